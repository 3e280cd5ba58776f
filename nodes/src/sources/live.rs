//! Numbers and vectors that come while a graph runs.

use haptograph_engine::frame::{Scalar, Vector};
use haptograph_engine::node::Port;

haptograph_engine::settings! {
    /// Settings of `LiveInput` and `LiveVector`.
    pub(crate) struct LiveInputSettings {
        /// Quantity of the number, by name: `"frequency"`, `"force"`. The endpoint gives it in that quantity's SI unit.
        quantity: String = "number".to_owned();
    }
}

haptograph_engine::node! {
    /// A live input of one number: a fader, a key, a sensor on a serial line. Its endpoint is an `OscInput`, a `MidiInput`,
    /// a `SerialInput` or a `SimulatedInput`, which sets the range of the number, or a `Host`. Three numbers make a vector with `Pack`.
    /// Elsewhere: MouseX, hslider, nentry, slider, Control.
    pub(crate) struct LiveInputSource as "LiveInput"(LiveInputSettings) in "sources";
    example: r#""pitch": LiveInput(clock: "control", endpoint: "pitch", quantity: "frequency")"#;
    out VALUE: Scalar =
        Port::of_setting("quantity", "The number, in the SI unit of `quantity`; it holds while the input \
                                      is silent.");
}

haptograph_engine::node! {
    /// Three numbers of an embedding program, whose end is a `Host`: a position, a force, a velocity.
    pub(crate) struct LiveVector(LiveInputSettings) in "sources";
    example: r#""tip": LiveVector(clock: "control", endpoint: "tip", quantity: "length")"#;
    out VALUE: Vector = Port::of_setting("quantity", "The vector, in the SI unit of `quantity`; it holds while the program \
                                                      gives none.");
}
