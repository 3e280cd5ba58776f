//! Builds kinds from the example in their spec, for tests over a whole registry.

use super::{Bench, context};
use crate::device::{Device, DeviceEntry};
use crate::diagnostic::{Diagnostics, Sources};
use crate::document::text;
use crate::document::value::{Body, Name, Shape, Value};
use crate::frame::Kind;
use crate::node::{
    Build, FileContext, FileSink, InputSpec, KindRule, Limit, NodeEntry, NodeSpec, Presence, Stream,
};
use crate::settings::{Fields, Reading};
use haptograph_signal::quantity::Quantity;
use std::path::Path;
use std::sync::Arc;

/// The result of building the example of a kind of node.
pub enum ExampleNode {
    /// A processor on a bench.
    Processor(Bench),
    /// The gain and the limit of a sink that drives a device.
    Actuator(f64, Limit),
    /// A file sink, and the streams that it will write.
    File(Box<dyn FileSink>, Vec<Stream>),
    /// A source, whose settings are valid.
    Source,
}

impl Bench {
    /// Builds a node as the example of its spec has it, paths relative to `folder`, with every input connected: those
    /// that take any linear kind to a signal of kind `linear`. `None` for kinds that are no processors, once their
    /// settings have been read and found to fit.
    ///
    /// # Errors
    /// A description of the error in the example.
    pub fn from_example(
        entry: &NodeEntry,
        folder: &Path,
        rate_hz: f64,
        linear: Kind,
    ) -> Result<Option<Self>, String> {
        Ok(match node_from_example(entry, "", folder, rate_hz, linear)? {
            ExampleNode::Processor(bench) => Some(bench),
            _ => None,
        })
    }
}

/// Builds a node as [`Bench::from_example`] does, with other settings, `cutoff_hz: 5, gain: 2`, in place of those that the
/// example gives or leaves out. `reset: None` leaves an optional input unconnected.
///
/// # Errors
/// A description of the error in the example or the settings.
pub fn node_from_example(
    entry: &NodeEntry,
    settings: &str,
    folder: &Path,
    rate_hz: f64,
    linear: Kind,
) -> Result<ExampleNode, String> {
    let spec = entry.spec;
    let example = Example { text: spec.example, settings, kind: spec.name, inputs: spec.inputs, folder };
    let kinds = |times: &[usize]| -> Vec<Kind> {
        let ports = spec.inputs.iter().zip(times);
        ports
            .flat_map(|(port, times)| std::iter::repeat_n(kind_of(spec, port.kind, linear), *times))
            .collect()
    };
    match entry.build {
        build @ (Build::Processor(_) | Build::Scripted(_)) => {
            let ((finish, members), Connected { times, names }) = example.read(|fields, reading| {
                let members = entry.members(fields, reading)?;
                Some((build.read_processor(fields, reading)?, members))
            })?;
            let members = members.map_err(|error| error.to_string())?;
            let ports = spec.inputs.iter().zip(&times);
            let connected = ports.flat_map(|(port, times)| {
                let kind = (*times > 0).then(|| kind_of(spec, port.kind, linear));
                let least = usize::from(!port.presence.is_several());
                std::iter::repeat_n(kind, (*times).max(least))
            });
            let connected: Vec<Option<Kind>> = connected.collect();
            let names: Vec<&str> = names.iter().map(String::as_str).collect();
            let cx = context(spec, rate_hz, &connected).named(&names);
            let (processor, _) =
                finish(&cx).and_then(|(_, finish)| finish(&cx)).map_err(|error| error.to_string())?;
            Ok(ExampleNode::Processor(Bench::around(processor, spec, members, &cx, &connected)))
        }
        Build::Actuator(build) => {
            let (finish, _) = example.read(build)?;
            let (gain, limit) = finish(&()).map_err(|error| error.to_string())?;
            Ok(ExampleNode::Actuator(gain, limit))
        }
        Build::File(build) => {
            let (finish, Connected { times, .. }) = example.read(build)?;
            let stream = |(number, kind)| Stream {
                name: format!("bench.{number}"),
                kind,
                quantity: Quantity::NUMBER,
                rate: context(spec, rate_hz, &[]).rate,
                simulated: false,
            };
            let streams: Vec<Stream> = kinds(&times).into_iter().enumerate().map(stream).collect();
            let cx = FileContext { streams: streams.clone(), graph_seed: 1 };
            let sink = finish(&cx).map_err(|error| error.to_string())?;
            Ok(ExampleNode::File(sink, streams))
        }
        Build::Source(read) => {
            example.read(|fields, reading| read(fields, reading).then_some(()))?;
            Ok(ExampleNode::Source)
        }
    }
}

/// Builds a device as the example of its spec has it, with other settings as in [`node_from_example`], paths relative to
/// `folder`.
///
/// # Errors
/// A description of the error in the example or the settings.
pub fn device_from_example(
    entry: &DeviceEntry,
    settings: &str,
    folder: &Path,
    rate_hz: f64,
) -> Result<Box<dyn Device>, String> {
    let example = Example { text: entry.spec.example, settings, kind: entry.spec.name, inputs: &[], folder };
    let (finish, _) = example.read(entry.build)?;
    let built = finish(&super::bare_context(rate_hz));
    built.map(|built| built.body).map_err(|error| error.to_string())
}

/// A kind of frame that a port takes.
fn kind_of(spec: &NodeSpec, rule: KindRule, linear: Kind) -> Kind {
    match rule {
        KindRule::Is(kind) => kind,
        KindRule::Linear | KindRule::Any => linear,
        KindRule::Same(name) => match spec.inputs.iter().find(|port| port.name == name) {
            Some(port) => kind_of(spec, port.kind, linear),
            None => linear,
        },
    }
}

struct Example<'a> {
    text: &'a str,
    /// Those that are not as in the text.
    settings: &'a str,
    kind: &'a str,
    inputs: &'a [InputSpec],
    folder: &'a Path,
}

/// The connections of an example.
#[derive(Default)]
struct Connected {
    /// How often each input is connected.
    times: Vec<usize>,
    /// Names of connections.
    names: Vec<String>,
}

impl Example<'_> {
    /// Reads its settings with `build`, everything left over being an error; and its connections.
    fn read<T>(
        &self,
        build: impl FnOnce(&mut Fields, &mut Reading<'_>) -> Option<T>,
    ) -> Result<(T, Connected), String> {
        let mut sources = Sources::default();
        let mut list = Vec::new();
        let mut parse = |text: &str| {
            let text: Arc<str> = format!("{{{text}}}").into();
            let id = sources.add("example".into(), text.clone());
            text::read(id, &text, &mut list).and_then(|value| entry(value, self.kind))
        };
        let others = parse(&format!("\"others\": {}({})", self.kind, self.settings));
        let (Some((written, mut entries)), Some((_, others))) = (parse(self.text), others) else {
            return Err(format!("the example is not `\"name\": {}(...)`: {}", self.kind, self.text));
        };
        entries.retain(|(name, _)| others.iter().all(|(other, _)| other.text != name.text));
        entries.extend(others);
        let mut reading = Reading {
            diagnostics: &mut list,
            folder: &|_| self.folder.to_path_buf(),
            files: &mut Vec::new(),
            setting: None,
            first_given: u32::MAX,
        };
        let mut fields = Fields::new(self.kind.to_owned(), written.span, entries, &mut reading);
        let _ = (fields.take("clock"), fields.take("endpoint"));
        let mut connected = Connected::default();
        for port in self.inputs {
            let given = fields.take(port.name).map(|value| value.shape);
            connected.times.push(match (port.presence, given) {
                (Presence::Many | Presence::Named, Some(Shape::List(list))) => list.len(),
                (Presence::Named, Some(Shape::Map(pairs))) => {
                    connected.names = pairs.iter().filter_map(|(key, _)| text_of(key)).collect();
                    pairs.len()
                }
                (Presence::Optional, Some(value)) if is_none(&value) => 0,
                (Presence::Optional, _) | (_, Some(_)) => 1,
                (_, None) => return Err(format!("the example leaves `{}` out", port.name)),
            });
        }
        let built = build(&mut fields, &mut reading);
        fields.finish(&mut reading);
        match built {
            Some(built) if list.is_empty() => Ok((built, connected)),
            _ => Err(Diagnostics { sources, list }.to_string()),
        }
    }
}

/// True if an input is left unconnected: `reset: None`.
fn is_none(value: &Shape) -> bool {
    matches!(value, Shape::Tagged(tagged) if tagged.name.as_ref().is_some_and(|name| name.text == "None"))
}

fn text_of(key: &Value) -> Option<String> {
    match &key.shape {
        Shape::String(text) => Some(text.clone()),
        _ => None,
    }
}

/// The fields of `{"name": Kind(...)}`.
fn entry(value: Value, kind: &str) -> Option<(Name, Vec<(Name, Value)>)> {
    let Shape::Map(mut entries) = value.shape else {
        return None;
    };
    let (_, Value { shape: Shape::Tagged(tagged), .. }) = entries.pop().filter(|_| entries.is_empty())?
    else {
        return None;
    };
    let name = tagged.name.filter(|name| name.text == kind)?;
    match tagged.body {
        Body::Fields(fields) => Some((name, fields.to_vec())),
        Body::Tuple(values) if values.is_empty() => Some((name, Vec::new())),
        _ => None,
    }
}
