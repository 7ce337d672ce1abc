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

use super::{atomic, write_all};
use crate::report::FileError;
use crate::report::table::header;
use crate::scenario;
use crate::simulate::{Frame, Moment, Record, Simulation, Still, Stopped, stills};
use checkpoint::{Checkpoint, Identity, damaged};
use checkpointer::Latest;
use growing::{GrowingFile, kept_path};
use motion::{Form, Size};

/// Shapes that a film strip shows.
const STILLS: usize = 8;

/// The files of a simulation that is under way.
///
/// ```
/// use leafdyn::files::Recording;
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
/// let mut recording = Recording::begin(folder, &mut simulation)?;
/// while !simulation.done() {
///     let frame = simulation.next_frame()?;
///     recording.add(&simulation, &frame)?;
/// }
/// let record = recording.record(&simulation, None)?;
/// let files = recording.finish(&record)?;
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
    motion: GrowingFile,
    energy: GrowingFile,
    moments: Vec<Moment>,
    /// Time on the clock in processes before this one.
    wall: Duration,
    checkpointer: Checkpointer,
}

impl Recording {
    /// Begins the files of a simulation in `folder`, which is made if it is
    /// not there, with the leaf as it is now.
    ///
    /// # Errors
    /// If they cannot be written.
    pub fn begin(folder: &Path, simulation: &mut Simulation) -> Result<Self, FileError> {
        atomic::make_folder(folder)?;
        let (form, size) = form(simulation);
        let start = form.start(size, outputs(simulation));
        let motion = GrowingFile::begin(folder.join(form.file_name()), &start)?;
        let start = header(energy::Row::default());
        let energy = GrowingFile::begin(folder.join(energy::FILE_NAME), &start)?;
        let mut recording = Recording::with(folder, simulation, motion, energy);
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
    pub fn resume(folder: &Path, simulation: &mut Simulation) -> Result<Self, FileError> {
        let found = Checkpoint::read(folder, &Identity::of(simulation))?;
        let state = found.state().filter(|state| simulation.restore(state));
        state.ok_or_else(|| {
            damaged(
                &folder.join(checkpoint::FILE_NAME),
                "it does not fit the leaf",
            )
        })?;
        let (form, _) = form(simulation);
        let motion = GrowingFile::resume(folder.join(form.file_name()), &found.motion)?;
        let energy = GrowingFile::resume(folder.join(energy::FILE_NAME), &found.energy)?;
        let mut recording = Recording::with(folder, simulation, motion, energy);
        let moments = recording.energy.read(energy::read).ok();
        recording.moments = moments
            .filter(|moments| moments.len() == simulation.frames().1 + 1)
            .ok_or_else(|| damaged(&folder.join(energy::FILE_NAME), "outputs are missing"))?;
        recording.wall = Duration::from_nanos(found.wall_nanoseconds);
        recording.update_checkpointer(simulation);
        Ok(recording)
    }

    fn with(
        folder: &Path,
        simulation: &Simulation,
        motion: GrowingFile,
        energy: GrowingFile,
    ) -> Self {
        let (form, size) = form(simulation);
        Recording {
            folder: folder.into(),
            run: Identity::of(simulation),
            form,
            size,
            stations: simulation.stations().into(),
            joined: simulation.leaf().joined(),
            motion,
            energy,
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
        let moment = Moment::of(frame, self.joined);
        let (form, stations) = (self.form, &self.stations);
        self.motion.append(|out| form.write(frame, stations, out))?;
        self.energy.append(|out| energy::write(&moment, out))?;
        self.moments.push(moment);
        self.update_checkpointer(simulation);
        Ok(())
    }

    fn update_checkpointer(&self, simulation: &Simulation) {
        let wall = (self.wall + simulation.wall_time()).as_nanos();
        let wall = wall.min(u128::from(u64::MAX)) as u64;
        let extents = [self.motion.extent(), self.energy.extent()];
        let time = simulation.time();
        *self.checkpointer.latest() = Some(Latest {
            folder: self.folder.clone(),
            files: [self.motion.unfinished(), self.energy.unfinished()],
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
        let chosen = stills(&self.moments, STILLS, longest);
        let (form, size) = (self.form, self.size);
        let shapes = self
            .motion
            .read(|file| form.positions(size, &chosen, file))?;
        let still = |(moment, shape): (usize, &[DVec3])| Still {
            moment,
            curves: shape.chunks(size.nodes).map(<[DVec3]>::to_vec).collect(),
        };
        let stills = chosen.into_iter().zip(shapes.chunks(size.rows()));
        let moments = mem::take(&mut self.moments);
        let mut record = Record::new(simulation, stopped, moments, stills.map(still).collect());
        record.wall_seconds += self.wall.as_secs_f64();
        Ok(record)
    }

    /// Writes all else about the simulation, gives all files their names, and
    /// removes what a run that was stopped has left. Returns the files.
    ///
    /// # Errors
    /// If a file cannot be written; a checkpoint can then still be.
    pub fn finish(&mut self, record: &Record) -> Result<Vec<PathBuf>, FileError> {
        let mut files = write_all(&self.folder, record)?;
        // From here on there is nothing left to go on from.
        let mut latest = self.checkpointer.latest();
        let start = self.form.start(self.size, record.moments.len());
        self.motion.replace_start(&start)?;
        files.push(self.motion.finish()?);
        files.push(self.energy.finish()?);
        latest.take();
        drop(latest);
        let file = |name: &str| self.folder.join(name);
        let other = file(self.form.other().file_name());
        for left in [
            file(checkpoint::FILE_NAME),
            kept_path(&file(self.form.file_name())),
            kept_path(&other),
            kept_path(&file(energy::FILE_NAME)),
            other,
        ] {
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

fn form(simulation: &Simulation) -> (Form, Size) {
    let size = Size {
        rods: simulation.leaf().rods(),
        nodes: simulation.stations().len(),
    };
    (Form::of(size, outputs(simulation)), size)
}
