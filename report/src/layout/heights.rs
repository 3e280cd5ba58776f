//! Vertical positions of items: as close as possible to straight links, in the order of each layer.

use super::{Item, Segment};

const ROUNDS: usize = 24;

/// The top of every item.
pub(super) fn heights(items: &[Item], segments: &[Segment], order: &[Vec<usize>]) -> Vec<f64> {
    let mut tops = vec![0.0; items.len()];
    for layer in order {
        let mut y = 0.0;
        for pair in layer.windows(2) {
            tops[pair[0]] = y;
            y += step(items, pair[0], pair[1]);
        }
        if let Some(last) = layer.last() {
            tops[*last] = y;
        }
    }
    let mut pulls = vec![Vec::new(); items.len()];
    for segment in segments {
        // Links across several layers are straightened first.
        let passing = [segment.from, segment.to].iter().filter(|item| !items[**item].solid).count();
        let weight = [1.0, 2.0, 8.0][passing];
        let offset = segment.from_y - segment.to_y;
        pulls[segment.to].push((segment.from, offset, weight));
        pulls[segment.from].push((segment.to, -offset, weight));
    }
    for round in 0..ROUNDS {
        let layers: Box<dyn Iterator<Item = &Vec<usize>>> =
            if round % 2 == 0 { Box::new(order.iter()) } else { Box::new(order.iter().rev()) };
        for layer in layers {
            settle(items, layer, &pulls, &mut tops);
        }
    }
    tops
}

/// Distance from the top of an item to the top of the next one below.
fn step(items: &[Item], above: usize, below: usize) -> f64 {
    let gap = match (items[above].solid, items[below].solid) {
        (true, true) if items[above].height == 0.0 && items[below].height == 0.0 => 14.0,
        (true, true) => 26.0,
        (false, false) => 12.0,
        _ => 18.0,
    };
    items[above].height + gap
}

/// Least squares for one layer under its order, by pooling adjacent violators.
fn settle(items: &[Item], layer: &[usize], pulls: &[Vec<(usize, f64, f64)>], tops: &mut [f64]) {
    struct Pool {
        mean: f64,
        weight: f64,
        members: usize,
    }
    let mut offset = 0.0;
    let mut offsets = Vec::with_capacity(layer.len());
    let mut pools: Vec<Pool> = Vec::new();
    for (i, item) in layer.iter().enumerate() {
        if i > 0 {
            offset += step(items, layer[i - 1], *item);
        }
        offsets.push(offset);
        let weight: f64 = pulls[*item].iter().map(|pull| pull.2).sum();
        let wanted: f64 = pulls[*item].iter().map(|(other, shift, w)| (tops[*other] + shift) * w).sum();
        // An item without links keeps its position but yields to all others.
        let (wanted, weight) = if weight > 0.0 { (wanted / weight, weight) } else { (tops[*item], 0.01) };
        let mut pool = Pool { mean: wanted - offset, weight, members: 1 };
        while let Some(above) = pools.pop_if(|above| above.mean > pool.mean) {
            let weight = above.weight + pool.weight;
            pool = Pool {
                mean: (above.mean * above.weight + pool.mean * pool.weight) / weight,
                weight,
                members: above.members + pool.members,
            };
        }
        pools.push(pool);
    }
    let means = pools.iter().flat_map(|pool| std::iter::repeat_n(pool.mean, pool.members));
    for ((item, mean), offset) in layer.iter().zip(means).zip(offsets) {
        tops[*item] = mean + offset;
    }
}
