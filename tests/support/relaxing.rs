//! Options of relaxations, and leaves brought to rest with them.

use leafdyn::relax::{Equilibrium, Method, Options, SemiImplicit, relax};
use leafdyn::scenario::Scenario;

use super::{TIGHT, scenario};

/// Relaxing to a tolerance.
pub fn to(tolerance: f64) -> Options {
    Options {
        tolerance: Some(tolerance),
        ..Options::default()
    }
}

/// Relaxing on one grid.
pub fn on(segments: usize) -> Options {
    Options {
        method: Method::default().on_grid(Some(segments)),
        ..Options::default()
    }
}

/// Relaxing on one grid, with iterations to a tolerance.
pub fn iterated(tolerance: f64, segments: usize) -> Options {
    Options {
        tolerance: Some(tolerance),
        ..on(segments)
    }
}

/// By this method.
pub fn by(method: Method, options: Options) -> Options {
    Options { method, ..options }
}

/// With so many modes of vibration.
pub fn with_modes(modes: usize, options: Options) -> Options {
    Options { modes, ..options }
}

/// Relaxing to a tolerance that every node keeps.
pub fn at_every_node(tolerance: f64) -> Options {
    Options {
        every_node: true,
        ..to(tolerance)
    }
}

/// With something else asked of the semi-implicit method.
fn with(options: Options, change: impl Fn(&mut SemiImplicit)) -> Options {
    let Method::SemiImplicit(mut method) = options.method else {
        panic!("{:?}", options.method);
    };
    change(&mut method);
    by(method.into(), options)
}

/// Stopping at a saddle.
pub fn keeping(options: Options) -> Options {
    with(options, |method| method.keep_unstable = true)
}

/// For the whole leaf, in space.
pub fn in_full(options: Options) -> Options {
    with(options, |method| method.full_model = true)
}

/// Relaxes, with any outcome.
#[track_caller]
pub fn relaxed(scenario: &Scenario, options: &Options) -> Equilibrium {
    relax(scenario, options, &mut |_| {}).unwrap()
}

/// Relaxes; the run must succeed.
#[track_caller]
pub fn settled(scenario: &Scenario, options: &Options) -> Equilibrium {
    let leaf = relaxed(scenario, options);
    let (outcome, remark) = (leaf.outcome, &leaf.remark);
    let what = format!("{}: {outcome:?}, {remark:?}", scenario.name);
    assert!(outcome.is_success(), "{what}");
    leaf
}

/// Relaxes to a tolerance; the run must succeed and stay within it.
#[track_caller]
pub fn settle(scenario: &Scenario, tolerance: f64) -> Equilibrium {
    settled(scenario, &to(tolerance))
}

/// Relaxes on one grid.
#[track_caller]
pub fn settle_on(scenario: &Scenario, segments: usize, keep_unstable: bool) -> Equilibrium {
    let options = iterated(1e-9, segments);
    match keep_unstable {
        true => settled(scenario, &keeping(options)),
        false => settled(scenario, &options),
    }
}

/// An equilibrium to a tolerance, kept if it is unstable.
#[track_caller]
pub fn kept(scenario: &Scenario, tolerance: f64) -> Equilibrium {
    settled(scenario, &keeping(to(tolerance)))
}

/// An equilibrium in which a leaf comes to rest, and the same by the full model.
pub fn reduced_and_full(scenario: &Scenario, segments: Option<usize>) -> [Equilibrium; 2] {
    let options = || segments.map_or(Options::default(), on);
    [options(), in_full(options())].map(|options| relaxed(scenario, &options))
}

/// A scenario file with `entries` replaced, relaxed at the tight tolerance.
#[track_caller]
pub fn solve(name: &str, overrides: &str) -> Equilibrium {
    settle(&scenario(name, overrides), TIGHT)
}
