//! Listening sockets of the studio: on this machine, and optionally on one address of a network.

use crate::pages::Reach;
use std::io;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, TcpListener, UdpSocket};

/// Number of free ports tried, since a port must be free on both addresses.
const MAX_TRIES: u32 = 16;

/// A listening socket.
#[derive(Debug)]
pub(super) struct Door {
    pub listener: TcpListener,
    pub address: SocketAddr,
    /// Host names in browsers.
    pub hosts: Vec<String>,
    pub reach: Reach,
}

/// The socket for pages of this machine, and optionally one for other machines on the same port.
#[derive(Debug)]
pub(super) struct Doors {
    pub here: Door,
    pub lan: Option<Door>,
}

impl Doors {
    /// All sockets.
    pub(super) fn all(self) -> impl Iterator<Item = Door> {
        std::iter::once(self.here).chain(self.lan)
    }
}

/// Error of opening the sockets.
#[derive(Debug, thiserror::Error)]
pub(super) enum ListenError {
    /// The port is taken, or the address does not belong to this machine.
    #[error("cannot listen at {0}: {1}; choose another port, or an address of this machine")]
    Bind(SocketAddr, io::Error),
    /// The address is the unspecified or the loopback address.
    #[error("other machines cannot reach this one at {0}; give one of its network addresses")]
    Address(IpAddr),
    /// Any other error of the system.
    #[error("cannot listen: {0}")]
    Other(#[from] io::Error),
}

/// Listens on a port of the loopback address and of `lan`; 0 selects a free port.
pub(super) fn doors(port: u16, lan: Option<IpAddr>) -> Result<Doors, ListenError> {
    if let Some(lan) = lan.filter(|lan| is_no_place(*lan)) {
        return Err(ListenError::Address(lan));
    }
    let mut tries = 0;
    loop {
        let here = bind(Ipv4Addr::LOCALHOST.into(), port, Reach::Machine)?;
        let Some(lan) = lan else {
            return Ok(Doors { here, lan: None });
        };
        match bind(lan, here.address.port(), Reach::Network) {
            Ok(door) => {
                let lan = Some(door);
                return Ok(Doors { here, lan });
            }
            // A port that is free on one address may be taken on the other.
            Err(ListenError::Bind(_, error))
                if port == 0 && tries < MAX_TRIES && error.kind() == io::ErrorKind::AddrInUse =>
            {
                tries += 1;
            }
            Err(error) => return Err(error),
        }
    }
}

fn is_no_place(address: IpAddr) -> bool {
    address.is_unspecified()
        || address.is_multicast()
        || address == IpAddr::V4(Ipv4Addr::LOCALHOST)
        || address == IpAddr::V6(Ipv6Addr::LOCALHOST)
}

fn bind(address: IpAddr, port: u16, reach: Reach) -> Result<Door, ListenError> {
    let asked = SocketAddr::new(address, port);
    let listener = TcpListener::bind(asked).map_err(|error| ListenError::Bind(asked, error))?;
    listener.set_nonblocking(true)?;
    let address = listener.local_addr()?;
    let mut hosts = vec![address.to_string()];
    if reach == Reach::Machine {
        hosts.push(format!("localhost:{}", address.port()));
    }
    if address.port() == 80 {
        // Browsers omit port 80.
        let bare = hosts.iter().filter_map(|host| host.strip_suffix(":80"));
        hosts.extend(bare.map(str::to_owned).collect::<Vec<_>>());
    }
    Ok(Door { listener, address, hosts, reach })
}

/// The address from which this machine would reach others, if it has a network. Nothing is sent.
pub fn lan_address() -> Option<IpAddr> {
    // Addresses for documentation (RFC 5737 and 3849); only the route to them matters.
    let anybody: [(IpAddr, IpAddr); 2] = [
        (Ipv4Addr::UNSPECIFIED.into(), Ipv4Addr::new(203, 0, 113, 1).into()),
        (Ipv6Addr::UNSPECIFIED.into(), Ipv6Addr::new(0x2001, 0xdb8, 0, 0, 0, 0, 0, 1).into()),
    ];
    let from = |(any, other): (IpAddr, IpAddr)| {
        let socket = UdpSocket::bind((any, 0)).ok()?;
        socket.connect((other, 9)).ok()?;
        Some(socket.local_addr().ok()?.ip())
    };
    anybody.into_iter().filter_map(from).find(|address| !is_no_place(*address))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_machines_are_heard_at_one_address_only_and_at_the_same_port() {
        let doors = doors(0, Some(Ipv4Addr::new(127, 0, 0, 2).into())).expect("both are this machine's");
        let lan = doors.lan.expect("it was asked for");
        assert_eq!(doors.here.address.port(), lan.address.port());
        let port = lan.address.port();
        assert_eq!(lan.hosts, [format!("127.0.0.2:{port}")]);
        assert_eq!(doors.here.hosts, [format!("127.0.0.1:{port}"), format!("localhost:{port}")]);
        assert_eq!((doors.here.reach, lan.reach), (Reach::Machine, Reach::Network));
    }

    #[test]
    fn addresses_that_are_everywhere_or_nowhere_are_refused() {
        for address in ["0.0.0.0", "127.0.0.1", "::", "::1", "224.0.0.1"] {
            let address: IpAddr = address.parse().expect("an address");
            assert!(matches!(doors(0, Some(address)), Err(ListenError::Address(_))), "{address}");
        }
        let elsewhere = Ipv4Addr::new(203, 0, 113, 77).into();
        assert!(matches!(doors(0, Some(elsewhere)), Err(ListenError::Bind(..))));
    }
}
