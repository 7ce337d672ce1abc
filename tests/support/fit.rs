//! Made-up measurements.

use glam::DVec3;
use leafdyn::relax::Equilibrium;
use leafdyn::study::{BaseScenario, Data, Fit, FitOutcome, FitRequest, fit};

use crate::random::Draw;
use crate::{base, settle};

/// A vein that hangs.
pub const VEIN: &str = r#"
    name = "vein"
    leaf = { rods = 1, length = 1.0, fan = [0.0] }
    stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = 50.0, shear_2 = 40.0, shear_3 = 40.0 }
    load = { gravity = [0.0, 0.0, -0.5] }
    dynamics = { density = 1.0, rotary_inertia = 1e-4 }
"#;

/// A leaf of five veins.
pub const LEAF: &str = r#"
    name = "leaf"
    leaf = { rods = 5, length = 1.0, fan = "symmetric" }
    stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = 50.0, shear_2 = 40.0, shear_3 = 40.0 }
    coupling = { y = 1.0, z = 1.0 }
    load = { gravity = [0.0, 0.0, -1.0] }
"#;

/// What is free, of a vein or of all.
pub const THREE: [&str; 3] = [
    "stiffness.bending_2",
    "stiffness.bending_3",
    "stiffness.axial",
];

/// A fit of free numbers to these tables.
pub fn request(base: BaseScenario, data: &[&str], free: &[&str]) -> FitRequest {
    let rods = base.scenario().rods.len();
    let mut all = Data::default();
    for (k, text) in data.iter().enumerate() {
        all.read(text, &format!("data{k}.csv"), rods).unwrap();
    }
    FitRequest {
        base,
        data: all,
        free: free.iter().map(|free| free.parse().unwrap()).collect(),
        robust: false,
        candidates: Vec::new(),
        tolerance: None,
        limit: Default::default(),
        most_evaluations: None,
    }
}

/// What a fit found.
pub fn fitted(request: &FitRequest) -> Fit {
    fit(request, &mut |_| {}).unwrap_or_else(|refused| panic!("{refused}"))
}

/// Asserts that a fit has found these numbers, but for a part of them.
#[track_caller]
pub fn gives_back(found: &Fit, wanted: &[f64], within: f64) {
    let remarks = &found.remarks;
    assert_ne!(found.outcome, FitOutcome::NotConverged, "{remarks:?}");
    assert_eq!(found.parameters.len(), wanted.len());
    for (parameter, wanted) in found.parameters.iter().zip(wanted) {
        let error = (parameter.value / wanted - 1.0).abs();
        assert!(error < within, "{parameter:?}: {wanted}");
    }
}

/// Asserts that a fit has found these numbers within so many halves of their intervals.
#[track_caller]
pub fn within_bars(found: &Fit, wanted: &[f64], halves: f64) {
    assert_eq!(found.parameters.len(), wanted.len());
    for (parameter, wanted) in found.parameters.iter().zip(wanted) {
        let half = 0.5 * (parameter.high.unwrap() - parameter.low.unwrap());
        let off = (parameter.value - wanted).abs();
        assert!(off < halves * half, "{parameter:?}: {wanted}");
    }
}

/// Tips of a leaf with these numbers pulled by these forces, as a table with noise of a deviation.
pub fn pulls(text: &str, truth: &str, forces: &[[f64; 3]], sd: f64, noise: &mut Draw) -> String {
    let forces_are = "load.tip_force[0],load.tip_force[1],load.tip_force[2]";
    let mut table = format!("{forces_are},tip_x,tip_y,tip_z,sd_tip_x,sd_tip_y,sd_tip_z\n");
    for force in forces {
        let pulled = base(text, &format!("{truth}; load.tip_force={force:?}"));
        let tip = settle(pulled.scenario(), 1e-9).tips[0].to_array();
        let tip = tip.map(|x| x + sd * noise.normal());
        let cells = [*force, tip, [sd; 3]].concat();
        let cells: Vec<String> = cells.iter().map(|x| format!("{x:?}")).collect();
        table += &(cells.join(",") + "\n");
    }
    table
}

/// Forces on the tip.
pub const PULLS: [[f64; 3]; 5] = [
    [1.0, 0.0, 0.0],
    [0.0, 0.6, 0.0],
    [0.0, 0.0, 0.8],
    [2.0, 0.5, -0.5],
    [-0.3, 0.2, 1.0],
];

/// Points on the first veins of a leaf, at every so many stations, as a table of some columns of
/// rod, sigma, x, y, z and sd, with noise of the deviation sd (1e-4 is told if there is none); and the points.
pub fn traced(
    leaf: &Equilibrium,
    [veins, every]: [usize; 2],
    columns: &str,
    sd: f64,
    noise: &mut Draw,
) -> (String, Vec<DVec3>) {
    let (mut table, mut points) = (format!("{columns}\n"), Vec::new());
    for (j, rod) in leaf.shape.rods[..veins].iter().enumerate() {
        let stations = leaf.shape.stations.iter().zip(&rod.nodes);
        for (sigma, node) in stations.step_by(every).skip(1) {
            let [x, y, z] = node.position.to_array().map(|x| x + sd * noise.normal());
            let cell = |column| match column {
                "rod" => (j + 1).to_string(),
                "sigma" => format!("{sigma:?}"),
                "x" => format!("{x:?}"),
                "y" => format!("{y:?}"),
                "z" => format!("{z:?}"),
                _ => format!("{:?}", if sd > 0.0 { sd } else { 1e-4 }),
            };
            table += &(columns.split(',').map(cell).collect::<Vec<_>>().join(",") + "\n");
            points.push(DVec3::new(x, y, z));
        }
    }
    (table, points)
}
