//! Bad data and requests get a message that says what to change.

mod common;

use common::fit::{LEAF, base, request};
use leafdyn::study::{Data, FitError, FitRequest, Free, fit};

#[test]
fn bad_data_are_explained() {
    let refused = |data: &str, free: &[&str]| {
        let base = base(LEAF, &[]);
        let mut all = Data::default();
        if let Err(refused) = all.read(data, "data.csv", 5) {
            return refused.to_string();
        }
        let free = free.iter().map(|free| free.parse::<Free>());
        let free = match free.collect::<Result<Vec<Free>, FitError>>() {
            Ok(free) => free,
            Err(refused) => return refused.to_string(),
        };
        let request = FitRequest {
            data: all,
            free,
            ..request(base, &[], &[])
        };
        fit(&request, &mut |_| {}).unwrap_err().to_string()
    };
    let good = "load.tip_force[2],tip_z\n-0.1,-0.2\n";
    let free = ["stiffness.bending_2"].as_slice();
    for (data, free, said) in [
        ("", free, "data.csv:1: is empty"),
        ("-0.1,-0.2\n", free, "data.csv:1: has no header"),
        ("tip_z\n", free, "no row below the header"),
        ("tip_z,tip_z\n1,2\n", free, "stands there twice"),
        (
            "load.tip_force[2],tip_w\n1,2\n",
            free,
            "unknown column tip_w",
        ),
        (
            "load.tip_forc[2],tip_z\n1,2\n",
            free,
            "did you mean load.tip_force?",
        ),
        ("tip_z,sd_tip_x\n1,2\n", free, "sd_tip_x without tip_x"),
        (
            "tip_z\nnan\n",
            free,
            "data.csv:2: tip_z = nan: must be a finite number",
        ),
        ("tip_z\n1;2\n", free, "must be a finite number"),
        (
            "# made up\ntip_z,tip_x\n1\n",
            free,
            "data.csv:3: has 1 cells, and the header 2",
        ),
        ("tip_z,sd_tip_z\n1,0\n", free, "is greater than 0"),
        (
            "load.tip_force[2],tip_z\n,1\n",
            free,
            "is empty: every experiment needs its value",
        ),
        ("rod,x,y\n6,1,1\n", free, "from 1 to 5"),
        ("rod,x,y,w\n1,1,1,1\n", free, "unknown column w"),
        ("rod,sigma,x\n1,1.5,1\n", free, "from 0 to 1"),
        ("rod,x\n1,1\n", free, "at least two of x, y, z"),
        (
            "rod,x,y,experiment\n1,1,1,third\n",
            free,
            "no row of an experiments file has that name",
        ),
        ("tip_z,frequency_1\n-0.2,1\n", free, "standard deviations"),
        (
            "tip_z,tip_x,sd_tip_x\n-0.2,1,0.1\n",
            free,
            "give all or none",
        ),
        ("load.tip_force[2],tip_z\n1e12,1\n", free, "data.csv:2"),
        (
            good,
            &["stiffness.bending_2", "stiffness.torsion"],
            "free fewer, or measure more",
        ),
        (
            good,
            &["stiffness.bending_2", "stiffness.bending_2"],
            "is free twice",
        ),
        (
            good,
            &["load.tip_force[2]"],
            "is set by the experiment, and free",
        ),
        (good, &["leaf.rods"], "whole number"),
        (good, &["stiffness.bendin_2"], "did you mean"),
        (good, &["stiffness.bending_2=3..2"], "LOW..HIGH"),
        (
            good,
            &["stiffness.bending_2=2..3"],
            "not between the bounds",
        ),
    ] {
        let refused = refused(data, free);
        assert!(refused.contains(said), "{data:?} {free:?}: {refused}");
    }
}
