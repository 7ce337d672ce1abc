//! The folds of a stiff arch with one end pinned, against shooting.
//!
//! A clamped arch under a load along it, against its symmetric half, whose crown is guided,
//! solved by shooting; and the load at which it sways, against the antisymmetric half.

mod common;

use common::branch::{changes_at, follow, request};
use common::plane;
use common::*;
use leafdyn::study::trace;

/// Half of the opening angle.
const ALPHA: f64 = 0.9;

/// An arch of length one in its plane with this half angle, and this stiffness against stretch
/// and shear, whose tip is held.
fn arch(alpha: f64, held: &str, axial: &str, load: f64) -> String {
    let span = alpha.sin() / alpha;
    let clamp = match held {
        "clamped" => format!(", angles = {:?}", -alpha),
        _ => String::new(),
    };
    format!(
        r#"
        name = "arch"
        leaf = {{ rods = 1, length = 1.0, fan = [{alpha}] }}
        stiffness = {{ torsion = 50.0, bending_2 = 50.0, bending_3 = 1.0, axial = {axial}, shear_2 = {axial}, shear_3 = {axial} }}
        rest = {{ bend_3 = {:?} }}
        tip = {{ held = "{held}", position = [{span:?}, 0.0, 0.0]{clamp} }}
        load = {{ gravity = [0.0, {:?}, 0.0] }}
        "#,
        -2.0 * alpha,
        -load
    )
}

/// One that neither stretches nor shears.
fn rigid(load: f64) -> String {
    arch(ALPHA, "clamped", "inf", load)
}

/// Place, angle and moment at the crown of an arch that leaves its base with this moment
/// and force: theta' = m - 2 alpha, m' = n_x sin theta - n_y cos theta, n_y' = q, by the
/// method of Runge and Kutta.
fn crown(load: f64, [moment, along, across]: [f64; 3]) -> [f64; 4] {
    let slope = |s: f64, [_, _, theta, m]: [f64; 4]| {
        let n_y = across + load * s;
        let (sin, cos) = theta.sin_cos();
        [cos, sin, m - 2.0 * ALPHA, along * sin - n_y * cos]
    };
    runge_kutta(slope, [0.0, 0.0, ALPHA, moment], 0.5, 400)
}

/// Derivatives of two results by two of the three numbers at the base, by differences.
fn derivatives(load: f64, base: [f64; 3], of: [usize; 2], by: [usize; 2]) -> [[f64; 2]; 2] {
    let step = 1e-5;
    by.map(|k| {
        let at = |sign: f64| {
            let mut base = base;
            base[k] += sign * step;
            crown(load, base)
        };
        let (up, down) = (at(1.0), at(-1.0));
        of.map(|result| (up[result] - down[result]) / (2.0 * step))
    })
}

fn determinant([[a, b], [c, d]]: [[f64; 2]; 2]) -> f64 {
    a * d - b * c
}

/// Moment and force at the base of the symmetric arch, from those near it: at the crown it
/// is level, and half way.
fn symmetric(load: f64, mut base: [f64; 3]) -> [f64; 3] {
    let half = 0.5 * ALPHA.sin() / ALPHA;
    base[2] = -0.5 * load;
    for _ in 0..20 {
        let [x, _, theta, _] = crown(load, base);
        let off = [x - half, theta];
        let by = derivatives(load, base, [0, 2], [0, 1]);
        let whole = determinant(by);
        base[0] -= (off[0] * by[1][1] - off[1] * by[1][0]) / whole;
        base[1] -= (off[1] * by[0][0] - off[0] * by[0][1]) / whole;
    }
    base
}

#[test]
fn an_arch_sinks_as_its_half_with_a_guided_crown() {
    let mut base = [0.0; 3];
    for load in [5.0, 20.0, 40.0] {
        base = symmetric(load, base);
        let [x, y, _, moment] = crown(load, base);
        let leaf = settle(&parse(&rigid(load)), 1e-9).at_stations(&parse(&rigid(load)), Some(20));
        let found = &leaf.shape.rods[0].nodes[10];
        assert!((found.position.x - x).abs() < 1e-8, "{load}: {x}");
        assert!((found.position.y - y).abs() < 1e-8, "{load}: {y}");
        assert!((found.m.z - moment).abs() < 1e-6, "{load}: {moment}");
        let force = leaf.reaction.unwrap().force;
        // The other holder feels the thrust the other way.
        let thrust = force.x.abs() - base[1].abs();
        assert!(thrust.abs() < 1e-6, "{load}: {force} {base:?}");
    }
}

#[test]
fn an_arch_sways_where_its_antisymmetric_half_does() {
    // Of a sway the crown neither sinks nor has a moment, and the thrust stays.
    let sways = |load: f64, base: [f64; 3]| determinant(derivatives(load, base, [1, 3], [0, 2]));
    let (mut load, mut base) = (0.0, [0.0; 3]);
    let first = sways(0.0, base);
    let step = 2.0;
    loop {
        let next = symmetric(load + step, base);
        if sways(load + step, next) * first < 0.0 {
            break;
        }
        (load, base) = (load + step, next);
        assert!(load < 1000.0);
    }
    let critical = bisect(load, load + step, |load| sways(load, symmetric(load, base)));
    let vary = format!("load.gravity[1]=0..{:?}", -1.1 * critical);
    let found = follow(&rigid(0.0), "", &vary, false);
    changes_at("arch", &found, &[(-critical, 1)], 1e-6);
}

/// In some of them branches cross next to a fold, after which the branch soon turns back.
#[test]
fn critical_points_do_not_depend_on_the_tolerance_beyond_what_is_told() {
    let arches = [
        (0.3171, "clamped", "1e5", -90.0, 4, 1e-7),
        (0.3171, "clamped", "2e5", -90.0, 4, 1e-7),
        (
            0.46448069911199,
            "pinned",
            "12301.7568832803",
            -62.814326719,
            2,
            1e-8,
        ),
    ];
    for (alpha, held, axial, last, count, tight) in arches {
        let branch = |tolerance: f64| {
            let base = base(&arch(alpha, held, axial, 0.0), "");
            let vary = format!("load.gravity[1]=0..{last}");
            let request = request(base, &vary, tolerance, 2000);
            let found = trace(&request, &mut |_, _, _| {}).unwrap();
            assert!(found.complete, "{alpha} {axial}: {:?}", found.remark);
            found.branches[0].clone()
        };
        let [loose, tight] = [1e-6, tight].map(branch);
        let [loose, tight] = [&loose, &tight].map(|it| it.critical().collect::<Vec<_>>());
        assert_eq!(loose.len(), count, "{alpha} {axial}");
        for ((_, loose), (_, tight)) in loose.iter().zip(&tight) {
            assert_eq!(loose.index, tight.index);
            let off = (loose.value - tight.value).abs();
            let told = loose.value_error.unwrap() + tight.value_error.unwrap();
            assert!(off <= told && told < 1e-4, "{axial}: {off} {told}");
        }
    }
}

/// Half of the opening angle of a shallow arch, of which one end is pinned.
const SHALLOW: f64 = 0.5;

/// The place, angle and moment at the pinned end of an arch with this compliance in
/// stretch and shear that leaves its base with this moment and force, by the method of
/// Runge and Kutta.
fn pinned_end(compliance: f64, steps: u32, [moment, along, across, load]: [f64; 4]) -> [f64; 4] {
    let slope = |s: f64, [_, _, theta, m]: [f64; 4]| {
        let n_y = across + load * s;
        let (sin, cos) = theta.sin_cos();
        let stretch = 1.0 + compliance * (along * cos + n_y * sin);
        let shear = compliance * (n_y * cos - along * sin);
        let (x, y) = (stretch * cos - shear * sin, stretch * sin + shear * cos);
        [x, y, m - 2.0 * SHALLOW, y * along - x * n_y]
    };
    runge_kutta(slope, [0.0, 0.0, SHALLOW, moment], 1.0, steps)
}

/// The base and the load at the fold next to others: the end is where it is pinned, without
/// a moment, and to first order stays so at this load.
fn fold(compliance: f64, steps: u32, near: [f64; 4]) -> [f64; 4] {
    type Base = nalgebra::Vector4<f64>;
    let span = SHALLOW.sin() / SHALLOW;
    let off = |base: Base| {
        let [x, y, _, m] = pinned_end(compliance, steps, base.into());
        nalgebra::Vector3::new(x - span, y, m)
    };
    let by = |base: Base| {
        let column = |k: usize| {
            let step = Base::ith(k, 1e-5);
            (off(base + step) - off(base - step)) / 2e-5
        };
        nalgebra::Matrix3::from_columns(&[column(0), column(1), column(2)])
    };
    let all = |base: Base| {
        let off = off(base);
        Base::new(off.x, off.y, off.z, by(base).determinant())
    };
    let mut base = Base::from(near);
    for _ in 0..20 {
        let column = |k: usize| {
            let step = Base::ith(k, 1e-3);
            (all(base + step) - all(base - step)) / 2e-3
        };
        let columns = [0, 1, 2, 3].map(column);
        let matrix = nalgebra::Matrix4::from_columns(&columns);
        base -= matrix.try_inverse().unwrap() * all(base);
    }
    base.into()
}

/// The vertical force per length at that fold; from there to the next one.
fn extrapolated_fold(compliance: f64, near: &mut [f64; 4]) -> f64 {
    let [coarse, fine] = [400, 800].map(|steps| fold(compliance, steps, *near));
    *near = fine;
    -(fine[3] + (fine[3] - coarse[3]) / 15.0)
}

/// Near the base and the load of both folds.
const NEAR: [[f64; 4]; 2] = [
    [-1.389, -56.789, -30.936, 59.885],
    [-0.0736, -81.902, -8.415, 16.679],
];

fn pinned(axial: &str) -> String {
    arch(SHALLOW, "pinned", axial, 0.0)
}

#[test]
fn folds_of_stiff_arches_are_within_what_is_told() {
    for axial in ["1e5", "1e6", "inf"] {
        let text = pinned(axial);
        let found = follow(&text, "", "load.gravity[1]=0..-60", false);
        assert!(found.complete, "{axial}: {:?}", found.remark);
        let compliance = axial.parse::<f64>().unwrap().recip();
        let critical: Vec<_> = found.branches[0].critical().collect();
        assert_eq!(critical.len(), NEAR.len(), "{axial}");
        for ((_, point), near) in critical.iter().zip(NEAR) {
            let wanted = extrapolated_fold(compliance, &mut near.clone());
            let off = (point.value - wanted).abs();
            let told = point.value_error.unwrap();
            // What is left of the shooting.
            assert!(off < told + 3e-9, "{axial}: {} {wanted}", point.value);
            assert!(off < 1e-7 && told < 3e-6, "{axial}: {told}");
        }
    }
}

#[test]
fn boundaries_of_stiff_arches_are_within_what_is_told() {
    let load = "load.gravity[1]=0..-60";
    let stiffness = "stiffness.axial+stiffness.shear_2+stiffness.shear_3=2e4..1e6:8log";
    let found = plane::follow(&pinned("1e5"), "", load, stiffness);
    assert!(found.complete, "{:?}", found.remark);
    assert_eq!(found.curves.len(), NEAR.len());
    for (curve, mut near) in found.curves.iter().zip(NEAR) {
        // From the stiffest on.
        let exact = curve.points.iter().filter(|point| point.errors[1] == 0.0);
        for point in exact.rev() {
            let wanted = extrapolated_fold(point.values[1].recip(), &mut near);
            let (off, told) = ((point.values[0] - wanted).abs(), point.errors[0]);
            assert!(off < told + 3e-9, "{:?}: {wanted}", point.values);
            assert!(told < 1e-5, "{:?}: {told}", point.values);
        }
    }
}
