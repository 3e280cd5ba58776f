use super::*;

fn block(width: f64, height: f64) -> Block {
    Block { width, height, side: Side::Free }
}

fn link(from: usize, to: usize) -> Link {
    Link { from, from_y: 10.0, to, to_y: 10.0, room: (0.0, 0.0), closes_loop: false }
}

fn overlap(layout: &Layout, blocks: &[Block]) -> bool {
    let apart = |i: usize, j: usize| {
        let (a, b) = (layout.corners[i], layout.corners[j]);
        a.0 + blocks[i].width <= b.0
            || b.0 + blocks[j].width <= a.0
            || a.1 + blocks[i].height <= b.1
            || b.1 + blocks[j].height <= a.1
    };
    (0..blocks.len()).any(|i| (0..i).any(|j| !apart(i, j)))
}

#[test]
fn a_chain_is_a_straight_line() {
    let blocks = [block(50.0, 30.0), block(80.0, 30.0), block(20.0, 30.0)];
    let layout = layout(&blocks, &[link(0, 1), link(1, 2)]);
    assert!(layout.corners.iter().all(|c| (c.1 - layout.corners[0].1).abs() < 1e-6));
    assert!(layout.corners.windows(2).all(|w| w[0].0 < w[1].0));
}

#[test]
fn a_planar_graph_is_drawn_without_crossings() {
    // Two chains whose blocks are named in opposite order.
    let blocks = [block(40.0, 30.0); 6];
    let links = [link(0, 3), link(1, 2), link(3, 4), link(2, 5)];
    let layout = layout(&blocks, &links);
    for routes in [[0, 1], [2, 3]] {
        let [a, b] = routes.map(|i| layout.routes[i].1.points());
        let starts = a[0].1 - b[0].1;
        let ends = a[a.len() - 1].1 - b[b.len() - 1].1;
        assert!(starts * ends > 0.0);
    }
}

#[test]
fn no_blocks_overlap_and_every_link_ends_at_its_blocks() {
    let mut state = 12345u64;
    let mut random = move |below: usize| {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 33) as usize % below
    };
    for _ in 0..40 {
        let count = 2 + random(40);
        let blocks: Vec<_> =
            (0..count).map(|_| block(20.0 + random(100) as f64, 20.0 + random(60) as f64)).collect();
        let links: Vec<_> = (0..count * 2).map(|_| link(random(count), random(count))).collect();
        let layout = layout(&blocks, &links);
        assert!(!overlap(&layout, &blocks));
        for (link, (_, route)) in links.iter().zip(&layout.routes) {
            let points = route.points();
            let (from, to) = (layout.corners[link.from], layout.corners[link.to]);
            let near = |a: (f64, f64), b: (f64, f64)| (a.0 - b.0).abs() + (a.1 - b.1).abs() < 1e-6;
            assert!(near(points[0], (from.0 + blocks[link.from].width, from.1 + 10.0)));
            assert!(near(points[points.len() - 1], (to.0, to.1 + 10.0)));
        }
    }
}

#[test]
fn a_loop_is_closed_by_the_link_that_says_so() {
    let blocks = [block(40.0, 30.0); 3];
    let mut links = [link(0, 1), link(1, 2), link(2, 0)];
    links[0].closes_loop = true;
    let layout = layout(&blocks, &links);
    let around: Vec<_> = layout.routes.iter().map(|(_, r)| matches!(r, Route::Around(_))).collect();
    assert_eq!(around, [true, false, false]);
}

#[test]
fn pins_stand_at_their_sides() {
    let pin = |side| Block { width: 0.0, height: 0.0, side };
    let blocks = [block(40.0, 30.0), pin(Side::Left), pin(Side::Right), block(40.0, 30.0)];
    let at = |from, to| Link { from_y: 0.0, to_y: 0.0, ..link(from, to) };
    let layout = layout(&blocks, &[at(1, 0), at(0, 2), at(1, 3)]);
    assert!(layout.corners[1].0 < layout.corners[0].0 && layout.corners[2].0 > layout.corners[3].0 + 40.0);
}

#[test]
fn what_ends_or_begins_a_signal_stands_in_the_row_of_its_neighbour() {
    // A chain of eight in two rows; a block reads the first, another feeds the seventh through one more.
    let blocks = [block(100.0, 30.0); 11];
    let mut links: Vec<_> = (0..7).map(|i| link(i, i + 1)).collect();
    links.extend([link(0, 8), link(9, 10), link(10, 6)]);
    let layout = in_rows(&blocks, &links, 600.0);
    let y = |block: usize| layout.corners[block].1;
    let height = layout.size.1;
    let is_above = |block: usize| y(block) < height / 2.0;
    assert!(is_above(0) && !is_above(6) && !overlap(&layout, &blocks));
    assert!(is_above(8) && !is_above(9) && !is_above(10));
    let parts = |number: usize| layout.routes.iter().filter(|(of, _)| *of == number).count();
    assert!((7..10).all(|number| parts(number) == 1), "they stay within a row");
}

#[test]
fn no_box_is_left_alone_in_the_last_row() {
    let blocks = [block(100.0, 30.0); 7];
    let links: Vec<_> = (0..6).map(|i| link(i, i + 1)).collect();
    let layout = in_rows(&blocks, &links, 400.0);
    let y = |block: usize| layout.corners[block].1;
    assert!((y(6) - y(5)).abs() < 1e-6 && !overlap(&layout, &blocks));
}

/// Links each other way, blocks of many sizes: what holds of any graph that is broken into rows.
#[test]
fn rows_hold_every_block_once_and_every_link_runs_through() {
    const WIDEST: f64 = 500.0;
    let mut state = 99_u64;
    let mut random = move |below: usize| {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 33) as usize % below
    };
    let mut broken = 0;
    for _ in 0..40 {
        let count = 8 + random(40);
        let blocks: Vec<_> =
            (0..count).map(|_| block(20.0 + random(100) as f64, 20.0 + random(60) as f64)).collect();
        let mut links: Vec<_> = (1..count).map(|i| link(i - 1 - random(i.min(3)), i)).collect();
        links.extend((0..count / 4).map(|_| link(random(count), random(count))));
        let layout = in_rows(&blocks, &links, WIDEST);
        assert!(!overlap(&layout, &blocks));
        let right = |(corner, block): (&(f64, f64), &Block)| corner.0 + block.width;
        let widths = layout.corners.iter().zip(&blocks).map(right);
        let left = layout.corners.iter().map(|corner| corner.0).fold(f64::INFINITY, f64::min);
        // A row may be as wide as links that go round in it make it.
        assert!(widths.fold(0.0, f64::max) - left < 1.5 * WIDEST);
        for (number, link) in links.iter().enumerate() {
            let parts: Vec<&[(f64, f64)]> = layout
                .routes
                .iter()
                .filter(|(of, _)| *of == number)
                .map(|(_, route)| route.points())
                .collect();
            broken += usize::from(parts.len() > 1);
            let (from, to) = (layout.corners[link.from], layout.corners[link.to]);
            let near = |a: (f64, f64), b: (f64, f64)| (a.0 - b.0).abs() + (a.1 - b.1).abs() < 1e-6;
            let mut at = (from.0 + blocks[link.from].width, from.1 + 10.0);
            for _ in &parts {
                let part = parts.iter().find(|part| near(part[0], at)).expect("it goes on");
                at = part[part.len() - 1];
            }
            assert!(near(at, (to.0, to.1 + 10.0)), "link {number}");
        }
    }
    assert!(broken > 40);
}
