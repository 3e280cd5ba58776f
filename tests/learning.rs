//! Recordings, surfaces and signals, as users of the program handle them.

#![allow(clippy::unwrap_used)] // in helpers, clippy does not see that these are tests

use serde_json::Value;
use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;

/// Runs the program with something on its standard input.
fn haptograph(folder: &Path, arguments: &[&str], input: &str) -> Output {
    let mut child = Command::new(env!("CARGO_BIN_EXE_haptograph"))
        .args(arguments)
        .current_dir(folder)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    // A program that fails early does not read.
    let _ = child
        .stdin
        .take()
        .expect("it is piped")
        .write_all(input.as_bytes());
    child.wait_with_output().expect("the program ends")
}

fn succeed(folder: &Path, arguments: &[&str]) -> String {
    let output = haptograph(folder, arguments, "");
    assert!(
        output.status.success(),
        "{arguments:?}: {}",
        String::from_utf8_lossy(&output.stderr)
    );
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn json(folder: &Path, arguments: &[&str]) -> Value {
    serde_json::from_str(&succeed(folder, arguments)).expect("it is JSON")
}

fn fail(folder: &Path, arguments: &[&str]) -> String {
    let output = haptograph(folder, arguments, "");
    assert_eq!(output.status.code(), Some(1), "{arguments:?}");
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// White noise, the same on every machine.
fn noise(samples: usize, seed: u64) -> Vec<f64> {
    let mut source = haptograph::signal::noise::Gaussian::new(seed);
    (0..samples).map(|_| source.next_sample()).collect()
}

/// A column of numbers as a CSV file.
fn column(path: &Path, name: &str, values: &[f64]) {
    let rows: String = values.iter().map(|value| format!("{value}\n")).collect();
    fs::write(path, format!("{name}\n{rows}")).unwrap();
}

/// A folder with simulated recordings of two materials and a surface learned from all gestures, made once.
fn workshop() -> &'static Path {
    static FOLDER: OnceLock<tempfile::TempDir> = OnceLock::new();
    FOLDER
        .get_or_init(|| {
            let folder = tempfile::tempdir().unwrap();
            let simulate = |material: &str, motion: &str, person: &str, seed: &str, file: &str| {
                let arguments = [
                    "simulate-recording",
                    "--material",
                    material,
                    "--motion",
                    motion,
                    "--person",
                    person,
                ];
                // Taps are more than a second apart.
                let seconds = if motion == "tap" { "8" } else { "4" };
                let arguments = [
                    &arguments[..],
                    &["--seconds", seconds, "--seed", seed, "-o", file],
                ]
                .concat();
                succeed(folder.path(), &arguments);
            };
            fs::create_dir(folder.path().join("study")).unwrap();
            for material in ["T1", "T3"] {
                for (take, seed) in [("1", "11"), ("2", "12")] {
                    simulate(
                        material,
                        "drag",
                        "1",
                        seed,
                        &format!("study/{material}.anna.{take}.npz"),
                    );
                }
                simulate(
                    material,
                    "drag",
                    "2",
                    "13",
                    &format!("study/{material}.ben.1.npz"),
                );
            }
            for motion in ["circle", "tap", "press"] {
                simulate("T1", motion, "1", "11", &format!("{motion}.npz"));
            }
            let all = [
                "learn",
                "study/T1.anna.1.npz",
                "circle.npz",
                "tap.npz",
                "press.npz",
            ];
            succeed(
                folder.path(),
                &[&all[..], &["-o", "t1.ron", "--report", "page"]].concat(),
            );
            folder
        })
        .path()
}

#[test]
fn a_surface_is_learned_whole_and_again_to_the_bit() {
    let folder = workshop();
    let shown = json(folder, &["surface", "show", "t1.ron", "--json"]);
    for part in ["friction", "taps", "texture", "stiffness"] {
        assert!(shown[part].is_object(), "{part} is missing: {shown}");
    }
    assert_eq!(shown["provenance"]["origin"], "simulated");
    // The simulated material's own numbers: friction 0.18, stiffness 42.2 N/mm.
    assert!(
        (shown["friction"]["mu"].as_f64().unwrap() - 0.18).abs() < 0.03,
        "{}",
        shown["friction"]
    );
    assert!(
        (shown["stiffness"]["n_per_mm"].as_f64().unwrap() / 42.2 - 1.0).abs() < 0.1,
        "{}",
        shown["stiffness"]
    );
    assert!(!shown["taps"]["speeds_mm_s"].as_array().unwrap().is_empty());
    let again = [
        "learn",
        "study/T1.anna.1.npz",
        "circle.npz",
        "tap.npz",
        "press.npz",
        "-o",
        "again.ron",
        "--name",
        "t1",
    ];
    succeed(folder, &again);
    assert!(fs::read(folder.join("again.ron")).unwrap() == fs::read(folder.join("t1.ron")).unwrap());
    assert_eq!(
        shown["provenance"]["settings"]["recording 1 file"],
        "T1.anna.1.npz"
    );
}

#[test]
fn a_processed_table_is_enough_to_learn_from() {
    let folder = tempfile::tempdir().unwrap();
    let excitation = noise(20_000, 1);
    let mut y = [0.0; 2];
    let mut text =
        "# rate_hz: 10000\naccel_m_s2, force_normal_n, force_tangential_n, speed_mm_s\r\n".to_owned();
    for (i, e) in excitation.iter().enumerate() {
        // Four stretches of other speeds and forces, each with a loudness of its own.
        let (speed, force) = [(60.0, 0.5), (150.0, 1.0), (90.0, 2.0), (200.0, 1.5)][i / 5000];
        let next = 1.2 * y[0] - 0.7 * y[1] + speed * force / 100.0 * e;
        y = [next, y[0]];
        text += &format!("{next}, {force}, {}, {speed}\r\n", 0.4 * force);
    }
    fs::write(folder.path().join("processed.csv"), text).unwrap();
    succeed(
        folder.path(),
        &["learn", "processed.csv", "-o", "surface.ron", "--keep-outliers"],
    );
    let shown = json(folder.path(), &["surface", "show", "surface.ron", "--json"]);
    assert!((shown["friction"]["mu"].as_f64().unwrap() - 0.4).abs() < 1e-6);
    let measured = shown["texture"]["models"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|model| model["kind"] == "measured");
    let ar = measured
        .map(|model| model["ar"][0].as_f64().unwrap())
        .collect::<Vec<_>>();
    assert!(
        ar.len() >= 4 && ar.iter().all(|a| (a + 1.2).abs() < 0.1),
        "{ar:?}"
    );
}

#[test]
fn a_surface_without_friction_says_so_and_keeps_its_texture() {
    let folder = tempfile::tempdir().unwrap();
    let mut text = "# rate_hz: 10000\naccel_m_s2,force_normal_n,force_tangential_n,speed_mm_s\n".to_owned();
    for (i, a) in noise(8000, 1).iter().enumerate() {
        // The tool is pulled along: no friction does that.
        let (force, speed) = (1.0 + (i / 2000) as f64, 50.0 + 30.0 * (i / 2000 % 2) as f64);
        text += &format!("{a},{force},{},{speed}\n", -0.2 * force);
    }
    fs::write(folder.path().join("pulled.csv"), text).unwrap();
    let learned = haptograph(
        folder.path(),
        &["learn", "pulled.csv", "-o", "pulled.ron", "--report", "page"],
        "",
    );
    let (said, warned) = (
        String::from_utf8_lossy(&learned.stdout),
        String::from_utf8_lossy(&learned.stderr),
    );
    assert!(learned.status.success(), "{warned}");
    for part in [
        "so the surface has no friction",
        "pulling the tool along",
        "--circle",
    ] {
        assert!(warned.contains(part), "{part} is missing: {warned}");
    }
    assert!(said.contains("friction  none"), "{said}");
    let shown = json(folder.path(), &["surface", "show", "pulled.ron", "--json"]);
    assert!(shown["texture"].is_object() && shown["friction"].is_null());
    let settings = &shown["provenance"]["settings"];
    assert!(
        settings["not learned: friction"]
            .as_str()
            .unwrap()
            .contains("pulling"),
        "{settings}"
    );
    let page = fs::read_to_string(folder.path().join("page/report.html")).unwrap();
    assert!(page.contains("the surface has no friction"));
}

#[test]
fn what_a_user_got_wrong_is_said_before_the_work() {
    let folder = workshop();
    fs::write(folder.join("file"), "").unwrap();
    for (arguments, said) in [
        (
            &["learn", "tap.npz", "-o", "x.ron", "--report", "file"][..],
            "file is a file; give a folder",
        ),
        (
            &["learn", "tap.npz", "-o", "nowhere/x.ron"],
            "there is no folder nowhere",
        ),
        (&["learn", "tap.npz", "-o", "x.txt"], ".ron"),
        (
            &["learn", "tap.npz", "./tap.npz", "-o", "x.ron"],
            "are the same recording",
        ),
        (
            &[
                "surface", "resample", "t1.ron", "--rate", "45", "--method", "spectral", "-o", "x.ron",
            ],
            "give more than 50 Hz",
        ),
    ] {
        let error = fail(folder, arguments);
        assert!(error.contains(said), "{arguments:?}: {error}");
    }
    for (arguments, said) in [
        (
            &["learn", "tap.npz", "-o", "x.ron", "--name", " "][..],
            "needs a name",
        ),
        (
            &[
                "simulate-recording",
                "--material",
                "T1",
                "--motion",
                "tap",
                "-o",
                "x.wav",
            ],
            ".npz",
        ),
        (
            &[
                "simulate-recording",
                "--material",
                "T1",
                "--motion",
                "tap",
                "--seconds",
                "-5",
                "-o",
                "x.npz",
            ],
            "from 0.1 to 3600",
        ),
        (
            &["segment", "x.csv", "--column", "x", "--seed", "3"],
            "--seed is for --method genetic",
        ),
        (
            &["segment", "x.csv", "--column", "x", "--time-limit", "3"],
            "--time-limit is for --method genetic",
        ),
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
    let forced = haptograph(
        folder,
        &[
            "learn",
            "study/T1.anna.1.npz",
            "--circle",
            "tap.npz",
            "-o",
            "forced.ron",
        ],
        "",
    );
    let warned = String::from_utf8_lossy(&forced.stderr);
    assert!(
        warned.contains("tap.npz says of itself that it is a tap; it is taken as a circle"),
        "{warned}"
    );

    let rows: String = noise(3000, 1).iter().map(|a| format!("{a},1,2,60\n")).collect();
    let header = "# rate_hz: 10000\naccel_m_s2,force_nromal_n,force_normal_n,speed_mm_s\n";
    fs::write(
        folder.join("typo.csv"),
        format!("{}{rows}", header.replace("force_nromal", "forc_normal")),
    )
    .unwrap();
    let learned = haptograph(folder, &["learn", "typo.csv", "-o", "typo.ron"], "");
    let warned = String::from_utf8_lossy(&learned.stderr);
    assert!(
        warned.contains("column \"forc_normal_n\" is not understood")
            && warned.contains("did you mean force_normal_n?"),
        "{warned}"
    );
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
        for part in ["x is there twice", "twice.csv:1:5", "x,y,x", "^"] {
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
    let selected = haptograph(
        folder.path(),
        &["surface", "select", ".", "--count", "1", "--json"],
        "",
    );
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
    let compare = |b: &str| {
        haptograph(
            folder.path(),
            &["compare", "a.csv", b, "--rate", "10000", "--json"],
            "",
        )
    };
    let output = compare("louder.csv");
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(
        found["SD"].is_null()
            && found["reason"]
                .as_str()
                .unwrap()
                .contains("power error is the same")
    );
    assert!(output.stderr.is_empty());
    let said = |b: &str| String::from_utf8_lossy(&compare(b).stderr).into_owned();
    assert!(
        said("huge.csv").contains("check the units"),
        "{}",
        said("huge.csv")
    );
    assert!(
        said("force.csv").contains("is in m/s2") && said("force.csv").contains("in N"),
        "{}",
        said("force.csv")
    );
    assert!(
        said("plain.csv").contains("plain.csv does not say its unit"),
        "{}",
        said("plain.csv")
    );

    let mut whole = std::io::Cursor::new(vec![]);
    let spec = hound::WavSpec {
        channels: 1,
        sample_rate: 10_000,
        bits_per_sample: 32,
        sample_format: hound::SampleFormat::Float,
    };
    let mut writer = hound::WavWriter::new(&mut whole, spec).unwrap();
    signal
        .iter()
        .for_each(|&x| writer.write_sample(x as f32).unwrap());
    writer.finalize().unwrap();
    let whole = whole.into_inner();
    for (bytes, said) in [(20, "cut off"), (5000, "announces 3000 samples")] {
        fs::write(folder.path().join("short.wav"), &whole[..bytes]).unwrap();
        let error = fail(folder.path(), &["compare", "short.wav", "a.csv"]);
        assert!(error.contains(said), "{error}");
    }
}

#[test]
fn breaks_are_found_and_printed_as_agreed() {
    let folder = tempfile::tempdir().unwrap();
    // Process A of Auto-PARM: breaks after 512 and 768 samples.
    let mut y = vec![0.0, 0.0];
    for (t, e) in noise(1024, 4).into_iter().enumerate() {
        let (a, b) =
            [(0.9, 0.0), (1.69, -0.81), (1.32, -0.81)][usize::from(t >= 512) + usize::from(t >= 768)];
        y.push(a * y[t + 1] + b * y[t] + e);
    }
    let rows: String = y[2..]
        .iter()
        .enumerate()
        .map(|(i, y)| format!("{i}, \"{y}\"\r\n"))
        .collect();
    fs::write(folder.path().join("a.csv"), format!("time, \"y\"\r\n{rows}")).unwrap();
    let found = json(folder.path(), &["segment", "a.csv", "--column", "y", "--json"]);
    let keys: Vec<&String> = found.as_object().unwrap().keys().collect();
    assert_eq!(keys, ["breaks", "mdl", "orders"]);
    let breaks: Vec<i64> = found["breaks"]
        .as_array()
        .unwrap()
        .iter()
        .map(|b| b.as_i64().unwrap())
        .collect();
    assert!(
        breaks.len() == 2 && (breaks[0] - 512).abs() < 30 && (breaks[1] - 768).abs() < 30,
        "{breaks:?}"
    );
    assert_eq!(found["orders"].as_array().unwrap().len(), 3);
    let wide = json(
        folder.path(),
        &[
            "segment",
            "a.csv",
            "--column",
            "y",
            "--min-span",
            "600",
            "--max-order",
            "3",
            "--json",
        ],
    );
    assert_eq!(
        (
            wide["breaks"].as_array().unwrap().len(),
            wide["orders"].as_array().unwrap().len()
        ),
        (0, 1)
    );
    assert!(succeed(folder.path(), &["segment", "a.csv", "--column", "y"]).contains("segments            3"));

    fs::write(folder.path().join("bad.csv"), "a,y\r\n1,2\r\n3,x\r\n").unwrap();
    let told = fail(folder.path(), &["segment", "bad.csv", "--column", "y", "--json"]);
    assert!(told.contains("line 3, column 2"), "{told}");
    assert!(fail(folder.path(), &["segment", "bad.csv", "--column", "z"]).contains("there are a, y"));
}

#[test]
fn interpolation_is_the_model_at_vertices_and_saturates() {
    let folder = workshop();
    let shown = json(folder, &["surface", "show", "t1.ron", "--json"]);
    let models = shown["texture"]["models"].as_array().unwrap();
    let number = |value: &Value| value.as_f64().unwrap();
    let input: String = models
        .iter()
        .map(|model| format!("{} {}\n", model["speed_mm_s"], model["force_n"]))
        .collect();
    let output = haptograph(
        folder,
        &["surface", "interpolate", "t1.ron", "--json"],
        &(input + "1e9 1e9\n-1 -1\n"),
    );
    let lines: Vec<Value> = String::from_utf8_lossy(&output.stdout)
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(lines.len(), models.len() + 2);
    for (line, model) in lines.iter().zip(models) {
        let keys: Vec<&String> = line.as_object().unwrap().keys().collect();
        assert_eq!(
            keys,
            [
                "ar",
                "force_n",
                "gain",
                "ma",
                "speed_mm_s",
                "triangle",
                "variance",
                "weights"
            ]
        );
        // mm/s are converted in decimal and back, which may cost the last bit.
        assert!((number(&line["speed_mm_s"]) - number(&model["speed_mm_s"])).abs() < 1e-12);
        assert_eq!(line["force_n"], model["force_n"]);
        assert!(
            (number(&line["variance"]) - number(&model["variance"])).abs()
                <= 1e-9 * number(&model["variance"])
        );
        for (a, b) in line["ar"]
            .as_array()
            .unwrap()
            .iter()
            .zip(model["ar"].as_array().unwrap())
        {
            assert!((number(a) - number(b)).abs() < 1e-9, "{a} {b}");
        }
    }
    let (corner, rest) = (&lines[models.len()], &lines[models.len() + 1]);
    assert_eq!(
        (&corner["speed_mm_s"], &corner["force_n"]),
        (
            &shown["texture"]["max_speed_mm_s"],
            &shown["texture"]["max_force_n"]
        )
    );
    assert_eq!(
        (number(&rest["variance"]), number(&rest["speed_mm_s"])),
        (0.0, 0.0)
    );

    let output = haptograph(
        folder,
        &["surface", "interpolate", "t1.ron", "--json"],
        "10 1\n\n10 abc\n",
    );
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(String::from_utf8_lossy(&output.stdout).lines().count(), 1);
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(
        told.contains("line 3, column 4") && told.contains("abc"),
        "{told}"
    );
}

#[test]
fn surfaces_change_format_and_rate() {
    let folder = workshop();
    succeed(folder, &["surface", "convert", "t1.ron", "t1.xml"]);
    succeed(folder, &["surface", "convert", "t1.xml", "back.ron"]);
    let models = |file: &str| json(folder, &["surface", "show", file, "--json"])["texture"]["models"].clone();
    assert_eq!(models("t1.ron"), models("back.ron"));
    let told = fail(folder, &["surface", "convert", "t1.ron", "t1.txt"]);
    assert!(told.contains(".ron") && told.contains(".xml"), "{told}");

    for (method, most_db) in [("zoh", 6.0), ("hatt", 60.0), ("spectral", 0.1)] {
        let out = format!("t1.{method}.ron");
        let arguments = [
            "surface", "resample", "t1.ron", "--rate", "1000", "--method", method, "-o", &out, "--json",
        ];
        let worst = json(folder, &arguments)["worst_db"].as_f64().unwrap();
        assert!(worst.abs() <= most_db, "{method}: {worst} dB");
        assert_eq!(
            json(folder, &["surface", "show", &out, "--json"])["texture"]["rate_hz"],
            1000.0
        );
    }
    let told = fail(
        folder,
        &[
            "surface", "resample", "t1.ron", "--rate", "700", "--method", "zoh", "-o", "x.ron",
        ],
    );
    assert!(
        told.contains("spectral") && !folder.join("x.ron").exists(),
        "{told}"
    );
}

#[test]
fn what_is_wrong_in_a_surface_file_is_shown_at_its_place() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(
        folder.path().join("bad.xml"),
        "<modelSet>\n  <mu>slippery</mu>\n</modelSet>\n",
    )
    .unwrap();
    let told = fail(folder.path(), &["surface", "show", "bad.xml"]);
    assert!(told.contains("bad.xml:2:") && told.contains("slippery"), "{told}");
    assert!(fail(folder.path(), &["surface", "show", "none.ron"]).contains("none.ron"));
}

#[test]
fn a_few_surfaces_stand_for_a_folder() {
    let folder = workshop();
    let many = folder.join("many");
    fs::create_dir_all(&many).unwrap();
    for name in ["a", "b", "c"] {
        let text = fs::read_to_string(folder.join("t1.ron")).unwrap();
        fs::write(
            many.join(format!("{name}.ron")),
            text.replacen("\"t1\"", &format!("\"{name}\""), 1),
        )
        .unwrap();
    }
    let found = json(folder, &["surface", "select", "many", "--count", "2", "--json"]);
    assert_eq!(found["surfaces"].as_array().unwrap().len(), 3);
    assert_eq!(found["selected"].as_array().unwrap().len(), 2);
    assert!(
        fail(folder, &["surface", "select", "many", "--count", "4"])
            .contains("4 surfaces cannot be chosen of 3")
    );
    assert!(succeed(folder, &["surface", "select", "many"]).contains("2 of 3 surfaces"));
}

#[test]
fn vibrations_are_compared_whatever_they_are_kept_in() {
    let folder = tempfile::tempdir().unwrap();
    let (a, b) = (noise(20_000, 1), noise(20_000, 2));
    column(&folder.path().join("a.csv"), "accel_m_s2", &a);
    column(&folder.path().join("b.csv"), "accel_m_s2", &b);
    let same = json(
        folder.path(),
        &["compare", "a.csv", "a.csv", "--rate", "10000", "--json"],
    );
    assert_eq!(
        (&same["NSE"], &same["PE"], &same["SD"]),
        (&0.0.into(), &0.0.into(), &0.0.into())
    );
    let other = json(
        folder.path(),
        &["compare", "a.csv", "b.csv", "--rate", "10000", "--json"],
    );
    for measure in ["NSE", "PE", "SD"] {
        assert!(other[measure].as_f64().unwrap() > 0.0);
    }
    assert!(fail(folder.path(), &["compare", "a.csv", "b.csv"]).contains("--rate"));

    let spec = hound::WavSpec {
        channels: 1,
        sample_rate: 10_000,
        bits_per_sample: 32,
        sample_format: hound::SampleFormat::Float,
    };
    let mut writer = hound::WavWriter::create(folder.path().join("a.wav"), spec).unwrap();
    a.iter()
        .for_each(|sample| writer.write_sample(*sample as f32 / 8.0).unwrap());
    writer.finalize().unwrap();
    fs::write(
        folder.path().join("a.wav.ron"),
        "Recording(unit: \"m/s2\", full_scale: 8.0)",
    )
    .unwrap();
    let kept = json(
        folder.path(),
        &["compare", "a.wav", "a.csv", "--rate", "10000", "--json"],
    );
    assert!(
        kept["NSE"].as_f64().unwrap() < 1e-6 && kept["PE"].as_f64().unwrap() < 1e-5,
        "{kept}"
    );
    // Both are brought down to a tenth of the rate, with the same windows of the same moments.
    let slow = json(
        folder.path(),
        &["compare", "a.wav", "a.wav", "--rate", "1000", "--json"],
    );
    assert_eq!((&slow["SD"], &slow["windows"]), (&0.0.into(), &14.into()));
    assert!(fail(folder.path(), &["compare", "a.wav", "a.wav", "--rate", "20000"]).contains("at most"));
}

#[test]
fn an_evaluation_prints_the_tables_of_the_thesis() {
    let folder = workshop();
    let text = succeed(folder, &["evaluate", "study"]);
    assert!(
        text.contains("virtual T1")
            && text.contains("baseline")
            && text.contains("anna")
            && text.contains("ben"),
        "{text}"
    );
    let found = json(folder, &["evaluate", "study", "--json", "--report", "evaluation"]);
    assert_eq!(found["expert"], "anna");
    let cells = found["table"]["sd"].as_array().unwrap();
    assert!(cells.len() == 2 && cells.iter().all(|row| row.as_array().unwrap().len() == 2));
    let row = &found["people_table"]["sd"][0];
    assert_eq!(
        (&row[0], &row[1]),
        (&cells[0][0], &cells[1][1]),
        "the expert's row is the diagonal"
    );
    assert!(found["map"]["places"].as_array().unwrap().len() == 4);
    assert!(
        fs::read_to_string(folder.join("evaluation/report.html"))
            .unwrap()
            .contains("simulated")
    );
    fs::create_dir_all(folder.join("empty")).unwrap();
    assert!(fail(folder, &["evaluate", "empty"]).contains("<material>.<person>.<take>"));
}

/// Every command of the chapter runs as it stands there.
#[cfg(unix)]
#[test]
fn the_chapter_on_learning_is_true() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = tempfile::tempdir().unwrap();
    std::os::unix::fs::symlink(root.join("graphs"), folder.path().join("graphs")).unwrap();
    let program = Path::new(env!("CARGO_BIN_EXE_haptograph")).parent().unwrap();
    let path = format!(
        "{}:{}",
        program.display(),
        std::env::var("PATH").unwrap_or_default()
    );
    let chapter = fs::read_to_string(root.join("docs/learning.md")).unwrap();
    let blocks: String = chapter
        .split("```sh\n")
        .skip(1)
        .filter_map(|rest| rest.split_once("```"))
        .map(|(block, _)| block)
        .collect();
    assert!(blocks.matches("haptograph ").count() > 15);
    let output = Command::new("sh")
        .args(["-e", "-c", &blocks])
        .env("PATH", path)
        .current_dir(folder.path())
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    for made in [
        "tile/report.html",
        "out/texturepad/report.html",
        "study-report/report.html",
        "tile.1k.ron",
    ] {
        assert!(folder.path().join(made).is_file(), "{made} is missing");
    }
}
