//! `energy.csv`: energies and the tip at all outputs.

use std::io;

use crate::report::table::append_csv;
use leafdyn::simulate::Moment;

pub const ENERGY_FILE_NAME: &str = "energy.csv";

/// Approximate bytes of a row.
pub const ENERGY_BYTES: u64 = 200;

pub const ENERGY_COLUMNS: &str =
    "time,steps,kinetic,elastic,coupling,potential,dissipated,work,tip_x,tip_y,tip_z,error";

pub fn write_energies(moment: &Moment, out: &mut Vec<u8>) -> io::Result<()> {
    let tip = moment.tip.to_array();
    let Moment {
        time,
        steps,
        energy,
        error,
        ..
    } = *moment;
    append_csv([(time, steps, energy, tip, error)], out)
}
