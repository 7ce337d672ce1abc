//! The veins of a leaf: from numbers, from sections, or from a blade.
//!
//! Tissue between neighbouring veins: the table `[tissue]`.

use crate::scenario::blade::{Blade, BladeParts, BladeProperty, blade};
use crate::scenario::format::Key;
use crate::scenario::format::entries::Entries;
use crate::scenario::format::item::EntryValue;
use crate::scenario::format::source::ScenarioResult;
use crate::scenario::section::{Property, Section};
use crate::scenario::{Profile, Radii, Rod, section};
use std::f64::consts::PI;
use std::sync::Arc;

/// What the stiffnesses of the veins follow from.
pub(super) enum StiffnessSource {
    /// Numbers.
    Stiffnesses,
    Sections(Vec<Arc<Section>>),
    Blade(Arc<Blade>, BladeParts),
}

impl StiffnessSource {
    pub fn from_entries(entries: &Entries, rods: usize) -> ScenarioResult<StiffnessSource> {
        if let Some(blade) = blade(entries, rods)? {
            let parts = blade.parts();
            return Ok(StiffnessSource::Blade(Arc::new(blade), parts));
        }
        Ok(match section::sections(entries, rods)? {
            Some(sections) => StiffnessSource::Sections(sections),
            None => StiffnessSource::Stiffnesses,
        })
    }

    pub fn blade(&self) -> Option<&Arc<Blade>> {
        match self {
            StiffnessSource::Blade(blade, _) => Some(blade),
            _ => None,
        }
    }

    pub fn radii(&self) -> Radii {
        match self {
            StiffnessSource::Sections(sections) => Radii::of(sections.clone()),
            _ => Radii::default(),
        }
    }

    /// What sections or a blade determine of all veins; `None` if numbers are given.
    pub fn profiles(&self, property: Property) -> Option<Vec<Profile>> {
        match self {
            StiffnessSource::Stiffnesses => None,
            StiffnessSource::Sections(sections) => Some(section::profiles(sections, property)),
            StiffnessSource::Blade(_, parts) => Some(parts.profiles(property.into())),
        }
    }
}

/// Whether the tips are joined: those of a blade are if it ends in a point.
pub(super) fn joined(entries: &Entries, blade: Option<&Arc<Blade>>) -> ScenarioResult<bool> {
    let item = entries.value_or_default(Key::Joined)?;
    let Some(blade) = blade else {
        return item.switch();
    };
    if !entries.is_given(Key::Joined) {
        return Ok(blade.is_pointed());
    }
    let joined = item.switch()?;
    item.refuse_unless(
        !joined || blade.is_pointed(),
        "the blade has a width at its tip (blade.width): let it end at 0, or leave this out",
    )?;
    Ok(joined)
}

pub(super) fn veins(
    entries: &Entries,
    rods: usize,
    made: &StiffnessSource,
) -> ScenarioResult<Vec<Rod>> {
    let quantity = |key| entries.value_or_default(key)?.quantity(rods);
    let triple = |keys: [Key; 3], of: fn(usize) -> Property| -> ScenarioResult<[Vec<Profile>; 3]> {
        let one = |axis: usize| match made.profiles(of(axis)) {
            Some(profiles) => Ok(profiles),
            None => quantity(keys[axis]),
        };
        Ok([one(0)?, one(1)?, one(2)?])
    };
    let rest_of_blade = |axis: usize| match made {
        StiffnessSource::Blade(blade, parts) if axis == 2 || blade.curvature().is_some() => {
            Some(parts.profiles(BladeProperty::Rest(axis)))
        }
        _ => None,
    };
    let rest = |axis: usize| match rest_of_blade(axis) {
        Some(profiles) => Ok(profiles),
        None => quantity(Key::REST_CURVATURE[axis]),
    };
    let (length, base, directions) = match made {
        StiffnessSource::Blade(blade, parts) => (
            parts.lengths(),
            parts.bases(),
            parts.directions(blade.elevation),
        ),
        _ => {
            let angle = angles(entries.value_or_default(Key::Fan)?, rods)?.into_iter();
            let each = angle.zip(
                entries
                    .value_or_default(Key::Elevation)?
                    .number_for_each(rods)?,
            );
            (
                entries
                    .value_or_default(Key::Length)?
                    .number_for_each(rods)?,
                entries.value_or_default(Key::Base)?.vectors(rods)?,
                each.map(|(angle, elevation)| [angle, elevation, 0.0])
                    .collect(),
            )
        }
    };
    let couple = triple(Key::COUPLE, Property::Couple)?;
    let force = triple(Key::FORCE, Property::Force)?;
    let rest = [rest(0)?, rest(1)?, rest(2)?];
    let stretch = quantity(Key::RestStretch)?;
    let pick = |all: &[Vec<Profile>; 3], rod: usize| all.each_ref().map(|one| one[rod].clone());
    Ok((0..rods)
        .map(|rod| {
            let [angle, elevation, roll] = directions[rod];
            Rod {
                length: length[rod],
                base: base[rod],
                angle,
                elevation,
                roll,
                couple_stiffness: pick(&couple, rod),
                force_stiffness: pick(&force, rod),
                rest_curvature: pick(&rest, rod),
                rest_stretch: stretch[rod].clone(),
            }
        })
        .collect())
}

/// Base angles phi_n of the rods n = 1..N (paper, section 2.4 (c)).
fn angles(item: EntryValue, rods: usize) -> ScenarioResult<Vec<f64>> {
    let step = PI / (3.0 * rods as f64);
    // -pi/3 + 2 pi n / (3N) = step (2n - N); with n - 1/2 the fan is exactly antisymmetric.
    let fan = |odd: f64| {
        (1..=rods)
            .map(|n| step * (2.0 * n as f64 - odd - rods as f64))
            .collect()
    };
    match item.value.as_str() {
        Some("paper") => Ok(fan(0.0)),
        Some("symmetric") => Ok(fan(1.0)),
        None if item.value.is_array() => item.number_for_each(rods),
        _ => Err(item.value_error(format_args!(
            "must be \"paper\" or \"symmetric\", or a list of {rods} angles in radians, one per rod"
        ))),
    }
}

/// Tissue that fills the gap between two neighbouring veins and turns with them. It is without
/// force in the natural leaf: every vein in its rest shape from its base, each for itself.
#[derive(Clone, Debug, PartialEq)]
pub struct Tissue {
    /// k1, k2 and k3, force per displacement and length of leaf, along the directors between both
    /// veins: against neighbours that slide along each other, against a change of the width, and
    /// against one vein that rises above the other.
    pub stiffness: [Profile; 3],
    /// c1, moment per angle and length of leaf, against a fold along the veins.
    pub fold: Profile,
}

impl Default for Tissue {
    fn default() -> Self {
        Tissue {
            stiffness: [0.0; 3].map(Profile::Constant),
            fold: Profile::Constant(0.0),
        }
    }
}

impl Tissue {
    /// k1, k2, k3 and c1.
    pub(crate) fn profiles(&self) -> [&Profile; 4] {
        let [along, across, normal] = &self.stiffness;
        [along, across, normal, &self.fold]
    }
}

/// Reads `[tissue]` of a leaf with so many gaps; `None` if no gap has any.
pub(super) fn tissue(entries: &Entries, gaps: usize) -> ScenarioResult<Option<Vec<Tissue>>> {
    let mut tissue = vec![Tissue::default(); gaps];
    for (which, key) in Key::TISSUE.into_iter().enumerate() {
        let Some(item) = entries.given_value(key) else {
            continue;
        };
        let why = "tissue lies between veins: it needs leaf.rods = 2 or more";
        item.refuse_unless(gaps > 0, why)?;
        for (gap, stiffness) in tissue.iter_mut().zip(item.number_for_each(gaps)?) {
            match which {
                3 => gap.fold = Profile::Constant(stiffness),
                axis => gap.stiffness[axis] = Profile::Constant(stiffness),
            }
        }
    }
    let some = tissue.iter().any(|gap| *gap != Tissue::default());
    Ok(some.then_some(tissue))
}
