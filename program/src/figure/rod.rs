//! A single rod at rest in one large view: of the plane in which it lies, or in space; with its loads,
//! its supports and its unloaded shape.

use crate::figure::drawing::labels::{LegendRows, SUPPORT_NAMES, new_page};
use crate::figure::drawing::markers::{draw_support_marker, draw_tip_marker};
use crate::figure::drawing::space::{
    BoxMargins, PlaneView, SpacePanel, VIEW_FROM_ABOVE, VIEW_FROM_FRONT, VIEW_FROM_SIDE,
    ViewAngles, draw_plane_panel, padded_box,
};
use crate::figure::drawing::veins::{DrawnVeins, draw_vein_markers};
use crate::figure::drawing::{
    Drawing, DrawingPath, FRAME_COLOR, PAGE, PageRectangle, PathStep, Stroke, TEXT_COLOR,
    curve_between_fractions, draw_panel_title, is_drawable, polyline_path,
};
use crate::figure::scenario::{FigureSetting, SupportForm};
use glam::{DVec2, DVec3};
use leafdyn::natural::Natural;
use leafdyn::relax::Equilibrium;
use leafdyn::scenario::Scenario;

/// Sizes of the view of a rod.
struct RodLayout {
    /// Least and largest height, in pixels.
    lowest: f64,
    highest: f64,
    /// Margins around the box in space.
    margins: BoxMargins,
    /// Width of the rod, in pixels.
    line: f64,
    /// Padding around the rod and its arrows, as a fraction of the largest extent.
    padding: f64,
}

const LAYOUT: RodLayout = RodLayout {
    lowest: 240.0,
    highest: 560.0,
    margins: BoxMargins {
        left: 90.0,
        right: 60.0,
        below: 44.0,
    },
    line: 2.4,
    padding: 0.07,
};

/// Which shapes of a rod look different, in its extents.
struct RodVisibility {
    /// A rod that leaves a plane of two axes by less is drawn in that plane.
    flat: f64,
    /// An unloaded shape nearer to the rod is not drawn.
    unloaded: f64,
    /// An unloaded shape larger than this, of a coiled rod, is cut off.
    farthest: f64,
}

const VISIBILITY: RodVisibility = RodVisibility {
    flat: 0.02,
    unloaded: 0.004,
    farthest: 4.0,
};

/// Segments of which the unloaded shape is drawn.
const UNLOADED_SHAPE_POINTS: usize = 96;

const UNLOADED_SHAPE_STROKE: Stroke = Stroke::new(FRAME_COLOR, 1.4);

/// The wall that clamps an end of a rod, in pixels.
struct ClampWall {
    half_length: f64,
    hatching_depth: f64,
    /// Strokes to each side of the middle.
    hatching_strokes: i32,
}

const WALL: ClampWall = ClampWall {
    half_length: 15.0,
    hatching_depth: 8.0,
    hatching_strokes: 3,
};

/// What is drawn of a rod, in units of its length.
struct DrawnRod<'a> {
    veins: &'a DrawnVeins,
    /// Its unloaded shape, if that looks different.
    unloaded_shape: Vec<DVec3>,
    /// Whether its end is left out.
    is_cut_off: bool,
}

/// Draws a single rod with its name and notes.
pub fn draw(
    leaf: &Equilibrium,
    scenario: &Scenario,
    veins: &DrawnVeins,
    setting: &FigureSetting,
    notes: &[String],
) -> Drawing {
    let rod = DrawnRod::from_equilibrium(leaf, scenario, veins);
    let mut page = new_page(PAGE.left_margin, &leaf.scenario, notes, None);
    let mut top = 0.0;
    page.draw_group("key", |page| top = rod.draw_legend(page));
    let (low, high) = rod.bounding_corners();
    let extent = high - low;
    let corner = DVec2::new(PAGE.left_margin, top + PAGE.panel_title);
    let width = PAGE.width - PAGE.left_margin - PAGE.right_margin;
    let height = match rod.viewing_plane() {
        Some(PlaneView { title, axes }) => {
            let [across, up] = axes.map(|axis| extent[axis]);
            let height = (width * up / across).clamp(LAYOUT.lowest, LAYOUT.highest);
            let cell = PageRectangle::new(corner, DVec2::new(width, height));
            let scale = (width / across).min(height / up);
            page.draw_group("rod", |page| {
                draw_panel_title(page, corner, "", title);
                let camera = draw_plane_panel(page, 0.5 * (low + high), setting, cell, scale, axes);
                rod.draw(page, cell, |point| camera.project_point(point));
                let taken = rod
                    .occupied_points()
                    .map(|point| camera.project_point(point));
                camera.draw_arrows(page, &setting.direction_arrows(true, 0.0), cell, taken);
            });
            height + PAGE.panel_axis
        }
        None => {
            let cell = PageRectangle::new(corner, DVec2::new(width, LAYOUT.highest));
            let bounds = padded_box(low, high);
            let view = ViewAngles::oblique([veins.tip_from_base()]);
            let scene = SpacePanel::new(bounds, setting, view, cell, LAYOUT.margins, None);
            page.draw_group("rod", |page| {
                draw_panel_title(page, corner, "", "in space, with its shadow on the floor");
                scene.draw_floor_and_walls(page);
                scene.draw_axes(page, 38.0);
                scene.draw_direction_arrows(page, true, 0.0);
                scene.draw_shadows(page, veins, LAYOUT.line);
                rod.draw(page, cell, |point| scene.project_point(point));
            });
            LAYOUT.highest
        }
    };
    page.height = (corner.y + height + PAGE.bottom_margin).ceil();
    page
}

impl<'a> DrawnRod<'a> {
    fn from_equilibrium(leaf: &Equilibrium, scenario: &Scenario, veins: &'a DrawnVeins) -> Self {
        let natural = Natural::new(scenario, true);
        let at = |k: usize| {
            natural
                .vein_pose(0, k as f64 / UNLOADED_SHAPE_POINTS as f64)
                .position
                / veins.unit
        };
        let mut unloaded: Vec<DVec3> = (0..=UNLOADED_SHAPE_POINTS)
            .map(at)
            .filter(|&it| is_drawable(it))
            .collect();
        let (stations, curve) = match leaf.shape.curves.first() {
            Some(curve) => (&leaf.shape.curve_stations[..], &curve[..]),
            None => Default::default(),
        };
        let point = |sigma: f64| {
            let point = curve_between_fractions(stations, curve, [sigma; 2]).pop()? / veins.unit;
            is_drawable(point).then_some(point)
        };
        let differs = (0..=UNLOADED_SHAPE_POINTS)
            .zip(&unloaded)
            .any(|(k, natural)| {
                let there = point(k as f64 / UNLOADED_SHAPE_POINTS as f64);
                there.is_some_and(|it| {
                    it.distance(*natural) > VISIBILITY.unloaded * veins.largest_extent()
                })
            });
        let extent = |(low, high): (DVec3, DVec3)| (high - low).max_element();
        let own = extent((veins.low, veins.high));
        let whole = unloaded
            .iter()
            .fold((DVec3::ZERO, DVec3::ZERO), |(low, high), &it| {
                (low.min(it), high.max(it))
            });
        let cut_off = extent(whole) > VISIBILITY.farthest * own && own > 0.0;
        if cut_off {
            let near = |it: &&DVec3| it.length() < 1.5 * own;
            let count = unloaded.iter().take_while(near).count();
            unloaded.truncate(count);
        }
        DrawnRod {
            veins,
            unloaded_shape: if differs { unloaded } else { Vec::new() },
            is_cut_off: cut_off,
        }
    }

    /// Points that nothing else should cover.
    fn occupied_points(&self) -> impl Iterator<Item = DVec3> {
        let arrows = self.veins.forces.iter().flat_map(|force| force.ends);
        let unloaded = self.unloaded_shape.iter().copied();
        self.veins.piece_ends().chain(unloaded).chain(arrows)
    }

    /// Corners of a box around it.
    fn bounding_corners(&self) -> (DVec3, DVec3) {
        let (low, high) = self
            .occupied_points()
            .fold((self.veins.low, self.veins.high), |(low, high), it| {
                (low.min(it), high.max(it))
            });
        let extent = (high - low).max_element();
        let extent = if extent > 1e-9 { extent } else { 1.0 };
        let padding = DVec3::splat(LAYOUT.padding * extent);
        (low - padding, high + padding)
    }

    /// The plane of two axes in which it is seen, unless it leaves every such plane.
    fn viewing_plane(&self) -> Option<PlaneView> {
        let (low, high) = self.bounding_corners();
        let extent = high - low - DVec3::splat(2.0 * LAYOUT.padding * (high - low).max_element());
        let seen = |view: &PlaneView| extent[view.axes[0]].min(extent[view.axes[1]]);
        let views = [VIEW_FROM_ABOVE, VIEW_FROM_SIDE, VIEW_FROM_FRONT].into_iter();
        let best = views.reduce(|one, other| {
            if seen(&other) > seen(&one) {
                other
            } else {
                one
            }
        })?;
        let across = 3 - best.axes[0] - best.axes[1];
        (extent[across] <= VISIBILITY.flat * extent.max_element()).then_some(best)
    }

    /// Draws the key; returns where it ends.
    fn draw_legend(&self, page: &mut Drawing) -> f64 {
        let mut key = LegendRows::starting_at(PAGE.left_margin, PAGE.notes_base_line + 22.0, 26.0);
        let own = self
            .veins
            .veins
            .first()
            .map_or(TEXT_COLOR, |vein| vein.color);
        key.add_entry(page, "at rest", |page, cell| {
            cell.draw_midline(page, Stroke::new(own, LAYOUT.line))
        });
        if !self.unloaded_shape.is_empty() {
            let name = match self.is_cut_off {
                true => "unloaded, cut off",
                false => "unloaded",
            };
            key.add_entry(page, name, |page, cell| {
                cell.draw_midline(page, UNLOADED_SHAPE_STROKE.with_dashes(true));
            });
        }
        let veins = self.veins;
        for (how, name) in SUPPORT_NAMES {
            let (ends, gripped) = (veins.has_held_ends(how), veins.has_grips(how));
            match how {
                SupportForm::Clamped if ends => key.add_entry(page, name, |page, cell| {
                    let [left, right] = cell.midline();
                    draw_wall(page, left.lerp(right, 0.6), DVec2::X, 0.6);
                }),
                _ if ends || gripped => key.add_entry(page, name, |page, cell| {
                    draw_support_marker(page, cell.middle(), how);
                }),
                _ => (),
            }
        }
        if veins.tip_support.is_none() {
            key.add_entry(page, "free tip", |page, cell| {
                draw_tip_marker(page, cell.middle())
            });
        }
        key.bottom()
    }

    fn draw(&self, page: &mut Drawing, cell: PageRectangle, place: impl Fn(DVec3) -> DVec2) {
        let points: Vec<DVec2> = self
            .unloaded_shape
            .iter()
            .map(|&point| place(point))
            .collect();
        if !points.is_empty() {
            page.draw_stroke(
                polyline_path(&points),
                UNLOADED_SHAPE_STROKE.with_dashes(true),
            );
        }
        for vein in &self.veins.veins {
            page.draw_stroke(
                vein.projected_path(&place),
                Stroke::new(vein.color, LAYOUT.line),
            );
        }
        for force in &self.veins.forces {
            force.draw(page, &place);
            force.draw_label(page, cell, &place);
        }
        draw_vein_markers(page, self.veins, &place);
        let Some(pieces) = self.veins.veins.first().map(|vein| &vein.pieces) else {
            return;
        };
        if let Some([base, next, ..]) = pieces.first() {
            let [base, next] = [*base, *next].map(&place);
            draw_support(page, base, next - base, self.veins.base_support);
        }
        match (pieces.last(), self.veins.tip_support) {
            (Some([.., before, tip]), Some(held)) => {
                let [before, tip] = [*before, *tip].map(&place);
                draw_support(page, tip, before - tip, held);
            }
            (Some([.., tip]), None) => draw_tip_marker(page, place(*tip)),
            (None, _) => (),
        }
    }
}

/// Draws what holds an end of a rod that goes on into this direction on the page.
fn draw_support(page: &mut Drawing, at: DVec2, inward: DVec2, held: SupportForm) {
    match (held, inward.try_normalize()) {
        (SupportForm::Clamped, Some(inward)) => draw_wall(page, at, inward, 1.0),
        _ => draw_support_marker(page, at, held),
    }
}

/// Draws a wall across the end of a rod, hatched behind.
fn draw_wall(page: &mut Drawing, at: DVec2, inward: DVec2, size: f64) {
    let along = size * WALL.half_length * inward.perp();
    page.draw_line(at - along, at + along, Stroke::new(TEXT_COLOR, 2.0));
    let mut path: DrawingPath = Vec::new();
    for k in -WALL.hatching_strokes..=WALL.hatching_strokes {
        let from = at + f64::from(k) / f64::from(WALL.hatching_strokes) * along;
        let behind = size * WALL.hatching_depth * (0.6 * inward.perp() - inward);
        path.extend([PathStep::Move(from), PathStep::Line(from + behind)]);
    }
    page.draw_stroke(path, Stroke::new(TEXT_COLOR, 1.0));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::drawing::formats::checked_svg_text;
    use crate::figure::leaf;
    use crate::report::sample;

    use glam::DVec3;
    use leafdyn::scenario::{Clamp, HeldTip, PointLoad};

    /// The sample rod in a picture of this scenario.
    fn svg(change: impl FnOnce(&mut Scenario)) -> String {
        let mut scenario = sample::sample_scenario("rod", 1);
        change(&mut scenario);
        checked_svg_text(&leaf(&sample::sample_equilibrium(1, 8), &scenario))
    }

    /// How often one of its strokes is as thick as that of a wall: the key has one more.
    fn walls(svg: &str) -> usize {
        svg.matches("stroke=\"#202024\" stroke-width=\"2\"").count() - 1
    }

    #[test]
    fn a_rod_has_one_view_with_its_loads_and_supports() {
        let hanging = svg(|_| ());
        for part in [
            ">at rest<",
            ">unloaded<",
            ">free tip<",
            ">gravity<",
            ">from the side<",
        ] {
            assert_eq!(hanging.matches(part).count(), 1, "{part}");
        }
        assert_eq!(walls(&hanging), 1);
        let loaded = svg(|it| {
            it.tip_force = [0.0, 0.0, -2.0];
            it.points = vec![PointLoad {
                vein: 0,
                at: 0.5,
                force: [0.0, 0.0, 0.5],
                moment: [0.0; 3],
                follows: false,
                mass: 0.0,
                offset: [0.0; 2],
                in_time: None,
                landing: None,
            }];
        });
        assert!(loaded.contains(">force 2<") && loaded.contains(">force 0.5<"));
        // A clamped tip is drawn as a clamp, a pinned one as pinned.
        let hold = |it: &mut Scenario, clamps| {
            let position = [1.0, 0.0, 0.0];
            it.held_tip = Some(HeldTip { position, clamps });
        };
        let clamp = Clamp {
            angle: 0.0,
            twist: 0.0,
        };
        let clamped = svg(|it| hold(it, Some(vec![clamp])));
        assert_eq!(walls(&clamped), 2);
        let pinned = svg(|it| hold(it, None));
        assert_eq!(walls(&pinned), 1);
        assert!(pinned.contains(">pinned<"));
        assert!(
            ![clamped, pinned]
                .iter()
                .any(|svg| svg.contains(">free tip<"))
        );
    }

    /// It is drawn as the dead force that has its direction on the section there.
    #[test]
    fn a_load_that_follows_is_drawn_where_it_points() {
        let rod = sample::sample_equilibrium(1, 8);
        let turn = rod.shape.rods[0].nodes[4].rotation;
        let own = DVec3::new(0.2, 0.0, 0.5);
        let loaded = |force: DVec3, follows: bool| {
            svg(|it| {
                it.points = vec![PointLoad {
                    vein: 0,
                    at: rod.shape.stations[4],
                    force: force.to_array(),
                    moment: [0.0; 3],
                    follows,
                    mass: 0.0,
                    offset: [0.0; 2],
                    in_time: None,
                    landing: None,
                }];
            })
        };
        let drawn = loaded(own, true);
        assert!(drawn.contains(">force 0.5385<"));
        assert_eq!(drawn, loaded(turn * own, false));
        // Off the axis it begins beside it.
        let beside = svg(|it| {
            it.points = vec![PointLoad {
                vein: 0,
                at: rod.shape.stations[4],
                force: own.to_array(),
                moment: [0.0; 3],
                follows: true,
                mass: 0.0,
                offset: [0.0, 0.1],
                in_time: None,
                landing: None,
            }];
        });
        assert!(beside.contains(">force 0.5385<"));
        assert_ne!(beside, drawn);
        let along = svg(|it| {
            it.follower = Some(vec![
                [0.0, 0.0, 0.3].map(leafdyn::scenario::Profile::Constant),
            ]);
        });
        assert_ne!(along, svg(|_| ()));
    }

    #[test]
    fn a_rod_that_leaves_every_plane_is_drawn_in_space() {
        let mut rod = sample::sample_equilibrium(1, 8);
        for (k, point) in rod.shape.curves[0].iter_mut().enumerate() {
            *point += 0.02 * (k * k) as f64 * 0.25 * DVec3::Y;
        }
        let drawn = checked_svg_text(&leaf(&rod, &sample::sample_scenario("rod", 1)));
        assert!(drawn.contains(">in space, with its shadow on the floor<"));
        assert!(!drawn.contains(">from the side<"));
    }

    #[test]
    fn the_unloaded_shape_is_drawn_where_it_differs() {
        let unloaded = |svg: &str| svg.contains(">unloaded");
        let straight = |scale: f64| {
            let mut rod = sample::sample_equilibrium(1, 8);
            for (k, point) in rod.shape.curves[0].iter_mut().enumerate() {
                *point = scale * k as f64 / 8.0 * DVec3::X;
            }
            checked_svg_text(&leaf(&rod, &sample::sample_scenario("rod", 1)))
        };
        assert!(!unloaded(&straight(1.0)) && unloaded(&straight(0.9)));
        // Of a coiled rod only the beginning.
        assert!(straight(0.1).contains(">unloaded, cut off<"));
    }
}
