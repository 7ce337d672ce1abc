//! At rest, what holds of any body in equilibrium holds of the output, checked
//! from the nodes alone: no part of the solver takes part.

use glam::DMat3;
use leafdyn_testing::*;

/// Three different veins, twisted, tapered and bent at rest, coupled, loaded.
fn twisted(joined: bool) -> Scenario {
    let mut leaf = paper_leaf(3, [0.9, 1.2, 0.7], [80.0, 60.0, 40.0], 0.8);
    leaf.joined = joined;
    leaf.coupling = vec![[0.5, 1.0, 2.0], [3.0, 0.2, 1.0]];
    leaf.gravity = [0.2, -0.1, -0.8];
    leaf.tip_force = [0.3, 0.2, 0.4];
    for (j, rod) in leaf.rods.iter_mut().enumerate() {
        rod.length = 1.0 + 0.1 * j as f64;
        rod.rest_curvature = [0.4, 0.8 - 0.5 * j as f64, 0.3].map(Profile::Constant);
        rod.couple_stiffness[1] = linear(&[0.0, 1.0], &[1.5, 0.5]);
    }
    leaf
}

fn scenes() -> Vec<Scenario> {
    let mut rigid = twisted(true);
    for rod in &mut rigid.rods {
        rod.force_stiffness = [f64::INFINITY; 3].map(Profile::Constant);
    }
    let mut single = fig04(1);
    single.rods[0].angle = 0.4;
    single.tip_force = [0.5, -0.7, 1.0];
    let mut with_moment = single.clone();
    with_moment.tip_moment = [0.4, 0.5, -0.6];
    let twisted = [true, false].map(twisted);
    [vec![fig04(5), rigid, single, with_moment], twisted.into()].concat()
}

fn vector(a: [f64; 3]) -> DVec3 {
    DVec3::from_array(a)
}

/// Nodal weights of the trapezoidal rule, fractions of the length.
fn weights(leaf: &Equilibrium) -> Vec<f64> {
    let nodes = leaf.shape.stations.len();
    let at = |i: usize| leaf.shape.stations[i.min(nodes - 1)];
    let weight = |i: usize| 0.5 * (at(i + 1) - at(i.saturating_sub(1)));
    (0..nodes).map(weight).collect()
}

/// From the first rod of a gap to the second, at a node.
fn across(leaf: &Equilibrium, gap: usize, i: usize) -> DVec3 {
    let [a, b] = [gap, gap + 1].map(|j| leaf.shape.rods[j].nodes[i].position);
    b - a
}

/// Force of a gap on its first rod, per unit of the fraction of the length.
fn coupling(scenario: &Scenario, leaf: &Equilibrium, gap: usize, i: usize) -> DVec3 {
    let mean = 0.5 * (leaf.shape.rods[gap].length + leaf.shape.rods[gap + 1].length);
    vector(scenario.coupling[gap]) * across(leaf, gap, i) * mean
}

fn tip_forces(scenario: &Scenario) -> usize {
    match scenario.joined {
        true => 1,
        false => scenario.rods.len(),
    }
}

/// What acts on all tips.
fn tip_load(scenario: &Scenario) -> DVec3 {
    vector(scenario.tip_force) * tip_forces(scenario) as f64
}

/// On any grid, exactly, and so in the extrapolated result.
#[test]
fn the_bases_carry_all_forces() {
    for scenario in scenes() {
        for leaf in [settle(&scenario, 1e-11), settle_on(&scenario, 16, false)] {
            let weight: f64 = scenario.rods.iter().map(|rod| rod.length).sum();
            let load = vector(scenario.gravity) * weight + tip_load(&scenario);
            let off = carried(&leaf.shape.rods) - load;
            assert!(off.length() < 1e-9, "{off}");
        }
    }
}

/// On any grid, exactly: the midpoint element does not notice how the leaf
/// lies in space. Couplings act between different points, so that those that
/// are not equal along all axes leave a moment.
#[test]
fn the_bases_carry_all_moments() {
    for scenario in scenes() {
        let leaf = settle_on(&scenario, 16, false);
        let weights = weights(&leaf);
        let mut sum = -vector(scenario.tip_moment);
        for (rod, of) in leaf.shape.rods.iter().zip(&scenario.rods) {
            sum += in_lab(&rod.nodes[0]).1;
            for (node, weight) in rod.nodes.iter().zip(&weights) {
                sum -= node.position.cross(vector(scenario.gravity)) * (of.length * weight);
            }
        }
        for rod in leaf.shape.rods.iter().take(tip_forces(&scenario)) {
            let tip = rod.nodes.last().unwrap().position;
            sum -= tip.cross(vector(scenario.tip_force));
        }
        for gap in 0..scenario.coupling.len() {
            for (i, weight) in weights.iter().enumerate() {
                let apart = -across(&leaf, gap, i);
                sum -= apart.cross(coupling(&scenario, &leaf, gap, i)) * *weight;
            }
        }
        assert!(sum.length() < 1e-9, "{}: {sum}", scenario.rods.len());
    }
}

#[test]
fn tips_meet_and_carry_the_tip_force_and_no_moment() {
    for scenario in scenes() {
        let leaf = settle(&scenario, 1e-11);
        let rods = 0..leaf.shape.rods.len();
        let tips: Vec<NodeState> = rods.map(|rod| tip_node(&leaf.shape.rods, rod)).collect();
        let carried: DVec3 = tips.iter().map(|tip| in_lab(tip).0).sum();
        let load = tip_load(&scenario);
        assert!((carried - load).length() < 1e-9, "{carried}");
        assert!((leaf.tip_force_sum - load).length() < 1e-9);
        for tip in &tips {
            let moment = in_lab(tip).1 - vector(scenario.tip_moment);
            assert!(moment.length() < 1e-9, "{moment}");
            if scenario.joined {
                assert_eq!(tip.position, leaf.tips[0]);
            } else {
                assert!((in_lab(tip).0 - vector(scenario.tip_force)).length() < 1e-9);
            }
        }
        assert_eq!(leaf.tips.len(), tip_forces(&scenario));
    }
}

#[test]
fn the_clamp_holds_and_directors_are_orthonormal() {
    for scenario in scenes() {
        let leaf = settle(&scenario, 1e-11);
        for (rod, of) in leaf.shape.rods.iter().zip(&scenario.rods) {
            let base = rod.nodes[0];
            assert_eq!(base.position, DVec3::ZERO);
            let (sin, cos) = of.angle.sin_cos();
            assert!((base.rotation * DVec3::X - DVec3::new(cos, sin, 0.0)).length() < 1e-15);
            assert!((base.rotation * DVec3::Z - DVec3::Z).length() < 1e-15);
            for node in &rod.nodes {
                let directors = DMat3::from_quat(node.rotation);
                let error = directors * directors.transpose() - DMat3::IDENTITY;
                let mut entries = error.to_cols_array().into_iter();
                assert!(entries.all(|e| e.abs() < 1e-14), "{error}");
            }
        }
    }
}

/// n = H (v - e1) and m = A (u - u0) at every node.
#[test]
fn strains_and_forces_obey_the_constitutive_law() {
    for scenario in scenes() {
        let leaf = settle(&scenario, 1e-8);
        for (rod, of) in leaf.shape.rods.iter().zip(&scenario.rods) {
            for (node, &sigma) in rod.nodes.iter().zip(&leaf.shape.stations) {
                for k in 0..3 {
                    let v = DVec3::X[k] + node.n[k] / of.force_stiffness[k].at(sigma);
                    close("v", node.v[k], v, 1e-14);
                    let moment = of.couple_stiffness[k].at(sigma)
                        * (node.u[k] - of.rest_curvature[k].at(sigma));
                    close("m", node.m[k], moment, 1e-14);
                }
            }
        }
    }
}

/// Largest differences along a rod between r' and R v, and between the
/// axial vector of R^T R' and u, the derivatives taken by central differences.
fn kinematics(rod: &RodShape) -> [f64; 2] {
    let ds = rod.length / (rod.nodes.len() - 1) as f64;
    rod.nodes.windows(3).fold([0.0, 0.0], |worst, w| {
        let slope = (w[2].position - w[0].position) / (2.0 * ds);
        let turn = (w[0].rotation.conjugate() * w[2].rotation).to_scaled_axis() / (2.0 * ds);
        [
            worst[0].max((slope - w[1].rotation * w[1].v).length()),
            worst[1].max((turn - w[1].u).length()),
        ]
    })
}

/// Largest imbalances along a rod of n' + f = 0 and m' + r' x n = 0, lab axes,
/// by central differences.
fn local_balance(scenario: &Scenario, leaf: &Equilibrium, j: usize) -> [f64; 2] {
    let rod = &leaf.shape.rods[j];
    let ds = rod.length / (rod.nodes.len() - 1) as f64;
    let mut worst = [0.0_f64; 2];
    for i in 1..rod.nodes.len() - 1 {
        let mut load = vector(scenario.gravity) * rod.length;
        if j + 1 < leaf.shape.rods.len() {
            load += coupling(scenario, leaf, j, i);
        }
        if j > 0 {
            load -= coupling(scenario, leaf, j - 1, i);
        }
        let [(n0, m0), (n, _), (n1, m1)] = [i - 1, i, i + 1].map(|i| in_lab(&rod.nodes[i]));
        let slope = rod.nodes[i].rotation * rod.nodes[i].v;
        worst[0] = worst[0].max(((n1 - n0) / (2.0 * ds) + load / rod.length).length());
        worst[1] = worst[1].max(((m1 - m0) / (2.0 * ds) + slope.cross(n)).length());
    }
    worst
}

/// Every field of the output satisfies the differential equations it is the
/// solution of, to second order in the step of the differences.
#[test]
fn kinematics_and_balance_hold_along_every_rod() {
    for scenario in scenes() {
        let errors = [32, 64, 128].map(|segments| {
            let leaf = settle_on(&scenario, segments, false);
            let rods = leaf.shape.rods.iter().enumerate();
            let of = |(j, rod)| [kinematics(rod), local_balance(&scenario, &leaf, j)];
            let all: Vec<_> = rods.map(of).collect();
            [0, 1, 2, 3].map(|k| largest(all.iter().map(|of| of[k / 2][k % 2])))
        });
        for k in 0..4 {
            let [coarse, middle, fine] = errors.map(|e| e[k]);
            assert!(fine < 2e-3, "equation {k}: {fine:.1e}");
            if fine > 1e-9 {
                for order in [order(coarse, middle), order(middle, fine)] {
                    assert!((order - 2.0).abs() < 0.15, "equation {k}: {order}");
                }
            }
        }
    }
}

/// Total potential energy by the trapezoidal rule over the nodes.
fn quadrature(scenario: &Scenario, leaf: &Equilibrium) -> f64 {
    let weights = weights(leaf);
    let mut energy = 0.0;
    for (rod, of) in leaf.shape.rods.iter().zip(&scenario.rods) {
        for ((node, weight), &sigma) in rod.nodes.iter().zip(&weights).zip(&leaf.shape.stations) {
            let mut density = -vector(scenario.gravity).dot(node.position);
            for k in 0..3 {
                density += 0.5 * node.n[k].powi(2) / of.force_stiffness[k].at(sigma);
                density += 0.5 * node.m[k].powi(2) / of.couple_stiffness[k].at(sigma);
            }
            energy += density * weight * of.length;
        }
    }
    for gap in 0..scenario.coupling.len() {
        for (i, weight) in weights.iter().enumerate() {
            energy += 0.5 * across(leaf, gap, i).dot(coupling(scenario, leaf, gap, i)) * weight;
        }
    }
    for rod in 0..tip_forces(scenario) {
        let tip = tip_node(&leaf.shape.rods, rod).position;
        energy -= tip.dot(vector(scenario.tip_force));
    }
    energy
}

#[test]
fn the_energy_is_that_of_the_fields() {
    for scenario in scenes() {
        let on = |segments| quadrature(&scenario, &settle_on(&scenario, segments, false));
        let sums = [16, 32, 64, 128].map(on);
        let leaf = settle(&scenario, 1e-11);
        let (sum, energy) = (extrapolate(&sums, 0.25), leaf.energy.unwrap());
        close("energy", sum, energy, 1e-9);
    }
}
