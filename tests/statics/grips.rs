//! Holders along veins.

use leafdyn::relax::{Path, StabilityLoss, Stage};
use leafdyn_testing::*;

const ROD: &str = r#"
    name = "rod"
    leaf = { rods = 1, length = 1.0, fan = [0.0] }
    stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 2.0, axial = 60.0, shear_2 = inf, shear_3 = inf }
"#;

fn gripped(at: &str, held: &str, way: [f64; 3], more: &str) -> Equilibrium {
    let text =
        format!("{ROD}\n{more}\n[[grip]]\nvein = 1\nat = {at}\nheld = {held:?}\nmove = {way:?}");
    settle(&parse(&text), 1e-9)
}

/// A grip at the tip holds what [tip] does, and feels the same.
#[test]
fn a_grip_at_the_tip_is_a_held_tip() {
    for held in ["pinned", "clamped"] {
        let grip = gripped(
            "1.0",
            held,
            [-0.2, 0.1, 0.3],
            "load.gravity = [0.0, 0.0, -1.0]",
        );
        let tip = format!(
            "{ROD}\nload.gravity = [0.0, 0.0, -1.0]\ntip = {{ held = {held:?}, position = [0.8, 0.1, 0.3] }}"
        );
        let tip = settle(&parse(&tip), 1e-9);
        let bars = [&grip, &tip].map(|leaf| leaf.accuracy.error_estimate.unwrap());
        assert!(distance(&grip, &tip) <= bars[0] + bars[1], "{held}");
        let felt = tip.reaction.unwrap();
        let off = only(&grip.grip_reactions).force.distance(felt.force);
        assert!(off < 1e-6 * felt.force.length(), "{held}: {off:.1e}");
        assert_eq!(
            only(&grip.grip_reactions).moment.is_some(),
            held == "clamped"
        );
    }
}

/// The part before a clamp does not depend on what is beyond it.
#[test]
fn a_clamp_in_the_middle_divides_a_vein() {
    let way = [-0.05, 0.1, 0.2];
    let whole = gripped("0.5", "clamped", way, "load.gravity = [0.0, 0.0, -2.0]");
    let half = ROD.replace("length = 1.0", "length = 0.5");
    let half = format!(
        "{half}\nload.gravity = [0.0, 0.0, -2.0]\ntip = {{ held = \"clamped\", position = [0.45, 0.1, 0.2] }}"
    );
    let half = settle(&parse(&half), 1e-9);
    let bars = [&whole, &half].map(|leaf| leaf.accuracy.error_estimate.unwrap());
    let (whole, nodes) = (&whole.shape, &half.shape.rods[0].nodes);
    let mut compared = 0;
    for (sigma, node) in half.shape.stations.iter().zip(nodes) {
        let station = whole.stations.iter().position(|at| *at == 0.5 * sigma);
        if let Some(k) = station {
            let off = node.position.distance(whole.rods[0].nodes[k].position);
            assert!(off <= bars[0] + bars[1], "{sigma}: {off:.1e}");
            compared += 1;
        }
    }
    assert!(compared > 4);
    // The half beyond it hangs from the clamp as a cantilever.
    let hanging = format!(
        "{}\nload.gravity = [0.0, 0.0, -2.0]",
        ROD.replace("length = 1.0", "length = 0.5")
    );
    let hanging = settle(&parse(&hanging), 1e-9);
    let tip = hanging.tips[0] + DVec3::new(0.45, 0.1, 0.2);
    let end = whole.rods[0].nodes.last().unwrap().position;
    assert!(end.distance(tip) <= bars[0] + 1e-9);
}

/// The force that a holder feels is minus the derivative of the energy by its way: of two grips that
/// pull a leaf with tissue across its veins.
#[test]
fn reactions_are_derivatives_of_the_energy() {
    let at = |way: f64| {
        let text = format!(
            r#"
            name = "across"
            leaf = {{ rods = 3, length = 1.0, fan = [0.0, 0.0, 0.0], joined = false, base = [[0.0, -0.2, 0.0], [0.0, 0.0, 0.0], [0.0, 0.2, 0.0]] }}
            stiffness = {{ torsion = 1.0, bending_2 = 1.0, bending_3 = 2.0, axial = 200.0, shear_2 = 80.0, shear_3 = 80.0 }}
            tissue = {{ along = 20.0, across = 40.0, normal = 30.0, fold = 0.5 }}
            [[grip]]
            vein = 1
            at = [0.25, 0.75]
            move = [0.0, -0.05, 0.02]
            [[grip]]
            vein = 3
            at = [0.25, 0.75]
            held = "clamped"
            move = [0.0, {way:?}, 0.02]
        "#
        );
        settle(&parse(&text), 1e-9)
    };
    let energy = |way: f64| at(way).energy.unwrap();
    let (way, h) = (0.05, 8e-3);
    let central = |h: f64| (energy(way + h) - energy(way - h)) / (2.0 * h);
    let slope = (4.0 * central(h) - central(2.0 * h)) / 3.0;
    let leaf = at(way);
    let [lower, upper] = [0, 1].map(|k| leaf.grip_reactions[k]);
    close("reaction", -upper.force.y, slope, 1e-5 * slope.abs());
    // What is pulled apart pulls back.
    assert!(
        upper.force.y < -0.1 && lower.force.y > 0.1,
        "{lower:?} {upper:?}"
    );
}

/// What happened on the way to the holders.
#[track_caller]
fn on_the_way(leaf: &Equilibrium) -> &[leafdyn::relax::Event] {
    match &leaf.path {
        Some(Path::Held { events }) => events,
        other => panic!("{other:?}"),
    }
}

/// A strut between a clamp and a pin that comes nearer turns aside at Euler's load, 20.1907 A/L^2: with
/// EA = 1000 after a fiftieth of its length. Pulled it is stable all the way.
#[test]
fn a_strut_turns_aside_on_the_way_of_its_pin() {
    let to = |x: f64| {
        let strut = format!("{ROD}\ntip = {{ held = \"pinned\", position = [{x:?}, 0.0, 0.0] }}");
        let strut = strut.replace("axial = 60.0", "axial = 1000.0");
        settle(&parse(&strut), 1e-6)
    };
    let pressed = to(0.9);
    let event = *only(on_the_way(&pressed));
    assert_eq!(event.stage, Stage::Moving);
    assert!(matches!(event.happening, StabilityLoss::Branched { .. }));
    close("part", event.part, 0.0202 / 0.1, 2.0 / 32.0);
    assert_eq!(on_the_way(&to(1.01)), []);
}

/// A taut rod whose middle is pulled aside by a third, with layers of a five-hundredth of its
/// length at its clamp: on grids that do not know of them its holders are moved anew.
#[test]
fn a_stitch_comes_to_rest() {
    for axial in [1e4, 1e5, 3e5, 1e6] {
        let stitch = parse(&format!(
            r#"
            name = "stitch"
            leaf = {{ rods = 1, length = 1.0, fan = [0.0] }}
            stiffness = {{ torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = {axial:?}, shear_2 = {axial:?}, shear_3 = {axial:?} }}
            tip = {{ held = "pinned", position = [1.0, 0.0, 0.0] }}
            grip = [{{ vein = 1, at = 0.5, move = [0.0, 0.0, 0.3] }}]"#
        ));
        let found = settle(&stitch, 1e-5);
        assert_eq!(on_the_way(&found), []);
        // Each half is stretched to sqrt(0.5^2 + 0.3^2), but for the layers at the clamp.
        let stretched = 0.34_f64.sqrt();
        let force = 2.0 * axial * (stretched / 0.5 - 1.0) * 0.3 / stretched;
        let felt = -only(&found.grip_reactions).force.z;
        close("force", felt / force, 1.0, 12.0 / axial.sqrt());
    }
}

/// The equilibrium to which holders bring a leaf does not depend on the tolerance.
#[test]
fn holders_bring_a_leaf_to_one_equilibrium_at_all_tolerances() {
    for seed in 1..=asked("HELD", 12) as u64 {
        let mut draw = random::Draw(seed);
        let held = ["pinned", "clamped"][usize::from(draw.chance(0.5))];
        let (x, yz) = (draw.uniform(0.4, 0.9), draw.list(2, -0.2, 0.2));
        let leaf = parse(&format!(
            r#"
            name = "held"
            leaf = {{ rods = 1, length = 1.0, fan = [{:?}] }}
            stiffness = {{ torsion = {:?}, bending_2 = {:?}, bending_3 = 1.0, axial = 1e4, shear_2 = 1e4, shear_3 = 1e4 }}
            load = {{ gravity = [0.0, {:?}, {:?}] }}
            tip = {{ held = {held:?}, position = [{x:?}, {:?}, {:?}] }}"#,
            draw.uniform(-0.5, 0.5),
            draw.log(0.1, 3.0),
            draw.log(0.1, 10.0),
            draw.uniform(-1.0, 1.0),
            draw.uniform(-3.0, 3.0),
            yz[0],
            yz[1],
        ));
        let energy = |tolerance| settle(&leaf, tolerance).energy.unwrap();
        let wanted = energy(1e-8);
        for tolerance in [1e-3, 1e-4, 1e-6] {
            close("energy", energy(tolerance) / wanted, 1.0, 0.01);
        }
    }
}
