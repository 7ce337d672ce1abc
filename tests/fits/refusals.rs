//! Bad data and requests get a message that says what to change.

use leafdyn::study::{Data, FitError, FitRemark, fit};
use leafdyn_testing::fit::{LEAF, request};
use leafdyn_testing::*;

/// Data in lines between `|`, `=>` and a part of the message, with one number free.
const DATA: &str = "
    => data.csv:1: is empty
    -0.1,-0.2 => data.csv:1: has no header
    tip_z => no row below the header
    load.tip_force[2]|-0.1 => there are no data: columns of results are tip_x
    tip_z,tip_z|1,2 => stands there twice
    load.tip_force[2],tip_w|1,2 => unknown column tip_w
    load.tip_forc[2],tip_z|1,2 => did you mean load.tip_force?
    tip_z,sd_tip_x|1,2 => sd_tip_x without tip_x
    tip_z|nan => data.csv:2: tip_z = nan: must be a finite number
    tip_z|1;2 => must be a finite number
    # made up|tip_z,tip_x|1 => data.csv:3: has 1 cells, and the header 2
    tip_z,sd_tip_z|1,0 => is greater than 0
    load.tip_force[2],tip_z|,1 => is empty: every experiment needs its value
    rod,x,y|6,1,1 => rod = 6: must be a whole number from 1 to 5
    rod,x,y,w|1,1,1,1 => unknown column w
    rod,sigma,x|1,1.5,1 => from 0 to 1
    rod,x|1,1 => at least two of x, y, z
    rod,x,y,experiment|1,1,1,third => no row of an experiments file has that name
    experiment,load.tip_force[2],tip_z|A,-0.1,-0.2|A,-0.2,-0.3 => data.csv:3: experiment A: has that name from data.csv:2
    experiment,load.tip_force[2],tip_z|2,-0.1,-0.2|,-0.2,-0.3 => data.csv:3: experiment 2: has that name from data.csv:2
    experiment,tip_x,tip_z|# 1,-0.1,none => data.csv:2: tip_z = none: must be a finite number
    tip_z|# -0.2 => no row below the header (1 lines
    tip_z,frequency_1|-0.2,1 => standard deviations
    tip_z,tip_x,sd_tip_x|-0.2,1,0.1 => give all or none
    load.tip_force[2],tip_z|1e12,1 => data.csv:2
    tip_z|1e308|-1e308 => data.csv:2: tip_z = 1e308: next to such a number
    tip_z,sd_tip_z|-0.1,0.1|1e16,1e15 => data.csv:3: tip_z = 1e16
    tip_z,sd_tip_z|-0.1,0.1|-0.1,1e-300 => data.csv:3: sd_tip_z = 1e-300: is less than the rounding of tip_z
    tip_y,sd_tip_y|0,1e-160|0,1e-160 => data.csv:2: sd_tip_y = 1e-160
    tip_z,sd_tip_z|-0.1,1e-17|-0.2,0.1 => data.csv:2: sd_tip_z = 1e-17
    frequency_1|1e300|1 => data.csv:2: frequency_1 = 1e300
    frequency_1,sd_frequency_1|1,1e-30|1,0.1 => data.csv:2: sd_frequency_1 = 1e-30
    rod,sigma,x,y,sd|1,0.5,0.5,0,1e-200 => data.csv:2: sd = 1e-200: is less than the rounding of x
    rod,x,y|1,-1e200,1e200|1,1,1 => data.csv:2: x = -1e200
";

/// Numbers that are to be free, `=>` and a part of the message, with good data.
const FREE: &str = "
    stiffness.bending_2 stiffness.torsion => free fewer, or measure more
    stiffness.bending_2 stiffness.bending_2 => is free twice
    load.tip_force[2] => is set by the experiment, and free
    leaf.rods => whole number
    stiffness.bendin_2 => did you mean
    stiffness.bending_2=3..2 => LOW..HIGH
    stiffness.bending_2=2..3 => not between the bounds
";

/// Why leaves cannot be fitted to these data.
fn tried(lines: &str, free: &str) -> Result<(), FitError> {
    let mut data = Data::default();
    let lines = lines.split('|').filter(|line| !line.is_empty());
    let text: String = lines.map(|line| format!("{line}\n")).collect();
    data.read(&text, "data.csv", 5)?;
    let free = free.split(' ').map(str::parse).collect::<Result<_, _>>()?;
    let mut request = request(base(LEAF, ""), &[], &[]);
    (request.data, request.free) = (data, free);
    fit(&request, &mut |_| {}).map(|_| ())
}

/// A name may begin with #: where the header has as many columns, the line is a row. Whole lines
/// are comments, and those among the rows are said to be left out.
#[test]
fn lines_that_begin_with_a_number_sign() {
    let read = |text: &str| {
        let mut request = request(base(LEAF, ""), &[text], &["stiffness.bending_2"]);
        request.tolerance = Some(1e-5);
        fit(&request, &mut |_| {}).unwrap()
    };
    let named = "# pulls, made up\nexperiment,load.tip_force[2],tip_z\nNo 1,-0.1,-0.19\n\
                 #2,-0.2,-0.21\n# No 3 slipped\nNo 4,-0.4,-0.25\n";
    let found = read(named);
    let names: Vec<_> = found.residuals.iter().map(|it| &it.experiment).collect();
    assert_eq!(names, ["No 1", "#2", "No 4"]);
    assert_eq!((found.files[0].rows, found.files[0].comments), (3, 2));
    let said = "left out as comments: 1 of data0.csv";
    let sentences: Vec<String> = found.remarks.iter().map(ToString::to_string).collect();
    assert!(
        sentences.iter().any(|it| it.ends_with(said)),
        "{sentences:?}"
    );
    let numbers = "load.tip_force[2],tip_z\n-0.1,-0.19\n#-0.2,-0.21\n-0.4,-0.25\n";
    let found = read(numbers);
    assert_eq!(found.residuals.len(), 2);
    let left_out = FitRemark::CommentLines {
        files: found.files.clone(),
    };
    assert!(found.remarks.contains(&left_out), "{:?}", found.remarks);
}

/// Rows of one name are repeated measurements if their settings are the same.
#[test]
fn repeated_measurements_have_one_name() {
    let twice = "experiment,load.tip_force[2],tip_z\nA,-0.1,-0.2\nA,-0.1,-0.21\n";
    let found = fit(
        &request(base(LEAF, ""), &[twice], &["stiffness.bending_2"]),
        &mut |_| {},
    );
    assert_eq!(found.unwrap().residuals.len(), 2);
}

#[test]
fn bad_data_are_explained() {
    let data = pairs(DATA).map(|(data, said)| (data, "stiffness.bending_2", said));
    let good = "load.tip_force[2],tip_z|-0.1,-0.2";
    let free = pairs(FREE).map(|(free, said)| (good, free, said));
    for (data, free, said) in data.chain(free) {
        let refused = tried(data, free).unwrap_err().to_string();
        assert!(refused.contains(said), "{data:?} {free:?}: {refused}");
    }
}
