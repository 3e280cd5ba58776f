//! Segments, and surfaces in other forms.

use super::{fail, haptograph, json, noise, succeed, told_by, workshop};
use serde_json::Value;
use std::fs;

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
    let rows: String = y[2..].iter().enumerate().map(|(i, y)| format!("{i}, \"{y}\"\r\n")).collect();
    fs::write(folder.path().join("a.csv"), format!("time, \"y\"\r\n{rows}")).unwrap();
    let found = json(folder.path(), &["segment", "a.csv", "--column", "y", "--json"]);
    let keys: Vec<&String> = found.as_object().unwrap().keys().collect();
    assert_eq!(keys, ["breaks", "mdl", "orders"]);
    let breaks: Vec<i64> = found["breaks"].as_array().unwrap().iter().map(|b| b.as_i64().unwrap()).collect();
    assert!(breaks.len() == 2 && (breaks[0] - 512).abs() < 30 && (breaks[1] - 768).abs() < 30, "{breaks:?}");
    assert_eq!(found["orders"].as_array().unwrap().len(), 3);
    let wide = json(
        folder.path(),
        &["segment", "a.csv", "--column", "y", "--min-span", "600", "--max-order", "3", "--json"],
    );
    assert_eq!((wide["breaks"].as_array().unwrap().len(), wide["orders"].as_array().unwrap().len()), (0, 1));
    assert!(succeed(folder.path(), &["segment", "a.csv", "--column", "y"]).contains("segments            3"));
    let evolve = ["--method", "genetic", "--seed", "2", "--min-span", "200", "--max-order", "2"];
    let evolve = [&["segment", "a.csv", "--column", "y", "--json"], &evolve[..]].concat();
    let evolved = json(folder.path(), &evolve);
    assert_eq!(evolved["orders"].as_array().unwrap().len(), 3);
    assert_eq!(evolved, json(folder.path(), &evolve), "its seed is given");

    fs::write(folder.path().join("bad.csv"), "a,y\r\n1,2\r\n3,x\r\n").unwrap();
    let told = fail(folder.path(), &["segment", "bad.csv", "--column", "y", "--json"]);
    assert!(told.contains("bad.csv:3:3") && !told.contains("column 2"), "{told}");
    assert!(fail(folder.path(), &["segment", "bad.csv", "--column", "z"]).contains("the columns are a, y"));
}

#[test]
fn interpolation_is_the_model_at_vertices_and_saturates() {
    let folder = workshop();
    let shown = json(folder, &["surface", "show", "t1.ron", "--json"]);
    let models = shown["texture"]["models"].as_array().unwrap();
    let number = |value: &Value| value.as_f64().unwrap();
    let input: String =
        models.iter().map(|model| format!("{} {}\n", model["speed_mm_s"], model["force_n"])).collect();
    let output =
        haptograph(folder, &["surface", "interpolate", "t1.ron", "--json"], &(input + "1e9 1e9\n-1 -1\n"));
    let lines: Vec<Value> = String::from_utf8_lossy(&output.stdout)
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(lines.len(), models.len() + 2);
    assert_eq!(
        (&lines[models.len()]["asked_force_n"], &lines[models.len() + 1]["asked_speed_mm_s"]),
        (&1e9.into(), &(-1.0).into())
    );
    let output = haptograph(folder, &["surface", "interpolate", "t1.ron"], "-1 1\n");
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(said.starts_with("0 mm/s, 1 N in place of -1 mm/s, 1 N: models"), "{said}");
    for (line, model) in lines.iter().zip(models) {
        let keys: Vec<&String> = line.as_object().unwrap().keys().collect();
        assert_eq!(
            keys,
            ["ar", "force_n", "gain", "ma", "speed_mm_s", "triangle", "variance", "warping", "weights"]
        );
        // mm/s are converted in decimal and back, which may cost the last bit.
        assert!((number(&line["speed_mm_s"]) - number(&model["speed_mm_s"])).abs() < 1e-12);
        assert_eq!(line["force_n"], model["force_n"]);
        assert!(
            (number(&line["variance"]) - number(&model["variance"])).abs()
                <= 1e-9 * number(&model["variance"])
        );
        for (a, b) in line["ar"].as_array().unwrap().iter().zip(model["ar"].as_array().unwrap()) {
            assert!((number(a) - number(b)).abs() < 1e-9, "{a} {b}");
        }
    }
    let (corner, rest) = (&lines[models.len()], &lines[models.len() + 1]);
    assert_eq!(
        (&corner["speed_mm_s"], &corner["force_n"]),
        (&shown["texture"]["max_speed_mm_s"], &shown["texture"]["max_force_n"])
    );
    assert_eq!((number(&rest["variance"]), number(&rest["speed_mm_s"])), (0.0, 0.0));

    let output = haptograph(folder, &["surface", "interpolate", "t1.ron", "--json"], "10 1\n\n10 abc\n");
    assert_eq!(output.status.code(), Some(1));
    // The one that can be read, and then what is wrong.
    assert_eq!(String::from_utf8_lossy(&output.stdout).lines().count(), 2);
    let told = told_by(&output);
    assert!(told.contains("line 3, column 4") && told.contains("abc"), "{told}");
}

#[test]
fn surfaces_change_format_and_rate() {
    let folder = workshop();
    let method = ["--method", "thesis"];
    let learn = ["learn", "study/T1.anna.1.npz", "-o", "plain.ron"];
    succeed(folder, &[&learn[..], &method].concat());
    succeed(folder, &["surface", "convert", "plain.ron", "t1.xml"]);
    succeed(folder, &["surface", "convert", "t1.xml", "back.ron"]);
    let models = |file: &str| json(folder, &["surface", "show", file, "--json"])["texture"]["models"].clone();
    assert_eq!(models("plain.ron"), models("back.ron"));
    let told = fail(folder, &["surface", "convert", "t1.ron", "t1.xml"]);
    assert!(told.contains("warped"), "{told}");
    let told = fail(folder, &["surface", "convert", "t1.ron", "t1.txt"]);
    assert!(told.contains(".ron") && told.contains(".xml"), "{told}");

    for (from, method, most_db) in [
        ("plain.ron", "zoh", 6.0),
        ("plain.ron", "hatt", 60.0),
        ("plain.ron", "spectral", 0.1),
        ("t1.ron", "spectral", 0.2),
    ] {
        let out = format!("{method}.{from}");
        let arguments =
            ["surface", "resample", from, "--rate", "1000", "--method", method, "-o", &out, "--json"];
        let worst = json(folder, &arguments)["worst_db"].as_f64().unwrap();
        assert!(worst.abs() <= most_db, "{method}: {worst} dB");
        assert_eq!(json(folder, &["surface", "show", &out, "--json"])["texture"]["rate_hz"], 1000.0);
    }
    let told = fail(
        folder,
        &["surface", "resample", "plain.ron", "--rate", "700", "--method", "zoh", "-o", "x.ron"],
    );
    assert!(told.contains("spectral") && !folder.join("x.ron").exists(), "{told}");
}

#[test]
fn a_few_surfaces_stand_for_a_folder() {
    let folder = workshop();
    let many = folder.join("many");
    fs::create_dir_all(&many).unwrap();
    for name in ["a", "b", "c"] {
        let text = fs::read_to_string(folder.join("t1.ron")).unwrap();
        fs::write(many.join(format!("{name}.ron")), text.replacen("\"t1\"", &format!("\"{name}\""), 1))
            .unwrap();
    }
    let found = json(folder, &["surface", "select", "many", "--count", "2", "--json"]);
    assert_eq!(found["surfaces"].as_array().unwrap().len(), 3);
    assert_eq!(found["selected"].as_array().unwrap().len(), 2);
    assert!(found.as_object().unwrap().contains_key("centre"));
    assert!(
        fail(folder, &["surface", "select", "many", "--count", "4"])
            .contains("cannot select 4 of 3 surfaces")
    );
    assert!(succeed(folder, &["surface", "select", "many"]).contains("2 of 3 surfaces"));
}

/// An uncompressed BMP of 24 bits of that gray value.
fn bitmap(side: u32, gray: impl Fn(u32, u32) -> u8) -> Vec<u8> {
    let mut bytes = b"BM\0\0\0\0\0\0\0\0".to_vec();
    for number in [54, 40, side, side, 24 << 16 | 1, 0, 0, 0, 0, 0, 0] {
        bytes.extend(number.to_le_bytes());
    }
    for place in 0..side * side {
        bytes.extend([gray(place % side, place / side); 3]);
    }
    bytes
}

#[test]
fn a_photograph_has_a_roughness_and_a_fineness() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    // Two lines per mm at 8 pixels per mm.
    let grating = bitmap(64, |x, _| if x % 4 < 2 { 200 } else { 40 });
    fs::write(folder.join("grating.bmp"), &grating).unwrap();
    let found = json(folder, &["surface", "image", "grating.bmp", "--mm", "8", "--json"]);
    let number = |key: &str| found[key].as_f64().unwrap();
    assert_eq!((number("width_px"), number("height_px"), number("pixels_per_mm")), (64.0, 64.0, 8.0));
    assert!((number("fineness_per_mm") - 2.0).abs() < 1e-6, "{found}");
    assert!((0.0..0.5).contains(&number("angular_second_moment")), "{found}");
    let even = bitmap(64, |_, _| 90);
    fs::write(folder.join("even.bmp"), &even).unwrap();
    let text = succeed(folder, &["surface", "image", "even.bmp", "--mm", "8"]);
    assert!(text.contains("angular second moment 1 ") && text.contains("0 cycles/mm"), "{text}");
    let refused = |name: &str, bytes: &[u8]| {
        fs::write(folder.join(name), bytes).unwrap();
        fail(folder, &["surface", "image", name, "--mm", "8"])
    };
    assert!(refused("cut.bmp", &grating[..grating.len() - 1]).contains("cut.bmp"));
    assert!(refused("photo.jpg", &[0xff, 0xd8, 0xff, 0xe0]).contains("JPEG"));
    assert!(refused("table.csv", b"a,b\n1,2\n").contains("neither a PNG nor a BMP"));
    let mut huge = grating;
    huge[18..22].copy_from_slice(&1_000_000_u32.to_le_bytes());
    assert!(refused("huge.bmp", &huge).contains("1000000 x 64 pixels"));
    for size in ["0", "-1", "nan", "wide"] {
        let output = haptograph(folder, &["surface", "image", "even.bmp", "--mm", size], "");
        assert_eq!(output.status.code(), Some(2), "{size}");
    }
}

#[test]
fn maps_are_compared_on_measured_models_which_a_law_has_not() {
    let folder = workshop();
    let learn = ["learn", "study/T1.anna.1.npz", "-o", "maps/measured.ron"];
    fs::create_dir_all(folder.join("maps")).unwrap();
    succeed(folder, &[&learn[..], &["--method", "thesis"]].concat());
    let of_file = json(folder, &["surface", "leave-one-out", "maps/measured.ron", "--json"]);
    let of_folder = json(folder, &["surface", "leave-one-out", "maps", "--json"]);
    assert_eq!(of_file, of_folder);
    let all = of_file["left_out"]["all"].as_object().unwrap();
    let maps: Vec<&str> = all.keys().map(String::as_str).collect();
    assert_eq!(maps, ["law", "law_without_fade", "nearest", "triangulation"]);
    for (map, figures) in all {
        assert_eq!(figures["models"], all["law"]["models"], "{map}");
        assert!(figures["models"].as_u64().unwrap() >= 3);
        assert!(figures["lsd_db"].as_f64().unwrap() > 0.0 && figures["lsd_error_db"].is_null());
        let parts = ["inside", "outside"].map(|part| &of_file["left_out"][part][map]["models"]);
        let together: u64 = parts.iter().filter_map(|models| models.as_u64()).sum();
        assert_eq!(Some(together), figures["models"].as_u64());
    }
    assert_eq!(of_file["notes"].as_array().unwrap().len(), 2);
    let law = ["learn", "study/T1.anna.1.npz", "-o", "law.ron"];
    succeed(folder, &law);
    assert!(fail(folder, &["surface", "leave-one-out", "law.ron"]).contains("a law has no measured models"));
}
