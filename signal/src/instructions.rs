//! The vector instructions that kernels use. The samples do not depend on them.

use pulp::Arch;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

static IS_AVX512_OFF: AtomicBool = AtomicBool::new(false);

/// The processor's widest vector instructions.
#[inline]
pub fn arch() -> Arch {
    #[cfg(target_arch = "x86_64")]
    if IS_AVX512_OFF.load(Relaxed)
        && let Some(avx2) = pulp::x86::V3::try_new()
    {
        return Arch::V3(avx2);
    }
    Arch::new()
}

/// Lets every kernel that is made from now on do without AVX-512, to measure what other processors do.
pub fn turn_avx512_off() {
    IS_AVX512_OFF.store(true, Relaxed);
}
