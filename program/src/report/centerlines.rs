//! Tables of a leaf: `centerlines.csv`, `modes.csv` and `sensitivity.csv`, with every rod at
//! every station, for spreadsheets and scripts.

use std::io::{self, Write};

use glam::DVec3;

use super::table::{append_csv, csv_without_header, header};
use leafdyn::relax::{Equilibrium, NodeState, Sensitivity};
use leafdyn::scenario::Stress;
use leafdyn::shape::weights;

/// Nodes of the finest grid that a cubic interpolates.
const CUBIC: usize = 4;

/// Names of the columns. Rods are numbered from 1; strains and stress
/// resultants are components along the directors.
const HEADER: &str = "rod,sigma,s,x,y,z,qw,qx,qy,qz,v1,v2,v3,u1,u2,u3,n1,n2,n3,m1,m2,m3";

/// `centerlines.csv`: one row per rod and station; the largest stresses there come last, if
/// sections are given.
pub fn centerlines(equilibrium: &Equilibrium, out: &mut dyn Write) -> io::Result<()> {
    let shape = &equilibrium.shape;
    let stresses = equilibrium.stress.as_ref();
    let rows = shape.rods.iter().enumerate().flat_map(|(j, rod)| {
        let nodes = shape.stations.iter().zip(&rod.nodes).enumerate();
        nodes.map(move |(i, (sigma, node))| {
            let stress = stresses.map(|of| of.rods[j][i].to_array());
            (
                j + 1,
                *sigma,
                sigma * rod.length,
                columns(node),
                stress.as_slice().as_flattened().to_vec(),
            )
        })
    });
    let names: &[&str] = if stresses.is_some() {
        &Stress::NAMES
    } else {
        &[]
    };
    out.write_all(&header(&[&[HEADER], names].concat().join(",")))?;
    append_csv::<(usize, _, _, _, _)>(rows, out)
}

/// Names of the columns. Modes and rods are numbered from 1; displacements and
/// rotation vectors are along the lab axes.
const MODES_HEADER: &str = "mode,eigenvalue,error,frequency,rod,sigma,dx,dy,dz,rx,ry,rz";

/// `modes.csv`: one row per mode, rod and station.
pub fn modes_table(equilibrium: &Equilibrium, out: &mut dyn Write) -> io::Result<()> {
    out.write_all(&header(MODES_HEADER))?;
    let mut table = csv_without_header(out);
    let shape = &equilibrium.shape;
    let place = |&at: &f64| (at, weights(&shape.curve_stations, at, CUBIC));
    let places: Vec<_> = shape.stations.iter().map(place).collect();
    for (index, mode) in equilibrium.stability.modes.iter().flatten().enumerate() {
        let of_mode = (index + 1, mode.eigenvalue, mode.error, mode.frequency());
        let rods = mode.displacement.iter().zip(&mode.rotation);
        for (rod, (displacement, rotation)) in rods.enumerate() {
            for (sigma, (first, weights)) in &places {
                let at = |nodes: &[DVec3]| -> DVec3 {
                    let near = weights.iter().zip(&nodes[*first..]);
                    near.map(|(weight, node)| *weight * *node).sum()
                };
                let [d, r] = [at(displacement), at(rotation)];
                let shape = [d.x, d.y, d.z, r.x, r.y, r.z].map(|value| value + 0.0);
                table.serialize((of_mode, rod + 1, sigma, shape))?;
            }
        }
    }
    table.flush()
}

/// The columns from `x` onwards.
fn columns(node: &NodeState) -> [f64; 19] {
    let NodeState {
        position: r,
        rotation: q,
        v,
        u,
        n,
        m,
    } = node;
    [
        r.x, r.y, r.z, q.w, q.x, q.y, q.z, v.x, v.y, v.z, u.x, u.y, u.z, n.x, n.y, n.z, m.x, m.y,
        m.z,
    ]
    // Adding zero turns -0 into 0.
    .map(|value| value + 0.0)
}

/// The derivative of a station's position with respect to a number; rods are counted from 1.
const SENSITIVITY_HEADER: &str = "key,value,rod,sigma,d_x,d_y,d_z,error";

/// Cells of a row.
type Row<'s> = (&'s str, f64, usize, f64, [f64; 3], Option<f64>);

/// `sensitivity.csv`: a row for every number and station, or for the tips where only
/// they are known.
pub fn sensitivity_table(leaf: &Equilibrium, out: &mut dyn Write) -> io::Result<()> {
    let all = leaf.sensitivities.iter().flatten();
    out.write_all(&header(SENSITIVITY_HEADER))?;
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
