//! Files that are complete or absent: each is written under another name in
//! its folder and renamed when it is complete.

use crate::report::FileError;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::{fs, io, mem};
use tempfile::{Builder, NamedTempFile};

/// Large enough to write the centerline file of a wide leaf in few pieces.
const BUFFER_BYTES: usize = 1 << 16;

/// Drafts that have not been renamed yet.
static UNFINISHED_DRAFTS: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

fn lock_unfinished_drafts() -> MutexGuard<'static, Vec<PathBuf>> {
    // A list of paths is valid even if the lock is poisoned.
    UNFINISHED_DRAFTS
        .lock()
        .unwrap_or_else(PoisonError::into_inner)
}

/// Removes all unfinished files, and blocks other threads that try to begin or finish one
/// from now on: for a program about to exit.
pub fn remove_unfinished_files() {
    let mut paths = lock_unfinished_drafts();
    for path in paths.drain(..) {
        // A file that cannot be removed is left behind.
        let _ = fs::remove_file(path);
    }
    mem::forget(paths);
}

/// Writes `file` through `fill`; on an error `file` is as it was before.
pub(super) fn write_file(
    file: &Path,
    fill: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> io::Result<()> {
    let (draft, created) = DraftFile::begin(file)?;
    let mut out = BufWriter::with_capacity(BUFFER_BYTES, created);
    fill(&mut out)?;
    out.flush()?;
    drop(out);
    finish_draft(draft.path(), file)
}

/// Writes a file that does not exist yet; on an error it still does not.
pub fn write_new_file(file: &Path, bytes: &[u8]) -> io::Result<()> {
    // Takes the name, so that a file of another process is not replaced.
    File::create_new(file)?;
    let written = write_file(file, |out| out.write_all(bytes));
    written.inspect_err(|_| {
        // What cannot be removed is left behind, empty.
        let _ = fs::remove_file(file);
    })
}

/// The path of a file that is being written. A file that is not renamed is removed when this
/// is dropped.
pub(super) struct DraftFile(PathBuf);

impl DraftFile {
    /// Begins a file under another name.
    pub fn begin(file: &Path) -> io::Result<(Self, File)> {
        let mut paths = lock_unfinished_drafts();
        let (created, path) = create_draft(file)?.keep().map_err(|kept| kept.error)?;
        paths.push(path.clone());
        Ok((DraftFile(path), created))
    }

    pub fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for DraftFile {
    fn drop(&mut self) {
        let mut paths = lock_unfinished_drafts();
        if let Some(at) = paths.iter().position(|path| *path == self.0) {
            // A file that cannot be removed is left behind.
            let _ = fs::remove_file(paths.swap_remove(at));
        }
    }
}

/// Gives a draft its final name.
pub(super) fn finish_draft(draft: &Path, file: &Path) -> io::Result<()> {
    let mut paths = lock_unfinished_drafts();
    fs::rename(draft, file)?;
    paths.retain(|path| path != draft);
    Ok(())
}

/// A new file in the folder of `file`, under a hidden name that cannot be predicted: nothing that
/// stands there, such as a link, is opened.
fn create_draft(file: &Path) -> io::Result<NamedTempFile> {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let folder = file.parent().filter(|it| !it.as_os_str().is_empty());
    Builder::new()
        .prefix(&format!(".{name}."))
        .suffix(".part")
        .make_in(folder.unwrap_or(Path::new(".")), |path| {
            File::create_new(path)
        })
}

/// Creates the output folder and its parents.
pub(super) fn make_folder(folder: &Path) -> Result<(), FileError> {
    let created = fs::create_dir_all(folder);
    created.map_err(|reason| folder_not_writable(folder, nearest_existing_ancestor(folder), reason))
}

/// Checks that files can be written to `folder`, without leaving anything there, before
/// a long computation.
pub fn check_writable(folder: &Path) -> Result<(), FileError> {
    let existing = nearest_existing_ancestor(folder);
    let written = create_draft(&existing.join("probe")).and_then(NamedTempFile::close);
    written.map_err(|reason| folder_not_writable(folder, existing, reason))
}

fn folder_not_writable(folder: &Path, existing: PathBuf, reason: io::Error) -> FileError {
    let (folder, obstacle) = (folder.display(), existing.display());
    FileError(match existing.is_dir() {
        true => format!(
            "cannot write to the folder {folder}: {reason}; make it writable or name another with --out DIR"
        ),
        false => format!(
            "cannot write to the folder {folder}: {obstacle} is not a folder; name another with --out DIR"
        ),
    })
}

/// `path`, or its nearest ancestor that exists.
fn nearest_existing_ancestor(path: &Path) -> PathBuf {
    path.ancestors()
        .find(|ancestor| ancestor.exists())
        .filter(|ancestor| !ancestor.as_os_str().is_empty())
        .unwrap_or(Path::new("."))
        .to_path_buf()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let name = |entry: io::Result<fs::DirEntry>| entry.unwrap().file_name();
        let names = fs::read_dir(folder).unwrap().map(name);
        let mut names: Vec<_> = names.map(|name| name.into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn failed_write_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.json");
        write_new_file(&file, b"old").unwrap();
        let again = write_new_file(&file, b"new").unwrap_err();
        assert_eq!(again.kind(), io::ErrorKind::AlreadyExists);
        let failed = write_file(&file, |out| {
            out.write_all(b"half of the n")?;
            Err(io::Error::other("disk full"))
        });
        assert_eq!(failed.unwrap_err().to_string(), "disk full");
        assert_eq!(fs::read(&file).unwrap(), b"old");
        assert_eq!(names(folder.path()), ["a.json"]);
    }

    /// A link that stands where drafts used to be written is not followed, nor is one that stands
    /// where the file goes.
    #[cfg(unix)]
    #[test]
    fn nothing_is_written_through_a_link() {
        let (folder, outside) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let target = outside.path().join("target");
        fs::write(&target, "outside").unwrap();
        let links = [
            "a.json".into(),
            format!(".a.json.{}.part", std::process::id()),
        ];
        for link in links {
            std::os::unix::fs::symlink(&target, folder.path().join(link)).unwrap();
        }
        let probe = format!(".probe.{}.part", std::process::id());
        std::os::unix::fs::symlink(outside.path().join("new"), folder.path().join(probe)).unwrap();
        check_writable(folder.path()).unwrap();
        let file = folder.path().join("a.json");
        write_file(&file, |out| out.write_all(b"inside")).unwrap();
        assert_eq!(fs::read(&target).unwrap(), b"outside");
        assert_eq!(fs::read(&file).unwrap(), b"inside");
        assert!(!file.is_symlink());
        assert_eq!(names(outside.path()), ["target"]);
    }

    /// Drafts of the same file by the same process are different files.
    #[test]
    fn names_of_drafts_are_not_predictable() {
        let folder = tempfile::tempdir().unwrap();
        let begin = || DraftFile::begin(&folder.path().join("a.json")).unwrap().0;
        let (first, second) = (begin(), begin());
        assert_ne!(first.path(), second.path());
    }

    #[test]
    fn probing_leaves_nothing_and_makes_no_folder() {
        let folder = tempfile::tempdir().unwrap();
        check_writable(&folder.path().join("out/deep")).unwrap();
        assert!(names(folder.path()).is_empty());
    }
}
