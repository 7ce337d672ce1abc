//! A clamped arch under a load along it, against its symmetric half, whose crown is guided,
//! solved by shooting; and the load at which it sways, against the antisymmetric half.

mod common;

use common::branch::{changes_at, follow};
use common::{parse, settle};

/// Half of the opening angle.
const ALPHA: f64 = 0.9;

/// An arch of length one that neither stretches nor shears, in its plane.
fn arch(load: f64) -> String {
    let span = ALPHA.sin() / ALPHA;
    format!(
        r#"
        name = "arch"
        leaf = {{ rods = 1, length = 1.0, fan = [{ALPHA}] }}
        stiffness = {{ torsion = 50.0, bending_2 = 50.0, bending_3 = 1.0, axial = inf, shear_2 = inf, shear_3 = inf }}
        rest = {{ bend_3 = {:?} }}
        tip = {{ held = "clamped", position = [{span:?}, 0.0, 0.0], angles = {:?} }}
        load = {{ gravity = [0.0, {:?}, 0.0] }}
        "#,
        -2.0 * ALPHA,
        -ALPHA,
        -load
    )
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
    let steps = 400;
    let h = 0.5 / f64::from(steps);
    let mut y = [0.0, 0.0, ALPHA, moment];
    let ahead = |y: [f64; 4], k: [f64; 4], by: f64| std::array::from_fn(|c| y[c] + by * k[c]);
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
        let leaf = settle(&parse(&arch(load)), 1e-9).at_stations(&parse(&arch(load)), Some(20));
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
    let (mut low, mut high) = (load, load + step);
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        match sways(middle, symmetric(middle, base)) * first < 0.0 {
            true => high = middle,
            false => low = middle,
        }
    }
    let vary = format!("load.gravity[1]=0..{:?}", -1.1 * low);
    let found = follow(&arch(0.0), "", &vary, false);
    changes_at("arch", &found, &[(-low, 1)], 1e-6);
}
