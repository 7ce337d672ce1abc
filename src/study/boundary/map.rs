//! The coarse map under the curves of a boundary: the index of equilibria at the centres of
//! cells, each continued from a neighbouring cell, independently of the curves.

use rayon::prelude::*;

use super::compare::{Crossing, Edge, is_followed};
use super::result::BoundaryMap;
use crate::branch::boundary::{AtRest, Boundary, Path, Plane, follow_path, recount};
use crate::branch::{Critical, Kind};
use crate::leaf::Grid;

/// Largest number of cells along a side.
pub const MOST_CELLS: usize = 256;

/// The cells of a map, as far as they have been computed.
pub struct Cells<'p> {
    plane: &'p Plane<'p>,
    /// Columns and rows.
    size: [usize; 2],
    /// The equilibria found in the last sweep, from which others may be reached.
    front: Vec<Option<AtRest>>,
    /// Paths that were followed, by the cell at their end; only the last one may have reached it.
    edges: Vec<Vec<Edge>>,
    pub factorizations: usize,
}

/// A path that contradicts the curves, with the critical points on it.
pub struct Unexplained {
    pub ends: [[f64; 2]; 2],
    pub grid: Grid,
    pub critical: Vec<Critical>,
}

/// Offsets of neighbouring cells along the first and the second parameter.
const NEIGHBOURS: [[isize; 2]; 4] = [[-1, 0], [1, 0], [0, -1], [0, 1]];

impl<'p> Cells<'p> {
    /// A map of so many cells, all unknown.
    pub fn new(plane: &'p Plane<'p>, size: [usize; 2]) -> Self {
        let count = size[0] * size[1];
        Cells {
            plane,
            size,
            front: vec![None; count],
            edges: (0..count).map(|_| Vec::new()).collect(),
            factorizations: 0,
        }
    }

    /// The centre of a cell.
    fn middle(&self, cell: usize) -> [f64; 2] {
        let at = [cell % self.size[0], cell / self.size[0]];
        [0, 1].map(|i| (at[i] as f64 + 0.5) / self.size[i] as f64)
    }

    /// The neighbours of a cell.
    fn neighbours(&self, cell: usize) -> impl Iterator<Item = usize> + use<> {
        let [columns, rows] = self.size;
        let (column, row) = (cell % columns, cell / columns);
        NEIGHBOURS.into_iter().filter_map(move |[right, up]| {
            let column = column.checked_add_signed(right).filter(|it| *it < columns);
            let row = row.checked_add_signed(up).filter(|it| *it < rows);
            Some(row? * columns + column?)
        })
    }

    /// The index in a cell, if its equilibrium is known.
    fn index(&self, cell: usize) -> Option<usize> {
        self.edges[cell].last()?.found
    }

    /// Continues an equilibrium to the nearest cell of the first column, along the first parameter
    /// and then along the second; returns the paths that contradict the curves.
    pub fn begin(&mut self, first: AtRest, curves: &[Boundary]) -> Vec<Unexplained> {
        let second = first.solution.params[1];
        let row = ((second * self.size[1] as f64) as usize).min(self.size[1] - 1);
        let cell = row * self.size[0];
        let middle = self.middle(cell);
        let mut unexplained = Vec::new();
        let mut now = Some(first);
        for to in [[middle[0], second], middle] {
            if let Some(from) = now.take_if(|from| from.solution.params != to) {
                let mut path = follow_path(self.plane, &from, to);
                now = path.end.take();
                unexplained.extend(self.record((&from, to, now.as_ref()), cell, path, curves));
            }
        }
        self.front[cell] = now;
        unexplained
    }

    /// Recounts the index on finer grids in those cells of the last sweep where it contradicts
    /// the curves: close to a curve, the grid of a path may be too coarse.
    fn recount(&mut self, curves: &[Boundary]) {
        let counted: Vec<(usize, usize)> = (self.front.par_iter().enumerate())
            .filter_map(|(cell, at)| {
                let (at, edge) = (at.as_ref()?, self.edges[cell].last()?);
                if edge.is_explained(curves) {
                    return None;
                }
                Some((cell, recount(self.plane, at)?))
            })
            .collect();
        for (cell, index) in counted {
            if let (Some(at), Some(edge)) = (&mut self.front[cell], self.edges[cell].last_mut()) {
                at.index = index;
                edge.found = Some(index);
            }
        }
    }

    /// Continues to all neighbours of the cells found last, in parallel; returns the paths that
    /// contradict the curves, or `None` if there are no such neighbours.
    pub fn advance(&mut self, curves: &[Boundary]) -> Option<Vec<Unexplained>> {
        self.recount(curves);
        let next: Vec<(usize, Vec<usize>)> = (0..self.front.len())
            .filter(|&cell| self.index(cell).is_none())
            .map(|cell| {
                let from = self.neighbours(cell).filter(|&it| self.front[it].is_some());
                (cell, from.collect())
            })
            .filter(|(_, from): &(usize, Vec<usize>)| !from.is_empty())
            .collect();
        let followed: Vec<Vec<(usize, Path)>> = (next.par_iter())
            .map(|(cell, from)| self.reach(*cell, from))
            .collect();
        let none = vec![None; self.front.len()];
        let before = std::mem::replace(&mut self.front, none);
        let mut unexplained = Vec::new();
        for ((cell, _), paths) in next.iter().zip(followed) {
            for (from, mut path) in paths {
                let (to, end) = (self.middle(*cell), path.end.take());
                if let Some(from) = &before[from] {
                    let ends = (from, to, end.as_ref());
                    unexplained.extend(self.record(ends, *cell, path, curves));
                }
                self.front[*cell] = end;
            }
        }
        (!next.is_empty()).then_some(unexplained)
    }

    /// Continues to a cell from its neighbours in turn, until one path reaches it.
    fn reach(&self, cell: usize, from: &[usize]) -> Vec<(usize, Path)> {
        let mut paths = Vec::new();
        for &other in from {
            let Some(begun) = &self.front[other] else {
                continue;
            };
            let path = follow_path(self.plane, begun, self.middle(cell));
            let found = path.end.is_some();
            paths.push((other, path));
            if found {
                break;
            }
        }
        paths
    }

    /// Records a path to a cell; returns it if it contradicts the curves.
    fn record(
        &mut self,
        (from, to, end): (&AtRest, [f64; 2], Option<&AtRest>),
        cell: usize,
        mut path: Path,
        curves: &[Boundary],
    ) -> Option<Unexplained> {
        self.factorizations += path.factorizations;
        if self.plane.first().joined() {
            path.tips.iter_mut().for_each(|tips| tips.truncate(1));
        }
        let ends = [from.solution.params, to];
        let along = usize::from(ends[0][0] == ends[1][0]);
        let beyond = path.critical.extract_if(.., |it| !is_followed(it.indices));
        let beyond = beyond.map(|critical| Crossing {
            at: ends[0][along] + critical.fraction * (to[along] - ends[0][along]),
            fold: critical.kind == Kind::Fold,
            indices: critical.indices,
        });
        let edge = Edge {
            ends,
            beyond: beyond.collect(),
            index: from.index,
            tips: path.tips,
            found: end.map(|end| end.index),
        };
        let unexplained = (!edge.is_explained(curves)).then_some(Unexplained {
            ends: edge.ends,
            grid: path.grid,
            critical: path.critical,
        });
        self.edges[cell].push(edge);
        unexplained
    }

    /// The map, compared with the curves. A cell disagrees if its index is not the one that they
    /// imply from the cell at the start of its path, or if no path reaches it though they do not
    /// prevent it.
    pub fn compared(&self, curves: &[Boundary]) -> BoundaryMap {
        let [columns, rows] = self.size;
        let value = |i: usize, cell: usize| self.plane.values(self.middle(cell))[i];
        let row = |r: usize| (0..columns).map(|c| self.index(r * columns + c)).collect();
        let mut map = BoundaryMap {
            first: (0..columns).map(|c| value(0, c)).collect(),
            second: (0..rows).map(|r| value(1, r * columns)).collect(),
            index: (0..rows).map(row).collect(),
            disagreeing: Vec::new(),
        };
        for (cell, edges) in self.edges.iter().enumerate() {
            let explained = match edges.last() {
                Some(last) if last.found.is_some() => last.is_explained(curves),
                _ => edges.iter().all(|edge| edge.is_explained(curves)),
            };
            if !explained && self.plane.scenario(self.middle(cell)).is_ok() {
                let (column, row) = (cell % columns + 1, cell / columns + 1);
                map.disagreeing.push([column, row]);
            }
        }
        map
    }
}
