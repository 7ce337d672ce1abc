//! Relaxation and shooting, which share neither grid nor element nor linear
//! algebra, find the same leaf: position, directors, forces, moments, energy.

mod common;

use common::{TIGHT, agree, files, scenario, settle, shoot_near};
use leafdyn::scenario::Scenario;

/// Of position, in lengths of the leaf; ten times that of all else.
const CLOSE: f64 = 1e-9;

#[track_caller]
fn both_agree(scenario: &Scenario, within: f64) {
    let what = format!("{}, {} veins", scenario.name, scenario.rods.len());
    let leaf = settle(scenario, TIGHT);
    let shot =
        shoot_near(scenario, &leaf).unwrap_or_else(|failure| panic!("{what}: {}", failure.reason));
    agree(&what, scenario, &leaf, &shot, within);
    // The boundary-value problem itself is solved, and it is told how well.
    assert!(shot.defect < 1e-11, "{what}: defect {:.1e}", shot.defect);
    let length = common::scale(scenario).length;
    let error = shot.error.position / length;
    assert!(error < 1e-10, "{what}: estimated error {error:.1e}");
}

#[test]
fn on_every_figure_of_the_paper() {
    let paper = files("paper");
    assert_eq!(paper.len(), 9);
    for file in paper {
        for rods in [1, 2, 3, 5] {
            let entry = format!("leaf.rods={rods}");
            both_agree(&Scenario::read(&file, &[entry]).unwrap(), CLOSE);
        }
    }
}

#[test]
fn on_every_classic_problem() {
    let classic = files("classic");
    assert!(classic.len() >= 18);
    for file in &classic {
        both_agree(&Scenario::read(file, &[]).unwrap(), CLOSE);
    }
}

/// The same sections and loads in fans of other numbers of veins, where what
/// the file lists vein by vein does not forbid it.
#[test]
fn on_fans_made_of_the_classic_problems() {
    let mut accepted = 0;
    for file in &files("classic") {
        for rods in [2, 3, 5] {
            let fan = [format!("leaf.rods={rods}"), "leaf.fan='symmetric'".into()];
            if let Ok(fan) = Scenario::read(file, &fan) {
                accepted += 1;
                both_agree(&fan, CLOSE);
            }
        }
    }
    assert!(accepted >= 30, "{accepted}");
}

#[test]
fn on_fig_4_with_as_many_veins_as_the_paper() {
    for rods in [21, 35] {
        let leaf = scenario("paper/fig04", &[format!("leaf.rods={rods}")]);
        both_agree(&leaf, 1e-8);
    }
}

/// The solution does not remember where it came from: from leaves relaxed to
/// one digit it is the same as from leaves relaxed to eleven.
#[test]
fn from_rough_starts_too() {
    for figure in ["fig04", "fig05", "fig06", "fig13"] {
        let leaf = scenario(&format!("paper/{figure}"), &["leaf.rods=5".into()]);
        let (rough, fine) = (settle(&leaf, 0.1), settle(&leaf, TIGHT));
        let mut start = rough.clone();
        for rod in &mut start.shape.rods {
            for node in &mut rod.nodes {
                node.position.z += 0.01;
                node.n.x += 0.1;
                node.m.y -= 0.1;
            }
        }
        let shot = shoot_near(&leaf, &start).unwrap();
        assert_eq!(rough.shape.stations, fine.shape.stations);
        agree(figure, &leaf, &fine, &shot, CLOSE);
    }
}
