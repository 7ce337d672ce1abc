//! Figures, one file or few for the result of each verb.
//!
//! Each kind of picture has a file that fills a [`drawing::Drawing`]: a page with a header, keys, and panels
//! with axes or in space. SVG and PNG are written from the same drawing.

mod boundary;
mod chart;
mod check;
pub(crate) mod drawing;
mod fit;
pub(crate) mod leaf;
mod map;
pub(crate) mod motion;
mod rod;
pub(crate) mod scenario;
mod sensitivity;
// A browser draws the surface itself.
#[cfg(not(target_family = "wasm"))]
mod shaded;
mod sweep;
mod trace;
mod unbend;

pub use crate::figure::boundary::draw as boundary;
pub use crate::figure::chart::{draw_chart as chart, draw_scaling as scaling};
pub use crate::figure::check::draw as check;
pub use crate::figure::drawing::Drawing;
pub use crate::figure::fit::draw as fit;
pub use crate::figure::leaf::{draw as leaf, draw_equilibria as equilibria, draw_modes as modes};
pub use crate::figure::map::draw as map;
pub use crate::figure::motion::{draw_energies as energy, draw_filmstrip as filmstrip, write_film};
pub use crate::figure::sensitivity::draw as sensitivity;
#[cfg(not(target_family = "wasm"))]
pub use crate::figure::shaded::write_surface_picture;
pub use crate::figure::sweep::draw as sweep;
pub use crate::figure::trace::draw as trace;
pub use crate::figure::unbend::draw as unbend;
use leafdyn::scenario::Scenario;

/// Draws a result of a scenario.
pub type FigureFunction<R> = fn(&R, &Scenario) -> Drawing;

#[cfg(test)]
mod tests {
    use crate::figure::drawing::{TEXT_COLOR, formats};
    use crate::report::sample;
    use std::io::Cursor;

    use super::*;

    use glam::DVec3;
    use leafdyn::relax::Mode;
    use leafdyn::scenario::{Grip, PointLoad, Profile, Scenario, Schedule, SupportKind, Wind};
    use leafdyn::simulate::{Record, Stopped};

    fn scenario() -> Scenario {
        sample::sample_scenario("fan", 5)
    }

    #[test]
    fn every_picture_is_wide_enough_to_print() {
        for drawing in [
            leaf(&sample::sample_equilibrium(21, 32), &scenario()),
            check(&sample::sample_check(21, 32, 0.1), &scenario()),
            chart(&sample::sample_chart()),
            scaling(&sample::sample_scaling()),
            map(&sample::map_of_all_outcomes()),
            energy(&sample::sample_record(5, 16), &scenario()),
            filmstrip(&sample::sample_record(5, 16), &scenario()),
        ] {
            formats::checked_svg_text(&drawing);
            let mut bytes = Vec::new();
            formats::write_png(&drawing, &mut bytes).unwrap();
            let reader = ::png::Decoder::new(Cursor::new(&bytes)).read_info();
            let reader = reader.unwrap();
            assert_eq!(reader.info().width, 1800, "{}", drawing.description);
            assert_eq!(reader.info().color_type, ::png::ColorType::Rgb);
        }
    }

    fn in_cm() -> Scenario {
        let mut scenario = scenario();
        scenario.units.length = Some("cm".into());
        scenario.units.force = Some("N".into());
        scenario.units.time = Some("s".into());
        scenario
    }

    #[test]
    fn axes_are_in_the_units_of_the_scenario() {
        let fan = sample::sample_equilibrium(5, 8);
        let record = sample::sample_record(5, 8);
        let drawn = |scenario: &Scenario| {
            [
                leaf(&fan, scenario),
                check(&sample::sample_check(5, 8, 0.0), scenario),
                filmstrip(&record, scenario),
                energy(&record, scenario),
            ]
            .map(|drawing| formats::checked_svg_text(&drawing))
        };
        let [rest, checked, strip, energies] = drawn(&in_cm());
        for svg in [&rest, &checked] {
            // From above and from the side, and in space.
            assert_eq!(svg.matches(">x / cm<").count(), 3);
            assert!(!svg.contains('ξ'));
        }
        assert!(rest.contains("L = 1 cm") && rest.contains("cm</text>"));
        assert!(strip.contains(" cm wide") && strip.contains(">x<"));
        assert!(energies.contains(">tip / cm<") && energies.contains(">energy / N cm<"));
        assert!(energies.contains(">time / s<") && strip.contains("t = 0 s<"));
        let [rest, _, strip, energies] = drawn(&scenario());
        assert_eq!(rest.matches(">ξ = x/L<").count(), 2);
        assert_eq!(rest.matches(">ξ<").count(), 1);
        assert!(strip.contains(" L wide") && strip.contains(">ξ<"));
        assert!(energies.contains(">tip<") && energies.contains(">energy<"));
        assert!(energies.contains(">time, in the scenario's unit<") && !strip.contains("t = 0 s"));
    }

    #[test]
    fn values_on_axes_are_those_of_the_scenario() {
        // Ten times as long: the leaf is the same in lengths, its axes are not.
        let mut fan = sample::sample_equilibrium(5, 8);
        let mut large = in_cm();
        for rod in &mut large.rods {
            rod.length *= 10.0;
        }
        for rod in &mut fan.shape.rods {
            rod.length *= 10.0;
        }
        for point in fan.shape.curves.iter_mut().flatten().chain(&mut fan.tips) {
            *point *= 10.0;
        }
        let svg = formats::checked_svg_text(&leaf(&fan, &large));
        assert!(svg.contains(">8</text>") && !svg.contains(">0.8</text>"));
    }

    #[test]
    fn gravity_is_drawn_where_there_is_any() {
        let (fan, record) = (
            sample::sample_equilibrium(5, 8),
            sample::sample_record(5, 8),
        );
        let count = |scenario: &Scenario| {
            [leaf(&fan, scenario), filmstrip(&record, scenario)].map(|drawing| {
                formats::checked_svg_text(&drawing)
                    .matches(">gravity<")
                    .count()
            })
        };
        assert_eq!(count(&scenario()), [4, 1]);
        let mut without = scenario();
        without.gravity = [0.0; 3];
        assert_eq!(count(&without), [0, 0]);
        // A mass that is pulled, and weights of single veins.
        let mut pulled = without.clone();
        pulled.g = [0.0, 0.0, -9.81];
        assert_eq!(count(&pulled), [4, 1]);
        without.own_gravity = vec![[0.0, 0.0, -1.0]; 5];
        assert_eq!(count(&without), [4, 1]);
    }

    #[test]
    fn wind_is_drawn_as_it_blows() {
        let (fan, record) = (
            sample::sample_equilibrium(5, 8),
            sample::sample_record(5, 8),
        );
        let count = |at: &[f64], velocity: &[[f64; 3]]| {
            let mut windy = scenario();
            windy.wind = Some(Wind {
                velocity: Schedule::linear(at.to_vec(), velocity.to_vec()),
                density: 1.2,
                drag: 2.0,
                width: Vec::new(),
            });
            [leaf(&fan, &windy), filmstrip(&record, &windy)].map(|drawing| {
                formats::checked_svg_text(&drawing)
                    .matches(">wind<")
                    .count()
            })
        };
        assert_eq!(count(&[0.0], &[[1.0, 0.0, 0.0]]), [4, 1]);
        // One that changes in every picture, as soon as it blows.
        let until = record.moments[record.stills[2].moment].time;
        let rising = [[0.0; 3], [0.0; 3], [1.0, 0.0, 0.0]];
        let pictures = record.stills.len();
        assert_eq!(
            count(&[0.0, until, until + 1e-9], &rising),
            [0, pictures - 3]
        );
    }

    #[test]
    fn grips_are_drawn_where_they_hold() {
        let (fan, record) = (
            sample::sample_equilibrium(5, 8),
            sample::sample_record(5, 8),
        );
        let mut held = scenario();
        let drawn = |scenario: &Scenario| {
            [leaf(&fan, scenario), filmstrip(&record, scenario)]
                .map(|it| formats::checked_svg_text(&it))
        };
        let free = drawn(&held);
        held.grips = vec![
            Grip::rigid(0, [0.25, 0.5], SupportKind::Clamped),
            Grip::rigid(3, [0.6; 2], SupportKind::Pinned),
        ];
        for (svg, free) in drawn(&held).iter().zip(&free) {
            assert!(svg.contains(">pinned<") && !free.contains(">pinned<"));
        }
        // A stretch and both of its ends, and a point; and in the key.
        let panels = [4, record.stills.len()];
        for (k, panels) in panels.into_iter().enumerate() {
            let paths = |svg: &str| svg.matches("<path").count();
            assert_eq!(paths(&drawn(&held)[k]) - paths(&free[k]), 4 * panels + 1);
        }
    }

    fn point_load(vein: usize, force: [f64; 3]) -> PointLoad {
        PointLoad {
            vein,
            at: 0.4,
            force,
            moment: [0.0; 3],
            follows: false,
            mass: 0.0,
            offset: [0.0; 2],
            in_time: None,
            landing: None,
        }
    }

    #[test]
    fn forces_and_couples_are_drawn_on_leaves_of_many_veins() {
        let (fan, record) = (
            sample::sample_equilibrium(5, 8),
            sample::sample_record(5, 8),
        );
        let drawn = |scenario: &Scenario| {
            let drawings = [leaf(&fan, scenario), filmstrip(&record, scenario)];
            drawings.map(|it| formats::checked_svg_text(&it))
        };
        // Heads of arrows are closed and dark, as clamps are, of which there are as many.
        let dark = format!("Z\" fill=\"{}\"", formats::hex_color(TEXT_COLOR));
        let heads = |svg: &[String; 2]| svg.each_ref().map(|it| it.matches(&dark).count());
        let free = heads(&drawn(&scenario()));
        let panels = [4, record.stills.len()];
        // No panel sees it end-on.
        let mut loaded = scenario();
        loaded.points = vec![point_load(3, [0.3, 0.2, -0.4])];
        let svg = drawn(&loaded);
        assert_eq!(heads(&svg), [0, 1].map(|k| free[k] + panels[k]));
        assert!(svg[0].contains("arrow: force 0.5385"));
        // Arcs at three places of every vein.
        let mut turned = scenario();
        let couple = [0.1, 0.2, 0.3].map(Profile::Constant);
        turned.couple = Some(vec![couple; 5]);
        let arcs = 3 * 5;
        let svg = drawn(&turned);
        assert_eq!(heads(&svg), [0, 1].map(|k| free[k] + arcs * panels[k]));
    }

    #[test]
    fn moments_are_drawn_on_a_rod_as_they_act() {
        let (rod, record) = (
            sample::sample_equilibrium(1, 8),
            sample::sample_record(1, 8),
        );
        let drawn = |scenario: &Scenario| {
            let paths = |drawing| formats::checked_svg_text(&drawing).matches("<path").count();
            [leaf(&rod, scenario), filmstrip(&record, scenario)].map(paths)
        };
        let mut turned = sample::sample_scenario("rod", 1);
        let [rest, moving] = drawn(&turned);
        turned.points = vec![PointLoad {
            moment: [0.3, 0.2, 0.1],
            ..point_load(0, [0.0; 3])
        }];
        let pictures = record.stills.len();
        // An arc and its head in every panel, and one view at rest.
        assert_eq!(drawn(&turned), [rest + 2, moving + 2 * pictures]);
        turned.points.clear();
        turned.tip_moment = [0.0, 0.0, 0.5];
        assert_eq!(drawn(&turned), [rest + 2, moving]);
    }

    #[test]
    fn names_are_escaped() {
        let mut fan = sample::sample_equilibrium(5, 8);
        fan.scenario = "a < b & \"c\"\u{1}".into();
        let svg = formats::checked_svg_text(&leaf(&fan, &scenario()));
        assert!(svg.contains(">a &lt; b &amp; \"c\"</text>"));
    }

    fn motion(record: &Record) -> [String; 2] {
        [energy(record, &scenario()), filmstrip(record, &scenario())]
            .map(|drawing| formats::checked_svg_text(&drawing))
    }

    #[test]
    fn an_early_end_is_reported() {
        let mut record = sample::sample_record(5, 8);
        record.stopped = Some(Stopped::Diverged {
            otherwise: "the semi-implicit method",
            time: 10.1,
            percent: 70.0,
        });
        let reported = |svg: String| svg.contains("ended early: diverged");
        assert!(motion(&record).into_iter().all(reported));
    }

    #[test]
    fn extreme_numbers_are_drawn_without_a_panic() {
        let finite = [1e300, -1e300, -1e-300, 1e-310, -1.0, 0.0];
        for value in finite.into_iter().chain([f64::NAN, f64::INFINITY]) {
            draw_extreme_leaf(value);
            draw_extreme_check(value);
            draw_extreme_chart(value);
            draw_extreme_motion(value);
        }
        draw_extreme_motion(1e308);
    }

    fn draw_extreme_leaf(value: f64) {
        let mut fan = sample::sample_equilibrium(3, 8);
        let shape = vec![vec![value * DVec3::Z; 9]; 3];
        fan.stability.modes = Some(vec![Mode {
            eigenvalue: value,
            error: Some(1e-9),
            effective_masses: None,
            displacement: shape.clone(),
            rotation: shape,
        }]);
        formats::checked_svg_text(&modes(&fan, &scenario()));
        let curves = fan.shape.curves.iter_mut();
        curves.for_each(|curve| curve[4].z = value);
        fan.tips[0].x = value;
        leaf(&fan, &scenario());
        let curves = fan.shape.curves.iter_mut();
        curves.for_each(|curve| curve.fill(DVec3::splat(value)));
        leaf(&fan, &scenario());
        fan.shape.curves.clear();
        leaf(&fan, &scenario());
    }

    fn draw_extreme_check(value: f64) {
        let mut found = sample::sample_check(3, 8, 0.0);
        for difference in &mut found.along {
            difference.position = value;
            difference.moment = value;
        }
        found.along[3].force = value;
        if let Some(Ok(solution)) = found.shot.as_mut().map(|shot| shot.found.as_mut()) {
            solution.rods[1].nodes[4].position = DVec3::splat(value);
        }
        formats::checked_svg_text(&check(&found, &scenario()));
        let worst = found.along[0];
        found.along.fill(worst);
        found.tolerance = value;
        formats::checked_svg_text(&check(&found, &scenario()));
    }

    fn draw_extreme_chart(value: f64) {
        let mut found = sample::sample_chart();
        found.rows[0].true_error = Some(value);
        if let Some(spread) = &mut found.rows[1].seconds {
            spread.median = value;
        }
        found.reference.as_mut().unwrap().known_within = value;
        formats::checked_svg_text(&chart(&found));
    }

    fn draw_extreme_motion(value: f64) {
        let mut record = sample::sample_record(3, 8);
        record.stills[3].curves[1][4].z = value;
        record.moments[70].energy.kinetic = value;
        record.moments[71].tip.x = value;
        motion(&record);
        for moment in &mut record.moments {
            moment.energy.kinetic = value;
            moment.energy.potential = -value;
            moment.tip = DVec3::splat(value);
        }
        let curves = record.stills.iter_mut().flat_map(|still| &mut still.curves);
        curves.for_each(|curve| curve.fill(DVec3::splat(value)));
        motion(&record);
    }

    #[test]
    fn one_output_only() {
        let mut record = sample::sample_record(3, 8);
        record.moments.truncate(1);
        record.stills.truncate(1);
        motion(&record);
    }

    #[test]
    fn a_long_record_makes_no_large_picture() {
        let mut record = sample::sample_record(3, 8);
        record.moments = record.moments.repeat(2000);
        for (i, moment) in record.moments.iter_mut().enumerate() {
            moment.time = 1e-3 * i as f64;
        }
        for svg in motion(&record) {
            assert!(svg.len() < 1_000_000, "{}", svg.len());
        }
    }
}
