//! A sketch as text for programs that lay graphs out themselves: DOT for Graphviz, Mermaid for pages in Markdown.
//! Nodes have numbers as identifiers, so that names stand in labels only, where any character can be escaped.

use super::sketch::{NodeBox, Role, Sketch, Stroke, WireLine};
use std::fmt::{self, Write as _};

/// Writes the graph language of Graphviz: a box with its ports for each node, a cluster for each clock.
pub(super) fn dot(sketch: &Sketch, title: &str) -> String {
    let mut text = format!(
        "digraph {{\n  label=\"{}\"; labelloc=t; rankdir=LR; fontname=\"sans-serif\";\n  \
         node [shape=record, fontname=\"sans-serif\", fontsize=11];\n  edge [fontname=\"sans-serif\", fontsize=9];\n",
        Dot(title)
    );
    each_clock(sketch, |clock, members| match clock {
        Some((number, name, rate)) => {
            line(&mut text, format_args!("  subgraph cluster_{number} {{"));
            let (name, rate) = (Dot(name), Dot(rate));
            line(&mut text, format_args!("    label=\"{name}, {rate}\"; style=rounded; color=gray;"));
            members.iter().for_each(|node| dot_node(&mut text, sketch, *node, "    "));
            line(&mut text, format_args!("  }}"));
        }
        None => members.iter().for_each(|node| dot_node(&mut text, sketch, *node, "  ")),
    });
    for wire in &sketch.wires {
        let ((from, output), (to, input)) = (wire.from, wire.to);
        let look = match wire.stroke {
            Stroke::Thin => "",
            Stroke::Thick => ", penwidth=2.5",
            Stroke::Touch => ", style=dotted, penwidth=2",
        };
        let backward = if wire.closes_loop { ", constraint=false" } else { "" };
        let (label, bridge) = (Dot(&wire.unit), Dot(&wire.bridge));
        let label = match (wire.unit.is_empty(), wire.bridge.is_empty()) {
            (false, false) => format!("{label}\\n{bridge}"),
            _ => format!("{label}{bridge}"),
        };
        line(
            &mut text,
            format_args!("  n{from}:o{output}:e -> n{to}:i{input}:w [label=\"{label}\"{look}{backward}];"),
        );
    }
    text.push_str("}\n");
    text
}

fn dot_node(text: &mut String, sketch: &Sketch, number: usize, indent: &str) {
    let node = &sketch.boxes[number];
    let ports = |letter: char, ports: &[super::sketch::Port]| {
        let ports: Vec<String> = { ports.iter().enumerate() }
            .map(|(port, p)| format!("<{letter}{port}> {}", Dot(&p.name)))
            .collect();
        format!("{{{}}}", ports.join("|"))
    };
    let sides = [('i', &node.inputs), ('o', &node.outputs)];
    let sides: Vec<String> = { sides.iter().filter(|(_, side)| !side.is_empty()) }
        .map(|(letter, side)| ports(*letter, side))
        .collect();
    let sides = match sides.is_empty() {
        true => String::new(),
        false => format!("|{{{}}}", sides.join("|")),
    };
    let look = match node.role {
        Role::Body => ", style=bold",
        _ => "",
    };
    let (path, kind) = (Dot(&node.path), Dot(&node.kind));
    line(text, format_args!("{indent}n{number} [label=\"{path}\\n{kind}{sides}\"{look}];"));
}

/// Writes a flowchart of Mermaid: a box for each node, a subgraph for each clock, the ports on the wires.
pub(super) fn mermaid(sketch: &Sketch, title: &str) -> String {
    // YAML: in single quotes, only a quote needs care.
    let title = title.replace('\'', "''").replace(|c: char| c.is_control(), " ");
    let mut text = format!("---\ntitle: '{title}'\n---\nflowchart LR\n");
    each_clock(sketch, |clock, members| match clock {
        Some((number, name, rate)) => {
            let (name, rate) = (Mermaid(name), Mermaid(rate));
            line(&mut text, format_args!("  subgraph c{number}[\"{name}, {rate}\"]"));
            members.iter().for_each(|node| mermaid_node(&mut text, *node, &sketch.boxes[*node], "    "));
            line(&mut text, format_args!("  end"));
        }
        None => members.iter().for_each(|node| mermaid_node(&mut text, *node, &sketch.boxes[*node], "  ")),
    });
    for wire in &sketch.wires {
        let arrow = match wire.stroke {
            Stroke::Thin => "-->",
            Stroke::Thick => "==>",
            Stroke::Touch => "-.->",
        };
        let label = mermaid_label(sketch, wire);
        let (from, to) = (wire.from.0, wire.to.0);
        line(&mut text, format_args!("  n{from} {arrow}|\"{label}\"| n{to}"));
    }
    text
}

fn mermaid_node(text: &mut String, number: usize, node: &NodeBox, indent: &str) {
    let (open, close) = match node.role {
        Role::Body => ("([", "])"),
        Role::File => ("[/", "/]"),
        _ => ("[", "]"),
    };
    let (path, kind) = (Mermaid(&node.path), Mermaid(&node.kind));
    line(text, format_args!("{indent}n{number}{open}\"{path}<br>{kind}\"{close}"));
}

/// `acceleration → current<br>m/s², resample`
fn mermaid_label(sketch: &Sketch, wire: &WireLine) -> String {
    let output = &sketch.boxes[wire.from.0].outputs[wire.from.1].name;
    let input = &sketch.boxes[wire.to.0].inputs[wire.to.1].name;
    // The port of a body has the name of the node that it touches; that node's own port has none.
    let ports = match (output.is_empty(), input.is_empty()) {
        (false, false) => format!("{} → {}", Mermaid(output), Mermaid(input)),
        _ => "touch".to_owned(),
    };
    let words = [&wire.unit, &wire.bridge].into_iter().filter(|w| !w.is_empty());
    let words: Vec<String> = words.map(|word| Mermaid(word).to_string()).collect();
    match words.is_empty() {
        true => ports,
        false => format!("{ports}<br>{}", words.join(", ")),
    }
}

/// Calls `write` with each clock (number, name, rate) and its nodes; last, with the nodes that have no clock.
fn each_clock(sketch: &Sketch, mut write: impl FnMut(Option<(usize, &str, &str)>, &[usize])) {
    let members = |clock: Option<usize>| {
        let members = (0..sketch.boxes.len()).filter(|node| sketch.boxes[*node].clock == clock);
        members.collect::<Vec<_>>()
    };
    for (number, (name, rate)) in sketch.clocks.iter().enumerate() {
        write(Some((number, name, rate)), &members(Some(number)));
    }
    write(None, &members(None));
}

fn line(text: &mut String, line: fmt::Arguments<'_>) {
    // Writing to a `String` cannot fail.
    let _ = writeln!(text, "{line}");
}

/// Text inside a quoted label of DOT, records included. Graphviz reads entities such as `&lt;` too.
struct Dot<'a>(&'a str);

impl fmt::Display for Dot<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for c in self.0.chars() {
            match c {
                '"' | '\\' | '{' | '}' | '|' | '<' | '>' => write!(f, "\\{c}")?,
                '&' => f.write_str("&amp;")?,
                c if c.is_control() => f.write_char(' ')?,
                c => f.write_char(c)?,
            }
        }
        Ok(())
    }
}

/// Text inside a quoted label of Mermaid, which knows no escape but entities such as `#35;`. A label is HTML or
/// Markdown where Mermaid sees either, so that all punctuation but the harmless is escaped.
struct Mermaid<'a>(&'a str);

impl fmt::Display for Mermaid<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for c in self.0.chars() {
            match c {
                '/' | '-' | '.' | ',' => f.write_char(c)?,
                c if c.is_ascii_punctuation() => write!(f, "#{};", u32::from(c))?,
                c if c.is_control() => f.write_char(' ')?,
                c => f.write_char(c)?,
            }
        }
        Ok(())
    }
}
