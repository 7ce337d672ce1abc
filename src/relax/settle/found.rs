//! What a run found, to which it returns if further grids lead nowhere.

use crate::newton::Contraction;
use crate::relax::accuracy::defect::{Estimate, Linear};
use crate::relax::path::{Path, Stage};
use crate::relax::saddle::Saddle;
use crate::relax::settle::run::Run;
use crate::relax::transfer::level::Level;

/// What a run found on its grids, and how it came there: see its fields of the same names. Work
/// and the limits on it go on being counted.
pub struct Found {
    levels: Vec<Level>,
    estimate: Option<Estimate>,
    linear: Option<Linear>,
    added_for_nodes: bool,
    index: Option<usize>,
    clearly_stable: bool,
    saddle: Option<Saddle>,
    effects: [Option<f64>; 2],
    solved: usize,
    remaining: f64,
    contraction: Contraction,
    pushes: i32,
    path: Option<Path>,
    reached: Option<(Stage, f64)>,
    from_start: Option<(f64, usize)>,
    unconfirmed: bool,
}

impl Run<'_, '_> {
    /// What was found so far; its estimate and the equations for it are taken out of the run.
    pub fn found(&mut self) -> Found {
        Found {
            levels: self.levels.clone(),
            estimate: self.estimate.take(),
            linear: self.linear.take(),
            added_for_nodes: self.added_for_nodes,
            index: self.index,
            clearly_stable: self.clearly_stable,
            saddle: self.saddle,
            effects: self.effects,
            solved: self.solved,
            remaining: self.remaining,
            contraction: self.contraction,
            pushes: self.pushes,
            path: self.path.clone(),
            reached: self.reached,
            from_start: self.from_start,
            unconfirmed: self.unconfirmed,
        }
    }

    /// Returns to what was found before.
    pub fn return_to(&mut self, before: Found) {
        self.levels = before.levels;
        self.tabulate();
        (self.estimate, self.linear) = (before.estimate, before.linear);
        self.added_for_nodes = before.added_for_nodes;
        (self.index, self.clearly_stable) = (before.index, before.clearly_stable);
        (self.saddle, self.effects) = (before.saddle, before.effects);
        (self.solved, self.remaining) = (before.solved, before.remaining);
        (self.contraction, self.pushes) = (before.contraction, before.pushes);
        (self.path, self.reached) = (before.path, before.reached);
        (self.from_start, self.unconfirmed) = (before.from_start, before.unconfirmed);
    }
}

#[cfg(test)]
mod tests {
    use crate::leaf::{Grid, Leaf};
    use crate::relax::path::{Path, Stage};
    use crate::relax::request::options::{Options, Progress};
    use crate::relax::settle::run::Run;
    use crate::scenario::Scenario;

    const ROD: &str = r#"
        name = "rod"
        leaf = { rods = 1, length = 1.0, fan = [0.3] }
        stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = 100.0, shear_2 = 50.0, shear_3 = 50.0 }
        load = { gravity = [0.0, 0.0, -1.0] }
    "#;

    /// What a run finds after that, on other grids and by another path, is forgotten with all of its
    /// traces.
    #[test]
    fn a_run_returns_to_all_that_it_had_found() {
        let scenario = Scenario::from_toml(ROD).unwrap();
        let (leaf, options) = (Leaf::new(&scenario), Options::default());
        let mut ignored = |_: &Progress| {};
        let mut run = Run::new(&leaf, &options, 1e-8, &mut ignored);
        run.path = Some(Path::Released);
        run.solve(Grid::new(8, &[])).unwrap();
        let numbers = |run: &Run| {
            let state = [run.from_start.map_or(0.0, |it| it.0), run.remaining];
            let path = (run.path.clone(), run.reached, run.pushes);
            let flags = [run.added_for_nodes, run.unconfirmed, run.clearly_stable];
            let linear = run.linear.as_ref().map(|linear| linear.grid());
            let grids = (run.segments_of_estimate(), run.error(), linear);
            let newton = format!("{:?}", run.contraction);
            (state, path, flags, grids, newton, run.index)
        };
        let before = numbers(&run);
        assert!(run.linear.is_some() && run.contraction.is_measured());
        let found = run.found();
        run.restart();
        run.solve(Grid::new(16, &[])).unwrap();
        run.path = Some(Path::STABLE);
        run.reached = Some((Stage::Loading, 0.5));
        (run.from_start, run.pushes) = (None, 3);
        (run.added_for_nodes, run.unconfirmed) = (true, true);
        assert!(numbers(&run) != before);
        run.return_to(found);
        assert_eq!(numbers(&run), before);
    }
}
