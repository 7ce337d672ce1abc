//! What the tests share: reading a scenario file with some
//! entries replaced, relaxing it, and comparing with a reference.

pub mod bench;
pub mod branch;
pub mod fit;
pub mod motion;
mod pairs;
pub mod plane;
pub mod plate;
pub mod random;
pub mod real;
mod relaxing;
mod shot;
pub mod valid;
pub mod vibration;
pub mod workplace;

pub use std::f64::consts::PI;
use std::fmt::Debug;
use std::path::{Path, PathBuf};

pub use glam::DVec3;
pub use leafdyn::internals::leaf::Leaf;
use leafdyn::internals::leaf::Scale;
pub use leafdyn::relax::{Equilibrium, Limit, Method, NodeState, Options, Outcome, RodShape};
use leafdyn::scenario::{BaseSpin, BaseSupport, Dynamics, Radii, Rod, Units};
pub use leafdyn::scenario::{Profile, Scenario, Schedule};
pub use leafdyn::shape::Difference;
use leafdyn::study::BaseScenario;
pub use motion::TIMOSHENKO;
pub use pairs::pairs;
pub use relaxing::*;
pub use shot::*;

/// The folder of the repository.
pub fn root() -> &'static Path {
    let support = Path::new(env!("CARGO_MANIFEST_DIR"));
    let root = support.ancestors().nth(2);
    root.expect("this package stands two folders below")
}

/// The tolerance at which canonical values are checked: small enough for the
/// digits they are given with, large enough for double precision.
pub const TIGHT: f64 = 1e-11;

/// The files of a folder of scenarios, in order.
pub fn files(folder: &str) -> Vec<PathBuf> {
    let folder = path(folder).with_extension("");
    let entries = std::fs::read_dir(folder).unwrap();
    let mut files: Vec<PathBuf> = entries.map(|file| file.unwrap().path()).collect();
    files.sort();
    files
}

/// All scenario files; measured data stand beside theirs.
pub fn scenario_files() -> Vec<PathBuf> {
    let folders = ["paper", "classic", "motion", "study", "measured", "field"];
    let mut all = folders.map(files).concat();
    all.retain(|file| file.extension().is_none_or(|kind| kind != "csv"));
    all
}

/// Those of leaves that come to rest: not in wind, in which `relax` only releases them.
pub fn resting_files() -> Vec<PathBuf> {
    let mut all = scenario_files();
    all.retain(|file| read(file, "").wind.is_none());
    all
}

/// The classic problems that shooting solves: those without grips.
pub fn classic_files_to_shoot() -> Vec<PathBuf> {
    let mut all = files("classic");
    all.retain(|file| read(file, "").grips.is_empty());
    all
}

/// The path of a scenario that comes with the program, such as `classic/rollup`.
pub fn path(name: &str) -> PathBuf {
    root().join("scenarios").join(format!("{name}.toml"))
}

/// Entries `KEY=VALUE` to be replaced as by `--set`, one text with `;` between them.
pub fn entries(text: &str) -> Vec<String> {
    let entries = text.split(';').map(str::trim);
    entries
        .filter(|e| !e.is_empty())
        .map(String::from)
        .collect()
}

/// What the environment asks for by a name, such as how many leaves are tried.
pub fn asked(name: &str, otherwise: usize) -> usize {
    std::env::var(name).map_or(otherwise, |text| text.parse().expect(name))
}

/// The only one of them.
#[track_caller]
pub fn only<T: Debug>(all: &[T]) -> &T {
    assert_eq!(all.len(), 1, "{all:?}");
    &all[0]
}

/// Largest of some numbers, none of which is negative; NaN if one of them is.
pub fn largest(numbers: impl IntoIterator<Item = f64>) -> f64 {
    let larger = |most: f64, number: f64| match number > most || number.is_nan() {
        true => number,
        false => most,
    };
    numbers.into_iter().fold(0.0, larger)
}

/// The scenario of a text with [`entries`] replaced, to be varied.
#[track_caller]
pub fn base(text: &str, overrides: &str) -> BaseScenario {
    let base = BaseScenario::from_text(text.into(), "test.toml".into(), &entries(overrides));
    base.unwrap_or_else(|error| panic!("{error}\n{text}"))
}

/// A scenario that comes with the program, with [`entries`] replaced.
#[track_caller]
pub fn scenario(name: &str, overrides: &str) -> Scenario {
    read(&path(name), overrides)
}

/// As [`scenario`], of a file.
#[track_caller]
pub fn read(file: &Path, overrides: &str) -> Scenario {
    Scenario::read_with(file, &entries(overrides)).unwrap_or_else(|error| panic!("{error}"))
}

/// A scenario from text.
#[track_caller]
pub fn parse(text: &str) -> Scenario {
    Scenario::from_toml(text).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

/// A straight rod along e1 of length one, and of stiffness one but for stretch
/// and shear.
pub const ROD: &str = r#"
    name = "rod"
    leaf = { rods = 1, length = 1.0, fan = [0.0] }
    stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = 100.0, shear_2 = 100.0, shear_3 = 100.0 }
"#;

/// The entries of a rod that neither stretches nor shears.
pub const RIGID: &str = "stiffness.axial=inf; stiffness.shear_2=inf; stiffness.shear_3=inf";

/// The rod [`ROD`] with [`entries`] replaced.
#[track_caller]
pub fn rod(overrides: &str) -> Scenario {
    let rod = Scenario::from_toml_with(ROD, "rod", &entries(overrides));
    rod.unwrap_or_else(|error| panic!("{error}"))
}

/// The text of [`ROD`] whose tip is held where it is at rest.
pub fn held(how: &str) -> String {
    format!("{ROD}\ntip = {{ held = \"{how}\", position = [1.0, 0.0, 0.0] }}")
}

/// The numbers of a text of lines of columns; `#` begins a comment.
#[track_caller]
pub fn table<const COLUMNS: usize>(text: &str) -> Vec<[f64; COLUMNS]> {
    let lines = text.lines().map(|line| line.split('#').next().unwrap());
    let rows = lines.filter(|line| !line.trim().is_empty()).map(|line| {
        let cells = line.split_whitespace().map(|cell| cell.parse().unwrap());
        let row: Vec<f64> = cells.collect();
        row.try_into().unwrap_or_else(|_| panic!("{line}"))
    });
    rows.collect()
}

/// What something comes to on so many threads.
pub fn on_threads<T: Send>(threads: usize, run: impl FnOnce() -> T + Send) -> T {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
    pool.build().unwrap().install(run)
}

/// The joint tip, or the only rod's.
pub fn tip(leaf: &Equilibrium) -> DVec3 {
    leaf.tips[0]
}

/// The last node of a rod.
pub fn tip_node(rods: &[RodShape], rod: usize) -> NodeState {
    *rods[rod].nodes.last().unwrap()
}

/// The angle by which the tip's tangent is turned from e1 towards `axis`.
pub fn tip_angle(rods: &[RodShape], rod: usize, axis: DVec3) -> f64 {
    let tangent = tip_node(rods, rod).rotation * DVec3::X;
    tangent.dot(axis).atan2(tangent.x)
}

/// The sum of the forces at the bases.
pub fn carried(rods: &[RodShape]) -> DVec3 {
    rods.iter().map(|rod| in_lab(&rod.nodes[0]).0).sum()
}

/// Force and moment of a node along the lab axes.
pub fn in_lab(node: &NodeState) -> (DVec3, DVec3) {
    (node.rotation * node.n, node.rotation * node.m)
}

/// Asserts `found` = `wanted` within `tolerance`.
#[track_caller]
pub fn close(what: &str, found: f64, wanted: f64, tolerance: f64) {
    let error = (found - wanted).abs();
    let what = format!("{what}: {found} is {error:.1e} from {wanted}");
    assert!(error <= tolerance, "{what}, allowed {tolerance:.1e}");
}

/// Asserts that the tip is `wanted`, whose components are known to `digits`,
/// within `tolerance`, and that the error estimate covers the error.
#[track_caller]
pub fn tip_is(what: &str, leaf: &Equilibrium, wanted: DVec3, digits: f64, tolerance: f64) {
    assert!(digits <= tolerance);
    let error = (tip(leaf) - wanted).abs().max_element();
    let what = format!("{what}: tip {} is {error:.1e} from {wanted}", tip(leaf));
    assert!(error <= tolerance, "{what}, allowed {tolerance:.1e}");
    let estimate = estimate(leaf);
    assert!(error <= estimate + digits, "{what}, told {estimate:.1e}");
}

/// The error that a leaf is told to have.
#[track_caller]
pub fn estimate(leaf: &Equilibrium) -> f64 {
    leaf.accuracy.error_estimate.unwrap()
}

/// All nodes of some rods.
pub fn nodes(rods: &[RodShape]) -> impl Iterator<Item = &NodeState> {
    rods.iter().flat_map(|rod| &rod.nodes)
}

/// [`entries`] of the three stretch and shear stiffnesses.
pub fn set_stiffness(axial: f64, shear: f64) -> String {
    format!("stiffness.axial={axial}; stiffness.shear_2={shear}; stiffness.shear_3={shear}")
}

/// Linear between points, fractions of the length.
pub fn linear(at: &[f64], value: &[f64]) -> Profile {
    Profile::Linear {
        at: at.to_vec(),
        value: value.to_vec(),
    }
}

/// The order of an error that is `coarse` at some step and `fine` at half of it.
pub fn order(coarse: f64, fine: f64) -> f64 {
    (coarse / fine).log2()
}

/// Removes the leading error from values whose error is a series in a quantity
/// that falls to `part` from one to the next (1/4: ds^2 on nested grids).
pub fn extrapolate(values: &[f64], part: f64) -> f64 {
    let mut column = values.to_vec();
    let mut power = 1.0;
    while column.len() > 1 {
        power *= part;
        let next = |w: &[f64]| w[1] + (w[1] - w[0]) * power / (1.0 - power);
        column = column.windows(2).map(next).collect();
    }
    column[0]
}

/// A leaf of the paper: equal veins of unit length in its fan, couplings
/// (0, 1, 1), weight along -e3. To be changed at will.
pub fn paper_leaf(rods: usize, couple: [f64; 3], force: [f64; 3], weight: f64) -> Scenario {
    let constant = |values: [f64; 3]| values.map(Profile::Constant);
    let angle = |n: usize| PI * (2.0 * n as f64 / rods as f64 - 1.0) / 3.0;
    let veins: Vec<_> = (1..=rods)
        .map(|n| Rod {
            length: 1.0,
            base: [0.0; 3],
            angle: angle(n),
            elevation: 0.0,
            roll: 0.0,
            couple_stiffness: constant(couple),
            force_stiffness: constant(force),
            rest_curvature: constant([0.0; 3]),
            rest_stretch: Profile::Constant(1.0),
        })
        .collect();
    let gravity = [0.0, 0.0, -weight];
    Scenario {
        name: "leaf".into(),
        units: Units::default(),
        dynamics: Dynamics::default_for(&veins).with_loads(gravity, [0.0; 3], [0.0; 3]),
        rods: veins,
        radii: Radii::default(),
        base_held: vec![BaseSupport::Clamped; rods],
        base_turn_stiffness: Vec::new(),
        base_spin: BaseSpin::Free,
        joined: true,
        coupling: vec![[0.0, 1.0, 1.0]; rods - 1],
        tissue: None,
        tissue_grown: true,
        blade: None,
        gravity,
        own_gravity: Vec::new(),
        g: [0.0; 3],
        weighs_points_only: false,
        distributed: None,
        foundation: None,
        factored: None,
        follower: None,
        couple: None,
        couple_follows: false,
        points: Vec::new(),
        tip_force: [0.0; 3],
        tip_moment: [0.0; 3],
        held_tip: None,
        grips: Vec::new(),
        support_motion: None,
        wind: None,
        photo: None,
        natural: None,
        tolerance: 1e-6,
        place_shift: 0.0,
    }
}

/// Fig. 4 of the paper with so many veins.
pub fn fig04(rods: usize) -> Scenario {
    paper_leaf(rods, [1.0; 3], [100.0; 3], 1.0)
}

/// Largest distance between two results at the stations they share.
pub fn distance(a: &Equilibrium, b: &Equilibrium) -> f64 {
    let (mut largest, mut shared) = (0.0_f64, 0);
    for (i, sigma) in a.shape.stations.iter().enumerate() {
        let mut stations = b.shape.stations.iter();
        let Some(k) = stations.position(|s| (s - sigma).abs() < 1e-12) else {
            continue;
        };
        shared += 1;
        for (p, q) in a.shape.rods.iter().zip(&b.shape.rods) {
            largest = largest.max((p.nodes[i].position - q.nodes[k].position).length());
        }
    }
    assert!(shared >= 2, "base and tip at least are shared");
    largest
}

/// The units of a scenario.
pub fn scale(scenario: &Scenario) -> Scale {
    Leaf::new(scenario).scale
}

/// Asserts that a leaf found by a reduced model is that of the full one.
#[track_caller]
pub fn same(scenario: &Scenario, found: &Equilibrium, full: &Equilibrium) {
    let off = apart(scenario, &found.shape.rods, &full.shape.rods);
    // Ends that differ by so much turn a segment of a twentieth by so much more.
    // Iterations of 1e-12 in the energy norm leave soft modes so much.
    let rotated = off.rotation < 20.0 * 1e-10;
    assert!(off.position < 5e-10 && rotated, "{off:?}");
    assert!(off.force < 1e-8 && off.moment < 1e-8, "{off:?}");
    let [found, full] = [found, full].map(|leaf| leaf.energy.unwrap());
    let unit = scale(scenario).moment() * (1.0 + full.abs());
    let energy = found - full;
    assert!(energy.abs() < 1e-10 * unit, "{energy:.1e}");
}

/// Everything about a shape, bit by bit.
pub fn bits(rods: &[RodShape]) -> Vec<u64> {
    let nodes = rods.iter().flat_map(|rod| &rod.nodes);
    let numbers = nodes.flat_map(|node| {
        let vectors = [node.position, node.v, node.u, node.n, node.m];
        let vectors = vectors.into_iter().flat_map(|v| v.to_array());
        vectors.chain(node.rotation.to_array())
    });
    numbers.map(f64::to_bits).collect()
}

/// Largest differences between two shapes in units of length, A/L^2 and A/L.
pub fn apart(scenario: &Scenario, a: &[RodShape], b: &[RodShape]) -> Difference {
    assert_eq!(a.len(), b.len());
    for (a, b) in a.iter().zip(b) {
        assert_eq!(a.nodes.len(), b.nodes.len());
    }
    let (scale, difference) = (scale(scenario), Difference::between(a, b));
    Difference {
        position: difference.position / scale.length,
        rotation: difference.rotation,
        force: difference.force / scale.force(),
        moment: difference.moment / scale.moment(),
    }
}
