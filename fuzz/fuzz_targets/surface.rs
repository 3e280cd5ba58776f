//! Any bytes are a surface or an error; a surface is the same after it was written and read again.
#![no_main]

use haptograph_surfaces::files::{native, read_surface};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    match read_surface(bytes) {
        Ok(surface) => assert_eq!(read_surface(native::write(&surface).as_bytes()), Ok(surface)),
        Err(error) => assert!(!error.to_string().is_empty()),
    }
});
