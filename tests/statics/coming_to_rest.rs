//! Random leaves come to rest: wild ones, and ones at the edge of what could be
//! a leaf. How many are drawn, from which seed, and where those that fail or take long are
//! written, the environment says:
//! `LEAVES=1000 SEED=7 FAILED=folder cargo test --release --test statics coming_to_rest:: -- --nocapture`.

use std::cell::Cell;
use std::fmt::Write;
use std::time::Instant;

use leafdyn_testing::random::{Draw, list};
use leafdyn_testing::*;

/// Leaves that take longer, in seconds, are told, as those that fail.
const SLOW: f64 = 5.0;

/// What leaves of a kind have at most.
struct Kind {
    name: &'static str,
    /// Torsion and bending stiffness: smallest and largest.
    couple: [f64; 2],
    /// Stretch and shear stiffness, over the mean of that.
    force: [f64; 2],
    /// Of the loads, they are at least this part: a vein is then stretched and sheared
    /// by about the inverse of it at most.
    force_per_load: f64,
    lengths: [f64; 2],
    rest_curvature: f64,
    stretch: f64,
    /// Weight and tip force a vein, in units of `load_unit`.
    weight: f64,
    tip_force: f64,
    /// Over so many decades.
    decades: i32,
    /// Whether the unit is that of the softest bending stiffness.
    of_the_softest: bool,
}

const WILD: Kind = Kind {
    name: "wild",
    couple: [0.1, 10.0],
    force: [3.0, 1e5],
    force_per_load: 0.0,
    lengths: [0.7, 1.3],
    rest_curvature: 10.0,
    stretch: 1.0,
    weight: 50.0,
    tip_force: 10.0,
    decades: 2,
    of_the_softest: false,
};

const EDGE: Kind = Kind {
    name: "edge",
    couple: [0.03, 30.0],
    force: [3.0, 1e5],
    force_per_load: 1.0,
    lengths: [0.5, 1.5],
    rest_curvature: 20.0,
    stretch: 2.0,
    weight: 1e4,
    tip_force: 1e4,
    decades: 4,
    of_the_softest: true,
};

/// Weight and tip force, if there are any.
fn loads(draw: &mut Draw, kind: &Kind, rods: usize, softest: f64) -> [Option<Vec<f64>>; 2] {
    let (unit, veins) = match kind.of_the_softest {
        true => (softest, 1),
        false => (1.0, rods),
    };
    let gravity = draw.vector(kind.weight * unit, kind.decades);
    let tip_force = draw.vector(kind.tip_force * unit * veins as f64, kind.decades);
    [(0.8, gravity), (0.6, tip_force)].map(|(part, load)| draw.chance(part).then_some(load))
}

/// A random leaf.
fn leaf(draw: &mut Draw, kind: &Kind, name: &str) -> String {
    let rods = draw.uniform(1.0, 9.0) as usize;
    let mut text = format!("name = \"{name}\"\n[leaf]\nrods = {rods}\n");
    let [shortest, longest] = kind.lengths;
    let lengths = match draw.chance(0.5) {
        true => "1.0".into(),
        false => list(draw.list(rods, shortest, longest)),
    };
    let fan = match draw.uniform(0.0, 1.0) {
        which if which < 0.25 => "\"paper\"".into(),
        which if which < 0.5 => "\"symmetric\"".into(),
        _ => list(draw.list(rods, -1.6, 1.6)),
    };
    let joined = draw.chance(0.85);
    text += &format!("length = {lengths}\nfan = {fan}\njoined = {joined}\n[stiffness]\n");
    let softest = Cell::new(f64::INFINITY);
    for key in ["torsion", "bending_2", "bending_3"] {
        let [low, high] = kind.couple;
        let value = draw.quantity(rods, |draw| {
            let value = draw.log(low, high);
            softest.set(softest.get().min(value));
            value
        });
        writeln!(text, "{key} = {value}").unwrap();
    }
    let loads = loads(draw, kind, rods, softest.get());
    let size = |v: &Vec<f64>| v.iter().map(|c| c * c).sum::<f64>().sqrt();
    let load: f64 = loads.iter().flatten().map(size).sum();
    let all_rigid = draw.chance(0.1);
    for key in ["axial", "shear_2", "shear_3"] {
        let [low, high] = kind.force;
        let low = low.max(kind.force_per_load * load);
        let high = high.max(10.0 * low);
        let value = draw.quantity(rods, |draw| match all_rigid || draw.chance(0.25) {
            true => f64::INFINITY,
            false => draw.log(low, high),
        });
        writeln!(text, "{key} = {value}").unwrap();
    }
    text += "[rest]\n";
    for key in ["twist", "bend_2", "bend_3"] {
        if draw.chance(0.6) {
            let most = kind.rest_curvature * [1.0, 0.3][usize::from(draw.chance(0.5))];
            let value = draw.quantity(rods, |draw| draw.uniform(-most, most));
            writeln!(text, "{key} = {value}").unwrap();
        }
    }
    if kind.stretch > 1.0 && draw.chance(0.5) {
        let value = draw.quantity(rods, |draw| draw.uniform(1.0, kind.stretch));
        writeln!(text, "stretch = {value}").unwrap();
    }
    if rods > 1 && draw.chance(0.7) {
        text += "[coupling]\n";
        let most = draw.log(0.1, 1e3);
        for key in ["x", "y", "z"] {
            writeln!(text, "{key} = {}", draw.uniform(0.0, most)).unwrap();
        }
    }
    text += "[load]\n";
    for (key, load) in ["gravity", "tip_force"].into_iter().zip(loads) {
        if let Some(load) = load {
            writeln!(text, "{key} = {}", list(load)).unwrap();
        }
    }
    text
}

/// Relaxes so many leaves; returns how many of them did not come to rest, and the
/// number of all.
fn failures(kind: &Kind, least: usize) -> (usize, usize) {
    let (count, seed) = (asked("LEAVES", least), asked("SEED", 1) as u64);
    let mut failed = 0;
    let (mut slowest, mut total) = (0.0_f64, 0.0);
    for k in 0..count {
        let begin = seed.wrapping_mul(0x1234_5678_9abc_def1);
        let mut draw = Draw(begin.wrapping_add((k as u64) << 20));
        let name = format!("{}-{seed}-{k}", kind.name);
        let text = leaf(&mut draw, kind, &name);
        let scenario = parse(&text);
        let clock = Instant::now();
        let found = relaxed(&scenario, &Options::default());
        let seconds = clock.elapsed().as_secs_f64();
        slowest = slowest.max(seconds);
        total += seconds;
        let at_rest = found.outcome.is_success();
        failed += usize::from(!at_rest);
        if !at_rest || seconds > SLOW {
            let (outcome, work) = (found.outcome.word(), found.work);
            let remark = found.remark;
            println!("{name}: {outcome} after {seconds:.1} s, {work:?}: {remark:?}");
            if let Ok(folder) = std::env::var("FAILED") {
                std::fs::write(format!("{folder}/{name}.toml"), text).unwrap();
            }
        }
    }
    let (name, each) = (kind.name, 1e3 * total / count as f64);
    println!(
        "{name}: {failed} of {count} did not come to rest; {each:.1} ms each, {slowest:.2} s at most"
    );
    (failed, count)
}

#[test]
fn wild_and_edge_leaves() {
    for (kind, least, one_of) in [(&WILD, 40, 1000), (&EDGE, 12, 100)] {
        let (failed, count) = failures(kind, least);
        assert!(failed <= count / one_of, "{}: {failed}", kind.name);
    }
}

/// On 16 segments this leaf's waves bend a segment by more than a right angle; on
/// finer ones it is at rest.
#[test]
fn waves_that_a_grid_on_the_way_does_not_resolve() {
    let stretch = "1.0625, 1.192, 1.108, 1.048, 1.012, 1.0, 1.012, 1.048, 1.108, 1.192, 1.0625";
    let changes = format!("stiffness.torsion=10; rest.stretch=[{stretch}]");
    let leaf = settled(&scenario("study/undulation", &changes), &Options::default());
    assert_eq!(leaf.stability.negative_eigenvalues, Some(0));
}
