//! The thread that listens at one place for all inputs there.

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

/// Where inputs are heard.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in crate::network) enum Place {
    /// Open Sound Control at an address.
    Osc(SocketAddr),
    /// A serial port at a rate.
    Serial { path: PathBuf, baud: u32 },
    /// A MIDI port by a part of its name.
    Midi(String),
}

impl Place {
    /// Is it one place, whatever its settings?
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

/// Which of the numbers there.
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

/// A number that is listened for, and to whom it goes.
#[derive(Debug, Clone)]
pub(in crate::network) struct Route {
    pub selector: Selector,
    pub link: Arc<Link>,
}

/// The routes of a place. No real-time thread looks at them.
#[derive(Debug, Clone, Default)]
pub(super) struct Routes(Arc<Mutex<Vec<Route>>>);

impl Routes {
    /// All of them, as they are now.
    pub fn list(&self) -> MutexGuard<'_, Vec<Route>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A place that is listened at, until it is dropped.
#[derive(Debug)]
pub(in crate::network) struct Hub {
    place: Place,
    routes: Routes,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Hub {
    /// Begins to listen, to nothing yet.
    ///
    /// # Errors
    /// What the system says where the place cannot be listened at.
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

    /// Does it listen at this place?
    pub fn is_at(&self, place: &Place) -> bool {
        self.place.is_at(place)
    }

    /// Does it listen there in the way that is asked for?
    pub fn is_as(&self, place: &Place) -> bool {
        self.place == *place
    }

    /// From now on this number is listened for too. Was it not before?
    pub fn add(&self, route: &Route) -> bool {
        let mut routes = self.routes.list();
        let is_new = !routes.iter().any(|known| Arc::ptr_eq(&known.link, &route.link));
        if is_new {
            routes.push(route.clone());
        }
        is_new
    }

    /// Goes on with those routes only whose links are wanted.
    pub fn retain(&self, is_wanted: impl Fn(&Arc<Link>) -> bool) {
        self.routes.list().retain(|route| is_wanted(&route.link));
    }
}

impl Drop for Hub {
    fn drop(&mut self) {
        end(&self.stop, &mut self.thread);
    }
}
