//! Twins: leaves in postures of which everything is known, measured with noise.

use super::*;
use leafdyn::posture::points::PosturePoints;

const LENGTH: f64 = 0.3;

/// What one twin came to.
struct Outcome {
    exact: f64,
    interval: [f64; 2],
    found: f64,
}

fn measure(draw: &mut Draw, spatial: bool, noise: f64) -> Outcome {
    let twin = Twin::draw(draw, spatial, LENGTH);
    let taper = "{ at = [0.0, 1.0], value = [1.0, 0.1] }";
    let bending = if draw.chance(0.5) { taper } else { "1.0" };
    let leaf = scenario(["0.8", bending, bending], "gravity = [0.0, 0.0, -1.0]");
    let plane = (!spatial).then_some(DVec3::Y);
    let exact = posture(&leaf, twin.curve(), plane).critical_young();
    let points = measured(&|s| twin.position(s), 30, noise, !spatial, draw);
    let points = PosturePoints {
        plane,
        ..PosturePoints::in_space(points)
    };
    let found = Posture::from_points(hanging(&leaf), &points, None).unwrap();
    Outcome {
        exact,
        interval: found.critical_interval(),
        found: found.critical_young(),
    }
}

/// Intervals of 95 % hold the exact E* of 92 to 97.5 % of 300 twins at noise of 0.1, 0.33 and 1 % of the length, in the
/// plane and in space; nine of ten are within 3 % at 0.33 %.
#[test]
fn intervals_of_the_least_modulus_are_those_of_95_percent() {
    for spatial in [false, true] {
        for noise in [0.3e-3, 1e-3, 3e-3] {
            let mut draw = Draw(31);
            let twins: Vec<Outcome> = (0..300)
                .map(|_| measure(&mut draw, spatial, noise))
                .collect();
            let holds = |it: &&Outcome| it.interval[0] <= it.exact && it.exact <= it.interval[1];
            let held = twins.iter().filter(holds).count();
            println!("noise {noise}, spatial {spatial}: {held} of 300");
            assert!(
                (276..=292).contains(&held),
                "{held} of 300 at {noise}, spatial {spatial}"
            );
            let mut errors: Vec<f64> = twins
                .iter()
                .map(|it| (it.found / it.exact - 1.0).abs())
                .collect();
            errors.sort_by(f64::total_cmp);
            assert!(
                errors[270] < 0.03 * noise / 1e-3,
                "{} at {noise}",
                errors[270]
            );
        }
    }
}

/// A bound is not above the truth: at noise of 1 mm the lower end of the interval is below the modulus of at least 93 %
/// of 200 leaves of 1.05 to 20 E*, and in the median at least 0.8 E*.
#[test]
fn a_bound_is_below_the_modulus() {
    let mut draw = Draw(41);
    let (mut below, mut parts) = (0, Vec::new());
    for k in 0..200 {
        let twin = measure(&mut draw, k % 2 == 0, 1e-3);
        let young = twin.exact * draw.log(1.05, 20.0);
        below += usize::from(twin.interval[0] <= young);
        parts.push(twin.interval[0] / twin.exact);
    }
    parts.sort_by(f64::total_cmp);
    assert!(below >= 186, "{below}");
    assert!(parts[100] >= 0.8, "{}", parts[100]);
}

/// Points without noise give the exact E* within 1 %, and their interval says so.
#[test]
fn points_without_noise() {
    let mut draw = Draw(51);
    for k in 0..40 {
        let twin = measure(&mut draw, k % 2 == 0, 0.0);
        assert!(
            (twin.found / twin.exact - 1.0).abs() < 2e-3,
            "{} {}",
            twin.found,
            twin.exact
        );
        assert!(twin.interval[1] / twin.interval[0] < 1.02);
    }
}
