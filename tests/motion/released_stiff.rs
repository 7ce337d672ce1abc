//! Slender veins are released from where their tips have been brought together without stretching
//! them: from arcs that strain them the energy of stretch would throw them about.

use leafdyn::simulate::{Frame, Options, Simulation};
use leafdyn_testing::motion::{BOTH, SLENDER_VEINS, discrete, moving, released};
use leafdyn_testing::*;

/// The frame at time 0, and the number of segments.
fn begin(leaf: &Scenario, options: &Options) -> (Frame, usize) {
    let mut simulation = Simulation::new(leaf, options).unwrap();
    (simulation.frame(), simulation.segments())
}

/// Largest difference of a segment's length from its own, relative to that, and its largest turn.
fn largest_of_segments(leaf: &Scenario, (frame, segments): &(Frame, usize)) -> [f64; 2] {
    let (mut stretch, mut turn) = (0.0_f64, 0.0_f64);
    for (j, rod) in leaf.rods.iter().enumerate() {
        let own = rod.length / *segments as f64;
        let nodes = frame.centerline(j).windows(2);
        stretch = nodes.fold(stretch, |most, ends| {
            most.max(((ends[1] - ends[0]).length() / own - 1.0).abs())
        });
        let rotations = &frame.rotations[j * (segments + 1)..(j + 1) * (segments + 1)];
        turn = rotations
            .windows(2)
            .fold(turn, |most, ends| most.max(ends[0].angle_between(ends[1])));
    }
    [stretch, turn]
}

#[track_caller]
fn assert_gently_joined(name: &str, leaf: &Scenario) {
    let start = begin(leaf, &Options::default());
    let tips = start.0.tips(false);
    assert!(
        tips.iter().all(|tip| *tip == tips[0]),
        "{name}: the tips meet"
    );
    let [stretch, turn] = largest_of_segments(leaf, &start);
    // A force of 256 pi^2 A/L^2, and the chord of a bent segment.
    let rod = &leaf.rods[0];
    let soft = |a: &Profile| a.min() / (rod.length * rod.length);
    let force =
        256.0 * PI * PI * soft(&rod.couple_stiffness[1]).max(soft(&rod.couple_stiffness[2]));
    let allowed = force / rod.force_stiffness[0].min() + turn * turn / 24.0;
    assert!(
        stretch < 1.1 * allowed,
        "{name}: {stretch:.1e} instead of {allowed:.1e}"
    );
    assert!(turn < 0.8, "{name}: a segment turns by {turn}");
    // Of bending alone: turns of four radians at most.
    let unit = rod
        .couple_stiffness
        .iter()
        .skip(1)
        .map(|a| a.max_abs())
        .fold(0.0, f64::max)
        / rod.length;
    let energy = start.0.energy.elastic / (unit * leaf.rods.len() as f64);
    assert!(energy < 0.5 * 40.0, "{name}: {energy} a vein");
}

#[test]
fn they_meet_without_stretch() {
    assert_gently_joined("slender", &parse(SLENDER_VEINS));
    for seed in 0..60 {
        assert_gently_joined(&seed.to_string(), &parse(&real::leaf(seed)));
    }
}

/// By either method, on the segments that the program chooses, and the energy stays: nothing is
/// thrown about.
#[test]
fn they_move_for_their_duration() {
    let mut leaf = parse(SLENDER_VEINS);
    leaf.dynamics.duration *= 0.02;
    leaf.dynamics.output_interval *= 0.02;
    leaf.dynamics.external_damping = 0.0;
    let tips = BOTH.map(|scheme| {
        let mut simulation = Simulation::new(&leaf, &moving(scheme, None)).unwrap();
        assert_eq!(simulation.segments(), 16);
        let start = simulation.frame().energy.balance();
        let mut fastest = 0.0_f64;
        while !simulation.done() {
            let energy = simulation.next_frame().unwrap().energy;
            fastest = fastest.max(energy.kinetic);
            assert!((energy.balance() - start).abs() < 0.02 * (fastest + start.abs()));
        }
        assert!(fastest > 1e-3 * start.abs(), "it moves");
        simulation.frame().tips(true)[0]
    });
    let apart = tips[0].distance(tips[1]) / leaf.rods[0].length;
    assert!(apart < 2e-3, "{apart:.1e}");
}

/// To rest, by default.
#[test]
fn they_come_to_rest_where_they_are_relaxed() {
    let leaf = parse(SLENDER_VEINS);
    let mut simulation = Simulation::new(&leaf, &Options::default()).unwrap();
    while !simulation.done() {
        simulation.next_frame().unwrap();
    }
    let rest = settle_on(&leaf, 16, false).tips[0];
    let off = simulation.frame().tips(true)[0].distance(rest) / 15.0;
    assert!(off < 1e-3, "{off:.1e}");
}

/// Veins that yield to the arcs start from them, as a relaxation does.
#[test]
fn soft_veins_start_from_arcs() {
    for name in ["motion/swing", "paper/fig04", "paper/fig08"] {
        let leaf = scenario(name, "leaf.rods=5");
        let (frame, segments) = begin(&leaf, &Options::default());
        let arcs = released(&Leaf::new(&leaf), segments);
        assert_eq!(frame.positions, arcs.x, "{name}");
    }
    // Nor is there anything to do where there are no arcs.
    let mut apart = parse(SLENDER_VEINS);
    apart.joined = false;
    let model = Leaf::new(&apart);
    let (frame, segments) = begin(&apart, &Options::default());
    let shapes = released(&model, segments);
    assert_eq!(discrete(&model, segments).segments(), segments);
    let same = frame.positions.iter().zip(&shapes.x);
    assert!(same.into_iter().all(|(a, b)| a.distance(*b * 15.0) < 1e-12));
}
