//! Measured data, as read from CSV: experiments and traced veins.

use std::collections::BTreeMap;

use super::FitError;
use super::columns::{MeasuredColumn, NAME, Reading, TRACED};
use super::quantity::Quantity;
use super::table::{Table, refuse};
use super::view::{COORDINATES, IN_PHOTO, Seen};
use crate::study::Keys;

/// Origin of a number: a file and a line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Origin {
    /// Name of the file.
    pub file: String,
    /// Line, counted from 1.
    pub line: usize,
}

impl std::fmt::Display for Origin {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        write!(f, "{}:{}", self.file, self.line)
    }
}

/// A measured number.
#[derive(Clone, Debug)]
pub struct Measured {
    /// The quantity.
    pub quantity: Quantity,
    /// Its value; none for a candidate.
    pub value: Option<f64>,
    /// Its standard deviation, if known.
    pub sd: Option<f64>,
}

/// One experiment.
#[derive(Clone, Debug)]
pub struct Experiment {
    /// Its name, or its number.
    pub name: String,
    /// Numbers of the scenario during the experiment.
    pub settings: Vec<(Keys, f64)>,
    /// What was measured.
    pub measured: Vec<Measured>,
    /// Its position in the data.
    pub origin: Option<Origin>,
}

/// A point on a vein.
#[derive(Clone, Debug)]
pub struct Traced {
    /// The name of its experiment; none: the scenario without changes.
    pub experiment: Option<String>,
    /// Rod, counted from 0.
    pub rod: usize,
    /// Fraction of the length, for a marked point.
    pub sigma: Option<f64>,
    /// The coordinates measured: x, y, z, or pixels of a photograph to the right and down.
    pub at: [Option<f64>; 5],
    /// Standard deviation of each, if known.
    pub sd: Option<f64>,
    /// Its position in the data.
    pub origin: Origin,
}

impl Traced {
    /// Whether it was traced in a photograph.
    pub(super) fn is_in_photo(&self) -> bool {
        self.at[IN_PHOTO..].iter().any(Option::is_some)
    }
}

/// A file of data, and how much of it was read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DataFile {
    /// Its name.
    pub file: String,
    /// Number of rows.
    pub rows: usize,
    /// Number of lines left out because they are comments.
    pub comments: usize,
    /// How many of these are among the rows, below the header.
    pub comments_among_rows: usize,
    /// What it was taken for, where that is not the usual CSV, in words.
    pub taken: Vec<String>,
    /// What was left out, in words.
    pub left_out: Vec<String>,
    /// Names of its columns.
    pub names: Vec<String>,
    /// What the columns that are used are: keys, results, and others of the data.
    pub quantities: Vec<String>,
}

/// All data.
#[derive(Clone, Debug, Default)]
pub struct Data {
    /// How files are read.
    pub reading: Reading,
    /// The files.
    pub files: Vec<DataFile>,
    /// Experiments.
    pub experiments: Vec<Experiment>,
    /// Points on veins.
    pub traced: Vec<Traced>,
}

impl Data {
    /// Adds a file of measured data, a text or its bytes; `veins` is the number of rods.
    ///
    /// # Errors
    /// What cannot be read, or not in one way only.
    pub fn read(
        &mut self,
        table: impl AsRef<[u8]>,
        file: &str,
        veins: usize,
    ) -> Result<(), FitError> {
        let table = Table::of(table.as_ref(), file, &self.reading)?;
        self.files.push(DataFile {
            file: file.into(),
            rows: table.rows(),
            comments: table.comments[0],
            comments_among_rows: table.comments[1],
            taken: table.taken.clone(),
            left_out: table.left_out.clone(),
            names: table.names.clone(),
            quantities: table.header.clone(),
        });
        // A table of points has at least two of these, or one and sigma.
        let mut names = COORDINATES.iter().chain(&["rod"]);
        match names.any(|name| table.column(name).is_some()) {
            true => self.read_traced(&table, veins),
            false => {
                let experiments = experiments(&table, false, self.experiments.len())?;
                self.experiments.extend(experiments);
                Ok(())
            }
        }
    }

    /// Checks that every column that was given a quantity is in one of the files.
    pub(super) fn check_columns(&self) -> Result<(), FitError> {
        let is_in = |file: &DataFile, name: &String| file.names.contains(name);
        for column in &self.reading.columns {
            if !self.files.iter().any(|file| is_in(file, &column.name)) {
                let files = self.files.iter();
                let files =
                    files.map(|file| format!("{} has {}", file.file, file.names.join(", ")));
                return Err(FitError::Data(format!(
                    "no file of data has a column {}: {}",
                    column.name,
                    files.collect::<Vec<_>>().join("; ")
                )));
            }
        }
        Ok(())
    }

    /// Checks that every column on which rows are chosen is in one of the files.
    pub(super) fn check_choices(&self) -> Result<(), FitError> {
        let choices = self.reading.rows.iter().flat_map(|it| &it.conditions);
        for condition in choices {
            let column = &condition.column;
            if !(self.files.iter()).any(|file| file.quantities.contains(column)) {
                let files = self.files.iter();
                let files =
                    files.map(|file| format!("{} has {}", file.file, file.quantities.join(", ")));
                return Err(FitError::Data(format!(
                    "rows are chosen by {column}, which is a column of no file of data: {}",
                    files.collect::<Vec<_>>().join("; ")
                )));
            }
        }
        Ok(())
    }

    fn read_traced(&mut self, table: &Table, veins: usize) -> Result<(), FitError> {
        let strange = table
            .header
            .iter()
            .find(|name| !TRACED.contains(&name.as_str()));
        if let Some(name) = strange {
            let why = format!(
                "unknown column {name}: points on veins have {}; {}",
                TRACED.join(", "),
                renamed(name)
            );
            return Err(refuse(table.file, table.header_line, why));
        }
        let column = |name: &str| table.column(name);
        if column("rod").is_none() && veins > 1 {
            let why = format!("points on veins need a column rod, from 1 to {veins} (leaf.rods)");
            return Err(refuse(table.file, table.header_line, why));
        }
        for row in 0..table.rows() {
            let line = table.line(row);
            let number = |name: &str| match column(name) {
                Some(column) => table.number(row, column),
                None => Ok(None),
            };
            // Of one vein, every point is on that.
            let rod = match column("rod") {
                Some(column) => table.number(row, column)?,
                None => Some(1.0),
            };
            let rod = rod.filter(|rod| rod.fract() == 0.0);
            let Some(rod) = rod.filter(|rod| (1.0..=veins as f64).contains(rod)) else {
                let cell = column("rod").map_or("", |column| table.cell(row, column));
                let found = if cell.is_empty() { "nothing" } else { cell };
                let why =
                    format!("rod = {found}: must be a whole number from 1 to {veins} (leaf.rods)");
                return Err(refuse(table.file, line, why));
            };
            let sigma = number("sigma")?;
            if let Some(sigma) = sigma.filter(|sigma| !(0.0..=1.0).contains(sigma)) {
                let why =
                    format!("sigma = {sigma}: is a fraction of the vein's length, from 0 to 1");
                return Err(refuse(table.file, line, why));
            }
            let mut at = Seen::default();
            for (place, name) in at.iter_mut().zip(COORDINATES) {
                *place = number(name)?;
            }
            let [seen, pixels] = [&at[..IN_PHOTO], &at[IN_PHOTO..]]
                .map(|coordinates| coordinates.iter().flatten().count());
            if seen > 0 && pixels > 0 {
                let why = "a point has coordinates x, y, z, or those in a photograph, pixel_x, pixel_y: \
                           leave one of them out";
                return Err(refuse(table.file, line, why));
            }
            if seen + pixels < 2 && sigma.is_none() || seen + pixels == 0 {
                let why = "at least two of x, y, z are needed, or pixel_x and pixel_y, or one of them and sigma";
                return Err(refuse(table.file, line, why));
            }
            let experiment = column(NAME).map(|column| table.cell(row, column));
            self.traced.push(Traced {
                experiment: experiment.filter(|name| !name.is_empty()).map(String::from),
                rod: rod as usize - 1,
                sigma,
                at,
                sd: match column("sd") {
                    Some(column) => table.positive(row, column)?,
                    None => None,
                },
                origin: Origin {
                    file: table.file.into(),
                    line,
                },
            });
        }
        Ok(())
    }
}

/// Candidate experiments: like those made, but without measured values.
pub fn candidates(
    table: &[u8],
    file: &str,
    columns: &[MeasuredColumn],
) -> Result<Vec<Experiment>, FitError> {
    let reading = Reading {
        columns: columns.to_vec(),
        ..Reading::default()
    };
    experiments(&Table::of(table, file, &reading)?, true, 0)
}

/// How a column with another name is used.
fn renamed(name: &str) -> String {
    format!(
        "name it so in the file, or say what it is by the option column, as in '{name}=tip_x': columns \
         that mean nothing are then left out"
    )
}

/// The meaning of a column of experiments.
enum Column {
    Name,
    Setting(Keys),
    Result(Quantity),
    Deviation(Quantity),
}

fn column(table: &Table, name: &str) -> Result<Column, FitError> {
    let quantity = |text: &str| text.parse::<Quantity>().ok();
    if name == NAME {
        return Ok(Column::Name);
    }
    if let Some(quantity) = quantity(name) {
        return Ok(Column::Result(quantity));
    }
    if let Some(quantity) = name.strip_prefix("sd_").and_then(quantity) {
        return Ok(Column::Deviation(quantity));
    }
    name.parse().map(Column::Setting).map_err(|refused| {
        let why = match name.contains('.') {
            true => format!("column {refused}"),
            false => format!(
                "unknown column {name}: columns are keys of the scenario, such as \
                 load.tip_force[0], results ({}), their standard deviations (sd_tip_x), \
                 experiment, a name, or rod, x, y, z (or pixel_x, pixel_y) of points on veins; {}",
                Quantity::ALL,
                renamed(name)
            ),
        };
        refuse(table.file, table.header_line, why)
    })
}

fn experiments(
    table: &Table,
    candidates: bool,
    before: usize,
) -> Result<Vec<Experiment>, FitError> {
    let columns = table.header.iter().map(|name| column(table, name));
    let columns = columns.collect::<Result<Vec<_>, _>>()?;
    let results: Vec<Quantity> = (columns.iter())
        .filter_map(|column| match column {
            Column::Result(quantity) => Some(*quantity),
            _ => None,
        })
        .collect();
    for column in &columns {
        if let Column::Deviation(quantity) = column
            && !results.contains(quantity)
        {
            let why = format!("sd_{quantity} without {quantity}: add that column");
            return Err(refuse(table.file, table.header_line, why));
        }
    }
    if results.is_empty() && candidates {
        let why = format!("no column is a result ({})", Quantity::ALL);
        return Err(refuse(table.file, table.header_line, why));
    }
    let mut found = Vec::new();
    for row in 0..table.rows() {
        let line = table.line(row);
        let mut experiment = Experiment {
            name: (before + row + 1).to_string(),
            settings: Vec::new(),
            measured: Vec::new(),
            origin: Some(Origin {
                file: table.file.into(),
                line,
            }),
        };
        let mut deviations = BTreeMap::new();
        for (k, column) in columns.iter().enumerate() {
            match column {
                Column::Name if !table.cell(row, k).is_empty() => {
                    experiment.name = table.cell(row, k).into();
                }
                Column::Name => {}
                Column::Setting(keys) => {
                    let Some(value) = table.number(row, k)? else {
                        let why = format!("{keys} is empty: every experiment needs its value");
                        return Err(refuse(table.file, line, why));
                    };
                    experiment.settings.push((keys.clone(), value));
                }
                Column::Result(quantity) => {
                    let value = table.number(row, k)?;
                    if value.is_some() || candidates {
                        experiment.measured.push(Measured {
                            quantity: *quantity,
                            value,
                            sd: None,
                        });
                    }
                }
                Column::Deviation(quantity) => {
                    deviations.insert(quantity.to_string(), table.positive(row, k)?);
                }
            }
        }
        for measured in &mut experiment.measured {
            let sd = deviations.get(&measured.quantity.to_string());
            measured.sd = sd.copied().flatten();
        }
        found.push(experiment);
    }
    Ok(found)
}
