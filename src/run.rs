//! What a run is given and may refuse: a limit of its time and its cancellation, refused options and
//! what methods do not model, as data that each interface words as its users do, and words for the
//! variants of an enum, such as a method or an outcome.
//!
//! The clock that measures the time of runs is that of the system; on `wasm32-unknown-unknown`, which has
//! none, it is the one that the host has set by `set`, without which no time passes.

#[cfg(all(target_family = "wasm", target_os = "unknown"))]
pub use crate::run::host::{Instant, set};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
#[cfg(not(all(target_family = "wasm", target_os = "unknown")))]
pub use std::time::Instant;

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
    pub fn with_deadline(deadline: Instant) -> Self {
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

/// An option that cannot have the value it was given.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{option} = {value}: {reason}")]
pub struct RefusedOption {
    /// Name of the option, words with `_` between them.
    pub option: &'static str,
    /// The value.
    pub value: String,
    /// What it must be, or what to change.
    pub reason: String,
}

impl RefusedOption {
    /// An option with this value, for this reason.
    pub fn new(option: &'static str, value: impl ToString, reason: impl Into<String>) -> Self {
        RefusedOption {
            option,
            value: value.to_string(),
            reason: reason.into(),
        }
    }
}

/// What a scenario has and a method or a question does not take into account: an answer to it would
/// be that of another scenario.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum UnmodelledFeature {
    /// Grips along veins.
    #[error(
        "[[grip]]: {what} does not take grips along veins into account, as relaxation and following do; leave them out, or hold the tip by [tip]"
    )]
    Grips {
        /// The method or the question.
        what: &'static str,
    },
    /// Wind.
    #[error(
        "[wind]: {what} does not take wind into account, as motions do, and relaxation in a steady one; leave it out"
    )]
    Wind {
        /// The method or the question.
        what: &'static str,
    },
    /// Loads that turn with the section, or moments along veins.
    #[error(
        "load.follower, load.couple, load.point.follows: {what} does not take loads that turn with the section, or moments along veins, into account, as relaxation and motions do; leave them out"
    )]
    Followers {
        /// The method or the question.
        what: &'static str,
    },
    /// Tissue that is rigid where shooting cannot keep it so.
    #[error("tissue.along, tissue.normal = inf: shooting does not solve {what}")]
    RigidTissue {
        /// What else the leaf has, with its key, and what may be changed.
        what: &'static str,
    },
    /// A leaf to which no continuation leads from the arcs that shooting starts from.
    #[error("{why}; use shooting-from-rest")]
    FromArcs {
        /// What the leaf has, and what leads it to rest instead.
        why: &'static str,
    },
}

/// A word that is not among those allowed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{found}: must be one of {}", allowed.join(", "))]
pub struct UnknownWord {
    /// The word.
    pub found: String,
    /// The allowed words.
    pub allowed: Vec<&'static str>,
}

/// Names of the release before, for one more release.
#[doc(hidden)]
#[macro_export]
macro_rules! renamed {
    ($($old:ident => $new:ident,)+) => {
        $(
            #[doc = concat!("Renamed to [`", stringify!($new), "`].")]
            #[deprecated(note = "renamed: its documentation has the new name")]
            pub type $old = $new;
        )+
    };
}

/// Declares an enum by the words for its variants, with `ALL` and `word()`, on which everything
/// else is based.
#[doc(hidden)]
#[macro_export]
macro_rules! words {
    ($(
        $(#[$about:meta])*
        pub enum $type:ident {
            $($(#[$of:meta])* $variant:ident = $word:literal,)*
        }
    )*) => {$(
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $type {
            $($(#[$of])* $variant,)*
        }

        impl $type {
            /// All variants.
            pub const ALL: [$type; [$($word),*].len()] = [$($type::$variant),*];

            /// The word for the variant in requests and in files.
            pub fn word(self) -> &'static str {
                match self {
                    $($type::$variant => $word),*
                }
            }
        }

        $crate::read_and_write!($type);
    )*};
}

/// Declares what may be said of a result: an enum whose variants have a sentence, which `thiserror`
/// makes of their data, and a code, a word for programs that stays when the sentence changes. A
/// variant that passes on what another type says has the code of that. As JSON it is the sentence.
macro_rules! remarks {
    ($(
        $(#[$about:meta])*
        pub enum $type:ident {
            $(
                $(#[$of:meta])*
                $variant:ident $(($($data:tt)*))? $({ $($fields:tt)* })?
                    = $($code:literal)? $(inner.$inner_code:ident())?,
            )*
        }
    )*) => {$(
        $(#[$about])*
        #[derive(Clone, Debug, PartialEq, thiserror::Error)]
        pub enum $type {
            $($(#[$of])* $variant $(($($data)*))? $({ $($fields)* })?,)*
        }

        impl $type {
            /// All of its own codes.
            #[cfg(test)]
            pub const CODES: &'static [&'static str] = &[$($($code,)?)*];

            /// The word for it, in kebab case, which stays when its sentence changes.
            pub fn code(&self) -> &'static str {
                match self {
                    $(
                        $(Self::$variant { .. } => $code,)?
                        $(Self::$variant(inner) => inner.$inner_code(),)?
                    )*
                }
            }
        }

        impl serde::Serialize for $type {
            fn serialize<S: serde::Serializer>(
                &self,
                serializer: S,
            ) -> std::result::Result<S::Ok, S::Error> {
                serializer.collect_str(self)
            }
        }
    )*};
}
pub(crate) use remarks;

/// Several remarks as one text, as JSON and the console have them; none without any.
pub(crate) fn join_remarks<R: ToString>(remarks: &[R]) -> Option<String> {
    let sentences: Vec<String> = remarks.iter().map(R::to_string).collect();
    (!sentences.is_empty()).then(|| sentences.join("; "))
}

/// Implements writing and parsing by word for types with `ALL` and `word()`.
#[doc(hidden)]
#[macro_export]
macro_rules! read_and_write {
    ($type:ty) => {
        impl std::fmt::Display for $type {
            fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
                f.write_str(self.word())
            }
        }

        impl std::str::FromStr for $type {
            type Err = $crate::run::UnknownWord;

            fn from_str(text: &str) -> std::result::Result<Self, Self::Err> {
                let found = Self::ALL.into_iter().find(|it| it.word() == text);
                found.ok_or_else(|| $crate::run::UnknownWord {
                    found: text.into(),
                    allowed: Self::ALL.map(|it| it.word()).to_vec(),
                })
            }
        }

        impl serde::Serialize for $type {
            fn serialize<S: serde::Serializer>(
                &self,
                serializer: S,
            ) -> std::result::Result<S::Ok, S::Error> {
                serializer.serialize_str(self.word())
            }
        }

        impl<'de> serde::Deserialize<'de> for $type {
            fn deserialize<D: serde::Deserializer<'de>>(
                deserializer: D,
            ) -> std::result::Result<Self, D::Error> {
                let word = <String as serde::Deserialize>::deserialize(deserializer)?;
                word.parse().map_err(serde::de::Error::custom)
            }
        }
    };
}

#[cfg(all(target_family = "wasm", target_os = "unknown"))]
mod host {
    use std::ops::{Add, Sub};
    use std::sync::OnceLock;
    use std::time::Duration;

    static CLOCK: OnceLock<fn() -> f64> = OnceLock::new();

    /// Sets the clock of this process, once: seconds since any moment.
    pub fn set(clock: fn() -> f64) {
        let _ = CLOCK.set(clock);
    }

    /// A moment of the host's clock, as `std::time::Instant`.
    #[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
    pub struct Instant(f64);

    impl Instant {
        /// This moment.
        pub fn now() -> Instant {
            Instant(CLOCK.get().map_or(0.0, |clock| clock()))
        }

        /// The time since this moment.
        pub fn elapsed(&self) -> Duration {
            Instant::now() - *self
        }
    }

    impl Add<Duration> for Instant {
        type Output = Instant;

        fn add(self, time: Duration) -> Instant {
            Instant(self.0 + time.as_secs_f64())
        }
    }

    impl Sub for Instant {
        type Output = Duration;

        fn sub(self, earlier: Instant) -> Duration {
            Duration::try_from_secs_f64(self.0 - earlier.0).unwrap_or_default()
        }
    }
}
