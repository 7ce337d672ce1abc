//! The veins of a leaf and the tissue between them: their quantities, the units that make a leaf
//! dimensionless, and how both are read, from numbers, from sections or from a blade.

use crate::scenario::blade::{Blade, BladeParts, BladeProperty, read_blade};
use crate::scenario::format::Key;
use crate::scenario::format::entries::Entries;
use crate::scenario::format::error::ScenarioResult;
use crate::scenario::format::item::EntryValue;
use crate::scenario::profile::Profile;
use crate::scenario::section::{self, Property, Radii, Section};
use glam::{DQuat, DVec3};
use std::f64::consts::PI;
use std::sync::Arc;

/// One vein as a special Cosserat rod. Index 0 of every triple belongs to the
/// tangent-like director d1, so that a stiffness triple is (torsion, bending
/// about d2, bending about d3) or (axial, shear along d2, shear along d3).
#[derive(Clone, Debug, PartialEq)]
pub struct Rod {
    /// Reference length L.
    pub length: f64,
    /// Where the rod begins; the paper's rods all begin in the origin.
    pub base: [f64; 3],
    /// Base angle phi of d1(0) in the e1-e2 plane, in radians (paper, section 2.4 (c)).
    pub angle: f64,
    /// Angle of d1(0) above the e1-e2 plane, in radians.
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
    /// All profiles in the constitutive law of the rod.
    pub(crate) fn constitutive_profiles(&self) -> impl Iterator<Item = &Profile> {
        let triples = [
            &self.couple_stiffness,
            &self.force_stiffness,
            &self.rest_curvature,
        ];
        triples.into_iter().flatten().chain([&self.rest_stretch])
    }

    /// Whether another rod has the same length, base and rest shape.
    pub(crate) fn has_same_rest_shape(&self, other: &Rod) -> bool {
        let place = |rod: &Rod| (rod.length, rod.base, [rod.angle, rod.elevation, rod.roll]);
        place(self) == place(other)
            && self.rest_curvature == other.rest_curvature
            && self.rest_stretch == other.rest_stretch
    }

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

    /// The position of the base.
    pub fn base_position(&self) -> DVec3 {
        DVec3::from_array(self.base)
    }
}

/// Units that make a leaf dimensionless: lengths in units of `length`, couple
/// stiffnesses in units of `stiffness`, hence forces in A/L^2, moments and energies in
/// A/L.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// L, the length of the longest rod.
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

    /// The natural unit of the quantity of a key, with this unit of time.
    pub(super) fn unit(&self, key: Key, time: f64) -> f64 {
        let [length, force, times] = key.dimension();
        self.length.powi(length) * self.force().powi(force) * time.powi(times)
    }
}

/// L, the length of the longest rod.
pub fn longest(rods: &[Rod]) -> f64 {
    rods.iter()
        .fold(0.0, |longest, rod| longest.max(rod.length))
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
    /// Poisson's ratio times the width of the gap: by so much, times the strain v1 - 1 of its veins, the
    /// gap narrows without force, and by so much, times their curvature u2, it folds without moment.
    pub contraction: Profile,
}

impl Default for Tissue {
    fn default() -> Self {
        Tissue {
            stiffness: [0.0; 3].map(Profile::Constant),
            fold: Profile::Constant(0.0),
            contraction: Profile::Constant(0.0),
        }
    }
}

impl Tissue {
    /// k1, k2, k3 and c1 along the gap.
    pub(crate) fn stiffness_profiles(&self) -> [&Profile; 4] {
        let [along, across, normal] = &self.stiffness;
        [along, across, normal, &self.fold]
    }

    /// Whether it is rigid in some direction.
    pub fn is_rigid(&self) -> bool {
        let rigid = |k: &Profile| k.at(0.5) == f64::INFINITY;
        self.stiffness.iter().any(rigid)
    }

    /// Whether its forces are unknowns beside those of the veins: it is rigid, or contracts.
    pub fn has_unknown_forces(&self) -> bool {
        self.is_rigid() || self.contraction.max_abs() > 0.0
    }

    /// Everything that may vary along the gap.
    pub(crate) fn profiles(&self) -> [&Profile; 5] {
        let [along, across, normal, fold] = self.stiffness_profiles();
        [along, across, normal, fold, &self.contraction]
    }
}

/// What the stiffnesses of the veins follow from.
pub(super) enum StiffnessSource {
    /// Stiffnesses as numbers.
    Stiffnesses,
    Sections(Vec<Arc<Section>>),
    Blade {
        blade: Arc<Blade>,
        parts: BladeParts,
    },
}

impl StiffnessSource {
    pub fn from_entries(entries: &Entries, rods: usize) -> ScenarioResult<StiffnessSource> {
        if let Some(blade) = read_blade(entries, rods)? {
            return Ok(StiffnessSource::from_blade(Arc::new(blade)));
        }
        Ok(match section::read_sections(entries, rods)? {
            Some(sections) => StiffnessSource::Sections(sections),
            None => StiffnessSource::Stiffnesses,
        })
    }

    pub fn from_blade(blade: Arc<Blade>) -> StiffnessSource {
        let parts = blade.parts();
        StiffnessSource::Blade { blade, parts }
    }

    pub fn blade(&self) -> Option<&Arc<Blade>> {
        match self {
            StiffnessSource::Blade { blade, .. } => Some(blade),
            _ => None,
        }
    }

    pub fn radii(&self) -> Radii {
        match self {
            StiffnessSource::Sections(sections) => Radii::from_sections(sections.clone()),
            _ => Radii::default(),
        }
    }

    /// The rotary inertia per length about d2 and d3 along veins of these densities, as sections or the strips of a blade
    /// determine it; `None` if numbers are given.
    pub fn rotary_inertia(&self, density: &[Profile]) -> Option<Vec<[Profile; 2]>> {
        let gyration = |axis| self.property_profiles(Property::SquaredGyration(axis));
        let each = density.iter().zip(gyration(0)?).zip(gyration(1)?);
        let inertia = |((density, about_2), about_3): ((&Profile, Profile), Profile)| {
            [density.times(&about_2), density.times(&about_3)]
        };
        Some(each.map(inertia).collect())
    }

    /// A property along all veins, as sections or a blade determine it; `None` if numbers are given.
    pub fn property_profiles(&self, property: Property) -> Option<Vec<Profile>> {
        match self {
            StiffnessSource::Stiffnesses => None,
            StiffnessSource::Sections(sections) => {
                Some(section::section_profiles(sections, property))
            }
            StiffnessSource::Blade { parts, .. } => Some(parts.profiles(property.into())),
        }
    }
}

/// Reads `leaf.joined`: whether the tips are joined. The tips of a blade are if it ends in a point.
pub(super) fn read_joined(entries: &Entries, blade: Option<&Arc<Blade>>) -> ScenarioResult<bool> {
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

/// Reads the quantities of all veins.
pub(super) fn read_veins(
    entries: &Entries,
    rods: usize,
    source: &StiffnessSource,
) -> ScenarioResult<Vec<Rod>> {
    let quantity = |key| entries.value_or_default(key)?.profile_per_rod(rods);
    let triple = |keys: [Key; 3], of: fn(usize) -> Property| -> ScenarioResult<[Vec<Profile>; 3]> {
        let one = |axis: usize| match source.property_profiles(of(axis)) {
            Some(profiles) => Ok(profiles),
            None => quantity(keys[axis]),
        };
        Ok([one(0)?, one(1)?, one(2)?])
    };
    let rest_of_blade = |axis: usize| match source {
        StiffnessSource::Blade { blade, parts } if axis == 2 || blade.curvature().is_some() => {
            Some(parts.profiles(BladeProperty::Rest(axis)))
        }
        _ => None,
    };
    let rest = |axis: usize| match rest_of_blade(axis) {
        Some(profiles) => Ok(profiles),
        None => quantity(Key::REST_CURVATURE[axis]),
    };
    let (length, base, directions) = match source {
        StiffnessSource::Blade { blade, parts } => (
            parts.lengths(),
            parts.bases(),
            parts.directions(blade.elevation),
        ),
        _ => {
            let angle = read_fan_angles(entries.value_or_default(Key::Fan)?, rods)?.into_iter();
            let each = angle.zip(
                entries
                    .value_or_default(Key::Elevation)?
                    .number_for_each(rods)?,
            );
            (
                entries
                    .value_or_default(Key::Length)?
                    .number_for_each(rods)?,
                entries.value_or_default(Key::Base)?.vector_per_rod(rods)?,
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
fn read_fan_angles(item: EntryValue, rods: usize) -> ScenarioResult<Vec<f64>> {
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

/// Reads `[tissue]` of a leaf with so many gaps, or takes it from a blade; `None` if no gap has any.
pub(super) fn read_tissue(
    entries: &Entries,
    gaps: usize,
    source: &StiffnessSource,
) -> ScenarioResult<Option<Vec<Tissue>>> {
    if let StiffnessSource::Blade { parts, .. } = source {
        let rigid = || Profile::Constant(f64::INFINITY);
        let gap = |[across, fold, contraction]: [Profile; 3]| Tissue {
            stiffness: [rigid(), across, rigid()],
            fold,
            contraction,
        };
        let of_blade = || parts.tissue_profiles().into_iter().map(gap).collect();
        return Ok((gaps > 0).then(of_blade));
    }
    let mut tissue = vec![Tissue::default(); gaps];
    let keys = Key::TISSUE.into_iter().chain([Key::TissueContraction]);
    for (which, key) in keys.enumerate() {
        let Some(item) = entries.given_value(key) else {
            continue;
        };
        let why = "tissue lies between veins: it needs leaf.rods = 2 or more";
        item.refuse_unless(gaps > 0, why)?;
        for (gap, stiffness) in tissue.iter_mut().zip(item.number_for_each(gaps)?) {
            match which {
                3 => gap.fold = Profile::Constant(stiffness),
                4 => gap.contraction = Profile::Constant(stiffness),
                axis => gap.stiffness[axis] = Profile::Constant(stiffness),
            }
        }
    }
    let some = tissue.iter().any(|gap| *gap != Tissue::default());
    Ok(some.then_some(tissue))
}

#[cfg(test)]
mod tests {
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
