//! Building kinds from the example in their spec: a test over a whole registry needs no more than that.

use super::{Bench, context};
use crate::device::{Device, DeviceEntry};
use crate::diagnostic::{Diagnostics, Sources};
use crate::document::text;
use crate::document::value::{Body, Name, Shape, Value};
use crate::frame::Kind;
use crate::node::{Build, FileContext, InputSpec, KindRule, NodeEntry, NodeSpec, Presence, Stream};
use crate::settings::{Fields, Reading};
use haptograph_signal::quantity::Quantity;
use std::path::Path;
use std::sync::Arc;

impl Bench {
    /// Builds a node as the example of its spec has it, paths relative to `folder`, with every input connected: those
    /// that take any linear kind to a signal of kind `linear`. `None` for kinds that are no processors, once their
    /// settings have been read and found to fit.
    ///
    /// # Errors
    /// What is wrong with the example, as text.
    pub fn from_example(
        entry: &NodeEntry,
        folder: &Path,
        rate_hz: f64,
        linear: Kind,
    ) -> Result<Option<Self>, String> {
        Self::from_example_with(entry, "", folder, rate_hz, linear)
    }

    /// The same with other settings, `cutoff_hz: 5, gain: 2`, in place of those that the example gives or leaves out.
    ///
    /// # Errors
    /// What is wrong with the example or the settings, as text.
    pub fn from_example_with(
        entry: &NodeEntry,
        settings: &str,
        folder: &Path,
        rate_hz: f64,
        linear: Kind,
    ) -> Result<Option<Self>, String> {
        let spec = entry.spec;
        let example = Example {
            text: spec.example,
            settings,
            kind: spec.name,
            inputs: spec.inputs,
            folder,
        };
        let kinds = |times: &[usize]| -> Vec<Kind> {
            let ports = spec.inputs.iter().zip(times);
            ports
                .flat_map(|(port, times)| std::iter::repeat_n(kind_of(spec, port.kind, linear), *times))
                .collect()
        };
        match entry.build {
            Build::Processor(build) => {
                let (finish, times) = example.read(build)?;
                let connected: Vec<Option<Kind>> = kinds(&times).into_iter().map(Some).collect();
                let cx = context(spec, rate_hz, &connected);
                let (processor, _) = finish(&cx)
                    .and_then(|(_, finish)| finish(&cx))
                    .map_err(|error| error.to_string())?;
                Ok(Some(Self::around(processor, spec, &cx, &connected)))
            }
            Build::Actuator(build) => {
                let (finish, _) = example.read(build)?;
                finish(&()).map_err(|error| error.to_string())?;
                Ok(None)
            }
            Build::File(build) => {
                let (finish, times) = example.read(build)?;
                let stream = |kind| Stream {
                    name: "bench.output".into(),
                    kind,
                    quantity: Quantity::NUMBER,
                    rate: context(spec, rate_hz, &[]).rate,
                    simulated: false,
                };
                let streams = kinds(&times).into_iter().map(stream).collect();
                finish(&FileContext {
                    streams,
                    graph_seed: 1,
                })
                .map_err(|error| error.to_string())?;
                Ok(None)
            }
            Build::Source => {
                example.read(|_, _| Some(()))?;
                Ok(None)
            }
        }
    }
}

/// Builds a device as the example of its spec has it, paths relative to `folder`.
///
/// # Errors
/// What is wrong with the example, as text.
pub fn device_from_example(
    entry: &DeviceEntry,
    folder: &Path,
    rate_hz: f64,
) -> Result<Box<dyn Device>, String> {
    let example = Example {
        text: entry.spec.example,
        settings: "",
        kind: entry.spec.name,
        inputs: &[],
        folder,
    };
    let (finish, _) = example.read(entry.build)?;
    finish(&super::bare_context(rate_hz, Vec::new())).map_err(|error| error.to_string())
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

impl Example<'_> {
    /// Reads its settings with `build`, everything left over being an error; and how often each input is connected.
    fn read<T>(
        &self,
        build: impl FnOnce(&mut Fields, &mut Reading<'_>) -> Option<T>,
    ) -> Result<(T, Vec<usize>), String> {
        let mut sources = Sources::default();
        let mut list = Vec::new();
        let mut parse = |text: &str| {
            let text: Arc<str> = format!("{{{text}}}").into();
            let id = sources.add("example".into(), text.clone());
            text::read(id, &text, &mut list).and_then(|value| entry(value, self.kind))
        };
        let others = parse(&format!("\"others\": {}({})", self.kind, self.settings));
        let (Some((written, mut entries)), Some((_, others))) = (parse(self.text), others) else {
            return Err(format!(
                "the example is not `\"name\": {}(...)`: {}",
                self.kind, self.text
            ));
        };
        entries.retain(|(name, _)| others.iter().all(|(other, _)| other.text != name.text));
        entries.extend(others);
        let mut reading = Reading {
            diagnostics: &mut list,
            folder: &|_| self.folder.to_path_buf(),
            files: &mut Vec::new(),
        };
        let mut fields = Fields::new(self.kind.to_owned(), written.span, entries, &mut reading);
        let _ = (fields.take("clock"), fields.take("endpoint"));
        let mut times = Vec::new();
        for port in self.inputs {
            let given = fields.take(port.name).map(|value| value.shape);
            times.push(match (port.presence, given) {
                (Presence::Many, Some(Shape::List(list))) => list.len(),
                (Presence::Optional, _) | (_, Some(_)) => 1,
                (_, None) => return Err(format!("the example leaves `{}` out", port.name)),
            });
        }
        let built = build(&mut fields, &mut reading);
        fields.finish(&mut reading);
        match built {
            Some(built) if list.is_empty() => Ok((built, times)),
            _ => Err(Diagnostics { sources, list }.to_string()),
        }
    }
}

/// The fields of `{"name": Kind(...)}`.
fn entry(value: Value, kind: &str) -> Option<(Name, Vec<(Name, Value)>)> {
    let Shape::Map(mut entries) = value.shape else {
        return None;
    };
    let (
        _,
        Value {
            shape: Shape::Tagged(tagged),
            ..
        },
    ) = entries.pop().filter(|_| entries.is_empty())?
    else {
        return None;
    };
    let name = tagged.name.filter(|name| name.text == kind)?;
    match tagged.body {
        Body::Fields(fields) => Some((name, fields)),
        Body::Tuple(values) if values.is_empty() => Some((name, Vec::new())),
        _ => None,
    }
}
