//! A scenario: the description of a leaf, read from TOML and checked once.
//!
//! All other modules rely on a [`Scenario`] being valid: lengths of lists agree,
//! stiffnesses are positive, angles finite.
//!
//! Where and how veins begin, and where along them nodes must be.
//!
//! Reads a scenario from a file or from text.

mod blade;
mod check;
pub(crate) mod format;
mod limits;
mod loads;
mod outline;
mod photo;
mod plausibility;
mod profile;
mod section;
mod supports;
crate::renamed! {
    Begin => BaseRotations,
    Part => EntryPath,
    PhotoRate => PhotoParameterDerivative,
    Place => SourceLocation,
    Start => MotionStart,
    Turning => ZeroEnergyRotation,
}

#[cfg(test)]
mod tests;
mod veins;

use crate::memory;
pub use crate::scenario::blade::{Blade, BladePart, BladeProperty};
pub use crate::scenario::format::Key;
pub(crate) use crate::scenario::format::ValueSchema;
pub use crate::scenario::format::entries::{Entries, EntryPath};
pub use crate::scenario::format::schema::schema;
pub(crate) use crate::scenario::format::source::intended_number;
use crate::scenario::format::source::line_of;
pub use crate::scenario::format::source::{ScenarioError, SourceLocation, printable};
pub use crate::scenario::format::units;
pub use crate::scenario::format::units::Units;
pub use crate::scenario::loads::{Dynamics, MotionStart, PointLoad, Weight, Wind};
pub use crate::scenario::outline::{Moduli, Stress};
pub use crate::scenario::photo::{Photo, PhotoParameterDerivative};
pub use crate::scenario::plausibility::PlausibilityWarning;
pub(crate) use crate::scenario::plausibility::{
    LARGEST_PLAUSIBLE_STRETCH, obstacle, out_of_reach, plausibility_warnings,
};
pub(crate) use crate::scenario::profile::sorted_distinct;
pub use crate::scenario::profile::{Profile, Schedule};
pub use crate::scenario::section::{Property, Radii, Section};
pub use crate::scenario::supports::{
    BaseRotations, Clamp, Grip, HeldTip, SupportKind, UnbalancedMoment, ZeroEnergyRotation,
};
pub use crate::scenario::veins::Tissue;
use glam::{DQuat, DVec3};
use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::Path;
use std::sync::Arc;
/// Values as they can be written.
pub use toml::{Table, Value};

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
    pub base_held: SupportKind,
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
        loads::natural_time_unit(self.scale(), &self.dynamics.density)
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

/// Places that differ by less are the same: no segment may be so short.
const PLACE_TOLERANCE: f64 = 1e-12;

impl Rod {
    /// The rotation of the directors at the base: by the fan's angle about e3, after the elevation
    /// about -e2, so that d1 = (cos e cos phi, cos e sin phi, sin e), after the roll about e1.
    pub fn base_rotation(&self) -> DQuat {
        let mut rotation = DQuat::from_rotation_z(self.angle);
        if self.elevation != 0.0 {
            rotation *= DQuat::from_rotation_y(-self.elevation);
        }
        if self.roll != 0.0 {
            rotation *= DQuat::from_rotation_x(self.roll);
        }
        rotation
    }

    /// Where it begins.
    pub fn base_position(&self) -> DVec3 {
        DVec3::from_array(self.base)
    }
}

impl Scenario {
    /// Where vein `j` begins, and the rotation of its directors there.
    pub fn base(&self, j: usize) -> (DVec3, DQuat) {
        let rod = &self.rods[j];
        (rod.base_position(), rod.base_rotation())
    }

    /// Fractions inside (0, 1) where a grid must have a node: kinks of stiffnesses, rest shapes,
    /// loads and the wind's width, points that are loaded, and the ends of what is gripped;
    /// ascending, each once, and none within rounding of another or of an end: what is there is at
    /// the nearest node.
    pub fn kinks(&self) -> Vec<f64> {
        let masses = (0..self.rods.len()).filter_map(|vein| self.weight(vein).of_mass);
        let profiles = self.rods.iter().flat_map(Rod::profiles);
        let profiles = profiles
            .chain(masses.map(|(_, mass)| mass))
            .chain(self.tissue.iter().flatten().flat_map(Tissue::profiles))
            .chain(self.distributed.iter().flatten().flatten())
            .chain(self.wind.iter().flat_map(|wind| &wind.width));
        let points = self.points.iter().map(|point| point.at);
        let ends = self.grips.iter().flat_map(|grip| grip.at);
        let inside = points.chain(ends);
        let all = profiles.flat_map(Profile::kinks).copied().chain(inside);
        let mut kinks =
            sorted_distinct(all.filter(|&at| at > PLACE_TOLERANCE && at < 1.0 - PLACE_TOLERANCE));
        kinks.dedup_by(|next, kept| *next - *kept <= PLACE_TOLERANCE);
        kinks
    }
}

/// Most bytes of a file; 100,000 rods with every quantity listed need fewer.
pub const MOST_BYTES: u64 = 64 << 20;

impl Scenario {
    /// Reads and checks the TOML in `text`, or the JSON of a [`Scenario`] or of a
    /// result with its `input`.
    ///
    /// ```
    /// let scenario = leafdyn::scenario::Scenario::from_toml(
    ///     r#"
    ///     name = "cantilever"
    ///     leaf = { rods = 1, length = 1.0, fan = [0.0] }
    ///     stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = inf, shear_2 = inf, shear_3 = inf }
    ///     load = { tip_force = [0.0, 0.0, -1.0] }
    ///     "#,
    /// )?;
    /// assert_eq!(scenario.rods.len(), 1);
    /// # Ok::<(), leafdyn::scenario::ScenarioError>(())
    /// ```
    pub fn from_toml(text: &str) -> Result<Scenario, ScenarioError> {
        Scenario::from_toml_with(text, "scenario", &[])
    }

    /// As [`Scenario::from_toml`], with the entries `overrides` replaced
    /// (`KEY=VALUE`, such as `load.gravity=[0,0,-0.5]`; the value is TOML, anything
    /// else is taken as text), or parts of them: one entry of a list
    /// (`load.gravity[2]=-1`, `stiffness.bending_2.value[0]=2`), or every number of
    /// a key multiplied (`scale:load.gravity=2`). Messages call the text `file`.
    pub fn from_toml_with(
        text: &str,
        file: &str,
        overrides: &[String],
    ) -> Result<Scenario, ScenarioError> {
        let entries = Entries::from_text(text, file)?;
        entries.replaced(overrides)?.check()
    }

    /// Reads and checks the file at `path`.
    pub fn read(path: impl AsRef<Path>) -> Result<Scenario, ScenarioError> {
        Scenario::read_with(path.as_ref(), &[])
    }

    /// As [`Scenario::read`], with the entries `overrides` replaced.
    pub fn read_with(path: &Path, overrides: &[String]) -> Result<Scenario, ScenarioError> {
        Scenario::from_toml_with(&text(path)?, &path.display().to_string(), overrides)
    }
}

/// Reads the text of a scenario's file.
///
/// # Errors
/// If it cannot be read, or is not text.
pub fn text(path: &Path) -> Result<String, ScenarioError> {
    decode_utf8(bytes(path)?, &path.display().to_string())
}

/// Reads a file, of at most one byte more than [`MOST_BYTES`].
///
/// # Errors
/// If it cannot be read.
pub fn bytes(path: &Path) -> Result<Vec<u8>, ScenarioError> {
    let file = path.display().to_string();
    let mut bytes = Vec::new();
    // Opening a folder succeeds on some systems, and reading it fails.
    File::open(path)
        .and_then(|file| file.take(MOST_BYTES + 1).read_to_end(&mut bytes))
        .map_err(|reason| match reason.kind() {
            ErrorKind::IsADirectory => {
                ScenarioError::in_file(&file, None, "is a folder: give the file itself".into())
            }
            _ => {
                let problem = format!("cannot be read: {reason}: check its path and permissions");
                ScenarioError::in_file(&file, None, problem)
            }
        })?;
    Ok(bytes)
}

/// Decodes the text of a scenario's `file` from its first bytes.
pub fn decode_utf8(bytes: Vec<u8>, file: &str) -> Result<String, ScenarioError> {
    if bytes.len() as u64 > MOST_BYTES {
        let problem = format!("is larger than {MOST_BYTES} bytes: this is no scenario");
        return Err(ScenarioError::in_file(file, None, problem));
    }
    memory::check_text_memory(&bytes)
        .map_err(|why| ScenarioError::in_file(file, None, why.to_string()))?;
    String::from_utf8(bytes).map_err(|error| {
        let offset = error.utf8_error().valid_up_to();
        let bytes = error.as_bytes();
        let byte = bytes[offset];
        let problem =
            format!("is not text in UTF-8: byte {offset} is 0x{byte:02x}: save the file as UTF-8");
        ScenarioError::in_file(file, Some(line_of(bytes, offset)), problem)
    })
}

#[cfg(test)]
mod base_tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    fn rod(angle: f64, elevation: f64) -> Rod {
        Rod {
            length: 1.0,
            base: [0.1, -0.2, 0.3],
            angle,
            elevation,
            roll: 0.0,
            couple_stiffness: [1.0; 3].map(Profile::Constant),
            force_stiffness: [1.0; 3].map(Profile::Constant),
            rest_curvature: [0.0; 3].map(Profile::Constant),
            rest_stretch: Profile::Constant(1.0),
        }
    }

    /// d2 stays in the plane of the fan, d3 leans back.
    #[test]
    fn a_vein_rises_from_the_plane_of_the_fan() {
        for (angle, elevation) in [(0.0, 0.0), (0.7, 0.4), (-2.0, -1.1), (0.3, FRAC_PI_2)] {
            let rod = rod(angle, elevation);
            let turn = rod.base_rotation();
            let ((sin, cos), (up, flat)) = (angle.sin_cos(), elevation.sin_cos());
            let directors = [
                DVec3::new(flat * cos, flat * sin, up),
                DVec3::new(-sin, cos, 0.0),
                DVec3::new(-up * cos, -up * sin, flat),
            ];
            for (axis, director) in [DVec3::X, DVec3::Y, DVec3::Z].into_iter().zip(directors) {
                assert!(
                    (turn * axis).distance(director) < 1e-15,
                    "{angle} {elevation}"
                );
            }
        }
        // Leaves that lie flat are what they always were, to the last bit.
        assert_eq!(rod(0.7, 0.0).base_rotation(), DQuat::from_rotation_z(0.7));
        assert_eq!(rod(0.7, 0.0).base_position(), DVec3::new(0.1, -0.2, 0.3));
    }
}
