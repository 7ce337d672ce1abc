//! What a page does with a leaf, without a page.

use base64::prelude::{BASE64_STANDARD, Engine};
use leafdyn_web::session::Session;
use serde_json::{Value, json};
use std::path::Path;

fn ask(session: &mut Session, question: Value) -> Value {
    let answer = session.answer(question.to_string().as_bytes());
    serde_json::from_slice(&answer).unwrap()
}

fn text(name: &str) -> String {
    let scenarios = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenarios");
    std::fs::read_to_string(scenarios.join(name)).unwrap()
}

fn open(session: &mut Session, name: &str) -> Value {
    let opened = ask(
        session,
        json!({ "ask": "open", "text": text(name), "name": name }),
    );
    assert_eq!(opened["answer"], "opened", "{}", opened["error"]);
    opened
}

const COLUMN: &str = r#"
    name = "column"
    leaf = { rods = 1, length = 1.0, fan = [0.0] }
    stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 10.0, axial = 100.0, shear_2 = 100.0, shear_3 = 100.0 }
    load = { tip_force = [-2.8, 0.0, 0.5] }
"#;

/// Held up by a force across, which is reversed: it goes along, is left at its fold, swings over, and
/// rests on the other side, where it stays when the force comes back.
#[test]
fn a_column_goes_along_snaps_and_comes_back_late() {
    let mut session = Session::default();
    let key = "load.tip_force[2]";
    ask(
        &mut session,
        json!({ "ask": "open", "text": COLUMN, "name": "column.toml" }),
    );
    let set = |session: &mut Session, value: f64| {
        ask(
            session,
            json!({ "ask": "set", "values": [[key, value]], "modes": 1 }),
        )
    };
    let held = set(&mut session, -0.05);
    assert_eq!(held["answer"], "followed");
    assert!(held["tips"][0][2].as_f64().unwrap() > 0.3);
    assert_eq!(held["eigenvalues"].as_array().unwrap().len(), 1);
    let left = set(&mut session, -0.3);
    assert_eq!(left["answer"], "left");
    let fold = left["values"][0][1].as_f64().unwrap();
    assert!((fold + 0.1113).abs() < 2e-3, "{fold}");
    let first = ask(&mut session, json!({ "ask": "go", "damped": true }));
    assert!(first["tip"][2].as_f64().unwrap() > 0.3);
    let mut last = first;
    let mut count = 0;
    while last["ended"] != true {
        last = ask(&mut session, json!({ "ask": "frame" }));
        assert_eq!(last["answer"], "moving", "{}", last["error"]);
        count += 1;
    }
    assert!((20..2000).contains(&count), "{count}");
    let landed = ask(&mut session, json!({ "ask": "land" }));
    assert_eq!(
        (&landed["answer"], &landed["stable"]),
        (&json!("found"), &json!(true))
    );
    let gap = landed["tips"][0][2].as_f64().unwrap() - last["tip"][2].as_f64().unwrap();
    assert!(gap.abs() < 0.02, "{gap}");
    let back = set(&mut session, 0.05);
    assert_eq!(back["answer"], "followed");
    assert!(back["tips"][0][2].as_f64().unwrap() < -0.3);
}

/// Told where it is, another session begins with the same of two equilibria, and traces its branch both
/// ways; told nonsense, it begins as a relaxation does.
#[test]
fn a_place_leads_to_the_same_of_several_equilibria() {
    let mut session = Session::default();
    let key = "load.tip_force[2]";
    ask(
        &mut session,
        json!({ "ask": "open", "text": COLUMN, "name": "column.toml" }),
    );
    let values = json!([[key, -0.05]]);
    let up = ask(&mut session, json!({ "ask": "set", "values": values }));
    let at = ask(&mut session, json!({ "ask": "place" }))["at"].clone();
    let opened = |at: Value| {
        let mut other = Session::default();
        let question =
            json!({ "ask": "open", "text": COLUMN, "name": "", "values": values, "at": at });
        let tip = ask(&mut other, question)["known"]["tips"][0][2].as_f64();
        (other, tip.unwrap())
    };
    let (mut other, tip) = opened(at);
    assert!((tip - up["tips"][0][2].as_f64().unwrap()).abs() < 2e-4);
    let question = json!({ "ask": "trace", "key": key, "from": -0.5, "to": 0.5 });
    let branch = ask(&mut other, question);
    let points = branch["points"].as_array().unwrap();
    let number = |point: &Value, of: &str| point[of].as_f64().unwrap();
    let ends = [&points[0], points.last().unwrap()].map(|it| number(it, "value"));
    assert_eq!(ends, [-0.5, 0.5]);
    let folds = points.iter().filter(|it| it["kind"] == "fold");
    let folds: Vec<f64> = folds.map(|it| number(it, "value")).collect();
    assert_eq!(folds.len(), 2);
    assert!(folds.iter().all(|at| (at.abs() - 0.1113).abs() < 2e-3));
    assert!(
        points
            .iter()
            .any(|it| (number(it, "value") + 0.05).abs() < 0.01)
    );
    for nonsense in ["", "x", "AAAA", "////////////////////////////////"] {
        assert!(opened(json!(nonsense)).1 < -0.3);
    }
}

/// A question in between leaves a motion as it is.
#[test]
fn a_motion_goes_on_after_what_only_asks() {
    let mut session = Session::default();
    open(&mut session, "paper/fig04.toml");
    ask(&mut session, json!({ "ask": "go", "released": true }));
    for asked in ["place", "unloaded", "version"] {
        ask(&mut session, json!({ "ask": asked }));
        let frame = ask(&mut session, json!({ "ask": "frame" }));
        assert_eq!(frame["answer"], "moving", "{asked}");
    }
}

/// Under a dead moment, which has no potential, the leaf is found anew for every value.
#[test]
fn a_leaf_under_a_moment_is_not_said_to_be_left() {
    let mut session = Session::default();
    open(&mut session, "classic/cantilever_tip.toml");
    for moment in [0.5, 1.0, 0.0] {
        let values = json!([["load.tip_moment[1]", moment]]);
        let set = ask(&mut session, json!({ "ask": "set", "values": values }));
        assert!(
            set["answer"] == "found" || moment == 0.0,
            "{}",
            set["answer"]
        );
        // Its stability is that of its small motions.
        assert!(set["stable"].is_boolean(), "{}", set["stable"]);
    }
}

/// In a steady wind sliders have their effects on the leaf at rest in it, also those of the wind; without it, and in
/// one that changes, on the leaf at rest without it.
#[test]
fn sliders_have_effects_in_wind() {
    let text = |speed: &str| {
        format!("{COLUMN}\nwind = {{ velocity = {speed}, density = 1.0, drag = 2.0, width = 0.4 }}")
    };
    let effect = |text: &str, key: &str| {
        let mut session = Session::default();
        let opened = ask(
            &mut session,
            json!({ "ask": "open", "text": text, "name": "windy.toml" }),
        );
        assert_eq!(opened["answer"], "opened", "{}", opened["error"]);
        let sliders = opened["sliders"].as_array().unwrap();
        let slider = sliders.iter().find(|slider| slider["key"] == key);
        slider.and_then(|slider| slider["effect"].as_f64())
    };
    let key = "load.tip_force[2]";
    let steady = text("[0.0, 1.5, 0.0]");
    let of_speed = effect(&steady, "wind.velocity[1]").unwrap();
    assert!(of_speed > 1e-2, "{of_speed}");
    let [calm, blown] = [COLUMN, &steady].map(|text| effect(text, key).unwrap());
    assert!(
        blown > 0.0 && (blown - calm).abs() > 1e-3 * calm,
        "{calm} {blown}"
    );
    let gust = text("{ at = [0.0, 1.0], value = [[0.0, 0.0, 0.0], [0.0, 1.5, 0.0]] }");
    let without = effect(&gust, key).unwrap();
    assert!((without - calm).abs() < 1e-6 * calm, "{calm} {without}");
}

/// Whatever is asked in whatever order, there is an answer, and the leaf goes on.
#[test]
fn a_refused_question_leaves_the_leaf_as_it_is() {
    let mut session = Session::default();
    assert_eq!(
        ask(&mut session, json!({ "ask": "land" }))["answer"],
        "refused"
    );
    assert_eq!(session.answer(b"nonsense").first(), Some(&b'{'));
    open(&mut session, "paper/fig04.toml");
    for question in [
        json!({ "ask": "open", "text": "name = <b>", "name": "x" }),
        json!({ "ask": "set", "values": [["leaf.length", -1.0]] }),
        json!({ "ask": "set", "values": [["nothing", 1.0]] }),
        json!({ "ask": "frame" }),
        json!({ "ask": "trace", "key": "leaf.rods", "from": 1.0, "to": 5.0 }),
        json!({ "ask": "write", "file": "passwd" }),
        json!({ "ask": "sensitivity", "keys": ["leaf.rods"] }),
    ] {
        let answer = ask(&mut session, question.clone());
        assert_eq!(answer["answer"], "refused", "{question}");
        assert!(!answer["error"].as_str().unwrap().is_empty());
    }
    let set = ask(
        &mut session,
        json!({ "ask": "set", "values": [["load.gravity[2]", -0.5]] }),
    );
    assert_eq!(set["answer"], "followed");
    let scenario = ask(
        &mut session,
        json!({ "ask": "write", "file": "scenario.toml" }),
    );
    assert_eq!(scenario["answer"], "file");
}

/// Every scenario of the repository opens; what can rest rests; each of its numbers has a range with
/// its value in it.
#[test]
fn all_scenarios_open_with_their_sliders() {
    let scenarios = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenarios");
    let mut count = 0;
    for folder in ["paper", "classic", "measured", "motion", "study"] {
        for file in std::fs::read_dir(scenarios.join(folder)).unwrap() {
            let file = file.unwrap().file_name().into_string().unwrap();
            if !file.ends_with(".toml") {
                continue;
            }
            let mut session = Session::default();
            let opened = open(&mut session, &format!("{folder}/{file}"));
            let sliders = opened["sliders"].as_array().unwrap();
            assert!(sliders.len() > 5, "{file}");
            for slider in sliders {
                let [value, low, high] = ["value", "low", "high"].map(|key| slider[key].as_f64());
                let Some(value) = value else { continue };
                assert!(low.unwrap() <= value && value <= high.unwrap(), "{slider}");
            }
            let unloaded = ask(&mut session, json!({ "ask": "unloaded" }));
            assert_eq!(
                unloaded["answer"], "unloaded",
                "{file}: {}",
                unloaded["error"]
            );
            count += 1;
        }
    }
    assert!(count > 30);
}

/// A slider says what its number is in words, and how far the leaf goes with it: as a small change of the
/// number moves it.
#[test]
fn sliders_know_their_words_and_what_they_do() {
    let mut session = Session::default();
    let opened = open(&mut session, "paper/fig04.toml");
    let sliders = opened["sliders"].as_array().unwrap();
    let slider = |key: &str| sliders.iter().find(|it| it["key"] == key).unwrap();
    for (key, words) in [
        ("stiffness.bending_2", "bending stiffness, up and down"),
        ("stiffness.torsion", "stiffness against twisting"),
        ("load.gravity[2]", "weight of the veins along z"),
    ] {
        assert_eq!(slider(key)["words"], words);
    }
    let effect = |key: &str| slider(key)["effect"].as_f64().unwrap();
    assert!(effect("stiffness.torsion") < 1e-3 * effect("load.gravity[2]"));
    // The tip moves farthest: against a central difference.
    let [more, less] = [-1.01, -0.99].map(|value| {
        let question = json!({ "ask": "set", "values": [["load.gravity[2]", value]] });
        let known = ask(&mut session, question);
        let tip = known["tips"][0].as_array().unwrap().clone();
        [0, 1, 2].map(|axis: usize| tip[axis].as_f64().unwrap())
    });
    let moved = [0, 1, 2].map(|axis| (more[axis] - less[axis]) / 0.02);
    let moved = moved.iter().map(|it| it * it).sum::<f64>().sqrt();
    let told = effect("load.gravity[2]");
    assert!((told - moved).abs() < 2e-3 * moved, "{told} {moved}");
    assert!(opened["growth"].is_null());
}

/// The growth of margins is told vein by vein where they have grown.
#[test]
fn grown_margins_are_told() {
    let opened = open(&mut Session::default(), "study/undulation.toml");
    let growth = &opened["growth"];
    assert_eq!(growth["keys"].as_array().unwrap().len(), 11);
    assert_eq!(growth["keys"][10], "rest.stretch[10]");
    assert_eq!(
        (&growth["stretches"][0], &growth["stretches"][5]),
        (&json!(1.3), &json!(1.0))
    );
}

/// A leaf under a dead moment, which is relaxed anew for each value, is relaxed on one grid of half as many segments while a slider is
/// dragged, and let go as accurately as before: the coarse one is never the measure of the next.
#[test]
fn a_dragged_leaf_under_a_moment_is_coarse_and_then_exact() {
    let mut session = Session::default();
    open(&mut session, "classic/helical_rollup.toml");
    let set = |session: &mut Session, part: f64, coarse: bool| {
        let values = json!([["stiffness.bending_3", 100.0 * part]]);
        let leaf = ask(
            session,
            json!({ "ask": "set", "values": values, "coarse": coarse }),
        );
        assert_eq!(leaf["answer"], "found", "{part} {coarse}");
        leaf
    };
    let tip = |leaf: &Value| [0, 1, 2].map(|axis| leaf["tips"][0][axis].as_f64().unwrap());
    let segments = |leaf: &Value| leaf["view"]["leaves"][0]["nodes"].as_u64().unwrap() - 1;
    for part in [1.02, 1.05, 1.08] {
        let rough = [set(&mut session, part, true), set(&mut session, part, true)];
        let exact = set(&mut session, part, false);
        assert!(rough.iter().all(|leaf| leaf["error"].is_null()));
        assert!(exact["error"].as_f64().unwrap() <= 1e-4 * 10.0);
        assert_eq!(rough.each_ref().map(segments), [64, 64]);
        let [a, b] = [tip(&rough[1]), tip(&exact)];
        let apart = a
            .iter()
            .zip(b)
            .map(|(a, b)| (a - b).powi(2))
            .sum::<f64>()
            .sqrt();
        assert!(apart < 0.02 * 10.0 && apart > 1e-4, "{apart} of 10");
    }
}

/// A tip on a roller is drawn as one that slides, not as a free one.
#[test]
fn a_tip_on_a_roller_is_not_drawn_as_free() {
    let mut session = Session::default();
    let mut figure = |name: &str| {
        open(&mut session, name);
        let file = ask(
            &mut session,
            json!({ "ask": "write", "file": "figure.svg" }),
        );
        let content = BASE64_STANDARD.decode(file["content"].as_str().unwrap());
        String::from_utf8(content.unwrap()).unwrap()
    };
    let roller = figure("classic/three_point_bending.toml");
    assert!(roller.contains(">slides<") && !roller.contains(">free tip<"));
    let free = figure("classic/cantilever_tip.toml");
    assert!(!free.contains(">slides<") && free.contains(">free tip<"));
}

/// While a slider is dragged the leaf is that of a coarse grid; let go, it is as accurate as before. Where the coarse
/// grid would leave a branch, the finer ones decide.
#[test]
fn a_dragged_leaf_is_coarse_and_then_exact() {
    let mut session = Session::default();
    open(&mut session, "measured/blade.toml");
    let set = |session: &mut Session, value: f64, coarse: bool| {
        let values = json!([["load.g[2]", value]]);
        let question = json!({ "ask": "set", "values": values, "coarse": coarse });
        let leaf = ask(session, question);
        assert_eq!(leaf["answer"], "followed", "{value} {coarse}");
        assert_eq!(leaf["stable"], true);
        leaf
    };
    for value in [-900.0, -700.0, -800.0] {
        let rough = set(&mut session, value, true);
        let exact = set(&mut session, value, false);
        assert!(rough["error"].is_null() && exact["error"].as_f64() < Some(2e-3));
        let tips = [&rough, &exact].map(|leaf| {
            let tip = |axis: usize| leaf["tips"][0][axis].as_f64().unwrap();
            [tip(0), tip(1), tip(2)]
        });
        let apart = tips[0].iter().zip(tips[1]).map(|(a, b)| (a - b).powi(2));
        let apart = apart.sum::<f64>().sqrt();
        assert!(apart < 0.3 && apart > 1e-6, "{apart} cm of 30");
    }
    ask(
        &mut session,
        json!({ "ask": "open", "text": COLUMN, "name": "column.toml" }),
    );
    let push = |session: &mut Session, value: f64, coarse: bool| {
        let values = json!([["load.tip_force[2]", value]]);
        ask(
            session,
            json!({ "ask": "set", "values": values, "coarse": coarse }),
        )
    };
    // Beside its fold as well.
    for coarse in [true, false] {
        let beside = push(&mut session, -0.108, coarse);
        assert_eq!(beside["answer"], "followed", "{coarse}");
        assert!(beside["tips"][0][2].as_f64().unwrap() > 0.2);
    }
    assert_eq!(push(&mut session, 0.3, true)["answer"], "followed");
    let left = push(&mut session, -0.3, true);
    assert_eq!(left["answer"], "left");
    let fold = left["values"][0][1].as_f64().unwrap();
    assert!((fold + 0.1113).abs() < 2e-3, "{fold}");
}
