//! Tests of the folders that a run may find at its target.

use super::commit::Placed;
use super::*;
use crate::cli::Failure;

fn run(target: &Path, files: &[(&str, &str)]) -> Result<Placed, Failure> {
    let folder = RunFolder::beside(target)?;
    for (name, text) in files {
        fs::create_dir_all(folder.path().join(name).parent().unwrap()).unwrap();
        folder.write(name, text).unwrap();
    }
    folder.commit(&[], Force::default()).map(|(placed, _)| placed)
}

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    let mut names: Vec<String> =
        entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn a_live_run_of_real_devices_is_kept_and_others_are_replaced() {
    let parent = tempfile::tempdir().unwrap();
    let target = parent.path().join("out");
    let run = |facts: &str| run(&target, &[(MARK, facts)]).unwrap().earlier;
    let kept = |name: &str| Some(parent.path().canonicalize().unwrap().join(name));
    // A real stylus and a simulated actuator.
    let real = r#"{"live": true, "simulated_devices": true, "real_devices": true}"#;
    assert_eq!(run(r#"{"simulated_devices": false, "real_devices": true}"#), None);
    assert_eq!(run(r#"{"live": true, "simulated_devices": true, "real_devices": false}"#), None);
    // No device.
    assert_eq!(run(r#"{"live": true, "simulated_devices": false, "real_devices": false}"#), None);
    assert_eq!(run(real), None);
    assert_eq!(run(real), kept("out-1"));
    assert_eq!(run("{}"), kept("out-2"));
    assert_eq!(run("{}"), None);
    assert_eq!(fs::read_to_string(parent.path().join("out-2/run.json")).unwrap(), real);
    assert_eq!(names(parent.path()), ["out", "out-1", "out-2"]);
}

#[test]
fn a_run_of_which_nothing_says_any_more_that_it_can_be_repeated_is_kept() {
    let parent = tempfile::tempdir().unwrap();
    let target = parent.path().join("out");
    let run = || run(&target, &[(MARK, "{}"), ("felt.csv", "1")]).unwrap().earlier;
    assert_eq!(run(), None);
    fs::remove_file(target.join(MARK)).unwrap();
    assert!(run().is_some_and(|kept| kept.ends_with("out-1")));
    fs::write(target.join(MARK), "{} and a note").unwrap();
    assert!(run().is_some_and(|kept| kept.ends_with("out-2")));
    assert_eq!(run(), None);
    assert_eq!(names(&parent.path().join("out-1")), ["felt.csv", MANIFEST]);
}

#[test]
fn files_of_others_stay_and_changed_ones_are_kept_beside() {
    let parent = tempfile::tempdir().unwrap();
    let target = parent.path().join("out");
    run(&target, &[(MARK, "{}"), ("a.csv", "1"), ("gone.csv", "1"), ("record/b.csv", "1")]).unwrap();
    fs::write(target.join("analysis.py"), "mine").unwrap();
    fs::write(target.join("a.csv"), "edited").unwrap();
    let placed = run(&target, &[(MARK, "{}"), ("a.csv", "2")]).unwrap();
    assert_eq!(names(&target), ["a-1.csv", "a.csv", "analysis.py", MANIFEST, MARK]);
    assert_eq!(fs::read_to_string(target.join("a.csv")).unwrap(), "2");
    assert_eq!(fs::read_to_string(target.join("a-1.csv")).unwrap(), "edited");
    let place = target.canonicalize().unwrap();
    assert_eq!(placed.left, [place.join("analysis.py")]);
    assert_eq!(placed.moved, [(place.join("a.csv"), place.join("a-1.csv"))]);
    assert_eq!(placed.lines().len(), 2);
    assert_eq!(names(parent.path()), ["out"]);
}

#[test]
fn nothing_is_lost_where_a_step_fails() {
    let parent = tempfile::tempdir().unwrap();
    let target = parent.path().join("out");
    run(&target, &[(MARK, "{}"), ("a.csv", "1")]).unwrap();
    let mut folder = RunFolder::beside(&target).unwrap();
    folder.begin();
    folder.write("a.csv", "2").unwrap();
    // A file blocks the place of the second replaced file.
    fs::create_dir(folder.path().join(REPLACED)).unwrap();
    fs::write(folder.path().join(REPLACED).join(MARK), "").unwrap();
    let waiting = folder.path().to_owned();
    assert!(folder.commit(&[], Force::default()).is_err());
    assert_eq!(fs::read_to_string(waiting.join("a.csv")).unwrap(), "2");
    assert_eq!(fs::read_to_string(target.join("a.csv")).unwrap(), "1");
    assert_eq!(names(&target), ["a.csv", MANIFEST, MARK]);
}

#[test]
fn runs_that_died_are_told_from_those_that_live() {
    let parent = tempfile::tempdir().unwrap();
    let target = parent.path().join("out");
    let living = RunFolder::beside(&target).unwrap();
    assert!(RunFolder::beside(&target).is_err(), "two runs into one folder");
    assert_eq!(dead_in(parent.path()), Vec::<PathBuf>::new());
    let waiting = living.path().to_owned();
    drop(living);
    assert!(!waiting.exists(), "nothing was recorded");
    let mut dead = RunFolder::beside(&target).unwrap();
    dead.begin();
    drop(dead);
    assert_eq!(names(parent.path()), ["out.partial-1"]);
    assert_eq!(dead_in(parent.path()).len(), 1);
    run(&target, &[(MARK, "{}")]).unwrap();
    assert_eq!(names(parent.path()), ["out", "out.partial-1"]);
}

#[cfg(unix)]
#[test]
fn links_are_not_followed_out_of_the_folder_and_the_folder_may_be_one() {
    let parent = tempfile::tempdir().unwrap();
    let (real, target) = (parent.path().join("real"), parent.path().join("out"));
    let elsewhere = parent.path().join("elsewhere");
    fs::create_dir(&real).unwrap();
    fs::create_dir(&elsewhere).unwrap();
    std::os::unix::fs::symlink(&real, &target).unwrap();
    run(&target, &[(MARK, "{}"), ("record/a", "1")]).unwrap();
    fs::rename(real.join("record"), parent.path().join("moved")).unwrap();
    std::os::unix::fs::symlink(&elsewhere, real.join("record")).unwrap();
    run(&target, &[(MARK, "{}"), ("record/a", "2")]).unwrap();
    assert!(target.is_symlink());
    assert_eq!(names(&real), [MANIFEST, "record", "record-1", MARK]);
    assert_eq!(fs::read_to_string(real.join("record/a")).unwrap(), "2");
    assert!(real.join("record-1").is_symlink() && names(&elsewhere).is_empty());
}

/// All files below a folder with their contents.
fn tree(folder: &Path) -> Vec<(PathBuf, String)> {
    let (mut found, mut folders) = (Vec::new(), vec![folder.to_owned()]);
    while let Some(next) = folders.pop() {
        for entry in fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            match path.is_dir() {
                true => folders.push(path),
                false => {
                    let name = path.strip_prefix(folder).unwrap().to_owned();
                    found.push((name, fs::read_to_string(&path).unwrap()));
                }
            }
        }
    }
    found.sort();
    found
}

/// Creates an earlier run with these facts and foreign files, then moves another run there and kills it after
/// `steps` steps. Returns true if the kill happened.
fn killed_after(steps: Option<u32>, facts: &str, parent: &Path) -> bool {
    let (target, probe) = (parent.join("out"), parent.join("probe.csv"));
    let earlier = [(MARK, facts), ("a.csv", "1"), ("gone.csv", "1"), ("record/b.csv", "1")];
    run(&target, &earlier).unwrap();
    fs::write(target.join("analysis.py"), "mine").unwrap();
    fs::write(target.join("a.csv"), "edited").unwrap();
    let mut folder = RunFolder::beside(&target).unwrap();
    folder.begin();
    for (name, text) in [(MARK, "{}"), ("a.csv", "2"), ("c.csv", "2"), ("record-b.csv", "2")] {
        folder.write(name, text).unwrap();
    }
    fs::write(folder.probe(0).unwrap().join("probe.csv"), "2").unwrap();
    STEPS_LEFT.set(steps);
    let moved = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
        folder.commit(&[probe], Force::default()).unwrap();
    }));
    STEPS_LEFT.set(None);
    moved.is_err()
}

#[test]
fn a_move_that_is_killed_at_any_step_is_completed_by_the_next_run() {
    for facts in ["{}", r#"{"live": true, "real_devices": true}"#] {
        let whole = tempfile::tempdir().unwrap();
        assert!(!killed_after(None, facts, whole.path()));
        let whole = tree(whole.path());
        let mut steps = 0;
        loop {
            let parent = tempfile::tempdir().unwrap();
            if !killed_after(Some(steps), facts, parent.path()) {
                break;
            }
            assert!(tree(parent.path()) != whole, "{steps}: nothing was left to do");
            drop(RunFolder::beside(&parent.path().join("out")).unwrap());
            assert_eq!(tree(parent.path()), whole, "{steps}");
            steps += 1;
        }
        assert!(steps > 8, "{steps}");
    }
}

#[test]
fn a_move_that_was_taken_back_is_not_completed() {
    let parent = tempfile::tempdir().unwrap();
    let target = parent.path().join("out");
    let mut folder = RunFolder::beside(&target).unwrap();
    folder.begin();
    folder.write("a.csv", "1").unwrap();
    fs::create_dir(&target).unwrap();
    fs::write(target.join("thesis.tex"), "mine").unwrap();
    let waiting = folder.path().to_owned();
    assert!(folder.commit(&[], Force::default()).is_err());
    fs::remove_file(target.join("thesis.tex")).unwrap();
    drop(RunFolder::beside(&target).unwrap());
    assert!(waiting.join("a.csv").is_file() && names(&target).is_empty());
}

#[test]
fn a_free_name_keeps_its_extension() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.wav");
    assert_eq!(free_beside(&path), path);
    fs::write(&path, "").unwrap();
    fs::create_dir(folder.path().join("x-1.wav")).unwrap();
    assert_eq!(free_beside(&path), folder.path().join("x-2.wav"));
}
