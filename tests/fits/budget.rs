//! A fit has a budget that is told before its first step, and ends with the best that was found so far.

use leafdyn::study::{FitError, FitOutcome, FitRemark, fit};
use leafdyn_testing::fit::{LEAF, THREE, pulls, request};
use leafdyn_testing::random::Draw;
use leafdyn_testing::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Tips pulled to where no such leaf has them, so that there is much to search.
fn hopeless() -> String {
    let truth = "stiffness.bending_2=1.4; stiffness.bending_3=0.7; stiffness.axial=40";
    let forces = [0.0, 2.0, 4.0, 6.0].map(|k: f64| [1.0 + k, 0.5 * (k - 4.0), 0.7 * k.cos()]);
    pulls(LEAF, truth, &forces, 0.3, &mut Draw(5))
}

#[test]
fn a_budget_is_told_and_kept() {
    let mut asked = request(base(LEAF, ""), &[&hopeless()], &THREE);
    let mut sums = Vec::new();
    for most in [3, 6, 12] {
        asked.most_evaluations = Some(most);
        let mut first = None;
        let found = fit(&asked, &mut |step| first = first.or(Some(step.budget))).unwrap();
        let budget = first.flatten().unwrap();
        assert_eq!((budget.evaluations, budget.leaves), (most, 4));
        assert!(budget.seconds > 0.0);
        let used_up = FitRemark::BudgetUsedUp { evaluations: most };
        assert_eq!(found.remarks[0], used_up);
        if most == 3 {
            assert_eq!(found.outcome, FitOutcome::NotConverged);
        }
        sums.push(found.chi_squared);
    }
    // What is found with more is no worse.
    assert!(sums.is_sorted_by(|a, b| b <= a), "{sums:?}");
}

/// It ends at the same place on any number of threads.
#[test]
fn a_budget_ends_at_the_same_place_on_all_threads() {
    let mut asked = request(base(LEAF, ""), &[&hopeless()], &THREE);
    asked.most_evaluations = Some(8);
    let found = [1, 2].map(|threads| on_threads(threads, || fit(&asked, &mut |_| {}).unwrap()));
    let values = found.map(|fit| {
        fit.parameters
            .iter()
            .map(|it| it.value.to_bits())
            .collect::<Vec<_>>()
    });
    assert_eq!(values[0], values[1]);
}

/// What a fit has found when its limit is reached is its result: values at which the sum of squares is no larger
/// than where it began.
#[test]
fn a_limit_that_is_reached_leaves_the_best_values() {
    for steps in [1, 2, 4] {
        let cancel = Arc::new(AtomicBool::new(false));
        let mut asked = request(base(LEAF, ""), &[&hopeless()], &THREE);
        asked.limit.cancel = Some(cancel.clone());
        let (mut sums, mut seen) = (Vec::new(), 0);
        let found = fit(&asked, &mut |step| {
            if step.budget.is_none() {
                sums.push(step.sum);
                seen += 1;
                cancel.store(seen >= steps, Ordering::Relaxed);
            }
        });
        let found = found.unwrap();
        assert_eq!(found.remarks[0], FitRemark::Stopped);
        assert_eq!(found.outcome, FitOutcome::NotConverged);
        let squares = found.residuals.iter().map(|it| it.residual.powi(2));
        let last: f64 = squares.sum();
        let slack = 1.0 + 1e-3;
        assert!(last <= slack * sums[0], "{last} {sums:?}");
        assert!((last - found.chi_squared).abs() <= 1e-9 * last);
    }
}

/// Where the limit is reached before any leaf is at rest there is nothing to tell.
#[test]
fn a_limit_that_is_reached_at_once_leaves_nothing() {
    let mut asked = request(base(LEAF, ""), &[&hopeless()], &THREE);
    asked.limit.cancel = Some(Arc::new(AtomicBool::new(true)));
    let refused = fit(&asked, &mut |_| {});
    assert!(matches!(refused, Err(FitError::NoEquilibrium(_))));
}
