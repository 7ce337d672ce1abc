//! A run over nested grids: its options, the grids on which the leaf has settled, and the
//! error estimate of their extrapolation.

mod error;

use crate::largest::larger;
use crate::leaf::{DiscreteLeaf, Leaf, Loads, System, whole_fields};
use crate::newton::{Contraction, Stop, Work};
use crate::relax::accuracy::defect::{Estimate, Linear};
use crate::relax::accuracy::richardson::Richardson;
use crate::relax::path::{Path, Route, Stage};
use crate::relax::request::method::{Method, SemiImplicit};
use crate::relax::request::options::{Options, Progress};
use crate::relax::saddle::Saddle;
use crate::relax::settle::methods::softens;
use crate::relax::transfer::level::{Level, complete, positions};
use glam::DVec3;

/// Segments of the coarsest grid, in two panels or more if profiles have kinks.
pub const COARSEST: usize = 8;

/// Amplification of errors on single grids by extrapolation: bound on the sum of the weights'
/// absolute values.
const EXTRAPOLATED: f64 = 2.0;

/// Safety factor on the error estimated from the defect of the extrapolated leaf.
const SAFETY: f64 = 2.0;

/// The least part of the largest error between the nodes of the coarsest grid that is taken
/// for the error at these nodes: where layers are thinner than its segments the linear
/// equations of a coarse grid are wrong by so much.
const LAYERS: f64 = 0.1;

/// Upper bound of that estimate in units of the error estimated from the last extrapolation:
/// the response of a neutral mode to rounding is not an error.
const LARGEST: f64 = 10.0;

/// If the error estimated by extrapolation exceeds the tolerance by this factor, the defect is
/// not computed: it would hardly be small enough.
const OUT_OF_REACH: f64 = 3e3;

/// The smallest tolerance for which the first grid is tried alone: below it nodes would be too
/// few for stations between them.
const LEAST_ALONE: f64 = 5e-7;

/// Largest number of corrections by the estimated error, and the part of the error that each
/// leaves at best.
const CORRECTIONS: usize = 4;
const CORRECTED: f64 = 1e-2;

/// For leaves with more nodes than this no equations are kept while others are solved, which
/// saves memory at the cost of another factorisation on a coarse grid.
const MANY_NODES: usize = 50_000;

/// A leaf that rests so near to the arcs from which it starts (lengths, radians), after so few
/// steps of Newton's method without softened rods, rests where slow loading leads: so did all of
/// 5000 random leaves. Those of up to 3 lengths that ended elsewhere had taken 20 steps and more;
/// of stiff leaves, which are softened on their way from arcs, 3 in 1000 end elsewhere.
const FIRST_VALLEY: (f64, usize) = (2.0, 8);

/// Changes of the energy below this part of it, or of the leaf's bending energy, are rounding.
const ENERGY_NOISE: f64 = 1e-11;

/// Rounding error per segment.
const ROUNDING: f64 = 4e-15;

/// Limit on nodes times force evaluations for a leaf to come to rest: some seconds.
pub const BUDGET: usize = 10_000_000;

/// The state of a run.
pub struct Run<'a, 'o> {
    pub leaf: &'a Leaf,
    /// The full leaf, if `leaf` is half of it.
    pub whole: Option<&'a Leaf>,
    /// Rods solved for.
    pub solved: usize,
    /// Whether to tell that they stay in their plane, as nothing acts out of it.
    pub planar: bool,
    /// Displacements that would follow from neglecting shear, and stretch.
    pub effects: [Option<f64>; 2],
    pub options: &'o Options,
    pub tolerance: f64,
    /// Whether only the shape and its stability are requested, without forces on the grids,
    /// eigenvalues or derivatives.
    pub shape_alone: bool,
    pub progress: &'o mut dyn FnMut(&Progress),
    pub work: Work,
    pub saddle: Option<Saddle>,
    pub levels: Vec<Level>,
    pub table: Richardson,
    /// The error of its best column where the energy converges otherwise than its order indicates:
    /// then layers are thinner than the segments, and what they change in positions, which is the
    /// same on all grids that miss them, is not seen in these.
    pub unresolved: f64,
    /// The error estimated from the defect of the extrapolated values, if it is known, and the
    /// linear equations for it.
    pub estimate: Option<Estimate>,
    pub linear: Option<Linear>,
    /// The linear system of the last grid, for reuse.
    pub spare_system: Option<System>,
    /// Whether a grid was added for the nodes of the finest one.
    pub added_for_nodes: bool,
    pub index: Option<usize>,
    /// Whether the lowest eigenvalue is clearly positive.
    pub clearly_stable: bool,
    /// Factor on the error estimate of a leaf that is beside a bifurcation: see
    /// [`Lowest::softening`](crate::relax::stability::eigenvalues::Lowest::softening).
    pub softening: f64,
    /// Largest remaining iteration error on any grid.
    pub remaining: f64,
    /// Convergence of Newton's method on the grids so far.
    pub contraction: Contraction,
    /// Nodes times force evaluations so far.
    pub spent: usize,
    /// Number of pushes off saddles at which the iteration had converged (found by their Morse
    /// index).
    pub pushes: i32,
    /// Whether it fails where the leaf would have to leave the valley of its initial guess.
    pub stays_in_valley: bool,
    /// How the leaf came to where it is, if that is known.
    pub path: Option<Path>,
    /// How far the leaf came on its path before it failed.
    pub reached: Option<(Stage, f64)>,
    /// Distance of the first equilibrium from the start (lengths, radians), and the steps that
    /// led there.
    pub from_start: Option<(f64, usize)>,
    /// Whether the leaf moved far from its start, and to no equilibrium on two grids.
    pub unconfirmed: bool,
    /// Nodes times force evaluations of all walks.
    pub walked: usize,
}

impl<'a, 'o> Run<'a, 'o> {
    /// A run that has not begun.
    pub fn new(
        leaf: &'a Leaf,
        options: &'o Options,
        tolerance: f64,
        progress: &'o mut dyn FnMut(&Progress),
    ) -> Self {
        Run {
            leaf,
            whole: None,
            solved: leaf.rods(),
            planar: false,
            effects: [None; 2],
            options,
            tolerance,
            shape_alone: false,
            progress,
            work: Work::default(),
            saddle: None,
            levels: Vec::new(),
            table: Richardson::default(),
            unresolved: 0.0,
            estimate: None,
            linear: None,
            spare_system: None,
            added_for_nodes: false,
            index: None,
            clearly_stable: false,
            softening: 1.0,
            remaining: 0.0,
            contraction: Contraction::default(),
            spent: 0,
            pushes: 0,
            stays_in_valley: false,
            path: None,
            reached: None,
            from_start: None,
            unconfirmed: false,
            walked: 0,
        }
    }

    /// The same run of another leaf, that reduced from the `whole` one or the whole itself, from
    /// the beginning; its work goes on being counted.
    pub fn of(mut self, leaf: &'a Leaf, whole: Option<&'a Leaf>) -> Self {
        (self.leaf, self.whole) = (leaf, whole);
        self.solved = leaf.rods();
        (self.linear, self.spare_system) = (None, None);
        (self.stays_in_valley, self.clearly_stable) = (false, false);
        self.restart();
        self
    }

    /// Whether a run ended at a stable equilibrium.
    pub fn is_answer(&self, end: &Result<bool, Stop>) -> bool {
        end.is_ok() && self.index == Some(0)
    }

    /// Whether the leaf is loaded slowly, rather than released.
    pub fn loads_slowly(&self) -> bool {
        let disturbed = |how: SemiImplicit| how.keep_unstable || how.disturbance.is_some();
        let released = match self.options.method {
            Method::SemiImplicit(how) => disturbed(how),
            _ => false,
        };
        // Held tips are moved to their holder by a method of their own.
        self.options.route == Route::Loading
            && !released
            && self.leaf.held.is_none()
            && self.leaf.loads != Loads::default()
            && self.leaf.loads.tip_moment == DVec3::ZERO
    }

    /// Whether a leaf that was released may be loaded slowly.
    pub fn may_be_loaded_instead(&self) -> bool {
        let settles = matches!(
            self.options.method,
            Method::SemiImplicit(how) if !how.keep_unstable && how.disturbance.is_none()
        );
        settles
            && self.options.route == Route::Loading
            && self.leaf.held.is_none()
            && self.leaf.loads.tip_moment == DVec3::ZERO
            && !self.out_of_time()
    }

    /// The path of a leaf that is released.
    pub fn released(&self) -> Option<Path> {
        let released = self.options.route == Route::Release && !self.keeps_unstable();
        let moved = self.leaf.held.is_some() || self.leaf.loads.tip_moment != DVec3::ZERO;
        (released && !moved).then_some(Path::Released)
    }

    /// Whether it may come to rest without being loaded in steps: its rods need not be softened.
    pub fn may_settle_at_once(&self) -> bool {
        matches!(self.options.method, Method::SemiImplicit(_)) && !softens(self.leaf)
    }

    /// Whether Newton's method alone came to rest from the start, so near that this is where
    /// slow loading leads.
    pub fn is_in_first_valley(&self) -> bool {
        let near = |&(distance, steps): &(f64, usize)| {
            distance < FIRST_VALLEY.0 && steps <= FIRST_VALLEY.1
        };
        self.from_start.as_ref().is_some_and(near) && self.saddle.is_none()
    }

    /// Discards all grids and the results on them.
    pub fn restart(&mut self) {
        self.saddle = None;
        self.levels.clear();
        self.tabulate();
        self.effects = [None; 2];
        self.index = None;
        self.softening = 1.0;
        self.remaining = 0.0;
        self.contraction = Contraction::default();
        self.pushes = 0;
        self.unconfirmed = false;
    }

    /// The run of a reduced leaf converted to one of the whole leaf.
    pub fn completed(mut self, whole: &'a Leaf) -> Self {
        let reduced = self.leaf;
        let complete = |level: &Level| complete(reduced, whole, level);
        self.levels = self.levels.iter().map(complete).collect();
        self.leaf = whole;
        self.whole = None;
        let estimate = self.estimate.take();
        let estimate = estimate.map(|half| Estimate {
            rods: whole_fields(reduced, half.rods),
            energy: half.energy * if reduced.in_half() { 2.0 } else { 1.0 },
            ..half
        });
        self.tabulate();
        // The equations are those of the reduced leaf.
        (self.linear, self.spare_system) = (None, None);
        Run { estimate, ..self }
    }

    /// Segments of the fixed grid, if there is one.
    pub fn segments(&self) -> Option<usize> {
        self.options.method.segments()
    }

    /// Whether unstable equilibria are accepted.
    pub fn keeps_unstable(&self) -> bool {
        matches!(self.options.method, Method::SemiImplicit(how) if how.keep_unstable)
    }

    /// Whether the time limit is reached or the run is cancelled.
    pub fn out_of_time(&self) -> bool {
        self.options.limit.reached()
    }

    /// Whether a grid is so coarse that it only serves leaves that settle in the valley they
    /// start in.
    pub fn too_coarse(&self, segments: usize) -> bool {
        self.segments().is_none() && segments < COARSEST
    }

    /// Adds the next finer grid.
    pub fn push(&mut self, level: Level) {
        self.levels.push(level);
        self.tabulate();
    }

    /// Tabulates the positions on all grids, and discards earlier estimates.
    pub fn tabulate(&mut self) {
        let on = |level: &Level| {
            let segments = level.leaf.segments();
            let stride = segments / self.levels[0].leaf.segments();
            (segments, positions(level, stride))
        };
        self.table = self.levels.iter().map(on).collect();
        let ordered = energies(&self.levels).ordered();
        self.unresolved = self.table.change_beyond(ordered);
        self.estimate = None;
        if self.levels.len() < 2 {
            self.linear = None;
        }
    }
}

/// The potential energies on all grids.
pub fn energies(levels: &[Level]) -> Richardson {
    let on = |level: &Level| (level.leaf.segments(), vec![level.leaf.energy(&level.state)]);
    let largest = (levels.iter()).map(|level| level.leaf.energy(&level.state).abs());
    let noise = ENERGY_NOISE * largest.fold(1.0, larger);
    levels
        .iter()
        .map(on)
        .collect::<Richardson>()
        .with_noise(noise)
}

/// Whether the equations of a leaf need much memory.
pub fn is_large(leaf: &DiscreteLeaf) -> bool {
    leaf.rods() * leaf.segments() > MANY_NODES
}
