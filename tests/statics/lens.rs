//! Lenses: pairs of straight rods that leave the origin at -beta and +beta and
//! meet in a common tip, with and without load, coupling and midrib; by
//! relaxation and by shooting.

use leafdyn_testing::*;

/// Force along e1 at the tip of a rod.
fn thrust(rods: &[RodShape], rod: usize) -> f64 {
    in_lab(&tip_node(rods, rod)).0.x
}

/// Boundary-value problem and an independent quadrature; the coupling is
/// k (r2 - r1) per unit length, k = 10, by collocation. Tip; slope there, force along
/// e2 at the tip and moment at the clamp of the second rod.
#[test]
fn unloaded_lenses_follow_the_elastica_and_coupling_draws_rods_together() {
    let rows = "
        0.9729912300336  -0.2589824010247  -1.5973116944519  -1.5541702703319
        0.8966184928350  -0.5011600905202  -3.3497382489409  -3.0034372601570
        0.9061509842798  -0.4540275720102  -2.6055875304799  -3.2765365454579
    ";
    let names = ["lens_30", "lens_60", "lens_coupled"];
    for (name, [x, slope, force, moment]) in names.iter().zip(table(rows)) {
        let leaf = Both::solve(&format!("classic/{name}"), "");
        leaf.tip_is(name, DVec3::new(x, 0.0, 0.0), 2e-13, TIGHT);
        for rods in leaf.shapes() {
            // Of the first, the mirror image.
            for (rod, sign) in [(1, 1.0), (0, -1.0)] {
                let (n, at_tip) = in_lab(&tip_node(rods, rod));
                let m = in_lab(&rods[rod].nodes[0]).1;
                close(name, sign * tip_angle(rods, rod, DVec3::Y), slope, TIGHT);
                close(name, sign * n.y, force, 1e-10);
                close(name, sign * m.z, moment, 1e-10);
                assert!(m.x.abs() + m.y.abs() < 1e-10, "{name}: {m}");
                assert!(at_tip.length() < 1e-10, "{name}: {at_tip}");
            }
        }
        assert_eq!(leaf.relaxed.stable(), Some(true), "{name}");
    }
}

/// Half of the tip force is each rod's.
#[test]
fn a_force_on_the_tip_closes_or_opens_the_lens() {
    for (force, x) in [(-2.0, 0.8908401673153), (10.0, 0.9174586260365)] {
        let what = format!("F = {force}");
        let pulled = format!("load.tip_force=[{force:?}, 0, 0]");
        let leaf = Both::solve("classic/lens_60", &pulled);
        leaf.tip_is(&what, DVec3::new(x, 0.0, 0.0), 2e-13, TIGHT);
        for rods in leaf.shapes() {
            for rod in [0, 1] {
                close(&what, thrust(rods, rod), force / 2.0, 1e-10);
            }
        }
        assert_eq!(leaf.relaxed.stable(), Some(true));
    }
}

/// EA, GA of the lens with a midrib; the length at which the midrib carries
/// nothing; that at which the flat shape loses its stability (`tests/stability/bifurcations.rs`), and the
/// thrust in the midrib there. Collocation.
const MIDRIB: &str = "
    2500  1000  0.897148164116  0.93780575743  16.9666896065
    1e5   4e4   0.896631799808  0.92789056742  17.5280528927
";

fn with_midrib(axial: f64, shear: f64, length: f64) -> Scenario {
    let stiffness = set_stiffness(axial, shear);
    let entries = format!("{stiffness}; leaf.length=[1.0, {length:?}, 1.0]");
    scenario("classic/lens_midrib", &entries)
}

#[test]
fn a_midrib_of_its_natural_length_carries_nothing() {
    for [axial, shear, natural, ..] in table::<5>(MIDRIB) {
        let leaf = Both::of(&with_midrib(axial, shear, natural));
        leaf.tip_is("natural", DVec3::new(natural, 0.0, 0.0), 1e-12, TIGHT);
        for rods in leaf.shapes() {
            // A length off by its last digit, 5e-13, is a thrust of EA times that.
            close("thrust", thrust(rods, 1), 0.0, 1e-12 * axial + 1e-10);
        }
        assert_eq!(leaf.relaxed.stable(), Some(true));
    }
}

/// Of the length at which the flat shape loses its stability.
#[test]
fn a_longer_midrib_bears_the_thrust() {
    for [axial, shear, _, critical, there] in table(MIDRIB) {
        let leaf = kept(&with_midrib(axial, shear, critical), TIGHT);
        // The length is known to 5e-12.
        let within = 5e-12 * axial + 1e-9;
        close("thrust", -thrust(&leaf.shape.rods, 1), there, within);
    }
}
