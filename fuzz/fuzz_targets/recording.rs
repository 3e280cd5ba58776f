//! Any bytes are a recording or an error, in every format of recordings.
#![no_main]

use haptograph_surfaces::recording::{read_archive, read_column, read_csv, write_archive};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let _ = read_column(bytes, "x");
    for read in [read_csv(bytes, "fuzzed"), read_archive(bytes)] {
        match read {
            Ok(recording) => assert!(write_archive(&recording).is_ok()),
            Err(error) => assert!(!error.to_string().is_empty()),
        }
    }
});
