//! Where the leaf of a map jumps to another equilibrium from a cell to the next, with its
//! followed branch as the judge.

use leafdyn::study::{BaseScenario, Map, MapMethod, MapRequest};
use leafdyn_testing::branch::follow;
use leafdyn_testing::*;

/// An arch between clamps, shallow enough to snap through under a load along it.
const ARCH: &str = r#"
    name = "arch"
    leaf = { rods = 1, length = 1.0, fan = [0.6] }
    stiffness = { torsion = 50.0, bending_2 = 50.0, bending_3 = 1.0, axial = 5000.0, shear_2 = 5000.0, shear_3 = 5000.0 }
    rest = { bend_3 = -1.2 }
    tip = { held = "clamped", position = [0.941, 0.0, 0.0], angles = -0.6 }
    load = { gravity = [0.0, -1.0, 0.0] }
"#;

/// A map by the default method, and its jumps.
fn mapped(base: BaseScenario, axes: &[&str]) -> Map {
    let axes = axes.iter().map(|axis| axis.parse().unwrap()).collect();
    let methods = vec![MapMethod::default()];
    let request = MapRequest::new(base, axes, Some(methods.clone()), None, 300.0).unwrap();
    let cells = 0..request.cells();
    let rows = cells.flat_map(|cell| request.solve_cell(cell, &methods));
    let mut map = Map::new(request.clone(), rows.collect());
    map.find_jumps(&|_, _| {});
    map
}

#[test]
fn an_arch_snaps_where_its_branch_loses_its_stability() {
    let map = mapped(base(ARCH, ""), &["load.gravity[1]=-1..-150:7"]);
    let branch = &follow(ARCH, "", "load.gravity[1]=-1..-150", false).branches[0];
    let critical: Vec<_> = branch.critical_points().collect();
    // It comes back stable far below: between them there are two equilibria.
    assert_eq!(critical.len(), 4);
    let lost = critical[0].1.value;
    let jump = only(map.jumps.as_deref().unwrap());
    let [a, b] = jump.between;
    assert!(b < lost && lost < a + (a - b), "{lost} {jump:?}");
    assert!((a - b) < 1e-2);
    assert!(jump.distance > 0.1);
    let cells = [&jump.from[0][..], &jump.to[0]];
    assert_eq!(cells, ["-75.5", "-100.333333333"]);
}

/// The same along either axis of a map of two, and only there.
#[test]
fn both_axes_are_looked_along() {
    let (load, bending) = ("load.gravity[1]", "scale:stiffness.bending_3");
    let axes = [format!("{load}=-60..-100:2"), format!("{bending}=1..1.5:2")];
    let axes = axes.each_ref().map(String::as_str);
    let jumps = mapped(base(ARCH, ""), &axes).jumps.unwrap();
    // A stiffer arch snaps later, at -80.6 times 1.5 if it did not stretch.
    let keys: Vec<&str> = jumps.iter().map(|jump| jump.key.as_str()).collect();
    assert_eq!(keys, [load, bending], "{jumps:?}");
}

/// Branches that are stable throughout, and one that forks without a jump.
#[test]
fn what_is_continuous_does_not_jump() {
    let table = "
        classic/cantilever_heavy; => scale:load.gravity=0.5..2.0:5
        paper/fig04; leaf.rods=3 => load.gravity[2]=-0.1..-2:5
        paper/fig05; leaf.rods=3 => scale:stiffness.bending_2=1..2:4
    ";
    for (leaf, vary) in pairs(table) {
        let (name, set) = leaf.split_once(';').unwrap();
        let base = BaseScenario::read(&path(name), &entries(set)).unwrap();
        let map = mapped(base, &[vary]);
        assert_eq!(map.jumps, Some(Vec::new()), "{name}");
    }
}
