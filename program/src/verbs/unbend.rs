//! `leafdyn unbend`: the least stiffness that a posture proves, and the leaf without its weight.

use crate::verbs::exit::{ExitStatus, Refusal};
use crate::verbs::request::{
    DeliveredResult, ScenarioArguments, ScenarioJob, VerbTraits, word_parser,
};
use clap::{Args, ValueHint};
use leafdyn::posture::leaf::ScenarioRod;
use leafdyn::scenario::bytes;
use leafdyn::study;
use leafdyn::study::{
    MeasuredColumn, NamedPosture, PostureOutcome, PostureRow, Postures, SecondPosture, ShapeFormat,
    ShapeTableOptions, UnbendError, UnbendRemark, UnbendRequest, Unbending, read_postures,
};
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// From the posture of a hanging leaf or stem, the least stiffness that it proves, and the leaf without its weight.
///
/// The scenario has the weight, the loads and the section of a single vein; its Young's modulus is not used.
///
/// Exit status: 0 the posture proves a bound, and is stable at the moduli of --young; 1 not
/// (the files are still written and say why); 2 the request was refused.
#[derive(Debug, Args)]
pub struct UnbendArguments {
    #[command(flatten)]
    request: ScenarioArguments,

    /// Points of the centreline from base to tip, as CSV with a header: x, y, z, or two of them in a plane, or pixel_x, pixel_y with [photo]; if measured normal_x, normal_y, normal_z of the blade, and sd
    #[arg(long, value_name = "POINTS.csv", value_hint = ValueHint::FilePath)]
    shape: PathBuf,

    #[command(flatten)]
    table: ShapeTableArguments,

    /// Young's modulus, or the range in which it lies: is the posture stable there?
    #[arg(long, value_name = "E|A..B")]
    young: Option<YoungRange>,

    /// Points of the same leaf after it was turned about the direction of its base by ROLL degrees, 180 if left out: they tell the modulus itself
    #[arg(long, value_name = "OTHER.csv[:ROLL]")]
    second: Option<SecondShape>,

    /// The points are those of many leaves: the column by whose cells they are told apart; one row a leaf, nothing is relaxed
    #[arg(long, value_name = "COLUMN", conflicts_with = "second")]
    group: Option<String>,
}

/// How tables of points are read.
#[derive(Debug, Args)]
pub struct ShapeTableArguments {
    /// The program that wrote the points: adel, midribs in cm, told apart by --group inerv; biomech, a field sheet of twelve rows, whose sections and weights stand for those of the scenario. Tables of DeepLabCut are known by their first lines
    #[arg(long, value_name = "PROGRAM", value_parser = word_parser::<ShapeFormat>(ShapeFormat::ALL.map(ShapeFormat::word)))]
    format: Option<ShapeFormat>,

    /// What a column of the points is: its name in the file, or its number, from 1, in a file without a header, and x, y, z, pixel_x, pixel_y, normal_x, normal_y, normal_z or sd, with a factor and an offset, as in '1=x:1e-3'; may repeat
    #[arg(long, value_name = "NAME=QUANTITY[:FACTOR[+OFFSET]]")]
    column: Vec<MeasuredColumn>,
}

impl ShapeTableArguments {
    /// How a table is read whose leaves are told apart by this column, if there are several.
    pub fn options(&self, group: Option<&str>) -> ShapeTableOptions {
        ShapeTableOptions {
            group: group.map(String::from),
            format: self.format,
            columns: self.column.clone(),
        }
    }

    /// Whether any of the options is given.
    pub fn any_given(&self) -> bool {
        self.format.is_some() || !self.column.is_empty()
    }
}

/// A second table of points, and the angle by which the leaf was turned.
#[derive(Clone, Debug)]
struct SecondShape {
    file: PathBuf,
    degrees: f64,
}

impl FromStr for SecondShape {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let angle = |text: &str| {
            text.trim()
                .parse()
                .ok()
                .filter(|angle: &f64| angle.is_finite())
        };
        let (file, degrees) = match text.rsplit_once(':').map(|(file, end)| (file, angle(end))) {
            Some((file, Some(degrees))) => (file, degrees),
            _ => (text, 180.0),
        };
        match file.is_empty() {
            true => Err("must name a file"),
            false => Ok(SecondShape {
                file: file.into(),
                degrees,
            }),
        }
    }
}

/// A modulus, or a range.
#[derive(Clone, Debug)]
struct YoungRange(RangeInclusive<f64>);

impl FromStr for YoungRange {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let number = |text: &str| {
            let number: Option<f64> = text.trim().parse().ok();
            number.filter(|it| *it > 0.0 && it.is_finite())
        };
        let ends = match text.split_once("..") {
            Some((low, high)) => [number(low), number(high)],
            None => [number(text); 2],
        };
        match ends {
            [Some(low), Some(high)] if low <= high => Ok(YoungRange(low..=high)),
            _ => {
                Err("must be a number greater than 0, or two as in 1e6..1e8, the smaller one first")
            }
        }
    }
}

impl UnbendArguments {
    pub fn run(self) -> Result<ExitStatus, Refusal> {
        let second = self.second.iter().map(|second| second.file.clone());
        let reads: Vec<PathBuf> = second.chain([self.shape.clone()]).collect();
        let traits = VerbTraits {
            input_files: &reads,
            ..VerbTraits::default()
        };
        match &self.group {
            Some(column) => (self.request)
                .run_each_scenario::<Postures>(traits, |job| self.run_groups(job, column)),
            None => {
                (self.request).run_each_scenario::<Unbending>(traits, |job| self.run_scenario(job))
            }
        }
    }

    /// Many leaves, a row each.
    fn run_groups(&self, job: &ScenarioJob, column: &str) -> Result<DeliveredResult, Refusal> {
        // What no leaf of this scenario can tell is refused once.
        ScenarioRod::new(&job.scenario)
            .map_err(|error| format!("{}: {error}", job.scenario.name))?;
        let file = self.shape.display().to_string();
        let options = self.table.options(Some(column));
        let leaves = read_postures(&bytes(&self.shape)?, &file, &options, &job.scenario)?;
        let young = self.young.as_ref().map(|range| range.0.clone());
        let found = study::unbend_groups(&job.scenario, leaves, young);
        let bound = |row: &PostureRow| row.outcome == PostureOutcome::Bound;
        let success = found.postures.iter().any(bound);
        job.write_and_deliver(&found, success)
    }

    fn run_scenario(&self, job: &ScenarioJob) -> Result<DeliveredResult, Refusal> {
        let posture = self.read(job, &self.shape)?;
        let second = match &self.second {
            Some(second) => Some(SecondPosture {
                points: self.read(job, &second.file)?.points,
                roll: second.degrees.to_radians(),
            }),
            None => None,
        };
        let request = UnbendRequest {
            young: self.young.as_ref().map(|range| range.0.clone()),
            second,
            is_unit_known: posture.is_unit_known,
            limit: job.limit.clone(),
            ..UnbendRequest::new(
                posture
                    .scenario
                    .map_or_else(|| job.scenario.clone(), |it| *it),
                posture.points,
            )
        };
        let mut found = study::unbend(&request).map_err(|error| match error {
            UnbendError::Second(error) => {
                let second = self
                    .second
                    .as_ref()
                    .map_or(&self.shape, |second| &second.file);
                format!("{}: {error}", second.display())
            }
            error => format!("{}: {error}", self.shape.display()),
        })?;
        if let Some(taken) = posture.taken {
            found.remarks.insert(0, UnbendRemark::Coordinates(taken));
        }
        job.print_remark(found.remarks.first());
        let stable = found.indices.iter().all(|it| it.index == 0);
        let success = found.critical_young.value > 0.0 && stable;
        job.write_and_deliver(&found, success)
    }

    /// The points of the only leaf of a table.
    fn read(&self, job: &ScenarioJob, path: &Path) -> Result<NamedPosture, Refusal> {
        let file = path.display().to_string();
        let options = self.table.options(None);
        let read = read_postures(&bytes(path)?, &file, &options, &job.scenario)?;
        let first = read.into_iter().next();
        first.ok_or_else(|| format!("{file}: has no points").into())
    }
}
