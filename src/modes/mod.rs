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
//! be proved is not returned. Eigenvalues themselves are Rayleigh quotients of the shapes in mixed form,
//! in which no large stiffness enters.

mod arnoldi;
mod lanczos;
pub(crate) mod linearized;
pub(crate) mod motion_pairs;
mod node_blocks;

use crate::leaf::{
    DirectSolver, DiscreteLeaf, Increment, MatrixFactors, NodalField, State, System, TissueForces,
    displacement_part, hessian_at_constant_force, rotation_part,
};
use crate::modes::lanczos::{Lanczos, NormalizedEigenvector, RitzBound};
use crate::motion::Physics;
use crate::rod::{Section, Segment};
use crate::run::Limit;
use glam::{DMat3, DVec3};
use std::borrow::Cow;

/// How stiff rods are softened in the matrix, since a large stiffness loses digits.
struct MatrixSoftening {
    /// Stiffness, in A/L^2, to which stiffer rods are softened. The eigenvalues do not change to first
    /// order.
    stiffness: f64,
    /// Least ratio of [`MatrixSoftening::stiffness`] to the largest force carried.
    force_ratio: f64,
    /// Ratio of the softenings from which the first-order effect on modes is computed.
    comparison_ratio: f64,
    /// Cosine of the angle between two shapes above which they are the same mode.
    same_mode_cosine: f64,
}

const SOFTENING: MatrixSoftening = MatrixSoftening {
    stiffness: 1e6,
    force_ratio: 1e4,
    comparison_ratio: 4.0,
    same_mode_cosine: 0.99,
};

/// Shifts of the matrix, and how many searches there are.
struct ModeSearch {
    /// The first negative shift tried for an unstable leaf, in A/(rho L^4), and the factor to the next.
    first_shift: f64,
    next_shift: f64,
    /// Factor to the next shift below the eigenvalues that are wanted, if they are not the lowest.
    lower_shift: f64,
    /// Eigenvalues are counted below the last one minus this part of its distance from the lower
    /// shift; the first of these at which the matrix is not singular, and the next where one that is
    /// missing is not found: in a stiff matrix rounding moves eigenvalues by as much.
    counting_offsets: [f64; 3],
    /// Eigenvalues are counted at least so many times the error of one below the last one.
    counting_errors: f64,
    /// Distance of a closer shift from clustered eigenvalues, as a part of that to the last shift, and
    /// the factor of this distance for the next attempt.
    closer_shift: f64,
    closer_shift_growth: f64,
    /// Least distance of a closer shift over the error of the bound on clustered eigenvalues.
    closer_shift_errors: f64,
    /// Eigenvectors of this accuracy or less are found with solutions that are not refined.
    unrefined_accuracy: f64,
    /// Number of searches that start with approximate modes.
    approximate_starts: usize,
    /// Largest number of searches in excess of one for every mode wanted: each finds only one
    /// of equal eigenvalues.
    extra_searches: usize,
    /// Searches in a row that find none of those counted, after which the count is rounding: on the finest grids of
    /// blades it is, and no search of 19 found another one.
    fruitless_searches: usize,
}

const SEARCH: ModeSearch = ModeSearch {
    first_shift: 1e-3,
    next_shift: 8.0,
    lower_shift: 4.0,
    counting_offsets: [1e-7, 1e-6, 1e-5],
    counting_errors: 40.0,
    closer_shift: 2e-3,
    closer_shift_growth: 6.0,
    closer_shift_errors: 0.5,
    unrefined_accuracy: 1e-6,
    approximate_starts: 2,
    extra_searches: 16,
    fruitless_searches: 4,
};

/// A mode and its eigenvalue.
#[derive(Clone, Debug)]
pub struct Eigenpair {
    /// Eigenvalue lambda, in A/(rho L^4).
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
    /// The modes below the wanted ones, if these are not the lowest: they are not computed.
    pub modes_below: Option<ModesBelow>,
    /// Accuracy of eigenvectors; the error of an eigenvalue is its square.
    pub accuracy: f64,
    /// Shapes of approximate modes, from the same grid in a shape nearby or interpolated from
    /// another grid: the search begins with them.
    pub approximate_modes: &'a [Vec<Increment>],
    /// Time limit, beyond which nothing is returned.
    pub time: &'a Limit,
}

/// Eigenvalues below a shift.
#[derive(Clone, Copy, Debug)]
pub struct ModesBelow {
    /// Number of eigenvalues.
    pub count: usize,
    /// The shift; in a request negative and only to begin with.
    pub shift: f64,
}

/// K - shift M, factorized.
struct ShiftedMatrix {
    shift: f64,
    factors: MatrixFactors,
}

/// Eigenvalues that were not found.
struct MissingModes {
    count: usize,
    /// They are below this value.
    limit: f64,
}

/// The search for the modes of a leaf in one state.
struct Vibration<'a> {
    leaf: &'a DiscreteLeaf,
    state: &'a State,
    direct_solver: DirectSolver,
    masses: MassMatrix,
    wanted: ModeRequest<'a>,
    /// [`ModeRequest::approximate_modes`] as vectors.
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
                false => quotient(soft, state, &shape, &forces, TissueForces::Carried),
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
    let (n, limit) = (
        leaf.segments(),
        SOFTENING.stiffness.max(SOFTENING.force_ratio * tension),
    );
    for (k, section) in soft.sections.iter_mut().enumerate() {
        *section = leaf.limit_held_segment(k / n, k % n, *section, DVec3::splat(limit));
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
    fn factorize(&self, system: &mut System, shift: f64) -> Option<ShiftedMatrix> {
        self.assemble(system, shift);
        let factors = self.direct_solver.factorize(system, 0.0).ok()?;
        Some(ShiftedMatrix { shift, factors })
    }

    /// The matrix at a shift below all eigenvalues that are wanted, as close to them as necessary.
    fn shift_below_all(&self, system: &mut System) -> Option<ShiftedMatrix> {
        let (others, mut shift, next) = match self.wanted.modes_below {
            Some(below) => (below.count, below.shift, SEARCH.lower_shift),
            None => (0, -self.leaf.neutral_shift(), SEARCH.next_shift),
        };
        loop {
            let matrix = self.factorize(system, shift)?;
            if matrix.factors.negative_eigenvalue_count() <= others {
                return Some(matrix);
            }
            shift = (next * shift).min(-SEARCH.first_shift);
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
        let mut matrix = self.shift_below_all(system)?;
        let below = ModesBelow {
            count: matrix.factors.negative_eigenvalue_count(),
            shift: matrix.shift,
        };
        // Some of the others may be above the shift.
        let others = self
            .wanted
            .modes_below
            .map_or(0, |others| others.count - below.count);
        // Beside turns as many more, so that the last one is not zero: the eigenvalues below it
        // are counted.
        let count = (others + wanted + found.len()).min(self.direct_solver.size() - below.count);
        let (mut limit, mut sought) = (f64::INFINITY, count - found.len());
        let under = |found: &[NormalizedEigenvector], limit| {
            found.iter().filter(|f| f.eigenvalue < limit).count()
        };
        let (mut part, mut fruitless) = (0, 0);
        for search in 0..SEARCH.extra_searches + count {
            if self.wanted.time.reached() {
                return None;
            }
            let before = under(&found, limit);
            let bound = self.search(&mut matrix, sought, limit, search, &mut found);
            if limit.is_finite() && under(&found, limit) == before {
                part = (part + 1).min(SEARCH.counting_offsets.len() - 1);
                fruitless += 1;
                if fruitless == SEARCH.fruitless_searches {
                    return None;
                }
            } else {
                fruitless = 0;
            }
            if found.len() < count {
                sought = count - found.len();
                if let Some(bound) = bound
                    && let Some(closer) =
                        self.closer_shift(system, matrix.shift, bound, below.count + found.len())?
                {
                    matrix = closer;
                }
                continue;
            }
            let parts = &SEARCH.counting_offsets[part..];
            let missing = self.count_missing(system, &found, count, below, parts)?;
            if missing.count == 0 {
                let wanted = found.into_iter().take(count).skip(others).take(wanted);
                return Some(wanted.collect());
            }
            (sought, limit) = (missing.count.min(count), missing.limit);
            if matrix.shift != below.shift {
                matrix = self.factorize(system, below.shift)?;
            }
        }
        None
    }

    /// The eigenvalues that are missing below a value just below the `count`-th of those found, by one
    /// of these `parts`, as it may have further equal ones; `others` are below the lowest shift.
    fn count_missing(
        &self,
        system: &mut System,
        found: &[NormalizedEigenvector],
        count: usize,
        others: ModesBelow,
        parts: &[f64],
    ) -> Option<MissingModes> {
        let last = found[count - 1].eigenvalue;
        let rounding = self.leaf.eigenvalue_rounding();
        let least = SEARCH.counting_errors * self.wanted.accuracy.powi(2);
        for &part in parts {
            let part = part.max(least * part / SEARCH.counting_offsets[0]);
            let below = last - (part * (last - others.shift)).max(4.0 * rounding);
            let here = found.iter().filter(|f| f.eigenvalue < below).count();
            self.assemble(system, below);
            let mut there = self.direct_solver.count_negative(system, 0.0).ok()?;
            if there != others.count + here {
                // So close to an eigenvalue, quick factors may tell a wrong sign.
                there = self
                    .direct_solver
                    .factorize_sparse(system, 0.0)
                    .ok()?
                    .negative_eigenvalue_count();
            }
            // Too many: one is equal to the limit up to rounding.
            if let Some(count) = there.checked_sub(others.count + here) {
                return Some(MissingModes {
                    count,
                    limit: below,
                });
            }
        }
        None
    }

    /// The matrix at a shift closer to the next eigenvalues, if many are close together:
    /// somewhat below `bound`, but above no eigenvalue that is not found yet. `Some(None)` if there is no
    /// such shift, `None` if memory is short.
    fn closer_shift(
        &self,
        system: &mut System,
        shift: f64,
        bound: RitzBound,
        found: usize,
    ) -> Option<Option<ShiftedMatrix>> {
        let mut part = SEARCH
            .closer_shift
            .max(SEARCH.closer_shift_errors * bound.error);
        while part < 1.0 {
            let closer = bound.eigenvalue - part * (bound.eigenvalue - shift);
            let matrix = self.factorize(system, closer)?;
            if matrix.factors.negative_eigenvalue_count() <= found {
                return Some(Some(matrix));
            }
            part *= SEARCH.closer_shift_growth;
        }
        Some(None)
    }

    /// Adds so many of the eigenvalues next above the shift to those found,
    /// fewer if there are no more below a limit; see [`Lanczos::run`].
    fn search(
        &self,
        matrix: &mut ShiftedMatrix,
        sought: usize,
        limit: f64,
        search: usize,
        found: &mut Vec<NormalizedEigenvector>,
    ) -> Option<RitzBound> {
        let from_near =
            search < SEARCH.approximate_starts && found.len() < self.approximate_modes.len();
        let (start, check_every) = match from_near {
            true => (self.start_from_modes(found.len()), 2),
            false => (self.asymmetric_start(search), 4),
        };
        let quick = self.wanted.accuracy >= SEARCH.unrefined_accuracy;
        let ShiftedMatrix { shift, factors } = matrix;
        let mut lanczos = Lanczos {
            mass_product: &|v| self.masses.times(v),
            shift: *shift,
            solve: &mut |b| match quick {
                true => factors.solve_unrefined(b),
                false => factors.solve_vector(b),
            },
            known_modes: found,
            accuracy: self.wanted.accuracy,
            check_every,
            time: self.wanted.time,
        };
        let more = lanczos.run(start, sought, limit);
        found.extend(more.modes);
        found.sort_by(|a, b| a.eigenvalue.total_cmp(&b.eigenvalue));
        more.bound
    }

    /// A load that excites all approximate modes not found yet.
    fn start_from_modes(&self, found: usize) -> Vec<f64> {
        let mut load = vec![0.0; self.direct_solver.size()];
        for near in &self.approximate_modes[found..] {
            (load.iter_mut().zip(near)).for_each(|(load, near)| *load += near);
        }
        self.masses.times(&load)
    }

    /// A load without any symmetry, different in every search.
    fn asymmetric_start(&self, search: usize) -> Vec<f64> {
        // Multiples of the golden ratio spread evenly: no symmetry, no chance.
        let golden = |k: usize| (k as f64 * 0.618_033_988_749_895).fract() - 0.5;
        let mut load = vec![0.0; self.direct_solver.size()];
        for (j, i) in self.leaf.rod_index_pairs(self.leaf.moving_nodes()) {
            let sigma = self.leaf.grid.sigma()[i];
            let wave = (7.0 * search as f64 * sigma).sin();
            for (c, at) in self.direct_solver.unknowns(j, i).into_iter().enumerate() {
                let k = 18 * (j + 97 * search) + c;
                load[at] += golden(k + 1) + sigma * golden(k + 7) + wave * golden(k + 13);
            }
        }
        self.masses.times(&load)
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

/// Block of a node in the mass matrix.
struct NodeMassBlock {
    rod: usize,
    /// Number of the node on its rod.
    node: usize,
    unknowns: [usize; 6],
    tensor: DMat3,
    /// Along the lab axes.
    mass: DVec3,
    /// Between rotation (rows) and displacement, of masses off the axis.
    coupling: Option<DMat3>,
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
            let tensor = match i {
                0 => leaf.tensor_across_joint(state, j, tensor),
                _ => tensor,
            };
            NodeMassBlock {
                rod: j,
                node: i,
                unknowns: pattern.unknowns(j, i),
                tensor: if free.rotation { tensor } else { DMat3::ZERO },
                mass: free.of_displacement(DVec3::splat(inertia.mass)),
                coupling: inertia.coupling(state.q[state.base(j) + i], || free),
            }
        };
        let nodes = leaf
            .rod_index_pairs(leaf.moving_nodes())
            .map(node)
            .collect();
        MassMatrix { nodes }
    }

    /// The mass matrix times a vector.
    pub fn times(&self, v: &[f64]) -> Vec<f64> {
        let mut product = vec![0.0; v.len()];
        for node in &self.nodes {
            let [a, b, c, shifts @ ..] = node.unknowns;
            let turned = node.tensor * DVec3::new(v[a], v[b], v[c]);
            for (at, turned) in [a, b, c].into_iter().zip(turned.to_array()) {
                product[at] += turned;
            }
            for (at, mass) in shifts.into_iter().zip(node.mass.to_array()) {
                product[at] += mass * v[at];
            }
            if let Some(coupling) = node.coupling {
                let [turn, shift] = [[a, b, c], shifts].map(|at| DVec3::from(at.map(|k| v[k])));
                let (turned, shifted) = (coupling * shift, coupling.transpose() * turn);
                let both = turned.to_array().into_iter().chain(shifted.to_array());
                for (at, more) in node.unknowns.into_iter().zip(both) {
                    product[at] += more;
                }
            }
        }
        product
    }

    /// Adds `factor` M to the matrix of a system.
    pub fn add_to_system(&self, system: &mut System, factor: f64) {
        for node in &self.nodes {
            let against_displacement = DMat3::from_diagonal(node.mass * factor);
            system.add_rotation_spring(node.rod, node.node, node.tensor * factor);
            system.add_displacement_spring(node.rod, node.node, against_displacement);
            if let Some(coupling) = node.coupling {
                system.add_rotation_displacement_coupling(node.rod, node.node, coupling * factor);
            }
        }
    }
}

/// The mass of a shape: twice its kinetic energy.
pub fn mass(leaf: &DiscreteLeaf, physics: &Physics, state: &State, shape: &[Increment]) -> f64 {
    let node = |(j, i)| {
        let inertia = physics.inertia(leaf, j, i);
        let k = state.base(j) + i;
        let (turn, shift) = (rotation_part(&shape[k]), displacement_part(&shape[k]));
        turn.dot(inertia.tensor(state.q[k]) * turn)
            + inertia.mass * shift.length_squared()
            + 2.0 * turn.dot(inertia.first_moment(state.q[k]).cross(shift))
    };
    leaf.rod_index_pairs(leaf.moving_nodes()).map(node).sum()
}

/// The effective masses of a shape along the lab axes: p^2/m, where m is its mass and p the momentum of the leaf if it
/// moves at the rate of the shape. A base that is shaken along an axis excites a mode with this mass; those of all
/// modes sum up to the mass of the leaf (Clough and Penzien, Dynamics of Structures, 3rd ed., section 12-5).
pub fn effective_masses(
    leaf: &DiscreteLeaf,
    physics: &Physics,
    state: &State,
    shape: &[Increment],
) -> [f64; 3] {
    let node = |(j, i)| {
        let k = state.base(j) + i;
        let rates = [rotation_part(&shape[k]), displacement_part(&shape[k])];
        physics.inertia(leaf, j, i).momentum(state.q[k], rates)[1]
    };
    let momentum: DVec3 = leaf.rod_index_pairs(leaf.moving_nodes()).map(node).sum();
    let mass = mass(leaf, physics, state, shape);
    (momentum * momentum / mass).to_array()
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
/// to which both belong; the tissue may then have the forces of its strains in place of those that the state carries.
pub fn quotient(
    leaf: &DiscreteLeaf,
    state: &State,
    shape: &[Increment],
    forces: &[DVec3],
    tissue: TissueForces,
) -> f64 {
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
    sum + leaf.tissue_curvature(state, shape, tissue)
        + leaf.spring_curvature(state, shape)
        + leaf.lever_curvature(state, shape)
}

/// The contribution of second derivatives with respect to rotations, at constant force.
fn rotational_second_variation(segment: &Segment, section: &Section, a: DVec3, b: DVec3) -> f64 {
    let k = hessian_at_constant_force(segment, section);
    a.dot(k.aa * a) + 2.0 * a.dot(k.ab * b) + b.dot(k.bb * b)
}

/// Accuracy of eigenvectors for the derivatives of eigenvalues.
const DERIVATIVE_ACCURACY: f64 = 1e-9;

/// The modes of [`lowest`](crate::modes::lowest), with the shapes and forces of the leaf without softening:
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
        let softer = of(&soften_leaf(leaf, state, SOFTENING.comparison_ratio), &near)?;
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
        if product.abs() < SOFTENING.same_mode_cosine * (dot(a, a) * dot(b, b)).sqrt() {
            return;
        }
        let sign = product.signum();
        let part = 1.0 / (SOFTENING.comparison_ratio - 1.0);
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
    let mut shape = Cow::Borrowed(&mode.shape);
    // Hinges that hold the spin allow other increments in another state.
    for held in leaf.spin_axes(state).iter() {
        let base = &mut shape.to_mut()[state.base(held.rod)];
        let across = held.across(rotation_part(base));
        base[..3].copy_from_slice(&across.to_array());
    }
    let quotient = quotient(leaf, state, &shape, &mode.forces, TissueForces::Strained);
    quotient / mass(leaf, &physics, state, &shape) * physics.time_unit.powi(-2)
}
