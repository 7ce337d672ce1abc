//! Where a leaf is, as text that an address can hold: enough to find its equilibrium again among
//! several.

use base64::prelude::{BASE64_URL_SAFE_NO_PAD, Engine};
use glam::{DQuat, DVec3};
use leafdyn::relax::{NodeState, RodShape, Shape};

/// Numbers of a node: its position, its directors, and its force along these.
const OF_NODE: usize = 10;

/// Writes where a leaf is: the number of veins, the stations, and the numbers of every node, vein after
/// vein. These are a first guess; stations say on which grid.
pub fn write(shape: &Shape) -> String {
    let nodes = shape.rods.iter().flat_map(|rod| &rod.nodes);
    let of_node = |node: &NodeState| {
        let (x, q, n) = (node.position, node.rotation, node.n);
        [x.x, x.y, x.z, q.x, q.y, q.z, q.w, n.x, n.y, n.z]
    };
    let numbers = nodes.flat_map(of_node);
    let mut bytes = (shape.rods.len() as u32).to_le_bytes().to_vec();
    bytes.extend(shape.stations.iter().flat_map(|at| at.to_le_bytes()));
    bytes.extend(numbers.flat_map(|x| (x as f32).to_le_bytes()));
    BASE64_URL_SAFE_NO_PAD.encode(bytes)
}

/// Stations and veins of what was written; `None` where that was something else.
pub fn read(text: &str) -> Option<(Vec<f64>, Vec<RodShape>)> {
    let bytes = BASE64_URL_SAFE_NO_PAD.decode(text).ok()?;
    let (count, rest) = bytes.split_first_chunk::<4>()?;
    let rods = u32::from_le_bytes(*count) as usize;
    let of_rod = rods.checked_mul(OF_NODE * size_of::<f32>())?;
    let of_station = of_rod.checked_add(size_of::<f64>())?;
    if rods == 0 || rest.is_empty() || !rest.len().is_multiple_of(of_station) {
        return None;
    }
    let count = rest.len() / of_station;
    let (stations, nodes) = rest.split_at(count * size_of::<f64>());
    let station = |of: &[u8]| Some(f64::from_le_bytes(of.try_into().ok()?));
    let stations = stations.chunks(size_of::<f64>()).map(station);
    let number = |of: &[u8]| Some(f64::from(f32::from_le_bytes(of.try_into().ok()?)));
    let numbers = nodes.chunks(size_of::<f32>()).map(number);
    let numbers = numbers.collect::<Option<Vec<f64>>>()?;
    let rods = numbers.chunks(OF_NODE * count).map(|rod| {
        let nodes = rod.chunks(OF_NODE).map(node);
        Some(RodShape {
            length: 1.0,
            nodes: nodes.collect::<Option<_>>()?,
        })
    });
    let (stations, rods) = (
        stations.collect::<Option<Vec<f64>>>()?,
        rods.collect::<Option<_>>()?,
    );
    stations
        .iter()
        .all(|at| at.is_finite())
        .then_some((stations, rods))
}

fn node(of: &[f64]) -> Option<NodeState> {
    let rotation = DQuat::from_xyzw(of[3], of[4], of[5], of[6]);
    let fits = of.iter().all(|x| x.is_finite()) && rotation.length() > 0.5;
    fits.then(|| NodeState {
        position: DVec3::new(of[0], of[1], of[2]),
        rotation: rotation.normalize(),
        v: DVec3::X,
        u: DVec3::ZERO,
        n: DVec3::new(of[7], of[8], of[9]),
        m: DVec3::ZERO,
    })
}
