//! What is asked of the boundary-value solver, and what it answers.

use std::fmt;

use glam::DVec3;
use serde::Serialize;

use super::dop853::Unbounded;
use crate::limit::Limit;
use crate::memory::TooMuch;
use crate::shape::{Difference, RodShape};

/// Work done by the shooting, counted so that tests can pin it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Work {
    /// Corrections made.
    pub iterations: usize,
    /// Linearisations: sensitivities of all intervals, and their factorisation.
    pub linearizations: usize,
    /// Steps of the integrator.
    pub steps: usize,
    /// Evaluations of the slopes of the whole leaf.
    pub slopes: usize,
}

impl Work {
    /// Adds what another run did.
    pub fn add(&mut self, other: Work) {
        self.iterations += other.iterations;
        self.linearizations += other.linearizations;
        self.steps += other.steps;
        self.slopes += other.slopes;
    }
}

/// How far a shooting has come.
#[derive(Clone, Copy, Debug)]
pub struct Correction {
    /// From arcs: how much is made of the change that leads to the scenario's leaf (of its
    /// loads, or of its stiffness), from 0 to 1; 1 where it starts near the leaf.
    pub way: f64,
    /// How many corrections were made since the present solution was begun.
    pub iteration: usize,
    /// How much is made of the linearisation that the next one needs, from 0 to 1.
    pub linearized: f64,
    /// The largest number of the last correction found, in the units of the unknowns;
    /// infinite before the first.
    pub size: f64,
    /// What corrections are to shrink to.
    pub wanted: f64,
}

/// What a shooting does is counted, and told step by step.
pub(super) struct Log<'p> {
    /// Counted so far.
    pub work: Work,
    /// How much of the present change of the leaf of arcs is made.
    pub way: f64,
    /// Told of each correction.
    pub progress: &'p mut dyn FnMut(&Correction),
}

/// Displacements below this part of the largest are not worth telling.
const MOVES: f64 = 0.2;

/// Where a solution starts from.
#[derive(Clone, Copy, Debug)]
pub enum Start<'s> {
    /// On its own: from arcs by continuation.
    Arcs,
    /// From the shape of the leaf at some stations, in the scenario's units.
    Leaf {
        /// Fractions of the length, from 0 to 1.
        stations: &'s [f64],
        /// One shape per rod.
        rods: &'s [RodShape],
    },
}

/// How precise a solution is to be.
#[derive(Clone, Copy, Debug)]
pub enum Precision {
    /// Estimated error of the positions relative to the longest rod, or as far
    /// as double precision allows: see [`Solution::error`].
    Error(f64),
    /// Local error allowed per integration step, in dimensionless form.
    LocalError(f64),
}

/// What is asked of the shooting.
#[derive(Clone, Debug)]
pub struct Options<'s> {
    /// Where it starts from.
    pub start: Start<'s>,
    /// Fractions of the length at which the solution is wanted, from 0 to 1.
    pub stations: &'s [f64],
    /// How precise it is to be.
    pub precision: Precision,
    /// Number of intervals; `None`: as many as the growth of perturbations needs.
    pub intervals: Option<usize>,
    /// When Newton's method gives up.
    pub limit: Limit,
}

impl<'s> Options<'s> {
    /// Over as many intervals as needed, without a limit.
    pub fn new(start: Start<'s>, stations: &'s [f64], precision: Precision) -> Self {
        Options {
            start,
            stations,
            precision,
            intervals: None,
            limit: Limit::default(),
        }
    }
}

/// A direction that the equations leave undetermined, or nearly so: the leaf
/// is at a bifurcation, or its equilibria form a family.
#[derive(Clone, Debug, PartialEq)]
pub struct Neutral {
    /// Smallest singular value of the condensed equations over the largest.
    pub ratio: f64,
    /// Displacement of every rod along it at the stations, the largest of
    /// all displacements being 1.
    pub displacement: Vec<Vec<DVec3>>,
}

/// A solution of the boundary-value problem, in the units of the scenario.
#[derive(Clone, Debug)]
pub struct Solution {
    /// Fractions of the length.
    pub stations: Vec<f64>,
    /// The shape there, one per rod.
    pub rods: Vec<RodShape>,
    /// Total potential energy (that of a dead moment does not exist).
    pub energy: f64,
    /// Estimated global error: the difference to a solution with local errors
    /// larger by two orders of magnitude, plus one local error.
    pub error: Difference,
    /// Largest jump between intervals or violation of a condition at the tip,
    /// relative to lengths, radians, and the forces and moments of each rod.
    pub defect: f64,
    /// Ends of the intervals as fractions of the length, from 0 to 1.
    pub intervals: Vec<f64>,
    /// Decimal logarithm of the growth of perturbations from base to tip: the
    /// sum over the intervals.
    pub growth: f64,
    /// Smallest singular value of the condensed equations over the largest.
    pub condition: f64,
    /// The direction that belongs to it, where the equations are nearly singular.
    pub neutral: Option<Neutral>,
    /// Work done.
    pub work: Work,
}

/// Growth over an interval that is blamed for a failure, as a power of ten.
const TOO_MUCH_GROWTH: f64 = 5.0;

/// Why there is no solution.
#[derive(Clone, Debug, PartialEq)]
pub enum Reason {
    /// An initial-value problem grows out of all bounds before its interval ends.
    Unbounded {
        /// How far it went.
        sigma: f64,
    },
    /// Newton's method does not converge.
    NoConvergence {
        /// The last correction, relative.
        correction: f64,
        /// Decimal logarithm of the largest growth over one interval.
        growth: f64,
    },
    /// The equations are singular.
    Singular(Neutral),
    /// So many intervals as are needed take too much memory.
    TooMuch(TooMuch),
}

impl From<TooMuch> for Reason {
    fn from(too_much: TooMuch) -> Self {
        Reason::TooMuch(too_much)
    }
}

impl From<Unbounded> for Reason {
    fn from(Unbounded { sigma }: Unbounded) -> Self {
        Reason::Unbounded { sigma }
    }
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Reason::Unbounded { sigma } => write!(
                f,
                "integrated from the start, the leaf grows out of all bounds at {sigma:.3} of its length: use more intervals"
            ),
            Reason::NoConvergence { correction, growth } if *growth > TOO_MUCH_GROWTH => write!(
                f,
                "Newton's method stops at corrections of {correction:.1e}; perturbations grow 10^{growth:.0} times over an interval: use more intervals"
            ),
            Reason::NoConvergence { correction, .. } => write!(
                f,
                "Newton's method stops at corrections of {correction:.1e}: lower the load, or start from the relaxed leaf"
            ),
            Reason::Singular(neutral) => write!(
                f,
                "the equations are singular (ratio of singular values {:.1e}): {neutral}",
                neutral.ratio
            ),
            Reason::TooMuch(too_much) => too_much.fmt(f),
        }
    }
}

/// What the direction means, in words.
impl fmt::Display for Neutral {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let longer = |a: DVec3, b: &DVec3| if b.length() > a.length() { *b } else { a };
        let largest: Vec<DVec3> = (self.displacement.iter())
            .map(|rod| rod.iter().fold(DVec3::ZERO, longer))
            .collect();
        let veins: Vec<String> = (largest.iter().enumerate())
            .filter(|(_, moved)| moved.length() > MOVES)
            .map(|(j, _)| (j + 1).to_string())
            .collect();
        let who = match veins.as_slice() {
            all if all.len() == largest.len() && all.len() > 1 => "all veins".to_string(),
            [one] => format!("vein {one}"),
            several => format!("veins {}", several.join(", ")),
        };
        let sum: DVec3 = largest.iter().map(|moved| *moved * *moved).sum();
        let axis = ["x", "y", "z"][sum.max_position()];
        write!(
            f,
            "a bifurcation is near, or the leaf can move without resistance; {who} would move, mostly along {axis}"
        )
    }
}

/// A solution that was not found.
#[derive(Clone, Debug)]
pub struct Failure {
    /// Why.
    pub reason: Reason,
    /// How much of the change from the arcs' leaf to the scenario's was made.
    pub part: f64,
    /// The last shape that was reached, at the stations.
    pub rods: Vec<RodShape>,
    /// Work done.
    pub work: Work,
}
