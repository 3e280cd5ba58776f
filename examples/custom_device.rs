//! A program that reaches a device which haptograph does not know: the work that waits on this computer, as Linux counts it.
//! `cargo run --release --example custom_device -- run examples/custom_device.ron --live --for 5`.

use haptograph::engine::device::{Channel, Device, DeviceEntry, DeviceKind, DeviceSpec};
use haptograph::engine::frame::Kind;
use haptograph::engine::node::{BuildContext, BuildError};
use haptograph::engine::registry::Registry;
use haptograph::engine::silence::OnSilence;
use haptograph::live::{BackendEntry, NumberSource, Readers, add_backend};
use haptograph::nodes::network::inputs::NumberInput;
use haptograph::nodes::network::link::Count;
use haptograph::signal::quantity::Quantity;
use std::io::Result;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread::JoinHandle;
use std::time::Duration;

haptograph::engine::settings! {
    /// Settings of [`Workload`].
    pub struct WorkloadSettings {
        /// The file with the numbers.
        file: String = "/proc/loadavg".to_owned();
        /// Which of its words is read, from 1: the average over one minute, five or fifteen.
        word: u32 = 1, in 1..=3;
    }
}

/// The device as graphs know it: its channels, and the body that ticks.
pub struct Workload;

impl DeviceKind for Workload {
    type Settings = WorkloadSettings;
    const SPEC: DeviceSpec = DeviceSpec {
        name: "Workload",
        doc: "The processes of this computer that run or wait, on average over some minutes.",
        source: "",
        simulated: false,
        senses: &[Channel::new("value", Kind::SCALAR, Quantity::NUMBER, "How many they are.")],
        drives: &[],
        example: r#""work": Workload()"#,
    };

    fn build(_: WorkloadSettings, cx: &BuildContext) -> std::result::Result<Box<dyn Device>, BuildError> {
        let silence = Duration::from_secs(1);
        let body = NumberInput::in_range([0.0, 1000.0], silence, OnSilence::Zero, cx)?;
        Ok(Box::new(body))
    }
}

/// The side that reaches it: a thread reads the file ten times a second, for all inputs of that file.
struct Files;

impl NumberSource for Files {
    type Kind = Workload;
    type Address = String;
    type Field = usize;

    fn locate(settings: &WorkloadSettings) -> Result<(String, usize)> {
        Ok((settings.file.clone(), settings.word as usize))
    }

    fn listen(file: &String, readers: Readers<usize>, stop: Arc<AtomicBool>) -> Result<JoinHandle<()>> {
        let file = file.clone();
        std::fs::read_to_string(&file)?;
        std::thread::Builder::new().spawn(move || {
            while !stop.load(Relaxed) {
                // Without news the inputs fall silent, and what depends on them stops.
                if let Ok(text) = std::fs::read_to_string(&file) {
                    let number = |word: &usize| text.split_whitespace().nth(word - 1)?.parse().ok();
                    readers.publish(|word| Some(number(word).ok_or(Count::Malformed)));
                }
                std::thread::sleep(Duration::from_millis(100));
            }
        })
    }
}

/// The shipped kinds, and this program's, with what reaches it.
pub fn registry() -> Registry {
    let mut registry = haptograph::nodes::registry();
    registry.add_device(DeviceEntry::of::<Workload>());
    add_backend(&mut registry, BackendEntry::numbers::<Files>("workloads"));
    registry
}

fn main() -> ExitCode {
    haptograph::cli::main(&registry())
}
