//! A posture tells the least modulus at which it is stable: as closed forms, other integrations and relaxations do,
//! within its interval if its points have noise.

mod closed_forms;
mod noisy_points;
mod off_axis;
mod point_weights;
mod refused;
mod relaxed;
mod two_postures;

use glam::DVec3;
use leafdyn::posture::leaf::ScenarioRod;
use leafdyn::posture::rod::HangingRod;
use leafdyn::posture::smoothing::CurvePoint;
use leafdyn::posture::{GivenCurve, Posture};
use leafdyn_testing::random::Draw;
use leafdyn_testing::{Scenario, parse};
use std::sync::Arc;

/// A rod of length 1 with this torsion and bending, and these loads.
fn scenario(stiffness: [&str; 3], loads: &str) -> Scenario {
    let [torsion, second, third] = stiffness;
    parse(&format!(
        r#"
        name = "posture"
        leaf = {{ rods = 1, length = 1.0, fan = [0.0] }}
        stiffness = {{ torsion = {torsion}, bending_2 = {second}, bending_3 = {third}, axial = inf, shear_2 = inf, shear_3 = inf }}
        load = {{ {loads} }}
        "#
    ))
}

fn hanging(scenario: &Scenario) -> HangingRod {
    ScenarioRod::new(scenario).unwrap().rod
}

/// The posture of a known curve.
fn posture(scenario: &Scenario, curve: GivenCurve, plane: Option<DVec3>) -> Posture {
    Posture::from_curve(hanging(scenario), curve, plane, 8).unwrap()
}

/// A straight line from the origin.
fn straight(along: DVec3) -> GivenCurve {
    Arc::new(move |t| CurvePoint {
        position: t * along,
        first: along,
        second: DVec3::ZERO,
    })
}

/// A curve whose tangent has an elevation and an azimuth that are polynomials of the fraction of its length.
#[derive(Clone)]
struct Twin {
    elevation: [f64; 4],
    azimuth: [f64; 3],
    length: f64,
}

/// A value and its derivative.
fn polynomial(coefficients: &[f64], s: f64) -> [f64; 2] {
    let mut sums = [0.0; 2];
    for c in coefficients.iter().rev() {
        sums = [sums[0] * s + c, sums[1] * s + sums[0]];
    }
    sums
}

impl Twin {
    /// A leaf that rises and arches over, in the x-z plane unless `spatial`.
    fn draw(draw: &mut Draw, spatial: bool, length: f64) -> Twin {
        let (up, down) = (draw.uniform(0.3, 1.4), draw.uniform(-2.4, -0.2));
        let [a, b] = [0.5, 0.4].map(|size| size * draw.normal());
        let [c, d] = [0.5, 0.4].map(|size| size * draw.normal());
        Twin {
            elevation: [up, 0.6 * down + a, 0.4 * down - a + b, -b],
            azimuth: if spatial { [0.0, c, d] } else { [0.0; 3] },
            length,
        }
    }

    /// The tangent and its derivative by the fraction of the length.
    fn tangent(&self, s: f64) -> [DVec3; 2] {
        let [e, de] = polynomial(&self.elevation, s);
        let [a, da] = polynomial(&self.azimuth, s);
        let level = DVec3::new(a.cos(), a.sin(), 0.0);
        let left = DVec3::new(-a.sin(), a.cos(), 0.0);
        let tangent = e.cos() * level + e.sin() * DVec3::Z;
        let turned = de * (e.cos() * DVec3::Z - e.sin() * level) + da * e.cos() * left;
        [tangent, turned]
    }

    /// By the rule of Gauss and Legendre with two points, on 64 parts.
    fn position(&self, s: f64) -> DVec3 {
        let parts = 64;
        let width = s / parts as f64;
        let offset = 0.5 / 3_f64.sqrt();
        let middles = (0..parts).map(|k| (k as f64 + 0.5) * width);
        let sums = middles.map(|middle| {
            let ends = [-offset, offset].map(|by| self.tangent(middle + by * width)[0]);
            0.5 * width * (ends[0] + ends[1])
        });
        self.length * sums.sum::<DVec3>()
    }

    fn curve(&self) -> GivenCurve {
        let twin = self.clone();
        Arc::new(move |s| {
            let [tangent, turned] = twin.tangent(s);
            CurvePoint {
                position: twin.position(s),
                first: twin.length * tangent,
                second: twin.length * turned,
            }
        })
    }
}

/// Points at equal distances along a curve with normal noise in each coordinate, or in x and z alone.
fn measured(
    curve: &dyn Fn(f64) -> DVec3,
    count: usize,
    noise: f64,
    flat: bool,
    draw: &mut Draw,
) -> Vec<DVec3> {
    let points = (0..count).map(|k| {
        let [x, y, z] = [0; 3].map(|_| noise * draw.normal());
        let y = if flat { 0.0 } else { y };
        curve(k as f64 / (count - 1) as f64) + DVec3::new(x, y, z)
    });
    points.collect()
}
