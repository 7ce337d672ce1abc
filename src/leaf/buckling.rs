//! What a leaf does in a mode: whether its veins bend up and down, bend sideways or twist, and which does most.
//!
//! The rotation vector w of a mode turns the directors; along the arclength s its derivative along the
//! directors is the change of the strains u = (u1, u2, u3) of twist and bends
//! (Antman, Nonlinear Problems of Elasticity, 2nd ed., section 8.6): the integral of the square of each tells
//! how much a vein twists, bends about d2 (up and down) and about d3 (sideways).

use crate::leaf::state::{NodalField, State, rotation_part};
use crate::words;
use glam::DVec3;
use serde::Serialize;
use std::fmt;

words! {
    /// What veins do most in a mode.
    pub enum BucklingMotion {
        /// They twist, about d1.
        Twists = "twists",
        /// They bend about d2, out of their surface.
        BendsUpAndDown = "bends-up-and-down",
        /// They bend about d3, within their surface.
        BendsSideways = "bends-sideways",
    }
}

/// What a leaf does in a mode. Displayed, it is a phrase.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct BucklingMode {
    /// What its veins do most.
    #[serde(rename = "motion")]
    pub kind: BucklingMotion,
    /// The vein that does most, from 1; of several that do as much the first. None of a leaf of one vein, and where all
    /// do as much.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vein: Option<usize>,
}

/// Veins that do so little less, as a part, do as much.
const AS_MUCH: f64 = 1e-3;

impl BucklingMode {
    /// What the increments of all nodes with equations do to the leaf in this state; `None` if they turn
    /// nothing along the veins, as in a stretch.
    pub fn of_increments(state: &State, increments: &NodalField) -> Option<Self> {
        let amounts: Vec<DVec3> = increments
            .iter()
            .enumerate()
            .map(|(vein, nodes)| {
                let first = (state.segments() + 1).checked_sub(nodes.len());
                let base = state.base(vein) + first.unwrap_or(0);
                // A node without equations does not turn.
                let before = first.unwrap_or(0).min(1);
                let turns = nodes.iter().map(rotation_part);
                let turns: Vec<DVec3> = std::iter::repeat_n(DVec3::ZERO, before)
                    .chain(turns)
                    .collect();
                let segments = turns.windows(2).enumerate().map(|(i, ends)| {
                    let node = base - before + i;
                    let length = state.x[node].distance(state.x[node + 1]);
                    let strain = state.q[node + 1].inverse() * (ends[1] - ends[0]);
                    strain * strain / length.max(f64::MIN_POSITIVE)
                });
                segments.sum()
            })
            .collect();
        let DVec3 { x, y, z } = amounts.iter().sum();
        let largest = x.max(y).max(z);
        if !(largest > 0.0 && largest.is_finite()) {
            return None;
        }
        let kind = match largest {
            _ if largest == y => BucklingMotion::BendsUpAndDown,
            _ if largest == z => BucklingMotion::BendsSideways,
            _ => BucklingMotion::Twists,
        };
        let amount = |all: &DVec3| all.element_sum();
        let most = amounts.iter().map(amount).fold(0.0, f64::max);
        let does_as_much = |all: &DVec3| amount(all) >= (1.0 - AS_MUCH) * most;
        let first = amounts.iter().position(does_as_much);
        Some(BucklingMode {
            kind,
            vein: first
                .map(|vein| vein + 1)
                .filter(|_| !amounts.iter().all(does_as_much)),
        })
    }
}

/// As in `bends sideways, vein 3 most`.
impl fmt::Display for BucklingMode {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self.kind {
            BucklingMotion::Twists => "twists",
            BucklingMotion::BendsUpAndDown => "bends up or down",
            BucklingMotion::BendsSideways => "bends sideways",
        })?;
        match self.vein {
            Some(vein) => write!(f, ", vein {vein} most"),
            None => Ok(()),
        }
    }
}
