//! A moving leaf: its energies and the position of its tip over time, its shapes at several instants, and
//! a film as GIF in the same view.

use crate::figure::drawing::axes::{Axis, NamedCurve, PanelAxes};
use crate::figure::drawing::formats::rasterize;
use crate::figure::drawing::labels::{Legend, LegendRows, new_page};
use crate::figure::drawing::space::{
    BoxMargins, SMALL_LINE_WIDTH_FACTOR, SmallPanels, SpacePanel, ViewAngles, common_bounding_box,
};
use crate::figure::drawing::veins::DrawnVeins;
use crate::figure::drawing::{
    CURVE_COLORS, Color, Drawing, FONT_SIZE, NOTE_COLOR, PAGE, PageRectangle, PanelCaption,
    SECOND_SOLUTION_COLOR, Stroke, TEXT_COLOR, TextAnchor, WHITE, is_drawable, panel_letters,
    polyline_path, vein_color,
};
use crate::figure::scenario::{COORDINATE_NAMES, FigureSetting, name_with_unit};
use crate::report::numbers::{format_four_digits, number_in_unit};
use glam::{DVec2, DVec3};
use leafdyn::scenario::units::TIME;
use leafdyn::scenario::{Scenario, Units};
use leafdyn::simulate::{Energy, OutputSample, Record, ShapeSnapshot};
use rayon::prelude::*;
use std::collections::HashMap;
use std::io;
use std::io::Write;
use std::ops::Range;
use tiny_skia::Pixmap;

/// Heights of the panels over time, in pixels.
struct EnergyLayout {
    energies: f64,
    balance: f64,
    tip: f64,
    /// Gap above the lower panels, for the tick labels of the upper ones.
    between: f64,
    /// Width right of the panels, for the key.
    key: f64,
}

const ENERGY_LAYOUT: EnergyLayout = EnergyLayout {
    energies: 300.0,
    balance: 120.0,
    tip: 200.0,
    between: 30.0,
    key: 200.0,
};

pub fn header_notes(record: &Record) -> Vec<String> {
    let mut notes = vec![
        format!("N = {}", record.rods),
        format!("{} method", record.scheme),
        format!("{} segments a vein", record.segments),
    ];
    if record.stopped.is_some() {
        notes.push(format!("ended early: {}", record.outcome()));
    }
    notes
}

pub fn draw_energies(record: &Record, scenario: &Scenario) -> Drawing {
    let name = format!("{}: energy in time", record.scenario);
    let upper = PAGE.header + PAGE.panel_title;
    let lower = upper + ENERGY_LAYOUT.energies + ENERGY_LAYOUT.between + PAGE.panel_title;
    let mut drawing = new_page(PAGE.left_margin, &name, &header_notes(record), None);
    let lowest = lower + ENERGY_LAYOUT.balance + ENERGY_LAYOUT.between + PAGE.panel_title;
    drawing.height = lowest + ENERGY_LAYOUT.tip + PAGE.panel_axis + PAGE.bottom_margin;
    let end = match record.time {
        time if time > 0.0 => time,
        _ => record.duration,
    };
    let curves = energy_curves(record);
    let balance = &curves[curves.len() - 1];
    let values = curves.iter().flat_map(NamedCurve::ordinates);
    let unit = scenario.units.energy();
    let energy = name_with_unit("energy", unit.as_deref());
    let across = Axis::linear("", 0.0, end);
    let up = Axis::linear_covering(&energy, values.chain([0.0]));
    let cell = PageRectangle::left_of_legend(upper, ENERGY_LAYOUT.energies, ENERGY_LAYOUT.key);
    drawing.draw_group("energies", |page| {
        let what = "where the energy is";
        let axes = PanelAxes::draw_titled(page, cell, ["(a)", what], across.clone(), up);
        // In reverse, so that the balance, which should be zero, is below all others.
        for curve in curves.iter().rev() {
            axes.draw_curve(page, &curve.points, Stroke::new(curve.color, 1.6));
        }
        let mut key = Legend::right_of(cell);
        for curve in &curves {
            draw_legend_line(page, &mut key, curve);
        }
    });
    let cell = PageRectangle::left_of_legend(lower, ENERGY_LAYOUT.balance, ENERGY_LAYOUT.key);
    let name = name_with_unit("balance", unit.as_deref());
    let up = Axis::linear_covering(&name, balance.ordinates().chain([0.0]));
    drawing.draw_group("balance", |page| {
        let what =
            "its balance, which no motion changes, magnified: all energies less the work put in";
        let axes = PanelAxes::draw_titled(page, cell, ["(b)", what], across, up);
        axes.draw_curve(page, &balance.points, Stroke::new(TEXT_COLOR, 1.3));
    });
    let cell = PageRectangle::left_of_legend(lowest, ENERGY_LAYOUT.tip, ENERGY_LAYOUT.key);
    drawing.draw_group("tip", |page| {
        draw_tip_coordinates(page, record, &scenario.units, cell, end)
    });
    drawing
}

/// A tip that moves by a smaller part of its distance from the origin is drawn from where it began.
const SMALL_MOTION: f64 = 0.2;

/// Where the tip began, if its whole motion is small beside its coordinates, which would hide it.
pub fn small_motion_origin(moments: &[OutputSample]) -> Option<DVec3> {
    let start = moments.first()?.tip;
    let tips = || moments.iter().map(|moment| moment.tip);
    let moved = tips().fold(0.0, |most: f64, tip| most.max(tip.distance(start)));
    let farthest = tips().fold(0.0, |most: f64, tip| most.max(tip.length()));
    (moved > 0.0 && moved < SMALL_MOTION * farthest).then_some(start)
}

/// Draws the coordinates of the joint tip, or the means of free ones.
fn draw_tip_coordinates(
    page: &mut Drawing,
    record: &Record,
    units: &Units,
    cell: PageRectangle,
    end: f64,
) {
    let origin = small_motion_origin(&record.moments);
    let start = origin.unwrap_or_default();
    let coordinate = |axis: usize| NamedCurve {
        name: COORDINATE_NAMES[axis],
        color: CURVE_COLORS[axis],
        points: (record.moments.iter())
            .map(|moment| (moment.time, (moment.tip - start)[axis]))
            .collect(),
    };
    let curves = [0, 1, 2].map(coordinate);
    let across = match units.time.as_deref() {
        None => "time, in the scenario's unit".into(),
        unit => name_with_unit("time", unit),
    };
    let across = Axis::linear(&across, 0.0, end);
    let name = name_with_unit("tip", units.length.as_deref());
    let up = Axis::linear_covering(
        &name,
        curves.iter().flat_map(NamedCurve::ordinates).chain([0.0]),
    );
    let what = match (record.joined, origin) {
        (true, None) => "where the tip is",
        (true, Some(_)) => "how far the tip is from where it began",
        (false, None) => "where the tips are, in the mean",
        (false, Some(_)) => "how far the tips are from where they began, in the mean",
    };
    let axes = PanelAxes::draw_titled(page, cell, ["(c)", what], across, up);
    let mut key = Legend::right_of(cell);
    for curve in &curves {
        axes.draw_curve(page, &curve.points, Stroke::new(curve.color, 1.6));
        draw_legend_line(page, &mut key, curve);
    }
}

/// Draws the line of a curve in the key, with its last value.
fn draw_legend_line(page: &mut Drawing, key: &mut Legend, curve: &NamedCurve) {
    let last = curve.points.last().map_or(0.0, |point| point.1);
    let note = format!("at the end {}", format_four_digits(last));
    key.add_line(page, curve.name, &note, Stroke::new(curve.color, 1.6));
}

/// All energies except those that are always zero; their balance last.
fn energy_curves(record: &Record) -> Vec<NamedCurve> {
    let first = record.moments.first().map(|moment| moment.energy);
    let first = first.unwrap_or_default();
    let curve = |name, color, value: &dyn Fn(&Energy) -> f64| NamedCurve {
        name,
        color,
        points: (record.moments.iter())
            .map(|moment| (moment.time, value(&moment.energy)))
            .collect(),
    };
    let mut curves = vec![
        curve("kinetic", CURVE_COLORS[0], &|e| e.kinetic),
        curve("elastic and coupling", CURVE_COLORS[1], &|e| {
            e.elastic + e.coupling
        }),
        curve("potential, from the start", CURVE_COLORS[2], &|e| {
            e.potential - first.potential
        }),
        curve("dissipated", CURVE_COLORS[3], &|e| e.dissipated),
        curve("work put in", CURVE_COLORS[4], &|e| e.work),
    ];
    curves.retain(|curve| curve.ordinates().any(|value| value != 0.0));
    curves.push(curve("balance", TEXT_COLOR, &|e| {
        e.balance() - first.balance()
    }));
    curves
}

/// Number, size and delays of the pictures of a film.
struct FilmFormat {
    /// Time that the film takes, in hundredths of a second.
    duration: f64,
    most_pictures: usize,
    /// How long a picture is shown: browsers show shorter delays for longer.
    shortest_delay: usize,
    longest_delay: usize,
    /// Size of the page: half as many as it has pixels.
    page: DVec2,
    title_height: f64,
    margins: BoxMargins,
}

const FILM: FilmFormat = FilmFormat {
    duration: 1000.0,
    most_pictures: 140,
    shortest_delay: 2,
    longest_delay: 100,
    page: DVec2::new(320.0, 240.0),
    title_height: 26.0,
    margins: BoxMargins {
        left: 46.0,
        right: 42.0,
        below: 42.0,
    },
};

/// Index of a pixel that has not changed.
const UNCHANGED_PIXEL_INDEX: u8 = 255;

/// Writes the film; a single picture where no motion is recorded.
pub fn write_film(record: &Record, scenario: &Scenario, out: &mut dyn Write) -> io::Result<()> {
    let setting = &FigureSetting::from_scenario(scenario);
    let film = match record.film.as_slice() {
        [] => &record.stills,
        film => film,
    };
    let shown = sampled_shapes(film);
    let shapes: Vec<DrawnVeins> = (shown.iter())
        .map(|still| DrawnVeins::from_motion(record, still, scenario))
        .collect();
    let bounds = common_bounding_box(shapes.iter());
    let view = ViewAngles::oblique(shapes.iter().map(DrawnVeins::tip_from_base));
    let times: Vec<f64> = (shown.iter())
        .map(|still| record.moments.get(still.moment).map_or(0.0, |m| m.time))
        .collect();
    let pictures: Vec<Vec<u8>> = (shapes.par_iter().zip(&times))
        .map_init(ColorPalette::new, |palette, (veins, time)| {
            let when = instant_text(*time, &scenario.units);
            let text = format!("{}, {when}", record.scenario);
            palette.nearest_color_indices(&rasterize(&draw_picture(
                veins, bounds, view, setting, &text, *time,
            )))
        })
        .collect();
    encode_gif(&pictures, &picture_delays(&times), out).map_err(io::Error::other)
}

/// An instant as text.
fn instant_text(time: f64, units: &Units) -> String {
    let time = number_in_unit(format_four_digits(time), units, TIME);
    format!("t = {time}")
}

/// At most `FILM.most_pictures` of the shapes, including the first and the last.
fn sampled_shapes(film: &[ShapeSnapshot]) -> Vec<&ShapeSnapshot> {
    let count = film.len().min(FILM.most_pictures);
    let last = film.len().saturating_sub(1);
    let place = |k: usize| k * last / (count - 1).max(1);
    (0..count).map(|k| &film[place(k)]).collect()
}

/// How long each picture is shown, in hundredths of a second: in proportion to the time
/// until the next, the last as long as the average.
fn picture_delays(times: &[f64]) -> Vec<u16> {
    let [Some(from), Some(to)] = [times.first(), times.last()] else {
        return Vec::new();
    };
    let count = times.len() as f64;
    let moving = FILM.duration * (count - 1.0) / count;
    let mut elapsed = 0;
    let ends = times[1..]
        .iter()
        .map(|time| moving * (time - from) / (to - from));
    (ends.chain([FILM.duration]))
        .map(|end| {
            let end = if end.is_finite() {
                end.round() as usize
            } else {
                0
            };
            let delay = end
                .saturating_sub(elapsed)
                .clamp(FILM.shortest_delay, FILM.longest_delay);
            elapsed += delay;
            delay as u16
        })
        .collect()
}

fn draw_picture(
    veins: &DrawnVeins,
    bounds: [DVec3; 2],
    view: ViewAngles,
    setting: &FigureSetting,
    text: &str,
    time: f64,
) -> Drawing {
    let mut page = Drawing::new(FILM.page.x, text);
    page.height = FILM.page.y;
    let cell = PageRectangle::new(
        DVec2::new(0.0, FILM.title_height),
        FILM.page - DVec2::new(0.0, FILM.title_height),
    );
    let scene = SpacePanel::new(bounds, setting, view, cell, FILM.margins, None);
    scene.draw_floor_and_walls(&mut page);
    scene.draw_axes(&mut page, 36.0);
    scene.draw_direction_arrows(&mut page, true, time);
    scene.draw_leaf(
        &mut page,
        veins,
        SMALL_LINE_WIDTH_FACTOR * veins.line_width(),
    );
    let corner = DVec2::new(10.0, 17.0);
    page.draw_label(corner, text, FONT_SIZE.text, TextAnchor::Start, TEXT_COLOR);
    page
}

/// Vein colors in several tints, greys, and the colors of markers.
struct ColorPalette {
    colors: Vec<Color>,
    /// Nearest colors found so far.
    indices_by_color: HashMap<[u8; 3], u8>,
}

impl ColorPalette {
    fn new() -> Self {
        let mut colors = vec![WHITE, TEXT_COLOR, NOTE_COLOR, SECOND_SOLUTION_COLOR];
        let mix = |Color(r, g, b): Color, part: f64| {
            let of = |x: u8| (255.0 + part * (f64::from(x) - 255.0)).round() as u8;
            Color(of(r), of(g), of(b))
        };
        for grey in 1..=42 {
            colors.push(mix(Color(20, 20, 24), f64::from(grey) / 42.0));
        }
        for vein in 0..34 {
            let color = vein_color(f64::from(vein) / 33.0);
            colors.extend([1.0, 0.8, 0.6, 0.45, 0.3, 0.15].map(|part| mix(color, part)));
        }
        colors.truncate(usize::from(UNCHANGED_PIXEL_INDEX));
        ColorPalette {
            colors,
            indices_by_color: HashMap::new(),
        }
    }

    /// The index of the nearest color for every pixel.
    fn nearest_color_indices(&mut self, pixels: &Pixmap) -> Vec<u8> {
        let rgb = pixels.data().chunks_exact(4);
        rgb.map(|rgba| {
            let rgb = [rgba[0], rgba[1], rgba[2]];
            *self.indices_by_color.entry(rgb).or_insert_with(|| {
                let distance = |Color(r, g, b): &Color| {
                    let squared = |a: u8, b: u8| (i32::from(a) - i32::from(b)).pow(2);
                    squared(*r, rgb[0]) + squared(*g, rgb[1]) + squared(*b, rgb[2])
                };
                let colors = self.colors.iter().enumerate();
                let nearest = colors.min_by_key(|(_, color)| distance(color));
                nearest.map_or(0, |(index, _)| index as u8)
            })
        })
        .collect()
    }
}

/// Encodes of each picture only what differs from the one before.
fn encode_gif(
    pictures: &[Vec<u8>],
    delays: &[u16],
    out: &mut dyn Write,
) -> Result<(), gif::EncodingError> {
    let [width, height] = (2.0 * FILM.page).to_array().map(|pixels| pixels as u16);
    let colors = ColorPalette::new().colors.into_iter();
    let mut table: Vec<u8> = colors.flat_map(|Color(r, g, b)| [r, g, b]).collect();
    table.resize(3 * 256, 0);
    let mut encoder = gif::Encoder::new(out, width, height, &table)?;
    encoder.set_repeat(gif::Repeat::Infinite)?;
    let mut before: Option<&Vec<u8>> = None;
    for (picture, &delay) in pictures.iter().zip(delays) {
        let ChangedRows { rows, pixels } = changed_rows(before, picture, usize::from(width));
        encoder.write_frame(&gif::Frame {
            delay,
            top: rows.start as u16,
            width,
            height: rows.len() as u16,
            transparent: before.map(|_| UNCHANGED_PIXEL_INDEX),
            dispose: gif::DisposalMethod::Keep,
            buffer: pixels.into(),
            ..gif::Frame::default()
        })?;
        before = Some(picture);
    }
    Ok(())
}

/// Rows of a picture that differ from the one before, at least one, and the indices of their pixels.
struct ChangedRows {
    rows: Range<usize>,
    pixels: Vec<u8>,
}

fn changed_rows(before: Option<&Vec<u8>>, picture: &[u8], width: usize) -> ChangedRows {
    let Some(before) = before else {
        return ChangedRows {
            rows: 0..picture.len() / width,
            pixels: picture.to_vec(),
        };
    };
    let pixels = before.iter().zip(picture);
    let pixels = pixels.map(|(a, b)| if a == b { UNCHANGED_PIXEL_INDEX } else { *b });
    let pixels: Vec<u8> = pixels.collect();
    let differs = |pixel: &u8| *pixel != UNCHANGED_PIXEL_INDEX;
    let first = pixels.iter().position(differs).unwrap_or(0) / width;
    let last = pixels.iter().rposition(differs).unwrap_or(0) / width;
    let rows = first..last + 1;
    let changed = &pixels[rows.start * width..rows.end * width];
    ChangedRows {
        pixels: changed.to_vec(),
        rows,
    }
}

/// From the notes to the key below them, in pixels.
const LEGEND_BASE_LINE: f64 = 20.0;

/// Color of the earlier path of the tip.
const EARLIER_PATH_COLOR: Color = Color(240, 190, 176);

/// Most points of the tip's path that are drawn between two panels.
const MOST_PATH_POINTS: usize = 400;

pub fn draw_filmstrip(record: &Record, scenario: &Scenario) -> Drawing {
    let setting = FigureSetting::from_scenario(scenario);
    let name = format!("{}: instants of the motion", record.scenario);
    let stills = record.stills.iter();
    let shapes: Vec<DrawnVeins> = stills
        .map(|it| DrawnVeins::from_motion(record, it, scenario))
        .collect();
    let has_path = record.tips.len() == 1 && record.stills.len() > 1;
    let top = if has_path {
        PAGE.header + LEGEND_BASE_LINE
    } else {
        PAGE.header
    };
    let panels = SmallPanels::fitted_to_shapes(shapes.iter(), shapes.len(), &setting, top);
    let mut notes = header_notes(record);
    let first = shapes.first();
    notes.extend(first.map_or(Vec::new(), |veins| veins.leaf_notes(&setting)));
    let width = panels.grid_width();
    notes.push(format!("a square of the grid is {width} wide"));
    let mut drawing = new_page(PAGE.side_margin, &name, &notes, first);
    drawing.height = panels.bottom();
    let mut since = record.stills.first().map_or(0, |still| still.moment);
    let strokes = [SECOND_SOLUTION_COLOR, EARLIER_PATH_COLOR].map(|color| Stroke::new(color, 1.0));
    if has_path {
        drawing.draw_group("key", |page| {
            let mut key = LegendRows::starting_at(
                PAGE.side_margin,
                PAGE.notes_base_line + LEGEND_BASE_LINE,
                22.0,
            );
            for (name, stroke) in ["the tip's way since the picture before", "and before that"]
                .into_iter()
                .zip(strokes)
            {
                key.add_entry(page, name, |page, cell| cell.draw_midline(page, stroke));
            }
        });
    }
    let instants = shapes.iter().zip(&record.stills).enumerate();
    for ((index, (veins, still)), letter) in instants.zip(panel_letters().cycle()) {
        let paths = [(since, still.moment), (0, since)];
        let paths = paths.map(|(from, to)| tip_path(record, from, to));
        since = still.moment;
        drawing.draw_group("instant", |page| {
            let time = record.moments.get(still.moment).map_or(0.0, |m| m.time);
            let when = instant_text(time, &scenario.units);
            let caption = PanelCaption {
                letter: &letter,
                text: &when,
                color: NOTE_COLOR,
            };
            let scene = panels.draw_empty_panel(page, index, time, panels.view, caption);
            for (path, stroke) in paths.iter().zip(strokes).rev() {
                let path: Vec<_> = path
                    .iter()
                    .map(|&point| scene.project_point(point))
                    .collect();
                if path.len() > 1 {
                    page.draw_stroke(polyline_path(&path), stroke);
                }
            }
            scene.draw_leaf(page, veins, SMALL_LINE_WIDTH_FACTOR * veins.line_width());
        });
    }
    drawing
}

/// The path of the tip from one moment to another, in lengths; empty for free tips.
fn tip_path(record: &Record, from: usize, to: usize) -> Vec<DVec3> {
    if record.tips.len() != 1 || from >= to {
        return Vec::new();
    }
    let moments = record.moments.get(from..=to).unwrap_or_default();
    let every = moments.len().div_ceil(MOST_PATH_POINTS).max(1);
    let points = moments.iter().step_by(every).chain(moments.last());
    points
        .map(|moment| moment.tip / record.length)
        .filter(|&point| is_drawable(point))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;

    #[test]
    fn a_tip_that_moves_little_is_drawn_from_where_it_began() {
        let mut record = sample::sample_record(3, 4);
        let start = record.moments[0].tip;
        for (by, small) in [(1e-3, true), (0.1, true), (0.3, false), (0.0, false)] {
            for (k, moment) in record.moments.iter_mut().enumerate() {
                moment.tip = start + by * start.length() * (k % 2) as f64 * DVec3::Y;
            }
            let origin = small_motion_origin(&record.moments);
            assert_eq!(origin, small.then_some(start), "{by}");
        }
        assert_eq!(small_motion_origin(&[]), None);
    }

    #[test]
    fn what_is_always_zero_is_not_drawn() {
        let mut record = sample::sample_record(3, 4);
        let names = |record: &Record| -> Vec<&str> {
            let curves = energy_curves(record).into_iter();
            curves.map(|curve| curve.name).collect()
        };
        assert!(!names(&record).contains(&"work put in"));
        record.moments[3].energy.work = 0.1;
        assert!(names(&record).contains(&"work put in"));
    }
}

#[cfg(test)]
mod film_tests {
    use super::*;
    use crate::report::sample;

    use std::collections::HashSet;

    /// A decoded film: its repetition, delays, and whole pictures as RGBA.
    fn decoded(bytes: &[u8]) -> (gif::Repeat, Vec<u16>, Vec<Vec<u8>>) {
        let mut options = gif::DecodeOptions::new();
        options.set_color_output(gif::ColorOutput::RGBA);
        let mut decoder = options.read_info(bytes).unwrap();
        let width = 2 * FILM.page.x as usize;
        let mut canvas = vec![0; 4 * width * 2 * FILM.page.y as usize];
        let (mut delays, mut pictures) = (Vec::new(), Vec::new());
        while let Some(frame) = decoder.read_next_frame().unwrap() {
            assert_eq!((frame.left, usize::from(frame.width)), (0, width));
            let start = 4 * width * usize::from(frame.top);
            for (to, from) in canvas[start..]
                .chunks_exact_mut(4)
                .zip(frame.buffer.chunks_exact(4))
            {
                if from[3] > 0 {
                    to.copy_from_slice(from);
                }
            }
            delays.push(frame.delay);
            pictures.push(canvas.clone());
        }
        (decoder.repeat(), delays, pictures)
    }

    fn total(delays: &[u16]) -> u32 {
        delays.iter().map(|&delay| u32::from(delay)).sum()
    }

    #[test]
    fn a_film_lasts_ten_seconds_loops_and_shows_the_leaf() {
        let mut record = sample::sample_record(5, 8);
        let (_, frames) = sample::sample_motion(5, 8);
        let still = |(moment, frame): (usize, &leafdyn::simulate::Frame)| ShapeSnapshot {
            moment,
            curves: (0..5).map(|rod| frame.centerline(rod).to_vec()).collect(),
        };
        record.film = frames.iter().enumerate().map(still).collect();
        let scenario = sample::sample_scenario("swing", 5);
        let setting = FigureSetting::from_scenario(&scenario);
        let mut bytes = Vec::new();
        write_film(&record, &scenario, &mut bytes).unwrap();
        assert!(bytes.len() < 5_000_000, "{}", bytes.len());
        let (repeat, delays, pictures) = decoded(&bytes);
        assert_eq!(repeat, gif::Repeat::Infinite);
        assert_eq!(pictures.len(), 101);
        assert_eq!(total(&delays), 1000);
        // Every picture shows its instant, in colors that are close enough.
        let stills = record.film.iter();
        let shapes: Vec<DrawnVeins> = stills
            .map(|it| DrawnVeins::from_motion(&record, it, &scenario))
            .collect();
        let bounds = common_bounding_box(shapes.iter());
        let view = ViewAngles::oblique(shapes.iter().map(DrawnVeins::tip_from_base));
        for k in [0, 50, 100] {
            let time = record.moments[k].time;
            let text = format!("{}, t = {}", record.scenario, format_four_digits(time));
            let painted = rasterize(&draw_picture(
                &shapes[k], bounds, view, &setting, &text, time,
            ));
            let shown = pictures[k].chunks_exact(4);
            let pairs = shown.zip(painted.data().chunks_exact(4));
            let difference =
                |(a, b): (&[u8], &[u8])| (0..3).map(|c| a[c].abs_diff(b[c])).max().unwrap_or(0);
            let off: Vec<u8> = pairs.map(difference).collect();
            let worst = off.iter().filter(|&&off| off > 48).count();
            assert!(worst < off.len() / 2000, "picture {k}: {worst} are off");
        }
        // Five veins, five colors.
        let pixels = pictures[0].chunks_exact(4);
        let seen: HashSet<[u8; 3]> = pixels.map(|c| [c[0], c[1], c[2]]).collect();
        for vein in 0..5 {
            let Color(r, g, b) = vein_color(f64::from(vein) / 4.0);
            let near =
                |c: &[u8; 3]| c[0].abs_diff(r).max(c[1].abs_diff(g)).max(c[2].abs_diff(b)) < 14;
            assert!(seen.iter().any(near), "vein {vein}");
        }
    }

    #[test]
    fn delays_are_proportional_to_times() {
        assert_eq!(picture_delays(&[0.0, 1.0, 2.0, 4.0]), [100, 100, 100, 100]);
        let even: Vec<f64> = (0..140).map(f64::from).collect();
        let delays = picture_delays(&even);
        assert_eq!(total(&delays), 1000);
        assert!(delays.iter().all(|delay| (7..=8).contains(delay)));
        assert_eq!(super::picture_delays(&[0.0]), [100]);
        assert!(super::picture_delays(&[]).is_empty());
        assert_eq!(super::picture_delays(&[1.0, 1.0]), [2, 100]);
    }
}

#[cfg(test)]
mod filmstrip_tests {
    use super::*;
    use crate::figure::drawing::formats::{checked_svg_text, hex_color};
    use crate::report::sample;

    #[test]
    fn the_path_of_the_tip_is_drawn() {
        let scenario = sample::sample_scenario("swing", 5);
        let mut record = sample::sample_record(5, 8);
        let paths = |record: &Record| {
            let svg = checked_svg_text(&draw_filmstrip(record, &scenario));
            [SECOND_SOLUTION_COLOR, EARLIER_PATH_COLOR].map(|color| {
                svg.matches(&format!("stroke=\"{}\"", hex_color(color)))
                    .count()
            })
        };
        // In all pictures but the first, or the first two, and in the key.
        assert_eq!(paths(&record), [8, 7]);
        record.joined = false;
        let curves = record.stills[0].curves.iter();
        record.tips = curves.map(|curve| curve[0]).collect();
        assert_eq!(paths(&record), [0, 0]);
    }
}
