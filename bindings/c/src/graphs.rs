//! Graphs: reading, checking, and listing their channels.

use crate::border::Status;
use crate::failure::Failure;
use crate::table::{self, Entry};
use haptograph_engine::device::Channel;
use haptograph_engine::diagnostic::{Diagnostics, render};
use haptograph_engine::document::{Document, LoadOptions};
use haptograph_engine::graph::{CheckOptions, Graph, Hosted, check};
use std::path::Path;

/// The source of a graph's text.
pub(crate) enum Text<'a> {
    File(&'a Path),
    /// A text, and a file name for it.
    Memory(&'a str, &'a Path),
}

/// The options of checking a graph.
pub(crate) struct GraphRequest<'a> {
    /// Parameters, each `name=value`.
    pub set: Vec<&'a str>,
    pub endpoints: Option<&'a str>,
    /// The endpoints that the caller provides; `None` means all.
    pub hosted: Option<Vec<&'a str>>,
    pub seed: Option<u64>,
}

impl GraphRequest<'_> {
    fn options(&self) -> Result<CheckOptions, Failure> {
        let mut options = CheckOptions::hosted();
        for assignment in &self.set {
            let Some((name, value)) = assignment.split_once('=').filter(|(name, _)| !name.is_empty()) else {
                let message = format_args!("`{assignment}` is not an assignment: write it as NAME=VALUE");
                return Err(Failure::new(Status::Argument, message));
            };
            if options.set.iter().any(|(known, _)| known == name) {
                let message = format_args!("`{name}` is set twice: set it once");
                return Err(Failure::new(Status::Argument, message));
            }
            options.set.push((name.to_owned(), value.to_owned()));
        }
        if let Some(endpoints) = self.endpoints {
            options.endpoints = endpoints.to_owned();
        }
        if let Some(names) = &self.hosted {
            options.hosted = Hosted::Also(names.iter().map(|name| (*name).to_owned()).collect());
        }
        options.seed = self.seed;
        Ok(options)
    }
}

/// Reads and checks a graph and returns its handle.
pub(crate) fn open(text: &Text<'_>, request: &GraphRequest<'_>) -> Result<u64, Failure> {
    let options = request.options()?;
    let document = match text {
        Text::File(path) => Document::load(path, &LoadOptions::default())?,
        Text::Memory(text, name) => Document::parse(name, text)?,
    };
    let graph = check(&document, &haptograph_nodes::registry(), &options)?;
    has_endpoints(&graph, request.hosted.as_deref().unwrap_or_default())?;
    Ok(table::insert(Entry::Graph(Box::new(graph)))?)
}

fn has_endpoints(graph: &Graph, names: &[&str]) -> Result<(), Failure> {
    let known: Vec<&str> = graph.devices().iter().map(|device| device.name.as_str()).collect();
    match names.iter().find(|name| !known.contains(name)) {
        None => Ok(()),
        Some(name) => {
            let known = known.join(", ");
            let message = format_args!("the graph has no endpoint `{name}`; it has {known}");
            Err(Failure::new(Status::Name, message))
        }
    }
}

/// The warnings of a graph as printed on a terminal; empty if there are none.
pub(crate) fn warnings(graph: &Graph) -> String {
    match graph.warnings() {
        [] => String::new(),
        warnings => render(&Diagnostics { sources: graph.sources().clone(), list: warnings.to_vec() }, false),
    }
}

/// The rate of its driver frames, Hz.
pub(crate) fn rate_hz(graph: &Graph) -> f64 {
    let driver = graph.drivers().first().copied().unwrap_or_default();
    graph.clocks().get(driver).map_or(0.0, |clock| clock.rate.hz())
}

/// The channels that the caller feeds or reads.
#[derive(Clone, Copy)]
pub(crate) enum Direction {
    In,
    Out,
}

/// The channels of one direction, with full names.
pub(crate) fn channels(graph: &Graph, direction: Direction) -> Vec<(String, Channel)> {
    match direction {
        Direction::In => graph.host_inputs().collect(),
        Direction::Out => graph.host_outputs().collect(),
    }
}
