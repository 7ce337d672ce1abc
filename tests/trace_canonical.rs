//! Critical loads of textbook problems, found by following an equilibrium: the
//! index changes there by as much as it should.

use leafdyn::study::{Base, PointKind, Trace, TraceRequest, trace};

/// Follows a scenario given as text.
fn follow(text: &str, set: &[&str], vary: &str, switch: bool) -> Trace {
    let overrides: Vec<String> = set.iter().map(|entry| entry.to_string()).collect();
    let request = TraceRequest {
        base: Base::of_text(text.into(), "test.toml".into(), &overrides).unwrap(),
        vary: vary.parse().unwrap(),
        switch,
        keep_unstable: true,
        segments: None,
        tolerance: Some(1e-8),
        most_points: 2000,
        cross_section: None,
    };
    trace(&request, &mut |_, _, _| {}).unwrap()
}

/// The critical values along the first branch, each with the change of index.
fn critical(trace: &Trace) -> Vec<(f64, i64)> {
    let branch = &trace.branches[0];
    let mut before = branch.points[0].index;
    let mut found = Vec::new();
    for (_, point) in branch.critical() {
        found.push((point.value, point.index as i64 - before as i64));
        before = point.index;
    }
    found
}

fn agree(what: &str, trace: &Trace, wanted: &[(f64, i64)], within: f64) {
    let found = critical(trace);
    println!("{what}: {found:?}, {:?}", trace.remark);
    assert_eq!(found.len(), wanted.len(), "{what}: {found:?}");
    for ((value, change), (wanted, wanted_change)) in found.iter().zip(wanted) {
        let off = (value / wanted - 1.0).abs();
        println!("{what}: {value:.13}, off by {off:.1e}");
        assert_eq!(change, wanted_change, "{what} at {value}");
        assert!(off < within, "{what}: {value} is not {wanted}");
    }
    for (_, point) in trace.branches[0].critical() {
        let bound = point.value_error.unwrap();
        println!("{what}: bound {bound:.1e}");
    }
}

const ROD: &str = r#"
    name = "rod"
    leaf = { rods = 1, length = 1.0, fan = [0.0] }
    stiffness = { torsion = 0.8, bending_2 = 1.0, bending_3 = 1000.0, axial = 1000.0, shear_2 = 1000.0, shear_3 = 1000.0 }
"#;

/// (2 k - 1)^2 pi^2/4 of the clamped-free column; a round one buckles both ways.
#[test]
fn euler() {
    let euler = |k: f64| (2.0 * k - 1.0).powi(2) * std::f64::consts::PI.powi(2) / 4.0;
    let strip = follow(ROD, &[], "load.tip_force[0]=0..-70", false);
    let wanted = [1.0, 2.0, 3.0].map(|k| (-euler(k), 1));
    agree("Euler", &strip, &wanted, 1e-8);
    let round = follow(
        ROD,
        &["stiffness.bending_3=1.0"],
        "load.tip_force[0]=0..-30",
        false,
    );
    agree(
        "Euler, round",
        &round,
        &[1.0, 2.0].map(|k| (-euler(k), 2)),
        1e-8,
    );
}

/// Engesser and Reissner: P (1 + P/GA - P/EA) = pi^2/4.
#[test]
fn reissner() {
    for (axial, shear, exact) in [
        ("1000.0", "400.0", 2.458335976611486),
        ("100.0", "40.0", 2.382272748545408),
    ] {
        let set = [
            format!("stiffness.axial={axial}"),
            format!("stiffness.shear_2={shear}"),
            format!("stiffness.shear_3={shear}"),
        ];
        let set: Vec<&str> = set.iter().map(String::as_str).collect();
        let found = follow(ROD, &set, "load.tip_force[0]=0..-5", false);
        agree("Reissner", &found, &[(-exact, 1)], 1e-8);
    }
}

const RIGID: [&str; 3] = [
    "stiffness.axial=inf",
    "stiffness.shear_2=inf",
    "stiffness.shear_3=inf",
];

/// Greenhill (1881): 9/4 j^2, j the first zero of J_(-1/3).
#[test]
fn greenhill() {
    let set: Vec<&str> = RIGID
        .into_iter()
        .chain(["stiffness.bending_3=2.0"])
        .collect();
    let found = follow(ROD, &set, "load.gravity[0]=0..-10", false);
    agree("Greenhill", &found, &[(-7.837347438943484, 1)], 1e-8);
}

/// Lateral buckling of a cantilever strip with its bend before buckling, by a
/// shooting solution of the linearised problem: P/sqrt(GJ) and w/sqrt(GJ) with
/// EI_weak = 1, GJ = 0.8.
#[test]
fn lateral_buckling() {
    let root = 0.8f64.sqrt();
    for (strong, tip, weight) in [
        ("1000.0", 4.016676901240, 12.867244417440),
        ("20.0", 4.241802097099, 13.614407298823),
        ("10.0", 4.536899035739, 14.602497778784),
    ] {
        // Bends easily sideways, and is loaded along its strong direction.
        let bending = format!("stiffness.bending_2={strong}");
        let set: Vec<&str> = [bending.as_str(), "stiffness.bending_3=1.0"]
            .into_iter()
            .chain(RIGID)
            .collect();
        let by_tip = follow(ROD, &set, "load.tip_force[2]=0..-6", false);
        agree("tip load", &by_tip, &[(-tip * root, 1)], 1e-7);
        let by_weight = follow(ROD, &set, "load.gravity[2]=0..-16", false);
        agree("weight", &by_weight, &[(-weight * root, 1)], 1e-7);
    }
}

/// Points of the post-buckled elastica: load P/P_cr, x and y of the tip at end
/// slopes of 20 and 60 degrees (P = 2 k / K, elliptic integrals).
#[test]
fn elastica() {
    let set: Vec<&str> = RIGID
        .into_iter()
        .chain(["stiffness.bending_2=1000.0", "stiffness.bending_3=1.0"])
        .collect();
    let critical = std::f64::consts::PI.powi(2) / 4.0;
    for (part, x, y) in [
        (1.0153968655397, 0.96973090736352, 0.2194130423956),
        (1.1517196204691, 0.74101960607633, 0.59320764616489),
        (1.8848008689781, 0.12315997240512, 0.80317099000746),
    ] {
        let vary = format!("load.tip_force[0]=-2.2..{:?}:30", -part * critical);
        let found = follow(ROD, &set, &vary, true);
        assert_eq!(found.branches.len(), 3, "{part}: {:?}", found.remark);
        for branch in &found.branches[1..] {
            let last = branch.points.last().unwrap();
            let tip = last.tips[0];
            println!(
                "{part}: tip {tip}, within {:?}, index {}",
                last.error, last.index
            );
            assert_eq!(last.index, 0);
            assert!((last.value + part * critical).abs() < 1e-12);
            let off = (tip.x - x).abs().max((tip.y.abs() - y).abs());
            assert!(off < 1e-8, "{part}: {off:e}");
        }
        let tips = [1, 2].map(|b| found.branches[b].points.last().unwrap().tips[0]);
        assert!((tips[0].y + tips[1].y).abs() < 1e-8, "mirror images");
        let kinds: Vec<PointKind> = found.branches[0].critical().map(|(_, p)| p.kind).collect();
        assert_eq!(kinds, [PointKind::Branching(1)]);
    }
}

const LENS: &str = r#"
    name = "lens"
    leaf = { rods = 3, length = 1.0, fan = [-1.0471975511965976, 0.0, 1.0471975511965976] }
    stiffness = { torsion = 0.8, bending_2 = 1.0, bending_3 = 1.0, axial = 2500.0, shear_2 = 1000.0, shear_3 = 1000.0 }
"#;

/// A lens of two rods at 60 degrees with a midrib: where the midrib is too long
/// it buckles out of the plane; its critical length by collocation.
#[test]
fn lens_with_midrib() {
    for (axial, shear, end, exact) in [
        ("2500.0", "1000.0", 0.94, 0.93780575743),
        ("1e5", "4e4", 0.93, 0.92789056742),
    ] {
        let set = [
            format!("stiffness.axial={axial}"),
            format!("stiffness.shear_2={shear}"),
            format!("stiffness.shear_3={shear}"),
            "leaf.length=[1.0, 0.9, 1.0]".into(),
        ];
        let set: Vec<&str> = set.iter().map(String::as_str).collect();
        let found = follow(LENS, &set, &format!("leaf.length[1]=0.9..{end}"), false);
        agree("midrib", &found, &[(exact, 1)], 1e-9);
    }
}

/// A hanging, naturally curved rod (Miller and others, J. Mech. Phys. Solids 68,
/// 2014): the weight at which it leaves its plane, by collocation.
#[test]
fn hanging_curved_rod() {
    let curved = |turns: f64, exact: f64| {
        let text = format!(
            r#"
            name = "curved"
            leaf = {{ rods = 1, length = 1.0, fan = [0.0] }}
            stiffness = {{ torsion = 0.6666666666666666, bending_2 = 1.0, bending_3 = 1.0, axial = inf, shear_2 = inf, shear_3 = inf }}
            rest = {{ bend_3 = {turns:?} }}
            "#
        );
        let found = follow(
            &text,
            &[],
            &format!("load.gravity[0]={:?}..{:?}", 1.3 * exact, 0.8 * exact),
            false,
        );
        agree("curved", &found, &[(exact, -1)], 1e-8);
    };
    curved(6.0, 11.868750740620);
    curved(2.0 * std::f64::consts::PI, 12.187078750000);
}
