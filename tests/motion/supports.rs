//! Leaves whose supports move: bases that are shaken and turned, grips and tips that are moved, by both methods, against
//! closed forms and the same motions seen from elsewhere.

use crate::driven::Complex;
use leafdyn::scenario::{BaseMotion, Sine, SupportMotion};
use leafdyn::simulate;
use leafdyn_testing::motion::*;
use leafdyn_testing::{DVec3, Leaf, Method, PI, Scenario, Schedule, by, settled, to};

/// The displacement of the tip of a cantilever of unit length, stiffness and mass, per displacement of its base that
/// oscillates with the angular frequency omega, damped in space: w'''' = (omega^2 - i omega c) w with w(0) = 1,
/// w'(0) = 0, and w''(1) = w'''(1) = 0.
fn tip_response(omega: f64, damping: f64) -> Complex {
    let k = Complex(omega * omega, -omega * damping).sqrt().sqrt();
    let half = Complex(0.5, 0.0);
    let [up, down] = [k.exp(), (-k).exp()];
    let (cosh, sinh) = (half * (up + down), half * (up - down));
    let turned = Complex(-k.1, k.0);
    let [one, other] = [turned.exp(), (-turned).exp()];
    let (cos, sin) = (half * (one + other), Complex(0.0, -0.5) * (one - other));
    // w = cos kx + a (cosh kx - cos kx) + b (sinh kx - sin kx)
    let [[p, q], [r, s]] = [[cosh + cos, sinh + sin], [sinh - sin, cosh + cos]];
    let determinant = p * s - q * r;
    let a = (cos * s + sin * q) / determinant;
    let b = (-(sin * p) - cos * r) / determinant;
    cos + a * (cosh - cos) + b * (sinh - sin)
}

/// Slowly the tip goes along, and at resonance it lags by a quarter of a period.
#[test]
fn the_transfer_function_of_a_base_has_its_limits() {
    let still = tip_response(1e-3, 1e-3);
    assert!((still.0 - 1.0).abs() < 1e-6 && still.1.abs() < 1e-6);
    let resonant = tip_response(SLENDER[0] * SLENDER[0], 0.01);
    assert!(resonant.1 < -100.0 && resonant.0.abs() < 0.1 * resonant.1.abs());
}

fn sine(amplitude: [f64; 3], frequency: f64) -> Schedule<[f64; 3]> {
    Schedule::Sine(Sine {
        mean: [0.0; 3],
        amplitude,
        frequency,
        phase: 0.0,
    })
}

/// Moves the bases of a leaf.
fn move_base(scenario: &mut Scenario, displacement: Schedule<[f64; 3]>, turn: Schedule<[f64; 3]>) {
    scenario.support_motion = Some(Box::new(SupportMotion {
        base: Some(BaseMotion {
            displacement,
            turn: turn.of_rotations(),
        }),
        ..SupportMotion::default()
    }));
}

fn still() -> Schedule<[f64; 3]> {
    Schedule::constant([0.0; 3])
}

/// Amplitude and phase below, at and above the lowest frequency, of second order in step and segments, and extrapolated
/// exact.
#[test]
fn a_shaken_base_moves_the_tip_as_its_transfer_function_says() {
    let lowest = SLENDER[0] * SLENDER[0] / (2.0 * PI);
    for frequency in [0.5 * lowest, lowest, 1.7 * lowest] {
        let mut rod = beam(1e-7, [1e6; 2]);
        rod.dynamics.external_damping = 2.0;
        rod.dynamics.duration = 40.0;
        move_base(&mut rod, sine([0.0, 0.0, 1e-3], frequency), still());
        let leaf = Leaf::new(&rod);
        let omega = 2.0 * PI * frequency;
        let Complex(real, imaginary) = tip_response(omega, 2.0);
        let amplitude = 1e-3 * real.hypot(imaginary);
        for time in [18.0, 18.37] {
            let angle = omega * time;
            let exact = 1e-3 * (real * angle.sin() + imaginary * angle.cos());
            let on = |segments: usize, h: f64| {
                at(
                    Scheme::SemiImplicit,
                    &leaf,
                    &released(&leaf, segments),
                    h,
                    time,
                )
                .state
                .tip(0)
                .z
            };
            let off = |found: f64| (found - exact).abs() / amplitude;
            let (long, short, coarse) = (on(16, 0.02), on(16, 0.01), on(8, 0.01));
            let found = short + (short - long) / 3.0 + (short - coarse) / 3.0;
            assert!(off(short) < 0.02, "{frequency}: {:e}", off(short));
            assert!(off(found) < 5e-4, "{frequency}: {:e}", off(found));
        }
    }
}

/// A smooth course that begins and ends level.
fn course(times: f64) -> Schedule<[f64; 3]> {
    let values = [
        [0.0; 3],
        [0.1, -0.2, 0.3],
        [0.3, 0.1, -0.1],
        [0.0, 0.2, 0.1],
    ];
    let values = values
        .map(|value: [f64; 3]| value.map(|it| times * it))
        .to_vec();
    Schedule::smooth(vec![0.0, 0.3, 0.5, 0.8], values)
}

/// Seen from a base that moves without turning, a leaf feels the inertia of its mass as a gravity that changes:
/// piecewise linear for a cubic spline. Both methods have this limit.
#[test]
fn an_accelerated_base_is_gravity_in_time() {
    let mut moved = twisted_rod();
    move_base(&mut moved, course(1.0), still());
    let mut pulled = twisted_rod();
    let density = pulled.dynamics.density[0].at(0.5);
    let acceleration = |time: f64| {
        let h = 1e-4;
        let [a, b] = [course(1.0).rate(time - h), course(1.0).rate(time + h)];
        [0, 1, 2].map(|c| -density * (b[c] - a[c]) / (2.0 * h))
    };
    // The second derivative is linear between knots and continuous, but for both ends.
    let near = |knot: f64, to: f64| acceleration(knot + to * 2e-4);
    let at_knot = |knot: f64, side: f64| {
        let [one, two] = [near(knot, side), near(knot, 2.0 * side)];
        [0, 1, 2].map(|c| 2.0 * one[c] - two[c])
    };
    pulled.dynamics.gravity = Schedule::linear(
        vec![0.0, 0.3, 0.5, 0.8, 0.8 + 1e-9],
        vec![
            at_knot(0.0, 1.0),
            at_knot(0.3, 1.0),
            at_knot(0.5, 1.0),
            at_knot(0.8, -1.0),
            [0.0; 3],
        ],
    );
    for scheme in BOTH {
        let tips = |scenario: &Scenario, shift: DVec3| {
            let leaf = Leaf::new(scenario);
            let start = released(&leaf, 8);
            let [a, b] = [1e-3, 5e-4].map(|h| at(scheme, &leaf, &start, h, 0.7).state.tip(0));
            b + (b - a) / 3.0 - shift
        };
        let start = tips(&twisted_rod(), DVec3::ZERO);
        let one = tips(&moved, DVec3::from_array(course(1.0).at(0.7)));
        let other = tips(&pulled, DVec3::ZERO);
        let off = one.distance(other) / other.distance(start);
        assert!(off < 1e-4, "{scheme:?}: {off:e}");
    }
}

/// A rod whose base moves and turns, damped as given; and one on an elastic base.
fn turned((external, internal): (f64, f64), elastic: bool) -> Scenario {
    let mut rod = twisted_rod();
    rod.dynamics.external_damping = external;
    rod.dynamics.internal_damping = internal;
    rod.gravity = [0.0, 0.2, -0.5];
    rod.dynamics.gravity = Schedule::constant(rod.gravity);
    if elastic {
        rod.base_held = vec![leafdyn::scenario::BaseSupport::Elastic];
        rod.base_turn_stiffness = vec![3.0];
    }
    move_base(&mut rod, course(0.5), course(2.0));
    rod
}

/// Both methods are of second order in the step, with all dampings and kinds of bases, and have the same limit.
#[test]
fn both_methods_follow_a_base_that_turns() {
    for (damping, elastic) in DAMPINGS
        .map(|it| (it, false))
        .into_iter()
        .chain([((0.3, 0.01), true)])
    {
        let scenario = turned(damping, elastic);
        let leaf = Leaf::new(&scenario);
        let start = released(&leaf, 4);
        let limits = BOTH.map(|scheme| {
            let [a, b, c] = [4e-3, 2e-3, 1e-3].map(|h| numbers(&at(scheme, &leaf, &start, h, 0.6)));
            let ratio = distance(&a, &b) / distance(&b, &c);
            assert!(
                (3.4..4.6).contains(&ratio),
                "{damping:?} {scheme:?}: {ratio}"
            );
            limit(&b, &c)
        });
        let off = apart(&limits[0], &limits[1]);
        assert!(off < 1e-3, "{damping:?}: {off:e}");
    }
}

/// The balance of energy is kept, of second order in the step, whatever moves: clamped and elastic bases, grips, and
/// tips, with dampings and several veins.
#[test]
fn the_work_of_holders_is_accounted_for() {
    let mut gripped = gripped_veins();
    let moves = |index: usize| {
        let start = gripped.grips[index].displacement;
        let values = [[0.0; 3], [0.1, 0.05, -0.1], [0.0, 0.05, 0.1]];
        let values = values
            .map(|it: [f64; 3]| [0, 1, 2].map(|c| start[c] + it[c]))
            .to_vec();
        Schedule::smooth(vec![0.0, 0.2, 0.5], values)
    };
    gripped.support_motion = Some(Box::new(SupportMotion {
        grips: vec![moves(0), moves(1)],
        ..SupportMotion::default()
    }));
    let mut fan = three_veins();
    move_base(&mut fan, course(0.3), course(1.0));
    let mut blown = three_veins();
    move_base(&mut blown, course(0.3), course(1.0));
    blown.wind = Some(leafdyn::scenario::Wind {
        velocity: Schedule::constant([0.5, 1.0, -1.0]),
        density: 1.0,
        drag: 1.0,
        width: vec![leafdyn::scenario::Profile::Constant(0.3); 3],
    });
    let cases = [
        ("clamped", turned((0.0, 0.0), false)),
        ("damped", turned((0.5, 0.01), false)),
        ("elastic", turned((0.3, 0.0), true)),
        ("gripped", gripped),
        ("fan", fan),
        ("blown", blown),
    ];
    for (name, scenario) in cases {
        let leaf = Leaf::new(&scenario);
        let start = match name {
            "gripped" => rest(&scenario, 8),
            _ => released(&leaf, 8),
        };
        for scheme in BOTH {
            let imbalance = |h: f64| energy_imbalance(scheme, &leaf, &start, h, (20, 0.04));
            let [long, short] = [2e-3, 1e-3].map(imbalance);
            assert!(
                short < 0.35 * long && short < 2e-3,
                "{name} {scheme:?}: {long:e} {short:e}"
            );
        }
    }
}

const ROD: &str = r#"
    name = "rod"
    leaf = { rods = 1, length = 1.0, fan = [0.0] }
    stiffness = { torsion = 0.8, bending_2 = 1.0, bending_3 = 1.2, axial = 90.0, shear_2 = 60.0, shear_3 = 40.0 }
    load = { gravity = [0.0, 0.2, -0.5] }
    [dynamics]
    density = 1.0
    duration = 0.8
    external_damping = 0.2
    start = "at-rest"
"#;

const MOVES: &str = "{ at = [0.0, 0.3, 0.5], value = [[0.0, 0.0, 0.0], [0.0, 0.1, -0.2], [0.05, 0.1, 0.1]], smooth = true }";

/// The last shape of the rod with these entries.
fn moved(scheme: Scheme, length: f64, segments: usize, extra: &str, sets: &[&str]) -> Vec<DVec3> {
    let mut all = vec![format!("leaf.length={length:?}")];
    all.extend(sets.iter().map(|it| it.to_string()));
    let scenario = Scenario::from_toml_with(&format!("{extra}\n{ROD}"), "rod", &all).unwrap();
    let options = simulate::Options {
        step: Some(1e-3),
        ..moving(scheme, Some(segments))
    };
    run(&scenario, &options).positions
}

/// What is beyond a clamp in the middle that moves is a cantilever on a base that moves likewise, and what is before it a
/// rod whose clamped tip does.
#[test]
fn bases_grips_and_tips_move_alike() {
    let inertia = "dynamics.rotary_inertia=0.01";
    for scheme in BOTH {
        let grip = format!("grip = [{{ vein = 1, at = 0.5, held = \"clamped\", move = {MOVES} }}]");
        let whole = moved(scheme, 2.0, 16, &grip, &[inertia]);
        let base = format!("dynamics.base={{ move = {MOVES} }}");
        let beyond = moved(scheme, 1.0, 8, "", &[&base, inertia]);
        let position = "{ at = [0.0, 0.3, 0.5], value = [[1.0, 0.0, 0.0], [1.0, 0.1, -0.2], [1.05, 0.1, 0.1]], smooth = true }";
        let tip = format!("tip = {{ held = \"clamped\", position = {position} }}");
        let before = moved(scheme, 1.0, 8, &tip, &[inertia]);
        for i in 0..=8 {
            let off = (whole[8 + i] - DVec3::X).distance(beyond[i]);
            assert!(off < 1e-9, "{scheme:?}, beyond, {i}: {off:e}");
            let off = whole[i].distance(before[i]);
            assert!(off < 1e-9, "{scheme:?}, before, {i}: {off:e}");
        }
        assert!(beyond[0].distance(DVec3::new(0.05, 0.1, 0.1)) < 1e-12);
    }
}

/// A base that turns slowly by a quarter turn brings the leaf where it rests on a base of that direction.
#[test]
fn a_slow_quarter_turn_ends_in_statics() {
    let sets = [
        "dynamics.base={ at = [0.0, 20.0], turn = [[0.0, 0.0, 0.0], [0.0, -1.5707963267948966, 0.0]], smooth = true }",
        "dynamics.duration=60",
        "dynamics.external_damping=3",
    ];
    for scheme in BOTH {
        let scenario = Scenario::from_toml_with(ROD, "rod", &sets.map(String::from)).unwrap();
        let found = run(&scenario, &moving(scheme, Some(16))).positions[16];
        let upright = ["leaf.elevation=1.5707963267948966".to_string()];
        let upright = Scenario::from_toml_with(ROD, "rod", &upright).unwrap();
        let options = leafdyn_testing::iterated(1e-10, 16);
        let exact = leafdyn_testing::tip(&settled(&upright, &options));
        let off = found.distance(exact);
        assert!(off < 1e-6, "{scheme:?}: {off:e}");
    }
}

/// An elastic base that hardly gives turns its rod as a clamp does.
#[test]
fn stiff_elastic_bases_turn_as_clamps() {
    let turn = "dynamics.base={ at = [0.0, 0.4], turn = [[0.0, 0.0, 0.0], [0.3, -0.5, 0.4]], smooth = true }";
    let clamped = moved(Scheme::SemiImplicit, 1.0, 8, "", &[turn]);
    let off = [1e3, 1e4].map(|stiffness: f64| {
        let elastic = [
            "leaf.base_held=elastic".to_string(),
            format!("leaf.base_turn_stiffness={stiffness}"),
        ];
        let sets = [turn, &elastic[0], &elastic[1]];
        moved(Scheme::SemiImplicit, 1.0, 8, "", &sets)[8].distance(clamped[8])
    });
    assert!(
        off[0] < 1e-2 && (5.0..20.0).contains(&(off[0] / off[1])),
        "{off:?}"
    );
}

/// A rigid rod whose base begins to move all at once is pulled along, as one that hardly yields.
#[test]
fn rigid_rods_jump_with_their_base() {
    let made = |axial: f64| {
        let mut rod = beam(1e-3, [axial; 2]);
        let way = vec![[0.0; 3], [0.1, 0.0, 0.05], [0.05, 0.0, 0.0]];
        move_base(
            &mut rod,
            Schedule::linear(vec![0.1, 0.3, 0.4], way),
            still(),
        );
        rod
    };
    let now = |axial: f64, time: f64| {
        let scenario = made(axial);
        let leaf = Leaf::new(&scenario);
        let mut method = method(Scheme::SemiImplicit, &leaf, &released(&leaf, 8), 1e-3);
        let start = method.snapshot().energy.balance();
        method.advance(time).unwrap();
        let found = method.snapshot();
        (found.clone(), (found.energy.balance() - start).abs())
    };
    let (rigid, off) = now(f64::INFINITY, 0.102);
    for v in &rigid.velocity {
        assert!((v.linear.x - 0.5).abs() < 2e-3, "{v:?}");
    }
    assert!(off < 1e-3 * rigid.energy.work, "{off:e} {:?}", rigid.energy);
    let [rigid, stiff] = [f64::INFINITY, 1e6].map(|axial| now(axial, 0.6).0.state.tip(0));
    assert!(rigid.distance(stiff) < 2e-3, "{rigid} {stiff}");
}

/// At rest supports are where they are at time 0, and a scenario keeps them as it is written.
#[test]
fn at_rest_supports_are_where_they_are_at_time_zero() {
    let grip = "grip = [{ vein = 1, at = 0.5, move = { at = [-1.0, 1.0], value = [[0, 0, 0], [0, 0, 0.2]] } }]";
    let made = |extra: &str, sets: &[&str]| {
        let sets: Vec<String> = sets.iter().map(|it| it.to_string()).collect();
        Scenario::from_toml_with(&format!("{extra}\n{ROD}"), "rod", &sets).unwrap()
    };
    let base = "dynamics.base={ at = [0.0, 1.0], move = [[0, 0, 0], [0, 0, 1]], turn = [[0, 0, 0], [0, 0, 2]] }";
    let moving = made(grip, &[base]);
    let still = made("grip = [{ vein = 1, at = 0.5, move = [0, 0, 0.1] }]", &[]);
    let rest = |it: &Scenario| leafdyn_testing::tip(&settled(it, &to(1e-9)));
    assert_eq!(rest(&moving), rest(&still));
    // Also by the motion of an explicit relaxation.
    let explicit = by(Method::Explicit { segments: Some(8) }, to(1e-6));
    let explicit = |it: &Scenario| leafdyn_testing::tip(&settled(it, &explicit));
    assert_eq!(explicit(&moving), explicit(&still));
    let tip = "tip = { held = \"pinned\", position = { mean = [0.9, 0, 0], amplitude = [0, 0, 0.1], frequency = 1.0, phase = 1.5707963267948966 } }";
    let moving_tip = made(
        tip,
        &["dynamics.base={ move = { amplitude = [0, 0, 1], frequency = 2.0 } }"],
    );
    let still = made("tip = { held = \"pinned\", position = [0.9, 0, 0.1] }", &[]);
    assert!(rest(&moving_tip).distance(rest(&still)) < 1e-9);
    for scenario in [moving, moving_tip] {
        let again = Scenario::from_toml(&serde_json::to_string(&scenario).unwrap()).unwrap();
        assert_eq!(again, scenario);
    }
}

/// What makes no sense is refused, with what would.
#[test]
fn motions_that_make_no_sense_are_refused() {
    for (set, why) in [
        ("dynamics.base=1", "must be a table: the motion of bases is"),
        ("dynamics.base={ at = [0, 1] }", "move or turn is missing"),
        (
            "dynamics.base={ at = [0, 1], mov = [[0,0,0],[0,0,1]] }",
            "unknown key mov",
        ),
        (
            "dynamics.base={ at = [0, 1], move = [[0,0,0]] }",
            "must have 2, one per entry of at",
        ),
        (
            "dynamics.base={ at = [0, 1], move = [[0,0,1],[0,0,0]] }",
            "must begin with no move",
        ),
        (
            "dynamics.base={ move = { amplitude = [0,0,1], frequency = 1, phase = 1 } }",
            "must begin with no move",
        ),
        (
            "dynamics.base={ at = [0, 1], move = [[0,0,0],[0,0,1e9]] }",
            "gives |base|/L",
        ),
        (
            "dynamics.base={ at = [0, 1], turn = [[0,0,0],[0,0,1e9]] }",
            "gives |turn|",
        ),
        (
            "dynamics.base={ move = { amplitude = [0,0,1], frequency = 1e9 } }",
            "a lower frequency",
        ),
        (
            "grip[0].move={ at = [0, 1], value = [[0,0,0],[0,0,99]] }",
            "at most 10 times",
        ),
        ("grip[0].move=3", "must be a list of three numbers"),
        (
            "grip[0].move={ at = [0, 1] }",
            "value is missing: a motion is",
        ),
    ] {
        let text = format!("grip = [{{ vein = 1, at = 0.5 }}]\n{ROD}");
        let refused = Scenario::from_toml_with(&text, "rod", &[set.into()])
            .unwrap_err()
            .to_string();
        assert!(refused.contains(why), "{set}: {refused}");
    }
}
