//! A leaf that is its own mirror image is found by half of its veins, with the result of the full
//! model; where it breaks the mirror, or moves out of its valley, the full model takes over. A
//! leaf that nothing pulls out of its plane stays in it to the last bit, unless it buckles out
//! of it; what is told of the plane is so.

use leafdyn::relax::{Route, SemiImplicit};
use leafdyn_testing::random::{cases, leaves};
use leafdyn_testing::*;
use proptest::prelude::*;

fn fig05(entries: &str) -> Scenario {
    scenario("paper/fig05", entries)
}

/// What acts within the plane on a random leaf.
fn in_plane(mut leaf: Scenario) -> Scenario {
    leaf.gravity[2] = 0.0;
    leaf.tip_force[2] = 0.0;
    for rod in &mut leaf.rods {
        rod.rest_curvature[0] = Profile::Constant(0.0);
        rod.rest_curvature[1] = Profile::Constant(0.0);
    }
    leaf
}

/// A leaf made of the upper half of another and its mirror image.
fn mirrored(mut leaf: Scenario, odd: bool) -> Scenario {
    let half = leaf.rods.len();
    for (j, rod) in leaf.rods.iter_mut().enumerate() {
        rod.angle = -0.9 + 0.8 * (j as f64 + 0.5) / half as f64;
    }
    let images: Vec<_> = leaf.rods.iter().rev().cloned().collect();
    let gaps: Vec<_> = leaf.coupling.iter().rev().copied().collect();
    let middle = [0.3, 1.0, 0.7];
    leaf.coupling.push(middle);
    if odd {
        let mut midrib = leaf.rods[0].clone();
        midrib.angle = 0.0;
        midrib.rest_curvature[0] = Profile::Constant(0.0);
        midrib.rest_curvature[2] = Profile::Constant(0.0);
        leaf.rods.push(midrib);
        leaf.coupling.push(middle);
    }
    leaf.coupling.extend(gaps);
    leaf.base_held = vec![leaf.base_held[0]; 2 * half + usize::from(odd)];
    for mut image in images {
        image.angle = -image.angle;
        for k in [0, 2] {
            image.rest_curvature[k] = image.rest_curvature[k].scaled(-1.0);
        }
        leaf.rods.push(image);
    }
    leaf.gravity[1] = 0.0;
    leaf.tip_force[1] = 0.0;
    leaf
}

/// Found as by the full model: outcome, index, and all fields of what is at rest.
fn found_as_in_full(leaf: &Scenario) -> Result<[Equilibrium; 2], TestCaseError> {
    let [found, full] = reduced_and_full(leaf, Some(20));
    prop_assert_eq!(found.outcome, full.outcome);
    prop_assert!(!full.model.planar);
    prop_assert_eq!(full.model.rods, leaf.rods.len());
    prop_assert_eq!(
        found.stability.negative_eigenvalues,
        full.stability.negative_eigenvalues
    );
    prop_assume!(full.outcome.is_success());
    same(leaf, &found, &full);
    let force = found.tip_force_sum - full.tip_force_sum;
    prop_assert!(force.length() < 1e-8 * scale(leaf).force());
    Ok([found, full])
}

proptest! {
    #![proptest_config(cases(100))]

    #[test]
    fn a_leaf_in_its_plane_is_the_leaf(leaf in leaves()) {
        let [planar, full] = found_as_in_full(&in_plane(leaf))?;
        // Nothing is told of the plane that is not so.
        if planar.model.planar {
            prop_assert!(nodes(&full.shape.rods).all(|node| node.position.z == 0.0));
        }
    }

    #[test]
    fn half_a_leaf_is_the_leaf(leaf in leaves(), odd in prop::bool::ANY) {
        found_as_in_full(&mirrored(leaf, odd))?;
    }
}

/// The leaf of Fig. 5 lies flat.
#[test]
fn the_paper_s_flat_leaf_is_found_in_its_plane() {
    for (rods, iterations) in [(5, 16), (21, 14), (35, 13)] {
        let leaf = relaxed(&fig05(&format!("leaf.rods={rods}")), &Options::default());
        assert!(leaf.model.planar);
        assert_eq!(leaf.outcome, Outcome::Converged);
        assert!(nodes(&leaf.shape.rods).all(|node| node.position.z == 0.0));
        let work = [leaf.work.steps, leaf.work.cg_iterations];
        assert_eq!(work, [4, iterations], "{rods} rods");
    }
}

/// Most such leaves are found by half, and that of Fig. 5 in its plane, too: the saving is real.
#[test]
fn the_paper_s_firm_leaves_are_found_by_half() {
    for figure in ["fig04", "fig05", "fig06", "fig13"] {
        for (rods, solved) in [(2, 1), (4, 2), (5, 3), (21, 11)] {
            let (figure, rods_are) = (format!("paper/{figure}"), format!("leaf.rods={rods}"));
            let leaf = scenario(&figure, &format!("{rods_are}; leaf.fan='symmetric'"));
            let [half, whole] = reduced_and_full(&leaf, None);
            assert_eq!(half.model.rods, solved, "{figure}, {rods}");
            assert_eq!(half.model.planar, figure == "paper/fig05");
            assert_eq!(half.outcome, Outcome::Converged);
            assert_eq!(half.stability.negative_eigenvalues, Some(0));
            assert_eq!(half.shape.rods.len(), rods);
            let apart = Difference::between(&half.shape.rods, &whole.shape.rods);
            let bound = match half.accuracy.segments == whole.accuracy.segments {
                // Both end their iterations five thousandths of the tolerance away.
                true => 1e-8,
                false => estimate(&half) + estimate(&whole),
            };
            assert!(apart.position < bound, "{figure}, {rods}: {apart:?}");
            // The fan of the paper is not symmetric: nothing is left out there.
            let own = relaxed(&scenario(&figure, &rods_are), &Options::default());
            assert_eq!(own.model.rods, rods);
        }
    }
}

/// Flat leaves that are equilibria, and not what the leaf does: pulled sideways
/// edge-on, pushed back at the tip, bent at rest against each other.
#[test]
fn a_leaf_that_buckles_out_of_its_plane_is_followed() {
    let soft = "leaf.rods=3; stiffness.bending_2=0.05; stiffness.torsion=0.05; \
                stiffness.axial=100; stiffness.shear_2=100; stiffness.shear_3=100; coupling.z=0";
    for (what, fan, bending_3, entry) in [
        ("lateral", "paper", 5, "load.tip_force=[0, -4, 0]"),
        ("weight", "paper", 5, "load.gravity=[0, -6, 0]"),
        ("pushed", "symmetric", 2, "load.tip_force=[-2, 0, 0]"),
        ("bent", "paper", 5, "rest.bend_3=[3, 0, -3]"),
    ] {
        let soft = format!("{soft}; leaf.fan='{fan}'; stiffness.bending_3={bending_3}; {entry}");
        let leaf = fig05(&soft);
        for segments in [Some(16), None] {
            let [found, full] = reduced_and_full(&leaf, segments);
            assert!(found.outcome.is_success(), "{what}: {:?}", found.outcome);
            assert_eq!(found.outcome, full.outcome, "{what}");
            assert_eq!(found.stability.negative_eigenvalues, Some(0), "{what}");
            assert!(!found.model.planar, "{what}");
            let lift = largest(nodes(&found.shape.rods).map(|node| node.position.z.abs()));
            assert!(lift > 0.05, "{what}: {lift}");
            let apart = Difference::between(&found.shape.rods, &full.shape.rods);
            assert!(apart.position < 1e-12, "{what}: {apart:?}");
        }
        // Stiff enough, the same leaf stays flat.
        let stiff = "stiffness.bending_2=50; stiffness.torsion=50";
        let leaf = relaxed(&fig05(&format!("{soft}; {stiff}")), &Options::default());
        assert!(leaf.model.planar, "{what}");
    }
}

/// Flat at rest this leaf is stable, but not on its way there: in space it
/// leaves the plane and comes to rest elsewhere. The answer is that in space.
#[test]
fn a_flat_valley_that_the_leaf_does_not_come_to_is_not_told() {
    let leaf = parse(
        r#"
        name = "two_valleys"
        leaf = { rods = 2, length = [1.1602764955215343, 1.162438327833955], fan = [-0.07237179647058896, 1.039812713018257] }
        stiffness.torsion = { at = [0.0, 0.3512142618678161, 1.0], value = [0.1284452439112738, 0.14359498887548044, 0.07706714634676427] }
        stiffness.bending_2 = 0.7830801094214045
        stiffness.bending_3 = 0.38309378941088756
        stiffness.axial = inf
        stiffness.shear_2 = 74.7976509039849
        stiffness.shear_3 = 67.26264986497492
        coupling = { x = 1.2701123121090474, y = 0.9544600194057796, z = 1.1053997707532524 }
        load = { gravity = [-0.27481151713278484, -0.3020747217601999, 0.0], tip_force = [-0.9125959227821634, -0.61559480013023, 0.0] }
        [rest.bend_3]
        at = [0.0, 0.3512142618678161, 1.0]
        value = [[1.3714156700735378, 1.533170181247829, 0.8228494020441227], [1.0032007292937608, 1.1215253533429401, 0.6019204375762565]]
    "#,
    );
    let [found, full] = reduced_and_full(&leaf, Some(20));
    assert!(!found.model.planar);
    assert_eq!(found.outcome, full.outcome);
    let apart = Difference::between(&found.shape.rods, &full.shape.rods);
    assert!(apart.position < 1e-12, "{apart:?}");
    assert!(full.tips[0].z.abs() > 0.05, "{}", full.tips[0]);
    let flat = relaxed(&leaf, &keeping(on(20)));
    assert_eq!(flat.tips[0].z, 0.0);
    assert_eq!(flat.stability.negative_eigenvalues, Some(0));
}

/// What acts out of the plane, however little, and what may: a start that is
/// not flat, a saddle that is kept.
#[test]
fn of_other_leaves_nothing_is_told() {
    for entry in [
        "load.gravity=[0, 0, 1e-9]",
        "load.tip_force=[0, 0, 1e-9]",
        "rest.bend_2=[0, 1e-9, 0]",
        "rest.twist=[0, 0, 1e-9]",
    ] {
        let leaf = relaxed(&fig05(&format!("leaf.rods=3; {entry}")), &on(8));
        assert!(!leaf.model.planar, "{entry}");
    }
    let leaf = fig05("leaf.rods=3");
    let disturbed = SemiImplicit {
        disturbance: Some(1),
        ..SemiImplicit::default()
    };
    let disturbed = by(disturbed.into(), Options::default());
    for options in [keeping(Options::default()), disturbed] {
        assert!(!relaxed(&leaf, &options).model.planar);
    }
}

/// Pushed back at its tip, a leaf of veins that bend sideways most easily leaves
/// the mirror's plane sideways, though its symmetric shape is an equilibrium.
#[test]
fn a_leaf_that_breaks_its_mirror_is_followed() {
    for rods in [2, 3, 4] {
        let soft = "leaf.fan='symmetric'; stiffness.bending_3=0.05; load.tip_force=[-2.0, 0, 0]";
        let leaf = scenario("paper/fig04", &format!("leaf.rods={rods}; {soft}"));
        // Loaded slowly, it stays symmetric where it can.
        let released = || Options {
            route: Route::Release,
            ..Options::default()
        };
        let [found, whole] = [released(), in_full(released())].map(|how| relaxed(&leaf, &how));
        assert!(found.outcome.is_success(), "{rods}: {:?}", found.outcome);
        assert_eq!(found.stability.negative_eigenvalues, Some(0), "{rods}");
        assert_eq!(found.model.rods, rods);
        assert!(found.tips[0].y.abs() > 0.1, "{rods}: {}", found.tips[0]);
        // To one side or to the other.
        let [found, whole] = [found, whole].map(|leaf| leaf.energy.unwrap());
        close(&format!("{rods} rods"), found, whole, 1e-6);
    }
}

/// The effects of shear and stretch are derivatives: they tell what a leaf four
/// times as stiff does differently.
#[test]
fn what_shear_and_stretch_matter_is_told() {
    for figure in ["fig04", "fig06"] {
        let with = |axial: f64, shear: f64| {
            let entries = format!("leaf.rods=5; {}", set_stiffness(axial, shear));
            relaxed(&scenario(&format!("paper/{figure}"), &entries), &on(16))
        };
        // Compliances small enough for their effects to be linear.
        let leaf = with(1e4, 1e4);
        for (effect, other) in [
            (leaf.model.shear_effect, with(1e4, f64::INFINITY)),
            (leaf.model.stretch_effect, with(f64::INFINITY, 1e4)),
        ] {
            let effect = effect.unwrap();
            let pairs = nodes(&leaf.shape.rods).zip(nodes(&other.shape.rods));
            let apart = pairs.map(|(a, b)| (a.position - b.position).abs().max_element());
            let apart = largest(apart);
            let ratio = effect / apart;
            assert!((ratio - 1.0).abs() < 0.03, "{figure}: {effect} {apart}");
        }
    }
}
