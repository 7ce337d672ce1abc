//! The stated error covers the stations between those where a leaf was solved for, too:
//! of leaves whose profiles have knots, which leave few nodes between two of them.
//! `LEAFDYN_LEAVES` is how many are tried.

mod common;

use common::random::{drawn, leaves};
use common::*;

#[test]
fn stated_errors_cover_stations_between_few_nodes() {
    let count = asked("LEAFDYN_LEAVES", 60);
    let (mut judged, mut wrong) = (0, Vec::new());
    for (case, mut leaf) in drawn(leaves(), count).into_iter().enumerate() {
        for rod in &mut leaf.rods {
            rod.rest_curvature[1] = Profile::Constant(5.0);
        }
        let at_rest = |tolerance| relaxed(&leaf, &at_every_node(tolerance));
        let truth = at_rest(1e-11);
        for tolerance in [1e-4, 1e-6, 1e-8] {
            let found = at_rest(tolerance);
            if !(truth.outcome.is_success() && found.outcome.is_success()) {
                continue;
            }
            for parts in [None, Some(7), Some(13)] {
                let there = found.clone().at_stations(&leaf, parts);
                let exact = truth.clone().at_stations(&leaf, parts);
                let (error, told) = (distance(&there, &exact), estimate(&there));
                // Where there are several equilibria, each is one.
                if error < 0.01 {
                    judged += 1;
                    let what = format!("{case} at {tolerance:e}, {parts:?}: {error:e} of {told:e}");
                    wrong.extend((error > told + estimate(&exact)).then_some(what));
                }
            }
        }
    }
    println!("{} of {judged} too low", wrong.len());
    let enough = judged > 6 * count;
    assert!(enough && wrong.is_empty(), "{judged}: {wrong:#?}");
}
