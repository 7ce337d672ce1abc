//! All equilibria of a leaf, as text.

use crate::report::Reported;
use crate::report::numbers::{
    as_accurate, bound_of_positions, counted, decimals, in_unit, point, seconds, veins,
};
use crate::report::table::{Lines, labelled};
use crate::report::words::stable_or_index;
use leafdyn::scenario::Units;
use leafdyn::scenario::units::{ENERGY, LENGTH};
use leafdyn::study::{Equilibria, Found};

impl Reported for Equilibria {
    fn heading(&self) -> String {
        let leaf = self.found.first();
        let veins = leaf.map_or("a leaf".into(), |found| veins(&found.equilibrium));
        format!("{}: {veins}, all shapes", self.scenario)
    }

    /// The equilibria, lowest energy first.
    fn lines(&self, units: &Units) -> Lines {
        let found = self.found.iter().enumerate();
        let mut lines = labelled(
            "found",
            found.map(|(number, found)| equilibrium_line(number, found, units)),
        );
        let stable = |found: &&Found| found.equilibrium.stable() == Some(true);
        let stable = self.found.iter().filter(stable).count();
        let others = self.found.len() - stable;
        let failed = match self.failed {
            0 => String::new(),
            failed => format!(", {failed} of them without coming to rest"),
        };
        let starts = self.starts;
        let count =
            format!("{stable} stable and {others} other equilibria from {starts} starts{failed}");
        lines.push(("starts", count));
        lines
    }

    fn work(&self) -> Option<String> {
        Some(format!("{} in all", seconds(self.wall_seconds)))
    }

    fn remarks(&self) -> Lines {
        let more = "there may be more: no number of starts proves that these are all";
        let remark = labelled("remark", self.remark.clone());
        [remark, labelled("remark", Some(more.into()))].concat()
    }
}

fn equilibrium_line(number: usize, found: &Found, units: &Units) -> String {
    let leaf = &found.equilibrium;
    let index = leaf.stability.negative_eigenvalues;
    let stability = index.map_or("of unknown stability".into(), stable_or_index);
    let tip = match &leaf.tips[..] {
        [tip] => {
            let tip = point(tip.to_array(), decimals(leaf));
            format!(", tip {}", in_unit(tip, units, LENGTH))
        }
        _ => String::new(),
    };
    let within = match leaf.accuracy.error_estimate {
        Some(error) => format!(", within {}", bound_of_positions(error, units)),
        None => String::new(),
    };
    let plain = if found.plain {
        ", the plain one among them"
    } else {
        ""
    };
    let starts = counted(found.starts, "start", "starts");
    let (number, energy) = (number + 1, leaf.energy.unwrap_or(f64::NAN));
    let energy = in_unit(as_accurate(leaf, energy, energy), units, ENERGY);
    format!("{number:>2}. energy {energy}: {stability}{tip}{within} ({starts}{plain})")
}
