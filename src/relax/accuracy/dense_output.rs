//! A leaf between two stations where it is known: the equilibrium equations integrated from both.

use crate::largest::larger;
use crate::leaf::{Flow, RodFields, Slice};
use glam::DVec3;

/// Longest step of the integration.
const STEP: f64 = 1.0 / 64.0;

/// Safety factor on the error estimate.
const SAFETY: f64 = 2.0;

/// All rods at one sigma.
pub type Section = Vec<RodFields>;

/// A leaf at rest at `points` between two stations, given the sections there, and the largest
/// error of a position in addition to those at the stations: the mean of what is integrated from
/// either side, with weights that fall linearly to zero at the other. `None` where positions
/// integrated from one station miss the other by more than the distance of the two.
///
/// Let a and b be the vectors by which the two miss. Errors that grow linearly from either
/// station have a + b = 0 if the mean is free of them; otherwise its error is at most |a + b|/4.
pub fn integrated_between(
    flow: &mut Flow,
    kinks: &[f64],
    [(from, begin), (to, end)]: [(f64, &Section); 2],
    points: &[f64],
) -> Option<(Vec<Section>, f64)> {
    let forward = points.iter().copied().chain([to]);
    let mut before = integrated(flow, kinks, (from, begin), forward);
    let backward = points.iter().rev().copied().chain([from]);
    let mut behind = integrated(flow, kinks, (to, end), backward);
    let (there, here) = (before.pop()?, behind.pop()?);
    let mut error = 0.0_f64;
    for j in 0..begin.len() {
        let (a, b) = (there[j].x - end[j].x, here[j].x - begin[j].x);
        // Also where the integration yields no numbers.
        let near = |miss: DVec3| miss.is_finite() && miss.length() <= to - from;
        if !near(a) || !near(b) {
            return None;
        }
        error = larger(error, 0.25 * (a + b).length());
    }
    behind.reverse();
    let sections = before.iter().zip(&behind).zip(points);
    let sections = sections.map(|((a, b), at)| mean([a, b], (at - from) / (to - from)));
    Some((sections.collect(), SAFETY * error))
}

/// The mean of two sections, the second with this weight.
pub fn mean([a, b]: [&Section; 2], weight: f64) -> Section {
    let rod = |(a, b): (&RodFields, &RodFields)| RodFields {
        x: a.x.lerp(b.x, weight),
        q: a.q.lerp(b.q, weight),
        n: a.n.lerp(b.n, weight),
        m: a.m.lerp(b.m, weight),
    };
    a.iter().zip(b).map(rod).collect()
}

/// The sections at `points`, one after the other, integrated from one section; no step reaches
/// across a kink.
fn integrated(
    flow: &mut Flow,
    kinks: &[f64],
    (mut at, begin): (f64, &Section),
    points: impl Iterator<Item = f64>,
) -> Vec<Section> {
    let mut section = begin.clone();
    let mut integrate_to = |point: f64| {
        let inside = |kink: &&f64| (**kink - at) * (**kink - point) < 0.0;
        let mut stops: Vec<f64> = kinks.iter().filter(inside).copied().collect();
        if point < at {
            stops.reverse();
        }
        for stop in stops.into_iter().chain([point]) {
            let steps = ((stop - at).abs() / STEP).ceil().max(1.0);
            let mut after = vec![Slice::default(); steps as usize];
            flow.integrate(|j| section[j], [at, stop], &mut after);
            if let Some(last) = after.last() {
                section = (0..section.len()).map(|j| last.rod(j)).collect();
            }
            at = stop;
        }
        section.clone()
    };
    points.map(&mut integrate_to).collect()
}
