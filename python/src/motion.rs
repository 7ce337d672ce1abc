//! A leaf in motion: followed to its end, or an output at a time.

use std::error::Error;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use leafdyn::run::Limit;
use leafdyn::scenario;
use leafdyn::simulate::{
    Frame, Options, OutputSample, Record, Refinement, Scheme, ShapeSnapshot, Simulation,
    SimulationError, Stopped, film_indices, snapshot_indices,
};
use leafdyn_program::files::{FileSelection, MotionRecording, ResultDocument};
use leafdyn_program::page;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{Array, array, flat};
use crate::errors::value_error;
use crate::result::{Files, chosen, write_error};
use crate::run::{Interrupt, elapsed, on_pool, run, run_keeping};
use crate::scenario::Scenario;

/// Shapes that a film strip shows.
const STILLS: usize = 8;

/// A leaf in motion.
#[pyclass(frozen, module = "leafdyn._leafdyn")]
pub struct Motion {
    scenario: Arc<scenario::Scenario>,
    options: Options,
    state: Arc<Mutex<State>>,
}

struct State {
    simulation: Simulation,
    /// The outputs since time 0, if they are kept.
    frames: Vec<Frame>,
    stopped: Option<Stopped>,
}

impl Motion {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn joined(&self) -> bool {
        self.scenario.joined
    }

    fn record(&self, state: &State, with_film: bool) -> Record {
        let moments: Vec<OutputSample> = (state.frames.iter())
            .map(|frame| OutputSample::from_frame(frame, self.joined()))
            .collect();
        let longest = self.scenario.rods.iter().map(|rod| rod.length);
        let chosen = snapshot_indices(&moments, STILLS, longest.fold(0.0, f64::max));
        let still = |moment: usize| {
            let frame = &state.frames[moment];
            let curves = (0..frame.rods).map(|rod| frame.centerline(rod).to_vec());
            ShapeSnapshot {
                moment,
                curves: curves.collect(),
            }
        };
        let shapes = chosen.into_iter().map(still).collect();
        let mut record = Record::new(&state.simulation, state.stopped, moments, shapes);
        if with_film {
            let nodes = state.frames.first();
            let nodes = nodes.map_or(0, |frame| frame.positions.len());
            let film = film_indices(state.frames.len(), nodes).into_iter();
            record.film = film.map(still).collect();
        }
        record
    }
}

#[pymethods]
impl Motion {
    /// The leaf of a scenario at time 0.
    #[new]
    #[pyo3(signature = (scenario, method, segments, step, tolerance))]
    fn new(
        py: Python,
        scenario: &Scenario,
        method: Option<&str>,
        segments: Option<usize>,
        step: Option<f64>,
        tolerance: Option<f64>,
    ) -> PyResult<Self> {
        let scheme = method.map(str::parse::<Scheme>).transpose();
        let options = Options {
            scheme: scheme
                .map_err(|unknown| PyValueError::new_err(format!("method = {unknown}")))?,
            segments,
            step,
            tolerance,
            ..Options::default()
        };
        let scenario = scenario.checked.clone();
        let (leaf, asked) = (scenario.clone(), options.clone());
        let simulation = run(py, None, move |_| Simulation::new(&leaf, &asked))?;
        let state = State {
            simulation: simulation.map_err(value_error)?,
            frames: Vec::new(),
            stopped: None,
        };
        Ok(Motion {
            scenario,
            options,
            state: Arc::new(Mutex::new(state)),
        })
    }

    /// Follows the leaf from time 0 to the end, or as far as it goes, on grids that are refined as
    /// requested, and keeps all outputs of the last, whose number is returned. After Ctrl-C, or so many
    /// seconds, those are kept of the last run that came to its end, or of the first as far as it came.
    #[pyo3(signature = (progress, time_limit))]
    fn follow(
        &self,
        py: Python,
        progress: Option<&Bound<PyAny>>,
        time_limit: Option<f64>,
    ) -> PyResult<usize> {
        let state = self.state.clone();
        let (scenario, mut options) = (self.scenario.clone(), self.options.clone());
        let duration = scenario.dynamics.duration;
        let seconds = time_limit.and_then(|it| Duration::try_from_secs_f64(it).ok());
        let deadline = seconds.and_then(|it| Instant::now().checked_add(it));
        let mut interrupt = Interrupt::default();
        let followed = run_keeping(py, progress, &mut interrupt, move |monitor| {
            options.limit = Limit {
                deadline,
                ..monitor.limit()
            };
            let late = || deadline.is_some_and(|time| Instant::now() >= time);
            let mut motion = Refinement::new(&scenario, &options)?;
            let clock = Instant::now();
            let mut watch = |simulation: &Simulation| {
                let (time, segments) = (simulation.time(), simulation.segments());
                monitor.report(time, Some(duration), || {
                    let run = format!("{segments} segments a rod, {}", elapsed(clock));
                    format!("t = {time:.4} of {duration}, {run}")
                });
                !monitor.cancelled() && !late()
            };
            let mut runs = 0;
            while let Some(mut simulation) = motion.next_run(&mut watch) {
                let (mut frames, mut stopped) = (vec![simulation.frame()], None);
                while !simulation.done() && stopped.is_none() {
                    match simulation.next_frame() {
                        Ok(frame) => frames.push(frame),
                        Err(why) => stopped = Some(why),
                    }
                    watch(&simulation);
                }
                let whole_before = runs > 0 && (monitor.cancelled() || late());
                if whole_before || monitor.cancelled() && frames.len() == 1 {
                    break;
                }
                runs += 1;
                motion.end_run(&mut simulation, stopped);
                *state.lock().unwrap_or_else(PoisonError::into_inner) = State {
                    simulation,
                    frames,
                    stopped,
                };
            }
            Ok::<(), SimulationError>(())
        })?;
        interrupt.or_else(followed, value_error)?;
        let outputs = self.state().frames.len();
        interrupt.hand_over(py, outputs)
    }

    /// The bar on the tips, until when it is known, and what was aimed at.
    #[getter]
    fn accuracy(&self) -> (Option<f64>, Option<f64>, Option<f64>) {
        let state = self.state();
        let last = state.frames.last();
        (
            last.and_then(|frame| frame.error),
            state.simulation.known_until(),
            state.simulation.aim(),
        )
    }

    /// The bar on the tips at every output that was kept; not a number where it is not known.
    #[getter]
    fn errors<'py>(&self, py: Python<'py>) -> Array<'py> {
        let state = self.state();
        let errors = state.frames.iter();
        let errors: Vec<f64> = errors
            .map(|frame| frame.error.unwrap_or(f64::NAN))
            .collect();
        let count = errors.len();
        array(py, errors, &[count])
    }

    /// The leaf now, before the first output that `next` moves on to.
    fn frame<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let frame = self.state().simulation.frame();
        self.arrays(py, &[frame])
    }

    /// Moves on to the next output; none behind the last.
    fn next<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let state = self.state.clone();
        let frame = run(py, None, move |_| {
            let mut state = state.lock().unwrap_or_else(PoisonError::into_inner);
            if state.simulation.done() || state.stopped.is_some() {
                return None;
            }
            let frame = state.simulation.next_frame();
            frame.map_err(|why| state.stopped = Some(why)).ok()
        })?;
        frame.map(|frame| self.arrays(py, &[frame])).transpose()
    }

    /// All outputs that were kept.
    fn outputs<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.arrays(py, &self.state().frames)
    }

    /// Fractions of the length at which the nodes are.
    fn stations<'py>(&self, py: Python<'py>) -> Array<'py> {
        let stations = self.state().simulation.stations().to_vec();
        let count = stations.len();
        array(py, stations, &[count])
    }

    /// How it ended, in one word, and if that was early in a sentence.
    #[getter]
    fn outcome(&self) -> (&'static str, Option<String>) {
        let stopped = self.state().stopped;
        (
            stopped.map_or("completed", Stopped::word),
            stopped.map(|why| why.to_string()),
        )
    }

    /// What makes it doubtful from its beginning.
    #[getter]
    fn doubts(&self) -> Vec<String> {
        let state = self.state();
        let doubts = state.simulation.doubts().iter();
        doubts.map(ToString::to_string).collect()
    }

    #[getter]
    fn method(&self) -> &'static str {
        self.state().simulation.scheme().word()
    }

    /// The summary and the pictures of the outputs that were kept.
    fn files(&self) -> Files {
        let record = self.record(&self.state(), false);
        Files::of(record, self.scenario.clone())
    }

    /// The page that plays them in space.
    fn page(&self, py: Python) -> String {
        py.detach(|| page::html_page(&self.record(&self.state(), true), &self.scenario))
    }

    /// Writes the files of the program of these kinds into a folder.
    fn save(&self, py: Python, folder: PathBuf, kinds: Vec<String>) -> PyResult<Vec<PathBuf>> {
        let selection = FileSelection {
            kinds: chosen(&kinds),
            ..FileSelection::default()
        };
        let written = on_pool(py, || {
            let State {
                simulation,
                frames,
                stopped,
            } = &mut *self.state();
            let (first, others) = frames.split_first().ok_or("there are no outputs")?;
            let mut recording =
                MotionRecording::begin_with_frame(&folder, simulation, &selection, first)?;
            for frame in others {
                recording.add_output(simulation, frame)?;
            }
            let record = recording.finished_record(simulation, *stopped)?;
            Ok(recording.finish(&ResultDocument::new(&record, &self.scenario, None))?)
        })?;
        written.map_err(|error: Box<dyn Error + Send + Sync>| write_error(error))
    }
}

impl Motion {
    /// Outputs by the names of their quantities; the first axis is time.
    fn arrays<'py>(&self, py: Python<'py>, frames: &[Frame]) -> PyResult<Bound<'py, PyDict>> {
        let rods = self.scenario.rods.len();
        let nodes = frames.first().map_or(0, |frame| frame.positions.len()) / rods;
        let shape = [frames.len(), rods, nodes];
        let found = PyDict::new(py);
        let with = |components: usize| [&shape[..], &[components]].concat();
        let vectors = |of: &dyn Fn(&Frame) -> Vec<f64>, components: usize| {
            array(py, frames.iter().flat_map(of).collect(), &with(components))
        };
        let numbers = |of: &dyn Fn(&Frame) -> f64| {
            let numbers = frames.iter().map(|frame| of(frame) + 0.0).collect();
            array(py, numbers, &[frames.len()])
        };
        found.set_item("times", numbers(&|frame| frame.time)?)?;
        let positions = vectors(&|frame| flat(frame.positions.iter().copied()), 3)?;
        found.set_item("positions", positions)?;
        let rotations = |frame: &Frame| {
            let rotations = frame.rotations.iter();
            let numbers = rotations.flat_map(|q| [q.w, q.x, q.y, q.z]);
            numbers.map(|value| value + 0.0).collect()
        };
        found.set_item("rotations", vectors(&rotations, 4)?)?;
        let velocities = |frame: &Frame| flat(frame.velocities.iter().map(|v| v.linear));
        found.set_item("velocities", vectors(&velocities, 3)?)?;
        let angular = |frame: &Frame| flat(frame.velocities.iter().map(|v| v.angular));
        found.set_item("angular_velocities", vectors(&angular, 3)?)?;
        found.set_item("kinetic", numbers(&|frame| frame.energy.kinetic)?)?;
        found.set_item("elastic", numbers(&|frame| frame.energy.elastic)?)?;
        found.set_item("coupling", numbers(&|frame| frame.energy.coupling)?)?;
        found.set_item("potential", numbers(&|frame| frame.energy.potential)?)?;
        found.set_item("dissipated", numbers(&|frame| frame.energy.dissipated)?)?;
        found.set_item("work", numbers(&|frame| frame.energy.work)?)?;
        Ok(found)
    }
}
