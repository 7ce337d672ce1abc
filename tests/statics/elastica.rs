//! A column beyond its buckling load follows the elastica; by relaxation, by shooting and along
//! branches.

use leafdyn::study::PointKind;
use leafdyn_testing::branch::follow;
use leafdyn_testing::*;

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
        let kinds: Vec<PointKind> = found.branches[0]
            .critical_points()
            .map(|(_, p)| p.kind)
            .collect();
        assert_eq!(kinds, [PointKind::Branching(1)]);
    }
}
