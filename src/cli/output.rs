//! The files that commands write where their user says. One that is there already is replaced only where haptograph wrote it
//! and nobody changed it since: `.haptograph.json` beside it has its hash. Else it is refused before the work, or with
//! `--force` replaced.

use super::written::{Written, free_beside};
use super::{Failure, folder_of, remark};
use crate::signal::files;
use crate::surfaces::files::write_atomically_by;
use std::fmt::Display;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The list of what haptograph wrote into a folder, and the hashes.
pub const LEDGER: &str = ".haptograph.json";

/// Whether files of others may be replaced.
#[derive(Debug, Clone, Copy, Default, clap::Args)]
pub struct Force {
    /// Replace files also where haptograph did not write them or they were changed since
    #[arg(long)]
    pub force: bool,
}

/// A file that may be written.
#[derive(Debug)]
pub struct Output {
    path: PathBuf,
    force: Force,
    /// Folders that were made for it, innermost first; they go again where nothing was written.
    made: Vec<PathBuf>,
}

impl Drop for Output {
    fn drop(&mut self) {
        // One that is not empty stays, and with it those around it.
        let _ = self.made.iter().try_for_each(fs::remove_dir);
    }
}

impl Output {
    /// Sees to it before the work that a file can be written and loses nobody anything.
    pub fn claim(path: &Path, force: Force) -> Result<Self, Failure> {
        let path = path.to_owned();
        let made = Vec::new();
        Self { path, force, made }.proved()
    }

    fn proved(self) -> Result<Self, Failure> {
        folder_of(&self.path)?;
        let place = replaceable(&self.path, self.force)?;
        tempfile::tempfile_in(folder_of(&place)?)
            .map_err(|error| Failure::file("write", &self.path, &error))?;
        Ok(self)
    }

    /// Sees to the page `report.html` of a folder, which is made if need be.
    pub fn claim_page(folder: &Path, force: Force) -> Result<Self, Failure> {
        if folder.is_file() {
            return Err(Failure::Message(format!(
                "{} is a file; give a folder for the page",
                folder.display()
            )));
        }
        let path = folder.join("report.html");
        let is_missing =
            |folder: &&Path| !folder.as_os_str().is_empty() && fs::symlink_metadata(folder).is_err();
        let missing = folder.ancestors().take_while(is_missing);
        let made = missing.map(Path::to_owned).collect();
        // From here on they go again.
        let output = Self { path, force, made };
        fs::create_dir_all(folder).map_err(|error| Failure::file("make the folder", folder, &error))?;
        output.proved()
    }

    /// Writes the file whole or not at all; where it is, is returned.
    pub fn write(&self, text: &str) -> Result<PathBuf, Failure> {
        self.write_by(|path| fs::write(path, text)).map(|(path, ())| path)
    }

    /// The same for what others write, into a file of that name elsewhere first.
    pub fn write_by<T, E: Display>(
        &self,
        write: impl FnOnce(&Path) -> Result<T, E>,
    ) -> Result<(PathBuf, T), Failure> {
        let failed = |error: &dyn Display| Failure::file("write", &self.path, error);
        let folder = folder_of(&self.path)?;
        let waiting = tempfile::Builder::new()
            .prefix(".haptograph-")
            .tempdir_in(folder)
            .map_err(|error| failed(&error))?;
        let file = waiting.path().join(self.path.file_name().unwrap_or_default());
        // Nobody knows the file by the name that it has until it is whole.
        let made = write(&file).map_err(|error| {
            let said = error
                .to_string()
                .replace(&*file.to_string_lossy(), &self.path.to_string_lossy());
            let twice = format!("cannot write {}: ", self.path.display());
            failed(&said.strip_prefix(&twice).unwrap_or(&said))
        })?;
        Ok((place(&file, &self.path, self.force)?, made))
    }
}

/// Moves a file to where it was asked for, or beside that where meanwhile there is a file of others; where it is, is returned.
pub fn place(from: &Path, to: &Path, force: Force) -> Result<PathBuf, Failure> {
    let (place, shown) = match replaceable(to, force) {
        Ok(place) => (place, to.to_owned()),
        Err(_) => {
            let free = free_beside(to);
            let (to, free_shown) = (to.display(), free.display());
            remark(&format!(
                "note: {to} is not as haptograph wrote it and stays; written to {free_shown} instead\n"
            ));
            (free.clone(), free)
        }
    };
    let noted = note(&place, |list, name| list.announce(name, from));
    move_file(from, &place).map_err(|error| {
        // Where that cannot be noted either, the list has a name too many.
        let _ = note(&place, |list, name| {
            list.withdraw(name);
            Ok(())
        });
        Failure::file("write", to, &error)
    })?;
    let noted = noted.and_then(|()| {
        note(&place, |list, name| {
            list.arrived(name);
            Ok(())
        })
    });
    if let Err(error) = noted {
        let shown = shown.display();
        remark(&format!(
            "note: it is not noted that haptograph wrote {shown}, which will not be replaced without --force: {error}\n"
        ));
    }
    Ok(shown)
}

/// The path without links, where nothing is there or what is there may be replaced.
pub fn replaceable(path: &Path, force: Force) -> Result<PathBuf, Failure> {
    let refused = |why: &str| Err(Failure::file("write", path, &why));
    let Ok(found) = fs::symlink_metadata(path) else {
        return Ok(path.to_owned());
    };
    let place = match path.canonicalize() {
        Ok(place) if found.is_symlink() => place,
        Err(_) if found.is_symlink() => return refused("it is a link that leads nowhere; give another file"),
        _ => path.to_owned(),
    };
    match fs::symlink_metadata(&place) {
        Ok(found) if found.is_dir() => return refused("it is a folder; give a file"),
        Ok(found) if !found.is_file() => return refused("it is no regular file; give another one"),
        _ => {}
    }
    if force.force || is_own(&place) {
        return Ok(place);
    }
    refused(
        "it is there, and haptograph did not write it or it was changed since; give another file, or --force to replace it",
    )
}

fn is_own(place: &Path) -> bool {
    let (Ok(folder), Some(name)) = (folder_of(place), place.file_name()) else {
        return false;
    };
    let list = Written::read(&folder.join(LEDGER));
    list.is_some_and(|list| list.is_unchanged(folder, Path::new(name)))
}

/// Changes what is noted of a file in the list of its folder.
fn note(place: &Path, change: impl FnOnce(&mut Written, &Path) -> io::Result<()>) -> io::Result<()> {
    let folder = folder_of(place).map_err(io::Error::other)?;
    let _lock = lock(folder);
    let ledger = folder.join(LEDGER);
    let list = Written::read(&ledger);
    if list.is_none() && fs::symlink_metadata(&ledger).is_ok() {
        return Err(io::Error::other(format!(
            "{} is no list of haptograph's",
            ledger.display()
        )));
    }
    let mut list = list.unwrap_or_default();
    list.retain(|name| folder.join(name).exists());
    change(&mut list, Path::new(place.file_name().unwrap_or_default()))?;
    list.save(&ledger)
}

/// Keeps other commands from changing a folder's list meanwhile. Without it an entry may be lost: its file is then refused.
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

/// Renames, or copies beside the target first where that is on another file system.
fn move_file(from: &Path, to: &Path) -> io::Result<()> {
    if fs::rename(from, to).is_ok() {
        return Ok(());
    }
    let mut source = files::open(from, u64::MAX)?;
    write_atomically_by(to, |target| io::copy(&mut source, target).map(drop))
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
            note(&path, |list, name| list.announce(name, &waiting)).unwrap();
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
            drop(Output::claim_page(folder, Force::default()).unwrap());
        }
        assert!(!above.path().join("new").exists() && old.exists());
        Output::claim_page(&new, Force::default())
            .unwrap()
            .write("page")
            .unwrap();
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
