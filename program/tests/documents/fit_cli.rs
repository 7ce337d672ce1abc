//! What a fit draws, and what its report says of the files of data that it read.

use leafdyn_testing::workplace::{Workplace, contains};

const VEIN: &str = r#"
    name = "vein"
    units = { length = "cm", force = "N" }
    leaf = { rods = 1, length = 10.0, fan = [0.0] }
    stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = 50.0, shear_2 = 40.0, shear_3 = 40.0 }
    load = { gravity = [0.0, 0.0, -1e-4] }
"#;

/// Two experiments have one result, two the other.
const PULLS: &str = "load.tip_force[2],tip_x,tip_z
-1e-3,,-0.40
-2e-3,,-0.70
-3e-3,9.93,
-4e-3,9.89,
";

const PHOTOGRAPH: &str = "rod,x,z\n1,2.5,-0.02\n1,5.0,-0.05\n1,7.5,-0.09\n1,10.0,-0.13\n";

/// The figure of a fit to such experiments, and what it says.
fn figure(experiments: &str, photograph: &str) -> (String, String) {
    let place = Workplace::new();
    place.write("vein.toml", VEIN);
    place.write("pulls.csv", experiments);
    let mut data = "--data pulls.csv".to_string();
    if !photograph.is_empty() {
        place.write("photograph.csv", photograph);
        data += " --data photograph.csv";
    }
    let run = place.run(format!(
        "fit vein.toml {data} --free stiffness.bending_2 --write svg --out out"
    ));
    (place.read("out/fit.svg"), run.out)
}

fn groups<'s>(svg: &'s str, name: &str) -> Vec<&'s str> {
    let start = format!("<g class=\"{name}\">");
    let groups = svg.split(start.as_str()).skip(1);
    groups.flat_map(|rest| rest.split("</g>").next()).collect()
}

/// Results are drawn along the column that varies, axes have words and units, and there is no view
/// in which nothing was measured; counts of one are no plurals.
#[test]
fn panels_are_those_of_the_data() {
    let (svg, out) = figure(PULLS, PHOTOGRAPH);
    contains(&out, &["vein: fit of 1 number to 12 data"]);
    let misfit = out.split_once("standard deviation ").unwrap().1;
    let sd = misfit.split(' ').next().unwrap();
    let parts = [
        "12 data, 1 free number",
        ">z of the tip / cm<",
        ">x of the tip / cm<",
        ">x / cm<",
        ">z / cm<",
        ">traced veins, from the side<",
    ];
    contains(&svg, &parts);
    contains(&svg, &[&format!("residuals of {sd}")]);
    assert!(!svg.contains("free numbers") && !svg.contains("from above"));
    let [tip_z, tip_x] = groups(&svg, "result")[..] else {
        panic!("two panels of results");
    };
    for panel in [tip_z, tip_x] {
        contains(
            panel,
            &[">force on the tip along z / 10⁻³ N<", "data less model"],
        );
        assert!(!panel.contains(">experiment<"));
    }
    // From a pull of 1 mN to one of 2, and from 3 to 4.
    assert!(
        tip_z.contains(">\u{2212}1.6<") && !tip_z.contains(">\u{2212}3.6<"),
        "{tip_z}"
    );
    assert!(
        tip_x.contains(">\u{2212}3.6<") && !tip_x.contains(">\u{2212}1.6<"),
        "{tip_x}"
    );
}

/// The numbers are drawn with the intervals that are written.
#[test]
fn intervals_are_those_of_the_numbers() {
    let (svg, out) = figure(PULLS, PHOTOGRAPH);
    let (_, told) = out.split_once("stiffness.bending_2 = ").unwrap();
    let (value, rest) = told.split_once(" N cm² (95 %: ").unwrap();
    let interval = rest.split(')').next().unwrap();
    let [numbers] = groups(&svg, "numbers")[..] else {
        panic!("one panel of numbers");
    };
    let text = format!(">{value} ({interval}) N cm²<");
    contains(numbers, &[">bending stiffness A2<", &text]);
}

/// Experiments between which more than one column varies keep their numbers, as in the data.
#[test]
fn experiments_without_one_varied_column_have_numbers() {
    let experiments = "load.tip_force[1],load.tip_force[2],tip_y
0,-1e-3,0.001
2e-3,-1e-3,0.65
2e-3,-2e-3,0.66
1e-3,0,0.33
";
    let (svg, _) = figure(experiments, "");
    let [panel] = groups(&svg, "result")[..] else {
        panic!("one panel of results");
    };
    contains(panel, &[">experiment<", ">1<", ">4<"]);
    assert!(!panel.contains("force on the tip"));
}

const UNLOADED_VEIN: &str = r#"
    name = "vein"
    leaf = { rods = 1, length = 1.0, fan = [0.0] }
    stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = inf, shear_2 = inf, shear_3 = inf }
    load = { tip_force = [0.0, 0.0, 0.0] }
"#;

/// As a testing machine with a German language exports it.
const MACHINE: &str = "Probe;3\r\nZeit;Kraft;Weg\r\ns;N;mm\r\n0,1;-0,25;63,2\r\n0,2;-9,9;0,0\r\n\
                       0,3;-0,75;185,4\r\n0,4;-9,9;0,0\r\n0,5;-1,25;292,6\r\n;;\r\n";

#[test]
fn files_of_a_machine() {
    let place = Workplace::new();
    place.write("vein.toml", UNLOADED_VEIN);
    place.write("machine.csv", MACHINE);
    place.write("plain.csv", "load.tip_force[2],tip_z\n-0.5,-0.1254\n");
    let fit = "fit vein.toml --free stiffness.bending_2 --write none --data plain.csv --data";
    let columns = "--column Kraft=load.tip_force[2] --column Weg=tip_z:-1e-3";
    let run = place.ok(format!("{fit} machine.csv {columns} --every 2"));
    let lines = [
        "vein: fit of 1 number to 4 data",
        "plain.csv: 1 row; rows 1, 3, 5 and so on of 1",
        "machine.csv: 3 rows; cells divided by semicolons; decimal commas; rows 1, 3, 5 and so on of 5; \
         left out: 1 line before the header, a row of units (s, N, mm; nothing is converted), \
         1 blank row, the column Zeit",
    ];
    contains(&run.out, &lines);
    for (options, said) in [
        ("", "machine.csv:2: unknown column Zeit: columns are keys"),
        ("--every 0", "must be a whole number from 1"),
        ("--column Kraft", "write NAME=QUANTITY"),
    ] {
        let run = place.run(format!("{fit} machine.csv {options}"));
        contains(&run.err, &[said]);
    }
}
