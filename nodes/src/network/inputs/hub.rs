//! The hub: the thread that listens at one place for all inputs there.

use super::midi::{self, MidiSelector};
use super::osc::{self, OscSelector};
use super::serial;
use crate::network::link::Link;
use crate::network::socket::end;
use std::fmt;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

/// The place of an input.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in crate::network) enum Place {
    /// Open Sound Control at an address.
    Osc(SocketAddr),
    /// A serial port at a rate.
    Serial { path: PathBuf, baud: u32 },
    /// A MIDI port, by part of its name.
    Midi(String),
}

impl Place {
    /// Whether both are one place, whatever their settings.
    fn is_at(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Serial { path, .. }, Self::Serial { path: other, .. }) => path == other,
            _ => self == other,
        }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Osc(address) => write!(f, "{address}"),
            Self::Serial { path, .. } => write!(f, "{}", path.display()),
            Self::Midi(port) => write!(f, "MIDI port `{port}`"),
        }
    }
}

/// Selects a number at a place.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in crate::network) enum Selector {
    Osc(OscSelector),
    /// Counted from 1.
    Column(usize),
    Midi(MidiSelector),
}

impl fmt::Display for Selector {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Osc(selector) => selector.fmt(f),
            Self::Column(column) => write!(f, "column {column}"),
            Self::Midi(selector) => selector.fmt(f),
        }
    }
}

/// A selected number and its link.
#[derive(Debug, Clone)]
pub(in crate::network) struct Route {
    pub selector: Selector,
    pub link: Arc<Link>,
}

/// The routes of a place. No real-time thread uses them.
#[derive(Debug, Clone, Default)]
pub(super) struct Routes(Arc<Mutex<Vec<Route>>>);

impl Routes {
    /// The present routes.
    pub fn list(&self) -> MutexGuard<'_, Vec<Route>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Listens at a place until it is dropped.
#[derive(Debug)]
pub(in crate::network) struct Hub {
    place: Place,
    routes: Routes,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Hub {
    /// Starts to listen, without routes.
    ///
    /// # Errors
    /// The system's error if the place cannot be opened.
    pub fn open(place: &Place) -> std::io::Result<Self> {
        let (routes, stop) = (Routes::default(), Arc::<AtomicBool>::default());
        let (theirs, flag) = (routes.clone(), Arc::clone(&stop));
        let thread = match place {
            Place::Osc(address) => osc::listen(*address, theirs, flag)?,
            Place::Serial { path, baud } => serial::listen(path, *baud, theirs, flag)?,
            Place::Midi(port) => midi::listen(port, theirs, flag)?,
        };
        Ok(Self {
            place: place.clone(),
            routes,
            stop,
            thread: Some(thread),
        })
    }

    /// Whether it listens at this place.
    pub fn is_at(&self, place: &Place) -> bool {
        self.place.is_at(place)
    }

    /// Whether it listens there with these settings.
    pub fn is_as(&self, place: &Place) -> bool {
        self.place == *place
    }

    /// Adds a route. Returns whether it is new.
    pub fn add(&self, route: &Route) -> bool {
        let mut routes = self.routes.list();
        let is_new = !routes.iter().any(|known| Arc::ptr_eq(&known.link, &route.link));
        if is_new {
            routes.push(route.clone());
        }
        is_new
    }

    /// Keeps only the routes whose links are in use.
    pub fn retain(&self, is_wanted: impl Fn(&Arc<Link>) -> bool) {
        self.routes.list().retain(|route| is_wanted(&route.link));
    }
}

impl Drop for Hub {
    fn drop(&mut self) {
        end(&self.stop, &mut self.thread);
    }
}
