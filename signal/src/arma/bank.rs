//! Many synthesis filters at once.

use super::{ArmaError, ArmaFilter, Form};

/// Synthesis filters side by side; each gives the samples it would give alone.
#[derive(Debug, Clone)]
pub struct VoiceBank {
    voices: Vec<ArmaFilter>,
}

impl VoiceBank {
    /// So many filters at rest, each passing its excitation on. Allocates here and never again.
    pub fn new(form: Form, voices: usize) -> Self {
        Self {
            voices: vec![ArmaFilter::new(form); voices],
        }
    }

    /// How many voices there are.
    pub fn voices(&self) -> usize {
        self.voices.len()
    }

    /// The coefficients of one voice from the next sample on, as in [`ArmaFilter::set_coefficients`].
    ///
    /// # Errors
    /// As there. A voice that does not exist is ignored.
    pub fn set_coefficients(
        &mut self,
        voice: usize,
        ar: &[f64],
        ma: &[f64],
        gain: f64,
    ) -> Result<(), ArmaError> {
        match self.voices.get_mut(voice) {
            Some(voice) => voice.set_coefficients(ar, ma, gain),
            None => Ok(()),
        }
    }

    /// Filters frames of one sample a voice, voice after voice, up to the last whole frame of the shorter slice.
    pub fn process(&mut self, excitation: &[f64], out: &mut [f64]) {
        let voices = self.voices.len().max(1);
        for (excitation, out) in excitation.chunks_exact(voices).zip(out.chunks_exact_mut(voices)) {
            for (voice, (e, out)) in self.voices.iter_mut().zip(excitation.iter().zip(out)) {
                voice.process(std::slice::from_ref(e), std::slice::from_mut(out));
            }
        }
    }

    /// Puts every voice to rest; the coefficients stay.
    pub fn reset(&mut self) {
        self.voices.iter_mut().for_each(ArmaFilter::reset);
    }
}
