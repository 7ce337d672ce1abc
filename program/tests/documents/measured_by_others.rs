//! The page on measurements of others has the numbers of the program, as it is, beside theirs.

use leafdyn::posture::Posture;
use leafdyn::posture::leaf::ScenarioRod;
use leafdyn::posture::points::PosturePoints;
use leafdyn::scenario::Scenario;
use leafdyn::study::{ShapeTableOptions, read_postures};
use leafdyn_testing::random::Draw;
use leafdyn_testing::root;
use leafdyn_testing::workplace::{Workplace, floats};
use serde_json::Value;
use std::fs;

/// The page with single spaces.
fn page() -> String {
    let text = fs::read_to_string(root().join("docs/validation.md")).unwrap();
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Asserts that the page has this number where `{}` stands between these words, to the digits that it shows.
fn shows(words: &str, number: f64) {
    let (before, after) = words.split_once("{}").unwrap();
    let page = page();
    let places: Vec<&str> = page
        .match_indices(before)
        .filter_map(|(at, _)| Some(page[at + before.len()..].split_once(after)?.0))
        .filter(|between| between.parse::<f64>().is_ok())
        .collect();
    assert_eq!(places.len(), 1, "{words} stands {} times", places.len());
    let decimals = places[0]
        .split_once('.')
        .map_or(0, |(_, decimals)| decimals.len());
    let unit = 0.1_f64.powi(decimals as i32);
    let shown: f64 = places[0].parse().unwrap();
    assert!(
        (shown - number).abs() < 0.5001 * unit,
        "{words}: {shown}, and the program {number}"
    );
}

/// A place with the scenarios and their data.
fn place() -> Workplace {
    let place = Workplace::new();
    for file in fs::read_dir(root().join("scenarios/field")).unwrap() {
        let file = file.unwrap().path();
        let name = file.file_name().unwrap().to_str().unwrap();
        place.write(name, fs::read_to_string(&file).unwrap());
    }
    place
}

fn answer(place: &Workplace, run: &str) -> Value {
    place.run(format!("{run} --json --write none")).json()
}

#[test]
fn the_wing_that_bends_by_a_third_of_its_length() {
    let place = place();
    let height = |mass: f64| {
        let force = -9.80665 * mass;
        let told = answer(
            &place,
            &format!("relax pazy.toml --set load.tip_force=[0,0,{force}]"),
        );
        floats(&told["tip"])[2]
    };
    let unloaded = height(0.0);
    let change = |mass: f64| (height(mass) - unloaded) / 0.55 * 100.0;
    shows("1 kg at the tip | -22.10 % | {} % |", change(1.0));
    shows("2 kg | -38.83 % | {} % |", change(2.0));
    shows("hangs by {} m, so that", -unloaded);
    // UM/NAST with the same stiffnesses.
    assert!((change(1.0) + 20.64).abs() < 0.02 && (change(2.0) + 36.40).abs() < 0.02);
    // The change in the data is that of the unloaded wing.
    let data = fs::read_to_string(root().join("scenarios/field/pazy.csv")).unwrap();
    assert_eq!(
        data.lines().filter(|line| line.starts_with('-')).count(),
        10
    );
}

#[test]
fn the_bamboo_rod_has_the_modulus_of_others() {
    let place = place();
    let told = answer(
        &place,
        "fit bamboo.toml --data bamboo_weights.csv --data bamboo_points.csv --free section.young --free section.mass_density",
    );
    let young = &told["parameters"][0];
    let number = |name: &str| young[name].as_f64().unwrap();
    assert_eq!(young["key"], "section.young");
    let table = "Young's modulus | | {} (7.31 to 7.48) × 10⁶ psi |";
    shows(table, number("value") / 1e6);
    shows("| {} × 10⁶ psi (its owner's model) |", 7.345);
    // Student's 95 % of 23 degrees of freedom, were the errors independent; those that the program tells are wider, as the
    // residuals are smooth.
    let half = 2.0687 * number("standard_error") / number("value");
    assert!(
        (number("value") * (-half).exp() / 7.31e6 - 1.0).abs() < 2e-3,
        "{young}"
    );
    assert!(
        (number("value") * half.exp() / 7.48e6 - 1.0).abs() < 2e-3,
        "{young}"
    );
    assert!(number("low") < 7.31e6 && number("high") > 7.48e6);
    shows("wider, {} to", number("low") / 1e6);
    let residuals = told["residuals"].as_array().unwrap();
    let differences: Vec<f64> = (residuals.iter())
        .map(|one| one["data"].as_f64().unwrap() - one["model"].as_f64().unwrap())
        .collect();
    assert_eq!(differences.len(), 25);
    let squares: f64 = differences.iter().map(|it| it * it).sum();
    shows("| repeats: 0.11 in | {} in |", (squares / 23.0).sqrt());
}

#[test]
fn the_palm_hangs_lower_than_a_straight_one() {
    let place = place();
    let told = answer(&place, "relax palm.toml");
    shows("E = 2000 MPa | 0.42 m | {} m |", floats(&told["tip"])[2]);
    let least = |sheet: &str| {
        let told = answer(
            &place,
            &format!("unbend palm.toml --shape {sheet} --format biomech"),
        );
        told["critical_young"]["value"].as_f64().unwrap()
    };
    let sheet = place.read("palm.csv");
    let width = 0.9 * 0.0181;
    place.write("narrower.csv", sheet.replace("0.0181", &width.to_string()));
    shows("the bound would be {} GPa", least("narrower.csv"));
    // The modulus of the example is above the bound.
    assert!(least("palm.csv") < 1.0 && least("narrower.csv") > 1.1 * least("palm.csv"));
}

/// What twins of measured leaves came to.
#[derive(Default)]
struct WheatTwins {
    all: usize,
    /// How many intervals hold the least modulus of the leaf without noise.
    held: usize,
    /// How many bounds are above the modulus at which the leaf rests.
    above: usize,
    /// The bounds in least moduli.
    bounds: Vec<f64>,
    /// The noise, in mm.
    noises: Vec<f64>,
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Ten twins of each of the 40 leaves: the smoothed midrib is the posture of a leaf whose modulus is 1.05 to 20 times its
/// least one, at which it rests there by its curvature at rest; its points are measured anew, with noise as was estimated
/// of this leaf, or with this one.
fn wheat_twins(noise: Option<f64>) -> WheatTwins {
    let file = |name: &str| fs::read(root().join("scenarios/field").join(name)).unwrap();
    let scenario = String::from_utf8(file("wheat.toml")).unwrap();
    let scenario = Scenario::from_toml(&scenario).unwrap();
    let options = ShapeTableOptions {
        group: Some("leaf".into()),
        ..ShapeTableOptions::default()
    };
    let leaves = read_postures(&file("wheat.csv"), "wheat.csv", &options, &scenario).unwrap();
    assert_eq!(leaves.len(), 40);
    let rod = ScenarioRod::new(&scenario).unwrap().rod;
    let (mut draw, mut twins) = (Draw(91), WheatTwins::default());
    for leaf in leaves {
        let truth = Posture::from_points(rod.clone(), &leaf.points, None).unwrap();
        let smoothed = truth.smoothing().unwrap();
        let (least, noise) = (truth.critical_young(), noise.unwrap_or(smoothed.deviation));
        twins.noises.push(10.0 * noise);
        for _ in 0..10 {
            let young = least * draw.log(1.05, 20.0);
            let positions = smoothed.at.iter().map(|&t| {
                let place = smoothed.curve.at(t).position;
                place + glam::DVec3::new(noise * draw.normal(), 0.0, noise * draw.normal())
            });
            let points = PosturePoints::in_plane(positions.collect(), glam::DVec3::Y);
            let found = Posture::from_points(rod.clone(), &points, None).unwrap();
            let [low, high] = found.critical_interval();
            twins.all += 1;
            twins.held += usize::from(low <= least && least <= high);
            twins.above += usize::from(low > young);
            twins.bounds.push(low / least);
        }
    }
    twins
}

#[test]
fn twins_of_wheat_leaves_stay_below_their_modulus() {
    for (row, noise) in [("as estimated of each leaf", None), ("of 1 mm", Some(0.1))] {
        let mut twins = wheat_twins(noise);
        assert_eq!(twins.all, 400);
        let [noise, bound] = [&mut twins.noises, &mut twins.bounds].map(|it| median(it));
        let held = 100.0 * twins.held as f64 / 400.0;
        println!(
            "{row}: {noise} mm, held {held} %, {} above, bound {bound}",
            twins.above
        );
        shows(&format!("| {row} | {{}} mm |"), noise);
        shows(&format!("| {row} | {noise:.2} mm | {{}} % |"), held);
        shows(
            &format!("| {row} | {noise:.2} mm | {held:.1} % | {{}} of 400 |"),
            twins.above as f64,
        );
        let before = format!(
            "| {row} | {noise:.2} mm | {held:.1} % | {} of 400 | {{}} |",
            twins.above
        );
        shows(&before, bound);
    }
}
