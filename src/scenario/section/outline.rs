//! An elliptic or rectangular section at one place along a rod: area, moments, torsion constant and shear
//! factors, full or hollow; and the largest stresses in sections, also those of `polygon`.
//!
//! Second moments and areas of hollow sections are those of the outline less those of the hole.
//!
//! # Torsion of hollow sections
//!
//! The torsion constant J of a hollow section lies between two bounds (L. Prandtl's stress function
//! gives most of all that are constant on both edges of the wall). From below it is that of tubes
//! within each other (R. Bredt 1896, layer upon layer): with the area A(x) within the line at depth
//! x in the wall, and the integral g(x) of the gradient of the depth along it,
//!
//! J > 4 integral of A(x)^2/g(x) dx over the wall,
//!
//! from above that of the outline less that of the hole. Both are exact for circles. For ellipses
//! the lower one is taken: exact for thin walls, too low by 1 % where the wall is a fifth of the
//! thickness, by up to 7 % where it is nearly half of it. A rectangle is between both by the part
//! y + (b/a)^2 y (1 - y), with its sides a > b and the wall y b/2: it is exact for thin walls and for
//! full sections, and else within 1 % of finite differences.
//!
//! # Stresses
//!
//! With the area S, the second moments I2 and I3 about d2 and d3, and the width w and thickness t:
//!
//! | | |
//! | --- | --- |
//! | normal stress | \|n1\|/S + \|m2\| t/(2 I2) + \|m3\| w/(2 I3) in the corner of a rectangle; on an ellipse the root of the sum of the squares of both bending stresses in place of their sum; else \|n1/S + m2 z/I2 - m3 y/I3\| in the corner (y, z) where it is largest |
//! | shear stress | of torsion \|m1\| D/J, plus the root of the sum of the squares of those of n2 and n3, n Q/(I b) each |
//! | equivalent stress | the root of normal^2 + 3 shear^2 (R. von Mises, 1913) |
//!
//! D is the largest slope of the stress function per twist (S. P. Timoshenko and J. N. Goodier,
//! Theory of Elasticity, 3rd ed., arts. 107 to 109): the radius of a circle, on an ellipse with the
//! semi-axes a > b at the ends of the short one 2 a^2 b/(a^2 + b^2), of a rectangle in the middle of
//! the long sides. That of a thin wall is 2 A/s (art. 115, R. Bredt), with the area A within it and its
//! length s; a thick one lies between both as its torsion constant does: exact for circles, and of
//! rectangles within 4 % of finite differences. Q/(I b) is D. I. Zhuravskii's (art. 120, note): the first moment of half
//! of the section over its second moment and the material across, 3/2 of the mean in a rectangle, 4/3 in a round section
//! and 2 in a thin round tube.
//!
//! The largest normal and shear stresses, and those of torsion and shear forces, lie at different
//! places of the outline: the largest shear and equivalent stresses are at most these sums, and equal
//! to them for the equivalent one of a circle that is bent, pulled and twisted. Corners within a hollow
//! rectangle concentrate stress, which is left out.

use crate::numbers::GAUSS_LEGENDRE_RULE;
use crate::scenario::section::polygon::PolygonSection;
use glam::DVec3;
use serde::Serialize;
use std::f64::consts::PI;

/// Outlines whose constants have closed forms, and which may be hollow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ClosedOutline {
    /// An ellipse with its width along d2 and its thickness along d3, or a circle.
    Ellipse,
    /// A rectangle with its width along d2 and its thickness along d3.
    Rectangle,
}

/// A section at one place, with its wall if it is hollow.
#[derive(Clone, Copy, Debug)]
pub(super) struct SectionDimensions {
    pub outline: ClosedOutline,
    pub width: f64,
    pub thickness: f64,
    pub wall: Option<f64>,
}

impl SectionDimensions {
    /// The dimensions of the hole.
    pub fn hole(self) -> Option<SectionDimensions> {
        let inside = |side: f64, wall: f64| (side - 2.0 * wall).max(0.0);
        self.wall.map(|wall| SectionDimensions {
            width: inside(self.width, wall),
            thickness: inside(self.thickness, wall),
            wall: None,
            ..self
        })
    }

    /// The area within the outline, with the hole.
    pub fn enclosed_area(self) -> f64 {
        match self.outline {
            ClosedOutline::Ellipse => PI / 4.0 * self.width * self.thickness,
            ClosedOutline::Rectangle => self.width * self.thickness,
        }
    }

    /// The area of the material.
    pub fn area(self) -> f64 {
        self.enclosed_area() - self.hole().map_or(0.0, SectionDimensions::enclosed_area)
    }

    /// The second moments I2 and I3 of the area, about d2 and d3.
    pub fn second_moments(self) -> [f64; 2] {
        let factor = match self.outline {
            ClosedOutline::Ellipse => PI / 64.0,
            ClosedOutline::Rectangle => 1.0 / 12.0,
        };
        let (w, t) = (self.width, self.thickness);
        let full = [factor * w * t * t * t, factor * t * w * w * w];
        match self.hole() {
            None => full,
            Some(hole) => {
                let [second, third] = hole.second_moments();
                [full[0] - second, full[1] - third]
            }
        }
    }

    /// The torsion constant J.
    pub fn torsion_constant(self) -> f64 {
        let Some(wall) = self.wall else {
            return self.outline.torsion_constant(self.width, self.thickness);
        };
        let panel = |from: f64| -> f64 {
            let layers = GAUSS_LEGENDRE_RULE.iter();
            layers
                .map(|point| {
                    point.weight * self.layer_torsion((from + point.at / WALL_PANELS) * wall)
                })
                .sum()
        };
        let panels = (0..WALL_PANELS as usize).map(|k| panel(k as f64 / WALL_PANELS));
        let below = 4.0 * wall / WALL_PANELS * panels.sum::<f64>();
        match self.outline {
            ClosedOutline::Ellipse => below,
            ClosedOutline::Rectangle => {
                below + self.torsion_interpolation(wall) * (self.torsion_upper_bound() - below)
            }
        }
    }

    /// The torsion constant of the outline less that of the hole.
    fn torsion_upper_bound(self) -> f64 {
        let of = |sides: SectionDimensions| match sides.width.min(sides.thickness) > 0.0 {
            true => sides.outline.torsion_constant(sides.width, sides.thickness),
            false => 0.0,
        };
        of(self) - self.hole().map_or(0.0, of)
    }

    /// Where the torsion constant of a hollow rectangle lies between its bounds: 0 at the lower one, 1 at
    /// the upper one.
    pub fn torsion_interpolation(self, wall: f64) -> f64 {
        let (long, short) = (
            self.width.max(self.thickness),
            self.width.min(self.thickness),
        );
        let part = 2.0 * wall / short;
        part + (short / long).powi(2) * part * (1.0 - part)
    }

    /// A^2/g (see the torsion of hollow sections above) of the line at this depth in the wall.
    fn layer_torsion(self, depth: f64) -> f64 {
        let (w, t) = (self.width - 2.0 * depth, self.thickness - 2.0 * depth);
        let (area, gradient) = match self.outline {
            ClosedOutline::Ellipse => {
                // Of ellipses with the semi-axes a - x and b - x.
                let (a, b) = (w / 2.0, t / 2.0);
                (PI * a * b, 2.0 * PI * (a + b - (a * b).sqrt()))
            }
            ClosedOutline::Rectangle => (w * t, 2.0 * (w + t)),
        };
        area * area / gradient
    }

    /// Cowper's factors for shear forces along d2 and along d3.
    pub fn shear_factors(self, nu: f64) -> [f64; 2] {
        let sides = [(self.width, self.thickness), (self.thickness, self.width)];
        sides.map(|(along, across)| {
            let Some(wall) = self.wall else {
                return self.outline.shear_factor(along, across, nu);
            };
            match self.outline {
                ClosedOutline::Rectangle => box_shear_factor(along - wall, across - wall, nu),
                ClosedOutline::Ellipse => {
                    let full = self.outline.shear_factor(along, across, nu);
                    let hole = ((along - 2.0 * wall) / along).powi(2);
                    full * hollow_circle_shear_factor(hole, nu)
                        / hollow_circle_shear_factor(0.0, nu)
                }
            }
        })
    }
}

/// Panels of a wall's depth, each with the rule of five points: they resolve the layers of every wall
/// to 1e-9.
const WALL_PANELS: f64 = 4.0;

/// Cowper's factor of a hollow circle, the square of whose inner diameter is the part `hole` of
/// the square of the outer one. The factor of a hollow ellipse is estimated from that of the full
/// ellipse, reduced as for circles.
fn hollow_circle_shear_factor(hole: f64, nu: f64) -> f64 {
    let both = (1.0 + hole) * (1.0 + hole);
    6.0 * (1.0 + nu) * both / ((7.0 + 6.0 * nu) * both + (20.0 + 12.0 * nu) * hole)
}

/// Cowper's factor of a box with equal thin walls, whose middle lines have these lengths.
fn box_shear_factor(along: f64, across: f64, nu: f64) -> f64 {
    let m = across / along;
    let walls = 12.0 + m * (72.0 + m * (150.0 + m * 90.0));
    let of_nu = 11.0 + m * (66.0 + m * (135.0 + m * 90.0));
    let flanges = 10.0 * m * m * m * (3.0 + nu + 3.0 * m);
    10.0 * (1.0 + nu) * (1.0 + 3.0 * m).powi(2) / (walls + nu * of_nu + flanges)
}

impl ClosedOutline {
    /// The torsion constant J. Of a rectangle with the long side a and the short
    /// side b: a b^3 (1/3 - 64/pi^5 b/a sum over odd n of tanh(n pi a/(2 b))/n^5).
    fn torsion_constant(self, width: f64, thickness: f64) -> f64 {
        match self {
            ClosedOutline::Ellipse => {
                let (a, b) = (width / 2.0, thickness / 2.0);
                // In this order equal sides give the circle's value to the last bit but one.
                PI * a * b * (a * b) * ((a * b) / (a * a + b * b))
            }
            ClosedOutline::Rectangle => {
                let (long, short) = (width.max(thickness), width.min(thickness));
                let term = |n: f64| (n * PI * long / (2.0 * short)).tanh() / n.powi(5);
                // From n = 17 on every tanh is 1, so the rest of the sum is known (zeta(5)
                // times 31/32, less the terms before).
                let all = 31.0 / 32.0 * 1.036_927_755_143_37;
                let odd = (0..8).map(|k| (2 * k + 1) as f64);
                let deficit: f64 = odd.map(|n| n.powi(-5) - term(n)).sum();
                let sum = all - deficit;
                long * short.powi(3) * (1.0 / 3.0 - 64.0 / PI.powi(5) * short / long * sum)
            }
        }
    }

    /// Cowper's factor for a shear force along the side `along`.
    fn shear_factor(self, along: f64, across: f64, nu: f64) -> f64 {
        match self {
            ClosedOutline::Rectangle => 10.0 * (1.0 + nu) / (12.0 + 11.0 * nu),
            ClosedOutline::Ellipse => {
                let (a, b) = (along * along, across * across);
                12.0 * (1.0 + nu) * a * (3.0 * a + b)
                    / ((40.0 + 37.0 * nu) * a * a + (16.0 + 10.0 * nu) * a * b + nu * b * b)
            }
        }
    }
}

/// What the largest stresses in a section follow from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moduli {
    /// S, the area of the material.
    area: f64,
    /// Where bending stresses are largest.
    fibers: OuterFibers,
    /// Largest shear stress per twisting moment.
    torsion: f64,
    /// Largest shear stress per force along d2 and along d3.
    shear: [f64; 2],
}

/// The fibers of a section that bending stresses most.
#[derive(Clone, Copy, Debug, PartialEq)]
enum OuterFibers {
    /// Of an ellipse, t/(2 I2) and w/(2 I3): each is largest where the other is zero.
    Ellipse([f64; 2]),
    /// Of a rectangle, t/(2 I2) and w/(2 I3): both are largest in the same corner.
    Rectangle([f64; 2]),
    /// Of any other section of straight sides, whose corners lie at different distances from its axes.
    Corners(PolygonSection),
}

/// The largest stresses in a section, force per area.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Stress {
    /// Size of the stress along the rod, in tension or compression, by tension and bending.
    pub normal: f64,
    /// Shear stress by torsion and shear forces.
    pub shear: f64,
    /// Von Mises' equivalent stress, as if normal and shear stress were largest in the same point.
    pub equivalent: f64,
}

impl Stress {
    /// The names of the three stresses in results.
    pub const NAMES: [&str; 3] = ["normal_stress", "shear_stress", "equivalent_stress"];

    /// The three stresses in the order of [`Stress::NAMES`].
    pub fn to_array(self) -> [f64; 3] {
        [self.normal, self.shear, self.equivalent]
    }
}

impl Moduli {
    /// The moduli of a section of straight sides.
    pub(super) fn for_polygon(section: PolygonSection) -> Moduli {
        let area = section.area();
        Moduli {
            area,
            fibers: OuterFibers::Corners(section),
            torsion: section.stress_function_slope() / section.torsion_constant(),
            shear: section.peak_shear().map(|peak| peak / area),
        }
    }

    /// Stresses by a force n and a moment m along the directors.
    pub fn stress(&self, n: DVec3, m: DVec3) -> Stress {
        let tension = n.x / self.area;
        let normal = match self.fibers {
            OuterFibers::Ellipse([second, third]) => {
                tension.abs() + (m.y * second).hypot(m.z * third)
            }
            OuterFibers::Rectangle([second, third]) => {
                tension.abs() + (m.y * second).abs() + (m.z * third).abs()
            }
            OuterFibers::Corners(section) => section.normal_stress(tension, [m.y, m.z]),
        };
        let (n, m) = (n.abs(), m.abs());
        let shear = m.x * self.torsion + (n.y * self.shear[0]).hypot(n.z * self.shear[1]);
        Stress {
            normal,
            shear,
            equivalent: normal.hypot(3_f64.sqrt() * shear),
        }
    }

    /// The moduli of a strip of a plate, which twists with the plate, J = w t^3/3, and bends in its plane with this
    /// lever, I3 = w t lever^2/12.
    pub(in crate::scenario) fn for_strip(width: f64, thickness: f64, lever: f64) -> Moduli {
        let sides = SectionDimensions {
            outline: ClosedOutline::Rectangle,
            width,
            thickness,
            wall: None,
        };
        let [second, third] = sides.second_moments();
        let in_plane = third * (lever / width).powi(2);
        Moduli {
            torsion: 3.0 / (width * thickness * thickness),
            fibers: OuterFibers::Rectangle([0.5 * thickness / second, 0.5 * width / in_plane]),
            ..sides.moduli()
        }
    }
}

impl SectionDimensions {
    /// What the largest stresses in the section follow from.
    pub fn moduli(self) -> Moduli {
        let (w, t) = (self.width, self.thickness);
        let [second, third] = self.second_moments();
        let turned = SectionDimensions {
            width: t,
            thickness: w,
            ..self
        };
        Moduli {
            area: self.area(),
            fibers: {
                let fibers = [0.5 * t / second, 0.5 * w / third];
                match self.outline {
                    ClosedOutline::Ellipse => OuterFibers::Ellipse(fibers),
                    ClosedOutline::Rectangle => OuterFibers::Rectangle(fibers),
                }
            },
            torsion: self.stress_function_slope() / self.torsion_constant(),
            shear: [
                turned.first_moment() / (third * turned.central_material_width()),
                self.first_moment() / (second * self.central_material_width()),
            ],
        }
    }

    /// The hole, if it has an area.
    fn open_hole(self) -> Option<SectionDimensions> {
        self.hole().filter(|hole| hole.enclosed_area() > 0.0)
    }

    /// The first moment of the upper half of the section about d2.
    fn first_moment(self) -> f64 {
        let factor = match self.outline {
            ClosedOutline::Ellipse => 1.0 / 12.0,
            ClosedOutline::Rectangle => 1.0 / 8.0,
        };
        let full = factor * self.width * self.thickness * self.thickness;
        full - self
            .open_hole()
            .map_or(0.0, SectionDimensions::first_moment)
    }

    /// The material along d2 through its centre.
    fn central_material_width(self) -> f64 {
        self.width - self.open_hole().map_or(0.0, |hole| hole.width)
    }

    /// The largest slope of the stress function per twist, D.
    fn stress_function_slope(self) -> f64 {
        let (w, t) = (self.width, self.thickness);
        let full = self.outline.stress_function_slope(w, t);
        let Some(wall) = self.wall.filter(|_| self.open_hole().is_some()) else {
            return full;
        };
        let thin = match self.outline {
            // The length of an ellipse as for the torsion constant.
            ClosedOutline::Ellipse => w * t / (w + t - (w * t).sqrt()) / 2.0,
            ClosedOutline::Rectangle => w * t / (w + t),
        };
        thin + self.torsion_interpolation(wall) * (full - thin)
    }
}

/// Terms of the series for the stress function of a rectangle, which falls off as exp(-n pi/2).
const RECTANGLE_SERIES_TERMS: i32 = 12;

impl ClosedOutline {
    /// The largest slope of the stress function of the full outline per twist. Of a rectangle with
    /// the long side a and the short side b: b (1 - 8/pi^2 sum over odd n of 1/(n^2 cosh(n pi a/(2 b)))).
    fn stress_function_slope(self, width: f64, thickness: f64) -> f64 {
        let (long, short) = (width.max(thickness), width.min(thickness));
        match self {
            ClosedOutline::Ellipse => {
                let ratio = short / long;
                short / (1.0 + ratio * ratio)
            }
            ClosedOutline::Rectangle => {
                let odd = (0..RECTANGLE_SERIES_TERMS).map(|k| f64::from(2 * k + 1));
                let terms = odd.map(|n| 1.0 / (n * n * (n * PI * long / (2.0 * short)).cosh()));
                short * (1.0 - 8.0 / (PI * PI) * terms.sum::<f64>())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn close(found: f64, wanted: f64, relative: f64) {
        assert!((found / wanted - 1.0).abs() < relative, "{found} {wanted}");
    }

    /// Table 6 of Timoshenko and Goodier, art. 109, with more digits from summing the series
    /// term by term, and the thin strip.
    #[test]
    fn torsion_of_rectangles() {
        for (sides, constant) in [
            (1.0, 0.140_577_014_955),
            (2.0, 0.228_681_655_7),
            (10.0, 0.312_332_5),
        ] {
            for (width, thickness) in [(sides, 1.0), (1.0, sides)] {
                let found = ClosedOutline::Rectangle.torsion_constant(width, thickness);
                close(found, constant * sides, 3e-5);
            }
        }
        let direct = |long: f64| {
            let odd = (0..20_000).map(|k| (2 * k + 1) as f64);
            let sum: f64 = odd.map(|n| (n * PI * long / 2.0).tanh() / n.powi(5)).sum();
            long * (1.0 / 3.0 - 64.0 / PI.powi(5) / long * sum)
        };
        for long in [1.0, 1.3, 4.0, 50.0] {
            close(
                ClosedOutline::Rectangle.torsion_constant(long, 1.0),
                direct(long),
                1e-13,
            );
        }
        close(
            ClosedOutline::Rectangle.torsion_constant(1e4, 1.0),
            1e4 / 3.0,
            1e-4,
        );
    }

    fn hollow(outline: ClosedOutline, width: f64, thickness: f64, wall: f64) -> SectionDimensions {
        SectionDimensions {
            outline,
            width,
            thickness,
            wall: Some(wall),
        }
    }

    /// Of a tube from d to D: pi (D^4 - d^4)/32 and /64, and Cowper's factor of a thin one,
    /// 2 (1 + nu)/(4 + 3 nu).
    #[test]
    fn a_tube() {
        for wall in [0.001, 0.1, 0.3, 0.5] {
            let inner = 1.0 - 2.0 * wall;
            let polar = PI / 32.0 * (1.0 - f64::powi(inner, 4));
            let tube = hollow(ClosedOutline::Ellipse, 1.0, 1.0, wall);
            close(tube.torsion_constant(), polar, 1e-13);
            close(tube.area(), PI / 4.0 * (1.0 - inner * inner), 1e-13);
            let [second, third] = tube.second_moments();
            close(second, polar / 2.0, 1e-13);
            close(third, polar / 2.0, 1e-13);
        }
        let [thin, full] = [1e-6, 0.5].map(|wall| hollow(ClosedOutline::Ellipse, 1.0, 1.0, wall));
        close(thin.shear_factors(0.3)[0], 2.6 / 4.9, 1e-5);
        close(full.shear_factors(0.3)[1], 7.8 / 8.8, 1e-14);
    }

    /// Thin walls: Bredt's 4 A^2 t/s, and bending of four plates. Cowper's factor of a square tube
    /// is 20 (1 + nu)/(48 + 39 nu).
    #[test]
    fn thin_walls() {
        let (w, t, wall) = (2.0, 1.0, 1e-7);
        let tube = hollow(ClosedOutline::Rectangle, w, t, wall);
        close(
            tube.torsion_constant(),
            4.0 * (w * t).powi(2) * wall / (2.0 * (w + t)),
            1e-6,
        );
        close(tube.area(), 2.0 * (w + t) * wall, 1e-6);
        let [soft, stiff] = tube.second_moments();
        close(soft, wall * (t.powi(3) / 6.0 + w * t * t / 2.0), 1e-6);
        close(stiff, wall * (w.powi(3) / 6.0 + t * w * w / 2.0), 1e-6);
        let square = hollow(ClosedOutline::Rectangle, 1.0, 1.0, 1e-9);
        close(square.shear_factors(0.3)[0], 26.0 / 59.7, 1e-8);
    }

    /// Torsion constants from finite differences (rectangles) and bilinear elements (ellipses) for
    /// the stress function on three grids, extrapolated.
    #[test]
    fn torsion_constants_of_hollow_sections() {
        use ClosedOutline::{Ellipse, Rectangle};
        for (outline, width, thickness, wall, torsion, within) in [
            (Rectangle, 1.0, 1.0, 0.02, 0.018_998, 2e-3),
            (Rectangle, 1.0, 1.0, 0.1, 0.077_092, 3e-3),
            (Rectangle, 1.0, 1.0, 0.3, 0.135_647, 9e-3),
            (Rectangle, 2.0, 1.0, 0.05, 0.120_270, 3e-3),
            (Rectangle, 1.0, 2.0, 0.2, 0.348_626, 5e-3),
            (Rectangle, 4.0, 1.0, 0.1, 0.524_925, 2e-3),
            (Rectangle, 4.0, 1.0, 0.4, 1.098_601, 4e-3),
            (Ellipse, 4.0, 2.0, 0.05, 0.745_960, 2e-4),
            (Ellipse, 2.0, 4.0, 0.4, 3.877_292, 6e-3),
            (Ellipse, 20.0, 2.0, 0.2, 12.867_544, 3e-3),
        ] {
            let tube = hollow(outline, width, thickness, wall);
            close(tube.torsion_constant(), torsion, within);
            assert!(tube.torsion_constant() < tube.torsion_upper_bound());
        }
        // A wall of half the thickness leaves no hole.
        let full = hollow(Rectangle, 1.7, 1.0, 0.5);
        close(
            full.torsion_constant(),
            Rectangle.torsion_constant(1.7, 1.0),
            1e-14,
        );
    }

    fn moduli(outline: ClosedOutline, width: f64, thickness: f64, wall: Option<f64>) -> Moduli {
        let sides = SectionDimensions {
            outline,
            width,
            thickness,
            wall,
        };
        sides.moduli()
    }

    /// Largest shear stress M/(k a b^2) of rectangles (Timoshenko and Goodier, art. 109, table 12),
    /// and 2 M/(pi a b^2) of an ellipse with these semi-axes; whichever way it lies.
    #[test]
    fn torsion_of_full_sections() {
        for (long, k) in [
            (1.0, 0.208),
            (1.5, 0.231),
            (2.0, 0.246),
            (3.0, 0.267),
            (4.0, 0.282),
            (10.0, 0.312),
        ] {
            for (width, thickness) in [(long, 1.0), (1.0, long)] {
                let found = moduli(ClosedOutline::Rectangle, width, thickness, None).torsion;
                close(found, 1.0 / (k * long), 3e-3);
                let found = moduli(ClosedOutline::Ellipse, width, thickness, None).torsion;
                close(found, 16.0 / (PI * long), 1e-14);
            }
        }
    }

    /// Tubes: M (D/2)/J; M/(2 A t) of thin ones; the slope in the middle of the long sides from finite
    /// differences for the stress function on two grids, over J.
    #[test]
    fn torsion_of_hollow_sections() {
        use ClosedOutline::{Ellipse, Rectangle};
        for wall in [0.01, 0.2, 0.5] {
            let polar = PI / 32.0 * (1.0 - f64::powi(1.0 - 2.0 * wall, 4));
            close(
                moduli(Ellipse, 1.0, 1.0, Some(wall)).torsion,
                0.5 / polar,
                1e-13,
            );
        }
        let thin = 1e-6;
        for (outline, area) in [(Rectangle, 2.0), (Ellipse, PI / 2.0)] {
            let found = moduli(outline, 2.0, 1.0, Some(thin)).torsion;
            close(found, 1.0 / (2.0 * area * thin), 1e-5);
        }
        for (width, wall, slope, torsion) in [
            (1.0, 0.1, 0.5697, 0.07703),
            (1.0, 0.2, 0.6343, 0.11807),
            (1.0, 0.4, 0.6750, 0.14024),
            (2.0, 0.1, 0.7281, 0.21637),
            (2.0, 0.3, 0.8390, 0.41853),
            (4.0, 0.1, 0.8434, 0.52474),
            (4.0, 0.3, 0.9169, 1.02655),
        ] {
            let found = moduli(Rectangle, width, 1.0, Some(wall)).torsion;
            close(found, slope / torsion, 0.04);
        }
    }

    /// Of the mean: 3/2 in a rectangle, 4/3 in an ellipse, 2 in a thin tube; in one whose inner
    /// diameter is half of the outer one 4/3 (R^2 + R r + r^2)/(R^2 + r^2).
    #[test]
    fn shear_by_forces() {
        use ClosedOutline::{Ellipse, Rectangle};
        for (outline, width, thickness, wall, factor) in [
            (Rectangle, 3.0, 0.7, None, 1.5),
            (Rectangle, 3.0, 0.7, Some(0.35), 1.5),
            (Ellipse, 3.0, 0.7, None, 4.0 / 3.0),
            (Ellipse, 1.0, 1.0, Some(1e-7), 2.0),
            (Ellipse, 1.0, 1.0, Some(0.25), 4.0 / 3.0 * 1.75 / 1.25),
        ] {
            let found = moduli(outline, width, thickness, wall);
            for shear in found.shear {
                close(shear * found.area, factor, 1e-6);
            }
        }
    }

    /// Bent about both axes, the largest stress is that of the extreme among many points of the outline.
    #[test]
    fn bending_about_both_axes() {
        let (w, t, about) = (2.0, 0.5, [0.7, 1.9]);
        let around = (0..100_000).map(|k| f64::from(k) / 1e5 * 2.0 * PI);
        let ellipse = moduli(ClosedOutline::Ellipse, w, t, None);
        let [second, third] = [w * t * t * t, t * w * w * w].map(|it| PI / 64.0 * it);
        let stress = around.map(|angle: f64| {
            let (y, z) = (0.5 * w * angle.cos(), 0.5 * t * angle.sin());
            2.0 * 4.0 / (PI * w * t) + (about[0] * z / second - about[1] * y / third).abs()
        });
        let most = stress.fold(0.0, f64::max);
        let n = DVec3::new(-2.0, 0.0, 0.0);
        let m = DVec3::new(0.0, -about[0], about[1]);
        close(ellipse.stress(n, m).normal, most, 1e-8);
        let rectangle = moduli(ClosedOutline::Rectangle, w, t, None);
        let most = 2.0 / (w * t) + 6.0 * (about[0] / (w * t * t) + about[1] / (t * w * w));
        close(rectangle.stress(n, m).normal, most, 1e-14);
    }
}
