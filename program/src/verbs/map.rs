//! `leafdyn map`: maps where each method fails.

use std::fs;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Mutex;
use std::time::Instant;

use super::help::FOR_EXPERTS;
use super::job::{Delivered, Job};
use super::progress::fraction_of;
use super::request::{Request, VerbTraits};
use super::{OnInterrupt, Refusal, Status, on_interrupt};
use crate::files::{self, Journal, Kind};
use crate::report::{self, FileError};
use clap::Args;
use leafdyn::study::{
    self, CELL_SECONDS, Map as Cells, MapMethod, MapRequest, MapRow, MapShow, Vary,
};

/// Solve a leaf by several methods over one or two varying numbers, and map where each method fails.
///
/// Exit status: 0 the map is made, whatever the methods did; 2 the request was
/// refused. Cells that are already in the folder are not solved again.
#[derive(Debug, Args)]
pub struct Map {
    #[command(flatten)]
    request: Request,

    /// What varies, once or twice: numbers of the scenario as in --set, entries of lists counted from 0 (load.gravity[2]), method.step, method.segments; several keys that vary together are joined by +
    #[arg(long, value_name = "KEY=FROM..TO[:COUNT][log]", required = true)]
    vary: Vec<Vary>,

    /// The methods: semi-implicit, explicit, explicit-motion, single-shooting, shooting, shooting-from-rest [default: all; explicit-motion if method.step is set or varies]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    methods: Option<Vec<MapMethod>>,

    /// Time allowed for each method in each cell
    #[arg(long, value_name = "S", default_value_t = CELL_SECONDS, allow_negative_numbers = true)]
    cell_seconds: f64,

    /// Solve every K-th cell from the I-th on, into map-I-of-K.csv: for jobs that share a map
    #[arg(long, value_name = "I/K", help_heading = FOR_EXPERTS)]
    shard: Option<Shard>,

    /// What the figure shows: outcomes, or waves: how many the margins of stable answers make
    #[arg(long, value_name = "WHAT", default_value_t)]
    show: MapShow,
}

/// One of several parts of a map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Shard {
    /// Its number, from 1.
    part: usize,
    of: usize,
}

impl Shard {
    fn file_name(self) -> String {
        format!("map-{}-of-{}.csv", self.part, self.of)
    }

    fn contains(self, cell: usize) -> bool {
        cell % self.of == self.part - 1
    }
}

impl FromStr for Shard {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let parsed = text.split_once('/').and_then(|(part, of)| {
            let (part, of) = (part.trim().parse().ok()?, of.trim().parse().ok()?);
            (1..=of).contains(&part).then_some(Shard { part, of })
        });
        parsed.ok_or("must be I/K with I from 1 to K, as in 1/4")
    }
}

const WHOLE: Shard = Shard { part: 1, of: 1 };

impl Map {
    pub fn run(self) -> Result<Status, Refusal> {
        let traits = VerbTraits {
            varies: true,
            puts: Some("--vary"),
            ..VerbTraits::default()
        };
        self.request.each::<Cells>(traits, |job| self.one(job))
    }

    fn one(&self, job: &Job) -> Result<Delivered, Refusal> {
        let folder = &job.folder;
        let request = MapRequest::new(
            job.base.clone(),
            self.vary.clone(),
            self.methods.clone(),
            self.request.tolerance,
            self.cell_seconds,
        )?;
        files::belongs(folder, &request)?;
        let clock = Instant::now();
        let known = Cells::new(request.clone(), self.known(folder, &request)?);
        // A later run identifies the rows by the request stored next to them.
        let keeps_rows = job.selection.kinds.contains(&Kind::Csv);
        if keeps_rows {
            files::claim(folder, &job.document(&known))?;
        }
        let computed = self.solve(job, keeps_rows, &request, &known.rows)?;
        let counts = [known.rows.len(), computed.len()];
        let mut map = Cells::new(request, [known.rows, computed].concat());
        map.show = self.show;
        if self.shard.is_none() {
            let line = Mutex::new(job.progress());
            map.find_jumps(&|done, pairs| {
                if let Ok(mut line) = line.lock() {
                    line.update(fraction_of(done, pairs), || {
                        format!("{done} of {pairs} pairs of cells that stand apart")
                    });
                }
            });
        }
        let work = report::MapWork {
            map: &map,
            known: counts[0],
            computed: counts[1],
            seconds: clock.elapsed().as_secs_f64(),
        };
        let written = match self.shard {
            None => job.write(&map),
            Some(_) if keeps_rows => {
                let file = files::write_rows(folder, &self.file_name(), &map.request, &map.rows)?;
                Ok(vec![file.display().to_string()])
            }
            Some(_) => Ok(Vec::new()),
        };
        job.deliver_written(&map, true, &work, [written])
    }

    /// The file of the rows.
    fn file_name(&self) -> String {
        self.shard.map_or("map.csv".into(), Shard::file_name)
    }

    /// The rows that need not be computed: those of the shard or, for a whole map, all
    /// in the folder.
    fn known(&self, folder: &Path, request: &MapRequest) -> Result<Vec<MapRow>, Refusal> {
        let mut files = vec![folder.join(self.file_name())];
        if self.shard.is_none() {
            files.extend(shards(folder));
        }
        files.retain(|file| file.exists());
        let mut rows = Vec::new();
        for file in files {
            rows.extend(report::read_rows(&file, request)?);
        }
        Ok(rows)
    }

    /// Computes the missing rows; each is written to the file as soon as it is known.
    fn solve(
        &self,
        job: &Job,
        keeps_rows: bool,
        request: &MapRequest,
        known: &[MapRow],
    ) -> Result<Vec<MapRow>, Refusal> {
        let shard = self.shard.unwrap_or(WHOLE);
        let is_known = |cell: usize, method: MapMethod| {
            let found = known.binary_search_by_key(&(cell, method), |row| (row.cell, row.method));
            found.is_ok()
        };
        let todo: Vec<(usize, Vec<MapMethod>)> = (0..request.cells())
            .filter(|&cell| shard.contains(cell))
            .map(|cell| {
                let methods = request.methods.iter().copied();
                let missing = methods.filter(|&method| !is_known(cell, method));
                (cell, missing.collect())
            })
            .filter(|(_, methods): &(usize, Vec<_>)| !methods.is_empty())
            .collect();
        if todo.is_empty() {
            return Ok(Vec::new());
        }
        let todo = spread(todo);
        let open = || Journal::open(&job.folder, &self.file_name(), request, known);
        let mut journal = keeps_rows.then(open).transpose()?;
        if journal.is_some() {
            let file = job.folder.join(self.file_name());
            let file = file.display();
            let how = format!(
                "stopped; finished cells are in {file}: the same command goes on with the others"
            );
            *on_interrupt() = Some(OnInterrupt::Tell(how));
        }
        let mut line = job.progress();
        let (mut rows, mut finished) = (Vec::new(), 0);
        let mut failed: Option<FileError> = None;
        study::map(request, &todo, &mut |new| {
            // Cells that were being solved still arrive after a failure, which they must not hide.
            if let Some(journal) = &mut journal {
                unless_failed(&mut failed, || journal.append(request, &new));
            }
            rows.extend(new);
            finished += 1;
            let cells = todo.len();
            line.update(fraction_of(finished, cells), || {
                format!("{finished} of {cells} cells")
            });
            failed.is_none()
        });
        failed.map_or(Ok(rows), |error| Err(error.into()))
    }
}

/// The same, so that those before any of them are a fair sample of all: hard cells stand side by side,
/// and the time that is left is estimated from the cells that are finished.
fn spread<T>(all: Vec<T>) -> Vec<T> {
    let count = all.len();
    // Steps of the golden section, which leave no gap for long.
    let golden = (0.618 * count as f64).round().max(1.0) as usize;
    let shared = |step: usize, k: usize| step.is_multiple_of(k) && count.is_multiple_of(k);
    let coprime = |step: &usize| (2..=*step).all(|k| !shared(*step, k));
    let step = (golden..).find(coprime).unwrap_or(1);
    let mut all: Vec<Option<T>> = all.into_iter().map(Some).collect();
    let order = (0..count).map(|k| (k * step) % count);
    order.filter_map(|at| all[at].take()).collect()
}

/// Writes unless something before could not be written, which is kept.
fn unless_failed<E>(failed: &mut Option<E>, write: impl FnOnce() -> Result<(), E>) {
    if failed.is_none() {
        *failed = write().err();
    }
}

/// Files of shards in a folder, in order of their names.
fn shards(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(folder) else {
        return Vec::new();
    };
    let mut files: Vec<PathBuf> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|file| {
            let name = file.file_name().unwrap_or_default().to_string_lossy();
            let middle = name.strip_prefix("map-");
            let middle = middle.and_then(|rest| rest.strip_suffix(".csv"));
            let shard = middle.and_then(|middle| middle.replace("-of-", "/").parse::<Shard>().ok());
            shard.is_some_and(|shard| name == shard.file_name())
        })
        .collect();
    files.sort();
    files
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each comes once, and the first of them are from everywhere.
    #[test]
    fn cells_come_from_all_over_the_map() {
        for count in [0, 1, 2, 3, 6, 7, 48, 117, 1024] {
            let mut order = spread((0..count).collect::<Vec<usize>>());
            let first: Vec<usize> = order.iter().copied().take(count / 4).collect();
            for quarter in 0..4 {
                let within = |cell: &&usize| **cell * 4 / count == quarter;
                let found = first.iter().filter(within).count();
                assert!(4 * found + 8 >= first.len(), "{count}: {first:?}");
            }
            order.sort();
            assert_eq!(order, (0..count).collect::<Vec<_>>());
        }
    }

    /// A cell that is written after one that could not be does not hide that.
    #[test]
    fn the_first_failure_is_kept() {
        let (mut failed, mut written) = (None, 0);
        for result in [Ok(()), Err("no space left"), Ok(()), Err("closed")] {
            unless_failed(&mut failed, || {
                written += 1;
                result
            });
        }
        assert_eq!((failed, written), (Some("no space left"), 2));
    }

    #[test]
    fn only_files_of_shards_are_recognized() {
        let folder = tempfile::tempdir().unwrap();
        let names = "map-2-of-3.csv map-4-of-3.csv map.csv map-x.csv map-1-of-2.csv";
        for name in names.split(' ') {
            fs::write(folder.path().join(name), "").unwrap();
        }
        let found: Vec<_> = (shards(folder.path()).iter())
            .map(|file| file.file_name().unwrap().to_str().unwrap().to_string())
            .collect();
        assert_eq!(found, ["map-1-of-2.csv", "map-2-of-3.csv"]);
    }
}
