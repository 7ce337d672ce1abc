//! Field sheets of biomech: where stations of a leaf's axis are, their sections, and the mass that they carry.

use crate::numbers::format_two_digits;
use crate::posture::points::PosturePoints;
use crate::scenario::{Scenario, SectionConstants, SectionOutline};
use crate::study::fit::cells::line_error;
use crate::study::fit::columns::FitError;
use glam::DVec3;
use serde_json::{Value, json};

/// A station of a field sheet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FieldStation {
    /// Distance from the base along the axis, in m.
    pub distance: f64,
    /// Outline of the section, and its sides in m.
    pub outline: SectionOutline,
    /// Width, across the axis and level.
    pub width: f64,
    /// Height, across both.
    pub height: f64,
    /// Where it was in the field, in m.
    pub position: [f64; 3],
    /// Mass of the axis and of what it carries between the station before and this one, in kg.
    pub mass: f64,
}

/// A field sheet of biomech.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct FieldSheet {
    /// The stations, from the base.
    pub stations: Vec<FieldStation>,
    /// Inclination of the axis at its base, in radians.
    pub inclination: f64,
}

/// The rows of a field sheet.
const ROWS: [&str; 12] = [
    "distance",
    "type",
    "width",
    "height",
    "inclination",
    "torsion",
    "x",
    "y",
    "z",
    "mass",
    "mass_right",
    "mass_left",
];

/// Sections by their type, which is counted from 1. Triangles that point down and up have the same moments of area.
const OUTLINES: [SectionOutline; 5] = [
    SectionOutline::Triangle,
    SectionOutline::Rectangle,
    SectionOutline::Triangle,
    SectionOutline::Ellipse,
    SectionOutline::Circle,
];

/// The field sheet in a file.
///
/// # Errors
/// What is no such sheet, with the line.
pub(super) fn read_field_sheet(text: &str, file: &str) -> Result<FieldSheet, FitError> {
    let mut rows: Vec<(usize, Vec<f64>)> = Vec::new();
    let decimal_commas = has_decimal_commas(text);
    for (k, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let line = match decimal_commas {
            true => line.replace(',', "."),
            false => line.to_owned(),
        };
        let cells = line.split(|mark: char| mark.is_whitespace() || mark == ';' || mark == ',');
        let cells: Vec<&str> = cells.filter(|cell| !cell.is_empty()).collect();
        let number = |cell: &&str| {
            let number = cell.parse::<f64>().ok().filter(|number| number.is_finite());
            number.ok_or_else(|| {
                let why = format!(
                    "{cell} is no number: a field sheet of biomech has twelve rows of numbers without names; a table \
                     with names is read without a format"
                );
                line_error(file, k + 1, why)
            })
        };
        let numbers: Vec<f64> = cells.iter().map(number).collect::<Result<_, _>>()?;
        let first = rows.first().map_or(numbers.len(), |(_, row)| row.len());
        if numbers.len() != first {
            let why = format!(
                "has {} numbers and the first row {first}: a column is a station",
                numbers.len()
            );
            return Err(line_error(file, k + 1, why));
        }
        rows.push((k + 1, numbers));
    }
    if rows.len() != ROWS.len() {
        let why = format!(
            "has {} rows: a field sheet of biomech has twelve: {}",
            rows.len(),
            ROWS.join(", ")
        );
        return Err(line_error(file, 1, why));
    }
    let cell = |row: usize, station: usize| rows[row].1[station];
    let refuse = |row: usize, station: usize, why: &str| {
        let (line, value) = (rows[row].0, rows[row].1[station]);
        let name = ROWS[row];
        Err(line_error(
            file,
            line,
            format!("station {}: {name} = {value}: {why}", station + 1),
        ))
    };
    let mut stations: Vec<FieldStation> = Vec::new();
    let mut distance = 0.0;
    for k in 0..rows[0].1.len() {
        let step = cell(0, k);
        // The first distance is that of the first station from the base.
        if step < 0.0 || k > 0 && step == 0.0 {
            return refuse(
                0,
                k,
                "is the distance from the station before, greater than 0",
            );
        }
        distance += step;
        let kind = cell(1, k);
        let known = (1..=OUTLINES.len()).find(|number| *number as f64 == kind);
        let Some(number) = known else {
            return refuse(
                1,
                k,
                "must be 1, 3 (a triangle), 2 (a rectangle), 4 (an ellipse) or 5 (a circle)",
            );
        };
        for row in [2, 3] {
            if cell(row, k) <= 0.0 {
                return refuse(row, k, "must be greater than 0");
            }
        }
        for row in [9, 10, 11] {
            if cell(row, k) < 0.0 {
                return refuse(row, k, "is a mass, and not negative");
            }
        }
        stations.push(FieldStation {
            distance,
            outline: OUTLINES[number - 1],
            width: cell(2, k),
            height: cell(3, k),
            position: [cell(6, k), cell(7, k), cell(8, k)],
            mass: cell(9, k) + cell(10, k) + cell(11, k),
        });
    }
    let sheet = FieldSheet {
        stations,
        inclination: cell(4, 0).to_radians(),
    };
    if let Some(why) = sheet.implausible_unit() {
        return Err(line_error(file, rows[0].0, why));
    }
    Ok(sheet)
}

/// Whether the commas of a sheet are those of decimals: all stand between digits, and others divide the cells.
fn has_decimal_commas(text: &str) -> bool {
    let lines = text.lines().map(str::trim);
    let lines = lines.filter(|line| !line.is_empty() && !line.starts_with('#'));
    let mut any = false;
    for line in lines {
        let cells = line.split(|mark: char| mark.is_whitespace() || mark == ';');
        for cell in cells.filter(|cell| !cell.is_empty()) {
            let Some((whole, decimals)) = cell.split_once(',') else {
                continue;
            };
            let is_digits =
                |part: &str| !part.is_empty() && part.bytes().all(|it| it.is_ascii_digit());
            if cell.contains('.')
                || !is_digits(whole.trim_start_matches('-'))
                || !is_digits(decimals)
            {
                return false;
            }
            any = true;
        }
    }
    any
}

/// Mass over the volume of the boxes around the sections, in kg/m^3, that a plant may have with what it carries: pith has 20, green wood
/// 1000, and leaflets or fruit many times the mass of their axis. Grams in place of kilograms are a thousand
/// times as many, centimeters in place of meters a million times as few.
const PLAUSIBLE_DENSITIES: std::ops::RangeInclusive<f64> = 2.0..=5e4;

/// Largest ratio of the way between positions to that along the axis, or the inverse.
const LARGEST_WAY_RATIO: f64 = 3.0;

/// Differences of the inclination at the base from that of the way to the next station, in degrees: up to
/// the first a number that is taken for radians agrees with it, from the second on one of degrees does not.
const INCLINATION_DIFFERENCES: [f64; 2] = [15.0, 30.0];

impl FieldSheet {
    /// Which of its units are probably not those of a field sheet.
    fn implausible_unit(&self) -> Option<String> {
        let (mut volume, mut mass, mut before) = (0.0, 0.0, 0.0);
        for station in &self.stations {
            volume += station.width * station.height * (station.distance - before);
            mass += station.mass;
            before = station.distance;
        }
        let density = mass / volume;
        if volume > 0.0 && mass > 0.0 && !PLAUSIBLE_DENSITIES.contains(&density) {
            return Some(format!(
                "the masses over width, height and distance are {} kg/m³: distances and sections of a field sheet are in \
                 m, and masses in kg",
                format_two_digits(density)
            ));
        }
        let positions = self
            .stations
            .iter()
            .map(|it| DVec3::from_array(it.position));
        let positions: Vec<DVec3> = positions.collect();
        let [first, .., last] = &self.stations[..] else {
            return None;
        };
        let way: f64 = positions
            .windows(2)
            .map(|pair| pair[0].distance(pair[1]))
            .sum();
        let ratio = way / (last.distance - first.distance);
        if !(1.0 / LARGEST_WAY_RATIO..=LARGEST_WAY_RATIO).contains(&ratio) {
            return Some(format!(
                "the way from position to position is {} times that by the distances: both are in m",
                format_two_digits(ratio)
            ));
        }
        let chord = positions[1] - positions[0];
        let rise = chord.z.atan2(chord.truncate().length()).to_degrees();
        let given = self.inclination.to_degrees();
        let [near, far] = INCLINATION_DIFFERENCES;
        if (given - rise).abs() > far && (given.to_degrees() - rise).abs() < near {
            return Some(format!(
                "inclination = {given:.2}, and the way to the next station rises by {rise:.0} degrees: inclinations are \
                 in degrees"
            ));
        }
        None
    }
}

/// Standard gravity, in m/s^2.
const GRAVITY: f64 = 9.806_65;

/// Young's modulus with which a sheet becomes a scenario, in Pa: the factor of the stiffnesses is the modulus in GPa.
const NOMINAL_MODULUS: f64 = 1e9;

/// Poisson's ratio that gives the shear modulus, which a sheet does not have.
const POISSON: f64 = 0.3;

/// The point that tells the inclination at the base is so far from it, as a part of the way to the first station.
const INCLINATION_POINT: f64 = 0.05;

impl FieldSheet {
    /// The points in the unit of a scenario, with one near the base that tells the measured inclination there.
    pub fn points(&self, file: &str, scenario: &Scenario) -> Result<PosturePoints, FitError> {
        let meters = scenario.units.meters().ok_or_else(|| {
            let why = "field sheets of biomech are in m, and the scenario does not say its unit: give units.length as \
                       m, cm, mm, in or ft";
            line_error(file, 1, why)
        })?;
        let mut positions: Vec<DVec3> = (self.stations.iter())
            .map(|station| DVec3::from_array(station.position) / meters)
            .collect();
        if let [first, second, ..] = positions[..] {
            let chord = second - first;
            let level = DVec3::new(chord.x, chord.y, 0.0).normalize_or(DVec3::X);
            let (rise, run) = self.inclination.sin_cos();
            let toward = run * level + rise * DVec3::Z;
            positions.insert(1, first + INCLINATION_POINT * chord.length() * toward);
        }
        Ok(PosturePoints::in_space(positions))
    }

    /// A scenario with the sections and the weight of the sheet: stiffnesses at [`NOMINAL_MODULUS`], linear between the
    /// stations, and the mass of each over the way from the one before as weight per length, likewise. They stand for
    /// `[stiffness]` or `[section]`, `load.distributed` and `leaf.length`.
    pub fn scenario(&self, file: &str, scenario: &Scenario) -> Result<Scenario, FitError> {
        let refuse = |why: &str| line_error(file, 1, why);
        let (Some(meters), Some(newtons)) = (scenario.units.meters(), scenario.units.newtons())
        else {
            return Err(refuse(
                "field sheets of biomech are in m and kg, and the scenario does not say its units: give units.length as \
                 m, cm, mm, in or ft, and units.force as N, mN, kN or lbf",
            ));
        };
        if scenario.blade.is_some() || scenario.rods.len() != 1 {
            return Err(refuse(
                "a field sheet of biomech describes one vein: give a scenario with leaf.rods = 1 and without [blade]",
            ));
        }
        if scenario.gravity != [0.0; 3] || scenario.g != [0.0; 3] {
            return Err(refuse(
                "the field sheet has the weight: leave load.gravity and load.g out of the scenario",
            ));
        }
        let young = NOMINAL_MODULUS * meters * meters / newtons;
        let length = self.stations.last().map_or(0.0, |station| station.distance);
        let mut at: Vec<f64> = Vec::new();
        let mut stiffness = [Vec::new(), Vec::new(), Vec::new()];
        let mut weight: Vec<[f64; 3]> = Vec::new();
        let mut before = 0.0;
        for station in &self.stations {
            let constants = SectionConstants::of_full_section(
                station.outline,
                station.width / meters,
                station.height / meters,
            )
            .ok_or_else(|| refuse("has a section that is not full"))?;
            let step = station.distance - before;
            let pull = match step > 0.0 {
                true => station.mass * GRAVITY / step,
                false => 0.0,
            };
            let values = [
                constants.torsion / (2.0 * (1.0 + POISSON)),
                constants.second_moments[0],
                constants.second_moments[1],
            ]
            .map(|constant| young * constant);
            // Where the first station is beyond the base, the section begins there as it is.
            if at.is_empty() && station.distance > 0.0 {
                at.push(0.0);
                for (all, value) in stiffness.iter_mut().zip(values) {
                    all.push(value);
                }
                weight.push([0.0, 0.0, -pull * meters / newtons]);
            }
            at.push(station.distance / length);
            for (all, value) in stiffness.iter_mut().zip(values) {
                all.push(value);
            }
            weight.push([0.0, 0.0, -pull * meters / newtons]);
            before = station.distance;
        }
        if let Some(last) = at.last_mut() {
            *last = 1.0;
        }
        let profile = |value: &Vec<f64>| json!({ "at": at, "value": value });
        let mut form = serde_json::to_value(scenario).map_err(|_| refuse("cannot be written"))?;
        let Value::Object(tables) = &mut form else {
            return Err(refuse("cannot be written"));
        };
        tables.remove("section");
        let [torsion, bending_2, bending_3] = stiffness.each_ref().map(profile);
        let rigid = "inf";
        tables.insert(
            "stiffness".into(),
            json!({
                "torsion": torsion, "bending_2": bending_2, "bending_3": bending_3,
                "axial": rigid, "shear_2": rigid, "shear_3": rigid,
            }),
        );
        let mut set = |table: &str, key: &str, value: Value| {
            let entry = tables.entry(table).or_insert_with(|| json!({}));
            if let Value::Object(entries) = entry {
                entries.insert(key.into(), value);
            }
        };
        set("leaf", "length", json!(length / meters));
        set("load", "distributed", json!({ "at": at, "value": weight }));
        Scenario::from_toml(&form.to_string()).map_err(|error| {
            refuse(&format!(
                "with the sections and weights of the sheet: {error}"
            ))
        })
    }
}
