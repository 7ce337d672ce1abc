//! Veins as tubes for Blender and other programs: binary glTF 2.0, with a motion as an
//! animation of morph targets.
//!
//! Source: Khronos Group, "glTF 2.0 Specification" (ISO/IEC 12113:2022).

use crate::figure::drawing::veins::{node_stride, replace_undrawable_points};
use crate::figure::drawing::{Color, color_of_vein};
use glam::{DVec3, Vec3};
use leafdyn::relax::Equilibrium;
use leafdyn::simulate::Record;
use leafdyn::surface::TriangleMesh;
use serde_json::{Value, json};
use std::io;
use std::io::Write;

/// Most shapes of a film: each has all vertices.
const MOST_FILM_SHAPES: usize = 61;

/// Most segments of a vein: finer ones are thinned.
const MOST_SEGMENTS_PER_VEIN: usize = 32;

/// Length of a film in seconds, as the unit of time is not known.
const FILM_SECONDS: f64 = 10.0;

/// Radius of a vein, as a fraction of the longest.
const RELATIVE_VEIN_RADIUS: f64 = 0.004;

const GLTF_FLOAT: u32 = 5126;

const GLTF_UNSIGNED_INT: u32 = 5125;

const GLTF_UNSIGNED_BYTE: u32 = 5121;

const GLTF_ARRAY_BUFFER: u32 = 34962;

const GLTF_ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// The centerlines of a leaf at a time.
struct ShapeAtTime<'s> {
    time: f64,
    curves: &'s [Vec<DVec3>],
}

/// Writes a leaf at rest.
pub fn write_leaf(equilibrium: &Equilibrium, out: &mut dyn Write) -> io::Result<()> {
    let shape = &equilibrium.shape;
    let leaf = [ShapeAtTime {
        time: 0.0,
        curves: &shape.curves,
    }];
    write_shapes(&equilibrium.scenario, &leaf, shape.longest(), out)
}

/// Writes a motion, of which some shapes are left out.
pub fn write_motion(record: &Record, out: &mut dyn Write) -> io::Result<()> {
    let film = &record.film;
    let last = film.len().saturating_sub(1);
    let stride = last.div_ceil(MOST_FILM_SHAPES - 1).max(1);
    let kept = (0..film.len()).filter(|&k| k.is_multiple_of(stride) || k == last);
    let shape = |k: usize| ShapeAtTime {
        time: record.moments[film[k].moment].time,
        curves: &film[k].curves,
    };
    let shapes: Vec<ShapeAtTime> = kept.map(shape).collect();
    write_shapes(&record.scenario, &shapes, record.length, out)
}

/// The buffer, with its views and accessors.
#[derive(Default)]
struct GltfBuffer {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl GltfBuffer {
    /// Adds an array, and returns the index of its accessor.
    fn add_array(
        &mut self,
        bytes: impl IntoIterator<Item = u8>,
        target: Option<u32>,
        mut accessor: Value,
    ) -> usize {
        let start = self.bytes.len();
        self.bytes.extend(bytes);
        let mut view =
            json!({ "buffer": 0, "byteOffset": start, "byteLength": self.bytes.len() - start });
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        accessor["bufferView"] = json!(self.views.len());
        self.views.push(view);
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    /// Adds numbers one by one, or vectors for vertices, with their bounds.
    fn add_floats<const N: usize>(&mut self, numbers: &[[f32; N]]) -> usize {
        let bound = |of: fn(f32, f32) -> f32, start: f32| -> Vec<f32> {
            let along = |k: usize| numbers.iter().map(move |it| it[k]).fold(start, of);
            (0..N).map(along).collect()
        };
        let accessor = json!({
            "componentType": GLTF_FLOAT, "count": numbers.len(),
            "type": if N == 3 { "VEC3" } else { "SCALAR" },
            "min": bound(f32::min, f32::MAX), "max": bound(f32::max, f32::MIN),
        });
        let bytes = numbers.as_flattened().iter().flat_map(|x| x.to_le_bytes());
        self.add_array(bytes, (N == 3).then_some(GLTF_ARRAY_BUFFER), accessor)
    }

    fn add_vectors(&mut self, vectors: impl Iterator<Item = Vec3>) -> usize {
        self.add_floats(&vectors.map(Vec3::into).collect::<Vec<[f32; 3]>>())
    }
}

/// Writes shapes at times; the first is the base of the morph targets.
fn write_shapes(
    name: &str,
    shapes: &[ShapeAtTime],
    longest: f64,
    out: &mut dyn Write,
) -> io::Result<()> {
    let thin = |curve: &Vec<DVec3>| {
        let stride = node_stride(curve.len(), MOST_SEGMENTS_PER_VEIN);
        replace_undrawable_points(curve.iter().copied().step_by(stride), longest)
    };
    let thinned = shapes
        .iter()
        .map(|shape| shape.curves.iter().map(thin).collect());
    let thinned: Vec<Vec<Vec<DVec3>>> = thinned.collect();
    let radius = RELATIVE_VEIN_RADIUS * longest;
    let first = thinned.first();
    let Some(first) = first.filter(|curves| curves.iter().any(|curve| curve.len() > 1)) else {
        let none = [json!([]), json!([])];
        return write_container(name, &GltfBuffer::default(), none, None, out);
    };
    let (veins, points) = (first.len(), first[0].len());
    let base = TubeMesh::around_curves(first, radius);
    let mut file = GltfBuffer::default();
    let position = file.add_vectors(base.positions.iter().copied());
    let normal = file.add_vectors(base.normals.iter().copied());
    let colors = (0..veins).flat_map(|vein| {
        let color = linear_color(color_of_vein(vein, veins));
        std::iter::repeat_n(color, TubeMesh::vertices_per_tube(points)).flatten()
    });
    let count = base.positions.len();
    let accessor = json!({ "componentType": GLTF_UNSIGNED_BYTE, "normalized": true, "count": count, "type": "VEC4" });
    let color = file.add_array(colors, Some(GLTF_ARRAY_BUFFER), accessor);
    let corners = TubeMesh::triangle_indices(veins, points);
    let accessor =
        json!({ "componentType": GLTF_UNSIGNED_INT, "count": corners.len(), "type": "SCALAR" });
    let corners = corners.into_iter().flat_map(u32::to_le_bytes);
    let indices = file.add_array(corners, Some(GLTF_ELEMENT_ARRAY_BUFFER), accessor);

    let mut targets = Vec::new();
    for curves in &thinned[1..] {
        let tubes = TubeMesh::around_curves(curves, radius);
        let mut moved = |of: fn(&TubeMesh) -> &Vec<Vec3>| {
            file.add_vectors(of(&tubes).iter().zip(of(&base)).map(|(a, b)| a - b))
        };
        targets.push(json!({
            "POSITION": moved(|tubes| &tubes.positions), "NORMAL": moved(|tubes| &tubes.normals),
        }));
    }
    let mut mesh = json!([{ "name": "veins", "primitives": [{
        "attributes": { "POSITION": position, "NORMAL": normal, "COLOR_0": color },
        "indices": indices, "material": 0,
    }]}]);
    let mut animation = None;
    if !targets.is_empty() {
        mesh[0]["weights"] = json!(vec![0.0; targets.len()]);
        animation = Some(morph_animation(&mut file, shapes));
        mesh[0]["primitives"][0]["targets"] = Value::Array(targets);
    }
    write_container(name, &file, [mesh, vein_material()], animation, out)
}

/// The color of a blade in linear RGB, and that of its veins.
const BLADE_COLORS: [[f64; 4]; 2] = [[0.09, 0.30, 0.05, 1.0], [0.30, 0.42, 0.12, 1.0]];

/// Writes the surface of a leaf, its blade and its veins, with normals and texture coordinates.
pub(super) fn write_surface(
    name: &str,
    parts: [&TriangleMesh; 2],
    out: &mut dyn Write,
) -> io::Result<()> {
    let mut file = GltfBuffer::default();
    let mut primitives = Vec::new();
    let exist = |(_, mesh): &(usize, &TriangleMesh)| !mesh.triangles.is_empty();
    for (part, mesh) in parts.into_iter().enumerate().filter(exist) {
        let uv: Vec<[f32; 2]> = mesh.uv.iter().map(|it| it.map(|x| x as f32)).collect();
        let bytes = uv.as_flattened().iter().flat_map(|x| x.to_le_bytes());
        let accessor = json!({ "componentType": GLTF_FLOAT, "count": uv.len(), "type": "VEC2" });
        let texture = file.add_array(bytes, Some(GLTF_ARRAY_BUFFER), accessor);
        let corners = mesh.triangles.as_flattened();
        let accessor =
            json!({ "componentType": GLTF_UNSIGNED_INT, "count": corners.len(), "type": "SCALAR" });
        let corners = corners.iter().flat_map(|corner| corner.to_le_bytes());
        let indices = file.add_array(corners, Some(GLTF_ELEMENT_ARRAY_BUFFER), accessor);
        primitives.push(json!({
            "attributes": {
                "POSITION": file.add_vectors(mesh.vertices.iter().map(|it| it.as_vec3())),
                "NORMAL": file.add_vectors(mesh.normals.iter().map(|it| it.as_vec3())),
                "TEXCOORD_0": texture,
            },
            "indices": indices, "material": part,
        }));
    }
    let mesh = json!([{ "name": "leaf", "primitives": primitives }]);
    let material = |name: &str, color: [f64; 4]| {
        json!({ "name": name, "doubleSided": true, "pbrMetallicRoughness": {
            "baseColorFactor": color, "metallicFactor": 0.0, "roughnessFactor": 0.6 } })
    };
    let [blade, veins] = BLADE_COLORS;
    let materials = json!([material("blade", blade), material("veins", veins)]);
    write_container(name, &file, [mesh, materials], None, out)
}

/// The material of veins with colors of their own.
fn vein_material() -> Value {
    json!([{ "name": "vein", "doubleSided": true,
        "pbrMetallicRoughness": { "metallicFactor": 0.0, "roughnessFactor": 0.6 } }])
}

/// The animation: at the time of a shape its weight is one and all others are zero.
fn morph_animation(file: &mut GltfBuffer, shapes: &[ShapeAtTime]) -> Value {
    let (start, end) = (shapes[0].time, shapes[shapes.len() - 1].time);
    let rate = if end > start {
        FILM_SECONDS / (end - start)
    } else {
        1.0
    };
    let times = shapes
        .iter()
        .map(|shape| [((shape.time - start) * rate) as f32]);
    let times: Vec<[f32; 1]> = times.collect();
    let mut weights = vec![[0.0]; shapes.len() * (shapes.len() - 1)];
    // The first shape is the base.
    for shape in 1..shapes.len() {
        weights[shape * (shapes.len() - 1) + shape - 1] = [1.0];
    }
    json!([{ "name": "motion",
        "samplers": [{ "input": file.add_floats(&times), "output": file.add_floats(&weights), "interpolation": "LINEAR" }],
        "channels": [{ "sampler": 0, "target": { "node": 0, "path": "weights" } }],
    }])
}

/// Writes the header, the document and the buffer.
fn write_container(
    name: &str,
    file: &GltfBuffer,
    [meshes, materials]: [Value; 2],
    animations: Option<Value>,
    out: &mut dyn Write,
) -> io::Result<()> {
    let generator = concat!("leafdyn ", env!("CARGO_PKG_VERSION"));
    let mut document = json!({ "asset": { "version": "2.0", "generator": generator }, "scene": 0, "scenes": [{ "name": name }] });
    if !file.accessors.is_empty() {
        document["scenes"][0]["nodes"] = json!([0]);
        // Up is y in this format.
        let half = std::f64::consts::FRAC_1_SQRT_2;
        document["nodes"] =
            json!([{ "name": "leaf", "mesh": 0, "rotation": [-half, 0.0, 0.0, half] }]);
        document["meshes"] = meshes;
        document["materials"] = materials;
        document["buffers"] = json!([{ "byteLength": file.bytes.len() }]);
        document["bufferViews"] = Value::Array(file.views.clone());
        document["accessors"] = Value::Array(file.accessors.clone());
    }
    if let Some(animations) = animations {
        document["animations"] = animations;
    }
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut chunks = vec![(*b"JSON", &text)];
    if !file.bytes.is_empty() {
        chunks.push((*b"BIN\0", &file.bytes));
    }
    let size: usize = chunks.iter().map(|(_, chunk)| 8 + chunk.len()).sum();
    let size = u32::try_from(12 + size).map_err(|_| io::ErrorKind::FileTooLarge)?;
    out.write_all(b"glTF")?;
    out.write_all([2, size].map(u32::to_le_bytes).as_flattened())?;
    for (kind, chunk) in chunks {
        out.write_all(&(chunk.len() as u32).to_le_bytes())?;
        out.write_all(&kind)?;
        out.write_all(chunk)?;
    }
    Ok(())
}

/// Converts a color from sRGB to linear RGB, opaque.
fn linear_color(Color(red, green, blue): Color) -> [u8; 4] {
    let of = |value: u8| {
        let value = f64::from(value) / 255.0;
        let linear = if value <= 0.04045 {
            value / 12.92
        } else {
            ((value + 0.055) / 1.055).powf(2.4)
        };
        (255.0 * linear).round() as u8
    };
    [of(red), of(green), of(blue), 255]
}

/// Corners of a tube's section.
const TUBE_SIDES: usize = 8;

/// Surfaces of tubes around curves with equally many points.
struct TubeMesh {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
}

impl TubeMesh {
    /// Tubes around `curves`, whose rings are transported along each curve without twist.
    fn around_curves(curves: &[Vec<DVec3>], radius: f64) -> Self {
        let (mut positions, mut normals) = (Vec::new(), Vec::new());
        for curve in curves {
            let mut across = DVec3::Z;
            for (i, &point) in curve.iter().enumerate() {
                let (before, after) = (i.saturating_sub(1), (i + 1).min(curve.len() - 1));
                let tangent = (curve[after] - curve[before]).normalize_or(DVec3::X);
                across = across.reject_from_normalized(tangent);
                if across.length() < 0.1 {
                    // Vertical, or a sharp kink: any perpendicular direction will do.
                    across = tangent.any_orthonormal_vector();
                }
                across = across.normalize();
                let binormal = tangent.cross(across);
                for side in 0..TUBE_SIDES {
                    let angle = std::f64::consts::TAU * side as f64 / TUBE_SIDES as f64;
                    let normal = angle.cos() * across + angle.sin() * binormal;
                    positions.push((point + radius * normal).as_vec3());
                    normals.push(normal.as_vec3().normalize_or(Vec3::X));
                }
            }
        }
        TubeMesh { positions, normals }
    }

    /// Corners of the triangles of `tubes` tubes around `points` points each, with open
    /// ends.
    fn triangle_indices(tubes: usize, points: usize) -> Vec<u32> {
        let ring = |tube: usize, point: usize| (tube * points + point) * TUBE_SIDES;
        let mut corners = Vec::new();
        for tube in 0..tubes {
            for point in 0..points.saturating_sub(1) {
                let (here, next) = (ring(tube, point), ring(tube, point + 1));
                for side in 0..TUBE_SIDES {
                    let other = (side + 1) % TUBE_SIDES;
                    let quad = [here + side, here + other, next + side, next + other];
                    let [a, b, c, d] = quad.map(|corner| corner as u32);
                    corners.extend([a, b, c, b, d, c]);
                }
            }
        }
        corners
    }

    /// Vertices of a tube around `points` points.
    fn vertices_per_tube(points: usize) -> usize {
        points * TUBE_SIDES
    }
}
