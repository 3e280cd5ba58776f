use super::*;
use crate::plot_request::Form;
use crate::record::{Reduction, WatchedOutput};
use crate::sound::Clip;
use haptograph_engine::frame::{Kind, OneKind, Record as _};
use haptograph_engine::node::Stream;
use haptograph_nodes::texture::frames::Weights;
use haptograph_signal::quantity::Quantity;
use haptograph_signal::time::Rate;

fn record(
    name: &str,
    kind: Kind,
    quantity: Quantity,
    hz: u64,
    frames: impl Iterator<Item = f64>,
) -> Recorded {
    let rate = Rate::from_hz(hz).unwrap();
    let mut recorded = Recorded::of(Stream { name: name.into(), kind, quantity, rate, simulated: true });
    for block in frames.collect::<Vec<_>>().chunks(kind.width() * 64) {
        recorded.extend(block);
    }
    recorded
}

/// Ten seconds of synthetic touch signals.
fn signals(seconds: u64) -> Vec<Recorded> {
    let hand = |t: f64| (0.08 * (1.0 - (5.0 * t).cos()), 1.2 + 0.6 * (1.7 * t).sin());
    let mut seed = 1u64;
    let mut noise = move || {
        seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (seed >> 40) as f64 / (1u64 << 23) as f64 - 1.0
    };
    let (mut y1, mut y2) = (0.0, 0.0);
    let vibration = (0..seconds * 10_000).map(move |i| {
        let (v, f) = hand(i as f64 / 1e4);
        let y: f64 = 1.9 * y1 - 0.95 * y2 + 2.0 * noise() * (v * f).sqrt();
        (y1, y2) = (y, y1);
        y
    });
    let at = move |i: u64, hz: f64| hand(i as f64 / hz);
    let place = (0..seconds * 240).flat_map(move |i| {
        let (speed_m_s, force_n) = at(i, 240.0);
        Weights { speed_m_s, force_n, ..Weights::default() }.to_components()
    });
    let position = (0..seconds * 125).flat_map(|i| {
        let t = i as f64 / 125.0;
        [0.03 * (5.0 * t).cos(), 0.03 * (5.0 * t).sin(), 0.0]
    });
    vec![
        record("stylus.position", Kind::VECTOR, Quantity::LENGTH, 125, position),
        record(
            "stylus.force",
            Kind::SCALAR,
            Quantity::FORCE,
            125,
            (0..seconds * 125).map(move |i| at(i, 125.0).1),
        ),
        record(
            "speed.speed",
            Kind::SCALAR,
            Quantity::SPEED,
            125,
            (0..seconds * 125).map(move |i| at(i, 125.0).0),
        ),
        record("texture/locate.weights", Weights::KIND, Quantity::NUMBER, 240, place),
        record("texture/filter.acceleration", Kind::SCALAR, Quantity::ACCELERATION, 10_000, vibration),
    ]
}

/// A page without its images, whose encoded text may contain anything.
fn written(html: &str) -> String {
    let mut parts = html.split("base64,");
    let first = parts.next().unwrap_or_default();
    let is_letter = |c: char| c.is_ascii_alphanumeric() || "+/=".contains(c);
    let rest = parts.flat_map(|part| ["base64,", part.trim_start_matches(is_letter)]);
    std::iter::once(first).chain(rest).collect()
}

#[test]
fn a_page_shows_everything_and_fetches_nothing() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs/surfaces/t3-tile.ron");
    let surface = haptograph_surfaces::files::load(&path).unwrap();
    let texture = surface.texture.unwrap();
    let sound = sound();
    let page = Page {
        title: "texturepad <b>".into(),
        about: "A stylus on a tablet.\n\nIt & more.".into(),
        simulation: Simulation::All,
        facts: vec![("Seed".into(), "7".into()), ("Surface".into(), "tile".into())],
        warnings: vec!["The limit of out held back 3 of 480000 ticks.".into()],
        headlines: vec![Headline::new("Held back", "0 %", "out")],
        files: vec![("a b#c.wav".into(), "what `file` got".into())],
        sound: Some(&sound),
        signals: signals(10),
        textures: vec![("texture/locate.weights".into(), texture)],
        ..Page::default()
    };
    let html = page.to_html();
    assert!(!written(&html).contains("NaN") && !html.contains("texturepad <b>"));
    for outside in ["src=\"http", "href=\"http", "url(", "<link", "@import", "fetch("] {
        assert!(!html.contains(outside), "{outside}");
    }
    assert!(html.contains("href=\"./a%20b%23c.wav\""));
    for name in [
        "stylus.force",
        "speed.speed",
        "spectrogram",
        "The stroke over",
        "simulated",
        "held back",
        "Strongest frequency",
        "50 ms up close",
        "src=\"data:audio/wav;base64,UklGR",
    ] {
        assert!(html.contains(name), "{name}");
    }
    // 1.28 MB of it are the sound.
    assert!(html.len() < 1_900_000, "{}", html.len());
    let body = html.split_once("<main>").unwrap().1.split_once("</main>").unwrap().0;
    roxmltree::Document::parse(&format!("<main>{body}</main>")).unwrap();
    if let Some(folder) = std::env::var_os("HAPTOGRAPH_PICTURES") {
        std::fs::write(std::path::Path::new(&folder).join("page.html"), html).unwrap();
    }
}

/// Ten seconds of a vibration of the page's signals.
fn sound() -> Sound {
    let stream = signals(1).remove(4).stream;
    let mut clip = Clip::of(stream);
    let samples: Vec<f64> = (0..100_000).map(|i| (f64::from(i) * 0.2).sin()).collect();
    clip.extend(&samples);
    Sound::of([&clip]).unwrap()
}

#[test]
fn the_policy_allows_the_pages_own_script_and_nothing_from_elsewhere() {
    let html = Page::default().to_html();
    let (_, rest) = html.split_once("<script>").unwrap();
    let (script, rest) = rest.split_once("</script>").unwrap();
    assert!(!rest.contains("<script"));
    let hash = STANDARD.encode(Sha256::digest(script));
    let (_, policy) = html.split_once("Content-Security-Policy\" content=\"").unwrap();
    let (policy, _) = policy.split_once('"').unwrap();
    assert!(policy.starts_with("default-src 'none';"), "{policy}");
    assert!(policy.ends_with(&format!("script-src 'sha256-{hash}'")), "{policy}");
}

#[test]
fn what_is_constant_the_same_or_shown_already_is_named_and_not_drawn() {
    let scalar =
        |name: &str, values: Vec<f64>| record(name, Kind::SCALAR, Quantity::FORCE, 125, values.into_iter());
    let wave = || (0..500).map(|i| (f64::from(i) * 0.1).sin()).collect::<Vec<_>>();
    let hum = |hz: u64| (0..4 * hz).map(move |i| (20.0 * i as f64 / hz as f64).sin());
    let steps = || (0..500).map(f64::from).collect::<Vec<_>>();
    let drawn = |name: &str, values: Vec<f64>| {
        let stream = scalar(name, vec![]).stream;
        let mut trace = Trace::of(stream.clone(), Form::OverTime);
        trace.extend(&values);
        let (node, output) = (haptograph_engine::graph::NodeId::default(), 0);
        (WatchedOutput { node, output, stream }, trace)
    };
    let (watch, trace) = drawn("asked", steps());
    let asked = PlotRequest {
        title: "Steps".into(),
        form: Form::OverTime,
        names: vec!["asked".into()],
        signals: vec![watch],
    };
    let noisy = steps().iter().enumerate().map(|(i, x)| x + (i % 3) as f64).collect();
    let page = Page {
        signals: vec![
            scalar("drawn", wave()),
            scalar("flat", vec![0.5; 500]),
            scalar("twin", wave()),
            scalar("asked", steps()),
            scalar("alias", steps()),
            scalar("sensed", noisy),
            record("slow twin", Kind::SCALAR, Quantity::LENGTH, 1000, hum(1000)),
            record("fast twin", Kind::SCALAR, Quantity::LENGTH, 10_000, hum(10_000)),
        ],
        requests: vec![(&asked, vec![trace])],
        ..Page::default()
    };
    let html = page.to_html();
    assert_eq!(html.matches("<figure class=\"plot\"").count(), 3);
    for said in [
        "Nearly the same, but for noise and rate: sensed as asked, slow twin as fast twin",
        "flat (0.5 N)",
        "The same: twin as drawn, alias as asked",
        "Shown above over time: asked",
    ] {
        assert!(html.contains(said), "{said}");
    }
}

#[test]
fn temperatures_are_in_degrees_celsius_and_densities_in_plain_units() {
    let warm = record("coil", Kind::SCALAR, Quantity::TEMPERATURE, 10, [293.15, 303.15].into_iter());
    let plot = figures::over_time(&warm, crate::theme::Ink::Blue).remove(0);
    assert_eq!(plot.y.label, "Temperature (°C)");
    assert_eq!(plot.caption, "Rises from 20 to 30 °C.");
    let hum = (0..20_000).map(|i| (f64::from(i) * 0.3).sin());
    let hum = record("out", Kind::SCALAR, Quantity::CURRENT, 10_000, hum);
    let spectrum = figures::mean_spectrum(&hum, crate::theme::Ink::Blue).unwrap();
    assert_eq!(spectrum.y.label, "Density (A²/Hz)");
}

#[test]
fn the_page_of_a_long_run_is_no_larger() {
    let size = |seconds| Page { signals: signals(seconds), ..Page::default() }.to_html().len();
    let (short, long) = (size(10), size(100));
    assert!(long < 2 * short, "{short} {long}");
}
