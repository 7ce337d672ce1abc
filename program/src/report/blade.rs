//! A blade in the report of a relaxation.

use crate::report::numbers::{bound_of_positions, brief, in_unit};
use leafdyn::relax::BladeReport;
use leafdyn::scenario::Units;
use leafdyn::scenario::units::{COUPLE_STIFFNESS, FORCE, FORCE_PER_AREA, LENGTH, MASS};

/// The lines about a blade.
pub fn blade_lines(blade: &BladeReport, units: &Units) -> Vec<String> {
    let length = |it: f64| in_unit(brief(it), units, LENGTH);
    let stiffness = |it: f64| in_unit(brief(it), units, COUPLE_STIFFNESS);
    let mass = |it: f64| match units.grams() {
        Some(grams) => format!("; its mass is {} g", brief(grams * it)),
        None => format!("; its mass is {}", in_unit(brief(it), units, MASS)),
    };
    let mut lines = vec![format!(
        "at its widest, {}, its bending stiffness is {} and its torsional stiffness {}{}",
        length(blade.width),
        stiffness(blade.bending),
        stiffness(blade.torsion),
        blade.mass.map(mass).unwrap_or_default()
    )];
    let [a1, a2, a3] = blade.couple_stiffness.map(stiffness);
    let strip = length(blade.strip_width);
    lines.push(format!(
        "each vein there: a strip {strip} wide, torsion {a1}, bending_2 {a2}, bending_3 {a3}"
    ));
    if let Some([along, across, normal, fold]) = blade.tissue {
        let stiffness = |it: f64| in_unit(brief(it), units, FORCE_PER_AREA);
        let [along, across, normal] = [along, across, normal].map(stiffness);
        let fold = in_unit(brief(fold), units, FORCE);
        lines.push(format!(
            "tissue there: along {along}, across {across}, normal {normal}, fold {fold}"
        ));
    }
    if let Some(least) = blade.least_width {
        let effect = blade.least_width_effect;
        let effect = effect.map(|it| bound_of_positions(it, units));
        let effect = effect.map(|it| format!("; half of that moves it by {it}"));
        lines.push(format!(
            "where narrower than {} it is as stiff as there{}",
            length(least),
            effect.unwrap_or_default()
        ));
    }
    if let Some(fewer) = blade.half_as_many {
        let (rods, apart) = (fewer.rods, bound_of_positions(fewer.difference, units));
        lines.push(format!(
            "with {rods} veins in place of these it differs by {apart}"
        ));
    }
    lines
}
