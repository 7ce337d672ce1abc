//! Tables of points on postures: coordinates from base to tip, or pixels of a photograph.

use crate::posture::points::PosturePoints;
use crate::scenario::Scenario;
use crate::study::fit::cells::{DecodedText, decode, line_error};
use crate::study::fit::columns::{
    DataFileOptions, EXPERIMENT_NAME_COLUMN, FitError, MeasuredColumn, NORMAL_COLUMNS,
};
use crate::study::fit::table::{DataTable, KnownColumns};
use crate::study::unbend::outline::BladeOutline;
use crate::study::unbend::shape_formats::{ShapeFormat, deeplabcut_points};
use crate::study::unbend::sheet::read_field_sheet;
use glam::DVec3;

/// Coordinates of a point in space.
const COORDINATES: [&str; 3] = ["x", "y", "z"];

/// Coordinates of a point in a photograph.
const PIXELS: [&str; 2] = ["pixel_x", "pixel_y"];

/// The standard deviation of a coordinate.
const DEVIATION: &str = "sd";

/// The number of a leaf in tables of ADEL.
const ADEL_LEAF: &str = "inerv";

fn is_posture_column(name: &str) -> bool {
    let all = COORDINATES.iter().chain(&PIXELS).chain(&NORMAL_COLUMNS);
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
    pub taken: Option<String>,
    /// Whether the format of the table says the unit of the points.
    pub is_unit_known: bool,
    /// The scenario with what the table has besides the points, if it has: sections and weight, or the outline.
    pub scenario: Option<Box<Scenario>>,
}

/// How a table of points is read.
#[derive(Clone, Debug, Default)]
pub struct ShapeTableOptions {
    /// The column by which rows belong to one leaf or another.
    pub group: Option<String>,
    /// The program that wrote the table; `None`: its columns have the names of this one, or are given.
    pub format: Option<ShapeFormat>,
    /// Columns that have other names, or, without a header, numbers.
    pub columns: Vec<MeasuredColumn>,
}

/// Where coordinates of a table lead.
enum Coordinates {
    Space([usize; 3]),
    /// Two columns, the directions of their axes, and what that means.
    Plane([usize; 2], [DVec3; 2], Option<&'static str>),
    Photo([usize; 2]),
}

/// Reads a table of points, from base to tip.
///
/// # Errors
/// What cannot be read, or not in one way only.
pub fn read_postures(
    table: &[u8],
    file: &str,
    options: &ShapeTableOptions,
    scenario: &Scenario,
) -> Result<Vec<NamedPosture>, FitError> {
    let decoded = decode(table, file)?;
    if options.format == Some(ShapeFormat::Biomech) {
        let sheet = read_field_sheet(&decoded.text, file)?;
        if options.group.is_some() || !options.columns.is_empty() {
            let why =
                "a field sheet of biomech has one leaf and no columns to choose: leave them out";
            return Err(line_error(file, 1, why));
        }
        return Ok(vec![NamedPosture {
            name: String::new(),
            points: sheet.points(file, scenario)?,
            taken: Some(
                "sections, weight and length are those of the field sheet, and the factor of the stiffnesses is Young's \
                 modulus in GPa"
                    .into(),
            ),
            is_unit_known: true,
            scenario: Some(Box::new(sheet.scenario(file, scenario)?)),
        }]);
    }
    let Some(video) = deeplabcut_points(&decoded.text, file)? else {
        return read_points(&decoded, file, options, scenario);
    };
    if options.group.is_none() && video.frames > 1 {
        let why = format!(
            "has {} frames: tell them apart by the column frame, or keep one row",
            video.frames
        );
        return Err(line_error(file, 4, why));
    }
    let decoded = DecodedText {
        text: video.table,
        encoding: None,
    };
    let mut found = read_points(&decoded, file, options, scenario)?;
    for leaf in &mut found {
        leaf.taken = Some(format!(
            "the body parts of DeepLabCut were taken as points from base to tip, in their order in the file: {}",
            video.parts.join(", ")
        ));
    }
    Ok(found)
}

/// The points of all leaves of a table with a row a point.
fn read_points(
    decoded: &DecodedText,
    file: &str,
    options: &ShapeTableOptions,
    scenario: &Scenario,
) -> Result<Vec<NamedPosture>, FitError> {
    let mut reading = DataFileOptions {
        columns: options.columns.clone(),
        ..DataFileOptions::default()
    };
    let group = options.group.as_deref();
    if let Some(group) = group {
        reading.columns.push(MeasuredColumn {
            name: group.into(),
            quantity: EXPERIMENT_NAME_COLUMN.into(),
            factor: 1.0,
            offset: 0.0,
        });
    }
    let is_adel = options.format == Some(ShapeFormat::Adel);
    let is_known =
        |name: &str| is_posture_column(name) || is_adel && matches!(name, ADEL_LEAF | "s" | "r");
    let columns = KnownColumns {
        is_known: &is_known,
        leaves_out_others: true,
    };
    check_distinct_names(&reading.columns)?;
    let table = DataTable::parse_text(decoded, file, &reading, &columns)?;
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
    // The unit of coordinates in that of the scenario.
    let unit = match is_adel {
        true => check_midribs(&table, group.is_some(), scenario)?,
        false => 1.0,
    };
    let coordinates = match coordinates(&table, scenario)? {
        Coordinates::Plane(columns, ..) if is_adel => {
            Coordinates::Plane(columns, [unit * DVec3::X, unit * DVec3::Z], None)
        }
        Coordinates::Space(_) | Coordinates::Photo(_) if is_adel => {
            let why = "midribs of ADEL have x and y alone: read other tables without a format";
            return Err(line_error(file, table.header_line, why));
        }
        others => others,
    };
    let deviation = table.column_index(DEVIATION);
    let normals = NORMAL_COLUMNS.map(|name| table.column_index(name));
    let has_normals = normals.iter().any(Option::is_some);
    if has_normals && normals.iter().any(Option::is_none) {
        let why =
            "a normal has three components: give normal_x, normal_y and normal_z, or none of them";
        return Err(line_error(file, table.header_line, why));
    }
    // Leaves of ADEL may have their outline beside the midrib.
    let outline = match (table.column_index("s"), table.column_index("r")) {
        (Some(s), Some(r)) if is_adel => Some([s, r]),
        _ => None,
    };
    let mut outlines: Vec<Vec<[f64; 2]>> = Vec::new();
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
                    Some(axes[0].cross(axes[1]).normalize()),
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
        let at = found.iter().rposition(|leaf| leaf.name == name);
        let at = at.unwrap_or_else(|| {
            found.push(NamedPosture {
                name: name.into(),
                points: PosturePoints {
                    plane,
                    normals: has_normals.then(Vec::new),
                    sd: deviation.map(|_| Vec::new()),
                    ..PosturePoints::default()
                },
                taken: taken.map(String::from),
                is_unit_known: is_adel,
                scenario: None,
            });
            outlines.push(Vec::new());
            found.len() - 1
        });
        if let Some([s, r]) = outline {
            outlines[at].push([number(s)?, number(r)?]);
        }
        let points = &mut found[at].points;
        points.positions.push(position);
        if let (Some(all), [Some(x), Some(y), Some(z)]) = (&mut points.normals, normals) {
            all.push(DVec3::new(number(x)?, number(y)?, number(z)?));
        }
        if let (Some(all), Some(column)) = (&mut points.sd, deviation) {
            let sd = table.positive_number(row, column)?;
            all.push(unit * sd.ok_or_else(|| {
                let why = "sd is empty: give the standard deviation of every point, or leave the column out";
                line_error(file, table.line_number(row), why)
            })?);
        }
    }
    if outline.is_some() {
        for (leaf, rows) in found.iter_mut().zip(&outlines) {
            add_outline(leaf, rows, scenario).map_err(|why| {
                let of = match leaf.name.as_str() {
                    "" => String::new(),
                    name => format!("leaf {name}: "),
                };
                line_error(file, table.header_line, format!("{of}{why}"))
            })?;
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

/// Gives a leaf the outline through its pairs of s and r, if the width of its section counts.
fn add_outline(
    leaf: &mut NamedPosture,
    rows: &[[f64; 2]],
    scenario: &Scenario,
) -> Result<(), String> {
    let outline = BladeOutline::new(rows)?;
    let Some(with_outline) = outline.outlined(scenario) else {
        return Ok(());
    };
    leaf.scenario = Some(Box::new(with_outline?));
    leaf.taken = Some("the width of the section is r times its largest width".into());
    Ok(())
}

/// A centimeter, the unit of ADEL's midribs, in the scenario's unit of length; refuses outlines, and several leaves that
/// nothing tells apart.
fn check_midribs(table: &DataTable, has_group: bool, scenario: &Scenario) -> Result<f64, FitError> {
    let refuse = |why: String| Err(line_error(table.file, table.header_line, why));
    if table.column_index("x").is_none() && table.column_index("r").is_some() {
        return refuse(
            "has s and r: it is an outline, not a midrib; it belongs to the scenario, as its outline or as section.width = \
             { at = [s ..], value = [r times the largest width ..] }"
                .into(),
        );
    }
    if let (Some(column), false) = (table.column_index(ADEL_LEAF), has_group) {
        let mut leaves: Vec<&str> = Vec::new();
        for row in 0..table.row_count() {
            let leaf = table.cell(row, column);
            if leaves.last() != Some(&leaf) {
                leaves.push(leaf);
            }
        }
        if leaves.len() > 1 {
            return refuse(format!(
                "has {} leaves: tell them apart by the column {ADEL_LEAF}, or keep the rows of one",
                leaves.len()
            ));
        }
    }
    match scenario.units.meters() {
        Some(meters) => Ok(0.01 / meters),
        None => refuse(
            "midribs of ADEL are in cm, and the scenario does not say its unit: give units.length as m, cm, mm, in or ft"
                .into(),
        ),
    }
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

/// Refuses two coordinates that are said to be one column.
fn check_distinct_names(columns: &[MeasuredColumn]) -> Result<(), FitError> {
    for (k, map) in columns.iter().enumerate() {
        if let Some(other) = columns[..k].iter().find(|other| other.name == map.name) {
            return Err(FitError::Data(format!(
                "column {}={}: {} is {} already: name each column once",
                map.name, map.quantity, map.name, other.quantity
            )));
        }
    }
    Ok(())
}
