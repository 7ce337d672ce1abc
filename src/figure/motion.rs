//! The pictures of a simulation.

use std::io::{self, Write};

use super::drawing::Drawing;
use super::{energy, filmstrip, png, svg};
use crate::report::Format;
use crate::simulate::Record;

/// A picture of a simulation: its energies in time, or the leaf at some
/// instants; as SVG or PNG.
pub struct MotionFigure {
    file: &'static str,
    draw: fn(&Record) -> Drawing,
    write: fn(&Drawing, &mut dyn Write) -> io::Result<()>,
}

impl MotionFigure {
    /// `energy.svg`.
    pub const ENERGY_SVG: Self = MotionFigure {
        file: "energy.svg",
        draw: energy::draw,
        write: svg::write_drawing,
    };
    /// `energy.png`.
    pub const ENERGY_PNG: Self = MotionFigure {
        file: "energy.png",
        draw: energy::draw,
        write: png::write_drawing,
    };
    /// `filmstrip.svg`.
    pub const FILMSTRIP_SVG: Self = MotionFigure {
        file: "filmstrip.svg",
        draw: filmstrip::draw,
        write: svg::write_drawing,
    };
    /// `filmstrip.png`.
    pub const FILMSTRIP_PNG: Self = MotionFigure {
        file: "filmstrip.png",
        draw: filmstrip::draw,
        write: png::write_drawing,
    };
}

impl Format<Record> for MotionFigure {
    fn file_name(&self) -> &'static str {
        self.file
    }

    fn write(&self, record: &Record, out: &mut dyn Write) -> io::Result<()> {
        (self.write)(&(self.draw)(record), out)
    }
}

/// What both pictures say of a simulation.
pub fn notes(record: &Record) -> Vec<String> {
    let mut notes = vec![
        format!("N = {}", record.rods),
        format!("{} method", record.scheme.name()),
        format!("{} segments a vein", record.segments),
    ];
    if record.stopped.is_some() {
        notes.push(format!("ended early: {}", record.outcome()));
    }
    notes
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;
    use crate::report::sample;
    use crate::simulate::Stopped;
    use glam::DVec3;

    const FIGURES: [(MotionFigure, MotionFigure); 2] = [
        (MotionFigure::ENERGY_SVG, MotionFigure::ENERGY_PNG),
        (MotionFigure::FILMSTRIP_SVG, MotionFigure::FILMSTRIP_PNG),
    ];

    fn svg(figure: &MotionFigure, record: &Record) -> String {
        let mut bytes = Vec::new();
        figure.write(record, &mut bytes).unwrap();
        let svg = String::from_utf8(bytes).unwrap();
        assert_eq!(svg.matches("<g ").count(), svg.matches("</g>").count());
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
        svg
    }

    #[test]
    fn pictures_are_wide_enough_to_print() {
        for (_, figure) in FIGURES {
            let mut bytes = Vec::new();
            figure.write(&sample::record(5, 16), &mut bytes).unwrap();
            let reader = ::png::Decoder::new(Cursor::new(&bytes)).read_info();
            assert_eq!(reader.unwrap().info().width, 1800);
        }
    }

    #[test]
    fn an_early_end_is_told() {
        let mut record = sample::record(5, 8);
        record.stopped = Some(Stopped::Diverged {
            otherwise: "--method semi-implicit",
            time: 10.1,
            percent: 70.0,
        });
        for (figure, _) in FIGURES {
            assert!(svg(&figure, &record).contains("ended early: diverged"));
        }
    }

    #[test]
    fn numbers_gone_wild_are_drawn_without_a_panic() {
        for wild in [f64::NAN, f64::INFINITY, 1e308, -1e300, 1e-310, 0.0] {
            let mut record = sample::record(3, 8);
            record.stills[3].curves[1][4].z = wild;
            record.moments[70].energy.kinetic = wild;
            record.moments[71].tip.x = wild;
            for (figure, _) in FIGURES {
                svg(&figure, &record);
            }
            for moment in &mut record.moments {
                moment.energy.kinetic = wild;
                moment.energy.potential = -wild;
                moment.tip = DVec3::splat(wild);
            }
            for still in &mut record.stills {
                still
                    .curves
                    .iter_mut()
                    .for_each(|c| c.fill(DVec3::splat(wild)));
            }
            for (figure, _) in FIGURES {
                svg(&figure, &record);
            }
        }
    }

    #[test]
    fn one_output_only() {
        let mut record = sample::record(3, 8);
        record.moments.truncate(1);
        record.stills.truncate(1);
        for (figure, _) in FIGURES {
            svg(&figure, &record);
        }
    }

    #[test]
    fn a_long_record_makes_no_large_picture() {
        let mut record = sample::record(3, 8);
        let many = (0..200_000).map(|i| sample::moment(1e-3 * f64::from(i)));
        record.moments = many.collect();
        for (figure, _) in FIGURES {
            let length = svg(&figure, &record).len();
            assert!(length < 1_000_000, "{length}");
        }
    }
}
