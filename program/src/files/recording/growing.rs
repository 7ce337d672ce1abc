//! A file that grows during a run, and that can be left unfinished for another process
//! to continue.

use std::fs::{File, OpenOptions};
use std::io::{self, BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use super::checkpoint::{Extent, damaged, unreadable};
use crate::files::atomic::{self, Draft};
use crate::report::FileError;
use crc32fast::Hasher;

pub struct GrowingFile {
    /// The finished file.
    file: PathBuf,
    draft: Draft,
    out: File,
    bytes: u64,
    checksum: Hasher,
    /// Data to be appended.
    buffer: Vec<u8>,
}

/// A CRC-32 checksum as text.
fn digits(checksum: Hasher) -> String {
    format!("{:08x}", checksum.finalize())
}

/// Where an unfinished file is kept: `motion.csv.part`.
pub fn kept_path(file: &Path) -> PathBuf {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    file.with_file_name(format!("{name}.part"))
}

impl GrowingFile {
    /// Begins a file with these bytes.
    pub fn begin(file: PathBuf, start: &[u8]) -> Result<Self, FileError> {
        let begun = Draft::begin(&file).map_err(|reason| FileError::write(&file, reason));
        let (draft, out) = begun?;
        let mut begun = GrowingFile {
            file,
            draft,
            out,
            bytes: 0,
            checksum: Hasher::new(),
            buffer: Vec::new(),
        };
        begun.append(|out| out.write_all(start))?;
        Ok(begun)
    }

    /// Continues a kept file after this extent. It is not changed if its content differs
    /// from what was kept.
    pub fn resume(file: PathBuf, extent: &Extent) -> Result<Self, FileError> {
        let kept = kept_path(&file);
        let resume = || -> io::Result<Option<Self>> {
            let mut out = OpenOptions::new().read(true).write(true).open(&kept)?;
            let (mut bytes, mut checksum) = (0, Hasher::new());
            let mut reader = BufReader::new(&out).take(extent.bytes);
            let mut buffer = vec![0; 1 << 16];
            loop {
                let read = reader.read(&mut buffer)?;
                if read == 0 {
                    break;
                }
                bytes += read as u64;
                checksum.update(&buffer[..read]);
            }
            if bytes != extent.bytes || digits(checksum.clone()) != extent.checksum {
                return Ok(None);
            }
            out.set_len(bytes)?;
            out.seek(SeekFrom::Start(bytes))?;
            Ok(Some(GrowingFile {
                draft: Draft::resume(&kept),
                file,
                out,
                bytes,
                checksum,
                buffer,
            }))
        };
        let resumed = resume().map_err(|reason| unreadable(&kept, reason))?;
        resumed.ok_or_else(|| damaged(&kept, "it is not as checkpoint.json says"))
    }

    /// The path of the unfinished file, and the one where another process looks for it.
    pub fn unfinished(&self) -> [PathBuf; 2] {
        [self.draft.path().into(), kept_path(&self.file)]
    }

    pub fn extent(&self) -> Extent {
        let name = self.file.file_name().unwrap_or_default();
        Extent {
            file: name.to_string_lossy().into(),
            bytes: self.bytes,
            checksum: digits(self.checksum.clone()),
        }
    }

    /// Appends to the file what `fill` adds to a buffer.
    pub fn append(
        &mut self,
        fill: impl FnOnce(&mut Vec<u8>) -> io::Result<()>,
    ) -> Result<(), FileError> {
        self.buffer.clear();
        let filled = fill(&mut self.buffer).and_then(|()| self.out.write_all(&self.buffer));
        filled.map_err(|reason| self.failed(reason))?;
        self.bytes += self.buffer.len() as u64;
        self.checksum.update(&self.buffer);
        Ok(())
    }

    /// Replaces the beginning of the file; nothing can be appended after that.
    pub fn replace_start(&mut self, bytes: &[u8]) -> Result<(), FileError> {
        let replaced = self.out.rewind().and_then(|()| self.out.write_all(bytes));
        replaced.map_err(|reason| self.failed(reason))
    }

    /// Reads the data written so far.
    pub fn read<T>(
        &self,
        read: impl FnOnce(BufReader<File>) -> io::Result<T>,
    ) -> Result<T, FileError> {
        let opened = File::open(self.draft.path()).map(BufReader::new);
        opened.and_then(read).map_err(|reason| self.failed(reason))
    }

    /// Gives the file its final name, and returns its path.
    pub fn finish(&mut self) -> Result<PathBuf, FileError> {
        let finished = atomic::rename(self.draft.path(), &self.file);
        finished.map_err(|reason| self.failed(reason))?;
        Ok(self.file.clone())
    }

    fn failed(&self, reason: io::Error) -> FileError {
        FileError::write(&self.file, reason)
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    fn write(file: &mut GrowingFile, text: &str) -> Extent {
        file.append(|out| out.write_all(text.as_bytes())).unwrap();
        file.extent()
    }

    #[test]
    fn a_kept_file_goes_on_where_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        let mut file = GrowingFile::begin(path.clone(), b"one ").unwrap();
        let extent = write(&mut file, "two ");
        write(&mut file, "and a half-written thr");
        let [draft, kept] = file.unfinished();
        atomic::rename(&draft, &kept).unwrap();
        drop(file);
        assert!(kept_path(&path).exists());

        let mut file = GrowingFile::resume(path.clone(), &extent).unwrap();
        write(&mut file, "three");
        file.finish().unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "one two three");
        assert!(!kept_path(&path).exists());
    }

    #[test]
    fn an_unfinished_file_that_is_dropped_is_removed() {
        let folder = tempfile::tempdir().unwrap();
        drop(GrowingFile::begin(folder.path().join("a.csv"), b"one").unwrap());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
