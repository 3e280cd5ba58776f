//! Suggestions for misspelt names.

/// Longer words, in bytes, are not compared.
const MAX_COMPARED: usize = 64;

/// Shorter words are the beginning of too many others.
const LEAST_BEGINNING: usize = 3;

/// The candidate that `word` probably means: one that lacks only its unit (`low` for `low_hz`), the nearest by edit
/// distance if it is near enough, or the only one that begins with it (`low` for `lowest`).
pub fn closest<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    if word.len() > MAX_COMPARED {
        return None; // Comparing costs the product of the lengths, and such words are no slips of a finger.
    }
    let lower = word.to_lowercase();
    let candidates = candidates.into_iter();
    let comparable: Vec<(&str, String)> = candidates
        .filter(|candidate| candidate.len() <= MAX_COMPARED)
        .map(|candidate| (candidate, candidate.to_lowercase()))
        .collect();
    let rest = |candidate: &str| candidate.strip_prefix(&*lower).map(str::to_owned);
    let lacks_unit =
        |candidate: &str| !lower.is_empty() && rest(candidate).is_some_and(|rest| rest.starts_with('_'));
    if let Some((meant, _)) = comparable.iter().find(|(_, candidate)| lacks_unit(candidate)) {
        return Some(meant);
    }
    let (nearest, distance) = comparable
        .iter()
        .map(|(candidate, small)| (*candidate, edit_distance(&lower, small)))
        .min_by_key(|(_, distance)| *distance)?;
    let letters = word.chars().count();
    let allowed = (letters / 3).max(1).min(letters.saturating_sub(1));
    if distance <= allowed {
        return Some(nearest);
    }
    let mut begun = comparable.iter().filter(|(_, candidate)| rest(candidate).is_some());
    match (begun.next(), begun.next()) {
        (Some((only, _)), None) if letters >= LEAST_BEGINNING => Some(only),
        _ => None,
    }
}

/// Insertions, deletions, substitutions and swaps of neighbours that turn `a` into `b`.
fn edit_distance(a: &str, b: &str) -> usize {
    let a: Vec<char> = a.chars().collect();
    let b: Vec<char> = b.chars().collect();
    let mut before_last: Vec<usize> = Vec::new();
    let mut last: Vec<usize> = (0..=b.len()).collect();
    for i in 1..=a.len() {
        let mut row = vec![i; b.len() + 1];
        for j in 1..=b.len() {
            let substituted = last[j - 1] + usize::from(a[i - 1] != b[j - 1]);
            row[j] = substituted.min(row[j - 1] + 1).min(last[j] + 1);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                row[j] = row[j].min(before_last[j - 2] + 1);
            }
        }
        before_last = std::mem::replace(&mut last, row);
    }
    last[b.len()]
}

/// Advice about an unknown name: the closest one, or all of them after `are`.
pub fn choices(name: &str, known: &[&str], are: &str) -> String {
    const SHOWN: usize = 12;
    match (closest(name, known.iter().copied()), known.len()) {
        (Some(near), _) => format!("; did you mean `{near}`?"),
        (None, 0) => String::new(),
        (None, 1..=SHOWN) => format!("; {are} {}", known.join(", ")),
        (None, _) => format!("; {are} {} and {} others", known[..SHOWN].join(", "), known.len() - SHOWN),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_words_are_guessed_and_far_ones_are_not() {
        let words = ["gain", "Hold", "frequency_hz", "x", "low_hz", "loudest", "load_n", "lead"];
        for (written, meant) in [
            ("gian", Some("gain")),
            ("hodl", Some("Hold")),
            ("frequency", Some("frequency_hz")),
            ("GAIN", Some("gain")),
            ("low", Some("low_hz")),
            ("load", Some("load_n")),
            ("loud", Some("loudest")),
            ("loude", Some("loudest")),
            ("lo", None),
            ("y", None),
            ("noise", None),
            ("", None),
        ] {
            assert_eq!(closest(written, words), meant, "{written}");
        }
        assert_eq!(closest(&"a".repeat(1000), words), None);
    }
}
