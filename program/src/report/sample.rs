//! Sample results for the tests of reports and figures: a small leaf at rest and in
//! motion, and made-up studies of it.

use glam::{DQuat, DVec3};
use leafdyn::relax::{Equilibrium, Outcome};
use leafdyn::scenario::Scenario;
use leafdyn::shape::Difference;
use leafdyn::simulate::{Frame, OutputSample, Record, ShapeSnapshot, Simulation, snapshot_indices};
use leafdyn::study::{
    AccuracySetting, BaseScenario, Chart, ChartOutcome, ChartRemark, ChartRow, ChartRowRemark,
    Check, Map, MapMethod, MapOutcome, MapRemark, MapRequest, MapRow, NeutralDirection,
    PeerProgram, ReferenceConfidence, ReferenceSolution, ScalingRow, ScalingStudy, ShootingResult,
    ShootingSolution, SolverConfig, Sweep, SweepRequest, TimingSpread, sweep,
};
use leafdyn::{relax, simulate};

/// The scenario of most samples.
pub fn sample_scenario(name: &str, rods: usize) -> Scenario {
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
pub fn sample_equilibrium(rods: usize, segments: usize) -> Equilibrium {
    let options = relax::Options {
        method: relax::SemiImplicit::on_grid(Some(segments)).into(),
        ..relax::Options::default()
    };
    let mut leaf = relax::relax(&sample_scenario("fan", rods), &options, &mut |_| {}).unwrap();
    leaf.accuracy.error_estimate = Some(3e-9);
    leaf
}

/// That fan on coarse grids over these numbers.
pub fn sample_sweep(vary: &[&str]) -> Sweep {
    let text = r#"
        name = "fan"
        leaf = { rods = 3, length = 1.0, fan = "symmetric" }
        stiffness = { torsion = 1, bending_2 = 1, bending_3 = 1, axial = 100, shear_2 = 100, shear_3 = 100 }
        load = { gravity = [0.0, 0.0, -1.0] }
    "#;
    let base = BaseScenario::from_text(text.into(), "fan.toml".into(), &[]).unwrap();
    let options = relax::Options {
        tolerance: Some(1e-3),
        modes: 1,
        ..relax::Options::default()
    };
    let axes = vary.iter().map(|axis| axis.parse().unwrap()).collect();
    sweep(SweepRequest::new(base, axes, options).unwrap(), &|_| ())
}

/// A check of that fan whose boundary-value solution is turned about x by
/// `angle`.
pub fn sample_check(rods: usize, segments: usize, angle: f64) -> Check {
    let relaxed = sample_equilibrium(rods, segments);
    let turn = DQuat::from_rotation_x(angle);
    let mut shapes = relaxed.shape.rods.clone();
    for node in shapes.iter_mut().flat_map(|rod| &mut rod.nodes) {
        node.position = turn * node.position;
        node.rotation = turn * node.rotation;
    }
    let zero = vec![DVec3::ZERO; segments + 1];
    let solution = ShootingSolution {
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
        neutral: Some(NeutralDirection {
            ratio: 1e-10,
            displacement: vec![zero; rods],
        }),
        unsharpened: None,
        work: Default::default(),
    };
    let shot = ShootingResult {
        tips: vec![turn * relaxed.tips[0]],
        found: Ok(solution),
        // The same shape is as stable.
        negative_eigenvalues: Some(if angle == 0.0 { 0 } else { 2 }),
        wall_seconds: 0.02,
    };
    Check::new(relaxed, Some(shot))
}

/// A map of 2 x 4 cells in which every outcome and reference occurs.
pub fn map_of_all_outcomes() -> Map {
    let text = r#"
        name = "vein"
        leaf = { rods = 1, length = 1.0, fan = [0.0] }
        stiffness = { torsion = 1, bending_2 = 1, bending_3 = 1, axial = 100, shear_2 = 100, shear_3 = 100 }
    "#;
    let base = BaseScenario::from_text(
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
            MapMethod::ToRest(method) if method.semi_implicit().is_some() && cell < 5 => {
                MapOutcome::Right
            }
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
            6 => ReferenceConfidence::Unconfirmed,
            7 => ReferenceConfidence::None,
            _ => ReferenceConfidence::Confirmed,
        };
        let row = MapRow {
            remark: Some(MapRemark::Refused(format!(
                "said of cell {cell}, \"quoted\""
            ))),
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
pub fn sample_motion(rods: usize, segments: usize) -> (Simulation, Vec<Frame>) {
    let options = simulate::Options {
        segments: Some(segments),
        ..simulate::Options::default()
    };
    let mut swing = Simulation::new(&sample_scenario("swing", rods), &options).unwrap();
    let mut frames = vec![swing.frame()];
    while !swing.done() {
        frames.push(swing.next_frame().unwrap());
    }
    (swing, frames)
}

/// The record of that motion.
pub fn sample_record(rods: usize, segments: usize) -> Record {
    let (swing, frames) = sample_motion(rods, segments);
    let moments: Vec<OutputSample> = frames
        .iter()
        .map(|frame| OutputSample::from_frame(frame, true))
        .collect();
    let still = |moment: usize| ShapeSnapshot {
        moment,
        curves: (0..rods)
            .map(|rod| frames[moment].centerline(rod).to_vec())
            .collect(),
    };
    let stills = snapshot_indices(&moments, 8, 1.0)
        .into_iter()
        .map(still)
        .collect();
    Record::new(&swing, None, moments, stills)
}

fn sample_spread(median: f64) -> TimingSpread {
    TimingSpread {
        min: 0.8 * median,
        q1: 0.875 * median,
        median,
        q3: 1.2 * median,
        runs: 5,
    }
}

fn sample_chart_row(contender: &str, knob: AccuracySetting, seconds: f64, error: f64) -> ChartRow {
    let contender = contender.parse().unwrap();
    ChartRow {
        seconds: Some(sample_spread(seconds)),
        steps: Some(8),
        factorizations: Some(9),
        force_evaluations: Some(9),
        true_error: Some(error),
        error_estimate: Some(10.0 * error),
        ..ChartRow::without_result(contender, knob, ChartOutcome::Ended(Outcome::Converged))
    }
}

fn sample_row_not_run(contender: &str, knob: AccuracySetting) -> ChartRow {
    ChartRow::without_result(contender.parse().unwrap(), knob, ChartOutcome::NotRun)
}

/// A chart of few points, two failures and a peer.
pub fn sample_chart() -> Chart {
    use AccuracySetting::{Segments, Tolerance};
    let peer = |knob: &str, seconds: f64, true_error: Option<f64>, outcome: &str| PeerProgram {
        name: "solve_bvp".into(),
        knob: knob.into(),
        seconds: sample_spread(seconds),
        true_error,
        outcome: outcome.into(),
        pareto: false,
        ratio: None,
    };
    let chart = Chart {
        motion: false,
        default: SolverConfig::ALL[0],
        scenario: "fan".into(),
        rods: 5,
        joined: true,
        threads: 1,
        rounds: 5,
        reference: Some(ReferenceSolution {
            confirmed: true,
            told: "relaxation and shooting agree within their error estimates".into(),
            known_within: 1e-12,
            relaxation_estimate: Some(1e-12),
            shooting_estimate: Some(2e-12),
            difference: Some(1e-14),
            neutral: None,
        }),
        remarks: vec![ChartRemark::PeersOfAnotherLeaf { rows: 1 }],
        rows: vec![
            sample_chart_row("semi-implicit", Tolerance(1e-2), 1e-3, 1e-4),
            sample_chart_row("semi-implicit", Tolerance(1e-6), 2e-3, 1e-8),
            ChartRow {
                error_estimate: None,
                ..sample_chart_row("semi-implicit-grid", Segments(4), 5e-4, 9e-3)
            },
            sample_chart_row("explicit", Tolerance(1e-2), 2e-2, 1e-4),
            sample_row_not_run("explicit", Tolerance(1e-11)),
            ChartRow {
                true_error: None,
                error_estimate: None,
                ending: ChartOutcome::Ended(Outcome::NotAtRest),
                remark: Some(ChartRowRemark::NoAccurateGrid { finest: 512 }),
                ..sample_chart_row("single-shooting", Tolerance(1e-6), 7e-2, 1.0)
            },
        ],
        peers: vec![
            peer("tol=0.001", 0.25, Some(5e-6), "converged"),
            peer("tol=1e-09", 16.0, None, "not-converged max-nodes"),
        ],
        decades: Vec::new(),
        scaling: None,
    };
    chart.with_comparisons()
}

/// Two leaves, two contenders, one of which was too slow.
pub fn sample_scaling() -> ScalingStudy {
    let knob = AccuracySetting::Tolerance(1e-6);
    let found = |rods: usize, row: ChartRow| ScalingRow { rods, row };
    ScalingStudy {
        scenario: "fan".into(),
        tolerance: 1e-6,
        unconfirmed: Vec::new(),
        rows: vec![
            found(5, sample_chart_row("semi-implicit", knob, 1e-3, 1e-8)),
            found(15, sample_chart_row("semi-implicit", knob, 3e-3, 1e-8)),
            found(5, sample_chart_row("explicit", knob, 3e-2, 1e-8)),
            found(15, sample_row_not_run("explicit", knob)),
        ],
    }
}
