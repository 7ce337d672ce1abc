//! From the leaf on nested grids to the result in the units of the scenario, at its own stations and at
//! others; with doubts about results that indicate wrong input.

use crate::leaf::{DiscreteLeaf, Grid, Leaf, RodFields, RodIntegrator};
use crate::natural::Natural;
use crate::newton::EquilibriumFailure;
use crate::numbers::larger;
use crate::relax::accuracy::fields::{
    KnownResultants, KnownSection, LeafSection, integrate_between_stations,
};
use crate::relax::accuracy::transfer::{GridLevel, NodalResultants, VeinStation, is_planar_level};
use crate::relax::accuracy::{IntegratedLeaf, NestedEquilibrium, transfer};
use crate::relax::path::{Event, Path, PathPosition, StabilityLoss, Stage};
use crate::relax::plan::RelaxationProblem;
use crate::relax::remark::{EquilibriumDoubt, EquilibriumRemark, RestObstacle, SpanHolder};
use crate::relax::result::forces::{Stresses, turned_from_wind};
use crate::relax::result::{Accuracy, BladeReport, Equilibrium, Model, Outcome, Shape, Stability};
use crate::rotation::{Pose, align_quaternion_sign};
use crate::scenario::{
    Grip, LARGEST_PLAUSIBLE_STRETCH, Profile, Rod, Scenario, Tissue, held_tip_out_of_reach,
    plausibility_warnings, probable_obstacle_to_rest,
};
use crate::shape::{
    Centerline, InterpolationWeights, NodeState, RodShape, STATION_TOLERANCE, Undulation,
    equally_spaced, interpolation_weights,
};
use glam::DVec3;

/// The outcome of a run, with what is to be said of it.
pub struct RunEnd {
    pub outcome: Outcome,
    pub remark: Option<EquilibriumRemark>,
}

impl RunEnd {
    pub fn new(outcome: Outcome, remark: impl Into<Option<EquilibriumRemark>>) -> Self {
        RunEnd {
            outcome,
            remark: remark.into(),
        }
    }
}

/// Assembles the result of a relaxation in the units of the scenario.
pub fn equilibrium(
    problem: &RelaxationProblem,
    found: &NestedEquilibrium,
    end: RunEnd,
    wall_seconds: f64,
) -> Equilibrium {
    let finest = found
        .levels
        .last()
        .expect("the grid it failed on, at least");
    let (scenario, scale) = (problem.leaf.scenario(), problem.leaf.scale);
    let error = found.error();
    let ResultStations {
        stations,
        rods,
        added_error,
    } = stations_of_result(problem, found, error.unwrap_or(0.0));
    let joined = problem.leaf.joined();
    debug_assert!(!joined || finest.state.tips_meet());
    let tips = rods.iter().take(if joined { 1 } else { rods.len() });
    let tips = tips.filter_map(|rod| rod.nodes.last());
    let error_estimate = error.map(|error| (error + added_error) * scale.length);
    let DrawnCenterlines { grid, lines } = centerlines(found, finest);
    let energy = found.energy();
    // Neither wind nor loads that turn with the section have a potential.
    let has_energy = !problem.leaf.in_wind() && !problem.leaf.loads.has_followers();
    let on_bases = found.base_reactions();
    let tip_force = |rod: &RodShape| rod.nodes.last().map_or(DVec3::ZERO, |n| n.rotation * n.n);
    let segments: Vec<usize> = found
        .levels
        .iter()
        .map(|level| level.leaf.segments())
        .collect();
    Equilibrium {
        scenario: scenario.name.clone(),
        method: problem.options.method,
        outcome: end.outcome,
        remark: end.remark,
        doubts: Vec::new(),
        rod_count: rods.len(),
        energy: has_energy.then_some(energy.value * scale.moment()),
        tips: tips.map(|node| node.position).collect(),
        tip_force_sum: rods.iter().map(tip_force).sum(),
        reaction: found.reaction(),
        grip_reactions: found.grip_reactions(),
        base_reactions: on_bases.each,
        base_reaction: Some(on_bases.all),
        stability: Stability {
            negative_eigenvalues: found.index,
            neutral_directions: neutral_directions(scenario, &rods),
            modes: None,
            mode_shapes: problem.options.mode_shapes,
            small_motions: None,
            saddle: found.history.saddle,
        },
        path: path_to_equilibrium(problem.leaf, found),
        sensitivities: None,
        margin: None,
        blade: BladeReport::of(scenario),
        stress: Stresses::of(scenario, &stations, &rods)
            .map(|it| it.with_grid_error(scenario, &stations, found)),
        undulation: Undulation::from_centerlines(
            scenario,
            &lines,
            &stations,
            &rods,
            error_estimate,
        ),
        model: Model::new(
            rods.len(),
            found.solved_rods,
            problem.planar && found.index == Some(0) && is_planar_level(finest),
            &segments,
            found.history.strain_effects.scaled(scale.length),
        ),
        accuracy: Accuracy {
            segments,
            intervals: None,
            tolerance: problem.tolerance,
            residual: Some(finest.leaf.residual(&finest.state)),
            error_estimate,
            energy_error: (energy.error.filter(|_| has_energy)).map(|error| error * scale.moment()),
        },
        attempts: Vec::new(),
        work: found.work,
        wall_seconds,
        shape: Shape {
            stations,
            rods,
            joined,
            curves: (lines.iter())
                .map(|line| line.iter().map(|pose| pose.position).collect())
                .collect(),
            curve_stations: grid.sigma().to_vec(),
        },
    }
}

/// Directions in which a leaf of this shape can move without resistance.
pub fn neutral_directions(scenario: &Scenario, rods: &[RodShape]) -> usize {
    scenario.neutral_directions(|j| rods[j].nodes.iter().map(|node| node.position))
}

/// How the leaf came to its equilibrium. What finer grids than that of slow loading make of its end
/// belongs to the path.
fn path_to_equilibrium(leaf: &Leaf, found: &NestedEquilibrium) -> Option<Path> {
    let mut path = found.path.clone()?;
    if let Path::Loaded { events, .. } | Path::Held { events } = &mut path
        && found.history.saddle.is_some()
    {
        events.push(Event {
            stage: match leaf.joined() && leaf.rods() > 1 {
                _ if leaf.has_placed_supports() => Stage::Moving,
                true => Stage::Joining,
                false => Stage::Loading,
            },
            part: 1.0,
            happening: StabilityLoss::Branched {
                equally_open: false,
                mode: None,
            },
        });
    }
    Some(path)
}

/// Segments of the coarsest grid from which on its nodes are enough stations for a result.
const LEAST_STATION_SEGMENTS: usize = 8;

/// The leaf at the stations of its result.
struct ResultStations {
    /// Places of the stations, as fractions of the length.
    stations: Vec<f64>,
    /// The rods there, in the units of the scenario.
    rods: Vec<RodShape>,
    /// The error of the positions in addition to that at the nodes of the coarsest grid, in lengths
    /// of the leaf.
    added_error: f64,
}

/// The leaf at the stations of its result, with this `error` at the nodes of the coarsest grid. The
/// stations are these nodes or, if they are few, those of the next grid, and all if every node is
/// requested: of a leaf that was integrated to the tolerance those of the integration, otherwise those
/// of the finest grid that keeps the tolerance between the nodes of the coarsest.
fn stations_of_result(
    problem: &RelaxationProblem,
    found: &NestedEquilibrium,
    error: f64,
) -> ResultStations {
    let (first, finest) = (
        &found.levels[0].leaf.grid,
        &found.levels[found.levels.len() - 1],
    );
    let (every_node, few) = (
        problem.options.every_node,
        first.segments() < LEAST_STATION_SEGMENTS,
    );
    let (grid, rods, added_error) = match found.integrated_leaf() {
        Some(IntegratedLeaf {
            estimate,
            error: integrated,
        }) => {
            let grid = match every_node {
                true => estimate.grid.clone(),
                false if few && estimate.grid != *first => first.refined(),
                false => first.clone(),
            };
            let stride = estimate.grid.segments() / grid.segments();
            let rod = |(j, rod): (usize, &Vec<RodFields>)| {
                // Quaternions have the signs of the finest grid.
                let mut q = finest.state.q[finest.state.base(j)];
                let node = |node: &RodFields| {
                    q = align_quaternion_sign(node.q, q);
                    RodFields {
                        q: q.normalize(),
                        ..*node
                    }
                };
                rod.iter().step_by(stride).map(node).collect()
            };
            let rods = estimate.rods.iter().enumerate().map(rod).collect();
            (grid, rods, (integrated - error).max(0.0))
        }
        None => {
            let wanted = match every_node {
                true => found.levels.len(),
                false => found.levels.len().min(1 + usize::from(few)),
            };
            let reached = found.finer_nodes(wanted);
            let grid = found.levels[reached.grid].leaf.grid.clone();
            (grid, reached.rods, reached.added_error)
        }
    };
    let leaf = problem.leaf;
    let resultants: Vec<_> = (found.levels.iter())
        .map(NodalResultants::on_level)
        .collect();
    let rod = |(j, rod): (usize, &Vec<RodFields>)| {
        let nodes = rod.iter().zip(grid.sigma());
        let nodes = nodes.map(|(fields, &sigma)| {
            let at = VeinStation { vein: j, sigma };
            let mut node = transfer::node_state_from_fields(leaf, at, fields);
            if resultants.iter().any(NodalResultants::include_tissue) {
                let stencils = found.stencils(sigma);
                let part = [0, 1].map(|which| {
                    found.extrapolated_value(|k, _| {
                        let [value, _] = &stencils[k];
                        value.value(|i| resultants[k].of_tissue(j, i)[which])
                    })
                });
                transfer::subtract_tissue_strain(leaf, at, part, &mut node);
            }
            node
        });
        RodShape {
            length: leaf.length(j) * leaf.scale.length,
            nodes: nodes.collect(),
        }
    };
    let rods = rods.iter().enumerate().map(rod).collect();
    ResultStations {
        stations: grid.sigma().to_vec(),
        rods,
        added_error,
    }
}

/// The centerlines that figures show, in the units of the scenario.
struct DrawnCenterlines<'f> {
    /// The grid at whose nodes they are given.
    grid: &'f Grid,
    lines: Vec<Centerline>,
}

/// The centerlines at all nodes of the finest grid or, for a corrected leaf, of the grid of
/// the integration.
fn centerlines<'f>(found: &'f NestedEquilibrium, finest: &'f GridLevel) -> DrawnCenterlines<'f> {
    let length = finest.leaf.leaf.scale.length;
    if let Some(estimate) = found.corrected_estimate() {
        let pose = |fields: &RodFields| Pose {
            position: fields.x * length,
            rotation: fields.q,
        };
        let line = |rod: &Vec<RodFields>| rod.iter().map(pose).collect();
        return DrawnCenterlines {
            grid: &estimate.grid,
            lines: estimate.rods.iter().map(line).collect(),
        };
    }
    let n = finest.leaf.segments();
    let node = |k: usize| Pose {
        position: finest.state.x[k] * length,
        rotation: finest.state.q[k],
    };
    let bases = (0..finest.leaf.rods()).map(|j| finest.state.base(j));
    let lines = bases.map(|base| (base..=base + n).map(node).collect());
    DrawnCenterlines {
        grid: &finest.leaf.grid,
        lines: lines.collect(),
    }
}

/// How much of its loads a leaf bore that did not come to rest under all of them.
#[derive(Clone, Copy)]
pub struct ReachedLoads {
    /// How far the leaf came on its path, if it has one.
    pub position: Option<PathPosition>,
    /// The part of the loads without a potential beside all others.
    pub borne_part: Option<f64>,
}

/// The end of a run, at rest (to the tolerance or not) or stopped before, with a remark
/// where one helps.
pub fn outcome(
    problem: &RelaxationProblem,
    found: &NestedEquilibrium,
    stopped: Option<EquilibriumFailure>,
    reached: ReachedLoads,
) -> RunEnd {
    let obstacle = || obstacle_to_rest(problem, found, reached).map(Box::new);
    let segments = found.levels.last().map_or(0, |level| level.leaf.segments());
    let explicit = problem.options.method.is_explicit();
    match stopped {
        None if found.keeps_tolerance => RunEnd::new(
            match (found.index, found.history.saddle) {
                (Some(1..), _) => Outcome::Saddle,
                (_, Some(_)) => Outcome::ConvergedAfterSaddle,
                _ => Outcome::Converged,
            },
            found
                .index
                .is_none()
                .then(|| match !problem.leaf.loads.has_moments() {
                    _ if problem.leaf.in_wind() => {
                        EquilibriumRemark::WindWithoutPotential { verdict: None }
                    }
                    _ if problem.leaf.loads.has_followers() => {
                        EquilibriumRemark::FollowersWithoutPotential { verdict: None }
                    }
                    true => EquilibriumRemark::IndexNotCounted,
                    false => EquilibriumRemark::MomentWithoutPotential { verdict: None },
                }),
        ),
        None => RunEnd::new(
            Outcome::ToleranceNotReached,
            match found.beyond_rounding(2 * segments) {
                true => EquilibriumRemark::ToleranceBelowRounding,
                false => EquilibriumRemark::ToleranceBeyondFinestGrid { segments },
            },
        ),
        Some(EquilibriumFailure::NoDescent) => RunEnd::new(
            Outcome::Diverged,
            match obstacle() {
                Some(obstacle) if obstacle.is_end_of_growth() => {
                    EquilibriumRemark::EquilibriumEnds { segments, obstacle }
                }
                obstacle => EquilibriumRemark::NoDescent { segments, obstacle },
            },
        ),
        Some(EquilibriumFailure::StepLimit) if problem.out_of_time() => RunEnd::new(
            Outcome::OutOfTime,
            EquilibriumRemark::OutOfTime { segments },
        ),
        Some(stop) => RunEnd::new(
            Outcome::NotAtRest,
            match stop {
                EquilibriumFailure::StepLimit if explicit => {
                    EquilibriumRemark::ExplicitStepLimit { segments }
                }
                EquilibriumFailure::Memory => EquilibriumRemark::OutOfMemory { segments },
                EquilibriumFailure::StepLimit | EquilibriumFailure::Unresolved
                    if problem.keeps_unstable() =>
                {
                    EquilibriumRemark::NoEquilibriumFromStart { segments }
                }
                EquilibriumFailure::Unresolved => EquilibriumRemark::UnresolvedBend {
                    segments,
                    obstacle: obstacle(),
                },
                _ => EquilibriumRemark::StepLimit {
                    segments,
                    obstacle: obstacle(),
                },
            },
        ),
    }
}

/// Part of its length by which the distance between two holders of an inextensible span is smaller
/// where the span is straight, for all that rounding tells.
const STRAIGHT_SPAN_TOLERANCE: f64 = 1e-9;

/// An inextensible vein that two holders, neighbours along it, keep straight. What pulls it aside
/// would need infinite forces along it, and any force along it is in balance. A vein that shears reaches farther.
fn taut_span(leaf: &DiscreteLeaf) -> Option<RestObstacle> {
    let n = leaf.segments();
    let holders = |j: usize| {
        let base = [(SpanHolder::Base, 0, leaf.leaf.base_pose(j).position)];
        let grips = leaf.rod_grips(j).map(|held| {
            let sigma = leaf.grid.sigma()[held.node];
            (SpanHolder::Grip(sigma), held.node, held.position)
        });
        let tip = (leaf.leaf.tip_support.iter()).map(|it| (SpanHolder::Tip, n, it.position));
        base.into_iter().chain(grips).chain(tip).collect::<Vec<_>>()
    };
    let taut = |j: usize, from: usize, to: usize, distance: f64| {
        let sections = || (from..to).map(|i| leaf.section(j, i));
        let length: f64 = sections().map(|it| it.ds * it.rest_strain.x).sum();
        // Within a stretch that a grip holds every node is held.
        to > from + 1
            && sections().all(|it| it.compliance == DVec3::ZERO)
            && distance >= length * (1.0 - STRAIGHT_SPAN_TOLERANCE)
    };
    (0..leaf.rods()).find_map(|j| {
        let holders = holders(j);
        let mut spans = holders.windows(2);
        let span = spans.find(|span| taut(j, span[0].1, span[1].1, span[0].2.distance(span[1].2)));
        span.map(|span| RestObstacle::TautSpan {
            vein: j,
            between: [span[0].0, span[1].0],
        })
    })
}

/// Loads that advice names, as a part of the largest.
const NAMED_LOAD_FRACTION: f64 = 0.1;

/// What may have kept a leaf from coming to rest: if nothing else, the part of the loads it reached,
/// the largest of its loads, and the softest stiffness of the vein that bends most.
fn obstacle_to_rest(
    problem: &RelaxationProblem,
    found: &NestedEquilibrium,
    reached: ReachedLoads,
) -> Option<RestObstacle> {
    if let Some(slip) = probable_obstacle_to_rest(problem.leaf.scenario()) {
        return Some(RestObstacle::Implausible(slip));
    }
    let level = found.levels.last()?;
    if let Some(half_turn) = level.leaf.half_turn_near(&level.state) {
        return Some(RestObstacle::HalfTurn { place: half_turn });
    }
    if let Some(taut) = taut_span(&level.leaf) {
        return Some(taut);
    }
    if let Some(part) = reached.borne_part {
        let loads = problem.leaf.keys_without_potential();
        let spins = problem.leaf.scenario().vein_driven_to_spin();
        return Some(RestObstacle::EndOfGrowth { part, loads, spins });
    }
    let bends = |j: usize| {
        let base = level.state.base(j);
        let rate = |i: usize| {
            let ends = [level.state.q[base + i], level.state.q[base + i + 1]];
            ends[0].angle_between(ends[1]) / level.leaf.section(j, i).ds
        };
        (0..level.leaf.segments()).map(rate).fold(0.0, f64::max)
    };
    let rods = 0..level.leaf.rods();
    let vein = rods
        .max_by(|&a, &b| bends(a).total_cmp(&bends(b)))
        .unwrap_or(0);
    let stiffness = level.leaf.leaf.section(vein, 0.5, 1.0).couple_stiffness;
    let loads = problem.leaf.loads;
    let [weight, tip] = [loads.gravity, loads.tip_force].map(|load| load.length());
    let moment = problem.leaf.dead_moments().map(|it| it.moment);
    let moment = moment.max_by(|a, b| a.length().total_cmp(&b.length()));
    // Along the directors at the base a moment shows what it turns; forces turn by their arms.
    let base = level.state.q[level.state.base(vein)];
    let turned = match moment.filter(|moment| moment.length() > weight.max(tip)) {
        Some(moment) => (base.conjugate() * moment).abs() / stiffness,
        None => stiffness.recip(),
    };
    let softest = ["torsion", "bending_2", "bending_3"][turned.max_position()];
    let named = [
        (weight * problem.leaf.rods() as f64, "load.gravity"),
        (tip, "load.tip_force"),
        (loads.tip_moment.length(), "load.tip_moment"),
        (problem.leaf.largest_point_moment(), "load.point.moment"),
    ];
    let largest = named.iter().fold(0.0_f64, |m, (size, _)| m.max(*size));
    let counts = |(size, _): &&(f64, _)| *size > NAMED_LOAD_FRACTION * largest;
    // Tissue that keeps its length strains veins that grow, whatever their loads.
    let growth = strains_by_growth(problem.leaf.scenario()).then_some("the growth by rest.stretch");
    let loads = named.iter().filter(counts).map(|(_, name)| *name);
    Some(RestObstacle::Loads {
        reached: reached.position,
        loads: growth.into_iter().chain(loads).collect(),
        stiffness: softest,
        vein,
        may_shoot: moment.is_some() && problem.leaf.tip_support.is_none(),
    })
}

/// Whether veins have grown, or shrunk, and the tissue between them has not.
fn strains_by_growth(scenario: &Scenario) -> bool {
    let grown = |rod: &Rod| rod.rest_stretch != Profile::Constant(1.0);
    !scenario.tissue_grown && scenario.tissue.is_some() && scenario.rods.iter().any(grown)
}

/// The implausible properties of a leaf at rest, first those of its scenario.
pub fn implausible_properties(scenario: &Scenario, leaf: &Equilibrium) -> Vec<EquilibriumDoubt> {
    if !leaf.outcome.is_at_rest() {
        return Vec::new();
    }
    let (rods, stations) = (&leaf.shape.rods, &leaf.shape.stations);
    let warnings = plausibility_warnings(scenario).into_iter();
    let mut all: Vec<_> = warnings.map(EquilibriumDoubt::Implausible).collect();
    if held_tip_out_of_reach(scenario).is_none() {
        let strained = || stretch_doubt(scenario, rods, stations);
        all.extend(inversion_doubt(rods, stations).or_else(strained));
    }
    all.extend(turned_from_wind(scenario, rods, stations));
    let shift = scenario.place_shift * leaf.shape.longest();
    all.extend(EquilibriumDoubt::about_places(
        shift,
        leaf.accuracy.error_estimate,
    ));
    all
}

/// The doubt about a vein that is stretched far beyond its rest stretch.
fn stretch_doubt(
    scenario: &Scenario,
    rods: &[RodShape],
    stations: &[f64],
) -> Option<EquilibriumDoubt> {
    let excess = |at: &VeinStation, node: &NodeState| {
        node.v.x / scenario.rods[at.vein].rest_stretch.at(at.sigma) - 1.0
    };
    let veins = rods.iter().enumerate().flat_map(|(vein, rod)| {
        let nodes = rod.nodes.iter().zip(stations);
        nodes.map(move |(node, &sigma)| (VeinStation { vein, sigma }, node))
    });
    let stretches = veins.map(|(at, node)| (at, excess(&at, node)));
    let (at, stretch) = stretches.max_by(|(_, a), (_, b)| a.total_cmp(b))?;
    (stretch > LARGEST_PLAUSIBLE_STRETCH).then_some(EquilibriumDoubt::Stretched {
        vein: at.vein,
        station: at.sigma,
        stretch,
    })
}

/// A vein with inverted elements (non-positive stretch).
fn inversion_doubt(rods: &[RodShape], stations: &[f64]) -> Option<EquilibriumDoubt> {
    let backwards = |rod: &RodShape| rod.nodes.iter().position(|node| node.v.x <= 0.0);
    let mut rods = rods.iter().enumerate();
    rods.find_map(|(vein, rod)| {
        let station = stations[backwards(rod)?];
        Some(EquilibriumDoubt::Inverted { vein, station })
    })
}

/// Smallest number of parts into which the stations of a result divide a vein.
const MIN_STATION_PARTS: usize = 16;

impl Equilibrium {
    /// The leaf at stations that divide every vein into `parts` equal parts; `None`: at the
    /// nodes of the finest grid, with its segments halved until there are at least 17
    /// stations.
    ///
    /// Between the stations of the solution the equilibrium equations are integrated; a leaf that
    /// is not at rest is interpolated linearly. The error between stations in addition to that at
    /// them is added to the error estimate; if that then exceeds the tolerance, the outcome becomes
    /// [`Outcome::ToleranceNotReached`], or without `parts` the stations stay as they are.
    #[must_use]
    pub fn at_stations(self, scenario: &Scenario, parts: Option<usize>) -> Self {
        let to = match parts {
            Some(parts) => equally_spaced(parts),
            None => finest_grid_stations(&self.shape),
        };
        if to == self.shape.stations {
            return self;
        }
        let mut there = self.clone().interpolated_to_stations(scenario, to);
        if there.keeps_tolerance() || !self.keeps_tolerance() {
            return there;
        }
        if parts.is_none() {
            return self;
        }
        if there.outcome.is_success() {
            there.outcome = Outcome::ToleranceNotReached;
            there.remark = Some(EquilibriumRemark::InaccurateBetweenStations);
        }
        there
    }

    /// Whether the tolerance, if it is kept at the stations of the solution, is kept at the ends
    /// of so many equal `parts`, too.
    pub(in crate::relax) fn keeps_tolerance_at(&self, scenario: &Scenario, parts: usize) -> bool {
        let there = || {
            self.clone()
                .interpolated_to_stations(scenario, equally_spaced(parts))
        };
        !self.keeps_tolerance() || there().keeps_tolerance()
    }

    pub(in crate::relax) fn keeps_tolerance(&self) -> bool {
        let allowed = self.accuracy.tolerance * self.shape.longest();
        (self.accuracy.error_estimate).is_none_or(|error| error <= allowed)
    }

    /// The leaf at these stations, wherever its tolerance is kept.
    fn interpolated_to_stations(mut self, scenario: &Scenario, to: Vec<f64>) -> Self {
        let at_rest = !matches!(
            self.outcome,
            Outcome::NotAtRest | Outcome::Singular | Outcome::Diverged
        );
        let leaf = Leaf::new(scenario);
        let discrete = DiscreteLeaf::new(&leaf, Grid::new(1, leaf.kinks()));
        let mut flow = RodIntegrator::new(&discrete);
        let (stations, known) = (&self.shape.stations, &self.shape.rods);
        let section = |i: usize| -> LeafSection {
            let rods = known.iter();
            rods.map(|rod| transfer::fields_from_node_state(&leaf, &rod.nodes[i]))
                .collect()
        };
        let held = HeldStretches::new(scenario);
        let mut between = 0.0_f64;
        let tied = (scenario.tissue.iter().flatten()).any(Tissue::has_unknown_forces);
        let (kinks, strain_jumps) = (scenario.kinks(), scenario.strain_jumps());
        let mut rods = vec![Vec::with_capacity(to.len()); known.len()];
        let mut rest = to.as_slice();
        for (i, &station) in stations.iter().enumerate() {
            if rest
                .first()
                .is_some_and(|at| (at - station).abs() < STATION_TOLERANCE)
            {
                for (rod, known) in rods.iter_mut().zip(known) {
                    rod.push(known.nodes[i]);
                }
                rest = &rest[1..];
            }
            let next = stations.get(i + 1).copied().unwrap_or(1.0);
            let (points, others) =
                rest.split_at(rest.partition_point(|at| *at < next - STATION_TOLERANCE));
            rest = others;
            if points.is_empty() {
                continue;
            }
            let [begin, end] = [i, i + 1].map(section);
            let ends = [(station, &begin), (next, &end)];
            let ends = ends.map(|(sigma, section)| KnownSection { sigma, section });
            // The equations of a single rod do not determine the forces of tissue that is rigid, or contracts.
            let found = match at_rest && !tied {
                true => {
                    let known = |vein: usize| held.known_resultants(vein, [station, next]);
                    integrate_between_stations(&mut flow, leaf.kinks(), ends, points, known)
                }
                false => None,
            };
            for (vein, (there, rod)) in rods.iter_mut().zip(known).enumerate() {
                let grip = held.grip(vein, [station, next]).filter(|_| at_rest);
                if let (Some(found), None) = (&found, grip) {
                    between = larger(between, found.added_errors[vein] * leaf.scale.length);
                    for (&sigma, section) in points.iter().zip(&found.sections) {
                        let at = VeinStation { vein, sigma };
                        there.push(transfer::node_state_from_fields(&leaf, at, &section[vein]));
                    }
                    continue;
                }
                for &sigma in points {
                    let kinks = [kinks.as_slice(), &strain_jumps];
                    let through = StationInterpolation::new(stations, kinks, sigma);
                    let node = through.node_state(&rod.nodes);
                    there.push(match grip {
                        Some(grip) => held.place(grip, sigma, node),
                        None => node,
                    });
                    if at_rest && grip.is_none() {
                        between = larger(between, through.error(&rod.nodes));
                    }
                }
            }
        }
        for (rod, nodes) in self.shape.rods.iter_mut().zip(rods) {
            rod.nodes = nodes;
        }
        let error = self.stress.as_ref().and_then(|it| it.error);
        // Where stations in between are less accurate than the nodes, so are the forces there.
        let at_nodes = self.accuracy.error_estimate;
        let error = error.filter(|_| at_nodes.is_some_and(|at_nodes| between <= at_nodes));
        let stress = Stresses::of(scenario, &to, &self.shape.rods);
        self.stress = stress.map(|it| Stresses { error, ..it });
        self.shape.stations = to;
        if let Some(error) = &mut self.accuracy.error_estimate {
            *error += between;
        }
        self
    }
}

/// The stretches of veins whose places rigid grips hold: positions there are known between stations, too.
struct HeldStretches<'a> {
    grips: Vec<&'a Grip>,
    /// The natural leaf, if there are such stretches.
    natural: Option<Natural<'a>>,
    /// All grips, beyond whose ends stress resultants are others than before.
    ends: &'a [Grip],
}

impl<'a> HeldStretches<'a> {
    fn new(scenario: &'a Scenario) -> Self {
        let is_stretch = |grip: &&Grip| grip.at[0] < grip.at[1] && grip.rigid_axes() == [true; 3];
        let grips: Vec<&Grip> = scenario.grips.iter().filter(is_stretch).collect();
        let natural = (!grips.is_empty()).then(|| Natural::new(scenario, true));
        HeldStretches {
            grips,
            natural,
            ends: &scenario.grips,
        }
    }

    /// At which of two stations the stress resultants of a vein are known.
    fn known_resultants(&self, vein: usize, [from, to]: [f64; 2]) -> KnownResultants {
        let ends = |grip: &Grip| grip.vein == vein && (grip.at[1] - from).abs() < STATION_TOLERANCE;
        match self.grip(vein, [from, to]) {
            Some(_) => KnownResultants::Nowhere,
            None if self.ends.iter().any(ends) => KnownResultants::AtSecond,
            None => KnownResultants::Both,
        }
    }

    /// The grip that holds a vein between two stations.
    fn grip(&self, vein: usize, [from, to]: [f64; 2]) -> Option<&'a Grip> {
        let holds = |grip: &&&Grip| {
            let [begin, end] = grip.at;
            grip.vein == vein && begin <= from + STATION_TOLERANCE && to <= end + STATION_TOLERANCE
        };
        self.grips.iter().find(holds).copied()
    }

    /// An interpolated node of a vein at the place where the grip holds it.
    fn place(&self, grip: &Grip, sigma: f64, node: NodeState) -> NodeState {
        let Some(natural) = &self.natural else {
            return node;
        };
        let pose = natural.vein_pose(grip.vein, sigma);
        NodeState {
            position: pose.position + DVec3::from_array(grip.displacement),
            rotation: match grip.holds_directions() {
                true => align_quaternion_sign(pose.rotation, node.rotation),
                false => node.rotation,
            },
            ..node
        }
    }
}

/// Most stations through which a vein is interpolated.
const INTERPOLATED_STATIONS: usize = 6;

/// Safety factor on the error of such an interpolation, the difference to that through one station less.
const INTERPOLATION_SAFETY: f64 = 2.0;

/// Polynomials through the stations nearest to a place between two kinks.
struct StationInterpolation {
    value: InterpolationWeights,
    /// Of strains: those of the first station are on the other side if they jump there.
    strains: InterpolationWeights,
    /// Through one station less.
    lower: InterpolationWeights,
}

impl StationInterpolation {
    /// To the place `at`, between `kinks` that are stations, at some of which strains jump.
    fn new(stations: &[f64], [kinks, strain_jumps]: [&[f64]; 2], at: f64) -> Self {
        let panel = kinks.partition_point(|kink| *kink < at);
        let low = panel.checked_sub(1).map_or(0.0, |k| kinks[k]);
        let high = kinks.get(panel).copied().unwrap_or(1.0);
        let node = |at: f64| stations.partition_point(|it| *it < at - SAME_KINK_DISTANCE);
        let (first, last) = (node(low), node(high).min(stations.len() - 1));
        let through = |first: usize, less: usize| {
            let near = &stations[first..=last];
            let count = (INTERPOLATED_STATIONS - less).min(near.len() - less);
            let InterpolationWeights {
                first: skipped,
                weights,
            } = interpolation_weights(near, at, count);
            InterpolationWeights {
                first: first + skipped,
                weights,
            }
        };
        let jumps = strain_jumps
            .iter()
            .any(|jump| (jump - low).abs() <= SAME_KINK_DISTANCE);
        StationInterpolation {
            value: through(first, 0),
            strains: through(first + usize::from(jumps), 0),
            lower: through(first, 1),
        }
    }

    /// The state of a vein with these nodes.
    fn node_state(&self, nodes: &[NodeState]) -> NodeState {
        let sum = |of: fn(&NodeState) -> DVec3| self.value.weighted_sum(nodes, of);
        let strain = |of: fn(&NodeState) -> DVec3| self.strains.weighted_sum(nodes, of);
        NodeState {
            position: sum(|node| node.position),
            rotation: self.value.rotation(nodes),
            v: strain(|node| node.v),
            u: strain(|node| node.u),
            n: sum(|node| node.n),
            m: sum(|node| node.m),
        }
    }

    /// The error of the position of a vein with these nodes.
    fn error(&self, nodes: &[NodeState]) -> f64 {
        let position = |through: &InterpolationWeights| -> DVec3 {
            through.weighted_sum(nodes, |node| node.position)
        };
        INTERPOLATION_SAFETY * position(&self.value).distance(position(&self.lower))
    }
}

/// A station that is closer to a kink than this, as a fraction of the length, is at it.
const SAME_KINK_DISTANCE: f64 = 1e-12;

/// Nodes of the finest grid, with all segments halved until there are enough.
fn finest_grid_stations(shape: &Shape) -> Vec<f64> {
    let mut stations = shape.curve_stations.clone();
    while (2..=MIN_STATION_PARTS).contains(&stations.len()) {
        let middles = stations
            .windows(2)
            .flat_map(|w| [0.5 * (w[0] + w[1]), w[1]]);
        stations = stations[..1].iter().copied().chain(middles).collect();
    }
    stations
}

#[cfg(test)]
mod stations_tests {
    use super::*;

    /// A tapering vein with a knot, compared with an accurate solution at the same stations.
    #[test]
    fn stations_between_are_as_accurate_as_those_that_were_solved_for() {
        let scenario = Scenario::from_toml(
            r#"
            name = "taper"
            leaf = { rods = 3, length = [1.0, 1.1, 0.9], fan = "paper" }
            stiffness = { torsion = 0.5, bending_2 = { at = [0.0, 0.3, 1.0], value = [1.0, 1.0, 0.4] }, bending_3 = 1.0, axial = 100.0, shear_2 = 50.0, shear_3 = inf }
            rest = { bend_2 = 0.7, twist = -0.4, stretch = 1.05 }
            coupling = { y = 1.0, z = 2.0 }
            load = { gravity = [0.1, 0.2, -2.0] }
            "#,
        )
        .unwrap();
        let to = |tolerance| {
            let relaxation = scenario.relaxation().tolerance(tolerance);
            relaxation.every_node().run().unwrap()
        };
        let sharp = to(1e-10);
        for tolerance in [1e-3, 1e-6, 1e-8] {
            let found = to(tolerance);
            let there = found.clone().at_stations(&scenario, None);
            let finest = found.shape.curves[0].len();
            let count = there.shape.stations.len();
            assert!(count > MIN_STATION_PARTS && count >= finest);
            let within = there.accuracy.error_estimate.unwrap();
            assert!(within <= tolerance * found.shape.longest());
            let sharp = sharp.clone().at_stations(&scenario, Some(40));
            let there = found.at_stations(&scenario, Some(40));
            assert_eq!(there.shape.stations, equally_spaced(40));
            let error = there.accuracy.error_estimate.unwrap();
            for (one, other) in there.shape.rods.iter().zip(&sharp.shape.rods) {
                for (node, exact) in one.nodes.iter().zip(&other.nodes) {
                    let away = (node.position - exact.position).length();
                    assert!(away <= error, "{tolerance}: {away} > {error}");
                    assert!((node.m - exact.m).length() < 1e2 * error);
                    assert!((node.n - exact.n).length() < 1e3 * error);
                    assert!((node.u - exact.u).length() < 1e3 * error);
                }
            }
        }
    }

    #[test]
    fn stations_that_were_found_stay_as_they_are() {
        let scenario = Scenario::from_toml(include_str!("../../../scenarios/paper/fig04.toml"));
        let scenario = scenario.unwrap();
        let found = scenario.relaxation().every_node().run().unwrap();
        let there = found.clone().at_stations(&scenario, None);
        for (i, station) in found.shape.stations.iter().enumerate() {
            let mut stations = there.shape.stations.iter();
            let k = stations.position(|s| s == station).unwrap();
            for (one, other) in found.shape.rods.iter().zip(&there.shape.rods) {
                assert_eq!(one.nodes[i], other.nodes[k]);
            }
        }
        let nodes = there.shape.curves[0].len();
        assert_eq!(there.shape.stations.len(), nodes.max(MIN_STATION_PARTS + 1));
    }
}
