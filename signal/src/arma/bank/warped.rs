//! Warped lattices in lanes.

use super::{Frames, Group};
use crate::arma::warped::{ROWS, SUMS, Step};
use crate::arma::{ArmaError, MAX_ORDER, are_finite, is_over};
use pulp::Arch;

/// Voices in a group: the widest vector, as each has a matrix of its own to keep in the cache.
const LANES: usize = 8;
/// Rows computed together, so that a state is fetched once for all of them.
const TILE: usize = 4;

type Lanes = [f64; LANES];

/// As many [`WarpedLattice`](crate::arma::WarpedLattice)s as there are lanes, each with its own order of summation.
#[derive(Debug, Clone)]
pub(super) struct WarpedGroup {
    tiles: Box<Tiles>,
    order: [usize; LANES],
    warping: Lanes,
    out_scale: Lanes,
    state: [Lanes; ROWS],
    /// The step of the voice that is being set.
    set: Box<Step>,
    arch: Arch,
}

/// The step matrices: for every [`TILE`] rows what the excitation enters them with, then each state; 0 beyond the order.
#[derive(Debug, Clone)]
#[repr(align(64))]
struct Tiles([[[Lanes; TILE]; MAX_ORDER + 1]; ROWS / TILE]);

impl Group for WarpedGroup {
    const LANES: usize = LANES;

    fn new() -> Self {
        Self {
            tiles: Box::new(Tiles([[[[0.0; LANES]; TILE]; MAX_ORDER + 1]; ROWS / TILE])),
            order: [0; LANES],
            warping: [0.0; LANES],
            out_scale: [0.0; LANES],
            state: [[0.0; LANES]; ROWS],
            set: Box::new(Step::SILENT),
            arch: Arch::new(),
        }
    }

    #[inline(always)]
    fn run(&mut self, mut frames: Frames<'_>) {
        let order = self.order.into_iter().fold(0, usize::max).min(MAX_ORDER);
        let (tiles, pairs) = (order.div_ceil(TILE), order.div_ceil(SUMS));
        let mut state = self.state;
        for n in 0..frames.count() {
            let e: Lanes = frames.excitation(n);
            let mut next = state;
            let rows = next.as_chunks_mut::<TILE>().0.iter_mut();
            for (rows, tile) in rows.zip(&self.tiles.0[..tiles]) {
                *rows = product(tile, &e, &state, pairs);
            }
            let mut out = [0.0; LANES];
            for l in 0..LANES {
                out[l] = (next[0][l] - self.warping[l] * state[0][l]) * self.out_scale[l];
            }
            frames.put(n, &out);
            state = next;
        }
        self.state = state;
    }

    fn settle(&mut self) {
        for lane in 0..LANES {
            let column: [f64; ROWS] = std::array::from_fn(|m| self.state[m][lane]);
            if is_over(&[], &column[..self.order[lane]]) || !are_finite(&column) {
                for row in &mut self.state {
                    row[lane] = 0.0;
                }
            }
        }
    }

    fn reset(&mut self) {
        self.state.fill([0.0; LANES]);
    }
}

impl WarpedGroup {
    /// See [`WarpedBank::set_coefficients`](super::WarpedBank::set_coefficients).
    pub fn set_coefficients(
        &mut self,
        lane: usize,
        ar: &[f64],
        warping: f64,
        gain: f64,
    ) -> Result<(), ArmaError> {
        self.set.set(self.arch, ar, warping, gain)?;
        let (step, old) = (&self.set, self.order[lane]);
        let order = step.order;
        let columns = std::iter::once(&step.drive).chain(&step.columns);
        for (j, column) in columns.enumerate().take(order.max(old) + 1) {
            for (i, value) in column.iter().enumerate().take(order.max(old)) {
                let is_within = i < order && j <= order;
                self.tiles.0[i / TILE][j][i % TILE][lane] = if is_within { *value } else { 0.0 };
            }
        }
        for row in &mut self.state[order.min(old)..] {
            row[lane] = 0.0;
        }
        self.order[lane] = order;
        (self.warping[lane], self.out_scale[lane]) = (step.warping, step.out_scale);
        Ok(())
    }
}

/// The next states of a tile: the sums of a single voice, which has as many and adds the first states to the excitation's.
#[inline(always)]
fn product(
    tile: &[[Lanes; TILE]; MAX_ORDER + 1],
    e: &Lanes,
    state: &[Lanes; ROWS],
    pairs: usize,
) -> [Lanes; TILE] {
    let [drive, columns @ ..] = tile;
    let (mut even, mut odd) = ([[0.0; LANES]; TILE], [[0.0; LANES]; TILE]);
    for r in 0..TILE {
        for l in 0..LANES {
            even[r][l] = drive[r][l] * e[l];
        }
    }
    let columns = columns.as_chunks::<SUMS>().0.iter();
    for ([left, right], x) in columns.zip(state.as_chunks::<SUMS>().0).take(pairs) {
        for r in 0..TILE {
            for l in 0..LANES {
                even[r][l] = left[r][l].mul_add(x[0][l], even[r][l]);
                odd[r][l] = right[r][l].mul_add(x[1][l], odd[r][l]);
            }
        }
    }
    for r in 0..TILE {
        for l in 0..LANES {
            even[r][l] += odd[r][l];
        }
    }
    even
}
