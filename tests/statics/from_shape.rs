//! A leaf that is given a shape to begin with stays in the valley in which that lies, and ends in the
//! same equilibrium, to its bar, as closed forms and relaxations from nowhere.

use leafdyn::relax::{Progress, RelaxError, relax, relax_from};
use leafdyn_testing::*;

fn nothing() -> impl FnMut(&Progress) {
    |_: &Progress| {}
}

#[test]
fn a_buckled_column_stays_on_its_side() {
    let text = include_str!("../../scenarios/classic/elastica_buckled.toml");
    let column = parse(text);
    let options = Options {
        tolerance: Some(1e-8),
        ..Options::default()
    };
    for side in [-1.0, 1.0] {
        let mut pushed = column.clone();
        pushed.gravity[1] = 0.1 * side;
        let pushed = relax(&pushed, &options, &mut nothing()).unwrap();
        let from = (&pushed.shape.stations[..], &pushed.shape.rods[..]);
        let leaf = relax_from(&column, from, &options, &mut nothing()).unwrap();
        assert_eq!(leaf.stable(), Some(true));
        assert!(leaf.doubts.is_empty(), "{:?}", leaf.doubts);
        // By elliptic integrals.
        let exact = DVec3::new(0.74101960607633, side * 0.59320764616489, 0.0);
        let away = tip(&leaf).distance(exact);
        assert!(away <= leaf.accuracy.error_estimate.unwrap(), "{away}");
    }
}

#[test]
fn a_leaf_goes_back_to_where_it_was_under_its_old_load() {
    let fig04 = parse(include_str!("../../scenarios/paper/fig04.toml"));
    let options = Options::default();
    let alone = relax(&fig04, &options, &mut nothing()).unwrap();
    let mut heavy = fig04.clone();
    heavy.gravity[2] *= 2.0;
    let heavy = relax(&heavy, &options, &mut nothing()).unwrap();
    let from = (&heavy.shape.stations[..], &heavy.shape.rods[..]);
    let back = relax_from(&fig04, from, &options, &mut nothing()).unwrap();
    let bar = |leaf: &Equilibrium| leaf.accuracy.error_estimate.unwrap();
    assert!(tip(&back).distance(tip(&alone)) <= bar(&back) + bar(&alone));
    assert!(tip(&back).distance(tip(&heavy)) > 0.1);
}

#[test]
fn shapes_of_other_leaves_are_refused() {
    let fig04 = parse(include_str!("../../scenarios/paper/fig04.toml"));
    let options = Options::default();
    let leaf = relax(&fig04, &options, &mut nothing()).unwrap();
    let (stations, rods) = (&leaf.shape.stations[..], &leaf.shape.rods[..]);
    for from in [
        (stations, &rods[1..]),
        (&stations[1..], rods),
        (&[0.0, 1.0][..], rods),
    ] {
        let refused = relax_from(&fig04, from, &options, &mut nothing());
        assert!(matches!(refused, Err(RelaxError::Option(why)) if why.option == "start"));
    }
}
