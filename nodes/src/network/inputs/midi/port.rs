//! MIDI ports of this machine, and the thread that listens to one.

use super::super::hub::{Routes, Selector};
use super::event::Event;
use crate::network::link::Link;
use midir::{Ignore, MidiInput, MidiInputConnection};
use std::io::{Error, Result};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Name of this program among the system's MIDI clients.
const CLIENT: &str = "haptograph";
/// Time between reports that a port is present: a fifth of the silence that counts as gone.
const ALIVE: Duration = Duration::from_millis(10);
/// Time between attempts to find the port.
const LOOK: Duration = Duration::from_millis(100);
/// Silence after which the port is reopened: a port that was unplugged and replugged between two polls has its old name, but the
/// old connection receives nothing.
const IDLE: Duration = Duration::from_secs(1);
/// Size of the message queue. If it overflows, all keys count as released, because a release may be lost.
const MOST_WAITING: usize = 1024;

/// Names of the input ports.
///
/// # Errors
/// The system's error if it has no MIDI.
pub fn names() -> Result<Vec<String>> {
    let input = MidiInput::new(CLIENT).map_err(Error::other)?;
    let ports = input.ports();
    Ok(ports
        .iter()
        .filter_map(|port| input.port_name(port).ok())
        .collect())
}

/// An open port, by its full name, and the links updated since.
struct Open {
    name: String,
    told: Vec<Arc<Link>>,
    _connection: MidiInputConnection<()>,
}

/// Queue that the system's callback fills.
#[derive(Clone)]
struct Inbox {
    events: SyncSender<Event>,
    /// A message was lost.
    overflowed: Arc<AtomicBool>,
}

/// Opens the port of this name, or else the first port whose name contains it.
fn open(part: &str, inbox: Inbox) -> Result<Open> {
    let mut input = MidiInput::new(CLIENT).map_err(Error::other)?;
    input.ignore(Ignore::All);
    let ports = input.ports();
    let is_it = |port: &&midir::MidiInputPort| input.port_name(port).is_ok_and(|name| name.contains(part));
    let is_exactly = |port: &&midir::MidiInputPort| input.port_name(port).is_ok_and(|name| name == part);
    let exact = ports.iter().find(is_exactly);
    let Some(port) = exact.or_else(|| ports.iter().find(is_it)).cloned() else {
        let found = match names()?.join("`, `") {
            none if none.is_empty() => "there is none".to_owned(),
            names => format!("there are `{names}`"),
        };
        return Err(Error::other(format!(
            "no MIDI port has `{part}` in its name; {found}"
        )));
    };
    let hear = move |_: u64, bytes: &[u8], (): &mut ()| {
        if let Some(event) = Event::understand(bytes) {
            // Do not wait if the queue is full.
            if inbox.events.try_send(event).is_err() {
                inbox.overflowed.store(true, Relaxed);
            }
        }
    };
    let name = input.port_name(&port).map_err(Error::other)?;
    let connection = input.connect(&port, CLIENT, hear, ());
    Ok(Open {
        name,
        told: Vec::new(),
        _connection: connection.map_err(|error| Error::other(error.to_string()))?,
    })
}

/// Listens to a port until `stop`, on a separate thread, and reopens one that was unplugged.
pub(in super::super) fn listen(part: &str, routes: Routes, stop: Arc<AtomicBool>) -> Result<JoinHandle<()>> {
    let (events, arrived) = sync_channel(MOST_WAITING);
    let inbox = Inbox {
        events,
        overflowed: Arc::default(),
    };
    let (opened, outcome) = sync_channel(1);
    let part = part.to_owned();
    let thread = std::thread::Builder::new()
        .name(format!("input {part}"))
        .spawn(move || {
            let first = open(&part, inbox.clone());
            let connection = match first {
                Ok(connection) => {
                    let _ = opened.send(Ok(()));
                    connection
                }
                Err(error) => {
                    let _ = opened.send(Err(error));
                    return;
                }
            };
            attend(&part, (connection, inbox), &arrived, &routes, &stop);
        })?;
    outcome.recv().map_err(Error::other)??;
    Ok(thread)
}

/// Processes messages, reports that the port is present, and looks for one that is gone.
fn attend(
    part: &str,
    (connection, inbox): (Open, Inbox),
    arrived: &Receiver<Event>,
    routes: &Routes,
    stop: &AtomicBool,
) {
    let mut connection = Some(connection);
    let (mut looked, mut heard) = (Instant::now(), Instant::now());
    while !stop.load(Relaxed) {
        let first = arrived.recv_timeout(ALIVE).ok();
        for event in first.into_iter().chain(arrived.try_iter()) {
            heard = Instant::now();
            take(event, routes, connection.as_mut());
        }
        if inbox.overflowed.swap(false, Relaxed) {
            let_go(routes);
        }
        if let Some(open) = &connection {
            open.told.iter().for_each(|link| stay(link));
        }
        if looked.elapsed() >= LOOK {
            looked = Instant::now();
            let names = names().unwrap_or_default();
            connection = connection.filter(|open| names.contains(&open.name));
            if let Some(known) = connection.take_if(|_| heard.elapsed() >= IDLE) {
                heard = Instant::now();
                // Values hold: whether the port was gone is unknown.
                connection = open(&known.name, inbox.clone()).ok().map(|anew| Open {
                    told: known.told,
                    ..anew
                });
            }
            connection = connection.or_else(|| open(part, inbox.clone()).ok());
        }
    }
}

/// Releases all keys.
fn let_go(routes: &Routes) {
    for route in &*routes.list() {
        if matches!(&route.selector, Selector::Midi(selector) if selector.is_key()) {
            route.link.tell_number(0.0);
        }
    }
}

fn take(event: Event, routes: &Routes, mut open: Option<&mut Open>) {
    for route in &*routes.list() {
        let Selector::Midi(selector) = &route.selector else {
            continue;
        };
        if let Some(share) = event.number(selector) {
            route.link.tell_number(share);
            if let Some(open) = &mut open
                && !open.told.iter().any(|link| Arc::ptr_eq(link, &route.link))
            {
                open.told.push(Arc::clone(&route.link));
            }
        }
    }
}

/// A value holds while its port is present. Values of another port do not hold, because a key that
/// was held may be released.
fn stay(link: &Link) {
    if let Some((1.., sensed)) = link.sensed.look() {
        link.tell_number(sensed[0]);
    }
}
