//! Leaves as people measure them, drawn from a seed: TOML in centimetres and
//! newtons, with a section, a weight, tissue and, mostly, a curvature at rest.
//! Nothing here depends on the program, so that benchmarks draw the same
//! leaves as the tests do.

use std::f64::consts::PI;

/// Lengths in cm, forces in N.
struct Measured {
    seed: u64,
    /// Symmetric about the x axis.
    angles: Vec<f64>,
    length: f64,
    section: Section,
    young: f64,
    /// Per length of vein.
    weight: f64,
    /// In y and z.
    coupling: f64,
    rest_curvature: Option<f64>,
}

enum Section {
    /// Its diameter at the base and at the tip.
    Round(f64, f64),
    /// Width and thickness.
    Elliptical(f64, f64),
}

/// Powers of ten of a unit of length and of force in centimetres and newtons.
struct Units {
    length: (&'static str, i32),
    force: (&'static str, i32),
}

const CM_N: Units = Units {
    length: ("cm", 0),
    force: ("N", 0),
};
const M_N: Units = Units {
    length: ("m", 2),
    force: ("N", 0),
};
const MM_MN: Units = Units {
    length: ("mm", -1),
    force: ("mN", -3),
};

/// The leaf of a seed, in cm and N.
pub fn leaf(seed: u64) -> String {
    Measured::draw(seed).toml(&CM_N)
}

/// The same leaf in m and N, to the last decimal digit.
pub fn in_metres(seed: u64) -> String {
    Measured::draw(seed).toml(&M_N)
}

/// The same leaf in mm and mN, to the last decimal digit.
pub fn in_millimetres(seed: u64) -> String {
    Measured::draw(seed).toml(&MM_MN)
}

/// The same leaf with its veins numbered from the other side.
pub fn backwards(seed: u64) -> String {
    let mut leaf = Measured::draw(seed);
    leaf.angles.reverse();
    leaf.toml(&CM_N)
}

impl Measured {
    fn draw(seed: u64) -> Measured {
        let mut random = Random(seed);
        let rods = 3 + random.below(19) as usize;
        let length = rounded(random.log_uniform(5.0, 60.0));
        // The outermost veins of a leaf leave its base at 6 to 57 degrees.
        let widest = random.uniform(0.1, 1.0);
        let section = match random.below(2) {
            0 => {
                let base: f64 = random.log_uniform(0.03, 0.25);
                let tip = (base * random.uniform(0.3, 1.0)).max(0.03);
                Section::Round(rounded(base), rounded(tip))
            }
            _ => {
                let sides = [
                    random.log_uniform(0.03, 0.25),
                    random.log_uniform(0.03, 0.25),
                ];
                let [width, thickness] = [sides[0].max(sides[1]), sides[0].min(sides[1])];
                Section::Elliptical(rounded(width), rounded(thickness))
            }
        };
        let young = rounded(random.log_uniform(5e3, 2e5));
        let bending = young * section.mean_second_moment();
        Measured {
            seed,
            angles: fan(rods, widest),
            length,
            section,
            young,
            weight: random.log_uniform(0.3, 30.0) * bending / length.powi(3),
            coupling: random.log_uniform(0.3, 300.0) * bending / length.powi(4),
            rest_curvature: (random.below(5) < 3).then(|| random.uniform(-0.5, 1.5) / length),
        }
    }

    fn toml(&self, units: &Units) -> String {
        let number = |value: f64, length: i32, force: i32| {
            decimal(value, -length * units.length.1 - force * units.force.1)
        };
        let angles: Vec<String> = self.angles.iter().map(|&angle| decimal(angle, 0)).collect();
        let section = match self.section {
            Section::Round(base, tip) => format!(
                "shape = \"circle\"\ndiameter = {{ at = [0.0, 1.0], value = [{}, {}] }}",
                number(base, 1, 0),
                number(tip, 1, 0)
            ),
            Section::Elliptical(width, thickness) => format!(
                "shape = \"ellipse\"\nwidth = {}\nthickness = {}",
                number(width, 1, 0),
                number(thickness, 1, 0)
            ),
        };
        let rest = self.rest_curvature.map_or(String::new(), |curvature| {
            format!("[rest]\nbend_2 = {}\n\n", number(curvature, -1, 0))
        });
        let coupling = number(self.coupling, -2, 1);
        format!(
            "name = \"real-{}\"\n\n[units]\nlength = \"{}\"\nforce = \"{}\"\n\n\
             [leaf]\nrods = {}\nlength = {}\nfan = [{}]\n\n\
             [section]\n{section}\nyoung = {}\n\n{rest}\
             [coupling]\ny = {coupling}\nz = {coupling}\n\n\
             [load]\ngravity = [0.0, 0.0, {}]\n",
            self.seed,
            units.length.0,
            units.force.0,
            self.angles.len(),
            number(self.length, 1, 0),
            angles.join(", "),
            number(self.young, -2, 1),
            number(-self.weight, -1, 1),
        )
    }
}

impl Section {
    /// The geometric mean of both second moments of area in the middle of the
    /// vein, by which weight and tissue are measured.
    fn mean_second_moment(&self) -> f64 {
        let [width, thickness] = match *self {
            Section::Round(base, tip) => [0.5 * (base + tip); 2],
            Section::Elliptical(width, thickness) => [width, thickness],
        };
        PI * (width * thickness).powi(2) / 64.0
    }
}

/// Equally spaced from one side to the other, and exactly antisymmetric.
fn fan(rods: usize, widest: f64) -> Vec<f64> {
    let last = rods as f64 - 1.0;
    let angle = |rod: usize| widest * (2.0 * rod as f64 - last) / last;
    (0..rods).map(angle).collect()
}

/// Four significant digits: nobody measures a leaf more closely.
fn rounded(value: f64) -> f64 {
    decimal(value, 0).parse().expect("a number")
}

/// A value of four significant digits, times a power of ten. The digits are the
/// same in all systems of units.
fn decimal(value: f64, power: i32) -> String {
    let digits = format!("{value:.3e}");
    let (mantissa, exponent) = digits.split_once('e').expect("an exponent");
    let exponent: i32 = exponent.parse().expect("a whole number");
    format!("{mantissa}e{}", exponent + power)
}

/// SplitMix64 (Steele, Lea and Flood 2014): the same leaves on every machine.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        bits ^ (bits >> 31)
    }

    fn below(&mut self, count: u64) -> u64 {
        self.next() % count
    }

    fn uniform(&mut self, from: f64, to: f64) -> f64 {
        let fraction = (self.next() >> 11) as f64 / (1u64 << 53) as f64;
        from + (to - from) * fraction
    }

    fn log_uniform(&mut self, from: f64, to: f64) -> f64 {
        self.uniform(from.ln(), to.ln()).exp()
    }
}
