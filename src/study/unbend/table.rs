//! Tables of points on postures: coordinates from base to tip, or pixels of a photograph.

use crate::posture::points::PosturePoints;
use crate::scenario::Scenario;
use crate::study::fit::columns::{
    DataFileOptions, EXPERIMENT_NAME_COLUMN, FitError, MeasuredColumn,
};
use crate::study::fit::table::{DataTable, KnownColumns, line_error};
use glam::DVec3;

/// Coordinates of a point in space.
const COORDINATES: [&str; 3] = ["x", "y", "z"];

/// Coordinates of a point in a photograph.
const PIXELS: [&str; 2] = ["pixel_x", "pixel_y"];

/// Components of the blade's normal, d3.
const NORMALS: [&str; 3] = ["normal_x", "normal_y", "normal_z"];

/// The standard deviation of a coordinate.
const DEVIATION: &str = "sd";

fn is_posture_column(name: &str) -> bool {
    let all = COORDINATES.iter().chain(&PIXELS).chain(&NORMALS);
    name == DEVIATION || all.into_iter().any(|known| *known == name)
}

/// The points of one leaf of a table.
#[derive(Clone, Debug)]
pub struct NamedPosture {
    /// The cell of the column that groups rows; empty without one.
    pub name: String,
    /// Its points.
    pub points: PosturePoints,
    /// What coordinates were taken for, where that is not what their names say.
    pub taken: Option<&'static str>,
}

/// Where coordinates of a table lead.
enum Coordinates {
    Space([usize; 3]),
    /// Two columns, the directions of their axes, and what that means.
    Plane([usize; 2], [DVec3; 2], Option<&'static str>),
    Photo([usize; 2]),
}

/// Reads a table of points, from base to tip; `group` names the column by which rows belong to one leaf or another.
///
/// # Errors
/// What cannot be read, or not in one way only.
pub fn read_postures(
    table: &[u8],
    file: &str,
    group: Option<&str>,
    scenario: &Scenario,
) -> Result<Vec<NamedPosture>, FitError> {
    let mut reading = DataFileOptions::default();
    if let Some(group) = group {
        reading.columns.push(MeasuredColumn {
            name: group.into(),
            quantity: EXPERIMENT_NAME_COLUMN.into(),
            factor: 1.0,
            offset: 0.0,
        });
    }
    let columns = KnownColumns {
        is_known: &is_posture_column,
        leaves_out_others: true,
    };
    let table = DataTable::parse_with_columns(table, file, &reading, &columns)?;
    let by = match group {
        Some(group) => Some(table.column_index(EXPERIMENT_NAME_COLUMN).ok_or_else(|| {
            let why = format!(
                "has no column {group}: its columns are {}",
                table.names.join(", ")
            );
            line_error(file, table.header_line, why)
        })?),
        None => None,
    };
    let coordinates = coordinates(&table, scenario)?;
    let deviation = table.column_index(DEVIATION);
    let normals = NORMALS.map(|name| table.column_index(name));
    let has_normals = normals.iter().any(Option::is_some);
    if has_normals && normals.iter().any(Option::is_none) {
        let why =
            "a normal has three components: give normal_x, normal_y and normal_z, or none of them";
        return Err(line_error(file, table.header_line, why));
    }
    let mut found: Vec<NamedPosture> = Vec::new();
    for row in 0..table.row_count() {
        let number = |column: usize| -> Result<f64, FitError> {
            table.number(row, column)?.ok_or_else(|| {
                let name = &table.header[column];
                let why = format!("{name} is empty: a point of a posture needs all its coordinates; leave the row out");
                line_error(file, table.line_number(row), why)
            })
        };
        let (position, plane, taken) = match &coordinates {
            Coordinates::Space(columns) => {
                let [x, y, z] = columns.map(number);
                (DVec3::new(x?, y?, z?), None, None)
            }
            Coordinates::Plane(columns, axes, taken) => {
                let [a, b] = columns.map(number);
                (
                    a? * axes[0] + b? * axes[1],
                    Some(axes[0].cross(axes[1])),
                    *taken,
                )
            }
            Coordinates::Photo(columns) => {
                let [x, y] = columns.map(number);
                let photo = scenario.photo.as_ref();
                let photo = photo.ok_or_else(|| {
                    let why = "pixel_x, pixel_y: the scenario has no [photo], which says how large a pixel is; add it, or give x, y, z";
                    line_error(file, table.header_line, why)
                })?;
                let seen = photo.point_at_pixel([x?, y?]).map(|one| one.unwrap_or(0.0));
                (
                    DVec3::from_array(seen),
                    Some(photo.right.cross(photo.up)),
                    None,
                )
            }
        };
        let name = by.map_or("", |column| table.cell(row, column));
        let at = found.iter().position(|leaf| leaf.name == name);
        let at = at.unwrap_or_else(|| {
            found.push(NamedPosture {
                name: name.into(),
                points: PosturePoints {
                    plane,
                    normals: has_normals.then(Vec::new),
                    sd: deviation.map(|_| Vec::new()),
                    ..PosturePoints::default()
                },
                taken,
            });
            found.len() - 1
        });
        let points = &mut found[at].points;
        points.positions.push(position);
        if let (Some(all), [Some(x), Some(y), Some(z)]) = (&mut points.normals, normals) {
            all.push(DVec3::new(number(x)?, number(y)?, number(z)?));
        }
        if let (Some(all), Some(column)) = (&mut points.sd, deviation) {
            let sd = table.positive_number(row, column)?;
            all.push(sd.ok_or_else(|| {
                let why = "sd is empty: give the standard deviation of every point, or leave the column out";
                line_error(file, table.line_number(row), why)
            })?);
        }
    }
    // Deviations in a photograph are those of pixels.
    if let (Coordinates::Photo(_), Some(photo)) = (&coordinates, &scenario.photo) {
        for leaf in &mut found {
            for sd in leaf.points.sd.iter_mut().flatten() {
                *sd *= photo.scale;
            }
        }
    }
    Ok(found)
}

/// Which columns are coordinates, and of what.
fn coordinates(table: &DataTable, scenario: &Scenario) -> Result<Coordinates, FitError> {
    let refuse = |why: &str| Err(line_error(table.file, table.header_line, why));
    let axes = COORDINATES.map(|name| table.column_index(name));
    let pixels = PIXELS.map(|name| table.column_index(name));
    let some = axes.iter().any(Option::is_some);
    match (axes, pixels) {
        ([None, None, None], [Some(x), Some(y)]) => Ok(Coordinates::Photo([x, y])),
        _ if some && pixels.iter().any(Option::is_some) => {
            refuse("has x, y, z and pixel_x, pixel_y: leave one of them out")
        }
        ([Some(x), Some(y), Some(z)], _) => Ok(Coordinates::Space([x, y, z])),
        ([Some(x), None, Some(z)], _) => Ok(Coordinates::Plane([x, z], [DVec3::X, DVec3::Z], None)),
        ([None, Some(y), Some(z)], _) => Ok(Coordinates::Plane([y, z], [DVec3::Y, DVec3::Z], None)),
        ([Some(x), Some(y), None], _) => {
            let pull = scenario.total_load() + DVec3::from_array(scenario.tip_force);
            let upright = pull.z.abs() > pull.x.abs().max(pull.y.abs());
            Ok(match upright {
                true => Coordinates::Plane(
                    [x, y],
                    [DVec3::X, DVec3::Z],
                    Some("y was taken upwards, as z of the scenario, along which the loads pull"),
                ),
                false => Coordinates::Plane([x, y], [DVec3::X, DVec3::Y], None),
            })
        }
        _ => refuse(
            "has no coordinates of points: name two or three columns x, y, z (from base to tip), or two pixel_x, pixel_y",
        ),
    }
}
