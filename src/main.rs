//! `leafdyn`: a scenario is read, becomes a leaf, comes to rest, and the
//! result is judged and shown.

use std::process::ExitCode;

/// A leaf needs many small arrays for a short time: with the system's allocator of Linux they
/// took a twelfth of a relaxation.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    leafdyn::cli::main()
}
