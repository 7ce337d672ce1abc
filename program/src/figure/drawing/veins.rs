//! The veins of a leaf as they are drawn, in units of the longest rod: smooth curves with their
//! supports, grips, loads and markers, of a leaf at rest, in motion, or of any curves.

use crate::figure::drawing::axes::round_step;
use crate::figure::drawing::markers::{
    ForceArrow, Marker, MomentArrow, RodPoint, draw_clamp_bar, draw_mass_marker,
    draw_second_solution_dot, draw_support_marker, draw_tip_marker, force_arrows, moment_arrows,
};
use crate::figure::drawing::{
    Color, Drawing, DrawingPath, PathStep, Stroke, TEXT_COLOR, WHITE, circle_path, color_of_vein,
    curve_between_fractions, is_drawable, polyline_path,
};
use crate::figure::scenario::{
    FigureSetting, LoadKind, LoadMark, ParsedKey, SupportForm, load_marks, section_rotation,
    support_marks, with_followers_as_dead,
};
use glam::{DQuat, DVec2, DVec3};
use leafdyn::relax::{Equilibrium, RodShape};
use leafdyn::scenario::Scenario;
use leafdyn::simulate::{Record, ShapeSnapshot};

/// Of a leaf of more veins only some are drawn: more could not be distinguished.
const MOST_VEINS_DRAWN: usize = 200;

/// Largest distance of a drawn curve from the computed points, in lengths: a
/// quarter of a pixel.
const LARGEST_CURVE_DEVIATION: f64 = 3e-4;

/// Curves are drawn with at least this many pieces, if they have as many segments.
const FEWEST_PIECES_PER_CURVE: usize = 8;

/// How many dots a second solution has.
struct DotLimits {
    /// About the most veins with dots, and about the most dots of all.
    veins: usize,
    most: usize,
    /// Dots per extent of the leaf.
    per_extent: f64,
    /// On a vein that has as many nodes.
    fewest: usize,
}

const SECOND_SOLUTION_DOT_LIMITS: DotLimits = DotLimits {
    veins: 24,
    most: 160,
    per_extent: 14.0,
    fewest: 8,
};

/// Part of a vein over which its tangent at a force is taken.
const TANGENT_REACH: f64 = 0.02;

pub type BezierPiece = [DVec3; 4];

pub struct DrawnVein {
    pub pieces: Vec<BezierPiece>,
    pub color: Color,
}

impl DrawnVein {
    pub fn projected_path(&self, place: impl Fn(DVec3) -> DVec2) -> DrawingPath {
        let start = self
            .pieces
            .first()
            .map(|piece| PathStep::Move(place(piece[0])));
        let pieces = self.pieces.iter();
        let rest = pieces.map(|&[_, a, b, end]| PathStep::Cubic(place(a), place(b), place(end)));
        start.into_iter().chain(rest).collect()
    }
}

/// A stretch of a vein, or a point, that a grip holds.
pub struct GrippedStretch {
    pub points: Vec<DVec3>,
    pub support: SupportForm,
}

/// The tip of a vein, or of all where they are joined.
pub struct DrawnTip {
    pub position: DVec3,
    pub color: Color,
}

pub struct DrawnVeins {
    pub veins: Vec<DrawnVein>,
    pub count: usize,
    pub dots: Vec<DVec3>,
    pub tips: Vec<DrawnTip>,
    /// How the bases are held, and the tips if they are.
    pub base_support: SupportForm,
    pub tip_support: Option<SupportForm>,
    pub grips: Vec<GrippedStretch>,
    pub forces: Vec<ForceArrow>,
    /// Where masses have landed.
    masses: Vec<DVec3>,
    pub moments: Vec<MomentArrow>,
    /// Corners of the bounding box.
    pub low: DVec3,
    pub high: DVec3,
    /// The largest rod length, in the scenario's units.
    pub unit: f64,
}

impl DrawnVeins {
    pub fn from_equilibrium(equilibrium: &Equilibrium, scenario: &Scenario) -> Self {
        let shape = &equilibrium.shape;
        let veins = DrawnVeins::from_curves(&shape.curves, &equilibrium.tips, shape.longest());
        let loads = load_marks(&with_followers_as_dead(scenario, equilibrium), None);
        veins.with_supports(scenario).with_loads(
            scenario,
            &loads,
            (&shape.curve_stations, &shape.curves),
            |vein, sigma| section_rotation(equilibrium, vein - 1, sigma),
        )
    }

    /// Whether bases or tips are held like this.
    pub fn has_held_ends(&self, how: SupportForm) -> bool {
        self.base_support == how || self.tip_support == Some(how)
    }

    /// Whether a grip holds like this.
    pub fn has_grips(&self, how: SupportForm) -> bool {
        self.grips.iter().any(|grip| grip.support == how)
    }

    /// Where the drawn veins begin.
    pub fn bases(&self) -> impl Iterator<Item = DVec3> {
        let first = |vein: &DrawnVein| vein.pieces.first().map_or(DVec3::ZERO, |piece| piece[0]);
        self.veins.iter().map(first)
    }

    /// From the base to the tip, or from the mean of all bases to that of all tips.
    pub fn tip_from_base(&self) -> DVec3 {
        let mean = |points: &mut dyn Iterator<Item = DVec3>| {
            let points: Vec<DVec3> = points.collect();
            points.iter().sum::<DVec3>() / points.len().max(1) as f64
        };
        let tips = self.tips.iter().map(|tip| tip.position);
        mean(&mut { tips }) - mean(&mut self.bases())
    }

    /// The veins of a moving leaf at one instant.
    pub fn from_motion(record: &Record, still: &ShapeSnapshot, scenario: &Scenario) -> Self {
        let tips = vein_tips(&still.curves, record.joined);
        let veins = DrawnVeins::from_curves(&still.curves, &tips, record.length);
        let time = record.moments.get(still.moment).map_or(0.0, |it| it.time);
        let loads = load_marks(scenario, Some(time));
        veins.with_supports(scenario).with_loads(
            scenario,
            &loads,
            (&record.stations, &still.curves),
            |_, _| None,
        )
    }

    /// Adds what the grips of a scenario hold and where forces and moments act, on curves through nodes
    /// at these stations. Loads off the axis are drawn there where the rotation of the section of a vein at a
    /// fraction of its length is known.
    fn with_loads(
        mut self,
        scenario: &Scenario,
        loads: &[LoadMark],
        (stations, curves): (&[f64], &[Vec<DVec3>]),
        rotation: impl Fn(usize, f64) -> Option<DQuat>,
    ) -> Self {
        let point = |vein: usize, sigma: f64| {
            let curve = curves.get(vein - 1)?;
            let point = curve_between_fractions(stations, curve, [sigma; 2]).pop()? / self.unit;
            is_drawable(point).then_some(point)
        };
        self.moments = moment_arrows(loads, point);
        let masses = loads.iter().filter(|mark| mark.action == LoadKind::Mass);
        self.masses = masses.filter_map(|it| point(it.vein, it.at)).collect();
        self.forces = force_arrows(
            loads,
            &scenario.units,
            self.largest_extent(),
            |vein, sigma, [along_2, along_3]| {
                let near = [(sigma - TANGENT_REACH).max(0.0), sigma.max(TANGENT_REACH)];
                let [before, there] = near.map(|sigma| point(vein, sigma));
                let own = DVec3::new(0.0, along_2, along_3) / self.unit;
                let arm = rotation(vein, sigma).map_or(DVec3::ZERO, |turn| turn * own);
                Some(RodPoint {
                    position: point(vein, sigma)? + arm,
                    arm,
                    tangent: (there? - before?).normalize_or_zero(),
                })
            },
        );
        for end in self.forces.iter().flat_map(|force| force.ends) {
            (self.low, self.high) = (self.low.min(end), self.high.max(end));
        }
        let grips = support_marks(scenario).into_iter();
        for grip in
            grips.filter(|mark| [ParsedKey::Grip, ParsedKey::Foundation].contains(&mark.part))
        {
            let curve = curves.get(grip.vein - 1).map_or(&[][..], Vec::as_slice);
            let points = curve_between_fractions(stations, curve, grip.at).into_iter();
            let points = points.map(|point| point / self.unit);
            self.grips.push(GrippedStretch {
                points: points.filter(|&point| is_drawable(point)).collect(),
                support: grip.held,
            });
        }
        self
    }

    /// Adds how a scenario holds the bases and the tips.
    pub fn with_supports(self, scenario: &Scenario) -> Self {
        let marks = support_marks(scenario);
        let held = |part| {
            let mut of_part = marks.iter().filter(move |mark| mark.part == part);
            of_part.next().map(|mark| mark.held)
        };
        // The tip of the only vein may be held by a grip at its end: a roller, a spring.
        let grip_at_tip = || {
            let mut grips = marks.iter().filter(|mark| mark.part == ParsedKey::Grip);
            let at_end = grips.find(|mark| scenario.rods.len() == 1 && mark.at[1] == 1.0);
            at_end.map(|mark| mark.held)
        };
        DrawnVeins {
            base_support: held(ParsedKey::Base).unwrap_or(self.base_support),
            tip_support: held(ParsedKey::Tip).or_else(grip_at_tip),
            ..self
        }
    }

    /// Veins through these points, with the longest rod as the unit. Tips are extrapolated,
    /// points need not be.
    pub fn from_curves(curves: &[Vec<DVec3>], tips: &[DVec3], longest: f64) -> Self {
        let usable = longest.is_finite() && longest > 0.0;
        let unit = if usable { longest } else { 1.0 };
        let count = curves.len();
        let drawn = (0..count).filter(|&index| is_vein_drawn(index, count));
        let veins: Vec<DrawnVein> = drawn
            .map(|index| DrawnVein {
                pieces: smooth_vein(&drawable_points(&curves[index], unit)),
                color: color_of_vein(index, count),
            })
            .collect();
        let joined = tips.len() == 1;
        let tips = (0..tips.len())
            .filter(|&index| joined || is_vein_drawn(index, count))
            .map(|index| DrawnTip {
                position: tips[index] / unit,
                color: color_of_vein(index, count),
            })
            .filter(|tip| is_drawable(tip.position))
            .collect();

        let pieces = veins.iter().flat_map(|vein| &vein.pieces);
        let (mut low, mut high) = (DVec3::ZERO, DVec3::ZERO);
        for piece in pieces {
            (low, high) = (low.min(piece[3]), high.max(piece[3]));
        }
        DrawnVeins {
            veins,
            count,
            dots: Vec::new(),
            tips,
            base_support: SupportForm::Clamped,
            tip_support: None,
            grips: Vec::new(),
            forces: Vec::new(),
            masses: Vec::new(),
            moments: Vec::new(),
            low,
            high,
            unit,
        }
    }

    /// Adds a second solution as dots, on as many veins and at as many nodes as can be
    /// distinguished.
    pub fn add_second_solution(&mut self, rods: &[RodShape]) {
        let every = self.count.div_ceil(SECOND_SOLUTION_DOT_LIMITS.veins).max(1);
        let most = (SECOND_SOLUTION_DOT_LIMITS.most / rods.len().div_ceil(every).max(1))
            .max(SECOND_SOLUTION_DOT_LIMITS.fewest);
        // A coiled vein is longer than the leaf.
        let lengths = 1.0 / self.largest_extent();
        let wanted = (SECOND_SOLUTION_DOT_LIMITS.per_extent * lengths).ceil() as usize;
        let dots = wanted.clamp(SECOND_SOLUTION_DOT_LIMITS.fewest, most);
        for rod in rods.iter().step_by(every) {
            let stride = (rod.nodes.len() - 1).div_ceil(dots).max(1);
            // The base is under the clamp's marker.
            let nodes = rod.nodes.iter().skip(stride).step_by(stride);
            let points = nodes.map(|node| node.position / self.unit);
            self.dots.extend(points.filter(|&point| is_drawable(point)));
        }
        for &point in &self.dots {
            (self.low, self.high) = (self.low.min(point), self.high.max(point));
        }
    }

    pub fn leaf_notes(&self, setting: &FigureSetting) -> Vec<String> {
        let mut notes = vec![format!("L = {}", setting.longest_rod_text())];
        let every = vein_stride(self.count);
        if every > 1 {
            notes.push(format!("1 vein in {every} drawn"));
        }
        let single: Vec<&ForceArrow> = (self.forces.iter())
            .filter(|force| !force.label().is_empty())
            .collect();
        match single.as_slice() {
            // On a rod every arrow has its label.
            _ if self.count == 1 => (),
            [] => (),
            [one] => notes.push(format!("arrow: {}", one.label())),
            _ => notes.push("arrows: forces".into()),
        }
        match self.moments.as_slice() {
            [] => (),
            [one] if !one.is_per_length => notes.push(format!(
                "curved arrow: moment {}",
                setting.moment_text(one.size)
            )),
            _ => notes.push("curved arrows: moments".into()),
        }
        notes
    }

    pub fn piece_ends(&self) -> impl Iterator<Item = DVec3> {
        let pieces = self.veins.iter().flat_map(|vein| &vein.pieces);
        pieces.flat_map(|piece| [piece[0], piece[3]])
    }

    /// The largest side of the box, or 1 if it is a point.
    pub fn largest_extent(&self) -> f64 {
        let extent = (self.high - self.low).max_element();
        if extent > 1e-9 { extent } else { 1.0 }
    }

    /// A line width that keeps neighboring veins apart.
    pub fn line_width(&self) -> f64 {
        match self.veins.len() {
            0..=2 => 2.0,
            3..=8 => 1.7,
            9..=30 => 1.25,
            31..=60 => 0.9,
            61..=120 => 0.65,
            _ => 0.45,
        }
    }
}

fn vein_stride(count: usize) -> usize {
    count.div_ceil(MOST_VEINS_DRAWN).max(1)
}

/// Whether a vein is drawn: of a wide leaf only every n-th vein and the last are.
pub fn is_vein_drawn(index: usize, count: usize) -> bool {
    index.is_multiple_of(vein_stride(count)) || index + 1 == count
}

/// The last point of the first curve if the tips are joined, otherwise of all curves.
pub fn vein_tips(curves: &[Vec<DVec3>], joined: bool) -> Vec<DVec3> {
    let count = if joined { 1 } else { curves.len() };
    let ends = curves.iter().take(count);
    ends.filter_map(|curve| curve.last()).copied().collect()
}

/// The length of the longest of these curves.
pub fn longest_curve<'c>(curves: impl IntoIterator<Item = &'c Vec<DVec3>>) -> f64 {
    let length = |curve: &Vec<DVec3>| curve.windows(2).map(|w| w[0].distance(w[1])).sum();
    curves.into_iter().map(length).fold(0.0, f64::max)
}

/// Displacements of a buckled leaf below this fraction of its length are magnified.
const LEAST_VISIBLE_DISPLACEMENT: f64 = 0.1;

/// Magnifies the displacements of curves from others with as many nodes until they are visible; returns
/// the factor, if there is one.
pub fn magnify_displacements(curves: &mut [Vec<DVec3>], from: &[Vec<DVec3>]) -> Option<f64> {
    let largest = curves.iter().flatten().zip(from.iter().flatten());
    let largest = largest.map(|(x, y)| x.distance(*y)).fold(0.0, f64::max);
    let visible = LEAST_VISIBLE_DISPLACEMENT * longest_curve(&*curves);
    if !(0.0 < largest && largest < visible) {
        return None;
    }
    let factor = round_step(visible / largest);
    for (x, from) in curves.iter_mut().flatten().zip(from.iter().flatten()) {
        *x = *from + factor * (*x - *from);
    }
    Some(factor)
}

/// Points of which those that cannot be drawn repeat the one before; the first is the clamp.
pub fn replace_undrawable_points(points: impl Iterator<Item = DVec3>, longest: f64) -> Vec<DVec3> {
    let mut last = DVec3::ZERO;
    let tame = points.map(|point| {
        if is_drawable(point / longest) {
            last = point;
        }
        last
    });
    tame.collect()
}

/// The smallest stride that leaves a vein of so many nodes its tip and at most so many segments.
pub fn node_stride(nodes: usize, most: usize) -> usize {
    let last = nodes.saturating_sub(1);
    let mut strides = last.div_ceil(most).max(1)..=last;
    let whole = strides.find(|stride| last.is_multiple_of(*stride));
    whole.unwrap_or(1)
}

/// Draws the markers of a leaf: those along its veins, and of its bases and tips.
pub fn draw_leaf_markers(page: &mut Drawing, veins: &DrawnVeins, place: impl Fn(DVec3) -> DVec2) {
    for force in &veins.forces {
        force.draw(page, &place);
    }
    draw_vein_markers(page, veins, &place);
    let mut bases: Vec<DVec3> = Vec::new();
    for base in veins.bases() {
        if !bases.contains(&base) {
            bases.push(base);
        }
    }
    let places: Vec<DVec2> = bases.into_iter().map(&place).collect();
    match (veins.base_support, places.as_slice()) {
        (SupportForm::Clamped, [_, _, ..]) => draw_clamp_bar(page, &places),
        (held, places) => places
            .iter()
            .for_each(|&at| draw_support_marker(page, at, held)),
    }
    if let [tip] = veins.tips.as_slice() {
        return match veins.tip_support {
            Some(held) => draw_support_marker(page, place(tip.position), held),
            None => draw_tip_marker(page, place(tip.position)),
        };
    }
    // Many are small.
    let radius = if veins.tips.len() > 30 { 1.5 } else { 2.4 };
    for tip in &veins.tips {
        let rim = Stroke::new(tip.color, 0.5 * radius);
        page.draw_shape(circle_path(place(tip.position), radius), WHITE, Some(rim));
    }
}

/// Draws the markers along veins: points of a second solution, masses that have landed, moments and grips.
pub fn draw_vein_markers(page: &mut Drawing, veins: &DrawnVeins, place: impl Fn(DVec3) -> DVec2) {
    let radius = 0.7 + 0.6 * veins.line_width();
    for &point in &veins.dots {
        draw_second_solution_dot(page, place(point), radius);
    }
    for &mass in &veins.masses {
        draw_mass_marker(page, place(mass));
    }
    for moment in &veins.moments {
        moment.draw(page, veins.largest_extent(), &place);
    }
    for grip in &veins.grips {
        draw_grip_markers(page, grip, veins.line_width(), &place);
    }
}

/// Marks where a grip holds a vein: a stretch with both of its ends, or a point.
fn draw_grip_markers(
    page: &mut Drawing,
    grip: &GrippedStretch,
    line_width: f64,
    place: impl Fn(DVec3) -> DVec2,
) {
    let points: Vec<DVec2> = grip.points.iter().map(|&point| place(point)).collect();
    let marker = match grip.support {
        SupportForm::Clamped => Marker::Square,
        SupportForm::Pinned => Marker::Triangle,
        SupportForm::Sliding => Marker::Circle,
        SupportForm::Elastic => Marker::Diamond,
    };
    if let [first, .., last] = points.as_slice() {
        page.draw_stroke(
            polyline_path(&points),
            Stroke::new(TEXT_COLOR, 1.6 + line_width),
        );
        marker.draw(page, *first, TEXT_COLOR);
        marker.draw(page, *last, TEXT_COLOR);
    } else if let [point] = points.as_slice() {
        marker.draw(page, *point, TEXT_COLOR);
    }
}

/// The points up to the first that cannot be drawn.
fn drawable_points(curve: &[DVec3], unit: f64) -> Vec<DVec3> {
    let points = curve.iter().map(|&point| point / unit);
    points.take_while(|&point| is_drawable(point)).collect()
}

/// Smooth pieces through every second, fourth, ... of the points, as long as the curve
/// stays close to the others.
fn smooth_vein(points: &[DVec3]) -> Vec<BezierPiece> {
    let segments = points.len().saturating_sub(1);
    let mut stride = 1;
    while segments.is_multiple_of(2 * stride) && segments / (2 * stride) >= FEWEST_PIECES_PER_CURVE
    {
        stride *= 2;
    }
    loop {
        let kept: Vec<DVec3> = points.iter().copied().step_by(stride).collect();
        let pieces = interpolate_pieces(&kept);
        if stride == 1 || largest_deviation(&pieces, points, stride) < LARGEST_CURVE_DEVIATION {
            return pieces;
        }
        stride /= 2;
    }
}

fn largest_deviation(pieces: &[BezierPiece], points: &[DVec3], stride: usize) -> f64 {
    let deviation = |(index, &point): (usize, &DVec3)| {
        let place = (index / stride).min(pieces.len() - 1);
        let t = index as f64 / stride as f64 - place as f64;
        bezier_point(&pieces[place], t).distance(point)
    };
    points.iter().enumerate().map(deviation).fold(0.0, f64::max)
}

fn bezier_point(piece: &BezierPiece, t: f64) -> DVec3 {
    let [a, b, c, d] = *piece;
    let s = 1.0 - t;
    s * s * s * a + 3.0 * s * s * t * b + 3.0 * s * t * t * c + t * t * t * d
}

/// Cubic pieces, one per segment, through equally spaced points, with tangents from
/// differences: of fourth order inside, of second order next to the ends.
fn interpolate_pieces(points: &[DVec3]) -> Vec<BezierPiece> {
    let p = points;
    let last = p.len().saturating_sub(1);
    let tangent = |i: usize| match (i, last) {
        (_, 0) => DVec3::ZERO,
        (_, 1) => p[1] - p[0],
        (0, _) => 2.0 * p[1] - 1.5 * p[0] - 0.5 * p[2],
        (i, _) if i == last => 1.5 * p[i] - 2.0 * p[i - 1] + 0.5 * p[i - 2],
        (i, _) if i == 1 || i + 1 == last => 0.5 * (p[i + 1] - p[i - 1]),
        (i, _) => (8.0 * (p[i + 1] - p[i - 1]) - (p[i + 2] - p[i - 2])) / 12.0,
    };
    let piece = |i: usize| {
        let (start, end) = (tangent(i) / 3.0, tangent(i + 1) / 3.0);
        [p[i], p[i] + start, p[i + 1] - end, p[i + 1]]
    };
    (0..last).map(piece).collect()
}

#[cfg(test)]
mod tests {
    use crate::report::sample;
    use std::f64::consts::PI;

    use super::*;

    #[test]
    fn a_half_circle_is_drawn_round_with_few_pieces() {
        let points: Vec<DVec3> = (0..=256)
            .map(|i| DVec2::from_angle(PI * f64::from(i) / 256.0).extend(0.0) / PI)
            .collect();
        let pieces = smooth_vein(&points);
        assert!(pieces.len() <= 16, "{}", pieces.len());
        for piece in &pieces {
            for t in [0.25, 0.5, 0.75] {
                assert!((bezier_point(piece, t).length() * PI - 1.0).abs() < 2e-3);
            }
        }
    }

    #[test]
    fn small_displacements_are_magnified_until_they_are_visible() {
        let straight = vec![vec![DVec3::ZERO, DVec3::X]];
        for (by, factor) in [
            (1.5e-3, Some(100.0)),
            (0.04, Some(5.0)),
            (0.2, None),
            (0.0, None),
        ] {
            let mut bent = straight.clone();
            bent[0][1].y = by;
            let found = magnify_displacements(&mut bent, &straight);
            assert_eq!(found, factor, "{by}");
            let drawn = by * factor.unwrap_or(1.0);
            assert!((bent[0][1] - DVec3::new(1.0, drawn, 0.0)).length() < 1e-12);
        }
    }

    #[test]
    fn curves_of_no_one_and_two_points() {
        assert!(smooth_vein(&[]).is_empty());
        assert!(smooth_vein(&[DVec3::X]).is_empty());
        assert_eq!(smooth_vein(&[DVec3::ZERO, DVec3::X])[0][3], DVec3::X);
    }

    #[test]
    fn a_thinned_vein_keeps_its_tip() {
        for (nodes, kept) in [(65, 33), (33, 33), (61, 31), (2, 2), (1, 1), (0, 1)] {
            let (last, stride) = (f64::max(nodes as f64 - 1.0, 0.0), node_stride(nodes, 32));
            assert_eq!(last / stride as f64 + 1.0, f64::from(kept));
        }
    }

    #[test]
    fn dots_are_few_enough_to_be_distinguished() {
        for (rods, dots) in [(1, 14), (5, 5 * 14), (21, 21 * 8), (200, 23 * 8)] {
            let leaf = sample::sample_equilibrium(rods, 64);
            let mut veins = DrawnVeins::from_equilibrium(
                &leaf,
                &sample::sample_scenario("fan", leaf.shape.rods.len()),
            );
            veins.add_second_solution(&leaf.shape.rods);
            assert!(veins.dots.len() <= dots, "{rods}: {}", veins.dots.len());
            assert!(veins.dots.len() > dots / 2, "{rods}: {}", veins.dots.len());
        }
    }

    #[test]
    fn dots_away_from_the_leaf_are_in_the_box() {
        let leaf = sample::sample_equilibrium(3, 8);
        let mut veins = DrawnVeins::from_equilibrium(
            &leaf,
            &sample::sample_scenario("fan", leaf.shape.rods.len()),
        );
        let mut rods = leaf.shape.rods.clone();
        rods[1].nodes[8].position.z = 3.0;
        veins.add_second_solution(&rods);
        assert_eq!(veins.high.z, 3.0);
    }
}
