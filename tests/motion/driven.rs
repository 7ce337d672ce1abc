//! Leaves that loads drive: by forces that oscillate, against the transfer function of a cantilever, and by
//! loads that change smoothly, against many straight pieces; both methods alike, with their energies.

use glam::DVec3;
use leafdyn::internals::motion::{Physics, StepControl, TimeIntegrator};
use leafdyn::scenario::Sine;
use leafdyn_testing::motion::*;
use leafdyn_testing::*;
use std::f64::consts::PI;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// A complex number.
#[derive(Clone, Copy, Debug)]
pub struct Complex(pub f64, pub f64);

impl Add for Complex {
    type Output = Complex;

    fn add(self, other: Complex) -> Complex {
        Complex(self.0 + other.0, self.1 + other.1)
    }
}

impl Neg for Complex {
    type Output = Complex;

    fn neg(self) -> Complex {
        Complex(-self.0, -self.1)
    }
}

impl Sub for Complex {
    type Output = Complex;

    fn sub(self, other: Complex) -> Complex {
        self + -other
    }
}

impl Mul for Complex {
    type Output = Complex;

    fn mul(self, other: Complex) -> Complex {
        Complex(
            self.0 * other.0 - self.1 * other.1,
            self.0 * other.1 + self.1 * other.0,
        )
    }
}

impl Div for Complex {
    type Output = Complex;

    fn div(self, other: Complex) -> Complex {
        let size = other.0 * other.0 + other.1 * other.1;
        let Complex(a, b) = self * Complex(other.0, -other.1);
        Complex(a / size, b / size)
    }
}

impl Complex {
    pub fn sqrt(self) -> Complex {
        let size = self.0.hypot(self.1).sqrt();
        let half = 0.5 * self.1.atan2(self.0);
        Complex(size * half.cos(), size * half.sin())
    }

    pub fn exp(self) -> Complex {
        let size = self.0.exp();
        Complex(size * self.1.cos(), size * self.1.sin())
    }
}

/// The displacement of the tip of a cantilever of unit length, stiffness and mass, per unit of a force on it
/// that oscillates with the angular frequency omega: the solution w of w'''' = (omega^2 - i omega c) w
/// with w(0) = w'(0) = 0, w''(1) = 0 and w'''(1) = -1.
fn tip_response(omega: f64, damping: f64) -> Complex {
    let k = Complex(omega * omega, -omega * damping).sqrt().sqrt();
    let half = Complex(0.5, 0.0);
    let [up, down] = [k.exp(), (-k).exp()];
    let (cosh, sinh) = (half * (up + down), half * (up - down));
    let turned = Complex(-k.1, k.0);
    let [one, other] = [turned.exp(), (-turned).exp()];
    let (cos, sin) = (half * (one + other), Complex(0.0, -0.5) * (one - other));
    // w = a ((cosh kx - cos kx) + ratio (sinh kx - sin kx)).
    let ratio = -((cosh + cos) / (sinh + sin));
    let a = Complex(-1.0, 0.0) / (k * k * k * ((sinh - sin) + ratio * (cosh + cos)));
    a * ((cosh - cos) + ratio * (sinh - sin))
}

/// Statically a tip moves by F L^3/(3 EI), and at resonance it lags behind by a quarter of a period.
#[test]
fn the_transfer_function_has_its_limits() {
    let still = tip_response(1e-3, 1e-3);
    assert!((3.0 * still.0 - 1.0).abs() < 1e-6 && still.1.abs() < 1e-6);
    let resonant = tip_response(SLENDER[0] * SLENDER[0], 0.01);
    assert!(resonant.1 < -10.0 && resonant.0.abs() < 0.1 * resonant.1.abs());
}

fn sine(amplitude: [f64; 3], frequency: f64, phase: f64) -> Schedule<[f64; 3]> {
    Schedule::Sine(Sine {
        mean: [0.0; 3],
        amplitude,
        frequency,
        phase,
    })
}

/// A straight rod whose tip a small force shakes from time 0 on, damped so that it soon swings evenly.
fn shaken(r2: f64, stiffness: f64, frequency: f64) -> Scenario {
    let mut rod = beam(r2, [stiffness; 2]);
    rod.dynamics.external_damping = 2.0;
    rod.dynamics.tip_force = sine([0.0, 0.0, 1e-3], frequency, 0.4);
    rod.dynamics.duration = 40.0;
    rod
}

/// Where the tip is at a time, by steps of `h` on so many segments.
fn height(scheme: Scheme, scenario: &Scenario, segments: usize, h: f64, time: f64) -> f64 {
    let leaf = Leaf::new(scenario);
    let snapshot = at(scheme, &leaf, &released(&leaf, segments), h, time);
    snapshot.state.tip(0).z
}

/// Amplitude and phase below, at and above the lowest frequency, by the semi-implicit method: of second order
/// in the step, and extrapolated the exact ones of bending (rotary inertia and shear are next to none).
#[test]
fn a_shaken_cantilever_swings_as_its_transfer_function_says() {
    let lowest = SLENDER[0] * SLENDER[0] / (2.0 * PI);
    for frequency in [0.5 * lowest, lowest, 1.7 * lowest] {
        let rod = shaken(1e-7, 1e6, frequency);
        let Complex(real, imaginary) = tip_response(2.0 * PI * frequency, 2.0);
        let amplitude = 1e-3 * real.hypot(imaginary);
        for time in [18.0, 18.37] {
            let angle = 2.0 * PI * frequency * time + 0.4;
            let exact = 1e-3 * (real * angle.sin() + imaginary * angle.cos());
            let on =
                |segments: usize, h: f64| height(Scheme::SemiImplicit, &rod, segments, h, time);
            let off = |found: f64| (found - exact).abs() / amplitude;
            let (long, short) = (on(16, 0.02), on(16, 0.01));
            let coarse = on(8, 0.01);
            let extrapolated = short + (short - long) / 3.0 + (short - coarse) / 3.0;
            assert!(off(short) < 0.02, "{frequency}: {:e}", off(short));
            assert!(
                off(extrapolated) < 5e-4,
                "{frequency}: {:e} {:e}",
                off(extrapolated),
                off(short)
            );
        }
    }
}

/// Both methods, on one grid, of a rod whose shear and rotary inertia count.
#[test]
fn both_methods_follow_an_oscillating_force() {
    let rod = shaken(1e-2, 300.0, 0.9);
    let [explicit, implicit] = BOTH.map(|scheme| {
        let [long, short] = [1e-3, 5e-4].map(|h| height(scheme, &rod, 8, h, 5.0));
        short + (short - long) / 3.0
    });
    let off = (explicit - implicit).abs() / explicit.abs();
    assert!(off < 1e-5, "{explicit} {implicit}");
}

/// Steps that error control makes do not overlook a force that begins with nothing.
#[test]
fn no_oscillation_is_overlooked() {
    let frequency = 3.0;
    let rod = shaken(1e-7, 1e6, frequency);
    let Complex(real, imaginary) = tip_response(2.0 * PI * frequency, 2.0);
    let leaf = Leaf::new(&rod);
    let mut found = semi_implicit(&leaf, &released(&leaf, 16), StepControl::LocalError(1e-7));
    let mut most = 0.0_f64;
    for k in 0..40 {
        found.advance(18.0 + 0.025 * f64::from(k)).unwrap();
        most = most.max(found.snapshot().state.tip(0).z.abs());
    }
    let amplitude = 1e-3 * real.hypot(imaginary);
    assert!(
        (most / amplitude - 1.0).abs() < 0.05,
        "{most:e} {amplitude:e}"
    );
}

/// The momentum of a free rod is the integral of the force, exactly by the explicit method.
#[test]
fn a_free_rod_has_the_momentum_of_the_oscillation() {
    let mut rod = twisted_rod();
    rod.dynamics.clamped = false;
    rod.dynamics.tip_force = sine([0.02, -0.1, 0.05], 0.7, 0.2);
    let leaf = Leaf::new(&rod);
    let (grid, physics) = (discrete(&leaf, 4), Physics::new(&leaf));
    let omega = 2.0 * PI * 0.7;
    for until in [0.31, 1.7] {
        let snapshot = at(Scheme::Explicit, &leaf, &released(&leaf, 4), 2e-3, until);
        let nodes = grid.rod_index_pairs(0..=4);
        let masses = nodes.map(|(j, i)| physics.inertia(&grid, j, i).mass);
        let momenta = masses.zip(&snapshot.velocity);
        let sum: DVec3 = momenta.map(|(mass, v)| mass * v.linear).sum();
        let gained = sum * leaf.scale.force() * physics.time_unit;
        let impulse = (0.2_f64.cos() - (omega * until + 0.2).cos()) / omega;
        let exact = impulse * DVec3::new(0.02, -0.1, 0.05);
        let off = gained.distance(exact) / exact.length();
        assert!(off < 1e-9, "{until}: {off:e}");
    }
}

/// A force that changes smoothly moves a leaf as one of many straight pieces does.
#[test]
fn a_smooth_force_is_that_of_many_straight_pieces() {
    let values = vec![
        [0.0; 3],
        [0.3, -0.2, 0.6],
        [0.1, 0.2, -0.4],
        [0.0, 0.0, 0.2],
    ];
    let smooth = Schedule::smooth(vec![0.1, 0.5, 0.7, 1.3], values);
    let count = 400;
    let pieces: Vec<f64> = (0..=count)
        .map(|k| 0.1 + 1.2 * f64::from(k) / f64::from(count))
        .collect();
    let values = pieces.iter().map(|time| smooth.at(*time)).collect();
    let straight = Schedule::linear(pieces, values);
    for scheme in BOTH {
        let [one, other, still] =
            [&smooth, &straight, &Schedule::constant([0.0; 3])].map(|force| {
                let mut rod = twisted_rod();
                rod.dynamics.tip_force = force.clone();
                let leaf = Leaf::new(&rod);
                let start = released(&leaf, 8);
                at(scheme, &leaf, &start, 2e-3, 1.5).state.tip(0)
            });
        let off = one.distance(other) / one.distance(still);
        assert!(off < 1e-4, "{scheme:?}: {off:e}");
    }
}

/// The work of oscillating loads and rest shapes is in the balance of the energy, of second order in the
/// step.
#[test]
fn the_work_of_oscillations_is_accounted_for() {
    for scheme in BOTH {
        let imbalance = |h: f64| {
            let mut rod = twisted_rod();
            rod.dynamics.gravity = sine([0.1, -0.3, 0.4], 0.8, 0.3);
            rod.dynamics.rest = Schedule::Sine(Sine {
                mean: 1.0,
                amplitude: 0.5,
                frequency: 0.4,
                phase: 0.0,
            });
            let leaf = Leaf::new(&rod);
            energy_imbalance(scheme, &leaf, &released(&leaf, 4), h, (40, 0.05))
        };
        let [long, short] = [4e-3, 2e-3].map(imbalance);
        assert!(
            short < 0.35 * long && short < 1e-3,
            "{scheme:?}: {long:e} {short:e}"
        );
    }
}

/// What makes no sense is refused, with what would.
#[test]
fn schedules_that_make_no_sense_are_refused() {
    let text = |force: &str| {
        format!(
            "name = \"rod\"\n\
             leaf = {{ rods = 1, length = 1.0, fan = [0.0] }}\n\
             section = {{ shape = \"circle\", diameter = 0.1, young = 1e4, mass_density = 1e-3 }}\n\
             dynamics = {{ tip_force = {{ {force} }} }}"
        )
    };
    assert!(Scenario::from_toml(&text("amplitude = [0, 0, 1e-3], frequency = 2.0")).is_ok());
    for (force, why) in [
        (
            "amplitude = [0, 0, 1], frequency = 0",
            "must be greater than 0",
        ),
        ("amplitude = [0, 0, 1]", "frequency is missing"),
        ("frequency = 1.0", "amplitude is missing"),
        (
            "amplitude = [0, 0, 1], frequency = 1.0, at = [0.0]",
            "unknown key at",
        ),
        (
            "amplitude = [0, 0, 1e-3], frequency = 1e9",
            "a lower frequency or a shorter duration",
        ),
        (
            "at = [0.0, 1.0], value = [[0, 0, 0], [0, 0, 1e-3]], smooth = 1",
            "smooth",
        ),
    ] {
        let refused = Scenario::from_toml(&text(force)).unwrap_err().to_string();
        assert!(refused.contains(why), "{force}: {refused}");
    }
}
