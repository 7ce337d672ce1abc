//! A leaf at rest.

use super::drawing::Drawing;
use super::page::{HEADER, LEFT, new_page};
use super::panels::Panels;
use super::setting::Setting;
use super::veins::Veins;
use crate::relax::Equilibrium;
use crate::report::numbers::power_of_ten;
use crate::report::words::{shooting, verdict};
use crate::scenario::Scenario;

pub fn draw(leaf: &Equilibrium, scenario: &Scenario) -> Drawing {
    let setting = Setting::of(scenario);
    let veins = Veins::of(leaf);
    let panels = Panels::below(HEADER, &veins);
    let notes = notes(leaf, &veins, &setting);
    let mut drawing = new_page(LEFT, &leaf.scenario, &notes, Some(&veins));
    drawing.description = format!("{}: {}", leaf.scenario, verdict(leaf));
    drawing.height = panels.end().ceil();
    panels.draw(&mut drawing, &veins, &setting);
    drawing
}

fn notes(equilibrium: &Equilibrium, veins: &Veins, setting: &Setting) -> Vec<String> {
    let mut notes = vec![format!("N = {}", veins.count), verdict(equilibrium)];
    match equilibrium.accuracy.intervals {
        Some(count) => notes.push(format!("by {}", shooting(count))),
        None if equilibrium.method.is_shooting() => {
            notes.push("shown is how far shooting came".into());
        }
        None => (),
    }
    if let Some(error) = equilibrium.accuracy.error_estimate {
        let (error, unit) = setting.in_unit(error / veins.unit);
        let error = power_of_ten(error);
        notes.push(format!("error of positions ≤ {error} {unit}"));
    }
    notes.extend(veins.notes(setting));
    notes
}
