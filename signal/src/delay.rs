//! A delay of a whole number of samples.

/// Delays a signal by a fixed number of samples; the past before the signal is zero.
#[derive(Debug, Clone)]
pub struct DelayLine {
    ring: Box<[f64]>,
    next: usize,
}

impl DelayLine {
    /// Makes a delay of `frames` samples; 0 passes the signal. Allocates here only.
    pub fn new(frames: usize) -> Self {
        Self { ring: vec![0.0; frames].into_boxed_slice(), next: 0 }
    }

    /// The delay in samples.
    pub fn frames(&self) -> usize {
        self.ring.len()
    }

    /// Writes a sample and returns the one written [`frames`](Self::frames) calls ago.
    #[inline]
    pub fn step(&mut self, x: f64) -> f64 {
        let Some(oldest) = self.ring.get_mut(self.next) else {
            return x;
        };
        let y = std::mem::replace(oldest, x);
        self.next = if self.next + 1 == self.ring.len() { 0 } else { self.next + 1 };
        y
    }

    /// Delays `x` into `y`, sample by sample up to the shorter of the two.
    pub fn process(&mut self, x: &[f64], y: &mut [f64]) {
        for (x, y) in x.iter().zip(y) {
            *y = self.step(*x);
        }
    }

    /// Clears the past.
    pub fn reset(&mut self) {
        self.ring.fill(0.0);
        self.next = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_goes_in_comes_out_later_however_it_is_cut() {
        let x: Vec<f64> = (1..=200).map(f64::from).collect();
        for frames in [0, 1, 3, 64, 500] {
            for cut in [1, 7, 200] {
                let mut line = DelayLine::new(frames);
                let mut y = vec![f64::NAN; 200];
                for (x, y) in x.chunks(cut).zip(y.chunks_mut(cut)) {
                    line.process(x, y);
                }
                for n in 0..200 {
                    assert_eq!(y[n], if n < frames { 0.0 } else { x[n - frames] });
                }
                line.reset();
                assert_eq!(line.step(9.0), if frames == 0 { 9.0 } else { 0.0 });
            }
        }
    }
}
