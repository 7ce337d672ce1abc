//! The forces and moments that a leaf exerts on what holds it and the largest stresses along its veins,
//! with their errors.

use crate::leaf::{DiscreteLeaf, FieldChange, Scale};
use crate::numbers::{larger, largest};
use crate::relax::accuracy::richardson::{EXTRAPOLATED_GRIDS, Extrapolated, Richardson};
use crate::relax::accuracy::transfer::{GridLevel, NodalResultants};
use crate::relax::accuracy::{FieldErrors, NestedEquilibrium};
use crate::relax::remark::EquilibriumDoubt;
use crate::rod::Wrench;
use crate::scenario::{Grip, Moduli, Scenario, Stress, SupportKind};
use crate::shape::{RodShape, STATION_TOLERANCE};
use glam::DVec3;
use serde::Serialize;
use std::ops::RangeInclusive;

/// Rounding error of a strain, per segment of a rod.
const STRAIN_ROUNDING: f64 = 4.0 * f64::EPSILON;

/// The error by the defect is taken unless it is this many times that of the extrapolation: of nearly
/// rigid rods the response to a jump by rounding is a force that is none. At 1, the lesser of both
/// was too small in 2 of 344 random leaves, where the extrapolation's was small by chance.
const SPURIOUS_DEFECT: f64 = 30.0;

/// What the bars of the forces and moments on bases are made from, besides those of extrapolation and defect.
struct BaseBar {
    /// Safety factor where the leaf was not integrated along its rods, as in grips and in wind: of 3,600 forces and
    /// moments on the bases of 250 random leaves the largest error was 2.0 times the bar without it.
    not_integrated: f64,
    /// Safety factor where tissue is strained by its veins: layers as thin as its gaps begin at the clamps. Of
    /// 1,250 forces and moments on the bases of 30 random blades the largest error was 3.9 times the bar without it.
    layers: f64,
    /// Part of the errors on single bases that their sum may have where the linear equations tell that they
    /// cancel.
    uncancelled: f64,
    /// Rounding of a sum over all bases, relative to the sizes of what is summed.
    rounding: f64,
}

const BASE_BAR: BaseBar = BaseBar {
    not_integrated: 2.5,
    layers: 6.0,
    uncancelled: 0.25,
    rounding: 16.0 * f64::EPSILON,
};

/// Safety factor on the bars of reactions of grips that give, whose forces are those of displacements: of 860 forces and
/// moments on holders of 117 random leaves on springs the largest error was 2.8 times the bar without it.
const ELASTIC_GRIP_SAFETY: f64 = 4.0;

/// The reaction at a held tip: what the leaf exerts on its holder.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Reaction {
    /// The force.
    #[serde(rename = "tip_reaction")]
    pub force: DVec3,
    /// For a clamp, the moments of the rods about the tip.
    #[serde(
        rename = "tip_reaction_moments",
        skip_serializing_if = "Option::is_none"
    )]
    pub moments: Option<Vec<DVec3>>,
    /// Bound on the error of the force; `None` on a single grid.
    #[serde(rename = "tip_reaction_error", skip_serializing_if = "Option::is_none")]
    pub error: Option<f64>,
    /// Bound on the error of the moments.
    #[serde(
        rename = "tip_reaction_moments_error",
        skip_serializing_if = "Option::is_none"
    )]
    pub moments_error: Option<f64>,
}

/// What the leaf exerts on a grip.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct GripReaction {
    /// The force.
    pub force: DVec3,
    /// For a clamp, the moment about the middle of what it holds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub moment: Option<DVec3>,
    /// Bound on the error of the force; `None` on a single grid.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<f64>,
    /// Bound on the error of the moment.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub moment_error: Option<f64>,
}

/// What the leaf exerts on the support of a base, or on those of all bases.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BaseReaction {
    /// The force.
    pub force: DVec3,
    /// The moment about the base, none on a hinge on which it may spin; on all supports together about the mean of the bases.
    pub moment: Option<DVec3>,
    /// Bound on the error of the force; `None` on a single grid that was not integrated along its rods.
    pub error: Option<f64>,
    /// Bound on the error of the moment.
    pub moment_error: Option<f64>,
}

/// What the leaf exerts on the supports of its bases, in the lab frame.
pub struct BaseReactions {
    /// On that of every vein.
    pub each: Vec<BaseReaction>,
    /// On all of them.
    pub all: BaseReaction,
}

impl BaseReactions {
    /// Those on bases at these `places`, `held` those that carry moments, from force and moment on each and bounds on the
    /// errors of any force and of any moment; all in the units of the scenario.
    pub fn from_each(
        places: &[DVec3],
        on_bases: &[Wrench],
        held: &[bool],
        [error, moment_error]: [f64; 2],
    ) -> Self {
        let each = on_bases.iter().zip(held).map(|(on_base, held)| {
            let directed = *held;
            BaseReaction {
                force: on_base.force,
                error: Some(error),
                moment: directed.then_some(on_base.moment),
                moment_error: directed.then_some(moment_error),
            }
        });
        let all = resultant(places, on_bases);
        let bound = Wrench {
            force: error * DVec3::X,
            moment: moment_error * DVec3::X,
        };
        let errors = summed_sizes(places, &vec![bound; places.len()]);
        BaseReactions {
            each: each.collect(),
            all: BaseReaction {
                force: all.force,
                error: Some(errors[0]),
                moment: Some(all.moment),
                moment_error: Some(errors[1]),
            },
        }
    }
}

/// Forces and moments on the supports of bases, or on all of them together, on a grid of so many segments;
/// dimensionless.
struct BasesOnGrid {
    segments: usize,
    wrenches: Vec<Wrench>,
}

/// Forces and moments on the supports of the bases of a leaf that was integrated along its rods, or on all of
/// them together; dimensionless.
struct IntegratedBases {
    wrenches: Vec<Wrench>,
    /// Their errors.
    errors: Vec<Wrench>,
    /// Bounds on the errors of the forces and of the moments.
    bounds: [f64; 2],
}

impl IntegratedBases {
    fn new(leaf: &DiscreteLeaf, FieldErrors { estimate, safety }: FieldErrors) -> Self {
        let on_base = |j: usize, moment: DVec3| match leaf.leaf.base_carries_moment(j) {
            true => moment,
            false => DVec3::ZERO,
        };
        let rods = estimate.rods.iter().enumerate();
        let wrenches = rods.map(|(j, rod)| Wrench {
            force: rod[0].n,
            moment: on_base(j, rod[0].m + leaf.dead_moment_on_clamp()),
        });
        let errors = estimate.errors.iter().enumerate();
        let errors = errors.map(|(j, rod)| Wrench {
            force: safety * rod[0].force,
            moment: on_base(j, safety * rod[0].moment),
        });
        let errors: Vec<Wrench> = errors.collect();
        IntegratedBases {
            wrenches: wrenches.collect(),
            bounds: PARTS.map(|part| largest(errors.iter().map(|it| part(it).length()))),
            errors,
        }
    }

    /// Those on the supports of all bases at these places.
    fn together(&self, places: &[DVec3]) -> Self {
        let off = resultant(places, &self.errors);
        let [force, moment] = summed_sizes(places, &self.errors);
        IntegratedBases {
            wrenches: vec![resultant(places, &self.wrenches)],
            bounds: [
                off.force.length() + BASE_BAR.uncancelled * force,
                off.moment.length() + BASE_BAR.uncancelled * moment,
            ],
            errors: vec![off],
        }
    }
}

/// The force of a wrench, and its moment.
const PARTS: [fn(&Wrench) -> DVec3; 2] = [|it| it.force, |it| it.moment];

/// Forces and moments on bases with their errors: from their series on grids or, where it tells more, from the
/// integration.
fn state_wrenches(
    series: &[BasesOnGrid],
    integrated: Option<IntegratedBases>,
    noise: [ForceNoise; 2],
) -> [Extrapolated<Vec<DVec3>>; 2] {
    [0, 1].map(|k| {
        let of = |wrenches: &[Wrench]| wrenches.iter().map(PARTS[k]).collect::<Vec<DVec3>>();
        let grids: Vec<_> = (series.iter())
            .map(|it| (it.segments, of(&it.wrenches)))
            .collect();
        let extrapolated = extrapolate_series(&grids, noise[k]);
        let Some(integrated) = &integrated else {
            return extrapolated;
        };
        let value = of(&integrated.wrenches);
        let size = largest(value.iter().map(|it| it.length()));
        let error = integrated.bounds[k] + noise[k].relative * size + noise[k].rounding;
        match extrapolated.error {
            Some(other) if error >= SPURIOUS_DEFECT * other => extrapolated,
            _ => Extrapolated {
                value,
                error: Some(error),
            },
        }
    })
}

/// From the mean of `places` to each.
fn arms(places: &[DVec3]) -> impl Iterator<Item = DVec3> {
    let mean = places.iter().sum::<DVec3>() / places.len() as f64;
    places.iter().map(move |place| *place - mean)
}

/// The sum of forces at `places`, and of these and moments the moment about the mean of the places.
fn resultant(places: &[DVec3], forces: &[Wrench]) -> Wrench {
    let each = arms(places).zip(forces);
    each.fold(Wrench::default(), |sum, (arm, own)| Wrench {
        force: sum.force + own.force,
        moment: sum.moment + own.moment + arm.cross(own.force),
    })
}

/// The sums of the sizes of forces at `places`, and of all moments about the mean of the places.
fn summed_sizes(places: &[DVec3], forces: &[Wrench]) -> [f64; 2] {
    let each = arms(places).zip(forces);
    each.fold([0.0; 2], |[force, moment], (arm, own)| {
        let size = own.force.length();
        [
            force + size,
            moment + own.moment.length() + arm.length() * size,
        ]
    })
}

/// Errors of forces on a grid that are not errors of the grid.
#[derive(Clone, Copy)]
struct ForceNoise {
    /// By unfinished iterations, as a part of the force.
    relative: f64,
    /// By rounding of positions, in units of A/L^2.
    rounding: f64,
}

/// Numbers of a leaf on nested grids as vectors, extrapolated as far as their own series shows.
fn extrapolate_vectors(
    levels: &[GridLevel],
    on: impl Fn(&GridLevel) -> Vec<DVec3>,
    noise: ForceNoise,
) -> Extrapolated<Vec<DVec3>> {
    let on = |level: &GridLevel| (level.leaf.segments(), on(level));
    let series: Vec<_> = extrapolated_levels(levels).iter().map(on).collect();
    extrapolate_series(&series, noise)
}

/// The grids over which forces are extrapolated.
fn extrapolated_levels(levels: &[GridLevel]) -> &[GridLevel] {
    &levels[levels.len().saturating_sub(EXTRAPOLATED_GRIDS)..]
}

/// Vectors on grids of so many segments, extrapolated as far as their series shows.
fn extrapolate_series(
    series: &[(usize, Vec<DVec3>)],
    noise: ForceNoise,
) -> Extrapolated<Vec<DVec3>> {
    let ForceNoise { relative, rounding } = noise;
    let values = series.iter().map(|(_, vectors)| vectors);
    let all = values.flatten().map(|vector| vector.length());
    let size = largest(all);
    let scale = if size > 0.0 { size } else { 1.0 };
    let table: Richardson = (series.iter())
        .map(|(segments, vectors)| {
            let numbers = vectors.iter().flat_map(|it| (*it / scale).to_array());
            (*segments, numbers.collect())
        })
        .collect();
    let table = table.with_noise(rounding / scale);
    let best = table.few_values_error();
    let found = table.column(best.map_or(0, |best| best.columns));
    let error = best.map(|best| (best.error + relative) * scale + rounding);
    let vectors = found.chunks(3).map(|it| DVec3::from_slice(it) * scale);
    Extrapolated {
        value: vectors.collect(),
        error,
    }
}

impl NestedEquilibrium {
    fn force_noise(&self) -> ForceNoise {
        let rounding = |leaf: &DiscreteLeaf| {
            STRAIN_ROUNDING * leaf.segments() as f64 * leaf.largest_finite_stiffness()
        };
        let held = self
            .levels
            .last()
            .filter(|level| level.leaf.leaf.has_placed_supports());
        let rounding = held.map_or(0.0, |level| rounding(&level.leaf));
        ForceNoise {
            relative: self.history.iteration_error,
            rounding,
        }
    }

    /// The reaction at a held tip.
    pub fn reaction(&self) -> Option<Reaction> {
        let leaf = &self.levels[0].leaf.leaf;
        let held = leaf.tip_support.as_ref()?;
        let noise = self.force_noise();
        let clamped = held.clamps.is_some();
        let force = |level: &GridLevel| vec![level.leaf.reaction(&level.state).force];
        let moments = |level: &GridLevel| level.leaf.reaction(&level.state).moments;
        let forces = extrapolate_vectors(&self.levels, force, noise);
        let (mut force, mut error) = (forces.value[0], forces.error);
        let Extrapolated {
            value: mut moments,
            error: mut moments_error,
        } = extrapolate_vectors(&self.levels, moments, noise);
        if let Some(FieldErrors { estimate, safety }) = self.field_errors() {
            let tips = || estimate.rods.iter().filter_map(|rod| rod.last());
            let level = &self.levels[0].leaf;
            let off = |of: fn(&FieldChange) -> DVec3| {
                let tips = estimate.errors.iter().filter_map(|rod| rod.last());
                tips.map(move |tip| safety * of(tip).length())
            };
            let bar = |error: f64, size: f64| error + noise.relative * size + noise.rounding;
            let largest_moment = largest(tips().map(|tip| tip.m.length()));
            let own = bar(off(|tip| tip.force).sum(), force.length());
            let own_of_moments = bar(largest(off(|tip| tip.moment)), largest_moment);
            if error.is_none_or(|error| own < SPURIOUS_DEFECT * error) {
                let forces = tips().enumerate();
                force = forces.map(|(j, tip)| level.tip_force(j) - tip.n).sum();
                error = Some(own);
            }
            if moments_error.is_none_or(|error| own_of_moments < SPURIOUS_DEFECT * error) {
                moments = tips()
                    .enumerate()
                    .map(|(j, tip)| {
                        level.dead_moment_at(1.0) + level.lever_moment_at(j, 1.0, tip.q) - tip.m
                    })
                    .collect();
                moments_error = Some(own_of_moments);
            }
        }
        let of = |all: Vec<DVec3>| all.iter().map(|it| *it * leaf.scale.moment()).collect();
        Some(Reaction {
            force: force * leaf.scale.force(),
            error: error.map(|error| error * leaf.scale.force()),
            moments: clamped.then(|| of(moments)),
            moments_error: moments_error
                .filter(|_| clamped)
                .map(|error| error * leaf.scale.moment()),
        })
    }

    /// What the leaf exerts on the supports of its bases.
    pub fn base_reactions(&self) -> BaseReactions {
        let leaf = &self.levels[0].leaf;
        let scale = leaf.leaf.scale;
        let places: Vec<DVec3> = (0..leaf.rods())
            .map(|j| leaf.leaf.base_pose(j).position)
            .collect();
        let series: Vec<BasesOnGrid> = extrapolated_levels(&self.levels)
            .iter()
            .map(|level| BasesOnGrid {
                segments: level.leaf.segments(),
                wrenches: level.leaf.base_reactions(&level.state),
            })
            .collect();
        let integrated = self
            .field_errors()
            .map(|errors| IntegratedBases::new(leaf, errors));
        let together = |it: &BasesOnGrid| BasesOnGrid {
            segments: it.segments,
            wrenches: vec![resultant(&places, &it.wrenches)],
        };
        let of_all: Vec<BasesOnGrid> = series.iter().map(together).collect();
        let together = |it: &IntegratedBases| it.together(&places);
        let integrated_of_all = integrated.as_ref().map(together);
        let noise = self.force_noise();
        let finest = series.last().map_or(&[][..], |it| &it.wrenches);
        let sums = summed_sizes(&places, finest).map(|sum| ForceNoise {
            rounding: noise.rounding + BASE_BAR.rounding * sum,
            ..noise
        });
        let safety = match integrated {
            Some(_) => 1.0,
            None if leaf.has_tissue_cells() => BASE_BAR.layers,
            None => BASE_BAR.not_integrated,
        };
        let [forces, moments] = state_wrenches(&series, integrated, [noise; 2]);
        let [force, moment] = state_wrenches(&of_all, integrated_of_all, sums);
        let bar = |error: Option<f64>, unit: f64| error.map(|error| safety * error * unit);
        let each = forces.value.iter().zip(&moments.value).enumerate();
        let each = each.map(|(j, (force, moment))| {
            let directed = leaf.leaf.base_carries_moment(j);
            BaseReaction {
                force: *force * scale.force(),
                error: bar(forces.error, scale.force()),
                moment: directed.then(|| *moment * scale.moment()),
                moment_error: bar(moments.error, scale.moment()).filter(|_| directed),
            }
        });
        BaseReactions {
            each: each.collect(),
            all: BaseReaction {
                force: force.value[0] * scale.force(),
                error: bar(force.error, scale.force()),
                moment: Some(moment.value[0] * scale.moment()),
                moment_error: bar(moment.error, scale.moment()),
            },
        }
    }

    /// What the leaf exerts on its grips.
    pub fn grip_reactions(&self) -> Vec<GripReaction> {
        let leaf = &self.levels[0].leaf;
        if !leaf.has_grips() {
            return Vec::new();
        }
        let noise = self.force_noise();
        let on = |part: fn(&Wrench) -> DVec3| {
            move |level: &GridLevel| -> Vec<DVec3> {
                let reactions = level.leaf.grip_reactions(&level.state);
                reactions.iter().map(part).collect()
            }
        };
        let forces = extrapolate_vectors(&self.levels, on(|it| it.force), noise);
        let moments = extrapolate_vectors(&self.levels, on(|it| it.moment), noise);
        let (scenario, scale) = (leaf.leaf.scenario(), leaf.leaf.scale);
        let gives = scenario.foundation.is_some() || !scenario.grips.iter().all(Grip::is_rigid);
        let safety = if gives { ELASTIC_GRIP_SAFETY } else { 1.0 };
        let both = forces.value.iter().zip(&moments.value).zip(&scenario.grips);
        let reaction = |((force, moment), grip): ((&DVec3, &DVec3), &Grip)| {
            let clamped = grip.held == SupportKind::Clamped;
            GripReaction {
                force: *force * scale.force(),
                error: forces.error.map(|error| safety * error * scale.force()),
                moment: clamped.then(|| *moment * scale.moment()),
                moment_error: (moments.error)
                    .filter(|_| clamped)
                    .map(|error| safety * error * scale.moment()),
            }
        };
        both.map(reaction).collect()
    }
}

/// The stress with the largest equivalent one, by a force and a moment along the directors, in the
/// sections at one place.
fn largest_stress(moduli: &[Moduli], n: DVec3, m: DVec3) -> Option<Stress> {
    let stresses = moduli.iter().map(|it| it.stress(n, m));
    stresses.reduce(|one, other| match other.equivalent > one.equivalent {
        true => other,
        false => one,
    })
}

/// The largest stresses of a leaf in each of its sections, at its stations. As JSON the place where
/// the equivalent stress is largest of all: `stress` in `summary.json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Stresses {
    /// The vein with the largest one, from 1.
    pub vein: usize,
    /// The place along it, a fraction of its length.
    pub sigma: f64,
    /// The stresses there.
    #[serde(flatten)]
    pub largest: Stress,
    /// Bound on the error of any of them; `None` on a single grid.
    pub error: Option<f64>,
    /// The stresses at all stations, a list per rod.
    #[serde(skip)]
    pub rods: Vec<Vec<Stress>>,
}

impl Stresses {
    /// The stresses of rods at these stations; `None` if stiffnesses are given in place of sections.
    pub fn of(scenario: &Scenario, stations: &[f64], rods: &[RodShape]) -> Option<Self> {
        let stress = |(j, rod): (usize, &RodShape)| -> Option<Vec<Stress>> {
            let nodes = stations.iter().zip(&rod.nodes);
            let at = |(sigma, node): (&f64, &crate::shape::NodeState)| {
                let moduli = scenario.moduli(j, *sigma);
                largest_stress(&moduli, node.n, node.m)
            };
            nodes.map(at).collect()
        };
        let rods: Vec<_> = rods.iter().enumerate().map(stress).collect::<Option<_>>()?;
        let each = rods.iter().zip(1..);
        let all = each.flat_map(|(rod, vein)| {
            let here = stations.iter().zip(rod);
            here.map(move |(&sigma, &largest)| Stresses {
                vein,
                sigma,
                largest,
                error: None,
                rods: Vec::new(),
            })
        });
        // The first of those that are equal.
        let larger = |one: Stresses, other: Stresses| {
            if other.largest.equivalent > one.largest.equivalent {
                other
            } else {
                one
            }
        };
        let largest = all.reduce(larger)?;
        Some(Stresses { rods, ..largest })
    }

    /// The stresses with the error that follows from those of forces and moments anywhere: a stress is a
    /// norm of both.
    pub fn with_field_errors(self, scenario: &Scenario, errors: Option<[f64; 2]>) -> Self {
        let Some([force, moment]) = errors else {
            return self;
        };
        let moduli = scenario.moduli(self.vein - 1, self.sigma);
        // A section that is not symmetric about d2 is stressed most by moments of one sign.
        let errors = [1.0, -1.0].map(|sign| {
            let moment = moment * DVec3::new(1.0, sign, 1.0);
            largest_stress(&moduli, DVec3::splat(force), moment).map(|it| it.equivalent)
        });
        let [one, other] = errors;
        Stresses {
            error: one.zip(other).map(|(one, other)| larger(one, other)),
            ..self
        }
    }

    /// The stresses with the error of a leaf that was integrated along its rods to these stations, from those of its
    /// forces and moments: a stress is a norm of both, and may be the largest at another station.
    fn integrated(
        self,
        scenario: &Scenario,
        stations: &[f64],
        FieldErrors { estimate, safety }: FieldErrors,
        scale: Scale,
    ) -> Self {
        let places = estimate.errors[0].len() - 1;
        let (nodes, sigma) = (estimate.grid.segments(), estimate.grid.sigma());
        let error = |j: usize, station: f64| -> Option<f64> {
            let i = sigma
                .partition_point(|at| *at < station - STATION_TOLERANCE)
                .min(nodes);
            let fields = &estimate.rods[j][i];
            let along = |it: DVec3| fields.q.conjugate() * it;
            let moduli = scenario.moduli(j, station);
            if moduli.is_empty() {
                return None;
            }
            let at = |place: usize| {
                let off = estimate.errors[j][place];
                let force = along(off.force - off.rotation.cross(fields.n)) * scale.force();
                let moment = along(off.moment - off.rotation.cross(fields.m)) * scale.moment();
                let stress = largest_stress(&moduli, force, moment);
                safety * stress.map_or(0.0, |it| it.equivalent)
            };
            let place = i * places / nodes;
            let next = (i * places).div_ceil(nodes);
            Some(larger(at(place), at(next)))
        };
        let mut most = error(self.vein - 1, self.sigma);
        for (j, rod) in self.rods.iter().enumerate() {
            for (&station, stress) in stations.iter().zip(rod) {
                let reached = error(j, station).map(|error| stress.equivalent + error);
                let above = reached.map(|reached| reached - self.largest.equivalent);
                most = most.zip(above).map(|(most, above)| larger(most, above));
            }
        }
        Stresses {
            error: most,
            ..self
        }
    }

    /// The stresses with the error of a leaf on nested grids at these stations: where it was not integrated, that
    /// of the stresses at the nodes of the coarsest, and the distance of these from their extrapolation.
    pub(in crate::relax) fn with_grid_error(
        self,
        scenario: &Scenario,
        stations: &[f64],
        found: &NestedEquilibrium,
    ) -> Self {
        let scale = found.levels[0].leaf.leaf.scale;
        if let Some(errors) = found
            .field_errors()
            .filter(|_| found.integrated_leaf().is_some())
        {
            return self.integrated(scenario, stations, errors, scale);
        }
        let sigma = found.levels[0].leaf.grid.sigma();
        let rods = self.rods.len();
        let moduli: Vec<Vec<Moduli>> = (0..rods)
            .flat_map(|j| sigma.iter().map(move |at| scenario.moduli(j, *at)))
            .collect();
        if moduli.iter().any(Vec::is_empty) {
            return self;
        }
        let stress = |k: usize, [n, m]: [DVec3; 2]| {
            let stress = largest_stress(&moduli[k], n * scale.force(), m * scale.moment());
            stress.map_or(DVec3::ZERO, |it| DVec3::from_array(it.to_array()))
        };
        let nodes = || (0..rods).flat_map(|j| (0..sigma.len()).map(move |i| (j, i)));
        let on = |level: &GridLevel| -> Vec<DVec3> {
            let stride = level.leaf.segments() / (sigma.len() - 1);
            let resultants = NodalResultants::on_level(level);
            nodes()
                .enumerate()
                .map(|(k, (j, i))| stress(k, resultants.at(j, i * stride)))
                .collect()
        };
        let noise = ForceNoise {
            relative: found.history.iteration_error,
            rounding: 0.0,
        };
        let stresses = extrapolate_vectors(&found.levels, on, noise);
        let told = self.largest.equivalent;
        let peak = largest(stresses.value.iter().map(|it| it.z));
        // Between the nodes of the coarsest grid stresses may be larger, but not those at a node.
        let off = match sigma.contains(&self.sigma) {
            true => (told - peak).abs(),
            false => 0.0,
        };
        Stresses {
            error: stresses.error.map(|error| error + off),
            ..self
        }
    }
}

/// Parts of the width of the drag that flat sections may turn to the wind before that is doubtful.
const FACES_IN_WIND: RangeInclusive<f64> = 0.75..=1.33;

/// The doubt about the drag on sections that turn another width to the wind than `wind.width`. What a section turns to
/// the part of the velocity that is normal to the vein is that of an ellipse with its width and thickness.
pub(super) fn turned_from_wind(
    scenario: &Scenario,
    rods: &[RodShape],
    stations: &[f64],
) -> Option<EquilibriumDoubt> {
    let (wind, widths) = (scenario.wind.as_ref()?, scenario.vein_widths()?);
    let air = DVec3::from_array(wind.velocity.at(0.0));
    let (mut turned, mut assumed) = (0.0, 0.0);
    for (vein, (rod, width)) in rods.iter().zip(&widths).enumerate() {
        for (nodes, ends) in rod.nodes.windows(2).zip(stations.windows(2)) {
            let sigma = 0.5 * (ends[0] + ends[1]);
            let middle = nodes[0].rotation.lerp(nodes[1].rotation, 0.5).normalize();
            let across = (middle.inverse() * air).with_x(0.0);
            let thickness = scenario.thickness(vein, sigma)?;
            let part = rod.length * (ends[1] - ends[0]) * across.length();
            turned += part * (width.at(sigma) * across.z).hypot(thickness * across.y);
            assumed += part * wind.width[vein].at(sigma) * across.length();
        }
    }
    let part = turned / assumed;
    (part.is_finite() && !FACES_IN_WIND.contains(&part))
        .then_some(EquilibriumDoubt::TurnedFromWind { part })
}
