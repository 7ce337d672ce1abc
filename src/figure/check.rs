//! The figure of a check: the relaxed leaf as lines, the boundary-value
//! solution as dots, and their differences.

use glam::DVec2;

use super::differences;
use super::drawing::{Anchor, Drawing, INK, Stroke, vein_color};
use super::font::Font;
use super::markers::dot;
use super::page::{HEADER, KeyRows, LEFT, NOTE_BASE, RIGHT, TEXT_SIZE, WIDTH, header};
use super::panels::Panels;
use super::setting::Setting;
use super::veins::Veins;
use crate::report::words::{equilibrium_of_index, headline, verdict};
use crate::scenario::Scenario;
use crate::study::{Check, Verdict};

const LINE: f64 = 19.0;

pub fn draw(check: &Check, scenario: &Scenario) -> Drawing {
    let setting = Setting::of(scenario);
    let mut veins = Veins::of(&check.relaxed);
    if let Some(solution) = check.solution() {
        veins.add_dots(&solution.rods);
    }
    let title = format!("{}: {}", check.relaxed.scenario, headline(&check.verdict));
    // Why the solutions could not be compared.
    let reason = match &check.verdict {
        Verdict::NotCompared(why) => Font::embedded().wrapped(why, TEXT_SIZE, WIDTH - LEFT - RIGHT),
        _ => Vec::new(),
    };
    let key_line = NOTE_BASE + LINE * (reason.len() + 1) as f64;
    let panels = Panels::below(HEADER - NOTE_BASE + key_line, &veins);
    let compared = !check.along.is_empty();
    let below = if compared { differences::HEIGHT } else { 0.0 };
    let mut drawing = Drawing::new(WIDTH, &title);
    drawing.height = (panels.end() + below).ceil();
    drawing.group("header", |page| {
        let notes = notes(check, &veins, &setting);
        header(page, LEFT, &title, &notes, Some(&veins));
        for (line, text) in reason.iter().enumerate() {
            let base = DVec2::new(LEFT, NOTE_BASE + LINE * (line + 1) as f64);
            page.label(base, text, TEXT_SIZE, Anchor::Start, INK);
        }
        let mut key = KeyRows::at(LEFT, key_line, 26.0);
        let stroke = Stroke::new(vein_color(0.3), veins.line_width());
        key.entry(page, "relaxed", |page, cell| cell.line(page, stroke));
        if check.solution().is_some() {
            key.entry(page, "boundary-value solution by shooting", |page, cell| {
                dot(page, cell.middle(), 2.0);
            });
        }
    });
    panels.draw(&mut drawing, &veins, &setting);
    if compared {
        drawing.group("differences", |page| {
            differences::draw(page, check, veins.unit, panels.end());
        });
    }
    drawing
}

fn notes(check: &Check, veins: &Veins, setting: &Setting) -> Vec<String> {
    let mut notes = vec![format!("N = {}", veins.count)];
    let relaxed = verdict(&check.relaxed);
    match &check.shot {
        Some(shot) if shot.found.is_ok() => {
            let shot = equilibrium_of_index(shot.negative_eigenvalues);
            if shot == relaxed {
                notes.push(format!("both: {shot}"));
            } else {
                notes.push(format!("relaxed: {relaxed}"));
                notes.push(format!("by shooting: {shot}"));
            }
        }
        _ => notes.push(format!("relaxed: {relaxed}")),
    }
    notes.extend(veins.notes(setting));
    notes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::svg::text;
    use crate::report::sample;

    fn svg(check: &Check) -> String {
        text(&draw(check, &sample::scenario("fan", 5)))
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
        }
    }

    #[test]
    fn without_a_second_solution_the_reason_is_given() {
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
}
