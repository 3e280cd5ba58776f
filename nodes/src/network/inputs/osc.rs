//! Numbers by Open Sound Control: one argument of the messages to one address.

use super::hub::Routes;
use super::{Mapping, NumberInput, Place, Selector, VALUE};
use crate::network::link::Count;
use crate::network::osc::{decode, each_message};
use crate::network::remote::address;
use crate::network::socket::WAIT;
use haptograph_engine::device::{Device, DeviceKind, DeviceSpec};
use haptograph_engine::node::{BuildContext, BuildError};
use haptograph_engine::silence::OnSilence;
use rosc::{OscMessage, OscType};
use std::fmt;
use std::net::{SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread::JoinHandle;
use std::time::Duration;

haptograph_engine::settings! {
    /// A number that another program sends by Open Sound Control.
    pub struct OscInputSettings {
        /// Address and port at which to listen; inputs at the same one share it.
        listen: String = "127.0.0.1:9752".to_owned();
        /// OSC address of the messages.
        address: String;
        /// Which of their arguments, counted from 1.
        argument: u32 = 1, in 1..=64;
        /// Two numbers that are heard ...
        from: [f64; 2] = [0.0, 1.0];
        /// ... and what they stand for, in the SI unit of the `LiveInput`'s quantity. Between them is a straight line; beyond
        /// them it ends.
        to: [f64; 2] = [0.0, 1.0];
        /// Silence after which it counts as gone, ms.
        timeout_ms: f64 = 1000.0, in 1.0..=10_000.0;
        /// What its silence does to the actuators that depend on it: `Hold` for senders that only speak of what changes.
        on_silence: OnSilence = OnSilence::Zero;
    }
}

/// A number by Open Sound Control.
pub struct OscInput;

impl DeviceKind for OscInput {
    type Settings = OscInputSettings;
    const SPEC: DeviceSpec = DeviceSpec {
        name: "OscInput",
        doc: "One number that another program sends by Open Sound Control over UDP, such as a fader of TouchOSC: an argument \
              of the messages to one address, mapped to a range. It is heard in live runs only. While it is silent, every \
              actuator that depends on it is at zero, unless `on_silence` is `Hold`, for senders that only speak of what \
              changes. Whoever reaches the address is heard.",
        source: "",
        simulated: false,
        senses: VALUE,
        drives: &[],
        example: r#""pitch": OscInput(listen: "127.0.0.1:9752", address: "/1/fader1", to: [80, 320], on_silence: Hold)"#,
    };

    fn build(settings: OscInputSettings, cx: &BuildContext) -> Result<Box<dyn Device>, BuildError> {
        if !settings.address.starts_with('/') {
            let message = format!("`{}` is not an OSC address", settings.address);
            return Err(
                BuildError::at("address", message).help("OSC addresses begin with a slash: \"/1/fader1\"")
            );
        }
        let listen = address("listen", &settings.listen)?;
        if listen.port() == 0 {
            return Err(
                BuildError::at("listen", "port 0 is no port that a sender could know")
                    .help("choose one: \"127.0.0.1:9752\""),
            );
        }
        let selector = OscSelector {
            address: settings.address,
            argument: settings.argument as usize,
        };
        let mapping = Mapping::new(settings.from, settings.to)?;
        let timeout = Duration::from_secs_f64(settings.timeout_ms * 1e-3);
        let silence = (timeout, settings.on_silence);
        Ok(NumberInput::device(
            Place::Osc(listen),
            Selector::Osc(selector),
            mapping,
            silence,
            cx,
        ))
    }
}

/// One argument, counted from 1, of the messages to one address.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in crate::network) struct OscSelector {
    address: String,
    argument: usize,
}

impl fmt::Display for OscSelector {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} argument {}", self.address, self.argument)
    }
}

impl OscSelector {
    /// The number that a message has for it; nothing where it is a message to another address.
    fn number(&self, message: &OscMessage) -> Option<Result<f64, Count>> {
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
        Some(if number.is_finite() {
            Ok(number)
        } else {
            Err(Count::NotNumbers)
        })
    }
}

/// Listens at an address until `stop`, on a thread of its own.
pub(super) fn listen(
    address: SocketAddr,
    routes: Routes,
    stop: Arc<AtomicBool>,
) -> std::io::Result<JoinHandle<()>> {
    let socket = UdpSocket::bind(address)?;
    socket.set_read_timeout(Some(WAIT))?;
    std::thread::Builder::new()
        .name(format!("input {address}"))
        .spawn(move || {
            let mut bytes = [0; 65_536];
            while !stop.load(Relaxed) {
                // What else can go wrong here is that nothing came.
                if let Ok(count) = socket.recv(&mut bytes) {
                    take(&bytes[..count], &routes);
                }
            }
        })
}

/// Hands the numbers of a packet to those who listen for them.
fn take(bytes: &[u8], routes: &Routes) {
    let routes = routes.list();
    match decode(bytes) {
        Ok(packet) => each_message(&packet, &mut |message: &OscMessage| {
            let mut is_claimed = false;
            for route in &*routes {
                let Selector::Osc(selector) = &route.selector else {
                    continue;
                };
                is_claimed |= message.addr == selector.address;
                match selector.number(message) {
                    Some(Ok(number)) => route.link.tell_number(number),
                    Some(Err(what)) => route.link.count(what, 1),
                    None => {}
                }
            }
            if !is_claimed {
                routes.iter().for_each(|route| route.link.leave(&message.addr));
            }
        }),
        Err(what) => routes.iter().for_each(|route| route.link.count(what, 1)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::inputs::Route;
    use crate::network::link::Link;
    use proptest::prelude::*;
    use rosc::OscPacket;

    fn packet(addr: &str, args: Vec<OscType>) -> Vec<u8> {
        let addr = addr.to_owned();
        rosc::encoder::encode(&OscPacket::Message(OscMessage { addr, args })).unwrap()
    }

    /// A listener for the second argument of `/knob`.
    fn second() -> (Routes, Arc<Link>) {
        let (routes, link) = (Routes::default(), Arc::new(Link::new()));
        let selector = OscSelector {
            address: "/knob".to_owned(),
            argument: 2,
        };
        routes.list().push(Route {
            selector: Selector::Osc(selector),
            link: Arc::clone(&link),
        });
        (routes, link)
    }

    fn latest(link: &Link) -> f64 {
        link.sensed.look().unwrap().1[0]
    }

    #[test]
    fn the_argument_that_was_asked_for_is_taken_and_other_messages_left_alone() {
        let (routes, link) = second();
        take(
            &packet("/knob", vec![OscType::Float(1.0), OscType::Int(7)]),
            &routes,
        );
        take(
            &packet("/other", vec![OscType::Float(1.0), OscType::Int(9)]),
            &routes,
        );
        assert_eq!((latest(&link), link.counts().accepted), (7.0, 1));
        assert_eq!(link.unclaimed.list(), [("/other".to_owned(), 1)]);
        take(&packet("/knob", vec![OscType::Nil, OscType::Bool(true)]), &routes);
        assert_eq!(latest(&link), 1.0);
    }

    #[test]
    fn what_is_no_number_is_counted_and_changes_nothing() {
        let (routes, link) = second();
        take(
            &packet("/knob", vec![OscType::Int(0), OscType::Float(f32::INFINITY)]),
            &routes,
        );
        take(&packet("/knob", vec![OscType::Int(0)]), &routes);
        take(b"/knob", &routes);
        let counts = link.counts();
        assert_eq!((counts.accepted, counts.not_numbers, counts.malformed), (0, 1, 2));
    }

    #[test]
    fn addresses_that_nobody_listens_to_are_kept_within_bounds() {
        let (routes, link) = second();
        for times in 0..3 {
            for address in 0..=times * 20 {
                take(&packet(&format!("/{address}"), vec![OscType::Int(1)]), &routes);
            }
        }
        let kept = link.unclaimed.list();
        assert_eq!((kept.len(), &kept[0]), (16, &("/0".to_owned(), 3)));
        assert_eq!(link.counts().unclaimed, 1 + 21 + 41);
    }

    proptest! {
        #[test]
        fn any_bytes_are_survived(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            let (routes, link) = second();
            take(&bytes, &routes);
            prop_assert!(link.counts().accepted == 0 || latest(&link).is_finite());
        }
    }
}
