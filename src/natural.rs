//! The natural leaf: every vein in its rest shape, each from its base, unloaded and tied to nothing,
//!
//! x' = L R v0,   q' = L/2 (R u0) q,
//!
//! integrated by the explicit Runge-Kutta method of order 8 of Dormand and Prince in equal steps.

use crate::scenario::{Profile, Rod, Scenario};
use crate::tableau::{A, B, C, STAGES};
use glam::{DQuat, DVec3};

/// Largest rotation in a step, in radians: its error is rounding.
const TURN: f64 = 0.1;

/// Longest step, so that profiles that bend little but vary are resolved.
const STEP: f64 = 1.0 / 16.0;

/// The natural leaf, in the units of the scenario.
#[derive(Clone, Debug)]
pub struct Natural<'a> {
    scenario: &'a Scenario,
    /// Whether the rest lengths have grown.
    grown: bool,
    /// Of every vein the fractions of its length where a step ends, with the states there.
    veins: Vec<Vec<(f64, Vein)>>,
}

/// A vein at one sigma.
type Vein = (DVec3, DQuat);

impl<'a> Natural<'a> {
    /// Of this scenario, whose veins have `grown`, or not yet.
    pub fn new(scenario: &'a Scenario, grown: bool) -> Self {
        let veins = (0..scenario.rods.len()).map(|j| vein(scenario, j, grown));
        Natural {
            veins: veins.collect(),
            scenario,
            grown,
        }
    }

    /// Position and rotation of vein `j` at `sigma`.
    pub fn at(&self, j: usize, sigma: f64) -> (DVec3, DQuat) {
        let vein = &self.veins[j];
        let before = vein.partition_point(|(end, _)| *end <= sigma).max(1) - 1;
        let (from, state) = vein[before];
        match sigma == from {
            true => state,
            false => step(
                &self.scenario.rods[j],
                self.grown,
                from,
                sigma - from,
                state,
            ),
        }
    }
}

/// The steps along vein `j`, which end at every kink and seam of its rest shape.
fn vein(scenario: &Scenario, j: usize, grown: bool) -> Vec<(f64, Vein)> {
    let rod = &scenario.rods[j];
    let shape = rod.rest_curvature.iter().chain([&rod.rest_stretch]);
    let mut kinks: Vec<f64> = (shape.clone())
        .flat_map(|p| p.kinks().iter().chain(p.seams()))
        .copied()
        .collect();
    kinks.sort_by(f64::total_cmp);
    kinks.dedup();
    let turn: f64 = rod.rest_curvature.iter().map(|p| p.max_abs()).sum();
    let longest = (TURN / (turn * rod.length)).min(STEP);
    let mut steps = vec![(0.0, scenario.base(j))];
    for end in kinks.into_iter().chain([1.0]) {
        let (mut from, mut state) = steps[steps.len() - 1];
        let count = ((end - from) / longest).ceil();
        let width = (end - from) / count;
        for k in 0..count as usize {
            state = step(rod, grown, from, width, state);
            from = if k + 1 == count as usize {
                end
            } else {
                from + width
            };
            steps.push((from, state));
        }
    }
    steps
}

/// A step of a vein from `sigma` by `width`.
fn step(rod: &Rod, grown: bool, sigma: f64, width: f64, (x, q): Vein) -> Vein {
    let mut slopes = [(DVec3::ZERO, DQuat::from_array([0.0; 4])); STAGES];
    let combine = |slopes: &[Vein], weights: &[f64]| {
        let mut sum = (x, q);
        for ((dx, dq), weight) in slopes.iter().zip(weights) {
            sum.0 += *dx * (width * weight);
            sum.1 += *dq * (width * weight);
        }
        sum
    };
    for i in 0..STAGES {
        let (_, q) = combine(&slopes, A[i]);
        let at = sigma + C[i] * width;
        let u = DVec3::from_array(Profile::all(&rod.rest_curvature, at));
        let q = q.normalize();
        let spin = 0.5 * rod.length * u;
        slopes[i] = (
            q * DVec3::X * (rod.length * if grown { rod.rest_stretch.at(at) } else { 1.0 }),
            q * DQuat::from_xyzw(spin.x, spin.y, spin.z, 0.0),
        );
    }
    let (x, q) = combine(&slopes, &B);
    (x, q.normalize())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A vein that is curved and twisted alike all along is a helix; one whose curvature varies is
    /// the same in one step or in many.
    #[test]
    fn the_natural_vein_is_the_helix_and_does_not_depend_on_the_steps() {
        let text = r#"
            name = "veins"
            leaf = { rods = 2, length = [2.0, 1.0], fan = [0.3, -0.2], joined = false }
            stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = 9.0, shear_2 = 9.0, shear_3 = 9.0 }
            rest = { twist = [1.2, 0.5], bend_2 = { at = [0.0, 0.3, 1.0], value = [[0.7, 0.7, 0.7], [0.0, 4.0, -2.0]] }, bend_3 = -0.4, stretch = 1.1 }
        "#;
        let scenario = Scenario::from_toml(text).unwrap();
        let natural = Natural::new(&scenario, true);
        let (x, q) = natural.at(0, 0.77);
        let (u, s) = (DVec3::new(1.2, 0.7, -0.4), 0.77 * 2.0);
        let (_, base) = scenario.base(0);
        let turned = base * crate::rotation::exp(s * u);
        assert!(turned.angle_between(q).abs() < 1e-7 && (turned.dot(q).abs() - 1.0).abs() < 1e-14);
        // The integral of exp(s [u]) e1.
        let (k, axis) = (u.length(), u.normalize());
        let across = axis.cross(DVec3::X);
        let along = axis * axis.x;
        let integral =
            along * s + (DVec3::X - along) * (k * s).sin() / k + across * (1.0 - (k * s).cos()) / k;
        assert!((x - base * (1.1 * integral)).length() < 1e-13);

        for (from, to) in [(0.0, 0.1), (0.1, 0.3), (0.3, 0.61)] {
            let (mut state, width) = (natural.at(1, from), (to - from) / 100.0);
            for k in 0..100 {
                state = step(
                    &scenario.rods[1],
                    true,
                    from + k as f64 * width,
                    width,
                    state,
                );
            }
            let (x, q) = natural.at(1, to);
            assert!((x - state.0).length() < 1e-13);
            assert!((q.dot(state.1).abs() - 1.0).abs() < 1e-14);
        }
    }
}
