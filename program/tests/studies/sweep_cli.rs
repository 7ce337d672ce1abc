//! `relax --vary`: a row a leaf, each as a leaf relaxed alone; forces on the base and frequencies as closed
//! forms have them, within the errors that stand beside them; leaves that are refused are rows.

use leafdyn_testing::workplace::{Json, Workplace, all_refused, contains};

/// A straight rod without weight that is clamped.
const ROD: &str = r#"
name = "rod"
leaf = { rods = 1, length = 1.0, fan = [0.0] }
stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = inf, shear_2 = inf, shear_3 = inf }
dynamics = { density = 1.0 }
"#;

/// The rows of a table by the names of its columns.
struct Rows {
    names: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Rows {
    fn read(place: &Workplace, file: &str) -> Rows {
        let mut reader = csv::Reader::from_path(place.path(file)).unwrap();
        let names = reader.headers().unwrap().iter().map(String::from).collect();
        let rows = reader.records().map(|row| {
            let row = row.unwrap();
            row.iter().map(String::from).collect()
        });
        Rows {
            names,
            rows: rows.collect(),
        }
    }

    #[track_caller]
    fn text(&self, row: usize, name: &str) -> &str {
        let at = self.names.iter().position(|it| it == name);
        &self.rows[row][at.unwrap_or_else(|| panic!("{name} of {:?}", self.names))]
    }

    #[track_caller]
    fn number(&self, row: usize, name: &str) -> f64 {
        let text = self.text(row, name);
        let number = text.parse();
        number.unwrap_or_else(|_| panic!("{name} of row {row}: {text:?}"))
    }
}

/// Every row has the numbers that the leaf alone has, to the last bit; the last key varies fastest.
#[test]
fn rows_are_leaves_relaxed_alone() {
    let place = Workplace::new();
    place.ok("relax leaf.toml --vary load.gravity[2]=-1..-2:2 --vary leaf.rods=2..3:2");
    place.holds("out/small", "table.csv table.json table.png table.svg");
    let table = Rows::read(&place, "out/small/table.csv");
    assert_eq!(
        &table.names[..4],
        ["load.gravity[2]", "leaf.rods", "exit_status", "outcome"]
    );
    assert_eq!(table.rows.len(), 4);
    let json = place.json("out/small/table.json");
    for (row, (weight, rods)) in [("-1.0", "2"), ("-1.0", "3"), ("-2.0", "2"), ("-2.0", "3")]
        .into_iter()
        .enumerate()
    {
        assert_eq!(table.text(row, "load.gravity[2]"), weight);
        assert_eq!(table.text(row, "leaf.rods"), rods);
        let set = format!("--set load.gravity[2]={weight} --set leaf.rods={rods}");
        let alone = place.told(0, format!("relax leaf.toml {set} --write none --modes 3"));
        let tip: Vec<f64> = alone["tip"].list().iter().map(Json::number).collect();
        for (axis, x) in ["x", "y", "z"].into_iter().zip(tip) {
            assert_eq!(table.number(row, &format!("tip_{axis}")), x);
        }
        let base = &alone["base_reaction"];
        let error = base["error"].number();
        for (k, axis) in ["x", "y", "z"].into_iter().enumerate() {
            let name = format!("base_reaction_{axis}");
            assert_eq!(table.number(row, &name), base["force"][k].number());
            assert_eq!(table.number(row, &format!("{name}_error")), error);
        }
        assert_eq!(table.number(row, "energy"), alone["energy"].number());
        let lowest = alone["lowest_eigenvalues"][0].number();
        let frequency = lowest.sqrt() / std::f64::consts::TAU;
        assert_eq!(table.number(row, "frequency_1"), frequency);
        assert_eq!(table.text(row, "outcome"), "converged");
        assert_eq!(table.text(row, "exit_status"), "0");
        assert_eq!(table.text(row, "stable"), "true");
        assert_eq!(
            json["rows"][row]["tip_z"].number(),
            table.number(row, "tip_z")
        );
    }
    assert_eq!(
        (&json["leaves"], json["vary"][1].text()),
        (&4.into(), "leaf.rods")
    );
    let one = Rows::read(&place, "out/small/table.csv").rows;
    for threads in ["1", "2"] {
        let run =
            "relax leaf.toml --vary load.gravity[2]=-1..-2:2 --vary leaf.rods=2..3:2 --write csv";
        place.run_on(threads, run).ok();
        assert_eq!(
            Rows::read(&place, "out/small/table.csv").rows,
            one,
            "{threads} threads"
        );
    }
}

/// The support carries the whole weight, and frequencies grow with the root of all stiffnesses: both within
/// the errors in the table.
#[test]
fn errors_bound_what_closed_forms_tell() {
    let place = Workplace::new();
    place.ok("relax leaf.toml --vary load.gravity[2]=-0.5..-4:4 --write csv");
    let table = Rows::read(&place, "out/small/table.csv");
    for row in 0..4 {
        let weight = 5.0 * table.number(row, "load.gravity[2]");
        let away = (table.number(row, "base_reaction_z") - weight).abs();
        let bound = table.number(row, "base_reaction_z_error");
        assert!(away <= bound + 1e-14 && bound < 1e-3, "{away} {bound}");
    }
    place.write("rod.toml", ROD);
    let keys = "stiffness.torsion+stiffness.bending_2+stiffness.bending_3";
    place.ok(format!(
        "relax rod.toml --vary {keys}=1..4:2 --tolerance 1e-8 --write csv"
    ));
    let table = Rows::read(&place, "out/rod/table.csv");
    for mode in 1..=3 {
        let [value, bound] = [0, 1].map(|row| {
            [
                table.number(row, &format!("frequency_{mode}")),
                table.number(row, &format!("frequency_{mode}_error")),
            ]
        });
        let ([low, low_error], [high, high_error]) = (value, bound);
        let away = (high - 2.0 * low).abs();
        assert!(
            away <= high_error + 2.0 * low_error + 1e-14 * high,
            "{mode}: {away}"
        );
        // As accurate as was asked for.
        assert!(low_error <= 1e-8 * low, "{mode}: {low} {low_error}");
    }
}

/// A leaf that is refused is a row with its message, and the status is that of the worst leaf.
#[test]
fn refused_leaves_are_rows() {
    let place = Workplace::new();
    let run = place.run("relax leaf.toml --vary stiffness.torsion=-1..1:3");
    let run = run
        .ends(2)
        .says(&["1 of 3 at rest", "2 refused", "greater than 0"]);
    assert_eq!(run.err, "");
    let table = Rows::read(&place, "out/small/table.csv");
    let statuses: Vec<&str> = (0..3).map(|row| table.text(row, "exit_status")).collect();
    assert_eq!(statuses, ["2", "2", "0"]);
    assert_eq!(table.text(0, "outcome"), "refused");
    contains(
        table.text(0, "remark"),
        &["stiffness.torsion", "greater than 0"],
    );
    assert_eq!(table.text(0, "tip_x"), "");
    let alone = place.run("relax leaf.toml --set stiffness.torsion=1 --json --write none");
    assert_eq!(table.number(2, "tip_z"), alone.json()["tip"][2].number());
    // Not at rest within the tolerance on one coarse grid.
    let run =
        place.run("relax leaf.toml --vary load.gravity[2]=-1..-2000:2 --segments 4 --write csv");
    run.ends(1)
        .says(&["1 of 2 at rest within the tolerance, 1 not"]);
}

/// A fixed grid may vary, and converges with the second order.
#[test]
fn a_fixed_grid_may_vary() {
    let place = Workplace::new();
    place.ok("relax leaf.toml --vary method.segments=8..32:3 --modes 0 --write csv");
    let table = Rows::read(&place, "out/small/table.csv");
    let tips = [8, 20, 32].map(|n| {
        let row = (0..3).find(|&row| table.text(row, "method.segments") == n.to_string());
        table.number(row.unwrap(), "tip_z")
    });
    let exact = place.told(0, "relax leaf.toml --tolerance 1e-10 --write none");
    let exact = exact["tip"][2].number();
    let orders = [0, 1].map(|k| {
        let [fine, coarse] = [tips[k + 1] - exact, tips[k] - exact].map(f64::abs);
        (coarse / fine).ln() / (f64::from([20, 32][k]) / f64::from([8, 20][k])).ln()
    });
    assert!(
        orders.iter().all(|order| (order - 2.0).abs() < 0.1),
        "{orders:?}"
    );
}

/// The figure shows columns, with one curve for every value of a second number, or cells.
#[test]
fn the_figure_shows_any_column() {
    let place = Workplace::new();
    let vary = "--vary load.gravity[2]=-1..-3:3 --vary coupling.y+coupling.z=1..2:2";
    let run = place.ok(format!(
        "relax leaf.toml {vary} --show frequency_1,base_reaction_z"
    ));
    run.says(&["6 of 6 at rest", "frequency_1 from", "base_reaction_z from"]);
    let picture = place.picture("out/small/table");
    contains(
        &picture,
        &["frequency 1", "force on the base along z", "= 2.0"],
    );
}

#[test]
fn several_scenarios_have_a_table_each() {
    let place = Workplace::new();
    place.write("rod.toml", ROD);
    place.ok("relax leaf.toml rod.toml --vary stiffness.torsion=1..2:2 --write csv");
    place.holds("out", "rod small tables.csv");
    place.holds("out/rod", "table.csv");
    assert_eq!(Rows::read(&place, "out/small/table.csv").rows.len(), 2);
}

#[test]
fn what_cannot_vary_is_refused() {
    all_refused(
        "relax leaf.toml",
        "--vary stiffness.torsion=1..2 --all => cannot be used with
         --vary stiffness.torsion=1..2 --margin => cannot be used with
         --vary stiffness.torsion=1..2 --sensitivity leaf.length => cannot be used with
         --vary stiffness.torsion=1..2 --veins auto => vary leaf.rods
         --vary stiffness.torsion=1..2 --stations 3 => --stations 3
         --vary stiffness.torsion=1..2 --show remark => --show remark: is no number
         --vary stiffness.torsion=1..2 --show frequency_9 => ask for it by --modes 9
         --vary stiffness.torsion=1..2 --show tip => tip: must be tip_x
         --vary method.step=1..2 => no time step
         --vary stiffness.torsion=1..2 --vary stiffness.torsion=3..4 => varies twice
         --vary coupling.y[9]=1..2 => coupling.y[9]
         --vary stiffness.torsion=1..2 --tolerance 2 => --tolerance 2
         --show tip_z => --vary",
    );
}
