//! `energy.csv`: energies and the tip at all outputs.

use std::io::{self, Read};

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::motion::Energy;
use crate::report::table::append_csv;
use crate::simulate::Moment;

pub const FILE_NAME: &str = "energy.csv";

#[derive(Default, Serialize, Deserialize)]
pub struct Row {
    time: f64,
    steps: usize,
    kinetic: f64,
    elastic: f64,
    coupling: f64,
    potential: f64,
    dissipated: f64,
    work: f64,
    tip_x: f64,
    tip_y: f64,
    tip_z: f64,
}

impl From<&Moment> for Row {
    fn from(moment: &Moment) -> Self {
        let Moment {
            time,
            steps,
            energy,
            tip,
        } = moment;
        Row {
            time: *time,
            steps: *steps,
            kinetic: energy.kinetic,
            elastic: energy.elastic,
            coupling: energy.coupling,
            potential: energy.potential,
            dissipated: energy.dissipated,
            work: energy.work,
            tip_x: tip.x,
            tip_y: tip.y,
            tip_z: tip.z,
        }
    }
}

impl From<Row> for Moment {
    fn from(row: Row) -> Self {
        Moment {
            time: row.time,
            steps: row.steps,
            energy: Energy {
                kinetic: row.kinetic,
                elastic: row.elastic,
                coupling: row.coupling,
                potential: row.potential,
                dissipated: row.dissipated,
                work: row.work,
            },
            tip: DVec3::new(row.tip_x, row.tip_y, row.tip_z),
        }
    }
}

/// Appends a row.
pub fn write(moment: &Moment, out: &mut Vec<u8>) -> io::Result<()> {
    append_csv([Row::from(moment)], out)
}

/// Reads all rows, exactly as they were written.
pub fn read(file: impl Read) -> io::Result<Vec<Moment>> {
    let mut table = csv::Reader::from_reader(file);
    let rows = table.deserialize::<Row>();
    rows.map(|row| Ok(row?.into())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{sample, table::header};

    #[test]
    fn moments_are_read_back_to_the_last_digit() {
        let mut moments = sample::record(3, 4).moments;
        moments[3].energy.potential = f64::MIN_POSITIVE / 3.0;
        moments[4].energy.potential = -1e300 / 3.0;
        moments[5].energy.work = f64::INFINITY;
        moments[6].tip.y = 0.1 + 0.2;
        let mut bytes = header(Row::default());
        for moment in &moments {
            write(moment, &mut bytes).unwrap();
        }
        assert_eq!(read(&bytes[..]).unwrap(), moments);
    }
}
