//! Small vibrations about an equilibrium: the lowest eigenvalues of
//! K x = lambda M x with the Hessian K of the energy and the masses M of the
//! leaf in motion ([`crate::motion`]), without damping. Dimensionless: lambda in
//! units of A/(rho L^4).
//!
//! A positive lambda is the square of a frequency, a negative one that of the
//! rate at which the leaf leaves an unstable equilibrium.
//!
//! K - sigma M is factorized for a sigma below all eigenvalues, as the signs
//! of its pivots prove, and the Lanczos method finds the eigenvalues nearest to
//! sigma. Their number below the last one found follows from
//! the signs of the pivots of a second factorization there (Sylvester's law): missing ones,
//! such as the second one of a double eigenvalue, are
//! searched for until the numbers agree. A list whose completeness cannot
//! be proved is not returned.
//!
//! The mass matrix: for every node an inertia tensor and a mass.
//!
//! Rayleigh quotients of shapes.
//!
//! Modes for the derivatives of eigenvalues.

mod lanczos;

use crate::leaf::{
    DiagonalBlocks, DirectSolver, DiscreteLeaf, Increment, MatrixFactors, NodalField, State,
    System, displacement_part, hessian_at_constant_force, rotation_part,
};
use crate::modes::lanczos::{Lanczos, NormalizedEigenvector, RitzBound};
use crate::motion::Physics;
use crate::rod::{Section, Segment, Wrench};
use crate::run::Limit;
use glam::{DMat3, DVec3};

/// Stiffness, in A/L^2, to which stiffer rods are softened in the matrix, since a
/// larger one loses digits. The eigenvalues do not change to first order.
const STIFFNESS_CAP_IN_MATRIX: f64 = 1e6;

/// That stiffness is at least this multiple of the largest force carried.
const STIFFNESS_FORCE_RATIO: f64 = 1e4;

/// The first negative shift tried for an unstable leaf, in
/// A/(rho L^4), and the factor to the next.
const FIRST_SHIFT: f64 = 1e-3;

const NEXT_SHIFT: f64 = 8.0;

/// Eigenvalues are counted below the last one minus this part of its distance from
/// the lower shift, or minus so many times the error of an eigenvalue; the first of these at
/// which the matrix is not singular, and the next where one that is missing is not found: in a
/// stiff matrix rounding moves eigenvalues by as much.
const COUNTING_OFFSETS: [f64; 3] = [1e-7, 1e-6, 1e-5];

const COUNTING_ERROR_MULTIPLE: f64 = 40.0;

/// Factor to the next shift below those eigenvalues that are wanted, if they are not the lowest.
const LOWER_SHIFT_FACTOR: f64 = 4.0;

/// Shifts closer to clustered eigenvalues: the distance from them as a part of that to
/// the last shift, at least so many times the error of the bound on them, and its factor for the
/// next attempt.
const CLOSER_SHIFT_FRACTION: f64 = 2e-3;

const CLOSER_SHIFT_ERRORS: f64 = 0.5;

const CLOSER_SHIFT_GROWTH: f64 = 6.0;

/// Eigenvectors of this accuracy or less are found with solutions that are not refined.
const UNREFINED_ACCURACY: f64 = 1e-6;

/// Number of searches that start with approximate modes.
const APPROXIMATE_MODE_STARTS: usize = 2;

/// Largest number of searches in excess of one for every mode wanted: each finds only one
/// of equal eigenvalues.
const MAX_EXTRA_SEARCHES: usize = 16;

/// A mode and its eigenvalue.
#[derive(Clone, Debug)]
pub struct Eigenpair {
    /// Lambda.
    pub eigenvalue: f64,
    /// Turns and shifts of all nodes, rod after rod, base to tip.
    pub shape: Vec<Increment>,
    /// The spatial forces that it causes in the segments, rod by rod.
    pub forces: Vec<DVec3>,
}

/// Request for the modes of a leaf.
#[derive(Clone, Copy)]
pub struct ModeRequest<'a> {
    /// Number of the lowest modes.
    pub count: usize,
    /// Those next above so many others, which are not computed, and a negative shift to begin
    /// with at which these are below it and the wanted ones above.
    pub modes_below: Option<(usize, f64)>,
    /// Accuracy of eigenvectors; the error of an eigenvalue is its square.
    pub accuracy: f64,
    /// Shapes of approximate modes, from the same grid in a shape nearby or interpolated from
    /// another grid: the search begins with them.
    pub approximate_modes: &'a [Vec<Increment>],
    /// Time limit, beyond which nothing is returned.
    pub time: &'a Limit,
}

struct Vibration<'a> {
    leaf: &'a DiscreteLeaf,
    state: &'a State,
    direct_solver: DirectSolver,
    masses: MassMatrix,
    wanted: ModeRequest<'a>,
    /// [`ModeRequest::near`] as vectors.
    approximate_modes: Vec<Vec<f64>>,
    /// The turns of veins without resistance.
    zero_energy_rotations: Vec<Vec<f64>>,
}

/// The lowest eigenvalues, ascending (all if there are fewer than wanted), with
/// their modes, orthonormal in the mass product. `None` if memory is short, the
/// time limit is exceeded, or the list cannot be proved to be complete.
pub fn lowest(
    leaf: &DiscreteLeaf,
    physics: &Physics,
    state: &State,
    wanted: ModeRequest,
) -> Option<Vec<Eigenpair>> {
    softened_leaf_modes(&soften_leaf(leaf, state, 1.0), physics, state, wanted)
}

fn softened_leaf_modes(
    soft: &DiscreteLeaf,
    physics: &Physics,
    state: &State,
    wanted: ModeRequest,
) -> Option<Vec<Eigenpair>> {
    let mut system = System::new(soft);
    let pattern = DirectSolver::for_coupling_pattern(&system).ok()?;
    let mut vibration = Vibration {
        masses: MassMatrix::new(soft, physics, state, &pattern),
        leaf: soft,
        state,
        direct_solver: pattern,
        wanted,
        approximate_modes: Vec::new(),
        zero_energy_rotations: Vec::new(),
    };
    let near = wanted
        .approximate_modes
        .iter()
        .map(|near| vibration.unknown_vector(near));
    vibration.approximate_modes = near.collect();
    let turn = |turn: &NodalField| {
        // Clamped bases have no equations.
        let bases = &[[0.0; 6]][..soft.first_node()];
        let all: Vec<_> = turn
            .iter()
            .flat_map(|rod| bases.iter().chain(rod))
            .copied()
            .collect();
        vibration.unknown_vector(&all)
    };
    vibration.zero_energy_rotations = soft.zero_energy_fields(state).iter().map(turn).collect();
    let found = vibration.lowest(&mut system)?;
    let pair = |mode: &NormalizedEigenvector| {
        let shape = vibration.node_increments(&mode.vector);
        let forces = forces(soft, state, &shape);
        Eigenpair {
            // Zero is that of a turn alone.
            eigenvalue: match mode.eigenvalue == 0.0 {
                true => 0.0,
                false => quotient(soft, state, &shape, &forces),
            },
            shape,
            forces,
        }
    };
    let mut pairs: Vec<Eigenpair> = found.iter().map(pair).collect();
    pairs.sort_by(|a, b| a.eigenvalue.total_cmp(&b.eigenvalue));
    Some(pairs)
}

/// The leaf with a matrix that keeps the digits of its soft modes; the softening is multiplied
/// by `times`.
fn soften_leaf(leaf: &DiscreteLeaf, state: &State, times: f64) -> DiscreteLeaf {
    let mut soft = leaf.clone();
    let tension = state.n.iter().fold(0.0_f64, |m, n| m.max(n.length()));
    for section in &mut soft.sections {
        *section = section.limit_condensing_stiffness(
            STIFFNESS_CAP_IN_MATRIX.max(STIFFNESS_FORCE_RATIO * tension),
        );
        let added = section.condensing.recip() - section.compliance;
        section.condensing = (section.compliance + times * added).recip();
    }
    soft
}

impl Vibration<'_> {
    /// Assembles K - shift M.
    fn assemble(&self, system: &mut System, shift: f64) {
        self.leaf.assemble(self.state, system);
        self.masses.add_to_system(system, -shift);
    }

    /// K - shift M, factorized.
    fn factorize(&self, system: &mut System, shift: f64) -> Option<MatrixFactors> {
        self.assemble(system, shift);
        self.direct_solver.factorize(system, 0.0).ok()
    }

    /// A shift below all eigenvalues that are wanted, as close to them as necessary.
    fn shift_below_all(&self, system: &mut System) -> Option<(f64, MatrixFactors)> {
        let (others, mut shift, next) = match self.wanted.modes_below {
            Some((others, shift)) => (others, shift, LOWER_SHIFT_FACTOR),
            None => (0, -self.leaf.neutral_shift(), NEXT_SHIFT),
        };
        loop {
            let factor = self.factorize(system, shift)?;
            if factor.negative_eigenvalue_count() <= others {
                return Some((shift, factor));
            }
            shift = (next * shift).min(-FIRST_SHIFT);
            if !shift.is_finite() {
                return None;
            }
        }
    }

    /// The turns as eigenvectors of unit mass, whose eigenvalues are zero.
    fn zero_energy_modes(&self) -> Vec<NormalizedEigenvector> {
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let mut modes: Vec<NormalizedEigenvector> = Vec::new();
        for turn in &self.zero_energy_rotations {
            let mut vector = turn.clone();
            for other in &modes {
                let part = dot(&other.vector, &self.masses.times(&vector));
                let both = vector.iter_mut().zip(&other.vector);
                both.for_each(|(v, other)| *v -= part * other);
            }
            let mass = dot(&vector, &self.masses.times(&vector));
            vector.iter_mut().for_each(|v| *v /= mass.sqrt());
            modes.push(NormalizedEigenvector {
                eigenvalue: 0.0,
                vector,
            });
        }
        modes
    }

    /// Eigenvectors of unit mass, eigenvalues ascending.
    fn lowest(&self, system: &mut System) -> Option<Vec<NormalizedEigenvector>> {
        if self.wanted.count == 0 {
            return Some(Vec::new());
        }
        let mut found = self.zero_energy_modes();
        let wanted = self.wanted.count;
        let (lowest, mut factor) = self.shift_below_all(system)?;
        let below = factor.negative_eigenvalue_count();
        // Some of the others may be above the shift.
        let others = self
            .wanted
            .modes_below
            .map_or(0, |(others, _)| others - below);
        // Beside turns as many more, so that the last one is not zero: the eigenvalues below it
        // are counted.
        let count = (others + wanted + found.len()).min(self.direct_solver.size() - below);
        let (mut shift, mut limit, mut sought) = (lowest, f64::INFINITY, count - found.len());
        let under = |found: &[NormalizedEigenvector], limit| {
            found.iter().filter(|f| f.eigenvalue < limit).count()
        };
        let mut part = 0;
        for search in 0..MAX_EXTRA_SEARCHES + count {
            if self.wanted.time.reached() {
                return None;
            }
            let before = under(&found, limit);
            let bound = self.search(shift, &mut factor, sought, limit, search, &mut found);
            if limit.is_finite() && under(&found, limit) == before {
                part = (part + 1).min(COUNTING_OFFSETS.len() - 1);
            }
            if found.len() < count {
                sought = count - found.len();
                if let Some(bound) = bound
                    && let Some(closer) =
                        self.closer_shift(system, shift, bound, below + found.len())?
                {
                    (shift, factor) = closer;
                }
                continue;
            }
            let beyond = (lowest, below);
            let (missing, next) =
                self.count_missing(system, &found, count, beyond, &COUNTING_OFFSETS[part..])?;
            if missing == 0 {
                let wanted = found.into_iter().take(count).skip(others).take(wanted);
                return Some(wanted.collect());
            }
            (sought, limit) = (missing.min(count), next);
            if shift != lowest {
                (shift, factor) = (lowest, self.factorize(system, lowest)?);
            }
        }
        None
    }

    /// Number of missing eigenvalues, and the value below which they are: just below the
    /// `count`-th of those found, by one of these `parts`, as it may have further equal ones. So
    /// many others are below the lowest shift.
    fn count_missing(
        &self,
        system: &mut System,
        found: &[NormalizedEigenvector],
        count: usize,
        (lowest, others): (f64, usize),
        parts: &[f64],
    ) -> Option<(usize, f64)> {
        let last = found[count - 1].eigenvalue;
        let rounding = self.leaf.eigenvalue_rounding();
        let least = COUNTING_ERROR_MULTIPLE * self.wanted.accuracy.powi(2);
        for &part in parts {
            let part = part.max(least * part / COUNTING_OFFSETS[0]);
            let below = last - (part * (last - lowest)).max(4.0 * rounding);
            let here = found.iter().filter(|f| f.eigenvalue < below).count();
            self.assemble(system, below);
            let mut there = self.direct_solver.count_negative(system, 0.0).ok()?;
            if there != others + here {
                // So close to an eigenvalue, quick factors may tell a wrong sign.
                there = self
                    .direct_solver
                    .factorize_sparse(system, 0.0)
                    .ok()?
                    .negative_eigenvalue_count();
            }
            // Too many: one is equal to the limit up to rounding.
            if let Some(count) = there.checked_sub(others + here) {
                return Some((count, below));
            }
        }
        None
    }

    /// A shift closer to the next eigenvalues, if many are close together:
    /// somewhat below `bound`, but above no eigenvalue that is not found yet.
    fn closer_shift(
        &self,
        system: &mut System,
        shift: f64,
        bound: RitzBound,
        found: usize,
    ) -> Option<Option<(f64, MatrixFactors)>> {
        let mut part = CLOSER_SHIFT_FRACTION.max(CLOSER_SHIFT_ERRORS * bound.error);
        while part < 1.0 {
            let closer = bound.eigenvalue - part * (bound.eigenvalue - shift);
            let factor = self.factorize(system, closer)?;
            if factor.negative_eigenvalue_count() <= found {
                return Some(Some((closer, factor)));
            }
            part *= CLOSER_SHIFT_GROWTH;
        }
        Some(None)
    }

    /// Adds so many of the eigenvalues next above the shift to those found,
    /// fewer if there are no more below a limit; see [`Lanczos::run`].
    fn search(
        &self,
        shift: f64,
        factor: &mut MatrixFactors,
        sought: usize,
        limit: f64,
        search: usize,
        found: &mut Vec<NormalizedEigenvector>,
    ) -> Option<RitzBound> {
        let from_near =
            search < APPROXIMATE_MODE_STARTS && found.len() < self.approximate_modes.len();
        let (start, check_every) = match from_near {
            true => (self.start_from_modes(found.len()), 2),
            false => (self.asymmetric_start(search), 4),
        };
        let quick = self.wanted.accuracy >= UNREFINED_ACCURACY;
        let mut lanczos = Lanczos {
            masses: &self.masses,
            shift,
            solve: &mut |b| match quick {
                true => factor.solve_unrefined(b),
                false => factor.solve_vector(b),
            },
            known_modes: found,
            accuracy: self.wanted.accuracy,
            check_every,
            time: self.wanted.time,
        };
        let (more, bound) = lanczos.run(start, sought, limit);
        found.extend(more);
        found.sort_by(|a, b| a.eigenvalue.total_cmp(&b.eigenvalue));
        bound
    }

    /// A vector as turns and shifts of all nodes.
    fn node_increments(&self, vector: &[f64]) -> Vec<Increment> {
        let mut shape = vec![[0.0; 6]; self.state.x.len()];
        for (j, i) in self.leaf.rod_index_pairs(self.leaf.moving_nodes()) {
            shape[self.state.base(j) + i] = self.direct_solver.unknowns(j, i).map(|at| vector[at]);
        }
        shape
    }

    /// Turns and shifts of all nodes as a vector.
    fn unknown_vector(&self, shape: &[Increment]) -> Vec<f64> {
        let mut vector = vec![0.0; self.direct_solver.size()];
        for (j, i) in self.leaf.rod_index_pairs(self.leaf.moving_nodes()) {
            let node = &shape[self.state.base(j) + i];
            for (at, part) in self.direct_solver.unknowns(j, i).into_iter().zip(node) {
                vector[at] = *part;
            }
        }
        vector
    }
}

/// Inertia of a node.
struct NodeMassBlock {
    /// Rod, and number of the node.
    index: (usize, usize),
    unknowns: [usize; 6],
    tensor: DMat3,
    mass: f64,
}

/// The mass matrix of a leaf, its unknowns numbered as in the pattern of its
/// stiffness. A shared tip has the masses of all rods' ends.
pub struct MassMatrix {
    nodes: Vec<NodeMassBlock>,
}

impl MassMatrix {
    /// The masses of the moving leaf, its nodes rotated as in `state`.
    pub fn new(
        leaf: &DiscreteLeaf,
        physics: &Physics,
        state: &State,
        pattern: &DirectSolver,
    ) -> Self {
        let node = |(j, i)| {
            let inertia = physics.inertia(leaf, j, i);
            let tensor = inertia.tensor(state.q[state.base(j) + i]);
            // Fixed components have no mass.
            let free = leaf.node_freedom(j, i);
            NodeMassBlock {
                index: (j, i),
                unknowns: pattern.unknowns(j, i),
                tensor: if free.rotation { tensor } else { DMat3::ZERO },
                mass: if free.displacement { inertia.mass } else { 0.0 },
            }
        };
        let nodes = leaf
            .rod_index_pairs(leaf.moving_nodes())
            .map(node)
            .collect();
        MassMatrix { nodes }
    }

    /// M v.
    pub fn times(&self, v: &[f64]) -> Vec<f64> {
        let mut product = vec![0.0; v.len()];
        for node in &self.nodes {
            let [a, b, c, shifts @ ..] = node.unknowns;
            let turned = node.tensor * DVec3::new(v[a], v[b], v[c]);
            for (at, turned) in [a, b, c].into_iter().zip(turned.to_array()) {
                product[at] += turned;
            }
            for at in shifts {
                product[at] += node.mass * v[at];
            }
        }
        product
    }

    /// Adds `factor` M to the matrix of a system.
    pub fn add_to_system(&self, system: &mut System, factor: f64) {
        for node in &self.nodes {
            let (j, i) = node.index;
            let stiffness = DiagonalBlocks {
                rotary: node.tensor * factor,
                translational: node.mass * factor,
            };
            system.add_to_node(j, i, stiffness, Wrench::default());
        }
    }
}

/// The mass of a shape: twice its kinetic energy.
pub fn mass(leaf: &DiscreteLeaf, physics: &Physics, state: &State, shape: &[Increment]) -> f64 {
    let node = |(j, i)| {
        let inertia = physics.inertia(leaf, j, i);
        let k = state.base(j) + i;
        let (turn, shift) = (rotation_part(&shape[k]), displacement_part(&shape[k]));
        turn.dot(inertia.tensor(state.q[k]) * turn) + inertia.mass * shift.length_squared()
    };
    leaf.rod_index_pairs(leaf.moving_nodes()).map(node).sum()
}

/// Rounding error of the quotient of a mode of unit mass.
pub fn quotient_rounding(leaf: &DiscreteLeaf) -> f64 {
    let sections = leaf.sections.iter();
    let stiffest = sections.fold(0.0_f64, |m, s| m.max(s.couple_stiffness.max_element()));
    4.0 * f64::EPSILON * stiffest * (leaf.segments() * leaf.segments()) as f64
}

/// The spatial forces that a shape causes in the segments.
pub fn forces(leaf: &DiscreteLeaf, state: &State, shape: &[Increment]) -> Vec<DVec3> {
    let n = leaf.segments();
    let force = |(j, i): (usize, usize)| {
        let mut segment = leaf.segment(state, j, i, state.n[j * n + i]);
        segment.gap = DVec3::ZERO;
        let [a, b] = [0, 1].map(|end| &shape[state.base(j) + i + end]);
        segment.force_increment(
            leaf.section(j, i),
            displacement_part(b) - displacement_part(a),
            rotation_part(a),
            rotation_part(b),
        )
    };
    leaf.rod_index_pairs(0..n).map(force).collect()
}

/// Rayleigh quotient of a shape of unit mass, in mixed form: with the [`forces`] that the shape
/// causes in the segments as independent variables. Errors of the shape or of these forces,
/// from rounding or from the stiffness with which the forces were condensed out, have only a
/// second-order effect; and no large stiffness enters. The leaf and the state may be near those
/// to which both belong.
pub fn quotient(leaf: &DiscreteLeaf, state: &State, shape: &[Increment], forces: &[DVec3]) -> f64 {
    let n = leaf.segments();
    let mut sum = 0.0;
    for (j, i) in leaf.rod_index_pairs(0..n) {
        let section = leaf.section(j, i);
        let segment = leaf.segment(state, j, i, state.n[j * n + i]);
        let [a, b] = [0, 1].map(|end| &shape[state.base(j) + i + end]);
        let (dx, a, b) = (
            displacement_part(b) - displacement_part(a),
            rotation_part(a),
            rotation_part(b),
        );
        let force = segment.frame.transpose() * forces[j * n + i];
        let gap = segment.gap_increment(section, dx, a, b);
        sum += 2.0 * force.dot(gap) - section.ds * (section.compliance * force).dot(force);
        sum += rotational_second_variation(&segment, section, a, b);
    }
    for (j, i) in leaf
        .rod_index_pairs(leaf.moving_nodes())
        .filter(|(j, _)| j + 1 < leaf.rods())
    {
        let [a, b] = [j, j + 1].map(|rod| displacement_part(&shape[state.base(rod) + i]));
        sum += (b - a).dot(leaf.node_coupling(j, i) * (b - a));
    }
    sum + leaf.tissue_curvature(state, shape)
}

/// The contribution of second derivatives with respect to rotations, at constant force.
fn rotational_second_variation(segment: &Segment, section: &Section, a: DVec3, b: DVec3) -> f64 {
    let k = hessian_at_constant_force(segment, section);
    a.dot(k.aa * a) + 2.0 * a.dot(k.ab * b) + b.dot(k.bb * b)
}

/// Accuracy of eigenvectors for the derivatives of eigenvalues.
const DERIVATIVE_ACCURACY: f64 = 1e-9;

/// Ratio of the softenings from which the first-order effect of softening is computed.
const SOFTENING_RATIO: f64 = 4.0;

/// Cosine of the angle between two shapes above which they are the same mode.
const SAME_MODE_COSINE: f64 = 0.99;

/// As [`lowest`](crate::modes::lowest), with the shapes and forces of the leaf without softening:
/// derivatives of an eigenvalue, unlike the eigenvalue itself, depend on errors of these
/// in first order. The effect of softening is removed by means of the modes of a softer leaf.
pub fn unsoftened_modes(
    leaf: &DiscreteLeaf,
    state: &State,
    count: usize,
) -> Option<Vec<Eigenpair>> {
    let (physics, time) = (Physics::new(&leaf.leaf), Limit::default());
    let of = |soft: &DiscreteLeaf, near: &[Vec<Increment>]| {
        let wanted = ModeRequest {
            count,
            modes_below: None,
            accuracy: DERIVATIVE_ACCURACY,
            approximate_modes: near,
            time: &time,
        };
        softened_leaf_modes(soft, &physics, state, wanted)
    };
    let soft = soften_leaf(leaf, state, 1.0);
    let mut modes = of(&soft, &[])?;
    let changed = |(soft, stiff): (&Section, &Section)| soft.condensing != stiff.condensing;
    if soft.sections.iter().zip(&leaf.sections).any(changed) {
        let near: Vec<_> = modes.iter().map(|mode| mode.shape.clone()).collect();
        let softer = of(&soften_leaf(leaf, state, SOFTENING_RATIO), &near)?;
        for (mode, softer) in modes.iter_mut().zip(&softer) {
            mode.remove_softening(softer);
        }
    }
    Some(modes)
}

impl Eigenpair {
    /// The sum of two modes.
    pub fn plus(&self, other: &Eigenpair) -> Eigenpair {
        let mut sum = self.clone();
        let both = sum.shape.iter_mut().flatten();
        (both.zip(other.shape.iter().flatten())).for_each(|(value, other)| *value += other);
        (sum.forces.iter_mut().zip(&other.forces)).for_each(|(force, other)| *force += *other);
        sum
    }

    /// Removes the first-order effect of softening by means of the same mode of a softer
    /// leaf. If modes are so close together that they mix, it is not removed.
    fn remove_softening(&mut self, softer: &Eigenpair) {
        let dot = |a: &[Increment], b: &[Increment]| -> f64 {
            let both = a.iter().flatten().zip(b.iter().flatten());
            both.map(|(a, b)| a * b).sum()
        };
        let (a, b) = (&self.shape, &softer.shape);
        let product = dot(a, b);
        if product.abs() < SAME_MODE_COSINE * (dot(a, a) * dot(b, b)).sqrt() {
            return;
        }
        let sign = product.signum();
        let part = 1.0 / (SOFTENING_RATIO - 1.0);
        let both = (self.shape.iter_mut().flatten()).zip(softer.shape.iter().flatten());
        both.for_each(|(value, softer)| *value += part * (*value - sign * softer));
        for (force, softer) in self.forces.iter_mut().zip(&softer.forces) {
            *force += part * (*force - sign * *softer);
        }
    }
}

/// The eigenvalue from the shape and the forces of a mode, possibly those of a neighboring
/// leaf and state: their errors have only a second-order effect. In the
/// scenario's unit of time.
pub fn eigenvalue(leaf: &DiscreteLeaf, state: &State, mode: &Eigenpair) -> f64 {
    let physics = Physics::new(&leaf.leaf);
    let quotient = quotient(leaf, state, &mode.shape, &mode.forces);
    quotient / mass(leaf, &physics, state, &mode.shape) * physics.time_unit.powi(-2)
}
