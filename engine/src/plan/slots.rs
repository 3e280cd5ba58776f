//! Buffers reused by lifetime: a linear scan over the steps.

use crate::io::LINE;
use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

/// A buffer that a step writes, before it has a place.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Demand {
    /// f64s.
    pub len: usize,
    /// Step that writes it.
    pub from: usize,
    /// Last step that needs it.
    pub to: usize,
    /// The only step that reads it; [`MANY`] if a tap or several do.
    pub reader: Option<usize>,
}

/// Stands for several readers.
pub(crate) const MANY: usize = usize::MAX;

/// Gives every demand a slot; two demands share one only if their lives do not touch. Returns the slot of each
/// demand, and the length of each slot.
pub(crate) fn assign(demands: &[Demand]) -> (Vec<u32>, Vec<usize>) {
    let mut order: Vec<usize> = (0..demands.len()).collect();
    order.sort_by_key(|i| demands[*i].from);
    let mut slots: Vec<usize> = Vec::new();
    // Slots in use by the step that needs them last, and free ones by length: of equal ones the one freed last,
    // which is most likely still in the processor's nearest cache.
    let mut busy: BinaryHeap<Reverse<(usize, u32)>> = BinaryHeap::new();
    let mut free: BTreeMap<usize, Vec<u32>> = BTreeMap::new();
    let mut placed = vec![0_u32; demands.len()];
    for i in order {
        let Demand { len, from, to, .. } = demands[i];
        let len = len.next_multiple_of(LINE);
        while let Some(Reverse((until, slot))) = busy.peek().copied()
            && until < from
        {
            busy.pop();
            free.entry(slots[slot as usize]).or_default().push(slot);
        }
        let slot = take_best(&mut free, len).unwrap_or_else(|| {
            slots.push(0);
            (slots.len() - 1) as u32
        });
        slots[slot as usize] = slots[slot as usize].max(len);
        busy.push(Reverse((to, slot)));
        placed[i] = slot;
    }
    (placed, slots)
}

/// The best fit: the smallest that is large enough, else the largest, to be grown.
fn take_best(free: &mut BTreeMap<usize, Vec<u32>>, len: usize) -> Option<u32> {
    let fit = free.range(len..).next().or_else(|| free.last_key_value());
    let fit = *fit?.0;
    let slots = free.get_mut(&fit)?;
    let slot = slots.pop();
    if slots.is_empty() {
        free.remove(&fit);
    }
    slot
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lives_that_touch_never_share_a_slot() {
        let demands: Vec<Demand> = (0..40)
            .map(|i| Demand { len: 8 + i % 5, from: i, to: i + 1 + (i * 7) % 9, reader: None })
            .collect();
        let (placed, slots) = assign(&demands);
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
        let demands: Vec<Demand> =
            (0..100).map(|i| Demand { len: 64, from: i, to: i + 1, reader: None }).collect();
        assert_eq!(assign(&demands).1.len(), 2);
    }
}
