//! Leaves vibrate at the right frequencies. Those of the semi-discrete
//! equations converge to the known ones of beams and chains with the square
//! of the segment length, and leapfrog vibrates at them but for its known
//! dispersion.

mod common;

use common::motion::*;
use common::vibration::Linear;
use common::*;
use glam::DQuat;
use leafdyn::internals::leaf::{DiscreteLeaf, Grid, Leaf, State};
use leafdyn::internals::motion::Physics;
use leafdyn::scenario::Schedule;

/// A beam with the slenderness r2 = I/(A L^2) and s2 = EI/(k G A L^2).
fn slender(r2: f64, s2: f64) -> Scenario {
    beam(r2, [1.0 / r2, 1.0 / s2])
}

/// Frequencies of bending up and down of a straight rod along e1, in the
/// scenario's units.
fn bending(leaf: &DiscreteLeaf, state: &State) -> Vec<f64> {
    let physics = Physics::new(&leaf.leaf);
    let linear = Linear::new(leaf, &physics, state).only(&[1, 5]);
    let all = linear.lowest(4).into_iter();
    all.map(|frequency| frequency / physics.time).collect()
}

/// What the lowest frequencies on nested grids extrapolate to. The order of
/// convergence is two.
fn extrapolated<const K: usize>(name: &str, grids: &[Vec<f64>]) -> [f64; K] {
    std::array::from_fn(|k| {
        let values: Vec<f64> = grids.iter().map(|grid| grid[k]).collect();
        let [.., a, b, c] = values[..] else {
            panic!("three grids at least");
        };
        let order = order(a - b, b - c);
        close(
            &format!("order of {name}, mode {k}, {values:?}"),
            order,
            2.0,
            0.1,
        );
        extrapolate(&values, 0.25)
    })
}

/// As [`extrapolated`], of a beam that nothing loads.
fn of_beam<const K: usize>(name: &str, scenario: &Scenario) -> [f64; K] {
    let leaf = Leaf::new(scenario);
    let on = |segments| bending(&discrete(&leaf, segments), &released(&leaf, segments));
    extrapolated(name, &[16, 32, 64, 128].map(on))
}

#[track_caller]
fn assert_near(name: &str, found: &[f64], known: &[f64], within: f64) {
    for (mode, (found, known)) in found.iter().zip(known).enumerate() {
        close(&format!("{name}, mode {mode}"), found / known, 1.0, within);
    }
}

/// Roots of the frequency equation of the clamped Timoshenko beam, to 16
/// digits, from its closed form.
#[test]
fn clamped_timoshenko_beams() {
    for [r2, s2, known @ ..] in table::<6>(TIMOSHENKO) {
        let name = format!("r2 = {r2}, s2 = {s2}");
        let found = of_beam::<4>(&name, &slender(r2, s2));
        assert_near(&name, &found, &known, 1e-8);
    }
}

#[test]
fn clamped_beams_so_slender_that_only_bending_counts() {
    let known = SLENDER.map(|b| b * b);
    let slender = [2e-4, 1e-4, 5e-5, 2.5e-5]
        .map(|part| of_beam::<3>(&format!("{part}"), &slender(part, part)));
    let found = [0, 1, 2].map(|k| extrapolate(&slender.map(|of| of[k]), 0.5));
    assert_near("Euler-Bernoulli", &found, &known, 1e-6);
}

/// The lowest frequencies of a hanging chain on nested grids that are fine at its clamp.
fn hanging(part: f64) -> Vec<Vec<f64>> {
    let rod = chain(part);
    let leaf = Leaf::new(&rod);
    let mut grid = Grid::new(1, &layered(48)[1..48]);
    let mut found = Vec::new();
    for _ in 0..4 {
        let leaf = DiscreteLeaf::new(&leaf, grid.clone());
        found.push(bending(&leaf, &hanging_straight(&leaf)));
        grid = grid.refined();
    }
    found
}

/// A rod along e1, each segment stretched by what hangs on it.
fn hanging_straight(leaf: &DiscreteLeaf) -> State {
    let n = leaf.segments();
    let mut x = vec![DVec3::ZERO; n + 1];
    let below = |i: usize| (i + 1..=n).map(|node| leaf.grid.weight(node)).sum::<f64>();
    let forces: Vec<DVec3> = (0..n).map(|i| below(i) * leaf.loads.gravity).collect();
    for i in 0..n {
        let section = leaf.section(0, i);
        x[i + 1] = x[i] + section.ds * (DVec3::X + section.compliance * forces[i]);
    }
    let mut state = State::new(n, x, vec![DQuat::IDENTITY; n + 1]);
    state.n = forces;
    assert!(leaf.residual(&state) < 1e-9 * leaf.loads.gravity.x);
    state
}

#[test]
fn a_hanging_chain() {
    let known = CHAIN.map(f64::sqrt);
    let ever_softer = [0.02, 0.01, 0.005, 0.0025, 0.00125]
        .map(|part| extrapolated::<2>(&format!("bending {part}"), &hanging(part)));
    let found = [0, 1].map(|k| extrapolate(&ever_softer.map(|of| of[k]), 0.5));
    assert_near("chain", &found[..1], &known[..1], 1e-6);
    // The second feels bending more.
    assert_near("chain", &found, &known, 2e-5);
}

/// Leapfrog with steps of `h` vibrates at 2/h asin(omega h/2) where the
/// semi-discrete equations have the frequency omega: let go in the shape of a
/// mode, every number follows the cosine of that frequency.
fn assert_vibrates(name: &str, scenario: &Scenario, state: &State, wanted: &[usize]) {
    const SIZE: f64 = 1e-6;
    let leaf = Leaf::new(scenario);
    let grid = discrete(&leaf, state.segments());
    let linear = Linear::new(&grid, &Physics::new(&leaf), state);
    let modes = linear.modes();
    let fastest = modes.frequencies[modes.frequencies.len() - 1];
    for &mode in wanted {
        let omega = modes.frequencies[mode];
        let h = 1.5 / fastest;
        let start = linear.displaced(state, modes.modes.column(mode).into(), SIZE);
        let worst = off_cosine(&leaf, (state, &start), (omega, h), (SIZE, 100));
        assert!(worst < 1e-5, "{name}, mode {mode}: {worst:.1e}");
    }
}

#[test]
fn a_beam_in_motion() {
    let beam = slender(0.0016, 0.00416);
    let leaf = Leaf::new(&beam);
    assert_vibrates("beam", &beam, &released(&leaf, 12), &[0, 3, 20, 40]);
}

/// Bent, twisted, coupled and joined, under a load.
#[test]
fn a_leaf_in_motion() {
    let mut leaf = three_veins();
    leaf.dynamics.gravity = Schedule::constant([1.0, -2.0, -3.0]);
    assert_vibrates("leaf", &leaf, &rest(&leaf, 6), &[0, 5, 30, 60, 90]);
}
