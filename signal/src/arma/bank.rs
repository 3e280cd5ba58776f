//! Many synthesis filters at once.

mod direct;
mod lattice;

use super::{ArmaError, Form, SETTLE};
use direct::DirectGroup;
use lattice::LatticeGroup;
use pulp::{Arch, Simd, WithSimd};

/// Frames a group of voices works on before the next group has its turn, so that its state stays in the cache.
const RUN: usize = 64;

/// Synthesis filters side by side in SIMD lanes; each gives the samples it would give alone, to the bit.
#[derive(Debug, Clone)]
pub struct VoiceBank {
    voices: usize,
    groups: Groups,
    since_settled: usize,
    arch: Arch,
}

#[derive(Debug, Clone)]
enum Groups {
    Direct(Box<[DirectGroup]>),
    Lattice(Box<[LatticeGroup]>),
}

/// Voices that share the lanes of a vector.
trait Group: Clone {
    /// How many.
    const LANES: usize;

    /// Voices at rest that pass their excitation on.
    fn new() -> Self;

    /// See [`VoiceBank::set_coefficients`].
    fn set_coefficients(&mut self, lane: usize, ar: &[f64], ma: &[f64], gain: f64) -> Result<(), ArmaError>;

    /// Filters up to [`RUN`] frames.
    fn run(&mut self, frames: Frames<'_>);

    /// Puts voices to rest that have died away or are no longer finite.
    fn settle(&mut self);

    /// Puts all voices to rest.
    fn reset(&mut self);
}

/// Some columns of frames with `voices` columns: `columns` of them from `first` on.
struct Frames<'a> {
    voices: usize,
    first: usize,
    columns: usize,
    excitation: &'a [f64],
    out: &'a mut [f64],
}

impl Frames<'_> {
    /// How many frames there are.
    fn count(&self) -> usize {
        self.excitation.len() / self.voices
    }

    /// One sample a lane, 0 in lanes without a voice.
    #[inline(always)]
    fn excitation<const LANES: usize>(&self, frame: usize) -> [f64; LANES] {
        let start = frame * self.voices + self.first;
        let row = &self.excitation[start..start + self.columns];
        if let Some(row) = row.first_chunk::<LANES>() {
            return *row;
        }
        let mut lanes = [0.0; LANES];
        lanes[..row.len()].copy_from_slice(row);
        lanes
    }

    #[inline(always)]
    fn put<const LANES: usize>(&mut self, frame: usize, lanes: &[f64; LANES]) {
        let start = frame * self.voices + self.first;
        let row = &mut self.out[start..start + self.columns];
        if let Some(row) = row.first_chunk_mut::<LANES>() {
            *row = *lanes;
        } else {
            row.copy_from_slice(&lanes[..row.len()]);
        }
    }
}

impl VoiceBank {
    /// So many filters at rest, each passing its excitation on. Allocates here and never again.
    pub fn new(form: Form, voices: usize) -> Self {
        Self {
            voices,
            groups: match form {
                Form::Direct => Groups::Direct(groups(voices)),
                Form::Lattice => Groups::Lattice(groups(voices)),
            },
            since_settled: 0,
            arch: Arch::new(),
        }
    }

    /// How many voices there are.
    pub fn voices(&self) -> usize {
        self.voices
    }

    /// The coefficients of one voice from the next sample on, as in [`ArmaFilter`](super::ArmaFilter).
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
        match &mut self.groups {
            Groups::Direct(groups) => set(groups, voice, ar, ma, gain),
            Groups::Lattice(groups) => set(groups, voice, ar, ma, gain),
        }
    }

    /// Filters frames of one sample a voice, voice after voice, up to the last whole frame of the shorter slice.
    pub fn process(&mut self, excitation: &[f64], out: &mut [f64]) {
        if self.voices == 0 {
            return;
        }
        let frames = excitation.len().min(out.len()) / self.voices;
        let mut done = 0;
        while done < frames {
            let run = (frames - done).min(SETTLE - self.since_settled).min(RUN);
            let part = done * self.voices..(done + run) * self.voices;
            self.arch.dispatch(Run {
                groups: &mut self.groups,
                voices: self.voices,
                excitation: &excitation[part.clone()],
                out: &mut out[part],
            });
            done += run;
            self.since_settled += run;
            if self.since_settled == SETTLE {
                self.since_settled = 0;
                match &mut self.groups {
                    Groups::Direct(groups) => groups.iter_mut().for_each(Group::settle),
                    Groups::Lattice(groups) => groups.iter_mut().for_each(Group::settle),
                }
            }
        }
    }

    /// Puts every voice to rest; the coefficients stay.
    pub fn reset(&mut self) {
        match &mut self.groups {
            Groups::Direct(groups) => groups.iter_mut().for_each(Group::reset),
            Groups::Lattice(groups) => groups.iter_mut().for_each(Group::reset),
        }
        self.since_settled = 0;
    }
}

fn groups<G: Group>(voices: usize) -> Box<[G]> {
    vec![G::new(); voices.div_ceil(G::LANES)].into_boxed_slice()
}

fn set<G: Group>(groups: &mut [G], voice: usize, ar: &[f64], ma: &[f64], gain: f64) -> Result<(), ArmaError> {
    match groups.get_mut(voice / G::LANES) {
        Some(group) => group.set_coefficients(voice % G::LANES, ar, ma, gain),
        None => Ok(()),
    }
}

/// Filters up to [`RUN`] frames of all voices.
struct Run<'a> {
    groups: &'a mut Groups,
    voices: usize,
    excitation: &'a [f64],
    out: &'a mut [f64],
}

impl WithSimd for Run<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        match self.groups {
            Groups::Direct(groups) => run(groups, self.voices, self.excitation, self.out),
            Groups::Lattice(groups) => run(groups, self.voices, self.excitation, self.out),
        }
    }
}

#[inline(always)]
fn run<G: Group>(groups: &mut [G], voices: usize, excitation: &[f64], out: &mut [f64]) {
    for (group, first) in groups.iter_mut().zip((0..voices).step_by(G::LANES)) {
        group.run(Frames {
            voices,
            first,
            columns: G::LANES.min(voices - first),
            excitation,
            out,
        });
    }
}
