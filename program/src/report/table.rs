//! Layout of results: labeled lines for the console, and tables as CSV. A table of several scenarios has
//! the scalars of their JSON; `centerlines.csv`, `modes.csv` and `sensitivity.csv` have every rod at every
//! station.

use glam::DVec3;
use leafdyn::relax::{Equilibrium, NodeState, Sensitivity, SmallMotions};
use leafdyn::scenario::Stress;
use leafdyn::shape::{InterpolationWeights, interpolation_weights};
use leafdyn::surface::AngleDistribution;
use serde::Serialize;
use serde::de::{Deserialize, Deserializer, IgnoredAny, MapAccess, SeqAccess, Visitor};
use std::borrow::Cow;
use std::collections::HashMap;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::{fmt, io};

/// Lines of a report, each with its label; one without a label continues the one
/// above.
pub type LabelledLines = Vec<(&'static str, String)>;

/// Lines of which only the first is labelled.
pub fn label_first_line(
    name: &'static str,
    lines: impl IntoIterator<Item = String>,
) -> LabelledLines {
    let names = std::iter::once(name).chain(std::iter::repeat(""));
    names.zip(lines).collect()
}

pub fn file_list_text(folder: &Path, files: &[PathBuf]) -> String {
    let names = files.iter().filter_map(|file| file.file_name());
    let names: Vec<_> = names.map(|name| name.to_string_lossy()).collect();
    format!("{}: {}", folder.display(), names.join(", "))
}

/// What spreadsheets take for the beginning of a formula, which they run.
const FORMULA_STARTS: [char; 6] = ['=', '+', '-', '@', '\t', '\r'];

/// Before a text spreadsheets take this for a sign that it is one.
const TEXT_CELL_PREFIX: char = '\'';

/// The cell of a text that comes from a name, such as that of an experiment.
pub fn text_cell(text: &str) -> Cow<'_, str> {
    match text.starts_with(FORMULA_STARTS) && text.parse::<f64>().is_err() {
        true => format!("{TEXT_CELL_PREFIX}{text}").into(),
        false => text.into(),
    }
}

/// Writes rows as CSV without a header; each may be a tuple of tuples and arrays, whose
/// elements are its cells.
pub fn append_csv_rows<R: Serialize>(
    rows: impl IntoIterator<Item = R>,
    out: &mut dyn Write,
) -> io::Result<()> {
    let mut table = csv_writer_without_header(out);
    for row in rows {
        table.serialize(row)?;
    }
    table.flush()
}

/// A CSV writer that writes no header by itself.
pub fn csv_writer_without_header<W: Write>(out: W) -> csv::Writer<W> {
    let mut builder = csv::WriterBuilder::new();
    builder.has_headers(false).from_writer(out)
}

/// What came of one of several scenarios.
pub struct ScenarioOutput {
    /// Path of the scenario's file.
    pub file: String,
    pub exit_status: i32,
    /// Its result, or why there is none.
    pub json: Vec<u8>,
}

/// One table of several results. The scalar values of their JSON are the cells. Columns are named by their keys, those of
/// nested objects by both keys (`work_steps`); lists are left out, except tips.
pub fn table_of_json_results(results: &[ScenarioOutput]) -> io::Result<Vec<u8>> {
    let mut columns: Vec<String> = Vec::new();
    let mut rows: Vec<HashMap<String, String>> = Vec::new();
    for output in results {
        let FlattenedJson(mut cells) = serde_json::from_slice(&output.json)?;
        let head = [
            NamedCell::new("file", text_cell(&output.file).into()),
            NamedCell::new("exit_status", output.exit_status.to_string()),
        ];
        cells.retain(|cell| cell.name != "exit_status");
        cells.splice(0..0, head);
        let mut after = 0;
        for NamedCell { name, .. } in &cells {
            after = 1 + match columns.iter().position(|column| column == name) {
                Some(known) => known,
                None => {
                    columns.insert(after, name.clone());
                    after
                }
            };
        }
        rows.push(cells.into_iter().map(|it| (it.name, it.cell)).collect());
    }
    columns.retain(|column| column != "error");
    columns.push("error".into());
    let mut table = csv::Writer::from_writer(Vec::new());
    table.write_record(&columns)?;
    for row in &rows {
        let cells = columns.iter().map(|column| row.get(column));
        table.write_record(cells.map(|cell| cell.map_or("", String::as_str)))?;
    }
    table.into_inner().map_err(|error| error.into_error())
}

/// A cell of a table, and the name of its column.
struct NamedCell {
    name: String,
    cell: String,
}

impl NamedCell {
    fn new(name: impl Into<String>, cell: String) -> Self {
        let name = name.into();
        NamedCell { name, cell }
    }
}

/// A JSON value as named cells; that of a scalar has no name.
struct FlattenedJson(Vec<NamedCell>);

impl<'de> Deserialize<'de> for FlattenedJson {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Cells;

        impl Cells {
            fn single_cell<E>(cell: impl ToString) -> Result<FlattenedJson, E> {
                Ok(FlattenedJson(vec![NamedCell::new("", cell.to_string())]))
            }
        }

        impl<'de> Visitor<'de> for Cells {
            type Value = FlattenedJson;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("JSON")
            }

            fn visit_bool<E>(self, value: bool) -> Result<FlattenedJson, E> {
                Cells::single_cell(value)
            }

            fn visit_i64<E>(self, value: i64) -> Result<FlattenedJson, E> {
                Cells::single_cell(value)
            }

            fn visit_u64<E>(self, value: u64) -> Result<FlattenedJson, E> {
                Cells::single_cell(value)
            }

            fn visit_f64<E>(self, value: f64) -> Result<FlattenedJson, E> {
                Cells::single_cell(format_args!("{value:?}"))
            }

            fn visit_str<E>(self, value: &str) -> Result<FlattenedJson, E> {
                Cells::single_cell(text_cell(value))
            }

            fn visit_unit<E>(self) -> Result<FlattenedJson, E> {
                Cells::single_cell("")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<FlattenedJson, A::Error> {
                while list.next_element::<IgnoredAny>()?.is_some() {}
                Ok(FlattenedJson(Vec::new()))
            }

            fn visit_map<A: MapAccess<'de>>(
                self,
                mut object: A,
            ) -> Result<FlattenedJson, A::Error> {
                let mut cells = Vec::new();
                while let Some(key) = object.next_key::<String>()? {
                    match key.as_str() {
                        "version" | "source" | "input" => {
                            object.next_value::<IgnoredAny>()?;
                        }
                        "tip" | "tip_force_sum" => {
                            let tip = object.next_value::<Option<[f64; 3]>>()?;
                            for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
                                let cell = tip.map(|tip| format!("{:?}", tip[axis]));
                                let name = format!("{key}_{name}");
                                cells.push(NamedCell::new(name, cell.unwrap_or_default()));
                            }
                        }
                        _ => {
                            let FlattenedJson(inner) = object.next_value()?;
                            for NamedCell { name, cell } in inner {
                                let below = if name.is_empty() { "" } else { "_" };
                                cells.push(NamedCell::new(format!("{key}{below}{name}"), cell));
                            }
                        }
                    }
                }
                Ok(FlattenedJson(cells))
            }
        }

        deserializer.deserialize_any(Cells)
    }
}

/// The header of a table with these columns, which commas separate.
pub fn table_header(columns: &str) -> Vec<u8> {
    format!("{columns}\n").into_bytes()
}

/// Nodes of the finest grid that a cubic interpolates.
const CUBIC_NODES: usize = 4;

/// Names of the columns. Rods are numbered from 1; strains and stress
/// resultants are components along the directors.
const CENTERLINES_HEADER: &str =
    "rod,sigma,s,x,y,z,qw,qx,qy,qz,v1,v2,v3,u1,u2,u3,n1,n2,n3,m1,m2,m3";

/// Writes the area of a surface by classes of inclination and azimuth, in degrees: those in which there is some.
pub fn write_angle_table(angles: &AngleDistribution, out: &mut dyn Write) -> io::Result<()> {
    out.write_all(&table_header("inclination,azimuth,area"))?;
    let rows = angles
        .classes()
        .filter(|class| class.area > 0.0)
        .map(|class| {
            let [inclination, azimuth] = [class.inclination, class.azimuth].map(f64::to_degrees);
            // The middles of classes are halves of degrees.
            let round = |degrees: f64| (2.0 * degrees).round() / 2.0;
            (round(inclination), round(azimuth), class.area)
        });
    append_csv_rows::<(f64, f64, f64)>(rows, out)
}

/// `centerlines.csv`: one row per rod and station; the largest stresses there come last, if
/// sections are given.
pub fn write_centerlines(equilibrium: &Equilibrium, out: &mut dyn Write) -> io::Result<()> {
    let shape = &equilibrium.shape;
    let stresses = equilibrium.stress.as_ref();
    let rows = shape.rods.iter().enumerate().flat_map(|(j, rod)| {
        let nodes = shape.stations.iter().zip(&rod.nodes).enumerate();
        nodes.map(move |(i, (sigma, node))| {
            let stress = stresses.map(|of| of.rods[j][i].to_array());
            (
                j + 1,
                *sigma,
                sigma * rod.length,
                node_columns(node),
                stress.as_slice().as_flattened().to_vec(),
            )
        })
    });
    let names: &[&str] = if stresses.is_some() {
        &Stress::NAMES
    } else {
        &[]
    };
    out.write_all(&table_header(
        &[&[CENTERLINES_HEADER], names].concat().join(","),
    ))?;
    append_csv_rows::<(usize, _, _, _, _)>(rows, out)
}

/// Names of the columns. Modes and rods are numbered from 1; displacements and
/// rotation vectors are along the lab axes.
const MODES_HEADER: &str = "mode,eigenvalue,error,frequency,rod,sigma,dx,dy,dz,rx,ry,rz";

/// Names of the columns of small motions without a potential, the last of which are those a quarter of a period later.
const MOTIONS_HEADER: &str = "mode,growth_rate,error,frequency,rod,sigma,dx,dy,dz,rx,ry,rz,\
                              later_dx,later_dy,later_dz,later_rx,later_ry,later_rz";

/// A station of the rods, and the weights of nodes beside it.
struct InterpolatedStation {
    sigma: f64,
    near: InterpolationWeights,
}

impl InterpolatedStation {
    fn all(equilibrium: &Equilibrium) -> Vec<Self> {
        let shape = &equilibrium.shape;
        let stations = shape.stations.iter().map(|&sigma| InterpolatedStation {
            sigma,
            near: interpolation_weights(&shape.curve_stations, sigma, CUBIC_NODES),
        });
        stations.collect()
    }

    /// The vector there of a rod that has these at its nodes.
    fn vector(&self, nodes: &[DVec3]) -> DVec3 {
        let InterpolationWeights { first, weights } = &self.near;
        let near = weights.iter().zip(&nodes[*first..]);
        near.map(|(weight, node)| *weight * *node).sum()
    }
}

/// The components of two vectors, of which none is minus zero.
fn components([d, r]: [DVec3; 2]) -> [f64; 6] {
    [d.x, d.y, d.z, r.x, r.y, r.z].map(|value| value + 0.0)
}

/// `modes.csv`: one row per mode, rod and station.
pub fn write_modes_table(equilibrium: &Equilibrium, out: &mut dyn Write) -> io::Result<()> {
    let stations = InterpolatedStation::all(equilibrium);
    let motions = equilibrium.stability.small_motions.as_ref();
    if let Some(motions) = motions.filter(|motions| motions.shapes.is_some()) {
        return write_motions_table(motions, &stations, out);
    }
    out.write_all(&table_header(MODES_HEADER))?;
    let mut table = csv_writer_without_header(out);
    for (index, mode) in equilibrium.stability.modes.iter().flatten().enumerate() {
        let of_mode = (index + 1, mode.eigenvalue, mode.error, mode.frequency());
        let rods = mode.displacement.iter().zip(&mode.rotation);
        for (rod, (displacement, rotation)) in rods.enumerate() {
            for station in &stations {
                let shape = [displacement, rotation].map(|nodes| station.vector(nodes));
                table.serialize((of_mode, rod + 1, station.sigma, components(shape)))?;
            }
        }
    }
    table.flush()
}

/// One row per small motion, rod and station.
fn write_motions_table(
    motions: &SmallMotions,
    stations: &[InterpolatedStation],
    out: &mut dyn Write,
) -> io::Result<()> {
    out.write_all(&table_header(MOTIONS_HEADER))?;
    let mut table = csv_writer_without_header(out);
    for (k, shape) in motions.shapes.iter().flatten().enumerate() {
        let error = motions.errors.as_ref().map(|errors| errors[k]);
        let of_motion = (
            k + 1,
            motions.growth_rates[k],
            error,
            motions.frequencies[k],
        );
        for rod in 0..shape.displacement.len() {
            for station in stations {
                let vectors = |fields: [&Vec<Vec<DVec3>>; 2]| {
                    components(fields.map(|field| station.vector(&field[rod])))
                };
                let now = vectors([&shape.displacement, &shape.rotation]);
                let later = vectors([&shape.later_displacement, &shape.later_rotation]);
                table.serialize((of_motion, rod + 1, station.sigma, now, later))?;
            }
        }
    }
    table.flush()
}

/// Cells of `centerlines.csv` from the column `x` onwards.
fn node_columns(node: &NodeState) -> [f64; 19] {
    let NodeState {
        position: r,
        rotation: q,
        v,
        u,
        n,
        m,
    } = node;
    [
        r.x, r.y, r.z, q.w, q.x, q.y, q.z, v.x, v.y, v.z, u.x, u.y, u.z, n.x, n.y, n.z, m.x, m.y,
        m.z,
    ]
    // Adding zero turns -0 into 0.
    .map(|value| value + 0.0)
}

const SENSITIVITY_HEADER: &str = "key,value,rod,sigma,d_x,d_y,d_z,error";

/// A row of `sensitivity.csv`, with the columns of its header in this order.
#[derive(Serialize)]
struct SensitivityTableRow<'s> {
    key: &'s str,
    value: f64,
    /// Counted from 1.
    rod: usize,
    sigma: f64,
    /// Derivative of the position there with respect to the number of this key.
    derivative: [f64; 3],
    error: Option<f64>,
}

/// `sensitivity.csv`: a row for every number and station, or for the tips where only
/// they are known.
pub fn write_sensitivity_table(leaf: &Equilibrium, out: &mut dyn Write) -> io::Result<()> {
    let all = leaf.sensitivities.iter().flatten();
    out.write_all(&table_header(SENSITIVITY_HEADER))?;
    append_csv_rows(all.flat_map(sensitivity_table_rows), out)
}

fn sensitivity_table_rows(of: &Sensitivity) -> Vec<SensitivityTableRow<'_>> {
    let row = |rod: usize, sigma: f64, derivative: &DVec3, error| SensitivityTableRow {
        key: &of.key,
        value: of.value,
        rod: rod + 1,
        sigma,
        derivative: derivative.to_array(),
        error,
    };
    if of.positions.is_empty() {
        let tips = of.tips.iter().enumerate();
        return tips.map(|(j, d)| row(j, 1.0, d, of.tip_error)).collect();
    }
    let rods = of.positions.iter().enumerate();
    rods.flat_map(|(j, rod)| {
        let nodes = of.stations.iter().zip(rod);
        nodes.map(move |(sigma, d)| row(j, *sigma, d, of.positions_error))
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_look_like_formulas_are_cells_of_text() {
        let names = [
            "=cmd|' /C calc'!A0",
            "@SUM(1+1)",
            "+1+1",
            "-2+3",
            "\t=1",
            "rod",
            "-2",
            "'a",
        ];
        for name in names {
            let cell = text_cell(name);
            let runs = cell.starts_with(FORMULA_STARTS) && cell.parse::<f64>().is_err();
            assert!(!runs, "{cell}");
            assert!(cell == name || cell == format!("'{name}"));
        }
        let output = ScenarioOutput {
            file: "@a.toml".into(),
            exit_status: 2,
            json: br#"{ "scenario": "=1+1", "tolerance": -1e-6 }"#.to_vec(),
        };
        let table = table_of_json_results(&[output]).unwrap();
        let table = String::from_utf8(table).unwrap();
        assert!(table.contains("'@a.toml,2,'=1+1,-1e-6"), "{table}");
    }
}
