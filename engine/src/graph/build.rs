//! From draft to graph: settings read, processors and devices built.

use super::clocks::Clocks;
use super::devices::{Devices, DraftDevice};
use super::draft::{Context, Draft, DraftNode, Slot};
use super::memory::{self, Memory};
use super::{Bridge, Edge, Graph, GraphDevice, Input, Node, Output, Work, fingerprint, wires};
use crate::device::Device;
use crate::diagnostic::{Diagnostic, SourceId, Sources, Span};
use crate::document::folder;
use crate::document::value::Shape;
use crate::frame::Kind;
use crate::node::{Build, BuildContext, BuildError, FileContext, Flow, KindRule, QuantityRule, Stream};
use crate::settings::{Fields, closest};
use haptograph_signal::files;
use haptograph_signal::noise::stream_seed;
use haptograph_signal::quantity::Quantity;
use petgraph::graph::{DiGraph, NodeIndex};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// Largest block of a plan in driver frames.
const MAX_QUANTUM: u64 = 1024;

/// Built nodes and devices; `None` after a reported error.
pub(super) struct Built {
    works: Vec<Option<Work>>,
    /// Paths in the settings of each node.
    files: Vec<Vec<PathBuf>>,
    devices: Vec<Option<Box<dyn Device>>>,
    simulated: Vec<bool>,
}

/// Reads all settings, and builds every node and device without errors.
pub(super) fn build(
    cx: &mut Context<'_>,
    draft: &Draft,
    clocks: &Clocks,
    devices: Option<&Devices>,
    seed: u64,
) -> Built {
    let declared: &[DraftDevice] = devices.map_or(&[], |devices| &devices.list);
    let simulated = simulated(draft, declared);
    let mut files = Vec::new();
    let mut works = Vec::new();
    let mut memory = Memory::default();
    memory.connections(cx, draft, clocks);
    for node in 0..draft.nodes.len() {
        cx.files.clear();
        works.push(work(
            cx,
            draft,
            clocks,
            declared,
            &simulated,
            &mut memory,
            seed,
            node,
        ));
        files.push(std::mem::take(&mut cx.files));
    }
    refuse_shared_files(cx, draft, &works);
    Built {
        works,
        files,
        devices: declared
            .iter()
            .map(|device| body(cx, clocks, device, seed))
            .collect(),
        simulated,
    }
}

/// Refuses sinks that would write the same file or the note beside another's file.
fn refuse_shared_files(cx: &mut Context<'_>, draft: &Draft, works: &[Option<Work>]) {
    let mut known: HashMap<PathBuf, usize> = HashMap::new();
    for (node, work) in works.iter().enumerate() {
        let Some(Work::File(sink)) = work else { continue };
        let file = sink.file_name();
        let mut note = file.as_os_str().to_owned();
        note.push(".ron");
        for name in [file.to_owned(), note.into()] {
            let Some(first) = known.insert(name, node) else {
                continue;
            };
            let at = |node: usize| {
                let fields = &draft.nodes[node].fields;
                let mut written = fields.remaining().iter();
                let written = written.find(|(name, _)| name.text == "file");
                written.map_or(fields.span, |(_, value)| value.span)
            };
            let (first_path, path) = (&draft.nodes[first].path, &draft.nodes[node].path);
            let message =
                format!("`{first_path}` and `{path}` would write the same file in the run's folder");
            let diagnostic = Diagnostic::error("E0304", at(node), message);
            cx.report(
                diagnostic
                    .also(at(first), "the other")
                    .help("give each sink a file of its own"),
            );
        }
    }
}

/// Which nodes depend on a simulated device, through connections and through bodies.
fn simulated(draft: &Draft, devices: &[DraftDevice]) -> Vec<bool> {
    let mut simulated = vec![false; draft.nodes.len()];
    let readers = draft.readers(|_| true);
    let mut sources: Vec<Vec<usize>> = vec![Vec::new(); devices.len()];
    let mut found = Vec::new();
    for (i, node) in draft.nodes.iter().enumerate() {
        let Some(device) = node.device else { continue };
        sources[device].push(i);
        if devices[device].entry.spec.simulated {
            found.push(i);
        }
    }
    while let Some(node) = found.pop() {
        if std::mem::replace(&mut simulated[node], true) {
            continue;
        }
        found.extend(&readers[node]);
        if let Some(device) = draft.nodes[node].device {
            found.extend(&sources[device]);
        }
    }
    simulated
}

/// Whether a field has an unknown name. Errors of the node could then follow from the missing setting.
fn misread(node: &DraftNode) -> bool {
    let settings = node.entry.settings();
    let mut fields = node.fields.remaining().iter();
    fields.any(|(name, _)| settings.iter().all(|setting| setting.name != name.text))
}

#[expect(clippy::too_many_arguments, reason = "a node depends on all of the graph")]
fn work(
    cx: &mut Context<'_>,
    draft: &Draft,
    clocks: &Clocks,
    devices: &[DraftDevice],
    simulated: &[bool],
    memory: &mut Memory,
    seed: u64,
    node: usize,
) -> Option<Work> {
    let target = &draft.nodes[node];
    let buffers = buffer_bytes(draft, clocks, node);
    if !memory.add(cx, buffers, target.name, &target.path) {
        return None;
    }
    let mut fields = target.fields.clone();
    let places = Places::of(&fields).and_inputs(target);
    let before = cx.diagnostics.len();
    let sound =
        !target.broken && !target.has_broken_input() && !target.fields.has_reported() && !misread(target);
    let work = match target.entry.build {
        Build::Processor(_) | Build::Scripted(_) => {
            let build = target.entry.build;
            let finish = cx.reading(|reading| build.read_processor(&mut fields, reading));
            let context = context(draft, clocks, seed, node).filter(|_| sound);
            match (finish, context) {
                (Some(finish), Some(context)) => {
                    let measured = places.or_report(cx, finish(&context));
                    let fitting =
                        measured.filter(|(bytes, _)| memory.add(cx, *bytes, target.name, &target.path));
                    let advised = fitting.and_then(|(_, finish)| places.or_report(cx, finish(&context)));
                    advised.map(|(processor, advice)| {
                        advice.into_iter().for_each(|doubt| places.warn(cx, doubt));
                        Work::Process(processor)
                    })
                }
                _ => None,
            }
        }
        Build::Actuator(read) => {
            fields.if_missing("limit", Some(no_limit(target)));
            let finish = cx.reading(|reading| read(&mut fields, reading));
            let limit = finish.and_then(|finish| places.or_report(cx, finish(&())));
            let device = target.device.filter(|_| sound);
            let channel = device.and_then(|device| {
                let port = target.entry.spec.inputs.first()?.name;
                let drives = &devices[device].drives;
                drives.iter().position(|channel| channel.name == port)
            });
            match (limit, device, channel) {
                (Some((gain, limit)), Some(device), Some(channel)) => Some(Work::Actuator {
                    device,
                    channel,
                    gain,
                    limit,
                }),
                _ => None,
            }
        }
        Build::File(read) => {
            let finish = cx.reading(|reading| read(&mut fields, reading));
            let context = streams(draft, clocks, simulated, node)
                .filter(|_| sound)
                .map(|streams| FileContext {
                    streams,
                    graph_seed: seed,
                });
            match (finish, context) {
                (Some(finish), Some(context)) => places.or_report(cx, finish(&context)).map(Work::File),
                _ => None,
            }
        }
        Build::Source(read) => {
            let has_settings = cx.reading(|reading| read(&mut fields, reading));
            target
                .device
                .filter(|_| sound && has_settings)
                .and_then(|device| {
                    let senses = &devices[device].senses;
                    let outputs = target.entry.spec.outputs.iter();
                    let channels =
                        outputs.map(|port| senses.iter().position(|channel| channel.name == port.name));
                    let channels = channels.collect::<Option<_>>()?;
                    Some(Work::Source { device, channels })
                })
        }
    };
    cx.reading(|reading| fields.finish(reading));
    explain(cx, before, &target.uses);
    for i in before..cx.diagnostics.len() {
        cx.diagnostics[i] = draft.in_use(node, cx.diagnostics[i].clone(), cx);
    }
    work
}

fn no_limit(node: &DraftNode) -> Diagnostic {
    let kind = node.entry.spec.name;
    let settings = node.entry.settings();
    let limit = settings.iter().find(|setting| setting.name == "limit");
    let expected = limit.map_or_else(|| "...".to_owned(), |setting| setting.expected.clone());
    let expected = expected.trim_start_matches("a structure ");
    Diagnostic::error(
        "E0605",
        node.fields.span,
        format!("actuator sink `{kind}` has no limit"),
    )
    .label("`limit` is missing")
    .help(format!("set the limit of the actuator: `limit: {expected}`"))
    .help("every actuator needs a limit")
}

fn context(draft: &Draft, clocks: &Clocks, seed: u64, node: usize) -> Option<BuildContext> {
    let target = &draft.nodes[node];
    let widths = target.inputs.iter().map(|slot| match &slot.wire {
        Some(wire) => draft.nodes[wire.from].outputs[wire.output].kind.map(Kind::width),
        None => Some(0),
    });
    Some(BuildContext {
        path: target.path.clone(),
        rate: clocks.list[target.clock?].rate,
        max_frames: max_frames(clocks, target.clock?),
        seed: stream_seed(seed, &target.path),
        input_widths: widths.collect::<Option<_>>()?,
    })
}

/// Largest size of the output buffers of a node, without sharing.
fn buffer_bytes(draft: &Draft, clocks: &Clocks, node: usize) -> u64 {
    let target = &draft.nodes[node];
    let widths = target
        .outputs
        .iter()
        .map(|output| output.kind.map_or(1, Kind::width));
    let frames = target.clock.map_or(0, |clock| max_frames(clocks, clock));
    memory::bytes(frames as u64, widths.sum())
}

/// Largest number of frames of a clock in a block of its driver.
fn max_frames(clocks: &Clocks, clock: usize) -> usize {
    let (n, d) = clocks.list[clock].rate.parts();
    let (m, e) = clocks.list[clocks.list[clock].driver].rate.parts();
    let frames = u128::from(MAX_QUANTUM) * u128::from(n) * u128::from(e);
    let frames = frames.div_ceil(u128::from(d) * u128::from(m)) + 1;
    usize::try_from(frames).unwrap_or(usize::MAX)
}

fn streams(draft: &Draft, clocks: &Clocks, simulated: &[bool], node: usize) -> Option<Vec<Stream>> {
    let wires = draft.nodes[node].wires();
    let stream = |(_, wire): (usize, &super::draft::Wire)| {
        let from = &draft.nodes[wire.from];
        let carried = from.outputs[wire.output];
        Some(Stream {
            name: from.output_name(wire.output),
            kind: carried.kind?,
            quantity: carried.quantity?,
            rate: clocks.list[from.clock?].rate,
            simulated: simulated[wire.from],
        })
    };
    wires.map(stream).collect()
}

fn body(cx: &mut Context<'_>, clocks: &Clocks, device: &DraftDevice, seed: u64) -> Option<Box<dyn Device>> {
    let mut fields = device.fields.clone();
    let places = Places::of(&fields);
    let before = cx.diagnostics.len();
    let finish = cx.reading(|reading| {
        let finish = (device.entry.build)(&mut fields, reading);
        fields.finish(reading);
        finish
    });
    let built = match (finish, device.clock.filter(|_| !device.broken)) {
        (Some(finish), Some(clock)) => {
            let context = BuildContext {
                path: device.name.clone(),
                rate: clocks.list[clock].rate,
                max_frames: max_frames(clocks, clock),
                seed: stream_seed(seed, &format!("endpoints/{}", device.name)),
                input_widths: Vec::new(),
            };
            places.or_report(cx, finish(&context)).map(|mut body| {
                body.connect(&device.senses, &device.drives);
                body
            })
        }
        _ => None,
    };
    explain(cx, before, &device.uses);
    built
}

/// Places of the fields of a node or device.
struct Places {
    owner: Span,
    fields: Vec<(String, Span)>,
}

impl Places {
    fn of(fields: &Fields) -> Self {
        let written = fields.remaining().iter();
        Self {
            owner: fields.span,
            fields: written
                .map(|(name, value)| (name.text.clone(), value.span))
                .collect(),
        }
    }

    /// Inputs are where their first connection is.
    fn and_inputs(mut self, node: &DraftNode) -> Self {
        let wires = node.wires().map(|(slot, wire)| {
            let port = &node.entry.spec.inputs[node.inputs[slot].port];
            (port.name.to_owned(), wire.span)
        });
        self.fields.extend(wires);
        self
    }

    fn or_report<T>(&self, cx: &mut Context<'_>, built: Result<T, BuildError>) -> Option<T> {
        match built {
            Ok(built) => Some(built),
            Err(error) => {
                let make = |span, message| Diagnostic::error("E0304", span, message);
                let is_part = error.part.is_some();
                let mut diagnostic = self.finding(&cx.sources, error, make);
                let parameter = || parameter_in_text(cx, &diagnostic).filter(|_| is_part);
                if let Some(help) = not_there(cx, &diagnostic).or_else(parameter) {
                    diagnostic.help = vec![help];
                }
                cx.report(diagnostic);
                None
            }
        }
    }

    fn warn(&self, cx: &mut Context<'_>, doubt: BuildError) {
        let make = |span, message| Diagnostic::warning("W0107", span, message);
        let diagnostic = self.finding(&cx.sources, doubt, make);
        cx.report(diagnostic);
    }

    /// What a node found about itself, at the setting it is about.
    fn finding(
        &self,
        sources: &Sources,
        error: BuildError,
        make: impl FnOnce(Span, String) -> Diagnostic,
    ) -> Diagnostic {
        let written = self
            .fields
            .iter()
            .find(|(name, _)| Some(name.as_str()) == error.field);
        let span = written.map_or(self.owner, |(_, span)| *span);
        let part = error.part.and_then(|part| part_of_text(sources, span, part));
        let mut diagnostic = make(part.unwrap_or(span), error.message);
        if let (Some(field), None) = (error.field, written) {
            diagnostic = diagnostic.label(format!("by the default of `{field}`"));
        }
        if let Some(help) = error.help {
            diagnostic = diagnostic.help(help);
        }
        diagnostic
    }
}

/// What to write where a word of a text, as of a formula, is the name of a parameter.
fn parameter_in_text(cx: &Context<'_>, diagnostic: &Diagnostic) -> Option<String> {
    let span = diagnostic.primary.as_ref()?.span;
    let word = cx.sources.get(span.source)?.text.get(span.start..span.end)?;
    cx.document.parameters().find(|(name, _)| *name == word)?;
    Some(format!(
        "`{word}` is a parameter of the graph, and this text sees its inputs only: multiply by `Gain(gain: \
         Param(\"{word}\"))`, or make it an input, `Constant(value: Param(\"{word}\"))`"
    ))
}

/// Help for a path that leads to no file: a file of a similar name, or the folder from which a path of `--set`, or of a
/// running graph, is resolved.
fn not_there(cx: &Context<'_>, diagnostic: &Diagnostic) -> Option<String> {
    let span = diagnostic.primary.as_ref()?.span;
    let is_given = span.source.0 as usize >= cx.document.sources.iter().count();
    let written = cx.sources.get(span.source)?.text.get(span.start..span.end)?;
    let written = Path::new(written.trim_matches('"'));
    let path = match is_given {
        true => written.to_path_buf(),
        false => folder(&cx.sources, span.source).join(written),
    };
    if !cx.files.contains(&path) || path.exists() {
        return None;
    }
    if let Some(near) = similar_file(&path) {
        let near = written.with_file_name(near);
        return Some(format!("did you mean `{}`?", near.display()));
    }
    let beside = folder(&cx.sources, SourceId::default()).join(written);
    let found = match files::is_file(&beside) {
        true => format!("; there is {}", beside.display()),
        false => String::new(),
    };
    let looked = || format!("a path given by --set is looked for from the folder you are in{found}");
    is_given.then(looked)
}

/// The name of a file in the same folder, of the same kind, that was meant by a path.
fn similar_file(path: &Path) -> Option<String> {
    let folder = match path.parent()? {
        here if here.as_os_str().is_empty() => Path::new("."),
        folder => folder,
    };
    let files = files::list(folder);
    let names = files
        .iter()
        .filter_map(|file| file.file_name().map(PathBuf::from));
    let alike = names.filter(|name| name.extension() == path.extension());
    let mut stems: Vec<String> = alike
        .filter_map(|name| Some(name.file_stem()?.to_str()?.to_owned()))
        .collect();
    stems.sort_unstable();
    let stem = closest(path.file_stem()?.to_str()?, stems.iter().map(String::as_str))?;
    Some(match path.extension().and_then(|extension| extension.to_str()) {
        Some(extension) => format!("{stem}.{extension}"),
        None => stem.to_owned(),
    })
}

/// The place of some characters of a text that is written in plain quotes, without escapes.
pub(super) fn part_of_text(sources: &Sources, span: Span, (first, end): (usize, usize)) -> Option<Span> {
    let written = sources.get(span.source)?.text.get(span.start..span.end)?;
    let text = written.strip_prefix('"')?.strip_suffix('"')?;
    if text.contains('\\') {
        return None;
    }
    let byte = |characters: usize| {
        text.char_indices()
            .nth(characters)
            .map_or(text.len(), |(at, _)| at)
    };
    let (start, end) = (span.start + 1 + byte(first), span.start + 1 + byte(end));
    (start < end).then_some(Span { start, end, ..span })
}

/// Adds the place of use to diagnostics of values of parameters and settings.
fn explain(cx: &mut Context<'_>, from: usize, uses: &[(Span, Span)]) {
    for diagnostic in &mut cx.diagnostics[from..] {
        let Some(at) = diagnostic.primary.as_ref().map(|label| label.span) else {
            continue;
        };
        let holds =
            |value: &Span| value.source == at.source && value.start <= at.start && at.end <= value.end;
        if let Some((_, place)) = uses.iter().find(|(value, _)| holds(value)) {
            *diagnostic = diagnostic.clone().also(*place, "used here");
        }
    }
}

/// Makes the graph, after a check without errors.
pub(super) fn assemble(
    mut cx: Context<'_>,
    draft: Draft,
    clocks: Clocks,
    devices: Option<Devices>,
    built: Built,
    seed: u64,
) -> Option<Graph> {
    let mut nodes = DiGraph::with_capacity(draft.nodes.len(), draft.nodes.len());
    let Built {
        works,
        files,
        devices: bodies,
        simulated,
    } = built;
    // Only devices that nodes are bound to are part of the graph.
    let mut kept: Vec<Option<usize>> = Vec::new();
    let mut graph_devices = Vec::new();
    for (device, body) in devices.into_iter().flat_map(|devices| devices.list).zip(bodies) {
        kept.push(match (device.bound, device.clock, body) {
            (true, Some(clock), Some(body)) => {
                graph_devices.push(GraphDevice {
                    entry: device.entry,
                    clock,
                    fingerprint: fingerprint::of_device(&cx, &clocks, &device),
                    name: device.name,
                    device: body,
                    senses: device.senses,
                    span: device.span,
                });
                Some(graph_devices.len() - 1)
            }
            _ => None,
        });
    }
    for (i, (work, simulated)) in works.into_iter().zip(simulated).enumerate() {
        let node = &draft.nodes[i];
        let mut work = work?;
        if let Work::Source { device, .. } | Work::Actuator { device, .. } = &mut work {
            *device = kept.get(*device).copied()??;
        }
        if let Some(doubt) = within_the_device(&mut work, node, &graph_devices) {
            cx.report(doubt);
        }
        nodes.add_node(Node {
            path: node.path.clone(),
            entry: node.entry,
            clock: node.clock,
            inputs: node.inputs.iter().map(|slot| input(&draft, node, slot)).collect(),
            outputs: outputs(node)?,
            work,
            span: node.name,
            simulated,
            fingerprint: fingerprint::of_node(&cx, &draft, &clocks, i),
            live: live_values(node),
            written: written(node),
            files: files.get(i).cloned().unwrap_or_default(),
        });
    }
    for (to, node) in draft.nodes.iter().enumerate() {
        for (input, wire) in node.wires() {
            let edge = Edge {
                output: wire.output,
                input,
                bridge: wire.bridge.map_or(Bridge::Direct, |(bridge, _)| bridge),
                span: wire.span,
            };
            nodes.add_edge(NodeIndex::new(wire.from), NodeIndex::new(to), edge);
        }
    }
    let template_outputs = wires::template_outputs(&mut cx, &draft);
    Some(Graph {
        about: cx.document.about.clone(),
        seed,
        clocks: clocks.list,
        base: clocks.base?,
        nodes,
        template_outputs,
        devices: graph_devices,
        sources: cx.sources,
        warnings: cx.diagnostics,
    })
}

/// Lowers the limit of a sink to the largest output of its device, so that `delivered` is right; returns a warning.
fn within_the_device(work: &mut Work, node: &DraftNode, devices: &[GraphDevice]) -> Option<Diagnostic> {
    let Work::Actuator {
        device,
        channel,
        limit,
        ..
    } = work
    else {
        return None;
    };
    let device = devices.get(*device)?;
    let most = device
        .device
        .max_output_bound(*channel)
        .filter(|most| *most < limit.peak)?;
    let message = format!(
        "the peak limit of `{}` is {}, but `{}` can give at most {most}; the limit is lowered to {most}",
        node.path, limit.peak, device.name
    );
    limit.peak = most;
    limit.continuous = limit.continuous.min(most);
    let written = node.fields.remaining().iter();
    let written = written.clone().find(|(name, _)| name.text == "limit");
    let span = written.map_or(node.fields.span, |(_, value)| value.span);
    let warning = Diagnostic::warning("W0108", span, message);
    Some(
        warning
            .also(device.span, "the device")
            .help("lower the limit, or correct what the device states"),
    )
}

/// The live settings of a node with their values or defaults.
fn live_values(node: &DraftNode) -> Vec<(usize, f64)> {
    let specs = node.entry.settings().into_iter().enumerate();
    specs
        .filter(|(_, spec)| spec.live)
        .filter_map(|(place, spec)| {
            let written = node.fields.remaining().iter();
            let written = written.clone().find(|(name, _)| name.text == spec.name);
            let value = match written.map(|(_, value)| &value.shape) {
                Some(Shape::Number(number, _)) => Some(*number),
                Some(_) => None,
                None => spec.default?.parse().ok(),
            };
            Some((place, value?))
        })
        .collect()
}

/// The given settings with computed values; paths without their folders.
fn written(node: &DraftNode) -> Vec<(String, String)> {
    let given = node.fields.remaining().iter();
    let is_setting = |name: &str| node.entry.settings().iter().any(|spec| spec.name == name);
    given
        .filter(|(name, _)| is_setting(&name.text))
        .map(|(name, value)| (name.text.clone(), value.brief()))
        .collect()
}

fn input(draft: &Draft, node: &DraftNode, slot: &Slot) -> Input {
    let port = &node.entry.spec.inputs[slot.port];
    let carried = slot
        .wire
        .as_ref()
        .map(|wire| draft.nodes[wire.from].outputs[wire.output])
        .unwrap_or_default();
    Input {
        name: port.name,
        kind: carried.kind.unwrap_or(match port.kind {
            KindRule::Is(kind) => kind,
            _ => Kind::Scalar,
        }),
        quantity: carried.quantity.unwrap_or(match port.quantity {
            QuantityRule::Is(quantity) => quantity,
            _ => Quantity::NUMBER,
        }),
        connected: slot.wire.is_some(),
        held: port.flow == Flow::Held,
    }
}

fn outputs(node: &DraftNode) -> Option<Vec<Output>> {
    let ports = node.entry.spec.outputs.iter().zip(&node.outputs);
    let output = |(port, carried): (&crate::node::OutputSpec, &super::draft::Type)| {
        Some(Output {
            name: port.name,
            kind: carried.kind?,
            quantity: carried.quantity?,
        })
    };
    ports.map(output).collect()
}
