//! The pen tablet as a device of graphs, and the source that reads one.

use super::drawing::DrawingSettings;
use super::tablet::{self, TABLET_RATE_HZ, TabletReading};
use haptograph_engine::device::{Channel, Device, DeviceKind, DeviceSpec};
use haptograph_engine::frame::{Kind, Scalar, Vector};
use haptograph_engine::node::{BuildContext, BuildError, Port};
use haptograph_engine::settings::NoSettings;
use haptograph_signal::quantity::Quantity;

haptograph_engine::node! {
    /// A pen tablet: reads the position and the force of its stylus.
    pub struct TabletSource as "Tablet"(NoSettings) in "sources";
    source: "3.1.1";
    example: r#""stylus": Tablet(clock: "tablet", endpoint: "stylus")"#;
    out POSITION: Vector = Port::of(Quantity::LENGTH, "Position of the tip, m; z is zero.");
    out FORCE: Scalar = Port::of(Quantity::FORCE, "Normal force of the tip, N; zero while lifted.");
    out TOUCHING: Scalar = Port::of(Quantity::NUMBER, "1 while the tip touches, else 0.");
}

/// A tablet that a simulated hand draws on.
pub(crate) struct SimulatedTablet;

impl DeviceKind for SimulatedTablet {
    type Settings = DrawingSettings;
    const SPEC: DeviceSpec = DeviceSpec {
        name: "SimulatedTablet",
        doc: "A pen tablet at 125 Hz with the resolutions of the thesis (4.934 and 4.861 um, 0.0013 N), drawn on by a \
              simulated hand. The seed is the person: two seeds differ in pace, size and pressure.",
        source: "3.1.1",
        simulated: true,
        senses: &[
            Channel::new("position", Kind::VECTOR, Quantity::LENGTH, "Position of the tip, m."),
            Channel::new("force", Kind::SCALAR, Quantity::FORCE, "Normal force of the tip, N."),
            Channel::new("touching", Kind::SCALAR, Quantity::NUMBER, "1 while the tip touches."),
            Channel::new(
                "orientation",
                Kind::VECTOR,
                Quantity::ANGLE,
                "Tilt of the pen: axis times angle, rad. The simulated hand holds it upright: zero.",
            ),
        ],
        drives: &[],
        example: r#""stylus": SimulatedTablet(stroke: Circles(radius_mm: 30.0, period_s: 1.2), force_n: 1.0)"#,
    };

    fn build(settings: DrawingSettings, cx: &BuildContext) -> Result<Box<dyn Device>, BuildError> {
        if cx.rate.hz() != TABLET_RATE_HZ {
            return Err(BuildError::of_node(format!(
                "this tablet has a rate of {TABLET_RATE_HZ} Hz, but its clock ticks at {}",
                cx.rate
            ))
            .help(format!("put its nodes on a clock of {TABLET_RATE_HZ} Hz and bridge from there")));
        }
        let stroke = settings.to_stroke()?;
        let tablet = tablet::SimulatedTablet::new(stroke, cx.seed)
            .map_err(|error| BuildError::at("stroke", error.to_string()))?;
        Ok(Box::new(Drawn { reading: tablet.read(), tablet }))
    }
}

#[derive(Debug, Clone)]
struct Drawn {
    tablet: tablet::SimulatedTablet,
    reading: TabletReading,
}

impl Device for Drawn {
    fn advance(&mut self) {
        self.tablet.advance();
        self.reading = self.tablet.read();
    }

    fn read(&mut self, channel: usize, frame: &mut [f64]) {
        let [x, y] = self.reading.position_m;
        match channel {
            0 => frame.copy_from_slice(&[x, y, 0.0]),
            1 => frame.fill(self.reading.force_n),
            2 => frame.fill(f64::from(u8::from(self.reading.force_n > 0.0))),
            _ => frame.fill(0.0),
        }
    }

    fn write(&mut self, _: usize, _: &[f64]) {}
}
