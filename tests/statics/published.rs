//! Published problems of rods in equilibrium whose tips are known to many digits; by relaxation
//! and by shooting. Rows: a file of `scenarios/classic`, entries replaced, `=>` x, y and z of the
//! tip and, if it is known, the angle of its tangent from e1 towards -e3.

use leafdyn_testing::*;

/// A cantilever under a dead transverse tip load P L^2/EI (Bisshopp and Drucker 1945,
/// Mattiasson 1981): closed form, elliptic integrals. Fans of naturally curved rods of different
/// lengths, bent down by their weight: collocation, re-integrated by DOP853, to the last digit.
const TO_THE_LAST_DIGIT: &str = "
    cantilever_tip; load.tip_force=[0, 0, -1]  => 0.94356676371662 0 -0.30172077379981 0.46135194971188
    cantilever_tip; load.tip_force=[0, 0, -2]  => 0.83935827917483 0 -0.49345748039671 0.78174983155654
    cantilever_tip; load.tip_force=[0, 0, -5]  => 0.61237163927557 0 -0.71379152361191 1.2153681176117
    cantilever_tip; load.tip_force=[0, 0, -10] => 0.44500440224625 0 -0.81060902488030 1.4302855388039
    cantilever_tip; load.tip_force=[0, 0, -50] => 0.19999960395040 0 -0.91715544730359 1.5679819015714
    fan_2 => 0.910506987231897 0 -0.405683573211535
    fan_3 => 0.934244176818460 0 -0.332744460157685
    fan_5; coupling.x=0; coupling.y=0; coupling.z=0 => 0.944393353500033 0 -0.307902124648867
    fan_5 => 0.944560025935573 0 -0.307809400980400
    fan_5; HARD(2.5e5 1e5) => 0.944419286318834 0 -0.306536598218815
";

/// Cantilevers that stretch and shear (axial and shear stiffness), and cantilevers under their
/// own weight w L^3/EI: collocation on the boundary-value problem, two meshes.
const BY_TWO_MESHES: &str = "
    cantilever_tip_cosserat; HARD(100 40); load.tip_force=[0, 0, -4]     => 0.6585159805983 0 -0.7307575514909 1.0997828540301
    cantilever_tip_cosserat; HARD(100 40); load.tip_force=[0, 0, -10]    => 0.4270824760091 0 -0.9424536888340 1.3957770840497
    cantilever_tip_cosserat; HARD(1000 400); load.tip_force=[0, 0, -10]  => 0.4432531320994 0 -0.8236366963903 1.4272379906638
    cantilever_heavy; load.gravity=[0, 0, -1]   => 0.9912463953466 0 -0.1234714019834
    cantilever_heavy; load.gravity=[0, 0, -5]   => 0.8466571799543 0 -0.4959050446224
    cantilever_heavy; load.gravity=[0, 0, -10]  => 0.6563537612386 0 -0.7001997155143
    cantilever_heavy; load.gravity=[0, 0, -20]  => 0.4452320522396 0 -0.8298814434393
    cantilever_heavy; load.gravity=[0, 0, -50]  => 0.2450147563206 0 -0.9079171234773
    cantilever_heavy; load.gravity=[0, 0, -100] => 0.1592233826284 0 -0.9375239353963
    cantilever_heavy_cosserat => 0.4438083750994 0 -0.8440537983558 1.3353720770773
";

/// The Princeton beam, a flat strip of 0.508 m: 8.896 N at 30 and 90 degrees from its chord,
/// 13.345 N at 45 and 90. Collocation.
const PRINCETON: &str = "
    princeton; load.tip_force=[0, 7.704161992066368, 4.448]             => 0.500340767648 0.010146995016 0.079447830196
    princeton; load.tip_force=[0, 0, 8.896]                             => 0.481980695762 0 0.146246558816
    princeton; load.tip_force=[0, 9.436339994934478, 9.436339994934476] => 0.477644443173 0.015341799699 0.156573901653
    princeton; load.tip_force=[0, 0, 13.345]                            => 0.457602672631 0 0.200677265105
";

/// A rod wound into one coil and into ten, and pulled aside (Ibrahimbegovic 1997). Collocation.
const COILS: &str = "
    helical_rollup; load.tip_moment=[0, 0, 62.83185307179586]; load.tip_force=[0, 0, 5]   => 0.41020335261 0.05377090312 -1.09172901932
    helical_rollup; load.tip_moment=[0, 0, 628.3185307179587]; load.tip_force=[0, 0, 50]  => 0.00480324966 0.000072496847 -0.07644174173
";

/// The 45-degree bend of Bathe and Bolourchi (1979), of length 78.5: torsional stiffness by the
/// polar moment, or by the torsion constant 0.140577; shear factor 5/6 or 1, or neither shear
/// nor stretch. Collocation, to eight decimals.
const BEND: &str = "
    bend45_300 => 58.77889733 22.24467943 40.19239233
    bend45_600 => 47.15009624 15.68468948 53.47547800
    bend45_300; HARD(1e7 5e6)                                       => 58.77912249 22.24478095 40.19189167
    bend45_600; HARD(1e7 5e6)                                       => 47.15043857 15.68480053 53.47485879
    bend45_300; stiffness.torsion=702885                            => 58.53570907 22.11251371 40.48075757
    bend45_300; stiffness.torsion=702885; load.tip_force=[0, 0, 450] => 51.96942440 18.36916294 48.70534908
    bend45_600; stiffness.torsion=702885                            => 46.89158622 15.55767615 53.60798641
    bend45_300; HARD(inf inf)                                       => 58.77968539 22.24503474 40.18828384
    bend45_300; HARD(inf inf); load.tip_force=[0, 0, 450]           => 52.23929842 18.50846405 48.49798262
    bend45_600; HARD(inf inf)                                       => 47.15129440 15.68507816 53.46859844
";

/// Accuracy of the numbers, and that of leaves; both are lengths.
const PROBLEMS: [(&str, f64, f64); 5] = [
    (TO_THE_LAST_DIGIT, 2e-14, TIGHT),
    (BY_TWO_MESHES, 2e-13, TIGHT),
    (PRINCETON, 6e-13, 5e-12),
    (COILS, 1e-11, 1e-10),
    (BEND, 6e-9, 6e-9),
];

/// Entries, in which `HARD(EA GA)` stands for both stiffnesses.
fn written_out(entries: &str) -> String {
    let Some((before, rest)) = entries.split_once("HARD(") else {
        return entries.into();
    };
    let (both, after) = rest.split_once(')').unwrap();
    let [axial, shear] = table(both)[0];
    format!("{before}{}{after}", set_stiffness(axial, shear))
}

#[test]
fn tips_are_where_they_are_known_to_be() {
    for (rows, digits, within) in PROBLEMS {
        for (what, numbers) in pairs(rows) {
            let (file, entries) = what.split_once(';').unwrap_or((what, ""));
            let leaf = Both::solve(&format!("classic/{file}"), &written_out(entries));
            let numbers = numbers.split(' ').map(|number| number.parse().unwrap());
            let numbers: Vec<f64> = numbers.collect();
            leaf.tip_is(what, DVec3::from_slice(&numbers), digits, within);
            for (rods, slope) in leaf.shapes().iter().zip(numbers.get(3).into_iter().cycle()) {
                close(what, tip_angle(rods, 0, DVec3::NEG_Z), *slope, TIGHT);
            }
            // Of what has no potential no index is claimed.
            let potential = !entries.contains("tip_moment");
            let index = leaf.relaxed.stability.negative_eigenvalues;
            assert_eq!(index, potential.then_some(0), "{what}");
        }
    }
}

/// What stretch alone, or shear alone, moves the tip of a heavy cantilever by is
/// coefficient Gamma eps with eps = EI/(EA L^2) or EI/(GA L^2): collocation, to
/// three decimals, at eps = 1e-3.
#[test]
fn stretch_and_shear_move_the_tip_in_proportion_to_their_compliance() {
    let (eps, rigid) = (1e-3, f64::INFINITY);
    for [gamma, stretch, shear] in table("1 0.050 0.489\n 5 0.216 0.342\n 20 0.366 0.147") {
        let with = |axial: f64, shear: f64| {
            let weight = format!("load.gravity=[0, 0, {:?}]", -gamma);
            let entries = format!("{}; {weight}", set_stiffness(axial, shear));
            tip(&solve("classic/cantilever_heavy_cosserat", &entries))
        };
        let inextensible = with(rigid, rigid);
        let moved = |tip: DVec3| (tip - inextensible).length() / (gamma * eps);
        close("stretch", moved(with(1.0 / eps, rigid)), stretch, 5e-4);
        close("shear", moved(with(rigid, 1.0 / eps)), shear, 5e-4);
    }
}

/// No bifurcation is crossed on the way to a fan's load, nor to five times it:
/// the sign of the determinant of the collocation matrix never changes.
#[test]
fn no_stability_of_fans_is_lost_up_to_five_times_the_load() {
    for name in ["classic/fan_3", "classic/fan_5"] {
        for weight in [0.5, 2.0, 5.0, 10.0] {
            let leaf = solve(name, &format!("load.gravity=[0, 0, {:?}]", -weight));
            assert_eq!(leaf.stable(), Some(true), "{name}, {weight}");
            assert!(leaf.stability.saddle.is_none(), "{name}, {weight}");
        }
    }
}
