//! A connection to the Inverse Service.

use super::messages::State;
use crate::udp::WAIT;
use haptograph_nodes::network::link::Count;
use std::io::{Error, ErrorKind, Result};
use std::net::{SocketAddr, TcpStream};
use std::time::Duration;
use tungstenite::protocol::WebSocketConfig;
use tungstenite::{Message, WebSocket, client::client_with_config};

/// Longest wait for each step of opening a connection.
const OPENING: Duration = Duration::from_millis(500);
/// Size of the largest message: a hundred times that of an arm with its configuration.
const MAX_BYTES: usize = 128 * 1024;
/// Messages that may come ahead of the one that is wanted.
const AHEAD: usize = 8;

/// An open connection.
#[derive(Debug)]
pub(super) struct Service(WebSocket<TcpStream>);

/// A message, or none.
#[derive(Debug)]
pub(super) enum Received {
    State(State),
    /// A message that is none of the service's.
    Refused(Count),
    /// Nothing has come yet.
    Nothing,
    /// The connection is of no further use; something was refused.
    Lost(Option<Count>),
}

impl Service {
    /// Connects, and returns the first state, which lists everything that the service has.
    ///
    /// # Errors
    /// The error, with a remedy.
    pub(super) fn connect(address: SocketAddr) -> Result<(Self, State)> {
        let failed = |kind, error: &dyn std::fmt::Display| {
            let message = format!(
                "no Haply Inverse Service answers there ({error}); start it with Haply Hub, or on Linux by \
                 `systemctl start haply-inverse-service`"
            );
            Error::new(kind, message)
        };
        let of_system = |error: Error| failed(error.kind(), &error);
        let stream = TcpStream::connect_timeout(&address, OPENING).map_err(of_system)?;
        stream.set_nodelay(true).map_err(of_system)?;
        stream.set_read_timeout(Some(OPENING)).map_err(of_system)?;
        stream.set_write_timeout(Some(OPENING)).map_err(of_system)?;
        let config = WebSocketConfig::default()
            .read_buffer_size(MAX_BYTES)
            .max_message_size(Some(MAX_BYTES))
            .max_frame_size(Some(MAX_BYTES));
        let opened = client_with_config(format!("ws://{address}/"), stream, Some(config));
        let (socket, _) = opened.map_err(|error| failed(ErrorKind::InvalidData, &error))?;
        let mut service = Self(socket);
        for _ in 0..AHEAD {
            match service.receive() {
                Received::State(state) => {
                    service.0.get_ref().set_read_timeout(Some(WAIT)).map_err(of_system)?;
                    return Ok((service, state));
                }
                Received::Nothing => {}
                Received::Refused(_) | Received::Lost(_) => break,
            }
        }
        Err(failed(ErrorKind::InvalidData, &"something else listens, which sent no list of devices"))
    }

    /// Sends a message. False if the connection is of no further use.
    pub(super) fn send(&mut self, message: String) -> bool {
        self.0.send(Message::text(message)).is_ok()
    }

    /// Waits a moment for a message, and takes what else is there: the last state, or else the first message. `count` is told of
    /// messages behind a state that cannot be read.
    pub(super) fn latest(&mut self, count: impl Fn(Count)) -> Received {
        let mut latest = self.receive();
        for _ in 0..AHEAD {
            if !matches!(latest, Received::State(_)) || self.0.get_ref().set_nonblocking(true).is_err() {
                break;
            }
            let next = self.receive();
            if self.0.get_ref().set_nonblocking(false).is_err() {
                return Received::Lost(None);
            }
            match next {
                Received::Nothing => break,
                Received::Lost(what) => return Received::Lost(what),
                Received::State(_) => latest = next,
                Received::Refused(what) => count(what),
            }
        }
        latest
    }

    /// Waits a moment for a message.
    pub(super) fn receive(&mut self) -> Received {
        match self.0.read() {
            Ok(Message::Text(text)) => State::parse(&text).map_or_else(Received::Refused, Received::State),
            Ok(Message::Binary(_)) => Received::Refused(Count::Malformed),
            // Pings are answered by the next read or send.
            Ok(_) => Received::Nothing,
            Err(tungstenite::Error::Io(error)) if is_transient(&error) => Received::Nothing,
            Err(tungstenite::Error::Capacity(_)) => Received::Lost(Some(Count::TooLarge)),
            Err(tungstenite::Error::Utf8(_) | tungstenite::Error::Protocol(_)) => {
                Received::Lost(Some(Count::Malformed))
            }
            Err(_) => Received::Lost(None),
        }
    }

    /// Closes the connection, without waiting for the other end.
    pub(super) fn close(mut self) {
        // The end of the stream closes it, too.
        let _ = self.0.close(None).and_then(|()| self.0.flush());
    }
}

fn is_transient(error: &Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted)
}
