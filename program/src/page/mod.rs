//! Leaves in space for browsers ([`html_page`]), ParaView ([`vtk`]) and Blender ([`glb`]).
//!
//! The page shows a leaf that can be rotated, played and inspected, as one self-contained
//! HTML file.
//!
//! ```
//! use leafdyn::relax::{Options, relax};
//! use leafdyn::scenario::Scenario;
//! use leafdyn_program::page;
//!
//! let scenario = Scenario::read("../scenarios/paper/fig04.toml")?;
//! let leaf = relax(&scenario, &Options::default(), &mut |_| {})?;
//! let page = page::html_page(&leaf, &scenario);
//! assert!(page.starts_with("<!DOCTYPE html>") && page.len() < 1_000_000);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! `data.rs` defines the data of the page, `results.rs` fills it in, and the scripts draw it.
//! `three/` holds the part of three.js that is used, and how it is bundled.

mod data;
pub mod glb;
mod results;
pub mod surface;
pub mod vtk;

use crate::figure::FigureFunction;
use crate::figure::drawing::formats::{escape_xml, hex_color, write_svg};
use crate::figure::drawing::space::ViewAngles;
use crate::figure::drawing::veins::is_vein_drawn;
use crate::figure::drawing::{Drawing, color_of_vein};
pub use crate::figure::scenario::QuantityLabel;
use crate::figure::scenario::{FigureSetting, LoadMark, load_marks, support_marks};
pub use crate::page::data::{PageData, PageLeaf};
use crate::report;
use crate::report::ReportedResult;
use glam::DVec3;
use leafdyn::scenario;
use leafdyn::scenario::Scenario;
use leafdyn::simulate::Record;
use leafdyn::study::Trace;
use std::io;
use std::io::Write;

const PAGE_HTML: &str = include_str!("page.html");

const PAGE_CSS: &str = include_str!("page.css");

const THREE_JS: &str = include_str!("three/three.min.js");

const PAGE_SCRIPTS: [&str; 7] = [
    include_str!("given.js"),
    include_str!("data.js"),
    include_str!("space.js"),
    include_str!("axes.js"),
    include_str!("chart.js"),
    include_str!("stage.js"),
    include_str!("page.js"),
];

/// A result that has a page.
pub trait PageResult: ReportedResult {
    /// The figure that replaces it in a browser without 3D graphics.
    #[doc(hidden)]
    const FALLBACK_FIGURE: FigureFunction<Self>;

    /// Fills in the data of the page.
    #[doc(hidden)]
    fn fill_page_data(&self, view: &mut PageData, scenario: &Scenario);
}

/// A shape of the leaf among several.
pub struct ShapeInSeries<'r> {
    /// Its time, or its number.
    pub time: f64,
    /// Fractions of the length at which its nodes are.
    pub stations: &'r [f64],
    /// The centerlines of its veins.
    pub curves: &'r [Vec<DVec3>],
}

/// The instants of a motion.
pub(crate) fn shapes_of_motion(record: &Record) -> Vec<ShapeInSeries<'_>> {
    let film = record.film.iter();
    film.map(|still| ShapeInSeries {
        time: record.moments[still.moment].time,
        stations: &record.stations,
        curves: &still.curves,
    })
    .collect()
}

/// All points of a trace, numbered branch after branch.
pub(crate) fn shapes_of_trace(trace: &Trace) -> Vec<ShapeInSeries<'_>> {
    let points = trace.branches.iter().flat_map(|branch| &branch.points);
    (points.enumerate())
        .map(|(number, point)| ShapeInSeries {
            time: number as f64,
            stations: &point.stations,
            curves: &point.curves,
        })
        .collect()
}

/// Writes the page of a result.
pub(crate) fn write_page<R: PageResult>(
    result: &R,
    input: &Scenario,
    out: &mut dyn Write,
) -> io::Result<()> {
    out.write_all(html_page(result, input).as_bytes())
}

/// The page of a result of this scenario: a self-contained HTML file.
pub fn html_page<R: PageResult>(result: &R, scenario: &Scenario) -> String {
    assemble_html(
        &page_data(result, scenario),
        &R::FALLBACK_FIGURE(result, scenario),
    )
}

/// The data of that page alone.
pub fn page_data<R: PageResult>(result: &R, scenario: &Scenario) -> PageData {
    let mut view = page_data_without_result(scenario);
    view.summary = result.summary(&scenario.units);
    result.fill_page_data(&mut view, scenario);
    let setting = FigureSetting::from_scenario(scenario);
    for leaf in &mut view.leaves {
        if let Some(time) = leaf.time {
            leaf.loads = Some(loads_on_drawn_veins(scenario, Some(time)));
            leaf.directions = Some(setting.direction_arrows(true, time));
        }
        leaf.loads.take_if(|loads| *loads == view.loads);
        leaf.directions.take_if(|arrows| *arrows == view.directions);
    }
    let tips = view.leaves.iter().map(|leaf| leaf.tip_from_base);
    let oblique = ViewAngles::oblique(tips).toward_viewer();
    view.toward.get_or_insert(oblique);
    view
}

/// The data of a page that shows a scenario without a result.
pub fn page_data_without_result(scenario: &Scenario) -> PageData {
    let count = scenario.rods.len();
    let drawn: Vec<usize> = (1..=count)
        .filter(|number| is_vein_drawn(number - 1, count))
        .collect();
    let color = |&number: &usize| hex_color(color_of_vein(number - 1, count));
    PageData {
        kind: "leaf",
        title: scenario.name.clone(),
        verdict: String::new(),
        success: true,
        summary: Vec::new(),
        units: [
            &scenario.units.length,
            &scenario.units.force,
            &scenario.units.time,
        ]
        .map(Clone::clone),
        directions: FigureSetting::from_scenario(scenario).direction_arrows(true, 0.0),
        loads: loads_on_drawn_veins(scenario, None),
        holds: (support_marks(scenario).into_iter())
            .filter(|mark| is_vein_drawn(mark.vein - 1, count))
            .collect(),
        toward: None,
        longest: scenario::longest(&scenario.rods),
        lengths: (drawn.iter().map(|&number| scenario.rods[number - 1].length)).collect(),
        joined: scenario.joined,
        rods: count,
        colors: drawn.iter().map(color).collect(),
        drawn,
        leaves: Vec::new(),
        modes: Vec::new(),
        chart: None,
    }
}

/// The loads on the veins that are drawn.
pub(crate) fn loads_on_drawn_veins(scenario: &Scenario, time: Option<f64>) -> Vec<LoadMark> {
    let count = scenario.rods.len();
    let mut loads = load_marks(scenario, time);
    loads.retain(|mark| is_vein_drawn(mark.vein - 1, count));
    loads
}

/// A leaf in motion at this time, as centerlines with nodes at these stations, for the page of its
/// scenario.
pub fn moving_leaf(
    stations: &[f64],
    curves: &[Vec<DVec3>],
    page: &PageData,
    scenario: &Scenario,
    time: f64,
) -> PageLeaf {
    let arrows = FigureSetting::from_scenario(scenario).direction_arrows(true, time);
    PageLeaf {
        directions: Some(arrows).filter(|arrows| *arrows != page.directions),
        loads: Some(loads_on_drawn_veins(scenario, Some(time)))
            .filter(|loads| *loads != page.loads),
        ..PageLeaf::from_centerlines(String::new(), stations, curves, page, usize::MAX)
    }
}

fn assemble_html(view: &PageData, still: &Drawing) -> String {
    let (mut data, mut figure) = (Vec::new(), Vec::new());
    // Writing to memory cannot fail.
    let _ = report::write_json(view, &mut data);
    let _ = write_svg(still, &mut figure);
    // Within a script only `</script` and `<!--` are special.
    let data = String::from_utf8_lossy(&data).replace('<', "\\u003c");
    let figure = String::from_utf8_lossy(&figure).into_owned();
    let scripts = PAGE_SCRIPTS.concat();
    let parts = [
        ("TITLE", escape_xml(&view.title)),
        ("STYLE", PAGE_CSS.into()),
        ("FIGURE", figure),
        ("DATA", data),
        ("THREE", THREE_JS.into()),
        ("SCRIPT", scripts),
    ];
    let size: usize = parts.iter().map(|(_, part)| part.len()).sum();
    let mut page = String::with_capacity(PAGE_HTML.len() + size);
    let mut rest = PAGE_HTML;
    // Inserted text is not searched for placeholders.
    while let Some((before, after)) = rest.split_once("{{") {
        let Some((name, after)) = after.split_once("}}") else {
            break;
        };
        page.push_str(before);
        let part = parts.iter().find(|(part, _)| *part == name);
        page.push_str(part.map_or("", |(_, text)| text));
        rest = after;
    }
    page + rest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;

    use serde_json::Value;

    fn scenario(rods: usize) -> Scenario {
        let mut scenario = sample::sample_scenario("page", rods);
        scenario.name = "a < b </script>".into();
        scenario.units.length = Some("cm".into());
        scenario
    }

    /// The data that stand in the text of a page.
    fn data(page: &str) -> Value {
        let (_, rest) = page.split_once("type=\"application/json\">").unwrap();
        serde_json::from_str(rest.split_once("</script>").unwrap().0).unwrap()
    }

    #[test]
    fn the_bundle_is_the_one_that_was_made() {
        let noted = include_str!("three/three.min.js.crc32");
        let found = crc32fast::hash(THREE_JS.as_bytes());
        assert_eq!(format!("{found:08x}"), noted.trim());
        assert!(THREE_JS.contains("SPDX-License-Identifier: MIT"));
        assert!(!THREE_JS.contains("</script") && !THREE_JS.contains("<!--"));
    }

    #[test]
    fn a_page_is_whole_and_loads_nothing() {
        let mut leaf = sample::sample_equilibrium(21, 32);
        leaf.scenario = "a < b </script>".into();
        let page = html_page(&leaf, &scenario(21));
        assert!(page.len() < 1_000_000, "{}", page.len());
        assert!(page.contains("<title>a &lt; b &lt;/script&gt;</title>"));
        assert!(!page.contains("{{"));
        let outside = page.replace(THREE_JS, "");
        for load in ["src=", "href=\"", "@import", "url(", "import("] {
            assert!(!outside.contains(load), "{load}");
        }
        assert_eq!(outside.matches("</script>").count(), 3);
        let data = data(&page);
        assert_eq!(data["title"], "a < b </script>");
        assert_eq!(data["units"], serde_json::json!(["cm", null, null]));
        assert_eq!(data["leaves"][0]["nodes"], leaf.shape.stations.len());
    }

    /// A list of unknown length is no list of arguments: of 130,000 numbers browsers refuse.
    #[test]
    fn no_function_is_called_with_as_many_arguments_as_there_are_numbers() {
        let scripts = PAGE_SCRIPTS.concat();
        for call in ["Math.max(...", "Math.min(...", "push(...", "fromCharCode("] {
            for (at, _) in scripts.match_indices(call) {
                let arguments = &scripts[at + call.len()..];
                let line = arguments.lines().next().unwrap();
                assert!(arguments.starts_with('['), "{call}{line}");
            }
        }
    }

    #[test]
    fn a_motion_has_its_instants_and_energies() {
        let mut record = sample::sample_record(5, 8);
        record.film = record.stills.clone();
        let data = data(&html_page(&record, &scenario(5)));
        assert_eq!(data["leaves"].as_array().unwrap().len(), record.film.len());
        let curves = data["chart"]["curves"].as_array().unwrap();
        let names: Vec<&str> = curves.iter().filter_map(|c| c["name"].as_str()).collect();
        assert!(names.contains(&"kinetic") && names.contains(&"tip z"));
        assert!(!names.contains(&"work put in"), "{names:?}");
        // In the unit of lengths; that of forces has no name.
        let choices = &data["chart"]["choices"];
        let tip = "tip, from where it began / cm";
        assert_eq!(*choices, serde_json::json!(["energy", tip]));
    }

    #[test]
    fn of_a_wide_leaf_some_veins_are_drawn() {
        let data = data(&html_page(
            &sample::sample_equilibrium(401, 4),
            &scenario(401),
        ));
        let drawn = data["drawn"].as_array().unwrap();
        assert!(drawn.len() <= 202 && drawn[0] == 1 && *drawn.last().unwrap() == 401);
    }

    #[test]
    fn extreme_numbers_make_a_page() {
        for value in [f64::NAN, f64::INFINITY, 1e300] {
            let mut leaf = sample::sample_equilibrium(3, 8);
            leaf.shape.rods[1].nodes[3].position.z = value;
            leaf.energy = Some(value);
            data(&html_page(&leaf, &scenario(3)));
            let mut record = sample::sample_record(3, 8);
            record.moments[3].energy.kinetic = value;
            record.film = record.stills.clone();
            record.film[1].curves[0][2].x = value;
            data(&html_page(&record, &scenario(3)));
        }
    }
}
