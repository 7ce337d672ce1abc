//! The plan of a relaxation: which attempts are made to bring a leaf to rest, in which order, by which
//! rule each is accepted, on which grids and with how much work.
//!
//! The equilibrium that is asked for is that of slow loading ([`Path`](crate::relax::path::Path)), or
//! that of a release from arcs. The first is often known without loading the leaf slowly: where
//! Newton's method leads from arcs to rest through convex states only, nearby, and the veins take their
//! loads stably, slow loading leads there too. Half of a symmetric leaf stands for the whole as long as
//! that is stable.

use crate::leaf::{DiscreteLeaf, Leaf, Loads};
use crate::relax::accuracy::transfer::GridLevel;
use crate::relax::log::{Extent, Strategy};
use crate::relax::path::{LoadOrder, Path, Route};
use crate::relax::request::{Method, Options, SemiImplicit};

/// The coarsest and the finest grids on which a leaf is brought to rest, in segments a vein.
pub(super) struct GridLimits {
    /// The coarsest grid of a relaxation and of slow loading, in two panels or more if profiles have
    /// kinks. Twice as many double the work for a tolerance that the first grids keep.
    pub coarsest: usize,
    /// The coarsest grid where the tolerance is loose or only the shape is requested, as forces and
    /// eigenvalues have larger errors, of a leaf that comes to rest in the valley it starts in.
    pub coarsest_of_shape: usize,
    /// The coarsest grid of a blade, which is narrow at its tip: with half as many two error bars of 86
    /// were too low by a factor of two. It is loaded slowly on half as many.
    pub coarsest_of_blade: usize,
    /// The finest grid on which slow loading is repeated until two grids lead to one equilibrium. Twice
    /// as many double the time after which a loading that no two grids confirm is given up.
    pub finest_of_loading: usize,
    /// The finest of the coarser grids that are tried where a followed leaf finds no equilibrium: folds
    /// lie elsewhere on each of them.
    pub finest_of_tracking: usize,
    /// The finest grid from whose start a leaf that moves far is released until two grids lead to one
    /// equilibrium.
    pub finest_of_release: usize,
    /// The finest grid from whose start an equilibrium of any index is sought by Newton's method alone, unless the
    /// bending needs more segments: on the leaves of Figs 8 and 9, where three grids lead to none, none up to 1024
    /// segments did, in a minute.
    pub finest_of_any_index: usize,
    /// The finest grid on which an equilibrium that was not found by relaxation is looked for first.
    pub finest_of_given_equilibrium: usize,
    /// The finest grid that is tried where coarser ones do not resolve the bending.
    pub finest_resolving: usize,
    /// The finest grid of a relaxation. Twice as many allow tolerances a quarter as large, as far as
    /// rounding does.
    pub finest: usize,
}

pub(super) const GRIDS: GridLimits = GridLimits {
    coarsest: 8,
    coarsest_of_shape: 4,
    coarsest_of_blade: 16,
    finest_of_loading: 64,
    finest_of_tracking: 128,
    finest_of_release: 256,
    finest_of_any_index: 32,
    finest_of_given_equilibrium: 1024,
    finest_resolving: 2048,
    finest: 16_384,
};

/// Limits on the work for one leaf. Twice as much doubles the time after which a leaf that does not
/// come to rest is given up.
pub(super) struct WorkLimits {
    /// Nodes times force evaluations of a relaxation: some seconds.
    pub node_evaluations: usize,
    /// Force evaluations that any leaf may use on a coarse grid, of at most `coarse_segments`
    /// segments, whatever was spent before; on finer ones inversely proportional to the segments, but
    /// no fewer than `guaranteed_on_any_grid`.
    pub guaranteed: usize,
    pub guaranteed_on_any_grid: usize,
    pub coarse_segments: usize,
    /// Force evaluations of slow loading on a grid: it typically takes a dozen, and a few hundred for
    /// each loss of stability.
    pub loading_evaluations: usize,
    /// Nodes times force evaluations of slow loading on all grids.
    pub loading_node_evaluations: usize,
    /// Nodes times steps of the explicit method: some ten seconds.
    pub explicit_node_steps: usize,
    /// A node of a leaf with tissue counts as so many of one without in a relaxation: with its sparse matrix it takes
    /// some 25 times as long as those of veins that are solved for one by one.
    pub tissue_node: usize,
}

impl WorkLimits {
    /// The nodes of a leaf on a grid, as relaxations count them.
    pub fn nodes(&self, leaf: &DiscreteLeaf) -> usize {
        let each = match leaf.has_tissue() {
            true => self.tissue_node,
            false => 1,
        };
        each * leaf.rods() * leaf.segments()
    }
}

pub(super) const WORK: WorkLimits = WorkLimits {
    node_evaluations: 10_000_000,
    guaranteed: 600,
    guaranteed_on_any_grid: 100,
    coarse_segments: 64,
    loading_evaluations: 2500,
    loading_node_evaluations: 10_000_000 / 8,
    explicit_node_steps: 600_000_000,
    tissue_node: 8,
};

/// Limits on the unknowns, six a node, of grids on which eigenvalues are computed. Time and memory grow
/// in proportion.
pub(super) struct UnknownLimits {
    /// Grids on which eigenvalues take about as long as a relaxation: those of a stable leaf are computed
    /// on no others if there are two, and only theirs, or those on the coarsest grid, are differentiated.
    pub quick: usize,
    /// The finest grid for eigenvalues without the shapes of their modes: about a second.
    pub without_shapes: usize,
    /// Grids that are added for the accuracy of eigenvalues.
    pub added: usize,
}

pub(super) const UNKNOWNS: UnknownLimits = UnknownLimits {
    quick: 4_000,
    without_shapes: 20_000,
    added: 200_000,
};

/// The smallest tolerance for which the first grid is tried alone: below it nodes would be too
/// few for stations between them.
const SMALLEST_SINGLE_GRID_TOLERANCE: f64 = 5e-7;

/// Largest number of corrections of a leaf by its estimated error.
const CORRECTIONS: usize = 4;

/// Where a leaf may go from its initial guess.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ValleyPolicy {
    /// Into another valley of its energy: saddles are left.
    MayLeave,
    /// It fails where it would have to leave the valley of its initial guess.
    Stay,
    /// It also fails where it rests with a negative eigenvalue, whatever that is worth: the leaf
    /// follows its branch of stable equilibria.
    StayOnBranch,
}

/// The leaf that is to come to rest, and how.
#[derive(Clone, Copy)]
pub struct RelaxationProblem<'a> {
    pub leaf: &'a Leaf,
    /// The full leaf, if `leaf` is half of it.
    pub whole_leaf: Option<&'a Leaf>,
    pub options: &'a Options,
    /// Requested error of positions, in lengths of the leaf.
    pub tolerance: f64,
    /// Whether only the shape and its stability are requested, without forces on the grids,
    /// eigenvalues or derivatives.
    pub shape_alone: bool,
    /// Whether to tell that the rods stay in their plane, as nothing acts out of it.
    pub planar: bool,
    /// Where the leaf may go from its initial guess.
    pub valley: ValleyPolicy,
    /// The whole leaf at rest under the loads that have a potential, from which the others grow; `None`: they
    /// grow from where a release from arcs leads.
    pub loaded_start: Option<&'a GridLevel>,
    /// When loads without a potential grow.
    pub load_order: LoadOrder,
}

impl<'a> RelaxationProblem<'a> {
    /// The problem of a leaf with forces and eigenvalues, wherever it comes to rest.
    pub fn new(leaf: &'a Leaf, options: &'a Options, tolerance: f64) -> Self {
        RelaxationProblem {
            leaf,
            whole_leaf: None,
            options,
            tolerance,
            shape_alone: false,
            planar: false,
            valley: ValleyPolicy::MayLeave,
            loaded_start: None,
            load_order: LoadOrder::default(),
        }
    }

    /// The problem for the half of the leaf, if there is one.
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

    /// Whether a saddle is a result, and not left.
    pub fn keeps_unstable(&self) -> bool {
        matches!(self.options.method, Method::SemiImplicit(how) if how.keep_unstable)
    }

    /// Whether the time limit is reached or the run is cancelled.
    pub fn out_of_time(&self) -> bool {
        self.options.limit.reached()
    }

    /// Whether a grid is so coarse that it only serves leaves that come to rest in the valley they
    /// start in.
    pub fn too_coarse(&self, segments: usize) -> bool {
        self.segments().is_none() && segments < GRIDS.coarsest
    }

    /// Whether the leaf is loaded slowly, rather than released.
    pub fn loads_slowly(&self) -> bool {
        self.may_load_slowly() && self.leaf.loads != Loads::default() && self.leaf.has_potential()
    }

    /// Whether loads without a potential grow on a leaf that was first loaded slowly with the others.
    pub fn grows_from_slow_loading(&self) -> bool {
        let grows = self.leaf.loads.has_followers() || self.leaf.in_wind();
        self.may_load_slowly() && grows
    }

    /// Whether loads without a potential may also grow before the others.
    fn may_load_in_other_order(&self) -> bool {
        may_keep_start_valley(self.options.method)
            && self.options.route == Route::Loading
            && self.leaf.loads.has_followers()
    }

    /// Whether slow loading is asked for, and possible for this leaf.
    fn may_load_slowly(&self) -> bool {
        let disturbed = |how: SemiImplicit| how.keep_unstable || how.disturbance.is_some();
        let released = match self.options.method {
            Method::SemiImplicit(how) => disturbed(how),
            _ => false,
        };
        // What is held is moved to its holder by a method of its own; without loads leaves turn on hinges.
        self.options.route == Route::Loading
            && !released
            && !self.leaf.has_placed_supports()
            && !self.leaf.turns_freely()
    }

    /// Whether a leaf that was released may be loaded slowly.
    pub fn may_be_loaded_instead(&self) -> bool {
        let settles = matches!(
            self.options.method,
            Method::SemiImplicit(how) if !how.keep_unstable && how.disturbance.is_none()
        );
        settles
            && self.options.route == Route::Loading
            && !self.leaf.has_placed_supports()
            && !self.leaf.turns_freely()
            && self.leaf.has_potential()
            && !self.out_of_time()
    }

    /// The path of the leaf as far as nothing happens on it, if it has one.
    pub fn undisturbed_path(&self) -> Option<Path> {
        if self.loads_slowly() {
            return Some(Path::STABLE);
        }
        let released = self.options.route == Route::Release && !self.keeps_unstable();
        let moved = self.leaf.has_placed_supports() || !self.leaf.has_load_potential();
        (released && !moved).then_some(Path::Released)
    }

    /// How often the leaf may be corrected by its estimated error.
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

/// From this tolerance on a leaf may begin on the coarsest grid for its shape alone.
const LOOSE_TOLERANCE: f64 = 1e-3;

/// Whether a leaf may come to rest in the valley it starts in by this method: semi-implicit, free to leave
/// saddles, and not disturbed.
fn may_keep_start_valley(method: Method) -> bool {
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
        true => GRIDS.coarsest_of_shape,
        false => GRIDS.coarsest,
    }
}

/// Smallest compliance (units of L^2/A) of a leaf that moves with its strain energy. A stiffer
/// one is first brought to rest with this compliance, which also gives its segment forces, and then
/// with its own.
const MOVING_COMPLIANCE: f64 = 2e-3;

/// Approximate largest stretch of a softened leaf by its load.
const MOVING_STRETCH: f64 = 0.05;

/// By which rule the equilibrium of an attempt is accepted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Acceptance {
    /// Slow loading leads there: it is stable and near the arcs, and the veins take their loads stably.
    EndOfLoading,
    /// It is stable, wherever that is.
    Stable,
    /// It is at rest, stable or not.
    AtRest,
}

/// How far an equilibrium is from the start of the iteration that led there.
#[derive(Clone, Copy, Debug)]
pub struct WayFromStart {
    /// Largest displacement (lengths) or rotation (radians) of a node.
    pub distance: f64,
    /// Accepted steps of the iteration that led there.
    pub steps: usize,
}

/// A leaf that rests so near to the arcs from which it starts, after so few steps of Newton's method
/// without softened rods, rests where slow loading leads, stably if its veins take their loads stably:
/// so did all of 5000 random leaves. Those of up to 3 lengths that ended elsewhere had taken 20 steps
/// and more; of stiff leaves, which are softened on their way from arcs, 3 in 1000 end elsewhere.
pub(super) const LONGEST_WAY_IN_FIRST_VALLEY: WayFromStart = WayFromStart {
    distance: 2.0,
    steps: 8,
};

/// An attempt that is planned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlannedAttempt {
    pub strategy: Strategy,
    pub extent: Extent,
    /// Segments of the first grid of the attempt.
    pub segments: usize,
    pub acceptance: Acceptance,
    /// Whether it is made only before the time limit.
    pub needs_time: bool,
}

/// The attempts for a leaf whose first grid has `segments` segments, in their order: each is made if
/// none before was accepted.
pub fn plan(problem: &RelaxationProblem, has_half: bool, segments: usize) -> Vec<PlannedAttempt> {
    let extent = match has_half {
        true => Extent::Half,
        false => Extent::Whole,
    };
    let first_valley = PlannedAttempt {
        strategy: Strategy::FirstValley,
        extent,
        segments,
        acceptance: Acceptance::EndOfLoading,
        needs_time: false,
    };
    let loading = PlannedAttempt {
        strategy: Strategy::SlowLoading,
        acceptance: Acceptance::AtRest,
        ..first_valley
    };
    let release = PlannedAttempt {
        strategy: Strategy::Release,
        extent: Extent::Whole,
        ..loading
    };
    if problem.loads_slowly() {
        // A stiff leaf is softened on its way from arcs: that may lead elsewhere.
        let convex =
            matches!(problem.options.method, Method::SemiImplicit(_)) && !softens(problem.leaf);
        let from_arcs = PlannedAttempt {
            segments: problem.segments().unwrap_or(GRIDS.coarsest),
            needs_time: true,
            ..release
        };
        let mut attempts = vec![loading, from_arcs];
        if convex {
            attempts.insert(0, first_valley);
        }
        return attempts;
    }
    let mut attempts = vec![release];
    if has_half {
        attempts.insert(
            0,
            PlannedAttempt {
                extent,
                acceptance: Acceptance::Stable,
                ..release
            },
        );
    }
    if problem.may_load_in_other_order() {
        attempts.push(PlannedAttempt {
            strategy: Strategy::OtherLoadOrder,
            needs_time: true,
            ..release
        });
    }
    if problem.may_be_loaded_instead() {
        attempts.push(PlannedAttempt {
            extent: Extent::Whole,
            needs_time: true,
            ..loading
        });
    }
    attempts
}

/// The least compliance of a leaf that moves after so many pushes off saddles.
pub(super) fn moving_compliance(leaf: &Leaf, pushes: i32) -> f64 {
    let load = leaf.loads.tip_force.length() + leaf.loads.gravity.length();
    (MOVING_COMPLIANCE * 0.1_f64.powi(pushes)).min(MOVING_STRETCH / load)
}

/// Whether a leaf is so stiff that it is softened while it moves.
fn softens(leaf: &Leaf) -> bool {
    let compliance = (0..leaf.rods()).map(|j| leaf.section(j, 0.5, 1.0).compliance.min_element());
    compliance.fold(f64::INFINITY, f64::min) < moving_compliance(leaf, 0)
}
