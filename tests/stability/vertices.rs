//! The vertices of pitchforks, met along the branch that turns back.

use leafdyn::study::trace;
use leafdyn_testing::*;

/// An inextensible strip on edge that twisted out of its plane is unloaded: it comes back into the plane
/// at the load at which it would leave it, which is where the plane one, followed by itself, crosses.
/// The stiffer the strip is on edge, the less does that load change along the branch: its points are
/// beside a singular one farther from the vertex.
#[test]
fn a_strip_out_of_its_plane_reports_the_plane_one_that_crosses_it() {
    let rigid = "stiffness.axial=inf; stiffness.shear_2=inf; stiffness.shear_3=inf; \
        stiffness.torsion=1; load.gravity=[0, 0, 0]";
    let critical = |stiffness: f64, keep: bool, vary: &str| {
        let strip = base(ROD, &format!("{rigid}; stiffness.bending_2={stiffness:?}"));
        let mut request = branch::request(strip, vary, 1e-7, 2000);
        request.keep_unstable = keep;
        let trace = trace(&request, &mut |_, _, _| {}).unwrap();
        assert!(
            trace.complete,
            "{stiffness}: {:?}",
            trace.branches[0].remarks
        );
        let critical: Vec<_> = trace.branches[0].critical_points().collect();
        let [(_, point)] = critical[..] else {
            panic!("{stiffness}: {} critical points", critical.len())
        };
        (point.value, point.value_error.unwrap())
    };
    for stiffness in [5.0, 20.0, 1e3, 1e4] {
        let (plane, known) = critical(stiffness, true, "load.tip_force[2]=0..-6");
        let (vertex, told) = critical(stiffness, false, "load.tip_force[2]=-6..0");
        let off = (vertex - plane).abs();
        println!("{stiffness}: {vertex} within {told:.1e}, {plane} within {known:.1e}");
        assert!(off <= told + known, "{stiffness}: {off:.1e} of {told:.1e}");
        assert!(
            told <= 2e-4 * known.max(plane.abs()),
            "{stiffness}: {told:.1e}"
        );
        // By collocation.
        let off = (vertex + 4.274_845_155_2).abs();
        assert!(stiffness != 20.0 || off <= told, "{off:.1e} of {told:.1e}");
    }
}
