//! `sensitivity.csv`: derivatives of the positions at all stations.

use std::io::{self, Write};

use serde::Serialize;

use crate::relax::{Equilibrium, Sensitivity};

use super::table::write_csv;

/// The derivative of a station's position with respect to a number.
#[derive(Serialize)]
struct Row<'s> {
    key: &'s str,
    value: f64,
    /// Counted from 1.
    rod: usize,
    sigma: f64,
    d_x: f64,
    d_y: f64,
    d_z: f64,
    error: Option<f64>,
}

/// `sensitivity.csv`: a row for every number and station, or for the tips where only
/// they are known.
pub fn table(leaf: &Equilibrium, out: &mut dyn Write) -> io::Result<()> {
    let all = leaf.sensitivities.iter().flatten();
    write_csv(all.flat_map(rows), out)
}

fn rows(of: &Sensitivity) -> Vec<Row<'_>> {
    let row = |(rod, sigma): (usize, f64), d: glam::DVec3, error| Row {
        key: &of.key,
        value: of.value,
        rod: rod + 1,
        sigma,
        d_x: d.x,
        d_y: d.y,
        d_z: d.z,
        error,
    };
    if of.positions.is_empty() {
        let tips = of.tips.iter().enumerate();
        return tips.map(|(j, d)| row((j, 1.0), *d, of.tip_error)).collect();
    }
    let rods = of.positions.iter().enumerate();
    rods.flat_map(|(j, rod)| {
        let nodes = of.stations.iter().zip(rod);
        nodes.map(move |(sigma, d)| row((j, *sigma), *d, of.positions_error))
    })
    .collect()
}
