//! Drawing of a graph, as SVG: data flow from left to right, clocks are coloured regions, wires carry units and
//! bridges, templates are frames, and loops through bodies run below. Graphviz and Mermaid get text and lay it out themselves.

mod paint;
mod sketch;
mod text;

use super::layout::{Block, Layout, Link, Route, Side, in_rows};
use super::svg::{Rect, escape, text_width};
use super::theme;
use haptograph_engine::graph::Graph;
use sketch::{NodeBox, Role, Sketch};

/// Most boxes and wires of a drawing: nobody can read more, and the time to place them rises with their square.
const MAX_BOXES: usize = 500;
const MAX_WIRES: usize = 1000;

/// Why `graph` is not drawn, if it has too many nodes or connections to be legible.
pub fn too_large(graph: &Graph) -> Option<String> {
    why_too_large(&Sketch::of(graph))
}

fn why_too_large(sketch: &Sketch) -> Option<String> {
    let (boxes, wires) = (sketch.boxes.len(), sketch.wires.len());
    (boxes > MAX_BOXES || wires > MAX_WIRES).then(|| {
        format!(
            "{boxes} boxes and {wires} connections are too many for a drawing; at most {MAX_BOXES} and {MAX_WIRES} are drawn"
        )
    })
}

/// Draws `graph` as a standalone SVG file; one that is [`too_large`] is a line that says so.
pub fn standalone_svg(graph: &Graph, title: &str) -> String {
    draw(&Sketch::of(graph), title, &theme::css())
}

/// Draws `graph` so that all of it can be read on a screen: nodes by their names, without ports, settings and files, with one wire from a node
/// to another. Templates are boxes where names would become too small otherwise.
pub fn overview_svg(graph: &Graph, title: &str) -> String {
    let sketch = Sketch::of(graph);
    let (names, size) = overview(sketch.overview(false), title);
    let least = SMALLEST / 12.0;
    if size.0 * least <= SCREEN.0 && size.1 * least <= SCREEN.1 {
        return names;
    }
    overview(sketch.overview(true), title).0
}

/// Width and height of a browser's window of 1440 to 900 pixels, without what surrounds a drawing.
const SCREEN: (f64, f64) = (1400.0, 720.0);
/// Height of the smallest names, pixels.
const SMALLEST: f64 = 9.0;
/// Widths of the rows of an overview that are tried, as parts of the screen's.
const WIDTHS: [f64; 8] = [0.4, 0.55, 0.7, 0.85, 1.0, 1.2, 1.5, 2.0];

/// The overview that fills the screen best, and its size.
fn overview(sketch: Sketch, title: &str) -> (String, (f64, f64)) {
    if why_too_large(&sketch).is_some() {
        return (draw(&sketch, title, &theme::css()), (0.0, 0.0));
    }
    let everything: Vec<usize> = (0..sketch.boxes.len()).collect();
    let scenes = WIDTHS.iter().map(|part| arrange(&sketch, &everything, "", part * SCREEN.0));
    let scale = |scene: &Scene| {
        let (width, height) = paint::size(&sketch, scene);
        (SCREEN.0 / width).min(SCREEN.1 / height)
    };
    let best = scenes.max_by(|a, b| scale(a).total_cmp(&scale(b))).unwrap_or_default();
    (paint::paint(&sketch, &best, title, &theme::css()), paint::size(&sketch, &best))
}

/// The drawing of `graph` for a page with the style sheet.
pub(crate) fn svg(graph: &Graph, title: &str) -> String {
    draw(&Sketch::of(graph), title, "")
}

/// `graph` in DOT, the language of Graphviz: `dot -Tpdf`.
pub fn dot(graph: &Graph, title: &str) -> String {
    text::dot(&Sketch::of(graph), title)
}

/// `graph` as a flowchart of Mermaid, which many Markdown pages show.
pub fn mermaid(graph: &Graph, title: &str) -> String {
    text::mermaid(&Sketch::of(graph), title)
}

fn draw(sketch: &Sketch, title: &str, style: &str) -> String {
    if let Some(why) = why_too_large(sketch) {
        let width = text_width(&why, 12.0) + 20.0;
        return format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} 24\" width=\"{width:.0}\" height=\"24\">\
             <text x=\"10\" y=\"16\" font-size=\"12\" font-family=\"sans-serif\">{}</text></svg>\n",
            escape(&why)
        );
    }
    let everything: Vec<usize> = (0..sketch.boxes.len()).collect();
    let scene = arrange(sketch, &everything, "", WIDEST);
    paint::paint(sketch, &scene, title, style)
}

/// Positions of all boxes and wires of a sketch or of one of its groups.
#[derive(Debug, Default)]
struct Scene {
    size: (f64, f64),
    boxes: Vec<(usize, Rect)>,
    groups: Vec<(String, Rect)>,
    /// Parts of wires; a wire that enters a group has several.
    routes: Vec<(usize, Route)>,
    /// Heights at which wires cross the frame, (wire, height), on the left and on the right.
    entering: Vec<(usize, f64)>,
    leaving: Vec<(usize, f64)>,
}

const HEADER: f64 = 36.0;
const PORT: f64 = 16.0;
/// Height of a box that has its name only.
const NAME: f64 = 26.0;
/// Maximum width of a row of boxes, so that it is legible on a page of 840 pixels.
const WIDEST: f64 = 800.0;
/// Heights of a line of settings, and of the divider between ports and settings.
const SETTING: f64 = 12.0;
const DIVIDER: f64 = 6.0;
const FRAME: f64 = 16.0;
const FRAME_TITLE: f64 = 18.0;

/// A child of a group: a node or a nested group.
enum Child {
    Node(usize),
    Group(String, Scene),
}

/// Lays out the boxes `members` of the group with the path `prefix`: nested groups first, each as one block.
fn arrange(sketch: &Sketch, members: &[usize], prefix: &str, widest: f64) -> Scene {
    let mut children: Vec<Child> = Vec::new();
    let mut child_of = vec![None; sketch.boxes.len()];
    for member in members {
        let rest = &sketch.boxes[*member].path[prefix.len()..];
        let group = match rest.split_once('/') {
            Some((group, _)) if sketch.boxes[*member].role != Role::Body => format!("{prefix}{group}/"),
            _ => {
                child_of[*member] = Some(children.len());
                children.push(Child::Node(*member));
                continue;
            }
        };
        if child_of[*member].is_some() {
            continue;
        }
        let inside: Vec<usize> =
            members.iter().copied().filter(|m| sketch.boxes[*m].path.starts_with(&group)).collect();
        inside.iter().for_each(|m| child_of[*m] = Some(children.len()));
        let scene = arrange(sketch, &inside, &group, widest);
        children.push(Child::Group(group, scene));
    }
    let mut blocks: Vec<Block> = children
        .iter()
        .map(|child| {
            let (width, height) = match child {
                Child::Node(node) => box_size(&sketch.boxes[*node]),
                Child::Group(_, scene) => scene.size,
            };
            Block { width, height, side: Side::Free }
        })
        .collect();
    let (links, wires, pins) = connect(sketch, &children, &child_of, &mut blocks);
    let depth = prefix.matches('/').count() as f64;
    let placed = in_rows(&blocks, &links, widest - depth * 4.0 * FRAME);
    collect(sketch, children, placed, &wires, &pins, prefix)
}

/// Turns wires into links between children; a wire to or from the outside gets a pin, a block without size.
/// Returns the links, the wire of each link, and the pins: (block, wire, true on the left).
#[allow(clippy::type_complexity)]
fn connect(
    sketch: &Sketch,
    children: &[Child],
    child_of: &[Option<usize>],
    blocks: &mut Vec<Block>,
) -> (Vec<Link>, Vec<usize>, Vec<(usize, usize, bool)>) {
    let (mut links, mut wires, mut pins) = (Vec::new(), Vec::new(), Vec::new());
    for (number, wire) in sketch.wires.iter().enumerate() {
        let (from, to) = (child_of[wire.from.0], child_of[wire.to.0]);
        if from.is_none() && to.is_none() {
            continue;
        }
        if let (Some(a), Some(b)) = (from, to)
            && a == b
            && matches!(children[a], Child::Group(..))
        {
            continue;
        }
        let mut pin = |left: bool| {
            let side = if left { Side::Left } else { Side::Right };
            blocks.push(Block { width: 0.0, height: 0.0, side });
            pins.push((blocks.len() - 1, number, left));
            (blocks.len() - 1, 0.0)
        };
        let end = |child: Option<usize>, port: f64, crossing: fn(&Scene) -> &[(usize, f64)]| {
            child.map(|child| match &children[child] {
                Child::Node(_) => (child, port),
                Child::Group(_, scene) => {
                    let at = crossing(scene).iter().find(|(wire, _)| *wire == number);
                    (child, at.map_or(0.0, |(_, y)| *y))
                }
            })
        };
        let start = end(from, port_height(&sketch.boxes[wire.from.0], wire.from.1), |scene| &scene.leaving)
            .unwrap_or_else(|| pin(true));
        let finish = end(to, port_height(&sketch.boxes[wire.to.0], wire.to.1), |scene| &scene.entering)
            .unwrap_or_else(|| pin(false));
        // Labels stand at the ends of a wire, not where it crosses a frame.
        let at_node = |child: Option<usize>| child.is_some_and(|c| matches!(children[c], Child::Node(_)));
        let written = |word: &str, room: f64| {
            if word.is_empty() { 0.0 } else { text_width(word, 9.0) + room }
        };
        links.push(Link {
            from: start.0,
            from_y: start.1,
            to: finish.0,
            to_y: finish.1,
            room: (
                if at_node(from) { written(&wire.unit, 4.0) } else { 0.0 },
                if at_node(to) { written(&wire.bridge, 16.0) } else { 0.0 },
            ),
            closes_loop: wire.closes_loop,
        });
        wires.push(number);
    }
    (links, wires, pins)
}

/// Joins the layout of a group and of its children into one scene with a frame.
fn collect(
    sketch: &Sketch,
    children: Vec<Child>,
    placed: Layout,
    wires: &[usize],
    pins: &[(usize, usize, bool)],
    prefix: &str,
) -> Scene {
    let framed = !prefix.is_empty();
    let (pad_x, pad_top, pad_bottom) = if framed { (0.0, FRAME_TITLE + 8.0, FRAME) } else { (0.0, 0.0, 0.0) };
    let move_by = |route: &Route, by: (f64, f64)| {
        let mut route = route.clone();
        route.points_mut().iter_mut().for_each(|p| *p = (p.0 + by.0, p.1 + by.1));
        route
    };
    let mut scene = Scene {
        size: (placed.size.0 + 2.0 * pad_x, placed.size.1 + pad_top + pad_bottom),
        ..Scene::default()
    };
    for (child, corner) in children.into_iter().zip(&placed.corners) {
        let at = (corner.0 + pad_x, corner.1 + pad_top);
        match child {
            Child::Node(node) => {
                let (width, height) = box_size(&sketch.boxes[node]);
                scene.boxes.push((node, Rect { x: at.0, y: at.1, width, height }));
            }
            Child::Group(path, inner) => {
                let moved = |r: Rect| Rect { x: r.x + at.0, y: r.y + at.1, ..r };
                let frame = Rect { x: at.0, y: at.1, width: inner.size.0, height: inner.size.1 };
                scene.groups.push((path, frame));
                scene.groups.extend(inner.groups.into_iter().map(|(path, r)| (path, moved(r))));
                scene.boxes.extend(inner.boxes.into_iter().map(|(node, r)| (node, moved(r))));
                scene.routes.extend(inner.routes.iter().map(|(wire, route)| (*wire, move_by(route, at))));
            }
        }
    }
    let own = placed.routes.iter();
    scene.routes.extend(own.map(|(link, route)| (wires[*link], move_by(route, (pad_x, pad_top)))));
    for (block, wire, left) in pins {
        let crossing = (*wire, placed.corners[*block].1 + pad_top);
        if *left { scene.entering.push(crossing) } else { scene.leaving.push(crossing) }
    }
    // Without pins on a side the frame needs a margin there.
    let slack = |pinned: bool| if framed && !pinned { FRAME } else { 0.0 };
    let left = slack(!scene.entering.is_empty());
    scene.shift(left);
    scene.size.0 += left + slack(!scene.leaving.is_empty());
    scene
}

impl Scene {
    fn shift(&mut self, by: f64) {
        self.boxes.iter_mut().for_each(|(_, r)| r.x += by);
        self.groups.iter_mut().for_each(|(_, r)| r.x += by);
        let points = self.routes.iter_mut().flat_map(|(_, route)| route.points_mut());
        points.for_each(|p| p.0 += by);
    }
}

/// Height of port `i` below the top of its box.
fn port_height(node: &NodeBox, i: usize) -> f64 {
    if node.is_name { NAME / 2.0 } else { HEADER + PORT * (i as f64 + 0.5) + 2.0 }
}

fn box_size(node: &NodeBox) -> (f64, f64) {
    if node.is_name {
        return (text_width(&node.name, 12.0) * 1.04 + 28.0, NAME);
    }
    let words = |ports: &[sketch::Port]| ports.iter().map(|p| text_width(&p.name, 10.0)).fold(0.0, f64::max);
    let ports = words(&node.inputs) + words(&node.outputs) + 44.0;
    let head = text_width(&node.name, 12.0).max(text_width(&node.kind, 10.0)) * 1.04 + 34.0;
    let settings = node.settings.iter().map(|line| text_width(line, 9.0) + 18.0);
    let width = ports.max(head).max(84.0).max(settings.fold(0.0, f64::max));
    (width, settings_top(node) + lines_height(node))
}

/// Height below the ports of a box at which its settings begin.
fn settings_top(node: &NodeBox) -> f64 {
    let rows = node.inputs.len().max(node.outputs.len());
    let bottom = if rows == 0 { 2.0 } else { 8.0 };
    HEADER + PORT * rows as f64 + bottom
}

fn lines_height(node: &NodeBox) -> f64 {
    match node.settings.len() {
        0 => 0.0,
        lines => DIVIDER + SETTING * lines as f64,
    }
}

#[cfg(test)]
mod tests;
