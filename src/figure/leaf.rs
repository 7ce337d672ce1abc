//! The figure of a leaf at rest.

use super::Pictured;
use super::drawing::Drawing;
use super::header::{self, HEADER};
use super::page::{Panels, WIDTH};
use super::veins::Veins;
use crate::relax::Equilibrium;
use crate::report::numbers::power_of_ten;
use crate::report::words::{shooting, verdict};

impl Pictured for Equilibrium {
    const SVG: &'static str = "figure.svg";
    const PNG: &'static str = "figure.png";

    fn draw(&self) -> Drawing {
        let veins = Veins::of(self);
        let panels = Panels::below(HEADER, &veins);
        let mut drawing = Drawing {
            width: WIDTH,
            height: panels.end().ceil(),
            description: format!("{}: {}", self.scenario, verdict(self)),
            marks: Vec::new(),
        };
        drawing.group("header", |page| {
            header::draw(page, &self.scenario, &notes(self, &veins), &veins)
        });
        panels.draw(&mut drawing, &veins);
        drawing
    }
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

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::report::sample;

    #[test]
    fn shapes_gone_wild_are_drawn_without_a_panic() {
        for wild in [f64::NAN, f64::INFINITY, 1e300, -1e-300] {
            let mut leaf = sample::fan(3, 8);
            for curve in &mut leaf.shape.curves {
                curve[4].z = wild;
            }
            leaf.tips[0].x = wild;
            leaf.draw();
            leaf.shape
                .curves
                .iter_mut()
                .for_each(|curve| curve.fill(DVec3::splat(wild)));
            leaf.draw();
            leaf.shape.curves.clear();
            leaf.draw();
        }
    }
}
