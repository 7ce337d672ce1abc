//! The grid: positions of the nodes along the rods.

/// Nodes as fractions sigma = s/L of every rod's length, from 0 to 1, the same
/// for all rods since the coupling joins equal fractions.
///
/// The interval is cut into panels wherever a profile has a kink, and every
/// panel into equal segments, so that the midpoint rule never reaches across a
/// kink and halving all segments keeps its error series in ds^2 clean.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    sigma: Vec<f64>,
    /// Widths within a panel are identical to the last bit, which differences of sigma are not.
    widths: Vec<f64>,
}

impl Grid {
    /// `segments` segments distributed over the panels between `kinks` (ascending, inside (0,
    /// 1)) in proportion to their widths, at least one each.
    pub fn new(segments: usize, kinks: &[f64]) -> Self {
        let edges = [&[0.0], kinks, &[1.0]].concat();
        let widths: Vec<f64> = edges.windows(2).map(|w| w[1] - w[0]).collect();
        let mut counts = vec![1_usize; widths.len()];
        for _ in widths.len()..segments {
            // The next segment goes to the panel with the longest segments.
            let width = |panel: usize| widths[panel] / counts[panel] as f64;
            let longest = (0..widths.len()).max_by(|&a, &b| width(a).total_cmp(&width(b)));
            counts[longest.expect("at least one panel")] += 1;
        }
        let mut grid = Grid {
            sigma: vec![0.0],
            widths: Vec::new(),
        };
        for ((start, width), count) in edges.iter().zip(widths).zip(counts) {
            let nodes = (1..=count).map(|i| start + width * i as f64 / count as f64);
            grid.sigma.extend(nodes);
            grid.widths.extend(vec![width / count as f64; count]);
        }
        *grid.sigma.last_mut().expect("at least one node") = 1.0;
        grid
    }

    /// The grid whose nodes are `stations`: made with this number of segments, or with a half,
    /// a quarter ... of it and refined, which differs if there are kinks.
    pub fn through(stations: &[f64], kinks: &[f64]) -> Self {
        let segments = stations.len() - 1;
        let grid = Grid::new(segments, kinks);
        let apart = |grid: &Grid| {
            let pairs = grid.sigma.iter().zip(stations);
            grid.segments() != segments || pairs.into_iter().any(|(a, b)| (a - b).abs() > 1e-9)
        };
        let mut nested = grid.clone();
        let mut halvings = 0;
        while apart(&nested) && segments.is_multiple_of(2 << halvings) {
            halvings += 1;
            nested = Grid::new(segments >> halvings, kinks);
            nested = (0..halvings).fold(nested, |grid, _| grid.refined());
        }
        if apart(&nested) { grid } else { nested }
    }

    /// The same grid with every segment halved.
    pub fn refined(&self) -> Self {
        self.cut(|a, b, _| [a, 0.5 * (a + b)])
    }

    /// The same grid with every segment cut in three.
    pub fn tripled(&self) -> Self {
        self.cut(|a, b, third| [a, a + third, b - third])
    }

    /// The grid with every second node; a kink may then lie inside a segment. `None` unless the
    /// segments are pairs of equal ones.
    pub fn coarsened(&self) -> Option<Self> {
        let pairs = self.widths.chunks(2);
        let equal = |pair: &[f64]| matches!(pair, [a, b] if a == b);
        pairs.clone().all(equal).then(|| Grid {
            sigma: self.sigma.iter().copied().step_by(2).collect(),
            widths: pairs.map(|pair| 2.0 * pair[0]).collect(),
        })
    }

    /// With every segment divided in N: `nodes` gives its first nodes from its ends and the
    /// new width.
    fn cut<const N: usize>(&self, nodes: impl Fn(f64, f64, f64) -> [f64; N]) -> Self {
        let widths = self.widths.iter().map(|width| width / N as f64);
        let segments = self.sigma.windows(2).zip(widths.clone());
        let starts = segments.flat_map(|(ends, width)| nodes(ends[0], ends[1], width));
        Grid {
            sigma: starts.chain([1.0]).collect(),
            widths: widths.flat_map(|width| [width; N]).collect(),
        }
    }

    /// Number of segments of each rod.
    pub fn segments(&self) -> usize {
        self.sigma.len() - 1
    }

    /// Node fractions, base to tip.
    pub fn sigma(&self) -> &[f64] {
        &self.sigma
    }

    /// The node nearest to a fraction of the length.
    pub fn nearest(&self, sigma: f64) -> usize {
        let after = self
            .sigma
            .partition_point(|at| *at < sigma)
            .min(self.segments());
        let before = after.saturating_sub(1);
        match sigma - self.sigma[before] < self.sigma[after] - sigma {
            true => before,
            false => after,
        }
    }

    /// Midpoint of segment `i`.
    pub fn middle(&self, i: usize) -> f64 {
        0.5 * (self.sigma[i] + self.sigma[i + 1])
    }

    /// Width of segment `i` as a fraction of the length.
    pub fn width(&self, i: usize) -> f64 {
        self.widths[i]
    }

    /// Trapezoidal weight of node `i` as a fraction of the length.
    pub fn weight(&self, i: usize) -> f64 {
        let width = |i: usize| self.widths.get(i).copied().unwrap_or(0.0);
        0.5 * (width(i.wrapping_sub(1)) + width(i))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panels_meet_at_the_kinks_and_weights_add_to_one() {
        let kinks = [0.2, 0.25, 0.9];
        let grid = Grid::new(11, &kinks);
        for (grid, segments) in [(grid.refined(), 22), (grid.tripled(), 33), (grid, 11)] {
            assert_eq!(grid.segments(), segments);
            assert!(kinks.iter().all(|kink| grid.sigma().contains(kink)));
            let sum: f64 = (0..=segments).map(|i| grid.weight(i)).sum();
            assert!((sum - 1.0).abs() < 1e-15);
            assert_eq!(grid.refined().coarsened(), Some(grid));
        }
        assert_eq!(Grid::new(11, &kinks).coarsened(), None);
        let [fine, coarse] = [32, 8].map(|segments| Grid::new(segments, &[0.3404]));
        for grid in [fine, coarse.refined().refined()] {
            let through = Grid::through(grid.sigma(), &[0.3404]);
            let pairs = through.sigma().iter().zip(grid.sigma());
            assert!(pairs.map(|(a, b)| (a - b).abs()).all(|off| off < 1e-15));
            assert_eq!(through.segments(), grid.segments());
        }
        // However many kinks there are, every panel has a segment.
        assert_eq!(Grid::new(1, &[0.25, 0.5]).segments(), 3);
    }
}
