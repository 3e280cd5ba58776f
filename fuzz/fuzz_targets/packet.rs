//! Any packet is settings that can be shown on one line, or none at all.
#![no_main]

use haptograph_nodes::network::understand;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    for told in understand(bytes).into_iter().flatten() {
        assert!(!told.name.is_empty());
        for text in [&told.name, &told.value] {
            assert!(text.len() <= 200 && !text.chars().any(char::is_control), "{told:?}");
        }
    }
});
