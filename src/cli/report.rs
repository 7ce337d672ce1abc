//! The summary of a relaxation that people read.

use std::path::Path;

use leafdyn::output::{model, shooting, verdict};
use leafdyn::relax::{Equilibrium, Method, Mode, Outcome};

use super::text::{
    bound, brief, decimals, eigenvalues, grids, lay_out, longest_rod, point, seconds, significant,
    veins, written,
};

/// Modes whose numbers are told.
const MODES_TOLD: usize = 6;

/// What was solved, what was found, how well, and where the files are.
pub fn report(equilibrium: &Equilibrium, folder: Option<&Path>) -> String {
    let mut lines = vec![("found", found(equilibrium))];
    if let Some(saddle) = &equilibrium.saddle {
        lines.push((
            "left",
            format!(
                "a saddle of index {} with energy {} and tip {}",
                saddle.negative_eigenvalues,
                significant(saddle.energy),
                point(saddle.tip.to_array(), decimals(equilibrium)),
            ),
        ));
    }
    // Where shooting came no further, the shape is not yet this leaf's: it has
    // no energy, and its tip says nothing.
    if equilibrium.energy.is_finite() {
        if let [tip] = equilibrium.tips.as_slice() {
            lines.push(("tip", point(tip.to_array(), decimals(equilibrium))));
        }
        lines.push(("energy", significant(equilibrium.energy)));
    }
    lines.push(("error", error(equilibrium)));
    if let Some(modes) = modes(equilibrium) {
        lines.push(("modes", modes));
    }
    if !equilibrium.segments.is_empty() {
        lines.push(("model", model(equilibrium)));
    }
    lines.push(("work", work(equilibrium)));
    if let Some(folder) = folder {
        lines.push(("written", written(equilibrium, folder)));
    }
    if let Some(remark) = &equilibrium.remark {
        lines.push(("remark", remark.clone()));
    }
    let heading = format!(
        "{}: {}, method {}",
        equilibrium.scenario,
        veins(equilibrium),
        equilibrium.method
    );
    lay_out(&heading, &lines)
}

/// The kind of equilibrium, or how far from one.
pub fn found(equilibrium: &Equilibrium) -> String {
    let verdict = verdict(equilibrium);
    match equilibrium.outcome {
        Outcome::NotAtRest | Outcome::Diverged | Outcome::Singular
            if equilibrium.residual.is_finite() =>
        {
            format!("{verdict} (residual {:.1e})", equilibrium.residual)
        }
        _ => verdict + &eigenvalues(equilibrium.negative_eigenvalues),
    }
}

fn error(equilibrium: &Equilibrium) -> String {
    let source = match equilibrium.intervals {
        Some(count) => format!("by {}", shooting(count)),
        None => format!("from {}", grids(equilibrium)),
    };
    let wanted = bound(equilibrium.tolerance * longest_rod(equilibrium));
    match equilibrium.error_estimate {
        Some(error) => format!(
            "positions within {} (wanted {wanted}), {source}",
            bound(error)
        ),
        None => match equilibrium.segments.as_slice() {
            [segments] => format!("not estimated on a single grid of {segments} segments a vein"),
            _ => "not known".into(),
        },
    }
}

/// The lowest eigenvalues, as growth rates and frequencies.
fn modes(equilibrium: &Equilibrium) -> Option<String> {
    let Some(modes) = &equilibrium.modes else {
        return equilibrium.mode_shapes.then(|| "not known".into());
    };
    let unstable = |mode: &&Mode| mode.growth().is_some() && !mode.is_neutral();
    let list = |values: &mut dyn Iterator<Item = f64>| {
        let told: Vec<String> = values.take(MODES_TOLD).map(brief).collect();
        told.join(", ")
    };
    let growth = list(&mut modes.iter().filter(unstable).filter_map(Mode::growth));
    let frequencies = modes.iter().filter(|mode| !unstable(mode));
    let frequencies = list(&mut frequencies.map(|mode| match mode.is_neutral() {
        true => 0.0,
        false => mode.frequency().unwrap_or_default(),
    }));
    let phrases = [
        ("growth rates", growth),
        ("lowest frequencies", frequencies),
    ];
    let phrases = phrases.iter().filter(|(_, list)| !list.is_empty());
    let told: Vec<String> = phrases
        .map(|(what, list)| format!("{what} {list}"))
        .collect();
    (!told.is_empty()).then(|| told.join("; "))
}

fn work(equilibrium: &Equilibrium) -> String {
    let work = equilibrium.work;
    let (steps, factorizations, evaluations) =
        (work.steps, work.factorizations, work.force_evaluations);
    let time = seconds(equilibrium.wall_seconds);
    if equilibrium.method == Method::Shooting.name() {
        return format!(
            "{steps} corrections, {factorizations} linearisations, {evaluations} evaluations of all slopes in {time}"
        );
    }
    format!(
        "{steps} steps, {factorizations} factorisations, {evaluations} force evaluations in {time}"
    )
}
