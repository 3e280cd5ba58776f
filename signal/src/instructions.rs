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

/// The family of processors that computes the same bits as this one: architecture, level of x86-64, system, C library.
///
/// The kernels give the same samples with all instructions, but `sin`, `exp` and the like are the system's, which have other
/// versions for processors with fused multiplication and addition (level 3 of x86-64).
pub fn processor_family() -> String {
    let level = match Arch::new() {
        #[cfg(target_arch = "x86_64")]
        Arch::V3(_) | Arch::V4(_) => "-v3",
        _ => "",
    };
    let library = if cfg!(target_env = "musl") { "-musl" } else { "" };
    let library = if cfg!(target_env = "gnu") { "-gnu" } else { library };
    format!("{}{level}-{}{library}", std::env::consts::ARCH, std::env::consts::OS)
}

/// Lets every kernel that is made from now on do without AVX-512, to measure what other processors do.
pub fn turn_avx512_off() {
    IS_AVX512_OFF.store(true, Relaxed);
}
