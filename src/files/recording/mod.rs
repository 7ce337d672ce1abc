//! The files of a simulation, which grow while it runs.
//!
//! `motion.csv` (or `motion.npy`) and `energy.csv` get every output at once,
//! under names of their own, so that memory does not grow with them. When the
//! run has ended they get their names, and pictures and a summary are made of
//! them. A run that is stopped can be kept instead, and resumed.

mod checkpoint;
mod checkpointer;
mod energy;
mod growing;
mod motion;

use std::fs;
use std::mem;
use std::path::{Path, PathBuf};
use std::time::Duration;

use glam::DVec3;

pub use checkpointer::Checkpointer;

use super::{Selection, atomic, write_all};
use crate::report::table::header;
use crate::report::{Document, FileError, Kind};
use crate::scenario;
use crate::shape::equally_spaced;
use crate::simulate::{Frame, Moment, Record, Simulation, Still, Stopped, film, stills};
use checkpoint::{Checkpoint, Identity, damaged};
use checkpointer::Latest;
use growing::{GrowingFile, kept_path};
use motion::{Form, Size};

/// Shapes that a film strip shows.
const STILLS: usize = 8;

/// The files of a simulation that is under way.
///
/// ```
/// use leafdyn::files::{Document, Recording, Selection};
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
    run: Identity,
    form: Form,
    size: Size,
    stations: Vec<f64>,
    joined: bool,
    /// `motion` and `energy`, where they are wanted or figures are made of them.
    growing: Option<[GrowingFile; 2]>,
    selection: Selection,
    /// Positions at the last output.
    last: Vec<DVec3>,
    moments: Vec<Moment>,
    /// Time on the clock in processes before this one.
    wall: Duration,
    checkpointer: Checkpointer,
}

impl Recording {
    /// Begins the files of a simulation in `folder`, which is made if it is
    /// not there, with the leaf as it is now. Without tables and figures nothing
    /// is written on the way, and there is nothing to resume.
    ///
    /// # Errors
    /// If they cannot be written.
    pub fn begin(
        folder: &Path,
        simulation: &mut Simulation,
        selection: &Selection,
    ) -> Result<Self, FileError> {
        let mut recording = Recording::with(folder, simulation, selection);
        if selection.kinds.iter().any(|kind| *kind != Kind::Json) {
            atomic::make_folder(folder)?;
            let form = recording.form;
            let start = form.start(recording.size, outputs(simulation));
            let motion = GrowingFile::begin(folder.join(form.file_name()), &start)?;
            let start = header(energy::Row::default());
            let energy = GrowingFile::begin(folder.join(energy::FILE_NAME), &start)?;
            recording.growing = Some([motion, energy]);
        }
        let frame = simulation.frame();
        recording.add(simulation, &frame)?;
        Ok(recording)
    }

    /// Goes on where a simulation of the same leaf and options was stopped with a
    /// checkpoint in `folder`: the simulation is brought there, too.
    ///
    /// # Errors
    /// If there is no checkpoint, or it does not fit. Nothing that was kept is
    /// lost then.
    pub fn resume(
        folder: &Path,
        simulation: &mut Simulation,
        selection: &Selection,
    ) -> Result<Self, FileError> {
        let mut recording = Recording::with(folder, simulation, selection);
        let found = Checkpoint::read(folder, &recording.run)?;
        let state = found.state().filter(|state| simulation.restore(state));
        state.ok_or_else(|| {
            damaged(
                &folder.join(checkpoint::FILE_NAME),
                "it does not fit the leaf, or a number of it is not finite",
            )
        })?;
        let motion = folder.join(recording.form.file_name());
        let motion = GrowingFile::resume(motion, &found.motion)?;
        let energy = GrowingFile::resume(folder.join(energy::FILE_NAME), &found.energy)?;
        let moments = energy.read(energy::read).ok();
        recording.growing = Some([motion, energy]);
        recording.moments = moments
            .filter(|moments| moments.len() == simulation.frames().1 + 1)
            .ok_or_else(|| damaged(&folder.join(energy::FILE_NAME), "outputs are missing"))?;
        recording.wall = Duration::from_nanos(found.wall_nanoseconds);
        recording.update_checkpointer(simulation);
        Ok(recording)
    }

    fn with(folder: &Path, simulation: &Simulation, selection: &Selection) -> Self {
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
            run: Identity::of(simulation, selection.stations),
            form: Form::of(size, outputs(simulation)),
            size,
            stations,
            joined: simulation.leaf().joined(),
            growing: None,
            selection: selection.clone(),
            last: Vec::new(),
            moments: Vec::new(),
            wall: Duration::ZERO,
            checkpointer: Checkpointer::default(),
        }
    }

    /// What writes a checkpoint when the program is stopped.
    pub fn checkpointer(&self) -> Checkpointer {
        self.checkpointer.clone()
    }

    /// Adds an output: the leaf of `simulation` now.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn add(&mut self, simulation: &Simulation, frame: &Frame) -> Result<(), FileError> {
        self.moments.push(Moment::of(frame, self.joined));
        let Some([motion, energy]) = &mut self.growing else {
            self.last = frame.positions.clone();
            return Ok(());
        };
        let (form, stations) = (self.form, &self.stations);
        let there = match self.selection.stations {
            Some(_) => &frame.at(simulation.stations(), stations),
            None => frame,
        };
        motion.append(|out| form.write(there, stations, out))?;
        if let Some(moment) = self.moments.last() {
            energy.append(|out| energy::write(moment, out))?;
        }
        self.update_checkpointer(simulation);
        Ok(())
    }

    fn update_checkpointer(&self, simulation: &Simulation) {
        let Some(files) = &self.growing else {
            return;
        };
        let wall = (self.wall + simulation.wall_time()).as_nanos();
        let wall = wall.min(u128::from(u64::MAX)) as u64;
        let extents = files.each_ref().map(GrowingFile::extent);
        let time = simulation.time();
        *self.checkpointer.latest() = Some(Latest {
            folder: self.folder.clone(),
            files: files.each_ref().map(GrowingFile::unfinished),
            checkpoint: Checkpoint::new(self.run.clone(), extents, time, wall),
            state: simulation.save(),
        });
    }

    /// What is known of a simulation that has ended here; nothing can be added
    /// after that.
    ///
    /// # Errors
    /// If what was written cannot be read.
    pub fn record(
        &mut self,
        simulation: &Simulation,
        stopped: Option<Stopped>,
    ) -> Result<Record, FileError> {
        let longest = scenario::longest(&simulation.leaf().scenario().rods);
        let (form, size) = (self.form, self.size);
        let (chosen, shapes, nodes) = match &self.growing {
            Some([motion, _]) => {
                let chosen = stills(&self.moments, STILLS, longest);
                let shapes = motion.read(|file| form.positions(size, &chosen, file))?;
                (chosen, shapes, size.nodes)
            }
            None => {
                let nodes = self.last.len() / size.rods;
                let last = self.moments.len().saturating_sub(1);
                (vec![last], mem::take(&mut self.last), nodes)
            }
        };
        let still = |(moment, shape): (usize, &[DVec3])| Still {
            moment,
            curves: shape.chunks(nodes).map(<[DVec3]>::to_vec).collect(),
        };
        let stills = chosen.into_iter().zip(shapes.chunks(nodes * size.rods));
        let moments = mem::take(&mut self.moments);
        let stills = stills.map(still).collect();
        let mut record = Record::new(simulation, stopped, moments, stills);
        if self.growing.is_some() {
            record.stations.clone_from(&self.stations);
        }
        record.film = self.film(record.moments.len())?;
        record.wall_seconds += self.wall.as_secs_f64();
        Ok(record)
    }

    /// The shapes of a film of so many outputs, if one is wanted.
    fn film(&self, outputs: usize) -> Result<Vec<Still>, FileError> {
        let wanted = |kind: &Kind| Kind::FILMS.contains(kind);
        let (Some([motion, _]), true) = (&self.growing, self.selection.kinds.iter().any(wanted))
        else {
            return Ok(Vec::new());
        };
        let (form, size) = (self.form, self.size);
        let chosen = film(outputs, size.rows());
        let shapes = motion.read(|file| form.positions(size, &chosen, file))?;
        let still = |(moment, shape): (usize, &[DVec3])| Still {
            moment,
            curves: shape.chunks(size.nodes).map(<[DVec3]>::to_vec).collect(),
        };
        Ok(chosen
            .into_iter()
            .zip(shapes.chunks(size.rows()))
            .map(still)
            .collect())
    }

    /// Writes all else about the simulation, gives all files their names, and
    /// removes what a run that was stopped has left. Returns the files.
    ///
    /// # Errors
    /// If a file cannot be written; a checkpoint can then still be.
    pub fn finish(&mut self, record: &Document<Record>) -> Result<Vec<PathBuf>, FileError> {
        let kinds = &self.selection.kinds;
        let mut files = write_all(&self.folder, record, kinds)?;
        let Some([motion, energy]) = &mut self.growing else {
            return Ok(files);
        };
        // From here on there is nothing left to go on from.
        let mut latest = self.checkpointer.latest();
        if kinds.contains(&Kind::Csv) {
            let outputs = record.result.moments.len();
            motion.replace_start(&self.form.start(self.size, outputs))?;
            files.push(motion.finish()?);
            files.push(energy.finish()?);
        }
        latest.take();
        drop(latest);
        let file = |name: &str| self.folder.join(name);
        let other = file(self.form.other().file_name());
        let mut left = vec![
            file(checkpoint::FILE_NAME),
            kept_path(&file(self.form.file_name())),
            kept_path(&other),
            kept_path(&file(energy::FILE_NAME)),
        ];
        if kinds.contains(&Kind::Csv) {
            left.push(other);
        }
        for left in left {
            // What is not there need not be removed.
            let _ = fs::remove_file(left);
        }
        Ok(files)
    }
}

/// Outputs of a simulation, the first and the last included.
fn outputs(simulation: &Simulation) -> usize {
    simulation.frames().0 + 1
}
