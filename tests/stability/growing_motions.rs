//! Motions that grow are found also where many others are slower.

use leafdyn::relax::MotionInstability;
use leafdyn::study::{PointKind, trace};
use leafdyn_testing::*;

/// Round veins side by side without anything between them, of which the last is stiff.
fn veins(soft: usize, more: &str) -> Scenario {
    let list = |of_soft: f64, of_stiff: f64| {
        let all = (0..soft).map(|k| of_soft * (1.0 + 0.01 * k as f64));
        list_of(all.chain([of_stiff]).collect())
    };
    let fan = list_of((0..=soft).map(|k| 0.05 * k as f64).collect());
    parse(&format!(
        "name = \"veins\"\nleaf = {{ rods = {}, length = 1.0, fan = {fan}, joined = false }}
         stiffness = {{ torsion = {}, bending_2 = {}, bending_3 = {}, axial = 6000.0, shear_2 = 6000.0, shear_3 = 6000.0 }}
         dynamics = {{ density = 1.0, rotary_inertia = 0.003, external_damping = 0.0 }}\n{more}",
        soft + 1,
        list(0.8, 160.0),
        list(1.0, 200.0),
        list(1.1, 200.0),
    ))
}

fn list_of(numbers: Vec<f64>) -> String {
    let words: Vec<String> = numbers.iter().map(|it| format!("{it:?}")).collect();
    format!("[{}]", words.join(", "))
}

/// A moment that turns with the tip of a round vein makes it flutter at once, whatever other veins do (H. Ziegler,
/// Principles of Structural Stability, 1968): its root is the same beside four soft ones, whose first twenty are
/// smaller.
#[test]
fn one_stiff_vein_of_many_flutters() {
    let turned = |vein: usize| {
        format!(
            "[[load.point]]\nvein = {vein}\nat = 1.0\nmoment = [300.0, 60.0, 0.0]\nfollows = true"
        )
    };
    let alone = settle(&veins(0, &turned(1)), 1e-6);
    let motions = alone.stability.small_motions.unwrap();
    assert_eq!(motions.instability, Some(MotionInstability::Flutter));
    let [rates, frequencies] = [motions.growth_rates, motions.frequencies];
    let beside = settle(&veins(4, &turned(5)), 1e-6);
    let motions = beside.stability.small_motions.unwrap();
    assert_eq!(
        (motions.stable, motions.instability),
        (Some(false), Some(MotionInstability::Flutter))
    );
    let found = motions.growth_rates.iter().zip(&motions.frequencies);
    let grow: Vec<_> = found.filter(|(growth, _)| **growth > 1.0).collect();
    assert!(!grow.is_empty());
    for (growth, frequency) in grow {
        let alike = rates.iter().zip(&frequencies).any(|(rate, other)| {
            (growth - rate).abs() < 1e-3 * growth && (frequency - other).abs() < 1e-3 * frequency
        });
        assert!(
            alike && *frequency > 40.0,
            "{growth} {frequency} {rates:?} {frequencies:?}"
        );
    }
}

/// The load at which a stiff vein flutters (Beck, ZAMP 3, 1952) is located along a trace beside soft veins, of which more
/// than twenty motions are slower.
#[test]
fn flutter_of_one_stiff_vein_of_many_is_located() {
    let text = r#"
        name = "veins"
        leaf = { rods = 4, length = 1.0, fan = [0.0, 0.1, 0.2, 0.3], joined = false }
        dynamics = { density = 1.0, external_damping = 0.0 }
        [stiffness]
        torsion = [1.0, 1.0, 1.0, 500.0]
        bending_2 = [1.0, 1.1, 1.2, 900.0]
        bending_3 = [1.3, 1.4, 1.5, 200.0]
        axial = inf
        shear_2 = inf
        shear_3 = inf
        [[load.point]]
        vein = 4
        at = 1.0
        force = [-3500.0, 0.0, 0.0]
        follows = true
    "#;
    let vary = "load.point[0].force[0]=-3500..-4500";
    let mut request = branch::request(base(text, ""), vary, 1e-6, 200);
    request.keep_unstable = false;
    let trace = trace(&request, &mut |_, _, _| {}).unwrap();
    assert!(
        trace.complete,
        "{:?} {:?}",
        trace.remark,
        trace.branches[0].remark()
    );
    let events: Vec<_> = trace.branches[0].critical_points().collect();
    assert_eq!(events.len(), 1);
    let (_, flutter) = events[0];
    assert_eq!(flutter.kind, PointKind::Flutter);
    let (apart, error) = (
        flutter.value + 200.0 * 20.050_953_6,
        flutter.value_error.unwrap(),
    );
    assert!(
        apart.abs() <= error && error < 0.1,
        "{} {error}",
        flutter.value
    );
    let motion = flutter.motion.as_ref().unwrap().dominant.as_ref().unwrap();
    close(
        "frequency",
        motion.frequency,
        11.015_56 * 200.0_f64.sqrt(),
        1e-4,
    );
}

/// Of a leaf with more veins in wind than have a coarse grid it is not known.
#[test]
fn of_very_many_veins_it_is_not_known() {
    let wind = "wind = { velocity = [0.0, 0.0, 0.3], density = 1.0, drag = 1.0, width = 0.01 }";
    let options = Options {
        method: Options::default().method.on_grid(Some(4)),
        ..Options::default()
    };
    let stable = [10, 30].map(|soft| relaxed(&veins(soft, wind), &options).stable());
    assert_eq!(stable, [Some(true), None]);
}
