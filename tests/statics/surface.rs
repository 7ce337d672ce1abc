//! The surface of a leaf: its area is that of the outline, bodies are closed, angles are those of closed forms.

use leafdyn::surface::{NoSurface, TriangleMesh};
use leafdyn_testing::*;
use std::f64::consts::{FRAC_PI_2, PI};

/// A level strip of length one that rests as an arc up or down to the right angle.
fn quarter_circle(bend: f64) -> Scenario {
    parse(&format!(
        r#"
        name = "strip"
        leaf = {{ rods = 1, length = 1.0, fan = [0.0] }}
        section = {{ shape = "rectangle", width = 0.2, thickness = 0.01, young = 1.0 }}
        rest.bend_2 = {bend:?}
        load.gravity = [0.0, 0.0, 0.0]
        "#
    ))
}

fn blade(rods: usize, edges: bool, elevation: f64) -> Scenario {
    parse(&format!(
        r#"
        name = "blade"
        leaf = {{ rods = {rods}, elevation = {elevation:?} }}
        load.gravity = [0.0, 0.0, 0.0]
        [blade]
        length = 20.0
        thickness = 0.03
        young = 5e4
        edges = {edges}
        [blade.width]
        at = [0.0, 0.15, 0.4, 0.7, 1.0]
        value = [0.9, 1.4, 1.6, 1.0, 0.0]
        "#
    ))
}

/// The volume within a closed mesh whose normals point outwards, by the divergence theorem.
fn volume(mesh: &TriangleMesh) -> f64 {
    let tetrahedra = mesh.triangles.iter().map(|corners| {
        let [a, b, c] = corners.map(|k| mesh.vertices[k as usize]);
        a.dot(b.cross(c)) / 6.0
    });
    tetrahedra.sum()
}

fn at_rest(scenario: &Scenario, parts: usize) -> Equilibrium {
    settle(scenario, 1e-8).at_stations(scenario, Some(parts))
}

#[test]
fn the_area_of_a_blade_is_that_of_its_outline() {
    for (rods, edges) in [(3, true), (7, true), (1, false), (2, false), (5, false)] {
        let scenario = blade(rods, edges, 0.0);
        let outline = scenario.blade.as_ref().unwrap().area();
        let leaf = at_rest(&scenario, 200);
        let sheet = TriangleMesh::sheet(&leaf.shape, &scenario).unwrap();
        let off = (sheet.area() / outline - 1.0).abs();
        assert!(off < 1e-3, "{rods} veins, edges {edges}: {off:.1e}");
        // Level, and seen from above.
        assert!(sheet.normals.iter().all(|normal| normal.z > 0.99));
        let angles = sheet.angles();
        assert!((angles.projected_area - sheet.area()).abs() < 1e-9 * outline);
        assert!(angles.mean_inclination < 1e-6);
    }
}

#[test]
fn a_blade_that_rises_is_inclined_by_its_elevation() {
    let scenario = blade(5, true, 0.7);
    let leaf = at_rest(&scenario, 50);
    let angles = TriangleMesh::sheet(&leaf.shape, &scenario)
        .unwrap()
        .angles();
    assert!((angles.mean_inclination - 0.7).abs() < 1e-6);
    assert!((angles.projected_area / angles.area - 0.7_f64.cos()).abs() < 1e-9);
    // What rises along x falls against it.
    let most = angles
        .classes()
        .max_by(|a, b| a.area.total_cmp(&b.area))
        .unwrap();
    assert!((most.azimuth - PI).abs() < 0.1 && (most.inclination - 0.7).abs() < 0.05);
}

/// The strip is an arc from level to upright: all inclinations have the same area, and the radius is 2/pi.
#[test]
fn angles_of_an_arc_are_those_of_a_circle() {
    for bend in [FRAC_PI_2, -FRAC_PI_2] {
        let scenario = quarter_circle(bend);
        let leaf = at_rest(&scenario, 360);
        let sheet = TriangleMesh::sheet(&leaf.shape, &scenario).unwrap();
        assert!((sheet.area() - 0.2).abs() < 1e-5);
        let angles = sheet.angles();
        assert!((angles.mean_inclination - 0.25 * PI).abs() < 1e-5);
        assert!((angles.projected_area - 0.2 * 2.0 / PI).abs() < 1e-5);
        let mut rows = vec![0.0; 18];
        for class in angles.classes() {
            rows[(class.inclination / FRAC_PI_2 * 18.0) as usize] += class.area;
        }
        for row in &rows {
            assert!((row - 0.2 / 18.0).abs() < 1e-5, "{rows:?}");
        }
        let whole: f64 = rows.iter().sum();
        assert!((whole - angles.area).abs() < 1e-12);
    }
}

#[test]
fn bodies_and_tubes_are_closed_and_turned_outwards() {
    for scenario in [
        quarter_circle(1.2),
        blade(5, true, 0.4),
        blade(4, false, 0.4),
    ] {
        let leaf = at_rest(&scenario, 60);
        let sheet = TriangleMesh::sheet(&leaf.shape, &scenario).unwrap();
        assert!(!sheet.boundary_edges().is_empty());
        let body = TriangleMesh::body(&leaf.shape, &scenario).unwrap();
        assert!(body.boundary_edges().is_empty());
        let thickness = if scenario.blade.is_some() { 0.03 } else { 0.01 };
        let off = volume(&body) / (sheet.area() * thickness) - 1.0;
        assert!(off.abs() < 1e-2, "{}: {off:.1e}", scenario.name);
        let tubes = TriangleMesh::vein_tubes(&leaf.shape, &scenario);
        assert!(tubes.boundary_edges().is_empty());
        assert!(volume(&tubes) > 0.0);
        let both = body.clone().and(tubes.clone());
        assert!((both.area() - body.area() - tubes.area()).abs() < 1e-9 * both.area());
        assert_eq!(both.vertices.len(), both.veins.len());
        assert_eq!(both.vertices.len(), both.normals.len());
    }
}

/// The tube of a circular section is the prism in it.
#[test]
fn tubes_have_the_radii_of_their_sections() {
    let scenario = parse(
        r#"
        name = "stem"
        leaf = { rods = 1, length = 1.0, fan = [0.0] }
        section = { shape = "circle", diameter = 0.1, young = 1.0 }
        load.gravity = [0.0, 0.0, 0.0]
        "#,
    );
    let leaf = at_rest(&scenario, 20);
    let tube = TriangleMesh::vein_tubes(&leaf.shape, &scenario);
    let octagon = 0.5 * 8.0 * 0.05_f64.powi(2) * (0.25 * PI).sin();
    assert!((volume(&tube) - octagon).abs() < 1e-12);
}

#[test]
fn a_rod_of_which_no_width_is_known_has_no_surface() {
    let scenario = parse(&format!("{ROD}\nload.gravity = [0.0, 0.0, -1.0]"));
    let leaf = settle(&scenario, 1e-6);
    let refused = TriangleMesh::sheet(&leaf.shape, &scenario).unwrap_err();
    assert_eq!(refused, NoSurface::NoWidth);
    assert!(refused.to_string().contains("[section]"));
}

/// Every triangle of every leaf has an area, and every place across the leaf has a sheet: where veins meet vertices are one.
#[test]
fn where_veins_meet_vertices_are_one() {
    let scenario = scenario("paper/fig04", "");
    let leaf = at_rest(&scenario, 40);
    let sheet = TriangleMesh::sheet(&leaf.shape, &scenario).unwrap();
    let facets = sheet.triangles.iter().map(|corners| {
        let [a, b, c] = corners.map(|k| sheet.vertices[k as usize]);
        (b - a).cross(c - a).length()
    });
    assert!(facets.into_iter().all(|area| area > 0.0));
    // One row of quadrilaterals less at either end, where all veins meet in a point.
    let rods = scenario.rods.len();
    assert_eq!(sheet.vertices.len(), 39 * rods + 2);
    assert_eq!(sheet.triangles.len(), 2 * 38 * (rods - 1) + 2 * (rods - 1));
    // Its boundary is one closed line.
    assert_eq!(sheet.boundary_edges().len(), 2 * 40);
}
