//! The header is what the source says. `HAPTOGRAPH_HEADER=write` writes it, which is what the script `header` does.

use std::path::Path;

fn generated() -> String {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(here.join("cbindgen.toml")).expect("a configuration");
    let sources = ["", "/error", "/graph", "/channel", "/player", "/live"];
    let mut builder = cbindgen::Builder::new().with_config(config);
    for source in sources {
        builder = builder.with_src(here.join(format!("src/border{source}.rs")));
    }
    let mut header = Vec::new();
    builder.generate().expect("bindings").write(&mut header);
    String::from_utf8(header).expect("UTF-8")
}

/// What Rust has to be told of a function's safety stands in the header's first lines.
fn without_safety(header: &str) -> String {
    let mut kept = Vec::new();
    let mut skips = false;
    for line in header.lines() {
        let comment = line.trim_start().strip_prefix("//").map(str::trim);
        skips = match comment {
            Some("# Safety") => true,
            Some(_) => skips,
            None => false,
        };
        if skips {
            // The empty line before the heading goes too.
            if comment == Some("# Safety") && kept.last().is_some_and(|line: &&str| line.trim() == "//") {
                kept.pop();
            }
        } else {
            kept.push(line);
        }
    }
    kept.join("\n") + "\n"
}

#[test]
fn the_header_is_up_to_date() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("include/haptograph.h");
    let wanted = without_safety(&generated());
    if std::env::var_os("HAPTOGRAPH_HEADER").is_some_and(|what| what == "write") {
        std::fs::write(&path, &wanted).expect("a header");
    }
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    let differs = committed.lines().zip(wanted.lines()).position(|(old, new)| old != new);
    assert!(
        committed == wanted,
        "include/haptograph.h is stale from line {:?} on: run bindings/c/header",
        differs.map(|line| line + 1)
    );
}

#[test]
fn the_header_has_the_version_of_the_package() {
    let header = generated();
    for (part, value) in [
        ("MAJOR", env!("CARGO_PKG_VERSION_MAJOR")),
        ("MINOR", env!("CARGO_PKG_VERSION_MINOR")),
        ("PATCH", env!("CARGO_PKG_VERSION_PATCH")),
    ] {
        let line = format!("#define HAPTOGRAPH_VERSION_{part} {value}\n");
        assert!(header.contains(&line), "{line}");
    }
}
