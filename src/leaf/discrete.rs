//! The grid of a leaf, and the leaf on it: sections of its segments, and the weights, loads and
//! couplings of its nodes.
//!
//! Veins that tissue ties, or that meet at a tip, must fit together at rest: what their rest shapes
//! miss by their discretization, stiff tissue would turn into forces. So the rest strain and the rest
//! curvature of their segments are those of a segment between two nodes of the stress-free leaf,
//!
//! v0 = R^T (x1 - x0)/ds,   u0 = log(q0^* q1)/ds,
//!
//! which differ from those at its middle by a series in ds^2.

use crate::leaf::direct::pattern::SharedPattern;
use crate::leaf::nodal_loads::{Lever, NodalMoment, ScheduledLoads};
use crate::leaf::springs::NodeSprings;
use crate::leaf::state::{BaseJoint, State};
use crate::leaf::{FollowerLoad, GrippedNode, Leaf, Loads};
use crate::natural::Natural;
use crate::numbers::largest;
use crate::rod::{Section, Segment, TissueStrip};
use crate::rotation;
use crate::scenario::{Profile, RodPlace};
use crate::simd::{GROUP, Lanes, NumberGroup, Vectors, group_components};
use glam::DVec3;
use pulp::{Scalar, Simd};
use std::ops::{Add, Mul, Range};

/// Radius of gyration of a vein with the tissue it carries, in units of the leaf's length: its
/// rotary inertia per unit length and mass is the square. A thin rod's own is smaller, but a
/// vein rotates with its strip of blade.
const RADIUS_OF_GYRATION: f64 = 0.1;

/// Smallest shift of the matrix, as a squared frequency, that keeps neutral modes from moving: far below
/// the squared frequency of any bending mode.
const LEAST_NEUTRAL_SHIFT: f64 = 1e-7;

/// Largest difference between stations of a shape and nodes of a grid by rounding, in fractions of the
/// length.
const STATION_ROUNDING: f64 = 1e-9;

/// A leaf on a grid.
#[derive(Clone, Debug)]
pub struct DiscreteLeaf {
    /// The leaf before discretization.
    pub leaf: Leaf,
    /// The grid of every rod.
    pub grid: Grid,
    /// Sections of all segments, rod after rod.
    pub sections: Vec<Section>,
    /// Rest curvatures of all segments, from which [`DiscreteLeaf::scale_rest_curvatures`] sets those
    /// of the sections.
    rest_curvatures: Vec<DVec3>,
    /// Coupling of each gap, per unit of sigma; the last may be the one between
    /// a rod and its image.
    coupling: Vec<DVec3>,
    /// Tissue of each gap at every node; empty if there is none.
    pub(super) strips: Vec<TissueStrip>,
    /// Forces on all nodes by loads of their veins alone; empty if there are none.
    pub(super) own_loads: Vec<DVec3>,
    /// Those of these forces that act off the axis.
    pub(super) levers: Vec<Lever>,
    /// Dead moments on points of a single rod, whole.
    pub(super) point_moments: Vec<NodalMoment>,
    /// Loads of single veins that vary in time, if there are any. Their forces and moments are in
    /// `own_loads`, `levers` and `point_moments`, which are those at rest until factors are set.
    pub scheduled_loads: Option<Box<ScheduledLoads>>,
    /// Loads without a potential on all nodes, rod after rod, before their factor; empty if there are none.
    pub(super) followers: Vec<FollowerLoad>,
    /// Nodes that grips hold.
    pub(super) grips: Vec<GrippedNode>,
    /// The entry of `grips` for each node, rod after rod; empty without grips. Fields of increments ask for every node.
    pub(super) grip_of_node: Vec<Option<usize>>,
    /// Springs of supports that give.
    pub(super) springs: NodeSprings,
    /// Bases on hinges that hold their spin.
    pub(super) joints: Vec<BaseJoint>,
    /// Factor of all loads: one, except during continuation in the loads.
    pub load_factor: f64,
    /// Loads that all rods share, before the factor.
    pub loads: Loads,
    /// The pattern of the matrix.
    pub(super) pattern: SharedPattern,
}

/// What a held tip exerts on its holder.
#[derive(Clone, Debug)]
pub struct TipReaction {
    /// Force of all rods together.
    pub force: DVec3,
    /// Moment of every rod, which a clamp balances.
    pub moments: Vec<DVec3>,
}

/// Mass of a node at unit density, or its mass per weight.
#[derive(Clone, Copy, Debug)]
pub(super) struct NodeMass {
    /// Moment of inertia, the same about all axes.
    pub rotary: f64,
    pub translational: f64,
}

impl NodeMass {
    /// The mass that belongs to component `c` of an increment (rotation, displacement).
    #[inline]
    pub fn of_component(self, c: usize) -> f64 {
        if c < 3 {
            self.rotary
        } else {
            self.translational
        }
    }
}

/// Weights of a node in sums along a rod.
#[derive(Clone, Copy, Debug)]
pub struct NodeWeights {
    /// Weight in dead loads.
    pub load: f64,
    /// Weight in the coupling: zero at a joint tip, which all rods share.
    pub coupling: f64,
}

impl DiscreteLeaf {
    /// Discretizes `leaf` on `grid`.
    pub fn new(leaf: &Leaf, grid: Grid) -> Self {
        let mut sections = leaf.sections_on(&grid);
        leaf.fit_rest_shapes(&grid, &mut sections);
        DiscreteLeaf::with_sections(leaf, grid, sections, None)
    }

    /// Discretizes `leaf` on this grid with the sections of this leaf, if both have the same rods, and with
    /// its tissue, if that is the same, too: evaluating profiles takes as long as assembling a small leaf.
    pub fn with_same_rods(&self, leaf: &Leaf) -> Option<Self> {
        if !self.leaf.has_same_rods(leaf) {
            return None;
        }
        let (grid, sections) = (self.grid.clone(), self.sections.clone());
        let strips = self.leaf.has_same_tissue(leaf).then_some(&self.strips[..]);
        Some(DiscreteLeaf::with_sections(leaf, grid, sections, strips))
    }

    /// Discretizes `leaf` on this grid with the rest shapes of this leaf, if both have the same: integrating
    /// those of curved veins takes longer than all else.
    pub fn with_same_rest_shapes(&self, leaf: &Leaf) -> Self {
        let mut sections = leaf.sections_on(&self.grid);
        match self.leaf.has_same_rest_shapes(leaf) {
            true => {
                let own = self.sections.iter().zip(&self.rest_curvatures);
                for (section, (known, rest_curvature)) in sections.iter_mut().zip(own) {
                    section.rest_strain = known.rest_strain;
                    section.rest_curvature = *rest_curvature;
                }
            }
            false => leaf.fit_rest_shapes(&self.grid, &mut sections),
        }
        DiscreteLeaf::with_sections(leaf, self.grid.clone(), sections, None)
    }

    /// The leaf with these sections, and these strips of tissue, if they are known.
    fn with_sections(
        leaf: &Leaf,
        grid: Grid,
        sections: Vec<Section>,
        strips: Option<&[TissueStrip]>,
    ) -> Self {
        let gaps = leaf.rods() - usize::from(!leaf.borders_own_image(leaf.rods() - 1));
        let coupling = (0..gaps).map(|g| leaf.coupling(g)).collect();
        let mut discrete = DiscreteLeaf {
            leaf: leaf.clone(),
            grid,
            rest_curvatures: sections.iter().map(|of| of.rest_curvature).collect(),
            sections,
            coupling,
            strips: Vec::new(),
            own_loads: Vec::new(),
            pattern: SharedPattern::default(),
            levers: Vec::new(),
            point_moments: Vec::new(),
            scheduled_loads: None,
            followers: Vec::new(),
            grips: Vec::new(),
            grip_of_node: Vec::new(),
            springs: NodeSprings::default(),
            joints: leaf.base_joints(),
            load_factor: 1.0,
            loads: leaf.loads,
        };
        discrete.own_loads = discrete.nodal_own_loads(leaf);
        discrete.levers = discrete.nodal_levers(leaf);
        discrete.point_moments = discrete.nodal_point_moments();
        discrete.scheduled_loads = discrete.find_scheduled_loads();
        discrete.followers = discrete.nodal_followers();
        if let Some(strips) = strips {
            discrete.strips = strips.to_vec();
        }
        let makes_strips = leaf.has_tissue() && strips.is_none();
        let scenario = leaf.scenario();
        let is_held = !scenario.grips.is_empty() || scenario.foundation.is_some();
        if makes_strips || is_held || leaf.has_base_springs() {
            // Holders and tissue have their places in the natural leaf, whatever the rest shapes are now.
            let original = (scenario.natural.as_ref()).map(|natural| {
                DiscreteLeaf::new(&Leaf::new(&natural.scenario), discrete.grid.clone())
            });
            let unstrained = |grown: bool| {
                original
                    .as_ref()
                    .unwrap_or(&discrete)
                    .unstrained_state(grown)
            };
            let natural = unstrained(true);
            let ungrown = (makes_strips && !scenario.tissue_grown).then(|| unstrained(false));
            discrete.set_gripped_nodes(&natural);
            discrete.limit_held_segments();
            discrete.springs = discrete.springs_from(&natural);
            if makes_strips {
                discrete.strips = discrete.tissue_strips(ungrown.as_ref().unwrap_or(&natural));
            }
        }
        discrete
    }

    /// The same discretization of [`Leaf::decoupled_leaf`].
    pub fn decoupled_leaf(&self) -> Self {
        let leaf = self.leaf.decoupled_leaf();
        DiscreteLeaf {
            loads: leaf.loads,
            leaf,
            coupling: vec![DVec3::ZERO; self.coupling.len()],
            ..self.clone()
        }
    }

    /// The stress-free leaf: unstrained rods, v = v0 and u = u0, each from its base.
    pub fn stress_free_state(&self) -> State {
        self.unstrained_state(true)
    }

    /// Unstrained rods, each from its base, with their rest stretch if they have `grown`, else of unit
    /// stretch.
    fn unstrained_state(&self, grown: bool) -> State {
        let (mut xs, mut qs) = (Vec::new(), Vec::new());
        for j in 0..self.rods() {
            let base = self.leaf.base_pose(j);
            let (mut x, mut q) = (base.position, base.rotation);
            xs.push(x);
            qs.push(q);
            for i in 0..self.segments() {
                let section = self.section(j, i);
                let next = (q * rotation::exp(section.rest_curvature * section.ds)).normalize();
                let strain = if grown { section.rest_strain } else { DVec3::X };
                x += section.ds * (rotation::midpoint(q, next) * strain);
                q = next;
                xs.push(x);
                qs.push(q);
            }
        }
        State::new(self.segments(), xs, qs)
    }

    /// The smallest compliance of any segment, in units of L^2/A.
    pub fn least_compliance(&self) -> f64 {
        self.sections
            .iter()
            .fold(f64::INFINITY, |m, s| m.min(s.compliance.min_element()))
    }

    /// This leaf with no compliance below `floor`, and no tissue stiffer than the inverse of `floor`.
    pub fn with_compliance_floor(&self, floor: f64) -> Self {
        let mut soft = self.clone();
        let n = self.segments();
        for (k, section) in soft.sections.iter_mut().enumerate() {
            let floor = floor / self.leaf.share(k / n);
            section.compliance = section.compliance.max(DVec3::splat(floor));
            section.condensing = section.condensing.min(DVec3::splat(1.0 / floor));
        }
        for (k, strip) in soft.strips.iter_mut().enumerate() {
            let stiffest = self.grid.node_weight(k % (n + 1)) / floor;
            strip.stiffness = strip.stiffness.min(DVec3::splat(stiffest));
            strip.condensing = strip.stiffness;
        }
        soft
    }

    /// Sets the force of every segment, and of the tissue, to that of its strain, and in rigid
    /// directions to zero; returns the largest strain in rigid directions, as a length.
    pub fn strain_forces(&self, state: &mut State) -> f64 {
        let (n, mut violation) = (self.segments(), 0.0_f64);
        state.tissue.clear();
        for (j, i) in self.rod_index_pairs(0..n) {
            let section = self.section(j, i);
            let rigid = section.compliance.cmpeq(DVec3::ZERO);
            let strained = self.strained_segment(state, j, i);
            state.n[j * n + i] = strained.frame * strained.nu;
            let gap = self.closable_gap(j, i, strained.gap);
            let off = DVec3::select(rigid, gap, DVec3::ZERO);
            violation = largest([violation, off.x.abs(), off.y.abs(), off.z.abs()]);
        }
        violation
    }

    /// Whether nearly rigid segments have their lengths, with a total error of at most
    /// `within` per rod. Their forces are found by proximal steps: if no shape nearby
    /// satisfies the lengths, the forces grow from step to step while no node moves.
    pub fn satisfies_lengths(&self, state: &State, within: f64) -> bool {
        let n = self.segments();
        let open = |j: usize| -> f64 {
            let gap = |i: usize| {
                let nearly_rigid = self.missing_law_fraction(j, i).cmpgt(DVec3::ZERO);
                if !nearly_rigid.any() {
                    return 0.0;
                }
                let gap = self.segment(state, j, i, state.n[j * n + i]).gap;
                let gap = self.closable_gap(j, i, gap);
                DVec3::select(nearly_rigid, gap, DVec3::ZERO).length()
            };
            (0..n).map(gap).sum()
        };
        self.open_tissue_gap(state) <= within && (0..self.rods()).all(|j| open(j) <= within)
    }

    /// A shift of the matrix (times the mass matrix) above the error of a neutral mode's zero
    /// eigenvalue by rounding and unfinished iterations.
    pub fn neutral_shift(&self) -> f64 {
        LEAST_NEUTRAL_SHIFT + 4.0 * self.eigenvalue_rounding()
    }

    /// Rounding error of the eigenvalues of the matrix.
    pub fn eigenvalue_rounding(&self) -> f64 {
        let n = self.segments();
        let stiffest = largest(self.rod_index_pairs(0..n).map(|(j, i)| {
            // Nodes at both ends of a segment that holders direct do not move.
            match self.segment_hold(j, i).directs {
                true => self.section(j, i).condensing.x,
                false => self.section(j, i).condensing.max_element(),
            }
        }));
        f64::EPSILON * stiffest * (self.segments() * self.segments()) as f64
    }

    /// The first node of a rod that has equations: the base if a hinge lets it turn, else the next node.
    /// Fields of increments and of nodal forces begin with it.
    #[inline]
    pub fn first_node(&self) -> usize {
        usize::from(!self.leaf.hinged())
    }

    /// The nodes of a rod that have equations.
    pub fn moving_nodes(&self) -> Range<usize> {
        self.first_node()..self.segments() + 1
    }

    /// Segments per rod.
    pub fn segments(&self) -> usize {
        self.grid.segments()
    }

    /// Number of rods.
    pub fn rods(&self) -> usize {
        self.leaf.rods()
    }

    /// Rod and number of every node or segment whose number is in `of`.
    pub fn rod_index_pairs<I: Iterator<Item = usize> + Clone>(
        &self,
        of: I,
    ) -> impl Iterator<Item = (usize, usize)> + use<I> {
        (0..self.rods()).flat_map(move |j| of.clone().map(move |i| (j, i)))
    }

    /// Whether neighboring rods are coupled.
    pub fn coupled(&self) -> bool {
        let between = self.coupling.iter().take(self.rods() - 1);
        between.into_iter().any(|&k| k != DVec3::ZERO)
    }

    /// Coupling of gap `g`, force per displacement and unit of sigma.
    pub(crate) fn coupling(&self, g: usize) -> DVec3 {
        self.coupling[g]
    }

    /// Coupling of gap `g` at node `i`, force per displacement; none at a
    /// joint tip, which all rods share.
    pub(crate) fn node_coupling(&self, g: usize, i: usize) -> DVec3 {
        self.coupling[g] * self.coupling_weight(i)
    }

    /// Mass of the nodes of rod `j` at unit density, per weight.
    pub(super) fn mass_per_weight(&self, j: usize) -> NodeMass {
        let mass = self.leaf.length(j) * self.leaf.share(j);
        NodeMass {
            rotary: RADIUS_OF_GYRATION * RADIUS_OF_GYRATION * mass,
            translational: mass,
        }
    }

    /// Whether all tips are one point that moves.
    pub fn tips_move_together(&self) -> bool {
        // The tip of a single rod is not shared, and a held tip does not move.
        self.leaf.joined() && self.rods() > 1 && self.leaf.tip_support.is_none()
    }

    /// What the tips exert on their holder.
    pub fn reaction(&self, state: &State) -> TipReaction {
        let n = self.segments();
        let mut force = DVec3::ZERO;
        let mut moments = Vec::with_capacity(self.rods());
        for j in 0..self.rods() {
            let segment = self.segment(state, j, n - 1, state.n[j * n + n - 1]);
            let gradient = segment.gradient(self.section(j, n - 1));
            let load = self.load(state, j, n);
            let follower = self.follower_wrench(state, j, n);
            force += load.force + follower.force - gradient.x;
            moments.push(load.moment + self.node_moment(state, j, n) - gradient.b);
        }
        TipReaction { force, moments }
    }

    /// Weight of node `i` in the masses: zero at a held tip, which does not move.
    pub(super) fn mass_weight(&self, i: usize) -> f64 {
        match self.leaf.tip_support {
            Some(_) if i == self.segments() => 0.0,
            _ => self.grid.node_weight(i),
        }
    }

    /// Segment `i` of rod `j` in `state`, carrying the force `n`.
    pub fn segment(&self, state: &State, j: usize, i: usize, n: DVec3) -> Segment {
        Segment::new(self.section(j, i), &state.ends(j, i), n)
    }

    /// Segment `i` of rod `j` in `state`, carrying the force of its strains.
    pub fn strained_segment(&self, state: &State, j: usize, i: usize) -> Segment {
        Segment::with_strain_force(self.section(j, i), &state.ends(j, i))
    }

    /// Section of segment `i` of rod `j`.
    #[inline]
    pub fn section(&self, j: usize, i: usize) -> &Section {
        &self.sections[j * self.segments() + i]
    }

    /// Weight of the coupling of node `i`: zero at a joint tip, which all rods share.
    pub(super) fn coupling_weight(&self, i: usize) -> f64 {
        match self.leaf.joined() && i == self.segments() {
            true => 0.0,
            false => self.grid.node_weight(i),
        }
    }

    /// Weights of node `i`.
    #[inline]
    pub(super) fn node_weights(&self, i: usize) -> NodeWeights {
        NodeWeights {
            load: self.grid.node_weight(i),
            coupling: self.coupling_weight(i),
        }
    }

    /// Loads on rod `j`, per weight. The tip force acts on every free tip, and once on a joint
    /// one, through the first rod.
    pub(super) fn rod_load(&self, j: usize) -> RodLoad {
        let (joined, mirrored) = (self.leaf.joined(), self.leaf.mirrored);
        let share = self.leaf.share(j);
        let tip_share = match joined {
            true if j > 0 => 0.0,
            true if mirrored => 0.5,
            _ => share,
        };
        let gap = |present: bool, g: usize| match present {
            true => self.coupling[g],
            false => DVec3::ZERO,
        };
        RodLoad {
            dead: self.loads.gravity * (self.load_factor * self.leaf.length(j) * share),
            tip: tip_share * self.load_factor * self.loads.tip_force,
            previous: gap(j > 0, j.wrapping_sub(1)),
            next: gap(j + 1 < self.rods(), j),
            image: 2.0 * DVec3::Y * gap(self.leaf.borders_own_image(j), j),
        }
    }

    /// Force on the tip of rod `j`: its share if the tips are one.
    pub fn tip_force(&self, j: usize) -> DVec3 {
        self.rod_load(j).tip + self.point_force_at(j, 1.0)
    }

    /// Dead load, coupling, tissue and springs on node `i` of rod `j`.
    pub fn load(&self, state: &State, j: usize, i: usize) -> NodeLoad {
        let mut load = self.load_with_tissue(state, j, i, self.tissue_load(state, j, i));
        if self.has_springs() {
            let springs = self.spring_load(state, j, i);
            load.moment += springs.moment;
            load.force += springs.force;
            load.energy += springs.energy;
        }
        load
    }

    /// The load on node `i` of rod `j`, of which this is that of the tissue.
    pub fn load_with_tissue(
        &self,
        state: &State,
        j: usize,
        i: usize,
        tissue: NodeLoad,
    ) -> NodeLoad {
        let (k, nodes) = (state.base(j) + i, self.segments() + 1);
        let x = |present: bool, k: usize| state.x[if present { k } else { state.base(j) + i }];
        let (first, last) = (j == 0, j + 1 == self.rods());
        let x = [
            x(!first, k.wrapping_sub(nodes)),
            state.x[k],
            x(!last, k + nodes),
        ];
        let load = LaneRodLoads::load_group(Scalar, &group_loads([self.rod_load(j); GROUP]), 0);
        let weights = self.node_weights(i);
        let lanes = load.node_forces(x.map(Vectors::from), weights, i == self.segments());
        let own = self.own_load_on_node(j, i);
        let mut load = NodeLoad {
            moment: tissue.moment,
            force: DVec3::from(lanes.force) + tissue.force + own,
            energy: f64::from(lanes.energy) + tissue.energy - own.dot(state.x[k]),
        };
        for lever in self.levers_on(j, i) {
            load.moment += lever.moment(state.q[k]);
            load.energy += lever.energy(state.q[k]);
        }
        load
    }

    /// Potential energy of the dead loads in a state.
    pub fn potential(&self, state: &State) -> f64 {
        self.rod_index_pairs(0..self.segments() + 1)
            .map(|(j, i)| self.load(state, j, i).energy - self.coupling_energy(state, j, i))
            .sum()
    }

    /// Energy of the coupling and of the tissue between node `i` of rod `j` and the next rod.
    pub fn coupling_energy(&self, state: &State, j: usize, i: usize) -> f64 {
        if j + 1 == self.rods() {
            return 0.0;
        }
        let k = state.base(j) + i;
        let stretch = state.x[k + self.segments() + 1] - state.x[k];
        0.5 * stretch.dot(self.node_coupling(j, i) * stretch) + self.tissue_load(state, j, i).energy
    }

    /// Sets loads and coupling to these fractions of those of the `whole` leaf.
    pub fn set_load_factors(&mut self, whole: &DiscreteLeaf, loads: f64, coupling: f64) {
        self.load_factor = loads * whole.load_factor;
        for (own, full) in self.coupling.iter_mut().zip(&whole.coupling) {
            *own = coupling * *full;
        }
    }

    /// Sets all rest curvatures to `factor` times those of the leaf.
    pub fn scale_rest_curvatures(&mut self, factor: f64) {
        for (section, own) in self.sections.iter_mut().zip(&self.rest_curvatures) {
            section.rest_curvature = factor * *own;
        }
    }
}

/// Nodes as fractions sigma = s/L of every rod's length, from 0 to 1, the same
/// for all rods since the coupling joins equal fractions.
///
/// The interval is cut into panels wherever a profile has a kink, and every
/// panel into equal segments, so that the midpoint rule never reaches across a
/// kink and halving all segments keeps its error series in ds^2 clean.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    sigma: Vec<f64>,
    /// Widths within a panel are identical to the last bit, which differences of sigma are not.
    widths: Vec<f64>,
}

impl Grid {
    /// `segments` segments distributed over the panels between `kinks` (ascending, inside (0,
    /// 1)) in proportion to their widths, at least one each.
    pub fn new(segments: usize, kinks: &[f64]) -> Self {
        let edges = [&[0.0], kinks, &[1.0]].concat();
        let widths: Vec<f64> = edges.windows(2).map(|w| w[1] - w[0]).collect();
        let mut counts = vec![1_usize; widths.len()];
        for _ in widths.len()..segments {
            // The next segment goes to the panel with the longest segments.
            let width = |panel: usize| widths[panel] / counts[panel] as f64;
            let longest = (0..widths.len()).max_by(|&a, &b| width(a).total_cmp(&width(b)));
            counts[longest.expect("at least one panel")] += 1;
        }
        let mut grid = Grid {
            sigma: vec![0.0],
            widths: Vec::new(),
        };
        for ((start, width), count) in edges.iter().zip(widths).zip(counts) {
            let nodes = (1..=count).map(|i| start + width * i as f64 / count as f64);
            grid.sigma.extend(nodes);
            grid.widths.extend(vec![width / count as f64; count]);
        }
        *grid.sigma.last_mut().expect("at least one node") = 1.0;
        grid
    }

    /// The grid whose nodes are `stations`: made with this number of segments, or with a half,
    /// a quarter ... of it and refined, which differs if there are kinks.
    pub fn from_stations(stations: &[f64], kinks: &[f64]) -> Self {
        let segments = stations.len() - 1;
        let grid = Grid::new(segments, kinks);
        let apart = |grid: &Grid| {
            let pairs = grid.sigma.iter().zip(stations);
            grid.segments() != segments
                || pairs
                    .into_iter()
                    .any(|(a, b)| (a - b).abs() > STATION_ROUNDING)
        };
        let mut nested = grid.clone();
        let mut halvings = 0;
        while apart(&nested) && segments.is_multiple_of(2 << halvings) {
            halvings += 1;
            nested = Grid::new(segments >> halvings, kinks);
            nested = (0..halvings).fold(nested, |grid, _| grid.refined());
        }
        if apart(&nested) { grid } else { nested }
    }

    /// This grid with every segment halved.
    pub fn refined(&self) -> Self {
        self.subdivided_grid(|a, b, _| [a, 0.5 * (a + b)])
    }

    /// This grid with every segment cut in three.
    pub fn tripled(&self) -> Self {
        self.subdivided_grid(|a, b, third| [a, a + third, b - third])
    }

    /// The grid with every second node; a kink may then lie inside a segment. `None` unless the
    /// segments are pairs of equal ones.
    pub fn coarsened(&self) -> Option<Self> {
        let pairs = self.widths.chunks(2);
        let equal = |pair: &[f64]| matches!(pair, [a, b] if a == b);
        pairs.clone().all(equal).then(|| Grid {
            sigma: self.sigma.iter().copied().step_by(2).collect(),
            widths: pairs.map(|pair| 2.0 * pair[0]).collect(),
        })
    }

    /// This grid with every segment divided in N: `nodes` gives the first N nodes of a segment from
    /// its ends and the new width.
    fn subdivided_grid<const N: usize>(&self, nodes: impl Fn(f64, f64, f64) -> [f64; N]) -> Self {
        let widths = self.widths.iter().map(|width| width / N as f64);
        let segments = self.sigma.windows(2).zip(widths.clone());
        let starts = segments.flat_map(|(ends, width)| nodes(ends[0], ends[1], width));
        Grid {
            sigma: starts.chain([1.0]).collect(),
            widths: widths.flat_map(|width| [width; N]).collect(),
        }
    }

    /// Number of segments of each rod.
    pub fn segments(&self) -> usize {
        self.sigma.len() - 1
    }

    /// Node fractions, base to tip.
    pub fn sigma(&self) -> &[f64] {
        &self.sigma
    }

    /// The node nearest to a fraction of the length.
    pub fn nearest_node(&self, sigma: f64) -> usize {
        let after = self
            .sigma
            .partition_point(|at| *at < sigma)
            .min(self.segments());
        let before = after.saturating_sub(1);
        match sigma - self.sigma[before] < self.sigma[after] - sigma {
            true => before,
            false => after,
        }
    }

    /// Midpoint of segment `i`.
    pub fn segment_midpoint(&self, i: usize) -> f64 {
        0.5 * (self.sigma[i] + self.sigma[i + 1])
    }

    /// Width of segment `i` as a fraction of the length.
    pub fn segment_width(&self, i: usize) -> f64 {
        self.widths[i]
    }

    /// The integral of a density over the halves of both segments at node `i`, by its values there: of
    /// each half on its own side where the density jumps.
    pub fn node_integral<T>(&self, i: usize, density: impl Fn(RodPlace) -> T) -> T
    where
        T: Copy + PartialEq + Add<Output = T> + Mul<f64, Output = T>,
    {
        let [base, tip] = RodPlace::both_sides(self.sigma[i]).map(density);
        if base == tip || i == 0 || i == self.segments() {
            return base * self.node_weight(i);
        }
        base * (0.5 * self.widths[i - 1]) + tip * (0.5 * self.widths[i])
    }

    /// Trapezoidal weight of node `i` as a fraction of the length.
    pub fn node_weight(&self, i: usize) -> f64 {
        let width = |i: usize| self.widths.get(i).copied().unwrap_or(0.0);
        0.5 * (width(i.wrapping_sub(1)) + width(i))
    }
}

impl Leaf {
    /// The sections of all segments, rod after rod, with the rest shapes of their middles.
    fn sections_on(&self, grid: &Grid) -> Vec<Section> {
        let segments = (0..self.rods()).flat_map(|j| (0..grid.segments()).map(move |i| (j, i)));
        segments
            .map(|(j, i)| self.section(j, grid.segment_midpoint(i), grid.segment_width(i)))
            .collect()
    }

    /// Gives the segments of all rods, rod after rod, the rest shape between their nodes, if tissue
    /// ties the rods.
    fn fit_rest_shapes(&self, grid: &Grid, sections: &mut [Section]) {
        if !self.has_tissue() {
            return;
        }
        let natural = Natural::new(self.scenario(), true);
        // As a motion changes them: with the chords of the natural leaf.
        let factor = (self.scenario().natural.as_ref()).map_or(1.0, |it| it.factor);
        for (j, sections) in sections.chunks_mut(grid.segments()).enumerate() {
            if self.is_straight_at_rest(j) {
                continue;
            }
            let mut before = natural.vein_pose(j, 0.0);
            for (section, sigma) in sections.iter_mut().zip(&grid.sigma()[1..]) {
                let next = natural.vein_pose(j, *sigma);
                let chord = (next.position - before.position) / (self.scale.length * section.ds);
                let [from, to] = [before, next].map(|pose| pose.rotation);
                section.rest_strain = rotation::midpoint(from, to).inverse() * chord;
                section.rest_curvature = factor * rotation::log(from.conjugate() * to) / section.ds;
                before = next;
            }
        }
    }

    /// Whether a rod at rest is straight and stretched alike everywhere.
    fn is_straight_at_rest(&self, j: usize) -> bool {
        let rod = &self.scenario().rods[j];
        let [_, bends @ ..] = &rod.rest_curvature;
        let even = matches!(rod.rest_stretch, Profile::Constant(_));
        even && bends.iter().all(|of| of.max_abs() == 0.0)
    }
}

/// Loads on a rod per weight of its nodes, except the force on its tip.
#[derive(Clone, Copy)]
pub struct RodLoad {
    /// Dead load that all rods share.
    pub dead: DVec3,
    /// Force on the tip, whole.
    pub tip: DVec3,
    /// Coupling with the previous rod, with the next, and with the rod's own mirror image.
    pub previous: DVec3,
    pub next: DVec3,
    pub image: DVec3,
}

/// What acts on a node besides its segments.
#[derive(Clone, Copy, Debug, Default)]
pub struct NodeLoad {
    /// Moment of the tissue.
    pub moment: DVec3,
    /// Force of loads, coupling and tissue.
    pub force: DVec3,
    /// Potential energy; that of a gap belongs to its lower rod.
    pub energy: f64,
}

/// The [`RodLoad`] of each rod of a group, component by component.
#[derive(Clone, Copy)]
pub struct GroupLoads {
    dead: [NumberGroup; 3],
    tip: [NumberGroup; 3],
    previous: [NumberGroup; 3],
    next: [NumberGroup; 3],
    image: [NumberGroup; 3],
}

/// Arranges the loads of the rods of a group by components.
#[inline(always)]
pub fn group_loads(of: [RodLoad; GROUP]) -> GroupLoads {
    let vectors = |load: fn(&RodLoad) -> DVec3| group_components(of.each_ref().map(load));
    GroupLoads {
        dead: vectors(|load| load.dead),
        tip: vectors(|load| load.tip),
        previous: vectors(|load| load.previous),
        next: vectors(|load| load.next),
        image: vectors(|load| load.image),
    }
}

/// The [`RodLoad`] of several rods, as vectors in lanes.
#[derive(Clone, Copy)]
pub struct LaneRodLoads<S: Simd> {
    dead: Vectors<S>,
    tip: Vectors<S>,
    previous: Vectors<S>,
    next: Vectors<S>,
    image: Vectors<S>,
}

/// Forces of dead loads and coupling on a node of several rods.
#[derive(Clone, Copy)]
pub struct LaneNodeForces<S: Simd> {
    pub force: Vectors<S>,
    /// Potential energy; that of a gap belongs to its lower rod.
    pub energy: Lanes<S>,
}

impl<S: Simd> LaneRodLoads<S> {
    /// The loads on the lanes from `part` on.
    #[inline(always)]
    pub fn load_group(simd: S, group: &GroupLoads, part: usize) -> Self {
        let vectors = |load: &[NumberGroup; 3]| Vectors::load_group(simd, load, part);
        LaneRodLoads {
            dead: vectors(&group.dead),
            tip: vectors(&group.tip),
            previous: vectors(&group.previous),
            next: vectors(&group.next),
            image: vectors(&group.image),
        }
    }

    /// Forces on nodes, from the positions of the nodes on the previous rods, of these nodes, and of
    /// those on the next rods.
    #[inline(always)]
    pub fn node_forces(
        &self,
        [previous, x, next]: [Vectors<S>; 3],
        weights: NodeWeights,
        tip: bool,
    ) -> LaneNodeForces<S> {
        let simd = x.x.simd;
        let (weight, half) = (Lanes::splat(simd, weights.load), Lanes::splat(simd, 0.5));
        let coupling_weight = Lanes::splat(simd, weights.coupling);
        let mut force = self.dead.scale(weight);
        if tip {
            force = force + self.tip;
        }
        let to_image = (self.image * x).scale(coupling_weight);
        let stretch = next - x;
        let pull = (self.next * stretch).scale(coupling_weight);
        let energy = half * (pull.dot(stretch) + to_image.dot(x)) - force.dot(x);
        let push = (self.previous * (x - previous)).scale(coupling_weight);
        LaneNodeForces {
            force: force + pull - push - to_image,
            energy,
        }
    }

    /// The contribution of the coupling to the diagonal of nodes, per weight.
    #[inline(always)]
    pub fn coupling_stiffness(&self) -> Vectors<S> {
        self.previous + self.next + self.image
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panels_meet_at_the_kinks_and_weights_add_to_one() {
        let kinks = [0.2, 0.25, 0.9];
        let grid = Grid::new(11, &kinks);
        for (grid, segments) in [(grid.refined(), 22), (grid.tripled(), 33), (grid, 11)] {
            assert_eq!(grid.segments(), segments);
            assert!(kinks.iter().all(|kink| grid.sigma().contains(kink)));
            let sum: f64 = (0..=segments).map(|i| grid.node_weight(i)).sum();
            assert!((sum - 1.0).abs() < 1e-15);
            assert_eq!(grid.refined().coarsened(), Some(grid));
        }
        assert_eq!(Grid::new(11, &kinks).coarsened(), None);
        let [fine, coarse] = [32, 8].map(|segments| Grid::new(segments, &[0.3404]));
        for grid in [fine, coarse.refined().refined()] {
            let through = Grid::from_stations(grid.sigma(), &[0.3404]);
            let pairs = through.sigma().iter().zip(grid.sigma());
            assert!(pairs.map(|(a, b)| (a - b).abs()).all(|off| off < 1e-15));
            assert_eq!(through.segments(), grid.segments());
        }
        // However many kinks there are, every panel has a segment.
        assert_eq!(Grid::new(1, &[0.25, 0.5]).segments(), 3);
    }
}
