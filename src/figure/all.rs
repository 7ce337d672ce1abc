//! All shapes of a leaf that were found, lowest energy first.

use super::Pictured;
use super::drawing::Drawing;
use super::header::{self, HEADER};
use super::page::WIDTH;
use super::small::{SmallLeaf, small_height, small_leaves};
use crate::study::All;

/// Shapes drawn.
const MOST: usize = 24;

const BOTTOM: f64 = 10.0;

impl Pictured for All {
    const SVG: &'static str = "equilibria.svg";
    const PNG: &'static str = "equilibria.png";

    fn draw(&self) -> Drawing {
        let leaf = |found: &'_ crate::study::Found| {
            let index = match found.equilibrium.stability.negative_eigenvalues {
                Some(0) => "stable".into(),
                Some(index) => format!("index {index}"),
                None => String::new(),
            };
            format!(
                "energy {:.7}, {index}",
                found.equilibrium.energy.unwrap_or(f64::NAN)
            )
        };
        let shown: Vec<SmallLeaf> = (self.found.iter().take(MOST))
            .map(|found| SmallLeaf {
                curves: &found.equilibrium.shape.curves,
                tips: &found.equilibrium.tips,
                title: leaf(found),
            })
            .collect();
        let name = format!("{}: equilibria, lowest energy first", self.scenario);
        let mut drawing = Drawing {
            width: WIDTH,
            height: HEADER + small_height(shown.len()) + BOTTOM,
            description: name.clone(),
            marks: Vec::new(),
        };
        let mut notes = vec![format!(
            "{} found from {} starts",
            self.found.len(),
            self.starts
        )];
        if self.found.len() > MOST {
            notes.push(format!("the first {MOST} drawn"));
        }
        drawing.group("header", |page| {
            header::draw_without_key(page, &name, &notes);
        });
        drawing.group("leaves", |page| small_leaves(page, &shown, HEADER));
        drawing
    }
}
