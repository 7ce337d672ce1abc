//! What scripts rely on when they follow an equilibrium: files, exit statuses,
//! messages, and results that do not depend on the threads.

mod workplace;

use serde_json::Value;
use workplace::{Workplace, contains, floats, help_names, timeless};

const FILES: [&str; 4] = ["trace.csv", "trace.json", "trace.png", "trace.svg"];

const COLUMNS: &str = "branch,point,kind,value,value_error,tip_x,tip_y,tip_z,error,energy,\
    negative_eigenvalues,stable,multiplicity,margin_waves,margin_amplitude,twist";

#[test]
fn help_names_every_option_and_exit_status() {
    help_names(
        "trace",
        "--vary
        --switch
        --keep-unstable
        --segments
        --points
        --cross-section
        --tolerance
        --set
        --out
        --json
        0 all branches
        2 the request",
    );
}

#[test]
fn a_trace_is_a_table_a_summary_and_a_figure() {
    let place = Workplace::new();
    let run = place.run("trace leaf.toml --vary load.gravity[2]=0..-3");
    run.ends(0).says(&[
        "load.gravity[2] from 0.0 to -3.0",
        "to the end of the range",
        "stable",
        "written",
    ]);
    assert_eq!(place.names("out/small"), FILES);
    place.picture("out/small/trace");
    let rows = place.table("out/small/trace.csv", COLUMNS);
    assert!(rows.len() > 9);
    assert_eq!(rows[0][..5], ["1", "1", "regular", "0.0", ""]);
    let last = rows.last().unwrap();
    assert_eq!(last[3..5], ["-3.0", ""], "ends at the end of the range");
}

/// Every point is the leaf that `relax` finds there.
#[test]
fn points_are_what_relax_finds() {
    let place = Workplace::new();
    let vary = "--vary load.gravity[2]=0..-3:4";
    place.run(&format!("trace leaf.toml --tolerance 1e-8 {vary} --out t"));
    let rows = place.table("t/trace.csv", COLUMNS);
    let mut compared = 0;
    for row in rows.iter().step_by(3) {
        let set = format!("--set load.gravity=[0,0,{}]", row[3]);
        let leaf = place.run(&format!(
            "relax leaf.toml --tolerance 1e-10 {set} --json --out r"
        ));
        for (found, wanted) in row[5..8].iter().zip(floats(&leaf.json()["tip"])) {
            let found: f64 = found.parse().unwrap();
            assert!((found - wanted).abs() < 2e-8, "{row:?}: {wanted}");
        }
        let bound: f64 = row[8].parse().unwrap();
        assert!(bound < 1e-8, "{row:?}");
        compared += 1;
    }
    assert!(compared >= 3);
}

/// A leaf without weight, soft across, loses its flatness at a fork; both its
/// sides are followed.
#[test]
fn a_fork_is_found_and_both_its_sides() {
    let place = Workplace::new();
    let fork = "trace leaf.toml --set load.gravity=[0,0,0] --set leaf.rods=3 \
                --vary stiffness.bending_2=1..0.3:20 --switch --json";
    let trace = timeless(place.run_on("1", fork).ends(0).json());
    let two = timeless(place.run_on("2", fork).json());
    assert_eq!(trace, two, "threads change nothing");
    let branches = trace["branches"].as_array().unwrap();
    assert!(branches.len() >= 3, "{trace}");
    let first = &branches[0]["critical"][0];
    assert_eq!(first["kind"], "branch-point");
    assert_eq!(first["negative_eigenvalues"], 1);
    assert!(first["value_error"].as_f64().unwrap() < 1e-8);
    let [one, other] = [1, 2].map(|b| branches[b]["last"]["tip"][2].as_f64().unwrap());
    assert!(
        one.abs() > 1e-3 && (one + other).abs() < 1e-7,
        "{one} {other}"
    );
    let stable = |b: usize| branches[b]["first"]["stable"].as_bool().unwrap();
    assert!(stable(1) && stable(2), "what leaves the fork is stable");
}

/// The paper's Fig. 7: Hooke's law is a very good approximation.
#[test]
fn a_leaf_that_is_pulled_obeys_hookes_law() {
    let place = Workplace::new();
    for (name, axial, length) in [("fig07a", 9.0, 1.5), ("fig07b", 10.29, 1.0)] {
        let vary = "--vary load.tip_force[0]=0..20 --cross-section 0.05 --json --out h";
        let run = place.run(&format!("trace scenarios/paper/{name}.toml {vary}"));
        let law = &run.ends(0).json()["law"];
        let number = |key: &str| law[key].as_f64().unwrap();
        println!("{name}: {law}");
        assert!(number("r_squared") > 0.99999 && number("deviation") < 1e-3);
        // The veins lie askew and shear, which takes a part of their stiffness.
        let straight = 21.0 * axial / length;
        assert!(number("slope") < straight && number("slope") > 0.7 * straight);
        let young = number("slope") * number("length") / 0.05;
        assert!((number("young") / young - 1.0).abs() < 1e-12);
        let parts = ["displacement along x / cm", "force / N", "slope", "N/cm"];
        contains(&place.picture("h/trace"), &parts);
    }
}

#[test]
fn what_cannot_be_followed_is_refused() {
    workplace::all_refused(
        "trace leaf.toml --vary",
        "leaf.rods=3..9 => a whole number has nothing between
        method.step=1e-3..1 => setting of a method
        dynamics.density=1..2 => no equilibrium
        solve.tolerance=1e-3..1e-6 => changes no leaf
        load.gravity[2]=1..1 => the same
        load.gravity=0..1 => give an index
        stiffness.axial=100..-5 => greater than 0
        load.gravity[2]=0..1 --points 1 => 2 or more
        load.gravity[2]=0..1 --cross-section -1 => greater than 0
        load.gravity[2]=0..1 --tolerance 5 => tolerance
        load.gravity[2]=0..1 --segments 0 => segments",
    );
}

/// What ends early is said, with what was found until then.
#[test]
fn a_branch_that_goes_on_is_an_outcome() {
    let place = Workplace::new();
    let run = place.run("trace leaf.toml --vary load.gravity[2]=0..-3:100 --points 5 --json");
    let trace = run.ends(1).json();
    assert_eq!(trace["complete"], false);
    let branch = &trace["branches"][0];
    assert_eq!(branch["end"], "most-points");
    assert_eq!(branch["points"], 5);
    contains(branch["remark"].as_str().unwrap(), &["allow more"]);
    assert_eq!(place.names("out/small"), FILES);
}

/// The rest length of one vein grows.
#[test]
fn a_vein_that_grows_is_followed() {
    let place = Workplace::new();
    let run = place.run("trace leaf.toml --vary rest.stretch[0]=1..1.2 --json");
    let grown: Value = run.ends(0).json()["branches"][0]["last"].clone();
    let leaf = place.run("relax leaf.toml --set rest.stretch=[1.2,1,1,1,1] --json --out r");
    let tips = [&grown["tip"], &leaf.json()["tip"]].map(floats);
    for (a, b) in tips[0].iter().zip(&tips[1]) {
        assert!((a - b).abs() < 2e-6, "{a} {b}");
    }
}

/// On the grid that is enough at its start, this branch would go over to one that only
/// that grid has.
#[test]
fn a_branch_that_needs_finer_grids_gets_them() {
    let place = Workplace::new();
    let leaf = "scenarios/paper/fig10.toml --set leaf.rods=5 --keep-unstable --tolerance 1e-4";
    let run = place.run(&format!(
        "trace {leaf} --vary load.gravity[2]=0..-0.5 --json"
    ));
    let trace = run.ends(0).json();
    let branch = &trace["branches"][0];
    assert_eq!(
        [&branch["end"], &trace["complete"]],
        [&Value::from("returned"), &true.into()]
    );
    for row in place.table("out/fig10/trace.csv", COLUMNS) {
        let error: f64 = row[8]
            .parse()
            .unwrap_or_else(|_| panic!("no bound: {row:?}"));
        assert!(error <= 1e-4, "{row:?}");
    }
    let critical = branch["critical"].as_array().unwrap();
    assert_eq!((critical.len(), &critical[0]["kind"]), (1, &"fold".into()));
    assert!(
        critical[0]["value_error"].as_f64().unwrap() < 1e-6,
        "{critical:?}"
    );
    let index = |point: &str| branch[point]["negative_eigenvalues"].as_u64().unwrap();
    assert_eq!(index("first"), index("last") + 1);
}

/// Also of veins that are coupled at one end of the range only.
#[test]
fn coupling_may_vary() {
    let place = Workplace::new();
    let vary = "--set coupling.y=0 --vary coupling.z=0..40 --tolerance 1e-8 --json --out t";
    let trace = place.run(&format!("trace leaf.toml {vary}")).ends(0).json();
    let branch = &trace["branches"][0];
    assert!(branch["points"].as_u64().unwrap() < 40, "{branch}");
    let set = "--set coupling.y=0 --set coupling.z=40 --tolerance 1e-9 --json --out r";
    let leaf = place.run(&format!("relax leaf.toml {set}")).json();
    let tips = [&branch["last"]["tip"], &leaf["tip"]].map(floats);
    for (a, b) in tips[0].iter().zip(&tips[1]) {
        assert!((a - b).abs() < 2e-8, "{a} {b}");
    }
}
