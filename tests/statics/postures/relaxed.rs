//! The index of a posture is that of the leaf relaxed from there, on both sides of each rung of its ladder.

use super::*;
use leafdyn::posture::leaf::{rest_scenario, with_level_base};
use leafdyn::relax::{Options, SemiImplicit, relax_from};
use leafdyn_testing::asked;

/// The index of the leaf that rests in the posture at a modulus, and how far it is from there.
fn relaxed(scenario: &Scenario, found: &Posture, young: f64) -> (Option<usize>, f64) {
    let stations = found.stations(false);
    let of = ScenarioRod::new(scenario).unwrap();
    let rest = rest_scenario(scenario, &of, found, &stations, young);
    let options = Options {
        method: SemiImplicit {
            keep_unstable: true,
            ..SemiImplicit::default()
        }
        .into(),
        ..Options::default()
    };
    let (at, rods) = stations.to_shape();
    let leaf = relax_from(&rest, (&at, &rods), &options, &mut |_| {}).unwrap();
    let tip = stations.ends.last().unwrap().position;
    (
        leaf.stability.negative_eigenvalues,
        leaf.tips[0].distance(tip) / stations.length,
    )
}

const LOADS: &str =
    "gravity = [0.0, 0.0, -1.0], point = [{ vein = 1, at = 0.6, force = [0.0, 0.0, -0.5] }]";

/// Compares the index on both sides of the first rungs of a leaf under these loads, and returns how many leaves rest in
/// the posture: where another equilibrium crosses it at the rung, a leaf may come to rest in that one, nearby.
pub fn compare(
    draw: &mut Draw,
    spatial: bool,
    stiffness: [&str; 3],
    loads: &str,
    rungs: usize,
) -> usize {
    let leaf = scenario(stiffness, loads);
    let plane = (!spatial).then_some(DVec3::Y);
    let found = posture(&leaf, Twin::draw(draw, spatial, 1.3).curve(), plane);
    let ladder = found.ladder();
    let mut compared = 0;
    for (k, &rung) in ladder.iter().take(rungs).enumerate() {
        let near = ladder
            .iter()
            .filter(|other| (*other / rung - 1.0).abs() < 0.02);
        if near.count() > 1 {
            continue;
        }
        for (young, index) in [(1.01 * rung, k), (0.99 * rung, k + 1)] {
            assert_eq!(found.index(young), index);
            let (counted, off) = relaxed(&leaf, &found, young);
            if off < 1e-3 {
                assert_eq!(counted, Some(index), "at {young} of {ladder:?}");
                compared += 1;
            }
        }
    }
    compared
}

/// How many comparisons are made of so many leaves, four each, of which `LEAFDYN_POSTURES` says another number: most, as
/// few leaves come to rest in another equilibrium than the posture.
fn compare_many(otherwise: usize, seed: u64, kinds: &[(bool, [&str; 3])]) {
    let leaves = asked("LEAFDYN_POSTURES", otherwise);
    let mut draw = Draw(seed);
    let compared = |k: usize, draw: &mut Draw| {
        let (spatial, stiffness) = kinds[k % kinds.len()];
        compare(draw, spatial, stiffness, LOADS, 2)
    };
    let compared: usize = (0..leaves).map(|k| compared(k, &mut draw)).sum();
    println!("{compared} comparisons of {leaves} leaves");
    assert!(
        20 * compared >= 19 * 4 * leaves,
        "{compared} of {leaves} leaves"
    );
}

#[test]
fn in_the_plane_and_out_of_it() {
    let kinds = [["0.7", "1.0", "1.0"], ["0.1", "1.0", "3.0"]];
    compare_many(12, 21, &kinds.map(|stiffness| (false, stiffness)));
}

#[test]
fn in_space() {
    compare_many(8, 22, &[(true, ["0.7", "1.0", "1.0"])]);
}

/// The scenario that rests in a posture keeps the section, with its moduli at E, and what else was given of the leaf.
#[test]
fn sections_stay_sections() {
    for (material, shear, meaning) in [
        (
            "young = 2e3, poisson = 0.2",
            "poisson = 0.2",
            "young = 6000",
        ),
        (
            "young = 2e3, shear_modulus = 500.0",
            "shear_modulus = 1500",
            "young = 6000",
        ),
        (
            "young = { at = [0.0, 1.0], value = [2e3, 1e3] }",
            "poisson",
            "value = [6000.0, 3000.0]",
        ),
    ] {
        let leaf = parse(&format!(
            r#"
            name = "kept"
            leaf = {{ rods = 1, length = 1.3, fan = [0.0] }}
            section = {{ shape = "rectangle", width = {{ at = [0.0, 1.0], value = [0.2, 0.1] }}, thickness = 0.1, mass_density = 20.0, {material} }}
            load.g = [0.0, 0.0, -1.0]
            dynamics = {{ internal_damping = 0.01, tip_force = {{ at = [0.0, 1.0], value = [[0.0, 0.0, 0.0], [0.0, 0.0, -0.1]] }} }}
            photo = {{ scale = 0.01, x = 300.0, y = 200.0 }}
            "#
        ));
        let found = posture(
            &leaf,
            Twin::draw(&mut Draw(8), false, 1.3).curve(),
            Some(DVec3::Y),
        );
        let of = ScenarioRod::new(&leaf).unwrap();
        let rest = rest_scenario(&leaf, &of, &found, &found.stations(false), 3.0 * of.young);
        let written = with_level_base(&rest).to_toml();
        for part in [
            "[section]",
            "shape = \"rectangle\"",
            shear,
            meaning,
            "mass_density = 20",
            "[photo]",
        ] {
            assert!(written.contains(part), "{part}: {written}");
        }
        assert!(!written.contains("[stiffness]"), "{written}");
        let back = parse(&written);
        assert_eq!(back.rods, rest.rods);
        assert_eq!(back.dynamics, rest.dynamics);
        assert_eq!(back.dynamics.tip_force, leaf.dynamics.tip_force);
        // A2 at the base: E w t^3/12.
        let bending = 6e3 * 0.2 * 0.1_f64.powi(3) / 12.0;
        assert!((back.rods[0].couple_stiffness[1].at(0.0) / bending - 1.0).abs() < 1e-12);
        if rest.young(0).is_some() {
            assert_eq!(back.young(0), Some(6e3));
        }
    }
}

/// The leaf whose blade is turned where the normals say so: the same as its scenario in a lab that is turned.
#[test]
fn a_blade_with_measured_normals() {
    let leaf = scenario(["0.2", "1.0", "0.3"], "gravity = [0.0, 0.0, -1.0]");
    let twin = Twin::draw(&mut Draw(5), true, 1.0);
    let positions: Vec<DVec3> = (0..60)
        .map(|k| twin.position(f64::from(k) / 59.0))
        .collect();
    let normals = (0..60).map(|k| {
        let s = f64::from(k) / 59.0;
        let [tangent, _] = twin.tangent(s);
        let side = DVec3::Z.cross(tangent).normalize();
        let up = tangent.cross(side);
        (0.4 + 0.8 * s).cos() * up + (0.4 + 0.8 * s).sin() * side
    });
    let points = leafdyn::posture::points::PosturePoints {
        normals: Some(normals.collect()),
        ..leafdyn::posture::points::PosturePoints::in_space(positions)
    };
    let found = Posture::from_points(hanging(&leaf), &points, None).unwrap();
    assert!(
        (found.base.roll.abs() - 0.4).abs() < 1e-2,
        "{}",
        found.base.roll
    );
    let rung = found.critical_young();
    for (young, index) in [(1.02 * rung, 0), (0.98 * rung, 1)] {
        let (counted, off) = relaxed(&leaf, &found, young);
        assert!(off < 1e-3, "{off}");
        assert_eq!(counted, Some(index));
    }
    let stations = found.stations(false);
    let of = ScenarioRod::new(&leaf).unwrap();
    let rest = rest_scenario(&leaf, &of, &found, &stations, 1.5 * rung);
    let level = with_level_base(&rest);
    let back = parse(&level.to_toml());
    assert_eq!(back.rods, level.rods);
    assert_eq!(back.gravity, level.gravity);
    let sharp = |leaf: &Scenario| leaf.relaxation().tolerance(1e-9).run().unwrap();
    let (one, other) = (sharp(&rest), sharp(&back));
    // Both labs differ by a turn about the base.
    let base = DVec3::from_array(level.rods[0].base);
    let reach = |leaf: &leafdyn::relax::Equilibrium| leaf.tips[0].distance(base);
    assert!(
        (reach(&one) - reach(&other)).abs() < 1e-8,
        "{} {}",
        reach(&one),
        reach(&other)
    );
}
