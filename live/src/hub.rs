//! Inputs of one number each that share an address or a port: a hub listens there for all of them, on one thread.

use crate::backend::{Backend, BackendError, Connected, Counts};
use haptograph_engine::device::DeviceKind;
use haptograph_engine::graph::{Graph, GraphDevice};
use haptograph_engine::silence::InputCell;
use haptograph_nodes::network::inputs::NumberInput;
use haptograph_nodes::network::link::Link;
use std::fmt::{Debug, Display};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

/// A kind of place at which numbers arrive.
pub(crate) trait Port: Send + 'static {
    /// The kind of its inputs.
    type Kind: DeviceKind;
    /// An address or a port, with the settings that all of its inputs share.
    type Place: Clone + PartialEq + Display + Debug + Send;
    /// Selects a number there.
    type Selector: Clone + PartialEq + Display + Debug + Send;

    /// The selector of an input, and the place where it listens.
    fn select(
        settings: &<Self::Kind as DeviceKind>::Settings,
    ) -> std::io::Result<(Self::Place, Self::Selector)>;

    /// True if both places are the same, whatever their settings.
    fn is_same(one: &Self::Place, other: &Self::Place) -> bool {
        one == other
    }

    /// Publishes the numbers of the routes until `stop`, on a thread of its own.
    ///
    /// # Errors
    /// The system's error if the place cannot be opened.
    fn listen(
        place: &Self::Place,
        routes: Routes<Self::Selector>,
        stop: Arc<AtomicBool>,
    ) -> std::io::Result<JoinHandle<()>>;
}

/// A selected number and its link.
#[derive(Debug, Clone)]
pub(crate) struct Route<S> {
    /// Name of the endpoint.
    pub device: String,
    pub selector: S,
    /// Silence after which its input counts as gone.
    pub timeout: Duration,
    pub link: Arc<Link>,
    /// True if the connection was added by the last open.
    pub is_new: bool,
}

impl<S> Route<S> {
    /// A new route with a link of its own.
    pub fn new(device: &str, selector: S, timeout: Duration) -> Self {
        Self {
            device: device.to_owned(),
            selector,
            timeout,
            link: Arc::default(),
            is_new: true,
        }
    }
}

/// The routes of a place. No real-time thread uses them.
#[derive(Debug)]
pub(crate) struct Routes<S>(Arc<Mutex<Vec<Route<S>>>>);

impl<S> Clone for Routes<S> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

impl<S> Default for Routes<S> {
    fn default() -> Self {
        Self(Arc::default())
    }
}

impl<S> Routes<S> {
    /// The present routes.
    pub fn list(&self) -> MutexGuard<'_, Vec<Route<S>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Listens at a place until it is dropped.
#[derive(Debug)]
pub(crate) struct Hub<P: Port> {
    place: P::Place,
    routes: Routes<P::Selector>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    is_new: bool,
}

impl<P: Port> Hub<P> {
    /// Starts to listen, without routes.
    ///
    /// # Errors
    /// The system's error if the place cannot be opened.
    pub fn open(place: &P::Place) -> std::io::Result<Self> {
        let (routes, stop) = (Routes::default(), Arc::<AtomicBool>::default());
        let thread = P::listen(place, routes.clone(), Arc::clone(&stop))?;
        Ok(Self {
            place: place.clone(),
            routes,
            stop,
            thread: Some(thread),
            is_new: true,
        })
    }

    /// The link of an input: that of an input that selects the same, or a new one.
    pub fn link(&self, device: &str, selector: P::Selector, timeout: Duration) -> Arc<Link> {
        let mut routes = self.routes.list();
        // Silence depends on the timeout: inputs with another timeout have their own links.
        let is_it = |route: &&Route<P::Selector>| route.selector == selector && route.timeout == timeout;
        if let Some(known) = routes.iter().find(is_it) {
            return Arc::clone(&known.link);
        }
        let route = Route::new(device, selector, timeout);
        let link = Arc::clone(&route.link);
        routes.push(route);
        link
    }
}

impl<P: Port> Drop for Hub<P> {
    fn drop(&mut self) {
        crate::end(&self.stop, &mut self.thread);
    }
}

/// The inputs of a kind of place.
pub(crate) struct Hubs<P: Port>(Vec<Hub<P>>);

impl<P: Port> Hubs<P> {
    /// Without connections, as a backend.
    pub fn boxed() -> Box<dyn Backend> {
        Box::new(Self(Vec::new()))
    }

    /// The link of an input, at the hub of its place, which is opened if there is none.
    fn link(
        &mut self,
        device: &str,
        (place, selector): (P::Place, P::Selector),
        timeout: Duration,
    ) -> Result<Arc<Link>, BackendError> {
        let hub = match self.0.iter().position(|hub| P::is_same(&hub.place, &place)) {
            Some(known) if self.0[known].place == place => known,
            Some(_) => return Err(BackendError::Differ(device.to_owned(), place.to_string())),
            None => {
                let opened = Hub::open(&place).map_err(|error| failed(device, &place, error))?;
                self.0.push(opened);
                self.0.len() - 1
            }
        };
        Ok(self.0[hub].link(device, selector, timeout))
    }
}

fn failed(device: &str, place: &impl Display, error: std::io::Error) -> BackendError {
    BackendError::Place {
        device: device.to_owned(),
        place: place.to_string(),
        error,
    }
}

impl<P: Port> Backend for Hubs<P> {
    fn open(&mut self, graph: &mut Graph) -> Result<(), BackendError> {
        for hub in &mut self.0 {
            hub.is_new = false;
            hub.routes
                .list()
                .iter_mut()
                .for_each(|route| route.is_new = false);
        }
        for device in 0..graph.devices().len() {
            let known = &graph.devices()[device];
            let name = known.name.clone();
            let Some(settings) = known.settings::<P::Kind>() else {
                continue;
            };
            let selected = P::select(settings).map_err(|error| failed(&name, &"its place", error))?;
            if let Some(body) = graph.body_mut::<NumberInput>(device) {
                body.attach(&self.link(&name, selected, body.timeout())?);
            }
        }
        Ok(())
    }

    fn undo(&mut self) {
        self.0.retain(|hub| !hub.is_new);
        for hub in &self.0 {
            hub.routes.list().retain(|route| !route.is_new);
        }
    }

    fn keep(&mut self, graph: &Graph) {
        for (device, cell) in graph.devices().iter().filter_map(cell) {
            for hub in &self.0 {
                let mut routes = hub.routes.list();
                let own = routes
                    .iter_mut()
                    .filter(|route| Arc::ptr_eq(&route.link.input, &cell));
                own.for_each(|route| device.name.clone_into(&mut route.device));
            }
        }
    }

    fn status(&self) -> Vec<Connected> {
        let routes = |hub: &Hub<P>| -> Vec<Connected> {
            let routes = hub.routes.list();
            let link = |route: &Route<P::Selector>| {
                Connected::link(&route.device, format!("{} {}", hub.place, route.selector))
            };
            routes.iter().map(link).collect()
        };
        self.0.iter().flat_map(routes).collect()
    }

    fn counts(&self) -> Vec<Counts> {
        let routes = |hub: &Hub<P>| -> Vec<Counts> {
            let routes = hub.routes.list();
            routes.iter().map(|route| packets(&route.link)).collect()
        };
        self.0.iter().flat_map(routes).collect()
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
