//! Areas, moments and factors of full and hollow sections.
//!
//! Second moments and areas of hollow sections are those of the outline less those of the hole.
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

use std::f64::consts::PI;

use super::gauss::GAUSS;
use crate::words;

words! {
    /// The outline of a section.
    pub enum Outline {
        /// A circle, whose width and thickness are the same.
        Circle = "circle",
        /// An ellipse with its width along d2 and its thickness along d3.
        Ellipse = "ellipse",
        /// A rectangle with the same sides.
        Rectangle = "rectangle",
    }
}

/// A section at one place, with its wall if it is hollow.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sides {
    pub outline: Outline,
    pub width: f64,
    pub thickness: f64,
    pub wall: Option<f64>,
}

impl Sides {
    /// Those of the hole.
    pub fn hole(self) -> Option<Sides> {
        let inside = |side: f64, wall: f64| (side - 2.0 * wall).max(0.0);
        self.wall.map(|wall| Sides {
            width: inside(self.width, wall),
            thickness: inside(self.thickness, wall),
            wall: None,
            ..self
        })
    }

    /// The area within the outline, with the hole.
    pub fn enclosed(self) -> f64 {
        match self.outline {
            Outline::Circle | Outline::Ellipse => PI / 4.0 * self.width * self.thickness,
            Outline::Rectangle => self.width * self.thickness,
        }
    }

    pub fn area(self) -> f64 {
        self.enclosed() - self.hole().map_or(0.0, Sides::enclosed)
    }

    /// The second moments I2 and I3 of the area, about d2 and d3.
    pub fn second_moments(self) -> [f64; 2] {
        let factor = match self.outline {
            Outline::Circle | Outline::Ellipse => PI / 64.0,
            Outline::Rectangle => 1.0 / 12.0,
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
    pub fn torsion(self) -> f64 {
        let Some(wall) = self.wall else {
            return self.outline.torsion(self.width, self.thickness);
        };
        let panel = |from: f64| -> f64 {
            let layers = GAUSS.iter();
            layers
                .map(|(x, weight)| weight * self.layer((from + x / PANELS) * wall))
                .sum()
        };
        let panels = (0..PANELS as usize).map(|k| panel(k as f64 / PANELS));
        let below = 4.0 * wall / PANELS * panels.sum::<f64>();
        match self.outline {
            Outline::Circle | Outline::Ellipse => below,
            Outline::Rectangle => below + self.between(wall) * (self.most_torsion() - below),
        }
    }

    /// The torsion constant of the outline less that of the hole.
    fn most_torsion(self) -> f64 {
        let of = |sides: Sides| match sides.width.min(sides.thickness) > 0.0 {
            true => sides.outline.torsion(sides.width, sides.thickness),
            false => 0.0,
        };
        of(self) - self.hole().map_or(0.0, of)
    }

    /// Where the torsion constant of a rectangle lies between its bounds.
    pub fn between(self, wall: f64) -> f64 {
        let (long, short) = (
            self.width.max(self.thickness),
            self.width.min(self.thickness),
        );
        let part = 2.0 * wall / short;
        part + (short / long).powi(2) * part * (1.0 - part)
    }

    /// A^2/g of the line at this depth in the wall.
    fn layer(self, depth: f64) -> f64 {
        let (w, t) = (self.width - 2.0 * depth, self.thickness - 2.0 * depth);
        let (area, gradient) = match self.outline {
            Outline::Circle | Outline::Ellipse => {
                // Of ellipses with the semi-axes a - x and b - x.
                let (a, b) = (w / 2.0, t / 2.0);
                (PI * a * b, 2.0 * PI * (a + b - (a * b).sqrt()))
            }
            Outline::Rectangle => (w * t, 2.0 * (w + t)),
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
                Outline::Rectangle => box_shear_factor(along - wall, across - wall, nu),
                Outline::Circle | Outline::Ellipse => {
                    let full = self.outline.shear_factor(along, across, nu);
                    let hole = ((along - 2.0 * wall) / along).powi(2);
                    full * of_hollow_circle(hole, nu) / of_hollow_circle(0.0, nu)
                }
            }
        })
    }
}

/// So many panels of five points resolve the layers of every wall to 1e-9.
const PANELS: f64 = 4.0;

/// Cowper's factor of a hollow circle, the square of whose inner diameter is the part `hole` of
/// that of the outer one. That of a hollow ellipse is that of the full one, reduced as for circles:
/// an estimate.
fn of_hollow_circle(hole: f64, nu: f64) -> f64 {
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

impl Outline {
    /// The torsion constant J. Of a rectangle with the long side a and the short
    /// side b: a b^3 (1/3 - 64/pi^5 b/a sum over odd n of tanh(n pi a/(2 b))/n^5).
    fn torsion(self, width: f64, thickness: f64) -> f64 {
        match self {
            Outline::Circle | Outline::Ellipse => {
                let (a, b) = (width / 2.0, thickness / 2.0);
                // In this order equal sides give the circle's value to the last bit but one.
                PI * a * b * (a * b) * ((a * b) / (a * a + b * b))
            }
            Outline::Rectangle => {
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
            Outline::Rectangle => 10.0 * (1.0 + nu) / (12.0 + 11.0 * nu),
            Outline::Circle | Outline::Ellipse => {
                let (a, b) = (along * along, across * across);
                12.0 * (1.0 + nu) * a * (3.0 * a + b)
                    / ((40.0 + 37.0 * nu) * a * a + (16.0 + 10.0 * nu) * a * b + nu * b * b)
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
                let found = Outline::Rectangle.torsion(width, thickness);
                close(found, constant * sides, 3e-5);
            }
        }
        let direct = |long: f64| {
            let odd = (0..20_000).map(|k| (2 * k + 1) as f64);
            let sum: f64 = odd.map(|n| (n * PI * long / 2.0).tanh() / n.powi(5)).sum();
            long * (1.0 / 3.0 - 64.0 / PI.powi(5) / long * sum)
        };
        for long in [1.0, 1.3, 4.0, 50.0] {
            close(Outline::Rectangle.torsion(long, 1.0), direct(long), 1e-13);
        }
        close(Outline::Rectangle.torsion(1e4, 1.0), 1e4 / 3.0, 1e-4);
    }

    fn hollow(outline: Outline, width: f64, thickness: f64, wall: f64) -> Sides {
        Sides {
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
            for outline in [Outline::Circle, Outline::Ellipse] {
                let tube = hollow(outline, 1.0, 1.0, wall);
                close(tube.torsion(), polar, 1e-13);
                close(tube.area(), PI / 4.0 * (1.0 - inner * inner), 1e-13);
                let [second, third] = tube.second_moments();
                close(second, polar / 2.0, 1e-13);
                close(third, polar / 2.0, 1e-13);
            }
        }
        let [thin, full] = [1e-6, 0.5].map(|wall| hollow(Outline::Circle, 1.0, 1.0, wall));
        close(thin.shear_factors(0.3)[0], 2.6 / 4.9, 1e-5);
        close(full.shear_factors(0.3)[1], 7.8 / 8.8, 1e-14);
    }

    /// Thin walls: Bredt's 4 A^2 t/s, and bending of four plates. Cowper's factor of a square tube
    /// is 20 (1 + nu)/(48 + 39 nu).
    #[test]
    fn thin_walls() {
        let (w, t, wall) = (2.0, 1.0, 1e-7);
        let tube = hollow(Outline::Rectangle, w, t, wall);
        close(
            tube.torsion(),
            4.0 * (w * t).powi(2) * wall / (2.0 * (w + t)),
            1e-6,
        );
        close(tube.area(), 2.0 * (w + t) * wall, 1e-6);
        let [soft, stiff] = tube.second_moments();
        close(soft, wall * (t.powi(3) / 6.0 + w * t * t / 2.0), 1e-6);
        close(stiff, wall * (w.powi(3) / 6.0 + t * w * w / 2.0), 1e-6);
        let square = hollow(Outline::Rectangle, 1.0, 1.0, 1e-9);
        close(square.shear_factors(0.3)[0], 26.0 / 59.7, 1e-8);
    }

    /// Torsion constants from finite differences (rectangles) and bilinear elements (ellipses) for
    /// the stress function on three grids, extrapolated.
    #[test]
    fn torsion_of_hollow_sections() {
        use Outline::{Ellipse, Rectangle};
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
            close(tube.torsion(), torsion, within);
            assert!(tube.torsion() < tube.most_torsion());
        }
        // A wall of half the thickness leaves no hole.
        let full = hollow(Rectangle, 1.7, 1.0, 0.5);
        close(full.torsion(), Rectangle.torsion(1.7, 1.0), 1e-14);
    }
}
