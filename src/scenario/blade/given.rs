//! A blade as it is given, and the veins and the tissue that follow from it.

use super::material::Material;
use super::vein::{BladePart, BladeProperty, Outline, Vein};
use crate::scenario::{Profile, Tissue};
use glam::{DQuat, DVec3};
use std::sync::Arc;

/// Places at which the widest one is looked for.
const WIDTH_SAMPLES: usize = 500;

/// A blade, from which the veins of a leaf and the tissue between them follow.
#[derive(Clone, Debug, PartialEq)]
pub struct Blade {
    pub(super) outline: Arc<Outline>,
    /// Whether the outermost veins are the margins.
    pub edges: bool,
    /// The angle by which it rises from the x-y plane as a whole, in radians.
    pub elevation: f64,
    pub(in crate::scenario) materials: Vec<Material>,
}

impl Blade {
    /// The length, from the base to the tip.
    pub fn length(&self) -> f64 {
        self.outline.length
    }

    /// The width at the fraction `x` of the length.
    pub fn width(&self, x: f64) -> f64 {
        self.outline.width.at(x)[0]
    }

    /// The width at the fraction `x` of the length from which stiffnesses follow: nowhere less than
    /// a part of the largest one.
    pub fn bearing_width(&self, x: f64) -> f64 {
        self.outline.bearing_width(x)
    }

    /// The least bearing width as a fraction of the largest width, wherever the blade is wider.
    pub fn least_part(&self) -> f64 {
        self.outline.least
    }

    /// The least bearing width, if the blade is narrower somewhere.
    pub fn least_width(&self) -> Option<f64> {
        let Outline {
            least,
            largest,
            narrows,
            ..
        } = &*self.outline;
        narrows.then_some(least * largest)
    }

    /// Where it is widest: a fraction of the length.
    pub fn widest(&self) -> f64 {
        let places = (0..=WIDTH_SAMPLES).map(|k| k as f64 / WIDTH_SAMPLES as f64);
        let wider = |a: f64, b: f64| if self.width(b) > self.width(a) { b } else { a };
        places.fold(0.0, wider)
    }

    /// Where vein `j` lies: a fraction of the half width, negative to the right of the midrib.
    pub fn place(&self, j: usize) -> f64 {
        self.eta(j).0
    }

    /// Whether all veins meet at the tip.
    pub fn is_pointed(&self) -> bool {
        let (_, widths) = self.points();
        widths.last() == Some(&0.0)
    }

    /// Where the curvature of its surface at rest is given, as fractions of the length, and its values
    /// there; `None` if it lies flat.
    pub(in crate::scenario) fn curvature(&self) -> Option<(&[f64], &[f64])> {
        let curvature = self.outline.curvature.as_ref()?;
        Some((curvature.knots(), curvature.values()))
    }

    /// Whether it has a mass.
    pub fn has_mass(&self) -> bool {
        self.materials.iter().all(|of| of.mass_density.is_some())
    }

    /// The places of the points of the outline, as fractions of the length, and the widths there.
    pub(in crate::scenario) fn points(&self) -> (&[f64], &[f64]) {
        (self.outline.width.knots(), self.outline.width.values())
    }

    /// The place of vein `j`, as a fraction of the half width, and how far neighbours are apart.
    fn eta(&self, j: usize) -> (f64, f64) {
        let count = self.materials.len();
        let gaps = if self.edges { count.max(2) - 1 } else { count };
        let eta = (2.0 * j as f64 + 1.0 - count as f64) / gaps as f64;
        (eta, 2.0 / gaps as f64)
    }

    /// The veins and the tissue between them.
    pub(in crate::scenario) fn parts(&self) -> Parts {
        let count = self.materials.len();
        let etas: Vec<f64> = (0..count).map(|j| self.eta(j).0).collect();
        let (_, apart) = self.eta(0);
        let alike = |one: usize, other: usize| self.materials[one] == self.materials[other];
        let vein = |j: usize| {
            let material = self.materials[j].clone();
            Arc::new(Vein::new(&self.outline, etas[j].abs(), count, material))
        };
        let veins = with_images(count, alike, vein);
        let gaps_alike = |g: usize, image: usize| alike(g, image + 1) && alike(g + 1, image);
        let gap = |g: usize| BladePart::gap(&veins[g], &veins[g + 1], apart);
        Parts {
            gaps: with_images(count - 1, gaps_alike, gap),
            parts: with_images(count, alike, |j| BladePart::vein(veins[j].clone())),
            half_width: 0.5 * self.width(0.0),
            veins,
            etas,
        }
    }
}

/// So many values, of which one that is `alike` to its image, counted from the other end, is the
/// same.
fn with_images<T>(
    count: usize,
    alike: impl Fn(usize, usize) -> bool,
    make: impl Fn(usize) -> Arc<T>,
) -> Vec<Arc<T>> {
    let mut all: Vec<Arc<T>> = Vec::with_capacity(count);
    for j in 0..count {
        let image = count - 1 - j;
        let same = image < j && alike(j, image);
        all.push(if same { all[image].clone() } else { make(j) });
    }
    all
}

/// What follows from a blade: its veins, and the tissue between them.
pub(in crate::scenario) struct Parts {
    /// The places of the veins, as fractions of the half width.
    etas: Vec<f64>,
    half_width: f64,
    veins: Vec<Arc<Vein>>,
    parts: Vec<Arc<BladePart>>,
    gaps: Vec<Arc<BladePart>>,
}

impl Parts {
    /// A property of every vein, along it.
    pub(in crate::scenario) fn profiles(&self, property: BladeProperty) -> Vec<Profile> {
        let each = self.etas.iter().zip(&self.parts);
        each.map(|(eta, part)| part.profile(property, *eta < 0.0))
            .collect()
    }

    /// The lengths of the veins.
    pub(in crate::scenario) fn lengths(&self) -> Vec<f64> {
        self.veins.iter().map(|vein| vein.length).collect()
    }

    /// Where the veins begin.
    pub(in crate::scenario) fn bases(&self) -> Vec<[f64; 3]> {
        let y = self.etas.iter().map(|eta| eta * self.half_width);
        y.map(|y| [0.0, y, 0.0]).collect()
    }

    /// The angle of each vein at its base in the x-y plane, its elevation above that, and the turn
    /// of its section about d1, if the whole blade is turned by `elevation` about -e2.
    pub(in crate::scenario) fn directions(&self, elevation: f64) -> Vec<[f64; 3]> {
        let each = self.etas.iter().zip(&self.veins);
        each.map(|(eta, vein)| {
            let angle = if *eta < 0.0 {
                -vein.angle()
            } else {
                vein.angle()
            };
            tilted(angle, elevation)
        })
        .collect()
    }

    /// The tissue in every gap.
    pub(in crate::scenario) fn tissue(&self) -> Vec<Tissue> {
        let gap = |part: &Arc<BladePart>| {
            let of = |which| part.profile(BladeProperty::Tissue(which), false);
            Tissue {
                stiffness: [of(0), of(1), of(2)],
                fold: of(3),
            }
        };
        self.gaps.iter().map(gap).collect()
    }
}

/// A direction at `angle` in a plane that is turned about -e2 by `elevation`: its own angle and
/// elevation, and the turn about it that brings d2 into the plane.
fn tilted(angle: f64, elevation: f64) -> [f64; 3] {
    if elevation == 0.0 {
        return [angle, 0.0, 0.0];
    }
    let plane = DQuat::from_rotation_y(-elevation) * DQuat::from_rotation_z(angle);
    let tangent = plane * DVec3::X;
    let (own, up) = (tangent.y.atan2(tangent.x), tangent.z.asin());
    let upright = DQuat::from_rotation_z(own) * DQuat::from_rotation_y(-up);
    let across = upright.inverse() * (plane * DVec3::Y);
    [own, up, across.z.atan2(across.y)]
}
