//! A file that grows during a run.

use std::fs::File;
use std::io::{self, BufReader, Seek, Write};
use std::path::PathBuf;

use crate::files::atomic::{self, Draft};
use crate::report::FileError;

pub struct GrowingFile {
    /// The finished file.
    file: PathBuf,
    draft: Draft,
    out: File,
    /// Data to be appended.
    buffer: Vec<u8>,
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
        filled.map_err(|reason| self.failed(reason))
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

    #[test]
    fn an_unfinished_file_that_is_dropped_is_removed() {
        let folder = tempfile::tempdir().unwrap();
        drop(GrowingFile::begin(folder.path().join("a.csv"), b"one").unwrap());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
