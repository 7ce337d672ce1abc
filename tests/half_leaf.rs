//! A leaf that is its own mirror image is solved by half of its veins, with the
//! result of the whole; where it breaks the mirror, or moves out of its valley,
//! the whole leaf takes over.

mod common;

use common::random::{cases, leaves};
use common::*;
use proptest::prelude::*;

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

proptest! {
    #![proptest_config(cases(60))]

    #[test]
    fn half_a_leaf_is_the_leaf(leaf in leaves(), odd in prop::bool::ANY) {
        let leaf = mirrored(leaf, odd);
        let [half, whole] = reduced_and_full(&leaf, Some(20));
        prop_assert_eq!(half.outcome, whole.outcome);
        prop_assert_eq!(whole.model.rods, leaf.rods.len());
        prop_assert_eq!(half.stability.negative_eigenvalues, whole.stability.negative_eigenvalues);
        prop_assume!(whole.outcome == Outcome::Converged);
        same(&leaf, &half, &whole);
        let force = half.tip_force_sum - whole.tip_force_sum;
        prop_assert!(force.length() < 1e-8 * scale(&leaf).force());
    }
}

/// Most such leaves are found by half: the saving is real.
#[test]
fn the_paper_s_firm_leaves_are_found_by_half() {
    for figure in ["fig04", "fig05", "fig06", "fig13"] {
        for (rods, solved) in [(2, 1), (4, 2), (5, 3), (21, 11)] {
            let (figure, rods_are) = (format!("paper/{figure}"), format!("leaf.rods={rods}"));
            let leaf = scenario(&figure, &format!("{rods_are}; leaf.fan='symmetric'"));
            let [half, whole] = reduced_and_full(&leaf, None);
            assert_eq!(half.model.rods, solved, "{figure}, {rods}");
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

/// Pushed back at its tip, a leaf of veins that bend sideways most easily leaves
/// the mirror's plane sideways, though its symmetric shape is an equilibrium.
#[test]
fn a_leaf_that_breaks_its_mirror_is_followed() {
    for rods in [2, 3, 4] {
        let soft = "leaf.fan='symmetric'; stiffness.bending_3=0.05; load.tip_force=[-2.0, 0, 0]";
        let leaf = scenario("paper/fig04", &format!("leaf.rods={rods}; {soft}"));
        let [found, whole] = reduced_and_full(&leaf, None);
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
