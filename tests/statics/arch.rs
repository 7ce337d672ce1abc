//! The folds of a stiff arch with one end pinned, against shooting.
//!
//! A clamped arch under a load along it, against its halves: the symmetric one, whose crown
//! is guided, and the antisymmetric one, which tells when it sways.

use leafdyn::study::trace;
use leafdyn_testing::branch::{changes_at, follow, request};
use leafdyn_testing::plane;
use leafdyn_testing::*;
use nalgebra::{SMatrix, SVector, Vector3, Vector4};

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

/// Load; place and moment at the crown, which is guided, and thrust: shooting over half of
/// the arch, 400 steps of Runge and Kutta.
const CROWNS: &str = "
     5  0.435181616459713  0.210112564191802  0.007253890331304   2.455059974193660
    20  0.435181616459713  0.209771508836800  0.031148245841752   9.835440140538067
    40  0.435181616459713  0.209235751636409  0.069028051695249  19.717910800689413
";

#[test]
fn an_arch_sinks_as_its_half_with_a_guided_crown() {
    for [load, x, y, moment, thrust] in table(CROWNS) {
        let arch = parse(&rigid(load));
        let leaf = settle(&arch, 1e-9).at_stations(&arch, Some(20));
        let found = &leaf.shape.rods[0].nodes[10];
        let what = format!("under {load}");
        close(&what, found.position.x, x, 1e-8);
        close(&what, found.position.y, y, 1e-8);
        close(&what, found.m.z, moment, 1e-6);
        close(&what, leaf.reaction.unwrap().force.x.abs(), thrust, 1e-6);
    }
}

/// Where the antisymmetric half, whose crown neither sinks nor has a moment, can move under
/// the same thrust: shooting, 400 steps.
#[test]
fn an_arch_sways_where_its_antisymmetric_half_does() {
    let critical = 150.8587531279734;
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
        let [loose, tight] = [&loose, &tight].map(|it| it.critical_points().collect::<Vec<_>>());
        assert_eq!(loose.len(), count, "{alpha} {axial}");
        for ((_, loose), (_, tight)) in loose.iter().zip(&tight) {
            assert_eq!(loose.index, tight.index);
            let off = (loose.value - tight.value).abs();
            let told = loose.value_error.unwrap() + tight.value_error.unwrap();
            assert!(off <= told && told < 1e-4, "{axial}: {off} {told}");
        }
    }
}

/// The state at s = `end` of y' = slope(s, y), by the classic rule of Runge and Kutta.
fn runge_kutta<const N: usize>(
    slope: impl Fn(f64, [f64; N]) -> [f64; N],
    mut y: [f64; N],
    end: f64,
    steps: u32,
) -> [f64; N] {
    let h = end / f64::from(steps);
    let ahead = |y: [f64; N], k: [f64; N], by: f64| std::array::from_fn(|c| y[c] + by * k[c]);
    for step in 0..steps {
        let s = h * f64::from(step);
        let a = slope(s, y);
        let b = slope(s + 0.5 * h, ahead(y, a, 0.5 * h));
        let c = slope(s + 0.5 * h, ahead(y, b, 0.5 * h));
        let d = slope(s + h, ahead(y, c, h));
        y = std::array::from_fn(|k| y[k] + h / 6.0 * (a[k] + 2.0 * (b[k] + c[k]) + d[k]));
    }
    y
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

/// Derivatives of results by numbers, by differences, as columns.
fn jacobian<const R: usize>(
    at: Vector4<f64>,
    step: f64,
    of: impl Fn(Vector4<f64>) -> SVector<f64, R>,
) -> SMatrix<f64, R, 4> {
    let columns = [0, 1, 2, 3].map(|k| {
        let by = Vector4::ith(k, step);
        (of(at + by) - of(at - by)) / (2.0 * step)
    });
    SMatrix::from_columns(&columns)
}

/// The base and the load at the fold next to others: the end is where it is pinned, without
/// a moment, and to first order stays so at this load.
fn fold(compliance: f64, steps: u32, near: [f64; 4]) -> [f64; 4] {
    let span = SHALLOW.sin() / SHALLOW;
    let off = |base: Vector4<f64>| {
        let [x, y, _, m] = pinned_end(compliance, steps, base.into());
        Vector3::new(x - span, y, m)
    };
    let all = |base| {
        let by = jacobian(base, 1e-5, off);
        off(base).push(by.fixed_columns::<3>(0).determinant())
    };
    let mut base = Vector4::from(near);
    for _ in 0..20 {
        base -= jacobian(base, 1e-3, all).try_inverse().unwrap() * all(base);
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
        let critical: Vec<_> = found.branches[0].critical_points().collect();
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
