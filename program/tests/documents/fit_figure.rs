//! The figure of a fit.

use leafdyn_testing::workplace::{Workplace, contains};

const VEIN: &str = r#"
    name = "vein"
    units = { length = "cm", force = "N" }
    leaf = { rods = 1, length = 10.0, fan = [0.0] }
    stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = 50.0, shear_2 = 40.0, shear_3 = 40.0 }
    load = { gravity = [0.0, 0.0, -1e-4] }
"#;

/// Two experiments have one result, two the other.
const PULLS: &str = "load.tip_force[2],tip_x,tip_z
-1e-3,,-0.40
-2e-3,,-0.70
-3e-3,9.93,
-4e-3,9.89,
";

const PHOTOGRAPH: &str = "rod,x,z\n1,2.5,-0.02\n1,5.0,-0.05\n1,7.5,-0.09\n1,10.0,-0.13\n";

/// Experiments have their numbers in the data, axes their units, and there is no view in
/// which nothing was measured; counts of one are no plurals.
#[test]
fn panels_are_those_of_the_data() {
    let place = Workplace::new();
    place.write("vein.toml", VEIN);
    place.write("pulls.csv", PULLS);
    place.write("photograph.csv", PHOTOGRAPH);
    let run = place.run(
        "fit vein.toml --data pulls.csv --data photograph.csv --free stiffness.bending_2 \
         --write svg --out out",
    );
    contains(&run.out, &["vein: fit of 1 number to 12 data"]);
    let svg = place.read("out/fit.svg");
    let misfit = run.out.split_once("standard deviation ").unwrap().1;
    let sd = misfit.split(' ').next().unwrap();
    let parts = [
        "12 data, 1 free number",
        ">tip_z / cm<",
        ">tip_x / cm<",
        ">x / cm<",
        ">z / cm<",
        "experiment as it is, from the side<",
    ];
    contains(&svg, &parts);
    contains(&svg, &[&format!("residuals of {sd}")]);
    assert!(!svg.contains("free numbers") && !svg.contains("from above"));
    // Ticks 1 and 2, then 3 and 4, then those of the data.
    let panels: Vec<&str> = svg.split("<g class=\"result\">").skip(1).collect();
    let [tip_z, tip_x] = panels[..] else {
        panic!("{} panels of results", panels.len());
    };
    let tip_z = tip_z.split("</g>").next().unwrap();
    let tip_x = tip_x.split("</g>").next().unwrap();
    assert!(tip_z.contains(">2<") && !tip_z.contains(">3<"), "{tip_z}");
    assert!(tip_x.contains(">4<") && !tip_x.contains(">2<"), "{tip_x}");
    let data = svg.split("<g class=\"residuals\">").nth(1).unwrap();
    assert!(data.contains(">7<") && !data.contains(">2.5<"), "{data}");
}
