//! A file that is whole or not there.
//!
//! # Method
//! Bytes go into a file beside the target, which then takes the target's place. On Linux that file has no name until
//! it is whole (`O_TMPFILE`), so nothing is left of it whatever ends the process. Elsewhere, on file systems that know
//! no nameless files, and for the moment in which it replaces another file, it has a name that ends in `.part`:
//! whoever catches signals deletes those by [`abandon_unfinished`].

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::error::OneLine;

/// A file that could not be written.
#[derive(Debug, thiserror::Error)]
#[error("{}: cannot be written: {}", OneLine(.path.display()), OneLine(.source))]
pub struct WriteError {
    /// The file as asked for.
    pub path: PathBuf,
    /// What the system or the encoder says.
    pub source: io::Error,
}

/// Writes a file so that it is whole or not there: `write` fills a new file beside `path`, which then
/// takes the place of `path`. A symbolic link keeps pointing where it did; a device such as `/dev/null` is
/// written as it is.
///
/// # Errors
/// When the file cannot be made, filled or renamed; nothing is left behind then.
pub fn write_atomically(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> Result<(), WriteError> {
    let write = || match place(path)? {
        Place::Device(target) => {
            let mut file = BufWriter::new(File::options().write(true).open(target)?);
            write(&mut file)?;
            file.flush()
        }
        Place::File(target) => {
            let mut unfinished = Unfinished::beside(&target)?;
            write(&mut unfinished.file)?;
            unfinished.replace(&target)
        }
    };
    write().map_err(|source| WriteError { path: path.to_owned(), source })
}

/// Whether [`write_atomically`] could begin, for whoever wants to know before long work: the folder is there and takes
/// files, and no folder is in the way. Nothing is changed.
///
/// # Errors
/// Why it could not.
pub fn check_writable(path: &Path) -> Result<(), WriteError> {
    let check = || match place(path)? {
        // To open a pipe and close it again would end its reader.
        Place::Device(_) => Ok(()),
        Place::File(target) => Unfinished::beside(&target).map(drop),
    };
    check().map_err(|source| WriteError { path: path.to_owned(), source })
}

/// Names that end in `.part` and belong to this process.
static UNFINISHED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

fn unfinished_names() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    // Of names alone: there is nothing that a panic could have left half done.
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// While it lives no file gets a name: none is begun under one, none is finished.
pub struct Abandoned {
    _names: MutexGuard<'static, BTreeSet<PathBuf>>,
}

/// Deletes every file of this process that is not whole yet. For the moment before a signal ends the process.
#[must_use = "dropped, other threads go on to write"]
pub fn abandon_unfinished() -> Abandoned {
    let names = unfinished_names();
    for name in names.iter() {
        // Nobody is left to hear of a failure.
        let _ = fs::remove_file(name);
    }
    Abandoned { _names: names }
}

/// Where bytes go.
enum Place {
    /// Links followed; a file may be there or not.
    File(PathBuf),
    Device(PathBuf),
}

fn place(path: &Path) -> io::Result<Place> {
    let target = match fs::canonicalize(path) {
        Ok(target) => target,
        Err(error) if error.kind() == ErrorKind::NotFound => path.to_owned(),
        Err(error) => return Err(error),
    };
    match fs::metadata(&target) {
        Ok(found) if found.is_dir() => Err(io::Error::other("it is a folder, expected a file name")),
        Ok(found) if !found.is_file() => Ok(Place::Device(target)),
        Err(error) if error.kind() != ErrorKind::NotFound => Err(error),
        _ if target.file_name().is_none() => Err(io::Error::other("it is a folder, expected a file name")),
        _ => {
            let folder = folder_of(&target);
            match fs::metadata(folder) {
                Ok(found) if found.is_dir() => Ok(Place::File(target)),
                Ok(_) => Err(io::Error::other(format!("{} is a file, expected a folder", folder.display()))),
                Err(error) if error.kind() == ErrorKind::NotFound => {
                    let problem = format!("the folder {} does not exist", folder.display());
                    Err(io::Error::new(ErrorKind::NotFound, problem))
                }
                Err(error) => Err(error),
            }
        }
    }
}

fn folder_of(target: &Path) -> &Path {
    target.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// A file that waits to take its place; dropped, it is gone.
struct Unfinished {
    file: BufWriter<File>,
    /// Ends in `.part`; `None` as long as it needs no name.
    name: Option<PathBuf>,
}

impl Unfinished {
    fn beside(target: &Path) -> io::Result<Self> {
        let folder = folder_of(target);
        if let Some(file) = nameless(folder) {
            return Ok(Self { file: BufWriter::new(file), name: None });
        }
        let (name, file) = with_free_name(&mut unfinished_names(), folder, |name| File::create_new(name))?;
        Ok(Self { file: BufWriter::new(file), name: Some(name) })
    }

    /// Takes the place of the target.
    fn replace(mut self, target: &Path) -> io::Result<()> {
        self.file.flush()?;
        let file = self.file.get_ref();
        file.sync_all()?;
        let mut names = unfinished_names();
        let name = match self.name.take() {
            Some(name) => name,
            None => match give_name(file, target) {
                Ok(()) => return Ok(()),
                // A link replaces nothing, a rename does.
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {
                    with_free_name(&mut names, folder_of(target), |name| give_name(file, name))?.0
                }
                Err(error) => return Err(error),
            },
        };
        let renamed = fs::rename(&name, target);
        if renamed.is_err() {
            // The cause is already on its way.
            let _ = fs::remove_file(&name);
        }
        names.remove(&name);
        renamed
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        if let Some(name) = self.name.take() {
            let mut names = unfinished_names();
            // Nothing can be done about a failure here, and the cause is already on its way.
            let _ = fs::remove_file(&name);
            names.remove(&name);
        }
    }
}

/// Makes a file under a name that nothing else has, and remembers the name. A process of the same number that was
/// killed, perhaps in another container, may have left its own.
fn with_free_name<T>(
    names: &mut BTreeSet<PathBuf>,
    folder: &Path,
    make: impl Fn(&Path) -> io::Result<T>,
) -> io::Result<(PathBuf, T)> {
    let mut number = names.len();
    loop {
        let name = folder.join(format!(".volery-{}-{number}.part", std::process::id()));
        match make(&name) {
            Err(error) if error.kind() == ErrorKind::AlreadyExists => number += 1,
            made => {
                let made = made?;
                names.insert(name.clone());
                return Ok((name, made));
            }
        }
    }
}

/// A file of this folder without a name, which [`give_name`] can give one.
#[cfg(target_os = "linux")]
fn nameless(folder: &Path) -> Option<File> {
    use rustix::fs::{Mode, OFlags};
    let flags = OFlags::TMPFILE | OFlags::WRONLY | OFlags::CLOEXEC;
    let file = File::from(rustix::fs::open(folder, flags, Mode::from_raw_mode(0o666)).ok()?);
    fs::symlink_metadata(own_path(&file)).is_ok().then_some(file)
}

#[cfg(target_os = "linux")]
fn give_name(file: &File, name: &Path) -> io::Result<()> {
    use rustix::fs::{AtFlags, CWD};
    Ok(rustix::fs::linkat(CWD, own_path(file), CWD, name, AtFlags::SYMLINK_FOLLOW)?)
}

#[cfg(target_os = "linux")]
fn own_path(file: &File) -> String {
    use std::os::fd::AsRawFd;
    format!("/proc/self/fd/{}", file.as_raw_fd())
}

#[cfg(not(target_os = "linux"))]
fn nameless(_folder: &Path) -> Option<File> {
    None
}

#[cfg(not(target_os = "linux"))]
fn give_name(_file: &File, _name: &Path) -> io::Result<()> {
    Err(ErrorKind::Unsupported.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_killed_processes_are_stepped_over() {
        let folder = tempfile::tempdir().unwrap();
        let mut names = BTreeSet::new();
        let make = |name: &Path| File::create_new(name);
        let (first, _) = with_free_name(&mut BTreeSet::new(), folder.path(), make).unwrap();
        let (second, _) = with_free_name(&mut names, folder.path(), make).unwrap();
        assert_ne!(first, second);
        assert_eq!(names.into_iter().collect::<Vec<_>>(), [second]);
        let gone = folder.path().join("gone");
        assert!(with_free_name(&mut BTreeSet::new(), &gone, make).is_err());
    }

    #[test]
    fn a_file_under_a_name_takes_its_place_or_is_gone() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("a");
        let named = |bytes: &[u8]| {
            let (name, file) =
                with_free_name(&mut unfinished_names(), folder.path(), |name| File::create_new(name))
                    .unwrap();
            let mut unfinished = Unfinished { file: BufWriter::new(file), name: Some(name) };
            unfinished.file.write_all(bytes).unwrap();
            unfinished
        };
        let entries = || fs::read_dir(folder.path()).unwrap().count();
        drop(named(b"lost"));
        assert_eq!(entries(), 0);
        named(b"new").replace(&target).unwrap();
        assert_eq!((entries(), fs::read(&target).unwrap()), (1, b"new".to_vec()));
        named(b"newer").replace(&target).unwrap();
        assert_eq!((entries(), fs::read(&target).unwrap()), (1, b"newer".to_vec()));
        let inside = target.join("b");
        assert!(named(b"nowhere").replace(&inside).is_err());
        assert_eq!(entries(), 1);
        assert!(unfinished_names().iter().all(|name| !name.starts_with(folder.path())));
    }
}
