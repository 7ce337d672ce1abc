//! Loads that turn with the section, and moments along veins: closed forms, an integration of the rod's
//! equations from its free tip, and the order of convergence.
//!
//! All loads of a rod that follow it are known in the frame of its tip, where force and moment are given:
//! the equations of its equilibrium are then an initial value problem, which is integrated here by the
//! classical Runge-Kutta method, independent of the elements.

use glam::DQuat;
use leafdyn::relax::{EquilibriumRemark, Options, Route};
use leafdyn_testing::random::Draw;
use leafdyn_testing::*;

const ROD: &str = r#"
    name = "rod"
    leaf = { rods = 1, length = 1.0, fan = [0.0] }
    stiffness = { torsion = 0.8, bending_2 = 1.0, bending_3 = 1.4, axial = 90.0, shear_2 = inf, shear_3 = 60.0 }
"#;

const A: DVec3 = DVec3::new(0.8, 1.0, 1.4);
const COMPLIANCE: DVec3 = DVec3::new(1.0 / 90.0, 0.0, 1.0 / 60.0);

/// Loads along the directors of a rod: on its tip, on its middle, and per length.
#[derive(Clone, Copy, Default)]
struct Following {
    tip: [DVec3; 2],
    middle: [DVec3; 2],
    along: [DVec3; 2],
}

impl Following {
    /// The rod under these loads, forces first.
    fn scenario(&self) -> Scenario {
        let list = |v: DVec3| format!("{:?}", v.to_array());
        let [force, moment] = self.along.map(list);
        let point = |at: f64, load: [DVec3; 2]| {
            let [force, moment] = load.map(list);
            format!(
                "\n[[load.point]]\nvein = 1\nat = {at:?}\nforce = {force}\nmoment = {moment}\nfollows = true"
            )
        };
        parse(&format!(
            "{ROD}\n[load]\nfollower = {force}\ncouple = {moment}\ncouple_follows = true{}{}",
            point(0.5, self.middle),
            point(1.0, self.tip)
        ))
    }

    /// Position and rotation of the tip, and force and moment on the base, by integration from the tip.
    fn integrated(&self) -> (DVec3, DQuat, [DVec3; 2]) {
        let mut y = Fields {
            r: DVec3::ZERO,
            q: DQuat::IDENTITY,
            n: self.tip[0],
            m: self.tip[1],
        };
        let steps = 2000;
        let h = -1.0 / f64::from(steps);
        for step in 0..steps {
            if step == steps / 2 {
                y.n += y.q * self.middle[0];
                y.m += y.q * self.middle[1];
            }
            let slope = |y: Fields| y.slope(self.along);
            let k1 = slope(y);
            let k2 = slope(y.plus(k1, 0.5 * h));
            let k3 = slope(y.plus(k2, 0.5 * h));
            let k4 = slope(y.plus(k3, h));
            for (k, part) in [(k1, 1.0), (k2, 2.0), (k3, 2.0), (k4, 1.0)] {
                y = y.plus(k, part * h / 6.0);
            }
            y.q = y.q.normalize();
        }
        let back = y.q.conjugate();
        (back * -y.r, back, [back * y.n, back * y.m])
    }
}

/// Position, rotation, force and moment of a section, or their slopes.
#[derive(Clone, Copy)]
struct Fields {
    r: DVec3,
    q: DQuat,
    n: DVec3,
    m: DVec3,
}

impl Fields {
    fn slope(self, [f, c]: [DVec3; 2]) -> Fields {
        let q = self.q.normalize();
        let back = q.conjugate();
        let r = q * (DVec3::X + COMPLIANCE * (back * self.n));
        let u = (back * self.m) / A;
        Fields {
            r,
            q: self.q * DQuat::from_xyzw(0.5 * u.x, 0.5 * u.y, 0.5 * u.z, 0.0),
            n: -(q * f),
            m: -r.cross(self.n) - q * c,
        }
    }

    fn plus(self, slope: Fields, h: f64) -> Fields {
        Fields {
            r: self.r + h * slope.r,
            q: self.q + slope.q * h,
            n: self.n + h * slope.n,
            m: self.m + h * slope.m,
        }
    }
}

fn cases() -> Vec<Following> {
    let v = DVec3::new;
    let none = [DVec3::ZERO; 2];
    vec![
        // A force across a cantilever that follows it: the elastica beyond half a turn.
        Following {
            tip: [v(0.0, 9.0, 0.0), DVec3::ZERO],
            ..Following::default()
        },
        Following {
            tip: [v(-3.0, 0.0, 2.0), v(0.0, 1.0, 0.0)],
            ..Following::default()
        },
        Following {
            along: [v(0.0, 0.0, 8.0), DVec3::ZERO],
            ..Following::default()
        },
        Following {
            along: [DVec3::ZERO, v(1.0, 2.0, 3.0)],
            ..Following::default()
        },
        Following {
            tip: [v(1.0, -2.0, 0.5), v(0.5, 0.3, -0.6)],
            middle: [v(0.4, 1.0, -2.0), v(-0.4, 0.6, 0.2)],
            along: [v(0.6, 1.0, 1.5), v(0.3, -0.5, 0.7)],
        },
        Following {
            middle: [v(0.0, 4.0, 3.0), v(0.3, 0.0, 0.8)],
            tip: none,
            along: none,
        },
    ]
}

#[test]
fn rods_are_those_integrated_from_their_tips() {
    for (number, case) in cases().into_iter().enumerate() {
        let leaf = settle(&case.scenario(), 1e-9);
        let (x, q, [n, m]) = case.integrated();
        tip_is(&format!("case {number}"), &leaf, x, 1e-10, 1e-8);
        let own = tip_node(&leaf.shape.rods, 0);
        let off = (own.rotation * DVec3::X).distance(q * DVec3::X);
        assert!(off < 1e-7, "case {number}: tip turned by {off:.1e}");
        // What the rod carries at its base, and just before the load on its tip.
        let base = &leaf.shape.rods[0].nodes[0];
        let (force, moment) = in_lab(base);
        for (what, found, wanted) in [("force", force, n), ("moment", moment, m)] {
            let off = found.distance(wanted);
            assert!(
                off < 1e-6 * (1.0 + wanted.length()),
                "case {number}, {what}: {off:.1e}"
            );
        }
        assert!(
            own.n.distance(case.tip[0]) < 1e-6,
            "case {number}: {}",
            own.n
        );
        assert!(
            own.m.distance(case.tip[1]) < 1e-6,
            "case {number}: {}",
            own.m
        );
        let on_base = leaf.base_reaction.as_ref().unwrap();
        assert!(
            on_base.force.distance(n) < 1e-6,
            "case {number}: {}",
            on_base.force
        );
        assert!(on_base.moment.unwrap().distance(m) < 1e-6, "case {number}");
        assert_eq!(leaf.energy, None);
    }
}

#[test]
fn errors_are_of_second_order() {
    for (number, case) in cases().into_iter().enumerate() {
        let (x, ..) = case.integrated();
        let tips =
            [16, 32, 64, 128].map(|segments| tip(&settle_on(&case.scenario(), segments, false)));
        let errors = tips.map(|tip| tip.distance(x));
        let orders: Vec<f64> = errors
            .windows(2)
            .map(|pair| order(pair[0], pair[1]))
            .collect();
        let last = orders[2];
        assert!((last - 2.0).abs() < 0.03, "case {number}: {orders:?}");
        let along = |axis: usize| extrapolate(&tips.map(|tip| tip[axis]), 0.25);
        let best = DVec3::new(along(0), along(1), along(2));
        assert!(
            best.distance(x) < 1e-4 * errors[3],
            "case {number}: {best} for {x}"
        );
    }
}

/// In its plane a moment is the same whether it turns with the section or not.
#[test]
fn moments_in_the_plane_bend_alike_dead_or_following() {
    let couple = |what: &str| settle(&parse(&format!("{ROD}\n[load]\n{what}")), 1e-9);
    let point = |follows: bool| {
        format!(
            "gravity = [0.0, 0.0, 0.0]\n[[load.point]]\nvein = 1\nat = 1.0\nmoment = [0.0, 0.0, 4.0]\nfollows = {follows}"
        )
    };
    let pairs = [
        [
            "couple = [0.0, 0.0, 6.0]".to_owned(),
            "couple = [0.0, 0.0, 6.0]\ncouple_follows = true".into(),
        ],
        [point(false), point(true)],
    ];
    for pair in pairs {
        let [dead, following] = pair.map(|text| couple(&text));
        assert!(tip(&dead).distance(tip(&following)) < 1e-8);
    }
    // An arc of the curvature M/EI; a moment c per length: theta = c (s - s^2/2)/EI.
    let arc = couple(&point(true));
    let turn = 4.0 / 1.4_f64;
    let wanted = DVec3::new(turn.sin(), 1.0 - turn.cos(), 0.0) / turn;
    tip_is("arc", &arc, wanted, 1e-14, 1e-8);
    let leaf = couple("couple = [0.0, 0.0, 6.0]");
    let spread = DVec3::new((3.0 / 1.4_f64).cos(), (3.0 / 1.4_f64).sin(), 0.0);
    let direction = tip_node(&leaf.shape.rods, 0).rotation * DVec3::X;
    assert!(direction.distance(spread) < 1e-8, "{direction}");
}

/// Dead moments along a vein, and their sum on its base; beside a weight, on two veins with a joint tip.
#[test]
fn bases_bear_all_moments() {
    let text = r#"
        name = "two"
        leaf = { rods = 2, length = 1.0, fan = "symmetric" }
        stiffness = { torsion = 0.8, bending_2 = 1.0, bending_3 = 1.4, axial = 90.0, shear_2 = 70.0, shear_3 = 60.0 }
        coupling = { x = 1.5, y = 1.5, z = 1.5 }
        [load]
        gravity = [0.0, 0.1, -0.6]
        couple = [[0.3, 0.2, -0.4], [0.0, 0.5, 0.2]]
        follower = [0.0, 0.2, 0.4]
        [[load.point]]
        vein = 2
        at = 1.0
        force = [0.3, -0.2, 0.1]
        moment = [0.2, 0.1, 0.3]
        follows = true
    "#;
    let scenario = parse(text);
    let leaf = settle(&scenario, 1e-8);
    // Forces and moments about the origin, by Simpson's rule along the veins.
    let (mut force, mut moment) = (DVec3::ZERO, DVec3::ZERO);
    let full = leaf.clone().at_stations(&scenario, Some(256));
    for (j, rod) in full.shape.rods.iter().enumerate() {
        let couple = [DVec3::new(0.3, 0.2, -0.4), DVec3::new(0.0, 0.5, 0.2)][j];
        for (i, node) in rod.nodes.iter().enumerate() {
            let weight = match i {
                0 | 256 => 1.0,
                _ if i % 2 == 1 => 4.0,
                _ => 2.0,
            } / (3.0 * 256.0);
            let f = DVec3::new(0.0, 0.1, -0.6) + node.rotation * DVec3::new(0.0, 0.2, 0.4);
            force += weight * f;
            moment += weight * (node.position.cross(f) + couple);
        }
    }
    let tip = tip_node(&leaf.shape.rods, 1);
    let f = tip.rotation * DVec3::new(0.3, -0.2, 0.1);
    force += f;
    moment += tip.position.cross(f) + tip.rotation * DVec3::new(0.2, 0.1, 0.3);
    let on_base = leaf.base_reaction.as_ref().unwrap();
    assert!(
        on_base.force.distance(force) < 1e-6,
        "{} {force}",
        on_base.force
    );
    let own = on_base.moment.unwrap();
    assert!(own.distance(moment) < 1e-6, "{own} {moment}");
    assert!(matches!(
        leaf.remark,
        Some(EquilibriumRemark::FollowersWithoutPotential { verdict: Some(_) })
    ));
}

/// A grip bears what acts between it and the base.
#[test]
fn held_rods_are_loaded_once_they_are_held() {
    let text = format!(
        "{ROD}\n[load]\nfollower = [0.0, 0.0, 2.0]\n[[grip]]\nvein = 1\nat = 1.0\nmove = [-0.05, 0.0, 0.1]"
    );
    let scenario = parse(&text);
    let leaf = settle(&scenario, 1e-8);
    let full = leaf.clone().at_stations(&scenario, Some(256));
    let nodes = full.shape.rods[0].nodes.iter().enumerate();
    let sum: DVec3 = nodes
        .map(|(i, node)| {
            let weight = match i {
                0 | 256 => 1.0,
                _ if i % 2 == 1 => 4.0,
                _ => 2.0,
            } / (3.0 * 256.0);
            weight * (node.rotation * DVec3::new(0.0, 0.0, 2.0))
        })
        .sum();
    let held = leaf.grip_reactions[0].force + leaf.base_reaction.as_ref().unwrap().force;
    assert!(held.distance(sum) < 1e-5, "{held} {sum}");
}

#[test]
fn what_needs_a_potential_refuses_them() {
    let leaf = cases()[0].scenario();
    let refused = leafdyn::study::relax_with_margin(&leaf, &to(1e-6), &mut |_| {});
    let why = refused.unwrap_err().to_string();
    assert!(why.contains("load.follower"), "{why}");
}

/// A joined leaf that is softer to one side than to the other, stiff veins between soft ones: several equilibria.
fn soft_leaf(random: &mut Draw) -> Scenario {
    let rods = 2 + random.uniform(0.0, 4.0) as usize;
    let [torsion, bending] = [random.log(0.3, 3.0), random.log(1.0, 30.0)];
    let weight = random.log(0.5, 12.0);
    parse(&format!(
        r#"
        name = "soft"
        leaf = {{ rods = {rods}, length = 1.0, fan = "paper" }}
        stiffness = {{ torsion = {torsion:?}, bending_2 = 1.0, bending_3 = {bending:?}, axial = 100.0, shear_2 = 100.0, shear_3 = 100.0 }}
        load.gravity = [0.0, 0.0, {:?}]
        "#,
        -weight
    ))
}

/// A load that is hardly there changes nothing: loads without a potential grow on the leaf that slow loading gives.
#[test]
fn vanishing_loads_leave_the_slowly_loaded_leaf() {
    let mut random = Draw(0x51_0e5);
    let mut far = 0;
    for k in 0..60 {
        let alone = soft_leaf(&mut random);
        let mut loaded = alone.clone();
        loaded.follower = Some(vec![
            [
                Profile::Constant(0.0),
                Profile::Constant(0.0),
                Profile::Constant(1e-12)
            ];
            alone.rods.len()
        ]);
        let [one, other] = [&alone, &loaded].map(|it| settle(it, 1e-6));
        assert_eq!(
            one.path.as_ref().map(|it| it.word()),
            other.path.as_ref().map(|it| it.word()),
            "{k}"
        );
        let bar = estimate(&one) + estimate(&other);
        let off = tip(&one).distance(tip(&other));
        assert!(off <= bar.max(1e-9), "{k}: {off:.1e} > {bar:.1e}");
        let released = Options {
            route: Route::Release,
            ..to(1e-6)
        };
        far += usize::from(tip(&settled(&loaded, &released)).distance(tip(&one)) > 0.1);
    }
    // Where slow loading ends is not where arcs lead.
    assert!(far > 0);
}
