//! Measured data: experiments with settings and results, and points traced on veins, as read from
//! tables.
//!
//! Experiments under the same conditions share a leaf: they are one [`ExperimentCase`].

use crate::study::ParameterKeys;
use crate::study::fit::cells::line_error;
use crate::study::fit::columns::{
    COORDINATE_COLUMNS, DataFileOptions, EXPERIMENT_NAME_COLUMN, FIRST_PHOTO_COORDINATE, FitError,
    MeasuredColumn, MeasuredQuantity, ObservedCoordinates, TRACED_POINT_COLUMNS,
};
use crate::study::fit::table::DataTable;
use std::collections::{BTreeMap, HashMap};

/// Origin of a number: a file and a line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DataOrigin {
    /// Name of the file.
    pub file: String,
    /// Line, counted from 1.
    pub line: usize,
}

impl std::fmt::Display for DataOrigin {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        write!(f, "{}:{}", self.file, self.line)
    }
}

/// A measured number.
#[derive(Clone, Debug)]
pub struct MeasuredValue {
    /// The quantity.
    pub quantity: MeasuredQuantity,
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
    pub settings: Vec<(ParameterKeys, f64)>,
    /// What was measured.
    pub measured: Vec<MeasuredValue>,
    /// Its position in the data.
    pub origin: Option<DataOrigin>,
}

/// A point on a vein.
#[derive(Clone, Debug)]
pub struct TracedVeinPoint {
    /// The name of its experiment; none: the scenario without changes.
    pub experiment: Option<String>,
    /// Rod, counted from 0.
    pub rod: usize,
    /// Fraction of the length, for a marked point.
    pub sigma: Option<f64>,
    /// The coordinates measured: x, y, z, or pixels of a photograph to the right and down.
    pub coordinates: [Option<f64>; 5],
    /// Standard deviation of each, if known.
    pub sd: Option<f64>,
    /// Its position in the data.
    pub origin: DataOrigin,
}

impl TracedVeinPoint {
    /// Whether it was traced in a photograph.
    pub(super) fn is_in_photo(&self) -> bool {
        self.coordinates[FIRST_PHOTO_COORDINATE..]
            .iter()
            .any(Option::is_some)
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
    pub reading: DataFileOptions,
    /// The files.
    pub files: Vec<DataFile>,
    /// Experiments.
    pub experiments: Vec<Experiment>,
    /// Points on veins.
    pub traced: Vec<TracedVeinPoint>,
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
        let table = DataTable::parse(table.as_ref(), file, &self.reading)?;
        self.files.push(DataFile {
            file: file.into(),
            rows: table.row_count(),
            comments: table.comments[0],
            comments_among_rows: table.comments[1],
            taken: table.taken.clone(),
            left_out: table.left_out.clone(),
            names: table.names.clone(),
            quantities: table.header.clone(),
        });
        // A table of points has at least two of these, or one and sigma.
        let mut names = COORDINATE_COLUMNS.iter().chain(&["rod"]);
        match names.any(|name| table.column_index(name).is_some()) {
            true => self.read_traced(&table, veins),
            false => {
                let experiments = read_experiments(&table, false, self.experiments.len())?;
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

    fn read_traced(&mut self, table: &DataTable, veins: usize) -> Result<(), FitError> {
        let strange = table
            .header
            .iter()
            .find(|name| !TRACED_POINT_COLUMNS.contains(&name.as_str()));
        if let Some(name) = strange {
            let why = format!(
                "unknown column {name}: points on veins have {}; {}",
                TRACED_POINT_COLUMNS.join(", "),
                column_naming_advice(name)
            );
            return Err(line_error(table.file, table.header_line, why));
        }
        let column = |name: &str| table.column_index(name);
        if column("rod").is_none() && veins > 1 {
            let why = format!("points on veins need a column rod, from 1 to {veins} (leaf.rods)");
            return Err(line_error(table.file, table.header_line, why));
        }
        for row in 0..table.row_count() {
            let line = table.line_number(row);
            let number = |name: &str| match column(name) {
                Some(column) => table.number(row, column),
                None => Ok(None),
            };
            // A leaf of one vein needs no column: every point is on that vein.
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
                return Err(line_error(table.file, line, why));
            };
            let sigma = number("sigma")?;
            if let Some(sigma) = sigma.filter(|sigma| !(0.0..=1.0).contains(sigma)) {
                let why =
                    format!("sigma = {sigma}: is a fraction of the vein's length, from 0 to 1");
                return Err(line_error(table.file, line, why));
            }
            let mut at = ObservedCoordinates::default();
            for (place, name) in at.iter_mut().zip(COORDINATE_COLUMNS) {
                *place = number(name)?;
            }
            let [seen, pixels] = [&at[..FIRST_PHOTO_COORDINATE], &at[FIRST_PHOTO_COORDINATE..]]
                .map(|coordinates| coordinates.iter().flatten().count());
            if seen > 0 && pixels > 0 {
                let why = "a point has coordinates x, y, z, or those in a photograph, pixel_x, pixel_y: \
                           leave one of them out";
                return Err(line_error(table.file, line, why));
            }
            if seen + pixels < 2 && sigma.is_none() || seen + pixels == 0 {
                let why = "at least two of x, y, z are needed, or pixel_x and pixel_y, or one of them and sigma";
                return Err(line_error(table.file, line, why));
            }
            let experiment = column(EXPERIMENT_NAME_COLUMN).map(|column| table.cell(row, column));
            self.traced.push(TracedVeinPoint {
                experiment: experiment.filter(|name| !name.is_empty()).map(String::from),
                rod: rod as usize - 1,
                sigma,
                coordinates: at,
                sd: match column("sd") {
                    Some(column) => table.positive_number(row, column)?,
                    None => None,
                },
                origin: DataOrigin {
                    file: table.file.into(),
                    line,
                },
            });
        }
        Ok(())
    }
}

/// Candidate experiments: like those made, but without measured values.
pub fn read_candidate_experiments(
    table: &[u8],
    file: &str,
    columns: &[MeasuredColumn],
) -> Result<Vec<Experiment>, FitError> {
    let reading = DataFileOptions {
        columns: columns.to_vec(),
        ..DataFileOptions::default()
    };
    read_experiments(&DataTable::parse(table, file, &reading)?, true, 0)
}

/// How a column with another name is used.
fn column_naming_advice(name: &str) -> String {
    format!(
        "name it so in the file, or say what it is by the option column, as in '{name}=tip_x': columns \
         that mean nothing are then left out"
    )
}

/// The meaning of a column of experiments.
enum ExperimentColumn {
    Name,
    Setting(ParameterKeys),
    Result(MeasuredQuantity),
    Deviation(MeasuredQuantity),
}

fn parse_experiment_column(table: &DataTable, name: &str) -> Result<ExperimentColumn, FitError> {
    let quantity = |text: &str| text.parse::<MeasuredQuantity>().ok();
    if name == EXPERIMENT_NAME_COLUMN {
        return Ok(ExperimentColumn::Name);
    }
    if let Some(quantity) = quantity(name) {
        return Ok(ExperimentColumn::Result(quantity));
    }
    if let Some(quantity) = name.strip_prefix("sd_").and_then(quantity) {
        return Ok(ExperimentColumn::Deviation(quantity));
    }
    name.parse()
        .map(ExperimentColumn::Setting)
        .map_err(|refused| {
            let why = match name.contains('.') {
                true => format!("column {refused}"),
                false => format!(
                    "unknown column {name}: columns are keys of the scenario, such as \
                 load.tip_force[0], results ({}), their standard deviations (sd_tip_x), \
                 experiment, a name, or rod, x, y, z (or pixel_x, pixel_y) of points on veins; {}",
                    MeasuredQuantity::ALL,
                    column_naming_advice(name)
                ),
            };
            line_error(table.file, table.header_line, why)
        })
}

fn read_experiments(
    table: &DataTable,
    candidates: bool,
    before: usize,
) -> Result<Vec<Experiment>, FitError> {
    let columns = table
        .header
        .iter()
        .map(|name| parse_experiment_column(table, name));
    let columns = columns.collect::<Result<Vec<_>, _>>()?;
    let results: Vec<MeasuredQuantity> = (columns.iter())
        .filter_map(|column| match column {
            ExperimentColumn::Result(quantity) => Some(*quantity),
            _ => None,
        })
        .collect();
    for column in &columns {
        if let ExperimentColumn::Deviation(quantity) = column
            && !results.contains(quantity)
        {
            let why = format!("sd_{quantity} without {quantity}: add that column");
            return Err(line_error(table.file, table.header_line, why));
        }
    }
    if results.is_empty() && candidates {
        let why = format!("no column is a result ({})", MeasuredQuantity::ALL);
        return Err(line_error(table.file, table.header_line, why));
    }
    let mut found = Vec::new();
    for row in 0..table.row_count() {
        let line = table.line_number(row);
        let mut experiment = Experiment {
            name: (before + row + 1).to_string(),
            settings: Vec::new(),
            measured: Vec::new(),
            origin: Some(DataOrigin {
                file: table.file.into(),
                line,
            }),
        };
        let mut deviations = BTreeMap::new();
        for (k, column) in columns.iter().enumerate() {
            match column {
                ExperimentColumn::Name if !table.cell(row, k).is_empty() => {
                    experiment.name = table.cell(row, k).into();
                }
                ExperimentColumn::Name => {}
                ExperimentColumn::Setting(keys) => {
                    let Some(value) = table.number(row, k)? else {
                        let why = format!("{keys} is empty: every experiment needs its value");
                        return Err(line_error(table.file, line, why));
                    };
                    experiment.settings.push((keys.clone(), value));
                }
                ExperimentColumn::Result(quantity) => {
                    let value = table.number(row, k)?;
                    if value.is_some() || candidates {
                        experiment.measured.push(MeasuredValue {
                            quantity: *quantity,
                            value,
                            sd: None,
                        });
                    }
                }
                ExperimentColumn::Deviation(quantity) => {
                    deviations.insert(quantity.to_string(), table.positive_number(row, k)?);
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

/// An experiment with the points traced on its veins.
pub(super) struct ObservedExperiment {
    /// Its position in the data.
    pub number: usize,
    pub experiment: Experiment,
    pub traced: Vec<TracedVeinPoint>,
}

/// One experiment or several under the same conditions.
pub(super) struct ExperimentCase {
    /// At least one.
    pub experiments: Vec<ObservedExperiment>,
    /// Whether it differs from the other cases by loads only: it then has the same
    /// derivatives with respect to the free numbers.
    pub differs_by_loads_only: bool,
}

impl ExperimentCase {
    fn new(first: ObservedExperiment) -> ExperimentCase {
        let settings = first.experiment.settings.iter();
        let mut targets = settings.flat_map(|it| it.0.targets());
        let loaded_only = targets.all(|target| {
            let key = target.key();
            key.is_some_and(|key| key.path().starts_with("load."))
        });
        ExperimentCase {
            experiments: vec![first],
            differs_by_loads_only: loaded_only,
        }
    }

    fn first_experiment(&self) -> &Experiment {
        &self.experiments[0].experiment
    }

    /// Numbers of the scenario under its conditions.
    pub fn settings(&self) -> &[(ParameterKeys, f64)] {
        &self.first_experiment().settings
    }

    pub fn measured_values(&self) -> impl Iterator<Item = &MeasuredValue> + Clone {
        self.experiments
            .iter()
            .flat_map(|it| &it.experiment.measured)
    }

    pub fn traced_points(&self) -> impl Iterator<Item = &TracedVeinPoint> + Clone {
        self.experiments.iter().flat_map(|it| &it.traced)
    }

    /// The name of its first experiment.
    pub fn name(&self) -> &str {
        &self.first_experiment().name
    }

    /// The position of its first experiment in the data as the beginning of a message, if it
    /// has one.
    pub fn origin_prefix(&self) -> String {
        let origin = self.first_experiment().origin.as_ref();
        origin.map_or_else(String::new, |origin| format!("{origin}: "))
    }
}

/// The conditions under which there are data. A leaf is relaxed for each of these, however many
/// experiments there are.
pub(super) fn experiment_cases(data: Data) -> Result<Vec<ExperimentCase>, FitError> {
    let mut cases: Vec<ExperimentCase> = Vec::new();
    let mut known = HashMap::new();
    for observed in observed_experiments(data)? {
        let bits = observed.experiment.settings.iter().map(|(keys, value)| {
            // Names identify keys.
            (keys.to_string(), value.to_bits())
        });
        let case = *known.entry(bits.collect::<Vec<_>>()).or_insert(cases.len());
        match cases.get_mut(case) {
            Some(case) => case.experiments.push(observed),
            None => cases.push(ExperimentCase::new(observed)),
        }
    }
    Ok(cases)
}

fn observed_experiments(data: Data) -> Result<Vec<ObservedExperiment>, FitError> {
    let observed = |experiment: Experiment| ObservedExperiment {
        number: 0,
        experiment,
        traced: Vec::new(),
    };
    let mut all: Vec<_> = data.experiments.into_iter().map(observed).collect();
    let mut named: HashMap<String, usize> = HashMap::new();
    for (place, observed) in all.iter().enumerate() {
        let experiment = &observed.experiment;
        let first = *named.entry(experiment.name.clone()).or_insert(place);
        check_same_settings(&all[first].experiment, experiment)?;
    }
    let mut plain = None;
    for traced in data.traced {
        let place = match &traced.experiment {
            Some(name) => *named.get(name).ok_or_else(|| {
                let origin = &traced.origin;
                FitError::Data(format!(
                    "{origin}: experiment {name}: no row of an experiments file has that name"
                ))
            })?,
            None => *plain.get_or_insert_with(|| {
                all.push(observed(Experiment {
                    name: "as it is".into(),
                    settings: Vec::new(),
                    measured: Vec::new(),
                    origin: None,
                }));
                all.len() - 1
            }),
        };
        all[place].traced.push(traced);
    }
    for (number, observed) in all.iter_mut().enumerate() {
        observed.number = number;
    }
    all.retain(|it| !it.experiment.measured.is_empty() || !it.traced.is_empty());
    Ok(all)
}

/// Checks that two experiments of one name have the same settings: points on veins could
/// belong to either.
fn check_same_settings(one: &Experiment, other: &Experiment) -> Result<(), FitError> {
    let settings = |of: &Experiment| {
        let settings = of.settings.iter();
        let named = settings.map(|(keys, value)| (keys.to_string(), *value));
        named.collect::<BTreeMap<_, _>>()
    };
    if settings(one) == settings(other) {
        return Ok(());
    }
    let place = |of: &Experiment| of.origin.as_ref().map(DataOrigin::to_string);
    let [first, second] = [one, other].map(|of| place(of).unwrap_or_default());
    Err(FitError::Data(format!(
        "{second}: experiment {}: has that name from {first}, which has other settings: give each a \
         name of its own",
        other.name
    )))
}
