//! The leaf as a surface for ray tracers, canopy models and modelling programs: Wavefront OBJ, PLY (G. Turk,
//! "The PLY polygon file format", Stanford 1994), glTF and VTK, each with the blade and its veins; and the
//! distribution of the blade's angles.

use crate::page::{glb, vtk};
use crate::report;
use leafdyn::relax::Equilibrium;
use leafdyn::scenario::Scenario;
use leafdyn::surface::TriangleMesh;
use std::io;
use std::io::Write;

/// The surface of a leaf: its blade, which is empty where no width is known, and its veins.
struct SurfaceParts {
    blade: TriangleMesh,
    veins: TriangleMesh,
}

impl SurfaceParts {
    fn new(equilibrium: &Equilibrium, scenario: &Scenario) -> Self {
        let shape = &equilibrium.shape;
        SurfaceParts {
            blade: TriangleMesh::sheet(shape, scenario).unwrap_or_default(),
            veins: TriangleMesh::vein_tubes(shape, scenario),
        }
    }

    /// The blade, and the veins.
    fn both(&self) -> [&TriangleMesh; 2] {
        [&self.blade, &self.veins]
    }
}

/// Writes a leaf as Wavefront OBJ: an object for the blade and one for the veins.
pub fn write_obj(
    equilibrium: &Equilibrium,
    scenario: &Scenario,
    out: &mut dyn Write,
) -> io::Result<()> {
    writeln!(out, "# leafdyn {}", env!("CARGO_PKG_VERSION"))?;
    let parts = SurfaceParts::new(equilibrium, scenario);
    let mut first = 1;
    for (name, mesh) in ["blade", "veins"].into_iter().zip(parts.both()) {
        if mesh.triangles.is_empty() {
            continue;
        }
        writeln!(out, "o {name}")?;
        for it in &mesh.vertices {
            writeln!(out, "v {:?} {:?} {:?}", it.x, it.y, it.z)?;
        }
        for [u, v] in &mesh.uv {
            writeln!(out, "vt {u:?} {v:?}")?;
        }
        for it in &mesh.normals {
            writeln!(out, "vn {:?} {:?} {:?}", it.x, it.y, it.z)?;
        }
        for corners in &mesh.triangles {
            let [a, b, c] = corners.map(|k| first + k);
            writeln!(out, "f {a}/{a}/{a} {b}/{b}/{b} {c}/{c}/{c}")?;
        }
        first += mesh.vertices.len() as u32;
    }
    Ok(())
}

/// Writes a leaf as binary PLY, with the vein and the place along it of every vertex.
pub fn write_ply(
    equilibrium: &Equilibrium,
    scenario: &Scenario,
    out: &mut dyn Write,
) -> io::Result<()> {
    let parts = SurfaceParts::new(equilibrium, scenario);
    let mesh = parts.blade.and(parts.veins);
    writeln!(out, "ply\nformat binary_little_endian 1.0")?;
    writeln!(out, "comment leafdyn {}", env!("CARGO_PKG_VERSION"))?;
    writeln!(out, "element vertex {}", mesh.vertices.len())?;
    for name in ["x", "y", "z", "nx", "ny", "nz", "s", "t"] {
        writeln!(out, "property double {name}")?;
    }
    writeln!(out, "property int vein")?;
    writeln!(out, "element face {}", mesh.triangles.len())?;
    writeln!(out, "property list uchar int vertex_indices\nend_header")?;
    for (k, place) in mesh.vertices.iter().enumerate() {
        let numbers = [place.to_array(), mesh.normals[k].to_array()];
        for number in numbers.as_flattened().iter().chain(&mesh.uv[k]) {
            out.write_all(&number.to_le_bytes())?;
        }
        out.write_all(&(mesh.veins[k] as i32).to_le_bytes())?;
    }
    for corners in &mesh.triangles {
        out.write_all(&[3])?;
        for corner in corners {
            out.write_all(&(*corner as i32).to_le_bytes())?;
        }
    }
    Ok(())
}

/// Writes a leaf as glTF: a mesh for the blade and one for the veins.
pub fn write_glb(
    equilibrium: &Equilibrium,
    scenario: &Scenario,
    out: &mut dyn Write,
) -> io::Result<()> {
    let parts = SurfaceParts::new(equilibrium, scenario);
    glb::write_surface(&equilibrium.scenario, parts.both(), out)
}

/// Writes a leaf for ParaView.
pub fn write_vtp(
    equilibrium: &Equilibrium,
    scenario: &Scenario,
    out: &mut dyn Write,
) -> io::Result<()> {
    vtk::write_surface(SurfaceParts::new(equilibrium, scenario).both(), out)
}

/// Writes the area of the blade by classes of inclination and azimuth.
pub fn write_angles(
    equilibrium: &Equilibrium,
    scenario: &Scenario,
    out: &mut dyn Write,
) -> io::Result<()> {
    let angles = SurfaceParts::new(equilibrium, scenario).blade.angles();
    report::write_angle_table(&angles, out)
}
