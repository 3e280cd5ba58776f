//! Order of items within their layers, with few crossings.

use super::{Item, Segment};

/// Rounds of sorting by barycentres; the best order is kept.
const ROUNDS: usize = 16;

/// Items of every layer from top to bottom.
pub(super) fn order(items: &[Item], segments: &[Segment]) -> Vec<Vec<usize>> {
    let count = items.iter().map(|item| item.layer + 1).max().unwrap_or(0);
    let mut layers = vec![Vec::new(); count];
    for (number, item) in items.iter().enumerate() {
        layers[item.layer].push(number);
    }
    let sides = Sides::of(items, segments);
    let mut best = (sides.crossings(&layers), layers.clone());
    for round in 0..ROUNDS {
        if round % 2 == 0 {
            for layer in 1..count {
                sides.sort(&mut layers, layer, Direction::Left);
            }
        } else {
            for layer in (0..count.saturating_sub(1)).rev() {
                sides.sort(&mut layers, layer, Direction::Right);
            }
        }
        sides.exchange(&mut layers);
        let crossings = sides.crossings(&layers);
        if crossings < best.0 {
            best = (crossings, layers.clone());
        }
        if best.0 == 0 {
            break;
        }
    }
    best.1
}

#[derive(Clone, Copy)]
enum Direction {
    Left,
    Right,
}

/// The neighbours of every item: (other item, height of the segment's end on it, height on this item).
struct Sides {
    left: Vec<Vec<(usize, f64, f64)>>,
    right: Vec<Vec<(usize, f64, f64)>>,
}

impl Sides {
    fn of(items: &[Item], segments: &[Segment]) -> Self {
        let part = |item: usize, y: f64| {
            if items[item].height > 0.0 { y / items[item].height } else { 0.5 }
        };
        let mut sides = Self { left: vec![Vec::new(); items.len()], right: vec![Vec::new(); items.len()] };
        for segment in segments {
            let (from, to) = (part(segment.from, segment.from_y), part(segment.to, segment.to_y));
            sides.right[segment.from].push((segment.to, to, from));
            sides.left[segment.to].push((segment.from, from, to));
        }
        sides
    }

    fn sort(&self, layers: &mut [Vec<usize>], layer: usize, direction: Direction) {
        let (neighbours, other) = match direction {
            Direction::Left => (&self.left, layer - 1),
            Direction::Right => (&self.right, layer + 1),
        };
        let place = places(&layers[other], neighbours.len());
        let mut keyed: Vec<(f64, usize)> = layers[layer]
            .iter()
            .enumerate()
            .map(|(now, item)| {
                let beside = &neighbours[*item];
                // An item without neighbours keeps its relative position.
                if beside.is_empty() {
                    let share = layers[other].len() as f64 / layers[layer].len() as f64;
                    return ((now as f64 + 0.5) * share, *item);
                }
                let sum: f64 = beside.iter().map(|(other, part, _)| place[*other] + part).sum();
                (sum / beside.len() as f64, *item)
            })
            .collect();
        keyed.sort_by(|a, b| a.0.total_cmp(&b.0));
        layers[layer] = keyed.into_iter().map(|(_, item)| item).collect();
    }

    /// Exchanges neighbours in a layer if that reduces the crossings.
    fn exchange(&self, layers: &mut [Vec<usize>]) {
        for layer in 0..layers.len() {
            let left = layer.checked_sub(1).map(|l| places(&layers[l], self.left.len()));
            let right = layers.get(layer + 1).map(|l| places(l, self.left.len()));
            let (mut changed, mut passes) = (true, 0);
            while changed && passes < 8 {
                (changed, passes) = (false, passes + 1);
                for i in 1..layers[layer].len() {
                    let (above, below) = (layers[layer][i - 1], layers[layer][i]);
                    let cost = |a: usize, b: usize| {
                        let of = |sides: &[Vec<(usize, f64, f64)>], place: &Option<Vec<f64>>| {
                            place.as_ref().map_or(0, |place| pair_crossings(&sides[a], &sides[b], place))
                        };
                        of(&self.left, &left) + of(&self.right, &right)
                    };
                    if cost(below, above) < cost(above, below) {
                        layers[layer].swap(i - 1, i);
                        changed = true;
                    }
                }
            }
        }
    }

    fn crossings(&self, layers: &[Vec<usize>]) -> usize {
        let between = layers.windows(2).map(|pair| {
            let place = places(&pair[1], self.left.len());
            let ends = |(y, item): (usize, &usize)| {
                let place = &place;
                let start = y as f64;
                self.right[*item]
                    .iter()
                    .map(move |(to, part, own)| (start + own, place[*to] + part))
                    .collect::<Vec<_>>()
            };
            let segments: Vec<(f64, f64)> = pair[0].iter().enumerate().flat_map(ends).collect();
            let crossing = |(i, a): (usize, &(f64, f64))| {
                segments[i + 1..].iter().filter(|b| (a.0 - b.0) * (a.1 - b.1) < 0.0).count()
            };
            segments.iter().enumerate().map(crossing).sum::<usize>()
        });
        between.sum()
    }
}

/// Crossings between the segments of `above` and `below` in this order.
fn pair_crossings(above: &[(usize, f64, f64)], below: &[(usize, f64, f64)], place: &[f64]) -> usize {
    let at = |end: &(usize, f64, f64)| place[end.0] + end.1;
    above.iter().map(|a| below.iter().filter(|b| at(b) < at(a)).count()).sum()
}

fn places(layer: &[usize], items: usize) -> Vec<f64> {
    let mut place = vec![0.0; items];
    for (i, item) in layer.iter().enumerate() {
        place[*item] = i as f64;
    }
    place
}
