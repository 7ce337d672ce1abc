//! Error bars of eigenvalues where grids agree by chance.

use leafdyn::relax::Mode;
use leafdyn::scenario::Scenario;
use leafdyn_testing::bench::figure;
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

/// Eigenvalues of Fig. 4 that are listed without their shapes have four digits by default, and
/// more where a smaller tolerance is asked for.
#[test]
fn listed_eigenvalues_have_four_digits() {
    let leaf = figure("fig04", 21);
    let exact = eigenvalues(&leaf, 1e-10);
    for (tolerance, wanted) in [(1e-4, 2e-4), (1e-6, 1e-4), (1e-8, 1e-6)] {
        for ((value, bar), (exact, _)) in eigenvalues(&leaf, tolerance).into_iter().zip(&exact) {
            assert!(bar < wanted * exact, "{tolerance:e}: {value} within {bar}");
            assert!(
                (value - exact).abs() <= bar + 1e-9 * exact,
                "{tolerance:e}: {value} within {bar}"
            );
        }
    }
}

/// Between two grips the leaf on a grid that is added for eigenvalues is held where it is natural
/// on that grid, not where coarser ones predict it.
#[test]
fn eigenvalues_between_grips_are_those_of_any_grids() {
    let rod = parse(
        r#"
        name = "rod"
        leaf = { rods = 1, length = 1.0, fan = [0.0] }
        stiffness = { torsion = 0.8, bending_2 = 1.0, bending_3 = 1.0, axial = 1000.0, shear_2 = 300.0, shear_3 = 300.0 }
        rest = { bend_2 = -2.0, bend_3 = -3.8 }
        grip = [{ vein = 1, at = 0.881 }, { vein = 1, at = 0.809 }]
        "#,
    );
    let exact = eigenvalues(&rod, 1e-10);
    for tolerance in [1e-4, 1e-6, 1e-7, 1e-8, 1e-9] {
        for ((value, bar), (exact, _)) in eigenvalues(&rod, tolerance).into_iter().zip(&exact) {
            let error = (value - exact).abs();
            assert!(
                error <= bar,
                "{tolerance:e}: {value} within {bar}: {error:e}"
            );
        }
    }
}

/// The softest modes of a nearly inextensible blade change with the forces that its stiff tissue carries, of which fine
/// grids have few digits: no grid is added on which bars become larger.
#[test]
fn bars_of_a_blade_end_before_rounding_does() {
    let blade = scenario("measured/blade", "");
    let [fine, rough] = [1e-6, 1e-4].map(|tolerance| {
        let mut options = with_modes(3, to(tolerance));
        options.mode_shapes = true;
        listed(&settled(&blade, &options))
    });
    for ((value, bar), (other, other_bar)) in fine.into_iter().zip(rough) {
        assert!(bar < 1e-4 * value, "{value} within {bar}");
        let apart = (value - other).abs();
        assert!(apart <= bar + other_bar, "{value} within {bar}: {apart:e}");
    }
}

/// Eigenvalues of blades whose lengths hardly differ scatter by what is out of balance in them: within the bars.
#[test]
fn bars_of_blades_cover_what_is_out_of_balance() {
    let found = [25.0, 25.000_000_01, 24.999_999_95].map(|length| {
        let blade = scenario("measured/blade", &format!("blade.length={length:?}"));
        let mut options = with_modes(3, to(1e-6));
        options.mode_shapes = true;
        listed(&settled(&blade, &options))
    });
    for (one, other) in [(0, 1), (0, 2), (1, 2)] {
        for ((value, bar), (again, its_bar)) in found[one].iter().zip(&found[other]) {
            let apart = (value - again).abs();
            assert!(apart <= bar + its_bar, "{value} within {bar:e}: {apart:e}");
        }
    }
}

/// The three lowest, as they are listed by default, and their bars.
fn eigenvalues(leaf: &Scenario, tolerance: f64) -> Vec<(f64, f64)> {
    listed(&settled(leaf, &with_modes(3, to(tolerance))))
}

fn listed(leaf: &Equilibrium) -> Vec<(f64, f64)> {
    let modes = leaf
        .stability
        .modes
        .as_ref()
        .expect("a small leaf has modes");
    let known = |mode: &Mode| {
        (
            mode.eigenvalue,
            mode.error.expect("there are several grids"),
        )
    };
    modes.iter().map(known).collect()
}
