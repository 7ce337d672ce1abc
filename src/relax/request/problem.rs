//! What is asked of nested grids: which leaf is to come to rest, and how accurately.

use crate::leaf::{Leaf, Loads};
use crate::relax::path::{Path, Route};
use crate::relax::request::method::{Method, SemiImplicit};
use crate::relax::request::options::Options;

/// Segments of the coarsest grid, in two panels or more if profiles have kinks.
pub const COARSEST: usize = 8;

/// The smallest tolerance for which the first grid is tried alone: below it nodes would be too
/// few for stations between them.
const LEAST_ALONE: f64 = 5e-7;

/// Largest number of corrections by the estimated error.
const CORRECTIONS: usize = 4;

/// The leaf that is to come to rest, and how.
#[derive(Clone, Copy)]
pub struct Problem<'a> {
    pub leaf: &'a Leaf,
    /// The full leaf, if `leaf` is half of it.
    pub whole: Option<&'a Leaf>,
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

impl<'a> Problem<'a> {
    /// The leaf with forces and eigenvalues, wherever it comes to rest.
    pub fn new(leaf: &'a Leaf, options: &'a Options, tolerance: f64) -> Self {
        Problem {
            leaf,
            whole: None,
            options,
            tolerance,
            shape_alone: false,
            planar: false,
            stays_in_valley: false,
        }
    }

    /// The same for the half of the leaf, if there is one.
    pub fn reduced(self, half: Option<&'a Leaf>) -> Self {
        match half {
            None => self,
            Some(half) => Problem {
                leaf: half,
                whole: Some(self.leaf),
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
        self.options.route == Route::Loading
            && !released
            && !self.leaf.is_held()
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
            && self.options.route == Route::Loading
            && !self.leaf.is_held()
            && !self.leaf.hinged()
            && !self.leaf.loads.has_moments()
            && !self.out_of_time()
    }

    /// The path of the leaf as far as nothing happens on it, if it has one.
    pub fn path(&self) -> Option<Path> {
        if self.loads_slowly() {
            return Some(Path::STABLE);
        }
        let released = self.options.route == Route::Release && !self.keeps_unstable();
        let moved = self.leaf.is_held() || self.leaf.loads.has_moments();
        (released && !moved).then_some(Path::Released)
    }

    /// The largest number of corrections.
    pub fn corrections(&self) -> usize {
        let grids = matches!(self.options.method, Method::SemiImplicit(_));
        let free = !self.leaf.is_held() && self.segments().is_none();
        match grids && free && self.shape_alone {
            true => CORRECTIONS,
            false => 0,
        }
    }

    /// Whether the first grid may be enough.
    pub fn may_be_alone(&self) -> bool {
        self.corrections() > 0 && self.tolerance >= LEAST_ALONE
    }
}
