//! Where slow loading leads: a leaf as people measure it comes to rest in the same equilibrium on
//! all grids, at all tolerances, by all methods, in all units, and however its veins are
//! numbered; where the path loses its stability is where theory says. `LEAVES` is how many real
//! leaves are tried, `SEED` the first.

use leafdyn::relax::{
    AttemptEnd, BucklingMode, BucklingMotion, Event, Extent, Path, Route, StabilityLoss, Stage,
    Strategy, relax,
};
use leafdyn_testing::random::Draw;
use leafdyn_testing::real;
use leafdyn_testing::*;

/// Tips nearer to each other than this part of the length are one, on fixed grids and at loose
/// tolerances.
const SAME: f64 = 0.03;

/// The tip in lengths of the longest vein.
fn tip_in_lengths(scenario: &Scenario, options: &Options) -> DVec3 {
    let leaf = relax(scenario, options, &mut |_| {}).unwrap();
    assert!(
        leaf.outcome.is_success(),
        "{}: {:?}",
        scenario.name,
        leaf.remark
    );
    tip(&leaf) / leaf.shape.longest()
}

fn to(tolerance: f64) -> Options {
    Options {
        tolerance: Some(tolerance),
        ..Options::default()
    }
}

fn on(segments: usize) -> Options {
    Options {
        method: Method::default().on_grid(Some(segments)),
        ..Options::default()
    }
}

/// What happened to a leaf on its path.
#[track_caller]
fn events(leaf: &Equilibrium) -> &[Event] {
    match leaf.path.as_ref() {
        Some(Path::Loaded { events, confirmed }) => {
            assert!(confirmed, "{}", leaf.scenario);
            events
        }
        other => panic!("{}: {other:?}", leaf.scenario),
    }
}

#[test]
fn real_leaves_rest_in_one_equilibrium_whatever_the_numerics() {
    let (count, first) = (asked("LEAVES", 25), asked("SEED", 1) as u64);
    let (mut elsewhere, mut uncertain) = (Vec::new(), 0);
    for seed in first..first + count as u64 {
        let leaf = parse(&real::leaf(seed));
        let found = relax(&leaf, &to(1e-6), &mut |_| {}).unwrap();
        assert!(found.outcome.is_success(), "{seed}");
        uncertain += usize::from(!found.doubts.is_empty());
        let reference = tip(&found) / found.shape.longest();
        let mirrored = DVec3::new(reference.x, -reference.y, reference.z);
        let others = [
            tip_in_lengths(&leaf, &to(1e-3)),
            tip_in_lengths(&leaf, &to(1e-9)),
            tip_in_lengths(&leaf, &on(32)),
            tip_in_lengths(&leaf, &on(64)),
            tip_in_lengths(&parse(&real::in_metres(seed)), &to(1e-6)),
            tip_in_lengths(&parse(&real::in_millimetres(seed)), &to(1e-6)),
            tip_in_lengths(&parse(&real::backwards(seed)), &to(1e-6)),
        ];
        let off = others.map(|other| other.distance(reference));
        if off.iter().any(|off| *off > SAME) {
            println!(
                "seed {seed}: {off:?}, mirrored {}",
                others[6].distance(mirrored)
            );
            elsewhere.push(seed);
        }
    }
    println!(
        "{} of {count} elsewhere, {uncertain} uncertain",
        elsewhere.len()
    );
    assert!(elsewhere.len() <= count / 1000, "{elsewhere:?}");
    assert!(uncertain <= count / 50, "{uncertain}");
}

#[test]
fn threads_do_not_matter() {
    for seed in 1..8 {
        let leaf = parse(&real::leaf(seed));
        let [one, two] = [1, 2].map(|threads| on_threads(threads, || leaf.relax().unwrap()));
        assert_eq!(one.shape, two.shape, "{seed}");
        assert_eq!((one.path, one.work), (two.path, two.work));
    }
}

/// Newton's method from arcs is tried first by the semi-implicit method, never by the explicit
/// one: both end in the same equilibrium.
#[test]
fn methods_agree() {
    let explicit = Options {
        method: Method::Explicit { segments: None },
        ..to(1e-3)
    };
    for name in [
        "paper/fig04",
        "paper/fig06",
        "paper/fig10",
        "paper/fig13",
        "classic/fan_3",
    ] {
        let leaf = scenario(name, "leaf.rods=3");
        let [a, b] = [to(1e-3), explicit.clone()].map(|options| tip_in_lengths(&leaf, &options));
        assert!(a.distance(b) < SAME, "{name}: {a} {b}");
    }
}

/// An upright column buckles at Greenhill's weight, 7.837 A/L^3, to one of two equal sides
/// (Greenhill 1881, Proc. Camb. Phil. Soc. 4).
#[test]
fn a_column_turns_aside_at_its_critical_load() {
    let weight = 12.0;
    let column = rod(&format!(
        "{RIGID}; stiffness.bending_3=2; load.gravity=[{}, 0, 0]",
        -weight
    ));
    let found = column.relax().unwrap();
    let event = only(events(&found));
    assert_eq!(event.stage, Stage::Loading);
    // It is softest about d2: it bends up or down.
    let mode = Some(BucklingMode {
        kind: BucklingMotion::BendsUpAndDown,
        vein: None,
    });
    assert_eq!(
        event.happening,
        StabilityLoss::Branched {
            equally_open: true,
            mode
        }
    );
    close("part", event.part, 7.83734744 / weight, 1.0 / 512.0);
    assert!(tip(&found).z < -0.1, "{}", tip(&found));
    assert_eq!(found.stability.negative_eigenvalues, Some(0));
    assert_eq!(found.path.unwrap().word(), "branched");
}

/// Parts of the loading at which something happened.
fn parts_of_loading(leaf: &Equilibrium) -> Vec<f64> {
    let loading = events(leaf).iter().filter(|it| it.stage == Stage::Loading);
    loading.map(|it| it.part).collect()
}

/// Columns that are joined only after they are loaded buckle one after the other, each at the weight
/// at which it does so alone: 7.837 A/l^3 (Greenhill 1881).
#[test]
fn columns_of_a_joined_leaf_buckle_each_for_itself() {
    let (weight, lengths) = (16.0, [1.0, 0.95, 0.9_f64]);
    let columns = rod(&format!(
        "{RIGID}; leaf.rods=3; leaf.fan=[0, 0, 0]; stiffness.bending_3=2; \
         leaf.base=[[0, -0.1, 0], [0, 0, 0], [0, 0.1, 0]]; leaf.length={lengths:?}; \
         load.gravity=[{}, 0, 0]",
        -weight
    ));
    let found = parts_of_loading(&columns.relax().unwrap());
    assert_eq!(found.len(), 3, "{found:?}");
    for (part, length) in found.into_iter().zip(lengths) {
        let critical = 7.83734744 / length.powi(3);
        close("part", part, critical / weight, 1.0 / 256.0);
    }
}

/// Each of three columns bears a third of the force on their joint tip, and all buckle at once, at
/// three times Euler's load pi^2/4 (A/L^2).
#[test]
fn columns_share_the_force_on_their_joint_tip() {
    let force = 12.0;
    let columns = rod(&format!(
        "{RIGID}; leaf.rods=3; leaf.fan=[0, 0, 0]; stiffness.bending_3=2; \
         leaf.base=[[0, -0.1, 0], [0, 0, 0], [0, 0.1, 0]]; load.tip_force=[{}, 0, 0]",
        -force
    ));
    let found = parts_of_loading(&columns.relax().unwrap());
    let critical = 3.0 * std::f64::consts::PI.powi(2) / 4.0;
    close("part", *only(&found), critical / force, 1.0 / 256.0);
}

/// What happens to an upright leaf while it is loaded happens to its veins, each for itself. Of 2000,
/// five differ, which lose their stability within some per cent of their loads: coarse grids miss that.
#[test]
fn an_upright_leaf_is_loaded_as_its_veins_are() {
    let count = asked("UPRIGHT", 100);
    let (mut seen, mut released, mut others) = ([0; 2], 0, 0);
    for seed in 1..=count as u64 {
        let mut draw = Draw(seed);
        let (half, elevation) = (draw.uniform(0.05, 0.55), draw.uniform(0.5, 1.57));
        let weight = -draw.log(1.0, 40.0);
        let (stiffer, bent) = (draw.log(0.1, 10.0), draw.uniform(-1.0, 1.0));
        let force = draw.uniform(-1.0, 0.0);
        let entries = |fan: &[f64], lengths: &[f64]| {
            let veins = fan.len() as f64;
            format!(
                "{RIGID}; leaf.rods={veins}; leaf.fan={fan:?}; leaf.length={lengths:?}; \
                 leaf.elevation={elevation}; \
                 stiffness.bending_3={stiffer}; rest.bend_2={bent}; \
                 load.gravity=[0, 0, {weight}]; load.tip_force=[0, 0, {}]",
                veins * force,
            )
        };
        let fan = [-half, 0.3 * half, half];
        let lengths = match draw.chance(0.5) {
            true => [1.0; 3],
            false => [0.94, 1.0, 0.97],
        };
        let joined = rod(&entries(&fan, &lengths)).relax().unwrap();
        let alone = [0, 1, 2].map(|j| rod(&entries(&[fan[j]], &[lengths[j]])).relax().unwrap());
        let loaded = |leaf: &Equilibrium| {
            matches!(
                leaf.path,
                Some(Path::Loaded {
                    confirmed: true,
                    ..
                })
            )
        };
        if !loaded(&joined) || !alone.iter().all(loaded) {
            released += 1;
            continue;
        }
        // Veins that are alike but for their directions turn aside together.
        let alone = alone.each_ref().map(parts_of_loading).concat();
        let found = parts_of_loading(&joined);
        let among = |part: &f64, all: &[f64]| all.iter().any(|it| (it - part).abs() < 1.0 / 128.0);
        seen[usize::from(!alone.is_empty())] += 1;
        let same = found.iter().all(|part| among(part, &alone))
            && alone.iter().all(|part| among(part, &found));
        if !same {
            println!(
                "{seed}: {found:?}, alone {alone:?}: {}",
                entries(&fan, &lengths)
            );
            others += 1;
        }
    }
    println!(
        "{} leaves stood, {} did not, {released} were released",
        seen[0], seen[1]
    );
    assert!(
        seen.into_iter().all(|count| count > 10 * released),
        "{seen:?}"
    );
    assert!(others <= count / 100, "{others} of {count}");
}

/// Of the paper's Fig. 10 two equilibria are nearly mirror images. Slowly loaded the leaf sags;
/// released from its flat arcs it ends above them, with more energy.
#[test]
fn a_released_leaf_may_end_elsewhere() {
    let leaf = scenario("paper/fig10", "leaf.rods=5");
    let released = Options {
        route: Route::Release,
        ..Options::default()
    };
    let [slow, released] =
        [Options::default(), released].map(|options| relax(&leaf, &options, &mut |_| {}).unwrap());
    assert_eq!(events(&slow), []);
    assert_eq!(released.path, Some(Path::Released));
    assert!(tip(&slow).z < -0.1 && tip(&released).z > 0.1);
    assert!(slow.energy < released.energy);
}

/// Work of typical leaves: Newton's method at once, and a walk.
#[test]
fn counts_of_factorisations() {
    let count = |leaf: &Scenario| leaf.relax().unwrap().work.factorizations;
    assert_eq!(count(&scenario("paper/fig04", "")), 6);
    let real: Vec<usize> = (1..12)
        .map(|seed| count(&parse(&real::leaf(seed))))
        .collect();
    let mut sorted = real.clone();
    sorted.sort_unstable();
    assert!(sorted[sorted.len() / 2] <= 60, "{real:?}");
}

/// What was tried, as strategy, extent and end.
fn attempts(leaf: &Equilibrium) -> Vec<(Strategy, Extent, AttemptEnd)> {
    let each = leaf.attempts.iter();
    each.map(|it| (it.strategy, it.extent, it.end)).collect()
}

/// The plan of a relaxation, read from its log: Newton's method from arcs first, of one half where
/// that stands for the whole, and slow loading where that may lead elsewhere.
#[test]
fn the_log_tells_what_was_tried() {
    let leaf = parse(
        r#"
        name = "symmetric"
        leaf = { rods = 3, length = 1.0, fan = "symmetric", joined = true }
        stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 2.0, axial = 100.0, shear_2 = 50.0, shear_3 = 50.0 }
        load = { gravity = [0.0, 0.0, -1.0] }
        "#,
    );
    let accepted = |strategy| [(strategy, Extent::Half, AttemptEnd::Accepted)];
    let first_valley = attempts(&leaf.relax().unwrap());
    assert_eq!(first_valley, accepted(Strategy::FirstValley));
    let released = Options {
        route: Route::Release,
        ..Options::default()
    };
    let found = relax(&leaf, &released, &mut |_| {}).unwrap();
    assert_eq!(attempts(&found), accepted(Strategy::Release));
    // A stiff column is softened on its way from arcs: it is loaded slowly at once.
    let column = rod(&format!(
        "{RIGID}; stiffness.bending_3=2; load.gravity=[-12, 0, 0]"
    ));
    let loaded = (Strategy::SlowLoading, Extent::Whole, AttemptEnd::Accepted);
    assert_eq!(attempts(&column.relax().unwrap()), [loaded]);
    // What rests far from arcs may not be where slow loading leads.
    let found = scenario("paper/fig10", "leaf.rods=5").relax().unwrap();
    let [
        (Strategy::FirstValley, _, first),
        (Strategy::SlowLoading, _, second),
    ] = attempts(&found)[..]
    else {
        panic!("{:?}", found.attempts);
    };
    assert_ne!(first, AttemptEnd::Accepted);
    assert_eq!(second, AttemptEnd::Accepted);
}
