//! Blades that are flat against plates: sheared and bent in their plane, bent and twisted out of it, at rest and as they
//! vibrate, of any number of veins; with the orders of what is left.

use leafdyn_testing::plate::RitzPlate;
use leafdyn_testing::*;

/// A blade of a constant width with a free end.
#[derive(Clone, Copy)]
struct Strip {
    rods: usize,
    length: f64,
    width: f64,
    thickness: f64,
    young: f64,
    poisson: f64,
    shear: f64,
    edges: bool,
}

const STRIP: Strip = Strip {
    rods: 9,
    length: 10.0,
    width: 2.0,
    thickness: 0.01,
    young: 1e4,
    poisson: 0.0,
    shear: 1e4 / 2.6,
    edges: false,
};

impl Strip {
    fn text(&self, more: &str) -> String {
        let Strip {
            rods,
            length,
            width,
            thickness,
            young,
            poisson,
            shear,
            edges,
        } = self;
        format!(
            r#"
            name = "strip"
            leaf = {{ rods = {rods} }}
            [blade]
            length = {length:?}
            width = {width:?}
            thickness = {thickness:?}
            young = {young:?}
            poisson = {poisson:?}
            shear_modulus = {shear:?}
            edges = {edges}
            {more}
            "#
        )
    }
}

/// A strip much wider than long, clamped at both ends, one of which moves in the plane: as a linear lattice of the same
/// rules, computed elsewhere; plane stress has 294.65.
#[test]
fn short_strips_shear_as_plane_stress() {
    let travel = 1e-4;
    let stiffness = |rods: usize| {
        let strip = Strip {
            rods,
            length: 0.5,
            width: 4.0,
            ..STRIP
        };
        let grip = |vein: usize| {
            format!(
                "[[grip]]\nvein = {vein}\nat = 1.0\nheld = 'clamped'\nmove = [0.0, {travel:?}, 0.0]\n"
            )
        };
        let grips: String = (1..=rods).map(grip).collect();
        2.0 * settle(&parse(&strip.text(&grips)), 1e-8).energy.unwrap() / (travel * travel)
    };
    for (rods, known, digits) in [
        (3, 279.0, 0.05),
        (5, 293.09, 0.01),
        (9, 296.847656, 5e-5),
        (17, 296.02, 0.02),
        (33, 294.90, 0.02),
    ] {
        close("stiffness", stiffness(rods), known, digits);
    }
}

/// The deflection in the plane under a force on the end, over that of Timoshenko's beam, at aspects down to 2.
#[test]
fn strips_bend_in_their_plane_as_timoshenko_beams() {
    for (edges, factor) in [(false, 1.0), (true, 12.0)] {
        // Margins have less of the shear than their part of the force.
        for (aspect, within) in [(2.0, 3.5e-4), (3.0, 1.3e-4), (5.0, 4e-5), (12.0, 1e-5)] {
            let ratio = in_plane_ratio(Strip {
                rods: 5,
                length: 2.0 * aspect,
                edges,
                ..STRIP
            });
            let off = (ratio - 1.0).abs();
            assert!(off < factor * within, "{edges} {aspect}: {ratio}");
        }
    }
    // Two strips and their middles are exactly such a beam.
    for aspect in [1.0, 3.0] {
        let two = Strip {
            rods: 2,
            length: 2.0 * aspect,
            ..STRIP
        };
        close("two strips", in_plane_ratio(two), 1.0, 1e-6);
    }
}

/// The mean deflection of the end in the plane by a force shared by all veins as shear is, over L^3/(3 E I) + 6 L/(5 G W t).
fn in_plane_ratio(strip: Strip) -> f64 {
    let Strip {
        rods,
        length,
        width,
        thickness,
        young,
        shear,
        ..
    } = strip;
    let force = 1e-6;
    let each = force / rods as f64;
    let point = |vein: usize| {
        format!("[[load.point]]\nvein = {vein}\nat = 1.0\nforce = [0.0, {each:?}, 0.0]\n")
    };
    let loads: String = (1..=rods).map(point).collect();
    let leaf = settle(&parse(&strip.text(&loads)), 1e-10);
    let second = thickness * width.powi(3) / 12.0;
    let wanted =
        length.powi(3) / (3.0 * young * second) + 6.0 * length / (5.0 * shear * width * thickness);
    2.0 * leaf.energy.unwrap().abs() / (force * force) / wanted
}

/// However many veins it has, it twists as G W t^3/3, away from its ends.
#[test]
fn strips_twist_as_plates() {
    for (rods, edges) in [
        (3, true),
        (5, true),
        (9, true),
        (2, false),
        (5, false),
        (9, false),
    ] {
        let strip = Strip {
            rods,
            length: 25.0,
            edges,
            ..STRIP
        };
        let gaps = if edges { rods - 1 } else { rods } as f64;
        let torque = 1e-7;
        let force = torque / (strip.width * (rods - 1) as f64 / gaps);
        let point = |vein: usize, force: f64| {
            format!("[[load.point]]\nvein = {vein}\nat = 1.0\nforce = [0.0, 0.0, {force:?}]\n")
        };
        let loads = point(1, -force) + &point(rods, force);
        let leaf = settle(&parse(&strip.text(&loads)), 1e-10);
        let stiffness = strip.shear * strip.width * strip.thickness.powi(3) / 3.0;
        let angle = torque / stiffness * strip.length / 2.0;
        let nodes = &leaf.shape.rods[rods / 2].nodes;
        // Between two stations away from both ends.
        let stations = &leaf.shape.stations;
        let [a, b] = [0.25, 0.75].map(|sigma| stations.partition_point(|at| *at < sigma));
        let turn = |k: usize| (nodes[k].rotation * DVec3::Y).z;
        let part = 2.0 * (stations[b] - stations[a]);
        close("angle", (turn(b) - turn(a)) / (part * angle), 1.0, 2e-5);
    }
}

/// A plate that is narrower at its end, with veins that are slanted by up to 0.3, hangs as Ritz has it, with an error of
/// second order in their number.
#[test]
fn fans_of_slanted_veins_bend_as_plates() {
    let (length, young, poisson, thickness) = (2.0, 1e4, 0.3, 0.004);
    let shear = young / (2.0 * (1.0 + poisson));
    let load = 1e-9;
    let plate = RitzPlate {
        length,
        width: |x: f64| 1.6 - 1.2 * x,
        thickness,
        young: [young; 2],
        poisson,
        shear,
    };
    let wanted = plate.tip_deflection(load);
    let off = |rods: usize| {
        let text = format!(
            r#"
            name = "fan"
            leaf = {{ rods = {rods} }}
            blade = {{ length = {length}, width = {{ at = [0.0, 1.0], value = [1.6, 0.4] }}, thickness = {thickness}, young = {young}, poisson = {poisson}, mass_density = 1.0, edges = false }}
            load = {{ g = [0.0, 0.0, {:?}] }}
            "#,
            load / thickness
        );
        settle(&parse(&text), 1e-9).tips[rods / 2].z / wanted - 1.0
    };
    let errors = [5, 9, 17].map(off);
    assert!(errors[0] < 3.2e-3, "{errors:?}");
    for pair in errors.windows(2) {
        assert!((2.7..5.0).contains(&(pair[0] / pair[1])), "{errors:?}");
    }
}

/// The six lowest frequencies of cantilever plates at three aspects, within half a per cent of Ritz with 17 veins.
#[test]
fn plates_vibrate_as_ritz_has_it() {
    for aspect in [1.0, 2.0, 5.0] {
        let (width, thickness, young, poisson, density) = (1.0, 1e-3, 1e4, 0.3, 1.0);
        let length: f64 = aspect * width;
        let plate = RitzPlate {
            length,
            width: |_| width,
            thickness,
            young: [young; 2],
            poisson,
            shear: young / (2.0 * (1.0 + poisson)),
        };
        let wanted = plate.frequencies();
        let rigidity = young * thickness.powi(3) / (12.0 * (1.0 - poisson * poisson));
        let unit = length.powi(2) * (density * thickness / rigidity).sqrt();
        let found = |rods: usize, edges: bool| -> Vec<f64> {
            let text = format!(
                r#"
                name = "plate"
                leaf = {{ rods = {rods} }}
                blade = {{ length = {length:?}, width = {width:?}, thickness = {thickness:?}, young = {young:?}, poisson = {poisson}, mass_density = {density:?}, edges = {edges} }}
                "#
            );
            let leaf = settled(&parse(&text), &with_modes(6, to(1e-5)));
            let modes = leaf.stability.modes.unwrap();
            modes
                .iter()
                .map(|mode| mode.frequency().unwrap() * unit)
                .collect()
        };
        let errors = |rods: usize, edges: bool| -> Vec<f64> {
            let each = found(rods, edges).into_iter().zip(&wanted);
            each.map(|(found, wanted)| found / wanted - 1.0).collect()
        };
        for (rods, edges, within) in [(9, false, 1.1e-2), (17, false, 3e-3), (17, true, 9e-3)] {
            let errors = errors(rods, edges);
            assert!(
                errors.iter().all(|error| error.abs() < within),
                "{aspect} {rods} {edges}: {errors:.5?}"
            );
        }
    }
}
