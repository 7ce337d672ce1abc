//! A cantilever under a dead transverse tip load, and a column beyond its
//! buckling load, follow the elastica.

mod common;

use std::f64::consts::PI;

use common::{TIGHT, close, set_stiffness, set_vector, solve, tip, tip_angle, tip_is};
use glam::DVec3;

fn load(alpha: f64) -> String {
    set_vector("load.tip_force", DVec3::new(0.0, 0.0, -alpha))
}

/// Bisshopp and Drucker 1945, Mattiasson 1981: alpha = P L^2/EI, slope, x and
/// y of the tip. Closed form, elliptic integrals.
const INEXTENSIBLE: [[f64; 4]; 5] = [
    [1.0, 0.46135194971188, 0.94356676371662, 0.30172077379981],
    [2.0, 0.78174983155654, 0.83935827917483, 0.49345748039671],
    [5.0, 1.2153681176117, 0.61237163927557, 0.71379152361191],
    [10.0, 1.4302855388039, 0.44500440224625, 0.81060902488030],
    [50.0, 1.5679819015714, 0.19999960395040, 0.91715544730359],
];

#[test]
fn an_inextensible_cantilever_follows_the_closed_form() {
    for [alpha, slope, x, y] in INEXTENSIBLE {
        let what = format!("alpha = {alpha}");
        let leaf = solve("classic/cantilever_tip", &[load(alpha)]);
        tip_is(&what, &leaf, DVec3::new(x, 0.0, -y), 2e-14, TIGHT);
        close(&what, tip_angle(&leaf, 0, DVec3::NEG_Z), slope, TIGHT);
        // The clamp's moment is P x; it acts about -e2 on the part before it.
        let base = leaf.shape.rods[0].nodes[0];
        close(&what, base.m.length(), alpha * x, alpha * TIGHT);
        assert_eq!(leaf.stable(), Some(true));
    }
}

/// alpha, EA, GA; x, y and slope of the tip. Collocation on the
/// boundary-value problem, two meshes.
const COSSERAT: [[f64; 6]; 3] = [
    [
        4.0,
        100.0,
        40.0,
        0.6585159805983,
        0.7307575514909,
        1.0997828540301,
    ],
    [
        10.0,
        100.0,
        40.0,
        0.4270824760091,
        0.9424536888340,
        1.3957770840497,
    ],
    [
        10.0,
        1000.0,
        400.0,
        0.4432531320994,
        0.8236366963903,
        1.4272379906638,
    ],
];

#[test]
fn a_cantilever_that_stretches_and_shears_follows_reissner() {
    for [alpha, axial, shear, x, y, slope] in COSSERAT {
        let what = format!("alpha = {alpha}, EA = {axial}");
        let mut overrides = set_stiffness(axial, shear).to_vec();
        overrides.push(load(alpha));
        let leaf = solve("classic/cantilever_tip_cosserat", &overrides);
        tip_is(&what, &leaf, DVec3::new(x, 0.0, -y), 2e-13, TIGHT);
        close(&what, tip_angle(&leaf, 0, DVec3::NEG_Z), slope, TIGHT);
        assert_eq!(leaf.stable(), Some(true));
    }
}

/// End slope in degrees, P/P_cr, x and y of the tip. Closed form, elliptic
/// integrals.
const BUCKLED: [[f64; 4]; 4] = [
    [20.0, 1.0153968655397, 0.96973090736352, 0.2194130423956],
    [60.0, 1.1517196204691, 0.74101960607633, 0.59320764616489],
    [120.0, 1.8848008689781, 0.12315997240512, 0.80317099000746],
    [160.0, 4.0300859660499, -0.34031885569115, 0.62460351295334],
];

#[test]
fn a_column_beyond_its_buckling_load_follows_the_closed_form() {
    let critical = PI * PI / 4.0;
    for [slope, ratio, x, y] in BUCKLED {
        let what = format!("end slope {slope} degrees");
        let force = DVec3::new(-ratio * critical, 0.0, 0.0);
        let leaf = solve(
            "classic/elastica_buckled",
            &[set_vector("load.tip_force", force)],
        );
        // It may go to either side.
        let side = tip(&leaf).y.signum();
        // Close to the buckling load the slope is as uncertain as the load's
        // last digit, 5e-14, times d(slope)/d(load): 12 at 20 degrees.
        let digits = 1e-12;
        tip_is(&what, &leaf, DVec3::new(x, side * y, 0.0), digits, TIGHT);
        let angle = tip_angle(&leaf, 0, DVec3::Y) * side;
        close(&what, angle, slope.to_radians(), TIGHT);
        assert_eq!(leaf.stability.negative_eigenvalues, Some(0), "{what}");
    }
}
