//! The live page with a scenario in it, where the program was built with one.

use crate::report;
use serde::Serialize;

/// The page that `web/build.sh` makes.
#[cfg(feature = "live")]
const LIVE_PAGE: Option<&str> = Some(include_str!("../../web/dist/live.html"));

#[cfg(not(feature = "live"))]
const LIVE_PAGE: Option<&str> = None;

/// Where a scenario stands in it.
const SCENARIO_PLACEHOLDER: &str = "<script id=\"given\" type=\"application/json\">null</script>";

/// Why there is no page.
#[derive(Clone, Copy, Debug, thiserror::Error)]
#[error(
    "this program was built without the live page: run web/build.sh and build it again with --features live, \
     or open web/dist/live.html and drop the scenario on it"
)]
pub struct LivePageNotBuilt;

/// A slider of the page: a number with the ends of its range.
#[derive(Clone, Debug, Serialize)]
pub struct LiveSlider {
    /// The path of the number.
    pub key: String,
    /// The lowest value.
    pub low: f64,
    /// The highest value.
    pub high: f64,
    /// Whether it is logarithmic.
    pub log: bool,
}

/// The page, on which the scenario of this text is open with these sliders; without any it has some
/// that matter.
///
/// # Errors
/// If there is none.
pub fn live_page(
    text: &str,
    name: &str,
    sliders: &[LiveSlider],
) -> Result<String, LivePageNotBuilt> {
    #[derive(Serialize)]
    struct Given<'g> {
        text: &'g str,
        name: &'g str,
        sliders: &'g [LiveSlider],
    }
    let page = LIVE_PAGE.ok_or(LivePageNotBuilt)?;
    let given = Given {
        text,
        name,
        sliders,
    };
    let mut data = Vec::new();
    // Writing to memory cannot fail.
    let _ = report::write_json(&given, &mut data);
    // Within a script only `</script` and `<!--` are special.
    let data = String::from_utf8_lossy(&data).replace('<', "\\u003c");
    Ok(page.replacen(
        SCENARIO_PLACEHOLDER,
        &SCENARIO_PLACEHOLDER.replace("null", &data),
        1,
    ))
}

#[cfg(all(test, feature = "live"))]
mod tests {
    use super::*;

    #[test]
    fn a_scenario_stands_in_the_page_as_data() {
        let page = live_page("name = \"</script>\"", "a.toml", &[]).unwrap();
        assert!(page.contains("name = \\\"\\u003c/script>"));
        assert_eq!(page.matches("id=\"given\"").count(), 1);
    }
}
