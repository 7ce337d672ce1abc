//! True values lie inside the intervals as often as these say.

use leafdyn::study::FitOutcome;
use leafdyn_testing::fit::{PULLS, THREE, VEIN, fitted, pulls, request};
use leafdyn_testing::random::Draw;
use leafdyn_testing::*;
use rayon::prelude::*;

/// Leaves that are fitted for three numbers and for six, which take longer;
/// `LEAFDYN_LEAVES` in the environment asks for more.
const OF_THREE: usize = 200;
const OF_SIX: usize = 40;

/// More pulls, of a testing machine that turns: bending, torsion and shear are all felt.
const MORE: [[f64; 3]; 7] = [
    [0.0, 3.0, 3.0],
    [0.0, -4.0, 6.0],
    [8.0, 4.0, 0.0],
    [8.0, 0.0, 5.0],
    [20.0, 0.0, 0.0],
    [0.0, 8.0, -2.0],
    [3.0, -6.0, 6.0],
];

/// Of numbers that are determined: how many of made-up leaves lie inside, how many
/// are determined, how many were asked for; and how many fits do not end at a minimum, and
/// say so.
fn covered(names: &[(&str, f64)], forces: &[[f64; 3]], otherwise: usize) -> [usize; 4] {
    let sd = 3e-3;
    let leaves = asked("LEAFDYN_LEAVES", otherwise);
    let (free, middles): (Vec<&str>, Vec<f64>) = names.iter().copied().unzip();
    let set = |values: &[f64]| {
        let entries = free.iter().zip(values);
        let entries = entries.map(|(name, value)| format!("{name}={value:?}"));
        entries.collect::<Vec<_>>().join("; ")
    };
    let one = |number: usize| -> [usize; 4] {
        let mut noise = Draw(1_000_000 * number as u64 + 77);
        let mut drawn = |middle: f64| middle * (1.6 * (noise.even() - 0.5)).exp();
        let values: Vec<f64> = middles.iter().map(|middle| drawn(*middle)).collect();
        let mut data = pulls(VEIN, &set(&values), forces, sd, &mut noise);
        if number % 2 == 1 {
            // The same without their deviations.
            let line = |line: &str| line.split(',').take(6).collect::<Vec<_>>().join(",");
            data = data.lines().map(line).collect::<Vec<_>>().join("\n");
        }
        let found = fitted(&request(base(VEIN, &set(&middles)), &[&data], &free));
        let mut counts = [0; 4];
        if found.outcome == FitOutcome::NotConverged {
            println!("{number}: {:?}", found.remarks);
            counts[3] = 1;
        }
        for (parameter, truth) in found.parameters.iter().zip(values) {
            counts[2] += 1;
            let ends = parameter.low.zip(parameter.high);
            if let Some((low, high)) = ends.filter(|_| parameter.determined) {
                counts[1] += 1;
                counts[0] += usize::from((low..=high).contains(&truth));
            }
        }
        counts
    };
    let all = (0..leaves).into_par_iter().map(one);
    all.reduce(|| [0; 4], |a, b| [0, 1, 2, 3].map(|k| a[k] + b[k]))
}

/// Of so many leaves one fit may get no farther than where a leaf has to jump.
const ONE_LOST_OF: usize = 200;

fn check([inside, all, asked, lost]: [usize; 4], numbers: usize) {
    let part = inside as f64 / all as f64;
    println!("{inside} of {all} inside: {part:.4}; {asked} asked for");
    println!("{lost} fits without a minimum");
    assert!(lost * ONE_LOST_OF * numbers <= asked, "{lost} fits");
    // Of few leaves three standard deviations of the count; numbers of one leaf are not
    // independent.
    let slack = 3.0 * (0.95 * 0.05 * numbers as f64 / all as f64).sqrt();
    assert!((part - 0.95).abs() < slack.max(0.02), "{inside} of {all}");
}

#[test]
fn three_numbers() {
    let names: Vec<_> = THREE.into_iter().zip([1.0, 1.0, 20.0]).collect();
    check(covered(&names, &PULLS, OF_THREE), 3);
}

/// Some of them are felt little: intervals are long, and the sum of squares is not
/// that of its curvature.
#[test]
fn six_numbers() {
    let names = [
        ("stiffness.torsion", 1.0),
        ("stiffness.bending_2", 1.0),
        ("stiffness.bending_3", 1.0),
        ("stiffness.axial", 40.0),
        ("stiffness.shear_2", 30.0),
        ("stiffness.shear_3", 30.0),
    ];
    let many = [&PULLS[..], &MORE].concat();
    check(covered(&names, &many, OF_SIX), 6);
}
