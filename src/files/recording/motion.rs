//! The leaf at all outputs: `motion.csv`, or where that would be long
//! `motion.npy`.

use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom, Write};

use glam::DVec3;

use crate::simulate::Frame;

/// Most rows of a CSV file, some 60 MB.
const MOST_ROWS: usize = 200_000;

/// Columns of the CSV file. Velocities and angular velocities are along the
/// lab axes.
const HEADER: [&str; 16] = [
    "time", "rod", "sigma", "x", "y", "z", "qw", "qx", "qy", "qz", "vx", "vy", "vz", "wx", "wy",
    "wz",
];

/// Numbers per node: the columns from `x` on.
const NUMBERS: usize = 13;

/// Bytes before the numbers of a NumPy array.
const NPY_HEADER: usize = 128;

/// How the leaf is written down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    Table,
    Array,
}

/// Size of a motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    pub rods: usize,
    /// Of each rod.
    pub nodes: usize,
}

impl Size {
    fn rows(self) -> usize {
        self.rods * self.nodes
    }
}

impl Form {
    /// The form in which so many outputs are written.
    pub fn of(size: Size, outputs: usize) -> Self {
        match size.rows().saturating_mul(outputs) {
            0..=MOST_ROWS => Form::Table,
            _ => Form::Array,
        }
    }

    pub fn file_name(self) -> &'static str {
        match self {
            Form::Table => "motion.csv",
            Form::Array => "motion.npy",
        }
    }

    pub fn other(self) -> Self {
        match self {
            Form::Table => Form::Array,
            Form::Array => Form::Table,
        }
    }

    /// What stands before the first of so many outputs.
    pub fn start(self, size: Size, outputs: usize) -> Vec<u8> {
        match self {
            Form::Table => (HEADER.join(",") + "\n").into_bytes(),
            Form::Array => npy_header(size, outputs),
        }
    }

    /// Appends an output.
    pub fn write(self, frame: &Frame, stations: &[f64], out: &mut dyn Write) -> io::Result<()> {
        match self {
            Form::Table => write_rows(frame, stations, out),
            Form::Array => write_numbers(frame, out),
        }
    }

    /// The positions of all nodes at some of the outputs, in rising order.
    pub fn positions(
        self,
        size: Size,
        outputs: &[usize],
        file: BufReader<impl Read + Seek>,
    ) -> io::Result<Vec<Vec<DVec3>>> {
        match self {
            Form::Table => read_rows(size, outputs, file),
            Form::Array => read_numbers(size, outputs, file),
        }
    }
}

/// All numbers of a node.
fn numbers(frame: &Frame, node: usize) -> [f64; NUMBERS] {
    let (r, q) = (frame.positions[node], frame.rotations[node]);
    let (v, w) = (
        frame.velocities[node].linear,
        frame.velocities[node].angular,
    );
    [
        r.x, r.y, r.z, q.w, q.x, q.y, q.z, v.x, v.y, v.z, w.x, w.y, w.z,
    ]
    // Adding zero turns -0 into 0.
    .map(|value| value + 0.0)
}

fn write_rows(frame: &Frame, stations: &[f64], out: &mut dyn Write) -> io::Result<()> {
    let mut table = csv::WriterBuilder::new()
        .has_headers(false)
        .from_writer(out);
    for node in 0..frame.positions.len() {
        let (rod, station) = (node / stations.len(), node % stations.len());
        let place = (frame.time, rod + 1, stations[station]);
        table.serialize((place, numbers(frame, node)))?;
    }
    table.flush()
}

fn read_rows(
    size: Size,
    outputs: &[usize],
    mut file: BufReader<impl Read>,
) -> io::Result<Vec<Vec<DVec3>>> {
    // The header is passed with the first output.
    let mut passed = 0;
    let mut line = String::new();
    let mut read = Vec::with_capacity(outputs.len());
    for output in outputs {
        let first = 1 + output * size.rows();
        while passed < first {
            file.skip_until(b'\n')?;
            passed += 1;
        }
        let mut points = Vec::with_capacity(size.rows());
        for _ in 0..size.rows() {
            line.clear();
            file.read_line(&mut line)?;
            passed += 1;
            let mut cells = line.split(',').skip(3).map(str::parse);
            let mut cell = || match cells.next() {
                Some(Ok(number)) => Ok(number),
                _ => Err(io::Error::from(io::ErrorKind::InvalidData)),
            };
            points.push(DVec3::new(cell()?, cell()?, cell()?));
        }
        read.push(points);
    }
    Ok(read)
}

/// Format 1.0: magic, version, length of the rest, and the rest in Python.
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

fn write_numbers(frame: &Frame, out: &mut dyn Write) -> io::Result<()> {
    for node in 0..frame.positions.len() {
        for number in numbers(frame, node) {
            out.write_all(&number.to_le_bytes())?;
        }
    }
    Ok(())
}

fn read_numbers(
    size: Size,
    outputs: &[usize],
    mut file: BufReader<impl Read + Seek>,
) -> io::Result<Vec<Vec<DVec3>>> {
    const NODE: usize = 8 * NUMBERS;
    let mut read = Vec::with_capacity(outputs.len());
    for output in outputs {
        let start = NPY_HEADER as u64 + (output * size.rows()) as u64 * NODE as u64;
        file.seek(SeekFrom::Start(start))?;
        let mut points = Vec::with_capacity(size.rows());
        let mut node = [0; NODE];
        for _ in 0..size.rows() {
            file.read_exact(&mut node)?;
            let [x, y, z] = [0, 8, 16].map(|at| {
                let mut bytes = [0; 8];
                bytes.copy_from_slice(&node[at..at + 8]);
                f64::from_le_bytes(bytes)
            });
            points.push(DVec3::new(x, y, z));
        }
        read.push(points);
    }
    Ok(read)
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;
    use crate::report::sample;

    fn written(form: Form, frames: &[Frame]) -> (Size, Vec<u8>) {
        let size = Size { rods: 3, nodes: 5 };
        let mut bytes = form.start(size, frames.len());
        let stations = [0.0, 0.25, 0.5, 0.75, 1.0];
        for frame in frames {
            form.write(frame, &stations, &mut bytes).unwrap();
        }
        (size, bytes)
    }

    #[test]
    fn positions_are_read_back_to_the_last_digit() {
        let frames: Vec<Frame> = (0..6)
            .map(|i| sample::frame(3, 4, 0.1 * i as f64))
            .collect();
        for form in [Form::Table, Form::Array] {
            let (size, bytes) = written(form, &frames);
            let file = BufReader::new(Cursor::new(bytes));
            let read = form.positions(size, &[0, 2, 3, 5], file).unwrap();
            for (positions, output) in read.iter().zip([0, 2, 3, 5]) {
                assert_eq!(*positions, frames[output].positions, "{form:?} {output}");
            }
        }
    }

    #[test]
    fn a_short_file_is_an_error() {
        for form in [Form::Table, Form::Array] {
            let (size, mut bytes) = written(form, &[sample::frame(3, 4, 0.0)]);
            bytes.truncate(bytes.len() - 200);
            let file = BufReader::new(Cursor::new(bytes));
            assert!(form.positions(size, &[0], file).is_err());
        }
    }

    #[test]
    fn header_and_rows() {
        let (_, bytes) = written(Form::Table, &[sample::frame(3, 4, 0.5)]);
        let text = String::from_utf8(bytes).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(
            lines[0],
            "time,rod,sigma,x,y,z,qw,qx,qy,qz,vx,vy,vz,wx,wy,wz"
        );
        assert_eq!(lines.len(), 1 + 3 * 5);
        assert!(lines[1].starts_with("0.5,1,0.0,"), "{}", lines[1]);
        assert!(lines[15].starts_with("0.5,3,1.0,"), "{}", lines[15]);
        assert_eq!(lines[15].split(',').count(), HEADER.len());
    }

    #[test]
    fn headers_of_arrays_are_equally_long() {
        let large = Size {
            rods: 100_000,
            nodes: 4_000_001,
        };
        for header in [
            npy_header(Size { rods: 1, nodes: 2 }, 1),
            npy_header(large, 1_000_001),
        ] {
            assert_eq!(header.len(), 128);
            assert!(header.starts_with(b"\x93NUMPY\x01\x00\x76\x00{"));
            assert!(header.ends_with(b" \n"));
        }
    }

    #[test]
    fn long_tables_are_arrays() {
        let size = Size { rods: 5, nodes: 17 };
        assert_eq!(Form::of(size, 2352), Form::Table);
        assert_eq!(Form::of(size, 2353), Form::Array);
        assert_eq!(Form::of(size, usize::MAX), Form::Array);
    }
}
