//! Learns a surface from a recording dropped on the page, in a process of its own: what fails there ends nothing else.

use crate::learn::{Dropped, FULL, paths, stem};
use crate::run_page::REPORT;
use haptograph_signal::files;
use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// The program that learns the recording `table`, writes its surface to `surface`, and the page about it, `report.html`, into
/// the folder `report`. All three are names in the folder in which it is started; flags of `learn` for the columns of the table follow. It
/// describes an error on its standard
/// error stream, in a line that begins with `error: ` and those after it, and fails.
pub type Learner = fn(table: &Path, surface: &Path, report: &Path) -> io::Result<Command>;

/// Maximum memory of the process, bytes: a recording of 64 MiB needs a sixth of it.
#[cfg(target_os = "linux")]
const MAX_BYTES: u64 = 2 << 30;
/// Maximum time that it takes.
const LONGEST: Duration = Duration::from_secs(600);
/// Polling period.
const STEP: Duration = Duration::from_millis(20);
/// Beginning of its error.
const ERROR: &str = "error: ";
/// Maximum number of letters of its error.
const MAX_LETTERS: usize = 1000;

/// The one recording that is learned at a time, which any thread can cancel.
#[derive(Debug, Clone, Default)]
pub(super) struct Learning(Arc<Mutex<Option<Running>>>);

#[derive(Debug)]
struct Running {
    page: u64,
    request: u64,
    child: Option<Child>,
    end: Option<End>,
}

/// Reason for which the process was ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum End {
    Cancelled,
    TooLong,
}

/// The turn of one recording; dropping it lets another begin.
#[derive(Debug)]
pub(super) struct Turn(Learning);

impl Drop for Turn {
    fn drop(&mut self) {
        self.0.end(End::Cancelled, |_| true);
        *self.0.running() = None;
    }
}

impl Learning {
    fn running(&self) -> MutexGuard<'_, Option<Running>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes the turn for a request of a page; `None` while another recording is learned.
    pub(super) fn begin(&self, page: u64, request: u64) -> Option<Turn> {
        let mut running = self.running();
        running.is_none().then(|| {
            *running = Some(Running { page, request, child: None, end: None });
            Turn(self.clone())
        })
    }

    fn end(&self, why: End, is_meant: impl FnOnce(&Running) -> bool) {
        if let Some(running) = self.running().as_mut().filter(|running| is_meant(running)) {
            running.end.get_or_insert(why);
            if let Some(child) = &mut running.child {
                // One that has ended already.
                let _ = child.kill();
            }
        }
    }

    /// Cancels the learning of a page; with a request, that one only.
    pub(super) fn cancel(&self, page: u64, request: Option<u64>) {
        self.end(End::Cancelled, |running| {
            running.page == page && request.is_none_or(|request| running.request == request)
        });
    }

    /// Cancels it whosever it is.
    pub(super) fn cancel_all(&self) {
        self.end(End::Cancelled, |_| true);
    }

    /// Cancels it whosever it is, and waits until its files are removed.
    pub(super) fn close(&self) {
        self.cancel_all();
        let asked = Instant::now();
        while self.running().is_some() && asked.elapsed() < Duration::from_secs(5) {
            std::thread::sleep(STEP);
        }
    }
}

impl Turn {
    /// What reading the table finds.
    pub(super) fn reading(
        &self,
        Dropped { name, csv, mapping, .. }: &Dropped,
    ) -> Result<serde_json::Value, String> {
        let stored = |error: io::Error| format!("cannot store the recording: {error}");
        let workplace = tempfile::tempdir().map_err(stored)?;
        let table = workplace.path().join(format!("{}.csv", stem(name)));
        std::fs::write(&table, csv).map_err(stored)?;
        Ok(crate::learn::reading(&table, mapping))
    }

    /// Learns the table `name` and writes its surface to a new file in `folder`; returns the file and the report as HTML.
    pub(super) fn surface(
        &self,
        learner: Learner,
        Dropped { name, csv, mapping, .. }: &Dropped,
        folder: &Path,
    ) -> Result<(PathBuf, Vec<u8>), String> {
        let stem = stem(name);
        let stored = |error: io::Error| format!("cannot store the recording: {error}");
        let workplace = tempfile::tempdir().map_err(stored)?;
        let [table_name, made, errors] = ["csv", "ron", "errors"].map(|ending| format!("{stem}.{ending}"));
        std::fs::write(workplace.path().join(&table_name), csv).map_err(stored)?;
        let errors = workplace.path().join(errors);
        let failed = |error: io::Error| format!("cannot start the process that learns: {error}");
        let mut command = learner(table_name.as_ref(), made.as_ref(), "report".as_ref()).map_err(failed)?;
        command
            .args(mapping.flags())
            .current_dir(workplace.path())
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(File::create(&errors).map_err(stored)?);
        let status = self.wait(command.spawn().map_err(failed)?).map_err(failed)?;
        self.judge(status, &errors)?;
        let at = |name: &str| workplace.path().join(name);
        let failed = |error: io::Error| format!("cannot read the learned surface: {error}");
        let surface = files::read(&at(&made), files::MAX_SURFACE_BYTES).map_err(failed)?;
        if !haptograph_surfaces::files::read_surface(&surface).is_ok_and(|surface| surface.texture.is_some())
        {
            return Err(crate::learn::NO_DRAG.to_owned());
        }
        let report = at("report").join(REPORT);
        let report = files::read(&report, files::MAX_REPORT_BYTES).map_err(failed)?;
        Ok((keep(&surface, folder, &stem)?, report))
    }

    /// Waits for the process to end, and ends it if it takes too long.
    fn wait(&self, child: Child) -> io::Result<ExitStatus> {
        limit(&child);
        let Self(learning) = self;
        if let Some(running) = learning.running().as_mut() {
            let child = running.child.insert(child);
            if running.end.is_some() {
                let _ = child.kill();
            }
        }
        let begun = Instant::now();
        loop {
            if begun.elapsed() > LONGEST {
                learning.end(End::TooLong, |_| true);
            }
            let mut running = learning.running();
            let child = running.as_mut().and_then(|running| running.child.as_mut());
            let child = child.ok_or(io::ErrorKind::NotFound)?;
            if let Some(status) = child.try_wait()? {
                return Ok(status);
            }
            drop(running);
            std::thread::sleep(STEP);
        }
    }

    /// The reason for which the process failed.
    fn judge(&self, status: ExitStatus, errors: &Path) -> Result<(), String> {
        let end = self.0.running().as_ref().and_then(|running| running.end);
        match end {
            Some(End::Cancelled) => return Err("learning was cancelled".to_owned()),
            Some(End::TooLong) => {
                let minutes = LONGEST.as_secs() / 60;
                return Err(format!(
                    "learning took more than {minutes} minutes and was ended; use a shorter recording"
                ));
            }
            None if status.success() => return Ok(()),
            None => {}
        }
        let said = files::read(errors, files::MAX_NOTE_BYTES).unwrap_or_default();
        let said = String::from_utf8_lossy(&said);
        #[cfg(target_os = "linux")]
        if said.contains("memory allocation of") {
            return Err(format!(
                "learning needed more than {} GiB of memory and was ended; check the numbers of the recording, or \
                 use a shorter one",
                MAX_BYTES >> 30
            ));
        }
        // Warnings come before the error, its help is indented, and after it comes what a panic leaves.
        let mut lines = said.lines().skip_while(|line| !line.starts_with(ERROR));
        let first = lines.next().into_iter();
        let lines = first.chain(lines.take_while(|line| line.starts_with(' ')));
        let error = lines.flat_map(str::split_whitespace).skip(1);
        let error = error.collect::<Vec<_>>().join(" ");
        // The page has no flags.
        let error = error.split("; --").next().unwrap_or_default();
        Err(match error.chars().take(MAX_LETTERS).collect::<String>() {
            error if error.is_empty() => format!("the process that learned it ended early ({status})"),
            error => error,
        })
    }
}

/// Limits the memory of the process, and its time even if this program ends before it. The limit on memory counts what can be
/// written, unlike that on addresses, which allocators reserve for each thread.
#[cfg(target_os = "linux")]
fn limit(child: &Child) {
    use rustix::process::{Pid, Resource, Rlimit, prlimit};
    let pid = i32::try_from(child.id()).ok().and_then(Pid::from_raw);
    let cores = std::thread::available_parallelism().map_or(1, usize::from) as u64;
    for (resource, most) in
        [(Resource::Data, MAX_BYTES), (Resource::Cpu, cores * LONGEST.as_secs()), (Resource::Core, 0)]
    {
        let maximum = Some(most);
        // One that has ended already.
        let _ = prlimit(pid, resource, Rlimit { current: maximum, maximum });
    }
}

#[cfg(not(target_os = "linux"))]
fn limit(_: &Child) {}

/// Writes a surface to a new file named `stem` in `folder`.
fn keep(surface: &[u8], folder: &Path, stem: &str) -> Result<PathBuf, String> {
    let failed = |error: io::Error| format!("cannot write the surface: {error}");
    let mut file = tempfile::NamedTempFile::new_in(folder).map_err(failed)?;
    file.write_all(surface).map_err(failed)?;
    make_readable(file.as_file()).map_err(failed)?;
    for path in paths(folder, stem) {
        match file.persist_noclobber(&path) {
            Ok(_) => return Ok(path),
            Err(error) if error.error.kind() == io::ErrorKind::AlreadyExists => file = error.file,
            Err(error) => return Err(failed(error.error)),
        }
    }
    Err(FULL.to_owned())
}

/// Temporary files are private; surfaces get the permissions of ordinary files.
#[cfg(unix)]
fn make_readable(file: &File) -> io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    file.set_permissions(std::fs::Permissions::from_mode(0o644))
}

#[cfg(not(unix))]
fn make_readable(_: &File) -> io::Result<()> {
    Ok(())
}

#[cfg(unix)]
#[cfg(test)]
mod tests {
    use super::*;

    fn learn(learner: Learner) -> (Learning, std::thread::JoinHandle<Result<(), String>>, tempfile::TempDir) {
        let (learning, folder) = (Learning::default(), tempfile::tempdir().expect("a folder"));
        let turn = learning.begin(1, 2).expect("nothing is learned");
        let path = folder.path().to_owned();
        let dropped = Dropped {
            name: "x.csv".to_owned(),
            csv: "a".to_owned(),
            mapping: Default::default(),
            reads: false,
        };
        let thread = std::thread::spawn(move || turn.surface(learner, &dropped, &path).map(drop));
        (learning, thread, folder)
    }

    fn shell(script: &str) -> io::Result<Command> {
        let mut command = Command::new("sh");
        command.args(["-c", script]);
        Ok(command)
    }

    #[test]
    fn a_process_that_fails_says_why_and_leaves_nothing() {
        let learners: [(Learner, &str); 4] = [
            (
                |_, _, _| {
                    shell(
                        "echo 'warning: w' >&2; echo 'error: x.csv:7: bad' >&2; echo '  help: mend it' >&2; echo 'stack' >&2; exit 1",
                    )
                },
                "x.csv:7: bad help: mend it",
            ),
            (|_, _, _| shell("kill -KILL $$"), "signal: 9"),
            (|_, _, _| Ok(Command::new("/nowhere/at/all")), "cannot start"),
            (|_, _, _| shell("true"), "cannot read"),
        ];
        for (learner, why) in learners {
            let (learning, thread, folder) = learn(learner);
            let error = thread.join().expect("no panic").expect_err("it fails");
            assert!(error.contains(why) && !error.contains("stack"), "{error}");
            assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 0);
            assert!(learning.begin(1, 3).is_some(), "the next one may begin");
        }
    }

    #[test]
    fn learning_is_cancelled_by_its_own_page_and_request_only() {
        let (learning, thread, _folder) = learn(|_, _, _| shell("exec sleep 600"));
        assert!(learning.begin(1, 3).is_none(), "one at a time");
        learning.cancel(2, None);
        learning.cancel(1, Some(3));
        assert_eq!(learning.running().as_ref().and_then(|running| running.end), None);
        learning.cancel(1, Some(2));
        let error = thread.join().expect("no panic").expect_err("it was cancelled");
        assert!(error.contains("cancelled"), "{error}");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn what_takes_too_much_memory_ends_alone() {
        // It says what Rust says, once it has the limit.
        let (_learning, thread, _folder) = learn(|_, _, _| {
            shell(
                "until [ $(ulimit -d) = 2097152 ]; do sleep 0.01; done; echo 'memory allocation of 9 bytes failed' >&2; kill -ABRT $$",
            )
        });
        let error = thread.join().expect("no panic").expect_err("it fails");
        assert!(error.contains("2 GiB"), "{error}");
    }
}
