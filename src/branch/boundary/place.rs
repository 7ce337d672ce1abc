//! A point of a boundary: an equilibrium on the sheet at which the matrix is singular.

use nalgebra::DMatrix;

use super::search::{self, Eigen, Found, Lost, Search};
use super::sheet::{Direction, Sample, Sheet, Spot};
use crate::branch::critical::{Critical, Kind};
use crate::branch::deflation::STIFF;
use crate::branch::equations::Stuck;
use crate::branch::field::{add, combined, dot, plus, times};
use crate::leaf::Field;

/// The distance over which the change of a singular value is differenced.
const DIFFERENCE: f64 = 3e-4;

/// Below this part of what a mode could feel of a number, it feels nothing but rounding.
const DRIVEN: f64 = 1e-5;

/// Eigenvalues that differ by more than this, relative to their change with a step of
/// length one, do not vanish together.
const TOGETHER: f64 = 1e-5;

/// An eigenvalue that is smaller than this is that of a neutral mode.
const NEUTRAL: f64 = 1e-7;

/// A point of a boundary on one grid.
#[derive(Clone, Debug)]
pub struct Place {
    /// Where it is.
    pub spot: Spot,
    /// What becomes neutral there, and whether the branch along the first number turns.
    pub kind: Kind,
    /// How many modes become neutral together.
    pub neutral: usize,
    /// The modes of the border: first the neutral ones.
    pub held: Vec<Field>,
    /// The way along the boundary and the way across it on the sheet: this goes to where
    /// there are more negative eigenvalues.
    pub tangent: Direction,
    pub normal: Direction,
    /// Change of the eigenvalue of H along the latter.
    pub slope: f64,
    /// Morse index across the boundary, and before it.
    pub index: usize,
    /// Eigenvalues of H but for those that are zero.
    pub others: Vec<f64>,
    /// Along a fold: the change of the numbers with the way along the boundary, which
    /// changes its sign at a cusp.
    pub speed: f64,
    /// The direction in the plane of the numbers in which a fold goes.
    pub heading: [f64; 2],
}

/// A critical point of a branch through the plane.
#[derive(Clone, Copy)]
pub struct Seed<'c> {
    pub critical: &'c Critical,
    /// Both numbers, as fractions of their ranges,
    pub place: [f64; 2],
    /// and their change with the parameter of the branch.
    pub way: [f64; 2],
}

impl Seed<'_> {
    /// The number that does not change along the branch, if there is one.
    pub fn given(&self) -> Option<usize> {
        [1, 0].into_iter().find(|&which| self.way[which] == 0.0)
    }
}

impl Place {
    /// Where a boundary begins: it lies across the branch.
    pub fn begin(sheet: &mut Sheet, seed: &Seed) -> Result<Place, Lost> {
        let Seed {
            critical,
            place,
            way,
        } = seed;
        let modes = critical.modes.iter().chain(&critical.held);
        let held = independent(sheet, modes, critical.held.len());
        let spot = Spot {
            state: critical.state.clone(),
            place: *place,
        };
        let across = Direction {
            increments: critical.tangent.increments.clone(),
            place: way.map(|part| part * critical.tangent.fraction),
        };
        let slope = critical.slope / sheet.along(&across, &across).sqrt();
        let across = sheet.normalised(across);
        let along = sheet.normalised(Direction {
            place: [-way[1], way[0]],
            ..sheet.number(1)
        });
        let like = Place {
            spot,
            kind: critical.kind,
            neutral: critical.modes.len(),
            held,
            tangent: along.clone(),
            normal: across.clone(),
            slope,
            index: 0,
            others: Vec::new(),
            speed: 0.0,
            heading: [0.0; 2],
        };
        let found = Search {
            spot: &like.spot,
            across: &across,
            slope,
            along: &along,
            held: &like.held,
            neutral: like.neutral,
            accuracy: 1e-11,
            furthest: 0.1,
        };
        let found = found.run(sheet)?;
        like.at(sheet, found)
    }

    /// The point that was found from this one, with the directions of this one.
    pub fn moved(&self, sheet: &Sheet, found: Found) -> Place {
        let Found { sample, eigen, .. } = found;
        Place {
            held: held(sheet, &sample, &eigen),
            index: index(&sample, &eigen),
            others: eigen.others,
            spot: sample.spot,
            ..self.clone()
        }
    }

    /// The same with its own directions: the way along the boundary as here.
    pub fn at(&self, sheet: &mut Sheet, found: Found) -> Result<Place, Lost> {
        let border = self.held.iter().map(|mode| sheet.equations.momentum(mode));
        let border: Vec<Field> = border.collect();
        let sample = sheet.look(found.sample.spot, &border)?;
        let eigen = search::eigen(&sample, self.neutral);
        let basis = self.basis(sheet, &sample, &eigen)?;
        let held = held(sheet, &sample, &eigen);
        let change = self.change(sheet, &sample, &basis, &held)?;
        let slope = change[0].hypot(change[1]);
        if !(slope.is_finite() && slope > NEUTRAL) {
            return Err(Lost::Stuck(Stuck::NotConverged));
        }
        if eigen.spread > TOGETHER * slope {
            return Err(Lost::Parted);
        }
        let [a, b] = change.map(|part| part / slope);
        let normal = Direction::mixed([a, b], &basis);
        let mut tangent = Direction::mixed([-b, a], &basis);
        if sheet.along(&tangent, &self.tangent) < 0.0 {
            tangent = tangent.reversed();
        }
        let drive = self.drive(&sample, &eigen, slope);
        if self.kind == Kind::Branching && drive.felt > DRIVEN {
            return Err(Lost::Unfolded);
        }
        // A fold moves in the direction in which the mode feels nothing.
        let mut heading = drive.free;
        if heading[0] * self.heading[0] + heading[1] * self.heading[1] < 0.0 {
            heading = heading.map(|part| -part);
        }
        Ok(Place {
            kind: self.kind,
            neutral: self.neutral,
            held,
            speed: heading[0] * tangent.place[0] + heading[1] * tangent.place[1],
            heading,
            tangent,
            normal,
            slope,
            index: index(&sample, &eigen),
            others: eigen.others,
            spot: sample.spot,
        })
    }

    /// The change of the eigenvalue along both directions on the sheet: with K X + B H = 0
    /// and B^T X = 1 that of H is -X^T dK X. How far off the sheet a straight way leads does
    /// not count in central differences, but for stiff segments, which feel it.
    fn change(
        &self,
        sheet: &mut Sheet,
        sample: &Sample,
        basis: &[Direction; 2],
        held: &[Field],
    ) -> Result<[f64; 2], Lost> {
        let modes = &held[..self.neutral.min(held.len())];
        let border: Vec<Field> = held.iter().map(|it| sheet.equations.momentum(it)).collect();
        let stiff = sheet.leaf(sample.spot.place)?.stiffest() * STIFF <= 1.0;
        let mut change = [0.0; 2];
        for (change, direction) in change.iter_mut().zip(basis) {
            let mut at = |step: f64| {
                let mut spot = sheet.beside(&sample.spot, direction, step)?;
                if stiff {
                    let normals = [&basis[0], &basis[1]];
                    spot = sheet.settle(&spot, normals, &border, &sample.rates)?.spot;
                }
                Ok::<_, Stuck>((step, sheet.curvature(spot, modes)?))
            };
            let [after, before] = [DIFFERENCE, -DIFFERENCE].map(|step| match at(step) {
                // At an end of a range there may be nothing beyond.
                Err(Stuck::OutOfRange(_)) => at(0.0),
                found => found,
            });
            let ((after, above), (before, below)) = (after?, before?);
            *change = (below - above) / (after - before);
        }
        Ok(change)
    }

    /// Two directions of length one, normal to each other, that span the sheet.
    fn basis(&self, sheet: &Sheet, sample: &Sample, eigen: &Eigen) -> Result<[Direction; 2], Lost> {
        let solved = &sample.solved;
        let p = solved.modes.len();
        let others = eigen.others.iter().zip(&eigen.vectors[self.neutral..]);
        let left = others.filter(|(value, _)| value.abs() < NEUTRAL);
        let mut frozen: Vec<&Vec<f64>> = left.map(|(_, vector)| vector).collect();
        if self.kind == Kind::Branching {
            // Along a neutral mode another branch may leave: the sheet is this one's.
            frozen.extend(&eigen.vectors[..self.neutral]);
        }
        let rows = (p + frozen.len()).max(p + 2);
        let mut matrix = DMatrix::<f64>::zeros(rows, p + 2);
        for r in 0..p {
            for c in 0..p {
                matrix[(r, c)] = solved.h[(r, c)];
            }
            for i in 0..2 {
                matrix[(r, p + i)] = solved.rates[i].multipliers[r];
            }
        }
        for (k, vector) in frozen.iter().enumerate() {
            for c in 0..p {
                matrix[(p + k, c)] = vector[c];
            }
        }
        let svd = matrix.svd(false, true);
        let right = svd.v_t.ok_or(Stuck::NotConverged)?;
        let mut order: Vec<usize> = (0..p + 2).collect();
        order.sort_by(|&a, &b| svd.singular_values[a].total_cmp(&svd.singular_values[b]));
        let direction = |row: usize| {
            let part = |c: usize| right[(row, c)];
            let parts: Vec<f64> = (0..p).map(part).collect();
            let mut increments = combined(&parts, &solved.modes);
            for i in 0..2 {
                add(&mut increments, part(p + i), &solved.rates[i].increments);
            }
            Direction {
                increments,
                place: [part(p), part(p + 1)],
            }
        };
        let first = sheet.normalised(direction(order[0]));
        let second = direction(order[1]);
        let part = sheet.along(&first, &second);
        let second = Direction {
            increments: plus(&second.increments, -part, &first.increments),
            place: [0, 1].map(|i| second.place[i] - part * first.place[i]),
        };
        Ok([first, sheet.normalised(second)])
    }

    fn drive(&self, sample: &Sample, eigen: &Eigen, slope: f64) -> Drive {
        let (solved, rates) = (&sample.solved, &sample.rates);
        let mut felt = 0.0_f64;
        let mut free = [0.0; 2];
        for vector in &eigen.vectors[..self.neutral] {
            let mode = combined(vector, &solved.modes);
            let drive = [0, 1].map(|i| {
                let multipliers = &solved.rates[i].multipliers;
                vector
                    .iter()
                    .zip(multipliers)
                    .map(|(v, d)| v * d)
                    .sum::<f64>()
            });
            for i in 0..2 {
                let most = (dot(&rates[i], &rates[i]) * dot(&mode, &mode)).sqrt();
                felt = felt.max(drive[i].abs() / most.max(slope));
            }
            let size = drive[0].hypot(drive[1]);
            free = [-drive[1] / size, drive[0] / size];
        }
        Drive { felt, free }
    }

    /// The direction on the sheet, across the boundary, in which one of the numbers
    /// stays, and the change of the eigenvalue along it.
    pub fn across_at(&self, sheet: &Sheet, which: usize) -> (Direction, f64) {
        let parts = [self.tangent.place[which], -self.normal.place[which]];
        let both = [self.normal.clone(), self.tangent.clone()];
        let across = sheet.normalised(Direction::mixed(parts, &both));
        let slope = self.slope * sheet.along(&across, &self.normal);
        (across, slope)
    }

    /// Going along the boundary the other way.
    pub fn turned(&self) -> Place {
        Place {
            tangent: self.tangent.reversed(),
            speed: -self.speed,
            ..self.clone()
        }
    }
}

/// The modes for the next border: those of the eigenvectors of H.
fn held(sheet: &Sheet, sample: &Sample, eigen: &Eigen) -> Vec<Field> {
    let modes = eigen.vectors.iter();
    let modes: Vec<Field> = modes.map(|it| combined(it, &sample.solved.modes)).collect();
    independent(sheet, modes.iter(), modes.len())
}

/// Morse index across the boundary: by the inertia of the bordered matrix, which is that of
/// the matrix alone and of H together. Neutral modes do not count, but for the boundary's.
fn index(sample: &Sample, eigen: &Eigen) -> usize {
    let held_negative = eigen.others.iter().filter(|&&h| h < NEUTRAL).count();
    sample.solved.negative.saturating_sub(held_negative)
}

/// What the neutral modes feel of the numbers.
struct Drive {
    /// The largest part of what they could feel.
    felt: f64,
    /// The direction in the plane of the numbers in which they feel nothing.
    free: [f64; 2],
}

/// As many of these modes as are wanted, of mass one and normal to each other over the
/// masses; those that depend on the ones before are left out.
fn independent<'m>(
    sheet: &Sheet,
    modes: impl Iterator<Item = &'m Field>,
    count: usize,
) -> Vec<Field> {
    let equations = &sheet.equations;
    let mut kept: Vec<Field> = Vec::new();
    for mode in modes {
        let size = equations.product(mode, mode).sqrt();
        let mut mode = times(mode, 1.0 / size);
        for _ in 0..2 {
            for other in &kept {
                let part = equations.product(other, &mode);
                add(&mut mode, -part, other);
            }
        }
        let size = equations.product(&mode, &mode).sqrt();
        if size > 1e-6 && kept.len() < count {
            kept.push(times(&mode, 1.0 / size));
        }
    }
    kept
}
