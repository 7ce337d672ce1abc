//! Wind: motions and rests in it are those of closed forms and of independent solutions; both
//! methods follow it with second order, and its work is accounted for.

use leafdyn::internals::leaf::State;
use leafdyn::internals::motion::{Energy, StepControl, TimeIntegrator as _};
use leafdyn::relax::{EquilibriumRemark, Route};
use leafdyn::scenario::{Dynamics, MotionStart, Tissue, Wind};
use leafdyn_testing::motion::{
    BOTH, Scheme, apart, at, beam, distance, explicit, limit, method, moving, numbers, ramp,
    released, rest, run, semi_implicit, three_veins, twisted_rod,
};
use leafdyn_testing::*;

/// Air of this velocity with rho C_D w/2 = `pressed` past all veins.
fn air(velocity: Schedule<[f64; 3]>, pressed: f64, rods: usize) -> Wind {
    Wind {
        velocity,
        density: 4.0,
        drag: 0.5,
        width: vec![Profile::Constant(pressed); rods],
    }
}

/// A free straight rod of mass one, broadside on.
fn falling(gravity: f64, wind: f64, pressed: f64) -> Scenario {
    let mut rod = beam(0.01, [100.0, 100.0]);
    rod.dynamics.clamped = false;
    rod.dynamics.gravity = Schedule::constant([0.0, 0.0, -gravity]);
    rod.wind = Some(air(Schedule::constant([0.0, 0.0, wind]), pressed, 1));
    rod
}

/// Velocity and height of a free rod after a time, from the largest step on, and the order.
fn assert_falls(rod: &Scenario, [velocity, height]: [f64; 2], until: f64) {
    let leaf = Leaf::new(rod);
    let start = released(&leaf, 8);
    let off = [100, 200, 400].map(|steps| {
        let now = at(
            Scheme::Explicit,
            &leaf,
            &start,
            until / f64::from(steps),
            until,
        );
        for (x, v) in now.state.x.iter().zip(&now.velocity) {
            let straight =
                v.linear.distance(now.velocity[0].linear) + (x.z - now.state.x[0].z).abs();
            assert!(straight < 1e-12 && v.angular.length() < 1e-12, "{straight}");
        }
        [
            now.velocity[3].linear.z - velocity,
            now.state.x[3].z - height,
        ]
    });
    for c in 0..2 {
        for pair in off.windows(2) {
            close(
                "order",
                order(pair[0][c].abs(), pair[1][c].abs()),
                2.0,
                0.05,
            );
        }
        let limit = off[2][c] + (off[2][c] - off[1][c]) / 3.0;
        assert!(limit.abs() < 2e-7, "{limit:.1e}");
    }
}

/// v = v_T tanh(g t/v_T) with v_T^2 = 2 m g/(rho C_D w), its integral v_T^2/g ln cosh(g t/v_T); and
/// without weight the wind takes it along, v = U - U/(1 + c U t). The semi-implicit method holds
/// the base.
#[test]
fn a_free_rod_falls_as_the_air_lets_it_and_is_blown_away() {
    let (g, c, t): (f64, f64, f64) = (2.0, 1.5, 1.2);
    let terminal = (g / c).sqrt();
    let velocity = -terminal * (g * t / terminal).tanh();
    let height = -terminal * terminal / g * (g * t / terminal).cosh().ln();
    assert_falls(&falling(g, 0.0, c), [velocity, height], t);
    let wind = 3.0;
    let blown = wind - wind / (1.0 + c * wind * t);
    let way = wind * t - (1.0 + c * wind * t).ln() / c;
    assert_falls(&falling(0.0, wind, c), [blown, way], t);
}

/// An inextensible cantilever across the wind, C = rho C_D w U^2 L^3/(2 EI), in other units than
/// natural ones.
fn across(cauchy: f64) -> Scenario {
    let (length, bending, speed) = (3.0_f64, 7.0, 2.0);
    let pressed = cauchy * bending / (speed * speed * length.powi(3));
    let mut rod = paper_leaf(1, [bending; 3], [f64::INFINITY; 3], 0.0);
    (rod.rods[0].length, rod.rods[0].angle) = (length, 0.0);
    rod.dynamics = Dynamics::default_for(&rod.rods);
    rod.wind = Some(air(Schedule::constant([0.0, 0.0, speed]), pressed, 1));
    rod
}

fn rests(scenario: &Scenario, options: Options) -> Equilibrium {
    rests_by(Route::Release, scenario, options)
}

/// At rest in the wind that grows, or in which the leaf moves.
fn rests_by(route: Route, scenario: &Scenario, options: Options) -> Equilibrium {
    settled(scenario, &Options { route, ..options })
}

/// Its drag over that of the rigid one.
fn reconfiguration(cauchy: f64, route: Route) -> f64 {
    let rod = across(cauchy);
    let found = rests_by(route, &rod, to(1e-9));
    let base = found.shape.rods[0].nodes[0];
    let pressed = cauchy * 7.0 / 27.0 / 4.0;
    assert!(found.accuracy.residual.unwrap() < 1e-8 * cauchy);
    assert_eq!((found.energy, found.stable()), (None, Some(true)));
    assert!(matches!(
        found.remark,
        Some(EquilibriumRemark::WindWithoutPotential { verdict: Some(_) })
    ));
    (base.rotation * base.n).z / (pressed * 4.0 * 3.0)
}

/// By theta''' = -C sin^2(theta) - theta'^3/2, theta(0) = pi/2, theta'(1) = theta''(1) = 0: R is the
/// integral of sin^3(theta). In strong wind R ~ C^(-1/3) (S. Vogel, J. Exp. Bot. 40, 1989).
#[test]
fn a_cantilever_across_the_wind_bends_out_of_it() {
    let table = "1 => 0.9748331360; 10 => 0.5236122824; 100 => 0.1917895283; 1000 => 0.0890046689";
    for row in table.split("; ") {
        let (cauchy, drag) = row.split_once(" => ").unwrap();
        let [cauchy, drag] = [cauchy, drag].map(|text| text.parse().unwrap());
        for route in [Route::Release, Route::Loading] {
            close(row, reconfiguration(cauchy, route), drag, 1e-8);
        }
    }
    let strong = [1e4, 1e5].map(|cauchy| reconfiguration(cauchy, Route::Release));
    close(
        "exponent",
        (strong[1] / strong[0]).log10(),
        -1.0 / 3.0,
        1e-3,
    );
}

/// A leaf of three veins in gusts from the side, as the wind changes its slope.
fn in_gusts() -> Scenario {
    let mut leaf = three_veins();
    let velocity = Schedule::linear(
        vec![0.0, 0.7, 2.0],
        vec![[0.0; 3], [2.0, 3.0, 4.0], [1.0, -3.0, 5.0]],
    );
    leaf.wind = Some(air(velocity, 0.8, 3));
    leaf.wind.as_mut().unwrap().width[1] = Profile::Linear {
        at: vec![0.0, 0.25, 1.0],
        value: vec![0.6, 1.0, 0.2],
    };
    leaf
}

/// The same with tissue, and veins whose tips are apart.
fn with_tissue() -> Scenario {
    let mut leaf = in_gusts();
    leaf.joined = false;
    leaf.tissue = Some(vec![
        Tissue {
            stiffness: [20.0, 40.0, 30.0].map(Profile::Constant),
            fold: Profile::Constant(0.5),
            contraction: Profile::Constant(0.0),
        };
        2
    ]);
    leaf
}

/// A rod in a gust.
fn rod_in_a_gust() -> Scenario {
    let mut rod = twisted_rod();
    rod.wind = Some(air(ramp(2.0, [3.0, -4.0, 6.0]), 1.0, 1));
    rod
}

/// Of a leaf at rest in still air.
fn still(scenario: &Scenario, segments: usize) -> State {
    let mut still = scenario.clone();
    // The nodes are those of the leaf in wind.
    let widths = still.wind.take().unwrap().width;
    let kinks: Vec<f64> = widths.iter().flat_map(Profile::kinks).copied().collect();
    still.distributed = Some(vec![
        std::array::from_fn(|_| zero_with(&kinks));
        widths.len()
    ]);
    rest(&still, segments)
}

fn zero_with(kinks: &[f64]) -> Profile {
    let inner = kinks.iter().copied().filter(|at| *at > 0.0 && *at < 1.0);
    let at: Vec<f64> = [0.0].into_iter().chain(inner).chain([1.0]).collect();
    let value = vec![0.0; at.len()];
    Profile::Linear { at, value }
}

/// Both methods are of second order and have the same limit.
#[test]
fn leaves_in_gusts_move_alike_by_both_methods() {
    for (name, scenario) in [("leaf", in_gusts()), ("tissue", with_tissue())] {
        let leaf = Leaf::new(&scenario);
        let state = still(&scenario, 4);
        let until = 1.5;
        let limits = BOTH.map(|scheme| {
            let on = |steps: usize| at(scheme, &leaf, &state, until / steps as f64, until);
            let found = [1500, 3000, 6000].map(|steps| numbers(&on(steps)));
            let changes = [0, 1].map(|k| distance(&found[k], &found[k + 1]));
            close(
                &format!("{name} {scheme:?}"),
                order(changes[0], changes[1]),
                2.0,
                0.1,
            );
            limit(&found[1], &found[2])
        });
        let start: Vec<f64> = state.x.iter().flat_map(|x| x.to_array()).collect();
        let moved = apart(&start, &limits[0][..start.len()]);
        assert!(moved > 0.3, "{name}: moved by {moved}");
        let between = apart(&limits[0], &limits[1]);
        assert!(between < 5e-6, "{name}: {between:.1e} apart");
    }
}

/// The balance of energy, with the work of the wind, closes as the square of the step.
#[test]
fn the_work_of_the_wind_is_accounted_for() {
    for scenario in [rod_in_a_gust(), in_gusts()] {
        let leaf = Leaf::new(&scenario);
        let state = still(&scenario, 4);
        for scheme in BOTH {
            let off = [1e-3, 5e-4].map(|h| {
                let mut method = method(scheme, &leaf, &state, h);
                let mut at = |k: usize| {
                    method.advance(0.03 * k as f64).unwrap();
                    method.snapshot().energy
                };
                let all: Vec<Energy> = (0..=50).map(&mut at).collect();
                assert!(all[50].work.abs() > 0.3, "{}", all[50].work);
                largest(all.iter().map(|e| (e.balance() - all[0].balance()).abs()))
            });
            let name = format!("{} {scheme:?}: {off:?}", scenario.name);
            close(&name, order(off[0], off[1]), 2.0, 0.1);
        }
    }
}

/// Newton's method finds where long motions by either method end.
#[test]
fn leaves_rest_where_their_motion_ends() {
    let mut leaf = with_tissue();
    leaf.dynamics.external_damping = 4.0;
    leaf.wind.as_mut().unwrap().velocity = Schedule::constant([1.0, 3.0, 4.0]);
    let mut joined = leaf.clone();
    (joined.joined, joined.tissue) = (true, None);
    for scenario in [leaf, joined] {
        let found = rests(&scenario, on(8));
        assert!(found.accuracy.residual.unwrap() < 1e-9);
        let tips: Vec<DVec3> = found.tips.clone();
        let discrete = Leaf::new(&scenario);
        let start = still(&scenario, 8);
        for scheme in BOTH {
            let h = if scheme == Scheme::Explicit {
                2e-3
            } else {
                0.05
            };
            let now = at(scheme, &discrete, &start, h, 40.0);
            for (j, tip) in tips.iter().enumerate() {
                let off = now.state.tip(j).distance(*tip);
                assert!(off < 1e-9, "{scheme:?} {j}: {off:.1e}");
            }
        }
        assert!(tips[0].distance(start.tip(0)) > 0.2);
    }
}

/// Widths and velocities that vary: on grids whose segments are halved positions converge as a
/// series in ds^2, and errors are within their bars.
#[test]
fn rest_in_wind_converges_with_the_square_of_the_segments() {
    let mut leaf = in_gusts();
    leaf.wind.as_mut().unwrap().velocity = Schedule::constant([1.0, 3.0, 4.0]);
    let on_grids = [8, 16, 32, 64].map(|segments| tip(&rests(&leaf, on(segments))));
    let changes: Vec<f64> = (on_grids.windows(2)).map(|w| w[0].distance(w[1])).collect();
    for pair in changes.windows(2) {
        close("order", order(pair[0], pair[1]), 2.0, 0.1);
    }
    let fine = rests(&leaf, to(1e-10));
    let coarse = rests(&leaf, to(1e-6));
    let off = tip(&fine).distance(tip(&coarse));
    let bar = coarse.accuracy.error_estimate.unwrap();
    assert!(off <= bar && bar <= 1e-6, "{off:.1e} {bar:.1e}");
}

/// A motion at rest in steady wind stays there; it begins where `relax` ends.
#[test]
fn a_motion_that_starts_at_rest_in_wind_stays_there() {
    let mut leaf = in_gusts();
    leaf.wind.as_mut().unwrap().velocity = Schedule::constant([1.0, 3.0, 4.0]);
    leaf.dynamics.start = MotionStart::AtRest;
    leaf.dynamics.duration = 2.0;
    leaf.dynamics.output_interval = 1.0;
    let rest = rests(&leaf, on(8));
    for scheme in BOTH {
        let frame = run(&leaf, &moving(scheme, Some(8)));
        let off = frame.tips(true)[0].distance(tip(&rest));
        assert!(off < 1e-9, "{scheme:?}: {off:.1e}");
    }
}

/// Motions and equilibria are equal to the last bit on any number of threads.
#[test]
fn motions_in_wind_have_equal_bits_on_any_number_of_threads() {
    let mut many = paper_leaf(16, [1.0; 3], [100.0; 3], 1.0);
    many.wind = Some(air(Schedule::constant([1.0, 2.0, 3.0]), 0.5, 16));
    let leaf = Leaf::new(&many);
    let moved = |threads: usize, scheme| {
        on_threads(threads, || {
            let start = released(&leaf, 520);
            numbers(&at(scheme, &leaf, &start, 2e-5, 4e-4))
        })
    };
    for scheme in BOTH {
        let alone = moved(1, scheme);
        for threads in [2, 5] {
            assert!(moved(threads, scheme) == alone, "{scheme:?} {threads}");
        }
    }
    // It hardly moves: motions on so many segments take long.
    let faint = Schedule::constant([0.1, 0.2, 0.3]);
    (many.joined, many.gravity) = (false, [0.0; 3]);
    many.wind.as_mut().unwrap().velocity = faint;
    let relaxed = |threads| on_threads(threads, || bits(&rests(&many, on(520)).shape.rods));
    assert!(relaxed(1) == relaxed(2));
}

/// Drag so strong that it alone limits the step of the explicit method: up to it the motion is that of
/// the semi-implicit one, and far beyond it says that it diverged.
#[test]
fn explicit_steps_are_as_short_as_drag_demands() {
    let mut rod = twisted_rod();
    rod.wind = Some(air(Schedule::constant([1.0, -2.0, 2.0]), 20.0, 1));
    let leaf = Leaf::new(&rod);
    let start = released(&leaf, 8);
    let stable = explicit(&leaf, &start, None).stable_step();
    assert_eq!(stable.limit, "the drag of the wind");
    let after = |scheme, h| at(scheme, &leaf, &start, h, 0.5).state.tip(0);
    let found = after(Scheme::Explicit, 0.999 * stable.step);
    let off = found.distance(after(Scheme::SemiImplicit, 2e-4));
    assert!(
        off < 1e-3 && found.distance(start.tip(0)) > 0.5,
        "{off:.1e}"
    );
    let mut lost = explicit(&leaf, &start, Some(4.0 * stable.step));
    assert!(lost.advance(1.0).is_err());
}

/// Without air, and in air that does not blow past a rod, motions are those without wind.
#[test]
fn air_without_effect_changes_nothing() {
    let rod = twisted_rod();
    let leaf = Leaf::new(&rod);
    let start = released(&leaf, 4);
    let mut blown = rod.clone();
    blown.wind = Some(air(ramp(1.0, [1.0, 2.0, 3.0]), 1.0, 1));
    blown.wind.as_mut().unwrap().drag = 0.0;
    let windy = Leaf::new(&blown);
    for scheme in BOTH {
        let [a, b] = [&leaf, &windy].map(|leaf| numbers(&at(scheme, leaf, &start, 1e-3, 0.5)));
        let off = largest(a.iter().zip(&b).map(|(a, b)| (a - b).abs()));
        assert!(off < 1e-9, "{scheme:?}: {off:.1e}");
    }
    // Steps that are as long as their error allows end at every change of the wind.
    let gust = in_gusts();
    let windy = Leaf::new(&gust);
    let state = still(&gust, 4);
    let mut motion = semi_implicit(&windy, &state, StepControl::LocalError(1e-6));
    let fine = at(Scheme::Explicit, &windy, &state, 2e-4, 1.5);
    motion.advance(1.5).unwrap();
    let off = motion.snapshot().state.tip(0).distance(fine.state.tip(0));
    assert!(off < 1e-4, "{off:.1e}");
}

/// With a dead moment and loads that turn with the section, by both ways.
#[test]
fn wind_and_other_forces_without_a_potential_act_together() {
    let text = r#"
        name = "rod"
        leaf = { rods = 1, length = 1.0, fan = [0.3] }
        stiffness = { torsion = 0.8, bending_2 = 1.0, bending_3 = 1.4, axial = 60.0, shear_2 = 70.0, shear_3 = 50.0 }
        load = { gravity = [0.0, 0.0, -0.4], tip_moment = [0.1, -0.2, 0.2], follower = [0.2, 0.3, 0.4] }
        wind = { velocity = [0.5, 0.8, 1.0], density = 1.2, drag = 2.0, width = 0.4 }
    "#;
    let scenario = parse(text);
    let [moved, grown] =
        [Route::Release, Route::Loading].map(|route| rests_by(route, &scenario, to(1e-8)));
    assert!(tip(&moved).distance(tip(&grown)) < 3e-8);
    assert_eq!(grown.stable(), Some(true));
}

/// Veins with sections, and a blade, turn to the wind what they are wide, unless that is given; the scenario that is
/// written says no more than was said.
#[test]
fn the_width_in_wind_is_that_of_sections_and_strips() {
    let air = "[wind]\nvelocity = [0.0, 150.0, 0.0]\ndensity = 1.2e-8\ndrag = 1.2\n";
    let strip = format!(
        "name = 'strip'\nleaf = {{ rods = 1, length = 10, fan = [0] }}\nsection = {{ shape = 'rectangle', \
         width = {{ at = [0, 1], value = [0.6, 0.2] }}, thickness = 0.02, young = 2e5, mass_density = 8e-6 }}\n{air}"
    );
    let given = format!("{strip}width = {{ at = [0, 1], value = [0.6, 0.2] }}\n");
    let [strip, given] = [strip, given].map(|text| Scenario::from_toml(&text).unwrap());
    let (own, same) = (
        rests(&strip, Options::default()),
        rests(&given, Options::default()),
    );
    let away = tip(&own).distance(tip(&same));
    assert!(away < 1e-9, "{away:e}");

    let blade = format!(
        "name = 'blade'\nleaf = {{ rods = 5, elevation = 0.9 }}\nblade = {{ length = 25, thickness = 0.03, young = 5e4, \
         mass_density = 8e-6, width = {{ at = [0, 0.4, 1], value = [0.9, 1.6, 0] }} }}\n{air}"
    );
    let blade = Scenario::from_toml(&blade).unwrap();
    let wind = blade.wind.as_ref().unwrap();
    let whole = blade.blade.as_ref().unwrap();
    // Strips of a slender blade are across it but for the square of their small angles.
    for x in [0.0, 0.2, 0.4, 0.7, 1.0] {
        let together: f64 = wind.width.iter().map(|width| width.at(x)).sum();
        close("width of the strips", together, whole.width(x), 4e-3);
    }
    for leaf in [&strip, &blade] {
        let written = serde_json::to_value(leaf).unwrap();
        assert_eq!(written["wind"].get("width"), None);
        let again = Scenario::from_toml(&written.to_string()).unwrap();
        assert_eq!(again.wind, leaf.wind);
    }
    // Numbers tell no width.
    let mut rod = serde_json::to_value(in_gusts()).unwrap();
    rod["wind"].as_object_mut().unwrap().remove("width");
    let refused = Scenario::from_toml(&rod.to_string())
        .unwrap_err()
        .to_string();
    assert!(refused.contains("wind.width is missing"), "{refused}");
}
