//! Stiffnesses and masses of a rod from its material and the size of its section: the table `[section]`.
//!
//! With the area S, the second moments I2 and I3 about d2 and d3 and the shear
//! modulus G, which is given or that of an isotropic material, E/(2 (1 + nu)):
//!
//! | | |
//! | --- | --- |
//! | torsion | A1 = G J |
//! | bending | A2 = E I2, A3 = E I3 |
//! | axial | H1 = E S |
//! | shear | H2 = k2 G S, H3 = k3 G S |
//! | density, squared radii of gyration | rho S; I2/S, I3/S |
//!
//! The torsion constants J are those of Saint-Venant (S. P. Timoshenko and J. N.
//! Goodier, Theory of Elasticity, 3rd ed., arts. 107 to 109), the shear factors k
//! those of G. R. Cowper, J. Appl. Mech. 33 (1966), 335; of hollow sections see `outline`, of triangles,
//! hexagons and channels `polygon`.
//! They depend on Poisson's ratio, for which a given G stands as well: see [`ShearLaw::equivalent_poisson`].

mod outline;
mod polygon;

use crate::numbers::sorted_distinct;
use crate::scenario::format::Key;
use crate::scenario::format::entries::Entries;
use crate::scenario::format::error::ScenarioResult;
use crate::scenario::format::item::EntryValue;
use crate::scenario::profile::{
    DerivedProfile, Profile, RodPlace, RodProperties, Side, knot_places,
};
use crate::scenario::section::outline::{ClosedOutline, SectionDimensions};
pub use crate::scenario::section::outline::{Moduli, Stress};
use crate::scenario::section::polygon::{LEAST_CHANNEL_GAP, PolygonSection};
use crate::words;
use std::any::Any;
use std::f64::consts::PI;
use std::sync::Arc;

/// A kink closer to a fraction of the length than this is there.
const SAME_KINK_DISTANCE: f64 = 1e-12;

/// Steps between two knots at which the extremes of a property are looked for: properties are smooth
/// between knots.
const STEPS_BETWEEN_KNOTS: usize = 16;

words! {
    /// The outline of a section.
    pub enum SectionOutline {
        /// A circle, whose width and thickness are the same.
        Circle = "circle",
        /// An ellipse with its width along d2 and its thickness along d3.
        Ellipse = "ellipse",
        /// A rectangle with its width along d2 and its thickness along d3.
        Rectangle = "rectangle",
        /// An isosceles triangle: its base along d2 below, its apex on the side of d3.
        Triangle = "triangle",
        /// A regular hexagon, its width across flats, along d2.
        Hexagon = "hexagon",
        /// A channel, open towards d3.
        U = "u",
    }
}

/// A section at one place along a rod.
#[derive(Clone, Copy, Debug)]
enum CrossSection {
    Closed(SectionDimensions),
    Polygon(PolygonSection),
}

impl CrossSection {
    /// `None` of a channel without a wall.
    fn new(
        outline: SectionOutline,
        width: f64,
        thickness: f64,
        wall: Option<f64>,
    ) -> Option<CrossSection> {
        let height = thickness;
        let closed = |outline| {
            CrossSection::Closed(SectionDimensions {
                outline,
                width,
                thickness,
                wall,
            })
        };
        Some(match outline {
            SectionOutline::Circle | SectionOutline::Ellipse => closed(ClosedOutline::Ellipse),
            SectionOutline::Rectangle => closed(ClosedOutline::Rectangle),
            SectionOutline::Triangle => {
                CrossSection::Polygon(PolygonSection::Triangle { width, height })
            }
            SectionOutline::Hexagon => CrossSection::Polygon(PolygonSection::Hexagon { width }),
            SectionOutline::U => CrossSection::Polygon(PolygonSection::Channel {
                width,
                height,
                wall: wall?,
            }),
        })
    }

    /// The area of the material.
    fn area(self) -> f64 {
        match self {
            CrossSection::Closed(section) => section.area(),
            CrossSection::Polygon(section) => section.area(),
        }
    }

    /// The area within the outline.
    fn enclosed_area(self) -> f64 {
        match self {
            CrossSection::Closed(section) => section.enclosed_area(),
            CrossSection::Polygon(section) => section.area(),
        }
    }

    /// The extent along d3.
    fn height(self) -> f64 {
        match self {
            CrossSection::Closed(section) => section.thickness,
            CrossSection::Polygon(section) => section.height(),
        }
    }

    /// The second moments I2 and I3 of the area, about d2 and d3.
    fn second_moments(self) -> [f64; 2] {
        match self {
            CrossSection::Closed(section) => section.second_moments(),
            CrossSection::Polygon(section) => section.second_moments(),
        }
    }

    /// The torsion constant J.
    fn torsion_constant(self) -> f64 {
        match self {
            CrossSection::Closed(section) => section.torsion_constant(),
            CrossSection::Polygon(section) => section.torsion_constant(),
        }
    }

    /// Factors for shear forces along d2 and along d3: Cowper's, which depend on Poisson's ratio, or Zhuravskii's.
    fn shear_factors(self, poisson: f64) -> [f64; 2] {
        match self {
            CrossSection::Closed(section) => section.shear_factors(poisson),
            CrossSection::Polygon(section) => section.shear_factors(),
        }
    }

    /// What the largest stresses in the section follow from.
    fn moduli(self) -> Moduli {
        match self {
            CrossSection::Closed(section) => section.moduli(),
            CrossSection::Polygon(section) => Moduli::for_polygon(section),
        }
    }
}

/// Moments of area of a full section.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SectionConstants {
    /// I2 and I3, about d2 and d3; length^4.
    pub second_moments: [f64; 2],
    /// The torsion constant J; length^4.
    pub torsion: f64,
}

impl SectionConstants {
    /// Those of an outline with this width, along d2, and thickness, along d3; of a circle the thickness alone counts,
    /// of a hexagon the width. `None` of a channel, which is not full.
    pub fn of_full_section(
        outline: SectionOutline,
        width: f64,
        thickness: f64,
    ) -> Option<SectionConstants> {
        let width = match outline {
            SectionOutline::Circle => thickness,
            _ => width,
        };
        let section = CrossSection::new(outline, width, thickness, None)?;
        Some(SectionConstants {
            second_moments: section.second_moments(),
            torsion: section.torsion_constant(),
        })
    }
}

/// A property that a section determines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Property {
    /// A1, A2 and A3, by index.
    Couple(usize),
    /// H1, H2 and H3, by index.
    Force(usize),
    /// Mass per length.
    Density,
    /// Squared radii of gyration about d2 and d3, by index: rotary inertia per mass.
    SquaredGyration(usize),
    /// Width along d2.
    Width,
}

impl Property {
    const ALL: [Property; 10] = {
        use Property::{Couple, Density, Force, SquaredGyration, Width};
        [
            Couple(0),
            Couple(1),
            Couple(2),
            Force(0),
            Force(1),
            Force(2),
            Density,
            SquaredGyration(0),
            SquaredGyration(1),
            Width,
        ]
    };

    /// The index of the property in [`Property::ALL`].
    fn index(self) -> usize {
        match self {
            Property::Couple(axis) => axis,
            Property::Force(axis) => 3 + axis,
            Property::Density => 6,
            Property::SquaredGyration(axis) => 7 + axis,
            Property::Width => 9,
        }
    }
}

/// The hole of a section, as it is given.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum HollowSection {
    /// The thickness of the wall.
    Wall(Profile),
    /// The inner diameter of a circle.
    Bore(Profile),
}

impl HollowSection {
    pub fn profile(&self) -> &Profile {
        match self {
            HollowSection::Wall(profile) | HollowSection::Bore(profile) => profile,
        }
    }
}

/// What gives the shear modulus of a material besides Young's modulus.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum ShearLaw {
    /// Poisson's ratio of an isotropic material.
    Poisson(Profile),
    /// The shear modulus itself.
    Modulus(Profile),
}

impl ShearLaw {
    pub fn profile(&self) -> &Profile {
        match self {
            ShearLaw::Poisson(profile) | ShearLaw::Modulus(profile) => profile,
        }
    }

    /// The shear modulus at a place where Young's modulus is `young`.
    fn modulus(&self, young: f64, place: RodPlace) -> f64 {
        match self {
            ShearLaw::Poisson(poisson) => young / (2.0 * (1.0 + poisson.at(place))),
            ShearLaw::Modulus(modulus) => modulus.at(place),
        }
    }

    /// Poisson's ratio of the isotropic material with the same shear factors.
    ///
    /// A bent rod contracts across by its ratio nu along the fibers. In the compatibility of its shear
    /// stresses that is a term 2 nu G/E, which is nu'/(1 + nu') in an isotropic rod of the ratio nu'. A
    /// given G says nu = E/(2 G) - 1 if the material is isotropic, which it is not where that is more
    /// than 1/2. Then nu is taken to be 1/2: with G = E/20 another one, from 0 on, changes the shear
    /// factors by less than 1 %.
    fn equivalent_poisson(&self, young: f64, place: RodPlace) -> f64 {
        match self {
            ShearLaw::Poisson(poisson) => poisson.at(place),
            ShearLaw::Modulus(modulus) => {
                let ratio = modulus.at(place) / young;
                let isotropic = 0.5 / ratio - 1.0;
                match isotropic <= LARGEST_POISSON {
                    true => isotropic,
                    false => ratio / (1.0 - ratio),
                }
            }
        }
    }
}

/// Largest Poisson's ratio of isotropic materials: that of incompressible ones.
const LARGEST_POISSON: f64 = 0.5;

/// The section of a rod and its material, along the rod.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Section {
    pub outline: SectionOutline,
    pub width: Profile,
    pub thickness: Profile,
    pub hollow: Option<HollowSection>,
    pub young: Profile,
    pub shear: ShearLaw,
    /// Mass per volume; zero where it is not given.
    pub mass_density: Profile,
    /// Fractions inside (0, 1) where the slope of a property may jump; twice where the property may.
    kinks: Vec<f64>,
    /// Least and largest value of every property, where they change along the rod: else the
    /// profiles are constant.
    extremes: [[f64; 2]; Property::ALL.len()],
}

impl Section {
    fn new(
        outline: SectionOutline,
        [width, thickness]: [Profile; 2],
        hollow: Option<HollowSection>,
        shear: ShearLaw,
        [young, mass_density]: [Profile; 2],
    ) -> Section {
        let mut section = Section {
            outline,
            width,
            thickness,
            hollow,
            young,
            shear,
            mass_density,
            kinks: Vec::new(),
            extremes: [[f64::INFINITY, f64::NEG_INFINITY]; Property::ALL.len()],
        };
        let knots = knot_places(section.profiles());
        let inner = knots[1..knots.len() - 1].iter();
        section.kinks = inner.map(|place| place.sigma).collect();
        let varies = !section.is_constant();
        for place in section.places().filter(|_| varies) {
            for property in Property::ALL {
                let value = section.property_value(property, place);
                let [least, most] = &mut section.extremes[property.index()];
                (*least, *most) = (least.min(value), most.max(value));
            }
        }
        section
    }

    /// This section of a material whose moduli are those of this one times `to/from`; `from` itself becomes `to`
    /// to the last digit.
    pub fn with_scaled_moduli(&self, from: f64, to: f64) -> Section {
        let scaled = |modulus: &Profile| match modulus {
            Profile::Constant(value) => Profile::Constant(to * (value / from)),
            varying => varying.scaled(to / from),
        };
        let shear = match &self.shear {
            ShearLaw::Poisson(poisson) => ShearLaw::Poisson(poisson.clone()),
            ShearLaw::Modulus(modulus) => ShearLaw::Modulus(scaled(modulus)),
        };
        Section::new(
            self.outline,
            [self.width.clone(), self.thickness.clone()],
            self.hollow.clone(),
            shear,
            [scaled(&self.young), self.mass_density.clone()],
        )
    }

    fn profiles(&self) -> impl Iterator<Item = &Profile> {
        let Section {
            width,
            thickness,
            hollow,
            young,
            shear,
            mass_density,
            ..
        } = self;
        let all = [width, thickness, young, shear.profile(), mass_density];
        all.into_iter()
            .chain(hollow.iter().map(HollowSection::profile))
    }

    /// Whether the section is the same along the whole rod.
    fn is_constant(&self) -> bool {
        let mut profiles = self.profiles();
        profiles.all(|profile| matches!(profile, Profile::Constant(_)))
    }

    /// The section at a place.
    fn cross_section_at(&self, place: impl Into<RodPlace>) -> CrossSection {
        let place = place.into();
        let (width, thickness) = (self.width.at(place), self.thickness.at(place));
        let wall = self.hollow.as_ref().map(|hollow| match hollow {
            HollowSection::Wall(wall) => wall.at(place),
            HollowSection::Bore(inner) => 0.5 * (width - inner.at(place)),
        });
        let section = CrossSection::new(self.outline, width, thickness, wall);
        // Scenarios of channels without a wall are refused.
        section.unwrap_or(CrossSection::Polygon(PolygonSection::Hexagon { width }))
    }

    /// A property at a place.
    fn property_value(&self, property: Property, place: impl Into<RodPlace>) -> f64 {
        let place = place.into();
        let sides = self.cross_section_at(place);
        let young = self.young.at(place);
        let shear = self.shear.modulus(young, place);
        let area = sides.area();
        let second = sides.second_moments();
        match property {
            Property::Couple(0) => shear * sides.torsion_constant(),
            Property::Couple(axis) => young * second[axis - 1],
            Property::Force(0) => young * area,
            Property::Force(axis) => self.shear_factors_at(place)[axis - 1] * shear * area,
            Property::Density => self.mass_density.at(place) * area,
            Property::SquaredGyration(axis) => second[axis] / area,
            Property::Width => self.width.at(place),
        }
    }

    /// A property along the rod.
    pub fn profile(self: &Arc<Section>, property: Property) -> Profile {
        match self.is_constant() {
            true => Profile::Constant(self.property_value(property, 0.5)),
            false => Profile::Derived(DerivedProfile::new(self.clone(), property.index(), 1.0)),
        }
    }

    /// Cowper's factors for both shear forces, at the knots and between them.
    fn shear_factors(&self) -> impl Iterator<Item = f64> {
        self.places().flat_map(|place| self.shear_factors_at(place))
    }

    /// Cowper's factors for both shear forces at a place.
    fn shear_factors_at(&self, place: RodPlace) -> [f64; 2] {
        let young = self.young.at(place);
        let poisson = self.shear.equivalent_poisson(young, place);
        self.cross_section_at(place).shear_factors(poisson)
    }

    /// The knots, and places between them.
    fn places(&self) -> impl Iterator<Item = RodPlace> + use<> {
        let edges = sorted_distinct([&[0.0], self.kinks.as_slice(), &[1.0]].concat());
        (0..edges.len() - 1).flat_map(move |panel| {
            let ends = [edges[panel], edges[panel + 1]];
            (0..=STEPS_BETWEEN_KNOTS).map(move |k| {
                let part = k as f64 / STEPS_BETWEEN_KNOTS as f64;
                RodPlace::within(ends[0] + part * (ends[1] - ends[0]), ends)
            })
        })
    }

    /// The sides on which the section is another one at a fraction of the length: both where it jumps.
    fn sides_at(&self, sigma: f64) -> &'static [Side] {
        let here = |kink: &f64| (kink - sigma).abs() <= SAME_KINK_DISTANCE;
        let mut pairs = self.kinks.windows(2);
        match pairs.any(|pair| pair[0] == pair[1] && here(&pair[0])) {
            true => &[Side::Base, Side::Tip],
            false => &[Side::Base],
        }
    }
}

impl RodProperties for Section {
    fn value_at(&self, property: usize, place: RodPlace) -> f64 {
        self.property_value(Property::ALL[property], place)
    }

    fn extremes(&self, property: usize) -> [f64; 2] {
        self.extremes[property]
    }

    fn kinks(&self) -> &[f64] {
        &self.kinks
    }

    fn as_any(&self) -> &dyn Any {
        self
    }

    fn has_equal_property(&self, _: usize, other: &dyn Any) -> bool {
        other.downcast_ref() == Some(self)
    }
}

/// Radii of the veins, from their sections. Computations use the stiffnesses alone: scenarios that
/// differ only in radii are equal.
#[derive(Clone, Debug, Default)]
pub struct Radii(Vec<Arc<Section>>);

impl Radii {
    pub(super) fn from_sections(sections: Vec<Arc<Section>>) -> Self {
        Radii(sections)
    }

    /// The sections; none where stiffnesses are given in place of them.
    pub(super) fn sections(&self) -> &[Arc<Section>] {
        &self.0
    }

    /// The radius of a rod at a fraction of its length: that of a circle with the area of
    /// the outline of its section. `None` if stiffnesses are given in place of sections.
    pub fn at(&self, rod: usize, sigma: f64) -> Option<f64> {
        let section = self.0.get(rod)?;
        Some((section.cross_section_at(sigma).enclosed_area() / PI).sqrt())
    }

    /// Half of the width of a rod's section, along d2, at a fraction of its length; `None` as of
    /// [`Radii::at`].
    pub fn half_width(&self, rod: usize, sigma: f64) -> Option<f64> {
        let section = self.0.get(rod)?;
        Some(0.5 * section.width.at(sigma))
    }

    /// The thickness of a rod's section, along d3, at a fraction of its length; `None` as of
    /// [`Radii::at`].
    pub fn thickness(&self, rod: usize, sigma: f64) -> Option<f64> {
        let section = self.0.get(rod)?;
        Some(section.cross_section_at(sigma).height())
    }

    /// The moduli of the section of a rod at a fraction of its length: of both sections where it jumps.
    pub(super) fn moduli(&self, rod: usize, sigma: f64) -> Vec<Moduli> {
        let sections = self.0.get(rod).into_iter();
        let sides = |section: &'_ Arc<Section>| {
            let of = |side: &Side| {
                section
                    .cross_section_at(RodPlace::new(sigma, *side))
                    .moduli()
            };
            section.sides_at(sigma).iter().map(of).collect::<Vec<_>>()
        };
        sections.flat_map(sides).collect()
    }

    /// Young's modulus of the section of a rod, if it is the same all along.
    pub(super) fn young(&self, rod: usize) -> Option<f64> {
        match self.0.get(rod)?.young {
            Profile::Constant(young) => Some(young),
            _ => None,
        }
    }

    /// The larger side of the section of a rod, where that is largest.
    pub fn largest_side(&self, rod: usize) -> Option<f64> {
        let section = self.0.get(rod)?;
        Some(section.width.max_abs().max(section.thickness.max_abs()))
    }

    /// The largest mass per volume; none where a section has none.
    pub(super) fn largest_mass_density(&self) -> Option<f64> {
        let densities = self.0.iter().map(|section| section.mass_density.max_abs());
        densities.reduce(f64::max).filter(|density| *density > 0.0)
    }

    /// The largest modulus of elasticity; none without sections.
    pub(super) fn largest_young(&self) -> Option<f64> {
        let moduli = self.0.iter().map(|section| section.young.max_abs());
        moduli.reduce(f64::max)
    }

    /// Whether the sections have a mass.
    pub fn have_mass(&self) -> bool {
        !self.0.is_empty()
            && self
                .0
                .iter()
                .all(|section| section.mass_density.min() > 0.0)
    }
}

impl PartialEq for Radii {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// The entry that gives the size of the sections or of the blade.
pub(super) fn size_entry(entries: &Entries) -> Option<EntryValue<'_>> {
    let sizes = [
        Key::Diameter,
        Key::Thickness,
        Key::Width,
        Key::BladeThickness,
    ];
    sizes.into_iter().find_map(|key| entries.given_value(key))
}

/// A property of the sections of all rods.
pub(super) fn section_profiles(sections: &[Arc<Section>], property: Property) -> Vec<Profile> {
    let profile = |section: &Arc<Section>| section.profile(property);
    sections.iter().map(profile).collect()
}

/// Reads `[section]`: the sections of the rods, which determine the stiffnesses; `None` if there is no
/// such table.
pub(super) fn read_sections(
    entries: &Entries,
    rods: usize,
) -> ScenarioResult<Option<Vec<Arc<Section>>>> {
    if !entries.has_key_of_table("section") {
        return Ok(None);
    }
    for key in Key::COUPLE.into_iter().chain(Key::FORCE) {
        if let Some(item) = entries.given_value(key) {
            let why = "[section] gives the stiffnesses: leave out either [stiffness] or [section]";
            return Err(item.value_error(why));
        }
    }
    let quantity = |key| entries.value_or_default(key)?.profile_per_rod(rods);
    let SectionForm { outline, sides } = read_form(entries)?;
    let [width, thickness] = [quantity(sides[0])?, quantity(sides[1])?];
    let hollow = read_hollow(entries, outline, [&width, &thickness])?;
    let young = quantity(Key::Young)?;
    let shear = read_shear_law(entries, rods)?;
    let mass_density = match entries.given_value(Key::MassDensity) {
        Some(item) => item.profile_per_rod(rods)?,
        None => vec![Profile::Constant(0.0); rods],
    };
    let all = [&width, &thickness, &young, &mass_density];
    let mut sections: Vec<Arc<Section>> = Vec::with_capacity(rods);
    for rod in 0..rods {
        let own = |rod: usize| hollow.as_ref().map(|hollow| &hollow[rod]);
        let same = rod > 0
            && all.iter().all(|values| values[rod] == values[rod - 1])
            && shear[rod] == shear[rod - 1]
            && own(rod) == own(rod - 1);
        sections.push(match sections.last() {
            Some(last) if same => last.clone(),
            _ => Arc::new(Section::new(
                outline,
                [&width, &thickness].map(|side| side[rod].clone()),
                own(rod).cloned(),
                shear[rod].clone(),
                [&young, &mass_density].map(|value| value[rod].clone()),
            )),
        });
    }
    check_shear_factors(entries, &sections)?;
    Ok(Some(sections))
}

/// Refuses flat sections of auxetic materials, for which Cowper's formula has no meaning.
fn check_shear_factors(entries: &Entries, sections: &[Arc<Section>]) -> ScenarioResult<()> {
    for (rod, section) in sections.iter().enumerate() {
        let (key, change) = match section.shear {
            ShearLaw::Poisson(_) => (Key::Poisson, "a negative ratio: choose a larger one"),
            ShearLaw::Modulus(_) => (
                Key::SectionShearModulus,
                "more than half of section.young: choose a smaller one",
            ),
        };
        entries.value_or_default(key)?.entry(rod).refuse_unless(
            section.shear_factors().all(|k| k > 0.0 && k <= 1.0),
            format_args!(
                "gives a shear factor that is not between 0 and 1, as Cowper's formula fails for \
                 so flat a section with {change}, or give the stiffnesses in place of a section"
            ),
        )?;
    }
    Ok(())
}

/// What gives the shear modulus of every rod.
fn read_shear_law(entries: &Entries, rods: usize) -> ScenarioResult<Vec<ShearLaw>> {
    let Some(item) = entries.given_value(Key::SectionShearModulus) else {
        let poisson = read_poisson(entries.value_or_default(Key::Poisson)?, rods)?;
        return Ok(poisson.into_iter().map(ShearLaw::Poisson).collect());
    };
    let twice = "section.poisson is given, too, from which the shear modulus follows as well: leave \
         one of them out";
    item.refuse_unless(entries.given_value(Key::Poisson).is_none(), twice)?;
    let modulus = item.profile_per_rod(rods)?;
    Ok(modulus.into_iter().map(ShearLaw::Modulus).collect())
}

/// The outline of a section, and the keys of its two sides, along d2 and along d3.
struct SectionForm {
    outline: SectionOutline,
    sides: [Key; 2],
}

fn read_form(entries: &Entries) -> ScenarioResult<SectionForm> {
    let item = entries.value_or_default(Key::SectionShape)?;
    let outline = item.word(
        "must be \"circle\", \"ellipse\", \"rectangle\", \"triangle\", \"hexagon\" or \"u\"",
    )?;
    let (width, thickness, diameter) = (Key::Width, Key::Thickness, Key::Diameter);
    let (sides, others) = match outline {
        SectionOutline::Circle => ([diameter; 2], &[width, thickness][..]),
        SectionOutline::Hexagon => ([width; 2], &[thickness, diameter][..]),
        SectionOutline::Ellipse
        | SectionOutline::Rectangle
        | SectionOutline::Triangle
        | SectionOutline::U => ([width, thickness], &[diameter][..]),
    };
    if let Some(other) = others.iter().find_map(|key| entries.given_value(*key)) {
        return Err(other.value_error(
            "a circle has a diameter; a hexagon has a width (across flats); all others have a width (along d2) and a \
             thickness (along d3): leave this out, or change section.shape",
        ));
    }
    let has_wall = entries.given_value(Key::Wall).is_some();
    item.refuse_unless(
        outline != SectionOutline::U || has_wall,
        "has a wall: give section.wall, the thickness of its web and of its flanges",
    )?;
    Ok(SectionForm { outline, sides })
}

/// The walls or bores of the rods; `None` if their sections are full.
fn read_hollow(
    entries: &Entries,
    outline: SectionOutline,
    [width, thickness]: [&[Profile]; 2],
) -> ScenarioResult<Option<Vec<HollowSection>>> {
    let (bore, wall) = (
        entries.given_value(Key::InnerDiameter),
        entries.given_value(Key::Wall),
    );
    let Some(item) = bore.or(wall) else {
        return Ok(None);
    };
    if let Some(bore) = bore {
        let round = "belongs to a circle: give section.wall, the thickness of the wall";
        bore.refuse_unless(outline == SectionOutline::Circle, round)?;
        let twice = "section.wall is given, too: leave one of them out";
        bore.refuse_unless(wall.is_none(), twice)?;
    }
    item.refuse_unless(
        !matches!(outline, SectionOutline::Triangle | SectionOutline::Hexagon),
        "triangles and hexagons are full: leave it out, or change section.shape",
    )?;
    let profiles = item.profile_per_rod(width.len())?;
    for (rod, profile) in profiles.iter().enumerate() {
        let sides = [&width[rod], &thickness[rod]];
        // Between knots all are linear.
        for place in knot_places(sides.into_iter().chain([profile])) {
            let side = sides.map(|side| side.at(place));
            let (value, least) = (profile.at(place), side[0].min(side[1]));
            let channel = outline == SectionOutline::U;
            match bore {
                _ if channel => {
                    let gap = side[0] - 2.0 * value;
                    let flange = side[1] - value;
                    item.entry(rod).refuse_unless(
                        gap.min(flange) >= LEAST_CHANNEL_GAP * value,
                        "must be at most a third of section.width and half of section.thickness, all along the \
                         rod: stouter channels twist as no thin walls do; give their stiffnesses",
                    )?;
                }
                Some(_) => item.entry(rod).refuse_unless(
                    value < least,
                    "must be less than section.diameter, all along the rod",
                )?,
                None => item.entry(rod).refuse_unless(
                    2.0 * value <= least,
                    "must be at most half of the section's smaller side, all along the rod",
                )?,
            }
        }
    }
    let of = |profile| match bore {
        Some(_) => HollowSection::Bore(profile),
        None => HollowSection::Wall(profile),
    };
    Ok(Some(profiles.into_iter().map(of).collect()))
}

/// Poisson's ratio along every rod.
pub(super) fn read_poisson(item: EntryValue, rods: usize) -> ScenarioResult<Vec<Profile>> {
    let poisson = item.profile_per_rod(rods)?;
    for (rod, profile) in poisson.iter().enumerate() {
        let most = profile.scaled(-1.0).min();
        item.entry(rod).refuse_unless(
            profile.min() > -1.0 && -most <= LARGEST_POISSON,
            "must be greater than -1 and at most 0.5, as of every isotropic material",
        )?;
    }
    Ok(poisson)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::Scenario;
    use leafdyn_testing::pairs;

    fn section(outline: SectionOutline, width: f64, thickness: f64, poisson: f64) -> Section {
        let constant = Profile::Constant;
        let shear = ShearLaw::Poisson(constant(poisson));
        let sides = [constant(width), constant(thickness)];
        let material = [constant(2.0), constant(3.0)];
        Section::new(outline, sides, None, shear, material)
    }

    #[track_caller]
    fn close(found: f64, wanted: f64, relative: f64) {
        assert!((found / wanted - 1.0).abs() < relative, "{found} {wanted}");
    }

    /// A round section of diameter d: J = pi d^4/32, I = pi d^4/64, Cowper's factor
    /// 6 (1 + nu)/(7 + 6 nu).
    #[test]
    fn an_ellipse_with_equal_axes_is_a_circle() {
        let nu = 0.37;
        let circle = section(SectionOutline::Ellipse, 0.2, 0.2, nu);
        let (shear, area) = (2.0 / (2.0 * (1.0 + nu)), PI * 0.01);
        let i = PI * 0.2_f64.powi(4) / 64.0;
        let factor = 6.0 * (1.0 + nu) / (7.0 + 6.0 * nu);
        for (property, value) in [
            (Property::Couple(0), shear * 2.0 * i),
            (Property::Couple(1), 2.0 * i),
            (Property::Couple(2), 2.0 * i),
            (Property::Force(0), 2.0 * area),
            (Property::Force(1), factor * shear * area),
            (Property::Force(2), factor * shear * area),
            (Property::Density, 3.0 * area),
            (Property::SquaredGyration(0), 0.2_f64.powi(2) / 16.0),
            (Property::SquaredGyration(1), 0.2_f64.powi(2) / 16.0),
        ] {
            close(circle.property_value(property, 0.5), value, 1e-14);
        }
    }

    /// The stiff direction of a flat section is sideways: A3 about d3, H2 along d2.
    #[test]
    fn a_flat_section_is_soft_up_and_down() {
        let flat = section(SectionOutline::Rectangle, 0.4, 0.1, 0.3);
        let [up, sideways] = [1, 2].map(|k| flat.property_value(Property::Couple(k), 0.0));
        close(up, 2.0 * 0.4 * 1e-3 / 12.0, 1e-14);
        close(sideways, 2.0 * 0.1 * 0.064 / 12.0, 1e-14);
        let ellipse = section(SectionOutline::Ellipse, 0.4, 0.1, 0.3);
        assert!(
            ellipse.property_value(Property::Force(1), 0.0)
                > ellipse.property_value(Property::Force(2), 0.0)
        );
        // It turns more easily out of its plane: (diameter/4)^2.
        for (axis, gyration) in [0.1 / 4.0, 0.4 / 4.0].into_iter().enumerate() {
            let squared = ellipse.property_value(Property::SquaredGyration(axis), 0.0);
            close(squared, gyration * gyration, 1e-14);
        }
    }

    #[test]
    fn hollow_sections_are_read_refused_and_written() {
        let text = |section: &str| {
            format!(
                "name = 'tube'\nleaf = {{ rods = 2, length = 1, fan = 'symmetric' }}\nsection = {{ {section}, young = 1 }}"
            )
        };
        let table = r#"
            shape = 'circle', diameter = [0.1, 0.2], wall = 0.06 => section.wall = 0.06: must be at most half of the section's smaller side
            shape = 'rectangle', width = 0.4, thickness = { at = [0, 0.5, 1], value = [0.1, 0.05, 0.1] }, wall = 0.03 => at most half of
            shape = 'ellipse', width = 0.4, thickness = 0.1, inner_diameter = 0.05 => belongs to a circle: give section.wall
            shape = 'circle', diameter = 0.1, inner_diameter = [0.05, 0.1] => section.inner_diameter, entry 2 = 0.1: must be less
            shape = 'circle', diameter = 0.1, wall = 0 => must be greater than 0
        "#;
        for (section, said) in pairs(table) {
            let refused = Scenario::from_toml(&text(section)).unwrap_err().to_string();
            assert!(refused.contains(said), "{section}: {refused}");
        }
        // A bore and its wall are the same tube, and a bore of nothing none.
        let of = |section: &str| Scenario::from_toml(&text(section)).unwrap();
        let bore = of("shape = 'circle', diameter = 0.5, inner_diameter = 0.25, mass_density = 1");
        let wall = of("shape = 'circle', diameter = 0.5, wall = 0.125, mass_density = 1");
        assert_eq!(bore, wall);
        for leaf in [&bore, &wall] {
            let again = Scenario::from_toml(&serde_json::to_string(leaf).unwrap());
            assert_eq!(again.unwrap(), *leaf);
        }
        let full = of("shape = 'circle', diameter = 0.5, mass_density = 1");
        let none = of("shape = 'circle', diameter = 0.5, inner_diameter = 0, mass_density = 1");
        let stiffness = |leaf: &Scenario| {
            let rod = &leaf.rods[0];
            let all = rod.couple_stiffness.iter().chain(&rod.force_stiffness);
            all.map(|it| it.at(0.0)).collect::<Vec<f64>>()
        };
        for (one, other) in stiffness(&full).into_iter().zip(stiffness(&none)) {
            assert!((one / other - 1.0).abs() < 1e-13, "{one} {other}");
        }
        assert_eq!(full.dynamics.density[0], Profile::Constant(PI / 16.0));
    }
}
