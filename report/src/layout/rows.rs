//! Layouts wider than a page: layers are broken into rows like text into lines, and links between rows run
//! down the right margin, back between the rows, and in from the left.

use super::{Block, Columns, LANE, Layout, Link, Route, Side, backward_links, beginnings, layers, layout};

/// Distance from a row to the first lane below it, and from the last lane to the next row.
const ROW_GAP: f64 = 22.0;
/// Cost of a last row with one box, beside 1 for a row more.
const ALONE: f64 = 0.3;

/// Computes the layout, in rows of about `widest` if one row is too wide.
pub(crate) fn in_rows(blocks: &[Block], links: &[Link], widest: f64) -> Layout {
    let backward = backward_links(blocks.len(), links);
    let layers = layers(blocks, links, &backward);
    let Columns { columns, .. } = Columns::of(blocks, links, &backward, &layers);
    let total = columns.last().map_or(0.0, |(x, width)| x + width);
    if total <= widest {
        return layout(blocks, links);
    }
    let row_of_layer = rows(&columns, links, &layers, widest);
    let mut row: Vec<usize> = layers.iter().map(|layer| row_of_layer[*layer]).collect();
    let mut order: Vec<usize> = (0..blocks.len()).collect();
    order.sort_by_key(|block| layers[*block]);
    let begins = beginnings(blocks, links, &backward, &order);
    gather(blocks, links, (&order, &begins), widest, &mut row);
    beside_neighbours(blocks, links, &mut row);
    let count = without_gaps(&mut row);
    let crossings = crossings(links, &row);
    let rows: Vec<Row> = (0..count).map(|number| Row::of(number, blocks, links, &row, &crossings)).collect();
    stack(blocks, links, &rows, &crossings)
}

/// Moves a pin to the row of its neighbour.
fn beside_neighbours(blocks: &[Block], links: &[Link], row: &mut [usize]) {
    for link in links {
        if blocks[link.from].side == Side::Left {
            row[link.from] = row[link.to];
        }
        if blocks[link.to].side == Side::Right {
            row[link.to] = row[link.from];
        }
    }
}

/// Numbers the rows anew if some have no blocks. Returns how many there are.
fn without_gaps(row: &mut [usize]) -> usize {
    let mut used = row.to_vec();
    used.sort_unstable();
    used.dedup();
    for row in row.iter_mut() {
        *row = used.partition_point(|known| known < row);
    }
    used.len()
}

/// Moves blocks that nothing reads up to the row of their sources, and blocks that begin signals down to the row
/// of their readers, where there is room: links within a row are short.
fn gather(
    blocks: &[Block],
    links: &[Link],
    (order, begins): (&[usize], &[bool]),
    widest: f64,
    row: &mut Vec<usize>,
) {
    let width = |number: usize, row: &[usize]| {
        let mut row = row.to_vec();
        beside_neighbours(blocks, links, &mut row);
        let crossings = crossings(links, &row);
        Row::of(number, blocks, links, &row, &crossings).placed.size.0
    };
    let attempt = |block: usize, to: usize, row: &mut Vec<usize>| {
        let mut moved = row.clone();
        moved[block] = to;
        if width(to, &moved) <= width(to, row).max(widest) {
            *row = moved;
        }
    };
    let is_free = |block: usize| blocks[block].side == Side::Free;
    for block in order.iter().copied().filter(|block| is_free(*block)) {
        let sources = links.iter().filter(|link| link.to == block).map(|link| link.from);
        let nearest = sources.filter(|from| is_free(*from)).map(|from| row[from]).max();
        let is_read = links.iter().any(|link| link.from == block);
        if let (false, Some(nearest)) = (is_read, nearest)
            && nearest < row[block]
        {
            attempt(block, nearest, row);
        }
    }
    for block in order.iter().rev().copied().filter(|block| begins[*block]) {
        let readers = links.iter().filter(|link| link.from == block).map(|link| link.to);
        let nearest = readers.filter(|to| is_free(*to)).map(|to| row[to]).min();
        if let Some(nearest) = nearest
            && nearest > row[block]
        {
            attempt(block, nearest, row);
        }
    }
}

/// Row of every layer: as few rows as needed, of similar widths, broken where few links pass.
fn rows(columns: &[(f64, f64)], links: &[Link], layers: &[usize], widest: f64) -> Vec<usize> {
    let count = columns.len();
    let width = |first: usize, end: usize| columns[end - 1].0 + columns[end - 1].1 - columns[first].0;
    // For each layer: the links from the layers before it to it and those behind.
    let mut passing = vec![0_i64; count + 1];
    for link in links {
        let (a, b) = (layers[link.from], layers[link.to]);
        passing[a.min(b) + 1] += 1;
        passing[a.max(b) + 1] -= 1;
    }
    for layer in 1..=count {
        passing[layer] += passing[layer - 1];
    }
    let last = layers.iter().filter(|layer| **layer + 1 == count).count();
    // For each layer: the minimum cost of breaking the layers before it, and the start of its last row.
    let mut best = vec![(0.0_f64, 0_usize); count + 1];
    for end in 1..=count {
        best[end] = (f64::INFINITY, 0);
        for first in (0..end).rev() {
            let width = width(first, end);
            if width > widest && end - first > 1 {
                break;
            }
            let slack = (1.0 - width / widest).max(0.0);
            let ragged = if end == count { 0.0 } else { slack * slack };
            let broken = if first == 0 { 0.0 } else { 1.0 + 0.02 * passing[first] as f64 };
            // A box in a row of its own is far from what leads to it.
            let alone = if first > 0 && first + 1 == count && last == 1 { ALONE } else { 0.0 };
            let cost = best[first].0 + ragged + broken + alone;
            if cost < best[end].0 {
                best[end] = (cost, first);
            }
        }
    }
    let mut breaks = Vec::new();
    let mut end = count;
    while end > 0 {
        end = best[end].1;
        breaks.push(end);
    }
    (0..count).map(|layer| breaks.iter().filter(|first| **first <= layer).count() - 1).collect()
}

/// Links from one row to another that start at the same port and run together.
struct Crossing {
    from: usize,
    from_y: f64,
    from_row: usize,
    to_row: usize,
    links: Vec<usize>,
}

fn crossings(links: &[Link], row: &[usize]) -> Vec<Crossing> {
    let mut crossings: Vec<Crossing> = Vec::new();
    for (number, link) in links.iter().enumerate() {
        let (from_row, to_row) = (row[link.from], row[link.to]);
        if from_row == to_row {
            continue;
        }
        let same = |c: &&mut Crossing| (c.from, c.from_y, c.to_row) == (link.from, link.from_y, to_row);
        match crossings.iter_mut().find(same) {
            Some(crossing) => crossing.links.push(number),
            None => crossings.push(Crossing {
                from: link.from,
                from_y: link.from_y,
                from_row,
                to_row,
                links: vec![number],
            }),
        }
    }
    crossings
}

/// One row, laid out alone, with pins at the ends of links to and from other rows.
struct Row {
    /// Indices of its blocks among all blocks.
    blocks: Vec<usize>,
    /// Indices of its links among all links, including the parts of crossing links at pins.
    links: Vec<usize>,
    /// Pins among the blocks of its layout at which a crossing leaves, and enters.
    exits: Vec<(usize, usize)>,
    entries: Vec<(usize, usize)>,
    placed: Layout,
}

impl Row {
    fn of(number: usize, blocks: &[Block], links: &[Link], row: &[usize], crossings: &[Crossing]) -> Self {
        let own: Vec<usize> = (0..blocks.len()).filter(|block| row[*block] == number).collect();
        let mut here = vec![usize::MAX; blocks.len()];
        own.iter().enumerate().for_each(|(place, block)| here[*block] = place);
        let mut parts: Vec<Block> = own.iter().map(|block| blocks[*block]).collect();
        let (mut joined, mut numbers) = (Vec::new(), Vec::new());
        for (link_number, link) in links.iter().enumerate() {
            if row[link.from] == number && row[link.to] == number {
                let (from, to) = (here[link.from], here[link.to]);
                joined.push(Link { from, to, ..*link });
                numbers.push(link_number);
            }
        }
        let (mut exits, mut entries) = (Vec::new(), Vec::new());
        let mut pin = |side: Side| {
            parts.push(Block { width: 0.0, height: 0.0, side });
            parts.len() - 1
        };
        for (i, crossing) in crossings.iter().enumerate() {
            if crossing.from_row == number {
                let to = pin(Side::Right);
                exits.push((i, to));
                let room = crossing.links.iter().map(|link| links[*link].room.0);
                joined.push(Link {
                    from: here[crossing.from],
                    from_y: crossing.from_y,
                    to,
                    to_y: 0.0,
                    room: (room.fold(0.0, f64::max), 0.0),
                    closes_loop: false,
                });
                numbers.push(crossing.links[0]);
            }
            if crossing.to_row == number {
                let from = pin(Side::Left);
                entries.push((i, from));
                for link_number in &crossing.links {
                    let link = &links[*link_number];
                    joined.push(Link {
                        from,
                        from_y: 0.0,
                        to: here[link.to],
                        to_y: link.to_y,
                        room: (0.0, link.room.1),
                        closes_loop: false,
                    });
                    numbers.push(*link_number);
                }
            }
        }
        let placed = layout(&parts, &joined);
        Self { blocks: own, links: numbers, exits, entries, placed }
    }

    fn pin(&self, pins: &[(usize, usize)], crossing: usize) -> (f64, f64) {
        let pin = pins.iter().find(|(number, _)| *number == crossing);
        pin.map_or((0.0, 0.0), |(_, block)| self.placed.corners[*block])
    }
}

/// Stacks the rows and draws the crossings around them.
fn stack(blocks: &[Block], links: &[Link], rows: &[Row], crossings: &[Crossing]) -> Layout {
    let stack = Stack::of(rows, crossings);
    let mut layout = stack.place_rows(blocks.len());
    let lanes = stack.draw_crossings(blocks, &mut layout);
    let right = if lanes > 0 { width_of(lanes - 1) + 8.0 } else { 0.0 };
    to_the_edges(&mut layout, blocks, links, stack.left + stack.widest + right);
    layout.settle(blocks);
    layout
}

/// Width of parallel lanes.
fn width_of(lanes: usize) -> f64 {
    lanes as f64 * LANE
}

/// Rows below each other, with room for the crossings.
struct Stack<'a> {
    rows: &'a [Row],
    crossings: &'a [Crossing],
    /// Left edge of the rows, and the width of the widest.
    left: f64,
    widest: f64,
    /// Upper edge of every row.
    tops: Vec<f64>,
}

impl<'a> Stack<'a> {
    fn of(rows: &'a [Row], crossings: &'a [Crossing]) -> Self {
        let most = rows.iter().map(|row| row.entries.len()).max().unwrap_or(0);
        let left = if most > 0 { width_of(most) + 4.0 } else { 0.0 };
        let widest = rows.iter().map(|row| row.placed.size.0).fold(0.0, f64::max);
        let (mut tops, mut y) = (Vec::new(), 0.0);
        for (number, row) in rows.iter().enumerate() {
            y += match (number, row.entries.len()) {
                (0, 0) => 0.0,
                (0, entries) => width_of(entries) + ROW_GAP,
                (_, entries) => 2.0 * ROW_GAP + width_of(entries),
            };
            tops.push(y);
            y += row.placed.size.1;
        }
        Self { rows, crossings, left, widest, tops }
    }

    fn place_rows(&self, blocks: usize) -> Layout {
        let mut layout = Layout { corners: vec![(0.0, 0.0); blocks], ..Layout::default() };
        for (row, top) in self.rows.iter().zip(&self.tops) {
            let moved = |p: (f64, f64)| (p.0 + self.left, p.1 + top);
            for (place, block) in row.blocks.iter().enumerate() {
                layout.corners[*block] = moved(row.placed.corners[place]);
            }
            for (number, route) in &row.placed.routes {
                let mut route = route.clone();
                route.points_mut().iter_mut().for_each(|p| *p = moved(*p));
                layout.routes.push((row.links[*number], route));
            }
        }
        layout
    }

    /// Rank of every crossing among those into its row, by entry height: the topmost runs lowest and innermost.
    fn ranks(&self) -> Vec<usize> {
        let mut ranks = vec![0; self.crossings.len()];
        for row in self.rows {
            let mut order: Vec<(f64, usize)> =
                row.entries.iter().map(|(crossing, pin)| (row.placed.corners[*pin].1, *crossing)).collect();
            order.sort_by(|a, b| a.0.total_cmp(&b.0));
            order.iter().enumerate().for_each(|(place, (_, crossing))| ranks[*crossing] = place);
        }
        ranks
    }

    fn exit(&self, crossing: usize) -> (f64, f64) {
        let row = self.crossings[crossing].from_row;
        let (x, y) = self.rows[row].pin(&self.rows[row].exits, crossing);
        (x + self.left, y + self.tops[row])
    }

    /// Draws every crossing from its exit down the right margin to its entry. Returns the number of lanes there.
    fn draw_crossings(&self, blocks: &[Block], layout: &mut Layout) -> usize {
        let ranks = self.ranks();
        // In order from the lowest exit up: it has the innermost lane.
        let mut by_exit: Vec<usize> = (0..self.crossings.len()).collect();
        by_exit.sort_by(|a, b| self.exit(*b).1.total_cmp(&self.exit(*a).1));
        let mut taken: Vec<(f64, f64, usize)> = Vec::new();
        for number in by_exit {
            let crossing = &self.crossings[number];
            let (exit, into) = (self.exit(number), &self.rows[crossing.to_row]);
            let pin = into.pin(&into.entries, number);
            let entry = (pin.0 + self.left, pin.1 + self.tops[crossing.to_row]);
            let lane_y = self.tops[crossing.to_row] - ROW_GAP - width_of(ranks[number]);
            let lane_x = self.left - 4.0 - width_of(ranks[number]);
            let (low, high) = (exit.1.min(lane_y) - 4.0, exit.1.max(lane_y) + 4.0);
            let free = |lane: &usize| !taken.iter().any(|t| t.2 == *lane && t.0 < high && low < t.1);
            let lane = (0..self.crossings.len()).find(free).unwrap_or(0);
            taken.push((low, high, lane));
            let right_x = self.left + self.widest + 4.0 + width_of(lane);
            let corners = [(right_x, exit.1), (right_x, lane_y), (lane_x, lane_y), (lane_x, entry.1)];
            let around = Route::Around([&[exit][..], &corners, &[entry]].concat());
            let ways_out = way_out(layout, blocks, crossing);
            for (i, link) in crossing.links.iter().enumerate() {
                if i > 0 {
                    layout.routes.extend(ways_out.iter().map(|route| (*link, route.clone())));
                }
                layout.routes.push((*link, around.clone()));
            }
        }
        taken.iter().map(|(.., lane)| lane + 1).max().unwrap_or(0)
    }
}

/// The exit that the links of a crossing share, which was drawn for the first of them only.
fn way_out(layout: &Layout, blocks: &[Block], crossing: &Crossing) -> Vec<Route> {
    let corner = layout.corners[crossing.from];
    let start = (corner.0 + blocks[crossing.from].width, corner.1 + crossing.from_y);
    let near = |p: &(f64, f64)| (p.0 - start.0).abs() + (p.1 - start.1).abs() < 0.01;
    let routes = layout.routes.iter().filter(|(link, _)| *link == crossing.links[0]);
    let routes = routes.filter(|(_, route)| route.points().first().is_some_and(near));
    routes.map(|(_, route)| route.clone()).collect()
}

/// Moves pins to the outer edges, outside of the lanes.
fn to_the_edges(layout: &mut Layout, blocks: &[Block], links: &[Link], right: f64) {
    for (corner, block) in layout.corners.iter_mut().zip(blocks) {
        match block.side {
            Side::Left => corner.0 = 0.0,
            Side::Right => corner.0 = right,
            Side::Free => {}
        }
    }
    for (number, route) in &mut layout.routes {
        let Route::Forward(points) = route else { continue };
        let link = &links[*number];
        if blocks[link.from].side == Side::Left {
            points.insert(0, layout.corners[link.from]);
        }
        if blocks[link.to].side == Side::Right {
            points.push(layout.corners[link.to]);
        }
    }
}
