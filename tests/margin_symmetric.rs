//! Margins next to symmetric bifurcations: below its Euler load a column has no pass and
//! gives way where it must, beyond it the pass is the straight column, and its energy
//! vanishes like the square of the distance. On coarse grids these loads are larger.

mod common;

use std::f64::consts::PI;

use common::{RIGID, parse, rod};
use leafdyn::relax::{Loss, Margin, Options};
use leafdyn::scenario::Scenario;
use leafdyn::study::relax_with_margin;

const EULER: f64 = 0.25 * PI * PI;

/// Distances from the bifurcation, as parts of its load.
const PARTS: [f64; 5] = [0.1, 0.05, 0.02, 0.01, 0.005];

fn margin(scenario: &Scenario) -> Margin {
    let options = Options {
        tolerance: Some(1e-8),
        ..Options::default()
    };
    let leaf = relax_with_margin(scenario, &options, &mut |_| {}).unwrap();
    leaf.margin.unwrap()
}

/// A clamped strip, or a round column, under a load along it.
fn column(load: f64, round: bool) -> Scenario {
    let other = if round { 1.0 } else { 50.0 };
    rod(&format!(
        "{RIGID}; stiffness.bending_2={other:?}; load.tip_force=[{:?}, 0, 0]",
        -load
    ))
}

#[test]
fn below_its_load_a_column_gives_way_at_what_is_left_of_it() {
    for (round, part) in PARTS
        .into_iter()
        .flat_map(|it| [(false, it), (true, it)])
        .skip(1)
        .step_by(3)
    {
        let found = margin(&column((1.0 - part) * EULER, round));
        let least = &found.pushes[0];
        let (force, error) = (least.force.unwrap(), least.error.unwrap());
        println!(
            "{part}: {force} within {error:.1e}, off by {:.1e}",
            force - part * EULER
        );
        assert_eq!(
            (least.direction.to_string().as_str(), least.kind),
            ("-x", Loss::BranchPoint)
        );
        assert!((force - part * EULER).abs() <= error && error < 1e-4 * force);
        assert!(found.barrier.is_none(), "{found:?}");
    }
}

/// Complete elliptic integrals K and E, by the arithmetic-geometric mean.
fn elliptic(k: f64) -> [f64; 2] {
    let (mut a, mut b, mut c) = (1.0, (1.0 - k * k).sqrt(), k);
    let (mut sum, mut power) = (0.5 * c * c, 1.0);
    while c > 1e-16 {
        (a, b, c) = (0.5 * (a + b), (a * b).sqrt(), 0.5 * (a - b));
        sum += power * c * c;
        power *= 2.0;
    }
    let first = 0.5 * PI / a;
    [first, first * (1.0 - sum)]
}

/// The energy of the straight column above that of the elastica under a load P: with the sine
/// k of half of its tip's angle K(k) = sqrt P, its tip is at 2 E/K - 1, and the first integral
/// theta'^2 = 2 P (cos theta - cos alpha) makes the difference P (4 - 2 k^2 - 4 E/K).
fn barrier(load: f64) -> f64 {
    let (mut low, mut high) = (0.0, 0.99);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        match elliptic(middle)[0] < load.sqrt() {
            true => low = middle,
            false => high = middle,
        }
    }
    let [first, second] = elliptic(low);
    load * (4.0 - 2.0 * low * low - 4.0 * second / first)
}

#[test]
fn beyond_its_load_the_barrier_of_a_strip_is_that_of_the_elastica() {
    for part in PARTS {
        let load = (1.0 + part) * EULER;
        let found = margin(&column(load, false)).barrier;
        let found = found.unwrap_or_else(|| panic!("{part}"));
        let (energy, error, right) = (found.energy, found.error.unwrap(), barrier(load));
        println!(
            "{part}: {energy} within {error:.1e}, off by {:.1e}",
            energy - right
        );
        // The closed form is a difference of numbers of the order of the load.
        assert!((energy - right).abs() <= error + 1e-14 * load);
        assert!(error < 1e-6 * energy);
        assert!((found.saddle.tip.x - 1.0).abs() < 1e-9);
    }
}

/// A round one can be turned without a force.
#[test]
fn a_buckled_round_column_has_no_margin() {
    let found = margin(&column(1.02 * EULER, true));
    assert!(found.barrier.is_none() && found.pushes.is_empty());
    assert!(found.remark.unwrap().contains("cannot be told from zero"));
}

/// Axial stiffness, and the load under which a column that is clamped at both ends buckles:
/// P (1 - P/H) = 4 pi^2.
const AXIAL: f64 = 1000.0;

fn shortened(beyond: f64) -> Scenario {
    let load = 0.5 * AXIAL * (1.0 - (1.0 - 16.0 * PI * PI / AXIAL).sqrt());
    let tip = 1.0 - (1.0 + beyond) * load / AXIAL;
    parse(&format!(
        r#"
        name = "column"
        leaf = {{ rods = 1, length = 1.0, fan = [0.0] }}
        stiffness = {{ torsion = 50.0, bending_2 = 50.0, bending_3 = 1.0, axial = {AXIAL:?}, shear_2 = inf, shear_3 = inf }}
        tip = {{ held = "clamped", position = [{tip:?}, 0.0, 0.0] }}
        "#
    ))
}

/// Held at both ends, from 10 to 0.5 % beyond: H/2 times the square of the strain beyond, but
/// for terms of the next order.
#[test]
fn a_column_that_is_shortened_has_a_barrier() {
    for beyond in [-0.02, -0.005] {
        let found = margin(&shortened(beyond));
        assert!(found.barrier.is_none(), "{beyond}: {found:?}");
        assert!(found.remark.unwrap().contains("the tip is held"));
    }
    let relative = [0.1, 0.05, 0.02, 0.01, 0.005].map(|beyond| {
        let found = margin(&shortened(beyond)).barrier;
        found.unwrap_or_else(|| panic!("{beyond}")).energy / (beyond * beyond)
    });
    println!("{relative:?}");
    for pair in relative.windows(2) {
        assert!((pair[0] / pair[1] - 1.0).abs() < 0.01, "{relative:?}");
    }
}
