//! A cantilever clamped horizontally and bent by its own weight; by relaxation
//! and by shooting.

mod common;

use common::*;

/// Gamma = w L^3/EI; x, y of the tip and their ratio. Collocation on the
/// boundary-value problem, two meshes.
const INEXTENSIBLE: &str = "
      1  0.9912463953466  -0.1234714019834  0.124561766442
      5  0.8466571799543  -0.4959050446224  0.585721182509
     10  0.6563537612386  -0.7001997155143  1.066802320433
     20  0.4452320522396  -0.8298814434393  1.863930144438
     50  0.2450147563206  -0.9079171234773  3.705560991965
    100  0.1592233826284  -0.9375239353963  5.888104623327
";

fn weight(gamma: f64) -> String {
    format!("load.gravity=[0, 0, {:?}]", -gamma)
}

#[test]
fn an_inextensible_one_follows_the_master_curve() {
    for [gamma, x, y, ratio] in table(INEXTENSIBLE) {
        let what = format!("Gamma = {gamma}");
        let leaf = Both::solve("classic/cantilever_heavy", &weight(gamma));
        leaf.tip_is(&what, DVec3::new(x, 0.0, y), 2e-13, TIGHT);
        let tip = tip(&leaf.relaxed);
        close(&what, -tip.z / tip.x, ratio, 1e-10);
        assert_eq!(leaf.relaxed.stable(), Some(true));
    }
}

#[test]
fn one_that_stretches_and_shears_follows_the_boundary_value_problem() {
    let leaf = Both::solve("classic/cantilever_heavy_cosserat", "");
    let wanted = DVec3::new(0.4438083750994, 0.0, -0.8440537983558);
    leaf.tip_is("Gamma = 20", wanted, 2e-13, TIGHT);
    for rods in leaf.shapes() {
        let slope = tip_angle(rods, 0, DVec3::Z);
        close("slope", slope, -1.3353720770773, TIGHT);
    }
    assert_eq!(leaf.relaxed.stable(), Some(true));
}

/// What stretch alone, or shear alone, moves the tip by is
/// coefficient Gamma eps with eps = EI/(EA L^2) or EI/(GA L^2): collocation, to
/// three decimals, at eps = 1e-3.
#[test]
fn stretch_and_shear_move_the_tip_in_proportion_to_their_compliance() {
    let (eps, rigid) = (1e-3, f64::INFINITY);
    for [gamma, stretch, shear] in table("1 0.050 0.489\n 5 0.216 0.342\n 20 0.366 0.147") {
        let with = |axial: f64, shear: f64| {
            let entries = format!("{}; {}", set_stiffness(axial, shear), weight(gamma));
            tip(&solve("classic/cantilever_heavy_cosserat", &entries))
        };
        let inextensible = with(rigid, rigid);
        let moved = |tip: DVec3| (tip - inextensible).length() / (gamma * eps);
        close("stretch", moved(with(1.0 / eps, rigid)), stretch, 5e-4);
        close("shear", moved(with(rigid, 1.0 / eps)), shear, 5e-4);
    }
}
