//! The text report of all equilibria of a leaf.

use crate::report::numbers::power_of_ten;
use crate::study::{All, Found};

use super::Reported;
use super::numbers::{seconds, veins};
use super::table::{Lines, labelled};
use super::words::stable_or_index;

impl Reported for All {
    fn heading(&self) -> String {
        let leaf = self.found.first();
        let veins = leaf.map_or("a leaf".into(), |found| veins(&found.equilibrium));
        format!("{}: {veins}, all shapes", self.scenario)
    }

    /// The equilibria, lowest energy first.
    fn lines(&self) -> Lines {
        let found = self.found.iter().enumerate();
        let mut lines = labelled("found", found.map(|(number, found)| line(number, found)));
        let stable = |found: &&Found| found.equilibrium.stable() == Some(true);
        let stable = self.found.iter().filter(stable).count();
        let others = self.found.len() - stable;
        let failed = match self.failed {
            0 => String::new(),
            failed => format!(", {failed} of them without coming to rest"),
        };
        let (starts, time) = (self.starts, seconds(self.wall_seconds));
        let work = format!(
            "{stable} stable and {others} other equilibria from {starts} starts{failed}, in {time}"
        );
        lines.push(("work", work));
        lines
    }

    fn remarks(&self) -> Lines {
        let more = "there may be more: no number of starts proves that these are all";
        let remark = labelled("remark", self.remark.clone());
        [remark, labelled("remark", Some(more.into()))].concat()
    }
}

fn line(number: usize, found: &Found) -> String {
    let leaf = &found.equilibrium;
    let index = leaf.stability.negative_eigenvalues;
    let stability = index.map_or("of unknown stability".into(), stable_or_index);
    let tip = match &leaf.tips[..] {
        [tip] => format!(", tip ({:.6}, {:.6}, {:.6})", tip.x, tip.y, tip.z),
        _ => String::new(),
    };
    let within = match leaf.accuracy.error_estimate {
        Some(error) => format!(", within {}", power_of_ten(error)),
        None => String::new(),
    };
    let plain = if found.plain {
        ", the plain one among them"
    } else {
        ""
    };
    let starts = match found.starts {
        1 => "1 start".into(),
        starts => format!("{starts} starts"),
    };
    let (number, energy) = (number + 1, leaf.energy.unwrap_or(f64::NAN));
    format!("{number:>2}. energy {energy:.10}: {stability}{tip}{within} ({starts}{plain})")
}
