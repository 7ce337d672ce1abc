//! Branches of nearly rigid rods between holders: their forces, and where they buckle.

use leafdyn_testing::branch::{changes_at, follow};
use leafdyn_testing::*;

fn wire(slenderness: f64) -> String {
    format!(
        r#"
        leaf = {{ rods = 1, length = 1.0, fan = [0.0] }}
        tip = {{ held = "pinned", position = [1.0, 0.0, 0.0] }}
        section = {{ shape = "circle", diameter = {:?}, young = 1e9 }}
        "#,
        1.0 / slenderness
    )
}

/// Stretched, a wire of any slenderness carries its stiffness times its strain at every point.
#[test]
fn a_stretched_wire_carries_its_strain() {
    for slenderness in [790.0, 800.0, 1000.0, 2600.0, 1e5] {
        let found = follow(&wire(slenderness), "", "tip.position[0]=1.0..1.002", false);
        assert!(
            found.complete,
            "{slenderness}: {:?}",
            found.branches[0].remarks
        );
        let stiffness = 0.25e9 * PI / slenderness.powi(2);
        for point in &found.branches[0].points {
            let right = -stiffness * (point.value - 1.0);
            let force = point.reaction.expect("the tip is held").x;
            assert!(
                (force - right).abs() <= 1e-9 * stiffness * 2e-3,
                "{slenderness}, {}: {force} for {right}",
                point.value
            );
            assert_eq!(point.index, 0, "{slenderness}, {}", point.value);
        }
    }
}

/// Compressed, it buckles where P (1 - P/EA) = 20.190728556 EI/L^2 (E. Reissner, 1972), in both
/// planes at once.
#[test]
fn a_compressed_wire_buckles() {
    for slenderness in [500.0_f64, 1000.0, 5000.0] {
        let squared = slenderness.powi(-2);
        // Of a circle EI/(EA L^2) = (d/L)^2/16; shear is as soft as Poisson's ratio says.
        let shear = 1.0 / (0.9 / 2.6);
        let euler = 20.190728556426627 * squared / 16.0;
        let mut strain = euler;
        for _ in 0..20 {
            strain = euler / (1.0 - strain + shear * strain);
        }
        let range = format!("tip.position[0]=1.0..{:?}", 1.0 - 2.0 * euler);
        let found = follow(&wire(slenderness), "", &range, false);
        let critical = 1.0 - strain;
        changes_at("a wire", &found, &[(critical, 2)], 1e-3 * euler);
    }
}
