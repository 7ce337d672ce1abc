//! The lowest modes of leaves at rest: known frequencies, errors that hold, none left out, as
//! many unstable ones as there are.

use leafdyn::internals::leaf::State;
use leafdyn::internals::motion::Physics;
use leafdyn::relax::{Mode, relax};
use leafdyn::scenario::{Dynamics, PolarInertia};
use leafdyn_testing::motion::{
    CHAIN, SLENDER, beam, chain, discrete, layered, state_of, three_veins,
};
use leafdyn_testing::random::{cases, drawn, leaves};
use leafdyn_testing::vibration::Linear;
use leafdyn_testing::*;
use nalgebra::SymmetricEigen;
use proptest::prelude::*;

fn with(count: usize) -> Options {
    let mut options = with_modes(count, Options::default());
    options.mode_shapes = true;
    options
}

/// On one grid.
fn with_on(segments: usize, count: usize) -> Options {
    by(Method::default().on_grid(Some(segments)), with(count))
}

#[track_caller]
fn modes_of(leaf: &Equilibrium) -> &[Mode] {
    leaf.stability.modes.as_deref().expect("modes are found")
}

/// Frequencies must be those known to 1e-6 of them, and the estimates of the
/// errors must hold, but for the `digits` to which they are known.
#[track_caller]
fn assert_known(name: &str, leaf: &Equilibrium, known: &[f64], digits: f64) {
    let modes = modes_of(leaf);
    assert_eq!(modes.len(), known.len());
    for (k, (mode, known)) in modes.iter().zip(known).enumerate() {
        let found = mode.frequency().expect("the rod is stable");
        let error = (found / known - 1.0).abs();
        let estimate = mode.error.expect("several grids") / (2.0 * known * known);
        let what = format!("{name}, mode {k}: {found:.10}, {error:.1e}, estimate {estimate:.1e}");
        assert!(error < 1e-6, "{what}");
        assert!(error <= estimate + digits, "{what}");
    }
}

/// Every frequency twice.
#[test]
fn a_slender_beam_vibrates_as_euler_and_bernoulli_say() {
    let known: Vec<f64> = SLENDER.iter().flat_map(|b| [b * b; 2]).collect();
    let slender = settled(&beam(1e-10, [f64::INFINITY; 2]), &with(6));
    assert_known("Euler-Bernoulli", &slender, &known, 1e-8);
}

/// Roots of the frequency equation of the clamped Timoshenko beam (T. C. Huang,
/// J. Appl. Mech. 28, 1961) to 13 digits. Rods also twist and stretch, both
/// with (k - 1/2) pi/r here: the whole spectrum is known.
#[test]
fn timoshenko_beams_with_all_modes_in_space() {
    for [r2, s2, bending @ ..] in table::<6>(TIMOSHENKO) {
        let bars = (1..10).map(|k| (f64::from(k) - 0.5) * PI / r2.sqrt());
        let mut known: Vec<f64> = bars.chain(bending).flat_map(|omega| [omega; 2]).collect();
        known.sort_by(f64::total_cmp);
        known.retain(|&omega| omega <= bending[3]);
        let name = format!("r2 = {r2}, s2 = {s2}");
        let beam = beam(r2, [1.0 / r2, 1.0 / s2]);
        assert_known(&name, &settled(&beam, &with(known.len())), &known, 1e-12);
    }
}

/// A beam of a flat section, four times as wide as thick, with the slenderness of the first row of the table about d2 and
/// of the second about d3. It twists with the inertia rho (I2 + I3).
fn flat_beam(torsion: f64) -> (Scenario, Vec<f64>) {
    let [soft, stiff, _] = table::<6>(TIMOSHENKO)[..] else {
        panic!("three rows");
    };
    let [[r2, s2, bending_2 @ ..], [r3, s3, bending_3 @ ..]] = [soft, stiff];
    let [axial, shear] = [1.0 / r2, 1.0 / s2];
    close("section", 16.0 * r2 / r3 + 16.0 * s2 / s3, 2.0, 1e-14);
    let beam = parse(&format!(
        r#"
        name = "flat"
        leaf = {{ rods = 1, length = 1.0, fan = [0.0] }}
        stiffness = {{ torsion = {torsion:?}, bending_2 = 1.0, bending_3 = 16.0, axial = {axial:?}, shear_2 = {shear:?}, shear_3 = {shear:?} }}
        dynamics = {{ density = 1.0, rotary_inertia = {r2:?}, rotary_inertia_3 = {r3:?}, external_damping = 0.0 }}
        "#
    ));
    let bars = |speed: f64| (1..5).map(move |k| (f64::from(k) - 0.5) * PI * speed);
    let waves = bars((torsion / (r2 + r3)).sqrt()).chain(bars(axial.sqrt()));
    let bending = bending_2.into_iter().chain(bending_3.map(|it| 4.0 * it));
    let mut known: Vec<f64> = waves.chain(bending).collect();
    known.sort_by(f64::total_cmp);
    known.retain(|&omega| omega <= bending_2[3]);
    (beam, known)
}

#[test]
fn a_flat_beam_vibrates_about_either_axis_with_its_own_inertia() {
    let (beam, known) = flat_beam(0.7);
    assert_eq!(known.len(), 8);
    assert_known("flat", &settled(&beam, &with(8)), &known, 1e-11);
    let errors = [64, 128].map(|segments| {
        let leaf = settled(&beam, &with_on(segments, 8));
        let found = modes_of(&leaf).iter().filter_map(Mode::frequency);
        found
            .zip(&known)
            .map(|(found, known)| found - known)
            .collect::<Vec<_>>()
    });
    for k in 0..8 {
        close("order", order(errors[0][k], errors[1][k]), 2.0, 0.02);
    }
}

/// A strip 0.3 m long, 40 mm wide and 0.4 mm thick bends so slenderly that its frequencies are those of Euler and Bernoulli,
/// the fourth to less than 1e-4, and twists with A1 and rho (I2 + I3): with the mass per volume, with the mass per length,
/// and with both moments of inertia as numbers.
#[test]
fn a_strip_has_the_inertia_of_its_section() {
    let [length, width, thickness, young, density] = [0.3, 0.04, 4e-4, 2e9, 800.0_f64];
    let (area, mass) = (width * thickness, density * width * thickness);
    let gyration = [thickness, width].map(|side| side * side / 12.0);
    let given = gyration.map(|squared| mass * squared);
    for (of_section, dynamics) in [
        (format!(", mass_density = {density:?}"), String::new()),
        (String::new(), format!("density = {mass:?}")),
        (
            String::new(),
            format!(
                "density = {mass:?}, rotary_inertia = {:?}, rotary_inertia_3 = {:?}",
                given[0], given[1]
            ),
        ),
    ] {
        let strip = parse(&format!(
            r#"
            name = "strip"
            leaf = {{ rods = 1, length = {length:?}, fan = [0.0] }}
            section = {{ shape = "rectangle", width = {width:?}, thickness = {thickness:?}, young = {young:?}{of_section} }}
            dynamics = {{ {dynamics} }}
            "#
        ));
        let slender = [SLENDER[0], SLENDER[1], SLENDER[2], 10.995_540_734_875_467];
        let bending =
            slender.map(|b| (b / length).powi(2) * (young * gyration[0] * area / mass).sqrt());
        let torsion = strip.rods[0].couple_stiffness[0].at(0.5);
        let twist = 0.5 * PI / length * (torsion / (given[0] + given[1])).sqrt();
        let [one, two, three, four] = bending;
        let leaf = settled(&strip, &with(5));
        for (mode, known) in modes_of(&leaf).iter().zip([one, two, twist, three, four]) {
            close("frequency", mode.frequency().unwrap() / known, 1.0, 1e-4);
        }
        let doubts = format!("{:?}", leaf.doubts);
        assert!(!doubts.contains("Inertia"), "{doubts}");
    }
}

/// A grid makes frequencies wrong by the square of its segments' length.
#[test]
fn frequencies_of_one_grid_converge_in_second_order() {
    for [r2, s2, bending @ ..] in table::<6>(TIMOSHENKO) {
        let beam = beam(r2, [1.0 / r2, 1.0 / s2]);
        let errors = [32, 64].map(|segments| {
            let leaf = settled(&beam, &with_on(segments, 4));
            [0, 2].map(|k| modes_of(&leaf)[k].frequency().unwrap() - bending[k / 2])
        });
        for k in 0..2 {
            close("order", order(errors[0][k], errors[1][k]), 2.0, 0.02);
        }
    }
}

/// Ever softer in bending.
#[test]
fn a_hanging_chain() {
    let known = CHAIN.map(f64::sqrt);
    let softer = [0.02, 0.01, 0.005, 0.0025, 0.00125].map(|part| {
        let mut rod = chain(part);
        // Twist is fast; its knots put nodes where the rod bends.
        let at = layered(48);
        let value = vec![1e4 * part * part; at.len()];
        rod.rods[0].couple_stiffness[0] = linear(&at, &value);
        let leaf = settled(&rod, &with(4));
        let found: Vec<f64> = modes_of(&leaf).iter().filter_map(Mode::frequency).collect();
        close("twice", found[1] / found[0], 1.0, 1e-8);
        close("twice", found[3] / found[2], 1.0, 1e-8);
        [found[0], found[2]]
    });
    for (k, within) in [(0, 1e-6), (1, 2e-5)] {
        let found = extrapolate(&softer.map(|pair| pair[k]), 0.5);
        close("frequency", found / known[k], 1.0, within);
    }
}

/// Of random leaves, unless LEAFDYN_LEAVES asks for others, against the same leaf to 1e-10, with
/// and without more grids for the modes' shapes.
#[test]
fn stated_errors_of_eigenvalues_are_bounds() {
    let count = asked("LEAFDYN_LEAVES", 30);
    let mut compared = 0;
    for (k, leaf) in drawn(leaves(), count).iter().enumerate() {
        let relaxed = |tolerance, mode_shapes| {
            let mut options = with_modes(4, to(tolerance));
            options.mode_shapes = mode_shapes;
            relaxed(leaf, &options)
        };
        let listed = |leaf: &Equilibrium| leaf.stability.modes.clone().unwrap_or_default();
        let best = relaxed(1e-10, true);
        for (tolerance, shapes) in [
            (1e-1, false),
            (1e-2, false),
            (1e-3, false),
            (1e-3, true),
            (1e-5, false),
            (1e-6, true),
        ] {
            let found = relaxed(tolerance, shapes);
            if (found.tips[0] - best.tips[0]).length() > 10.0 * tolerance {
                continue;
            }
            let found = listed(&found);
            assert!(found.is_sorted_by_key(|mode| mode.eigenvalue));
            assert_eq!(
                found.len(),
                listed(&best).len(),
                "leaf {k} to {tolerance:e}"
            );
            for (mode, best) in found.iter().zip(listed(&best)) {
                let (error, left) = (mode.error.unwrap(), best.error.unwrap());
                let what = format!("leaf {k} to {tolerance:e}, shapes {shapes}");
                close(&what, mode.eigenvalue, best.eigenvalue, error + left);
                compared += 1;
            }
        }
    }
    assert!(compared > 10 * count, "{compared}");
}

/// Coarse grids and a low tolerance leave no mode out.
#[test]
fn modes_are_known_to_every_tolerance() {
    for name in ["paper/fig10", "paper/fig07b", "classic/lens_midrib"] {
        let leaf = scenario(name, "");
        let best = settled(&leaf, &with_modes(3, to(1e-7)));
        for tolerance in [3e-2, 1e-2, 3e-3, 1e-3] {
            let found = settled(&leaf, &with_modes(3, to(tolerance)));
            let pairs = modes_of(&found).iter().zip(modes_of(&best));
            assert_eq!(modes_of(&found).len(), 3);
            for (mode, best) in pairs {
                let (error, left) = (mode.error.unwrap(), best.error.unwrap());
                let what = format!("{name} to {tolerance:e}");
                close(&what, mode.eigenvalue, best.eigenvalue, error + left);
            }
        }
    }
}

/// Close eigenvalues that change places from grid to grid.
#[test]
fn eigenvalues_ascend_with_their_modes() {
    let stiffness = "stiffness.torsion=1; stiffness.bending_2=0.5; stiffness.bending_3=2";
    let held = "tip.held=\"clamped\"; tip.position=[0.9957195005240812, 0, 0]";
    let leaf = rod(&format!(
        "{stiffness}; {}; {held}",
        set_stiffness(5e3, f64::INFINITY)
    ));
    let best = settled(&leaf, &with_modes(3, to(1e-8)));
    for tolerance in [1e-1, 1e-2, 1e-3, 1e-4, 1e-6] {
        let found = settled(&leaf, &with_modes(3, to(tolerance)));
        let modes = modes_of(&found);
        assert!(modes.is_sorted_by_key(|mode| mode.eigenvalue));
        for (mode, best) in modes.iter().zip(modes_of(&best)) {
            let error = mode.error.unwrap() + best.error.unwrap();
            close("eigenvalue", mode.eigenvalue, best.eigenvalue, error);
        }
    }
}

/// All eigenvalues, ascending, by a dense method.
fn dense(scenario: &Scenario, state: &State) -> Vec<f64> {
    let leaf = Leaf::new(scenario);
    let grid = discrete(&leaf, state.segments());
    let linear = Linear::new(&grid, &Physics::new(&leaf), state);
    let values = SymmetricEigen::new(linear.scaled()).eigenvalues;
    let mut values: Vec<f64> = values.iter().copied().collect();
    values.sort_by(f64::total_cmp);
    values
}

#[track_caller]
fn assert_as_dense(name: &str, scenario: &Scenario, options: &Options) {
    let leaf = settled(scenario, options);
    let physics = Physics::new(&Leaf::new(scenario));
    let known = dense(scenario, &state_of(scenario, &leaf));
    let found: Vec<f64> = modes_of(&leaf).iter().map(|mode| mode.eigenvalue).collect();
    assert_eq!(found.len(), options.modes.min(known.len()), "{name}");
    let size = known[known.len() - 1].abs();
    for (k, (found, known)) in found.iter().zip(&known).enumerate() {
        let found = found * physics.time_unit.powi(2);
        // A dense method's error is a part of the largest eigenvalue.
        let error = (found - known).abs() / (1e-9 * known.abs() + 1e-14 * size);
        assert!(error < 1.0, "{name}, {k}: {found} for {known}");
    }
}

#[test]
fn eigenvalues_are_those_of_a_dense_method() {
    let on = |segments, count| Options {
        tolerance: Some(1e-12),
        ..with_on(segments, count)
    };
    assert_as_dense("three veins", &three_veins(), &on(6, 25));
    let mut round = three_veins();
    round.dynamics.polar_inertia = PolarInertia::Sum;
    round.dynamics.density = vec![Profile::Constant(7.0); 3];
    assert_as_dense("heavier", &round, &on(6, 25));
    let mut free = three_veins();
    free.joined = false;
    assert_as_dense("free tips", &free, &on(6, 25));
    assert_as_dense("Fig. 4", &fig04(5), &on(8, 20));
    // Every vein vibrates nearly alike, or exactly: eigenvalues are close
    // together, or the same twelve times.
    assert_as_dense("Fig. 4, many veins", &fig04(20), &on(4, 12));
    let mut same = paper_leaf(6, [1.0; 3], [100.0; 3], 0.0);
    same.joined = false;
    same.coupling = vec![[0.0; 3]; 5];
    for count in [2, 12, 15] {
        assert_as_dense("six equal veins", &same, &on(4, count));
    }
    // All there are.
    assert_as_dense("one vein", &fig04(1), &on(4, 100));
    let flat = scenario("paper/fig10", "leaf.rods=5");
    assert_as_dense("a saddle", &flat, &keeping(on(10, 30)));
}

/// Modes do not depend on whether a leaf was brought to rest by motion, nor on whether half of
/// it was solved for.
#[test]
fn other_ways_to_rest_tell_the_same_modes() {
    let explicit = by(Method::Explicit { segments: None }, with(4));
    let mirrored = scenario("paper/fig04", "leaf.rods=4; leaf.fan='symmetric'");
    for (leaf, other, solved) in [(fig04(3), explicit, 3), (mirrored, in_full(with(4)), 2)] {
        let (plain, other) = (settled(&leaf, &with(4)), settled(&leaf, &other));
        assert_eq!(plain.model.rods, solved);
        for (a, b) in modes_of(&plain).iter().zip(modes_of(&other)) {
            let told = a.error.unwrap() + b.error.unwrap() + 1e-7 * a.eigenvalue;
            close("eigenvalue", a.eigenvalue, b.eigenvalue, told);
            close("eigenvalue", a.eigenvalue / b.eigenvalue, 1.0, 1e-5);
            assert_eq!(a.displacement.len(), leaf.rods.len());
        }
    }
}

/// The number of negative eigenvalues listed.
fn negative(leaf: &Equilibrium) -> usize {
    let modes = modes_of(leaf).iter();
    modes.filter(|mode| mode.eigenvalue < 0.0).count()
}

#[test]
fn saddles_have_as_many_negative_eigenvalues_as_their_index() {
    let flat = scenario("paper/fig10", "leaf.rods=5");
    for (segments, index) in [(10, 14), (20, 16), (40, 18), (80, 18)] {
        let leaf = settled(&flat, &keeping(with_on(segments, 24)));
        assert_eq!(leaf.outcome, Outcome::Saddle);
        // So soft a state lies elsewhere on every grid, but nearly flat on all.
        assert!(
            tip(&leaf).z.abs() < 0.01,
            "{segments} segments: {}",
            tip(&leaf)
        );
        assert_eq!(leaf.stability.negative_eigenvalues, Some(index));
        assert_eq!(negative(&leaf), index, "{segments} segments");
        assert!(modes_of(&leaf).is_sorted_by_key(|mode| mode.eigenvalue));
        assert!(modes_of(&leaf)[0].frequency().is_none());
        assert!(modes_of(&leaf)[0].growth().unwrap() > 0.0);
    }
}

/// Euler's column, P = 4.5 pi^2: it buckles in four ways, two by two alike.
#[test]
fn a_round_column_leaves_its_saddle_in_pairs_of_ways() {
    let mut column = beam(1e-4, [1e4; 2]);
    column.tip_force = [-4.5 * PI * PI, 0.0, 0.0];
    let leaf = settled(&column, &keeping(with(6)));
    assert_eq!(leaf.stability.negative_eigenvalues, Some(4));
    assert_eq!(negative(&leaf), 4);
    for pair in modes_of(&leaf).chunks(2) {
        close("twice", pair[1].eigenvalue / pair[0].eigenvalue, 1.0, 1e-7);
    }
}

proptest! {
    #![proptest_config(cases(24))]

    #[test]
    fn random_leaves_have_as_many_negative_eigenvalues_as_their_index(
        leaf in leaves(), keep_unstable: bool,
    ) {
        let segments = 12.max(Leaf::new(&leaf).kinks().len() + 1);
        let mut options = with_on(segments, 12);
        if keep_unstable {
            options = keeping(options);
        }
        let found = relaxed(&leaf, &options);
        if found.outcome.is_success() {
            let index = found.stability.negative_eigenvalues.unwrap();
            let negative = negative(&found);
            prop_assert_eq!(index.min(12), negative);
            prop_assert!(modes_of(&found).is_sorted_by_key(|mode| mode.eigenvalue));
        }
    }
}

fn bits(leaf: &Equilibrium) -> Vec<u64> {
    let mut bits = Vec::new();
    for mode in modes_of(leaf) {
        bits.push(mode.eigenvalue.to_bits());
        let shapes = mode.displacement.iter().chain(&mode.rotation).flatten();
        bits.extend(shapes.flat_map(|v| v.to_array()).map(f64::to_bits));
    }
    bits
}

#[test]
fn modes_are_equal_bit_by_bit_on_any_number_of_threads() {
    let options = with_on(32, 2);
    let on = |threads| on_threads(threads, || settled(&fig04(300), &options));
    let alone = on(1);
    let nodes = alone.accuracy.segments.last().unwrap() * 300;
    assert!(nodes >= 8192, "too small to be shared out");
    for threads in [1, 2] {
        assert_eq!(bits(&on(threads)), bits(&alone), "{threads} threads");
    }
}

/// Nothing is said where nothing is known.
#[test]
fn no_modes_without_a_potential_or_rest_or_request() {
    let mut rollup = fig04(1);
    rollup.tip_moment = [0.0, 1.0, 0.0];
    assert!(settled(&rollup, &with(3)).stability.modes.is_none());
    let unasked = settled(&fig04(2), &Options::default());
    assert!(unasked.stability.modes.is_none());
    let without_shapes = with_modes(3, Options::default());
    assert_eq!(modes_of(&settled(&fig04(3), &without_shapes)).len(), 3);
    let many = relax(&fig04(1), &with(101), &mut |_| {});
    assert!(many.unwrap_err().to_string().contains("modes = 101"));
}

/// Other units, the same leaf.
#[test]
fn frequencies_are_in_the_units_of_the_scenario() {
    let natural = settled(&fig04(3), &with(3));
    // Lengths times 10, stiffness times 1000, density times 4.
    let mut other = paper_leaf(3, [1000.0; 3], [1000.0; 3], 1.0);
    for rod in &mut other.rods {
        rod.length = 10.0;
    }
    // Force over displacement and length: A/L^4.
    other.coupling = vec![[0.0, 0.1, 0.1]; 2];
    other.dynamics = Dynamics::default_for(&other.rods);
    let density = 4.0 * other.dynamics.mean_density();
    other.dynamics.density = vec![Profile::Constant(density); 3];
    other.dynamics.rotary_inertia = vec![[density; 2].map(Profile::Constant); 3];
    let other = settled(&other, &with(3));
    for (a, b) in modes_of(&natural).iter().zip(modes_of(&other)) {
        close("eigenvalue", 4.0 * b.eigenvalue / a.eigenvalue, 1.0, 1e-9);
    }
}

/// In a blade's stiff matrix rounding moves the second eigenvalue by more than the gap below it in
/// which eigenvalues are counted: it is found nevertheless, as if three were requested.
#[test]
fn the_last_mode_of_a_stiff_blade_is_found() {
    let blade = r#"
        leaf = { rods = 7, elevation = 1.05 }
        load = { g = [0, 0, -981] }
        [blade]
        length = 30
        width = { at = [0, 0.1, 0.3, 0.6, 0.85, 1.0], value = [0.8, 1.0, 1.2, 0.9, 0.4, 0.0] }
        thickness = 0.03
        young = 1e5
        mass_density = 7.5e-6"#;
    let scenario = Scenario::from_toml(blade).unwrap();
    let [two, three] =
        [2, 3].map(|count| settled(&scenario, &with_modes(count, Options::default())));
    assert_eq!(modes_of(&two).len(), 2);
    for (a, b) in modes_of(&two).iter().zip(modes_of(&three)) {
        let bound = a.error.unwrap() + b.error.unwrap();
        assert!((a.eigenvalue - b.eigenvalue).abs() <= bound, "{a:?} {b:?}");
    }
}
