//! The 45-degree bend of Bathe and Bolourchi (1979) in the variants of its
//! torsion and shear stiffness; by relaxation and by shooting.

mod common;

use common::*;

/// Positions are given to eight decimals; relative to the length: 8e-11.
const DIGITS: f64 = 6e-9;

/// Young's modulus; the section is 1 x 1 and Poisson's ratio zero, so that
/// G = E/2 and the shear stiffness is k G. Torsion is by the polar moment, or
/// by the torsion constant 0.140577.
const YOUNG: f64 = 1e7;

/// Torsion constant J, shear factor k (infinite: neither shear nor stretch), load
/// and tip. Collocation on the boundary-value problem; the first two by shooting too.
const TIPS: &str = "
    0.166666666666666667  0.833333333333333333  300  58.77889733  22.24467943  40.19239233
    0.166666666666666667  0.833333333333333333  600  47.15009624  15.68468948  53.47547800
    0.166666666666666667  1                     300  58.77912249  22.24478095  40.19189167
    0.166666666666666667  1                     600  47.15043857  15.68480053  53.47485879
    0.140577              0.833333333333333333  300  58.53570907  22.11251371  40.48075757
    0.140577              0.833333333333333333  450  51.96942440  18.36916294  48.70534908
    0.140577              0.833333333333333333  600  46.89158622  15.55767615  53.60798641
    0.166666666666666667  inf                   300  58.77968539  22.24503474  40.18828384
    0.166666666666666667  inf                   450  52.23929842  18.50846405  48.49798262
    0.166666666666666667  inf                   600  47.15129440  15.68507816  53.46859844
";

#[test]
fn every_variant_ends_where_the_boundary_value_problem_does() {
    for [torsion, shear, force, wanted @ ..] in table::<6>(TIPS) {
        let axial = if shear.is_infinite() { shear } else { YOUNG };
        let stiffness = set_stiffness(axial, shear * YOUNG / 2.0);
        let torsion = torsion * YOUNG / 2.0;
        let entries =
            format!("{stiffness}; stiffness.torsion={torsion:?}; load.tip_force=[0, 0, {force}]");
        let leaf = Both::solve("classic/bend45_300", &entries);
        let what = format!("torsion {torsion}, shear {shear}, load {force}");
        leaf.tip_is(&what, DVec3::from_array(wanted), DIGITS, DIGITS);
        assert_eq!(leaf.relaxed.stable(), Some(true), "{what}");
    }
}

/// The files themselves, at the tolerance they ask for.
#[test]
fn the_scenario_files_state_the_first_variant() {
    let names = ["classic/bend45_300", "classic/bend45_600"];
    for (name, [.., x, y, z]) in names.iter().zip(table::<6>(TIPS)) {
        let scenario = scenario(name, "");
        let leaf = settle(&scenario, scenario.tolerance);
        let error = (tip(&leaf) - DVec3::new(x, y, z)).length();
        assert!(error <= leaf.accuracy.error_estimate.unwrap() + DIGITS);
        assert!(error <= scenario.tolerance * scenario.rods[0].length);
    }
}
