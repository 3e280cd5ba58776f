//! Reading is total: any bytes give a surface or an error, never a panic, a hang, or memory beyond ten times the file
//! plus a mebibyte.

#![allow(clippy::unwrap_used)] // Helpers of tests are tests.

use haptograph_surfaces::files::{hatt, native, read_surface};
use haptograph_surfaces::hull::Hull;
use haptograph_surfaces::{
    ArmaModel, Friction, ModelAt, Origin, Provenance, Stiffness, Surface, Tap, Taps, TextureModel, VertexKind,
};
use peak_alloc::PeakAlloc;
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::sync::Mutex;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// One reader at a time, as memory is counted for the whole process.
static ALONE: Mutex<()> = Mutex::new(());

/// Reads; a surface must survive being written and read again.
fn read(bytes: &[u8]) -> bool {
    let before = MEMORY.current_usage();
    MEMORY.reset_peak_usage();
    let read = read_surface(bytes);
    let used = MEMORY.peak_usage().saturating_sub(before);
    let allowed = 10 * bytes.len() + (1 << 20);
    assert!(
        used <= allowed,
        "{used} bytes for {}: {}",
        bytes.len(),
        String::from_utf8_lossy(&bytes[..bytes.len().min(200)])
    );
    match read {
        Ok(surface) => {
            assert_eq!(read_surface(native::write(&surface).as_bytes()), Ok(surface));
            true
        }
        Err(error) => {
            assert!(!error.to_string().is_empty());
            false
        }
    }
}

/// Small files of each kind.
fn seeds() -> Vec<Vec<u8>> {
    let model = |a: f64, ma: &[f64], gain: f64| ArmaModel::from_arma(&[a, 0.3], ma, gain, 0.7).unwrap();
    let at = |speed_m_s: f64, force_n: f64, model: ArmaModel| ModelAt {
        speed_m_s,
        force_n,
        model,
        kind: VertexKind::Measured,
    };
    let hull = Hull { speed_steps: 1, force_steps: 1, ..Hull::default() };
    let texture = |rate_hz: f64, ma: &[f64], gain: f64| {
        let measured = vec![at(0.05, 1.0, model(-0.9, ma, gain)), at(0.2, 2.5, model(0.4, ma, gain))];
        TextureModel::from_measured(rate_hz, measured, &hull).unwrap()
    };
    let provenance = Provenance::new(Origin::Simulated, "a \"seed\"").with_setting("seed", 7);
    let mut surface = Surface::new("T & <2>", provenance);
    surface.friction = Some(Friction::new(0.35, Some(0.8)).unwrap());
    surface.stiffness = Some(Stiffness::new(17.8, None).unwrap());
    surface.texture = Some(texture(10_000.0, &[], 1.0));
    let tap = |speed_m_s: f64| Tap {
        speed_m_s,
        acceleration_m_s2: (0..100).map(|k| f64::from(k % 7)).collect(),
        peak_force_n: None,
    };
    surface.taps = Some(Taps::new(1000.0, vec![tap(0.1)]).unwrap());
    let taps = hatt::write_taps(&surface).unwrap();
    let fast = hatt::write_models(&surface).unwrap();
    surface.texture = Some(texture(1000.0, &[0.2], 3.0));
    let slow = hatt::write_models(&surface).unwrap();
    surface.taps = Some(
        Taps::new(
            1000.0,
            vec![Tap { speed_m_s: 0.1, acceleration_m_s2: vec![1.0, 2.0], peak_force_n: Some(2.0) }],
        )
        .unwrap(),
    );
    [taps, fast, slow, native::write(&surface)].map(String::into_bytes).to_vec()
}

const WORDS: [&str; 40] = [
    "0",
    "-1",
    "1e999",
    "-1e-999",
    "NaN",
    "inf",
    "18446744073709551616",
    "0.1",
    "3.2",
    "1e5",
    "<value>",
    "</value>",
    "<value/>",
    "<tri>",
    "<model>",
    "</model>",
    "<tap>",
    "<!--",
    "-->",
    "<![CDATA[",
    "]]>",
    "&amp;",
    "&#0;",
    "&x;",
    "<!DOCTYPE a>",
    "<?x?>",
    "(",
    ")",
    "[",
    "]",
    "{",
    "}",
    ",",
    ":",
    "\"",
    "/*",
    "Some(",
    "r#\"",
    "\u{feff}",
    "\u{0}",
];

/// One to four changes, of bytes, numbers, words and whole passages.
fn mutate(seeds: &[Vec<u8>], random: &mut Xoshiro256PlusPlus) -> Vec<u8> {
    let mut bytes = seeds[random.random_range(0..seeds.len())].clone();
    for _ in 0..random.random_range(1..=4) {
        if bytes.is_empty() {
            break;
        }
        let at = random.random_range(0..bytes.len());
        let longest = random.random_range(1..200);
        let end = (at + random.random_range(1..=longest)).min(bytes.len());
        match random.random_range(0..9) {
            0 => bytes[at] ^= 1 << random.random_range(0..8),
            1 => bytes[at] = random.random(),
            2 => drop(bytes.drain(at..end)),
            3 => bytes.splice(at..at, bytes[at..end].to_vec()).for_each(drop),
            4 => bytes.truncate(at),
            5 => bytes.splice(at..at, WORDS[random.random_range(0..WORDS.len())].bytes()).for_each(drop),
            6 => {
                // A passage of another file.
                let other = &seeds[random.random_range(0..seeds.len())];
                let from = random.random_range(0..other.len());
                let passage = other[from..(from + end - at).min(other.len())].to_vec();
                bytes.splice(at..end, passage).for_each(drop);
            }
            7 => {
                // Another number where one stands.
                let number = |byte: &u8| byte.is_ascii_digit() || b".-e".contains(byte);
                if let Some(start) = bytes[at..].iter().position(number).map(|offset| at + offset) {
                    let length = bytes[start..].iter().take_while(|byte| number(byte)).count();
                    let word = WORDS[random.random_range(0..10)];
                    bytes.splice(start..start + length, word.bytes()).for_each(drop);
                }
            }
            _ => {
                // A line again, or gone.
                let start =
                    bytes[..at].iter().rposition(|&byte| byte == b'\n').map_or(0, |newline| newline + 1);
                let length =
                    bytes[start..].iter().position(|&byte| byte == b'\n').map_or(0, |newline| newline + 1);
                let line = bytes[start..start + length].to_vec();
                if random.random() {
                    bytes.splice(start..start, line).for_each(drop);
                } else {
                    bytes.drain(start..start + length);
                }
            }
        }
    }
    bytes
}

fn survive(inputs: usize, seed: u64) {
    let _alone = ALONE.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    let seeds = seeds();
    assert!(seeds.iter().all(|seed| read(seed)));
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let surfaces = (0..inputs).filter(|_| read(&mutate(&seeds, &mut random))).count();
    // Mutations that are all refused, or none, would test little.
    assert!(surfaces > inputs / 100 && surfaces < inputs / 2, "{surfaces} of {inputs} were surfaces");
}

#[test]
fn twenty_thousand_mutated_files() {
    survive(20_000, 1);
}

#[test]
#[ignore = "a million mutated files: minutes"]
fn a_million_mutated_files() {
    survive(1_000_000, 2);
}

#[test]
fn files_that_ask_for_memory_do_not_get_it() {
    let _alone = ALONE.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    let repeat =
        |head: &str, part: &str, tail: &str| [head, &part.repeat(300_000 / part.len()), tail].concat();
    let surface = "Surface(format: 1, name: \"\", provenance: (origin: imported, source: \"\", made_by: \"\"";
    let open = format!("{surface}), texture: (rate_hz: 1000, filters: [");
    for text in [
        repeat("", "(", ""),
        repeat("", "[", ""),
        repeat("", "Some(", ""),
        repeat("", "/*", ""),
        repeat("", "<a>", ""),
        repeat("<modelSet>", "<model>", ""),
        repeat("<modelSet>", "<model/>", ""),
        repeat("<modelSet>", "<tri><value>1</value><value>1</value><value>1</value></tri>", ""),
        repeat("<modelSet><speedList>", "<value>1</value>", ""),
        repeat("<modelSet><material>", "&amp;", ""),
        repeat("<modelSet><material>", "<![CDATA[a]]>", ""),
        repeat("<modelSet ", "a='b' ", ">"),
        repeat("<tapSet>", "<tap><tapSpeed>1</tapSpeed><tapAccel/></tap>", ""),
        repeat("<tapSet><tap><tapAccel>", "<value>1</value>", ""),
        repeat("", "<!-- haptograph surface: -->", "<tapSet>"),
        repeat("<", "a", "/>"),
        repeat(&open, "(ar:[]),", ""),
        repeat(&open, "(ar:[", ""),
        repeat(&format!("{open}(ar:["), "0,", "])])"),
        repeat(
            &format!("{open}(ar:[])], vertices:["),
            "(speed_mm_s:0,force_n:0,filter:0,variance:0,kind:edge),",
            "]))",
        ),
        repeat(&format!("{open}(ar:[])], vertices:[], triangles:["), "(0,0,0),", "]))"),
        repeat(&format!("{surface}, settings: {{"), "\"\":\"\",", "}))"),
        repeat(
            &format!("{surface}), taps: (rate_hz: 1000, taps: [(speed_mm_s: 1, acceleration_m_s2: ["),
            "0,",
            "])]))",
        ),
        repeat(
            &format!("{surface}), taps: (rate_hz: 1000, taps: ["),
            "(speed_mm_s:1,acceleration_m_s2:[]),",
            "]))",
        ),
        repeat(&format!("{surface}), "), "x: 1, ", ")"),
        repeat("Surface(name: \"", "\\u{e9}", "\")"),
    ] {
        read(text.as_bytes());
    }
}

#[test]
fn the_largest_map_that_is_read_keeps_within_its_memory() {
    let _alone = ALONE.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    let vertices: String = (0..32 * 32)
        .map(|k| {
            let (speed, force) = (k % 32, k / 32);
            let variance = u8::from(speed > 0 && force > 0);
            format!("(speed_mm_s:{speed},force_n:{force},filter:0,variance:{variance},kind:edge),")
        })
        .collect();
    let lsf: Vec<String> = (1..=32).map(|k| format!("{}", 0.09 * f64::from(k))).collect();
    let text = format!(
        "(format:1,name:\"\",provenance:(origin:imported,source:\"\",made_by:\"\"),texture:(rate_hz:1000,filters:[(ar_lsf:[{}])],vertices:[{vertices}]))",
        lsf.join(",")
    );
    assert!(read(text.as_bytes()), "{:?}", read_surface(text.as_bytes()).map(|_| ()));
}
