//! Leaves that nobody would grow, but that a scenario may state: each comes to
//! rest in a stable equilibrium, and where symmetry or a simpler leaf tells
//! where, it is there.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_3, PI};

use leafdyn_testing::*;

const RIGID: [f64; 3] = [f64::INFINITY; 3];

/// Under other loads than its own.
fn loaded(mut leaf: Scenario, gravity: [f64; 3], tip_force: [f64; 3]) -> Scenario {
    (leaf.gravity, leaf.tip_force) = (gravity, tip_force);
    leaf
}

fn fan(angles: &[f64], force_stiffness: [f64; 3], weight: f64) -> Scenario {
    let mut leaf = paper_leaf(angles.len(), [1.0; 3], force_stiffness, weight);
    for (rod, angle) in leaf.rods.iter_mut().zip(angles) {
        rod.angle = *angle;
    }
    leaf.coupling = vec![[0.0; 3]; angles.len() - 1];
    leaf
}

#[track_caller]
fn stable(scenario: &Scenario, tolerance: f64) -> Equilibrium {
    // Most need some tens; nobody waits for ten times the most.
    stable_within(1_000, scenario, tolerance)
}

#[track_caller]
fn stable_within(evaluations: usize, scenario: &Scenario, tolerance: f64) -> Equilibrium {
    let leaf = settle(scenario, tolerance);
    assert_eq!(leaf.stability.negative_eigenvalues, Some(0));
    let work = leaf.work;
    assert!(work.force_evaluations < evaluations, "{work:?}");
    leaf
}

/// Rods that lie in one another share the load: each is a single rod.
#[test]
fn a_fan_that_is_closed() {
    for coupling in [0.0, 1.0, 1e4] {
        let mut closed = fan(&[0.3; 5], [100.0; 3], 1.0);
        closed.tip_force = [0.5, 1.0, 2.0];
        closed.coupling = vec![[coupling; 3]; 4];
        let mut single = fan(&[0.3], [100.0; 3], 1.0);
        single.tip_force = [0.1, 0.2, 0.4];
        let (all, one) = (stable(&closed, 1e-10), stable(&single, 1e-10));
        assert!((tip(&all) - tip(&one)).length() < 1e-10);
        let [all, one] = [all, one].map(|leaf| leaf.energy.unwrap());
        close("energy", all, 5.0 * one, 1e-9);
    }
}

/// Free and uncoupled, every rod is on its own; coupling changes that.
#[test]
fn free_tips() {
    let angles = [-2.0, -0.5, 0.1, 3.0];
    let mut free = fan(&angles, [100.0; 3], 3.0);
    free.joined = false;
    free.tip_force = [1.0, 0.0, -2.0];
    let together = stable(&free, 1e-10);
    assert_eq!(together.tips.len(), 4);
    for (angle, found) in angles.iter().zip(&together.tips) {
        let mut single = fan(&[*angle], [100.0; 3], 3.0);
        single.tip_force = free.tip_force;
        // Whether the tip of a single rod is joined makes no difference.
        let alone = stable(&single, 1e-10);
        single.joined = false;
        assert_eq!(tip(&stable(&single, 1e-10)), tip(&alone));
        assert!((*found - tip(&alone)).length() < 1e-10, "{angle}");
    }
    free.coupling = vec![[1e4; 3]; 3];
    let coupled = stable(&free, 1e-6);
    for found in &coupled.tips {
        assert!((*found - tip(&coupled)).length() < 0.1);
    }
}

/// Two rods that leave the base in opposite directions meet half-way; six in a
/// star meet straight above or below the base.
#[test]
fn opposite_rods_and_stars() {
    for stiffness in [[100.0; 3], RIGID] {
        let pair = stable(&fan(&[0.0, PI], stiffness, 0.0), 1e-8);
        assert!(tip(&pair).x.abs() < 1e-8 && tip(&pair).length() > 0.7);
        let upright = stable(&fan(&[-FRAC_PI_2, FRAC_PI_2], stiffness, 0.0), 1e-8);
        assert!(tip(&upright).y.abs() < 1e-8);
        let [one, other] = [&upright, &pair].map(|leaf| tip(leaf).length());
        close("the same pair", one, other, 1e-7);
        let [one, other] = [&upright, &pair].map(|leaf| leaf.energy.unwrap());
        close("the same pair", one, other, 1e-6);

        let six: Vec<f64> = (0..6).map(|k| k as f64 * FRAC_PI_3).collect();
        let star = stable(&fan(&six, stiffness, 1.0), 1e-8);
        assert!(tip(&star).x.hypot(tip(&star).y) < 1e-8 && tip(&star).z.abs() > 0.5);
        // Rigid rods snap through on the way to rest, to either side.
        if stiffness != RIGID {
            let three = fan(&[0.0, 2.0 * FRAC_PI_3, -2.0 * FRAC_PI_3], stiffness, 1.0);
            let height = tip(&stable(&three, 1e-8)).z;
            close("half a star", height, tip(&star).z, 1e-7);
        }
    }
}

#[test]
fn angles_that_go_round_more_than_once() {
    let plain = stable(&fan(&[0.7, -0.2, 0.1], [100.0; 3], 1.0), 1e-9);
    let wound = [0.7 + 20.0 * PI, -0.2 - 8.0 * PI, 0.1];
    let wound = stable(&fan(&wound, [100.0; 3], 1.0), 1e-9);
    assert!((tip(&plain) - tip(&wound)).length() < 1e-9);
}

/// A round column may buckle to any side, and comes to rest on the same
/// elastica as a strip that can go only two ways.
#[test]
fn round_columns() {
    let both = |force: f64, weight: f64| {
        let [gravity, tip_force] = [weight, force].map(|load| [-load, 0.0, 0.0]);
        let round = loaded(fan(&[0.0], RIGID, 0.0), gravity, tip_force);
        let mut strip = round.clone();
        strip.rods[0].couple_stiffness[1] = Profile::Constant(2.0);
        let both = [round, strip].map(|rod| stable(&rod, 1e-8));
        let [round, strip] = both.each_ref().map(tip);
        let what = format!("x, P = {force}, w = {weight}");
        close(&what, round.x, strip.x, 3e-8);
        both
    };
    for load in [2.5, 3.0, 5.0, 10.0, 50.0, 100.0, 300.0] {
        let [round, strip] = both(load, 0.0);
        let [bulge, wanted] = [&round, &strip].map(|leaf| tip(leaf).y.hypot(tip(leaf).z));
        close(&format!("bulge, P = {load}"), bulge, wanted, 3e-8);
        // Both turned aside from the straight state, which was met.
        for leaf in [round, strip] {
            assert_eq!(leaf.path.unwrap().word(), "branched", "P = {load}");
        }
    }
    for weight in [7.9, 9.0, 20.0, 50.0, 100.0] {
        both(0.0, weight);
    }
}

/// As coupling grows the leaf becomes a plate of glued veins: a limit.
#[test]
fn coupling_up_to_the_strongest_allowed() {
    let with = |coupling: f64| {
        let mut leaf = fig04(5);
        leaf.coupling = vec![[coupling; 3]; 4];
        tip(&stable(&leaf, 1e-6))
    };
    let glued = with(1e12);
    for (coupling, apart) in [(1e10, 1e-5), (1e8, 1e-4), (1e6, 1e-3), (1e4, 1e-2)] {
        let off = (with(coupling) - glued).length();
        assert!(off < apart, "{coupling:e}: {off:.1e}");
    }
}

#[test]
fn veins_of_different_kinds() {
    // Rigid in one way each.
    let mut leaf = fig04(3);
    for (j, rod) in leaf.rods.iter_mut().enumerate() {
        rod.force_stiffness[j] = Profile::Constant(f64::INFINITY);
        rod.force_stiffness[(j + 1) % 3] = Profile::Constant(1.0);
    }
    stable(&leaf, 1e-8);
    // One vein a million times stiffer than the others: it hardly bends.
    let mut leaf = fig04(3);
    leaf.rods[1].couple_stiffness = [1e6; 3].map(Profile::Constant);
    let bent = stable(&leaf, 1e-8);
    let middle = bent.shape.rods[1].nodes.last().unwrap().rotation * DVec3::X;
    assert!(middle.angle_between(bent.shape.rods[1].nodes[0].rotation * DVec3::X) < 1e-4);
    // Ten times longer than its neighbours, and half as long.
    for lengths in [[1.0, 10.0, 1.0], [0.5, 1.0, 1.0], [1.0, 0.1, 1.0]] {
        let mut leaf = fig04(3);
        leaf.gravity = [0.0, 0.0, -0.1];
        for (rod, length) in leaf.rods.iter_mut().zip(lengths) {
            rod.length = length;
        }
        // Among these is one whose own motion is followed until its limit.
        stable_within(40_000, &leaf, 1e-6);
    }
    // Tapered a millionfold; with four kinks, two of them close together.
    let mut leaf = fig04(5);
    leaf.gravity = [0.0, 0.0, -1e-6];
    for rod in &mut leaf.rods {
        rod.couple_stiffness = [0, 1, 2].map(|_| linear(&[0.0, 1.0], &[1.0, 1e-6]));
    }
    stable(&leaf, 1e-6);
    let mut leaf = fig04(5);
    let kinks = linear(&[0.0, 0.01, 0.5, 0.501, 1.0], &[1.0, 0.1, 1.0, 0.01, 1.0]);
    for rod in &mut leaf.rods {
        rod.couple_stiffness[0] = kinks.clone();
    }
    stable(&leaf, 1e-6);
}

#[test]
fn veins_wound_up_at_rest() {
    let rows = "1 0 0 300\n 1 50 0 200\n 5 0 6 0\n 5 0 20 0\n 5 30 0 0\n 5 6 3 0";
    for [rods, rest @ ..] in table::<4>(rows) {
        let mut leaf = fig04(rods as usize);
        for rod in &mut leaf.rods {
            rod.rest_curvature = rest.map(Profile::Constant);
        }
        stable(&leaf, 1e-6);
    }
}

#[test]
fn loads_from_all_sides() {
    for weight in table("0 0 10\n -50 0 0\n 0 0 -1e3\n 1e3 0 0") {
        stable(&loaded(fig04(5), weight, [0.0; 3]), 1e-6);
    }
    for force in table("-100 0 0\n -1e3 0 0\n 1e5 0 1\n 0 100 0") {
        stable(&loaded(fig04(5), [0.0; 3], force), 1e-6);
    }
    // Inextensible rods, pulled: they point where the force does.
    for force in [1e3, 1e4, 1e5] {
        let mut rod = fan(&[0.0], RIGID, 0.0);
        rod.tip_force = [0.0, 0.0, -force];
        if force > 1e4 {
            // Bent at once at the clamp, that is more than grids resolve; not so from a bit aside.
            rod.tip_force = [force, 0.0, -1e-3 * force];
        }
        // Those whose own motion is followed need more.
        let pulled = stable_within(3_000, &rod, 1e-6);
        let direction = DVec3::from_array(rod.tip_force).normalize();
        assert!(tip(&pulled).dot(direction) > 1.0 - 1.0 / force.sqrt());
        assert!(tip(&pulled).length() <= 1.0);
    }
}

#[test]
fn many_veins() {
    let leaf = stable(&fig04(500), 1e-6);
    assert_eq!(leaf.shape.rods.len(), 500);
    // The paper's fan fills its sector ever more evenly: the tip comes to lie
    // straight ahead, at the height that 100 veins show to three digits.
    assert!(tip(&leaf).y.abs() < 0.003);
    close("z", tip(&leaf).z, tip(&stable(&fig04(100), 1e-6)).z, 1e-3);
}

/// Very soft veins turn by more than rounding where all forces are balanced to rounding. Whether
/// they are stable, no grid tells.
#[test]
fn a_leaf_without_resistance_to_torsion() {
    for torsion in [1e-7, 1e-8, 1e-9] {
        let soft = format!("leaf.rods=4; stiffness.torsion={torsion}");
        let scenario = scenario("paper/fig04", &soft);
        let leaf = settle(&scenario, 1e-6);
        let sharp = scenario.relaxation().tolerance(1e-8).run().unwrap();
        let rests = [Outcome::Converged, Outcome::ToleranceNotReached];
        assert!(rests.contains(&sharp.outcome), "{:?}", sharp.remark);
        let told = [&leaf, &sharp].map(estimate);
        assert!((tip(&leaf) - tip(&sharp)).length() < told[0] + told[1]);
    }
}

/// Found among leaves at the edge of what could be one: its motion is resolved on 512 segments
/// only.
#[test]
fn a_leaf_that_needs_many_segments() {
    let scenario = parse(
        r#"
        name = "edge"
        [leaf]
        rods = 6
        length = [1.5155463556927136, 1.660386420189775, 1.468892568813211, 1.2599155854912283, 1.490727837911322, 1.3647456914846212]
        fan = "symmetric"
        [stiffness]
        torsion = 0.03508660525341855
        bending_2 = { at = [0.0, 0.5073359708082478, 1.0], value = [24.454819987880366, 46.277173113147974, 0.45407062342642324] }
        bending_3 = 6.294434231783438
        axial = [14925.756765249987, 41678.179748491486, 311.2817295287977, 26418.555191739335, 298.2793761740473, 102.77626026313085]
        shear_2 = [7408.662404670575, inf, 7.8511407131121365, 244.8024799134127, inf, 19815.41483627946]
        shear_3 = [22830.51947844362, 9794.853968264044, 813.9931017528617, 20.477798995283134, 668.5948340845422, 7.807910577834681]
        [rest]
        bend_2 = [-0.3327020960375151, 11.021271781028744, 4.685292587281733, -14.511891705780604, -8.980623587728648, -2.4913582335709634]
        stretch = [1.8230277792683507, 1.3414531492878137, 1.4190504304895781, 1.584127559031983, 1.6784324971192477, 1.3704453324633261]
        [load]
        gravity = [0.19848254629124962, 0.047280533807095085, 0.20432850601779637]
        "#,
    );
    stable_within(40_000, &scenario, 1e-6);
}

/// Interpolation between the stations of the solution would lose the tolerance: the leaf is
/// solved again with a smaller one.
#[test]
fn stations_keep_the_tolerance() {
    let scenario = parse(
        r#"
        name = "wild"
        [leaf]
        rods = 5
        length = 1.0
        fan = [-0.6818300492623899, -0.32578787236603435, -0.06696011249292266, 0.7888598399641547, 1.2643070024880192]
        [stiffness]
        torsion = { at = [0.0, 0.5624792114016682, 1.0], value = [0.5521991789813508, 2.159670137597459, 4.123415875446259] }
        bending_2 = [0.12256746059515733, 0.1617601439555148, 0.224098739719853, 0.10787397932802176, 8.991426245426776]
        bending_3 = 6.515992890944755
        axial = inf
        shear_2 = [131.75083244909044, 13.682977672871683, 16042.860216673182, 11874.283978294618, inf]
        shear_3 = [inf, 44.48980332577623, 214.79177212731926, 555.8310171797848, inf]
        [rest]
        twist = 5.42949225546819
        bend_2 = 7.717503410725037
        bend_3 = [1.952170120199444, -4.00064011463638, 9.768959029212258, -8.68372618767776, 2.5810621923890142]
        stretch = [1.0842327367099334, 1.077343828143547, 1.0379370305560967, 1.0844457816079407, 1.0172816939983738]
        [coupling]
        x = 0.14616572467754196
        y = 95.19660478079815
        z = 0.7182194396781834
        [load]
        tip_force = [0.6251948400748418, -0.0479611992042154, -0.8759177734442191]
        "#,
    );
    let at = |scenario: &Scenario, tolerance, stations| {
        let mut options = at_every_node(tolerance);
        options.stations = stations;
        relaxed(scenario, &options).at_stations(scenario, Some(20))
    };
    for stations in [None, Some(20)] {
        let kept = at(&scenario, 1e-6, stations);
        assert_eq!(kept.outcome, Outcome::Converged);
        assert!(kept.accuracy.error_estimate.unwrap() <= 1e-6);
    }
    // Its layers are thinner than the segments of a grid that keeps this tolerance at its nodes.
    let mut layers = paper_leaf(5, [1.0; 3], [100.0; 3], 1.0);
    layers.coupling = vec![[1e5; 3]; 4];
    assert_eq!(
        at(&layers, 1e-3, None).outcome,
        Outcome::ToleranceNotReached
    );
    let kept = at(&layers, 1e-3, Some(20));
    assert_eq!(kept.outcome, Outcome::Converged);
    assert_eq!(kept.accuracy.tolerance, 1e-3);
    assert!(kept.accuracy.error_estimate.unwrap() <= 1e-3);
}

/// Knots that tables of different origin have at one place, up to rounding, are one: no segment lies between them.
#[test]
fn knots_that_differ_by_rounding_are_one() {
    let leaf = |knot: f64| {
        parse(&format!(
            r#"
            name = "slender"
            units = {{ length = "cm", force = "N", time = "s" }}
            leaf = {{ rods = 1, length = 17.0, fan = [0.0], elevation = 1.4 }}
            section = {{ shape = "rectangle", width = {{ at = [0.0, 0.33, 1.0], value = [1.2, 1.7, 0.1] }}, thickness = 0.025, young = 1.5e5, mass_density = 1e-5 }}
            load = {{ g = [0.0, 0.0, -981.0] }}
            rest = {{ bend_2 = {{ at = [0.0, {knot:?}, 1.0], value = [0.04, -0.04, 0.07] }} }}
            "#
        ))
    };
    let one = settle(&leaf(0.33), 1e-6);
    for by in [8e-15, -8e-15, 3e-13] {
        let other = settle(&leaf(0.33 + by), 1e-6);
        assert_eq!(other.accuracy.segments, one.accuracy.segments, "{by:e}");
        let (off, bar) = (distance(&one, &other), estimate(&one));
        assert!(off <= 1e-9, "{by:e}: {off:.1e}, {bar:.1e}");
    }
}
