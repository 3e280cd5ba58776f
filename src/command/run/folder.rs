//! The folder of a run: made beside its target and put in its place when it is complete, so that what is found there
//! is always whole.

use super::super::Failure;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// A folder that is being filled; removed if it is not put in place.
#[derive(Debug)]
pub struct RunFolder {
    temporary: TempDir,
    content: PathBuf,
}

/// Every run leaves this file: a folder without it was not made by a run and is not replaced.
pub const MARK: &str = "run.json";

impl RunFolder {
    /// An empty folder on the same file system as `target`, which must be free, or left by an earlier run.
    pub fn beside(target: &Path) -> Result<Self, Failure> {
        refuse_foreign(target)?;
        let parent = match target.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent.to_owned(),
            _ => PathBuf::from("."),
        };
        fs::create_dir_all(&parent).map_err(|error| Failure::file("make the folder", &parent, &error))?;
        let made = tempfile::Builder::new()
            .prefix(".haptograph-")
            .tempdir_in(&parent)
            .and_then(|temporary| {
                let content = temporary.path().join("run");
                fs::create_dir(&content)?;
                fs::create_dir(temporary.path().join("probes"))?;
                Ok(Self { temporary, content })
            });
        made.map_err(|error| Failure::file("make a folder in", &parent, &error))
    }

    /// Where the run's files go.
    pub fn path(&self) -> &Path {
        &self.content
    }

    /// Where probes wait until the run is complete; one folder each.
    pub fn probe(&self, number: usize) -> Result<PathBuf, Failure> {
        let path = self.temporary.path().join("probes").join(number.to_string());
        fs::create_dir_all(&path).map_err(|error| Failure::file("make the folder", &path, &error))?;
        Ok(path)
    }

    /// Adds a file.
    pub fn write(&self, name: &str, text: &str) -> Result<(), Failure> {
        let path = self.content.join(name);
        fs::write(&path, text).map_err(|error| Failure::file("write", &path, &error))
    }

    /// Replaces what an earlier run left at `target`; what it recorded of real devices is kept beside it, and where is
    /// returned.
    pub fn put_in_place(self, target: &Path) -> Result<Option<PathBuf>, Failure> {
        refuse_foreign(target)?;
        let kept = holds_what_cannot_be_repeated(target).then(|| free_beside(target));
        let old = kept.clone().unwrap_or_else(|| self.temporary.path().join("old"));
        let failed = |error| Failure::file("put the run in place at", target, &error);
        if target.exists() {
            fs::rename(target, &old).map_err(failed)?;
        }
        fs::rename(&self.content, target).map_err(|error| {
            // Give the earlier run back; if that fails too, the first error is the one to tell.
            let _ = fs::rename(&old, target);
            failed(error)
        })?;
        Ok(kept)
    }
}

/// A live run of real devices can hold somebody's hour.
fn holds_what_cannot_be_repeated(target: &Path) -> bool {
    let facts = fs::read_to_string(target.join(MARK)).ok();
    let facts = facts.and_then(|text| serde_json::from_str::<serde_json::Value>(&text).ok());
    facts.is_some_and(|facts| facts["live"] == true && facts["real_devices"] == true)
}

/// The folder's name with the first number behind it that is free.
fn free_beside(target: &Path) -> PathBuf {
    let name = target.file_name().unwrap_or_default().to_string_lossy();
    let numbered = (1_u64..).map(|number| target.with_file_name(format!("{name}-{number}")));
    let mut free = numbered.filter(|path| !path.exists());
    free.next().unwrap_or_else(|| target.with_extension("kept"))
}

fn refuse_foreign(target: &Path) -> Result<(), Failure> {
    let Ok(mut entries) = fs::read_dir(target) else {
        return if target.exists() {
            Err(Failure::Message(format!(
                "{} is not a folder; give another one by --out",
                target.display()
            )))
        } else {
            Ok(())
        };
    };
    if entries.next().is_some() && !target.join(MARK).is_file() {
        let message = format!(
            "{} holds files that no run made; give another folder by --out",
            target.display()
        );
        return Err(Failure::Message(message));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_live_run_of_real_devices_is_kept_and_others_are_replaced() {
        let parent = tempfile::tempdir().unwrap();
        let target = parent.path().join("out");
        let run = |facts: &str| {
            let folder = RunFolder::beside(&target).unwrap();
            folder.write(MARK, facts).unwrap();
            folder.put_in_place(&target).unwrap()
        };
        // A real stylus and a simulated actuator.
        let real = r#"{"live": true, "simulated": true, "real_devices": true}"#;
        assert_eq!(run(r#"{"simulated": false, "real_devices": true}"#), None);
        assert_eq!(
            run(r#"{"live": true, "simulated": true, "real_devices": false}"#),
            None
        );
        // No device at all.
        assert_eq!(
            run(r#"{"live": true, "simulated": false, "real_devices": false}"#),
            None
        );
        assert_eq!(run(real), None);
        assert_eq!(run(real), Some(parent.path().join("out-1")));
        assert_eq!(run("{}"), Some(parent.path().join("out-2")));
        assert_eq!(run("{}"), None);
        assert_eq!(
            fs::read_to_string(parent.path().join("out-2/run.json")).unwrap(),
            real
        );
    }
}
