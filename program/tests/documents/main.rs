//! Documents, files and figures say what the program does.

mod documented_commands;
mod figure_trace;
mod first_minute;
mod fit_cli;
mod measured_by_others;
mod numbers_on_two_pages;
mod pictures;
mod refusals;
mod relax_cli;
mod scenario_files;
mod view_files;
mod written_files;
