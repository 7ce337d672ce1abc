//! What scripts and terminals get of failures: requests that cannot be met are refused in one
//! message, and one JSON object, before anything is written; never a control character.

use std::fs;

use leafdyn_testing::workplace::{Json, Run, Workplace, contains};

/// Requests, and a part of the message.
const REFUSED: &str = "
    relax leaf.toml --method newton => newton
    relax leaf.toml --method newton => semi-implicit
    relax leaf.toml --method implicit => semi-implicit
    relax absent.toml => absent.toml: cannot be read
    relax leaf.toml --segments few => invalid value 'few' for '--segments <N>'
    relax leaf.toml --set leaf.rods=0 => leaf.rods = 0: 
    relax leaf.toml --modes 101 => --modes
    relax leaf.toml --modes -1 => --modes
    relax leaf.toml --modes 3 --method shooting => --modes 3: modes are those of a relaxed leaf: use the method semi-implicit
    relax leaf.toml --modes 3 --method shooting-from-rest => --modes 3: modes are
    relax leaf.toml --modes all => --modes
    relax leaf.toml --method shooting --segments 8 => --segments 8: shooting has no grid
    relax leaf.toml --intervals 4 => --intervals 4: only the method shooting has intervals
    relax leaf.toml --method explicit --keep-unstable => --keep-unstable: explicit motion leaves unstable equilibria; use the method semi-implicit
    relax leaf.toml --method shooting --intervals 0 => --intervals 0: allowed are 1 to 4096
    relax leaf.toml --write pdf => pdf: must be some of json, csv, svg, png
    relax leaf.toml --write json,none => none: must be some of
    relax leaf.toml --write json, => must be some of
    relax leaf.toml --all --write csv => --write csv: this verb writes json, svg, png
    relax leaf.toml --stations 0 => --stations
    relax leaf.toml --stations many => --stations
    relax leaf.toml --margin --all => cannot be used with
    relax leaf.toml --margin --method shooting => --margin: a margin is that of a relaxed leaf
    relax leaf.toml --margin --set leaf.rods=1 --set load.tip_moment=[0,0,1] => dead moment
    check leaf.toml --intervals 0 => --intervals 0: allowed are
    check leaf.toml --intervals 5000 => 1 to 4096
    check leaf.toml --tolerance -1 => tolerance
    check leaf.toml --tolerance 1 => tolerance
    check leaf.toml --set leaf.rods=0 => rods
    check leaf.toml --segments 8 => --segments
    check leaf.toml --method shooting => --method
    check leaf.toml --out leaf.toml/out => --out DIR
    check absent.toml => absent.toml
    relax scenarios/motion/gust.toml => wind.velocity: a leaf comes to rest in steady wind only
    relax scenarios/motion/gust.toml --path release => wind.velocity: a leaf comes to rest in steady wind only
    relax scenarios/motion/gust.toml --path release --method explicit => [wind]: explicit relaxation does not
    relax scenarios/motion/gust.toml --keep-unstable => [wind]: the search for an equilibrium of any index does not
    relax scenarios/motion/gust.toml --method shooting => [wind]: shooting in wind that changes does not
    relax scenarios/motion/gust.toml --method shooting-from-rest => [wind]: shooting in wind that changes does not
    relax scenarios/motion/gust.toml --margin => [wind]: the margin does not
    relax scenarios/motion/gust.toml --all => [wind]: the search for all shapes does not
    relax scenarios/motion/gust.toml --sensitivity leaf.length => wind.velocity: a leaf comes to rest in steady wind only
    check scenarios/motion/gust.toml => [wind]: shooting in wind that changes does not
    trace scenarios/motion/gust.toml --vary leaf.length=20..30 => wind.velocity: a leaf comes to rest in steady wind only
    trace scenarios/motion/gust.toml --vary leaf.length=20..30 --vary section.young=1e5..2e5 => [wind]: a boundary of stability does not
    trace scenarios/motion/gust.toml --set wind.velocity=[1,0,0] --vary leaf.length=20..30 --switch => [wind]: following branches that cross does not
    trace scenarios/motion/gust.toml --set wind.velocity=[1,0,0] --vary leaf.length=20..30 --keep-unstable => [wind]: a start at an equilibrium of any index does not
    map scenarios/motion/gust.toml --vary leaf.length=20..30 => [wind]: a map does not
    chart scenarios/motion/gust.toml => [wind]: a chart does not
    simulate leaf.toml --step 0 => step 0: must be greater
    simulate leaf.toml --step -1 => step -1
    simulate leaf.toml --step nan => step NaN
    simulate leaf.toml --step 0.1 => stable up to 5.964e-3, because of shear with rotation: use a shorter step
    simulate leaf.toml --method explicit --set stiffness.shear_2=inf => no stable time step for rigid rods
    simulate leaf.toml --method shooting => semi-implicit
    simulate leaf.toml --segments 0 => --segments 0
    simulate leaf.toml --tolerance 1 => tolerance
    simulate leaf.toml --keep-unstable => --keep-unstable
    simulate leaf.toml --out leaf.toml/out => --out DIR
    simulate leaf.toml --resume => --resume is gone: a motion that is stopped has whole files up to its last output
    simulate leaf.toml --set dynamics.start=1 => start
    simulate absent.toml => absent.toml
    trace leaf.toml --vary coupling.y[5]=1..2 => --vary: with coupling.y[5]=1.0: coupling.y[5]: there
    map leaf.toml --vary coupling.y[5]=1..2 => --vary: with coupling.y[5]=1.0: coupling.y[5]: there
    map leaf.toml --set leaf.rods=0 --vary load.gravity[2]=1..2 => --set leaf.rods=0: leaf.rods
    chart leaf.toml --rods 3,0 => --rods: with leaf.rods=0: leaf.rods = 0: must be
    trace leaf.toml --vary load.gravity[2]=−1..-2 => write -1, with a hyphen as minus sign
    trace leaf.toml --vary load.gravity[2]=-1..‐2 => write -2, with a hyphen as minus sign
    trace leaf.toml --vary leaf.rods=3..9 => a whole number has nothing between
    trace leaf.toml --vary method.step=1e-3..1 => setting of a method
    trace leaf.toml --vary dynamics.density=1..2 => no equilibrium
    trace leaf.toml --vary solve.tolerance=1e-3..1e-6 => changes no leaf
    trace leaf.toml --vary load.gravity[2]=1..1 => the same
    trace leaf.toml --vary stiffness.axial=100..-5 => greater than 0
    trace leaf.toml --vary load.gravity[2]=0..1 --points 1 => 2 or more
    trace leaf.toml --vary load.gravity[2]=0..1 --cross-section 1 => unexpected argument '--cross-section'
    trace leaf.toml --vary load.gravity[2]=0..1 --tolerance 5 => tolerance
    trace leaf.toml --vary load.gravity[2]=0..1 --segments 0 => segments
    trace leaf.toml --vary load.gravity[2]=0..-1 --vary load.gravity[2]=0..-3 => varies twice
    trace leaf.toml --vary load.gravity[2]=0..-1 --vary load.gravity[1]+load.gravity[2]=0..-3 => varies twice
    trace leaf.toml --vary load.gravity[2]=0..-1 --vary leaf.rods=3..9 => a whole number has nothing between
    trace leaf.toml --vary load.gravity[2]=0..-1 --vary dynamics.density=1..2 => no equilibrium
    trace leaf.toml --vary load.gravity[2]=0..-1 --vary load.gravity[1]=1..1 => the same
    trace leaf.toml --vary load.gravity[2]=0..-1 --vary stiffness.axial=100..-5 => greater than 0
    trace leaf.toml --vary load.gravity[2]=0..-1 --vary load.gravity[1]=0..1 --vary load.gravity[0]=0..1 => 3 times
    trace leaf.toml --vary load.gravity[2]=0..-1 --vary load.gravity[1]=0..1 --map 16 => as 16x16
    trace leaf.toml --vary load.gravity[2]=0..-1 --vary load.gravity[1]=0..1 --map 0x4 => from 1 to 256
    trace leaf.toml --vary load.gravity[2]=0..-1 --vary load.gravity[1]=0..1 --map 4x1000 => from 1 to 256
    trace leaf.toml --vary rest.twist=0..1 --stations 4 => --stations 4: the files of this verb have none
    map leaf.toml => --vary
    map leaf.toml --vary stiffness.torsion=1 => has no ..
    map leaf.toml --vary stiffness.torsion[5]=1..2 => 5 entries
    map leaf.toml --vary rest.twist=0..1:2000 --vary rest.bend_2=0..1:2000 => at most 1000000
    map leaf.toml --vary stiffness.torsion=1..2:2 --vary stiffness.torsion=1..2:2 => varies twice
    map leaf.toml --vary stiffness.torsion=1..2:2 --vary rest.twist=0..1 --vary rest.bend_2=0..1 => one or two axes
    map leaf.toml --vary stiffness.torsion=1..2:2 --methods newton => semi-implicit
    map leaf.toml --vary stiffness.torsion=1..2:2 --methods explicit-motion => method.step
    map leaf.toml --vary stiffness.torsion=1..2:2 --set method.step=0 => greater than 0
    map leaf.toml --vary stiffness.torsion=1..2:2 --set method.steps=1 => method.step and method.segments
    map leaf.toml --vary stiffness.torsion=1..2:2 --cell-seconds 0 => cell-seconds
    map leaf.toml --vary stiffness.torsion=1..2:2 --tolerance 1 => tolerance
    map leaf.toml --vary stiffness.torsion=1..2:2 --shard 1/2 => --shard is gone: give each job a part of the range
    map leaf.toml --vary stiffness.torsion=1..2:2 --draw a.csv => --draw
    map leaf.toml --vary stiffness.torsion=1..2:2 --set leaf.rods=0 => rods
    map leaf.toml --vary stiffness.torsion=1..2:2 --out leaf.toml/out => --out DIR
    chart leaf.toml --seconds 0 => seconds 0: must be greater than 0
    chart leaf.toml --seconds -1 => seconds -1
    chart leaf.toml --seconds nan => seconds NaN
    chart leaf.toml --seconds 1e9 => at most 86400
    chart leaf.toml --methods newton => semi-implicit-grid
    chart leaf.toml --tolerance 1e-3 => --rods
    chart leaf.toml --tolerance 2 --rods 2 => --tolerance 2
    chart leaf.toml --rods 2,many => --rods
    chart leaf.toml --rods 2,0 => leaf.rods
    chart leaf.toml --set leaf.rods=0 => rods
    chart leaf.toml --out leaf.toml/out => --out DIR
    chart absent.toml => absent.toml
    chart => SCENARIO
    grow leaf.toml => grow
";

#[test]
fn bad_requests_are_refused_before_anything_is_written() {
    leafdyn_testing::workplace::all_refused("", REFUSED);
}

/// Messages of the library name an option where they are about one, not where a name is like it.
#[test]
fn a_file_named_like_an_option_is_a_file() {
    let place = Workplace::new();
    for file in ["step 1.toml", "modes = 3.toml"] {
        place.write(file, "leaf = { rod = 1 }");
        let run = place.command("relax").arg(file).output().unwrap();
        let run = Run::from(run).ends(2);
        assert!(
            run.err.starts_with(&format!("error: {file}:")),
            "{}",
            run.err
        );
    }
}

#[test]
fn help_is_the_same_with_json() {
    let place = Workplace::new();
    let help = place.ok("relax --help --json").out;
    assert!(help.starts_with("Find how a leaf"));
}

/// What was found is not lost with the files, and is one object, too.
#[test]
fn files_that_cannot_be_written_are_told_beside_the_result() {
    let place = Workplace::new();
    fs::create_dir_all(place.path("out/small/figure.svg/in")).unwrap();
    place.write("leaf2.toml", leafdyn_testing::workplace::leaf("two", 2));
    for verb in ["relax leaf.toml", "relax leaf.toml leaf2.toml"] {
        let run = place.run(format!("{verb} --json")).ends(2);
        let json = run.json();
        let json = if json.is_array() { &json[0] } else { &json };
        assert_eq!(json["outcome"], "converged");
        assert_eq!(json["exit_status"], 2);
        let error = json["error"].text();
        contains(error, &["cannot write out/small/figure.svg"]);
        assert_eq!(run.err.trim_end(), format!("error: {error}"));
    }
}

/// What a terminal gets of a run.
fn shown(run: Run) -> String {
    let all = run.out + &run.err;
    let mut characters = all.chars();
    let obeyed = characters.find(|c| c.is_control() && !matches!(c, '\n' | '\t'));
    assert_eq!(obeyed, None, "{all:?}");
    assert!(!all.contains(['\u{202e}', '\u{2066}']), "{all:?}");
    all
}

#[test]
fn control_characters_are_escaped() {
    let place = Workplace::new();
    let (esc, escaped) = ("\u{1b}[31m", "\\u{1b}[31m");
    let run = |arguments: &str| {
        let named = arguments.replace("NAME", &format!("{esc}\u{7}\u{202e}"));
        shown(place.run(named).ends(2))
    };
    for arguments in [
        "relax NAME.toml --json --write=none",
        "relax leaf.toml --set NAME=1",
        "relax leaf.toml --set leaf.fan=NAME",
        "relax leaf.toml --set name=NAME",
        "relax leaf.toml --set leaf.rods[NAME]=1",
        "relax leaf.toml --out leaf.toml/NAME",
        "chart leaf.toml --peers NAME",
    ] {
        let said = run(arguments);
        assert!(said.contains(escaped), "{arguments:?}: {said}");
    }
    // Of requests that are not understood they may also be left out.
    for arguments in [
        "relax leaf.toml --method NAME",
        "map leaf.toml --vary NAME=1..2",
        "trace leaf.toml --vary rest.twist=NAME",
        "relax leaf.toml --write NAME",
        "relax leaf.toml --NAME 1",
    ] {
        run(arguments);
    }
    // And those in a file: its name, a key, a value, a comment beside a slip.
    let file = format!("a{esc}.toml");
    for text in [
        format!("name = \"{esc}\""),
        format!("\"{esc}\" = 1"),
        format!("name = 3 # {esc}"),
        format!("name = \"a\"\nnamee = 3 # {esc}"),
        format!("{{\"{esc}\": 1}}"),
    ] {
        place.write(&file, text);
        contains(&run(&format!("relax {file}")), &[escaped]);
    }
    place.write(&file, leafdyn_testing::workplace::leaf("small", 2));
    let report = place.run(format!("relax {file} --out o{esc}"));
    contains(&shown(report), &["o\\u{1b}[31m: summary.json"]);
}
