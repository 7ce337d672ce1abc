//! `simulate` takes the method that costs less, whose steps it knows or estimates beforehand, unless
//! one is requested or only one can move the leaf; and it says which and why.

use leafdyn::simulate::{
    CheaperChange, Options, Refinement, SchemeChoice, SchemeReason, Simulation,
};
use leafdyn_testing::motion::{SLENDER_VEINS, Scheme, moving, run};
use leafdyn_testing::workplace::{Json, Workplace, contains};
use leafdyn_testing::*;
use serde_json::Value;

fn chosen(scenario: &Scenario, options: &Options) -> SchemeChoice {
    Simulation::new(scenario, options).unwrap().choice()
}

fn by_default(scenario: &Scenario) -> SchemeChoice {
    chosen(scenario, &Options::default())
}

fn steps(scenario: &Scenario, scheme: Scheme) -> f64 {
    run(scenario, &moving(scheme, None)).steps as f64
}

/// The number of explicit steps is known, but for the last one's part.
#[test]
fn explicit_steps_are_known_beforehand() {
    for scenario in [scenario("motion/swing", ""), parse(&real::leaf(14))] {
        let [explicit, _] = by_default(&scenario).costs.unwrap();
        let made = steps(&scenario, Scheme::Explicit);
        assert!(!explicit.at_least && explicit.steps - made < 1.0);
        assert!(explicit.steps >= made);
    }
}

/// The number of semi-implicit steps is estimated to a factor of two, or of two and a half where
/// nothing damps the fast motion that the pilot's longer steps pass over; at any tolerance.
#[test]
fn semi_implicit_steps_are_estimated() {
    for seed in [2, 18, 41, 45, 56] {
        for how in ["", "external_damping = 0.0\nduration = 2.0"] {
            let leaf = parse(&format!("{}[dynamics]\n{how}", real::leaf(seed)));
            for tolerance in [1e-4, 1e-6] {
                let options = Options {
                    tolerance: Some(tolerance),
                    ..moving(Scheme::SemiImplicit, None)
                };
                let made = run(&leaf, &options).steps as f64;
                let automatic = Options {
                    scheme: None,
                    ..options
                };
                let choice = chosen(&leaf, &automatic);
                let [_, estimated] = choice.costs.unwrap();
                let ratio = estimated.steps / made;
                let within = ratio < 2.0 && (estimated.at_least || ratio > 0.4);
                assert!(within, "{seed}, {how}, {tolerance}: {ratio:.2}");
            }
        }
    }
}

/// The choices for leaves on either side, and how far the methods' costs are apart.
#[test]
fn the_cheaper_method_is_taken() {
    let own = |name: &str| scenario(name, "");
    let measured = |seed: u64| parse(&real::leaf(seed));
    let slender = parse(SLENDER_VEINS);
    for (name, leaf, scheme) in [
        ("swing", own("motion/swing"), Scheme::Explicit),
        ("curl", own("motion/curl"), Scheme::Explicit),
        ("strike", own("motion/strike"), Scheme::Explicit),
        ("2", measured(2), Scheme::SemiImplicit),
        ("13", measured(13), Scheme::Explicit),
        ("14", measured(14), Scheme::Explicit),
        ("33", measured(33), Scheme::Explicit),
        ("45", measured(45), Scheme::SemiImplicit),
        ("56", measured(56), Scheme::SemiImplicit),
        ("slender", slender, Scheme::Explicit),
    ] {
        let choice = by_default(&leaf);
        assert_eq!(
            (choice.scheme, choice.reason),
            (scheme, SchemeReason::Cost),
            "{name}"
        );
        let [explicit, semi_implicit] = choice.costs.unwrap();
        let (less, more) = match scheme {
            Scheme::Explicit => (explicit, semi_implicit),
            Scheme::SemiImplicit => (semi_implicit, explicit),
        };
        assert!(
            less.seconds <= more.seconds && !less.at_least,
            "{name}: {choice}"
        );
    }
}

/// Stiff veins of 15 cm that are released with their tips together ring. What is told to help does: with that internal
/// damping the same motion has a tenth of the steps, and costs what was estimated, to a factor of two.
#[test]
fn what_makes_a_costly_motion_cheaper_is_told() {
    let ringing = parse(
        r#"
        units = { length = "m", force = "N", time = "s" }
        leaf = { rods = 7, length = 0.15, fan = [-0.35, -0.23, -0.12, 0.0, 0.12, 0.23, 0.35] }
        section = { shape = "ellipse", width = 1.2e-3, thickness = 0.4e-3, young = 2e9, mass_density = 900.0 }
        load = { g = [0.0, 0.0, -9.81] }
        dynamics = { duration = 4.0 }
        "#,
    );
    let on_grid = Options {
        segments: Some(16),
        ..Options::default()
    };
    let motion = Refinement::new(&ringing, &on_grid).unwrap();
    let (_, seconds) = motion.expected().unwrap();
    let cheaper = motion.cheaper_motions();
    assert!(cheaper.is_sorted_by(|a, b| a.seconds <= b.seconds));
    assert!(cheaper.iter().all(|it| it.seconds < 0.5 * seconds));
    let damping = cheaper.iter().find_map(|it| match it.change {
        CheaperChange::InternalDamping(time) => Some((time, it.to_string())),
        _ => None,
    });
    let (time, told) = damping.unwrap();
    contains(
        &told,
        &[
            "dynamics.internal_damping = ",
            " % of its critical damping: some ",
        ],
    );
    let steps = |internal_damping: f64| {
        let mut leaf = ringing.clone();
        leaf.dynamics.internal_damping = internal_damping;
        leaf.dynamics.duration = 0.02;
        leaf.dynamics.output_interval = 0.02;
        let options = Options {
            tolerance: Some(1e-3),
            ..moving(Scheme::SemiImplicit, None)
        };
        run(&leaf, &options).steps
    };
    let [ringing_steps, damped] = [0.0, time].map(steps);
    assert!(10 * damped < ringing_steps, "{damped} {ringing_steps}");
    // A short motion is told nothing.
    let short = scenario("motion/swing", "");
    let short = Refinement::new(&short, &Options::default()).unwrap();
    assert_eq!(short.cheaper_motions(), []);
}

/// Internal damping makes explicit steps so short that they took forty times as long.
#[test]
fn internal_damping_is_left_to_the_semi_implicit_method() {
    let leaf = parse(&format!(
        "{}[dynamics]\ndensity = 2e-7\nduration = 2.0\ninternal_damping = 1e-2\n",
        real::leaf(14)
    ));
    let choice = by_default(&leaf);
    let [explicit, semi_implicit] = choice.costs.unwrap();
    assert_eq!(choice.scheme, Scheme::SemiImplicit);
    assert!(explicit.seconds > 10.0 * semi_implicit.seconds, "{choice}");
}

/// What is told before a motion is what the choice of its method compared: with tissue, which takes most of a step,
/// and without.
#[test]
fn the_duration_told_beforehand_counts_tissue() {
    for (name, tissue) in [("study/plate", true), ("motion/gust", false)] {
        let leaf = scenario(name, "dynamics.duration=0.2");
        let simulation = Simulation::new(&leaf, &Options::default()).unwrap();
        let [_, semi_implicit] = simulation.choice().costs.unwrap();
        assert_eq!(simulation.choice().scheme, Scheme::SemiImplicit, "{name}");
        let (steps, seconds) = simulation.expected().unwrap();
        close(name, steps, semi_implicit.steps, 1e-9 * steps);
        close(name, seconds, semi_implicit.seconds, 1e-9 * seconds);
        let step = seconds / steps / simulation.segments() as f64;
        assert_eq!(step > 5e-5, tissue, "{name}: {step:e} a segment");
    }
}

/// A request, and what only one of the methods can do, is not a matter of costs.
#[test]
fn what_decides_before_costs() {
    let leaf = |overrides: &str| scenario("motion/swing", overrides);
    let free = "leaf.rods=1; leaf.fan=[0]; coupling.y=0; coupling.z=0; dynamics.clamped=false";
    let pulse = "dynamics.tip_force={at=[1,1.0000001,1.0000002],value=[[0,0,0],[0,0,9],[0,0,0]]}";
    let default = Options::default;
    let step = |h| Options {
        step: Some(h),
        ..default()
    };
    for (overrides, options, scheme, reason) in [
        (
            "",
            moving(Scheme::SemiImplicit, None),
            Scheme::SemiImplicit,
            SchemeReason::Requested,
        ),
        (
            "",
            moving(Scheme::Explicit, None),
            Scheme::Explicit,
            SchemeReason::Requested,
        ),
        (
            "stiffness.axial=inf",
            default(),
            Scheme::SemiImplicit,
            SchemeReason::RigidRods,
        ),
        (free, default(), Scheme::Explicit, SchemeReason::FreeBase),
        (pulse, default(), Scheme::Explicit, SchemeReason::ShortPulse),
        ("", step(1e-3), Scheme::Explicit, SchemeReason::GivenStep),
    ] {
        let choice = chosen(&leaf(overrides), &options);
        let expected = SchemeChoice {
            scheme,
            reason,
            costs: None,
        };
        assert_eq!(choice, expected, "{overrides}");
    }
}

/// The choice is the same whatever is compiled in parallel, and the motion is the one of the
/// method alone, to the last bit.
#[test]
fn a_choice_changes_nothing_in_the_motion() {
    for seed in [2, 14] {
        let leaf = parse(&real::leaf(seed));
        let scheme = by_default(&leaf).scheme;
        let frames = [None, Some(scheme)].map(|scheme| {
            let options = Options {
                scheme,
                ..Options::default()
            };
            let mut simulation = Simulation::new(&leaf, &options).unwrap();
            [
                simulation.next_frame().unwrap(),
                simulation.next_frame().unwrap(),
            ]
        });
        assert_eq!(frames[0], frames[1], "{seed}");
    }
}

#[test]
fn the_report_and_the_summary_say_why() {
    let place = Workplace::new();
    let short = "simulate leaf.toml --segments 16 --set dynamics.duration=1";
    let run = place.ok(short);
    let line = "\n  choice   it costs less on the first grid: some ";
    run.says(&["method explicit\n", line, " by the semi-implicit one\n"]);
    let of = |arguments: &str| -> Value {
        let run = place.ok(format!("{short} --json {arguments}"));
        run.json()["choice"].clone()
    };
    let choice = of("");
    assert_eq!(choice["reason"], "cost");
    contains(
        choice["explanation"].text(),
        &["it costs less on the first grid: some ", " steps in "],
    );
    assert!(choice["explicit"]["steps"].number() > 100.0);
    assert_eq!(choice["explicit"]["at_least"], false);
    assert!(choice["semi_implicit"]["seconds"].number() > choice["explicit"]["seconds"].number());

    let choice = of("--method semi-implicit");
    assert_eq!(choice["reason"], "requested");
    assert_eq!(
        (&choice["explicit"], &choice["semi_implicit"]),
        (&Value::Null, &Value::Null)
    );
    let requested = place.ok(format!("{short} --method explicit")).out;
    assert!(!requested.contains("choice"), "{requested}");
}
