//! Sections bounded by straight lines that are no rectangles: an isosceles triangle, a regular hexagon and a channel.
//!
//! Areas and second moments are exact; the axis of the rod passes through the centroid. Of sections with one axis of
//! symmetry the shear center is beside the centroid: the twist by a shear force across the symmetry axis, of the order
//! of the force times that distance, is left out, as the rod couples no shear with torsion.
//!
//! # Torsion
//!
//! L. Prandtl's stress function, -2 within the section under the Laplace operator and zero on its edge, was solved by
//! rational functions with poles that cluster at the corners (A. Gopal and L. N. Trefethen, SIAM J. Numer. Anal. 57
//! (2019), 2074): equilateral triangles and squares come out to 14 digits.
//!
//! - Triangle: J = w^3 t^3 f/(12 (w^2 + t^2)), f = 1 - (1 - x^2)(1 - x) h(x), x = (w - c t)/(w + c t), c = 2/sqrt(3). f
//!   is 1 in both limits, of thin wedges (the integral of b^3/3), and 7/10 of the equilateral one. The polynomial h is
//!   fitted to 36 triangles with w/t from 1/42 to 12: f is within 4e-9 there.
//! - Hexagon: J and the slope of the stress function in the middle of a side by the same method, to 13 digits.
//! - Channel, whose web and flanges are a wall e thick: J = e^3 (w + 2 t - 2 e)/3 - C e^4. C has the two ends of a strip,
//!   0.10504 e^4 each (from the series of rectangles), and two corners, -0.07249 e^4 each, from finite differences
//!   on four grids. It is within 0.4 % where the gap is e wide or wider, and the flanges rise e above the web or higher.
//!
//! # Shear
//!
//! The factors are those of the energy of D. I. Zhuravskii's shear stresses, k = I^2/(S integral of (Q/b)^2 dS), which
//! do not depend on Poisson's ratio; the largest stress by a force is the largest Q/(I b). A channel is taken as its
//! middle line, along which the shear flows. (S. P. Timoshenko, Strength of Materials, part I, arts. 26 and 66, part II,
//! art. 53.)

use crate::numbers::{GAUSS_LEGENDRE_RULE, largest};
use glam::DVec2;

/// J of a regular hexagon as wide as 1 across flats.
const HEXAGON_TORSION: f64 = 0.115_050_994_404_600;

/// The largest slope of the stress function of that hexagon per twist, in the middle of a side.
const HEXAGON_SLOPE: f64 = 0.613_038_471_314_25;

/// Shear factors of a regular hexagon across flats, and from corner to corner.
const HEXAGON_SHEAR: [f64; 2] = [0.901_156_493_765_664, 0.9];

/// The largest shear stress in a regular hexagon by a force across flats, and by one from corner to corner, over the
/// mean one: across flats it is at 0.19 of the way to them.
const HEXAGON_PEAK_SHEAR: [f64; 2] = [1.258_733_462_3, 1.4];

/// Chebyshev coefficients of h, from which the torsion constant of a triangle follows.
const TRIANGLE_TORSION: [f64; 15] = [
    2.643_668_514_541_858e-1,
    5.912_870_411_579_522e-2,
    -3.436_633_957_691_709e-2,
    -1.082_785_006_565_61e-2,
    1.460_529_612_452_586e-3,
    1.451_901_921_747_545e-3,
    1.269_780_579_423_247e-4,
    -1.579_543_076_832_077e-4,
    -5.853_701_388_987_48e-5,
    3.349_558_372_612_832e-6,
    6.374_365_864_314_408e-6,
    -4.804_731_211_219_892e-7,
    -2.046_988_160_081_567e-6,
    -9.865_742_961_904_741e-7,
    -2.160_258_216_602_145e-7,
];

/// The deficit of the slope of the stress function in the middle of the base of a flat triangle, (1 - slope/t)/(1 - x),
/// as a polynomial in 1 - x: within 2e-6 of the solutions.
const FLAT_TRIANGLE_SLOPE: [f64; 6] = [
    0.382_431_289_03,
    0.135_943_440_16,
    0.032_098_809_65,
    -0.040_798_409_57,
    -0.027_846_609_80,
    0.018_171_425_83,
];

/// The same of the largest slope on the legs of a tall one, (1 - slope/w)/(1 + x), as a polynomial in 1 + x and, in
/// [`TALL_TRIANGLE_LOGARITHM`], one times ln(1 + x): within 5e-6.
const TALL_TRIANGLE_SLOPE: [f64; 3] = [0.449_140_987_95, 0.131_203_364_30, -0.013_352_458_26];

/// See [`TALL_TRIANGLE_SLOPE`].
const TALL_TRIANGLE_LOGARITHM: [f64; 2] = [-0.184_839_528_31, -0.028_788_481_34];

/// C e^4 is by how much the torsion constant of a channel of the wall e is less than that of its middle line, 1/3 e^3 a
/// length: of two ends and two corners.
const CHANNEL_ENDS_AND_CORNERS: f64 = 2.0 * (0.105_040 - 0.072_486);

/// The least gap of a channel, and the least height of its flanges above the web, in thicknesses of the wall.
pub(super) const LEAST_CHANNEL_GAP: f64 = 1.0;

/// A section bounded by straight lines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum PolygonSection {
    /// An isosceles triangle: its base of this width, along d2, is on the side of -d3; its height is along d3.
    Triangle { width: f64, height: f64 },
    /// A regular hexagon of this width across flats, along d2; two of its corners lie along d3.
    Hexagon { width: f64 },
    /// A channel, open towards d3: its web, of this width, lies along d2, and two flanges reach up to the height along
    /// d3, which includes the web.
    Channel { width: f64, height: f64, wall: f64 },
}

/// The corners of a section's outline that no others enclose, from its centroid, along d2 and d3.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct OuterCorners {
    corners: [DVec2; 6],
    count: usize,
}

impl OuterCorners {
    fn new(given: &[[f64; 2]]) -> OuterCorners {
        let mut corners = [DVec2::ZERO; 6];
        for (corner, given) in corners.iter_mut().zip(given) {
            *corner = DVec2::from_array(*given);
        }
        OuterCorners {
            corners,
            count: given.len(),
        }
    }

    pub fn as_slice(&self) -> &[DVec2] {
        &self.corners[..self.count]
    }
}

/// The middle line of a channel.
struct ChannelLine {
    /// Length of the web.
    web: f64,
    /// Length of each flange.
    flange: f64,
    wall: f64,
    /// Height of the centroid over the web.
    centroid: f64,
}

impl ChannelLine {
    fn new(width: f64, height: f64, wall: f64) -> ChannelLine {
        let (web, flange) = (width - wall, height - wall / 2.0);
        ChannelLine {
            web,
            flange,
            wall,
            centroid: flange * flange / (web + 2.0 * flange),
        }
    }

    fn area(&self) -> f64 {
        self.wall * (self.web + 2.0 * self.flange)
    }

    /// Second moments about the axes along the web and along the flanges.
    fn second_moments(&self) -> [f64; 2] {
        let (b, h) = (self.web, self.flange);
        let along = self.wall * 2.0 * h.powi(3) / 3.0 - self.area() * self.centroid.powi(2);
        [along, self.wall * (b.powi(3) / 12.0 + h * b * b / 2.0)]
    }

    /// The first moment of the area between the tip of a flange and the place so far from it along the middle line,
    /// which ends in the middle of the web: for a force along the web, and for one along the flanges.
    fn first_moments(&self, from_tip: f64) -> [f64; 2] {
        let (b, h) = (self.web, self.flange);
        let on_flange = from_tip.min(h);
        let on_web = from_tip - on_flange;
        let along_web = b / 2.0 * on_flange + on_web * (b - on_web) / 2.0;
        let along_flanges =
            on_flange * (h - self.centroid - on_flange / 2.0) - self.centroid * on_web;
        [along_web, along_flanges].map(|moment| self.wall * moment)
    }

    /// The integrals of Q^2/e along the middle line for both forces.
    fn shear_energies(&self) -> [f64; 2] {
        let mut sums = [0.0; 2];
        for (begin, length) in [(0.0, self.flange), (self.flange, self.web / 2.0)] {
            for point in GAUSS_LEGENDRE_RULE {
                let moments = self.first_moments(begin + point.at * length);
                for (sum, moment) in sums.iter_mut().zip(moments) {
                    *sum += 2.0 * point.weight * length * moment * moment / self.wall;
                }
            }
        }
        sums
    }
}

impl PolygonSection {
    /// The area of the material.
    pub fn area(self) -> f64 {
        match self {
            PolygonSection::Triangle { width, height } => width * height / 2.0,
            PolygonSection::Hexagon { width } => 3_f64.sqrt() / 2.0 * width * width,
            PolygonSection::Channel {
                width,
                height,
                wall,
            } => width * height - (width - 2.0 * wall) * (height - wall),
        }
    }

    /// The extent along d3.
    pub fn height(self) -> f64 {
        match self {
            PolygonSection::Triangle { height, .. } | PolygonSection::Channel { height, .. } => {
                height
            }
            PolygonSection::Hexagon { width } => 2.0 / 3_f64.sqrt() * width,
        }
    }

    /// The height of the centroid of a channel over the outer side of its web.
    fn channel_centroid(width: f64, height: f64, wall: f64) -> f64 {
        let (gap, flange) = (width - 2.0 * wall, height - wall);
        let whole = width * height * height / 2.0;
        let hole = gap * flange * (wall + flange / 2.0);
        (whole - hole) / (width * height - gap * flange)
    }

    /// The second moments I2 and I3 of the area, about d2 and d3.
    pub fn second_moments(self) -> [f64; 2] {
        match self {
            PolygonSection::Triangle { width, height } => {
                [width * height.powi(3) / 36.0, height * width.powi(3) / 48.0]
            }
            PolygonSection::Hexagon { width } => [5.0 * 3_f64.sqrt() / 144.0 * width.powi(4); 2],
            PolygonSection::Channel {
                width,
                height,
                wall,
            } => {
                let (gap, flange) = (width - 2.0 * wall, height - wall);
                let centroid = PolygonSection::channel_centroid(width, height, wall);
                // Of a rectangle whose middle is at this height.
                let about_2 = |width: f64, height: f64, middle: f64| {
                    width * height * (height * height / 12.0 + (middle - centroid).powi(2))
                };
                let second = about_2(width, height, height / 2.0)
                    - about_2(gap, flange, wall + flange / 2.0);
                let third = (height * width.powi(3) - flange * gap.powi(3)) / 12.0;
                [second, third]
            }
        }
    }

    /// The torsion constant J.
    pub fn torsion_constant(self) -> f64 {
        match self {
            PolygonSection::Triangle { width, height } => {
                let x = slenderness(width, height);
                let f = 1.0 - (1.0 - x * x) * (1.0 - x) * chebyshev_sum(&TRIANGLE_TORSION, x);
                let (w, t) = (width * width, height * height);
                width * height / 12.0 * (w * t / (w + t)) * f
            }
            PolygonSection::Hexagon { width } => HEXAGON_TORSION * width.powi(4),
            PolygonSection::Channel {
                width,
                height,
                wall,
            } => {
                let line = width + 2.0 * height - 2.0 * wall;
                wall.powi(3) * (line / 3.0 - CHANNEL_ENDS_AND_CORNERS * wall)
            }
        }
    }

    /// The largest slope of the stress function per twist. That at the sharp inner corners of a channel, which
    /// concentrate stress, is left out: it is the thickness of the wall.
    pub fn stress_function_slope(self) -> f64 {
        match self {
            PolygonSection::Triangle { width, height } => {
                let x = slenderness(width, height);
                match x > 0.0 {
                    true => height * (1.0 - (1.0 - x) * horner(&FLAT_TRIANGLE_SLOPE, 1.0 - x)),
                    false => {
                        let y = 1.0 + x;
                        let logarithm = y.ln() * horner(&TALL_TRIANGLE_LOGARITHM, y);
                        width * (1.0 - y * (horner(&TALL_TRIANGLE_SLOPE, y) + logarithm))
                    }
                }
            }
            PolygonSection::Hexagon { width } => HEXAGON_SLOPE * width,
            PolygonSection::Channel { wall, .. } => wall,
        }
    }

    /// Factors for shear forces along d2 and along d3.
    pub fn shear_factors(self) -> [f64; 2] {
        match self {
            PolygonSection::Triangle { .. } => [30.0 / 31.0, 5.0 / 6.0],
            PolygonSection::Hexagon { .. } => HEXAGON_SHEAR,
            PolygonSection::Channel {
                width,
                height,
                wall,
            } => {
                let line = ChannelLine::new(width, height, wall);
                let [along, across] = line.second_moments();
                let energies = line.shear_energies();
                [
                    across * across / (line.area() * energies[0]),
                    along * along / (line.area() * energies[1]),
                ]
            }
        }
    }

    /// The largest shear stress by a force along d2, and by one along d3, each over the mean one.
    pub fn peak_shear(self) -> [f64; 2] {
        match self {
            PolygonSection::Triangle { .. } => [9.0 / 8.0, 3.0 / 2.0],
            PolygonSection::Hexagon { .. } => HEXAGON_PEAK_SHEAR,
            PolygonSection::Channel {
                width,
                height,
                wall,
            } => {
                let line = ChannelLine::new(width, height, wall);
                let [along, across] = line.second_moments();
                let [middle, _] = line.first_moments(line.flange + line.web / 2.0);
                // The shear flow is largest at the height of the centroid.
                let [_, neutral] = line.first_moments(line.flange - line.centroid);
                [middle / across, neutral / along].map(|it| it * line.area() / wall)
            }
        }
    }

    /// The corners in one of which bending and tension stress the section most.
    pub fn outer_corners(self) -> OuterCorners {
        match self {
            PolygonSection::Triangle { width, height } => OuterCorners::new(&[
                [-width / 2.0, -height / 3.0],
                [width / 2.0, -height / 3.0],
                [0.0, 2.0 * height / 3.0],
            ]),
            PolygonSection::Hexagon { width } => {
                let side = width / 3_f64.sqrt();
                let right = width / 2.0;
                OuterCorners::new(&[
                    [0.0, side],
                    [right, side / 2.0],
                    [right, -side / 2.0],
                    [0.0, -side],
                    [-right, -side / 2.0],
                    [-right, side / 2.0],
                ])
            }
            PolygonSection::Channel {
                width,
                height,
                wall,
            } => {
                let centroid = PolygonSection::channel_centroid(width, height, wall);
                let right = width / 2.0;
                let (below, above) = (-centroid, height - centroid);
                OuterCorners::new(&[
                    [-right, below],
                    [right, below],
                    [right, above],
                    [-right, above],
                ])
            }
        }
    }

    /// The largest size of the stress along the rod, by a tension per area and moments about d2 and d3.
    pub fn normal_stress(self, tension: f64, [about_2, about_3]: [f64; 2]) -> f64 {
        let [second, third] = self.second_moments();
        let at =
            |corner: &DVec2| tension + about_2 / second * corner.y - about_3 / third * corner.x;
        let corners = self.outer_corners();
        largest(corners.as_slice().iter().map(|corner| at(corner).abs()))
    }
}

/// x of a triangle: 0 of the equilateral one, towards 1 where it is flat, towards -1 where it is tall.
fn slenderness(width: f64, height: f64) -> f64 {
    let height = 2.0 / 3_f64.sqrt() * height;
    (width - height) / (width + height)
}

/// A sum of Chebyshev polynomials (C. W. Clenshaw 1955).
fn chebyshev_sum(coefficients: &[f64], x: f64) -> f64 {
    let (mut last, mut before) = (0.0, 0.0);
    for coefficient in coefficients[1..].iter().rev() {
        (last, before) = (coefficient + 2.0 * x * last - before, last);
    }
    coefficients[0] + x * last - before
}

/// A polynomial, its constant first.
fn horner(coefficients: &[f64], x: f64) -> f64 {
    let sum = coefficients.iter().rev();
    sum.fold(0.0, |sum, coefficient| sum * x + coefficient)
}

#[cfg(test)]
mod tests;
