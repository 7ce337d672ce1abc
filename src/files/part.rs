//! A file that grows during a run: a draft that can also be kept unfinished,
//! to be continued by another process.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufReader, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use super::atomic;
use super::checksum::Checksum;
use crate::report::OutputError;

/// How much of a file was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Extent {
    pub bytes: u64,
    pub checksum: Checksum,
}

/// A file on the way.
pub struct Part {
    /// The finished file.
    file: PathBuf,
    draft: PathBuf,
    out: BufWriter<File>,
    extent: Extent,
}

/// Where an unfinished file is, and where it is kept.
#[derive(Clone, Debug)]
pub struct Keepable {
    draft: PathBuf,
    kept: PathBuf,
}

impl Keepable {
    /// Gives the unfinished file the name under which it is found again.
    pub fn keep(&self) -> io::Result<()> {
        match self.draft == self.kept {
            true => Ok(()),
            false => atomic::finish(&self.draft, &self.kept),
        }
    }
}

/// Why a kept file cannot be continued.
pub enum Lost {
    /// It cannot be read or written.
    Unreadable(io::Error),
    /// It is not what was kept.
    Changed,
}

impl From<io::Error> for Lost {
    fn from(error: io::Error) -> Self {
        Lost::Unreadable(error)
    }
}

impl Part {
    /// Where an unfinished file is kept: `motion.csv.part`.
    pub fn kept_path(file: &Path) -> PathBuf {
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        file.with_file_name(format!("{name}.part"))
    }

    pub fn begin(file: PathBuf) -> Result<Self, OutputError> {
        let begun = atomic::begin(&file);
        let (draft, created) = begun.map_err(|reason| OutputError::File {
            file: file.clone(),
            reason,
        })?;
        Ok(Part {
            out: BufWriter::new(created),
            extent: Extent {
                bytes: 0,
                checksum: Checksum::new(),
            },
            file,
            draft,
        })
    }

    /// Goes on with a kept file where it had this extent. Nothing is changed
    /// if it is not what was kept.
    pub fn resume(file: PathBuf, extent: Extent) -> Result<Self, Lost> {
        let draft = Part::kept_path(&file);
        let kept = OpenOptions::new().read(true).write(true).open(&draft)?;
        let mut reader = BufReader::new(&kept).take(extent.bytes);
        let mut found = Extent {
            bytes: 0,
            checksum: Checksum::new(),
        };
        let mut buffer = vec![0; 1 << 16];
        loop {
            let read = reader.read(&mut buffer)?;
            if read == 0 {
                break;
            }
            found.bytes += read as u64;
            found.checksum.add(&buffer[..read]);
        }
        if found != extent {
            return Err(Lost::Changed);
        }
        kept.set_len(extent.bytes)?;
        let mut out = BufWriter::new(kept);
        out.seek(SeekFrom::Start(extent.bytes))?;
        Ok(Part {
            file,
            draft,
            out,
            extent,
        })
    }

    pub fn keepable(&self) -> Keepable {
        Keepable {
            draft: self.draft.clone(),
            kept: Part::kept_path(&self.file),
        }
    }

    /// Lets `fill` append to the file; what it wrote is on its way to the disk
    /// afterwards.
    pub fn append(
        &mut self,
        fill: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> Result<Extent, OutputError> {
        let filled = fill(&mut Counting(self)).and_then(|()| self.out.flush());
        filled.map_err(|reason| self.failed(reason))?;
        Ok(self.extent)
    }

    /// Replaces the beginning of the file.
    pub fn replace_start(&mut self, bytes: &[u8]) -> Result<(), OutputError> {
        let replaced = (self.out.rewind())
            .and_then(|()| self.out.write_all(bytes))
            .and_then(|()| self.out.seek(SeekFrom::End(0)))
            .map(|_| ());
        replaced.map_err(|reason| self.failed(reason))
    }

    /// Reads what was written so far.
    pub fn read<T>(
        &self,
        read: impl FnOnce(BufReader<File>) -> io::Result<T>,
    ) -> Result<T, OutputError> {
        let opened = File::open(&self.draft).map(BufReader::new);
        opened.and_then(read).map_err(|reason| self.failed(reason))
    }

    /// Gives the file its name.
    pub fn finish(&mut self) -> Result<PathBuf, OutputError> {
        let finished = self.out.flush().and_then(|()| match self.is_kept() {
            true => fs::rename(&self.draft, &self.file),
            false => atomic::finish(&self.draft, &self.file),
        });
        finished.map_err(|reason| self.failed(reason))?;
        Ok(self.file.clone())
    }

    /// Whether the file is under the name it is kept by.
    fn is_kept(&self) -> bool {
        self.draft == Part::kept_path(&self.file)
    }

    fn failed(&self, reason: io::Error) -> OutputError {
        let file = self.file.clone();
        OutputError::File { file, reason }
    }
}

/// What was begun and neither finished nor kept is not left behind.
impl Drop for Part {
    fn drop(&mut self) {
        if !self.is_kept() {
            atomic::discard(&self.draft);
        }
    }
}

/// Counts what is written.
struct Counting<'a>(&'a mut Part);

impl Write for Counting<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.0.out.write(bytes)?;
        self.0.extent.bytes += written as u64;
        self.0.extent.checksum.add(&bytes[..written]);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.out.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn write(part: &mut Part, text: &str) -> Extent {
        let appended = part.append(|out| out.write_all(text.as_bytes()));
        appended.unwrap()
    }

    #[test]
    fn what_is_kept_goes_on_where_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.csv");
        let mut part = Part::begin(file.clone()).unwrap();
        let extent = write(&mut part, "one two ");
        write(&mut part, "and a half-written thr");
        part.keepable().keep().unwrap();
        drop(part);
        assert!(folder.path().join("a.csv.part").exists());

        let mut part = Part::resume(file.clone(), extent).ok().unwrap();
        write(&mut part, "three");
        part.finish().unwrap();
        assert_eq!(fs::read_to_string(&file).unwrap(), "one two three");
        assert!(!folder.path().join("a.csv.part").exists());
    }

    #[test]
    fn what_was_changed_is_not_continued_and_not_touched() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.csv");
        let mut part = Part::begin(file.clone()).unwrap();
        let extent = write(&mut part, "one two");
        part.keepable().keep().unwrap();
        drop(part);
        for changed in ["one tWo and more", "one"] {
            fs::write(folder.path().join("a.csv.part"), changed).unwrap();
            let resumed = Part::resume(file.clone(), extent);
            assert!(matches!(resumed.err(), Some(Lost::Changed)));
            let left = fs::read_to_string(folder.path().join("a.csv.part"));
            assert_eq!(left.unwrap(), changed);
        }
    }

    #[test]
    fn what_is_dropped_is_gone() {
        let folder = tempfile::tempdir().unwrap();
        let mut part = Part::begin(folder.path().join("a.csv")).unwrap();
        write(&mut part, "one");
        drop(part);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
