//! Random leaves are stable up to the force that unseats them, and not beyond.

use leafdyn::internals::branch::{BranchEquations, LeafFamily};
use leafdyn::internals::leaf::{DiscreteLeaf, Grid, State};
use leafdyn::internals::relax::{relax_from_state, state_from_rod_shapes};
use leafdyn::study::relax_with_margin;
use leafdyn_testing::random::Draw;
use leafdyn_testing::*;

/// A soft leaf that may have several places to rest, with more.
fn soft(draw: &mut Draw, more: impl Fn(&mut Draw, usize) -> String) -> Scenario {
    let rods = 1 + (3.0 * draw.even()) as usize;
    let coupling = match rods {
        1 => "",
        _ => "coupling = { y = 1.0, z = 1.0 }",
    };
    parse(&format!(
        r#"
        name = "soft"
        leaf = {{ rods = {rods}, length = 1.0, fan = "paper" }}
        stiffness = {{ torsion = {:?}, bending_2 = {:?}, bending_3 = 1.0, axial = 20.0, shear_2 = 20.0, shear_3 = 20.0 }}
        rest.bend_2 = {:?}
        rest.bend_3 = {:?}
        load = {{ gravity = [0.0, 0.0, {:?}] }}
        {coupling}
        {}
        "#,
        10.0_f64.powf(draw.uniform(-2.0, 0.0)),
        10.0_f64.powf(draw.uniform(-2.0, -0.5)),
        draw.uniform(-2.0, 2.0),
        draw.uniform(-1.0, 1.0),
        -draw.uniform(0.0, 0.2),
        more(draw, rods),
    ))
}

/// A stable leaf followed from a fraction of its push to another by Newton's method, in
/// halves where that does not get there at once or goes far.
fn advanced(
    equations: &mut BranchEquations,
    state: &State,
    way: [f64; 2],
    halvings: usize,
) -> Option<State> {
    if let Ok(point) = equations.correct(state, way[1].max(0.0), None)
        && state.largest_displacement_to(&point.state) < 0.05
        && point.index == 0
    {
        return Some(point.state);
    }
    let middle = 0.5 * (way[0] + way[1]);
    let half = advanced(equations, state, [way[0], middle], halvings.checked_sub(1)?)?;
    advanced(equations, &half, [middle, way[1]], halvings - 1)
}

/// Ten leaves that some push unseats: followed in small steps they are stable up to 0.98 of
/// the least, and under 1.02 of it they come to rest elsewhere.
#[test]
fn random_leaves_stay_below_the_push_and_leave_above_it() {
    stay_below_and_leave_above(10, Draw(7), |_, _| String::new());
}

/// The same of leaves in grips.
#[test]
fn random_leaves_in_grips_stay_below_the_push_and_leave_above_it() {
    stay_below_and_leave_above(5, Draw(8), |draw, rods| {
        let held = ["pinned", "clamped"][usize::from(draw.even() < 0.5)];
        let way = draw.list(3, -0.1, 0.1);
        format!("grip = [{{ vein = {rods}, at = [0.25, 0.375], held = {held:?}, move = {way:?} }}]")
    });
}

fn stay_below_and_leave_above(
    wanted: usize,
    mut draw: Draw,
    more: impl Fn(&mut Draw, usize) -> String,
) {
    let (mut tried, mut unseated) = (0, 0);
    while unseated < wanted {
        tried += 1;
        assert!(tried < 80, "{unseated} of {tried}");
        let scenario = soft(&mut draw, &more);
        let options = at_every_node(1e-5);
        let rest = relax_with_margin(&scenario, &options, &mut |_| {}).unwrap();
        let margin = rest.margin.clone().unwrap();
        let Some(push) = margin.pushes.first().filter(|push| push.force.is_some()) else {
            continue;
        };
        let force = push.force.unwrap();
        assert!(push.error.unwrap() < 1e-3 * force, "{push:?}");
        let make = |[part]: [f64; 1]| {
            let mut pushed = scenario.clone();
            pushed.tip_force[push.direction.axis] += push.direction.sign() * part * force;
            Ok(pushed)
        };
        let family = LeafFamily::new(&make, [0.0, 2.0], false).unwrap();
        let leaf = Leaf::new(&scenario);
        // On one grid, fine enough for its folds.
        let mut options = on(64);
        options.every_node = true;
        let alone = relaxed(&scenario, &options);
        if alone.tips[0].distance(rest.tips[0]) > 2e-3 {
            continue;
        }
        let grid = Grid::new(alone.shape.stations.len() - 1, leaf.kinks());
        let discrete = DiscreteLeaf::new(&leaf, grid.clone());
        let mut state = state_from_rod_shapes(&leaf, &discrete, &alone.shape.rods);
        let mut equations = BranchEquations::new(&family, grid.clone());
        let mut last = 0.0;
        for step in 0..=196 {
            let part = 0.005 * f64::from(step);
            let way = [0.5 * (part - 0.005), 0.5 * part];
            let next = advanced(&mut equations, &state, way, 14);
            let next = next.unwrap_or_else(|| panic!("{push:?} at {part}"));
            last = state.largest_displacement_to(&next);
            state = next;
        }
        let pushed = Leaf::new(&make([1.02]).unwrap());
        let beyond = relax_from_state(&pushed, &grid, state.clone(), &Limit::default());
        let jump = beyond.map_or(f64::INFINITY, |beyond| {
            state.largest_displacement_to(&beyond)
        });
        // As far as eight more such steps would lead at most, if it only bends aside.
        assert!(jump > 8.0 * last, "{push:?}: {last} {jump}");
        unseated += 1;
    }
}
