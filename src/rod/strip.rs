//! Tissue between two neighboring veins: the midpoint element laid across, from a node of one to
//! the node of the other at an equal fraction of their lengths.
//!
//! With the geodesic midpoint R of the rotations q0 and q1 of both nodes, the positions x0 and x1
//! and the same in the natural leaf, in which tissue has no force,
//!
//! e = R^T (x1 - x0) - \[natural\],   theta = log(q0^* q1) - \[natural\],
//! E = 1/2 sum_k k_k e_k^2 + 1/2 c_1 theta_1^2.
//!
//! k_1 resists neighbors that slide along each other, k_2 a change of width, k_3 one vein that rises
//! above the other, c_1 a fold along the veins. As a segment a strip carries a spatial
//! force as a further unknown, which is condensed out ([`Element`]), so that Newton's method
//! converges as fast however stiff it is. It may have no stiffness in some direction, in which it then
//! carries no force, or be rigid there: the force is then condensed out with a finite stiffness, a step of
//! the method of multipliers.
//!
//! Tissue that is rigid, or contracts across the veins as they stretch, by Poisson's ratio, has the strains
//!
//! e_2 + c (v_1 - v0_1) - a (v_2 - v0_2),   theta_1 - c (u_2 - u0_2) - a (u_1 - u0_1)
//!
//! in place of e_2 and theta_1, with the means of the stretch v_1, the shear v_2, the twist u_1 and the bend u_2 of
//! both veins: [`VeinStrain`] has these of a segment, with derivatives by its nodes. Veins that are slanted against
//! each other or unequally long are apart by a = e_1 along them in the natural leaf: without what is by their own
//! strains, the strains are those straight across, as in a plate.

use crate::rod::element::{Element, FirstDerivatives, NodalHessian, UNKNOWNS, nodal_gradient};
use crate::rod::section::{LaneNodes, LaneSections, NodePair, Section, Wrench};
use crate::rotation;
use crate::simd::Vectors;
use glam::{DVec2, DVec3};
use nalgebra::SVector;
use pulp::Scalar;

/// Derivatives by the unknowns (rotation, displacement) of two nodes.
pub type PairGradient = SVector<f64, 12>;

/// A block of a matrix of the unknowns (rotation, displacement) of a node, rows first.
pub type NodeBlock = [[f64; UNKNOWNS]; UNKNOWNS];

/// The tissue that belongs to a node of two neighboring veins; also its derivative with respect
/// to a parameter.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TissueStrip {
    /// k: force per displacement along the veins, across, and normal to the leaf; infinite: rigid.
    pub stiffness: DVec3,
    /// Stiffness with which the force is condensed out: k, or of a rigid direction a finite one.
    pub condensing: DVec3,
    /// c_1: moment per radian of a fold along the veins.
    pub fold_stiffness: f64,
    /// R^T (x1 - x0) in the natural leaf.
    pub stress_free_gap: DVec3,
    /// log(q0^* q1) in the natural leaf.
    pub stress_free_rotation: DVec3,
    /// c: the length by which the strip narrows freely per stretch of its veins, and by which it
    /// folds freely per curvature of theirs.
    pub contraction: f64,
    /// a: how far its ends are apart along the veins in the natural leaf, if its strains are those straight across.
    pub offset: f64,
}

/// The mean strains, less those at rest, of the segments of both veins by which a strip contracts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContractingStrains {
    /// v_1 - v0_1.
    pub stretch: f64,
    /// v_2 - v0_2.
    pub shear: f64,
    /// u_1 - u0_1.
    pub twist: f64,
    /// u_2 - u0_2.
    pub bend: f64,
}

/// What multiplies [`ContractingStrains`] in the strains of a strip, or the stress by each of them.
#[derive(Clone, Copy, Debug, Default)]
pub struct StrainFactors {
    /// By the stretch and the shear.
    pub force: DVec2,
    /// By the twist and the bend.
    pub moment: DVec2,
}

impl ContractingStrains {
    /// The sum with these factors of stretch and shear, and with those of twist and bend.
    fn weighted(self, factors: StrainFactors) -> [f64; 2] {
        [
            factors.force.dot(DVec2::new(self.stretch, self.shear)),
            factors.moment.dot(DVec2::new(self.twist, self.bend)),
        ]
    }
}

/// What a strip exerts in its strains across the veins and in its fold.
#[derive(Clone, Copy, Debug)]
pub struct StripStress {
    /// The force along d2, the derivative of the energy by e_2.
    pub across: f64,
    /// The part of it that is carried, and not condensed out.
    pub carried_across: f64,
    /// The moment about d1, the derivative of the energy by theta_1.
    pub fold: f64,
    /// The energy of both strains.
    pub energy: f64,
}

/// The derivatives of e_2 and theta_1 by the unknowns of the nodes of a strip.
pub struct StripStrainGradients {
    pub across: PairGradient,
    pub fold: PairGradient,
}

/// The second derivatives of the energy of a strip.
pub struct StripHessian {
    /// The blocks of the two nodes, upper triangles.
    pub diagonal_blocks: [NodeBlock; 2],
    /// The block between the first and the second.
    pub off_diagonal_block: NodeBlock,
}

/// The energy of a strip, and what it exerts on its two nodes; also their derivatives with respect to a
/// parameter.
#[derive(Clone, Copy, Debug)]
pub struct StripLoads {
    pub energy: f64,
    pub on_nodes: [Wrench; 2],
}

/// A strip as an element between its ends.
struct StripElement {
    element: Element<Scalar>,
    sections: LaneSections<Scalar>,
}

/// A strip between its ends that carries a spatial force, which is condensed out of its energy.
pub struct CarryingStrip {
    strip: TissueStrip,
    element: Element<Scalar>,
}

/// The strains e along the directors, and the fold theta_1.
struct StripStrains {
    e: DVec3,
    theta: f64,
}

impl TissueStrip {
    /// A strip that is without force between these ends; `rigid` is the stiffness with which forces in
    /// rigid directions are condensed out.
    pub fn stress_free_between(
        stiffness: DVec3,
        fold: f64,
        rigid: DVec3,
        ends: &NodePair,
    ) -> TissueStrip {
        let middle = rotation::midpoint(ends.q[0], ends.q[1]);
        TissueStrip {
            stiffness,
            condensing: DVec3::select(is_infinite(stiffness), rigid, stiffness),
            fold_stiffness: fold,
            contraction: 0.0,
            offset: 0.0,
            stress_free_gap: middle.inverse() * (ends.x[1] - ends.x[0]),
            stress_free_rotation: rotation::log(ends.q[0].conjugate() * ends.q[1]),
        }
    }

    /// Whether the strip resists any strain.
    pub fn has_stiffness(&self) -> bool {
        self.stiffness != DVec3::ZERO || self.fold_stiffness != 0.0
    }

    /// Whether the strip is rigid in some direction.
    pub fn is_rigid(&self) -> bool {
        is_infinite(self.stiffness).any()
    }

    /// Ones in rigid directions, zeros in others.
    pub fn rigid_directions(&self) -> DVec3 {
        DVec3::select(is_infinite(self.stiffness), DVec3::ONE, DVec3::ZERO)
    }

    /// The strip whose veins are strained so: where it is without force then.
    pub fn contracted(&self, strains: ContractingStrains) -> TissueStrip {
        let [across, fold] = strains.weighted(self.vein_strain_factors());
        let mut strip = *self;
        strip.stress_free_gap.y -= across;
        strip.stress_free_rotation.x -= fold;
        strip
    }

    /// The factors of the strains of its veins in its strain across (by the force) and in its fold (by
    /// the moment).
    pub fn vein_strain_factors(&self) -> StrainFactors {
        StrainFactors {
            force: DVec2::new(self.contraction, -self.offset),
            moment: DVec2::new(-self.offset, -self.contraction),
        }
    }

    /// The difference of the data from those of another strip. What is rigid stays so.
    pub fn difference_from(&self, other: &TissueStrip) -> TissueStrip {
        let rigid = is_infinite(self.stiffness);
        let change = self.stiffness - other.stiffness;
        TissueStrip {
            stiffness: DVec3::select(rigid, DVec3::ZERO, change),
            condensing: DVec3::ZERO,
            contraction: self.contraction - other.contraction,
            offset: self.offset - other.offset,
            fold_stiffness: self.fold_stiffness - other.fold_stiffness,
            stress_free_gap: self.stress_free_gap - other.stress_free_gap,
            stress_free_rotation: self.stress_free_rotation - other.stress_free_rotation,
        }
    }

    /// A strip in the same place that has no force.
    pub fn without_stiffness(&self) -> TissueStrip {
        TissueStrip {
            stiffness: DVec3::ZERO,
            condensing: DVec3::ZERO,
            fold_stiffness: 0.0,
            contraction: 0.0,
            ..*self
        }
    }

    /// Adds `times` the data of another strip.
    pub fn add(&mut self, times: f64, other: &TissueStrip) {
        self.stiffness += times * other.stiffness;
        self.fold_stiffness += times * other.fold_stiffness;
        self.stress_free_gap += times * other.stress_free_gap;
        self.stress_free_rotation += times * other.stress_free_rotation;
        self.contraction += times * other.contraction;
        self.offset += times * other.offset;
    }

    /// The sections of the strip as an element.
    fn sections(&self) -> LaneSections<Scalar> {
        LaneSections::from(&Section {
            ds: 1.0,
            couple_stiffness: self.fold_stiffness * DVec3::X,
            rest_curvature: self.stress_free_rotation,
            rest_strain: self.stress_free_gap,
            compliance: DVec3::ZERO,
            condensing: self.condensing,
        })
    }

    /// The strip between these ends: it carries the force of its strains, and in rigid directions the
    /// spatial force `carried`.
    fn strained_element(&self, ends: &NodePair, carried: DVec3) -> StripElement {
        let sections = self.sections();
        let mut element = Element::with_strain_forces(&sections, &LaneNodes::from(ends));
        let rigid = is_infinite(self.stiffness);
        if rigid.any() {
            let carried = DVec3::from(Vectors::from(carried).director_components(element.frame));
            element.nu = DVec3::select(rigid, carried, DVec3::from(element.nu)).into();
        }
        StripElement { element, sections }
    }

    /// The strip between these ends, carrying the spatial `force`. In directions without stiffness it
    /// carries none.
    pub fn carrying(&self, ends: &NodePair, force: DVec3) -> CarryingStrip {
        let mut element = Element::with_strain_forces(&self.sections(), &LaneNodes::from(ends));
        let dx = DVec3::from(element.w);
        let stiff = self.stiffness.cmpgt(DVec3::ZERO);
        let carried = DVec3::from(Vectors::from(force).director_components(element.frame));
        let nu = DVec3::select(stiff, carried, DVec3::ZERO);
        let w = DVec3::select(stiff, self.stress_free_gap + nu / self.stiffness, dx);
        (element.nu, element.w, element.gap) = (nu.into(), w.into(), (dx - w).into());
        CarryingStrip {
            strip: *self,
            element,
        }
    }

    /// The spatial force of its strains between these ends, and in rigid directions that `carried`.
    pub fn force(&self, ends: &NodePair, carried: DVec3) -> DVec3 {
        let element = self.strained_element(ends, carried).element;
        element.nu.from_director_components(element.frame).into()
    }

    /// The strains of an element.
    fn strains(&self, element: &Element<Scalar>) -> StripStrains {
        let [w, u] = [element.w, element.u].map(DVec3::from);
        StripStrains {
            e: w - self.stress_free_gap,
            theta: u.x - self.stress_free_rotation.x,
        }
    }

    /// The energy of the strip, and the moment and force that it exerts on either node, if it carries
    /// this spatial force in rigid directions.
    pub fn loads(&self, ends: &NodePair, carried: DVec3) -> StripLoads {
        let StripElement { element, sections } = self.strained_element(ends, carried);
        let StripStrains { e, theta } = self.strains(&element);
        let elastic = self.elastic_stiffness();
        let energy = 0.5 * ((elastic * e).dot(e) + self.fold_stiffness * theta * theta);
        StripLoads {
            energy,
            on_nodes: nodal_loads(element.gradient(&sections)),
        }
    }

    /// The stiffness without that of rigid directions.
    fn elastic_stiffness(&self) -> DVec3 {
        DVec3::select(is_infinite(self.stiffness), DVec3::ZERO, self.stiffness)
    }

    /// The change of the strip's energy and loads with its data, at the given `rate`, but for that of
    /// its forces in rigid directions.
    pub fn parameter_derivative(&self, ends: &NodePair, rate: &TissueStrip) -> StripLoads {
        let StripElement {
            mut element,
            sections,
        } = self.strained_element(ends, DVec3::ZERO);
        let StripStrains { e, theta } = self.strains(&element);
        let elastic = self.elastic_stiffness();
        let energy = (0.5 * rate.stiffness * e - elastic * rate.stress_free_gap).dot(e)
            + (0.5 * rate.fold_stiffness * theta
                - self.fold_stiffness * rate.stress_free_rotation.x)
                * theta;
        element.nu = (rate.stiffness * e - elastic * rate.stress_free_gap).into();
        element.m = ((rate.fold_stiffness * theta
            - self.fold_stiffness * rate.stress_free_rotation.x)
            * DVec3::X)
            .into();
        StripLoads {
            energy,
            on_nodes: nodal_loads(element.gradient(&sections)),
        }
    }

    /// The second derivatives of the strip's energy; in rigid directions it carries this spatial
    /// force, which is condensed out.
    pub fn hessian(&self, ends: &NodePair, carried: DVec3) -> StripHessian {
        let force = self.force(ends, carried);
        self.carrying(ends, force).hessian()
    }
}

impl CarryingStrip {
    /// The strip, as its veins are strained.
    pub fn strip(&self) -> &TissueStrip {
        &self.strip
    }

    /// The right-hand side for [`CarryingStrip::hessian`].
    pub fn loads(&self) -> [Wrench; 2] {
        let (strip, element) = (&self.strip, &self.element);
        let Element { nu, w, gap, .. } = *element;
        let correction = Vectors::from(strip.condensing) * gap;
        let lawful = Vectors::from(DVec3::ONE - strip.rigid_directions()) * gap;
        let g_mu = nu.cross(w + lawful) - w.cross(correction);
        nodal_loads(element.nodal_derivatives(nu + correction, g_mu, element.m))
    }

    /// The residual of the law in rigid directions: a length along each director.
    pub fn open_gap(&self) -> DVec3 {
        self.strip.rigid_directions() * DVec3::from(self.element.gap)
    }

    /// The stress across and in the fold of the strip.
    pub fn stress(&self) -> StripStress {
        let (strip, element) = (&self.strip, &self.element);
        let [nu, w, gap, m] = [element.nu, element.w, element.gap, element.m].map(DVec3::from);
        let across = (nu + strip.condensing * gap).y;
        let strain = (w + gap - strip.stress_free_gap).y;
        let turned = DVec3::from(element.u).x - strip.stress_free_rotation.x;
        StripStress {
            across,
            carried_across: nu.y,
            fold: m.x,
            energy: 0.5 * (across * strain + m.x * turned),
        }
    }

    /// The derivatives of its strains across and in the fold by the unknowns of its nodes.
    pub fn strain_gradients(&self) -> StripStrainGradients {
        let element = &self.element;
        let none = Vectors::from(DVec3::ZERO);
        let turned = -DVec3::from(element.w).cross(DVec3::Y);
        let across = element.nodal_derivatives(DVec3::Y.into(), turned.into(), none);
        let fold = element.nodal_derivatives(none, none, DVec3::X.into());
        StripStrainGradients {
            across: pair_gradient(across),
            fold: pair_gradient(fold),
        }
    }

    /// The change of the spatial force for the displacement `dx` of the second node against the first
    /// and the spatial rotations `turns` of both.
    pub fn force_increment(&self, dx: DVec3, turns: [DVec3; 2]) -> DVec3 {
        let (strip, element) = (&self.strip, &self.element);
        let onto = |v: DVec3| DVec3::from(Vectors::from(v).director_components(element.frame));
        let [alpha, beta] = turns.map(onto);
        let [nu, w, gap, tau] = [element.nu, element.w, element.gap, element.relative.tau];
        let [nu, w, gap, tau] = [nu, w, gap, tau].map(DVec3::from);
        let mu = 0.5 * (alpha + beta + (beta - alpha).cross(tau));
        let turned = (DVec3::ONE - strip.rigid_directions()) * nu.cross(mu);
        let change = strip.condensing * (onto(dx) + gap + w.cross(mu)) - turned;
        Vectors::from(change)
            .from_director_components(element.frame)
            .into()
    }

    /// The second derivative of its energy along increments of both nodes: the squares of its strains with their
    /// stiffnesses, and what the force and the moment that it carries add.
    ///
    /// In a mode the strains of stiff tissue are smaller by many digits than the shifts of its ends, of which they are
    /// differences: a product with the matrix loses these digits, the squares do not. Rigid directions count `rigid`
    /// times: once as those of a strip with the stiffness k with which their force is condensed out, k e^2; twice if the force
    /// f = k e is that of a multiplier, whose term is 2 f e.
    pub fn curvature(&self, along: &PairGradient, rigid: f64) -> f64 {
        let (strip, element) = (&self.strip, &self.element);
        let vector = |first: usize| DVec3::from_slice(&along.as_slice()[first..first + 3]);
        let onto = |v: DVec3| DVec3::from(Vectors::from(v).director_components(element.frame));
        let [alpha, beta, dx] = [vector(0), vector(6), vector(9) - vector(3)].map(onto);
        let (w, tau) = (DVec3::from(element.w), DVec3::from(element.relative.tau));
        let mu = 0.5 * (alpha + beta + (beta - alpha).cross(tau));
        let strains = dx + w.cross(mu);
        let times = DVec3::ONE + (rigid - 1.0) * strip.rigid_directions();
        let fold = match strip.fold_stiffness {
            0.0 => 0.0,
            stiffness => stiffness * self.strain_gradients().fold.dot(along).powi(2),
        };
        (times * strip.condensing * strains).dot(strains)
            + fold
            + self.geometric_hessian().curvature(along)
    }

    /// Second derivatives of its energy, the force being condensed out: those of its energy where the
    /// force is that of its strains.
    pub fn hessian(&self) -> StripHessian {
        self.second_derivatives(&self.strip)
    }

    /// The part of [`CarryingStrip::hessian`] without that of its stiffness: by the force that it
    /// carries and by the moment of its fold.
    pub fn geometric_hessian(&self) -> StripHessian {
        let mut without = self.strip;
        (without.condensing, without.fold_stiffness) = (DVec3::ZERO, 0.0);
        self.second_derivatives(&without)
    }

    fn second_derivatives(&self, with_stiffness: &TissueStrip) -> StripHessian {
        let open = self.strip.rigid_directions().into();
        let second = (self.element).second_strained(&with_stiffness.sections(), open);
        StripHessian::from(second.nodal_hessian())
    }
}

impl StripHessian {
    /// The second derivative along increments of both nodes.
    pub fn curvature(&self, along: &PairGradient) -> f64 {
        let (first, second) = along.as_slice().split_at(UNKNOWNS);
        let mut sum = 0.0;
        for (own, block) in [first, second].into_iter().zip(&self.diagonal_blocks) {
            for r in 0..UNKNOWNS {
                let beyond = (r + 1..UNKNOWNS).map(|c| block[r][c] * own[c]);
                sum += own[r] * (block[r][r] * own[r] + 2.0 * beyond.sum::<f64>());
            }
        }
        for (row, value) in self.off_diagonal_block.iter().zip(first) {
            let product: f64 = row.iter().zip(second).map(|(k, other)| k * other).sum();
            sum += 2.0 * value * product;
        }
        sum
    }
}

impl From<NodalHessian<Scalar>> for StripHessian {
    fn from(hessian: NodalHessian<Scalar>) -> Self {
        StripHessian {
            diagonal_blocks: hessian
                .diagonal_blocks
                .map(|block| block.map(|row| row.map(f64::from))),
            off_diagonal_block: hessian.off_diagonal_block.map(|row| row.map(f64::from)),
        }
    }
}

/// Which components are infinite.
fn is_infinite(stiffness: DVec3) -> glam::BVec3 {
    stiffness.cmpeq(DVec3::splat(f64::INFINITY))
}

/// The strains by which tissue contracts of a segment between two nodes, and their derivatives.
pub struct VeinStrain {
    element: Element<Scalar>,
    ds: f64,
    /// Their excess over the segment's at rest.
    pub excess: ContractingStrains,
}

impl VeinStrain {
    /// The strains of a segment between its nodes.
    pub fn between(section: &Section, ends: &NodePair) -> VeinStrain {
        let sections = LaneSections::from(section);
        let element = Element::with_strain_forces(&sections, &LaneNodes::from(ends));
        VeinStrain {
            excess: {
                let v = DVec3::from(element.w) - section.rest_strain;
                let u = DVec3::from(element.u) - section.rest_curvature;
                ContractingStrains {
                    stretch: v.x,
                    shear: v.y,
                    twist: u.x,
                    bend: u.y,
                }
            },
            element,
            ds: section.ds,
        }
    }

    /// The derivatives of the sum of stretch and shear with these factors by the unknowns of the nodes.
    pub fn force_gradient(&self, factors: DVec2) -> PairGradient {
        let factors = factors.extend(0.0);
        let turned = factors.cross(DVec3::from(self.element.w) * self.ds);
        let none = Vectors::from(DVec3::ZERO);
        let first = (self.element).nodal_derivatives(factors.into(), turned.into(), none);
        pair_gradient(first) / self.ds
    }

    /// The derivatives of the sum of twist and bend with these factors by the unknowns of the nodes.
    pub fn moment_gradient(&self, factors: DVec2) -> PairGradient {
        let none = Vectors::from(DVec3::ZERO);
        let first = (self.element).nodal_derivatives(none, none, factors.extend(0.0).into());
        pair_gradient(first) / self.ds
    }

    /// The second derivatives of the sum of all strains with these factors.
    pub fn hessian(&self, factors: StrainFactors) -> StripHessian {
        let mut element = self.element;
        element.nu = (factors.force.extend(0.0) / self.ds).into();
        element.m = (factors.moment.extend(0.0) / self.ds).into();
        element.w = (DVec3::from(element.w) * self.ds).into();
        // Without stiffness only the forces count.
        let sections = LaneSections::from(&Section {
            ds: 1.0,
            couple_stiffness: DVec3::ZERO,
            rest_curvature: DVec3::ZERO,
            rest_strain: DVec3::ZERO,
            compliance: DVec3::ZERO,
            condensing: DVec3::ZERO,
        });
        let none = Vectors::from(DVec3::ZERO);
        let hessian = element.second_strained(&sections, none).nodal_hessian();
        StripHessian::from(hessian)
    }
}

/// The derivatives by the unknowns of both nodes.
fn pair_gradient(first: FirstDerivatives<Scalar>) -> PairGradient {
    let [a, b] = nodal_gradient(first).map(|node| node.map(f64::from));
    PairGradient::from_fn(|k, _| if k < 6 { a[k] } else { b[k - 6] })
}

/// Moment and force on both nodes, minus the derivatives of an energy.
fn nodal_loads(first: FirstDerivatives<Scalar>) -> [Wrench; 2] {
    nodal_gradient(first).map(|node| {
        let [a, b, c, d, e, f] = node.map(f64::from);
        Wrench {
            moment: -DVec3::new(a, b, c),
            force: -DVec3::new(d, e, f),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rotation;
    use glam::DQuat;

    /// A strip far from its natural state, and its ends.
    fn strained() -> (TissueStrip, NodePair) {
        let ends = |scale: f64| NodePair {
            x: [
                DVec3::new(0.1, -0.2, 0.3) * scale,
                DVec3::new(0.15, 0.1, 0.25),
            ],
            q: [
                DQuat::from_scaled_axis(scale * DVec3::new(0.4, -0.3, 0.8)),
                DQuat::from_scaled_axis(DVec3::new(-0.2, 0.5, 0.6) * scale),
            ],
        };
        let strip = TissueStrip::stress_free_between(
            DVec3::new(20.0, 40.0, 0.0),
            0.5,
            DVec3::ZERO,
            &ends(0.3),
        );
        (strip, ends(1.0))
    }

    fn energy(strip: &TissueStrip, ends: &NodePair) -> f64 {
        strip.loads(ends, DVec3::ZERO).energy
    }

    fn loads(strip: &TissueStrip, ends: &NodePair) -> [Wrench; 2] {
        strip.loads(ends, DVec3::ZERO).on_nodes
    }

    /// The ends with one of the 12 unknowns changed.
    fn moved(ends: &NodePair, k: usize, by: f64) -> NodePair {
        let (mut ends, change) = (*ends, by * DVec3::AXES[k % 3]);
        match k % 6 / 3 {
            0 => ends.q[k / 6] = rotation::exp(change) * ends.q[k / 6],
            _ => ends.x[k / 6] += change,
        }
        ends
    }

    /// The derivative of a function of a number by central differences of order 4.
    fn slope(f: impl Fn(f64) -> f64) -> f64 {
        let central = |h: f64| (f(h) - f(-h)) / (2.0 * h);
        (4.0 * central(1e-3) - central(2e-3)) / 3.0
    }

    fn flat(loads: [Wrench; 2]) -> Vec<f64> {
        let vectors = loads.into_iter().flat_map(|it| [it.moment, it.force]);
        vectors.flat_map(|v| v.to_array()).collect()
    }

    #[test]
    fn loads_are_the_derivatives_of_the_energy_and_vanish_in_the_natural_leaf() {
        let (strip, ends) = strained();
        let found = flat(loads(&strip, &ends));
        for k in 0..12 {
            let slope = slope(|h| energy(&strip, &moved(&ends, k, h)));
            assert!((found[k] + slope).abs() < 1e-9, "{k}: {} {slope}", found[k]);
        }
        let rest = TissueStrip::stress_free_between(
            strip.stiffness,
            strip.fold_stiffness,
            DVec3::ZERO,
            &ends,
        );
        assert!(
            flat(loads(&rest, &ends))
                .iter()
                .all(|load| load.abs() < 1e-14)
        );
    }

    /// Whatever force a strip carries, its increment without a motion leads to that of its strains, for
    /// which the condensed loads are the loads; by a motion it changes as that does.
    #[test]
    fn the_force_carried_becomes_that_of_the_strains() {
        let (strip, ends) = strained();
        let strains = strip.force(&ends, DVec3::ZERO);
        let same = flat(strip.carrying(&ends, strains).loads());
        for (one, other) in same.into_iter().zip(flat(loads(&strip, &ends))) {
            assert!((one - other).abs() < 1e-13, "{one} {other}");
        }
        let wrong = strains + DVec3::new(3.0, -2.0, 1.0);
        let none = [DVec3::ZERO; 2];
        let change = strip
            .carrying(&ends, wrong)
            .force_increment(DVec3::ZERO, none);
        // The part without stiffness, along d3, is not carried.
        let d3 = rotation::midpoint(ends.q[0], ends.q[1]) * DVec3::Z;
        assert!((wrong + change - strains).cross(d3).length() < 1e-13);
        for k in 0..12 {
            let increment = DVec3::AXES[k % 3];
            let mut turns = none;
            let dx = match k % 6 / 3 {
                0 => {
                    turns[k / 6] = increment;
                    DVec3::ZERO
                }
                _ => increment * if k < 6 { -1.0 } else { 1.0 },
            };
            let found = strip.carrying(&ends, strains).force_increment(dx, turns);
            let expected = DVec3::from_array(
                [0, 1, 2].map(|c| slope(|h| strip.force(&moved(&ends, k, h), DVec3::ZERO)[c])),
            );
            assert!(found.distance(expected) < 1e-8, "{k}: {found} {expected}");
        }
    }

    /// In spatial increments the derivatives of moments are unsymmetric by half of their moment.
    #[test]
    fn the_hessian_is_the_symmetric_part_of_the_derivative_of_the_loads() {
        let (strip, ends) = strained();
        let hessian = strip.hessian(&ends, DVec3::ZERO);
        let by = |r: usize, k: usize| slope(|h| -flat(loads(&strip, &moved(&ends, k, h)))[r]);
        for (r, k) in (0..12).flat_map(|r| (r..12).map(move |k| (r, k))) {
            let found = match (r / 6, k / 6) {
                (a, b) if a == b => hessian.diagonal_blocks[a][r % 6][k % 6],
                _ => hessian.off_diagonal_block[r % 6][k % 6],
            };
            let expected = 0.5 * (by(r, k) + by(k, r));
            assert!(
                (found - expected).abs() < 1e-8,
                "{r} {k}: {found} {expected}"
            );
        }
    }

    /// The curvature along increments is that of the matrix, but that it keeps its digits where ends turn as one body: there a
    /// strip a hundred million million times as stiff has none, of which a product with its matrix leaves 1e-3.
    #[test]
    fn curvatures_keep_the_digits_that_products_lose() {
        let (strip, ends) = strained();
        let carrying = strip.carrying(&ends, strip.force(&ends, DVec3::ZERO));
        let along = PairGradient::from_fn(|k, _| (0.7 * k as f64).sin());
        let product = carrying.hessian().curvature(&along);
        let found = carrying.curvature(&along, 1.0);
        let off = (found - product).abs();
        assert!(off < 1e-12 * product.abs(), "{found} {product}");
        let stiff = TissueStrip::stress_free_between(DVec3::splat(1e14), 1.0, DVec3::ZERO, &ends);
        let turn = DVec3::new(0.3, -0.7, 0.5);
        let [a, b] = ends.x.map(|x| turn.cross(x));
        let as_one_body = [turn, a, turn, b].map(|v| v.to_array()).concat();
        let as_one_body = PairGradient::from_column_slice(&as_one_body);
        let carrying = stiff.carrying(&ends, DVec3::ZERO);
        assert!(carrying.curvature(&as_one_body, 1.0).abs() < 1e-12);
    }

    #[test]
    fn rates_are_derivatives_by_the_strip() {
        let (strip, ends) = strained();
        let rate = TissueStrip {
            stiffness: DVec3::new(1.0, -2.0, 3.0),
            fold_stiffness: 0.7,
            stress_free_gap: DVec3::new(0.3, 0.1, -0.2),
            stress_free_rotation: DVec3::new(0.2, -0.1, 0.4),
            ..TissueStrip::default()
        };
        let changed = |h: f64| TissueStrip {
            stiffness: strip.stiffness + h * rate.stiffness,
            condensing: strip.stiffness + h * rate.stiffness,
            contraction: 0.0,
            offset: 0.0,
            fold_stiffness: strip.fold_stiffness + h * rate.fold_stiffness,
            stress_free_gap: strip.stress_free_gap + h * rate.stress_free_gap,
            stress_free_rotation: strip.stress_free_rotation + h * rate.stress_free_rotation,
        };
        let found = strip.parameter_derivative(&ends, &rate);
        assert!((found.energy - slope(|h| energy(&changed(h), &ends))).abs() < 1e-9);
        for (k, load) in flat(found.on_nodes).into_iter().enumerate() {
            let expected = slope(|h| flat(loads(&changed(h), &ends))[k]);
            assert!((load - expected).abs() < 1e-9, "{k}: {load} {expected}");
        }
    }
}
