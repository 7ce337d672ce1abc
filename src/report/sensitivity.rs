//! `sensitivity.csv`: derivatives of the positions at all stations.

use std::io::{self, Write};

use glam::DVec3;

use crate::relax::{Equilibrium, Sensitivity};

use super::table::{append_csv, header};

/// The derivative of a station's position with respect to a number; rods are counted from 1.
const COLUMNS: [&str; 8] = ["key", "value", "rod", "sigma", "d_x", "d_y", "d_z", "error"];

/// Cells of a row.
type Row<'s> = (&'s str, f64, usize, f64, [f64; 3], Option<f64>);

/// `sensitivity.csv`: a row for every number and station, or for the tips where only
/// they are known.
pub fn table(leaf: &Equilibrium, out: &mut dyn Write) -> io::Result<()> {
    let all = leaf.sensitivities.iter().flatten();
    out.write_all(&header(&COLUMNS))?;
    append_csv(all.flat_map(rows), out)
}

fn rows(of: &Sensitivity) -> Vec<Row<'_>> {
    let row = |(rod, sigma): (usize, f64), d: &DVec3, error| -> Row {
        (&of.key, of.value, rod + 1, sigma, d.to_array(), error)
    };
    if of.positions.is_empty() {
        let tips = of.tips.iter().enumerate();
        return tips.map(|(j, d)| row((j, 1.0), d, of.tip_error)).collect();
    }
    let rods = of.positions.iter().enumerate();
    rods.flat_map(|(j, rod)| {
        let nodes = of.stations.iter().zip(rod);
        nodes.map(move |(sigma, d)| row((j, *sigma), d, of.positions_error))
    })
    .collect()
}
