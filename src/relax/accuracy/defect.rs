//! Defect correction: the error of a leaf on one grid, or extrapolated over several, estimated
//! from its defect, and subtracted.
//!
//! The equilibrium equations are integrated from the nodes of the coarsest grid, where an
//! extrapolated leaf is most accurate (of a single grid: from every second node), to the
//! midpoints between them, by a method of order 8. The jumps of position, rotation, force and
//! moment there are the defect; to first order the error is the response of the leaf to these
//! jumps. The linear equations are those of a coarse grid: the relative error of the response
//! is of second order.
//!
//! The response may be subtracted and the remaining error estimated again: iterated defect
//! correction (Stetter, Numer. Math. 29 (1978) 425). The leaf then converges, on the nodes
//! from which it is integrated, to the solution of the equations themselves, in each round by
//! the relative error of the linear equations: about a hundredth on 8 segments.

use crate::leaf::{
    DefiniteFactors, DiscreteLeaf, EquationWorkspace, FieldChange, Grid, LinearSolveOutcome,
    NodalField, RodFields, RodIntegrator, SegmentTangent, State, StationFields, System,
    displacement_part, rotation_part,
};
use crate::newton::SolverCounts;
use crate::numbers::larger;
use crate::relax::accuracy::fields::extrapolated_node_fields;
use crate::relax::accuracy::transfer::GridLevel;
use crate::rotation;
use glam::DVec3;

/// When and how far a leaf is corrected by its defect.
struct DefectCorrection {
    /// The linear equations are those of the grid so many levels below the finest, but not of the
    /// coarsest. One less makes them four times as accurate, and twice as expensive.
    levels_below_finest: usize,
    /// The part of the error assumed to remain after a correction before it has been measured: on a
    /// grid of n segments this number over n^2.
    contraction_by_segments: f64,
    /// The least part of the error assumed to remain.
    least_contraction: f64,
    /// The largest measured part with which corrections continue.
    largest_contraction: f64,
    /// Growth, as an exponent, of perturbations from a node to a midpoint by tissue from which on the
    /// jumps there tell nothing of the errors at the nodes.
    largest_growth: f64,
    /// Errors of rotations allowed in a corrected leaf, in multiples of that of the positions
    /// (dimensionless): as they are in an extrapolated one.
    rotation_errors: f64,
    /// Errors of forces and moments allowed in a corrected leaf, in the same multiples.
    force_errors: f64,
    /// Relative accuracy, in the energy norm, of the response to the defect: in a stiff leaf most of
    /// that norm is stretch, and displacements are a small part of it.
    response_accuracy: f64,
}

const CORRECTION: DefectCorrection = DefectCorrection {
    levels_below_finest: 2,
    contraction_by_segments: 0.64,
    least_contraction: 0.01,
    largest_contraction: 0.2,
    largest_growth: 2.0,
    rotation_errors: 10.0,
    force_errors: 50.0,
    response_accuracy: 1e-6,
};

/// The factorized equations of one of the grids of a leaf.
pub struct FactorizedLevel {
    level_number: usize,
    pub system: System,
    factors: DefiniteFactors,
}

impl FactorizedLevel {
    /// The equations of one of the `levels`, assembled anew at rest: those of the last Newton step
    /// have the forces before it, which differ where rods are rigid.
    fn new(
        levels: &[GridLevel],
        level_number: usize,
        workspace: &mut EquationWorkspace,
        work: &mut SolverCounts,
    ) -> Option<Self> {
        let GridLevel { leaf, state } = &levels[level_number];
        let mut system = workspace.equations(leaf);
        work.force_evaluations += 1;
        work.factorizations += 1;
        leaf.assemble(state, &mut system);
        leaf.add_phase_conditions(state, &mut system);
        let factors = match leaf.rods() {
            1 => DefiniteFactors::indefinite_single_rod(&mut system)?,
            _ => DefiniteFactors::new(&mut system, 0.0)?,
        };
        Some(FactorizedLevel {
            level_number,
            system,
            factors,
        })
    }

    /// The number of the grid of these equations, from the coarsest.
    pub fn grid(&self) -> usize {
        self.level_number
    }
}

/// The largest errors of positions, in lengths of the leaf.
#[derive(Clone, Copy)]
pub struct PositionErrors {
    /// The largest error at the nodes from which the leaf was integrated.
    pub at_nodes: f64,
    /// The largest error on either side of the midpoints between these nodes.
    pub between: f64,
}

impl PositionErrors {
    pub fn largest(self) -> f64 {
        larger(self.at_nodes, self.between)
    }

    /// Both errors plus that of the integration.
    fn increased(self, error: f64) -> Self {
        PositionErrors {
            at_nodes: self.at_nodes + error,
            between: self.between + error,
        }
    }
}

/// A leaf on one grid or several, with its error estimated from the equilibrium equations.
pub struct DefectEstimate {
    pub position_errors: PositionErrors,
    /// The leaf at the nodes of `grid`, rod after rod, dimensionless.
    pub rods: Vec<Vec<RodFields>>,
    /// Potential energy of the leaf, in units of A/L.
    pub energy: f64,
    /// The error of the energy: see [`energy_error`].
    pub energy_error: f64,
    /// The errors of the fields along the lab axes, at the nodes from which the leaf was
    /// integrated and at the midpoints between them, rod after rod.
    pub errors: Vec<Vec<FieldChange>>,
    /// The finest grid or, for a corrected leaf, one with as many segments as its accuracy needs.
    pub grid: Grid,
    /// How often the leaf was corrected by its estimated error.
    pub corrections: usize,
}

/// What corrections are to reach, and how many may be made.
#[derive(Clone, Copy)]
pub struct CorrectionGoal {
    /// The estimated error of positions that is small enough, in lengths of the leaf.
    pub error: f64,
    pub most_corrections: usize,
}

/// Estimates the error of the leaf on `levels`, from coarse to fine, each with twice the
/// segments of the one before, with `columns` extrapolations. If the error is more than that of the
/// `goal` the leaf is corrected, provided that this reduces it below.
/// `None` where grips hold veins, whose forces jump there, where a foundation does, where the linear equations cannot be
/// solved, where tissue is so stiff that integration along the veins is unstable, or where the
/// segments of a single level are not pairs of equal ones. The equations are factorized, in the
/// memory of the `workspace`, unless `linear` has them already.
pub fn estimate(
    levels: &[GridLevel],
    columns: usize,
    goal: CorrectionGoal,
    linear: &mut Option<FactorizedLevel>,
    workspace: &mut EquationWorkspace,
    work: &mut SolverCounts,
) -> Option<DefectEstimate> {
    let (enough, most) = (goal.error, goal.most_corrections);
    let (first, last) = (&levels.first()?.leaf, levels.len() - 1);
    // The linear equations need two segments between nodes.
    let (parts, grid) = match last {
        0 => (first.grid.coarsened()?, 0),
        _ => (
            first.grid.clone(),
            last.saturating_sub(CORRECTION.levels_below_finest).max(1),
        ),
    };
    let widths = (0..parts.segments()).map(|i| parts.segment_width(i));
    let unstable =
        first.tissue_growth_exponent(0.5 * widths.fold(0.0, larger)) > CORRECTION.largest_growth;
    if unstable || first.has_grips() || first.leaf.has_foundation() {
        return None;
    }
    if linear
        .as_ref()
        .is_none_or(|linear| linear.level_number != grid)
    {
        *linear = Some(FactorizedLevel::new(levels, grid, workspace, work)?);
    }
    let (level, linear) = (&levels[grid], linear.as_mut()?);
    let (finest, count) = (&levels[last].leaf.grid, parts.segments());
    let (mut known, mut flow) = (
        extrapolated_node_fields(levels, columns, count),
        RodIntegrator::new(first),
    );
    let mut tangents = Tangents::new(level, count);
    let n = level.leaf.segments() as f64;
    let assumed = (CORRECTION.contraction_by_segments / (n * n)).max(CORRECTION.least_contraction);
    let mut uncorrected = None;
    let mut before = 0.0;
    let mut steps = IntegrationSteps::new(finest.segments() / count / 2, last == 0);
    for corrections in 0..=most {
        satisfy_tip_conditions(first, &mut known);
        let integrated = integrate_to_midpoints(first, &parts, &mut flow, &known, steps.count);
        let Some(response) = tangents.response(linear, &integrated.jumps) else {
            break;
        };
        let largest = response.position_errors.largest();
        steps.measure(largest);
        // With halved steps the error includes that of the longer ones: its ratio is no measure
        // of the contraction.
        let contraction = match corrections == 0 || steps.halved {
            true => assumed,
            false => largest / before,
        };
        if !largest.is_finite() || contraction > CORRECTION.largest_contraction {
            break;
        }
        let rounds_left = i32::try_from(most - corrections).unwrap_or(0);
        let out_of_reach = largest * contraction.powi(rounds_left) > enough;
        if corrections > 0 && out_of_reach {
            break;
        }
        let changes = tangents.changes(&response, &integrated.jumps);
        if corrections == 0 {
            let errors = response.position_errors;
            let estimate = integrated.estimate(first, finest, &known, &changes, errors);
            if largest <= enough || out_of_reach {
                return Some(estimate);
            }
            uncorrected = Some(estimate);
        } else if largest + steps.error <= enough {
            let [turn, stress] = largest_rotation_and_stress(&changes);
            if larger(
                turn / CORRECTION.rotation_errors,
                stress / CORRECTION.force_errors,
            ) <= enough
            {
                let errors = response.position_errors.increased(steps.error);
                let mut forces = known
                    .iter()
                    .flatten()
                    .map(|it| it.n.length() + it.m.length());
                let largest = forces.by_ref().fold(0.0, larger);
                return Some(DefectEstimate {
                    corrections,
                    energy_error: energy_error(first, &changes, &integrated.jumps)
                        + steps.error * largest,
                    ..integrated.estimate(first, finest, &known, &changes, errors)
                });
            }
        }
        apply_changes(&changes, &mut known);
        before = largest;
        steps.choose(largest * contraction, enough);
    }
    uncorrected
}

/// A leaf integrated from the ends of the parts of its rods to the midpoints between them.
struct MidpointIntegration {
    /// After every step from the two ends of a part to its midpoint, part after part.
    slices: Vec<[Vec<StationFields>; 2]>,
    jumps: Vec<Vec<FieldChange>>,
    energy: f64,
}

/// The leaf `known` at the nodes of `parts`, integrated from there to the midpoints between
/// them in `steps` steps, and the jumps there.
fn integrate_to_midpoints(
    leaf: &DiscreteLeaf,
    parts: &Grid,
    flow: &mut RodIntegrator,
    known: &[Vec<RodFields>],
    steps: usize,
) -> MidpointIntegration {
    let n = parts.segments();
    let mut slices = vec![[(); 2].map(|()| vec![StationFields::default(); steps]); n];
    let mut jumps = vec![Vec::with_capacity(n); leaf.rods()];
    let mut energy = 0.0;
    for (i, ends) in slices.iter_mut().enumerate() {
        let [before, behind] = &mut *ends;
        for (k, after, sign) in [(i, before, 1.0), (i + 1, behind, -1.0)] {
            flow.integrate(
                |j| known[j][k],
                [parts.sigma()[k], parts.segment_midpoint(i)],
                after,
            );
            energy += sign * flow.energy();
        }
        for (j, jumps) in jumps.iter_mut().enumerate() {
            let [a, b] = at_midpoint(ends, j);
            let jump = jump(&a, &b);
            // Minus the work of closing the jump: the energy error is then of second order.
            energy -= a.n.dot(jump.position) + a.m.dot(jump.rotation);
            jumps.push(jump);
        }
    }
    for (j, known) in known.iter().enumerate() {
        energy -= known.last().map_or(0.0, |tip| leaf.tip_force(j).dot(tip.x));
        energy += known
            .first()
            .map_or(0.0, |base| leaf.leaf.base_spring_energy(j, base.q));
        let nodes = parts.sigma()[..n].iter().zip(known);
        let work = nodes.map(|(&sigma, node)| leaf.point_force_at(j, sigma).dot(node.x));
        energy -= work.sum::<f64>();
        if leaf.has_levers() {
            let nodes = parts.sigma().iter().zip(known);
            let levers = nodes.map(|(&sigma, node)| leaf.lever_energy_at(j, sigma, node.q));
            energy += levers.sum::<f64>();
        }
    }
    MidpointIntegration {
        slices,
        jumps,
        energy,
    }
}

/// Rod `j` at the midpoint of a part, integrated from either end.
fn at_midpoint(ends: &[Vec<StationFields>; 2], j: usize) -> [RodFields; 2] {
    ends.each_ref()
        .map(|slices| slices.last().expect("a step at least").rod(j))
}

impl MidpointIntegration {
    /// An uncorrected leaf with these errors, on the `finest` grid or on the refined one that has the
    /// ends of all steps.
    fn estimate(
        &self,
        leaf: &DiscreteLeaf,
        finest: &Grid,
        known: &[Vec<RodFields>],
        changes: &[Vec<FieldChange>],
        position_errors: PositionErrors,
    ) -> DefectEstimate {
        let rods = self.rods(known);
        let mut grid = finest.clone();
        while grid.segments() + 1 < rods[0].len() {
            grid = grid.refined();
        }
        DefectEstimate {
            position_errors,
            rods,
            energy: self.energy,
            energy_error: energy_error(leaf, changes, &self.jumps),
            errors: with_midpoints(changes, &self.jumps),
            grid,
            corrections: 0,
        }
    }

    /// All rods at the ends of all steps from `known`; at midpoints the mean of the two sides.
    fn rods(&self, known: &[Vec<RodFields>]) -> Vec<Vec<RodFields>> {
        let rod = |(j, known): (usize, &Vec<RodFields>)| {
            let steps = self.slices.first().map_or(0, |[before, _]| before.len());
            let mut rod = Vec::with_capacity(2 * steps * self.slices.len() + 1);
            for (begin, ends) in known.iter().zip(&self.slices) {
                let [before, behind] = ends.each_ref().map(|it| &it[..steps - 1]);
                let [a, b] = at_midpoint(ends, j);
                rod.push(*begin);
                rod.extend(before.iter().map(|slice| slice.rod(j)));
                rod.push(mean(&a, &b));
                rod.extend(behind.iter().rev().map(|slice| slice.rod(j)));
            }
            rod.extend(known.last());
            rod
        };
        known.iter().enumerate().map(rod).collect()
    }
}

/// Changes at the nodes, and at the midpoints between them on the side where they are larger: half
/// of the jump is added to their mean.
fn with_midpoints(
    changes: &[Vec<FieldChange>],
    jumps: &[Vec<FieldChange>],
) -> Vec<Vec<FieldChange>> {
    let rod = |(nodes, jumps): (&Vec<FieldChange>, &Vec<FieldChange>)| {
        let mut all = Vec::with_capacity(nodes.len() + jumps.len());
        for (pair, jump) in nodes.windows(2).zip(jumps) {
            all.push(pair[0]);
            let larger_side = |field: fn(&FieldChange) -> DVec3| {
                let mean = 0.5 * (field(&pair[0]) + field(&pair[1]));
                let half = 0.5 * field(jump);
                mean + if mean.dot(half) < 0.0 { -half } else { half }
            };
            all.push(FieldChange {
                position: larger_side(|it| it.position),
                rotation: larger_side(|it| it.rotation),
                force: larger_side(|it| it.force),
                moment: larger_side(|it| it.moment),
            });
        }
        all.extend(nodes.last());
        all
    };
    changes.iter().zip(jumps).map(rod).collect()
}

/// The error of the energy of a leaf with these jumps, which are closed by the work of its forces,
/// and with the response `changes` to them. Between the jumps the error e of the fields satisfies the linear
/// equations, so that its energy is the work of its forces at the jumps, and the error of the leaf's
/// energy half of [n] e_x - e_n [x], with the same of moments and rotations: it is of second order, and
/// bounded by the size of every term. A dead moment has no potential: the energy is not
/// stationary, and changes by its work in the rotation e of the node on which it acts.
fn energy_error(
    leaf: &DiscreteLeaf,
    changes: &[Vec<FieldChange>],
    jumps: &[Vec<FieldChange>],
) -> f64 {
    let mut error = 0.0;
    for (nodes, jumps) in changes.iter().zip(jumps) {
        for (pair, jump) in nodes.windows(2).zip(jumps) {
            let mean = |field: fn(&FieldChange) -> DVec3| {
                0.5 * (field(&pair[0]).length() + field(&pair[1]).length())
            };
            error += 0.5
                * (jump.force.length() * mean(|it| it.position)
                    + mean(|it| it.force) * jump.position.length());
            error += 0.5
                * (jump.moment.length() * mean(|it| it.rotation)
                    + mean(|it| it.moment) * jump.rotation.length());
        }
    }
    let [turned, _] = largest_rotation_and_stress(changes);
    let moments = leaf.dead_moments().map(|it| it.moment.length());
    error + turned * moments.sum::<f64>()
}

/// Makes forces and moments at the tips, and moments at hinges, satisfy the end conditions, which unfinished
/// iterations violate slightly: the linear equations assume them. For a rod in the mirror
/// plane the components that would move it out of the plane are set to zero.
fn satisfy_tip_conditions(leaf: &DiscreteLeaf, known: &mut [Vec<RodFields>]) {
    for (j, rod) in known.iter_mut().enumerate() {
        for node in rod.iter_mut().filter(|_| leaf.leaf.is_halved_midrib(j)) {
            node.n.y = 0.0;
            (node.m.x, node.m.z) = (0.0, 0.0);
        }
    }
    let turning = |(j, _): &(usize, &mut Vec<RodFields>)| leaf.leaf.base_turns(*j);
    for (j, rod) in known.iter_mut().enumerate().filter(turning) {
        // Corrections are across the axes of hinges on a grid, which differ from those of these fields.
        if let Some(joint) = leaf.leaf.base_joint(j) {
            rod[0].q = joint.settled(rod[0].q);
        }
        let RodFields { q, m, .. } = rod[0];
        rod[0].m = leaf.leaf.base_spring_moment(j, q) + leaf.leaf.joint_moment(j, q, m);
    }
    let mut tips: Vec<_> = known.iter_mut().filter_map(|rod| rod.last_mut()).collect();
    let held = leaf.leaf.tip_support.as_ref();
    let clamped = held.is_some_and(|held| held.clamps.is_some());
    let share = 1.0 / tips.len() as f64;
    let mut missing: DVec3 = (tips.iter().enumerate())
        .map(|(j, tip)| share * (leaf.tip_force(j) - tip.n))
        .sum();
    if leaf.leaf.is_mirror_half() {
        // The mirror image balances the component across the plane.
        missing.y = 0.0;
    }
    for (j, tip) in tips.iter_mut().enumerate() {
        match held {
            Some(_) => {}
            None if leaf.leaf.joined() => tip.n += missing,
            None => tip.n = leaf.tip_force(j),
        }
        if !clamped {
            tip.m = leaf.dead_moment_at(1.0);
            if leaf.has_levers() {
                tip.m += leaf.lever_moment_at(j, 1.0, tip.q);
            }
        }
    }
}

fn jump(a: &RodFields, b: &RodFields) -> FieldChange {
    FieldChange {
        position: a.x - b.x,
        rotation: rotation::log(a.q * b.q.conjugate()),
        force: a.n - b.n,
        moment: a.m - b.m,
    }
}

fn mean(a: &RodFields, b: &RodFields) -> RodFields {
    RodFields {
        x: 0.5 * (a.x + b.x),
        q: a.q.lerp(b.q, 0.5),
        n: 0.5 * (a.n + b.n),
        m: 0.5 * (a.m + b.m),
    }
}

/// The linearized equations of a leaf on a grid that is divided into equal parts of `part`
/// segments; its fields may jump at their midpoints.
struct Tangents<'a> {
    level: &'a GridLevel,
    part: usize,
    /// The segments just beyond the midpoints, rod after rod.
    behind: Vec<Vec<SegmentTangent>>,
    /// The first segment and the last of every part; computed on first use.
    at_ends: Vec<Vec<SegmentTangent>>,
}

/// The first-order response of a leaf to jumps of its fields.
struct JumpResponse {
    /// Displacements and rotations of all nodes from the `first` on.
    solution: NodalField,
    first: usize,
    /// The largest displacements at the ends of the parts, and on either side of the midpoints.
    position_errors: PositionErrors,
}

impl<'a> Tangents<'a> {
    /// Linearizes the equations of the leaf of `level`, divided into `parts` parts.
    fn new(level: &'a GridLevel, parts: usize) -> Self {
        let GridLevel { leaf, state } = level;
        let part = leaf.segments() / parts;
        let middles = |j: usize| {
            let segments = (0..parts).map(|k| k * part + part / 2);
            segments.map(|i| leaf.tangent(state, j, i)).collect()
        };
        Tangents {
            level,
            part,
            behind: (0..leaf.rods()).map(middles).collect(),
            at_ends: Vec::new(),
        }
    }

    /// The response of the `linear` equations to `jumps`. `None` where these cannot be solved.
    fn response(
        &self,
        linear: &mut FactorizedLevel,
        jumps: &[Vec<FieldChange>],
    ) -> Option<JumpResponse> {
        let leaf = &self.level.leaf;
        let FactorizedLevel {
            system, factors, ..
        } = linear;
        leaf.assemble_jump_correction(&self.behind, jumps, system);
        let LinearSolveOutcome::Converged(_) = factors.solve(system, CORRECTION.response_accuracy)
        else {
            return None;
        };
        let (mut at_ends, mut between) = (0.0_f64, 0.0_f64);
        let solution = system.solution();
        for (rod, jumps) in solution.iter().zip(jumps) {
            // The ends of parts, without the bases.
            let nodes = &rod[1 - system.first_node()..];
            for (nodes, jump) in nodes.chunks(self.part).zip(jumps) {
                let before = displacement_part(&nodes[self.part / 2 - 1]);
                let middle = larger(before.length(), (before + jump.position).length());
                between = larger(between, middle);
                at_ends = larger(at_ends, displacement_part(&nodes[self.part - 1]).length());
            }
        }
        Some(JumpResponse {
            solution,
            first: system.first_node(),
            position_errors: PositionErrors {
                at_nodes: at_ends,
                between,
            },
        })
    }

    /// The changes of all fields in a response, at the ends of the parts.
    fn changes(
        &mut self,
        response: &JumpResponse,
        jumps: &[Vec<FieldChange>],
    ) -> Vec<Vec<FieldChange>> {
        let GridLevel { leaf, state } = self.level;
        if self.at_ends.is_empty() {
            let ends = |j: usize| {
                let segments = (0..=jumps[0].len()).map(|k| (k * self.part).saturating_sub(1));
                segments.map(|i| leaf.tangent(state, j, i)).collect()
            };
            self.at_ends = (0..leaf.rods()).map(ends).collect();
        }
        let moved = displace_state(state, response);
        let ends = |(j, jumps): (usize, &Vec<FieldChange>)| {
            let end = |k: usize| self.change(response, &moved, j, jumps, k);
            (0..=jumps.len()).map(end).collect()
        };
        jumps.iter().enumerate().map(ends).collect()
    }

    /// The change at the beginning of part `k` of rod `j`, as [`resultants`](crate::relax::accuracy::transfer::resultants) takes
    /// forces and moments: from the segment before it.
    fn change(
        &self,
        response: &JumpResponse,
        moved: &State,
        j: usize,
        jumps: &[FieldChange],
        k: usize,
    ) -> FieldChange {
        let GridLevel { leaf, state } = self.level;
        let (n, i) = (leaf.segments(), k * self.part);
        let s = i.saturating_sub(1);
        let ([begin, mut a], [end, b]) = (response.at(j, s), response.at(j, s + 1));
        let mut across = end - begin;
        if s % self.part == self.part / 2 {
            // This segment begins just beyond the jump at the midpoint.
            let jump = jumps[s / self.part];
            a += jump.rotation;
            across -= jump.position;
        }
        let tangent = &self.at_ends[j][k];
        let (segment, second, first) = (&tangent.segment, &tangent.second, &tangent.first);
        let (section, zero) = (leaf.section(j, s), DVec3::ZERO);
        // Without the part that closes the segment's remaining gap (residual of its
        // constitutive law).
        let force = segment.force_increment(section, across, a, b)
            - segment.force_increment(section, zero, zero, zero);
        // A moment with fixed lab components does not rotate with its node.
        if i == 0 {
            let moment = second.xa.transpose() * across + second.aa * a + second.ab * b;
            return FieldChange {
                position: zero,
                rotation: response.at(j, 0)[1],
                force,
                moment: -moment - 0.5 * a.cross(first.a),
            };
        }
        let moment = second.xb.transpose() * across + second.ab.transpose() * a + second.bb * b;
        let left = leaf.grid.segment_width(i - 1);
        let right = if i < n {
            leaf.grid.segment_width(i)
        } else {
            0.0
        };
        let [before, after] = [state, moved].map(|state| leaf.load(state, j, i));
        let part = left / (left + right);
        FieldChange {
            position: end,
            rotation: b,
            force: force - part * (after.force - before.force),
            moment: moment + 0.5 * b.cross(first.b) - part * (after.moment - before.moment),
        }
    }
}

impl JumpResponse {
    /// Displacement and rotation of node `i` of rod `j`.
    fn at(&self, j: usize, i: usize) -> [DVec3; 2] {
        match i < self.first {
            true => [DVec3::ZERO; 2],
            false => {
                [displacement_part, rotation_part].map(|of| of(&self.solution[j][i - self.first]))
            }
        }
    }
}

/// The largest rotation (radians), and the largest change of a force or moment.
fn largest_rotation_and_stress(changes: &[Vec<FieldChange>]) -> [f64; 2] {
    let most = |of: fn(&FieldChange) -> f64| changes.iter().flatten().map(of).fold(0.0, larger);
    [
        most(|it| it.rotation.length()),
        most(|it| larger(it.force.length(), it.moment.length())),
    ]
}

/// Adds the changes to the fields of the leaf.
fn apply_changes(changes: &[Vec<FieldChange>], known: &mut [Vec<RodFields>]) {
    let changes = changes.iter().flatten();
    for (node, change) in known.iter_mut().flatten().zip(changes) {
        node.x += change.position;
        node.q = (rotation::exp(change.rotation) * node.q).normalize();
        node.n += change.force;
        node.m += change.moment;
    }
}

/// The state with its nodes displaced and rotated.
fn displace_state(state: &State, response: &JumpResponse) -> State {
    let mut moved = state.clone();
    for j in 0..state.rods() {
        for i in 0..=state.segments() {
            let (k, [shift, turn]) = (state.base(j) + i, response.at(j, i));
            moved.x[k] += shift;
            moved.q[k] = (rotation::exp(turn) * moved.q[k]).normalize();
        }
    }
    moved
}

/// Bound on the part of the integration error that remains with halved steps: with order 8 it is a
/// 256th.
const HALVED_STEP_ERROR_RATIO: f64 = 1.0 / 16.0;

/// The steps of the integration from a node to a midpoint.
struct IntegrationSteps {
    count: usize,
    /// Whether they are half of those of the round before.
    halved: bool,
    /// Bound on the error of the integration.
    error: f64,
    /// Whether the leaf is on a single grid.
    alone: bool,
}

impl IntegrationSteps {
    fn new(count: usize, alone: bool) -> Self {
        IntegrationSteps {
            count,
            halved: false,
            error: f64::INFINITY,
            alone,
        }
    }

    /// Bounds the error of the integration by the estimated error of a round: after a round with longer
    /// steps that includes their error, and so bounds that of the halved steps.
    fn measure(&mut self, largest: f64) {
        self.error = match (self.halved, self.alone) {
            (true, true) => HALVED_STEP_ERROR_RATIO * largest,
            (true, false) => 0.0,
            (false, true) => self.error,
            (false, false) => f64::INFINITY,
        };
    }

    /// Halves the steps if the next round, whose error is `expected`, may be the last; on a
    /// single grid only if their own error is not known to be small. For small tolerances, with
    /// several grids, the ends of more steps make better stations.
    fn choose(&mut self, expected: f64, enough: f64) {
        let unknown = !self.alone || self.error > 0.5 * enough;
        self.halved = unknown && expected <= enough;
        if self.halved {
            self.count *= 2;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::relax::{Options, relax_on_grids};
    use crate::scenario::Scenario;

    const LEAF: &str = r#"
        name = "leaf"
        leaf = { rods = 5, length = 1.0, fan = "paper", joined = true }
        stiffness = { torsion = 0.7, bending_2 = 1.0, bending_3 = 2.0, axial = AXIAL, shear_2 = 50.0, shear_3 = inf }
        load = { gravity = [0.0, 0.0, -1.0] }
    "#;

    /// The linear equations are factorized once for all rounds, and each of these leaves less
    /// than a thirtieth of the error, for rods that are rigid in stretch or not.
    #[test]
    fn every_round_leaves_a_small_part() {
        for axial in ["inf", "100.0"] {
            let leaf = Scenario::from_toml(&LEAF.replace("AXIAL", axial)).unwrap();
            let options = Options {
                tolerance: Some(1e-3),
                ..Options::default()
            };
            let relaxed = relax_on_grids(&leaf, &options, false, &mut |_| {}).unwrap();
            let found = relaxed.on_grids;
            let (mut linear, mut work) = (None, SolverCounts::default());
            let mut estimated = |error, most_corrections| {
                let goal = CorrectionGoal {
                    error,
                    most_corrections,
                };
                let workspace = &mut EquationWorkspace::default();
                estimate(&found.levels, 1, goal, &mut linear, workspace, &mut work).unwrap()
            };
            let first = estimated(0.0, 0).position_errors.largest();
            // The last round only verifies.
            for most in 2..=4_usize {
                let enough = first * 30.0_f64.powi(1 - most as i32);
                let estimate = estimated(enough, most);
                let largest = estimate.position_errors.largest();
                let what = format!("{axial}, {most}: {largest} of {first}");
                assert!((1..=most).contains(&estimate.corrections), "{what}");
                assert!(largest <= enough, "{what}");
            }
            assert_eq!(work.factorizations, 1);
        }
    }
}
