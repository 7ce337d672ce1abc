//! `leafdyn new`, `schema`, `completions`, `man`: a scenario to begin with, and descriptions of
//! the program for editors, shells and readers.

use crate::files;
use crate::verbs::{Cli, ExitStatus, Refusal, show_report, write_standard_output};
use clap::{Args, CommandFactory, ValueEnum, ValueHint};
use clap_complete::Shell;
use leafdyn::scenario::schema;
use std::io::ErrorKind;
use std::path::PathBuf;

/// The heading in the help of options that few need.
pub const EXPERT_OPTIONS_HEADING: &str = "Options for experts";

/// Print the JSON schema of scenarios, by which editors complete and check them.
#[derive(Debug, Args)]
pub struct SchemaArguments {}

impl SchemaArguments {
    pub fn run(self) -> Result<ExitStatus, Refusal> {
        write_standard_output(format!("{:#}\n", schema()).as_bytes())?;
        Ok(ExitStatus::Success)
    }
}

/// Print what lets a shell complete verbs, options and files.
///
/// As in: leafdyn completions bash > ~/.local/share/bash-completion/completions/leafdyn
#[derive(Debug, Args)]
pub struct CompletionsArguments {
    /// The shell
    shell: Shell,
}

impl CompletionsArguments {
    pub fn run(self) -> Result<ExitStatus, Refusal> {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut Cli::command(), "leafdyn", &mut script);
        write_standard_output(&script)?;
        Ok(ExitStatus::Success)
    }
}

/// Print the manual page of the program, or of a verb.
///
/// As in: leafdyn man relax > leafdyn-relax.1
#[derive(Debug, Args)]
pub struct ManArguments {
    /// The verb; left out: the program
    verb: Option<String>,
}

impl ManArguments {
    pub fn run(self) -> Result<ExitStatus, Refusal> {
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
        write_standard_output(&text)?;
        Ok(ExitStatus::Success)
    }
}

/// Write a scenario to begin with: short, with every entry explained.
///
/// Exit status: 0 written; 2 the file is there already, or cannot be written.
#[derive(Debug, Args)]
pub struct NewArguments {
    /// What it is about
    #[arg(value_enum, default_value_t = ExampleScenario::Leaf)]
    example: ExampleScenario,

    /// The file [default: the example's name and .toml]
    #[arg(value_hint = ValueHint::FilePath)]
    file: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum ExampleScenario {
    /// A leaf of nine veins under its own weight
    Leaf,
    /// A blade from its outline and thickness, under its own weight
    Blade,
    /// A single rod, clamped, with a weight at its tip
    Rod,
    /// A leaf that is pulled at its tip, to be followed from slack to taut
    PullTest,
    /// A leaf that is let go, swings and comes to rest
    Motion,
}

impl ExampleScenario {
    /// Its name, its text, and the next command.
    fn contents(self) -> (&'static str, &'static str, &'static str) {
        match self {
            ExampleScenario::Leaf => ("leaf", include_str!("examples/leaf.toml"), "relax FILE"),
            ExampleScenario::Blade => ("blade", include_str!("examples/blade.toml"), "relax FILE"),
            ExampleScenario::Rod => ("rod", include_str!("examples/rod.toml"), "relax FILE"),
            ExampleScenario::PullTest => (
                "pull-test",
                include_str!("examples/pull-test.toml"),
                "trace FILE --vary load.tip_force[0]=1.5..5",
            ),
            ExampleScenario::Motion => (
                "motion",
                include_str!("examples/motion.toml"),
                "simulate FILE",
            ),
        }
    }
}

impl NewArguments {
    pub fn run(self) -> Result<ExitStatus, Refusal> {
        let (name, text, next) = self.example.contents();
        let file = self.file.unwrap_or_else(|| format!("{name}.toml").into());
        let path = file.display();
        files::write_new_file(&file, text.as_bytes()).map_err(|reason| match reason.kind() {
            ErrorKind::AlreadyExists => format!("{path}: is there already: name another file"),
            _ => format!("{path}: cannot be written: {reason}"),
        })?;
        let next = next.replace("FILE", &path.to_string());
        show_report(&format!(
            "{path}: written; change it, then\n  leafdyn {next}\n"
        ))?;
        Ok(ExitStatus::Success)
    }
}
