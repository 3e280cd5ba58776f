//! Texts that are kept as they are printed: they are read before they are committed.

use std::path::Path;

/// Compares what is printed with a file, or writes it there with `BLESS=1`.
pub fn compare(kept: impl AsRef<Path>, printed: &str) {
    let kept = kept.as_ref();
    if std::env::var_os("BLESS").is_some() {
        std::fs::write(kept, printed).expect("writable");
    }
    let wanted = std::fs::read_to_string(kept).unwrap_or_default();
    assert!(printed == wanted, "{}: BLESS=1 writes\n{printed}", kept.display());
}
