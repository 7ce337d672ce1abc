//! A path on which a part of the loading, or of another change, grows from 0 to 1: in steps that
//! become longer where they succeed, and shorter where they fail.

/// A step longer than the shortest by no more than this factor counts as the shortest.
const SHORTEST_STEP_TOLERANCE: f64 = 1.01;

/// How far along its path a change is, and its next step.
#[derive(Clone, Copy, Debug)]
pub struct Homotopy {
    /// The part that is reached.
    pub lambda: f64,
    step: f64,
    shortest: f64,
    longest: f64,
}

impl Homotopy {
    /// The beginning of a path, with the length of the first step and the limits of all others.
    pub fn new(first: f64, [shortest, longest]: [f64; 2]) -> Self {
        Homotopy {
            lambda: 0.0,
            step: first,
            shortest,
            longest,
        }
    }

    /// The part after the next step. What would remain to the end is not left to a further step if it
    /// is less than half of the shortest.
    pub fn next_lambda(&self) -> f64 {
        match self.lambda + self.step {
            next if next < 1.0 - 0.5 * self.shortest => next,
            _ => 1.0,
        }
    }

    /// The length of the next step.
    pub fn next_step_length(&self) -> f64 {
        self.next_lambda() - self.lambda
    }

    pub fn is_shortest(&self) -> bool {
        self.step <= SHORTEST_STEP_TOLERANCE * self.shortest
    }

    /// Makes the next step; the one after it has this length, within the limits.
    pub fn advance(&mut self, then: f64) {
        self.lambda = self.next_lambda();
        self.step = then.clamp(self.shortest, self.longest);
    }

    /// Shortens the next step by this factor; false if it is the shortest already.
    pub fn shorten(&mut self, factor: f64) -> bool {
        if self.is_shortest() {
            return false;
        }
        self.step = (factor * self.next_step_length()).max(self.shortest);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ten tenths are one, whatever the rounding of their sum.
    #[test]
    fn equal_steps_end_at_one() {
        for count in 1..1000 {
            let mut path = Homotopy::new(1.0 / f64::from(count), [1e-6, 1.0]);
            let mut steps = 0;
            while path.lambda < 1.0 {
                path.advance(path.next_step_length());
                steps += 1;
            }
            assert_eq!((steps, path.lambda), (count, 1.0));
        }
    }

    /// Beyond 0.6 no step longer than 0.01 succeeds, beyond 0.9 none.
    #[test]
    fn steps_grow_and_become_shorter() {
        let mut path = Homotopy::new(1.0, [1.0 / 512.0, 0.5]);
        let (mut parts, mut failures) = (Vec::new(), 0);
        loop {
            let next = path.next_lambda();
            if next <= 0.6 || next <= 0.9 && path.next_step_length() <= 0.01 {
                path.advance(2.0 * path.next_step_length());
                parts.push(path.lambda);
            } else if path.shorten(0.5) {
                failures += 1;
            } else {
                break;
            }
        }
        assert_eq!(parts[0], 0.5);
        assert!(path.is_shortest() && path.lambda > 0.9 - 1.01 / 512.0);
        assert!(parts.is_sorted() && (40..80).contains(&parts.len()));
        assert!(failures < 60, "{failures}");
    }
}
