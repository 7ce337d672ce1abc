//! Masses that land on a leaf in motion: the modes of a beam with a mass, momentum and energy, and both methods alike.

use leafdyn::internals::motion::{Physics, StepControl, TimeIntegrator};
use leafdyn::scenario::{Landing, PointLoad};
use leafdyn_testing::motion::*;
use leafdyn_testing::{DVec3, Leaf, PI, Scenario};

/// A mass that lands on a point of a vein.
fn land(scenario: &mut Scenario, (vein, at): (usize, f64), landing: Landing) {
    scenario.points.push(PointLoad {
        follows: false,
        vein,
        at,
        force: [0.0; 3],
        moment: [0.0; 3],
        mass: 0.0,
        offset: [0.0; 2],
        in_time: None,
        landing: Some(landing),
    });
}

const DROP: Landing = Landing {
    mass: 0.3,
    from: 0.1,
    velocity: [0.0, 0.0, -0.01],
};

/// A mode of a cantilever of unit length, stiffness and mass, normalised by mass.
struct Mode {
    /// The root of its frequency.
    root: f64,
}

impl Mode {
    fn new(number: u32) -> Mode {
        let mut b = (f64::from(number) + 0.5) * PI;
        if number == 0 {
            b = SLENDER[0];
        }
        for _ in 0..20 {
            b -= (b.cos() + 1.0 / b.cosh()) / (-b.sin() - b.tanh() / b.cosh());
        }
        Mode { root: b }
    }

    fn squared_frequency(&self) -> f64 {
        self.root.powi(4)
    }

    fn shape(&self, x: f64) -> f64 {
        let b = self.root;
        let (end, sum) = ((-b).exp() - b.sin() + b.cos(), b.sinh() + b.sin());
        let ratio = (b.cosh() + b.cos()) / sum;
        let y = b * x;
        // cosh y - ratio sinh y without the difference of large numbers.
        (-y).exp() - end * (y.sinh() / sum) - y.cos() + ratio * y.sin()
    }
}

/// A mode of the cantilever with a mass on one of its points, in those of the cantilever: its squared frequency lambda is
/// a root of 1 = lambda m sum phi^2(x)/(omega^2 - lambda), and the part of each lambda m phi(x) s/(omega^2 - lambda).
struct LoadedMode {
    lambda: f64,
    modes: Vec<Mode>,
    parts: Vec<f64>,
}

impl LoadedMode {
    fn new(number: usize, mass: f64, x: f64) -> LoadedMode {
        let all = (0..60).map(Mode::new);
        // A mass on a node of a mode has no part in it.
        let modes: Vec<Mode> = all.filter(|it| it.shape(x).abs() > 1e-6).collect();
        let part = |it: &Mode, lambda: f64| {
            lambda * mass * it.shape(x) / (it.squared_frequency() - lambda)
        };
        let sum =
            |lambda: f64| -> f64 { modes.iter().map(|it| part(it, lambda) * it.shape(x)).sum() };
        // Roots lie between the squared frequencies without the mass.
        let before = number
            .checked_sub(1)
            .map(|before| modes[before].squared_frequency());
        let [mut low, mut high] = [before.unwrap_or(0.0), modes[number].squared_frequency()];
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            match sum(middle) < 1.0 {
                true => low = middle,
                false => high = middle,
            }
        }
        let lambda = low;
        let parts: Vec<f64> = modes.iter().map(|it| part(it, lambda)).collect();
        // The displacement s of the mass is one so far.
        let norm = (parts.iter().map(|it| it * it).sum::<f64>() + mass).sqrt();
        LoadedMode {
            lambda,
            parts: parts.iter().map(|it| it / norm).collect(),
            modes,
        }
    }

    fn shape(&self, x: f64) -> f64 {
        let modes = self.modes.iter().zip(&self.parts);
        modes.map(|(mode, part)| part * mode.shape(x)).sum()
    }
}

/// A slender cantilever moves in its modes with the mass, each of which has its part of the momentum, m v phi(x): of
/// second order in steps and segments, and extrapolated as exactly as that.
#[test]
fn a_beam_with_a_mass_moves_in_its_modes() {
    for (x, mass) in [(0.5, 0.3), (1.0, 1.5)] {
        let mut rod = beam(1e-8, [1e7; 2]);
        land(&mut rod, (0, x), Landing { mass, ..DROP });
        let leaf = Leaf::new(&rod);
        for number in 0..2 {
            let mode = LoadedMode::new(number, mass, x);
            let omega = mode.lambda.sqrt();
            let amplitude = -0.01 * mass * mode.shape(x) / omega;
            // The part of the mode in the displacements.
            let part = |segments: usize, h: f64, time: f64| {
                let (grid, mut physics) = (discrete(&leaf, segments), Physics::new(&leaf));
                let now = at(
                    Scheme::SemiImplicit,
                    &leaf,
                    &released(&leaf, segments),
                    h,
                    time,
                );
                physics.land_next_mass();
                let of_node = |i: usize| {
                    let weight = physics.inertia(&grid, 0, i).mass * now.state.x[i].z;
                    weight * mode.shape(grid.grid.sigma()[i])
                };
                (1..=segments).map(of_node).sum::<f64>()
            };
            for time in [0.17, 0.6] {
                let exact = amplitude * (omega * (time - 0.1)).sin();
                let off = |found: f64| ((found - exact) / amplitude).abs();
                let h = 0.02 / omega;
                let (long, short) = (part(64, 2.0 * h, time), part(64, h, time));
                let coarse = part(32, h, time);
                let found = short + (short - long) / 3.0 + (short - coarse) / 3.0;
                assert!(
                    off(found) < 5e-5,
                    "{x} {number} {time}: {:e} {:e}",
                    off(found),
                    off(short)
                );
            }
        }
    }
}

/// A rod whose shear and rotary inertia count, damped as given, on which masses with a weight land one after the other.
fn struck((external, internal): (f64, f64)) -> Scenario {
    let mut rod = twisted_rod();
    rod.dynamics.external_damping = external;
    rod.dynamics.internal_damping = internal;
    rod.g = [0.0, 0.3, -1.0];
    let velocity = [0.4, -0.6, -1.0];
    land(
        &mut rod,
        (0, 0.5),
        Landing {
            velocity,
            from: 0.0537,
            ..DROP
        },
    );
    land(
        &mut rod,
        (0, 1.0),
        Landing {
            velocity,
            from: 0.2,
            mass: 0.1,
        },
    );
    rod
}

/// Both methods are of second order in the step, with all dampings, and have the same limit.
#[test]
fn both_methods_are_of_second_order() {
    for damping in DAMPINGS {
        let scenario = struck(damping);
        let leaf = Leaf::new(&scenario);
        let start = released(&leaf, 4);
        let limits = BOTH.map(|scheme| {
            let steps = match scheme {
                Scheme::Explicit => [2e-3, 1e-3, 5e-4],
                Scheme::SemiImplicit => [2e-3, 1e-3, 5e-4],
            };
            let [a, b, c] = steps.map(|h| numbers(&at(scheme, &leaf, &start, h, 0.6)));
            let ratio = distance(&a, &b) / distance(&b, &c);
            assert!(
                (3.0..5.5).contains(&ratio),
                "{damping:?} {scheme:?}: {ratio}"
            );
            limit(&b, &c)
        });
        let off = apart(&limits[0], &limits[1]);
        assert!(off < 2e-4, "{damping:?}: {off:e}");
    }
}

/// Masses that land on a tip that all veins share.
#[test]
fn both_methods_agree_on_a_joint_tip() {
    let mut leaf = three_veins();
    leaf.g = [0.0, 0.0, -1.0];
    land(
        &mut leaf,
        (1, 1.0),
        Landing {
            velocity: [0.1, -0.3, -1.0],
            ..DROP
        },
    );
    let made = Leaf::new(&leaf);
    let start = released(&made, 8);
    let tips = BOTH.map(|scheme| {
        let [a, b] = [1e-3, 5e-4].map(|h| at(scheme, &made, &start, h, 0.4).state.tip(0));
        b + (b - a) / 3.0
    });
    let off = tips[0].distance(tips[1]);
    assert!(off < 1e-4, "{off:e}");
}

/// The momentum of a free rod is that of the masses that landed on it, exactly by the explicit method, which goes on
/// in equal steps.
#[test]
fn a_free_rod_has_the_momentum_of_the_mass() {
    let mut rod = twisted_rod();
    rod.dynamics.clamped = false;
    land(
        &mut rod,
        (0, 0.5),
        Landing {
            velocity: [0.2, -0.5, 0.3],
            ..DROP
        },
    );
    let leaf = Leaf::new(&rod);
    for (time, momentum) in [(0.0999, DVec3::ZERO), (0.1, DVec3::ONE), (0.3, DVec3::ONE)] {
        let snapshot = at(Scheme::Explicit, &leaf, &released(&leaf, 4), 7e-3, time);
        let mut physics = Physics::new(&leaf);
        if time >= 0.1 {
            physics.land_next_mass();
        }
        let grid = discrete(&leaf, 4);
        let nodes = grid.rod_index_pairs(0..=4);
        let masses = nodes.map(|(j, i)| physics.inertia(&grid, j, i).mass);
        let sum: DVec3 = masses
            .zip(&snapshot.velocity)
            .map(|(mass, v)| mass * v.linear)
            .sum();
        let gained = sum * leaf.scale.force() * physics.time_unit;
        let exact = momentum * 0.3 * DVec3::new(0.2, -0.5, 0.3);
        assert!(gained.distance(exact) < 1e-13, "{time}: {gained} {exact}");
    }
}

/// The energy that is lost is told, vanishes with the length of the segments, and is in the balance, which a landing does
/// not change.
#[test]
fn the_lost_energy_is_accounted_for() {
    for scheme in BOTH {
        let lost = |segments: usize| {
            let mut rod = beam(1e-2, [300.0; 2]);
            rod.g = [0.0, 0.2, -1.0];
            land(&mut rod, (0, 0.5), DROP);
            let leaf = Leaf::new(&rod);
            let mut method = method(scheme, &leaf, &released(&leaf, segments), 1e-3);
            let before = method.advance(0.1 - 1e-9).unwrap().energy;
            let velocity = method.snapshot().velocity[segments / 2].linear * leaf.scale.length
                / Physics::new(&leaf).time_unit;
            let after = method.advance(0.1).unwrap().energy;
            let [impact] = method.impacts() else {
                panic!("{:?}", method.impacts());
            };
            assert!(
                (after.balance() - before.balance()).abs() < 1e-10,
                "{before:?} {after:?}"
            );
            let node = 1.0 / segments as f64;
            let apart = DVec3::from_array(DROP.velocity).distance_squared(velocity);
            let exact = 0.5 * DROP.mass * node / (DROP.mass + node) * apart;
            let found = impact.lost_energy * leaf.scale.moment();
            assert!(
                (found / exact - 1.0).abs() < 1e-6,
                "{scheme:?}: {found:e} {exact:e}"
            );
            assert_eq!(impact.lost_energy, after.dissipated);
            found
        };
        let [coarse, fine] = [8, 16].map(lost);
        assert!(coarse / fine > 1.6, "{coarse:e} {fine:e}");
    }
}

/// The balance of energy is kept to second order, with masses, weights and damping.
#[test]
fn the_work_of_masses_is_accounted_for() {
    for scheme in BOTH {
        let imbalance = |h: f64| {
            let scenario = struck((0.4, 0.0));
            let leaf = Leaf::new(&scenario);
            energy_imbalance(scheme, &leaf, &released(&leaf, 4), h, (20, 0.03))
        };
        let [long, short] = [2e-3, 1e-3].map(imbalance);
        assert!(
            short < 0.35 * long && short < 1e-3,
            "{scheme:?}: {long:e} {short:e}"
        );
    }
}

/// A rigid vein takes the part of the blow along it at once, and moves on as a vein that hardly yields.
#[test]
fn rigid_veins_take_the_blow() {
    let made = |axial: f64| {
        let mut rod = beam(1e-3, [axial; 2]);
        land(
            &mut rod,
            (0, 1.0),
            Landing {
                velocity: [-0.7, 0.0, -0.4],
                ..DROP
            },
        );
        rod
    };
    let moved = |axial: f64, until: f64| {
        let scenario = made(axial);
        let leaf = Leaf::new(&scenario);
        at(
            Scheme::SemiImplicit,
            &leaf,
            &released(&leaf, 8),
            1e-3,
            until,
        )
    };
    let now = moved(f64::INFINITY, 0.1);
    for v in &now.velocity {
        assert!(v.linear.x.abs() < 1e-6, "{v:?}");
    }
    assert!(now.velocity[8].linear.z < -0.1);
    let [rigid, stiff] = [f64::INFINITY, 1e6].map(|axial| moved(axial, 0.5).state.tip(0));
    assert!(
        rigid.z < -0.05 && rigid.distance(stiff) < 0.02 * rigid.z.abs(),
        "{rigid} {stiff}"
    );
}

const ROD: &str = r#"
    name = "rod"
    leaf = { rods = 1, length = 1.0, fan = [0.0] }
    section = { shape = "circle", diameter = 0.1, young = 1e4, mass_density = 1e-3 }
    [load]
    g = [0.0, 0.0, -9.81]
    [[load.point]]
    vein = 1
    at = 0.5
    mass = 1e-3
    from = 0.01
    velocity = [0.0, 0.0, -3.0]
"#;

/// Before it lands a mass has no part in the leaf: at rest and in modes.
#[test]
fn a_mass_that_has_not_landed_is_absent() {
    let scenario = Scenario::from_toml(ROD).unwrap();
    let mut without = scenario.clone();
    without.points.clear();
    let rest = |it: &Scenario| {
        leafdyn_testing::tip(&leafdyn_testing::settled(it, &leafdyn_testing::to(1e-9)))
    };
    assert!(rest(&scenario).distance(rest(&without)) < 1e-12);
    let again = Scenario::from_toml(&serde_json::to_string(&scenario).unwrap()).unwrap();
    assert_eq!(again, scenario);
    assert_eq!(
        [0.0, 0.01].map(|time| scenario.at_time(time).points[0].mass),
        [0.0, 1e-3]
    );
}

/// What makes no sense is refused, with what would.
#[test]
fn masses_that_make_no_sense_are_refused() {
    for (set, why) in [
        (
            "load.point[0].from=0",
            "give from, the time at which it does",
        ),
        ("load.point[0].mass=0", "add mass, greater than 0"),
        ("load.point[0].from=-1", "must not be negative"),
        ("load.point[0].velocity=[0,0,1e30]", "gives |v| T/L"),
        ("load.point[0].from=1e30", "gives |t|/T"),
    ] {
        let refused = Scenario::from_toml_with(ROD, "rod", &[set.into()])
            .unwrap_err()
            .to_string();
        assert!(refused.contains(why), "{set}: {refused}");
    }
}

/// What internal friction dissipates as velocities jump is the work of its stresses on the strains: of a drop on a leaf
/// of a material that creeps the energy is balanced, also in steps that are longer than the friction takes.
#[test]
fn friction_after_a_landing_is_in_the_balance_of_energy() {
    let mut scenario = beam(1e-3, [1e4; 2]);
    scenario.dynamics.internal_damping = 1e-3;
    scenario.dynamics.external_damping = 0.5;
    land(
        &mut scenario,
        (0, 0.6),
        Landing {
            mass: 0.05,
            from: 0.1,
            velocity: [0.0, 0.0, -0.5],
        },
    );
    let leaf = Leaf::new(&scenario);
    let off = [1e-5, 1e-6, 1e-7].map(|error| {
        let mut moving = semi_implicit(&leaf, &released(&leaf, 16), StepControl::LocalError(error));
        let start = moving.snapshot().energy.balance();
        moving.advance(1.0).unwrap();
        let energy = moving.snapshot().energy;
        (energy.balance() - start).abs() / energy.dissipated
    });
    assert!(off[0] < 0.2 && off[1] < 0.05 && off[2] < 0.01, "{off:?}");
}
