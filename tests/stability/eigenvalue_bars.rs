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

/// A pointed blade of two veins, of which stiff tissue ties the margins.
const POINTED: &str = r#"
    name = "pointed"
    leaf = { rods = 2, elevation = 0.887 }
    blade = { length = 25.0, thickness = 0.028, young = 5e4, young_across = 3.4e4, mass_density = 8e-6, poisson = 0.36, width = { at = [0.0, 0.3, 0.7, 1.0], value = [1.23, 1.59, 1.72, 0.56] } }
    load = { g = [0.0, 0.0, -981.0] }
"#;

/// Eigenvalues of a blade with the shapes of its modes, and their bars.
fn of_shapes(blade: &Scenario, tolerance: f64) -> Vec<(f64, f64)> {
    let mut options = with_modes(3, to(tolerance));
    options.mode_shapes = true;
    listed(&settled(blade, &options))
}

/// Eigenvalues of blades at tolerances from 1e-3 to 1e-8 agree within their bars, which follow the tolerance: nothing scatters,
/// however stiff the tissue is, and in the median bars are at most 30 times the differences.
#[test]
fn bars_of_blades_follow_the_tolerance() {
    let blades = [
        (scenario("measured/blade", ""), [1e-4, 5e-5, 1e-7]),
        (scenario("study/plate", ""), [5e-5, 5e-5, 5e-8]),
        (parse(POINTED), [1e-4, 1e-6, 5e-8]),
    ];
    let mut ratios = Vec::new();
    for (blade, largest) in blades {
        let found = [1e-3, 1e-5, 1e-8].map(|tolerance| of_shapes(&blade, tolerance));
        for (eigenvalues, largest) in found.iter().zip(largest) {
            for (value, bar) in eigenvalues {
                assert!(
                    *bar < largest * value,
                    "{}: {value} within {bar:e}",
                    blade.name
                );
            }
        }
        for (one, other) in [(0, 1), (0, 2), (1, 2)] {
            for ((value, bar), (again, its_bar)) in found[one].iter().zip(&found[other]) {
                let apart = (value - again).abs();
                let told = bar + its_bar;
                ratios.push(told / apart);
                assert!(
                    apart <= told,
                    "{}: {value} within {told:e}: {apart:e}",
                    blade.name
                );
            }
        }
    }
    ratios.sort_by(f64::total_cmp);
    let median = ratios[ratios.len() / 2];
    assert!(median < 30.0, "{median}");
}

/// Of blades whose lengths differ by less than anyone can measure eigenvalues differ as much: by minus four times that, and not
/// by rounding of the forces in their tissue.
#[test]
fn eigenvalues_of_blades_that_hardly_differ_hardly_differ() {
    for length in [25.0 + 1e-11, 25.0 - 5e-11, 25.0 + 1e-9] {
        let found = [25.0, length].map(|length| {
            let blade = scenario("measured/blade", &format!("blade.length={length:?}"));
            of_shapes(&blade, 1e-6)
        });
        for ((value, _), (again, _)) in found[0].iter().zip(&found[1]) {
            let apart = (value - again).abs() / value;
            let longer = (length - 25.0_f64).abs() / 25.0;
            assert!(apart < 10.0 * longer + 1e-10, "{length}: {value} {apart:e}");
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
