//! Results to test the formats with: arcs that fan out and meet in a tip.

use std::f64::consts::PI;

use glam::{DQuat, DVec3};

use crate::bvp::{self, Neutral, Solution};
use crate::motion::{Energy, StableStep, Velocity};
use crate::relax::{
    self, Accuracy, Equilibrium, Method, Model, NodeState, Outcome, RodShape, Stability, Work,
};
use crate::shape::Difference;
use crate::simulate::{Frame, Moment, Record, Scheme, Still};
use crate::study::{
    Base, Chart, Check, Confidence, Ending, Map, MapMethod, MapOutcome, MapRequest, MapRow, Peer,
    Reference, Row, Scaling, ScalingRow, Setting, Shot, Spread,
};
use crate::undulation::{Undulation, Vein};

/// A fan of `rods` arcs of length 1, given at `segments` + 1 stations.
pub fn fan(rods: usize, segments: usize) -> Equilibrium {
    let stations: Vec<f64> = (0..=segments).map(|i| i as f64 / segments as f64).collect();
    let angle = |rod: usize| (2.0 * (rod as f64 + 0.5) / rods as f64 - 1.0) * PI / 3.0;
    let point = |rod: usize, sigma: f64| {
        let angle = angle(rod);
        let side = if angle.abs() < 1e-9 {
            0.0
        } else {
            ((angle * (1.0 - 2.0 * sigma)).cos() - angle.cos()) / (2.0 * angle)
        };
        DVec3::new(0.95 * sigma, side, -0.15 * sigma * sigma)
    };
    let node = |rod: usize, sigma: f64| NodeState {
        position: point(rod, sigma),
        rotation: DQuat::from_rotation_z(angle(rod) * (1.0 - 2.0 * sigma)),
        v: DVec3::X,
        u: DVec3::new(0.0, 0.0, -2.0 * angle(rod)),
        n: DVec3::new(0.1, 0.2, 0.3),
        m: DVec3::new(0.4, 0.5, 0.6),
    };
    let shape = |rod: usize| RodShape {
        length: 1.0,
        nodes: stations.iter().map(|&sigma| node(rod, sigma)).collect(),
    };
    let shapes: Vec<RodShape> = (0..rods).map(shape).collect();
    let curves = shapes
        .iter()
        .map(|shape| shape.nodes.iter().map(|node| node.position).collect())
        .collect();
    Equilibrium {
        scenario: "fan".into(),
        method: Method::default(),
        outcome: Outcome::Converged,
        remark: None,
        rod_count: rods,
        accuracy: Accuracy {
            segments: vec![segments],
            intervals: None,
            tolerance: 1e-6,
            residual: Some(1e-13),
            error_estimate: Some(3e-9),
        },
        energy: Some(11.07),
        tips: vec![point(0, 1.0)],
        tip_force_sum: DVec3::ZERO,
        stability: Stability {
            negative_eigenvalues: Some(0),
            ..Stability::default()
        },
        undulation: Undulation {
            veins: vec![Vein::default(); rods],
        },
        model: Model::default(),
        work: Work {
            steps: 8,
            factorizations: 9,
            force_evaluations: 9,
            cg_iterations: 40,
        },
        wall_seconds: 0.01,
        shape: relax::Shape {
            stations,
            rods: shapes,
            joined: true,
            curves,
        },
    }
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
    let still = vec![DVec3::ZERO; segments + 1];
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
            displacement: vec![still; rods],
        }),
        work: bvp::Work::default(),
    };
    let shot = Shot {
        tips: vec![turn * relaxed.tips[0]],
        found: Ok(solution),
        negative_eigenvalues: Some(2),
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
            ..MapRow::without_answer(cell, method, outcome, reference)
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

/// That fan at a time, swinging up and down.
pub fn frame(rods: usize, segments: usize, time: f64) -> Frame {
    let leaf = fan(rods, segments);
    let nodes = || leaf.shape.rods.iter().flat_map(|rod| &rod.nodes);
    let swing = DVec3::new(1.0, 1.0, 2.0 * time.cos());
    let turn = DQuat::from_rotation_y(0.1 * time.sin());
    let positions: Vec<DVec3> = nodes().map(|node| node.position * swing).collect();
    let moving = |x: &DVec3| Velocity {
        angular: DVec3::new(0.1, -0.2, 0.3 * time.sin()),
        linear: DVec3::new(0.0, 0.0, -x.z * time.sin() / 3.0),
    };
    Frame {
        time,
        steps: (100.0 * time) as usize,
        rods,
        velocities: positions.iter().map(moving).collect(),
        positions,
        rotations: nodes().map(|node| turn * node.rotation).collect(),
        energy: moment(time).energy,
    }
}

/// The energies of a damped swing at a time.
pub fn moment(time: f64) -> Moment {
    let left = (-0.1 * time).exp();
    let (fast, high) = (time.sin().powi(2), time.cos().powi(2));
    Moment {
        time,
        steps: (100.0 * time) as usize,
        energy: Energy {
            kinetic: left * fast,
            elastic: 0.7 * left * high,
            coupling: 0.1 * left * high,
            potential: 0.2 * left * high - 3.0,
            dissipated: 1.0 - left + 1e-5 * time.sin(),
            work: 0.0,
        },
        tip: DVec3::new(0.95, 0.0, -0.3 * time.cos()),
    }
}

/// A swing followed for 10 units of time.
pub fn record(rods: usize, segments: usize) -> Record {
    let moments: Vec<Moment> = (0..=100).map(|i| moment(0.1 * f64::from(i))).collect();
    let still = |moment: usize| Still {
        moment,
        curves: frame(rods, segments, moments[moment].time)
            .positions
            .chunks(segments + 1)
            .map(<[DVec3]>::to_vec)
            .collect(),
    };
    Record {
        scenario: "swing".into(),
        scheme: Scheme::Explicit,
        stopped: None,
        rods,
        joined: true,
        length: 1.0,
        segments,
        tolerance: 1e-6,
        duration: 10.0,
        time: 10.0,
        time_step: Some(9e-3),
        stable_step: Some(StableStep {
            step: 1e-2,
            limit: "shear with rotation",
        }),
        steps: 1000,
        stills: [0, 10, 25, 40, 55, 70, 85, 100].map(still).into(),
        tips: vec![moments[100].tip],
        moments,
        wall_seconds: 0.1,
    }
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
