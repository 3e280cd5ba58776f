//! Layered layout of a drawing from left to right, after Sugiyama: layers by longest path, order within a
//! layer by barycentres and exchanges of neighbours, heights by constrained least squares. Backward links run
//! below; a layout that is too wide is broken into rows.

mod heights;
mod order;
mod rows;

pub(crate) use rows::in_rows;
use std::collections::VecDeque;

/// A rectangle to place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Block {
    pub width: f64,
    pub height: f64,
    pub side: Side,
}

/// Allowed side of a block.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Side {
    /// Any position.
    Free,
    /// Left of all others.
    Left,
    /// Right of all others.
    Right,
}

/// A link from the right side of one block to the left side of another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Link {
    pub from: usize,
    /// Height of its start below the top of its block.
    pub from_y: f64,
    pub to: usize,
    pub to_y: f64,
    /// Width of the labels at its start and at its end.
    pub room: (f64, f64),
    /// True if the link closes a loop and should be the backward link of it.
    pub closes_loop: bool,
}

/// The result: top left corners of the blocks, courses of the links, and total size.
#[derive(Debug, Clone, Default)]
pub(crate) struct Layout {
    pub corners: Vec<(f64, f64)>,
    /// (link, course); the parts of a link are in any order.
    pub routes: Vec<(usize, Route)>,
    pub size: (f64, f64),
}

/// The course of a link.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Route {
    /// Points joined by curves that start and end horizontally.
    Forward(Vec<(f64, f64)>),
    /// Corners of a course of horizontal and vertical segments.
    Around(Vec<(f64, f64)>),
}

/// A block, or a point at which a long link passes a layer.
#[derive(Debug, Clone, Copy)]
struct Item {
    layer: usize,
    height: f64,
    /// True for a block, false for a passing link.
    solid: bool,
}

/// Part of a link between items of neighbouring layers.
#[derive(Debug, Clone, Copy)]
struct Segment {
    from: usize,
    from_y: f64,
    to: usize,
    to_y: f64,
}

const LAYER_GAP: f64 = 34.0;
const LANE: f64 = 11.0;

/// Computes the layout.
pub(crate) fn layout(blocks: &[Block], links: &[Link]) -> Layout {
    let backward = backward_links(blocks.len(), links);
    let layers = layers(blocks, links, &backward);
    let (items, segments, chains) = subdivide(blocks, links, &backward, &layers);
    let order = order::order(&items, &segments);
    let tops = heights::heights(&items, &segments, &order);
    let Columns { columns, rooms } = Columns::of(blocks, links, &backward, &layers);
    let corner = |i: usize| {
        let column = columns[layers[i]];
        let slack = column.1 - blocks[i].width;
        let shift = match blocks[i].side {
            Side::Left => 0.0,
            Side::Right => slack,
            Side::Free => slack / 2.0,
        };
        (column.0 + shift, tops[i])
    };
    let corners: Vec<_> = (0..blocks.len()).map(corner).collect();
    let bottom = |item: usize| tops[item] + items[item].height;
    let mut lanes = Lanes::default();
    let route = |number: usize, link: &Link, lanes: &mut Lanes| {
        let (from, to) = (corners[link.from], corners[link.to]);
        let start = (from.0 + blocks[link.from].width, from.1 + link.from_y);
        let end = (to.0, to.1 + link.to_y);
        if backward[number] {
            let span = (layers[link.to].min(layers[link.from]), layers[link.from].max(layers[link.to]));
            let within = (0..items.len()).filter(|i| (span.0..=span.1).contains(&items[*i].layer));
            // A self-loop stays close to its block.
            let floor = if link.from == link.to {
                bottom(link.from) - 12.0
            } else {
                within.map(bottom).fold(f64::NEG_INFINITY, f64::max)
            };
            let (from, to) = (layers[link.from], layers[link.to]);
            let right = columns[from].0 + columns[from].1 + rooms[from].0;
            let left = columns[to].0 - rooms[to].1;
            Route::Around(lanes.around(span, floor, (start, right), (end, left)))
        } else {
            let mut points = vec![start];
            let edge = |layer: usize| (columns[layer].0, columns[layer].0 + columns[layer].1);
            // Straight past the labels beside the layer, so that no link crosses them.
            let (from, to) = (layers[link.from], layers[link.to]);
            points.push((edge(from).1 + rooms[from].0, start.1));
            for item in &chains[number] {
                let layer = items[*item].layer;
                let (left, right) = edge(layer);
                let (left, right) = (left - rooms[layer].1, right + rooms[layer].0);
                points.extend([(left, tops[*item]), (right, tops[*item])]);
            }
            points.extend([(edge(to).0 - rooms[to].1, end.1), end]);
            Route::Forward(points)
        }
    };
    let routes = links.iter().enumerate().map(|(number, link)| (number, route(number, link, &mut lanes)));
    let mut layout = Layout { routes: routes.collect(), corners, size: (0.0, 0.0) };
    layout.settle(blocks);
    layout
}

impl Layout {
    /// Moves everything to the origin and computes the size.
    fn settle(&mut self, blocks: &[Block]) {
        let ends = self.corners.iter().zip(blocks).flat_map(|(c, b)| [*c, (c.0 + b.width, c.1 + b.height)]);
        let points: Vec<_> =
            ends.chain(self.routes.iter().flat_map(|(_, r)| r.points().iter().copied())).collect();
        let low = points.iter().fold((f64::INFINITY, f64::INFINITY), |l, p| (l.0.min(p.0), l.1.min(p.1)));
        let high =
            points.iter().fold((0.0_f64, 0.0_f64), |h, p| (h.0.max(p.0 - low.0), h.1.max(p.1 - low.1)));
        let moved = |p: &mut (f64, f64)| *p = (p.0 - low.0, p.1 - low.1);
        self.corners.iter_mut().for_each(moved);
        self.routes.iter_mut().flat_map(|(_, r)| r.points_mut()).for_each(moved);
        self.size = high;
    }
}

impl Route {
    pub(crate) fn points(&self) -> &[(f64, f64)] {
        match self {
            Self::Forward(points) | Self::Around(points) => points,
        }
    }
    pub(crate) fn points_mut(&mut self) -> &mut [(f64, f64)] {
        match self {
            Self::Forward(points) | Self::Around(points) => points,
        }
    }
}

/// Finds backward links: preferably those that close a loop, then any others.
fn backward_links(blocks: usize, links: &[Link]) -> Vec<bool> {
    let mut backward: Vec<bool> = links.iter().map(|link| link.closes_loop || link.from == link.to).collect();
    let mut outgoing = vec![Vec::new(); blocks];
    for (number, link) in links.iter().enumerate().filter(|(n, _)| !backward[*n]) {
        outgoing[link.from].push((number, link.to));
    }
    #[derive(Clone, Copy, PartialEq)]
    enum State {
        New,
        Open,
        Done,
    }
    let mut state = vec![State::New; blocks];
    for root in 0..blocks {
        let mut path = vec![(root, 0)];
        while let Some((block, next)) = path.pop() {
            if next == 0 && state[block] != State::New {
                continue;
            }
            state[block] = State::Open;
            let Some((number, to)) = outgoing[block].get(next).copied() else {
                state[block] = State::Done;
                continue;
            };
            path.push((block, next + 1));
            match state[to] {
                State::Open => backward[number] = true,
                State::New => path.push((to, 0)),
                State::Done => {}
            }
        }
    }
    backward
}

/// Layer of every block: as far left as its inputs allow; blocks that begin signals as far right as their
/// readers allow.
fn layers(blocks: &[Block], links: &[Link], backward: &[bool]) -> Vec<usize> {
    let forward: Vec<&Link> = links.iter().zip(backward).filter(|(_, b)| !**b).map(|(l, _)| l).collect();
    let first = usize::from(blocks.iter().any(|b| b.side == Side::Left));
    let mut layer: Vec<usize> = blocks.iter().map(|b| if b.side == Side::Left { 0 } else { first }).collect();
    let mut waiting = vec![0; blocks.len()];
    let mut outgoing = vec![Vec::new(); blocks.len()];
    for link in &forward {
        waiting[link.to] += 1;
        outgoing[link.from].push(link.to);
    }
    let mut ready: VecDeque<usize> = (0..blocks.len()).filter(|i| waiting[*i] == 0).collect();
    let mut sorted = Vec::with_capacity(blocks.len());
    while let Some(block) = ready.pop_front() {
        sorted.push(block);
        for to in &outgoing[block] {
            layer[*to] = layer[*to].max(layer[block] + 1);
            waiting[*to] -= 1;
            if waiting[*to] == 0 {
                ready.push_back(*to);
            }
        }
    }
    let inner = blocks.iter().zip(&layer).filter(|(b, _)| b.side != Side::Right).map(|(_, l)| *l);
    let last = inner.max().map_or(0, |l| l + 1);
    for (block, layer) in blocks.iter().zip(&mut layer) {
        if block.side == Side::Right {
            *layer = last;
        }
    }
    let begins = beginnings(blocks, links, backward, &sorted);
    for block in sorted.into_iter().rev() {
        let nearest = outgoing[block].iter().map(|to| layer[*to]).min();
        if let (true, Some(nearest)) = (begins[block], nearest) {
            layer[block] = nearest.saturating_sub(1).max(first);
        }
    }
    layer
}

/// Blocks without inputs, and those with inputs only from such blocks that nothing else reads. `order` has every
/// block after its sources.
fn beginnings(blocks: &[Block], links: &[Link], backward: &[bool], order: &[usize]) -> Vec<bool> {
    let mut begins: Vec<bool> = blocks.iter().map(|block| block.side == Side::Free).collect();
    for (link, _) in links.iter().zip(backward).filter(|(_, backward)| **backward) {
        (begins[link.from], begins[link.to]) = (false, false);
    }
    let (mut sources, mut readers) = (vec![Vec::new(); blocks.len()], vec![Vec::new(); blocks.len()]);
    for link in links {
        sources[link.to].push(link.from);
        readers[link.from].push(link.to);
    }
    for block in order {
        let is_alone = |from: &usize| readers[*from].iter().all(|reader| reader == block);
        begins[*block] &= sources[*block].iter().all(|from| begins[*from] && is_alone(from));
    }
    begins
}

type Subdivision = (Vec<Item>, Vec<Segment>, Vec<Vec<usize>>);

/// Splits links into segments between neighbouring layers; the items added for a link form its chain.
fn subdivide(blocks: &[Block], links: &[Link], backward: &[bool], layers: &[usize]) -> Subdivision {
    let mut items: Vec<Item> = blocks
        .iter()
        .zip(layers)
        .map(|(block, layer)| Item { layer: *layer, height: block.height, solid: true })
        .collect();
    let mut segments = Vec::new();
    let mut chains = vec![Vec::new(); links.len()];
    for (number, link) in links.iter().enumerate().filter(|(n, _)| !backward[*n]) {
        let mut at = (link.from, link.from_y);
        for layer in layers[link.from] + 1..layers[link.to] {
            items.push(Item { layer, height: 0.0, solid: false });
            let item = items.len() - 1;
            segments.push(Segment { from: at.0, from_y: at.1, to: item, to_y: 0.0 });
            chains[number].push(item);
            at = (item, 0.0);
        }
        segments.push(Segment { from: at.0, from_y: at.1, to: link.to, to_y: link.to_y });
    }
    (items, segments, chains)
}

/// Horizontal positions of the layers.
struct Columns {
    /// Left edge and width of every layer.
    columns: Vec<(f64, f64)>,
    /// Width to the right and left of every layer for labels.
    rooms: Vec<(f64, f64)>,
}

impl Columns {
    fn of(blocks: &[Block], links: &[Link], backward: &[bool], layers: &[usize]) -> Self {
        let count = layers.iter().max().map_or(0, |l| l + 1);
        let mut width = vec![0.0_f64; count];
        for (block, layer) in blocks.iter().zip(layers) {
            width[*layer] = width[*layer].max(block.width);
        }
        let mut rooms = vec![(0.0_f64, 0.0_f64); count];
        // A link that runs around needs its own lane.
        let mut lanes = vec![(0.0, 0.0); count];
        for (link, backward) in links.iter().zip(backward) {
            let (from, to) = (layers[link.from], layers[link.to]);
            rooms[from].0 = rooms[from].0.max(link.room.0);
            rooms[to].1 = rooms[to].1.max(link.room.1);
            if *backward {
                lanes[from].0 += LANE;
                lanes[to].1 += LANE;
            }
        }
        let mut x = 0.0;
        let columns = (0..count).map(|layer| {
            if layer > 0 {
                let left = rooms[layer - 1].0 + lanes[layer - 1].0;
                x += width[layer - 1] + LAYER_GAP + left + rooms[layer].1 + lanes[layer].1;
            }
            (x, width[layer])
        });
        Self { columns: columns.collect(), rooms }
    }
}

/// Lanes below the blocks for backward links.
#[derive(Default)]
struct Lanes {
    /// (first layer, last layer, height).
    taken: Vec<(usize, usize, f64)>,
}

impl Lanes {
    fn around(
        &mut self,
        span: (usize, usize),
        floor: f64,
        (start, right): ((f64, f64), f64),
        (end, left): ((f64, f64), f64),
    ) -> Vec<(f64, f64)> {
        let beside = |at: usize| self.taken.iter().filter(|t| t.0 == at || t.1 == at).count() as f64 * LANE;
        let (right, left) = (right + 10.0 + beside(span.1), left - 10.0 - beside(span.0));
        let mut lowest = floor + 24.0;
        let meets = |t: &&(usize, usize, f64), at: f64| {
            t.0 <= span.1 && span.0 <= t.1 && (t.2 - at).abs() < 0.99 * LANE
        };
        while let Some(taken) = self.taken.iter().find(|t| meets(t, lowest)) {
            lowest = taken.2 + LANE;
        }
        self.taken.push((span.0, span.1, lowest));
        vec![start, (right, start.1), (right, lowest), (left, lowest), (left, end.1), end]
    }
}

#[cfg(test)]
mod tests;
