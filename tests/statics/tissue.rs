//! Tissue with a width between neighbouring veins: closed forms in the limit of small loads, and a
//! leaf whose equilibrium was computed elsewhere.

use leafdyn_testing::*;

/// Three veins that begin apart, tied by tissue in all directions, in three dimensions.
const LADDER: &str = r#"
    name = "ladder"
    leaf = { rods = 3, length = 1.0, fan = [0.0, 0.0, 0.0], joined = false, base = [[0.0, -0.2, 0.0], [0.0, 0.0, 0.0], [0.0, 0.2, 0.0]] }
    stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 2.0, axial = 200.0, shear_2 = 80.0, shear_3 = 80.0 }
    tissue = { along = 20.0, across = 40.0, normal = 30.0, fold = 0.5 }
    load = { gravity = [0.0, 0.0, -2.0], tip_force = [0.0, 0.3, 0.0] }
"#;

/// Its tips by a prototype of the same law, extrapolated over its grids to 5e-11.
const LADDER_TIPS: [[f64; 3]; 3] = [
    [0.964938705292161, -0.1521610729812186, -0.2500437921163196],
    [
        0.9644666149951245,
        0.047389314153201946,
        -0.24979949070927057,
    ],
    [0.9639040260601034, 0.2483233956993133, -0.2495270862218981],
];
const LADDER_ENERGY: f64 = -0.33959137542366186;

#[test]
fn three_tied_veins_rest_where_another_program_finds_them() {
    for tolerance in [1e-3, 1e-6, 1e-9] {
        let leaf = settle(&parse(LADDER), tolerance);
        let bar = leaf.accuracy.error_estimate.unwrap();
        assert!(bar <= tolerance && leaf.stable() == Some(true));
        for (tip, known) in leaf.tips.iter().zip(LADDER_TIPS) {
            let off = tip.distance(DVec3::from_array(known));
            assert!(off <= bar + 2e-10, "{tolerance}: {off:.1e}, bar {bar:.1e}");
        }
        if tolerance == 1e-9 {
            close("energy", leaf.energy.unwrap(), LADDER_ENERGY, 1e-9);
        }
    }
}

/// Two cantilevers side by side, of which one is loaded at its tip across the leaf, are a sum mode
/// without force in the tissue and a difference mode on an elastic foundation of twice its
/// stiffness (M. Hetenyi, Beams on Elastic Foundation, 1946).
#[test]
fn a_loaded_vein_leans_on_its_neighbour_as_on_an_elastic_foundation() {
    const LOAD: f64 = 1e-4;
    const NORMAL: f64 = 50.0;
    let text = format!(
        r#"
        name = "foundation"
        leaf = {{ rods = 2, length = 1.0, fan = [0.0, 0.0], joined = false, base = [[0.0, 0.0, 0.0], [0.0, 0.1, 0.0]] }}
        stiffness = {{ torsion = 1e5, bending_2 = 1.0, bending_3 = 1e5, axial = inf, shear_2 = inf, shear_3 = inf }}
        tissue = {{ normal = {NORMAL} }}
        [[load.point]]
        vein = 1
        at = 1.0
        force = [0.0, 0.0, {LOAD}]
    "#
    );
    let leaf = settle(&parse(&text), 1e-11);
    let b = (2.0 * NORMAL / 4.0_f64).powf(0.25);
    let (sinh, cosh, sin, cos) = (b.sinh(), b.cosh(), b.sin(), b.cos());
    let difference =
        LOAD * b / (2.0 * NORMAL) * (sinh * cosh - sin * cos) / (cosh * cosh + cos * cos);
    let sum = 0.5 * LOAD / 3.0;
    close("loaded", leaf.tips[0].z / (sum + difference), 1.0, 1e-6);
    close("other", leaf.tips[1].z / (sum - difference), 1.0, 1e-6);
}

/// Two cantilevers apart in their plane, tied so that they hardly approach each other and slide
/// with resistance, bend as a beam of two layers (N. M. Newmark and others, 1951; U. A. Girhammar
/// and V. K. A. Gopu, J. Struct. Eng. 119, 1993).
#[test]
fn two_veins_that_slide_with_resistance_are_a_beam_of_two_layers() {
    const LOAD: f64 = 1e-4;
    let (axial, apart, along): (f64, f64, f64) = (500.0, 0.1, 200.0);
    let text = format!(
        r#"
        name = "layers"
        leaf = {{ rods = 2, length = 1.0, fan = [0.0, 0.0], joined = false, base = [[0.0, -0.05, 0.0], [0.0, 0.05, 0.0]] }}
        stiffness = {{ torsion = 1e3, bending_2 = 1e3, bending_3 = 1.0, axial = {axial}, shear_2 = inf, shear_3 = inf }}
        tissue = {{ along = {along}, across = 1e8 }}
        load = {{ tip_force = [0.0, {}, 0.0] }}
    "#,
        0.5 * LOAD
    );
    let leaf = settle(&parse(&text), 1e-11);
    let bending = 2.0;
    let a = (along * (2.0 / axial + apart * apart / bending)).sqrt();
    let (sinh, cosh) = (a.sinh(), a.cosh());
    let sliding = 1.0 / 3.0 - (cosh / a - sinh / (a * a)) / (a * cosh);
    let part = along * apart * apart / (bending * a * a);
    let deflection = LOAD / bending * (1.0 / 3.0 - part * sliding);
    for (tip, base) in leaf.tips.iter().zip([-0.5 * apart, 0.5 * apart]) {
        close("tip", (tip.y - base) / deflection, 1.0, 1e-6);
    }
}

/// Whatever the bases, the elevations and the shapes at rest, tissue adds nothing to a leaf that has
/// no load: it rests in its natural shape, without energy.
#[test]
fn the_natural_leaf_is_at_rest() {
    let text = r#"
        name = "natural"
        leaf = { rods = 3, length = [1.0, 0.8, 1.1], fan = [0.5, 0.1, -0.4], elevation = [0.3, 0.0, -0.2], joined = false, base = [[0.0, 0.2, 0.1], [0.1, 0.0, 0.0], [0.0, -0.2, 0.05]] }
        stiffness = { torsion = 1.0, bending_2 = 0.5, bending_3 = 2.0, axial = 90.0, shear_2 = inf, shear_3 = 40.0 }
        rest = { twist = 0.7, bend_2 = { at = [0.0, 0.3, 1.0], value = [0.5, 2.0, -1.0] }, bend_3 = -0.6 }
        tissue = { along = 20.0, across = [40.0, 5.0], normal = 30.0, fold = 0.5 }
    "#;
    let (tied, apart) = (
        parse(text),
        parse(&text.replace("tissue = ", "units = { length = \"m\" }\n# ")),
    );
    let (tied, apart) = (settle(&tied, 1e-10), settle(&apart, 1e-10));
    let bars = [&tied, &apart].map(|leaf| leaf.accuracy.error_estimate.unwrap());
    assert!(distance(&tied, &apart) < bars[0] + bars[1], "{bars:?}");
    assert!(tied.energy.unwrap().abs() < 1e-14);
    assert_eq!(tied.stable(), Some(true));
}
