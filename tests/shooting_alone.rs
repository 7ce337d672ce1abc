//! Without a relaxed leaf to start from, shooting reaches every scene with few
//! veins. That it reaches the digits of every problem whose answer is known,
//! the tests of those problems say.

mod common;

use common::*;
use leafdyn::internals::leaf::{DiscreteLeaf, Grid, State};

/// Scenes with one equilibrium, or with one that continuation from the arcs
/// leads to: the relaxed one.
#[test]
fn it_finds_the_relaxed_leaf() {
    let figures = ["fig04", "fig05", "fig06", "fig13"].into_iter();
    let paper = figures.flat_map(|figure| {
        let with = |rods| scenario(&format!("paper/{figure}"), &format!("leaf.rods={rods}"));
        [1, 2, 3, 5].map(with)
    });
    let buckled = path("classic/elastica_buckled");
    let classic = files("classic").into_iter().filter(|file| *file != buckled);
    let classic = classic.map(|file| read(&file, ""));
    // From arcs there is no way to where a tip is held.
    let classic = classic.filter(|leaf| leaf.held_tip.is_none());
    for leaf in paper.chain(classic) {
        let what = format!("{}, {} veins", leaf.name, leaf.rods.len());
        let relaxed = settle(&leaf, TIGHT);
        let alone = shot_alone(&leaf, &relaxed.shape.stations);
        agree(&what, &leaf, &relaxed, &alone, 1e-9);
    }
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
