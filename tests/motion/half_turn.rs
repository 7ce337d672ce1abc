//! Where sections of neighbouring veins have turned against each other by half a turn, the law of the
//! tissue between them jumps: a motion ends there, and says where and why.

use leafdyn::simulate::Stopped;
use leafdyn_testing::motion::{BOTH, at_beginning, method, rest};
use leafdyn_testing::*;

/// Two veins whose twist at rest grows to 5 and -5 radians.
const UNWOUND: &str = r#"
    name = "unwound"
    leaf = { rods = 2, length = 1.0, fan = [0.0, 0.0], base = [[0.0, -0.1, 0.0], [0.0, 0.1, 0.0]], joined = false }
    stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = 100.0, shear_2 = 100.0, shear_3 = 100.0 }
    rest.twist = [5.0, -5.0]
    tissue.across = 10.0
    dynamics = { duration = 3.0, start = "at-rest", external_damping = 1.0, rest = { at = [0.0, 2.0], factor = [0.0, 1.0] } }
"#;

/// By both methods it ends at the tips, at the same time.
#[test]
fn a_motion_ends_at_half_a_turn_by_both_methods() {
    let scenario = base(UNWOUND, "").scenario().clone();
    let leaf = Leaf::new(&scenario);
    let start = rest(&at_beginning(&scenario), 32);
    let times = BOTH.map(|scheme| {
        let mut motion = method(scheme, &leaf, &start, 1e-3);
        assert!(motion.advance(0.5).is_ok());
        let stopped = motion.advance(1.0).unwrap_err();
        let Stopped::HalfTurn { time, half_turn } = stopped else {
            panic!("{scheme:?}: {stopped}");
        };
        assert_eq!((half_turn.gap, half_turn.sigma), (0, 1.0));
        assert_eq!(stopped.word(), "half-turn");
        let told = stopped.to_string();
        assert!(told.contains("veins 1 and 2 are turned against each other by half a turn"));
        time
    });
    close("end", times[0], times[1], 3e-3);
}

/// What turns less goes on, though its quaternions begin on opposite sides.
#[test]
fn less_than_half_a_turn_goes_on() {
    let scenario = base(UNWOUND, "rest.twist=[0.9, -0.9]").scenario().clone();
    let leaf = Leaf::new(&scenario);
    let mut start = rest(&at_beginning(&scenario), 16);
    let other = start.base(1)..start.x.len();
    start.q[other].iter_mut().for_each(|q| *q = -*q);
    for scheme in BOTH {
        assert!(
            method(scheme, &leaf, &start, 1e-3).advance(2.5).is_ok(),
            "{scheme:?}"
        );
    }
}
