//! Who may know whom: the rooms of the engine, and what is in nobody's signature.

use std::fs;
use std::path::{Path, PathBuf};

/// Rooms, and what their code must not name.
const BANS: [(&str, &[&str]); 8] = [
    (
        "document",
        &[
            "crate::graph::{",
            "crate::graph;",
            "crate::plan",
            "crate::run",
            "crate::host",
            "petgraph",
        ],
    ),
    ("graph", &["crate::plan", "crate::run", "crate::host"]),
    ("plan", &["crate::run", "crate::host"]),
    ("run", &["crate::host", "petgraph"]),
    ("host", &["petgraph"]),
    (
        "limiter",
        &[
            "crate::graph",
            "crate::plan",
            "crate::run",
            "crate::host",
            "petgraph",
        ],
    ),
    (
        "settings",
        &[
            "crate::graph",
            "crate::plan",
            "crate::run",
            "crate::host",
            "petgraph",
        ],
    ),
    (
        "diagnostic",
        &[
            "crate::graph",
            "crate::plan",
            "crate::run",
            "crate::host",
            "petgraph",
        ],
    ),
];

/// The source files below a folder, without tests.
fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).expect("the room is there").flatten() {
        let path = entry.path();
        let name = entry.file_name();
        if name == "tests" || name == "tests.rs" {
            continue;
        }
        if path.is_dir() {
            found.extend(sources(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
    found
}

/// The code of a file: no comments, and nothing from its tests on.
fn code(path: &Path) -> String {
    let text = fs::read_to_string(path).expect("a source file can be read");
    let text = text.split("#[cfg(test)]").next().unwrap_or_default();
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
        for path in sources(&root.join(room))
            .into_iter()
            .chain(alone.exists().then_some(alone))
        {
            let code = code(&path);
            read += 1;
            let named = banned.iter().filter(|name| code.contains(**name));
            breaches.extend(named.map(|name| format!("{}: {name}", path.display())));
        }
    }
    assert!(read > 50, "{read} files");
    assert!(breaches.is_empty(), "{}", breaches.join("\n"));
}

#[test]
fn nobody_but_the_engine_knows_the_graph_library() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    for name in [
        "signal",
        "surfaces",
        "nodes",
        "report",
        "studio",
        "bindings/c",
        "bindings/python",
    ] {
        let manifest =
            fs::read_to_string(root.join(name).join("Cargo.toml")).expect("a crate has a manifest");
        assert!(!manifest.contains("petgraph"), "{name}");
    }
    // In the engine's own signatures it is private. The parts of a plan are seen by the crate alone.
    let types = ["NodeIndex", "EdgeIndex", "DiGraph", "EdgeReference"];
    for path in sources(&root.join("engine/src")) {
        let code = code(&path);
        let public = code.lines().map(str::trim_start).filter(|line| {
            line.starts_with("pub fn") || line.starts_with("pub use") || line.starts_with("pub type")
        });
        let named = |line: &&str| types.iter().any(|name| line.contains(name));
        assert_eq!(
            public.filter(named).collect::<Vec<_>>(),
            [""; 0],
            "{}",
            path.display()
        );
    }
}
