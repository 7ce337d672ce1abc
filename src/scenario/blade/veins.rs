//! The veins of a blade, and the tissue between two, as profiles along them.

use crate::numbers::{GAUSS_LEGENDRE_RULE, QuadraturePoint, sorted_distinct};
use crate::scenario::blade::division::{PLATE_SHEAR_FACTOR, Strip};
use crate::scenario::blade::spline::{Spline, quintic_hermite};
use crate::scenario::profile::{DerivedProfile, Profile, RodPlace, RodProperties};
use crate::scenario::section::Property;
use std::any::Any;
use std::ops::Range;
use std::sync::Arc;

/// Panels between which the place along the blade is interpolated, over a vein's length: x(s) is
/// then right to rounding.
const ARC_LENGTH_PANELS: usize = 64;

/// Equal parts of a vein's length over which an integral along it is summed up.
const INTEGRATION_PANELS: usize = 32;

/// What follows from a blade for its veins, and for the tissue between them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::scenario) enum BladeProperty {
    /// A1, A2 and A3, by index.
    Couple(usize),
    /// H1, H2 and H3, by index.
    Force(usize),
    /// u0_1, u0_2 and u0_3, by index.
    Rest(usize),
    /// Mass per length.
    Density,
    /// Squared radii of gyration of a strip about d2 and d3, by index: t^2/12 by which it resists that its face turns, and
    /// l^2/12 with the lever of bending in the plane, with which the whole blade has the inertia of its width.
    SquaredGyration(usize),
    /// Width of a strip, across the vein.
    Width,
    /// k2 of tissue.
    Across,
    /// c1 of tissue.
    Fold,
    /// The contraction of tissue.
    Contraction,
}

impl From<Property> for BladeProperty {
    fn from(property: Property) -> Self {
        match property {
            Property::Couple(axis) => BladeProperty::Couple(axis),
            Property::Force(axis) => BladeProperty::Force(axis),
            Property::Density => BladeProperty::Density,
            Property::SquaredGyration(axis) => BladeProperty::SquaredGyration(axis),
            Property::Width => BladeProperty::Width,
        }
    }
}

/// Properties of a vein; tissue has fewer.
const MAX_PROPERTIES: usize = 13;

/// The indices of A1 to A3 and H1 to H3 among the properties of a vein.
const STIFFNESSES: Range<usize> = 0..6;

/// The indices of the rest curvatures among the properties of a vein.
const REST_CURVATURES: Range<usize> = 6..9;

const DENSITY: usize = 9;

impl BladeProperty {
    /// The index of the property among those of a vein, or of tissue.
    fn index(self) -> usize {
        match self {
            BladeProperty::Couple(axis) => axis,
            BladeProperty::Force(axis) => 3 + axis,
            BladeProperty::Rest(axis) => REST_CURVATURES.start + axis,
            BladeProperty::Density => DENSITY,
            BladeProperty::SquaredGyration(axis) => DENSITY + 1 + axis,
            BladeProperty::Width => DENSITY + 3,
            BladeProperty::Across => 0,
            BladeProperty::Fold => 1,
            BladeProperty::Contraction => 2,
        }
    }
}

/// The outline of a blade: its width over the distance from the base.
#[derive(Clone, Debug, PartialEq)]
pub struct BladeOutline {
    /// From the base to the tip.
    pub length: f64,
    /// The width at fractions of the length.
    pub width: Spline,
    /// The least width from which stiffnesses are computed, as a fraction of the largest.
    pub least: f64,
    pub largest: f64,
    /// Whether the width falls below the least one.
    pub has_narrow_part: bool,
    /// The curvature of the surface at rest about the y axis, downwards, at fractions of the length.
    pub curvature: Option<Spline>,
}

impl BladeOutline {
    /// The width at the fraction `x` of the length from which stiffnesses are computed: nowhere less
    /// than the least width, and smooth. It exceeds a width w by the part (least/w)^4/4.
    pub fn bearing_width(&self, x: f64) -> f64 {
        let ([width, ..], least) = (
            self.width.value_and_derivatives(x),
            self.least * self.largest,
        );
        match self.has_narrow_part {
            true => (width.powi(4) + least.powi(4)).sqrt().sqrt(),
            false => width,
        }
    }
}

/// A vein of a blade, along y = eta W(x)/2.
#[derive(Clone, Debug, PartialEq)]
pub struct BladeVein {
    outline: Arc<BladeOutline>,
    /// The place of the vein, a fraction of the half width; not negative: the mirror image of a vein is
    /// the same vein.
    eta: f64,
    /// Its strip, where the width is one.
    strip: Strip,
    material: BladeMaterial,
    /// Arc length of the vein.
    pub length: f64,
    /// x and its first and second derivative by sigma, at the ends of equal panels.
    places: Vec<[f64; 3]>,
    /// Fractions of the vein's length at the inner points of the outline.
    seams: Vec<f64>,
}

/// Thickness and material of a vein with its tissue.
#[derive(Clone, Debug, PartialEq)]
pub struct BladeMaterial {
    pub thickness: Profile,
    /// E, along the veins.
    pub young: Profile,
    /// E', across the veins; `None`: the same as along them.
    pub young_across: Option<Profile>,
    /// G; `None`: that of an isotropic material.
    pub shear_modulus: Option<Profile>,
    pub poisson: Profile,
    /// Mass per volume.
    pub mass_density: Option<Profile>,
}

/// Thickness and moduli at one place.
pub struct LocalMaterial {
    pub t: f64,
    pub young: f64,
    pub across: f64,
    pub shear: f64,
    pub poisson: f64,
}

impl LocalMaterial {
    /// 1 - nu^2 E'/E: what a plate that is kept from narrowing is softer by than one that is not.
    pub fn contraction_factor(&self) -> f64 {
        1.0 - self.poisson * self.poisson * self.across / self.young
    }
}

impl BladeMaterial {
    pub fn local_material(&self, sigma: f64) -> LocalMaterial {
        let young = self.young.at(sigma);
        let across = self.young_across.as_ref();
        let shear = self.shear_modulus.as_ref();
        let poisson = self.poisson.at(sigma);
        LocalMaterial {
            t: self.thickness.at(sigma),
            young,
            across: across.map_or(young, |it| it.at(sigma)),
            shear: shear.map_or_else(|| young / (2.0 * (1.0 + poisson)), |it| it.at(sigma)),
            poisson,
        }
    }

    fn profiles(&self) -> impl Iterator<Item = &Profile> {
        let given = [&self.thickness, &self.young, &self.poisson];
        let others = [&self.young_across, &self.shear_modulus, &self.mass_density];
        given.into_iter().chain(others.into_iter().flatten())
    }

    pub fn kinks(&self) -> impl Iterator<Item = f64> {
        self.profiles().flat_map(Profile::kinks).copied()
    }
}

/// 1/cos(phi) of the angle phi whose tangent is `slope`.
fn secant(slope: f64) -> f64 {
    (1.0 + slope * slope).sqrt()
}

impl BladeVein {
    pub fn new(
        outline: &Arc<BladeOutline>,
        eta: f64,
        strip: Strip,
        material: BladeMaterial,
    ) -> BladeVein {
        let mut vein = BladeVein {
            outline: outline.clone(),
            eta,
            strip,
            material,
            length: 0.0,
            places: Vec::new(),
            seams: Vec::new(),
        };
        vein.compute_arc_length();
        vein
    }

    /// The derivatives y' and y'' of y = eta W/2 by the distance from the base, at the fraction x
    /// of the length.
    fn lateral_derivatives(&self, x: f64) -> [f64; 2] {
        let BladeOutline { length, width, .. } = &*self.outline;
        let [_, slope, second] = width.value_and_derivatives(x);
        let half = 0.5 * self.eta;
        [half * slope / length, half * second / (length * length)]
    }

    /// h and l of the strip, perpendicular to the vein, of a blade of this width at the fraction `x` of its length.
    fn strip_size(&self, width: f64, x: f64) -> [f64; 2] {
        let perpendicular = width / secant(self.lateral_derivatives(x)[0]);
        [self.strip.width, self.strip.lever].map(|part| part * perpendicular)
    }

    /// The angle of the vein to the axis of the blade, at the base.
    pub fn angle(&self) -> f64 {
        self.lateral_derivatives(0.0)[0].atan()
    }

    /// The derivative of the arc length by the fraction `x` of the blade's length.
    fn arc_length_derivative(&self, x: f64) -> f64 {
        self.outline.length * secant(self.lateral_derivatives(x)[0])
    }

    /// The arc length between two fractions, between which the outline is smooth.
    fn arc_length_between(&self, from: f64, to: f64) -> f64 {
        let width = to - from;
        let part = |point: &QuadraturePoint| {
            width * point.weight * self.arc_length_derivative(from + point.at * width)
        };
        GAUSS_LEGENDRE_RULE.iter().map(part).sum()
    }

    /// Finds the length of the vein, and x at equal distances along the vein.
    fn compute_arc_length(&mut self) {
        let even = (0..=ARC_LENGTH_PANELS).map(|k| k as f64 / ARC_LENGTH_PANELS as f64);
        let outline = self.outline.clone();
        let curved = outline.curvature.iter().flat_map(Spline::seams);
        let knots = sorted_distinct(outline.width.seams().iter().chain(curved).copied());
        let edges = sorted_distinct(even.chain(knots.iter().copied()));
        let mut reached = vec![0.0];
        for pair in edges.windows(2) {
            let before = reached[reached.len() - 1];
            reached.push(before + self.arc_length_between(pair[0], pair[1]));
        }
        self.length = reached[reached.len() - 1];
        let place = |k: usize| {
            let wanted = self.length * k as f64 / ARC_LENGTH_PANELS as f64;
            let panel = reached.partition_point(|&s| s < wanted).max(1) - 1;
            let mut x = edges[panel];
            // Newton's method, which converges quadratically; a panel is nearly straight.
            for _ in 0..6 {
                let missing = wanted - reached[panel] - self.arc_length_between(edges[panel], x);
                x = (x + missing / self.arc_length_derivative(x)).clamp(0.0, 1.0);
            }
            let [slope, second] = self.lateral_derivatives(x);
            // dx/ds = (1 + y'^2)^(-1/2) and its derivative, by sigma.
            let speed = self.length / (self.outline.length * secant(slope));
            let change = -slope * second / (1.0 + slope * slope) * self.outline.length;
            [x, speed, speed * speed * change]
        };
        let mut places: Vec<_> = (0..=ARC_LENGTH_PANELS).map(place).collect();
        (places[0][0], places[ARC_LENGTH_PANELS][0]) = (0.0, 1.0);
        self.places = places;
        let inner = |knot: &&f64| **knot > 0.0 && **knot < 1.0;
        let known = |knot: &f64| reached[edges.partition_point(|edge| edge < knot)] / self.length;
        self.seams = knots.iter().filter(inner).map(known).collect();
    }

    /// The fraction x of the blade's length at the fraction sigma of the vein's.
    fn blade_fraction(&self, sigma: f64) -> f64 {
        let scaled = sigma * ARC_LENGTH_PANELS as f64;
        let k = (scaled as usize).min(ARC_LENGTH_PANELS - 1);
        let (t, h) = (scaled - k as f64, 1.0 / ARC_LENGTH_PANELS as f64);
        let end = |[x, slope, second]: [f64; 3]| [x, h * slope, h * h * second];
        let [x, ..] = quintic_hermite(t, end(self.places[k]), end(self.places[k + 1]));
        x.clamp(0.0, 1.0)
    }
}

impl BladeVein {
    /// u0 at the fraction `x` of the blade's length.
    fn rest_curvature(&self, x: f64) -> [f64; 3] {
        let [slope, second] = self.lateral_derivatives(x);
        // On a cylinder at the angle phi, tan(phi) = y', to its principal direction.
        let curvature = self.outline.curvature.as_ref();
        let curvature =
            curvature.map_or(0.0, |of| of.value_and_derivatives(x)[0]) / (1.0 + slope * slope);
        let sideways = second / secant(slope).powi(3);
        [curvature * slope, curvature, sideways]
    }

    /// A1, A2, A3, H1, H2 and H3 at a fraction of the vein's length, where this material is.
    fn stiffnesses(&self, sigma: f64, material: &LocalMaterial) -> [f64; 6] {
        let x = self.blade_fraction(sigma);
        let [h, lever] = self.strip_size(self.outline.bearing_width(x), x);
        let (t, young, shear) = (material.t, material.young, material.shear);
        let flat = h * t.powi(3);
        let [a1, a2, a3] = [
            shear * flat / 3.0,
            young * flat / 12.0,
            young * t * h * lever.powi(2) / 12.0,
        ];
        let [h2, h3] = [self.strip.shear_factor, PLATE_SHEAR_FACTOR].map(|f| f * shear * h * t);
        [a1, a2, a3, young * h * t, h2, h3]
    }

    /// The mass per length, its squared radii of gyration about d2 and d3, and the width of the strip, of the blade's
    /// own width: also where stiffnesses follow from a larger one.
    fn mass_and_extent(&self, sigma: f64, material: &LocalMaterial) -> [f64; 4] {
        let x = self.blade_fraction(sigma);
        let [width, ..] = self.outline.width.value_and_derivatives(x);
        let [h, lever] = self.strip_size(width.max(0.0), x);
        let density = self.material.mass_density.as_ref();
        let density = density.map_or(0.0, |it| it.at(sigma));
        let t = material.t;
        [density * h * t, t * t / 12.0, lever * lever / 12.0, h]
    }

    /// The property with this index at a fraction of the vein's length, without the others.
    fn property(&self, index: usize, sigma: f64) -> f64 {
        match index {
            index if STIFFNESSES.contains(&index) => {
                self.stiffnesses(sigma, &self.material.local_material(sigma))[index]
            }
            // Natural leaves are integrated with these.
            index if REST_CURVATURES.contains(&index) => {
                let axis = index - REST_CURVATURES.start;
                self.rest_curvature(self.blade_fraction(sigma))[axis]
            }
            index => {
                self.mass_and_extent(sigma, &self.material.local_material(sigma))[index - DENSITY]
            }
        }
    }

    /// All properties at a fraction of the vein's length, by their indices.
    fn properties(&self, sigma: f64) -> [f64; MAX_PROPERTIES] {
        let material = self.material.local_material(sigma);
        let mut all = [0.0; MAX_PROPERTIES];
        all[STIFFNESSES].copy_from_slice(&self.stiffnesses(sigma, &material));
        all[REST_CURVATURES].copy_from_slice(&self.rest_curvature(self.blade_fraction(sigma)));
        all[DENSITY..].copy_from_slice(&self.mass_and_extent(sigma, &material));
        all
    }
}

/// What a profile of a blade follows from.
#[derive(Clone, Debug, PartialEq)]
enum BladePartSource {
    /// A vein.
    Vein(Arc<BladeVein>),
    /// The tissue between two veins.
    Gap {
        /// The vein that is nearer to the midrib, and the other one.
        veins: [Arc<BladeVein>; 2],
        /// Where its middle lies: a fraction of the half width.
        eta: f64,
        /// The width of the gap over that of the blade.
        width_fraction: f64,
    },
}

/// A vein of a blade, or the tissue between two: what profiles along it are evaluated from.
#[derive(Clone, Debug, PartialEq)]
pub struct BladePart {
    source: BladePartSource,
    kinks: Vec<f64>,
    /// The least and the largest value of every property.
    extremes: [[f64; 2]; MAX_PROPERTIES],
}

impl BladePart {
    pub fn from_vein(vein: Arc<BladeVein>) -> Arc<BladePart> {
        BladePart::new(BladePartSource::Vein(vein))
    }

    /// The tissue between two veins, whose middle is at `eta` and whose width is this fraction of the blade's.
    pub fn from_gap(
        one: &Arc<BladeVein>,
        other: &Arc<BladeVein>,
        eta: f64,
        width_fraction: f64,
    ) -> Arc<BladePart> {
        // The gap on the other side of the midrib is then the same part.
        let (near, far) = if one.eta <= other.eta {
            (one, other)
        } else {
            (other, one)
        };
        BladePart::new(BladePartSource::Gap {
            veins: [near.clone(), far.clone()],
            eta: eta.abs(),
            width_fraction,
        })
    }

    fn new(source: BladePartSource) -> Arc<BladePart> {
        let kinks = match &source {
            BladePartSource::Vein(vein) => sorted_distinct(vein.material.kinks()),
            BladePartSource::Gap {
                veins: [one, other],
                ..
            } => sorted_distinct(one.material.kinks().chain(other.material.kinks())),
        };
        let mut part = BladePart {
            source,
            kinks,
            extremes: [[f64::INFINITY, f64::NEG_INFINITY]; MAX_PROPERTIES],
        };
        let even = (0..=2 * ARC_LENGTH_PANELS).map(|k| k as f64 / (2 * ARC_LENGTH_PANELS) as f64);
        for sigma in even.chain(part.kinks.clone()) {
            for (value, [least, most]) in part.properties(sigma).into_iter().zip(&mut part.extremes)
            {
                (*least, *most) = (least.min(value), most.max(value));
            }
        }
        part.into()
    }

    fn properties(&self, sigma: f64) -> [f64; MAX_PROPERTIES] {
        match &self.source {
            BladePartSource::Vein(vein) => vein.properties(sigma),
            BladePartSource::Gap {
                veins: [one, other],
                eta,
                width_fraction,
            } => {
                let outline = &one.outline;
                let x = 0.5 * (one.blade_fraction(sigma) + other.blade_fraction(sigma));
                let slope = 0.5 * eta * outline.width.value_and_derivatives(x)[1] / outline.length;
                let w = width_fraction * outline.bearing_width(x) / secant(slope);
                let [a, b] = [one, other].map(|vein| vein.material.local_material(sigma));
                let mean = |of: fn(&LocalMaterial) -> f64| 0.5 * (of(&a) + of(&b));
                let t = mean(|it| it.t);
                let across = mean(|it| it.across / it.contraction_factor());
                let mut all = [0.0; MAX_PROPERTIES];
                all[BladeProperty::Across.index()] = across * t / w;
                all[BladeProperty::Fold.index()] = across * t.powi(3) / (12.0 * w);
                all[BladeProperty::Contraction.index()] = mean(|it| it.poisson) * w;
                all
            }
        }
    }

    /// A property along the part; with its sign in the mirror image if `image`, for a vein on the other
    /// side of the midrib.
    pub fn profile(self: &Arc<BladePart>, property: BladeProperty, image: bool) -> Profile {
        let turns = image && matches!(property, BladeProperty::Rest(0 | 2));
        let factor = if turns { -1.0 } else { 1.0 };
        let [least, most] = self.extremes[property.index()];
        match least == most {
            true => Profile::Constant(factor * least),
            false => Profile::Derived(DerivedProfile::new(self.clone(), property.index(), factor)),
        }
    }
}

impl RodProperties for BladePart {
    fn value_at(&self, property: usize, RodPlace { sigma, .. }: RodPlace) -> f64 {
        match &self.source {
            BladePartSource::Vein(vein) => vein.property(property, sigma),
            BladePartSource::Gap { .. } => self.properties(sigma)[property],
        }
    }

    /// Three stiffnesses, or three rest curvatures, of a vein; all that tissue has.
    fn three_values_at(
        &self,
        properties: [usize; 3],
        RodPlace { sigma, .. }: RodPlace,
    ) -> Option<[f64; 3]> {
        let vein = match &self.source {
            BladePartSource::Vein(vein) => vein,
            BladePartSource::Gap { .. } => {
                let all = self.properties(sigma);
                return Some(properties.map(|index| all[index]));
            }
        };
        let all_in = |range: Range<usize>| properties.iter().all(|index| range.contains(index));
        if all_in(STIFFNESSES) {
            let all = vein.stiffnesses(sigma, &vein.material.local_material(sigma));
            return Some(properties.map(|index| all[index]));
        }
        if all_in(REST_CURVATURES) {
            let all = vein.rest_curvature(vein.blade_fraction(sigma));
            return Some(properties.map(|index| all[index - REST_CURVATURES.start]));
        }
        None
    }

    fn extremes(&self, property: usize) -> [f64; 2] {
        self.extremes[property]
    }

    fn kinks(&self) -> &[f64] {
        &self.kinks
    }

    /// The inner points of the outline, on a vein.
    fn seams(&self) -> &[f64] {
        match &self.source {
            BladePartSource::Vein(vein) => &vein.seams,
            BladePartSource::Gap { .. } => &[],
        }
    }

    fn integration_panels(&self) -> usize {
        INTEGRATION_PANELS
    }

    fn as_any(&self) -> &dyn Any {
        self
    }

    /// Rest curvatures follow from the outline alone.
    fn has_equal_property(&self, property: usize, other: &dyn Any) -> bool {
        let Some(other) = other.downcast_ref::<BladePart>() else {
            return false;
        };
        match (&self.source, &other.source) {
            (BladePartSource::Vein(one), BladePartSource::Vein(two))
                if REST_CURVATURES.contains(&property) =>
            {
                self.kinks == other.kinks && one.eta == two.eta && one.outline == two.outline
            }
            _ => self == other,
        }
    }
}
