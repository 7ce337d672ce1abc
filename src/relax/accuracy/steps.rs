//! The steps of the integration along the veins in defect correction, and their error.

/// The part of the integration error that remains with halved steps, or less: with order 8 it
/// is a 256th.
const HALVED: f64 = 1.0 / 16.0;

/// The steps of the integration from a node to a midpoint.
pub struct Steps {
    pub count: usize,
    /// Whether they are half of those of the round before.
    pub halved: bool,
    /// Bound on the error of the integration.
    pub error: f64,
    /// Whether the leaf is on a single grid.
    alone: bool,
}

impl Steps {
    pub fn new(count: usize, alone: bool) -> Self {
        Steps {
            count,
            halved: false,
            error: f64::INFINITY,
            alone,
        }
    }

    /// With the estimated error of a round: after a round with longer steps it includes their
    /// error, and so bounds that of the halved steps.
    pub fn measure(&mut self, largest: f64) {
        self.error = match (self.halved, self.alone) {
            (true, true) => HALVED * largest,
            (true, false) => 0.0,
            (false, true) => self.error,
            (false, false) => f64::INFINITY,
        };
    }

    /// Halves the steps if the next round, whose error is `expected`, may be the last; on a
    /// single grid only if their own error is not known to be small. For small tolerances, with
    /// several grids, the ends of more steps make better stations.
    pub fn choose(&mut self, expected: f64, enough: f64) {
        let unknown = !self.alone || self.error > 0.5 * enough;
        self.halved = unknown && expected <= enough;
        if self.halved {
            self.count *= 2;
        }
    }
}
