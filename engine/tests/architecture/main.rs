//! Who may know whom: the rooms of the engine, and what is in nobody's signature. [`shape`] holds the sizes.

mod shape;
mod source;

use std::fs;
use std::path::{Path, PathBuf};

/// Rooms, and what their code must not name.
const BANS: [(&str, &[&str]); 18] = [
    ("bridges", LEAF),
    // The body of an endpoint of the calling program is the host's.
    ("device", &["crate::graph", "crate::plan", "crate::run", "petgraph"]),
    ("diagnostic", LEAF),
    ("formula", LEAF),
    ("frame", LEAF),
    ("histogram", LEAF),
    ("io", LEAF),
    ("limiter", LEAF),
    ("node", LEAF),
    ("node_id", LEAF),
    ("registry", LEAF),
    ("settings", LEAF),
    ("silence", LEAF),
    (
        "document",
        &["crate::graph::{", "crate::graph;", "crate::plan", "crate::run", "crate::host", "petgraph"],
    ),
    ("graph", &["crate::plan", "crate::run", "crate::host"]),
    ("plan", &["crate::run", "crate::host"]),
    // A run asks the `Planner` of its graph.
    ("run", &["crate::graph", "crate::host", "petgraph"]),
    ("host", &["petgraph"]),
];

/// What rooms do not name that graphs are made of.
const LEAF: &[&str] = &["crate::graph", "crate::plan", "crate::run", "crate::host", "petgraph"];

/// The code of a file: no comments, and nothing from its tests on.
fn code(path: &Path) -> String {
    let text = fs::read_to_string(path).expect("a source file can be read");
    // An attribute of one line alone, such as an import for tests, does not end it.
    let text = text.split("#[cfg(test)]\nmod ").next().unwrap_or_default();
    let lines = text.lines().filter(|line| !line.trim_start().starts_with("//"));
    lines.collect::<Vec<_>>().join("\n")
}

#[test]
fn no_room_knows_those_above_it() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut breaches = Vec::new();
    let mut read = 0;
    for (room, banned) in BANS {
        let alone = root.join(room).with_extension("rs");
        let folder = root.join(room);
        let inside = if folder.is_dir() { source::files(&folder) } else { Vec::new() };
        let files: Vec<PathBuf> = { inside.into_iter() }.chain(alone.exists().then_some(alone)).collect();
        assert!(!files.is_empty(), "{room}");
        for path in files {
            let code = code(&path);
            read += 1;
            let named = banned.iter().filter(|name| code.contains(**name));
            breaches.extend(named.map(|name| format!("{}: {name}", path.display())));
        }
    }
    assert!(read > 50, "{read} files");
    assert!(breaches.is_empty(), "{}", breaches.join("\n"));
}

/// Kinds of frames that only touch has: the engine carries them without knowing them.
const OF_TOUCH: [&str; 3] = ["contact", "weights", "coefficients"];

#[test]
fn the_engine_has_no_kind_of_touch() {
    let (mut breaches, mut read) = (Vec::new(), 0);
    for path in source::files(&root().join("engine/src")) {
        let code = code(&path);
        read += 1;
        for kind in OF_TOUCH {
            let (quoted, upper) = (format!("{kind:?}"), kind.to_uppercase());
            let named = format!("{}{}", &upper[..1], &kind[1..]);
            let words = code.split(|c: char| !(c.is_alphanumeric() || c == '_'));
            let is_named = words.into_iter().any(|word| word == named || word == upper);
            breaches
                .extend((is_named || code.contains(&quoted)).then(|| format!("{}: {kind}", path.display())));
        }
    }
    assert!(read > 80, "{read} files");
    assert!(breaches.is_empty(), "{}", breaches.join("\n"));
}

/// The crates from the bottom up: each may name those of lower layers only. Two of one layer never name each other.
const LAYERS: [&[&str]; 7] = [
    &["signal"],
    &["engine", "surfaces"],
    &["nodes", "learning"],
    &["live", "report", "study"],
    &["studio"],
    &[".", "bindings/c", "studio/wasm"],
    &["bindings/python", "benches/instructions"],
];

/// Workspaces of their own that measure, show and attack the others, and that nobody names.
const OUTSIDE: [&str; 3] = ["benches/peers", "examples/network", "fuzz"];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn manifest(folder: &str) -> String {
    let path = root().join(folder).join("Cargo.toml");
    fs::read_to_string(path).expect("a crate has a manifest")
}

/// The name of the package of a folder of [`LAYERS`].
fn package(folder: &str) -> String {
    match folder {
        "." => "haptograph".to_owned(),
        "studio/wasm" => "haptograph-wasm".to_owned(),
        "bindings/c" => "haptograph-c".to_owned(),
        "bindings/python" => "haptograph-python".to_owned(),
        "benches/instructions" => "haptograph-instructions".to_owned(),
        _ => format!("haptograph-{folder}"),
    }
}

/// The names of all dependencies of a manifest: those for tests, for some systems, and optional ones too.
fn dependencies(manifest: &str) -> Vec<&str> {
    let mut names = Vec::new();
    let mut is_list = false;
    for line in manifest.lines().map(str::trim) {
        if let Some(section) = line.strip_prefix('[') {
            is_list =
                section.trim_end_matches(']').ends_with("dependencies") && !section.starts_with("workspace");
        } else if is_list && !line.starts_with('#') {
            let end = line.find(['.', ' ', '=']).unwrap_or(0);
            names.push(&line[..end]);
        }
    }
    names
}

#[test]
fn crates_name_those_below_them_only() {
    let mut breaches = Vec::new();
    let mut named = 0;
    for (layer, folders) in LAYERS.iter().enumerate() {
        let below: Vec<String> = LAYERS[..layer].concat().into_iter().map(package).collect();
        for folder in *folders {
            let text = manifest(folder);
            assert!(text.contains(&format!("name = \"{}\"", package(folder))), "{folder}");
            for name in dependencies(&text) {
                if name.starts_with("haptograph") {
                    named += 1;
                    let is_below = below.iter().any(|package| package == name);
                    breaches.extend((!is_below).then(|| format!("{folder} names {name}")));
                }
            }
        }
    }
    assert!(named > 20, "{named} dependencies were read");
    assert!(breaches.is_empty(), "{}", breaches.join("\n"));
}

/// What speaks to hardware or to the system's scheduler.
const HARDWARE: [&str; 6] = ["cpal", "evdev", "midir", "rosc", "thread-priority", "serialport"];

#[test]
fn hardware_is_reached_by_one_crate() {
    for folder in LAYERS.concat() {
        let text = manifest(folder);
        let named: Vec<&str> =
            dependencies(&text).into_iter().filter(|name| HARDWARE.contains(name)).collect();
        match folder {
            "live" => assert!(named.len() > 4, "{named:?}"),
            // For an example.
            "." => assert_eq!(named, ["cpal"]),
            _ => assert_eq!(named, [""; 0], "{folder}"),
        }
    }
}

#[test]
fn every_crate_has_a_layer() {
    let text = manifest(".");
    let list = |key: &str| -> Vec<String> {
        let line = text.lines().find_map(|line| line.strip_prefix(key));
        let words = line.expect("the workspace lists its crates").split('"');
        words.skip(1).step_by(2).map(str::to_owned).collect()
    };
    let all = [list("members = "), list("exclude = ")].concat();
    assert!(all.len() > 8, "{all:?}");
    for folder in all {
        let has_layer = LAYERS.concat().contains(&&*folder) || OUTSIDE.contains(&&*folder);
        assert!(has_layer, "{folder} is in no layer: see LAYERS");
    }
}

/// The last argument of each call of `function` in a piece of code.
fn last_arguments<'a>(code: &'a str, function: &str) -> Vec<&'a str> {
    let calls = code.split(function).skip(1);
    let arguments = calls.filter_map(|call| {
        let mut depth = 1_usize;
        let end = call.find(|c: char| {
            depth = match c {
                '(' => depth + 1,
                ')' => depth - 1,
                _ => depth,
            };
            depth == 0
        });
        call[..end?].trim().trim_end_matches(',').rsplit(',').next()
    });
    arguments.map(str::trim).collect()
}

/// A limit is that of a kind of file, or comes from the caller, or the file is read piece by piece to its end.
fn is_known_limit(limit: &str, kinds: &[&str]) -> bool {
    let name = limit.rsplit("::").next().unwrap_or_default();
    let is_from_caller = limit.ends_with("max_bytes") || limit.ends_with("left_bytes");
    is_from_caller || limit == "u64::MAX" || kinds.contains(&name)
}

#[test]
fn files_are_read_within_the_limit_of_their_kind() {
    let limits = code(&root().join("signal/src/files/limits.rs"));
    let kinds: Vec<&str> =
        { limits.split("pub const ").skip(1) }.filter_map(|item| item.split(':').next()).collect();
    assert!(kinds.len() > 8, "{kinds:?}");
    let (mut read, mut breaches) = (0, Vec::new());
    for folder in LAYERS.concat() {
        let folder = root().join(folder).join("src");
        if !folder.is_dir() {
            continue;
        }
        for path in source::files(&folder) {
            let code = code(&path);
            for function in ["files::read(", "files::read_text(", "files::open(", "bounded::read("] {
                for limit in last_arguments(&code, function) {
                    read += 1;
                    let is_known = is_known_limit(limit, &kinds);
                    breaches.extend((!is_known).then(|| format!("{}: {limit}", path.display())));
                }
            }
        }
    }
    assert!(read > 30, "{read} calls");
    assert!(breaches.is_empty(), "{}", breaches.join("\n"));
    let own = last_arguments("files::read(&path(a, b), 1 << 20)?; files::open(p, MAX_BYTES)", "files::read(");
    assert_eq!(own, ["1 << 20"]);
    assert!(!is_known_limit("1 << 20", &kinds) && !is_known_limit("MAX_BYTES", &kinds));
}

/// What the public items of a file name: signatures however many lines they take, fields of public structures, what is
/// re-exported.
fn public_items(code: &str) -> Vec<String> {
    let lines: Vec<&str> = code.lines().map(str::trim).collect();
    let mut items = Vec::new();
    let mut is_in_public_struct = false;
    for (number, line) in lines.iter().enumerate() {
        let words = line.strip_prefix("pub ").unwrap_or(line);
        let is_item = ["fn", "const", "async", "unsafe", "use", "type", "static", "trait", "struct", "enum"]
            .iter()
            .any(|word| words.starts_with(&format!("{word} ")));
        let begins = |word: &str| words.split("fn ").next().is_some_and(|words| words.contains(word));
        if begins("struct ") || begins("enum ") || line.starts_with("impl") || line.contains("fn ") {
            is_in_public_struct = line.starts_with("pub struct ");
        }
        let is_field = is_in_public_struct && !is_item;
        if !line.starts_with("pub ") || !(is_item || is_field) {
            continue;
        }
        let ends: &[char] = match words.split(' ').next() {
            Some("use") => &[';'],
            _ => &['{', ';'],
        };
        let rest = lines[number..].join(" ");
        let item = match is_field {
            true => line,
            false => rest.split(ends).next().unwrap_or_default(),
        };
        items.push(without_private_fields(item));
    }
    items
}

/// A tuple structure with its public fields only; anything else as it is.
fn without_private_fields(item: &str) -> String {
    let Some((name, fields)) = item.split_once('(').filter(|_| item.starts_with("pub struct ")) else {
        return item.to_owned();
    };
    let public = fields.split(',').filter(|field| field.trim_start().starts_with("pub "));
    name.to_owned() + &public.collect::<String>()
}

/// Of the graph library, whose types are in no public signature.
const PRIVATE: [&str; 5] = ["NodeIndex", "EdgeIndex", "DiGraph", "EdgeReference", "petgraph"];

fn breaches(code: &str) -> Vec<String> {
    let items = public_items(code).into_iter();
    items.filter(|item| PRIVATE.iter().any(|name| item.contains(name))).collect()
}

#[test]
fn a_breach_is_seen_wherever_it_stands() {
    for breach in [
        "pub fn at(&self) -> NodeIndex {",
        "pub fn at(\n    &self,\n    node: NodeIndex,\n) -> bool {",
        "pub fn at<T>(node: T)\nwhere\n    T: Into<NodeIndex>,\n{",
        "pub const fn at(node: NodeIndex) {}",
        "pub struct Graph {\n    name: String,\n    pub nodes: DiGraph<Node, Edge>,\n}",
        "pub struct Id(pub NodeIndex);",
        "pub type Id = NodeIndex;",
        "pub use petgraph::{\n    algo,\n    graph,\n};",
    ] {
        assert_eq!(breaches(breach).len(), 1, "{breach}");
    }
    for sound in [
        "pub(crate) fn at(node: NodeIndex) {}",
        "fn at() {\n    let node: NodeIndex;\n}",
        "pub fn at() {\n    let node: NodeIndex;\n}",
        "pub struct Graph {\n    nodes: DiGraph<Node, Edge>,\n    pub(crate) more: NodeIndex,\n}",
        "pub(crate) struct Graph {\n    pub nodes: DiGraph<Node, Edge>,\n}",
        "pub struct Id(pub(crate) NodeIndex);",
        "use petgraph::graph::NodeIndex;",
    ] {
        assert_eq!(breaches(sound), [""; 0], "{sound}");
    }
}

#[test]
fn nobody_but_the_engine_knows_the_graph_library() {
    for folder in LAYERS.concat().into_iter().filter(|folder| *folder != "engine") {
        let text = manifest(folder);
        assert!(!dependencies(&text).contains(&"petgraph"), "{folder}");
    }
    let mut read = 0;
    for path in source::files(&root().join("engine/src")) {
        let code = code(&path);
        read += public_items(&code).len();
        assert_eq!(breaches(&code), [""; 0], "{}", path.display());
    }
    assert!(read > 300, "{read} public items");
}
