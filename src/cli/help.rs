//! `leafdyn schema`, `completions`, `man`: descriptions of the program for editors,
//! shells and readers.

use clap::{Args, CommandFactory};
use clap_complete::Shell;

use super::{Cli, Refusal, Status, show};
use crate::scenario::schema;

/// Print the JSON schema of scenarios, by which editors complete and check them.
#[derive(Debug, Args)]
pub struct Schema {}

impl Schema {
    pub fn run(self) -> Result<Status, Refusal> {
        show(format!("{:#}\n", schema()).as_bytes())?;
        Ok(Status::Success)
    }
}

/// Print what lets a shell complete verbs, options and files.
///
/// As in: leafdyn completions bash > ~/.local/share/bash-completion/completions/leafdyn
#[derive(Debug, Args)]
pub struct Completions {
    /// The shell
    shell: Shell,
}

impl Completions {
    pub fn run(self) -> Result<Status, Refusal> {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut Cli::command(), "leafdyn", &mut script);
        show(&script)?;
        Ok(Status::Success)
    }
}

/// Print the manual page of the program, or of a verb.
///
/// As in: leafdyn man relax > leafdyn-relax.1
#[derive(Debug, Args)]
pub struct Man {
    /// The verb; left out: the program
    verb: Option<String>,
}

impl Man {
    pub fn run(self) -> Result<Status, Refusal> {
        let mut program = Cli::command();
        program.build();
        let page = match self.verb.as_deref() {
            None => clap_mangen::Man::new(program),
            Some(verb) => {
                let found = program.find_subcommand(verb).cloned();
                let found =
                    found.ok_or_else(|| format!("there is no verb {verb:?}: see leafdyn help"))?;
                clap_mangen::Man::new(found)
            }
        };
        let mut text = Vec::new();
        page.render(&mut text)?;
        show(&text)?;
        Ok(Status::Success)
    }
}
