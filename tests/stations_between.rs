//! The stated error covers the stations between those where a leaf was solved for, too:
//! of leaves whose profiles have knots, which leave few nodes between two of them.
//! `LEAFDYN_LEAVES` is how many are tried.

mod common;

use common::random::{drawn, leaves};
use common::{distance, relaxed, to};
use leafdyn::relax::Options;
use leafdyn::scenario::Profile;

#[test]
fn stated_errors_cover_stations_between_few_nodes() {
    let count = std::env::var("LEAFDYN_LEAVES").ok();
    let count = count.and_then(|count| count.parse().ok()).unwrap_or(60);
    let (mut judged, mut wrong) = (0, Vec::new());
    for (case, mut leaf) in drawn(leaves(), count).into_iter().enumerate() {
        for rod in &mut leaf.rods {
            rod.rest_curvature[1] = Profile::Constant(5.0);
        }
        let at_rest = |tolerance| {
            let options = Options {
                every_node: true,
                ..to(tolerance)
            };
            relaxed(&leaf, &options)
        };
        let truth = at_rest(1e-11);
        for tolerance in [1e-4, 1e-6, 1e-8] {
            let found = at_rest(tolerance);
            if !(truth.outcome.is_success() && found.outcome.is_success()) {
                continue;
            }
            for parts in [None, Some(7), Some(13)] {
                let [there, exact] =
                    [&found, &truth].map(|rest| rest.clone().at_stations(&leaf, parts));
                let [estimate, uncertain] =
                    [&there, &exact].map(|rest| rest.accuracy.error_estimate.unwrap());
                let error = distance(&there, &exact);
                // Where there are several equilibria, each is one.
                if error < 0.01 {
                    judged += 1;
                    let what = format!(
                        "{case} at {tolerance:e}, {parts:?}: {error:.1e}, stated {estimate:.1e}"
                    );
                    wrong.extend((error > estimate + uncertain).then_some(what));
                }
            }
        }
    }
    println!("{} of {judged} too low", wrong.len());
    assert!(
        judged > 6 * count && wrong.is_empty(),
        "{judged}: {wrong:#?}"
    );
}
