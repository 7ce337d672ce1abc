//! A leaf at rest at other stations.

use crate::largest::larger;
use crate::leaf::{DiscreteLeaf, Flow, Grid, Leaf};
use crate::relax::accuracy::dense_output::{Section, integrated_between, mean};
use crate::relax::result::equilibrium::{Equilibrium, Outcome, Shape};
use crate::relax::result::stress::Stresses;
use crate::relax::transfer::strains;
use crate::scenario::Scenario;
use crate::shape::{SAME_STATION, equally_spaced};

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
    /// Between the stations of the solution the equilibrium equations are integrated; a leaf that
    /// is not at rest is interpolated linearly. The error between stations in addition to that at
    /// them is added to the error estimate; if that then exceeds the tolerance, the outcome becomes
    /// [`Outcome::ToleranceNotReached`], or without `parts` the stations stay as they are.
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
    pub(in crate::relax) fn keeps_tolerance_at(&self, scenario: &Scenario, parts: usize) -> bool {
        let there = || self.clone().interpolated(scenario, equally_spaced(parts));
        !self.keeps_tolerance() || there().keeps_tolerance()
    }

    pub(in crate::relax) fn keeps_tolerance(&self) -> bool {
        let allowed = self.accuracy.tolerance * self.shape.longest();
        (self.accuracy.error_estimate).is_none_or(|error| error <= allowed)
    }

    /// The same at these stations.
    fn interpolated(mut self, scenario: &Scenario, to: Vec<f64>) -> Self {
        let at_rest = !matches!(
            self.outcome,
            Outcome::NotAtRest | Outcome::Singular | Outcome::Diverged
        );
        let leaf = Leaf::new(scenario);
        let discrete = DiscreteLeaf::new(&leaf, Grid::new(1, leaf.kinks()));
        let mut flow = Flow::new(&discrete);
        let (stations, known) = (&self.shape.stations, &self.shape.rods);
        let section = |i: usize| -> Section {
            let rods = known.iter();
            rods.map(|rod| strains::fields(&leaf, &rod.nodes[i]))
                .collect()
        };
        let mut between = 0.0_f64;
        let mut rods = vec![Vec::with_capacity(to.len()); known.len()];
        let mut rest = to.as_slice();
        for (i, &station) in stations.iter().enumerate() {
            if rest
                .first()
                .is_some_and(|at| (at - station).abs() < SAME_STATION)
            {
                for (rod, known) in rods.iter_mut().zip(known) {
                    rod.push(known.nodes[i]);
                }
                rest = &rest[1..];
            }
            let next = stations.get(i + 1).copied().unwrap_or(1.0);
            let (points, others) =
                rest.split_at(rest.partition_point(|at| *at < next - SAME_STATION));
            rest = others;
            if points.is_empty() {
                continue;
            }
            let [begin, end] = [i, i + 1].map(section);
            let ends = [(station, &begin), (next, &end)];
            let found = match at_rest {
                true => integrated_between(&mut flow, leaf.kinks(), ends, points),
                false => None,
            };
            let (sections, error) = found.unwrap_or_else(|| {
                let weight = |at: &f64| (at - station) / (next - station);
                let mean = |at: &f64| mean([&begin, &end], weight(at));
                let error = if at_rest { next - station } else { 0.0 };
                (points.iter().map(mean).collect(), error)
            });
            between = larger(between, error * leaf.scale.length);
            for (&at, section) in points.iter().zip(&sections) {
                for (j, fields) in section.iter().enumerate() {
                    rods[j].push(strains::node_of(&leaf, (j, at), fields));
                }
            }
        }
        for (rod, nodes) in self.shape.rods.iter_mut().zip(rods) {
            rod.nodes = nodes;
        }
        let error = self.stress.as_ref().and_then(|it| it.error);
        // Where stations in between are less accurate than the nodes, so are the forces there.
        let at_nodes = self.accuracy.error_estimate;
        let error = error.filter(|_| at_nodes.is_some_and(|at_nodes| between <= at_nodes));
        let stress = Stresses::of(scenario, &to, &self.shape.rods);
        self.stress = stress.map(|it| Stresses { error, ..it });
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
        let scenario = Scenario::from_toml(include_str!("../../../scenarios/paper/fig04.toml"));
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
