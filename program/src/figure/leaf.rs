//! A leaf at rest, all equilibria of a leaf, and how far its tip moves when a number changes.

use super::panels::Panels;
use crate::figure::axes::Axes;
use crate::figure::axis::{Axis, Ticks};
use crate::figure::drawing::{Anchor, BLUE, Drawing, INK, rectangle};
use crate::figure::layout::{Cell, HEADER, LEFT, PANEL_AXIS, PANEL_TITLE, RIGHT, TICK_SIZE, WIDTH};
use crate::figure::page::new_page;
use crate::figure::setting::Setting;
use crate::figure::small::{SIDE, SmallPanels};
use crate::figure::veins::Veins;
use crate::report::numbers::power_of_ten;
use crate::report::words::{shooting, stable_or_index, verdict};
use glam::DVec2;
use leafdyn::relax::{Equilibrium, Sensitivity};
use leafdyn::scenario::Scenario;
use leafdyn::study::Equilibria;

pub fn draw(leaf: &Equilibrium, scenario: &Scenario) -> Drawing {
    let setting = Setting::of(scenario);
    let veins = Veins::of(leaf, scenario);
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

/// Room left of the panel, for the keys.
const NAMES: f64 = 190.0;
const ROW: f64 = 22.0;
const BAR: f64 = 12.0;
const BOTTOM: f64 = 4.0;
const MOST_ROWS: usize = 40;
const FEWEST_DECADES: f64 = 2.0;

/// How far the tip of a leaf moves when a number changes by 1 %, largest first.
pub fn draw_sensitivity(leaf: &Equilibrium) -> Drawing {
    let found = leaf.sensitivities.as_deref().unwrap_or_default();
    let length = leaf.shape.longest();
    let change = |found: &Sensitivity| {
        let by = match found.value {
            0.0 => 1.0,
            value => 0.01 * value,
        };
        let moved = found.tips.iter().map(|tip| (*tip * by).length());
        moved.fold(0.0, f64::max) / length
    };
    let rows = found.iter().map(|it| (it.key.as_str(), change(it)));
    let mut rows: Vec<(&str, f64)> = rows.collect();
    rows.sort_by(|a, b| b.1.total_cmp(&a.1));
    rows.truncate(MOST_ROWS);
    let height = ROW * rows.len().max(1) as f64;
    let name = format!("{}: what each number does to the tip", leaf.scenario);
    let notes = ["a number that is zero: one of its units".to_string()];
    let mut page = new_page(LEFT, &name, &notes, None);
    page.height = HEADER + PANEL_TITLE + height + PANEL_AXIS + BOTTOM;
    let cell = Cell::new(
        DVec2::new(LEFT + NAMES, HEADER + PANEL_TITLE),
        DVec2::new(WIDTH - LEFT - RIGHT - NAMES, height),
    );
    let values = rows.iter().map(|row| row.1);
    let name = "displacement of the tip by 1 %, in L";
    let across = Axis::logarithmic(name, values, FEWEST_DECADES);
    let up = Axis {
        ticks: Ticks::At(Vec::new()),
        labelled: false,
        ..Axis::linear("", 0.0, 1.0)
    };
    page.group("changes", |page| {
        let what = "by a hundredth of each number";
        let axes = Axes::titled(page, cell, ["", what], across, up);
        for (k, (key, value)) in rows.iter().enumerate() {
            let middle = cell.corner.y + ROW * (k as f64 + 0.5);
            let at = DVec2::new(cell.corner.x - 8.0, middle);
            page.centered_label(at, key, TICK_SIZE, Anchor::End, INK);
            let fraction = axes.across.fraction(*value);
            if fraction.is_finite() && fraction > 0.0 {
                let corner = DVec2::new(cell.corner.x, middle - 0.5 * BAR);
                let size = DVec2::new(fraction.min(1.0) * cell.size.x, BAR);
                page.shape(rectangle(corner, size), BLUE, None);
            }
        }
    });
    page
}
