//! Random leaves, at rest and moving, always the same ones.

use std::fmt::Display;

use leafdyn::scenario::{PointLoad, Profile, Scenario, Schedule};
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::{RngSeed, TestRunner};

use crate::{asked, linear, paper_leaf};

/// Random numbers, the same everywhere, of the sequence that a number begins, by the generator
/// of Steele, Lea and Flood (OOPSLA 2014).
pub struct Draw(pub u64);

impl Draw {
    /// Between 0 and 1.
    pub fn even(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.even()
    }

    pub fn log(&mut self, low: f64, high: f64) -> f64 {
        self.uniform(low.ln(), high.ln()).exp()
    }

    pub fn list(&mut self, count: usize, low: f64, high: f64) -> Vec<f64> {
        (0..count).map(|_| self.uniform(low, high)).collect()
    }

    /// A normal number, by the formula of Box and Muller.
    pub fn normal(&mut self) -> f64 {
        let (a, b) = (1.0 - self.even(), self.even());
        (-2.0 * a.ln()).sqrt() * (std::f64::consts::TAU * b).cos()
    }
}

impl Draw {
    /// True with this probability.
    pub fn chance(&mut self, part: f64) -> bool {
        self.uniform(0.0, 1.0) < part
    }

    /// A vector of a random direction, of a length up to `most`, over all its `decades`.
    pub fn vector(&mut self, most: f64, decades: i32) -> Vec<f64> {
        let length = self.log(most * 0.1_f64.powi(decades), most);
        let (z, turn) = (self.uniform(-1.0, 1.0), self.uniform(-3.2, 3.2));
        let (sin, cos) = turn.sin_cos();
        let across = (1.0 - z * z).sqrt();
        vec![length * across * cos, length * across * sin, length * z]
    }

    /// A quantity: alike in all rods, each rod's own, or profiles.
    pub fn quantity(&mut self, rods: usize, next: impl Fn(&mut Self) -> f64) -> String {
        match self.uniform(0.0, 1.0) {
            kind if kind < 0.4 => next(self).to_string(),
            kind if kind < 0.8 => list((0..rods).map(|_| next(self)).collect()),
            _ => {
                let (value, knot) = (next(self), self.uniform(0.1, 0.9));
                let values: Vec<f64> = (0..3).map(|_| value * self.uniform(0.3, 1.0)).collect();
                match value.is_finite() {
                    true => format!("{{ at = [0.0, {knot}, 1.0], value = {} }}", list(values)),
                    false => "inf".into(),
                }
            }
        }
    }
}

/// A list as TOML writes it.
pub fn list<T: Display>(values: Vec<T>) -> String {
    let values: Vec<String> = values.iter().map(T::to_string).collect();
    format!("[{}]", values.join(", "))
}

/// So many cases, without a file of those that failed: always the same, or others with
/// another SEED in the environment.
pub fn cases(cases: u32) -> ProptestConfig {
    let mut config = ProptestConfig::with_cases(cases);
    config.failure_persistence = None;
    config.rng_seed = RngSeed::Fixed(asked("SEED", 7) as u64);
    config
}

/// The first so many, always the same.
pub fn drawn(leaves: impl Strategy<Value = Scenario>, count: usize) -> Vec<Scenario> {
    let mut runner = TestRunner::deterministic();
    let mut next = |_| leaves.new_tree(&mut runner).unwrap().current();
    (0..count).map(&mut next).collect()
}

fn log_uniform(decades: std::ops::Range<f64>) -> impl Strategy<Value = f64> {
    decades.prop_map(|exponent| 10f64.powf(exponent))
}

fn force_stiffness() -> impl Strategy<Value = f64> {
    prop_oneof![4 => log_uniform(1.0..3.0), 1 => Just(f64::INFINITY)]
}

/// A quantity that changes along the rod by up to `most` times, with a kink.
fn profile(value: f64, (kink, bend): (f64, f64), on: bool) -> Profile {
    match on {
        false => Profile::Constant(value),
        true => linear(&[0.0, kink, 1.0], &[value, bend * value, 0.6 * value]),
    }
}

/// One to three points with loads off the axes, some of which turn with the section.
pub fn add_loads_off_axis(draw: &mut Draw, scenario: &mut Scenario, following: bool) {
    let rods = scenario.rods.len();
    scenario.g = [0.1, 0.0, -1.0];
    for number in 0..1 + (3.0 * draw.even()) as usize {
        let at = [0.25, 0.5, 0.8, 1.0][(4.0 * draw.even()) as usize];
        let [x, y, z] = [0; 3].map(|_| draw.uniform(-0.5, 0.5));
        scenario.points.push(PointLoad {
            vein: ((rods as f64) * draw.even()) as usize,
            at,
            force: [x, y, z],
            moment: [0.0; 3],
            follows: following && number == 0,
            mass: draw.uniform(0.0, 0.4),
            offset: [0; 2].map(|_| draw.uniform(-0.2, 0.2)),
            in_time: None,
            landing: None,
        });
    }
}

prop_compose! {
    /// One to four veins, alike but for length, angle and rest shape: stiffness
    /// over two decades, some rigid in stretch or shear; any load, coupling,
    /// fan, profiles with kinks.
    pub fn leaves()(rods in 1..5_usize)(
        couple in prop::array::uniform3(log_uniform(-1.0..1.0)),
        force in prop::array::uniform3(force_stiffness()),
        rest in prop::collection::vec(prop::array::uniform3(-2.0..2.0), rods),
        lengths in prop::collection::vec(0.8..1.2, rods),
        angles in prop::collection::vec(-0.3..0.3, rods),
        coupling in prop::collection::vec(prop::array::uniform3(0.0..5.0), rods - 1),
        gravity in prop::array::uniform3(-1.0..1.0),
        tip_force in prop::array::uniform3(-1.0..1.0),
        kinks in prop::array::uniform3((0.1..0.9, 0.5..2.0)),
        tapered in prop::array::uniform3(prop::bool::weighted(0.3)),
        joined in prop::bool::weighted(0.75),
    ) -> Scenario {
        let mut leaf = paper_leaf(rest.len(), couple, force, 0.0);
        leaf.joined = joined;
        leaf.coupling = coupling;
        leaf.gravity = gravity;
        leaf.tip_force = tip_force;
        for (j, rod) in leaf.rods.iter_mut().enumerate() {
            rod.length = lengths[j];
            rod.angle += angles[j];
            for k in 0..3 {
                rod.couple_stiffness[k] = profile(couple[k], kinks[k], tapered[k]);
                rod.rest_curvature[k] = profile(rest[j][k], kinks[2 - k], tapered[2 - k]);
            }
        }
        leaf
    }
}

/// A quantity that is constant or, if it is finite, changes along the rod with two kinks:
/// at the ends and there it is so many times as large.
fn kinked(value: f64, [first, second]: [f64; 2], times: [f64; 4], on: bool) -> Profile {
    match on && value.is_finite() {
        false => Profile::Constant(value),
        true => linear(&[0.0, first, second, 1.0], &times.map(|t| t * value)),
    }
}

/// Constant, or with two of four kinks, some close together, that make its
/// values up to thrice as large.
fn mover_profile(decades: std::ops::Range<f64>) -> impl Strategy<Value = Profile> {
    let [first, second] = [[0.2, 0.22], [0.6, 0.85]].map(|of| prop::sample::select(of.to_vec()));
    let knots = (first, second, 0.4..2.5, 0.4..2.5, 0.4..2.5);
    (log_uniform(decades), knots, prop::bool::weighted(0.5)).prop_map(
        |(value, (first, second, a, b, c), on)| kinked(value, [first, second], [1.0, a, b, c], on),
    )
}

prop_compose! {
    fn moving_rods(count: usize)(
        couple in prop::collection::vec(prop::array::uniform3(mover_profile(-1.0..1.0)), count),
        force in prop::collection::vec(prop::array::uniform3(mover_profile(1.0..4.0)), count),
        rest in prop::array::uniform3(-1.0..1.0),
        lengths in prop::collection::vec(0.99..1.01, count),
        density in prop::collection::vec(mover_profile(-0.3..0.3), count),
        radius in prop::collection::vec(log_uniform(-2.0..-0.5), count),
    ) -> Scenario {
        let mut leaf = paper_leaf(count, [1.0; 3], [1.0; 3], 0.0);
        for (j, rod) in leaf.rods.iter_mut().enumerate() {
            rod.length = lengths[j];
            rod.couple_stiffness = couple[j].clone();
            rod.force_stiffness = force[j].clone();
            rod.rest_curvature = rest.map(Profile::Constant);
        }
        let dynamics = &mut leaf.dynamics;
        let squared = radius.iter().map(|radius| 0.25 * radius * radius);
        let both = density.iter().zip(squared);
        let inertia = |(density, squared): (&Profile, f64)| {
            let about_both = density.scaled(squared);
            [about_both.clone(), about_both]
        };
        dynamics.rotary_inertia = both.map(inertia).collect();
        dynamics.density = density;
        leaf
    }
}

prop_compose! {
    /// One to four veins, each its own: stiffness over two decades in bending
    /// and three in stretch and shear, sections slender and stout, coupling
    /// over five decades. Undamped. They stand close together, so that even
    /// the strongest coupling does not throw them about.
    pub fn movers()(count in 1..5_usize)(
        leaf in moving_rods(count),
        coupling in log_uniform(-1.0..4.0),
        parts in prop::collection::vec(prop::array::uniform3(0.0..1.0), count - 1),
        gravity in prop::array::uniform3(-0.3..0.3),
        joined in any::<bool>(),
    ) -> Scenario {
        let mut leaf: Scenario = leaf;
        leaf.joined = joined;
        for rod in &mut leaf.rods {
            rod.angle *= 0.02;
        }
        leaf.coupling = parts.iter().map(|gap| gap.map(|part: f64| coupling * part)).collect();
        leaf.gravity = gravity;
        leaf.dynamics.gravity = Schedule::constant(gravity);
        leaf.dynamics.external_damping = 0.0;
        leaf
    }
}

/// Constant or, as often, with a kink or two and up to twenty times as large in one
/// place as in another.
fn uneven_profile(value: impl Strategy<Value = f64>) -> impl Strategy<Value = Profile> {
    let knots = (0.05..0.5, 0.55..0.95, prop::array::uniform4(-0.7..0.5));
    (value, knots, prop::bool::weighted(0.3)).prop_map(|(value, (first, second, tens), on)| {
        kinked(value, [first, second], tens.map(|ten| 10f64.powf(ten)), on)
    })
}

prop_compose! {
    fn uneven_rods(count: usize)(
        couple in prop::collection::vec(
            prop::array::uniform3(uneven_profile(log_uniform(-1.5..1.5))), count),
        force in prop::collection::vec(
            prop::array::uniform3(prop_oneof![
                4 => uneven_profile(log_uniform(1.5..5.0)),
                1 => Just(Profile::Constant(f64::INFINITY)),
            ]), count),
        curved in log_uniform(-1.0..1.3),
        rest in prop::collection::vec(prop::array::uniform3(uneven_profile(-1.0..1.0)), count),
        lengths in prop::collection::vec(0.58..1.73, count),
        angles in prop::collection::vec(-1.5..1.5, count),
    ) -> Scenario {
        let mut leaf = paper_leaf(count, [1.0; 3], [1.0; 3], 0.0);
        for (j, rod) in leaf.rods.iter_mut().enumerate() {
            rod.length = lengths[j];
            rod.angle = angles[j];
            rod.couple_stiffness = couple[j].clone();
            rod.force_stiffness = force[j].clone();
            rod.rest_curvature = rest[j].each_ref().map(|profile| profile.scaled(curved));
        }
        leaf
    }
}

prop_compose! {
    /// One to five veins, each its own, under loads and couplings over two decades.
    pub fn wild_leaves()(count in 1..6_usize)(
        leaf in uneven_rods(count),
        load in log_uniform(-1.0..1.2),
        coupling in log_uniform(-1.0..3.0),
        parts in prop::collection::vec(prop::array::uniform3(0.0..1.0), count - 1),
        gravity in prop::array::uniform3(-1.0..1.0),
        tip_force in prop::array::uniform3(-1.0..1.0),
        tip_moment in prop::array::uniform3(-1.0..1.0),
        joined in prop::bool::weighted(0.8),
    ) -> Scenario {
        let mut leaf: Scenario = leaf;
        leaf.joined = joined;
        leaf.gravity = gravity.map(|g| load * g);
        leaf.tip_force = tip_force.map(|f| load * f);
        leaf.coupling = parts.iter().map(|gap| gap.map(|part: f64| coupling * part)).collect();
        if leaf.rods.len() == 1 {
            leaf.tip_moment = tip_moment;
        }
        leaf
    }
}

prop_compose! {
    /// One to eight veins at the edge of what could be a leaf: stiffness over three
    /// decades, lengths over a factor of three, curved by up to 20/L at rest, loads up
    /// to 1e4 of the softest vein.
    pub fn uneven_leaves()(count in 1..9_usize)(
        leaf in uneven_rods(count),
        load in log_uniform(-2.5..2.5),
        coupling in log_uniform(-1.0..3.0),
        parts in prop::collection::vec(prop::array::uniform3(0.0..1.0), count - 1),
        gravity in prop::array::uniform3(-1.0..1.0),
        tip_force in prop::array::uniform3(-1.0..1.0),
        joined in prop::bool::weighted(0.75),
    ) -> Scenario {
        let mut leaf: Scenario = leaf;
        leaf.joined = joined;
        leaf.gravity = gravity.map(|g| load * g);
        leaf.tip_force = tip_force.map(|f| load * leaf.rods.len() as f64 * f);
        leaf.coupling = parts.iter().map(|gap| gap.map(|part: f64| coupling * part)).collect();
        leaf
    }
}
