//! A leaf from its outline, thickness and moduli: the table `[blade]`.
//!
//! A blade of the length L and the width W(x) has N veins, of which vein j lies along
//! y = eta_j W(x)/2 in the natural leaf, and of which each has a strip of the width h ([`division`]). The strip and the
//! gap of the width w between two veins are perpendicular to the veins, and become narrower by the cosine of
//! their angle to the axis of the blade. With the thickness t, Young's moduli E along the veins and E' across, the shear
//! modulus G and Poisson's ratio nu,
//!
//! | | |
//! | --- | --- |
//! | torsion | A1 = G h t^3/3 |
//! | bending | A2 = E h t^3/12, A3 = E t h l^2/12 with the lever l |
//! | stretch and shear | H1 = E h t, H2 = f G h t, H3 = 5/6 G h t |
//! | tissue | rigid along (k1) and normal to the veins (k3), k2 = E' t/(D w), c1 = E' t^3/(12 D w) |
//! | contraction | nu w, with D = 1 - nu^2 E'/E |
//! | inertia | rho t h, about d2 rho h t^3/12, about d3 rho t h l^2/12, about d1 their sum |
//!
//! So veins that slide past each other shear their strips, not the tissue besides, and a strip that bends or stretches
//! curves or narrows the gaps beside it: a blade is a plate that is bent, stretched and sheared in strips.
//!
//! Its surface may be curved at rest about the y axis, kappa(x): a vein at the angle phi to its axis
//! then has u0_1 = kappa sin(phi) cos(phi) and u0_2 = kappa cos(phi)^2, so that all fit together.

mod division;
mod spline;
#[cfg(test)]
mod tests;
mod veins;

use crate::scenario::blade::division::StripDivision;
pub(super) use crate::scenario::blade::spline::Spline;
pub(super) use crate::scenario::blade::veins::BladeProperty;
use crate::scenario::blade::veins::{BladeMaterial, BladeOutline, BladePart, BladeVein};
use crate::scenario::format::Key;
use crate::scenario::format::entries::Entries;
use crate::scenario::format::error::ScenarioResult;
use crate::scenario::format::item::{EntryValue, Knots};
use crate::scenario::profile::Profile;
use crate::scenario::section::read_poisson;
use glam::{DQuat, DVec3};
use std::ops::RangeInclusive;
use std::sync::Arc;

/// How densely the width of a blade is looked at, and what an outline may be.
struct OutlineLimits {
    /// Equal steps along the blade among whose ends the widest place is looked for.
    widest_place_steps: usize,
    /// Steps between two points of an outline at which the width is checked to be positive.
    steps_between_points: usize,
    /// Most points of an outline: a smooth one needs far fewer.
    most_points: usize,
    /// Range of the least bearing width, a fraction of the largest width. Stiffnesses in the plane go
    /// with its third power.
    least_width: RangeInclusive<f64>,
}

const OUTLINE_LIMITS: OutlineLimits = OutlineLimits {
    widest_place_steps: 500,
    steps_between_points: 32,
    most_points: 1000,
    least_width: 1e-3..=0.5,
};

/// A blade, from which the veins of a leaf and the tissue between them follow.
#[derive(Clone, Debug, PartialEq)]
pub struct Blade {
    outline: Arc<BladeOutline>,
    /// Whether the outermost veins are the margins.
    pub edges: bool,
    /// The angle by which the blade rises from the x-y plane as a whole, in radians.
    pub elevation: f64,
    pub(super) materials: Vec<BladeMaterial>,
}

impl Blade {
    /// The length, from the base to the tip.
    pub fn length(&self) -> f64 {
        self.outline.length
    }

    /// The width at the fraction `x` of the length.
    pub fn width(&self, x: f64) -> f64 {
        self.outline.width.value_and_derivatives(x)[0]
    }

    /// The width at the fraction `x` of the length from which stiffnesses follow: nowhere less than
    /// a part of the largest one.
    pub fn bearing_width(&self, x: f64) -> f64 {
        self.outline.bearing_width(x)
    }

    /// The least bearing width as a fraction of the largest width, wherever the blade is wider.
    pub fn least_width_fraction(&self) -> f64 {
        self.outline.least
    }

    /// The least bearing width, if the blade is narrower somewhere.
    pub fn least_width(&self) -> Option<f64> {
        let outline = &self.outline;
        let is_narrow = outline.has_narrow_part;
        is_narrow.then_some(outline.least * outline.largest)
    }

    /// Where the blade is widest: a fraction of the length.
    pub fn widest(&self) -> f64 {
        let steps = OUTLINE_LIMITS.widest_place_steps;
        let places = (0..=steps).map(|k| k as f64 / steps as f64);
        let wider = |a: f64, b: f64| if self.width(b) > self.width(a) { b } else { a };
        places.fold(0.0, wider)
    }

    /// Where vein `j` lies: a fraction of the half width, negative to the right of the midrib.
    pub fn vein_position(&self, j: usize) -> f64 {
        self.division().vein_position(j)
    }

    /// The distance of neighboring veins, as a fraction of the width.
    pub fn gap_fraction(&self) -> f64 {
        self.division().gap()
    }

    fn division(&self) -> StripDivision {
        StripDivision {
            count: self.materials.len(),
            edges: self.edges,
        }
    }

    /// The area within the outline.
    pub fn area(&self) -> f64 {
        self.length() * self.outline.width.integral()
    }

    /// Whether all veins meet at the tip.
    pub fn is_pointed(&self) -> bool {
        self.outline.width.values().last() == Some(&0.0)
    }

    /// The curvature of the surface at rest, over fractions of the length; `None` if it lies flat.
    pub(super) fn curvature(&self) -> Option<&Spline> {
        self.outline.curvature.as_ref()
    }

    /// E along vein `rod` at a fraction of its length.
    pub fn young(&self, rod: usize, sigma: f64) -> f64 {
        self.materials[rod].young.at(sigma)
    }

    /// The thickness along vein `rod` at a fraction of its length.
    pub fn thickness(&self, rod: usize, sigma: f64) -> f64 {
        self.materials[rod].thickness.at(sigma)
    }

    /// The largest mass per volume; none where there is none.
    pub(super) fn largest_mass_density(&self) -> Option<f64> {
        let densities = self.materials.iter().flat_map(|of| &of.mass_density);
        densities.map(Profile::max_abs).reduce(f64::max)
    }

    /// The largest Young's modulus along the veins, or across them.
    pub(super) fn largest_young(&self) -> f64 {
        let moduli = self.materials.iter().map(|of| of.young.max_abs());
        moduli.fold(0.0, f64::max)
    }

    /// Whether the mass of every vein is given.
    pub fn has_mass(&self) -> bool {
        self.materials.iter().all(|of| of.mass_density.is_some())
    }

    /// The width over fractions of the length.
    pub(super) fn width_profile(&self) -> &Spline {
        &self.outline.width
    }

    /// The veins and the tissue between them.
    pub(super) fn parts(&self) -> BladeParts {
        let (count, division) = (self.materials.len(), self.division());
        let etas: Vec<f64> = (0..count).map(|j| division.vein_position(j)).collect();
        let alike = |one: usize, other: usize| self.materials[one] == self.materials[other];
        let vein = |j: usize| {
            let material = self.materials[j].clone();
            Arc::new(BladeVein::new(
                &self.outline,
                etas[j].abs(),
                division.strip(j),
                material,
            ))
        };
        let veins = build_with_images(count, alike, vein);
        let gaps_alike = |g: usize, image: usize| alike(g, image + 1) && alike(g + 1, image);
        let gap = |g: usize| {
            let middle = 0.5 * (etas[g] + etas[g + 1]);
            BladePart::from_gap(&veins[g], &veins[g + 1], middle, division.gap())
        };
        BladeParts {
            gaps: build_with_images(count - 1, gaps_alike, gap),
            vein_parts: build_with_images(count, alike, |j| BladePart::from_vein(veins[j].clone())),
            half_width: 0.5 * self.width(0.0),
            veins,
            etas,
        }
    }
}

/// Makes `count` values. Where value j is `alike` to its mirror image, value j counted from the other
/// end, both are one.
fn build_with_images<T>(
    count: usize,
    alike: impl Fn(usize, usize) -> bool,
    make: impl Fn(usize) -> Arc<T>,
) -> Vec<Arc<T>> {
    let mut all: Vec<Arc<T>> = Vec::with_capacity(count);
    for j in 0..count {
        let image = count - 1 - j;
        let same = image < j && alike(j, image);
        all.push(if same { all[image].clone() } else { make(j) });
    }
    all
}

/// The veins of a blade, and the tissue between them.
pub(super) struct BladeParts {
    /// The places of the veins, as fractions of the half width.
    etas: Vec<f64>,
    half_width: f64,
    veins: Vec<Arc<BladeVein>>,
    vein_parts: Vec<Arc<BladePart>>,
    gaps: Vec<Arc<BladePart>>,
}

impl BladeParts {
    /// A property along every vein.
    pub fn profiles(&self, property: BladeProperty) -> Vec<Profile> {
        let each = self.etas.iter().zip(&self.vein_parts);
        each.map(|(eta, part)| part.profile(property, *eta < 0.0))
            .collect()
    }

    /// The lengths of the veins.
    pub fn lengths(&self) -> Vec<f64> {
        self.veins.iter().map(|vein| vein.length).collect()
    }

    /// Where the veins begin.
    pub fn bases(&self) -> Vec<[f64; 3]> {
        let y = self.etas.iter().map(|eta| eta * self.half_width);
        y.map(|y| [0.0, y, 0.0]).collect()
    }

    /// The angle of each vein at its base in the x-y plane, its elevation above that, and the turn
    /// of its section about d1, if the whole blade is turned by `elevation` about -e2.
    pub fn directions(&self, elevation: f64) -> Vec<[f64; 3]> {
        let each = self.etas.iter().zip(&self.veins);
        each.map(|(eta, vein)| {
            let angle = if *eta < 0.0 {
                -vein.angle()
            } else {
                vein.angle()
            };
            tilt_direction(angle, elevation)
        })
        .collect()
    }

    /// k2, c1 and the contraction of the tissue in every gap.
    pub fn tissue_profiles(&self) -> Vec<[Profile; 3]> {
        let properties = [
            BladeProperty::Across,
            BladeProperty::Fold,
            BladeProperty::Contraction,
        ];
        let gap = |part: &Arc<BladePart>| properties.map(|of| part.profile(of, false));
        self.gaps.iter().map(gap).collect()
    }
}

/// A direction at `angle` in a plane that is turned about -e2 by `elevation`: its own angle and
/// elevation, and the turn about it that brings d2 into the plane.
fn tilt_direction(angle: f64, elevation: f64) -> [f64; 3] {
    if elevation == 0.0 {
        return [angle, 0.0, 0.0];
    }
    let plane = DQuat::from_rotation_y(-elevation) * DQuat::from_rotation_z(angle);
    let tangent = plane * DVec3::X;
    let (own, up) = (tangent.y.atan2(tangent.x), tangent.z.asin());
    let upright = DQuat::from_rotation_z(own) * DQuat::from_rotation_y(-up);
    let across = upright.inverse() * (plane * DVec3::Y);
    [own, up, across.z.atan2(across.y)]
}

/// Reads `[blade]` of a leaf with so many veins; `None` if there is no such table.
pub(super) fn read_blade(entries: &Entries, rods: usize) -> ScenarioResult<Option<Blade>> {
    if !entries.has_key_of_table("blade") {
        return Ok(None);
    }
    if let Some(item) = Key::all()
        .filter(|key| key.follows_from_blade())
        .find_map(|key| entries.given_value(key))
    {
        let why = "follows from [blade], which is given, too: leave one of them out";
        return Err(item.value_error(why));
    }
    let quantity = |key| entries.value_or_default(key)?.profile_per_rod(rods);
    let optional = |key| {
        entries
            .given_value(key)
            .map(|item| item.profile_per_rod(rods))
            .transpose()
    };
    let thickness = quantity(Key::BladeThickness)?;
    let young = quantity(Key::BladeYoung)?;
    let young_across = optional(Key::YoungAcross)?;
    let shear_modulus = optional(Key::ShearModulus)?;
    let poisson = read_poisson(entries.value_or_default(Key::BladePoisson)?, rods)?;
    let mass_density = optional(Key::BladeMassDensity)?;
    let pick = |all: &Option<Vec<Profile>>, rod: usize| all.as_ref().map(|all| all[rod].clone());
    let materials = (0..rods).map(|rod| BladeMaterial {
        thickness: thickness[rod].clone(),
        young: young[rod].clone(),
        young_across: pick(&young_across, rod),
        shear_modulus: pick(&shear_modulus, rod),
        poisson: poisson[rod].clone(),
        mass_density: pick(&mass_density, rod),
    });
    let elevation = entries.value_or_default(Key::Elevation)?;
    let whole = "a blade rises as a whole: give one number";
    elevation.refuse_unless(!elevation.value.is_array(), whole)?;
    let materials: Vec<BladeMaterial> = materials.collect();
    check_contraction(entries, &materials)?;
    Ok(Some(Blade {
        elevation: elevation.number()?,
        outline: Arc::new(read_outline(entries)?),
        edges: read_edges(entries, rods)?,
        materials,
    }))
}

/// Reads `blade.edges`; left out, it is true but for two veins, which as margins would be three times too stiff in
/// their plane.
fn read_edges(entries: &Entries, rods: usize) -> ScenarioResult<bool> {
    let edges = entries.value_or_default(Key::Edges)?;
    if rods != 2 {
        return edges.switch();
    }
    let given = entries.given_value(Key::Edges);
    let Some(edges) = given else {
        return Ok(false);
    };
    let margins = edges.switch()?;
    edges.refuse_unless(
        !margins,
        "two veins on the margins are three times too stiff in their plane: leave this out, or give more veins",
    )?;
    Ok(false)
}

/// Refuses materials that would become narrower when bent than a plate can: whose 1 - nu^2 E'/E is not positive.
fn check_contraction(entries: &Entries, materials: &[BladeMaterial]) -> ScenarioResult<()> {
    for (rod, material) in materials.iter().enumerate() {
        let steps = OUTLINE_LIMITS.steps_between_points;
        let places = (0..=steps).map(|k| k as f64 / steps as f64);
        let places = material.kinks().chain(places);
        for sigma in places {
            let local = material.local_material(sigma);
            if local.contraction_factor() > 0.0 {
                continue;
            }
            let key = match material.young_across.is_some() {
                true => Key::YoungAcross,
                false => Key::BladePoisson,
            };
            let item = entries.value_or_default(key)?;
            let most = local.young / local.poisson.powi(2);
            return Err(item.entry(rod).value_error(format_args!(
                "with poisson = {} and young = {} Young's modulus across the veins must be less than young/poisson^2 = {most:.4e}",
                local.poisson, local.young
            )));
        }
    }
    Ok(())
}

fn read_outline(entries: &Entries) -> ScenarioResult<BladeOutline> {
    let item = entries.value_or_default(Key::BladeWidth)?;
    let width = parse_width_profile(item)?;
    let narrow = entries.value_or_default(Key::LeastWidth)?;
    let least = narrow.number()?;
    let range = OUTLINE_LIMITS.least_width;
    narrow.refuse_unless(
        range.contains(&least),
        format_args!(
            "must be between {} and {}: a fraction of the largest width",
            range.start(),
            range.end()
        ),
    )?;
    let steps = OUTLINE_LIMITS.steps_between_points;
    let knots = width.knots().windows(2);
    let between = knots.flat_map(|pair| {
        let (from, to) = (pair[0], pair[1]);
        (0..=steps).map(move |k| (from + k as f64 / steps as f64 * (to - from), k))
    });
    let (mut largest, mut narrowest) = (0.0_f64, f64::INFINITY);
    for (x, k) in between {
        let [value, ..] = width.value_and_derivatives(x);
        let inside = k > 0 && k < steps;
        item.refuse_unless(
            !inside || value > 0.0,
            format_args!(
                "the smoothest outline through these points crosses itself at {x:.3} of the length: \
                 add points there"
            ),
        )?;
        (largest, narrowest) = (largest.max(value), narrowest.min(value));
    }
    Ok(BladeOutline {
        length: entries.value_or_default(Key::BladeLength)?.number()?,
        has_narrow_part: narrowest < least * largest,
        width,
        least,
        largest,
        curvature: read_curvature(entries)?,
    })
}

/// The curvature of the surface at rest, over fractions of the length.
fn read_curvature(entries: &Entries) -> ScenarioResult<Option<Spline>> {
    let Some(item) = entries.given_value(Key::RestBend2) else {
        return Ok(None);
    };
    item.refuse_unless(
        !item.value.is_array(),
        "a blade bends as a whole: give one number, or one profile",
    )?;
    let Knots { at, value } = match item.value.is_table() {
        true => item.knots()?,
        false => Knots {
            at: vec![0.0, 1.0],
            value: vec![item.number()?; 2],
        },
    };
    if value.iter().all(|value| *value == 0.0) {
        return Ok(None);
    }
    if let Some(twist) = entries.given_value(Key::RestTwist) {
        let why = "the veins of a blade that is curved (rest.bend_2) twist as its surface does: \
                   leave one of them out";
        return Err(twist.value_error(why));
    }
    Ok(Some(Spline::through_points(at, value)))
}

/// The width over fractions of the length.
fn parse_width_profile(item: EntryValue) -> ScenarioResult<Spline> {
    if !item.value.is_table() {
        let width = item.number()?;
        item.refuse_unless(width > 0.0, "must be greater than 0")?;
        return Ok(Spline::through_points(vec![0.0, 1.0], vec![width; 2]));
    }
    let Knots { at, value } = item.knots()?;
    let last = at.len() - 1;
    let most = OUTLINE_LIMITS.most_points;
    item.refuse_unless(
        last < most,
        format_args!("has more than {most} points: an outline is smooth with far fewer"),
    )?;
    let list = item.list("value").unwrap_or(item);
    for (k, value) in value.iter().enumerate() {
        list.entry(k).refuse_unless(
            *value > 0.0 || *value == 0.0 && (k == 0 || k == last),
            "must be greater than 0, and may be 0 at the base and at the tip",
        )?;
    }
    list.refuse_unless(
        last > 1 || value[0] + value[1] > 0.0,
        "must be greater than 0 somewhere",
    )?;
    Ok(Spline::through_points(at, value))
}
