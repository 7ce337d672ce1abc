//! Newton's equation of Fig. 4's leaf, rod by rod against all at once, and
//! where the time of a whole run goes. One thread, all in the same run:
//! `cargo bench --bench linear_solvers`.

use leafdyn::internals::leaf::{
    DirectSolver, DiscreteLeaf, Grid, Leaf, LinearSolveOutcome, State, System,
};
use leafdyn::internals::relax::initial_state;
use leafdyn::relax::{Equilibrium, Progress, relax};
use leafdyn::scenario::Scenario;
use leafdyn_testing::bench::{figure, on_one_thread, print_head, to};
use std::collections::BTreeMap;
use std::time::Instant;

const RODS: [usize; 6] = [5, 10, 15, 21, 28, 35];

/// Segments of each rod where the solvers are compared.
const SEGMENTS: usize = 32;

/// Newton steps from the start to the state whose equation is solved: there the
/// leaf is nearly at rest.
const STEPS: usize = 3;

/// Each is timed so often, turn by turn, and the best time of each counts: what
/// disturbs the machine then disturbs all alike.
const ROUNDS: usize = 40;

/// Tolerances of the conjugate gradients: of a Newton step far from rest, and
/// of the last.
const LOOSE: f64 = 1e-3;
const TIGHT: f64 = 1e-10;

/// The best of several times of one thing.
struct Best(f64);

impl Best {
    const NONE: Best = Best(f64::INFINITY);

    fn time<T>(&mut self, f: impl FnOnce() -> T) -> T {
        let clock = Instant::now();
        let result = f();
        self.0 = self.0.min(clock.elapsed().as_secs_f64());
        result
    }

    fn microseconds(&self) -> f64 {
        1e6 * self.0
    }
}

/// The parts of a Newton step rod by rod, in seconds.
struct Parts {
    assembly: Best,
    factor: Best,
    loose: Best,
    tight: Best,
    advance: Best,
    loose_iterations: usize,
    tight_iterations: usize,
}

impl Parts {
    const NONE: Parts = Parts {
        assembly: Best::NONE,
        factor: Best::NONE,
        loose: Best::NONE,
        tight: Best::NONE,
        advance: Best::NONE,
        loose_iterations: 0,
        tight_iterations: 0,
    };

    fn round(&mut self, leaf: &DiscreteLeaf, state: &State, next: &mut State, system: &mut System) {
        let sums = self.assembly.time(|| leaf.assemble(state, system));
        assert!(sums.energy.is_finite());
        assert!(self.factor.time(|| system.factorize(0.0)));
        self.loose_iterations = iterations(self.loose.time(|| system.solve(None, LOOSE)));
        self.tight_iterations = iterations(self.tight.time(|| system.solve(None, TIGHT)));
        self.advance.time(|| leaf.advance(state, system, 1.0, next));
    }

    /// Time of a solution that takes so many iterations.
    fn solve(&self, iterations: f64) -> f64 {
        let more = (self.tight_iterations - self.loose_iterations).max(1) as f64;
        let each = (self.tight.0 - self.loose.0) / more;
        self.loose.0 + each * (iterations - self.loose_iterations as f64)
    }
}

fn iterations(solved: LinearSolveOutcome) -> usize {
    match solved {
        LinearSolveOutcome::Converged(iterations) => iterations,
        other => panic!("Fig. 4's leaf is positive definite: {other:?}"),
    }
}

/// The state after some Newton steps, and room for its equation.
fn nearly_at_rest(leaf: &DiscreteLeaf) -> (State, System) {
    let (mut state, mut system) = (initial_state(leaf), System::new(leaf));
    let mut next = state.clone();
    for _ in 0..STEPS {
        leaf.assemble(&state, &mut system);
        assert!(system.factorize(0.0));
        iterations(system.solve(None, LOOSE));
        leaf.advance(&state, &system, 1.0, &mut next);
        std::mem::swap(&mut state, &mut next);
    }
    (state, system)
}

fn compare_solvers(rods: usize) {
    let scenario = figure("fig04", rods);
    let model = Leaf::new(&scenario);
    let leaf = DiscreteLeaf::new(&model, Grid::new(SEGMENTS, model.kinks()));
    let (state, mut system) = nearly_at_rest(&leaf);
    let (mut next, mut parts) = (state.clone(), Parts::NONE);
    let (mut first, mut numeric, mut solve) = (Best::NONE, Best::NONE, Best::NONE);
    for _ in 0..ROUNDS {
        parts.round(&leaf, &state, &mut next, &mut system);
        // The first factorisation orders the unknowns, too.
        let solver = DirectSolver::for_coupling_pattern(&system).expect("fits into memory");
        let sparse = || solver.factorize_sparse(&system, 0.0);
        first.time(sparse).expect("fits into memory");
        let mut factor = numeric.time(sparse).expect("fits into memory");
        solve.time(|| factor.solve(&mut system, None));
        assert_eq!(factor.negative_eigenvalue_count(), 0);
    }
    let direct = numeric.0 + solve.0;
    println!(
        "| {rods:2} | {:.0} | {:.0} ({}) | {:.0} ({}) | {:.0} | {:.0} | {:.0} | {:.1} | {:.1} |",
        parts.factor.microseconds(),
        parts.loose.microseconds(),
        parts.loose_iterations,
        parts.tight.microseconds(),
        parts.tight_iterations,
        first.microseconds() - numeric.microseconds(),
        numeric.microseconds(),
        solve.microseconds(),
        direct / (parts.factor.0 + parts.loose.0),
        direct / (parts.factor.0 + parts.tight.0),
    );
}

/// Runs a relaxation to 1e-6; also counts its steps on each grid.
fn run(scenario: &Scenario) -> (Equilibrium, BTreeMap<usize, usize>) {
    let mut steps = BTreeMap::new();
    let found = relax(scenario, &to(1e-6), &mut |progress| {
        if let Progress::Relaxing { grid, .. } = progress {
            *steps.entry(*grid).or_default() += 1;
        }
    })
    .expect("a valid request");
    assert!(found.outcome.is_success());
    (found, steps)
}

fn share_out(rods: usize) {
    let scenario = figure("fig04", rods);
    let model = Leaf::new(&scenario);
    let (found, steps) = run(&scenario);
    let on = |segments: &usize| DiscreteLeaf::new(&model, Grid::new(*segments, model.kinks()));
    let leaves: Vec<DiscreteLeaf> = steps.keys().map(on).collect();
    let begun = |leaf: &DiscreteLeaf| {
        let (state, system) = nearly_at_rest(leaf);
        (Parts::NONE, state.clone(), state, system)
    };
    let mut grids: Vec<(Parts, State, State, System)> = leaves.iter().map(begun).collect();
    let mut total = Best::NONE;
    for _ in 0..ROUNDS {
        total.time(|| run(&scenario));
        for (leaf, (parts, state, next, system)) in leaves.iter().zip(&mut grids) {
            parts.round(leaf, state, next, system);
        }
    }
    // Every grid has one assembly more than steps; the finest one more again and
    // one more factorisation, for the Morse index.
    let each = found.work.cg_iterations as f64 / found.work.steps as f64;
    let (mut assembly, mut factor, mut solves, mut advance) = (0.0, 0.0, 0.0, 0.0);
    for (k, ((parts, ..), &steps)) in grids.iter().zip(steps.values()).enumerate() {
        let index = f64::from(k + 1 == grids.len());
        let steps = steps as f64;
        assembly += (steps + 1.0 + index) * parts.assembly.0;
        factor += (steps + index) * parts.factor.0;
        solves += steps * parts.solve(each);
        advance += steps * parts.advance.0;
    }
    let rest = total.0 - assembly - factor - solves - advance;
    let percent = |part: f64| 100.0 * part / total.0;
    let steps = steps
        .iter()
        .map(|(segments, steps)| format!("{steps} on {segments}"));
    let steps: Vec<String> = steps.collect();
    println!(
        "| {rods:2} | {:.2} | {:.0}% | {:.0}% | {:.0}% | {:.0}% | {:.0}% | {} |",
        1e3 * total.0,
        percent(assembly),
        percent(factor),
        percent(solves),
        percent(advance),
        percent(rest),
        steps.join(", "),
    );
}

fn main() {
    on_one_thread();

    println!("One Newton equation of Fig. 4's leaf on {SEGMENTS} segments a rod; microseconds.");
    println!("Rod by rod: factorisation, then conjugate gradients (iterations). Direct: order and");
    println!("symbolic part, numeric factorisation, solution. Ratios: direct without the symbolic");
    println!("part over rod by rod, each with its factorisation.");
    println!();
    print_head(
        "N | rods: factorise | to 1e-3 | to 1e-10 | direct: order | factorise | solve | ratio at 1e-3 | at 1e-10",
    );
    for rods in RODS {
        compare_solvers(rods);
    }

    println!();
    println!("Where the time of a run to 1e-6 goes: shares by the number of assemblies,");
    println!("factorisations, solutions and updates on each grid, times the time of one.");
    println!("The rest is setting up, prolongation, extrapolation and reporting.");
    println!();
    print_head(
        "N | run, ms | assembly | factorisation | solves | update | the rest | steps on grids of segments",
    );
    for rods in RODS {
        share_out(rods);
    }
}
