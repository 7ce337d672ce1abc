//! A family of made-up measurements, each built to leave certain combinations of numbers
//! open: they are named exactly, and nothing else is.

mod common;

use common::fit::{Noise, base, fitted, request};
use leafdyn::study::FitOutcome;

/// Drawn leaves of each kind; `LEAFDYN_LEAVES` in the environment asks for more.
const DRAWN: u64 = 6;

/// What is measured, which numbers are free, and which combinations stay open.
struct Built {
    text: String,
    truth: Vec<String>,
    /// Fractions of the length that were marked on the rod of this number, from 1.
    traced: (usize, Vec<f64>),
    free: Vec<&'static str>,
    open: Vec<Vec<(&'static str, f64)>>,
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

fn everywhere() -> Vec<f64> {
    (1..=10).map(|k| 0.1 * f64::from(k)).collect()
}

/// In its plane a vein feels neither torsion nor what bends and shears it out of it.
fn planar(a: f64, b: f64) -> Built {
    let force = format!("load = {{ tip_force = [{a:?}, {b:?}, 0.0] }}");
    Built {
        text: vein(PLAIN, &force),
        truth: vec![format!("stiffness.bending_3={a:?}")],
        traced: (1, everywhere()),
        free: vec![
            "stiffness.torsion",
            "stiffness.bending_2",
            "stiffness.bending_3",
            "stiffness.shear_3",
        ],
        open: vec![
            vec![("stiffness.torsion", 1.0)],
            vec![("stiffness.bending_2", 1.0)],
            vec![("stiffness.shear_3", 1.0)],
        ],
    }
}

/// Of a shape under a load only the ratio of stiffness and load is felt.
fn load_over_stiffness(a: f64, b: f64) -> Built {
    Built {
        text: vein(INEXTENSIBLE, "load = { gravity = [0.0, -1.5, 0.0] }"),
        truth: vec![
            format!("stiffness.bending_3={a:?}"),
            format!("scale:load.gravity={b:?}"),
        ],
        traced: (1, everywhere()),
        free: vec!["stiffness.bending_3", "scale:load.gravity"],
        open: vec![vec![
            ("stiffness.bending_3", 1.0),
            ("scale:load.gravity", 1.0),
        ]],
    }
}

/// The same with a shear stiffness beside it: all three grow together.
fn all_in_proportion(a: f64, b: f64) -> Built {
    let text = INEXTENSIBLE.replace("shear_2 = inf", "shear_2 = 12.0");
    Built {
        text: vein(&text, "load = { gravity = [0.0, -1.5, 0.0] }"),
        truth: vec![
            format!("stiffness.bending_3={a:?}"),
            format!("stiffness.shear_2={:?}", 12.0 * b),
        ],
        traced: (1, everywhere()),
        free: vec![
            "stiffness.bending_3",
            "stiffness.shear_2",
            "scale:load.gravity",
        ],
        open: vec![vec![
            ("stiffness.bending_3", 1.0),
            ("stiffness.shear_2", 1.0),
            ("scale:load.gravity", 1.0),
        ]],
    }
}

/// Without loads a shape says nothing of knots beyond the last point on it.
fn knots_beyond(a: f64, b: f64) -> Built {
    let rest = "rest = { bend_3 = { at = [0.0, 0.5, 0.75, 1.0], value = [0.5, 0.5, 0.5, 0.5] } }";
    Built {
        text: vein(PLAIN, rest),
        truth: vec![format!("rest.bend_3.value=[{a:?}, {b:?}, 0.5, 0.5]")],
        traced: (1, (1..=5).map(|k| 0.1 * f64::from(k)).collect()),
        free: vec!["rest.bend_3"],
        open: vec![
            vec![("rest.bend_3.value[2]", 1.0)],
            vec![("rest.bend_3.value[3]", 1.0)],
        ],
    }
}

/// A shape without loads says nothing of any stiffness.
fn unloaded(a: f64, b: f64) -> Built {
    Built {
        text: vein(PLAIN, "rest = { bend_2 = 0.4, twist = 0.2 }"),
        truth: vec![format!("rest.bend_2={a:?}"), format!("rest.twist={b:?}")],
        traced: (1, everywhere()),
        free: vec![
            "rest.bend_2",
            "rest.twist",
            "stiffness.bending_2",
            "stiffness.axial",
        ],
        open: vec![
            vec![("stiffness.bending_2", 1.0)],
            vec![("stiffness.axial", 1.0)],
        ],
    }
}

/// A straight vein that is pulled along itself feels its axial stiffness alone.
fn along(a: f64, b: f64) -> Built {
    let force = format!("load = {{ tip_force = [{:?}, 0.0, 0.0] }}", 4.0 * b);
    Built {
        text: vein(PLAIN, &force),
        truth: vec![format!("stiffness.axial={:?}", 40.0 * a)],
        traced: (1, everywhere()),
        free: vec![
            "stiffness.axial",
            "stiffness.bending_2",
            "stiffness.shear_2",
            "rest.twist",
        ],
        open: vec![
            vec![("stiffness.bending_2", 1.0)],
            vec![("stiffness.shear_2", 1.0)],
            vec![("rest.twist", 1.0)],
        ],
    }
}

/// One vein says nothing of another that it neither meets nor is coupled to.
fn other_vein(a: f64, b: f64) -> Built {
    Built {
        text: "name = \"two\"\nleaf = { rods = 2, length = 1.0, fan = [-0.3, 0.3], joined = false }\nstiffness = { torsion = 1.0, bending_2 = [1.0, 1.0], bending_3 = 1.0, axial = 40.0, shear_2 = 30.0, shear_3 = 30.0 }\nload = { gravity = [0.0, 0.0, -2.0] }\n"
            .into(),
        truth: vec![format!("stiffness.bending_2=[{a:?}, {b:?}]")],
        traced: (1, everywhere()),
        free: vec!["stiffness.bending_2"],
        open: vec![vec![("stiffness.bending_2[1]", 1.0)]],
    }
}

/// Points on the rod, marked, with noise.
fn traced(built: &Built, noise: &mut Noise) -> String {
    let truth: Vec<&str> = built.truth.iter().map(String::as_str).collect();
    let base = base(&built.text, &truth);
    let leaf = common::settle(base.scenario(), 1e-9).at_stations(base.scenario(), Some(20));
    let (rod, sigmas) = &built.traced;
    let mut table = String::from("rod,sigma,x,y,z,sd\n");
    for sigma in sigmas {
        let station = (20.0 * sigma).round() as usize;
        let place = leaf.shape.rods[rod - 1].nodes[station].position;
        let [x, y, z] = place.to_array().map(|x| x + 1e-4 * noise.normal());
        table += &format!("{rod},{sigma:?},{x:?},{y:?},{z:?},1e-4\n");
    }
    table
}

#[test]
fn all_that_is_open_is_named_and_nothing_else() {
    let kinds: [fn(f64, f64) -> Built; 7] = [
        planar,
        load_over_stiffness,
        all_in_proportion,
        knots_beyond,
        unloaded,
        along,
        other_vein,
    ];
    let drawn = std::env::var("LEAFDYN_LEAVES").ok();
    let drawn = drawn.and_then(|text| text.parse().ok()).unwrap_or(DRAWN);
    for (kind, built) in kinds.into_iter().enumerate() {
        for number in 0..drawn {
            let mut noise = Noise(1000 * kind as u64 + number);
            let [a, b] = [0.7 + 0.8 * noise.even(), 0.7 + 0.8 * noise.even()];
            let built = built(a, b);
            let data = traced(&built, &mut noise);
            let found = fitted(&request(base(&built.text, &[]), &[&data], &built.free));
            let said = format!(
                "kind {kind}, {number}: {:?} {:?}",
                found.says, found.remarks
            );
            assert_eq!(found.outcome, FitOutcome::Undetermined, "{said}");
            assert_eq!(found.undetermined.len(), built.open.len(), "{said}");
            for open in &built.open {
                let alike = found.undetermined.iter().any(|named| {
                    named.len() == open.len()
                        && open.iter().all(|(key, part)| {
                            named.get(*key).is_some_and(|own| (own - part).abs() < 1e-2)
                        })
                });
                assert!(alike, "{open:?} is not named; {said}");
            }
            for parameter in &found.parameters {
                let named =
                    |open: &Vec<(&str, f64)>| open.iter().any(|(key, _)| *key == parameter.key);
                let open = built.open.iter().any(named);
                assert_eq!(parameter.determined, !open, "{parameter:?}; {said}");
                // Never an interval for what is not known.
                assert!(!open || parameter.low.is_none() || parameter.high.is_none());
            }
        }
    }
}
