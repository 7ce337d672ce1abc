//! Documents, files and figures say what the program does.

mod architecture;
mod documented_commands;
mod documented_keys;
mod figure_trace;
mod first_minute;
mod fit_figure;
mod fit_files;
mod help;
mod numbers_on_two_pages;
mod refusals;
mod relax_cli;
mod report_digits;
mod scenario_files;
mod several_leaves;
mod view_files;
mod written_files;
