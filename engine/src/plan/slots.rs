//! Buffers reused by lifetime: a linear scan over the steps.

use super::Life;
use crate::io::LINE;

/// A buffer that a step writes, before it has a place.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Demand {
    /// f64s.
    pub len: usize,
    /// Step that writes it.
    pub from: usize,
    /// Last step that needs it.
    pub to: usize,
}

/// Gives every demand a slot; two demands share one only if their lives do not touch. Returns the slot of each
/// demand, the length of each slot, and the lives.
pub(crate) fn assign(demands: &[Demand]) -> (Vec<u32>, Vec<usize>, Vec<Life>) {
    let mut order: Vec<usize> = (0..demands.len()).collect();
    order.sort_by_key(|i| demands[*i].from);
    let mut slots: Vec<usize> = Vec::new();
    let mut busy_until: Vec<Option<usize>> = Vec::new();
    let mut placed = vec![0_u32; demands.len()];
    let mut lives = Vec::with_capacity(demands.len());
    for i in order {
        let demand = demands[i];
        let len = demand.len.next_multiple_of(LINE);
        let free = |slot: &usize| busy_until[*slot].is_none_or(|until| until < demand.from);
        // The best fit: the smallest that is large enough, else the largest, grown.
        let best = (0..slots.len()).filter(free).min_by_key(|slot| {
            let have = slots[*slot];
            if have >= len {
                (0, have - len)
            } else {
                (1, len - have)
            }
        });
        let slot = best.unwrap_or_else(|| {
            slots.push(0);
            busy_until.push(None);
            slots.len() - 1
        });
        slots[slot] = slots[slot].max(len);
        busy_until[slot] = Some(demand.to);
        placed[i] = slot as u32;
        lives.push(Life {
            slot: slot as u32,
            from: demand.from,
            to: demand.to,
        });
    }
    (placed, slots, lives)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lives_that_touch_never_share_a_slot() {
        let demands: Vec<Demand> = (0..40)
            .map(|i| Demand {
                len: 8 + i % 5,
                from: i,
                to: i + 1 + (i * 7) % 9,
            })
            .collect();
        let (placed, slots, _) = assign(&demands);
        for (i, a) in demands.iter().enumerate() {
            assert!(slots[placed[i] as usize] >= a.len);
            for (j, b) in demands.iter().enumerate().skip(i + 1) {
                let overlap = a.from <= b.to && b.from <= a.to;
                assert!(!overlap || placed[i] != placed[j], "{i} and {j}");
            }
        }
    }

    #[test]
    fn a_chain_needs_two_buffers() {
        let demands: Vec<Demand> = (0..100)
            .map(|i| Demand {
                len: 64,
                from: i,
                to: i + 1,
            })
            .collect();
        assert_eq!(assign(&demands).1.len(), 2);
    }
}
