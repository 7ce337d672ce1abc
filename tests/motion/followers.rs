//! Loads that turn with the section, and moments along veins, while a leaf moves.

use leafdyn::simulate;
use leafdyn_testing::motion::*;
use leafdyn_testing::*;

const LOADS: &str = r#"
    [load]
    gravity = [0.0, 0.0, -0.5]
    follower = [0.3, 0.6, 0.9]
    couple = [0.4, -0.3, 0.5]
    [[load.point]]
    vein = 1
    at = 1.0
    force = [0.5, 0.4, -0.7]
    moment = [0.3, -0.2, 0.4]
    mass = 0.2
    follows = true
"#;

const ROD: &str = r#"
    name = "rod"
    leaf = { rods = 1, length = 1.0, fan = [0.1] }
    stiffness = { torsion = 0.9, bending_2 = 1.2, bending_3 = 0.8, axial = 90.0, shear_2 = 60.0, shear_3 = 70.0 }
"#;

const VEINS: &str = r#"
    name = "veins"
    leaf = { rods = 2, length = 1.0, fan = "symmetric" }
    stiffness = { torsion = 0.9, bending_2 = 1.2, bending_3 = 0.8, axial = 90.0, shear_2 = 60.0, shear_3 = 70.0 }
    coupling = { x = 1.0, y = 2.0, z = 1.5 }
"#;

fn loaded(leaf: &str, damping: f64, duration: f64) -> Scenario {
    parse(&format!(
        "{leaf}\ndynamics = {{ density = 1.0, rotary_inertia = 0.01, external_damping = {damping:?}, duration = {duration:?} }}\n{LOADS}"
    ))
}

/// A damped leaf that is let go comes to the rest that relaxation finds.
#[test]
fn damped_motions_end_where_relaxation_does() {
    for leaf in [ROD, VEINS] {
        let scenario = loaded(leaf, 4.0, 24.0);
        let rest = settled(&scenario, &iterated(1e-12, 8));
        for scheme in BOTH {
            let options = simulate::Options {
                step: Some(2e-3),
                ..moving(scheme, Some(8))
            };
            let end = run(&scenario, &options).positions;
            for (found, node) in end.iter().zip(nodes(&rest.shape.rods)) {
                let off = found.distance(node.position);
                assert!(off < 1e-8, "{scheme:?}: {off:e}");
            }
        }
    }
}

/// The work of the loads is told: without damping the balance of energy deviates by an error of second
/// order in the step.
#[test]
fn their_work_is_in_the_balance_of_energy() {
    for text in [ROD, VEINS] {
        let scenario = loaded(text, 0.0, 1.0);
        let leaf = Leaf::new(&scenario);
        let state = rest(&scenario.unloaded(), 4);
        for scheme in BOTH {
            let deviations = [1e-3, 5e-4].map(|h| {
                let mut method = method(scheme, &leaf, &state, h);
                let start = method.snapshot().energy.balance();
                let mut at = |k: usize| {
                    method.advance(0.02 * k as f64).unwrap();
                    let energy = method.snapshot().energy;
                    assert!(k < 40 || energy.work.abs() > 0.1, "{}", energy.work);
                    (energy.balance() - start).abs()
                };
                largest((1..=50).map(&mut at))
            });
            let order = order(deviations[0], deviations[1]);
            close(&format!("order, {scheme:?}"), order, 2.0, 0.1);
        }
    }
}
