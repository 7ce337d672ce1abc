//! Tables as instruments, spreadsheets and people write them give the numbers that they mean, and
//! what could mean two things is refused.

use leafdyn::study::{Data, DataFileOptions, FitRequest, MeasuredColumn, fit};
use leafdyn_testing::fit::{LEAF, request};
use leafdyn_testing::*;

/// What the tables below say of a tip that is pulled: force and place.
const PULLS: [[f64; 2]; 3] = [[-0.25, -0.0632], [-0.5, -0.1254], [-1.0, -0.2414]];

pub fn utf16(text: &str, unit: fn(u16) -> [u8; 2]) -> Vec<u8> {
    let units = std::iter::once(0xfeff).chain(text.encode_utf16());
    units.flat_map(unit).collect()
}

/// The table of [`PULLS`] with these columns, in a dialect: separator, decimal mark, line end.
fn pulls([separator, mark, end]: [&str; 3]) -> String {
    let rows = PULLS.map(|row| {
        row.map(|x| x.to_string().replace('.', mark))
            .join(separator)
    });
    let header = ["load.tip_force[2]", "tip_z"].join(separator);
    let lines = [vec![header], rows.to_vec()].concat();
    lines.iter().map(|line| format!("{line}{end}")).collect()
}

fn read_with(
    table: impl AsRef<[u8]>,
    veins: usize,
    columns: &[&str],
    every: usize,
) -> Result<Data, String> {
    let columns = columns.iter().map(|column| column.parse());
    let columns: Result<Vec<MeasuredColumn>, _> = columns.collect();
    let reading = DataFileOptions {
        columns: columns.map_err(|refused| refused.to_string())?,
        every: every.try_into().unwrap(),
        ..DataFileOptions::default()
    };
    let mut data = Data {
        reading,
        ..Data::default()
    };
    let read = data.read(table, "data.csv", veins);
    read.map(|()| data).map_err(|refused| refused.to_string())
}

pub fn read(table: impl AsRef<[u8]>) -> Result<Data, String> {
    read_with(table, 5, &[], 1)
}

/// Settings and results of every experiment, one after the other.
pub fn numbers(data: &Data) -> Vec<Vec<f64>> {
    let experiments = data.experiments.iter();
    let rows = experiments.map(|experiment| {
        let settings = experiment.settings.iter().map(|(_, value)| *value);
        let measured = experiment.measured.iter().filter_map(|one| one.value);
        settings.chain(measured).collect()
    });
    rows.collect()
}

/// What the report says of the only file.
fn said(data: &Data) -> String {
    let file = &data.files[0];
    [file.taken.join(", "), file.left_out.join(", ")].join(" | ")
}

#[test]
fn every_dialect_is_read_and_named() {
    let plain = pulls([",", ".", "\n"]);
    let tabs = pulls(["\t", ".", "\n"]);
    let german = pulls([";", ",", "\r\n"]);
    let with_first = |line: &str| format!("{line}\n{plain}");
    let cases: Vec<(&str, Vec<u8>, &str)> = vec![
        ("plain", plain.clone().into(), " | "),
        (
            "marked",
            with_first("").replace('\n', "\r\n").into_bytes(),
            " | ",
        ),
        (
            "semicolons",
            german.clone().into(),
            "cells divided by semicolons, decimal commas | ",
        ),
        ("tabs", tabs.clone().into(), "cells divided by tabs | "),
        ("order mark", format!("\u{feff}{plain}").into(), " | "),
        (
            "UTF-16, low byte first",
            utf16(&tabs, u16::to_le_bytes),
            "cells divided by tabs, text in UTF-16 | ",
        ),
        (
            "UTF-16, high byte first",
            utf16(&german, u16::to_be_bytes),
            "cells divided by semicolons, decimal commas, text in UTF-16 | ",
        ),
        (
            "minus signs",
            plain.replace("\n-", "\n\u{2212}").into(),
            " | ",
        ),
        (
            "units",
            plain.replacen('\n', "\n(N),(m)\n", 1).into(),
            " | a row of units ((N), (m); nothing is converted)",
        ),
        (
            "bare units",
            german.replacen('\n', "\nN;mm\n", 1).into(),
            "cells divided by semicolons, decimal commas | a row of units (N, mm; nothing is converted)",
        ),
        (
            "units that nobody knows, beside one that is known",
            german.replacen('\n', "\nN;Skt.\n", 1).into(),
            "cells divided by semicolons, decimal commas | a row of units (N, Skt.; nothing is converted)",
        ),
        (
            "blank rows",
            format!("{plain},\n,\n").into(),
            " | 2 blank rows",
        ),
        ("cells behind", plain.replace('\n', ",\n").into(), " | "),
        (
            "lines before",
            with_first("Specimen,leaf 3\nDate,2024-05-02\n").into(),
            " | 2 lines before the header",
        ),
        (
            "row numbers",
            plain
                .replace("load", ",load")
                .replace("\n-", "\n7,-")
                .into(),
            " | the first column, without a name",
        ),
        (
            "Latin-1",
            [b"Pr\xfcfling;3\n".as_slice(), german.as_bytes()].concat(),
            "cells divided by semicolons, decimal commas, text in Latin-1 | 1 line before the header",
        ),
        ("quoted", plain.replace("tip_z", "\"tip_z\"").into(), " | "),
    ];
    for (name, table, wanted) in cases {
        let data = read(table).unwrap_or_else(|refused| panic!("{name}: {refused}"));
        assert_eq!(numbers(&data), PULLS.map(|row| row.to_vec()), "{name}");
        assert_eq!(said(&data), wanted, "{name}");
    }
}

#[test]
fn names_have_commas_and_number_signs() {
    let table = "experiment,load.tip_force[2],tip_z\n\"leaf 1, upper\",-0.25,-0.0632\n\
                 #2,-0.5,-0.1254\n\"say \"\"ah\"\"\",-1.0,-0.2414\n";
    let data = read(table).unwrap();
    let names: Vec<_> = data
        .experiments
        .iter()
        .map(|one| one.name.as_str())
        .collect();
    assert_eq!(names, ["leaf 1, upper", "#2", "say \"ah\""]);
    assert_eq!(numbers(&data), PULLS.map(|row| row.to_vec()));
}

/// Numbers in the file, between spaces, and what they are, or a part of the refusal.
const MARKS: &str = "
    0,5 1,234 => 0.5 1.234
    0.5 1,234 => 0.5 1234
    1.234 => 1.234
    1.234 12 => 1.234 12
    0,5 1.234 => 0.5 1234
    1.234,5 -2.000 => 1234.5 -2000
    1,234.5 12 => 1234.5 12
    1.234.567 1,234 => 1234567 1.234
    1,5e-3 2E2 => 0.0015 200
    +,5 -7, => 0.5 -7
    1,234 => data.csv:2: 1,234 may be 1.234 or 1234, and no other number of the file tells which
    1,234 12 1.234 => 1,234 may be 1.234 or 1234
    0.5 0,5 => data.csv:2: 0.5 has a decimal point, and 0,5 in line 3 a decimal comma
    0,5 1.234 5678,5 => data.csv:3: 1.234 has its thousands divided, or another decimal mark, and 5678,5 in line 4 has not
    1,2,3 => must be a finite number
    12,34.5 => must be a finite number
    1,5 none => data.csv:3: tip_z = none: must be a finite number
";

/// What a comma means is decided by the other numbers of the file, or not at all.
#[test]
fn commas_are_not_guessed() {
    for (cells, wanted) in pairs(MARKS) {
        let rows = cells.split(' ').map(|cell| format!("{cell};\n"));
        let table = format!("tip_z;tip_x\n{}", rows.collect::<String>());
        match read(&table) {
            Ok(data) => {
                let wanted: Result<Vec<f64>, _> = wanted.split(' ').map(str::parse).collect();
                assert_eq!(numbers(&data).concat(), wanted.unwrap(), "{cells}");
            }
            Err(refused) => assert!(refused.contains(wanted), "{cells}: {refused}"),
        }
    }
}

/// Tables in lines between `|`, `=>` and a part of the refusal.
const REFUSED: &str = "
    Vein,,Margin,|X,Y,X,Y|0.9,-0.1,0.9,-0.2 => data.csv:2: unknown column Vein X: columns are keys
    X,Y,X,Y|0.9,-0.1,0.9,-0.2 => data.csv:1: the column X stands there twice (columns 1 and 3)
    ,Area,X,Y|1,0,898.08,450.56 => data.csv:1: unknown column Area
    load.tip_force[2],tip_z|-0,25,-0,06 => data.csv:2: has 4 cells, and the header 2
    Probe;3|Zeit;Kraft|s;N|1;2 => data.csv:2: unknown column Zeit
    made up|load.tip_force[2];tip_w|1;2 => data.csv:2: unknown column tip_w
    tip_z|1|load.tip_force[2],tip_z|1,2 => data.csv:1: names columns, and so does line 3
    -0.1,-0.2|slipped,again => data.csv:1: has no header
    tip_x tip_z|1 2|1 2 3 => data.csv:1: columns are divided by blanks
    tip_z,|0,25 => data.csv:1: column 2 has no name, and cells below
    experiment,tip_z|'a,1|b,2 => data.csv:2: a quotation mark is not closed
    x,y|1,1 => data.csv:1: points on veins need a column rod, from 1 to 5
    made up|rod,x,y,w|1,1,1,1 => data.csv:2: unknown column w
    made up|sd_tip_x;tip_z|1;2 => data.csv:2: sd_tip_x without tip_x
";

#[test]
fn what_cannot_be_read_is_explained() {
    for (lines, said) in pairs(REFUSED) {
        let refused = read(lines.replace('|', "\n").replace('\'', "\"")).unwrap_err();
        assert!(refused.contains(said), "{lines}: {refused}");
    }
    for (bytes, said) in [
        (b"PK\x03\x04".as_slice(), "export the table as CSV"),
        (b"t\0i\0p\0_\0z\0", "save the file as UTF-8"),
        (b"tip_z\n\x96" as &[u8], "save the file as UTF-8"),
        (b"tip_z\r1\r" as &[u8], "line ends of CR alone"),
    ] {
        let refused = read(bytes).unwrap_err();
        assert!(refused.contains(said), "{refused}");
    }
}

#[test]
fn columns_are_renamed_and_converted() {
    let machine = "Time;Standard force;Extension\ns;N;mm\n0,0;-0,25;-3,2\n0,1;-0,5;-65,4\n";
    let columns = [
        "Standard force=load.tip_force[2]",
        "Extension=tip_z:1e-3-0.06",
        "Extension=tip_x:-1e-3",
    ];
    let data = read_with(machine, 5, &columns, 1).unwrap();
    let wanted = [
        [-0.25, -3.2 * 1e-3 - 0.06, -3.2 * -1e-3],
        [-0.5, -65.4 * 1e-3 - 0.06, -65.4 * -1e-3],
    ];
    assert_eq!(numbers(&data), wanted);
    let said = said(&data);
    assert!(
        said.ends_with("(s, N, mm; nothing is converted), the column Time"),
        "{said}"
    );

    let digitised = " ,Area,Mean,X,Y\n1,0,255,898.08,450.56\n2,0,255,892.3199,500.32\n";
    let data = read_with(digitised, 1, &["X=x:1e-3", "Y=z:-1e-3+0.5"], 1).unwrap();
    let points: Vec<_> = data
        .traced
        .iter()
        .map(|point| (point.rod, point.coordinates))
        .collect();
    let at = |x: f64, y: f64| [Some(x * 1e-3), None, Some(y * -1e-3 + 0.5), None, None];
    assert_eq!(points, [(0, at(898.08, 450.56)), (0, at(892.3199, 500.32))]);

    // Names that stand there twice have those of their groups before them, and groups their own length.
    let groups = "Vein,,Margin,\nX,Y,X,Y\n0.9976,-0.0632,0.9,-0.1\n0.9904,-0.1254,,\n,,0.7,-0.3\n";
    let data = read_with(groups, 1, &["Vein X=x", "Vein Y=z"], 1).unwrap();
    let points: Vec<_> = data.traced.iter().map(|point| point.coordinates).collect();
    let at = |x, z| [Some(x), None, Some(z), None, None];
    assert_eq!(points, [at(0.9976, -0.0632), at(0.9904, -0.1254)]);
    assert_eq!(
        self::said(&data),
        " | 1 blank row, the columns Margin X, Margin Y"
    );

    let refused = read_with("A,X,X\n1,2,3\n", 1, &["X=x", "A=z"], 1).unwrap_err();
    assert!(refused.contains("data.csv:1: the column X stands there twice (columns 2 and 3)"));
    let refused = read_with("A,X,tip_z\n1,2,3\n", 1, &["X=tip_z"], 1).unwrap_err();
    assert!(
        refused.contains("the columns X and tip_z both are tip_z"),
        "{refused}"
    );
    for (column, said) in [
        ("Force", "write NAME=QUANTITY"),
        ("=tip_z", "write the name"),
        (
            "Force=tip_w",
            "tip_w is no quantity: keys of the scenario, results (tip_x",
        ),
        ("Force=load.tip_forc[2]", "did you mean load.tip_force?"),
        ("Force=tip_z:0", "a factor, which is not 0"),
        ("Force=tip_z:1e-3+", "a factor, which is not 0"),
        ("Force=experiment:2", "a name has no factor"),
    ] {
        let refused = read_with("Force\n1\n", 1, &[column], 1).unwrap_err();
        assert!(refused.contains(said), "{column}: {refused}");
    }
}

/// A column that no file has is refused: its quantity would be missing without a word.
#[test]
fn columns_that_no_file_has_are_refused() {
    let mut asked = request(base(LEAF, ""), &[], &["stiffness.bending_2"]);
    asked.data.reading.columns = vec!["Force=load.tip_force[2]".parse().unwrap()];
    asked
        .data
        .read(pulls([",", ".", "\n"]), "data.csv", 5)
        .unwrap();
    let refused = fit(&asked, &mut |_| {}).unwrap_err().to_string();
    let wanted = "no file of data has a column Force: data.csv has load.tip_force[2], tip_z";
    assert_eq!(refused, wanted);
}

#[test]
fn rows_are_thinned() {
    let rows: String = (0..10).map(|k| format!("{k},0.5\n")).collect();
    let table = format!("load.tip_force[2],tip_z\n{rows}");
    let data = read_with(&table, 5, &[], 4).unwrap();
    let forces: Vec<f64> = numbers(&data).iter().map(|row| row[0]).collect();
    assert_eq!(forces, [0.0, 4.0, 8.0]);
    assert_eq!(said(&data), "rows 1, 5, 9 and so on of 10 | ");
    let lines = data
        .experiments
        .iter()
        .map(|one| one.origin.as_ref().unwrap().line);
    assert_eq!(lines.collect::<Vec<_>>(), [2, 6, 10]);
}

#[test]
fn candidates_may_have_other_names() {
    let column = "Force=load.tip_force[2]".parse().unwrap();
    let table = "Force;tip_z\n0,5;\n";
    let found = FitRequest::read_candidates(table, "next.csv", &[column]).unwrap();
    assert_eq!(found[0].settings[0].1, 0.5);
}

/// Cells divided by blanks, and columns without names, which are given by their numbers.
#[test]
fn columns_of_bare_numbers_are_given_by_number() {
    let wanted: Vec<Vec<f64>> = PULLS.iter().map(|row| row.to_vec()).collect();
    let columns = ["1=load.tip_force[2]", "2=tip_z"];
    for table in [
        "-0.25 -0.0632\n-0.5 -0.1254\n-1.0 -0.2414\n",
        "# slipped at the end\n\n  -0.25\t  -0.0632\n  -0.5\t  -0.1254\n  -1\t  -0.2414\n",
        "-0.25,-0.0632\n-0.5,-0.1254\n-1.0,-0.2414\n",
        "-0,25;-0,0632\n-0,5;-0,1254\n-1,0;-0,2414\n",
    ] {
        let data = read_with(table, 5, &columns, 1).unwrap();
        assert_eq!(numbers(&data), wanted, "{table}");
    }
    let named = "load.tip_force[2]   tip_z\n-0.25 -0.0632\n-0.5   -0.1254\n-1.0  -0.2414\n";
    let data = read(named).unwrap();
    assert_eq!(numbers(&data), wanted);
    assert!(
        data.files[0]
            .taken
            .contains(&"cells divided by blanks".to_string())
    );
    let refused = read_with("-0.25,-0.0632\nslipped,1\n", 5, &columns, 1).unwrap_err();
    assert!(
        refused.contains("data.csv:2: load.tip_force[2] = slipped"),
        "{refused}"
    );
    let refused = read_with("-0.25,-0.0632\n", 5, &["3=tip_z"], 1).unwrap_err();
    assert!(
        refused.contains("none of the columns") && refused.contains("1, 2"),
        "{refused}"
    );
}
