//! Colours of the figure.

/// Red, green, blue.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Color(pub u8, pub u8, pub u8);

pub const WHITE: Color = Color(255, 255, 255);
/// Titles and markers.
pub const INK: Color = Color(32, 32, 36);
/// Axis labels and notes.
pub const NOTE: Color = Color(84, 84, 92);
/// Frames of panels.
pub const FRAME: Color = Color(120, 120, 128);
/// Grid lines.
pub const GRID: Color = Color(226, 227, 232);
/// The floor of the panel in space.
pub const FLOOR: Color = Color(247, 247, 249);
/// Shadows on that floor.
pub const SHADOW: Color = Color(212, 213, 220);

/// Points of a second solution.
pub const DOT: Color = Color(213, 60, 30);

/// Colours that must be told apart, also by the colour-blind (after Okabe and Ito).
pub const BLUE: Color = Color(0, 114, 178);
pub const SKY: Color = Color(86, 170, 225);
pub const GREEN: Color = Color(0, 158, 115);
pub const VERMILION: Color = Color(213, 94, 0);
pub const PURPLE: Color = Color(170, 90, 150);
pub const ORANGE: Color = Color(230, 159, 0);
pub const BROWN: Color = Color(120, 80, 45);
pub const SLATE: Color = Color(60, 60, 66);

/// Of curves in one panel, in this order.
pub const CURVES: [Color; 8] = [BLUE, GREEN, VERMILION, PURPLE, ORANGE, SKY, BROWN, SLATE];

/// Viridis (Smith and van der Walt, matplotlib) at equal distances.
const VIRIDIS: [Color; 11] = [
    Color(68, 1, 84),
    Color(72, 36, 117),
    Color(65, 68, 135),
    Color(53, 95, 141),
    Color(42, 120, 142),
    Color(33, 145, 140),
    Color(34, 168, 132),
    Color(68, 191, 112),
    Color(122, 209, 81),
    Color(189, 223, 38),
    Color(253, 231, 37),
];

/// The bright end of viridis is left out: thin yellow lines vanish on white.
const BRIGHTEST: f64 = 0.88;

/// The colour of a vein: `t` runs from 0 at one edge of the leaf to 1 at the other.
pub fn vein_color(t: f64) -> Color {
    let place = BRIGHTEST * t.clamp(0.0, 1.0) * (VIRIDIS.len() - 1) as f64;
    let left = (place as usize).min(VIRIDIS.len() - 2);
    let (a, b) = (VIRIDIS[left], VIRIDIS[left + 1]);
    let mix = |a: u8, b: u8| {
        let (a, b) = (f64::from(a), f64::from(b));
        (a + (place - left as f64) * (b - a)).round() as u8
    };
    Color(mix(a.0, b.0), mix(a.1, b.1), mix(a.2, b.2))
}
