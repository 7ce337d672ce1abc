//! What the supports of the bases feel balances all loads and the other supports, is that of closed forms and of
//! shooting, and has bars that hold.

use crate::stated_bars::{Drawn, draw, draw_blade};
use leafdyn::relax::{BaseReaction, Method, Route};
use leafdyn_testing::*;
use std::time::{Duration, Instant};

/// A force and a moment, with a bar of each.
#[derive(Clone, Copy, Default)]
struct Felt {
    force: DVec3,
    moment: DVec3,
    bars: [f64; 2],
}

/// Equal parts of a vein over which loads are summed, by Simpson's rule.
const PARTS: usize = 512;

/// What the supports of all bases feel.
fn on_bases(leaf: &Equilibrium) -> Felt {
    let base: BaseReaction = leaf.base_reaction.unwrap();
    Felt {
        force: base.force,
        moment: base.moment.unwrap(),
        bars: [base.error, base.moment_error].map(Option::unwrap),
    }
}

/// The mean of the bases.
fn mean_base(leaf: &Equilibrium) -> DVec3 {
    let bases = leaf.shape.rods.iter().map(|rod| rod.nodes[0].position);
    bases.sum::<DVec3>() / leaf.rod_count as f64
}

/// What the holders of tips and grips feel, about a point.
fn on_other_supports(scenario: &Scenario, leaf: &Equilibrium, about: DVec3) -> Felt {
    let mut felt = Felt::default();
    let mut add = |place: DVec3, force: DVec3, moments: DVec3, bars: [Option<f64>; 2]| {
        let arm = place - about;
        let [force_bar, moment_bar] = bars.map(Option::unwrap_or_default);
        felt.force += force;
        felt.moment += arm.cross(force) + moments;
        felt.bars[0] += force_bar;
        felt.bars[1] += arm.length() * force_bar + moment_bar;
    };
    if let Some(tip) = &leaf.reaction {
        let moments = tip.moments.iter().flatten().sum();
        let all = tip.moments_error.map(|bar| bar * leaf.rod_count as f64);
        add(leaf.tips[0], tip.force, moments, [tip.error, all]);
    }
    for (grip, on_grip) in scenario.grips.iter().zip(&leaf.grip_reactions) {
        let middle = 0.5 * (grip.at[0] + grip.at[1]);
        let near = |sigma: &f64| (sigma - middle).abs() < 1e-12;
        let k = leaf.shape.stations.iter().position(near).unwrap();
        let place = leaf.shape.rods[grip.vein].nodes[k].position;
        let moment = on_grip.moment.unwrap_or_default();
        add(
            place,
            on_grip.force,
            moment,
            [on_grip.error, on_grip.moment_error],
        );
    }
    felt
}

/// The load of vein `j` at a station, per unit of sigma: weight, load along it, and drag.
fn load_density(scenario: &Scenario, leaf: &Equilibrium, j: usize, i: usize) -> DVec3 {
    let (sigma, node) = (leaf.shape.stations[i], &leaf.shape.rods[j].nodes[i]);
    let mut load = DVec3::from_array(scenario.weight(j).at(sigma));
    if let Some(along) = &scenario.distributed {
        load += DVec3::from_array(along[j].each_ref().map(|it| it.at(sigma)));
    }
    if let Some(wind) = &scenario.wind {
        let tangent = (node.rotation * node.v).normalize();
        let normal = DVec3::from_array(wind.velocity.at(0.0)).reject_from(tangent);
        load += 0.5 * wind.density * wind.drag * wind.width[j].at(sigma) * normal.length() * normal;
    }
    load * scenario.rods[j].length
}

/// All loads, about a point. Couplings act between different points: those that are not equal along all axes
/// leave a moment.
fn loads(scenario: &Scenario, leaf: &Equilibrium, about: DVec3) -> Felt {
    let dead = scenario.points.iter().map(|point| point.moment);
    let dead = dead.chain([scenario.tip_moment]).map(DVec3::from_array);
    let (mut force, mut moment) = (DVec3::ZERO, dead.sum::<DVec3>());
    let mut add = |place: DVec3, load: DVec3| {
        force += load;
        moment += (place - about).cross(load);
    };
    let at = |j: usize, i: usize| leaf.shape.rods[j].nodes[i].position;
    for i in 0..=PARTS {
        let weight = match i {
            0 | PARTS => 1.0,
            _ if i % 2 == 1 => 4.0,
            _ => 2.0,
        } / (3.0 * PARTS as f64);
        for j in 0..leaf.rod_count {
            add(at(j, i), weight * load_density(scenario, leaf, j, i));
        }
        for (gap, coupling) in scenario.coupling.iter().enumerate() {
            let mean = 0.5 * (scenario.rods[gap].length + scenario.rods[gap + 1].length);
            let pull = weight * mean * DVec3::from_array(*coupling) * (at(gap + 1, i) - at(gap, i));
            add(at(gap, i), pull);
            add(at(gap + 1, i), -pull);
        }
    }
    let tips = if scenario.joined { 1 } else { leaf.rod_count };
    for j in 0..tips {
        add(at(j, PARTS), DVec3::from_array(scenario.tip_force));
    }
    for point in &scenario.points {
        let k = (point.at * PARTS as f64).round();
        assert!((point.at * PARTS as f64 - k).abs() < 1e-9, "a station");
        add(
            at(point.vein, k as usize),
            DVec3::from_array(scenario.force_on(point)),
        );
    }
    Felt {
        force,
        moment,
        bars: [0.0; 2],
    }
}

/// Loads and supports of a leaf balance, to the bars and to a part of the sum of sizes for the quadrature.
#[track_caller]
fn is_balanced(what: &str, scenario: &Scenario, leaf: &Equilibrium, part: f64) {
    let about = mean_base(leaf);
    let dense = leaf.clone().at_stations(scenario, Some(PARTS));
    let (bases, others) = (on_bases(leaf), on_other_supports(scenario, &dense, about));
    let loads = loads(scenario, &dense, about);
    let length = leaf.shape.longest();
    let each = leaf.base_reactions.iter().map(|it| it.force.length());
    let size = each.sum::<f64>() + loads.force.length() + others.force.length();
    let off = bases.force + others.force - loads.force;
    let bar = bases.bars[0] + others.bars[0] + part * size;
    assert!(
        off.length() <= bar,
        "{what}: force off by {off}, bar {bar:.1e}"
    );
    let off = bases.moment + others.moment - loads.moment;
    let bar = bases.bars[1] + others.bars[1] + part * size * length;
    assert!(
        off.length() <= bar,
        "{what}: moment off by {off}, bar {bar:.1e}"
    );
    // What is told is told accurately.
    assert!(
        bases.bars[0] < 3e-3 * size,
        "{what}: {:.1e} of {size}",
        bases.bars[0]
    );
    // The parts make the whole.
    let each = leaf.base_reactions.iter().zip(&leaf.shape.rods);
    let (mut force, mut moment) = (DVec3::ZERO, DVec3::ZERO);
    for (on_base, rod) in each {
        force += on_base.force;
        moment += on_base.moment.unwrap_or_default();
        moment += (rod.nodes[0].position - about).cross(on_base.force);
    }
    let count = leaf.rod_count as f64;
    let [force_bar, moment_bar] = [
        leaf.base_reactions[0].error.unwrap(),
        leaf.base_reactions[0].moment_error.unwrap_or(0.0),
    ];
    assert!(
        (force - bases.force).length() <= bases.bars[0] + count * force_bar,
        "{what}"
    );
    let bar = bases.bars[1] + count * (moment_bar + length * force_bar);
    assert!((moment - bases.moment).length() <= bar, "{what}");
}

const HINGED: &str = r#"
    name = "hinged"
    leaf = { rods = 3, length = [1.0, 0.9, 1.1], fan = [0.2, 0.0, -0.2], base = [[0.0, -0.2, 0.0], [0.1, 0.0, 0.15], [0.0, 0.2, 0.0]], base_held = "pinned" }
    stiffness = { torsion = 0.8, bending_2 = 1.0, bending_3 = 2.0, axial = 100.0, shear_2 = 60.0, shear_3 = 80.0 }
    rest = { bend_2 = [0.3, -0.5, 0.4], bend_3 = [0.2, 0.1, -0.3] }
    load.gravity = [0.0, 0.3, -2.0]
"#;

const CLAMPED: &str = r#"
    name = "clamped"
    leaf = { rods = 3, length = [1.0, 0.9, 1.1], fan = [0.2, 0.0, -0.2], base = [[0.0, -0.2, 0.0], [0.1, 0.0, 0.15], [0.0, 0.2, 0.0]] }
    stiffness = { torsion = 0.8, bending_2 = 1.0, bending_3 = 2.0, axial = 100.0, shear_2 = 60.0, shear_3 = 80.0 }
    rest = { bend_2 = [0.3, -0.5, 0.4], bend_3 = [0.2, 0.1, -0.3] }
    tissue = { along = 20.0, across = 10.0, normal = 15.0, fold = 0.4 }
    coupling = { x = 0.5, y = 1.0, z = 2.0 }
    load.gravity = [0.0, 0.3, -2.0]
    load.distributed = [0.1, 0.0, 0.3]
"#;

const ROD: &str = r#"
    name = "rod"
    leaf = { rods = 1, length = 1.0, fan = [0.0] }
    stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 2.0, axial = 60.0, shear_2 = 50.0, shear_3 = inf }
    load.gravity = [0.0, 0.0, -1.0]
"#;

fn scenes() -> Vec<Scenario> {
    let points = r#"
        [[load.point]]
        vein = 2
        at = 0.25
        force = [0.1, 0.2, -0.5]
        [[load.point]]
        vein = 3
        at = 1.0
        force = [0.0, -0.2, 0.3]
    "#;
    let grips = r#"
        [[grip]]
        vein = 1
        at = 0.5
        move = [-0.02, 0.03, 0.1]
        [[grip]]
        vein = 1
        at = 0.75
        held = "clamped"
        move = [-0.02, 0.0, 0.1]
    "#;
    let wind = "[wind]\nvelocity = [0.0, 0.4, 1.0]\ndensity = 1.0\ndrag = 2.0\nwidth = 0.5";
    let pinned = "tip = { held = \"pinned\", position = [0.8, 0.1, 0.2] }";
    let clamped =
        "tip = { held = \"clamped\", position = [0.8, 0.1, -0.2], angles = 0.3, twist = 0.4 }";
    let apart = CLAMPED.replace("rods = 3,", "rods = 3, joined = false,");
    let mut moments = parse(&format!(
        "{ROD}\n[[load.point]]\nvein = 1\nat = 0.5\nmoment = [0.3, -0.4, 0.2]"
    ));
    moments.tip_force = [0.2, 0.1, -0.3];
    moments.tip_moment = [0.1, 0.2, -0.4];
    vec![
        scenario("paper/fig04", ""),
        scenario("paper/fig05", ""),
        scenario("paper/fig08", "leaf.rods=5"),
        scenario("measured/lily", ""),
        scenario("measured/orchid", ""),
        scenario("measured/blade", "leaf.rods=5"),
        parse(CLAMPED),
        parse(&format!("{CLAMPED}\n{points}")),
        parse(&format!("{apart}\nload.tip_force = [0.3, 0.2, -0.4]")),
        parse(&format!("{CLAMPED}\n{pinned}")),
        parse(&format!("{CLAMPED}\n{grips}")),
        parse(HINGED),
        parse(&HINGED.replace(
            "\"pinned\"",
            "\"elastic\", base_turn_stiffness = [0.8, 2.0, 0.3]",
        )),
        parse(&format!("{HINGED}\n{clamped}")),
        parse(&format!("{ROD}\n{grips}")),
        parse(&format!("{ROD}\n{clamped}")),
        parse(&format!("{ROD}\n{wind}")),
        moments,
    ]
}

/// Forces to the bars alone, moments to those of the quadrature, too.
#[test]
fn bases_and_other_supports_carry_all_loads() {
    for (k, scenario) in scenes().iter().enumerate() {
        let blade = scenario.blade.is_some();
        for tolerance in [1e-4, if blade { 1e-5 } else { 1e-8 }] {
            let mut options = at_every_node(tolerance);
            if scenario.wind.is_some() {
                options.route = Route::Release;
            }
            let leaf = settled(scenario, &options);
            let what = format!("{k}, {} to {tolerance:e}", scenario.name);
            // Moments need the places of the loads, also between the nodes, which are less accurate next to grips.
            let between = if scenario.grips.is_empty() {
                1e-7
            } else {
                1e-5
            };
            let part = between + estimate(&leaf) / leaf.shape.longest();
            is_balanced(&what, scenario, &leaf, part);
        }
    }
}

/// A balance below a leaf without other supports shows its weight.
#[test]
fn a_balance_shows_the_weight() {
    let (scenario, weight) = (scenario("paper/fig04", ""), DVec3::NEG_Z * 21.0);
    for (tolerance, part) in [(1e-3, 1e-3), (1e-6, 1e-6)] {
        let on_base = on_bases(&settle(&scenario, tolerance));
        let (off, bar) = (on_base.force.distance(weight), on_base.bars[0]);
        assert!(
            off <= bar && bar < part * weight.length(),
            "{off:e}, {bar:e}"
        );
    }
}

/// Small deflections of a clamped rod under a force at its tip; a hinge bears no moment.
#[test]
fn small_deflections_bear_the_force_and_its_moment() {
    let load = 1e-7;
    let rod = rod(&format!(
        "load.tip_force=[0, {load}, {load}]; load.gravity=[0, 0, 0]"
    ));
    let on_base = on_bases(&settle(&rod, 1e-10));
    let force = DVec3::new(0.0, load, load);
    assert!((on_base.force - force).length() < 1e-9 * load);
    assert!((on_base.moment - DVec3::X.cross(force)).length() < 1e-6 * load);
}

/// A column buckled to an end slope of 60 degrees, by elliptic integrals: its base bears the force, and the force
/// times the place of the tip.
#[test]
fn an_elastica_bears_the_force_at_its_tip() {
    let (ratio, x, y) = (1.1517196204691, 0.74101960607633, 0.59320764616489);
    let load = ratio * PI * PI / 4.0;
    let leaf = solve(
        "classic/elastica_buckled",
        &format!("load.tip_force=[{:?}, 0, 0]", -load),
    );
    let side = tip(&leaf).y.signum();
    let force = DVec3::new(-load, 0.0, 0.0);
    let moment = DVec3::new(x, side * y, 0.0).cross(force);
    let on_base = only(&leaf.base_reactions);
    assert!(
        (on_base.force - force).length() < 1e-10,
        "{}",
        on_base.force
    );
    assert!(
        (on_base.moment.unwrap() - moment).length() < 1e-9,
        "{moment}"
    );
    let all = on_bases(&leaf);
    assert!((all.force - force).length() < 1e-10 && (all.moment - moment).length() < 1e-9);
}

/// A moment next to a clamp is borne by the clamp.
#[test]
fn a_clamp_bears_a_moment_at_the_base() {
    let moment = DVec3::new(0.3, -0.8, 0.5);
    let at = |at: f64| {
        let text = format!(
            "{ROD}\n[[load.point]]\nvein = 1\nat = {at:?}\nmoment = {:?}",
            moment.to_array()
        );
        on_bases(&settle(&parse(&text), 1e-9)).moment
    };
    let none = on_bases(&settle(&parse(ROD), 1e-9)).moment;
    assert!((at(1e-13) - none - moment).length() < 1e-8);
}

/// Integration along the veins from the base, which shares neither grids nor elements, finds the same.
#[test]
fn shooting_finds_the_same_reactions() {
    let method: Method = "shooting-from-rest".parse().unwrap();
    for scenario in [
        parse(CLAMPED),
        parse(HINGED),
        scenario("paper/fig06", "leaf.rods=4"),
    ] {
        let shot = settled(&scenario, &by(method, to(1e-9)));
        let leaf = settle(&scenario, 1e-9);
        let mut all: Vec<_> = leaf
            .base_reactions
            .iter()
            .zip(&shot.base_reactions)
            .collect();
        assert_eq!(all.len(), scenario.rods.len());
        all.push((
            leaf.base_reaction.as_ref().unwrap(),
            shot.base_reaction.as_ref().unwrap(),
        ));
        for (own, other) in all {
            let bar = own.error.unwrap() + other.error.unwrap();
            let off = own.force.distance(other.force);
            assert!(
                off <= bar && bar < 1e-5,
                "{}: {off:e}, {bar:e}",
                scenario.name
            );
            assert_eq!(own.moment.is_some(), other.moment.is_some());
            if let Some((own_moment, other_moment)) = own.moment.zip(other.moment) {
                let bar = own.moment_error.unwrap() + other.moment_error.unwrap();
                let off = own_moment.distance(other_moment);
                assert!(
                    off <= bar && bar < 1e-5,
                    "{}: {off:e}, {bar:e}",
                    scenario.name
                );
            }
        }
    }
}

/// Of half of a mirror-symmetric leaf those of the whole are told.
#[test]
fn half_of_a_leaf_tells_those_of_the_whole() {
    for rods in [4, 5] {
        let more = format!("leaf.rods={rods}; leaf.fan=symmetric");
        let scenario = scenario("paper/fig04", &more);
        let [half, whole] = reduced_and_full(&scenario, None);
        assert!(half.model.rods < rods && whole.model.rods == rods);
        let both = half.base_reactions.iter().zip(&whole.base_reactions);
        let total = (half.base_reaction.as_ref()).zip(whole.base_reaction.as_ref());
        for (own, other) in both.chain(total) {
            let bar = own.error.unwrap() + other.error.unwrap();
            assert!(own.force.distance(other.force) <= bar, "{rods}");
            let bar = own.moment_error.unwrap() + other.moment_error.unwrap();
            let off = own.moment.unwrap().distance(other.moment.unwrap());
            assert!(off <= bar, "{rods}: {off:e}, {bar:e}");
        }
        assert_eq!(half.base_reactions.len(), rods);
    }
}

/// The keys of results, with bars, and none of what is not there.
#[test]
fn results_have_the_keys_of_every_support() {
    let [clamped, hinged] = [CLAMPED, HINGED].map(|text| {
        let held = "tip = { held = \"pinned\", position = [0.8, 0.1, 0.2] }";
        let grip = "[[grip]]\nvein = 2\nat = 0.5\nheld = \"clamped\"\nmove = [0.0, 0.0, 0.05]";
        let leaf = settle(&parse(&format!("{text}\n{held}\n{grip}")), 1e-4);
        serde_json::to_value(leaf).unwrap()
    });
    for (leaf, moment) in [(&clamped, true), (&hinged, false)] {
        let each = leaf["base_reactions"].as_array().unwrap();
        assert_eq!(each.len(), 3);
        for on_base in each {
            assert_eq!(on_base["force"].as_array().unwrap().len(), 3);
            assert!(on_base["error"].is_f64());
            assert_eq!(on_base["moment"].is_array(), moment);
            assert_eq!(on_base["moment_error"].is_f64(), moment);
        }
        for key in ["force", "moment"] {
            assert_eq!(leaf["base_reaction"][key].as_array().unwrap().len(), 3);
        }
        for bar in [
            &leaf["base_reaction"]["error"],
            &leaf["base_reaction"]["moment_error"],
            &leaf["tip_reaction_error"],
            &leaf["grip_reactions"][0]["error"],
            &leaf["grip_reactions"][0]["moment_error"],
        ] {
            assert!(bar.is_f64(), "{bar}");
        }
    }
}

/// Forces and moments that a leaf states, with their bars: on bases, then on all of them.
fn stated(leaf: &Equilibrium) -> [Vec<(DVec3, f64)>; 4] {
    let each = |all: &[BaseReaction]| {
        let forces = all.iter().map(|it| (it.force, it.error.unwrap()));
        let moments = all
            .iter()
            .filter_map(|it| Some((it.moment?, it.moment_error.unwrap())));
        [forces.collect(), moments.collect()]
    };
    let [forces, moments] = each(&leaf.base_reactions);
    let [force, moment] = each(leaf.base_reaction.as_slice());
    [forces, moments, force, moment]
}

/// What [`stated`] states.
const QUANTITIES: [&str; 4] = ["forces on bases", "moments", "force on all", "moment"];

/// Leaves of all kinds of which a bar is too small, by less than a half: in grips, whose reactions converge as chance
/// has it.
const BEYOND: [&str; 0] = [];

/// Bars of these leaves against a relaxation to a much smaller tolerance.
fn bars_hold(leaves: impl Iterator<Item = (usize, Drawn)>, truths: &[f64]) {
    let (mut wrong, mut resting) = (Vec::new(), 0);
    let mut ratios: [Vec<f64>; 4] = Default::default();
    for (seed, Drawn { scenario, .. }) in leaves {
        let rest = |tolerance: f64| {
            let mut options = to(tolerance);
            options.limit = Limit::with_deadline(Instant::now() + Duration::from_secs(3));
            if scenario.wind.is_some() {
                options.route = Route::Release;
            }
            let leaf = relaxed(&scenario, &options);
            leaf.outcome.is_success().then_some(leaf)
        };
        let Some(truth) = truths.iter().find_map(|tolerance| rest(*tolerance)) else {
            continue;
        };
        resting += 1;
        for tolerance in [1e-3, 1e-4, 1e-5, 1e-6] {
            let Some(leaf) = rest(tolerance) else {
                continue;
            };
            if distance(&leaf, &truth) > 0.05 * leaf.shape.longest() {
                // Another equilibrium.
                continue;
            }
            for (k, (own, exact)) in stated(&leaf).iter().zip(&stated(&truth)).enumerate() {
                for ((own, bar), (exact, uncertain)) in own.iter().zip(exact) {
                    let off = own.distance(*exact);
                    if off > bar + uncertain {
                        let grids = &leaf.accuracy.segments;
                        wrong.push(format!(
                            "{seed} at {tolerance:e}: {} off by {off:.2e}, bar {bar:.2e}, {grids:?}",
                            QUANTITIES[k]
                        ));
                    }
                    if off > 10.0 * uncertain {
                        ratios[k].push(bar / off);
                    }
                }
            }
        }
    }
    for (what, mut ratios) in QUANTITIES.into_iter().zip(ratios) {
        ratios.sort_by(f64::total_cmp);
        let count = ratios.len();
        let [least, median] = [0, count / 2].map(|k| ratios.get(k).copied().unwrap_or(f64::NAN));
        println!("{what}: {count} bars, over error at least {least:.2}, median {median:.1}");
    }
    println!("{resting} rest");
    wrong.retain(|what| !BEYOND.iter().any(|known| what.starts_with(known)));
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// As many leaves as `LEAFDYN_BASES` says.
#[test]
fn bars_of_random_leaves_hold() {
    let count = asked("LEAFDYN_BASES", 24);
    bars_hold(
        (0..count).map(|seed| (seed, draw(seed))),
        &[1e-11, 1e-10, 1e-9],
    );
}

/// As many blades as `LEAFDYN_BLADE_BASES` says.
#[test]
fn bars_of_random_blades_hold() {
    let count = asked("LEAFDYN_BLADE_BASES", 4);
    bars_hold(
        (0..count).map(|seed| (seed, draw_blade(seed))),
        &[1e-9, 1e-8],
    );
}
