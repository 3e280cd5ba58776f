//! Renders a scene as SVG.

use super::super::svg::{Anchor, Path, Rect, Svg, text_width};
use super::super::theme::Ink;
use super::sketch::{NodeBox, Role, Sketch, Stroke, WireLine};
use super::{DIVIDER, HEADER, Route, SETTING, Scene, port_height, settings_top};
use std::collections::BTreeMap;

const MARGIN: f64 = 28.0;
const TOP: f64 = 64.0;

pub(super) fn paint(sketch: &Sketch, scene: &Scene, title: &str, style: &str) -> String {
    let size = size(sketch, scene);
    let mut svg = Svg::on_paper(size);
    svg.raw(format_args!("<style>{SHAPES}</style>"));
    svg.text("title ink", (MARGIN, 24.0), Anchor::Start, title);
    paint_legend(&mut svg, sketch);
    svg.raw(format_args!("<g transform=\"translate({MARGIN} {TOP})\">"));
    let wires = whole_wires(scene);
    for (path, frame) in &scene.groups {
        let name = path.trim_end_matches('/').rsplit('/').next().unwrap_or_default();
        svg.rect("panel frame grp", *frame, 10.0);
        svg.text("small soft strong", (frame.x + 12.0, frame.y + 17.0), Anchor::Start, name);
    }
    paint_regions(&mut svg, sketch, scene, &wires);
    for (number, routes) in &wires {
        paint_wire(&mut svg, &sketch.wires[*number], routes);
    }
    for (number, at) in &scene.boxes {
        let node = &sketch.boxes[*number];
        let what = [("data-node", &*node.path), ("data-kind", &*node.kind)];
        svg.group_of("node", &what, |svg| paint_box(svg, node, *at));
    }
    for (number, routes) in &wires {
        paint_words(&mut svg, &sketch.wires[*number], routes);
    }
    svg.raw(format_args!("</g>"));
    svg.finish(size, title, style)
}

/// Width and height of the whole drawing.
pub(super) fn size(sketch: &Sketch, scene: &Scene) -> (f64, f64) {
    ((scene.size.0).max(legend_width(sketch)) + 2.0 * MARGIN, scene.size.1 + TOP + MARGIN)
}

const SHAPES: &str = ".grp{stroke-dasharray:5 4;shape-rendering:auto}.body{stroke-width:2}.edge{stroke-width:1.2}\
.wire{fill:none;stroke-width:1.4}.thick{stroke-width:2.8}.touch{stroke-width:2;stroke-dasharray:1 5;stroke-linecap:round}\
.wire:hover{stroke-width:4}.node:hover .box{stroke-width:3}.region{fill:none;stroke-width:26;stroke-linecap:round;stroke-linejoin:round}";

/// The parts of every wire, ordered from its start to its end.
fn whole_wires(scene: &Scene) -> BTreeMap<usize, Vec<&Route>> {
    let mut wires: BTreeMap<usize, Vec<&Route>> = BTreeMap::new();
    for (number, route) in &scene.routes {
        wires.entry(*number).or_default().push(route);
    }
    for parts in wires.values_mut() {
        let near = |a: (f64, f64), b: (f64, f64)| (a.0 - b.0).abs() + (a.1 - b.1).abs() < 0.01;
        let start = |route: &Route| route.points()[0];
        let end = |route: &Route| route.points()[route.points().len() - 1];
        let first = parts.iter().position(|part| !parts.iter().any(|other| near(end(other), start(part))));
        parts.swap(0, first.unwrap_or(0));
        for i in 1..parts.len() {
            let next = (i..parts.len()).find(|j| near(end(parts[i - 1]), start(parts[*j])));
            parts.swap(i, next.unwrap_or(i));
        }
    }
    wires
}

fn legend_width(sketch: &Sketch) -> f64 {
    sketch.clocks.iter().map(legend_entry).sum()
}

fn legend_entry((name, rate): &(String, String)) -> f64 {
    text_width(name, 10.0) + text_width(rate, 10.0) + 50.0
}

fn paint_legend(svg: &mut Svg, sketch: &Sketch) {
    let mut x = MARGIN;
    for (i, clock) in sketch.clocks.iter().enumerate() {
        let swatch = Rect { x, y: 34.0, width: 20.0, height: 12.0 };
        let ink = Ink::number(i).class();
        svg.rect(&format!("t{ink} s{ink} edge"), swatch, 4.0);
        svg.text("small ink", (x + 26.0, 43.5), Anchor::Start, &clock.0);
        let rate_at = x + 32.0 + text_width(&clock.0, 10.0);
        svg.text("small soft", (rate_at, 43.5), Anchor::Start, &clock.1);
        x += legend_entry(clock);
    }
}

/// Regions of clocks: under every node, and along the wires that stay on one clock.
fn paint_regions(svg: &mut Svg, sketch: &Sketch, scene: &Scene, wires: &BTreeMap<usize, Vec<&Route>>) {
    for clock in 0..sketch.clocks.len() {
        let on = |number: usize| sketch.boxes[number].clock == Some(clock);
        let ink = Ink::number(clock).class();
        for (number, routes) in wires {
            let wire = &sketch.wires[*number];
            // A long wire would be a ribbon across the picture.
            let short = matches!(routes[..], [Route::Forward(points)] if points.len() == 4);
            if on(wire.from.0) && on(wire.to.0) && short {
                svg.path(&format!("region w{ink}"), &course(routes));
            }
        }
        for (_, at) in scene.boxes.iter().filter(|(number, _)| on(*number)) {
            svg.rect(&format!("t{ink}"), at.inflated(9.0), 16.0);
        }
    }
}

fn paint_wire(svg: &mut Svg, wire: &WireLine, routes: &[&Route]) {
    let class = match wire.stroke {
        Stroke::Thin => "wire",
        Stroke::Thick => "wire thick",
        Stroke::Touch => "wire touch",
    };
    svg.path_of(class, &[("data-port", &wire.port)], &course(routes), &wire.about);
}

fn course(routes: &[&Route]) -> Path {
    let mut path = Path::default();
    for (i, route) in routes.iter().enumerate() {
        if i == 0 {
            path.move_to(route.points()[0]);
        }
        match route {
            Route::Forward(points) => smooth(&mut path, points),
            Route::Around(points) => rounded(&mut path, points),
        }
    }
    path
}

/// Curves that start and end horizontally.
fn smooth(path: &mut Path, points: &[(f64, f64)]) {
    for pair in points.windows(2) {
        let [a, b] = [pair[0], pair[1]];
        if a == b {
            continue;
        }
        if (a.1 - b.1).abs() < 0.5 {
            path.line_to(b);
        } else {
            let reach = (b.0 - a.0) * 0.5;
            path.cubic_to((a.0 + reach, a.1), (b.0 - reach, b.1), b);
        }
    }
}

/// Straight segments with rounded corners.
fn rounded(path: &mut Path, points: &[(f64, f64)]) {
    let toward = |a: (f64, f64), b: (f64, f64), most: f64| {
        let (dx, dy) = (b.0 - a.0, b.1 - a.1);
        let length = dx.hypot(dy);
        let part = if length > 0.0 { (most / length).min(0.5) } else { 0.0 };
        (a.0 + dx * part, a.1 + dy * part)
    };
    for corner in points.windows(3) {
        let (before, after) = (toward(corner[1], corner[0], 9.0), toward(corner[1], corner[2], 9.0));
        path.line_to(before);
        path.cubic_to(corner[1], corner[1], after);
    }
    if let Some(last) = points.last() {
        path.line_to(*last);
    }
}

fn paint_box(svg: &mut Svg, node: &NodeBox, at: Rect) {
    if !node.doc.is_empty() {
        svg.tooltip(&format!("{} \u{2013} {}: {}", node.path, node.kind, node.doc));
    }
    let ink = node.clock.map_or(Ink::Grey, Ink::number).class();
    match node.role {
        Role::Process => svg.rect(&format!("box s{ink} edge"), at, 6.0),
        Role::Body => {
            svg.rect(&format!("t6 s{ink} body"), at, 16.0);
            svg.rect(&format!("box s{ink} edge"), at.inflated(-4.0), 12.0);
        }
        Role::Source => svg.path(&format!("box s{ink} edge"), &tag(at, true)),
        Role::Actuator => svg.path(&format!("box s{ink} edge"), &tag(at, false)),
        Role::File => svg.path(&format!("box s{ink} edge"), &sheet(at)),
    }
    let middle = at.x + at.width / 2.0;
    svg.text(
        "ink strong",
        (middle, at.y + if node.is_name { 17.0 } else { 16.0 }),
        Anchor::Middle,
        &node.name,
    );
    if node.is_name {
        return;
    }
    svg.text("small soft", (middle, at.y + 29.0), Anchor::Middle, &node.kind);
    if !(node.inputs.is_empty() && node.outputs.is_empty()) {
        let y = at.y + HEADER;
        svg.line("grid", (at.x + 8.0, y), (at.right() - 8.0, y));
    }
    for (i, port) in node.inputs.iter().enumerate() {
        let y = at.y + port_height(node, i);
        let (dot, word) = if port.connected { ("soft", "small soft") } else { ("box frame", "small faint") };
        paint_port(svg, node, ("data-input", &port.name), dot, (at.x, y));
        svg.text(word, (at.x + 9.0, y + 3.5), Anchor::Start, &port.name);
    }
    for (i, port) in node.outputs.iter().enumerate() {
        let y = at.y + port_height(node, i);
        paint_port(svg, node, ("data-output", &port.name), "soft", (at.right(), y));
        svg.text("small soft", (at.right() - 9.0, y + 3.5), Anchor::End, &port.name);
    }
    let top = at.y + settings_top(node);
    if !node.settings.is_empty() {
        svg.line("grid", (at.x + 8.0, top - 1.0), (at.right() - 8.0, top - 1.0));
    }
    for (i, line) in node.settings.iter().enumerate() {
        let y = top + DIVIDER + SETTING * i as f64 + 4.0;
        svg.text("tiny soft", (at.x + 9.0, y), Anchor::Start, line);
    }
}

/// The dot of a port, which a page can find by the names of node and port; a body has none that a graph could connect.
fn paint_port(svg: &mut Svg, node: &NodeBox, (what, name): (&str, &str), dot: &str, at: (f64, f64)) {
    let port = format!("{}.{name}", node.path);
    let what: &[(&str, &str)] = if node.role == Role::Body { &[] } else { &[(what, &port)] };
    svg.group_of("port", what, |svg| svg.circle(dot, at, 2.6));
}

/// A box with a point: sources point in from the left, actuators out to the right.
fn tag(at: Rect, source: bool) -> Path {
    let depth = 9.0;
    let header = HEADER.min(at.height);
    let middle = at.y + header / 2.0;
    let (left, right) = (at.x, at.right());
    let mut path = Path::default();
    if source {
        path.move_to((right, at.y));
        path.line_to((right, at.bottom()));
        path.line_to((left, at.bottom()));
        path.line_to((left, at.y + header));
        path.line_to((left + depth, middle));
        path.line_to((left, at.y));
    } else {
        path.move_to((left, at.y));
        path.line_to((left, at.bottom()));
        path.line_to((right, at.bottom()));
        path.line_to((right, at.y + header));
        path.line_to((right + depth, middle));
        path.line_to((right, at.y));
    }
    path.close();
    path
}

/// A sheet of paper with a folded corner.
fn sheet(at: Rect) -> Path {
    let fold = 11.0;
    let (right, bottom) = (at.right(), at.bottom());
    let mut path = Path::through(&[
        (right - fold, at.y),
        (at.x, at.y),
        (at.x, bottom),
        (right, bottom),
        (right, at.y + fold),
        (right - fold, at.y),
        (right - fold, at.y + fold),
        (right, at.y + fold),
    ]);
    path.move_to((right, at.y + fold));
    path
}

/// Labels of a wire: the unit at its start, the bridge at its end.
fn paint_words(svg: &mut Svg, wire: &WireLine, routes: &[&Route]) {
    let (Some(first), Some(last)) = (routes.first(), routes.last()) else {
        return;
    };
    let start = first.points()[0];
    let end = last.points()[last.points().len() - 1];
    if !wire.unit.is_empty() {
        svg.text("tiny soft halo", (start.0 + 6.0, start.1 - 4.0), Anchor::Start, &wire.unit);
    }
    if !wire.bridge.is_empty() {
        let width = text_width(&wire.bridge, 9.0) + 10.0;
        let pill = Rect { x: end.0 - width - 7.0, y: end.1 - 7.0, width, height: 14.0 };
        svg.rect("box frame", pill, 7.0);
        svg.text("tiny soft", (pill.x + width / 2.0, end.1 + 3.2), Anchor::Middle, &wire.bridge);
    }
}
