//! Bases: their motion, and its effect where clamps hold them.

use crate::leaf::derivative::{Forces, at_constant_force};
use crate::leaf::discrete::DiscreteLeaf;
use crate::leaf::state::{State, add};
use crate::rod::Segment;
use crate::rotation;
use crate::scenario::Scenario;
use glam::DVec3;

impl DiscreteLeaf {
    /// Adds the effect of displacing and rotating a clamped base.
    pub(in crate::leaf::derivative) fn add_base_motion(
        &self,
        state: &State,
        segments: &[Segment],
        j: usize,
        [shift, turn]: [DVec3; 2],
        forces: &mut Forces,
    ) {
        let n = self.segments();
        let section = self.section(j, 0);
        let segment = &segments[j * n];
        let k = at_constant_force(segment, section);
        add(
            &mut forces.on_nodes(j, n)[0],
            k.xb.transpose() * shift - k.ab.transpose() * turn,
            k.xx * shift - k.xa * turn,
        );
        forces.on_gaps(j, n)[0] += segment.gap_increment(section, -shift, turn, DVec3::ZERO);
        let ((g_x, g_a, _), load) = (segment.gradient(section), self.load(state, j, 0));
        forces.energy += (g_a - load.moment).dot(turn) - (g_x + load.force).dot(shift);
    }
}

/// The derivatives of the position and of the rotation of the base of rod `j`.
pub(in crate::leaf::derivative) fn base_rate(
    terms: &[(f64, Scenario)],
    j: usize,
    length: f64,
) -> [DVec3; 2] {
    let (first, turned) = terms[0].1.base(j);
    let mut rate = [DVec3::ZERO; 2];
    for (weight, scenario) in terms {
        let (x, q) = scenario.base(j);
        rate[0] += *weight * (x - first) / length;
        rate[1] += *weight * rotation::log(q * turned.conjugate());
    }
    rate
}
