//! A device of a program's own, that of `examples/custom_device.rs`, in runs that are edited.
#![allow(clippy::unwrap_used)]

#[allow(dead_code)] // Its `main`.
#[path = "../examples/custom_device.rs"]
mod custom_device;

use haptograph::engine::device::{Device, DeviceEntry, DeviceKind, DeviceSpec};
use haptograph::engine::node::{BuildContext, BuildError};
use haptograph::engine::silence::InputState;
use haptograph::live::supervisor::{Event, Request, RunOptions, StartError, Supervisor};
use haptograph::live::{BackendEntry, BackendError, NumberSource, Readers, add_backend};
use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::thread::JoinHandle;

/// A graph that reads the number in a file, and steps by parameters.
fn graph(folder: &Path, kind: &str) -> RunOptions {
    let text = format!(
        r#"Graph(format: 1, parameters: {{ "path": {:?}, "level": 0.5 }},
            clocks: {{ "servo": Driver(rate_hz: 1000) }},
            nodes: {{
                "work": LiveInput(clock: "servo", endpoint: "work"),
                "one": Constant(clock: "servo", value: Param("level"), quantity: "current"),
                "felt": Multiply(input: "one", by: "work"),
                "out": ActuatorSink(current: "felt", endpoint: "coil", limit: (peak_a: 0.5, continuous_a: 0.25)),
            }},
            endpoints: {{ "simulated": {{ "work": {kind}, "coil": SimulatedHaptuator() }} }})"#,
        folder.join("number"),
    );
    fs::write(folder.join("number"), "0.1 0.2").unwrap();
    fs::write(folder.join("g.ron"), text).unwrap();
    RunOptions::of(folder.join("g.ron"))
}

/// Waits for an event.
fn wait_for(run: &mut Supervisor, is_it: impl Fn(&Event) -> bool) -> Vec<Event> {
    let mut events = Vec::new();
    while !run.is_finished() && !events.iter().any(&is_it) {
        run.wait();
        events.extend(run.poll());
    }
    events
}

#[test]
fn the_device_goes_on_after_an_edit_that_was_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut options = graph(folder.path(), r#"Workload(file: Param("path"))"#);
    options.seconds = Some(120.0);
    let mut run = Supervisor::start(options, &custom_device::registry(), None).unwrap();
    let sender = run.sender();
    sender.send(Request::new("path", "/nowhere/at/all")).unwrap();
    let events = wait_for(&mut run, |event| matches!(event, Event::Refused(_)));
    assert!(events.iter().any(|event| matches!(event, Event::Refused(_))), "{events:?}");
    sender.send(Request::new("level", "0.4")).unwrap();
    let events = wait_for(&mut run, |event| matches!(event, Event::Changed(..)));
    assert!(events.iter().any(|event| matches!(event, Event::Changed(..))), "{events:?}");
    let accepted = |run: &mut Supervisor| {
        let status = run.status();
        assert_eq!(status.inputs.len(), 1);
        status.inputs[0].packets.expect("they are counted").accepted
    };
    let before = accepted(&mut run);
    // A second is the silence after which the input would be gone.
    let is_heard = |run: &mut Supervisor| run.status().inputs[0].status.state == InputState::Heard;
    loop {
        if run.is_finished() || accepted(&mut run) >= before + 15 && is_heard(&mut run) {
            break;
        }
        run.wait();
        run.poll();
    }
    assert!(!run.is_finished(), "it is not heard again");
    run.stop();
    run.finish().unwrap();
}

#[test]
fn a_real_device_that_nothing_reaches_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let options = graph(folder.path(), "Workload()");
    let mut registry = haptograph::nodes::registry();
    registry.add_device(DeviceEntry::of::<custom_device::Workload>());
    let refused = Supervisor::start(options, &registry, None).map(drop);
    assert!(
        matches!(&refused, Err(StartError::Backend(BackendError::Unreached { device, .. })) if device == "work"),
        "{refused:?}"
    );
}

/// A body that no source of numbers can reach.
#[derive(Clone)]
struct Deaf;

impl Device for Deaf {
    fn advance(&mut self) {}
    fn read(&mut self, _: usize, frame: &mut [f64]) {
        frame.fill(0.0);
    }
    fn write(&mut self, _: usize, _: &[f64]) {}
}

impl DeviceKind for Deaf {
    type Settings = custom_device::WorkloadSettings;
    const SPEC: DeviceSpec = custom_device::Workload::SPEC;
    fn build(_: Self::Settings, _: &BuildContext) -> Result<Box<dyn Device>, BuildError> {
        Ok(Box::new(Self))
    }
}

struct Unheard;

impl NumberSource for Unheard {
    type Kind = Deaf;
    type Address = String;
    type Field = usize;
    fn locate(settings: &custom_device::WorkloadSettings) -> std::io::Result<(String, usize)> {
        Ok((settings.file.clone(), 1))
    }
    fn listen(_: &String, _: Readers<usize>, _: Arc<AtomicBool>) -> std::io::Result<JoinHandle<()>> {
        panic!("nothing reads it")
    }
}

#[test]
fn a_device_whose_body_takes_no_numbers_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let options = graph(folder.path(), "Workload()");
    let mut registry = haptograph::nodes::registry();
    registry.add_device(DeviceEntry::of::<Deaf>());
    add_backend(&mut registry, BackendEntry::numbers::<Unheard>("deaf"));
    let refused = Supervisor::start(options, &registry, None).map(drop);
    assert!(
        matches!(&refused, Err(StartError::Backend(BackendError::Place { device, .. })) if device == "work"),
        "{refused:?}"
    );
}
