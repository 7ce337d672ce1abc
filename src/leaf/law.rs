//! The constitutive law of nearly rigid segments in linear equations.
//!
//! Newton's equations of a leaf have the spatial forces of its segments as unknowns,
//! \[K B; B^T -C\] (dx, dn), with the compliances C. A force is condensed out with a limited stiffness
//! k, as a larger one loses the soft modes to rounding
//! ([`Section::limit_condensing_stiffness`](crate::rod::Section::limit_condensing_stiffness)). For a
//! stiffer segment, C < 1/k, the solution misses the length (1 - C k) (B^T dx - C dn) of the law
//! v = v0 + n/H. Where loads determine the force that is next to nothing; where holders, or other rods,
//! determine the strain, each solution gains only the fraction k/H of the force.
//!
//! So the missing lengths e are unknowns, too: with them as additional gaps, a solution misses G e in
//! addition, and e = e0 + G e is solved by [`solve_minimal_residual`]. G is small but for the rods whose
//! strain is determined, so that few solutions are enough at any stiffness.

use crate::krylov::{KrylovLimits, StagnationLimit, solve_minimal_residual};
use crate::leaf::derivative::parameter::LinearResponse;
use crate::leaf::discrete::DiscreteLeaf;
use crate::leaf::state::{NodalField, State};
use crate::leaf::system::System;
use crate::leaf::tissue::rigid::ForceCarriers;
use crate::numbers::largest;
use crate::rod::Section;
use glam::{BVec3, DVec3};

/// Largest missing part of the law of a segment, 1 - C k, by rounding.
const MISSING_LAW_ROUNDING: f64 = 1e-12;

/// The largest gap of a segment in a state at rest, in lengths of the leaf, that is attributed to rounding.
const LARGEST_ROUNDED_GAP: f64 = 1e-11;

/// Stiffness in shear with which the force of a segment is condensed out whose direction is that of its
/// holders, in units of its bending stiffness over the square of its length. Over a held stretch of n
/// segments a solution misses the part 10 n^2 of its inverse in the modes that alternate, and next to nothing in
/// others.
const DIRECTED_SEGMENT_STIFFNESS: f64 = 1e6;

/// Limits of the iteration for the missing lengths. A force is undetermined where the law closes less
/// than the fraction `singular_value_limit` of the length that a step misses: at a stiffness of
/// 10^12 A/L^2 it closes 10^-7 on branches, where k is 10^5.
const LAW_COMPLETION_LIMITS: KrylovLimits = KrylovLimits {
    accuracy: 1e-9,
    most: 40,
    singular_value_limit: 1e-8,
    stagnation: Some(StagnationLimit {
        directions: 3,
        remainder: 0.99,
    }),
};

/// What holders determine of a segment.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SegmentHold {
    /// Whether they place both ends along some axis, and an end can turn: then its direction is theirs.
    pub directs: bool,
    /// Whether they hold the places of both ends.
    pub has_length: bool,
    /// Whether they hold both sections.
    pub has_sections: bool,
}

impl DiscreteLeaf {
    /// The part of the law of segment `i` of rod `j` that a linear solution does not satisfy.
    pub(super) fn missing_law_fraction(&self, j: usize, i: usize) -> DVec3 {
        let section = self.section(j, i);
        let left = DVec3::ONE - section.compliance * section.condensing;
        DVec3::select(
            left.cmplt(DVec3::splat(MISSING_LAW_ROUNDING)),
            DVec3::ZERO,
            left,
        )
    }

    /// Whether some segment is stiffer than its force is condensed out with, and a step closes its law.
    pub fn is_nearly_rigid(&self) -> bool {
        let mut segments = self.rod_index_pairs(0..self.segments());
        segments.any(|(j, i)| {
            self.missing_law_fraction(j, i) * self.completed_components(j, i, false) != DVec3::ZERO
        })
    }

    /// Whether the forces in a state, which is that of another leaf, are not those of this one by more than
    /// rounding.
    pub fn law_differs(&self, state: &State) -> bool {
        let n = self.segments();
        let mut segments = self.rod_index_pairs(0..n);
        segments.any(|(j, i)| {
            let gap = self.segment(state, j, i, state.n[j * n + i]).gap;
            self.closable_gap(j, i, gap).length() > LARGEST_ROUNDED_GAP
        })
    }

    /// The largest strain by which a step from one state to another misses the law of its nearly
    /// rigid segments, to first order.
    pub fn missing_strain(&self, before: &State, after: &State) -> f64 {
        let n = self.segments();
        let missing = |(j, i): (usize, usize)| {
            let section = self.section(j, i);
            let change = (after.n[j * n + i] - before.n[j * n + i]).length();
            let missing = self.missing_law_fraction(j, i) * self.completed_components(j, i, false);
            let soft = DVec3::select(missing.cmpgt(DVec3::ZERO), section.condensing, DVec3::ONE);
            (missing / soft).max_element() * change
        };
        largest(self.rod_index_pairs(0..n).map(missing))
    }

    /// Largest finite stiffness in stretch and shear of any segment; zero if all are rigid.
    pub fn largest_finite_stiffness(&self) -> f64 {
        self.largest_stiffness(|_| DVec3::ZERO)
    }

    /// Largest stiffness in stretch and shear of any segment; of rigid ones that with which their
    /// force is condensed out.
    pub fn largest_force_stiffness(&self) -> f64 {
        self.largest_stiffness(|section| section.condensing)
    }

    fn largest_stiffness(&self, of_rigid: fn(&Section) -> DVec3) -> f64 {
        let stiffness = |section: &Section| {
            let rigid = section.compliance.cmpeq(DVec3::ZERO);
            DVec3::select(rigid, of_rigid(section), section.compliance.recip()).max_element()
        };
        largest(self.sections.iter().map(stiffness))
    }

    /// The parts of the law that a completion closes: all that have a force to close them, or without `rigid`
    /// directions those of a finite stiffness. A straight rigid rod between holders has no force of its own, and its
    /// length depends on its deflection in second order: Newton's method with its exact length
    /// would converge slowly there, where that with a limited stiffness keeps it straight. Where
    /// holders place both ends of an unshearable segment, its direction is theirs in first order,
    /// and its shear forces are closed in any case: they carry the moment that a held stretch receives at its end.
    fn completed_components(&self, j: usize, i: usize, rigid: bool) -> DVec3 {
        let section = self.section(j, i);
        let carried = DVec3::select(
            section.condensing.cmpgt(DVec3::ZERO),
            DVec3::ONE,
            DVec3::ZERO,
        );
        let is_rigid = section.compliance.cmpeq(DVec3::ZERO);
        if rigid || !is_rigid.any() {
            return carried;
        }
        let of_rigid = match self.segment_hold(j, i).directs {
            true => DVec3::new(0.0, 1.0, 1.0),
            false => DVec3::ZERO,
        };
        carried * DVec3::select(is_rigid, of_rigid, DVec3::ONE)
    }

    /// The part of a gap of segment `i` of rod `j` that its force can close.
    pub(super) fn closable_gap(&self, j: usize, i: usize, gap: DVec3) -> DVec3 {
        let carried = self.section(j, i).condensing.cmpgt(DVec3::ZERO);
        DVec3::select(carried, gap, DVec3::ZERO)
    }

    /// Condenses out the forces of segments between holders with the stiffnesses of
    /// [`DiscreteLeaf::limit_held_segment`].
    pub(super) fn limit_held_segments(&mut self) {
        if !self.has_grips() {
            return;
        }
        for (j, i) in self.rod_index_pairs(0..self.segments()) {
            let section = self.section(j, i);
            let limited = self.limit_held_segment(j, i, *section, section.condensing);
            let k = j * self.segments() + i;
            self.sections[k] = limited;
        }
    }

    /// The section of segment `i` of rod `j`, whose force is condensed out with at most the stiffness
    /// `largest`, but for what holders determine.
    ///
    /// Where they direct the segment its shear forces alternate from segment to segment in answer to a moment at
    /// the end of the held stretch, and only the bending of the segments resists: with the stiffness of
    /// other segments each solution would close next to nothing of their law. With a larger one no soft
    /// mode is lost, as the nodes do not move. What is rigid of a segment in whose law nothing is free has no force: none
    /// is determined, and on the way to where they are held its ends need not have their distance.
    pub fn limit_held_segment(
        &self,
        j: usize,
        i: usize,
        section: Section,
        largest: DVec3,
    ) -> Section {
        let hold = self.segment_hold(j, i);
        let limit = match hold.directs {
            true => {
                let bending = section.couple_stiffness.y.max(section.couple_stiffness.z);
                let stiffness = DIRECTED_SEGMENT_STIFFNESS * bending / section.ds.powi(2);
                largest.max(DVec3::new(0.0, stiffness, stiffness))
            }
            false => largest,
        };
        let mut limited = section.limit_condensing_stiffnesses(limit);
        let known = BVec3::new(hold.has_length, hold.has_sections, hold.has_sections);
        let forceless = known & section.compliance.cmpeq(DVec3::ZERO);
        limited.condensing = DVec3::select(forceless, DVec3::ZERO, limited.condensing);
        limited
    }

    /// What holders determine of segment `i` of rod `j`.
    pub(super) fn segment_hold(&self, j: usize, i: usize) -> SegmentHold {
        if !self.has_grips() {
            return SegmentHold::default();
        }
        let ends = [i, i + 1].map(|node| self.node_freedom(j, node));
        let turns = ends.iter().any(|end| end.rotation);
        let has_length = ends.iter().all(|end| !end.displacement.any());
        SegmentHold {
            directs: turns && ends.iter().all(|end| !end.displacement.all()),
            has_length,
            has_sections: has_length && !turns,
        }
    }

    /// Completes the law in the `response` of a leaf with these `segments`: `gaps` are the lengths
    /// that the response misses, and in return the additional gaps for which it was solved; without
    /// `rigid` directions these are left to the next iteration. `solve` solves for the increments of
    /// the nodes under forces on them, with the factorized matrix. Forces that no law determines, of
    /// rigid rods between holders, do not change. False if a solution fails; the response is then as
    /// it was.
    pub fn complete_law(
        &self,
        carriers: &ForceCarriers,
        response: &mut LinearResponse,
        gaps: &mut [DVec3],
        rigid: bool,
        solve: &mut dyn FnMut(&NodalField) -> Option<NodalField>,
    ) -> bool {
        let close = |gaps: &mut [DVec3]| {
            // What is rigid in the tissue has a force everywhere.
            let segments = self.rod_index_pairs(0..self.segments());
            for (gap, (j, i)) in gaps.iter_mut().zip(segments) {
                *gap *= self.completed_components(j, i, rigid);
            }
        };
        close(gaps);
        let missing: Vec<f64> = gaps.iter().flat_map(|gap| gap.to_array()).collect();
        if missing.iter().all(|part| *part == 0.0) {
            return true;
        }
        let none: NodalField = (response.nodes.iter())
            .map(|rod| vec![[0.0; 6]; rod.len()])
            .collect();
        let mut responses: Vec<LinearResponse> = Vec::new();
        let product = &mut |direction: &[f64]| {
            let mut left: Vec<DVec3> = vectors_from_numbers(direction);
            let mut forces = none.clone();
            self.condense_gaps(carriers, &left, &mut forces);
            let nodes = solve(&forces)?;
            let mut carried = vec![DVec3::ZERO; left.len()];
            self.carried_force_changes(carriers, &nodes, &mut left, &mut carried);
            close(&mut left);
            responses.push(LinearResponse {
                nodes,
                force_changes: carried,
            });
            let left = left.iter().flat_map(|gap| gap.to_array());
            Some(direction.iter().zip(left).map(|(v, g)| v - g).collect())
        };
        let Some(found) = solve_minimal_residual(&missing, LAW_COMPLETION_LIMITS, product) else {
            return false;
        };
        for (part, more) in found.coefficients.iter().zip(&responses) {
            response.add(*part, more);
        }
        if let Some(sum) = found.solution() {
            gaps.copy_from_slice(&vectors_from_numbers(&sum));
        }
        true
    }
}

impl System {
    /// Completes the law of nearly rigid segments in the solution of the equations assembled in a
    /// `state` of `leaf`; `solve` as in [`DiscreteLeaf::complete_law`]. Returns the forces on the
    /// nodes that do so, beside those assembled.
    pub fn complete_law(
        &mut self,
        leaf: &DiscreteLeaf,
        state: &State,
        solve: &mut dyn FnMut(&mut System, &NodalField) -> Option<NodalField>,
    ) -> Option<NodalField> {
        let carriers = leaf.force_carriers(state);
        let segments = carriers.segments.iter();
        let mut gaps: Vec<DVec3> = segments.map(|segment| segment.gap).collect();
        gaps.extend(carriers.strips.iter().map(|it| it.rigid * it.element.gap));
        let mut response = LinearResponse {
            nodes: self.solution(),
            force_changes: vec![DVec3::ZERO; gaps.len()],
        };
        leaf.carried_force_changes(
            &carriers,
            &response.nodes,
            &mut gaps,
            &mut response.force_changes,
        );
        let first = response.nodes.clone();
        let complete =
            leaf.complete_law(&carriers, &mut response, &mut gaps, false, &mut |forces| {
                solve(self, forces)
            });
        if !complete {
            self.set_solution(&first);
            return None;
        }
        self.set_solution(&response.nodes);
        let n = leaf.segments();
        let forces = leaf.rod_index_pairs(0..n).map(|(j, i)| {
            let (section, k) = (leaf.section(j, i), j * n + i);
            carriers.segments[k].frame * (section.condensing * gaps[k] / section.ds)
        });
        self.law_forces.extend(forces);
        let of_tissue = carriers.strips.iter().zip(&gaps[carriers.segments.len()..]);
        let of_tissue = of_tissue.map(|(strip, gap)| {
            strip.element.frame * (strip.section.condensing * *gap) / strip.weight
        });
        self.law_forces.extend(of_tissue);
        let mut nodes: NodalField = first.iter().map(|rod| vec![[0.0; 6]; rod.len()]).collect();
        leaf.condense_gaps(&carriers, &gaps, &mut nodes);
        Some(nodes)
    }

    /// The spatial forces of the segments, beside those of the solution, that complete the law.
    pub fn law_forces(&self) -> &[DVec3] {
        &self.law_forces
    }

    /// Sets the solution, with these additional forces of the segments.
    pub fn set_completed(&mut self, increments: &NodalField, law_forces: &[DVec3]) {
        self.set_solution(increments);
        self.law_forces.extend_from_slice(law_forces);
    }
}

fn vectors_from_numbers(numbers: &[f64]) -> Vec<DVec3> {
    numbers.chunks_exact(3).map(DVec3::from_slice).collect()
}
