//! Derivatives of a leaf at rest by numbers of its scenario, against differences of
//! whole relaxations.

use std::f64::consts::TAU;

use leafdyn::relax::{GripReaction, Mode, Path, Reaction, Sensitivity};
use leafdyn::study::{BaseScenario, ParameterKeys, relax_with_sensitivities};
use leafdyn_testing::random::Draw;
use leafdyn_testing::*;

/// Leaves to be tried, from the second number on with grips, from the third on with hinges, from the fourth on
/// with grips that slide and give, or on a foundation; `LEAFDYN_LEAVES` in the environment asks for more.
const LEAVES: usize = 48;
const GRIPPED: usize = 24;
const HINGED: usize = 32;
const SLIDING: usize = 38;

/// A part of a scenario, and the keys that it has, between blanks.
type Part = (String, &'static str);

/// Stiffnesses, or a section.
fn stiffness(draw: &mut Draw, number: usize, rods: usize) -> Part {
    match number % 5 {
        // Nearly rigid: forces are condensed out with less than the stiffness.
        4 => (
            format!(
                "stiffness = {{ torsion = 1.0, bending_2 = 2.0, bending_3 = 1.5, axial = 3e7, shear_2 = 1e9, shear_3 = {:?} }}",
                draw.uniform(20.0, 100.0)
            ),
            "stiffness.torsion stiffness.bending_2 stiffness.axial stiffness.shear_3",
        ),
        3 if number.is_multiple_of(2) => (
            "section = { shape = \"rectangle\", width = 0.2, thickness = 0.1, young = 2e4, shear_modulus = 2e3 }".into(),
            "section.young section.width section.thickness section.shear_modulus",
        ),
        3 => (
            "section = { shape = \"rectangle\", width = 0.2, thickness = 0.1, young = 2e4, poisson = 0.3 }".into(),
            "section.young section.width section.thickness section.poisson",
        ),
        2 => (
            format!(
                "section = {{ shape = \"circle\", diameter = {:?}, young = 1e4 }}",
                draw.list(rods, 0.15, 0.2)
            ),
            "section.young section.diameter[0] section.poisson",
        ),
        _ => (
            format!(
                "stiffness = {{ torsion = {:?}, bending_2 = {{ at = [0.0, 0.4, 1.0], value = [2.0, 1.5, 0.7] }}, bending_3 = 1.5, axial = 50.0, shear_2 = {:?}, shear_3 = 80.0 }}",
                draw.list(rods, 0.5, 2.0),
                draw.uniform(20.0, 100.0),
            ),
            "stiffness.torsion[0] stiffness.bending_3 stiffness.axial+stiffness.axial stiffness.shear_2",
        ),
    }
}

/// A moment on a single rod, or what couples several.
fn coupling(draw: &mut Draw, number: usize, rods: usize) -> Part {
    match rods {
        1 => {
            let some = number.is_multiple_of(8) && number < HINGED;
            let moment = if some { 0.3 } else { 0.0 };
            let moment = format!("load.tip_moment = [0.0, {moment:?}, 0.0]");
            (moment, "load.tip_moment[1]")
        }
        // Coupling may be zero, and not below.
        _ => {
            let z = draw.list(rods - 1, 0.5, 3.0);
            let coupling = format!("coupling = {{ x = 0.0, y = 1.0, z = {z:?} }}");
            (coupling, "coupling.x coupling.z[0]")
        }
    }
}

/// Bases apart, tissue between the veins, and loads of single ones.
fn apart(draw: &mut Draw, number: usize, rods: usize) -> Part {
    if number.is_multiple_of(2) {
        return (String::new(), "");
    }
    let base: Vec<_> = (0..rods).map(|j| [0.0, 0.1 * j as f64, 0.05]).collect();
    let tissue = match rods {
        1 => String::new(),
        _ => format!(
            "tissue = {{ along = 20.0, across = {:?}, normal = 15.0, fold = 0.4 }}",
            draw.list(rods - 1, 5.0, 40.0)
        ),
    };
    let text = format!(
        r#"
        {tissue}
        leaf.base = {base:?}
        leaf.elevation = {:?}
        load.g = [0.0, 0.1, -0.3]
        load.point = [{{ vein = {rods}, at = 0.5, force = [0.1, -0.2, 0.3], offset = [0.1, -0.15] }}, {{ vein = 1, at = 1.0, force = [0.0, 0.1, 0.0], mass = 0.2 }}]
        load.distributed = {{ at = [0.0, 1.0], value = [[0.0, 0.0, 0.2], [0.1, 0.0, 0.0]] }}
        "#,
        draw.list(rods, -0.3, 0.3),
    );
    let keys = match rods {
        1 => {
            "leaf.base[0][1] leaf.elevation[0] load.g[2] load.point[0].force[0] load.point[0].offset[1] load.point[1].mass"
        }
        _ => {
            "leaf.base[1][1] leaf.base[0][2] leaf.elevation[0] load.g[2] load.point[0].force[2] load.point[0].offset[0] \
             tissue.along tissue.across[0] tissue.normal tissue.fold"
        }
    };
    (text, keys)
}

/// A joint tip that is held, pinned or clamped.
fn held_tip(draw: &mut Draw, number: usize, rods: usize) -> Part {
    match number % 6 {
        1 | 3 => {
            let tip = "tip = { held = \"pinned\", position = [0.7, 0.05, -0.2] }";
            (tip.into(), "tip.position[0] tip.position[2]")
        }
        2 | 5 => {
            let (angles, twist) = (draw.list(rods, -0.2, 0.2), draw.list(rods, -0.3, 0.3));
            let place = "held = \"clamped\", position = [0.8, 0.02, -0.1]";
            let tip = format!("tip = {{ {place}, angles = {angles:?}, twist = {twist:?} }}");
            (tip, "tip.position[1] tip.angles[0] tip.twist[0]")
        }
        _ => (String::new(), ""),
    }
}

/// A stretch of the first vein that is clamped, or pinned, and a point of the last.
fn grips(draw: &mut Draw, number: usize, rods: usize) -> Part {
    // Between two holders of a nearly rigid rod the force is that of rounding.
    let rigid = number % 5 == 4;
    let ungripped = number >= HINGED && !number.is_multiple_of(2);
    if number < GRIPPED || ungripped || rigid && rods > 1 {
        return (String::new(), "");
    }
    let held = ["clamped", "pinned"][number % 2];
    let at = if rigid { "0.5" } else { "[0.25, 0.5]" };
    let way = draw.list(6, -0.05, 0.05);
    let text = format!(
        r#"grip = [{{ vein = 1, at = {at}, held = "{held}", move = {:?} }}, {{ vein = {rods}, at = 0.75, move = {:?} }}]"#,
        &way[..3],
        &way[3..],
    );
    (text, "grip[0].move[1] grip[1].move[2]")
}

/// Grips that slide and give, and on every second leaf a foundation.
fn sliding(draw: &mut Draw, number: usize, rods: usize) -> Part {
    // Between two holders of a nearly rigid rod the force is that of rounding.
    let held = match number % 5 {
        4 => "3.0",
        _ => "inf",
    };
    let way = draw.list(6, -0.05, 0.05);
    let springs = draw.list(4, 0.3, 5.0);
    let [a, b, c, d] = springs[..] else {
        unreachable!("four of them");
    };
    let foundation = match number.is_multiple_of(2) {
        true => {
            "foundation = { stiffness = { at = [0.0, 0.4, 1.0], value = [[1.0, 0.0, 2.0], [0.5, 3.0, 1.0], [2.0, 1.0, 1.0]] } }"
        }
        false => "",
    };
    let text = format!(
        r#"
        {foundation}
        grip = [
            {{ vein = 1, at = [0.25, 0.5], stiffness = [{a:?}, 0.0, {held}], move = {:?} }},
            {{ vein = {rods}, at = 0.75, held = "clamped", stiffness = [{held}, {b:?}, {c:?}], turn_stiffness = {d:?}, move = {:?} }},
        ]
        "#,
        &way[..3],
        &way[3..],
    );
    let keys = match foundation.is_empty() {
        true => {
            "grip[0].stiffness[0] grip[1].stiffness[2] grip[1].turn_stiffness grip[0].move[2] grip[1].move[1]"
        }
        false => {
            "grip[0].stiffness[0] grip[1].turn_stiffness grip[1].move[0] foundation.stiffness.value[1][1] \
             foundation.stiffness.value[2][0]"
        }
    };
    (text, keys)
}

/// A random leaf, and keys of all kinds of it.
fn random(number: usize) -> (String, Vec<&'static str>) {
    let mut draw = Draw(number as u64);
    let rods = 1 + number % 4;
    let joined = !number.is_multiple_of(3);
    let hinged = number >= HINGED;
    let elastic = hinged && number % 4 == 3;
    // Round veins spin on hinges.
    let round = hinged && number % 5 == 2;
    let (stiffness, its_keys) = stiffness(&mut draw, number + usize::from(round), rods);
    let (coupling, coupling_keys) = coupling(&mut draw, number, rods);
    let (tip, tip_keys) = match rods > 1 && joined {
        true => held_tip(&mut draw, number, rods),
        false => (String::new(), ""),
    };
    let (apart, apart_keys) = apart(&mut draw, number, rods);
    let (grips, grip_keys) = match number < SLIDING {
        true => grips(&mut draw, number, rods),
        false => sliding(&mut draw, number, rods),
    };
    let all = "rest.twist[0] rest.bend_2[0] rest.bend_3[0] rest.stretch load.gravity[0] \
               load.gravity[2] load.tip_force[1] leaf.length[0] leaf.fan[0] dynamics.density \
               dynamics.rotary_inertia dynamics.rotary_inertia_3";
    let keys = [
        all,
        its_keys,
        coupling_keys,
        tip_keys,
        apart_keys,
        grip_keys,
        if elastic {
            "leaf.base_turn_stiffness"
        } else {
            ""
        },
    ];
    let text = format!(
        r#"
        name = "leaf{number}"
        {tip}
        {coupling}
        {apart}
        {grips}
        leaf.base_held = "{}"
        {}
        leaf.rods = {rods}
        leaf.joined = {joined}
        leaf.length = {:?}
        leaf.fan = {:?}
        {stiffness}
        rest = {{ twist = {:?}, bend_2 = {:?}, bend_3 = {:?}, stretch = 1.1 }}
        load.gravity = [{:?}, 0.0, {:?}]
        load.tip_force = {:?}
        dynamics = {{ density = 1.3, rotary_inertia = 0.01, rotary_inertia_3 = 0.02 }}
        "#,
        match (hinged, elastic) {
            (_, true) => "elastic",
            (true, false) => "pinned",
            (false, false) => "clamped",
        },
        if elastic {
            "leaf.base_turn_stiffness = 1.7"
        } else {
            ""
        },
        draw.list(rods, 0.8, 1.2),
        draw.list(rods, -0.7, 0.7),
        draw.list(rods, -0.5, 0.5),
        draw.list(rods, -0.8, 0.8),
        draw.list(rods, -0.5, 0.5),
        draw.uniform(-0.5, 0.5),
        draw.uniform(-1.0, -0.2),
        draw.list(3, -0.5, 0.5),
    );
    let keys = keys.iter().flat_map(|keys| keys.split_whitespace());
    (text, keys.collect())
}

pub fn keys(keys: &[&str]) -> Vec<ParameterKeys> {
    keys.iter().map(|key| key.parse().unwrap()).collect()
}

pub fn derivatives(
    base: &BaseScenario,
    wanted: &[&str],
    options: &Options,
) -> (Equilibrium, Vec<Sensitivity>) {
    let leaf = relax_with_sensitivities(base, &keys(wanted), options, &mut |_| {}).unwrap();
    let (remark, text) = (&leaf.remark, base.text());
    assert_eq!(leaf.outcome, Outcome::Converged, "{remark:?}\n{text}");
    let found = leaf.sensitivities.clone().unwrap();
    (leaf, found)
}

/// What the holder of a tip feels.
fn felt(held: &Option<Reaction>) -> impl Iterator<Item = DVec3> {
    held.iter().flat_map(|held| {
        let moments = held.moments.iter().flatten().copied();
        [held.force].into_iter().chain(moments)
    })
}

/// What the grips feel.
fn on_grips(grips: &[GripReaction]) -> impl Iterator<Item = DVec3> {
    grips
        .iter()
        .flat_map(|grip| [grip.force].into_iter().chain(grip.moment))
}

/// Tips, places of the stations, energy, what the holders feel, the lowest eigenvalue and the
/// frequencies; and how many of them are not of modes.
pub fn results(leaf: &Equilibrium) -> (Vec<f64>, usize) {
    let places = leaf.tips.iter().copied();
    let places = places.chain(nodes(&leaf.shape.rods).map(|node| node.position));
    let mut all: Vec<f64> = places.flat_map(|it| it.to_array()).collect();
    all.extend(leaf.energy);
    let felt = felt(&leaf.reaction).chain(on_grips(&leaf.grip_reactions));
    all.extend(felt.flat_map(|it| it.to_array()));
    let count = all.len();
    let modes = leaf.stability.modes.as_deref().unwrap_or_default();
    all.extend(modes.iter().take(1).map(|mode| mode.eigenvalue));
    let hertz = |mode: &Mode| mode.frequency().unwrap_or(f64::NAN) / TAU;
    all.extend(modes.iter().map(hertz));
    (all, count)
}

/// The same derivatives from eight relaxations, and how far those of four are off: much
/// where modes come close to each other. Empty if one of them comes to rest by another path.
pub fn differenced(base: &BaseScenario, key: &ParameterKeys, options: &Options) -> Vec<(f64, f64)> {
    let value = base.differentiable_value(key).unwrap();
    let size = if value == 0.0 { 1.0 } else { value.abs() };
    let word = |leaf: &Equilibrium| leaf.path.as_ref().map(Path::word);
    let here = word(&leafdyn_testing::relaxed(base.scenario(), options));
    let at = |steps: f64, step: f64| -> Option<Vec<f64>> {
        let scenario = base
            .scenario_with_values(&[(key, value + steps * step)])
            .ok()?
            .scenario;
        let there = leafdyn_testing::relaxed(&scenario, options);
        let same = here.is_none() || [here, None].contains(&word(&there));
        Some(if same { results(&there).0 } else { Vec::new() })
    };
    let central = [(-2.0, 1.0), (-1.0, -8.0), (1.0, 8.0), (2.0, -1.0)].as_slice();
    let forward = [-25.0, 48.0, -36.0, 16.0, -3.0];
    let forward: Vec<_> = [0.0, 1.0, 2.0, 3.0, 4.0].into_iter().zip(forward).collect();
    let by = |rule: &[(f64, f64)], step: f64| -> Option<Vec<f64>> {
        let mut sums: Vec<f64> = Vec::new();
        for (steps, weight) in rule {
            let values = at(*steps, step)?;
            if values.is_empty() {
                return Some(values);
            }
            sums.resize(values.len(), 0.0);
            let terms = sums.iter_mut().zip(values);
            terms.for_each(|(sum, value)| *sum += weight * value / (12.0 * step));
        }
        Some(sums)
    };
    // With half the step, of the error of the fourth order a sixteenth is left.
    let (Some(coarse), Some(fine)) = (by(central, 3e-3 * size), by(central, 1.5e-3 * size)) else {
        let found = by(&forward, 1e-3 * size).unwrap().into_iter();
        return found.map(|value| (value, 0.0)).collect();
    };
    let both = fine.iter().zip(coarse);
    both.map(|(fine, coarse)| (fine + (fine - coarse) / 15.0, (fine - coarse).abs() / 15.0))
        .collect()
}

pub fn of(found: &Sensitivity) -> Vec<f64> {
    let places = found.tips.iter().chain(found.positions.iter().flatten());
    let places = places.flat_map(|it: &DVec3| it.to_array());
    places
        .chain([found.energy])
        .chain(
            felt(&found.reaction)
                .chain(on_grips(&found.grip_reactions))
                .flat_map(|it| it.to_array()),
        )
        .chain(found.lowest_eigenvalue)
        .chain(found.frequencies.iter().map(|it| it.unwrap_or(f64::NAN)))
        .collect()
}

/// Asserts that the derivatives by these keys, with those of two frequencies, are those of whole relaxations.
pub fn assert_those_of_relaxations(base: &BaseScenario, wanted: &[&str], what: &str) {
    let options = with_modes(2, iterated(1e-10, 12));
    let (leaf, ours) = derivatives(base, wanted, &options);
    let (units, count) = results(&leaf);
    for (key, ours) in keys(wanted).iter().zip(&ours) {
        let theirs = differenced(base, key, &options);
        let size = base.differentiable_value(key).unwrap().abs().max(1e-1);
        let ours = of(ours);
        assert_eq!(ours.len(), theirs.len());
        for (k, (ours, (theirs, unsure))) in ours.iter().zip(&theirs).enumerate() {
            let off = (ours - theirs).abs() - 4.0 * unsure;
            let error = off * size / (units[k].abs().max(1.0) + theirs.abs() * size);
            let allowed = if k < count { 1e-7 } else { 1e-6 };
            assert!(error < allowed, "{what} {key} {k}: {ours} {theirs}");
        }
    }
}

/// Every key, on one grid, which leaves no doubt about what is differenced.
#[test]
fn they_are_those_of_whole_relaxations() {
    let mut elsewhere = Vec::new();
    for number in 0..asked("LEAFDYN_LEAVES", LEAVES) {
        let (text, wanted) = random(number);
        let base = base(&text, "");
        let options = with_modes(2, iterated(1e-9, 12));
        let (leaf, found) = derivatives(&base, &wanted, &options);
        assert_eq!(found.len(), wanted.len());
        for (key, found) in keys(&wanted).iter().zip(&found) {
            let value = base.differentiable_value(key).unwrap().abs();
            let size = if value == 0.0 { 1.0 } else { value };
            let (ours, mut theirs) = (of(found), differenced(&base, key, &options));
            let (units, count) = results(&leaf);
            if theirs.is_empty() {
                elsewhere.push(number);
                continue;
            }
            if key.to_string().starts_with("load.tip_moment") {
                // With a moment there are no modes.
                theirs.truncate(count);
            }
            assert_eq!(ours.len(), theirs.len(), "{number} {key}");
            for (k, (ours, (theirs, unsure))) in ours.iter().zip(&theirs).enumerate() {
                // What a change by the whole number would change, against the result.
                let unit = units[k].abs().max(1.0);
                let off = (ours - theirs).abs() - 4.0 * unsure;
                let error = off * size / (unit + theirs.abs() * size);
                // Eigenvalues are differenced to the second order.
                let allowed = if k < count { 1e-7 } else { 1e-6 };
                let what = format!("leaf {number}, {key}, result {k}: {ours} {theirs}");
                assert!(error < allowed, "{what}\n{text}");
            }
        }
    }
    // The ways of two leaves to their holders nearly snap.
    elsewhere.dedup();
    assert!(elsewhere.len() <= 2, "{elsewhere:?}");
}

/// Tissue that there is not yet has a derivative at zero, of veins whose rest shapes do not depend on it.
#[test]
fn tissue_begins_at_zero() {
    let text = r#"
        leaf = { rods = 4, fan = [-0.5, -0.1, 0.2, 0.6], length = [0.9, 1.0, 1.1, 1.0], elevation = 0.3 }
        stiffness = { torsion = 0.7, bending_2 = 1.0, bending_3 = 2.0, axial = 300.0, shear_2 = 90.0, shear_3 = 80.0 }
        load.gravity = [0.2, 0.3, -1.5]
        load.point = [{ vein = 2, at = 0.5, force = [2.0, 0.0, -1.0] }, { vein = 3, at = 0.6, force = [-2.0, 0.5, 0.0] }]"#;
    let wanted = [
        "tissue.along",
        "tissue.across",
        "tissue.normal",
        "tissue.fold",
    ];
    for joined in ["true", "false"] {
        let base = base(text, &format!("leaf.joined = {joined}"));
        let options = with_modes(2, iterated(1e-11, 12));
        let (leaf, found) = derivatives(&base, &wanted, &options);
        let (_, count) = results(&leaf);
        for (key, found) in keys(&wanted).iter().zip(&found) {
            let (ours, theirs) = (of(found), differenced(&base, key, &options));
            assert_eq!(ours.len(), theirs.len(), "{key}");
            let largest = theirs[..count].iter().map(|it| it.0.abs());
            assert!(largest.fold(0.0, f64::max) > 1e-5, "{key} does nothing");
            for (k, (ours, (theirs, _))) in ours.iter().zip(&theirs).enumerate() {
                let error = (ours - theirs).abs() / theirs.abs().max(1.0);
                let allowed = if k < count { 2e-7 } else { 2e-6 };
                assert!(
                    error < allowed,
                    "{joined} {key}, result {k}: {ours} {theirs}"
                );
            }
        }
    }
}

/// Over several grids they are as accurate as they say, by one solution for each
/// number or for each result.
#[test]
fn their_errors_are_bounds() {
    for number in [1, 2, 7, 25, 26, 30] {
        let (text, wanted) = random(number);
        let base = base(&text, "");
        for count in [2, wanted.len()] {
            let rough = derivatives(&base, &wanted[..count], &leafdyn_testing::to(1e-5)).1;
            let fine = derivatives(&base, &wanted[..count], &leafdyn_testing::to(1e-10)).1;
            for (rough, fine) in rough.iter().zip(&fine) {
                let key = &rough.key;
                let tips = rough.tips.iter().zip(&fine.tips);
                let apart = largest(tips.map(|(a, b)| a.distance(*b)));
                let [error, least] = [rough, fine].map(|found| found.tip_error.unwrap());
                let what = format!("{number} {key}: {apart:e} {error:e}");
                assert!(apart <= error + least, "{what}");
                assert!(least < 1e-3 * error + 1e-8, "{what}, at best {least:e}");
                let error = rough.energy_error.unwrap() + fine.energy_error.unwrap();
                close(&format!("{number} {key}"), rough.energy, fine.energy, error);
            }
        }
    }
}

/// How a mass on a point slows a leaf, over all grids, against relaxations with other masses: where it
/// hangs from the vein as well as where it has inertia alone.
#[test]
fn frequencies_change_with_a_mass_on_a_point() {
    let vibrating = "; dynamics.density=1.0; load.tip_force=[0.1, 0.2, -0.3]";
    for (g, at) in [("[0.0, 0.0, 0.0]", 1.0), ("[0.0, 0.1, -0.5]", 0.7)] {
        let text = format!("{ROD}\n[[load.point]]\nvein = 1\nat = {at:?}\nmass = 0.3\n");
        let stiffness = set_stiffness(1e3, 1e3);
        let entries = format!("{stiffness}; stiffness.bending_3=1.5{vibrating}; load.g={g}");
        let base = base(&text, &entries);
        let options = with_modes(2, leafdyn_testing::to(1e-9));
        let mass = "load.point[0].mass";
        let (leaf, found) = derivatives(&base, &[mass], &options);
        let theirs = differenced(&base, &keys(&[mass])[0], &options);
        let count = results(&leaf).1;
        let frequencies = found[0].frequencies.iter().flatten();
        let mut compared = 0;
        for (ours, (theirs, _)) in frequencies.zip(&theirs[count + 1..]) {
            let what = format!("mass at {at}: {ours} for {theirs}");
            assert!((ours - theirs).abs() < 1e-5 * theirs.abs(), "{what}");
            compared += 1;
        }
        assert_eq!(compared, 2);
    }
}

/// A round rod vibrates alike in all directions. Other bending in one of them splits
/// the lowest eigenvalue, which has no derivative then; weight along the rod does not.
#[test]
fn an_eigenvalue_that_splits_has_no_derivative() {
    let round = format!("{}; load.gravity=[-1.0, 0.0, 0.0]", set_stiffness(1e3, 1e3));
    let wanted = [
        "stiffness.bending_2",
        "load.gravity[0]",
        "stiffness.torsion",
    ];
    let base = base(ROD, &round);
    let options = with_modes(3, leafdyn_testing::to(1e-8));
    let found = derivatives(&base, &wanted, &options).1;
    let [bending, weight, torsion] = [0, 1, 2].map(|k| &found[k]);
    assert_eq!(bending.lowest_eigenvalue, None);
    assert_eq!(bending.lowest_eigenvalue_error, None);
    assert_eq!(bending.frequencies[..2], [None, None]);
    assert!(bending.frequencies[2].is_some());
    let differenced = differenced(&base, &keys(&wanted)[1], &options);
    let lowest = weight.lowest_eigenvalue.unwrap();
    let bar = weight.lowest_eigenvalue_error.unwrap();
    // Differences come from more grids than the derivative does.
    let same = |(value, _): &(f64, f64)| (value - lowest).abs() < bar.min(1e-4);
    assert!(
        differenced.iter().any(same),
        "{lowest} within {bar:e} {differenced:?}"
    );
    assert!(torsion.lowest_eigenvalue.unwrap().abs() < 1e-9);
}

#[test]
fn what_has_no_derivative_is_refused() {
    let (text, _) = random(4);
    let base = base(&text.replace("axial = 3e7", "axial = inf"), "");
    for (key, said) in [
        ("stiffness.axial", "is infinite"),
        ("leaf.rods", "whole number"),
        ("method.step", "setting of a method"),
        ("leaf.length[7]", "count from 0"),
        ("dynamics.duration", "write it there first"),
        ("stiffness.torsion+stiffness.bending_2", "another value"),
    ] {
        let keys = keys(&[key]);
        let refused = relax_with_sensitivities(&base, &keys, &Options::default(), &mut |_| {});
        let refused = refused.map(|leaf| leaf.outcome).unwrap_err().to_string();
        assert!(refused.contains(said), "{key}: {refused}");
    }
}
