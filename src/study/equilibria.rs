//! Equilibria of a leaf, as far as many starts find them.

use crate::relax::{
    Equilibrium, Options, RelaxError, SemiImplicit, Shape, relax, serialize_index,
    without_wind_or_followers,
};
use crate::run::{Instant, Limit, join_remarks};
use crate::scenario::Scenario;
use crate::shape::serialize_tips;
use crate::study::judge::{common_stations, rod_differences};
use crate::study::remark::EquilibriaRemark;
use glam::DVec3;
use rayon::prelude::*;
use serde::{Serialize, Serializer};

/// The search for equilibria, which also ends after [`MOST_FRUITLESS_STARTS`].
struct EquilibriaSearch {
    /// Starts relaxed in parallel, before the next check for new equilibria.
    parallel_starts: usize,
    /// Largest number of starts.
    most_starts: usize,
    /// Equilibria closer to each other than this part of the longest rod, or than their error
    /// estimates, are the same.
    same_distance: f64,
    /// Energies that differ by less than this, relatively, are the same.
    same_energy: f64,
    /// Tolerance to which a start is relaxed first. If it ends in a stable equilibrium that is known, it is not relaxed
    /// any further: with this error and that of the known one the distance at which they are the same is still
    /// `same_distance`.
    rough_tolerance: f64,
}

const SEARCH: EquilibriaSearch = EquilibriaSearch {
    parallel_starts: 16,
    most_starts: 160,
    same_distance: 1e-3,
    same_energy: 1e-6,
    rough_tolerance: 2e-4,
};

/// The search ends after so many starts in a row without a new equilibrium, or after
/// all starts.
pub const MOST_FRUITLESS_STARTS: usize = 32;

/// The equilibria of a leaf that many starts have found. As JSON it is
/// `equilibria.json`.
#[derive(Clone, Debug, Serialize)]
pub struct Equilibria {
    /// Name of the scenario.
    pub scenario: String,
    /// Number of starts.
    pub starts: usize,
    /// Number of starts that did not come to rest within the tolerance.
    pub failed: usize,
    /// The equilibria, lowest energy first.
    #[serde(rename = "equilibria")]
    pub found: Vec<FoundEquilibrium>,
    /// Whether a stable one has less energy than that in which a relaxation ends, and whether the
    /// search was stopped.
    #[serde(rename = "remark", serialize_with = "serialize_remarks")]
    pub remarks: Vec<EquilibriaRemark>,
    /// Total time, in seconds.
    pub wall_seconds: f64,
}

/// One of the equilibria.
#[derive(Clone, Debug)]
pub struct FoundEquilibrium {
    /// The equilibrium.
    pub equilibrium: Equilibrium,
    /// Starts that ended in it.
    pub starts: usize,
    /// Whether one of them is the unperturbed start, that of a relaxation.
    pub plain: bool,
}

/// An equilibrium as JSON: what identifies it, and its shape.
impl Serialize for FoundEquilibrium {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Keys<'a> {
            energy: Option<f64>,
            #[serde(flatten, serialize_with = "serialize_index")]
            negative_eigenvalues: Option<usize>,
            #[serde(flatten, serialize_with = "serialize_tips")]
            tips: &'a [DVec3],
            error_estimate: Option<f64>,
            segments: &'a [usize],
            starts: usize,
            plain: bool,
            #[serde(flatten)]
            shape: &'a Shape,
        }
        let leaf = &self.equilibrium;
        Keys {
            energy: leaf.energy,
            negative_eigenvalues: leaf.stability.negative_eigenvalues,
            tips: &leaf.tips,
            error_estimate: leaf.accuracy.error_estimate,
            segments: &leaf.accuracy.segments,
            starts: self.starts,
            plain: self.plain,
            shape: &leaf.shape,
        }
        .serialize(serializer)
    }
}

/// Relaxes the leaf from its unperturbed start, from many perturbed ones,
/// and to the equilibrium, stable or not, that Newton's method finds. No number of
/// starts can prove that there are no other equilibria. If `limit` is reached, the result is
/// what has been found until then.
pub fn equilibria(
    scenario: &Scenario,
    how: SemiImplicit,
    tolerance: Option<f64>,
    limit: &Limit,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<Equilibria, RelaxError> {
    without_wind_or_followers(scenario, "the search for all shapes")?;
    let clock = Instant::now();
    let mut all = Equilibria {
        scenario: scenario.name.clone(),
        found: Vec::new(),
        starts: 0,
        failed: 0,
        remarks: Vec::new(),
        wall_seconds: 0.0,
    };
    let wanted = tolerance.unwrap_or(scenario.tolerance);
    let find_within = |how: SemiImplicit, tolerance: f64| {
        let options = Options {
            method: how.into(),
            tolerance: Some(tolerance),
            limit: limit.clone(),
            ..Options::default()
        };
        relax(scenario, &options, &mut |_| {})
    };
    let find = |how: SemiImplicit| find_within(how, wanted);
    all.add_equilibrium(find(how)?, true);
    let of_any_index = SemiImplicit {
        keep_unstable: true,
        ..how
    };
    let mut in_vain = 0;
    let mut next = 0;
    while next < SEARCH.most_starts && in_vain < MOST_FRUITLESS_STARTS && !limit.reached() {
        let disturbed = (next..next + SEARCH.parallel_starts).map(|number| SemiImplicit {
            disturbance: Some(number),
            ..how
        });
        // A saddle may need far finer grids than the others: its start is the first of all.
        let starts: Vec<SemiImplicit> = (next == 0)
            .then_some(of_any_index)
            .into_iter()
            .chain(disturbed)
            .collect();
        let rough = SEARCH.rough_tolerance;
        let end = |start: &SemiImplicit| {
            if rough > wanted
                && !start.keep_unstable
                && let Ok(ended) = find_within(*start, rough)
                && is_at_stable_rest(&ended)
            {
                return Ok(EndOfStart::Rough(Box::new(ended)));
            }
            Ok(EndOfStart::Relaxed(Box::new(find(*start)?)))
        };
        let ends: Result<Vec<EndOfStart>, RelaxError> = starts.par_iter().map(end).collect();
        let ends = ends?;
        // Of the starts that led to one new equilibrium only the first is relaxed any further.
        let new: Vec<bool> = (0..ends.len())
            .map(|k| ends[k].is_first_in_new(&ends[..k], &all))
            .collect();
        let end = |(ended, (start, new)): (EndOfStart, (&SemiImplicit, bool))| match new {
            true => Ok(EndOfStart::Relaxed(Box::new(find(*start)?))),
            false => Ok(ended),
        };
        let batch: Vec<_> = ends.into_iter().zip(starts.iter().zip(new)).collect();
        let batch: Vec<Result<EndOfStart, RelaxError>> = batch.into_par_iter().map(end).collect();
        next += SEARCH.parallel_starts;
        for (start, ended) in starts.iter().zip(batch) {
            let before = all.found.len();
            let ended = match ended? {
                EndOfStart::Relaxed(ended) => *ended,
                EndOfStart::Rough(rough) => match all.known_stable(&rough) {
                    Some(number) => {
                        all.starts += 1;
                        all.found[number].starts += 1;
                        in_vain += 1;
                        continue;
                    }
                    // At full accuracy the first led elsewhere.
                    None => find(*start)?,
                },
            };
            if limit.reached() && !ended.outcome.is_success() {
                // Stopped on its way, which says nothing of its start.
                continue;
            }
            all.add_equilibrium(ended, false);
            in_vain = match all.found.len() > before {
                true => 0,
                false if start.keep_unstable => in_vain,
                false => in_vain + 1,
            };
        }
        progress(all.starts, all.found.len());
    }
    all.found.sort_by(|a, b| {
        let [a, b] = [a, b].map(|found| found.equilibrium.energy.unwrap_or(f64::NAN));
        a.total_cmp(&b)
    });
    all.remarks.extend(all.lower_energy_remark());
    if limit.reached() {
        let starts = all.starts;
        all.remarks.push(EquilibriaRemark::Stopped { starts });
    }
    all.wall_seconds = clock.elapsed().as_secs_f64();
    Ok(all)
}

/// Where a start led.
enum EndOfStart {
    /// To a stable equilibrium, to the rough tolerance.
    Rough(Box<Equilibrium>),
    /// To this, to the tolerance that is wanted.
    Relaxed(Box<Equilibrium>),
}

impl EndOfStart {
    /// Whether it is a rough approximation to a stable equilibrium that is not `known`, and none of the ends `before` it
    /// is of the same.
    fn is_first_in_new(&self, before: &[EndOfStart], known: &Equilibria) -> bool {
        let EndOfStart::Rough(rough) = self else {
            return false;
        };
        let is_same = |end: &EndOfStart| match end {
            EndOfStart::Rough(other) | EndOfStart::Relaxed(other) => {
                is_at_stable_rest(other) && is_same_equilibrium(other, rough)
            }
        };
        known.known_stable(rough).is_none() && !before.iter().any(is_same)
    }
}

fn is_at_stable_rest(equilibrium: &Equilibrium) -> bool {
    equilibrium.outcome.is_success() && equilibrium.stable() == Some(true)
}

impl Equilibria {
    /// The number of the stable equilibrium to which this one is a rough approximation.
    fn known_stable(&self, rough: &Equilibrium) -> Option<usize> {
        if !is_at_stable_rest(rough) {
            return None;
        }
        self.found.iter().position(|found| {
            let known = &found.equilibrium;
            known.stable() == Some(true) && is_same_equilibrium(known, rough)
        })
    }

    fn add_equilibrium(&mut self, equilibrium: Equilibrium, plain: bool) {
        self.starts += 1;
        if !equilibrium.outcome.is_success() {
            self.failed += 1;
            return;
        }
        let mut known = self.found.iter_mut();
        match known.find(|found| is_same_equilibrium(&found.equilibrium, &equilibrium)) {
            Some(found) => {
                found.starts += 1;
                found.plain |= plain;
            }
            None => self.found.push(FoundEquilibrium {
                equilibrium,
                starts: 1,
                plain,
            }),
        }
    }
}

impl Equilibria {
    /// Its remarks in one sentence, if there are any.
    pub fn remark(&self) -> Option<String> {
        join_remarks(&self.remarks)
    }

    /// The stable equilibrium with less energy than that of the unperturbed start, if any.
    fn lower_energy_remark(&self) -> Option<EquilibriaRemark> {
        let plain = self.found.iter().position(|found| found.plain)?;
        let stable = |found: &FoundEquilibrium| found.equilibrium.stable() == Some(true);
        let lowest = self.found.iter().position(stable)?;
        let [least, energy] = [lowest, plain].map(|k| self.found[k].equilibrium.energy);
        let (least, energy) = (least?, energy?);
        // Mirror images differ by rounding only.
        let difference = energy - least;
        (difference > SEARCH.same_energy * energy.abs()).then_some(EquilibriaRemark::LowerEnergy {
            plain,
            lowest,
            difference,
        })
    }
}

fn serialize_remarks<S: Serializer>(
    remarks: &[EquilibriaRemark],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    join_remarks(remarks).serialize(serializer)
}

fn is_same_equilibrium(a: &Equilibrium, b: &Equilibrium) -> bool {
    let errors = [a, b].map(|leaf| leaf.accuracy.error_estimate.unwrap_or(0.0));
    let within = (SEARCH.same_distance * a.shape.longest()).max(2.0 * (errors[0] + errors[1]));
    // Their grids may differ: compared at common stations.
    let both = common_stations(&a.shape.stations, &b.shape.stations);
    let mut apart = rod_differences(&both, &a.shape.rods, &b.shape.rods).flatten();
    apart.all(|apart| apart.position < within)
}
