//! The text report of a relaxation.

use crate::relax::{Equilibrium, Mode, Outcome, Sensitivity};
use crate::report::words::{shooting, verdict};

use super::numbers::{
    bound, brief, decimals, eigenvalues, grids, point, seconds, significant, veins,
};
use super::table::{Lines, labelled};
use super::{Reported, margin};

/// Most modes that are listed.
const MOST_MODES: usize = 6;

impl Reported for Equilibrium {
    fn heading(&self) -> String {
        let (name, veins) = (&self.scenario, veins(self));
        format!("{name}: {veins}, method {}", self.method)
    }

    fn lines(&self) -> Lines {
        let mut lines = vec![("found", found(self))];
        if let Some(saddle) = &self.stability.saddle {
            let (index, energy) = (saddle.negative_eigenvalues, significant(saddle.energy));
            let tip = point(saddle.tip.to_array(), decimals(self));
            let left = format!("a saddle of index {index} with energy {energy} and tip {tip}");
            lines.push(("left", left));
        }
        // Where shooting failed, the shape is not that of the leaf: it has no energy, and
        // its tip is meaningless.
        if let Some(energy) = self.energy.filter(|energy| energy.is_finite()) {
            if let [tip] = self.tips.as_slice() {
                lines.push(("tip", point(tip.to_array(), decimals(self))));
            }
            lines.push(("energy", significant(energy)));
        }
        if let Some(reaction) = &self.reaction {
            let force = reaction.force.to_array().map(significant).join(", ");
            lines.push(("reaction", format!("({force}) on the holder of the tip")));
        }
        lines.extend(waves(self).map(|waves| ("waves", waves)));
        lines.push(("error", error(self)));
        lines.extend(modes(self).map(|modes| ("modes", modes)));
        lines.extend(labelled("changes", changes(self)));
        let margin = self.margin.as_ref().map(margin::lines);
        lines.extend(labelled("margin", margin.unwrap_or_default()));
        if !self.accuracy.segments.is_empty() {
            lines.push(("model", self.model.description.clone()));
        }
        lines.push(("work", work(self)));
        lines
    }

    fn remarks(&self) -> Lines {
        let remark = labelled("remark", self.remark.clone());
        [remark, labelled("doubtful", self.doubts.clone())].concat()
    }
}

/// The kind of equilibrium, or the residual.
pub fn found(equilibrium: &Equilibrium) -> String {
    let verdict = verdict(equilibrium);
    let residual = equilibrium.accuracy.residual.filter(|it| it.is_finite());
    match (equilibrium.outcome, residual) {
        (Outcome::NotAtRest | Outcome::Diverged | Outcome::Singular, Some(residual)) => {
            format!("{verdict} (residual {residual:.1e})")
        }
        _ => verdict + &eigenvalues(equilibrium.stability.negative_eigenvalues),
    }
}

fn error(equilibrium: &Equilibrium) -> String {
    let source = match equilibrium.accuracy.intervals {
        Some(count) => format!("by {}", shooting(count)),
        None => format!("from {}", grids(equilibrium)),
    };
    let wanted = bound(equilibrium.accuracy.tolerance * equilibrium.shape.longest());
    match equilibrium.accuracy.error_estimate {
        Some(error) => {
            let error = bound(error);
            format!("positions within {error} (wanted {wanted}), {source}")
        }
        None => match equilibrium.accuracy.segments.as_slice() {
            [segments] => format!("not estimated on a single grid of {segments} segments a vein"),
            _ => "not known".into(),
        },
    }
}

/// The waves along the margins, if any vein has waves.
fn waves(equilibrium: &Equilibrium) -> Option<String> {
    let undulation = &equilibrium.undulation;
    let margin = undulation.margin()?;
    if undulation.veins.iter().all(|vein| vein.waves() == 0.0) {
        return None;
    }
    let load = match margin.tension < 0.0 {
        true => "compression",
        false => "tension",
    };
    let (predicted, number) = (margin.predicted_waves(), margin.load_number);
    let theory = format!("linear theory: {predicted:.1} at |T| L²/A2 = {number:.1} of {load}");
    let (waves, high) = (margin.waves(), margin.amplitude);
    Some(match margin.wavelength {
        Some(long) => {
            format!("{waves} along the margins, {high:.4} high and {long:.3} long; {theory}")
        }
        None => format!("none along the margins; {theory}"),
    })
}

/// The lowest eigenvalues, as growth rates and frequencies.
fn modes(equilibrium: &Equilibrium) -> Option<String> {
    let Some(modes) = &equilibrium.stability.modes else {
        let asked = equilibrium.stability.mode_shapes;
        return asked.then(|| "not known".into());
    };
    let unstable = |mode: &&Mode| mode.growth().is_some() && !mode.is_neutral();
    let list = |values: &mut dyn Iterator<Item = f64>| {
        let listed: Vec<String> = values.take(MOST_MODES).map(brief).collect();
        listed.join(", ")
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
    let phrases: Vec<String> = phrases
        .map(|(what, list)| format!("{what} {list}"))
        .collect();
    let one_grid = modes.iter().any(|mode| mode.error.is_none());
    let note = if one_grid { " (on one grid)" } else { "" };
    (!phrases.is_empty()).then(|| phrases.join("; ") + note)
}

/// How the tip moves when each number changes by 1 %, or by its unit if it is zero.
fn changes(equilibrium: &Equilibrium) -> Vec<String> {
    let change = |found: &Sensitivity| {
        let (by, what) = match found.value == 0.0 {
            true => (1.0, "one unit".into()),
            false => (0.01 * found.value, format!("1 % of {}", brief(found.value))),
        };
        let tips = found.tips.iter().map(|tip| (*tip * by).to_array());
        let tips = tips.map(|tip| format!("({})", tip.map(brief).join(", ")));
        let tips: Vec<String> = tips.take(1).collect();
        format!("{}: by {what} the tip moves {}", found.key, tips.join(""))
    };
    let found = equilibrium.sensitivities.as_deref().unwrap_or_default();
    found.iter().map(change).collect()
}

fn work(equilibrium: &Equilibrium) -> String {
    let work = equilibrium.work;
    let (steps, factorizations, evaluations) =
        (work.steps, work.factorizations, work.force_evaluations);
    let time = seconds(equilibrium.wall_seconds);
    if equilibrium.method.is_shooting() {
        return format!(
            "{steps} corrections, {factorizations} linearisations, {evaluations} evaluations of all slopes in {time}"
        );
    }
    format!(
        "{steps} steps, {factorizations} factorisations, {evaluations} force evaluations in {time}"
    )
}
