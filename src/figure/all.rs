//! All equilibria of a leaf that were found, lowest energy first.

use super::drawing::Drawing;
use super::page::new_page;
use super::setting::Setting;
use super::small::{SIDE, SmallPanels};
use super::veins::Veins;
use crate::report::words::stable_or_index;
use crate::scenario::Scenario;
use crate::study::All;

/// Most equilibria drawn.
const MOST: usize = 24;

pub fn draw(all: &All, scenario: &Scenario) -> Drawing {
    let setting = Setting::of(scenario);
    let shown = &all.found[..all.found.len().min(MOST)];
    let shapes = shown.iter().map(|found| Veins::of(&found.equilibrium));
    let shapes: Vec<Veins> = shapes.collect();
    let panels = SmallPanels::holding(shapes.iter(), shown.len(), &setting);
    let name = format!("{}: equilibria, lowest energy first", all.scenario);
    let count = all.found.len();
    let mut notes = vec![format!("{count} found from {} starts", all.starts)];
    if count > MOST {
        notes.push(format!("the first {MOST} drawn"));
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
