//! Weight, and loads on points and along veins.

use glam::DVec3;

use super::entries::Entries;
use super::error::ScenarioResult;
use super::item::Item;
use super::key::Key;
use super::{Profile, Scenario};

/// A dead load on a point of a vein.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointLoad {
    /// The vein, counted from 0.
    pub vein: usize,
    /// Where, as a fraction of its length in (0, 1].
    pub at: f64,
    /// The force, besides the weight of the mass.
    pub force: [f64; 3],
    /// The moment about the lab axes; zero unless the leaf is a single rod.
    pub moment: [f64; 3],
    /// The mass, which [`Scenario::g`] pulls; not negative.
    pub mass: f64,
}

/// The weight of a vein per reference length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weight<'s> {
    /// The part that is the same all along the vein.
    pub even: [f64; 3],
    /// The acceleration of gravity, and the mass per length that it pulls, if any.
    pub of_mass: Option<([f64; 3], &'s Profile)>,
}

impl Weight<'_> {
    /// The weight per length at a fraction of the length.
    pub fn at(&self, sigma: f64) -> [f64; 3] {
        let Some((g, mass)) = self.of_mass else {
            return self.even;
        };
        let mass = mass.at(sigma);
        [0, 1, 2].map(|axis| self.even[axis] + mass * g[axis])
    }
}

impl Scenario {
    /// The weight of a vein per reference length.
    pub fn weight(&self, vein: usize) -> Weight<'_> {
        let own = self.own_gravity.get(vein).copied().unwrap_or([0.0; 3]);
        let pulls = self.g != [0.0; 3];
        Weight {
            even: [0, 1, 2].map(|axis| self.gravity[axis] + own[axis]),
            of_mass: pulls.then(|| (self.g, &self.dynamics.density[vein])),
        }
    }

    /// The same leaf without weight, loads and wind; what is held of it stays where it is.
    pub fn unloaded(&self) -> Scenario {
        let none = [0.0; 3];
        Scenario {
            gravity: none,
            own_gravity: Vec::new(),
            g: none,
            distributed: None,
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
        weights || self.distributed.is_some() || !self.points.is_empty()
    }

    /// Whether dead moments act at rest.
    pub fn has_moments(&self) -> bool {
        let on_points = || self.points.iter().any(|point| point.moment != [0.0; 3]);
        self.tip_moment != [0.0; 3] || on_points()
    }

    /// Whether all rods begin in the origin, in the plane z = 0.
    pub(crate) fn is_fan(&self) -> bool {
        let in_plane = |rod: &super::Rod| rod.base == [0.0; 3] && rod.elevation == 0.0;
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
            && self.points.iter().all(|point| flat(point.force))
            && self.grips.iter().all(|grip| flat(grip.displacement))
            && flat(self.tip_force)
            && !self.has_moments()
            && self.wind.is_none()
    }

    /// The sum of all weights, and of the loads along veins and on points.
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

    /// The force on a point: what is given, and the weight of its mass.
    pub fn force_on(&self, point: &PointLoad) -> [f64; 3] {
        [0, 1, 2].map(|axis| point.force[axis] + point.mass * self.g[axis])
    }
}

/// Reads `load.gravity`: the weight that all rods share, and their own besides; empty if these do
/// not differ.
pub(super) fn gravity(entries: &Entries, rods: usize) -> ScenarioResult<([f64; 3], Vec<[f64; 3]>)> {
    let item = entries.item(Key::Gravity)?;
    let each = item.vectors(rods)?;
    let first = each.first().copied().unwrap_or([0.0; 3]);
    if each.iter().all(|own| *own == first) {
        return Ok((first, Vec::new()));
    }
    item.ensure(
        !entries.is_given(Key::GravityInTime),
        "dynamics.gravity, one vector for all rods, would replace these: leave one of them out",
    )?;
    Ok(([0.0; 3], each))
}

/// Reads `load.g`, which needs a mass.
pub(super) fn g(entries: &Entries) -> ScenarioResult<[f64; 3]> {
    let item = entries.item(Key::G)?;
    let g = item.vector()?;
    let masses = [Key::Density, Key::MassDensity, Key::BladeMassDensity];
    let has_mass = masses.into_iter().any(|key| entries.is_given(key));
    item.ensure(
        has_mass || g == [0.0; 3],
        "is an acceleration and needs the mass that it pulls: give dynamics.density, or \
         mass_density in [section] or [blade]; a force per length is load.gravity",
    )?;
    Ok(g)
}

/// Reads `load.distributed`; `None` if it is left out or zero.
pub(super) fn distributed(entries: &Entries, rods: usize) -> ScenarioResult<Option<Vec<[Profile; 3]>>> {
    let Some(item) = entries.given(Key::Distributed) else {
        return Ok(None);
    };
    let loads = item.vector_profiles(rods)?;
    let some = loads.iter().flatten().any(|load| load.max_abs() > 0.0);
    Ok(some.then_some(loads))
}

/// Reads `[[load.point]]`.
pub(super) fn points(entries: &Entries, rods: usize) -> ScenarioResult<Vec<PointLoad>> {
    let count = entries.rows("load.point").unwrap_or(0);
    (0..count).map(|row| point(entries, row, rods)).collect()
}

fn point(entries: &Entries, row: usize, rods: usize) -> ScenarioResult<PointLoad> {
    let item = |key| entries.item_of(key, row);
    let turned = item(Key::PointMoment)?;
    let moment = turned.vector()?;
    on_one_rod(turned, rods, &[moment])?;
    Ok(PointLoad {
        vein: item(Key::PointVein)?.whole(rods)? - 1,
        at: item(Key::PointAt)?.fraction()?,
        force: item(Key::PointForce)?.vector()?,
        moment,
        mass: item(Key::PointMass)?.number()?,
    })
}

/// Refuses moments on more than one rod.
pub(super) fn on_one_rod(item: Item, rods: usize, moments: &[[f64; 3]]) -> ScenarioResult<()> {
    let allowed = rods == 1 || moments.iter().all(|moment| *moment == [0.0; 3]);
    let (what, why) = match item.key() {
        Key::PointMoment => ("on a point", "a dead moment has no potential"),
        _ => ("at the tip", "joined tips pass on no moment"),
    };
    item.ensure(
        allowed,
        format_args!("a moment {what} needs leaf.rods = 1 (here {rods}): {why}"),
    )
}
