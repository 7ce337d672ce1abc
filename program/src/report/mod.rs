//! Results as lines on the console, as rows of tables, and as JSON for scripts.

mod chart;
mod check;
mod document;
mod fit;
mod map;
pub(crate) mod numbers;
mod relax;
#[cfg(test)]
pub(crate) mod sample;
mod simulate;
mod sweep;
pub(crate) mod table;
mod trace;
mod unbend;

pub use crate::report::chart::{write_chart_table, write_scaling_table};
pub use crate::report::document::{
    FileError, RefusalDocument, ReportedResult, ResultDocument, branch_end_phrase,
    check_verdict_phrase, contender_name, equilibrium_kind, map_title, relaxation_verdict,
    shooting_method_name, stability_phrase, write_json,
};
pub use crate::report::fit::{write_fit_table, write_fitted_scenario};
pub use crate::report::map::{ReportedMap, write_map_table};
pub use crate::report::relax::doubt_with_option;
pub use crate::report::sweep::{ReportedSweep, row_status, write_sweep_table};
pub use crate::report::table::{
    write_angle_table, write_centerlines, write_modes_table, write_sensitivity_table,
};
pub use crate::report::trace::{
    error_location_words, index_change_text, is_codimension_two, passes_crossings,
    point_stability_phrase, slope_unit, write_boundary_table, write_trace_table,
};
pub use crate::report::unbend::{write_postures_table, write_rest_scenario, write_rest_table};
