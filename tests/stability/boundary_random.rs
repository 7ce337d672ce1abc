//! Boundaries of random leaves over random pairs of numbers: a trace through a curve, at
//! its second number, has a critical point where the curve is, within what both state.
//! `LEAFDYN_BOUNDARIES` is how many leaves are tried.

use leafdyn::study::BoundaryRemark;
use leafdyn_testing::branch::{follow, text};
use leafdyn_testing::plane::followed;
use leafdyn_testing::random::Draw;
use leafdyn_testing::*;
use rayon::prelude::*;

/// Leaves, unless the environment asks for more.
const LEAVES: usize = 6;

/// Places at which a curve is crossed.
const PLACES: usize = 3;

struct Case {
    text: String,
    overrides: String,
    along: &'static str,
    across: String,
}

/// A random leaf that loses its stability along the first number, and the second.
fn case(number: usize) -> Case {
    let mut draw = Draw(1000 * number as u64 + 7);
    let torsion = draw.uniform(0.6, 1.5);
    let [axial, shear_2, shear_3] = [(); 3].map(|_| draw.uniform(200.0, 3000.0));
    let stiffness = format!(
        "stiffness.torsion={torsion:?}; stiffness.axial={axial:?}; \
         stiffness.shear_2={shear_2:?}; stiffness.shear_3={shear_3:?}"
    );
    let [low, high] = [draw.uniform(0.6, 0.9), draw.uniform(1.1, 1.6)];
    // A column, a strip on edge, a lens whose midrib grows, and a rod that hangs.
    let (text, more, along, keys, part) = match number % 4 {
        0 => (
            ROD.into(),
            format!("stiffness.bending_2={:?}", draw.uniform(3.0, 30.0)),
            "load.tip_force[0]=0..-6",
            "stiffness.bending_3 leaf.length scale:stiffness.axial load.gravity[0]",
            1.0,
        ),
        1 => (
            ROD.into(),
            format!("stiffness.bending_2={:?}", draw.uniform(10.0, 100.0)),
            "load.tip_force[2]=0..-7",
            "stiffness.bending_3 stiffness.torsion leaf.length load.gravity[2]",
            1.0,
        ),
        2 => (
            text("classic/lens_midrib"),
            format!(
                "leaf.length=[1.0, 0.9, 1.0]; coupling.z={:?}",
                draw.uniform(0.0, 2.0)
            ),
            "leaf.length[1]=0.88..0.97",
            "stiffness.torsion stiffness.bending_3 coupling.z scale:leaf.fan",
            0.7,
        ),
        _ => {
            let [low, high] = [draw.uniform(5.8, 5.95), draw.uniform(6.05, 6.2)];
            return Case {
                text: text("classic/hanging_curved"),
                overrides: "rest.bend_3=6.0".into(),
                along: "load.gravity[0]=8..14",
                across: format!("rest.bend_3={low:?}..{high:?}"),
            };
        }
    };
    let keys: Vec<&str> = keys.split(' ').collect();
    let key = keys[(draw.uniform(0.0, part) * keys.len() as f64) as usize];
    Case {
        text,
        overrides: format!("{stiffness}; {more}"),
        along,
        across: format!("{key}={low:?}..{high:?}"),
    }
}

/// What is wrong with the curves of a leaf, and how many places were crossed.
fn judged(number: usize) -> (usize, Vec<String>) {
    let case = case(number);
    let what = format!("{number}: {} over {}", case.along, case.across);
    let numbers = [case.along, case.across.as_str()];
    let found = match followed(1e-6, &case.text, &case.overrides, numbers) {
        Ok(found) => found,
        Err(error) => return (0, vec![format!("{what}: {error}")]),
    };
    // Some leaves stay stable all along, and say so.
    if found.curves.is_empty() {
        let remark = found.remark;
        let stays = matches!(remark, Some(BoundaryRemark::NoIndexChange { .. }));
        let wrong = (!stays).then(|| format!("{what}: {remark:?}"));
        return (0, wrong.into_iter().collect());
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
            let traced = follow(&case.text, &bent, case.along, false);
            let critical = traced
                .branches
                .iter()
                .flat_map(|branch| branch.critical_points());
            let beyond = critical.map(|(_, critical)| {
                let stated = point.errors[0] + critical.value_error.unwrap_or(0.0);
                (critical.value - value).abs() - stated - 1e-12 * value.abs()
            });
            let off = beyond.fold(f64::INFINITY, f64::min);
            places += 1;
            let missed = format!("{what}: at {across} not at {value}, off by {off:.1e}");
            wrong.extend((off > 0.0).then_some(missed));
        }
    }
    (places, wrong)
}

#[test]
fn traces_cross_them_where_they_are() {
    let count = asked("LEAFDYN_BOUNDARIES", LEAVES);
    let all: Vec<_> = (0..count).into_par_iter().map(judged).collect();
    let places: usize = all.iter().map(|(places, _)| places).sum();
    let wrong: Vec<String> = all.into_iter().flat_map(|(_, wrong)| wrong).collect();
    println!("{places} places of {count} leaves");
    assert!(places >= 2 * count && wrong.is_empty(), "{wrong:#?}");
}
