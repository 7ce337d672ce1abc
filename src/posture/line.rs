//! Forces and moments along a posture. They do not ask for the modulus:
//!
//! ```text
//!   n(s) = F + integral of f from s to L        m' = n x r',  m(L) = 0
//! ```
//!
//! A force F that the section holds off the axis, at the lever a from it, adds a x F to the moment of all before it; the
//! lever turns with the directors.
//!
//! Integrals are those of polynomials through the five Gauss points of each element: of order ten over an
//! element, of order six at its points.

use crate::numbers::GAUSS_LEGENDRE_RULE;
use crate::posture::rod::HangingRod;
use crate::posture::smoothing::CurvePoint;
use crate::scenario::{Profile, RodPlace};
use glam::{DMat3, DVec3};
use std::sync::LazyLock;

/// Gauss points of an element.
pub const POINTS: usize = GAUSS_LEGENDRE_RULE.len();

/// Integrals from the begin of an element of length 1 to its Gauss points, of the polynomials that are 1 at one of
/// these and 0 at the others.
pub static PARTIAL_INTEGRALS: LazyLock<[[f64; POINTS]; POINTS]> = LazyLock::new(|| {
    let at = |k: usize| GAUSS_LEGENDRE_RULE[k].at;
    let cardinal = |j: usize, x: f64| -> f64 {
        let others = (0..POINTS).filter(|&k| k != j);
        others.map(|k| (x - at(k)) / (at(j) - at(k))).product()
    };
    let mut integrals = [[0.0; POINTS]; POINTS];
    for (i, row) in integrals.iter_mut().enumerate() {
        for (j, integral) in row.iter_mut().enumerate() {
            // The rule is exact: the polynomials are of degree 4.
            let points = GAUSS_LEGENDRE_RULE.iter();
            *integral = points
                .map(|point| at(i) * point.weight * cardinal(j, at(i) * point.at))
                .sum();
        }
    }
    integrals
});

/// How the directors follow from the tangent.
#[derive(Clone, Debug)]
pub enum Directors {
    /// Any will do, as the rod is round: they do not turn about the tangent.
    Round,
    /// The curve lies in a plane with this normal, which is the director of this number, 1 or 2 for d2 or d3.
    Planar {
        /// Unit normal of the plane.
        normal: DVec3,
        /// 1: it is d2; 2: d3.
        director: usize,
    },
    /// The direction of the blade's normal, d3, was measured: here at the Gauss points, with its derivative by the
    /// parameter.
    Measured(Vec<[DVec3; 2]>),
}

/// Values at the end of an element of the polynomials that are 1 at one of its Gauss points and 0 at the others.
static END_VALUES: LazyLock<[f64; POINTS]> = LazyLock::new(|| {
    let at = |k: usize| GAUSS_LEGENDRE_RULE[k].at;
    std::array::from_fn(|j| {
        let others = (0..POINTS).filter(|&k| k != j);
        others.map(|k| (1.0 - at(k)) / (at(j) - at(k))).product()
    })
});

/// A force that the section at an end of an element holds off the axis.
#[derive(Clone, Copy, Debug)]
struct SectionLever {
    /// The number of the end; the last one is the tip.
    end: usize,
    force: DVec3,
    /// Along d2 and d3.
    offset: [f64; 2],
    /// d3 there, in the lab.
    third: DVec3,
    /// The derivative of the curve there less that of the polynomial through the Gauss points before.
    remainder: DVec3,
}

impl SectionLever {
    /// The lever on a curve with these derivatives at the Gauss points, which may be another one nearby: the section
    /// turns with the tangent, the shortest way.
    fn on_curve(&self, first: &[DVec3]) -> ForceOffAxis {
        let tangent = (end_value(self.end, first) + self.remainder).normalize_or_zero();
        let third = (self.third - self.third.dot(tangent) * tangent).normalize_or_zero();
        let [along_2, along_3] = self.offset;
        ForceOffAxis {
            end: self.end,
            force: self.force,
            arm: along_2 * third.cross(tangent) + along_3 * third,
        }
    }
}

/// The value at an end of an element of the polynomial through the Gauss points of the element before it.
fn end_value(end: usize, values: &[DVec3]) -> DVec3 {
    let own = &values[(end - 1) * POINTS..end * POINTS];
    own.iter().zip(*END_VALUES).map(|(v, part)| part * *v).sum()
}

/// A force off the axis on a curve.
#[derive(Clone, Copy, Debug)]
pub struct ForceOffAxis {
    /// The number of the end of an element where the section holds it; the last one is the tip.
    pub end: usize,
    /// The force.
    pub force: DVec3,
    /// From the axis to the force, in the lab.
    pub arm: DVec3,
}

/// The elements of a posture and what belongs to their Gauss points, whatever the curve.
#[derive(Clone, Debug)]
pub struct Elements {
    /// Ends of the elements, parameters from 0 to 1.
    pub edges: Vec<f64>,
    /// The parameters of the Gauss points.
    pub at: Vec<f64>,
    /// Stiffness at a modulus of 1.
    pub stiffness: Vec<[f64; 3]>,
    /// Load per length.
    pub load: Vec<DVec3>,
    /// Fraction of the length.
    pub sigma: Vec<f64>,
    /// Fractions of the length at the ends of the elements.
    pub ends: Vec<f64>,
    /// Forces on ends of elements: number of the element behind, and force. Those of the tip follow all.
    forces: Vec<(usize, DVec3)>,
    /// Those of them that act off the axis; see [`Elements::add_levers`].
    levers: Vec<SectionLever>,
}

/// A posture at the Gauss points.
#[derive(Clone, Debug)]
pub struct Line {
    /// |dr/dt|.
    pub speed: Vec<f64>,
    /// Unit tangents.
    pub tangent: Vec<DVec3>,
    /// Forces n, in the lab.
    pub force: Vec<DVec3>,
    /// Moments m, in the lab.
    pub moment: Vec<DVec3>,
    /// Length.
    pub length: f64,
    /// Forces off the axis.
    pub levers: Vec<ForceOffAxis>,
}

/// Moments in the lab at ends of elements and Gauss points, in their order.
pub struct Moments {
    /// The moments; at an end where a force acts off the axis, that behind it, but of the tip that before it.
    pub moments: Vec<DVec3>,
    /// The forces; at an end on which one acts, that behind it.
    pub forces: Vec<DVec3>,
    /// The length of the curve.
    pub length: f64,
}

impl Elements {
    /// The parameter of each Gauss point of elements with these ends.
    pub fn parameters(edges: &[f64]) -> Vec<f64> {
        let each = edges.windows(2);
        each.flat_map(|ends| {
            GAUSS_LEGENDRE_RULE
                .iter()
                .map(|point| ends[0] + point.at * (ends[1] - ends[0]))
        })
        .collect()
    }

    /// Elements for a curve, given by its derivatives by the parameter: ends at equal distances and where the rod
    /// has kinks.
    pub fn new(rod: &HangingRod, count: usize, curve: &dyn Fn(f64) -> CurvePoint) -> Elements {
        let even: Vec<f64> = (0..=count).map(|k| k as f64 / count as f64).collect();
        let (sigma, length) = fractions(&even, curve);
        let kinks = rod.kinks();
        let mut edges = even.clone();
        edges.extend(
            kinks
                .iter()
                .map(|&kink| parameter_at(kink, &even, &sigma, length, curve)),
        );
        edges.sort_by(f64::total_cmp);
        // An element far shorter than others is none: its end moves to the kink.
        let near = 0.05 / count as f64;
        let is_even = |edge: f64| even.contains(&edge) && edge > 0.0 && edge < 1.0;
        let all = edges.clone();
        edges.retain(|&edge| {
            !is_even(edge)
                || !all
                    .iter()
                    .any(|&other| !even.contains(&other) && (other - edge).abs() < near)
        });
        edges.dedup();
        Elements::with_edges(rod, edges, curve)
    }

    fn with_edges(
        rod: &HangingRod,
        edges: Vec<f64>,
        curve: &dyn Fn(f64) -> CurvePoint,
    ) -> Elements {
        let at = Elements::parameters(&edges);
        let (ends, length) = fractions(&edges, curve);
        let speed: Vec<f64> = at.iter().map(|&t| curve(t).first.length()).collect();
        let mut sigma = Vec::with_capacity(at.len());
        for (e, pair) in edges.windows(2).enumerate() {
            let width = pair[1] - pair[0];
            for i in 0..POINTS {
                let part: f64 = (0..POINTS)
                    .map(|j| PARTIAL_INTEGRALS[i][j] * speed[e * POINTS + j])
                    .sum();
                sigma.push(ends[e] + width * part / length);
            }
        }
        let place = |k: usize| RodPlace::within(sigma[k], [ends[k / POINTS], ends[k / POINTS + 1]]);
        let forces = rod.points.iter();
        let forces = forces.map(|point| (nearest_end(&ends, point.at), point.force));
        let mut forces: Vec<(usize, DVec3)> = forces.collect();
        forces.push((ends.len() - 1, rod.tip_force));
        Elements {
            stiffness: (0..at.len())
                .map(|k| Profile::values_of_three(rod.stiffness.each_ref(), place(k)))
                .collect(),
            load: (0..at.len()).map(|k| rod.load(place(k))).collect(),
            edges,
            at,
            sigma,
            ends,
            forces,
            levers: Vec::new(),
        }
    }

    /// Adds the levers of forces off the axis to a curve with these derivatives and directors at its ends and Gauss
    /// points, in their order.
    pub fn add_levers(&mut self, rod: &HangingRod, first: &[DVec3], directors: &[DMat3]) {
        let inner: Vec<DVec3> = inner_points(first).collect();
        let off_axis = rod.points.iter().filter(|point| point.is_off_axis());
        let levers = off_axis.map(|point| {
            let end = nearest_end(&self.ends, point.at);
            let place = end * (POINTS + 1);
            SectionLever {
                end,
                force: point.force,
                offset: point.offset,
                third: directors[place].z_axis,
                remainder: first[place] - end_value(end, &inner),
            }
        });
        self.levers = levers.collect();
    }

    /// Elements with ends at equal parts of the length and at the rod's kinks.
    pub fn at_equal_parts(
        rod: &HangingRod,
        parts: usize,
        curve: &dyn Fn(f64) -> CurvePoint,
    ) -> Elements {
        let even: Vec<f64> = (0..=parts).map(|k| k as f64 / parts as f64).collect();
        let (sigma, length) = fractions(&even, curve);
        let mut wanted = even.clone();
        wanted.extend(rod.kinks());
        wanted.sort_by(f64::total_cmp);
        wanted.dedup_by(|next, kept| *next - *kept < 1e-9);
        let inner = wanted[1..wanted.len() - 1].iter();
        let inner = inner.map(|&at| parameter_at(at, &even, &sigma, length, curve));
        let edges = [0.0].into_iter().chain(inner).chain([1.0]).collect();
        Elements::with_edges(rod, edges, curve)
    }

    /// Parameters of the ends of elements and of the Gauss points between them, in their order, and which are ends.
    pub fn ends_and_points(&self) -> (Vec<f64>, Vec<bool>) {
        let (mut at, mut is_end) = (vec![self.edges[0]], vec![true]);
        for (e, own) in self.at.chunks(POINTS).enumerate() {
            at.extend(own);
            is_end.extend([false; POINTS]);
            at.push(self.edges[e + 1]);
            is_end.push(true);
        }
        (at, is_end)
    }

    /// Fractions of the length of ends and Gauss points, in their order.
    pub fn sigma_everywhere(&self) -> Vec<f64> {
        let mut all = vec![0.0];
        for (e, own) in self.sigma.chunks(POINTS).enumerate() {
            all.extend(own);
            all.push(self.ends[e + 1]);
        }
        all
    }

    /// The stiffness at the end or Gauss point of this number in their order; at an end where it jumps that before it.
    pub fn stiffness_everywhere(&self, rod: &HangingRod, k: usize) -> [f64; 3] {
        let (e, own) = (k / (POINTS + 1), k % (POINTS + 1));
        match own {
            0 => Profile::values_of_three(rod.stiffness.each_ref(), self.ends[e]),
            own => self.stiffness[e * POINTS + own - 1],
        }
    }

    /// Moments at ends and Gauss points of a curve with these derivatives there, in their order.
    pub fn moments_everywhere(&self, first: &[DVec3]) -> Moments {
        let inner: Vec<DVec3> = inner_points(first).collect();
        let line = self.line(&inner);
        let (mut moments, mut forces) = (
            vec![DVec3::ZERO; first.len()],
            vec![DVec3::ZERO; first.len()],
        );
        let (mut behind, mut pull) = (DVec3::ZERO, DVec3::ZERO);
        for e in (0..self.edges.len() - 1).rev() {
            let own = e * POINTS..(e + 1) * POINTS;
            let last = (e + 1) * (POINTS + 1);
            let levers = line.levers.iter().filter(|lever| lever.end == e + 1);
            behind += levers
                .map(|lever| lever.arm.cross(lever.force))
                .sum::<DVec3>();
            if e + 2 == self.edges.len() {
                moments[last] = behind;
            }
            let turning = own
                .clone()
                .map(|k| self.weight(k) * inner[k].cross(line.force[k]));
            behind += turning.sum::<DVec3>();
            for (_, force) in self.forces.iter().filter(|(at, _)| *at == e + 1) {
                pull += *force;
            }
            if e + 2 == self.edges.len() {
                forces[last] = pull;
            }
            let loads = own
                .clone()
                .map(|k| self.weight(k) * line.speed[k] * self.load[k]);
            pull += loads.sum::<DVec3>();
            moments[e * (POINTS + 1)] = behind;
            forces[e * (POINTS + 1)] = pull;
            for (i, k) in own.enumerate() {
                moments[e * (POINTS + 1) + 1 + i] = line.moment[k];
                forces[e * (POINTS + 1) + 1 + i] = line.force[k];
            }
        }
        Moments {
            moments,
            forces,
            length: line.length,
        }
    }

    /// Number of Gauss points.
    pub fn count(&self) -> usize {
        self.at.len()
    }

    /// The width of the element of a Gauss point, in the parameter.
    pub fn width(&self, k: usize) -> f64 {
        self.edges[k / POINTS + 1] - self.edges[k / POINTS]
    }

    /// The weight of a Gauss point in an integral over the parameter.
    pub fn weight(&self, k: usize) -> f64 {
        self.width(k) * GAUSS_LEGENDRE_RULE[k % POINTS].weight
    }

    /// Integrals from the tip back to the Gauss points, of values there; `jumps` are added at ends of elements.
    fn integrate_from_tip(&self, values: &[DVec3], jumps: &[(usize, DVec3)]) -> Vec<DVec3> {
        let count = self.edges.len() - 1;
        let mut found = vec![DVec3::ZERO; values.len()];
        let mut behind = DVec3::ZERO;
        for e in (0..count).rev() {
            for (_, jump) in jumps.iter().filter(|(at, _)| *at == e + 1) {
                behind += *jump;
            }
            let width = self.edges[e + 1] - self.edges[e];
            let own = &values[e * POINTS..(e + 1) * POINTS];
            let whole: DVec3 = own
                .iter()
                .zip(&GAUSS_LEGENDRE_RULE)
                .map(|(v, p)| p.weight * *v)
                .sum();
            for i in 0..POINTS {
                let part: DVec3 = (0..POINTS).map(|j| PARTIAL_INTEGRALS[i][j] * own[j]).sum();
                found[e * POINTS + i] = behind + width * (whole - part);
            }
            behind += width * whole;
        }
        found
    }

    /// Forces and moments of the curve with these derivatives dr/dt at the Gauss points.
    pub fn line(&self, first: &[DVec3]) -> Line {
        let speed: Vec<f64> = first.iter().map(|d| d.length()).collect();
        let loads: Vec<DVec3> = self.load.iter().zip(&speed).map(|(f, v)| *v * *f).collect();
        let force = self.integrate_from_tip(&loads, &self.forces);
        let turning: Vec<DVec3> = first.iter().zip(&force).map(|(d, n)| d.cross(*n)).collect();
        let levers: Vec<ForceOffAxis> = self.levers.iter().map(|it| it.on_curve(first)).collect();
        let jumps = levers.iter();
        let jumps: Vec<_> = jumps.map(|it| (it.end, it.arm.cross(it.force))).collect();
        let moment = self.integrate_from_tip(&turning, &jumps);
        Line {
            length: (0..speed.len()).map(|k| self.weight(k) * speed[k]).sum(),
            tangent: first.iter().zip(&speed).map(|(d, v)| *d / *v).collect(),
            speed,
            force,
            moment,
            levers,
        }
    }
}

/// Levers whose moments out of a plane are below this part of them balance each other.
const BALANCED: f64 = 1e-9;

impl Line {
    /// Whether the forces off the axis, all of which are along the plane with this normal, have moments within it alone:
    /// those beside it are alike on both sides.
    pub fn has_levers_alike_on_both_sides(&self, normal: DVec3) -> bool {
        self.levers.iter().all(|lever| {
            let here = self.levers.iter().filter(|it| it.end == lever.end);
            let (mut sum, mut size) = (DVec3::ZERO, 0.0);
            for it in here {
                sum += it.arm.dot(normal) * it.force;
                size += it.arm.length() * it.force.length();
            }
            sum.length() <= BALANCED * size
        })
    }
}

/// The end of an element, but the base, that is nearest to a fraction of the length.
fn nearest_end(ends: &[f64], at: f64) -> usize {
    let off = |k: usize| (ends[k] - at).abs();
    let nearest = (1..ends.len()).min_by(|&a, &b| off(a).total_cmp(&off(b)));
    nearest.unwrap_or(ends.len() - 1)
}

/// Of values at ends and Gauss points those at the latter.
fn inner_points(values: &[DVec3]) -> impl Iterator<Item = DVec3> {
    let counted = values.iter().enumerate();
    counted
        .filter(|(k, _)| k % (POINTS + 1) != 0)
        .map(|(_, value)| *value)
}

/// Fractions of the length at ends of elements, and the length.
fn fractions(edges: &[f64], curve: &dyn Fn(f64) -> CurvePoint) -> (Vec<f64>, f64) {
    let mut along = vec![0.0];
    for pair in edges.windows(2) {
        let width = pair[1] - pair[0];
        let part: f64 = (GAUSS_LEGENDRE_RULE.iter())
            .map(|point| point.weight * curve(pair[0] + point.at * width).first.length())
            .sum();
        along.push(along[along.len() - 1] + width * part);
    }
    let length = along[along.len() - 1];
    along.iter_mut().for_each(|one| *one /= length);
    (along, length)
}

/// The parameter at a fraction of the length, by Newton's method in the element where it lies.
fn parameter_at(
    wanted: f64,
    edges: &[f64],
    sigma: &[f64],
    length: f64,
    curve: &dyn Fn(f64) -> CurvePoint,
) -> f64 {
    let e = sigma
        .partition_point(|&one| one <= wanted)
        .clamp(1, edges.len() - 1)
        - 1;
    let part = (wanted - sigma[e]) / (sigma[e + 1] - sigma[e]);
    let mut t = edges[e] + part * (edges[e + 1] - edges[e]);
    for _ in 0..8 {
        let width = t - edges[e];
        let reached: f64 = (GAUSS_LEGENDRE_RULE.iter())
            .map(|point| width * point.weight * curve(edges[e] + point.at * width).first.length())
            .sum();
        let missing = (wanted - sigma[e]) * length - reached;
        t = (t + missing / curve(t).first.length()).clamp(edges[e], edges[e + 1]);
    }
    t
}

impl Directors {
    /// The directors at a Gauss point with this tangent.
    pub fn at(&self, k: usize, tangent: DVec3) -> DMat3 {
        let complete = |third: DVec3| DMat3::from_cols(tangent, third.cross(tangent), third);
        match self {
            Directors::Round => complete(tangent.any_orthonormal_vector()),
            Directors::Planar {
                normal,
                director: 1,
            } => DMat3::from_cols(tangent, *normal, tangent.cross(*normal)),
            Directors::Planar { normal, .. } => complete(*normal),
            Directors::Measured(normals) => {
                let normal = normals[k][0];
                complete((normal - normal.dot(tangent) * tangent).normalize_or_zero())
            }
        }
    }
}
