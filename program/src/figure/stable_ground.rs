//! The ground of a plane of two numbers on which the branch is stable, between the curves of a
//! boundary.

use super::boundary_sides::Line;
use super::map::PALE;
use crate::figure::drawing::{Drawing, polygon};
use crate::figure::layout::Cell;
use glam::DVec2;

/// Distance in pixels of the rows in which crossings with curves are looked for.
const ROW: f64 = 2.0;

/// A stretch of stable ground, row after row, between the same two curves.
struct Ground {
    /// The curves to the left and to the right; `None`: the frame.
    between: [Option<usize>; 2],
    left: Vec<DVec2>,
    right: Vec<DVec2>,
}

/// Shades where the branch is stable; whether there is such ground. Of rows that no curve crosses
/// nothing is known.
pub fn shade(page: &mut Drawing, cell: Cell, curves: &[Line]) -> bool {
    let (mut done, mut open): (Vec<Ground>, Vec<Ground>) = (Vec::new(), Vec::new());
    let rows = (cell.size.y / ROW).floor() as usize;
    for row in 0..=rows {
        let y = cell.corner.y + (row as f64 + 0.5) * cell.size.y / (rows as f64 + 1.0);
        let mut next = Vec::new();
        for (between, [left, right]) in stable_stretches(cell, curves, y) {
            let same = open.iter().position(|ground| ground.between == between);
            let mut ground = match same {
                Some(place) => open.swap_remove(place),
                None => Ground {
                    between,
                    left: Vec::new(),
                    right: Vec::new(),
                },
            };
            ground.left.push(DVec2::new(left, y));
            ground.right.push(DVec2::new(right, y));
            next.push(ground);
        }
        done.append(&mut open);
        open = next;
    }
    done.append(&mut open);
    for ground in &done {
        let corners = ground.left.iter().chain(ground.right.iter().rev());
        page.shape(polygon(&corners.copied().collect::<Vec<_>>()), PALE, None);
    }
    !done.is_empty()
}

/// The stretches of a row in which the branch is stable, with the curves that bound them.
fn stable_stretches(cell: Cell, curves: &[Line], y: f64) -> Vec<([Option<usize>; 2], [f64; 2])> {
    let from = cell.corner.with_y(y);
    let mut crossings: Vec<(f64, Option<[bool; 2]>, usize)> = (curves.iter().enumerate())
        .flat_map(|(k, curve)| {
            curve
                .stable_beside(from, DVec2::X)
                .map(move |(x, it)| (x, it, k))
        })
        .filter(|(x, ..)| (0.0..=cell.size.x).contains(x))
        .collect();
    crossings.sort_by(|a, b| a.0.total_cmp(&b.0));
    // The side of a crossing; the frame does not contradict.
    let side = |k: Option<usize>, which: usize| match k.and_then(|k| crossings.get(k)) {
        Some((_, sides, _)) => Some(sides.is_some_and(|it| it[which])),
        None => None,
    };
    let count = crossings.len();
    let stable = (0..=count).filter(|&k| {
        let both = [side(k.checked_sub(1), 1), side(Some(k), 0)];
        count > 0 && both.into_iter().flatten().all(|stable| stable)
    });
    let end = |k: Option<usize>, frame: f64| match k.and_then(|k| crossings.get(k)) {
        Some((x, _, curve)) => (Some(*curve), from.x + x),
        None => (None, frame),
    };
    stable
        .map(|k| {
            let (left, a) = end(k.checked_sub(1), from.x);
            let (right, b) = end(Some(k), cell.end().x);
            ([left, right], [a, b])
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A vertical line with the index on both sides, across a panel of 100 x 100.
    fn vertical(x: f64, sides: [usize; 2]) -> Line {
        let ends = [DVec2::new(x, -1.0), DVec2::new(x, 101.0)];
        Line::new(vec![(ends, sides)], false)
    }

    #[test]
    fn ground_is_stable_where_both_curves_say_so() {
        let cell = Cell::new(DVec2::ZERO, DVec2::splat(100.0));
        let stretches = |curves: &[Line]| -> Vec<[f64; 2]> {
            let found = stable_stretches(cell, curves, 50.0).into_iter();
            found.map(|(_, ends)| ends).collect()
        };
        let (one, two) = (vertical(30.0, [0, 1]), vertical(60.0, [1, 0]));
        assert_eq!(stretches(&[two, one]), [[0.0, 30.0], [60.0, 100.0]]);
        assert_eq!(stretches(&[vertical(30.0, [1, 0])]), [[30.0, 100.0]]);
        let strip = [vertical(30.0, [2, 0]), vertical(40.0, [0, 1])];
        assert_eq!(stretches(&strip), [[30.0, 40.0]]);
        // They contradict each other, or there is none.
        let against = [vertical(30.0, [1, 0]), vertical(40.0, [1, 2])];
        assert!(stretches(&against).is_empty() && stretches(&[]).is_empty());
    }
}
