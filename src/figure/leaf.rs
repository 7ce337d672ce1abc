//! A leaf at rest.

use super::drawing::Drawing;
use super::page::{HEADER, LEFT, new_page};
use super::panels::Panels;
use super::veins::Veins;
use crate::relax::Equilibrium;
use crate::report::numbers::power_of_ten;
use crate::report::words::{shooting, verdict};

pub fn draw(leaf: &Equilibrium) -> Drawing {
    let veins = Veins::of(leaf);
    let panels = Panels::below(HEADER, &veins);
    let mut drawing = new_page(LEFT, &leaf.scenario, &notes(leaf, &veins), Some(&veins));
    drawing.description = format!("{}: {}", leaf.scenario, verdict(leaf));
    drawing.height = panels.end().ceil();
    panels.draw(&mut drawing, &veins);
    drawing
}

fn notes(equilibrium: &Equilibrium, veins: &Veins) -> Vec<String> {
    let mut notes = vec![format!("N = {}", veins.count), verdict(equilibrium)];
    match equilibrium.accuracy.intervals {
        Some(count) => notes.push(format!("by {}", shooting(count))),
        None if equilibrium.method.is_shooting() => {
            notes.push("shown is how far shooting came".into());
        }
        None => (),
    }
    if let Some(error) = equilibrium.accuracy.error_estimate {
        let bound = power_of_ten(error / veins.unit);
        notes.push(format!("error of positions ≤ {bound} L"));
    }
    notes.extend(veins.notes());
    notes
}
