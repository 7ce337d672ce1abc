//! The figure of a trace: what can be chosen, what is left out, and that nothing in it
//! covers or leaves anything else.

use leafdyn_testing::workplace::{Workplace, contains};

/// The figure of a trace of these arguments.
fn figure(arguments: &str) -> String {
    let place = Workplace::new();
    let run = place.run(format!("trace {arguments} --write svg --out out"));
    run.ends(0);
    place.read("out/trace.svg")
}

/// What the groups of a name hold.
fn groups<'s>(svg: &'s str, name: &str) -> Vec<&'s str> {
    let start = format!("<g class=\"{name}\">");
    let groups = svg.split(start.as_str()).skip(1);
    groups.flat_map(|rest| rest.split("</g>").next()).collect()
}

fn attribute(tag: &str, name: &str) -> Option<f64> {
    let (_, rest) = tag.split_once(&format!("{name}=\""))?;
    rest.split('"').next()?.parse().ok()
}

/// Texts with their places.
fn texts(group: &str) -> Vec<(String, [f64; 2])> {
    let tags = group.split("<text").skip(1);
    let placed = tags.filter_map(|tag| {
        let text = tag.split('>').nth(1)?.split('<').next()?;
        let at = [attribute(tag, " x")?, attribute(tag, " y")?];
        Some((text.to_string(), at))
    });
    placed.collect()
}

/// Pitchforks: a leaf of two veins that is pushed in its plane.
const PITCHFORK: &str =
    "scenarios/classic/lens_coupled.toml --vary load.tip_force[0]=0..-5 --switch";

#[test]
fn the_quantity_is_chosen_and_each_has_a_panel() {
    let svg = figure(&format!("{PITCHFORK} --show x,energy,twist"));
    let panels = groups(&svg, "branches");
    assert_eq!(panels.len(), 3);
    assert!(svg.contains(">force on the tip along x<") && !svg.contains("load.tip_force"));
    // A twist that is rounding is drawn as none: its axis is wider.
    let names = [">x of the tip<", ">energy<", ">mean twist / 10⁻⁹ rad<"];
    for (panel, name) in panels.iter().zip(names) {
        assert!(panel.contains(name), "{name}");
    }
    let svg = figure("scenarios/classic/lens_coupled.toml --vary load.tip_force[0]=0..-1");
    assert!(svg.contains(">stable equilibria<"));
    for absent in ["unstable", "branches cross", "stroke-dasharray"] {
        assert!(!svg.contains(absent), "{absent}");
    }
}

/// The coordinates of a path of straight lines.
fn coordinates(path: &str) -> Vec<f64> {
    let (_, path) = path.split_once("d=\"M").unwrap();
    let path = path.split(['Z', '"']).next().unwrap();
    let numbers = path.split([' ', 'L']).map(|number| number.parse().unwrap());
    numbers.collect()
}

#[test]
fn a_pitchfork_is_drawn_as_it_is() {
    let svg = figure(PITCHFORK);
    // The key and the title name what there is.
    let parts = [
        "stable drawn solid, unstable dashed",
        "branches cross",
        ">z of the tip<",
    ];
    contains(&svg, &parts);
    assert!(!svg.contains(">fold<"));
    assert!(groups(&svg, "law").is_empty(), "forces are no law here");
    let linear = figure("scenarios/classic/lens_coupled.toml --vary load.tip_force[0]=0..-0.1");
    let ([panel], [leaves], [law]) = (
        &groups(&svg, "branches")[..],
        &groups(&svg, "leaves")[..],
        &groups(&linear, "law")[..],
    ) else {
        panic!("one of each")
    };
    // Leaves that look the same are drawn once: from where the branches cross the flat leaf
    // does not change any more.
    let all = texts(leaves).into_iter().map(|(text, _)| text);
    let captions: Vec<String> = all.filter(|text| text.starts_with("at ")).collect();
    for (part, count) in [("index 1", 0), ("\u{2212}5, stable", 2)] {
        let with = captions.iter().filter(|caption| caption.contains(part));
        assert_eq!(with.count(), count, "{captions:?}");
    }
    // Numbers beside points do not touch.
    let digits = |text: &str| text.chars().all(|c| c.is_ascii_digit() || ", ".contains(c));
    let numbers: Vec<(String, [f64; 2])> = (texts(panel).into_iter())
        .filter(|(text, at)| digits(text) && at[0] > 64.0 && at[1] < 478.0)
        .collect();
    assert!(numbers.len() >= 3, "{numbers:?}");
    for (k, (one, a)) in numbers.iter().enumerate() {
        for (other, b) in &numbers[..k] {
            let apart = (a[0] - b[0]).abs() > 8.0 || (a[1] - b[1]).abs() > 10.0;
            assert!(apart, "{one} and {other}");
        }
    }
    // The line of the force law ends within its frame.
    let path = |part: &str| coordinates(law.lines().find(|line| line.contains(part)).unwrap());
    let ends = path("stroke=\"#d55e00\"");
    assert_eq!(ends.len(), 4);
    // The frame is the rectangle, the only closed path without a fill.
    let corners = path("Z\" stroke");
    // Not cut off at the frame, but ending inside.
    for end in ends.chunks(2) {
        for (at, low, high) in [
            (end[0], corners[0], corners[2]),
            (end[1], corners[1], corners[5]),
        ] {
            assert!(at > low + 2.0 && at < high - 2.0, "{at} in {low} to {high}");
        }
    }
}

#[test]
fn what_varies_by_its_logarithm_has_a_logarithmic_axis() {
    let leaf = "scenarios/paper/fig04.toml --set leaf.rods=3";
    let svg = figure(&format!("{leaf} --vary load.gravity[2]=-0.1..-10log"));
    let decades = ["\u{2212}10⁻¹", "\u{2212}10⁰", "\u{2212}10¹"].map(|decade| {
        let found = texts(&svg).into_iter().find(|(text, _)| text == decade);
        found.unwrap_or_else(|| panic!("{decade}")).1[0]
    });
    let [first, second] = [decades[1] - decades[0], decades[2] - decades[1]];
    assert!((first - second).abs() < 0.1 && first > 100.0, "{decades:?}");
}

#[test]
fn a_force_that_moves_nothing_has_no_law() {
    let svg = figure("scenarios/classic/elastica_buckled.toml --vary load.tip_force[0]=0..-2");
    assert!(groups(&svg, "law").is_empty());
}

/// Of leaves whose differences are invisible in a small panel one is drawn.
#[test]
fn leaves_are_drawn_only_where_they_look_different() {
    let leaf = "scenarios/paper/fig04.toml --set leaf.rods=3";
    for (to, count) in [("-1.01", 1), ("-50", 3)] {
        let svg = figure(&format!("{leaf} --vary load.gravity[2]=-1..{to}"));
        let [leaves] = groups(&svg, "leaves")[..] else {
            panic!("one group of leaves")
        };
        assert_eq!(leaves.matches(">at ").count(), count, "to {to}");
    }
}

/// A leaf that buckles, without the branches into which it does: drawn is the coordinate along which it buckles, with the room in which
/// they would be, and what would draw them.
#[test]
fn a_branch_that_is_left_shows_where_to() {
    let svg = figure("scenarios/classic/lens_coupled.toml --vary load.tip_force[0]=0..-5");
    let parts = [
        ">z of the tip<",
        "branches cross",
        "--switch follows the buckled",
    ];
    contains(&svg, &parts);
    assert!(!svg.contains("10⁹"));
    let ends = figure(PITCHFORK);
    assert_eq!(ends.matches("to the end of the range").count(), 1);
}
