//! Arithmetic on every sample of a block, compiled for several instruction sets and dispatched at run time.
//!
//! Each sample is computed by the same operations in the same order, and no operation is fused unless its function says
//! so. The bits therefore depend neither on the instruction set nor on the block.

use crate::instructions::arch;
use pulp::{Simd, WithSimd};

/// Numbers on whole cache lines. The widest vectors straddle two lines where numbers lie anywhere, at twice the cost.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub struct CacheLines<T>(pub T);

/// `a b + c`, rounded once. On WebAssembly it is rounded twice: without an instruction for it, emulation would be a
/// hundred times slower.
#[inline(always)]
pub(crate) fn mul_add(a: f64, b: f64, c: f64) -> f64 {
    if cfg!(target_family = "wasm") { a * b + c } else { a.mul_add(b, c) }
}

/// [`mul_add`] in every lane.
#[inline(always)]
pub(crate) fn mul_add_lanes<S: Simd>(simd: S, a: S::f64s, b: S::f64s, c: S::f64s) -> S::f64s {
    if cfg!(target_family = "wasm") {
        simd.add_f64s(simd.mul_f64s(a, b), c)
    } else {
        simd.mul_add_f64s(a, b, c)
    }
}

/// `y = gain x`.
#[inline]
pub fn scale(gain: f64, x: &[f64], y: &mut [f64]) {
    map(
        x,
        y,
        #[inline(always)]
        move |x| gain * x,
    );
}

/// `y = x + offset`.
#[inline]
pub fn offset(offset: f64, x: &[f64], y: &mut [f64]) {
    map(
        x,
        y,
        #[inline(always)]
        move |x| x + offset,
    );
}

/// `y = gains[0] a + gains[1] b`.
#[inline]
pub fn mix(gains: [f64; 2], a: &[f64], b: &[f64], y: &mut [f64]) {
    zip(
        a,
        b,
        y,
        #[inline(always)]
        move |a, b| gains[0] * a + gains[1] * b,
    );
}

/// Computes every sample of `y` from that of `x`, up to the shorter of the two.
///
/// `f` has to be marked `#[inline(always)]` to be compiled for the instruction set.
#[inline]
pub fn map(x: &[f64], y: &mut [f64], f: impl Fn(f64) -> f64) {
    if let ([x], [y]) = (x, &mut *y) {
        *y = f(*x);
        return;
    }
    in_blocks(Map { x, y, f });
}

/// Computes every sample of `y` from those of `a` and `b`, up to the shortest; `f` as in [`map`].
#[inline]
pub fn zip(a: &[f64], b: &[f64], y: &mut [f64], f: impl Fn(f64, f64) -> f64) {
    if let ([a], [b], [y]) = (a, b, &mut *y) {
        *y = f(*a, *b);
        return;
    }
    in_blocks(Zip { a, b, y, f });
}

/// Separate, so that single samples do not pay for the registers that a loop needs.
#[inline(never)]
fn in_blocks<W: WithSimd<Output = ()>>(work: W) {
    arch().dispatch(work);
}

struct Map<'a, F> {
    x: &'a [f64],
    y: &'a mut [f64],
    f: F,
}

impl<F: Fn(f64) -> f64> WithSimd for Map<'_, F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for (y, x) in self.y.iter_mut().zip(self.x) {
            *y = (self.f)(*x);
        }
    }
}

struct Zip<'a, F> {
    a: &'a [f64],
    b: &'a [f64],
    y: &'a mut [f64],
    f: F,
}

impl<F: Fn(f64, f64) -> f64> WithSimd for Zip<'_, F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for (y, (a, b)) in self.y.iter_mut().zip(self.a.iter().zip(self.b)) {
            *y = (self.f)(*a, *b);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_length_gives_the_bits_of_the_plain_loop() {
        let x: Vec<f64> = (0..150).map(|i| (f64::from(i) * 0.7).sin() / 3.0).collect();
        let z: Vec<f64> = x.iter().rev().copied().collect();
        for len in 0..x.len() {
            let mut y = vec![f64::NAN; len];
            scale(0.3, &x[..len], &mut y);
            assert!(y.iter().zip(&x).all(|(y, x)| *y == 0.3 * x), "{len}");
            offset(0.3, &x[..len], &mut y);
            assert!(y.iter().zip(&x).all(|(y, x)| *y == x + 0.3), "{len}");
            mix([0.3, 0.7], &x[..len], &z, &mut y);
            assert!(y.iter().zip(x.iter().zip(&z)).all(|(y, (a, b))| *y == 0.3 * a + 0.7 * b), "{len}");
        }
    }
}
