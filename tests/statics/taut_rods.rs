//! Rods that holders, or other rods, stretch carry their stiffness times their strain, however
//! slender and stiff they are, and the bar of the reaction holds.

use leafdyn_testing::*;

/// A straight rod whose tip is held, along x.
fn taut(axial: f64, strain: f64, how: &str) -> Scenario {
    parse(&format!(
        r#"
        leaf = {{ rods = 1, length = 1.0, fan = [0.0] }}
        stiffness = {{ torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = {axial:e}, shear_2 = inf, shear_3 = inf }}
        tip = {{ held = "{how}", position = [{:?}, 0.0, 0.0] }}
        "#,
        1.0 + strain
    ))
}

/// What the holder feels along x, with the bar.
fn felt(leaf: &Equilibrium) -> (f64, f64) {
    let reaction = leaf.reaction.as_ref().expect("the tip is held");
    (reaction.force.x, reaction.error.expect("several grids"))
}

#[test]
fn any_stiffness_carries_its_strain() {
    for axial in [1e3, 1e5, 1e7, 1.1e7, 2.2e7, 1e9, 1e12] {
        for strain in [2e-2, 1e-4, 1e-6] {
            for (how, tolerance) in [("pinned", 1e-4), ("clamped", 1e-8)] {
                let leaf = settle(&taut(axial, strain, how), tolerance);
                let (found, bar) = felt(&leaf);
                let right = -axial * ((1.0 + strain) - 1.0);
                let off = (found - right).abs();
                let what =
                    format!("{axial:e}, {strain:e}, {how}: {found} for {right}, bar {bar:e}");
                assert!(off <= bar + 1e-15 * right.abs(), "{what}");
                let rounded = 1e-14 * axial;
                assert!(bar <= 1e-6 * right.abs() + rounded * 10.0, "{what}");
            }
        }
    }
}

/// Wires of any slenderness and material, in any units and direction: as many as `LEAFDYN_TAUT` says.
#[test]
fn wires_of_any_slenderness() {
    let golden = |k: usize| (k as f64 * 0.618_033_988_749_895).fract();
    for seed in 0..asked("LEAFDYN_TAUT", 40) {
        let number = |k: usize| golden(7 * seed + k + 1);
        let between = |k: usize, low: f64, high: f64| low * (high / low).powf(number(k));
        let (length, young) = (between(1, 1e-2, 1e3), between(2, 1e3, 1e12));
        let diameter = length / between(3, 10.0, 1e5);
        let strain = between(4, 1e-7, 5e-2);
        let angle = 6.0 * (number(5) - 0.5);
        let how = if number(6) < 0.5 { "pinned" } else { "clamped" };
        let angles = if number(6) < 0.5 {
            String::new()
        } else {
            format!("angles = {angle:?}")
        };
        let (sin, cos) = angle.sin_cos();
        let [x, y] = [cos, sin].map(|part| length * (1.0 + strain) * part);
        let wire = parse(&format!(
            r#"
            leaf = {{ rods = 1, length = {length:e}, fan = [{angle:?}] }}
            section = {{ shape = "circle", diameter = {diameter:e}, young = {young:e} }}
            [tip]
            held = "{how}"
            position = [{x:e}, {y:e}, 0.0]
            {angles}
            "#
        ));
        let leaf = settle(&wire, 1e-6);
        assert!(leaf.outcome.is_success(), "{seed}: {:?}", leaf.outcome);
        let stiffness = young * 0.25 * PI * diameter * diameter;
        let reaction = leaf.reaction.as_ref().unwrap();
        let right = -stiffness * strain * DVec3::new(cos, sin, 0.0);
        let off = reaction.force.distance(right);
        let bar = reaction.error.expect("several grids");
        // The place of the tip is rounded.
        let rounded = 4.0 * f64::EPSILON * stiffness;
        let what = format!(
            "{seed}: {:?} for {right:?}, off {off:e}, bar {bar:e}",
            reaction.force
        );
        assert!(off <= bar + rounded, "{what}");
        assert!(bar <= 1e-6 * right.length() + 100.0 * rounded, "{what}");
    }
}

/// A grip stretches the part of a rod before it, and not the part beyond.
#[test]
fn a_grip_stretches_what_is_before_it() {
    for diameter in [1e-2, 1e-3, 1e-4] {
        let rod = parse(&format!(
            r#"
            leaf = {{ rods = 1, length = 1.0, fan = [0.0] }}
            section = {{ shape = "circle", diameter = {diameter:?}, young = 1e9 }}
            grip = [{{ vein = 1, at = 0.5, move = [0.001, 0.0, 0.0] }}]
            "#
        ));
        let leaf = settle(&rod, 1e-6);
        let grip = only(&leaf.grip_reactions);
        let right = -1e9 * 0.25 * PI * diameter * diameter * 0.002;
        let off = grip.force.distance(right * DVec3::X);
        let bar = grip.error.expect("several grids");
        assert!(
            off <= bar + 1e-12 * right.abs(),
            "{diameter}: {off:e}, bar {bar:e}"
        );
        assert!(bar <= 1e-6 * right.abs(), "{diameter}: {bar:e}");
    }
}

/// Three stiff rods on hinges that meet in a joint share a force along the middle one as a truss
/// does: it bears P/(1 + 2 cos^3 phi) (C. L. M. H. Navier's truss).
#[test]
fn a_truss_shares_its_load_by_stiffness() {
    let phi = 0.6_f64;
    let (sin, cos) = phi.sin_cos();
    let side = sin / cos;
    for axial in [1e6, 1e8, 1e10] {
        let truss = parse(&format!(
            r#"
            [leaf]
            rods = 3
            length = [{0:?}, 1.0, {0:?}]
            fan = [{phi:?}, 0.0, -{phi:?}]
            base = [[0.0, -{side:?}, 0.0], [0.0, 0.0, 0.0], [0.0, {side:?}, 0.0]]
            base_held = "pinned"
            [stiffness]
            torsion = 1.0
            bending_2 = 1.0
            bending_3 = 1.0
            axial = {axial:e}
            shear_2 = inf
            shear_3 = inf
            [load]
            tip_force = [10.0, 0.0, 0.0]
            "#,
            1.0 / cos
        ));
        let leaf = settle(&truss, 1e-8);
        assert!(leaf.outcome.is_success(), "{axial:e}: {:?}", leaf.outcome);
        let tip = tip_node(&leaf.shape.rods, 1);
        let right = 10.0 / (1.0 + 2.0 * cos.powi(3));
        close("the middle rod", tip.n.x, right, 1e-5 * right);
    }
}
