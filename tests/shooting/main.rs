//! The boundary-value problem by shooting.

mod agrees;
mod error;
mod followers;
mod kinks;
mod off_axis;
mod rigid_tissue;
mod singular;
mod soft;
mod tissue;
mod work;
