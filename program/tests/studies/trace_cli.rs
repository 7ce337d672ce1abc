//! What scripts rely on when they follow an equilibrium, and boundaries: files, exit statuses,
//! messages, and results that do not depend on the threads.

use leafdyn_testing::workplace::{
    Json, Workplace, all_tell, contains, near, pairs, tells, timeless,
};
use serde_json::Value;

const FILES: &str = "trace.csv trace.json trace.png trace.svg";

const COLUMNS: &str = "branch,point,kind,value,value_error,tip_x,tip_y,tip_z,error,energy,\
    negative_eigenvalues,stable,multiplicity,margin_waves,margin_amplitude,twist";

const BOUNDARY: &str = "curve,point,kind,load.tip_force[0],stiffness.bending_3,error_1,error_2,\
    tip_x,tip_y,tip_z,error,index_before,index_behind";

/// A column that buckles in one plane alone.
const COLUMN: &str = "--set leaf.rods=1 --set leaf.fan=[0] --set load.gravity=[0,0,0] \
    --set stiffness.bending_2=1000 --vary load.tip_force[0]=0..-6";

#[test]
fn a_trace_is_a_table_a_summary_and_a_figure() {
    let place = Workplace::new();
    let run = place.run("trace leaf.toml --vary load.gravity[2]=0..-3");
    let range = "load.gravity[2] from 0.0 to -3.0";
    run.ends(0)
        .says(&[range, "to the end of the range", "stable", "written"]);
    place.holds("out/small", FILES);
    place.picture("out/small/trace");
    let rows = place.table("out/small/trace.csv", COLUMNS);
    assert!(rows.len() > 9);
    assert_eq!(rows[0][..5], ["1", "1", "regular", "0.0", ""]);
    let last = rows.last().unwrap();
    assert_eq!(last[3..5], ["-3.0", ""], "ends at the end of the range");
}

/// A leaf that snapped has other equilibria, which may lose their stability elsewhere.
#[test]
fn a_trace_from_a_leaf_that_snapped_says_so() {
    let place = Workplace::new();
    let text = "
        name = 'seven'
        leaf = { rods = 7, length = 0.15, fan = [-0.3, -0.2, -0.1, 0, 0.1, 0.2, 0.3], elevation = 1.2 }
        section = { shape = 'ellipse', width = 1.2e-3, thickness = 0.4e-3, young = 2e9, mass_density = 900 }
        load = { g = [0, 0, -9.81] }
    ";
    place.write("seven.toml", text);
    let remark = "snapped on its way, to one of several equilibria";
    place
        .ok("relax seven.toml --write none")
        .says(&["snapped at"]);
    place
        .ok("trace seven.toml --vary load.g[2]=-9.81..-11 --write json")
        .says(&[remark]);
    let flat = "trace seven.toml --set leaf.elevation=0 --vary load.g[2]=-9.81..-11 --write json";
    assert!(!place.ok(flat).out.contains(remark));
}

/// With grips the table has the forces on them, and the figure shows the one that varies most.
#[test]
fn forces_on_grips_are_columns() {
    let place = Workplace::new();
    let grips = "\n[[grip]]\nvein = 1\nat = [0.3, 0.6]\n\n[[grip]]\nvein = 2\nat = 0.5\nheld = \"clamped\"\n";
    place.write("gripped.toml", &(place.read("leaf.toml") + grips));
    let run = "trace gripped.toml --vary grip[0].move[2]=0..0.1";
    place
        .run(run)
        .ends(0)
        .says(&["on grip 1", "on grip 2", "tips and middles"]);
    let columns = format!("{COLUMNS},grip_1_x,grip_1_y,grip_1_z,grip_2_x,grip_2_y,grip_2_z");
    let rows = place.table("out/small/trace.csv", &columns);
    let pushed: f64 = rows.last().unwrap()[18].parse().unwrap();
    assert!(pushed < -0.1, "{pushed}");
    contains(
        &place.picture("out/small/trace"),
        &["force on grip 1 along z"],
    );
    let refused = place.run(format!("{run} --show grip_3_x"));
    contains(&refused.ends(2).err, &["there are 2 of [[grip]]"]);
}

#[test]
fn a_boundary_is_a_table_a_summary_and_a_figure() {
    let place = Workplace::new();
    let bending = "--vary stiffness.bending_3=0.5..2";
    let run = place.run(format!("trace leaf.toml {COLUMN} {bending}"));
    run.ends(0).says(&[
        "load.tip_force[0] from 0.0 to -6.0",
        "stiffness.bending_3 from 0.5 to 2.0",
        "at stiffness.bending_3 = 1.0",
        "branches cross: index 0 to 1",
        "the end of a range",
        "written",
    ]);
    let files = "boundary.csv boundary.json boundary.png boundary.svg";
    place.holds("out/small", files);
    let picture = place.picture("out/small/boundary");
    let parts = [
        ">force on the tip along x<",
        ">bending stiffness A3<",
        "curve 1",
        ">stable<",
        "looked for in 0 to \u{2212}6 and 0.5 to 2",
    ];
    contains(&picture, &parts);
    let rows = place.table("out/small/boundary.csv", BOUNDARY);
    assert_eq!(rows[0][..3], ["1", "1", "branch-point"]);
    assert_eq!(rows[0][4], "0.5");
    assert_eq!(rows.last().unwrap()[4], "2.0");
    let json = place.json("out/small/boundary.json");
    assert_eq!(json["complete"], true);
    assert_eq!(json["curves"][0]["ends"][1], "reached");
    assert_eq!(json["curves"][0]["points"].list().len(), rows.len());
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
    let branches = trace["branches"].list();
    assert!(branches.len() >= 3, "{trace}");
    let first = &branches[0]["critical"][0];
    tells(first, "kind=branch-point negative_eigenvalues=1");
    assert!(first["value_error"].number() < 1e-8);
    let [one, other] = [1, 2].map(|b| branches[b]["last"]["tip"][2].number());
    let mirrored = (one + other).abs() < 1e-7;
    assert!(one.abs() > 1e-3 && mirrored, "{one} {other}");
    let stable = |b: usize| branches[b]["first"]["stable"].as_bool().unwrap();
    assert!(stable(1) && stable(2), "what leaves the fork is stable");
}

/// An inextensible strut on hinges, on springs k across it: with w = a sin(q s), q = pi, its energy under P is
/// a^2/4 (q^4 + k - P q^2) + a^4 q^4/64 (4 q^2 - 3 P), A2 = L = 1. It buckles at P = q^2 + k/q^2, steadily as long as
/// k < q^4/3, and jumps beyond; from k = 4 q^4 on in two waves.
#[test]
fn a_strut_on_springs_buckles_steadily_or_jumps() {
    let place = Workplace::new();
    let squared = std::f64::consts::PI.powi(2);
    for (springs, kind, told) in [
        (10.0, "supercritical", "steadily"),
        (100.0, "subcritical", "jumps"),
    ] {
        let strut = format!(
            "
            leaf = {{ rods = 1, length = 1.0, fan = [0.0], base_held = \"pinned\", base_spin = \"held\" }}
            stiffness = {{ torsion = 10.0, bending_2 = 1.0, bending_3 = 1e3, axial = inf, shear_2 = inf, shear_3 = inf }}
            foundation = {{ stiffness = [0.0, 0.0, {springs:?}] }}
            grip = [{{ vein = 1, at = 1.0, stiffness = [0.0, inf, inf] }}]
            "
        );
        place.write("strut.toml", &strut);
        let load = squared + springs / squared;
        let vary = format!(
            "--vary load.tip_force[0]=0..{} --until unstable --out t",
            -1.2 * load
        );
        let run = place.run(format!("trace strut.toml {vary}"));
        run.ends(0).says(&[
            "  critical stable up to load.tip_force[0] = -",
            ": there it bends up or down, ",
            told,
            &format!(" ({kind})"),
            "  advice   ",
            "relax --all finds the shapes in which the leaf can rest beyond -",
        ]);
        let trace = place.json("t/trace.json");
        let critical = trace["branches"][0]["critical"].only();
        assert_eq!(critical["branching"], kind, "{critical}");
        let (value, error) = (critical["value"].number(), critical["value_error"].number());
        assert!(
            (value + load).abs() <= error.max(1e-9 * load),
            "{value} {load} {error}"
        );
    }
}

/// Of veins that nothing ties, which buckle together, one is followed, and the branch says so.
#[test]
fn of_several_directions_one_is_followed_and_it_is_told() {
    let place = Workplace::new();
    let two = "
        leaf = { rods = 2, length = 1.0, fan = [0.0, 0.0], joined = false }
        stiffness = { torsion = 10.0, bending_2 = 1e3, bending_3 = 1.0, axial = inf, shear_2 = inf, shear_3 = inf }
        ";
    place.write("two.toml", two);
    let run = place.run("trace two.toml --vary load.tip_force[0]=0..-2.6 --switch --out t");
    run.says(&[
        "branches cross in 2 directions at -",
        "in 2 directions, of which one is followed, to both its sides",
    ]);
}

/// The paper's Fig. 7: Hooke's law is a very good approximation.
#[test]
fn a_leaf_that_is_pulled_obeys_hookes_law() {
    let place = Workplace::new();
    for (name, axial, length) in [("fig07a", 9.0, 1.5), ("fig07b", 10.29, 1.0)] {
        let vary = "--vary load.tip_force[0]=0..20 --out h";
        let trace = place.told(0, format!("trace scenarios/paper/{name}.toml {vary}"));
        let number = |key: &str| trace["law"][key].number();
        assert!(number("r_squared") > 0.99999 && number("deviation") < 1e-3);
        // The veins lie askew and shear, which takes a part of their stiffness.
        let straight = 21.0 * axial / length;
        assert!(number("slope") < straight && number("slope") > 0.7 * straight);
        let parts = ["displacement along x / cm", "force / N", "slope", "N/cm"];
        contains(&place.picture("h/trace"), &parts);
    }
}

/// What ends early is said, with what was found until then.
#[test]
fn what_goes_on_is_an_outcome() {
    let bending = "--vary stiffness.bending_3=0.5..2";
    let short = COLUMN.replace("0..-6", "0..-1");
    let table = format!(
        "
        trace leaf.toml --vary load.gravity[2]=0..-3:100 --points 5 => complete=false branches.0.end=most-points branches.0.points=5; allow more
        trace leaf.toml {COLUMN} {bending}:100 --points 20 => complete=false curves.0.ends.1=most-points
        trace leaf.toml {short} {bending} => complete=false; changes nowhere
        "
    );
    all_tell(1, &table);
}

/// On the grid that is enough at its start, this branch would go over to one that only
/// that grid has.
#[test]
fn a_branch_that_needs_finer_grids_gets_them() {
    let place = Workplace::new();
    let leaf = "scenarios/paper/fig10.toml --set leaf.rods=5 --keep-unstable --tolerance 1e-4";
    let trace = place.told(0, format!("trace {leaf} --vary load.gravity[2]=0..-0.5"));
    let branch = &trace["branches"][0];
    assert_eq!(branch["end"], "returned");
    assert_eq!(trace["complete"], true);
    for row in place.table("out/fig10/trace.csv", COLUMNS) {
        let error: f64 = row[8].parse().expect("a bound");
        assert!(error <= 1e-4, "{row:?}");
    }
    let fold = branch["critical"].only();
    assert_eq!(fold["kind"], "fold");
    assert!(fold["value_error"].number() < 1e-6, "{fold}");
    let index = |point: &str| branch[point]["negative_eigenvalues"].count();
    assert_eq!(index("first"), index("last") + 1);
}

/// One load, the rest length of one vein, and coupling, which may end where leaves do: no step
/// leads beyond it.
#[test]
fn a_branch_ends_in_the_leaf_that_relax_finds_there() {
    let place = Workplace::new();
    let table = "
        load.gravity[2]=0..-3 => load.gravity=[0,0,-3]
        rest.stretch[0]=1..1.2 => rest.stretch=[1.2,1,1,1,1]
        coupling.z=0..40 => coupling.z=40
        coupling.z=40..0 => coupling.z=0
        coupling.z=2..1e-9 => coupling.z=1e-9
    ";
    for (varied, there) in pairs(table) {
        let follow = format!("trace leaf.toml --vary {varied} --tolerance 1e-8 --out t");
        let trace = place.told(0, follow);
        let (branch, last) = (&trace["branches"][0], &trace["branches"][0]["last"]);
        assert_eq!(branch["end"], "reached", "{trace}");
        assert!(branch["points"].count() < 40, "{branch}");
        let end = varied.rsplit("..").next().unwrap();
        assert_eq!(last["value"].as_f64(), end.parse().ok());
        let relax = format!("relax leaf.toml --set {there} --tolerance 1e-9 --out r");
        let leaf = place.told(0, relax);
        near(&last["tip"], &leaf["tip"], 2e-8);
        let row = place.table("t/trace.csv", COLUMNS).pop().unwrap();
        let numbers: Vec<f64> = row[5..9].iter().map(|cell| cell.parse().unwrap()).collect();
        near(&numbers[..3].into(), &leaf["tip"], 2e-8);
        assert!(numbers[3] <= 1e-8, "{row:?}");
    }
}

/// A rod along e1, bending up and down, with these entries besides.
fn rod(place: &Workplace, couple: [f64; 3], entries: &str) {
    let [torsion, bending_2, bending_3] = couple;
    let text = format!(
        "name = \"rod\"\nleaf = {{ rods = 1, length = 1.0, fan = [0.0] }}\n\
         stiffness = {{ torsion = {torsion}, bending_2 = {bending_2}, bending_3 = {bending_3}, \
         axial = 1000.0, shear_2 = 1000.0, shear_3 = 1000.0 }}\n{entries}\n"
    );
    place.write("rod.toml", text);
}

/// A column that is turned from lying to standing to lying buckles sideways where it
/// stands: both its sides are one loop through the two crossings.
#[test]
fn a_loop_is_closed() {
    let place = Workplace::new();
    rod(&place, [50.0, 1.0, 50.0], "load = { gravity = [-9, 0, 0] }");
    let run = place.run("trace rod.toml --vary leaf.fan[0]=-1..1 --switch");
    run.ends(0).says(&["branches cross at", "points, closed"]);
    place.holds("out/rod", FILES);
    let trace = place.json("out/rod/trace.json");
    assert_eq!(trace["complete"], true);
    let branches = trace["branches"].list();
    let ends: Vec<&Value> = branches.iter().map(|branch| &branch["end"]).collect();
    assert_eq!(ends, ["reached", "closed", "closed", "closed", "closed"]);
    for branch in &branches[1..] {
        let [first, last] = ["first", "last"].map(|end| &branch[end]);
        let [a, b] = [first, last].map(|point| point["value"].number());
        assert!((a - b).abs() < 1e-6, "{a} {b}");
        near(&first["tip"], &last["tip"], 2e-6);
        // It goes through both crossings and to both sides.
        let number = branch["points"].count();
        assert!(number > 20, "{number}");
    }
}

/// A vein that winds up more than the finest grid resolves.
#[test]
fn a_spiral_is_wound_up_until_no_grid_resolves_it() {
    let place = Workplace::new();
    rod(&place, [1.0; 3], "rest = { bend_2 = 20.0 }");
    let run = place.run("trace rod.toml --vary rest.bend_2=20..900 --tolerance 1e-4");
    let bends = "a vein bends by more than a right angle within one segment";
    run.ends(1).says(&["ends: grid too coarse", bends]);
    place.holds("out/rod", FILES);
    let trace = place.json("out/rod/trace.json");
    assert_eq!(trace["complete"], false);
    let branch = &trace["branches"][0];
    assert_eq!(branch["end"], "unresolved");
    contains(branch["remark"].text(), &["right angle"]);
    // 512 segments that turn by 1.6 each.
    let last = branch["last"]["value"].number();
    assert!((last - 819.2).abs() < 1.0, "{last}");
}

/// Where branches cross that are not followed, and where stability is lost again and again, report
/// and figure say which option helps; with it they do not.
#[test]
fn options_that_help_are_told() {
    let place = Workplace::new();
    let column =
        "trace scenarios/classic/elastica_buckled.toml --vary load.tip_force[0]=-1..-60 --out c";
    let [crossings, losses] = [
        "--switch follows the buckled ones",
        "--until unstable ends branches",
    ];
    let run = place
        .run(column)
        .ends(0)
        .says(&[crossings, losses, "3 points"]);
    contains(&place.picture("c/trace"), &["--switch follows the buckled"]);
    assert!(!run.out.contains("doubtful"));
    let run = place
        .run(format!("{column} --switch --until unstable"))
        .ends(0);
    let told = [crossings, losses].map(|it| run.out.contains(it));
    assert_eq!(told, [false, false], "{}", run.out);
    assert!(!place.picture("c/trace").contains("--switch"));
    let trace = place.json("c/trace.json");
    assert_eq!(trace["branches"][0]["end"], "unstable");
    assert_eq!(trace["branches"].list().len(), 3);
}

/// Euler's column buckles about the axis of its smaller bending stiffness, at pi^2/4 of that, and the report
/// says how.
#[test]
fn a_branch_that_is_lost_says_how_the_leaf_buckles() {
    let place = Workplace::empty();
    let stiff = "axial = inf, shear_2 = inf, shear_3 = inf";
    for (bending_2, bending_3, how) in [
        (1.0, 9.0, "it bends up or down"),
        (9.0, 1.0, "it bends sideways"),
    ] {
        let column = format!(
            "name = \"column\"\nleaf = {{ rods = 1, length = 1.0, fan = [0.0] }}\n\
             stiffness = {{ torsion = 5.0, bending_2 = {bending_2}, bending_3 = {bending_3}, {stiff} }}\n"
        );
        place.write("column.toml", column);
        let run = place.ok("trace column.toml --vary load.tip_force[0]=-1..-4 --write none");
        run.says(&[
            "branches cross at -2.467401",
            &format!("index 0 to 1: {how}"),
        ]);
    }
    // Loaded slowly beyond that, it turns aside likewise.
    place.write(
        "loaded.toml",
        format!(
            "name = \"loaded\"\nleaf = {{ rods = 1, length = 1.0, fan = [0.0] }}\n\
             stiffness = {{ torsion = 5.0, bending_2 = 9.0, bending_3 = 1.0, {stiff} }}\n\
             load = {{ tip_force = [-3.0, 0.0, 0.0] }}\n"
        ),
    );
    let run = place.ok("relax loaded.toml --write none");
    run.says(&["turned to one of two equal sides", "(it bends sideways)"]);
}
