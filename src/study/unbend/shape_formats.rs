//! Tables of shapes as other programs write them.
//!
//! - DeepLabCut (A. Mathis et al., Nature Neuroscience 21 (2018), 1281): three lines `scorer`, `bodyparts`, `coords`
//!   name the columns; a row is a frame, of which each body part is a point in pixels.
//! - ADEL and echap (C. Fournier et al.): midribs in cm, a row a point, with `inerv`, the leaf, `x` outwards and `y` up
//!   from its insertion.
//! - biomech (PalmStudio): a field sheet of twelve rows without names, a column a station, in m, kg and degrees.

use crate::study::fit::cells::line_error;
use crate::study::fit::columns::FitError;
use crate::words;

words! {
    /// A program whose tables of shapes are read.
    pub enum ShapeFormat {
        /// Midribs of ADEL and echap, in cm.
        Adel = "adel",
        /// A field sheet of biomech, in m and kg.
        Biomech = "biomech",
    }
}

/// Points of which DeepLabCut is less sure are left out, as by its own default (`pcutoff`).
const LEAST_LIKELIHOOD: f64 = 0.6;

/// What the first lines of a table of DeepLabCut begin with.
const HEADS: [&str; 3] = ["scorer", "bodyparts", "coords"];

/// The points in a table of DeepLabCut.
pub(super) struct VideoPoints {
    /// A table with a row a point: `frame`, `bodypart`, `pixel_x`, `pixel_y`.
    pub table: String,
    /// The number of frames.
    pub frames: usize,
    /// The names of the body parts.
    pub parts: Vec<String>,
}

/// The points in a table of DeepLabCut; `None` of any other table.
///
/// # Errors
/// Several animals, or rows that are no such table.
pub(super) fn deeplabcut_points(text: &str, file: &str) -> Result<Option<VideoPoints>, FitError> {
    let first = text.lines().next().unwrap_or_default();
    let is_scorer = |mark: &char| first.split(*mark).next().map(str::trim) == Some(HEADS[0]);
    // Spreadsheets save the table with other marks between the cells.
    let Some(mark) = [',', ';', '\t'].into_iter().find(is_scorer) else {
        return Ok(None);
    };
    let divided =
        |line: &str| -> Vec<String> { line.split(mark).map(|cell| cell.trim().into()).collect() };
    let mut lines = text.lines().enumerate();
    let mut heads: Vec<Vec<String>> = Vec::new();
    for name in HEADS {
        let (k, line) = lines.next().unwrap_or((heads.len(), ""));
        let cells = divided(line);
        if cells[0] == "individuals" {
            let why = "names individuals: give the table of one of them, without this line";
            return Err(line_error(file, k + 1, why));
        }
        if cells[0] != name {
            let why = format!(
                "must begin with {name}: a table of DeepLabCut has the lines {}, and a row for each frame below",
                HEADS.join(", ")
            );
            return Err(line_error(file, k + 1, why));
        }
        heads.push(cells);
    }
    let (parts, coordinates) = (&heads[1], &heads[2]);
    let column = |part: &str, coordinate: &str| {
        let mut both = parts.iter().zip(coordinates);
        both.position(|(one, other)| *one == part && *other == coordinate)
    };
    let mut named: Vec<&str> = Vec::new();
    for part in parts.iter().skip(1).filter(|part| !part.is_empty()) {
        if !named.contains(&part.as_str()) {
            named.push(part);
        }
    }
    let mut table = String::from("frame,bodypart,pixel_x,pixel_y\n");
    let mut frames = 0;
    for (k, line) in lines.filter(|(_, line)| !line.trim().is_empty()) {
        let cells = match mark {
            ',' => divided(line),
            _ => divided(&line.replace(',', ".")),
        };
        frames += 1;
        for part in &named {
            let [Some(x), Some(y)] = ["x", "y"].map(|name| column(part, name)) else {
                let why = format!("{part} has no columns x and y");
                return Err(line_error(file, 3, why));
            };
            let cell = |at: usize| cells.get(at).map_or("", String::as_str);
            let number = |at: usize| cell(at).parse::<f64>().ok().filter(|it| it.is_finite());
            let likelihood = column(part, "likelihood").and_then(number);
            if likelihood.is_some_and(|likelihood| likelihood < LEAST_LIKELIHOOD) {
                continue;
            }
            match (number(x), number(y)) {
                (Some(_), Some(_)) => {
                    table += &format!("{},{part},{},{}\n", cell(0), cell(x), cell(y));
                }
                // Where nothing was seen there is nothing, or NaN.
                _ if [x, y]
                    .iter()
                    .all(|at| matches!(cell(*at), "" | "nan" | "NaN")) => {}
                _ => {
                    let why = format!(
                        "{part}: {}, {} must be two numbers, or empty",
                        cell(x),
                        cell(y)
                    );
                    return Err(line_error(file, k + 1, why));
                }
            }
        }
    }
    if frames == 0 {
        let why = "has no row below its three lines: a row of a table of DeepLabCut is a frame";
        return Err(line_error(file, HEADS.len(), why));
    }
    Ok(Some(VideoPoints {
        table,
        frames,
        parts: named.into_iter().map(String::from).collect(),
    }))
}
