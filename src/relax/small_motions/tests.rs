use super::*;
use crate::modes::linearized::tests::reference_roots;
use crate::relax::{Options, relax_on_grids};
use crate::scenario::Scenario;
use leafdyn_testing::asked;

/// Numbers without an order, the same in every run: J. H. Halton's sequence in one base.
fn halton(mut index: usize, base: usize) -> f64 {
    let (mut value, mut part) = (0.0, 1.0 / base as f64);
    while index > 0 {
        value += part * (index % base) as f64;
        (index, part) = (index / base, part / base as f64);
    }
    value
}

/// A leaf whose veins are often round, under loads that turn with it, dead moments or wind.
fn leaf(number: usize) -> Option<Scenario> {
    let number = number + 1;
    let draw = |base: usize| halton(number, base);
    let signed = |base: usize, size: f64| size * (2.0 * draw(base) - 1.0);
    let rods = 1 + number % 3;
    let round = if draw(2) < 0.6 { 1.0 } else { 1.0 + draw(3) };
    let held = ["clamped", "clamped", "pinned"][number % 3];
    let joined = rods > 1 && draw(5) < 0.4;
    let point = |force: f64, moment: f64| {
        format!(
            "[[load.point]]\nvein = 1\nat = 1.0\nfollows = true\nforce = [{}, {}, {}]\nmoment = [{}, {}, {}]\n",
            signed(7, force),
            signed(11, 0.2 * force),
            signed(13, 0.2 * force),
            signed(17, moment),
            signed(19, moment),
            signed(23, moment)
        )
    };
    let load = match number % 5 {
        0 => point(0.0, 3.0),
        1 => point(12.0, 0.5),
        2 => format!(
            "[load]\nfollower = [{}, {}, {}]\ncouple = [{}, 0.0, {}]\n",
            signed(7, 15.0),
            signed(11, 1.0),
            signed(13, 1.0),
            signed(17, 2.0),
            signed(19, 1.0)
        ),
        3 => format!(
            "[load]\ngravity = [0.0, 0.0, -0.5]\n[wind]\nvelocity = [{}, {}, {}]\ndensity = 1.0\ndrag = 1.5\nwidth = 0.2\n",
            signed(7, 2.0),
            signed(11, 2.0),
            signed(13, 2.0)
        ),
        _ => format!(
            "[load]\ncouple = [{}, {}, {}]\ncouple_follows = {}\n",
            signed(7, 4.0),
            signed(11, 1.0),
            signed(13, 1.0),
            draw(17) < 0.5
        ),
    };
    let damping = match number % 4 {
        0 => "",
        1 => "external_damping = 0.3, ",
        2 => "internal_damping = 0.002, ",
        _ => "external_damping = 0.0, ",
    };
    let text = format!(
        "name = \"leaf\"\nleaf = {{ rods = {rods}, length = 1.0, fan = \"symmetric\", joined = {joined}, base_held = \"{held}\" }}
         stiffness = {{ torsion = 0.8, bending_2 = 1.0, bending_3 = {round}, axial = 60.0, shear_2 = 60.0, shear_3 = 60.0 }}
         dynamics = {{ density = 1.0, {damping}rotary_inertia = 0.003 }}\n{load}"
    );
    Scenario::from_toml(&text).ok()
}

/// On one grid no leaf is called stable of which a root grows by more than rounding, and none unstable of which no
/// root does: by all roots of the companion matrix. `LEAFDYN_GROWTH` has the number of leaves.
#[test]
fn no_growing_motion_is_missed() {
    let options = Options {
        method: Options::default().method.on_grid(Some(5)),
        ..Options::default()
    };
    let (mut leaves, mut unstable, mut unknown, mut beyond) = (0, 0, 0, 0);
    let mut faults = Vec::new();
    for (number, scenario) in
        (0..asked("LEAFDYN_GROWTH", 120)).filter_map(|number| Some((number, leaf(number)?)))
    {
        let Ok(relaxed) = relax_on_grids(&scenario, &options, false, &mut |_| {}) else {
            continue;
        };
        let (Some(motions), Some(level)) = (
            &relaxed.result.stability.small_motions,
            relaxed.on_grids.levels.last(),
        ) else {
            continue;
        };
        let (physics, _) = Physics::for_small_motions(&level.leaf.leaf);
        let forces = WithoutPotential::in_motion(&level.leaf, &physics);
        let roots = reference_roots(&level.leaf, &physics, &level.state, &forces);
        let mut growing: Vec<c64> = roots.iter().copied().filter(|it| it.re > 0.0).collect();
        growing.sort_by(|a, b| (b.re / b.norm()).total_cmp(&(a.re / a.norm())));
        let grows = |part: f64| growing.first().is_some_and(|it| it.re > part * it.norm());
        leaves += 1;
        match motions.stable {
            Some(true) if grows(1e-4) => {
                faults.push(format!("{number} called stable: {:?}", growing[0]));
            }
            Some(false) if !grows(1e-9) => faults.push(format!("{number} called unstable")),
            Some(false) => {
                unstable += 1;
                let least = growing.iter().filter(|it| it.re > 1e-4 * it.norm());
                let least = least.map(|it| it.norm()).fold(f64::INFINITY, f64::min);
                let before = roots.iter().filter(|it| it.norm() < 0.999 * least).count();
                beyond += usize::from(before > 2 * LEAST_ROOTS);
            }
            None => unknown += 1,
            Some(true) => {}
        }
    }
    println!(
        "{leaves} leaves, {unstable} unstable, {beyond} by roots beyond the lowest, {unknown} unknown"
    );
    assert!(faults.is_empty(), "{}", faults.join("\n"));
    assert!(leaves >= 60 && 4 * unstable >= leaves && 10 * unknown <= leaves);
}
