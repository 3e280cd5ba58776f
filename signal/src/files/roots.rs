//! Confinement of a thread to some folders and files, while it works for a client that must not read every file of the
//! machine.

use super::Refusal;
use std::borrow::Cow;
use std::cell::RefCell;
use std::io;
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

thread_local! {
    static SCOPE: RefCell<Scope> = const { RefCell::new(Scope::Everything) };
}

/// The files that this thread may read now.
enum Scope {
    Everything,
    /// All files; each opened file is recorded.
    Noted(Vec<PathBuf>),
    Within(Arc<Roots>),
}

/// Folders with all that is below them, and single files.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Roots {
    folders: Vec<PathBuf>,
    files: Vec<PathBuf>,
}

impl Roots {
    /// Makes roots of these folders, with all links resolved.
    ///
    /// # Errors
    /// The first path that is not a folder, and the reason.
    pub fn of<P: AsRef<Path>>(folders: impl IntoIterator<Item = P>) -> Result<Self, (PathBuf, io::Error)> {
        let real = |folder: P| {
            let folder = folder.as_ref();
            match folder.canonicalize() {
                Ok(real) if real.is_dir() => Ok(real),
                Ok(_) => Err((folder.to_owned(), io::ErrorKind::NotADirectory.into())),
                Err(error) => Err((folder.to_owned(), error)),
            }
        };
        Ok(Self { folders: folders.into_iter().map(real).collect::<Result<_, _>>()?, files: Vec::new() })
    }

    /// Adds single files, such as those that [`noting_files`] returned.
    #[must_use]
    pub fn and_files(mut self, files: impl IntoIterator<Item = PathBuf>) -> Self {
        self.files.extend(files);
        self
    }

    /// The folders, with all links resolved.
    pub fn folders(&self) -> &[PathBuf] {
        &self.folders
    }

    /// Runs `work` on this thread, which can read nothing else meanwhile. Other threads are not confined.
    pub fn confine<T>(self: &Arc<Self>, work: impl FnOnce() -> T) -> T {
        let _back = enter(Scope::Within(Arc::clone(self)));
        work()
    }

    /// The file that a path leads to, if it is one of these or below one.
    fn admit(&self, path: &Path) -> Option<PathBuf> {
        let real = resolved(path)?;
        let is_in = |folder: &PathBuf| real.starts_with(folder);
        (self.folders.iter().any(is_in) || self.files.contains(&real)).then_some(real)
    }
}

/// Restores the previous scope of the thread when it is dropped, also after a panic.
struct Back(Option<Scope>);

impl Drop for Back {
    fn drop(&mut self) {
        if let Some(before) = self.0.take() {
            SCOPE.set(before);
        }
    }
}

fn enter(scope: Scope) -> Back {
    Back(Some(SCOPE.replace(scope)))
}

/// Runs `work` on this thread. Returns its result and the files that it opened for reading, with all links resolved.
pub fn noting_files<T>(work: impl FnOnce() -> T) -> (T, Vec<PathBuf>) {
    let _back = enter(Scope::Noted(Vec::new()));
    let done = work();
    let noted = SCOPE.with_borrow_mut(|scope| match scope {
        Scope::Noted(files) => std::mem::take(files),
        _ => Vec::new(),
    });
    (done, noted)
}

/// The folders that this thread is confined to, if a path lies outside them; `None` if it may be read.
pub fn refused(path: &Path) -> Option<Arc<Roots>> {
    SCOPE.with_borrow(|scope| match scope {
        Scope::Within(roots) if roots.admit(path).is_none() => Some(Arc::clone(roots)),
        _ => None,
    })
}

/// The path to open for a path. A confined thread opens the target that was checked, so that no link is followed after
/// the check.
pub(super) fn admitted(path: &Path) -> io::Result<Cow<'_, Path>> {
    SCOPE.with_borrow(|scope| match scope {
        Scope::Within(roots) => roots.admit(path).map(Cow::Owned).ok_or_else(|| Refusal::Outside.into()),
        _ => Ok(Cow::Borrowed(path)),
    })
}

/// Records an opened file.
pub(super) fn note(path: &Path) {
    SCOPE.with_borrow_mut(|scope| {
        if let (Scope::Noted(files), Ok(real)) = (scope, path.canonicalize()) {
            files.push(real);
        }
    });
}

/// A path from the root without links and `..`; its target need not exist. `None` if the path cannot be resolved.
fn resolved(path: &Path) -> Option<PathBuf> {
    let path = std::path::absolute(path).ok()?;
    let found = path.ancestors().find_map(|folder| Some((folder, folder.canonicalize().ok()?)));
    let (folder, real) = found?;
    let rest = path.strip_prefix(folder).ok()?;
    // What is missing may be a link that leads nowhere yet.
    if rest.components().next().is_some_and(|first| real.join(first).is_symlink()) {
        return None;
    }
    let is_name = |part: Component<'_>| matches!(part, Component::Normal(_));
    // No such folder, so nothing that `..` could lead out of: what comes of it later is not known.
    rest.components().all(is_name).then(|| match rest.as_os_str().is_empty() {
        true => real,
        false => real.join(rest),
    })
}

#[cfg(unix)]
#[cfg(test)]
mod tests {
    use super::super::{is_file, is_folder, list, open, read};
    use super::*;
    use std::fs;
    use std::os::unix::fs::symlink;

    /// A folder with `in/a`, a file beside it and what leads there, and the roots of `in`.
    fn place() -> (tempfile::TempDir, Arc<Roots>) {
        let place = tempfile::tempdir().unwrap();
        let at = |name: &str| place.path().join(name);
        fs::create_dir_all(at("in/below")).unwrap();
        fs::create_dir(at("in-too")).unwrap();
        for name in ["in/a", "in/below/b", "secret", "in-too/c"] {
            fs::write(at(name), name).unwrap();
        }
        symlink("a", at("in/link")).unwrap();
        symlink("../secret", at("in/out")).unwrap();
        symlink("..", at("in/up")).unwrap();
        symlink("/etc", at("in/etc")).unwrap();
        symlink("../nowhere", at("in/dangling")).unwrap();
        let roots = Roots::of([at("in")]).unwrap();
        (place, Arc::new(roots))
    }

    fn outside(path: &Path) -> bool {
        open(path, 99).is_err_and(|error| Refusal::of(&error) == Some(Refusal::Outside))
    }

    #[test]
    fn nothing_is_read_outside_whatever_the_path_is_like() {
        let (place, roots) = place();
        let at = |name: &str| place.path().join(name);
        roots.confine(|| {
            for (name, content) in [
                ("in/a", "in/a"),
                ("in/below/../a", "in/a"),
                ("in/link", "in/a"),
                ("in/./below/b", "in/below/b"),
                ("in/up/in/a", "in/a"),
            ] {
                assert_eq!(read(&at(name), 99).unwrap(), content.as_bytes(), "{name}");
                assert!(refused(&at(name)).is_none() && is_file(&at(name)), "{name}");
            }
            for name in [
                "secret",
                "in/../secret",
                "in/out",
                "in/up/secret",
                "in/etc/passwd",
                "in-too/c",
                "in/none/../../secret",
                "in/dangling",
                "nothing/here",
                "in/below/../../../../../../../../etc/passwd",
            ] {
                assert!(outside(&at(name)) && !is_file(&at(name)), "{name}");
                assert_eq!(refused(&at(name)), Some(Arc::clone(&roots)), "{name}");
            }
            for path in ["/etc/passwd", "/proc/self/environ", "/dev/zero", "/dev/stdin", "secret", "/"] {
                assert!(outside(Path::new(path)), "{path}");
            }
            assert!(is_folder(&at("in")) && !is_folder(&at("in-too")) && list(&at("in-too")).is_empty());
            let mut names = list(&at("in"));
            names.sort();
            assert_eq!(names, [at("in/a"), at("in/link")], "no file that leads out");
            // What is not there is that, and not outside.
            let missing = open(&at("in/none/x"), 9).unwrap_err();
            assert_eq!(missing.kind(), io::ErrorKind::NotFound);
        });
        assert_eq!(read(&at("secret"), 99).unwrap(), b"secret", "afterwards all is as before");
    }

    #[test]
    fn pipes_within_are_refused_without_waiting_for_them() {
        let (place, roots) = place();
        let pipe = place.path().join("in/pipe");
        let made = std::process::Command::new("mkfifo").arg(&pipe).status().unwrap();
        assert!(made.success());
        let error = roots.confine(|| open(&pipe, 9)).unwrap_err();
        assert_eq!(Refusal::of(&error), Some(Refusal::NotRegular { found: "a named pipe" }));
    }

    #[test]
    fn files_that_were_noted_can_be_read_alone() {
        let (place, roots) = place();
        let (secret, other) = (place.path().join("in/out"), place.path().join("in-too/c"));
        let (read_before, noted) = noting_files(|| read(&secret, 99));
        assert_eq!(read_before.unwrap(), b"secret");
        assert_eq!(noted, [place.path().canonicalize().unwrap().join("secret")]);
        let roots = Arc::new(Roots::clone(&roots).and_files(noted));
        roots.confine(|| {
            assert_eq!(read(&secret, 99).unwrap(), b"secret");
            assert!(outside(&other));
        });
    }

    #[test]
    fn a_panic_ends_the_confinement_and_other_threads_have_none() {
        let (place, roots) = place();
        let secret = place.path().join("secret");
        let panicked = std::panic::catch_unwind(|| roots.confine(|| panic!("on purpose")));
        assert!(panicked.is_err() && read(&secret, 99).is_ok());
        roots
            .confine(|| std::thread::scope(|scope| scope.spawn(|| assert!(read(&secret, 99).is_ok())).join()))
            .unwrap();
    }

    #[test]
    fn what_is_no_folder_is_named() {
        let (place, _) = place();
        for name in ["secret", "none"] {
            let (path, _) = Roots::of([place.path().join(name)]).unwrap_err();
            assert_eq!(path, place.path().join(name));
        }
    }
}
