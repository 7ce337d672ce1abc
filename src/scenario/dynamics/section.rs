//! Moment of inertia of a round section.

use super::super::Profile;

/// rho I = density radius^2/4 at all knots of both profiles, and linear
/// between them. Where the radius varies this is a cubic along the rod, and
/// more than it between knots: whoever minds gives the radius at more knots.
pub(super) fn inertia(density: &Profile, radius: &Profile) -> Profile {
    let at_fraction = |sigma: f64| density.at(sigma) * radius.at(sigma).powi(2) / 4.0;
    if let (Profile::Constant(_), Profile::Constant(_)) = (density, radius) {
        return Profile::Constant(at_fraction(0.0));
    }
    let mut at = [&[0.0], density.kinks(), radius.kinks(), &[1.0]].concat();
    at.sort_by(f64::total_cmp);
    at.dedup();
    let value = at.iter().map(|&sigma| at_fraction(sigma)).collect();
    Profile::Linear { at, value }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn linear(at: &[f64], value: &[f64]) -> Profile {
        Profile::Linear {
            at: at.to_vec(),
            value: value.to_vec(),
        }
    }

    #[test]
    fn constants_give_a_constant() {
        let inertia = inertia(&Profile::Constant(3.0), &Profile::Constant(0.2));
        assert!(matches!(inertia, Profile::Constant(i) if (i - 0.03).abs() < 1e-17));
    }

    #[test]
    fn profiles_give_the_product_at_the_knots_of_both() {
        let density = linear(&[0.0, 0.5, 1.0], &[4.0, 2.0, 2.0]);
        let radius = linear(&[0.0, 0.25, 1.0], &[2.0, 2.0, 1.0]);
        let expected = linear(
            &[0.0, 0.25, 0.5, 1.0],
            &[4.0, 3.0, 0.5 * (5.0_f64 / 3.0).powi(2), 0.5],
        );
        assert_eq!(inertia(&density, &radius), expected);
    }

    #[test]
    fn with_one_radius_it_is_exact() {
        let density = linear(&[0.0, 1.0], &[4.0, 2.0]);
        let inertia = inertia(&density, &Profile::Constant(2.0));
        assert_eq!(inertia, density);
    }
}
