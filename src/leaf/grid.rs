//! Where the nodes lie along the rods.

/// Nodes as fractions sigma = s/L of every rod's length, from 0 to 1, the same
/// for all rods since the coupling joins equal fractions.
///
/// The interval is cut into panels wherever a profile has a kink, and every
/// panel into equal segments, so that the midpoint rule never reaches across a
/// kink and halving all segments keeps its error series in ds^2 clean.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    sigma: Vec<f64>,
    /// Those of one panel to the last bit alike, as differences of sigma are not.
    widths: Vec<f64>,
}

impl Grid {
    /// `segments` segments shared out among the panels between `kinks`
    /// (ascending, inside (0, 1)) by their widths, at least one each.
    pub fn new(segments: usize, kinks: &[f64]) -> Self {
        let edges: Vec<f64> = std::iter::once(0.0)
            .chain(kinks.iter().copied())
            .chain(std::iter::once(1.0))
            .collect();
        let widths: Vec<f64> = edges.windows(2).map(|w| w[1] - w[0]).collect();
        let mut counts = vec![1_usize; widths.len()];
        for _ in widths.len()..segments {
            // The next segment goes where the segments are longest.
            let longest = (0..widths.len())
                .max_by(|&a, &b| {
                    (widths[a] / counts[a] as f64).total_cmp(&(widths[b] / counts[b] as f64))
                })
                .expect("at least one panel");
            counts[longest] += 1;
        }
        let (mut sigma, mut each) = (vec![0.0], Vec::new());
        for ((start, width), count) in edges.iter().zip(&widths).zip(&counts) {
            sigma.extend((1..=*count).map(|i| start + width * i as f64 / *count as f64));
            each.extend(std::iter::repeat_n(width / *count as f64, *count));
        }
        *sigma.last_mut().expect("at least one node") = 1.0;
        Grid {
            sigma,
            widths: each,
        }
    }

    /// The same grid with every segment halved.
    pub fn refined(&self) -> Self {
        let mut sigma = Vec::with_capacity(2 * self.sigma.len() - 1);
        for pair in self.sigma.windows(2) {
            sigma.extend([pair[0], 0.5 * (pair[0] + pair[1])]);
        }
        sigma.push(1.0);
        let widths = self.widths.iter().flat_map(|width| [0.5 * width; 2]);
        Grid {
            sigma,
            widths: widths.collect(),
        }
    }

    /// The same grid with every segment cut in three.
    pub fn tripled(&self) -> Self {
        let mut sigma = Vec::with_capacity(3 * self.sigma.len() - 2);
        for (pair, width) in self.sigma.windows(2).zip(&self.widths) {
            let third = width / 3.0;
            sigma.extend([pair[0], pair[0] + third, pair[1] - third]);
        }
        sigma.push(1.0);
        let widths = self.widths.iter().flat_map(|width| [width / 3.0; 3]);
        Grid {
            sigma,
            widths: widths.collect(),
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
        let left = if i > 0 { self.width(i - 1) } else { 0.0 };
        let right = if i < self.segments() {
            self.width(i)
        } else {
            0.0
        };
        0.5 * (left + right)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panels_meet_at_the_kinks() {
        let grid = Grid::new(8, &[0.3]);
        assert_eq!(grid.segments(), 8);
        assert!(grid.sigma().contains(&0.3));
        assert!(grid.refined().sigma().contains(&0.3));
        assert_eq!(grid.refined().segments(), 16);
    }

    #[test]
    fn weights_add_to_one() {
        let grid = Grid::new(11, &[0.2, 0.25, 0.9]);
        let sum: f64 = (0..=11).map(|i| grid.weight(i)).sum();
        assert!((sum - 1.0).abs() < 1e-15);
    }

    #[test]
    fn more_kinks_than_segments_still_gives_one_segment_a_panel() {
        assert_eq!(Grid::new(1, &[0.25, 0.5]).segments(), 3);
    }
}
