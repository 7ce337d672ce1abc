//! `leafdyn relax`: a leaf comes to rest.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum, ValueHint};

use leafdyn::output::{self, Format, Summary};
use leafdyn::relax::{self, Equilibrium, Method, Options};
use leafdyn::scenario::Scenario;

use super::progress::ProgressLine;
use super::{Refusal, Status, note, report, show};

/// Find how a leaf comes to rest, how accurate that is and whether it is stable.
///
/// Exit status: 0 at rest within the tolerance; 1 not (the files are still
/// written and say how far it came); 2 the request was refused.
#[derive(Debug, Args)]
pub struct Relax {
    /// The leaf, as a TOML file
    #[arg(value_hint = ValueHint::FilePath)]
    scenario: PathBuf,

    /// How the leaf is brought to rest
    #[arg(long, value_name = "NAME", value_enum, default_value_t = MethodName::SemiImplicit)]
    method: MethodName,

    /// One fixed grid of N segments a rod, without extrapolation; left out: as fine as the tolerance needs
    #[arg(long, value_name = "N")]
    segments: Option<usize>,

    /// Wanted accuracy of the centerlines, relative to the largest rod length; overrides the scenario's
    #[arg(long, value_name = "T", allow_negative_numbers = true)]
    tolerance: Option<f64>,

    /// Shoot over N intervals; 1 is single shooting; left out: as many as the growth of perturbations needs
    #[arg(long, value_name = "N")]
    intervals: Option<usize>,

    /// Override one entry of the scenario, as in --set load.gravity=[0,0,-0.5]; may repeat
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,

    /// Where files go [default: out/<name of the scenario>]
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    out: Option<PathBuf>,

    /// Print the summary as JSON on standard output and nothing else there
    #[arg(long)]
    json: bool,

    /// Stop at a saddle instead of leaving it for a stable equilibrium
    #[arg(long)]
    keep_unstable: bool,
}

/// The methods by the names users type.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum MethodName {
    SemiImplicit,
    Shooting,
}

impl From<MethodName> for Method {
    fn from(name: MethodName) -> Self {
        match name {
            MethodName::SemiImplicit => Method::SemiImplicit,
            MethodName::Shooting => Method::Shooting,
        }
    }
}

impl Relax {
    pub fn run(self) -> Result<Status, Refusal> {
        let scenario = Scenario::read(&self.scenario, &self.overrides)?;
        let folder = match &self.out {
            Some(folder) => folder.clone(),
            None => Path::new("out").join(folder_name(&scenario.name)),
        };
        output::check_writable(&folder)?;

        let equilibrium = self.solve(&scenario)?;
        let written = output::write_all(&folder, &equilibrium);
        // What was found is shown even if the files could not be written.
        self.print(&equilibrium, &folder, written.is_ok())?;
        written?;
        Ok(match equilibrium.outcome.is_success() {
            true => Status::AtRest,
            false => Status::NotAtRest,
        })
    }

    fn solve(&self, scenario: &Scenario) -> Result<Equilibrium, Refusal> {
        let options = Options {
            method: self.method.into(),
            segments: self.segments,
            tolerance: self.tolerance,
            keep_unstable: self.keep_unstable,
            intervals: self.intervals,
        };
        let mut line = ProgressLine::new(&scenario.name);
        Ok(relax::relax(scenario, &options, &mut |progress| {
            line.update(progress)
        })?)
    }

    fn print(
        &self,
        equilibrium: &Equilibrium,
        folder: &Path,
        written: bool,
    ) -> Result<(), Refusal> {
        if !self.json {
            let folder = written.then_some(folder);
            return show(report::report(equilibrium, folder).as_bytes());
        }
        if let Some(remark) = &equilibrium.remark {
            note(&format!("{}: {remark}", equilibrium.scenario));
        }
        let mut json = Vec::new();
        Summary.write(equilibrium, &mut json)?;
        show(&json)
    }
}

/// The scenario's name as one folder below `out`, whatever is in it.
fn folder_name(name: &str) -> String {
    let plain = |c: char| {
        if c.is_alphanumeric() || "-_.+ ".contains(c) {
            c
        } else {
            '_'
        }
    };
    let folder: String = name.trim().chars().map(plain).collect();
    match folder.as_str() {
        "" => "leaf".into(),
        _ if folder.starts_with('.') => folder.replacen('.', "_", 1),
        _ => folder,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_stay_below_out() {
        for (name, folder) in [
            ("fig04", "fig04"),
            ("../../etc", "_._.._etc"),
            ("..", "_."),
            ("a/b", "a_b"),
            ("", "leaf"),
            ("Blatt 3, süß", "Blatt 3_ süß"),
        ] {
            assert_eq!(folder_name(name), folder);
        }
    }
}
