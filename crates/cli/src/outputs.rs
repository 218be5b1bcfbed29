//! What a run writes is nothing that it reads, and nothing twice.
//!
//! # Method
//! Two names are one place if they lead to the same file, whatever links are between, or, where there is no file yet,
//! to the same name in the same folder. A folder that is written into stands for its entries that may be written. What
//! is no regular file, such as `/dev/null`, has no content to lose.

use std::ffi::OsStr;
use std::fs::{self, Metadata};
use std::path::{Path, PathBuf};

use volery::io::check_writable;

use crate::Failure;

/// Where a run writes.
#[derive(Debug, Default)]
pub(crate) struct Outputs {
    files: Vec<(&'static str, PathBuf)>,
    folders: Vec<Folder>,
}

/// A folder that is written into.
#[derive(Debug)]
struct Folder {
    option: &'static str,
    path: PathBuf,
    /// Whether a file of this name may be written.
    is_written: fn(&OsStr) -> bool,
}

impl Outputs {
    /// Adds a file that an option names.
    pub(crate) fn file(mut self, option: &'static str, path: &Path) -> Self {
        self.files.push((option, path.to_owned()));
        self
    }

    /// Adds a folder, and which of its files may be written.
    pub(crate) fn folder(
        mut self,
        option: &'static str,
        path: &Path,
        is_written: fn(&OsStr) -> bool,
    ) -> Self {
        self.folders.push(Folder { option, path: path.to_owned(), is_written });
        self
    }

    /// Refuses outputs that are one another or an input, and places where nothing can be written. A folder among the
    /// inputs stands for the files in it.
    pub(crate) fn check<'a>(&self, inputs: impl IntoIterator<Item = &'a Path>) -> Result<(), Failure> {
        let inputs = inputs.into_iter();
        self.check_inputs(inputs)?;
        self.check_each_other()?;
        for (option, path) in &self.files {
            check_writable(path).map_err(|error| Failure::undone(format!("{option} {error}")))?;
        }
        self.folders.iter().try_for_each(|folder| check_folder(&folder.path))
    }

    /// Refuses outputs that are inputs; for those that are known late.
    pub(crate) fn check_inputs<'a>(&self, inputs: impl IntoIterator<Item = &'a Path>) -> Result<(), Failure> {
        let written = self.places();
        let refuse = |clash: &Written, what: &str, path: &Path| {
            let (option, output, input) = (clash.option, clash.path.display(), path.display());
            Err(Failure::usage(format!("{option} {output}: is {what} {input}, expected another file")))
        };
        for input in inputs {
            let inside = files_in(input, &|_| true);
            for path in inside.iter().map(PathBuf::as_path).chain([input]) {
                let place = Place::of(path);
                let clash =
                    written.iter().find(|written| place.as_ref().is_some_and(|place| written.holds(place)));
                if let Some(clash) = clash {
                    return refuse(clash, "the input", path);
                }
            }
            // A folder of slices would have one slice more.
            let folder = Folder { option: "", path: input.to_owned(), is_written: is_slice };
            let folder = Written::in_folder(&folder);
            if let Some(clash) = written.iter().find(|written| written.is_in(&folder)) {
                return refuse(clash, "a new slice in the input", input);
            }
        }
        Ok(())
    }

    fn check_each_other(&self) -> Result<(), Failure> {
        let written = self.places();
        for (index, one) in written.iter().enumerate() {
            let other = written[..index].iter().find(|other| match (&one.place, &other.place) {
                (Some(one), Some(_)) => other.holds(one),
                _ => false,
            });
            let folders = written[..index].iter().find(|other| one.is_in(other) || other.is_in(one));
            if let Some(other) = other.or(folders) {
                let problem = format!(
                    "{} {}: is written by {} as well, expected a file for each",
                    one.option,
                    one.path.display(),
                    other.option
                );
                return Err(Failure::usage(problem));
            }
        }
        Ok(())
    }

    /// Every place that may be written.
    fn places(&self) -> Vec<Written> {
        let file = |(option, path): &(&'static str, PathBuf)| Written {
            option,
            path: path.clone(),
            place: Place::of(path),
            folder: None,
        };
        let mut written: Vec<_> = self.files.iter().map(file).collect();
        for folder in &self.folders {
            // New files of the folder, and those that are there, which may be links to elsewhere.
            let place = |path: PathBuf| {
                let place = Place::of(&path);
                Written { option: folder.option, path, place, folder: None }
            };
            written.extend(files_in(&folder.path, &|name| (folder.is_written)(name)).into_iter().map(place));
            written.push(Written::in_folder(folder));
        }
        written
    }
}

/// Whether a file of this name in a folder of slices is one of them.
fn is_slice(name: &OsStr) -> bool {
    let ending = Path::new(name).extension();
    ending.is_some_and(|ending| ["png", "tif", "tiff"].iter().any(|known| ending.eq_ignore_ascii_case(known)))
}

/// Whether a folder gets a file of a name.
type IsWritten = fn(&OsStr) -> bool;

/// A place that may be written, and who asks for it.
struct Written {
    option: &'static str,
    path: PathBuf,
    /// `None` where there is nothing to lose.
    place: Option<Place>,
    /// A folder, and the names of new files in it.
    folder: Option<(PathBuf, IsWritten)>,
}

impl Written {
    /// The new files of a folder.
    fn in_folder(folder: &Folder) -> Self {
        let real = fs::canonicalize(&folder.path).ok().filter(|path| path.is_dir());
        let new = real.map(|real| (real, folder.is_written));
        Self { option: folder.option, path: folder.path.clone(), place: None, folder: new }
    }

    fn holds(&self, place: &Place) -> bool {
        self.place.as_ref() == Some(place)
    }

    /// Whether it is a file that may be written into the folder that the other is.
    fn is_in(&self, other: &Self) -> bool {
        let Some((folder, is_written)) = &other.folder else { return false };
        match &self.place {
            Some(Place::New(path)) => {
                path.parent() == Some(folder) && path.file_name().is_some_and(is_written)
            }
            _ => false,
        }
    }
}

/// What a name leads to.
#[derive(Debug, PartialEq, Eq)]
enum Place {
    /// A file that is there.
    #[cfg(unix)]
    File { device: u64, inode: u64 },
    /// A file that is there, by its one true name.
    #[cfg(not(unix))]
    File(PathBuf),
    /// A name in a folder that is there.
    New(PathBuf),
}

impl Place {
    /// `None` where nothing can be lost: devices, folders, names in folders that are not there.
    fn of(path: &Path) -> Option<Self> {
        match fs::metadata(path) {
            Ok(found) => found.is_file().then(|| Self::of_file(path, &found)).flatten(),
            Err(_) => {
                let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
                let folder = fs::canonicalize(folder.unwrap_or(Path::new("."))).ok()?;
                Some(Self::New(folder.join(path.file_name()?)))
            }
        }
    }

    #[cfg(unix)]
    #[expect(clippy::unnecessary_wraps, reason = "elsewhere a name may lead nowhere")]
    fn of_file(_path: &Path, found: &Metadata) -> Option<Self> {
        use std::os::unix::fs::MetadataExt;
        Some(Self::File { device: found.dev(), inode: found.ino() })
    }

    #[cfg(not(unix))]
    fn of_file(path: &Path, _found: &Metadata) -> Option<Self> {
        fs::canonicalize(path).ok().map(Self::File)
    }
}

/// The entries of a folder that have such names; none where it is no folder.
fn files_in(folder: &Path, has_name: &dyn Fn(&OsStr) -> bool) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    entries.flatten().filter(|entry| has_name(&entry.file_name())).map(|entry| entry.path()).collect()
}

/// Whether a folder is there and takes files, or could be made.
fn check_folder(folder: &Path) -> Result<(), Failure> {
    let there = folder.ancestors().find(|path| path.as_os_str().is_empty() || path.exists());
    let there = there.filter(|path| !path.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if !there.is_dir() {
        let problem = format!("cannot be made: {} is a file, expected a folder", there.display());
        return Err(Failure::of_file(folder, problem));
    }
    check_writable(&there.join(".volery")).map_err(|error| {
        Failure::of_file(folder, format_args!("nothing can be written there: {}", error.source))
    })
}
