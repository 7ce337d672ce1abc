//! Leaves that move: scenarios, starts, methods, and how far apart two motions are.

use glam::DVec3;
use leafdyn::internals::leaf::{DiscreteLeaf, Grid, Leaf, State};
use leafdyn::internals::motion::{
    Explicit, Physics, SemiImplicit, Snapshot, StepControl, TimeIntegrator,
};
use leafdyn::internals::relax::initial_state;
use leafdyn::relax::Equilibrium;
use leafdyn::scenario::{
    Grip, PointLoad, PolarInertia, Profile, Scenario, Schedule, SupportKind, Tissue,
};
use leafdyn::simulate::{self, Frame, Simulation};

pub use leafdyn::simulate::Scheme;

use crate::{iterated, largest, nodes, paper_leaf, settled};

/// Linear from zero at time 0 to `value` at time `until`, then constant.
pub fn ramp(until: f64, value: [f64; 3]) -> Schedule<[f64; 3]> {
    Schedule::linear(vec![0.0, until], vec![[0.0; 3], value])
}

/// Rest shapes whose curvature grows so many times until time 2.
pub fn curling(times: f64) -> Schedule<f64> {
    Schedule::linear(vec![0.0, 2.0], vec![1.0, times])
}

/// External and internal damping.
pub const DAMPINGS: [(f64, f64); 4] = [(0.0, 0.0), (1.5, 0.0), (0.0, 0.01), (1.5, 0.01)];

/// A twisted rod of three different bending and shear stiffnesses and moments of inertia, without
/// loads and undamped; natural units.
pub fn twisted_rod() -> Scenario {
    let mut rod = paper_leaf(1, [0.9, 1.4, 0.7], [90.0, 60.0, 40.0], 0.0);
    rod.rods[0].rest_curvature = [0.8, -0.5, 0.6].map(Profile::Constant);
    rod.dynamics.rotary_inertia = vec![[0.01, 0.025].map(Profile::Constant)];
    rod.dynamics.polar_inertia = PolarInertia::Sum;
    rod.dynamics.external_damping = 0.0;
    rod
}

/// The same under dead moments on points in its middle and at its tip.
pub fn moments_on_points() -> Scenario {
    let mut rod = twisted_rod();
    let point = |at: f64, moment: [f64; 3]| PointLoad {
        vein: 0,
        at,
        force: [0.0; 3],
        moment,
        follows: false,
        mass: 0.0,
        offset: [0.0; 2],
        in_time: None,
        landing: None,
    };
    rod.points = vec![
        point(0.5, [0.8, -0.6, 0.9]),
        point(0.75, [-0.3, 0.4, 0.2]),
        point(1.0, [0.2, 0.3, -0.4]),
    ];
    rod
}

/// Three veins of different lengths and stiffnesses, coupled and joined at
/// the tip, under their weight; undamped.
pub fn three_veins() -> Scenario {
    let mut leaf = paper_leaf(3, [0.9, 1.2, 0.8], [90.0, 60.0, 40.0], 0.0);
    leaf.coupling = vec![[1.0, 6.0, 2.0], [0.5, 3.0, 4.0]];
    for (rod, part) in leaf.rods.iter_mut().zip([0.95, 1.0, 0.9]) {
        rod.length = part;
        let of = |profile: &mut Profile| *profile = Profile::Constant(part * profile.at(0.5));
        rod.couple_stiffness.iter_mut().for_each(of);
        rod.rest_curvature[1] = Profile::Constant(0.4 * part);
    }
    leaf.dynamics.external_damping = 0.0;
    leaf
}

/// The same with tissue, a stretch of one vein pinned and displaced, and a point of another clamped.
pub fn gripped_veins() -> Scenario {
    let mut leaf = three_veins();
    leaf.tissue = Some(vec![
        Tissue {
            stiffness: [20.0, 40.0, 30.0].map(Profile::Constant),
            fold: Profile::Constant(0.5),
            contraction: Profile::Constant(0.0),
        };
        2
    ]);
    let grip = |vein: usize, at: [f64; 2], held: SupportKind, displacement: [f64; 3]| Grip {
        displacement,
        ..Grip::rigid(vein, at, held)
    };
    leaf.grips = vec![
        grip(0, [0.25, 0.5], SupportKind::Pinned, [0.02, -0.03, 0.04]),
        grip(2, [0.75; 2], SupportKind::Clamped, [0.0, 0.05, 0.0]),
    ];
    leaf
}

/// The scenario with loads at rest that are those at time 0.
pub fn at_beginning(scenario: &Scenario) -> Scenario {
    let mut resting = scenario.clone();
    let dynamics = &scenario.dynamics;
    resting.gravity = dynamics.gravity.at(0.0);
    resting.tip_force = dynamics.tip_force.at(0.0);
    resting.tip_moment = dynamics.tip_moment.at(0.0);
    let factor = dynamics.rest.at(0.0);
    for rod in &mut resting.rods {
        rod.rest_curvature = rod.rest_curvature.each_ref().map(|it| it.scaled(factor));
    }
    resting
}

/// A straight rod along e1 of unit length, bending stiffness and mass, undamped, with
/// the rotary inertia r2 = I/(A L^2).
pub fn beam(r2: f64, [axial, shear]: [f64; 2]) -> Scenario {
    let mut beam = paper_leaf(1, [1.0; 3], [axial, shear, shear], 0.0);
    beam.rods[0].angle = 0.0;
    beam.dynamics.rotary_inertia = vec![[r2; 2].map(Profile::Constant)];
    beam.dynamics.external_damping = 0.0;
    beam
}

/// A hanging rod of length, mass and gravity one that hardly bends, by the
/// stiffness `part`^2.
pub fn chain(part: f64) -> Scenario {
    let [soft, stiff] = [part * part, 1.0 / (part * part)];
    let mut rod = paper_leaf(1, [soft; 3], [stiff; 3], 0.0);
    rod.rods[0].angle = 0.0;
    rod.dynamics.density = vec![Profile::Constant(1.0)];
    rod.dynamics.rotary_inertia = vec![[soft; 2].map(Profile::Constant)];
    rod.gravity = [1.0, 0.0, 0.0];
    rod.dynamics.gravity = Schedule::constant(rod.gravity);
    rod
}

/// Squares of two frequencies of a hanging chain: (j/2)^2 with the zeros j of the
/// Bessel function J0 (H. Lamb, Higher mechanics).
pub const CHAIN: [f64; 2] = [1.445796490736696, 7.617815585915522];

/// Roots of frequencies of a beam so slender that only bending counts: those of
/// cos b cosh b = -1 (S. Timoshenko, Vibration problems in engineering).
pub const SLENDER: [f64; 3] = [1.875104068711961, 4.694091132974175, 7.854757438237613];

/// Slenderness r^2 = I/(A L^2) and s^2 = EI/(k G A L^2); frequencies of the clamped Timoshenko
/// beam, times sqrt(rho A L^4/EI): roots of its frequency equation (T. C. Huang, J. Appl.
/// Mech. 28, 1961) to 13 digits.
pub const TIMOSHENKO: &str = "
    1e-4    2.6e-4   3.513078252179  21.90711479483  60.85906859261  117.9269574473
    0.0016  0.00416  3.470067483695  20.23985098215  51.63550442718  90.90518380084
    0.01    0.026    3.259779790893  15.02362640182  33.03084600553  50.83238503823
";

/// A layer at the clamp of a chain bends: points that are most of them there.
pub fn layered(count: u32) -> Vec<f64> {
    let growth = 4.2_f64;
    let at = |i: u32| (growth * f64::from(i) / f64::from(count)).exp_m1() / growth.exp_m1();
    (0..=count).map(at).collect()
}

/// The leaf of a scenario on a grid.
pub fn discrete(leaf: &Leaf, segments: usize) -> DiscreteLeaf {
    DiscreteLeaf::new(leaf, Grid::new(segments, leaf.kinks()))
}

/// The equilibrium at time 0, to rounding.
pub fn rest(scenario: &Scenario, segments: usize) -> State {
    let resting = at_beginning(scenario);
    state_of(scenario, &settled(&resting, &iterated(1e-12, segments)))
}

/// The state of a result on one grid.
pub fn state_of(scenario: &Scenario, found: &Equilibrium) -> State {
    let length = Leaf::new(scenario).scale.length;
    let nodes = || nodes(&found.shape.rods);
    let x = nodes().map(|node| node.position / length).collect();
    let q = nodes().map(|node| node.rotation).collect();
    State::new(found.shape.stations.len() - 1, x, q)
}

/// How far, over the amplitude `size`, leapfrog with steps of `h` is from the cosine at which
/// it should vibrate about a state of rest when it is let go in the shape of a mode
/// of frequency omega: 2/h asin(omega h/2). Looked at every hundred steps.
pub fn off_cosine(
    leaf: &Leaf,
    (rest, start): (&State, &State),
    (omega, h): (f64, f64),
    (size, looks): (f64, usize),
) -> f64 {
    let seen = 2.0 / h * (0.5 * omega * h).asin();
    let mut leapfrog = method(Scheme::Explicit, leaf, start, h);
    let positions = |s: &State| -> Vec<f64> { s.x.iter().flat_map(|x| x.to_array()).collect() };
    let (rest, start) = (positions(rest), positions(start));
    let mut worst = 0.0_f64;
    for k in 1..=looks {
        let until = h * (100 * k) as f64;
        leapfrog.advance(until).unwrap();
        assert_eq!(leapfrog.steps(), 100 * k);
        let now = positions(&leapfrog.snapshot().state);
        let cosine = (seen * until).cos();
        for ((now, rest), start) in now.iter().zip(&rest).zip(&start) {
            worst = worst.max((now - rest - cosine * (start - rest)).abs() / size);
        }
    }
    worst
}

/// The shape from which a leaf is released.
pub fn released(leaf: &Leaf, segments: usize) -> State {
    initial_state(&discrete(leaf, segments))
}

/// Explicit motion of a leaf on the state's grid, with steps of `h` or the longest.
pub fn explicit(leaf: &Leaf, state: &State, h: Option<f64>) -> Explicit {
    let grid = discrete(leaf, state.segments());
    Explicit::new(grid, Physics::new(leaf), state, h).unwrap()
}

/// Semi-implicit motion of a leaf on the state's grid.
pub fn semi_implicit(leaf: &Leaf, state: &State, steps: StepControl) -> SemiImplicit {
    let grid = discrete(leaf, state.segments());
    SemiImplicit::new(grid, Physics::new(leaf), state, steps)
}

/// A leaf of five slender veins, in cm and N: 15 cm long and 1 mm thick, of 200 MPa.
pub const SLENDER_VEINS: &str = r#"
    name = "slender"
    [leaf]
    rods = 5
    length = 15.0
    fan = "symmetric"
    [section]
    shape = "circle"
    diameter = 0.1
    young = 2e4
    mass_density = 1e-5
    [load]
    gravity = [0, 0, -1e-4]
"#;

/// The two methods.
pub const BOTH: [Scheme; 2] = [Scheme::Explicit, Scheme::SemiImplicit];

/// A method at time 0 with steps of `h`.
pub fn method(scheme: Scheme, leaf: &Leaf, state: &State, h: f64) -> Box<dyn TimeIntegrator> {
    match scheme {
        Scheme::Explicit => Box::new(explicit(leaf, state, Some(h))),
        Scheme::SemiImplicit => Box::new(semi_implicit(leaf, state, StepControl::Fixed(h))),
    }
}

/// How far the balance of energy is off at so many outputs, an interval apart, of a motion by steps of `h`.
#[track_caller]
pub fn energy_imbalance(
    scheme: Scheme,
    leaf: &Leaf,
    start: &State,
    h: f64,
    (outputs, interval): (u32, f64),
) -> f64 {
    let mut method = method(scheme, leaf, start, h);
    let before = method.snapshot().energy.balance();
    let off = (1..=outputs).map(|k| {
        let now = method.advance(interval * f64::from(k)).unwrap();
        (now.energy.balance() - before).abs()
    });
    crate::largest(off)
}

/// Where a leaf is at `until`, having moved by steps of `h`.
#[track_caller]
pub fn at(scheme: Scheme, leaf: &Leaf, state: &State, h: f64, until: f64) -> Snapshot {
    let mut method = method(scheme, leaf, state, h);
    if let Err(broken) = method.advance(until) {
        panic!("{scheme:?}, steps of {h}: {broken:?}");
    }
    method.snapshot()
}

/// Moving by a method, on a grid of so many segments.
pub fn moving(scheme: Scheme, segments: Option<usize>) -> simulate::Options {
    simulate::Options {
        scheme: Some(scheme),
        segments,
        ..simulate::Options::default()
    }
}

/// The last frame of a simulation.
#[track_caller]
pub fn run(scenario: &Scenario, options: &simulate::Options) -> Frame {
    let mut simulation = Simulation::new(scenario, options).unwrap();
    while !simulation.done() {
        simulation.next_frame().unwrap();
    }
    simulation.frame()
}

/// All positions, rotations and velocities of a snapshot.
pub fn numbers(snapshot: &Snapshot) -> Vec<f64> {
    let state = &snapshot.state;
    let velocities = snapshot.velocity.iter();
    (state.x.iter().flat_map(|x| x.to_array()))
        .chain(state.q.iter().flat_map(|q| q.to_array()))
        .chain(velocities.flat_map(|v| [v.linear, v.angular].map(|v| v.to_array()).concat()))
        .collect()
}

/// Largest difference.
pub fn apart(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    largest(a.iter().zip(b).map(|(a, b)| (a - b).abs()))
}

/// Root of the mean square of the differences, smoother than the largest.
pub fn distance(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    let squares: f64 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
    (squares / a.len() as f64).sqrt()
}

/// The limit of values at h and h/2 whose error is of second order.
pub fn limit(coarse: &[f64], fine: &[f64]) -> Vec<f64> {
    let pairs = coarse.iter().zip(fine);
    pairs.map(|(c, f)| f + (f - c) / 3.0).collect()
}

/// Position of the tip of the first rod.
pub fn tip(snapshot: &Snapshot) -> DVec3 {
    snapshot.state.tip(0)
}
