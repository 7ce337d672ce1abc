//! What a posture proves: `unbend.json`.

use crate::numbers::format_two_digits;
use crate::posture::leaf::{ModulusMeaning, ScenarioRod};
use crate::posture::rest::Stations;
use crate::posture::two_postures::TwoPostures;
use crate::posture::{Governing, Posture};
use crate::run::remarks;
use crate::scenario::Scenario;
use crate::study::unbend::request::UnbendRequest;
use glam::DVec3;
use serde::{Serialize, Serializer};

remarks! {
    /// What is to be known of the result.
    pub enum UnbendRemark {
        /// Coordinates that were taken for others.
        #[error("{0}")]
        Coordinates(String) = "coordinates",
        /// Points that were projected.
        #[error("the points were up to {} off the upright plane into which they were put", format_two_digits(*.off))]
        Projected {
            /// The largest distance.
            off: f64,
        } = "projected",
        /// A length that is not that of the scenario.
        #[error(
            "the points are {} long and leaf.length is {}: the length of the points was used, with the scenario's weight \
             per length",
            format_two_digits(*.found), format_two_digits(*.given)
        )]
        Length {
            /// Of the posture.
            found: f64,
            /// Of the scenario.
            given: f64,
        } = "length",
        /// Points that may run from tip to base.
        #[error(
            "the points begin away from leaf.base and lead back against the direction of the base: do they run from \
             tip to base? Then turn their order around"
        )]
        PerhapsReversed = "perhaps-reversed",
        /// A posture that proves nothing.
        #[error("the loads only stretch the leaf: it would be stable at any modulus, and the posture proves no bound")]
        NoBound = "no-bound",
        /// A modulus below the bound.
        #[error(
            "at {} the posture would be unstable ({index} negative eigenvalues): the modulus is larger, or the section, \
             the weight or the points are not those of this leaf",
            format_two_digits(*.young)
        )]
        Unstable {
            /// The modulus.
            young: f64,
            /// Its index.
            index: usize,
        } = "unstable",
        /// Postures that differ too little.
        #[error(
            "the leaf moves too little from one posture to the other to tell its modulus: it turns by {} rad, as noise \
             would; 95 %: at least {}",
            format_two_digits(*.turn), format_two_digits(*.least)
        )]
        MovesTooLittle {
            /// The largest turn.
            turn: f64,
            /// The least modulus.
            least: f64,
        } = "moves-too-little",
        /// Postures that no elastic leaf has.
        #[error(
            "the leaf moves against its weight from one posture to the other: turn its points around, or give the angle \
             by which it was turned (FILE:DEGREES)"
        )]
        MovesAgainstWeight = "moves-against-weight",
        /// A modulus by two postures below the bound of one.
        #[error("the modulus by two postures is below the bound that one of them proves: they are not those of one leaf")]
        BelowBound = "below-bound",
        /// A relaxation that does not confirm the posture.
        #[error("the scenario that should rest in the posture, relaxed from there, does not come to rest there: near its least modulus that is not to be expected; else take the bound with care")]
        NotConfirmed = "not-confirmed",
    }
}

/// The least modulus with its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CriticalYoung {
    /// The value; zero if the posture is stable at any modulus.
    pub value: f64,
    /// Lower end: a bound that the posture proves with 97.5 %.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// A modulus with its 95 % interval, from two postures.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ModulusInterval {
    /// The value.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end; none if the leaf may be rigid.
    pub high: Option<f64>,
    /// The largest angle by which the leaf turns from one posture to the other, besides the turn of its base.
    pub turn: f64,
}

/// Where the standard deviation of 1/E is more than this part of it, two postures tell no modulus.
const LARGEST_DEVIATION: f64 = 0.5;

impl ModulusInterval {
    /// The modulus that two postures tell, if they do.
    pub fn new(compared: &TwoPostures) -> Option<ModulusInterval> {
        let [least, most] = compared.interval();
        let c = compared.compliance;
        (c > 0.0 && compared.deviation < LARGEST_DEVIATION * c).then_some(ModulusInterval {
            value: 1.0 / c,
            low: 1.0 / most,
            high: (least > 0.0).then(|| 1.0 / least),
            turn: compared.turn,
        })
    }
}

/// The index at a modulus.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PostureIndex {
    /// The modulus.
    pub young: f64,
    /// Number of negative eigenvalues.
    pub index: usize,
}

/// What a relaxation from the posture came to.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RestCheck {
    /// The modulus.
    pub young: f64,
    /// Largest distance of the leaf at rest from the posture, in lengths; none if it does not come to rest.
    pub distance: Option<f64>,
    /// Its index.
    pub index: Option<usize>,
}

/// What slow loading of the leaf without loads leads to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SlowLoading {
    /// To the posture from this modulus on.
    From(f64),
    /// Elsewhere even at this modulus.
    NotBelow(f64),
}

/// How points became a curve.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SmoothingReport {
    /// Number of points.
    pub points: usize,
    /// Coordinates that were measured: 2 in a plane.
    pub coordinates: usize,
    /// Standard deviation of a coordinate, given or estimated; with a column `sd` that of a mean point.
    pub sd: f64,
    /// Whether it was given.
    pub sd_given: bool,
    /// Effective number of coefficients of each coordinate.
    pub degrees_of_freedom: f64,
}

/// What a posture proves.
#[derive(Clone, Debug)]
pub struct Unbending {
    /// Name of the scenario.
    pub scenario: String,
    /// The posture.
    pub posture: Posture,
    /// The posture at equal parts of its length.
    pub stations: Stations,
    /// The measured points.
    pub points: Vec<DVec3>,
    /// What the modulus is.
    pub meaning: ModulusMeaning,
    /// The least modulus.
    pub critical_young: CriticalYoung,
    /// The indices at the moduli that were asked for: one, or both ends of a range.
    pub indices: Vec<PostureIndex>,
    /// The modulus by two postures.
    pub young: Option<ModulusInterval>,
    /// How two postures compare.
    pub compared: Option<TwoPostures>,
    /// The modulus at which the leaf without loads is shown.
    pub shown_young: f64,
    /// The scenario that rests in the posture at that modulus.
    pub rest: Option<Scenario>,
    /// Whether it does.
    pub rest_check: Option<RestCheck>,
    /// Where slow loading leads.
    pub slow_loading: Option<SlowLoading>,
    /// What is to be known.
    pub remarks: Vec<UnbendRemark>,
    /// Time taken.
    pub wall_seconds: f64,
}

impl Unbending {
    pub(super) fn new(
        scenario: &Scenario,
        of: &ScenarioRod,
        posture: Posture,
        stations: Stations,
        request: &UnbendRequest,
    ) -> Unbending {
        let [low, high] = posture.critical_interval();
        let ends = request.young.iter().flat_map(|range| {
            let (low, high) = (*range.start(), *range.end());
            if low == high {
                vec![low]
            } else {
                vec![low, high]
            }
        });
        let indices = ends.map(|young| PostureIndex {
            young,
            index: posture.index(young),
        });
        Unbending {
            scenario: scenario.name.clone(),
            points: request.points.positions.clone(),
            meaning: of.meaning,
            critical_young: CriticalYoung {
                value: posture.critical_young(),
                low,
                high,
            },
            indices: indices.collect(),
            young: None,
            compared: None,
            shown_young: 0.0,
            rest: None,
            rest_check: None,
            slow_loading: None,
            remarks: Vec::new(),
            wall_seconds: 0.0,
            posture,
            stations,
        }
    }

    pub(super) fn add_remarks(&mut self, request: &UnbendRequest) {
        let given = request.scenario.rods[0].length;
        let found = self.stations.length;
        if let Some(off) = self.posture.off_plane {
            self.remarks.push(UnbendRemark::Projected { off });
        }
        if (found / given - 1.0).abs() > LENGTH_TOLERANCE {
            self.remarks.push(UnbendRemark::Length { found, given });
        }
        let (base, rotation) = request.scenario.base(0);
        if request.points.lead_backwards(base, rotation * DVec3::X) {
            self.remarks.push(UnbendRemark::PerhapsReversed);
        }
        if self.critical_young.value == 0.0 {
            self.remarks.push(UnbendRemark::NoBound);
        }
        let unstable = self.indices.iter().filter(|it| it.index > 0);
        if let Some(PostureIndex { young, index }) = unstable.copied().next() {
            self.remarks.push(UnbendRemark::Unstable { young, index });
        }
        if let (Some(compared), None) = (self.compared, self.young) {
            let [_, most] = compared.interval();
            self.remarks.push(match most > 0.0 {
                true => UnbendRemark::MovesTooLittle {
                    turn: compared.turn,
                    least: 1.0 / most,
                },
                false => UnbendRemark::MovesAgainstWeight,
            });
        }
        let high = self.young.and_then(|young| young.high);
        if high.is_some_and(|high| high < self.critical_young.low) {
            self.remarks.push(UnbendRemark::BelowBound);
        }
        let confirmed = |check: RestCheck| {
            let near = check.distance.is_some_and(|off| off < CONFIRMED_DISTANCE);
            let index = self.posture.index(check.young);
            near && check.index.is_none_or(|found| found == index)
        };
        if self.rest_check.is_some_and(|check| !confirmed(check)) {
            self.remarks.push(UnbendRemark::NotConfirmed);
        }
    }

    /// How the points became a curve.
    pub fn smoothing(&self) -> Option<SmoothingReport> {
        let smoothed = self.posture.smoothing()?;
        Some(SmoothingReport {
            points: smoothed.at.len(),
            coordinates: if self.posture.is_planar() { 2 } else { 3 },
            sd: smoothed.deviation,
            sd_given: smoothed.is_deviation_given,
            degrees_of_freedom: smoothed.degrees_of_freedom,
        })
    }

    /// The direction in which the leaf would leave its posture first.
    pub fn governing(&self) -> Governing {
        self.posture.critical.governing
    }

    /// The index at a modulus.
    pub fn index(&self, young: f64) -> usize {
        self.posture.index(young)
    }

    /// The modulus from which slow loading leads to the posture, if one was found.
    pub fn reached_from(&self) -> Option<f64> {
        match self.slow_loading {
            Some(SlowLoading::From(young)) => Some(young),
            _ => None,
        }
    }
}

/// Lengths that differ by more than this part are told.
const LENGTH_TOLERANCE: f64 = 0.02;

/// A leaf at rest this near to the posture, in lengths, confirms it: its curvature at rest is linear between 65
/// stations.
const CONFIRMED_DISTANCE: f64 = 1e-3;

impl Serialize for Unbending {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        #[serde(untagged)]
        enum Index<'a> {
            One(usize),
            Several(&'a [PostureIndex]),
        }
        #[derive(Serialize)]
        struct Base {
            position: [f64; 3],
            angle: f64,
            elevation: f64,
            roll: f64,
        }
        #[derive(Serialize)]
        struct Keys<'a> {
            scenario: &'a str,
            outcome: &'static str,
            modulus: ModulusMeaning,
            critical_young: CriticalYoung,
            governing: Governing,
            critical_at: f64,
            critical_stretch: [f64; 2],
            ladder: Vec<f64>,
            #[serde(skip_serializing_if = "Option::is_none")]
            index: Option<Index<'a>>,
            #[serde(skip_serializing_if = "Option::is_none")]
            young: Option<ModulusInterval>,
            reached_from: Option<f64>,
            #[serde(skip_serializing_if = "Option::is_none")]
            not_reached_at: Option<f64>,
            smoothing: Option<SmoothingReport>,
            length: f64,
            base: Base,
            shown_young: f64,
            rest_check: Option<RestCheck>,
            remarks: Vec<String>,
            wall_seconds: f64,
        }
        let index = match self.indices.as_slice() {
            [] => None,
            [only] => Some(Index::One(only.index)),
            several => Some(Index::Several(several)),
        };
        Keys {
            scenario: &self.scenario,
            outcome: match self.critical_young.value {
                0.0 => "no-bound",
                _ => "bound",
            },
            modulus: self.meaning,
            critical_young: self.critical_young,
            governing: self.governing(),
            critical_at: self.posture.critical.at,
            critical_stretch: self.posture.critical.stretch,
            ladder: self.posture.ladder(),
            index,
            young: self.young,
            reached_from: self.reached_from(),
            not_reached_at: match self.slow_loading {
                Some(SlowLoading::NotBelow(young)) => Some(young),
                _ => None,
            },
            smoothing: self.smoothing(),
            length: self.stations.length,
            base: Base {
                position: self.stations.ends[0].position.to_array(),
                angle: self.posture.base.angle,
                elevation: self.posture.base.elevation,
                roll: self.posture.base.roll,
            },
            shown_young: self.shown_young,
            rest_check: self.rest_check,
            remarks: self.remarks.iter().map(ToString::to_string).collect(),
            wall_seconds: self.wall_seconds,
        }
        .serialize(serializer)
    }
}
