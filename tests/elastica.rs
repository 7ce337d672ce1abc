//! A cantilever under a dead transverse tip load, and a column beyond its
//! buckling load, follow the elastica; by relaxation and by shooting.

mod common;

use common::branch::follow;
use common::*;
use leafdyn::study::PointKind;

fn load(alpha: f64) -> String {
    format!("load.tip_force=[0, 0, {:?}]", -alpha)
}

/// Bisshopp and Drucker 1945, Mattiasson 1981: alpha = P L^2/EI, slope, x and
/// y of the tip. Closed form, elliptic integrals.
const INEXTENSIBLE: &str = "
     1  0.46135194971188  0.94356676371662  0.30172077379981
     2  0.78174983155654  0.83935827917483  0.49345748039671
     5  1.2153681176117   0.61237163927557  0.71379152361191
    10  1.4302855388039   0.44500440224625  0.81060902488030
    50  1.5679819015714   0.19999960395040  0.91715544730359
";

#[test]
fn an_inextensible_cantilever_follows_the_closed_form() {
    for [alpha, slope, x, y] in table(INEXTENSIBLE) {
        let what = format!("alpha = {alpha}");
        let leaf = Both::solve("classic/cantilever_tip", &load(alpha));
        leaf.tip_is(&what, DVec3::new(x, 0.0, -y), 2e-14, TIGHT);
        for rods in leaf.shapes() {
            close(&what, tip_angle(rods, 0, DVec3::NEG_Z), slope, TIGHT);
            // The clamp's moment is P x; it acts about -e2 on the part before it.
            let moment = rods[0].nodes[0].m.length();
            close(&what, moment, alpha * x, alpha * TIGHT);
        }
        assert_eq!(leaf.relaxed.stable(), Some(true));
    }
}

/// alpha, EA, GA; x, y and slope of the tip. Collocation on the
/// boundary-value problem, two meshes.
const COSSERAT: &str = "
     4   100   40  0.6585159805983  0.7307575514909  1.0997828540301
    10   100   40  0.4270824760091  0.9424536888340  1.3957770840497
    10  1000  400  0.4432531320994  0.8236366963903  1.4272379906638
";

#[test]
fn a_cantilever_that_stretches_and_shears_follows_reissner() {
    for [alpha, axial, shear, x, y, slope] in table(COSSERAT) {
        let what = format!("alpha = {alpha}, EA = {axial}");
        let entries = format!("{}; {}", load(alpha), set_stiffness(axial, shear));
        let leaf = Both::solve("classic/cantilever_tip_cosserat", &entries);
        leaf.tip_is(&what, DVec3::new(x, 0.0, -y), 2e-13, TIGHT);
        for rods in leaf.shapes() {
            close(&what, tip_angle(rods, 0, DVec3::NEG_Z), slope, TIGHT);
        }
        assert_eq!(leaf.relaxed.stable(), Some(true));
    }
}

/// End slope in degrees, P/P_cr, x and y of the tip. Closed form, elliptic
/// integrals.
const BUCKLED: &str = "
     20  1.0153968655397   0.96973090736352  0.2194130423956
     60  1.1517196204691   0.74101960607633  0.59320764616489
    120  1.8848008689781   0.12315997240512  0.80317099000746
    160  4.0300859660499  -0.34031885569115  0.62460351295334
";

fn pushed(ratio: f64) -> String {
    format!("load.tip_force=[{:?}, 0, 0]", -ratio * PI * PI / 4.0)
}

#[test]
fn a_column_beyond_its_buckling_load_follows_the_closed_form() {
    for [slope, ratio, x, y] in table(BUCKLED) {
        let what = format!("end slope {slope} degrees");
        let leaf = solve("classic/elastica_buckled", &pushed(ratio));
        // It may go to either side.
        let side = tip(&leaf).y.signum();
        // Close to the buckling load the slope is as uncertain as the load's
        // last digit, 5e-14, times d(slope)/d(load): 12 at 20 degrees.
        let digits = 1e-12;
        tip_is(&what, &leaf, DVec3::new(x, side * y, 0.0), digits, TIGHT);
        let angle = tip_angle(&leaf.shape.rods, 0, DVec3::Y) * side;
        close(&what, angle, slope.to_radians(), TIGHT);
        assert_eq!(leaf.stability.negative_eigenvalues, Some(0), "{what}");
    }
}

/// From arcs shooting stays straight: so from the relaxed leaf.
#[test]
fn so_it_does_by_shooting_from_the_relaxed_leaf() {
    for [_, ratio, x, y] in table(BUCKLED) {
        let column = scenario("classic/elastica_buckled", &pushed(ratio));
        let shot = shot_near(&column, &settle(&column, 1e-4));
        let found = tip_node(&shot.rods, 0).position;
        // Close to the buckling load the errors of the integration are large too.
        let tolerance = TIGHT + 5.0 * shot.error.position;
        assert!(tolerance < 3e-10, "{tolerance:.1e}");
        let off = found - DVec3::new(x, found.y.signum() * y, 0.0);
        assert!(off.abs().max_element() <= tolerance, "{ratio}: {off}");
    }
}

/// Along the two branches that leave the straight column, at the loads of three of
/// these slopes.
#[test]
fn so_it_does_along_the_branches_that_leave_the_straight_one() {
    for [_, ratio, x, y] in &table(BUCKLED)[..3] {
        let load = -ratio * PI * PI / 4.0;
        let vary = format!("load.tip_force[0]=-2.2..{load:?}:30");
        let strip = format!("{RIGID}; stiffness.bending_2=1000.0");
        let found = follow(ROD, &strip, &vary, true);
        assert_eq!(found.branches.len(), 3, "{ratio}: {:?}", found.remark);
        let ends = [1, 2].map(|b| found.branches[b].points.last().unwrap());
        for end in ends {
            assert_eq!(end.index, 0);
            assert!((end.value - load).abs() < 1e-12);
            close("x", end.tips[0].x, *x, 1e-8);
            close("y", end.tips[0].y.abs(), *y, 1e-8);
        }
        let sum = ends[0].tips[0].y + ends[1].tips[0].y;
        assert!(sum.abs() < 1e-8, "mirror images");
        let kinds: Vec<PointKind> = found.branches[0].critical().map(|(_, p)| p.kind).collect();
        assert_eq!(kinds, [PointKind::Branching(1)]);
    }
}
