//! A leaf at rest, and all equilibria of a leaf.

use super::panels::Panels;
use super::rod;
use crate::figure::drawing::Drawing;
use crate::figure::layout::{HEADER, LEFT};
use crate::figure::page::new_page;
use crate::figure::setting::Setting;
use crate::figure::small::{SIDE, SmallPanels};
use crate::figure::veins::Veins;
use crate::report::numbers::power_of_ten;
use crate::report::words::{shooting, stable_or_index, verdict};
use leafdyn::relax::Equilibrium;
use leafdyn::scenario::Scenario;
use leafdyn::study::Equilibria;

pub fn draw(leaf: &Equilibrium, scenario: &Scenario) -> Drawing {
    let setting = Setting::of(scenario);
    let veins = Veins::of(leaf, scenario);
    let notes = notes(leaf, &veins, &setting);
    let mut drawing = match veins.count {
        1 => rod::draw(leaf, scenario, &veins, &setting, &notes),
        _ => {
            let panels = Panels::below(HEADER, &veins);
            let mut drawing = new_page(LEFT, &leaf.scenario, &notes, Some(&veins));
            drawing.height = panels.end().ceil();
            panels.draw(&mut drawing, &veins, &setting);
            drawing
        }
    };
    drawing.description = format!("{}: {}", leaf.scenario, verdict(leaf));
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
        let error = power_of_ten(setting.scale() * (error / veins.unit));
        notes.push(format!("error of positions ≤ {error} {}", setting.unit()));
    }
    notes.extend(veins.notes(setting));
    notes
}

/// Most equilibria drawn.
const MOST_EQUILIBRIA: usize = 24;

pub fn draw_equilibria(all: &Equilibria, scenario: &Scenario) -> Drawing {
    let setting = Setting::of(scenario);
    let shown = &all.found[..all.found.len().min(MOST_EQUILIBRIA)];
    let shapes = shown
        .iter()
        .map(|found| Veins::of(&found.equilibrium, scenario));
    let shapes: Vec<Veins> = shapes.collect();
    let panels = SmallPanels::holding(shapes.iter(), shown.len(), &setting, HEADER);
    let name = format!("{}: equilibria, lowest energy first", all.scenario);
    let count = all.found.len();
    let mut notes = vec![format!("{count} found from {} starts", all.starts)];
    if count > MOST_EQUILIBRIA {
        notes.push(format!("the first {MOST_EQUILIBRIA} drawn"));
    }
    let mut drawing = new_page(SIDE, &name, &notes, shapes.first());
    drawing.height = panels.end();
    for (index, (found, veins)) in shown.iter().zip(&shapes).enumerate() {
        let negative = found.equilibrium.stability.negative_eigenvalues;
        let stability = negative.map_or(String::new(), stable_or_index);
        let energy = found.equilibrium.energy.unwrap_or(f64::NAN);
        let text = format!("energy {energy:.7}, {stability}");
        drawing.group("leaf", |page| {
            panels.draw(page, index, veins, [&(index + 1).to_string(), &text]);
        });
    }
    drawing
}
