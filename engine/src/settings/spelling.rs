//! What somebody may have meant who wrote a name that is not there.

/// Longer words, in bytes, are not compared.
const MAX_COMPARED: usize = 64;

/// The candidate nearest to `word` by edit distance, if one is near enough to be what was meant.
pub fn closest<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    if word.len() > MAX_COMPARED {
        return None; // Comparing costs the product of the lengths, and such words are no slips of a finger.
    }
    let lower = word.to_lowercase();
    let distance = |candidate: &&str| edit_distance(&lower, &candidate.to_lowercase());
    let candidates = candidates.into_iter();
    let comparable = candidates.filter(|candidate| candidate.len() <= MAX_COMPARED);
    let nearest = comparable.min_by_key(distance)?;
    let letters = word.chars().count();
    let allowed = (letters / 3).max(1).min(letters.saturating_sub(1));
    (edit_distance(&lower, &nearest.to_lowercase()) <= allowed).then_some(nearest)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_words_are_guessed_and_far_ones_are_not() {
        let words = ["gain", "Hold", "frequency_hz", "x"];
        for (written, meant) in [
            ("gian", Some("gain")),
            ("hodl", Some("Hold")),
            ("frequency", Some("frequency_hz")),
            ("GAIN", Some("gain")),
            ("y", None),
            ("loss", None),
            ("", None),
        ] {
            assert_eq!(closest(written, words), meant, "{written}");
        }
        assert_eq!(closest(&"a".repeat(1000), words), None);
    }
}
