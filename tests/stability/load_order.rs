//! Where the equilibrium of a loaded leaf ends before loads that turn with the section have grown to their full size,
//! they are put on before the other loads: as a branch in these loads finds the leaf.

use leafdyn::relax::{EquilibriumDoubt, EquilibriumRemark, Options, RestObstacle, Route};
use leafdyn::study::trace;
use leafdyn_testing::*;

/// A stem of a pinned place and a force beside its axis which turns with the section, in cm and N.
const STEM: &str = r#"
    name = "stem"
    leaf = { rods = 1, length = 0.943, fan = [-0.0434] }
    rest = { bend_3 = 0.662, twist = 1.79 }
    [section]
    shape = "u"
    young = 1200000.0
    mass_density = 753.0
    width = { at = [0.0, 0.4, 1.0], value = [0.12, 0.1, 0.06] }
    thickness = { at = [0.0, 0.4, 1.0], value = [0.072, 0.06, 0.036] }
    wall = 0.012
    [load]
    g = [0.0, 0.0, -2.2]
    tip_force = [-0.823, -0.981, 0.665]
    [[load.point]]
    vein = 1
    at = 0.637
    force = [0.153, 1.05, -1.39]
    follows = true
    offset = [0.278, -0.198]
    [[grip]]
    vein = 1
    at = 0.449
    held = "pinned"
    move = [0.0264, 0.0461, -0.0456]
"#;

const TOLERANCE: f64 = 1e-6;

#[test]
fn a_fold_on_one_way_is_gone_round_on_another() {
    let leaf = parse(STEM);
    let found = settled(&leaf, &to(TOLERANCE));
    let part = found.doubts.iter().find_map(|doubt| match doubt {
        EquilibriumDoubt::OtherLoadOrder { part, loads } => {
            assert_eq!(loads, &["load.point.force"]);
            Some(*part)
        }
        _ => None,
    });
    let part = part.expect("how much of these loads the leaf bears beside the others");
    let along = |vary: &str| {
        let mut request = branch::request(base(STEM, ""), vary, TOLERANCE, 500);
        request.keep_unstable = false;
        trace(&request, &mut |_, _, _| {}).unwrap()
    };
    // The branch in the force that grew last ends at a fold.
    let folded = along("scale:load.point[0].force=0..1");
    let fold = largest(folded.branches[0].points.iter().map(|point| point.value));
    assert!((part - fold).abs() < 2e-3, "{part} {fold}");
    // That in the others leads past it.
    let passed = along("scale:load.tip_force=0..1");
    let end = passed.branches[0].points.last().unwrap();
    assert_eq!((end.value, end.index), (1.0, 0));
    let off = tip(&found).distance(end.tips[0]);
    assert!(off < 4.0 * TOLERANCE, "{off:.1e}");
}

/// Where the order is not free it is told how much of these loads the leaf bears.
#[test]
fn the_end_of_an_equilibrium_is_told() {
    let options = Options {
        route: Route::Release,
        ..to(1e-4)
    };
    let found = relaxed(&parse(STEM), &options);
    let Some(EquilibriumRemark::EquilibriumEnds { obstacle, .. }) = &found.remark else {
        panic!("{:?}: {:?}", found.outcome, found.remark);
    };
    let RestObstacle::EndOfGrowth { part, .. } = **obstacle else {
        panic!("{obstacle:?}");
    };
    let with = |part: f64| {
        let entries = format!("scale:load.point[0].force={part:?}");
        relaxed(base(STEM, &entries).scenario(), &options).outcome
    };
    assert!(with(part - 2e-3).is_at_rest() && !with(part + 2e-3).is_at_rest());
}
