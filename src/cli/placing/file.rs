//! Single output files. An existing file is replaced only if haptograph wrote it and it is unchanged since.
//! Otherwise the command fails before it computes anything, unless `--force` is given.

use super::free_beside;
use super::manifest::Manifest;
use crate::cli::{Failure, eprint, folder_of, make_folder};
use crate::signal::files::copy_atomically;
use std::ffi::OsStr;
use std::fmt::Display;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// File with the names and hashes of the files that haptograph wrote into a folder.
const LEDGER: &str = ".haptograph.json";

/// Permission to replace files that haptograph did not write.
#[derive(Debug, Clone, Copy, Default, clap::Args)]
pub(crate) struct Force {
    /// Replace existing files even if haptograph did not write them or they were changed since
    #[arg(long)]
    pub force: bool,
}

/// An output path that may be written.
#[derive(Debug)]
pub(crate) struct Output {
    path: PathBuf,
    force: Force,
    /// Folders created for it, innermost first; dropped without a written file, they are removed again.
    made: Vec<PathBuf>,
}

impl Drop for Output {
    fn drop(&mut self) {
        // `remove_dir` fails for a folder that is not empty, which ends the loop.
        let _ = self.made.iter().try_for_each(fs::remove_dir);
    }
}

impl Output {
    /// Checks before the work that a file can be written without loss of another one.
    pub(crate) fn claim(path: &Path, force: Force) -> Result<Self, Failure> {
        Self { path: path.to_owned(), force, made: Vec::new() }.proved()
    }

    fn proved(self) -> Result<Self, Failure> {
        folder_of(&self.path)?;
        let place = replaceable(&self.path, self.force)?;
        tempfile::tempfile_in(folder_of(&place)?).map_err(Failure::doing("write", &self.path))?;
        Ok(self)
    }

    /// Claims the page `report.html` of a folder and creates the folder.
    pub(crate) fn claim_page(folder: Option<&Path>, force: Force) -> Result<Option<Self>, Failure> {
        let Some(folder) = folder else { return Ok(None) };
        if folder.is_file() {
            let folder = folder.display();
            return Err(Failure::Message(format!("{folder} is a file; give a folder for the page")));
        }
        let is_missing =
            |folder: &&Path| !folder.as_os_str().is_empty() && fs::symlink_metadata(folder).is_err();
        let made = folder.ancestors().take_while(is_missing).map(Path::to_owned).collect();
        // From here on `drop` removes the created folders.
        let output = Self { path: folder.join("report.html"), force, made };
        make_folder(folder)?;
        output.proved().map(Some)
    }

    /// Writes the whole file or nothing; returns its path.
    pub(crate) fn write(&self, content: impl AsRef<[u8]>) -> Result<PathBuf, Failure> {
        self.write_by(|path| fs::write(path, content)).map(|(path, ())| path)
    }

    /// The same for a writer function, which gets a temporary path first. A note that it writes is placed too.
    pub(crate) fn write_by<T, E: Display>(
        &self,
        write: impl FnOnce(&Path) -> Result<T, E>,
    ) -> Result<(PathBuf, T), Failure> {
        let failed = |error: &dyn Display| Failure::file("write", &self.path, error);
        let waiting = tempfile::Builder::new()
            .prefix(".haptograph-")
            .tempdir_in(folder_of(&self.path)?)
            .map_err(|error| failed(&error))?;
        let file = waiting.path().join(self.path.file_name().unwrap_or_default());
        // Errors name the temporary path; the user knows only the final one.
        let made = write(&file).map_err(|error| {
            let said = error.to_string().replace(&*file.to_string_lossy(), &self.path.to_string_lossy());
            let twice = format!("cannot write {}: ", self.path.display());
            failed(&said.strip_prefix(&twice).unwrap_or(&said))
        })?;
        let placed = place_all(waiting.path(), &self.path, self.force)?;
        Ok((placed.last().unwrap_or(&self.path).clone(), made))
    }
}

/// Moves a file and its note, if they wait in a folder, to their places; returns the final paths, the file's last: no
/// file of samples exists without its full scale.
pub(super) fn place_all(waiting: &Path, file: &Path, force: Force) -> Result<Vec<PathBuf>, Failure> {
    let mut placed = Vec::new();
    for target in [file.with_added_extension("ron"), file.to_owned()] {
        let from = waiting.join(target.file_name().unwrap_or_default());
        if from.is_file() {
            placed.push(place(&from, &target, force)?);
        }
    }
    Ok(placed)
}

/// Moves a file to its target, or beside it if a foreign file has appeared there; returns the final path.
fn place(from: &Path, to: &Path, force: Force) -> Result<PathBuf, Failure> {
    let (place, shown) = replaceable(to, force).map(|place| (place, to.to_owned())).unwrap_or_else(|_| {
        let free = free_beside(to);
        let (to, shown) = (to.display(), free.display());
        eprint(&format!(
            "note: {to} was changed since haptograph wrote it and is kept; wrote {shown} instead\n"
        ));
        (free.clone(), free)
    });
    let announced = change_list(&place, |list, name| list.announce(name, from));
    // Across file systems a file is copied beside the target first.
    let moved = fs::rename(from, &place).or_else(|_| copy_atomically(from, &place));
    // If this fails, the announcement stays, which holds for the old file and for the new one.
    let settled = change_list(&place, |list, name| {
        list.settle(name, moved.is_ok());
        Ok(())
    });
    moved.map_err(Failure::doing("write", to))?;
    if let Err(error) = announced.and(settled) {
        let shown = shown.display();
        eprint(&format!(
            "note: cannot record that haptograph wrote {shown}; later runs will replace it only with --force: {error}\n"
        ));
    }
    Ok(shown)
}

/// The path without links, if the file does not exist or may be replaced.
pub(crate) fn replaceable(path: &Path, force: Force) -> Result<PathBuf, Failure> {
    let refused = |why: &str| Err(Failure::file("write", path, &why));
    let Ok(found) = fs::symlink_metadata(path) else {
        return Ok(path.to_owned());
    };
    let place = match path.canonicalize() {
        Ok(place) if found.is_symlink() => place,
        Err(_) if found.is_symlink() => return refused("it is a broken link; give another file"),
        _ => path.to_owned(),
    };
    match fs::symlink_metadata(&place) {
        Ok(found) if found.is_dir() => return refused("it is a folder; give a file"),
        Ok(found) if !found.is_file() => return refused("it is not a regular file; give another one"),
        _ => {}
    }
    if force.force || is_own(&place) {
        return Ok(place);
    }
    refused(
        "the file exists, and haptograph did not write it or it was changed since; give another file, or --force to replace it",
    )
}

fn is_own(place: &Path) -> bool {
    let (Ok(folder), Some(name)) = (folder_of(place), place.file_name()) else {
        return false;
    };
    let list = Manifest::read(&folder.join(LEDGER));
    list.is_some_and(|list| list.is_unchanged(folder, Path::new(name)))
}

/// Changes the entry of a file in the list of its folder. A name that is not Unicode has none: the file counts as foreign.
fn change_list(place: &Path, change: impl FnOnce(&mut Manifest, &str) -> io::Result<()>) -> io::Result<()> {
    let Some(name) = place.file_name().and_then(OsStr::to_str) else {
        return Ok(());
    };
    let folder = folder_of(place).map_err(io::Error::other)?;
    let _lock = lock(folder);
    let ledger = folder.join(LEDGER);
    let list = Manifest::read(&ledger);
    if list.is_none() && fs::symlink_metadata(&ledger).is_ok() {
        return Err(io::Error::other(format!("{} is not a file list of haptograph", ledger.display())));
    }
    let mut list = list.unwrap_or_default();
    list.forget_missing(folder);
    change(&mut list, name)?;
    list.save(&ledger)
}

/// Locks a folder's list against other commands. Without the lock an entry may be lost; its file then counts
/// as foreign.
fn lock(folder: &Path) -> Option<File> {
    let lock = File::open(folder).ok()?;
    for _ in 0..200 {
        if lock.try_lock().is_ok() {
            return Some(lock);
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn write(path: &Path, text: &str, force: bool) -> Option<PathBuf> {
        Output::claim(path, Force { force }).ok()?.write(text).ok()
    }

    #[test]
    fn only_what_haptograph_wrote_and_nobody_changed_is_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.svg");
        assert_eq!(write(&path, "1", false).as_ref(), Some(&path));
        assert_eq!(write(&path, "2", false).as_ref(), Some(&path));
        fs::write(&path, "edited").unwrap();
        assert_eq!(write(&path, "3", false), None);
        assert_eq!(fs::read_to_string(&path).unwrap(), "edited");
        assert_eq!(write(&path, "4", true).as_ref(), Some(&path));
        assert_eq!(write(folder.path(), "5", true), None);
    }

    #[test]
    fn a_kill_before_or_after_the_move_leaves_a_file_that_can_be_replaced() {
        for moved in [false, true] {
            let folder = tempfile::tempdir().unwrap();
            let (path, waiting) = (folder.path().join("x.svg"), folder.path().join("waiting"));
            write(&path, "1", false).unwrap();
            fs::write(&waiting, "2").unwrap();
            change_list(&path, |list, name| list.announce(name, &waiting)).unwrap();
            if moved {
                fs::rename(&waiting, &path).unwrap();
            }
            assert_eq!(write(&path, "3", false).as_ref(), Some(&path));
            assert_eq!(write(&path, "4", false).as_ref(), Some(&path));
            fs::write(&path, "edited").unwrap();
            assert_eq!(write(&path, "5", false), None);
        }
    }

    #[test]
    fn a_folder_for_a_page_that_is_not_written_goes_again() {
        let above = tempfile::tempdir().unwrap();
        let (new, old) = (above.path().join("new/page"), above.path().join("old"));
        fs::create_dir(&old).unwrap();
        for folder in [&new, &old] {
            drop(Output::claim_page(Some(folder), Force::default()).unwrap());
        }
        assert!(!above.path().join("new").exists() && old.exists());
        Output::claim_page(Some(&new), Force::default()).unwrap().unwrap().write("page").unwrap();
        assert_eq!(fs::read_to_string(new.join("report.html")).unwrap(), "page");
    }

    #[test]
    fn what_appears_meanwhile_stays_and_the_work_is_not_lost() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.svg");
        let output = Output::claim(&path, Force::default()).unwrap();
        fs::write(&path, "mine").unwrap();
        let free = folder.path().join("x-1.svg");
        assert_eq!(output.write("work").unwrap(), free);
        assert_eq!(fs::read_to_string(&path).unwrap(), "mine");
        assert_eq!(fs::read_to_string(&free).unwrap(), "work");
    }

    #[cfg(unix)]
    #[test]
    fn a_link_stays_one_and_a_device_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let (real, link) = (folder.path().join("real.svg"), folder.path().join("link.svg"));
        write(&real, "1", false).unwrap();
        std::os::unix::fs::symlink(&real, &link).unwrap();
        write(&link, "2", false).unwrap();
        assert!(link.is_symlink());
        assert_eq!(fs::read_to_string(&real).unwrap(), "2");
        let null = folder.path().join("null.svg");
        std::os::unix::fs::symlink("/dev/null", &null).unwrap();
        assert_eq!(write(&null, "3", true), None);
    }

    #[test]
    fn a_list_of_others_is_not_written_over() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join(LEDGER), "notes").unwrap();
        write(&folder.path().join("x.svg"), "1", false).unwrap();
        assert_eq!(fs::read_to_string(folder.path().join(LEDGER)).unwrap(), "notes");
    }
}
