//! A leaf from which the errors told were taken off is that of the boundary-value problem,
//! on few grids.

mod common;

use common::{scenario, to};
use leafdyn::relax::{Equilibrium, Method, Options, relax};
use leafdyn::scenario::Scenario;
use leafdyn::shape::{Difference, NodeState, RodShape};

const TOLERANCE: f64 = 1e-9;

fn found(leaf: &Scenario, options: &Options) -> Equilibrium {
    let found = relax(leaf, options, &mut |_| {}).unwrap();
    assert!(
        found.outcome.is_at_rest(),
        "{}: {:?}",
        leaf.name,
        found.remark
    );
    found
}

/// Half a leaf and whole ones, with a midrib and without, rods that are rigid in stretch and
/// shear, a single one: all stations, forces and the energy are those of shooting.
#[test]
fn two_or_three_coarse_grids_tell_what_shooting_does() {
    for (name, overrides) in [
        ("paper/fig04", "leaf.rods=5"),
        ("paper/fig04", "leaf.rods=6"),
        ("paper/fig04", "leaf.rods=5; load.tip_force=[0.0, 0.3, 0.0]"),
        ("paper/fig05", "leaf.rods=5"),
        ("classic/lens_30", ""),
        ("classic/cantilever_heavy", ""),
        ("classic/lens_60", ""),
        ("classic/fan_5", ""),
    ] {
        let leaf = scenario(name, overrides);
        let what = format!("{name} {overrides}");
        let corrected = found(&leaf, &to(TOLERANCE));
        let segments = &corrected.accuracy.segments;
        assert!(*segments.last().unwrap() <= 16, "{what}: {segments:?}");
        let shot = Options {
            method: Method::ShootingFromRest { intervals: None },
            ..to(1e-11)
        };
        let shot = found(&leaf, &shot);
        let bar = corrected.accuracy.error_estimate.unwrap();
        let off = common::distance(&corrected, &shot);
        let uncertain = shot.accuracy.error_estimate.unwrap();
        println!("{what}: {segments:?}, off {off:.1e}, bar {bar:.1e}");
        assert!(off <= bar + uncertain, "{what}: {off:e} for {bar:e}");
        for (a, b) in corrected.shape.rods.iter().zip(&shot.shape.rods) {
            for (a, b) in [(&a.nodes[0], &b.nodes[0]), (tip(a), tip(b))] {
                let Difference {
                    rotation,
                    force,
                    moment,
                    ..
                } = Difference::of(a, b);
                let others = rotation.max(force).max(moment);
                assert!(others <= 50.0 * TOLERANCE, "{what}: {others:e}");
            }
        }
        let [a, b] = [&corrected, &shot].map(|leaf| leaf.energy.unwrap());
        println!("energy off by {:.1e}", a - b);
        assert!(
            (a - b).abs() <= 0.1 * TOLERANCE * a.abs().max(1.0),
            "{what}: {a} for {b}"
        );
    }
}

fn tip(rod: &RodShape) -> &NodeState {
    &rod.nodes[rod.nodes.len() - 1]
}
