//! The path on which a leaf is loaded, and which defines the equilibrium that a relaxation finds.
//!
//! The veins of the natural leaf are in their rest shapes, apart and unloaded. Slowly, so that the
//! leaf is at rest all the time, first the loads are put on in proportion, each vein for itself and
//! bearing an equal part of the force on the joint tip, then the tips are moved together while the
//! coupling of the veins is put on. Tissue is without force between veins in their rest shapes: it
//! belongs to the natural leaf, and ties the veins from the beginning. As long as this
//! path of equilibria is stable it is the only answer, whatever the grid, the tolerance and the
//! method. Where stability is lost the leaf moves on, down its energy (`relax::loading::snap`).
//!
//! A leaf that is held is moved to its holders instead, under its loads (`relax::solve_on_grid::grips`): that is its
//! path.
//!
//! The loads come first because straight veins of unequal chords that are compressed before
//! they are bent buckle at once, to either side; after their loads they are bent already.

use crate::leaf::BucklingMode;
use crate::words;
use serde::Serialize;
use std::fmt;

words! {
    /// Which equilibrium a relaxation finds, where there are several.
    #[derive(Default)]
    pub enum Route {
        /// The equilibrium of a leaf that is loaded slowly: see [`Path`].
        #[default]
        Loading = "loading",
        /// The equilibrium to which a leaf moves that is released under all of its loads, with
        /// its tips together and its veins bent to circular arcs.
        Release = "release",
    }
}

words! {
    /// What is done to the leaf on a part of its path.
    pub enum Stage {
        /// The loads are put on the veins apart.
        Loading = "loading",
        /// The tips are moved together, and the coupling is put on.
        Joining = "joining",
        /// What is held is moved to its place.
        Moving = "moving",
    }
}

/// When loads without a potential are put on a leaf: an equilibrium under all loads may lie beyond a fold of the
/// one path, and be reached on the other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum LoadOrder {
    /// After the loads that have a potential.
    #[default]
    PotentialFirst,
    /// Before them.
    PotentialLast,
}

/// A place on the path of a leaf.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathPosition {
    /// The stage that the leaf is in.
    pub stage: Stage,
    /// The part of the stage, from 0 to 1.
    pub lambda: f64,
}

/// Where the stability of the path was lost.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Event {
    /// The stage in which the stability was lost.
    pub stage: Stage,
    /// The part of the stage, from 0 to 1.
    pub part: f64,
    /// How the stability was lost.
    #[serde(flatten)]
    pub happening: StabilityLoss,
}

/// How the stability of a path was lost.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
pub enum StabilityLoss {
    /// The equilibrium ended at a fold: the leaf moved to another one.
    Snapped,
    /// Nothing was lost, but within a short part of the path the leaf moved far: a nearly perfect one, where a perfect
    /// one would turn to either side.
    #[serde(rename = "bent-sharply")]
    BentSharply,
    /// The equilibrium became unstable: the leaf turned aside.
    Branched {
        /// Whether to turn to the other side was as good: a mirror image.
        equally_open: bool,
        /// What the veins do in the mode along which the leaf turned, if it was seen.
        #[serde(flatten)]
        mode: Option<BucklingMode>,
    },
}

/// How the leaf came to its equilibrium.
#[derive(Clone, Debug, PartialEq)]
pub enum Path {
    /// Loaded slowly; stable all the way if nothing happened.
    Loaded {
        /// Where the path lost its stability.
        events: Vec<Event>,
        /// Whether two grids lead to the same equilibrium.
        confirmed: bool,
    },
    /// Moved to its holders; stably if nothing happened.
    Held {
        /// Where the path lost its stability.
        events: Vec<Event>,
    },
    /// Released under all loads.
    Released,
}

impl Path {
    /// Slow loading on which the leaf stays stable all the way.
    pub const STABLE: Path = Path::Loaded {
        events: Vec::new(),
        confirmed: true,
    };

    /// Where the stability of the path was lost.
    pub fn events(&self) -> &[Event] {
        match self {
            Path::Loaded { events, .. } | Path::Held { events } => events,
            Path::Released => &[],
        }
    }

    /// The word for the path in files.
    pub fn word(&self) -> &'static str {
        let snapped = |event: &Event| event.happening == StabilityLoss::Snapped;
        let bent = |event: &Event| event.happening == StabilityLoss::BentSharply;
        match self.events() {
            _ if *self == Path::Released => "released",
            events if events.iter().all(bent) => "stable-throughout",
            events if events.iter().any(snapped) => "snapped",
            _ => "branched",
        }
    }
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let percent = 100.0 * self.part;
        let what = match self.happening {
            StabilityLoss::Snapped => "snapped",
            StabilityLoss::BentSharply => {
                "bent sharply, where a perfect leaf would turn to either side,"
            }
            StabilityLoss::Branched {
                equally_open: true, ..
            } => "turned to one of two equal sides",
            StabilityLoss::Branched { .. } => "turned aside",
        };
        write!(f, "{what} at {percent:.0} % of {}", self.stage)?;
        match self.happening {
            StabilityLoss::Branched {
                mode: Some(mode), ..
            } => write!(f, " (it {mode})"),
            _ => Ok(()),
        }
    }
}

/// As the keys `path` and, if anything happened, `path_events`.
impl Serialize for Path {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Keys<'a> {
            path: &'static str,
            #[serde(skip_serializing_if = "<[Event]>::is_empty")]
            path_events: &'a [Event],
        }
        let (path, path_events) = (self.word(), self.events());
        Keys { path, path_events }.serialize(serializer)
    }
}
