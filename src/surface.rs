//! The surface of a leaf as triangles in space, its area, and how it is inclined: what ray tracers and
//! models of canopies take.
//!
//! A leaf with veins is a sheet through them, out to its margins: beyond the outermost veins it goes on along
//! their d2, by the half of their section, or in a [`Blade`] out to its outline. Across it is straight
//! between neighboring veins; along it has the stations at which the leaf is known. Its upper side is
//! that of d3.

use crate::relax::Shape;
use crate::rotation::Pose;
use crate::scenario::{Blade, Scenario};
use crate::shape::RodShape;
use glam::DVec3;
use std::collections::HashMap;
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::fmt;

/// Vertices of a row across that are nearer to each other than this, in lengths of the leaf, are one: where veins
/// meet.
const SAME_VERTEX_DISTANCE: f64 = 1e-9;

/// Sides of the tube around a vein.
const TUBE_SIDES: usize = 8;

/// The radius of the tube around a vein without a section, as a fraction of the longest vein.
const RELATIVE_VEIN_RADIUS: f64 = 0.004;

/// Triangles in space. Seen from outside, or from the upper side of a sheet, their corners turn counterclockwise.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriangleMesh {
    /// Places of the vertices, in the units of the scenario.
    pub vertices: Vec<DVec3>,
    /// Unit normals at the vertices: outwards, or of a sheet upwards.
    pub normals: Vec<DVec3>,
    /// Of every vertex the fraction of the length of its vein, and the place across: 0 to 1 over a sheet from the
    /// right margin to the left one, or around a tube.
    pub uv: Vec<[f64; 2]>,
    /// The vein of every vertex, counted from 1: at margins the outermost one.
    pub veins: Vec<u32>,
    /// The three vertices of every triangle.
    pub triangles: Vec<[u32; 3]>,
}

/// Why a leaf has no surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoSurface {
    /// A single vein of which stiffnesses are given has no width.
    NoWidth,
    /// Of the leaf no thickness is known.
    NoThickness,
    /// The leaf is known at fewer than two stations, or where it has no place.
    Undefined,
}

impl fmt::Display for NoSurface {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            NoSurface::NoWidth => {
                "a single vein has a surface if its width is known: give [section] or [blade] in place of [stiffness]"
            }
            NoSurface::NoThickness => {
                "the thickness of the leaf is not known: give [section] or [blade] in place of [stiffness]"
            }
            NoSurface::Undefined => "the leaf is not known at two stations",
        })
    }
}

impl std::error::Error for NoSurface {}

impl TriangleMesh {
    /// The sheet of a leaf of this shape, which a scenario describes.
    ///
    /// # Errors
    /// If it has no width.
    pub fn sheet(shape: &Shape, scenario: &Scenario) -> Result<TriangleMesh, NoSurface> {
        let rods = &shape.rods;
        let stations = &shape.stations;
        let known = |rod: &RodShape| {
            rod.nodes.len() == stations.len() && rod.nodes.iter().all(|it| it.position.is_finite())
        };
        if stations.len() < 2 || rods.is_empty() || !rods.iter().all(known) {
            return Err(NoSurface::Undefined);
        }
        let margins = Margins::new(scenario, rods.len());
        if rods.len() == 1 && !margins.exist() {
            return Err(NoSurface::NoWidth);
        }
        let same = SAME_VERTEX_DISTANCE * shape.longest();
        let mut mesh = TriangleMesh::default();
        let mut before: Vec<u32> = Vec::new();
        for (i, &sigma) in stations.iter().enumerate() {
            let row = margins.row(rods, i, sigma);
            let across = row.len() - 1;
            let mut here: Vec<u32> = Vec::with_capacity(row.len());
            for (c, (place, vein)) in row.into_iter().enumerate() {
                let beside = here.last().copied();
                let is_same = |k: &u32| mesh.vertices[*k as usize].distance(place) <= same;
                here.push(match beside.filter(is_same) {
                    Some(beside) => beside,
                    None => {
                        mesh.vertices.push(place);
                        mesh.uv.push([sigma, c as f64 / across as f64]);
                        mesh.veins.push(vein as u32 + 1);
                        mesh.vertices.len() as u32 - 1
                    }
                });
            }
            if !before.is_empty() {
                for c in 0..across {
                    mesh.add_quad([before[c], here[c], here[c + 1], before[c + 1]]);
                }
            }
            before = here;
        }
        mesh.normals = mesh.vertex_normals();
        Ok(mesh)
    }

    /// The leaf as a body: its sheet as thick as the blade or the sections are, closed all around.
    ///
    /// # Errors
    /// If it has no width or no thickness.
    pub fn body(shape: &Shape, scenario: &Scenario) -> Result<TriangleMesh, NoSurface> {
        let sheet = TriangleMesh::sheet(shape, scenario)?;
        let count = sheet.vertices.len();
        let half = |k: usize| {
            let (vein, sigma) = (sheet.veins[k] as usize - 1, sheet.uv[k][0]);
            (scenario.thickness(vein, sigma)).map(|thickness| 0.5 * thickness)
        };
        let halves: Option<Vec<f64>> = (0..count).map(half).collect();
        let halves = halves.ok_or(NoSurface::NoThickness)?;
        let mut body = TriangleMesh::default();
        for side in [1.0, -1.0] {
            for (k, half) in halves.iter().enumerate() {
                let normal = side * sheet.normals[k];
                body.add_vertex(
                    sheet.vertices[k] + *half * normal,
                    sheet.uv[k],
                    sheet.veins[k],
                );
            }
        }
        let below = count as u32;
        for &[a, b, c] in &sheet.triangles {
            body.triangles.push([a, b, c]);
            body.triangles.push([below + a, below + c, below + b]);
        }
        for [a, b] in sheet.boundary_edges() {
            body.triangles.push([a, below + a, below + b]);
            body.triangles.push([a, below + b, b]);
        }
        body.normals = body.vertex_normals();
        Ok(body)
    }

    /// The veins of a leaf of this shape as closed tubes, with the radii of their sections.
    pub fn vein_tubes(shape: &Shape, scenario: &Scenario) -> TriangleMesh {
        let mut mesh = TriangleMesh::default();
        let thin = RELATIVE_VEIN_RADIUS * shape.longest();
        for (j, rod) in shape.rods.iter().enumerate() {
            let radius = |sigma: f64| scenario.radii.at(j, sigma).unwrap_or(thin);
            let nodes = rod.nodes.iter().zip(&shape.stations);
            let nodes = nodes.filter(|(node, _)| node.position.is_finite());
            let places: Vec<(Pose, f64)> = nodes
                .map(|(node, sigma)| {
                    let pose = Pose {
                        position: node.position,
                        rotation: node.rotation,
                    };
                    (pose, *sigma)
                })
                .collect();
            if places.len() > 1 {
                mesh.add_tube(j, &places, &radius);
            }
        }
        mesh.normals = mesh.vertex_normals();
        mesh
    }

    /// The tube around vein `j`, closed by its end sections.
    fn add_tube(&mut self, j: usize, places: &[(Pose, f64)], radius: &dyn Fn(f64) -> f64) {
        let first = self.vertices.len() as u32;
        let sides = TUBE_SIDES as u32;
        for (pose, sigma) in places {
            for side in 0..TUBE_SIDES {
                let part = side as f64 / TUBE_SIDES as f64;
                let (sin, cos) = (TAU * part).sin_cos();
                let around = pose.rotation * DVec3::new(0.0, cos, sin);
                let place = pose.position + radius(*sigma) * around;
                self.add_vertex(place, [*sigma, part], j as u32 + 1);
            }
        }
        let ends = [places[0], places[places.len() - 1]];
        let centers = ends.map(|(pose, sigma)| {
            self.add_vertex(pose.position, [sigma, 0.0], j as u32 + 1);
            self.vertices.len() as u32 - 1
        });
        let ring = |i: u32, side: u32| first + i * sides + side % sides;
        let last = places.len() as u32 - 1;
        for side in 0..sides {
            for i in 0..last {
                let [a, b] = [side, side + 1].map(|side| ring(i, side));
                let [c, d] = [side, side + 1].map(|side| ring(i + 1, side));
                self.triangles.extend([[a, b, d], [a, d, c]]);
            }
            self.triangles
                .push([centers[0], ring(0, side + 1), ring(0, side)]);
            self.triangles
                .push([centers[1], ring(last, side), ring(last, side + 1)]);
        }
    }

    /// This mesh and another one after it.
    #[must_use]
    pub fn and(mut self, other: TriangleMesh) -> TriangleMesh {
        let first = self.vertices.len() as u32;
        self.vertices.extend(other.vertices);
        self.normals.extend(other.normals);
        self.uv.extend(other.uv);
        self.veins.extend(other.veins);
        let moved = other
            .triangles
            .iter()
            .map(|corners| corners.map(|k| first + k));
        self.triangles.extend(moved);
        self
    }

    /// The sum of the areas of all triangles.
    pub fn area(&self) -> f64 {
        self.facets().map(|facet| facet.length()).sum()
    }

    /// How the triangles are inclined.
    pub fn angles(&self) -> AngleDistribution {
        AngleDistribution::new(self.facets())
    }

    /// The vector areas of the triangles, along their normals.
    fn facets(&self) -> impl Iterator<Item = DVec3> {
        self.triangles.iter().map(|corners| {
            let [a, b, c] = corners.map(|k| self.vertices[k as usize]);
            0.5 * (b - a).cross(c - a)
        })
    }

    fn add_vertex(&mut self, place: DVec3, uv: [f64; 2], vein: u32) {
        self.vertices.push(place);
        self.uv.push(uv);
        self.veins.push(vein);
    }

    /// Adds both triangles of a quadrilateral that is divided along its shorter diagonal, without those of
    /// which two corners are one.
    fn add_quad(&mut self, [a, b, c, d]: [u32; 4]) {
        let at = |k: u32| self.vertices[k as usize];
        let pair = match at(a).distance(at(c)) <= at(b).distance(at(d)) {
            true => [[a, b, c], [a, c, d]],
            false => [[a, b, d], [b, c, d]],
        };
        let distinct = |[a, b, c]: &[u32; 3]| a != b && b != c && c != a;
        self.triangles.extend(pair.into_iter().filter(distinct));
    }

    /// The normal at every vertex: the mean of those of its triangles, weighted by their areas.
    fn vertex_normals(&self) -> Vec<DVec3> {
        let mut sums = vec![DVec3::ZERO; self.vertices.len()];
        for (corners, facet) in self.triangles.iter().zip(self.facets()) {
            for k in corners {
                sums[*k as usize] += facet;
            }
        }
        sums.into_iter()
            .map(|sum| sum.normalize_or(DVec3::Z))
            .collect()
    }

    /// The edges of which one triangle is on one side and none on the other, in the direction of that triangle.
    pub fn boundary_edges(&self) -> Vec<[u32; 2]> {
        let edges = |corners: &[u32; 3]| {
            let [a, b, c] = *corners;
            [[a, b], [b, c], [c, a]]
        };
        let mut count: HashMap<[u32; 2], usize> = HashMap::new();
        for edge in self.triangles.iter().flat_map(edges) {
            *count.entry(edge).or_default() += 1;
        }
        let all = self.triangles.iter().flat_map(edges);
        all.filter(|[a, b]| !count.contains_key(&[*b, *a]))
            .collect()
    }
}

/// How far a sheet goes on beyond its outermost veins.
struct Margins<'s> {
    scenario: &'s Scenario,
    /// The blade, if its outermost veins are not its margins.
    blade: Option<&'s Blade>,
    has_sections: bool,
    /// The outermost vein is so far from the midrib, as a fraction of the half width.
    outermost: f64,
}

impl<'s> Margins<'s> {
    fn new(scenario: &'s Scenario, rods: usize) -> Self {
        let blade = scenario.blade.as_deref();
        let outermost = blade.map_or(1.0, |blade| blade.vein_position(rods - 1).abs());
        Margins {
            scenario,
            blade: blade.filter(|_| outermost < 1.0 - SAME_VERTEX_DISTANCE),
            has_sections: blade.is_none() && scenario.radii.half_width(0, 0.0).is_some(),
            outermost,
        }
    }

    fn exist(&self) -> bool {
        self.blade.is_some() || self.has_sections
    }

    /// The distance of the margin from vein `j`, the outermost one, at a fraction of its length.
    fn distance(&self, j: usize, sigma: f64) -> f64 {
        match self.blade {
            Some(blade) => 0.5 * (1.0 - self.outermost) * blade.width(sigma),
            None => self.scenario.radii.half_width(j, sigma).unwrap_or(0.0),
        }
    }

    /// The places across the leaf at station `i`, from the right to the left, with their veins.
    fn row(&self, rods: &[RodShape], i: usize, sigma: f64) -> Vec<(DVec3, usize)> {
        let margin = |j: usize, side: f64| {
            let node = &rods[j].nodes[i];
            let beyond = side * self.distance(j, sigma) * (node.rotation * DVec3::Y);
            (node.position + beyond, j)
        };
        let last = rods.len() - 1;
        let mut row = Vec::with_capacity(rods.len() + 2);
        if self.exist() {
            row.push(margin(0, -1.0));
        }
        row.extend(
            rods.iter()
                .enumerate()
                .map(|(j, rod)| (rod.nodes[i].position, j)),
        );
        if self.exist() {
            row.push(margin(last, 1.0));
        }
        row
    }
}

/// Classes of inclination, from level to upright, and of azimuth, all around.
const INCLINATION_CLASSES: usize = 18;
const AZIMUTH_CLASSES: usize = 36;

/// How the surface of a leaf is inclined: its area by classes of inclination and azimuth.
#[derive(Clone, Debug, PartialEq)]
pub struct AngleDistribution {
    /// The area of each class: azimuth after azimuth of the first inclination, then of the next.
    areas: Vec<f64>,
    /// The whole area.
    pub area: f64,
    /// The area of the projection onto the x-y plane, counted as often as it is covered.
    pub projected_area: f64,
    /// The mean inclination, weighted by area, radians: zero for a level leaf.
    pub mean_inclination: f64,
}

/// A class of inclination and azimuth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AngleClass {
    /// Angle of the surface to the x-y plane in the middle of the class, radians, from 0 to pi/2.
    pub inclination: f64,
    /// Direction into which the surface falls, from x to y, in the middle of the class, radians, from 0 to 2 pi.
    pub azimuth: f64,
    /// The area.
    pub area: f64,
}

impl AngleDistribution {
    /// How many classes of inclination there are, and of azimuth.
    pub const CLASSES: [usize; 2] = [INCLINATION_CLASSES, AZIMUTH_CLASSES];

    /// The distribution of these vector areas.
    fn new(facets: impl Iterator<Item = DVec3>) -> Self {
        let mut areas = vec![0.0; INCLINATION_CLASSES * AZIMUTH_CLASSES];
        let (mut area, mut projected_area, mut turned) = (0.0, 0.0, 0.0);
        for facet in facets {
            let size = facet.length();
            if size == 0.0 {
                continue;
            }
            // The side that is seen from above.
            let upper = if facet.z < 0.0 { -facet } else { facet };
            let inclination = (upper.z / size).clamp(0.0, 1.0).acos();
            let azimuth = upper.y.atan2(upper.x).rem_euclid(TAU);
            let class = |part: f64, count: usize| ((part * count as f64) as usize).min(count - 1);
            let row = class(inclination / FRAC_PI_2, INCLINATION_CLASSES);
            let column = class(azimuth / TAU, AZIMUTH_CLASSES);
            areas[row * AZIMUTH_CLASSES + column] += size;
            area += size;
            projected_area += upper.z;
            turned += size * inclination;
        }
        AngleDistribution {
            areas,
            area,
            projected_area,
            mean_inclination: if area > 0.0 { turned / area } else { 0.0 },
        }
    }

    /// All classes: of every inclination those of all azimuths.
    pub fn classes(&self) -> impl Iterator<Item = AngleClass> {
        self.areas.iter().enumerate().map(|(k, area)| {
            let [row, column] =
                [k / AZIMUTH_CLASSES, k % AZIMUTH_CLASSES].map(|it| it as f64 + 0.5);
            AngleClass {
                inclination: row * FRAC_PI_2 / INCLINATION_CLASSES as f64,
                azimuth: column * 2.0 * PI / AZIMUTH_CLASSES as f64,
                area: *area,
            }
        })
    }
}
