//! What haptograph depends on: under which licences, and of how many crates the engine is made. `cargo deny check` looks at
//! the same list of licences, and needs a tool of its own.
#![allow(clippy::unwrap_used)]

use serde_json::Value;
use std::collections::{BTreeSet, HashMap};
use std::path::Path;
use std::process::Command;

/// Names in the engine's own tree, itself included: what an embedding program has to build.
const MAX_OF_ENGINE: usize = 47;
/// The same with the nodes that are there without the feature `touch`: what plays a `Gain`.
const MAX_OF_PLAIN_NODES: usize = 60;

/// The crates of the workspace and all that they need on this machine.
fn metadata() -> Value {
    let rustc = Command::new("rustc").arg("-vV").output().unwrap();
    let rustc = String::from_utf8(rustc.stdout).unwrap();
    let host = rustc.lines().find_map(|line| line.strip_prefix("host: ")).unwrap();
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--locked", "--offline", "--format-version", "1"])
        .args(["--filter-platform", host])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn text<'a>(value: &'a Value, key: &str) -> &'a str {
    value[key].as_str().unwrap()
}

/// The words in quotes between `begin` and the next `]` of `deny.toml`.
fn listed(begin: &str) -> Vec<String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("deny.toml");
    let all = std::fs::read_to_string(path).unwrap();
    let (_, rest) = all.split_once(begin).unwrap();
    let list = rest.split(']').next().unwrap();
    list.split('"').skip(1).step_by(2).map(str::to_owned).collect()
}

/// Whether an SPDX expression has a choice of licences that are all allowed.
fn is_allowed(expression: &str, allowed: &[String]) -> bool {
    let spaced = expression.replace('/', " OR ").replace('(', " ( ").replace(')', " ) ");
    let mut words = spaced.split_whitespace().peekable();
    any(&mut words, allowed)
}

type Words<'a> = std::iter::Peekable<std::str::SplitWhitespace<'a>>;

fn any(words: &mut Words<'_>, allowed: &[String]) -> bool {
    let mut is_allowed = all(words, allowed);
    while words.next_if_eq(&"OR").is_some() {
        is_allowed |= all(words, allowed);
    }
    is_allowed
}

fn all(words: &mut Words<'_>, allowed: &[String]) -> bool {
    let mut is_allowed = one(words, allowed);
    while words.next_if_eq(&"AND").is_some() {
        is_allowed &= one(words, allowed);
    }
    is_allowed
}

fn one(words: &mut Words<'_>, allowed: &[String]) -> bool {
    if words.next_if_eq(&"(").is_some() {
        let is_allowed = any(words, allowed);
        assert_eq!(words.next(), Some(")"));
        return is_allowed;
    }
    let mut licence = words.next().unwrap_or_default().to_owned();
    if words.next_if_eq(&"WITH").is_some() {
        licence += " WITH ";
        licence += words.next().unwrap_or_default();
    }
    allowed.contains(&licence)
}

#[test]
fn expressions_of_licences_are_read_as_they_are_meant() {
    let allowed = ["MIT", "Zlib", "A WITH B"].map(str::to_owned);
    for (expression, expected) in [
        ("MIT", true),
        ("GPL-3.0", false),
        ("GPL-3.0 OR MIT", true),
        ("GPL-3.0/MIT", true),
        ("GPL-3.0 AND MIT", false),
        ("(GPL-3.0 OR MIT) AND Zlib", true),
        ("GPL-3.0 OR MIT AND Zlib", true),
        ("(GPL-3.0 OR MIT) AND BSL-1.0", false),
        ("A WITH B", true),
        ("A", false),
        ("", false),
    ] {
        assert_eq!(is_allowed(expression, &allowed), expected, "{expression}");
    }
}

#[test]
fn every_crate_may_be_used() {
    let allowed = listed("allow = [");
    assert!(allowed.len() >= 5, "{allowed:?}");
    let exceptions = listed("exceptions = [");
    let metadata = metadata();
    let packages = metadata["packages"].as_array().unwrap();
    assert!(packages.len() > 100, "{}", packages.len());
    for package in packages {
        let (name, licence) = (text(package, "name"), package["license"].as_str());
        let licence = licence.unwrap_or_else(|| panic!("{name} states no licence"));
        let excepted = exceptions.first().is_some_and(|excepted| excepted == name);
        let allowed = match excepted {
            true => &exceptions[1..],
            false => &allowed[..],
        };
        assert!(is_allowed(licence, allowed), "{name} is under {licence}: see deny.toml");
    }
}

/// The names of all crates that are built for one of the workspace, itself included.
fn tree(metadata: &Value, root: &str) -> BTreeSet<String> {
    let packages = metadata["packages"].as_array().unwrap().iter();
    let names: HashMap<&str, &str> = packages.map(|one| (text(one, "id"), text(one, "name"))).collect();
    let nodes = metadata["resolve"]["nodes"].as_array().unwrap().iter();
    let nodes: HashMap<&str, &Value> = nodes.map(|node| (text(node, "id"), node)).collect();
    let is_root = |(_, name): &(&&str, &&str)| **name == root;
    let mut open = vec![*names.iter().find(is_root).unwrap().0];
    let mut found = BTreeSet::new();
    while let Some(id) = open.pop() {
        if !found.insert(id) {
            continue;
        }
        for dependency in nodes[id]["deps"].as_array().unwrap() {
            let mut kinds = dependency["dep_kinds"].as_array().unwrap().iter();
            // Neither for tests nor for build scripts.
            if kinds.any(|kind| kind["kind"].is_null()) {
                open.push(text(dependency, "pkg"));
            }
        }
    }
    found.into_iter().map(|id| names[id].to_owned()).collect()
}

#[test]
fn the_engine_stays_small() {
    let tree = tree(&metadata(), "haptograph-engine");
    assert!(tree.contains("petgraph") && tree.contains("haptograph-signal"), "{tree:?}");
    assert!(tree.len() <= MAX_OF_ENGINE, "{} crates: {tree:?}", tree.len());
}

#[test]
fn a_program_that_plays_a_gain_needs_few_crates() {
    let output = Command::new(env!("CARGO"))
        .args(["tree", "--locked", "--offline", "-p", "haptograph-nodes", "--no-default-features"])
        .args(["--edges", "normal", "--prefix", "none", "--no-dedupe", "--format", "{p}"])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    let all = String::from_utf8(output.stdout).unwrap();
    let names: BTreeSet<&str> = all.lines().filter_map(|line| line.split(' ').next()).collect();
    assert!(names.contains("haptograph-engine"), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(names.len() <= MAX_OF_PLAIN_NODES, "{} crates: {names:?}", names.len());
}

#[test]
fn no_crate_is_there_twice_but_those_of_the_list() {
    let lock = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("Cargo.lock")).unwrap();
    let mut versions: HashMap<&str, usize> = HashMap::new();
    for line in lock.lines() {
        if let Some(name) = line.strip_prefix("name = ") {
            *versions.entry(name.trim_matches('"')).or_default() += 1;
        }
    }
    assert!(versions.len() > 100, "{} crates", versions.len());
    let twice = versions.iter().filter(|(_, count)| **count > 1);
    let twice: BTreeSet<&str> = twice.map(|(name, _)| *name).collect();
    let skipped = listed("skip = [");
    let skipped: BTreeSet<&str> = skipped.iter().map(String::as_str).collect();
    assert_eq!(twice, skipped, "the list is in deny.toml");
}

#[test]
fn every_crate_has_its_licences_and_tells_its_features() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let text = |path: &str| std::fs::read_to_string(root.join(path)).unwrap();
    for folder in
        [".", "signal", "engine", "surfaces", "nodes", "learning", "live", "report", "study", "studio"]
    {
        for licence in ["LICENSE-APACHE", "LICENSE-MIT"] {
            let found = std::fs::read_to_string(root.join(folder).join(licence)).ok();
            assert_eq!(found, Some(text(licence)), "{folder}/{licence}");
        }
        let manifest = text(&format!("{folder}/Cargo.toml"));
        let Some((_, features)) = manifest.split_once("\n[features]\n") else {
            continue;
        };
        let features = features.split("\n[").next().unwrap().lines();
        let names = features.filter_map(|line| line.split_once(" = [")).map(|(name, _)| name);
        for name in names.filter(|name| *name != "default") {
            for page in ["README.md", "src/lib.rs"] {
                let row = format!("| `{name}` |");
                assert!(text(&format!("{folder}/{page}")).contains(&row), "{folder}/{page}: {row}");
            }
        }
    }
}
