//! A small registry: one kind of everything that graphs can be wrong about.
#![allow(dead_code)]

use haptograph_engine::device::{Channel, Device, DeviceEntry, DeviceKind, DeviceSpec};
use haptograph_engine::frame::{Kind, KindSpec, Level, Linear};
use haptograph_engine::node::{
    ActuatorKind, BuildContext, BuildError, Built, FileContext, FileKind, FileSink, Flow, FrameWriter, Input,
    InputSpec, Io, KindRule, Limit, Named, NodeEntry, NodeKind, NodeSpec, OutputCount, OutputRole,
    OutputSpec, Presence, Processor, QuantityRule, Stream, Tick, any_input, input, output, output_like,
};
use haptograph_engine::registry::Registry;
use haptograph_engine::{choices, settings};
use haptograph_signal::quantity::Quantity;
use haptograph_signal::units::Millimetres;
use std::path::{Path, PathBuf};

/// A kind that the engine does not have.
pub const WEIGHTS: Kind = Kind::new(&KindSpec {
    name: "weights",
    one: "weights",
    components: &["model", "weight"],
    neutral: &[],
    is_linear: false,
    bridges: &[],
    level: Level::norm("size"),
});

pub fn registry() -> Registry {
    let mut registry = Registry::new();
    registry
        .add_kind(WEIGHTS)
        .add(NodeEntry::processor::<Sine>())
        .add(NodeEntry::processor::<Gain>())
        .add(NodeEntry::processor::<Sum>())
        .add(NodeEntry::processor::<Mix>())
        .add(NodeEntry::processor::<Fan>())
        .add(NodeEntry::processor::<Multiply>())
        .add(NodeEntry::processor::<Derivative>())
        .add(NodeEntry::processor::<Filter>())
        .add(NodeEntry::processor::<Locate>())
        .add(NodeEntry::processor::<Split>())
        .add(NodeEntry::processor::<SpeedMeter>())
        .add(NodeEntry::processor::<Compensator>())
        .add(NodeEntry::file::<Wav>())
        .add(NodeEntry::actuator::<Drive>())
        .add(NodeEntry::source(&STYLUS))
        .add(NodeEntry::source(&THERMOMETER));
    registry.add_device(DeviceEntry::of::<Tablet>()).add_device(DeviceEntry::of::<Coil>());
    registry.add_parts("std/tones.ron", TONES);
    registry
}

/// A part of the library.
const TONES: &str = r#"Parts(format: 1, templates: {
    "Halved": Template(
        inputs: ["input"], settings: { "part": 1 },
        nodes: { "gain": Gain(input: Input("input"), gain: Expr("part / 2")) },
        outputs: { "output": "gain" },
    ),
})"#;

/// Fills its outputs with zeros: these tests check graphs, they do not run them.
#[derive(Clone)]
struct Silent;

impl<K: NodeKind> Processor<K> for Silent {
    fn process(&mut self, _: &Tick, _: &mut Io<'_, K>) {}
}

const fn spec(
    name: &'static str,
    doc: &'static str,
    inputs: &'static [InputSpec],
    outputs: &'static [OutputSpec],
) -> NodeSpec {
    NodeSpec { name, group: "test", doc, source: "", inputs, outputs, example: "" }
}

macro_rules! silent {
    ($kind:ident, $settings:ty, $spec:expr) => {
        struct $kind;
        impl NodeKind for $kind {
            type Settings = $settings;
            const SPEC: NodeSpec = $spec;
            fn build(_: $settings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
                Ok(Built::new(Silent))
            }
        }
    };
}

settings! {
    /// A tone.
    pub struct SineSettings {
        /// The frequency.
        [live, below_nyquist] frequency_hz: f64 = 440.0, in 0.0..=24_000.0;
        /// What its numbers are.
        quantity: String = "number".to_owned();
    }
}

struct Sine;
impl NodeKind for Sine {
    type Settings = SineSettings;
    const SPEC: NodeSpec = spec(
        "Sine",
        "A tone.",
        &[],
        &[OutputSpec {
            name: "output",
            kind: KindRule::Is(Kind::SCALAR),
            quantity: QuantityRule::Setting("quantity"),
            role: OutputRole::Plain,
            count: OutputCount::One,
            doc: "The tone.",
        }],
    );
    fn build(settings: SineSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        let nyquist = cx.rate.hz() / 2.0;
        if settings.frequency_hz >= nyquist {
            let message = format!("{} Hz cannot be made at {}", settings.frequency_hz, cx.rate);
            return Err(BuildError::at("frequency_hz", message)
                .help(format!("stay below {nyquist} Hz, half the rate, or use a faster clock")));
        }
        Ok(Built::new(Silent))
    }
}

settings! {
    /// A factor.
    pub struct GainSettings {
        /// The factor.
        [live] gain: f64;
    }
}
/// A gain of zero can be built, and is probably not meant.
struct Gain;

impl NodeKind for Gain {
    type Settings = GainSettings;
    const SPEC: NodeSpec = spec(
        "Gain",
        "Multiplies by a number.",
        &[any_input("input", "What is multiplied.")],
        &[output_like("output", "input", "The product.")],
    );
    fn build(_: Self::Settings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Silent))
    }
    fn advice(settings: &Self::Settings, _: &BuildContext) -> Vec<BuildError> {
        let silent = settings.gain == 0.0;
        let doubt = || BuildError::at("gain", "a gain of 0 lets nothing through").help("leave the node out");
        silent.then(doubt).into_iter().collect()
    }
}

const LIST: InputSpec = InputSpec {
    name: "inputs",
    kind: KindRule::Linear,
    quantity: QuantityRule::Any,
    flow: Flow::Sampled,
    presence: Presence::Many,
    doc: "The terms.",
};
silent!(
    Sum,
    haptograph_engine::settings::NoSettings,
    spec("Sum", "Adds.", &[LIST], &[output_like("output", "inputs", "The sum.")])
);

/// Adds under names, which are written in small letters.
struct Mix;
const MIXED: Input<Mix, Linear, Named> = Input::named("terms");

impl NodeKind for Mix {
    type Settings = haptograph_engine::settings::NoSettings;
    const SPEC: NodeSpec = spec(
        "Mix",
        "Adds under names.",
        &[any_input("terms", "The terms.").named()],
        &[output_like("output", "terms", "The sum.")],
    );
    fn build(_: Self::Settings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        let mut names = cx.names(MIXED).iter();
        match names.position(|name| name.contains(char::is_uppercase)) {
            Some(place) => {
                Err(BuildError::at("terms", "a term is written in small letters").connection(place))
            }
            None => Ok(Built::new(Silent)),
        }
    }
    fn advice(_: &Self::Settings, cx: &BuildContext) -> Vec<BuildError> {
        let alone = cx.connections(MIXED) == 1;
        let doubt = || BuildError::at("terms", "a sum of one").connection(0);
        alone.then(doubt).into_iter().collect()
    }
}

settings! {
    /// Names of copies.
    pub struct FanSettings {
        /// Of the copies.
        names: Vec<String>;
        /// How many there have to be, or any number.
        count: Option<u32> = None;
    }
}
/// Copies its input to outputs that it names.
struct Fan;

impl NodeKind for Fan {
    type Settings = FanSettings;
    const SPEC: NodeSpec = spec(
        "Fan",
        "Copies its input.",
        &[any_input("input", "What is copied.")],
        &[
            output("count", Kind::SCALAR, Quantity::NUMBER, "How many copies there are."),
            output_like("copies", "input", "A copy.").named_by("names"),
        ],
    );
    fn members(settings: &FanSettings) -> Result<Vec<String>, BuildError> {
        let found = settings.names.len();
        match settings.count.filter(|count| *count as usize != found) {
            Some(count) => Err(BuildError::at("count", format!("{found} copies are named, not {count}"))),
            None => Ok(settings.names.clone()),
        }
    }
    fn build(_: FanSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Silent))
    }
}

silent!(
    Multiply,
    haptograph_engine::settings::NoSettings,
    spec(
        "Multiply",
        "Multiplies two signals.",
        &[
            any_input("a", "One factor."),
            InputSpec { kind: KindRule::Same("a"), ..any_input("b", "The other.") },
        ],
        &[OutputSpec {
            name: "output",
            kind: KindRule::Same("a"),
            quantity: QuantityRule::Product("a", "b"),
            role: OutputRole::Plain,
            count: OutputCount::One,
            doc: "The product.",
        }],
    )
);

silent!(
    Derivative,
    haptograph_engine::settings::NoSettings,
    spec(
        "Derivative",
        "Change per second.",
        &[any_input("input", "What changes.")],
        &[OutputSpec {
            name: "output",
            kind: KindRule::Same("input"),
            quantity: QuantityRule::PerSecond("input"),
            role: OutputRole::Plain,
            count: OutputCount::One,
            doc: "Its change.",
        }],
    )
);

choices! {
    /// How a filter is computed.
    pub enum Form {
        /// Directly.
        Direct,
        /// As a lattice.
        Lattice,
    }
}
settings! {
    /// A filter.
    pub struct FilterSettings {
        /// How it is computed.
        form: Form = Form::Lattice;
        /// File of the surface.
        surface: PathBuf;
    }
}
struct Filter;
impl NodeKind for Filter {
    type Settings = FilterSettings;
    const SPEC: NodeSpec = spec(
        "Filter",
        "A synthesis filter.",
        &[
            input("weights", WEIGHTS, Quantity::NUMBER, "Which models.").held(),
            input("excitation", Kind::SCALAR, Quantity::NUMBER, "Noise.").optional(),
        ],
        &[output("acceleration", Kind::SCALAR, Quantity::ACCELERATION, "The vibration.")],
    );
    fn build(settings: FilterSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        match haptograph_signal::files::read(&settings.surface, 1 << 20) {
            Ok(_) => Ok(Built::new(Silent)),
            Err(error) => {
                let message = format!("cannot read surface `{}`: {error}", settings.surface.display());
                Err(BuildError::at("surface", message)
                    .help("paths are relative to the file they are written in"))
            }
        }
    }
}

silent!(
    Locate,
    haptograph_engine::settings::NoSettings,
    spec(
        "Locate",
        "Finds the models of a speed and force.",
        &[
            input("speed", Kind::SCALAR, Quantity::SPEED, "Speed of the tool."),
            input("force", Kind::SCALAR, Quantity::FORCE, "Normal force."),
        ],
        &[output("weights", WEIGHTS, Quantity::NUMBER, "The models.")],
    )
);
silent!(
    Split,
    haptograph_engine::settings::NoSettings,
    spec(
        "Split",
        "Takes a vector apart.",
        &[input("position", Kind::VECTOR, Quantity::LENGTH, "The vector.")],
        &[
            output("x", Kind::SCALAR, Quantity::LENGTH, "Along x."),
            output("y", Kind::SCALAR, Quantity::LENGTH, "Along y."),
        ],
    )
);
silent!(
    SpeedMeter,
    haptograph_engine::settings::NoSettings,
    spec(
        "SpeedMeter",
        "Speed of a point.",
        &[input("position", Kind::VECTOR, Quantity::LENGTH, "The point.")],
        &[output("speed", Kind::SCALAR, Quantity::SPEED, "Its speed.")],
    )
);
silent!(
    Compensator,
    haptograph_engine::settings::NoSettings,
    spec(
        "Compensator",
        "From acceleration to current.",
        &[input("acceleration", Kind::SCALAR, Quantity::ACCELERATION, "What is wanted.")],
        &[output("current", Kind::SCALAR, Quantity::CURRENT, "What makes it.")],
    )
);

settings! {
    /// A file.
    pub struct WavSettings {
        /// The name.
        [output_file] file: String;
    }
}
struct Wav;
impl FileKind for Wav {
    type Settings = WavSettings;
    const SPEC: NodeSpec = spec("Wav", "Writes a file.", &[InputSpec { kind: KindRule::Any, ..LIST }], &[]);
    fn build(settings: WavSettings, cx: &FileContext) -> Result<Box<dyn FileSink>, BuildError> {
        let rates = cx.streams.windows(2).all(|pair| pair[0].rate == pair[1].rate);
        if !rates {
            return Err(BuildError::at("inputs", "a WAV file has one rate, and these signals have several")
                .help("write a file for each rate"));
        }
        Ok(Box::new(WavFile(settings.file.into())))
    }
}
struct WavFile(PathBuf);
impl FileSink for WavFile {
    fn file_name(&self) -> &Path {
        &self.0
    }
    fn open(&self, _: &Path, _: &[Stream]) -> std::io::Result<Box<dyn FrameWriter>> {
        Err(std::io::ErrorKind::Unsupported.into())
    }
}

settings! {
    /// What a coil may be given.
    pub struct CoilLimit {
        /// Largest magnitude.
        peak_a: f64, in 0.0..=10.0;
    }
}
settings! {
    /// A drive.
    pub struct DriveSettings {
        /// Largest current.
        [limit] limit: CoilLimit;
    }
}
struct Drive;
impl ActuatorKind for Drive {
    type Settings = DriveSettings;
    const SPEC: NodeSpec = spec(
        "Drive",
        "Drives a coil.",
        &[input("current", Kind::SCALAR, Quantity::CURRENT, "What is given.")],
        &[output("delivered", Kind::SCALAR, Quantity::CURRENT, "What was given.")],
    );
    fn limit(settings: &DriveSettings) -> Result<(f64, Limit), BuildError> {
        let peak = settings.limit.peak_a;
        let limit = Limit { peak, continuous: peak, window_s: 1.0, slew_per_s: None };
        Ok((1.0, limit))
    }
}

const STYLUS: NodeSpec = spec(
    "Stylus",
    "A stylus on a tablet.",
    &[],
    &[
        output("position", Kind::VECTOR, Quantity::LENGTH, "Its tip."),
        output("force", Kind::SCALAR, Quantity::FORCE, "Normal force."),
    ],
);
const THERMOMETER: NodeSpec = spec(
    "Thermometer",
    "Temperature.",
    &[],
    &[output("temperature", Kind::SCALAR, Quantity::TEMPERATURE, "Now.")],
);

#[derive(Clone)]
struct Still;
impl Device for Still {
    fn advance(&mut self) {}
    fn read(&mut self, _: usize, _: &mut [f64]) {}
    fn write(&mut self, _: usize, _: &[f64]) {}
    fn max_output_bound(&self, _: usize) -> Option<f64> {
        Some(5.0)
    }
}

const fn channel(name: &'static str, kind: Kind, quantity: Quantity) -> Channel {
    Channel { name, kind, quantity, doc: "" }
}

settings! {
    /// A stroke.
    pub struct TabletSettings {
        /// The radius.
        radius_mm: Millimetres = Millimetres(30.0), in 1.0..=200.0;
    }
}
struct Tablet;
impl DeviceKind for Tablet {
    type Settings = TabletSettings;
    const SPEC: DeviceSpec = DeviceSpec {
        name: "Tablet",
        doc: "A simulated tablet.",
        source: "",
        simulated: true,
        senses: &[
            channel("position", Kind::VECTOR, Quantity::LENGTH),
            channel("force", Kind::SCALAR, Quantity::FORCE),
        ],
        drives: &[],
        example: "",
    };
    fn build(_: TabletSettings, _: &BuildContext) -> Result<Box<dyn Device>, BuildError> {
        Ok(Box::new(Still))
    }
}

struct Coil;
impl DeviceKind for Coil {
    type Settings = haptograph_engine::settings::NoSettings;
    const SPEC: DeviceSpec = DeviceSpec {
        name: "Coil",
        doc: "A voice coil.",
        source: "",
        simulated: false,
        senses: &[channel("temperature", Kind::SCALAR, Quantity::TEMPERATURE)],
        drives: &[channel("current", Kind::SCALAR, Quantity::CURRENT)],
        example: "",
    };
    fn build(_: Self::Settings, _: &BuildContext) -> Result<Box<dyn Device>, BuildError> {
        Ok(Box::new(Still))
    }
}
