//! The leaf as one sees it: its surface and its veins in the light of a sun and a sky, with its shadow on the ground
//! below it and a scale bar, for slides.
//!
//! The view is the oblique one of all figures and pages, with gravity down. It is a parallel projection: the scale
//! bar is as long as what lies across the view. Lengths are those of the longest vein.

mod light;
mod raster;

use crate::figure::drawing::axes::round_step;
use crate::figure::drawing::formats::{PIXELS_PER_UNIT, paint_over, write_pixels};
use crate::figure::drawing::space::{ParallelProjection, ViewAngles};
use crate::figure::drawing::veins::is_vein_drawn;
use crate::figure::drawing::{Drawing, Stroke, TEXT_COLOR, TextAnchor, is_drawable};
use crate::figure::scenario::FigureSetting;
use crate::figure::shaded::light::{
    GroundShadow, LightSubset, Lighting, SUN_SHARE, SpaceTriangle, SurfaceLight,
};
use crate::figure::shaded::raster::{CornerWeights, NearestTriangles, ProjectedTriangle};
use crate::report::numbers::format_four_digits;
use glam::{DQuat, DVec2, DVec3};
use leafdyn::relax::{Equilibrium, Shape};
use leafdyn::scenario::Scenario;
use leafdyn::shape::{InterpolationWeights, NodeState, RodShape, interpolation_weights};
use leafdyn::surface::TriangleMesh;
use rayon::prelude::*;
use std::io;
use std::io::Write;
use std::ops::Range;
use tiny_skia::{IntSize, Pixmap};

/// What a surface throws back of the light on the side that is seen, and lets through of that on the other: red, green
/// and blue of linear light, from 0 to 1, as all colors here.
struct Material {
    reflected: DVec3,
    transmitted: DVec3,
    gloss: f64,
}

/// The side of d3 of a leaf is darker and shinier than the other, and light through a leaf is yellow-green.
const UPPER_SIDE: Material = Material {
    reflected: DVec3::new(0.13, 0.30, 0.045),
    transmitted: DVec3::new(0.16, 0.26, 0.02),
    gloss: 0.10,
};

const LOWER_SIDE: Material = Material {
    reflected: DVec3::new(0.28, 0.43, 0.17),
    transmitted: DVec3::new(0.16, 0.26, 0.02),
    gloss: 0.03,
};

const VEIN: Material = Material {
    reflected: DVec3::new(0.36, 0.50, 0.16),
    transmitted: DVec3::ZERO,
    gloss: 0.05,
};

/// The ground in full light, and where it has faded into the background.
const GROUND: DVec3 = DVec3::new(0.86, 0.86, 0.84);
const BACKGROUND: DVec3 = DVec3::ONE;

/// Parts of the way from the middle of the picture to its edges over which the ground fades into the background, and
/// over which shadows do.
const GROUND_FADE: Range<f64> = 0.5..0.98;
const SHADOW_FADE: Range<f64> = 0.92..1.0;

/// How far the ground is below a leaf whose lowest point is not a base, in parts of its extent.
const GROUND_BELOW_LEAF: f64 = 0.05;

/// Fractions along a vein below this are its base.
const BASE_END: f64 = 1e-9;

/// The radius of a vein is at most this part of the distance to its neighbors: towards a joint tip veins become thin.
const VEIN_RADIUS_IN_SPACINGS: f64 = 0.11;

/// Least number of segments of which veins are drawn.
const DRAWN_SEGMENTS: usize = 120;

/// Points of a side of the grid on which the light of the sky on the ground is known, half of its side in extents of
/// the leaf, and how often it is smoothed.
const GROUND_GRID_SIDE: usize = 140;
const GROUND_GRID_RADIUS: f64 = 1.3;
const GROUND_GRID_SMOOTHINGS: usize = 3;

/// Samples of a pixel, across and down.
const PIXEL_SAMPLES: usize = 3;

/// Rows of pixels that are painted at a time.
const BAND_ROWS: usize = 24;

/// Sizes of a picture, in pixels.
struct PictureLayout {
    width: usize,
    /// Least and largest height, in widths.
    heights: Range<f64>,
    /// Around the leaf and its shadow.
    margin: f64,
    /// Below them, for the scale bar.
    scale_bar: f64,
}

const PICTURE: PictureLayout = PictureLayout {
    width: 1600,
    heights: 0.45..1.0,
    margin: 70.0,
    scale_bar: 70.0,
};

/// The scale bar is at most this part of the width of the picture.
const LONGEST_SCALE_BAR: f64 = 0.22;

/// What is seen: triangles with their normals, in lengths, turned so that gravity is down.
struct Scene {
    triangles: Vec<SceneTriangle>,
    /// Triangles of which the shadows are seen: those of the blade, or of the veins without one.
    casters: Vec<SpaceTriangle>,
    /// Whether the lowest point is a base.
    stands: bool,
}

struct SceneTriangle {
    corners: SpaceTriangle,
    normals: [DVec3; 3],
    is_vein: bool,
}

impl Scene {
    fn new(shape: &Shape, scenario: &Scenario, upright: DQuat) -> Self {
        let shape = &finely_divided(shape);
        let blade = TriangleMesh::sheet(shape, scenario).unwrap_or_default();
        let veins = thinned_veins(TriangleMesh::vein_tubes(shape, scenario), shape);
        let count = shape.rods.len();
        let to_scene = |point: DVec3| upright * point / shape.longest();
        let triangles = |mesh: &TriangleMesh, is_vein: bool| -> Vec<SceneTriangle> {
            let drawn = mesh.triangles.iter().filter(|corners| {
                let vein = mesh.veins[corners[0] as usize] as usize - 1;
                !is_vein || is_vein_drawn(vein, count)
            });
            let triangle = drawn.map(|corners| SceneTriangle {
                corners: corners.map(|k| to_scene(mesh.vertices[k as usize])),
                normals: corners.map(|k| upright * mesh.normals[k as usize]),
                is_vein,
            });
            triangle
                .filter(|it| it.corners.iter().all(|&corner| is_drawable(corner)))
                .collect()
        };
        let [mut blade_triangles, vein_triangles] =
            [triangles(&blade, false), triangles(&veins, true)];
        let casting = match blade_triangles.is_empty() {
            true => &vein_triangles,
            false => &blade_triangles,
        };
        let casters = casting.iter().map(|it| it.corners).collect();
        let heights = |mesh: &TriangleMesh, bases: bool| -> f64 {
            let vertices = mesh.vertices.iter().zip(&mesh.uv);
            (vertices.filter(|(_, uv)| !bases || uv[0] < BASE_END))
                .map(|(vertex, _)| to_scene(*vertex).z)
                .fold(f64::INFINITY, f64::min)
        };
        let stands = heights(&veins, true) <= heights(&veins, false).min(heights(&blade, false));
        blade_triangles.extend(vein_triangles);
        Scene {
            triangles: blade_triangles,
            casters,
            stands,
        }
    }

    fn points(&self) -> impl Iterator<Item = DVec3> {
        self.triangles.iter().flat_map(|it| it.corners)
    }

    /// The corners of a box around it.
    fn bounds(&self) -> [DVec3; 2] {
        bounds_of(self.points()).unwrap_or_default()
    }

    fn extent(&self) -> f64 {
        let [low, high] = self.bounds();
        (high - low).max_element().max(1e-9)
    }

    /// How high the ground is.
    fn ground(&self) -> f64 {
        let gap = if self.stands { 0.0 } else { GROUND_BELOW_LEAF };
        self.bounds()[0].z - gap * self.extent()
    }
}

/// A shape at so many stations that its outline is smooth: between those at which it is known by cubic polynomials.
fn finely_divided(shape: &Shape) -> Shape {
    let known = &shape.stations;
    let parts = DRAWN_SEGMENTS.div_ceil(known.len().saturating_sub(1).max(1));
    let stations: Vec<f64> = (known.windows(2))
        .flat_map(|ends| {
            let part = (ends[1] - ends[0]) / parts as f64;
            (0..parts).map(move |k| ends[0] + part * k as f64)
        })
        .chain(known.last().copied())
        .collect();
    let weights: Vec<InterpolationWeights> = (stations.iter())
        .map(|&station| interpolation_weights(known, station, 4))
        .collect();
    let rods = shape.rods.iter().map(|rod| RodShape {
        length: rod.length,
        nodes: (weights.iter().filter(|_| rod.nodes.len() == known.len()))
            .map(|weights| interpolated(rod, weights))
            .collect(),
    });
    Shape {
        rods: rods.collect(),
        stations,
        ..shape.clone()
    }
}

/// A node between those of a rod: its place and its directors.
fn interpolated(rod: &RodShape, weights: &InterpolationWeights) -> NodeState {
    NodeState {
        position: weights.weighted_sum(&rod.nodes, |node| node.position),
        rotation: weights.rotation(&rod.nodes),
        ..rod.nodes[weights.first]
    }
}

/// Tubes around the veins of a shape, thinner where veins are near to each other.
fn thinned_veins(mut tubes: TriangleMesh, shape: &Shape) -> TriangleMesh {
    let rods = &shape.rods;
    let spacing = |vein: usize, station: usize| -> f64 {
        let place = |vein: usize| rods[vein].nodes[station].position;
        let beside = [
            vein.checked_sub(1),
            Some(vein + 1).filter(|&it| it < rods.len()),
        ];
        let distances = beside
            .into_iter()
            .flatten()
            .map(|it| place(vein).distance(place(it)));
        distances.fold(f64::INFINITY, f64::min)
    };
    for (k, vertex) in tubes.vertices.iter_mut().enumerate() {
        let (vein, sigma) = (tubes.veins[k] as usize - 1, tubes.uv[k][0]);
        let station = shape.stations.partition_point(|&it| it < sigma);
        let middle = rods[vein].nodes[station].position;
        let radius = vertex.distance(middle);
        let most = VEIN_RADIUS_IN_SPACINGS * spacing(vein, station);
        if radius > most {
            *vertex = middle + most / radius * (*vertex - middle);
        }
    }
    tubes
}

fn bounds_of(points: impl Iterator<Item = DVec3>) -> Option<[DVec3; 2]> {
    points.fold(None, |bounds, it| {
        let [low, high] = bounds.unwrap_or([it; 2]);
        Some([low.min(it), high.max(it)])
    })
}

/// The rotation that takes the direction of gravity down; without gravity z is up.
fn rotation_to_upright(gravity: Option<DVec3>) -> DQuat {
    match gravity {
        // All rotations by half a turn do: this one keeps x.
        Some(down) if down.distance(DVec3::Z) < 1e-9 => {
            DQuat::from_rotation_x(std::f64::consts::PI)
        }
        Some(down) => DQuat::from_rotation_arc(down, DVec3::NEG_Z),
        None => DQuat::IDENTITY,
    }
}

/// From space to the samples of a picture.
struct Camera {
    view: ParallelProjection,
    samples_per_length: f64,
    /// Where the origin of space is, in samples.
    origin: DVec2,
    /// Size of the picture, in samples.
    samples: [usize; 2],
}

impl Camera {
    /// The camera of a picture that shows these points, in the oblique view.
    fn showing(view: ViewAngles, points: impl Iterator<Item = DVec3>) -> Self {
        let view = ParallelProjection::from_view(view);
        let on_page = points.map(|point| view.project_point(point).extend(0.0));
        let [low, high] = bounds_of(on_page).unwrap_or_default().map(DVec3::truncate);
        let shown = (high - low).max(DVec2::splat(1e-9));
        let width = PICTURE.width as f64;
        let around = DVec2::new(
            2.0 * PICTURE.margin,
            2.0 * PICTURE.margin + PICTURE.scale_bar,
        );
        let inner_width = width - around.x;
        let wanted = inner_width * shown.y / shown.x + around.y;
        let heights = PICTURE.heights;
        let height = wanted
            .clamp(heights.start * width, heights.end * width)
            .round();
        let inner = DVec2::new(inner_width, height - around.y);
        let scale = (inner / shown).min_element() * PIXEL_SAMPLES as f64;
        let middle = PIXEL_SAMPLES as f64 * (DVec2::splat(PICTURE.margin) + 0.5 * inner);
        Camera {
            samples_per_length: scale,
            origin: middle - scale * 0.5 * (low + high),
            view,
            samples: [PICTURE.width, height as usize].map(|pixels| pixels * PIXEL_SAMPLES),
        }
    }

    /// A point in samples, with its depth toward the viewer in lengths.
    fn in_samples(&self, point: DVec3) -> DVec3 {
        let on_page = self.origin + self.samples_per_length * self.view.project_point(point);
        on_page.extend(self.view.toward.dot(point))
    }

    fn project(&self, corners: &SpaceTriangle) -> ProjectedTriangle {
        ProjectedTriangle {
            corners: corners.map(|corner| self.in_samples(corner)),
        }
    }

    /// Where the ground at this height is seen at the middle of a sample.
    fn on_ground(&self, column: usize, row: usize, height: f64) -> DVec3 {
        let sample = DVec2::new(column as f64 + 0.5, row as f64 + 0.5);
        let at = (sample - self.origin) / self.samples_per_length;
        let in_plane = at.x * self.view.right - at.y * self.view.up;
        in_plane + (height - in_plane.z) / self.view.toward.z * self.view.toward
    }
}

/// The light of the sky on the ground around a leaf, on a grid.
struct SkyOnGround {
    corner: DVec2,
    spacing: f64,
    irradiance: Vec<f64>,
}

impl SkyOnGround {
    fn new(lighting: &Lighting, middle: DVec3, radius: f64) -> Self {
        let corner = middle.truncate() - DVec2::splat(radius);
        let spacing = 2.0 * radius / (GROUND_GRID_SIDE - 1) as f64;
        let irradiance = (0..GROUND_GRID_SIDE * GROUND_GRID_SIDE)
            .into_par_iter()
            .map(|k| {
                let place =
                    DVec2::new((k % GROUND_GRID_SIDE) as f64, (k / GROUND_GRID_SIDE) as f64);
                lighting.sky_on_ground((corner + spacing * place).extend(middle.z))
            });
        let mut sky = SkyOnGround {
            corner,
            spacing,
            irradiance: irradiance.collect(),
        };
        // Lights of the sky are few, and the edges of their shadows would be seen.
        for _ in 0..GROUND_GRID_SMOOTHINGS {
            sky.smooth(1);
            sky.smooth(GROUND_GRID_SIDE);
        }
        sky
    }

    /// Replaces every value inside the grid by its mean with the two beside it, at this distance in the list,
    /// weighted 1, 2, 1.
    fn smooth(&mut self, beside: usize) {
        let before = self.irradiance.clone();
        let place = |k: usize| (k / beside) % GROUND_GRID_SIDE;
        for k in (0..before.len()).filter(|&k| (1..GROUND_GRID_SIDE - 1).contains(&place(k))) {
            let sides = before[k - beside] + before[k + beside];
            self.irradiance[k] = 0.25 * sides + 0.5 * before[k];
        }
    }

    /// Bilinear between the points of the grid.
    fn at(&self, point: DVec3) -> f64 {
        let last = (GROUND_GRID_SIDE - 1) as f64;
        let place = (point.truncate() - self.corner) / self.spacing;
        let place = place.clamp(DVec2::ZERO, DVec2::splat(last * (1.0 - 1e-12)));
        let (cell, part) = (place.floor(), place.fract());
        let value = |dx: usize, dy: usize| {
            self.irradiance[(cell.y as usize + dy) * GROUND_GRID_SIDE + cell.x as usize + dx]
        };
        let row = |dy: usize| value(0, dy) + part.x * (value(1, dy) - value(0, dy));
        row(0) + part.y * (row(1) - row(0))
    }
}

/// A scene, lit and seen.
struct Picture<'s> {
    scene: &'s Scene,
    camera: Camera,
    lighting: Lighting,
    projected: Vec<ProjectedTriangle>,
    /// The middle of the ground that is seen.
    ground: DVec3,
    /// The ground that may be shaded from the sun.
    ground_shadow: GroundShadow,
    sky_on_ground: SkyOnGround,
    srgb: SrgbEncoding,
}

impl<'s> Picture<'s> {
    fn new(scene: &'s Scene, view: ViewAngles) -> Self {
        let toward_sun = sun_direction(view);
        let height = scene.ground();
        let shadow = |point: DVec3| point - (point.z - height) / toward_sun.z * toward_sun;
        let shown = scene.points().chain(scene.points().map(shadow));
        let camera = Camera::showing(view, shown);
        let lighting = Lighting::new(toward_sun, &scene.casters);
        let [low, high] = scene.bounds();
        let ground = (0.5 * (low + high)).truncate().extend(height);
        let radius = GROUND_GRID_RADIUS * scene.extent();
        Picture {
            projected: (scene.triangles.iter())
                .map(|it| camera.project(&it.corners))
                .collect(),
            ground_shadow: lighting.ground_shadow(&scene.casters, height),
            sky_on_ground: SkyOnGround::new(&lighting, ground, radius),
            srgb: SrgbEncoding::new(),
            scene,
            camera,
            lighting,
            ground,
        }
    }

    /// The color of the ground at a sample, in the light of some of the sun where it may be shaded.
    fn ground_color(&self, [column, row]: [usize; 2], subset: LightSubset) -> DVec3 {
        let point = self.camera.on_ground(column, row, self.ground.z);
        let size = self.camera.samples.map(|samples| samples as f64);
        let from_middle = |at: usize, size: f64| ((2 * at + 1) as f64 / size - 1.0).powi(4);
        let away = (from_middle(column, size[0]) + from_middle(row, size[1]))
            .sqrt()
            .sqrt();
        let sun = match self.ground_shadow.may_shade(point) {
            true => self.lighting.sun_on_ground(point, subset),
            false => SUN_SHARE,
        };
        let light = sun + self.sky_on_ground.at(point);
        let surface = BACKGROUND.lerp(GROUND, remaining(&GROUND_FADE, away));
        surface * (1.0 + (light - 1.0) * remaining(&SHADOW_FADE, away))
    }

    /// Whether the ground at a sample may be shaded from the sun.
    fn may_be_shaded(&self, [column, row]: [usize; 2]) -> bool {
        let point = self.camera.on_ground(column, row, self.ground.z);
        self.ground_shadow.may_shade(point)
    }

    /// The color of a triangle at a sample that it covers.
    fn surface_color(&self, number: usize, weights: CornerWeights, subset: LightSubset) -> DVec3 {
        let triangle = &self.scene.triangles[number];
        let weighted = |values: &[DVec3; 3]| -> DVec3 {
            let pairs = weights.0.iter().zip(values);
            pairs.map(|(weight, value)| *weight * *value).sum()
        };
        let toward_viewer = self.camera.view.toward;
        let is_upper = self.projected[number].faces_viewer();
        let outward = weighted(&triangle.normals).normalize_or(toward_viewer);
        let normal = if is_upper { outward } else { -outward };
        let place = weighted(&triangle.corners);
        let SurfaceLight { front, back, gloss } =
            self.lighting
                .on_surface(place, normal, toward_viewer, subset);
        let material = match (triangle.is_vein, is_upper) {
            (true, _) => &VEIN,
            (false, true) => &UPPER_SIDE,
            (false, false) => &LOWER_SIDE,
        };
        front * material.reflected
            + back * material.transmitted
            + DVec3::splat(gloss * material.gloss)
    }

    /// The pixels of these rows, four bytes each.
    fn paint_rows(&self, rows: Range<usize>) -> Vec<u8> {
        let width = self.camera.samples[0];
        let sample_rows = rows.start * PIXEL_SAMPLES..rows.end * PIXEL_SAMPLES;
        let nearest = NearestTriangles::render(&self.projected, width, sample_rows);
        let mut bytes = Vec::with_capacity(4 * rows.len() * PICTURE.width);
        for row in rows {
            for column in 0..PICTURE.width {
                let middle = [column, row].map(|at| at * PIXEL_SAMPLES + PIXEL_SAMPLES / 2);
                if nearest.is_free(middle, PIXEL_SAMPLES / 2) && !self.may_be_shaded(middle) {
                    // Open ground changes little within a pixel.
                    let color = self.ground_color(middle, LightSubset::ALL);
                    bytes.extend(color.to_array().map(|light| self.srgb.encode(light)));
                    bytes.push(u8::MAX);
                    continue;
                }
                let mut sum = DVec3::ZERO;
                for sample in 0..PIXEL_SAMPLES * PIXEL_SAMPLES {
                    let x = column * PIXEL_SAMPLES + sample % PIXEL_SAMPLES;
                    let y = row * PIXEL_SAMPLES + sample / PIXEL_SAMPLES;
                    // Every sample of a pixel has its part of the lights.
                    let subset = LightSubset {
                        first: sample,
                        every: PIXEL_SAMPLES * PIXEL_SAMPLES,
                    };
                    // A highlight brighter than white must not spread over the edge of the leaf.
                    sum += match nearest.triangle(x, y) {
                        Some(number) => {
                            let weights = self.projected[number].corner_weights(x, y);
                            self.surface_color(number, weights, subset).min(DVec3::ONE)
                        }
                        None => self.ground_color([x, y], subset),
                    };
                }
                let color = sum / (PIXEL_SAMPLES * PIXEL_SAMPLES) as f64;
                bytes.extend(color.to_array().map(|light| self.srgb.encode(light)));
                bytes.push(u8::MAX);
            }
        }
        bytes
    }

    /// All pixels, without the scale bar.
    fn paint(&self) -> Option<Pixmap> {
        let height = self.camera.samples[1] / PIXEL_SAMPLES;
        let bands: Vec<usize> = (0..height).step_by(BAND_ROWS).collect();
        let painted: Vec<Vec<u8>> = (bands.into_par_iter())
            .map(|from| self.paint_rows(from..(from + BAND_ROWS).min(height)))
            .collect();
        let size = IntSize::from_wh(PICTURE.width as u32, height as u32)?;
        Pixmap::from_vec(painted.concat(), size)
    }

    /// The scale bar in a corner.
    fn scale_bar(&self, setting: &FigureSetting) -> Drawing {
        let pixels_per_length = self.camera.samples_per_length / PIXEL_SAMPLES as f64;
        let ScaleBar { value, pixels } = ScaleBar::new(pixels_per_length, setting);
        let [width, height] = self
            .camera
            .samples
            .map(|samples| samples as f64 / PIXEL_SAMPLES as f64 / PIXELS_PER_UNIT);
        let mut page = Drawing::new(width, "scale bar");
        page.height = height;
        let margin = 0.5 * PICTURE.margin / PIXELS_PER_UNIT;
        let from = DVec2::new(margin, height - margin);
        let to = from + DVec2::new(pixels / PIXELS_PER_UNIT, 0.0);
        let stroke = Stroke::new(TEXT_COLOR, 2.0);
        page.draw_line(from, to, stroke);
        let cap = DVec2::new(0.0, 4.0);
        for end in [from, to] {
            page.draw_line(end - cap, end + cap, stroke);
        }
        let text = format!("{} {}", format_four_digits(value), setting.length_unit());
        let above = 0.5 * (from + to) - DVec2::new(0.0, 9.0);
        page.draw_label(above, &text, 15.0, TextAnchor::Middle, TEXT_COLOR);
        page
    }
}

/// What remains at a place of what fades over a range: all before it, nothing behind it.
fn remaining(range: &Range<f64>, at: f64) -> f64 {
    let part = ((range.end - at) / (range.end - range.start)).clamp(0.0, 1.0);
    part * part * (3.0 - 2.0 * part)
}

/// A round length, and how long it is in a picture.
struct ScaleBar {
    /// In the unit that is shown.
    value: f64,
    pixels: f64,
}

impl ScaleBar {
    fn new(pixels_per_length: f64, setting: &FigureSetting) -> Self {
        let pixels_per_unit = pixels_per_length / setting.value_per_length();
        let longest = LONGEST_SCALE_BAR * PICTURE.width as f64 / pixels_per_unit;
        // The largest of 1, 2 or 5 times a power of ten that is not longer is at least 0.4 of it.
        let value = [1.0, 0.5, 0.4].map(|part| round_step(part * longest));
        let value = value
            .into_iter()
            .find(|it| *it <= longest * (1.0 + 1e-9))
            .unwrap_or(longest);
        ScaleBar {
            value,
            pixels: value * pixels_per_unit,
        }
    }
}

/// The sun is behind the shoulder of the viewer, on the left and high.
fn sun_direction(view: ViewAngles) -> DVec3 {
    let toward = view.toward_viewer();
    let level = DVec3::new(toward.x, toward.y, 0.0).normalize();
    let left = DVec3::Z.cross(level) * -1.0;
    (1.25 * DVec3::Z + 0.25 * level + 0.55 * left).normalize()
}

/// Linear light as a byte (IEC 61966-2-1).
struct SrgbEncoding {
    /// The least light of every byte from 1 on.
    least: [f64; 255],
}

impl SrgbEncoding {
    fn new() -> Self {
        let light = |value: f64| match value {
            value if value <= 0.040_45 => value / 12.92,
            value => ((value + 0.055) / 1.055).powf(2.4),
        };
        SrgbEncoding {
            least: std::array::from_fn(|byte| light((byte as f64 + 0.5) / 255.0)),
        }
    }

    fn encode(&self, light: f64) -> u8 {
        self.least.partition_point(|least| *least <= light) as u8
    }
}

/// Writes the picture of a leaf at rest as PNG.
pub fn write_surface_picture(
    equilibrium: &Equilibrium,
    scenario: &Scenario,
    out: &mut dyn Write,
) -> io::Result<()> {
    let setting = FigureSetting::from_scenario(scenario);
    let upright = rotation_to_upright(setting.gravity());
    let scene = Scene::new(&equilibrium.shape, scenario, upright);
    let view = ViewAngles::oblique([upright * tip_from_base(&equilibrium.shape)]);
    let picture = Picture::new(&scene, view);
    let Some(mut pixels) = picture.paint() else {
        return Err(io::Error::other("the picture has no pixels"));
    };
    paint_over(&mut pixels, &picture.scale_bar(&setting));
    write_pixels(&pixels, out)
}

/// From the mean of the bases to that of the tips, in lengths.
fn tip_from_base(shape: &Shape) -> DVec3 {
    let ends = shape
        .rods
        .iter()
        .filter_map(|rod| Some([rod.nodes.first()?, rod.nodes.last()?]));
    let ways = ends.map(|[base, tip]| (tip.position - base.position) / shape.longest());
    let ways: Vec<DVec3> = ways.filter(|way| is_drawable(*way)).collect();
    ways.iter().sum::<DVec3>() / ways.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;

    fn scenario(load: DVec3) -> Scenario {
        let mut scenario = sample::sample_scenario("fan", 5);
        scenario.gravity = load.to_array();
        scenario
    }

    /// The leaf of the samples under a load in this direction, turned with it.
    fn turned_leaf(turn: DQuat) -> Equilibrium {
        let mut leaf = sample::sample_equilibrium(5, 16);
        for node in leaf.shape.rods.iter_mut().flat_map(|rod| &mut rod.nodes) {
            node.position = turn * node.position;
            node.rotation = turn * node.rotation;
        }
        leaf
    }

    fn picture_bytes(leaf: &Equilibrium, scenario: &Scenario) -> Vec<u8> {
        let mut bytes = Vec::new();
        write_surface_picture(leaf, scenario, &mut bytes).unwrap();
        bytes
    }

    #[test]
    fn gravity_is_down_whatever_its_direction() {
        let half = std::f64::consts::FRAC_PI_2;
        for turn in [
            DQuat::IDENTITY,
            DQuat::from_rotation_x(half),
            DQuat::from_rotation_y(-half),
            DQuat::from_rotation_x(2.0 * half),
            DQuat::from_scaled_axis(DVec3::new(0.4, -1.1, 0.3)),
        ] {
            let leaf = turned_leaf(turn);
            let setting = FigureSetting::from_scenario(&scenario(turn * DVec3::NEG_Z));
            let upright = rotation_to_upright(setting.gravity());
            let down = upright * turn * DVec3::NEG_Z;
            assert!(down.distance(DVec3::NEG_Z) < 1e-9, "{turn}: {down}");
            let way = upright * tip_from_base(&leaf.shape);
            assert!(way.z < -0.05, "the leaf of the samples hangs: {way}");
            let camera =
                Camera::showing(ViewAngles::oblique([way]), [DVec3::ZERO, way].into_iter());
            let [base, tip] = [DVec3::ZERO, way].map(|point| camera.in_samples(point));
            assert!(tip.y > base.y + 0.05 * camera.samples_per_length * way.z.abs());
        }
        assert_eq!(rotation_to_upright(None), DQuat::IDENTITY);
    }

    /// A leaf that does not fold covers as much of the picture as the sum of its projected triangles.
    #[test]
    fn the_silhouette_has_the_projected_area() {
        let leaf = turned_leaf(DQuat::IDENTITY);
        let scenario = scenario(DVec3::NEG_Z);
        let scene = Scene::new(&leaf.shape, &scenario, DQuat::IDENTITY);
        let view = ViewAngles::oblique([tip_from_base(&leaf.shape)]);
        let camera = Camera::showing(view, scene.points());
        let blade = scene.triangles.iter().filter(|it| !it.is_vein);
        let projected: Vec<ProjectedTriangle> = blade
            .clone()
            .map(|it| camera.project(&it.corners))
            .collect();
        let facing = projected.iter().filter(|it| it.faces_viewer()).count();
        assert!(facing == projected.len() || facing == 0, "it folds");
        let [width, height] = camera.samples;
        let nearest = NearestTriangles::render(&projected, width, 0..height);
        let samples = (0..height).flat_map(|row| (0..width).map(move |column| [column, row]));
        let covered = samples
            .filter(|&[x, y]| nearest.triangle(x, y).is_some())
            .count();
        let area: f64 = blade
            .map(|it| {
                let [a, b, c] = it.corners;
                0.5 * (b - a).cross(c - a).dot(view.toward_viewer()).abs()
            })
            .sum();
        let seen = covered as f64 / camera.samples_per_length.powi(2);
        assert!((seen / area - 1.0).abs() < 1e-3, "{seen}, {area}");
        assert!(covered > width * height / 20);
    }

    /// The scale bar is as long as what lies across the view, and round.
    #[test]
    fn the_scale_bar_is_to_scale() {
        let mut scenario = scenario(DVec3::NEG_Z);
        for unit in [None, Some("cm")] {
            scenario.units.length = unit.map(Into::into);
            let setting = FigureSetting::from_scenario(&scenario);
            for per_length in [0.3, 7.0, 812.0, 9e4] {
                let ScaleBar { value, pixels } = ScaleBar::new(per_length, &setting);
                let part = pixels / PICTURE.width as f64;
                assert!(part <= LONGEST_SCALE_BAR + 1e-9 && part > 0.39 * LONGEST_SCALE_BAR);
                assert!((value * per_length / setting.value_per_length() - pixels).abs() < 1e-9);
                assert_eq!(value, round_step(value), "{value} is not round");
            }
        }
        let leaf = turned_leaf(DQuat::IDENTITY);
        let scene = Scene::new(&leaf.shape, &scenario, DQuat::IDENTITY);
        let camera = Camera::showing(ViewAngles::oblique([DVec3::X]), scene.points());
        let across = camera.view.right;
        let seen = camera.in_samples(across) - camera.in_samples(DVec3::ZERO);
        assert!((seen.x - camera.samples_per_length).abs() < 1e-9 && seen.y.abs() < 1e-9);
    }

    /// The leaf, its veins, the ground and a shadow are seen; the picture is the same however many threads paint it.
    #[test]
    fn a_picture_shows_the_leaf_and_its_shadow_and_is_repeated() {
        let (leaf, scenario) = (turned_leaf(DQuat::IDENTITY), scenario(DVec3::NEG_Z));
        let scene = Scene::new(&leaf.shape, &scenario, DQuat::IDENTITY);
        let view = ViewAngles::oblique([tip_from_base(&leaf.shape)]);
        let picture = Picture::new(&scene, view);
        let pixels = picture.paint().unwrap();
        let count = |what: &dyn Fn([i32; 3]) -> bool| {
            let colors = pixels.data().chunks_exact(4);
            let colors = colors.map(|it| [it[0], it[1], it[2]].map(i32::from));
            colors.filter(|color| what(*color)).count() as f64 / (pixels.data().len() / 4) as f64
        };
        let green = count(&|[red, green, blue]| green > red + 12 && green > blue + 40);
        let shadow = count(&|[red, green, _]| (red - green).abs() < 6 && red < 205);
        let bright = count(&|[red, _, blue]| red > 230 && blue > 225);
        assert!(
            green > 0.03 && shadow > 0.02 && bright > 0.3,
            "{green} {shadow} {bright}"
        );
        assert!(green + shadow + bright > 0.8, "{green} {shadow} {bright}");
        let corner = &pixels.data()[..3];
        assert!(corner.iter().all(|&byte| byte > 250), "{corner:?}");
        let alone = rayon::ThreadPoolBuilder::new()
            .num_threads(1)
            .build()
            .unwrap();
        let again = alone.install(|| Picture::new(&scene, view).paint().unwrap());
        assert_eq!(again.data(), pixels.data());
    }

    #[test]
    fn what_cannot_be_drawn_is_left_out() {
        let scenario = scenario(DVec3::NEG_Z);
        let mut leaf = turned_leaf(DQuat::IDENTITY);
        for value in [f64::NAN, f64::INFINITY, 1e300] {
            leaf.shape.rods[1].nodes[3].position.z = value;
            assert!(picture_bytes(&leaf, &scenario).starts_with(b"\x89PNG"));
        }
        leaf.shape.rods.clear();
        assert!(picture_bytes(&leaf, &scenario).starts_with(b"\x89PNG"));
    }

    #[test]
    fn colors_are_encoded_as_the_standard_has_it() {
        let known = [
            (0.0, 0),
            (0.0031308, 10),
            (0.2140, 127),
            (1.0, 255),
            (7.0, 255),
        ];
        let srgb = SrgbEncoding::new();
        for (light, byte) in known {
            assert!(srgb.encode(light).abs_diff(byte) <= 1, "{light}");
        }
    }
}
