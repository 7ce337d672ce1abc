//! The files of a simulation, which grow while it runs.
//!
//! Every output is written at once to `motion.csv` (`motion.npy` for long motions), which has the leaf, and to
//! `energy.csv`, which has energies and the tip, under temporary names, so that memory does not grow. At the
//! end of the run the files get their final names, and figures and a summary are made from them.

use crate::files::atomic;
use crate::files::atomic::DraftFile;
use crate::files::result_files::{FileKind, FileSelection, write_result_files};
use crate::report::table::{append_csv_rows, table_header};
use crate::report::{FileError, ResultDocument};
use glam::DVec3;
use leafdyn::scenario;
use leafdyn::shape::equally_spaced;
use leafdyn::simulate::{
    Frame, OutputSample, Record, ShapeSnapshot, Simulation, Stopped, film_indices, snapshot_indices,
};
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::{fs, io, mem};

/// Shapes that a film strip shows.
const FILM_STRIP_SHAPES: usize = 8;

/// The files of a running simulation.
///
/// ```
/// use leafdyn_program::files::{FileSelection, MotionRecording, ResultDocument};
/// use leafdyn::scenario::Scenario;
/// use leafdyn::simulate::{Options, Simulation};
///
/// let cantilever = r#"
///     name = "cantilever"
///     leaf = { rods = 1, length = 1.0, fan = [0.0] }
///     stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = 100.0, shear_2 = 100.0, shear_3 = 100.0 }
///     load = { gravity = [0.0, 0.0, -1.0] }
/// "#;
/// # let folder = tempfile::tempdir()?;
/// # let folder = folder.path();
/// let scenario = Scenario::from_toml(cantilever)?;
/// let mut simulation = Simulation::new(&scenario, &Options::default())?;
/// let mut recording = MotionRecording::begin(folder, &mut simulation, &FileSelection::default())?;
/// while !simulation.done() {
///     let frame = simulation.next_frame()?;
///     recording.add_output(&simulation, &frame)?;
/// }
/// let record = recording.finished_record(&simulation, None)?;
/// let files = recording.finish(&ResultDocument::new(&record, &scenario, None))?;
/// assert_eq!(files.len(), 7);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct MotionRecording {
    folder: PathBuf,
    format: MotionFormat,
    size: MotionSize,
    stations: Vec<f64>,
    joined: bool,
    /// `motion` and `energy`, if they are selected or needed for figures.
    growing: Option<[GrowingFile; 2]>,
    selection: FileSelection,
    /// Positions at the last output, if there are no growing files.
    last_positions: Vec<DVec3>,
    moments: Vec<OutputSample>,
}

impl MotionRecording {
    /// Begins the files of a simulation in `folder`, which is created if missing, with the
    /// current state of the leaf. Without tables and figures nothing is written during
    /// the run.
    pub fn begin(
        folder: &Path,
        simulation: &mut Simulation,
        selection: &FileSelection,
    ) -> Result<Self, FileError> {
        let frame = simulation.frame();
        MotionRecording::begin_with_frame(folder, simulation, selection, &frame)
    }

    /// Begins a recording whose first output is this frame.
    pub fn begin_with_frame(
        folder: &Path,
        simulation: &Simulation,
        selection: &FileSelection,
        first: &Frame,
    ) -> Result<Self, FileError> {
        let mut recording = MotionRecording::new(folder, simulation, selection);
        if selection.kinds.iter().any(|kind| *kind != FileKind::Json) {
            atomic::make_folder(folder)?;
            let format = recording.format;
            let start = format.file_header(recording.size, output_count(simulation));
            let motion = GrowingFile::begin(folder.join(format.file_name()), &start)?;
            let start = table_header(ENERGY_COLUMNS);
            let energy = GrowingFile::begin(folder.join(ENERGY_FILE_NAME), &start)?;
            recording.growing = Some([motion, energy]);
        }
        recording.add_output(simulation, first)?;
        Ok(recording)
    }

    fn new(folder: &Path, simulation: &Simulation, selection: &FileSelection) -> Self {
        let stations = match selection.stations {
            Some(count) => equally_spaced(count),
            None => simulation.stations().to_vec(),
        };
        let size = MotionSize {
            rods: simulation.leaf().rods(),
            nodes: stations.len(),
        };
        MotionRecording {
            folder: folder.into(),
            format: MotionFormat::for_outputs(size, output_count(simulation)),
            size,
            stations,
            joined: simulation.leaf().joined(),
            growing: None,
            selection: selection.clone(),
            last_positions: Vec::new(),
            moments: Vec::new(),
        }
    }

    /// Approximate number of bytes that the growing files still need; zero without these.
    pub fn expected_bytes(&self, simulation: &Simulation) -> u64 {
        let (all, made) = simulation.frames();
        let output = self.format.bytes_per_output(self.size) + ENERGY_BYTES;
        match &self.growing {
            Some(_) => (all.saturating_sub(made) as u64).saturating_mul(output),
            None => 0,
        }
    }

    /// Adds an output: the current state of `simulation`.
    pub fn add_output(&mut self, simulation: &Simulation, frame: &Frame) -> Result<(), FileError> {
        self.moments
            .push(OutputSample::from_frame(frame, self.joined));
        let Some([motion, energy]) = &mut self.growing else {
            self.last_positions = frame.positions.clone();
            return Ok(());
        };
        let (format, stations) = (self.format, &self.stations);
        let frame = match self.selection.stations {
            Some(_) => &frame.interpolated_to_stations(simulation.stations(), stations),
            None => frame,
        };
        motion.append(|out| format.write_output(frame, stations, out))?;
        if let Some(moment) = self.moments.last() {
            energy.append(|out| write_energies(moment, out))?;
        }
        Ok(())
    }

    /// The record of a simulation that has ended; nothing can be added after that.
    ///
    /// # Errors
    /// If the files written so far cannot be read.
    pub fn finished_record(
        &mut self,
        simulation: &Simulation,
        stopped: Option<Stopped>,
    ) -> Result<Record, FileError> {
        let longest = scenario::longest(&simulation.leaf().scenario().rods);
        let stills = match &self.growing {
            Some(files) => self.read_stills(
                files,
                &snapshot_indices(&self.moments, FILM_STRIP_SHAPES, longest),
            )?,
            None => {
                let last = self.moments.len().saturating_sub(1);
                let nodes = self.last_positions.len() / self.size.rods;
                let size = MotionSize { nodes, ..self.size };
                split_into_shapes(&[last], &mem::take(&mut self.last_positions), size)
            }
        };
        let moments = mem::take(&mut self.moments);
        let mut record = Record::new(simulation, stopped, moments, stills);
        if self.growing.is_some() {
            record.stations.clone_from(&self.stations);
        }
        record.film = self.film_shapes(record.moments.len())?;
        Ok(record)
    }

    /// The shapes of a film of this number of outputs, if one is selected.
    fn film_shapes(&self, outputs: usize) -> Result<Vec<ShapeSnapshot>, FileError> {
        let selected = |kind: &FileKind| FileKind::FILM_KINDS.contains(kind);
        match &self.growing {
            Some(files) if self.selection.kinds.iter().any(selected) => {
                self.read_stills(files, &film_indices(outputs, self.size.rows()))
            }
            _ => Ok(Vec::new()),
        }
    }

    /// Reads the shapes at these outputs.
    fn read_stills(
        &self,
        [motion, _]: &[GrowingFile; 2],
        outputs: &[usize],
    ) -> Result<Vec<ShapeSnapshot>, FileError> {
        let (format, size) = (self.format, self.size);
        let positions = motion.read(|file| format.read_positions(size, outputs, file))?;
        Ok(split_into_shapes(outputs, &positions, size))
    }

    /// Writes the remaining files, gives all files their final names, and removes the motion
    /// of another run in the other format. Returns the files.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn finish(&mut self, record: &ResultDocument<Record>) -> Result<Vec<PathBuf>, FileError> {
        let kinds = &self.selection.kinds;
        let mut files = write_result_files(&self.folder, record, kinds)?;
        let Some([motion, energy]) = &mut self.growing else {
            return Ok(files);
        };
        if kinds.contains(&FileKind::Csv) {
            let outputs = record.result.moments.len();
            motion.replace_start(&self.format.file_header(self.size, outputs))?;
            files.push(motion.finish()?);
            files.push(energy.finish()?);
            let other = match self.format {
                MotionFormat::Csv => MotionFormat::Npy,
                MotionFormat::Npy => MotionFormat::Csv,
            };
            // It may not exist.
            let _ = fs::remove_file(self.folder.join(other.file_name()));
        }
        Ok(files)
    }
}

/// Splits the positions of all nodes at these outputs into shapes.
fn split_into_shapes(
    outputs: &[usize],
    positions: &[DVec3],
    size: MotionSize,
) -> Vec<ShapeSnapshot> {
    let shapes = outputs.iter().zip(positions.chunks(size.rows()));
    let still = |(&moment, shape): (&usize, &[DVec3])| ShapeSnapshot {
        moment,
        curves: shape.chunks(size.nodes).map(<[DVec3]>::to_vec).collect(),
    };
    shapes.map(still).collect()
}

/// The number of outputs of a simulation, including the first and the last.
fn output_count(simulation: &Simulation) -> usize {
    simulation.frames().0 + 1
}

/// Most rows of a CSV file, some 60 MB.
const MOST_CSV_ROWS: usize = 200_000;

/// Columns of the CSV file. Velocities and angular velocities are along the lab
/// axes.
const MOTION_COLUMNS: &str = "time,rod,sigma,x,y,z,qw,qx,qy,qz,vx,vy,vz,wx,wy,wz";

/// Numbers per node of a NumPy array: the columns from `x` on.
const NUMBERS_PER_NODE: usize = 13;

/// Approximate bytes per number in a table.
const BYTES_PER_NUMBER: usize = 20;

/// Bytes of the header of the array.
const NPY_HEADER_BYTES: usize = 128;

/// The file format of a motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum MotionFormat {
    Csv,
    Npy,
}

/// Size of a motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct MotionSize {
    pub rods: usize,
    pub nodes: usize,
}

impl MotionSize {
    pub fn rows(self) -> usize {
        self.rods * self.nodes
    }
}

impl MotionFormat {
    /// The format for this number of outputs.
    fn for_outputs(size: MotionSize, outputs: usize) -> Self {
        match size.rows().saturating_mul(outputs) {
            0..=MOST_CSV_ROWS => MotionFormat::Csv,
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
    fn bytes_per_output(self, size: MotionSize) -> u64 {
        let row = match self {
            MotionFormat::Csv => MOTION_COLUMNS.split(',').count() * BYTES_PER_NUMBER,
            MotionFormat::Npy => NUMBERS_PER_NODE * size_of::<f64>(),
        };
        (size.rows() as u64).saturating_mul(row as u64)
    }

    /// The header of a file with this number of outputs.
    fn file_header(self, size: MotionSize, outputs: usize) -> Vec<u8> {
        match self {
            MotionFormat::Csv => table_header(MOTION_COLUMNS),
            MotionFormat::Npy => npy_header(size, outputs),
        }
    }

    fn write_output(self, frame: &Frame, stations: &[f64], out: &mut Vec<u8>) -> io::Result<()> {
        let nodes = 0..frame.positions.len();
        match self {
            MotionFormat::Csv => {
                let rows = nodes.map(|node| {
                    let (rod, station) = (node / stations.len(), node % stations.len());
                    (
                        frame.time,
                        rod + 1,
                        stations[station],
                        node_numbers(frame, node),
                    )
                });
                append_csv_rows(rows, out)
            }
            MotionFormat::Npy => {
                let numbers = nodes.flat_map(|node| node_numbers(frame, node));
                out.extend(numbers.flat_map(f64::to_le_bytes));
                Ok(())
            }
        }
    }

    /// Reads the positions of all nodes at some outputs, given in increasing order.
    fn read_positions(
        self,
        size: MotionSize,
        outputs: &[usize],
        file: BufReader<impl Read + Seek>,
    ) -> io::Result<Vec<DVec3>> {
        let positions = match self {
            MotionFormat::Csv => read_csv_positions(size, outputs, file)?,
            MotionFormat::Npy => read_npy_positions(size, outputs, file)?,
        };
        match positions.len() == outputs.len() * size.rows() {
            true => Ok(positions),
            false => Err(io::ErrorKind::UnexpectedEof.into()),
        }
    }
}

/// Position, rotation as a quaternion, linear and angular velocity of a node.
fn node_numbers(frame: &Frame, node: usize) -> [f64; NUMBERS_PER_NODE] {
    let (r, q) = (frame.positions[node], frame.rotations[node]);
    let velocity = &frame.velocities[node];
    let (v, w) = (velocity.linear, velocity.angular);
    [
        r.x, r.y, r.z, q.w, q.x, q.y, q.z, v.x, v.y, v.z, w.x, w.y, w.z,
    ]
    // Adding zero turns -0 into 0.
    .map(|value| value + 0.0)
}

fn read_csv_positions(
    size: MotionSize,
    outputs: &[usize],
    file: impl Read,
) -> io::Result<Vec<DVec3>> {
    let mut points = Vec::with_capacity(outputs.len() * size.rows());
    let rows = csv::Reader::from_reader(file).into_byte_records();
    for (number, row) in rows.enumerate() {
        let row = row?;
        if outputs.binary_search(&(number / size.rows())).is_ok() {
            let row: (f64, usize, f64, [f64; NUMBERS_PER_NODE]) = row.deserialize(None)?;
            points.push(DVec3::from_slice(&row.3));
        }
    }
    Ok(points)
}

/// Format 1.0: magic bytes, version, length of the rest, and a Python dictionary.
fn npy_header(size: MotionSize, outputs: usize) -> Vec<u8> {
    let MotionSize { rods, nodes } = size;
    let shape = format!("({outputs}, {rods}, {nodes}, {NUMBERS_PER_NODE})");
    let text = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}");
    let mut header = b"\x93NUMPY\x01\x00".to_vec();
    let rest = NPY_HEADER_BYTES - header.len() - 2;
    header.extend((rest as u16).to_le_bytes());
    header.extend(text.bytes());
    header.resize(NPY_HEADER_BYTES - 1, b' ');
    header.push(b'\n');
    header
}

fn read_npy_positions(
    size: MotionSize,
    outputs: &[usize],
    mut file: impl Read + Seek,
) -> io::Result<Vec<DVec3>> {
    let mut points = Vec::with_capacity(outputs.len() * size.rows());
    let mut nodes = vec![[[0; 8]; NUMBERS_PER_NODE]; size.rows()];
    for output in outputs {
        let bytes = nodes.as_flattened_mut().as_flattened_mut();
        let start = NPY_HEADER_BYTES + output * bytes.len();
        file.seek(SeekFrom::Start(start as u64))?;
        file.read_exact(bytes)?;
        let numbers = |node: &[[u8; 8]; NUMBERS_PER_NODE]| {
            DVec3::from_array([0, 1, 2].map(|axis| f64::from_le_bytes(node[axis])))
        };
        points.extend(nodes.iter().map(numbers));
    }
    Ok(points)
}

const ENERGY_FILE_NAME: &str = "energy.csv";

/// Approximate bytes of a row of the table of energies.
const ENERGY_BYTES: u64 = 200;

const ENERGY_COLUMNS: &str =
    "time,steps,kinetic,elastic,coupling,potential,dissipated,work,tip_x,tip_y,tip_z,error";

fn write_energies(moment: &OutputSample, out: &mut Vec<u8>) -> io::Result<()> {
    let tip = moment.tip.to_array();
    let OutputSample {
        time,
        steps,
        energy,
        error,
        ..
    } = *moment;
    append_csv_rows([(time, steps, energy, tip, error)], out)
}

struct GrowingFile {
    /// The path that the file has once it is complete.
    file: PathBuf,
    draft: DraftFile,
    out: File,
    /// Rows that are not yet written.
    buffer: Vec<u8>,
}

impl GrowingFile {
    /// Begins a file with these bytes.
    pub fn begin(file: PathBuf, start: &[u8]) -> Result<Self, FileError> {
        let begun =
            DraftFile::begin(&file).map_err(|reason| FileError::cannot_write(&file, reason));
        let (draft, out) = begun?;
        let mut begun = GrowingFile {
            file,
            draft,
            out,
            buffer: Vec::new(),
        };
        begun.append(|out| out.write_all(start))?;
        Ok(begun)
    }

    /// Appends to the file what `fill` adds to a buffer.
    pub fn append(
        &mut self,
        fill: impl FnOnce(&mut Vec<u8>) -> io::Result<()>,
    ) -> Result<(), FileError> {
        self.buffer.clear();
        let filled = fill(&mut self.buffer).and_then(|()| self.out.write_all(&self.buffer));
        filled.map_err(|reason| self.write_error(reason))
    }

    /// Replaces the beginning of the file; nothing can be appended after that.
    fn replace_start(&mut self, bytes: &[u8]) -> Result<(), FileError> {
        let replaced = self.out.rewind().and_then(|()| self.out.write_all(bytes));
        replaced.map_err(|reason| self.write_error(reason))
    }

    /// Reads the data written so far.
    pub fn read<T>(
        &self,
        read: impl FnOnce(BufReader<File>) -> io::Result<T>,
    ) -> Result<T, FileError> {
        let opened = File::open(self.draft.path()).map(BufReader::new);
        opened
            .and_then(read)
            .map_err(|reason| self.write_error(reason))
    }

    /// Gives the file its final name, and returns its path.
    pub fn finish(&mut self) -> Result<PathBuf, FileError> {
        let finished = atomic::finish_draft(self.draft.path(), &self.file);
        finished.map_err(|reason| self.write_error(reason))?;
        Ok(self.file.clone())
    }

    fn write_error(&self, reason: io::Error) -> FileError {
        FileError::cannot_write(&self.file, reason)
    }
}

#[cfg(test)]
mod tests {
    use crate::report::sample;
    use std::io::Cursor;

    use super::*;

    fn written(format: MotionFormat, frames: &[Frame]) -> (MotionSize, Vec<u8>) {
        let size = MotionSize { rods: 3, nodes: 5 };
        let mut bytes = format.file_header(size, frames.len());
        let stations = [0.0, 0.25, 0.5, 0.75, 1.0];
        for frame in frames {
            format.write_output(frame, &stations, &mut bytes).unwrap();
        }
        (size, bytes)
    }

    #[test]
    fn positions_are_read_back_to_the_last_digit() {
        let (_, frames) = sample::sample_motion(3, 4);
        for format in [MotionFormat::Csv, MotionFormat::Npy] {
            let (size, bytes) = written(format, &frames[..6]);
            let file = BufReader::new(Cursor::new(bytes));
            let read = format.read_positions(size, &[0, 2, 3, 5], file).unwrap();
            for (positions, output) in read.chunks(15).zip([0, 2, 3, 5]) {
                assert_eq!(*positions, frames[output].positions, "{format:?} {output}");
            }
        }
    }

    #[test]
    fn a_short_file_is_an_error() {
        for format in [MotionFormat::Csv, MotionFormat::Npy] {
            let (size, mut bytes) = written(format, &sample::sample_motion(3, 4).1[..1]);
            bytes.truncate(bytes.len() - 200);
            let file = BufReader::new(Cursor::new(bytes));
            assert!(format.read_positions(size, &[0], file).is_err());
        }
    }

    #[test]
    fn headers_of_arrays_are_equally_long() {
        for (rods, nodes, outputs) in [(1, 2, 1), (100_000, 4_000_001, 1_000_001)] {
            let header = npy_header(MotionSize { rods, nodes }, outputs);
            assert_eq!(header.len(), 128);
            assert!(header.starts_with(b"\x93NUMPY\x01\x00\x76\x00{"));
            assert!(header.ends_with(b" \n"));
        }
    }

    #[test]
    fn long_tables_are_arrays() {
        let size = MotionSize { rods: 5, nodes: 17 };
        assert_eq!(MotionFormat::for_outputs(size, 2352), MotionFormat::Csv);
        assert_eq!(MotionFormat::for_outputs(size, 2353), MotionFormat::Npy);
        assert_eq!(
            MotionFormat::for_outputs(size, usize::MAX),
            MotionFormat::Npy
        );
    }
}

#[cfg(test)]
mod growing_tests {
    use std::fs;

    use super::*;

    #[test]
    fn an_unfinished_file_that_is_dropped_is_removed() {
        let folder = tempfile::tempdir().unwrap();
        drop(GrowingFile::begin(folder.path().join("a.csv"), b"one").unwrap());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
