//! Lenses: pairs of straight rods that leave the origin at -beta and +beta and
//! meet in a common tip, with and without load, coupling and midrib.

mod common;

use common::{
    TIGHT, close, critical, in_lab, scenario, set_stiffness, settle, settle_on, solve, tip,
    tip_angle, tip_is, tip_node,
};
use glam::DVec3;
use leafdyn::relax::{Equilibrium, Options, SemiImplicit, relax};
use leafdyn::scenario::Scenario;

/// Slope of the tip, force along e2 at the tip and moment at the clamp of the
/// second rod; of the first, the mirror image.
#[track_caller]
fn second_rod_is(what: &str, leaf: &Equilibrium, slope: f64, force: f64, moment: f64) {
    for (rod, sign) in [(1, 1.0), (0, -1.0)] {
        let (n, m) = (
            in_lab(&tip_node(leaf, rod)).0,
            in_lab(&leaf.shape.rods[rod].nodes[0]).1,
        );
        close(what, sign * tip_angle(leaf, rod, DVec3::Y), slope, TIGHT);
        close(what, sign * n.y, force, 1e-10);
        close(what, sign * m.z, moment, 1e-10);
        assert!(m.x.abs() + m.y.abs() < 1e-10, "{what}: {m}");
        assert!(
            in_lab(&tip_node(leaf, rod)).1.length() < 1e-10,
            "{what}: moment at the tip"
        );
    }
    assert_eq!(leaf.stable(), Some(true), "{what}");
}

/// Boundary-value problem and an independent quadrature.
#[test]
fn unloaded_lenses_follow_the_elastica() {
    for (name, x, slope, force, moment) in [
        (
            "classic/lens_30",
            0.9729912300336,
            -0.2589824010247,
            -1.5973116944519,
            -1.5541702703319,
        ),
        (
            "classic/lens_60",
            0.8966184928350,
            -0.5011600905202,
            -3.3497382489409,
            -3.0034372601570,
        ),
    ] {
        let leaf = solve(name, &[]);
        tip_is(name, &leaf, DVec3::new(x, 0.0, 0.0), 2e-13, TIGHT);
        second_rod_is(name, &leaf, slope, force, moment);
    }
}

/// Half of the tip force is each rod's.
#[test]
fn a_force_on_the_tip_closes_or_opens_the_lens() {
    for (force, x) in [(-2.0, 0.8908401673153), (10.0, 0.9174586260365)] {
        let what = format!("F = {force}");
        let leaf = solve(
            "classic/lens_60",
            &[format!("load.tip_force=[{force:?}, 0, 0]")],
        );
        tip_is(&what, &leaf, DVec3::new(x, 0.0, 0.0), 2e-13, TIGHT);
        for rod in [0, 1] {
            close(&what, in_lab(&tip_node(&leaf, rod)).0.x, force / 2.0, 1e-10);
        }
        assert_eq!(leaf.stable(), Some(true));
    }
}

/// Coupling k (r2 - r1) per unit length, collocation.
#[test]
fn coupling_draws_the_rods_together() {
    let leaf = solve("classic/lens_coupled", &[]);
    let what = "k = 10";
    tip_is(
        what,
        &leaf,
        DVec3::new(0.9061509842798, 0.0, 0.0),
        2e-13,
        TIGHT,
    );
    second_rod_is(
        what,
        &leaf,
        -0.4540275720102,
        -2.6055875304799,
        -3.2765365454579,
    );
}

/// EA, GA of the lens with a midrib; the length at which the midrib carries
/// nothing; that at which the flat shape loses its stability, and the thrust
/// in the midrib there. Collocation.
const MIDRIB: [(f64, f64, f64, f64, f64); 2] = [
    (2500.0, 1000.0, 0.897148164116, 0.93780575743, 16.9666896065),
    (1e5, 4e4, 0.896631799808, 0.92789056742, 17.5280528927),
];

fn with_midrib(axial: f64, shear: f64, length: f64) -> Scenario {
    let mut overrides = set_stiffness(axial, shear).to_vec();
    overrides.push(format!("leaf.length=[1.0, {length:?}, 1.0]"));
    scenario("classic/lens_midrib", &overrides)
}

#[test]
fn a_midrib_of_its_natural_length_carries_nothing() {
    for (axial, shear, natural, ..) in MIDRIB {
        let leaf = settle(&with_midrib(axial, shear, natural), TIGHT);
        tip_is(
            "natural",
            &leaf,
            DVec3::new(natural, 0.0, 0.0),
            1e-12,
            TIGHT,
        );
        // A length off by its last digit, 5e-13, is a thrust of EA times that.
        let thrust = in_lab(&tip_node(&leaf, 1)).0.x;
        close("thrust", thrust, 0.0, 1e-12 * axial + 1e-10);
        assert_eq!(leaf.stable(), Some(true));
    }
}

#[test]
fn a_longer_midrib_buckles_out_of_the_plane() {
    for (axial, shear, _, wanted, thrust) in MIDRIB {
        let found = critical(wanted - 0.01, wanted + 0.01, 8, |length, segments| {
            let leaf = settle_on(&with_midrib(axial, shear, length), segments, true);
            assert!(tip(&leaf).z.abs() < 1e-12, "it has left its plane");
            leaf.stability.negative_eigenvalues.unwrap() > 0
        });
        close("critical length", found, wanted, 1e-8);
        // The flat leaf of that length has that thrust in its midrib.
        let options = Options {
            method: SemiImplicit {
                keep_unstable: true,
                ..SemiImplicit::default()
            }
            .into(),
            tolerance: Some(TIGHT),
            ..Options::default()
        };
        let leaf = relax(&with_midrib(axial, shear, wanted), &options, &mut |_| {}).unwrap();
        let found = -in_lab(&tip_node(&leaf, 1)).0.x;
        // The length is known to 5e-12.
        close("thrust", found, thrust, 5e-12 * axial + 1e-9);
        // A little below, it rests flat.
        let leaf = settle(&with_midrib(axial, shear, wanted - 1e-3), 1e-8);
        assert_eq!(leaf.stability.negative_eigenvalues, Some(0));
        assert!(leaf.stability.saddle.is_none());
        assert!(tip(&leaf).z.abs() < 1e-8);
        // A little above, it does not.
        let leaf = settle(&with_midrib(axial, shear, wanted + 0.005), 1e-8);
        assert_eq!(leaf.stability.negative_eigenvalues, Some(0));
        assert!(
            leaf.stability
                .saddle
                .is_some_and(|saddle| saddle.negative_eigenvalues > 0)
        );
        assert!(tip(&leaf).z.abs() > 1e-3);
    }
}
