//! The page of all equilibria of a leaf, side by side.

use super::Viewed;
use super::data::{Leaf, View};
use crate::figure::drawing::Drawing;
use crate::report::Reported;
use crate::report::numbers::short;
use crate::report::words::equilibrium_of_index;
use crate::scenario::Scenario;
use crate::study::{All, Found};

/// More could not be distinguished side by side.
const MOST: usize = 24;

impl Viewed for All {
    fn fill(&self, view: &mut View) {
        view.kind = "equilibria";
        let count = self.found.len();
        view.verdict = match count {
            1 => "1 equilibrium".into(),
            _ => format!("{count} equilibria"),
        };
        if count > MOST {
            view.verdict += &format!(", the first {MOST} shown");
        }
        view.success = count > 0;
        let shown = self.found.iter().take(MOST).enumerate();
        view.leaves = shown
            .map(|(k, found)| leaf(k + 1, found, &view.drawn))
            .collect();
    }

    fn still(&self, scenario: &Scenario) -> Drawing {
        crate::figure::all(self, scenario)
    }
}

fn leaf(number: usize, found: &Found, drawn: &[usize]) -> Leaf {
    let leaf = &found.equilibrium;
    let kind = equilibrium_of_index(leaf.stability.negative_eigenvalues);
    let energy = short(leaf.energy.unwrap_or(f64::NAN));
    let label = format!("{number}. {kind}, energy {energy}");
    Leaf {
        summary: leaf.summary(),
        ..Leaf::full(label, &leaf.shape.stations, &leaf.shape.rods, drawn)
    }
}
