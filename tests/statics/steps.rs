//! Profiles with steps: two equal knots are a jump. Closed forms and transfer matrices of beams of two
//! pieces, the order of the error, both methods, stresses on both sides, and what is refused.

use crate::sensitivities::{derivatives, differenced, keys, of, results};
use leafdyn_testing::*;
use nalgebra::Matrix4;

/// Where the pieces meet.
const STEP: f64 = 0.4;

/// A profile of two constant pieces, as text.
fn pieces(first: f64, second: f64) -> String {
    format!(
        "{{ at = [0.0, {STEP}, {STEP}, 1.0], value = [{first:?}, {first:?}, {second:?}, {second:?}] }}"
    )
}

/// A straight rod along e1 that neither stretches nor shears, with these bending stiffnesses of its
/// pieces.
fn stepped(first: f64, second: f64, more: &str) -> String {
    let bending = pieces(first, second);
    format!(
        "name = 'stepped'\nleaf = {{ rods = 1, length = 1.0, fan = [0.0] }}\n\
         stiffness = {{ torsion = {bending}, bending_2 = {bending}, bending_3 = {bending}, axial = inf, shear_2 = inf, shear_3 = inf }}\n{more}\n"
    )
}

/// Under a tip force F the deflection is F/3 ((L^3 - b^3)/A1 + b^3/A2), b being the length of the
/// second piece.
#[test]
fn a_stepped_cantilever_under_a_tip_force() {
    let (first, second, force) = (2.0, 0.7, 1e-4);
    let text = stepped(first, second, "load = { tip_force = [0.0, 0.0, 1e-4] }");
    let b = (1.0 - STEP).powi(3);
    let wanted = force / 3.0 * ((1.0 - b) / first + b / second);
    let both = Both::of(&parse(&text));
    close("relaxed", tip(&both.relaxed).z, wanted, 1e-8 * wanted);
    let shot = tip_node(&both.shot.rods, 0).position;
    close("shot", shot.z, wanted, 1e-8 * wanted);
}

/// A moment bends both pieces to arcs, by however much.
#[test]
fn a_moment_bends_the_pieces_to_two_arcs() {
    let (first, second, moment) = (2.0, 0.5, 1.3);
    let more = "load = { tip_moment = [0.0, 0.0, 1.3] }";
    let by_moment = stepped(first, second, more);
    let rest = pieces(moment / first, moment / second);
    let at_rest = stepped(first, second, &format!("rest = {{ bend_3 = {rest} }}"));
    let [one, other] = [moment / first, moment / second];
    let arc = |curvature: f64, length: f64| {
        let angle: f64 = curvature * length;
        DVec3::new(angle.sin(), 1.0 - angle.cos(), 0.0) / curvature
    };
    let turn = glam::DQuat::from_rotation_z(one * STEP);
    let wanted = arc(one, STEP) + turn * arc(other, 1.0 - STEP);
    for text in [&by_moment, &at_rest] {
        let leaf = parse(text);
        Both::of(&leaf).tip_is(text, wanted, 1e-14, 1e-11);
        // The strains of a station are those of its side towards the base.
        let relaxed = settle(&leaf, 1e-9);
        let stations = relaxed.shape.stations.iter();
        for (&station, node) in stations.zip(&relaxed.shape.rods[0].nodes) {
            let wanted = if station < STEP + 1e-12 { one } else { other };
            close("curvature", node.u.z, wanted, 1e-7);
        }
    }
}

/// With the step at a node the error on one grid falls by four from grid to grid.
#[test]
fn the_error_is_of_second_order() {
    const LOADS: &str = "load = { tip_force = [0.1, 0.2, -0.8], gravity = [0.0, 0.0, -0.5] }";
    let leaf = parse(&stepped(2.0, 0.3, LOADS));
    let sharp = tip(&settle(&leaf, TIGHT));
    let errors = [10, 20, 40, 80].map(|segments| {
        let found = settled(&leaf, &iterated(1e-10, segments));
        (tip(&found) - sharp).length()
    });
    for pair in errors.windows(2) {
        let order = order(pair[0], pair[1]);
        assert!((order - 2.0).abs() < 0.03, "{errors:?}: {order}");
    }
    let (relaxed, _) = all_agree("under force and weight", &leaf);
    for tolerance in [1e-4, 1e-6, 1e-8] {
        let found = settle(&leaf, tolerance);
        let off = (tip(&found) - tip(&relaxed)).length();
        assert!(off <= estimate(&found), "{tolerance:e}: {off:e}");
    }
}

/// Distributed loads and weights of two pieces: each bends the beam by q (4 L x^3 - x^4)/(24 A) between
/// its ends.
#[test]
fn loads_and_weights_that_jump() {
    let deflection = |q: [f64; 2]| {
        let to = |x: f64| (4.0 * x.powi(3) - x.powi(4)) / 24.0;
        q[0] * to(STEP) + q[1] * (to(1.0) - to(STEP))
    };
    let distributed = format!(
        "load = {{ distributed = {{ at = [0.0, {STEP}, {STEP}, 1.0], value = [[0, 0, 1e-4], [0, 0, 1e-4], [0, 0, -3e-4], [0, 0, -3e-4]] }} }}"
    );
    let weight = format!(
        "load = {{ g = [0, 0, -1e-4] }}\ndynamics = {{ density = {} }}",
        pieces(1.0, 3.0)
    );
    for (load, q) in [(distributed, [1e-4, -3e-4]), (weight, [-1e-4, -3e-4])] {
        let leaf = parse(&stepped(1.0, 1.0, &load));
        let wanted = deflection(q);
        let both = Both::of(&leaf);
        close(&load, tip(&both.relaxed).z, wanted, 1e-7 * wanted.abs());
        let shot = tip_node(&both.shot.rods, 0);
        close(&load, shot.position.z, wanted, 1e-7 * wanted.abs());
        // The force at the step, which the nodes on one grid balance, too.
        for found in [&both.relaxed, &settle_on(&leaf, 10, false)] {
            let at = |station: &f64| (station - STEP).abs() < 1e-12;
            let node = found.shape.stations.iter().position(at).unwrap();
            let force = in_lab(&found.shape.rods[0].nodes[node]).0;
            close("force", force.z, q[1] * (1.0 - STEP), 1e-10);
        }
    }
}

/// A column clamped at its base and free at its tip buckles where tan(k1 a) tan(k2 b) = k2/k1, with
/// k^2 = P/A of each piece.
#[test]
fn a_stepped_column_buckles() {
    let (first, second) = (2.0, 0.6);
    let short = |load: f64| {
        let [k1, k2] = [first, second].map(|stiffness: f64| (load / stiffness).sqrt());
        let angles = [k1 * STEP, k2 * (1.0 - STEP)];
        angles[0].sin() * angles[1].sin() * k1 - angles[0].cos() * angles[1].cos() * k2
    };
    let critical = root(short, 0.5, 4.0);
    for (part, index) in [(1.0 - 1e-5, 0), (1.0 + 1e-5, 2)] {
        let load = part * critical;
        let leaf = parse(&stepped(
            first,
            second,
            &format!("load = {{ tip_force = [{:?}, 0.0, 0.0] }}", -load),
        ));
        let found = kept(&leaf, 1e-9);
        assert_eq!(found.stability.negative_eigenvalues, Some(index), "{part}");
    }
}

/// The lowest place between two where a function changes its sign.
fn root(of: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    let steps = 1000;
    let width = (high - low) / f64::from(steps);
    let change = (0..steps)
        .map(|k| low + f64::from(k) * width)
        .find(|at| of(*at) * of(at + width) <= 0.0);
    (low, high) = (change.unwrap(), change.unwrap() + width);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        match of(low) * of(middle) <= 0.0 {
            true => high = middle,
            false => low = middle,
        }
    }
    0.5 * (low + high)
}

/// What a piece of an Euler-Bernoulli beam makes of deflection, slope, moment and force at its beginning.
fn transfer(omega: f64, stiffness: f64, density: f64, length: f64) -> Matrix4<f64> {
    let beta = (density * omega * omega / stiffness).powf(0.25);
    let (sin, cos) = (beta * length).sin_cos();
    let (sinh, cosh) = ((beta * length).sinh(), (beta * length).cosh());
    let [s1, s2] = [0.5 * (cosh + cos), 0.5 * (sinh + sin) / beta];
    let [s3, s4] = [
        0.5 * (cosh - cos) / beta.powi(2),
        0.5 * (sinh - sin) / beta.powi(3),
    ];
    let (fourth, a) = (beta.powi(4), stiffness);
    Matrix4::new(
        s1,
        s2,
        s3 / a,
        s4 / a, //
        fourth * s4,
        s1,
        s2 / a,
        s3 / a, //
        a * fourth * s3,
        a * fourth * s4,
        s1,
        s2, //
        a * fourth * s2,
        a * fourth * s3,
        fourth * s4,
        s1,
    )
}

/// Frequencies of cantilevers whose stiffness or mass jumps, by transfer matrices.
#[test]
fn stepped_beams_vibrate_as_their_transfer_matrices_say() {
    for (stiffness, density) in [
        ([2.0, 0.5], [1.0, 1.0]),
        ([1.0, 1.0], [1.0, 3.0]),
        ([2.0, 0.5], [3.0, 0.8]),
    ] {
        let free = |omega: f64| {
            let of = |k: usize, length: f64| transfer(omega, stiffness[k], density[k], length);
            let all = of(1, 1.0 - STEP) * of(0, STEP);
            all[(2, 2)] * all[(3, 3)] - all[(2, 3)] * all[(3, 2)]
        };
        let first = root(free, 0.1, 20.0);
        let second = root(free, first + 0.1, 100.0);
        let dynamics = format!(
            "dynamics = {{ density = {}, rotary_inertia = 1e-10, external_damping = 0.0 }}",
            pieces(density[0], density[1])
        );
        let leaf = parse(&stepped(stiffness[0], stiffness[1], &dynamics));
        let found = settled(&leaf, &with_modes(4, to(1e-8)));
        let modes = found.stability.modes.as_deref().unwrap();
        for (mode, wanted) in modes.iter().zip([first, first, second, second]) {
            let found = mode.frequency().unwrap();
            let bar = mode.error.unwrap() / (2.0 * wanted * wanted);
            close("frequency", found / wanted, 1.0, 1e-6);
            close("within its bar", found / wanted, 1.0, bar + 1e-8);
        }
    }
}

/// At a step of the section the stress is that of the weaker side: 6 F b/(w t^2) beyond the step.
#[test]
fn the_stress_at_a_step_is_that_of_the_weaker_side() {
    let force = 1e-3;
    for (thickness, wanted, at) in [
        (pieces(0.02, 0.01), (1.0 - STEP) / 1e-4, STEP),
        (pieces(0.01, 0.02), 1.0 / 1e-4, 0.0),
    ] {
        let leaf = parse(&format!(
            "name = 'strip'\nleaf = {{ rods = 1, length = 1.0, fan = [0.0] }}\n\
             section = {{ shape = 'rectangle', width = 0.05, thickness = {thickness}, young = 1e9 }}\n\
             load = {{ tip_force = [0.0, 0.0, 1e-3] }}"
        ));
        let found = settle(&leaf, 1e-9).stress.unwrap();
        let wanted = 6.0 * force * wanted / 0.05;
        close("where", found.sigma, at, 1e-12);
        close("stress", found.largest.normal / wanted, 1.0, 1e-6);
        assert!(found.error.unwrap() < 1e-4 * wanted);
    }
}

/// A stem measured at stations, in pieces of constant sections or linear between them: every property
/// of a section may step, each at its own place, and all survive being written.
#[test]
fn steps_survive_being_written() {
    let leaf = "leaf = { rods = 2, length = 1.0, fan = 'symmetric' }\n";
    let texts = [
        "section = { shape = 'ellipse', width = { at = [0, 0.3, 0.3, 1], value = [0.2, 0.15, 0.12, 0.1] }, thickness = { at = [0, 0.5, 0.5, 0.6, 1], value = [0.1, 0.1, 0.05, 0.05, 0.04] }, young = { at = [0, 0.3, 1], value = [1, 2, 3] }, mass_density = { at = [0, 0.7, 0.7, 1], value = [2, 2, 1, 1] } }",
        "section = { shape = 'circle', diameter = { at = [0, 0.3, 0.3, 1], value = [[0.2, 0.15, 0.12, 0.1], [0.1, 0.1, 0.1, 0.2]] }, wall = 0.01, young = 1, shear_modulus = { at = [0, 0.2, 0.2, 1], value = [0.05, 0.05, 0.1, 0.1] } }",
        "stiffness = { torsion = 1, bending_2 = { at = [0, 0.3, 0.3, 1], value = [[1, 1, 2, 2], [1, 1, 1, 1]] }, bending_3 = 1, axial = 1e3, shear_2 = 1e3, shear_3 = 1e3 }\n\
         rest = { bend_2 = { at = [0, 0.5, 0.5, 1], value = [0, 0, 1, 2] } }\n\
         load = { distributed = { at = [0, 0.2, 0.2, 1], value = [[0, 0, 0], [0, 0, 0], [0, 0, 1], [0, 0, 2]] } }\n\
         dynamics = { density = { at = [0, 0.2, 0.2, 1], value = [1, 1, 2, 2] }, section_radius = { at = [0, 0.4, 0.4, 1], value = [0.1, 0.1, 0.2, 0.2] } }",
    ];
    for text in texts {
        let scenario = parse(&format!("name = 'stem'\n{leaf}{text}"));
        let json = serde_json::to_string(&scenario).unwrap();
        let again = parse(&json);
        assert_eq!(again, scenario, "{json}");
        assert_eq!(serde_json::to_string(&again).unwrap(), json);
    }
    let scenario = parse(&format!("name = 'stem'\n{leaf}{}", texts[2]));
    let [inertia, about_3] = &scenario.dynamics.rotary_inertia[0];
    assert_eq!(inertia, about_3);
    let values = [0.1, 0.3, 0.5].map(|sigma| inertia.at(sigma));
    let wanted = [0.01 / 4.0, 0.02 / 4.0, 0.08 / 4.0];
    for (value, wanted) in values.into_iter().zip(wanted) {
        close("inertia", value, wanted, 1e-15);
    }
    assert_eq!(scenario.kinks(), [0.2, 0.3, 0.5]);
}

/// By a value on one side of a step, and by one on the other.
#[test]
fn derivatives_by_the_values_at_a_step() {
    let more = format!(
        "rest = {{ bend_2 = {} }}\nload = {{ tip_force = [0.1, 0.3, -0.5], distributed = {{ at = [0.0, 0.6, 0.6, 1.0], value = [[0, 0, 0.2], [0, 0.1, 0.2], [0, 0, -0.3], [0.1, 0, 0]] }} }}",
        pieces(0.4, -0.3)
    );
    let text = stepped(2.0, 0.5, &more);
    let base = base(
        &text,
        "stiffness.torsion=0.7; stiffness.axial=50; stiffness.shear_2=60",
    );
    let wanted = [
        "stiffness.bending_2.value[1]",
        "stiffness.bending_2.value[2]",
        "rest.bend_2.value[2]",
        "load.distributed.value[1][1]",
        "load.distributed.value[2][2]",
    ];
    let options = iterated(1e-10, 10);
    let (leaf, found) = derivatives(&base, &wanted, &options);
    for (key, found) in keys(&wanted).iter().zip(&found) {
        let theirs = differenced(&base, key, &options);
        let count = results(&leaf).1;
        for (ours, (theirs, unsure)) in of(found).iter().zip(&theirs).take(count) {
            let off = (ours - theirs).abs() - 4.0 * unsure;
            assert!(off < 1e-7 * (1.0 + theirs.abs()), "{key}: {ours} {theirs}");
        }
    }
}

#[test]
fn what_is_no_step_is_refused() {
    let rod = |entry: &str| rod_refused(entry).unwrap_err().to_string();
    let table = "
        [0.0, 0.4, 0.4, 0.4, 1.0], value = [1, 1, 2, 2, 2] => at, entry 4 = 0.4: is the third of equal entries: a step is two
        [0.0, 0.0, 1.0], value = [1, 2, 2] => at, entry 2 = 0.0: a step at the base has no side before it: leave out the first entry
        [0.0, 1.0, 1.0], value = [1, 2, 2] => at, entry 3 = 1.0: a step at the tip has no side beyond it: leave out this entry
        [0.0, 0.4, 0.3, 1.0], value = [1, 1, 2, 2] => at, entry 3 = 0.3: must be greater than the entry before it, 0.4: knots rise, and two equal ones, next to each other, are a step
        [0.0, 0.4, 0.4, 1.0], value = [1, 1, 2] => has 3 entries: must have 4
    ";
    for (profile, said) in pairs(table) {
        let said_here = rod(&format!("stiffness.bending_2={{at={profile}}}"));
        assert!(said_here.contains(said), "{profile}: {said_here}");
    }
    let blade = "name = 'blade'\nleaf = { rods = 3 }\n[blade]\nlength = 25.0\nthickness = THICK\nyoung = 5e4\nwidth = WIDE";
    let even = "{ at = [0.0, 0.5, 1.0], value = [0.03, 0.03, 0.02] }";
    let step = "{ at = [0.0, 0.5, 0.5, 1.0], value = [0.03, 0.03, 0.02, 0.02] }";
    for (thick, wide, key) in [(even, step, "blade.width"), (step, even, "blade.thickness")] {
        let text = blade.replace("THICK", thick).replace("WIDE", wide);
        let refused = Scenario::from_toml(&text).unwrap_err().to_string();
        let said = "knots rise strictly (write a step as a steep ramp)";
        assert!(refused.contains(key) && refused.contains(said), "{refused}");
    }
    let text = ROD.to_string() + "dynamics.rest = { at = [0.0, 1.0, 1.0], factor = [1, 1, 2] }";
    let refused = Scenario::from_toml(&text).unwrap_err().to_string();
    assert!(refused.contains("times rise strictly"), "{refused}");
}

fn rod_refused(entry: &str) -> Result<Scenario, String> {
    let rod = Scenario::from_toml_with(ROD, "rod", &entries(entry));
    rod.map_err(|refused| refused.to_string())
}
