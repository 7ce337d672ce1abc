//! Measurements of other programs, next to ours.

use serde::Serialize;

use super::timing::Spread;

/// First words of outcomes that are equilibria.
const AT_REST: [&str; 2] = ["converged", "at-rest"];

/// First word of the outcome of a measurement that is not a search for an equilibrium.
const COMPLETED: &str = "completed";

/// One measurement of another program.
#[derive(Clone, Debug, PartialEq)]
pub struct PeerRow {
    /// The program.
    pub program: String,
    /// Name of the scenario.
    pub scenario: String,
    /// Veins of the leaf.
    pub rods: usize,
    /// The setting for its accuracy; other settings follow after a blank.
    pub knob: String,
    /// The time it took.
    pub seconds: f64,
    /// Largest distance of its positions from the solution, in units of length.
    pub error: Option<f64>,
    /// How it ended.
    pub outcome: String,
}

/// A peer's measurements at one setting.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Peer {
    /// The program, with its other settings.
    #[serde(rename = "program")]
    pub name: String,
    /// The value of its accuracy setting.
    pub knob: String,
    /// Times of all rows with these settings.
    #[serde(flatten)]
    pub seconds: Spread,
    /// The largest error of these rows, relative to the longest rod; `None`
    /// if it did not come to rest.
    pub true_error: Option<f64>,
    /// How it ended.
    pub outcome: String,
    /// Whether it is on the Pareto front.
    pub pareto: bool,
    /// Its time over that of the default contender at an error at most as large.
    pub ratio: Option<f64>,
}

impl Peer {
    /// Seconds and error, if it came to rest.
    pub fn point(&self) -> Option<(f64, f64)> {
        Some((self.seconds.median, self.true_error?))
    }
}

/// The rows for a leaf, rows with equal settings combined, and remarks on
/// the others. Errors become relative to the longest rod.
pub fn about(
    rows: &[PeerRow],
    scenario: &str,
    rods: usize,
    longest: f64,
) -> (Vec<Peer>, Vec<String>) {
    let mut peers: Vec<Peer> = Vec::new();
    let mut times: Vec<Vec<f64>> = Vec::new();
    let (mut other, mut silent) = (0, 0);
    for row in rows {
        if row.scenario != scenario || row.rods != rods {
            other += 1;
            continue;
        }
        let word = row.outcome.split_whitespace().next().unwrap_or_default();
        let at_rest = AT_REST.contains(&word);
        if row.error.is_none() && (at_rest || word == COMPLETED) {
            silent += 1;
            continue;
        }
        let true_error = row.error.filter(|_| at_rest).map(|error| error / longest);
        let (knob, settings) = row.knob.split_once(' ').unwrap_or((&row.knob, ""));
        let name = format!("{} {settings}", row.program).trim_end().to_string();
        let same =
            |peer: &Peer| peer.name == name && peer.knob == knob && peer.outcome == row.outcome;
        let same = peers.iter().position(same);
        let same = same.unwrap_or_else(|| {
            peers.push(Peer {
                name,
                knob: knob.into(),
                seconds: Spread::default(),
                true_error,
                outcome: row.outcome.clone(),
                pareto: false,
                ratio: None,
            });
            times.push(Vec::new());
            times.len() - 1
        });
        times[same].push(row.seconds);
        if true_error > peers[same].true_error {
            peers[same].true_error = true_error;
        }
    }
    for (peer, seconds) in peers.iter_mut().zip(&mut times) {
        seconds.sort_by(f64::total_cmp);
        peer.seconds = Spread::of(seconds).unwrap_or_default();
    }
    let rows = |count: usize| match count {
        1 => "1 row of --peers is".to_string(),
        count => format!("{count} rows of --peers are"),
    };
    let mut remarks = Vec::new();
    if other > 0 {
        remarks.push(format!("{} about another leaf, and left out", rows(other)));
    }
    if silent > 0 {
        let what = "without the error of a leaf at rest, and left out";
        remarks.push(format!("{} {what}", rows(silent)));
    }
    (peers, remarks)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// program, scenario, rods, knob, seconds, error, outcome.
    fn row(text: &str) -> PeerRow {
        let cell: Vec<&str> = text.split(',').collect();
        PeerRow {
            program: cell[0].into(),
            scenario: cell[1].into(),
            rods: cell[2].parse().unwrap(),
            knob: cell[3].into(),
            seconds: cell[4].parse().unwrap(),
            error: cell[5].parse().ok(),
            outcome: cell[6].into(),
        }
    }

    #[test]
    fn equal_rows_are_taken_together_and_others_counted() {
        let rows = [
            "a,leaf,5,n=10,3,4e-3,converged",
            "a,leaf,5,n=10,1,4e-3,converged",
            "a,leaf,5,n=10,2,4e-3,converged",
            "a,leaf,5,n=10 own-law,2,6e-3,at-rest",
            "a,leaf,5,n=20,2,,not-converged newton",
            "a,leaf,5,n=30,2,,converged",
            "a,leaf,5,n=30 steps=9,2,,completed",
            "a,leaf,7,n=10,2,1e-3,converged",
            "a,tree,5,n=10,2,1e-3,converged",
            "a,tree,5,n=20,2,1e-3,converged",
        ]
        .map(row);
        let (peers, remarks) = about(&rows, "leaf", 5, 2.0);
        let names = peers.iter().map(|peer| (&peer.name[..], &peer.knob[..]));
        let names: Vec<(&str, &str)> = names.collect();
        assert_eq!(names, [("a", "n=10"), ("a own-law", "n=10"), ("a", "n=20")]);
        assert_eq!((peers[0].seconds.median, peers[0].seconds.runs), (2.0, 3));
        assert_eq!(peers[0].true_error, Some(2e-3));
        assert_eq!(peers[2].true_error, None);
        let wanted = [
            "3 rows of --peers are about another leaf, and left out",
            "2 rows of --peers are without the error of a leaf at rest, and left out",
        ];
        assert_eq!(remarks, wanted);
    }
}
