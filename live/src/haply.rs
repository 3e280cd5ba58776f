//! Haply's arms, through the Inverse Service of this machine, which owns them.
//!
//! Each arm of a graph has a WebSocket to the service and a thread that holds it. The manufacturer's crate `haply` speaks the
//! same messages, with an asynchronous runtime and a client for HTTP that nothing here needs.

#[cfg(feature = "haply")]
mod arms;
#[cfg(feature = "haply")]
mod exchange;
#[cfg(any(test, feature = "haply"))]
mod messages;
#[cfg(feature = "haply")]
mod service;

use crate::backend::BackendEntry;
use haptograph_engine::device::DeviceKind;
use haptograph_nodes::network::HaplyInverse3;

/// Haply's arms.
pub const BACKEND: BackendEntry = BackendEntry {
    what: "Haply arms",
    feature: "haply",
    kinds: &[HaplyInverse3::SPEC.name],
    is_built: cfg!(feature = "haply"),
    drives: false,
    drives_any_clock: false,
    #[cfg(feature = "haply")]
    new: Some(|| Box::new(arms::Arms::default())),
    #[cfg(not(feature = "haply"))]
    new: None,
};

/// Where the service of this machine listens, as it is installed.
pub const SERVICE: &str = "127.0.0.1:10001";

/// Identifiers of the arms that the service of this machine has.
///
/// # Errors
/// If no service answers, or the program was built without it.
pub fn list() -> std::io::Result<Vec<String>> {
    #[cfg(feature = "haply")]
    let listed = {
        let address = SERVICE.parse().map_err(std::io::Error::other)?;
        service::Service::connect(address).map(|(_, state)| state.ids())
    };
    #[cfg(not(feature = "haply"))]
    let listed = Err(std::io::ErrorKind::Unsupported.into());
    listed
}

/// Refuses two endpoints of one arm.
#[cfg(feature = "haply")]
pub(crate) fn refuse_conflicts(graph: &haptograph_engine::graph::Graph) -> Result<(), crate::BackendError> {
    arms::configs(graph).map(drop)
}
