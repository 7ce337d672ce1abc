//! The checked scenario, and what follows from it alone.

use crate::numbers::sorted_distinct;
use crate::scenario::blade::Blade;
use crate::scenario::format::Key;
use crate::scenario::format::places::SAME_PLACE_DISTANCE;
use crate::scenario::format::units::Units;
use crate::scenario::loads::{
    Dynamics, FactoredLoads, Landing, PointLoad, Weight, Wind, natural_time_unit,
};
use crate::scenario::photo::Photo;
use crate::scenario::profile::Profile;
use crate::scenario::schedule::Schedule;
use crate::scenario::section::{Moduli, Property, Radii, Section};
use crate::scenario::support_motion::SupportMotion;
use crate::scenario::supports::{BaseSpin, BaseSupport, Grip, HeldTip};
use crate::scenario::veins::{Rod, Scale, Tissue};
use glam::{DQuat, DVec3};
use std::sync::Arc;

/// A checked scenario. All quantities are in the units the file was written
/// in, which only have to be consistent with each other.
#[derive(Clone, Debug, PartialEq)]
pub struct Scenario {
    /// Name of the scenario; output goes to `out/<name>` by default.
    pub name: String,
    /// Names of the units, for axes; nothing is converted.
    pub units: Units,
    /// The veins, from one edge of the leaf to the other; at least one.
    pub rods: Vec<Rod>,
    /// Radii of the veins where sections are given: for pictures.
    pub radii: Radii,
    /// The blade that the veins and the tissue follow from, if a blade is given in place of them.
    pub blade: Option<Arc<Blade>>,
    /// What is held of the base of each rod, unless [`Dynamics::clamped`] says that they are free.
    pub base_held: Vec<BaseSupport>,
    /// The moment per radian by which the base of each rod is held in its natural direction if it is elastic;
    /// empty unless some base is.
    pub base_turn_stiffness: Vec<f64>,
    /// Whether bases on hinges may spin.
    pub base_spin: BaseSpin,
    /// Whether all tips share one point.
    pub joined: bool,
    /// Coupling stiffness of each gap between neighbouring rods along the lab
    /// axes x, y, z: force per unit displacement and unit length of leaf, the
    /// length of a gap being the mean of its two rods'. N - 1 entries.
    pub coupling: Vec<[f64; 3]>,
    /// Tissue in each gap, N - 1 entries; `None` if there is none.
    pub tissue: Option<Vec<Tissue>>,
    /// Whether the tissue has grown with the veins, or is that of veins whose rest length has not:
    /// [`Rod::rest_stretch`] then strains it.
    pub tissue_grown: bool,
    /// Gravity, force per unit reference length, on every vein; [`Scenario::weight`] has all of it.
    pub gravity: [f64; 3],
    /// Gravity that each vein has besides, N entries; empty if veins do not differ.
    pub own_gravity: Vec<[f64; 3]>,
    /// The acceleration of gravity, which pulls [`Dynamics::density`] and the masses of points.
    pub g: [f64; 3],
    /// Whether that acceleration pulls the masses of points alone, as the mass per length is left out: motions have
    /// the default one.
    pub weighs_points_only: bool,
    /// Dead force per unit reference length along each vein, by components; `None` if there is none.
    pub distributed: Option<Vec<[Profile; 3]>>,
    /// Stiffness, per unit reference length, of springs along each vein that hold it in its natural place,
    /// by lab axes; `None` if there is none.
    pub foundation: Option<Vec<[Profile; 3]>>,
    /// Gravity, [`Scenario::g`] and the distributed loads in time, if a factor multiplies them; those at rest are
    /// those of time 0.
    pub factored: Option<Box<FactoredLoads>>,
    /// Force per unit reference length along each vein that turns with its sections, by components along
    /// the directors d1, d2, d3; `None` if there is none.
    pub follower: Option<Vec<[Profile; 3]>>,
    /// Moment per unit reference length along each vein, by components; `None` if there is none.
    pub couple: Option<Vec<[Profile; 3]>>,
    /// Whether that moment turns with the sections: its components are along the directors then, else
    /// along the lab axes.
    pub couple_follows: bool,
    /// Loads on points.
    pub points: Vec<PointLoad>,
    /// Dead force on the joint tip, or on every tip when the tips are free.
    pub tip_force: [f64; 3],
    /// Dead moment about the lab axes on the tip of a single rod.
    pub tip_moment: [f64; 3],
    /// The tip, if it is held.
    pub held_tip: Option<HeldTip>,
    /// Holders along the veins; no point has two.
    pub grips: Vec<Grip>,
    /// The supports that move in time, if any do; at rest they are where they are at time 0.
    pub support_motion: Option<Box<SupportMotion>>,
    /// Wind.
    pub wind: Option<Wind>,
    /// How a photograph shows the leaf, if points in a photograph are data of a fit; equilibria do not
    /// depend on it.
    pub photo: Option<Photo>,
    /// Wanted accuracy of the centerlines, relative to the largest rod length.
    pub tolerance: f64,
    /// The natural leaf, if the rest shapes of the veins have changed since.
    pub natural: Option<NaturalShapes>,
    /// Largest shift, as a fraction of the length, of a place along the veins that is read as one with others.
    pub place_shift: f64,
    /// How the leaf moves; equilibria do not depend on it, but for the density if [`Scenario::g`]
    /// pulls it.
    pub dynamics: Dynamics,
}

/// The rest shapes of the natural leaf, in which holders and tissue have their places.
#[derive(Clone, Debug, PartialEq)]
pub struct NaturalShapes {
    /// The scenario with these rest shapes.
    pub scenario: Arc<Scenario>,
    /// By which factor all rest curvatures have changed since.
    pub factor: f64,
}

impl Scenario {
    /// Whether every base is held in its direction, rigidly, if it is held at all.
    pub fn all_bases_clamped(&self) -> bool {
        let clamped = |held: &BaseSupport| *held == BaseSupport::Clamped;
        self.base_held.iter().all(clamped)
    }

    /// The stiffness of the spring at the base of rod `j`, moment per radian; zero without one.
    pub fn base_spring_stiffness(&self, j: usize) -> f64 {
        match self.base_held[j] {
            BaseSupport::Elastic => self.base_turn_stiffness[j],
            BaseSupport::Clamped | BaseSupport::Pinned => 0.0,
        }
    }

    /// Whether the base of rod `j` is on a hinge that holds its spin.
    pub fn holds_base_spin(&self, j: usize) -> bool {
        self.base_spin == BaseSpin::Held && self.base_held[j] == BaseSupport::Pinned
    }

    /// The units that make the leaf dimensionless.
    pub fn scale(&self) -> Scale {
        Scale::of(&self.rods)
    }

    /// The natural unit of the quantity of a key.
    pub(crate) fn unit(&self, key: Key) -> f64 {
        if let (Key::PhotoX | Key::PhotoY, Some(photo)) = (key, &self.photo) {
            return self.scale().length / photo.scale;
        }
        self.scale().unit(key, self.natural_time())
    }

    /// T: the natural unit of time, sqrt(rho L^4/A).
    pub(super) fn natural_time(&self) -> f64 {
        natural_time_unit(self.scale(), &self.dynamics.density)
    }
}

/// The fractions inside (0, 1) where nodes must be, ascending, and of other places of kinks those that are not
/// beside another: a grid without a node at such a kink misses it by less than its segments could tell.
pub(crate) fn distinct_places(
    nodes: impl Iterator<Item = f64>,
    kinks: impl Iterator<Item = f64>,
) -> Vec<f64> {
    let inside = |at: &f64| *at > SAME_PLACE_DISTANCE && *at < 1.0 - SAME_PLACE_DISTANCE;
    let mut places = sorted_distinct(nodes.filter(inside));
    places.dedup_by(|next, kept| *next - *kept <= SAME_PLACE_DISTANCE);
    for kink in sorted_distinct(kinks.filter(inside)) {
        let next = places.partition_point(|&place| place < kink);
        let mut beside = places[next.saturating_sub(1)..].iter().take(2);
        if beside.all(|place| (place - kink).abs() > SAME_PLACE_DISTANCE) {
            places.insert(next, kink);
        }
    }
    places
}

impl Scenario {
    /// Where vein `j` begins, and the rotation of its directors there.
    pub fn base(&self, j: usize) -> (DVec3, DQuat) {
        let rod = &self.rods[j];
        (rod.base_position(), rod.base_rotation())
    }

    /// Fractions inside (0, 1) where a grid must have a node: kinks of stiffnesses, rest shapes,
    /// loads and the wind's width, points that are loaded, and the ends of what is gripped;
    /// ascending, each once. Where kinks that follow from a blade are as close to another place as places that are
    /// read as one, the grid has one node.
    pub fn kinks(&self) -> Vec<f64> {
        let masses = (0..self.rods.len()).filter_map(|vein| self.weight(vein).of_mass);
        let factored = self.factored.iter().flat_map(|loads| {
            let all = [&loads.distributed, &loads.follower, &loads.couple];
            all.into_iter().flatten().flatten().flatten()
        });
        let profiles = self.rods.iter().flat_map(Rod::constitutive_profiles);
        let profiles = profiles
            .chain(masses.map(|(_, mass)| mass))
            .chain(self.tissue.iter().flatten().flat_map(Tissue::profiles))
            .chain(self.distributed.iter().flatten().flatten())
            .chain(self.foundation.iter().flatten().flatten())
            .chain(self.follower.iter().flatten().flatten())
            .chain(self.couple.iter().flatten().flatten())
            .chain(factored)
            .chain(self.wind.iter().flat_map(|wind| &wind.width));
        let points = self.points.iter().map(|point| point.at);
        let ends = self.grips.iter().flat_map(|grip| grip.at);
        let (given, derived): (Vec<&Profile>, Vec<&Profile>) =
            profiles.partition(|profile| matches!(profile, Profile::Linear { .. }));
        let [given, derived] = [given, derived].map(|all| all.into_iter().flat_map(Profile::kinks));
        distinct_places(points.chain(ends).chain(given.copied()), derived.copied())
    }

    /// Fractions inside (0, 1) where a stiffness or a rest shape jumps, and with it the strains of a rod.
    pub fn strain_jumps(&self) -> Vec<f64> {
        let profiles = self.rods.iter().flat_map(Rod::constitutive_profiles);
        let pairs = profiles.flat_map(|profile| profile.kinks().windows(2));
        let jumps = pairs.filter(|pair| pair[0] == pair[1]);
        sorted_distinct(jumps.map(|pair| pair[0]))
    }

    /// Whether all tips are held: as `[tip]` says, or by grips.
    pub fn holds_all_tips(&self) -> bool {
        let gripped = |vein: usize| {
            let mut grips = self.grips.iter().filter(|grip| grip.vein == vein);
            grips.any(|grip| grip.at[1] == 1.0 && grip.rigid_axes() == [true; 3])
        };
        self.held_tip.is_some() || (0..self.rods.len()).all(gripped)
    }

    /// Whether tissue, which has no force in the natural leaf, or grips and a foundation, which hold veins
    /// where they are in it, make a leaf depend on shapes at rest in another way than by their strains.
    pub fn needs_stress_free_leaf(&self) -> bool {
        self.tissue.is_some() || !self.grips.is_empty() || self.foundation.is_some()
    }

    /// The weight of a vein per reference length.
    pub fn weight(&self, vein: usize) -> Weight<'_> {
        let own = self.own_gravity.get(vein).copied().unwrap_or([0.0; 3]);
        let pulls = self.g != [0.0; 3] && !self.weighs_points_only;
        Weight {
            even: [0, 1, 2].map(|axis| self.gravity[axis] + own[axis]),
            of_mass: pulls.then(|| (self.g, &self.dynamics.density[vein])),
        }
    }

    /// This leaf without weight, loads and wind; what is held of it stays where it is.
    pub fn unloaded(&self) -> Scenario {
        let none = [0.0; 3];
        Scenario {
            gravity: none,
            own_gravity: Vec::new(),
            g: none,
            distributed: None,
            factored: None,
            follower: None,
            couple: None,
            points: Vec::new(),
            tip_force: none,
            tip_moment: none,
            wind: None,
            photo: None,
            dynamics: self.dynamics.clone().with_loads(none, none, none),
            ..self.clone()
        }
    }

    /// Whether veins have loads of their own besides the gravity that all share.
    pub fn has_own_loads(&self) -> bool {
        let weights = !self.own_gravity.is_empty() || self.g != [0.0; 3];
        let some = weights || self.distributed.is_some() || !self.points.is_empty();
        some || self.factored.is_some()
    }

    /// The factors in time of loads of single veins: that of all their weights and distributed loads, if there is
    /// one, and those of points.
    pub fn load_factors(&self) -> impl Iterator<Item = &Schedule<f64>> {
        let of_all = self.factored.iter().map(|loads| &loads.factor);
        let points = self.points.iter().filter_map(|it| it.in_time.as_ref());
        of_all.chain(points.map(|varying| &varying.factor))
    }

    /// The masses that land on points, in the order of the points, each with its number.
    pub fn landings(&self) -> impl Iterator<Item = (usize, Landing)> {
        let points = self.points.iter().enumerate();
        points.filter_map(|(number, point)| Some((number, point.landing?)))
    }

    /// The scenario whose loads at rest are those of this one at a time.
    pub fn at_time(&self, time: f64) -> Scenario {
        let mut at = self.clone();
        at.apply_load_factor(time);
        at.points = self.points.iter().map(|it| it.at_time(time)).collect();
        at.gravity = self.dynamics.gravity.at(time);
        at.tip_force = self.dynamics.tip_force.at(time);
        at.tip_moment = self.dynamics.tip_moment.at(time);
        at
    }

    /// Sets the loads that `load.factor` multiplies to those of a time.
    pub(super) fn apply_load_factor(&mut self, time: f64) {
        let Some(loads) = self.factored.as_ref().map(|loads| loads.at_time(time)) else {
            return;
        };
        self.gravity = loads.gravity;
        self.own_gravity = loads.own_gravity;
        self.g = loads.g;
        self.distributed = loads.distributed;
        self.follower = loads.follower;
        self.couple = loads.couple;
    }

    /// The keys that make rods rigid, with their value, as in `stiffness.axial, stiffness.shear_2 = inf`; empty if
    /// none is.
    pub(crate) fn rigid_keys_text(&self) -> String {
        let is_rigid = |direction: usize| {
            let mut rods = self.rods.iter();
            rods.any(|rod| rod.force_stiffness[direction].max_abs().is_infinite())
        };
        let keys = [Key::Axial, Key::Shear2, Key::Shear3];
        let rigid = (0..3).filter(|&direction| is_rigid(direction));
        let rigid: Vec<&str> = rigid.map(|direction| keys[direction].path()).collect();
        match rigid.is_empty() {
            true => String::new(),
            false => format!("{} = inf", rigid.join(", ")),
        }
    }

    /// The key, or the table, of something that acts on single veins or on each of them, so that the
    /// leaf with another number of veins is another one: loads per vein, points, grips, couplings
    /// and wind. `None` where all follows from a blade as a whole.
    pub fn key_of_loads_on_veins(&self) -> Option<&'static str> {
        let acts = |load: &[f64; 3]| *load != [0.0; 3];
        let free_tips = !self.joined && self.rods.len() > 1;
        let blade_mass = self.blade.as_ref().is_some_and(|blade| blade.has_mass());
        let keys = [
            (!self.grips.is_empty(), "grip"),
            (self.foundation.is_some(), Key::FoundationStiffness.path()),
            (!self.points.is_empty(), "load.point"),
            (
                acts(&self.gravity) || !self.own_gravity.is_empty(),
                Key::Gravity.path(),
            ),
            (self.distributed.is_some(), Key::Distributed.path()),
            (self.follower.is_some(), Key::Follower.path()),
            (self.couple.is_some(), Key::Couple.path()),
            (free_tips && acts(&self.tip_force), Key::TipForce.path()),
            (self.coupling.iter().any(acts), "coupling"),
            (
                self.wind.is_some() && !self.wind_width_follows_from_source(),
                Key::WindWidth.path(),
            ),
            (acts(&self.g) && !blade_mass, Key::Density.path()),
        ];
        keys.into_iter().find_map(|(acts, key)| acts.then_some(key))
    }

    /// Whether loads that turn with the sections, or moments along veins, vary in time: at rest they may be zero.
    pub fn has_followers_in_time(&self) -> bool {
        let turns = |point: &PointLoad| point.follows && point.in_time.is_some();
        let factored = self.factored.as_ref();
        factored.is_some_and(|loads| loads.follower.is_some() || loads.couple.is_some())
            || self.points.iter().any(turns)
    }

    /// Whether loads act at rest that turn with the sections, or moments along veins: they have no potential, and
    /// act on any vein.
    pub fn has_followers(&self) -> bool {
        let acts = |point: &PointLoad| {
            point.follows && (point.force != [0.0; 3] || point.moment != [0.0; 3])
        };
        self.follower.is_some() || self.couple.is_some() || self.points.iter().any(acts)
    }

    /// Whether dead moments act at rest on a single rod, at its tip or on points.
    pub fn has_moments(&self) -> bool {
        let on_points = || {
            let mut points = self.points.iter();
            points.any(|point| !point.follows && point.moment != [0.0; 3])
        };
        self.tip_moment != [0.0; 3] || on_points()
    }

    /// The scenario without loads that have no potential: those that turn with the sections, moments and wind.
    pub(crate) fn with_potential(&self) -> Scenario {
        let without = |point: &PointLoad| PointLoad {
            force: if point.follows { [0.0; 3] } else { point.force },
            moment: [0.0; 3],
            ..point.clone()
        };
        Scenario {
            follower: None,
            couple: None,
            wind: None,
            tip_moment: [0.0; 3],
            points: self.points.iter().map(without).collect(),
            ..self.clone()
        }
    }

    /// Whether all rods begin in the origin, in the plane z = 0.
    pub(crate) fn is_fan(&self) -> bool {
        let in_plane = |rod: &Rod| rod.base == [0.0; 3] && rod.elevation == 0.0;
        self.rods.iter().all(in_plane)
    }

    /// Whether no base, weight, load or displacement of a grip leads out of the plane z = 0.
    pub fn is_loaded_in_plane(&self) -> bool {
        let flat = |load: [f64; 3]| load[2] == 0.0;
        let even = |vein: usize| flat(self.weight(vein).even);
        self.rods
            .iter()
            .all(|rod| flat(rod.base) && rod.elevation == 0.0)
            && (0..self.rods.len()).all(even)
            && flat(self.g)
            && (self.distributed.iter().flatten()).all(|load| load[2].max_abs() == 0.0)
            && (self.points.iter()).all(|point| flat(point.force) && point.offset[1] == 0.0)
            && self.grips.iter().all(|grip| flat(grip.displacement))
            && flat(self.tip_force)
            && !self.has_moments()
            && !self.has_followers()
            && self.wind.is_none()
    }

    /// The sum of all weights, and of the dead loads along veins and on points.
    pub fn total_load(&self) -> DVec3 {
        let length: f64 = self.rods.iter().map(|rod| rod.length).sum();
        let mut total = length * DVec3::from_array(self.gravity);
        for (vein, rod) in self.rods.iter().enumerate() {
            let Weight { even, of_mass } = self.weight(vein);
            let own = DVec3::from_array(even) - DVec3::from_array(self.gravity);
            total += rod.length * own;
            if let Some((g, mass)) = of_mass {
                total += rod.length * mass.integral(1.0) * DVec3::from_array(g);
            }
            for load in self.distributed.iter().map(|all| &all[vein]) {
                let sums = load.each_ref().map(|one| one.integral(1.0));
                total += rod.length * DVec3::from_array(sums);
            }
        }
        let points = self
            .points
            .iter()
            .map(|point| DVec3::from_array(self.force_on(point)));
        total + points.sum::<DVec3>()
    }

    /// The dead force on a point: what is given, unless it follows the section, and the weight of its
    /// mass.
    pub fn force_on(&self, point: &PointLoad) -> [f64; 3] {
        let given = if point.follows { [0.0; 3] } else { point.force };
        [0, 1, 2].map(|axis| given[axis] + point.mass * self.g[axis])
    }

    /// The moduli of a rod's section at a fraction of its length, of both sections where it jumps; of a
    /// blade those of the strip of a vein, as wide as its stiffnesses are computed from. None if
    /// stiffnesses are given in place of sections.
    pub fn moduli(&self, rod: usize, sigma: f64) -> Vec<Moduli> {
        let (Some(blade), Some(vein)) = (&self.blade, self.rods.get(rod)) else {
            return self.radii.moduli(rod, sigma);
        };
        // H1 = E h t and A3/H1 = l^2/12.
        let stretch = vein.force_stiffness[0].at(sigma);
        let thickness = blade.thickness(rod, sigma);
        let width = stretch / (blade.young(rod, sigma) * thickness);
        let lever = (12.0 * vein.couple_stiffness[2].at(sigma) / stretch).sqrt();
        vec![Moduli::for_strip(width, thickness, lever)]
    }

    /// Whether sections give the stiffnesses of all rods.
    pub(super) fn stiffnesses_follow_from_sections(&self) -> bool {
        let sections = self.radii.sections();
        let gives = |(rod, section): (&Rod, &Arc<Section>)| {
            (0..3).all(|axis| {
                rod.couple_stiffness[axis] == section.profile(Property::Couple(axis))
                    && rod.force_stiffness[axis] == section.profile(Property::Force(axis))
            })
        };
        sections.len() == self.rods.len() && self.rods.iter().zip(sections).all(gives)
    }

    /// Multiplies the moduli of all sections, and the stiffnesses that follow from them, by `to/from`. False where
    /// sections do not give all stiffnesses: then nothing changes.
    pub(crate) fn scale_section_moduli(&mut self, from: f64, to: f64) -> bool {
        if !self.stiffnesses_follow_from_sections() {
            return false;
        }
        let scaled = |section: &Arc<Section>| Arc::new(section.with_scaled_moduli(from, to));
        let sections: Vec<Arc<Section>> = self.radii.sections().iter().map(scaled).collect();
        let each = self.radii.sections().iter().zip(&sections);
        for (vein, (before, section)) in each.enumerate() {
            let rod = &mut self.rods[vein];
            for axis in 0..3 {
                rod.couple_stiffness[axis] = section.profile(Property::Couple(axis));
                rod.force_stiffness[axis] = section.profile(Property::Force(axis));
            }
            let dynamics = &mut self.dynamics;
            let density_before = dynamics.density[vein].clone();
            if density_before == before.profile(Property::Density) {
                dynamics.density[vein] = section.profile(Property::Density);
            }
            if let Some(wind) = &mut self.wind
                && wind.width[vein] == before.profile(Property::Width)
            {
                wind.width[vein] = section.profile(Property::Width);
            }
            for (axis, of_vein) in dynamics.rotary_inertia[vein].iter_mut().enumerate() {
                let gyration = Property::SquaredGyration(axis);
                if *of_vein == density_before.times(&before.profile(gyration)) {
                    *of_vein = dynamics.density[vein].times(&section.profile(gyration));
                }
            }
        }
        self.radii = Radii::from_sections(sections);
        true
    }

    /// The thickness of a rod's section, or of a blade along a vein, at a fraction of its length, if one of them is given.
    pub(crate) fn thickness(&self, rod: usize, sigma: f64) -> Option<f64> {
        match &self.blade {
            Some(blade) => Some(blade.thickness(rod, sigma)),
            None => self.radii.thickness(rod, sigma),
        }
    }

    /// Young's modulus of a rod's section, or of a blade along a vein, if one of them is given and the modulus is the
    /// same all along.
    pub fn young(&self, rod: usize) -> Option<f64> {
        if let Some(blade) = &self.blade {
            let young = blade.young(rod, 0.0);
            let places = (0..=16).map(|k| f64::from(k) / 16.0);
            let alike = |sigma: f64| blade.young(rod, sigma) == young;
            return places.into_iter().all(alike).then_some(young);
        }
        self.radii.young(rod)
    }
}
