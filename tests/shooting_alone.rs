//! Without a relaxed leaf to start from, shooting reaches every scene with few
//! veins, and the digits of every problem whose answer is known.

mod common;

use std::f64::consts::PI;

use common::{
    TIGHT, agree, apart, close, files, in_lab, parse, path, scenario, set_stiffness, set_vector,
    settle, shoot_alone,
};
use glam::DVec3;
use leafdyn::bvp::Solution;
use leafdyn::leaf::{DiscreteLeaf, Grid, Leaf, State};
use leafdyn::relax::{NodeState, RodShape};
use leafdyn::scenario::Scenario;

const STATIONS: [f64; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];

#[track_caller]
fn solution(what: &str, scenario: &Scenario, stations: &[f64]) -> Solution {
    let solution = shoot_alone(scenario, stations).unwrap_or_else(|failure| {
        panic!("{what}: {} at {}", failure.reason, failure.part);
    });
    assert!(solution.defect < 1e-11, "{what}: {:.1e}", solution.defect);
    solution
}

/// Scenes with one equilibrium, or with one that continuation from the arcs
/// leads to: the relaxed one.
#[test]
fn it_finds_the_relaxed_leaf() {
    for figure in ["fig04", "fig05", "fig06", "fig13"] {
        for rods in [1, 2, 3, 5] {
            let leaf = scenario(&format!("paper/{figure}"), &[format!("leaf.rods={rods}")]);
            let relaxed = settle(&leaf, TIGHT);
            let what = format!("{figure}, {rods} veins");
            let alone = solution(&what, &leaf, &relaxed.shape.stations);
            agree(&what, &leaf, &relaxed, &alone, 1e-9);
        }
    }
    for file in files("classic") {
        if file == path("classic/elastica_buckled") {
            continue;
        }
        let leaf = Scenario::read(&file, &[]).unwrap();
        let relaxed = settle(&leaf, TIGHT);
        let alone = solution(&leaf.name, &leaf, &relaxed.shape.stations);
        agree(&leaf.name, &leaf, &relaxed, &alone, 1e-9);
    }
}

/// What a shape, given at some multiple of `2 * segments` equal steps, leaves
/// unbalanced at the nodes of the discrete leaf.
fn unbalanced(scenario: &Scenario, rods: &[RodShape], segments: usize) -> f64 {
    let leaf = Leaf::new(scenario);
    let stride = (rods[0].nodes.len() - 1) / segments;
    let nodes = || rods.iter().flat_map(|rod| rod.nodes.iter().step_by(stride));
    let mut state = State::new(
        segments,
        nodes()
            .map(|node| node.position / leaf.scale.length)
            .collect(),
        nodes().map(|node| node.rotation).collect(),
    );
    let middles = |rod: &RodShape| -> Vec<DVec3> {
        let nodes = rod.nodes[stride / 2..].iter().step_by(stride);
        nodes
            .map(|node| in_lab(node).0 / leaf.scale.force())
            .collect()
    };
    state.n = rods.iter().flat_map(middles).collect();
    DiscreteLeaf::new(&leaf, Grid::new(segments, &[])).residual(&state)
}

/// The soft leaves have several equilibria. What shooting finds is one: on
/// finer grids it satisfies the equations of the discrete leaf ever better, by
/// two orders in ds. A shape that is not its own leaves the load of a segment
/// unbalanced: one order.
#[test]
fn of_soft_leaves_it_finds_an_equilibrium() {
    let stations = Grid::new(1024, &[]);
    for figure in ["fig08", "fig09", "fig10"] {
        for rods in [1, 2, 3, 5] {
            let leaf = scenario(&format!("paper/{figure}"), &[format!("leaf.rods={rods}")]);
            let what = format!("{figure}, {rods} veins");
            let shape = solution(&what, &leaf, stations.sigma()).rods;
            let on_grids =
                |leaf: &Scenario| [256, 512].map(|segments| unbalanced(leaf, &shape, segments));
            let [coarse, fine] = on_grids(&leaf);
            assert!(fine < 1e-3, "{what}: {fine:.1e}");
            assert!(coarse / fine > 3.5, "{what}: {coarse:.1e}, {fine:.1e}");
            let mut heavier = leaf.clone();
            heavier.gravity[2] *= 10.0;
            let [coarse, fine] = on_grids(&heavier);
            assert!(coarse / fine < 3.0, "{what}: {coarse:.1e}, {fine:.1e}");
        }
    }
}

/// From arcs a straight column stays straight, which is an equilibrium too.
#[test]
fn a_column_beyond_its_buckling_load_stays_straight() {
    let column = scenario("classic/elastica_buckled", &[]);
    let alone = solution("column", &column, &STATIONS);
    for (node, sigma) in alone.rods[0].nodes.iter().zip(STATIONS) {
        assert!((node.position - DVec3::new(sigma, 0.0, 0.0)).length() < 1e-14);
    }
    assert!(alone.neutral.is_none());
}

fn solved(name: &str, overrides: &[String]) -> Solution {
    let what = format!("{name} {overrides:?}");
    solution(&what, &scenario(name, overrides), &STATIONS)
}

fn tip(solution: &Solution, rod: usize) -> NodeState {
    *solution.rods[rod].nodes.last().unwrap()
}

#[track_caller]
fn tip_is(solution: &Solution, wanted: [f64; 3], tolerance: f64) {
    let error = tip(solution, 0).position - DVec3::from_array(wanted);
    let error = error.abs().max_element();
    assert!(error <= tolerance, "off by {error:.1e} from {wanted:?}");
}

/// As in `tests/fan.rs`: collocation on the boundary-value problem.
#[test]
fn fans() {
    let uncoupled = ["x", "y", "z"].map(|axis| format!("coupling.{axis}=0"));
    for (name, overrides, x, z) in [
        ("fan_2", vec![], 0.910506987231897, -0.405683573211535),
        ("fan_3", vec![], 0.934244176818460, -0.332744460157685),
        (
            "fan_5",
            uncoupled.to_vec(),
            0.944393353500033,
            -0.307902124648867,
        ),
        ("fan_5", vec![], 0.944560025935573, -0.307809400980400),
        (
            "fan_5",
            set_stiffness(2.5e5, 1e5).to_vec(),
            0.944419286318834,
            -0.306536598218815,
        ),
    ] {
        let leaf = solved(&format!("classic/{name}"), &overrides);
        tip_is(&leaf, [x, 0.0, z], TIGHT);
    }
    let leaf = solved("classic/fan_5", &[]);
    let (n, m) = in_lab(&leaf.rods[0].nodes[0]);
    let force = DVec3::new(-0.346390655515, 0.071950238440, -2.023136799373);
    let moment = DVec3::new(0.420128081676, 0.906963028790, -0.070957964861);
    assert!((n - force).length() < 2e-11, "{}", n - force);
    assert!((m - moment).length() < 2e-11, "{}", m - moment);
    let sum: f64 = leaf.rods.iter().map(|rod| in_lab(&rod.nodes[0]).0.z).sum();
    close("sum of n_z", -sum, 11.025588509411, 1e-11);
}

/// As in `tests/lens.rs`: quadrature, and collocation on the boundary-value
/// problem. Tip; slope and force along e2 there, moment at the clamp.
#[test]
fn lenses() {
    for (name, x, slope, force, moment) in [
        (
            "lens_30",
            0.9729912300336,
            -0.2589824010247,
            -1.5973116944519,
            -1.5541702703319,
        ),
        (
            "lens_60",
            0.8966184928350,
            -0.5011600905202,
            -3.3497382489409,
            -3.0034372601570,
        ),
        (
            "lens_coupled",
            0.9061509842798,
            -0.4540275720102,
            -2.6055875304799,
            -3.2765365454579,
        ),
    ] {
        let leaf = solved(&format!("classic/{name}"), &[]);
        tip_is(&leaf, [x, 0.0, 0.0], TIGHT);
        for (rod, sign) in [(1, 1.0), (0, -1.0)] {
            let tangent = tip(&leaf, rod).rotation * DVec3::X;
            close(name, sign * tangent.y.atan2(tangent.x), slope, TIGHT);
            close(name, sign * in_lab(&tip(&leaf, rod)).0.y, force, 1e-10);
            let base = in_lab(&leaf.rods[rod].nodes[0]).1;
            close(name, sign * base.z, moment, 1e-10);
        }
    }
    for (force, x) in [(-2.0, 0.8908401673153), (10.0, 0.9174586260365)] {
        let entry = set_vector("load.tip_force", DVec3::new(force, 0.0, 0.0));
        let leaf = solved("classic/lens_60", &[entry]);
        tip_is(&leaf, [x, 0.0, 0.0], TIGHT);
        close("half", in_lab(&tip(&leaf, 0)).0.x, force / 2.0, 1e-10);
    }
}

/// As in `tests/bend45.rs`: collocation on the boundary-value problem. GJ,
/// shear factor, load, tip.
#[test]
fn the_45_degree_bend() {
    let (polar, torsion) = (1e7 / 12.0, 0.140577 * 1e7 / 2.0);
    let rigid = f64::INFINITY;
    for (torsion, shear, load, wanted) in [
        (
            polar,
            5.0 / 6.0,
            300.0,
            [58.77889733, 22.24467943, 40.19239233],
        ),
        (
            polar,
            5.0 / 6.0,
            600.0,
            [47.15009624, 15.68468948, 53.47547800],
        ),
        (polar, 1.0, 300.0, [58.77912249, 22.24478095, 40.19189167]),
        (polar, 1.0, 600.0, [47.15043857, 15.68480053, 53.47485879]),
        (
            torsion,
            5.0 / 6.0,
            300.0,
            [58.53570907, 22.11251371, 40.48075757],
        ),
        (
            torsion,
            5.0 / 6.0,
            450.0,
            [51.96942440, 18.36916294, 48.70534908],
        ),
        (
            torsion,
            5.0 / 6.0,
            600.0,
            [46.89158622, 15.55767615, 53.60798641],
        ),
        (polar, rigid, 300.0, [58.77968539, 22.24503474, 40.18828384]),
        (polar, rigid, 450.0, [52.23929842, 18.50846405, 48.49798262]),
        (polar, rigid, 600.0, [47.15129440, 15.68507816, 53.46859844]),
    ] {
        let axial = if shear == rigid { rigid } else { 1e7 };
        let mut overrides = set_stiffness(axial, shear * 1e7 / 2.0).to_vec();
        overrides.push(format!("stiffness.torsion={torsion:?}"));
        overrides.push(set_vector("load.tip_force", DVec3::new(0.0, 0.0, load)));
        // Given to eight decimals.
        tip_is(&solved("classic/bend45_300", &overrides), wanted, 6e-9);
    }
}

/// As in `tests/princeton.rs`: collocation on the boundary-value problem.
#[test]
fn the_princeton_beam() {
    for (load, cos, sin, displacement) in [
        (
            8.896,
            (PI / 6.0).cos(),
            0.5,
            [-0.007659232352, 0.010146995016, 0.079447830196],
        ),
        (8.896, 0.0, 1.0, [-0.026019304238, 0.0, 0.146246558816]),
        (
            13.345,
            (PI / 4.0).cos(),
            (PI / 4.0).sin(),
            [-0.030355556827, 0.015341799699, 0.156573901653],
        ),
        (13.345, 0.0, 1.0, [-0.050397327369, 0.0, 0.200677265105]),
    ] {
        let force = DVec3::new(0.0, load * cos, load * sin);
        let leaf = solved("classic/princeton", &[set_vector("load.tip_force", force)]);
        let [x, y, z] = displacement;
        tip_is(&leaf, [0.508 + x, y, z], 5e-12);
    }
}

/// As in `tests/helical_rollup.rs`: collocation on the boundary-value problem.
#[test]
fn one_coil_and_ten() {
    for (lambda, wanted) in [
        (0.1, [0.041020335261, 0.005377090312, -0.109172901932]),
        (1.0, [0.000480324966, 0.0000072496847, -0.007644174173]),
    ] {
        let leaf = solved(
            "classic/helical_rollup",
            &[
                set_vector("load.tip_moment", DVec3::new(0.0, 0.0, 200.0 * PI * lambda)),
                set_vector("load.tip_force", DVec3::new(0.0, 0.0, 50.0 * lambda)),
            ],
        );
        // The length is 10.
        tip_is(&leaf, wanted.map(|x| 10.0 * x), 1e-10);
    }
}

/// As in `tests/heavy_cantilever.rs`: collocation on the boundary-value problem.
#[test]
fn heavy_cantilevers() {
    for (gamma, x, y) in [
        (1.0, 0.9912463953466, -0.1234714019834),
        (5.0, 0.8466571799543, -0.4959050446224),
        (10.0, 0.6563537612386, -0.7001997155143),
        (20.0, 0.4452320522396, -0.8298814434393),
        (50.0, 0.2450147563206, -0.9079171234773),
        (100.0, 0.1592233826284, -0.9375239353963),
    ] {
        let weight = set_vector("load.gravity", DVec3::new(0.0, 0.0, -gamma));
        let leaf = solved("classic/cantilever_heavy", &[weight]);
        tip_is(&leaf, [x, 0.0, y], TIGHT);
    }
    let leaf = solved("classic/cantilever_heavy_cosserat", &[]);
    tip_is(&leaf, [0.4438083750994, 0.0, -0.8440537983558], TIGHT);
    let tangent = tip(&leaf, 0).rotation * DVec3::X;
    close("slope", tangent.z.atan2(tangent.x), -1.3353720770773, TIGHT);
}

/// As in `tests/elastica.rs`: elliptic integrals, Bisshopp and Drucker 1945;
/// with stretch and shear collocation on the boundary-value problem.
#[test]
fn the_elastica() {
    for (alpha, slope, x, y) in [
        (1.0, 0.46135194971188, 0.94356676371662, 0.30172077379981),
        (2.0, 0.78174983155654, 0.83935827917483, 0.49345748039671),
        (5.0, 1.2153681176117, 0.61237163927557, 0.71379152361191),
        (10.0, 1.4302855388039, 0.44500440224625, 0.81060902488030),
        (50.0, 1.5679819015714, 0.19999960395040, 0.91715544730359),
    ] {
        let load = set_vector("load.tip_force", DVec3::new(0.0, 0.0, -alpha));
        let leaf = solved("classic/cantilever_tip", &[load]);
        tip_is(&leaf, [x, 0.0, -y], TIGHT);
        let tangent = tip(&leaf, 0).rotation * DVec3::X;
        close("slope", (-tangent.z).atan2(tangent.x), slope, TIGHT);
        let moment = leaf.rods[0].nodes[0].m.length();
        close("moment", moment, alpha * x, alpha * TIGHT);
    }
    for (alpha, axial, shear, x, y) in [
        (4.0, 100.0, 40.0, 0.6585159805983, 0.7307575514909),
        (10.0, 100.0, 40.0, 0.4270824760091, 0.9424536888340),
        (10.0, 1000.0, 400.0, 0.4432531320994, 0.8236366963903),
    ] {
        let mut overrides = set_stiffness(axial, shear).to_vec();
        overrides.push(set_vector("load.tip_force", DVec3::new(0.0, 0.0, -alpha)));
        let leaf = solved("classic/cantilever_tip_cosserat", &overrides);
        tip_is(&leaf, [x, 0.0, -y], TIGHT);
    }
}

/// As in `tests/elastica.rs`: elliptic integrals. From the relaxed leaf, as
/// from arcs it stays straight.
#[test]
fn the_elastica_beyond_its_buckling_load() {
    for (ratio, x, y) in [
        (1.0153968655397, 0.96973090736352, 0.2194130423956),
        (1.1517196204691, 0.74101960607633, 0.59320764616489),
        (1.8848008689781, 0.12315997240512, 0.80317099000746),
        (4.0300859660499, -0.34031885569115, 0.62460351295334),
    ] {
        let force = DVec3::new(-ratio * PI * PI / 4.0, 0.0, 0.0);
        let column = scenario(
            "classic/elastica_buckled",
            &[set_vector("load.tip_force", force)],
        );
        let relaxed = settle(&column, 1e-4);
        let shot = common::shoot_near(&column, &relaxed).unwrap();
        let side = tip(&shot, 0).position.y.signum();
        // Close to the buckling load the errors of the integration are large too.
        let tolerance = TIGHT + 5.0 * shot.error.position;
        assert!(tolerance < 3e-10, "{tolerance:.1e}");
        tip_is(&shot, [x, side * y, 0.0], tolerance);
    }
}

/// As in `tests/rollup.rs`: closed form.
#[test]
fn roll_up() {
    for moment in [0.5, PI, -2.0, 2.0 * PI, 7.0 * PI] {
        let entry = set_vector("load.tip_moment", DVec3::new(0.0, 0.0, moment));
        let leaf = solved("classic/rollup", &[entry]);
        for (node, sigma) in leaf.rods[0].nodes.iter().zip(STATIONS) {
            let angle = moment * sigma;
            let arc = DVec3::new(angle.sin(), 1.0 - angle.cos(), 0.0) / moment;
            assert!((node.position - arc).length() < TIGHT, "{moment}, {sigma}");
            assert!((node.m - moment * DVec3::Z).length() < TIGHT);
        }
        close("energy", leaf.energy, 0.5 * moment * moment, 1e-10);
    }
}

/// As in `tests/helix.rs`: Love 1927, a wrench about the axis of a helix of
/// radius 0.2 at 30 degrees holds a straight rod, GJ = 0.8, in it.
#[test]
fn a_helix() {
    let (radius, sin, cos) = (0.2, 0.5, 0.75_f64.sqrt());
    let axis = DVec3::new(sin, 0.0, cos);
    let centre = DVec3::new(0.0, radius, 0.0);
    let at = |s: f64| {
        let angle = cos * s / radius;
        let around = DVec3::new(cos, 0.0, -sin);
        centre + radius * (angle.sin() * around - angle.cos() * DVec3::Y) + sin * s * axis
    };
    for (force, moment, length) in [
        (-1.875, 4.113620667976084, 1.0),
        (-9.375, 3.247595264191645, 0.6),
    ] {
        let force = force * axis;
        let moment = moment * axis + (centre - at(length)).cross(force);
        let rod = parse(&format!(
            "name = 'helix'\n\
             leaf = {{ rods = 1, length = {length:?}, fan = [0.0] }}\n\
             stiffness = {{ torsion = 0.8, bending_2 = 1.0, bending_3 = 1.0, axial = inf, shear_2 = inf, shear_3 = inf }}\n\
             {}\n{}\n",
            set_vector("load.tip_force", force),
            set_vector("load.tip_moment", moment),
        ));
        let helix = solution("helix", &rod, &STATIONS);
        for (node, sigma) in helix.rods[0].nodes.iter().zip(STATIONS) {
            let error = (node.position - at(sigma * length)).length();
            assert!(error < 2e-11, "{error:.1e} at {sigma}");
            assert!((in_lab(node).0 - force).length() < 1e-10);
        }
    }
}

/// As in `tests/lens.rs`: a midrib of its natural length carries nothing.
#[test]
fn a_midrib_of_its_natural_length() {
    for (axial, shear, length) in [(2500.0, 1000.0, 0.897148164116), (1e5, 4e4, 0.896631799808)] {
        let mut overrides = set_stiffness(axial, shear).to_vec();
        overrides.push(format!("leaf.length=[1.0, {length:?}, 1.0]"));
        let leaf = solved("classic/lens_midrib", &overrides);
        tip_is(&leaf, [length, 0.0, 0.0], TIGHT);
        let thrust = in_lab(&tip(&leaf, 1)).0.x;
        close("thrust", thrust, 0.0, 1e-12 * axial + 1e-10);
    }
}

/// The same at all numbers of intervals: those are the solver's own business.
#[test]
fn the_number_of_intervals_changes_nothing() {
    let leaf = scenario("paper/fig04", &["leaf.rods=5".into()]);
    let relaxed = settle(&leaf, 1e-6);
    let one = common::shoot_over(Some(1), &leaf, &relaxed).unwrap();
    for count in [2, 7, 50] {
        let several = common::shoot_over(Some(count), &leaf, &relaxed).unwrap();
        assert_eq!(several.intervals.len(), count + 1);
        let off = apart(&leaf, &one.rods, &several.rods);
        assert!(off.position < 1e-12 && off.force < 1e-11, "{off:?}");
    }
}
