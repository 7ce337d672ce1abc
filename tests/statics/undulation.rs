//! Waves and twist as numbers: of surfaces whose waves are known, and of the
//! paper's leaves.

use glam::{DMat3, DQuat};
use leafdyn::shape::{Handedness, Undulation, VeinUndulation};
use leafdyn_testing::*;

const SEGMENTS: usize = 64;

/// Five veins, one beside the other, through the given points.
fn sheet(point: impl Fn(f64, f64) -> DVec3) -> Vec<RodShape> {
    let node = |sigma: f64, across: f64| NodeState {
        position: point(sigma, across),
        rotation: DQuat::IDENTITY,
        v: DVec3::X,
        u: DVec3::ZERO,
        n: DVec3::ZERO,
        m: DVec3::ZERO,
    };
    let rod = |j: i32| {
        let along = stations().into_iter();
        let nodes = along.map(|sigma| node(sigma, 0.5 * f64::from(j) - 1.0));
        let (length, nodes) = (1.0, nodes.collect());
        RodShape { length, nodes }
    };
    (0..5).map(rod).collect()
}

fn stations() -> Vec<f64> {
    (0..=SEGMENTS).map(|i| i as f64 / SEGMENTS as f64).collect()
}

fn flat(sigma: f64, across: f64) -> DVec3 {
    // Wide in the middle, and one point at the base and at the tip.
    DVec3::new(sigma, 0.2 * across * (PI * sigma).sin(), 0.0)
}

fn measure(scenario: &Scenario, rods: &[RodShape]) -> Undulation {
    Undulation::at_stations(scenario, &stations(), rods, Some(1e-6))
}

/// The margins wave, the midrib does not.
fn wavy(waves: f64, height: f64) -> Vec<RodShape> {
    sheet(|sigma, across| {
        let up = height * across * across * (2.0 * PI * waves * sigma).sin();
        flat(sigma, across) + DVec3::Z * up
    })
}

#[test]
fn waves_of_a_sine_are_counted_and_measured() {
    let leaf = fig04(5);
    for waves in [1.0, 1.5, 2.0, 3.5] {
        for height in [0.005, 0.03] {
            let found = measure(&leaf, &wavy(waves, height));
            for vein in found.margins().unwrap() {
                assert_eq!(vein.waves(), waves, "{height}: {vein:?}");
                assert!((vein.amplitude / height - 1.0).abs() < 0.05, "{vein:?}");
                let length = vein.wavelength.unwrap() * waves;
                assert!((0.95..1.3).contains(&length), "{waves}, {height}: {length}");
            }
            let still = VeinUndulation {
                half_waves: 0,
                ..VeinUndulation::default()
            };
            assert_eq!(found.veins[2], still);
        }
    }
}

/// Half of the distance of an S, one wave of a sine, from its convex envelope: the envelope is the line from the origin
/// to where tan x = x, x = 4.4934, with the slope cos x = -0.21723, and the sine is farthest above it at 1.7898.
const HEIGHT_OF_AN_S: f64 = 0.68246;

#[test]
fn the_height_of_a_sine_is_its_amplitude_and_weighted_waves_are_its_waves() {
    let leaf = fig04(5);
    for (waves, part) in [(1.0, HEIGHT_OF_AN_S), (2.0, 1.0), (2.5, 1.0), (3.0, 1.0)] {
        // Its margins are straight seen from above.
        let rods = sheet(|sigma, across| {
            let up = 0.005 * across * across * (2.0 * PI * waves * sigma).sin();
            DVec3::new(sigma, 0.2 * across, up)
        });
        let found = measure(&leaf, &rods);
        for vein in found.margins().unwrap() {
            let height = vein.height / (0.005 * part);
            assert!((height - 1.0).abs() < 0.01, "{waves}: {height}");
            let counted = vein.weighted_waves / waves;
            assert!((counted - 1.0).abs() < 0.01, "{waves}: {counted}");
            assert_eq!(vein.height, found.height());
        }
        assert_eq!(
            (found.veins[2].height, found.veins[2].weighted_waves),
            (0.0, 0.0)
        );
    }
}

/// Largest distance of the nodes of two leaves.
fn largest_distance(one: &[RodShape], other: &[RodShape]) -> f64 {
    let nodes = one
        .iter()
        .zip(other)
        .flat_map(|(a, b)| a.nodes.iter().zip(&b.nodes));
    nodes
        .map(|(a, b)| a.position.distance(b.position))
        .fold(0.0, f64::max)
}

/// Beside a wave lies a straight tip, which is bent to one side or to the other: the last inflection comes, goes, and
/// slides along it. Height and weighted waves change no more than the leaf does.
#[test]
fn height_and_weighted_waves_are_continuous_where_an_inflection_slides() {
    let leaf = fig04(5);
    let bent = |tip: f64| {
        sheet(|sigma, across| {
            let wave = 0.02 * (4.0 * PI * sigma.min(0.5)).sin();
            let slope = 0.02 * 4.0 * PI * (sigma - 0.5).max(0.0);
            let over = tip * ((sigma - 0.5).max(0.0) / 0.5).powi(3);
            flat(sigma, across) + DVec3::Z * across * across * (wave + slope + over)
        })
    };
    let steps = 160;
    let tip = |k: i32| 0.02 * (2.0 * f64::from(k) / f64::from(steps) - 1.0);
    let margin = |rods: &[RodShape]| *measure(&leaf, rods).margin().unwrap();
    let mut largest_jump: f64 = 0.0;
    for k in 0..steps {
        let rods = [tip(k), tip(k + 1)].map(bent);
        let [before, after] = [margin(&rods[0]), margin(&rods[1])];
        let moved = largest_distance(&rods[0], &rods[1]);
        let change = (after.height - before.height).abs();
        assert!(change < 1.2 * moved, "{k}: {change}, {moved}");
        let counted = (after.weighted_waves - before.weighted_waves).abs();
        assert!(counted < 0.03, "{k}: {counted}");
        largest_jump = largest_jump.max((after.amplitude - before.amplitude).abs() / moved);
    }
    assert!(
        largest_jump > 3.0,
        "amplitudes did not jump: {largest_jump}"
    );
}

/// Along a sweep of the torsional stiffness the count of waves jumps from 2 to 1.5; height and weighted waves do not.
#[test]
fn the_height_of_an_undulating_leaf_follows_its_stiffness() {
    let margin = |torsion: f64| {
        let entries = format!("stiffness.torsion={torsion:?}");
        let leaf = settle(&scenario("study/undulation", &entries), 1e-4);
        *leaf.undulation.margin().unwrap()
    };
    let margins: Vec<VeinUndulation> = (0..5).map(|k| margin(2.0 + 0.25 * f64::from(k))).collect();
    assert_eq!((margins[0].waves(), margins[4].waves()), (2.0, 1.5));
    for pair in margins.windows(2) {
        let lower = pair[0].height - pair[1].height;
        let fewer = pair[0].weighted_waves - pair[1].weighted_waves;
        assert!((0.0..3e-3).contains(&lower), "{pair:?}");
        assert!((0.0..0.06).contains(&fewer), "{pair:?}");
    }
}

#[test]
fn droop_and_domes_are_no_waves() {
    let leaf = fig04(5);
    let droops: [fn(f64) -> f64; 3] = [
        |s| -0.3 * s * s * (6.0 - 4.0 * s + s * s) / 3.0,
        // A bend next to the clamp, as under tension.
        |s| -0.5 * (s - (1.0 - (-20.0 * s).exp()) / 20.0),
        |_| 0.0,
    ];
    for droop in droops {
        // Margins that arch the other way than they droop would be an S.
        for dome in [0.0, 0.03, 0.1] {
            let rods = sheet(|sigma, across| {
                let over = dome * across * across * (PI * sigma).sin();
                flat(sigma, across) + DVec3::Z * (droop(sigma) + over)
            });
            for vein in &measure(&leaf, &rods).veins {
                assert_eq!((vein.waves(), vein.amplitude), (0.0, 0.0), "{vein:?}");
                assert_eq!(vein.wavelength, None);
                assert!(
                    vein.height < 1e-12 && vein.weighted_waves < 1e-9,
                    "{vein:?}"
                );
            }
        }
    }
}

#[test]
fn what_is_below_the_noise_is_no_wave() {
    let leaf = fig04(5);
    let low = measure(&leaf, &wavy(2.0, 8e-4));
    assert_eq!(low.margin().unwrap().waves(), 0.0);
    let rods = wavy(2.0, 5e-3);
    let unsure = Undulation::at_stations(&leaf, &stations(), &rods, Some(2e-3));
    assert_eq!(unsure.margin().unwrap().waves(), 0.0);
    assert_eq!(measure(&leaf, &rods).margin().unwrap().waves(), 2.0);
}

#[test]
fn it_does_not_matter_where_the_leaf_lies_and_how_large_it_is() {
    let leaf = fig04(5);
    let rods = wavy(2.5, 0.02);
    let found = measure(&leaf, &rods);
    let turn = DMat3::from_quat(DQuat::from_scaled_axis(DVec3::new(0.3, -1.2, 2.0)));
    let mirror = DMat3::from_diagonal(DVec3::new(1.0, -1.0, 1.0));
    let (one, still) = (DMat3::IDENTITY, DVec3::ZERO);
    for (matrix, shift, scale, reversed) in [
        (turn, DVec3::new(5.0, -2.0, 1.0), 1.0, false),
        (mirror, still, 1.0, false),
        (one, still, 1.0, true),
        (one, still, 1e3, false),
    ] {
        let mut moved = rods.clone();
        for rod in &mut moved {
            rod.length *= scale;
            let places = rod.nodes.iter_mut().map(|node| &mut node.position);
            places.for_each(|x| *x = scale * (matrix * *x) + shift);
        }
        if reversed {
            moved.reverse();
        }
        let mut moved = measure(&leaf, &moved).veins;
        if reversed {
            moved.reverse();
        }
        for (a, b) in moved.iter().zip(&found.veins) {
            assert_eq!(a.half_waves, b.half_waves);
            assert!((a.amplitude - scale * b.amplitude).abs() < 1e-12);
            assert!((a.height - scale * b.height).abs() < 1e-12);
            assert!((a.weighted_waves - b.weighted_waves).abs() < 1e-9);
            let lengths = a.wavelength.zip(b.wavelength);
            assert!(lengths.is_none_or(|(a, b)| (a - scale * b).abs() < 1e-12));
        }
    }
}

#[test]
fn the_papers_smooth_leaves_do_not_wave() {
    for figure in ["fig04", "fig05", "fig06"] {
        let leaf = settle(&scenario(&format!("paper/{figure}"), "leaf.rods=5"), 1e-6);
        for vein in &leaf.undulation.veins {
            assert_eq!(vein.waves(), 0.0, "{figure}: {vein:?}");
        }
    }
}

/// A rod at rest is twisted by u0 L, and seen from the base turns as told.
#[test]
fn the_twist_of_a_rod_is_that_of_its_section() {
    for (twist, hand) in [
        (2.0, Handedness::Right),
        (-1.5, Handedness::Left),
        (0.0, Handedness::None),
    ] {
        let twisted = format!("leaf.length=2.0; leaf.fan=[0.4]; rest.twist={twist:?}");
        let leaf = settle(&rod(&twisted), 1e-9);
        assert!((leaf.undulation.twist() - 2.0 * twist).abs() < 1e-9);
        assert_eq!(leaf.undulation.hand(), hand);
    }
}

/// The mirror image of a leaf turns the other way, and a symmetric leaf has no
/// hand: its margins turn against each other.
#[test]
fn mirror_images_turn_the_other_way() {
    let leaf = |twist: f64| {
        let entries = format!("leaf.rods=5; leaf.fan='symmetric'; rest.twist={twist:?}");
        settle(&scenario("paper/fig13", &entries), 1e-8).undulation
    };
    let (one, other, none) = (leaf(0.7), leaf(-0.7), leaf(0.0));
    assert!((one.twist() + other.twist()).abs() < 1e-6);
    assert!(one.twist() > 0.1, "{}", one.twist());
    assert_eq!(
        (one.hand(), other.hand()),
        (Handedness::Right, Handedness::Left)
    );
    assert_eq!(none.hand(), Handedness::None);
    let [first, last] = none.margins().unwrap().map(|vein| vein.twist);
    assert!((first + last).abs() < 1e-6 && first.abs() > 0.1, "{first}");
}

/// The leaf of docs/undulation.md: what waves, and what does not.
#[test]
fn long_margins_on_a_stiff_midrib_wave_and_are_stable() {
    let relaxed = |entries: &str| settle(&scenario("study/undulation", entries), 1e-5);
    let leaf = relaxed("");
    assert_eq!(leaf.stable(), Some(true));
    let margin = leaf.undulation.margin().unwrap();
    assert_eq!(margin.waves(), 2.0);
    assert!(margin.amplitude > 0.05 && margin.tension < 0.0);
    assert!((margin.predicted_waves() - 2.0).abs() < 1.0, "{margin:?}");
    // Not without excess length, nor where the veins bend up and down as hard
    // as sideways.
    let stiff = "stiffness.bending_2=[1, 1, 1, 1, 1, 1000, 1, 1, 1, 1, 1]";
    for entry in ["rest.stretch=1.0", stiff] {
        let leaf = relaxed(entry);
        assert_eq!(leaf.stable(), Some(true), "{entry}");
        assert_eq!(leaf.undulation.margin().unwrap().waves(), 0.0, "{entry}");
    }
    // A soft midrib gives way, and the leaf folds up.
    let folded = relaxed("stiffness.bending_2=0.01; stiffness.bending_3=1.0");
    assert!(folded.tips[0].x < 0.1 && folded.tips[0].z.abs() > 0.5);
}

/// Without their weight the paper's soft leaves have a flat equilibrium: a
/// saddle, whose index no longer changes with the grid.
#[test]
fn the_papers_soft_leaves_are_saddles_when_flat() {
    for (figure, index) in [("fig08", 45), ("fig09", 6), ("fig10", 18)] {
        let entries = "leaf.rods=5; load.gravity=[0, 0, 0]";
        let flat = scenario(&format!("paper/{figure}"), entries);
        for segments in [160, 320] {
            let leaf = settle_on(&flat, segments, true);
            assert_eq!(leaf.stability.negative_eigenvalues, Some(index), "{figure}");
            assert!(leaf.tips[0].z.abs() < 1e-12);
        }
    }
}

/// Where the flat leaf has just lost its stability, it leaves that saddle on the grid on
/// which it is told, and is pushed no more than a few times.
#[test]
fn a_leaf_that_has_just_buckled_leaves_its_plane_soon() {
    for (bending, torsion) in [(0.27, 1.46), (0.15, 1.84), (0.37, 1.2)] {
        let overrides = leafdyn_testing::branch::weightless(bending, torsion);
        let leaf = settle(&scenario("study/undulation", &overrides), 1e-4);
        assert_eq!(leaf.stability.negative_eigenvalues, Some(0));
        let left = leaf.stability.saddle.map(|it| it.negative_eigenvalues);
        assert!(left.is_some_and(|index| index > 0), "{bending}: {left:?}");
        let height = leaf.tips[0].z.abs();
        assert!(height > 1e-3, "{bending}: {height}");
        let factorizations = leaf.work.factorizations;
        assert!(factorizations <= 121, "{bending}: {factorizations}");
    }
}
