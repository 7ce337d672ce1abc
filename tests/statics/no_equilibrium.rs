//! Where a leaf cannot come to rest, the message names what keeps it from it.

use leafdyn::relax::{
    Equilibrium, EquilibriumRemark, Method, Options, RelaxError, RestObstacle, relax,
};
use leafdyn_testing::*;

const RIGID: &str = r#"
    name = "rigid"
    leaf = { rods = 1, length = 1.0, fan = [0.0] }
    stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = inf, shear_2 = inf, shear_3 = inf }
"#;

fn relaxed(text: &str, entries: &str) -> Result<Equilibrium, RelaxError> {
    relax(
        base(text, entries).scenario(),
        &Options::default(),
        &mut |_| {},
    )
}

/// What is said of a leaf that does not come to rest.
#[track_caller]
fn blamed(text: &str, entries: &str) -> EquilibriumRemark {
    let found = relaxed(text, entries).unwrap();
    assert!(
        !found.outcome.is_at_rest(),
        "{entries}: {:?}",
        found.outcome
    );
    found.remark.expect("it says why")
}

/// Moments about the line about which a leaf turns freely balance nothing: those across the force on
/// a hinge do, and on a leaf that a force across the line holds.
#[test]
fn moments_along_a_free_turn_have_no_equilibrium() {
    let hinge = "leaf.base_held=pinned; load.tip_force=[1.0, 0.0, 0.0]; ";
    let line = "the line along its loads through its hinge";
    let refused = |entries: &str| {
        let found = relaxed(RIGID, &format!("{hinge}{entries}"));
        match found.map(|leaf| leaf.outcome.word()) {
            Err(RelaxError::UnbalancedMoment { line, moment }) => Some((line, moment)),
            Ok("converged") => None,
            other => panic!("{entries}: {other:?}"),
        }
    };
    let along = refused("load.tip_moment=[0.5, 0.1, 0.0]");
    assert_eq!(along, Some((line, 0.5)));
    let held = "tip.held=pinned; tip.position=[0.9, 0.0, 0.0]; load.tip_force=[0.0, 0.0, 0.0]; ";
    let along = refused(&format!("{held}load.tip_moment=[0.0, 0.0, 0.0]"));
    assert_eq!(along, None);
    let moments = |moment: &str| {
        let point = format!("{RIGID}\n[[load.point]]\nvein = 1\nat = 0.4\nmoment = {moment}");
        let held = "leaf.base_held=pinned; tip.held=pinned; tip.position=[0.9, 0.0, 0.0]";
        base(&point, held).scenario().unbalanced_moment()
    };
    let found = moments("[0.5, 0.1, 0.0]").unwrap();
    assert_eq!(
        (found.line, found.moment),
        ("the line through its holders", 0.5)
    );
    assert_eq!(moments("[0.0, 0.1, 0.0]"), None);
    // Across the force, and with weight across the line.
    for balanced in [
        "load.tip_moment=[0.0, 0.1, 0.0]",
        "load.gravity=[0.0, 0.0, -1.0]; load.tip_moment=[0.05, 0.0, 0.0]",
    ] {
        let scenario = base(RIGID, &format!("{hinge}{balanced}"));
        assert_eq!(scenario.scenario().unbalanced_moment(), None);
    }
}

/// An inextensible vein that is held straight between two holders bears no load across itself; it
/// does if it can be stretched, or if one holder is nearer.
#[test]
fn an_inextensible_vein_held_straight_is_named() {
    let gripped = format!("{RIGID}\n[[grip]]\nvein = 1\nat = 0.7\n");
    let weight = "load.gravity=[0.0, 0.0, -1.0]";
    let told = blamed(&gripped, weight).to_string();
    let named = "vein 1 is inextensible and held straight between its base and the grip at 0.7 of its length";
    assert!(told.contains(named), "{told}");
    for (entries, rests) in [
        ("stiffness.axial=1e4", true),
        ("grip[0].move=[-0.01, 0.0, 0.0]", true),
    ] {
        let found = relaxed(&gripped, &format!("{weight}; {entries}")).unwrap();
        assert_eq!(found.outcome.is_at_rest(), rests, "{entries}");
    }
    // Without a load it rests.
    assert!(relaxed(&gripped, "").unwrap().outcome.is_at_rest());
}

/// Newton's method ends where the law of the tissue jumps, at half a turn of two tips.
#[test]
fn half_a_turn_of_neighbours_is_named() {
    let veins = r#"
        name = "veins"
        leaf = { rods = 3, joined = false, length = 1.0, fan = [0.0, 0.0, 0.0], elevation = [-0.1198, -0.1208, 0.3305], base = [[0.0, -0.1, 0.0], [0.0, 0.0, 0.0], [0.0, 0.1, 0.0]] }
        tissue.normal = [27.0, 14.0]
        load.tip_force = [-5.0, -6.0, -4.0]
        [stiffness]
        torsion = 1.0
        bending_2 = { at = [0.0, 0.375, 1.0], value = [1.4141, 1.4521, 1.475] }
        bending_3 = 2.4863
        axial = 100.0
        shear_2 = 100.0
        shear_3 = 100.0
        [[load.point]]
        vein = 3
        at = 0.625
        force = [-8.4567, 1.9064, 3.9613]
    "#;
    let told = blamed(veins, "");
    let Some(RestObstacle::HalfTurn { place }) = told.obstacle() else {
        panic!("{told}");
    };
    assert_eq!((place.gap, place.sigma), (1, 1.0));
}

/// Newton's method alone, which takes equilibria of any index, finds none of these soft leaves on three grids, and is given
/// up: finer ones took a minute, and found none either.
#[test]
fn a_search_for_any_index_ends_after_three_grids() {
    for (leaf, factorizations) in [("paper/fig08", 49), ("paper/fig09", 74)] {
        let found = leafdyn_testing::relaxed(&scenario(leaf, ""), &keeping(Options::default()));
        let told = found.remark.expect("it says why");
        assert_eq!(told.code(), "no-equilibrium-from-start", "{leaf}");
        assert!(told.to_string().contains("on 32 segments"), "{told}");
        let needed = found.work.factorizations;
        // Processors round differently.
        assert!(needed <= factorizations * 6 / 5, "{leaf}: {needed}");
    }
}

/// Where veins grow and the tissue between them does not, that is named: a blade whose margins have grown by a
/// twentieth.
#[test]
fn growth_that_strains_tissue_is_named() {
    let grown = "tissue.grown=false; rest.stretch=[1.05, 1.0375, 1.025, 1.0125, 1.0, 1.0125, 1.025, 1.0375, 1.05]";
    let options = Options {
        method: Method::default().on_grid(Some(8)),
        ..Options::default()
    };
    let leaf = leafdyn_testing::relaxed(&scenario("measured/blade", grown), &options);
    assert!(!leaf.outcome.is_at_rest());
    let told = leaf.remark.expect("it says why").to_string();
    let named = "lower the growth by rest.stretch, or raise ";
    assert!(told.contains(named), "{told}");
}
