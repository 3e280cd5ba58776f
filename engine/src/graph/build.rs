//! From draft to graph: settings read, processors and devices built.

mod assemble;
mod findings;

use super::Work;
use super::clocks::Clocks;
use super::devices::{Devices, DraftDevice};
use super::draft::{Context, Draft, DraftNode};
use super::memory::{self, Memory};
use crate::device::BuiltDevice;
use crate::diagnostic::Diagnostic;
use crate::frame::Kind;
use crate::node::{Build, BuildContext, FileContext, MAX_BLOCK, Stream};
use crate::settings::{Expected, SettingRole, SettingSpec, written};
pub(super) use assemble::assemble;
pub(super) use findings::{Places, explain, part_of_text};
use haptograph_signal::noise::stream_seed;
use std::collections::HashMap;
use std::path::PathBuf;

/// Built nodes and devices; `None` after a reported error.
pub(super) struct Built {
    works: Vec<Option<Work>>,
    /// Paths in the settings of each node.
    files: Vec<Vec<PathBuf>>,
    devices: Vec<Option<BuiltDevice>>,
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
        works.push(work(cx, draft, clocks, declared, &simulated, &mut memory, seed, node));
        files.push(std::mem::take(&mut cx.files));
    }
    refuse_shared_files(cx, draft, &works);
    Built {
        works,
        files,
        devices: declared.iter().map(|device| body(cx, clocks, device, seed)).collect(),
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
                let file = draft.nodes[node].entry.setting_for(SettingRole::OutputFile);
                file.and_then(|file| fields.given(file.name)).map_or(fields.span, |value| value.span)
            };
            let (first_path, path) = (&draft.nodes[first].path, &draft.nodes[node].path);
            let message =
                format!("`{first_path}` and `{path}` would write the same file in the run's folder");
            let diagnostic = Diagnostic::error("E0304", at(node), message);
            cx.report(diagnostic.also(at(first), "the other").help("give each sink a file of its own"));
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

/// True if a field has an unknown name. Errors of the node could then follow from the missing setting.
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
            if let Some(limit) = target.entry.setting_for(SettingRole::Limit) {
                fields.if_missing(limit.name, Some(no_limit(target, &limit)));
            }
            let finish = cx.reading(|reading| read(&mut fields, reading));
            let limit = finish.and_then(|finish| places.or_report(cx, finish(&())));
            let device = target.device.filter(|_| sound);
            let channel = device.and_then(|device| {
                let port = target.entry.spec.inputs.first()?.name;
                let drives = &devices[device].drives;
                drives.iter().position(|channel| channel.name == port)
            });
            match (limit, device, channel) {
                (Some((gain, limit)), Some(device), Some(channel)) => {
                    Some(Work::Actuator { device, channel, gain, limit })
                }
                _ => None,
            }
        }
        Build::File(read) => {
            let finish = cx.reading(|reading| read(&mut fields, reading));
            let context = streams(draft, clocks, simulated, node)
                .filter(|_| sound)
                .map(|streams| FileContext { streams, graph_seed: seed });
            match (finish, context) {
                (Some(finish), Some(context)) => places.or_report(cx, finish(&context)).map(Work::File),
                _ => None,
            }
        }
        Build::Source(read) => {
            let has_settings = cx.reading(|reading| read(&mut fields, reading));
            target.device.filter(|_| sound && has_settings).and_then(|device| {
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

fn no_limit(node: &DraftNode, limit: &SettingSpec) -> Diagnostic {
    let (kind, name) = (node.entry.spec.name, limit.name);
    let expected = match &limit.expected {
        Expected::Structure(fields) => written(fields),
        _ => "...".to_owned(),
    };
    Diagnostic::error("E0605", node.fields.span, format!("actuator sink `{kind}` has no limit"))
        .label(format!("`{name}` is missing"))
        .help(format!("set the limit of the actuator: `{name}: {expected}`"))
        .help("every actuator needs a limit")
}

fn context(draft: &Draft, clocks: &Clocks, seed: u64, node: usize) -> Option<BuildContext> {
    let target = &draft.nodes[node];
    let kinds = target.inputs.iter().map(|slot| match &slot.wire {
        Some(wire) => draft.nodes[wire.from].outputs[wire.output].kind.map(Some),
        None => Some(None),
    });
    let names = target.inputs.iter().filter_map(|slot| slot.name.as_ref());
    Some(BuildContext {
        path: target.path.clone(),
        rate: clocks.list[target.clock?].rate,
        max_frames: max_frames(clocks, target.clock?),
        seed: stream_seed(seed, &target.path),
        inputs: kinds.collect::<Option<_>>()?,
        names: names.map(|name| name.text.clone()).collect(),
    })
}

/// Largest size of the output buffers of a node, without sharing.
fn buffer_bytes(draft: &Draft, clocks: &Clocks, node: usize) -> u64 {
    let target = &draft.nodes[node];
    let widths = target.outputs.iter().map(|output| output.kind.map_or(1, Kind::width));
    let frames = target.clock.map_or(0, |clock| max_frames(clocks, clock));
    memory::bytes(frames as u64, widths.sum())
}

/// Largest number of frames of a clock in a block of its driver.
fn max_frames(clocks: &Clocks, clock: usize) -> usize {
    let (n, d) = clocks.list[clock].rate.parts();
    let (m, e) = clocks.list[clocks.list[clock].driver].rate.parts();
    let frames = MAX_BLOCK as u128 * u128::from(n) * u128::from(e);
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

fn body(cx: &mut Context<'_>, clocks: &Clocks, device: &DraftDevice, seed: u64) -> Option<BuiltDevice> {
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
                inputs: Vec::new(),
                names: Vec::new(),
            };
            places.or_report(cx, finish(&context)).map(|mut built| {
                built.body.connect(&device.senses, &device.drives);
                built
            })
        }
        _ => None,
    };
    explain(cx, before, &device.uses);
    built
}
