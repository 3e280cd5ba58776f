#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    haptograph_fuzz::learn_table(bytes);
});
