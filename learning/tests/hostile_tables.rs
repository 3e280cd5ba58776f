//! A hostile table takes no memory beyond its first fault.

#![allow(clippy::unwrap_used)] // Helpers of tests are tests.

use haptograph_learning::recording::{self, LoadError};
use peak_alloc::PeakAlloc;
use std::io::BufReader;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

#[test]
fn a_sparse_table_is_read_no_further_than_its_fault() {
    let folder = tempfile::tempdir().unwrap();
    for (head, line) in [("", 1), ("accel_m_s2,force_normal_n,speed_mm_s\n1,1,80\n", 3)] {
        let path = folder.path().join("sparse.csv");
        std::fs::write(&path, head).unwrap();
        let file = std::fs::File::options().read(true).write(true).open(&path).unwrap();
        file.set_len(1 << 30).unwrap();
        let before = MEMORY.current_usage();
        MEMORY.reset_peak_usage();
        let Err(LoadError::Read { source, .. }) = recording::load(&path) else { panic!("{head}") };
        let (place, _) = source.place(BufReader::new(file)).unwrap();
        assert_eq!(place.line, line);
        let used = MEMORY.peak_usage().saturating_sub(before);
        assert!(used < 1 << 20, "{used} bytes");
    }
}
