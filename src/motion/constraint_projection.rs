//! Positions near given ones in which segments that hardly yield are not strained, such as those
//! of arcs with different chords that are joined at their tips.
//!
//! Rigid rods with a common tip: curves of two parameters in the plane of the fan, neither
//! stretched nor sheared, from the base to the tip.

use crate::leaf::{DiscreteLeaf, State, System};
use crate::newton::{DefiniteSolver, NewtonEquations, NewtonIteration, SolverCounts};
use crate::rotation;
use glam::{DMat2, DQuat, DVec2, DVec3};

/// Squared frequencies of the springs that hold the nodes while their positions are made
/// consistent: stiff ones first; a straight vein that must buckle may need softer ones.
const HOLDING_SPRING_RATES: [f64; 3] = [1e3, 30.0, 1.0];

/// Compliances (L^2/A) through which the leaf is made as stiff as it is: the first, the ratio of
/// successive ones, and the last.
const FIRST_COMPLIANCE: f64 = 0.1;

const COMPLIANCE_RATIO: f64 = 0.3;

const LAST_COMPLIANCE: f64 = 1e-9;

/// Iterations at each of them, and their accuracy.
const MAX_PROJECTION_ITERATIONS: usize = 20;

const INTERMEDIATE_ACCURACY: f64 = 1e-4;

const FINAL_ACCURACY: f64 = 1e-13;

/// A state near this one in which segments are strained no more than gently: the leaf becomes as
/// stiff as it is in steps, without loads, while springs in proportion to the masses hold its
/// nodes. If that fails, since the side to which straight rods buckle is undetermined, the rods
/// become curves with a common tip. `None` if there are none.
pub fn project_constraints(leaf: &DiscreteLeaf, near: &State) -> Option<State> {
    let mut leaf = leaf.clone();
    leaf.load_factor = 0.0;
    let mut system = System::new(&leaf);
    let mut held = |&rate: &f64| spring_held_equilibrium(&leaf, &mut system, near, rate);
    let found = HOLDING_SPRING_RATES.iter().find_map(&mut held);
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
    let mut floor = FIRST_COMPLIANCE;
    let last = leaf.least_compliance().max(LAST_COMPLIANCE);
    leaf.with_compliance_floor(floor).strain_forces(&mut state);
    let mut hold = |leaf: &DiscreteLeaf, accuracy: f64| {
        let newton = NewtonIteration {
            accuracy,
            iterations: MAX_PROJECTION_ITERATIONS,
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
        hold(&leaf.with_compliance_floor(floor), INTERMEDIATE_ACCURACY)?;
        floor *= COMPLIANCE_RATIO;
    }
    hold(leaf, FINAL_ACCURACY)?;
    Some(state)
}

/// The tip is at the mean of the ends of the arcs, but within these parts of the
/// length of the shortest rod; nearer by this factor, repeatedly, if
/// a rod does not reach it.
const TIP_REACH_RANGE: [f64; 2] = [0.2, 0.97];

const TIP_APPROACH_FACTOR: f64 = 0.96;

/// Initial values of the second parameter in the search for a curve. The first is that of
/// the arc minus a third of this, which keeps the direction of the chord. The side to which a
/// straight rod buckles is arbitrary; these values choose one.
const INITIAL_BENDS: [f64; 9] = [0.0, 2.0, -2.0, 4.0, -4.0, 7.0, -7.0, 10.0, -10.0];

/// Iterations of a search, their longest step, and the gap that counts as closed.
const CURVE_ITERATIONS: usize = 30;

const MAX_CURVE_STEP: f64 = 0.7;

const TIP_GAP_TOLERANCE: f64 = 1e-14;

/// Largest turn of a segment.
const MAX_SEGMENT_TURN: f64 = 1.0;

/// The state of a joined leaf, if there is one; the rods carry no forces.
pub(super) fn joined_rigid_curves(leaf: &DiscreteLeaf) -> Option<State> {
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
    let nearest = TIP_REACH_RANGE[0] * shortest;
    let first = mean.clamp(nearest, TIP_REACH_RANGE[1] * shortest);
    let distances = std::iter::successors(Some(first), |far| Some(TIP_APPROACH_FACTOR * far));
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
        let searches = INITIAL_BENDS.iter().filter_map(|&bend| {
            let mut at = DVec2::new(arc - bend / 3.0, bend);
            for _ in 0..CURVE_ITERATIONS {
                let [end, of_a, of_b] = self.end_with_derivatives(at.to_array());
                let gap = tip - end;
                if gap.length() < TIP_GAP_TOLERANCE * self.length {
                    return Some(at.to_array());
                }
                let step = DMat2::from_cols(of_a, of_b).inverse() * gap;
                if !step.is_finite() {
                    return None;
                }
                at += step.clamp_length_max(MAX_CURVE_STEP);
            }
            let [end, ..] = self.end_with_derivatives(at.to_array());
            // To rounding.
            ((tip - end).length() < 10.0 * TIP_GAP_TOLERANCE * self.length).then_some(at.to_array())
        });
        searches
            .map(|found| (self.bending(found), found))
            .filter(|(_, found)| self.largest_turn(*found) < MAX_SEGMENT_TURN)
            .min_by(|(a, _), (b, _)| a.total_cmp(b))
            .map(|(_, found)| found)
    }

    fn segment_turns(&self, parameters: [f64; 2]) -> impl Iterator<Item = (f64, f64)> {
        self.node_fractions.windows(2).map(move |ends| {
            let [from, to] = [ends[0], ends[1]].map(|part| self.tangent_angle(parameters, part));
            (to - from, ends[1] - ends[0])
        })
    }

    /// Square of the curvature integrated over the length.
    fn bending(&self, parameters: [f64; 2]) -> f64 {
        let turns = self.segment_turns(parameters);
        turns.map(|(turn, part)| turn * turn / part).sum()
    }

    fn largest_turn(&self, parameters: [f64; 2]) -> f64 {
        let turns = self.segment_turns(parameters);
        turns.fold(0.0, |largest, (turn, _)| largest.max(turn.abs()))
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
