//! Loads on a leaf and its motion: weight, loads on points and along veins, dead or turning with the
//! sections, wind (the table `[wind]`),
//! and the mass, damping, duration and loads in time of a motion (the table `[dynamics]`).

use crate::scenario::format::Key;
use crate::scenario::format::entries::Entries;
use crate::scenario::format::error::ScenarioResult;
use crate::scenario::format::item::EntryValue;
use crate::scenario::profile::{Profile, RodPlace, knot_places};
use crate::scenario::schedule::{Schedule, scaled};
use crate::scenario::section::Property;
use crate::scenario::veins::{Rod, Scale, StiffnessSource};
use crate::words;
use glam::DVec3;

/// A load on a point of a vein, at rest.
#[derive(Clone, Debug, PartialEq)]
pub struct PointLoad {
    /// The vein, counted from 0.
    pub vein: usize,
    /// The place of the point, a fraction of the vein's length in (0, 1].
    pub at: f64,
    /// The force, besides the weight of the mass.
    pub force: [f64; 3],
    /// The moment; zero unless the leaf is a single rod or the load follows.
    pub moment: [f64; 3],
    /// Whether force and moment turn with the section: their components are along its directors d1, d2,
    /// d3 then, else along the lab axes. The weight of the mass is dead.
    pub follows: bool,
    /// The mass, which [`Scenario::g`](crate::scenario::Scenario::g) pulls; not negative.
    pub mass: f64,
    /// Where force and mass are off the axis, lengths along the directors d2 and d3 of the section.
    pub offset: [f64; 2],
    /// The force and the moment in time, if they vary; those at rest are those of time 0.
    pub in_time: Option<Box<VaryingPointLoad>>,
    /// The mass that lands on the point, if one does; [`PointLoad::mass`] is zero then.
    pub landing: Option<Landing>,
}

/// A mass that lands on a point of a leaf in motion and stays there. The momentum of the point and of the mass is
/// kept, and energy is lost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Landing {
    /// The mass; positive.
    pub mass: f64,
    /// The time at which it lands; positive.
    pub from: f64,
    /// The velocity with which it lands.
    pub velocity: [f64; 3],
}

/// A load on a point, dead or turning with the section, whose force and moment vary in time.
#[derive(Clone, Debug, PartialEq)]
pub struct VaryingPointLoad {
    /// The factor of both.
    pub factor: Schedule<f64>,
    /// The force at a factor of one.
    pub force: [f64; 3],
    /// The moment at a factor of one.
    pub moment: [f64; 3],
}

impl PointLoad {
    /// Whether force and mass are off the axis.
    pub fn is_off_axis(&self) -> bool {
        self.offset != [0.0; 2]
    }

    /// Where force and mass are off the axis, along the directors.
    pub fn arm(&self) -> DVec3 {
        let [along_2, along_3] = self.offset;
        DVec3::new(0.0, along_2, along_3)
    }

    /// The load at rest that is this one at a time.
    pub fn at_time(&self, time: f64) -> PointLoad {
        let mut at = self.clone();
        if let Some(landing) = self.landing {
            at.mass = if landing.from <= time {
                landing.mass
            } else {
                0.0
            };
        }
        if let Some(varying) = &self.in_time {
            let factor = varying.factor.at(time);
            [at.force, at.moment] =
                [varying.force, varying.moment].map(|load| scaled(factor, load));
        }
        at
    }
}

/// The loads that a factor in time multiplies (`load.factor`), at a factor of one.
#[derive(Clone, Debug, PartialEq)]
pub struct FactoredLoads {
    /// The factor.
    pub factor: Schedule<f64>,
    /// As [`Scenario::gravity`](crate::scenario::Scenario::gravity).
    pub gravity: [f64; 3],
    /// As [`Scenario::own_gravity`](crate::scenario::Scenario::own_gravity).
    pub own_gravity: Vec<[f64; 3]>,
    /// As [`Scenario::g`](crate::scenario::Scenario::g).
    pub g: [f64; 3],
    /// As [`Scenario::distributed`](crate::scenario::Scenario::distributed).
    pub distributed: Option<Vec<[Profile; 3]>>,
    /// As [`Scenario::follower`](crate::scenario::Scenario::follower).
    pub follower: Option<Vec<[Profile; 3]>>,
    /// As [`Scenario::couple`](crate::scenario::Scenario::couple).
    pub couple: Option<Vec<[Profile; 3]>>,
}

impl FactoredLoads {
    /// These loads times a factor.
    fn times(&self, factor: f64) -> FactoredLoads {
        let along = |load: &[Profile; 3]| load.each_ref().map(|of| of.scaled(factor));
        let along_veins = |loads: &Option<Vec<[Profile; 3]>>| {
            let some = loads.as_ref().filter(|_| factor != 0.0);
            some.map(|all| all.iter().map(along).collect())
        };
        FactoredLoads {
            factor: self.factor.clone(),
            gravity: scaled(factor, self.gravity),
            own_gravity: (self.own_gravity.iter())
                .map(|own| scaled(factor, *own))
                .collect(),
            g: scaled(factor, self.g),
            distributed: along_veins(&self.distributed),
            follower: along_veins(&self.follower),
            couple: along_veins(&self.couple),
        }
    }

    /// The loads at a time.
    pub fn at_time(&self, time: f64) -> FactoredLoads {
        self.times(self.factor.at(time))
    }
}

/// Loads per length of each vein, as they are read.
pub(super) struct LoadsAlongVeins<'l> {
    pub distributed: &'l Option<Vec<[Profile; 3]>>,
    pub follower: &'l Option<Vec<[Profile; 3]>>,
    pub couple: &'l Option<Vec<[Profile; 3]>>,
}

/// Reads `load.factor`, if it is given, of loads as they are read.
pub(super) fn read_load_factor(
    entries: &Entries,
    weights: &RodWeights,
    g: [f64; 3],
    along: LoadsAlongVeins,
) -> ScenarioResult<Option<Box<FactoredLoads>>> {
    let Some(item) = entries.given_value(Key::LoadFactor) else {
        return Ok(None);
    };
    item.refuse_unless(
        !entries.is_given(Key::GravityInTime),
        "dynamics.gravity is gravity in time, too: leave one of them out",
    )?;
    Ok(Some(Box::new(FactoredLoads {
        factor: item.factors_in_time()?,
        gravity: weights.shared,
        own_gravity: weights.own.clone(),
        g,
        distributed: along.distributed.clone(),
        follower: along.follower.clone(),
        couple: along.couple.clone(),
    })))
}

/// The weight of a vein per reference length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weight<'s> {
    /// The weight per length that is the same all along the vein.
    pub even: [f64; 3],
    /// The acceleration of gravity, and the mass per length that it pulls, if any.
    pub of_mass: Option<([f64; 3], &'s Profile)>,
}

impl Weight<'_> {
    /// The weight per length at a place.
    pub fn at(&self, place: impl Into<RodPlace>) -> [f64; 3] {
        let Some((g, mass)) = self.of_mass else {
            return self.even;
        };
        let mass = mass.at(place);
        [0, 1, 2].map(|axis| self.even[axis] + mass * g[axis])
    }
}

/// Weights of rods, forces per reference length.
pub(super) struct RodWeights {
    /// The weight that all rods share.
    pub shared: [f64; 3],
    /// The weight that each rod has besides; empty if rods do not differ.
    pub own: Vec<[f64; 3]>,
}

/// Reads `load.gravity`.
pub(super) fn read_weights(entries: &Entries, rods: usize) -> ScenarioResult<RodWeights> {
    let item = entries.value_or_default(Key::Gravity)?;
    let each = item.vector_per_rod(rods)?;
    let first = each.first().copied().unwrap_or([0.0; 3]);
    if each.iter().all(|own| *own == first) {
        return Ok(RodWeights {
            shared: first,
            own: Vec::new(),
        });
    }
    item.refuse_unless(
        !entries.is_given(Key::GravityInTime),
        "dynamics.gravity, one vector for all rods, would replace these: leave one of them out",
    )?;
    Ok(RodWeights {
        shared: [0.0; 3],
        own: each,
    })
}

/// The acceleration of gravity, as it is read.
pub(super) struct GravityAcceleration {
    /// The acceleration.
    pub g: [f64; 3],
    /// Whether it pulls the masses of points alone.
    pub weighs_points_only: bool,
}

/// Reads `load.g`, which needs a mass: along the veins, or on points.
pub(super) fn read_gravity_acceleration(entries: &Entries) -> ScenarioResult<GravityAcceleration> {
    let item = entries.value_or_default(Key::G)?;
    let g = item.vector()?;
    let masses = [Key::Density, Key::MassDensity, Key::BladeMassDensity];
    let has_mass = masses.into_iter().any(|key| entries.is_given(key));
    let points = entries.table_count("load.point").unwrap_or(0);
    let on_points = (0..points).any(|row| entries.is_given_in_row(Key::PointMass, row));
    item.refuse_unless(
        has_mass || on_points || g == [0.0; 3],
        "is an acceleration and needs the mass that it pulls: give dynamics.density, or \
         mass_density in [section] or [blade], or masses on [[load.point]]; a force per length is load.gravity",
    )?;
    Ok(GravityAcceleration {
        g,
        weighs_points_only: !has_mass && g != [0.0; 3],
    })
}

/// Reads loads per length of each vein; `None` if the entry is left out or zero.
pub(super) fn read_loads_along_veins(
    entries: &Entries,
    key: Key,
    rods: usize,
) -> ScenarioResult<Option<Vec<[Profile; 3]>>> {
    let Some(item) = entries.given_value(key) else {
        return Ok(None);
    };
    let vectors = item.vector_profile_per_rod(rods)?;
    let some = vectors.iter().flatten().any(|of| of.max_abs() > 0.0);
    Ok(some.then_some(vectors))
}

/// Reads `[[load.point]]`.
pub(super) fn read_point_loads(entries: &Entries, rods: usize) -> ScenarioResult<Vec<PointLoad>> {
    let count = entries.table_count("load.point").unwrap_or(0);
    (0..count)
        .map(|row| read_point_load(entries, row, rods))
        .collect()
}

fn read_point_load(entries: &Entries, row: usize, rods: usize) -> ScenarioResult<PointLoad> {
    let item = |key| entries.value_in_row(key, row);
    let turned = item(Key::PointMoment)?;
    let moment = turned.vector()?;
    let follows = item(Key::PointFollows)?.switch()?;
    if !follows {
        check_single_rod_moments(turned, rods, &[moment])?;
    }
    let force = item(Key::PointForce)?.vector()?;
    let varying = match entries.is_given_in_row(Key::PointFactor, row) {
        true => Some(Box::new(VaryingPointLoad {
            factor: item(Key::PointFactor)?.factors_in_time()?,
            force,
            moment,
        })),
        false => None,
    };
    let given = PointLoad {
        vein: item(Key::PointVein)?.whole_number(rods)? - 1,
        at: item(Key::PointAt)?.fraction()?,
        force,
        moment,
        follows,
        mass: item(Key::PointMass)?.number()?,
        offset: item(Key::PointOffset)?.place_in_section()?,
        in_time: varying,
        landing: read_landing(entries, row)?,
    };
    Ok(given.at_time(0.0))
}

/// Reads when the mass of a point lands, unless it is there from the start.
fn read_landing(entries: &Entries, row: usize) -> ScenarioResult<Option<Landing>> {
    let item = |key| entries.value_in_row(key, row);
    let (begins, moves) = (item(Key::PointFrom)?, item(Key::PointVelocity)?);
    let (from, velocity) = (begins.number()?, moves.vector()?);
    moves.refuse_unless(
        from > 0.0 || velocity == [0.0; 3],
        "belongs to a mass that lands: give from, the time at which it does, a number greater than 0",
    )?;
    let mass = item(Key::PointMass)?.number()?;
    begins.refuse_unless(
        from == 0.0 || mass > 0.0,
        "is the time at which a mass lands: add mass, greater than 0",
    )?;
    Ok((from > 0.0).then_some(Landing {
        mass,
        from,
        velocity,
    }))
}

/// Refuses moments on more than one rod.
pub(super) fn check_single_rod_moments(
    item: EntryValue,
    rods: usize,
    moments: &[[f64; 3]],
) -> ScenarioResult<()> {
    let allowed = rods == 1 || moments.iter().all(|moment| *moment == [0.0; 3]);
    let (what, why) = match item.key() {
        Key::PointMoment => (
            "on a point",
            "a dead moment has no potential; one that follows the section (follows = true) may act on any vein",
        ),
        _ => ("at the tip", "joined tips pass on no moment"),
    };
    item.refuse_unless(
        allowed,
        format_args!("a moment {what} needs leaf.rods = 1 (here {rods}): {why}"),
    )
}

/// Air that flows past the veins. The force per reference length on a vein is rho C_D w |u| u/2, with
/// the part u of the air's velocity relative to the vein that is normal to the vein's tangent.
#[derive(Clone, Debug, PartialEq)]
pub struct Wind {
    /// Velocity of the air.
    pub velocity: Schedule<[f64; 3]>,
    /// rho, mass of the air per volume; positive.
    pub density: f64,
    /// C_D, the drag coefficient; not negative.
    pub drag: f64,
    /// w, the width that a vein turns to the wind however its section is turned, one profile per vein; not negative.
    pub width: Vec<Profile>,
}

/// Reads `[wind]` of so many veins; `None` if there is no such table. Widths that are left out are those of the sections,
/// or of the strips of a blade.
pub(super) fn read_wind(
    entries: &Entries,
    rods: usize,
    source: &StiffnessSource,
) -> ScenarioResult<Option<Wind>> {
    if !entries.has_key_of_table("wind") {
        return Ok(None);
    }
    let velocity = entries
        .value_or_default(Key::WindVelocity)?
        .vectors_in_time()?;
    let density = entries.value_or_default(Key::WindDensity)?.number()?;
    let drag = entries.value_or_default(Key::WindDrag)?.number()?;
    let own = match entries.is_given(Key::WindWidth) {
        true => None,
        false => source.property_profiles(Property::Width),
    };
    let width = match own {
        Some(width) => width,
        None => entries
            .value_or_default(Key::WindWidth)?
            .profile_per_rod(rods)?,
    };
    Ok(Some(Wind {
        velocity,
        density,
        drag,
        width,
    }))
}

/// The motion of a leaf where `[dynamics]` leaves it out.
struct DefaultMotion {
    /// Radius of the section over the length of the longest rod: half of it, the radius of
    /// gyration, is that of the relaxation.
    radius: f64,
    /// Duration, in units of sqrt(rho L^4/A).
    duration: f64,
    /// Outputs during the motion, after the first.
    outputs: f64,
}

const DEFAULT_MOTION: DefaultMotion = DefaultMotion {
    radius: 0.2,
    duration: 10.0,
    outputs: 100.0,
};

/// Angular frequency of the lowest bending mode of a clamped-free rod, in units of sqrt(A/(rho L^4)):
/// beta_1^2 of the beam.
pub(crate) const CLAMPED_ROD_FREQUENCY: f64 = 3.516;

words! {
    /// Where a motion begins, at time 0 and without velocity.
    pub enum MotionStart {
        /// In the shape from which a relaxation starts: arcs that meet in the tip,
        /// or the rest shape of free rods.
        Released = "released",
        /// In the equilibrium under the loads and with the rest shape of time 0.
        AtRest = "at-rest",
    }
}

/// The moment of inertia of rods about d1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PolarInertia {
    /// The sum of those about d2 and d3, as of every plane section.
    Sum,
    /// That about d2, where no inertia is given: a vein turns with its strip of blade and has the same inertia about
    /// all axes, as in the relaxation ([`crate::relax`]).
    Same,
}

/// How a leaf moves. All quantities are in the units of the scenario, with
/// its unit of time. L is the longest rod, A the mean bending stiffness
/// ([`Scale`]), rho the mean of the densities mid-rod.
#[derive(Clone, Debug, PartialEq)]
pub struct Dynamics {
    /// Mass per unit reference length, one per rod; positive.
    pub density: Vec<Profile>,
    /// rho I2 and rho I3, the moments of inertia per unit reference length about d2 and
    /// about d3, of each rod; positive.
    pub rotary_inertia: Vec<[Profile; 2]>,
    /// The moment of inertia about d1.
    pub polar_inertia: PolarInertia,
    /// Viscous force per unit reference length and velocity. Rotation is damped
    /// at the same rate: by this over the density times the angular momentum.
    pub external_damping: f64,
    /// Whether the scenario leaves that out: motions are damped then, but no verdict on small motions
    /// depends on it.
    pub assumes_damping: bool,
    /// Retardation time of the material (Kelvin-Voigt): the stress is the
    /// stiffness times the strain and times this time the strain rate.
    pub internal_damping: f64,
    /// How long the leaf is followed, a time.
    pub duration: f64,
    /// Time between two outputs; at most the duration.
    pub output_interval: f64,
    /// Whether the base is clamped; free only on a single rod.
    pub clamped: bool,
    /// Where the motion begins.
    pub start: MotionStart,
    /// Gravity, force per unit reference length.
    pub gravity: Schedule<[f64; 3]>,
    /// Dead force on the joint tip, or on every tip when the tips are free.
    pub tip_force: Schedule<[f64; 3]>,
    /// Dead moment about the lab axes on the tip of a single rod.
    pub tip_moment: Schedule<[f64; 3]>,
    /// Factor of all rest curvatures.
    pub rest: Schedule<f64>,
}

impl Dynamics {
    /// The default motion of these rods, of which there is at least one, without loads: see
    /// [`Dynamics::with_loads`].
    ///
    /// ```
    /// use leafdyn::scenario::{Dynamics, Profile, Rod};
    ///
    /// let rod = Rod {
    ///     length: 2.0,
    ///     base: [0.0; 3],
    ///     angle: 0.0,
    ///     elevation: 0.0,
    ///     roll: 0.0,
    ///     couple_stiffness: [8.0; 3].map(Profile::Constant),
    ///     force_stiffness: [f64::INFINITY; 3].map(Profile::Constant),
    ///     rest_curvature: [0.0; 3].map(Profile::Constant),
    ///     rest_stretch: Profile::Constant(1.0),
    /// };
    /// let weight = [0.0, 0.0, -1.0];
    /// let dynamics = Dynamics::default_for(&[rod]).with_loads(weight, [0.0; 3], [0.0; 3]);
    /// assert!((dynamics.mean_density() - 0.5).abs() < 1e-15);
    /// assert_eq!(dynamics.duration, 10.0);
    /// assert_eq!(dynamics.gravity.at(3.0), weight);
    /// ```
    pub fn default_for(rods: &[Rod]) -> Self {
        let scale = Scale::of(rods);
        let density = scale.stiffness / scale.length.powi(4);
        Dynamics::with_density(rods, vec![Profile::Constant(density); rods.len()])
    }

    /// This motion under constant loads.
    pub fn with_loads(
        self,
        gravity: [f64; 3],
        tip_force: [f64; 3],
        tip_moment: [f64; 3],
    ) -> Dynamics {
        Dynamics {
            gravity: Schedule::constant(gravity),
            tip_force: Schedule::constant(tip_force),
            tip_moment: Schedule::constant(tip_moment),
            ..self
        }
    }

    /// rho: the mean of the mid-rod densities of the rods, mass per length.
    pub fn mean_density(&self) -> f64 {
        mean_mid_rod_value(&self.density)
    }

    /// The unit of time, sqrt(rho L^4/A), of these rods.
    pub fn natural_time(&self, rods: &[Rod]) -> f64 {
        natural_time_unit(Scale::of(rods), &self.density)
    }

    /// The external damping that is critical for the lowest mode of a clamped vein.
    pub fn critical_damping(&self, rods: &[Rod]) -> f64 {
        critical_damping(&self.density, self.natural_time(rods))
    }

    /// The default motion of rods with these densities.
    fn with_density(rods: &[Rod], density: Vec<Profile>) -> Dynamics {
        let scale = Scale::of(rods);
        let time = natural_time_unit(scale, &density);
        let duration = DEFAULT_MOTION.duration * time;
        let radius = Profile::Constant(DEFAULT_MOTION.radius * scale.length);
        let inertia = |density| both_axes(round_inertia(density, &radius));
        Dynamics {
            rotary_inertia: density.iter().map(inertia).collect(),
            polar_inertia: PolarInertia::Same,
            external_damping: critical_damping(&density, time),
            assumes_damping: true,
            density,
            internal_damping: 0.0,
            duration,
            output_interval: duration / DEFAULT_MOTION.outputs,
            clamped: true,
            start: MotionStart::Released,
            gravity: Schedule::constant([0.0; 3]),
            tip_force: Schedule::constant([0.0; 3]),
            tip_moment: Schedule::constant([0.0; 3]),
            rest: Schedule::constant(1.0),
        }
    }
}

/// The external damping that is critical for the lowest mode of a clamped rod of the mean density.
fn critical_damping(density: &[Profile], time: f64) -> f64 {
    2.0 * CLAMPED_ROD_FREQUENCY * mean_mid_rod_value(density) / time
}

/// Mean of the values of profiles mid-rod; exact if all are equal.
fn mean_mid_rod_value(profiles: &[Profile]) -> f64 {
    let counted = profiles.iter().zip(1..);
    counted.fold(0.0, |mean, (profile, count)| {
        mean + (profile.at(0.5) - mean) / f64::from(count)
    })
}

/// The unit of time sqrt(rho L^4/A); in this order nothing overflows.
pub(super) fn natural_time_unit(scale: Scale, density: &[Profile]) -> f64 {
    (mean_mid_rod_value(density) / (scale.stiffness / scale.length.powi(4))).sqrt()
}

/// Moment of inertia of a round section: rho I = density radius^2/4 at all knots of
/// both profiles, and linear between them. Where the radius varies the exact value is a
/// cubic, which lies below: more knots of the radius reduce the difference.
fn round_inertia(density: &Profile, radius: &Profile) -> Profile {
    let inertia = |place: RodPlace| density.at(place) * radius.at(place).powi(2) / 4.0;
    if let (Profile::Constant(_), Profile::Constant(_)) = (density, radius) {
        return Profile::Constant(inertia(0.0.into()));
    }
    let places = knot_places([density, radius]);
    Profile::Linear {
        at: places.iter().map(|place| place.sigma).collect(),
        value: places.into_iter().map(inertia).collect(),
    }
}

/// The rotary inertia of a section that has the same about d2 and d3.
fn both_axes(inertia: Profile) -> [Profile; 2] {
    [inertia.clone(), inertia]
}

/// Reads `[dynamics]`, for rods under this gravity in time, a tip force and a tip moment.
pub(super) fn read_dynamics(
    entries: &Entries,
    rods: &[Rod],
    source: &StiffnessSource,
    gravity: Schedule<[f64; 3]>,
    [tip_force, tip_moment]: [[f64; 3]; 2],
) -> ScenarioResult<Dynamics> {
    let mass = [Key::MassDensity, Key::BladeMassDensity];
    let mass = mass.into_iter().find(|key| entries.is_given(*key));
    let of_mass = |property| mass.and_then(|_| source.property_profiles(property));
    let density = match entries.given_value(Key::Density) {
        Some(item) => {
            if let Some(key) = mass {
                let path = key.path();
                let why = format!("{path} is given, too: leave one of them out");
                return Err(item.value_error(why));
            }
            Some(item.profile_per_rod(rods.len())?)
        }
        None => of_mass(Property::Density),
    };
    let has_mass = density.is_some();
    let preset = match density {
        Some(density) => Dynamics::with_density(rods, density),
        None => Dynamics::default_for(rods),
    }
    .with_loads([0.0; 3], tip_force, tip_moment);
    let number = |key, default| {
        entries
            .given_value(key)
            .map_or(Ok(default), |item| item.number())
    };
    let load = |key, default| match entries.given_value(key) {
        Some(item) => item.vectors_in_time(),
        None => Ok(default),
    };
    let duration = number(Key::Duration, preset.duration)?;
    let given = read_rotary_inertia(entries, &preset.density)?;
    let of_section = || source.rotary_inertia(&preset.density).filter(|_| has_mass);
    let (rotary_inertia, polar_inertia) = match given.or_else(of_section) {
        Some(inertia) => (inertia, PolarInertia::Sum),
        None => (preset.rotary_inertia, preset.polar_inertia),
    };
    let external_damping = number(Key::ExternalDamping, preset.external_damping)?;
    let internal_damping = entries.value_or_default(Key::InternalDamping)?.number()?;
    let output_interval = match entries.given_value(Key::OutputInterval) {
        Some(item) => read_output_interval(item, duration)?,
        None => duration / DEFAULT_MOTION.outputs,
    };
    let clamped = read_clamped(entries.value_or_default(Key::Clamped)?, rods.len())?;
    let start = read_start(entries.value_or_default(Key::Start)?, clamped)?;
    let gravity = load(Key::GravityInTime, gravity)?;
    let tip_force = load(Key::TipForceInTime, preset.tip_force)?;
    let tip_moment = load(Key::TipMomentInTime, preset.tip_moment)?;
    if let Some(item) = entries.given_value(Key::TipMomentInTime) {
        check_single_rod_moments(item, rods.len(), &tip_moment.bounds())?;
    }
    Ok(Dynamics {
        rotary_inertia,
        polar_inertia,
        external_damping,
        assumes_damping: !entries.is_given(Key::ExternalDamping),
        internal_damping,
        duration,
        output_interval,
        clamped,
        start,
        gravity,
        tip_force,
        tip_moment,
        rest: match entries.given_value(Key::RestInTime) {
            Some(item) => item.factors_in_time()?,
            None => preset.rest,
        },
        density: preset.density,
    })
}

/// The rotary inertia about d2 and d3, if it is given.
fn read_rotary_inertia(
    entries: &Entries,
    density: &[Profile],
) -> ScenarioResult<Option<Vec<[Profile; 2]>>> {
    let quantity = |item: EntryValue| item.profile_per_rod(density.len());
    let both_given = [Key::RotaryInertia, Key::RotaryInertia3].map(|key| entries.given_value(key));
    let [about_2, about_3] = both_given;
    if let Some(item) = about_3 {
        item.refuse_unless(
            about_2.is_some(),
            "is the inertia about d3 alone: give dynamics.rotary_inertia, that about d2, too",
        )?;
    }
    if let Some(item) = entries.given_value(Key::SectionRadius) {
        item.refuse_unless(
            about_2.is_none(),
            "dynamics.rotary_inertia is given, too, and is density section_radius^2/4: \
             leave one of them out",
        )?;
        let radius = quantity(item)?;
        let round = density.iter().zip(&radius);
        let inertia = round.map(|(density, radius)| both_axes(round_inertia(density, radius)));
        return Ok(Some(inertia.collect()));
    }
    let Some(about_2) = about_2.map(quantity).transpose()? else {
        return Ok(None);
    };
    Ok(Some(match about_3.map(quantity).transpose()? {
        Some(about_3) => (about_2.into_iter().zip(about_3))
            .map(|(about_2, about_3)| [about_2, about_3])
            .collect(),
        None => about_2.into_iter().map(both_axes).collect(),
    }))
}

fn read_output_interval(item: EntryValue, duration: f64) -> ScenarioResult<f64> {
    let interval = item.number()?;
    item.refuse_unless(
        interval <= duration,
        format_args!(
            "must be at most dynamics.duration, {duration} (left out: a hundredth of the duration)"
        ),
    )?;
    Ok(interval)
}

fn read_clamped(item: EntryValue, rods: usize) -> ScenarioResult<bool> {
    let clamped = item.switch()?;
    item.refuse_unless(
        clamped || rods == 1,
        format_args!(
            "a free base needs leaf.rods = 1 (here {rods}): the rods of a leaf grow from one base"
        ),
    )?;
    Ok(clamped)
}

fn read_start(item: EntryValue, clamped: bool) -> ScenarioResult<MotionStart> {
    let start = item.word(
        "must be \"released\" (from the shape where a relaxation starts) or \"at-rest\" \
         (in equilibrium under the loads at time 0)",
    )?;
    item.refuse_unless(
        clamped || start == MotionStart::Released,
        "a rod with a free base has no equilibrium to start from: use \"released\"",
    )?;
    Ok(start)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_in_the_natural_unit_by_default() {
        for (length, bending) in [(1.0, 1.0), (0.03, 7.1), (1e50, 1e-50), (1e-50, 1e50)] {
            let rods = [1.0, 0.5, 0.1].map(|part| Rod {
                length: part * length,
                base: [0.0; 3],
                angle: 0.0,
                elevation: 0.0,
                roll: 0.0,
                couple_stiffness: [0.1, bending, bending].map(Profile::Constant),
                force_stiffness: [f64::INFINITY; 3].map(Profile::Constant),
                rest_curvature: [0.0; 3].map(Profile::Constant),
                rest_stretch: Profile::Constant(1.0),
            });
            let dynamics = Dynamics::default_for(&rods);
            assert_eq!((dynamics.duration, dynamics.output_interval), (10.0, 0.1));
            let density = dynamics.mean_density();
            let close = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-12;
            assert!(close(density, bending / length.powi(4)));
            assert!(close(dynamics.external_damping, 2.0 * 3.516 * density));
            for inertia in &dynamics.rotary_inertia[2] {
                assert!(close(inertia.at(0.5), 0.01 * density * length * length));
            }
        }
    }

    #[test]
    fn the_mean_of_equal_densities_is_exact() {
        assert_eq!(mean_mid_rod_value(&vec![Profile::Constant(0.1); 7]), 0.1);
        let taper = Profile::Linear {
            at: vec![0.0, 1.0],
            value: vec![4.0, 2.0],
        };
        assert_eq!(mean_mid_rod_value(&[taper, Profile::Constant(1.0)]), 2.0);
    }
}
