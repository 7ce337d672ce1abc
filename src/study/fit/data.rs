//! Measured data, as read from CSV: experiments and traced veins.

use std::collections::BTreeMap;

use super::FitError;
use super::quantity::Quantity;
use super::table::{NAME, Table, refuse};
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
    /// The coordinates measured.
    pub at: [Option<f64>; 3],
    /// Standard deviation of each, if known.
    pub sd: Option<f64>,
    /// Its position in the data.
    pub origin: Origin,
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
}

/// All data.
#[derive(Clone, Debug, Default)]
pub struct Data {
    /// The files.
    pub files: Vec<DataFile>,
    /// Experiments.
    pub experiments: Vec<Experiment>,
    /// Points on veins.
    pub traced: Vec<Traced>,
}

impl Data {
    /// Adds a file of measured data; `veins` is the number of rods.
    pub fn read(&mut self, text: &str, file: &str, veins: usize) -> Result<(), FitError> {
        let table = Table::of(text, file)?;
        self.files.push(DataFile {
            file: file.into(),
            rows: table.rows.len(),
            comments: table.comments,
            comments_among_rows: table.comments_among_rows,
        });
        match table.header.contains(&"rod") {
            true => self.read_traced(&table, veins),
            false => {
                let experiments = experiments(&table, false, self.experiments.len())?;
                self.experiments.extend(experiments);
                Ok(())
            }
        }
    }

    fn read_traced(&mut self, table: &Table, veins: usize) -> Result<(), FitError> {
        let known = ["rod", "x", "y", "z", "sigma", "sd", NAME];
        let strange = table.header.iter().find(|name| !known.contains(name));
        if let Some(name) = strange {
            let why = format!(
                "unknown column {name}: points on veins have {}",
                known.join(", ")
            );
            return Err(refuse(table.file, 1, why));
        }
        let column = |name: &str| table.header.iter().position(|known| *known == name);
        for row in 0..table.rows.len() {
            let line = table.rows[row].0;
            let number = |name: &str| match column(name) {
                Some(column) => table.number(row, column),
                None => Ok(None),
            };
            let rod = number("rod")?.filter(|rod| rod.fract() == 0.0);
            let Some(rod) = rod.filter(|rod| (1.0..=veins as f64).contains(rod)) else {
                let cell = column("rod").map_or("", |column| table.rows[row].1[column]);
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
            let at = [number("x")?, number("y")?, number("z")?];
            let seen = at.iter().flatten().count();
            if seen < 2 && sigma.is_none() || seen == 0 {
                let why = "at least two of x, y, z are needed, or one and sigma";
                return Err(refuse(table.file, line, why));
            }
            let experiment = column(NAME).map(|column| table.rows[row].1[column]);
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
pub fn candidates(text: &str, file: &str) -> Result<Vec<Experiment>, FitError> {
    experiments(&Table::of(text, file)?, true, 0)
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
                 load.tip_force[0], results ({}), their standard deviations (sd_tip_x), and \
                 experiment, a name",
                Quantity::ALL
            ),
        };
        refuse(table.file, 1, why)
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
            return Err(refuse(table.file, 1, why));
        }
    }
    if results.is_empty() && candidates {
        let why = format!("no column is a result ({})", Quantity::ALL);
        return Err(refuse(table.file, 1, why));
    }
    let mut found = Vec::new();
    for (row, (line, cells)) in table.rows.iter().enumerate() {
        let mut experiment = Experiment {
            name: (before + row + 1).to_string(),
            settings: Vec::new(),
            measured: Vec::new(),
            origin: Some(Origin {
                file: table.file.into(),
                line: *line,
            }),
        };
        let mut deviations = BTreeMap::new();
        for (k, column) in columns.iter().enumerate() {
            match column {
                Column::Name if !cells[k].is_empty() => experiment.name = cells[k].into(),
                Column::Name => {}
                Column::Setting(keys) => {
                    let Some(value) = table.number(row, k)? else {
                        let why = format!("{keys} is empty: every experiment needs its value");
                        return Err(refuse(table.file, *line, why));
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
