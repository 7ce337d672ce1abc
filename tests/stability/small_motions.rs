//! Stability without a potential: columns under loads that follow them flutter at the loads of the
//! literature, and of beam finite elements of our own.

use leafdyn::relax::{EquilibriumRemark, MotionInstability, SmallMotions};
use leafdyn_testing::*;
use nalgebra::{Complex, DMatrix};

/// An inextensible column of unit length, stiffness and density.
const COLUMN: &str = r#"
    name = "column"
    leaf = { rods = 1, length = 1.0, fan = [0.0] }
    stiffness = { torsion = 1.0, bending_2 = 1.3, bending_3 = 1.0, axial = inf, shear_2 = inf, shear_3 = inf }
"#;

/// A force along the tangent at its tip, against it.
fn tip(load: f64, mass: f64) -> String {
    format!(
        "[[load.point]]\nvein = 1\nat = 1.0\nforce = [{:?}, 0.0, 0.0]\nmass = {mass:?}\nfollows = true",
        -load
    )
}

fn column(more: &str) -> Scenario {
    parse(&format!("{COLUMN}\n{more}"))
}

fn motions(leaf: &Equilibrium) -> &SmallMotions {
    leaf.stability.small_motions.as_ref().unwrap()
}

/// The load beyond which a column is unstable on so many segments, and its frequency there.
fn critical(at: impl Fn(f64) -> Scenario, [from, to]: [f64; 2], segments: usize) -> [f64; 2] {
    let (mut stable, mut unstable) = (from, to);
    let mut frequency = f64::NAN;
    while unstable - stable > 1e-9 * to {
        let middle = 0.5 * (stable + unstable);
        let leaf = settle_on(&at(middle), segments, false);
        let motions = motions(&leaf);
        match motions.stable.unwrap() {
            true => stable = middle,
            false => {
                assert_eq!(motions.instability, Some(MotionInstability::Flutter));
                let roots = motions.growth_rates.iter().zip(&motions.frequencies);
                let fastest = roots.max_by(|(a, _), (b, _)| a.total_cmp(b)).unwrap();
                (unstable, frequency) = (middle, *fastest.1);
            }
        }
    }
    [stable, frequency]
}

/// That load, and the frequency, extrapolated over grids.
fn extrapolated(at: impl Fn(f64) -> Scenario, range: [f64; 2]) -> [f64; 2] {
    let found = [8, 16, 32].map(|segments| critical(&at, range, segments));
    [0, 1].map(|k| extrapolate(&found.map(|it| it[k]), 0.25))
}

/// Loads of Beck (1952), Leipholz (1962), and of our own elements.
#[test]
fn columns_flutter_at_their_loads() {
    let even = "dynamics = { density = 1.0 }";
    let beck = |more: &'static str| move |p: f64| column(&format!("{more}\n{}", tip(p, 0.0)));
    let leipholz = |q: f64| column(&format!("load.follower = [{:?}, 0.0, 0.0]", -q));
    let [load, frequency] = extrapolated(beck(even), [15.0, 25.0]);
    close("Beck", load, 20.0509, 2e-4);
    close("Beck's frequency", frequency, 11.016, 2e-3);
    let [load, _] = extrapolated(leipholz, [30.0, 50.0]);
    close("Leipholz", load, 40.054, 1e-3);
    let rotary = "dynamics = { density = 1.0, rotary_inertia = 0.01 }";
    let [load, _] = extrapolated(beck(rotary), [10.0, 25.0]);
    close("with rotary inertia", load, 18.17, 5e-3);
    let external = "dynamics = { density = 1.0, external_damping = 7.032 }";
    let [load, _] = extrapolated(beck(external), [15.0, 30.0]);
    close("with external damping", load, 22.38, 5e-3);
    let internal = "dynamics = { density = 1.0, internal_damping = 1e-4 }";
    let [load, _] = extrapolated(beck(internal), [5.0, 25.0]);
    close("with internal damping", load, 10.94, 5e-3);
}

/// Beam elements of Hermite's cubics for a clamped column of unit stiffness and density under a force along
/// the tangent of its tip, which bears a mass: the largest growth rate.
fn growth_of_beam(load: f64, mass: f64) -> f64 {
    let elements = 24;
    let h = 1.0 / elements as f64;
    let size = 2 * (elements + 1);
    let (mut stiffness, mut masses) = (DMatrix::zeros(size, size), DMatrix::zeros(size, size));
    let bending = [
        [12.0, 6.0 * h, -12.0, 6.0 * h],
        [6.0 * h, 4.0 * h * h, -6.0 * h, 2.0 * h * h],
        [-12.0, -6.0 * h, 12.0, -6.0 * h],
        [6.0 * h, 2.0 * h * h, -6.0 * h, 4.0 * h * h],
    ];
    let geometric = [
        [36.0, 3.0 * h, -36.0, 3.0 * h],
        [3.0 * h, 4.0 * h * h, -3.0 * h, -h * h],
        [-36.0, -3.0 * h, 36.0, -3.0 * h],
        [3.0 * h, -h * h, -3.0 * h, 4.0 * h * h],
    ];
    let inertia = [
        [156.0, 22.0 * h, 54.0, -13.0 * h],
        [22.0 * h, 4.0 * h * h, 13.0 * h, -3.0 * h * h],
        [54.0, 13.0 * h, 156.0, -22.0 * h],
        [-13.0 * h, -3.0 * h * h, -22.0 * h, 4.0 * h * h],
    ];
    for element in 0..elements {
        for r in 0..4 {
            for c in 0..4 {
                let at = (2 * element + r, 2 * element + c);
                stiffness[at] += bending[r][c] / h.powi(3) - load * geometric[r][c] / (30.0 * h);
                masses[at] += inertia[r][c] * h / 420.0;
            }
        }
    }
    // The force across the column at its tip, by its slope there.
    stiffness[(size - 2, size - 1)] += load;
    masses[(size - 2, size - 2)] += mass;
    let [stiffness, masses] =
        [stiffness, masses].map(|it| it.view((2, 2), (size - 2, size - 2)).into_owned());
    let squares = masses.lu().solve(&stiffness).unwrap().complex_eigenvalues();
    let growth = squares.iter().map(|square: &Complex<f64>| {
        let rounding = square.im.abs() < 1e-7 * square.norm();
        match rounding && square.re > 0.0 {
            true => 0.0,
            false => (-square).sqrt().re.abs(),
        }
    });
    growth.fold(0.0, f64::max)
}

/// A mass at the tip of Beck's column lowers the load, and raises it again (Pflueger 1955).
#[test]
fn a_mass_at_the_tip_lowers_and_raises_the_load() {
    let mut loads = Vec::new();
    for mass in [0.0, 0.1, 0.5, 2.0] {
        let gravity = "dynamics = { density = 1.0 }";
        let at = |p: f64| column(&format!("{gravity}\n{}", tip(p, mass)));
        let [load, _] = extrapolated(at, [10.0, 25.0]);
        let (mut stable, mut unstable) = (10.0, 25.0);
        while unstable - stable > 1e-7 {
            let middle = 0.5 * (stable + unstable);
            match growth_of_beam(middle, mass) > 0.0 {
                true => unstable = middle,
                false => stable = middle,
            }
        }
        close(&format!("mass {mass}"), load, stable, 5e-4);
        loads.push(load);
    }
    let least = loads.iter().copied().fold(f64::INFINITY, f64::min);
    assert!(
        least < loads[0] - 2.0 && least < loads[3] - 0.1,
        "{loads:?}"
    );
}

/// What the scenario leaves out is named, and the verdict is that of extrapolated roots: between 20.0509
/// and the load on a grid of 32 segments, 20.108, a column that flutters is not called stable.
#[test]
fn verdicts_are_told_with_what_is_assumed() {
    let leaf = settle(&column(&tip(10.0, 0.0)), 1e-6);
    assert_eq!(leaf.stable(), Some(true));
    let Some(EquilibriumRemark::FollowersWithoutPotential {
        verdict: Some(told),
    }) = leaf.remark
    else {
        panic!("{:?}", leaf.remark);
    };
    assert_eq!(
        told.assumed.words().collect::<Vec<_>>(),
        ["uniform density", "no rotary inertia", "no damping"]
    );
    for load in [20.04, 20.06, 25.0] {
        let leaf = settle(&column(&tip(load, 0.0)), 1e-6);
        let flutters = load > 20.0509;
        assert_eq!(leaf.stable(), Some(!flutters), "{load}");
        assert_eq!(
            leaf.remark.unwrap().to_string().contains("flutter"),
            flutters
        );
    }
}

/// A moment on a tip that turns with it, about the axis of a rod bent by its weight, and a rod in wind:
/// frequencies and decay with the drag's derivative by the velocity, beside those of the motion itself.
#[test]
fn a_leaf_in_wind_decays_by_the_drag() {
    let text = format!(
        "{COLUMN}\nwind = {{ velocity = [0.0, 0.0, 3.0], density = 1.0, drag = 1.0, width = 0.5 }}\n\
         dynamics = {{ density = 1.0, external_damping = 0.0 }}"
    );
    let scenario = parse(&text);
    let released = Options {
        route: leafdyn::relax::Route::Release,
        ..with_modes(2, to(1e-8))
    };
    let leaf = relaxed(&scenario, &released);
    assert_eq!(leaf.stable(), Some(true));
    let motions = motions(&leaf);
    // Drag per length c |u| u, c = 1/2 w/2: beside the wind of speed u it damps by c |u| to 2 c |u|.
    let rate = 0.25 * 3.0;
    for growth in &motions.growth_rates {
        assert!(
            *growth < -0.2 * rate && *growth > -rate,
            "{:?}",
            motions.growth_rates
        );
    }
}
