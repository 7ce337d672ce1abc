//! The verbs of the program, without files.

use std::ffi::OsString;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use leafdyn::relax::{self, Equilibrium, Method, Options, RelaxError, SemiImplicit};
use leafdyn::study::{
    self, CELL_SECONDS, ChartOptions, CheckOptions, Contender, MOST_POINTS, Map, MapMethod,
    MapRequest, MapShow, TraceError, TraceRequest, Vary,
};
use leafdyn::{cli, scenario};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::arrays::{array, curves, nodes};
use crate::errors::{cannot, cannot_vary};
use crate::result::{Files, Leaf};
use crate::run::{Monitor, elapsed, run};
use crate::scenario::Scenario;

/// What is asked of a relaxation besides its scenario.
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
}

fn refuse<T>(message: impl Into<String>) -> PyResult<T> {
    Err(PyValueError::new_err(message.into()))
}

impl Asked {
    /// The method with its own options; refused where they do not fit each other.
    fn method(&self) -> PyResult<Method> {
        let method: Method = self
            .method
            .parse()
            .or_else(|error| refuse(format!("method = {error}")))?;
        let (segments, intervals) = (self.segments, self.intervals);
        if let Some(found) = intervals
            && !matches!(
                method,
                Method::Shooting { .. } | Method::ShootingFromRest { .. }
            )
        {
            return refuse(format!(
                "intervals = {found}: only the method shooting has intervals"
            ));
        }
        if let (Some(found), true) = (segments, method.is_shooting()) {
            return refuse(format!(
                "segments = {found}: shooting has no grid; leave it out, or set the number of intervals"
            ));
        }
        Ok(match method {
            Method::SemiImplicit(how) => Method::SemiImplicit(SemiImplicit {
                segments,
                keep_unstable: self.keep_unstable,
                full_model: self.full_model,
                ..how
            }),
            Method::Explicit { .. } if self.keep_unstable => {
                return refuse(
                    "keep_unstable: explicit motion leaves unstable equilibria; use the method semi-implicit or shooting",
                );
            }
            Method::Explicit { .. } => Method::Explicit { segments },
            Method::SingleShooting => Method::SingleShooting,
            Method::Shooting { .. } => Method::Shooting { intervals },
            Method::ShootingFromRest { .. } => Method::ShootingFromRest { intervals },
        })
    }

    fn options(&self) -> PyResult<Options> {
        Ok(Options {
            method: self.method()?,
            tolerance: self.tolerance,
            modes: self.modes,
            mode_shapes: self.mode_shapes,
            ..Options::default()
        })
    }
}

/// Says how far a relaxation has come.
fn heard<'a>(monitor: &'a Monitor, name: &'a str) -> impl FnMut(&relax::Progress) + 'a {
    move |progress| {
        monitor.say(progress.step as f64, None, || {
            let relax::Progress {
                grid,
                step,
                residual,
            } = progress;
            format!("{name}: {grid} segments a vein, step {step}, residual {residual:.1e}")
        });
    }
}

/// Lets a leaf come to rest.
#[pyfunction]
#[pyo3(name = "relax")]
pub fn relax_one(
    py: Python,
    scenario: &Scenario,
    asked: Asked,
    progress: Option<&Bound<PyAny>>,
) -> PyResult<Leaf> {
    let mut options = asked.options()?;
    let scenario = scenario.checked.clone();
    let found = run(py, progress, move |monitor| {
        options.limit = monitor.limit();
        relax::relax(&scenario, &options, &mut heard(monitor, &scenario.name))
    })?;
    Ok(Leaf(found.map_err(cannot)?))
}

/// Lets many leaves come to rest, side by side.
#[pyfunction]
pub fn relax_many(
    py: Python,
    scenarios: Vec<PyRef<Scenario>>,
    asked: Asked,
    progress: Option<&Bound<PyAny>>,
) -> PyResult<Vec<Leaf>> {
    let mut options = asked.options()?;
    let scenarios: Vec<Arc<scenario::Scenario>> = (scenarios.iter())
        .map(|scenario| scenario.checked.clone())
        .collect();
    let found = run(py, progress, move |monitor| {
        options.limit = monitor.limit();
        let (done, all, clock) = (AtomicUsize::new(0), scenarios.len(), Instant::now());
        let one = |scenario: &Arc<scenario::Scenario>| {
            let found = relax::relax(scenario, &options, &mut |_| {});
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            monitor.say(done as f64, Some(all as f64), || {
                format!("{done} of {all} leaves, {}", elapsed(clock))
            });
            found
        };
        // One by one: a leaf may take a thousand times as long as its neighbour.
        let leaves = scenarios.par_iter().with_max_len(1).map(one);
        leaves.collect::<Result<Vec<Equilibrium>, RelaxError>>()
    })?;
    Ok(found.map_err(cannot)?.into_iter().map(Leaf).collect())
}

/// A check: its files, the relaxed leaf, and if there is one the boundary-value solution: its
/// stations and positions.
type Checked<'py> = (Files, Leaf, Option<[Bound<'py, PyAny>; 2]>);

/// Has a leaf confirmed by an independent method.
#[pyfunction]
pub fn check<'py>(
    py: Python<'py>,
    scenario: &Scenario,
    tolerance: Option<f64>,
    keep_unstable: bool,
    intervals: Option<usize>,
    progress: Option<&Bound<PyAny>>,
) -> PyResult<Checked<'py>> {
    let scenario = scenario.checked.clone();
    let found = run(py, progress, move |monitor| {
        let options = CheckOptions {
            tolerance,
            keep_unstable,
            intervals,
            limit: monitor.limit(),
        };
        study::check(&scenario, &options, &mut heard(monitor, &scenario.name))
    })?;
    let check = found.map_err(cannot)?;
    let solution = match check.solution() {
        None => None,
        Some(solution) => {
            let count = solution.stations.len();
            let stations = array(py, solution.stations.clone(), &[count])?;
            Some([stations, nodes(py, &solution.rods, "positions")?])
        }
    };
    let leaf = Leaf(check.relaxed.clone());
    Ok((Files::of(check), leaf, solution))
}

/// Equilibria: the files of all, and each with the number of starts that ended there and whether
/// the plain one is among them.
type All = (Files, Vec<(Leaf, usize, bool)>);

/// Looks for all equilibria of a leaf.
#[pyfunction]
pub fn all_shapes(
    py: Python,
    scenario: &Scenario,
    tolerance: Option<f64>,
    full_model: bool,
    progress: Option<&Bound<PyAny>>,
) -> PyResult<All> {
    let scenario = scenario.checked.clone();
    let found = run(py, progress, move |monitor| {
        let how = SemiImplicit {
            full_model,
            ..SemiImplicit::default()
        };
        let mut heard = |starts: usize, found: usize| {
            monitor.say(starts as f64, None, || {
                format!("{starts} starts, {found} equilibria")
            });
        };
        study::all(&scenario, how, tolerance, &monitor.limit(), &mut heard)
    })?;
    let all = found.map_err(cannot)?;
    let found = all.found.iter();
    let leaves = found.map(|one| (Leaf(one.equilibrium.clone()), one.starts, one.plain));
    let leaves = leaves.collect();
    Ok((Files::of(all), leaves))
}

/// A trace: its files, whether it is complete, its remark, and the centerlines of the points of
/// each branch.
type Traced<'py> = (Files, bool, Option<String>, Vec<Vec<Bound<'py, PyAny>>>);

/// Follows an equilibrium through a number of its scenario.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "they are those of the verb")]
pub fn trace<'py>(
    py: Python<'py>,
    scenario: &Scenario,
    vary: &str,
    switch: bool,
    keep_unstable: bool,
    segments: Option<usize>,
    tolerance: Option<f64>,
    most_points: Option<usize>,
    cross_section: Option<f64>,
    progress: Option<&Bound<PyAny>>,
) -> PyResult<Traced<'py>> {
    let vary: Vary = vary.parse().map_err(|error| cannot_vary(py, error))?;
    let request = TraceRequest {
        base: scenario.base(py)?,
        vary,
        switch,
        keep_unstable,
        segments,
        tolerance,
        most_points: most_points.unwrap_or(MOST_POINTS),
        cross_section,
    };
    let found = run(py, progress, move |monitor| {
        let mut heard = |branch: usize, points: usize, value: f64| {
            monitor.say_or_end(points as f64, None, || {
                format!("branch {}, {points} points, at {value:.6}", branch + 1)
            });
        };
        study::trace(&request, &mut heard)
    })?;
    let trace = found.map_err(|error| match error {
        TraceError::Scenario(error) => cannot_vary(py, error),
        error => cannot(error),
    })?;
    let branches = trace.branches.iter();
    let lines: PyResult<Vec<Vec<_>>> = branches
        .map(|branch| {
            branch
                .points
                .iter()
                .map(|point| curves(py, &point.curves))
                .collect()
        })
        .collect();
    let (complete, remark) = (trace.complete, trace.remark.clone());
    Ok((Files::of(trace), complete, remark, lines?))
}

/// Solves a leaf by several methods over one or two numbers.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "they are those of the verb")]
pub fn map(
    py: Python,
    scenario: &Scenario,
    vary: Vec<String>,
    methods: Option<Vec<String>>,
    tolerance: Option<f64>,
    cell_seconds: Option<f64>,
    show: &str,
    progress: Option<&Bound<PyAny>>,
) -> PyResult<Files> {
    let axes: Result<Vec<Vary>, _> = vary.iter().map(|axis| axis.parse()).collect();
    let methods = methods.map(|words| {
        let methods: Result<Vec<MapMethod>, _> = words.iter().map(|word| word.parse()).collect();
        methods.or_else(|error| refuse(format!("methods = {error}")))
    });
    let show: MapShow = show
        .parse()
        .or_else(|error| refuse(format!("show = {error}")))?;
    let request = MapRequest::new(
        scenario.base(py)?,
        axes.map_err(|error| cannot_vary(py, error))?,
        methods.transpose()?,
        tolerance,
        cell_seconds.unwrap_or(CELL_SECONDS),
    );
    let request = request.map_err(cannot)?;
    let mut map = run(py, progress, move |monitor| {
        let todo: Vec<_> = (0..request.cells())
            .map(|cell| (cell, request.methods.clone()))
            .collect();
        let (mut rows, mut done, clock) = (Vec::new(), 0, Instant::now());
        study::map(&request, &todo, &mut |new| {
            rows.extend(new);
            done += 1;
            let cells = todo.len();
            monitor.say(f64::from(done), Some(cells as f64), || {
                format!("{done} of {cells} cells, {}", elapsed(clock))
            });
            !monitor.cancelled()
        });
        Map::new(request, rows)
    })?;
    map.show = show;
    Ok(Files::of(map))
}

/// Measures speed against accuracy.
#[pyfunction]
pub fn chart(
    py: Python,
    scenario: &Scenario,
    seconds: Option<f64>,
    methods: Option<Vec<String>>,
    progress: Option<&Bound<PyAny>>,
) -> PyResult<(Files, bool, Vec<String>)> {
    let mut options = ChartOptions::default();
    options.seconds = seconds.unwrap_or(options.seconds);
    if let Some(words) = methods {
        let wanted: Result<Vec<Contender>, _> = words.iter().map(|word| word.parse()).collect();
        let wanted = wanted.or_else(|error| refuse(format!("methods = {error}")))?;
        options.contenders.retain(|who| wanted.contains(who));
    }
    let scenario = scenario.checked.clone();
    let found = run(py, progress, move |monitor| {
        study::chart(&scenario, &options, &mut |turn| {
            monitor.say_or_end(turn.round as f64, Some(turn.rounds as f64), || {
                format!("{}, round {} of {}", turn.knob, turn.round, turn.rounds)
            });
        })
    })?;
    let chart = found.map_err(cannot)?;
    let (confirmed, remarks) = (chart.confirmed(), chart.remarks.clone());
    Ok((Files::of(chart), confirmed, remarks))
}

/// The shortest of so many times in which the library alone reads a scenario's text and lets the leaf
/// come to rest: for the tests.
#[pyfunction]
pub fn library_seconds(py: Python, text: &str, runs: usize) -> f64 {
    py.detach(|| {
        let times = (0..runs).map(|_| {
            let clock = Instant::now();
            let leaf = scenario::Scenario::from_toml(text).map(|scenario| scenario.relax());
            let time = clock.elapsed().as_secs_f64();
            drop(leaf);
            time
        });
        times.fold(f64::INFINITY, f64::min)
    })
}

/// The program: does what these arguments ask for, the first of which is its name, and returns its
/// exit status.
#[pyfunction]
#[pyo3(name = "main")]
pub fn program(py: Python, arguments: Vec<OsString>) -> u8 {
    py.detach(|| cli::main_with(arguments))
}
