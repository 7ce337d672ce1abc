//! Rigid rods whose arcs do not meet are released from a shape near the arcs in
//! which they do, and their energy is kept from there on.

use leafdyn::simulate::{Options, Simulation};
use leafdyn_testing::motion::run;
use leafdyn_testing::random::Draw;
use leafdyn_testing::*;

fn leaf(overrides: &str) -> Scenario {
    let moving = "dynamics.external_damping=0; dynamics.internal_damping=0; dynamics.duration=0.3";
    scenario("motion/swing", &format!("{RIGID}; {moving}; {overrides}"))
}

#[test]
fn they_are_closed_and_their_energy_is_kept() {
    for overrides in [
        "leaf.rods=3; leaf.length=[1.0, 0.8, 1.1]",
        "leaf.rods=2; leaf.length=[1.0, 0.6]; leaf.fan=[0.9, -0.2]",
        "leaf.rods=5; leaf.fan=[-1.2, -0.3, 0.1, 0.5, 1.4]; rest.bend_2=2.0",
        // The midrib is straight, and has to give way to one side.
        "leaf.rods=3; leaf.fan=\"symmetric\"",
    ] {
        let leaf = leaf(overrides);
        let mut simulation = Simulation::new(&leaf, &Options::default()).unwrap();
        let first = simulation.frame();
        let segments = simulation.segments();
        for (j, rod) in leaf.rods.iter().enumerate() {
            for ends in first.centerline(j).windows(2) {
                let off = (ends[1] - ends[0]).length() * segments as f64 / rod.length - 1.0;
                assert!(off.abs() < 1e-9, "{overrides}: {off:.1e}");
            }
            // It leaves the base as it must, and stays near the plane of its arcs.
            let base = first.rotations[j * (segments + 1)] * DVec3::X;
            let towards = DVec3::new(rod.angle.cos(), rod.angle.sin(), 0.0);
            assert!((base - towards).length() < 1e-12);
        }
        let begin = first.energy.balance();
        let mut largest = 0.0_f64;
        while !simulation.done() {
            let frame = simulation.next_frame();
            let frame = frame.unwrap_or_else(|stopped| panic!("{overrides}: {stopped}"));
            let (energy, within) = (frame.energy, 1e-3 * (1.0 + begin.abs()));
            largest = largest.max(energy.kinetic);
            close(overrides, energy.balance(), begin, within);
        }
        assert!(largest > 1e-4, "{overrides}: it moves");
    }
}

/// Fans of all kinds move, those too in which a rod has to bend far to reach the others.
#[test]
fn fans_of_all_kinds_move() {
    let mut draw = Draw(5);
    for case in 0..30 {
        let rods = draw.uniform(2.0, 9.0) as usize;
        let (fan, length) = (draw.list(rods, -1.6, 1.6), draw.list(rods, 0.7, 1.4));
        let fan = match case % 3 {
            0 => format!("{fan:?}"),
            1 => "\"symmetric\"".into(),
            _ => "\"paper\"".into(),
        };
        let short = "dynamics.duration=1e-3; dynamics.output_interval=1e-3";
        let overrides =
            format!("leaf.rods={rods}; leaf.fan={fan}; leaf.length={length:?}; {short}");
        let last = run(&leaf(&overrides), &Options::default());
        assert!(last.energy.kinetic > 0.0, "{overrides}");
    }
}
