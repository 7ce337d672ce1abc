//! A leaf that starts at rest stays where it is: it rests by the equations of the grid on which it moves, also where
//! the way there is too far for that grid.

use leafdyn::simulate::{Options, Scheme, Simulation, SimulationError};
use leafdyn_testing::motion::*;
use leafdyn_testing::*;

/// Sheds everything but what a rod is; units of its own.
fn rod(rest: &str, more: &str) -> Scenario {
    parse(&format!(
        "name = 'rod'\nleaf = {{ rods = 1, length = 1.0, fan = [-0.0519] }}\n\
         stiffness = {{ torsion = 0.9, bending_2 = 0.7, bending_3 = 1.0, axial = 900.0, shear_2 = inf, shear_3 = inf }}\n\
         rest = {{ {rest} }}\ndynamics = {{ start = \"at-rest\", duration = 0.05, output_interval = 0.025 }}\n{more}"
    ))
}

/// How far the leaf moves from where it starts, and on how many segments.
fn moves(leaf: &Scenario, options: &Options) -> Result<(f64, usize), SimulationError> {
    let mut simulation = Simulation::new(leaf, options)?;
    let start = simulation.frame().positions;
    while !simulation.done() {
        simulation.next_frame().unwrap();
    }
    let end = simulation.frame().positions;
    let way = start.iter().zip(&end).map(|(a, b)| a.distance(*b));
    Ok((largest(way), simulation.segments()))
}

const TIP: &str = "load = { tip_force = [0.3, 0.2, -0.5] }";

/// Also on grids that are no multiples of that on which the leaf was loaded slowly, with turns between their nodes that
/// are large together.
#[test]
fn wound_rods_stay_at_rest() {
    for rest in [
        "twist = 10.0",
        "twist = 20.0",
        "twist = -50.0",
        "bend_2 = 20.0",
    ] {
        let leaf = rod(rest, TIP);
        let (way, _) = moves(&leaf, &moving(Scheme::SemiImplicit, None)).unwrap();
        assert!(way < 1e-9, "{rest}: {way:.1e}");
    }
    for segments in [20, 37, 64] {
        let leaf = rod("twist = 20.0", TIP);
        let options = moving(Scheme::SemiImplicit, Some(segments));
        let (way, on) = moves(&leaf, &options).unwrap();
        assert!(way < 1e-9 && on == segments, "{segments}: {way:.1e}");
    }
}

/// Holders and tissue stay in the places of the natural leaf where rest curvatures begin with a factor: what starts
/// at rest there stays, as that factor is the only one.
#[test]
fn holders_stay_in_their_places_under_a_factor_of_the_rest_shape() {
    let made = |rods: &str, holders: &str| {
        parse(&format!(
            "name = 'held'\nleaf = {{ {rods}, length = 1.0, joined = false }}\n\
             stiffness = {{ torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = 1000.0, shear_2 = 1000.0, shear_3 = 1000.0 }}\n\
             rest = {{ bend_2 = 0.6, twist = 0.3 }}\n\
             dynamics = {{ start = \"at-rest\", duration = 0.5, output_interval = 0.25, rest = {{ at = [0.0, 0.5], factor = [1.4, 1.4] }} }}\n{holders}"
        ))
    };
    let (one, two) = ("rods = 1, fan = [0.0]", "rods = 2, fan = [-0.2, 0.2]");
    for (rods, holders) in [
        (
            one,
            "grip = [{ vein = 1, at = 0.5, stiffness = [50.0, 50.0, 50.0] }]",
        ),
        (one, "grip = [{ vein = 1, at = 0.5 }]"),
        (one, "grip = [{ vein = 1, at = 0.5, held = \"clamped\" }]"),
        (one, "foundation = { stiffness = [20.0, 20.0, 20.0] }"),
        (
            two,
            "tissue = { across = 10.0, along = 5.0, normal = 20.0, fold = 0.3 }",
        ),
        (
            two,
            "tissue = { across = 10.0, along = inf, normal = inf, fold = 0.3 }",
        ),
    ] {
        let leaf = made(rods, holders);
        let (way, _) = moves(&leaf, &moving(Scheme::SemiImplicit, Some(16))).unwrap();
        assert!(way < 1e-8, "{holders}: {way:.1e}");
    }
}

/// A rod that is pushed together between holders rests on finer grids alone: it moves on one of them, and on a coarse
/// one that is asked for it is refused with what to do.
#[test]
fn what_rests_on_finer_grids_alone_moves_on_them() {
    let held = "[tip]\nheld = 'pinned'\nposition = [0.713, 0.0, 0.0]\n[[grip]]\nvein = 1\nat = [0.727, 0.926]";
    let leaf = rod("bend_2 = 0.0", held);
    let (way, segments) = moves(&leaf, &moving(Scheme::SemiImplicit, None)).unwrap();
    assert!(way < 1e-8 && segments > 16, "{segments}: {way:.1e}");
    let coarse = moves(&leaf, &moving(Scheme::SemiImplicit, Some(16)));
    let why = coarse.unwrap_err().to_string();
    assert!(
        why.contains("on 16 segments") && why.contains("give more segments"),
        "{why}"
    );
}

/// Rigid tissue bears forces that do not follow from where the veins are: a blade that starts at rest has them, too.
#[test]
fn blades_stay_at_rest() {
    for (file, sets) in [
        ("measured/blade", "leaf.rods=3"),
        ("measured/blade", "leaf.rods=4; load.g=[0.0, 50.0, -981.0]"),
        ("measured/blade", "leaf.rods=3; blade.thickness=0.01"),
        ("study/plate", "leaf.rods=3"),
    ] {
        let sets = format!(
            "{sets}; dynamics.start=\"at-rest\"; dynamics.duration=0.02; dynamics.output_interval=0.01"
        );
        let leaf = scenario(file, &sets);
        let (way, _) = moves(&leaf, &moving(Scheme::SemiImplicit, Some(16))).unwrap();
        let length = leaf.rods[0].length;
        assert!(way < 1e-9 * length, "{file}, {sets}: {way:.1e}");
    }
}
