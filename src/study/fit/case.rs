//! A leaf at rest under the conditions of its experiments, its predictions for the data, and
//! their derivatives.

use super::data::Origin;
use super::experiments::{Case, Observed};
use super::free::{Coordinate, FreeNumber, OffsetColumn};
use super::quantity::{Kind, Quantity};
use super::responses::Responses;
use super::vein::Vein;
use super::view::{COORDINATES, IN_PHOTO, View};
use crate::leaf::{LeafRate, Response, shift};
use crate::modes;
use crate::motion::Physics;
use crate::relax::transfer::predict::weights;
use crate::relax::{Level, Lost, Nearby, NestedEquilibrium, Parameter, unit_forces};
use crate::scenario::{Photo, PhotoRate};

/// Largest number of unknowns of a grid on which modes are computed, except the first.
const FEW_UNKNOWNS: usize = 4_000;

/// One scalar datum.
#[derive(Clone, Debug)]
pub(super) struct Component {
    /// The number of its experiment.
    pub experiment: usize,
    pub what: Compared,
    pub observed: f64,
    pub model: f64,
    /// Its standard deviation, if known.
    pub sd: Option<f64>,
    /// Whether it does not count as a datum: the distance of a point from a curve contains no
    /// information on the position along it.
    pub free: bool,
    pub origin: Option<Origin>,
}

impl Component {
    /// Whether a coordinate is the offset of its column.
    pub fn has_offset(&self, free: &Coordinate) -> bool {
        match (&free.number, self.what) {
            (FreeNumber::Offset(OffsetColumn::Result(of)), Compared::Result(what)) => *of == what,
            _ => false,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Compared {
    Result(Quantity),
    /// One of [`COORDINATES`] of a point on a rod, at this fraction of its length.
    Vein {
        rod: usize,
        coordinate: usize,
        sigma: f64,
    },
}

impl Compared {
    pub fn kind(self) -> Kind {
        match self {
            Compared::Result(quantity) => quantity.kind(),
            Compared::Vein { coordinate, .. } if coordinate >= IN_PHOTO => Kind::Pixel,
            Compared::Vein { .. } => Kind::Length,
        }
    }

    /// The name of its column in the data.
    pub fn column(self) -> String {
        match self {
            Compared::Result(quantity) => quantity.to_string(),
            Compared::Vein { coordinate, .. } => COORDINATES[coordinate].into(),
        }
    }

    /// The name of the column of its standard deviation.
    pub fn deviation_column(self) -> String {
        match self {
            Compared::Result(quantity) => format!("sd_{quantity}"),
            Compared::Vein { .. } => "sd".into(),
        }
    }
}

/// A leaf at rest at some values of the free numbers.
pub(super) struct CaseAt {
    pub at: NestedEquilibrium,
    /// Modes on the first grids.
    pub modes: Vec<Vec<modes::Eigenpair>>,
    pub components: Vec<Component>,
    /// Its response to the numbers, once computed.
    pub responses: Option<Responses>,
    /// The gradients of the components; empty until computed.
    pub gradients: Vec<Vec<f64>>,
}

impl CaseAt {
    /// Predictions of a leaf at rest for the data under these conditions.
    pub fn new(of: &Case, at: NestedEquilibrium) -> Result<CaseAt, Lost> {
        let frequencies = of
            .measured()
            .filter_map(|measured| match measured.quantity {
                Quantity::Frequency(mode) => Some(mode),
                _ => None,
            });
        let count = frequencies.max().unwrap_or(0);
        let mut modes = Vec::new();
        for level in at.levels.iter().filter(|_| count > 0) {
            let unknowns = 6 * level.leaf.rods() * level.leaf.segments();
            if modes.is_empty() || unknowns < FEW_UNKNOWNS {
                let pairs = modes::loaded(&level.leaf, &level.state, count);
                let lost = || Lost::NotAtRest("its frequencies cannot be found".into());
                let pairs = pairs
                    .filter(|pairs| pairs.len() == count)
                    .ok_or_else(lost)?;
                modes.push(pairs);
            }
        }
        let mut found = CaseAt {
            at,
            modes,
            components: Vec::new(),
            responses: None,
            gradients: Vec::new(),
        };
        let mut veins = Vec::new();
        let observed = of.observed.iter();
        let components = observed.flat_map(|of| found.compared(of, &mut veins));
        found.components = components.collect();
        Ok(found)
    }

    /// The components of an experiment.
    fn compared<'v>(&'v self, of: &Observed, veins: &mut Vec<Option<Vein<'v>>>) -> Vec<Component> {
        let mut components = Vec::new();
        let view = self.view();
        for measured in &of.experiment.measured {
            components.push(Component {
                experiment: of.number,
                what: Compared::Result(measured.quantity),
                observed: measured.value.unwrap_or(f64::NAN),
                model: self.result(measured.quantity),
                sd: measured.sd,
                free: false,
                origin: of.experiment.origin.clone(),
            });
        }
        for traced in &of.traced {
            veins.resize_with(veins.len().max(traced.rod + 1), || None);
            let vein = veins[traced.rod].get_or_insert_with(|| Vein::of(&self.at, traced.rod));
            let beside = traced.sigma.is_none();
            let (sigma, model) = match traced.sigma {
                Some(sigma) => (sigma, vein.point(sigma).0),
                None => vein.nearest(&traced.at, &view),
            };
            let seen = traced.at.iter().enumerate();
            let seen = seen.filter_map(|(k, value)| value.map(|value| (k, value)));
            for (number, (coordinate, observed)) in seen.enumerate() {
                components.push(Component {
                    experiment: of.number,
                    what: Compared::Vein {
                        rod: traced.rod,
                        coordinate,
                        sigma,
                    },
                    observed,
                    model: view.of(coordinate, model),
                    sd: traced.sd,
                    free: beside && number == 0,
                    origin: Some(traced.origin.clone()),
                });
            }
        }
        components
    }

    /// The axes along which its tip was measured, if there are no other data, and the equations of
    /// the leaf are symmetric: adjoint solutions for each axis then give the derivatives with
    /// respect to all numbers. `None` if solving for each number takes no more work.
    pub fn tip_axes(&self, numbers: usize) -> Option<Vec<usize>> {
        let leaf = &self.at.levels[0].leaf;
        let symmetric = !leaf.leaf.is_held() && !leaf.has_moments();
        let tip = |component: &Component| match component.what {
            Compared::Result(Quantity::Tip(axis)) => Some(axis),
            _ => None,
        };
        let mut axes: Vec<usize> = self.components.iter().map(tip).collect::<Option<_>>()?;
        axes.sort_unstable();
        axes.dedup();
        // One more is for the next step.
        (symmetric && axes.len() + 1 < numbers).then_some(axes)
    }

    /// The gradients of the components from these solutions.
    pub fn tip_rates(
        &self,
        responses: &Responses,
        axes: &[usize],
        slopes: &[f64],
    ) -> Result<Vec<Vec<f64>>, Lost> {
        let mut sums = [(); 3].map(|()| vec![0.0; slopes.len()]);
        for (k, level) in self.at.levels.iter().enumerate() {
            let weight = self.at.weights[k] * self.length();
            if weight == 0.0 {
                continue;
            }
            let all = unit_forces(&level.leaf, 1);
            let units: Vec<_> = axes.iter().map(|&axis| all[axis].clone()).collect();
            let rates = responses.by_results((k, level), &units)?;
            for (axis, rates) in axes.iter().zip(rates) {
                let sums = sums[*axis].iter_mut().zip(rates).zip(slopes);
                sums.for_each(|((sum, rate), slope)| *sum += weight * rate * slope);
            }
        }
        let row = |component: &Component| match component.what {
            Compared::Result(Quantity::Tip(axis)) => sums[axis].clone(),
            _ => Vec::new(),
        };
        Ok(self.components.iter().map(row).collect())
    }

    /// Its response to steps of the numbers on these grids, each of which must be one of its
    /// own; empty if there are no steps.
    pub fn answer(&self, levels: &[Level], steps: &[f64]) -> Result<Vec<Response>, Lost> {
        let none = |level: &Level| Response::zeros(&level.leaf);
        match &self.responses {
            Some(responses) if steps.iter().any(|step| *step != 0.0) => responses.to(levels, steps),
            _ => Ok(levels.iter().map(none).collect()),
        }
    }

    /// How points on its veins are seen.
    pub fn view(&self) -> View<'_> {
        View::new(self.photo())
    }

    fn photo(&self) -> Option<&Photo> {
        let leaf = &self.at.levels[0].leaf.leaf;
        leaf.scenario().photo.as_ref()
    }

    fn length(&self) -> f64 {
        self.at.levels[0].leaf.leaf.scale.length
    }

    fn force(&self) -> f64 {
        self.at.levels[0].leaf.leaf.scale.force()
    }

    /// The unit of such data in which numbers of the leaf are about one.
    pub fn unit(&self, kind: Kind) -> f64 {
        match kind {
            Kind::Length => self.length(),
            Kind::Pixel => self.length() / self.photo().map_or(1.0, |photo| photo.scale),
            Kind::Force => self.force(),
            Kind::Frequency => {
                let physics = Physics::new(&self.at.levels[0].leaf.leaf);
                1.0 / (std::f64::consts::TAU * physics.time)
            }
        }
    }

    pub fn result(&self, quantity: Quantity) -> f64 {
        match quantity {
            Quantity::Tip(axis) => {
                let tip = self.at.best(|_, level| level.state.tip(0));
                tip[axis] * self.length()
            }
            Quantity::Reaction(axis) => {
                let force = self.at.best(|_, level| level.leaf.reaction(&level.state).0);
                force[axis] * self.force()
            }
            Quantity::Grip(grip, axis) => {
                let force = |_, level: &Level| level.leaf.grip_reactions(&level.state)[grip][0];
                self.at.best(force)[axis] * self.force()
            }
            Quantity::Frequency(mode) => {
                self.eigenvalue(mode).max(0.0).sqrt() * self.unit(Kind::Frequency)
            }
        }
    }

    /// An eigenvalue, extrapolated over the grids with modes.
    fn eigenvalue(&self, mode: usize) -> f64 {
        self.over_modes(|level| self.modes[level][mode - 1].eigenvalue)
    }

    fn over_modes(&self, value: impl Fn(usize) -> f64) -> f64 {
        let segments = self.at.levels.iter().map(|level| level.leaf.segments());
        let segments: Vec<usize> = segments.take(self.modes.len()).collect();
        let weights = weights(&segments, f64::INFINITY);
        weights
            .iter()
            .enumerate()
            .map(|(k, weight)| weight * value(k))
            .sum()
    }

    /// The derivative of a result with respect to a number of the scenario.
    pub fn result_rate(
        &self,
        quantity: Quantity,
        (number, rate, responses): (&Parameter, &LeafRate, &[Response]),
    ) -> f64 {
        match quantity {
            Quantity::Tip(axis) => {
                let tip = |k: usize, level: &Level| {
                    shift(&responses[k].of_node(&level.leaf, 0, level.leaf.segments()))
                };
                self.at.best(tip)[axis] * self.length()
            }
            Quantity::Reaction(axis) => {
                let force = |k: usize, level: &Level| level.leaf.reaction_rate(rate, &responses[k]);
                self.at.best(force)[axis] * self.force()
            }
            Quantity::Grip(grip, axis) => {
                let force = |k: usize, level: &Level| {
                    let Level { leaf, state } = level;
                    leaf.grip_force_rates(state, rate, &responses[k])[grip]
                };
                self.at.best(force)[axis] * self.force()
            }
            Quantity::Frequency(mode) => {
                let scenarios = number.nearby().unwrap_or_default();
                let of = |k: usize| {
                    let near = Nearby::new(&self.at.levels[k], &scenarios, (rate, &responses[k]));
                    near.eigenvalue_rate(&self.modes[k][mode - 1])
                };
                // omega^2 = (2 pi f)^2.
                let frequency = self.result(quantity);
                self.over_modes(of) / (2.0 * std::f64::consts::TAU.powi(2) * frequency)
            }
        }
    }

    /// The derivatives of the coordinates of a point on a vein by numbers that change the leaf and its
    /// photograph; for the nearest point to an unmarked one, only the components normal to the vein.
    pub fn vein_rates(
        &self,
        (responses, photos): (&Responses, &[PhotoRate]),
        (rod, sigma): (usize, f64),
        point: &[&Component],
        slopes: &[f64],
    ) -> Vec<Vec<f64>> {
        let (view, stencils) = (self.view(), self.at.stencils(sigma));
        let coordinates = point.iter().map(|component| match component.what {
            Compared::Vein { coordinate, .. } => coordinate,
            Compared::Result(_) => 0,
        });
        let coordinates: Vec<usize> = coordinates.collect();
        let of_vein = |derivative: usize| {
            self.at.best(|k, level| {
                let base = level.state.base(rod);
                stencils[k][derivative].value(|i| level.state.x[base + i])
            })
        };
        let mut along = vec![0.0; coordinates.len()];
        if point.iter().any(|component| component.free) {
            let slope = of_vein(1);
            let seen = coordinates.iter().map(|k| view.along(*k, slope));
            along = normalized(seen.collect());
        }
        let place = of_vein(0) * self.length();
        let change = |(responses, photo): (&Vec<Response>, &PhotoRate)| -> Vec<f64> {
            let change = self.at.best(|k, level| {
                stencils[k][0].value(|i| shift(&responses[k].of_node(&level.leaf, rod, i)))
            }) * self.length();
            let seen = |k: &usize| view.along(*k, change) + view.rate(*k, place, photo);
            let seen: Vec<f64> = coordinates.iter().map(seen).collect();
            let part: f64 = seen.iter().zip(&along).map(|(a, b)| a * b).sum();
            let both = seen.iter().zip(&along);
            both.map(|(seen, along)| seen - part * along).collect()
        };
        let changes: Vec<Vec<f64>> = responses.each.iter().zip(photos).map(change).collect();
        let row = |place: usize| {
            let all = changes.iter().zip(slopes);
            all.map(|(change, slope)| change[place] * slope).collect()
        };
        (0..coordinates.len()).map(row).collect()
    }
}

/// A vector of length one, or zero.
fn normalized(vector: Vec<f64>) -> Vec<f64> {
    let length = vector.iter().map(|it| it * it).sum::<f64>().sqrt();
    let by = if length > 0.0 { 1.0 / length } else { 0.0 };
    vector.into_iter().map(|it| it * by).collect()
}
