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
            let rotations: Vec<DQuat> = rod.nodes.iter().map(|node| node.rotation).collect();
            let rotations = continuous(&rotations);
            let mut differences = Differences::default();
            let nodes = places.iter().map(|place| {
                if let Some(node) = place.node {
                    return rod.nodes[node];
                }
                if at_rest {
                    differences.add(place, |weights| position(weights, rod));
                }
                at(place, at_rest, (rod, &rotations), &scenario.rods[j])
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

/// The sum of values and slopes at the nodes of a vein with these weights.
fn sum(weights: &Slopes, vein: &RodShape, of: impl Fn(&NodeState) -> [DVec3; 2]) -> DVec3 {
    let term = |&(i, value, slope): &(usize, f64, f64)| {
        let [values, slopes] = of(&vein.nodes[i]);
        value * values + slope * slopes
    };
    weights.iter().map(term).sum()
}

/// The derivative of a node's position with respect to the fraction of the length.
fn tangent(vein: &RodShape, node: &NodeState) -> DVec3 {
    node.rotation * node.v * vein.length
}

fn position(weights: &Slopes, vein: &RodShape) -> DVec3 {
    sum(weights, vein, |node| [node.position, tangent(vein, node)])
}

/// The state of a vein at a place, its strains by the constitutive law of the rod; `rotations` are
/// those of its nodes, continuous in sign. Away from equilibrium the equations do not give the
/// slopes.
fn at(
    place: &Place,
    at_rest: bool,
    (vein, rotations): (&RodShape, &[DQuat]),
    rod: &Rod,
) -> NodeState {
    let lagrange = place.lagrange();
    let hermite = match at_rest {
        true => &place.hermite(0).0,
        false => &lagrange,
    };
    let mut q = [0.0; 4];
    for &(i, value, slope) in hermite {
        let u = vein.nodes[i].u * (0.5 * vein.length);
        let turn = (rotations[i] * DQuat::from_xyzw(u.x, u.y, u.z, 0.0)).to_array();
        for ((q, own), turn) in q.iter_mut().zip(rotations[i].to_array()).zip(turn) {
            *q += value * own + slope * turn;
        }
    }
    let rotation = DQuat::from_array(q).normalize();
    let to_directors = rotation.conjugate();
    let force = |node: &NodeState| node.rotation * node.n;
    let n = to_directors * sum(&lagrange, vein, |node| [force(node), DVec3::ZERO]);
    let m = to_directors
        * sum(hermite, vein, |node| {
            // m' = -r' x n.
            let slope = force(node).cross(tangent(vein, node));
            [node.rotation * node.m, slope]
        });
    let triple = |of: &[Profile; 3]| DVec3::from_array(of.each_ref().map(|it| it.at(place.at)));
    NodeState {
        position: position(hermite, vein),
        rotation,
        v: rod.rest_stretch.at(place.at) * DVec3::X + n / triple(&rod.force_stiffness),
        u: triple(&rod.rest_curvature) + m / triple(&rod.couple_stiffness),
        n,
        m,
    }
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
