//! When a run gives up.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// When a run gives up, at rest or not: at a time, or as soon as somebody says so.
/// It is looked at in every step, so that a run may end a little later.
#[derive(Clone, Debug, Default)]
pub struct Limit {
    /// At this time.
    pub deadline: Option<Instant>,
    /// As soon as this is `true`.
    pub cancel: Option<Arc<AtomicBool>>,
}

impl Limit {
    /// At a time.
    pub fn at(deadline: Instant) -> Self {
        Limit {
            deadline: Some(deadline),
            cancel: None,
        }
    }

    /// Whether the run may go on for as long as it takes.
    pub(crate) fn is_none(&self) -> bool {
        self.deadline.is_none() && self.cancel.is_none()
    }

    /// Whether it is time to give up.
    pub(crate) fn reached(&self) -> bool {
        let cancelled = |cancel: &Arc<AtomicBool>| cancel.load(Ordering::Relaxed);
        self.deadline.is_some_and(|time| Instant::now() >= time)
            || self.cancel.as_ref().is_some_and(cancelled)
    }
}
