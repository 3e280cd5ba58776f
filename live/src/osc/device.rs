//! Devices that use Open Sound Control: SuperCollider, Max, Pure Data, TouchOSC.

use super::packet::decode;
use crate::udp::are_in_range;
use haptograph_nodes::network::OscDeviceSettings;
use haptograph_nodes::network::link::{Count, DRIVEN, SENSED};
use rosc::{OscMessage, OscPacket, OscType};
use std::net::{SocketAddr, UdpSocket};
use std::time::{Duration, Instant};

/// The OSC addresses of a device, and where its commands go.
#[derive(Debug, PartialEq)]
pub(crate) struct Addresses {
    position: String,
    force: String,
    pub(crate) send_to: Option<SocketAddr>,
    every: Duration,
}

impl Addresses {
    /// The addresses of a device whose commands go to `send_to`.
    pub(crate) fn new(settings: &OscDeviceSettings, send_to: Option<SocketAddr>) -> Self {
        Self {
            position: settings.position.clone(),
            force: settings.force.clone(),
            send_to,
            every: Duration::from_secs_f64(1.0 / settings.send_rate_hz),
        }
    }

    /// Reads the state of the device out of a packet. Returns whether there was any: messages to other addresses are no
    /// error. Bundles apply at once.
    pub(crate) fn read(&self, bytes: &[u8], sensed: &mut [f64; SENSED]) -> Result<bool, Count> {
        let packet = decode(bytes)?;
        let mut new = *sensed;
        let has_state = self.read_packet(&packet, &mut new)?;
        if !are_in_range(&new) {
            return Err(Count::TooLarge);
        }
        *sensed = new;
        Ok(has_state)
    }

    fn read_packet(&self, packet: &OscPacket, sensed: &mut [f64; SENSED]) -> Result<bool, Count> {
        match packet {
            OscPacket::Bundle(bundle) => bundle
                .content
                .iter()
                .try_fold(false, |has_state, inner| Ok(has_state | self.read_packet(inner, sensed)?)),
            OscPacket::Message(message) if message.addr == self.position => {
                match numbers(message)?[..] {
                    [x, y] => sensed[..3].copy_from_slice(&[1e-3 * x, 1e-3 * y, 0.0]),
                    [x, y, z] => sensed[..3].copy_from_slice(&[1e-3 * x, 1e-3 * y, 1e-3 * z]),
                    _ => return Err(Count::Malformed),
                }
                Ok(true)
            }
            OscPacket::Message(message) if message.addr == self.force => {
                match numbers(message)?[..] {
                    [normal] => sensed[6..9].copy_from_slice(&[0.0, 0.0, normal]),
                    [x, y, z] => sensed[6..9].copy_from_slice(&[x, y, z]),
                    _ => return Err(Count::Malformed),
                }
                Ok(true)
            }
            OscPacket::Message(_) => Ok(false),
        }
    }

    /// Sends commands, if they go anywhere.
    pub(crate) fn sender(&self) -> Option<OscSender> {
        self.send_to.map(|to| OscSender { to, every: self.every, next: Instant::now() })
    }
}

fn numbers(message: &OscMessage) -> Result<Vec<f64>, Count> {
    let number = |value: &OscType| match value {
        OscType::Float(x) => Ok(f64::from(*x)),
        OscType::Double(x) => Ok(*x),
        OscType::Int(x) => Ok(f64::from(*x)),
        _ => Err(Count::Malformed),
    };
    let numbers: Vec<f64> = message.args.iter().map(number).collect::<Result<_, _>>()?;
    if numbers.iter().all(|x| x.is_finite()) { Ok(numbers) } else { Err(Count::NotNumbers) }
}

/// Sends commands to an address at a fixed rate.
#[derive(Debug)]
pub(crate) struct OscSender {
    to: SocketAddr,
    every: Duration,
    next: Instant,
}

impl OscSender {
    /// True if the next command is due.
    pub(crate) fn is_due(&mut self) -> bool {
        let now = Instant::now();
        let due = now >= self.next;
        if due {
            // Missed commands are not sent later.
            self.next = now + self.every;
        }
        due
    }

    /// Sends a command.
    pub(crate) fn send(&self, socket: &UdpSocket, driven: &[f64; DRIVEN]) {
        send_driven(socket, self.to, driven);
    }
}

/// Sends a command to an address.
pub(crate) fn send_driven(socket: &UdpSocket, to: SocketAddr, driven: &[f64; DRIVEN]) {
    let [x, y, z, current, brake] = driven.map(|value| OscType::Float(value as f32));
    for (addr, args) in [("/force", vec![x, y, z]), ("/current", vec![current]), ("/brake", vec![brake])] {
        let message = OscMessage { addr: addr.to_owned(), args };
        if let Ok(bytes) = rosc::encoder::encode(&OscPacket::Message(message)) {
            // If nothing receives it, the next one replaces it.
            let _ = socket.send_to(&bytes, to);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn packet(addr: &str, args: Vec<OscType>) -> Vec<u8> {
        let addr = addr.to_owned();
        rosc::encoder::encode(&OscPacket::Message(OscMessage { addr, args })).unwrap()
    }

    #[test]
    fn arrays_within_arrays_are_refused_before_they_are_built() {
        const DEEP: usize = 32_700;
        let tags = format!(",{}{}", "[".repeat(DEEP), "]".repeat(DEEP));
        let mut bytes = b"/pen/xy\0".to_vec();
        bytes.extend(tags.as_bytes());
        bytes.resize(bytes.len().next_multiple_of(4) + 4, 0);
        assert!(matches!(decode(&bytes), Err(Count::Malformed)));
        assert!(decode(&packet("/[a]", vec![OscType::Float(1.0)])).is_ok());
    }

    fn addresses() -> Addresses {
        Addresses {
            position: "/pen/xy".to_owned(),
            force: "/pen/pressure".to_owned(),
            send_to: None,
            every: Duration::from_millis(20),
        }
    }

    #[test]
    fn millimetres_and_newtons_are_read_and_other_messages_ignored() {
        let (addresses, mut sensed) = (addresses(), [0.0; SENSED]);
        let position = packet("/pen/xy", vec![OscType::Int(10), OscType::Double(-20.0)]);
        let force = packet("/pen/pressure", vec![OscType::Float(1.5)]);
        let tempo = packet("/tempo", vec![OscType::Nil]);
        let has_state = [position, force, tempo].map(|bytes| addresses.read(&bytes, &mut sensed).unwrap());
        assert_eq!(has_state, [true, true, false]);
        assert_eq!((sensed[0], sensed[1], sensed[8]), (0.01, -0.02, 1.5));
    }

    #[test]
    fn an_invalid_packet_changes_nothing() {
        let (addresses, mut sensed) = (addresses(), [0.5; SENSED]);
        let nan = packet("/pen/xy", vec![OscType::Float(f32::NAN), OscType::Float(0.0)]);
        assert!(matches!(addresses.read(&nan, &mut sensed), Err(Count::NotNumbers)));
        let far = packet("/pen/xy", vec![OscType::Float(1e30), OscType::Float(0.0)]);
        assert!(matches!(addresses.read(&far, &mut sensed), Err(Count::TooLarge)));
        let four = packet("/pen/xy", vec![OscType::Int(1); 4]);
        assert!(matches!(addresses.read(&four, &mut sensed), Err(Count::Malformed)));
        let deep: Vec<u8> = (0..3000)
            .rev()
            .flat_map(|k: u32| [&b"#bundle\0\0\0\0\0\0\0\0\x01"[..], &(20 * k).to_be_bytes()].concat())
            .collect();
        assert!(matches!(addresses.read(&deep, &mut sensed), Err(Count::Malformed)));
        for length in 0..four.len() {
            let _ = addresses.read(&four[..length], &mut sensed);
        }
        assert_eq!(sensed, [0.5; SENSED]);
    }
}
