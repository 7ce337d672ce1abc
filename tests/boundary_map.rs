//! The map under the curves of a boundary, against Euler's load; and the page.

mod workplace;

use std::f64::consts::PI;

use workplace::{Workplace, all_refused, contains};

const COLUMN: &str = "--set leaf.rods=1 --set leaf.fan=[0] --set load.gravity=[0,0,0] \
    --set stiffness.bending_2=1000 --vary load.tip_force[0]=0..-6 --vary stiffness.bending_3=0.5..2";

/// Cells on both sides of the load, which is nearly that of an inextensible column, and none
/// that the curve contradicts.
#[test]
fn cells_are_stable_below_the_load_and_not_above() {
    let place = Workplace::new();
    let run = place.run(&format!(
        "trace leaf.toml {COLUMN} --map 6x4 --write json,svg,html"
    ));
    run.ends(0).says(&["6 x 4 cells", "all as the curves say"]);
    let map = &place.json("out/small/boundary.json")["map"];
    assert_eq!(map["disagreeing"].as_array().unwrap().len(), 0);
    let numbers = |key: &str| -> Vec<f64> {
        let values = map[key].as_array().unwrap().iter();
        values.map(|value| value.as_f64().unwrap()).collect()
    };
    let (first, second) = (numbers("first"), numbers("second"));
    assert_eq!([first.len(), second.len()], [6, 4]);
    let mut both = [0, 0];
    for (r, ei) in second.iter().enumerate() {
        for (c, load) in first.iter().enumerate() {
            let beyond = -load / (0.25 * PI * PI * ei);
            if (beyond - 1.0).abs() > 0.1 {
                let index = map["index"][r][c].as_u64().unwrap() as usize;
                assert_eq!(index, usize::from(beyond > 1.0), "{load} at {ei}");
                both[index] += 1;
            }
        }
    }
    assert!(both[0] > 3 && both[1] > 3, "{both:?}");
    let page = place.read("out/small/boundary.html");
    contains(&page, &["\"curve 1\"", "load.tip_force[0]", "branch point"]);
}

#[test]
fn maps_that_cannot_be_are_refused() {
    all_refused(
        "trace leaf.toml --vary load.gravity[2]=0..-1 --vary load.gravity[1]=0..1 --map",
        "16 => as 16x16
        0x4 => from 1 to 256
        4x1000 => from 1 to 256",
    );
}
