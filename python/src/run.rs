//! Computations outside the interpreter, on a separate pool of threads, while the calling thread
//! waits without the interpreter's lock and checks for Ctrl-C. Switching to another thread and back
//! takes a considerable part of the time of a small leaf, so computations in short steps run on the
//! calling thread, which checks for Ctrl-C between them.

use std::any::Any;
use std::cell::OnceCell;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::thread::{self, ThreadId};
use std::time::{Duration, Instant};
use std::{mem, process};

use leafdyn::relax::Limit;
use pyo3::IntoPyObjectExt;
use pyo3::exceptions::{PyKeyboardInterrupt, PyRuntimeError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyType;
use rayon::{ThreadPool, ThreadPoolBuilder};

/// Interval between checks for signals and progress.
const POLL_INTERVAL: Duration = Duration::from_millis(10);

/// How long a run that Ctrl-C ends may take to hand over what it has found, unless a second Ctrl-C ends that, too.
struct Patience {
    least: Duration,
    /// Part of the time that the run has taken: more is lost if it is not waited for.
    part: f64,
    most: Duration,
}

const PATIENCE: Patience = Patience {
    least: Duration::from_millis(120),
    part: 0.1,
    most: Duration::from_secs(10),
};

impl Patience {
    /// With a run that has taken so long.
    fn with(&self, run: Duration) -> Duration {
        run.mul_f64(self.part).clamp(self.least, self.most)
    }
}

/// Most threads that can be requested.
const MOST_THREADS: usize = 1024;

/// The threads that compute. A forked process does not inherit them and makes new ones.
struct Pool {
    process: u32,
    threads: Arc<ThreadPool>,
}

static POOL: Mutex<Option<Pool>> = Mutex::new(None);

fn pool(wanted: Option<usize>) -> PyResult<Arc<ThreadPool>> {
    let mut pool = POOL.lock().unwrap_or_else(PoisonError::into_inner);
    let process = process::id();
    if let (Some(known), None) = (&*pool, wanted)
        && known.process == process
    {
        return Ok(known.threads.clone());
    }
    // By default the number is RAYON_NUM_THREADS, or that of the processors.
    let threads = ThreadPoolBuilder::new()
        .num_threads(wanted.unwrap_or(0))
        .thread_name(|_| "leafdyn".into())
        .build();
    let threads = threads.map_err(|error| PyRuntimeError::new_err(error.to_string()))?;
    let threads = Arc::new(threads);
    let new = Pool {
        process,
        threads: threads.clone(),
    };
    if let Some(old) = pool.replace(new)
        && old.process != process
    {
        // Its threads belong to another process and cannot be stopped.
        mem::forget(old);
    }
    Ok(threads)
}

/// Compute on so many threads from now on.
#[pyfunction]
pub fn set_threads(count: &Bound<PyAny>) -> PyResult<()> {
    let refused =
        || format!("count = {count:?}: allowed are whole numbers from 1 to {MOST_THREADS}");
    match count.extract::<usize>() {
        Ok(count) if (1..=MOST_THREADS).contains(&count) => pool(Some(count)).map(drop),
        Err(error) if error.is_instance_of::<PyTypeError>(count.py()) => {
            Err(PyTypeError::new_err(refused()))
        }
        _ => Err(PyValueError::new_err(refused())),
    }
}

/// The number of threads that compute.
#[pyfunction]
pub fn threads() -> PyResult<usize> {
    Ok(pool(None)?.current_num_threads())
}

/// Panics in a computation: for the tests.
#[pyfunction]
pub fn panic_on_purpose(py: Python) -> PyResult<()> {
    run(py, None, |_| panic!("on purpose"))
}

/// The progress of a run: the completed amount, the total if known, and a message.
type Report = (f64, Option<f64>, String);

/// The state shared by a run and the thread that waits for it.
#[derive(Default)]
pub struct Monitor {
    has_listener: bool,
    latest: Mutex<Option<Report>>,
    cancel: Arc<AtomicBool>,
}

impl Monitor {
    /// The limit that is reached when the run is cancelled.
    pub fn limit(&self) -> Limit {
        Limit {
            cancel: Some(self.cancel.clone()),
            ..Limit::default()
        }
    }

    /// Lets a limit be reached, too, when the run is cancelled.
    pub fn watch(&self, limit: &mut Limit) {
        limit.cancel = Some(self.cancel.clone());
    }

    /// Ends the run.
    pub fn cancel(&self) {
        self.cancel.store(true, Ordering::Relaxed);
    }

    pub fn cancelled(&self) -> bool {
        self.cancel.load(Ordering::Relaxed)
    }

    /// Reports the progress of the run, if there is a listener.
    pub fn report(&self, done: f64, total: Option<f64>, words: impl FnOnce() -> String) {
        if self.has_listener {
            *self.latest() = Some((done, total, words()));
        }
    }

    /// As [`Monitor::report`], for a computation without a limit: ends the run if it was
    /// cancelled.
    pub fn report_or_end(&self, done: f64, total: Option<f64>, words: impl FnOnce() -> String) {
        if self.cancelled() {
            // Nothing waits for the result, and resumed panics print no message.
            resume_unwind(Box::new("cancelled"));
        }
        self.report(done, total, words);
    }

    fn latest(&self) -> MutexGuard<'_, Option<Report>> {
        self.latest.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Passes the latest report on to `progress`.
    fn forward(&self, progress: Option<&Bound<PyAny>>) -> PyResult<()> {
        let latest = self.latest().take();
        if let (Some(progress), Some(report)) = (progress, latest) {
            progress.call1(report)?;
        }
        Ok(())
    }
}

/// The Ctrl-C that ended a run whose partial result is kept, if one did.
#[derive(Default)]
pub struct Interrupt(Option<PyErr>);

impl Interrupt {
    /// Whether there was one.
    pub fn happened(&self) -> bool {
        self.0.is_some()
    }

    /// A result, or `leafdyn.Interrupted` with it where Ctrl-C ended the run.
    pub fn hand_over<'py, R: IntoPyObject<'py>>(self, py: Python<'py>, result: R) -> PyResult<R> {
        match self.0 {
            None => Ok(result),
            Some(stop) => Err(interrupted(py, stop, result)),
        }
    }

    /// The value of a run, or why it has none: Ctrl-C, where that ended it.
    pub fn or_else<T, E>(
        &mut self,
        found: Result<T, E>,
        error: impl FnOnce(E) -> PyErr,
    ) -> PyResult<T> {
        found.map_err(|why| self.0.take().unwrap_or_else(|| error(why)))
    }
}

/// Whether an exception is a Ctrl-C, and not one of the listener to the progress.
pub fn is_interrupt(py: Python, stop: &PyErr) -> bool {
    stop.is_instance_of::<PyKeyboardInterrupt>(py)
}

/// `leafdyn.Interrupted`, with what was found until then.
pub fn interrupted<'py>(py: Python<'py>, stop: PyErr, partial: impl IntoPyObject<'py>) -> PyErr {
    let Ok(partial) = partial.into_bound_py_any(py) else {
        return stop;
    };
    let class = match INTERRUPTED.import(py, "leafdyn._errors", "Interrupted") {
        Ok(class) => class,
        Err(error) => return error,
    };
    match class.call1((partial,)) {
        Ok(exception) => PyErr::from_value(exception),
        Err(error) => error,
    }
}

static INTERRUPTED: PyOnceLock<Py<PyType>> = PyOnceLock::new();

/// The thread that loaded the package.
static FIRST: OnceLock<ThreadId> = OnceLock::new();

thread_local! {
    /// Whether this thread has a pool of its own.
    static OWN_POOL: OnceCell<bool> = const { OnceCell::new() };
}

/// Remembers the thread that loads the package, which usually is the one that receives Ctrl-C.
pub fn remember_first_thread() {
    let _ = FIRST.set(thread::current().id());
}

/// Whether this thread may compute: only the first one may. It then is a pool of its own, so that
/// computations here use no other threads, whose number others set and which a fork lacks.
fn may_compute() -> bool {
    if FIRST.get() != Some(&thread::current().id()) {
        return false;
    }
    let build = || {
        let own = ThreadPoolBuilder::new().num_threads(1).use_current_thread();
        // It lasts as long as the thread.
        own.build().map(mem::forget).is_ok()
    };
    OWN_POOL.with(|own| *own.get_or_init(build))
}

/// Does `work` on the pool, whose number of threads the program takes into account.
pub fn on_pool<T: Send>(py: Python, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    let pool = pool(None)?;
    Ok(py.detach(|| pool.install(work)))
}

/// Called by a run on this thread after each of its steps.
pub type Step<'a> = &'a mut dyn FnMut(&Monitor);

/// Does `work` on this thread, if it may: work that calls its `Step` often, several times in
/// [`POLL_INTERVAL`], and ends when its monitor is cancelled. Ctrl-C, and an exception of `progress`,
/// cancel it; what it has found is kept after Ctrl-C, which `interrupt` then has.
pub fn run_here<T: Send>(
    py: Python,
    progress: Option<&Bound<PyAny>>,
    interrupt: &mut Interrupt,
    work: impl FnOnce(&Monitor, Step) -> T + Send,
) -> PyResult<Option<T>> {
    if !may_compute() {
        return Ok(None);
    }
    let monitor = Monitor {
        has_listener: progress.is_some(),
        ..Monitor::default()
    };
    let listener = progress.map(|progress| progress.clone().unbind());
    let (found, stop) = py.detach(|| {
        let (mut polled, mut stop) = (Instant::now(), None);
        let mut step = |monitor: &Monitor| {
            if polled.elapsed() < POLL_INTERVAL || stop.is_some() {
                return;
            }
            let poll = Python::attach(|py| {
                py.check_signals()?;
                monitor.forward(listener.as_ref().map(|it| it.bind(py)))
            });
            if let Err(why) = poll {
                stop = Some(why);
                monitor.cancel();
            }
            polled = Instant::now();
        };
        let found = catch_unwind(AssertUnwindSafe(|| work(&monitor, &mut step)));
        (found.map_err(|panic| panicked(&*panic)), stop)
    });
    match (stop, found) {
        (Some(stop), Ok(found)) if is_interrupt(py, &stop) => {
            interrupt.0 = Some(stop);
            Ok(Some(found))
        }
        (Some(stop), _) => Err(stop),
        (None, found) => {
            monitor.forward(progress)?;
            found.map(Some)
        }
    }
}

/// Does `work` on the pool. Ctrl-C, and an exception of `progress`, cancel it.
pub fn run<T: Send + 'static>(
    py: Python,
    progress: Option<&Bound<PyAny>>,
    work: impl FnOnce(&Monitor) -> T + Send + 'static,
) -> PyResult<T> {
    match wait_for(py, progress, work)? {
        Waited::Ended(found) => Ok(found),
        // It ends soon by itself. Freeing its memory may take long and is not waited for.
        Waited::Stopped(stop, _) => Err(stop),
    }
}

/// Does `work` on the pool, which ends with what it has found when its monitor is cancelled. That is kept
/// after Ctrl-C, which `interrupt` then has, if it comes within [`PATIENCE`] and before another Ctrl-C.
pub fn run_keeping<T: Send + 'static>(
    py: Python,
    progress: Option<&Bound<PyAny>>,
    interrupt: &mut Interrupt,
    work: impl FnOnce(&Monitor) -> T + Send + 'static,
) -> PyResult<T> {
    let begun = Instant::now();
    let (stop, mut result) = match wait_for(py, progress, work)? {
        Waited::Ended(found) => return Ok(found),
        Waited::Stopped(stop, result) => (stop, result),
    };
    if !is_interrupt(py, &stop) {
        return Err(stop);
    }
    let (clock, patience) = (Instant::now(), PATIENCE.with(begun.elapsed()));
    while clock.elapsed() < patience {
        let received;
        (received, result) = py.detach(move || (result.recv_timeout(POLL_INTERVAL), result));
        match received {
            Ok(Ok(found)) => {
                interrupt.0 = Some(stop);
                return Ok(found);
            }
            Err(RecvTimeoutError::Timeout) => {}
            Ok(Err(_)) | Err(RecvTimeoutError::Disconnected) => break,
        }
        if py.check_signals().is_err() {
            break;
        }
    }
    Err(stop)
}

/// What a run sends: its result, or its panic.
type Sent<T> = Receiver<thread::Result<T>>;

/// A run that was waited for.
enum Waited<T> {
    Ended(T),
    /// Why it was cancelled, and where it still may send its result.
    Stopped(PyErr, Sent<T>),
}

/// Does `work` on the pool and waits until it ends or is cancelled.
fn wait_for<T: Send + 'static>(
    py: Python,
    progress: Option<&Bound<PyAny>>,
    work: impl FnOnce(&Monitor) -> T + Send + 'static,
) -> PyResult<Waited<T>> {
    let monitor = Arc::new(Monitor {
        has_listener: progress.is_some(),
        ..Monitor::default()
    });
    let (done, mut result) = sync_channel(1);
    let seen = monitor.clone();
    pool(None)?.spawn(move || {
        let found = catch_unwind(AssertUnwindSafe(|| work(&seen)));
        // After Ctrl-C nothing may wait for it.
        let _ = done.send(found);
    });
    loop {
        let received;
        (received, result) = py.detach(move || (result.recv_timeout(POLL_INTERVAL), result));
        match received {
            Ok(Ok(found)) => {
                monitor.forward(progress)?;
                return Ok(Waited::Ended(found));
            }
            Ok(Err(panic)) => return Err(panicked(&*panic)),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return Err(panicked(&"a thread ended")),
        }
        if let Err(stop) = py.check_signals().and_then(|()| monitor.forward(progress)) {
            monitor.cancel();
            return Ok(Waited::Stopped(stop, result));
        }
    }
}

/// A `RuntimeError`, for a panic.
fn panicked(panic: &(dyn Any + Send)) -> PyErr {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    let text = text.or_else(|| panic.downcast_ref::<&str>().copied());
    let text = text.unwrap_or("no message");
    PyRuntimeError::new_err(format!(
        "leafdyn panicked, which is a fault of its own: {text}"
    ))
}

/// Formats the time elapsed on a clock.
pub fn elapsed(clock: Instant) -> String {
    format!("{:.0} s", clock.elapsed().as_secs_f64())
}
