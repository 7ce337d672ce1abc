//! `leafdyn new`: writes an example scenario.

use std::io::ErrorKind;
use std::path::PathBuf;

use clap::{Args, ValueEnum, ValueHint};

use super::{Refusal, Status, show_report};
use crate::files;

/// Write a scenario to begin with: short, with every entry explained.
///
/// Exit status: 0 written; 2 the file is there already, or cannot be written.
#[derive(Debug, Args)]
pub struct New {
    /// What it is about
    #[arg(value_enum, default_value_t = Example::Leaf)]
    example: Example,

    /// The file [default: the example's name and .toml]
    #[arg(value_hint = ValueHint::FilePath)]
    file: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Example {
    /// A leaf of nine veins under its own weight
    Leaf,
    /// A single rod, clamped, with a weight at its tip
    Rod,
    /// A leaf that is pulled at its tip, to be followed from slack to taut
    PullTest,
    /// A leaf that is let go, swings and comes to rest
    Motion,
}

impl Example {
    /// Its name, its text, and the next command.
    fn contents(self) -> (&'static str, &'static str, &'static str) {
        match self {
            Example::Leaf => ("leaf", include_str!("examples/leaf.toml"), "relax FILE"),
            Example::Rod => ("rod", include_str!("examples/rod.toml"), "relax FILE"),
            Example::PullTest => (
                "pull-test",
                include_str!("examples/pull-test.toml"),
                "trace FILE --vary load.tip_force[0]=1.5..5",
            ),
            Example::Motion => (
                "motion",
                include_str!("examples/motion.toml"),
                "simulate FILE",
            ),
        }
    }
}

impl New {
    pub fn run(self) -> Result<Status, Refusal> {
        let (name, text, next) = self.example.contents();
        let file = self.file.unwrap_or_else(|| format!("{name}.toml").into());
        let path = file.display();
        files::write_new(&file, text.as_bytes()).map_err(|reason| match reason.kind() {
            ErrorKind::AlreadyExists => format!("{path}: is there already: name another file"),
            _ => format!("{path}: cannot be written: {reason}"),
        })?;
        let next = next.replace("FILE", &path.to_string());
        show_report(&format!(
            "{path}: written; change it, then\n  leafdyn {next}\n"
        ))?;
        Ok(Status::Success)
    }
}
