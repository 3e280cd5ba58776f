use super::sketch::{Port, Stroke, WireLine};
use super::*;
use haptograph_engine::document::Document;
use haptograph_engine::graph::{CheckOptions, check};

/// Parses a sketch from lines like `name: Kind @clock in,in -> out,out` and wires `a.out b.in [bridge]`.
fn sketch(clocks: &[&str], nodes: &[&str], wires: &[&str]) -> Sketch {
    let clocks = clocks.iter().map(|c| c.split_once(' ').unwrap());
    let mut sketch =
        Sketch { clocks: clocks.map(|(a, b)| (a.into(), b.into())).collect(), ..Sketch::default() };
    for line in nodes {
        let (head, ports) = line.split_once('|').unwrap();
        let [path, kind, clock, role] = head.split_whitespace().collect::<Vec<_>>()[..] else {
            panic!("{line}")
        };
        let (inputs, outputs) = ports.split_once("->").unwrap();
        let list = |text: &str| {
            text.split_whitespace()
                .map(|name| Port { name: name.into(), connected: true })
                .collect::<Vec<_>>()
        };
        sketch.boxes.push(NodeBox {
            path: path.into(),
            name: path.rsplit('/').next().unwrap().into(),
            kind: kind.into(),
            role: match role {
                "source" => Role::Source,
                "actuator" => Role::Actuator,
                "file" => Role::File,
                "body" => Role::Body,
                _ => Role::Process,
            },
            clock: sketch.clocks.iter().position(|(name, _)| name == clock),
            inputs: list(inputs),
            outputs: list(outputs),
            settings: Vec::new(),
            doc: String::new(),
            is_name: false,
        });
    }
    for line in wires {
        let words: Vec<&str> = line.split_whitespace().collect();
        let end = |text: &str, input: bool| {
            let (path, port) = text.rsplit_once('.').unwrap();
            let node = sketch.boxes.iter().position(|b| b.path == path).unwrap_or_else(|| panic!("{line}"));
            let ports = if input { &sketch.boxes[node].inputs } else { &sketch.boxes[node].outputs };
            (node, ports.iter().position(|p| p.name == port).unwrap_or_else(|| panic!("{line}")))
        };
        let bridge = words.get(2).copied().unwrap_or("-");
        sketch.wires.push(WireLine {
            from: end(words[0], false),
            to: end(words[1], true),
            bridge: if matches!(bridge, "-" | "touch" | "loop") { String::new() } else { bridge.into() },
            unit: words.get(3).copied().unwrap_or("").into(),
            port: String::new(),
            stroke: if matches!(bridge, "touch" | "loop") { Stroke::Touch } else { Stroke::Thin },
            closes_loop: matches!(bridge, "loop" | "delay"),
            about: String::new(),
        });
    }
    sketch
}

fn texturepad() -> Sketch {
    sketch(
        &["audio 48 kHz", "synth 10 kHz", "control 240 Hz", "tablet 125 Hz"],
        &[
            "pen SimulatedTablet tablet body | -> stylus",
            "stylus Tablet tablet source | pen -> position force",
            "speed SpeedEstimator tablet - | position -> speed",
            "texture/locate Locate control - | speed force -> weights",
            "texture/model Interpolate control - | weights -> coefficients",
            "texture/noise Noise synth - | -> output",
            "texture/filter SynthesisFilter synth - | excitation coefficients -> acceleration",
            "drive DynamicCompensator synth - | acceleration -> current",
            "out ActuatorSink audio actuator | current -> delivered haptuator",
            "haptuator SimulatedHaptuator audio body | out -> felt",
            "accelerometer Accelerometer audio source | haptuator -> acceleration",
            "wav WavSink - file | input felt ->",
        ],
        &[
            "pen.stylus stylus.pen touch",
            "stylus.position speed.position - m×3",
            "speed.speed texture/locate.speed hold m/s",
            "stylus.force texture/locate.force hold N",
            "texture/locate.weights texture/model.weights - weights",
            "texture/model.coefficients texture/filter.coefficients hold coefficients",
            "texture/noise.output texture/filter.excitation",
            "texture/filter.acceleration drive.acceleration - m/s²",
            "texture/filter.acceleration wav.input",
            "drive.current out.current resample A",
            "out.haptuator haptuator.out touch",
            "haptuator.felt accelerometer.haptuator touch",
            "accelerometer.acceleration wav.felt - m/s²",
        ],
    )
}

fn arm() -> Sketch {
    sketch(
        &["servo 1 kHz", "synth 10 kHz", "audio 48 kHz"],
        &[
            "arm SimulatedArm servo body | force -> position",
            "hip ArmPosition servo source | arm -> position velocity",
            "contact Sphere servo - | position -> contact",
            "spring Hooke servo - | contact -> force magnitude",
            "slide/tangent Tangent servo - | contact velocity -> velocity speed",
            "slide/dahl DahlFriction servo - | velocity load -> force",
            "slide/gain Gain servo - | input -> output",
            "tap/onset Onset servo - | contact velocity -> event",
            "tap/transient TapTransient servo - | event contact -> force",
            "texture/locate Locate servo - | speed force -> weights",
            "texture/model Interpolate servo - | weights -> coefficients",
            "texture/noise Noise synth - | -> output",
            "texture/filter SynthesisFilter synth - | excitation coefficients -> acceleration",
            "texture/scale Gain synth - | input -> output",
            "texture/direction Perpendicular servo - | contact friction -> direction",
            "sum Add servo - | inputs inputs2 inputs3 inputs4 -> output",
            "warning Threshold servo - | input -> event",
            "quadrant Quadrant servo - | position -> event",
            "limit Clamp servo - | input -> output",
            "motors ForceSink servo actuator | force -> delivered arm",
            "buzz ActuatorSink audio actuator | current -> delivered haptuator",
            "haptuator SimulatedHaptuator audio body | buzz -> ",
            "felt WavSink - file | input ->",
            "trace CsvSink - file | position contact force event ->",
            "leak LeakyIntegrator servo - | input feedback -> output",
            "compensator Compensator synth - | acceleration -> current",
            "meter Meter servo - | input -> rms",
            "slow Lowpass servo - | input -> output",
            "bias Constant servo - | -> output",
            "ramp Ramp servo - | -> output",
        ],
        &[
            "arm.position hip.arm touch",
            "hip.position contact.position - m×3",
            "contact.contact spring.contact - contact",
            "contact.contact slide/tangent.contact",
            "hip.velocity slide/tangent.velocity - m/s×3",
            "slide/tangent.velocity slide/dahl.velocity - m/s×3",
            "spring.magnitude slide/dahl.load - N",
            "slide/dahl.force slide/gain.input - N×3",
            "contact.contact tap/onset.contact",
            "hip.velocity tap/onset.velocity",
            "tap/onset.event tap/transient.event - event",
            "contact.contact tap/transient.contact",
            "slide/tangent.speed texture/locate.speed - m/s",
            "spring.magnitude texture/locate.force",
            "texture/locate.weights texture/model.weights - weights",
            "texture/model.coefficients texture/filter.coefficients hold coefficients",
            "texture/noise.output texture/filter.excitation",
            "texture/filter.acceleration texture/scale.input - m/s²",
            "contact.contact texture/direction.contact",
            "slide/dahl.force texture/direction.friction",
            "spring.force sum.inputs - N×3",
            "slide/gain.output sum.inputs2 - N×3",
            "tap/transient.force sum.inputs3 - N×3",
            "bias.output sum.inputs4 - N×3",
            "spring.magnitude warning.input",
            "hip.position quadrant.position",
            "sum.output limit.input - N×3",
            "limit.output motors.force - N×3",
            "motors.arm arm.force loop",
            "texture/scale.output compensator.acceleration - m/s²",
            "compensator.current buzz.current resample A",
            "buzz.haptuator haptuator.buzz touch",
            "texture/scale.output felt.input",
            "hip.position trace.position",
            "contact.contact trace.contact",
            "motors.delivered trace.force - N×3",
            "warning.event trace.event - event",
            "spring.magnitude meter.input",
            "meter.rms slow.input - N",
            "slow.output leak.input - N",
            "leak.output leak.feedback delay N",
        ],
    )
}

#[test]
fn no_boxes_overlap_and_groups_hold_their_own() {
    for sketch in [texturepad(), arm()] {
        let all: Vec<usize> = (0..sketch.boxes.len()).collect();
        let scene = arrange(&sketch, &all, "", WIDEST);
        assert_eq!(scene.boxes.len(), sketch.boxes.len());
        for (i, (a, ra)) in scene.boxes.iter().enumerate() {
            for (b, rb) in &scene.boxes[..i] {
                let apart =
                    ra.right() <= rb.x || rb.right() <= ra.x || ra.bottom() <= rb.y || rb.bottom() <= ra.y;
                assert!(apart, "{} and {}", sketch.boxes[*a].path, sketch.boxes[*b].path);
            }
            for (group, frame) in &scene.groups {
                let inside = ra.x >= frame.x
                    && ra.right() <= frame.right()
                    && ra.y >= frame.y
                    && ra.bottom() <= frame.bottom();
                assert_eq!(
                    inside,
                    sketch.boxes[*a].path.starts_with(group),
                    "{} {group}",
                    sketch.boxes[*a].path
                );
            }
        }
    }
}

#[test]
fn every_wire_is_drawn_from_its_output_to_its_input() {
    for sketch in [texturepad(), arm()] {
        let all: Vec<usize> = (0..sketch.boxes.len()).collect();
        let scene = arrange(&sketch, &all, "", WIDEST);
        let place = |node: usize| scene.boxes.iter().find(|(number, _)| *number == node).unwrap().1;
        for (number, wire) in sketch.wires.iter().enumerate() {
            let parts: Vec<&[(f64, f64)]> =
                scene.routes.iter().filter(|(n, _)| *n == number).map(|(_, route)| route.points()).collect();
            let (from, to) = (place(wire.from.0), place(wire.to.0));
            let start = (from.right(), from.y + port_height(&sketch.boxes[wire.from.0], wire.from.1));
            let end = (to.x, to.y + port_height(&sketch.boxes[wire.to.0], wire.to.1));
            let near = |a: (f64, f64), b: (f64, f64)| (a.0 - b.0).abs() + (a.1 - b.1).abs() < 1e-6;
            let mut at = start;
            for _ in &parts {
                let part = parts
                    .iter()
                    .find(|p| near(p[0], at))
                    .unwrap_or_else(|| panic!("{wire:?} is torn at {at:?}"));
                at = part[part.len() - 1];
            }
            assert!(near(at, end), "{wire:?}");
        }
    }
}

#[test]
fn an_overview_of_each_shipped_graph_has_its_nodes_and_can_be_read_on_a_screen() {
    for (name, sketch) in shipped() {
        let (picture, size) = overview(sketch.overview(false), "");
        let scale = (SCREEN.0 / size.0).min(SCREEN.1 / size.1);
        assert!(12.0 * scale >= SMALLEST, "{name}: names of {:.1} px", 12.0 * scale);
        for node in sketch.boxes.iter().filter(|node| node.role != Role::File) {
            assert!(picture.contains(&format!("data-node=\"{}\"", node.path)), "{name}: {}", node.path);
        }
    }
    // A template is a box, whose wires are bundles that name all of their ports.
    let collapsed = texturepad().overview(true);
    let template = collapsed.boxes.iter().position(|node| node.path == "texture").expect("a box");
    assert!(collapsed.boxes.iter().all(|node| !node.path.contains('/')));
    let wires: Vec<_> = collapsed.wires.iter().map(|wire| (wire.from.0, wire.to.0)).collect();
    let distinct: std::collections::BTreeSet<_> = wires.iter().collect();
    assert!(wires.iter().any(|wire| wire.1 == template) && wires.len() == distinct.len());
}

#[test]
fn a_graph_that_nobody_could_read_is_a_line_of_text() {
    let lines: Vec<String> = (0..=MAX_BOXES).map(|n| format!("n{n} Gain audio - | in -> out")).collect();
    let lines: Vec<&str> = lines.iter().map(String::as_str).collect();
    let (largest, larger) =
        (sketch(&["audio 48000"], &lines[1..], &[]), sketch(&["audio 48000"], &lines, &[]));
    assert!(why_too_large(&largest).is_none() && why_too_large(&larger).is_some());
    let picture = draw(&larger, "", "");
    assert!(picture.contains(&why_too_large(&larger).unwrap()) && picture.len() < 1000);
    assert!(draw(&largest, "", "").len() > 10_000);
}

#[test]
fn the_picture_is_well_formed() {
    for (name, sketch) in [("texturepad", texturepad()), ("arm", arm())] {
        let text = draw(&sketch, "A <drawing>", &theme::css());
        roxmltree::Document::parse(&text).unwrap();
        if let Some(folder) = std::env::var_os("HAPTOGRAPH_PICTURES") {
            std::fs::write(std::path::Path::new(&folder).join(format!("{name}.svg")), text).unwrap();
        }
    }
}

/// The sketches of all graphs that ship.
fn shipped() -> Vec<(String, Sketch)> {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs");
    let files = ["", "cookbook"].map(|folder| std::fs::read_dir(root.join(folder)).unwrap());
    let files = files.into_iter().flatten().map(|entry| entry.unwrap().path());
    let graphs = files.filter(|path| path.extension().is_some_and(|end| end == "ron"));
    let sketch = |path: std::path::PathBuf| {
        let document = Document::load(&path, &Default::default()).unwrap_or_else(|wrong| panic!("{wrong}"));
        let graph = check(&document, &haptograph_nodes::registry(), &CheckOptions::default());
        let graph = graph.unwrap_or_else(|wrong| panic!("{wrong}"));
        (path.display().to_string(), Sketch::of(&graph))
    };
    graphs.map(sketch).collect()
}

/// Points along a part of a wire, as it is painted.
fn along(route: &Route) -> Vec<(f64, f64)> {
    let between = |pair: &[(f64, f64)]| {
        let [a, b] = [pair[0], pair[1]];
        let smooth = matches!(route, Route::Forward(_));
        (0..=200).map(move |k| {
            let t = f64::from(k) / 200.0;
            // A cubic that begins and ends horizontally, and whose reach is half of its width.
            let across = if smooth { 1.5 * t - 1.5 * t * t + t * t * t } else { t };
            let down = if smooth { t * t * (3.0 - 2.0 * t) } else { t };
            (a.0 + (b.0 - a.0) * across, a.1 + (b.1 - a.1) * down)
        })
    };
    route.points().windows(2).flat_map(|pair| between(pair).collect::<Vec<_>>()).collect()
}

fn is_in(rect: &Rect, point: (f64, f64)) -> bool {
    (rect.x..rect.right()).contains(&point.0) && (rect.y..rect.bottom()).contains(&point.1)
}

#[test]
fn no_wire_crosses_a_label_or_a_box() {
    let made = [("texturepad", texturepad()), ("arm", arm())].map(|(name, sketch)| (name.to_owned(), sketch));
    let overviews = shipped().into_iter().flat_map(|(name, sketch)| {
        [false, true].map(|collapse| (format!("{name}, names"), sketch.overview(collapse)))
    });
    for (name, sketch) in made.into_iter().chain(shipped()).chain(overviews) {
        let all: Vec<usize> = (0..sketch.boxes.len()).collect();
        let scene = arrange(&sketch, &all, "", WIDEST);
        let place = |node: usize| scene.boxes.iter().find(|(number, _)| *number == node).unwrap().1;
        let wires: Vec<(usize, Vec<(f64, f64)>)> =
            { scene.routes.iter() }.map(|(wire, route)| (*wire, along(route))).collect();
        let crossing = |rect: &Rect, own: Option<usize>| {
            let mut others = wires.iter().filter(|(wire, _)| Some(*wire) != own);
            others.find(|(_, points)| points.iter().any(|point| is_in(rect, *point)))
        };
        for (number, at) in &scene.boxes {
            let wire = crossing(&at.inflated(-2.0), None).map(|(wire, _)| &sketch.wires[*wire].port);
            assert_eq!(wire, None, "{name}: through {}", sketch.boxes[*number].path);
        }
        for (number, wire) in sketch.wires.iter().enumerate() {
            let (from, to) = (place(wire.from.0), place(wire.to.0));
            let (start, end) = (
                from.y + port_height(&sketch.boxes[wire.from.0], wire.from.1),
                to.y + port_height(&sketch.boxes[wire.to.0], wire.to.1),
            );
            // The unit stands above the start of the wire, in letters of 9 pixels; its own wire stays below it.
            let unit = Rect {
                x: from.right() + 6.0,
                y: start - 10.5,
                width: text_width(&wire.unit, 9.0),
                height: 8.0,
            };
            let found = crossing(&unit, None).filter(|_| !wire.unit.is_empty());
            assert_eq!(found.map(|(other, _)| &sketch.wires[*other].port), None, "{name}: {wire:?}");
            let width = text_width(&wire.bridge, 9.0) + 10.0;
            let bridge = Rect { x: to.x - width - 7.0, y: end - 7.0, width, height: 14.0 };
            let found = crossing(&bridge, Some(number)).filter(|_| !wire.bridge.is_empty());
            assert_eq!(found.map(|(other, _)| &sketch.wires[*other].port), None, "{name}: {wire:?}");
        }
    }
}

/// Two nodes, a ring between two clocks, and names with whatever a label could trip over.
fn awkward() -> Sketch {
    let mut sketch = sketch(
        &["audio 48 kHz", "servo 1 kHz"],
        &["tip Noise servo - | -> output", "coil ActuatorSink audio body | a{b}|c -> "],
        &["tip.output coil.a{b}|c - m/s²"],
    );
    sketch.wires[0].bridge = "ring 5 ms".to_owned();
    sketch.clocks[1].0 = r#"ser"vo]"#.to_owned();
    sketch.boxes[0].path = "größe <\"a\"> [#1; c\\".to_owned();
    sketch.boxes[1].path = "pair/`{x|y}` & 触覚".to_owned();
    sketch
}

#[test]
fn dot_escapes_names_and_shows_clocks_ports_and_rings() {
    let wanted = r#"digraph {
  label="it's \"so\""; labelloc=t; rankdir=LR; fontname="sans-serif";
  node [shape=record, fontname="sans-serif", fontsize=11];
  edge [fontname="sans-serif", fontsize=9];
  subgraph cluster_0 {
    label="audio, 48 kHz"; style=rounded; color=gray;
    n1 [label="pair/`\{x\|y\}` &amp; 触覚\nActuatorSink|{{<i0> a\{b\}\|c}}", style=bold];
  }
  subgraph cluster_1 {
    label="ser\"vo], 1 kHz"; style=rounded; color=gray;
    n0 [label="größe \<\"a\"\> [#1; c\\\nNoise|{{<o0> output}}"];
  }
  n0:o0:e -> n1:i0:w [label="m/s²\nring 5 ms"];
}
"#;
    assert_eq!(text::dot(&awkward(), "it's \"so\""), wanted);
}

#[test]
fn mermaid_escapes_names_and_shows_clocks_ports_and_rings() {
    let wanted = "---
title: 'it''s \"so\"'
---
flowchart LR
  subgraph c0[\"audio, 48 kHz\"]
    n1([\"pair/#96;#123;x#124;y#125;#96; #38; 触覚<br>ActuatorSink\"])
  end
  subgraph c1[\"ser#34;vo#93;, 1 kHz\"]
    n0[\"größe #60;#34;a#34;#62; #91;#35;1#59; c#92;<br>Noise\"]
  end
  n0 -->|\"output → a#123;b#125;#124;c<br>m/s², ring 5 ms\"| n1
";
    assert_eq!(text::mermaid(&awkward(), "it's \"so\""), wanted);
}

#[test]
fn both_texts_hold_each_node_and_each_wire_of_the_shipped_graphs() {
    for (name, sketch) in shipped() {
        let dot = text::dot(&sketch, &name);
        let mermaid = text::mermaid(&sketch, &name);
        for node in 0..sketch.boxes.len() {
            assert_eq!(dot.matches(&format!(" n{node} [")).count(), 1, "{name}");
        }
        assert_eq!(dot.matches(" -> n").count(), sketch.wires.len(), "{name}");
        assert_eq!(mermaid.matches("|\"").count(), sketch.wires.len(), "{name}");
        assert_eq!(dot.matches("subgraph").count(), sketch.clocks.len(), "{name}");
        assert_eq!(mermaid.matches("subgraph").count(), sketch.clocks.len(), "{name}");
    }
}
