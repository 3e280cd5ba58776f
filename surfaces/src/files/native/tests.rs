use super::*;
use crate::files::{Malformed, Place, Problem, read_surface};
use crate::hull::Hull;
use crate::layers::onset::{Onset, OnsetExample, OnsetOrigin};
use crate::{
    ArmaModel, Friction, Grain, ModelAt, Origin, Provenance, Recorded, SpatialLine, StaticPeak, Stiffness,
    Surface, Tap, Taps, TextureModel, VertexKind,
};
use haptograph_signal::units::decimal::format_thousandfold;
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::sync::Arc;

/// A surface of random numbers, all digits in use.
fn random_surface(seed: u64) -> Surface {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut lsf = |order: usize| {
        let mut lsf: Vec<f64> = (0..order).map(|_| random.random_range(0.01..3.1)).collect();
        lsf.sort_by(f64::total_cmp);
        (1..order).for_each(|k| lsf[k] = lsf[k].max(lsf[k - 1] + 1e-3));
        lsf
    };
    let filters: Vec<_> = (0..6).map(|_| (lsf(7), lsf(4))).collect();
    let measured = filters
        .iter()
        .map(|(ar, ma)| ModelAt {
            speed_m_s: random.random_range(0.001..0.2),
            force_n: random.random_range(0.01..3.0),
            model: ArmaModel::from_lsf(ar, ma, random.random_range(0.5..20.0), random.random()).unwrap(),
            kind: VertexKind::Measured,
        })
        .collect();
    let tap = |speed_m_s: f64, random: &mut Xoshiro256PlusPlus| Tap {
        speed_m_s,
        acceleration_m_s2: (0..30).map(|_| random.random_range(-100.0..100.0)).collect(),
        peak_force_n: (speed_m_s > 0.1).then(|| random.random_range(0.1..5.0)),
    };
    let provenance = Provenance::new(Origin::Simulated, "a \"test\" \\ with\nodd {text} µ \u{7}")
        .with_setting("seed", seed)
        .with_setting("naïve \"name\"", "");
    let mut surface = Surface::new("Prüfstück", provenance);
    let peak = StaticPeak::new(1.0 + random.random::<f64>(), random.random()).unwrap();
    surface.friction =
        Some(Friction::new(random.random(), Some(random.random())).unwrap().with_peak(Some(peak)));
    surface.stiffness = Some(Stiffness::new(random.random_range(1.0..50.0), None).unwrap());
    surface.taps =
        Some(Taps::new(1000.0, vec![tap(0.0123456789, &mut random), tap(0.3, &mut random)]).unwrap());
    let grain = Grain::of_crackle(random.random_range(0.1..2.0), random.random_range(0.001..0.1)).unwrap();
    let texture = TextureModel::from_measured(1000.0, measured, &Hull::default()).unwrap();
    let mut power = |at: &ModelAt| {
        if at.speed_m_s * at.force_n == 0.0 { 0.0 } else { random.random() }
    };
    let powers: Vec<f64> = texture.models().iter().map(&mut power).collect();
    let line = SpatialLine::new(random.random_range(10.0..5000.0), random.random_range(0.0..100.0), powers);
    let ranges = Recorded { speed_m_s: (0.0123456789, 0.1), force_n: (0.1, 1.0 / 3.0) };
    let texture = texture.with_lines(vec![line.unwrap()]).unwrap().with_recorded(Some(ranges)).unwrap();
    let recorded: Vec<f64> = (0..500).map(|_| random.random_range(-1.0..1.0)).collect();
    let clips = crate::layers::Clips::new(&recorded).unwrap();
    let onset = Onset {
        origin: OnsetOrigin::Learned(random.random()),
        powers_m2_s4: random.random(),
        decay_s: random.random_range(0.002..0.2),
        force_n: random.random(),
        force_exponent: random.random(),
        stuck_s: random.random_range(0.05..2.0),
        stuck_exponent: random.random(),
        rest_m_s: random.random_range(0.0..0.1),
        slide_m_s: random.random_range(0.1..1.0),
    };
    let texture = texture.with_layer(Arc::new(onset.checked().unwrap())).unwrap();
    surface.texture = Some(texture.with_grain(Some(grain)).with_clips(Some(clips)));
    surface
}

#[test]
fn an_onset_is_learned_or_an_example_by_name_and_half_a_static_peak_is_refused() {
    let text = write(&random_surface(3));
    let (start, end) = (text.find("        onset: ").unwrap(), text.find("        filters: ").unwrap());
    let example = text.replace(&text[start..end], "        onset: Example(coarse),\n");
    let surface = read(&example).unwrap();
    let onset: Onset = *surface.texture.as_ref().unwrap().layer().unwrap();
    assert_eq!(onset.origin, OnsetOrigin::Example(OnsetExample::Coarse));
    assert_eq!(write(&surface), example);
    for (sound, bad) in [("Example(coarse)", "Example(other)"), ("Example(coarse)", "Learned(strokes: 9)")] {
        assert!(read(&example.replace(sound, bad)).is_err(), "{bad}");
    }
    let part = &text[text.find(", static_ratio").unwrap()..text.find(", stribeck_mm_s").unwrap()];
    assert!(read(&text.replace(part, "")).is_err());
    let speed = &text[text.find(", stribeck_mm_s").unwrap()..text.find(", r_squared").unwrap()];
    assert!(read(&text.replace(speed, "")).is_err());
}

const SQUARE: &str = r#"Surface(
    format: 1,
    name: "square",
    provenance: (origin: procedural, source: "a test", made_by: "hand"),
    texture: (
        rate_hz: 1000,
        filters: [(ar: [-0.5, 0.2])],
        vertices: [
            (speed_mm_s: 0, force_n: 0, filter: 0, variance: 0, kind: edge),
            (speed_mm_s: 200 /* as fast as that */, force_n: 0, filter: 0, variance: 0, kind: edge),
            (speed_mm_s: 200, force_n: 3, filter: 0, variance: 0.5, kind: measured),
            (speed_mm_s: 0, force_n: 3, filter: 0, variance: 0, kind: edge),
        ],
    ),
)"#;

fn error(text: &str) -> (Option<(usize, usize)>, String) {
    let error = read_surface(text.as_bytes()).expect_err(text);
    (error.place.map(|Place { line, column }| (line, column)), error.to_string())
}

#[test]
fn a_hand_written_file_needs_no_lsfs_and_no_triangles() {
    let surface = read(SQUARE).unwrap();
    let texture = surface.texture.as_ref().unwrap();
    assert_eq!(texture.triangles().len(), 2);
    assert_eq!((texture.max_speed_m_s(), texture.max_force_n()), (0.2, 3.0));
    assert_eq!(texture.models()[2].kind, VertexKind::Measured);
    assert_eq!(read_surface(format!("\u{feff}{SQUARE}").as_bytes()).unwrap(), surface);
    assert_eq!(read(&SQUARE.replace('\n', "\r\n")).unwrap(), surface);
}

#[test]
fn a_file_that_is_cut_anywhere_is_called_incomplete() {
    let whole = write(&random_surface(3));
    let ends = (SQUARE.len()..whole.len()).step_by(211).chain([whole.len() - 3]);
    let cuts = ends.map(|end| &whole[..whole.floor_char_boundary(end)]);
    for cut in cuts.chain((10..SQUARE.len() - 1).map(|end| &SQUARE[..end])) {
        let problem = read_surface(cut.as_bytes()).expect_err(cut).problem;
        let is_incomplete = matches!(problem, Problem::Malformed(Malformed::Incomplete { .. }));
        assert!(is_incomplete, "{problem}: ...{}", &cut[cut.len().saturating_sub(60)..]);
    }
    // A bracket too few in the middle is none at the end, and a mistake stays one.
    for wrong in [SQUARE.replace("[(ar:", "(ar:"), SQUARE.replace("1000", "fast")] {
        let problem = read_surface(wrong.as_bytes()).expect_err(&wrong).problem;
        let is_syntax = matches!(problem, Problem::Malformed(Malformed::Syntax { .. }));
        assert!(is_syntax, "{problem}");
    }
}

#[test]
fn a_file_of_another_kind_is_named_by_its_beginning() {
    let root = "Surface";
    let other = |found: &str| Malformed::OtherKind { root, found: found.to_owned() };
    for (text, reason) in [
        ("", Malformed::Empty { root }),
        ("\n // nothing\n", Malformed::Empty { root }),
        ("// made by hand\nGraph(\n format: 1)", other("Graph")),
        ("time_s,accel_m_s2\n0,1\n", other("time_s,accel_m_s2")),
        ("# gesture: drag\ntime_s\n0\n", other("#")),
    ] {
        let problem = read_surface(text.as_bytes()).expect_err(text).problem;
        assert_eq!(problem, Problem::Malformed(reason), "{text}");
    }
}

#[test]
fn the_example_in_the_documentation_reads() {
    let page = include_str!("mod.rs");
    let lines = page.lines().filter_map(|line| line.strip_prefix("//!"));
    let example: Vec<_> = lines
        .skip_while(|line| !line.contains("```ron"))
        .skip(1)
        .take_while(|line| !line.contains("```"))
        .collect();
    let surface = read(&example.join("\n")).unwrap();
    assert!(surface.taps.is_some() && surface.texture.is_some() && surface.stiffness.is_some());
}

#[test]
fn a_surface_of_nothing_but_a_name_is_a_surface() {
    let empty = Surface::new("", Provenance::new(Origin::Measured, ""));
    assert_eq!(read(&write(&empty)).unwrap(), empty);
}

#[test]
fn what_is_not_known_or_given_twice_is_refused_where_it_stands() {
    let (place, message) = error(&SQUARE.replace("rate_hz: 1000", "rate_hz: 1000, rite_hz: 3"));
    assert_eq!(place.map(|p| p.0), Some(6));
    assert!(message.contains("rite_hz"), "{message}");
    let (place, message) = error(&SQUARE.replace("name:", "format: 1, name:"));
    assert_eq!(place.map(|p| p.0), Some(3));
    assert!(message.contains("uplicate") && message.contains("format"), "{message}");
    let (_, message) = error(&SQUARE.replace("made_by", "settings: { \"a\": \"1\", \"a\": \"2\" }, made_by"));
    assert!(message.contains("\"a\" is given twice"), "{message}");
}

#[test]
fn errors_of_meaning_have_a_line_and_column_too() {
    let (place, message) = error(&SQUARE.replace("[-0.5, 0.2]", "[-0.5, 1.2]"));
    assert_eq!(place, Some((7, 19)), "{message}");
    let (place, message) = error(&SQUARE.replace("force_n: 3, filter: 0", "force_n: 3, filter: 1"));
    assert_eq!(place, Some((11, 13)), "{message}");
    let (place, message) =
        error(&SQUARE.replace("force_n: 0, filter: 0, variance: 0", "force_n: 0, filter: 0, variance: 1"));
    assert_eq!(place, Some((9, 13)), "{message}");
    assert!(message.contains("zero speed or force"), "{message}");
    let (place, message) = error(&SQUARE.replace("ar: [-0.5, 0.2]", ""));
    assert_eq!(place, Some((7, 19)), "{message}");
    let (_, message) =
        error(&SQUARE.replace("rate_hz: 1000", "rate_hz: 1000, grain: (octave_shares: [1], gain_db: [0])"));
    assert!(message.contains("1 shares and 1 gains"), "{message}");
    let (_, message) =
        error(&SQUARE.replace("rate_hz: 1000", "rate_hz: 1000, crackle: (depth: -1, time_constant_ms: 5)"));
    assert!(message.contains("depth -1"), "{message}");
    for text in ["", "AAA", "AA*A"] {
        let (_, message) = error(
            &SQUARE.replace("rate_hz: 1000", &format!("rate_hz: 1000, clips: (mu_law_base64: {text:?})")),
        );
        assert!(message.contains("clips"), "{message}");
    }
    let line = |powers: &str| {
        let line = format!("(cycles_per_mm: 0.3, diffusion_rad2_per_mm: 0.1, powers_m2_s4: {powers})");
        SQUARE.replace("rate_hz: 1000", &format!("rate_hz: 1000, lines: [{line}]"))
    };
    assert!(read(&line("[0, 0, 1, 0]")).is_ok());
    assert!(error(&line("[0, 0, 1]")).1.contains("3 powers"));
    assert!(error(&line("[1, 0, 1, 0]")).1.contains("model 0"));
    assert!(error(&line("[0, 0, -1, 0]")).1.contains("300 cycles"));
    let (_, message) = error(&SQUARE.replace("speed_mm_s: 200", "speed_mm_s: fast"));
    assert!(message.contains("line 10"), "{message}");
}

#[test]
fn crackle_of_earlier_files_is_read_as_grain_and_written_as_it() {
    let with = |layer: &str| SQUARE.replace("rate_hz: 1000", &format!("rate_hz: 1000, {layer}"));
    let crackle = "crackle: (depth: 0.6, time_constant_ms: 8)";
    let surface = read(&with(crackle)).unwrap();
    let grain = surface.texture.as_ref().unwrap().grain();
    assert_eq!(grain, Some(Grain::of_crackle(0.6, 0.008).unwrap()));
    let text = write(&surface);
    assert!(text.contains("grain: (") && !text.contains("crackle"), "{text}");
    assert_eq!(read(&text).unwrap(), surface);
    let (_, message) = error(&text.replace("        grain:", &format!("        {crackle},\n        grain:")));
    assert!(message.contains("`grain` twice"), "{message}");
}

#[test]
fn another_version_is_named_whatever_else_it_has() {
    let newer = SQUARE.replace("format: 1", "format: 2, novelty: [1, (2)]");
    assert_eq!(read(&newer).unwrap_err().problem, Problem::Version { found: 2 });
}

#[test]
fn a_list_beyond_all_reason_is_refused() {
    let orders = "0.01, ".repeat(33);
    let (_, message) = error(&SQUARE.replace("-0.5, 0.2", &orders));
    assert!(message.contains("more than 32 entries"), "{message}");
    assert!(read_surface(&[b'('; 100_000]).is_err());
    assert!(read_surface(b"").is_err());
    assert!(read_surface(b"\xff\xfe").unwrap_err().to_string().contains("UTF-8"));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]
    #[test]
    fn every_bit_comes_back(seed in any::<u64>()) {
        let surface = random_surface(seed);
        let text = write(&surface);
        prop_assert_eq!(&read(&text).unwrap(), &surface);
        prop_assert_eq!(write(&read(&text).unwrap()), text);
    }

    #[test]
    fn any_name_comes_back(name in any::<String>()) {
        let surface = Surface::new(name.clone(), Provenance::new(Origin::Imported, name));
        prop_assert_eq!(read(&write(&surface)).unwrap(), surface);
    }
}

#[test]
fn numbers_without_bounds_are_refused_by_name() {
    let surface = random_surface(1);
    let taps = surface.taps.as_ref().unwrap();
    let rate = |rate_hz: f64| format!("rate_hz: {rate_hz:?},");
    let at = |speed_m_s: f64| format!("speed_mm_s: {},", format_thousandfold(speed_m_s));
    let fastest = surface.texture.as_ref().unwrap().max_speed_m_s();
    let text = write(&surface);
    for (part, with, said) in [
        (
            format!("texture: (\n        {}", rate(1000.0)),
            "texture: (\n        rate_hz: 1e12,",
            "the texture's models",
        ),
        (
            format!("taps: (\n        {}", rate(taps.rate_hz())),
            "taps: (\n        rate_hz: 1e12,",
            "the taps' rate",
        ),
        (at(taps.taps().last().unwrap().speed_m_s), "speed_mm_s: 1e16,", "impact speed"),
        (at(fastest), "speed_mm_s: 1e16,", "at 1e13 m/s"),
    ] {
        let broken = text.replace(&part, with);
        assert_ne!(broken, text, "{part}");
        let error = read_surface(broken.as_bytes()).unwrap_err().to_string();
        assert!(error.contains(said), "{error}");
    }
}
