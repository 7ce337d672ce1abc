//! All shapes of a leaf: what many starts find, and that each is an equilibrium.

mod common;
mod workplace;

use leafdyn::relax::SemiImplicit;
use leafdyn::scenario::Scenario;
use leafdyn::study::{All, all};
use serde_json::Value;
use workplace::{Workplace, is_whole_png, text};

fn fig10(set: &[&str]) -> Scenario {
    let overrides = ["leaf.rods=5"].iter().chain(set).map(|s| s.to_string());
    Scenario::read(&common::path("paper/fig10"), &overrides.collect::<Vec<_>>()).unwrap()
}

fn search(scenario: &Scenario) -> All {
    all(
        scenario,
        SemiImplicit::default(),
        Some(1e-5),
        &mut |_, _| {},
    )
    .unwrap()
}

/// The paper's Fig. 10 with five veins has several places to rest, those with
/// tips at 0.227 and -0.113 among them, and the flat saddle.
#[test]
fn soft_leaf_with_many() {
    let found = search(&fig10(&[]));
    let stable: Vec<f64> = (found.found.iter())
        .filter(|one| one.equilibrium.stable() == Some(true))
        .map(|one| one.equilibrium.tips[0].z)
        .collect();
    println!("{stable:?} from {} starts", found.starts);
    assert!(stable.len() >= 5, "{stable:?}");
    for wanted in [0.2263, -0.1132, -0.2309] {
        assert!(stable.iter().any(|z| (z - wanted).abs() < 1e-3), "{wanted}");
    }
    let energies: Vec<f64> = found
        .found
        .iter()
        .map(|one| one.equilibrium.energy.unwrap())
        .collect();
    assert!(energies.is_sorted(), "lowest first");
    let saddle = found.found.last().unwrap();
    assert_eq!(saddle.equilibrium.stability.negative_eigenvalues, Some(18));
    let plain = found.found.iter().filter(|one| one.plain).count();
    assert_eq!(plain, 1, "the plain start is told");
    for one in &found.found {
        assert!(
            one.equilibrium.accuracy.residual.unwrap() < 1e-7,
            "{:?}",
            one.equilibrium.accuracy.residual
        );
    }
}

/// Without weight up and down are alike: every shape out of the plane is found
/// with its mirror image.
#[test]
fn mirror_images() {
    let found = search(&fig10(&["load.gravity=[0,0,0]"]));
    let stable: Vec<_> = (found.found.iter())
        .filter(|one| one.equilibrium.stable() == Some(true))
        .collect();
    assert!(stable.len() >= 2);
    let mut paired = 0;
    for one in &stable {
        let [tip, energy] = [one.equilibrium.tips[0].z, one.equilibrium.energy.unwrap()];
        let image = stable.iter().any(|other| {
            let other = &other.equilibrium;
            (other.tips[0].z + tip).abs() < 1e-4 && (other.energy.unwrap() - energy).abs() < 1e-7
        });
        paired += usize::from(image);
    }
    println!("{paired} of {} paired", stable.len());
    assert!(paired >= 2 && 4 * paired >= 3 * stable.len());
}

#[test]
fn a_stiff_leaf_has_one_whatever_the_threads() {
    let place = Workplace::new();
    let run = |threads: &str| {
        let arguments = ["relax", "leaf.toml", "--all", "--json"];
        let output = place
            .command(&arguments)
            .env("RAYON_NUM_THREADS", threads)
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        let mut object: Value = serde_json::from_slice(&output.stdout).unwrap();
        object["wall_seconds"] = Value::Null;
        object
    };
    let one = run("1");
    assert_eq!(one, run("2"));
    assert_eq!(one["equilibria"].as_array().unwrap().len(), 1);
    assert_eq!(one["equilibria"][0]["stable"], true);
    assert_eq!(
        place.names("out/small"),
        ["equilibria.json", "equilibria.png", "equilibria.svg"]
    );
    assert!(is_whole_png(&place.path("out/small/equilibria.png")));
    for more in [["--method", "explicit"], ["--segments", "8"]] {
        let output = place.run(&["relax", "leaf.toml", "--all", more[0], more[1]]);
        assert_eq!(output.status.code(), Some(2), "{more:?}");
    }
}
