//! What the derivatives of a leaf at rest cost, as parts of its relaxation: Fig. 4's
//! leaf with 21 veins, ten numbers of it. One thread, in process:
//! `cargo bench --bench sensitivity`. Relaxations with and without derivatives run in
//! turns, and the medians are printed.

use leafdyn::relax::{Options, relax};
use leafdyn::study::{BaseScenario, ParameterKeys, relax_with_sensitivities};
use leafdyn_testing::bench::{median, on_one_thread, print_head, to};
use std::time::Instant;

const TURNS: usize = 101;
const TOLERANCES: [f64; 3] = [1e-4, 1e-6, 1e-8];

/// Of all kinds: stiffnesses, couplings, loads, rest shape.
const KEYS: [&str; 10] = [
    "stiffness.torsion",
    "stiffness.bending_2",
    "stiffness.bending_3",
    "stiffness.axial",
    "stiffness.shear_2",
    "stiffness.shear_3",
    "coupling.y",
    "coupling.z",
    "load.gravity[2]",
    "rest.bend_2",
];

fn main() {
    on_one_thread();
    let keys = KEYS.map(|key| key.parse::<ParameterKeys>().expect("a key"));
    let text = std::fs::read_to_string("scenarios/paper/fig04.toml");
    let text = text.expect("the scenario is there");
    let rods = ["leaf.rods=21".to_string(), "rest.bend_2=0.0".to_string()];
    let base = BaseScenario::from_text(text, "fig04.toml".into(), &rods).expect("it is valid");
    println!(
        "N = 21, ten numbers. Milliseconds, medians of {TURNS}; the last column is what one number costs, as a part of the relaxation\n"
    );
    print_head("tolerance | modes | relaxation | with ten derivatives | one of them");
    for modes in [0, 3] {
        for tolerance in TOLERANCES {
            let options = Options {
                modes,
                ..to(tolerance)
            };
            let [alone, with] = medians([
                &mut || {
                    let leaf = relax(base.scenario(), &options, &mut |_| {}).unwrap();
                    assert!(leaf.outcome.is_success());
                },
                &mut || {
                    let leaf =
                        relax_with_sensitivities(&base, &keys, &options, &mut |_| {}).unwrap();
                    assert_eq!(leaf.sensitivities.map(|all| all.len()), Some(keys.len()));
                },
            ]);
            let part = (with - alone) / (keys.len() as f64 * alone);
            let [alone, with] = [1e3 * alone, 1e3 * with];
            println!("| {tolerance:e} | {modes} | {alone:.2} | {with:.2} | {part:.3} |");
        }
    }
}

/// Medians of the times that both take, in turns.
fn medians(mut both: [&mut dyn FnMut(); 2]) -> [f64; 2] {
    let mut times = [Vec::new(), Vec::new()];
    for _ in 0..TURNS {
        for (run, times) in both.iter_mut().zip(&mut times) {
            let clock = Instant::now();
            run();
            times.push(clock.elapsed().as_secs_f64());
        }
    }
    times.map(|mut times| median(&mut times))
}
