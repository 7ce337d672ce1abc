//! Selection of outputs for a few pictures.

use super::Moment;

/// A tip that moves by less than this part of the longest rod counts as hardly moving.
const HARDLY: f64 = 1e-3;

/// Number of moments from which those shown are selected.
const CANDIDATES: usize = 400;

/// The indices of `count` moments that show a motion, or of all if there are
/// no more: the first, the last, and others with the tip far from that of
/// the previous one, such as the turning points of a swing. If the tip hardly
/// moves (`length`: the longest rod), they are at equal intervals.
pub fn stills(moments: &[Moment], count: usize, length: f64) -> Vec<usize> {
    if moments.len() <= count {
        return (0..moments.len()).collect();
    }
    let pairs = moments.windows(2);
    let distance: f64 = pairs.map(|pair| pair[0].tip.distance(pair[1].tip)).sum();
    if distance.is_finite() && distance > HARDLY * length {
        return far_apart(moments, count);
    }
    let (last, gaps) = (moments.len() - 1, count - 1);
    let nearest = |k: usize| (2 * k * last + gaps) / (2 * gaps);
    (0..count).map(nearest).collect()
}

/// The first, the last, and others between, such that the sum of the square roots of the
/// distances between successive tips is largest: turning points, and equal distances between
/// them, as the root is concave. By dynamic programming.
fn far_apart(moments: &[Moment], count: usize) -> Vec<usize> {
    let last = moments.len() - 1;
    let most = moments.len().min(CANDIDATES.max(count));
    let candidates: Vec<usize> = (0..most).map(|k| k * last / (most - 1)).collect();
    let n = candidates.len();
    let gain = |i: usize, j: usize| {
        let [from, to] = [i, j].map(|k| moments[candidates[k]].tip);
        from.distance(to).sqrt()
    };
    // The best sum with k more chosen after the first, the last of them j, and its predecessor.
    let mut best = vec![f64::NEG_INFINITY; n];
    best[0] = 0.0;
    let mut whence = vec![vec![0; n]; count];
    for k in 1..count {
        let mut next = vec![f64::NEG_INFINITY; n];
        for j in k..n {
            for i in k - 1..j {
                let sum = best[i] + gain(i, j);
                if sum > next[j] {
                    (next[j], whence[k][j]) = (sum, i);
                }
            }
        }
        best = next;
    }
    let mut chosen = vec![n - 1];
    for k in (1..count).rev() {
        let before = whence[k][chosen[chosen.len() - 1]];
        chosen.push(before);
    }
    chosen.reverse();
    chosen.into_iter().map(|k| candidates[k]).collect()
}

/// Largest number of shapes of a film, and of nodes of all of them.
const FILM: usize = 401;
const FILM_NODES: usize = 4_000_000;

/// Which of so many outputs, each with so many nodes, a film shows: at equal intervals, including
/// the last.
pub fn film(outputs: usize, nodes: usize) -> Vec<usize> {
    let most = FILM.min(FILM_NODES / nodes.max(1)).max(2);
    let stride = outputs.saturating_sub(1).div_ceil(most - 1).max(1);
    let last = outputs.checked_sub(1);
    let evenly = (0..outputs).step_by(stride);
    let mut chosen: Vec<usize> = evenly.filter(|output| Some(*output) != last).collect();
    chosen.extend(last);
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::Energy;
    use glam::DVec3;

    fn moments(count: usize, tip: impl Fn(f64) -> f64) -> Vec<Moment> {
        let moment = |i| Moment {
            time: i as f64,
            steps: i,
            energy: Energy::default(),
            tip: DVec3::X * tip(i as f64),
            error: None,
        };
        (0..count).map(moment).collect()
    }

    #[test]
    fn a_film_is_even_and_ends_with_the_last_output() {
        assert!(film(0, 10).is_empty());
        assert_eq!(film(1, 10), [0]);
        assert_eq!(film(400, 10).len(), 400);
        assert_eq!(film(401, 10).len(), 401);
        assert_eq!(film(402, 10).len(), 202);
        let long = film(10_002, 10);
        assert!(long.len() <= 401 && *long.last().unwrap() == 10_001);
        assert_eq!(film(50, 4_000_000), [0, 49]);
    }

    #[test]
    fn a_fast_start_is_shown() {
        let chosen = stills(&moments(101, |t| (-t / 5.0).exp()), 8, 1.0);
        assert_eq!((chosen[0], chosen[7]), (0, 100));
        assert!(chosen[6] < 15, "{chosen:?}");
    }

    #[test]
    fn a_swing_is_shown_at_its_turning_points() {
        // Turns every 5 outputs, and decays.
        let swing = |t: f64| (0.1 * std::f64::consts::TAU * t).cos() * (-t / 40.0).exp();
        let chosen = stills(&moments(1001, swing), 8, 1.0);
        assert_eq!((chosen[0], chosen[7]), (0, 1000));
        let tips: Vec<f64> = chosen.iter().map(|&k| swing(k as f64)).collect();
        for pair in tips[..7].windows(2) {
            assert!(pair[0] * pair[1] < 0.0, "{chosen:?}: {tips:?}");
        }
    }

    #[test]
    fn what_hardly_moves_is_shown_at_equal_times() {
        for still in [|_: f64| 0.3, |t: f64| 1e-9 * t, |_: f64| f64::NAN] {
            let chosen = stills(&moments(71, still), 8, 1.0);
            assert_eq!(chosen, [0, 10, 20, 30, 40, 50, 60, 70]);
        }
    }

    #[test]
    fn none_is_shown_twice() {
        let jump = |at: f64| move |t: f64| if t < at { 0.0 } else { 1.0 };
        for at in [0.5, 7.5, 11.5] {
            let chosen = stills(&moments(13, jump(at)), 8, 1.0);
            assert_eq!((chosen[0], chosen[7]), (0, 12), "{chosen:?}");
            assert!(chosen.windows(2).all(|w| w[0] < w[1]), "{chosen:?}");
        }
    }

    #[test]
    fn few_are_all_shown() {
        assert_eq!(stills(&moments(3, |t| t), 8, 1.0), [0, 1, 2]);
    }
}
