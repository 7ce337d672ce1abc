//! Which leaf is to come to rest, how accurately, on which grids, and what that has cost so far.

use crate::leaf::{Leaf, Loads};
use crate::relax::path::{Path, Route};
use crate::relax::request::{Method, Options, SemiImplicit};

/// Segments of the coarsest grid, in two panels or more if profiles have kinks.
pub const COARSEST: usize = 8;

/// The smallest tolerance for which the first grid is tried alone: below it nodes would be too
/// few for stations between them.
pub(super) const SMALLEST_SINGLE_GRID_TOLERANCE: f64 = 5e-7;

/// Largest number of corrections by the estimated error.
pub(super) const CORRECTIONS: usize = 4;

/// The leaf that is to come to rest, and how.
#[derive(Clone, Copy)]
pub struct RelaxationProblem<'a> {
    pub leaf: &'a Leaf,
    /// The full leaf, if `leaf` is half of it.
    pub whole_leaf: Option<&'a Leaf>,
    pub options: &'a Options,
    pub tolerance: f64,
    /// Whether only the shape and its stability are requested, without forces on the grids,
    /// eigenvalues or derivatives.
    pub shape_alone: bool,
    /// Whether to tell that the rods stay in their plane, as nothing acts out of it.
    pub planar: bool,
    /// Whether it fails where the leaf would have to leave the valley of its initial guess.
    pub stays_in_valley: bool,
}

impl<'a> RelaxationProblem<'a> {
    /// The leaf with forces and eigenvalues, wherever it comes to rest.
    pub fn new(leaf: &'a Leaf, options: &'a Options, tolerance: f64) -> Self {
        RelaxationProblem {
            leaf,
            whole_leaf: None,
            options,
            tolerance,
            shape_alone: false,
            planar: false,
            stays_in_valley: false,
        }
    }

    /// The same for the half of the leaf, if there is one.
    pub fn reduced_to_half(self, half: Option<&'a Leaf>) -> Self {
        match half {
            None => self,
            Some(half) => RelaxationProblem {
                leaf: half,
                whole_leaf: Some(self.leaf),
                ..self
            },
        }
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

    /// Whether the leaf is loaded slowly, rather than released.
    pub fn loads_slowly(&self) -> bool {
        let disturbed = |how: SemiImplicit| how.keep_unstable || how.disturbance.is_some();
        let released = match self.options.method {
            Method::SemiImplicit(how) => disturbed(how),
            _ => false,
        };
        // What is held is moved to its holder by a method of its own; without loads hinges turn freely.
        self.options.route == Route::LoadedLeaf
            && !released
            && !self.leaf.has_placed_supports()
            && !self.leaf.hinged()
            && self.leaf.loads != Loads::default()
            && !self.leaf.loads.has_moments()
    }

    /// Whether a leaf that was released may be loaded slowly.
    pub fn may_be_loaded_instead(&self) -> bool {
        let settles = matches!(
            self.options.method,
            Method::SemiImplicit(how) if !how.keep_unstable && how.disturbance.is_none()
        );
        settles
            && self.options.route == Route::LoadedLeaf
            && !self.leaf.has_placed_supports()
            && !self.leaf.hinged()
            && !self.leaf.loads.has_moments()
            && !self.out_of_time()
    }

    /// The path of the leaf as far as nothing happens on it, if it has one.
    pub fn undisturbed_path(&self) -> Option<Path> {
        if self.loads_slowly() {
            return Some(Path::STABLE);
        }
        let released = self.options.route == Route::Release && !self.keeps_unstable();
        let moved = self.leaf.has_placed_supports() || self.leaf.loads.has_moments();
        (released && !moved).then_some(Path::Released)
    }

    /// The largest number of corrections.
    pub fn corrections(&self) -> usize {
        let grids = matches!(self.options.method, Method::SemiImplicit(_));
        let free = !self.leaf.has_placed_supports() && self.segments().is_none();
        match grids && free && self.shape_alone {
            true => CORRECTIONS,
            false => 0,
        }
    }

    /// Whether the first grid may be enough.
    pub fn may_use_single_grid(&self) -> bool {
        self.corrections() > 0 && self.tolerance >= SMALLEST_SINGLE_GRID_TOLERANCE
    }
}

/// Limit on nodes times force evaluations for a leaf to come to rest: some seconds.
pub const BUDGET: usize = 10_000_000;

/// Segments of the finest grid.
pub const FINEST: usize = 16_384;

/// Segments of the coarsest grid for a loose tolerance: if it is at least [`LOOSE`] or only
/// the shape is requested (forces and eigenvalues have larger errors), and the leaf settles in
/// the valley it starts in.
pub(super) const COARSEST_LOOSE_GRID: usize = 4;

pub(super) const LOOSE_TOLERANCE: f64 = 1e-3;

/// Whether the method may settle in the valley it starts in: semi-implicit, free to leave
/// saddles, and not disturbed.
pub(super) fn may_keep_start_valley(method: Method) -> bool {
    matches!(method, Method::SemiImplicit(how) if !how.keep_unstable && how.disturbance.is_none())
}

/// Whether half of a leaf may be solved in place of the whole.
pub fn may_solve_half(method: Method) -> bool {
    may_keep_start_valley(method) && matches!(method, Method::SemiImplicit(how) if !how.full_model)
}

/// Segments of the coarsest grid, unless a leaf needs more.
pub fn least_segments(method: Method, tolerance: f64, shape_alone: bool) -> usize {
    let loose = shape_alone || tolerance >= LOOSE_TOLERANCE;
    match may_keep_start_valley(method) && loose {
        true => COARSEST_LOOSE_GRID,
        false => COARSEST,
    }
}
