//! Sections of straight sides beside linear finite elements for the stress function, sums over small areas, and closed
//! forms.

use super::*;
use glam::DVec2;
use std::collections::HashMap;
use std::f64::consts::PI;

#[track_caller]
fn close(found: f64, wanted: f64, relative: f64) {
    assert!((found / wanted - 1.0).abs() < relative, "{found} {wanted}");
}

/// Linear triangular elements for the stress function on a section that is the union of triangles.
struct TorsionMesh {
    nodes: Vec<DVec2>,
    elements: Vec<[usize; 3]>,
}

impl TorsionMesh {
    /// Each of the triangles is divided into n^2 similar ones.
    fn new(triangles: &[[DVec2; 3]], n: usize) -> TorsionMesh {
        let mut mesh = TorsionMesh {
            nodes: Vec::new(),
            elements: Vec::new(),
        };
        let mut known = HashMap::new();
        for [a, b, c] in triangles {
            let mut node = |i: usize, j: usize| {
                let at = *a + (*b - *a) * (i as f64 / n as f64) + (*c - *a) * (j as f64 / n as f64);
                let key = (at * 1e8).round();
                let nodes = &mut mesh.nodes;
                *known
                    .entry((key.x as i64, key.y as i64))
                    .or_insert_with(|| {
                        nodes.push(at);
                        nodes.len() - 1
                    })
            };
            for i in 0..n {
                for j in 0..n - i {
                    mesh.elements
                        .push([node(i, j), node(i + 1, j), node(i, j + 1)]);
                    if i + j + 2 <= n {
                        let opposite = [node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)];
                        mesh.elements.push(opposite);
                    }
                }
            }
        }
        mesh
    }

    /// J, twice the integral of the stress function, by conjugate gradients.
    fn torsion_constant(&self) -> f64 {
        let mut edges: HashMap<(usize, usize), usize> = HashMap::new();
        for element in &self.elements {
            for k in 0..3 {
                let (a, b) = (element[k], element[(k + 1) % 3]);
                *edges.entry((a.min(b), a.max(b))).or_default() += 1;
            }
        }
        let mut inside = vec![1.0; self.nodes.len()];
        for ((a, b), _) in edges.iter().filter(|(_, count)| **count == 1) {
            (inside[*a], inside[*b]) = (0.0, 0.0);
        }
        let mut load = vec![0.0; self.nodes.len()];
        let mut stiffness = Vec::new();
        for element in &self.elements {
            let [a, b, c] = element.map(|node| self.nodes[node]);
            let twice = (b - a).perp_dot(c - a);
            let gradients = [b - c, c - a, a - b].map(|side| side.perp() / twice);
            let matrix = gradients.map(|g| gradients.map(|h| 0.5 * twice * g.dot(h)));
            stiffness.push(matrix);
            for node in element {
                load[*node] += inside[*node] * 2.0 * twice / 6.0;
            }
        }
        let times = |x: &[f64]| {
            let mut product = vec![0.0; x.len()];
            for (element, matrix) in self.elements.iter().zip(&stiffness) {
                for (row, i) in matrix.iter().zip(element) {
                    for (entry, j) in row.iter().zip(element) {
                        product[*i] += inside[*i] * entry * x[*j];
                    }
                }
            }
            product
        };
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let mut x = vec![0.0; load.len()];
        let mut residual = load.clone();
        let mut direction = load.clone();
        let mut size = dot(&residual, &residual);
        let enough = 1e-26 * size;
        while size > enough {
            let product = times(&direction);
            let step = size / dot(&direction, &product);
            for k in 0..x.len() {
                x[k] += step * direction[k];
                residual[k] -= step * product[k];
            }
            let before = std::mem::replace(&mut size, dot(&residual, &residual));
            for (d, r) in direction.iter_mut().zip(&residual) {
                *d = r + size / before * *d;
            }
        }
        dot(&load, &x)
    }

    /// J on n, 2n, 4n and 8n divisions, whose errors are sums of these powers of the size of the elements.
    fn extrapolated(triangles: &[[DVec2; 3]], n: usize, powers: [f64; 3]) -> f64 {
        let of = |k: i32| TorsionMesh::new(triangles, n << k).torsion_constant();
        let mut table: Vec<f64> = (0..4).map(of).collect();
        for power in powers {
            let factor = 2_f64.powf(power);
            table = table
                .windows(2)
                .map(|pair| (factor * pair[1] - pair[0]) / (factor - 1.0))
                .collect();
        }
        table[0]
    }
}

/// The triangle of three corners.
fn triangle(width: f64, height: f64) -> [DVec2; 3] {
    [
        DVec2::ZERO,
        DVec2::new(width, 0.0),
        DVec2::new(width / 2.0, height),
    ]
}

/// The unit squares of a channel whose wall is 1, each as two triangles.
fn channel(width: usize, height: usize) -> Vec<[DVec2; 3]> {
    let mut triangles = Vec::new();
    for i in 0..width {
        for j in (0..height).filter(|j| *j == 0 || i == 0 || i + 1 == width) {
            let corner = DVec2::new(i as f64, j as f64);
            let opposite = corner + DVec2::ONE;
            triangles.push([corner, corner + DVec2::X, corner + DVec2::Y]);
            triangles.push([opposite, corner + DVec2::Y, corner + DVec2::X]);
        }
    }
    triangles
}

/// sqrt(3) a^4/80 of the equilateral triangle, 0.0260896517 a^4 of half a square (Timoshenko and Goodier, art. 112, have
/// 0.0261 from H. Hancock's and B. G. Galerkin's series), and the integrals of b^3/3 of thin wedges.
#[test]
fn torsion_of_triangles_with_closed_forms() {
    let torsion = |width, height| PolygonSection::Triangle { width, height }.torsion_constant();
    let height = 3_f64.sqrt() / 2.0;
    close(torsion(2.0, 2.0 * height), 16.0 * 3_f64.sqrt() / 80.0, 1e-9);
    close(
        torsion(2_f64.sqrt(), 0.5_f64.sqrt()),
        0.026_089_651_711_5,
        1e-8,
    );
    for thin in [1e-4, 1e-6] {
        close(torsion(1.0, thin), thin.powi(3) / 12.0, 2.0 * thin);
        close(torsion(thin, 1.0), thin.powi(3) / 12.0, 2.0 * thin);
    }
    let slope = |width, height| PolygonSection::Triangle { width, height }.stress_function_slope();
    for nearly in [1.0 - 1e-9, 1.0 + 1e-9] {
        close(slope(nearly, height), height / 2.0, 2e-5);
    }
}

/// The errors of linear elements for J are those of interpolation, of the second and the fourth order, and, of the order
/// 2 pi/apex, that of the apex, where the stress function has a term of r^(pi/apex).
#[test]
fn torsion_of_triangles_by_finite_elements() {
    for (width, height) in [
        (1.0_f64, 0.2),
        (1.0, 0.5),
        (1.0, 1.3),
        (0.3, 1.0),
        (0.2, 1.0),
    ] {
        let apex = 2.0 * (width / (2.0 * height)).atan();
        let powers = [2.0, (2.0 * PI / apex).min(4.0), 4.0];
        let elements = TorsionMesh::extrapolated(&[triangle(width, height)], 12, powers);
        let found = PolygonSection::Triangle { width, height }.torsion_constant();
        close(found, elements, 3e-6);
    }
}

#[test]
fn torsion_of_a_hexagon_by_finite_elements() {
    let corner = |k: u32| DVec2::from_angle(PI / 3.0 * f64::from(k)) / 3_f64.sqrt();
    let sixths: Vec<_> = (0..6)
        .map(|k| [DVec2::ZERO, corner(k), corner(k + 1)])
        .collect();
    // The stress function has terms of r^(3/2) at its corners, of which J has the square.
    let elements = TorsionMesh::extrapolated(&sixths, 5, [2.0, 3.0, 4.0]);
    let found = PolygonSection::Hexagon { width: 1.0 }.torsion_constant();
    close(found, elements, 1e-6);
}

/// Reentrant corners have terms of r^(2/3): the error is of the order 4/3.
#[test]
fn torsion_of_channels_by_finite_elements() {
    for (width, height, within) in [(8, 6, 2e-5), (4, 4, 2e-5), (3, 3, 2e-4), (3, 2, 4e-3)] {
        let powers = [4.0 / 3.0, 2.0, 8.0 / 3.0];
        let elements = TorsionMesh::extrapolated(&channel(width, height), 4, powers);
        let section = PolygonSection::Channel {
            width: width as f64,
            height: height as f64,
            wall: 1.0,
        };
        close(section.torsion_constant(), elements, within);
    }
}

fn examples() -> [PolygonSection; 4] {
    [
        PolygonSection::Triangle {
            width: 0.8,
            height: 1.3,
        },
        PolygonSection::Hexagon { width: 1.1 },
        PolygonSection::Channel {
            width: 1.5,
            height: 0.9,
            wall: 0.25,
        },
        PolygonSection::Channel {
            width: 0.9,
            height: 2.0,
            wall: 0.3,
        },
    ]
}

/// The material of a section at this height over its lowest point, along d2: pieces from -right to -left and from left
/// to right of the middle.
fn chord(section: PolygonSection, z: f64) -> [f64; 2] {
    match section {
        PolygonSection::Triangle { width, height } => [0.0, 0.5 * width * (1.0 - z / height)],
        PolygonSection::Hexagon { width } => {
            let side = width / 3_f64.sqrt();
            let beyond = (z - side).abs() - side / 2.0;
            [0.0, 0.5 * width * (1.0 - beyond.max(0.0) * 2.0 / side)]
        }
        PolygonSection::Channel { width, wall, .. } => match z < wall {
            true => [0.0, width / 2.0],
            false => [width / 2.0 - wall, width / 2.0],
        },
    }
}

/// Area, centroid and second moments from sums over chords.
#[test]
fn areas_and_second_moments_are_sums_over_chords() {
    // A multiple of all heights over their walls.
    let steps = 36_000;
    for section in examples() {
        let dz = section.height() / f64::from(steps);
        let mut sums = [0.0; 4];
        for k in 0..steps {
            let z = (f64::from(k) + 0.5) * dz;
            let [left, right] = chord(section, z);
            let area = 2.0 * (right - left) * dz;
            let third = 2.0 / 3.0 * (right.powi(3) - left.powi(3)) * dz;
            for (sum, part) in sums.iter_mut().zip([area, area * z, area * z * z, third]) {
                *sum += part;
            }
        }
        let [area, first, second, third] = sums;
        let centroid = first / area;
        close(section.area(), area, 1e-8);
        let [about_2, about_3] = section.second_moments();
        close(about_2, second - area * centroid * centroid, 1e-7);
        close(about_3, third, 1e-7);
        let lowest = section.outer_corners();
        let lowest = lowest
            .as_slice()
            .iter()
            .map(|corner| corner.y)
            .fold(0.0, f64::min);
        close(-lowest, centroid, 1e-7);
    }
}

/// Zhuravskii's stresses of the triangle and the hexagon from sums over chords: first moments, energies and maxima.
#[test]
fn shear_by_forces_is_a_sum_over_chords() {
    let steps = 200_000;
    for section in &examples()[..2] {
        let height = section.height();
        let dz = height / f64::from(steps);
        let [second, _] = section.second_moments();
        let lowest = section.outer_corners();
        let lowest = lowest
            .as_slice()
            .iter()
            .map(|corner| corner.y)
            .fold(0.0, f64::min);
        let (mut first, mut energy, mut peak) = (0.0, 0.0, 0.0_f64);
        for k in 0..steps {
            let z = (f64::from(k) + 0.5) * dz;
            let breadth = 2.0 * chord(*section, z)[1];
            // The first moment of what is below, at the middle of the step.
            let half = 0.5 * breadth * (lowest + z) * dz;
            first += half;
            energy += first * first / breadth * dz;
            peak = peak.max(first.abs() / breadth);
            first += half;
        }
        let [_, factor] = section.shear_factors();
        close(factor, second * second / (section.area() * energy), 1e-5);
        close(
            section.peak_shear()[1],
            peak / second * section.area(),
            1e-5,
        );
    }
    // The hexagon across flats, and the triangle across its axis: b(y) is 2 - u and 1 - u of half the width.
    for (section, end) in examples()[..2].iter().zip([1.0, 0.5]) {
        let du = 1.0 / f64::from(steps);
        let breadth = |u: f64| 1.0 - end * u;
        let (mut first, mut energy, mut peak, mut area, mut second) = (0.0, 0.0, 0.0_f64, 0.0, 0.0);
        for k in (0..steps).rev() {
            let u = (f64::from(k) + 0.5) * du;
            let half = 0.5 * breadth(u) * u * du;
            first += half;
            energy += 2.0 * first * first / breadth(u) * du;
            peak = peak.max(first / breadth(u));
            area += 2.0 * breadth(u) * du;
            second += 2.0 * breadth(u) * u * u * du;
            first += half;
        }
        close(
            section.shear_factors()[0],
            second * second / (area * energy),
            1e-5,
        );
        close(section.peak_shear()[0], peak / second * area, 1e-5);
    }
}

/// The thin square channel with flanges as long as its web: shear flows and factors from integrals by hand. With b = h =
/// 1, the centroid at 1/3, I along the flanges is e/3 and 7 e/12 across; Q across is x/2 on a flange, up to 1/2 + 1/8 in
/// the middle of the web, and along 2/9 at the centroid.
#[test]
fn shear_of_a_thin_channel() {
    let wall = 1e-6;
    let section = PolygonSection::Channel {
        width: 1.0 + wall,
        height: 1.0 + wall / 2.0,
        wall,
    };
    let peaks = [0.625 / (7.0 / 12.0) * 3.0, 2.0 / 9.0 * 3.0 * 3.0];
    // Flanges 2 (1/4)/3; the web the integral of (5/8 - y^2/2)^2.
    let across = 1.0 / 6.0 + (25.0 / 64.0 - 5.0 / 8.0 / 12.0 + 0.25 / 80.0);
    // Flanges 2 integral of (2x/3 - x^2/2)^2; the web from 1/6 to 0 on either side.
    let along = 2.0 * (4.0 / 27.0 - 1.0 / 6.0 + 0.05) + 1.0 / 108.0;
    let factors = [(49.0 / 144.0) / (3.0 * across), (1.0 / 9.0) / (3.0 * along)];
    for axis in 0..2 {
        close(section.peak_shear()[axis], peaks[axis], 1e-5);
        close(section.shear_factors()[axis], factors[axis], 1e-5);
    }
}

/// Tension and bending about both axes: the largest stress among many points of the outline, whatever the signs.
#[test]
fn the_most_stressed_corner() {
    for section in examples() {
        let [second, third] = section.second_moments();
        let lowest = section.outer_corners();
        let lowest = lowest
            .as_slice()
            .iter()
            .map(|corner| corner.y)
            .fold(0.0, f64::min);
        for (tension, about) in [
            (0.3, [0.7, 0.1]),
            (-0.3, [0.7, -0.4]),
            (0.2, [-0.9, 0.0]),
            (0.0, [0.0, 1.0]),
        ] {
            let mut most = 0.0_f64;
            for k in 0..=2000 {
                let z = section.height() * f64::from(k) / 2000.0;
                for y in chord(section, z).into_iter().flat_map(|y| [y, -y]) {
                    let stress = tension + about[0] / second * (z + lowest) - about[1] / third * y;
                    most = most.max(stress.abs());
                }
            }
            let found = section.normal_stress(tension, about);
            close(found, most, 1e-12);
        }
    }
}
