//! The text report of a posture, its table, and the scenario that rests in it.

use crate::report::document::ReportedResult;
use crate::report::numbers::{
    count_in_words, duration_text, format_five_digits, number_in_key_unit, number_in_unit,
    round_to_error,
};
use crate::report::table::{LabelledLines, csv_writer_without_header, label_first_line, text_cell};
use leafdyn::posture::Governing;
use leafdyn::posture::leaf::ModulusMeaning;
use leafdyn::scenario::Units;
use leafdyn::scenario::units::LENGTH;
use leafdyn::study::{
    CriticalYoung, PostureIndex, PostureOutcome, PostureRow, Postures, SlowLoading, Unbending,
};
use std::io;
use std::io::Write;

/// Rungs of the ladder in the report.
const RUNGS_TOLD: usize = 4;

/// A modulus with the digits that its interval leaves, in its unit.
pub fn modulus_text(found: &Unbending, value: f64, error: f64, units: &Units) -> String {
    let digits = format_five_digits(round_to_error(value, error));
    match found.meaning {
        ModulusMeaning::Young => number_in_key_unit(digits, units, "section.young"),
        ModulusMeaning::Factor => format!("{digits} times the given stiffness"),
    }
}

/// The way in which a leaf would leave its posture.
pub fn governing_phrase(governing: Governing) -> &'static str {
    match governing {
        Governing::InPlane => "bends on in its plane",
        Governing::OutOfPlane => "twists out of its plane",
        Governing::Spatial => "bends and twists",
    }
}

impl ReportedResult for Unbending {
    fn heading(&self) -> String {
        let points = count_in_words(self.points.len(), "point", "points");
        format!("{}: posture of {points}", self.scenario)
    }

    fn report_lines(&self, units: &Units) -> LabelledLines {
        let CriticalYoung { value, low, high } = self.critical_young;
        let error = 0.05 * (high - low);
        let modulus = |value: f64| modulus_text(self, value, error, units);
        let digits = |value: f64| format_five_digits(round_to_error(value, error));
        let mut lines = LabelledLines::new();
        if value > 0.0 {
            let bound = format!(
                "E is at least {} (95 %: {} to {})",
                modulus(value),
                digits(low),
                digits(high)
            );
            lines.push(("bound", bound));
            let critical = &self.posture.critical;
            let [from, to] = critical.stretch.map(|sigma| format!("{sigma:.2}"));
            lines.push((
                "mode",
                format!(
                    "below it the leaf {}, most at {:.2} of its length, nearly all from {from} to {to}",
                    governing_phrase(critical.governing),
                    critical.at
                ),
            ));
            let ladder = self.posture.ladder();
            let rungs: Vec<String> = (ladder.iter().take(RUNGS_TOLD))
                .map(|rung| format_five_digits(*rung))
                .collect();
            let rungs = match self.meaning {
                ModulusMeaning::Young => {
                    number_in_key_unit(rungs.join(", "), units, "section.young")
                }
                ModulusMeaning::Factor => rungs.join(", "),
            };
            lines.push(("ladder", format!("the index changes at {rungs}")));
        } else {
            lines.push(("bound", "none: the posture is stable at any E".into()));
        }
        lines.extend(self.young.map(|young| {
            let error = 0.05 * (young.high.unwrap_or(2.0 * young.value) - young.low);
            let digits = |value: f64| format_five_digits(round_to_error(value, error));
            let interval = match young.high {
                Some(high) => format!("{} to {}", digits(young.low), digits(high)),
                None => format!("at least {}", digits(young.low)),
            };
            let value = modulus_text(self, young.value, error, units);
            let turn = young.turn;
            (
                "modulus",
                format!("E = {value} (95 %: {interval}), by postures that differ by {turn:.2} rad"),
            )
        }));
        lines.extend(label_first_line(
            "index",
            self.indices.iter().map(|PostureIndex { young, index }| {
                let at = modulus_text(self, *young, 0.0, units);
                match index {
                    0 => format!("0 at {at}: stable"),
                    index => format!("{index} at {at}: unstable, so that E is larger"),
                }
            }),
        ));
        let loading = match self.slow_loading {
            Some(SlowLoading::From(young)) => Some(format!(
                "slow loading leads here from E = {} on",
                modulus_text(self, young, 0.05 * young, units)
            )),
            Some(SlowLoading::NotBelow(young)) => Some(format!(
                "slow loading leads elsewhere even at E = {}: the leaf has grown under its load",
                modulus_text(self, young, 0.05 * young, units)
            )),
            None => None,
        };
        lines.extend(label_first_line("loading", loading));
        if let Some(smoothing) = self.smoothing() {
            let given = if smoothing.sd_given {
                "as given"
            } else {
                "estimated"
            };
            lines.push((
                "points",
                format!(
                    "standard deviation {} ({given}), smoothed to {:.1} coefficients a coordinate",
                    number_in_unit(
                        format_five_digits(round_to_error(smoothing.sd, 0.05 * smoothing.sd)),
                        units,
                        LENGTH
                    ),
                    smoothing.degrees_of_freedom
                ),
            ));
        }
        let shown = modulus_text(self, self.shown_young, 0.0, units);
        let confirmed = match self.rest_check.and_then(|check| check.distance) {
            Some(distance) => format!(", relaxed from there within {distance:.1e} of its length"),
            None => String::new(),
        };
        lines.push((
            "rest",
            format!("rest.toml and rest.csv are those of E = {shown}{confirmed}"),
        ));
        lines
    }

    fn work_line(&self) -> Option<String> {
        Some(duration_text(self.wall_seconds))
    }

    fn remarks(&self) -> LabelledLines {
        label_first_line("remark", self.remarks.iter().map(ToString::to_string))
    }
}

/// `rest.csv`: the posture at equal parts of its length, its moments, and the curvature and the place that it has
/// without loads, with standard deviations.
pub fn write_rest_table(found: &Unbending, out: &mut dyn Write) -> io::Result<()> {
    let mut table = csv_writer_without_header(out);
    table.write_record([
        "sigma", "s", "x", "y", "z", "u1", "u2", "u3", "m1", "m2", "m3", "u0_1", "u0_2", "u0_3",
        "x0", "y0", "z0", "sd_u1", "sd_u2", "sd_u3", "sd_m1", "sd_m2", "sd_m3", "sd_u0_1",
        "sd_u0_2", "sd_u0_3",
    ])?;
    let young = found.shown_young;
    let base = found.posture.base.rotation();
    let unloaded = found.stations.unloaded(young, base);
    for (station, place) in found.stations.ends.iter().zip(unloaded) {
        let vectors = [
            station.position,
            station.curvature,
            station.moment,
            station.rest_curvature(young),
            place,
            station.curvature_deviation,
            station.moment_deviation,
            station.rest_deviation(young),
        ];
        let along = [station.sigma, station.sigma * found.stations.length];
        let cells = along
            .into_iter()
            .chain(vectors.iter().flat_map(|v| v.to_array()));
        table.write_record(cells.map(|cell| format!("{cell:?}")))?;
    }
    table.flush()
}

/// `rest.toml`: the scenario that rests in the posture.
pub fn write_rest_scenario(found: &Unbending, out: &mut dyn Write) -> io::Result<()> {
    match &found.rest {
        Some(rest) => {
            writeln!(
                out,
                "# Rests in the posture of {} at E = {:?}.",
                found.scenario, found.shown_young
            )?;
            out.write_all(rest.to_toml().as_bytes())
        }
        None => Ok(()),
    }
}

/// Quantiles of the bounds in the report of many postures.
const QUANTILES: [f64; 3] = [0.05, 0.5, 0.95];

impl ReportedResult for Postures {
    fn heading(&self) -> String {
        let leaves = count_in_words(self.postures.len(), "leaf", "leaves");
        format!("{}: postures of {leaves}", self.scenario)
    }

    fn report_lines(&self, _units: &Units) -> LabelledLines {
        let count = |outcome: PostureOutcome| {
            let rows = self.postures.iter();
            rows.filter(|row| row.outcome == outcome).count()
        };
        let [bound, none, refused] = [
            PostureOutcome::Bound,
            PostureOutcome::NoBound,
            PostureOutcome::Refused,
        ]
        .map(count);
        let mut lines = vec![(
            "found",
            format!("{bound} with a bound, {none} stable at any E, {refused} refused"),
        )];
        let of = |row: &PostureRow| row.critical_young.filter(|young| *young > 0.0);
        let mut all: Vec<f64> = self.postures.iter().filter_map(of).collect();
        all.sort_by(f64::total_cmp);
        if let Some(last) = all.len().checked_sub(1) {
            let quantiles = QUANTILES.map(|part| {
                let young = all[(part * last as f64).round() as usize];
                format_five_digits(round_to_error(young, 5e-3 * young))
            });
            let [low, median, high] = quantiles;
            lines.push((
                "bounds",
                format!("E is at least {low}, {median} and {high} at 5, 50 and 95 %"),
            ));
        }
        let why = self
            .postures
            .iter()
            .find(|row| row.outcome == PostureOutcome::Refused);
        let why = why.map(|row| {
            format!(
                "{}: {}",
                row.leaf,
                row.remark.as_deref().unwrap_or_default()
            )
        });
        lines.extend(label_first_line("refused", why));
        lines
    }

    fn work_line(&self) -> Option<String> {
        Some(duration_text(self.wall_seconds))
    }
}

/// `postures.csv`: a row for each leaf.
pub fn write_postures_table(found: &Postures, out: &mut dyn Write) -> io::Result<()> {
    let mut table = csv::Writer::from_writer(out);
    for row in &found.postures {
        table.serialize(PostureRow {
            leaf: text_cell(&row.leaf).into(),
            remark: row.remark.as_deref().map(|remark| text_cell(remark).into()),
            ..row.clone()
        })?;
    }
    table.flush()
}
