//! Where a leaf of stiff veins has several equilibria, a relaxation ends in the one in
//! which the motion of the leaf in time, with the same mass and damping, ends, or says that
//! this is not certain: with few exceptions in hundreds, and none in these. `LANDINGS` is how
//! many such leaves are tried, `SEED` which.

mod common;

use common::motion::{Scheme, moving};
use common::random::Draw;
use common::*;
use leafdyn::relax::SemiImplicit;
use leafdyn::simulate::Simulation;
use leafdyn::study;

/// Tips nearer to each other than this part of the length are one.
const SAME: f64 = 0.02;

/// Segments of the motion: on fewer, some leaves end elsewhere.
const SEGMENTS: usize = 64;

/// Part of the energy at the start that may be left to move the leaf at rest.
const AT_REST: f64 = 1e-9;

/// A leaf of two to six stiff veins, heavy or curved enough to have several equilibria.
fn leaf(draw: &mut Draw) -> Scenario {
    let rods = draw.uniform(2.0, 7.0) as usize;
    let [fan, length, bend] =
        [(-1.2, 1.2), (0.9, 1.1), (-4.0, 4.0)].map(|(low, high)| draw.list(rods, low, high));
    let stiffness = [(0.3, 3.0), (0.1, 1.0), (0.3, 3.0), (1e3, 1e5), (1e3, 1e5)];
    let [torsion, bending_2, bending_3, axial, shear] =
        stiffness.map(|(low, high)| draw.log(low, high));
    let (coupling, weight) = (draw.log(0.1, 10.0), draw.log(1.0, 20.0));
    let (sideways, upwards) = (draw.uniform(-0.3, 0.3), draw.uniform(-1.0, 1.0));
    parse(&format!(
        r#"
        name = "landing"
        leaf = {{ rods = {rods}, length = {length:?}, fan = {fan:?} }}
        stiffness = {{ torsion = {torsion}, bending_2 = {bending_2}, bending_3 = {bending_3}, axial = {axial}, shear_2 = {shear}, shear_3 = {shear} }}
        rest = {{ bend_2 = {bend:?} }}
        coupling = {{ x = {coupling}, y = {coupling}, z = {coupling} }}
        load = {{ gravity = [0.0, {}, {}] }}
        dynamics = {{ duration = 200.0, output_interval = 0.5 }}
        solve = {{ tolerance = 1e-4 }}
        "#,
        weight * sideways,
        -weight * upwards,
    ))
}

/// Where its motion ends; `None` if it does not.
fn landing(leaf: &Scenario) -> Option<glam::DVec3> {
    let options = moving(Scheme::SemiImplicit, Some(SEGMENTS));
    let mut motion = Simulation::new(leaf, &options).unwrap();
    let mut most = 0.0_f64;
    while !motion.done() {
        let kinetic = motion.next_frame().ok()?.energy.kinetic;
        most = most.max(kinetic);
        if kinetic < AT_REST * most {
            return Some(motion.frame().tips(true)[0]);
        }
    }
    None
}

#[test]
fn is_that_of_the_motion() {
    let (count, mut draw) = (asked("LANDINGS", 6), Draw(asked("SEED", 1) as u64));
    let (mut judged, mut doubtful, mut elsewhere) = (0, 0, Vec::new());
    let mut drawn = 0;
    while judged < count {
        let this = draw.0;
        let leaf = leaf(&mut draw);
        drawn += 1;
        assert!(drawn < 100 * count);
        let plain = leaf.relax().unwrap();
        if !plain.outcome.is_success() {
            continue;
        }
        let how = SemiImplicit::default();
        let all = study::all(&leaf, how, None, &Limit::default(), &mut |_, _| {}).unwrap();
        let stable = |found: &&study::Found| found.equilibrium.stable() == Some(true);
        if all.found.iter().filter(stable).count() < 2 {
            continue;
        }
        let Some(end) = landing(&leaf) else {
            println!("seed {this}: does not come to rest in time");
            continue;
        };
        judged += 1;
        let off = (end - tip(&plain)).length();
        if off > SAME {
            println!("seed {this}: {off:.2} away; {:?}", plain.remark);
            match plain.remark {
                Some(_) => doubtful += 1,
                None => elsewhere.push(this),
            }
        }
    }
    let count = elsewhere.len();
    println!("{count} of {judged} elsewhere, {doubtful} more with a remark; {drawn} drawn");
    // docs/tried.md tells of more.
    assert!(count <= judged / 50, "{elsewhere:?}");
    let uncertain = format!("{doubtful} of {judged} are not certain");
    assert!(doubtful <= judged / 2, "{uncertain}");
}

#[test]
fn of_a_mirror_symmetric_leaf_is_found_on_half_of_it() {
    // Softened it never leaves a region of convex energy, and ends in another equilibrium.
    let leaf = parse(
        r#"
        name = "mirrored"
        leaf = { rods = 3, length = [1.044, 1.017, 1.044], fan = [0.166, 0.0, -0.166] }
        stiffness = { torsion = 1.56, bending_2 = 0.435, bending_3 = 1.095, axial = 36900.0, shear_2 = 2290.0, shear_3 = 2290.0 }
        rest = { bend_2 = [0.495, -2.635, 0.495] }
        coupling = { x = 4.67, y = 4.67, z = 4.67 }
        load = { gravity = [0.0, 0.0, 0.931] }
        dynamics = { duration = 200.0, output_interval = 0.5 }
        solve = { tolerance = 1e-4 }
        "#,
    );
    let rest = leaf.relax().unwrap();
    assert_eq!((rest.model.rods, &rest.remark), (2, &None));
    let off = (landing(&leaf).unwrap() - tip(&rest)).length();
    assert!(off < SAME, "{off}");
}

#[test]
fn of_a_column_that_is_pushed_along_its_axis_stays_doubtful() {
    // It stands on a saddle, which its motion in time does not leave.
    let stiff = set_stiffness(1e4, 1e4);
    let column = rod(&format!(
        "{stiff}; stiffness.bending_3=0.5; load.tip_force=[-4, 0, 0]"
    ));
    let rest = column.relax().unwrap();
    assert!(rest.stability.saddle.is_some());
    assert!(rest.remark.unwrap().contains("softened"));
    // The motion is given up long before it has spent what it may.
    assert!(rest.work.factorizations < 2000, "{:?}", rest.work);
}

#[test]
fn is_found_where_the_grid_of_the_motion_does_not_resolve_the_leaf() {
    // On 32 segments it bends too much at rest: the motion is not continued for ever, and
    // Newton's method goes on to 64.
    let leaf = parse(
        r#"
        name = "unresolved"
        leaf = { rods = 5, length = [0.844, 0.731, 0.949, 0.743, 0.658], fan = [0.456, 1.57, -1.09, 0.567, 1.33] }
        stiffness = { torsion = 0.52, bending_2 = 0.0633, bending_3 = [7.06, 1.13, 0.0788, 0.0301, 0.691], axial = [837.0, 52800.0, 515.0, 3740.0, inf], shear_2 = 5290.0, shear_3 = 19300.0 }
        coupling = { x = 212.0, y = 663.0, z = 234.0 }
        load = { gravity = [-0.158, -0.648, -0.93], tip_force = [136.0, -168.5, -3.64] }
        "#,
    );
    let rest = leaf.relax().unwrap();
    assert!(rest.outcome.is_success());
    assert!(rest.accuracy.segments[0] >= 64, "{:?}", rest.accuracy);
    assert!(rest.work.factorizations < 9000, "{:?}", rest.work);
}
