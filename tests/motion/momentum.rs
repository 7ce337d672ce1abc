//! In free flight linear momentum is the impulse of the loads and angular
//! momentum that of their moments, to rounding: on the "flying spaghetti" of
//! Simo and Vu-Quoc (Comput. Methods Appl. Mech. Eng. 58, 1986), a flexible
//! beam thrown by a force and a moment at one end. Internal damping changes
//! neither; external damping lets both decay alike. Only the explicit method
//! lets go of the base.

use leafdyn::internals::leaf::DiscreteLeaf;
use leafdyn::internals::motion::{Physics, Snapshot, TimeIntegrator};
use leafdyn::simulate::{self, ExplicitRefusal, Simulation, SimulationError};
use leafdyn_testing::motion::{Scheme, discrete, explicit, moving, released};
use leafdyn_testing::*;

/// L = 10, EA = GA = 1e4, EI = GJ = 500, rho A = 1, rho I = 10; loads rise
/// until t = 2.5 and fall until t = 5. The loaded end is the tip.
const SPAGHETTI: &str = r#"
    name = "flying-spaghetti"
    leaf = { rods = 1, length = 10.0, fan = [-0.9272952180016123] }
    stiffness = { torsion = 500.0, bending_2 = 500.0, bending_3 = 500.0, axial = 1e4, shear_2 = 1e4, shear_3 = 1e4 }
    [dynamics]
    density = 1.0
    rotary_inertia = 10.0
    external_damping = 0.0
    clamped = false
    duration = 15.0
    tip_force = { at = [0.0, 2.5, 5.0], value = [[0.0, 0.0, 0.0], [20.0, 0.0, 0.0], [0.0, 0.0, 0.0]] }
    tip_moment = { at = [0.0, 2.5, 5.0], value = [[0.0, 0.0, 0.0], [0.0, 100.0, 200.0], [0.0, 0.0, 0.0]] }
"#;
const SEGMENTS: usize = 10;
/// Steps until t = 5, and until t = 15.
const LOADED: usize = 2000;
const ALL: usize = 6000;

/// Linear and angular momentum about the origin.
fn momentum(leaf: &DiscreteLeaf, physics: &Physics, now: &Snapshot) -> [DVec3; 2] {
    let mut sum = [DVec3::ZERO; 2];
    for i in 0..=leaf.segments() {
        let inertia = physics.inertia(leaf, 0, i);
        let (velocity, x) = (now.velocity[i], now.state.x[i]);
        let linear = inertia.mass * velocity.linear;
        let q = now.state.q[i];
        let spin = q * (inertia.principal * (q.conjugate() * velocity.angular));
        sum[0] += linear;
        sum[1] += x.cross(linear) + spin;
    }
    sum
}

/// A flight and its momenta, one a step. Dimensionless.
struct Flight {
    /// Width of a step, and the rate of external damping.
    step: f64,
    damping: f64,
    snapshots: Vec<Snapshot>,
    momenta: Vec<[DVec3; 2]>,
    /// Impulses of the force and of the moment about the origin, in the kick of every step:
    /// until the step, and in all.
    impulses: Vec<[[DVec3; 2]; 2]>,
}

fn fly(scenario: &Scenario, steps: usize) -> Flight {
    let leaf = Leaf::new(scenario);
    let (grid, physics) = (discrete(&leaf, SEGMENTS), Physics::new(&leaf));
    let h = 5.0 / LOADED as f64 / physics.time_unit;
    let state = released(&leaf, SEGMENTS);
    let mut method = explicit(&leaf, &state, Some(h));
    let mut flight = Flight {
        step: h,
        damping: physics.damping,
        snapshots: vec![method.snapshot()],
        momenta: Vec::new(),
        impulses: Vec::new(),
    };
    for k in 1..=steps {
        method.advance(h * k as f64).unwrap();
        flight.snapshots.push(method.snapshot());
    }
    assert_eq!(method.steps(), steps);
    for now in &flight.snapshots {
        let momentum = momentum(&grid, &physics, now);
        flight.momenta.push(momentum);
        let from = (now.time - 0.5 * h).max(0.0);
        let until = |until: f64| {
            let loads = physics.mean_loads([from, until]);
            let moment = now.state.tip(0).cross(loads.tip_force) + loads.tip_moment;
            [loads.tip_force, moment].map(|load| (until - from) * load)
        };
        let kick = [until(now.time), until(now.time + 0.5 * h)];
        flight.impulses.push(kick);
    }
    flight
}

/// Largest distance between momenta, over the largest momentum.
fn worst<'a>(pairs: impl Iterator<Item = (&'a [DVec3; 2], [DVec3; 2])>) -> [f64; 2] {
    let (mut error, mut size) = ([0.0_f64; 2], [0.0_f64; 2]);
    for (found, wanted) in pairs {
        for k in 0..2 {
            error[k] = error[k].max((found[k] - wanted[k]).length());
            size[k] = size[k].max(wanted[k].length());
        }
    }
    [error[0] / size[0], error[1] / size[1]]
}

/// The impulse of the loads until every step: of the force exactly, of its moment at the
/// positions of the kicks.
fn impulses(flight: &Flight) -> Vec<[DVec3; 2]> {
    let mut sum = [DVec3::ZERO; 2];
    let of_kick = |[until, whole]: &[[DVec3; 2]; 2]| {
        let now = [0, 1].map(|k| sum[k] + until[k]);
        sum = [0, 1].map(|k| sum[k] + whole[k]);
        now
    };
    flight.impulses.iter().map(of_kick).collect()
}

#[test]
fn momenta_are_the_impulses_of_the_loads() {
    // Also of a beam that is three times as wide as thick, whose sections have three different moments of inertia.
    let flat = SPAGHETTI.replace(
        "rotary_inertia = 10.0",
        "rotary_inertia = 2.0\n    rotary_inertia_3 = 18.0",
    );
    for (text, internal) in [(SPAGHETTI, 0.0), (SPAGHETTI, 0.005), (flat.as_str(), 0.0)] {
        let mut scenario = parse(text);
        scenario.dynamics.internal_damping = internal;
        let flight = fly(&scenario, ALL);
        let all = flight.momenta.iter().zip(impulses(&flight));
        let [linear, angular] = worst(all);
        // It has flown far, bent, and left the plane.
        let chord = |s: &Snapshot| s.state.x[0].distance(s.state.tip(0));
        let shortest = flight.snapshots.iter().map(chord).fold(1.0, f64::min);
        let tip = flight.snapshots[ALL].state.tip(0);
        assert!(linear < 1e-12 && angular < 1e-12);
        let far = match text == SPAGHETTI {
            true => shortest < 0.85 && tip.x > 5.0 && tip.z < -0.2,
            false => shortest < 0.99 && tip.x > 3.0 && tip.z.abs() > 0.01,
        };
        assert!(far, "{shortest} {tip}");

        // Half of 20 times 5, in the scenario's units.
        let leaf = Leaf::new(&scenario);
        let unit = leaf.scale.force() * Physics::new(&leaf).time_unit;
        let impulse = flight.momenta[LOADED][0] * unit;
        assert!((impulse - DVec3::new(50.0, 0.0, 0.0)).length() < 50.0 * 1e-12);

        // Free of loads both stay, and so does energy without damping.
        let free = &flight.momenta[LOADED..];
        let still = free.iter().map(|now| (now, free[0]));
        let [linear, angular] = worst(still);
        let kept = linear < 1e-12 && angular < 1e-12;
        assert!(kept, "{linear:.1e} {angular:.1e}");
        let energies = flight.snapshots[LOADED..].iter().map(|s| s.energy);
        let balance: Vec<f64> = energies.map(|e| e.balance()).collect();
        let off = largest(balance.iter().map(|b| (b - balance[0]).abs()));
        let kinetic = flight.snapshots[LOADED].energy.kinetic;
        assert!(off < 1e-4 * kinetic);
    }
}

/// External damping takes from both by the same factor a step.
#[test]
fn damped_from_outside_both_decay_alike() {
    let mut scenario = parse(SPAGHETTI);
    scenario.dynamics.external_damping = 0.4;
    let flight = fly(&scenario, ALL);
    // Half of the kick at the end of the loads is still under them.
    let first = LOADED + 1;
    let free = &flight.momenta[first..];
    let half = 0.5 * flight.damping * flight.step;
    let part = (1.0 - half) / (1.0 + half);
    let decayed = free.iter().enumerate().skip(1);
    let decayed = decayed.map(|(k, now)| (now, free[0].map(|start| start * part.powi(k as i32))));
    let [linear, angular] = worst(decayed);
    assert!(linear < 1e-12 && angular < 1e-12);
    let all: f64 = (ALL - first) as f64 * flight.step * flight.damping;
    let left = free[free.len() - 1][0].length() / free[0][0].length();
    assert!((left.ln() + all).abs() < 1e-6, "{left} of {}", (-all).exp());
}

/// The semi-implicit method holds the base: it says so.
#[test]
fn the_semi_implicit_method_does_not_fly() {
    let scenario = parse(SPAGHETTI);
    let of = |scenario: &Scenario, options: &simulate::Options| {
        Simulation::new(scenario, options).map(|simulation| simulation.scheme())
    };
    let default = simulate::Options::default();
    assert_eq!(of(&scenario, &default), Ok(Scheme::Explicit));
    let held = Err(SimulationError::Held { obstacle: None });
    assert_eq!(of(&scenario, &moving(Scheme::SemiImplicit, None)), held);
    let mut rigid = scenario.clone();
    rigid.rods[0].force_stiffness[0] = Profile::Constant(f64::INFINITY);
    assert_eq!(
        of(&rigid, &default),
        Err(SimulationError::Held {
            obstacle: Some(ExplicitRefusal::RigidRod)
        })
    );
}
