//! The devices that a document declares, for programs that ask before they use them.

use super::context::Context;
use super::options::CheckOptions;
use super::values::{Parameters, Place};
use crate::document::Document;
use crate::document::value::Shape;
use crate::registry::Registry;

/// A device as a set of endpoints declares it, with its parameters' values.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DeclaredDevice {
    /// Name of the endpoint.
    pub endpoint: String,
    /// Declaration as one line of RON, settings sorted by name.
    pub written: String,
    /// True if its kind is a simulation. An unregistered kind counts as real.
    pub is_simulated: bool,
    /// True if the device is an endpoint of the calling program.
    pub is_host: bool,
}

/// The devices of the set that the options select, whether or not this build has their kinds.
pub fn declared_devices(
    document: &Document,
    registry: &Registry,
    options: &CheckOptions,
) -> Vec<DeclaredDevice> {
    let mut cx = Context::new(document, registry);
    let mut parameters = Parameters::read(&mut cx, options);
    let mut sets = document.endpoints.iter();
    let set = sets.find(|(name, _)| name.text == options.endpoints);
    let devices = set.map(|(_, devices)| devices.as_slice()).unwrap_or_default();
    let declared = devices.iter().map(|(name, value)| {
        // A value that cannot be replaced is kept; the check reports it.
        let replaced = parameters.replace(&mut cx, value, Place::Graph, &mut Vec::new());
        let value = replaced.as_ref().unwrap_or(value);
        let kind = match &value.shape {
            Shape::Tagged(tagged) => tagged.name.as_ref(),
            _ => None,
        };
        let entry = kind.and_then(|kind| registry.device(&kind.text));
        DeclaredDevice {
            endpoint: name.text.clone(),
            written: value.sorted(),
            is_simulated: entry.is_some_and(|entry| entry.spec.simulated),
            is_host: entry.is_some_and(|entry| entry.is_host()),
        }
    });
    declared.collect()
}
