//! The ground of a plane of two numbers on which the branch is stable, between the curves of a
//! boundary.

use std::collections::HashMap;

use super::boundary_sides::Line;
use super::map::PALE;
use crate::figure::drawing::{Drawing, polygon};
use crate::figure::layout::Cell;
use glam::DVec2;

/// Distance in pixels of the rows in which crossings with curves are looked for, and of the columns.
const ROW: f64 = 2.0;
const COLUMN: f64 = 4.0;
/// Least distance of a column from the ends of a stretch in which it is.
const BESIDE: f64 = 0.5;

/// A part of a row between two crossings with curves, or a crossing and an end of the row.
struct Stretch {
    row: usize,
    /// The curves at both ends.
    between: [Option<usize>; 2],
    ends: [f64; 2],
    /// Whether the curves say that it is stable: one, both alike, or not all.
    stable: Option<bool>,
}

/// Shades where the branch is stable in a part of the plane that curves leave only at its rim; whether
/// there is such ground.
pub fn shade(page: &mut Drawing, cell: Cell, curves: &[Line]) -> bool {
    let rows = (cell.size.y / ROW).floor().max(1.0) as usize;
    let height = cell.size.y / rows as f64;
    let y = |row: usize| cell.corner.y + (row as f64 + 0.5) * height;
    let stretches: Vec<Stretch> = (0..rows)
        .flat_map(|row| stretches(cell, curves, (row, y(row))))
        .collect();
    let regions = regions(&stretches, cell, curves, y);
    // Of the stretches of a region those with curves must all say that it is stable.
    let stable = |place: usize| {
        let mut said = (stretches.iter().zip(&regions))
            .filter(|(_, region)| **region == regions[place])
            .filter_map(|(stretch, _)| stretch.stable)
            .peekable();
        said.peek().is_some() && said.all(|stable| stable)
    };
    let mut verdicts: HashMap<usize, bool> = HashMap::new();
    // One polygon for stretches between the same curves in one row after the other.
    let mut polygons: Vec<(&Stretch, Vec<[DVec2; 2]>)> = Vec::new();
    for (place, stretch) in stretches.iter().enumerate() {
        if !*(verdicts.entry(regions[place])).or_insert_with(|| stable(place)) {
            continue;
        }
        let ends = stretch.ends.map(|x| DVec2::new(x, y(stretch.row)));
        let above = polygons
            .iter_mut()
            .rev()
            .find(|(last, _)| last.row + 1 == stretch.row && last.between == stretch.between);
        match above {
            Some((last, ends_of)) => {
                *last = stretch;
                ends_of.push(ends);
            }
            None => polygons.push((stretch, vec![ends])),
        }
    }
    let any = !polygons.is_empty();
    for (_, mut ends) in polygons {
        // To the rims of its rows.
        let half = DVec2::new(0.0, 0.5 * height);
        let (first, last) = (ends[0], ends[ends.len() - 1]);
        ends.insert(0, first.map(|at| at - half));
        ends.push(last.map(|at| at + half));
        let left = ends.iter().map(|ends| ends[0]);
        let right = ends.iter().rev().map(|ends| ends[1]);
        let corners: Vec<DVec2> = left.chain(right).collect();
        page.shape(polygon(&corners), PALE, None);
    }
    any
}

/// The stretches of a row, from left to right.
fn stretches(cell: Cell, curves: &[Line], (row, y): (usize, f64)) -> Vec<Stretch> {
    let from = cell.corner.with_y(y);
    let mut crossings: Vec<(f64, [bool; 2], usize)> = (curves.iter().enumerate())
        .flat_map(|(k, curve)| {
            let found = curve.stable_beside(from, DVec2::X);
            found.map(move |(x, sides)| (x, sides.unwrap_or_default(), k))
        })
        .filter(|(x, ..)| (0.0..=cell.size.x).contains(x))
        .collect();
    crossings.sort_by(|a, b| a.0.total_cmp(&b.0));
    let at = |k: Option<usize>| k.and_then(|k| crossings.get(k));
    (0..=crossings.len())
        .map(|k| {
            let (left, right) = (at(k.checked_sub(1)), at(Some(k)));
            let said = [left.map(|it| it.1[1]), right.map(|it| it.1[0])];
            Stretch {
                row,
                between: [left, right].map(|it| it.map(|it| it.2)),
                ends: [
                    left.map_or(0.0, |it| it.0),
                    right.map_or(cell.size.x, |it| it.0),
                ]
                .map(|x| from.x + x),
                stable: said.into_iter().flatten().reduce(|a, b| a && b),
            }
        })
        .collect()
}

/// The region of each stretch: those of neighbouring rows are one where a column leads from one to the
/// other without a curve in between.
fn regions(
    stretches: &[Stretch],
    cell: Cell,
    curves: &[Line],
    y: impl Fn(usize) -> f64,
) -> Vec<usize> {
    let columns = (cell.size.x / COLUMN).ceil().max(1.0) as usize;
    let x = |k: usize| cell.corner.x + (k as f64 + 0.5) * cell.size.x / columns as f64;
    let crossed: Vec<Vec<f64>> = (0..columns)
        .map(|k| {
            let top = DVec2::new(x(k), 0.0);
            let found = curves.iter().flat_map(|it| it.stable_beside(top, DVec2::Y));
            found.map(|(y, _)| y).collect()
        })
        .collect();
    let mut parent: Vec<usize> = (0..stretches.len()).collect();
    fn root(parent: &mut [usize], mut place: usize) -> usize {
        while parent[place] != place {
            parent[place] = parent[parent[place]];
            place = parent[place];
        }
        place
    }
    let rows: Vec<usize> = {
        let last = stretches.last().map_or(0, |stretch| stretch.row);
        (0..=last + 1)
            .map(|row| stretches.partition_point(|stretch| stretch.row < row))
            .collect()
    };
    for (place, stretch) in stretches.iter().enumerate() {
        let Some(&end) = rows.get(stretch.row + 2) else {
            continue;
        };
        let (here, below) = (y(stretch.row), y(stretch.row + 1));
        for other in rows[stretch.row + 1]..end {
            let [low, high] = [
                stretch.ends[0].max(stretches[other].ends[0]),
                stretch.ends[1].min(stretches[other].ends[1]),
            ];
            // A column along a curve leads nowhere.
            let open = (0..columns).any(|k| {
                let inside = low + BESIDE < x(k) && x(k) < high - BESIDE;
                inside && !crossed[k].iter().any(|y| (here..=below).contains(y))
            });
            if open {
                let [a, b] = [place, other].map(|it| root(&mut parent, it));
                parent[a] = b;
            }
        }
    }
    (0..stretches.len())
        .map(|place| root(&mut parent, place))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::drawing::{Mark, Step};
    use crate::figure::svg::text;

    /// A line through these points with the index on both sides.
    fn line(points: &[[f64; 2]], sides: [usize; 2]) -> Line {
        let points: Vec<DVec2> = points.iter().map(|&it| DVec2::from_array(it)).collect();
        let pieces = points.windows(2).map(|ends| ([ends[0], ends[1]], sides));
        Line::new(pieces.collect(), false)
    }

    /// The area that is shaded of a panel of 100 x 100.
    fn area(curves: &[Line]) -> f64 {
        let cell = Cell::new(DVec2::ZERO, DVec2::splat(100.0));
        let mut page = Drawing::new(100.0, "");
        assert_eq!(shade(&mut page, cell, curves), !page.marks.is_empty());
        text(&page);
        let area = |mark: &Mark| {
            let Mark::Shape { path, .. } = mark else {
                return 0.0;
            };
            let at = path.iter().filter_map(|step| match step {
                Step::Move(at) | Step::Line(at) => Some(*at),
                _ => None,
            });
            let at: Vec<DVec2> = at.collect();
            let next = at.iter().cycle().skip(1);
            0.5 * at
                .iter()
                .zip(next)
                .map(|(a, b)| a.perp_dot(*b))
                .sum::<f64>()
                .abs()
        };
        page.marks.iter().map(area).sum()
    }

    fn vertical(x: f64, sides: [usize; 2]) -> Line {
        line(&[[x, -1.0], [x, 101.0]], sides)
    }

    #[test]
    fn ground_is_stable_where_all_curves_say_so() {
        for (curves, wanted) in [
            (vec![vertical(60.0, [1, 0]), vertical(30.0, [0, 1])], 7000.0),
            (vec![vertical(30.0, [1, 0])], 7000.0),
            (vec![vertical(30.0, [2, 0]), vertical(40.0, [0, 1])], 1000.0),
            // They contradict each other, or there is none.
            (vec![vertical(30.0, [1, 0]), vertical(40.0, [1, 2])], 0.0),
            (vec![], 0.0),
        ] {
            assert!((area(&curves) - wanted).abs() < 1e-6, "{wanted}");
        }
    }

    /// Ground reaches below the lowest point of a curve that turns back, and around it.
    #[test]
    fn rows_without_a_curve_belong_to_the_ground_beside_them() {
        let inside = line(&[[20.0, -1.0], [20.0, 60.0], [50.0, 61.0]], [0, 1]);
        let other = line(&[[50.0, 61.0], [80.0, 60.0], [80.0, -1.0]], [1, 0]);
        let hollow = 60.0 * 60.0;
        assert!((area(&[inside, other]) - (10_000.0 - hollow)).abs() < 100.0);
    }
}
