//! The page of a leaf at rest, with its modes.

use glam::DVec3;

use super::Viewed;
use super::data::{Leaf, ModeShape, View, vectors};
use crate::figure::drawing::Drawing;
use crate::relax::{Equilibrium, Mode};
use crate::report::numbers::short;
use crate::report::words::verdict;
use crate::scenario::Scenario;

impl Viewed for Equilibrium {
    fn fill(&self, view: &mut View) {
        view.verdict = verdict(self);
        view.success = self.outcome.is_success();
        let shape = &self.shape;
        let leaf = Leaf::full("at rest".into(), &shape.stations, &shape.rods, &view.drawn);
        view.leaves.push(leaf);
        if self.stability.mode_shapes {
            let modes = self.stability.modes.iter().flatten().enumerate();
            view.modes = modes
                .map(|(k, mode)| mode_shape(self, k + 1, mode, &view.drawn))
                .collect();
        }
    }

    fn still(&self, scenario: &Scenario) -> Drawing {
        crate::figure::leaf(self, scenario)
    }
}

fn mode_shape(leaf: &Equilibrium, number: usize, mode: &Mode, drawn: &[usize]) -> ModeShape {
    let what = match (mode.is_neutral(), mode.growth()) {
        (true, _) => "neutral".into(),
        (_, Some(growth)) => format!("unstable, grows at {}", short(growth)),
        (_, None) => format!("ω = {}", short(mode.frequency().unwrap_or_default())),
    };
    let pick = |of: &[Vec<DVec3>]| {
        let chosen = drawn.iter().filter_map(|&number| of.get(number - 1));
        vectors(chosen.flatten().copied())
    };
    ModeShape {
        label: format!("mode {number}: {what}"),
        nodes: mode.displacement.first().map_or(0, Vec::len),
        rest: pick(&leaf.shape.curves),
        displacement: pick(&mode.displacement),
    }
}
