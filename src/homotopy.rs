//! A path on which a part of the loading, or of another change, grows from 0 to 1: in steps that
//! become longer where they succeed, and shorter where they fail. Slow loading, holders that are moved,
//! dead moments, a leaf that follows its scenario and shooting from arcs are such paths; each says how a
//! step is made, and by how much longer the next may be.

/// A step longer than the shortest by no more than this factor counts as the shortest.
const SHORTEST_STEP_TOLERANCE: f64 = 1.01;

/// The lengths of the steps of a path, as parts of it, and the factors on them.
#[derive(Clone, Copy, Debug)]
pub struct StepSizes {
    /// The first step, and the one after a path was begun again.
    pub first: f64,
    /// The shortest step: where the path ends, or changes, is known to this.
    pub shortest: f64,
    /// The longest step.
    pub longest: f64,
    /// The largest factor on a step after one that was made.
    pub growth: f64,
    /// The factor on a step after one that failed.
    pub failure: f64,
}

/// A step that is to be made.
#[derive(Clone, Copy, Debug)]
pub struct PathStep {
    /// The part of the path that is reached.
    pub from: f64,
    /// The part that the step leads to.
    pub to: f64,
    /// Whether it cannot be shorter.
    pub is_shortest: bool,
}

/// What came of a step.
#[derive(Clone, Copy, Debug)]
pub enum StepEnd<E> {
    /// It was made, and the next may be longer by this factor.
    Made {
        /// The factor.
        growth: f64,
    },
    /// It was made beyond a place where the path had to be begun again.
    Restarted,
    /// It failed, and should be shorter; if it cannot be, the path ends for this reason.
    TooLong(E),
    /// It failed, and should be made again as it was.
    Again,
    /// The path ends here.
    Ended(E),
}

impl PathStep {
    /// Its length.
    pub fn length(&self) -> f64 {
        self.to - self.from
    }
}

impl StepSizes {
    /// Follows a path from 0 to 1.
    ///
    /// # Errors
    /// Why it ended before.
    pub fn follow<E>(self, mut make_step: impl FnMut(&PathStep) -> StepEnd<E>) -> Result<(), E> {
        let mut path = Homotopy {
            lambda: 0.0,
            step: self.first,
            sizes: self,
        };
        while path.lambda < 1.0 {
            let step = path.next();
            match make_step(&step) {
                StepEnd::Made { growth } => path.advance(step, growth * step.length()),
                StepEnd::Restarted => path.advance(step, self.first),
                StepEnd::TooLong(reason) if step.is_shortest => return Err(reason),
                StepEnd::TooLong(_) => {
                    path.step = (self.failure * step.length()).max(self.shortest);
                }
                StepEnd::Again => {}
                StepEnd::Ended(reason) => return Err(reason),
            }
        }
        Ok(())
    }
}

/// How far along a path, and how long the next step is.
struct Homotopy {
    lambda: f64,
    step: f64,
    sizes: StepSizes,
}

impl Homotopy {
    /// The next step. What would remain to the end is not left to a further step if it is less than
    /// half of the shortest.
    fn next(&self) -> PathStep {
        let shortest = self.sizes.shortest;
        let to = match self.lambda + self.step {
            next if next < 1.0 - 0.5 * shortest => next,
            _ => 1.0,
        };
        PathStep {
            from: self.lambda,
            to,
            is_shortest: self.step <= SHORTEST_STEP_TOLERANCE * shortest,
        }
    }

    /// Behind a step; the next has this length, within the limits.
    fn advance(&mut self, step: PathStep, next: f64) {
        self.lambda = step.to;
        self.step = next.clamp(self.sizes.shortest, self.sizes.longest);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ten tenths are one, whatever the rounding of their sum.
    #[test]
    fn equal_steps_end_at_one() {
        for count in 1..1000 {
            let sizes = StepSizes {
                first: 1.0 / f64::from(count),
                shortest: 1e-6,
                longest: 1.0,
                growth: 1.0,
                failure: 0.5,
            };
            let (mut steps, mut reached) = (0, 0.0);
            let end: Result<(), ()> = sizes.follow(|step| {
                (steps, reached) = (steps + 1, step.to);
                StepEnd::Made { growth: 1.0 }
            });
            assert_eq!((end, steps, reached), (Ok(()), count, 1.0));
        }
    }

    /// Beyond 0.6 no step longer than 0.01 succeeds, beyond 0.9 none.
    #[test]
    fn steps_grow_and_become_shorter() {
        let sizes = StepSizes {
            first: 0.5,
            shortest: 1.0 / 512.0,
            longest: 0.5,
            growth: 2.0,
            failure: 0.5,
        };
        let (mut parts, mut failures) = (Vec::new(), 0);
        let end = sizes.follow(|step| {
            if step.to <= 0.6 || step.to <= 0.9 && step.length() <= 0.01 {
                parts.push(step.to);
                return StepEnd::Made {
                    growth: sizes.growth,
                };
            }
            failures += 1;
            StepEnd::TooLong(step.from)
        });
        let reached = end.unwrap_err();
        assert_eq!((parts[0], parts.last()), (0.5, Some(&reached)));
        assert!(reached > 0.9 - 1.01 / 512.0);
        assert!(parts.is_sorted() && (40..80).contains(&parts.len()));
        assert!(failures < 60, "{failures}");
    }
}
