//! Reads the table `[blade]`.

use super::given::Blade;
use super::material::Material;
use super::spline::Spline;
use super::vein::Outline;
use crate::scenario::Profile;
use crate::scenario::entries::Entries;
use crate::scenario::error::ScenarioResult;
use crate::scenario::item::Item;
use crate::scenario::key::Key;
use crate::scenario::material::poisson;
use std::sync::Arc;

/// Most points of an outline.
const MOST_POINTS: usize = 1000;

/// Where the width between points is looked at, so many times between two.
const SAMPLES: usize = 32;

/// Largest least bearing width.
const WIDEST: f64 = 0.5;

/// Least one: stiffnesses in the plane go with its third power.
const NARROWEST: f64 = 1e-3;

/// Reads `[blade]` of a leaf with so many veins; `None` if there is no such table.
pub(in crate::scenario) fn blade(entries: &Entries, rods: usize) -> ScenarioResult<Option<Blade>> {
    let mut table = Key::all().filter(|key| key.parts().0 == "blade");
    if !table.any(|key| entries.is_given(key)) {
        return Ok(None);
    }
    if let Some(item) = Key::all()
        .filter(|key| key.follows_from_blade())
        .find_map(|key| entries.given(key))
    {
        let why = "follows from [blade], which is given, too: leave one of them out";
        return Err(item.refuse(why));
    }
    let quantity = |key| entries.item(key)?.quantity(rods);
    let optional = |key| {
        entries
            .given(key)
            .map(|item| item.quantity(rods))
            .transpose()
    };
    let thickness = quantity(Key::BladeThickness)?;
    let young = quantity(Key::BladeYoung)?;
    let young_across = optional(Key::YoungAcross)?;
    let shear_modulus = optional(Key::ShearModulus)?;
    let poisson = poisson(entries.item(Key::BladePoisson)?, rods)?;
    let mass_density = optional(Key::BladeMassDensity)?;
    let pick = |all: &Option<Vec<Profile>>, rod: usize| all.as_ref().map(|all| all[rod].clone());
    let materials = (0..rods).map(|rod| Material {
        thickness: thickness[rod].clone(),
        young: young[rod].clone(),
        young_across: pick(&young_across, rod),
        shear_modulus: pick(&shear_modulus, rod),
        poisson: poisson[rod].clone(),
        mass_density: pick(&mass_density, rod),
    });
    let elevation = entries.item(Key::Elevation)?;
    let whole = "a blade rises as a whole: give one number";
    elevation.ensure(!elevation.value.is_array(), whole)?;
    Ok(Some(Blade {
        elevation: elevation.number()?,
        outline: Arc::new(outline(entries)?),
        edges: entries.item(Key::Edges)?.switch()?,
        materials: materials.collect(),
    }))
}

fn outline(entries: &Entries) -> ScenarioResult<Outline> {
    let item = entries.item(Key::BladeWidth)?;
    let width = width(item)?;
    let narrow = entries.item(Key::LeastWidth)?;
    let least = narrow.number()?;
    narrow.ensure(
        (NARROWEST..=WIDEST).contains(&least),
        format_args!("must be between {NARROWEST} and {WIDEST}: a fraction of the largest width"),
    )?;
    let knots = width.knots().windows(2);
    let between = knots.flat_map(|pair| {
        let (from, to) = (pair[0], pair[1]);
        (0..=SAMPLES).map(move |k| (from + k as f64 / SAMPLES as f64 * (to - from), k))
    });
    let (mut largest, mut narrowest) = (0.0_f64, f64::INFINITY);
    for (x, k) in between {
        let [value, ..] = width.at(x);
        let inside = k > 0 && k < SAMPLES;
        item.ensure(
            !inside || value > 0.0,
            format_args!(
                "the smoothest outline through these points crosses itself at {x:.3} of the length: \
                 add points there"
            ),
        )?;
        (largest, narrowest) = (largest.max(value), narrowest.min(value));
    }
    Ok(Outline {
        length: entries.item(Key::BladeLength)?.number()?,
        narrows: narrowest < least * largest,
        width,
        least,
        largest,
        curvature: curvature(entries)?,
    })
}

/// The curvature of the surface at rest, over fractions of the length.
fn curvature(entries: &Entries) -> ScenarioResult<Option<Spline>> {
    let Some(item) = entries.given(Key::RestBend2) else {
        return Ok(None);
    };
    item.ensure(
        !item.value.is_array(),
        "a blade bends as a whole: give one number, or one profile",
    )?;
    let (at, value) = match item.value.is_table() {
        true => item.knots()?,
        false => (vec![0.0, 1.0], vec![item.number()?; 2]),
    };
    if value.iter().all(|value| *value == 0.0) {
        return Ok(None);
    }
    if let Some(twist) = entries.given(Key::RestTwist) {
        let why = "the veins of a blade that is curved (rest.bend_2) twist as its surface does: \
                   leave one of them out";
        return Err(twist.refuse(why));
    }
    Ok(Some(Spline::through(at, value)))
}

/// The width over fractions of the length.
fn width(item: Item) -> ScenarioResult<Spline> {
    if !item.value.is_table() {
        let width = item.number()?;
        item.ensure(width > 0.0, "must be greater than 0")?;
        return Ok(Spline::through(vec![0.0, 1.0], vec![width; 2]));
    }
    let (at, value) = item.knots()?;
    let last = at.len() - 1;
    item.ensure(
        last < MOST_POINTS,
        format_args!("has more than {MOST_POINTS} points: an outline is smooth with far fewer"),
    )?;
    let list = item.list("value").unwrap_or(item);
    for (k, value) in value.iter().enumerate() {
        list.entry(k).ensure(
            *value > 0.0 || *value == 0.0 && (k == 0 || k == last),
            "must be greater than 0, and may be 0 at the base and at the tip",
        )?;
    }
    list.ensure(
        last > 1 || value[0] + value[1] > 0.0,
        "must be greater than 0 somewhere",
    )?;
    Ok(Spline::through(at, value))
}
