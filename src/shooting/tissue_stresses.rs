//! The tissue of a whole leaf at one sigma: its loads on the rods, after the stresses that are unknowns, and
//! the linearization of both.
//!
//! With the strains of a gap, S = G (rates of the frames) + what depends on poses alone, and the rates
//! free - C G^T t, in which C is the compliance of the rods, the stresses t satisfy
//! (G C G^T + compliance) t = S(free): symmetric, positive, and block-tridiagonal over the gaps, since only
//! neighboring gaps share a rod.

use crate::rod::Wrench;
use crate::rotation::Pose;
use crate::scenario::RodPlace;
use crate::shooting::rod_state::PERTURBATION_SIZE;
use crate::shooting::tissue::{
    FrameRates, GAP_STRAINS, GapTangent, PAIR_PERTURBATION_SIZE, StressedGap, TissueEnergy,
};
use glam::{DMat3, DVec3};
use nalgebra::{Matrix4, SMatrix, Vector4};

/// Rates of a rod's frame, in the order of [`FrameRates`].
const RATES: usize = 6;

/// One rod at one sigma: its law for the rates of its frame.
#[derive(Clone, Copy, Debug)]
pub struct RodSection {
    pub pose: Pose,
    /// Force and moment along the directors: with tissue that is rigid the momenta.
    pub resultants: Wrench,
    /// Rates without stress.
    pub unstrained: FrameRates,
    /// Changes of the rates per force and moment.
    pub compliance: FrameRates,
}

impl RodSection {
    /// The rates where `load` of the resultants does not strain the rod.
    pub fn rates(&self, load: &Wrench) -> FrameRates {
        let (compliance, resultants) = (&self.compliance, &self.resultants);
        FrameRates {
            position: self.unstrained.position
                + compliance.position * (resultants.force - load.force),
            rotation: self.unstrained.rotation
                + compliance.rotation * (resultants.moment - load.moment),
        }
    }
}

/// A rod of a leaf with tissue.
#[derive(Clone, Copy, Debug)]
pub struct RodInTissue {
    pub section: RodSection,
    /// Part of the resultants that the stresses of the tissue carry.
    pub carried: Wrench,
    /// Derivative of the tissue's Lagrangian by displacement and rotation.
    pub by_pose: Wrench,
}

/// The factorized equations of the stresses of a gap.
#[derive(Clone, Copy, Debug)]
struct GapFactor {
    /// Inverse of the diagonal block after elimination of the gaps before.
    inverse: Matrix4<f64>,
    /// Block by the stresses of the next gap.
    upper: Matrix4<f64>,
}

/// The tissue of a leaf at one sigma; empty without tissue.
#[derive(Clone, Debug, Default)]
pub struct TissueState {
    pub rods: Vec<RodInTissue>,
    gaps: Vec<StressedGap>,
    /// Strains of the gaps by the rates of both frames.
    rows: Vec<SMatrix<f64, GAP_STRAINS, PAIR_PERTURBATION_SIZE>>,
    factors: Vec<GapFactor>,
    stresses: Vec<[f64; 1]>,
    /// Potential energy per unit of sigma.
    pub energy: f64,
}

impl TissueState {
    /// Solves for the stresses of the gaps between rods with these sections, and sums up the loads.
    pub fn solve(
        &mut self,
        tissue: &TissueEnergy,
        place: RodPlace,
        lambda: f64,
        sections: impl Iterator<Item = RodSection>,
    ) {
        self.rods.clear();
        self.rods.extend(sections.map(|section| RodInTissue {
            section,
            carried: Wrench::default(),
            by_pose: Wrench::default(),
        }));
        self.gaps.clear();
        self.gaps
            .extend(self.rods.windows(2).enumerate().map(|(g, rods)| {
                let rods = [rods[0].section, rods[1].section];
                StressedGap {
                    law: tissue.law(g, place, lambda),
                    poses: rods.map(|rod| rod.pose),
                    rates: rods.map(|rod| rod.rates(&Wrench::default())),
                    unstrained: rods.map(|rod| rod.unstrained),
                    stresses: [0.0; GAP_STRAINS],
                }
            }));
        if tissue.has_stresses() {
            self.solve_stresses();
        }
        self.energy = 0.0;
        for (g, gap) in self.gaps.iter().enumerate() {
            let loads = gap.loads();
            self.energy += loads.energy;
            for (k, load) in loads.by_pose.into_iter().enumerate() {
                add(&mut self.rods[g + k].by_pose, &load);
            }
        }
    }

    fn solve_stresses(&mut self) {
        self.rows.clear();
        self.factors.clear();
        self.stresses.clear();
        for (g, gap) in self.gaps.iter().enumerate() {
            let mut rows = SMatrix::<f64, GAP_STRAINS, PAIR_PERTURBATION_SIZE>::zeros();
            let strains = gap.loads().by_stresses;
            let mut diagonal = Matrix4::<f64>::zeros();
            for strain in 0..GAP_STRAINS {
                let Some(compliance) = gap.law.stress_compliance(strain) else {
                    diagonal[(strain, strain)] = 1.0;
                    self.stresses.push([0.0]);
                    continue;
                };
                diagonal[(strain, strain)] = compliance;
                self.stresses.push([strains[strain]]);
                let mut unit = [0.0; GAP_STRAINS];
                unit[strain] = 1.0;
                for (k, wrench) in gap.rate_derivatives(&unit).into_iter().enumerate() {
                    let numbers = wrench
                        .force
                        .to_array()
                        .into_iter()
                        .chain(wrench.moment.to_array());
                    for (c, value) in numbers.enumerate() {
                        rows[(strain, RATES * k + c)] = value;
                    }
                }
            }
            let compliances = [0, 1].map(|k| compliance(&self.rods[g + k].section));
            let product = |a: &SMatrix<f64, GAP_STRAINS, PAIR_PERTURBATION_SIZE>,
                           from: usize,
                           b: &SMatrix<f64, GAP_STRAINS, PAIR_PERTURBATION_SIZE>,
                           to: usize,
                           compliance: &[f64; RATES]| {
                Matrix4::from_fn(|r, c| {
                    let terms = compliance.iter().enumerate();
                    terms
                        .map(|(k, value)| a[(r, from + k)] * value * b[(c, to + k)])
                        .sum::<f64>()
                })
            };
            diagonal += product(&rows, 0, &rows, 0, &compliances[0]);
            diagonal += product(&rows, RATES, &rows, RATES, &compliances[1]);
            if let (Some(before), Some(factor)) = (self.rows.last(), self.factors.last_mut()) {
                factor.upper = product(before, RATES, &rows, 0, &compliances[0]);
                diagonal -= factor.upper.transpose() * factor.inverse * factor.upper;
            }
            self.rows.push(rows);
            self.factors.push(GapFactor {
                // Where it is singular nothing follows: NaN is no state.
                inverse: diagonal
                    .cholesky()
                    .map_or(Matrix4::repeat(f64::NAN), |it| it.inverse()),
                upper: Matrix4::zeros(),
            });
        }
        substitute(&self.factors, &mut self.stresses);
        for (g, gap) in self.gaps.iter_mut().enumerate() {
            gap.stresses = [0, 1, 2, 3].map(|strain| self.stresses[GAP_STRAINS * g + strain][0]);
            for (k, load) in gap.rate_derivatives(&gap.stresses).into_iter().enumerate() {
                add(&mut self.rods[g + k].carried, &load);
            }
        }
        for (g, gap) in self.gaps.iter_mut().enumerate() {
            gap.rates = [0, 1].map(|k| self.rods[g + k].rates());
        }
    }

    /// What rigid tissue carries of the momenta of rod `j`: the rest are its force and moment.
    pub fn carried_by_constraints(&self, j: usize) -> Wrench {
        let mut carried = Wrench::default();
        for (g, gap) in self
            .gaps
            .iter()
            .enumerate()
            .take(j + 1)
            .skip(j.saturating_sub(1))
        {
            let [along, _, normal, _] = gap.stresses;
            let both = gap.rate_derivatives(&[along, 0.0, normal, 0.0]);
            add(&mut carried, &both[j - g]);
        }
        carried
    }

    /// The linearized loads without those by the stresses, gap by gap.
    pub fn tangents(&self) -> impl Iterator<Item = GapTangent> {
        self.gaps.iter().map(StressedGap::tangent)
    }

    /// The linearized equations of the stresses.
    pub fn linearized_stresses(&self, tangents: Vec<GapTangent>) -> LinearStresses {
        let rod = |rod: &RodInTissue| LinearRod {
            frame: DMat3::from_quat(rod.section.pose.rotation),
            compliance: rod.section.compliance,
            resultants: rod.section.resultants,
        };
        LinearStresses {
            rods: self.rods.iter().map(rod).collect(),
            rows: self.rows.clone(),
            factors: self.factors.clone(),
            unknown: (self.gaps.iter())
                .map(|gap| [0, 1, 2, 3].map(|i| gap.law.stress_compliance(i).is_some()))
                .collect(),
            tangents,
        }
    }
}

impl RodInTissue {
    /// The rates of its frame.
    pub fn rates(&self) -> FrameRates {
        self.section.rates(&self.carried)
    }
}

fn add(sum: &mut Wrench, other: &Wrench) {
    sum.force += other.force;
    sum.moment += other.moment;
}

fn compliance(section: &RodSection) -> [f64; RATES] {
    let FrameRates { position, rotation } = section.compliance;
    [
        position.x, position.y, position.z, rotation.x, rotation.y, rotation.z,
    ]
}

/// Solves in place for the stresses of all gaps, [`GAP_STRAINS`] rows each.
fn substitute<const W: usize>(factors: &[GapFactor], rows: &mut [[f64; W]]) {
    let blocks: &mut [[[f64; W]; GAP_STRAINS]] = rows.as_chunks_mut().0;
    let column = |block: &[[f64; W]; GAP_STRAINS], w: usize| Vector4::from_fn(|i, _| block[i][w]);
    for (g, factor) in factors.iter().enumerate() {
        for w in 0..W {
            let mut rest = column(&blocks[g], w);
            if let Some(before) = g.checked_sub(1) {
                rest -= factors[before].upper.transpose() * column(&blocks[before], w);
            }
            let solved = factor.inverse * rest;
            (0..GAP_STRAINS).for_each(|i| blocks[g][i][w] = solved[i]);
        }
    }
    for g in (1..factors.len()).rev() {
        let factor = &factors[g - 1];
        for w in 0..W {
            let change = factor.inverse * (factor.upper * column(&blocks[g], w));
            (0..GAP_STRAINS).for_each(|i| blocks[g - 1][i][w] -= change[i]);
        }
    }
}

/// A rod at one sigma, for the linearized equations.
#[derive(Clone, Copy, Debug)]
struct LinearRod {
    frame: DMat3,
    compliance: FrameRates,
    /// Along the directors.
    resultants: Wrench,
}

/// The linearized equations of the stresses of all gaps at one sigma.
#[derive(Clone, Debug)]
pub struct LinearStresses {
    rods: Vec<LinearRod>,
    rows: Vec<SMatrix<f64, GAP_STRAINS, PAIR_PERTURBATION_SIZE>>,
    factors: Vec<GapFactor>,
    /// Which stresses are unknowns.
    unknown: Vec<[bool; GAP_STRAINS]>,
    tangents: Vec<GapTangent>,
}

/// Memory for [`LinearStresses::add_slopes`]: the changes of rates and stresses by `W` perturbations.
#[derive(Clone, Debug)]
pub struct StressChanges<const W: usize> {
    /// Of the rates of all frames, along the directors.
    rates: Vec<[f64; W]>,
    /// Of what the stresses carry.
    carried: Vec<[f64; W]>,
    stresses: Vec<[f64; W]>,
}

impl<const W: usize> StressChanges<W> {
    /// For a leaf of so many rods.
    pub fn new(rods: usize) -> Self {
        StressChanges {
            rates: vec![[0.0; W]; RATES * rods],
            carried: vec![[0.0; W]; RATES * rods],
            stresses: vec![[0.0; W]; GAP_STRAINS * rods.saturating_sub(1)],
        }
    }
}

impl LinearStresses {
    /// Adds what the stresses change in the linearized slopes of perturbations of all rods.
    pub fn add_slopes<const W: usize>(
        &self,
        rows: &[[f64; W]],
        slopes: &mut [[f64; W]],
        changes: &mut StressChanges<W>,
    ) {
        let StressChanges {
            rates,
            carried,
            stresses,
        } = changes;
        // Rates at fixed stresses.
        carried.fill([0.0; W]);
        stresses.fill([0.0; W]);
        for (g, gap) in self.tangents.iter().enumerate() {
            for c in 0..PAIR_PERTURBATION_SIZE {
                let row = &rows[perturbation_row(g, c)];
                for r in 0..2 * RATES {
                    add_product(&mut carried[RATES * g + r], gap.by_rates[(r, c)], row);
                }
                for r in 0..GAP_STRAINS {
                    add_product(
                        &mut stresses[GAP_STRAINS * g + r],
                        gap.by_stresses[(r, c)],
                        row,
                    );
                }
            }
        }
        for (j, rod) in self.rods.iter().enumerate() {
            let lab = rod.frame.transpose();
            let Wrench { force, moment } = rod.resultants;
            for w in 0..W {
                let part = |k: usize| {
                    let first = PERTURBATION_SIZE * j + 3 * k;
                    DVec3::new(rows[first][w], rows[first + 1][w], rows[first + 2][w])
                };
                let theta = lab * part(1);
                let own = [
                    rod.compliance.position * (lab * part(2) + force.cross(theta)),
                    rod.compliance.rotation * (lab * part(3) + moment.cross(theta)),
                ];
                for (k, value) in own.iter().flat_map(|v| v.to_array()).enumerate() {
                    rates[RATES * j + k][w] = value;
                }
            }
        }
        let soft = |k: usize| {
            let FrameRates { position, rotation } = self.rods[k / RATES].compliance;
            match k % RATES {
                k @ 0..3 => position[k],
                k => rotation[k - 3],
            }
        };
        for (k, (rate, carried)) in rates.iter_mut().zip(&*carried).enumerate() {
            add_product(rate, -soft(k), carried);
        }
        // Stresses, of those that are unknowns.
        for (g, gap) in self.rows.iter().enumerate() {
            for (r, own) in stresses[GAP_STRAINS * g..][..GAP_STRAINS]
                .iter_mut()
                .enumerate()
            {
                if !self.unknown[g][r] {
                    own.fill(0.0);
                }
                for c in 0..2 * RATES {
                    add_product(own, gap[(r, c)], &rates[RATES * g + c]);
                }
            }
        }
        substitute(&self.factors, stresses);
        for (g, gap) in self.rows.iter().enumerate() {
            for r in 0..GAP_STRAINS {
                let stress = stresses[GAP_STRAINS * g + r];
                for c in 0..2 * RATES {
                    let change = gap[(r, c)];
                    add_product(&mut carried[RATES * g + c], change, &stress);
                    let k = RATES * g + c;
                    add_product(&mut rates[k], -soft(k) * change, &stress);
                }
            }
        }
        // Loads by the changes of rates and stresses.
        for (g, gap) in self.tangents.iter().enumerate() {
            for c in 0..PAIR_PERTURBATION_SIZE {
                let slope = &mut slopes[perturbation_row(g, c) + 6];
                for r in 0..2 * RATES {
                    add_product(slope, gap.by_rates[(r, c)], &rates[RATES * g + r]);
                }
                for r in 0..GAP_STRAINS {
                    let stress = &stresses[GAP_STRAINS * g + r];
                    add_product(slope, gap.by_stresses[(r, c)], stress);
                }
            }
        }
        // Rates by what the stresses carry, and the moments of the forces.
        for (j, rod) in self.rods.iter().enumerate() {
            let force = rod.frame * rod.resultants.force;
            for w in 0..W {
                let part = |k: usize| {
                    let first = RATES * j + 3 * k;
                    DVec3::new(
                        carried[first][w],
                        carried[first + 1][w],
                        carried[first + 2][w],
                    )
                };
                let position = -(rod.frame * (rod.compliance.position * part(0)));
                let rotation = -(rod.frame * (rod.compliance.rotation * part(1)));
                let moment = force.cross(position);
                for (k, change) in [(0, position), (3, rotation), (9, moment)] {
                    for c in 0..3 {
                        slopes[PERTURBATION_SIZE * j + k + c][w] += change[c];
                    }
                }
            }
        }
    }
}

/// Row of the perturbations of all rods for component `c` of the pair at gap `g`.
fn perturbation_row(g: usize, c: usize) -> usize {
    PERTURBATION_SIZE * (g + c / 6) + c % 6
}

#[inline]
fn add_product<const W: usize>(sum: &mut [f64; W], factor: f64, row: &[f64; W]) {
    for w in 0..W {
        sum[w] += factor * row[w];
    }
}
