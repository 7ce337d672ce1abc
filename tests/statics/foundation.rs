//! Veins on a foundation: beams on elastic ground, and what springs along veins are the limit of.

use leafdyn_testing::*;

/// A beam along e1 on a foundation of this stiffness along e2 and e3.
fn beam(length: f64, [y, z]: [f64; 2], more: &str) -> String {
    format!(
        r#"
        name = "beam"
        leaf = {{ rods = 1, length = {length:?}, fan = [0.0] }}
        stiffness = {{ torsion = 1.0, bending_2 = 1.0, bending_3 = 3.0, axial = inf, shear_2 = inf, shear_3 = inf }}
        foundation = {{ stiffness = [0.0, {y:?}, {z:?}] }}
        {more}
        "#
    )
}

/// Under a point of a long beam with a small force P the ground yields by P b/(2 k), and at a free end by
/// 2 P b/k, with b = (k/(4 EI))^(1/4) (M. Hetenyi, Beams on elastic foundation).
#[test]
fn ground_yields_under_a_force() {
    let force = 1e-3;
    for (k, axis, bending) in [(4.0_f64, 2, 1.0), (0.7, 2, 1.0), (4.0, 1, 3.0)] {
        let b = (k / (4.0 * bending)).powf(0.25);
        let length = 30.0 / b;
        let mut forces = [0.0; 3];
        forces[axis] = force;
        let point = format!("load.point = [{{ vein = 1, at = 0.5, force = {forces:?} }}]");
        let tip = format!("load.tip_force = {forces:?}");
        let under = |more: &str, sigma: f64| {
            let leaf = settled_on_ground(&beam(length, [k; 2], more));
            let nodes = &leaf.shape.rods[0].nodes;
            let at = (sigma * (nodes.len() - 1) as f64).round() as usize;
            (
                nodes[at].position[axis],
                leaf.accuracy.error_estimate.unwrap(),
            )
        };
        for (more, sigma, exact) in [
            (&point, 0.5, force * b / (2.0 * k)),
            (&tip, 1.0, 2.0 * force * b / k),
        ] {
            let (found, bar) = under(more, sigma);
            let off = (found - exact).abs();
            // Squares of slopes, which the theory leaves out.
            let allowed = bar + exact * (2.0 * b * exact).powi(2);
            assert!(
                off <= allowed && allowed < 1e-5 * exact,
                "{k}, {sigma}: {found} for {exact}, bar {bar:.1e}"
            );
        }
    }
}

fn settled_on_ground(text: &str) -> Equilibrium {
    let scenario = parse(text);
    settled(&scenario, &to(1e-11))
}

/// As many springs as there are nodes of a fine division are a foundation, to second order in their
/// distance: here of a bent leaf that is far from its natural shape.
#[test]
fn many_grips_are_a_foundation() {
    let leaf = |more: &str| {
        format!(
            r#"
            name = "leaf"
            leaf = {{ rods = 1, length = 1.0, fan = [0.3] }}
            stiffness = {{ torsion = 0.8, bending_2 = 1.0, bending_3 = 1.5, axial = 50.0, shear_2 = 60.0, shear_3 = 40.0 }}
            rest = {{ bend_2 = 0.8, twist = 0.5, bend_3 = -0.4 }}
            load = {{ gravity = [0.5, 0.8, -3.0] }}
            {more}
            "#
        )
    };
    let ground = settle(
        &parse(&leaf("foundation = { stiffness = [3.0, 8.0, 5.0] }")),
        1e-10,
    );
    let on_grips = |count: usize| {
        let grip = |k: usize| {
            let weight = if k == count { 0.5 } else { 1.0 } / count as f64;
            let stiffness = [3.0, 8.0, 5.0].map(|k| weight * k);
            format!(
                "{{ vein = 1, at = {:?}, stiffness = {stiffness:?} }}",
                k as f64 / count as f64
            )
        };
        let grips: Vec<String> = (1..=count).map(grip).collect();
        let leaf = settle(
            &parse(&leaf(&format!("grip = [{}]", grips.join(", ")))),
            1e-10,
        );
        leaf.tips[0].distance(ground.tips[0])
    };
    let off = [8, 16, 32].map(on_grips);
    assert!(off[0] > 1e-5, "{off:?}");
    for pair in off.windows(2) {
        assert!((3.6..4.4).contains(&(pair[0] / pair[1])), "{off:?}");
    }
}

/// Relaxation and shooting are independent of each other: joined and free tips, a foundation that varies along
/// the veins and jumps.
#[test]
fn shooting_finds_the_same() {
    let ground = "{ at = [0.0, 0.4, 0.4, 1.0], value = [[1.0, 0.0, 9.0], [2.0, 5.0, 3.0], [0.0, 20.0, 8.0], [4.0, 1.0, 8.0]] }";
    for joined in ["false", "true"] {
        let text = format!(
            r#"
            name = "leaf"
            leaf = {{ rods = 3, length = [1.0, 0.9, 1.1], fan = [0.3, 0.0, -0.2], joined = {joined} }}
            stiffness = {{ torsion = 0.8, bending_2 = 1.0, bending_3 = 1.5, axial = 200.0, shear_2 = 100.0, shear_3 = 100.0 }}
            rest = {{ bend_2 = 0.5, twist = 0.3, bend_3 = -0.4, stretch = 1.05 }}
            coupling = {{ x = 1.0, y = 2.0, z = 1.5 }}
            load = {{ gravity = [0.3, 0.8, -2.2], tip_force = [0.1, -0.2, 0.1] }}
            foundation = {{ stiffness = {ground} }}
            "#
        );
        let scenario = parse(&text);
        let relaxed = settle(&scenario, 1e-10);
        let shot = found(&scenario, shoot_near(&scenario, &relaxed));
        for (a, b) in nodes(&relaxed.shape.rods).zip(nodes(&shot.rods)) {
            assert!(a.position.distance(b.position) < 2e-9);
            assert!(a.m.distance(b.m) < 1e-6);
            assert!(a.n.distance(b.n) < 1e-5, "{} {}", a.n, b.n);
        }
        close("energy", relaxed.energy.unwrap(), shot.energy, 1e-8);
    }
}

/// Each squared frequency of a straight beam is that without the ground, and k/rho.
#[test]
fn ground_raises_squared_frequencies() {
    let text = |k: f64| {
        let mut text = beam(
            1.0,
            [k; 2],
            "dynamics = { density = 2.0, rotary_inertia = 1e-9 }",
        );
        if k == 0.0 {
            text = text.replace("foundation", "# foundation");
        }
        text
    };
    let squares = |k: f64| {
        let leaf = settled(&parse(&text(k)), &with_modes(6, to(1e-8)));
        let modes = leaf.stability.modes.clone().unwrap();
        modes
            .iter()
            .map(|mode| (mode.eigenvalue, mode.error.unwrap()))
            .collect::<Vec<_>>()
    };
    for ((on_ground, bar), (alone, other)) in squares(500.0).into_iter().zip(squares(0.0)) {
        let off = (on_ground - alone - 250.0).abs();
        assert!(
            off <= bar + other + 1e-5 * on_ground && off < 1e-5 * on_ground,
            "{on_ground} {alone} {off:.1e}"
        );
    }
}

/// Half of a mirror-symmetric leaf on ground is the leaf.
#[test]
fn halves_are_whole_leaves() {
    for rods in [3, 4] {
        let mut leaf = fig04(rods);
        let whole = |leaf: &Scenario| settle(leaf, 1e-9);
        let ground = |y: f64| vec![[1.0, y, 4.0].map(Profile::Constant); rods];
        leaf.foundation = Some(ground(2.0));
        let half = whole(&leaf);
        // Hardly more on one side, the leaf is solved whole.
        if let Some(all) = &mut leaf.foundation {
            all[0][2] = Profile::Constant(4.0 + 1e-12);
        }
        let whole = whole(&leaf);
        assert!(half.tips[0].distance(whole.tips[0]) < 1e-9, "{rods}");
        close("energy", half.energy.unwrap(), whole.energy.unwrap(), 1e-9);
        let own = half
            .stability
            .modes
            .iter()
            .flatten()
            .map(|mode| mode.eigenvalue);
        let others = whole
            .stability
            .modes
            .iter()
            .flatten()
            .map(|mode| mode.eigenvalue);
        assert!(
            own.zip(others).all(|(a, b)| (a / b - 1.0).abs() < 1e-6),
            "{rods}"
        );
    }
}

#[test]
fn what_makes_no_sense_is_refused() {
    for (ground, why) in [
        (
            "foundation = { stiffness = [0.0, -1.0, 0.0] }",
            "must not be negative",
        ),
        (
            "foundation = { stiffness = [0.0, inf, 0.0] }",
            "must be a finite number",
        ),
        (
            "foundation = { stiffness = 2.0 }",
            "a list of three numbers",
        ),
        ("foundation = { stiffness = [1e20, 0.0, 0.0] }", "k L^4/A"),
        ("foundation = { depth = 1.0 }", "depth"),
    ] {
        let text = format!("{ROD}\n{ground}");
        let refused = Scenario::from_toml(&text).unwrap_err().to_string();
        assert!(refused.contains(why), "{ground}: {refused}");
    }
}
