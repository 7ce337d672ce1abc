//! Grips that slide and give: rollers against elasticas, springs against the theory of small deflections
//! and their limits, and forces as derivatives of the energy.

use leafdyn_testing::*;

/// A specimen on a hinge and a roller, loaded in its middle.
fn three_points(force: f64) -> String {
    format!(
        r#"
        name = "three points"
        leaf = {{ rods = 1, length = 1.0, fan = [0.0], base_held = "pinned" }}
        stiffness = {{ torsion = 1.0, bending_2 = 1.0, bending_3 = 2.0, axial = inf, shear_2 = inf, shear_3 = inf }}
        load.point = [{{ vein = 1, at = 0.5, force = [0.0, 0.0, {force:?}] }}]
        grip = [{{ vein = 1, at = 1.0, stiffness = [0.0, inf, inf] }}]
        "#
    )
}

/// Force, place of the roller, deflection of the middle, slope at the ends: those of a cantilever of half
/// the length under half of the force, by elliptic integrals.
const BENT: &str = "
     1  0.998961421581421  0.0207962546310185  0.0624107532659502
    10  0.918433841193597  0.180033348198666   0.555302593478788
    30  0.688029284080525  0.327990911907779   1.09209864648806
    60  0.510425751476893  0.388351000221533   1.35592659892333
";

#[test]
fn a_specimen_between_rollers_is_an_elastica() {
    for [force, roller, deflection, slope] in table(BENT) {
        let leaf = settle(&parse(&three_points(-force)), 1e-11);
        let what = format!("force {force}");
        let nodes = &leaf.shape.rods[0].nodes;
        close(&what, leaf.tips[0].x, roller, 1e-9);
        assert_eq!([leaf.tips[0].y, leaf.tips[0].z], [0.0; 2], "{what}");
        let middle = nodes[nodes.len() / 2].position;
        close(&what, middle.x, 0.5 * roller, 1e-9);
        close(&what, -middle.z, deflection, 1e-9);
        let tangent = nodes[0].rotation * DVec3::X;
        close(&what, (-tangent.z).atan2(tangent.x), slope, 1e-8);
        let on_roller = only(&leaf.grip_reactions);
        assert!(on_roller.force.distance(-0.5 * force * DVec3::Z) < 1e-8 * force);
        assert_eq!(on_roller.force.x, 0.0, "{what}");
        assert_eq!(leaf.stability.negative_eigenvalues, Some(0), "{what}");
    }
}

/// Held in place it would be far stiffer.
#[test]
fn a_specimen_that_is_held_at_both_ends_is_stiffer() {
    let rolls = settle(&parse(&three_points(-30.0)), 1e-8);
    let held = three_points(-30.0).replace("stiffness = [0.0, inf, inf]", "held = \"pinned\"");
    let held = settle(&parse(&held.replace("axial = inf", "axial = 1e4")), 1e-8);
    let middle = |leaf: &Equilibrium| {
        let nodes = &leaf.shape.rods[0].nodes;
        nodes[nodes.len() / 2].position.z
    };
    assert!(middle(&held) > 0.2 * middle(&rolls), "{}", middle(&held));
}

/// A cantilever with a grip at its tip.
fn cantilever(grip: &str, force: [f64; 3]) -> String {
    format!(
        r#"
        name = "cantilever"
        leaf = {{ rods = 1, length = 1.0, fan = [0.0] }}
        stiffness = {{ torsion = 0.7, bending_2 = 1.0, bending_3 = 2.0, axial = 60.0, shear_2 = inf, shear_3 = inf }}
        load = {{ tip_force = {force:?} }}
        grip = [{{ vein = 1, at = 1.0, {grip} }}]
        "#
    )
}

/// A spring holds along each axis alone: the tip moves by F/(3 EI/L^3 + k), or F/(EA/L + k).
#[test]
fn springs_share_a_small_force_with_the_rod() {
    let (force, springs) = (1e-6, [40.0, 5.0, 0.3]);
    let grip = format!("stiffness = {springs:?}");
    for (axis, own) in [60.0, 6.0, 3.0].into_iter().enumerate() {
        let mut forces = [0.0; 3];
        forces[axis] = force;
        let leaf = settle(&parse(&cantilever(&grip, forces)), 1e-12);
        let exact = force / (own + springs[axis]);
        close("tip", (leaf.tips[0] - DVec3::X)[axis], exact, 1e-5 * exact);
        let felt = only(&leaf.grip_reactions).force[axis];
        close("force", felt, springs[axis] * exact, 1e-5 * force);
        let placed = DVec3::from_array(forces).dot(DVec3::X);
        let energy = leaf.energy.unwrap() + placed;
        close(
            "energy",
            energy,
            -0.5 * force * exact,
            1e-5 * force * exact + 1e-18,
        );
    }
}

/// A spring holds the direction, and nothing the place: the slope of the tip is F L^2/2/(EI + c L).
#[test]
fn a_spring_holds_a_direction() {
    let force = 1e-6;
    for (spring, bending, axis) in [(0.2, 1.0, 2), (3.0, 1.0, 2), (3.0, 2.0, 1)] {
        let grip =
            format!("held = \"clamped\", stiffness = [0.0, 0.0, 0.0], turn_stiffness = {spring:?}");
        let mut forces = [0.0; 3];
        forces[axis] = force;
        let leaf = settle(&parse(&cantilever(&grip, forces)), 1e-12);
        let slope = 0.5 * force / (bending + spring);
        let exact = force / (3.0 * bending) - 0.5 * spring * slope / bending;
        close("tip", leaf.tips[0][axis], exact, 1e-5 * exact);
        let felt = only(&leaf.grip_reactions);
        assert_eq!(felt.force, DVec3::ZERO);
        let moment = felt.moment.unwrap().length();
        close("moment", moment, spring * slope, 1e-5 * spring * slope);
    }
}

/// The moment on a clamp is about the point that it holds, wherever that has gone: here that of its weak spring.
#[test]
fn a_moment_is_about_the_point_that_is_held() {
    let grip = "held = \"clamped\", stiffness = [0.0, 0.0, 5.0], turn_stiffness = 0.001";
    let text = cantilever(grip, [0.0, 0.0, -1.0]).replace("at = 1.0", "at = 0.5");
    let leaf = settle(&parse(&text), 1e-10);
    let nodes = &leaf.shape.rods[0].nodes;
    let held = &nodes[nodes.len() / 2];
    assert!(held.position.z < -0.02);
    let moment = only(&leaf.grip_reactions).moment.unwrap();
    let turn = held.rotation.to_scaled_axis();
    assert!(moment.distance(0.001 * turn) < 1e-9, "{moment} {turn}");
}

/// A leaf in space, some veins of which are held by this.
fn leaf(grips: &str) -> String {
    format!(
        r#"
        name = "leaf"
        leaf = {{ rods = 3, length = [1.0, 0.9, 1.1], fan = [0.3, 0.0, -0.2], joined = false, elevation = 0.2 }}
        stiffness = {{ torsion = 0.8, bending_2 = 1.0, bending_3 = 1.5, axial = 200.0, shear_2 = 100.0, shear_3 = 100.0 }}
        rest = {{ bend_2 = 0.5, twist = 0.3, bend_3 = -0.4 }}
        coupling = {{ x = 1.0, y = 2.0, z = 1.5 }}
        load = {{ gravity = [0.3, 0.2, -1.2], tip_force = [0.1, -0.2, 0.1] }}
        {grips}
        "#
    )
}

/// Stiff springs are rigid grips, and weak ones none, each to first order; a roller is the limit of
/// springs along its axis.
#[test]
fn rigid_and_free_are_limits() {
    let grips = |stiffness: [f64; 3], turn: f64| {
        let turn = match turn.is_finite() {
            true => format!("{turn:?}"),
            false => "inf".into(),
        };
        let [x, y, z] = stiffness.map(|k| match k.is_finite() {
            true => format!("{k:?}"),
            false => "inf".into(),
        });
        let made = leaf(&format!(
            "grip = [{{ vein = [1, 3], at = 0.5, held = \"clamped\", stiffness = [{x}, {y}, {z}], turn_stiffness = {turn}, move = [0.02, 0.05, 0.03] }}]"
        ));
        settle(&parse(&made), 1e-10).tips
    };
    let inf = f64::INFINITY;
    let near = |limit: &[DVec3], of: &dyn Fn(f64) -> Vec<DVec3>, springs: [f64; 2]| {
        let off = springs.map(|spring| {
            let tips = of(spring);
            largest(tips.iter().zip(limit).map(|(a, b)| a.distance(*b)))
        });
        let ratio = off[0] / off[1];
        assert!(
            (ratio / 10.0 - 1.0).abs() < 0.02 && off[1] < 1e-3,
            "{off:?}"
        );
    };
    let rigid = grips([inf; 3], inf);
    near(&rigid, &|k| grips([k; 3], k), [1e5, 1e6]);
    let free = settle(&parse(&leaf("")), 1e-10).tips;
    near(&free, &|k| grips([k; 3], k), [1e-4, 1e-5]);
    let rolls = grips([0.0, inf, inf], inf);
    near(&rolls, &|k| grips([k, inf, inf], inf), [1e-4, 1e-5]);
    near(&rolls, &|k| grips([0.0, k, inf], inf), [1e5, 1e6]);
}

/// A holder of every kind.
const ALL: &str = r#"
    [[grip]]
    vein = 1
    at = [0.5, 0.75]
    stiffness = [3.0, inf, 0.0]
    move = [0.0, 0.06, 0.0]
    [[grip]]
    vein = 3
    at = 0.625
    held = "clamped"
    stiffness = [0.0, 4.0, inf]
    turn_stiffness = 0.6
    move = [0.0, 0.0, 0.08]
    [[grip]]
    vein = 2
    at = 1.0
    held = "clamped"
    stiffness = [inf, 0.0, 0.0]
"#;

/// Errors go with the square of the length of segments.
#[test]
fn the_order_is_two() {
    let scenario = parse(&leaf(ALL));
    let tip = |segments: usize| settled(&scenario, &iterated(1e-12, segments)).tips[0];
    let [a, b, c, d] = [8, 16, 32, 64].map(tip);
    for ratio in [a.distance(b) / b.distance(c), b.distance(c) / c.distance(d)] {
        assert!((3.6..4.4).contains(&ratio), "{ratio}");
    }
}

/// The force on a grip is minus the derivative of the energy by its way; along an axis on which it slides
/// there is none.
#[test]
fn reactions_are_derivatives_of_the_energy() {
    let scenario = parse(&leaf(ALL));
    let leaf = settle(&scenario, 1e-11);
    for (number, grip) in scenario.grips.iter().enumerate() {
        for axis in 0..3 {
            let step = 1e-4;
            let energy = |by: f64| {
                let mut moved = scenario.clone();
                moved.grips[number].displacement[axis] += by;
                settle(&moved, 1e-11).energy.unwrap()
            };
            let [near, far] = [1.0, 2.0].map(|k| energy(-k * step) - energy(k * step));
            let force = (8.0 * near - far) / (12.0 * step);
            let told = leaf.grip_reactions[number].force[axis];
            let what = format!("grip {number}, axis {axis}: {told}, {force}");
            assert!((told - force).abs() < 2e-7, "{what}");
            if grip.stiffness[axis] == 0.0 {
                assert_eq!(told, 0.0, "{what}");
            }
        }
    }
}

#[test]
fn what_makes_no_sense_is_refused() {
    for (grip, why) in [
        (
            "vein = 1, at = 0.5, stiffness = [0.0, 0.0, 0.0]",
            "holds nothing",
        ),
        (
            "vein = 1, at = 0.5, stiffness = [0.0, -1.0, 0.0]",
            "must not be negative",
        ),
        (
            "vein = 1, at = 0.5, stiffness = [0.0, nan, 0.0]",
            "must be a finite number",
        ),
        (
            "vein = 1, at = 0.5, stiffness = [1e20, 0.0, 0.0]",
            "k L^3/A",
        ),
        (
            "vein = 1, at = 0.5, stiffness = 3.0",
            "a list of three numbers",
        ),
        (
            "vein = 1, at = 0.5, turn_stiffness = 3.0",
            "add held = \"clamped\"",
        ),
        (
            "vein = 1, at = 0.5, held = \"clamped\", turn_stiffness = 0.0",
            "must be greater than 0",
        ),
        ("vein = [1, 1], at = 0.5", "stands in the list twice"),
        ("vein = [], at = 0.5", "has no entries"),
        ("vein = [1, 4], at = 0.5", "from 1 to 3"),
        (
            "vein = [1, 2], at = 0.5 }, { vein = 2, at = [0.4, 0.6]",
            "is held by grip[1], too",
        ),
    ] {
        let refused = Scenario::from_toml(&leaf(&format!("grip = [{{ {grip} }}]")));
        let refused = refused.unwrap_err().to_string();
        assert!(refused.contains(why), "{grip}: {refused}");
    }
}
