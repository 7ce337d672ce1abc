//! Limits of the time of a run, and its cancellation.

use crate::clock::Instant;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// When a run gives up, at rest or not: at a deadline, or when it is cancelled. It is
/// checked in every step, so that a run may end slightly later.
#[derive(Clone, Debug, Default)]
pub struct Limit {
    /// The run ends at this time.
    pub deadline: Option<Instant>,
    /// The run ends as soon as this is `true`.
    pub cancel: Option<Arc<AtomicBool>>,
}

impl Limit {
    /// A limit at a time.
    pub fn at(deadline: Instant) -> Self {
        Limit {
            deadline: Some(deadline),
            cancel: None,
        }
    }

    /// Whether the run is unlimited.
    pub(crate) fn is_none(&self) -> bool {
        self.deadline.is_none() && self.cancel.is_none()
    }

    /// Whether the run has to give up.
    pub(crate) fn reached(&self) -> bool {
        let cancelled = |cancel: &Arc<AtomicBool>| cancel.load(Ordering::Relaxed);
        self.deadline.is_some_and(|time| Instant::now() >= time)
            || self.cancel.as_ref().is_some_and(cancelled)
    }
}
