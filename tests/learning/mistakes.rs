//! What users got wrong, and what they are told.

use super::{column, fail, haptograph, noise, told_by, wav, workshop};
use serde_json::Value;
use std::fs;

#[test]
fn what_a_user_got_wrong_is_said_before_the_work() {
    let folder = workshop();
    fs::write(folder.join("file"), "").unwrap();
    fs::write(folder.join("empty.csv"), "").unwrap();
    for (arguments, said) in [
        (&["learn", "tap.npz", "-o", "x.ron", "--report", "file"][..], "file is a file; give a folder"),
        (&["learn", "tap.npz", "-o", "nowhere/x.ron"], "cannot write nowhere/x.ron"),
        (&["learn", "tap.npz", "-o", "x.txt"], ".ron"),
        (&["learn", "tap.npz", "./tap.npz", "-o", "x.ron"], "are the same recording"),
        (&["surface", "convert", "t1.ron", "t1.ron"], "would be overwritten"),
        (
            &["learn", "tap.npz", "study/T1.anna.1.npz", "-o", "x.ron", "--rate", "1"],
            "study/T1.anna.1.npz cannot be processed",
        ),
        (&["segment", "empty.csv", "--column", "x"], "the file is empty"),
        (&["learn", "empty.csv", "-o", "x.ron"], "the file is empty"),
        (
            &["surface", "resample", "t1.ron", "--rate", "45", "--method", "spectral", "-o", "x.ron"],
            "give a rate above 50 Hz",
        ),
    ] {
        let error = fail(folder, arguments);
        assert!(error.contains(said), "{arguments:?}: {error}");
    }
    for (arguments, said) in [
        (&["learn", "tap.npz", "-o", "x.ron", "--name", " "][..], "the name is empty"),
        (&["simulate-recording", "--material", "T1", "--motion", "tap", "-o", "x.wav"], ".npz"),
        (
            &["simulate-recording", "--material", "T1", "--motion", "tap", "--seconds", "-5", "-o", "x.npz"],
            "from 0.1 to 3600",
        ),
        (&["segment", "x.csv", "--column", "x", "--seed", "3"], "--seed is for --method genetic"),
        (&["segment", "x.csv", "--column", "x", "--time-limit", "3"], "--time-limit is for --method genetic"),
    ] {
        let output = haptograph(folder, arguments, "");
        let error = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {error}");
        assert!(error.contains(said), "{arguments:?}: {error}");
    }
    assert!(!folder.join("x.ron").exists());
}

#[test]
fn what_is_passed_over_or_overruled_is_said() {
    let folder = workshop();
    let forced =
        haptograph(folder, &["learn", "study/T1.anna.1.npz", "--circle", "tap.npz", "-o", "forced.ron"], "");
    let warned = String::from_utf8_lossy(&forced.stderr);
    assert!(warned.contains("tap.npz states that it is a tap; it is read as a circle"), "{warned}");

    let rows: String = noise(3000, 1).iter().map(|a| format!("{a},1,2,60\n")).collect();
    let header = "# rate_hz: 10000\naccel_m_s2,force_nromal_n,force_normal_n,speed_mm_s\n";
    fs::write(folder.join("typo.csv"), format!("{}{rows}", header.replace("force_nromal", "forc_normal")))
        .unwrap();
    let learned = haptograph(folder, &["learn", "typo.csv", "-o", "typo.ron"], "");
    let warned = String::from_utf8_lossy(&learned.stderr);
    assert!(warned.contains("\"forc_normal_n\" (did you mean force_normal_n?)"), "{warned}");
}

#[test]
fn a_column_that_is_there_twice_is_shown_at_its_place() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("twice.csv"), "x,y,x\n1,2,3\n").unwrap();
    for arguments in [
        &["segment", "twice.csv", "--column", "x"][..],
        &["compare", "twice.csv", "twice.csv", "--column", "y"],
        &["learn", "twice.csv", "-o", "x.ron"],
    ] {
        let error = fail(folder.path(), arguments);
        for part in ["column name x occurs twice", "twice.csv:1:5", "x,y,x", "^"] {
            assert!(error.contains(part), "{arguments:?}: {part} is missing: {error}");
        }
    }
}

#[test]
fn surfaces_of_one_name_are_not_merged_in_silence() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["a.ron", "b.ron"] {
        fs::copy(workshop().join("t1.ron"), folder.path().join(name)).unwrap();
    }
    let selected = haptograph(folder.path(), &["surface", "select", ".", "--count", "1", "--json"], "");
    let warned = String::from_utf8_lossy(&selected.stderr);
    assert!(
        warned.contains("under one name") && warned.contains("a.ron") && warned.contains("b.ron"),
        "{warned}"
    );
}

#[test]
fn comparisons_without_a_number_say_why() {
    let folder = tempfile::tempdir().unwrap();
    let signal = noise(3000, 1);
    let scaled = |factor: f64| signal.iter().map(|x| factor * x).collect::<Vec<_>>();
    for (file, name, factor) in [
        ("a.csv", "accel_m_s2", 1.0),
        ("louder.csv", "accel_m_s2", 3.0),
        ("huge.csv", "accel_m_s2", 1e300),
        ("force.csv", "force_normal_n", 2.0),
        ("plain.csv", "level", 2.0),
    ] {
        column(&folder.path().join(file), name, &scaled(factor));
    }
    let compare =
        |b: &str| haptograph(folder.path(), &["compare", "a.csv", b, "--rate", "10000", "--json"], "");
    let output = compare("louder.csv");
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(found["SD"].is_null() && found["reason"].as_str().unwrap().contains("--deviations"));
    assert!(output.stderr.is_empty());
    let said = |b: &str| told_by(&compare(b));
    assert!(said("huge.csv").contains("at most 1e10 m/s2"), "{}", said("huge.csv"));
    assert!(
        said("force.csv").contains("is in m/s2") && said("force.csv").contains("in N"),
        "{}",
        said("force.csv")
    );
    assert!(said("plain.csv").contains("plain.csv does not state its unit"), "{}", said("plain.csv"));

    wav(&folder.path().join("whole.wav"), 10_000, signal);
    let whole = fs::read(folder.path().join("whole.wav")).unwrap();
    for (bytes, said) in [(20, "within its header"), (5000, "announces 3000 frames")] {
        fs::write(folder.path().join("short.wav"), &whole[..bytes]).unwrap();
        let error = fail(folder.path(), &["compare", "short.wav", "a.csv"]);
        assert!(error.contains(said), "{error}");
    }
}

#[test]
fn what_is_wrong_in_a_surface_file_is_shown_at_its_place() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("bad.xml"), "<modelSet>\n  <mu>slippery</mu>\n</modelSet>\n").unwrap();
    let told = fail(folder.path(), &["surface", "show", "bad.xml"]);
    assert!(told.contains("bad.xml:2:") && told.contains("slippery"), "{told}");
    assert!(fail(folder.path(), &["surface", "show", "none.ron"]).contains("none.ron"));
}

#[test]
fn every_command_reads_the_tables_that_learn_reads() {
    let folder = tempfile::tempdir().unwrap();
    let study = folder.path().join("study");
    fs::create_dir(&study).unwrap();
    for take in 1..3_u8 {
        let rows = noise(20_000, take.into());
        let rows: String = rows
            .iter()
            .enumerate()
            .map(|(i, a)| format!("{};{};1;{}\n", i as f64 / 10.0, a / 9.80665, 50 + i / 200))
            .collect();
        let text = format!("Logger 7\n\nt;acc;Fz;v\nms;g;N;mm/s\n{rows}");
        fs::write(study.join(format!("leder.anna.{take}.csv")), text).unwrap();
    }
    let mapping =
        ["--column", "time=t", "--column", "accel=acc", "--column", "force_normal=Fz", "--column", "speed=v"];
    let with = |arguments: &[&str]| haptograph(folder.path(), &[arguments, &mapping[..]].concat(), "");
    let (one, two) = ("study/leder.anna.1.csv", "study/leder.anna.2.csv");
    let learned = with(&["learn", one, "-o", "leder.ron", "--json"]);
    let learned: Value = serde_json::from_slice(&learned.stdout).unwrap();
    assert!(learned["coverage"]["used_s"].as_f64().unwrap() > 1.0, "{learned}");
    assert!(!learned["warnings"].as_array().unwrap().is_empty(), "two seconds are few: {learned}");
    let compared = with(&["compare", one, two, "--json"]);
    let compared: Value = serde_json::from_slice(&compared.stdout).unwrap();
    assert!(compared["rate_hz"] == 10_000.0 && compared["lsd_db"].as_f64().unwrap() > 0.0);
    let column = ["compare", one, one, "--column", "acc", "--column", "time=t", "--json"];
    let column = haptograph(folder.path(), &column, "");
    let column: Value = serde_json::from_slice(&column.stdout).unwrap();
    assert!(column["lsd_db"] == 0.0 && column["rate_hz"] == 10_000.0, "{column}");
    let held_out = with(&["evaluate", "study", "--holdout", "--json"]);
    assert!(held_out.status.success(), "{}", told_by(&held_out));
    fs::remove_file(folder.path().join(two)).unwrap();
    assert!(told_by(&with(&["evaluate", "study"])).contains("--holdout"));
    let unsaid = fail(folder.path(), &["learn", one, "-o", "x.ron"]);
    assert!(
        unsaid.contains("missing columns: force_normal, speed, time. The file has: t, acc, Fz, v.")
            && !unsaid.contains("not used"),
        "{unsaid}"
    );
}

#[test]
fn a_wav_file_without_a_unit_is_compared_with_a_warning_or_its_full_scale() {
    let folder = tempfile::tempdir().unwrap();
    let signal = noise(20_000, 1);
    wav(&folder.path().join("a.wav"), 10_000, signal.iter().map(|x| x / 8.0));
    column(&folder.path().join("a.csv"), "accel_m_s2", &signal);
    let compare = |more: &[&str]| {
        let arguments = [&["compare", "a.wav", "a.csv", "--rate", "10000", "--json"], more].concat();
        let output = haptograph(folder.path(), &arguments, "");
        let found: Value = serde_json::from_slice(&output.stdout).unwrap();
        (found["lsd_db"].as_f64().unwrap(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let (lsd_db, warned) = compare(&[]);
    assert!(
        lsd_db > 15.0 && warned.contains("a.wav does not state its unit") && warned.contains("--full-scale")
    );
    let (lsd_db, warned) = compare(&["--full-scale", "8"]);
    assert!(lsd_db < 1e-3 && warned.is_empty(), "{lsd_db}: {warned}");
}

#[test]
fn implausible_speeds_are_said_once_without_advice_on_coverage() {
    let folder = tempfile::tempdir().unwrap();
    let rows: String =
        noise(20_000, 1).iter().enumerate().map(|(i, a)| format!("{a},1,{}\n", 50 + i / 500)).collect();
    let text = format!("# rate_hz: 10000\naccel_m_s2,force_normal_n,speed_m_s\n{rows}");
    fs::write(folder.path().join("fast.csv"), text).unwrap();
    let learned = haptograph(folder.path(), &["learn", "fast.csv", "-o", "fast.ron"], "");
    let warned = String::from_utf8_lossy(&learned.stderr);
    assert!(warned.contains("fast.csv: the largest speed in column \"speed_m_s\" is 89 m/s"), "{warned}");
    assert_eq!(warned.matches("--unit speed=mm/s").count(), 1, "{warned}");
    assert!(!String::from_utf8_lossy(&learned.stdout).contains("record next"));
}

/// Files that are empty, cut off, of another kind or nearly the right name: what is said of each, by every reader.
#[test]
fn a_file_that_cannot_be_read_says_what_it_is() {
    let (folder, shop) = (tempfile::tempdir().unwrap(), workshop());
    let (folder, at) = (folder.path(), |name: &str| folder.path().join(name));
    let header = "accel_m_s2,force_normal_n,speed_mm_s\n";
    let rows = |a: &str| format!("{a},1,80\n").repeat(3000);
    let surface = fs::read_to_string(shop.join("t1.ron")).unwrap();
    let archive = fs::read(shop.join("tap.npz")).unwrap();
    for (name, text) in [
        ("empty.npz", String::new()),
        ("header.csv", format!("# rate_hz: 10000\n{header}")),
        ("one.csv", format!("time_s,{header}0,1,1,80\n")),
        ("none.csv", rows("0.5")),
        ("still.csv", format!("# rate_hz: 10000\n{header}{}", rows("0"))),
        ("turned.csv", format!("# rate_hz: 10000\n{header}{}", rows("1\n-1").replace(",1,", ",-1,"))),
        ("cut.ron", surface[..surface.len() / 2].to_owned()),
        ("tile.ron", surface),
        (
            "pad.ron",
            fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/graphs/texturepad.ron")).unwrap(),
        ),
        ("cut.xml", "<modelSet texture=\"x\">".to_owned()),
    ] {
        fs::write(at(name), text).unwrap();
    }
    fs::write(at("cut.npz"), &archive[..archive.len() / 2]).unwrap();
    wav(&at("whole.wav"), 10_000, noise(3000, 1));
    let whole = fs::read(at("whole.wav")).unwrap();
    fs::write(at("cut.wav"), &whole[..5000]).unwrap();
    fs::write(at("cut-header.wav"), &whole[..20]).unwrap();
    fs::create_dir(at("takes")).unwrap();
    let learn = |file: &'static str| vec!["learn", file, "-o", "x.ron", "--full-scale", "20"];
    let show = |file: &'static str| vec!["surface", "show", file];
    let played = |set: &'static str| vec!["check", "pad.ron", "--set", set];
    let batch = |file: &'static str| vec!["batch", file, "--check"];
    for (arguments, parts) in [
        (learn("empty.npz"), &["the file is empty", "0 bytes"][..]),
        (learn("header.csv"), &["a header, but no row", "header.csv:2:1"]),
        (learn("one.csv"), &["one row only"]),
        (learn("none.csv"), &["the table has no header"]),
        (learn("still.csv"), &["still.csv has no vibration", "accelerometer connected"]),
        (learn("tile.ron"), &["it is a surface, not a recording"]),
        (learn("pad.ron"), &["it is a graph, not a recording"]),
        (learn("cut.npz"), &["cut off or damaged"]),
        (learn("cut.wav"), &["announces 3000 samples", "haptograph recover"]),
        (learn("cut-header.wav"), &["ends within its header"]),
        (learn("headr.csv"), &["there is no such file; did you mean `header.csv`?"]),
        (learn("nowhere/a.csv"), &["there is no folder nowhere"]),
        (
            vec!["learn", "takes", "-o", "x.ron"],
            &["takes is a folder, and x.ron is one surface", "--by material"],
        ),
        (show("cut.ron"), &["the file is incomplete: it ends inside a list"]),
        (show("cut.xml"), &["the file is incomplete: it ends inside <modelSet>"]),
        (show("empty.npz"), &["is a recording, not a surface"]),
        (show("tlie.ron"), &["did you mean `tile.ron`?"]),
        (show("pad.ron"), &["begins with `Graph`", "`Surface(`", "pad.ron:9:1"]),
        (
            played("surface=still.csv"),
            &["still.csv is a recording, not a surface", "haptograph learn still.csv"],
        ),
        (played("surface=cut.ron"), &["the file is incomplete"]),
        (played("surface=tlie.ron"), &["there is no such file; did you mean `tile.ron`?"]),
        (batch("pad.ron"), &["begins with `Graph`", "`Batch(`"]),
        (vec!["evaluate", "one.csv"], &["it is a file, not a folder"]),
        (vec!["segment", "header.csv", "--column", "accel_m_s2"], &["a header, but no row"]),
        (vec!["compare", "header.csv", "one.csv"], &["a header, but no row"]),
        (vec!["check", "pda.ron"], &["did you mean `pad.ron`?"]),
    ] {
        let said = fail(folder, &arguments);
        parts.iter().for_each(|part| assert!(said.contains(part), "{arguments:?}: {part}: {said}"));
        assert!(!at("x.ron").exists(), "{arguments:?}");
    }
    for seed in ["-1", "1.5", "x"] {
        let refused = haptograph(folder, &["run", "pad.ron", "--seed", seed], "");
        assert_eq!(refused.status.code(), Some(2));
        assert!(told_by(&refused).contains("give a whole number from 0 to 18446744073709551615"));
    }
}

#[test]
fn files_of_one_kind_given_for_another_are_named() {
    let folder = tempfile::tempdir().unwrap();
    column(&folder.path().join("x.csv"), "accel_m_s2", &noise(100, 1));
    let shown = fail(folder.path(), &["surface", "show", "x.csv"]);
    assert!(
        shown.contains("x.csv is a recording, not a surface") && shown.contains("learn x.csv"),
        "{shown}"
    );
    let spelled = fail(folder.path(), &["learn", "x.csv", "-o", "x.ron", "--column", "spede=v"]);
    assert!(spelled.contains("did you mean speed?"), "{spelled}");
    // The name that a file has until it is whole is nobody's business.
    let converted = fail(workshop(), &["surface", "convert", "t1.ron", "warped.xml"]);
    assert!(converted.contains("warped.xml") && !converted.contains(".haptograph-"), "{converted}");
    fs::copy(workshop().join("t1.ron"), folder.path().join("t1.ron")).unwrap();
    fs::write(folder.path().join("x.csv.ron"), "Recording(simulated: true)").unwrap();
    let selected = haptograph(folder.path(), &["surface", "select", ".", "--count", "1", "--json"], "");
    assert!(selected.status.success() && selected.stderr.is_empty(), "{}", told_by(&selected));
}

/// A drag of two seconds as a table, with its speed in mm/s.
fn drag(rate_hz: u32, speed: &str) -> String {
    let rows: String = (noise(2 * rate_hz as usize, 1).iter()).map(|a| format!("{a},1,80\n")).collect();
    format!("# rate_hz: {rate_hz}\naccel_m_s2,force_normal_n,speed_mm_s\n{rows}0,1,{speed}\n")
}

#[test]
fn numbers_without_bounds_are_refused_where_they_stand() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("speed.csv"), drag(1000, "1e308")).unwrap();
    fs::write(at("rate.csv"), drag(1000, "80").replace("1000", "1e12")).unwrap();
    fs::write(
        at("times.csv"),
        "time_s,accel_m_s2,force_normal_n,speed_mm_s\n0,1,1,80\n1e-12,2,1,80\n2e-12,1,1,80\n",
    )
    .unwrap();
    let surface = fs::read_to_string(workshop().join("t1.ron")).unwrap();
    let fast = surface.replacen("rate_hz: 10000.0", "rate_hz: 1e12", 1);
    assert_ne!(fast, surface);
    fs::write(at("fast.ron"), fast).unwrap();
    for (arguments, said) in [
        (&["learn", "speed.csv", "-o", "x.ron", "--report", "r"][..], &["speed.csv:2003:", "100 m/s"][..]),
        (&["learn", "rate.csv", "-o", "x.ron", "--report", "r"], &["rate.csv", "1e12", "from 1 Hz to 1 MHz"]),
        (&["learn", "times.csv", "-o", "x.ron", "--report", "r"], &["times.csv", "from 1 Hz to 1 MHz"]),
        (&["surface", "show", "fast.ron"], &["fast.ron", "1e12 Hz", "from 1 Hz to 1 MHz"]),
    ] {
        let error = fail(folder.path(), arguments);
        assert!(said.iter().all(|said| error.contains(said)), "{arguments:?}: {error}");
        assert!(!at("x.ron").exists() && !at("r").exists(), "{arguments:?}");
    }
}

#[test]
fn a_rate_that_is_too_low_is_refused_accepted_or_said() {
    let folder = tempfile::tempdir().unwrap();
    for rate_hz in [100, 400, 1000, 5000] {
        fs::write(folder.path().join(format!("{rate_hz}.csv")), drag(rate_hz, "80")).unwrap();
    }
    let learn = |name: &str, more: &[&str]| {
        let arguments = [&["learn", name, "-o", "x.ron", "--force", "--json"], more].concat();
        haptograph(folder.path(), &arguments, "")
    };
    for (name, is_refused, highest_hz) in [
        ("100.csv", true, Some(45.0)),
        ("400.csv", true, Some(180.0)),
        ("1000.csv", false, Some(450.0)),
        ("5000.csv", false, None),
    ] {
        let strict = learn(name, &[]);
        assert_eq!(strict.status.code(), Some(i32::from(is_refused)), "{name}");
        assert!(!is_refused || told_by(&strict).contains("--accept-rate"), "{name}");
        let accepted = learn(name, &["--accept-rate"]);
        let told: Value = serde_json::from_slice(&accepted.stdout).unwrap();
        let warnings = told["warnings"].to_string();
        let says = highest_hz.is_none_or(|hz: f64| warnings.contains(&format!("above {hz} Hz")));
        assert!(says && warnings.contains("samples per second") == highest_hz.is_some(), "{warnings}");
        let used_s = told["coverage"]["used_s"].as_f64().unwrap();
        assert!((1.8..=2.0).contains(&used_s), "{used_s}");
        let shown = haptograph(folder.path(), &["surface", "show", "x.ron", "--json"], "");
        let shown: Value = serde_json::from_slice(&shown.stdout).unwrap();
        assert_eq!(shown["highest_hz"].as_f64(), highest_hz);
    }
}
