//! Samples of voices side by side in SIMD lanes.

use haptograph_signal::arma::WarpedBank;
use pulp::Arch;

/// Maximum number of voices in a group.
pub(crate) const LANES: usize = WarpedBank::GROUP;
/// Frames processed at a time: a batch of the random numbers.
pub(crate) const BLOCK: usize = 64;
/// Voices whose samples are put side by side at a time.
pub(super) const DRAWN: usize = 8;

/// One value per voice.
pub(crate) type Row = [f64; LANES];

/// The samples of [`DRAWN`] voices.
pub(super) type Drawn = [[f64; BLOCK]; DRAWN];

/// A block of excitation of all voices of a bank.
pub struct Block<'a> {
    pub(crate) frames: &'a mut [Row; BLOCK],
    pub(super) drawn: &'a mut Drawn,
    pub(super) voices: usize,
    pub(crate) arch: Arch,
}

impl Block<'_> {
    /// Fills frames with samples that are drawn for [`DRAWN`] voices at a time, from the number given on.
    pub(crate) fn draw(&mut self, frames: &mut [Row; BLOCK], mut draw: impl FnMut(usize, &mut Drawn)) {
        for first in (0..self.voices).step_by(DRAWN) {
            draw(first, self.drawn);
            put_side_by_side(self.drawn, first, frames);
        }
    }

    /// Changes the samples of each voice, by its number.
    pub(crate) fn each_voice(&mut self, mut change: impl FnMut(usize, &mut [f64])) {
        for first in (0..self.voices).step_by(DRAWN) {
            take_apart(self.frames, first, self.drawn);
            let samples = self.drawn.iter_mut().take(self.voices - first);
            samples.zip(first..).for_each(|(samples, voice)| change(voice, samples));
            put_side_by_side(self.drawn, first, self.frames);
        }
    }
}

/// Puts the samples of [`DRAWN`] voices into the lanes from `first` on.
pub(super) fn put_side_by_side(drawn: &Drawn, first: usize, rows: &mut [Row; BLOCK]) {
    for (n, rows) in rows.as_chunks_mut::<2>().0.iter_mut().enumerate() {
        let [Some(one), Some(next)] = rows.each_mut().map(|row| row[first..].first_chunk_mut::<DRAWN>())
        else {
            return;
        };
        for l in (0..DRAWN).step_by(2) {
            let [a, b] = [l, l + 1].map(|l| drawn[l].as_chunks().0[n]);
            let [a, b] = turn(a, b);
            (one.as_chunks_mut().0[l / 2], next.as_chunks_mut().0[l / 2]) = (a, b);
        }
    }
}

/// Takes the samples of [`DRAWN`] voices out of the lanes from `first` on.
pub(super) fn take_apart(rows: &[Row; BLOCK], first: usize, voices: &mut Drawn) {
    for (n, rows) in rows.as_chunks::<2>().0.iter().enumerate() {
        let [Some(one), Some(next)] = rows.each_ref().map(|row| row[first..].first_chunk::<DRAWN>()) else {
            return;
        };
        for l in (0..DRAWN).step_by(2) {
            let [a, b] = [one, next].map(|row| row.as_chunks().0[l / 2]);
            let [a, b] = turn(a, b);
            (voices[l].as_chunks_mut().0[n], voices[l + 1].as_chunks_mut().0[n]) = (a, b);
        }
    }
}

/// Two numbers of two voices as two of two frames, or back.
#[inline(always)]
fn turn(a: [f64; 2], b: [f64; 2]) -> [[f64; 2]; 2] {
    // Written out: made of loops, it goes number by number, or with the widest instructions, which are slow at gathering.
    #[cfg(target_arch = "x86_64")]
    if let Some(sse2) = pulp::core_arch::x86::Sse2::try_new() {
        let (a, b) = (pulp::cast(a), pulp::cast(b));
        return [sse2._mm_unpacklo_pd(a, b), sse2._mm_unpackhi_pd(a, b)].map(pulp::cast);
    }
    [[a[0], b[0]], [a[1], b[1]]]
}
