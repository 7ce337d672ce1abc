//! The table `[dynamics]`: the type and the meaning of every value, and what
//! holds where one is left out.

use super::super::check::{Range, number, truth};
use super::super::error::{Problem, ScenarioError};
use super::super::key::Key;
use super::super::raw::Raw;
use super::super::{Profile, Rod, Schedule, in_time, quantity};
use super::{Dynamics, OUTPUTS, Start, section};
use toml::de::DeValue;

type Result<T> = std::result::Result<T, ScenarioError>;

/// Reads the table, for rods under the loads `[gravity, tip_force, tip_moment]`.
pub(in super::super) fn read(raw: &Raw, rods: &[Rod], loads: [[f64; 3]; 3]) -> Result<Dynamics> {
    let [gravity, tip_force, tip_moment] = loads;
    let preset = match quantity(raw, Key::Density, rods.len())? {
        Some(density) => Dynamics::of_density(rods, density),
        None => Dynamics::default_for(rods),
    }
    .with_loads(gravity, tip_force, tip_moment);
    let value = |key, range| {
        raw.optional(key)
            .map(|item| number(item, range))
            .transpose()
    };
    let duration = value(Key::Duration, Range::Positive)?.unwrap_or(preset.duration);
    let section = rotary_inertia(raw, &preset.density)?;
    Ok(Dynamics {
        polar_excess: if section.is_some() { 1.0 } else { 0.0 },
        rotary_inertia: section.unwrap_or(preset.rotary_inertia),
        external_damping: value(Key::ExternalDamping, Range::NotNegative)?
            .unwrap_or(preset.external_damping),
        internal_damping: value(Key::InternalDamping, Range::NotNegative)?
            .unwrap_or(preset.internal_damping),
        duration,
        output_interval: output_interval(raw, duration)?,
        clamped: clamped(raw, rods.len())?,
        start: start(raw)?,
        gravity: load(raw, Key::GravityInTime)?.unwrap_or(preset.gravity),
        tip_force: load(raw, Key::TipForceInTime)?.unwrap_or(preset.tip_force),
        tip_moment: moment(raw, rods.len())?.unwrap_or(preset.tip_moment),
        rest: match raw.optional(Key::RestInTime) {
            Some(item) => in_time::factors(item)?,
            None => preset.rest,
        },
        density: preset.density,
    })
}

fn quantity(raw: &Raw, key: Key, rods: usize) -> Result<Option<Vec<Profile>>> {
    raw.optional(key)
        .map(|item| quantity::read(item, rods, Range::Positive))
        .transpose()
}

fn rotary_inertia(raw: &Raw, density: &[Profile]) -> Result<Option<Vec<Profile>>> {
    let inertia = quantity(raw, Key::RotaryInertia, density.len())?;
    let Some(item) = raw.optional(Key::SectionRadius) else {
        return Ok(inertia);
    };
    if inertia.is_some() {
        return Err(item.refuse(Problem::TwoSections));
    }
    let radius = quantity::read(item, density.len(), Range::Positive)?;
    let round = density.iter().zip(&radius);
    Ok(Some(
        round
            .map(|(density, radius)| section::inertia(density, radius))
            .collect(),
    ))
}

fn output_interval(raw: &Raw, duration: f64) -> Result<f64> {
    let Some(item) = raw.optional(Key::OutputInterval) else {
        return Ok(duration / OUTPUTS);
    };
    let interval = number(item, Range::Positive)?;
    if interval > duration {
        return Err(item.refuse(Problem::IntervalTooLong { duration }));
    }
    Ok(interval)
}

fn clamped(raw: &Raw, rods: usize) -> Result<bool> {
    let Some(item) = raw.optional(Key::Clamped) else {
        return Ok(true);
    };
    match truth(item)? {
        false if rods > 1 => Err(item.refuse(Problem::FreeBase { rods })),
        clamped => Ok(clamped),
    }
}

fn start(raw: &Raw) -> Result<Start> {
    let Some(item) = raw.optional(Key::Start) else {
        return Ok(Start::Released);
    };
    let free = matches!(raw.optional(Key::Clamped).map(truth), Some(Ok(false)));
    match item.value() {
        DeValue::String(text) if text == "released" => Ok(Start::Released),
        DeValue::String(text) if text == "at-rest" && free => Err(item.refuse(Problem::FreeAtRest)),
        DeValue::String(text) if text == "at-rest" => Ok(Start::AtRest),
        _ => Err(item.refuse(Problem::Start)),
    }
}

fn load(raw: &Raw, key: Key) -> Result<Option<Schedule<[f64; 3]>>> {
    raw.optional(key).map(in_time::vectors).transpose()
}

fn moment(raw: &Raw, rods: usize) -> Result<Option<Schedule<[f64; 3]>>> {
    let moment = load(raw, Key::TipMomentInTime)?;
    match (raw.optional(Key::TipMomentInTime), &moment) {
        (Some(item), Some(moment)) if rods > 1 && moment.value.iter().any(|m| *m != [0.0; 3]) => {
            Err(item.refuse(Problem::MomentOnManyRods { rods }))
        }
        _ => Ok(moment),
    }
}
