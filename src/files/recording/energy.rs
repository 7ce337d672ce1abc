//! `energy.csv`: energies and the tip at all outputs.

use std::io::{self, Read, Write};

use glam::DVec3;

use crate::motion::Energy;
use crate::simulate::Moment;

pub const FILE_NAME: &str = "energy.csv";

const HEADER: [&str; 11] = [
    "time",
    "steps",
    "kinetic",
    "elastic",
    "coupling",
    "potential",
    "dissipated",
    "work",
    "tip_x",
    "tip_y",
    "tip_z",
];

/// A row: time, steps, six energies, and the tip.
type Row = (f64, usize, [f64; 6], [f64; 3]);

pub fn start() -> Vec<u8> {
    (HEADER.join(",") + "\n").into_bytes()
}

/// Appends a row.
pub fn write(moment: &Moment, out: &mut dyn Write) -> io::Result<()> {
    let mut table = csv::WriterBuilder::new()
        .has_headers(false)
        .from_writer(out);
    let e = &moment.energy;
    let row: Row = (
        moment.time,
        moment.steps,
        [
            e.kinetic,
            e.elastic,
            e.coupling,
            e.potential,
            e.dissipated,
            e.work,
        ],
        moment.tip.to_array(),
    );
    table.serialize(row)?;
    table.flush()
}

/// All rows, the same as when they were written.
pub fn read(file: impl Read) -> io::Result<Vec<Moment>> {
    let mut table = csv::Reader::from_reader(file);
    let rows = table.deserialize().map(|row| {
        let (time, steps, energy, tip): Row = row?;
        let [kinetic, elastic, coupling, potential, dissipated, work] = energy;
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
        })
    });
    rows.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;

    #[test]
    fn moments_are_read_back_to_the_last_digit() {
        let mut moments: Vec<Moment> = (0..9).map(|i| sample::moment(0.1 * i as f64)).collect();
        moments[3].energy.potential = f64::MIN_POSITIVE / 3.0;
        moments[4].energy.potential = -1e300 / 3.0;
        moments[5].energy.work = f64::INFINITY;
        moments[6].tip.y = 0.1 + 0.2;
        let mut bytes = start();
        for moment in &moments {
            write(moment, &mut bytes).unwrap();
        }
        assert_eq!(read(&bytes[..]).unwrap(), moments);
        let text = String::from_utf8(bytes).unwrap();
        let header =
            "time,steps,kinetic,elastic,coupling,potential,dissipated,work,tip_x,tip_y,tip_z";
        assert_eq!(text.lines().next(), Some(header));
    }

    #[test]
    fn nonsense_is_an_error() {
        for row in ["1,2,3", "a,1,2,3,4,5,6,7,8,9,10"] {
            let text = String::from_utf8(start()).unwrap() + row + "\n";
            assert!(read(text.as_bytes()).is_err(), "{row}");
        }
    }
}
