//! Supports that move in time: all bases together (`dynamics.base`), grips and the holder of the tip. The leaf at rest
//! is held where they are at time 0.

use crate::scenario::format::Key;
use crate::scenario::format::entries::Entries;
use crate::scenario::format::error::ScenarioResult;
use crate::scenario::schedule::Schedule;
use crate::scenario::supports::BaseSpin;
use glam::DVec3;

/// How all bases move: from where they are at rest, which is where they are at time 0.
#[derive(Clone, Debug, PartialEq)]
pub struct BaseMotion {
    /// Their displacement.
    pub displacement: Schedule<[f64; 3]>,
    /// Rotation vectors of their rotation about their mean, as of [`Schedule::rotation`].
    pub turn: Schedule<[f64; 3]>,
}

/// The supports that move.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SupportMotion {
    /// All bases, if they move.
    pub base: Option<BaseMotion>,
    /// The displacement of each grip from the natural leaf; empty unless one moves.
    pub grips: Vec<Schedule<[f64; 3]>>,
    /// The place of the tip, if its holder moves.
    pub tip: Option<Schedule<[f64; 3]>>,
}

impl SupportMotion {
    /// All quantities in time.
    pub fn schedules(&self) -> impl Iterator<Item = &Schedule<[f64; 3]>> {
        let base = self.base.iter();
        let base = base.flat_map(|base| [&base.displacement, &base.turn]);
        base.chain(&self.grips).chain(&self.tip)
    }
}

/// Largest displacement and turn of bases at time 0, where they are at rest.
const START_TOLERANCE: f64 = 1e-12;

/// Reads how supports move; `None` if none does.
pub(super) fn read_support_motion(entries: &Entries) -> ScenarioResult<Option<Box<SupportMotion>>> {
    let mut motion = SupportMotion::default();
    if let Some(item) = entries.given_value(Key::BaseInTime) {
        let [displacement, turn] = item.base_motion()?;
        let start = [displacement.at(0.0), turn.at(0.0)].map(DVec3::from_array);
        item.refuse_unless(
            start.iter().all(|start| start.length() <= START_TOLERANCE),
            "must begin with no move and no turn at time 0: at rest bases are where leaf.base and leaf.fan say; add \
             mean = -amplitude sin(phase) to a sine with a phase",
        )?;
        item.refuse_unless(
            entries.value_or_default(Key::Clamped)?.switch()?,
            "contradicts dynamics.clamped = false, a base that is free: leave one of them out",
        )?;
        let spin = entries.value_or_default(Key::BaseSpin)?.base_spin()?;
        item.refuse_unless(
            spin == BaseSpin::Free || turn.is_constant(),
            "turns bases whose spin hinges hold (leaf.base_spin = \"held\"), which no motion takes into account: leave \
             turn out, clamp the bases, or let them spin",
        )?;
        motion.base = Some(BaseMotion {
            displacement,
            turn: turn.of_rotations(),
        });
    }
    if let Some(item) = entries.given_value(Key::TipPosition) {
        let position = item.vectors_in_time()?;
        motion.tip = Some(position).filter(|position| !position.is_constant());
    }
    let count = entries.table_count("grip").unwrap_or(0);
    let mut moves: Vec<Schedule<[f64; 3]>> = Vec::new();
    for row in 0..count {
        let own = (entries.value_in_row(Key::GripMove, row)?).vectors_in_time()?;
        let own = match own.is_constant() {
            true => Schedule::constant(own.at(0.0)),
            false => own,
        };
        // A list of veins is a grip on each.
        let veins = entries.value_in_row(Key::GripVein, row)?.value.as_array();
        moves.extend(vec![own; veins.map_or(1, Vec::len)]);
    }
    if !moves.iter().all(Schedule::is_constant) {
        motion.grips = moves;
    }
    Ok((motion != SupportMotion::default()).then(|| Box::new(motion)))
}
