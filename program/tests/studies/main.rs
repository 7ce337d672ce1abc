//! The verbs that compare, follow and vary.

mod boundary_map;
mod chart_cli;
mod check_cli;
mod equilibria;
mod keys;
mod map_outcomes;
mod margin;
mod shape_tables;
mod simulate_choice;
mod simulate_cli;
mod simulate_doubts;
mod sweep_cli;
mod trace_cli;
mod unbend_cli;
