//! MIDI ports of this machine, and the thread that listens to one.

use super::event::{ByteStream, Event};
use super::selector::MidiSelector;
use crate::numbers::{NumberSource, Readers};
use haptograph_nodes::network::inputs::MidiInputSettings;
use haptograph_nodes::network::link::Link;
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
const PRESENCE_PERIOD: Duration = Duration::from_millis(10);
/// Time between attempts to find the port.
const LISTING_PERIOD: Duration = Duration::from_millis(100);
/// Silence after which the port is reopened: a port that was unplugged and replugged between two polls has its old name, but the
/// old connection receives nothing. By JACK it is not: that takes longer than a port may be silent.
const IDLE: Duration = match cfg!(feature = "midi-jack") {
    true => Duration::MAX,
    false => Duration::from_secs(1),
};
/// Size of the message queue. If it overflows, all keys count as released, because a release may be lost.
const MAX_WAITING: usize = 1024;

/// Names of the input ports.
///
/// # Errors
/// The system's error if it has no MIDI.
pub(super) fn names() -> Result<Vec<String>> {
    Ok(names_by(&MidiInput::new(CLIENT).map_err(Error::other)?))
}

fn names_by(client: &MidiInput) -> Vec<String> {
    let ports = client.ports();
    ports.iter().filter_map(|port| client.port_name(port).ok()).collect()
}

/// Lists the ports again and again by one client: to open one takes JACK longer than a port may be silent.
#[derive(Default)]
struct Lister(Option<MidiInput>);

impl Lister {
    fn names(&mut self) -> Vec<String> {
        let Some(client) = self.0.take().or_else(|| MidiInput::new(CLIENT).ok()) else {
            return Vec::new();
        };
        let names = names_by(&client);
        // A client of a server that has ended lists nothing; the next call opens another.
        self.0 = Some(client).filter(|_| !names.is_empty());
        names
    }
}

/// An open port, by its full name, and the links updated since.
struct Open {
    name: String,
    updated: Vec<Arc<Link>>,
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
        return Err(Error::other(format!("no MIDI port has `{part}` in its name; {found}")));
    };
    let mut stream = ByteStream::default();
    let receive = move |_: u64, bytes: &[u8], (): &mut ()| {
        for event in bytes.iter().filter_map(|byte| stream.take(*byte)) {
            // Do not wait if the queue is full.
            if inbox.events.try_send(event).is_err() {
                inbox.overflowed.store(true, Relaxed);
            }
        }
    };
    let name = input.port_name(&port).map_err(Error::other)?;
    let connection = input.connect(&port, CLIENT, receive, ());
    Ok(Open {
        name,
        updated: Vec::new(),
        _connection: connection.map_err(|error| Error::other(error.to_string()))?,
    })
}

/// A MIDI port, by part of its name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct PortName(String);

impl std::fmt::Display for PortName {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "MIDI port `{}`", self.0)
    }
}

/// Ports of the system's MIDI.
pub(super) struct MidiPort;

impl NumberSource for MidiPort {
    type Kind = haptograph_nodes::network::inputs::MidiInput;
    type Address = PortName;
    type Field = MidiSelector;

    fn locate(settings: &MidiInputSettings) -> Result<(PortName, MidiSelector)> {
        Ok((PortName(settings.port.clone()), MidiSelector::of(settings)))
    }

    fn listen(
        port: &PortName,
        readers: Readers<MidiSelector>,
        stop: Arc<AtomicBool>,
    ) -> Result<JoinHandle<()>> {
        listen(&port.0, readers, stop)
    }
}

/// Listens to a port until `stop`, on a separate thread, and reopens one that was unplugged.
fn listen(part: &str, readers: Readers<MidiSelector>, stop: Arc<AtomicBool>) -> Result<JoinHandle<()>> {
    let (events, arrived) = sync_channel(MAX_WAITING);
    let inbox = Inbox { events, overflowed: Arc::default() };
    let (opened, outcome) = sync_channel(1);
    let part = part.to_owned();
    let thread = std::thread::Builder::new().name(format!("input {part}")).spawn(move || {
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
        run(&part, (connection, inbox), &arrived, &readers, &stop);
    })?;
    outcome.recv().map_err(Error::other)??;
    Ok(thread)
}

/// Processes messages until `stop`, reports that the port is present, and reopens one that is gone.
fn run(
    part: &str,
    (connection, inbox): (Open, Inbox),
    arrived: &Receiver<Event>,
    readers: &Readers<MidiSelector>,
    stop: &AtomicBool,
) {
    let (mut connection, mut lister) = (Some(connection), Lister::default());
    let (mut last_listing, mut last_event) = (Instant::now(), Instant::now());
    while !stop.load(Relaxed) {
        let first = arrived.recv_timeout(PRESENCE_PERIOD).ok();
        for event in first.into_iter().chain(arrived.try_iter()) {
            last_event = Instant::now();
            take(event, readers, connection.as_mut());
        }
        if inbox.overflowed.swap(false, Relaxed) {
            release_keys(readers);
        }
        if let Some(open) = &connection {
            open.updated.iter().for_each(|link| publish_again(link));
        }
        if last_listing.elapsed() >= LISTING_PERIOD {
            last_listing = Instant::now();
            let names = lister.names();
            connection = connection.filter(|open| names.contains(&open.name));
            if let Some(known) = connection.take_if(|_| last_event.elapsed() >= IDLE) {
                last_event = Instant::now();
                // Values hold: whether the port was gone is unknown.
                connection =
                    open(&known.name, inbox.clone()).ok().map(|anew| Open { updated: known.updated, ..anew });
            }
            connection = connection.or_else(|| open(part, inbox.clone()).ok());
        }
    }
}

/// Releases all keys.
fn release_keys(readers: &Readers<MidiSelector>) {
    for reader in &*readers.list() {
        if reader.field.is_key() {
            reader.link.publish_number(0.0);
        }
    }
}

fn take(event: Event, readers: &Readers<MidiSelector>, mut open: Option<&mut Open>) {
    for reader in &*readers.list() {
        if let Some(share) = event.number(&reader.field) {
            reader.link.publish_number(share);
            if let Some(open) = &mut open
                && !open.updated.iter().any(|link| Arc::ptr_eq(link, &reader.link))
            {
                open.updated.push(Arc::clone(&reader.link));
            }
        }
    }
}

/// Publishes the last value again while its port is present. A value of a port that was closed is not, because a key that
/// was held may have been released.
fn publish_again(link: &Link) {
    if let Some((1.., sensed)) = link.sensed.look() {
        link.publish_number(sensed[0]);
    }
}

#[cfg(all(test, unix))]
#[path = "../../../tests/skip/mod.rs"]
mod skip;

#[cfg(all(test, unix))]
mod tests {
    use super::super::selector::Message;
    use super::*;
    use crate::numbers::Listener;
    use midir::os::unix::VirtualOutput;
    use midir::{MidiOutput, MidiOutputConnection};

    /// A port of the system that sends; none where the system has no MIDI.
    fn sender(name: &str) -> Option<MidiOutputConnection> {
        let output = MidiOutput::new("haptograph test").map_err(|error| error.to_string());
        let opened = output.and_then(|output| output.create_virtual(name).map_err(|error| error.to_string()));
        if let Err(error) = &opened {
            skip::skip(&format!("this machine has no MIDI: {error}"));
        }
        opened.ok()
    }

    fn reader(listener: &Listener<MidiPort>, message: Message) -> Arc<Link> {
        let channel = None;
        listener.link("knob", MidiSelector { message, channel }, Duration::from_millis(50))
    }

    /// Waits until a number is heard.
    fn hears(link: &Link, number: f64) -> bool {
        (0..5000).any(|_| {
            std::thread::sleep(Duration::from_millis(1));
            let heard = link.sensed.look();
            heard.is_some_and(|(version, sensed)| version > 0 && sensed[0] == number)
        })
    }

    #[test]
    fn a_port_of_the_system_is_heard_and_heard_again_after_it_was_gone() {
        let name = format!("knobs of {}", std::process::id());
        let Some(mut knobs) = sender(&name) else { return };
        assert!(names().unwrap().iter().any(|known| known.contains(&name)));
        let listener = Listener::<MidiPort>::open(&PortName(name.clone())).unwrap();
        let fader = reader(&listener, Message::Control(7));
        let key = reader(&listener, Message::Note(60));
        let wheel = reader(&listener, Message::PitchBend);
        knobs.send(&[0xb0, 7, 127]).unwrap();
        assert!(hears(&fader, 1.0));
        knobs.send(&[0x90, 60, 127]).unwrap();
        assert!(hears(&key, 1.0));
        knobs.send(&[0x80, 60, 64]).unwrap();
        assert!(hears(&key, 0.0));
        knobs.send(&[0xe0, 0, 64]).unwrap();
        assert!(hears(&wheel, 0.5));
        // Nobody's messages.
        for other in [&[0xc0, 7][..], &[0xf8], &[0xb0, 8, 1]] {
            knobs.send(other).unwrap();
        }
        knobs.send(&[0xb0, 7, 0]).unwrap();
        assert!(hears(&fader, 0.0) && hears(&wheel, 0.5));

        // Unplugged, and another time plugged in.
        drop(knobs);
        std::thread::sleep(5 * LISTING_PERIOD);
        let mut knobs = sender(&name).unwrap();
        let again = (0..100).any(|_| {
            knobs.send(&[0xb0, 7, 127]).unwrap();
            std::thread::sleep(Duration::from_millis(50));
            fader.sensed.look().is_some_and(|(_, sensed)| sensed[0] == 1.0)
        });
        assert!(again);
    }

    #[test]
    fn a_port_that_is_not_there_is_named() {
        let Some(_knobs) = sender("other knobs") else {
            return;
        };
        let refused = Listener::<MidiPort>::open(&PortName("no such port".to_owned())).err().unwrap();
        let said = refused.to_string();
        assert!(said.contains("`no such port`") && said.contains("other knobs"), "{said}");
    }
}
