//! The explicit method is stable up to the step it says, which is hardly
//! shorter than it must be; beyond, it says that it diverged: it never returns
//! a motion that is none.

use leafdyn::internals::motion::{Energy, Stopped, TimeIntegrator};
use leafdyn::scenario::PolarInertia;
use leafdyn::simulate::{Options, Simulation, SimulationError};
use leafdyn_testing::motion::{explicit, ramp, released};
use leafdyn_testing::random::{cases, movers};
use leafdyn_testing::*;
use proptest::prelude::*;

/// No damping, external damping, or both.
fn damped(mut leaf: Scenario, kind: usize, external: f64, internal: f64) -> Scenario {
    if kind > 0 {
        leaf.dynamics.external_damping = external;
    }
    if kind > 1 {
        leaf.dynamics.internal_damping = internal;
    }
    leaf
}

fn total(e: &Energy) -> f64 {
    e.kinetic + e.elastic + e.coupling + e.potential
}

proptest! {
    #![proptest_config(cases(40))]

    #[test]
    fn of_random_leaves(
        leaf in movers(),
        segments in 4..8_usize,
        (kind, external, internal) in (0..3_usize, 0.5..5.0_f64, -4.0..-1.0_f64),
    ) {
        let leaf = damped(leaf, kind, external, 10f64.powf(internal));
        let model = Leaf::new(&leaf);
        let state = released(&model, segments);
        let method = |h: f64| explicit(&model, &state, Some(h));
        let said = method(1.0).stable_step().step;
        let h = 0.999 * said;
        let mut steady = method(h);
        let before = total(&steady.snapshot().energy);
        steady.advance(2e4 * h).unwrap();
        let after = steady.snapshot().energy;
        prop_assert!(kind == 0 || (total(&after) < before && after.dissipated > 0.0));

        for over in [1.5, 2.0, 4.0] {
            let h = over * said;
            let mut lost = method(h);
            let found = lost.advance(2000.0 * h);
            let told = matches!(found, Err(Stopped::Diverged { .. } | Stopped::Unresolved { .. }));
            prop_assert!(told, "{over} times as long: {found:?} {:?}", lost.snapshot().energy);
        }
    }
}

proptest! {
    #![proptest_config(cases(40))]

    /// Sections that turn about d2 and d3 at rates up to thirty times apart, in leaves that keep their shapes but for
    /// vibrations: stable up to the step that is said, and not at 1.3 times as long a one.
    #[test]
    fn of_random_flat_leaves(
        leaf in movers(),
        segments in 4..8_usize,
        (flat, about) in (-3.0..-0.3_f64, 0..2_usize),
        small in -3.0..-1.5_f64,
    ) {
        let mut leaf: Scenario = leaf;
        for inertia in &mut leaf.dynamics.rotary_inertia {
            inertia[about] = inertia[about].scaled(10f64.powf(flat));
        }
        leaf.dynamics.polar_inertia = PolarInertia::Sum;
        leaf.joined = false;
        leaf.coupling.fill([0.0; 3]);
        leaf.gravity = leaf.gravity.map(|g| 10f64.powf(small) * g);
        leaf.dynamics.gravity = Schedule::constant(leaf.gravity);
        let model = Leaf::new(&leaf);
        let state = released(&model, segments);
        let method = |h: f64| explicit(&model, &state, Some(h));
        let said = method(1.0).stable_step().step;
        let h = 0.9999 * said;
        let mut steady = method(h);
        let before = total(&steady.snapshot().energy);
        steady.advance(2e4 * h).unwrap();
        let energy = steady.snapshot().energy;
        let grown = total(&energy) - before;
        prop_assert!(grown < 0.01 * energy.potential.abs().max(1e-6), "{grown:e} {energy:?}");
        let lost = method(1.3 * said).advance(2000.0 * 1.3 * said);
        prop_assert!(lost.is_err());
    }
}

/// Neighbours tied together more stiffly than each is by itself.
#[test]
fn of_a_leaf_that_coupling_rules() {
    for rods in [2, 3, 4, 7] {
        let mut leaf = paper_leaf(rods, [1.0; 3], [100.0; 3], 0.1);
        for (j, rod) in leaf.rods.iter_mut().enumerate() {
            rod.angle *= 1e-4;
            rod.length = 1.0 + 1e-4 * j as f64;
        }
        leaf.coupling = (1..rods).map(|gap| [1e5, 1e6 * gap as f64, 3e5]).collect();
        leaf.dynamics.external_damping = 0.0;
        let leaf = Leaf::new(&leaf);
        let state = released(&leaf, 5);
        let method = |h| explicit(&leaf, &state, Some(h));
        let stable = method(1.0).stable_step();
        assert_eq!(stable.limit, "coupling");
        let steps = |part: f64| {
            let h = part * stable.step;
            method(h).advance(2e4 * h)
        };
        assert!(steps(0.999).is_ok());
        assert!(steps(1.2).is_err());
    }
}

/// A thick, soft rod under a strong load, which shakes itself without end when
/// its forces are not those of an energy.
fn thick_rod() -> Scenario {
    let mut rod = rod("");
    rod.tip_force = [0.0, 3.0, -20.0];
    rod.dynamics.tip_force = Schedule::constant(rod.tip_force);
    rod
}

#[test]
fn a_thick_rod_comes_to_rest() {
    for damping in [0.3, 7.0] {
        let mut rod = thick_rod();
        rod.dynamics.external_damping = damping;
        let leaf = Leaf::new(&rod);
        let state = released(&leaf, 20);
        let mut method = explicit(&leaf, &state, None);
        let mut before = total(&method.snapshot().energy);
        // Energy falls all the time, and at last there is no motion.
        for k in 1..=60 {
            method.advance(k as f64 * 60.0 / damping / 60.0).unwrap();
            let energy = method.snapshot().energy;
            let now = total(&energy);
            assert!(now < before + 1e-9, "damping {damping}, {k}: {energy:?}");
            before = now;
        }
        let now = method.snapshot();
        let rest = settle_on(&rod, 20, false);
        let off = now.state.tip(0).distance(rest.tips[0]);
        let kinetic = now.energy.kinetic;
        assert!(kinetic < 1e-20 && off < 1e-8, "{kinetic:e} {off:e}");
    }
}

#[test]
fn a_thick_rod_keeps_its_energy() {
    let mut rod = thick_rod();
    rod.dynamics.external_damping = 0.0;
    let leaf = Leaf::new(&rod);
    let state = released(&leaf, 20);
    let longest = explicit(&leaf, &state, None).longest_step();
    let mut method = explicit(&leaf, &state, Some(0.5 * longest));
    let start = method.snapshot().energy.balance();
    let (mut most, mut off) = (0.0_f64, 0.0_f64);
    for k in 1..=1000 {
        method.advance(k as f64 * 0.1).unwrap();
        let energy = method.snapshot().energy;
        most = most.max(energy.kinetic);
        off = off.max((energy.balance() - start).abs());
    }
    assert!(most > 5.0 && off < 0.05 * most, "{off} of {most}");
}

/// What has no energy yet and what is loaded within a step is not taken for
/// a motion that diverged, however soon one looks.
#[test]
fn what_begins_gently_or_suddenly_goes_on() {
    for until in [3.0, 1e-5] {
        let mut rod = rod("");
        rod.dynamics.tip_force = ramp(until, [0.0, 0.3, 0.1]);
        rod.dynamics.gravity = ramp(until, [0.0, 0.0, -0.2]);
        let leaf = Leaf::new(&rod);
        for segments in [1, 2, 16] {
            let state = released(&leaf, segments);
            let mut method = explicit(&leaf, &state, None);
            let h = method.longest_step();
            for k in 1..=1000 {
                let found = method.advance(h * k as f64);
                let what = format!("{until}, {segments} segments, step {k}");
                assert!(found.is_ok(), "{what}: {:?}", found.err());
            }
        }
    }
}

#[test]
fn steps_beyond_the_limit_are_refused() {
    let rod = thick_rod();
    let of = |step| {
        let options = Options {
            step,
            ..Options::default()
        };
        Simulation::new(&rod, &options).map(|s| s.stable_step().unwrap().step)
    };
    let stable = of(None).unwrap();
    assert_eq!(of(Some(0.999 * stable)), Ok(stable));
    let refused = of(Some(1.001 * stable)).unwrap_err();
    assert!(
        matches!(&refused, SimulationError::Option(it) if it.option == "step"),
        "{refused:?}"
    );
}
