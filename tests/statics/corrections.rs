//! A leaf from which the errors told were taken off is that of the boundary-value problem,
//! on few grids.

use leafdyn_testing::*;

/// To the first two the errors on a grid of 4 or 8 segments alone are taken off.
const TOLERANCES: [f64; 3] = [1e-4, 1e-6, 1e-9];

fn found(leaf: &Scenario, options: &Options) -> Equilibrium {
    let found = relaxed(leaf, options);
    let what = format!("{}: {:?}", leaf.name, found.remark);
    assert!(found.outcome.is_at_rest(), "{what}");
    found
}

/// Half a leaf and whole ones, with a midrib and without, rods that are rigid in stretch and
/// shear, a single one: all stations, forces and the energy are those of shooting.
#[test]
fn one_coarse_grid_or_two_tell_what_shooting_does() {
    let mut alone = 0;
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
        let shooting = Method::ShootingFromRest { intervals: None };
        let shot = found(&leaf, &by(shooting, to(1e-11)));
        for tolerance in TOLERANCES {
            let corrected = found(&leaf, &to(tolerance));
            let segments = &corrected.accuracy.segments;
            assert!(*segments.last().unwrap() <= 16, "{what}: {segments:?}");
            alone += usize::from(segments.len() == 1);
            let (bar, uncertain) = (estimate(&corrected), estimate(&shot));
            let off = distance(&corrected, &shot);
            assert!(off <= bar + uncertain, "{what}: {off:e} for {bar:e}");
            for (a, b) in corrected.shape.rods.iter().zip(&shot.shape.rods) {
                let ends = [
                    a.nodes.first().zip(b.nodes.first()),
                    a.nodes.last().zip(b.nodes.last()),
                ];
                for (a, b) in ends.into_iter().flatten() {
                    let off = Difference::of(a, b);
                    let others = largest([off.rotation, off.force, off.moment]);
                    assert!(others <= 50.0 * tolerance, "{what}: {others:e}");
                }
            }
            let [a, b] = [&corrected, &shot].map(|leaf| leaf.energy.unwrap());
            close(&what, a, b, 0.1 * tolerance * a.abs().max(1.0));
        }
    }
    assert!(alone >= 8, "{alone}");
}
