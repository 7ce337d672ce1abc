//! Which outputs to show in a few pictures.

use super::Moment;

/// A tip that moves by less than this part of the longest rod hardly moves.
const HARDLY: f64 = 1e-3;

/// The numbers of `count` moments that show a motion, or of all if there are
/// no more: the first, the last, and others between which the tip goes equal
/// ways, so that fast motion is shown by as many as slow. If the tip hardly
/// moves (`length`: the longest rod), equal times are between them.
pub fn stills(moments: &[Moment], count: usize, length: f64) -> Vec<usize> {
    if moments.len() <= count {
        return (0..moments.len()).collect();
    }
    let mut way = 0.0;
    let mut ways = vec![0.0];
    for pair in moments.windows(2) {
        way += pair[0].tip.distance(pair[1].tip);
        ways.push(way);
    }
    if !(way.is_finite() && way > HARDLY * length) {
        ways = moments.iter().map(|moment| moment.time).collect();
    }
    let (first, last) = (ways[0], ways[moments.len() - 1]);
    let wanted = |k: usize| first + (last - first) * k as f64 / (count - 1) as f64;
    let mut chosen: Vec<usize> = (0..count).map(|k| nearest(&ways, wanted(k))).collect();
    chosen[0] = 0;
    chosen[count - 1] = moments.len() - 1;
    // Each only once: a jump from one output to the next spans several ways.
    for k in 1..count {
        chosen[k] = chosen[k].max(chosen[k - 1] + 1);
    }
    for k in (0..count).rev() {
        chosen[k] = chosen[k].min(moments.len() - count + k);
    }
    chosen
}

/// Of rising numbers, the index of the one nearest to `wanted`.
fn nearest(numbers: &[f64], wanted: f64) -> usize {
    let after = numbers.partition_point(|&number| number < wanted);
    match after {
        0 => 0,
        _ if after == numbers.len() => after - 1,
        _ if wanted - numbers[after - 1] < numbers[after] - wanted => after - 1,
        _ => after,
    }
}

/// Shapes of a film, and nodes of all of them, at most.
const FILM: usize = 401;
const FILM_NODES: usize = 4_000_000;

/// Which of so many outputs, each of so many nodes, a film shows: evenly many, the last
/// among them.
pub fn film(outputs: usize, nodes: usize) -> Vec<usize> {
    let most = FILM.min(FILM_NODES / nodes.max(1)).max(2);
    let stride = outputs.div_ceil(most - 1).max(1);
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
        };
        (0..count).map(moment).collect()
    }

    #[test]
    fn a_film_is_even_and_ends_with_the_last_output() {
        assert!(film(0, 10).is_empty());
        assert_eq!(film(1, 10), [0]);
        assert_eq!(film(400, 10).len(), 400);
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
