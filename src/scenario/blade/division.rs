//! How the width of a blade is divided into strips, one a vein, such that the strips together shear, bend and
//! twist in the plane of the blade as a plate does.
//!
//! | | all veins in the middle of equal strips | the outermost veins are the margins (N > 2) |
//! | --- | --- | --- |
//! | place of vein j, of the half width | (2 j - N - 1)/N | (2 j - N - 1)/(N - 1) |
//! | gap w | W/N | W/(N - 1) |
//! | strip h | W/N | (2 N - 3) W/(4 N (N - 1)) at the margins, equal ones between |
//! | lever l | h | w |
//!
//! A vein bends in the plane by A3 = E t h l^2/12: the strips' A3 and their stretch, the sum of E t h y^2, are
//! together E t W^3/12. Their shear stiffness is H2 = f G t h, with the factor f such that slender bending has the
//! compliance of the plate, 6/(5 G t W): of equal strips f = 1 - 5/(6 N^2) + 2/(3 N^4).

/// The factor of transverse shear of a plate (E. Reissner, 1945).
pub const PLATE_SHEAR_FACTOR: f64 = 5.0 / 6.0;

/// The division of a blade into strips.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StripDivision {
    /// N, the number of veins.
    pub count: usize,
    /// Whether the outermost veins are the margins.
    pub edges: bool,
}

/// The strip of a vein, where the width is one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Strip {
    /// h, its width.
    pub width: f64,
    /// l, the lever of its bending in the plane.
    pub lever: f64,
    /// f, the factor of its shear in the plane.
    pub shear_factor: f64,
}

impl StripDivision {
    /// Where vein `j` lies: a fraction of the half width.
    pub fn vein_position(&self, j: usize) -> f64 {
        (2.0 * j as f64 + 1.0 - self.count as f64) * self.gap()
    }

    /// w, the distance of neighboring veins, where the width is one.
    pub fn gap(&self) -> f64 {
        let gaps = match self.has_margins() {
            true => self.count - 1,
            false => self.count,
        };
        1.0 / gaps as f64
    }

    fn has_margins(&self) -> bool {
        self.edges && self.count > 1
    }

    /// h of vein `j`, where the width is one.
    fn strip_width(&self, j: usize) -> f64 {
        let count = self.count as f64;
        if !self.has_margins() {
            return 1.0 / count;
        }
        let margin = (2.0 * count - 3.0) / (4.0 * count * (count - 1.0));
        match j == 0 || j + 1 == self.count {
            true => margin,
            false => (1.0 - 2.0 * margin) / (count - 2.0),
        }
    }

    /// The strip of vein `j`.
    pub fn strip(&self, j: usize) -> Strip {
        let width = self.strip_width(j);
        Strip {
            width,
            lever: match self.has_margins() {
                true => self.gap(),
                false => width,
            },
            shear_factor: self.shear_factor(),
        }
    }

    /// f: the shear flow between the strips follows from the balance of slender bending, and its energy
    /// is that of the plate.
    fn shear_factor(&self) -> f64 {
        let count = self.count as f64;
        if !self.has_margins() {
            return 1.0 - 5.0 / (6.0 * count.powi(2)) + 2.0 / (3.0 * count.powi(4));
        }
        let gap = self.gap();
        // First moments of the strips up to each gap, and the forces of the veins in proportion.
        let (mut before, mut forces) = (0.0, Vec::new());
        for j in 0..self.count {
            let h = self.strip_width(j);
            let behind = before - 0.5 * h * self.vein_position(j);
            forces.push(h * gap * gap / 12.0 + 0.5 * gap * (before + behind));
            before = behind;
        }
        let sum: f64 = forces.iter().sum();
        let energy = (0..self.count).map(|j| (forces[j] / sum).powi(2) / self.strip_width(j));
        PLATE_SHEAR_FACTOR * energy.sum::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_add_up_to_the_blade() {
        for count in 1..20 {
            for edges in [false, true] {
                if edges && count == 2 {
                    continue;
                }
                let division = StripDivision { count, edges };
                let each = (0..count).map(|j| (division.strip(j), division.vein_position(j)));
                let (mut width, mut second) = (0.0, 0.0);
                for (strip, eta) in each {
                    width += strip.width;
                    second += strip.width * (0.25 * eta * eta + strip.lever.powi(2) / 12.0);
                }
                assert!(f64::abs(width - 1.0) < 1e-14, "{division:?}");
                assert!(
                    f64::abs(12.0 * second - 1.0) < 1e-14,
                    "{division:?}: {second}"
                );
            }
        }
    }

    /// One strip has the factor of a beam; the others are those by which a lattice of springs shears as plane stress.
    #[test]
    fn the_factors_of_shear() {
        let factor = |count, edges| StripDivision { count, edges }.shear_factor();
        for edges in [false, true] {
            assert!((factor(1, edges) - PLATE_SHEAR_FACTOR).abs() < 1e-15);
        }
        for (count, wanted) in [
            (3, 0.989583),
            (4, 0.836041),
            (5, 0.861032),
            (9, 0.948051),
            (17, 0.984979),
        ] {
            let found = factor(count, true);
            assert!((found - wanted).abs() < 1e-6, "{count}: {found}");
        }
    }
}
