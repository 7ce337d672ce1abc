//! Veins that can turn about the axis of their base without resistance: round ones that are
//! clamped in line, loaded along this line and held on it, if at all. Tissue, hinges, and axes that
//! do not go through the origin are left out.
//!
//! Where every vein of a group that is tied together, or a single one, turns about the axis by an
//! angle and every section back about its own tangent, no clamp, load or strain energy changes: if
//! it is bent it has a circle of equilibria, and no bifurcation.

use std::ops::Range;

use super::{Hold, Profile, Rod, Scenario, Tissue};
use glam::DVec3;

/// Numbers that differ by less than this part are the same.
const ROUNDING: f64 = 1e-12;

/// Profiles are compared at so many equal distances, and at their kinks.
const COMPARED: usize = 16;

/// Neighbouring veins that can turn together without resistance, whatever their shape.
#[derive(Clone, Debug, PartialEq)]
pub struct Turning {
    /// Their numbers.
    pub rods: Range<usize>,
    /// The direction of the axis, which goes through the base.
    pub axis: DVec3,
}

impl Scenario {
    /// The groups of veins that can turn without resistance, each about its own axis: none in wind.
    pub fn turnings(&self) -> Vec<Turning> {
        if self.wind.is_some() {
            return Vec::new();
        }
        let groups = self.tied_groups().into_iter();
        groups
            .filter_map(|rods| {
                let axis = self.axis_of(rods.clone())?;
                Some(Turning { rods, axis })
            })
            .collect()
    }

    /// The veins that couplings, tissue or a free joint tip tie together.
    fn tied_groups(&self) -> Vec<Range<usize>> {
        let share_tip = self.joined && self.held_tip.is_none();
        let tissue = |gap: usize| self.tissue.as_ref().is_some_and(|all| has_some(&all[gap]));
        let tied = |gap: usize| share_tip || self.coupling[gap] != [0.0; 3] || tissue(gap);
        let ends = (1..=self.rods.len()).filter(|&end| end == self.rods.len() || !tied(end - 1));
        let mut start = 0;
        ends.map(|end| std::mem::replace(&mut start, end)..end)
            .collect()
    }

    /// The axis about which a group of tied veins can turn.
    fn axis_of(&self, group: Range<usize>) -> Option<DVec3> {
        let rods = &self.rods[group.clone()];
        let tangent = |rod: &Rod| rod.base_rotation() * DVec3::X;
        let axis = tangent(rods.first()?);
        let in_line = |direction: DVec3| direction.distance(axis) <= ROUNDING;
        let is_along =
            |load: DVec3| load.reject_from_normalized(axis).length() <= ROUNDING * load.length();
        let along = |load: [f64; 3]| is_along(DVec3::from_array(load));
        let held = self.held_tip.as_ref().is_none_or(|held| {
            let clamps = held.clamps.as_ref().map(|clamps| &clamps[group.clone()]);
            let mut clamps = clamps.into_iter().flatten();
            along(held.position) && clamps.all(|clamp| in_line(clamp.rotation() * DVec3::X))
        });
        // A coupling differs from a multiple of the unit matrix along the axis alone.
        let gaps = group.start..group.end - 1;
        let within = &self.coupling[gaps.clone()];
        let coupling = within.iter().all(|k| {
            (0..3).any(|own| {
                let [one, other] = [k[(own + 1) % 3], k[(own + 2) % 3]];
                let on_axis = axis.reject_from_normalized(DVec3::AXES[own]).length() <= ROUNDING;
                same(one, other) && (same(one, k[own]) || on_axis)
            })
        });
        let tissue = self
            .tissue
            .iter()
            .any(|all| all[gaps.clone()].iter().any(has_some));
        let loads = |vein: usize| {
            let weight = self.weight(vein);
            along(weight.even)
                && weight.of_mass.is_none_or(|(g, _)| along(g))
                && self.distributed_at_knots(vein).all(along)
        };
        let mut points = self
            .points
            .iter()
            .filter(|point| group.contains(&point.vein));
        let mut grips = self.grips.iter().filter(|grip| group.contains(&grip.vein));
        let turns = rods.iter().all(|rod| in_line(tangent(rod)) && is_along(rod.base_position()))
            && self.base_held == Hold::Clamped
            && !tissue
            && group.clone().all(loads)
            && points.all(|point| along(self.force_on(point)))
            && grips.all(|grip| along(grip.displacement))
            && along(self.tip_force)
            // A dead moment has no potential.
            && !self.has_moments()
            && held
            && coupling
            // This takes longest.
            && rods.iter().all(is_round);
        turns.then_some(axis)
    }
}

impl Scenario {
    /// The distributed load of a vein where it may have extremes.
    fn distributed_at_knots(&self, vein: usize) -> impl Iterator<Item = [f64; 3]> {
        let loads = self.distributed.iter().map(move |all| &all[vein]);
        loads.flat_map(|load| {
            let inner = load.iter().flat_map(|one| one.kinks()).copied();
            let knots = [0.0, 1.0].into_iter().chain(inner);
            knots.map(|sigma| load.each_ref().map(|one| one.at(sigma)))
        })
    }
}

/// Veins whose points are all nearer to the axis than this part of the leaf's length are straight,
/// and do not move when they turn.
const ON_AXIS: f64 = 1e-6;

impl Scenario {
    /// Number of directions in which the leaf can move without resistance in an equilibrium: one
    /// for every group of veins that can turn and is bent. Each has an eigenvalue that is zero.
    /// `points` are those of a vein.
    pub fn neutral_directions<P: IntoIterator<Item = DVec3>>(
        &self,
        points: impl Fn(usize) -> P,
    ) -> usize {
        let near = ON_AXIS * super::longest(&self.rods);
        let bent = |turning: &Turning| {
            let mut points = turning.rods.clone().flat_map(&points);
            points.any(|point| point.reject_from_normalized(turning.axis).length() > near)
        };
        self.turnings().iter().filter(|it| bent(it)).count()
    }
}

fn has_some(tissue: &Tissue) -> bool {
    *tissue != Tissue::default()
}

fn same(a: f64, b: f64) -> bool {
    a == b || (a - b).abs() <= ROUNDING * a.abs().max(b.abs())
}

/// Whether sections have no preferred direction, and a vein at rest is straight.
fn is_round(rod: &Rod) -> bool {
    let alike = |a: &Profile, b: &Profile| {
        let even = (0..=COMPARED).map(|i| i as f64 / COMPARED as f64);
        let kinks = a.kinks().iter().chain(b.kinks()).copied();
        even.chain(kinks)
            .all(|sigma| same(a.at(sigma), b.at(sigma)))
    };
    let [_, bending_2, bending_3] = &rod.couple_stiffness;
    let [_, shear_2, shear_3] = &rod.force_stiffness;
    let curved = rod.rest_curvature[1..].iter().any(|of| of.max_abs() > 0.0);
    !curved && alike(bending_2, bending_3) && alike(shear_2, shear_3)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::Entries;

    fn turnings(change: &str) -> Vec<Turning> {
        turnings_with("", change)
    }

    fn turnings_with(tables: &str, change: &str) -> Vec<Turning> {
        let text = r#"
            name = "round"
            leaf = { rods = 2, length = [1.0, 0.8], fan = [0.0, 0.0], joined = false }
            stiffness = { torsion = 0.7, bending_2 = 1.0, bending_3 = 1.0, axial = inf, shear_2 = 9.0, shear_3 = 9.0 }
            coupling = { x = 1.0, y = 2.0, z = 2.0 }
            [load]
            gravity = [-3.0, 0.0, 0.0]
            "#;
        let entries = change.split("; ").filter(|entry| !entry.is_empty());
        let entries: Vec<_> = entries.map(|entry| entry.into()).collect();
        let text = format!("{text}\n{tables}");
        let given = Entries::of_text(&text, "round").unwrap().replaced(&entries);
        given.unwrap().checked().unwrap().turnings()
    }

    fn about(axis: DVec3, rods: Range<usize>) -> Turning {
        Turning { rods, axis }
    }

    #[test]
    fn only_what_has_no_preferred_direction_turns() {
        let both = [about(DVec3::X, 0..2)];
        assert_eq!(turnings(""), both);
        assert_eq!(turnings("rest.twist=0.4"), both);
        assert_eq!(turnings("rest.bend_2=0.1"), []);
    }

    /// A column that stands upright, or a force in its middle: along the axis nothing changes.
    #[test]
    fn loads_along_the_axis_leave_it_free_to_turn() {
        let upright = "leaf.elevation=1.5707963267948966; coupling.x=2; coupling.z=1; load.gravity=[0, 0, -3]";
        let axis = turnings(upright);
        assert!(axis.len() == 1 && axis[0].axis.distance(DVec3::Z) < 1e-15);
        assert_eq!(
            turnings(&upright.replace("coupling.z=1", "coupling.z=2.5; coupling.y=1")),
            []
        );
        let both = [about(DVec3::X, 0..2)];
        for (entry, turns) in [
            ("leaf.base=[-0.3, 0, 0]", true),
            ("leaf.base=[[0, 0, 0], [0, 0.1, 0]]", false),
            ("leaf.base_held=pinned", false),
            ("load.gravity=[[1, 0, 0], [-2, 0, 0]]", true),
            ("load.gravity=[[1, 0, 0], [-2, 0, 1]]", false),
            ("load.g=[-1, 0, 0]; dynamics.density=1", true),
            ("load.g=[0, 0, -1]; dynamics.density=1", false),
            (
                "load.distributed={at=[0, 1], value=[[0, 0, 0], [1, 0, 0]]}",
                true,
            ),
            (
                "load.distributed={at=[0, 1], value=[[0, 0, 0], [1, 1, 0]]}",
                false,
            ),
            ("tissue.normal=1", false),
        ] {
            assert_eq!(turnings(entry) == both, turns, "{entry}");
        }
        let held = |tables: &str, along: &str, across: &str| {
            for (vector, turns) in [(along, true), (across, false)] {
                let found = turnings_with(&tables.replace("VECTOR", vector), "");
                assert_eq!(found == both, turns, "{tables} {vector}");
            }
        };
        held(
            "[[load.point]]\nvein = 2\nat = 0.4\nforce = VECTOR",
            "[2, 0, 0]",
            "[0, 1, 0]",
        );
        held(
            "[[grip]]\nvein = 2\nat = 0.4\nheld = 'clamped'\nmove = VECTOR",
            "[-0.1, 0, 0]",
            "[0, 0, 1]",
        );
    }

    /// Veins that nothing ties together turn each for itself, and only those that are round.
    #[test]
    fn untied_veins_turn_each_for_itself() {
        let untied = "coupling.x=0; coupling.y=0; coupling.z=0";
        let each = [about(DVec3::X, 0..1), about(DVec3::X, 1..2)];
        assert_eq!(turnings(untied), each);
        let strip = format!("{untied}; stiffness.bending_3=[3.0, 1.0]");
        assert_eq!(turnings(&strip), each[1..]);
        let aside = format!("{untied}; leaf.fan=[0.3, 0.0]");
        assert_eq!(turnings(&aside), each[1..]);
        assert_eq!(turnings(&format!("{aside}; leaf.joined=true")), []);
    }
}
