//! All shapes of a leaf that were found, lowest energy first.

use super::drawing::Drawing;
use super::page::{new_page, title};
use super::small::{SIDE, SmallPanels};
use super::veins::Veins;
use crate::study::All;

/// Shapes drawn.
const MOST: usize = 24;

/// Draws the whole page.
pub fn draw(all: &All) -> Drawing {
    let shown = &all.found[..all.found.len().min(MOST)];
    let shapes: Vec<Veins> = shown
        .iter()
        .map(|found| Veins::of(&found.equilibrium))
        .collect();
    let panels = SmallPanels::holding(shapes.iter(), shown.len());
    let name = format!("{}: equilibria, lowest energy first", all.scenario);
    let mut notes = vec![format!(
        "{} found from {} starts",
        all.found.len(),
        all.starts
    )];
    if all.found.len() > MOST {
        notes.push(format!("the first {MOST} drawn"));
    }
    let mut drawing = new_page(SIDE, &name, &notes, shapes.first());
    drawing.height = panels.end();
    for (index, (found, veins)) in shown.iter().zip(&shapes).enumerate() {
        let stability = match found.equilibrium.stability.negative_eigenvalues {
            Some(0) => "stable".into(),
            Some(index) => format!("index {index}"),
            None => String::new(),
        };
        let energy = found.equilibrium.energy.unwrap_or(f64::NAN);
        let text = format!("energy {energy:.7}, {stability}");
        drawing.group("leaf", |page| {
            let corner = panels.cell(index).corner;
            title(page, corner, &(index + 1).to_string(), &text);
            panels.draw(page, index, veins, |_, _, _| ());
        });
    }
    drawing
}
