//! Computations outside the interpreter: on a pool of threads of their own, while the thread that
//! asked waits without the interpreter's lock and looks for Ctrl-C. To wake up another thread, and
//! then this one again, takes as long as a part of a small leaf: what is made of short steps is
//! done by the thread that asked, which looks for Ctrl-C between them.

use std::any::Any;
use std::cell::OnceCell;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::thread::{self, ThreadId};
use std::time::{Duration, Instant};
use std::{mem, process};

use leafdyn::relax::Limit;
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

/// Between two looks for signals and at how far a run has come.
const LOOK: Duration = Duration::from_millis(10);

/// Most threads that can be asked for.
const MOST_THREADS: usize = 1024;

/// The threads that compute. A process that was forked has none of its parent's and makes new ones.
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
    // Left out, the number is that of RAYON_NUM_THREADS, or of the processors.
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
        // Its threads are those of another process and cannot be told to end.
        mem::forget(old);
    }
    Ok(threads)
}

/// Compute on so many threads from now on.
#[pyfunction]
pub fn set_threads(count: usize) -> PyResult<()> {
    if !(1..=MOST_THREADS).contains(&count) {
        let message = format!("threads = {count}: allowed are 1 to {MOST_THREADS}");
        return Err(PyValueError::new_err(message));
    }
    pool(Some(count)).map(drop)
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

/// How far a run has come: how much is done, of how much if that is known, and in words.
type Said = (f64, Option<f64>, String);

/// What a run and the thread that waits for it have in common.
#[derive(Default)]
pub struct Monitor {
    heard: bool,
    said: Mutex<Option<Said>>,
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

    /// Ends the run.
    pub fn cancel(&self) {
        self.cancel.store(true, Ordering::Relaxed);
    }

    pub fn cancelled(&self) -> bool {
        self.cancel.load(Ordering::Relaxed)
    }

    /// Says how far the run has come, if anybody hears it.
    pub fn say(&self, done: f64, total: Option<f64>, words: impl FnOnce() -> String) {
        if self.heard {
            *self.said() = Some((done, total, words()));
        }
    }

    /// As [`Monitor::say`], for what has no limit: ends the run here if it was cancelled.
    pub fn say_or_end(&self, done: f64, total: Option<f64>, words: impl FnOnce() -> String) {
        if self.cancelled() {
            // Nobody waits for it. No message is printed of what is resumed.
            resume_unwind(Box::new("cancelled"));
        }
        self.say(done, total, words);
    }

    fn said(&self) -> MutexGuard<'_, Option<Said>> {
        self.said.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn tell(&self, progress: Option<&Bound<PyAny>>) -> PyResult<()> {
        let said = self.said().take();
        if let (Some(progress), Some(said)) = (progress, said) {
            progress.call1(said)?;
        }
        Ok(())
    }
}

static FIRST: OnceLock<ThreadId> = OnceLock::new();

thread_local! {
    static ALONE: OnceCell<bool> = const { OnceCell::new() };
}

/// Remembers the thread that is here when the interpreter loads the package: that which hears
/// Ctrl-C, as a rule.
pub fn remember_first_thread() {
    let _ = FIRST.set(thread::current().id());
}

/// Whether this thread may compute: the first may. It is then a pool of its own, so that what is
/// computed here wakes up no other threads, whose number others set and a fork has none of.
fn computes_here() -> bool {
    if FIRST.get() != Some(&thread::current().id()) {
        return false;
    }
    let build = || {
        let alone = ThreadPoolBuilder::new().num_threads(1).use_current_thread();
        // It lasts as long as the thread.
        alone.build().map(mem::forget).is_ok()
    };
    ALONE.with(|alone| *alone.get_or_init(build))
}

/// Does what is of the program alone, which counts threads: on the pool.
pub fn on_pool<T: Send>(py: Python, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    let pool = pool(None)?;
    Ok(py.detach(|| pool.install(work)))
}

/// What a run on this thread says at each of its steps.
pub type Step<'a> = &'a mut dyn FnMut(&Monitor);

/// Does `work` on this thread, if it may: work that calls its `Step` often, several times in
/// [`LOOK`], and ends when its monitor is cancelled. Ctrl-C, and an exception of `progress`,
/// cancel it.
pub fn run_here<T: Send>(
    py: Python,
    progress: Option<&Bound<PyAny>>,
    work: impl FnOnce(&Monitor, Step) -> T + Send,
) -> PyResult<Option<T>> {
    if !computes_here() {
        return Ok(None);
    }
    let monitor = Monitor {
        heard: progress.is_some(),
        ..Monitor::default()
    };
    let listener = progress.map(|progress| progress.clone().unbind());
    let (found, stop) = py.detach(|| {
        let (mut looked, mut stop) = (Instant::now(), None);
        let mut step = |monitor: &Monitor| {
            if looked.elapsed() < LOOK || stop.is_some() {
                return;
            }
            let look = Python::attach(|py| {
                py.check_signals()?;
                monitor.tell(listener.as_ref().map(|it| it.bind(py)))
            });
            if let Err(why) = look {
                stop = Some(why);
                monitor.cancel();
            }
            looked = Instant::now();
        };
        let found = catch_unwind(AssertUnwindSafe(|| work(&monitor, &mut step)));
        (found.map_err(|panic| panicked(&*panic)), stop)
    });
    match stop {
        Some(stop) => Err(stop),
        None => {
            monitor.tell(progress)?;
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
    let monitor = Arc::new(Monitor {
        heard: progress.is_some(),
        ..Monitor::default()
    });
    let (done, mut result) = sync_channel(1);
    let seen = monitor.clone();
    pool(None)?.spawn(move || {
        let found = catch_unwind(AssertUnwindSafe(|| work(&seen)));
        // After Ctrl-C nobody may wait for it.
        let _ = done.send(found);
    });
    loop {
        let received;
        (received, result) = py.detach(move || (result.recv_timeout(LOOK), result));
        match received {
            Ok(Ok(found)) => {
                monitor.tell(progress)?;
                return Ok(found);
            }
            Ok(Err(panic)) => return Err(panicked(&*panic)),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return Err(panicked(&"a thread ended")),
        }
        if let Err(stop) = py.check_signals().and_then(|()| monitor.tell(progress)) {
            // It ends soon by itself, and may have much to free: nobody waits for that.
            monitor.cancel();
            return Err(stop);
        }
    }
}

/// A fault of this program as an exception.
fn panicked(panic: &(dyn Any + Send)) -> PyErr {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    let text = text.or_else(|| panic.downcast_ref::<&str>().copied());
    let text = text.unwrap_or("no message");
    PyRuntimeError::new_err(format!(
        "leafdyn panicked, which is a fault of its own: {text}"
    ))
}

/// The time on the clock since something began, in words.
pub fn elapsed(clock: Instant) -> String {
    format!("{:.0} s", clock.elapsed().as_secs_f64())
}
