//! A run over nested grids: what is asked, the grids the leaf has settled on,
//! and the error estimate of their extrapolation.

use crate::leaf::{DiscreteLeaf, Leaf, System, whole_fields};
use crate::newton::{Contraction, Work};
use crate::relax::defect::{self, Estimate, Linear};
use crate::relax::level::{Level, complete, positions};
use crate::relax::method::Method;
use crate::relax::options::{Options, Progress};
use crate::relax::richardson::Richardson;
use crate::relax::saddle::Saddle;
use glam::DVec3;

/// Segments of the coarsest grid, in two panels or more if profiles have kinks.
pub const COARSEST: usize = 8;

/// Growth of errors of single grids by extrapolation, sum of the weights at most.
const EXTRAPOLATED: f64 = 2.0;

/// Safety factor on the error estimated from the defect of the extrapolated leaf.
const SAFETY: f64 = 2.0;

/// It is at most so many times the error estimated from the last extrapolation: the response
/// of a neutral mode to rounding is no error.
const LARGEST: f64 = 10.0;

/// Where the last extrapolation changed the leaf by so many times the tolerance the defect is
/// not computed: it would hardly be small enough.
const OUT_OF_REACH: f64 = 3e3;

/// How often the estimated error is subtracted, at most, and the part that remains at best.
const CORRECTIONS: usize = 4;
const CORRECTED: f64 = 1e-2;

/// Of a leaf with more nodes than this no equations are kept while others are solved: less
/// memory for a factorisation more of a coarse grid.
const MANY_NODES: usize = 50_000;

/// Part of the rounding error that grows with the number of segments.
const ROUNDING: f64 = 4e-15;

/// Nodes times force evaluations after which a leaf that has not come to rest
/// is given up: some seconds.
pub const BUDGET: usize = 4_000_000;

/// What is asked, and what was found so far.
pub struct Run<'a, 'o> {
    pub leaf: &'a Leaf,
    /// The leaf with all of its unknowns, if `leaf` is half of it or in its plane.
    pub whole: Option<&'a Leaf>,
    /// Rods solved for.
    pub solved: usize,
    /// Whether in their plane.
    pub planar: bool,
    /// What neglecting shear, and stretch, would change.
    pub effects: [Option<f64>; 2],
    pub options: &'o Options,
    pub tolerance: f64,
    /// Whether nothing but the shape and its stability is asked for: forces on the grids,
    /// eigenvalues and derivatives are not.
    pub shape_alone: bool,
    pub progress: &'o mut dyn FnMut(&Progress),
    pub work: Work,
    pub saddle: Option<Saddle>,
    pub levels: Vec<Level>,
    pub table: Richardson,
    /// The error estimated from the defect of the best values, if it is known, and the linear
    /// equations for it.
    pub estimate: Option<Estimate>,
    pub linear: Option<Linear>,
    /// Room for the equations of the grid that was settled on last.
    pub room: Option<System>,
    /// Whether a grid was added for the nodes of the finest one.
    pub for_nodes: bool,
    pub index: Option<usize>,
    /// Whether the lowest eigenvalue is clearly positive.
    pub clearly: bool,
    /// Largest iteration error left on any grid.
    pub remaining: f64,
    /// Of Newton's method on the grids so far.
    pub contraction: Contraction,
    /// Nodes times force evaluations so far.
    pub spent: usize,
    /// Saddles left that were only noticed by their index.
    pub pushes: i32,
    /// Whether the leaf did not come to rest in a first attempt.
    pub by_steps: bool,
    /// Whether it had to move while it was softer than it is.
    pub moved_softened: bool,
    /// Part of the loads under which it then came to rest.
    pub part: f64,
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
            planar: leaf.planar(),
            effects: [None; 2],
            options,
            tolerance,
            shape_alone: false,
            progress,
            work: Work::default(),
            saddle: None,
            levels: Vec::new(),
            table: Richardson::default(),
            estimate: None,
            linear: None,
            room: None,
            for_nodes: false,
            index: None,
            clearly: false,
            remaining: 0.0,
            contraction: Contraction::default(),
            spent: 0,
            pushes: 0,
            by_steps: false,
            moved_softened: false,
            part: 0.0,
        }
    }

    /// Forgets all grids, to begin anew by steps of loads and stiffness.
    pub fn begin_by_steps(&mut self) {
        if !self.by_steps {
            self.spent = BUDGET / 2;
        }
        self.by_steps = true;
        self.begin_anew();
    }

    /// Forgets all grids and what was found on them.
    pub fn begin_anew(&mut self) {
        self.moved_softened = false;
        self.saddle = None;
        self.levels.clear();
        self.tabulate();
        self.effects = [None; 2];
        self.index = None;
        self.remaining = 0.0;
        self.contraction = Contraction::default();
        self.pushes = 0;
    }

    /// The run as if it had been one of the whole leaf.
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
        (self.linear, self.room) = (None, None);
        Run { estimate, ..self }
    }

    /// Segments of the only grid, if there is to be one.
    pub fn segments(&self) -> Option<usize> {
        self.options.method.segments()
    }

    /// Whether an unstable equilibrium is wanted as much as a stable one.
    pub fn keeps_unstable(&self) -> bool {
        matches!(self.options.method, Method::SemiImplicit(how) if how.keep_unstable)
    }

    /// Whether a leaf that did not come to rest gets a second attempt.
    pub fn may_go_by_steps(&self) -> bool {
        let settles =
            matches!(self.options.method, Method::SemiImplicit(how) if !how.keep_unstable);
        // A tip that is held is led to its place by steps already.
        let free = self.leaf.held.is_none() && self.leaf.loads.tip_moment == DVec3::ZERO;
        settles && free && !self.late()
    }

    /// Whether the time allowed is over.
    pub fn late(&self) -> bool {
        self.options.limit.reached()
    }

    /// Estimate of the error of the best values, relative to the leaf's length:
    /// of the extrapolation, of unfinished iterations, and of rounding.
    pub fn error(&self) -> Option<f64> {
        let segments = self.levels.last()?.leaf.segments();
        let best = self.table.best()?.error;
        let extrapolation = match &self.estimate {
            // The errors of unfinished iterations are corrected with the others.
            Some(estimate) if estimate.corrections > 0 => {
                let segments = self.levels[0].leaf.segments() as f64;
                return Some(SAFETY * estimate.largest() + ROUNDING * segments);
            }
            // Where nodes are few the midpoints are stations, too.
            Some(estimate) if self.too_coarse(self.levels[0].leaf.segments()) => {
                (SAFETY * estimate.largest()).min(LARGEST * best)
            }
            Some(estimate) => (SAFETY * estimate.at_nodes).min(LARGEST * best),
            None => best,
        };
        Some(extrapolation + self.unfinished(segments))
    }

    /// Error of unfinished iterations and of rounding on a grid of so many segments.
    fn unfinished(&self, segments: usize) -> f64 {
        EXTRAPOLATED * self.remaining + ROUNDING * segments as f64
    }

    /// The leaf integrated to the nodes of the finest grid, or of a finer one if it was
    /// corrected, and its error, if that is within the tolerance.
    pub fn integrated(&self) -> Option<(&Estimate, f64)> {
        let (estimate, segments) = (self.estimate.as_ref()?, self.levels.last()?.leaf.segments());
        let error = match estimate.corrections {
            0 => SAFETY * estimate.largest() + self.unfinished(segments),
            _ => self.error()?,
        };
        (error <= self.tolerance || estimate.corrections > 0).then_some((estimate, error))
    }

    /// The integrated leaf, if its error was corrected.
    pub fn corrected(&self) -> Option<&Estimate> {
        self.estimate
            .as_ref()
            .filter(|estimate| estimate.corrections > 0)
    }

    /// How often the error may be corrected.
    fn corrections(&self) -> usize {
        let grids = matches!(self.options.method, Method::SemiImplicit(_));
        let free = self.leaf.held.is_none() && self.segments().is_none();
        match grids && free && self.shape_alone {
            true => CORRECTIONS,
            false => 0,
        }
    }

    /// Estimates the error of the best values from their defect, and corrects it if that
    /// makes them accurate enough.
    pub fn judge_accuracy(&mut self) {
        let most = self.corrections();
        let farthest = OUT_OF_REACH * CORRECTED.powi(-(most as i32));
        let best = self.table.best();
        let near = best.filter(|best| best.error <= farthest * self.tolerance);
        let enough = (self.tolerance / SAFETY - ROUNDING * COARSEST as f64, most);
        let (levels, linear, work) = (&self.levels, &mut self.linear, &mut self.work);
        self.estimate =
            near.and_then(|best| defect::estimate(levels, best.columns, enough, linear, work));
        if (self.levels.last()).is_some_and(|level| is_large(&level.leaf)) {
            self.linear = None;
        }
    }

    /// Whether unfinished iterations and rounding alone are more than the
    /// tolerance on a grid of so many `segments`, and already on the present one
    /// most of the error: no refinement helps then.
    pub fn beyond_rounding(&self, segments: usize) -> bool {
        let floor = self.unfinished(segments);
        floor > self.tolerance && self.error().is_some_and(|error| error <= 2.0 * floor)
    }

    /// Whether a grid is one for leaves only that settle where they start.
    pub fn too_coarse(&self, segments: usize) -> bool {
        self.segments().is_none() && segments < COARSEST
    }

    /// Adds the next finer grid.
    pub fn push(&mut self, level: Level) {
        self.levels.push(level);
        self.tabulate();
    }

    /// Tabulates the positions on all grids, and forgets estimates made before.
    pub fn tabulate(&mut self) {
        let mut table = Richardson::default();
        for level in &self.levels {
            let segments = level.leaf.segments();
            let stride = segments / self.levels[0].leaf.segments();
            table.push(segments, positions(level, stride));
        }
        self.table = table;
        self.estimate = None;
        if self.levels.len() < 2 {
            self.linear = None;
        }
    }
}

/// Whether the equations of a leaf fill much of the memory.
pub fn is_large(leaf: &DiscreteLeaf) -> bool {
    leaf.rods() * leaf.segments() > MANY_NODES
}
