//! A shear modulus in place of Poisson's ratio: closed forms of twist and shear, the same leaf by both,
//! and what is refused.

use crate::sensitivities::{derivatives, differenced, keys, of, results};
use leafdyn::scenario::Rod;
use leafdyn_testing::*;

/// A straight rod of unit length along e1 with this section and load.
fn beam(section: &str, load: &str) -> Scenario {
    parse(&format!(
        "name = 'beam'\nleaf = {{ rods = 1, length = 1.0, fan = [0.0] }}\nsection = {{ {section} }}\nload = {{ {load} }}"
    ))
}

/// All stiffnesses of a rod at a fraction of its length.
fn stiffnesses(rod: &Rod, sigma: f64) -> Vec<f64> {
    let all = rod.couple_stiffness.iter().chain(&rod.force_stiffness);
    all.map(|profile| profile.at(sigma)).collect()
}

/// theta = M L/(G J), however small G is beside E.
#[test]
fn a_moment_about_the_axis_twists_by_the_shear_modulus() {
    let (diameter, shear, moment) = (0.1_f64, 5e3, 0.04);
    let leaf = beam(
        "shape = 'circle', diameter = 0.1, young = 1e5, shear_modulus = 5e3",
        "tip_moment = [0.04, 0.0, 0.0]",
    );
    let wanted = moment / (shear * PI * diameter.powi(4) / 32.0);
    assert!(wanted > 0.8);
    let relaxed = settle(&leaf, 1e-9);
    let shot = leafdyn_testing::relaxed(&leaf, &by(Method::Shooting { intervals: None }, to(1e-9)));
    for found in [&relaxed, &shot] {
        let turn = tip_node(&found.shape.rods, 0).rotation.to_scaled_axis();
        close("twist", turn.x, wanted, 1e-9);
        close("bend", turn.y.hypot(turn.z), 0.0, 1e-12);
    }
}

/// w = F L^3/(3 E I) + F L/(k G S): with G = E/20 a tenth of the deflection is shear.
#[test]
fn a_force_across_shears_by_the_shear_modulus() {
    let (young, shear, force) = (1e5, 5e3, 1e-4);
    let (width, thickness) = (0.3, 0.15_f64);
    let leaf = beam(
        "shape = 'rectangle', width = 0.3, thickness = 0.15, young = 1e5, shear_modulus = 5e3",
        "tip_force = [0.0, 0.0, 1e-4]",
    );
    // 10/(12 - 2 nu G/E), with nu = 1/2.
    let factor = 10.0 / (12.0 - shear / young);
    let bent = force / (3.0 * young * width * thickness.powi(3) / 12.0);
    let sheared = force / (factor * shear * width * thickness);
    assert!(sheared > 0.08 * (bent + sheared));
    let found = tip(&settle(&leaf, 1e-12)).z;
    close("deflection", found / (bent + sheared), 1.0, 1e-6);
}

/// An isotropic material by its Poisson's ratio, and by the shear modulus that follows from it.
#[test]
fn an_isotropic_material_is_the_same_by_both() {
    let sections = [
        "shape = 'circle', diameter = 0.1",
        "shape = 'circle', diameter = 0.1, wall = 0.01",
        "shape = 'ellipse', width = 0.2, thickness = 0.1",
        "shape = 'rectangle', width = { at = [0, 0.3, 1], value = [0.2, 0.3, 0.1] }, thickness = 0.05",
    ];
    for section in sections {
        for poisson in [-0.1, 0.0, 0.3, 0.5] {
            let shear = 1e5 / (2.0 * (1.0 + poisson));
            let of = |law: String| beam(&format!("{section}, young = 1e5, {law}"), "");
            let by_ratio = of(format!("poisson = {poisson:?}"));
            let by_modulus = of(format!("shear_modulus = {shear:?}"));
            for sigma in [0.0, 0.2, 0.3, 0.8] {
                let ratio = stiffnesses(&by_ratio.rods[0], sigma);
                let modulus = stiffnesses(&by_modulus.rods[0], sigma);
                for (one, other) in ratio.iter().zip(&modulus) {
                    close(section, one / other, 1.0, 1e-14);
                }
            }
        }
    }
}

/// Against differences of whole relaxations, of a curved strip that twists as it is bent.
#[test]
fn derivatives_by_the_shear_modulus() {
    let text = |load: &str| {
        format!(
            "name = 'beam'\nleaf = {{ rods = 1, length = 1.0, fan = [0.0] }}\n\
             section = {{ shape = 'rectangle', width = 0.3, thickness = 0.15, young = 1e4, shear_modulus = 5e2 }}\n\
             rest = {{ bend_3 = 0.4 }}\nload = {{ {load} }}"
        )
    };
    let wanted = ["section.shear_modulus", "section.young"];
    let options = iterated(1e-10, 10);
    let base = base(&text("tip_force = [0.1, 0.3, -0.4]"), "");
    let (leaf, found) = derivatives(&base, &wanted, &options);
    let count = results(&leaf).1;
    for (key, found) in keys(&wanted).iter().zip(&found) {
        let theirs = differenced(&base, key, &options);
        let unit = base.differentiable_value(key).unwrap();
        for (ours, (theirs, unsure)) in of(found).iter().zip(&theirs).take(count) {
            let off = (ours - theirs).abs() - 4.0 * unsure;
            assert!(unit * off < 1e-7, "{key}: {ours} {theirs}");
        }
        assert!(unit * largest(found.tips[0].to_array().map(f64::abs)) > 1e-4);
    }
}

/// Along a vein, and one for each vein; written as it was given.
#[test]
fn it_may_change_along_veins_and_from_one_to_the_next() {
    for shear in [
        "[4e3, 6e3]",
        "{ at = [0.0, 0.4, 1.0], value = [4e3, 6e3, 5e3] }",
    ] {
        let text = format!(
            "name = 'leaf'\nleaf = {{ rods = 2, length = 1.0, fan = 'symmetric' }}\nsection = {{ shape = 'circle', diameter = 0.1, young = 1e5, shear_modulus = {shear} }}"
        );
        let leaf = parse(&text);
        let torsion = |rod: usize, sigma: f64| {
            leaf.rods[rod].couple_stiffness[0].at(sigma) / (PI * 1e-4 / 32.0)
        };
        let [first, last] = [torsion(0, 0.0), torsion(1, 0.4)];
        close("first", first, 4e3, 1e-9);
        close("last", last, 6e3, 1e-9);
        let json = serde_json::to_string(&leaf).unwrap();
        assert!(json.contains("shear_modulus") && !json.contains("poisson"));
        assert_eq!(parse(&json), leaf);
    }
}
