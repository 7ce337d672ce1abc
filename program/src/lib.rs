//! The program `leafdyn` over the library of the same name: its verbs, the text of its reports,
//! the files it writes, figures and pages. The Python package uses it, too.

#![warn(missing_docs)]

mod figure;
pub mod files;
pub mod page;
mod report;
pub mod verbs;
