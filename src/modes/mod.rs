//! Small vibrations about an equilibrium: the lowest eigenvalues of
//! K x = lambda M x with the Hessian K of the energy and the masses M of the
//! leaf in motion ([`crate::motion`]), without damping. Dimensionless: lambda in
//! units of A/(rho L^4).
//!
//! A positive lambda is the square of a frequency, a negative one that of the
//! rate at which the leaf leaves an unstable equilibrium.
//!
//! K - sigma M is factorised for a sigma below all eigenvalues, as the signs
//! of its pivots prove, and the Lanczos method finds the eigenvalues nearest to
//! sigma. Their number below the last one found follows from
//! the signs of the pivots of a second factorisation there (Sylvester's law): missing ones,
//! such as the second one of a double eigenvalue, are
//! searched for until the numbers agree. A list whose completeness cannot
//! be proved is not returned.

mod lanczos;
mod loaded;
mod masses;
mod quotient;
mod starts;

use crate::leaf::{DirectSolver, DiscreteLeaf, Factors, Field, Increment, State, System};
use crate::limit::Limit;
use crate::motion::Physics;
use glam::DVec3;
use lanczos::{Bound, Lanczos, Mode};
pub use loaded::{eigenvalue, loaded};
use masses::Masses;
pub use quotient::rounding;
use quotient::{forces, quotient};

/// Stiffness, in A/L^2, to which stiffer rods are softened in the matrix, since a
/// larger one loses digits. The eigenvalues do not change to first order.
const STIFFEST: f64 = 1e6;

/// That stiffness is at least this multiple of the largest force carried.
const STIFFER: f64 = 1e4;

/// The first negative shift tried for an unstable leaf, in
/// A/(rho L^4), and the factor to the next.
const FIRST_SHIFT: f64 = 1e-3;
const NEXT_SHIFT: f64 = 8.0;

/// Eigenvalues are counted below the last one minus this part of its distance from
/// the lower shift, or minus so many times the error of an eigenvalue; the first of these at
/// which the matrix is not singular, and the next where one that is missing is not found: in a
/// stiff matrix rounding moves eigenvalues by as much.
const BELOW: [f64; 3] = [1e-7, 1e-6, 1e-5];
const ERRORS_BELOW: f64 = 40.0;

/// Factor to the next shift below those eigenvalues that are wanted, if they are not the lowest.
const NEXT_BELOW: f64 = 4.0;

/// Shifts closer to clustered eigenvalues: the distance from them as a part of that to
/// the last shift, at least so many times the error of the bound on them, and its factor for the
/// next attempt.
const FIRST_PART: f64 = 2e-3;
const OF_ERROR: f64 = 0.5;
const NEXT_PART: f64 = 6.0;

/// Eigenvectors of this accuracy or less are found with solutions that are not refined.
const QUICK_ACCURACY: f64 = 1e-6;

/// Number of searches that start with approximate modes.
const FROM_NEAR: usize = 2;

/// Largest number of searches in excess of one for every mode wanted: each finds only one
/// of equal eigenvalues.
const SEARCHES: usize = 16;

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
pub struct Wanted<'a> {
    /// Number of the lowest modes.
    pub count: usize,
    /// Those next above so many others, which are not computed, and a negative shift to begin
    /// with at which these are below it and the wanted ones above.
    pub above: Option<(usize, f64)>,
    /// Accuracy of eigenvectors; the error of an eigenvalue is its square.
    pub accuracy: f64,
    /// Shapes of approximate modes, from the same grid in a shape nearby or interpolated from
    /// another grid: the search begins with them.
    pub near: &'a [Vec<Increment>],
    /// Time limit, beyond which nothing is returned.
    pub time: &'a Limit,
}

struct Vibration<'a> {
    leaf: &'a DiscreteLeaf,
    state: &'a State,
    pattern: DirectSolver,
    masses: Masses,
    wanted: Wanted<'a>,
    /// [`Wanted::near`] as vectors.
    near: Vec<Vec<f64>>,
    /// The turns of veins without resistance.
    turns: Vec<Vec<f64>>,
}

/// The lowest eigenvalues, ascending (all if there are fewer than wanted), with
/// their modes, orthonormal in the mass product. `None` if memory is short, the
/// time limit is exceeded, or the list cannot be proved to be complete.
pub fn lowest(
    leaf: &DiscreteLeaf,
    physics: &Physics,
    state: &State,
    wanted: Wanted,
) -> Option<Vec<Eigenpair>> {
    of_softened(&softened(leaf, state, 1.0), physics, state, wanted)
}

fn of_softened(
    soft: &DiscreteLeaf,
    physics: &Physics,
    state: &State,
    wanted: Wanted,
) -> Option<Vec<Eigenpair>> {
    let mut system = System::new(soft);
    let pattern = DirectSolver::of_coupling(&system).ok()?;
    let mut vibration = Vibration {
        masses: Masses::new(soft, physics, state, &pattern),
        leaf: soft,
        state,
        pattern,
        wanted,
        near: Vec::new(),
        turns: Vec::new(),
    };
    let near = wanted.near.iter().map(|near| vibration.vector(near));
    vibration.near = near.collect();
    let turn = |turn: &Field| {
        // Clamped bases have no equations.
        let bases = &[[0.0; 6]][..soft.first_node()];
        let all: Vec<_> = turn
            .iter()
            .flat_map(|rod| bases.iter().chain(rod))
            .copied()
            .collect();
        vibration.vector(&all)
    };
    vibration.turns = soft.turns(state).iter().map(turn).collect();
    let found = vibration.lowest(&mut system)?;
    let pair = |mode: &Mode| {
        let shape = vibration.shape(&mode.vector);
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
fn softened(leaf: &DiscreteLeaf, state: &State, times: f64) -> DiscreteLeaf {
    let mut soft = leaf.clone();
    let tension = state.n.iter().fold(0.0_f64, |m, n| m.max(n.length()));
    for section in &mut soft.sections {
        *section = section.condense(STIFFEST.max(STIFFER * tension));
        let added = section.condensing.recip() - section.compliance;
        section.condensing = (section.compliance + times * added).recip();
    }
    soft
}

impl Vibration<'_> {
    /// Assembles K - shift M.
    fn assemble(&self, system: &mut System, shift: f64) {
        self.leaf.assemble(self.state, system);
        self.masses.add(system, -shift);
    }

    /// K - shift M, factorised.
    fn factorize(&self, system: &mut System, shift: f64) -> Option<Factors> {
        self.assemble(system, shift);
        self.pattern.factorize(system, 0.0).ok()
    }

    /// A shift below all eigenvalues that are wanted, as close to them as necessary.
    fn below_all(&self, system: &mut System) -> Option<(f64, Factors)> {
        let (others, mut shift, next) = match self.wanted.above {
            Some((others, shift)) => (others, shift, NEXT_BELOW),
            None => (0, -self.leaf.neutral_shift(), NEXT_SHIFT),
        };
        loop {
            let factor = self.factorize(system, shift)?;
            if factor.negative() <= others {
                return Some((shift, factor));
            }
            shift = (next * shift).min(-FIRST_SHIFT);
            if !shift.is_finite() {
                return None;
            }
        }
    }

    /// The turns as eigenvectors of unit mass, whose eigenvalues are zero.
    fn turning(&self) -> Vec<Mode> {
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let mut modes: Vec<Mode> = Vec::new();
        for turn in &self.turns {
            let mut vector = turn.clone();
            for other in &modes {
                let part = dot(&other.vector, &self.masses.times(&vector));
                let both = vector.iter_mut().zip(&other.vector);
                both.for_each(|(v, other)| *v -= part * other);
            }
            let mass = dot(&vector, &self.masses.times(&vector));
            vector.iter_mut().for_each(|v| *v /= mass.sqrt());
            modes.push(Mode {
                eigenvalue: 0.0,
                vector,
            });
        }
        modes
    }

    /// Eigenvectors of unit mass, eigenvalues ascending.
    fn lowest(&self, system: &mut System) -> Option<Vec<Mode>> {
        if self.wanted.count == 0 {
            return Some(Vec::new());
        }
        let mut found = self.turning();
        let wanted = self.wanted.count;
        let (lowest, mut factor) = self.below_all(system)?;
        let below = factor.negative();
        // Some of the others may be above the shift.
        let others = self.wanted.above.map_or(0, |(others, _)| others - below);
        // Beside turns as many more, so that the last one is not zero: the eigenvalues below it
        // are counted.
        let count = (others + wanted + found.len()).min(self.pattern.size() - below);
        let (mut shift, mut limit, mut sought) = (lowest, f64::INFINITY, count - found.len());
        let under = |found: &[Mode], limit| found.iter().filter(|f| f.eigenvalue < limit).count();
        let mut part = 0;
        for search in 0..SEARCHES + count {
            if self.wanted.time.reached() {
                return None;
            }
            let before = under(&found, limit);
            let bound = self.search(shift, &mut factor, sought, limit, search, &mut found);
            if limit.is_finite() && under(&found, limit) == before {
                part = (part + 1).min(BELOW.len() - 1);
            }
            if found.len() < count {
                sought = count - found.len();
                if let Some(bound) = bound
                    && let Some(closer) = self.closer(system, shift, bound, below + found.len())?
                {
                    (shift, factor) = closer;
                }
                continue;
            }
            let beyond = (lowest, below);
            let (missing, next) = self.missing(system, &found, count, beyond, &BELOW[part..])?;
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
    fn missing(
        &self,
        system: &mut System,
        found: &[Mode],
        count: usize,
        (lowest, others): (f64, usize),
        parts: &[f64],
    ) -> Option<(usize, f64)> {
        let last = found[count - 1].eigenvalue;
        let rounding = self.leaf.rounding();
        let least = ERRORS_BELOW * self.wanted.accuracy.powi(2);
        for &part in parts {
            let part = part.max(least * part / BELOW[0]);
            let below = last - (part * (last - lowest)).max(4.0 * rounding);
            let here = found.iter().filter(|f| f.eigenvalue < below).count();
            self.assemble(system, below);
            let mut there = self.pattern.count_negative(system, 0.0).ok()?;
            if there != others + here {
                // So close to an eigenvalue, quick factors may tell a wrong sign.
                there = self.pattern.factorize_sparse(system, 0.0).ok()?.negative();
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
    fn closer(
        &self,
        system: &mut System,
        shift: f64,
        bound: Bound,
        found: usize,
    ) -> Option<Option<(f64, Factors)>> {
        let mut part = FIRST_PART.max(OF_ERROR * bound.error);
        while part < 1.0 {
            let closer = bound.eigenvalue - part * (bound.eigenvalue - shift);
            let factor = self.factorize(system, closer)?;
            if factor.negative() <= found {
                return Some(Some((closer, factor)));
            }
            part *= NEXT_PART;
        }
        Some(None)
    }

    /// Adds so many of the eigenvalues next above the shift to those found,
    /// fewer if there are no more below a limit; see [`Lanczos::run`].
    fn search(
        &self,
        shift: f64,
        factor: &mut Factors,
        sought: usize,
        limit: f64,
        search: usize,
        found: &mut Vec<Mode>,
    ) -> Option<Bound> {
        let from_near = search < FROM_NEAR && found.len() < self.near.len();
        let (start, check_every) = match from_near {
            true => (self.near_start(found.len()), 2),
            false => (self.start(search), 4),
        };
        let quick = self.wanted.accuracy >= QUICK_ACCURACY;
        let mut lanczos = Lanczos {
            masses: &self.masses,
            shift,
            solve: &mut |b| match quick {
                true => factor.solve_quickly(b),
                false => factor.solve_vector(b),
            },
            known: found,
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
    fn shape(&self, vector: &[f64]) -> Vec<Increment> {
        let mut shape = vec![[0.0; 6]; self.state.x.len()];
        for (j, i) in self.leaf.each(self.leaf.moving_nodes()) {
            shape[self.state.base(j) + i] = self.pattern.unknowns(j, i).map(|at| vector[at]);
        }
        shape
    }

    /// Turns and shifts of all nodes as a vector.
    fn vector(&self, shape: &[Increment]) -> Vec<f64> {
        let mut vector = vec![0.0; self.pattern.size()];
        for (j, i) in self.leaf.each(self.leaf.moving_nodes()) {
            let node = &shape[self.state.base(j) + i];
            for (at, part) in self.pattern.unknowns(j, i).into_iter().zip(node) {
                vector[at] = *part;
            }
        }
        vector
    }
}
