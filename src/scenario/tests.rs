//! Leaves with bases, tissue, loads and holders anywhere: their keys as they are read, replaced,
//! refused and written.

use crate::scenario::format::entries::Entries;
use crate::scenario::{
    BaseSupport, EntryPath, Key, Profile, Scenario, SupportKind, Tissue, schema,
};
use leafdyn_testing::pairs;
use serde_json::{Value, json};

const LEAF: &str = r#"
    name = "held"
    [leaf]
    rods = 3
    length = 2.0
    fan = "symmetric"
    joined = false
    base = [[0.0, -0.1, 0.0], [0.0, 0.0, 0.0], [0.0, 0.1, 0.0]]
    elevation = [0.2, 0.3, 0.2]
    base_held = "pinned"
    [section]
    shape = "circle"
    diameter = 0.1
    inner_diameter = { at = [0.0, 0.35, 1.0], value = [0.08, 0.05, 0.0] }
    young = 3.0
    mass_density = 2.0
    [coupling]
    z = 1.0
    [tissue]
    along = 20.0
    across = [40.0, 30.0]
    fold = 0.5
    [load]
    gravity = [[0.0, 0.0, -1e-4], [0.0, 0.0, -2e-4], [0.0, 0.0, -1e-4]]
    g = [0.0, 0.0, -1e-3]
    distributed = { at = [0.0, 0.6, 1.0], value = [[0, 0, 0], [0, 1e-4, 0], [0, 0, 1e-4]] }
    [[load.point]]
    vein = 1
    at = 0.5
    force = [0.0, 0.0, -2e-4]
    [[load.point]]
    vein = 3
    at = 1.0
    mass = 0.01
    [[grip]]
    vein = 1
    at = [0.3, 0.7]
    held = "clamped"
    move = [0.0, -0.2, 0.0]
    [[grip]]
    vein = 2
    at = 0.9
    [wind]
    velocity = [0.01, 0.0, 0.0]
    density = 0.1
    drag = 2.0
    width = { at = [0.0, 0.15, 1.0], value = [0.1, 0.1, 0.05] }
"#;

/// The leaf with overrides between `; `.
fn entries_with_overrides(overrides: &str) -> Result<Entries, String> {
    let overrides = overrides.split("; ").filter(|it| !it.is_empty());
    let overrides: Vec<String> = overrides.map(str::to_string).collect();
    let entries = Entries::from_text(LEAF, "held.toml").unwrap();
    let replaced = entries.replaced(&overrides);
    replaced.map_err(|refused| refused.to_string())
}

fn scenario_with_overrides(overrides: &str) -> Result<Scenario, String> {
    let checked = entries_with_overrides(overrides)?.check();
    checked.map_err(|refused| refused.to_string())
}

#[test]
fn all_that_is_given_arrives() {
    let leaf = scenario_with_overrides("").unwrap();
    assert_eq!(leaf.rods[2].base, [0.0, 0.1, 0.0]);
    assert_eq!(
        (leaf.rods[1].elevation, leaf.base_held.clone()),
        (0.3, vec![BaseSupport::Pinned; leaf.rods.len()])
    );
    let gap = |across: f64| Tissue {
        stiffness: [20.0, across, 0.0].map(Profile::Constant),
        fold: Profile::Constant(0.5),
        contraction: Profile::Constant(0.0),
    };
    assert_eq!(leaf.tissue, Some(vec![gap(40.0), gap(30.0)]));
    // Of a tube the mass is that of the wall.
    let area = std::f64::consts::FRAC_PI_4 * (0.01 - 0.0025);
    for (vein, even) in [(0, -1e-4), (1, -2e-4)] {
        let weight = leaf.weight(vein);
        assert_eq!(weight.even, [0.0, 0.0, even]);
        let [x, y, z] = weight.at(0.35);
        assert_eq!([x, y], [0.0; 2]);
        assert!((z / (even - 1e-3 * 2.0 * area) - 1.0).abs() < 1e-14);
    }
    let [middle, tip] = &leaf.points[..] else {
        panic!("{:?}", leaf.points);
    };
    assert_eq!((middle.vein, middle.at, middle.mass), (0, 0.5, 0.0));
    assert_eq!(leaf.force_on(tip), [0.0, 0.0, -1e-5]);
    let [stretch, point] = &leaf.grips[..] else {
        panic!("{:?}", leaf.grips);
    };
    assert_eq!(
        (stretch.vein, stretch.at, stretch.held),
        (0, [0.3, 0.7], SupportKind::Clamped)
    );
    assert_eq!(
        (point.vein, point.at, point.held),
        (1, [0.9, 0.9], SupportKind::Pinned)
    );
    assert_eq!(stretch.displacement, [0.0, -0.2, 0.0]);
    // Of the bore, the load, the point that is not the tip, the grips, and the wind's width.
    assert_eq!(leaf.kinks(), [0.15, 0.3, 0.35, 0.5, 0.6, 0.7, 0.9]);
    let beside = "load.point[0].at=0.35000000000000003; grip[1].at=0.9999999999999999";
    assert_eq!(
        scenario_with_overrides(beside).unwrap().kinks(),
        [0.15, 0.3, 0.35, 0.6, 0.7]
    );
    let wind = leaf.wind.as_ref().unwrap();
    assert_eq!(wind.velocity.at(7.0), [0.01, 0.0, 0.0]);
}

/// Both ways of writing it, and only once what all veins share.
#[test]
fn what_is_written_is_read_again_as_the_same() {
    let table = "
        =>
        leaf.base_spin=held =>
        load.distributed=[0, 0, 1e-4] =>
        load.distributed=[[0, 0, 1e-4], [0, 0, 0], [0, 1e-5, 0]] =>
        load.distributed={at = [0, 1], value = [[[0, 0, 0], [0, 0, 1e-4]], [[0, 0, 0], [0, 0, 0]], [[0, 0, 0], [1e-4, 0, 0]]]} =>
        wind.velocity={at = [0, 1], value = [[0, 0, 0], [0.01, 0, 0]]} =>
        wind.velocity={amplitude = [0.01, 0, 0], frequency = 2} =>
        dynamics.tip_force={mean = [0, 1e-5, 0], amplitude = [0, 0, 1e-5], frequency = 2.0, phase = 1.5} =>
        dynamics.tip_force={at = [0, 1, 2], value = [[0, 0, 0], [0, 0, 1e-5], [0, 1e-5, 0]], smooth = true} =>
        dynamics.rest={mean = 1, amplitude = 0.5, frequency = 0.1} =>
        dynamics.rest={at = [0, 1], value = [1, 2], smooth = true} =>
        leaf.base=[0.1, 0, 0]; load.gravity=[0, 0, -1e-4] =>
        load.point[0].offset=[0.1, -0.2] =>
        tissue.along=0; tissue.across=0; tissue.fold=0 =>
    ";
    for (overrides, _) in pairs(table) {
        let (entries, leaf) = (
            entries_with_overrides(overrides).unwrap(),
            scenario_with_overrides(overrides).unwrap(),
        );
        let written = serde_json::to_string(&leaf).unwrap();
        for text in [&written, &entries.to_toml()] {
            let again = Entries::from_text(text, "again").unwrap().check();
            assert_eq!(again.unwrap(), leaf, "{text}");
        }
        let written: Value = serde_json::from_str(&written).unwrap();
        assert_eq!(written.get("tissue").is_some(), leaf.tissue.is_some());
        assert_eq!(written["load"]["point"][1]["mass"], 0.01);
        assert_eq!(written["grip"][0]["at"], json!([0.3, 0.7]));
        assert_eq!(written["grip"][1]["at"], 0.9);
        assert!(written["section"].get("inner_diameter").is_some());
    }
    let shared =
        serde_json::to_value(scenario_with_overrides("leaf.base=[0.1, 0, 0]").unwrap()).unwrap();
    assert_eq!(shared["leaf"]["base"], json!([0.1, 0.0, 0.0]));
}

/// Compares overrides of parts with those of whole values.
#[test]
fn parts_are_reached_by_their_indices() {
    let table = "
        grip[0].move[1]=0.3 => grip[0].move=[0, 0.3, 0]
        scale:grip[0].move=2 => grip[0].move=[0, -0.4, 0]
        grip[0].at[0]=0.4 => grip[0].at=[0.4, 0.7]
        grip[1].at=0.8 => grip[1].at=8e-1
        load.point[0].force[2]=7e-5 => load.point[0].force=[0, 0, 7e-5]
        load.point[1].vein=2 => load.point[1].vein=2
        scale:load.point[1].mass=3 => load.point[1].mass=0.03
        tissue.along[1]=5 => tissue.along=[20, 5]
        scale:tissue.across=2 => tissue.across=[80, 60]
        leaf.base[2][1]=0.2 => leaf.base=[[0, -0.1, 0], [0, 0, 0], [0, 0.2, 0]]
        leaf.elevation[1]=0.1 => leaf.elevation=[0.2, 0.1, 0.2]
        load.gravity[1][2]=-3e-4 => load.gravity=[[0, 0, -1e-4], [0, 0, -3e-4], [0, 0, -1e-4]]
        load.gravity=[0, 0, -1e-4]; load.gravity[0][1]=1e-4 => load.gravity=[[0, 1e-4, -1e-4], [0, 0, -1e-4], [0, 0, -1e-4]]
        load.gravity=[0, 0, -1e-4]; load.gravity[0]=1e-4 => load.gravity=[1e-4, 0, -1e-4]
        load.distributed.value[1][2]=3e-4 => load.distributed={at = [0, 0.6, 1], value = [[0, 0, 0], [0, 1e-4, 3e-4], [0, 0, 1e-4]]}
        load.distributed=[0, 0, 1e-4]; load.distributed[1][0]=1e-5 => load.distributed=[[0, 0, 1e-4], [1e-5, 0, 1e-4], [0, 0, 1e-4]]
        wind.velocity[0]=0.02 => wind.velocity=[0.02, 0, 0]
    ";
    for (parts, whole) in pairs(table) {
        let one = scenario_with_overrides(parts).unwrap();
        let other = scenario_with_overrides(whole).unwrap();
        assert_eq!(one, other, "{parts}");
        let text = parts.split('=').next().unwrap();
        if !parts.contains(';') {
            assert_eq!(EntryPath::parse(text).unwrap().to_string(), text);
        }
    }
    let entries = entries_with_overrides("load.gravity=[0, 0, -1e-4]").unwrap();
    for (part, number) in [
        ("load.gravity[1][2]", Some(-1e-4)),
        ("load.gravity[2]", Some(-1e-4)),
        ("load.gravity", None),
        ("grip[1].move[0]", Some(0.0)),
        ("grip[2].move[0]", None),
        ("tissue.along[1]", Some(20.0)),
        ("load.distributed.value[1][1]", Some(1e-4)),
        ("load.distributed.value[2][1][1]", Some(1e-4)),
        ("load.point[1].mass", Some(0.01)),
    ] {
        assert_eq!(
            entries.number_at(EntryPath::parse(part).unwrap()),
            number,
            "{part}"
        );
    }
    let [one, other] =
        ["grip[0].move[1]", "grip[1].move[1]"].map(|it| EntryPath::parse(it).unwrap());
    assert!(one.overlaps(&one) && !one.overlaps(&other));
}

#[test]
fn what_cannot_be_is_refused() {
    let table = r#"
        grip[0].vein=4 => set grip[0].vein=4: grip[0].vein = 4: must be a whole number from 1 to 3
        grip[2].vein=1 => grip[2].vein: there are 2 of [[grip]], counted from 0: write it first
        grip.vein=1 => say which one, counted from 0: grip[0].vein
        grip[0]=1 => name an entry of it: vein, at, held, move, stiffness, turn_stiffness, as in grip[0].vein
        grip[x].vein=1 => an index is a whole number from 0
        grip[0].mov=1 => did you mean grip.move?
        grip[0].monsoon=1 => unknown key grip.monsoon: [[grip]] has vein, at, held, move
        grip[0].at=0 => must be greater than 0 (the base) and at most 1 (the tip)
        grip[0].at=[0.7, 0.3] => must rise from the base to the tip
        grip[0].at=[0.5, 1.2] => grip[0].at, entry 2 = 1.2: must be greater than 0
        grip[0].at=[0.5, 0.6, 0.7] => has 3 entries: must have 2
        grip[1].vein=1; grip[1].at=0.5 => grip[1].at = 0.5: is held by grip[0], too
        grip[1].vein=1; grip[1].at=[0.2, 0.3] => grip[0].at = [0.3, 0.7]: is held by grip[1], too
        grip[0].held=glued => must be "pinned" (the position is held) or "clamped"
        grip[0].move=[30, 0, 0] => must be at most 10 times the longest rod
        leaf.joined=true; grip[1].at=1.0 => must end before 1: the tip is shared by several rods, or held
        load.point[0].vein=0 => load.point[0].vein = 0: must be a whole number from 1 to 3
        load.point[1].at=1.5 => at most 1 (the tip)
        load.point[1].at=nan => must be a finite number
        load.point[0].moment=[1, 0, 0] => a moment on a point needs leaf.rods = 1 (here 3)
        load.point[0].mass=-1 => must not be negative
        load.point[0].force=[0, 0, 1e9] => gives |F| L^2/A
        load.point[0].offset=[1] => has 1 entries: must have 2, along the directors d2 and d3
        load.point[0].offset=1 => must be a list of two numbers, along d2 and d3
        load.point[0].offset[2]=1 => has the components 0 and 1, along d2 and d3
        load.point[0].offset=[0, inf] => must be a finite number
        load.point[0].offset=[0, 1e9] => gives |offset|/L
        load.point[0].mass=0.01; load.point[0].offset=[0, 1]; grip[0].held=pinned; grip[0].move={at = [0, 1], value = [[0, 0, 0], [0, 0, 1]]} => is of a mass where a pinned holder moves in time
        load.gravity=[[0, 0, 1], [0, 0, 1]] => has 2 entries: must have 3, one per rod
        load.gravity=3 => must be a list of three numbers [x, y, z], or a list of 3 of them (one per rod)
        load.gravity=[[0, 0, 1], [0, 0, 1], [0, 1]] => load.gravity, entry 3 = [0, 1]: has 2 entries
        load.gravity[1][2]=1e9 => gives |g| L^3/A
        load.g=[0, 0, -1e12] => gives |g| rho L^3/A
        load.distributed={at = [0, 1], value = [[0, 0, 1]]} => load.distributed, value = [[0, 0, 1]]: has 1 entries: must have 2
        load.distributed={at = [0, 1], value = [[0, 0, 1], [0, inf, 1]]} => entry 2, component 2 = inf
        load.distributed={at = [0, 1], worth = [[0, 0, 1]]} => unknown key worth
        load.distributed=7 => must be a list of three numbers
        load.distributed[0]=7 => is no list in the scenario
        dynamics.gravity={at = [0], value = [[0, 0, 1]]} => dynamics.gravity, one vector for all rods, would replace these
        leaf.base=[[0, 0, 0]] => has 1 entries: must have 3
        leaf.base=[1e9, 0, 0] => gives |base|/L
        leaf.elevation=[0.1, 0.2] => must have 3
        leaf.base_held=free => must be "clamped"
        leaf.base_held=["clamped", "elastic", "clamped"]; leaf.base_turn_stiffness=[0, 0, 0] => leaf.base_turn_stiffness, entry 2 = 0: must be greater than 0
        leaf.base_held=["clamped", "elastic", "clamped"]; leaf.base_turn_stiffness=[-1, 1, 0] => entry 1 = -1: must not be negative
        leaf.base_held=clamped; leaf.base_spin=held => add leaf.base_held = "pinned"
        leaf.base_spin=loose => must be "free" or "held"
        tissue.along=-1 => must not be negative
        tissue.along=[1, 2, 3] => has 3 entries: must have 2, one per gap
        tissue.across=1e30 => gives k L^4/A
        tissue.fold=inf => must be a finite number
        wind.velocity=3 => must be a table: a load in time is
        wind.velocity=[1e200, 0, 0] => gives |U| T/L
        wind.velocity=[1e6, 0, 0] => gives rho C_D w |U|^2 L^3/(2 A)
        wind.drag=-1 => must not be negative
        wind.width=-1 => must not be negative
        section.inner_diameter=0.1 => must be less than section.diameter
        section.wall=0.01 => section.wall is given, too: leave one of them out
        section.shape=ellipse => a circle has a diameter
    "#;
    for (overrides, said) in pairs(table) {
        let refused = scenario_with_overrides(overrides).unwrap_err();
        assert!(refused.contains(said), "{overrides}: {refused}");
        assert!(refused.len() < 400, "{refused}");
    }
}

/// In files, where a line is named.
/// Where every place of a vein is held a section that cannot stretch cannot shear, whatever the force along it is.
#[test]
fn places_of_a_stretch_do_not_hold_what_shears_and_does_not_stretch() {
    let read = |[axial, shear, held, at]: [&str; 4]| {
        let text = format!(
            "name = \"held\"
            leaf = {{ rods = 1, length = 1.0, fan = [0.0] }}
            stiffness = {{ torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = {axial}, shear_2 = {shear}, shear_3 = inf }}
            load = {{ gravity = [0.0, 0.0, -1.0] }}
            grip = [{{ vein = 1, at = {at}, held = \"{held}\" }}]"
        );
        Scenario::from_toml(&text).map_err(|refused| refused.to_string())
    };
    let stretch = "[0.3, 0.7]";
    let refused = read(["inf", "50.0", "pinned", stretch]).unwrap_err();
    assert!(
        refused.contains("stretch that shears and is inextensible"),
        "{refused}"
    );
    for held in [
        ["1e3", "50.0", "pinned", stretch],
        ["inf", "inf", "pinned", stretch],
        ["inf", "50.0", "clamped", stretch],
        ["inf", "50.0", "pinned", "0.5"],
    ] {
        assert!(read(held).is_ok(), "{held:?}");
    }
}

#[test]
fn tables_that_are_not_as_they_should_be_are_refused() {
    let table = r#"
        grip = 3 => held.toml:2: grip = 3: must be one table or several: write [[grip]] on a line of its own, below it vein, at
        grip = { vein = 1 } => must be one table or several
        load = { point = 3 } => held.toml:2: load.point = 3: must be one table or several: write [[load.point]]
        load = { point = [{ vein = 1, weight = 1 }] } => held.toml:2: unknown key load.point.weight (did you mean load.point.vein?): allowed here: vein, at, force
        load = { point = [{ vein = 1, at = 0.5 }, { at = 2.0, vein = 1 }] } => held.toml:2: load.point[1].at = 2.0: must be greater than 0
        load = { point = [{ at = 0.5 }] } => load.point[0].vein is missing: add a line such as `vein = 1` below its [[load.point]]
        load = { g = [0, 0, -9.81] } => load.g = [0, 0, -9.81]: is an acceleration and needs the mass that it pulls
        tissue = { along = 1 } => tissue lies between veins: it needs leaf.rods = 2 or more
        wind = { drag = 1 } => wind.velocity is missing
        dynamics = { clamped = false }, leaf.base_held = "pinned" => contradicts dynamics.clamped = false
    "#;
    let rest = "
        stiffness = { torsion = 1, bending_2 = 1, bending_3 = 1, axial = inf, shear_2 = inf, shear_3 = inf }
        leaf = { rods = 1, length = 1, fan = [0], base_held = 'HELD' }";
    for (entry, said) in pairs(table) {
        let (entry, held) = match entry.split_once(", leaf.base_held") {
            Some((entry, _)) => (entry, "pinned"),
            None => (entry, "clamped"),
        };
        let text = format!("name = 'held'\n{entry}{}", rest.replace("HELD", held));
        let entries = Entries::from_text(&text, "held.toml");
        let refused = entries.and_then(|entries| entries.check()).unwrap_err();
        let refused = refused.to_string();
        assert!(refused.contains(said), "{entry}: {refused}");
    }
}

/// Whatever a method would leave out of account is refused; what comes to the same as a leaf
/// without it is not.
#[test]
fn what_has_no_effect_is_none() {
    let text = "name = 'plain'
        leaf = { rods = 2, length = 1, fan = 'symmetric', base = [0, 0, 0], elevation = 0, base_held = 'clamped' }
        stiffness = { torsion = 1, bending_2 = 1, bending_3 = 1, axial = inf, shear_2 = inf, shear_3 = inf }
        tissue = { along = 0, fold = [0, 0] }
        load = { gravity = [[0, 0, -1], [0, 0, -1]], g = [0, 0, 0], distributed = [0, 0, 0] }
        dynamics = { density = 1 }";
    let text = text.replace("fold = [0, 0]", "fold = [0]");
    let plain = Entries::from_text(&text, "plain.toml").unwrap();
    let leaf = plain.check().unwrap();
    assert_eq!((leaf.gravity, leaf.tissue), ([0.0, 0.0, -1.0], None));
}

/// The same leaf in other units of length, force and time.
#[test]
fn limits_do_not_depend_on_units() {
    let leaf = scenario_with_overrides("").unwrap();
    for key in [
        Key::Base,
        Key::TissueFold,
        Key::G,
        Key::PointMass,
        Key::WindVelocity,
    ] {
        let [length, force, time] = key.dimension();
        let (unit, scale) = (leaf.unit(key), leaf.scale());
        let found = scale.length.powi(length) * scale.force().powi(force);
        let mass = leaf.dynamics.mean_density();
        let second = (mass * scale.length.powi(2) / scale.force()).sqrt();
        assert!(
            (unit / (found * second.powi(time)) - 1.0).abs() < 1e-12,
            "{key:?}"
        );
    }
}

/// Also those that may be there several times.
#[test]
fn the_schema_has_tables_within_tables() {
    let schema = schema();
    let point = &schema["properties"]["load"]["properties"]["point"];
    assert_eq!(point["type"], "array");
    assert_eq!(point["items"]["required"], json!(["vein", "at"]));
    let names: Vec<&String> = point["items"]["properties"]
        .as_object()
        .unwrap()
        .keys()
        .collect();
    assert_eq!(
        names,
        [
            "at", "factor", "follows", "force", "from", "mass", "moment", "offset", "vein",
            "velocity"
        ]
    );
    assert_eq!(
        schema["properties"]["grip"]["items"]["required"],
        json!(["vein", "at"])
    );
    assert_eq!(schema["required"], json!(["leaf"]));
    assert!(schema["properties"].get("load.point").is_none());
}
