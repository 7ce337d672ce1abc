//! Thickness and moduli of the veins of a blade.

use crate::scenario::Profile;

/// Thickness and material of a vein with its tissue.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    pub thickness: Profile,
    pub young: Profile,
    /// Left out: as along the veins.
    pub young_across: Option<Profile>,
    /// Left out: that of an isotropic material.
    pub shear_modulus: Option<Profile>,
    pub poisson: Profile,
    /// Mass per volume.
    pub mass_density: Option<Profile>,
}

/// Thickness and moduli at one place.
pub struct Local {
    pub t: f64,
    pub young: f64,
    pub across: f64,
    pub shear: f64,
}

impl Material {
    pub fn at(&self, sigma: f64) -> Local {
        let young = self.young.at(sigma);
        let across = self.young_across.as_ref();
        let shear = self.shear_modulus.as_ref();
        Local {
            t: self.thickness.at(sigma),
            young,
            across: across.map_or(young, |it| it.at(sigma)),
            shear: shear.map_or_else(
                || young / (2.0 * (1.0 + self.poisson.at(sigma))),
                |it| it.at(sigma),
            ),
        }
    }

    fn profiles(&self) -> impl Iterator<Item = &Profile> {
        let given = [&self.thickness, &self.young, &self.poisson];
        let others = [&self.young_across, &self.shear_modulus, &self.mass_density];
        given.into_iter().chain(others.into_iter().flatten())
    }

    pub fn kinks(&self) -> impl Iterator<Item = f64> {
        self.profiles().flat_map(Profile::kinks).copied()
    }
}
