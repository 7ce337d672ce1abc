//! Relaxation and shooting, which share neither grid nor element nor linear
//! algebra, find the same leaf: position, directors, forces, moments, energy. That shooting
//! reaches the digits of every problem whose answer is known, the tests of those problems say.

use leafdyn::internals::leaf::{DiscreteLeaf, Grid, State};
use leafdyn_testing::random::{drawn, leaves, wild_leaves};
use leafdyn_testing::*;

/// Of position, in lengths of the leaf; ten times that of all else.
const CLOSE: f64 = 1e-9;

/// From arcs too, where continuation leads to the relaxed leaf.
#[track_caller]
fn both_agree(scenario: &Scenario, within: f64, alone: bool) {
    let what = format!("{}, {} veins", scenario.name, scenario.rods.len());
    let (leaf, shot) = match alone {
        true => all_agree(&what, scenario),
        false => {
            let leaf = settle(scenario, TIGHT);
            let shot = shot_near(scenario, &leaf);
            (leaf, shot)
        }
    };
    agree(&what, scenario, &leaf, &shot, within);
    // Scenes are nowhere near a bifurcation.
    assert!(shot.neutral.is_none(), "{what}");
    // The boundary-value problem itself is solved, and it is told how well.
    assert!(shot.defect < 1e-11, "{what}: defect {:.1e}", shot.defect);
    let error = shot.error.position / scale(scenario).length;
    assert!(error < 1e-10, "{what}: estimated error {error:.1e}");
}

#[test]
fn on_every_figure_of_the_paper() {
    let paper = files("paper");
    assert_eq!(paper.len(), 9);
    for file in paper {
        // Soft leaves have several equilibria.
        let firm = ["fig04", "fig05", "fig06", "fig13"].map(|name| path(&format!("paper/{name}")));
        for rods in [1, 2, 3, 5] {
            let leaf = read(&file, &format!("leaf.rods={rods}"));
            both_agree(&leaf, CLOSE, firm.contains(&file));
        }
    }
    // With as many veins as the paper.
    for entry in ["leaf.rods=21", "leaf.rods=35"] {
        both_agree(&scenario("paper/fig04", entry), 1e-8, false);
    }
    for figure in ["fig08", "fig09", "fig10"] {
        let softer = "leaf.rods=5; stiffness.bending_2=2e-4";
        both_agree(&scenario(&format!("paper/{figure}"), softer), 2e-9, false);
    }
}

/// And on the same sections and loads in fans of other numbers of veins, where what
/// the file lists vein by vein does not forbid it.
#[test]
fn on_every_classic_problem() {
    let (classic, mut accepted) = (classic_files_to_shoot(), 0);
    assert!(classic.len() >= 18);
    for file in &classic {
        let leaf = read(file, "");
        // From arcs a column stays straight, and there is no way to where a tip is held.
        let alone = leaf.name != "elastica_buckled" && leaf.held_tip.is_none();
        both_agree(&leaf, CLOSE, alone);
        for rods in [2, 3, 5] {
            let fan = entries(&format!("leaf.rods={rods}; leaf.fan='symmetric'"));
            if let Ok(fan) = Scenario::read_with(file, &fan) {
                accepted += 1;
                both_agree(&fan, CLOSE, false);
            }
        }
    }
    assert!(accepted >= 30, "{accepted}");
}

/// The solution does not remember where it came from: from leaves relaxed to
/// one digit it is the same as from leaves relaxed to eleven.
#[test]
fn from_rough_starts_too() {
    for figure in ["fig04", "fig05", "fig06", "fig13"] {
        let leaf = scenario(&format!("paper/{figure}"), "leaf.rods=5");
        let (mut rough, fine) = (settle_on(&leaf, 8, false), settle(&leaf, TIGHT));
        for node in rough.shape.rods.iter_mut().flat_map(|rod| &mut rod.nodes) {
            node.position.z += 0.01;
            node.n.x += 0.1;
            node.m.y -= 0.1;
        }
        let shot = shot_near(&leaf, &rough);
        assert_eq!(rough.shape.stations, fine.shape.stations);
        agree(figure, &leaf, &fine, &shot, CLOSE);
    }
}

/// How often relaxation and shooting fail on leaves nobody has thought of; where both
/// succeed they must agree.
fn failed(leaves: &[Scenario], tolerance: f64, within: f64) -> [usize; 2] {
    let mut failed = [0, 0];
    for (case, scenario) in leaves.iter().enumerate() {
        let leaf = relaxed(scenario, &to(tolerance));
        if !leaf.outcome.is_success() {
            failed[0] += 1;
            println!("leaf {case}: relaxation {:?}", leaf.outcome);
            continue;
        }
        match shoot_near(scenario, &leaf) {
            Ok(shot) => agree(&format!("leaf {case}"), scenario, &leaf, &shot, within),
            Err(failure) => {
                failed[1] += 1;
                println!("leaf {case}: shooting, {}", failure.reason);
            }
        }
    }
    println!("of {} failed {failed:?}", leaves.len());
    failed
}

#[test]
fn on_random_leaves_of_moderate_loads() {
    let leaves = drawn(leaves(), 300);
    assert!(leaves.iter().any(|leaf| !leaf.joined));
    let [relaxing, shooting] = failed(&leaves, 1e-10, 1e-8);
    assert!(50 * relaxing < leaves.len() && 50 * shooting < leaves.len());
}

/// Sections that differ from vein to vein by orders of magnitude, dead moments,
/// loads that bend by many radians: some of these do not come to rest.
#[test]
fn on_wild_leaves() {
    let leaves = drawn(wild_leaves(), 60);
    let [relaxing, shooting] = failed(&leaves, 1e-8, 1e-6);
    assert!(6 * relaxing < leaves.len() && 50 * shooting < leaves.len());
}

/// Without a start continuation reaches nearly all. Where the way turns back, at
/// a fold, it stops; a few come out in another equilibrium.
#[test]
fn from_arcs_nearly_always() {
    let leaves = drawn(leaves(), 60);
    let (mut lost, mut other) = (0, 0);
    for (case, scenario) in leaves.iter().enumerate() {
        let leaf = settle(scenario, 1e-8);
        match shoot_alone(scenario, &leaf.shape.stations) {
            Ok(alone) => {
                assert!(alone.defect < 1e-10, "leaf {case}: {:.1e}", alone.defect);
                let off = apart(scenario, &leaf.shape.rods, &alone.rods);
                other += usize::from(off.position > 1e-7);
            }
            Err(failure) => {
                lost += 1;
                println!("leaf {case}: {} at {}", failure.reason, failure.lambda);
                assert!(failure.lambda < 1.0);
            }
        }
    }
    println!("of {}: {lost} lost, {other} elsewhere", leaves.len());
    assert!(20 * lost <= leaves.len(), "{lost}");
    assert!(10 * other <= leaves.len(), "{other}");
}

/// What a shape, given at some multiple of `2 * segments` equal steps, leaves
/// unbalanced at the nodes of the discrete leaf.
fn unbalanced(scenario: &Scenario, rods: &[RodShape], segments: usize) -> f64 {
    let leaf = Leaf::new(scenario);
    let (length, force) = (leaf.scale.length, leaf.scale.force());
    let stride = (rods[0].nodes.len() - 1) / segments;
    let nodes = || rods.iter().flat_map(|rod| rod.nodes.iter().step_by(stride));
    let x = nodes().map(|node| node.position / length).collect();
    let q = nodes().map(|node| node.rotation).collect();
    let mut state = State::new(segments, x, q);
    let middles = |rod: &RodShape| -> Vec<DVec3> {
        let nodes = rod.nodes[stride / 2..].iter().step_by(stride);
        nodes.map(|node| in_lab(node).0 / force).collect()
    };
    state.n = rods.iter().flat_map(middles).collect();
    DiscreteLeaf::new(&leaf, Grid::new(segments, &[])).residual(&state)
}

/// The soft leaves have several equilibria. What shooting finds is one: on
/// finer grids it satisfies the equations of the discrete leaf ever better, by
/// two orders in ds. A shape that is not its own leaves the load of a segment
/// unbalanced: one order.
#[test]
fn of_soft_leaves_it_finds_an_equilibrium() {
    let stations = Grid::new(1024, &[]);
    for figure in ["fig08", "fig09", "fig10"] {
        for rods in [1, 2, 3, 5] {
            let leaf = scenario(&format!("paper/{figure}"), &format!("leaf.rods={rods}"));
            let what = format!("{figure}, {rods} veins");
            let shape = shot_alone(&leaf, stations.sigma()).rods;
            let on_grids =
                |leaf: &Scenario| [256, 512].map(|segments| unbalanced(leaf, &shape, segments));
            let [coarse, fine] = on_grids(&leaf);
            assert!(fine < 1e-3, "{what}: {fine:.1e}");
            assert!(coarse / fine > 3.5, "{what}: {coarse:.1e}, {fine:.1e}");
            let mut heavier = leaf.clone();
            heavier.gravity[2] *= 10.0;
            let [coarse, fine] = on_grids(&heavier);
            assert!(coarse / fine < 3.0, "{what}: {coarse:.1e}, {fine:.1e}");
        }
    }
}

/// From arcs a straight column stays straight, which is an equilibrium too.
#[test]
fn a_column_beyond_its_buckling_load_stays_straight() {
    let stations = [0.0, 0.25, 0.5, 0.75, 1.0];
    let alone = shot_alone(&scenario("classic/elastica_buckled", ""), &stations);
    for (node, sigma) in alone.rods[0].nodes.iter().zip(stations) {
        assert!((node.position - DVec3::new(sigma, 0.0, 0.0)).length() < 1e-14);
    }
    assert!(alone.neutral.is_none());
}

/// The same at all numbers of intervals: those are the solver's own business.
#[test]
fn the_number_of_intervals_changes_nothing() {
    let leaf = scenario("paper/fig04", "leaf.rods=5");
    let relaxed = settle(&leaf, 1e-6);
    let over = |count| found(&leaf, shoot_over(Some(count), &leaf, &relaxed));
    let one = over(1);
    for count in [2, 7, 50] {
        let several = over(count);
        assert_eq!(several.intervals.len(), count + 1);
        let off = apart(&leaf, &one.rods, &several.rods);
        assert!(off.position < 1e-12 && off.force < 1e-11, "{off:?}");
    }
}
