//! What a fit costs, in work that does not depend on the machine, and that it does not
//! depend on the number of threads.

mod common;

use common::fit::{LEAF, Noise, base, pulls, request};
use leafdyn::study::{Fit, fit};

const FREE: [&str; 3] = [
    "stiffness.bending_2",
    "stiffness.bending_3",
    "stiffness.axial",
];

fn on(threads: usize) -> Fit {
    let truth = [
        "stiffness.bending_2=1.4",
        "stiffness.bending_3=0.7",
        "stiffness.axial=40",
    ];
    let forces: Vec<[f64; 3]> = (0..10)
        .map(|k| {
            [
                1.0 + k as f64,
                0.5 * (k as f64 - 4.0),
                0.7 * (k as f64).cos(),
            ]
        })
        .collect();
    let data = pulls(LEAF, &truth, &forces, 5e-4, &mut Noise(2));
    let asked = request(base(LEAF, &[]), &[&data], &FREE);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
    let pool = pool.build().unwrap();
    pool.install(|| fit(&asked, &mut |_, _| {}).unwrap())
}

/// The search is one of a few steps on coarse grids; all grids are used for the first
/// leaf and for no more than two steps at the end.
#[test]
fn few_evaluations_are_accurate() {
    let found = on(2);
    assert!(found.is_success(), "{:?}", found.remarks);
    let work = found.work;
    println!("{work:?}");
    assert!(work.accurate <= 3, "{work:?}");
    assert!(work.evaluations <= 10, "{work:?}");
    // Of ten leaves at the minimum.
    assert!(work.last.factorizations <= 60, "{work:?}");
}

#[test]
fn threads_change_no_bit() {
    let text = |fit: Fit| {
        let found = serde_json::to_value(&fit).unwrap();
        let mut found = found.as_object().unwrap().clone();
        found.remove("wall_seconds");
        format!("{found:?}{}", fit.fitted)
    };
    assert_eq!(text(on(1)), text(on(2)));
}
