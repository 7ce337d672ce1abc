//! The 45-degree bend of Bathe and Bolourchi (1979) in the variants of its
//! torsion and shear stiffness.

mod common;

use common::{set_stiffness, set_vector, settle, solve, tip, tip_is};
use glam::DVec3;

/// Positions are given to eight decimals.
const DIGITS: f64 = 6e-9;
/// Relative to the length 78.5: 1.3e-10.
const TOLERANCE: f64 = 1e-8;

/// Young's modulus; the section is 1 x 1 and Poisson's ratio zero, so that
/// G = E/2 and the shear stiffness is k G.
const YOUNG: f64 = 1e7;

struct Row {
    name: &'static str,
    torsion: f64,
    /// Shear factor k; infinite: neither shear nor stretch.
    shear: f64,
    /// Load and tip.
    tips: &'static [(f64, [f64; 3])],
}

/// Collocation on the boundary-value problem; the first row by shooting too.
const ROWS: [Row; 4] = [
    Row {
        name: "polar moment, shear factor 5/6",
        torsion: YOUNG / 12.0,
        shear: 5.0 / 6.0,
        tips: &[
            (300.0, [58.77889733, 22.24467943, 40.19239233]),
            (600.0, [47.15009624, 15.68468948, 53.47547800]),
        ],
    },
    Row {
        name: "polar moment, shear factor 1",
        torsion: YOUNG / 12.0,
        shear: 1.0,
        tips: &[
            (300.0, [58.77912249, 22.24478095, 40.19189167]),
            (600.0, [47.15043857, 15.68480053, 53.47485879]),
        ],
    },
    Row {
        name: "torsion constant 0.140577, shear factor 5/6",
        torsion: 0.140577 * YOUNG / 2.0,
        shear: 5.0 / 6.0,
        tips: &[
            (300.0, [58.53570907, 22.11251371, 40.48075757]),
            (450.0, [51.96942440, 18.36916294, 48.70534908]),
            (600.0, [46.89158622, 15.55767615, 53.60798641]),
        ],
    },
    Row {
        name: "polar moment, neither shear nor stretch",
        torsion: YOUNG / 12.0,
        shear: f64::INFINITY,
        tips: &[
            (300.0, [58.77968539, 22.24503474, 40.18828384]),
            (450.0, [52.23929842, 18.50846405, 48.49798262]),
            (600.0, [47.15129440, 15.68507816, 53.46859844]),
        ],
    },
];

#[test]
fn every_variant_ends_where_the_boundary_value_problem_does() {
    for row in &ROWS {
        let axial = if row.shear.is_infinite() {
            row.shear
        } else {
            YOUNG
        };
        for &(force, wanted) in row.tips {
            let mut overrides = set_stiffness(axial, row.shear * YOUNG / 2.0).to_vec();
            overrides.push(format!("stiffness.torsion={:?}", row.torsion));
            overrides.push(set_vector("load.tip_force", DVec3::new(0.0, 0.0, force)));
            let leaf = solve("classic/bend45_300", &overrides);
            let what = format!("{}, load {force}", row.name);
            tip_is(&what, &leaf, DVec3::from_array(wanted), DIGITS, TOLERANCE);
            assert_eq!(leaf.stable(), Some(true), "{what}");
        }
    }
}

/// The files themselves, at the tolerance they ask for.
#[test]
fn the_scenario_files_state_the_first_variant() {
    for (name, &(_, wanted)) in ["classic/bend45_300", "classic/bend45_600"]
        .iter()
        .zip(ROWS[0].tips)
    {
        let scenario = common::scenario(name, &[]);
        let leaf = settle(&scenario, scenario.tolerance);
        let error = (tip(&leaf) - DVec3::from_array(wanted)).length();
        assert!(error <= leaf.accuracy.error_estimate.unwrap() + DIGITS);
        assert!(error <= scenario.tolerance * scenario.rods[0].length);
    }
}
