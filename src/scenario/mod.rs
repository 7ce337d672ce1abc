//! A scenario: the description of a leaf, read from TOML and checked once.
//!
//! All other modules rely on a [`Scenario`] being valid: lengths of lists agree,
//! stiffnesses are positive, angles finite.

mod base;
mod blade;
mod bounds;
mod check;
mod dynamics;
mod entries;
mod error;
mod excerpt;
mod form;
mod gauss;
mod grip;
mod hold;
mod item;
mod json;
mod key;
mod limits;
mod load_limits;
mod loads;
mod material;
mod mistakes;
mod moduli;
mod outline;
mod part;
mod photo;
mod profile;
mod read;
mod schedule;
mod schema;
mod section;
mod slips;
mod source;
mod spelling;
mod tip;
mod tissue;
mod turning;
pub mod units;
mod values;
mod vectors;
mod veins;
mod wind;

pub use blade::{Blade, BladePart, BladeProperty};
pub use dynamics::{Dynamics, Start};
pub use entries::Entries;
pub use error::{Place, ScenarioError};
pub use excerpt::printable;
pub(crate) use form::Form;
pub use grip::Grip;
pub use hold::Hold;
pub use key::Key;
pub use loads::{PointLoad, Weight};
pub use moduli::{Moduli, Stress};
pub use part::Part;
pub use photo::{Photo, PhotoRate};
pub use profile::Profile;
pub(crate) use profile::ascending;
pub use read::{MOST_BYTES, bytes, text, utf8};
pub use schedule::Schedule;
pub use schema::schema;
pub use section::{Property, Radii, Section};
pub(crate) use slips::{STRETCHED, obstacle, out_of_reach, slips};
pub use tip::{Clamp, HeldTip};
pub use tissue::Tissue;
/// Values as they can be written.
pub use toml::{Table, Value};
pub use turning::{Begin, Turning, UnbalancedMoment};
pub use units::Units;
pub(crate) use values::number_meant;
pub use wind::Wind;

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
    /// The blade that the veins and the tissue follow from, if it is given in place of them.
    pub blade: Option<Arc<Blade>>,
    /// What is held of the bases, unless [`Dynamics::clamped`] says that they are free.
    pub base_held: Hold,
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
    /// What the veins have besides, N entries; empty if they do not differ.
    pub own_gravity: Vec<[f64; 3]>,
    /// The acceleration of gravity, which pulls [`Dynamics::density`] and the masses of points.
    pub g: [f64; 3],
    /// Dead force per unit reference length along each vein, by components; `None` if there is none.
    pub distributed: Option<Vec<[Profile; 3]>>,
    /// Dead loads on points.
    pub points: Vec<PointLoad>,
    /// Dead force on the joint tip, or on every tip when the tips are free.
    pub tip_force: [f64; 3],
    /// Dead moment about the lab axes on the tip of a single rod.
    pub tip_moment: [f64; 3],
    /// The tip, if it is held.
    pub held_tip: Option<HeldTip>,
    /// Holders along the veins; no point has two.
    pub grips: Vec<Grip>,
    /// Wind.
    pub wind: Option<Wind>,
    /// How a photograph shows it, if points in one are data of a fit; equilibria do not depend on it.
    pub photo: Option<Photo>,
    /// Wanted accuracy of the centerlines, relative to the largest rod length.
    pub tolerance: f64,
    /// How the leaf moves; equilibria do not depend on it, but for the density if [`Scenario::g`]
    /// pulls it.
    pub dynamics: Dynamics,
}

impl Scenario {
    /// The units that make it dimensionless.
    pub fn scale(&self) -> Scale {
        Scale::of(&self.rods)
    }

    /// The natural unit of a quantity of this key.
    pub(crate) fn unit(&self, key: Key) -> f64 {
        if let (Key::PhotoX | Key::PhotoY, Some(photo)) = (key, &self.photo) {
            return self.scale().length / photo.scale;
        }
        self.scale().unit(key, self.time())
    }

    /// T: the natural unit of time, sqrt(rho L^4/A).
    fn time(&self) -> f64 {
        dynamics::time(self.scale(), &self.dynamics.density)
    }
}

/// One vein as a special Cosserat rod. Index 0 of every triple belongs to the
/// tangent-like director d1, so that a stiffness triple is (torsion, bending
/// about d2, bending about d3) or (axial, shear along d2, shear along d3).
#[derive(Clone, Debug, PartialEq)]
pub struct Rod {
    /// Reference length L.
    pub length: f64,
    /// Where it begins; the paper's rods all begin in the origin.
    pub base: [f64; 3],
    /// Base angle phi of d1(0) in the e1-e2 plane, in radians (paper, section 2.4 (c)).
    pub angle: f64,
    /// Angle of d1(0) above this plane, in radians.
    pub elevation: f64,
    /// Angle by which the section at the base is turned about d1, in radians; not zero for veins of a
    /// blade that rises as a whole.
    pub roll: f64,
    /// A1, A2, A3 of eq. (5): moment times length.
    pub couple_stiffness: [Profile; 3],
    /// H1, H2, H3 of eq. (6): a force; infinite means rigid.
    pub force_stiffness: [Profile; 3],
    /// u0: twist, bend about d2, bend about d3; per length. Along the rod
    /// d1' = u3 d2 - u2 d3 and d2' = u1 d3 - u3 d1: a positive bend about d2
    /// curves the rod towards -d3, in a fan at rest downwards, one about d3
    /// towards d2, and a positive twist turns d2 towards d3.
    pub rest_curvature: [Profile; 3],
    /// Growth of the rest length: an element ds rests at this factor times ds,
    /// v0 = (stretch, 0, 0); positive, 1 without growth.
    pub rest_stretch: Profile,
}

impl Rod {
    /// All profiles in its constitutive law.
    pub(crate) fn profiles(&self) -> impl Iterator<Item = &Profile> {
        let triples = [
            &self.couple_stiffness,
            &self.force_stiffness,
            &self.rest_curvature,
        ];
        triples.into_iter().flatten().chain([&self.rest_stretch])
    }
}

/// Units that make a leaf dimensionless: lengths in units of `length`, couple
/// stiffnesses in units of `stiffness`, hence forces in A/L^2, moments and energies in
/// A/L.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// L: the largest rod length.
    pub length: f64,
    /// A, the mean bending stiffness: geometric mean of the 2 N values of A2
    /// and A3 of the N rods at half their lengths, however long the rods are.
    pub stiffness: f64,
}

impl Scale {
    /// The units of these rods, of which there is at least one.
    pub fn of(rods: &[Rod]) -> Scale {
        let logs: f64 = rods
            .iter()
            .map(|rod| rod.couple_stiffness[1].at(0.5).ln() + rod.couple_stiffness[2].at(0.5).ln())
            .sum();
        Scale {
            length: longest(rods),
            stiffness: (logs / (2 * rods.len()) as f64).exp(),
        }
    }

    /// Unit of force, A/L^2.
    pub fn force(&self) -> f64 {
        self.stiffness / (self.length * self.length)
    }

    /// Unit of moment and of energy, A/L.
    pub fn moment(&self) -> f64 {
        self.stiffness / self.length
    }

    /// Unit of a quantity of this key, with this unit of time.
    fn unit(&self, key: Key, time: f64) -> f64 {
        let [length, force, times] = key.dimension();
        self.length.powi(length) * self.force().powi(force) * time.powi(times)
    }
}

/// L: the longest rod.
pub fn longest(rods: &[Rod]) -> f64 {
    rods.iter()
        .fold(0.0, |longest, rod| longest.max(rod.length))
}

#[cfg(test)]
mod tests;
