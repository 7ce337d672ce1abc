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
const GLOSS_EXPONENT: f64 = 24.0;

/// A distant light, and the shadow of the leaf in it.
struct Light {
    /// Unit vector toward the light.
    toward: DVec3,
    /// Irradiance of a surface that faces it.
    irradiance: f64,
    /// From space into the frame of the light, in which it is along z.
    to_frame: DQuat,
    /// The corner of the shadow map in this frame.
    corner: DVec2,
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
        let mut light = Light {
            toward,
            irradiance,
            to_frame,
            corner,
            samples_per_length: side as f64 / extent,
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
        let it = self.to_frame * point;
        let on_map = self.samples_per_length * (it.truncate() - self.corner);
        on_map.extend(it.z)
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
                found.gloss += irradiance * half.dot(normal).max(0.0).powf(GLOSS_EXPONENT);
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

    /// The low and the high corner of the ground at this height that lies in a shadow of some triangle, in the light of
    /// any part of the sun; elsewhere it has the whole sun.
    pub fn sun_shadow_bounds(&self, casters: &[SpaceTriangle], height: f64) -> [DVec2; 2] {
        let none = [DVec2::INFINITY, DVec2::NEG_INFINITY];
        let corners = casters.iter().flatten();
        corners.fold(none, |[low, high], corner| {
            let each = self.sun.iter().map(|light| {
                let way = (corner.z - height) / light.toward.z;
                (*corner - way * light.toward).truncate()
            });
            each.fold([low, high], |[low, high], it| [low.min(it), high.max(it)])
        })
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
    fn beyond_the_bounds_of_its_shadow_the_ground_has_the_whole_sun() {
        let (height, sun) = (0.7, DVec3::new(0.5, -0.3, 1.2).normalize());
        let casters = disc(height);
        let light = Lighting::new(sun, &casters);
        let [low, high] = light.sun_shadow_bounds(&casters, 0.0);
        let mut shaded = 0;
        for k in 0..1600 {
            let at = DVec2::new(f64::from(k % 40), f64::from(k / 40)) * 0.15 - DVec2::splat(3.0);
            let lost = SUN_SHARE - light.sun_on_ground(at.extend(0.0), LightSubset::ALL);
            let inside = at.cmpge(low).all() && at.cmple(high).all();
            assert!(inside || lost.abs() < 1e-12, "{at}: {lost}");
            shaded += usize::from(lost > 1e-12);
        }
        assert!(shaded > 100);
        assert!((high - low).max_element() < 2.0 + 6.0 * height * SUN_RADIUS);
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
