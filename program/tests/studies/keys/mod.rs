//! Every key of the format counts in every verb: with another value the answer is another one, which
//! derivatives and a second method confirm, or the verb refuses and says why. A scenario of which a
//! part counts for nothing would have the answer of another scenario.

mod leaves;
mod rows;
mod verbs;

use std::collections::HashMap;
use std::sync::Mutex;

use leafdyn::scenario::Key;
use leafdyn_testing::workplace::{Workplace, floats};
use rayon::prelude::*;

use leaves::{LEAVES, TestLeaf};
use rows::{Acts, Row, rows};
use verbs::{Answer, Verb, ask, largest_difference, tips};

/// What is refused and must say so: verbs | leaves or keys | part of the message. A line that no
/// verb needs any more goes.
const REFUSED: &str = "
single-shooting shooting shooting-from-rest check chart | gripped | does not take grips
single-shooting shooting shooting-from-rest check chart | rollers | does not take grips
single-shooting shooting | founded | led to rest by the relaxation
explicit keep-unstable all margin map chart | windy gripped-in-wind | does not take wind
check single-shooting shooting shooting-from-rest | gripped-in-wind | does not take grips
single-shooting shooting | following windy | led to rest by the relaxation
explicit keep-unstable all margin map chart | following | does not take loads that turn with the section
single-shooting shooting | jaws pinned | a tip that is held (tip.held)
single-shooting shooting | leaf.base_held rooted mixed | a leaf on hinges
single-shooting shooting | leaf.base | veins that begin apart
explicit | twisted | dead moments without a potential
margin | twisted | has no potential, hence no barrier
trace | twisted | there is no index to follow
fit | leaf.joined | tip_x of free tips
explicit | leaf.base_spin | cannot hold the spin
simulate-explicit | beside load.point.offset | does not move masses off the axis
simulate-semi-implicit | dynamics.clamped | the semi-implicit method holds the base
keep-unstable | oval | leads to no equilibrium from this start
unbend | veins beside rooted mixed gripped rollers founded oval following windy | leaf.rods
unbend | twisted | dead moments have no potential
unbend | pinned jaws | the force of a holder does not follow
unbend | gripped-in-wind | the forces of grips do not follow
unbend | pulled moving flat struck photographed ruled prism gutter fibrous | give the blade's normal
";

/// The lines of a table whose cells are divided by `|`.
fn lines(table: &'static str) -> impl Iterator<Item = Vec<&'static str>> {
    let lines = table.lines().filter(|line| line.contains('|'));
    lines.map(|line| line.split('|').map(str::trim).collect())
}

/// Whether a line of a table is about a verb and a leaf or key.
fn is_about(line: &[&str], verb: Verb, leaf: &str, key: &str) -> bool {
    let has = |cell: &str, word: &str| cell.split_whitespace().any(|it| it == word);
    has(line[0], verb.word()) && (has(line[1], leaf) || has(line[1], key))
}

/// Faults that were found, and lines of tables that were needed.
#[derive(Default)]
struct Found {
    faults: Mutex<Vec<String>>,
    needed: Mutex<Vec<String>>,
}

impl Found {
    fn fault(&self, verb: Verb, leaf: &str, set: &str, what: &str) {
        let line = format!("{} {leaf} {set}: {what}", verb.word());
        self.faults.lock().unwrap().push(line);
    }

    /// Whether an answer may be judged: not if it is refused as documented, or a fault.
    fn is_answer(&self, verb: Verb, leaf: &str, row: Option<&Row>, answer: &Answer) -> bool {
        let (key, set) = row.map_or(("", ""), |row| (row.key.path(), row.set));
        for line in lines(REFUSED).filter(|line| is_about(line, verb, leaf, key)) {
            if answer.status != 0 && answer.said.contains(line[2]) {
                self.needed.lock().unwrap().push(line.join("|"));
                return false;
            }
        }
        match (answer.status, &answer.contradiction) {
            (0, None) => return true,
            // What a fit does not determine, it determined neither before.
            (1, None) if verb == Verb::Fit && !answer.numbers.is_empty() => return true,
            (0, Some(why)) => self.fault(verb, leaf, set, why),
            (status, _) => {
                let said: String = answer.said.chars().take(500).collect();
                self.fault(verb, leaf, set, &format!("status {status}: {said}"));
            }
        }
        false
    }
}

/// The data of a fit: where the tip is, how fast the leaf vibrates or where a photograph shows its
/// tip.
fn data(place: &Workplace, leaf: &TestLeaf) -> String {
    let ask = |verb| ask(place, verb, leaf, None).unwrap();
    if leaf.name == "moving" || leaf.name == "flat" {
        let frequency = ask(Verb::Modes)
            .numbers
            .first()
            .copied()
            .unwrap_or(f64::NAN);
        return format!("frequency_1,sd_frequency_1\n{frequency},0.001\n");
    }
    let mut tip = ask(Verb::Relax).tips;
    if tip.len() != 3 {
        tip = ask(Verb::Release).tips;
    }
    let [x, y, z] = tip[..] else {
        return "tip_x,tip_y,tip_z\n0.9,0.0,-0.1\n".into();
    };
    if leaf.name == "photographed" || leaf.name == "ruled" {
        let (x, y) = (20.0 + 100.0 * x, 50.0 - 100.0 * z);
        return format!("rod,sigma,pixel_x,pixel_y,sd\n1,1.0,{x},{y},0.1\n");
    }
    let held = leaf.vary[0].starts_with("load.gravity")
        && !["twisted", "windy", "gripped-in-wind", "following"].contains(&leaf.name);
    match held {
        // The tip of a held leaf is known: its reaction is measured.
        true => {
            String::from("reaction_x,reaction_y,sd_reaction_x,sd_reaction_y\n0.5,0.1,0.01,0.01\n")
        }
        false => {
            format!("tip_x,tip_y,tip_z,sd_tip_x,sd_tip_y,sd_tip_z\n{x},{y},{z},0.001,0.001,0.001\n")
        }
    }
}

/// The first vein at rest as points, from base to tip; of a leaf that does not come to rest a straight line.
fn shape(place: &Workplace, leaf: &TestLeaf) -> String {
    let run = format!("relax {}.toml --modes 0 --json --write none", leaf.name);
    let told =
        serde_json::from_str(&place.run_on("1", &run).out).unwrap_or(serde_json::Value::Null);
    let points: Vec<Vec<f64>> = match told["positions"][0].as_array() {
        Some(points) => points.iter().map(floats).collect(),
        None => (0..12)
            .map(|k| vec![f64::from(k) / 11.0, 0.0, 0.0])
            .collect(),
    };
    let rows = points
        .iter()
        .map(|at| format!("{},{},{}\n", at[0], at[1], at[2]));
    format!("x,y,z\n{}", rows.collect::<String>())
}

#[test]
fn every_key_counts_in_every_verb_or_is_refused() {
    let place = Workplace::empty();
    let names: Vec<&TestLeaf> = LEAVES.iter().collect();
    names.par_iter().for_each(|leaf| {
        place.write(&format!("{}.toml", leaf.name), leaf.scenario());
        place.write(&format!("{}.csv", leaf.name), data(&place, leaf));
        place.write(&format!("{}-shape.csv", leaf.name), shape(&place, leaf));
    });
    let found = Found::default();
    let rows: Vec<Row> = Key::all()
        .flat_map(rows)
        .filter(|row| !row.leaf.is_empty())
        .collect();
    // The leaves as they are.
    let all = |leaf| Verb::ALL.iter().map(move |verb| (leaf, *verb));
    let asked: Vec<(&TestLeaf, Verb)> = names.iter().copied().flat_map(all).collect();
    let answers = asked.par_iter().filter_map(|&(leaf, verb)| {
        let answer = ask(&place, verb, leaf, None)?;
        let judged = found.is_answer(verb, leaf.name, None, &answer);
        judged.then_some(((leaf.name, verb), answer))
    });
    let before: HashMap<(&str, Verb), Answer> = answers.collect();
    agree(&found, "", &before);
    // With another value of each key.
    let cells: Vec<(&Row, Verb)> = rows
        .iter()
        .flat_map(|row| Verb::ALL.iter().map(move |verb| (row, *verb)))
        .collect();
    let answers = cells.par_iter().filter_map(|&(row, verb)| {
        if !(verb.shows(row.acts) || verb == Verb::Chart && row.acts == Acts::Always) {
            return None;
        }
        let before = before.get(&(row.leaf, verb))?;
        let leaf = TestLeaf::named(row.leaf);
        let answer = ask(&place, verb, leaf, Some(row.set))?;
        if !found.is_answer(verb, row.leaf, Some(row), &answer) {
            return None;
        }
        if verb.shows(row.acts) && !answer.differs_from(before) {
            found.fault(verb, row.leaf, row.set, "counts for nothing");
        }
        Some(((row.set, verb), answer))
    });
    let after: HashMap<(&str, Verb), Answer> = answers.collect();
    for row in &rows {
        let of_row = after.iter().filter(|((set, _), _)| *set == row.set);
        let of_row: HashMap<(&str, Verb), &Answer> =
            of_row.map(|(it, answer)| (*it, answer)).collect();
        agree_on(
            &found,
            row.leaf,
            row.set,
            &of_row.iter().map(|((_, verb), it)| (*verb, *it)).collect(),
        );
    }
    rows.par_iter()
        .filter(|row| row.is_smooth)
        .for_each(|row| follows_derivatives(&place, &found, row));
    let needed = found.needed.into_inner().unwrap();
    let mut faults = found.faults.into_inner().unwrap();
    for line in lines(REFUSED) {
        let line = line.join("|");
        if !needed.contains(&line) {
            faults.push(format!("no more needed: {line}"));
        }
    }
    faults.sort();
    assert!(
        faults.is_empty(),
        "{} faults:\n{}",
        faults.len(),
        faults.join("\n")
    );
}

/// Asserts that all verbs found the leaves in the same equilibrium, and motions at the same end.
fn agree(found: &Found, set: &str, answers: &HashMap<(&'static str, Verb), Answer>) {
    for leaf in LEAVES {
        let of_leaf = answers.iter().filter(|((name, _), _)| *name == leaf.name);
        agree_on(
            found,
            leaf.name,
            set,
            &of_leaf.map(|((_, verb), answer)| (*verb, answer)).collect(),
        );
    }
}

/// How far motions by two methods may be apart.
const MOTIONS: f64 = 3e-3;

fn agree_on(found: &Found, leaf: &str, set: &str, answers: &HashMap<Verb, &Answer>) {
    let simulated =
        [Verb::SimulateExplicit, Verb::SimulateSemiImplicit].map(|verb| answers.get(&verb));
    if let [Some(one), Some(other)] = simulated {
        let apart = largest_difference(&one.tips, &other.tips);
        let length = one
            .tips
            .iter()
            .fold(1.0, |most: f64, at| most.max(at.abs()));
        if apart > MOTIONS * length {
            found.fault(
                Verb::SimulateExplicit,
                leaf,
                set,
                &format!("{apart:.1e} from semi-implicit"),
            );
        }
    }
    let Some(wanted) = answers.get(&Verb::Relax).or(answers.get(&Verb::Release)) else {
        return;
    };
    for (&verb, answer) in answers
        .iter()
        .filter(|(verb, answer)| !verb.moves() && !answer.tips.is_empty())
    {
        let within = 2.0 * (wanted.error + answer.error)
            + 1e-5
                * wanted
                    .tips
                    .iter()
                    .fold(1.0, |most: f64, at| most.max(at.abs()));
        // A map tells the first tip alone.
        let count = match verb {
            Verb::Map => 3,
            _ => wanted.tips.len(),
        };
        let apart = largest_difference(&wanted.tips[..count], &answer.tips);
        if apart > within {
            found.fault(
                verb,
                leaf,
                set,
                &format!(
                    "{apart:.1e} from relax, {:?} {:?}",
                    answer.tips, wanted.tips
                ),
            );
        }
    }
}

/// Part of the change by which the mean of the derivatives at both ends may differ from it.
const BENT: f64 = 0.05;

/// Asserts that the change of the tip is what the derivatives before and after it tell.
fn follows_derivatives(place: &Workplace, found: &Found, row: &Row) {
    let (key, _) = row.set.split_once('=').unwrap();
    let at = |set: &str| {
        let asked = format!(
            "relax {}.toml {set} --sensitivity {key} --write none --json",
            row.leaf
        );
        let run = place.run_on("1", &asked);
        match run.status {
            Some(0) => Ok(run.json()),
            _ => Err(format!("{asked}: {}{}", run.out, run.err)),
        }
    };
    let (before, after) = match (at(""), at(&format!("--set {}", row.set))) {
        (Ok(before), Ok(after)) => (before, after),
        (Err(why), _) | (_, Err(why)) => return found.fault(Verb::Relax, row.leaf, row.set, &why),
    };
    let rate = |told: &serde_json::Value| floats(&told["sensitivities"][0]["tip"]);
    let value = |told: &serde_json::Value| {
        told["sensitivities"][0]["value"]
            .as_f64()
            .unwrap_or(f64::NAN)
    };
    let step = value(&after) - value(&before);
    let changes = tips(&after)
        .iter()
        .zip(tips(&before))
        .map(|(after, before)| after - before)
        .collect::<Vec<_>>();
    let told: Vec<f64> = rate(&before)
        .iter()
        .zip(rate(&after))
        .map(|(a, b)| 0.5 * (a + b) * step)
        .collect();
    let size = leafdyn_testing::largest(changes.iter().map(|it| it.abs()));
    let off = largest_difference(&changes, &told);
    if off.is_nan() || off > BENT * size + 1e-8 {
        found.fault(
            Verb::Relax,
            row.leaf,
            row.set,
            &format!("changes the tip by {changes:?}, derivatives tell {told:?}"),
        );
    }
}
