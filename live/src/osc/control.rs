//! Sets settings of a running graph by Open Sound Control: `/out/gain 0.5` is the setting `gain` of the node `out`,
//! `/mix/gains/1 0.5` the number `gains[1]` of the node `mix`, `/gain 0.5` the graph's parameter `gain`.

use super::packet::decode;
use crate::SettingValue;
use crate::udp::WAIT;
use rosc::{OscMessage, OscPacket, OscType};
use std::net::{SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::thread::JoinHandle;

/// A received setting: `out.gain` and its value.
#[derive(Debug, Clone, PartialEq)]
pub struct SetRequest {
    /// A parameter, or a node's path and its setting.
    pub name: String,
    /// A number, of single precision as of double; a boolean as text, or a text.
    pub value: SettingValue,
}

/// Largest length of a name and of a value.
const MAX_LETTERS: usize = 200;

/// Listens at one address, on a separate thread, until it is dropped. It accepts packets from any sender.
#[derive(Debug)]
pub struct OscControl {
    address: SocketAddr,
    malformed: Arc<AtomicU64>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl OscControl {
    /// Passes every setting received at `address` to `on_setting`.
    ///
    /// # Errors
    /// The system's error if the address cannot be bound.
    pub fn listen(
        address: SocketAddr,
        mut on_setting: impl FnMut(SetRequest) + Send + 'static,
    ) -> std::io::Result<Self> {
        let socket = UdpSocket::bind(address)?;
        socket.set_read_timeout(Some(WAIT))?;
        let address = socket.local_addr()?;
        let (malformed, stop) = (Arc::<AtomicU64>::default(), Arc::<AtomicBool>::default());
        let (bad, ends) = (Arc::clone(&malformed), Arc::clone(&stop));
        let thread = std::thread::Builder::new().name("settings by OSC".to_owned()).spawn(move || {
            let mut bytes = [0; 65_536];
            while !ends.load(Relaxed) {
                // Other errors are timeouts.
                let Ok(count) = socket.recv(&mut bytes) else {
                    continue;
                };
                match parse_settings(&bytes[..count]) {
                    Some(settings) => settings.into_iter().for_each(&mut on_setting),
                    None => {
                        bad.fetch_add(1, Relaxed);
                    }
                }
            }
        })?;
        Ok(Self { address, malformed, stop, thread: Some(thread) })
    }

    /// The address, with the port that the system chose for port 0.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Packets that contained no settings.
    pub fn malformed(&self) -> u64 {
        self.malformed.load(Relaxed)
    }
}

impl Drop for OscControl {
    fn drop(&mut self) {
        self.stop.store(true, Relaxed);
        if let Some(thread) = self.thread.take() {
            // Only the callback can have panicked; nothing remains to report to.
            let _ = thread.join();
        }
    }
}

/// The settings in a packet; bundles apply immediately. None if any part is something else.
pub fn parse_settings(bytes: &[u8]) -> Option<Vec<SetRequest>> {
    let mut settings = Vec::new();
    let mut packets = vec![decode(bytes).ok()?];
    while let Some(packet) = packets.pop() {
        match packet {
            OscPacket::Message(message) => settings.push(setting(&message)?),
            OscPacket::Bundle(bundle) => packets.extend(bundle.content.into_iter().rev()),
        }
    }
    Some(settings)
}

fn setting(message: &OscMessage) -> Option<SetRequest> {
    let address = message.addr.strip_prefix('/')?;
    if address.split('/').any(str::is_empty) {
        return None;
    }
    let name = match address.rsplit_once('/') {
        Some((list, item)) if item.bytes().all(|letter| letter.is_ascii_digit()) => {
            let (path, field) = list.rsplit_once('/')?;
            format!("{path}.{field}[{item}]")
        }
        Some((path, field)) => format!("{path}.{field}"),
        None => address.to_owned(),
    };
    let value = match &message.args[..] {
        [OscType::Float(x)] => SettingValue::from(*x),
        [OscType::Double(x)] => SettingValue::from(*x),
        [OscType::Int(x)] => SettingValue::from(*x),
        // Its text keeps digits that a number would round.
        [OscType::Long(x)] => SettingValue::from_text(&name, &x.to_string()),
        [OscType::Bool(x)] => SettingValue::from(*x),
        [OscType::String(x)] => SettingValue::from_text(&name, x),
        _ => return None,
    };
    let fit = |text: &str| text.len() <= MAX_LETTERS && !text.chars().any(char::is_control);
    let value_fits = match &value {
        SettingValue::Number(_) => true,
        SettingValue::Text(text) => fit(text),
    };
    (fit(&name) && value_fits).then_some(SetRequest { name, value })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rosc::{OscBundle, OscTime};

    fn message(addr: &str, args: Vec<OscType>) -> OscPacket {
        let addr = addr.to_owned();
        OscPacket::Message(OscMessage { addr, args })
    }

    fn settings_of(packet: &OscPacket) -> Option<Vec<(String, SettingValue)>> {
        let settings = parse_settings(&rosc::encoder::encode(packet).unwrap())?;
        Some(settings.into_iter().map(|setting| (setting.name, setting.value)).collect())
    }

    #[test]
    fn addresses_are_names_and_arguments_values_as_they_were_meant() {
        for (addr, argument, name, value) in [
            ("/gain", OscType::Float(0.1), "gain", 0.1_f64.into()),
            ("/out/gain", OscType::Double(0.1 + 0.2), "out.gain", (0.1 + 0.2).into()),
            ("/hand/mix/gains/1", OscType::Int(2), "hand/mix.gains[1]", SettingValue::Number(2.0)),
            ("/texture/filter/gain", OscType::Int(-3), "texture/filter.gain", SettingValue::Number(-3.0)),
            ("/surface", OscType::String("a b.ron".into()), "surface", "a b.ron".into()),
            ("/out/gain", OscType::String("0.5".into()), "out.gain", 0.5.into()),
            ("/seed", OscType::Long(i64::MAX), "seed", "9223372036854775807".into()),
            ("/on", OscType::Bool(true), "on", "true".into()),
        ] {
            let settings = settings_of(&message(addr, vec![argument]));
            assert_eq!(settings, Some(vec![(name.to_owned(), value)]));
        }
    }

    #[test]
    fn bundles_keep_their_order() {
        let inner = OscPacket::Bundle(OscBundle {
            timetag: OscTime { seconds: 0, fractional: 1 },
            content: vec![message("/b", vec![OscType::Int(2)]), message("/c", vec![OscType::Int(3)])],
        });
        let outer = OscPacket::Bundle(OscBundle {
            timetag: OscTime { seconds: 0, fractional: 1 },
            content: vec![message("/a", vec![OscType::Int(1)]), inner, message("/d", vec![OscType::Int(4)])],
        });
        let names: Vec<String> = settings_of(&outer).unwrap().into_iter().map(|(name, _)| name).collect();
        assert_eq!(names, ["a", "b", "c", "d"]);
    }

    #[test]
    fn anything_else_is_no_setting() {
        for packet in [
            message("/out//gain", vec![OscType::Int(1)]),
            message("/", vec![OscType::Int(1)]),
            message("/gains/1", vec![OscType::Int(1)]),
            message("/gain", vec![]),
            message("/gain", vec![OscType::Int(1), OscType::Int(2)]),
            message("/gain", vec![OscType::Nil]),
            message("/gain", vec![OscType::String("\u{1b}[31mred".into())]),
            message(&format!("/{}", "long".repeat(100)), vec![OscType::Int(1)]),
        ] {
            assert_eq!(settings_of(&packet), None, "{packet:?}");
        }
        let bytes = rosc::encoder::encode(&message("/out/gain", vec![OscType::Float(1.0)])).unwrap();
        assert!((0..bytes.len()).all(|length| parse_settings(&bytes[..length]).is_none()));
    }
}
