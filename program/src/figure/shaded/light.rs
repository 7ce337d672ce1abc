//! The light on a leaf: a sun that is a disc, so that shadows are soft, and a sky of the same brightness all over.
//! Both are sums of distant lights, each with the shadow that the leaf casts in its light.
//!
//! Irradiances are fractions of that of open, level ground. Lengths are those of the longest vein, and z points up.

use crate::figure::shaded::raster::{DepthMap, ProjectedTriangle};
use glam::{DQuat, DVec2, DVec3};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// A triangle in space.
pub type SpaceTriangle = [DVec3; 3];

/// The irradiance of open, level ground from the sun; the rest is from the sky.
pub const SUN_SHARE: f64 = 0.55;

/// Half of the angle under which the sun is seen, radians: larger than the real one, for softer shadows.
const SUN_RADIUS: f64 = 0.08;

/// Irradiance from below, which open ground throws back.
const GROUND_SHARE: f64 = 0.16;

/// How the sun and the sky are divided: lights, and the samples of a side of the shadow of each. Lights are
/// multiples of the nine samples of a pixel.
struct LightDivision {
    lights: usize,
    shadow_side: usize,
}

const SUN_DIVISION: LightDivision = LightDivision {
    lights: 90,
    shadow_side: 480,
};

const SKY_DIVISION: LightDivision = LightDivision {
    lights: 90,
    shadow_side: 240,
};

/// A surface is lit as from this many samples of a shadow above it, so that it does not shade itself.
const SELF_SHADOW_OFFSET: f64 = 1.3;

/// How narrow the sun is reflected: the exponent of J. F. Blinn (Computer Graphics 11, 1977, 192).
const GLOSS_EXPONENT: i32 = 24;

/// Cells along the longer side of the grid on which the shadow of the leaf on the ground is known roughly.
const GROUND_SHADOW_SIDE: usize = 400;

/// A distant light, and the shadow of the leaf in it.
struct Light {
    /// Unit vector toward the light.
    toward: DVec3,
    /// Irradiance of a surface that faces it.
    irradiance: f64,
    /// From space into the samples of the shadow map: what a place along these axes adds to the column, the row and
    /// the depth, which is along the light and in lengths, and the place of the origin.
    axes: [DVec3; 3],
    origin: DVec2,
    samples_per_length: f64,
    depths: DepthMap,
}

impl Light {
    fn new(toward: DVec3, irradiance: f64, casters: &[SpaceTriangle], side: usize) -> Self {
        let to_frame = DQuat::from_rotation_arc(toward, DVec3::Z);
        let corners = casters
            .iter()
            .flatten()
            .map(|&it| (to_frame * it).truncate());
        let bounds = corners.fold(None, |bounds: Option<[DVec2; 2]>, it| {
            let [low, high] = bounds.unwrap_or([it; 2]);
            Some([low.min(it), high.max(it)])
        });
        let [corner, high] = bounds.unwrap_or_default();
        let extent = (high - corner).max_element().max(1e-9);
        let samples_per_length = side as f64 / extent;
        let from_frame = to_frame.inverse();
        let mut light = Light {
            toward,
            irradiance,
            axes: [
                from_frame * DVec3::X * samples_per_length,
                from_frame * DVec3::Y * samples_per_length,
                toward,
            ],
            origin: -samples_per_length * corner,
            samples_per_length,
            depths: DepthMap::render(std::iter::empty(), 0),
        };
        let projected = casters.iter().map(|corners| ProjectedTriangle {
            corners: corners.map(|corner| light.in_samples(corner)),
        });
        light.depths = DepthMap::render(projected, side);
        light
    }

    /// A point in the samples of the shadow map, with its depth in lengths.
    fn in_samples(&self, point: DVec3) -> DVec3 {
        let [x, y, z] = self.axes.map(|axis| axis.dot(point));
        DVec3::new(self.origin.x + x, self.origin.y + y, z)
    }

    fn reaches(&self, point: DVec3) -> bool {
        self.depths.is_visible(self.in_samples(point))
    }

    /// Whether it reaches a surface, on the side on which it is.
    fn reaches_surface(&self, point: DVec3, normal: DVec3) -> bool {
        let outward = normal * self.toward.dot(normal).signum();
        self.reaches(point + SELF_SHADOW_OFFSET / self.samples_per_length * outward)
    }
}

/// A part of all lights, every so many from one of them on, each as bright as it and those left out.
#[derive(Clone, Copy)]
pub struct LightSubset {
    pub first: usize,
    pub every: usize,
}

impl LightSubset {
    pub const ALL: LightSubset = LightSubset { first: 0, every: 1 };

    fn lights(self, lights: &[Light]) -> impl Iterator<Item = (&Light, f64)> {
        let some = lights.iter().skip(self.first).step_by(self.every);
        some.map(move |light| (light, light.irradiance * self.every as f64))
    }
}

/// The light on a surface.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SurfaceLight {
    /// Irradiance on the side that is seen.
    pub front: f64,
    /// Irradiance on the other side, of which a leaf lets some through.
    pub back: f64,
    /// What a glossy surface reflects of the sun toward the viewer.
    pub gloss: f64,
}

/// Sun and sky.
pub struct Lighting {
    sun: Vec<Light>,
    sky: Vec<Light>,
}

impl Lighting {
    /// The light of a sun in this direction, in which these triangles cast shadows.
    pub fn new(toward_sun: DVec3, casters: &[SpaceTriangle]) -> Self {
        let to_sun = DQuat::from_rotation_arc(DVec3::Z, toward_sun);
        let disc = spiral(SUN_DIVISION.lights)
            .map(|(part, angle)| to_sun * polar_direction(SUN_RADIUS * part.sqrt(), angle));
        // Equal solid angles.
        let dome = spiral(SKY_DIVISION.lights)
            .map(|(part, angle)| polar_direction((1.0 - part).acos(), angle));
        let lights = |directions: Vec<DVec3>, share: f64, division: &LightDivision| {
            let level: f64 = directions.iter().map(|it| it.z).sum();
            let directions = directions.into_par_iter();
            let light = |it| Light::new(it, share / level, casters, division.shadow_side);
            directions.map(light).collect()
        };
        Lighting {
            sun: lights(disc.collect(), SUN_SHARE, &SUN_DIVISION),
            sky: lights(dome.collect(), 1.0 - SUN_SHARE, &SKY_DIVISION),
        }
    }

    /// The light on a surface at a point, with the unit normal of the side that is seen.
    pub fn on_surface(
        &self,
        point: DVec3,
        normal: DVec3,
        toward_viewer: DVec3,
        subset: LightSubset,
    ) -> SurfaceLight {
        let mut found = SurfaceLight::default();
        let mut add = |light: &Light, irradiance: f64, is_sun: bool| {
            let cosine = light.toward.dot(normal);
            if !light.reaches_surface(point, normal) {
                return;
            }
            if cosine < 0.0 {
                found.back -= irradiance * cosine;
                return;
            }
            found.front += irradiance * cosine;
            if is_sun {
                let half = (light.toward + toward_viewer).normalize_or_zero();
                found.gloss += irradiance * half.dot(normal).max(0.0).powi(GLOSS_EXPONENT);
            }
        };
        for (light, irradiance) in subset.lights(&self.sun) {
            add(light, irradiance, true);
        }
        for (light, irradiance) in subset.lights(&self.sky) {
            add(light, irradiance, false);
        }
        // A surface that faces down sees the ground alone.
        found.front += GROUND_SHARE * 0.5 * (1.0 - normal.z);
        found.back += GROUND_SHARE * 0.5 * (1.0 + normal.z);
        found
    }

    /// Where the ground at this height may lie in a shadow of some triangle.
    pub fn ground_shadow(&self, casters: &[SpaceTriangle], height: f64) -> GroundShadow {
        // How far the shadow of a point is from below it, for each length that the point is high.
        let ways = self.sun.iter().map(|light| {
            let way = light.toward.truncate() / light.toward.z;
            [way, way]
        });
        let [least, most] = ways.fold(NOWHERE, united);
        let shadow = |corners: &SpaceTriangle| {
            let corner = |corner: &DVec3| {
                let ends = [least, most].map(|way| corner.truncate() - (corner.z - height) * way);
                [ends[0].min(ends[1]), ends[0].max(ends[1])]
            };
            corners.iter().map(corner).fold(NOWHERE, united)
        };
        GroundShadow::new(casters.iter().map(shadow).collect())
    }

    /// Irradiance of level ground from the sun.
    pub fn sun_on_ground(&self, point: DVec3, subset: LightSubset) -> f64 {
        irradiance_of_ground(&self.sun, point, subset)
    }

    /// Irradiance of level ground from the sky.
    pub fn sky_on_ground(&self, point: DVec3) -> f64 {
        irradiance_of_ground(&self.sky, point, LightSubset::ALL)
    }
}

/// The low and the high corner of a rectangle, and those of one that has no points.
type Rectangle = [DVec2; 2];

const NOWHERE: Rectangle = [DVec2::INFINITY, DVec2::NEG_INFINITY];

/// The rectangle around two others.
fn united(one: Rectangle, other: Rectangle) -> Rectangle {
    [one[0].min(other[0]), one[1].max(other[1])]
}

/// The ground that may lie in a shadow, in the light of any part of the sun, as cells of a grid. Elsewhere it has the
/// whole sun.
pub struct GroundShadow {
    corner: DVec2,
    cells_per_length: f64,
    columns: usize,
    is_shaded: Vec<bool>,
}

impl GroundShadow {
    /// The cells that these rectangles touch, and those within half a cell of them.
    fn new(shadows: Vec<Rectangle>) -> Self {
        let [low, high] = shadows.iter().copied().fold(NOWHERE, united);
        let size = (high - low).max(DVec2::ZERO);
        let cells_per_length = (GROUND_SHADOW_SIDE - 2) as f64 / size.max_element().max(1e-9);
        let mut found = GroundShadow {
            corner: low - DVec2::splat(1.0 / cells_per_length),
            cells_per_length,
            columns: GROUND_SHADOW_SIDE,
            is_shaded: vec![false; GROUND_SHADOW_SIDE * GROUND_SHADOW_SIDE],
        };
        for [low, high] in shadows {
            let ends = [low, high].map(|end| (end - found.corner) * cells_per_length);
            let first = (ends[0] - 0.5).max(DVec2::ZERO);
            let last = (ends[1] + 0.5).min(DVec2::splat((GROUND_SHADOW_SIDE - 1) as f64));
            for row in first.y as usize..=last.y as usize {
                let row = row * found.columns;
                found.is_shaded[row + first.x as usize..=row + last.x as usize].fill(true);
            }
        }
        found
    }

    pub fn may_shade(&self, point: DVec3) -> bool {
        let place = (point.truncate() - self.corner) * self.cells_per_length;
        let inside = place.cmpge(DVec2::ZERO).all() && place.max_element() < self.columns as f64;
        inside && self.is_shaded[place.y as usize * self.columns + place.x as usize]
    }
}

fn irradiance_of_ground(lights: &[Light], point: DVec3, subset: LightSubset) -> f64 {
    (subset.lights(lights))
        .filter(|(light, _)| light.reaches(point))
        .map(|(light, irradiance)| irradiance * light.toward.z)
        .sum()
}

/// Points of a disc by equal areas: the area within each as a fraction, and its angle (H. Vogel, Math. Biosci. 44,
/// 1979, 179).
fn spiral(count: usize) -> impl Iterator<Item = (f64, f64)> {
    let golden = TAU * (1.0 - 1.0 / 1.618_033_988_749_895);
    (0..count).map(move |k| {
        let number = k as f64 + 0.5;
        (number / count as f64, golden * number)
    })
}

/// The unit vector at this angle from z.
fn polar_direction(from_z: f64, azimuth: f64) -> DVec3 {
    let (sin, cos) = from_z.sin_cos();
    DVec3::new(sin * azimuth.cos(), sin * azimuth.sin(), cos)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A level disc of radius 1 at this height, as triangles.
    fn disc(height: f64) -> Vec<SpaceTriangle> {
        let rim = |k: usize| {
            let angle = TAU * k as f64 / 128.0;
            DVec3::new(angle.cos(), angle.sin(), height)
        };
        (0..128)
            .map(|k| [DVec3::new(0.0, 0.0, height), rim(k), rim(k + 1)])
            .collect()
    }

    #[test]
    fn open_ground_has_all_light() {
        let sun = DVec3::new(0.3, -0.2, 0.9).normalize();
        let light = Lighting::new(sun, &[]);
        let parts = [
            light.sun_on_ground(DVec3::ZERO, LightSubset::ALL),
            light.sky_on_ground(DVec3::ZERO),
        ];
        assert!((parts[0] - SUN_SHARE).abs() < 1e-12, "{parts:?}");
        assert!((parts[0] + parts[1] - 1.0).abs() < 1e-12, "{parts:?}");
        let level = light.on_surface(DVec3::ZERO, DVec3::Z, DVec3::Z, LightSubset::ALL);
        assert!((level.front - 1.0).abs() < 1e-12 && level.gloss > 0.0);
        // The nine parts of the lights are together all of them.
        let parts = (0..9)
            .map(|first| light.sun_on_ground(DVec3::ZERO, LightSubset { first, every: 9 }) / 9.0);
        assert!((parts.sum::<f64>() - SUN_SHARE).abs() < 1e-12);
    }

    /// Below the middle of a disc of radius a at the height h, the sky that is hidden has the share
    /// a^2/(a^2 + h^2) of the irradiance, and the sun is hidden where h tan(its radius) < a.
    #[test]
    fn a_disc_hides_as_much_sky_as_its_form_factor() {
        for height in [0.5, 1.0, 2.0] {
            let light = Lighting::new(DVec3::Z, &disc(height));
            let sky = light.sky_on_ground(DVec3::ZERO) / (1.0 - SUN_SHARE);
            let exact = 1.0 - 1.0 / (1.0 + height * height);
            assert!((sky - exact).abs() < 0.02, "{height}: {sky}, {exact}");
            assert_eq!(light.sun_on_ground(DVec3::ZERO, LightSubset::ALL), 0.0);
            let far = light.sun_on_ground(3.0 * DVec3::X, LightSubset::ALL);
            assert!((far - SUN_SHARE).abs() < 1e-12);
            // Half a sun below the rim, but for its curvature.
            let rim = light.sun_on_ground(DVec3::X, LightSubset::ALL) / SUN_SHARE;
            assert!((rim - 0.5).abs() < 0.1, "{height}: {rim}");
        }
    }

    #[test]
    fn beyond_its_shadow_the_ground_has_the_whole_sun() {
        let (height, sun) = (0.7, DVec3::new(0.5, -0.3, 1.2).normalize());
        let casters = disc(height);
        let light = Lighting::new(sun, &casters);
        let shadow = light.ground_shadow(&casters, 0.0);
        let (mut shaded, mut doubtful) = (0, 0);
        for k in 0..1600 {
            let at = DVec2::new(f64::from(k % 40), f64::from(k / 40)) * 0.15 - DVec2::splat(3.0);
            let lost = SUN_SHARE - light.sun_on_ground(at.extend(0.0), LightSubset::ALL);
            let inside = shadow.may_shade(at.extend(0.0));
            assert!(inside || lost.abs() < 1e-12, "{at}: {lost}");
            shaded += usize::from(lost > 1e-12);
            doubtful += usize::from(inside);
        }
        assert!(
            shaded > 100 && doubtful < shaded + shaded / 3,
            "{shaded} {doubtful}"
        );
    }

    /// A surface does not shade itself, however obliquely it is lit, and is lit from behind as well.
    #[test]
    fn a_sheet_alone_is_not_in_its_own_shadow() {
        for angle in [0.0, 0.5, 1.0, 1.4] {
            let tilt = DQuat::from_rotation_y(angle);
            let sheet: Vec<SpaceTriangle> = (disc(0.0).into_iter())
                .map(|corners| corners.map(|corner| tilt * corner))
                .collect();
            let open = Lighting::new(DVec3::Z, &[]);
            let light = Lighting::new(DVec3::Z, &sheet);
            for k in 0..50 {
                let at = tilt * (0.018 * f64::from(k) * DVec3::new(0.6, 0.8, 0.0));
                for normal in [tilt * DVec3::Z, tilt * -DVec3::Z] {
                    let seen =
                        |it: &Lighting| it.on_surface(at, normal, DVec3::Z, LightSubset::ALL);
                    let [alone, without] = [&light, &open].map(seen);
                    assert!((alone.front - without.front).abs() < 0.02, "{angle} {k}");
                    assert!((alone.back - without.back).abs() < 0.02, "{angle} {k}");
                }
            }
        }
    }
}
