//! Quantities along a rod, and quantities in time.

use crate::numbers::{GAUSS_LEGENDRE_RULE, sorted_distinct};
use std::any::Any;
use std::fmt::Debug;
use std::panic::{RefUnwindSafe, UnwindSafe};
use std::sync::Arc;

/// The side of a jump of a profile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Towards the base.
    Base,
    /// Towards the tip.
    Tip,
}

/// A fraction of a rod's length and, where a profile jumps there, the side. A fraction alone is on the
/// side of the base.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RodPlace {
    /// The fraction of the length.
    pub sigma: f64,
    /// The side on which a value that jumps there is meant.
    pub side: Side,
}

impl RodPlace {
    /// A place on one side of a fraction of the length.
    pub fn new(sigma: f64, side: Side) -> Self {
        RodPlace { sigma, side }
    }

    /// Both sides of a fraction of the length.
    pub fn both_sides(sigma: f64) -> [Self; 2] {
        [Side::Base, Side::Tip].map(|side| RodPlace::new(sigma, side))
    }

    /// A place of an interval between jumps, which may lie at one of its ends: seen from inside. The
    /// interval may lead to the tip or to the base.
    pub fn within(sigma: f64, [from, to]: [f64; 2]) -> Self {
        let is_near_from = (sigma - from).abs() < (sigma - to).abs();
        let side = match is_near_from == (from < to) {
            true => Side::Tip,
            false => Side::Base,
        };
        RodPlace::new(sigma, side)
    }
}

impl From<f64> for RodPlace {
    fn from(sigma: f64) -> Self {
        RodPlace::new(sigma, Side::Base)
    }
}

/// A jump this close to a place, as a fraction of the length, is there: nodes of grids and ends of steps
/// are within rounding of the jump.
const SAME_JUMP_DISTANCE: f64 = 4e-12;

/// A quantity along a rod, over the fraction sigma = s/L of the rod's length.
#[derive(Clone, Debug, PartialEq)]
pub enum Profile {
    /// The same value everywhere; may be infinite where the quantity allows it.
    Constant(f64),
    /// Linear between knots, of which there are at least two: `at` rises from 0 to 1; same length as
    /// `value`. Two equal knots inside are a jump.
    Linear {
        /// Fractions of the length.
        at: Vec<f64>,
        /// Values at the knots, all finite.
        value: Vec<f64>,
    },
    /// What follows from a section that changes along the rod, or from the outline and the material of
    /// a blade.
    Derived(DerivedProfile),
}

/// Properties along a rod that follow from one description of it, each with an index.
pub(super) trait RodProperties: Debug + Send + Sync + UnwindSafe + RefUnwindSafe {
    /// A property at a place.
    fn value_at(&self, property: usize, place: RodPlace) -> f64;

    /// Three properties at a place, if their common part can be computed once: the same values as one by
    /// one.
    fn three_values_at(&self, _properties: [usize; 3], _place: RodPlace) -> Option<[f64; 3]> {
        None
    }

    /// The least and the largest value of a property along the rod.
    fn extremes(&self, property: usize) -> [f64; 2];

    /// Fractions strictly inside (0, 1) where the slope of a property may jump, ascending; twice where
    /// the property itself may.
    fn kinks(&self) -> &[f64];

    /// Fractions strictly inside (0, 1) where a higher derivative may jump.
    fn seams(&self) -> &[f64] {
        &[]
    }

    /// Equal parts of the length over which an integral is summed up, each by the rule of quadrature.
    fn integration_panels(&self) -> usize {
        1
    }

    /// The description as a value of its own type.
    fn as_any(&self) -> &dyn Any;

    /// Whether another description has the same type, and this property is the same everywhere, with the
    /// same kinks and seams.
    fn has_equal_property(&self, property: usize, other: &dyn Any) -> bool;
}

/// A property of a section or a blade along a rod, times a factor.
#[derive(Clone, Debug)]
pub struct DerivedProfile {
    source: Arc<dyn RodProperties>,
    property: usize,
    factor: f64,
}

impl DerivedProfile {
    pub(super) fn new(source: Arc<dyn RodProperties>, property: usize, factor: f64) -> Self {
        DerivedProfile {
            source,
            property,
            factor,
        }
    }

    fn at(&self, place: RodPlace) -> f64 {
        self.factor * self.source.value_at(self.property, place)
    }
}

impl PartialEq for DerivedProfile {
    fn eq(&self, other: &Self) -> bool {
        let same = (self.property, self.factor) == (other.property, other.factor);
        same && (Arc::ptr_eq(&self.source, &other.source)
            || (self.source).has_equal_property(self.property, other.source.as_any()))
    }
}

impl Profile {
    /// The value at a place, or at a fraction in [0, 1].
    pub fn at(&self, place: impl Into<RodPlace>) -> f64 {
        let place = place.into();
        let RodPlace { sigma, side } = place;
        match self {
            Profile::Constant(value) => *value,
            Profile::Linear { at, value } => {
                let right = at.partition_point(|&knot| knot < sigma);
                let right = right.clamp(1, at.len() - 1);
                let jumps = |k: usize| at.get(k + 1) == Some(&at[k]);
                let near = |k: usize| (at[k] - sigma).abs() <= SAME_JUMP_DISTANCE;
                match side {
                    Side::Base if right > 1 && near(right - 1) && jumps(right - 2) => {
                        return value[right - 2];
                    }
                    Side::Tip if near(right) && jumps(right) => return value[right + 1],
                    _ => {}
                }
                let t = (sigma - at[right - 1]) / (at[right] - at[right - 1]);
                if t >= 1.0 {
                    // The sum below would lose a small value next to a large one.
                    return value[right];
                }
                value[right - 1] + t.max(0.0) * (value[right] - value[right - 1])
            }
            Profile::Derived(derived) => derived.at(place),
        }
    }

    /// The values of three profiles at a place: what they have in common is computed once.
    pub fn values_of_three(profiles: [&Profile; 3], place: impl Into<RodPlace>) -> [f64; 3] {
        let place = place.into();
        if let [
            Profile::Derived(first),
            Profile::Derived(second),
            Profile::Derived(third),
        ] = profiles
        {
            let all = [first, second, third];
            if all
                .iter()
                .all(|one| Arc::ptr_eq(&one.source, &first.source))
            {
                let properties = all.map(|one| one.property);
                if let Some(values) = first.source.three_values_at(properties, place) {
                    return [0, 1, 2].map(|k| all[k].factor * values[k]);
                }
            }
        }
        profiles.map(|profile| profile.at(place))
    }

    /// The integral over fractions from 0 to `sigma` in [0, 1].
    pub fn integral(&self, sigma: f64) -> f64 {
        match self {
            Profile::Constant(value) => value * sigma,
            Profile::Linear { at, .. } => {
                let inside = at.iter().copied().filter(|&knot| knot < sigma);
                let knots: Vec<f64> = inside.chain([sigma]).collect();
                let part = |w: &[f64]| (w[1] - w[0]) * self.at(0.5 * (w[0] + w[1]));
                knots.windows(2).map(part).sum()
            }
            Profile::Derived(derived) => {
                let count = derived.source.integration_panels();
                let panels = (1..count).map(|k| k as f64 / count as f64);
                let inside = self.kinks().iter().copied().chain(panels);
                let inside = inside.filter(|&knot| knot < sigma).chain([0.0, sigma]);
                let part = |w: &[f64]| -> f64 {
                    let width = w[1] - w[0];
                    let points = GAUSS_LEGENDRE_RULE.iter();
                    points
                        .map(|point| width * point.weight * self.at(w[0] + point.at * width))
                        .sum()
                };
                sorted_distinct(inside).windows(2).map(part).sum()
            }
        }
    }

    /// Fractions strictly inside (0, 1) where the slope may jump, ascending; twice where the value may.
    pub fn kinks(&self) -> &[f64] {
        match self {
            Profile::Constant(_) => &[],
            Profile::Linear { at, .. } => &at[1..at.len() - 1],
            Profile::Derived(derived) => derived.source.kinks(),
        }
    }

    /// Fractions strictly inside (0, 1) where some higher derivative may jump: an integration of high
    /// order stops there.
    pub(crate) fn seams(&self) -> &[f64] {
        match self {
            Profile::Derived(derived) => derived.source.seams(),
            _ => &[],
        }
    }

    /// The largest absolute value along the rod.
    pub fn max_abs(&self) -> f64 {
        self.fold_extremes(0.0, |m, v| m.max(v.abs()))
    }

    /// The smallest value along the rod.
    pub fn min(&self) -> f64 {
        self.fold_extremes(f64::INFINITY, f64::min)
    }

    /// The profile times a factor.
    pub fn scaled(&self, factor: f64) -> Profile {
        match self {
            Profile::Constant(value) => Profile::Constant(factor * value),
            Profile::Linear { at, value } => Profile::Linear {
                at: at.clone(),
                value: value.iter().map(|v| factor * v).collect(),
            },
            Profile::Derived(derived) => Profile::Derived(DerivedProfile {
                factor: factor * derived.factor,
                ..derived.clone()
            }),
        }
    }

    /// The product of two profiles.
    pub(super) fn times(&self, other: &Profile) -> Profile {
        match (self, other) {
            (Profile::Constant(factor), profile) | (profile, Profile::Constant(factor)) => {
                profile.scaled(*factor)
            }
            _ => {
                let product = ProfileProduct::new([self.clone(), other.clone()]);
                Profile::Derived(DerivedProfile::new(Arc::new(product), 0, 1.0))
            }
        }
    }

    /// Equal parts of the length over which an integral is summed up.
    fn integration_panels(&self) -> usize {
        match self {
            Profile::Derived(derived) => derived.source.integration_panels(),
            _ => 1,
        }
    }

    /// Folds values that include the extremes.
    fn fold_extremes(&self, start: f64, with: impl Fn(f64, f64) -> f64) -> f64 {
        match self {
            Profile::Constant(value) => with(start, *value),
            Profile::Linear { value, .. } => value.iter().copied().fold(start, with),
            Profile::Derived(DerivedProfile {
                source,
                property,
                factor,
            }) => {
                let values = source.extremes(*property).map(|value| factor * value);
                values.into_iter().fold(start, with)
            }
        }
    }
}

/// Steps between two kinks at which the extremes of a product are looked for: both factors are smooth between kinks.
const STEPS_OF_PRODUCT: usize = 32;

/// The product of two profiles that vary along the rod.
#[derive(Debug)]
struct ProfileProduct {
    factors: [Profile; 2],
    kinks: Vec<f64>,
    seams: Vec<f64>,
    extremes: [f64; 2],
}

impl ProfileProduct {
    fn new(factors: [Profile; 2]) -> Self {
        let knots = knot_places(&factors);
        let inner = &knots[1..knots.len() - 1];
        let mut product = ProfileProduct {
            kinks: inner.iter().map(|place| place.sigma).collect(),
            seams: sorted_distinct(factors.iter().flat_map(Profile::seams).copied()),
            extremes: [f64::INFINITY, f64::NEG_INFINITY],
            factors,
        };
        let edges = sorted_distinct(knots.iter().map(|place| place.sigma));
        for ends in edges.windows(2) {
            for step in 0..=STEPS_OF_PRODUCT {
                let part = step as f64 / STEPS_OF_PRODUCT as f64;
                let sigma = ends[0] + part * (ends[1] - ends[0]);
                let value = product.value_at(0, RodPlace::within(sigma, [ends[0], ends[1]]));
                let [least, most] = &mut product.extremes;
                (*least, *most) = (least.min(value), most.max(value));
            }
        }
        product
    }
}

impl RodProperties for ProfileProduct {
    fn value_at(&self, _: usize, place: RodPlace) -> f64 {
        let [one, other] = &self.factors;
        one.at(place) * other.at(place)
    }

    fn extremes(&self, _: usize) -> [f64; 2] {
        self.extremes
    }

    fn kinks(&self) -> &[f64] {
        &self.kinks
    }

    fn seams(&self) -> &[f64] {
        &self.seams
    }

    fn integration_panels(&self) -> usize {
        let [one, other] = self.factors.each_ref().map(Profile::integration_panels);
        one.max(other)
    }

    fn as_any(&self) -> &dyn Any {
        self
    }

    fn has_equal_property(&self, _: usize, other: &dyn Any) -> bool {
        let other: Option<&ProfileProduct> = other.downcast_ref();
        other.is_some_and(|other| self.factors == other.factors)
    }
}

/// The ends of a rod and the kinks of some profiles along it, ascending; where one of them jumps both
/// sides. Where profiles are linear between their kinks, their values here determine them.
pub(crate) fn knot_places<'p>(profiles: impl IntoIterator<Item = &'p Profile>) -> Vec<RodPlace> {
    let (mut all, mut jumps) = (vec![0.0, 1.0], Vec::new());
    for kinks in profiles.into_iter().map(Profile::kinks) {
        all.extend(kinks);
        let pairs = kinks.windows(2).filter(|pair| pair[0] == pair[1]);
        jumps.extend(pairs.map(|pair| pair[0]));
    }
    let places = |sigma: f64| {
        let count = if jumps.contains(&sigma) { 2 } else { 1 };
        RodPlace::both_sides(sigma).into_iter().take(count)
    };
    sorted_distinct(all).into_iter().flat_map(places).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn linear<const N: usize>(at: [f64; N], value: [f64; N]) -> Profile {
        Profile::Linear {
            at: at.to_vec(),
            value: value.to_vec(),
        }
    }

    #[test]
    fn a_constant_is_the_same_everywhere() {
        let rigid = Profile::Constant(f64::INFINITY);
        assert_eq!([0.0, 1.0].map(|sigma| rigid.at(sigma)), [f64::INFINITY; 2]);
        assert!(rigid.kinks().is_empty());
        let negative = Profile::Constant(-2.0);
        let found = (negative.integral(0.25), negative.max_abs(), negative.min());
        assert_eq!(found, (-0.5, 2.0, -2.0));
    }

    /// Beyond the ends, where a rounding error may lead, the end values hold.
    #[test]
    fn linear_between_knots_and_exact_at_them() {
        let tent = linear([0.0, 0.25, 1.0], [1.0, 3.0, -6.0]);
        let at = [-1e-17, 0.0, 0.125, 0.25, 0.5, 1.0, 1.0 + 1e-15];
        let values = [1.0, 1.0, 2.0, 3.0, 0.0, -6.0, -6.0];
        assert_eq!(at.map(|sigma| tent.at(sigma)), values);
        let integrals = [0.0, 0.125, 0.25, 1.0].map(|sigma| tent.integral(sigma));
        assert_eq!(integrals, [0.0, 0.1875, 0.5, -0.625]);
        assert_eq!(tent.kinks(), [0.25]);
        assert_eq!((tent.max_abs(), tent.min()), (6.0, -6.0));
        // A small value at a knot is not lost next to large ones.
        assert_eq!(linear([0.0, 0.5, 1.0], [1e9, 1e-9, 1e9]).at(0.5), 1e-9);
    }

    /// Also within rounding of the jump, on either side of it.
    #[test]
    fn a_jump_has_two_values() {
        let step = linear([0.0, 0.5, 0.5, 1.0], [1.0, 3.0, 5.0, 4.0]);
        for sigma in [0.5_f64.next_down(), 0.5, 0.5_f64.next_up()] {
            let sides = RodPlace::both_sides(sigma).map(|place| step.at(place));
            assert!((sides[0] - 3.0).abs() < 1e-14 && (sides[1] - 5.0).abs() < 1e-14);
        }
        assert_eq!(
            [0.0, 0.25, 0.75, 1.0].map(|sigma| step.at(sigma)),
            [1.0, 2.0, 4.5, 4.0]
        );
        assert_eq!(
            [0.5, 0.75, 1.0].map(|sigma| step.integral(sigma)),
            [1.0, 2.1875, 3.25]
        );
        assert_eq!((step.max_abs(), step.min()), (5.0, 1.0));
        let places = knot_places([&step, &linear([0.0, 0.25, 1.0], [1.0, 2.0, 3.0])]);
        let fractions: Vec<f64> = places.iter().map(|place| place.sigma).collect();
        assert_eq!(fractions, [0.0, 0.25, 0.5, 0.5, 1.0]);
        let towards = |ends: [f64; 2]| RodPlace::within(0.5, ends).side;
        let [base, tip] = [Side::Base, Side::Tip];
        assert_eq!([[0.0, 0.5], [0.5, 1.0]].map(towards), [base, tip]);
        assert_eq!([[0.5, 0.0], [1.0, 0.5]].map(towards), [base, tip]);
    }

    /// A product keeps the jumps of both factors; its integral is exact for polynomials.
    #[test]
    fn a_product_is_that_of_the_values() {
        let step = linear([0.0, 0.5, 0.5, 1.0], [1.0, 3.0, 5.0, 4.0]);
        let taper = linear([0.0, 1.0], [2.0, 1.0]);
        assert_eq!(taper.times(&Profile::Constant(3.0)), taper.scaled(3.0));
        let product = step.times(&taper);
        assert_eq!(product, step.times(&taper));
        assert_ne!(product, step.times(&step));
        let sides = RodPlace::both_sides(0.5).map(|place| product.at(place));
        assert_eq!(sides, [4.5, 7.5]);
        assert_eq!(product.kinks(), [0.5, 0.5]);
        // The largest values of (1 + 4x)(2 - x) and (6 - 2x)(2 - x) are at the step.
        assert_eq!((product.min(), product.max_abs()), (2.0, 7.5));
        let exact = [41.0 / 24.0, 41.0 / 24.0 + 17.0 / 6.0];
        for (sigma, exact) in [0.5, 1.0].into_iter().zip(exact) {
            assert!((product.integral(sigma) - exact).abs() < 1e-14);
        }
    }
}
