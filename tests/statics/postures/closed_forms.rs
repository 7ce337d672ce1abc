//! Straight columns and level strips against their buckling loads, tapered ones against zeros of Bessel functions, and
//! bent postures against the equation of Jacobi, integrated.

use super::*;
use leafdyn::posture::Governing;
use leafdyn_testing::{PI, Profile};

const ROUND: [&str; 3] = ["0.8", "1.0", "1.0"];
const WEIGHT: &str = "gravity = [0.0, 0.0, -1.0]";

#[track_caller]
fn near(found: f64, exact: f64) {
    assert!((found / exact - 1.0).abs() < 1e-6, "{found}, not {exact}");
}

/// E* of a column under its own weight and the two moduli below it, q L^3/(E I) = 7.837347439, 55.977030, 148.508298
/// (A. G. Greenhill, Proc. Camb. Phil. Soc. 4 (1881), 65: zeros of the Bessel function of order -1/3); each twice, as
/// the column is round.
#[test]
fn a_column_buckles_under_its_own_weight() {
    let column = posture(&scenario(ROUND, WEIGHT), straight(DVec3::Z), Some(DVec3::Y));
    let ladder = column.ladder();
    for (pair, exact) in ladder.chunks(2).zip([7.837347439, 55.977030, 148.508298]) {
        near(1.0 / pair[0], exact);
        near(1.0 / pair[1], exact);
    }
    let critical = column.critical_young();
    assert_eq!(column.index(1.01 * critical), 0);
    assert_eq!(column.index(0.99 * critical), 2);
    assert_eq!(column.critical.at, 0.0);
    // A hanging one is stable at any modulus.
    let hangs = posture(
        &scenario(ROUND, WEIGHT),
        straight(-DVec3::Z),
        Some(DVec3::Y),
    );
    assert_eq!((hangs.critical_young(), hangs.index(1e-9)), (0.0, 0));
}

/// Euler's load of a column that is free at its tip, and a column at an angle: E* is that of the part of its weight
/// along it, as it has grown so that it is straight.
#[test]
fn a_load_at_the_tip_and_an_inclined_column() {
    let loaded = scenario(ROUND, "tip_force = [0.0, 0.0, -1.0]");
    let column = posture(&loaded, straight(2.0 * DVec3::Z), Some(DVec3::Y));
    near(1.0 / column.critical_young(), PI * PI / 16.0);
    for angle in [0.2_f64, 0.7, 1.3] {
        let along = DVec3::new(angle.cos(), 0.0, angle.sin());
        // Stiff in torsion and sideways: it bends on in its plane.
        let strip = scenario(["1e3", "1.0", "1e3"], WEIGHT);
        let inclined = posture(&strip, straight(3.0 * along), Some(DVec3::Y));
        near(inclined.critical_young(), 27.0 * angle.sin() / 7.837347439);
        assert_eq!(inclined.critical.governing, Governing::InPlane);
    }
}

/// A level strip twists out of its plane at P L^2 = 4.012599344 and q L^3 = 12.853763324 sqrt(E I3 G J)
/// (L. Prandtl, Kipp-Erscheinungen, 1899; A. G. M. Michell, Phil. Mag. 48 (1899), 298).
#[test]
fn a_level_strip_twists_out_of_its_plane() {
    let (torsion, sideways) = (0.3, 0.01);
    for (load, exact) in [("tip_force", 4.012599344), ("gravity", 12.853763324)] {
        let strip = scenario(
            ["0.3", "1.0", "0.01"],
            &format!("{load} = [0.0, 0.0, -1.0]"),
        );
        let level = posture(&strip, straight(DVec3::X), Some(DVec3::Y));
        near(
            1.0 / level.critical_young() / f64::sqrt(torsion * sideways),
            exact,
        );
        assert_eq!(level.critical.governing, Governing::OutOfPlane);
        // The direction of the strip in the lab does not matter.
        let turned = posture(&strip, straight(DVec3::new(0.6, -0.8, 0.0)), None);
        near(turned.critical_young(), level.critical_young());
    }
}

/// Bessel's J of an order without its power: the sum of (-x^2/4)^k/(k! (order + 1) .. (order + k)).
fn bessel(order: f64, x: f64) -> f64 {
    let (mut term, mut sum) = (1.0, 1.0);
    for k in 1..60 {
        let k = f64::from(k);
        term *= -0.25 * x * x / (k * (order + k));
        sum += term;
    }
    sum
}

fn first_zero(order: f64) -> f64 {
    let (mut low, mut high) = (0.1, 4.0);
    for _ in 0..80 {
        let middle = 0.5 * (low + high);
        if bessel(order, middle) > 0.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

/// With x from the tip, I = x^p and a weight x^r: (E x^p theta')' + x^(r + 1)/(r + 1) theta = 0. With
/// b = (r + 3 - p)/2 the regular solution is x^((1 - p)/2) J_m(k x^b/b), m = (p - 1)/(2 b), k^2 = 1/(E (r + 1)), and it
/// vanishes at the base if k/b is the first zero. A triangular blade has p = r = 1.
#[test]
fn tapered_columns() {
    for (p, r) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
        let loads = match r {
            1 => "distributed = { at = [0.0, 1.0], value = [[0.0, 0.0, -1.0], [0.0, 0.0, 0.0]] }",
            _ => WEIGHT,
        };
        let mut rod = hanging(&scenario(ROUND, loads));
        if p == 1 {
            // A scenario's stiffness may not become as small.
            let taper = Profile::Linear {
                at: vec![0.0, 1.0],
                value: vec![1.0, 1e-12],
            };
            rod.stiffness = [taper.clone(), taper.clone(), taper];
        }
        let column = Posture::from_curve(rod, straight(DVec3::Z), Some(DVec3::Y), 8).unwrap();
        let [p, r] = [p, r].map(f64::from);
        let half = 0.5 * (r + 3.0 - p);
        let k = half * first_zero((p - 1.0) / (2.0 * half));
        near(1.0 / column.critical_young(), (r + 1.0) * k * k);
    }
}

/// Loads on points and a stiffness that jumps: the column of two parts, I = 4 below its middle and 1 above, under a force
/// P in its middle and one P at its tip: with a^2 = 2 P/(4 E) and b^2 = P/E the slopes are sin(a s) and C cos(b (1 - s)),
/// and the moments meet: 4 a/tan(a/2) = b tan(b/2).
#[test]
fn a_stepped_column_with_a_load_in_its_middle() {
    let step = "{ at = [0.0, 0.5, 0.5, 1.0], value = [4.0, 4.0, 1.0, 1.0] }";
    let loads =
        "tip_force = [0.0, 0.0, -1.0], point = [{ vein = 1, at = 0.5, force = [0.0, 0.0, -1.0] }]";
    let column = scenario([step, step, step], loads);
    let column = posture(&column, straight(DVec3::Z), Some(DVec3::Y));
    let unmet = |young: f64| {
        let (a, b) = ((0.5 / young).sqrt(), (1.0 / young).sqrt());
        4.0 * a / (0.5 * a).tan() - b * (0.5 * b).tan()
    };
    let (mut low, mut high) = (0.15, 10.0);
    for _ in 0..80 {
        let middle = 0.5 * (low + high);
        if unmet(middle) > 0.0 {
            high = middle;
        } else {
            low = middle;
        }
    }
    near(column.critical_young(), low);
}

/// In its plane a posture loses its stability where the solution of E I eta'' = (n . t) eta, eta(0) = 0, eta'(0) = 1 has
/// eta'(L) = 0: by the method of Runge and Kutta, for bent leaves.
#[test]
fn bent_postures_in_their_plane() {
    let mut draw = Draw(11);
    let mut compared = 0;
    for _ in 0..20 {
        let twin = Twin::draw(&mut draw, false, 1.0);
        let leaf = scenario(
            ["50.0", "1.0", "50.0"],
            "gravity = [0.0, 0.0, -1.0], tip_force = [0.1, 0.0, -0.3]",
        );
        let found = posture(&leaf, twin.curve(), Some(DVec3::Y));
        if found.critical_young() < 1e-3 || found.critical.governing != Governing::InPlane {
            continue;
        }
        let slope_at_tip = |young: f64| {
            let steps = 2000;
            let h = 1.0 / f64::from(steps);
            let rate = |s: f64, [eta, slope]: [f64; 2]| {
                let force = DVec3::new(0.1, 0.0, -0.3 - (1.0 - s));
                [slope, force.dot(twin.tangent(s)[0]) * eta / young]
            };
            let add = |[a, b]: [f64; 2], by: f64, [c, d]: [f64; 2]| [a + by * c, b + by * d];
            let mut state = [0.0, 1.0];
            for k in 0..steps {
                let s = f64::from(k) * h;
                let k1 = rate(s, state);
                let k2 = rate(s + 0.5 * h, add(state, 0.5 * h, k1));
                let k3 = rate(s + 0.5 * h, add(state, 0.5 * h, k2));
                let k4 = rate(s + h, add(state, h, k3));
                for (step, by) in [(k1, 1.0), (k2, 2.0), (k3, 2.0), (k4, 1.0)] {
                    state = add(state, by * h / 6.0, step);
                }
            }
            state[1]
        };
        let young = found.critical_young();
        assert!(slope_at_tip(young * (1.0 + 1e-6)) > 0.0);
        assert!(slope_at_tip(young * (1.0 - 1e-6)) < 0.0);
        compared += 1;
    }
    assert!(compared >= 8, "{compared}");
}

/// The eigenvalues converge as the tenth power of the elements' length.
#[test]
fn twice_as_many_elements_have_a_thousandth_of_the_error() {
    let strip = scenario(["0.3", "1.0", "0.01"], WEIGHT);
    let young = |elements: usize| {
        let rod = hanging(&strip);
        let found = Posture::from_curve(rod, straight(DVec3::X), Some(DVec3::Y), elements);
        found.unwrap().critical_young()
    };
    let exact = young(12);
    let [coarse, fine] = [2, 4].map(|elements| (young(elements) - exact).abs());
    assert!(
        coarse / fine > 300.0 && coarse / fine < 3000.0,
        "{}",
        coarse / fine
    );
}
