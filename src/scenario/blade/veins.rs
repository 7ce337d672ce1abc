//! The veins of a blade, and the tissue between two, as profiles along them.
//!
//! The smoothest curve through given points: the natural quintic spline.
//!
//! Of all curves W(x) through the points it has the least integral of W'''^2 (I. J. Schoenberg, On
//! interpolation by spline functions and its minimal properties, 1964): its third and fourth
//! derivatives vanish at both ends, and between the points it is a polynomial of degree 5 with
//! four continuous derivatives. So the curvature of a margin has no corners, and three points lie on
//! a parabola.

use crate::scenario::blade::{BladeMaterial, LocalMaterial};
use crate::scenario::profile::GAUSS_LEGENDRE_RULE;
use crate::scenario::{Profile, Property, sorted_distinct};
use glam::{DMat2, DVec2};
use std::sync::Arc;

/// Panels between which the place along the blade is interpolated, over a vein's length: x(s) is
/// then right to rounding.
const ARC_LENGTH_PANELS: usize = 64;

/// The factor of transverse shear of a plate (E. Reissner, 1945).
const SHEAR_FACTOR: f64 = 5.0 / 6.0;

/// What follows from a blade for its veins, and for the tissue between them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BladeProperty {
    /// A1, A2 and A3, by index.
    Couple(usize),
    /// H1, H2 and H3, by index.
    Force(usize),
    /// u0_1, u0_2 and u0_3, by index.
    Rest(usize),
    /// Mass per length.
    Density,
    /// Moment of inertia per length: the mean of those about d2 and d3.
    RotaryInertia,
    /// Of tissue: k1, k2, k3 and c1, by index.
    Tissue(usize),
}

impl From<Property> for BladeProperty {
    fn from(property: Property) -> Self {
        match property {
            Property::Couple(axis) => BladeProperty::Couple(axis),
            Property::Force(axis) => BladeProperty::Force(axis),
            Property::Density => BladeProperty::Density,
            Property::RotaryInertia => BladeProperty::RotaryInertia,
        }
    }
}

/// Most properties that something has.
const MAX_PROPERTIES: usize = 11;

impl BladeProperty {
    /// Its number among those of a vein, or of tissue.
    fn number(self) -> usize {
        match self {
            BladeProperty::Couple(axis) => axis,
            BladeProperty::Force(axis) => 3 + axis,
            BladeProperty::Rest(axis) => 6 + axis,
            BladeProperty::Density => 9,
            BladeProperty::RotaryInertia => 10,
            BladeProperty::Tissue(which) => which,
        }
    }
}

/// The outline of a blade: its width over the distance from the base.
#[derive(Clone, Debug, PartialEq)]
pub struct BladeOutline {
    /// The length.
    pub length: f64,
    /// The width at fractions of the length.
    pub width: Spline,
    /// The least width from which stiffnesses are computed, as a fraction of the largest.
    pub least: f64,
    /// The largest width.
    pub largest: f64,
    /// Whether the width falls below the least one.
    pub has_narrow_part: bool,
    /// The curvature of its surface at rest about the y axis, downwards, at fractions of the length.
    pub curvature: Option<Spline>,
}

impl BladeOutline {
    /// The width at the fraction `x` of the length from which stiffnesses are computed: it
    /// is nowhere less than the least width, and smooth. It differs from a width w by the part
    /// (least/w)^4/4.
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
    /// Its place, a fraction of the half width; not negative: its mirror image is the same vein.
    eta: f64,
    /// Its strip is the width of the blade over this.
    strip_count: f64,
    material: BladeMaterial,
    /// Its length.
    pub length: f64,
    /// x and its first and second derivative by sigma, at the ends of equal panels.
    places: Vec<[f64; 3]>,
    /// Fractions of its own length at the inner points of the outline.
    seams: Vec<f64>,
}

/// 1/cos(phi) of the angle with this tangent.
fn secant(slope: f64) -> f64 {
    (1.0 + slope * slope).sqrt()
}

impl BladeVein {
    pub fn new(
        outline: &Arc<BladeOutline>,
        eta: f64,
        count: usize,
        material: BladeMaterial,
    ) -> BladeVein {
        let (outline, count) = (outline.clone(), count as f64);
        let mut vein = BladeVein {
            outline,
            eta,
            strip_count: count,
            material,
            length: 0.0,
            places: Vec::new(),
            seams: Vec::new(),
        };
        vein.measure();
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

    /// The angle at its base.
    pub fn angle(&self) -> f64 {
        self.lateral_derivatives(0.0)[0].atan()
    }

    /// Arc length over the fraction `x` of the blade's length.
    fn arc_length_derivative(&self, x: f64) -> f64 {
        self.outline.length * secant(self.lateral_derivatives(x)[0])
    }

    /// The arc length between two fractions, between which the outline is smooth.
    fn arc_length_between(&self, from: f64, to: f64) -> f64 {
        let width = to - from;
        let part = |(x, weight): &(f64, f64)| {
            width * weight * self.arc_length_derivative(from + x * width)
        };
        GAUSS_LEGENDRE_RULE.iter().map(part).sum()
    }

    /// Finds its length, and x at equal distances along it.
    fn measure(&mut self) {
        let even = (0..=ARC_LENGTH_PANELS).map(|k| k as f64 / ARC_LENGTH_PANELS as f64);
        let outline = self.outline.clone();
        let curved = outline.curvature.iter().flat_map(Spline::knots);
        let knots = sorted_distinct(outline.width.knots().iter().chain(curved).copied());
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

    /// The fraction x of the blade's length at the fraction sigma of its own.
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

    /// A1, A2, A3, H1, H2 and H3 at a fraction of its length, where this material is.
    fn stiffnesses(&self, sigma: f64, material: &LocalMaterial) -> [f64; 6] {
        let h = self.outline.bearing_width(self.blade_fraction(sigma)) / self.strip_count;
        let (t, young, shear) = (material.t, material.young, material.shear);
        let [flat, upright] = [h * t.powi(3), t * h.powi(3)];
        let [a1, a2, a3] = [
            shear * flat / 3.0,
            young * flat / 12.0,
            young * upright / 12.0,
        ];
        let across = SHEAR_FACTOR * shear * h * t;
        [a1, a2, a3, young * h * t, across, across]
    }

    /// The mass and the moment of inertia per length, those of the blade as it is.
    fn masses(&self, sigma: f64, material: &LocalMaterial) -> [f64; 2] {
        let width = self
            .outline
            .width
            .value_and_derivatives(self.blade_fraction(sigma))[0]
            .max(0.0)
            / self.strip_count;
        let density = self.material.mass_density.as_ref();
        let density = density.map_or(0.0, |it| it.at(sigma));
        let (t, mass) = (material.t, density * width * material.t);
        [mass, 0.5 * mass * (width * width + t * t) / 12.0]
    }

    /// A property at a fraction of its length, without the others.
    fn property(&self, property: BladeProperty, sigma: f64) -> f64 {
        match property {
            BladeProperty::Couple(_) | BladeProperty::Force(_) => {
                self.stiffnesses(sigma, &self.material.local_material(sigma))[property.number()]
            }
            // Natural leaves are integrated with these.
            BladeProperty::Rest(axis) => self.rest_curvature(self.blade_fraction(sigma))[axis],
            BladeProperty::Density => self.masses(sigma, &self.material.local_material(sigma))[0],
            BladeProperty::RotaryInertia => {
                self.masses(sigma, &self.material.local_material(sigma))[1]
            }
            BladeProperty::Tissue(_) => 0.0,
        }
    }

    /// All properties at a fraction of its length, by their numbers.
    fn properties(&self, sigma: f64) -> [f64; MAX_PROPERTIES] {
        let material = self.material.local_material(sigma);
        let mut all = [0.0; MAX_PROPERTIES];
        all[..6].copy_from_slice(&self.stiffnesses(sigma, &material));
        all[6..9].copy_from_slice(&self.rest_curvature(self.blade_fraction(sigma)));
        all[9..].copy_from_slice(&self.masses(sigma, &material));
        all
    }
}

/// What a profile of a blade follows from.
#[derive(Clone, Debug, PartialEq)]
enum BladePartSource {
    /// A vein.
    Vein(Arc<BladeVein>),
    /// The tissue between two veins, whose width is that of the blade times a factor.
    Gap([Arc<BladeVein>; 2], f64),
}

/// A vein of a blade, or the tissue between two: what profiles along it are evaluated from.
#[derive(Clone, Debug, PartialEq)]
pub struct BladePart {
    source: BladePartSource,
    kinks: Vec<f64>,
    /// The least and largest value of every property.
    extremes: [[f64; 2]; MAX_PROPERTIES],
}

impl BladePart {
    pub(super) fn from_vein(vein: Arc<BladeVein>) -> Arc<BladePart> {
        BladePart::new(BladePartSource::Vein(vein))
    }

    /// The tissue between two veins, `apart` being the difference of their fractions of the half
    /// width.
    pub(super) fn from_gap(
        one: &Arc<BladeVein>,
        other: &Arc<BladeVein>,
        apart: f64,
    ) -> Arc<BladePart> {
        // Its mirror image is the same.
        let (near, far) = if one.eta <= other.eta {
            (one, other)
        } else {
            (other, one)
        };
        BladePart::new(BladePartSource::Gap(
            [near.clone(), far.clone()],
            0.5 * apart,
        ))
    }

    fn new(source: BladePartSource) -> Arc<BladePart> {
        let kinks = match &source {
            BladePartSource::Vein(vein) => sorted_distinct(vein.material.kinks()),
            BladePartSource::Gap([one, other], _) => {
                sorted_distinct(one.material.kinks().chain(other.material.kinks()))
            }
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
            BladePartSource::Gap([one, other], factor) => {
                let x = 0.5 * (one.blade_fraction(sigma) + other.blade_fraction(sigma));
                let w = factor * one.outline.bearing_width(x);
                let [a, b] = [one, other].map(|vein| vein.material.local_material(sigma));
                let mean = |of: fn(&LocalMaterial) -> f64| 0.5 * (of(&a) + of(&b));
                let (t, across) = (mean(|it| it.t), mean(|it| it.across));
                let along = mean(|it| it.shear) * t / w;
                let fold = across * t.powi(3) / (12.0 * w);
                let mut all = [0.0; MAX_PROPERTIES];
                all[..4].copy_from_slice(&[along, across * t / w, SHEAR_FACTOR * along, fold]);
                all
            }
        }
    }

    /// A property at a fraction of the length.
    pub fn property_value(&self, property: BladeProperty, sigma: f64) -> f64 {
        match &self.source {
            BladePartSource::Vein(vein) => vein.property(property, sigma),
            BladePartSource::Gap(..) => self.properties(sigma)[property.number()],
        }
    }

    /// Three properties of a vein at a fraction of its length, if they are of one kind.
    pub fn three(&self, properties: [BladeProperty; 3], sigma: f64) -> Option<[f64; 3]> {
        use BladeProperty::{Couple, Force, Rest};
        let BladePartSource::Vein(vein) = &self.source else {
            return None;
        };
        match properties {
            [
                Couple(_) | Force(_),
                Couple(_) | Force(_),
                Couple(_) | Force(_),
            ] => {
                let all = vein.stiffnesses(sigma, &vein.material.local_material(sigma));
                Some(properties.map(|property| all[property.number()]))
            }
            [Rest(a), Rest(b), Rest(c)] => {
                let all = vein.rest_curvature(vein.blade_fraction(sigma));
                Some([all[a], all[b], all[c]])
            }
            _ => None,
        }
    }

    /// Fractions inside (0, 1) where the slope of a property may jump.
    pub fn kinks(&self) -> &[f64] {
        &self.kinks
    }

    /// Fractions inside (0, 1) where the outline of a vein has its points.
    pub(in crate::scenario) fn outline_points(&self) -> &[f64] {
        match &self.source {
            BladePartSource::Vein(vein) => &vein.seams,
            BladePartSource::Gap(..) => &[],
        }
    }

    /// The least and the largest value of a property.
    pub(in crate::scenario) fn extremes(&self, property: BladeProperty) -> [f64; 2] {
        self.extremes[property.number()]
    }

    /// A property along it; of a vein on the other side of the midrib if `image`.
    pub(super) fn profile(self: &Arc<BladePart>, property: BladeProperty, image: bool) -> Profile {
        let turns = image && matches!(property, BladeProperty::Rest(0 | 2));
        let [least, most] = self.extremes(property);
        let factor = if turns { -1.0 } else { 1.0 };
        match least == most {
            true => Profile::Constant(factor * least),
            false => Profile::Blade {
                part: self.clone(),
                property,
                factor,
            },
        }
    }
}

/// A curve through points, of which the first is at 0 and the last at 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Spline {
    at: Vec<f64>,
    value: Vec<f64>,
    /// The first and second derivatives at the points.
    slopes: Vec<DVec2>,
}

impl Spline {
    /// Through these points, two or more; two give a line.
    pub fn through(at: Vec<f64>, value: Vec<f64>) -> Spline {
        let slopes = match at.len() {
            2 => vec![DVec2::new(value[1] - value[0], 0.0); 2],
            _ => spline_derivatives(&at, &value),
        };
        Spline { at, value, slopes }
    }

    /// Where the points are.
    pub fn knots(&self) -> &[f64] {
        &self.at
    }

    /// Their values.
    pub fn values(&self) -> &[f64] {
        &self.value
    }

    /// The value, and the first and second derivative at `x` in [0, 1].
    pub fn value_and_derivatives(&self, x: f64) -> [f64; 3] {
        let right = self.at.partition_point(|&knot| knot < x);
        let k = right.clamp(1, self.at.len() - 1) - 1;
        let width = self.at[k + 1] - self.at[k];
        let end = |k: usize| {
            let DVec2 { x, y } = self.slopes[k];
            [self.value[k], width * x, width * width * y]
        };
        let t = (x - self.at[k]) / width;
        let [value, slope, second] = quintic_hermite(t, end(k), end(k + 1));
        [value, slope / width, second / (width * width)]
    }
}

/// The polynomial of degree 5 with these values, first and second derivatives at 0 and at 1: its
/// value and derivatives at `t`.
pub(super) fn quintic_hermite(t: f64, [f0, d0, c0]: [f64; 3], [f1, d1, c1]: [f64; 3]) -> [f64; 3] {
    if t == 1.0 {
        // The sums below would lose a small value next to large ones, or a zero.
        return [f1, d1, c1];
    }
    let rise = f1 - f0;
    let a3 = 10.0 * rise - 6.0 * d0 - 4.0 * d1 - 1.5 * c0 + 0.5 * c1;
    let a4 = -15.0 * rise + 8.0 * d0 + 7.0 * d1 + 1.5 * c0 - c1;
    let a5 = 6.0 * rise - 3.0 * (d0 + d1) - 0.5 * (c0 - c1);
    [
        f0 + t * (d0 + t * (0.5 * c0 + t * (a3 + t * (a4 + t * a5)))),
        d0 + t * (c0 + t * (3.0 * a3 + t * (4.0 * a4 + t * 5.0 * a5))),
        c0 + t * (6.0 * a3 + t * (12.0 * a4 + t * 20.0 * a5)),
    ]
}

/// The derivatives at three points or more. Of the polynomial of degree 5 between two points with
/// the values f, slopes d and second derivatives c, at a distance h and with rise F,
///
/// h^3 f''' = 60 F - 36 h d0 - 24 h d1 - 9 h^2 c0 + 3 h^2 c1,
/// h^4 f'''' = -360 F + 192 h d0 + 168 h d1 + 36 h^2 c0 - 24 h^2 c1
///
/// at the first point, and likewise at the second; both are continuous, and zero at the ends. These
/// equations for (d, c) are block tridiagonal.
fn spline_derivatives(at: &[f64], value: &[f64]) -> Vec<DVec2> {
    let last = at.len() - 1;
    // What the interval from point k adds to the equations of its ends: the rows are f''' and f''''.
    let first_end = |k: usize| {
        let h = at[k + 1] - at[k];
        let (h2, h3, h4) = (h * h, h.powi(3), h.powi(4));
        let own = DMat2::from_cols_array(&[-36.0 / h2, 192.0 / h3, -9.0 / h, 36.0 / h2]);
        let next = DMat2::from_cols_array(&[-24.0 / h2, 168.0 / h3, 3.0 / h, -24.0 / h2]);
        let rise = value[k + 1] - value[k];
        (own, next, rise * DVec2::new(60.0 / h3, -360.0 / h4))
    };
    let second_end = |k: usize| {
        let h = at[k + 1] - at[k];
        let (h2, h3, h4) = (h * h, h.powi(3), h.powi(4));
        let before = DMat2::from_cols_array(&[-24.0 / h2, -168.0 / h3, -3.0 / h, -24.0 / h2]);
        let own = DMat2::from_cols_array(&[-36.0 / h2, -192.0 / h3, 9.0 / h, 36.0 / h2]);
        let rise = value[k + 1] - value[k];
        (before, own, rise * DVec2::new(60.0 / h3, 360.0 / h4))
    };
    // Elimination from the first point on: unknowns[k] = shift[k] - step[k] unknowns[k + 1].
    let mut eliminated: Vec<(DMat2, DVec2)> = Vec::with_capacity(last);
    let mut unknowns = vec![DVec2::ZERO; last + 1];
    for k in 0..=last {
        let (mut own, mut right) = (DMat2::ZERO, DVec2::ZERO);
        if let Some((step, shift)) = eliminated.last() {
            let (before, here, known) = second_end(k - 1);
            own += here - before * *step;
            right -= known + before * *shift;
        }
        if k == last {
            unknowns[k] = own.inverse() * right;
            break;
        }
        let (here, next, known) = first_end(k);
        own -= here;
        right += known;
        let inverse = own.inverse();
        eliminated.push((inverse * -next, inverse * right));
    }
    for (k, (step, shift)) in eliminated.into_iter().enumerate().rev() {
        unknowns[k] = shift - step * unknowns[k + 1];
    }
    unknowns
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn close(found: f64, wanted: f64, within: f64) {
        assert!((found - wanted).abs() < within, "{found} {wanted}");
    }

    #[test]
    fn lines_and_parabolas_are_what_they_are() {
        let line = Spline::through(vec![0.0, 1.0], vec![2.0, -1.0]);
        assert_eq!(line.value_and_derivatives(0.25), [1.25, -3.0, 0.0]);
        let parabola = |x: f64| 1.2 + x * (4.0 - 5.0 * x);
        for at in [vec![0.0, 0.3, 1.0], vec![0.0, 0.1, 0.2, 0.7, 0.9, 1.0]] {
            let value = at.iter().map(|&x| parabola(x)).collect();
            let spline = Spline::through(at, value);
            for x in [0.0, 0.05, 0.3, 0.65, 1.0] {
                let [value, slope, second] = spline.value_and_derivatives(x);
                close(value, parabola(x), 1e-13);
                close(slope, 4.0 - 10.0 * x, 1e-11);
                close(second, -10.0, 1e-10);
            }
        }
    }

    /// All derivatives up to the fourth are continuous, the last two vanish at the ends, and every
    /// other curve through the points has a larger integral of W'''^2.
    #[test]
    fn it_is_the_natural_quintic_spline() {
        let at = vec![0.0, 0.15, 0.4, 0.5, 0.8, 1.0];
        let spline = Spline::through(at.clone(), vec![1.0, 1.7, 2.0, 2.3, 1.1, 0.0]);
        // From the polynomial on one side of a knot.
        let third_and_fourth = |knot: f64, side: f64| {
            let h = 1e-3 * side;
            let [_, _, c0] = spline.value_and_derivatives(knot + 1e-14 * side);
            let [c1, c2, c3] =
                [1.0, 2.0, 3.0].map(|k| spline.value_and_derivatives(knot + k * h)[2]);
            let third = (-11.0 * c0 + 18.0 * c1 - 9.0 * c2 + 2.0 * c3) / (6.0 * h);
            [third, (2.0 * c0 - 5.0 * c1 + 4.0 * c2 - c3) / (h * h)]
        };
        let scale = third_and_fourth(0.45, 1.0)[1].abs();
        for &knot in &at[1..5] {
            let [left, right] = [-1.0, 1.0].map(|side| third_and_fourth(knot, side));
            close(left[0], right[0], 1e-6 * scale);
            close(left[1], right[1], 1e-4 * scale);
        }
        for [third, fourth] in [third_and_fourth(0.0, 1.0), third_and_fourth(1.0, -1.0)] {
            close(third, 0.0, 1e-6 * scale);
            close(fourth, 0.0, 1e-4 * scale);
        }
    }
}
