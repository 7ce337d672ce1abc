//! A fit: its numbers with their intervals, results of experiments with the model and its confidence
//! band along what varied, measured points over the veins, and below each the residuals.

use super::fit_numbers::draw_numbers;
use super::fit_panels::{draw_results, draw_veins};
use super::fit_series::results;
use crate::figure::drawing::Drawing;
use crate::figure::layout::{HEADER, LEFT, letters};
use crate::figure::page::new_page;
use crate::report::numbers::{brief, counted};
use leafdyn::scenario::Scenario;
use leafdyn::study::Fit;

const BOTTOM: f64 = 4.0;
/// Most panels of results, and most leaves, that are drawn.
const MOST_RESULTS: usize = 8;
const MOST_LEAVES: usize = 3;

pub fn draw(fit: &Fit, scenario: &Scenario) -> Drawing {
    let units = &scenario.units;
    let name = format!("{}: fit", fit.scenario);
    let count = fit.residuals.len();
    let free = counted(fit.parameters.len(), "free number", "free numbers");
    let mut notes = vec![format!("{count} data, {free}"), fit.outcome.word().into()];
    match fit.standard_deviation {
        Some(sd) => notes.push(format!("residuals of {}", brief(sd))),
        None => notes.push(format!(
            "sum of squares {} for {} degrees of freedom",
            brief(fit.chi_squared),
            fit.degrees_of_freedom
        )),
    }
    let mut page = new_page(LEFT, &name, &notes, None);
    let mut letters = letters();
    let mut letter = || letters.next().unwrap_or_default();
    let mut top = HEADER;
    page.group("numbers", |page| {
        top = draw_numbers(page, top, &letter(), &fit.parameters, units);
    });
    for results in results(fit).iter().take(MOST_RESULTS) {
        page.group("result", |page| {
            top = draw_results(page, top, &letter(), units, results);
        });
    }
    let traced = fit.leaves.iter().filter(|(_, it)| !it.traced.is_empty());
    for (name, leaf) in traced.take(MOST_LEAVES) {
        page.group("veins", |page| {
            let of = fit.residuals.iter();
            let of = of.filter(|it| it.rod.is_some() && it.number == leaf.number);
            top = draw_veins(page, top, &letter(), (name, units), leaf, of.collect());
        });
    }
    page.height = (top + BOTTOM).ceil();
    page
}
