//! Tests that need what is not on every machine.

use std::io::Write;

/// Says that a test is skipped, where the test runner does not capture it. Where `HAPTOGRAPH_NO_SKIPS` is set, as in
/// `.ci/full`, the test fails.
///
/// # Panics
/// Where nothing may be skipped.
pub fn skip(why: &str) {
    assert!(std::env::var_os("HAPTOGRAPH_NO_SKIPS").is_none(), "skipped: {why}");
    // A skip is no failure, nor is a closed standard error.
    let _ = writeln!(std::io::stderr(), "SKIPPED: {why}");
}
