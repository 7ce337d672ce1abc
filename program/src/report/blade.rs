//! A blade in the report of a relaxation.

use crate::report::numbers::{bound, brief};
use leafdyn::relax::BladeReport;

/// The lines about a blade.
pub fn blade_lines(blade: &BladeReport) -> Vec<String> {
    let BladeReport {
        width,
        strip_width,
        bending,
        torsion,
        couple_stiffness: [a1, a2, a3],
        ..
    } = blade;
    let [width, strip_width, bending, torsion] =
        [width, strip_width, bending, torsion].map(|it| brief(*it));
    let mass = blade.mass.map(|mass| format!("; mass {}", brief(mass)));
    let mut lines = vec![format!(
        "at its widest, {width}, it bends as {bending} and twists as {torsion}{}",
        mass.unwrap_or_default()
    )];
    let [a1, a2, a3] = [a1, a2, a3].map(|it| brief(*it));
    lines.push(format!(
        "each vein there: a strip {strip_width} wide, torsion {a1}, bending_2 {a2}, bending_3 {a3}"
    ));
    if let Some(tissue) = blade.tissue {
        let [along, across, normal, fold] = tissue.map(brief);
        lines.push(format!(
            "tissue there: along {along}, across {across}, normal {normal}, fold {fold}"
        ));
    }
    if let Some(least) = blade.least_width {
        let least = brief(least);
        let effect = match blade.least_width_effect {
            Some(effect) => format!("; half of that moves it by {}", bound(effect)),
            None => String::new(),
        };
        lines.push(format!(
            "where narrower than {least} it is as stiff as there{effect}"
        ));
    }
    if let Some(fewer) = blade.half_as_many {
        let (rods, apart) = (fewer.rods, bound(fewer.difference));
        lines.push(format!(
            "with {rods} veins in place of these it differs by {apart}"
        ));
    }
    lines
}
