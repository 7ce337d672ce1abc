//! Tables of shapes as the field has them: without names, divided by blanks, of DeepLabCut, ADEL and biomech.

use leafdyn::scenario::Scenario;
use leafdyn_testing::root;
use leafdyn_testing::workplace::Workplace;
use serde_json::Value;
use std::fs;

fn example(path: &str) -> String {
    fs::read_to_string(root().join("scenarios").join(path)).unwrap()
}

fn place() -> Workplace {
    let place = Workplace::new();
    place.write("leaf.toml", example("measured/posture.toml"));
    place.write("points.csv", example("measured/posture.csv"));
    place
}

/// The points of the example.
fn points() -> Vec<[f64; 2]> {
    let text = example("measured/posture.csv");
    let rows = text.lines().filter(|line| !line.starts_with('#')).skip(1);
    let rows = rows.map(|line| {
        let (x, z) = line.split_once(',').unwrap();
        [x.parse().unwrap(), z.parse().unwrap()]
    });
    rows.collect()
}

fn table(header: &str, row: impl Fn(usize, [f64; 2]) -> String) -> String {
    let rows: Vec<String> = points()
        .into_iter()
        .enumerate()
        .map(|(k, at)| row(k, at))
        .collect();
    format!("{header}{}\n", rows.join("\n"))
}

fn least(told: &Value) -> f64 {
    told["critical_young"]["value"].as_f64().unwrap()
}

fn told(place: &Workplace, run: &str) -> Value {
    place
        .run(format!("unbend {run} --json --write none"))
        .ends(0)
        .json()
}

fn refused(place: &Workplace, run: &str, parts: &[&str]) {
    let run = place.run(format!("{run} --write none")).ends(2);
    for part in parts {
        assert!(run.err.contains(part), "{part}: {}", run.err);
    }
}

#[test]
fn columns_without_names_are_given_by_number() {
    let place = place();
    let wanted = least(&told(&place, "leaf.toml --shape points.csv"));
    let same = |name: &str, table: String, columns: &str| {
        place.write(name, table);
        let found = least(&told(
            &place,
            &format!("leaf.toml --shape {name} {columns}"),
        ));
        assert!(
            (found / wanted - 1.0).abs() < 1e-4,
            "{name}: {found} {wanted}"
        );
    };
    same(
        "commas.csv",
        table("", |k, [x, z]| format!("{k},{x},{z}")),
        "--column 2=x --column 3=z",
    );
    same(
        "blanks.txt",
        table("", |_, [x, z]| format!("  {x}   {z}")),
        "--column 1=x --column 2=z",
    );
    same(
        "tabs.txt",
        table("# digitised\n", |_, [x, z]| format!("{x}\t{z}")),
        "--column 1=x --column 2=z",
    );
    // In mm, with decimal commas.
    same(
        "mm.txt",
        table("", |_, [x, z]| {
            format!("{};{}", 10.0 * x, 10.0 * z).replace('.', ",")
        }),
        "--column 1=x:0.1 --column 2=z:0.1",
    );
    same(
        "named.txt",
        table("x z\n", |_, [x, z]| format!("{x} {z}")),
        "",
    );
    same(
        "others.csv",
        table("along,up\n", |_, [x, z]| format!("{x},{z}")),
        "--column along=x --column up=z",
    );
    place.write("bare.csv", table("", |_, [x, z]| format!("{x},{z}")));
    refused(
        &place,
        "unbend leaf.toml --shape bare.csv --column 1=x --column 1=z",
        &["column 1=z: 1 is x already"],
    );
    refused(
        &place,
        "unbend leaf.toml --shape bare.csv",
        &["bare.csv:1", "no header", "1=x"],
    );
    refused(
        &place,
        "unbend leaf.toml --shape bare.csv --column 1=wide",
        &["wide is no quantity"],
    );
    place.write(
        "hole.csv",
        table("", |k, [x, z]| {
            if k == 3 {
                format!("{x},")
            } else {
                format!("{x},{z}")
            }
        }),
    );
    // The fourth line of a file without a header.
    refused(
        &place,
        "unbend leaf.toml --shape hole.csv --column 1=x --column 2=z",
        &["hole.csv:4", "z is empty"],
    );
    refused(&place, "relax leaf.toml --column 1=x", &["--start"]);
}

/// A table of DeepLabCut: pixels, with z down, of body parts in two frames.
fn video(frames: usize, likelihood: &str) -> String {
    let points = points();
    let line = |name: &str, cells: &dyn Fn(usize) -> String| {
        let cells: Vec<String> = (0..points.len()).map(cells).collect();
        format!("{name},{}\n", cells.join(","))
    };
    let mut text = line("scorer", &|_| "net,net,net".into());
    text += &line("bodyparts", &|k| format!("p{k},p{k},p{k}"));
    text += &line("coords", &|_| "x,y,likelihood".into());
    for frame in 0..frames {
        text += &line(&frame.to_string(), &|k| {
            let [x, z] = points[k];
            // The fifth point is not seen.
            match k {
                5 => format!("{},{},{likelihood}", 1000.0, 0.0),
                _ => format!("{},{},0.99", 300.0 + 100.0 * x, 2000.0 - 100.0 * z),
            }
        });
    }
    text
}

#[test]
fn tables_of_deeplabcut_are_known_by_their_first_lines() {
    let place = place();
    let photo = "\n[photo]\nscale = 0.01\nx = 300.0\ny = 2000.0\n";
    place.write("leaf.toml", example("measured/posture.toml") + photo);
    place.write(
        "without.csv",
        table("x,z\n", |k, [x, z]| {
            if k == 5 {
                String::new()
            } else {
                format!("{x},{z}")
            }
        }),
    );
    let wanted = least(&told(&place, "leaf.toml --shape without.csv"));
    place.write("one.csv", video(1, "0.2"));
    let found = told(&place, "leaf.toml --shape one.csv");
    assert!(
        (least(&found) / wanted - 1.0).abs() < 1e-4,
        "{wanted} {}",
        least(&found)
    );
    assert!(
        found["remarks"][0].as_str().unwrap().contains("p0, p1"),
        "{}",
        found["remarks"]
    );
    place.write("two.csv", video(2, "nan"));
    refused(
        &place,
        "unbend leaf.toml --shape two.csv",
        &["two.csv:4", "2 frames", "column frame"],
    );
    let rows = place.run("unbend leaf.toml --shape two.csv --group frame --json --write none");
    assert_eq!(rows.ends(0).json()["postures"].as_array().unwrap().len(), 2);
    place.write(
        "herd.csv",
        video(1, "0.2").replacen("bodyparts", "individuals", 1),
    );
    refused(
        &place,
        "unbend leaf.toml --shape herd.csv",
        &["herd.csv:2", "individuals"],
    );
    // As a spreadsheet saves it.
    let saved = video(1, "0.2").replace(',', ";").replace('.', ",");
    place.write("saved.csv", saved);
    let found = told(&place, "leaf.toml --shape saved.csv");
    assert!((least(&found) / wanted - 1.0).abs() < 1e-4);
    let lines: Vec<String> = video(1, "0.2").lines().map(String::from).collect();
    place.write(
        "cut.csv",
        [&lines[0], &lines[2], &lines[3]]
            .map(|it| it.clone())
            .join("\n"),
    );
    let run = "unbend leaf.toml --shape cut.csv";
    refused(&place, run, &["cut.csv:2", "must begin with bodyparts"]);
    place.write("head.csv", lines[..3].join("\n"));
    let run = "unbend leaf.toml --shape head.csv";
    refused(&place, run, &["head.csv:3", "no row below", "frame"]);
}

#[test]
fn midribs_of_adel_are_in_centimetres() {
    let place = place();
    let wanted = least(&told(&place, "leaf.toml --shape points.csv"));
    let midribs = |leaves: usize| {
        let rows = (1..=leaves).map(|leaf| {
            table("", |_, [x, z]| {
                format!("\"Soissons\",1,{leaf},{leaf},{x},{z},4.5")
            })
        });
        format!(
            "\"variety\",\"plant\",\"rank\",\"inerv\",\"x\",\"y\",\"hins\"\n{}",
            rows.collect::<String>()
        )
    };
    place.write("one.csv", midribs(1));
    let found = told(&place, "leaf.toml --shape one.csv --format adel");
    assert!((least(&found) / wanted - 1.0).abs() < 1e-4);
    // In mm and N the modulus is a hundredth of that in N/cm2, and lengths are ten times those in cm.
    let mm = "--set units.length=mm --set leaf.length=240 --set section.thickness=0.35 \
              --set section.width={at=[0,0.4,1],value=[9,10,1]} --set section.mass_density=8e-10 --set load.g=[0,0,-9810]";
    let found = told(
        &place,
        &format!("leaf.toml --shape one.csv --format adel {mm}"),
    );
    assert!(
        (least(&found) / (0.01 * wanted) - 1.0).abs() < 1e-3,
        "{}",
        least(&found)
    );
    place.write("three.csv", midribs(3));
    refused(
        &place,
        "unbend leaf.toml --shape three.csv --format adel",
        &["3 leaves", "inerv"],
    );
    let rows = place
        .run("unbend leaf.toml --shape three.csv --format adel --group inerv --json --write none");
    assert_eq!(rows.ends(0).json()["postures"].as_array().unwrap().len(), 3);
    place.write("outline.csv", "rankclass,s,r\n1,0,0.5\n1,1,0\n");
    refused(
        &place,
        "unbend leaf.toml --shape outline.csv --format adel",
        &["outline, not a midrib", "section.width"],
    );
    place.write(
        "bare.toml",
        example("measured/posture.toml").replace("length = \"cm\"\n", ""),
    );
    refused(
        &place,
        "unbend bare.toml --shape one.csv --format adel",
        &["in cm", "units.length"],
    );
    refused(
        &place,
        "unbend leaf.toml --shape one.csv --format plant",
        &["--format", "adel, biomech"],
    );
}

/// The sections of a field sheet by hand: I2 of triangle, rectangle, triangle, ellipse and circle, and weights per length.
#[test]
fn a_field_sheet_of_biomech_has_sections_and_weights() {
    let place = place();
    place.write("palm.txt", example("field/palm.csv"));
    let bare = "name = \"palm\"\nunits = { length = \"m\", force = \"N\" }\n\
                leaf = { rods = 1, length = 1.0, fan = [0.0] }\n\
                stiffness = { torsion = 1, bending_2 = 1, bending_3 = 1, axial = inf, shear_2 = inf, shear_3 = inf }\n";
    place.write("palm.toml", bare);
    place
        .run("unbend palm.toml --shape palm.txt --format biomech --out out")
        .ends(0);
    let rest = Scenario::from_toml(&place.read("out/rest.toml")).unwrap();
    let young = 2e9 * least(&told(&place, "palm.toml --shape palm.txt --format biomech"));
    let sigma = [0.0, 1.34 / 4.22, 2.68 / 4.22, 3.45 / 4.22, 1.0];
    let second = [
        0.0755 * 0.0411_f64.powi(3) / 36.0,
        0.03291 * 0.0303_f64.powi(3) / 12.0,
        0.0181 * 0.02982_f64.powi(3) / 36.0,
        std::f64::consts::PI / 64.0 * 0.01144 * 0.01121_f64.powi(3),
        std::f64::consts::PI / 64.0 * 0.001_f64.powi(4),
    ];
    for (k, second) in second.into_iter().enumerate() {
        let found = rest.rods[0].couple_stiffness[1].at(sigma[k]) / young;
        assert!((found / second - 1.0).abs() < 1e-3, "{k}: {found} {second}");
    }
    let weight = [
        0.0,
        1.6029 / 1.34,
        1.5682 / 1.34,
        0.6209 / 0.77,
        0.2329 / 0.77,
    ];
    for (k, weight) in weight.into_iter().enumerate() {
        let found = rest.distributed.as_ref().unwrap()[0][2].at(sigma[k]);
        assert!(
            (found + 9.80665 * weight).abs() < 1e-9,
            "{k}: {found} {weight}"
        );
    }
    place.write(
        "short.txt",
        example("field/palm.csv")
            .lines()
            .take(11)
            .collect::<Vec<_>>()
            .join("\n"),
    );
    refused(
        &place,
        "unbend palm.toml --shape short.txt --format biomech",
        &["11 rows", "twelve", "mass_left"],
    );
    place.write(
        "type.txt",
        example("field/palm.csv").replacen("1\t2\t3", "1\t7\t3", 1),
    );
    refused(
        &place,
        "unbend palm.toml --shape type.txt --format biomech",
        &["type.txt:2", "type = 7", "ellipse"],
    );
    refused(
        &place,
        "unbend palm.toml --shape palm.txt --format biomech --set load.gravity=[0,0,-1]",
        &["load.gravity", "leave"],
    );
    place.write(
        "bare.toml",
        bare.replace("units", "#units")
            .replace(", force = \"N\"", ""),
    );
    refused(
        &place,
        "unbend bare.toml --shape palm.txt --format biomech",
        &["units.length"],
    );
}

/// A sheet in other units than m, kg and degrees is refused with the one that it was probably not written in; decimal
/// commas are read where others divide the cells.
#[test]
fn a_field_sheet_in_other_units_is_refused() {
    let place = place();
    let sheet = example("field/palm.csv");
    let with = |rows: &[usize], factor: f64| {
        let mut number = 0;
        let line = |line: &str| {
            if line.trim().is_empty() || line.starts_with('#') {
                return line.to_owned();
            }
            number += 1;
            if !rows.contains(&(number - 1)) {
                return line.to_owned();
            }
            let cell = |cell: &str| format!("{:?}", factor * cell.parse::<f64>().unwrap());
            line.split_whitespace()
                .map(cell)
                .collect::<Vec<_>>()
                .join("\t")
        };
        sheet.lines().map(line).collect::<Vec<_>>().join("\n")
    };
    place.write(
        "palm.toml",
        "name = \"palm\"\nunits = { length = \"m\", force = \"N\" }\n\
         leaf = { rods = 1, length = 1.0, fan = [0.0] }\n\
         stiffness = { torsion = 1, bending_2 = 1, bending_3 = 1, axial = inf, shear_2 = inf, shear_3 = inf }\n",
    );
    let lengths = [0, 2, 3, 6, 7, 8];
    let (sections, axis, masses) = ([2, 3], [0], [9, 10, 11]);
    for (what, text, part) in [
        (
            "lengths in mm",
            with(&lengths, 1e3),
            "in m, and masses in kg",
        ),
        (
            "lengths in cm",
            with(&lengths, 1e2),
            "in m, and masses in kg",
        ),
        (
            "sections in mm",
            with(&sections, 1e3),
            "in m, and masses in kg",
        ),
        ("distances in cm", with(&axis, 1e2), "both are in m"),
        ("masses in g", with(&masses, 1e3), "in m, and masses in kg"),
        (
            "radians",
            with(&[4], std::f64::consts::PI / 180.0),
            "are in degrees",
        ),
    ] {
        place.write("other.txt", text);
        let run = place
            .run("unbend palm.toml --shape other.txt --format biomech --write none")
            .ends(2);
        assert!(run.err.contains(part), "{what}: {}", run.err);
    }
    place.write("palm.txt", &sheet);
    place.write("commas.txt", sheet.replace('.', ","));
    let [points, commas] = ["palm.txt", "commas.txt"].map(|file| {
        told(
            &place,
            &format!("palm.toml --shape {file} --format biomech"),
        )
    });
    assert_eq!(points["critical_young"], commas["critical_young"]);
}

/// Rows without a header that can be read in two ways are refused.
#[test]
fn rows_without_a_header_that_are_ambiguous() {
    let place = place();
    let comma = |value: f64| format!("{value:.3}").replace('.', ",");
    let commas = table("", |_, [x, z]| format!("{},{}", comma(x), comma(z)));
    place.write("commas.csv", commas);
    let run = "unbend leaf.toml --shape commas.csv --column 1=x --column 2=z";
    refused(
        &place,
        run,
        &["commas.csv:1", "decimal commas", "semicolons"],
    );
    let semicolons = table("", |_, [x, z]| format!("{};{}", comma(x), comma(z)));
    place.write("semicolons.csv", semicolons);
    told(
        &place,
        "leaf.toml --shape semicolons.csv --column 1=x --column 2=z",
    );
    let counted = table("1,2\n", |_, [x, z]| format!("{x:.4},{z:.4}"));
    place.write("counted.csv", counted);
    let run = "unbend leaf.toml --shape counted.csv --column 1=x --column 2=z";
    refused(&place, run, &["counted.csv:1", "counts the columns"]);
    // Whole numbers of as many columns as are used.
    let whole = table("", |_, [x, z]| format!("{:.0},{:.0}", 100.0 * x, 100.0 * z));
    place.write("whole.csv", whole);
    told(
        &place,
        "leaf.toml --shape whole.csv --column 1=x:0.01 --column 2=z:0.01",
    );
}

/// Relative widths at fractions of the length, as ADEL has them: widest at 0.35 and pointed at the tip.
fn outline() -> Vec<[f64; 2]> {
    let width = |s: f64| match s < 0.35 {
        true => 1.0 - 0.3 * ((0.35 - s) / 0.35).powi(2),
        false => 1.0 - ((s - 0.35) / 0.65).powi(2),
    };
    let fractions = (0..20).map(|k| f64::from(k) / 19.0);
    // One of the fractions is that of the largest width, which is 1.
    let largest = fractions.clone().map(width).fold(0.0, f64::max);
    fractions.map(|s| [s, width(s) / largest]).collect()
}

/// The midrib of the first of the measured wheat leaves, in cm.
fn wheat_midrib() -> Vec<[f64; 2]> {
    let text = example("field/wheat.csv");
    let rows = text.lines().filter_map(|line| line.strip_prefix("1,"));
    let rows = rows.map(|row| {
        let (x, y) = row.split_once(',').unwrap();
        [x.parse().unwrap(), y.parse().unwrap()]
    });
    rows.collect()
}

fn outline_table(header: &str) -> String {
    let rows = outline().into_iter().map(|[s, r]| format!("{s},{r}"));
    format!("{header}\n{}\n", rows.collect::<Vec<_>>().join("\n"))
}

/// The area of a blade is that of its outline, and a posture is the same with the widths of the outline as with the same
/// numbers in the scenario.
#[test]
fn outlines_are_widths_of_the_scenario() {
    let place = place();
    place.write("wheat.toml", example("field/wheat.toml"));
    place.write("outline.csv", outline_table("s,r"));
    place
        .run("relax wheat.toml --outline outline.csv:1.5 --write surface --out out")
        .ends(0);
    let angles = place.read("out/angles.csv");
    let rows = angles.lines().skip(1);
    let area: f64 = rows
        .map(|row| row.split(',').next_back().unwrap().parse::<f64>().unwrap())
        .sum();
    let polygon: f64 = (outline().windows(2))
        .map(|pair| 0.5 * (pair[0][1] + pair[1][1]) * (pair[1][0] - pair[0][0]))
        .sum();
    assert!((area / (20.0 * 1.5 * polygon) - 1.0).abs() < 1e-3, "{area}");
    // The largest width of the scenario is 1.7.
    let midrib = wheat_midrib();
    assert_eq!(midrib.len(), outline().len());
    let points = midrib.iter().map(|[x, y]| format!("{x},{y}\n"));
    place.write("midrib.csv", format!("x,y\n{}", points.collect::<String>()));
    let values: Vec<f64> = outline().iter().map(|[_, r]| 1.7 * r.max(0.01)).collect();
    let at: Vec<f64> = outline().iter().map(|[s, _]| *s).collect();
    let set = format!("--set section.width={{at={at:?},value={values:?}}}").replace(", ", ",");
    let wanted = least(&told(
        &place,
        &format!("wheat.toml --shape midrib.csv --format adel {set}"),
    ));
    let found = least(&told(
        &place,
        "wheat.toml --shape midrib.csv --format adel --outline outline.csv",
    ));
    assert!((found / wanted - 1.0).abs() < 1e-9, "{found} {wanted}");
    assert!(
        (least(&told(&place, "wheat.toml --shape midrib.csv --format adel")) / wanted - 1.0).abs()
            > 1e-3
    );
    // Midrib and outline in one table, of one leaf and of several with outlines of their own.
    let both = |leaf: usize, wider: f64| {
        let rows = midrib.iter().zip(outline());
        let rows = rows.map(|([x, y], [s, r])| format!("{leaf},{x},{y},{s},{}\n", r.powf(wider)));
        rows.collect::<String>()
    };
    place.write("leaf.csv", format!("inerv,x,y,s,r\n{}", both(1, 1.0)));
    let run = told(&place, "wheat.toml --shape leaf.csv --format adel");
    assert!((least(&run) / wanted - 1.0).abs() < 1e-9);
    assert!(
        run["remarks"][0]
            .as_str()
            .unwrap()
            .contains("r times its largest width"),
        "{run}"
    );
    place.write(
        "leaves.csv",
        format!("inerv,x,y,s,r\n{}{}", both(1, 1.0), both(2, 0.3)),
    );
    let rows = place.run(
        "unbend wheat.toml --shape leaves.csv --format adel --group inerv --json --write none",
    );
    let rows = rows.ends(0).json();
    let young = |k: usize| rows["postures"][k]["critical_young"].as_f64().unwrap();
    assert!((young(0) / wanted - 1.0).abs() < 1e-9);
    assert!((young(1) / wanted - 1.0).abs() > 0.01);
}

#[test]
fn outlines_that_are_none_are_refused() {
    let place = place();
    place.write("outline.csv", outline_table("s,r"));
    let run = "relax leaf.toml --outline";
    for (table, parts) in [
        (outline_table("width,r"), &["has no columns s and r"][..]),
        (
            "s,r\n0,0\n0.5,1\n1,0.6\n".into(),
            &["pointed at its tip", "1 - s"],
        ),
        ("s,r\n0,1\n0.5,1\n0.4,0.6\n1,0\n".into(), &["must increase"]),
        ("s,r\n0,1\n5,1\n20,0\n".into(), &["s runs from 0 to 20"]),
        ("s,r\n0,1\n0.5,-1\n1,0\n".into(), &["must not be negative"]),
        (
            "rankclass,s,r\n1,0,1\n1,1,0\n2,0,1\n2,1,0\n".into(),
            &["several outlines", "rankclass"],
        ),
        ("s,r\n0,1\n0.5,\n1,0\n".into(), &["outline.csv:3", "empty"]),
    ] {
        place.write("outline.csv", table);
        refused(&place, &format!("{run} outline.csv"), parts);
    }
    place.write("outline.csv", outline_table("s,r"));
    refused(
        &place,
        &format!("{run} outline.csv:-1"),
        &["--outline", "greater than 0"],
    );
    place.write("numbers.toml", example("field/palm.toml"));
    refused(
        &place,
        "relax numbers.toml --outline outline.csv",
        &["--outline outline.csv", "[section]", "[blade]"],
    );
}
