//! Devices that speak Open Sound Control: SuperCollider, Max, Pure Data, TouchOSC.

use super::link::{Count, DRIVEN, SENSED};
use super::protocol::are_within_reason;
use super::remote::{DRIVES, Remote, SENSES, Watch, Way, address, link_at, place_of};
use super::socket::{Codec, Plug};
use haptograph_engine::device::{Device, DeviceKind, DeviceSpec};
use haptograph_engine::node::{BuildContext, BuildError};
use haptograph_engine::silence::OnSilence;
use rosc::{OscMessage, OscPacket, OscType};
use std::net::{SocketAddr, UdpSocket};
use std::sync::Arc;
use std::time::{Duration, Instant};

haptograph_engine::settings! {
    /// A device of which another program tells by Open Sound Control.
    pub struct OscDeviceSettings {
        /// Address and port at which to listen.
        listen: String = "127.0.0.1:9751".to_owned();
        /// OSC address of the tip's position: two or three numbers, mm.
        position: String = "/position".to_owned();
        /// OSC address of the force: one number, the normal force, or three, N.
        force: String = "/force".to_owned();
        /// Address and port to which drives are told as `/force` (N) and `/current` and `/brake` (A); none: to nobody.
        send_to: Option<String> = None;
        /// How often they are told, Hz.
        send_rate_hz: f64 = 50.0, in 0.1..=200.0;
        /// Silence after which it counts as gone, ms. Many programs only speak of what changes.
        timeout_ms: f64 = 1000.0, in 1.0..=10_000.0;
        /// What its silence does to the actuators that depend on it; those that it is itself are at zero meanwhile.
        on_silence: OnSilence = OnSilence::Zero;
        /// A tip that seems to move faster has jumped, mm/s.
        fastest_mm_s: f64 = 5000.0, in 1.0..=1e6;
    }
}

/// A device that another program owns and tells of by Open Sound Control.
pub struct OscDevice;

impl DeviceKind for OscDevice {
    type Settings = OscDeviceSettings;
    const SPEC: DeviceSpec = DeviceSpec {
        name: "OscDevice",
        doc: "A device that another program owns, by Open Sound Control over UDP. It is reached in live runs only. While it \
              is silent or jumps, its drives are at zero; while it is silent, so is every actuator that depends on it, \
              unless `on_silence` is `Hold`, for senders that only speak of what changes. For a force loop the device protocol of `UdpDevice` is the \
              better one: it answers every packet.",
        source: "",
        simulated: false,
        senses: SENSES,
        drives: DRIVES,
        example: r#""stylus": OscDevice(listen: "127.0.0.1:9751", position: "/pen/xy", force: "/pen/pressure")"#,
    };

    fn build(settings: OscDeviceSettings, cx: &BuildContext) -> Result<Box<dyn Device>, BuildError> {
        for (field, text) in [("position", &settings.position), ("force", &settings.force)] {
            if !text.starts_with('/') {
                let message = format!("`{text}` is not an OSC address");
                return Err(
                    BuildError::at(field, message).help("OSC addresses begin with a slash: \"/pen/xy\"")
                );
            }
        }
        let send_to = settings.send_to.map(|to| address("send_to", &to)).transpose()?;
        let listen = address("listen", &settings.listen)?;
        let addresses = Addresses {
            position: settings.position,
            force: settings.force,
            send_to,
            every: Duration::from_secs_f64(1.0 / settings.send_rate_hz),
        };
        let plug = Plug {
            link: link_at(&place_of(&settings.listen, &cx.path)),
            listen,
            only: None,
            timeout: Duration::from_secs_f64(settings.timeout_ms * 1e-3),
            codec: Codec::Osc(Arc::new(addresses)),
        };
        let watch = Watch {
            timeout: plug.timeout,
            fastest_m_s: settings.fastest_mm_s * 1e-3,
            holds: settings.on_silence == OnSilence::Hold,
        };
        Ok(Box::new(Remote::new(Way::Socket(plug), watch, cx)))
    }
}

/// Bundles in a packet, one within the other or beside it.
const MAX_BUNDLES: usize = 8;
/// Arrays in a packet, or brackets in its texts; nobody here reads arrays.
const MAX_ARRAYS: usize = 64;

/// The packet that `bytes` are, all of them.
pub(super) fn decode(bytes: &[u8]) -> Result<OscPacket, Count> {
    // The decoder follows bundles within bundles as deep as they go.
    if bytes.windows(8).filter(|word| word == b"#bundle\0").count() > MAX_BUNDLES {
        return Err(Count::Malformed);
    }
    // It builds arrays within arrays without end, and taking these apart again overflows the stack.
    if bytes.iter().filter(|byte| **byte == b'[').count() > MAX_ARRAYS {
        return Err(Count::Malformed);
    }
    match rosc::decoder::decode_udp(bytes) {
        Ok(([], packet)) => Ok(packet),
        _ => Err(Count::Malformed),
    }
}

/// Does something with every message of a packet; bundles are taken at once.
pub(super) fn each_message(packet: &OscPacket, each: &mut impl FnMut(&OscMessage)) {
    match packet {
        OscPacket::Message(message) => each(message),
        OscPacket::Bundle(bundle) => bundle.content.iter().for_each(|inner| each_message(inner, each)),
    }
}

/// What is said where.
#[derive(Debug, PartialEq)]
pub(super) struct Addresses {
    position: String,
    force: String,
    send_to: Option<SocketAddr>,
    every: Duration,
}

impl Addresses {
    /// Takes what a packet says of the device, if anything. Messages to other addresses are no fault, and bundles are
    /// taken at once.
    pub fn understand(&self, bytes: &[u8], sensed: &mut [f64; SENSED]) -> Result<bool, Count> {
        let packet = decode(bytes)?;
        let mut news = *sensed;
        let told = self.take(&packet, &mut news)?;
        if !are_within_reason(&news) {
            return Err(Count::TooLarge);
        }
        *sensed = news;
        Ok(told)
    }

    fn take(&self, packet: &OscPacket, sensed: &mut [f64; SENSED]) -> Result<bool, Count> {
        match packet {
            OscPacket::Bundle(bundle) => bundle
                .content
                .iter()
                .try_fold(false, |told, inner| Ok(told | self.take(inner, sensed)?)),
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

    pub fn teller(&self) -> Option<Teller> {
        self.send_to.map(|to| Teller {
            to,
            every: self.every,
            next: Instant::now(),
        })
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
    if numbers.iter().all(|x| x.is_finite()) {
        Ok(numbers)
    } else {
        Err(Count::NotNumbers)
    }
}

/// Who is told of the drives, and when.
#[derive(Debug)]
pub(super) struct Teller {
    to: SocketAddr,
    every: Duration,
    next: Instant,
}

impl Teller {
    pub fn is_due(&mut self) -> bool {
        let now = Instant::now();
        let due = now >= self.next;
        if due {
            // What was missed is not made up for.
            self.next = now + self.every;
        }
        due
    }

    pub fn tell(&self, socket: &UdpSocket, driven: &[f64; DRIVEN]) {
        let [x, y, z, current, brake] = driven.map(|value| OscType::Float(value as f32));
        for (addr, args) in [
            ("/force", vec![x, y, z]),
            ("/current", vec![current]),
            ("/brake", vec![brake]),
        ] {
            let message = OscMessage {
                addr: addr.to_owned(),
                args,
            };
            if let Ok(bytes) = rosc::encoder::encode(&OscPacket::Message(message)) {
                // Nobody may be there: the next message tells the same.
                let _ = socket.send_to(&bytes, self.to);
            }
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
    fn millimetres_and_newtons_are_understood_and_other_messages_left_alone() {
        let (addresses, mut sensed) = (addresses(), [0.0; SENSED]);
        let position = packet("/pen/xy", vec![OscType::Int(10), OscType::Double(-20.0)]);
        let force = packet("/pen/pressure", vec![OscType::Float(1.5)]);
        let tempo = packet("/tempo", vec![OscType::Nil]);
        let told = [position, force, tempo].map(|bytes| addresses.understand(&bytes, &mut sensed).unwrap());
        assert_eq!(told, [true, true, false]);
        assert_eq!((sensed[0], sensed[1], sensed[8]), (0.01, -0.02, 1.5));
    }

    #[test]
    fn what_is_wrong_changes_nothing() {
        let (addresses, mut sensed) = (addresses(), [0.5; SENSED]);
        let nan = packet("/pen/xy", vec![OscType::Float(f32::NAN), OscType::Float(0.0)]);
        assert!(matches!(
            addresses.understand(&nan, &mut sensed),
            Err(Count::NotNumbers)
        ));
        let far = packet("/pen/xy", vec![OscType::Float(1e30), OscType::Float(0.0)]);
        assert!(matches!(
            addresses.understand(&far, &mut sensed),
            Err(Count::TooLarge)
        ));
        let four = packet("/pen/xy", vec![OscType::Int(1); 4]);
        assert!(matches!(
            addresses.understand(&four, &mut sensed),
            Err(Count::Malformed)
        ));
        let deep: Vec<u8> = (0..3000)
            .rev()
            .flat_map(|k: u32| [&b"#bundle\0\0\0\0\0\0\0\0\x01"[..], &(20 * k).to_be_bytes()].concat())
            .collect();
        assert!(matches!(
            addresses.understand(&deep, &mut sensed),
            Err(Count::Malformed)
        ));
        for length in 0..four.len() {
            let _ = addresses.understand(&four[..length], &mut sensed);
        }
        assert_eq!(sensed, [0.5; SENSED]);
    }
}
