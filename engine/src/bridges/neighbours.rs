//! The two frames of a slow writer around a tick, for bridges that interpolate.

use super::{BridgeContext, Ends};

/// The writer's latest two frames, for a bridge that interpolates between them, one period of the writer late.
#[derive(Debug, Clone)]
pub struct Neighbours {
    /// Older first.
    held: Vec<f64>,
    /// True once a frame has arrived.
    has_begun: bool,
}

impl Neighbours {
    /// Two neutral frames, before any frame has arrived.
    pub fn new(cx: &BridgeContext) -> Self {
        Self {
            held: [cx.kind.neutral(), cx.kind.neutral()].into_iter().flatten().collect(),
            has_begun: false,
        }
    }

    /// Calls `mix` for each of the reader's frames, with the older frame, the newer one, the position of the reader's
    /// tick between them (0 to 1), and the reader's frame. The frame before the first equals the first.
    #[inline]
    pub fn cross(
        &mut self,
        ends: &Ends,
        x: &[f64],
        y: &mut [f64],
        mut mix: impl FnMut(&[f64], &[f64], f64, &mut [f64]),
    ) {
        let width = self.held.len() / 2;
        let (older, newer) = self.held.split_at(width);
        let frame = |k: i64| -> &[f64] {
            let local = k - ends.first_written() as i64;
            match local {
                0.. => &x[local as usize * width..][..width],
                _ if !self.has_begun => x.get(..width).unwrap_or(newer),
                -1 => newer,
                _ => older,
            }
        };
        for (j, out) in y.chunks_exact_mut(width).enumerate() {
            let k = ends.latest_at(j) as i64;
            mix(frame(k - 1), frame(k), ends.since_latest(j), out);
        }
        self.keep(x);
    }

    fn keep(&mut self, x: &[f64]) {
        let width = self.held.len() / 2;
        match x.len() / width {
            0 => {}
            1 => {
                self.held.copy_within(width.., 0);
                self.held[width..].copy_from_slice(x);
                if !self.has_begun {
                    self.held[..width].copy_from_slice(x);
                }
            }
            frames => self.held.copy_from_slice(&x[(frames - 2) * width..]),
        }
        self.has_begun |= !x.is_empty();
    }

    /// Copies the frames of another one of the same width.
    pub fn copy_from(&mut self, old: &Self) {
        self.held.copy_from_slice(&old.held);
        self.has_begun = old.has_begun;
    }
}
