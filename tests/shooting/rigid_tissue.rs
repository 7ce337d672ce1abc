//! Tissue that is rigid along or normal to the veins, and tissue that contracts, by shooting: closed forms,
//! the limit of stiff tissue, and starts whose forces are those of a leaf at rest.

use glam::{DQuat, DVec3};
use leafdyn::internals::shooting::{
    self, RequiredPrecision::LocalError, ShootingFailureReason, ShootingOptions, ShootingSolution,
    ShootingStart,
};
use leafdyn::relax::RodShape;
use leafdyn::scenario::{Profile, Scenario};
use leafdyn::shape::NodeState;
use leafdyn_testing::*;

const STATIONS: [f64; 9] = [0.0, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875, 1.0];

/// Two parallel cantilevers 0.1 apart in their plane, with loads.
fn two_veins(stiffness: &str, tissue: &str, loads: &str) -> Scenario {
    parse(&format!(
        r#"
        name = "two veins"
        leaf = {{ rods = 2, length = 1.0, fan = [0.0, 0.0], joined = false, base = [[0.0, -0.05, 0.0], [0.0, 0.05, 0.0]] }}
        stiffness = {{ {stiffness} }}
        tissue = {{ {tissue} }}
        {loads}
        "#
    ))
}

/// The solution near another, of another leaf.
#[track_caller]
fn shot_from(scenario: &Scenario, start: &[RodShape], stations: &[f64]) -> ShootingSolution {
    let start = ShootingStart::Leaf {
        stations,
        rods: start,
    };
    let options = ShootingOptions {
        gives_up: true,
        ..ShootingOptions::new(start, stations, LocalError(SHARP))
    };
    found(scenario, shooting::solve(scenario, &options, &mut |_| {}))
}

/// The solution without any start.
#[track_caller]
fn solution_of(scenario: &Scenario) -> ShootingSolution {
    found(scenario, shoot_alone(scenario, &STATIONS))
}

/// Largest distance of the positions of two leaves.
fn distance(a: &ShootingSolution, b: &ShootingSolution) -> f64 {
    let pairs = a.rods.iter().zip(&b.rods);
    let nodes = pairs.flat_map(|(a, b)| a.nodes.iter().zip(&b.nodes));
    largest(nodes.map(|(a, b)| (a.position - b.position).length()))
}

#[track_caller]
fn is_near(what: &str, found: f64, wanted: f64, relative: f64) {
    let error = (found / wanted - 1.0).abs();
    assert!(
        error <= relative,
        "{what}: {found:e}, {wanted:e}, {error:.1e}"
    );
}

const LAYERS: &str =
    "torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = 500.0, shear_2 = inf, shear_3 = inf";

/// Newmark's beam of two layers (Newmark, Siess and Viest 1951; Girhammar and Gopu 1993), which
/// bends as one where no slip is possible: EI0 + EA r^2/2.
#[test]
fn two_layers_without_slip_bend_as_one() {
    let load = 1e-5;
    let loads = format!("load = {{ tip_force = [0.0, {}, 0.0] }}", 0.5 * load);
    let tip = |along: &str| {
        let tissue = format!("along = {along}, across = 1e5");
        let shot = solution_of(&two_veins(LAYERS, &tissue, &loads));
        tip_node(&shot.rods, 0).position.y + 0.05
    };
    let without_slip = tip("inf");
    is_near("rigid", without_slip, load / (3.0 * 4.5), 1e-6);
    for slip in [1e3, 1e4] {
        let a = (slip * (2.0 / 500.0 + 0.01_f64 / 2.0)).sqrt();
        let more = slip * 0.01 / (2.0 * a * a) * (1.0 / (a * a) - a.tanh() / (a * a * a));
        // In closed form the load alone bends both.
        let wanted = load / 2.0 * more;
        is_near("slip", tip(&slip.to_string()) - without_slip, wanted, 1e-4);
    }
}

/// Hetenyi's pair: half the force bends either vein, wherever it pulls.
#[test]
fn a_pair_without_rise_shares_its_load() {
    let load = 1e-5;
    let stiffness = "torsion = 50.0, bending_2 = 1.0, bending_3 = 10.0, axial = 1e4, shear_2 = inf, shear_3 = inf";
    let loads = format!("[[load.point]]\nvein = 1\nat = 1.0\nforce = [0.0, 0.0, {load}]");
    let shot = solution_of(&two_veins(stiffness, "normal = inf", &loads));
    let deflections = [0, 1].map(|j| tip_node(&shot.rods, j).position.z);
    is_near(
        "mean",
        0.5 * (deflections[0] + deflections[1]),
        load / 6.0,
        1e-8,
    );
    // The pair twists about its middle by the moment, each vein with its torsion and with its bending,
    // which acts on theta w/2: theta' = (w/2) P/(2 A1) (1 - cosh a (L - s)/cosh a L), a^2 = 4 A1/(A2 w^2).
    let a = (4.0 * 50.0 / 0.01_f64).sqrt();
    let twist = 0.05 * load / 100.0 * (1.0 - a.tanh() / a);
    is_near(
        "difference",
        deflections[0] - deflections[1],
        0.1 * twist,
        1e-5,
    );
    // The tissue passes half of the force at the tip, at one point.
    for rod in &shot.rods {
        let tip = rod.nodes[STATIONS.len() - 1];
        is_near("force", (tip.rotation * tip.n).z, load / 2.0, 1e-4);
    }
}

const LEAF: &str = r#"
    name = "three veins"
    leaf = { rods = 3, length = [1.0, 1.1, 0.9], fan = [0.15, 0.0, -0.1], joined = false, base = [[0.0, 0.1, 0.0], [0.0, 0.0, 0.0], [0.0, -0.12, 0.01]] }
    stiffness = { torsion = 0.5, bending_2 = { at = [0.0, 1.0], value = [1.0, 0.5] }, bending_3 = 3.0, axial = 300.0, shear_2 = 200.0, shear_3 = 200.0 }
    tissue = { along = RIGID, across = 50.0, normal = RIGID, fold = 0.3, contraction = 0.03 }
    [load]
    gravity = [0.0, 0.3, -1.5]
    [[load.point]]
    vein = 3
    at = 0.6
    force = [0.1, 0.2, -0.6]
    [[load.point]]
    vein = 1
    at = 1.0
    force = [0.0, 0.1, 0.3]
"#;

/// R^T (r_b - r_a), R being the mean rotation.
fn strain(positions: [DVec3; 2], rotations: [DQuat; 2]) -> DVec3 {
    let [p, mut q] = rotations;
    if p.dot(q) < 0.0 {
        q = -q;
    }
    (p + q).normalize().conjugate() * (positions[1] - positions[0])
}

/// What is rigid keeps its natural value all along to rounding, under large loads in space, and stiff tissue
/// tends to it.
#[test]
fn rigid_strains_vanish_and_are_the_limit_of_stiff_ones() {
    let scenario = |rigid: &str| parse(&LEAF.replace("RIGID", rigid));
    let rigid = scenario("inf");
    let shot = solution_of(&rigid);
    assert!(tip_node(&shot.rods, 1).position.z < -0.1, "it bends");
    for (i, sigma) in STATIONS.into_iter().enumerate() {
        for g in 0..2 {
            let natural = [g, g + 1].map(|j| {
                let rod = &rigid.rods[j];
                let turn = rod.base_rotation();
                let end = rod.base_position() + turn * DVec3::X * (rod.length * sigma);
                (end, turn)
            });
            let nodes = [g, g + 1].map(|j| shot.rods[j].nodes[i]);
            let now = strain(
                nodes.map(|node| node.position),
                nodes.map(|node| node.rotation),
            );
            let off = now - strain(natural.map(|it| it.0), natural.map(|it| it.1));
            assert!(
                off.x.abs() < 1e-10 && off.z.abs() < 1e-10,
                "{sigma}, {g}: {off}"
            );
        }
    }
    let stiff = ["1e4", "4e4"].map(|k| distance(&shot, &solution_of(&scenario(k))));
    let ratio = stiff[0] / stiff[1];
    // Layers at tips and loads on points decay like k^(-3/4), all else like 1/k.
    assert!(
        (2.6..4.2).contains(&ratio) && stiff[1] < 2e-3,
        "{stiff:?}: {ratio}"
    );
}

/// Forces and moments of a leaf at rest do not tell what the tissue has carried from the tip up to there: a
/// start with them alone leads to the same solution at once.
#[test]
fn forces_at_rest_are_a_start() {
    let scenario = parse(&LEAF.replace("RIGID", "inf"));
    let first = solution_of(&scenario);
    let again = shot_from(&scenario, &first.rods, &STATIONS);
    assert!(distance(&first, &again) < 1e-11);
    let resultants = first.rods.iter().zip(&again.rods);
    for (a, b) in resultants.flat_map(|(a, b)| a.nodes.iter().zip(&b.nodes)) {
        assert!((a.n - b.n).length() < 1e-8 && (a.m - b.m).length() < 1e-8);
    }
    assert!((first.energy / again.energy - 1.0).abs() < 1e-9);
    assert!(again.work.linearizations <= 2, "{:?}", again.work);
}

/// Joint veins, which meet in the natural leaf as well, free and clamped.
#[test]
fn joint_tips_of_rigid_tissue() {
    let text = r#"
        name = "lens"
        leaf = { rods = 3, length = [1.0, 0.985067355537799, 1.0], fan = [0.3, 0.0, -0.3] }
        stiffness = { torsion = 0.5, bending_2 = 1.0, bending_3 = 2.0, axial = 300.0, shear_2 = 200.0, shear_3 = 200.0 }
        rest = { bend_3 = [-0.6, 0.0, 0.6] }
        tissue = { along = RIGID, across = 30.0, normal = RIGID, fold = 0.2, contraction = 0.02 }
        load = { gravity = [0.0, 0.4, -1.0] }
    "#;
    for tip in [
        "",
        "tip = { held = \"clamped\", position = [0.9, 0.1, -0.2], angles = [-0.3, 0.0, 0.3] }",
    ] {
        let scenario = |rigid: &str| parse(&(text.replace("RIGID", rigid) + tip));
        let stiff = [2e4, 8e4, 3.2e5].map(|k: f64| {
            let scenario = scenario(&k.to_string());
            let mut plain = scenario.clone();
            for gap in plain.tissue.iter_mut().flatten() {
                gap.contraction = Profile::Constant(0.0);
            }
            let rest = settle(&plain, 1e-5);
            shot_from(&scenario, &rest.shape.rods, &rest.shape.stations)
        });
        let rigid = shot_from(&scenario("inf"), &stiff[0].rods, &stiff[0].stations);
        // What the tips determine twice is not taken for a bifurcation.
        assert!(
            rigid.condition > 1e-7 && rigid.neutral.is_none(),
            "{tip}: {:e}",
            rigid.condition
        );
        let middle = |leaf: &ShootingSolution| {
            let middle = leaf
                .stations
                .iter()
                .position(|at| *at == 0.5)
                .expect("a station");
            let rods = leaf.rods.iter();
            rods.map(|rod| rod.nodes[middle].position)
                .collect::<Vec<_>>()
        };
        let off = stiff.each_ref().map(|leaf| {
            let pairs = middle(leaf).into_iter().zip(middle(&rigid));
            largest(pairs.map(|(a, b)| a.distance(b)))
        });
        // Where a gap closes its layer decays like k^(-1/2).
        let ratios = [off[0] / off[1], off[1] / off[2]];
        let decays = ratios.iter().all(|ratio| (1.8..4.5).contains(ratio));
        assert!(decays && off[2] < 1e-4, "{tip}: {off:?}, {ratios:?}");
    }
}

/// Two strips of a plate bent along by a force P in all: with the fold held by stiff torsion as a wide
/// plate, EI + c1 c^2/2 each; free to fold as beams, beyond the layer at the clamp. With the bend k = (M +
/// c c1 theta)/B, B = 2 EI + c^2 c1, of M = P (L - s), the fold satisfies theta'' = a^2 (theta - c M/(2
/// EI)), theta(0) = theta'(L) = 0, a^2 = 4 EI c1/(A1 B).
#[test]
fn contraction_makes_strips_bend_as_plates_do() {
    let force = 1e-6;
    let loads = format!("load = {{ tip_force = [0.0, 0.0, {}] }}", 0.5 * force);
    let (bending, fold, contraction) = (1.0_f64, 40.0, 0.2_f64);
    let deflection = |torsion: f64| {
        let stiffness = format!(
            "torsion = {torsion}, bending_2 = {bending}, bending_3 = 10.0, axial = 500.0, shear_2 = inf, shear_3 = inf"
        );
        let tissue = format!(
            "along = 10.0, across = 50.0, normal = 20.0, fold = {fold}, contraction = {contraction}"
        );
        let shot = solution_of(&two_veins(&stiffness, &tissue, &loads));
        // The moment of a vein does the work on its bend, whatever the tissue carries of it.
        let base = shot.rods[0].nodes[0];
        is_near("moment", base.m.y.abs(), 0.5 * force, 1e-6);
        tip_node(&shot.rods, 0).position.z
    };
    let both = 2.0 * bending + fold * contraction * contraction;
    let wanted = |torsion: f64| {
        let a = (4.0 * bending * fold / (torsion * both)).sqrt();
        let layer = (1.0 - 2.0 / a.cosh() + a.tanh() * (1.0 / a - a)) / (a * a);
        let freed = fold * contraction * contraction / (2.0 * bending);
        force / both * (1.0 / 3.0 + freed * (1.0 / 3.0 + layer))
    };
    for torsion in [0.05, 1.0, 1e3] {
        is_near(
            &format!("torsion {torsion}"),
            deflection(torsion),
            wanted(torsion),
            1e-5,
        );
    }
    // Held, and freed.
    is_near("plate", wanted(1e6), force / both / 3.0, 1e-4);
    is_near("beams", wanted(1e-3), force / (2.0 * bending) / 3.0, 1e-2);
}

/// Pulled, two strips come closer by Poisson's ratio; the force on a vein remains what pulls it.
#[test]
fn contraction_narrows_strips_that_are_pulled() {
    let (pull, contraction) = (1e-3, 0.03);
    let stiffness = "torsion = 1.0, bending_2 = 1.0, bending_3 = 1e-3, axial = 100.0, shear_2 = inf, shear_3 = inf";
    let tissue = format!("across = 5000.0, normal = 10.0, contraction = {contraction}");
    let loads = format!("load = {{ tip_force = [{pull}, 0.0, 0.0] }}");
    let shot = solution_of(&two_veins(stiffness, &tissue, &loads));
    let middle = [0, 1].map(|j| shot.rods[j].nodes[4]);
    let strain = pull / 100.0;
    for node in middle {
        is_near("stretch", node.v.x - 1.0, strain, 1e-4);
        is_near("force", node.n.x, pull, 1e-6);
    }
    let width = middle[1].position.y - middle[0].position.y;
    is_near("width", width - 0.1, -contraction * strain, 1e-4);
}

/// The natural leaf, curved, twisted and grown, is without energy, and at rest.
#[test]
fn the_natural_leaf_is_at_rest() {
    let scenario = parse(
        r#"
        name = "natural"
        leaf = { rods = 3, length = [1.0, 1.2, 0.9], fan = [0.3, 0.0, -0.2], joined = false, base = [[0.0, 0.1, 0.0], [0.0, 0.0, 0.0], [0.0, -0.12, 0.01]] }
        stiffness = { torsion = 0.5, bending_2 = 1.0, bending_3 = 3.0, axial = 300.0, shear_2 = 200.0, shear_3 = 200.0 }
        rest = { twist = [0.3, -0.2, 0.1], bend_2 = { at = [0.0, 1.0], value = [0.5, 1.5] }, bend_3 = [-0.4, 0.1, 0.3], stretch = [1.1, 1.0, 1.2] }
        tissue = { along = inf, across = 30.0, normal = inf, fold = 0.2, contraction = [0.05, 0.02] }
        "#,
    );
    let shot = solution_of(&scenario);
    assert!(shot.energy.abs() < 1e-18, "{:e}", shot.energy);
    for node in shot.rods.iter().flat_map(|rod| &rod.nodes) {
        assert!(
            node.n.length() < 1e-9 && node.m.length() < 1e-9,
            "{} {}",
            node.n,
            node.m
        );
    }
}

/// What shooting leaves out is refused, with the key.
#[test]
fn what_is_left_out_is_named() {
    let base = r#"
        name = "refused"
        leaf = { rods = 2, length = [1.0, 1.1], fan = [0.1, -0.1], joined = false, base = [[0.0, WIDTH, 0.0], [0.0, -WIDTH, 0.0]], base_held = "HELD" }
        stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = AXIAL, shear_2 = inf, shear_3 = 100.0 }
        tissue = { along = inf, across = 1.0, normal = inf }
    "#;
    for (width, held, axial, key) in [
        ("0.1", "pinned", "100.0", "leaf.base_held"),
        ("0.0", "clamped", "inf", "stiffness.axial"),
    ] {
        let text = base.replace("WIDTH", width);
        let scenario = parse(&text.replace("HELD", held).replace("AXIAL", axial));
        let failure = shoot_alone(&scenario, &STATIONS).expect_err(key);
        let ShootingFailureReason::Unmodelled(missing) = failure.reason else {
            panic!("{key}: {}", failure.reason);
        };
        assert!(missing.to_string().contains(key), "{key}: {missing}");
    }
}

/// Three strips of a plate with rigid tissue bend as its beam E W t^3/12, bend in its plane as
/// Timoshenko's, and twist with G W t^3/3; at the clamp alone it is stiffer.
#[test]
fn three_strips_are_a_plate() {
    let (young, nu, length, width, t) = (1e4, 0.3, 1.0_f64, 0.1_f64, 0.01_f64);
    let shear = young / (2.0 * (1.0 + nu));
    let (h, d) = (width / 3.0, 1.0 - nu * nu);
    // The part of shear stiffness at which three strips shear as the whole section.
    let f = 1.0 - 5.0 / 54.0 + 2.0 / 243.0;
    let plate = |forces: [[f64; 3]; 3]| {
        let points = forces.iter().enumerate().map(|(j, force)| {
            format!(
                "[[load.point]]\nvein = {}\nat = 1.0\nforce = {force:?}\n",
                j + 1
            )
        });
        let scenario = parse(&format!(
            r#"
            name = "plate"
            leaf = {{ rods = 3, length = {length}, fan = [0.0, 0.0, 0.0], joined = false, base = [[0.0, {}, 0.0], [0.0, 0.0, 0.0], [0.0, {h}, 0.0]] }}
            stiffness = {{ torsion = {}, bending_2 = {}, bending_3 = {}, axial = {}, shear_2 = {}, shear_3 = {} }}
            tissue = {{ along = inf, across = {}, normal = inf, fold = {}, contraction = {} }}
            {}
            "#,
            -h,
            shear * h * t.powi(3) / 3.0,
            young * h * t.powi(3) / 12.0,
            young * t * h.powi(3) / 12.0,
            young * h * t,
            f * shear * h * t,
            shear * h * t * 5.0 / 6.0,
            young * t / h / d,
            young * t.powi(3) / (12.0 * h) / d,
            nu * h,
            points.collect::<String>(),
        ));
        // From the flat leaf, on which the loads are small.
        let flat: Vec<RodShape> = (scenario.rods.iter())
            .map(|rod| RodShape {
                length: rod.length,
                nodes: (STATIONS.iter())
                    .map(|sigma| NodeState {
                        position: rod.base_position() + DVec3::X * *sigma,
                        rotation: DQuat::IDENTITY,
                        v: DVec3::X,
                        u: DVec3::ZERO,
                        n: DVec3::ZERO,
                        m: DVec3::ZERO,
                    })
                    .collect(),
            })
            .collect();
        let (stations, rods) = (&STATIONS[..], &flat[..]);
        let start = ShootingStart::Leaf { stations, rods };
        let options = ShootingOptions::new(start, stations, LocalError(1e-9));
        found(&scenario, shooting::solve(&scenario, &options, &mut |_| {}))
    };
    let load = 1e-6;
    let tip = |shot: &ShootingSolution, j: usize| tip_node(&shot.rods, j);
    let up = plate([[0.0, 0.0, load / 3.0]; 3]);
    let beam = load * length.powi(3) / (3.0 * young * width * t.powi(3) / 12.0);
    let aside = plate([[0.0, load / 3.0, 0.0]; 3]);
    let timoshenko = load * length.powi(3) / (3.0 * young * t * width.powi(3) / 12.0)
        + load * length / (5.0 / 6.0 * shear * width * t);
    let torque = 2.0 * h * load;
    let twisted = plate([[0.0, 0.0, -load], [0.0; 3], [0.0, 0.0, load]]);
    let angle = torque * length / (shear * width * t.powi(3) / 3.0);
    is_near("bending", tip(&up, 1).position.z, beam, 1e-2);
    is_near("in the plane", tip(&aside, 1).position.y, timoshenko, 1e-3);
    is_near("twist", 2.0 * tip(&twisted, 1).rotation.x, angle, 3e-2);
}
