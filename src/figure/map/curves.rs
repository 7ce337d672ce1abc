//! Results of one method along one axis, as curves below its strip of outcomes: the tip
//! and the energy or, where waves are shown, the waves and the twist.

use super::panel::Varied;
use crate::figure::kit::*;
use crate::study::{Map, MapRow, MapShow};

/// Smaller variations are rounding.
const ROUNDING: f64 = 1e-9;
const TALL: f64 = 260.0;
const LOW: f64 = 150.0;

/// A curve: its name, its colour, and its value in a row.
type Quantity<'a> = (&'a str, Color, fn(&MapRow) -> Option<f64>);

/// The titles of the panels, the names of their axes, and their curves.
fn panels(map: &Map) -> Vec<(&str, String, Vec<Quantity<'_>>)> {
    let units = &map.request.base.scenario().units;
    let length = units.length.as_deref();
    match map.show {
        MapShow::Outcomes => vec![
            (
                "where the tip is",
                with_unit("tip", length),
                vec![
                    ("x", CURVES[0], |row| row.tip_x),
                    ("y", CURVES[1], |row| row.tip_y),
                    ("z", CURVES[2], |row| row.tip_z),
                ],
            ),
            (
                "energy",
                with_unit("energy", units.energy().as_deref()),
                vec![("energy", CURVES[3], |row| row.energy)],
            ),
        ],
        MapShow::Waves => vec![
            (
                "waves along the margins, of stable leaves",
                "waves".into(),
                vec![("waves", CURVES[0], MapRow::stable_waves)],
            ),
            (
                "their amplitude",
                with_unit("amplitude", Some("L")),
                vec![("amplitude", CURVES[1], |row| {
                    row.stable_waves().and(row.margin_amplitude)
                })],
            ),
            (
                "mean twist of the veins",
                with_unit("twist", Some("rad")),
                vec![("twist", CURVES[3], |row| row.twist)],
            ),
        ],
    }
}

/// Draws the curves below `start`, as wide as the strip. Returns where they end.
pub fn draw(page: &mut Drawing, map: &Map, x: &Varied, strip: Cell, start: f64) -> f64 {
    let values = &map.request.axes[0].values;
    let mut top = start;
    for (what, name, curves) in panels(map) {
        let height = if curves.len() > 1 { TALL } else { LOW };
        let cell = Cell::new(
            DVec2::new(strip.corner.x, top + PANEL_TITLE),
            DVec2::new(strip.size.x, height),
        );
        let lines = curves.iter().map(|(_, _, of)| {
            let mut line: Vec<(f64, f64)> = values.iter().map(|&x| (x, f64::NAN)).collect();
            for row in &map.rows {
                line[row.cell].1 = of(row).unwrap_or(f64::NAN);
            }
            line
        });
        let lines: Vec<_> = lines.collect();
        let known = lines.iter().flatten().map(|point| point.1);
        let up = Axis::holding(&name, known.filter(|value| value.is_finite())).at_least(ROUNDING);
        page.group("curves", |page| {
            let axes = Axes::titled(page, cell, ["", what], x.axis.clone(), up);
            let mut key = Key::right_of(cell);
            for ((name, color, _), line) in curves.iter().zip(lines) {
                axes.curve(page, &line, Stroke::new(*color, 1.6));
                axes.markers(page, line, Marker::Dot, *color);
                key.marked_line(page, name, "", *color);
            }
        });
        top = cell.end().y + PANEL_AXIS;
    }
    top
}
