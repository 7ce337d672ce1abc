//! The command line: verbs, parsing and exit status. All computations are in the library; a verb has a
//! file of its own.

mod chart;
mod check;
mod exit;
mod fit;
mod help;
mod map;
mod progress;
mod relax;
mod request;
mod simulate;
mod trace;
mod unbend;

use crate::verbs::exit::{
    ExitStatus, Refusal, note_json_output, print_note, print_refusal_json,
    refusal_with_option_names, report_refusal, stop_at_once_on_interrupt,
};
use clap::error::{ContextKind, ErrorKind};
use clap::{CommandFactory, Parser, Subcommand};
use std::env;
use std::ffi::OsString;
use std::process::ExitCode;

/// What the program says without a verb.
const HELP_WITHOUT_VERB: &str = "\
leafdyn finds how a leaf of coupled elastic veins comes to rest, with an error bar and a statement of stability.

  leafdyn new leaf           writes leaf.toml, a scenario to begin with; leafdyn new --help: what else there is
  leafdyn relax leaf.toml    brings it to rest: numbers here, files and a figure in out/leaf
  leafdyn help               all verbs; leafdyn help VERB: its options";

/// How a leaf of coupled elastic veins comes to rest, with an error bar and a statement of stability, and how it moves.
#[derive(Debug, Parser)]
#[command(name = "leafdyn", version, about, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    Relax(relax::RelaxArguments),
    Check(check::CheckArguments),
    Fit(fit::FitArguments),
    Chart(chart::ChartArguments),
    Map(map::MapArguments),
    Simulate(simulate::SimulateArguments),
    Trace(trace::TraceArguments),
    Unbend(unbend::UnbendArguments),
    New(help::NewArguments),
    Schema(help::SchemaArguments),
    Completions(help::CompletionsArguments),
    Man(help::ManArguments),
}

impl Cli {
    fn run(self) -> Result<ExitStatus, Refusal> {
        let done = match self.verb {
            Verb::Relax(relax) => relax.run(),
            Verb::Check(check) => check.run(),
            Verb::Fit(fit) => fit.run(),
            Verb::Chart(chart) => chart.run(),
            Verb::Map(map) => map.run(),
            Verb::Simulate(simulate) => simulate.run(),
            Verb::Trace(trace) => trace.run(),
            Verb::Unbend(unbend) => unbend.run(),
            Verb::New(new) => new.run(),
            Verb::Schema(schema) => schema.run(),
            Verb::Completions(completions) => completions.run(Cli::command()),
            Verb::Man(man) => man.run(Cli::command()),
        };
        done.map_err(refusal_with_option_names)
    }
}

/// Runs the program with the arguments of the process, and returns its exit status.
pub fn main() -> ExitCode {
    main_with(env::args_os().collect()).into()
}

/// Runs the program with these arguments, the first of which is its name.
pub fn main_with(arguments: Vec<OsString>) -> u8 {
    // Found before parsing, which may fail.
    let json = arguments.iter().any(|argument| argument == "--json");
    note_json_output(json);
    let command_line = match Cli::try_parse_from(arguments) {
        Ok(command_line) => command_line,
        Err(error) if error.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => {
            print_note(HELP_WITHOUT_VERB);
            return ExitStatus::Refused as u8;
        }
        Err(error) if error.use_stderr() => {
            let message = error.render().to_string();
            let message = NUMBER_PROBLEMS
                .iter()
                .fold(message, |message, (said, meant)| {
                    message.replace(said, meant)
                });
            let message = message + scenario_suggestion(&error);
            let message = message.trim_start_matches("error: ").trim_end();
            return report_refusal(message, json) as u8;
        }
        // Help, or the version.
        Err(help) => help.exit(),
    };
    let interrupted = stop_at_once_on_interrupt();
    let status = interrupted.and_then(|()| command_line.run());
    let status = status.unwrap_or_else(|refusal| match ExitStatus::from_refusal(&refusal) {
        ExitStatus::Interrupted => {
            print_note(&refusal.to_string());
            if json {
                print_refusal_json(&refusal.to_string(), ExitStatus::Interrupted.exit_code());
            }
            ExitStatus::Interrupted
        }
        _ => report_refusal(&refusal.to_string(), json),
    });
    status.exit_code() as u8
}

/// What the standard library says of texts that are no numbers, and what is meant.
const NUMBER_PROBLEMS: [(&str, &str); 4] = [
    (
        ": invalid digit found in string",
        ": must be a whole number",
    ),
    (
        ": cannot parse integer from empty string",
        ": must be a whole number",
    ),
    (": invalid float literal", ": must be a number"),
    (
        ": cannot parse float from empty string",
        ": must be a number",
    ),
];

/// How to get a scenario, if none is named.
fn scenario_suggestion(error: &clap::Error) -> &'static str {
    let missing = error.kind() == ErrorKind::MissingRequiredArgument;
    let which = error.get(ContextKind::InvalidArg);
    // The usage, which names it as well, is another part of the message.
    let scenario = which.is_some_and(|which| which.to_string().contains("<SCENARIO>"));
    match missing && scenario {
        false => "",
        true => {
            "\nA scenario says what the leaf is made of. To begin with one of your own:\n  \
             leafdyn new leaf        writes leaf.toml; leafdyn new --help: what else there is\n  \
             leafdyn relax leaf.toml"
        }
    }
}
