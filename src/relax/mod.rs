//! How a leaf comes to rest.
mod equilibrium;
mod prolong;
mod richardson;
pub mod semi_implicit;
mod shape;
mod start;
pub use equilibrium::{Equilibrium, NodeState, Outcome, RodShape, Saddle, Work};
use crate::leaf::*;
use crate::scenario::Scenario;

pub fn experiment(scenario: &Scenario, n: usize, grids: usize) {
    let leaf = Leaf::new(scenario);
    let mut d = DiscreteLeaf::new(&leaf, Grid::new(n, leaf.kinks()));
    let mut state = start::start(&d);
    let mut rich = richardson::Richardson::default();
    let mut work = Work::default();
    for g in 0..grids {
        let t = std::time::Instant::now();
        let mut system = System::new(&d);
        let mut r = semi_implicit::Relaxation { state, accuracy: 1e-9, work: &mut work, progress: &mut |_, _| {} };
        let end = r.settle(&d, &mut system);
        state = r.state;
        let stride = 1 << g;
        let m = d.segments();
        let mut vals = vec![];
        for j in 0..d.rods() { for i in (0..=m).step_by(stride) { vals.extend(state.x[state.base(j) + i].to_array()); } }
        rich.push(vals);
        println!("n {m} {end:?} residual {:.1e} energy {:.9} tip {:?} time {:?} {work:?}", d.residual(&state), d.energy(&state)*leaf.scale.moment(), state.x[m]*leaf.scale.length, t.elapsed());
        if let Some((v, e)) = rich.best(1.0) { println!("   best tip {:?} est {e:.2e}", &v[3*n..3*n+3]); }
        if g + 1 < grids {
        let fine = prolong::prolong(&d, &state);
        d = DiscreteLeaf::new(&leaf, d.grid.refined());
        state = fine; }
    }
}
