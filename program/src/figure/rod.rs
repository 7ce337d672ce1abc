//! A single rod at rest in one large view: of the plane in which it lies, or in space; with its loads,
//! its supports and its unloaded shape.

use crate::figure::drawing::labels::{
    Cell, KeyRows, LEFT, NOTE_BASE, PANEL_AXIS, PANEL_TITLE, RIGHT, WIDTH, new_page, title,
};
use crate::figure::drawing::markers::{Force, forces, hold_marker, tip_marker, vein_markers};
use crate::figure::drawing::space::{Margins, OBLIQUE, Scene, surrounding_box};
use crate::figure::drawing::{
    Drawing, FRAME, INK, Path, Step, Stroke, is_drawable, polyline, stretch,
};
use crate::figure::leaf::{Veins, flat};
use crate::figure::scenario::Setting;
use glam::{DVec2, DVec3};
use leafdyn::natural::Natural;
use leafdyn::relax::Equilibrium;
use leafdyn::scenario::{Hold, Scenario};

/// Heights of the view.
const LOWEST: f64 = 240.0;

const HIGHEST: f64 = 560.0;

const BOTTOM: f64 = 4.0;

/// Padding around the rod and its arrows, as a fraction of the largest extent.
const PADDING: f64 = 0.07;

/// A rod within this fraction of its extent of a plane is drawn in that.
const FLAT: f64 = 0.02;

/// Unloaded shapes nearer than this to the rod are not drawn, in its extents.
const VISIBLE: f64 = 0.004;

/// An unloaded shape that is so many times as large as a coiled rod is cut off.
const FARTHEST: f64 = 4.0;

/// Points of the unloaded shape.
const POINTS: usize = 96;

const LINE: f64 = 2.4;

const UNLOADED: Stroke = Stroke::new(FRAME, 1.4);

/// Half the length of a wall, the depth of its hatching, and the strokes of that.
const WALL: f64 = 15.0;

const DEPTH: f64 = 8.0;

const STROKES: i32 = 3;

/// Names of planes, and their two axes.
const PLANES: [(&str, [usize; 2]); 3] = [
    ("from above", [0, 1]),
    ("from the side", [0, 2]),
    ("from the front", [1, 2]),
];

const MARGINS: Margins = Margins {
    left: 90.0,
    right: 60.0,
    below: 44.0,
};

/// What is drawn of a rod, in units of its length.
struct Rod<'a> {
    veins: &'a Veins,
    /// Its unloaded shape, if that looks different.
    unloaded: Vec<DVec3>,
    /// Whether its end is left out.
    cut_off: bool,
    forces: Vec<Force>,
}

/// Draws a single rod with its name and notes.
pub fn draw(
    leaf: &Equilibrium,
    scenario: &Scenario,
    veins: &Veins,
    setting: &Setting,
    notes: &[String],
) -> Drawing {
    let rod = Rod::of(leaf, scenario, veins);
    let mut page = new_page(LEFT, &leaf.scenario, notes, None);
    let mut top = 0.0;
    page.group("key", |page| top = rod.draw_key(page));
    let (low, high) = rod.corners();
    let extent = high - low;
    let corner = DVec2::new(LEFT, top + PANEL_TITLE);
    let width = WIDTH - LEFT - RIGHT;
    let height = match rod.plane() {
        Some((what, axes)) => {
            let [across, up] = axes.map(|axis| extent[axis]);
            let height = (width * up / across).clamp(LOWEST, HIGHEST);
            let cell = Cell::new(corner, DVec2::new(width, height));
            let scale = (width / across).min(height / up);
            page.group("rod", |page| {
                title(page, corner, "", what);
                let camera = flat(page, 0.5 * (low + high), setting, cell, scale, axes);
                rod.draw(page, cell, |point| camera.place(point));
                let taken = rod.taken().map(|point| camera.place(point));
                camera.draw_arrows(page, &setting.arrows(true, 0.0), cell, taken);
            });
            height + PANEL_AXIS
        }
        None => {
            let cell = Cell::new(corner, DVec2::new(width, HIGHEST));
            let bounds = surrounding_box(low, high);
            let scene = Scene::new(bounds, setting, OBLIQUE, cell, MARGINS, None);
            page.group("rod", |page| {
                title(page, corner, "", "in space, with its shadow on the floor");
                scene.draw_box(page);
                scene.draw_axes(page, 38.0);
                scene.draw_arrows(page, true, 0.0);
                scene.draw_shadows(page, veins, LINE);
                rod.draw(page, cell, |point| scene.place(point));
            });
            HIGHEST
        }
    };
    page.height = (corner.y + height + BOTTOM).ceil();
    page
}

impl<'a> Rod<'a> {
    fn of(leaf: &Equilibrium, scenario: &Scenario, veins: &'a Veins) -> Self {
        let natural = Natural::new(scenario, true);
        let at = |k: usize| natural.at(0, k as f64 / POINTS as f64).0 / veins.unit;
        let mut unloaded: Vec<DVec3> = (0..=POINTS).map(at).filter(|&it| is_drawable(it)).collect();
        let (stations, curve) = match leaf.shape.curves.first() {
            Some(curve) => (&leaf.shape.curve_stations[..], &curve[..]),
            None => Default::default(),
        };
        let point = |sigma: f64| {
            let point = stretch(stations, curve, [sigma; 2]).pop()? / veins.unit;
            is_drawable(point).then_some(point)
        };
        let differs = (0..=POINTS).zip(&unloaded).any(|(k, natural)| {
            let there = point(k as f64 / POINTS as f64);
            there.is_some_and(|it| it.distance(*natural) > VISIBLE * veins.extent())
        });
        let extent = |(low, high): (DVec3, DVec3)| (high - low).max_element();
        let own = extent((veins.low, veins.high));
        let whole = unloaded
            .iter()
            .fold((DVec3::ZERO, DVec3::ZERO), |(low, high), &it| {
                (low.min(it), high.max(it))
            });
        let cut_off = extent(whole) > FARTHEST * own && own > 0.0;
        if cut_off {
            let near = |it: &&DVec3| it.length() < 1.5 * own;
            let count = unloaded.iter().take_while(near).count();
            unloaded.truncate(count);
        }
        let forces = forces(scenario, veins.extent(), |sigma| {
            let [before, there] = [(sigma - 0.02).max(0.0), sigma.max(0.02)].map(&point);
            Some((point(sigma)?, (there? - before?).normalize_or_zero()))
        });
        Rod {
            veins,
            unloaded: if differs { unloaded } else { Vec::new() },
            cut_off,
            forces,
        }
    }

    /// Points that nothing else should cover.
    fn taken(&self) -> impl Iterator<Item = DVec3> {
        let arrows = self.forces.iter().flat_map(|force| force.ends);
        let unloaded = self.unloaded.iter().copied();
        self.veins.points().chain(unloaded).chain(arrows)
    }

    /// Corners of a box around it.
    fn corners(&self) -> (DVec3, DVec3) {
        let (low, high) = self
            .taken()
            .fold((self.veins.low, self.veins.high), |(low, high), it| {
                (low.min(it), high.max(it))
            });
        let extent = (high - low).max_element();
        let extent = if extent > 1e-9 { extent } else { 1.0 };
        let padding = DVec3::splat(PADDING * extent);
        (low - padding, high + padding)
    }

    /// The plane of two axes in which it is seen, unless it leaves every such plane.
    fn plane(&self) -> Option<(&'static str, [usize; 2])> {
        let (low, high) = self.corners();
        let extent = high - low - DVec3::splat(2.0 * PADDING * (high - low).max_element());
        let seen = |(_, [a, b]): &(&str, [usize; 2])| extent[*a].min(extent[*b]);
        let best = PLANES.into_iter().reduce(|one, other| {
            if seen(&other) > seen(&one) {
                other
            } else {
                one
            }
        })?;
        let across = 3 - best.1[0] - best.1[1];
        (extent[across] <= FLAT * extent.max_element()).then_some(best)
    }

    /// Draws the key; returns where it ends.
    fn draw_key(&self, page: &mut Drawing) -> f64 {
        let mut key = KeyRows::at(LEFT, NOTE_BASE + 22.0, 26.0);
        let own = self.veins.veins.first().map_or(INK, |vein| vein.color);
        key.entry(page, "at rest", |page, cell| {
            cell.line(page, Stroke::new(own, LINE))
        });
        if !self.unloaded.is_empty() {
            let name = match self.cut_off {
                true => "unloaded, cut off",
                false => "unloaded",
            };
            key.entry(page, name, |page, cell| {
                cell.line(page, UNLOADED.dashed(true));
            });
        }
        let veins = self.veins;
        for (how, name) in [(Hold::Clamped, "clamp"), (Hold::Pinned, "pinned")] {
            let mut grips = veins.grips.iter();
            let gripped = grips.any(|grip| grip.held == how);
            let ends = veins.base_held == how || veins.tip_held == Some(how);
            match how {
                Hold::Clamped if ends => key.entry(page, name, |page, cell| {
                    let [left, right] = cell.midline();
                    draw_wall(page, left.lerp(right, 0.6), DVec2::X, 0.6);
                }),
                _ if ends || gripped => key.entry(page, name, |page, cell| {
                    hold_marker(page, cell.middle(), how);
                }),
                _ => (),
            }
        }
        if veins.tip_held.is_none() {
            key.entry(page, "free tip", |page, cell| {
                tip_marker(page, cell.middle())
            });
        }
        key.end()
    }

    fn draw(&self, page: &mut Drawing, cell: Cell, place: impl Fn(DVec3) -> DVec2) {
        let points: Vec<DVec2> = self.unloaded.iter().map(|&point| place(point)).collect();
        if !points.is_empty() {
            page.stroke(polyline(&points), UNLOADED.dashed(true));
        }
        for vein in &self.veins.veins {
            page.stroke(vein.path(&place), Stroke::new(vein.color, LINE));
        }
        for force in &self.forces {
            force.draw(page, cell, &place);
        }
        vein_markers(page, self.veins, &place);
        let Some(pieces) = self.veins.veins.first().map(|vein| &vein.pieces) else {
            return;
        };
        if let Some([base, next, ..]) = pieces.first() {
            let [base, next] = [*base, *next].map(&place);
            draw_support(page, base, next - base, self.veins.base_held);
        }
        match (pieces.last(), self.veins.tip_held) {
            (Some([.., before, tip]), Some(held)) => {
                let [before, tip] = [*before, *tip].map(&place);
                draw_support(page, tip, before - tip, held);
            }
            (Some([.., tip]), None) => tip_marker(page, place(*tip)),
            (None, _) => (),
        }
    }
}

/// Draws what holds an end of a rod that goes on into this direction on the page.
fn draw_support(page: &mut Drawing, at: DVec2, inward: DVec2, held: Hold) {
    match (held, inward.try_normalize()) {
        (Hold::Clamped, Some(inward)) => draw_wall(page, at, inward, 1.0),
        _ => hold_marker(page, at, held),
    }
}

/// Draws a wall across the end of a rod, hatched behind.
fn draw_wall(page: &mut Drawing, at: DVec2, inward: DVec2, size: f64) {
    let along = size * WALL * inward.perp();
    page.line(at - along, at + along, Stroke::new(INK, 2.0));
    let mut path: Path = Vec::new();
    for k in -STROKES..=STROKES {
        let from = at + f64::from(k) / f64::from(STROKES) * along;
        let behind = size * DEPTH * (0.6 * inward.perp() - inward);
        path.extend([Step::Move(from), Step::Line(from + behind)]);
    }
    page.stroke(path, Stroke::new(INK, 1.0));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::drawing::formats::text;
    use crate::figure::leaf;
    use crate::report::sample;

    use glam::DVec3;
    use leafdyn::scenario::{Clamp, HeldTip, PointLoad};

    /// The sample rod in a picture of this scenario.
    fn svg(change: impl FnOnce(&mut Scenario)) -> String {
        let mut scenario = sample::scenario("rod", 1);
        change(&mut scenario);
        text(&leaf(&sample::fan(1, 8), &scenario))
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
                mass: 0.0,
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

    #[test]
    fn a_rod_that_leaves_every_plane_is_drawn_in_space() {
        let mut rod = sample::fan(1, 8);
        for (k, point) in rod.shape.curves[0].iter_mut().enumerate() {
            *point += 0.02 * (k * k) as f64 * 0.25 * DVec3::Y;
        }
        let drawn = text(&leaf(&rod, &sample::scenario("rod", 1)));
        assert!(drawn.contains(">in space, with its shadow on the floor<"));
        assert!(!drawn.contains(">from the side<"));
    }

    #[test]
    fn the_unloaded_shape_is_drawn_where_it_differs() {
        let unloaded = |svg: &str| svg.contains(">unloaded");
        let straight = |scale: f64| {
            let mut rod = sample::fan(1, 8);
            for (k, point) in rod.shape.curves[0].iter_mut().enumerate() {
                *point = scale * k as f64 / 8.0 * DVec3::X;
            }
            text(&leaf(&rod, &sample::scenario("rod", 1)))
        };
        assert!(!unloaded(&straight(1.0)) && unloaded(&straight(0.9)));
        // Of a coiled rod only the beginning.
        assert!(straight(0.1).contains(">unloaded, cut off<"));
    }
}
