//! The leaf at all outputs: `motion.csv`, or `motion.npy` for long motions.

use std::io::{self, BufReader, Read, Seek, SeekFrom};

use glam::DVec3;

use crate::report::table::{append_csv, header};
use leafdyn::simulate::Frame;

/// Most rows of a CSV file, some 60 MB.
const MOST_ROWS: usize = 200_000;

/// Columns of the CSV file. Velocities and angular velocities are along the lab
/// axes.
const COLUMNS: &str = "time,rod,sigma,x,y,z,qw,qx,qy,qz,vx,vy,vz,wx,wy,wz";

/// Numbers per node of a NumPy array: the columns from `x` on.
const NUMBERS: usize = 13;

/// Approximate bytes per number in a table.
const DIGITS: usize = 20;

/// Bytes of the header of the array.
const NPY_HEADER: usize = 128;

/// The file format of a motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotionFormat {
    Csv,
    Npy,
}

/// Size of a motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    pub rods: usize,
    /// Nodes of each rod.
    pub nodes: usize,
}

impl Size {
    /// Nodes of all rods.
    pub fn rows(self) -> usize {
        self.rods * self.nodes
    }
}

impl MotionFormat {
    /// The format for this number of outputs.
    pub fn of(size: Size, outputs: usize) -> Self {
        match size.rows().saturating_mul(outputs) {
            0..=MOST_ROWS => MotionFormat::Csv,
            _ => MotionFormat::Npy,
        }
    }

    pub fn file_name(self) -> &'static str {
        match self {
            MotionFormat::Csv => "motion.csv",
            MotionFormat::Npy => "motion.npy",
        }
    }

    /// Bytes of an output, in a table approximately.
    pub fn bytes(self, size: Size) -> u64 {
        let row = match self {
            MotionFormat::Csv => COLUMNS.split(',').count() * DIGITS,
            MotionFormat::Npy => NUMBERS * size_of::<f64>(),
        };
        (size.rows() as u64).saturating_mul(row as u64)
    }

    /// The header of a file with this number of outputs.
    pub fn start(self, size: Size, outputs: usize) -> Vec<u8> {
        match self {
            MotionFormat::Csv => header(COLUMNS),
            MotionFormat::Npy => npy_header(size, outputs),
        }
    }

    pub fn write(self, frame: &Frame, stations: &[f64], out: &mut Vec<u8>) -> io::Result<()> {
        let nodes = 0..frame.positions.len();
        match self {
            MotionFormat::Csv => {
                let rows = nodes.map(|node| {
                    let (rod, station) = (node / stations.len(), node % stations.len());
                    (frame.time, rod + 1, stations[station], numbers(frame, node))
                });
                append_csv(rows, out)
            }
            MotionFormat::Npy => {
                let numbers = nodes.flat_map(|node| numbers(frame, node));
                out.extend(numbers.flat_map(f64::to_le_bytes));
                Ok(())
            }
        }
    }

    /// Reads the positions of all nodes at some outputs, given in increasing order.
    pub fn positions(
        self,
        size: Size,
        outputs: &[usize],
        file: BufReader<impl Read + Seek>,
    ) -> io::Result<Vec<DVec3>> {
        let positions = match self {
            MotionFormat::Csv => read_rows(size, outputs, file)?,
            MotionFormat::Npy => read_numbers(size, outputs, file)?,
        };
        match positions.len() == outputs.len() * size.rows() {
            true => Ok(positions),
            false => Err(io::ErrorKind::UnexpectedEof.into()),
        }
    }
}

/// All numbers of a node.
fn numbers(frame: &Frame, node: usize) -> [f64; NUMBERS] {
    let (r, q) = (frame.positions[node], frame.rotations[node]);
    let velocity = &frame.velocities[node];
    let (v, w) = (velocity.linear, velocity.angular);
    [
        r.x, r.y, r.z, q.w, q.x, q.y, q.z, v.x, v.y, v.z, w.x, w.y, w.z,
    ]
    // Adding zero turns -0 into 0.
    .map(|value| value + 0.0)
}

fn read_rows(size: Size, outputs: &[usize], file: impl Read) -> io::Result<Vec<DVec3>> {
    let mut points = Vec::with_capacity(outputs.len() * size.rows());
    let rows = csv::Reader::from_reader(file).into_byte_records();
    for (number, row) in rows.enumerate() {
        let row = row?;
        if outputs.binary_search(&(number / size.rows())).is_ok() {
            let row: (f64, usize, f64, [f64; NUMBERS]) = row.deserialize(None)?;
            points.push(DVec3::from_slice(&row.3));
        }
    }
    Ok(points)
}

/// Format 1.0: magic bytes, version, length of the rest, and a Python dictionary.
fn npy_header(size: Size, outputs: usize) -> Vec<u8> {
    let Size { rods, nodes } = size;
    let shape = format!("({outputs}, {rods}, {nodes}, {NUMBERS})");
    let text = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}");
    let mut header = b"\x93NUMPY\x01\x00".to_vec();
    let rest = NPY_HEADER - header.len() - 2;
    header.extend((rest as u16).to_le_bytes());
    header.extend(text.bytes());
    header.resize(NPY_HEADER - 1, b' ');
    header.push(b'\n');
    header
}

fn read_numbers(
    size: Size,
    outputs: &[usize],
    mut file: impl Read + Seek,
) -> io::Result<Vec<DVec3>> {
    let mut points = Vec::with_capacity(outputs.len() * size.rows());
    let mut nodes = vec![[[0; 8]; NUMBERS]; size.rows()];
    for output in outputs {
        let bytes = nodes.as_flattened_mut().as_flattened_mut();
        let start = NPY_HEADER + output * bytes.len();
        file.seek(SeekFrom::Start(start as u64))?;
        file.read_exact(bytes)?;
        let numbers = |node: &[[u8; 8]; NUMBERS]| {
            DVec3::from_array([0, 1, 2].map(|axis| f64::from_le_bytes(node[axis])))
        };
        points.extend(nodes.iter().map(numbers));
    }
    Ok(points)
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;
    use crate::report::sample;

    fn written(format: MotionFormat, frames: &[Frame]) -> (Size, Vec<u8>) {
        let size = Size { rods: 3, nodes: 5 };
        let mut bytes = format.start(size, frames.len());
        let stations = [0.0, 0.25, 0.5, 0.75, 1.0];
        for frame in frames {
            format.write(frame, &stations, &mut bytes).unwrap();
        }
        (size, bytes)
    }

    #[test]
    fn positions_are_read_back_to_the_last_digit() {
        let (_, frames) = sample::swing(3, 4);
        for format in [MotionFormat::Csv, MotionFormat::Npy] {
            let (size, bytes) = written(format, &frames[..6]);
            let file = BufReader::new(Cursor::new(bytes));
            let read = format.positions(size, &[0, 2, 3, 5], file).unwrap();
            for (positions, output) in read.chunks(15).zip([0, 2, 3, 5]) {
                assert_eq!(*positions, frames[output].positions, "{format:?} {output}");
            }
        }
    }

    #[test]
    fn a_short_file_is_an_error() {
        for format in [MotionFormat::Csv, MotionFormat::Npy] {
            let (size, mut bytes) = written(format, &sample::swing(3, 4).1[..1]);
            bytes.truncate(bytes.len() - 200);
            let file = BufReader::new(Cursor::new(bytes));
            assert!(format.positions(size, &[0], file).is_err());
        }
    }

    #[test]
    fn headers_of_arrays_are_equally_long() {
        for (rods, nodes, outputs) in [(1, 2, 1), (100_000, 4_000_001, 1_000_001)] {
            let header = npy_header(Size { rods, nodes }, outputs);
            assert_eq!(header.len(), 128);
            assert!(header.starts_with(b"\x93NUMPY\x01\x00\x76\x00{"));
            assert!(header.ends_with(b" \n"));
        }
    }

    #[test]
    fn long_tables_are_arrays() {
        let size = Size { rods: 5, nodes: 17 };
        assert_eq!(MotionFormat::of(size, 2352), MotionFormat::Csv);
        assert_eq!(MotionFormat::of(size, 2353), MotionFormat::Npy);
        assert_eq!(MotionFormat::of(size, usize::MAX), MotionFormat::Npy);
    }
}
