//! `trace` over two numbers as a program: its files, its outcomes, and requests that cannot be
//! met.

mod workplace;

use workplace::{Json, Workplace, contains};

const COLUMNS: &str = "curve,point,kind,load.tip_force[0],stiffness.bending_3,error_1,error_2,\
    tip_x,tip_y,tip_z,error,index_before,index_behind";

const COLUMN: &str = "--set leaf.rods=1 --set leaf.fan=[0] --set load.gravity=[0,0,0] \
    --set stiffness.bending_2=1000 --vary load.tip_force[0]=0..-6";

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
    let parts = ["load.tip_force[0]", "stiffness.bending_3", "curve 1"];
    contains(&picture, &parts);
    let rows = place.table("out/small/boundary.csv", COLUMNS);
    assert_eq!(rows[0][..3], ["1", "1", "branch-point"]);
    assert_eq!(rows[0][4], "0.5");
    assert_eq!(rows.last().unwrap()[4], "2.0");
    let json = place.json("out/small/boundary.json");
    assert_eq!(json["complete"], true);
    assert_eq!(json["curves"][0]["ends"][1], "reached");
    assert_eq!(json["curves"][0]["points"].list().len(), rows.len());
}

/// What ends early is said, with what was found until then.
#[test]
fn a_curve_that_goes_on_is_an_outcome() {
    let place = Workplace::new();
    let bending = "--vary stiffness.bending_3=0.5..2";
    let few = format!("trace leaf.toml {COLUMN} {bending}:100 --points 20");
    let json = place.told(1, few);
    assert_eq!(json["complete"], false);
    assert_eq!(json["curves"][0]["ends"][1], "most-points");
    let short = COLUMN.replace("0..-6", "0..-1");
    let json = place.told(1, format!("trace leaf.toml {short} {bending}"));
    contains(json["remark"].text(), &["changes nowhere"]);
}

#[test]
fn what_cannot_be_followed_is_refused() {
    workplace::all_refused(
        "trace leaf.toml --vary load.gravity[2]=0..-1 --vary",
        "load.gravity[2]=0..-3 => varies twice
        load.gravity[1]+load.gravity[2]=0..-3 => varies twice
        leaf.rods=3..9 => a whole number has nothing between
        dynamics.density=1..2 => no equilibrium
        load.gravity[1]=1..1 => the same
        stiffness.axial=100..-5 => greater than 0
        load.gravity[1]=0..1 --vary load.gravity[0]=0..1 => 3 times
        load.gravity[1]=0..1 --cross-section 1 => vary one number",
    );
}
