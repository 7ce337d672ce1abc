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
    pool.install(|| fit(&asked, &mut |_| {}).unwrap())
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

/// Twenty numbers, ten pulls and twenty points on each of 21 veins: the search has the same
/// few steps, and the ends of intervals that the curvature has right are looked at once.
#[test]
fn twenty_numbers_of_a_large_leaf_take_few_evaluations() {
    let ones = vec!["1.0"; 21].join(", ");
    let text = LEAF
        .replace("rods = 5", "rods = 21")
        .replace("bending_2 = 1.0", &format!("bending_2 = [{ones}]"));
    let mut noise = Noise(4);
    let mut values: Vec<f64> = (0..19).map(|_| 0.7 + 0.8 * noise.even()).collect();
    values.extend([1.0, 1.0]);
    let truth = [
        format!("stiffness.bending_2={values:?}"),
        "stiffness.axial=40".into(),
    ];
    let truth: Vec<&str> = truth.iter().map(String::as_str).collect();
    let forces: Vec<[f64; 3]> = (0..10)
        .map(|_| {
            [
                20.0 * noise.even(),
                20.0 * (noise.even() - 0.5),
                20.0 * (noise.even() - 0.5),
            ]
        })
        .collect();
    let sd = 5e-5;
    let pulled = pulls(&text, &truth, &forces, sd, &mut noise);
    let known = base(&text, &truth);
    let leaf = common::settle(known.scenario(), 1e-8).at_stations(known.scenario(), Some(20));
    let mut traced = String::from("rod,x,y,z,sd\n");
    for (j, rod) in leaf.shape.rods.iter().enumerate() {
        for node in &rod.nodes[1..] {
            let [x, y, z] = node.position.to_array().map(|x| x + sd * noise.normal());
            traced += &format!("{},{x:?},{y:?},{z:?},{sd:?}\n", j + 1);
        }
    }
    let free: Vec<String> = (0..19)
        .map(|j| format!("stiffness.bending_2[{j}]"))
        .chain(["stiffness.axial".into()])
        .collect();
    let free: Vec<&str> = free.iter().map(String::as_str).collect();
    let found = fit(
        &request(base(&text, &[]), &[&pulled, &traced], &free),
        &mut |_| {},
    )
    .unwrap();
    println!("{:?} in {} s", found.work, found.wall_seconds);
    assert!(found.is_success(), "{:?}", found.remarks);
    assert!(found.work.evaluations <= 12, "{:?}", found.work);
    assert!(found.work.accurate <= 4, "{:?}", found.work);
    let values = values.iter().take(19).chain(&[40.0]);
    for (parameter, value) in found.parameters.iter().zip(values) {
        let half = 0.5 * (parameter.high.unwrap() - parameter.low.unwrap());
        assert!(
            (parameter.value - value).abs() < 2.5 * half,
            "{parameter:?} {value}"
        );
    }
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
