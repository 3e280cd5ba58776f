//! Settings read, processors and devices built: the last form before the graph.

use super::Work;
use super::attach::{Attached, Attachment};
use super::clocks::Clocks;
use super::context::Context;
use super::declared::Connected;
use super::devices::Device;
use super::findings::Places;
use super::memory::{self, Memory};
use super::types::missing_quantities;
use crate::device::{BuiltDevice, Channel, DeviceEntry};
use crate::diagnostic::Diagnostic;
use crate::frame::Kind;
use crate::node::{Build, BuildContext, FileContext, MAX_BLOCK, Read, Stream};
use crate::settings::{Expected, Fields, SettingRole, SettingSpec, written};
use haptograph_signal::noise::stream_seed;
use std::collections::HashMap;
use std::ops::Deref;
use std::path::PathBuf;

/// Built nodes and devices.
pub(super) struct Built {
    pub graph: Attached,
    /// `None` after a reported error, as of the devices.
    pub works: Vec<Option<Work>>,
    /// Paths in the settings of each node.
    pub files: Vec<Vec<PathBuf>>,
    pub devices: Vec<Option<BuiltDevice>>,
    /// True for each node that depends on a simulated device.
    pub simulated: Vec<bool>,
}

impl Deref for Built {
    type Target = Attached;

    fn deref(&self) -> &Attached {
        &self.graph
    }
}

/// Reads all settings, and builds every node and device without errors.
pub(super) fn build(cx: &mut Context<'_>, graph: Attached, seed: u64) -> Built {
    let simulated = simulated(&graph);
    let mut memory = Memory::default();
    memory.connections(cx, &graph);
    let mut builder = Builder { graph: &graph, simulated: &simulated, memory, seed };
    let count = graph.nodes.len();
    let (mut files, mut works) = (Vec::with_capacity(count), Vec::with_capacity(count));
    for node in 0..graph.nodes.len() {
        cx.files.clear();
        works.push(builder.work(cx, node));
        files.push(std::mem::take(&mut cx.files));
    }
    refuse_shared_files(cx, &graph, &works);
    let devices = graph.devices.list.iter().zip(&graph.attachments);
    let devices =
        devices.map(|(device, attachment)| body(cx, &graph.clocks, device, attachment, seed)).collect();
    Built { works, files, devices, simulated, graph }
}

/// Refuses sinks that would write the same file or the note beside another's file.
fn refuse_shared_files(cx: &mut Context<'_>, graph: &Attached, works: &[Option<Work>]) {
    let mut known: HashMap<PathBuf, &Connected> = HashMap::new();
    for (node, work) in graph.nodes.iter().zip(works) {
        let Some(Work::File(sink)) = work else { continue };
        let file = sink.file_name();
        for name in [file.to_owned(), file.with_added_extension("ron")] {
            let Some(first) = known.insert(name, node) else {
                continue;
            };
            let at = |node: &Connected| {
                let file = node.entry.setting_for(SettingRole::OutputFile);
                let given = file.and_then(|file| node.fields.given(file.name));
                given.map_or(node.fields.span, |value| value.span)
            };
            let (first_path, path) = (&first.path, &node.path);
            let message =
                format!("`{first_path}` and `{path}` would write the same file in the run's folder");
            let diagnostic = Diagnostic::error("E0304", at(node), message);
            cx.report(diagnostic.also(at(first), "the other").help("give each sink a file of its own"));
        }
    }
}

/// Which nodes depend on a simulated device, through connections and through bodies.
fn simulated(graph: &Attached) -> Vec<bool> {
    let mut simulated = vec![false; graph.nodes.len()];
    let devices = &graph.devices.list;
    let mut bound: Vec<Vec<usize>> = vec![Vec::new(); devices.len()];
    let mut found = Vec::new();
    for (node, device) in graph.device_of.iter().enumerate() {
        let Some(device) = *device else { continue };
        bound[device].push(node);
        if devices[device].entry.spec.simulated {
            found.push(node);
        }
    }
    while let Some(node) = found.pop() {
        if !std::mem::replace(&mut simulated[node], true) {
            found.extend(&graph.readers[node]);
            found.extend(graph.device_of[node].iter().flat_map(|device| &bound[*device]));
        }
    }
    simulated
}

/// True if a field has an unknown name. Errors of the node could then follow from the missing setting.
fn misread(node: &Connected) -> bool {
    let settings = node.entry.specs();
    let mut fields = node.fields.remaining();
    fields.any(|(name, _)| settings.iter().all(|setting| setting.name != name.text))
}

struct Builder<'g> {
    graph: &'g Attached,
    simulated: &'g [bool],
    memory: Memory,
    seed: u64,
}

/// A node while it is built.
struct Job<'j> {
    node: usize,
    target: &'j Connected,
    fields: &'j mut Fields,
    places: &'j Places<'j>,
    /// True if no error of the node was reported, so that it can be built.
    is_sound: bool,
}

impl Job<'_> {
    /// Reads the settings and builds what they describe; without a context, only reads.
    fn built<C, T>(&mut self, cx: &mut Context<'_>, read: Read<C, T>, context: Option<C>) -> Option<T> {
        let finish = cx.reading(|reading| read(self.fields, reading));
        let context = context.filter(|_| self.is_sound);
        self.places.or_report(cx, finish?(&context?))
    }
}

impl Builder<'_> {
    /// Builds a node; `None` after a reported error.
    fn work(&mut self, cx: &mut Context<'_>, node: usize) -> Option<Work> {
        let target = &self.graph.nodes[node];
        if !self.memory.add(cx, self.buffer_bytes(node), target.name, &target.path) {
            return None;
        }
        let mut fields = target.fields.clone();
        for (name, missing) in missing_quantities(target) {
            fields.if_missing(name, Some(missing));
        }
        let inputs = || target.places().collect();
        let places = Places::of(&target.fields).and_inputs(&inputs);
        let before = cx.diagnostics.len();
        let is_refused = cx.is_faulty(target) || target.has_broken_input() || target.fields.has_reported();
        let is_sound = !is_refused && !misread(target);
        let mut job = Job { node, target, fields: &mut fields, places: &places, is_sound };
        let work = match target.entry.build {
            Build::Processor(_) | Build::Scripted(_) => self.processor(cx, &mut job),
            Build::Actuator(read) => {
                if let Some(limit) = target.entry.setting_for(SettingRole::Limit) {
                    job.fields.if_missing(limit.name, Some(no_limit(target, &limit)));
                }
                // A limit is checked whatever else is wrong.
                let finish = cx.reading(|reading| read(job.fields, reading));
                let limit = finish.and_then(|finish| places.or_report(cx, finish(&())));
                limit.zip(self.channel(&job)).map(|((gain, limit), (device, channel))| Work::Actuator {
                    device,
                    channel,
                    gain,
                    limit,
                })
            }
            Build::File(read) => {
                let context =
                    self.streams(node).map(|streams| FileContext { streams, graph_seed: self.seed });
                job.built(cx, read, context).map(Work::File)
            }
            Build::Source(read) => {
                let has_settings = cx.reading(|reading| read(job.fields, reading));
                self.channels(&job).filter(|_| has_settings)
            }
        };
        cx.reading(|reading| fields.finish(reading));
        cx.explain_node(before, target);
        work
    }

    fn processor(&mut self, cx: &mut Context<'_>, job: &mut Job<'_>) -> Option<Work> {
        let Job { target, places, .. } = *job;
        let finish = cx.reading(|reading| target.entry.build.read_processor(job.fields, reading));
        let context = self.context(job.node).filter(|_| job.is_sound)?;
        let (bytes, finish) = places.or_report(cx, finish?(&context))?;
        if !self.memory.add(cx, bytes, target.name, &target.path) {
            return None;
        }
        let (processor, advice) = places.or_report(cx, finish(&context))?;
        advice.into_iter().for_each(|doubt| places.warn(cx, doubt));
        Some(Work::Process(processor))
    }

    /// The device and channel that an actuator sink drives.
    fn channel(&self, job: &Job<'_>) -> Option<(usize, usize)> {
        let device = self.graph.device_of[job.node].filter(|_| job.is_sound)?;
        let port = job.target.entry.spec.inputs.first()?.name;
        Some((device, place_of(port, &self.graph.attachments[device].drives)?))
    }

    /// The device and channels that a source reads.
    fn channels(&self, job: &Job<'_>) -> Option<Work> {
        let device = self.graph.device_of[job.node].filter(|_| job.is_sound)?;
        let senses = &self.graph.attachments[device].senses;
        let outputs = job.target.entry.spec.outputs.iter();
        let channels = outputs.map(|port| place_of(port.name, senses)).collect::<Option<_>>()?;
        Some(Work::Source { device, channels })
    }

    fn context(&self, node: usize) -> Option<BuildContext> {
        let target = &self.graph.nodes[node];
        let kinds = target.inputs.iter().map(|slot| match &slot.wire {
            Some(wire) => self.graph.carried(wire).kind.map(Some),
            None => Some(None),
        });
        Some(BuildContext {
            path: target.path.clone(),
            rate: self.graph.rate_of(node)?,
            max_frames: max_frames(&self.graph.clocks, self.graph.clock_of[node]?),
            seed: stream_seed(self.seed, &target.path),
            inputs: kinds.collect::<Option<_>>()?,
            names: target.connection_names(),
        })
    }

    /// Largest size of the output buffers of a node, without sharing.
    fn buffer_bytes(&self, node: usize) -> u64 {
        let widths = self.graph.types[node].iter().map(|output| output.kind.map_or(1, Kind::width));
        let frames = self.graph.clock_of[node].map_or(0, |clock| max_frames(&self.graph.clocks, clock));
        memory::bytes(frames as u64, widths.sum())
    }

    /// The signals that arrive at a node.
    fn streams(&self, node: usize) -> Option<Vec<Stream>> {
        let stream = |(_, wire): (usize, &super::declared::Wire)| {
            let carried = self.graph.carried(wire);
            Some(Stream {
                name: self.graph.source_name(wire),
                kind: carried.kind?,
                quantity: carried.quantity?,
                rate: self.graph.rate_of(wire.from)?,
                simulated: self.simulated[wire.from],
            })
        };
        self.graph.nodes[node].wires().map(stream).collect()
    }
}

fn place_of(name: &str, channels: &[Channel]) -> Option<usize> {
    channels.iter().position(|channel| channel.name == name)
}

fn no_limit(node: &Connected, limit: &SettingSpec) -> Diagnostic {
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

/// Largest number of frames of a clock in a block of its driver.
fn max_frames(clocks: &Clocks, clock: usize) -> usize {
    let (n, d) = clocks.list[clock].rate.parts();
    let (m, e) = clocks.list[clocks.list[clock].driver].rate.parts();
    let frames = MAX_BLOCK as u128 * u128::from(n) * u128::from(e);
    let frames = frames.div_ceil(u128::from(d) * u128::from(m)) + 1;
    usize::try_from(frames).unwrap_or(usize::MAX)
}

/// Builds a device; `None` after a reported error.
fn body(
    cx: &mut Context<'_>,
    clocks: &Clocks,
    device: &Device,
    attachment: &Attachment,
    seed: u64,
) -> Option<BuiltDevice> {
    let mut fields = device.fields.clone();
    let places = Places::of(&device.fields);
    let before = cx.diagnostics.len();
    let finish = cx.reading(|reading| {
        let finish = (device.entry.build)(&mut fields, reading);
        fields.finish(reading);
        finish
    });
    let context = attachment.clock.map(|clock| BuildContext {
        path: device.name.clone(),
        rate: clocks.list[clock].rate,
        max_frames: max_frames(clocks, clock),
        seed: stream_seed(seed, &format!("endpoints/{}", device.name)),
        inputs: Vec::new(),
        names: Vec::new(),
    });
    let built = finish.zip(context).and_then(|(finish, context)| places.or_report(cx, finish(&context)));
    cx.explain(before, &device.uses);
    let mut built = built?;
    if let Some(clock) = attachment.clock.filter(|_| device.is_lent) {
        built.body = DeviceEntry::lent(built.body, clocks.list[clock].rate);
    }
    built.body.connect(&attachment.senses, &attachment.drives);
    Some(built)
}
