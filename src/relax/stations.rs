//! Interpolation of a leaf at rest to other stations.

use crate::leaf::Leaf;
use crate::relax::equilibrium::{Equilibrium, Outcome, Shape};
use crate::relax::nodes::continuous;
use crate::relax::place::{Differences, Place, Slopes};
use crate::scenario::{Profile, Rod, Scenario};
use crate::shape::{NodeState, RodShape, equally_spaced};
use glam::{DQuat, DVec3};

/// Smallest number of parts into which the stations of a result divide a vein.
const PARTS: usize = 16;

/// Advice if interpolated stations are less accurate than the tolerance.
const BETWEEN: &str = "the tolerance is kept where the leaf was solved for, but not at all of the \
    stations between: ask for a smaller tolerance, or for other stations";

impl Equilibrium {
    /// The same at stations that divide every vein into `parts` equal parts; `None`: at the
    /// nodes of the finest grid, with its segments halved until there are at least 17
    /// stations.
    ///
    /// Between the stations of the solution, positions, rotations and moments are Hermite
    /// polynomials with the slopes of the equations; never across a knot of a profile. The
    /// interpolation error is added to the error estimate; if that then exceeds the tolerance,
    /// the outcome becomes [`Outcome::ToleranceNotReached`], or without `parts` the stations
    /// stay as they are.
    #[must_use]
    pub fn at_stations(self, scenario: &Scenario, parts: Option<usize>) -> Self {
        let to = match parts {
            Some(parts) => equally_spaced(parts),
            None => finest(&self.shape),
        };
        if to == self.shape.stations {
            return self;
        }
        let mut there = self.clone().interpolated(scenario, to);
        if there.keeps_tolerance() || !self.keeps_tolerance() {
            return there;
        }
        if parts.is_none() {
            return self;
        }
        if there.outcome.is_success() {
            there.outcome = Outcome::ToleranceNotReached;
            there.remark = Some(BETWEEN.into());
        }
        there
    }

    /// Whether the tolerance, if it is kept at the stations of the solution, is kept at the ends
    /// of so many equal `parts`, too.
    pub(super) fn keeps_tolerance_at(&self, scenario: &Scenario, parts: usize) -> bool {
        let there = || self.clone().interpolated(scenario, equally_spaced(parts));
        !self.keeps_tolerance() || there().keeps_tolerance()
    }

    pub(super) fn keeps_tolerance(&self) -> bool {
        let allowed = self.accuracy.tolerance * self.shape.longest();
        (self.accuracy.error_estimate).is_none_or(|error| error <= allowed)
    }

    fn interpolated(mut self, scenario: &Scenario, to: Vec<f64>) -> Self {
        let at_rest = !matches!(
            self.outcome,
            Outcome::NotAtRest | Outcome::Singular | Outcome::Diverged
        );
        let places: Vec<_> = {
            let leaf = Leaf::new(scenario);
            let places = to
                .iter()
                .map(|&at| Place::new(&self.shape.stations, leaf.kinks(), at));
            places.collect()
        };
        let mut between = 0.0_f64;
        let rods = self.shape.rods.iter().enumerate().map(|(j, rod)| {
            let known = NodalFields::new(rod);
            let mut differences = Differences::default();
            let nodes = places.iter().map(|place| {
                if let Some(node) = place.node {
                    return rod.nodes[node];
                }
                if at_rest {
                    differences.add(place, |weights| {
                        sum(weights, &known.positions, &known.tangents)
                    });
                }
                known.at(place, at_rest, &scenario.rods[j])
            });
            let nodes = nodes.collect();
            between = between.max(differences.error());
            RodShape {
                length: rod.length,
                nodes,
            }
        });
        self.shape.rods = rods.collect();
        self.shape.stations = to;
        if let Some(error) = &mut self.accuracy.error_estimate {
            *error += between;
        }
        self
    }
}

/// Nodes of the finest grid, with all segments halved until there are enough.
fn finest(shape: &Shape) -> Vec<f64> {
    let mut stations = shape.curve_stations.clone();
    while (2..=PARTS).contains(&stations.len()) {
        let middles = stations
            .windows(2)
            .flat_map(|w| [0.5 * (w[0] + w[1]), w[1]]);
        stations = stations[..1].iter().copied().chain(middles).collect();
    }
    stations
}

/// The fields of a vein at its stations along the lab axes, with derivatives with respect to
/// the fraction of the length.
struct NodalFields {
    positions: Vec<DVec3>,
    tangents: Vec<DVec3>,
    rotations: Vec<[f64; 4]>,
    turns: Vec<[f64; 4]>,
    forces: Vec<DVec3>,
    moments: Vec<DVec3>,
    torques: Vec<DVec3>,
}

impl NodalFields {
    fn new(rod: &RodShape) -> Self {
        let each = |of: &dyn Fn(&NodeState) -> DVec3| rod.nodes.iter().map(of).collect::<Vec<_>>();
        let tangent = |node: &NodeState| node.rotation * node.v * rod.length;
        let rotations: Vec<DQuat> = rod.nodes.iter().map(|node| node.rotation).collect();
        let rotations = continuous(&rotations);
        let turn = |(q, node): (&DQuat, &NodeState)| {
            let u = node.u * (0.5 * rod.length);
            (*q * DQuat::from_xyzw(u.x, u.y, u.z, 0.0)).to_array()
        };
        NodalFields {
            positions: each(&|node| node.position),
            tangents: each(&tangent),
            turns: rotations.iter().zip(&rod.nodes).map(turn).collect(),
            rotations: rotations.iter().map(|q| q.to_array()).collect(),
            forces: each(&|node| node.rotation * node.n),
            moments: each(&|node| node.rotation * node.m),
            // m' = -r' x n.
            torques: each(&|node| (node.rotation * node.n).cross(tangent(node))),
        }
    }

    /// The state at a point, its strains by the constitutive law of the rod. Away from equilibrium
    /// the equations do not give the slopes.
    fn at(&self, place: &Place, at_rest: bool, rod: &Rod) -> NodeState {
        let lagrange: Slopes = (place.lagrange().into_iter())
            .map(|(i, weight)| (i, weight, 0.0))
            .collect();
        let hermite = match at_rest {
            true => &place.hermite(),
            false => &lagrange,
        };
        let mut q = [0.0; 4];
        for &(i, value, slope) in hermite {
            for (k, q) in q.iter_mut().enumerate() {
                *q += value * self.rotations[i][k] + slope * self.turns[i][k];
            }
        }
        let rotation = DQuat::from_array(q).normalize();
        let to_directors = rotation.conjugate();
        let n = to_directors * sum(&lagrange, &self.forces, &self.forces);
        let m = to_directors * sum(hermite, &self.moments, &self.torques);
        let triple = |of: &[Profile; 3]| DVec3::from_array(of.each_ref().map(|it| it.at(place.at)));
        NodeState {
            position: sum(hermite, &self.positions, &self.tangents),
            rotation,
            v: rod.rest_stretch.at(place.at) * DVec3::X + n / triple(&rod.force_stiffness),
            u: triple(&rod.rest_curvature) + m / triple(&rod.couple_stiffness),
            n,
            m,
        }
    }
}

fn sum(weights: &Slopes, values: &[DVec3], slopes: &[DVec3]) -> DVec3 {
    let terms = weights.iter();
    terms
        .map(|&(i, value, slope)| value * values[i] + slope * slopes[i])
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tapering vein with a knot, compared with an accurate solution at the same stations.
    #[test]
    fn stations_between_are_as_accurate_as_those_that_were_solved_for() {
        let scenario = Scenario::from_toml(
            r#"
            name = "taper"
            leaf = { rods = 3, length = [1.0, 1.1, 0.9], fan = "paper" }
            stiffness = { torsion = 0.5, bending_2 = { at = [0.0, 0.3, 1.0], value = [1.0, 1.0, 0.4] }, bending_3 = 1.0, axial = 100.0, shear_2 = 50.0, shear_3 = inf }
            rest = { bend_2 = 0.7, twist = -0.4, stretch = 1.05 }
            coupling = { y = 1.0, z = 2.0 }
            load = { gravity = [0.1, 0.2, -2.0] }
            "#,
        )
        .unwrap();
        let to = |tolerance| {
            let relaxation = scenario.relaxation().tolerance(tolerance);
            relaxation.every_node().run().unwrap()
        };
        let sharp = to(1e-10);
        for tolerance in [1e-3, 1e-6, 1e-8] {
            let found = to(tolerance);
            let there = found.clone().at_stations(&scenario, None);
            let finest = found.shape.curves[0].len();
            let count = there.shape.stations.len();
            assert!(count > PARTS && count >= finest);
            let within = there.accuracy.error_estimate.unwrap();
            assert!(within <= tolerance * found.shape.longest());
            let sharp = sharp.clone().at_stations(&scenario, Some(40));
            let there = found.at_stations(&scenario, Some(40));
            assert_eq!(there.shape.stations, equally_spaced(40));
            let error = there.accuracy.error_estimate.unwrap();
            for (one, other) in there.shape.rods.iter().zip(&sharp.shape.rods) {
                for (node, exact) in one.nodes.iter().zip(&other.nodes) {
                    let away = (node.position - exact.position).length();
                    assert!(away <= error, "{tolerance}: {away} > {error}");
                    assert!((node.m - exact.m).length() < 1e2 * error);
                    assert!((node.n - exact.n).length() < 1e3 * error);
                    assert!((node.u - exact.u).length() < 1e3 * error);
                }
            }
        }
    }

    #[test]
    fn stations_that_were_found_stay_as_they_are() {
        let scenario = Scenario::from_toml(include_str!("../../scenarios/paper/fig04.toml"));
        let scenario = scenario.unwrap();
        let found = scenario.relaxation().every_node().run().unwrap();
        let there = found.clone().at_stations(&scenario, None);
        for (i, station) in found.shape.stations.iter().enumerate() {
            let mut stations = there.shape.stations.iter();
            let k = stations.position(|s| s == station).unwrap();
            for (one, other) in found.shape.rods.iter().zip(&there.shape.rods) {
                assert_eq!(one.nodes[i], other.nodes[k]);
            }
        }
        let nodes = there.shape.curves[0].len();
        assert_eq!(there.shape.stations.len(), nodes.max(PARTS + 1));
    }
}
