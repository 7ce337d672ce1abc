//! Error bars of eigenvalues where grids agree by chance.

use leafdyn_testing::*;

/// Five free veins, alike but for their directions: 8 and 16 segments have the same lowest
/// eigenvalue by chance, finer ones another.
#[test]
fn stated_errors_of_eigenvalues_hold_where_two_grids_agree_by_chance() {
    let veins = parse(
        r#"
        name = "veins"
        leaf = { rods = 5, length = 1.0, fan = "symmetric", joined = false }
        stiffness = { torsion = 0.2033947416268903, bending_2 = 4.808545867632984, bending_3 = 4.969890584714055, axial = 146.37479120614, shear_2 = 90.74834407230306, shear_3 = 129.32500440900228 }
        load = { gravity = [0.0, 1.881346956815874, -7.54210348151372] }
        coupling = { z = 33.099072052389936 }
        "#,
    );
    const LOWEST: f64 = 9.2012101107;
    for (tolerance, count) in [1e-2, 1e-4, 1e-5, 1e-6]
        .into_iter()
        .flat_map(|t| [(t, 1), (t, 3)])
    {
        let mut options = with_modes(count, to(tolerance));
        options.mode_shapes = true;
        let leaf = settled(&veins, &options);
        let lowest = &leaf.stability.modes.as_ref().unwrap()[0];
        let (error, told) = ((lowest.eigenvalue - LOWEST).abs(), lowest.error.unwrap());
        assert!(
            error <= told + 1e-9,
            "{tolerance:e}, {count}: {error:e}, {told:e}"
        );
    }
}
