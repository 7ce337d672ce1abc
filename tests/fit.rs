//! From made-up measurements back to the numbers that they were made with.

mod common;

use std::sync::atomic::{AtomicUsize, Ordering};

use leafdyn::study::{Base, Data, Fit, FitError, FitOutcome, FitRequest, Free, fit};

/// Leaves of the coverage; `LEAFDYN_LEAVES` in the environment asks for another number.
const LEAVES: usize = 200;

/// Normal numbers, always the same: sums of twelve even ones.
struct Noise(u64);

impl Noise {
    fn even(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// By Box's and Muller's formula.
    fn normal(&mut self) -> f64 {
        let (a, b) = (1.0 - self.even(), self.even());
        (-2.0 * a.ln()).sqrt() * (std::f64::consts::TAU * b).cos()
    }
}

const VEIN: &str = r#"
    name = "vein"
    leaf = { rods = 1, length = 1.0, fan = [0.0] }
    stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = 50.0, shear_2 = 40.0, shear_3 = 40.0 }
    load = { gravity = [0.0, 0.0, -0.5] }
    dynamics = { density = 1.0, rotary_inertia = 1e-4 }
"#;

const LEAF: &str = r#"
    name = "leaf"
    leaf = { rods = 5, length = 1.0, fan = "symmetric" }
    stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = 50.0, shear_2 = 40.0, shear_3 = 40.0 }
    coupling = { y = 1.0, z = 1.0 }
    load = { gravity = [0.0, 0.0, -1.0] }
"#;

fn base(text: &str, entries: &[&str]) -> Base {
    let entries: Vec<String> = entries.iter().map(|entry| entry.to_string()).collect();
    Base::of_text(text.into(), "leaf.toml".into(), &entries).unwrap()
}

fn request(base: Base, data: &[&str], free: &[&str]) -> FitRequest {
    let rods = base.scenario().rods.len();
    let mut all = Data::default();
    for (k, text) in data.iter().enumerate() {
        all.read(text, &format!("data{k}.csv"), rods).unwrap();
    }
    FitRequest {
        base,
        data: all,
        free: free.iter().map(|free| free.parse().unwrap()).collect(),
        robust: false,
        candidates: Vec::new(),
        tolerance: None,
        limit: Default::default(),
    }
}

fn fitted(request: &FitRequest) -> Fit {
    fit(request, &mut |_, _| {}).unwrap_or_else(|refused| panic!("{refused}"))
}

/// Tips of a leaf pulled by these forces, as a table with noise of a deviation.
fn pulls(text: &str, truth: &[&str], forces: &[[f64; 3]], sd: f64, noise: &mut Noise) -> String {
    let header = "load.tip_force[0],load.tip_force[1],load.tip_force[2],tip_x,tip_y,tip_z,sd_tip_x,sd_tip_y,sd_tip_z\n";
    let mut table = String::from(header);
    for force in forces {
        let load = format!("load.tip_force={force:?}");
        let entries: Vec<&str> = truth.iter().copied().chain([load.as_str()]).collect();
        let leaf = common::settle(base(text, &entries).scenario(), 1e-9);
        let tip = leaf.tips[0].to_array().map(|x| x + sd * noise.normal());
        let cells: Vec<String> = force
            .iter()
            .chain(&tip)
            .chain(&[sd; 3])
            .map(|x| format!("{x:?}"))
            .collect();
        table += &(cells.join(",") + "\n");
    }
    table
}

const PULLS: [[f64; 3]; 5] = [
    [1.0, 0.0, 0.0],
    [0.0, 0.6, 0.0],
    [0.0, 0.0, 0.8],
    [2.0, 0.5, -0.5],
    [-0.3, 0.2, 1.0],
];

/// Without noise the numbers come back to many digits, whether positions or
/// frequencies are given.
#[test]
fn exact_data_give_the_exact_numbers() {
    let truth = [
        "stiffness.bending_2=1.7",
        "stiffness.bending_3=0.6",
        "stiffness.axial=31",
    ];
    let data = pulls(VEIN, &truth, &PULLS, 1e-3, &mut Noise(1)).replace("NaN", "");
    let mut noise = Noise(1);
    let exact =
        pulls(VEIN, &truth, &PULLS, 0.0, &mut noise).replace(",0.0,0.0,0.0\n", ",1e-3,1e-3,1e-3\n");
    assert_ne!(data, exact);
    let free = [
        "stiffness.bending_2",
        "stiffness.bending_3",
        "stiffness.axial",
    ];
    let mut wanted = request(base(VEIN, &[]), &[&exact], &free);
    wanted.tolerance = Some(1e-8);
    let found = fitted(&wanted);
    assert_eq!(found.outcome, FitOutcome::Converged, "{:?}", found.remarks);
    for (parameter, value) in found.parameters.iter().zip([1.7, 0.6, 31.0]) {
        let error = (parameter.value / value - 1.0).abs();
        assert!(
            error < 1e-5,
            "{}: {} {value}",
            parameter.key,
            parameter.value
        );
    }
    assert!(found.chi_squared < 1e-6);
    // The scenario that is written is the fitted one.
    let again = base(&found.fitted, &[]);
    let bending = again.scenario().rods[0].couple_stiffness[1].at(0.5);
    assert_eq!(bending, found.parameters[0].value);
}

#[test]
fn frequencies_give_stiffness_and_mass() {
    let truth = base(
        VEIN,
        &["stiffness.bending_2=1.7", "stiffness.bending_3=0.6"],
    );
    let leaf = truth
        .scenario()
        .relaxation()
        .tolerance(1e-8)
        .modes(2)
        .run()
        .unwrap();
    let hertz = |k: usize| {
        let modes = leaf.stability.modes.as_ref().unwrap();
        modes[k].frequency().unwrap() / std::f64::consts::TAU
    };
    let data = format!("frequency_1,frequency_2\n{:?},{:?}\n", hertz(0), hertz(1));
    let free = ["stiffness.bending_2", "stiffness.bending_3"];
    let found = fitted(&request(
        base(VEIN, &["stiffness.bending_2=1.2"]),
        &[&data],
        &free,
    ));
    for (parameter, value) in found.parameters.iter().zip([1.7, 0.6]) {
        let error = (parameter.value / value - 1.0).abs();
        assert!(
            error < 1e-4,
            "{}: {} {value}",
            parameter.key,
            parameter.value
        );
    }
}

/// Traced veins, marked or not, of which a photograph gives two coordinates.
#[test]
fn traced_veins_give_stiffnesses() {
    let truth = base(LEAF, &["stiffness.bending_2=1.6", "coupling.z=2.5"]);
    let leaf = common::settle(truth.scenario(), 1e-9);
    let (mut marked, mut bare) = (String::from("rod,sigma,x,y,z\n"), String::from("rod,x,z\n"));
    for (j, rod) in leaf.shape.rods.iter().enumerate() {
        for (sigma, node) in leaf.shape.stations.iter().zip(&rod.nodes).skip(1) {
            let [x, y, z] = node.position.to_array();
            marked += &format!("{},{sigma:?},{x:?},{y:?},{z:?}\n", j + 1);
            bare += &format!("{},{x:?},{z:?}\n", j + 1);
        }
    }
    let free = ["stiffness.bending_2", "coupling.z"];
    for data in [marked, bare] {
        let found = fitted(&request(base(LEAF, &[]), &[&data], &free));
        assert_ne!(
            found.outcome,
            FitOutcome::NotConverged,
            "{:?}",
            found.remarks
        );
        for (parameter, value) in found.parameters.iter().zip([1.6, 2.5]) {
            let error = (parameter.value / value - 1.0).abs();
            assert!(
                error < 1e-3,
                "{}: {} {value}",
                parameter.key,
                parameter.value
            );
        }
    }
}

/// What no datum feels is named, alone or as a combination, and never given a
/// narrow interval.
#[test]
fn what_the_data_do_not_determine_is_named() {
    // In its plane a vein feels neither torsion nor bending out of it.
    let flat = VEIN.replace("[0.0, 0.0, -0.5]", "[0.0, 0.0, 0.0]");
    let forces = [[1.0, 0.3, 0.0], [0.5, 0.8, 0.0], [2.0, -0.4, 0.0]];
    let data = pulls(
        &flat,
        &["stiffness.bending_3=0.7"],
        &forces,
        1e-3,
        &mut Noise(3),
    );
    let free = [
        "stiffness.torsion",
        "stiffness.bending_2",
        "stiffness.bending_3",
    ];
    let found = fitted(&request(base(&flat, &[]), &[&data], &free));
    assert_eq!(found.outcome, FitOutcome::Undetermined);
    let named: Vec<Vec<&String>> = found
        .undetermined
        .iter()
        .map(|open| open.keys().collect())
        .collect();
    assert_eq!(named, [[free[0]], [free[1]]], "{:?}", found.says);
    for (parameter, known) in found.parameters.iter().zip([false, false, true]) {
        assert_eq!(parameter.determined, known, "{parameter:?}");
        assert_eq!(parameter.low.is_some() && parameter.high.is_some(), known);
    }
    // Of frequencies alone only the ratio of stiffness and mass is felt.
    let slender = VEIN.replace(
        "axial = 50.0, shear_2 = 40.0, shear_3 = 40.0",
        "axial = inf, shear_2 = inf, shear_3 = inf",
    );
    let slender = slender
        .replace("[0.0, 0.0, -0.5]", "[0.0, 0.0, 0.0]")
        .replace(", rotary_inertia = 1e-4", ", section_radius = 1e-2");
    let data = "frequency_1\n0.6\n0.61\n0.59\n";
    let free = [
        "stiffness.bending_2+stiffness.bending_3+stiffness.torsion",
        "dynamics.density",
    ];
    let found = fitted(&request(base(&slender, &[]), &[data], &free));
    assert_eq!(found.outcome, FitOutcome::Undetermined);
    let [open] = found.undetermined.as_slice() else {
        panic!("{:?}", found.undetermined);
    };
    assert!(
        open.values().all(|part| (part - 1.0).abs() < 1e-3),
        "{open:?}"
    );
    assert!(
        found
            .says
            .iter()
            .any(|said| said.contains("only as their ratio")),
        "{:?}",
        found.says
    );
}

/// True values lie inside the 95 % intervals in about 95 % of made-up leaves.
#[test]
fn intervals_cover_the_truth() {
    let leaves = std::env::var("LEAFDYN_LEAVES").ok();
    let leaves = leaves.and_then(|text| text.parse().ok()).unwrap_or(LEAVES);
    let (inside, all) = (AtomicUsize::new(0), AtomicUsize::new(0));
    for number in 0..leaves {
        let mut noise = Noise(number as u64 + 77);
        let values = [0; 3].map(|_| (1.6 * (noise.even() - 0.5)).exp());
        let names = [
            "stiffness.bending_2",
            "stiffness.bending_3",
            "stiffness.axial",
        ];
        let truth: Vec<String> = names
            .iter()
            .zip(values)
            .map(|(name, value)| {
                format!(
                    "{name}={:?}",
                    if name.ends_with("axial") {
                        20.0 * value
                    } else {
                        value
                    }
                )
            })
            .collect();
        let truth: Vec<&str> = truth.iter().map(String::as_str).collect();
        let known = number % 2 == 0;
        let mut data = pulls(VEIN, &truth, &PULLS, 3e-3, &mut noise);
        if !known {
            // The same without their deviations.
            let lines = data
                .lines()
                .map(|line| line.split(',').take(6).collect::<Vec<_>>().join(","));
            data = lines.collect::<Vec<_>>().join("\n");
        }
        let found = fitted(&request(
            base(VEIN, &["stiffness.axial=20.0"]),
            &[&data],
            &names,
        ));
        assert_ne!(
            found.outcome,
            FitOutcome::NotConverged,
            "{number}: {:?}",
            found.remarks
        );
        for (parameter, truth) in found.parameters.iter().zip(&truth) {
            let truth: f64 = truth.split('=').nth(1).unwrap().parse().unwrap();
            if let (true, Some(low), Some(high)) =
                (parameter.determined, parameter.low, parameter.high)
            {
                all.fetch_add(1, Ordering::Relaxed);
                inside.fetch_add(
                    usize::from((low..=high).contains(&truth)),
                    Ordering::Relaxed,
                );
            }
        }
    }
    let (inside, all) = (inside.into_inner() as f64, all.into_inner() as f64);
    println!("{inside} of {all} inside: {:.4}", inside / all);
    // Three standard deviations of the count, of which the numbers of a leaf are not
    // independent.
    let slack = 3.0 * (0.95 * 0.05 / (all / 3.0)).sqrt();
    assert!((inside / all - 0.95).abs() < slack, "{inside} of {all}");
}

#[test]
fn bad_data_are_explained() {
    let refused = |data: &str, free: &[&str]| {
        let base = base(LEAF, &[]);
        let mut all = Data::default();
        if let Err(refused) = all.read(data, "data.csv", 5) {
            return refused.to_string();
        }
        let free = free.iter().map(|free| free.parse::<Free>());
        let free = match free.collect::<Result<Vec<Free>, FitError>>() {
            Ok(free) => free,
            Err(refused) => return refused.to_string(),
        };
        let request = FitRequest {
            data: all,
            free,
            ..request(base, &[], &[])
        };
        fit(&request, &mut |_, _| {}).unwrap_err().to_string()
    };
    let good = "load.tip_force[2],tip_z\n-0.1,-0.2\n";
    let free = ["stiffness.bending_2"].as_slice();
    for (data, free, said) in [
        ("", free, "data.csv:1: is empty"),
        ("-0.1,-0.2\n", free, "data.csv:1: has no header"),
        ("tip_z\n", free, "no row below the header"),
        ("tip_z,tip_z\n1,2\n", free, "stands there twice"),
        (
            "load.tip_force[2],tip_w\n1,2\n",
            free,
            "unknown column tip_w",
        ),
        (
            "load.tip_forc[2],tip_z\n1,2\n",
            free,
            "did you mean load.tip_force?",
        ),
        ("tip_z,sd_tip_x\n1,2\n", free, "sd_tip_x without tip_x"),
        (
            "tip_z\nnan\n",
            free,
            "data.csv:2: tip_z = nan: must be a finite number",
        ),
        ("tip_z\n1;2\n", free, "must be a finite number"),
        (
            "# made up\ntip_z,tip_x\n1\n",
            free,
            "data.csv:3: has 1 cells, and the header 2",
        ),
        ("tip_z,sd_tip_z\n1,0\n", free, "is greater than 0"),
        (
            "load.tip_force[2],tip_z\n,1\n",
            free,
            "is empty: every experiment needs its value",
        ),
        ("rod,x,y\n6,1,1\n", free, "from 1 to 5"),
        ("rod,x,y,w\n1,1,1,1\n", free, "unknown column w"),
        ("rod,sigma,x\n1,1.5,1\n", free, "from 0 to 1"),
        ("rod,x\n1,1\n", free, "at least two of x, y, z"),
        (
            "rod,x,y,experiment\n1,1,1,third\n",
            free,
            "no row of an experiments file has that name",
        ),
        ("tip_z,frequency_1\n-0.2,1\n", free, "standard deviations"),
        (
            "tip_z,tip_x,sd_tip_x\n-0.2,1,0.1\n",
            free,
            "give all or none",
        ),
        ("load.tip_force[2],tip_z\n1e12,1\n", free, "data.csv:2"),
        (
            good,
            &["stiffness.bending_2", "stiffness.torsion"],
            "free fewer, or measure more",
        ),
        (
            good,
            &["stiffness.bending_2", "stiffness.bending_2"],
            "is free twice",
        ),
        (
            good,
            &["load.tip_force[2]"],
            "is set by the experiment, and free",
        ),
        (good, &["leaf.rods"], "whole number"),
        (good, &["stiffness.bendin_2"], "did you mean"),
        (good, &["stiffness.bending_2=3..2"], "LOW..HIGH"),
        (
            good,
            &["stiffness.bending_2=2..3"],
            "not between the bounds",
        ),
    ] {
        let refused = refused(data, free);
        assert!(refused.contains(said), "{data:?} {free:?}: {refused}");
    }
}
