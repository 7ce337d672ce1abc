//! A family of made-up measurements, each built to leave certain combinations of numbers
//! open: they are named exactly, and nothing else is; what is open has no interval.

use leafdyn::study::{Fit, FitOutcome};
use leafdyn_testing::fit::{self, VEIN, fitted, request};
use leafdyn_testing::random::Draw;
use leafdyn_testing::*;

/// Drawn leaves of each kind; `LEAFDYN_LEAVES` in the environment asks for more.
const DRAWN: usize = 6;

/// What is measured, which numbers are free, and which combinations stay open.
struct Built {
    text: String,
    /// Entries replaced.
    truth: String,
    /// So many tenths of the length are marked on the first rod.
    traced: usize,
    free: &'static str,
    /// Of numbers that only grow together, between `|`.
    open: &'static str,
}

/// A vein with these tables.
fn vein(stiffness: &str, tables: &str) -> String {
    format!(
        "name = \"vein\"\nleaf = {{ rods = 1, length = 1.0, fan = [0.0] }}\nstiffness = {{ {stiffness} }}\n{tables}\n"
    )
}

const PLAIN: &str =
    "torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = 40.0, shear_2 = 30.0, shear_3 = 30.0";
const INEXTENSIBLE: &str =
    "torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = inf, shear_2 = inf, shear_3 = inf";

/// What is built of two numbers about one.
fn kinds(a: f64, b: f64) -> [Built; 7] {
    let (weight, sheared) = ("load = { gravity = [0.0, -1.5, 0.0] }", 12.0 * b);
    let shears = INEXTENSIBLE.replace("shear_2 = inf", "shear_2 = 12.0");
    let knots = "rest = { bend_3 = { at = [0.0, 0.5, 0.75, 1.0], value = [0.5, 0.5, 0.5, 0.5] } }";
    let tip_force = |force: [f64; 3]| format!("load = {{ tip_force = {force:?} }}");
    [
        // In its plane a vein feels neither torsion nor what bends and shears it out of it.
        Built {
            text: vein(PLAIN, &tip_force([a, b, 0.0])),
            truth: format!("stiffness.bending_3={a:?}"),
            traced: 10,
            free: "stiffness.torsion stiffness.bending_2 stiffness.bending_3 stiffness.shear_3",
            open: "stiffness.torsion|stiffness.bending_2|stiffness.shear_3",
        },
        // Of a shape under a load only the ratio of stiffness and load is felt.
        Built {
            text: vein(INEXTENSIBLE, weight),
            truth: format!("stiffness.bending_3={a:?}; scale:load.gravity={b:?}"),
            traced: 10,
            free: "stiffness.bending_3 scale:load.gravity",
            open: "stiffness.bending_3 scale:load.gravity",
        },
        // The same with a shear stiffness beside it: all three grow together.
        Built {
            text: vein(&shears, weight),
            truth: format!("stiffness.bending_3={a:?}; stiffness.shear_2={sheared:?}"),
            traced: 10,
            free: "stiffness.bending_3 stiffness.shear_2 scale:load.gravity",
            open: "stiffness.bending_3 stiffness.shear_2 scale:load.gravity",
        },
        // Without loads a shape says nothing of knots beyond the last point on it.
        Built {
            text: vein(PLAIN, knots),
            truth: format!("rest.bend_3.value=[{a:?}, {b:?}, 0.5, 0.5]"),
            traced: 5,
            free: "rest.bend_3",
            open: "rest.bend_3.value[2]|rest.bend_3.value[3]",
        },
        // A shape without loads says nothing of any stiffness.
        Built {
            text: vein(PLAIN, "rest = { bend_2 = 0.4, twist = 0.2 }"),
            truth: format!("rest.bend_2={a:?}; rest.twist={b:?}"),
            traced: 10,
            free: "rest.bend_2 rest.twist stiffness.bending_2 stiffness.axial",
            open: "stiffness.bending_2|stiffness.axial",
        },
        // A straight vein that is pulled along itself feels its axial stiffness alone.
        Built {
            text: vein(PLAIN, &tip_force([4.0 * b, 0.0, 0.0])),
            truth: format!("stiffness.axial={:?}", 40.0 * a),
            traced: 10,
            free: "stiffness.axial stiffness.bending_2 stiffness.shear_2 rest.twist",
            open: "stiffness.bending_2|stiffness.shear_2|rest.twist",
        },
        // One vein says nothing of another that it neither meets nor is coupled to.
        Built {
            text: vein(PLAIN, "load = { gravity = [0.0, 0.0, -2.0] }")
                .replace("rods = 1", "rods = 2, joined = false")
                .replace("fan = [0.0]", "fan = [-0.3, 0.3]")
                .replace("bending_2 = 1.0", "bending_2 = [1.0, 1.0]"),
            truth: format!("stiffness.bending_2=[{a:?}, {b:?}]"),
            traced: 10,
            free: "stiffness.bending_2",
            open: "stiffness.bending_2[1]",
        },
    ]
}

/// Points on the first rod, marked, with noise.
fn traced(built: &Built, noise: &mut Draw) -> String {
    let base = base(&built.text, &built.truth);
    let leaf = settle(base.scenario(), 1e-9).at_stations(base.scenario(), Some(20));
    let (table, _) = fit::traced(&leaf, [1, 2], "rod,sigma,x,y,z,sd", 1e-4, noise);
    // The header, and so many points.
    let lines: Vec<&str> = table.lines().take(1 + built.traced).collect();
    lines.join("\n")
}

#[test]
fn all_that_is_open_is_named_and_nothing_else() {
    let drawn = asked("LEAFDYN_LEAVES", DRAWN);
    for kind in 0..7 {
        for number in 0..drawn {
            let mut noise = Draw((1000 * kind + number) as u64);
            let [a, b] = [0.7 + 0.8 * noise.even(), 0.7 + 0.8 * noise.even()];
            let built = &kinds(a, b)[kind];
            let data = traced(built, &mut noise);
            let free: Vec<&str> = built.free.split(' ').collect();
            let found = fitted(&request(base(&built.text, ""), &[&data], &free));
            let (says, remarks) = (&found.says, &found.remarks);
            let said = format!("kind {kind}, {number}: {says:?} {remarks:?}");
            assert_eq!(found.outcome, FitOutcome::Undetermined, "{said}");
            let open = built.open.split('|').map(|of| of.split(' ').collect());
            let open: Vec<Vec<&str>> = open.collect();
            assert_eq!(found.undetermined.len(), open.len(), "{said}");
            for keys in &open {
                let alike = found.undetermined.iter().any(|named| {
                    let one = |part: &f64| (part - 1.0).abs() < 1e-2;
                    let together = |key: &&str| named.get(*key).is_some_and(one);
                    named.len() == keys.len() && keys.iter().all(together)
                });
                assert!(alike, "{keys:?} is not named; {said}");
            }
            for parameter in &found.parameters {
                let open = open.concat().contains(&parameter.key.as_str());
                assert_eq!(parameter.determined, !open, "{parameter:?}; {said}");
                // Never an interval for what is not known, always for what is.
                let bounded = parameter.low.is_some() && parameter.high.is_some();
                assert_eq!(bounded, !open, "{parameter:?}; {said}");
            }
        }
    }
}

/// Of frequencies alone only the ratio of stiffness and mass is felt.
#[test]
fn a_ratio_that_alone_is_felt_is_named() {
    let flat = VEIN.replace("[0.0, 0.0, -0.5]", "[0.0, 0.0, 0.0]");
    let slender = flat.replace(", rotary_inertia = 1e-4", ", section_radius = 1e-2");
    let data = "frequency_1\n0.6\n0.61\n0.59\n";
    let stiffness = "stiffness.bending_2+stiffness.bending_3+stiffness.torsion";
    let free = [stiffness, "dynamics.density"];
    let found = fitted(&request(base(&slender, RIGID), &[data], &free));
    assert_eq!(found.outcome, FitOutcome::Undetermined);
    let open = only(&found.undetermined);
    let mut parts = open.values();
    assert!(parts.all(|part| (part - 1.0).abs() < 1e-3), "{open:?}");
    let mut says = found.says.iter();
    assert!(says.any(|said| said.contains("only as their ratio")));
}

/// Three joined veins, and the lowest frequencies of a made-up one with bending stiffness 1.281
/// across the leaf under five pulls, with noise.
const RINGING: &str = r#"
    name = "ringing"
    leaf = { rods = 3, length = 1.0, fan = "symmetric" }
    stiffness = { torsion = 1.885, bending_2 = 1.507, bending_3 = 0.445, axial = 165.4, shear_2 = 100.0, shear_3 = 100.0 }
    coupling = { y = 4.238, z = 0.661 }
    load = { gravity = [0.0, -0.03, -0.89] }
    dynamics = { density = 0.7 }
"#;
const FREQUENCIES: &str = "load.tip_force[0],frequency_1,frequency_2,frequency_3
0.0,0.4913542932914,0.7237230048205472,1.50904748889789
1.0,0.5460825914918956,0.7576869867734115,1.568396611715732
2.0,0.5869013294112391,0.7832734382514106,1.6230542811572153
4.0,0.6525754052635092,0.8366233333740479,1.7165995344818712
6.0,0.7108733535713316,0.8901916261439116,1.8137669025548808
";

/// The torsional stiffness runs away. An end of the other number's interval is where the least
/// sum of squares is that of an end, even if the torsional stiffness has to come back for it.
#[test]
fn a_number_that_ran_away_narrows_no_interval() {
    let numbers = ["stiffness.torsion", "stiffness.bending_2"];
    let found = fitted(&request(base(RINGING, ""), &[FREQUENCIES], &numbers));
    let [torsion, bending] = [0, 1].map(|k| &found.parameters[k]);
    assert!(!torsion.determined && torsion.value > 1e3, "{torsion:?}");
    let sum = |fit: &Fit| fit.degrees_of_freedom as f64 * fit.standard_deviation.unwrap().powi(2);
    // Student's quantile for 13 degrees of freedom.
    assert_eq!(found.degrees_of_freedom, 13);
    let limit = sum(&found) * (1.0 + 2.160_f64.powi(2) / 13.0);
    let high = bending.high.unwrap();
    assert!(bending.low.unwrap() < 1.23 && high > 1.281, "{bending:?}");
    for (part, inside) in [(0.5, true), (0.96, true), (1.04, false)] {
        let held = bending.value + part * (high - bending.value);
        let begin = base(RINGING, &format!("stiffness.bending_2={held:?}"));
        let least = sum(&fitted(&request(begin, &[FREQUENCIES], &numbers[..1])));
        assert_eq!(least < limit, inside, "{least:e}, {limit:e} at {held}");
    }
}
