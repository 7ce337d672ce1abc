//! Sample results for the tests of reports and figures: a small leaf at rest and in
//! motion, and made-up studies of it.

use glam::{DQuat, DVec3};
use leafdyn::relax::{Equilibrium, Method, Outcome};
use leafdyn::scenario::Scenario;
use leafdyn::shape::Difference;
use leafdyn::simulate::{Frame, Moment, Record, Simulation, Still, stills};
use leafdyn::study::{
    Base, Chart, Check, Confidence, Ending, Map, MapMethod, MapOutcome, MapRequest, MapRow,
    Neutral, Peer, Reference, Row, Scaling, ScalingRow, Setting, ShootingSolution as Solution,
    Shot, Spread,
};
use leafdyn::{relax, simulate};

/// The scenario of most samples.
pub fn scenario(name: &str, rods: usize) -> Scenario {
    let text = format!(
        r#"
        name = "{name}"
        leaf = {{ rods = {rods}, length = 1.0, fan = "symmetric" }}
        stiffness = {{ torsion = 1, bending_2 = 1, bending_3 = 1, axial = 100, shear_2 = 100, shear_3 = 100 }}
        coupling = {{ y = 0.1, z = 0.1 }}
        load = {{ gravity = [0.0, 0.0, -1.0] }}
        dynamics = {{ duration = 10.0, output_interval = 0.1 }}
    "#
    );
    let text = match rods {
        1 => text.replace("coupling = { y = 0.1, z = 0.1 }", ""),
        _ => text,
    };
    Scenario::from_toml(&text).unwrap()
}

/// A leaf at rest on one grid, with an error estimate as if from several.
pub fn fan(rods: usize, segments: usize) -> Equilibrium {
    let options = relax::Options {
        method: Method::default().on_grid(Some(segments)),
        ..relax::Options::default()
    };
    let mut leaf = relax::relax(&scenario("fan", rods), &options, &mut |_| {}).unwrap();
    leaf.accuracy.error_estimate = Some(3e-9);
    leaf
}

/// A check of that fan whose boundary-value solution is turned about x by
/// `angle`.
pub fn check(rods: usize, segments: usize, angle: f64) -> Check {
    let relaxed = fan(rods, segments);
    let turn = DQuat::from_rotation_x(angle);
    let mut shapes = relaxed.shape.rods.clone();
    for node in shapes.iter_mut().flat_map(|rod| &mut rod.nodes) {
        node.position = turn * node.position;
        node.rotation = turn * node.rotation;
    }
    let zero = vec![DVec3::ZERO; segments + 1];
    let solution = Solution {
        stations: relaxed.shape.stations.clone(),
        rods: shapes,
        energy: 11.08,
        error: Difference {
            position: 1e-10,
            rotation: 2e-10,
            force: 3e-9,
            moment: 4e-9,
        },
        defect: 1e-14,
        intervals: vec![0.0, 0.5, 1.0],
        growth: 4.2,
        condition: 1e-10,
        neutral: Some(Neutral {
            ratio: 1e-10,
            displacement: vec![zero; rods],
        }),
        unsharpened: None,
        work: Default::default(),
    };
    let shot = Shot {
        tips: vec![turn * relaxed.tips[0]],
        found: Ok(solution),
        // The same shape is as stable.
        negative_eigenvalues: Some(if angle == 0.0 { 0 } else { 2 }),
        wall_seconds: 0.02,
    };
    Check::new(relaxed, Some(shot))
}

/// A map of 2 x 4 cells in which every outcome and reference occurs.
pub fn map() -> Map {
    let text = r#"
        name = "vein"
        leaf = { rods = 1, length = 1.0, fan = [0.0] }
        stiffness = { torsion = 1, bending_2 = 1, bending_3 = 1, axial = 100, shear_2 = 100, shear_3 = 100 }
    "#;
    let base = Base::of_text(
        text.into(),
        "vein.toml".into(),
        &["method.step=0.01".into()],
    );
    let axes = [
        "stiffness.bending_2=1..0.1:2log",
        "load.gravity[2]=-0.1..-100:4log",
    ];
    let request = MapRequest::new(
        base.unwrap(),
        axes.iter().map(|axis| axis.parse().unwrap()).collect(),
        None,
        None,
        20.0,
    )
    .unwrap();
    let row = |cell: usize, method: MapMethod| {
        let outcome = match method {
            MapMethod::ToRest(Method::SemiImplicit(_)) if cell < 5 => MapOutcome::Right,
            _ => MapOutcome::ALL[cell],
        };
        let rests = !matches!(
            outcome,
            MapOutcome::NotConverged
                | MapOutcome::Diverged
                | MapOutcome::Refused
                | MapOutcome::OutOfTime
        );
        let reference = match cell {
            6 => Confidence::Unconfirmed,
            7 => Confidence::None,
            _ => Confidence::Confirmed,
        };
        let row = MapRow {
            detail: format!("said of cell {cell}, \"quoted\""),
            seconds: 0.012345,
            cell,
            method,
            outcome,
            reference,
            ..MapRow::default()
        };
        if !rests {
            return row;
        }
        MapRow {
            index: Some(if outcome == MapOutcome::Saddle { 3 } else { 0 }),
            tip_x: Some(0.9),
            tip_y: Some(0.1 * cell as f64),
            tip_z: Some(-1.0 / 3.0),
            margin_waves: Some(if cell == 2 { 1.5 } else { 0.0 }),
            margin_amplitude: Some(0.01),
            twist: Some(-0.5),
            energy: Some(-1.5e-7),
            error: Some(1e-9),
            error_estimate: Some(2e-9),
            ..row
        }
    };
    let rows = (0..8).flat_map(|cell| MapMethod::ALL.map(|method| row(cell, method)));
    Map::new(request, rows.collect())
}

/// The same leaf released, and followed for 10 units of time.
pub fn swing(rods: usize, segments: usize) -> (Simulation, Vec<Frame>) {
    let options = simulate::Options {
        segments: Some(segments),
        ..simulate::Options::default()
    };
    let mut swing = Simulation::new(&scenario("swing", rods), &options).unwrap();
    let mut frames = vec![swing.frame()];
    while !swing.done() {
        frames.push(swing.next_frame().unwrap());
    }
    (swing, frames)
}

/// The record of that motion.
pub fn record(rods: usize, segments: usize) -> Record {
    let (swing, frames) = swing(rods, segments);
    let moments: Vec<Moment> = frames.iter().map(|frame| Moment::of(frame, true)).collect();
    let still = |moment: usize| Still {
        moment,
        curves: (0..rods)
            .map(|rod| frames[moment].centerline(rod).to_vec())
            .collect(),
    };
    let stills = stills(&moments, 8, 1.0).into_iter().map(still).collect();
    Record::new(&swing, None, moments, stills)
}

fn spread(median: f64) -> Spread {
    Spread {
        min: 0.8 * median,
        q1: 0.875 * median,
        median,
        q3: 1.2 * median,
        runs: 5,
    }
}

fn row(contender: &str, knob: Setting, seconds: f64, error: f64) -> Row {
    let contender = contender.parse().unwrap();
    Row {
        seconds: Some(spread(seconds)),
        steps: Some(8),
        factorizations: Some(9),
        force_evaluations: Some(9),
        true_error: Some(error),
        error_estimate: Some(10.0 * error),
        ..Row::without_result(contender, knob, Ending::Ended(Outcome::Converged))
    }
}

fn not_run(contender: &str, knob: Setting) -> Row {
    Row::without_result(contender.parse().unwrap(), knob, Ending::NotRun)
}

/// A chart of few points, two failures and a peer.
pub fn chart() -> Chart {
    use Setting::{Segments, Tolerance};
    let peer = |knob: &str, seconds: f64, true_error: Option<f64>, outcome: &str| Peer {
        name: "solve_bvp".into(),
        knob: knob.into(),
        seconds: spread(seconds),
        true_error,
        outcome: outcome.into(),
        pareto: false,
        ratio: None,
    };
    let chart = Chart {
        scenario: "fan".into(),
        rods: 5,
        joined: true,
        threads: 1,
        rounds: 5,
        reference: Some(Reference {
            confirmed: true,
            told: "relaxation and shooting agree within their error estimates".into(),
            known_within: 1e-12,
            relaxation_estimate: Some(1e-12),
            shooting_estimate: Some(2e-12),
            difference: Some(1e-14),
            neutral: None,
        }),
        remarks: vec!["1 row of --peers is about another leaf, and left out".into()],
        rows: vec![
            row("semi-implicit", Tolerance(1e-2), 1e-3, 1e-4),
            row("semi-implicit", Tolerance(1e-6), 2e-3, 1e-8),
            Row {
                error_estimate: None,
                ..row("semi-implicit-grid", Segments(4), 5e-4, 9e-3)
            },
            row("explicit", Tolerance(1e-2), 2e-2, 1e-4),
            not_run("explicit", Tolerance(1e-11)),
            Row {
                true_error: None,
                error_estimate: None,
                ending: Ending::Ended(Outcome::NotAtRest),
                remark: Some("perturbations grow".into()),
                ..row("single-shooting", Tolerance(1e-6), 7e-2, 1.0)
            },
        ],
        peers: vec![
            peer("tol=0.001", 0.25, Some(5e-6), "converged"),
            peer("tol=1e-09", 16.0, None, "not-converged max-nodes"),
        ],
        decades: Vec::new(),
        scaling: None,
    };
    chart.compared()
}

/// Two leaves, two contenders, one of which was too slow.
pub fn scaling() -> Scaling {
    let knob = Setting::Tolerance(1e-6);
    let found = |rods: usize, row: Row| ScalingRow { rods, row };
    Scaling {
        scenario: "fan".into(),
        tolerance: 1e-6,
        unconfirmed: Vec::new(),
        rows: vec![
            found(5, row("semi-implicit", knob, 1e-3, 1e-8)),
            found(15, row("semi-implicit", knob, 3e-3, 1e-8)),
            found(5, row("explicit", knob, 3e-2, 1e-8)),
            found(15, not_run("explicit", knob)),
        ],
    }
}
