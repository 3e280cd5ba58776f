//! Network devices and live inputs: the kinds, whose ports graphs are checked against, and their bodies, which tick.
//!
//! Another program or the system owns the device. The thread that reaches it writes its updates into the [`link`] of
//! the body, and ticks read the latest one without a lock. Until then, and offline, the device is silent.

mod conditioner;
mod evdev;
mod haply;
pub mod inputs;
pub mod link;
mod osc;
mod remote;

pub use evdev::{EvdevDevice, EvdevDeviceSettings};
pub use haply::{ArmGripSource, HaplyInverse3, HaplyInverse3Settings, HaplyPreset};
pub use osc::{OscDevice, OscDeviceSettings};
pub use remote::{Remote, UdpDevice, UdpDeviceSettings};
