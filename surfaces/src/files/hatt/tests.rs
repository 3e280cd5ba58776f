pub(crate) mod real_files;

use super::*;
use crate::files::{Place, read_surface};
use crate::hull::Hull;
use crate::{ArmaModel, Friction, ModelAt, Stiffness, Tap, Taps, TextureModel, VertexKind};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

/// A surface with all that a toolkit file holds, of random numbers with all digits in use.
fn surface(seed: u64, ma_pairs: usize) -> Surface {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut measured = Vec::new();
    for _ in 0..8 {
        let mut lsf = |order: usize| -> Vec<f64> {
            let step = std::f64::consts::PI / (order as f64 + 1.0);
            (0..order).map(|k| step * (k as f64 + 1.0 + random.random_range(-0.3..0.3))).collect()
        };
        let (ar, ma) = (lsf(9), lsf(2 * ma_pairs));
        let gain = if ma_pairs == 0 { 1.0 } else { random.random_range(1.0..20.0) };
        measured.push(ModelAt {
            speed_m_s: random.random_range(0.001..0.3),
            force_n: random.random_range(0.01..5.0),
            model: ArmaModel::from_lsf(&ar, &ma, gain, random.random()).unwrap(),
            kind: VertexKind::Measured,
        });
    }
    let provenance = Provenance::new(Origin::Simulated, "a test -- with <odd> & \"text\"");
    let mut surface = Surface::new("Tile & <Grout> no. 3", provenance);
    surface.friction = Some(Friction::new(random.random(), None).unwrap());
    let rate_hz = if ma_pairs == 0 { 10_000.0 } else { 1000.0 };
    surface.texture = Some(TextureModel::from_measured(rate_hz, measured, &Hull::default()).unwrap());
    let mut tap = |speed_m_s: f64| Tap {
        speed_m_s,
        acceleration_m_s2: (0..100).map(|_| random.random_range(-90.0..90.0)).collect(),
        peak_force_n: None,
    };
    surface.taps = Some(Taps::new(1000.0, vec![tap(0.0123456789012345), tap(0.25)]).unwrap());
    surface
}

fn place_and_message(text: &str) -> (usize, String) {
    let error = read_surface(text.as_bytes()).expect_err("this file is wrong");
    (error.place.map_or(0, |Place { line, .. }| line), error.to_string())
}

#[test]
fn every_bit_comes_back_from_a_model_file() {
    for seed in 0..20 {
        let surface = surface(seed, seed as usize % 3);
        let text = write_models(&surface).unwrap();
        let back = read_surface(text.as_bytes()).unwrap();
        assert_eq!(back.name, surface.name);
        assert_eq!(back.friction, surface.friction);
        assert_eq!(back.texture, surface.texture);
        assert_eq!(write_models(&back).unwrap(), text);
    }
}

#[test]
fn every_bit_comes_back_from_a_tap_file() {
    let surface = surface(1, 0);
    let text = write_taps(&surface).unwrap();
    assert_eq!(read_surface(text.as_bytes()).unwrap().taps, surface.taps);
}

#[test]
fn what_was_simulated_stays_so() {
    let text = write_models(&surface(1, 0)).unwrap();
    let back = read_surface(text.as_bytes()).unwrap();
    assert_eq!(back.provenance.origin, Origin::Simulated);
    assert!(back.provenance.source.starts_with("a test -\u{2010} with <odd>"), "{}", back.provenance.source);
    let unlabelled: String = text.lines().filter(|line| !line.starts_with("<!--")).collect();
    assert_eq!(read_surface(unlabelled.as_bytes()).unwrap().provenance.origin, Origin::Imported);
}

#[test]
fn written_files_obey_the_toolkits_rules() {
    let text = write_models(&surface(2, 1)).unwrap();
    let fields: Vec<&str> = text
        .lines()
        .filter(|line| line.starts_with("   <") && !line.starts_with("    ") && !line.starts_with("   </"))
        .map(|line| line.trim_start_matches("   <").split(['>', ' ', '/']).next().unwrap())
        .collect();
    let mut order: Vec<&str> = fields.clone();
    order.dedup();
    let expected = "material AccelUnits SpeedUnits ForceUnits SampleRate mu htmlPicture htmlLinuxPicture renderPicture \
        numMod numTri maxSpeed maxForce speedList forceList tri DTpicture LinuxDTpicture numARCoeff numMACoeff model";
    assert_eq!(order, expected.split_whitespace().collect::<Vec<_>>());
    for list in ["speedList", "forceList", "tri"] {
        assert!(text.contains(&format!("   <{list} type=\"array\">\n")));
    }
    let model = text.split("<model>").nth(1).unwrap();
    let at = |field: &str| model.find(&format!("<{field}>")).unwrap();
    let order = ["modNum", "ARcoeff", "ARlsf", "MAcoeff", "MAlsf", "var", "gain", "speedMod", "forceMod"];
    assert!(order.windows(2).all(|pair| at(pair[0]) < at(pair[1])));
    let plain = write_models(&surface(2, 0)).unwrap();
    assert!(!plain.contains("<gain>") && plain.contains("<MAlsf/>"));
    assert!(plain.contains("<numMACoeff>0</numMACoeff>"));
}

#[test]
fn errors_say_where() {
    let text = write_models(&surface(3, 1)).unwrap();
    let line_of = |part: &str| text.lines().position(|line| line.contains(part)).unwrap() + 1;
    let (line, message) = place_and_message(&text.replacen("<mu>", "<my>", 1).replacen("</mu>", "</my>", 1));
    assert_eq!(line, line_of("<mu>"), "{message}");
    assert!(message.contains("no field <my>"), "{message}");
    let (line, message) = place_and_message(&text.replacen("<var>", "<var>?", 1));
    assert_eq!(line, line_of("<var>"), "{message}");
    let (_, message) = place_and_message(&text.replace("mm/s", "m/s"));
    assert!(message.contains("expected \"mm/s\""), "{message}");
    let (_, message) = place_and_message(&text.replacen("<modNum>2<", "<modNum>7<", 1));
    assert!(message.contains("<modNum> is 7, but the file has 2"), "{message}");
    let (_, message) = place_and_message(&text.replacen("</mu>", "</mu><mu>1</mu>", 1));
    assert!(message.contains("given twice"), "{message}");
    let (_, message) = place_and_message(&text[..text.find("<var>").unwrap()]);
    assert!(message.contains("ends inside"), "{message}");
    let (_, message) = place_and_message(&format!("{text}<more/>"));
    assert!(message.contains("after"), "{message}");
    let (_, message) = place_and_message("<html></html>");
    assert!(message.contains("<modelSet> or <tapSet>"), "{message}");
    let (_, message) = place_and_message("<!DOCTYPE a [<!ENTITY b \"c\">]><tapSet>&b;</tapSet>");
    assert!(message.contains("DOCTYPE"), "{message}");
    let (_, message) = place_and_message(&text.replace("Tile", "&tile;"));
    assert!(message.contains("&tile;"), "{message}");
    assert!(read_surface(b"<").is_err());
}

#[test]
fn what_the_format_cannot_hold_is_refused_or_named() {
    let mut surface = surface(4, 0);
    let folder = tempfile::tempdir().unwrap();
    surface.stiffness = Some(Stiffness::new(3.0, None).unwrap());
    let left_out = crate::files::save(&surface, &folder.path().join("Models_A.xml")).unwrap();
    assert_eq!(left_out, ["taps", "stiffness"]);
    let texture = surface.texture.take().unwrap();
    let powers = texture.models().iter().map(|at| at.speed_m_s * at.force_n).collect();
    let texture = texture.with_lines(vec![crate::SpatialLine::new(300.0, 0.0, powers).unwrap()]).unwrap();
    surface.texture = Some(texture.with_grain(Some(crate::Grain::of_crackle(0.9, 0.008).unwrap())));
    let left_out = crate::files::save(&surface, &folder.path().join("Models_A.xml")).unwrap();
    assert_eq!(left_out, ["taps", "grain", "lines fixed in space", "stiffness"]);
    surface.texture = None;
    let path = folder.path().join("Taps_Cork.xml");
    assert_eq!(crate::files::save(&surface, &path).unwrap(), ["name", "friction", "stiffness"]);
    assert_eq!(crate::files::load(&path).unwrap().name, "Cork");
    assert!(matches!(write_models(&surface), Err(HattWriteError::NoTexture)));
    surface.friction = None;
    surface.taps = Some(Taps::new(2000.0, surface.taps.unwrap().taps().to_vec()).unwrap());
    assert!(matches!(write_taps(&surface), Err(HattWriteError::TapShape { .. })));
    assert!(crate::files::save(&surface, &folder.path().join("surface.txt")).is_err());
}

#[test]
fn models_and_taps_make_one_surface() {
    let whole = surface(5, 0);
    let models = read_surface(write_models(&whole).unwrap().as_bytes()).unwrap();
    let taps = read_surface(write_taps(&whole).unwrap().as_bytes()).unwrap();
    let merged = crate::files::merge(models.clone(), taps).unwrap();
    assert_eq!((&merged.taps, &merged.texture, &merged.name), (&whole.taps, &whole.texture, &whole.name));
    assert!(crate::files::merge(models.clone(), models).is_err());
}
