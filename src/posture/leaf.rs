//! From a scenario to the rod that hangs, and from a posture to the scenario that rests in it.

use crate::posture::Posture;
use crate::posture::points::PostureError;
use crate::posture::rest::Stations;
use crate::posture::rod::{HangingRod, PointForce};
use crate::scenario::{Profile, Radii, RodPlace, Scenario};
use crate::words;
use glam::{DQuat, DVec3};

words! {
    /// What the number E of a posture is.
    pub enum ModulusMeaning {
        /// Young's modulus of `[section]` or `[blade]`.
        Young = "young",
        /// The factor of the stiffnesses of the scenario, which are given as numbers or change with the modulus
        /// along the leaf.
        Factor = "factor",
    }
}

/// A scenario's rod, whose stiffness is E times known numbers.
#[derive(Clone, Debug)]
pub struct ScenarioRod {
    /// The rod.
    pub rod: HangingRod,
    /// What E is.
    pub meaning: ModulusMeaning,
    /// E of the scenario itself: 1 if it is a factor.
    pub young: f64,
    /// Where the scenario has its base.
    pub base: DVec3,
}

fn refuse(key: &'static str, why: &'static str) -> PostureError {
    PostureError::Scenario { key, why }
}

impl ScenarioRod {
    /// The rod of a scenario.
    ///
    /// # Errors
    /// What the forces of a posture do not follow from, with what to change.
    pub fn new(scenario: &Scenario) -> Result<ScenarioRod, PostureError> {
        check(scenario)?;
        let young = scenario.young(0);
        let (meaning, young) = match young {
            Some(young) => (ModulusMeaning::Young, young),
            None => (ModulusMeaning::Factor, 1.0),
        };
        let vector = DVec3::from_array;
        let weight = scenario.weight(0);
        let rod = HangingRod {
            stiffness: scenario.rods[0]
                .couple_stiffness
                .each_ref()
                .map(|profile| profile.scaled(1.0 / young)),
            weight: vector(weight.even),
            mass: weight.of_mass.map(|(g, mass)| (vector(g), mass.clone())),
            distributed: scenario.distributed.as_ref().map(|all| all[0].clone()),
            points: (scenario.points.iter())
                .map(|point| PointForce {
                    at: point.at,
                    force: vector(scenario.force_on(point)),
                    offset: point.offset,
                })
                .collect(),
            tip_force: vector(scenario.tip_force),
        };
        if !rod.is_loaded() {
            return Err(refuse(
                "load.gravity",
                "no load acts, so that the posture says nothing of the stiffness: give the weight per length, or \
                 load.g and a density or masses of points",
            ));
        }
        Ok(ScenarioRod {
            rod,
            meaning,
            young,
            base: vector(scenario.rods[0].base),
        })
    }
}

/// Refuses what the forces along a posture do not follow from.
fn check(scenario: &Scenario) -> Result<(), PostureError> {
    let stretch = &scenario.rods[0].rest_stretch;
    let reasons = [
        (
            scenario.rods.len() != 1,
            "leaf.rods",
            "the shape of several veins does not tell the forces between them: describe the leaf as one vein \
             (leaf.rods = 1) with the section and the weight of the whole",
        ),
        (
            scenario.held_tip.is_some(),
            "tip.held",
            "the force of a holder does not follow from the posture: leave the tip free, or give the force as \
             load.tip_force",
        ),
        (
            !scenario.grips.is_empty(),
            "grip",
            "the forces of grips do not follow from the posture: leave them out, or give them as [[load.point]]",
        ),
        (
            scenario.foundation.is_some(),
            "foundation.stiffness",
            "the forces of a foundation depend on the rest shape: leave it out",
        ),
        (
            scenario.wind.is_some(),
            "wind",
            "wind has no potential, so that no eigenvalue decides: measure the posture in still air and leave it out",
        ),
        (
            scenario.has_followers(),
            "load.follower, load.couple, load.point.follows",
            "loads that turn with the section, and moments along it, have no potential: give dead forces",
        ),
        (
            scenario.has_moments(),
            "load.tip_moment, load.point.moment",
            "dead moments have no potential: give forces",
        ),
        (
            !scenario.all_bases_clamped(),
            "leaf.base_held",
            "a base that turns adds a stiffness of its own: clamp it (leave this out), and begin the points above it",
        ),
        (
            !scenario.dynamics.clamped,
            "dynamics.clamped",
            "a leaf that is not held has no posture: leave this out",
        ),
        (
            *stretch != Profile::Constant(1.0),
            "rest.stretch",
            "the points give the length as it is: leave this out",
        ),
    ];
    match reasons.into_iter().find(|(refused, ..)| *refused) {
        Some((_, key, why)) => Err(refuse(key, why)),
        None => Ok(()),
    }
}

/// A profile as numbers that are linear between places, if it is not that already.
fn sampled(profile: &Profile, places: &[RodPlace]) -> Profile {
    match profile {
        Profile::Derived(_) => Profile::Linear {
            at: places.iter().map(|place| place.sigma).collect(),
            value: places.iter().map(|place| profile.at(*place)).collect(),
        },
        given => given.clone(),
    }
}

/// The scenario whose leaf rests in a posture at a modulus, with that curvature at rest and the loads of `scenario`. It
/// keeps sections that give its stiffnesses, with their moduli at E; else it is inextensible and unshearable.
pub fn rest_scenario(
    scenario: &Scenario,
    of: &ScenarioRod,
    posture: &Posture,
    stations: &Stations,
    young: f64,
) -> Scenario {
    let mut rest = scenario.clone();
    rest.name = format!("{}-rest", scenario.name);
    let at: Vec<f64> = stations.ends.iter().map(|station| station.sigma).collect();
    let mut places: Vec<RodPlace> = Vec::new();
    let kinks = of.rod.kinks();
    for &sigma in &at {
        let both = RodPlace::both_sides(sigma);
        let jumps = kinks.iter().any(|kink| (kink - sigma).abs() < 1e-9);
        places.extend(&both[..if jumps { 2 } else { 1 }]);
    }
    let curvature = stations.linear_rest_curvature(young);
    let knots = stations.knots();
    let keeps_sections = rest.scale_section_moduli(of.young, young);
    let rod = &mut rest.rods[0];
    rod.length = stations.length;
    rod.base = stations.ends[0].position.to_array();
    (rod.angle, rod.elevation, rod.roll) = (
        posture.base.angle,
        posture.base.elevation,
        posture.base.roll,
    );
    for (axis, profile) in rod.rest_curvature.iter_mut().enumerate() {
        *profile = match curvature.iter().all(|u0| u0[axis] == 0.0) {
            true => Profile::Constant(0.0),
            false => Profile::Linear {
                at: knots.clone(),
                value: curvature.iter().map(|u0| u0[axis]).collect(),
            },
        };
    }
    if !keeps_sections {
        rod.couple_stiffness = (of.rod.stiffness.each_ref())
            .map(|stiffness| sampled(stiffness, &places).scaled(young));
        rod.force_stiffness = [f64::INFINITY; 3].map(Profile::Constant);
        rest.radii = Radii::default();
        rest.blade = None;
        let dynamics = &mut rest.dynamics;
        let densities = dynamics.density.iter_mut();
        for profile in densities.chain(dynamics.rotary_inertia.iter_mut().flatten()) {
            *profile = sampled(profile, &places);
        }
    }
    let dynamics = &mut rest.dynamics;
    if dynamics.assumes_damping {
        dynamics.external_damping = dynamics.critical_damping(&rest.rods);
    }
    rest
}

/// The same scenario in a lab that is turned about the direction of the base, so that d2 is level there: the format
/// has no angle for a base that is rolled. Photographs, and loads and bases in time, are those of the lab as it was and
/// are left out of one that is turned.
pub fn with_level_base(rest: &Scenario) -> Scenario {
    let mut level = rest.clone();
    if rest.rods[0].roll == 0.0 {
        return level;
    }
    level.photo = None;
    level.factored = None;
    level.support_motion = None;
    for point in &mut level.points {
        point.in_time = None;
        point.landing = None;
    }
    let rolled = rest.rods[0].base_rotation();
    level.rods[0].roll = 0.0;
    let turn: DQuat = level.rods[0].base_rotation() * rolled.conjugate();
    let turned = |v: [f64; 3]| (turn * DVec3::from_array(v)).to_array();
    level.gravity = turned(rest.gravity);
    level.own_gravity = rest.own_gravity.iter().map(|own| turned(*own)).collect();
    level.g = turned(rest.g);
    level.tip_force = turned(rest.tip_force);
    for point in &mut level.points {
        point.force = turned(point.force);
    }
    if let Some(distributed) = &rest.distributed {
        let places = crate::scenario::knots(distributed[0].iter());
        let turn_all = |load: &[Profile; 3]| {
            let values: Vec<[f64; 3]> = places
                .iter()
                .map(|place| turned(load.each_ref().map(|one| one.at(*place))))
                .collect();
            [0, 1, 2].map(|axis| Profile::Linear {
                at: places.iter().map(|place| place.sigma).collect(),
                value: values.iter().map(|value| value[axis]).collect(),
            })
        };
        level.distributed = Some(distributed.iter().map(turn_all).collect());
    }
    level.dynamics = level
        .dynamics
        .with_loads(level.gravity, level.tip_force, level.tip_moment);
    level
}
