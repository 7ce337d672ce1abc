//! Refused options as data: what reads them writes them as its users do.

/// An option that cannot have the value it was given: `--step 0` of a program, `step=0` of a
/// function.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{option} = {value}: {reason}")]
pub struct RefusedOption {
    /// Its name, words with `_` between them.
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
