//! The leaves of `leafdyn_testing::real` are what they are said to be, and each is the
//! same leaf in every form.

use leafdyn::scenario::Rod;
use leafdyn_testing::real;
use leafdyn_testing::*;

const LEAVES: u64 = 500;

fn bending(rod: &Rod) -> [f64; 2] {
    [1, 2].map(|axis| rod.couple_stiffness[axis].at(0.5))
}

/// What has no unit: weight in A/L^3, coupling in A/L^4, the angle by which a vein
/// is curved, and the stiffnesses in A and A/L^2.
fn numbers(leaf: &Scenario) -> Vec<f64> {
    let unit = leaf.scale();
    let (length, stiffness) = (unit.length, unit.stiffness);
    let mut all = vec![
        -leaf.gravity[2] * length.powi(3) / stiffness,
        leaf.coupling[0][1] * length.powi(4) / stiffness,
        leaf.rods[0].rest_curvature[1].at(0.5) * length,
    ];
    for rod in &leaf.rods {
        all.extend([0.0, 0.4, 1.0].map(|at| rod.couple_stiffness[0].at(at) / stiffness));
        let force = rod.force_stiffness.each_ref();
        all.extend(force.map(|force| force.at(0.0) * length * length / stiffness));
        all.push(rod.angle);
    }
    all
}

#[test]
fn they_are_those_of_a_laboratory() {
    let leaves: Vec<Scenario> = (0..LEAVES).map(|seed| parse(&real::leaf(seed))).collect();
    for leaf in &leaves {
        let name = &leaf.name;
        assert!(leaf.joined && (3..=21).contains(&leaf.rods.len()), "{name}");
        let [weight, coupling, curved] = numbers(leaf)[..3] else {
            panic!("{name}: three numbers");
        };
        // Entries are rounded to four digits.
        assert!(weight > 0.2998 && weight < 30.02, "{name}: {weight}");
        assert!(coupling > 0.2998 && coupling < 300.2, "{name}: {coupling}");
        assert!(curved > -0.5005 && curved < 1.5009, "{name}: {curved}");
        for gap in &leaf.coupling {
            assert_eq!((gap[0], gap[1]), (0.0, gap[2]), "{name}");
        }
        for (rod, mirrored) in leaf.rods.iter().zip(leaf.rods.iter().rev()) {
            assert!((5.0..=60.0).contains(&rod.length), "{name}");
            assert_eq!(rod.angle, -mirrored.angle, "{name}");
            assert!(rod.angle.abs() <= 1.0, "{name}");
        }
    }
    let part = |which: fn(&Scenario) -> bool| {
        leaves.iter().filter(|leaf| which(leaf)).count() as f64 / LEAVES as f64
    };
    // Within three standard deviations.
    let curved = part(|leaf| leaf.rods[0].rest_curvature[1].at(0.5) != 0.0);
    close("curved at rest", curved, 0.6, 0.066);
    let round = part(|leaf| bending(&leaf.rods[0])[0] == bending(&leaf.rods[0])[1]);
    close("round", round, 0.5, 0.067);
    for rods in 3..=21 {
        assert!(leaves.iter().any(|leaf| leaf.rods.len() == rods), "{rods}");
    }
}

#[test]
fn in_other_units_they_are_the_same() {
    for seed in 0..LEAVES {
        let here = parse(&real::leaf(seed));
        for (text, length) in [
            (real::in_metres(seed), 1e-2),
            (real::in_millimetres(seed), 10.0),
        ] {
            let there = parse(&text);
            assert_ne!(there.units, here.units);
            close(
                "length",
                there.rods[0].length,
                length * here.rods[0].length,
                1e-11,
            );
            for (a, b) in numbers(&here).into_iter().zip(numbers(&there)) {
                close(&format!("real-{seed}"), a, b, 1e-13 * b.abs());
            }
        }
    }
}

#[test]
fn numbered_backwards_they_are_the_same() {
    for seed in 0..LEAVES {
        let here = parse(&real::leaf(seed));
        let mut there = parse(&real::backwards(seed));
        assert_ne!(here.rods, there.rods);
        there.rods.reverse();
        there.coupling.reverse();
        assert_eq!(here, there);
    }
}
