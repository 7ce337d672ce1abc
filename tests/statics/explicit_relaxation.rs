//! Explicit motion comes to rest where the semi-implicit relaxation does, and
//! where the damped motion of which both are short cuts ends.

use leafdyn::relax::{RelaxError, Route, relax};
use leafdyn_testing::motion::{Scheme, moving, run};
use leafdyn_testing::random::{drawn, leaves};
use leafdyn_testing::*;

/// Of positions, in lengths of the leaf.
const CLOSE: f64 = 1e-8;

const EXPLICIT: Method = Method::Explicit { segments: None };

fn explicit(options: Options) -> Options {
    by(EXPLICIT, options)
}

fn rest(scenario: &Scenario, method: Method, segments: Option<usize>) -> Equilibrium {
    settled(scenario, &by(method.on_grid(segments), Options::default()))
}

/// Released from arcs.
fn released(scenario: &Scenario, method: Method, segments: usize) -> Equilibrium {
    let released = Options {
        route: Route::Release,
        ..by(method.on_grid(Some(segments)), Options::default())
    };
    settled(scenario, &released)
}

#[track_caller]
fn agree_on(scenario: &Scenario, segments: usize) {
    let explicit = rest(scenario, EXPLICIT, Some(segments));
    let semi_implicit = rest(scenario, Method::default(), Some(segments));
    let apart =
        leafdyn_testing::apart(scenario, &explicit.shape.rods, &semi_implicit.shape.rods).position;
    assert!(apart < CLOSE, "{}: {apart:.1e}", scenario.name);
    let [a, b] = [&explicit, &semi_implicit].map(|leaf| leaf.stability.negative_eigenvalues);
    assert_eq!(a, b);
    let [a, b] = [&explicit, &semi_implicit].map(|leaf| leaf.energy.unwrap());
    assert!((a - b).abs() < 1e-9 * b.abs().max(1.0));
}

#[test]
fn on_every_figure_of_the_paper() {
    for file in files("paper") {
        // The paper's soft leaves bend too much for fewer.
        agree_on(&read(&file, "leaf.rods=5"), 32);
    }
    // With as many veins as the paper's.
    agree_on(&scenario("paper/fig04", ""), 16);
}

#[test]
fn on_the_classic_problems_it_can_do() {
    let mut done = 0;
    for file in files("classic") {
        let scenario = read(&file, "");
        match relax(&scenario, &explicit(Options::default()), &mut |_| {}) {
            Ok(explicit) => {
                done += 1;
                assert_eq!(explicit.outcome, Outcome::Converged, "{}", scenario.name);
                let other = rest(&scenario, Method::default(), None);
                let both = estimate(&explicit) + estimate(&other);
                for (a, b) in explicit.tips.iter().zip(&other.tips) {
                    assert!((*a - *b).length() <= both, "{}", scenario.name);
                }
            }
            Err(RelaxError::Option(refused)) if refused.option == "method" => {}
            Err(refused) => panic!("{}: {refused}", scenario.name),
        }
    }
    assert!(done >= 9, "{done}");
}

#[test]
fn on_leaves_nobody_has_thought_of() {
    let mut agreed = 0;
    for (case, scenario) in drawn(leaves(), 25).iter().enumerate() {
        let Ok(explicit) = relax(scenario, &explicit(to(1e-5)), &mut |_| {}) else {
            continue;
        };
        assert!(explicit.outcome.is_success(), "leaf {case}: {explicit:?}");
        let apart = tip(&explicit) - tip(&settle(scenario, 1e-8));
        let length = scale(scenario).length;
        assert!(apart.length() < 2e-5 * length, "leaf {case}: {apart}");
        agreed += 1;
    }
    assert!(agreed >= 15, "{agreed}");
}

/// Of several equilibria, the one in which the damped motion ends, resolved by
/// steps a hundredth as long as the relaxation's.
#[test]
fn the_damped_motion_ends_there() {
    for (figure, duration) in [("fig08", 10.0), ("fig09", 5.0), ("fig10", 10.0)] {
        let entries = format!("leaf.rods=5; dynamics.duration={duration}");
        let leaf_scenario = scenario(&format!("paper/{figure}"), &entries);
        let explicit = moving(Scheme::Explicit, Some(64));
        let end = run(&leaf_scenario, &explicit).tips(true)[0];
        for method in [EXPLICIT, Method::default()] {
            let tip = tip(&released(&leaf_scenario, method, 64));
            assert!((tip - end).length() < 0.01, "{figure}: {tip} or {end}");
        }
    }
}

/// What it takes, which does not depend on the machine.
#[test]
fn its_work_is_known() {
    for (figure, most) in [("fig04", 4000), ("fig06", 3000), ("fig10", 25_000)] {
        let scenario = scenario(&format!("paper/{figure}"), "leaf.rods=5");
        let work = released(&scenario, EXPLICIT, 32).work;
        let known = (most / 2 + 1..most).contains(&work.steps);
        assert!(known, "{figure}: {work:?}");
        assert!(work.factorizations < 60);
    }
}

#[test]
fn what_it_cannot_do_is_refused() {
    for (name, part) in [
        (
            "classic/lens_30",
            "stiffness.axial, stiffness.shear_2, stiffness.shear_3 = inf: no time step",
        ),
        ("classic/rollup", "load.tip_moment"),
    ] {
        let options = explicit(Options::default());
        let refused = relax(&scenario(name, ""), &options, &mut |_| {}).unwrap_err();
        let message = refused.to_string();
        assert!(message.contains(part), "{message}");
        assert!(message.contains("semi-implicit"), "{message}");
    }
}
