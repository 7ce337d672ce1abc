//! Tips that are held: pinned or clamped at a given place, as by the jaws of a
//! testing machine.

use std::f64::consts::{PI, TAU};

use leafdyn::scenario::{Clamp, HeldTip};
use leafdyn::simulate::{Frame, Simulation};
use leafdyn_testing::branch::follow;
use leafdyn_testing::motion::{BOTH, moving};
use leafdyn_testing::random::{drawn, leaves};
use leafdyn_testing::*;

fn held_rod(how: &str, overrides: &str) -> Scenario {
    Scenario::from_toml_with(&held(how), "held", &entries(overrides)).unwrap()
}

/// How a column is held, and Euler's load of it.
const EULER: [(&str, f64); 2] = [
    ("clamped", 39.47841760435743),
    ("pinned", 20.19072855642663),
];

/// What the holder feels.
fn held_by(leaf: &Equilibrium) -> DVec3 {
    leaf.reaction.as_ref().unwrap().force
}

/// And of moments, of a clamp.
fn moment_held(leaf: &Equilibrium) -> DVec3 {
    leaf.reaction.as_ref().unwrap().moments.as_ref().unwrap()[0]
}

/// Just before it buckles, at the travel P/EA with P (1 - P/EA) = P_E, the holder bears the load.
#[test]
fn the_holder_of_a_column_bears_its_load() {
    for (how, load) in EULER {
        let load = 500.0 * (1.0 - (1.0_f64 - 4e-3 * load).sqrt());
        let place = 1.0 - load / 1e3 + 1e-9;
        let stiffness = set_stiffness(1e3, f64::INFINITY);
        let before = format!("{stiffness}; stiffness.bending_2=3.0; tip.position=[{place}, 0, 0]");
        let force = held_by(&settle(&held_rod(how, &before), TIGHT));
        assert!((force - DVec3::X * load).length() < 1e-5, "{force}");
    }
}

/// Frequencies beta^2 of beams that are clamped at the base, with the first roots
/// beta of cos b cosh b = 1 and of tan b = tanh b.
#[test]
fn held_beams_vibrate_at_their_frequencies() {
    for (how, beta) in [
        ("clamped", 4.730040744862704_f64),
        ("pinned", 3.926602312047919),
    ] {
        let stiffness = set_stiffness(1e7, f64::INFINITY);
        let mass = "dynamics.density=1; dynamics.rotary_inertia=1e-9";
        let flat = format!("{stiffness}; {mass}; stiffness.bending_3=2.0");
        let beam = held_rod(how, &flat);
        let mut options = with_modes(2, to(1e-9));
        options.mode_shapes = true;
        let modes = relaxed(&beam, &options).stability.modes.unwrap();
        let beta = beta * beta;
        for (mode, exact) in modes.iter().zip([beta, 2.0_f64.sqrt() * beta]) {
            close(how, mode.frequency().unwrap() / exact, 1.0, 1e-6);
        }
    }
}

/// A chain hangs in a catenary; a rod that hardly resists bending nearly does,
/// but for the layers at its ends, as thin as the root of its stiffness over the
/// tension: its lowest point is off in proportion to the stiffness.
#[test]
fn a_soft_cable_hangs_in_a_catenary() {
    // Of length L = 1.2 between points 1 apart: 2 a sinh(1/(2a)) = L, a (cosh(1/(2a)) - 1).
    let sag = 0.29234379760092905;
    let off = [4e-4, 1e-4, 2.5e-5].map(|stiffness: f64| {
        let soft = format!(
            "leaf.length=1.2; load.gravity=[0, 0, -1]; stiffness.torsion={stiffness}; \
             stiffness.bending_2={stiffness}; stiffness.bending_3={stiffness}; {}",
            set_stiffness(1e4, 1e4)
        );
        let leaf = settle(&held_rod("clamped", &soft), 1e-7);
        (largest(leaf.shape.curves[0].iter().map(|x| -x.z)) - sag).abs()
    });
    for pair in off.windows(2) {
        assert!(pair[1] < 0.62 * pair[0], "{off:?}");
    }
    assert!(off[2] < 0.01, "{off:?}");
}

/// A rod bent into a ring closes on itself: it carries the moment 2 pi, and the
/// energy 2 pi^2.
#[test]
fn a_ring_closes_on_itself() {
    let ring = format!("stiffness.torsion=2.0; tip.position=[0, 0, 0]; tip.angles={TAU}");
    let leaf = settle(&held_rod("clamped", &ring), 1e-9);
    close("energy", leaf.energy.unwrap(), 2.0 * PI * PI, 1e-7);
    let moment = moment_held(&leaf);
    // Being round, it may lie in any plane through its clamp: it is told as it leans down.
    assert!((moment + DVec3::Y * TAU).length() < 1e-6, "{moment}");
    assert!(held_by(&leaf).length() < 1e-6);
}

/// A rod that neither stretches nor shears, and bends easily in the plane alone.
fn strip(how: &str, overrides: &str) -> Scenario {
    let stiff = "stiffness.torsion=10.0; stiffness.bending_2=10.0";
    held_rod(how, &format!("{RIGID}; {stiff}; {overrides}"))
}

/// Between clamps such a rod is four times that of a quarter of its length with a free
/// end, as bent: P/P_cr and x/L of the elastica at end slopes of 20 and 60 degrees (closed
/// form, elliptic integrals). Pushed straight it has no way to go but sideways.
#[test]
fn a_rod_pushed_together_between_clamps_is_the_elastica() {
    for (load, place) in [
        (1.0153968655397, 0.96973090736352),
        (1.1517196204691, 0.74101960607633),
    ] {
        let pushed = strip("clamped", &format!("tip.position=[{place}, 0, 0]"));
        let (force, euler) = (held_by(&settle(&pushed, 1e-9)), 4.0 * PI * PI);
        close("force", force.x, load * euler, 1e-8 * euler);
        assert!(force.with_x(0.0).length() < 1e-7, "{force}");
    }
}

/// The grip of a testing machine travels, along and across, and turns: the branch is
/// followed in few steps, as the prediction takes the motion of the grip along, and its
/// points are those of relaxations there.
#[test]
fn the_travel_of_a_grip_is_followed() {
    let arch = "stiffness.bending_2=10.0; stiffness.torsion=10.0; stiffness.axial=1e4; \
         leaf.fan=[0.3]; tip.position=[0.9, 0, 0]; tip.angles=-0.3; load.gravity=[0, 1, 0]";
    for travel in [
        "tip.position[0]=0.9..0.3",
        "tip.position[1]=0..0.3",
        "tip.angles=-0.3..-1",
        "leaf.fan[0]=0.3..1",
    ] {
        let found = follow(&held("clamped"), arch, travel, false);
        assert_eq!(found.branches.len(), 1, "{travel}");
        let branch = &found.branches[0];
        assert!(found.complete, "{travel}: {:?}", branch.end);
        let followed = found.factorizations;
        assert!(followed < 100, "{travel}: {followed}");
        assert!(branch.points.len() > 5, "{travel}");
        let key = travel.split('=').next().unwrap();
        for point in &branch.points {
            let there = format!("{arch}; {key}={:?}", point.value);
            let leaf = settle(&held_rod("clamped", &there), 1e-11);
            let error = point.error.unwrap();
            assert!(error > 0.0 && error < 1e-8, "{error:e}");
            // If its middle is off by the error, forces of some hundred bear it.
            let off = (point.energy - leaf.energy.unwrap()).abs();
            assert!(off < 1e3 * error, "{travel}, {}: {off:e}", point.value);
            let off = point.reaction.unwrap().distance(held_by(&leaf));
            assert!(off < 1e3 * error, "{travel}, {}: {off:e}", point.value);
        }
    }
}

/// A rod between pins that meet leaves them at 130.7 degrees to the force that holds them
/// together, without a moment (closed form: 2 E = K, k^2 = 0.8261147659849703).
#[test]
fn pinned_ends_meet() {
    let angle = 130.7099107079_f64.to_radians();
    // To its left, to which a rod turns that may turn to either side, that force is along e1.
    let met = format!("leaf.fan=[{:?}]; tip.position=[0, 0, 0]", -angle);
    let leaf = settle(&strip("pinned", &met), 1e-9);
    let off = held_by(&leaf) - DVec3::X * 21.54908744351816;
    assert!(off.length() < 1e-7, "{off}");
    let base = leaf.shape.rods[0].nodes[0].m;
    assert!(base.length() < 1e-7, "{base}");
}

/// However little such a rod is shortened it buckles, and never rests straight, too long
/// for its place: its energy is what Euler's load does on the way there, and a little more
/// as the load rises.
#[test]
fn rods_that_do_not_stretch_keep_their_length() {
    for (how, euler) in EULER {
        let placed = |place: f64| strip(how, &format!("tip.position=[{place}, 0, 0]"));
        for short in [1e-6, 1e-4, 1e-2, 0.1] {
            let leaf = settle(&placed(1.0 - short), 1e-9);
            let ratio = leaf.energy.unwrap() / (euler * short);
            let rounded = 1e-6;
            assert!(ratio > 1.0 - rounded, "{how}, {short}: {ratio}");
            assert!(ratio < 1.0 + short + rounded, "{how}, {short}: {ratio}");
        }
        for place in [0.5, 0.3, 0.1, -0.3] {
            settle(&placed(place), 1e-6);
        }
    }
}

/// Random leaves whose joint tip is held somewhere around where it would rest.
fn held_leaves(count: usize) -> Vec<Scenario> {
    let mut drawn = drawn(leaves(), 2 * count);
    drawn.retain(|leaf| leaf.joined);
    drawn.truncate(count);
    for (case, leaf) in drawn.iter_mut().enumerate() {
        let golden = |k: usize| ((case * 7 + k) as f64 * 0.618_033_988_749_895).fract() - 0.5;
        let clamp = |j: usize| Clamp {
            angle: golden(j + 4),
            twist: 2.0 * golden(j + 9),
        };
        leaf.held_tip = Some(HeldTip {
            position: [0.7 + 0.2 * golden(1), 0.4 * golden(2), 0.4 * golden(3)],
            clamps: (case % 2 == 0).then(|| (0..leaf.rods.len()).map(clamp).collect()),
        });
    }
    drawn
}

#[test]
fn relaxation_and_shooting_find_the_same_held_leaf() {
    for (case, scenario) in held_leaves(30).iter().enumerate() {
        let what = format!("leaf {case}, {} veins", scenario.rods.len());
        let leaf = settle(scenario, TIGHT);
        let shot = shot_near(scenario, &leaf);
        agree(&what, scenario, &leaf, &shot, 1e-9);
        let held = scenario.held_tip.as_ref().unwrap();
        let position = DVec3::from_array(held.position);
        for (j, rod) in leaf.shape.rods.iter().enumerate() {
            let tip = rod.nodes.last().unwrap();
            assert!((tip.position - position).length() < 1e-14, "{what}");
            if let Some(clamps) = &held.clamps {
                assert!(tip.rotation.angle_between(clamps[j].rotation()) < 1e-7);
            }
        }
        // What the holder feels is what the rods bear, and the load on the tip.
        let tips = (0..shot.rods.len()).map(|rod| tip_node(&shot.rods, rod));
        let borne: DVec3 = tips.map(|tip| in_lab(&tip).0).sum();
        let off = held_by(&leaf) - (DVec3::from_array(scenario.tip_force) - borne);
        let unit = scale(scenario).force();
        assert!(off.length() / unit < 1e-6, "{what}: {off}");
    }
}

/// A held leaf comes to rest by its motion, explicit or not, where the relaxation
/// says; until it is pushed it rests there, and its tip never moves.
#[test]
fn held_leaves_move_between_their_holders() {
    for how in ["clamped", "pinned"] {
        let loads = "stiffness.bending_2=2.0; tip.position=[0.9, 0, 0.1]; load.gravity=[0, 0, -20]";
        let pushed = "dynamics.duration=12; dynamics.output_interval=0.5; \
             dynamics.gravity={at=[2.0, 2.5, 3.0], value=[[0, 0, -20], [0, 60, -20], [0, 0, -20]]}";
        let scenario = held_rod(how, &format!("{loads}; {pushed}"));
        let [explicit, semi_implicit] = BOTH.map(|scheme| {
            let mut simulation = Simulation::new(&scenario, &moving(scheme, None)).unwrap();
            let mut frames = vec![simulation.frame()];
            while !simulation.done() {
                frames.push(simulation.next_frame().unwrap());
            }
            frames
        });
        let apart = |a: &Frame, b: &Frame| {
            let pairs = a.positions.iter().zip(&b.positions);
            largest(pairs.map(|(a, b)| a.distance(*b)))
        };
        for frames in [&explicit, &semi_implicit] {
            for frame in frames {
                let tip = frame.positions.last().unwrap();
                assert!((*tip - DVec3::new(0.9, 0.0, 0.1)).length() < 1e-14);
            }
            assert!(apart(&frames[0], &frames[1]) < 1e-6);
            assert!(apart(&frames[0], &frames[5]) > 1e-2);
            assert!(apart(&frames[0], frames.last().unwrap()) < 1e-4);
        }
        for (a, b) in explicit.iter().zip(&semi_implicit) {
            assert!(apart(a, b) < 1e-3, "{how}, t = {}: {}", a.time, apart(a, b));
        }
        let [a, b] = [Method::Explicit { segments: None }, Method::default()]
            .map(|method| settled(&held_rod(how, loads), &by(method, to(1e-7))));
        close("energy", a.energy.unwrap(), b.energy.unwrap(), 1e-7);
    }
}

#[test]
fn what_cannot_be_held_is_refused() {
    let table = "
        tip.held='loose' => must be \"free\", \"pinned\"
        tip.held='free' => belongs to a tip that is held
        tip.held='pinned'; tip.twist=1.0 => belongs to a clamped tip
        leaf.rods=3; leaf.fan='paper'; leaf.joined=false => needs leaf.joined = true
        tip.position=[30, 0, 0] => more than 10 times
        stiffness.axial=inf; tip.position=[1.5, 0, 0] => inextensible
        load.tip_moment=[0, 0, 1] => needs a free tip
        tip.twist=1e4 => at most 100 turns
        dynamics.clamped=false => needs a base that is clamped
    ";
    for (entry, problem) in pairs(table) {
        let refused = Scenario::from_toml_with(&held("clamped"), "held", &entries(entry));
        let message = refused.unwrap_err().to_string();
        assert!(message.contains(problem), "{message}");
    }
    let alone = ROD.to_string() + "tip = { held = \"pinned\" }";
    let message = Scenario::from_toml(&alone).unwrap_err().to_string();
    assert!(message.contains("needs tip.position"), "{message}");
}
