//! What a fit costs, in work that does not depend on the machine, and that it does not
//! depend on the number of threads.

use leafdyn::study::{Fit, fit};
use leafdyn_testing::fit::{self, LEAF, THREE, fitted, pulls, request, within_bars};
use leafdyn_testing::random::Draw;
use leafdyn_testing::*;

fn on(threads: usize) -> Fit {
    let truth = "stiffness.bending_2=1.4; stiffness.bending_3=0.7; stiffness.axial=40";
    let forces = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0_f64];
    let forces = forces.map(|k| [1.0 + k, 0.5 * (k - 4.0), 0.7 * k.cos()]);
    let data = pulls(LEAF, truth, &forces, 5e-4, &mut Draw(2));
    let asked = request(base(LEAF, ""), &[&data], &THREE);
    on_threads(threads, || fit(&asked, &mut |_| {}).unwrap())
}

/// The search is one of a few steps on coarse grids; all grids are used for the first
/// leaf and for no more than two steps at the end.
#[test]
fn few_evaluations_are_accurate() {
    let found = on(2);
    assert!(found.is_success(), "{:?}", found.remarks);
    let work = found.work;
    assert!(work.accurate <= 3, "{work:?}");
    assert!(work.evaluations <= 10, "{work:?}");
    // Of ten leaves at the minimum.
    assert!(work.last.factorizations <= 60, "{work:?}");
}

/// Twenty numbers, ten pulls and twenty points on each of 21 veins: the search has the same
/// few steps, and the ends of intervals that the curvature has right are looked at once.
#[test]
fn twenty_numbers_of_a_large_leaf_take_few_evaluations() {
    let ones = vec!["1.0"; 21].join(", ");
    let text = LEAF
        .replace("rods = 5", "rods = 21")
        .replace("bending_2 = 1.0", &format!("bending_2 = [{ones}]"));
    let mut noise = Draw(4);
    let mut values: Vec<f64> = (0..19).map(|_| 0.7 + 0.8 * noise.even()).collect();
    values.extend([1.0, 1.0]);
    let truth = format!("stiffness.bending_2={values:?}; stiffness.axial=40");
    let forces = [[0.0, 0.5, 0.5]; 10].map(|less| less.map(|less| 20.0 * (noise.even() - less)));
    let sd = 5e-5;
    let pulled = pulls(&text, &truth, &forces, sd, &mut noise);
    let known = base(&text, &truth);
    let leaf = settle(known.scenario(), 1e-8).at_stations(known.scenario(), Some(20));
    let (traced, _) = fit::traced(&leaf, [21, 1], "rod,x,y,z,sd", sd, &mut noise);
    let bending = (0..19).map(|j| format!("stiffness.bending_2[{j}]"));
    let free: Vec<String> = bending.chain(["stiffness.axial".into()]).collect();
    let free: Vec<&str> = free.iter().map(String::as_str).collect();
    let found = fitted(&request(base(&text, ""), &[&pulled, &traced], &free));
    assert!(found.is_success(), "{:?}", found.remarks);
    assert!(found.work.evaluations <= 12, "{:?}", found.work);
    assert!(found.work.accurate <= 4, "{:?}", found.work);
    within_bars(&found, &[&values[..19], &[40.0]].concat(), 2.5);
}

/// Pulls that are measured again and again are one leaf each, and rows stay in their order.
#[test]
fn equal_experiments_share_a_leaf() {
    let header = "load.tip_force[2],tip_z,frequency_1,sd_tip_z,sd_frequency_1\n";
    let pulls = "0.5,-0.11,,0.01,\n1.0,-0.05,,0.01,\n0.5,,0.3,,0.1\n";
    let asked = |count: usize| {
        let data = header.to_string() + &pulls.repeat(count);
        fitted(&request(base(LEAF, ""), &[&data], &THREE[..1]))
    };
    let [once, often] = [1, 5_000].map(asked);
    let last = [&once, &often].map(|fit| fit.work.last.factorizations);
    assert_eq!(last[0], last[1]);
    let values = [&once, &often].map(|fit| fit.parameters[0].value);
    close("bending", values[0], values[1], 1e-3);
    assert_eq!(often.residuals.len(), 15_000);
    for (row, residual) in often.residuals.iter().enumerate() {
        assert_eq!(residual.experiment, (row + 1).to_string());
        assert_eq!(residual.data, [-0.11, -0.05, 0.3][row % 3]);
    }
}

#[test]
fn threads_change_no_bit() {
    let text = |fit: Fit| {
        let mut found = serde_json::to_value(&fit).unwrap();
        found["wall_seconds"].take();
        format!("{found}{}", fit.fitted)
    };
    assert_eq!(text(on(1)), text(on(2)));
}
