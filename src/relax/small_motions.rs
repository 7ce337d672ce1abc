//! Stability without a potential: the growth rates and frequencies of the linearised motion of a leaf at rest
//! ([`crate::modes`]), on its grids and extrapolated.

use crate::modes::linearized::{MotionRoot, lowest_roots};
use crate::motion::{AssumedMotion, Physics};
use crate::numbers::largest;
use crate::relax::accuracy::NestedEquilibrium;
use crate::relax::accuracy::richardson::{EXTRAPOLATED_GRIDS, Richardson};
use crate::relax::accuracy::transfer::GridLevel;
use crate::relax::plan::{RelaxationProblem, UNKNOWNS};
use crate::relax::solve_on_grid::follower_loads::WithoutPotential;
use crate::words;
use serde::{Serialize, Serializer};

words! {
    /// How a leaf leaves an unstable equilibrium.
    pub enum MotionInstability {
        /// In oscillations that grow.
        Flutter = "flutter",
        /// Without oscillations.
        Divergence = "divergence",
    }
}

/// Roots that are computed even if fewer are requested: one of the lowest modes is the first that grows.
const LEAST_ROOTS: usize = 8;

/// Growth, as a part of the size of a root, that is rounding.
const GROWTH_ROUNDING: f64 = 1e-6;

/// Growth rates and frequencies of the small motions about an equilibrium, in the scenario's unit of time.
#[derive(Clone, Debug, PartialEq)]
pub struct SmallMotions {
    /// Rates of growth, negative where a motion decays: of the lowest modes, and of all further ones that
    /// were found to grow; the slowest motions first.
    pub growth_rates: Vec<f64>,
    /// Their angular frequencies, radians per time; zero of what does not oscillate.
    pub frequencies: Vec<f64>,
    /// Bounds on the errors of either, if there are grids to compare.
    pub errors: Option<Vec<f64>>,
    /// Whether no motion grows; `None` where grids tell otherwise, or growth is within its error.
    pub stable: Option<bool>,
    /// How the motion that grows fastest does, if one does.
    pub instability: Option<MotionInstability>,
    /// What is assumed of masses and damping.
    pub assumed: AssumedMotion,
}

/// A root extrapolated over grids.
#[derive(Clone, Copy)]
struct ExtrapolatedRoot {
    root: MotionRoot,
    error: Option<f64>,
}

impl ExtrapolatedRoot {
    /// Whether it grows, if that is certain.
    fn grows(&self) -> Option<bool> {
        let growth = self.root.growth;
        match self.error {
            _ if growth.abs() <= GROWTH_ROUNDING * self.root.size() => Some(false),
            Some(error) if growth.abs() <= error => None,
            _ => Some(growth > 0.0),
        }
    }
}

/// The small motions of a leaf at rest; `None` if they cannot be computed: the leaf is too large, or roots do
/// not converge.
pub fn small_motions(
    problem: &RelaxationProblem,
    found: &NestedEquilibrium,
) -> Option<SmallMotions> {
    let (physics, assumed) = Physics::for_small_motions(problem.leaf);
    let count = LEAST_ROOTS.max(problem.options.modes);
    let on = |level: &GridLevel| {
        let unknowns = 6 * level.leaf.rods() * level.leaf.segments();
        if unknowns > UNKNOWNS.without_shapes {
            return None;
        }
        let forces = WithoutPotential::in_motion(&level.leaf, &physics);
        let limit = &problem.options.limit;
        lowest_roots(&level.leaf, &physics, &level.state, &forces, count, limit)
    };
    let skipped = found.levels.len().saturating_sub(EXTRAPOLATED_GRIDS);
    let mut grids: Vec<(usize, Vec<MotionRoot>)> = Vec::new();
    for level in found.levels.iter().skip(skipped) {
        match on(level) {
            Some(roots) => grids.push((level.leaf.segments(), roots)),
            // The series needs consecutive grids.
            None if grids.is_empty() => {}
            None => break,
        }
    }
    let (_, finest) = grids.last()?;
    let roots: Vec<ExtrapolatedRoot> = (0..finest.len()).map(|k| extrapolated(&grids, k)).collect();
    let grow: Vec<Option<bool>> = roots.iter().map(ExtrapolatedRoot::grows).collect();
    let stable = match grow.contains(&Some(true)) {
        true => Some(false),
        false => (!grow.contains(&None)).then_some(true),
    };
    let fastest = (roots.iter().zip(&grow)).filter(|(_, grows)| **grows == Some(true));
    let fastest = fastest.max_by(|(a, _), (b, _)| a.root.growth.total_cmp(&b.root.growth));
    let instability = fastest.map(|(it, _)| match it.root.frequency > 0.0 {
        true => MotionInstability::Flutter,
        false => MotionInstability::Divergence,
    });
    let listed: Vec<ExtrapolatedRoot> = (roots.iter().zip(&grow).enumerate())
        .filter(|(k, (_, grows))| *k < problem.options.modes || **grows == Some(true))
        .map(|(_, (root, _))| *root)
        .collect();
    let rate = 1.0 / physics.time_unit;
    Some(SmallMotions {
        growth_rates: listed.iter().map(|it| it.root.growth * rate).collect(),
        frequencies: listed.iter().map(|it| it.root.frequency * rate).collect(),
        errors: listed.iter().map(|it| Some(it.error? * rate)).collect(),
        stable,
        instability,
        assumed,
    })
}

/// The root with this number, extrapolated over the finest grids on which it is of one kind.
fn extrapolated(grids: &[(usize, Vec<MotionRoot>)], k: usize) -> ExtrapolatedRoot {
    let (_, finest) = &grids[grids.len() - 1];
    let root = finest[k];
    let kind = |it: &MotionRoot| {
        let grows = it.growth > GROWTH_ROUNDING * it.size();
        (grows, it.frequency > 0.0)
    };
    let alike = grids.iter().rev().take_while(|(_, roots)| {
        roots.get(k).is_some_and(|it| kind(it) == kind(&root))
    });
    let count = alike.count();
    let series = &grids[grids.len() - count..];
    let values = |it: &MotionRoot| vec![it.growth, it.frequency];
    let table: Richardson = (series.iter().map(|(segments, roots)| (*segments, values(&roots[k])))).collect();
    let [growth, frequency] = table.extrapolated() else {
        return ExtrapolatedRoot { root, error: None };
    };
    let all = grids.len();
    let error = match table.best() {
        Some(best) => Some(best.error + GROWTH_ROUNDING * root.size()),
        // On the grid before it was another root.
        None if all > 1 => {
            let (_, before) = &grids[all - 2];
            let sizes = before.get(k).map(|it| (it.growth - root.growth).hypot(it.frequency - root.frequency));
            Some(largest(sizes))
        }
        None => None,
    };
    ExtrapolatedRoot {
        root: MotionRoot {
            growth: *growth,
            frequency: *frequency,
        },
        error,
    }
}

impl SmallMotions {
    /// As the keys `growth_rates`, `frequencies`, `motion_errors`, `instability` and `assumed`.
    pub(crate) fn serialize_keys<M: serde::ser::SerializeMap>(
        motions: Option<&SmallMotions>,
        map: &mut M,
    ) -> Result<(), M::Error> {
        let Some(motions) = motions else {
            return Ok(());
        };
        map.serialize_entry("growth_rates", &motions.growth_rates)?;
        map.serialize_entry("frequencies", &motions.frequencies)?;
        map.serialize_entry("motion_errors", &motions.errors)?;
        map.serialize_entry("instability", &motions.instability)?;
        map.serialize_entry("assumed", &Assumptions(motions.assumed))
    }
}

/// What is assumed, as a list of words.
struct Assumptions(AssumedMotion);

impl Serialize for Assumptions {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.0.words())
    }
}
