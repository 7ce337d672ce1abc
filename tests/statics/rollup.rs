//! A straight rod rolled up by a dead moment on its tip; by relaxation and by
//! shooting.

use leafdyn_testing::*;

/// An arc of the angle M L/EI, with no force in it, whatever its stretch and
/// shear stiffness (closed form).
#[test]
fn every_station_lies_on_the_arc() {
    for moment in [0.5, 1.5, PI, -2.0, 2.0 * PI, 4.0 * PI, 7.0 * PI] {
        for (axial, shear) in [(1000.0, 400.0), (f64::INFINITY, f64::INFINITY), (2.0, 1.0)] {
            let stiffness = set_stiffness(axial, shear);
            let entries = format!("{stiffness}; load.tip_moment=[0, 0, {moment:?}]");
            let leaf = Both::solve("classic/rollup", &entries);
            let what = format!("M = {moment}, EA = {axial}");
            let estimate = leaf.relaxed.accuracy.error_estimate.unwrap();
            let relaxed = (estimate.min(1e-11), 1e-11);
            let shapes = leaf.shapes().into_iter().zip([relaxed, (TIGHT, TIGHT)]);
            for (rods, (within, turned)) in shapes {
                for (&sigma, node) in leaf.relaxed.shape.stations.iter().zip(&rods[0].nodes) {
                    let angle = moment * sigma;
                    let arc = DVec3::new(angle.sin(), 1.0 - angle.cos(), 0.0) / moment;
                    let error = (node.position - arc).length();
                    assert!(error <= within, "{what}: {error:.1e} at {sigma}");
                    // The angles are exact on any grid, full turns included; what is integrated
                    // between them is as good as the steps.
                    let tangent = node.rotation * DVec3::X;
                    let exact = DVec3::new(angle.cos(), angle.sin(), 0.0);
                    assert!((tangent - exact).length() < turned, "{what}");
                    // Turned by 2 pi, a quaternion has gone to the other sheet.
                    close(&what, node.rotation.w, (0.5 * angle).cos(), turned);
                    assert!(node.n.length() < 1e-11 * moment.abs(), "{what}: {}", node.n);
                    assert!((node.m - moment * DVec3::Z).length() < TIGHT, "{what}");
                    assert!((node.u - moment * DVec3::Z).length() < TIGHT, "{what}");
                }
            }
            // Strain energy M^2 L/(2 EI) less the work M theta of the dead moment
            // would be the potential; without one, the energy is that of strain.
            for energy in [leaf.relaxed.energy.unwrap(), leaf.shot.energy] {
                close(&what, energy, 0.5 * moment * moment, 1e-10);
            }
        }
    }
}

/// More turns than are applied by steps: from the shape of the moment alone.
#[test]
fn hundreds_of_turns_are_found() {
    for moment in [300.0_f64, 1500.0] {
        let leaf = settle(&rod(&format!("load.tip_moment=[0, 0, {moment:?}]")), 1e-6);
        let arc = DVec3::new(moment.sin(), 1.0 - moment.cos(), 0.0) / moment;
        let off = (tip(&leaf) - arc).length();
        assert!(off <= estimate(&leaf), "{moment}: {off:.1e}");
    }
}

/// A rod that is curled, or twisted, by thousands of radians at rest: an arc, or a straight line.
#[test]
fn thousands_of_radians_at_rest_are_resolved() {
    for curl in [900.0_f64, 9_000.0] {
        let leaf = settle(&rod(&format!("rest.bend_3={curl:?}")), 1e-6);
        let arc = DVec3::new(curl.sin(), 1.0 - curl.cos(), 0.0) / curl;
        let off = (tip(&leaf) - arc).length();
        assert!(off <= estimate(&leaf), "{curl}: {off:.1e}");
        let leaf = settle(&rod(&format!("rest.twist={curl:?}")), 1e-6);
        let off = (tip(&leaf) - DVec3::X).length();
        assert!(off <= estimate(&leaf), "{curl}: {off:.1e}");
    }
    // Under a load, too: the twist of a rod that bends alike to all sides leaves its centerline as it is.
    let load = "load.tip_force=[0, 0, -0.1]";
    let twisted = relaxed(&rod(&format!("rest.twist=9000.0; {load}")), &to(1e-6));
    assert!(twisted.outcome.is_at_rest(), "{:?}", twisted.remark);
    let off = tip(&twisted).distance(tip(&settle(&rod(load), 1e-9)));
    let bar = estimate(&twisted);
    assert!(off <= bar && bar < 1e-3, "{off:.1e} {bar:.1e}");
}

/// A section that is hardly stiff against twist, and no twist; more turns than any
/// grid resolves.
#[test]
fn no_twist_where_there_is_none_and_too_many_turns_are_refused() {
    let soft = rod("stiffness.torsion=1e-8; load.tip_moment=[0, 0, 1]");
    let leaf = settle(&soft, 1e-6);
    let arc = DVec3::new(1.0_f64.sin(), 1.0 - 1.0_f64.cos(), 0.0);
    assert!((tip(&leaf) - arc).length() <= estimate(&leaf));
    for moment in ["[0, 0, 1e5]", "[1e7, 0, 1e7]"] {
        let turned = rod(&format!("load.tip_moment={moment}"));
        let lost = relaxed(&turned, &Options::default());
        assert_eq!(lost.outcome, Outcome::NotAtRest);
        let remark = lost.remark.unwrap().to_string();
        assert!(remark.contains("lower load.tip_moment"), "{remark}");
    }
}
