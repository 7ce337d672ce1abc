//! Shapes of small motions without a potential, beside those of the beam's equation and of undamped modes.

use leafdyn::relax::{EquilibriumDoubt, MotionShape, SmallMotions};
use leafdyn_testing::*;
use nalgebra::Complex;

/// An inextensible column of unit length, stiffness and density, which hardly bends about its other axis.
const COLUMN: &str = r#"
    name = "column"
    leaf = { rods = 1, length = 1.0, fan = [0.0] }
    stiffness = { torsion = 100.0, bending_2 = 100.0, bending_3 = 1.0, axial = inf, shear_2 = inf, shear_3 = inf }
"#;

/// The column under a force against the tangent of its tip, with more in `[dynamics]`.
fn column(load: f64, dynamics: &str) -> Scenario {
    parse(&format!(
        "{COLUMN}\ndynamics = {{ density = 1.0{dynamics} }}
         [[load.point]]\nvein = 1\nat = 1.0\nforce = [{:?}, 0.0, 0.0]\nfollows = true",
        -load
    ))
}

fn with_shapes(modes: usize, options: Options) -> Options {
    Options {
        mode_shapes: true,
        ..with_modes(modes, options)
    }
}

fn motions_of(leaf: &Equilibrium) -> &SmallMotions {
    leaf.stability.small_motions.as_ref().unwrap()
}

fn shapes_of(leaf: &Equilibrium) -> &[MotionShape] {
    motions_of(leaf).shapes.as_deref().unwrap()
}

/// Beck's column (ZAMP 3, 1952), w'''' + p w'' = omega^2 w, clamped, with w'' = w''' = 0 at its tip; omega is complex
/// beyond flutter.
struct Beck {
    p: f64,
    omega: Complex<f64>,
    a: Complex<f64>,
    b: Complex<f64>,
}

impl Beck {
    fn new(p: f64, omega: Complex<f64>) -> Self {
        let root = (omega * omega + 0.25 * p * p).sqrt();
        let [a, b] = [root - 0.5 * p, root + 0.5 * p].map(Complex::sqrt);
        Beck { p, omega, a, b }
    }

    /// Zero at a frequency.
    fn characteristic(&self) -> Complex<f64> {
        let Beck { p, omega, a, b } = *self;
        let square = omega * omega;
        2.0 * square * (a.cosh() * b.cos() + 1.0) + p * omega * a.sinh() * b.sin() + p * p
    }

    /// With the frequency next to a guess, by the secant method.
    fn near(p: f64, guess: Complex<f64>) -> Self {
        let (mut before, mut at) = (Beck::new(p, guess * 1.001), Beck::new(p, guess));
        for _ in 0..40 {
            let [low, high] = [before.characteristic(), at.characteristic()];
            let step = high * (at.omega - before.omega) / (high - low);
            if step.norm() < 1e-14 * at.omega.norm() || high == low {
                break;
            }
            let next = Beck::new(p, at.omega - step);
            before = at;
            at = next;
        }
        at
    }

    /// The displacement at a place, one at the tip.
    fn shape(&self, s: f64) -> Complex<f64> {
        let Beck { a, b, .. } = *self;
        // Without bending moment at the tip.
        let even = a * a * a.cosh() + b * b * b.cos();
        let odd = a * a.sinh() + b * b.sin();
        let w = |s: f64| {
            let (a_s, b_s) = (a * s, b * s);
            (a_s.cosh() - b_s.cos()) * odd - (a_s.sinh() / a - b_s.sin() / b) * even
        };
        w(s) / w(1.0)
    }
}

/// Largest difference of a shape on a leaf's grid from displacements and later displacements across the column.
fn largest_difference(
    leaf: &Equilibrium,
    shape: &MotionShape,
    wanted: impl Fn(f64) -> [f64; 2],
) -> f64 {
    let stations = leaf.shape.curve_stations.iter();
    let found = shape.displacement[0]
        .iter()
        .zip(&shape.later_displacement[0]);
    let apart = stations.zip(found).map(|(s, (now, later))| {
        let [real, quarter] = wanted(*s);
        (now.y - real).abs().max((later.y - quarter).abs())
    });
    apart.fold(0.0, f64::max)
}

/// Three errors on grids each twice as fine as the one before fall in second order.
#[track_caller]
fn falls_in_second_order(what: &str, errors: [f64; 3]) {
    for pair in errors.windows(2) {
        let ratio = pair[0] / pair[1];
        assert!((3.6..4.4).contains(&ratio), "{what}: {errors:?}");
    }
    assert!(errors[2] < 5e-3, "{what}: {errors:?}");
}

/// Below flutter, at 20.05, two motions in phase, and beyond it one whose nodes are out of phase, each beside the
/// solution of Beck's equation, with frequency and growth.
#[test]
fn the_column_moves_as_becks_equation_has_it() {
    for (load, guesses) in [
        (14.0, vec![Complex::new(6.7, 0.0), Complex::new(16.2, 0.0)]),
        (24.0, vec![Complex::new(11.1, -4.0)]),
    ] {
        let exact: Vec<Beck> = guesses.iter().map(|it| Beck::near(load, *it)).collect();
        let scenario = column(load, ", external_damping = 0.0");
        let accurate = relaxed(&scenario, &with_shapes(2, to(1e-6)));
        let motions = motions_of(&accurate);
        let errors = motions.errors.as_ref().unwrap();
        let on_grids = [16, 32, 64].map(|segments| {
            let leaf = relaxed(&scenario, &with_shapes(2, iterated(1e-9, segments)));
            assert_eq!(shapes_of(&leaf).len(), motions_of(&leaf).growth_rates.len());
            leaf
        });
        for (k, exact) in exact.iter().enumerate() {
            // Of exp(lambda t) with lambda = i omega the growing one.
            let [growth, frequency] = [exact.omega.im.abs(), exact.omega.re];
            let found = [motions.growth_rates[k], motions.frequencies[k]];
            for (found, wanted) in found.into_iter().zip([growth, frequency]) {
                let apart = (found - wanted).abs();
                assert!(
                    apart <= errors[k],
                    "{load}, {k}: {found} {wanted} {}",
                    errors[k]
                );
            }
            assert!(errors[k] < 1e-3 * frequency, "{errors:?}");
            let frequency_errors = on_grids
                .each_ref()
                .map(|leaf| (motions_of(leaf).frequencies[k] - frequency).abs() / frequency);
            falls_in_second_order(&format!("frequency {k} at {load}"), frequency_errors);
            let shape_errors = on_grids.each_ref().map(|leaf| {
                largest_difference(leaf, &shapes_of(leaf)[k], |s| {
                    let w = exact.shape(s);
                    // Of lambda = gamma + i omega the later part is minus the imaginary one; the guess has gamma > 0.
                    [w.re, -w.im]
                })
            });
            falls_in_second_order(&format!("shape {k} at {load}"), shape_errors);
        }
        let later = shapes_of(&accurate)[0].later_displacement.iter().flatten();
        let later = later.fold(0.0_f64, |largest, node| largest.max(node.length()));
        assert_eq!(later > 0.0, load > 20.05, "{later}");
    }
}

/// External damping slows the modes of a cantilever, and internal damping, too, without changing their shapes: of the
/// frequency w without damping lambda^2 + (c + tau w^2) lambda + w^2 = 0.
#[test]
fn a_damped_cantilever_moves_in_its_undamped_modes() {
    let options = || with_shapes(2, iterated(1e-9, 16));
    // Left out it is that of the section in motions, and none in small motions.
    let rotary = ", rotary_inertia = 0.001";
    let calm = parse(&format!("{COLUMN}\ndynamics = {{ density = 1.0{rotary} }}"));
    let calm = relaxed(&calm, &options());
    let modes = calm.stability.modes.as_ref().unwrap();
    for (dynamics, [external, internal]) in [
        (", external_damping = 0.0", [0.0, 0.0]),
        (", external_damping = 0.8", [0.8, 0.0]),
        (
            ", external_damping = 0.8, internal_damping = 2e-3",
            [0.8, 2e-3],
        ),
    ] {
        // A load this small changes nothing, and makes of the leaf one without a potential.
        let leaf = relaxed(&column(1e-9, &format!("{dynamics}{rotary}")), &options());
        let motions = motions_of(&leaf);
        for (k, (mode, shape)) in modes.iter().zip(shapes_of(&leaf)).enumerate() {
            let half = 0.5 * (external + internal * mode.eigenvalue);
            let frequency = (mode.eigenvalue - half * half).sqrt();
            // Matrices are softened; eigenvalues with a potential are told without it.
            let rounding = 1e-5 * frequency;
            close("growth rate", motions.growth_rates[k], -half, rounding);
            close("frequency", motions.frequencies[k], frequency, rounding);
            let undamped = mode.displacement[0].iter().zip(&mode.rotation[0]);
            let now = shape.displacement[0].iter().zip(&shape.rotation[0]);
            for ((d, r), (wanted_d, wanted_r)) in now.zip(undamped) {
                let apart = (*d - *wanted_d).length().max((*r - *wanted_r).length());
                assert!(apart < 1e-5, "{dynamics} {k}: {apart:e}");
            }
            let later = shape.later_displacement[0].iter();
            let later = later.fold(0.0_f64, |largest, node| largest.max(node.length()));
            assert!(later < 1e-5, "{dynamics} {k}: {later:e}");
        }
    }
}

/// Of a round vein every frequency of bending is two: their shapes are across each other.
#[test]
fn equal_motions_have_shapes_of_their_own() {
    let text = COLUMN.replace("bending_2 = 100.0", "bending_2 = 1.0");
    for dynamics in [
        "external_damping = 0.0",
        "external_damping = 0.5, internal_damping = 1e-3",
    ] {
        let round = parse(&format!(
            "{text}\ndynamics = {{ density = 1.0, {dynamics} }}
             [[load.point]]\nvein = 1\nat = 1.0\nforce = [-5.0, 0.0, 0.0]\nfollows = true"
        ));
        let leaf = relaxed(&round, &with_shapes(4, iterated(1e-9, 16)));
        for pair in shapes_of(&leaf).chunks(2) {
            let tips = [0, 1].map(|k| {
                let shape = &pair[k];
                let last = |of: &[Vec<DVec3>]| *of[0].last().unwrap();
                [&shape.displacement, &shape.later_displacement].map(|of| last(of))
            });
            // The tips in the plane of both directions, complex: independent if their determinant is not zero.
            let number =
                |k: usize, of: fn(&DVec3) -> f64| Complex::new(of(&tips[k][0]), -of(&tips[k][1]));
            let [y, z] = [|it: &DVec3| it.y, |it: &DVec3| it.z];
            let determinant = number(0, y) * number(1, z) - number(0, z) * number(1, y);
            assert!(determinant.norm() > 0.1, "{dynamics}: {tips:?}");
        }
    }
}

/// In wind, whose drag is no multiple of the masses, nodes are out of phase; and so many shapes are told as growth
/// rates.
#[test]
fn drag_puts_nodes_out_of_phase() {
    let windy = parse(&format!(
        "{COLUMN}\nwind = {{ velocity = [0.0, 8.0, 0.0], density = 1.0, drag = 1.0, width = 0.5 }}
         dynamics = {{ density = 1.0, external_damping = 0.0 }}"
    ));
    let leaf = settled(&windy, &with_shapes(3, to(1e-6)));
    let shapes = shapes_of(&leaf);
    assert_eq!(shapes.len(), motions_of(&leaf).growth_rates.len());
    assert_eq!(shapes.len(), 3);
    for shape in shapes {
        assert_eq!(shape.displacement[0].len(), leaf.shape.curves[0].len());
        let size = |of: &[Vec<DVec3>]| of[0].iter().fold(0.0_f64, |m, it| m.max(it.length()));
        close("largest displacement", size(&shape.displacement), 1.0, 1e-9);
        assert_eq!(shape.displacement[0][0], DVec3::ZERO);
    }
    let later = shapes.iter().map(|shape| {
        let nodes = shape.later_displacement[0].iter();
        nodes.fold(0.0_f64, |m, it| m.max(it.length()))
    });
    let later: Vec<f64> = later.collect();
    assert!(later.iter().all(|it| *it > 1e-6), "{later:?}");
    assert!(later.iter().any(|it| *it > 1e-4), "{later:?}");
}

/// Where not as many motions are found as were asked for, that is said.
#[test]
fn fewer_motions_than_asked_for_are_told_as_such() {
    let column = column(5.0, ", external_damping = 0.5, internal_damping = 0.01");
    for (asked, enough) in [(3, true), (100, false)] {
        let leaf = relaxed(&column, &with_modes(asked, Options::default()));
        let found = motions_of(&leaf).growth_rates.len();
        assert_eq!(found == asked, enough, "{found}");
        let said = EquilibriumDoubt::FewerMotions { asked, found };
        assert_eq!(leaf.doubts.contains(&said), !enough);
    }
}
