//! The table `[section]`: computes stiffnesses and masses from sections.

use std::sync::Arc;

use super::Profile;
use super::entries::Entries;
use super::error::Result;
use super::item::Item;
use super::key::Key;
use super::section::{Outline, Property, Radii, Section};
use super::value::MAGNITUDES;

const TABLE: [Key; 7] = [
    Key::SectionShape,
    Key::Diameter,
    Key::Width,
    Key::Thickness,
    Key::Young,
    Key::Poisson,
    Key::MassDensity,
];

/// The sections of the rods, if they determine the stiffnesses.
pub(super) struct Sections {
    sections: Vec<Arc<Section>>,
    has_mass: bool,
}

/// The entry with the size of the sections.
pub(super) fn size<'r>(entries: &'r Entries) -> Option<Item<'r>> {
    let given = |key| entries.given(key);
    given(Key::Diameter).or_else(|| given(Key::Thickness))
}

impl Sections {
    /// Reads the table; `None` if there is none.
    pub(super) fn read(entries: &Entries, rods: usize) -> Result<Option<Sections>> {
        if TABLE.iter().all(|&key| entries.given(key).is_none()) {
            return Ok(None);
        }
        for key in Key::COUPLE.into_iter().chain(Key::FORCE) {
            if let Some(item) = entries.given(key) {
                let why =
                    "[section] gives the stiffnesses: leave out either [stiffness] or [section]";
                return Err(item.refuse(why));
            }
        }
        let quantity = |key| entries.item(key)?.quantity(rods);
        let (outline, sides) = outline(entries)?;
        let [width, thickness] = [quantity(sides[0])?, quantity(sides[1])?];
        let young = quantity(Key::Young)?;
        let poisson = poisson(entries.item(Key::Poisson)?, rods)?;
        let given = entries.given(Key::MassDensity);
        let has_mass = given.is_some();
        let mass_density = match given {
            Some(item) => item.quantity(rods)?,
            None => vec![Profile::Constant(0.0); rods],
        };
        let section = |rod: usize| {
            Arc::new(Section::new(
                outline,
                [&width, &thickness].map(|side| side[rod].clone()),
                [&young, &poisson, &mass_density].map(|value| value[rod].clone()),
            ))
        };
        let sections = Sections {
            sections: (0..rods).map(section).collect(),
            has_mass,
        };
        sections.check(entries)?;
        Ok(Some(sections))
    }

    /// Refuses stiffnesses and masses that are too large or too small, and flat sections of
    /// auxetic materials, for which Cowper's formula has no meaning.
    fn check(&self, entries: &Entries) -> Result<()> {
        let Some(item) = size(entries) else {
            return Ok(());
        };
        for (rod, section) in self.sections.iter().enumerate() {
            entries.item(Key::Poisson)?.entry(rod).ensure(
                section.shear_factors().all(|k| k > 0.0 && k <= 1.0),
                "gives a shear factor that is not between 0 and 1, as Cowper's formula fails for \
                 so flat a section with a negative ratio: choose a larger one, or give the \
                 stiffnesses in place of a section",
            )?;
        }
        let stiffness = [Property::Couple, Property::Force];
        let stiffness = stiffness.into_iter().flat_map(|of| (0..3).map(of));
        let masses = [Property::Density, Property::RotaryInertia];
        let masses = masses.into_iter().filter(|_| self.has_mass);
        for property in stiffness.chain(masses) {
            for (rod, profile) in self.profiles(property).into_iter().enumerate() {
                for value in [profile.min(), profile.max_abs()] {
                    item.entry(rod).ensure(
                        MAGNITUDES.contains(&value),
                        format_args!(
                            "gives a stiffness or mass of {value:.3e}, which must lie between \
                             1e-50 and 1e50: choose other units"
                        ),
                    )?;
                }
            }
        }
        Ok(())
    }

    fn profiles(&self, property: Property) -> Vec<Profile> {
        let sections = self.sections.iter();
        sections.map(|section| section.profile(property)).collect()
    }

    pub(super) fn radii(&self) -> Radii {
        Radii::of(&self.sections)
    }

    /// A1, A2, A3 of all rods.
    pub(super) fn couple(&self) -> [Vec<Profile>; 3] {
        [0, 1, 2].map(|axis| self.profiles(Property::Couple(axis)))
    }

    /// H1, H2, H3 of all rods.
    pub(super) fn force(&self) -> [Vec<Profile>; 3] {
        [0, 1, 2].map(|axis| self.profiles(Property::Force(axis)))
    }

    /// Masses per length, if a density is given.
    pub(super) fn density(&self) -> Option<Vec<Profile>> {
        self.has_mass.then(|| self.profiles(Property::Density))
    }

    /// Moments of inertia per length, if a density is given.
    pub(super) fn rotary_inertia(&self) -> Option<Vec<Profile>> {
        (self.has_mass).then(|| self.profiles(Property::RotaryInertia))
    }
}

/// The outline, and the keys of its two sides.
fn outline(entries: &Entries) -> Result<(Outline, [Key; 2])> {
    let item = entries.item(Key::SectionShape)?;
    let sides = [Key::Width, Key::Thickness];
    let (outline, sides, others) = match item.value.as_str() {
        Some("circle") => (Outline::Circle, [Key::Diameter; 2], &sides[..]),
        Some("ellipse") => (Outline::Ellipse, sides, &[Key::Diameter][..]),
        Some("rectangle") => (Outline::Rectangle, sides, &[Key::Diameter][..]),
        _ => return Err(item.refuse("must be \"circle\", \"ellipse\" or \"rectangle\"")),
    };
    match others.iter().find_map(|&key| entries.given(key)) {
        None => Ok((outline, sides)),
        Some(other) => Err(other.refuse(
            "a circle has a diameter; an ellipse and a rectangle have a width (along d2) and a \
             thickness (along d3): leave this out, or change section.shape",
        )),
    }
}

fn poisson(item: Item, rods: usize) -> Result<Vec<Profile>> {
    let poisson = item.quantity(rods)?;
    for (rod, profile) in poisson.iter().enumerate() {
        let most = profile.scaled(-1.0).min();
        item.entry(rod).ensure(
            profile.min() > -1.0 && -most <= 0.5,
            "must be greater than -1 and at most 0.5, as of every isotropic material",
        )?;
    }
    Ok(poisson)
}
