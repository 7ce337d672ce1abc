//! Stiffnesses from measurements.

mod budget;
mod coverage;
mod dialects;
mod dialects_written;
mod ends;
mod followers;
mod grips;
mod hanging;
mod lack_of_fit;
mod next;
mod numbers;
mod photograph;
mod refusals;
mod small_motions;
mod starts;
mod undetermined_family;
mod wind;
mod work;
