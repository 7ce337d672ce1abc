//! The modes of a leaf at rest: the leaf and, over it, its shape in each mode.

use std::io::{self, Write};

use glam::DVec3;

use super::colors::{DOT, FRAME};
use super::drawing::{Anchor, Drawing, Stroke};
use super::energy::short;
use super::flat::{curve, title};
use super::header;
use super::markers::{clamp_marker, tip_markers};
use super::page::{TEXT_SIZE, WIDTH};
use super::space::{self, draw_box, draw_veins};
use super::strip::{SIDE, Strip, THINNER};
use super::veins::Veins;
use super::{png, svg};
use crate::relax::{Equilibrium, Mode};
use crate::report::Format;
use crate::report::words::verdict;

/// Modes that are drawn, at most.
const MOST: usize = 12;

/// Largest displacement drawn, as a part of the leaf's extent.
const AMPLITUDE: f64 = 0.2;

/// The figure of the modes, as SVG or PNG.
pub struct ModesFigure {
    file: &'static str,
    write: fn(&Drawing, &mut dyn Write) -> io::Result<()>,
}

impl ModesFigure {
    /// `modes.svg`.
    pub const SVG: Self = ModesFigure {
        file: "modes.svg",
        write: svg::write_drawing,
    };
    /// `modes.png`.
    pub const PNG: Self = ModesFigure {
        file: "modes.png",
        write: png::write_drawing,
    };
}

impl Format<Equilibrium> for ModesFigure {
    fn file_name(&self) -> &'static str {
        self.file
    }

    fn write(&self, equilibrium: &Equilibrium, out: &mut dyn Write) -> io::Result<()> {
        (self.write)(&draw(equilibrium), out)
    }
}

/// The whole page.
fn draw(equilibrium: &Equilibrium) -> Drawing {
    let name = format!("{}: modes", equilibrium.scenario);
    let rest = Veins::of(equilibrium);
    let modes = equilibrium.stability.modes.as_deref().unwrap_or_default();
    let drawn = &modes[..modes.len().min(MOST)];
    let shapes: Vec<Veins> = drawn
        .iter()
        .map(|mode| displaced(equilibrium, &rest, mode))
        .collect();
    let strip = Strip::holding(shapes.iter().chain([&rest]), drawn.len());
    let mut drawing = Drawing {
        width: WIDTH,
        height: strip.end(),
        description: name.clone(),
        marks: Vec::new(),
    };
    drawing.group("header", |page| {
        let mut notes = vec![format!("N = {}", rest.count), verdict(equilibrium)];
        notes.push(match modes.len() {
            count if count > MOST => format!("the lowest {MOST} of {count}"),
            count => format!("the lowest {count}"),
        });
        notes.push("grey: at rest".into());
        notes.extend(rest.notes());
        header::draw_from(SIDE, page, &name, &notes, &rest);
    });
    for (index, (mode, veins)) in drawn.iter().zip(&shapes).enumerate() {
        let camera = strip.camera(index);
        drawing.group("mode", |page| {
            let corner = strip.cell(index).corner;
            let letter = (index + 1).to_string();
            caption(page, corner, &letter, mode);
            let edges = strip.edges(&camera);
            draw_box(page, &camera, strip.low, strip.high, &edges);
            if index == 0 {
                for edge in &edges {
                    space::name(page, &camera, edge, 9.0);
                }
            }
            let thin = THINNER * veins.line_width();
            for vein in &rest.veins {
                let path = curve(vein, |point| camera.place(point));
                page.stroke(path, Stroke::new(FRAME, 0.6 * thin));
            }
            draw_veins(page, &camera, veins, strip.low.z, thin);
            clamp_marker(page, camera.place(DVec3::ZERO));
            tip_markers(page, veins, |tip| camera.place(tip));
        });
    }
    drawing
}

/// The frequency of a mode; of an unstable one its growth, in red.
fn caption(page: &mut Drawing, corner: glam::DVec2, number: &str, mode: &Mode) {
    match (mode.is_neutral(), mode.growth()) {
        (true, _) => title(page, corner, number, "neutral: ω = 0"),
        (_, None) => {
            let frequency = mode.frequency().unwrap_or_default();
            title(page, corner, number, &format!("ω = {}", short(frequency)));
        }
        (_, Some(growth)) => {
            title(page, corner, number, "");
            let at = corner + glam::DVec2::new(24.0, -8.0);
            let text = format!("unstable: grows at {}", short(growth));
            page.label(at, &text, TEXT_SIZE, Anchor::Start, DOT);
        }
    }
}

/// The leaf moved along a mode.
fn displaced(equilibrium: &Equilibrium, rest: &Veins, mode: &Mode) -> Veins {
    let far = |shape: &[DVec3]| shape.iter().fold(0.0_f64, |m, d| m.max(d.length()));
    let largest = mode.displacement.iter().fold(0.0, |m, d| far(d).max(m));
    let size = match largest > 0.0 {
        // Never larger than it is handed out: a mode of rotation alone.
        true => (AMPLITUDE * rest.extent() * rest.unit / largest).min(1.0),
        false => 0.0,
    };
    let curves: Vec<Vec<DVec3>> = equilibrium
        .shape
        .curves
        .iter()
        .zip(&mode.displacement)
        .map(|(curve, by)| curve.iter().zip(by).map(|(x, d)| x + size * d).collect())
        .collect();
    let joined = if equilibrium.shape.joined {
        1
    } else {
        curves.len()
    };
    let ends = curves.iter().take(joined);
    let tips: Vec<DVec3> = ends.filter_map(|curve| curve.last()).copied().collect();
    Veins::through(&curves, &tips, rest.unit)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;

    fn shaking(eigenvalue: f64, size: f64) -> Equilibrium {
        let mut leaf = sample::fan(3, 8);
        let shape = vec![vec![size * DVec3::Z; 9]; 3];
        let mode = Mode {
            eigenvalue,
            error: Some(1e-9),
            displacement: shape.clone(),
            rotation: shape,
        };
        leaf.stability.modes = Some(vec![mode; 14]);
        leaf.stability.mode_shapes = true;
        leaf
    }

    fn svg(leaf: &Equilibrium) -> String {
        let mut bytes = Vec::new();
        ModesFigure::SVG.write(leaf, &mut bytes).unwrap();
        String::from_utf8(bytes).unwrap()
    }

    #[test]
    fn frequencies_growth_and_neutral_modes_are_told() {
        for (eigenvalue, text) in [
            (4.0, "ω = 2<"),
            (-9.0, "unstable: grows at 3<"),
            (1e-10, "neutral"),
        ] {
            let svg = svg(&shaking(eigenvalue, 1.0));
            assert_eq!(svg.matches(text).count(), MOST, "{text}");
            assert!(svg.contains("the lowest 12 of 14"));
        }
    }

    #[test]
    fn shapes_gone_wild_are_drawn_without_a_panic() {
        for wild in [0.0, f64::NAN, f64::INFINITY, 1e300, -1e-300] {
            let svg = svg(&shaking(wild, wild));
            assert!(!svg.contains("NaN") && !svg.contains("inf"), "{wild}");
        }
    }
}
