//! Numbers by Open Sound Control: one argument of the messages to one address.

use super::packet::{decode, each_message};
use crate::numbers::{NumberSource, Readers};
use crate::udp::WAIT;
use haptograph_nodes::network::inputs::{OscInput, OscInputSettings};
use haptograph_nodes::network::link::Count;
use rosc::{OscMessage, OscType};
use std::fmt;
use std::io::{Error, Result};
use std::net::{SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread::JoinHandle;

/// An address at which numbers arrive.
pub(super) struct OscPort;

impl NumberSource for OscPort {
    type Kind = OscInput;
    type Address = SocketAddr;
    type Field = OscSelector;

    fn locate(settings: &OscInputSettings) -> Result<(SocketAddr, OscSelector)> {
        let selector =
            OscSelector { address: settings.address.clone(), argument: settings.argument as usize };
        Ok((settings.listen().map_err(Error::other)?, selector))
    }

    fn listen(
        address: &SocketAddr,
        readers: Readers<OscSelector>,
        stop: Arc<AtomicBool>,
    ) -> Result<JoinHandle<()>> {
        let socket = UdpSocket::bind(address)?;
        socket.set_read_timeout(Some(WAIT))?;
        std::thread::Builder::new().name(format!("input {address}")).spawn(move || {
            let mut bytes = [0; 65_536];
            while !stop.load(Relaxed) {
                // Other results are timeouts.
                if let Ok(count) = socket.recv(&mut bytes) {
                    take(&bytes[..count], &readers);
                }
            }
        })
    }
}

/// One argument, counted from 1, of the messages to one address.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct OscSelector {
    address: String,
    argument: usize,
}

impl fmt::Display for OscSelector {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} argument {}", self.address, self.argument)
    }
}

impl OscSelector {
    /// The number in a message; `None` for a message to another address.
    fn number(&self, message: &OscMessage) -> Option<std::result::Result<f64, Count>> {
        if message.addr != self.address {
            return None;
        }
        let number = match message.args.get(self.argument - 1) {
            Some(OscType::Float(x)) => f64::from(*x),
            Some(OscType::Double(x)) => *x,
            Some(OscType::Int(x)) => f64::from(*x),
            Some(OscType::Bool(on)) => f64::from(u8::from(*on)),
            _ => return Some(Err(Count::Malformed)),
        };
        Some(Ok(number))
    }
}

/// Publishes the numbers of a packet to their readers.
fn take(bytes: &[u8], readers: &Readers<OscSelector>) {
    match decode(bytes) {
        Ok(packet) => each_message(&packet, &mut |message: &OscMessage| {
            readers.publish(|selector| selector.number(message));
            let list = readers.list();
            if !list.iter().any(|reader| reader.field.address == message.addr) {
                list.iter().for_each(|reader| reader.link.count_unclaimed(&message.addr));
            }
        }),
        Err(what) => readers.publish(|_| Some(Err(what))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numbers::Reader;
    use haptograph_nodes::network::link::Link;
    use proptest::prelude::*;
    use rosc::OscPacket;
    use std::time::Duration;

    fn packet(addr: &str, args: Vec<OscType>) -> Vec<u8> {
        let addr = addr.to_owned();
        rosc::encoder::encode(&OscPacket::Message(OscMessage { addr, args })).unwrap()
    }

    /// A listener for the second argument of `/knob`.
    fn second() -> (Readers<OscSelector>, Arc<Link>) {
        let selector = OscSelector { address: "/knob".to_owned(), argument: 2 };
        let reader = Reader::new("knob", selector, Duration::from_secs(1));
        let (readers, link) = (Readers::default(), Arc::clone(&reader.link));
        readers.list().push(reader);
        (readers, link)
    }

    fn latest(link: &Link) -> f64 {
        link.sensed.look().unwrap().1[0]
    }

    #[test]
    fn the_selected_argument_is_taken_and_other_messages_are_counted() {
        let (readers, link) = second();
        take(&packet("/knob", vec![OscType::Float(1.0), OscType::Int(7)]), &readers);
        take(&packet("/other", vec![OscType::Float(1.0), OscType::Int(9)]), &readers);
        assert_eq!((latest(&link), link.counts().accepted), (7.0, 1));
        assert_eq!(link.unclaimed.list(), [("/other".to_owned(), 1)]);
        take(&packet("/knob", vec![OscType::Nil, OscType::Bool(true)]), &readers);
        assert_eq!(latest(&link), 1.0);
    }

    #[test]
    fn an_invalid_number_is_counted_and_changes_nothing() {
        let (readers, link) = second();
        take(&packet("/knob", vec![OscType::Int(0), OscType::Float(f32::INFINITY)]), &readers);
        take(&packet("/knob", vec![OscType::Int(0)]), &readers);
        take(b"/knob", &readers);
        let counts = link.counts();
        assert_eq!((counts.accepted, counts.not_numbers, counts.malformed), (0, 1, 2));
    }

    #[test]
    fn a_bounded_number_of_unclaimed_addresses_is_kept() {
        let (readers, link) = second();
        for times in 0..3 {
            for address in 0..=times * 20 {
                take(&packet(&format!("/{address}"), vec![OscType::Int(1)]), &readers);
            }
        }
        let kept = link.unclaimed.list();
        assert_eq!((kept.len(), &kept[0]), (16, &("/0".to_owned(), 3)));
        assert_eq!(link.counts().unclaimed, 1 + 21 + 41);
    }

    proptest! {
        #[test]
        fn any_bytes_are_survived(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            let (readers, link) = second();
            take(&bytes, &readers);
            prop_assert!(link.counts().accepted == 0 || latest(&link).is_finite());
        }
    }
}
