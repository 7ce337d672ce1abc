//! Veins as poly-lines for ParaView: VTK's XML format `.vtp` with numbers in base64,
//! and `.pvd`, which lists several in time.
//!
//! Source: "VTK XML formats", version 1.0, of the VTK documentation.

use crate::figure::drawing::formats::escape_xml;
use crate::page::ShapeInSeries;
use base64::prelude::{BASE64_STANDARD as STANDARD, Engine};
use glam::DVec3;
use leafdyn::relax::Equilibrium;
use leafdyn::scenario::Radii;
use leafdyn::shape::NodeState;
use leafdyn::surface::TriangleMesh;
use std::io;
use std::io::Write;
use std::path::Path;

/// Values at all nodes, vein by vein: name, values per node, all values.
struct NodeArray<'a>(&'a str, usize, Vec<f64>);

/// A leaf at rest: per node its vein, place along it, directors, strains, forces and
/// moments, and the radius where sections are given.
pub fn write_leaf(equilibrium: &Equilibrium, radii: &Radii, out: &mut dyn Write) -> io::Result<()> {
    let shape = &equilibrium.shape;
    let nodes = || shape.rods.iter().flat_map(|rod| &rod.nodes);
    let along = |of: &dyn Fn(&NodeState) -> DVec3| flatten_vectors(nodes().map(of));
    let lengths = shape.rods.iter().map(|rod| rod.length);
    let s = lengths.flat_map(|length| shape.stations.iter().map(move |sigma| sigma * length));
    let mut arrays = vec![
        NodeArray("s", 1, s.collect()),
        NodeArray("d1", 3, along(&|node| node.rotation * DVec3::X)),
        NodeArray("d2", 3, along(&|node| node.rotation * DVec3::Y)),
        NodeArray("d3", 3, along(&|node| node.rotation * DVec3::Z)),
        NodeArray("v", 3, along(&|node| node.v)),
        NodeArray("u", 3, along(&|node| node.u)),
        NodeArray("n", 3, along(&|node| node.n)),
        NodeArray("m", 3, along(&|node| node.m)),
    ];
    arrays.extend(radius_array(shape.rods.len(), &shape.stations, radii));
    arrays.extend(equilibrium.stress.as_ref().map(|of| {
        let stresses = of.rods.iter().flatten().map(|stress| stress.equivalent);
        NodeArray("equivalent_stress", 1, stresses.collect())
    }));
    let points: Vec<Vec<DVec3>> = (shape.rods.iter())
        .map(|rod| rod.nodes.iter().map(|node| node.position).collect())
        .collect();
    write_polydata(&points, &shape.stations, &arrays, out)
}

/// Centrelines alone, with the vein, the place along it and the radius where sections
/// are given.
pub fn write_curves(
    curves: &[Vec<DVec3>],
    stations: &[f64],
    radii: &Radii,
    out: &mut dyn Write,
) -> io::Result<()> {
    let radius = radius_array(curves.len(), stations, radii);
    write_polydata(curves, stations, radius.as_slice(), out)
}

fn radius_array(rods: usize, stations: &[f64], radii: &Radii) -> Option<NodeArray<'static>> {
    let nodes = (0..rods).flat_map(|rod| stations.iter().map(move |&sigma| (rod, sigma)));
    let radius: Option<Vec<f64>> = nodes.map(|(rod, sigma)| radii.at(rod, sigma)).collect();
    radius.map(|radius| NodeArray("radius", 1, radius))
}

/// The file of a shape in the list of this name.
pub(crate) fn shape_file_name(list: &str, number: usize) -> String {
    let stem = Path::new(list).file_stem().unwrap_or_default();
    format!("{}_vtp/{number:05}.vtp", stem.display())
}

/// The list of this name: shapes by time, or by a number that varies in its place.
pub(crate) fn write_shape_list(
    name: &str,
    shapes: &[ShapeInSeries],
    out: &mut dyn Write,
) -> io::Result<()> {
    writeln!(out, "<?xml version=\"1.0\"?>")?;
    writeln!(
        out,
        "<VTKFile type=\"Collection\" version=\"0.1\" byte_order=\"LittleEndian\">\n<Collection>"
    )?;
    for (k, shape) in shapes.iter().enumerate() {
        let (time, file) = (shape.time, escape_xml(&shape_file_name(name, k)));
        writeln!(
            out,
            "<DataSet timestep=\"{time:?}\" part=\"0\" file=\"{file}\"/>"
        )?;
    }
    writeln!(out, "</Collection>\n</VTKFile>")
}

fn flatten_vectors(vectors: impl Iterator<Item = DVec3>) -> Vec<f64> {
    vectors.flat_map(|vector| vector.to_array()).collect()
}

fn write_polydata(
    veins: &[Vec<DVec3>],
    stations: &[f64],
    arrays: &[NodeArray],
    out: &mut dyn Write,
) -> io::Result<()> {
    let (count, nodes) = (veins.len(), veins.iter().map(Vec::len).sum::<usize>());
    writeln!(out, "<?xml version=\"1.0\"?>")?;
    writeln!(
        out,
        "<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n\
         <PolyData>\n<Piece NumberOfPoints=\"{nodes}\" NumberOfVerts=\"0\" NumberOfLines=\"{count}\" \
         NumberOfStrips=\"0\" NumberOfPolys=\"0\">\n<Points>"
    )?;
    write_float_array(
        "Points",
        3,
        &flatten_vectors(veins.iter().flatten().copied()),
        out,
    )?;
    writeln!(out, "</Points>\n<Lines>")?;
    write_integer_array("connectivity", 0..nodes, out)?;
    let ends = veins.iter().scan(0, |end, vein| {
        *end += vein.len();
        Some(*end)
    });
    write_integer_array("offsets", ends, out)?;
    writeln!(out, "</Lines>\n<PointData>")?;
    let rods = veins.iter().enumerate();
    let rods = rods.flat_map(|(j, vein)| vein.iter().map(move |_| j + 1));
    write_integer_array("rod", rods, out)?;
    let lengths = veins.iter().map(Vec::len);
    let sigma = lengths.flat_map(|nodes| stations.iter().copied().take(nodes));
    write_float_array("sigma", 1, &sigma.collect::<Vec<f64>>(), out)?;
    for NodeArray(name, components, numbers) in arrays {
        write_float_array(name, *components, numbers, out)?;
    }
    writeln!(out, "</PointData>\n<CellData>")?;
    write_integer_array("rod", 1..count + 1, out)?;
    writeln!(out, "</CellData>\n</Piece>\n</PolyData>\n</VTKFile>")
}

/// Writes the surface of a leaf, its blade and its veins: triangles, with the vein and the place along it of every vertex, texture coordinates,
/// normals, and for every triangle whether it is of a vein.
pub(super) fn write_surface(meshes: [&TriangleMesh; 2], out: &mut dyn Write) -> io::Result<()> {
    let counts = meshes.map(|mesh| (mesh.vertices.len(), mesh.triangles.len()));
    let [vertices, triangles] = [counts[0].0 + counts[1].0, counts[0].1 + counts[1].1];
    writeln!(out, "<?xml version=\"1.0\"?>")?;
    writeln!(
        out,
        "<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n\
         <PolyData>\n<Piece NumberOfPoints=\"{vertices}\" NumberOfVerts=\"0\" NumberOfLines=\"0\" \
         NumberOfStrips=\"0\" NumberOfPolys=\"{triangles}\">\n<Points>"
    )?;
    let vectors = |of: fn(&TriangleMesh) -> &Vec<DVec3>| {
        flatten_vectors(meshes.into_iter().flat_map(of).copied())
    };
    write_float_array("Points", 3, &vectors(|mesh| &mesh.vertices), out)?;
    writeln!(out, "</Points>\n<Polys>")?;
    let firsts = [0, counts[0].0];
    let corners = meshes.into_iter().zip(firsts).flat_map(|(mesh, first)| {
        let corners = mesh.triangles.as_flattened().iter();
        corners.map(move |corner| first + *corner as usize)
    });
    write_integer_array("connectivity", corners, out)?;
    write_integer_array("offsets", (1..=triangles).map(|k| 3 * k), out)?;
    writeln!(
        out,
        "</Polys>\n<PointData Normals=\"normal\" TCoords=\"uv\">"
    )?;
    write_float_array("normal", 3, &vectors(|mesh| &mesh.normals), out)?;
    let uv: Vec<[f64; 2]> = meshes
        .into_iter()
        .flat_map(|mesh| mesh.uv.iter().copied())
        .collect();
    write_float_array("uv", 2, uv.as_flattened(), out)?;
    let veins = meshes
        .into_iter()
        .flat_map(|mesh| mesh.veins.iter().map(|vein| *vein as usize));
    write_integer_array("rod", veins, out)?;
    let sigma: Vec<f64> = uv.iter().map(|[sigma, _]| *sigma).collect();
    write_float_array("sigma", 1, &sigma, out)?;
    writeln!(out, "</PointData>\n<CellData>")?;
    let is_vein = [0, 1].into_iter().zip(counts);
    let is_vein = is_vein.flat_map(|(part, (_, count))| std::iter::repeat_n(part, count));
    write_integer_array("is_vein", is_vein, out)?;
    writeln!(out, "</CellData>\n</Piece>\n</PolyData>\n</VTKFile>")
}

fn write_float_array(
    name: &str,
    components: usize,
    numbers: &[f64],
    out: &mut dyn Write,
) -> io::Result<()> {
    let bytes = numbers.iter().flat_map(|number| number.to_le_bytes());
    write_base64_array("Float64", name, components, bytes.collect(), out)
}

fn write_integer_array(
    name: &str,
    numbers: impl Iterator<Item = usize>,
    out: &mut dyn Write,
) -> io::Result<()> {
    let bytes = numbers.flat_map(|number| (number as i64).to_le_bytes());
    write_base64_array("Int64", name, 1, bytes.collect(), out)
}

/// Writes the number of bytes and the bytes as one base64 text.
fn write_base64_array(
    kind: &str,
    name: &str,
    components: usize,
    bytes: Vec<u8>,
    out: &mut dyn Write,
) -> io::Result<()> {
    let size = (bytes.len() as u64).to_le_bytes();
    let text = STANDARD.encode([&size, &bytes[..]].concat());
    writeln!(
        out,
        "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\" format=\"binary\">{text}</DataArray>"
    )
}
