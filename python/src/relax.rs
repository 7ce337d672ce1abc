//! Relaxation of leaves.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use leafdyn::relax::{
    self, CorrectionProgress, Equilibrium, Limit, Method, Options, Progress, RelaxError, RodShape,
    Route, Settings,
};
use leafdyn::scenario;
use leafdyn::study::{
    self, MarginProgress, ParameterKeys, RefinedBlade, SensitivityError, VeinsError,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::errors::{value_error, vary_error};
use crate::posture::Points;
use crate::result::Leaf;
use crate::run::{
    Interrupt, Monitor, elapsed, interrupted, is_interrupt, run, run_here, run_keeping,
};
use crate::scenario::Scenario;
use crate::start::Start;

/// Most parts into which stations can divide a vein.
const MOST_STATIONS: usize = 1_000_000;

/// Options of a relaxation.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Asked {
    method: String,
    tolerance: Option<f64>,
    segments: Option<usize>,
    intervals: Option<usize>,
    keep_unstable: bool,
    full_model: bool,
    modes: usize,
    mode_shapes: bool,
    stations: Option<usize>,
    /// Numbers with respect to which derivatives are computed; for one leaf only.
    sensitivity: Vec<String>,
    /// Whether the stability margin is computed; for one leaf only.
    margin: bool,
    /// Which equilibrium is meant.
    path: String,
    /// To which error in veins a blade is refined, as a fraction of its largest displacement; for one
    /// leaf only.
    veins: Option<f64>,
    /// Whether the error in veins is estimated.
    veins_error: bool,
    /// The shape from which it starts; for one leaf only.
    start: Option<Start>,
    /// Points of the centerline from which it starts; for one leaf only.
    points: Option<Points>,
    /// Seconds after which all leaves are given up.
    time_limit: Option<f64>,
    /// Seconds after which a leaf of several is given up.
    time_limit_each: Option<f64>,
}

/// The outcome of one of several scenarios: a leaf, or why it is refused.
#[derive(IntoPyObject)]
pub enum LeafOrRefusal {
    Leaf(Py<Leaf>),
    Refusal(String),
}

/// Refuses a request with a `ValueError`.
pub fn refuse<T>(message: impl Into<String>) -> PyResult<T> {
    Err(PyValueError::new_err(message.into()))
}

/// Refuses a number of stations that is zero or unreasonably large.
pub fn check_stations(found: Option<usize>) -> PyResult<()> {
    match found {
        Some(found) if !(1..=MOST_STATIONS).contains(&found) => refuse(format!(
            "stations = {found}: allowed are 1 to {MOST_STATIONS}"
        )),
        _ => Ok(()),
    }
}

impl Asked {
    /// The method with its options; refused if they do not fit the method.
    fn method(&self) -> PyResult<Method> {
        let method: Method = self
            .method
            .parse()
            .or_else(|error| refuse(format!("method = {error}")))?;
        let settings = Settings {
            segments: self.segments,
            intervals: self.intervals,
            keep_unstable: self.keep_unstable,
            full_model: self.full_model,
            route: self.route()?,
        };
        method.with(settings).or_else(|unfit| {
            let value = unfit.value.map(|value| format!(" = {value}"));
            refuse(format!(
                "{}{}: {}",
                unfit.setting,
                value.unwrap_or_default(),
                unfit.why
            ))
        })
    }

    fn route(&self) -> PyResult<Route> {
        let route = self.path.parse();
        route.or_else(|error| refuse(format!("path = {error}")))
    }

    fn options(&self) -> PyResult<Options> {
        check_stations(self.stations)?;
        let method = self.method()?;
        Ok(Options {
            method,
            route: self.route()?,
            tolerance: self.tolerance,
            modes: self.modes,
            // Any number of modes is a request here: shooting refuses it.
            mode_shapes: self.mode_shapes || (self.modes > 0 && method.is_shooting()),
            every_node: true,
            stations: self.stations,
            limit: limit(self.time_limit),
            ..Options::default()
        })
    }
}

/// The limit of the time that begins now.
pub fn limit(seconds: Option<f64>) -> Limit {
    Limit {
        deadline: deadline(seconds),
        ..Limit::default()
    }
}

/// When these seconds, which begin now, are over; never, beyond what a clock counts.
fn deadline(seconds: Option<f64>) -> Option<Instant> {
    let time = Duration::try_from_secs_f64(seconds?).ok()?;
    Instant::now().checked_add(time)
}

/// Reports every step of a relaxation to a monitor, counted over all grids.
pub fn reporter<'a>(monitor: &'a Monitor, name: &'a str) -> impl FnMut(&Progress) + 'a {
    let (mut before, mut last) = (0, 0);
    move |progress| {
        let (Progress::Relaxing { step, .. }
        | Progress::Shooting(CorrectionProgress {
            iteration: step, ..
        })) = progress;
        if *step < last {
            // The next grid counts from the beginning.
            before += last + 1;
        }
        last = *step;
        monitor.report((before + step) as f64, None, || {
            format!("{name}: {progress}")
        });
    }
}

/// Most rods of a leaf that may be solved on the calling thread, and most nodes of its grid: a
/// step then takes milliseconds.
const FEW_RODS: usize = 8;
const FEW_NODES: usize = 4096;

/// Solves a leaf on the calling thread if all steps are short; otherwise returns `None`.
fn solve_here(
    py: Python,
    scenario: &scenario::Scenario,
    asked: &Asked,
    options: &Options,
    progress: Option<&Bound<PyAny>>,
    interrupt: &mut Interrupt,
) -> PyResult<Option<Result<Equilibrium, RelaxError>>> {
    let rods = scenario.rods.len();
    let few = |segments: usize| rods.saturating_mul(segments) <= FEW_NODES;
    let short_steps = options.method.semi_implicit().is_some() && options.modes == 0;
    if !short_steps || rods > FEW_RODS || !few(asked.segments.unwrap_or(0)) {
        return Ok(None);
    }
    let mut options = options.clone();
    let found = run_here(py, progress, interrupt, |monitor, step| {
        monitor.watch(&mut options.limit);
        let mut large = false;
        let mut report = reporter(monitor, &scenario.name);
        let found = relax::relax(scenario, &options, &mut |progress| {
            report(progress);
            step(monitor);
            let is_large = matches!(progress, Progress::Relaxing { grid, .. } if !few(*grid));
            if is_large && !monitor.cancelled() {
                // It restarts on the pool, which costs little compared with the remaining steps.
                large = true;
                monitor.cancel();
            }
        });
        (!large).then_some(found)
    })?;
    Ok(found.flatten())
}

/// Lets a leaf come to rest; after Ctrl-C as far as it came.
#[pyfunction]
#[pyo3(name = "relax")]
pub fn relax_one(
    py: Python,
    scenario: &Scenario,
    asked: Asked,
    progress: Option<&Bound<PyAny>>,
) -> PyResult<Leaf> {
    let mut options = asked.options()?;
    let mut interrupt = Interrupt::default();
    if let Some(tolerance) = asked.veins {
        let base = scenario.base(py)?;
        let refined = run_keeping(py, progress, &mut interrupt, move |monitor| {
            monitor.watch(&mut options.limit);
            let name = base.scenario().name.clone();
            study::refine_veins(&base, tolerance, &options, &mut reporter(monitor, &name))
        })?;
        let refined = interrupt.or_else(refined, |error| match error {
            VeinsError::Vary(error) => vary_error(py, error),
            error => value_error(error),
        });
        let RefinedBlade { base, leaf } = refined?;
        let input = base.scenario().clone().into();
        return interrupt.hand_over(py, Leaf::new(leaf, input, asked.stations));
    }
    let input = scenario.checked.clone();
    let estimate = asked.veins_error && input.blade.is_some();
    let estimate = (estimate.then(|| scenario.base(py)).transpose()?).zip(Some(options.clone()));
    let found = if let Some(points) = &asked.points {
        let (scenario, points) = (input.clone(), points.read(&input)?.points);
        let found = run_keeping(py, progress, &mut interrupt, move |monitor| {
            monitor.watch(&mut options.limit);
            let mut report = reporter(monitor, &scenario.name);
            study::relax_from_points(&scenario, &points, &options, &mut report)
        })?;
        interrupt.or_else(found, value_error)?
    } else if let Some(start) = &asked.start {
        let (scenario, stations, rods) = (input.clone(), start.stations.clone(), start.rods());
        let found = run_keeping(py, progress, &mut interrupt, move |monitor| {
            monitor.watch(&mut options.limit);
            let from: (&[f64], &[RodShape]) = (&stations, &rods);
            relax::relax_from(
                &scenario,
                from,
                &options,
                &mut reporter(monitor, &scenario.name),
            )
        })?;
        interrupt.or_else(found, value_error)?
    } else if asked.margin {
        let scenario = input.clone();
        let found = run_keeping(py, progress, &mut interrupt, move |monitor| {
            monitor.watch(&mut options.limit);
            let mut report = reporter(monitor, &scenario.name);
            let mut report_margin = |progress: &MarginProgress| match progress {
                MarginProgress::Relaxing(progress) => report(progress),
                MarginProgress::Searching { done, all, .. } => {
                    monitor.report(*done as f64, Some(*all as f64), || {
                        format!("{}: {done} of {all} searches", scenario.name)
                    });
                }
            };
            study::relax_with_margin(&scenario, &options, &mut report_margin)
        })?;
        interrupt.or_else(found, value_error)?
    } else if asked.sensitivity.is_empty() && input.blade.is_some() {
        let base = scenario.base(py)?;
        let found = run_keeping(py, progress, &mut interrupt, move |monitor| {
            monitor.watch(&mut options.limit);
            let name = base.scenario().name.clone();
            study::relax_blade(&base, &options, &mut reporter(monitor, &name))
        })?;
        interrupt.or_else(found, value_error)?
    } else if asked.sensitivity.is_empty() {
        if let Some(found) = solve_here(py, &input, &asked, &options, progress, &mut interrupt)? {
            let found = interrupt.or_else(found, value_error)?;
            return interrupt.hand_over(py, Leaf::new(found, input, asked.stations));
        }
        let scenario = input.clone();
        let found = run_keeping(py, progress, &mut interrupt, move |monitor| {
            monitor.watch(&mut options.limit);
            relax::relax(&scenario, &options, &mut reporter(monitor, &scenario.name))
        })?;
        interrupt.or_else(found, value_error)?
    } else {
        let base = scenario.base(py)?;
        let keys = match &asked.sensitivity[..] {
            [every] if every == "all" => base.differentiable_numbers(),
            keys => {
                let keys: Result<Vec<ParameterKeys>, _> = (keys.iter())
                    .map(|key| ParameterKeys::parse_with_lists(key))
                    .collect();
                keys.map_err(|error| vary_error(py, error))?
            }
        };
        let found = run_keeping(py, progress, &mut interrupt, move |monitor| {
            monitor.watch(&mut options.limit);
            let name = base.scenario().name.clone();
            study::relax_with_sensitivities(&base, &keys, &options, &mut reporter(monitor, &name))
        })?;
        interrupt.or_else(found, |error| match error {
            SensitivityError::Vary(error) => vary_error(py, error),
            error => value_error(error),
        })?
    };
    let found = match estimate.filter(|_| !interrupt.happened()) {
        None => found,
        Some((base, mut options)) => run_keeping(py, progress, &mut interrupt, move |monitor| {
            monitor.watch(&mut options.limit);
            let mut found = found;
            study::estimate_error_in_veins(&base, &mut found, &options);
            found
        })?,
    };
    interrupt.hand_over(py, Leaf::new(found, input, asked.stations))
}

/// What became of a scenario: a leaf, or why it is refused.
type LeafOrWhy = Result<Equilibrium, String>;

/// Lets many leaves come to rest, side by side. The first that is refused ends the run, unless refusals are
/// to be told in place of leaves. After Ctrl-C there is none where a leaf was not finished.
#[pyfunction]
pub fn relax_many(
    py: Python,
    scenarios: Vec<PyRef<Scenario>>,
    asked: Asked,
    tell_refusals: bool,
    progress: Option<&Bound<PyAny>>,
) -> PyResult<Vec<LeafOrRefusal>> {
    let mut options = asked.options()?;
    let checked: Vec<Arc<scenario::Scenario>> = (scenarios.iter())
        .map(|scenario| scenario.checked.clone())
        .collect();
    let inputs = checked.clone();
    let base = |scenario: &PyRef<Scenario>| {
        let estimate = asked.veins_error && scenario.checked.blade.is_some();
        estimate.then(|| scenario.base(py)).transpose()
    };
    let bases = scenarios.iter().map(base).collect::<PyResult<Vec<_>>>()?;
    let each = asked.time_limit_each;
    let finished: Arc<Vec<Mutex<Option<LeafOrWhy>>>> =
        Arc::new(checked.iter().map(|_| Mutex::default()).collect());
    let places = finished.clone();
    let ended = run(py, progress, move |monitor| {
        monitor.watch(&mut options.limit);
        let (done, all, clock) = (AtomicUsize::new(0), checked.len(), Instant::now());
        let one = |(number, scenario): (usize, &Arc<scenario::Scenario>)| {
            let mut options = options.clone();
            let own = deadline(each);
            options.limit.deadline = options.limit.deadline.into_iter().chain(own).min();
            let mut found = relax::relax(scenario, &options, &mut |_| {});
            if let (Ok(leaf), Some(base)) = (&mut found, &bases[number]) {
                study::estimate_error_in_veins(base, leaf, &options);
            }
            if monitor.cancelled() && found.as_ref().is_ok_and(|leaf| !leaf.outcome.is_at_rest()) {
                // Stopped on its way.
                return Ok(());
            }
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            monitor.report(done as f64, Some(all as f64), || {
                format!("{done} of {all} leaves, {}", elapsed(clock))
            });
            let found = match found {
                Err(error) if !tell_refusals => {
                    return Err(format!("scenarios[{number}], {}: {error}", scenario.name));
                }
                found => found.map_err(|error| error.to_string()),
            };
            *places[number]
                .lock()
                .unwrap_or_else(PoisonError::into_inner) = Some(found);
            Ok(())
        };
        // One by one: a leaf may take a thousand times as long as the next.
        let leaves = checked.par_iter().enumerate().with_max_len(1);
        leaves.try_for_each(one)
    });
    let leaf = |(place, input): (&Mutex<Option<LeafOrWhy>>, _)| match place
        .lock()
        .unwrap_or_else(PoisonError::into_inner)
        .take()
    {
        Some(Ok(found)) => {
            let leaf = Leaf::new(found, input, asked.stations);
            Py::new(py, leaf).map(|leaf| Some(LeafOrRefusal::Leaf(leaf)))
        }
        Some(Err(why)) => Ok(Some(LeafOrRefusal::Refusal(why))),
        None => Ok(None),
    };
    let leaves = || finished.iter().zip(inputs).map(leaf);
    match ended {
        Err(stop) if is_interrupt(py, &stop) => {
            let leaves = leaves().collect::<PyResult<Vec<_>>>()?;
            Err(interrupted(py, stop, leaves))
        }
        ended => {
            ended?.or_else(refuse)?;
            leaves().filter_map(Result::transpose).collect()
        }
    }
}

/// The shortest of so many times in which the library alone lets the leaf of a scenario come to rest,
/// with the same request as [`relax_one`]: for the tests.
#[pyfunction]
pub fn library_seconds(py: Python, scenario: &Scenario, runs: usize) -> f64 {
    let scenario = scenario.checked.clone();
    py.detach(|| {
        let times = (0..runs).map(|_| {
            let clock = Instant::now();
            let leaf = scenario.relaxation().every_node().run();
            // As Python does, whose clock runs until the result is gone.
            drop(leaf);
            clock.elapsed().as_secs_f64()
        });
        times.fold(f64::INFINITY, f64::min)
    })
}
