//! Inputs of one number each, of which several can share an address or a port: one thread listens there for all of them.

use crate::backend::{Backend, BackendError, Connected, Counts};
use haptograph_engine::device::DeviceKind;
use haptograph_engine::graph::{Graph, GraphDevice};
use haptograph_engine::silence::InputCell;
use haptograph_nodes::network::inputs::NumberInput;
use haptograph_nodes::network::link::{Count, Link};
use std::fmt::{Debug, Display};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

/// A source of numbers outside the program: sensors at a serial port, a file that the system writes, a network protocol.
///
/// Each input of [`Kind`](Self::Kind), whose device is a [`NumberInput`], reads one field at an address. Everything else is
/// here: threads, edits of the graph, silence, counts. [`BackendEntry::numbers`](crate::BackendEntry::numbers) makes a backend
/// of it; `examples/custom_device.rs` of the repository is a whole program.
pub trait NumberSource: Send + 'static {
    /// The kind of its inputs.
    type Kind: DeviceKind;
    /// An address, a port or a file, with the settings that all inputs there share.
    type Address: Clone + PartialEq + Display + Debug + Send;
    /// Which of the numbers there an input reads.
    type Field: Clone + PartialEq + Display + Debug + Send;

    /// What an input reads.
    ///
    /// # Errors
    /// If the settings name nothing that can be read.
    fn locate(
        settings: &<Self::Kind as DeviceKind>::Settings,
    ) -> std::io::Result<(Self::Address, Self::Field)>;

    /// True if both addresses are the same place, even with other settings. The same place with other settings is an error.
    fn is_same(one: &Self::Address, other: &Self::Address) -> bool {
        one == other
    }

    /// Opens the address, and publishes its numbers ([`Readers::publish`]) on a thread of its own until `stop` is set.
    ///
    /// # Errors
    /// The system's error if the address cannot be opened.
    fn listen(
        address: &Self::Address,
        readers: Readers<Self::Field>,
        stop: Arc<AtomicBool>,
    ) -> std::io::Result<JoinHandle<()>>;
}

/// An input and the field that it reads.
#[derive(Debug, Clone)]
pub(crate) struct Reader<F> {
    /// Name of the endpoint.
    pub device: String,
    pub field: F,
    /// Silence after which its input counts as gone.
    pub timeout: Duration,
    pub link: Arc<Link>,
    /// True if the connection was added by the last open.
    pub is_new: bool,
}

impl<F> Reader<F> {
    /// A new reader with a link of its own.
    pub(crate) fn new(device: &str, field: F, timeout: Duration) -> Self {
        Self { device: device.to_owned(), field, timeout, link: Arc::default(), is_new: true }
    }
}

/// The inputs that read an address, which may change while it is listened to. No real-time thread uses them.
#[derive(Debug)]
pub struct Readers<F>(Arc<Mutex<Vec<Reader<F>>>>);

impl<F> Clone for Readers<F> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

impl<F> Default for Readers<F> {
    fn default() -> Self {
        Self(Arc::default())
    }
}

impl<F> Readers<F> {
    /// Publishes what a message says of each field that is read: `None` for nothing, an error to be counted, or a number.
    /// NaN and infinity are counted and not published.
    pub fn publish(&self, number: impl Fn(&F) -> Option<Result<f64, Count>>) {
        for reader in &*self.list() {
            match number(&reader.field) {
                Some(Ok(number)) if number.is_finite() => reader.link.publish_number(number),
                Some(Ok(_)) => reader.link.count(Count::NotNumbers, 1),
                Some(Err(what)) => reader.link.count(what, 1),
                None => {}
            }
        }
    }

    /// The present readers.
    pub(crate) fn list(&self) -> MutexGuard<'_, Vec<Reader<F>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Listens at an address until it is dropped.
#[derive(Debug)]
pub(crate) struct Listener<S: NumberSource> {
    address: S::Address,
    readers: Readers<S::Field>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    is_new: bool,
}

impl<S: NumberSource> Listener<S> {
    /// Starts to listen, without readers.
    ///
    /// # Errors
    /// The system's error if the address cannot be opened.
    pub(crate) fn open(address: &S::Address) -> std::io::Result<Self> {
        let (readers, stop) = (Readers::default(), Arc::<AtomicBool>::default());
        let thread = S::listen(address, readers.clone(), Arc::clone(&stop))?;
        Ok(Self { address: address.clone(), readers, stop, thread: Some(thread), is_new: true })
    }

    /// The link of an input: that of an input that reads the same field, or a new one.
    pub(crate) fn link(&self, device: &str, field: S::Field, timeout: Duration) -> Arc<Link> {
        let mut readers = self.readers.list();
        // Silence depends on the timeout: inputs with another timeout have their own links.
        let is_it = |reader: &&Reader<S::Field>| reader.field == field && reader.timeout == timeout;
        if let Some(known) = readers.iter().find(is_it) {
            return Arc::clone(&known.link);
        }
        let reader = Reader::new(device, field, timeout);
        let link = Arc::clone(&reader.link);
        readers.push(reader);
        link
    }
}

impl<S: NumberSource> Drop for Listener<S> {
    fn drop(&mut self) {
        crate::end(&self.stop, &mut self.thread);
    }
}

/// The backend of a source: one listener for each address.
pub(crate) struct Listeners<S: NumberSource>(Vec<Listener<S>>);

impl<S: NumberSource> Listeners<S> {
    /// Without connections, as a backend.
    pub(crate) fn boxed() -> Box<dyn Backend> {
        Box::new(Self(Vec::new()))
    }

    /// The link of an input, at the listener of its address, which is opened if there is none.
    fn link(
        &mut self,
        device: &str,
        (address, field): (S::Address, S::Field),
        timeout: Duration,
    ) -> Result<Arc<Link>, BackendError> {
        let is_same = |known: &Listener<S>| S::is_same(&known.address, &address);
        let listener = match self.0.iter().position(is_same) {
            Some(known) if self.0[known].address == address => known,
            Some(_) => return Err(BackendError::Differ(device.to_owned(), address.to_string())),
            None => {
                let opened = Listener::open(&address).map_err(|error| failed(device, &address, error))?;
                self.0.push(opened);
                self.0.len() - 1
            }
        };
        Ok(self.0[listener].link(device, field, timeout))
    }

    fn each_reader<T>(&self, of: impl Fn(&S::Address, &Reader<S::Field>) -> T) -> Vec<T> {
        let of_listener = |listener: &Listener<S>| -> Vec<T> {
            let readers = listener.readers.list();
            readers.iter().map(|reader| of(&listener.address, reader)).collect()
        };
        self.0.iter().flat_map(of_listener).collect()
    }
}

fn failed(device: &str, address: &impl Display, error: std::io::Error) -> BackendError {
    BackendError::Place { device: device.to_owned(), place: address.to_string(), error }
}

impl<S: NumberSource> Backend for Listeners<S> {
    fn open(&mut self, graph: &mut Graph) -> Result<(), BackendError> {
        for listener in &mut self.0 {
            listener.is_new = false;
            let mut readers = listener.readers.list();
            readers.iter_mut().for_each(|reader| reader.is_new = false);
        }
        for device in 0..graph.devices().len() {
            let known = &graph.devices()[device];
            let name = known.name.clone();
            let Some(settings) = known.settings::<S::Kind>() else {
                continue;
            };
            let located = S::locate(settings).map_err(|error| failed(&name, &"its address", error))?;
            let no_body =
                || std::io::Error::other("the kind of this device has no `NumberInput` as its body");
            let body = graph.body_mut::<NumberInput>(device);
            let body = body.ok_or_else(|| failed(&name, &located.0, no_body()))?;
            body.attach(&self.link(&name, located, body.timeout())?);
        }
        Ok(())
    }

    fn undo(&mut self) {
        self.0.retain(|listener| !listener.is_new);
        for listener in &self.0 {
            listener.readers.list().retain(|reader| !reader.is_new);
        }
    }

    fn keep(&mut self, graph: &Graph) {
        for (device, cell) in graph.devices().iter().filter_map(cell) {
            for listener in &self.0 {
                let mut readers = listener.readers.list();
                let own = readers.iter_mut().filter(|reader| Arc::ptr_eq(&reader.link.input, &cell));
                own.for_each(|reader| device.name.clone_into(&mut reader.device));
            }
        }
    }

    fn status(&self) -> Vec<Connected> {
        self.each_reader(|address, reader| {
            Connected::link(&reader.device, format!("{address} {}", reader.field))
        })
    }

    fn counts(&self) -> Vec<Counts> {
        self.each_reader(|_, reader| packets(&reader.link))
    }
}

/// Counts of a link.
pub(crate) fn packets(link: &Link) -> Counts {
    Counts::Packets(link.counts(), link.unclaimed.list())
}

/// A device that can fall silent, and the state that it shares with its link.
pub(crate) fn cell(device: &GraphDevice) -> Option<(&GraphDevice, Arc<InputCell>)> {
    Some((device, device.device().live_input()?.cell))
}
