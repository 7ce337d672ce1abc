//! Positions near given ones in which segments that hardly yield are not strained, such as those
//! of arcs with different chords that are joined at their tips. Where springs do not lead there, rigid
//! rods with a common tip are found as curves of two parameters in the plane of the fan, neither
//! stretched nor sheared, from the base to the tip.

use crate::leaf::{DiscreteLeaf, State, System};
use crate::newton::{DefiniteSolver, NewtonEquations, NewtonIteration, SolverCounts};
use crate::rotation;
use glam::{DMat2, DQuat, DVec2, DVec3};

/// How a leaf is made as stiff as it is while springs hold its nodes.
struct StiffeningSteps {
    /// Squared frequencies of the springs, tried in this order: with stiff ones nodes stay near; a
    /// straight vein that must buckle may need softer ones.
    spring_rates: [f64; 3],
    /// Compliance (L^2/A) at first, ratio of successive ones, and the last.
    first_compliance: f64,
    compliance_ratio: f64,
    last_compliance: f64,
    /// Newton iterations at each compliance.
    most_iterations: usize,
    /// Accuracy (radians, lengths) of intermediate states and of the last one.
    intermediate_accuracy: f64,
    final_accuracy: f64,
}

const STIFFENING: StiffeningSteps = StiffeningSteps {
    spring_rates: [1e3, 30.0, 1.0],
    first_compliance: 0.1,
    compliance_ratio: 0.3,
    last_compliance: 1e-9,
    most_iterations: 20,
    intermediate_accuracy: 1e-4,
    final_accuracy: 1e-13,
};

/// A state near this one in which segments are strained no more than gently: the leaf becomes as
/// stiff as it is in steps, without loads, while springs in proportion to the masses hold its
/// nodes. If that fails, since the side to which straight rods buckle is undetermined, the rods
/// become curves with a common tip. `None` if there are none.
pub fn project_constraints(leaf: &DiscreteLeaf, near: &State) -> Option<State> {
    let mut leaf = leaf.clone();
    leaf.load_factor = 0.0;
    let mut system = System::new(&leaf);
    let mut held = |&rate: &f64| spring_held_equilibrium(&leaf, &mut system, near, rate);
    let found = STIFFENING.spring_rates.iter().find_map(&mut held);
    let is_held = leaf.leaf.has_placed_supports();
    found.or_else(|| joined_rigid_curves(&leaf).filter(|_| !is_held))
}

/// The equilibrium with springs of this `rate`, if there is one.
fn spring_held_equilibrium(
    leaf: &DiscreteLeaf,
    system: &mut System,
    near: &State,
    rate: f64,
) -> Option<State> {
    let mut state = near.clone();
    let mut floor = STIFFENING.first_compliance;
    let last = leaf.least_compliance().max(STIFFENING.last_compliance);
    leaf.with_compliance_floor(floor).strain_forces(&mut state);
    let mut hold = |leaf: &DiscreteLeaf, accuracy: f64| {
        let newton = NewtonIteration {
            accuracy,
            iterations: STIFFENING.most_iterations,
            work: &mut SolverCounts::default(),
            progress: &mut |_, _| {},
        };
        let held = NewtonEquations::Proximal {
            solver: &mut DefiniteSolver::default(),
            at: near,
            rate,
            largest: f64::INFINITY,
        };
        newton.solve(leaf, &mut state, system, held).ok()
    };
    while floor > last {
        hold(
            &leaf.with_compliance_floor(floor),
            STIFFENING.intermediate_accuracy,
        )?;
        floor *= STIFFENING.compliance_ratio;
    }
    hold(leaf, STIFFENING.final_accuracy)?;
    Some(state)
}

/// The search for rigid curves with a common tip.
struct RigidCurveSearch {
    /// The tip is at the mean of the ends of the arcs, but not nearer and not farther than these parts
    /// of the length of the shortest rod.
    nearest_tip: f64,
    farthest_tip: f64,
    /// Factor by which the tip comes nearer, repeatedly, if a rod does not reach it.
    approach: f64,
    /// Initial values of the second parameter of a curve. The first is that of
    /// the arc minus a third of this, which keeps the direction of the chord. The side to which a
    /// straight rod buckles is arbitrary; these values choose one.
    initial_bends: [f64; 9],
    /// Iterations of the search for one curve, and their longest step (radians).
    most_iterations: usize,
    longest_step: f64,
    /// Gap at the tip that counts as closed, as a part of the length.
    closed_gap: f64,
    /// Largest turn of a segment, radians.
    largest_turn: f64,
}

const CURVES: RigidCurveSearch = RigidCurveSearch {
    nearest_tip: 0.2,
    farthest_tip: 0.97,
    approach: 0.96,
    initial_bends: [0.0, 2.0, -2.0, 4.0, -4.0, 7.0, -7.0, 10.0, -10.0],
    most_iterations: 30,
    longest_step: 0.7,
    closed_gap: 1e-14,
    largest_turn: 1.0,
};

/// The state of a joined leaf, if there is one; the rods carry no forces.
fn joined_rigid_curves(leaf: &DiscreteLeaf) -> Option<State> {
    let rods: Vec<PlanarCurve> = (0..leaf.rods())
        .map(|j| PlanarCurve::new(leaf, j))
        .collect();
    let towards: DVec2 = rods.iter().map(|rod| DVec2::from_angle(rod.angle)).sum();
    let towards = towards.try_normalize().unwrap_or(DVec2::X);
    let openings: Vec<f64> = rods
        .iter()
        .map(|rod| rod.base_angle_from(towards))
        .collect();
    let chords = rods.iter().zip(&openings).map(|(rod, turn)| {
        let [tip, _, _] = rod.end_with_derivatives([-2.0 * turn, 0.0]);
        tip.dot(towards)
    });
    let mean = chords.sum::<f64>() / rods.len() as f64;
    let shortest = rods
        .iter()
        .map(|rod| rod.length)
        .fold(f64::INFINITY, f64::min);
    let nearest = CURVES.nearest_tip * shortest;
    let first = mean.clamp(nearest, CURVES.farthest_tip * shortest);
    let distances = std::iter::successors(Some(first), |far| Some(CURVES.approach * far));
    let (tip, found) = distances
        .take_while(|distance| *distance >= nearest)
        .find_map(|distance| {
            let tip = distance * towards;
            let found = rods.iter().zip(&openings);
            let found = found.map(|(rod, turn)| rod.solve_for_tip(tip, -2.0 * turn));
            Some((tip, found.collect::<Option<Vec<_>>>()?))
        })?;
    let (mut x, mut q) = (Vec::new(), Vec::new());
    for (rod, parameters) in rods.iter().zip(found) {
        rod.append_nodes(parameters, &mut x, &mut q);
        *x.last_mut()? = tip.extend(0.0);
    }
    Some(State::new(leaf.segments(), x, q))
}

/// A rod whose direction has turned by a p + b p (1 - p) at the part p of its length.
struct PlanarCurve {
    angle: f64,
    length: f64,
    /// Ends of the segments as parts of the length.
    node_fractions: Vec<f64>,
    /// Segments in their own directions.
    segments: Vec<DVec3>,
}

/// Turn of a segment between its ends, radians, and its part of the length.
struct SegmentTurn {
    angle: f64,
    fraction: f64,
}

impl PlanarCurve {
    fn new(leaf: &DiscreteLeaf, j: usize) -> Self {
        let segments: Vec<DVec3> = (0..leaf.segments())
            .map(|i| {
                let section = leaf.section(j, i);
                section.ds * section.rest_strain
            })
            .collect();
        let length = segments.iter().map(|segment| segment.length()).sum();
        let mut parts = vec![0.0];
        for segment in &segments {
            parts.push(parts[parts.len() - 1] + segment.length() / length);
        }
        let base = leaf.leaf.base_pose(j).rotation * DVec3::X;
        PlanarCurve {
            angle: base.y.atan2(base.x),
            length,
            node_fractions: parts,
            segments,
        }
    }

    /// Angle from `towards` to its direction at the base, at most half a turn.
    fn base_angle_from(&self, towards: DVec2) -> f64 {
        towards.angle_to(DVec2::from_angle(self.angle))
    }

    /// Derivatives of a node's turn at `part` with respect to both parameters.
    fn turns(part: f64) -> [f64; 2] {
        [part, part * (1.0 - part)]
    }

    fn tangent_angle(&self, [a, b]: [f64; 2], part: f64) -> f64 {
        let [of_a, of_b] = PlanarCurve::turns(part);
        self.angle + a * of_a + b * of_b
    }

    /// The end of the rod, and its derivatives.
    fn end_with_derivatives(&self, parameters: [f64; 2]) -> [DVec2; 3] {
        let mut sums = [DVec2::ZERO; 3];
        for (ends, segment) in self.node_fractions.windows(2).zip(&self.segments) {
            let [from, to] = [ends[0], ends[1]].map(|part| self.tangent_angle(parameters, part));
            let [t0, t1] = [ends[0], ends[1]].map(PlanarCurve::turns);
            let placed = DVec2::from_angle(0.5 * (from + to)).rotate(segment.truncate());
            sums[0] += placed;
            for k in 0..2 {
                sums[1 + k] += 0.5 * (t0[k] + t1[k]) * placed.perp();
            }
        }
        sums
    }

    /// The parameters with which the rod ends at `tip`, with the least bending among those found,
    /// by Newton's method.
    fn solve_for_tip(&self, tip: DVec2, arc: f64) -> Option<[f64; 2]> {
        let searches = CURVES.initial_bends.iter().filter_map(|&bend| {
            let mut at = DVec2::new(arc - bend / 3.0, bend);
            for _ in 0..CURVES.most_iterations {
                let [end, of_a, of_b] = self.end_with_derivatives(at.to_array());
                let gap = tip - end;
                if gap.length() < CURVES.closed_gap * self.length {
                    return Some(at.to_array());
                }
                let step = DMat2::from_cols(of_a, of_b).inverse() * gap;
                if !step.is_finite() {
                    return None;
                }
                at += step.clamp_length_max(CURVES.longest_step);
            }
            let [end, ..] = self.end_with_derivatives(at.to_array());
            // To rounding.
            ((tip - end).length() < 10.0 * CURVES.closed_gap * self.length).then_some(at.to_array())
        });
        searches
            .map(|found| (self.bending(found), found))
            .filter(|(_, found)| self.largest_turn(*found) < CURVES.largest_turn)
            .min_by(|(a, _), (b, _)| a.total_cmp(b))
            .map(|(_, found)| found)
    }

    /// The turns of all segments.
    fn segment_turns(&self, parameters: [f64; 2]) -> impl Iterator<Item = SegmentTurn> {
        self.node_fractions.windows(2).map(move |ends| {
            let [from, to] = [ends[0], ends[1]].map(|part| self.tangent_angle(parameters, part));
            SegmentTurn {
                angle: to - from,
                fraction: ends[1] - ends[0],
            }
        })
    }

    /// Square of the curvature integrated over the length.
    fn bending(&self, parameters: [f64; 2]) -> f64 {
        let turns = self.segment_turns(parameters);
        turns
            .map(|turn| turn.angle * turn.angle / turn.fraction)
            .sum()
    }

    fn largest_turn(&self, parameters: [f64; 2]) -> f64 {
        let turns = self.segment_turns(parameters);
        turns.fold(0.0, |largest, turn| largest.max(turn.angle.abs()))
    }

    fn append_nodes(&self, parameters: [f64; 2], x: &mut Vec<DVec3>, q: &mut Vec<DQuat>) {
        let frame = |part| rotation::exp(self.tangent_angle(parameters, part) * DVec3::Z);
        let mut node = DVec3::ZERO;
        x.push(node);
        q.push(frame(0.0));
        for (ends, segment) in self.node_fractions.windows(2).zip(&self.segments) {
            let next = frame(ends[1]);
            node += rotation::midpoint(frame(ends[0]), next) * *segment;
            x.push(node);
            q.push(next);
        }
    }
}
