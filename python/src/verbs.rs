//! Studies of leaves at rest, and the program itself.

use std::ffi::OsString;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use leafdyn::relax::SemiImplicit;
use leafdyn::scenario;
use leafdyn::study::{
    self, BoundaryRequest, ChartError, ChartOptions, ChartProgress, CheckOptions,
    DEFAULT_CELL_SECONDS, MOST_POINTS, Map, MapMethod, MapRequest, MapShow, SolverConfig,
    TraceError, TraceRequest,
};
use pyo3::prelude::*;

use crate::arrays::{array, curves, nodes};
use crate::errors::{value_error, vary_error};
use crate::range::Range;
use crate::relax::{check_stations, limit, refuse, reporter};
use crate::result::{Files, Leaf};
use crate::run::{Interrupt, elapsed, interrupted, is_interrupt, on_pool, run, run_keeping};
use crate::scenario::Scenario;

/// A check: its files, the relaxed leaf, and the stations and positions of the boundary-value
/// solution, if there is one.
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
    let input = scenario.clone();
    let found = run(py, progress, move |monitor| {
        let options = CheckOptions {
            tolerance,
            keep_unstable,
            intervals,
            limit: monitor.limit(),
        };
        study::check(&scenario, &options, &mut reporter(monitor, &scenario.name))
    })?;
    let check = found.map_err(value_error)?;
    let solution = match check.solution() {
        None => None,
        Some(solution) => {
            let count = solution.stations.len();
            let stations = array(py, solution.stations.clone(), &[count])?;
            Some([stations, nodes(py, &solution.rods, "positions")?])
        }
    };
    let leaf = Leaf::as_found(check.relaxed.clone(), input.clone());
    Ok((Files::of(check, input), leaf, solution))
}

/// All equilibria: their files, and each leaf with the number of starts that ended there and
/// whether the plain one is among them.
type Equilibria = (Files, Vec<(Leaf, usize, bool)>);

/// Looks for all equilibria of a leaf.
#[pyfunction]
pub fn equilibria(
    py: Python,
    scenario: &Scenario,
    tolerance: Option<f64>,
    full_model: bool,
    stations: Option<usize>,
    time_limit: Option<f64>,
    progress: Option<&Bound<PyAny>>,
) -> PyResult<Equilibria> {
    check_stations(stations)?;
    let mut limit = limit(time_limit);
    let mut interrupt = Interrupt::default();
    let scenario = scenario.checked.clone();
    let input = scenario.clone();
    let found = run_keeping(py, progress, &mut interrupt, move |monitor| {
        let how = SemiImplicit {
            full_model,
            ..SemiImplicit::default()
        };
        let mut report = |starts: usize, found: usize| {
            monitor.report(starts as f64, None, || {
                format!("{starts} starts, {found} equilibria")
            });
        };
        monitor.watch(&mut limit);
        study::equilibria(&scenario, how, tolerance, &limit, &mut report)
    })?;
    let mut all = interrupt.or_else(found, value_error)?;
    for one in &mut all.found {
        one.equilibrium = one.equilibrium.clone().at_stations(&input, stations);
    }
    let leaves = all.found.iter().map(|one| {
        let leaf = Leaf::as_found(one.equilibrium.clone(), input.clone());
        (leaf, one.starts, one.plain)
    });
    let leaves = leaves.collect();
    let found: Equilibria = (Files::of(all, input), leaves);
    interrupt.hand_over(py, found)
}

/// A trace, or a boundary: its files, whether it is complete, its remark, and the centerlines of the
/// points of each branch, or curve.
type Traced<'py> = (Files, bool, Option<String>, Vec<Vec<Bound<'py, PyAny>>>);

/// Options of a trace.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Asked {
    switch: bool,
    until: Option<String>,
    keep_unstable: bool,
    segments: Option<usize>,
    tolerance: Option<f64>,
    points: Option<usize>,
    /// Seconds after which the run ends with what it has.
    time_limit: Option<f64>,
}

impl Asked {
    fn request(&self, py: Python, scenario: &Scenario, vary: &Range) -> PyResult<TraceRequest> {
        let until = self.until.as_deref().map(str::parse).transpose();
        let until = until.or_else(|error| refuse(format!("until = {error}")))?;
        Ok(TraceRequest {
            vary: vary.vary(py)?,
            base: scenario.base(py)?,
            switch: self.switch,
            until,
            keep_unstable: self.keep_unstable,
            segments: self.segments,
            tolerance: self.tolerance,
            most_points: self.points.unwrap_or(MOST_POINTS),
            limit: limit(self.time_limit),
        })
    }
}

fn trace_error(py: Python, error: TraceError) -> PyErr {
    match error {
        TraceError::Scenario(error) => vary_error(py, error),
        error => value_error(error),
    }
}

/// Follows an equilibrium through a number of its scenario; after Ctrl-C as far as it came.
#[pyfunction]
pub fn trace<'py>(
    py: Python<'py>,
    scenario: &Scenario,
    vary: Range,
    asked: Asked,
    progress: Option<&Bound<PyAny>>,
) -> PyResult<Traced<'py>> {
    let mut request = asked.request(py, scenario, &vary)?;
    let mut interrupt = Interrupt::default();
    let found = run_keeping(py, progress, &mut interrupt, move |monitor| {
        monitor.watch(&mut request.limit);
        let mut report = |branch: usize, points: usize, value: f64| {
            monitor.report(points as f64, None, || {
                format!("branch {}, {points} points, at {value:.6}", branch + 1)
            });
        };
        study::trace(&request, &mut report)
    })?;
    let trace = interrupt.or_else(found, |error| trace_error(py, error))?;
    let branches = trace.branches.iter();
    let lines: PyResult<Vec<Vec<_>>> = branches
        .map(|branch| {
            let points = branch.points.iter();
            points.map(|point| curves(py, &point.curves)).collect()
        })
        .collect();
    let remark = trace.remark.as_ref().map(ToString::to_string);
    let complete = trace.complete;
    let files = Files::of(trace, scenario.checked.clone());
    interrupt.hand_over(py, (files, complete, remark, lines?))
}

/// Follows the points at which the index of a leaf changes through two numbers of its scenario.
#[pyfunction]
pub fn boundary<'py>(
    py: Python<'py>,
    scenario: &Scenario,
    along: Range,
    across: Range,
    asked: Asked,
    progress: Option<&Bound<PyAny>>,
) -> PyResult<Traced<'py>> {
    let mut interrupt = Interrupt::default();
    let mut request = BoundaryRequest {
        map: None,
        trace: asked.request(py, scenario, &along)?,
        across: across.vary(py)?,
    };
    let found = run_keeping(py, progress, &mut interrupt, move |monitor| {
        monitor.watch(&mut request.trace.limit);
        let mut report = |curve: Option<usize>, points: usize, [first, second]: [f64; 2]| {
            monitor.report(points as f64, None, || {
                let what = curve.map_or("trace".into(), |curve| format!("curve {}", curve + 1));
                format!("{what}, {points} points, at {first:.6}, {second:.6}")
            });
        };
        study::trace_stability_boundary(&request, &mut report)
    })?;
    let boundary = interrupt.or_else(found, |error| trace_error(py, error))?;
    let lines: PyResult<Vec<Vec<_>>> = (boundary.curves.iter())
        .map(|curve| {
            let points = curve.points.iter();
            points.map(|point| curves(py, &point.curves)).collect()
        })
        .collect();
    let remark = boundary.remark.as_ref().map(ToString::to_string);
    let complete = boundary.complete;
    let files = Files::of(boundary, scenario.checked.clone());
    interrupt.hand_over(py, (files, complete, remark, lines?))
}

/// Solves a leaf by several methods over one or two numbers; after Ctrl-C the cells that were finished.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "they are those of the verb")]
pub fn map(
    py: Python,
    scenario: &Scenario,
    vary: Vec<Range>,
    methods: Option<Vec<String>>,
    tolerance: Option<f64>,
    cell_seconds: Option<f64>,
    show: &str,
    progress: Option<&Bound<PyAny>>,
) -> PyResult<Files> {
    let axes: PyResult<Vec<_>> = vary.iter().map(|axis| axis.vary(py)).collect();
    let methods = methods.map(|words| {
        let methods: Result<Vec<MapMethod>, _> = words.iter().map(|word| word.parse()).collect();
        methods.or_else(|error| refuse(format!("methods = {error}")))
    });
    let show: MapShow = show
        .parse()
        .or_else(|error| refuse(format!("show = {error}")))?;
    let request = MapRequest::new(
        scenario.base(py)?,
        axes?,
        methods.transpose()?,
        tolerance,
        cell_seconds.unwrap_or(DEFAULT_CELL_SECONDS),
    );
    let mut request = request.map_err(value_error)?;
    let finished = Arc::new(Mutex::new(Vec::new()));
    let (rows, asked) = (finished.clone(), request.clone());
    let ended = run(py, progress, move |monitor| {
        request.limit = monitor.limit();
        let todo: Vec<usize> = (0..request.cells()).collect();
        let (mut done, clock) = (0, Instant::now());
        study::map(&request, &todo, &mut |new| {
            let mut rows = rows.lock().unwrap_or_else(PoisonError::into_inner);
            rows.extend(new);
            done += 1;
            let cells = todo.len();
            monitor.report(f64::from(done), Some(cells as f64), || {
                format!("{done} of {cells} cells, {}", elapsed(clock))
            });
            !monitor.cancelled()
        });
        // A copy, as Ctrl-C may still come.
        let rows = rows.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let mut map = Map::new(request, rows);
        if !monitor.cancelled() {
            map.find_jumps(&|done, pairs| {
                monitor.report(done as f64, Some(pairs as f64), || {
                    format!("{done} of {pairs} pairs of cells that stand apart")
                });
            });
        }
        map
    });
    let files = |map: Map| Files::of(Map { show, ..map }, scenario.checked.clone());
    match ended {
        Err(stop) if is_interrupt(py, &stop) => {
            let rows =
                std::mem::take(&mut *finished.lock().unwrap_or_else(PoisonError::into_inner));
            Err(interrupted(py, stop, files(Map::new(asked, rows))))
        }
        ended => ended.map(files),
    }
}

/// A chart: its files, those of the cost against the number of veins if that was asked for, whether
/// its reference is confirmed, and remarks.
type Charted = (Files, Option<Files>, bool, Vec<String>);

/// Measures speed against accuracy, and cost against the number of veins over `leaves`.
#[pyfunction]
pub fn chart(
    py: Python,
    scenario: &Scenario,
    seconds: Option<f64>,
    methods: Option<Vec<String>>,
    leaves: Vec<PyRef<Scenario>>,
    motion: bool,
    progress: Option<&Bound<PyAny>>,
) -> PyResult<Charted> {
    let mut options = ChartOptions {
        motion,
        ..ChartOptions::default()
    };
    options.seconds = seconds.unwrap_or(options.seconds);
    if let Some(words) = methods {
        let wanted: Result<Vec<SolverConfig>, _> = words.iter().map(|word| word.parse()).collect();
        let wanted = wanted.or_else(|error| refuse(format!("methods = {error}")))?;
        options.contenders.retain(|who| wanted.contains(who));
    }
    let leaves: Vec<scenario::Scenario> = (leaves.iter())
        .map(|leaf| (*leaf.checked).clone())
        .collect();
    let scenario = scenario.checked.clone();
    let input = scenario.clone();
    let found = run(py, progress, move |monitor| {
        let mut report = |turn: &ChartProgress| {
            monitor.report_or_end(turn.round as f64, Some(turn.rounds as f64), || {
                let ChartProgress {
                    rods,
                    round,
                    rounds,
                    ..
                } = turn;
                format!("{rods} veins, {}, round {round} of {rounds}", turn.setting)
            });
        };
        let mut chart = study::chart(&scenario, &options, &mut report)?;
        if !leaves.is_empty() {
            let scaling = study::scaling(&leaves, scenario.tolerance, &options, &mut report)?;
            chart.scaling = Some(scaling);
        }
        Ok::<_, ChartError>(chart)
    })?;
    let chart = found.map_err(value_error)?;
    let confirmed = chart.is_reference_confirmed();
    let remarks = chart.remarks.iter().map(ToString::to_string).collect();
    let scaling = chart.scaling.clone();
    let scaling = scaling.map(|scaling| Files::of(scaling, input.clone()));
    Ok((Files::of(chart, input), scaling, confirmed, remarks))
}

/// The program: does what these arguments ask for, the first of which is its name, and returns its
/// exit status.
#[pyfunction]
#[pyo3(name = "main")]
pub fn program(py: Python, arguments: Vec<OsString>) -> PyResult<u8> {
    on_pool(py, || leafdyn_program::verbs::main_with(arguments))
}
