//! Made-up measurements.

use crate::common::random::splitmix64;
use leafdyn::study::{Base, Data, Fit, FitRequest, fit};

/// Normal numbers, always the same: by Box's and Muller's formula.
pub struct Noise(pub u64);

impl Noise {
    /// An even number between 0 and 1.
    pub fn even(&mut self) -> f64 {
        splitmix64(&mut self.0)
    }

    /// A normal number.
    pub fn normal(&mut self) -> f64 {
        let (a, b) = (1.0 - self.even(), self.even());
        (-2.0 * a.ln()).sqrt() * (std::f64::consts::TAU * b).cos()
    }
}

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

/// A scenario with entries replaced.
pub fn base(text: &str, entries: &[&str]) -> Base {
    let entries: Vec<String> = entries.iter().map(|entry| entry.to_string()).collect();
    Base::of_text(text.into(), "leaf.toml".into(), &entries).unwrap()
}

/// A fit of free numbers to these tables.
pub fn request(base: Base, data: &[&str], free: &[&str]) -> FitRequest {
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
    }
}

/// What a fit found.
pub fn fitted(request: &FitRequest) -> Fit {
    fit(request, &mut |_| {}).unwrap_or_else(|refused| panic!("{refused}"))
}

/// Tips of a leaf pulled by these forces, as a table with noise of a deviation.
pub fn pulls(
    text: &str,
    truth: &[&str],
    forces: &[[f64; 3]],
    sd: f64,
    noise: &mut Noise,
) -> String {
    let header = "load.tip_force[0],load.tip_force[1],load.tip_force[2],tip_x,tip_y,tip_z,sd_tip_x,sd_tip_y,sd_tip_z\n";
    let mut table = String::from(header);
    for force in forces {
        let load = format!("load.tip_force={force:?}");
        let entries: Vec<&str> = truth.iter().copied().chain([load.as_str()]).collect();
        let leaf = super::settle(base(text, &entries).scenario(), 1e-9);
        let tip = leaf.tips[0].to_array().map(|x| x + sd * noise.normal());
        let cells: Vec<String> = force
            .iter()
            .chain(&tip)
            .chain(&[sd; 3])
            .map(|x| format!("{x:?}"))
            .collect();
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
