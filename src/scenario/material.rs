//! The table `[section]`: computes stiffnesses and masses from sections.

use std::sync::Arc;

use super::Profile;
use super::entries::Entries;
use super::error::ScenarioResult;
use super::item::Item;
use super::key::Key;
use super::outline::Outline;
use super::section::{Hollow, Property, Section};

/// The entry with the size of the sections, or of the blade.
pub(super) fn size(entries: &Entries) -> Option<Item<'_>> {
    let sizes = [Key::Diameter, Key::Thickness, Key::BladeThickness];
    sizes.into_iter().find_map(|key| entries.given(key))
}

/// A property of all rods.
pub(super) fn profiles(sections: &[Arc<Section>], property: Property) -> Vec<Profile> {
    let profile = |section: &Arc<Section>| section.profile(property);
    sections.iter().map(profile).collect()
}

/// The sections of the rods, which determine the stiffnesses; `None` if there is no such table.
pub(super) fn sections(entries: &Entries, rods: usize) -> ScenarioResult<Option<Vec<Arc<Section>>>> {
    let mut table = Key::all().filter(|key| key.parts().0 == "section");
    if !table.any(|key| entries.is_given(key)) {
        return Ok(None);
    }
    for key in Key::COUPLE.into_iter().chain(Key::FORCE) {
        if let Some(item) = entries.given(key) {
            let why = "[section] gives the stiffnesses: leave out either [stiffness] or [section]";
            return Err(item.refuse(why));
        }
    }
    let quantity = |key| entries.item(key)?.quantity(rods);
    let (outline, sides) = outline(entries)?;
    let [width, thickness] = [quantity(sides[0])?, quantity(sides[1])?];
    let hollow = hollow(entries, outline, [&width, &thickness])?;
    let young = quantity(Key::Young)?;
    let poisson = poisson(entries.item(Key::Poisson)?, rods)?;
    let mass_density = match entries.given(Key::MassDensity) {
        Some(item) => item.quantity(rods)?,
        None => vec![Profile::Constant(0.0); rods],
    };
    let all = [&width, &thickness, &young, &poisson, &mass_density];
    let mut sections: Vec<Arc<Section>> = Vec::with_capacity(rods);
    for rod in 0..rods {
        let own = |rod: usize| hollow.as_ref().map(|hollow| &hollow[rod]);
        let same = rod > 0
            && all.iter().all(|values| values[rod] == values[rod - 1])
            && own(rod) == own(rod - 1);
        sections.push(match sections.last() {
            Some(last) if same => last.clone(),
            _ => Arc::new(Section::new(
                outline,
                [&width, &thickness].map(|side| side[rod].clone()),
                own(rod).cloned(),
                [&young, &poisson, &mass_density].map(|value| value[rod].clone()),
            )),
        });
    }
    check(entries, &sections)?;
    Ok(Some(sections))
}

/// Refuses flat sections of auxetic materials, for which Cowper's formula has no meaning.
fn check(entries: &Entries, sections: &[Arc<Section>]) -> ScenarioResult<()> {
    for (rod, section) in sections.iter().enumerate() {
        entries.item(Key::Poisson)?.entry(rod).ensure(
            section.shear_factors().all(|k| k > 0.0 && k <= 1.0),
            "gives a shear factor that is not between 0 and 1, as Cowper's formula fails for \
             so flat a section with a negative ratio: choose a larger one, or give the \
             stiffnesses in place of a section",
        )?;
    }
    Ok(())
}

/// The outline, and the keys of its two sides.
fn outline(entries: &Entries) -> ScenarioResult<(Outline, [Key; 2])> {
    let item = entries.item(Key::SectionShape)?;
    let outline = item.word("must be \"circle\", \"ellipse\" or \"rectangle\"")?;
    let (sides, diameter) = ([Key::Width, Key::Thickness], [Key::Diameter; 2]);
    let (sides, others) = match outline {
        Outline::Circle => (diameter, sides),
        Outline::Ellipse | Outline::Rectangle => (sides, diameter),
    };
    match others.into_iter().find_map(|key| entries.given(key)) {
        None => Ok((outline, sides)),
        Some(other) => Err(other.refuse(
            "a circle has a diameter; an ellipse and a rectangle have a width (along d2) and a \
             thickness (along d3): leave this out, or change section.shape",
        )),
    }
}

/// The walls or bores of the rods; `None` if their sections are full.
fn hollow(
    entries: &Entries,
    outline: Outline,
    [width, thickness]: [&[Profile]; 2],
) -> ScenarioResult<Option<Vec<Hollow>>> {
    let (bore, wall) = (entries.given(Key::InnerDiameter), entries.given(Key::Wall));
    let Some(item) = bore.or(wall) else {
        return Ok(None);
    };
    if let Some(bore) = bore {
        let round = "belongs to a circle: give section.wall, the thickness of the wall";
        bore.ensure(outline == Outline::Circle, round)?;
        let twice = "section.wall is given, too: leave one of them out";
        bore.ensure(wall.is_none(), twice)?;
    }
    let profiles = item.quantity(width.len())?;
    for (rod, profile) in profiles.iter().enumerate() {
        let sides = [&width[rod], &thickness[rod]];
        let knots = [0.0, 1.0].into_iter();
        let inner = sides.into_iter().chain([profile]).flat_map(Profile::kinks);
        // Between knots all are linear.
        for sigma in knots.chain(inner.copied()) {
            let side = sides.map(|side| side.at(sigma));
            let (value, least) = (profile.at(sigma), side[0].min(side[1]));
            match bore {
                Some(_) => item.entry(rod).ensure(
                    value < least,
                    "must be less than section.diameter, all along the rod",
                )?,
                None => item.entry(rod).ensure(
                    2.0 * value <= least,
                    "must be at most half of the section's smaller side, all along the rod",
                )?,
            }
        }
    }
    let of = |profile| match bore {
        Some(_) => Hollow::Bore(profile),
        None => Hollow::Wall(profile),
    };
    Ok(Some(profiles.into_iter().map(of).collect()))
}

pub(super) fn poisson(item: Item, rods: usize) -> ScenarioResult<Vec<Profile>> {
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
