//! The program `leafdyn`.

use std::process::ExitCode;

/// A leaf needs many small arrays for a short time: with the system's allocator of Linux they
/// took a twelfth of a relaxation.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    leafdyn_program::verbs::main()
}
