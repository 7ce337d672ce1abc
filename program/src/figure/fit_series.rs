//! The results of experiments as series along the column that varies.

use std::collections::HashMap;

use leafdyn::study::{Fit, FitResidual, Keys};

/// Fewest experiments of a series among others.
const FEWEST: usize = 4;
/// Experiments are in line up to this part of their distance.
const IN_LINE: f64 = 1e-6;

/// Results of one kind, drawn in one panel.
pub struct Results<'f> {
    /// As in the data: `tip_x`.
    pub kind: &'f str,
    /// The number of the scenario along which the panel has them; `None`: the numbers of the
    /// experiments.
    pub along: Option<&'f Keys>,
    /// Series along it, each with its values in ascending order.
    pub series: Vec<Vec<(f64, &'f FitResidual)>>,
}

impl<'f> Results<'f> {
    pub fn all(&self) -> impl Iterator<Item = (f64, &'f FitResidual)> {
        self.series.iter().flatten().copied()
    }
}

type Settings = [(Keys, f64)];

/// The results of all experiments by their kinds. Those of experiments that differ along a line, as
/// one column varies or several together, are a series; those of others keep their numbers.
pub fn results(fit: &Fit) -> Vec<Results<'_>> {
    let leaves = fit.leaves.iter();
    let settings: HashMap<usize, &Settings> = leaves
        .map(|(_, leaf)| (leaf.number, &leaf.settings[..]))
        .collect();
    let mut kinds: Vec<(&str, Vec<&FitResidual>)> = Vec::new();
    for result in fit.residuals.iter().filter(|it| it.rod.is_none()) {
        match kinds.iter_mut().find(|(kind, _)| *kind == result.what) {
            Some((_, of)) => of.push(result),
            None => kinds.push((&result.what, vec![result])),
        }
    }
    let mut all = Vec::new();
    for (kind, of) in kinds {
        let first = all.len();
        let own: Vec<&Settings> = (of.iter())
            .map(|it| settings.get(&it.number).copied().unwrap_or_default())
            .collect();
        let mut numbered = Vec::new();
        let mut from = 0;
        while from < of.len() {
            let whole = (from == 0).then(|| varied(&own)).flatten();
            let found = match whole {
                Some(key) => Some((of.len(), key)),
                None => (from + FEWEST..=of.len())
                    .map_while(|to| Some((to, varied(&own[from..to])?)))
                    .last(),
            };
            let Some((to, key)) = found else {
                numbered.push((of[from].number as f64, of[from]));
                from += 1;
                continue;
            };
            let keys = &own[from][key].0;
            let mut series: Vec<_> = (from..to).map(|k| (own[k][key].1, of[k])).collect();
            series.sort_by(|a, b| a.0.total_cmp(&b.0));
            let along = Some(keys);
            let mut of_kind = all[first..].iter_mut();
            match of_kind.find(|it: &&mut Results| it.along == along) {
                Some(same) => same.series.push(series),
                None => all.push(Results {
                    kind,
                    along,
                    series: vec![series],
                }),
            }
            from = to;
        }
        if !numbered.is_empty() {
            all.push(Results {
                kind,
                along: None,
                series: vec![numbered],
            });
        }
    }
    all
}

/// Which of their numbers varies most, if the experiments differ along a line.
fn varied(settings: &[&Settings]) -> Option<usize> {
    let first = settings.first()?;
    let same = |it: &&Settings| {
        it.iter()
            .map(|(keys, _)| keys)
            .eq(first.iter().map(|(keys, _)| keys))
    };
    if !settings.iter().all(same) {
        return None;
    }
    let sizes: Vec<f64> = (0..first.len())
        .map(|k| {
            settings
                .iter()
                .fold(0.0, |most: f64, it| most.max(it[k].1.abs()))
        })
        .collect();
    let from_first = |it: &&Settings| -> Vec<f64> {
        let each = it.iter().zip(first.iter()).zip(&sizes);
        each.map(|((a, b), size)| if *size > 0.0 { (a.1 - b.1) / size } else { 0.0 })
            .collect()
    };
    let steps: Vec<Vec<f64>> = settings.iter().map(from_first).collect();
    let dot = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
    let longest = steps
        .iter()
        .max_by(|a, b| dot(a, a).total_cmp(&dot(b, b)))?;
    let square = dot(longest, longest);
    if square.is_nan() || square <= 0.0 {
        return None;
    }
    let in_line = |step: &Vec<f64>| {
        let part = dot(step, longest) / square;
        let off = step
            .iter()
            .zip(longest)
            .map(|(a, b)| (a - part * b).powi(2));
        off.sum::<f64>() <= IN_LINE * IN_LINE * square
    };
    if !steps.iter().all(in_line) {
        return None;
    }
    // The first of those that vary alike.
    (0..longest.len()).reduce(|best, k| {
        match longest[k].abs() > (1.0 + 1e-9) * longest[best].abs() {
            true => k,
            false => best,
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(keys: [&str; 2], values: &[[f64; 2]]) -> Vec<Vec<(Keys, f64)>> {
        let row = |values: &[f64; 2]| {
            let each = keys.iter().zip(values);
            each.map(|(key, value)| (key.parse().unwrap(), *value))
                .collect()
        };
        values.iter().map(row).collect()
    }

    #[test]
    fn experiments_in_line_vary_by_one_number() {
        let of = |values: &[[f64; 2]]| {
            let rows = rows(["load.tip_force[0]", "load.tip_force[2]"], values);
            varied(&rows.iter().map(Vec::as_slice).collect::<Vec<_>>())
        };
        assert_eq!(of(&[[0.0, 1.0], [0.0, 2.0], [0.0, 5.0]]), Some(1));
        // Two that vary together, one more than the other.
        assert_eq!(of(&[[1.0, 1.0], [2.0, 1.1], [3.0, 1.2]]), Some(0));
        assert_eq!(of(&[[-1.0, 1.0], [-2.0, 2.0]]), Some(0));
        assert_eq!(of(&[[0.0, 1.0], [0.0, 2.0], [1.0, 2.0]]), None);
        assert_eq!(of(&[[1.0, 1.0], [1.0, 1.0]]), None);
        assert_eq!(of(&[]), None);
    }
}
