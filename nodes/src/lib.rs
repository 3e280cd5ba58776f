//! The node kinds of haptograph: sensing, texture, friction, tapping, actuators, simulated bodies.
//!
//! [`registry`] has them all. Each is declared in one place: graphs are checked against its settings and ports, and
//! `haptograph nodes` prints them with its documentation.
//!
//! ```
//! use haptograph_engine::document::Document;
//! use haptograph_engine::graph::{CheckOptions, check};
//! use haptograph_engine::host::Scalar;
//! use haptograph_engine::run::{Player, SessionOptions};
//!
//! let text = r#"Graph(
//!     format: 1,
//!     clocks: { "audio": Driver(rate_hz: 48000) },
//!     nodes: { "tone": Sine(clock: "audio", frequency_hz: 12000), "loud": Gain(input: "tone", gain: 2) },
//! )"#;
//! let graph = check(&Document::parse("tone.ron", text)?, &haptograph_nodes::registry(), &CheckOptions::default())?;
//! let (mut player, mut session) = Player::open(&graph, &SessionOptions::default().probe("loud"))?;
//! let mut loud = session.probe::<Scalar>("loud")?;
//! player.process(4);
//! let mut samples = [0.0; 4];
//! assert_eq!(loud.read(&mut samples), 4);
//! assert!((samples[1] - 2.0).abs() < 1e-9 && (samples[3] + 2.0).abs() < 1e-9);
//! session.finish(player);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Features
//!
//! | feature | default | adds |
//! |---|---|---|
//! | `touch` | yes | contact, friction, taps, textures, simulated bodies, devices, recording and plots; without it a program builds less than half of the crates: signals, numbers and vectors of its own (`LiveInput`, `LiveVector`), and limited outputs (`ActuatorSink`, `ForceSink`) |
//! | `serde` | | the counts of a device's packets can be serialised |

#![cfg_attr(not(test), warn(unreachable_pub))]

pub mod actuators;
#[cfg(feature = "touch")]
mod aliases;
#[cfg(feature = "touch")]
pub mod contact;
mod csv_table;
pub mod filters;
#[cfg(feature = "touch")]
pub mod friction;
pub(crate) mod math;
#[cfg(feature = "touch")]
pub mod network;
#[cfg(feature = "touch")]
pub(crate) mod sensing;
#[cfg(feature = "touch")]
pub mod simulated;
pub mod sinks;
#[cfg(feature = "touch")]
pub mod soundcard;
pub mod sources;
#[cfg(feature = "touch")]
pub(crate) mod tapping;
#[cfg(feature = "touch")]
pub mod texture;
pub mod wav;

pub(crate) use haptograph_signal::vector;

use haptograph_engine::device::DeviceEntry;
#[cfg(feature = "touch")]
use haptograph_engine::frame::OneKind;
use haptograph_engine::node::NodeEntry;
use haptograph_engine::registry::Registry;

/// All kinds of nodes, devices and frames that come with haptograph.
pub fn registry() -> Registry {
    let mut all = Registry::new();
    sources_and_sinks(&mut all);
    plain_blocks(&mut all);
    all.add_device(DeviceEntry::host());
    #[cfg(feature = "touch")]
    touching(&mut all);
    all
}

#[cfg(feature = "touch")]
fn touching(all: &mut Registry) {
    all.add_kind(contact::Contact::KIND)
        .add_kind(texture::frames::Weights::KIND)
        .add_kind(texture::frames::Coefficients::KIND)
        .add_kind(<texture::Model as OneKind>::KIND);
    all.add(NodeEntry::file::<sinks::plots::TimePlot>())
        .add(NodeEntry::file::<sinks::plots::XyPlot>())
        .add(NodeEntry::file::<sinks::plots::PathPlot>())
        .add(NodeEntry::file::<sinks::recording::RecordingSink>());
    texture(all);
    touch(all);
    recording(all);
    all.add_parts("std/texture.ron", include_str!("std/texture.ron"))
        .add_parts("std/feel.ron", include_str!("std/feel.ron"));
}

fn sources_and_sinks(all: &mut Registry) {
    all.add(NodeEntry::processor::<sources::steps::Constant>())
        .add(NodeEntry::processor::<sources::steps::ConstantVector>())
        .add(NodeEntry::processor::<sources::steps::Step>())
        .add(NodeEntry::processor::<sources::steps::Ramp>())
        .add(NodeEntry::processor::<sources::steps::Pulse>())
        .add(NodeEntry::processor::<sources::waves::Sine>())
        .add(NodeEntry::processor::<sources::waves::Chirp>())
        .add(NodeEntry::processor::<sources::noise::Noise>())
        .add(NodeEntry::processor::<sources::csv::CsvSource>())
        .add(NodeEntry::processor::<sources::wav::WavSource>())
        .add(NodeEntry::processor::<sources::one_shot::OneShot>())
        .add(NodeEntry::processor::<sources::over_position::WavOverPosition>())
        .add(NodeEntry::processor::<sources::phase::Phase>())
        .add(NodeEntry::processor::<sources::phase::Adsr>())
        .add(NodeEntry::file::<sinks::wav::WavSink>())
        .add(NodeEntry::file::<sinks::csv::CsvSink>())
        .add(NodeEntry::processor::<sinks::meter::Meter>())
        .add(NodeEntry::source::<sources::live::LiveInputSource>())
        .add(NodeEntry::source::<sources::live::LiveVector>())
        .add(NodeEntry::actuator::<actuators::sinks::ActuatorSink>())
        .add(NodeEntry::actuator::<actuators::sinks::ForceSink>());
}

fn plain_blocks(all: &mut Registry) {
    all.add(NodeEntry::processor::<math::scaling::Gain>())
        .add(NodeEntry::processor::<math::scaling::Offset>())
        .add(NodeEntry::processor::<math::scaling::Calibrate>())
        .add(NodeEntry::processor::<math::scaling::Abs>())
        .add(NodeEntry::processor::<math::sums::Add>())
        .add(NodeEntry::processor::<math::sums::Subtract>())
        .add(NodeEntry::processor::<math::sums::Mixer>())
        .add(NodeEntry::processor::<math::products::Multiply>())
        .add(NodeEntry::processor::<math::products::Divide>())
        .add(NodeEntry::processor::<math::limits::Clamp>())
        .add(NodeEntry::processor::<math::limits::SoftClip>())
        .add(NodeEntry::processor::<math::limits::SlewLimit>())
        .add(NodeEntry::processor::<math::calculus::Derivative>())
        .add(NodeEntry::processor::<math::calculus::Integrator>())
        .add(NodeEntry::processor::<math::threshold::Threshold>())
        .add(NodeEntry::processor::<math::events::Counter>())
        .add(NodeEntry::processor::<math::events::SampleHold>())
        .add(NodeEntry::processor::<math::expression::Expression>())
        .add(NodeEntry::processor::<math::curve::Curve>())
        .add(NodeEntry::processor::<math::vectors::Magnitude>())
        .add(NodeEntry::processor::<math::vectors::Dot>())
        .add(NodeEntry::processor::<math::vectors::Cross>())
        .add(NodeEntry::processor::<math::vectors::Components>())
        .add(NodeEntry::processor::<math::vectors::Pack>())
        .add(NodeEntry::processor::<math::vectors::WrenchParts>())
        .add(NodeEntry::processor::<math::vectors::MakeWrench>())
        .add(NodeEntry::processor::<math::routing::Switch>())
        .add(NodeEntry::processor::<math::routing::Delay>())
        .add(NodeEntry::processor::<filters::classical::LowPass>())
        .add(NodeEntry::processor::<filters::classical::HighPass>())
        .add(NodeEntry::processor::<filters::classical::BandPass>())
        .add(NodeEntry::processor::<filters::classical::Bessel>())
        .add(NodeEntry::processor::<filters::classical::DoublePole>())
        .add(NodeEntry::processor::<filters::section::Biquad>())
        .add(NodeEntry::processor::<filters::section::SecondOrderSection>())
        .add(NodeEntry::processor::<filters::crossover::Crossover>());
}

#[cfg(feature = "touch")]
fn texture(all: &mut Registry) {
    all.add(NodeEntry::processor::<sensing::speed_node::SpeedEstimator>())
        .add(NodeEntry::processor::<texture::locator::Saturation>())
        .add(NodeEntry::processor::<texture::locator::TriangleLocator>())
        .add(NodeEntry::processor::<texture::interpolator::LsfInterpolator>())
        .add(NodeEntry::processor::<texture::excitation::Excitation>())
        .add(NodeEntry::processor::<texture::filter::ArmaFilter>())
        .add(NodeEntry::source::<texture::steering::LiveModel>())
        .add(NodeEntry::processor::<texture::steering::SteeredModel>())
        .add(NodeEntry::processor::<actuators::drive::DynamicCompensator>())
        .add(NodeEntry::source::<simulated::tablet_node::TabletSource>())
        .add(NodeEntry::source::<simulated::haptuator::AccelerometerSource>())
        .add_device(DeviceEntry::of::<simulated::tablet_node::SimulatedTablet>())
        .add(NodeEntry::actuator::<soundcard::SoundcardSink>())
        .add(NodeEntry::source::<soundcard::SoundcardSource>())
        .add_device(DeviceEntry::of::<simulated::haptuator::SimulatedHaptuator>())
        .add_device(DeviceEntry::of::<network::UdpDevice>())
        .add_device(DeviceEntry::of::<network::OscDevice>())
        .add_device(DeviceEntry::of::<network::EvdevDevice>())
        .add_device(DeviceEntry::of::<network::HaplyInverse3>())
        .add(NodeEntry::source::<network::ArmGripSource>())
        .add_device(DeviceEntry::of::<network::inputs::OscInput>())
        .add_device(DeviceEntry::of::<network::inputs::MidiInput>())
        .add_device(DeviceEntry::of::<network::inputs::SerialInput>())
        .add_device(DeviceEntry::of::<simulated::input::SimulatedInput>())
        .add_device(DeviceEntry::of::<soundcard::Soundcard>())
        .add_device(DeviceEntry::of::<soundcard::SoundcardVoltage>())
        .add_device(DeviceEntry::of::<soundcard::SoundcardAccelerometer>())
        .add_device(DeviceEntry::of::<soundcard::SoundcardInput>())
        .add_device(DeviceEntry::of::<soundcard::SoundcardHaptuator>());
}

#[cfg(feature = "touch")]
fn touch(all: &mut Registry) {
    for alias in aliases::TOUCH {
        all.add_alias(*alias);
    }
    all.add(NodeEntry::processor::<contact::nodes::ContactNode>())
        .add(NodeEntry::processor::<contact::nodes::ContactParts>())
        .add(NodeEntry::processor::<contact::force_node::NormalForce>())
        .add(NodeEntry::processor::<friction::nodes::DahlFriction>())
        .add(NodeEntry::processor::<friction::nodes::ViscousCoulombFriction>())
        .add(NodeEntry::processor::<tapping::node::Tapping>())
        .add(NodeEntry::processor::<texture::force::TextureForce>())
        .add(NodeEntry::processor::<sensing::contact_speed::ContactSpeed>())
        .add(NodeEntry::processor::<sensing::study::Responsiveness>())
        .add(NodeEntry::processor::<sensing::study::ForceWarning>())
        .add(NodeEntry::processor::<sensing::study::QuadrantDwell>())
        .add(NodeEntry::processor::<contact::wrench_node::ContactFromWrench>())
        .add(NodeEntry::processor::<contact::wrench_node::SurfaceSpeed>())
        .add(NodeEntry::processor::<actuators::brake_node::BrakeController>())
        .add(NodeEntry::actuator::<actuators::brake_node::BrakeSink>())
        .add(NodeEntry::source::<simulated::arm::ArmSource>())
        .add(NodeEntry::source::<simulated::pen::ForceTorqueSensorSource>())
        .add(NodeEntry::source::<simulated::pen::TrueContactSource>())
        .add_device(DeviceEntry::of::<simulated::arm::SimulatedOmni>())
        .add_device(DeviceEntry::of::<simulated::pen::SimulatedPenAndObject>());
}

#[cfg(feature = "touch")]
fn recording(all: &mut Registry) {
    all.add(NodeEntry::source::<simulated::recorder::RecordingToolSource>())
        .add(NodeEntry::source::<simulated::recorder::TrackerSource>())
        .add(NodeEntry::processor::<simulated::sensor_models::AccelerometerModel>())
        .add(NodeEntry::processor::<simulated::sensor_models::TrackerModel>())
        .add(NodeEntry::processor::<simulated::sensor_models::ForceSensorModel>())
        .add_device(DeviceEntry::of::<simulated::recorder::SimulatedRecordingTool>());
}
