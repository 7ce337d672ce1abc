//! Equilibria shapes of a leaf: what many starts find, and that each is an equilibrium.

use leafdyn::relax::SemiImplicit;
use leafdyn::study::{Equilibria, equilibria};
use leafdyn_testing::workplace::{Json, Workplace, timeless};
use leafdyn_testing::*;

fn search(entries: &str) -> Equilibria {
    let fig10 = scenario("paper/fig10", &format!("leaf.rods=5; {entries}"));
    let (how, limit) = (SemiImplicit::default(), Limit::default());
    equilibria(&fig10, how, Some(1e-5), &limit, &mut |_, _| {}).unwrap()
}

fn stable(all: &Equilibria) -> Vec<&Equilibrium> {
    let found = all.found.iter().map(|one| &one.equilibrium);
    found.filter(|leaf| leaf.stable() == Some(true)).collect()
}

/// The paper's Fig. 10 with five veins has several places to rest, those with
/// tips at 0.227 and -0.113 among them, and the flat saddle.
#[test]
fn soft_leaf_with_many() {
    let all = search("");
    let tips: Vec<f64> = stable(&all).iter().map(|leaf| leaf.tips[0].z).collect();
    assert!(tips.len() >= 5, "{tips:?}");
    for wanted in [0.2263, -0.1132, -0.2309] {
        assert!(tips.iter().any(|z| (z - wanted).abs() < 1e-3), "{wanted}");
    }
    assert!(all.found.is_sorted_by_key(|one| one.equilibrium.energy));
    let saddle = all.found.last().unwrap();
    assert_eq!(saddle.equilibrium.stability.negative_eigenvalues, Some(18));
    assert_eq!((all.found.len(), all.starts), (9, 66));
    let plain = all.found.iter().filter(|one| one.plain).count();
    assert_eq!(plain, 1, "the plain start is told");
    assert!(all.found[0].plain && all.remarks.is_empty());
    for one in &all.found {
        let residual = one.equilibrium.accuracy.residual.unwrap();
        assert!(residual < 1e-7, "{residual}");
        let bar = one.equilibrium.accuracy.error_estimate.unwrap();
        assert!(bar <= 1e-5, "a rough one is not told: {bar}");
    }
}

/// Without weight up and down are alike: every shape out of the plane is found
/// with its mirror image.
#[test]
fn mirror_images() {
    let all = search("load.gravity=[0,0,0]");
    let stable = stable(&all);
    assert!(stable.len() >= 2);
    let images = |a: &Equilibrium, b: &Equilibrium| {
        let energy = a.energy.unwrap() - b.energy.unwrap();
        (tip(a).z + tip(b).z).abs() < 1e-4 && energy.abs() < 1e-7
    };
    let paired = |one: &&&Equilibrium| stable.iter().any(|other| images(one, other));
    let (paired, all) = (stable.iter().filter(paired).count(), stable.len());
    assert!(paired >= 2 && 4 * paired >= 3 * all, "{paired} of {all}");
}

/// Whatever the disturbance of the start, and however long each rod.
#[test]
fn tips_of_unequal_rods_stay_joined() {
    for lengths in ["[1.0, 1.1]", "[1.0, 0.8, 1.3]"] {
        let rods = lengths.split(',').count();
        let leaf = format!(
            "name = 'unequal'\nleaf = {{ rods = {rods}, length = {lengths}, fan = 'symmetric' }}\n\
             stiffness = {{ torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = 1e3, \
             shear_2 = 1e3, shear_3 = 1e3 }}\nload = {{ gravity = [0.0, 0.0, -1.0] }}"
        );
        let (how, limit) = (SemiImplicit::default(), Limit::default());
        let leaf = parse(&leaf);
        let all = equilibria(&leaf, how, Some(1e-5), &limit, &mut |_, _| {}).unwrap();
        for one in &all.found {
            let rods = &one.equilibrium.shape.rods;
            let tip = |j: usize| tip_node(rods, j).position;
            let apart = largest((1..rods.len()).map(|j| tip(j).distance(tip(0))));
            assert!(apart < 1e-12, "{lengths}: {apart}");
        }
    }
}

#[test]
fn a_stiff_leaf_has_one_whatever_the_threads() {
    let place = Workplace::new();
    let [one, two] = ["1", "2"].map(|threads| {
        let run = place.run_on(threads, "relax leaf.toml --all --json");
        timeless(run.ends(0).json())
    });
    assert_eq!(one, two);
    assert_eq!(one["equilibria"].list().len(), 1);
    assert_eq!(one["equilibria"][0]["stable"], true);
    assert_eq!(one["remark"], serde_json::Value::Null);
    place.holds("out/small", "equilibria.json equilibria.png equilibria.svg");
    place.picture("out/small/equilibria");
    for more in ["--method explicit", "--segments 8"] {
        place.run(format!("relax leaf.toml --all {more}")).ends(2);
    }
}
