//! Many synthesis filters at once.

mod direct;
mod lattice;
mod warped;

use super::{ArmaError, Form, MAX_ORDER, Settling, in_runs};
use crate::instructions::arch;
use direct::DirectGroup;
use lattice::LatticeGroup;
use pulp::{Arch, Simd, WithSimd};
use warped::WarpedGroup;

/// Frames that a group of voices computes before the next group, so that its state stays in the cache.
const RUN: usize = 64;

/// Synthesis filters side by side in SIMD lanes; each gives the samples it would give alone, to the bit.
#[derive(Debug, Clone)]
pub struct VoiceBank(Plain);

#[derive(Debug, Clone)]
enum Plain {
    Direct(Bank<DirectGroup>),
    Lattice(Bank<LatticeGroup>),
}

/// [`WarpedLattice`](super::WarpedLattice)s side by side in SIMD lanes, of one order and warping factor a group; each gives the samples it
/// would give as a `WarpedLattice`, but for rounding, and the same bits for all block sizes and all other voices.
#[derive(Debug, Clone)]
pub struct WarpedBank(Bank<WarpedGroup>);

/// Vectors on their way through a lattice at the same time, as every stage waits for its neighbour.
const UNDER_WAY: usize = 2;
/// Voices in a group of lattices: so many of the widest vectors.
const LATTICES: usize = 8 * UNDER_WAY;

/// Rows of a value of each lattice, as vectors under way.
#[inline(always)]
fn vectors<S: Simd>(rows: &[[f64; LATTICES]]) -> &[[S::f64s; UNDER_WAY]] {
    S::as_simd_f64s(rows.as_flattened()).0.as_chunks().0
}

#[inline(always)]
fn vectors_mut<S: Simd>(rows: &mut [[f64; LATTICES]]) -> &mut [[S::f64s; UNDER_WAY]] {
    S::as_mut_simd_f64s(rows.as_flattened_mut()).0.as_chunks_mut().0
}

/// Voices of one kind.
#[derive(Debug, Clone)]
struct Bank<G> {
    voices: usize,
    groups: Box<[G]>,
    since_settled: usize,
    arch: Arch,
}

/// Voices that share the lanes of a vector.
trait Group: Clone {
    /// Number of voices.
    const LANES: usize;

    /// Makes voices with zero state.
    fn new() -> Self;

    /// Filters up to [`RUN`] frames.
    fn run<S: Simd>(&mut self, simd: S, frames: Frames<'_>);

    /// Clears the state of voices that are silent, NaN or infinite.
    fn settle(&mut self);
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
    /// Number of frames.
    fn count(&self) -> usize {
        self.excitation.len() / self.voices
    }

    /// One sample a lane, 0 in lanes without a voice.
    #[inline(always)]
    fn excitation<const LANES: usize>(&self, frame: usize) -> [f64; LANES] {
        let start = frame * self.voices + self.first;
        match self.excitation[start..].first_chunk() {
            Some(row) if self.columns == LANES => *row,
            _ => self.part_of_excitation(start),
        }
    }

    #[inline(always)]
    fn put<const LANES: usize>(&mut self, frame: usize, lanes: &[f64; LANES]) {
        let start = frame * self.voices + self.first;
        match self.out[start..].first_chunk_mut() {
            Some(row) if self.columns == LANES => *row = *lanes,
            _ => self.put_part(start, lanes),
        }
    }

    /// Separate, like what follows: merged with whole rows it would make these a copy of any length.
    #[cold]
    #[inline(never)]
    fn part_of_excitation<const LANES: usize>(&self, start: usize) -> [f64; LANES] {
        let mut lanes = [0.0; LANES];
        lanes[..self.columns].copy_from_slice(&self.excitation[start..start + self.columns]);
        lanes
    }

    #[cold]
    #[inline(never)]
    fn put_part(&mut self, start: usize, lanes: &[f64]) {
        self.out[start..start + self.columns].copy_from_slice(&lanes[..self.columns]);
    }
}

impl VoiceBank {
    /// Number of voices in a group, which get their coefficients together by [`Self::set_group`].
    pub(crate) const GROUP: usize = LatticeGroup::LANES;

    /// Makes `voices` filters with zero state that pass their excitation. Allocates here only.
    pub fn new(form: Form, voices: usize) -> Self {
        Self(match form {
            Form::Direct => Plain::Direct(Bank::new(voices)),
            Form::Lattice => Plain::Lattice(Bank::new(voices)),
        })
    }

    /// Sets the coefficients of one voice from the next sample on, as in [`ArmaFilter`](super::ArmaFilter).
    ///
    /// # Errors
    /// The errors of `ArmaFilter::set_coefficients`. A voice that does not exist is ignored.
    pub fn set_coefficients(
        &mut self,
        voice: usize,
        ar: &[f64],
        ma: &[f64],
        gain: f64,
    ) -> Result<(), ArmaError> {
        match &mut self.0 {
            Plain::Direct(bank) => bank.set(voice, |group, lane| group.set_coefficients(lane, ar, ma, gain)),
            Plain::Lattice(bank) => bank.set(voice, |group, lane| group.set_coefficients(lane, ar, ma, gain)),
        }
    }

    /// Sets the coefficients of all voices of a group from the next sample on: row k has `a_{k+1}`, or `b_{k+1}`, of
    /// each voice. The output has the same bits as after [`Self::set_coefficients`] for each voice; the direct form
    /// makes exactly these calls.
    ///
    /// # Errors
    /// The error of the first refused voice, with its index in the group. All lattices then keep their old
    /// coefficients. A group that does not exist is ignored.
    pub fn set_group(
        &mut self,
        group: usize,
        ar: &[[f64; Self::GROUP]],
        ma: &[[f64; Self::GROUP]],
        gain: &[f64; Self::GROUP],
    ) -> Result<(), (usize, ArmaError)> {
        match &mut self.0 {
            Plain::Lattice(bank) => match bank.groups.get_mut(group) {
                Some(group) => group.set_all(bank.arch, ar, ma, gain),
                None => Ok(()),
            },
            Plain::Direct(_) => (0..Self::GROUP).try_for_each(|lane| {
                let order = ar.len().max(ma.len());
                if order > MAX_ORDER {
                    return Err((lane, ArmaError::TooLong { order }));
                }
                let own = |rows: &[[f64; Self::GROUP]]| -> [f64; MAX_ORDER] {
                    std::array::from_fn(|k| rows.get(k).map_or(0.0, |row| row[lane]))
                };
                let (voice, ar_of, ma_of) = (group * Self::GROUP + lane, own(ar), own(ma));
                self.set_coefficients(voice, &ar_of[..ar.len()], &ma_of[..ma.len()], gain[lane])
                    .map_err(|error| (lane, error))
            }),
        }
    }

    /// Filters frames of one sample a voice, voice after voice, up to the last whole frame of the shorter slice.
    pub fn process(&mut self, excitation: &[f64], out: &mut [f64]) {
        match &mut self.0 {
            Plain::Direct(bank) => bank.process(excitation, out),
            Plain::Lattice(bank) => bank.process(excitation, out),
        }
    }
}

impl WarpedBank {
    /// Number of voices in a group, which get their coefficients together by [`Self::set_group`].
    pub const GROUP: usize = WarpedGroup::LANES;

    /// Makes `voices` silent filters without coefficients. Allocates here only.
    pub fn new(voices: usize) -> Self {
        Self(Bank::new(voices))
    }

    /// Sets the coefficients of all voices of a group, of one order and warping factor, from the next sample on: row k
    /// has `a_{k+1}` of each voice. White excitation of variance 1 comes out with these powers; a new power scales the
    /// excitation, not the state.
    ///
    /// # Errors
    /// The error of [`power_gain`](crate::warped::power_gain) for the first refused voice, with its
    /// index in the group. All voices then keep their old coefficients. A group that does not exist is ignored.
    pub fn set_group(
        &mut self,
        group: usize,
        ar: &[[f64; Self::GROUP]],
        warping: f64,
        power: &[f64; Self::GROUP],
    ) -> Result<(), (usize, ArmaError)> {
        match self.0.groups.get_mut(group) {
            Some(group) => group.set_all(ar, warping, power),
            None => Ok(()),
        }
    }

    /// Filters frames of one sample a voice, voice after voice, up to the last whole frame of the shorter slice.
    pub fn process(&mut self, excitation: &[f64], out: &mut [f64]) {
        self.0.process(excitation, out);
    }
}

impl<G: Group> Bank<G> {
    fn new(voices: usize) -> Self {
        Self {
            voices,
            groups: vec![G::new(); voices.div_ceil(G::LANES)].into_boxed_slice(),
            since_settled: 0,
            arch: arch(),
        }
    }

    /// Sets the voice in its lane, if it exists.
    fn set(
        &mut self,
        voice: usize,
        set: impl FnOnce(&mut G, usize) -> Result<(), ArmaError>,
    ) -> Result<(), ArmaError> {
        match self.groups.get_mut(voice / G::LANES) {
            Some(group) => set(group, voice % G::LANES),
            None => Ok(()),
        }
    }

    fn process(&mut self, excitation: &[f64], out: &mut [f64]) {
        if self.voices > 0 {
            in_runs(self, self.voices, excitation, out);
        }
    }
}

impl<G: Group> Settling for Bank<G> {
    const RUN: usize = RUN;

    fn since_settled(&mut self) -> &mut usize {
        &mut self.since_settled
    }

    #[inline(always)]
    fn run(&mut self, excitation: &[f64], out: &mut [f64]) {
        self.arch.dispatch(Run { groups: &mut self.groups, voices: self.voices, excitation, out });
    }

    fn settle(&mut self) {
        self.groups.iter_mut().for_each(Group::settle);
    }
}

/// Filters up to [`RUN`] frames of all voices.
struct Run<'a, G> {
    groups: &'a mut [G],
    voices: usize,
    excitation: &'a [f64],
    out: &'a mut [f64],
}

impl<G: Group> WithSimd for Run<'_, G> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        for (group, first) in self.groups.iter_mut().zip((0..self.voices).step_by(G::LANES)) {
            let frames = Frames {
                voices: self.voices,
                first,
                columns: G::LANES.min(self.voices - first),
                excitation: self.excitation,
                out: &mut *self.out,
            };
            group.run(simd, frames);
        }
    }
}

#[cfg(test)]
mod tests;
