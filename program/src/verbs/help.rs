//! `leafdyn new`, `schema`, `completions`, `man`: a scenario to begin with, and descriptions of
//! the program for editors, shells and readers.

use crate::files;
use crate::verbs::exit::{ExitStatus, Refusal, show_report, write_standard_output};
use clap::{Args, Command, ValueEnum, ValueHint};
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
    pub fn run(self, mut program: Command) -> Result<ExitStatus, Refusal> {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut program, "leafdyn", &mut script);
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
    pub fn run(self, mut program: Command) -> Result<ExitStatus, Refusal> {
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
    fn file_stem(self) -> &'static str {
        match self {
            ExampleScenario::Leaf => "leaf",
            ExampleScenario::Blade => "blade",
            ExampleScenario::Rod => "rod",
            ExampleScenario::PullTest => "pull-test",
            ExampleScenario::Motion => "motion",
        }
    }

    fn toml_text(self) -> &'static str {
        match self {
            ExampleScenario::Leaf => include_str!("examples/leaf.toml"),
            ExampleScenario::Blade => include_str!("examples/blade.toml"),
            ExampleScenario::Rod => include_str!("examples/rod.toml"),
            ExampleScenario::PullTest => include_str!("examples/pull-test.toml"),
            ExampleScenario::Motion => include_str!("examples/motion.toml"),
        }
    }

    /// The verb and options with which to go on.
    fn next_command(self) -> &'static str {
        match self {
            ExampleScenario::Leaf | ExampleScenario::Blade | ExampleScenario::Rod => "relax FILE",
            ExampleScenario::PullTest => "trace FILE --vary load.tip_force[0]=1.5..5",
            ExampleScenario::Motion => "simulate FILE",
        }
    }
}

impl NewArguments {
    pub fn run(self) -> Result<ExitStatus, Refusal> {
        let example = self.example;
        let name = format!("{}.toml", example.file_stem());
        let file = self.file.unwrap_or_else(|| name.into());
        let path = file.display();
        files::write_new_file(&file, example.toml_text().as_bytes()).map_err(
            |reason| match reason.kind() {
                ErrorKind::AlreadyExists => format!("{path}: is there already: name another file"),
                _ => format!("{path}: cannot be written: {reason}"),
            },
        )?;
        let next = example.next_command().replace("FILE", &path.to_string());
        show_report(&format!(
            "{path}: written; change it, then\n  leafdyn {next}\n"
        ))?;
        Ok(ExitStatus::Success)
    }
}
