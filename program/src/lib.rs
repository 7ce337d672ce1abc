//! The program `leafdyn` over the library of the same name: its verbs, the text of its reports,
//! the files it writes, figures and pages. The Python package uses it, too.

#![warn(missing_docs)]
// In a browser there are no verbs, which use most of the rest.
#![cfg_attr(target_family = "wasm", allow(dead_code, unused_imports))]
mod figure;
pub mod files;
pub mod live;
pub mod page;
mod report;
#[cfg(not(target_family = "wasm"))]
pub mod verbs;
