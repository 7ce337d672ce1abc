//! The boundary-value problem by shooting.

mod agrees;
mod error;
mod kinks;
mod singular;
mod soft;
mod tissue;
mod work;
