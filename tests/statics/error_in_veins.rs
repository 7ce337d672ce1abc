//! The error in veins that a blade states covers what more veins change, the leaf is the same whether it
//! is stated or not, and a blade is refined to as many veins as it says.

use std::time::{Duration, Instant};

use leafdyn::relax::{Outcome, VeinsRemark};
use leafdyn::study::{
    BaseScenario, RefinedBlade, VeinsError, estimate_error_in_veins, refine_veins, relax_blade,
};
use leafdyn_testing::random::Draw;
use leafdyn_testing::*;

/// Veins of the blade that stands for one of infinitely many.
const MANY: usize = 33;

/// Smaller errors, as fractions of the largest displacement, are not judged.
const JUDGED: f64 = 1e-3;

/// Tolerance of the blades, so that the errors of their grids do not count.
const TOLERANCE: f64 = 1e-5;

/// Blades of many veins that take longer are not judged.
const LONGEST: Duration = Duration::from_secs(10);

/// Farther from the truth, in lengths, is another equilibrium.
const ANOTHER: f64 = 0.1;

/// A random blade: of constant width, a fan, or pointed, flat or curved at rest, under its weight in any
/// direction.
fn random_blade(seed: usize) -> String {
    let mut random = Draw(0xb1ade + seed as u64);
    let length = random.log(5.0, 40.0);
    let width = length * random.log(0.1, 0.8);
    let thickness = width * random.log(0.003, 0.03);
    let part = random.uniform(0.3, 1.0);
    let outline = match random.even() {
        kind if kind < 0.25 => format!("{width:?}"),
        kind if kind < 0.5 => {
            let base = part * width;
            format!("{{ at = [0.0, 1.0], value = [{base:?}, {width:?}] }}")
        }
        _ => {
            let (at, base) = (random.uniform(0.3, 0.6), part * width);
            format!("{{ at = [0.0, {at:?}, 1.0], value = [{base:?}, {width:?}, 0.0] }}")
        }
    };
    let across = random.log(0.2, 1.0);
    let poisson = random.uniform(0.0, 0.4);
    let edges = random.chance(0.5);
    let rods = [9, 9, 10, 12, 13, 17][(6.0 * random.even()) as usize];
    // The weight of a strip that bends it, in units of E t^3/(12 L^3).
    let weight = random.log(0.3, 50.0);
    let per_area = weight * thickness.powi(3) / (12.0 * length.powi(3));
    let g = random.vector(per_area / thickness, 0);
    let elevation = random.uniform(-0.5, 0.9);
    let curved = match random.chance(0.7) {
        true => format!("rest.bend_2 = {:?}", random.uniform(-5.0, 5.0) / length),
        false => String::new(),
    };
    format!(
        "
        name = 'blade'
        leaf = {{ rods = {rods}, elevation = {elevation:?} }}
        blade = {{ length = {length:?}, width = {outline}, thickness = {thickness:?}, young = 1.0, young_across = {across:?}, poisson = {poisson:?}, mass_density = 1.0, edges = {edges} }}
        load.g = {g:?}
        {curved}
        "
    )
}

/// The blade with so many veins, at rest, with its error in veins.
fn stated(base: &BaseScenario, tolerance: f64) -> Equilibrium {
    let options = to(tolerance);
    let mut leaf = settled(base.scenario(), &options);
    estimate_error_in_veins(base, &mut leaf, &options);
    leaf
}

/// The largest distance of the veins from equal places of a blade with many more, between whose veins lie
/// parabolas.
fn distance_from_many([own, more]: [&Scenario; 2], [leaf, many]: [&Equilibrium; 2]) -> f64 {
    let [own, more] = [own, more].map(|it| it.blade.as_ref().unwrap());
    let etas: Vec<f64> = (0..many.rod_count).map(|j| more.vein_position(j)).collect();
    let vein = |k: usize| {
        let eta = own.vein_position(k);
        let nearest = (1..etas.len() - 1)
            .min_by(|a, b| (etas[*a] - eta).abs().total_cmp(&(etas[*b] - eta).abs()))
            .unwrap();
        let x = (eta - etas[nearest]) / (etas[nearest] - etas[nearest - 1]);
        let weights = [0.5 * x * (x - 1.0), 1.0 - x * x, 0.5 * x * (x + 1.0)];
        let nodes = leaf.shape.stations.iter().zip(&leaf.shape.rods[k].nodes);
        largest(nodes.filter_map(|(sigma, node)| {
            let same = |other: &f64| (other - sigma).abs() < 1e-9;
            let at = many.shape.stations.iter().position(same)?;
            let place: DVec3 = (0..3)
                .map(|i| weights[i] * many.shape.rods[nearest + i - 1].nodes[at].position)
                .sum();
            Some(place.distance(node.position))
        }))
    };
    largest((0..leaf.rod_count).map(vein))
}

/// Of 100 errors that are above a thousandth of the largest displacement it covers at least 95. As many blades as
/// `LEAFDYN_BLADES` says.
#[test]
fn the_error_in_veins_of_random_blades_holds() {
    let (count, first) = (asked("LEAFDYN_BLADES", 4), asked("LEAFDYN_BLADES_FROM", 0));
    let (mut judged, mut told, mut wrong) = (0, 0, Vec::new());
    let mut ratios = Vec::new();
    for seed in first..first + count {
        let text = random_blade(seed);
        let [own, many] =
            ["".into(), format!("leaf.rods={MANY}")].map(|change| base(&text, &change));
        let leaf = stated(&own, TOLERANCE);
        let report = leaf.blade.as_ref().unwrap();
        let mut limited = to(TOLERANCE);
        limited.limit = Limit::with_deadline(Instant::now() + LONGEST);
        let truth = relaxed(many.scenario(), &limited);
        if !truth.outcome.is_at_rest() {
            continue;
        }
        let scenarios = [own.scenario(), many.scenario()];
        let error = distance_from_many(scenarios, [&leaf, &truth]);
        let length = leaf.shape.longest();
        let Some(stated) = report.error_in_veins else {
            println!("{seed}: {}", report.error_in_veins_remark.as_ref().unwrap());
            continue;
        };
        told += 1;
        let displacement = distance(&leaf, &relaxed(&own.scenario().unloaded(), &to(TOLERANCE)));
        let seen = error > 5.0 * (estimate(&leaf) + estimate(&truth));
        if !seen || error < JUDGED * displacement || error > ANOTHER * length {
            continue;
        }
        judged += 1;
        ratios.push(stated / error);
        if stated < error {
            let (rods, part) = (leaf.rod_count, error / displacement);
            wrong.push(format!(
                "{seed}, {rods} veins: {stated:.2e} for {error:.2e}, {part:.1e} of the displacement"
            ));
        }
    }
    ratios.sort_by(f64::total_cmp);
    let median = ratios.get(ratios.len() / 2);
    println!(
        "{told} told, {judged} judged, median over error {median:?}, too small:\n{}",
        wrong.join("\n")
    );
    assert!(4 * told >= 3 * count);
    assert!(20 * wrong.len() <= judged, "{judged}: {wrong:?}");
}

/// A pointed blade under its weight.
const BLADE: &str = "
    name = 'blade'
    leaf = { rods = 9, elevation = 0.9 }
    blade = { length = 25.0, width = { at = [0.0, 0.4, 1.0], value = [0.9, 3.6, 0.0] }, thickness = 0.03, young = 5e4, mass_density = 8e-6 }
    load.g = [0, 0, -981]
";

fn blade(changes: &str) -> BaseScenario {
    base(BLADE, changes)
}

/// What a blade says in place of its error in veins, or besides.
fn remark(changes: &str) -> Option<VeinsRemark> {
    let report = stated(&blade(changes), 1e-3).blade.unwrap();
    let uncertain = matches!(
        report.error_in_veins_remark,
        Some(VeinsRemark::VeryFew { .. })
    );
    let known = report.error_in_veins_remark.is_none() || uncertain;
    assert_eq!(report.error_in_veins.is_some(), known, "{changes}");
    assert_eq!(report.half_as_many.is_some(), known, "{changes}");
    report.error_in_veins_remark
}

/// With other numbers of veins what is said of single ones means something else.
#[test]
fn keys_of_single_veins_are_refused() {
    let cases = [
        ("load.gravity=[0,0,-1e-6]", "load.gravity"),
        ("load.distributed=[0,0,-1e-6]", "load.distributed"),
        ("coupling.z=1e-9", "coupling"),
        (
            "blade.thickness=[0.03,0.03,0.03,0.03,0.04,0.03,0.03,0.03,0.03]",
            "blade.thickness",
        ),
        (
            "rest.stretch=[1.001,1,1,1,1,1,1,1,1.001]; tissue.grown=false",
            "rest.stretch",
        ),
        (
            "blade.width.value[2]=0.5; load.tip_force=[0,0,-1e-6]",
            "load.tip_force",
        ),
    ];
    for (changes, key) in cases {
        let wanted = VeinsRemark::SingleVeins { key };
        assert_eq!(remark(changes), Some(wanted.clone()), "{changes}");
        let refused = refine_veins(&blade(changes), 1e-2, &to(1e-4), &mut |_| {});
        assert!(matches!(refused, Err(VeinsError::SingleVeins(it)) if it == wanted));
    }
    for (table, key) in [
        (
            "[[load.point]]\nvein = 1\nat = 0.5\nforce = [0, 0, -1e-5]",
            "load.point",
        ),
        ("[[grip]]\nvein = 5\nat = 0.5", "grip"),
    ] {
        let text = format!("{BLADE}\n{table}\n");
        let report = stated(&base(&text, ""), 1e-3).blade.unwrap();
        let wanted = VeinsRemark::SingleVeins { key };
        assert_eq!(report.error_in_veins_remark, Some(wanted));
    }
    // What is said of the whole blade is the same with other veins.
    for changes in [
        "load.tip_force=[0,0,-1e-6]",
        "rest.stretch=1.001; tissue.grown=false",
        "blade.young={ at = [0.0, 1.0], value = [5e4, 3e4] }",
        "rest.bend_2=0.02",
    ] {
        assert_eq!(remark(changes), None, "{changes}");
    }
}

/// Three veins tell too little, fewer nothing, and a short wide blade nothing with any.
#[test]
fn few_veins_and_short_blades_are_told() {
    assert_eq!(
        remark("leaf.rods=5"),
        Some(VeinsRemark::VeryFew { rods: 3 })
    );
    assert_eq!(remark("leaf.rods=8"), None);
    let short = "blade.length=1.5; load.g=[0,0,-10]";
    assert_eq!(remark(short), Some(VeinsRemark::ShortAndWide));
    let four = stated(&blade("leaf.rods=4"), 1e-4).blade.unwrap();
    assert_eq!(
        (four.error_in_veins, four.error_in_veins_remark),
        (None, None)
    );
}

/// It is told of the leaf at rest, which stays as it was to the last bit; a comparison that is stopped says so.
#[test]
fn the_leaf_stays_as_it_was() {
    let (base, mut options) = (blade(""), to(1e-5));
    let leaf = settled(base.scenario(), &options);
    let told = stated(&base, 1e-5);
    let json = |leaf: &Equilibrium| {
        let leaf = Equilibrium {
            blade: None,
            wall_seconds: 0.0,
            ..leaf.clone()
        };
        serde_json::to_string(&leaf).unwrap()
    };
    assert_eq!(json(&leaf), json(&told));
    let report = told.blade.unwrap();
    let fewer = report.half_as_many.unwrap();
    assert_eq!(fewer.rods, 5);
    assert_eq!(report.error_in_veins, Some(1.5 * fewer.difference));
    options.limit = Limit::with_deadline(Instant::now());
    let mut stopped = leaf;
    estimate_error_in_veins(&base, &mut stopped, &options);
    let report = stopped.blade.unwrap();
    assert_eq!(report.error_in_veins, None);
    let remark = report.error_in_veins_remark;
    assert_eq!(remark, Some(VeinsRemark::FewerNotAtRest { rods: 5 }));
}

/// It ends with the first number of veins whose error is small enough, and with the same leaf as that
/// number by itself.
#[test]
fn veins_are_refined_until_their_error_is_small_enough() {
    let start = blade("leaf.rods=3; rest.bend_2=0.05; blade.width.value[1]=8");
    let displacement = distance(
        &settled(start.scenario(), &on(16)),
        &settled(&start.scenario().unloaded(), &on(16)),
    );
    let refined = |tolerance: f64| {
        let found = refine_veins(&start, tolerance, &on(16), &mut |_| {});
        let RefinedBlade { base, leaf } = found.unwrap();
        assert_eq!(base.scenario().rods.len(), leaf.rod_count);
        (base, leaf)
    };
    let (_, coarse) = refined(0.5);
    let tried = coarse.blade.unwrap().veins_tried;
    // That from three veins is not enough.
    assert_eq!(tried.iter().map(|it| it.rods).collect::<Vec<_>>(), [5, 9]);
    let wanted = 0.4 * tried[1].error_in_veins.unwrap() / displacement;
    let (base, leaf) = refined(wanted);
    let report = leaf.blade.as_ref().unwrap();
    let (last, before) = report.veins_tried.split_last().unwrap();
    assert!(last.rods > 9 && last.rods == leaf.rod_count);
    assert_eq!(last.error_in_veins, report.error_in_veins);
    assert!(last.error_in_veins.unwrap() <= (1.0 + 1e-6) * wanted * displacement);
    for tried in before.iter().filter(|it| it.rods > 5) {
        assert!(tried.error_in_veins.unwrap() > wanted * displacement);
    }
    let alone = relax_blade(&base, &on(16), &mut |_| {}).unwrap();
    assert_eq!(alone.tips, leaf.tips);
    assert_eq!(alone.shape, leaf.shape);
    assert_eq!(
        alone.blade.unwrap().least_width_effect,
        report.least_width_effect
    );
}

/// Where the most veins do not suffice the tolerance is not reached, and other tolerances are refused.
#[test]
fn too_few_veins_are_told() {
    let start = blade("leaf.rods=33; rest.bend_2=0.05");
    for tolerance in [0.0, -1.0, 1.0, f64::NAN] {
        let refused = refine_veins(&start, tolerance, &to(1e-4), &mut |_| {});
        assert!(matches!(refused, Err(VeinsError::Relax(_))), "{tolerance}");
    }
    let start = blade("leaf.rods=34");
    let found = refine_veins(&start, 1e-9, &on(16), &mut |_| {});
    let leaf = found.unwrap().leaf;
    assert_eq!(leaf.rod_count, 34);
    assert_eq!(leaf.outcome, Outcome::ToleranceNotReached);
    assert_eq!(leaf.remark.unwrap().code(), "error-in-veins");
    let paper = base(
        &std::fs::read_to_string(path("paper/fig04")).unwrap(),
        "leaf.rods=3",
    );
    let refused = refine_veins(&paper, 1e-2, &to(1e-4), &mut |_| {});
    assert!(matches!(refused, Err(VeinsError::NoBlade)));
}
