//! The solvers of leafdyn in a browser: a page writes a question into memory, and reads the answer.
//!
//! ```text
//! place(length)   where a question of so many bytes is to be written, as JSON
//! answer()        the length of the answer, as JSON, that then stands
//! result()        there
//! ```
//!
//! [`question`] has the questions, [`mod@answer`] the answers, and [`session`] how one follows from the other;
//! [`mod@place`] says where a leaf is.

pub mod answer;
pub mod motion;
pub mod place;
pub mod question;
pub mod session;

use session::Session;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// What the page has written, what it is to read, and the leaf that it shows.
#[derive(Default)]
struct Shared {
    question: Vec<u8>,
    answer: Vec<u8>,
    session: Session,
}

static SHARED: Mutex<Option<Shared>> = Mutex::new(None);

fn with<R>(of: impl FnOnce(&mut Shared) -> R) -> R {
    let mut shared: MutexGuard<Option<Shared>> =
        SHARED.lock().unwrap_or_else(PoisonError::into_inner);
    of(shared.get_or_insert_default())
}

/// The place of a question of so many bytes.
#[unsafe(no_mangle)]
pub extern "C" fn place(length: usize) -> *mut u8 {
    with(|shared| {
        shared.question.clear();
        shared.question.resize(length, 0);
        shared.question.as_mut_ptr()
    })
}

/// Answers the question that stands in its place; the length of the answer.
#[unsafe(no_mangle)]
pub extern "C" fn answer() -> usize {
    clock();
    with(|shared| {
        let question = std::mem::take(&mut shared.question);
        shared.answer = shared.session.answer(&question);
        shared.answer.len()
    })
}

/// The place of the answer.
#[unsafe(no_mangle)]
pub extern "C" fn result() -> *const u8 {
    with(|shared| shared.answer.as_ptr())
}

#[cfg(all(target_family = "wasm", target_os = "unknown"))]
fn clock() {
    #[link(wasm_import_module = "host")]
    unsafe extern "C" {
        /// Seconds since any moment.
        safe fn seconds() -> f64;
    }
    fn now() -> f64 {
        seconds()
    }
    leafdyn::run::set(now);
}

#[cfg(not(all(target_family = "wasm", target_os = "unknown")))]
fn clock() {}
