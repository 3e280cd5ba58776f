//! A program that reaches a device which haptograph does not know: the work that waits on this computer, as Linux counts it.
//! `cargo run --release --example custom_device -- run examples/custom_device.ron --live --for 5`.

use haptograph::engine::device::{Channel, Device, DeviceEntry, DeviceKind, DeviceSpec};
use haptograph::engine::frame::Kind;
use haptograph::engine::graph::Graph;
use haptograph::engine::node::{BuildContext, BuildError};
use haptograph::engine::registry::Registry;
use haptograph::engine::silence::OnSilence;
use haptograph::live::{Backend, BackendEntry, BackendError, Connected, Counts, add_backend};
use haptograph::nodes::network::inputs::NumberInput;
use haptograph::nodes::network::link::Link;
use haptograph::signal::quantity::Quantity;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread::JoinHandle;
use std::time::Duration;

haptograph::engine::settings! {
    /// Settings of [`Workload`].
    pub struct WorkloadSettings {
        /// The file that begins with the number.
        file: String = "/proc/loadavg".to_owned();
    }
}

/// The device as graphs know it: its channels, and the body that ticks.
pub struct Workload;

impl DeviceKind for Workload {
    type Settings = WorkloadSettings;
    const SPEC: DeviceSpec = DeviceSpec {
        name: "Workload",
        doc: "The processes of this computer that run or wait, on average over a minute.",
        source: "",
        simulated: false,
        senses: &[Channel::new(
            "value",
            Kind::SCALAR,
            Quantity::NUMBER,
            "How many they are.",
        )],
        drives: &[],
        example: r#""work": Workload()"#,
    };

    fn build(_: WorkloadSettings, cx: &BuildContext) -> Result<Box<dyn Device>, BuildError> {
        let silence = Duration::from_secs(1);
        let body = NumberInput::in_range([0.0, 1000.0], silence, OnSilence::Zero, cx)?;
        Ok(Box::new(body))
    }
}

/// The side that reaches it: a thread reads the file ten times a second.
struct Reading {
    device: String,
    file: String,
    link: Arc<Link>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    /// Whether it came with the graph that was opened last.
    is_new: bool,
}

fn number_in(file: &str) -> std::io::Result<f64> {
    let text = std::fs::read_to_string(file)?;
    let first = text.split_whitespace().next().and_then(|word| word.parse().ok());
    first.ok_or_else(|| std::io::Error::other("it does not begin with a number"))
}

impl Reading {
    fn start(device: &str, file: &str) -> Result<Self, BackendError> {
        let refused = |error| BackendError::Place {
            device: device.to_owned(),
            place: file.to_owned(),
            error,
        };
        number_in(file).map_err(refused)?;
        let (link, stop) = (Arc::<Link>::default(), Arc::<AtomicBool>::default());
        let (to, stopped, path) = (Arc::clone(&link), Arc::clone(&stop), file.to_owned());
        let read = move || {
            while !stopped.load(Relaxed) {
                // Without news the input falls silent, and what depends on it stops.
                let _ = number_in(&path).map(|number| to.publish_number(number));
                std::thread::sleep(Duration::from_millis(100));
            }
        };
        let thread = std::thread::Builder::new().spawn(read).map_err(refused)?;
        Ok(Self {
            device: device.to_owned(),
            file: file.to_owned(),
            link,
            stop,
            thread: Some(thread),
            is_new: true,
        })
    }
}

impl Drop for Reading {
    fn drop(&mut self) {
        self.stop.store(true, Relaxed);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

/// The backend: all such devices of a run.
#[derive(Default)]
struct Workloads(Vec<Reading>);

impl Backend for Workloads {
    fn open(&mut self, graph: &mut Graph) -> Result<(), BackendError> {
        for index in 0..graph.devices().len() {
            let device = &graph.devices()[index];
            let Some(settings) = device.settings::<Workload>() else {
                continue;
            };
            let is_it = |known: &&Reading| known.device == device.name && known.file == settings.file;
            let link = match self.0.iter().find(is_it) {
                Some(known) => Arc::clone(&known.link),
                None => {
                    let reading = Reading::start(&device.name, &settings.file)?;
                    let link = Arc::clone(&reading.link);
                    self.0.push(reading);
                    link
                }
            };
            if let Some(body) = graph.body_mut::<NumberInput>(index) {
                body.attach(&link);
            }
        }
        Ok(())
    }

    fn undo(&mut self) {
        self.0.retain(|reading| !reading.is_new);
    }

    fn keep(&mut self, graph: &Graph) {
        self.0.retain(|reading| {
            let mut devices = graph.devices().iter();
            devices.any(|device| {
                let settings = device.settings::<Workload>();
                device.name == reading.device && settings.is_some_and(|known| known.file == reading.file)
            })
        });
        self.0.iter_mut().for_each(|reading| reading.is_new = false);
    }

    fn status(&self) -> Vec<Connected> {
        let of = |reading: &Reading| Connected::link(&reading.device, &reading.file);
        self.0.iter().map(of).collect()
    }

    fn counts(&self) -> Vec<Counts> {
        let of = |reading: &Reading| Counts::Packets(reading.link.counts(), Vec::new());
        self.0.iter().map(of).collect()
    }
}

/// The shipped kinds, and this program's, with what reaches it.
pub fn registry() -> Registry {
    let mut registry = haptograph::nodes::registry();
    registry.add_device(DeviceEntry::of::<Workload>());
    add_backend(
        &mut registry,
        BackendEntry::new("workloads", &["Workload"], || Box::new(Workloads::default())),
    );
    registry
}

fn main() -> ExitCode {
    haptograph::cli::main(&registry())
}
