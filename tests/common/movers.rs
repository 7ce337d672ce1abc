//! Random leaves that move.
#![allow(dead_code)]

use leafdyn::scenario::{Profile, Scenario, Schedule};
use proptest::prelude::*;

use crate::common::paper_leaf;

fn log_uniform(decades: std::ops::Range<f64>) -> impl Strategy<Value = f64> {
    decades.prop_map(|exponent| 10f64.powf(exponent))
}

/// Constant, or with two of four kinks, some close together, that make its
/// values up to thrice as large.
fn profile(decades: std::ops::Range<f64>) -> impl Strategy<Value = Profile> {
    let [first, second] = [[0.2, 0.22], [0.6, 0.85]].map(|of| prop::sample::select(of.to_vec()));
    let knots = (first, second, 0.4..2.5, 0.4..2.5, 0.4..2.5);
    (log_uniform(decades), knots, prop::bool::weighted(0.5)).prop_map(
        |(value, (first, second, a, b, c), crooked)| match crooked {
            false => Profile::Constant(value),
            true => Profile::Linear {
                at: vec![0.0, first, second, 1.0],
                value: vec![value, a * value, b * value, c * value],
            },
        },
    )
}

prop_compose! {
    fn rods(count: usize)(
        couple in prop::collection::vec(prop::array::uniform3(profile(-1.0..1.0)), count),
        force in prop::collection::vec(prop::array::uniform3(profile(1.0..4.0)), count),
        rest in prop::array::uniform3(-1.0..1.0),
        lengths in prop::collection::vec(0.99..1.01, count),
        density in prop::collection::vec(profile(-0.3..0.3), count),
        radius in prop::collection::vec(log_uniform(-2.0..-0.5), count),
    ) -> Scenario {
        let mut leaf = paper_leaf(count, [1.0; 3], [1.0; 3], 0.0);
        for (j, rod) in leaf.rods.iter_mut().enumerate() {
            rod.length = lengths[j];
            rod.couple_stiffness = couple[j].clone();
            rod.force_stiffness = force[j].clone();
            rod.rest_curvature = rest.map(Profile::Constant);
        }
        let dynamics = &mut leaf.dynamics;
        dynamics.rotary_inertia = (density.iter().zip(&radius))
            .map(|(density, radius)| {
                let of = |value: f64| 0.25 * value * radius * radius;
                match density {
                    Profile::Constant(value) => Profile::Constant(of(*value)),
                    Profile::Linear { at, value } => Profile::Linear {
                        at: at.clone(),
                        value: value.iter().map(|value| of(*value)).collect(),
                    },
                }
            })
            .collect();
        dynamics.density = density;
        leaf
    }
}

prop_compose! {
    /// One to four veins, each its own: stiffness over two decades in bending
    /// and three in stretch and shear, sections slender and stout, coupling
    /// over five decades. Undamped. They stand close together, so that even
    /// the strongest coupling does not throw them about.
    pub fn movers()(count in 1..5_usize)(
        leaf in rods(count),
        coupling in log_uniform(-1.0..4.0),
        parts in prop::collection::vec(prop::array::uniform3(0.0..1.0), count - 1),
        gravity in prop::array::uniform3(-0.3..0.3),
        joined in any::<bool>(),
    ) -> Scenario {
        let mut leaf: Scenario = leaf;
        leaf.joined = joined;
        for rod in &mut leaf.rods {
            rod.angle *= 0.02;
        }
        leaf.coupling = parts.iter().map(|gap| gap.map(|part: f64| coupling * part)).collect();
        leaf.gravity = gravity;
        leaf.dynamics.gravity = Schedule::constant(gravity);
        leaf.dynamics.external_damping = 0.0;
        leaf
    }
}
