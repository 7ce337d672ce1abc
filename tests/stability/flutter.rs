//! Flutter and divergence along traces: what is located, and the bounds that are told, beside solutions of the
//! beam's equation by power series, static closed forms and the elastica in wind.

use leafdyn::study::{BranchEnd, PointKind, Trace, TracePoint, TraceUntil, trace};
use leafdyn_testing::*;
use nalgebra::{Complex, Matrix2, Vector2};

/// An inextensible column of unit length, stiffness and density.
const COLUMN: &str = r#"
    name = "column"
    leaf = { rods = 1, length = 1.0, fan = [0.0] }
    stiffness = { torsion = 1.0, bending_2 = 1.3, bending_3 = 1.0, axial = inf, shear_2 = inf, shear_3 = inf }
"#;

fn request(more: &str, vary: &str, tolerance: f64) -> leafdyn::study::TraceRequest {
    let mut request = branch::request(base(&format!("{COLUMN}\n{more}"), ""), vary, tolerance, 200);
    request.keep_unstable = false;
    request
}

fn traced(more: &str, vary: &str, tolerance: f64) -> Trace {
    let trace = trace(&request(more, vary, tolerance), &mut |_, _, _| {});
    let trace = trace.unwrap_or_else(|error| panic!("{error}"));
    assert!(
        trace.complete,
        "{:?} {:?}",
        trace.remark,
        trace.branches[0].remark()
    );
    trace
}

fn events(trace: &Trace) -> Vec<&TracePoint> {
    let points = trace.branches[0].critical_points();
    points.map(|(_, point)| point).collect()
}

/// A force at the tip, with a mass there.
fn tip(load: f64, mass: f64, follows: bool) -> String {
    format!(
        "\n[[load.point]]\nvein = 1\nat = 1.0\nforce = [{load:?}, 0.0, 0.0]\nmass = {mass:?}\nfollows = {follows}\n"
    )
}

/// A clamped column of unit length and stiffness, w'''' + (p + q s) w'' + (z r^2) w'' = z w, with the distance s
/// from its tip, tangential forces p at the tip and q per length, the rotary inertia r^2 and the mass m at the
/// tip, where w'' = 0 and w''' = z (m w - r^2 w'); z = omega^2.
#[derive(Clone, Copy, Default)]
struct Beam {
    p: f64,
    q: f64,
    rotary: f64,
    mass: f64,
    external: f64,
    internal: f64,
}

impl Beam {
    /// Zero at a root of the frequency: the determinant of displacement and slope at the clamp, of the two
    /// solutions by power series.
    fn determinant(&self, square: Complex<f64>, omega: Complex<f64>) -> Complex<f64> {
        let i = Complex::<f64>::i();
        // M lambda^2 + c lambda with lambda = i omega, over the stiffness 1 + lambda tau.
        let stiffness = 1.0 + i * omega * self.internal;
        let inertia = square - i * omega * self.external;
        let ends = [(1.0, 0.0), (0.0, 1.0)].map(|(a0, a1)| {
            let mut a = vec![Complex::new(0.0, 0.0); 60];
            (a[0], a[1]) = (a0.into(), a1.into());
            a[3] = square * (self.mass * a0 - self.rotary * a1) / (6.0 * stiffness);
            for k in 0..56 {
                let n = k as f64;
                let before = match k {
                    0 => Complex::new(0.0, 0.0),
                    _ => a[k + 1] * (self.q * (n + 1.0) * n),
                };
                let axial = (self.p + square * self.rotary) * a[k + 2] * ((n + 2.0) * (n + 1.0));
                a[k + 4] = (inertia * a[k] - axial - before)
                    / (stiffness * ((n + 4.0) * (n + 3.0) * (n + 2.0) * (n + 1.0)));
            }
            let w: Complex<f64> = a.iter().sum();
            let slope: Complex<f64> = (a.iter().enumerate()).map(|(k, a)| *a * k as f64).sum();
            [w, slope]
        });
        ends[0][0] * ends[1][1] - ends[0][1] * ends[1][0]
    }

    /// What vanishes at the onset of flutter: without damping the determinant and its derivative by omega^2, as
    /// two frequencies meet; with damping both parts of the determinant at a real frequency.
    fn onset(&self, omega: f64) -> Vector2<f64> {
        let square = omega * omega;
        if self.external == 0.0 && self.internal == 0.0 {
            let h = 1e-20;
            let found = self.determinant(Complex::new(square, h), Complex::new(omega, 0.0));
            return Vector2::new(found.re, found.im / h);
        }
        let found = self.determinant(square.into(), omega.into());
        Vector2::new(found.re, found.im)
    }
}

/// The parameter and the frequency at the onset of flutter, by Newton's method from near them.
fn onset(at: impl Fn(f64) -> Beam, near: [f64; 2]) -> [f64; 2] {
    let mut x = Vector2::new(near[0], near[1]);
    let value = |x: Vector2<f64>| at(x[0]).onset(x[1]);
    for _ in 0..50 {
        let column = |k: usize| {
            let mut step = Vector2::zeros();
            step[k] = 1e-5 * x[k];
            (value(x + step) - value(x - step)) / (2.0 * step[k])
        };
        let slope = Matrix2::from_columns(&[column(0), column(1)]);
        let step = slope.lu().solve(&value(x)).unwrap();
        x -= step;
        if step.norm() < 1e-12 * x.norm() {
            break;
        }
    }
    [x[0], x[1]]
}

/// Asserts that a critical point is this one, within the bounds that are told, which are as small.
#[track_caller]
fn is_at(name: &str, point: &TracePoint, kind: PointKind, [value, frequency]: [f64; 2], most: f64) {
    let error = point.value_error.unwrap();
    let motion = point.motion.unwrap().dominant.unwrap();
    let frequency_error = motion.error.unwrap();
    println!(
        "{name}: {} off {value} by {:.1e} of {error:.1e}, frequency off by {:.1e} of {frequency_error:.1e}",
        point.value,
        (point.value - value).abs(),
        (motion.frequency - frequency).abs()
    );
    assert_eq!(point.kind, kind, "{name}");
    assert!((point.value - value).abs() <= error, "{name}");
    assert!(
        (motion.frequency - frequency).abs() <= frequency_error,
        "{name}"
    );
    assert!(error <= most * value.abs(), "{name}: {error:e}");
    assert_eq!(motion.growth_rate, 0.0);
}

/// Columns of Beck (1952), Leipholz (1962), with rotary inertia, with damping of both kinds (Bolotin 1963).
#[test]
fn columns_flutter_where_their_frequencies_meet() {
    let even = "dynamics = { density = 1.0 }";
    let beck = Beam::default;
    struct Case {
        name: &'static str,
        dynamics: &'static str,
        beam: Beam,
        near: [f64; 2],
        literature: f64,
    }
    let cases = [
        Case {
            name: "Beck",
            dynamics: even,
            beam: beck(),
            near: [20.05, 11.0],
            literature: 20.0509,
        },
        Case {
            name: "rotary",
            dynamics: "dynamics = { density = 1.0, rotary_inertia = 0.01 }",
            beam: Beam {
                rotary: 0.01,
                ..beck()
            },
            near: [18.17, 10.0],
            literature: 18.17,
        },
        Case {
            name: "external",
            dynamics: "dynamics = { density = 1.0, external_damping = 7.032 }",
            beam: Beam {
                external: 7.032,
                ..beck()
            },
            near: [22.38, 10.3],
            literature: 22.38,
        },
        Case {
            name: "internal",
            dynamics: "dynamics = { density = 1.0, internal_damping = 1e-4 }",
            beam: Beam {
                internal: 1e-4,
                ..beck()
            },
            near: [10.94, 5.4],
            literature: 10.94,
        },
    ];
    for Case {
        name,
        dynamics,
        beam,
        near,
        literature,
    } in cases
    {
        let found = traced(
            &format!("{dynamics}\n{}", tip(-1.0, 0.0, true)),
            "load.point[0].force[0]=-1..-24",
            1e-8,
        );
        let wanted = onset(|p| Beam { p, ..beam }, near);
        close(name, wanted[0], literature, 5e-3);
        let first = events(&found)[0];
        assert_eq!((first.index, found.branches[0].points[0].index), (2, 0));
        is_at(
            name,
            first,
            PointKind::Flutter,
            [-wanted[0], wanted[1]],
            2e-6,
        );
    }
    let leipholz = format!("{even}\nload = {{ follower = [-1.0, 0.0, 0.0] }}");
    let found = traced(&leipholz, "load.follower[0]=-1..-50", 1e-8);
    let wanted = onset(
        |q| Beam {
            q,
            ..Beam::default()
        },
        [40.05, 11.0],
    );
    close("Leipholz", wanted[0], 40.054, 5e-4);
    is_at(
        "Leipholz",
        events(&found)[0],
        PointKind::Flutter,
        [-wanted[0], wanted[1]],
        2e-6,
    );
    assert_eq!(
        found.assumed.unwrap().words().collect::<Vec<_>>(),
        ["no rotary inertia", "no damping"]
    );
}

/// A mass at the tip of Beck's column under a force of 16.5 makes it flutter, and a larger one no longer does
/// (Pflueger 1955).
#[test]
fn flutter_begins_and_ends_along_a_mass() {
    let more = format!("dynamics = {{ density = 1.0 }}\n{}", tip(-16.5, 0.01, true));
    let found = traced(&more, "load.point[0].mass=0.0..4.0", 1e-8);
    let events = events(&found);
    assert_eq!(events.iter().map(|it| it.index).collect::<Vec<_>>(), [2, 0]);
    let beam = |mass: f64| Beam {
        p: 16.5,
        mass,
        ..Beam::default()
    };
    for event in events {
        let frequency = event.motion.unwrap().dominant.unwrap().frequency;
        let wanted = onset(beam, [1.001 * event.value, 0.999 * frequency]);
        is_at("mass", event, PointKind::Flutter, wanted, 1e-4);
    }
}

/// Of a force at the tip the part eta follows: below one half a clamped column diverges where
/// (1 - eta) cos kL + eta = 0, P = EI k^2 (Dzhanelidze 1958; Bolotin 1963).
#[test]
fn a_column_diverges_under_a_force_that_follows_in_part() {
    for dead in [2, 3] {
        let eta = 1.0 / (dead as f64 + 1.0);
        let points: String = (0..dead).map(|_| tip(-0.1, 0.0, false)).collect();
        let keys: Vec<String> = (0..=dead)
            .map(|k| format!("load.point[{k}].force[0]"))
            .collect();
        let found = traced(
            &format!("{}{points}", tip(-0.1, 0.0, true)),
            &format!("{}=-0.1..-1.8", keys.join("+")),
            1e-8,
        );
        let wave = (-eta / (1.0 - eta)).acos();
        let wanted = -eta * wave * wave;
        let first = events(&found)[0];
        is_at(
            &format!("eta {eta}"),
            first,
            PointKind::Divergence,
            [wanted, 0.0],
            3e-6,
        );
        assert_eq!(first.index, 1);
    }
}

/// A round column has every root twice: both planes flutter at once.
#[test]
fn a_round_column_flutters_in_both_planes() {
    let mut request = request(
        &tip(-1.0, 0.0, true),
        "load.point[0].force[0]=-1..-24",
        1e-7,
    );
    request.base = base(
        &format!("{COLUMN}\n{}", tip(-1.0, 0.0, true)),
        "stiffness.bending_2=1.0",
    );
    request.until = Some(TraceUntil::Unstable);
    let found = trace(&request, &mut |_, _, _| {}).unwrap();
    let branch = &found.branches[0];
    assert_eq!(branch.end, BranchEnd::StabilityLost);
    let [event] = events(&found)[..] else {
        panic!("{:?}", events(&found).len());
    };
    assert_eq!((event.kind, event.index), (PointKind::Flutter, 4));
    let wanted = onset(
        |p| Beam {
            p,
            ..Beam::default()
        },
        [20.05, 11.0],
    );
    assert!((event.value + wanted[0]).abs() < 1e-5, "{}", event.value);
}

/// Planes of which one is a little stiffer flutter one after the other, within one step of the trace.
#[test]
fn planes_flutter_one_after_the_other() {
    let stiffer = 1.005;
    let load = tip(-1.0, 0.0, true);
    let mut request = request(&load, "load.point[0].force[0]=-1..-24", 1e-7);
    let set = format!("stiffness.bending_2={stiffer}; dynamics.density=1.0");
    request.base = base(&format!("{COLUMN}\n{load}"), &set);
    let found = trace(&request, &mut |_, _, _| {}).unwrap();
    assert!(found.complete && found.branches[0].remark().is_none());
    let wanted = onset(
        |p| Beam {
            p,
            ..Beam::default()
        },
        [20.05, 11.0],
    );
    let events = events(&found);
    assert_eq!(events.iter().map(|it| it.index).collect::<Vec<_>>(), [2, 4]);
    for (event, stiffness) in events.iter().zip([1.0_f64, stiffer]) {
        let wanted = [-stiffness * wanted[0], stiffness.sqrt() * wanted[1]];
        is_at("one plane", event, PointKind::Flutter, wanted, 1e-5);
    }
}

/// Drag over that of a rigid rod, and the place of the tip, of an inextensible cantilever across the wind:
/// theta''' = -C sin^2 theta - theta'^3/2, integrated from the tip, where theta' = theta'' = 0, to the angle
/// pi/2 at the base.
fn in_wind(cauchy: f64) -> [f64; 3] {
    let integrated = |tip: f64| {
        let steps = 4000;
        let h = 1.0 / f64::from(steps);
        // theta, theta', theta'', and the integrals of sin^3, cos and sin, from the tip.
        let slope = |y: [f64; 6]| {
            let (sin, cos) = y[0].sin_cos();
            let third = -cauchy * sin * sin - 0.5 * y[1].powi(3);
            [-y[1], -y[2], -third, sin.powi(3), cos, sin]
        };
        let mut y = [tip, 0.0, 0.0, 0.0, 0.0, 0.0];
        for _ in 0..steps {
            let plus = |k: [f64; 6], h: f64| std::array::from_fn(|i| y[i] + h * k[i]);
            let k1 = slope(y);
            let k2 = slope(plus(k1, 0.5 * h));
            let k3 = slope(plus(k2, 0.5 * h));
            let k4 = slope(plus(k3, h));
            y = std::array::from_fn(|i| y[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]));
        }
        y
    };
    let (mut low, mut high) = (1e-6, std::f64::consts::FRAC_PI_2);
    while high - low > 1e-15 {
        let middle = 0.5 * (low + high);
        match integrated(middle)[0] < std::f64::consts::FRAC_PI_2 {
            true => low = middle,
            false => high = middle,
        }
        if middle == low && middle == high {
            break;
        }
    }
    let found = integrated(0.5 * (low + high));
    [found[3], found[4], found[5]]
}

/// Along the speed of the wind a cantilever across it bends back as its equation says, and stays stable.
#[test]
fn a_cantilever_gives_way_to_the_wind() {
    let wind = "wind = { velocity = [0.0, 0.0, 1.0], density = 2.0, drag = 1.0, width = 1.0 }";
    let to = 1000_f64.sqrt();
    let found = traced(wind, &format!("wind.velocity[2]=1..{to:?}:31log"), 1e-8);
    assert!(events(&found).is_empty());
    let points = &found.branches[0].points;
    // Half of the density times the square of the speed, with the stiffness 1.3 about d2.
    for (speed, drag) in [
        (1.0, 0.9748331360),
        (10.0, 0.5236122824),
        (100.0, 0.1917895283),
        (1000.0, 0.0890046689),
    ]
    .map(|(cauchy, drag): (f64, f64)| ((1.3 * cauchy).sqrt(), drag))
    {
        close("drag", in_wind(speed * speed / 1.3)[0], drag, 1e-9);
    }
    for point in points.iter().step_by(10) {
        let [_, along, across] = in_wind(point.value * point.value / 1.3);
        let tip = point.tips[0];
        let off = (tip.z - along).hypot(tip.x - across);
        println!(
            "speed {:.4}: off by {off:.1e} of {:?}",
            point.value, point.error
        );
        assert!(off <= point.error.unwrap() && point.error.unwrap() <= 1e-8);
        let growth = point.motion.unwrap().dominant.unwrap().growth_rate;
        assert!(point.stable() == Some(true) && growth < 0.0 && point.energy.is_nan());
    }
}

/// Where a buckled column folds back it ends, and says so: beside the fold of the same column without the
/// load that follows, which is too small to matter.
#[test]
fn a_branch_that_folds_back_ends_there() {
    let column = "stiffness.bending_3=10.0; load.tip_force=[-2.8, 0.0, 0.5]";
    let vary = "load.tip_force[2]=0.5..-0.5";
    let mut request = branch::request(base(ROD, column), vary, 1e-6, 2000);
    let with_potential = trace(&request, &mut |_, _, _| {}).unwrap();
    let fold = events(&with_potential)[0].value;
    request.base = base(ROD, &format!("{column}; load.follower=[0.0, 1e-9, 0.0]"));
    request.keep_unstable = false;
    let found = trace(&request, &mut |_, _, _| {}).unwrap();
    let branch = &found.branches[0];
    assert_eq!(branch.end.word(), "turns-back");
    assert!(!found.complete && branch.remark().is_some());
    let last = branch.points.last().unwrap();
    println!("ends at {}, fold at {fold}", last.value);
    assert!(last.value > fold && last.value - fold < 1e-3);
    assert!(
        branch
            .points
            .iter()
            .all(|point| point.stable() != Some(false))
    );
}

/// Branches that cross, starts of any index and boundaries are those of a potential.
#[test]
fn what_needs_a_potential_is_refused() {
    let refused = |change: fn(&mut leafdyn::study::TraceRequest)| {
        let mut request = request(
            &tip(-1.0, 0.0, true),
            "load.point[0].force[0]=-1..-24",
            1e-6,
        );
        change(&mut request);
        trace(&request, &mut |_, _, _| {}).unwrap_err().to_string()
    };
    assert!(refused(|it| it.switch = true).contains("branches that cross"));
    assert!(refused(|it| it.keep_unstable = true).contains("of any index"));
    let mut dead = request("", "dynamics.density=1..2", 1e-6);
    dead.keep_unstable = true;
    let told = trace(&dead, &mut |_, _, _| {}).unwrap_err().to_string();
    assert!(told.contains("changes a motion"), "{told}");
}
