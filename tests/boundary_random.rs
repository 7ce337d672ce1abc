//! Boundaries of random leaves over random pairs of numbers: a trace through a curve, at
//! its second number, has a critical point where the curve is, within what both state.
//! `LEAFDYN_BOUNDARIES` is how many leaves are tried.

mod common;

use common::branch::text;
use common::random::splitmix64;
use common::{ROD, branch, entries};
use leafdyn::study::{Base, Boundary, BoundaryRequest, TraceRequest, boundary};
use rayon::prelude::*;

/// Leaves, unless the environment asks for more.
const LEAVES: u64 = 6;

/// Places at which a curve is crossed.
const PLACES: usize = 3;

struct Case {
    text: String,
    overrides: String,
    along: String,
    across: String,
}

/// A random leaf that loses its stability along the first number, and the second.
fn case(number: u64) -> Case {
    let mut state = 1000 * number + 7;
    let mut next = |low: f64, high: f64| low + (high - low) * splitmix64(&mut state);
    let stiffness = format!(
        "stiffness.torsion={:?}; stiffness.axial={:?}; stiffness.shear_2={:?}; stiffness.shear_3={:?}",
        next(0.6, 1.5),
        next(200.0, 3000.0),
        next(200.0, 3000.0),
        next(200.0, 3000.0),
    );
    let [low, high] = [next(0.6, 0.9), next(1.1, 1.6)];
    let one_of = |keys: &[&str], which: f64| {
        let key = keys[(which * keys.len() as f64) as usize];
        format!("{key}={low:?}..{high:?}")
    };
    let (text, more, along, across) = match number % 4 {
        // A column.
        0 => (
            ROD.into(),
            format!("stiffness.bending_2={:?}", next(3.0, 30.0)),
            "load.tip_force[0]=0..-6".into(),
            one_of(
                &[
                    "stiffness.bending_3",
                    "leaf.length",
                    "scale:stiffness.axial",
                    "load.gravity[0]",
                ],
                next(0.0, 1.0),
            ),
        ),
        // A strip on edge.
        1 => (
            ROD.into(),
            format!("stiffness.bending_2={:?}", next(10.0, 100.0)),
            "load.tip_force[2]=0..-7".into(),
            one_of(
                &[
                    "stiffness.bending_3",
                    "stiffness.torsion",
                    "leaf.length",
                    "load.gravity[2]",
                ],
                next(0.0, 1.0),
            ),
        ),
        // A lens whose midrib grows.
        2 => (
            text("classic/lens_midrib"),
            format!(
                "leaf.length=[1.0, 0.9, 1.0]; coupling.z={:?}",
                next(0.0, 2.0)
            ),
            "leaf.length[1]=0.88..0.97".into(),
            one_of(
                &[
                    "stiffness.torsion",
                    "stiffness.bending_3",
                    "coupling.z",
                    "scale:leaf.fan",
                ],
                next(0.0, 0.7),
            ),
        ),
        // A rod that hangs.
        _ => (
            text("classic/hanging_curved"),
            String::new(),
            "load.gravity[0]=8..14".into(),
            format!("rest.bend_3={:?}..{:?}", next(5.8, 5.95), next(6.05, 6.2)),
        ),
    };
    let overrides = match number % 4 {
        3 => "rest.bend_3=6.0".into(),
        _ => format!("{stiffness}; {more}"),
    };
    Case {
        text,
        overrides,
        along,
        across,
    }
}

fn follow(case: &Case) -> Result<Boundary, String> {
    let base = Base::of_text(
        case.text.clone(),
        "test.toml".into(),
        &entries(&case.overrides),
    );
    let request = BoundaryRequest {
        trace: TraceRequest {
            base: base.map_err(|error| error.to_string())?,
            vary: case.along.parse().unwrap(),
            switch: false,
            keep_unstable: true,
            segments: None,
            tolerance: Some(1e-6),
            most_points: 100,
            cross_section: None,
        },
        across: case.across.parse().unwrap(),
        map: None,
    };
    boundary(&request, &mut |_, _, _| {}).map_err(|error| error.to_string())
}

/// What is wrong with the curves of a leaf, and how many places were crossed.
fn judged(number: u64) -> (usize, Vec<String>) {
    let case = case(number);
    let what = format!("{number}: {} over {}", case.along, case.across);
    let found = match follow(&case) {
        Ok(found) => found,
        Err(error) => return (0, vec![format!("{what}: {error}")]),
    };
    // Some leaves stay stable all along, and say so.
    if found.curves.is_empty() {
        let remark = found.remark.unwrap_or_default();
        let wrong = !remark.contains("the index changes nowhere");
        return (
            0,
            wrong
                .then(|| format!("{what}: {remark}"))
                .into_iter()
                .collect(),
        );
    }
    let key = case.across.split('=').next().unwrap();
    let (mut places, mut wrong) = (0, Vec::new());
    for curve in &found.curves {
        let exact = curve.points.iter().filter(|point| point.errors[1] == 0.0);
        let points: Vec<_> = exact.collect();
        let stride = (points.len() / PLACES).max(1);
        for point in points.into_iter().step_by(stride).take(PLACES) {
            let [value, across] = point.values;
            let bent = format!("{}; {key}={across:?}", case.overrides);
            let traced = branch::follow(&case.text, &bent, &case.along, false);
            let critical = traced.branches.iter().flat_map(|branch| branch.critical());
            let off = critical
                .map(|(_, critical)| {
                    let stated = point.errors[0] + critical.value_error.unwrap_or(0.0);
                    (critical.value - value).abs() - stated - 1e-12 * value.abs()
                })
                .fold(f64::INFINITY, f64::min);
            places += 1;
            if off > 0.0 {
                wrong.push(format!(
                    "{what}: at {across} not at {value}, off by {off:.1e}"
                ));
            }
        }
    }
    (places, wrong)
}

#[test]
fn traces_cross_them_where_they_are() {
    let count = std::env::var("LEAFDYN_BOUNDARIES").ok();
    let count = count.map_or(LEAVES, |count| count.parse().unwrap());
    let all: Vec<_> = (0..count).into_par_iter().map(judged).collect();
    let places: usize = all.iter().map(|(places, _)| places).sum();
    let wrong: Vec<String> = all.into_iter().flat_map(|(_, wrong)| wrong).collect();
    println!("{places} places of {count} leaves");
    assert!(places as u64 >= 2 * count && wrong.is_empty(), "{wrong:#?}");
}
