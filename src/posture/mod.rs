//! The posture of a hanging leaf or stem, and the least stiffness that it proves.
//!
//! A single rod with dead loads is clamped at its base and free at its tip; its stiffness is Young's modulus E times
//! known moments of area, and it neither stretches nor shears. Forces and moments along a posture that was measured
//! do not ask for E ([`mod@line`]), so that every E has a curvature at rest, u0 = u - A^-1 m/E, with which the leaf rests
//! in this posture. A posture that is seen is stable: E is at least [`Posture::critical_young`], the largest
//! eigenvalue of the second variation ([`second_variation`]).

pub mod frame;
pub mod intervals;
pub mod leaf;
pub mod line;
mod measured;
pub mod points;
pub mod rest;
pub mod rod;
pub mod second_variation;
pub mod smoothing;
pub mod two_postures;

use crate::numbers::GAUSS_LEGENDRE_RULE;
use crate::posture::frame::{BaseFrame, FrameRule, vertical_plane};
use crate::posture::line::{Directors, Elements, Line};
use crate::posture::points::{PostureError, PosturePoints};
use crate::posture::rod::HangingRod;
use crate::posture::second_variation::{CriticalMode, SecondVariation};
use crate::posture::smoothing::{CurvePoint, SmoothedCurve};
use crate::words;
use glam::DVec3;
use std::fmt;
use std::sync::Arc;

words! {
    /// The directions in which a leaf would leave its posture first.
    pub enum Governing {
        /// It would bend further within the plane of its posture.
        InPlane = "in-plane",
        /// It would twist and bend out of that plane.
        OutOfPlane = "out-of-plane",
        /// The posture lies in no plane, or forces off the axis lead out of it.
        Spatial = "spatial",
    }
}

/// Moduli beyond this many of a ladder are not told.
const MOST_RUNGS: usize = 8;

/// Eigenvalues below this fraction of the largest size are zero within rounding.
const ROUNDING: f64 = 1e-9;

/// A curve r(t), 0 <= t <= 1, in place of points.
pub type GivenCurve = Arc<dyn Fn(f64) -> CurvePoint + Send + Sync>;

/// The centreline of a posture.
#[derive(Clone)]
pub enum Centreline {
    /// Smoothed points.
    Smoothed(Box<SmoothedCurve>),
    /// A curve that is known.
    Given(GivenCurve),
}

impl fmt::Debug for Centreline {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Centreline::Smoothed(curve) => curve.fmt(f),
            Centreline::Given(_) => f.write_str("Given"),
        }
    }
}

impl Centreline {
    /// The curve at a parameter.
    pub fn at(&self, t: f64) -> CurvePoint {
        match self {
            Centreline::Smoothed(smoothed) => smoothed.curve.at(t),
            Centreline::Given(curve) => curve(t),
        }
    }
}

/// The least modulus of a stable posture.
#[derive(Clone, Debug)]
pub struct CriticalModulus {
    /// E*; zero if the posture is stable at any modulus.
    pub value: f64,
    /// Standard deviation of its logarithm by the noise of the points, to first order; zero of a curve that is known.
    pub relative_deviation: f64,
    /// The direction in which the leaf would leave its posture.
    pub governing: Governing,
    /// Fraction of the length where the critical mode bends or twists most.
    pub at: f64,
    /// Fractions of the length between which nine tenths of its bending energy lie.
    pub stretch: [f64; 2],
}

/// The eigenvalues of one part of the second variation.
#[derive(Clone, Debug)]
pub(crate) struct Part {
    governing: Governing,
    pub directors: Directors,
    about: &'static [usize],
    eigenvalues: Vec<f64>,
}

/// A posture with its forces and moments, and its stability at every modulus.
#[derive(Clone, Debug)]
pub struct Posture {
    /// The rod.
    pub rod: HangingRod,
    /// Its centreline.
    pub centreline: Centreline,
    /// The directors at the base.
    pub base: BaseFrame,
    /// How directors follow along the leaf.
    pub frame_rule: FrameRule,
    /// Gauss points for the second variation.
    pub elements: Elements,
    /// Forces and moments there.
    pub line: Line,
    /// The least modulus.
    pub critical: CriticalModulus,
    /// The critical mode, unless the posture is stable at any modulus.
    pub mode: Option<CriticalMode>,
    /// Points off the plane in which the posture was taken to lie: the largest distance.
    pub off_plane: Option<f64>,
    pub(crate) parts: Vec<Part>,
}

impl Posture {
    /// The posture of a known curve, which lies in the plane with this unit normal, if any; `elements` is the number
    /// of elements of the second variation, whose eigenvalues converge as its tenth power.
    ///
    /// # Errors
    /// A spatial curve of an anisotropic section.
    pub fn from_curve(
        rod: HangingRod,
        curve: GivenCurve,
        plane: Option<DVec3>,
        elements: usize,
    ) -> Result<Posture, PostureError> {
        let samples = (0..=16).map(|k| curve(k as f64 / 16.0).position).collect();
        let points = PosturePoints {
            plane,
            ..PosturePoints::in_space(samples)
        };
        let chosen = frame::choose(&rod, &points)?;
        let centreline = Centreline::Given(curve);
        Ok(Posture::assemble(
            rod,
            centreline,
            chosen.plane,
            FrameRule::Transported,
            elements,
        ))
    }

    pub(crate) fn assemble(
        rod: HangingRod,
        centreline: Centreline,
        plane: Option<DVec3>,
        frame_rule: FrameRule,
        count: usize,
    ) -> Posture {
        let mut elements = Elements::new(&rod, count, &|t| centreline.at(t));
        let base = BaseFrame::new(
            centreline.at(0.0).first,
            centreline.at(1.0).position - centreline.at(0.0).position,
            plane,
            &frame_rule,
        );
        if rod.has_levers() {
            let (at, _) = elements.ends_and_points();
            let curve: Vec<CurvePoint> = at.iter().map(|&t| centreline.at(t)).collect();
            let first: Vec<DVec3> = curve.iter().map(|point| point.first).collect();
            let positions: Vec<DVec3> = curve.iter().map(|point| point.position).collect();
            let tangents: Vec<DVec3> = first.iter().map(|d| d.normalize_or_zero()).collect();
            let frames = frame_rule.along(base.rotation(), &at, &positions, &tangents);
            elements.add_levers(&rod, &first, &frames);
        }
        let at = elements.at.iter();
        let first: Vec<DVec3> = at.map(|&t| centreline.at(t).first).collect();
        let line = elements.line(&first);
        let mut parts = Vec::new();
        let mut add = |governing, directors: Directors, about: &'static [usize]| {
            let problem = SecondVariation::new(&elements, &line, &directors, about);
            let eigenvalues = problem.eigenvalues();
            parts.push(Part {
                governing,
                directors,
                about,
                eigenvalues,
            });
        };
        match (plane, frame_rule.directors(&elements)) {
            (_, Some(measured)) => add(Governing::Spatial, measured, &[0, 1, 2]),
            (Some(normal), None) => {
                let is_split = line.has_levers_alike_on_both_sides(normal);
                // A round section may take its plane's normal as d2, wherever that is.
                let director = if vertical_plane(normal) || rod.is_round() {
                    1
                } else {
                    2
                };
                let directors = Directors::Planar { normal, director };
                let (inside, outside): (&[usize], &[usize]) = match director {
                    1 => (&[1], &[0, 2]),
                    _ => (&[2], &[0, 1]),
                };
                match is_split {
                    true => {
                        add(Governing::InPlane, directors.clone(), inside);
                        add(Governing::OutOfPlane, directors, outside);
                    }
                    false => add(Governing::Spatial, directors, &[0, 1, 2]),
                }
            }
            (None, None) => add(Governing::Spatial, Directors::Round, &[0, 1, 2]),
        }
        let mut posture = Posture {
            rod,
            centreline,
            base,
            frame_rule,
            elements,
            line,
            critical: CriticalModulus {
                value: 0.0,
                relative_deviation: 0.0,
                governing: Governing::Spatial,
                at: 0.0,
                stretch: [0.0, 1.0],
            },
            mode: None,
            off_plane: None,
            parts,
        };
        posture.find_critical();
        posture
    }

    /// The part of the second variation with the largest eigenvalue.
    fn critical_part(&self) -> &Part {
        let largest = |part: &Part| part.eigenvalues.first().copied().unwrap_or(0.0);
        let mut best = &self.parts[0];
        for part in &self.parts[1..] {
            if largest(part) > largest(best) {
                best = part;
            }
        }
        best
    }

    fn find_critical(&mut self) {
        let part = self.critical_part();
        let largest = part.eigenvalues[0];
        let governing = part.governing;
        let sizes = self.parts.iter().flat_map(|part| &part.eigenvalues);
        let size = sizes.fold(0.0_f64, |size, mu| size.max(mu.abs()));
        let problem = SecondVariation::new(&self.elements, &self.line, &part.directors, part.about);
        let mode = match largest > ROUNDING * size {
            true => problem.mode(largest),
            false => None,
        };
        if let Some(mode) = &mode {
            let density = mode.bending_density(&self.elements, &self.line, &part.directors);
            let most = (0..density.len()).max_by(|&a, &b| density[a].total_cmp(&density[b]));
            self.critical.at = match most {
                // The first and the last Gauss point stand for the base and the tip beside them.
                None | Some(0) => 0.0,
                Some(k) if k + 1 == density.len() => 1.0,
                Some(k) => self.elements.sigma[k],
            };
            self.critical.value = largest;
            let whole: f64 = (0..density.len())
                .map(|k| self.elements.weight(k) * density[k])
                .sum();
            let (mut sum, mut ends) = (0.0, [0.0, 1.0]);
            for k in 0..density.len() {
                let next = sum + self.elements.weight(k) * density[k] / whole;
                for (end, part) in ends.iter_mut().zip([0.05, 0.95]) {
                    if sum < part && next >= part {
                        *end = match k {
                            0 => 0.0,
                            k => self.elements.sigma[k],
                        };
                    }
                }
                sum = next;
            }
            self.critical.stretch = ends;
        }
        self.critical.governing = governing;
        self.mode = mode;
    }

    /// The directors in which the critical mode was found.
    pub(crate) fn critical_directors(&self) -> &Directors {
        &self.critical_part().directors
    }

    /// E*: the posture is stable at larger moduli alone.
    pub fn critical_young(&self) -> f64 {
        self.critical.value
    }

    /// Number of negative eigenvalues of the energy's second variation in this posture at a modulus.
    pub fn index(&self, young: f64) -> usize {
        let all = self.parts.iter().flat_map(|part| &part.eigenvalues);
        all.filter(|mu| **mu > young).count()
    }

    /// The moduli at which the index changes, the largest first, at most eight of them.
    pub fn ladder(&self) -> Vec<f64> {
        let mut rungs: Vec<f64> = (self.parts.iter())
            .flat_map(|part| &part.eigenvalues)
            .copied()
            .filter(|mu| *mu > 1e-6 * self.critical.value && *mu > 0.0)
            .collect();
        rungs.sort_by(|a, b| b.total_cmp(a));
        rungs.truncate(MOST_RUNGS);
        rungs
    }

    /// The length of the posture.
    pub fn length(&self) -> f64 {
        self.line.length
    }

    /// The smoothing, if the posture is one of points.
    pub fn smoothing(&self) -> Option<&SmoothedCurve> {
        match &self.centreline {
            Centreline::Smoothed(smoothed) => Some(smoothed),
            Centreline::Given(_) => None,
        }
    }

    /// The fractions of the length at parameters, which ascend.
    pub fn fractions_of(&self, at: &[f64]) -> Vec<f64> {
        let (mut reached, mut sum) = (0.0, 0.0);
        let mut along = |to: f64| {
            // Intervals between knots are longer than this.
            let steps = (64.0 * (to - reached)).ceil().max(1.0);
            let width = (to - reached) / steps;
            for k in 0..steps as usize {
                let from = reached + k as f64 * width;
                let points = GAUSS_LEGENDRE_RULE.iter();
                let speeds = points
                    .map(|p| p.weight * self.centreline.at(from + p.at * width).first.length());
                sum += width * speeds.sum::<f64>();
            }
            reached = to;
            sum
        };
        let each: Vec<f64> = at.iter().map(|&t| along(t)).collect();
        let whole = along(1.0);
        each.into_iter().map(|one| one / whole).collect()
    }

    /// Whether the posture was taken to lie in a plane.
    pub fn is_planar(&self) -> bool {
        let first = self.parts.first();
        first.is_some_and(|part| matches!(part.directors, Directors::Planar { .. }))
    }
}
