//! Columns and beams on hinges: where they buckle, how they vibrate, and in how many directions
//! nothing holds them.

use leafdyn::internals::leaf::Leaf;
use leafdyn::internals::motion::Physics;
use leafdyn::relax::Mode;
use leafdyn_testing::branch::{changes_at, follow};
use leafdyn_testing::motion::{discrete, state_of};
use leafdyn_testing::vibration::Linear;
use leafdyn_testing::*;
use nalgebra::SymmetricEigen;

/// A rod on a hinge whose tip is held on its axis.
const COLUMN: &str = r#"
    name = "column"
    leaf = { rods = 1, length = 1.0, fan = [0.0], base_held = "pinned" }
    stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = 1e3, shear_2 = 400.0, shear_3 = 400.0 }
    tip = { held = "pinned", position = [1.0, 0.0, 0.0] }
    dynamics = { density = 1.0, rotary_inertia = 1e-10 }
"#;

/// Its base turns, and does not spin.
const HELD_SPIN: &str = "leaf.base_spin=held";

/// Roots of tan b = b.
const TAN: [f64; 2] = [4.493409457909064, 7.725251836937707];

/// Roots of tan b = tanh b, of the beam on a hinge and in a clamp (S. Timoshenko, Vibration problems
/// in engineering).
const HINGED_CLAMPED: [f64; 3] = [3.926602312047919, 7.068582745628732, 10.210176122813031];

/// P (1 + P/GA - P/EA) = k^2 EI/L^2 (Engesser and Reissner).
fn reissner(k: f64, axial: f64, shear: f64) -> f64 {
    let a = 1.0 / shear - 1.0 / axial;
    2.0 * k * k / (1.0 + (1.0 + 4.0 * a * k * k).sqrt())
}

/// Pushed together, a column with the loads P = EA (1 - x) buckles at these, by so many ways each:
/// along the branch, and where it is kept straight.
#[test]
fn columns_buckle_at_the_loads_of_euler_and_reissner() {
    close("P", reissner(PI, 1e3, 400.0), 9.727663252556647, 1e-14);
    close("P", reissner(PI, 100.0, 40.0), 8.72715570151268, 1e-14);
    let rigid = f64::INFINITY;
    let mut cases = Vec::new();
    for (axial, shear) in [(1e3, 400.0), (100.0, 40.0), (1e4, rigid)] {
        for (other, ways) in [(1.0, 2), (1000.0, 1)] {
            let entries = format!(
                "{}; stiffness.bending_2={other:?}",
                set_stiffness(axial, shear)
            );
            let both = [PI, 2.0 * PI].map(|k| reissner(k, axial, shear)).to_vec();
            cases.push((entries.clone(), axial, both, ways));
            if shear == rigid {
                // Beside a clamp the ends' shear forces matter, too, if it shears.
                let both = TAN.map(|k| reissner(k, axial, shear)).to_vec();
                cases.push((format!("{entries}; tip.held=clamped"), axial, both, ways));
            }
        }
    }
    for (entries, axial, loads, ways) in cases {
        let places: Vec<f64> = loads.iter().map(|load| 1.0 - load / axial).collect();
        let last = 1.0 - 1.15 * loads[1] / axial;
        let vary = format!("tip.position[0]={}..{last}", 1.0 - 0.1 / axial);
        let found = follow(COLUMN, &entries, &vary, false);
        let wanted: Vec<_> = places.iter().map(|place| (*place, ways)).collect();
        changes_at(&entries, &found, &wanted, 1e-8 * (1.0 - places[0]));
        let mut index = 0;
        for load in loads {
            for (part, change) in [(0.999, 0), (1.001, ways)] {
                index += change;
                let place = 1.0 - part * load / axial;
                let at = format!("{entries}; tip.position=[{place}, 0, 0]");
                let leaf = settle_on(base(COLUMN, &at).scenario(), 512, true);
                let found = leaf.stability.negative_eigenvalues;
                assert_eq!(found, Some(index as usize), "{at}");
                assert_eq!(
                    leaf.stability.neutral_directions,
                    usize::from(!entries.contains("clamped"))
                );
            }
        }
    }
}

/// A slender beam between two hinges, or a hinge and a clamp, has the frequencies of Euler and
/// Bernoulli, each twice; between two hinges it spins.
#[test]
fn slender_beams_vibrate_as_euler_and_bernoulli_say() {
    let hinges = [1.0, 2.0, 3.0].map(|k| k * PI);
    for (held, roots, spins) in [("pinned", hinges, 1), ("clamped", HINGED_CLAMPED, 0)] {
        let stiff = set_stiffness(1e5, f64::INFINITY);
        let beam = base(COLUMN, &format!("{stiff}; tip.held={held}"));
        let options = Options {
            mode_shapes: true,
            ..with_modes(6 + spins, Options::default())
        };
        let leaf = settled(beam.scenario(), &options);
        assert_eq!(leaf.stability.neutral_directions, spins);
        let modes = leaf.stability.modes.as_deref().unwrap();
        assert_eq!(modes.len(), 6 + spins);
        assert!(modes[..spins].iter().all(|mode| mode.eigenvalue == 0.0));
        let known = roots.iter().flat_map(|b| [b * b; 2]);
        for (mode, known) in modes[spins..].iter().zip(known) {
            let found = mode.frequency().unwrap();
            let error = (found / known - 1.0).abs();
            let estimate = mode.error.unwrap() / (2.0 * known * known);
            let what = format!("{held}: {found} for {known}, {error:.1e}, estimate {estimate:.1e}");
            assert!(error < 1e-6 && error <= estimate + 1e-8, "{what}");
        }
    }
}

/// On a hinge that holds the spin a column buckles as on another, and no direction is neutral before.
#[test]
fn a_held_spin_is_none_of_the_ways_to_buckle() {
    for (other, ways) in [(1.0, 2), (1000.0, 1)] {
        for (part, index) in [(0.999, 0), (1.001, ways)] {
            let place = 1.0 - part * reissner(PI, 1e3, 400.0) / 1e3;
            let at =
                format!("stiffness.bending_2={other:?}; tip.position=[{place}, 0, 0]; {HELD_SPIN}");
            let leaf = settle_on(base(COLUMN, &at).scenario(), 512, true);
            assert_eq!(leaf.stability.negative_eigenvalues, Some(index), "{at}");
            assert_eq!(leaf.stability.neutral_directions, 0, "{at}");
        }
    }
}

/// A beam on a hinge that holds the spin bends as on another hinge, and twists as in a clamp.
#[test]
fn a_held_spin_vibrates_as_in_a_clamp() {
    let squares = |entries: &str| {
        let entries = format!(
            "dynamics.rotary_inertia=0.01; tip.position=[1.001, 0, 0]; stiffness.torsion=0.1; {entries}"
        );
        let options = Options {
            mode_shapes: true,
            ..with_modes(8, iterated(1e-10, 32))
        };
        let leaf = settled(base(COLUMN, &entries).scenario(), &options);
        let modes = leaf.stability.modes.unwrap();
        let twists = |mode: &Mode| largest(mode.displacement[0].iter().map(|d| d.length())) < 1e-6;
        modes
            .iter()
            .map(|mode| (mode.eigenvalue, twists(mode)))
            .collect::<Vec<_>>()
    };
    let [free, held, clamped] = ["", HELD_SPIN, "leaf.base_held=clamped"].map(squares);
    let pick = |of: &[(f64, bool)], twists: bool| -> Vec<f64> {
        let own = of.iter().filter(|it| it.1 == twists);
        own.map(|it| it.0).collect()
    };
    for (other, twists) in [(&free, false), (&clamped, true)] {
        let (ours, theirs) = (pick(&held, twists), pick(other, twists));
        let both = ours.len().min(theirs.len());
        assert!(both > 0, "{held:?} {other:?}");
        for (a, b) in ours.iter().zip(&theirs) {
            close("square of a frequency", *a, *b, 1e-7 * b);
        }
    }
}

/// Of leaves at rest on one grid the dense matrix, without a phase condition, has as many eigenvalues
/// that are negative, and that are zero, as are told.
#[test]
fn counts_are_those_of_the_dense_matrix() {
    let plain = "dynamics.rotary_inertia=0.01";
    let oval = "stiffness.bending_3=2.0";
    let lines = COLUMN.lines().filter(|line| !line.contains("tip ="));
    let free = lines.collect::<Vec<_>>().join("\n");
    let hanging = "load.gravity=[0, 0, -2.0]";
    let mut seen = Vec::new();
    for entries in [
        "",
        oval,
        "tip.position=[0.98, 0, 0]",
        "tip.position=[0.95, 0, 0]; stiffness.bending_3=2.0",
        "tip.position=[0.97, 0, 0]; load.gravity=[0, 1, -3]",
        "tip.position=[0.97, 0, 0]; load.gravity=[0, 1, -3]; stiffness.bending_3=2.0",
        "tip.held=clamped; tip.position=[0.9, 0, 0]",
        hanging,
        &format!("{hanging}; {oval}"),
        &format!("{hanging}; rest.bend_3=0.4"),
        &format!("{hanging}; {oval}; rest.bend_3=0.4"),
        HELD_SPIN,
        &format!("tip.position=[0.95, 0, 0]; {HELD_SPIN}"),
        &format!("tip.position=[0.95, 0, 0]; {oval}; {HELD_SPIN}"),
        &format!("tip.position=[0.97, 0, 0]; load.gravity=[0, 1, -3]; {HELD_SPIN}"),
        &format!("tip.position=[0.97, 0, 0]; load.gravity=[0, 1, -3]; {oval}; {HELD_SPIN}"),
        &format!("tip.held=clamped; tip.position=[0.9, 0, 0]; {HELD_SPIN}"),
        &format!("tip.position=[0.95, 0, 0]; leaf.fan=[0.4]; {HELD_SPIN}"),
        &format!("tip.position=[0.8, 0, 0]; leaf.fan=[1.4]; leaf.base=[0.1, 0, 0]; {HELD_SPIN}"),
        &format!("tip.position=[0.95, 0, 0]; leaf.fan=[0.4]; {oval}; {HELD_SPIN}"),
        &format!("{hanging}; {HELD_SPIN}"),
        &format!("{hanging}; {oval}; rest.bend_3=0.4; {HELD_SPIN}"),
    ] {
        let text = if entries.starts_with(hanging) {
            &free
        } else {
            COLUMN
        };
        let column = base(text, &format!("{plain}; {entries}"));
        let scenario = column.scenario();
        for options in [iterated(1e-12, 16), keeping(iterated(1e-12, 16))] {
            let leaf = settled(scenario, &options);
            let own = Leaf::new(scenario);
            let grid = discrete(&own, 16);
            let linear = Linear::new(&grid, &Physics::new(&own), &state_of(scenario, &leaf));
            let values = SymmetricEigen::new(linear.scaled()).eigenvalues;
            let count = |of: &dyn Fn(f64) -> bool| values.iter().filter(|it| of(**it)).count();
            let zero = count(&|value| value.abs() < 1e-5);
            assert_eq!(zero, leaf.stability.neutral_directions, "{entries}");
            let negative = count(&|value| value <= -1e-5);
            assert_eq!(
                leaf.stability.negative_eigenvalues,
                Some(negative),
                "{entries}"
            );
            seen.push((negative, zero));
        }
    }
    for neutral in 0..=2 {
        assert!(seen.iter().any(|(_, zero)| *zero == neutral), "{seen:?}");
    }
    assert!(seen.iter().any(|(negative, _)| *negative > 1), "{seen:?}");
}

/// Three veins with tissue from hinges, one of which moves.
const VEINS: &str = r#"
    name = "veins"
    leaf = { rods = 3, length = 1.0, fan = [0.2, 0.0, -0.2], base = [[0.0, -0.2, 0.0], [0.1, 0.0, 0.15], [0.0, 0.2, 0.0]], base_held = "pinned" }
    stiffness = { torsion = 0.8, bending_2 = 1.0, bending_3 = 2.0, axial = 100.0, shear_2 = 60.0, shear_3 = 80.0 }
    tissue = { along = 20.0, across = 10.0, normal = 15.0, fold = 0.4 }
    load.gravity = [0.0, 0.3, -2.0]
"#;

/// Every point of a branch along which a hinge moves is the leaf that relaxes there.
#[test]
fn a_hinge_that_moves_is_followed() {
    for (key, range, entries) in [
        ("leaf.base[0][1]", "-0.2..-0.1", ""),
        ("leaf.base[0][1]", "-0.2..-0.1", HELD_SPIN),
        ("leaf.fan[0]", "0.2..0.5", HELD_SPIN),
    ] {
        is_followed(key, range, entries);
    }
}

fn is_followed(key: &str, range: &str, entries: &str) {
    let found = follow(VEINS, entries, &format!("{key}={range}"), false);
    assert!(found.complete, "{:?}", found.branches[0].remarks);
    let key = key.parse().unwrap();
    let points = &found.branches[0].points;
    assert!(points.len() > 4 && points.iter().all(|point| point.index == 0));
    for point in points.iter().step_by(4) {
        let leaf = base(VEINS, entries)
            .scenario_with_values(&[(&key, point.value)])
            .unwrap();
        let leaf = settle(&leaf.scenario, 1e-9);
        let bar = point.error.unwrap() + leaf.accuracy.error_estimate.unwrap();
        for (ours, theirs) in point.tips.iter().zip(&leaf.tips) {
            let off = ours.distance(*theirs);
            assert!(off <= bar, "{}: {off:e}", point.value);
        }
    }
}

/// The boundary of a column over its bending stiffness: P (1 + P/GA - P/EA) = pi^2 EI/L^2.
#[test]
fn the_boundary_of_a_column_is_reissners() {
    let strip = "stiffness.bending_3=3.0";
    let (place, stiffness) = (
        "tip.position[0]=0.9999..0.98",
        "stiffness.bending_2=0.5..1.5",
    );
    let found = leafdyn_testing::plane::follow(COLUMN, strip, place, stiffness);
    assert!(found.complete, "{:?}", found.remark);
    let curve = only(&found.curves);
    assert!(curve.points.len() > 5);
    for point in &curve.points {
        let [place, bending] = point.values;
        let wanted = reissner(PI * bending.sqrt(), 1e3, 400.0);
        let load = 1e3 * (1.0 - place);
        close("P", load, wanted, 1e-9 * wanted);
        assert_eq!([point.index_before, point.index_behind], [0, 1]);
    }
}

/// A bent rod on a hinge turns about the force on its tip without resistance: a branch has the
/// equilibrium of every circle that a relaxation has, whichever way it goes.
#[test]
fn branches_of_a_leaf_that_can_turn_meet_its_relaxations() {
    let text = r#"
        leaf = { rods = 1, length = 1.0, fan = [0.0], base_held = "pinned" }
        rest = { bend_2 = -2.0, bend_3 = -0.4 }
        load = { tip_force = [-3.0, 3.7, 0.0] }
        stiffness = { torsion = 0.6, bending_2 = 2.0, bending_3 = 0.5, axial = inf, shear_2 = inf, shear_3 = inf }
    "#;
    for [from, to] in [[-3.0, -1.0], [-1.0, -3.0]] {
        let vary = format!("load.tip_force[0]={from}..{to}");
        let trace = follow(text, &format!("load.tip_force[0]={from}"), &vary, false);
        let points = &trace.branches[0].points;
        assert_eq!(points.last().unwrap().value, to);
        for point in points {
            let entries = [format!("load.tip_force[0]={:?}", point.value)];
            let leaf = Scenario::from_toml_with(text, "rod", &entries).unwrap();
            let rest = settle(&leaf, 1e-9);
            let off = point.tips[0].distance(tip(&rest));
            let told = point.error.unwrap() + estimate(&rest);
            assert!(off <= told, "{}: {off:e} of {told:e}", point.value);
        }
    }
}

/// A straight column whose base a spring holds.
const ROOTED: &str = r#"
    name = "rooted"
    leaf = { rods = 1, length = 1.0, fan = [0.0], base_held = "elastic", base_turn_stiffness = 1.0 }
    stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 3.0, axial = inf, shear_2 = inf, shear_3 = inf }
    load = { tip_force = [0.0, 0.0, 0.0] }
    dynamics = { density = 1.0, rotary_inertia = 1e-10 }
"#;

/// The root of a function that changes its sign between these.
fn root(f: impl Fn(f64) -> f64, [mut low, mut high]: [f64; 2]) -> f64 {
    let sign = f(low).signum();
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        match f(middle).signum() == sign {
            true => low = middle,
            false => high = middle,
        }
    }
    low
}

/// k L tan(k L) = c L/EI, P = EI k^2 (S. Timoshenko and J. Gere, Theory of elastic stability).
#[test]
fn columns_on_elastic_roots_buckle_where_they_should() {
    for spring in [0.2, 1.0, 8.0] {
        // In both planes, whose stiffness is 1 and 3.
        let mut loads = [1.0, 3.0].map(|stiffness: f64| {
            let k = root(
                |k| k * k.sin() - spring / stiffness * k.cos(),
                [1e-6, 0.5 * PI],
            );
            (-stiffness * k * k, 1)
        });
        loads.sort_by(|a, b| b.0.total_cmp(&a.0));
        let entries = format!("leaf.base_turn_stiffness={spring}");
        let vary = format!("load.tip_force[0]=0..{}", 1.05 * loads[1].0);
        let found = follow(ROOTED, &entries, &vary, false);
        changes_at(&entries, &found, &loads, 3e-7 * loads[0].0.abs());
    }
}

/// Frequencies of a beam on a spring: w'' = c w' at the base.
#[test]
fn beams_on_elastic_roots_vibrate_as_they_should() {
    for spring in [0.2, 1.0, 8.0] {
        // w = a (cosh bx - cos bx) + d sinh bx + e sin bx.
        let condition = |b: f64| {
            let (cosh, sinh, cos, sin) = (b.cosh(), b.sinh(), b.cos(), b.sin());
            // From 2 a b = c (d + e), with d = 2 a b/c - e.
            let a = 2.0 * b / spring;
            let bending = [(cosh + cos) + a * sinh, -sinh - sin];
            let shear = [(sinh - sin) + a * cosh, -cosh - cos];
            bending[0] * shear[1] - bending[1] * shear[0]
        };
        let known =
            [[0.1, 1.9], [3.3, 4.72], [6.5, 7.87]].map(|within| root(condition, within).powi(2));
        let text = base(
            ROOTED,
            &format!("leaf.base_turn_stiffness={spring}; stiffness.bending_3=1e4"),
        );
        let options = Options {
            modes: 6,
            mode_shapes: true,
            ..to(1e-8)
        };
        let leaf = settled(text.scenario(), &options);
        let modes = leaf.stability.modes.as_ref().unwrap();
        // Beside those in which the column sways as a whole about the axis in which it is stiff.
        for known in known {
            let off = |mode: &Mode| (mode.frequency().unwrap() / known - 1.0).abs();
            let nearest = modes.iter().map(off).fold(f64::INFINITY, f64::min);
            assert!(nearest < 1e-6, "{spring}: {nearest:e} off {known}");
        }
    }
}

/// A column along x that a strut, on a hinge across it, keeps from swaying; both are held by these words.
const PROPPED: &str = r#"
    name = "propped"
    leaf = { rods = 2, length = 1.0, fan = [0.0, 1.5707963267948966], base = [[0.0, 0.0, 0.0], [1.0, -1.0, 0.0]], base_held = HELD }
    stiffness = { torsion = 1.0, bending_2 = 1e4, bending_3 = 1.0, axial = inf, shear_2 = inf, shear_3 = inf }
    load = { tip_force = [0.0, 0.0, 0.0] }
"#;

/// A column of which the tip stays on its axis buckles where tan x = x/(1 + x^2/k) with the spring k L/EI at its
/// base: at x = 4.4934 on a clamp, at pi on a hinge (S. Timoshenko and J. Gere, Theory of elastic stability). Out of
/// the plane, where the strut on a hinge does not prop it, a stiff column on a spring leans at k L tan(k L) = c L/EI,
/// P = EI k^2.
#[test]
fn propped_columns_buckle_by_what_holds_each() {
    let on_spring = |k: f64| root(|x| x.sin() * (1.0 + x * x / k) - x * x.cos(), [3.2, 4.49]);
    let leaning = |c: f64| {
        let k = root(|k| k * k.sin() - 1e-4 * c * k.cos(), [1e-6, 0.5 * PI]);
        (-1e4 * k * k, 1)
    };
    for (held, x, leans) in [
        (r#"["clamped", "pinned"]"#, TAN[0], None),
        (r#"["pinned", "clamped"]"#, PI, None),
        (
            r#"["elastic", "pinned"], base_turn_stiffness = 2.0"#,
            on_spring(2.0),
            Some(leaning(2.0)),
        ),
        (
            r#"["elastic", "pinned"], base_turn_stiffness = 9.0"#,
            on_spring(9.0),
            Some(leaning(9.0)),
        ),
    ] {
        let text = PROPPED.replace("HELD", held);
        let wanted: Vec<_> = leans.into_iter().chain([(-x * x, 1)]).collect();
        let vary = format!("load.tip_force[0]=-1..{}", -1.1 * x * x);
        let found = follow(&text, "load.tip_force[0]=-1", &vary, false);
        changes_at(held, &found, &wanted, 1e-6);
    }
}

/// Veins that nothing ties vibrate as so many leaves of one vein do.
#[test]
fn veins_apart_vibrate_as_leaves_of_one_vein() {
    let leaf = |rods: usize, fan: &str, held: &str| {
        let text = format!(
            r#"
            name = "veins"
            leaf = {{ rods = {rods}, length = 1.0, fan = {fan}, joined = false, base_held = {held}, base_turn_stiffness = 1.3 }}
            stiffness = {{ torsion = 0.7, bending_2 = 1.0, bending_3 = 2.3, axial = 100.0, shear_2 = 60.0, shear_3 = 80.0 }}
            load.gravity = [0.1, 0.0, -1.0]
            dynamics = {{ density = 1.0, rotary_inertia = 0.01 }}
            "#
        );
        let scenario = parse(&text);
        let settings = Options {
            modes: 6,
            ..iterated(1e-12, 16)
        };
        let modes = settled(&scenario, &settings).stability.modes.unwrap();
        modes.iter().map(|mode| mode.eigenvalue).collect::<Vec<_>>()
    };
    let together = leaf(2, "[0.2, -0.3]", r#"["clamped", "elastic"]"#);
    let spring = leaf(1, "[-0.3]", r#"["elastic"]"#);
    let clamp = {
        let text = r#"
            name = "vein"
            leaf = { rods = 1, length = 1.0, fan = [0.2] }
            stiffness = { torsion = 0.7, bending_2 = 1.0, bending_3 = 2.3, axial = 100.0, shear_2 = 60.0, shear_3 = 80.0 }
            load.gravity = [0.1, 0.0, -1.0]
            dynamics = { density = 1.0, rotary_inertia = 0.01 }
        "#;
        let settings = Options {
            modes: 6,
            ..iterated(1e-12, 16)
        };
        let modes = settled(&parse(text), &settings).stability.modes.unwrap();
        modes.iter().map(|mode| mode.eigenvalue).collect::<Vec<_>>()
    };
    let mut apart = [spring, clamp].concat();
    apart.sort_by(f64::total_cmp);
    for (a, b) in together.iter().zip(&apart) {
        assert!((a / b - 1.0).abs() < 1e-8, "{together:?} {apart:?}");
    }
}

/// Beside clamps, what a hinge lets turn without resistance is told as on hinges alone: as many eigenvalues of the dense
/// matrix, without a phase condition, are zero and negative as are told.
#[test]
fn counts_of_veins_held_in_several_ways_are_those_of_the_dense_matrix() {
    const VEINS: &str = r#"
        name = "veins"
        leaf = { rods = 2, length = [1.0, 0.8], fan = [0.3, -0.4] }
        stiffness = { torsion = 0.8, bending_2 = 1.0, bending_3 = 1.0, axial = 200.0, shear_2 = 100.0, shear_3 = 100.0 }
        load = { gravity = [0.0, 0.0, -1.0] }
        dynamics = { density = 1.0, rotary_inertia = 0.01 }
    "#;
    let clamp = "leaf.base_held=['clamped', 'pinned']";
    let spring = "leaf.base_held=['elastic', 'pinned']; leaf.base_turn_stiffness=2.0";
    let held = "leaf.base_held=pinned; leaf.base_spin=held";
    let beside = "leaf.base_held=['clamped', 'pinned']; leaf.base_spin=held";
    let apart = "leaf.joined=false";
    let in_line = "leaf.fan=[0.0, 0.0]; leaf.base=[[0.0, 0.0, 0.0], [0.2, 0.0, 0.0]]; \
                   load.gravity=[0, 0, 0]; load.tip_force=[-14.0, 0.0, 0.0]";
    let mut seen = Vec::new();
    for (held, entries) in [
        (clamp, ""),
        (spring, ""),
        (clamp, "stiffness.bending_3=2.0"),
        (clamp, "stiffness.bending_3=2.0; rest.bend_3=0.5"),
        (clamp, apart),
        (clamp, in_line),
        (spring, in_line),
        (held, ""),
        (held, "coupling.x=2; coupling.y=2; coupling.z=3"),
        (held, "stiffness.bending_3=2.0"),
        (held, apart),
        (beside, ""),
        (beside, apart),
        (beside, in_line),
    ] {
        let leaf = base(VEINS, &format!("{held}; {entries}"));
        let scenario = leaf.scenario();
        let found = settled(scenario, &iterated(1e-12, 16));
        let own = Leaf::new(scenario);
        let grid = discrete(&own, 16);
        let linear = Linear::new(&grid, &Physics::new(&own), &state_of(scenario, &found));
        let values = SymmetricEigen::new(linear.scaled()).eigenvalues;
        let count = |of: &dyn Fn(f64) -> bool| values.iter().filter(|it| of(**it)).count();
        let zero = count(&|value| value.abs() < 1e-5);
        let what = format!("{held} {entries}: {values}");
        assert_eq!(zero, found.stability.neutral_directions, "{what}");
        let negative = count(&|value| value <= -1e-5);
        assert_eq!(
            found.stability.negative_eigenvalues,
            Some(negative),
            "{what}"
        );
        seen.push(zero);
    }
    assert_eq!(seen[..4], [1, 1, 0, 0], "{seen:?}");
    assert!(seen.contains(&2), "{seen:?}");
}
