//! The figure of a check: the relaxed leaf as lines, the boundary-value
//! solution as dots, and how far they are apart.

use glam::DVec2;

use super::Pictured;
use super::colors::{INK, NOTE, vein_color};
use super::differences;
use super::drawing::{Anchor, Drawing, HALF_CAPITAL, Stroke};
use super::font::Font;
use super::header::{self, HEADER, NOTE_BASE};
use super::markers::dot;
use super::page::{LEFT, Panels, RIGHT, TEXT_SIZE, WIDTH};
use super::veins::Veins;
use crate::report::words::{equilibrium_of_index, headline, verdict};
use crate::study::{Check, Verdict};

/// Height of a line of text.
const LINE: f64 = 19.0;

impl Pictured for Check {
    const SVG: &'static str = "check.svg";
    const PNG: &'static str = "check.png";

    fn draw(&self) -> Drawing {
        let mut veins = Veins::of(&self.relaxed);
        if let Some(shot) = self.solution() {
            veins.dot(&shot.solution.rods);
        }
        let title = format!("{}: {}", self.relaxed.scenario, headline(&self.verdict));
        let reason = reason(self);
        let key_line = NOTE_BASE + LINE * (reason.len() + 1) as f64;
        let panels = Panels::below(HEADER - NOTE_BASE + key_line, &veins);
        let compared = !self.along.is_empty();
        let below = if compared { differences::HEIGHT } else { 0.0 };
        let mut drawing = Drawing {
            width: WIDTH,
            height: (panels.end() + below).ceil(),
            description: title.clone(),
            marks: Vec::new(),
        };
        drawing.group("header", |page| {
            header::draw(page, &title, &notes(self, &veins), &veins);
            for (line, text) in reason.iter().enumerate() {
                let base = DVec2::new(LEFT, NOTE_BASE + LINE * (line + 1) as f64);
                page.label(base, text, TEXT_SIZE, Anchor::Start, INK);
            }
            key(page, self, &veins, key_line);
        });
        panels.draw(&mut drawing, &veins);
        if compared {
            drawing.group("differences", |page| {
                differences::draw(page, self, veins.unit, panels.end())
            });
        }
        drawing
    }
}

fn notes(check: &Check, veins: &Veins) -> Vec<String> {
    let mut notes = vec![format!("N = {}", veins.count)];
    let relaxed = verdict(&check.relaxed);
    match check.solution() {
        Some(shot) => {
            let shot = equilibrium_of_index(shot.negative_eigenvalues);
            if shot == relaxed {
                notes.push(format!("both: {shot}"));
            } else {
                notes.push(format!("relaxed: {relaxed}"));
                notes.push(format!("by shooting: {shot}"));
            }
        }
        None => notes.push(format!("relaxed: {relaxed}")),
    }
    notes.extend(veins.notes());
    notes
}

/// Why the solutions could not be compared, in lines.
fn reason(check: &Check) -> Vec<String> {
    match &check.verdict {
        Verdict::NotCompared(reason) => {
            Font::embedded().wrapped(reason, TEXT_SIZE, WIDTH - LEFT - RIGHT)
        }
        _ => Vec::new(),
    }
}

/// Which solution is drawn how.
fn key(page: &mut Drawing, check: &Check, veins: &Veins, base: f64) {
    const SWATCH: f64 = 26.0;
    let font = Font::embedded();
    let middle = base - HALF_CAPITAL * TEXT_SIZE;
    let mut x = LEFT;
    let start = DVec2::new(x, middle);
    let stroke = Stroke::new(vein_color(0.3), veins.line_width());
    page.line(start, start + DVec2::new(SWATCH, 0.0), stroke);
    let say = |page: &mut Drawing, x: f64, text: &str| {
        let base = DVec2::new(x, base);
        page.label(base, text, TEXT_SIZE, Anchor::Start, NOTE);
        x + font.width(text, TEXT_SIZE)
    };
    x = say(page, x + SWATCH + 7.0, "relaxed");
    if check.solution().is_some() {
        x += 24.0;
        dot(page, DVec2::new(x, middle), 2.0);
        say(page, x + 9.0, "boundary-value solution by shooting");
    }
}

#[cfg(test)]
mod tests {
    use std::io;

    use glam::DVec3;

    use super::*;
    use crate::figure::{FigurePng, FigureSvg};
    use crate::report::{Format, sample};

    fn svg(check: &Check) -> String {
        let mut bytes = Vec::new();
        FigureSvg.write(check, &mut bytes).unwrap();
        String::from_utf8(bytes).unwrap()
    }

    #[test]
    fn the_verdict_is_the_title() {
        for (angle, title) in [
            (0.0, "fan: both methods agree"),
            (0.1, "fan: the methods differ"),
        ] {
            let svg = svg(&sample::check(5, 8, angle));
            assert!(svg.contains(&format!("<title>{title}</title>")), "{title}");
            assert!(svg.contains(&format!(">{title}</text>")), "{title}");
            for quantity in ["position", "rotation", "force", "moment"] {
                assert!(svg.contains(quantity), "{quantity}");
            }
            assert_eq!(svg.matches("<g ").count(), svg.matches("</g>").count());
            assert!(!svg.contains("NaN") && !svg.contains("inf"));
        }
    }

    #[test]
    fn without_a_second_solution_the_reason_is_told() {
        let mut check = sample::check(5, 8, 0.0);
        let reason = "the relaxation did not come to rest: ".repeat(6);
        check.shot = None;
        check.along.clear();
        check.difference = None;
        check.verdict = Verdict::NotCompared(reason);
        let svg = svg(&check);
        assert!(svg.contains("could not be compared"));
        assert_eq!(svg.matches("rest:").count(), 6);
        assert!(!svg.contains("id=\"differences\""));
    }

    #[test]
    fn numbers_gone_wild_are_drawn_without_a_panic() {
        for wild in [f64::NAN, f64::INFINITY, 1e300, 1e-310, -1.0, 0.0] {
            let mut check = sample::check(3, 8, 0.0);
            for difference in &mut check.along {
                difference.position = wild;
                difference.moment = wild;
            }
            check.along[3].force = wild;
            if let Some(Ok(shot)) = &mut check.shot {
                shot.solution.rods[1].nodes[4].position = DVec3::splat(wild);
            }
            svg(&check);
            let wildest = check.along[0];
            check.along.fill(wildest);
            check.relaxed.accuracy.tolerance = wild;
            let svg = svg(&check);
            assert!(!svg.contains("NaN") && !svg.contains("inf"), "{wild}");
        }
    }

    #[test]
    fn the_picture_is_as_wide_as_that_of_a_leaf() {
        let mut bytes = Vec::new();
        FigurePng
            .write(&sample::check(21, 32, 0.1), &mut bytes)
            .unwrap();
        let reader = png::Decoder::new(io::Cursor::new(&bytes)).read_info();
        assert_eq!(reader.unwrap().info().width, 1800);
    }
}
