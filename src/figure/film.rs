//! A leaf that moves as a GIF, seen as in the film strip.

use std::collections::HashMap;
use std::io::{self, Write};

use glam::{DVec2, DVec3};
use rayon::prelude::*;
use tiny_skia::Pixmap;

use super::drawing::{Anchor, Color, DOT, Drawing, INK, NOTE, WHITE, vein_color};
use super::page::{Cell, TEXT_SIZE};
use super::png::paint;
use super::space::{Room, Scene, surrounding_box};
use super::veins::Veins;
use crate::report::numbers::short;
use crate::simulate::{Record, Still};

/// How long the film lasts, in hundredths of a second, and of how many pictures.
const DURATION: usize = 1000;
const MOST_PICTURES: usize = 140;

/// Half its pixels.
const SIZE: DVec2 = DVec2::new(320.0, 240.0);
const TITLE: f64 = 26.0;

const ROOM: Room = Room {
    left: 34.0,
    right: 30.0,
    below: 30.0,
};

/// Stands for a pixel that is as before.
const SAME: u8 = 255;

/// The film; nothing but one picture where nothing is known to move.
///
/// # Errors
/// Those of `out`.
pub fn write(record: &Record, out: &mut dyn Write) -> io::Result<()> {
    let film = match record.film.as_slice() {
        [] => &record.stills,
        film => film,
    };
    let stride = film.len().div_ceil(MOST_PICTURES).max(1);
    let shown: Vec<&Still> = film.iter().step_by(stride).collect();
    let shapes: Vec<Veins> = shown.iter().map(|still| veins(record, still)).collect();
    let boxes = shapes.iter().map(|veins| (veins.low, veins.high));
    let all = boxes.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
    let (low, high) = all.unwrap_or_default();
    let bounds = surrounding_box(low, high);
    let pictures: Vec<Vec<u8>> = (shapes.par_iter().zip(&shown))
        .map_init(Palette::new, |palette, (veins, still)| {
            let time = record.moments.get(still.moment).map_or(0.0, |m| m.time);
            let text = format!("{}, t = {}", record.scenario, short(time));
            palette.indices(&paint(&picture(veins, bounds, &text)))
        })
        .collect();
    let delay = (DURATION / pictures.len().max(1)).clamp(4, 100) as u16;
    encode(&pictures, delay, out).map_err(io::Error::other)
}

fn veins(record: &Record, still: &Still) -> Veins {
    let joined = if record.joined { 1 } else { still.curves.len() };
    let ends = still.curves.iter().take(joined);
    let tips: Vec<DVec3> = ends.filter_map(|curve| curve.last()).copied().collect();
    Veins::through(&still.curves, &tips, record.length)
}

fn picture(veins: &Veins, bounds: [DVec3; 2], text: &str) -> Drawing {
    let mut page = Drawing::new(SIZE.x, text);
    page.height = SIZE.y;
    let cell = Cell {
        corner: DVec2::new(0.0, TITLE),
        size: SIZE - DVec2::new(0.0, TITLE),
    };
    let scene = Scene::new(bounds, cell, ROOM, None);
    scene.draw_box(&mut page);
    scene.draw_labels(&mut page);
    scene.draw_names(&mut page, 26.0);
    scene.draw_leaf(&mut page, veins, 0.75 * veins.line_width());
    let corner = DVec2::new(10.0, 17.0);
    page.label(corner, text, TEXT_SIZE, Anchor::Start, INK);
    page
}

/// Colours of veins between white and full, greys, and those of markers.
struct Palette {
    colors: Vec<Color>,
    known: HashMap<[u8; 3], u8>,
}

impl Palette {
    fn new() -> Self {
        let mut colors = vec![WHITE, INK, NOTE, DOT];
        let mix = |Color(r, g, b): Color, part: f64| {
            let of = |x: u8| (255.0 + part * (f64::from(x) - 255.0)).round() as u8;
            Color(of(r), of(g), of(b))
        };
        for grey in 1..=42 {
            colors.push(mix(Color(20, 20, 24), f64::from(grey) / 42.0));
        }
        for vein in 0..34 {
            let color = vein_color(f64::from(vein) / 33.0);
            colors.extend([1.0, 0.8, 0.6, 0.45, 0.3, 0.15].map(|part| mix(color, part)));
        }
        colors.truncate(usize::from(SAME));
        Palette {
            colors,
            known: HashMap::new(),
        }
    }

    /// The nearest colour of every pixel.
    fn indices(&mut self, pixels: &Pixmap) -> Vec<u8> {
        let rgb = pixels.data().chunks_exact(4);
        rgb.map(|rgba| {
            let rgb = [rgba[0], rgba[1], rgba[2]];
            *self.known.entry(rgb).or_insert_with(|| {
                let far = |Color(r, g, b): &Color| {
                    let by = |a: u8, b: u8| (i32::from(a) - i32::from(b)).pow(2);
                    by(*r, rgb[0]) + by(*g, rgb[1]) + by(*b, rgb[2])
                };
                let nearest = self
                    .colors
                    .iter()
                    .enumerate()
                    .min_by_key(|(_, color)| far(color));
                nearest.map_or(0, |(index, _)| index as u8)
            })
        })
        .collect()
    }
}

/// Of each picture only what differs from the one before.
fn encode(pictures: &[Vec<u8>], delay: u16, out: &mut dyn Write) -> Result<(), gif::EncodingError> {
    let [width, height] = (2.0 * SIZE).to_array().map(|pixels| pixels as u16);
    let palette = Palette::new().colors;
    let mut table: Vec<u8> = palette
        .iter()
        .flat_map(|&Color(r, g, b)| [r, g, b])
        .collect();
    table.resize(3 * 256, 0);
    let mut encoder = gif::Encoder::new(out, width, height, &table)?;
    encoder.set_repeat(gif::Repeat::Infinite)?;
    let mut before: Option<&Vec<u8>> = None;
    for picture in pictures {
        let (rows, pixels) = changed(before, picture, usize::from(width));
        encoder.write_frame(&gif::Frame {
            delay,
            top: rows.start as u16,
            width,
            height: rows.len() as u16,
            transparent: before.map(|_| SAME),
            dispose: gif::DisposalMethod::Keep,
            buffer: pixels.into(),
            ..gif::Frame::default()
        })?;
        before = Some(picture);
    }
    Ok(())
}

/// The rows in which a picture differs from the one before, at least one, and their
/// pixels.
fn changed(
    before: Option<&Vec<u8>>,
    picture: &[u8],
    width: usize,
) -> (std::ops::Range<usize>, Vec<u8>) {
    let Some(before) = before else {
        return (0..picture.len() / width, picture.to_vec());
    };
    let pixels = before.iter().zip(picture);
    let pixels: Vec<u8> = pixels
        .map(|(a, b)| if a == b { SAME } else { *b })
        .collect();
    let differs = |pixel: &u8| *pixel != SAME;
    let first = pixels.iter().position(differs).unwrap_or(0) / width;
    let last = pixels.iter().rposition(differs).unwrap_or(0) / width;
    (
        first..last + 1,
        pixels[first * width..(last + 1) * width].to_vec(),
    )
}
