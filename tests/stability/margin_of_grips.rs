//! The margin of a leaf with holders along its veins, which stay where they are.

use leafdyn::relax::{
    CriticalTipForce, InstabilityKind, Margin, MarginRemark, PostcriticalBehavior,
};
use leafdyn::study::relax_with_margin;
use leafdyn_testing::*;

/// A strip that bends in one plane alone, held by a grip.
fn strip(length: f64, more: &str) -> Scenario {
    parse(&format!(
        r#"
        name = "strip"
        leaf = {{ rods = 1, length = {length:?}, fan = [0.0] }}
        stiffness = {{ torsion = 50.0, bending_2 = 50.0, bending_3 = 1.0, axial = inf, shear_2 = inf, shear_3 = inf }}
        {more}
        "#
    ))
}

fn margin(scenario: &Scenario) -> Margin {
    let found = relax_with_margin(scenario, &at_every_node(1e-8), &mut |_| {}).unwrap();
    found.margin.unwrap()
}

/// The force of a push, with its error.
fn force(push: &CriticalTipForce) -> (f64, f64) {
    (push.force.unwrap(), push.error.unwrap())
}

/// What is beyond a clamp in the middle gives way, snaps, and has a pass, as a vein of half the length
/// that begins there.
#[test]
fn beyond_a_clamp_a_column_is_a_shorter_one() {
    let grip = "grip = [{ vein = 1, at = 0.5, held = \"clamped\" }]";
    for load in [0.0, -3.0] {
        let load = format!("load.tip_force = [{load:?}, 0.0, 0.0]");
        let half = margin(&strip(1.0, &load));
        let whole = margin(&strip(2.0, &format!("{load}\n{grip}")));
        let [one, other] = [&half, &whole].map(|margin| &margin.pushes[0]);
        let ((right, bar), (found, error)) = (force(one), force(other));
        close("push", found, right, bar + error + 1e-10);
        assert!(error < 1e-5 * right, "{other:?}");
        assert_eq!((one.kind, one.then), (other.kind, other.then));
        assert_eq!(half.barrier.is_some(), whole.barrier.is_some());
        let passes = half.barrier.iter().zip(&whole.barrier);
        for (one, other) in passes {
            let bars = one.error.unwrap() + other.error.unwrap();
            close("barrier", other.energy, one.energy, bars + 1e-10);
            assert!(bars < 1e-4 * one.energy, "{bars}");
            let beyond = other.saddle.tip - DVec3::X;
            assert!(beyond.distance(one.saddle.tip) < 1e-6, "{beyond}");
        }
    }
}

/// A column that is clamped at its base, pinned in its middle and free at its tip. The pin bears the
/// push P, so that the part before it is not compressed and takes the moment 4 theta/a at an end that
/// rotates by theta; the other takes k tan(k b) theta from it, with k^2 = P (1 - P/H) as the column of
/// Reissner (a = b = 1/2).
#[test]
fn a_column_that_is_pinned_in_its_middle() {
    const AXIAL: f64 = 200.0;
    let unbalanced = |phi: f64| 4.0 - phi * phi.tan();
    let (mut low, mut high) = (0.5, 1.5);
    assert!(unbalanced(low) > 0.0 && unbalanced(high) < 0.0);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        match unbalanced(middle) > 0.0 {
            true => low = middle,
            false => high = middle,
        }
    }
    let squared = 4.0 * low * low;
    let right = 0.5 * AXIAL * (1.0 - (1.0 - 4.0 * squared / AXIAL).sqrt());
    let mut column = strip(1.0, "grip = [{ vein = 1, at = 0.5 }]");
    column.rods[0].force_stiffness[0] = Profile::Constant(AXIAL);
    let column = margin(&column);
    let least = &column.pushes[0];
    let (found, error) = force(least);
    close("push", found, right, error.max(1e-10));
    assert!(error < 1e-5 * right, "{least:?}");
    assert_eq!(least.direction.to_string(), "-x");
    let lost = (least.kind, least.then);
    assert_eq!(
        lost,
        (
            InstabilityKind::BranchPoint,
            Some(PostcriticalBehavior::BendsAside)
        )
    );
}

/// Where grips hold all tips no push is tried; the pass of a buckled strip between them is found.
#[test]
fn a_gripped_tip_is_not_pushed() {
    let tip = "[0.8, 0.0, 0.0]";
    let grip = "grip = [{ vein = 1, at = 1.0, held = \"clamped\", move = [-0.2, 0.0, 0.0] }]";
    let held = format!("tip = {{ held = \"clamped\", position = {tip} }}");
    let pulled = "load.gravity = [0.0, -0.3, 0.0]";
    let [gripped, held] = [grip, &held].map(|how| margin(&strip(1.0, &format!("{how}\n{pulled}"))));
    for margin in [&gripped, &held] {
        assert!(margin.pushes.is_empty() && margin.largest_push.is_none());
        assert_eq!(margin.remark, Some(MarginRemark::TipHeld));
    }
    let [one, other] = [&gripped, &held].map(|margin| margin.barrier.as_ref().unwrap());
    let bars = one.error.unwrap() + other.error.unwrap();
    close("barrier", one.energy, other.energy, bars + 1e-9);
    assert!(bars < 1e-4 * one.energy, "{bars}");
}
