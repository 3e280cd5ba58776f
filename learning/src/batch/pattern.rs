//! Finds files by a pattern.

use super::problem::PlanProblem;
use haptograph_signal::files;
use std::io;
use std::path::{Path, PathBuf};

/// The files that match a pattern, in the order of their names: `*` in the last component matches any text.
pub(super) fn matching(folder: &Path, pattern: &str) -> Result<Vec<PathBuf>, PlanProblem> {
    let path = Path::new(pattern);
    let wanted = path.file_name().unwrap_or_default().to_string_lossy();
    if !wanted.contains('*') {
        return Ok(vec![path.to_owned()]);
    }
    let place = path.parent().unwrap_or(Path::new(""));
    let entries = files::entries(&match folder.join(place) {
        place if place.as_os_str().is_empty() => PathBuf::from("."),
        place => place,
    });
    let entries = entries.into_iter().flatten();
    let names: io::Result<Vec<_>> = entries.map(|entry| Ok(entry?.file_name())).collect();
    let mut found: Vec<PathBuf> = names?
        .into_iter()
        .filter(|name| fits(&wanted, &name.to_string_lossy()))
        .map(|name| place.join(name))
        .collect();
    found.sort();
    match found.is_empty() {
        true => Err(PlanProblem::NoMatch { pattern: pattern.to_owned() }),
        false => Ok(found),
    }
}

/// True if a name matches a pattern. Hidden names match only if the pattern begins with a dot.
fn fits(pattern: &str, name: &str) -> bool {
    let mut parts = pattern.split('*');
    let Some(mut rest) = parts.next().and_then(|first| name.strip_prefix(first)) else {
        return false;
    };
    if name.starts_with('.') && !pattern.starts_with('.') {
        return false;
    }
    let parts: Vec<&str> = parts.collect();
    let Some((last, middle)) = parts.split_last() else {
        return rest.is_empty();
    };
    for part in middle {
        let Some(place) = rest.find(part) else {
            return false;
        };
        rest = &rest[place + part.len()..];
    }
    rest.ends_with(last)
}

#[cfg(test)]
mod tests {
    use super::fits;

    #[test]
    fn a_star_stands_for_anything() {
        for (pattern, name, wanted) in [
            ("*.ron", "a.ron", true),
            ("*.ron", ".a.ron", false),
            ("t*-*.ron", "t2-canvas.ron", true),
            ("t*-*.ron", "t2canvas.ron", false),
            ("a*a", "a", false),
            ("a*a", "aa", true),
            ("*", "x", true),
        ] {
            assert_eq!(fits(pattern, name), wanted, "{pattern} {name}");
        }
    }
}
