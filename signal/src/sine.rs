//! The sine of many angles at once: without the system library's branches, and with the same bits on every processor.

use crate::instructions::arch;
use pulp::{Simd, WithSimd};
use std::f64::consts::FRAC_1_PI;

/// Replaces angles, rad, by their sines, to within two units in the last place of 1 and the rounding of the angle. Angles
/// that are not finite become NaN.
pub fn sines(angles: &mut [f64]) {
    arch().dispatch(Sines { angles });
}

struct Sines<'a> {
    angles: &'a mut [f64],
}

impl WithSimd for Sines<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for angle in self.angles {
            *angle = sine(*angle);
        }
    }
}

/// Of as many half turns as make it small, an angle keeps its sine but for the sign.
#[inline(always)]
fn sine(angle_rad: f64) -> f64 {
    /// Sums with it are whole numbers, with the number's last bit as their own.
    const WHOLE: f64 = 1.5 / f64::EPSILON;
    /// Half a turn in parts of 33 bits, so that a million times the first two are exact, and the rest.
    const HALF_TURN_RAD: [f64; 3] = [
        f64::from_bits(0x4009_21fb_5440_0000),
        f64::from_bits(0x3de0_b461_1a60_0000),
        f64::from_bits(0x3bb3_198a_2e03_7073),
    ];
    let sum = angle_rad * FRAC_1_PI + WHOLE;
    let half_turns = sum - WHOLE;
    let [most, more, rest] = HALF_TURN_RAD;
    let within_rad = ((angle_rad - half_turns * most) - half_turns * more) - half_turns * rest;
    f64::from_bits(sine_within(within_rad).to_bits() ^ (sum.to_bits() << 63))
}

/// The sine between -π/2 and π/2, by a Chebyshev fit.
#[inline(always)]
pub fn sine_within(angle_rad: f64) -> f64 {
    const SINE: [f64; 9] = [
        1.0,
        -0.16666666666666666,
        0.008333333333333186,
        -0.0001984126984120872,
        2.755731921123654e-06,
        -2.5052106891168703e-08,
        1.6058940907182887e-10,
        -7.643027273612204e-13,
        2.7215821926997076e-15,
    ];
    let square = angle_rad * angle_rad;
    let mut sum = SINE[8];
    for &coefficient in SINE[..8].iter().rev() {
        sum = sum * square + coefficient;
    }
    angle_rad * sum
}

#[cfg(test)]
mod tests {
    use super::sines as in_place;

    #[test]
    fn they_are_the_librarys() {
        let mut worst = 0.0_f64;
        for span in [1.0, 100.0, 1e4, 1e6] {
            let angles: Vec<f64> = (-10_000..=10_000).map(|k| span * f64::from(k) / 10_000.0).collect();
            let mut sines = angles.clone();
            in_place(&mut sines);
            worst = angles.iter().zip(&sines).fold(worst, |worst, (x, y)| worst.max((x.sin() - y).abs()));
        }
        assert!(worst <= 2.0 * f64::EPSILON, "{worst}");
    }

    #[test]
    fn far_angles_keep_the_accuracy_of_their_rounding() {
        let angles: Vec<f64> = (0..10_000).map(|k| 1e9 + 0.37 * f64::from(k)).collect();
        let mut sines = angles.clone();
        in_place(&mut sines);
        assert!(angles.iter().zip(&sines).all(|(x, y)| (x.sin() - y).abs() < 2.0 * f64::EPSILON * x));
    }

    #[test]
    fn an_angle_that_is_not_finite_has_no_sine() {
        let mut angles = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY];
        in_place(&mut angles);
        assert!(angles.iter().all(|sine| sine.is_nan()));
    }
}
