//! One line of the report says what each file of data was taken for.

use leafdyn_testing::workplace::{Workplace, contains};

const VEIN: &str = r#"
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
    place.write("vein.toml", VEIN);
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
