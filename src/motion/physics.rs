//! What a leaf needs to move: masses, damping, time-dependent loads, and the air with its drag on the
//! segments. Dimensionless: time in units of sqrt(rho L^4/A).
//!
//! The force of wind per length of a rod is c |u_n| u_n with c = rho_a C_D w L/(2 rho), u_n being the part of
//! the air's velocity relative to the rod that is normal to its tangent. It is taken in the middle of
//! every segment, where the tangent is that of its chord and the velocity the mean of its ends', to
//! each of which half of it is applied: of second order in the length of the segments, and its power
//! is that of the mean velocity.

use crate::leaf::{DiscreteLeaf, Grid, Leaf, Lever, Loads, NodeFreedom, Scale, State};
use crate::rod::Wrench;
use crate::rotation::{cross_matrix, outer};
use crate::scenario::{Dynamics, PolarInertia, Profile, RodPlace, Schedule, SupportMotion};
use glam::{DMat3, DQuat, DVec3};
use std::cmp::Ordering;
use std::ops::Add;

/// Inertia of a node: the mass and the moments of inertia of the adjacent half-segments, and the
/// masses on points there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inertia {
    /// Mass.
    pub mass: f64,
    /// Moments of inertia about d1, d2 and d3, without those of masses off the axis.
    pub principal: DVec3,
    /// Masses off the axis; `None` without any.
    pub off_axis: Option<OffAxisMass>,
}

/// Masses off the axis of a node, along its directors. Their velocity is u + w x R o, with the velocity u of the node,
/// its angular velocity w and their offset o.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OffAxisMass {
    /// The sum of masses times offsets.
    pub first_moment: DVec3,
    /// Their moments of inertia about the node.
    pub tensor: DMat3,
}

impl OffAxisMass {
    fn of_point(it: &PointMass) -> Self {
        let squared = DMat3::from_diagonal(DVec3::splat(it.offset.length_squared()));
        OffAxisMass {
            first_moment: it.mass * it.offset,
            tensor: it.mass * (squared - outer(it.offset, it.offset)),
        }
    }

    /// The moments of inertia along the lab axes. Apart from the rest, so that a node without such masses costs no more.
    #[cold]
    fn tensor_along_lab_axes(&self, rotation: DQuat) -> DMat3 {
        let frame = DMat3::from_quat(rotation);
        frame * self.tensor * frame.transpose()
    }
}

impl Add for OffAxisMass {
    type Output = OffAxisMass;

    fn add(self, other: OffAxisMass) -> OffAxisMass {
        OffAxisMass {
            first_moment: self.first_moment + other.first_moment,
            tensor: self.tensor + other.tensor,
        }
    }
}

impl Inertia {
    /// By how much the moments of inertia about d1 and d3 exceed that about d2. A node that has the same about d2 and d3
    /// needs no d3.
    #[inline]
    fn excess(&self) -> [f64; 2] {
        let DVec3 { x, y, z } = self.principal;
        [x - y, z - y]
    }

    /// Inertia tensor of the node rotated by `rotation`, along the lab axes.
    #[inline]
    pub fn tensor(&self, rotation: DQuat) -> DMat3 {
        let ([excess_1, excess_3], d1) = (self.excess(), rotation * DVec3::X);
        let mut on_axis = DMat3::from_diagonal(DVec3::splat(self.principal.y));
        on_axis += outer(d1, d1) * excess_1;
        if excess_3 != 0.0 {
            let d3 = rotation * DVec3::Z;
            on_axis += outer(d3, d3) * excess_3;
        }
        match &self.off_axis {
            None => on_axis,
            Some(off_axis) => on_axis + off_axis.tensor_along_lab_axes(rotation),
        }
    }

    /// Whether there are masses off the axis: rotations and displacements are coupled then.
    pub fn is_off_axis(&self) -> bool {
        self.off_axis.is_some()
    }

    /// The sum s of masses times their distances from the node, along the lab axes.
    pub fn first_moment(&self, rotation: DQuat) -> DVec3 {
        let own = self.off_axis.as_ref().map(|it| it.first_moment);
        own.map_or(DVec3::ZERO, |own| rotation * own)
    }

    /// The angular momentum J w + s x u about the node and the momentum m u + w x s of a node with these velocities
    /// (w, u).
    pub fn momentum(&self, rotation: DQuat, [spin, velocity]: [DVec3; 2]) -> [DVec3; 2] {
        let (angular, linear) = (self.tensor(rotation) * spin, self.mass * velocity);
        if !self.is_off_axis() {
            return [angular, linear];
        }
        let s = self.first_moment(rotation);
        [angular + s.cross(velocity), linear + spin.cross(s)]
    }

    /// What couples the rotation (rows) and the displacement of a node in the mass matrix, if masses off the axis do.
    /// Held components have no mass.
    pub fn coupling(
        &self,
        rotation: DQuat,
        freedom: impl FnOnce() -> NodeFreedom,
    ) -> Option<DMat3> {
        let free = Some(freedom).filter(|_| self.is_off_axis())?();
        let axes = free.of_displacement(DVec3::ONE);
        let coupling = cross_matrix(self.first_moment(rotation)) * DMat3::from_diagonal(axes);
        free.rotation.then_some(coupling)
    }

    /// The moment w x J w and the force w x (w x s) that a steady rotation w takes.
    pub fn centrifugal_wrench(&self, rotation: DQuat, spin: DVec3) -> Wrench {
        let angular = self.tensor(rotation) * spin;
        Wrench {
            moment: spin.cross(angular),
            force: match self.is_off_axis() {
                true => spin.cross(spin.cross(self.first_moment(rotation))),
                false => DVec3::ZERO,
            },
        }
    }

    /// The kinetic energy of a node with these velocities (w, u).
    pub fn kinetic_energy(&self, rotation: DQuat, [spin, velocity]: [DVec3; 2]) -> f64 {
        let ([excess_1, excess_3], about_1) = (self.excess(), spin.dot(rotation * DVec3::X));
        let mut turning = self.principal.y * spin.length_squared() + excess_1 * about_1 * about_1;
        if excess_3 != 0.0 {
            turning += excess_3 * spin.dot(rotation * DVec3::Z).powi(2);
        }
        let on_axis = 0.5 * (self.mass * velocity.length_squared() + turning);
        on_axis + self.off_axis_energy(rotation, [spin, velocity])
    }

    /// What masses off the axis add to the kinetic energy of a node with these velocities (w, u): s . (u x w) + w . J w/2
    /// with their own J.
    fn off_axis_energy(&self, rotation: DQuat, [spin, velocity]: [DVec3; 2]) -> f64 {
        let Some(off_axis) = &self.off_axis else {
            return 0.0;
        };
        let own = rotation.conjugate() * spin;
        let coupled = self.first_moment(rotation).dot(velocity.cross(spin));
        coupled + 0.5 * own.dot(off_axis.tensor * own)
    }
}

/// A mass on a point of a vein.
#[derive(Clone, Copy, Debug)]
struct PointMass {
    vein: usize,
    /// Fraction of the vein's length.
    sigma: f64,
    mass: f64,
    /// Where it is off the axis, along the directors.
    offset: DVec3,
}

/// A factor of loads in time.
#[derive(Clone, Debug)]
struct LoadFactor {
    factor: Schedule<f64>,
    /// The factor at time 0.
    first: f64,
    /// Whether the load is there: not the weight of a mass that has not landed.
    acts: bool,
}

impl LoadFactor {
    fn present_value(&self, value: impl FnOnce(&Schedule<f64>) -> f64) -> f64 {
        if self.acts { value(&self.factor) } else { 0.0 }
    }
}

/// A mass that lands on a point of a vein. Dimensionless.
#[derive(Clone, Copy, Debug)]
pub struct LandingMass {
    /// Number of the point.
    pub point: usize,
    /// The vein, and the fraction of its length.
    pub vein: usize,
    pub sigma: f64,
    pub mass: f64,
    /// Where it lands off the axis, along the directors.
    pub offset: DVec3,
    pub velocity: DVec3,
    pub time: f64,
    /// Number of the factor of its weight.
    factor: usize,
}

impl LandingMass {
    /// Its kinetic energy before it lands.
    pub fn kinetic_energy(&self) -> f64 {
        0.5 * self.mass * self.velocity.length_squared()
    }
}

/// Duration of a motion and the interval between its outputs.
#[derive(Clone, Copy, Debug)]
pub struct MotionTimes {
    pub duration: f64,
    pub interval: f64,
}

/// Inertia, damping and loads of a leaf.
#[derive(Clone, Debug)]
pub struct Physics {
    dynamics: Dynamics,
    scale: Scale,
    /// Unit of time, in that of the scenario.
    pub time_unit: f64,
    /// Unit of mass per length, in that of the scenario: the mean density.
    density_unit: f64,
    /// External damping: every velocity decays at this rate.
    pub damping: f64,
    /// Retardation time of internal damping: stresses follow strain plus this times its rate.
    pub retardation: f64,
    /// Part of the loads of single veins, and of the dead moments on points.
    rod_load_factor: f64,
    dead_moment_factor: f64,
    /// Factor of the loads that turn with the sections, and of the moments along veins.
    follower_factor: f64,
    point_masses: Vec<PointMass>,
    /// Velocity of the air, if there is wind, in the scenario's units.
    air: Option<Schedule<[f64; 3]>>,
    /// Factors of loads of single veins that vary in time.
    load_factors: Vec<LoadFactor>,
    /// The supports that move, if any do.
    pub support_motion: Option<Box<SupportMotion>>,
    /// The masses that have not landed, the next one last.
    landing_masses: Vec<LandingMass>,
    /// The loads, if they are constant.
    constant_loads: Option<Loads>,
    /// The factor of the rest curvatures, if it is constant.
    pub constant_rest_factor: Option<f64>,
    /// Times at which a load, the air's velocity or the factor may change its slope, in increasing
    /// order.
    knots: Vec<f64>,
}

/// What is assumed of the small motions of a leaf in place of what its scenario leaves out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AssumedMotion {
    /// The same mass per length everywhere.
    pub uniform_density: bool,
    /// Sections without rotary inertia.
    pub no_rotary_inertia: bool,
    /// No damping, outside wind.
    pub no_damping: bool,
}

impl AssumedMotion {
    /// What is assumed, in words.
    pub fn words(self) -> impl Iterator<Item = &'static str> {
        let all = [
            (self.uniform_density, "uniform density"),
            (self.no_rotary_inertia, "no rotary inertia"),
            (self.no_damping, "no damping"),
        ];
        all.into_iter().filter_map(|(is, word)| is.then_some(word))
    }
}

impl Physics {
    /// Inertia, damping and loads of a leaf's scenario.
    pub fn new(leaf: &Leaf) -> Self {
        let scenario = leaf.scenario();
        let factors: Vec<_> = scenario.load_factors().cloned().collect();
        let dynamics = scenario.dynamics.clone();
        let supports = scenario.support_motion.clone();
        let mut physics = Physics::from_dynamics(leaf, dynamics, factors, supports);
        physics.add_landing_masses(leaf);
        let unit = physics.density_unit * physics.scale.length;
        let points = leaf.scenario().points.iter().filter(|it| it.mass > 0.0);
        let masses = points.map(|it| PointMass {
            vein: it.vein,
            sigma: it.at,
            mass: it.mass / unit,
            offset: leaf.point_offset(it),
        });
        physics.point_masses = masses.collect();
        physics
    }

    fn add_landing_masses(&mut self, leaf: &Leaf) {
        let scenario = leaf.scenario();
        let weight = match &scenario.factored {
            Some(loads) => loads.factor.clone(),
            None => Schedule::constant(1.0),
        };
        for (point, landing) in scenario.landings() {
            self.landing_masses.push(LandingMass {
                point,
                vein: scenario.points[point].vein,
                sigma: scenario.points[point].at,
                mass: landing.mass / (self.density_unit * self.scale.length),
                offset: leaf.point_offset(&scenario.points[point]),
                velocity: DVec3::from_array(landing.velocity)
                    * (self.time_unit / self.scale.length),
                time: landing.from / self.time_unit,
                factor: self.load_factors.len(),
            });
            self.load_factors.push(LoadFactor {
                factor: weight.clone(),
                first: 0.0,
                acts: false,
            });
            self.constant_loads = None;
        }
        self.landing_masses.sort_by(|a, b| {
            (b.time, b.point)
                .partial_cmp(&(a.time, a.point))
                .unwrap_or(Ordering::Equal)
        });
    }

    /// The mass that lands next, if one is left.
    pub fn next_landing(&self) -> Option<LandingMass> {
        self.landing_masses.last().copied()
    }

    /// The time at which a mass lands next; infinite if none is left.
    pub fn next_landing_time(&self) -> f64 {
        self.next_landing().map_or(f64::INFINITY, |it| it.time)
    }

    /// Adds the mass that lands next to the leaf.
    pub fn land_next_mass(&mut self) {
        let Some(landing) = self.landing_masses.pop() else {
            return;
        };
        self.load_factors[landing.factor].acts = true;
        self.point_masses.push(PointMass {
            vein: landing.vein,
            sigma: landing.sigma,
            mass: landing.mass,
            offset: landing.offset,
        });
    }

    /// Whether masses are off the axes, or will land there.
    pub fn has_masses_off_axis(&self) -> bool {
        let offsets = self.point_masses.iter().map(|it| it.offset);
        let landing = self.landing_masses.iter().map(|it| it.offset);
        offsets.chain(landing).any(|offset| offset != DVec3::ZERO)
    }

    /// Inertia, damping and loads of the small motions about an equilibrium, on which a verdict on its
    /// stability depends: only what the scenario gives, and what is assumed in place of what it leaves
    /// out.
    pub fn for_small_motions(leaf: &Leaf) -> (Self, AssumedMotion) {
        let given = &leaf.scenario().dynamics;
        let preset = Dynamics::default_for(&leaf.scenario().rods);
        let assumed = AssumedMotion {
            uniform_density: given.density == preset.density,
            no_rotary_inertia: given.polar_inertia == PolarInertia::Same,
            no_damping: given.assumes_damping && given.internal_damping == 0.0,
        };
        let mut physics = Physics::new(leaf);
        if assumed.no_rotary_inertia {
            let none = [0.0; 2].map(Profile::Constant);
            physics.dynamics.rotary_inertia = vec![none; given.density.len()];
        }
        if given.assumes_damping {
            physics.damping = 0.0;
        }
        (physics, assumed)
    }

    /// The defaults for scenarios without dynamics, under the loads at
    /// rest: the damped motion of a relaxation, in which masses on points are weights alone.
    pub fn for_relaxation(leaf: &Leaf) -> Self {
        let s = leaf.scenario();
        let dynamics = Dynamics::default_for(&s.rods);
        let loaded = dynamics.with_loads(s.gravity, s.tip_force, s.tip_moment);
        Physics::from_dynamics(leaf, loaded, Vec::new(), None)
    }

    fn from_dynamics(
        leaf: &Leaf,
        dynamics: Dynamics,
        factors: Vec<Schedule<f64>>,
        support_motion: Option<Box<SupportMotion>>,
    ) -> Self {
        let scale = leaf.scale;
        let densities = dynamics.density.iter().map(|density| density.at(0.5));
        let density = densities.sum::<f64>() / dynamics.density.len() as f64;
        let time = scale.length * scale.length * (density / scale.stiffness).sqrt();
        let still = load_schedules(&dynamics)
            .iter()
            .all(|load| load.is_constant());
        let still = still && factors.is_empty();
        let points = leaf.scenario().points.iter().filter(|it| !it.follows);
        let mut turned = points.filter_map(|it| it.in_time.as_ref());
        let turned = !factors.is_empty() && turned.any(|it| it.moment != [0.0; 3]);
        let air = leaf
            .scenario()
            .wind
            .as_ref()
            .map(|wind| wind.velocity.clone());
        let mut physics = Physics {
            rod_load_factor: leaf.loads.rod_load_factor,
            dead_moment_factor: if turned {
                1.0
            } else {
                leaf.loads.dead_moment_factor
            },
            follower_factor: match !factors.is_empty() && leaf.scenario().has_followers_in_time() {
                true => 1.0,
                false => leaf.loads.follower_factor,
            },
            constant_loads: None,
            point_masses: Vec::new(),
            knots: {
                let supports = support_motion.iter().flat_map(|it| it.schedules());
                let vectors = load_schedules(&dynamics).into_iter().chain(&air);
                schedule_knots(&dynamics, vectors.chain(supports), &factors, time)
            },
            load_factors: (factors.into_iter())
                .map(|factor| LoadFactor {
                    first: factor.at(0.0),
                    factor,
                    acts: true,
                })
                .collect(),
            landing_masses: Vec::new(),
            support_motion,
            air,
            constant_rest_factor: dynamics.rest.is_constant().then(|| dynamics.rest.at(0.0)),
            scale,
            time_unit: time,
            density_unit: density,
            damping: dynamics.external_damping / density * time,
            retardation: dynamics.internal_damping / time,
            dynamics,
        };
        physics.constant_loads = still.then(|| physics.loads(0.0));
        physics
    }

    /// Whether the base is clamped.
    pub fn clamped(&self) -> bool {
        self.dynamics.clamped
    }

    /// The unit of masses, in that of the scenario.
    pub fn mass_unit(&self) -> f64 {
        self.density_unit * self.scale.length
    }

    /// Inertia of node `i` of rod `j`.
    pub fn inertia(&self, leaf: &DiscreteLeaf, j: usize, i: usize) -> Inertia {
        let sigma = leaf.grid.sigma()[i];
        let length = leaf.grid.node_weight(i) * leaf.leaf.length(j) * leaf.leaf.share(j);
        let rotary = self.density_unit * self.scale.length * self.scale.length;
        // Where a blade ends in a point its last node has the inertia of the stretch around it.
        let weight = leaf.grid.node_weight(i);
        let around = |of: &Profile| match of.at(sigma) > 0.0 {
            true => mean_around_node(&leaf.grid, i, of),
            false => of.at((0.5 * weight - sigma).abs()),
        };
        let here = |it: &&PointMass| it.vein == j && leaf.grid.nearest_node(it.sigma) == i;
        let on_points = self.point_masses.iter().filter(here).map(|it| it.mass);
        let on_points = leaf.leaf.share(j) * on_points.sum::<f64>();
        let beside = self.point_masses.iter().filter(here);
        let beside = beside.filter(|it| it.offset != DVec3::ZERO);
        let off_axis = beside.map(OffAxisMass::of_point).reduce(OffAxisMass::add);
        let dynamics = &self.dynamics;
        let given = &dynamics.rotary_inertia[j];
        let [about_2, about_3] = given.each_ref().map(|it| length * around(it) / rotary);
        let polar = match dynamics.polar_inertia {
            PolarInertia::Sum => about_2 + about_3,
            PolarInertia::Same => about_2,
        };
        Inertia {
            mass: length * around(&dynamics.density[j]) / self.density_unit + on_points,
            principal: DVec3::new(polar, about_2, about_3),
            off_axis,
        }
    }

    /// Duration of the motion and output interval.
    pub fn times(&self) -> MotionTimes {
        MotionTimes {
            duration: self.dynamics.duration / self.time_unit,
            interval: self.dynamics.output_interval / self.time_unit,
        }
    }

    /// The loads at a time.
    pub fn loads(&self, time: f64) -> Loads {
        let at = time * self.time_unit;
        self.evaluate_loads(|load| load.at(at))
    }

    /// The means of the loads over an interval.
    pub fn mean_loads(&self, interval: [f64; 2]) -> Loads {
        let [from, to] = interval.map(|time| time * self.time_unit);
        self.evaluate_loads(|load| load.mean(from, to))
    }

    /// Sets the loads of a leaf to those of a time.
    pub fn apply_loads(&self, leaf: &mut DiscreteLeaf, time: f64) {
        leaf.loads = self.loads(time);
        self.apply_load_factors(leaf, |factor| factor.at(time * self.time_unit));
    }

    /// Sets the loads of a leaf to their means over an interval.
    pub fn apply_mean_loads(&self, leaf: &mut DiscreteLeaf, interval: [f64; 2]) {
        leaf.loads = self.mean_loads(interval);
        let [from, to] = interval.map(|time| time * self.time_unit);
        self.apply_load_factors(leaf, |factor| factor.mean(from, to));
    }

    fn apply_load_factors(&self, leaf: &mut DiscreteLeaf, value: impl Fn(&Schedule<f64>) -> f64) {
        if !self.load_factors.is_empty() {
            leaf.set_scheduled_factors(|number| self.load_factors[number].present_value(&value));
        }
    }

    /// The factors at a time of the loads of single veins that vary.
    pub fn load_factors(&self, time: f64) -> impl Iterator<Item = f64> {
        let at = time * self.time_unit;
        let factors = self.load_factors.iter();
        factors.map(move |it| it.present_value(|factor| factor.at(at)))
    }

    /// The sum of the present forces of loads of single veins that vary, less those at time 0, times vectors of
    /// the nodes.
    pub fn scheduled_excess(
        &self,
        leaf: &DiscreteLeaf,
        vectors: impl Fn(usize, usize) -> DVec3,
    ) -> f64 {
        let Some(scheduled) = &leaf.scheduled_loads else {
            return 0.0;
        };
        let excess = |number: usize| scheduled.factors[number] - self.load_factors[number].first;
        let forces = scheduled.forces.iter();
        forces
            .map(|it| excess(it.factor) * it.force.dot(vectors(it.rod, it.node)))
            .sum()
    }

    /// The present forces off the axes that vary, less those at time 0.
    pub fn scheduled_lever_excess(&self, leaf: &DiscreteLeaf) -> impl Iterator<Item = Lever> {
        let scheduled = leaf.scheduled_loads.iter();
        let levers = scheduled.flat_map(|it| it.levers.iter().map(|lever| (&it.factors, lever)));
        levers.map(|(factors, (number, lever))| Lever {
            force: (factors[*number] - self.load_factors[*number].first) * lever.force,
            ..*lever
        })
    }

    /// The loads with these values, without dimensions.
    fn evaluate_loads(&self, value: impl Fn(&Schedule<[f64; 3]>) -> [f64; 3]) -> Loads {
        if let Some(loads) = self.constant_loads {
            return loads;
        }
        let loads = load_schedules(&self.dynamics).map(|load| DVec3::from_array(value(load)));
        let ([gravity, tip_force, tip_moment], force) = (loads, self.scale.force());
        Loads {
            gravity: gravity * (self.scale.length / force),
            tip_force: tip_force / force,
            tip_moment: tip_moment / self.scale.moment(),
            rod_load_factor: self.rod_load_factor,
            dead_moment_factor: self.dead_moment_factor,
            follower_factor: self.follower_factor,
        }
    }

    /// Whether the scenario has wind.
    pub fn is_windy(&self) -> bool {
        self.air.is_some()
    }

    /// The velocity of the air at a time.
    pub fn air(&self, time: f64) -> DVec3 {
        self.evaluate_air_velocity(|velocity| velocity.at(time * self.time_unit))
    }

    /// The mean of the air's velocity over an interval.
    pub fn mean_air(&self, interval: [f64; 2]) -> DVec3 {
        let [from, to] = interval.map(|time| time * self.time_unit);
        self.evaluate_air_velocity(|velocity| velocity.mean(from, to))
    }

    /// The largest speed of the air.
    pub fn strongest_wind(&self) -> f64 {
        let speeds = self.air.iter().flat_map(Schedule::bounds);
        let speeds = speeds.map(|value| DVec3::from_array(value).length());
        speeds.fold(0.0, f64::max) * self.time_unit / self.scale.length
    }

    fn evaluate_air_velocity(&self, value: impl Fn(&Schedule<[f64; 3]>) -> [f64; 3]) -> DVec3 {
        let velocity = self.air.as_ref().map_or([0.0; 3], value);
        DVec3::from_array(velocity) * (self.time_unit / self.scale.length)
    }

    /// The factor of |u_n| u_n in the drag on segment `i` of rod `j`: rho_a C_D w L/(2 rho) times
    /// its length; zero without wind.
    pub fn drag(&self, leaf: &DiscreteLeaf, j: usize, i: usize) -> f64 {
        let length = leaf.grid.segment_width(i) * leaf.leaf.length(j);
        leaf.leaf.scenario().wind.as_ref().map_or(0.0, |wind| {
            let width = wind.width[j].at(leaf.grid.segment_midpoint(i));
            let pressed = 0.5 * wind.density * wind.drag * width * self.scale.length;
            pressed / self.density_unit * length
        })
    }

    /// The first time after `time` at which a load, the air's velocity or the factor of the rest curvatures may
    /// change its slope; infinite if there is none. Not closer than [`MIN_KNOT_STEP`]: a jump
    /// within less takes that long.
    pub fn next_knot(&self, time: f64) -> f64 {
        let next = self.knots.partition_point(|&knot| knot <= time);
        let knot = self.knots.get(next).copied().unwrap_or(f64::INFINITY);
        knot.max(time + MIN_KNOT_STEP)
    }

    /// A time at which a load, the air's velocity or the factor of the rest curvatures has a pulse too short for steps that end at its
    /// knots, in the scenario's unit.
    pub fn unresolved_pulse_time(&self) -> Option<f64> {
        let (d, shortest) = (&self.dynamics, MIN_KNOT_STEP * self.time_unit);
        let supports = self.support_motion.iter().flat_map(|it| it.schedules());
        let mut loads = load_schedules(d)
            .into_iter()
            .chain(&self.air)
            .chain(supports);
        let of_loads = loads.find_map(|load| load.pulse_within(shortest));
        let mut factors = self
            .load_factors
            .iter()
            .map(|it| &it.factor)
            .chain([&d.rest]);
        of_loads.or_else(|| factors.find_map(|factor| factor.pulse_within(shortest)))
    }

    /// The factor of all rest curvatures at a time.
    pub fn rest_curvature_factor(&self, time: f64) -> f64 {
        let changing = || self.dynamics.rest.at(time * self.time_unit);
        self.constant_rest_factor.unwrap_or_else(changing)
    }

    /// The mean of the factor of all rest curvatures over an interval.
    pub fn mean_rest_curvature_factor(&self, interval: [f64; 2]) -> f64 {
        let [from, to] = interval.map(|time| time * self.time_unit);
        let changing = || self.dynamics.rest.mean(from, to);
        self.constant_rest_factor.unwrap_or_else(changing)
    }

    /// Whether loads vary in time.
    pub fn loads_vary(&self) -> bool {
        self.constant_loads.is_none()
    }

    /// Whether rest curvatures vary in time.
    pub fn rest_curvature_varies(&self) -> bool {
        self.constant_rest_factor.is_none()
    }

    /// Whether rest curvatures ever differ from the leaf's own.
    pub fn rest_curvature_differs(&self) -> bool {
        self.constant_rest_factor != Some(1.0)
    }
}

/// The mean of a profile over the halves of both segments at a node, by its values there.
fn mean_around_node(grid: &Grid, i: usize, profile: &Profile) -> f64 {
    let [base, tip] = RodPlace::both_sides(grid.sigma()[i]).map(|place| profile.at(place));
    match base == tip {
        true => base,
        false => grid.node_integral(i, |place| profile.at(place)) / grid.node_weight(i),
    }
}

/// Shortest step to a knot, in units of time: the accelerations of shorter ones are rounding.
const MIN_KNOT_STEP: f64 = 1e-6;

/// Gravity, and the force and the moment on a tip.
fn load_schedules(dynamics: &Dynamics) -> [&Schedule<[f64; 3]>; 3] {
    [&dynamics.gravity, &dynamics.tip_force, &dynamics.tip_moment]
}

/// The knots of everything that varies in time, over the unit of time.
fn schedule_knots<'s>(
    dynamics: &'s Dynamics,
    vectors: impl Iterator<Item = &'s Schedule<[f64; 3]>>,
    factors: &[Schedule<f64>],
    unit: f64,
) -> Vec<f64> {
    let end = dynamics.duration;
    let knots = vectors.flat_map(|vector| vector.knot_times(end));
    let factors = factors.iter().chain([&dynamics.rest]);
    let knots = knots.chain(factors.flat_map(|factor| factor.knot_times(end)));
    let mut knots: Vec<f64> = knots.map(|time| time / unit).collect();
    knots.sort_by(f64::total_cmp);
    knots
}

/// Ratio of the speed of the air relative to a leaf to that of the wind, for stable steps: a leaf may
/// move against the wind as fast as that blows.
const RELATIVE_WIND_RATIO: f64 = 2.0;

/// Wind on a leaf of a grid. Dimensionless.
#[derive(Clone, Debug)]
pub struct WindDrag {
    /// c times the length of every segment, rod after rod.
    factors: Vec<f64>,
    segments: usize,
}

/// The drag on a segment.
#[derive(Clone, Copy, Debug)]
pub struct SegmentDrag {
    factor: f64,
    /// Length of the chord.
    chord: f64,
    /// Unit tangent t of the chord.
    tangent: DVec3,
    /// t . u, u_n and |u_n|.
    tangential_velocity: f64,
    normal_velocity: DVec3,
    normal_speed: f64,
}

impl SegmentDrag {
    fn new(factor: f64, chord: DVec3, u: DVec3) -> Self {
        let tangent = chord.normalize_or_zero();
        let along = tangent.dot(u);
        let normal = u - along * tangent;
        SegmentDrag {
            factor,
            chord: chord.length(),
            tangent,
            tangential_velocity: along,
            normal_velocity: normal,
            normal_speed: normal.length(),
        }
    }

    /// The force of the air on the segment.
    pub fn force(&self) -> DVec3 {
        self.factor * self.normal_speed * self.normal_velocity
    }

    /// The derivative of the force with respect to the air's velocity: c (|u_n| P + u_n u_n/|u_n|),
    /// P being the projection normal to the tangent.
    pub fn velocity_derivative(&self) -> DMat3 {
        let normal = DMat3::IDENTITY - outer(self.tangent, self.tangent);
        let direction = self.normal_velocity.normalize_or_zero();
        self.factor * self.normal_speed * (normal + outer(direction, direction))
    }

    /// The derivative of the force with respect to the vector from one end to the other, as the
    /// tangent turns with it.
    pub fn chord_derivative(&self) -> DMat3 {
        let turned = self.factor * self.normal_speed * outer(self.tangent, self.normal_velocity);
        (self.tangential_velocity * self.velocity_derivative() + turned)
            * (-self.chord.max(f64::MIN_POSITIVE).recip())
    }
}

impl WindDrag {
    /// The wind on a leaf; `None` if its scenario has none.
    pub fn new(leaf: &DiscreteLeaf, physics: &Physics) -> Option<Self> {
        let segments = leaf.segments();
        let drag = |(j, i)| physics.drag(leaf, j, i);
        physics.is_windy().then(|| WindDrag {
            factors: leaf.rod_index_pairs(0..segments).map(drag).collect(),
            segments,
        })
    }

    /// Rod and number of every segment, and the drag on it, in `air` of this velocity, from the
    /// positions and the velocities of all nodes.
    pub fn drags<'a>(
        &'a self,
        state: &'a State,
        air: DVec3,
        velocity: impl Fn(usize) -> DVec3 + 'a,
    ) -> impl Iterator<Item = ((usize, usize), SegmentDrag)> + 'a {
        let segments = self.factors.iter().enumerate();
        segments.map(move |(k, &factor)| {
            let (j, i) = (k / self.segments, k % self.segments);
            let node = state.base(j) + i;
            let moving = 0.5 * (velocity(node) + velocity(node + 1));
            let chord = state.x[node + 1] - state.x[node];
            ((j, i), SegmentDrag::new(factor, chord, air - moving))
        })
    }

    /// Sets the forces on all nodes.
    pub fn set_forces(
        &self,
        state: &State,
        air: DVec3,
        velocity: impl Fn(usize) -> DVec3,
        forces: &mut [DVec3],
    ) {
        forces.fill(DVec3::ZERO);
        for ((j, i), drag) in self.drags(state, air, velocity) {
            let (node, half) = (state.base(j) + i, 0.5 * drag.force());
            forces[node] += half;
            forces[node + 1] += half;
        }
    }

    /// Upper bound on the rate at which the drag of the strongest wind makes velocities decay: of all
    /// nodes the largest sum of the absolute values of a row of the matrix of these rates.
    pub fn fastest_decay(&self, leaf: &DiscreteLeaf, physics: &Physics) -> f64 {
        let n = self.segments;
        let mut nodes = vec![[0.0; 2]; leaf.rods() * (n + 1)];
        for (k, factor) in self.factors.iter().enumerate() {
            let node = k / n * (n + 1) + k % n;
            nodes[node][0] += factor;
            nodes[node + 1][0] += factor;
        }
        for (j, i) in leaf.rod_index_pairs(0..=n) {
            nodes[j * (n + 1) + i][1] = physics.inertia(leaf, j, i).mass;
        }
        if leaf.tips_move_together() {
            let tips = (0..leaf.rods()).map(|j| nodes[j * (n + 1) + n]);
            let tip = tips.fold([0.0; 2], |[a, b], [c, d]| [a + c, b + d]);
            (0..leaf.rods()).for_each(|j| nodes[j * (n + 1) + n] = tip);
        }
        let rates = nodes.into_iter().map(|[factor, mass]| factor / mass);
        RELATIVE_WIND_RATIO * physics.strongest_wind() * rates.fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_are_those_of_the_force() {
        let (chord, u) = (DVec3::new(0.3, -0.2, 0.1), DVec3::new(1.1, 0.7, -0.4));
        let drag = |chord, u| SegmentDrag::new(0.7, chord, u);
        let (here, h) = (drag(chord, u), 1e-6);
        for axis in DVec3::AXES {
            let of = |to: f64, air: f64| drag(chord + to * axis, u + air * axis).force();
            let by_chord = (of(h, 0.0) - of(-h, 0.0)) / (2.0 * h);
            let by_velocity = (of(0.0, h) - of(0.0, -h)) / (2.0 * h);
            assert!((here.chord_derivative() * axis).distance(by_chord) < 1e-8);
            assert!((here.velocity_derivative() * axis).distance(by_velocity) < 1e-8);
        }
    }
}
