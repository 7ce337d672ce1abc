//! The files of a simulation, which grow while it runs.
//!
//! Every output is written at once to `motion.csv` (or `motion.npy`) and `energy.csv`,
//! under temporary names, so that memory does not grow. At the end of the run the files
//! get their final names, and figures and a summary are made from them.

mod energy;
mod growing;
mod motion;

use std::fs;
use std::mem;
use std::path::{Path, PathBuf};

use glam::DVec3;

use super::{Kind, Selection, atomic, write_all};
use crate::report::table::header;
use crate::report::{Document, FileError};
use growing::GrowingFile;
use leafdyn::scenario;
use leafdyn::shape::equally_spaced;
use leafdyn::simulate::{Frame, Moment, Record, Simulation, Still, Stopped, film, stills};
use motion::{MotionFormat, Size};

/// Shapes that a film strip shows.
const STILLS: usize = 8;

/// The files of a running simulation.
///
/// ```
/// use leafdyn_program::files::{Document, Recording, Selection};
/// use leafdyn::scenario::Scenario;
/// use leafdyn::simulate::{Options, Simulation};
///
/// let cantilever = r#"
///     name = "cantilever"
///     leaf = { rods = 1, length = 1.0, fan = [0.0] }
///     stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = 100.0, shear_2 = 100.0, shear_3 = 100.0 }
///     load = { gravity = [0.0, 0.0, -1.0] }
/// "#;
/// # let folder = tempfile::tempdir()?;
/// # let folder = folder.path();
/// let scenario = Scenario::from_toml(cantilever)?;
/// let mut simulation = Simulation::new(&scenario, &Options::default())?;
/// let mut recording = Recording::begin(folder, &mut simulation, &Selection::default())?;
/// while !simulation.done() {
///     let frame = simulation.next_frame()?;
///     recording.add(&simulation, &frame)?;
/// }
/// let record = recording.record(&simulation, None)?;
/// let files = recording.finish(&Document::new(&record, &scenario, None))?;
/// assert_eq!(files.len(), 7);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Recording {
    folder: PathBuf,
    format: MotionFormat,
    size: Size,
    stations: Vec<f64>,
    joined: bool,
    /// `motion` and `energy`, if they are selected or needed for figures.
    growing: Option<[GrowingFile; 2]>,
    selection: Selection,
    /// Positions at the last output, if there are no growing files.
    last: Vec<DVec3>,
    moments: Vec<Moment>,
}

impl Recording {
    /// Begins the files of a simulation in `folder`, which is created if missing, with the
    /// current state of the leaf. Without tables and figures nothing is written during
    /// the run.
    pub fn begin(
        folder: &Path,
        simulation: &mut Simulation,
        selection: &Selection,
    ) -> Result<Self, FileError> {
        let frame = simulation.frame();
        Recording::begin_with(folder, simulation, selection, &frame)
    }

    /// The same with another first output.
    pub fn begin_with(
        folder: &Path,
        simulation: &Simulation,
        selection: &Selection,
        first: &Frame,
    ) -> Result<Self, FileError> {
        let mut recording = Recording::new(folder, simulation, selection);
        if selection.kinds.iter().any(|kind| *kind != Kind::Json) {
            atomic::make_folder(folder)?;
            let format = recording.format;
            let start = format.start(recording.size, outputs(simulation));
            let motion = GrowingFile::begin(folder.join(format.file_name()), &start)?;
            let start = header(energy::ENERGY_COLUMNS);
            let energy = GrowingFile::begin(folder.join(energy::ENERGY_FILE_NAME), &start)?;
            recording.growing = Some([motion, energy]);
        }
        recording.add(simulation, first)?;
        Ok(recording)
    }

    fn new(folder: &Path, simulation: &Simulation, selection: &Selection) -> Self {
        let stations = match selection.stations {
            Some(count) => equally_spaced(count),
            None => simulation.stations().to_vec(),
        };
        let size = Size {
            rods: simulation.leaf().rods(),
            nodes: stations.len(),
        };
        Recording {
            folder: folder.into(),
            format: MotionFormat::of(size, outputs(simulation)),
            size,
            stations,
            joined: simulation.leaf().joined(),
            growing: None,
            selection: selection.clone(),
            last: Vec::new(),
            moments: Vec::new(),
        }
    }

    /// Approximate number of bytes that the growing files still need; zero without these.
    pub fn expected_bytes(&self, simulation: &Simulation) -> u64 {
        let (all, made) = simulation.frames();
        let output = self.format.bytes(self.size) + energy::ENERGY_BYTES;
        match &self.growing {
            Some(_) => (all.saturating_sub(made) as u64).saturating_mul(output),
            None => 0,
        }
    }

    /// Adds an output: the current state of `simulation`.
    pub fn add(&mut self, simulation: &Simulation, frame: &Frame) -> Result<(), FileError> {
        self.moments.push(Moment::of(frame, self.joined));
        let Some([motion, energy]) = &mut self.growing else {
            self.last = frame.positions.clone();
            return Ok(());
        };
        let (format, stations) = (self.format, &self.stations);
        let frame = match self.selection.stations {
            Some(_) => &frame.at(simulation.stations(), stations),
            None => frame,
        };
        motion.append(|out| format.write(frame, stations, out))?;
        if let Some(moment) = self.moments.last() {
            energy.append(|out| energy::write_energies(moment, out))?;
        }
        Ok(())
    }

    /// The record of a simulation that has ended; nothing can be added after that.
    ///
    /// # Errors
    /// If the files written so far cannot be read.
    pub fn record(
        &mut self,
        simulation: &Simulation,
        stopped: Option<Stopped>,
    ) -> Result<Record, FileError> {
        let longest = scenario::longest(&simulation.leaf().scenario().rods);
        let stills = match &self.growing {
            Some(files) => self.read_stills(files, &stills(&self.moments, STILLS, longest))?,
            None => {
                let last = self.moments.len().saturating_sub(1);
                let nodes = self.last.len() / self.size.rods;
                let size = Size { nodes, ..self.size };
                split(&[last], &mem::take(&mut self.last), size)
            }
        };
        let moments = mem::take(&mut self.moments);
        let mut record = Record::new(simulation, stopped, moments, stills);
        if self.growing.is_some() {
            record.stations.clone_from(&self.stations);
        }
        record.film = self.film(record.moments.len())?;
        Ok(record)
    }

    /// The shapes of a film of this number of outputs, if one is selected.
    fn film(&self, outputs: usize) -> Result<Vec<Still>, FileError> {
        let selected = |kind: &Kind| Kind::FILMS.contains(kind);
        match &self.growing {
            Some(files) if self.selection.kinds.iter().any(selected) => {
                self.read_stills(files, &film(outputs, self.size.rows()))
            }
            _ => Ok(Vec::new()),
        }
    }

    /// Reads the shapes at these outputs.
    fn read_stills(
        &self,
        [motion, _]: &[GrowingFile; 2],
        outputs: &[usize],
    ) -> Result<Vec<Still>, FileError> {
        let (format, size) = (self.format, self.size);
        let positions = motion.read(|file| format.positions(size, outputs, file))?;
        Ok(split(outputs, &positions, size))
    }

    /// Writes the remaining files, gives all files their final names, and removes the motion
    /// of another run in the other format. Returns the files.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn finish(&mut self, record: &Document<Record>) -> Result<Vec<PathBuf>, FileError> {
        let kinds = &self.selection.kinds;
        let mut files = write_all(&self.folder, record, kinds)?;
        let Some([motion, energy]) = &mut self.growing else {
            return Ok(files);
        };
        if kinds.contains(&Kind::Csv) {
            let outputs = record.result.moments.len();
            motion.replace_start(&self.format.start(self.size, outputs))?;
            files.push(motion.finish()?);
            files.push(energy.finish()?);
            let other = match self.format {
                MotionFormat::Csv => MotionFormat::Npy,
                MotionFormat::Npy => MotionFormat::Csv,
            };
            // It may not exist.
            let _ = fs::remove_file(self.folder.join(other.file_name()));
        }
        Ok(files)
    }
}

/// Splits the positions of all nodes at these outputs into shapes.
fn split(outputs: &[usize], positions: &[DVec3], size: Size) -> Vec<Still> {
    let shapes = outputs.iter().zip(positions.chunks(size.rows()));
    let still = |(&moment, shape): (&usize, &[DVec3])| Still {
        moment,
        curves: shape.chunks(size.nodes).map(<[DVec3]>::to_vec).collect(),
    };
    shapes.map(still).collect()
}

/// The number of outputs of a simulation, including the first and the last.
fn outputs(simulation: &Simulation) -> usize {
    simulation.frames().0 + 1
}
