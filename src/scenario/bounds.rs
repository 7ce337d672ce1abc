//! Bounds on dimensionless numbers, and what the checks of combinations of values share.

use super::error::ScenarioResult;
use super::item::Item;
use super::key::Key;
use super::{Profile, Rod, Scale};

/// The range of a dimensionless number.
pub(super) struct Limit {
    /// The number.
    pub formula: &'static str,
    pub least: f64,
    pub most: f64,
    /// What the symbols mean, why there is a limit, and what to change.
    pub because: &'static str,
}

impl Limit {
    pub fn check(&self, item: Item, value: f64) -> ScenarioResult<()> {
        let limit = match value {
            _ if value > self.most => self.most,
            _ if value < self.least => self.least,
            _ => return Ok(()),
        };
        let (formula, because) = (self.formula, self.because);
        Err(item.refuse(format_args!(
            "gives {formula} = {value:.3e}, the limit is {limit:e}: {because}"
        )))
    }

    /// Checks the extremes of a profile of each rod, in this unit.
    pub fn check_profiles(&self, item: Item, profiles: &[Profile], unit: f64) -> ScenarioResult<()> {
        for (index, profile) in profiles.iter().enumerate() {
            for value in extremes(profile) {
                self.check(item.entry(index), value / unit)?;
            }
        }
        Ok(())
    }
}

/// The least and the largest value of a quantity that is positive. The mass of a blade may vanish at
/// its ends: then the largest twice.
pub(super) fn extremes(profile: &Profile) -> [f64; 2] {
    let (least, most) = (profile.min(), profile.max_abs());
    match profile {
        Profile::Blade { .. } if least == 0.0 => [most; 2],
        _ => [least, most],
    }
}

pub(super) const fn most(formula: &'static str, most: f64, because: &'static str) -> Limit {
    Limit {
        formula,
        least: 0.0,
        most,
        because,
    }
}

/// Within a factor of `most` of 1.
pub(super) const fn near_one(formula: &'static str, most: f64, because: &'static str) -> Limit {
    Limit {
        formula,
        least: 1.0 / most,
        most,
        because,
    }
}

/// Loads at rest and in time. A rod in tension F turns within sqrt(A/F) of
/// its ends: at the limit, within 1e-4 of its length.
pub(super) const GRAVITY: Limit = most("|g| L^3/A", 1e8, CONFINED);
pub(super) const TIP_FORCE: Limit = most("|F| L^2/A", 1e8, CONFINED);
pub(super) const TIP_MOMENT: Limit = most("|M| L/A", 1e8, WOUND);
/// Times of loads and factors.
pub(super) const TIME: Limit = most("|t|/T", 1e12, UNIT);

const CONFINED: &str = "A is the smallest bending stiffness of a rod and L its length; \
     beyond the limit bending is confined to less than 1e-4 of the length: lower the load or stiffen the rods";
const WOUND: &str = "A is the smallest bending stiffness of the rod and L its length; \
     the rod would roll up by this many radians: lower the moment or stiffen the rod";
pub(super) const UNIT: &str = "T = sqrt(rho_mean L^4/A) is the natural unit of time, with the longest rod L and \
     the means rho_mean and A of the densities and bending stiffnesses mid-rod: \
     choose a value, or a density, that brings this closer to 1";

/// The length of a rod and its smallest bending stiffness anywhere along it.
pub(super) fn softest(rod: &Rod) -> Scale {
    let [_, second, third] = &rod.couple_stiffness;
    Scale {
        length: rod.length,
        stiffness: second.min().min(third.min()),
    }
}

/// The smallest unit of a quantity of this key, which has no times, of all rods.
pub(super) fn smallest_unit(key: Key, rods: &[Rod]) -> f64 {
    let units = rods.iter().map(|rod| softest(rod).unit(key, 1.0));
    units.fold(f64::INFINITY, f64::min)
}

pub(super) fn norm([x, y, z]: [f64; 3]) -> f64 {
    // hypot avoids overflow of the squares of large components.
    x.hypot(y).hypot(z)
}
