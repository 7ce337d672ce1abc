//! A photograph of the leaf: the table `[photo]`.

use crate::scenario::format::entries::Entries;
use crate::scenario::format::error::ScenarioResult;
use crate::scenario::format::item::EntryValue;
use crate::scenario::format::{Key, NumberRange};
use glam::DVec3;

/// How a photograph shows a leaf: as seen from far away along an axis, pixels counted to the right
/// and down.
#[derive(Clone, Debug, PartialEq)]
pub struct Photo {
    /// Length that a pixel shows; positive.
    pub scale: f64,
    /// The pixel of the origin.
    pub origin: [f64; 2],
    /// Angle by which the picture is turned counterclockwise, in radians.
    pub rotation: f64,
    /// The direction to the right in a picture that is not turned: along an axis, or against it.
    pub right: DVec3,
    /// The direction upwards in a picture that is not turned: along another axis, or against it.
    pub up: DVec3,
}

/// The derivative of a photograph by a parameter.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PhotoParameterDerivative {
    scale: f64,
    origin: [f64; 2],
    rotation: f64,
}

impl Photo {
    /// The pixel of a point x is (a . x + b, c . x + d): (a, b) and (c, d).
    pub fn projection(&self) -> [(DVec3, f64); 2] {
        let [right, up] = self.picture_axes();
        let [x, y] = self.origin;
        [(right / self.scale, x), (-up / self.scale, y)]
    }

    /// The directions to the right and upwards in the picture.
    fn picture_axes(&self) -> [DVec3; 2] {
        let (sin, cos) = self.rotation.sin_cos();
        let (right, up) = (self.right, self.up);
        [cos * right - sin * up, sin * right + cos * up]
    }

    /// The derivative of the pixel of a point that does not move.
    pub fn rate(&self, point: DVec3, by: &PhotoParameterDerivative) -> [f64; 2] {
        let [right, up] = self.picture_axes().map(|axis| axis.dot(point) / self.scale);
        let growth = by.scale / self.scale;
        let [x, y] = by.origin;
        [
            x - growth * right - by.rotation * up,
            y + growth * up - by.rotation * right,
        ]
    }

    /// The coordinates of a point that are seen at a pixel: the third is not.
    pub fn point_at_pixel(&self, pixel: [f64; 2]) -> [Option<f64>; 3] {
        let [x, y] = [0, 1].map(|k| (pixel[k] - self.origin[k]) * self.scale);
        let [right, up] = self.picture_axes();
        let place = right * x - up * y;
        let seen = self.right.abs() + self.up.abs();
        [0, 1, 2].map(|axis| (seen[axis] > 0.5).then_some(place[axis]))
    }
}

impl PhotoParameterDerivative {
    /// The derivative as a weighted sum of photographs.
    pub fn from_terms<'p>(
        terms: impl Iterator<Item = (f64, &'p Photo)>,
    ) -> PhotoParameterDerivative {
        let mut rate = PhotoParameterDerivative::default();
        for (weight, photo) in terms {
            rate.scale += weight * photo.scale;
            rate.rotation += weight * photo.rotation;
            rate.origin = [0, 1].map(|k| rate.origin[k] + weight * photo.origin[k]);
        }
        rate
    }
}

/// Reads `[photo]`; `None` if there is no such table.
pub(super) fn read_photo(entries: &Entries) -> ScenarioResult<Option<Photo>> {
    if !entries.has_key_of_table("photo") {
        return Ok(None);
    }
    let [right, up] = [Key::PhotoRight, Key::PhotoUp].map(|key| entries.value_or_default(key));
    let (right, up) = (right?, up?);
    let (towards, upwards) = (read_axis(right)?, read_axis(up)?);
    up.refuse_unless(
        towards.dot(upwards) == 0.0,
        "is the axis of photo.right: choose another",
    )?;
    Ok(Some(Photo {
        scale: read_pixel_length(entries)?,
        origin: [
            entries.value_or_default(Key::PhotoX)?.number()?,
            entries.value_or_default(Key::PhotoY)?.number()?,
        ],
        rotation: entries.value_or_default(Key::PhotoRotation)?.number()?,
        right: towards,
        up: upwards,
    }))
}

/// The length of a pixel, as given or by a ruler in the picture.
fn read_pixel_length(entries: &Entries) -> ScenarioResult<f64> {
    let ruler = [Key::RulerFrom, Key::RulerTo, Key::RulerLength];
    let given = ruler.into_iter().find(|key| entries.is_given(*key));
    match (entries.given_value(Key::PhotoScale), given) {
        (Some(scale), None) => scale.number(),
        (Some(scale), Some(_)) => Err(scale.value_error(
            "a ruler says so, too: leave this out, or photo.ruler_from and the others",
        )),
        (None, None) => entries.value_or_default(Key::PhotoScale)?.number(),
        (None, Some(_)) => {
            let [from, to] =
                [Key::RulerFrom, Key::RulerTo].map(|key| entries.value_or_default(key));
            let to = to?;
            let ([x, y], [end_x, end_y]) = (read_pixel(from?)?, read_pixel(to)?);
            let pixels = (end_x - x).hypot(end_y - y);
            to.refuse_unless(
                pixels > 0.0,
                "is photo.ruler_from: give two points on a ruler",
            )?;
            Ok(entries.value_or_default(Key::RulerLength)?.number()? / pixels)
        }
    }
}

fn read_pixel(item: EntryValue) -> ScenarioResult<[f64; 2]> {
    let needed = "a list of two numbers: pixels to the right, and down";
    let mut pixel = [0.0; 2];
    let numbers = item.list_of_length(2, "pixels to the right, and down", needed)?;
    for (number, item) in pixel.iter_mut().zip(numbers) {
        *number = item.number_in(NumberRange::Finite)?;
    }
    Ok(pixel)
}

fn read_axis(item: EntryValue) -> ScenarioResult<DVec3> {
    let (sign, axis) = match item.text()?.strip_prefix('-') {
        Some(axis) => (-1.0, axis),
        None => (1.0, item.text()?),
    };
    match axis {
        "x" => Ok(sign * DVec3::X),
        "y" => Ok(sign * DVec3::Y),
        "z" => Ok(sign * DVec3::Z),
        _ => Err(item.value_error("must be \"x\", \"y\", \"z\", \"-x\", \"-y\" or \"-z\"")),
    }
}

/// The axis along a direction, as it is written.
pub(super) fn axis_name(direction: DVec3) -> String {
    let axes = direction.to_array().into_iter().zip(["x", "y", "z"]);
    let mut along = axes.filter(|(component, _)| *component != 0.0);
    let (component, axis) = along.next().unwrap_or((1.0, "x"));
    let sign = if component < 0.0 { "-" } else { "" };
    format!("{sign}{axis}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_dual::{Dual64, DualNum};

    fn picture() -> Photo {
        Photo {
            scale: 0.02,
            origin: [310.0, 1240.0],
            rotation: 0.3,
            right: -DVec3::Y,
            up: DVec3::Z,
        }
    }

    /// The pixel of a point, as the definition says.
    fn seen(by: [Dual64; 4], right: f64, up: f64) -> [Dual64; 2] {
        let [scale, x, y, rotation] = by;
        let (sin, cos) = rotation.sin_cos();
        [
            x + (cos * right - sin * up) / scale,
            y - (sin * right + cos * up) / scale,
        ]
    }

    #[test]
    fn a_point_comes_back_from_its_pixel() {
        let photo = picture();
        let point = DVec3::new(0.7, -1.3, 2.1);
        let pixel = photo.projection().map(|(a, b)| a.dot(point) + b);
        let [x, y, z] = photo.point_at_pixel(pixel);
        assert_eq!(x, None);
        assert!((y.unwrap() + 1.3).abs() < 1e-12 && (z.unwrap() - 2.1).abs() < 1e-12);
        // To the right and up, where the picture is not turned.
        let upright = Photo {
            rotation: 0.0,
            ..photo
        };
        let [x, y] = upright.projection().map(|(a, b)| a.dot(point) + b);
        assert!(
            (x - 375.0).abs() < 1e-9 && (y - 1135.0).abs() < 1e-9,
            "{x} {y}"
        );
    }

    #[test]
    fn its_derivatives_are_those_of_dual_numbers() {
        let photo = picture();
        let point = DVec3::new(0.7, -1.3, 2.1);
        let values = [
            photo.scale,
            photo.origin[0],
            photo.origin[1],
            photo.rotation,
        ];
        for which in 0..4 {
            let unit = |k: usize| f64::from(u8::from(k == which));
            let rate = PhotoParameterDerivative {
                scale: unit(0),
                origin: [unit(1), unit(2)],
                rotation: unit(3),
            };
            let mut dual = values.map(Dual64::from_re);
            dual[which] = dual[which].derivative();
            let exact = seen(dual, 1.3, 2.1);
            for (found, exact) in photo.rate(point, &rate).into_iter().zip(exact) {
                assert!((found - exact.eps).abs() < 1e-9 * (1.0 + exact.eps.abs()));
            }
        }
    }
}
