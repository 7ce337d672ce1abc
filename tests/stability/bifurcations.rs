//! Where straight and plane leaves lose their stability: at the loads of Euler, Reissner,
//! Greenhill and of linearised boundary-value problems the number of negative eigenvalues
//! changes, and nowhere else; along the branch, and of leaves that are relaxed.

use leafdyn::study::trace;
use leafdyn_testing::branch::{changes_at, follow, request, text};
use leafdyn_testing::*;

/// A leaf, what varies and between which values, and where its index changes by how much.
struct Case {
    text: String,
    entries: String,
    vary: (&'static str, f64, f64),
    critical: Vec<(f64, i64)>,
    within: f64,
}

impl Case {
    /// The leaf at a value, which is so many times as far from the start as another one.
    fn at(&self, critical: f64, part: f64) -> Scenario {
        let (key, from, _) = self.vary;
        let value = from + part * (critical - from);
        let base = base(&self.text, &self.entries);
        base.scenario_with_values(&[(&key.parse().unwrap(), value)])
            .unwrap()
            .scenario
    }

    /// Along the branch.
    fn is_followed(&self) {
        let (key, from, to) = self.vary;
        let found = follow(
            &self.text,
            &self.entries,
            &format!("{key}={from}..{to}"),
            false,
        );
        changes_at(&self.entries, &found, &self.critical, self.within);
    }

    /// Leaves that are relaxed, and kept if they are unstable.
    fn is_relaxed(&self) {
        let mut index = 0;
        for &(critical, change) in &self.critical {
            for (part, change) in [(0.999, 0), (1.001, change)] {
                index += change;
                let leaf = settle_on(&self.at(critical, part), 512, true);
                let found = leaf.stability.negative_eigenvalues;
                let what = format!("{}: {part} of {critical}", self.entries);
                assert_eq!(found, Some(index as usize), "{what}");
            }
        }
    }

    /// Below the first value the leaf comes to rest as it was, beyond it elsewhere.
    fn is_left(&self) {
        let critical = self.critical[0].0;
        for part in [0.98, 0.995, 1.005, 1.05] {
            let scenario = self.at(critical, part);
            let (leaf, own) = (settle(&scenario, 1e-8), kept(&scenario, 1e-8));
            assert_eq!(leaf.stability.negative_eigenvalues, Some(0));
            let apart = apart(&scenario, &eighths(&leaf), &eighths(&own)).position;
            let what = format!("{}: {part} of {critical}, {apart:e}", self.entries);
            let aside = leaf
                .path
                .as_ref()
                .map_or(leaf.stability.saddle.is_some(), |path| {
                    !path.events().is_empty()
                });
            match part < 1.0 {
                true => assert!(apart < 1e-8 && !aside, "{what}"),
                false => assert!(apart > 1e-3 && aside, "{what}"),
            }
        }
    }
}

/// The rods at the ends of eight equal parts, whatever the grid.
fn eighths(leaf: &Equilibrium) -> Vec<RodShape> {
    let rod = |rod: &RodShape| {
        let stride = (rod.nodes.len() - 1) / 8;
        let nodes = rod.nodes.iter().step_by(stride).copied().collect();
        RodShape {
            nodes,
            ..rod.clone()
        }
    };
    leaf.shape.rods.iter().map(rod).collect()
}

/// A rod along e1 that bends sideways easily, loaded from zero on.
fn rod_of(entries: String, key: &'static str, critical: &[(f64, i64)], within: f64) -> Case {
    Case {
        text: ROD.into(),
        entries,
        vary: (key, 0.0, 1.15 * critical.last().unwrap().0),
        critical: critical.to_vec(),
        within,
    }
}

const PUSHED: &str = "load.tip_force[0]";

/// P_k = (2k - 1)^2 pi^2/4 EI/L^2 of the clamped-free column, round or a thousand times as
/// stiff one way. Equally stiff in stretch and shear it buckles there all the same.
fn euler(k: i32) -> f64 {
    f64::from(2 * k - 1).powi(2) * PI * PI / 4.0
}

fn columns() -> Vec<Case> {
    let mut cases = Vec::new();
    let rigid = f64::INFINITY;
    for (stiffness, loads, within) in [(1e3, 5, 1e-8), (1e6, 3, 1e-7), (rigid, 5, 1e-7)] {
        for (other, ways) in [(1.0, 2), (1000.0, 1)] {
            let stiff = set_stiffness(stiffness, stiffness);
            let critical: Vec<_> = (1..=loads).map(|k| (-euler(k), ways)).collect();
            let column = format!("{stiff}; stiffness.bending_2={other:?}");
            cases.push(rod_of(column, PUSHED, &critical, within));
        }
    }
    // P (1 + P/GA - P/EA) = pi^2/4 EI/L^2 of one that stretches and shears (Engesser and
    // Reissner): EA, GA, P.
    let reissner = "1000 400 2.458335976611486\n 100 40 2.382272748545408";
    for [axial, shear, load] in table(reissner) {
        let column = format!("{}; stiffness.bending_2=1000", set_stiffness(axial, shear));
        cases.push(rod_of(column, PUSHED, &[(-load, 1)], 1e-8));
    }
    // Under its own weight, q L^3/EI = 9/4 j^2 with the first zero j of the Bessel function
    // J_(-1/3), if it is inextensible (Greenhill 1881).
    let column = format!("{RIGID}; stiffness.bending_2=2");
    let weight = [(-7.837347438943484, 1)];
    cases.push(rod_of(column, "load.gravity[0]", &weight, 1e-8));
    cases
}

/// Torsional stiffness, strong bending stiffness of a strip that is loaded in its stiff plane;
/// load / sqrt(EI GJ) at which it turns out of it, pre-buckling bend included. Collocation on
/// the linearised boundary-value problem.
const STRIPS: [(&str, &str); 2] = [
    (
        "load.tip_force[2]",
        "0.8  1000   4.016676901240
         0.8   100   4.054222577948
         0.8    20   4.241802097099
         0.8    10   4.536899035739",
    ),
    (
        "load.gravity[2]",
        "0.8  1000  12.867244417440
         0.8   100  12.991462820326
         0.8    20  13.614407298823
         0.8    10  14.602497778784
         2.0   100  13.103177400101",
    ),
];

fn strips() -> Vec<Case> {
    let rows = STRIPS.into_iter();
    let rows = rows.flat_map(|(key, rows)| table(rows).into_iter().map(move |row| (key, row)));
    rows.map(|(key, [torsion, strong, ratio])| {
        let strip = format!("{RIGID}; stiffness.torsion={torsion}; stiffness.bending_2={strong}");
        rod_of(strip, key, &[(-ratio * torsion.sqrt(), 1)], 1e-7)
    })
    .collect()
}

/// Curvature kL of a rod that hangs, naturally curved, and Gamma = w L^3/EI at which it leaves
/// its plane (Miller and others, J. Mech. Phys. Solids 68, 2014). Collocation on the
/// linearised boundary-value problem.
const HANGING: [(f64, f64); 2] = [(6.0, 11.868750740620), (2.0 * PI, 12.187078750000)];

/// EA, GA of a lens with a midrib, and its length at which the flat shape loses its stability.
/// Collocation.
const MIDRIB: &str = "2500 1000 0.93780575743\n 1e5 4e4 0.92789056742";

/// Euler's loads P_E of columns that are clamped at the base and held at the tip, as the
/// holder's travel P/EA at which a rod that is shortened buckles: P (1 - P/EA) = P_E.
const HELD: [(&str, f64); 2] = [
    ("clamped", 39.47841760435743),
    ("pinned", 20.19072855642663),
];

fn others() -> Vec<Case> {
    let mut cases = Vec::new();
    for (curvature, weight) in HANGING {
        cases.push(Case {
            text: text("classic/hanging_curved"),
            entries: format!("rest.bend_3={curvature:?}"),
            vary: ("load.gravity[0]", 0.0, 1.3 * weight),
            critical: vec![(weight, 1)],
            within: 1e-8,
        });
    }
    for [axial, shear, length] in table(MIDRIB) {
        cases.push(Case {
            text: text("classic/lens_midrib"),
            entries: format!("{}; leaf.length=[1, 0.9, 1]", set_stiffness(axial, shear)),
            vary: ("leaf.length[1]", 0.9, length + 2.2e-3),
            critical: vec![(length, 1)],
            within: 1e-9,
        });
    }
    for (how, load) in HELD {
        let travel = 0.5 * (1.0 - (1.0 - 4e-3 * load).sqrt());
        cases.push(Case {
            text: held(how),
            entries: format!(
                "{}; stiffness.bending_2=3",
                set_stiffness(1e3, f64::INFINITY)
            ),
            vary: ("tip.position[0]", 1.0, 1.0 - 1.4 * travel),
            critical: vec![(1.0 - travel, 1)],
            within: 1e-10,
        });
    }
    cases
}

/// A grip in the middle of a vein, beyond which nothing bears, presses it as a holder of its tip
/// does.
#[test]
fn a_vein_buckles_before_its_grip() {
    for (how, load) in HELD {
        let travel = 0.5 * (1.0 - (1.0 - 4e-3 * load).sqrt());
        let case = Case {
            text: format!("{ROD}\ngrip = [{{ vein = 1, at = 0.5, held = \"{how}\" }}]"),
            entries: format!(
                "{}; stiffness.bending_2=3; leaf.length=2",
                set_stiffness(1e3, f64::INFINITY)
            ),
            vary: ("grip[0].move[0]", 0.0, -1.4 * travel),
            critical: vec![(-travel, 1)],
            within: 1e-7,
        };
        case.is_followed();
        case.is_relaxed();
    }
}

#[test]
fn columns_buckle_at_the_loads_of_euler_reissner_and_greenhill() {
    for case in columns() {
        case.is_followed();
        case.is_relaxed();
        case.is_left();
    }
}

#[test]
fn strips_hanging_rods_lenses_and_held_columns_leave_their_planes() {
    for case in strips().into_iter().chain(others()) {
        case.is_followed();
        case.is_relaxed();
        case.is_left();
    }
}

/// An isotropic rod between clamps, neither pulled nor pushed, becomes unstable in two
/// directions when the moment M that twists it has tan(M L/2B) = M L/2B.
#[test]
fn a_twisted_rod_becomes_unstable_in_two_directions() {
    let torsion = 0.8;
    let stiffness = set_stiffness(1e8, f64::INFINITY);
    let case = Case {
        text: held("clamped"),
        entries: format!("{stiffness}; stiffness.torsion={torsion}"),
        vary: ("tip.twist", 0.0, 14.0),
        critical: vec![(8.986818915818128 / torsion, 2)],
        within: 1e-8,
    };
    case.is_followed();
    // More than a turn counts, and the clamp feels the moment.
    let twisted = settle(&case.at(11.0, 1.0), 1e-9);
    let moment = twisted.reaction.unwrap().moments.unwrap()[0];
    assert!((moment + DVec3::X * (11.0 * torsion)).length() < 1e-6);
}

/// Up to kL = 5 a hanging rod never leaves its plane (to Gamma = 3 (kL)^3 + 50).
#[test]
fn a_less_curved_rod_stays_in_its_plane() {
    for curvature in [1.0, 3.0, 5.0_f64] {
        let most = 3.0 * curvature.powi(3) + 50.0;
        for part in [0.02, 0.1, 0.3, 0.6, 1.0] {
            let weight = part * most;
            let bent = format!("rest.bend_3={curvature:?}; load.gravity=[{weight:?}, 0, 0]");
            let leaf = settle(
                &scenario("classic/hanging_curved", &format!("{RIGID}; {bent}")),
                1e-8,
            );
            assert_eq!(leaf.stability.negative_eigenvalues, Some(0));
            assert!(leaf.stability.saddle.is_none(), "kL = {curvature}, {part}");
            assert!(tip(&leaf).z.abs() < 1e-8);
        }
    }
}

/// A buckled column that is unloaded becomes straight at Euler's load, where its branch turns back
/// into the mirror image. No eigenvalue changes its sign along it, but the straight column is
/// reported as crossing there, and is followed to both sides if requested.
#[test]
fn a_buckled_branch_reports_the_straight_one_that_crosses_it() {
    let euler = -(std::f64::consts::FRAC_PI_2).powi(2);
    for segments in [None, Some(64)] {
        let column = base(
            &text("classic/elastica_buckled"),
            "load.tip_force=[-3, 0, 0]",
        );
        let mut request = branch::request(column, "load.tip_force[0]=-3..-1", 1e-8, 2000);
        request.keep_unstable = false;
        request.switch = true;
        request.segments = segments;
        let trace = leafdyn::study::trace(&request, &mut |_, _, _| {}).unwrap();
        let [buckled, straight @ ..] = trace.branches.as_slice() else {
            panic!("no branch")
        };
        let critical: Vec<_> = buckled.critical_points().collect();
        let [(_, vertex)] = critical[..] else {
            panic!("{} critical points", critical.len())
        };
        let (off, told) = ((vertex.value - euler).abs(), vertex.value_error.unwrap());
        assert!(off <= told && told < 1e-5, "{off:.1e} of {told:.1e}");
        assert_eq!(vertex.index, 0);
        let ends = straight.iter().filter_map(|it| it.points.last());
        let ends: Vec<_> = ends.map(|end| (end.value, end.index)).collect();
        assert_eq!(ends.len(), 2);
        assert!(
            ends.contains(&(-1.0, 0)) && ends.contains(&(-3.0, 1)),
            "{ends:?}"
        );
    }
}

/// A column under its own weight that a small weight sideways bends: its pitchfork is unfolded, and the
/// branch, stable throughout, has no critical point, however near it passes the other one.
#[test]
fn a_pitchfork_that_is_unfolded_is_none() {
    let stiff = "stiffness.bending_3=1.3; stiffness.axial=1000; stiffness.shear_2=1000; stiffness.shear_3=1000";
    for sideways in [1e-5, 3e-4, 1e-3, 1e-2] {
        for end in [-9.0, -20.0, -35.4] {
            let what = format!("{sideways} to {end}");
            let entries = format!("{stiff}; load.gravity=[0, 0, {}]", -sideways);
            let found = follow(ROD, &entries, &format!("load.gravity[0]=0..{end}"), false);
            changes_at(&what, &found, &[], 0.0);
            let last = found.branches[0].points.last().unwrap();
            assert_eq!((last.value, last.index), (end, 0), "{what}");
            let tip = last.tips[0];
            assert!(tip.x < 0.67 && tip.z < -0.4, "{what}: {tip}");
        }
    }
}

/// Curved veins, tied to each other side by side, stretch when the leaf bends. They are as
/// slender as those of real leaves: with a softer matrix, tangents would be wrong by a tenth,
/// steps short, and the second branch lost.
#[test]
fn leaves_whose_bending_stretches_their_veins_are_followed() {
    let leaf = r#"
        name = "shell"
        leaf = { rods = 5, length = 1.0, fan = "symmetric" }
        stiffness = { torsion = 0.8, bending_2 = 1.0, bending_3 = 1.0, axial = 5e5, shear_2 = 2e5, shear_3 = 2e5 }
        rest = { bend_2 = -0.6 }
        load = { gravity = [0.0, 0.0, 0.0] }
    "#;
    let shells = [
        (
            "leaf.fan=[-0.3, -0.15, 0, 0.15, 0.3]; coupling.y=1000; coupling.z=1000",
            20,
            0,
        ),
        (
            "leaf.fan=[-0.6, -0.3, 0, 0.3, 0.6]; coupling.y=20; coupling.z=20",
            40,
            3,
        ),
    ];
    for (entries, most, critical) in shells {
        let request = request(base(leaf, entries), "load.gravity[2]=0..-20", 1e-6, 2000);
        let found = trace(&request, &mut |_, _, _| {}).unwrap();
        assert!(found.complete, "{entries}: {:?}", found.branches[0].end);
        let branch = &found.branches[0];
        assert!(
            branch.points.len() <= most,
            "{entries}: {}",
            branch.points.len()
        );
        assert_eq!(branch.critical_points().count(), critical, "{entries}");
    }
}
