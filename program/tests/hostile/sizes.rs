//! Requests that would take all memory, or days, are refused before they start;
//! numbers of any size break nothing; what is late says so.

use std::time::Instant;

use leafdyn_testing::workplace::{Json, Workplace, leaf};

#[test]
fn what_takes_more_memory_than_is_allowed_is_refused() {
    leafdyn_testing::workplace::all_refused(
        "relax leaf.toml",
        "
        --segments 100000 --memory 100MB => 5 rods of 100000 segments would take about 3.0 GB of memory, and 100.0 MB are allowed: use fewer rods or segments, or raise the limit with --memory
        --segments 1000 --memory 1e6 => and 1.0 MB are allowed
        --method shooting --memory 250kB => use fewer rods or intervals
        --method shooting --intervals 4000 --memory 500MB => shooting with 5 rods, intervals: 4000, would
        --method shooting --set leaf.rods=100000 => shooting with 100000 rods
        --method single-shooting --set leaf.rods=100000 => shooting with 100000 rods
        --memory 10kB => a scenario of 
        --stations 100000 --memory 100MB => 5 rods with 100000 stations would take about 625.0 MB of memory, and 100.0 MB are allowed: ask for fewer stations, or raise the limit with --memory
        --stations 1000000 --modes 100 --write csv --memory 500MB => 5 rods with 1000000 stations
        --all --stations 1000000 --memory 500MB => ask for fewer stations
        --memory lots => must be a size, as in 500MB or 2GB
        --memory=-1GB => must be a size
        ",
    );
    leafdyn_testing::workplace::all_refused(
        "",
        "
        check leaf.toml --intervals 4000 --memory 500MB => shooting with 5 rods
        check leaf.toml --set leaf.rods=100000 => shooting with 100000 rods
        simulate leaf.toml --stations 1000000 --memory 1GB => ask for fewer stations
        simulate leaf.toml --segments 100000 --memory 1GB => 5 rods of 100000 segments
        trace leaf.toml --segments 10000 --vary load.gravity[2]=-1..0 --memory 1GB => branches of 5 rods of 10000 segments
        map leaf.toml --vary load.gravity[2]=-1..0:1000 --vary load.gravity[0]=0..1:1000 --memory 1GB => lower the counts of the axes
        ",
    );
}

#[test]
fn as_much_as_is_allowed_is_used_and_no_more() {
    let place = Workplace::new();
    place.ok("relax leaf.toml --segments 100 --memory 10MB");
    // Refinement ends where memory does, and says so by its outcome.
    let summary = place.told(1, "relax leaf.toml --tolerance 1e-11 --memory 1300kB");
    assert_eq!(summary["outcome"], "tolerance-not-reached");
    let grids = summary["segments"].list();
    assert!(grids.iter().all(|n| n.count() <= 32), "{grids:?}");
}

/// Tissue so stiff that the whole matrix must be factorised, which is larger than the leaf on its
/// grid: that is no lack of stability.
#[test]
fn a_matrix_that_does_not_fit_is_named() {
    let place = Workplace::new();
    place.write("wide.toml", leaf("wide", 200));
    let stiff = "--set coupling.y=1e7 --set coupling.z=1e7 --full-model --segments 100";
    let run = place.run(format!(
        "relax wide.toml {stiff} --memory 123MB --write none"
    ));
    let run = run
        .ends(1)
        .says(&["does not fit into the memory that is allowed"]);
    assert!(!run.out.contains("lowers the energy"), "{}", run.out);
    place.ok(format!("relax wide.toml {stiff} --memory 2GB --write none"));
}

#[test]
fn a_large_scenario_is_weighed_before_it_is_parsed() {
    let place = Workplace::new();
    let comments = "# nothing but words, again and again\n".repeat(100_000);
    place.write("large.toml", leaf("large", 2) + &comments);
    let limited = "relax large.toml --memory 100MB";
    place.refuses(limited, "would take about 22");
    place.ok("relax large.toml --memory 1GB");
    // What a text takes when parsed depends on its tables and keys more than on its length.
    let numbers = format!("a = [{}]", "1.0, ".repeat(20_000));
    let keys = format!("a{} = 1\n", ".b".repeat(75)).repeat(660);
    let tables = format!("a = [{}]", "{a.b.c=1},".repeat(10_000));
    assert!(keys.len() < numbers.len() + 10_000 && tables.len() < numbers.len() + 10_000);
    place.write("numbers.toml", numbers);
    place.refuses("relax numbers.toml --memory 15MB", "unknown key a");
    for (name, text) in [("keys", keys), ("tables", tables)] {
        place.write(&format!("{name}.toml"), text);
        place.refuses(format!("relax {name}.toml --memory 40MB"), "a scenario of ");
    }
}

/// Numbers of rods that no scenario has, and sizes beyond all powers of ten.
#[test]
fn maps_over_numbers_of_any_size_are_drawn_or_refused() {
    for rods in ["-5..3:2", "1..1e9:2", "0..5:2", "-9e18..9e18:2"] {
        let place = Workplace::new();
        let vary = format!("--vary leaf.rods={rods} --vary coupling.y[0]=0..1:2");
        let run = place.ok(format!("map leaf.toml {vary} --methods semi-implicit"));
        run.says(&["refused"]);
        place.picture("out/small/map");
    }
    leafdyn_testing::workplace::all_refused(
        "map leaf.toml",
        "
        --vary stiffness.bending_2=1e308..1e308:3 => of a size from 1e-100 to 1e100
        --vary load.gravity[2]=1e307..1.7e308:3 => of a size from
        --vary load.gravity[2]=-1.7e308..1.7e308:3 => of a size from
        --vary load.gravity[2]=1e-300..1:3log => of a size from
        ",
    );
    let place = Workplace::new();
    for vary in ["1e99..1e100:3", "-1e100..1e100:2", "1e-100..1e100:3log"] {
        let asked = format!("map leaf.toml --vary load.gravity[2]={vary} --out out/{vary}");
        place.ok(format!("{asked} --methods semi-implicit"));
        let picture = place.picture(&format!("out/{vary}/map"));
        assert!(!picture.contains("inf"), "{vary}");
    }
}

#[test]
fn a_cell_keeps_its_time_whatever_its_grid() {
    let clock = Instant::now();
    let place = Workplace::new();
    let one = "map leaf.toml --set leaf.rods=1 --set coupling.y=0 --set coupling.z=0";
    for slow in [
        "--vary method.segments=8..1e6:2log --cell-seconds 0.5",
        "--set method.segments=4000000 --vary load.gravity[2]=-1..0:2 --cell-seconds 1 --out fixed",
    ] {
        place.ok(format!("{one} {slow}")).says(&["out-of-time"]);
    }
    let seconds = clock.elapsed().as_secs();
    assert!(seconds < 60, "{seconds} s");
    // A grid that takes longer to build than a cell may last is not begun.
    let place = Workplace::new();
    let huge = "--set leaf.rods=1 --set method.segments=1000000 --methods semi-implicit";
    let how = "--vary load.gravity[2]=-1..-2:2 --cell-seconds 1 --write csv";
    let map = place.ok(format!("map leaf.toml {huge} {how}"));
    map.says(&["out-of-time"]);
    let rows = place.read("out/small/map.csv");
    let late = rows.matches("1000000 nodes take longer than 1 s");
    assert_eq!(late.count(), 2);
}

#[test]
fn a_simulation_of_weeks_is_refused_before_it_starts() {
    let place = Workplace::new();
    for method in ["explicit", "semi-implicit"] {
        let steps = "the time step of 1.000e-12 makes 1.0e13 steps, which take some";
        let short = format!("simulate leaf.toml --method {method} --step 1e-12");
        place.refuses(short, steps);
    }
    let stiff = "--set stiffness.torsion=1e12 --set dynamics.section_radius=1e-6";
    let most = "at most 3 are allowed";
    place.refuses(
        format!("simulate leaf.toml --method explicit {stiff}"),
        most,
    );
}

/// A vein with a kink whose shooting takes several intervals: its grid is that of
/// 32 segments refined, and cut otherwise than one of 256 would be.
#[test]
fn stations_of_a_profile_with_knots_are_compared_by_place() {
    let place = Workplace::new();
    let knots = "{ at = [0.0, 0.3404, 1.0], value = [1.0, 2.0, 0.2] }";
    let text = leaf("knots", 1)
        .replace("bending_2 = 1.0", &format!("bending_2 = {knots}"))
        .replace("-1.0]", "-3000.0]");
    place.write("knots.toml", text);
    let check = place.ok("check knots.toml --json").json();
    assert_eq!(check["verdict"], "agree");
    assert_eq!(check["within_estimates"], true);
    let [stations, along] = ["stations", "differences"].map(|key| check[key].list().len());
    assert_eq!(stations, along);
    let trace = "trace knots.toml --vary load.gravity[2]=-3000..-2900:2";
    assert_eq!(place.told(0, trace)["complete"], true);
}
