//! Output files: each complete or absent, never half written; and recordings, which grow during a run.

mod atomic;
mod peers;
mod recording;
mod result_files;
mod source;

pub use crate::files::atomic::{check_writable, remove_unfinished_files, write_new_file};
pub use crate::files::peers::read_peer_measurements;
pub use crate::files::recording::MotionRecording;
pub use crate::files::result_files::{
    FileFormat, FileKind, FileSelection, LIVE_PAGE_FILE, ResultFile, WrittenResult,
    result_file_contents, result_file_names, write_result_files, write_table,
};
pub use crate::files::source::{check_inputs, check_source, check_table, relative_source_path};
pub use crate::report::{FileError, ResultDocument};
