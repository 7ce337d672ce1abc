//! `energy.csv`: energies and the tip at all outputs.

use std::io::{self, Read};

use glam::DVec3;

use crate::report::table::append_csv;
use leafdyn::simulate::Energy;
use leafdyn::simulate::Moment;

pub const FILE_NAME: &str = "energy.csv";

/// Approximate bytes of a row.
pub const BYTES: u64 = 200;

pub const COLUMNS: &str =
    "time,steps,kinetic,elastic,coupling,potential,dissipated,work,tip_x,tip_y,tip_z,error";

/// Cells of a row: the time, the steps, the energies, the tip and the bound on its error.
type Row = (f64, usize, [f64; 6], [f64; 3], Option<f64>);

pub fn write(moment: &Moment, out: &mut Vec<u8>) -> io::Result<()> {
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

/// Reads all rows, exactly as they were written.
pub fn read(file: impl Read) -> io::Result<Vec<Moment>> {
    let rows = csv::Reader::from_reader(file).into_deserialize::<Row>();
    rows.map(|row| {
        let (time, steps, energies, tip, error) = row?;
        let [kinetic, elastic, coupling, potential, dissipated, work] = energies;
        Ok(Moment {
            time,
            steps,
            energy: Energy {
                kinetic,
                elastic,
                coupling,
                potential,
                dissipated,
                work,
            },
            tip: DVec3::from_array(tip),
            error,
        })
    })
    .collect()
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
        moments[7].error = Some(0.1 + 0.2);
        let mut bytes = header(COLUMNS);
        for moment in &moments {
            write(moment, &mut bytes).unwrap();
        }
        assert_eq!(read(&bytes[..]).unwrap(), moments);
    }
}
