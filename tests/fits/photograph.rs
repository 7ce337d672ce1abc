//! Points traced in a photograph, whose scale, place and rotation are free numbers.

use leafdyn::scenario::Scenario;
use leafdyn::study::{Data, Fit, FitError, FitOutcome, fit};
use leafdyn_testing::fit::{fitted, gives_back, request, within_bars};
use leafdyn_testing::random::Draw;
use leafdyn_testing::*;

/// The leaf, and how the picture shows it: from the side, a little turned.
const PHOTO: &str = "[photo]\nscale = 0.012\nx = 210.0\ny = 640.0\nrotation = 0.06\n";
const FREE: [&str; 5] = [
    "section.young",
    "photo.scale",
    "photo.x",
    "photo.y",
    "photo.rotation",
];
const TRUTH: [f64; 5] = [1.3e4, 0.0125, 190.0, 655.0, 0.035];

fn lily(photo: &str) -> String {
    leafdyn_testing::branch::text("measured/lily") + photo
}

/// Pixels of points on three veins of the leaf with these numbers, level and turned over, with the
/// table of these two; only of marked points is it told where on the vein they are.
fn pixels(marked: bool, sd: f64, noise: &mut Draw) -> [String; 2] {
    let [scale, x, y, rotation] = [TRUTH[1], TRUTH[2], TRUTH[3], TRUTH[4]];
    let (sin, cos) = rotation.sin_cos();
    let mut settings = String::from("experiment,load.gravity[2]\n");
    let mut table = String::from("experiment,rod,sigma,pixel_x,pixel_y,sd\n");
    for (name, weight) in [("level", -1.18e-4), ("turned over", 1.18e-4)] {
        settings += &format!("{name},{weight:?}\n");
        let truth = FREE.iter().zip(TRUTH);
        let truth: Vec<String> = truth
            .map(|(key, value)| format!("{key}={value:?}"))
            .collect();
        let truth = format!("{}; load.gravity[2]={weight:?}", truth.join("; "));
        let leaf = settle(base(&lily(PHOTO), &truth).scenario(), 1e-9);
        for (rod, vein) in leaf.shape.rods.iter().enumerate().step_by(3) {
            let nodes = leaf.shape.stations.iter().zip(&vein.nodes);
            for (sigma, node) in nodes.step_by(4).skip(1) {
                let [right, _, up] = node.position.to_array();
                let column = x + (cos * right - sin * up) / scale + sd * noise.normal();
                let row = y - (sin * right + cos * up) / scale + sd * noise.normal();
                let sigma = if marked {
                    format!("{sigma:?}")
                } else {
                    String::new()
                };
                let sd = if sd > 0.0 { sd } else { 1.0 };
                table += &format!("{name},{},{sigma},{column:?},{row:?},{sd:?}\n", rod + 1);
            }
        }
    }
    [settings, table]
}

fn found(marked: bool, sd: f64, tolerance: Option<f64>) -> Fit {
    let [settings, table] = pixels(marked, sd, &mut Draw(7));
    let data = [settings.as_str(), table.as_str()];
    let mut wanted = request(base(&lily(PHOTO), ""), &data, &FREE);
    wanted.tolerance = tolerance;
    fitted(&wanted)
}

/// Without noise the leaf and its picture come back, and in few steps: the derivatives by numbers of
/// the picture are exact.
#[test]
fn leaf_and_picture_come_back() {
    for marked in [true, false] {
        let found = found(marked, 0.0, Some(1e-8));
        gives_back(&found, &TRUTH, 1e-6);
        assert_eq!(found.outcome, FitOutcome::Converged, "{:?}", found.says);
        assert!(found.work.evaluations < 20, "{:?}", found.work);
        assert!(
            found
                .residuals
                .iter()
                .all(|it| it.what.starts_with("pixel_"))
        );
        let fitted = Scenario::from_toml(&found.fitted).unwrap();
        let scale = fitted.photo.unwrap().scale;
        assert!((scale / TRUTH[1] - 1.0).abs() < 1e-6);
        // For drawing, points are where they are in space.
        for (_, leaf) in &found.leaves {
            for (rod, at) in &leaf.traced {
                let [Some(x), None, Some(z)] = *at else {
                    panic!("{at:?}");
                };
                let curve = &leaf.curves[*rod];
                let near = curve.iter().map(|p| (p.x - x).hypot(p.z - z));
                assert!(near.fold(f64::INFINITY, f64::min) < 0.5);
            }
        }
    }
}

/// With noise of two pixels every number is within its bar, and the place of the base is known to
/// about as much.
#[test]
fn noise_leaves_them_within_their_bars() {
    let found = found(true, 2.0, None);
    assert_eq!(found.outcome, FitOutcome::Converged, "{:?}", found.says);
    within_bars(&found, &TRUTH, 2.0);
    let of = &found.parameters[2];
    let half = 0.5 * (of.high.unwrap() - of.low.unwrap());
    assert!((0.5..8.0).contains(&half), "{half} pixels");
}

/// A ruler in the picture says what the scale says.
#[test]
fn a_ruler_gives_the_scale() {
    let ruler = "[photo]\nx = 210.0\ny = 640.0\nruler_from = [100, 50]\nruler_to = [400, 450]\nruler_length = 6\n";
    let scenario = Scenario::from_toml(&lily(ruler)).unwrap();
    assert!((scenario.photo.unwrap().scale - 0.012).abs() < 1e-15);
    let both = lily(&(ruler.to_owned() + "scale = 0.012\n"));
    let error = Scenario::from_toml(&both).unwrap_err().to_string();
    assert!(
        error.contains("photo.scale = 0.012: a ruler says so, too"),
        "{error}"
    );
    let along = lily("[photo]\nscale = 0.01\nx = 0\ny = 0\nright = \"y\"\nup = \"-y\"\n");
    let error = Scenario::from_toml(&along).unwrap_err().to_string();
    assert!(
        error.contains("photo.up = \"-y\": is the axis of photo.right"),
        "{error}"
    );
}

/// Pixels need a photograph, and are no coordinates in space besides.
#[test]
fn what_a_picture_does_not_say_is_refused() {
    let table = "rod,pixel_x,pixel_y\n1,200,300\n1,220,290\n";
    let refused = |text: &str, table: &str| -> String {
        let mut data = Data::default();
        let read = data.read(table, "pixels.csv", 7);
        let request = request(base(text, ""), &[], &["section.young"]);
        let request = leafdyn::study::FitRequest { data, ..request };
        let error = read.and_then(|()| fit(&request, &mut |_| {}));
        let error: FitError = error.map(|_| ()).unwrap_err();
        error.to_string()
    };
    let without = refused(&lily(""), table);
    assert!(
        without.contains("pixels.csv:2: pixels of a photograph"),
        "{without}"
    );
    let both = refused(&lily(PHOTO), "rod,x,pixel_x,pixel_y\n1,0.1,200,300\n");
    assert!(
        both.contains("pixels.csv:2: a point has coordinates"),
        "{both}"
    );
}
