//! A small registry: one kind of everything that graphs can be wrong about.
#![allow(dead_code)]

use haptograph_engine::device::{Channel, Device, DeviceEntry, DeviceKind, DeviceSpec};
use haptograph_engine::frame::{AnyKind, Kind, KindSpec, Level, Linear, OneKind, Scalar, Vector};
use haptograph_engine::node::{
    ActuatorKind, BuildContext, BuildError, Built, Family, FileContext, FileKind, FileSink, FrameWriter,
    Held, Io, Limit, Many, Named, NodeEntry, NodeKind, Optional, Port, Processor, QuantityRule, Stream, Tick,
};
use haptograph_engine::registry::Registry;
use haptograph_engine::settings::NoSettings;
use haptograph_engine::{choices, settings};
use haptograph_signal::quantity::Quantity;
use haptograph_signal::units::Millimetres;
use std::path::{Path, PathBuf};

/// A kind that the engine does not have.
pub struct Weights;
impl OneKind for Weights {
    const KIND: Kind = WEIGHTS;
    type Array = [f64; 2];
}

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
        .add(NodeEntry::source::<StylusSource>())
        .add(NodeEntry::source::<ThermometerSource>());
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

/// Kinds of nodes that are only checked.
macro_rules! silent {
    ($($kind:ident),*) => {$(
        impl NodeKind for $kind {
            fn build(_: Self::Settings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
                Ok(Built::new(Silent))
            }
        }
    )*};
}
silent!(Sum, Multiply, Derivative, Locate, Split, SpeedMeter, Compensator);

settings! {
    /// A tone.
    pub struct SineSettings {
        /// The frequency.
        [live, below_nyquist] frequency_hz: f64 = 440.0, in 0.0..=24_000.0;
        /// What its numbers are.
        quantity: String = "number".to_owned();
    }
}

haptograph_engine::node! {
    /// A tone.
    struct Sine(SineSettings) in "test";
    example: "";
    out OUTPUT: Scalar = Port::of_setting("quantity", "The tone.");
}
impl NodeKind for Sine {
    fn build(_: SineSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
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
haptograph_engine::node! {
    /// Multiplies by a number.
    struct Gain(GainSettings) in "test";
    example: "";
    in INPUT: Linear = Port::any("What is multiplied.");
    out OUTPUT: Linear = Port::like("input", "The product.");
}

impl NodeKind for Gain {
    fn build(_: Self::Settings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Silent))
    }
    fn advice(settings: &Self::Settings, _: &BuildContext) -> Vec<BuildError> {
        let silent = settings.gain == 0.0;
        let doubt = || BuildError::at("gain", "a gain of 0 lets nothing through").help("leave the node out");
        silent.then(doubt).into_iter().collect()
    }
}

haptograph_engine::node! {
    /// Adds.
    struct Sum(NoSettings) in "test";
    example: "";
    in INPUTS: Linear, Many = Port::any("The terms.");
    out OUTPUT: Linear = Port::like("inputs", "The sum.");
}

haptograph_engine::node! {
    /// Adds under names.
    struct Mix(NoSettings) in "test";
    example: "";
    in TERMS: Linear, Named = Port::any("The terms.");
    out OUTPUT: Linear = Port::like("terms", "The sum.");
}

impl NodeKind for Mix {
    fn build(_: Self::Settings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        let mut names = cx.names(Mix::TERMS).iter();
        match names.position(|name| name.contains(char::is_uppercase)) {
            Some(place) => {
                Err(BuildError::at("terms", "a term is written in small letters").connection(place))
            }
            None => Ok(Built::new(Silent)),
        }
    }
    fn advice(_: &Self::Settings, cx: &BuildContext) -> Vec<BuildError> {
        let alone = cx.connections(Mix::TERMS) == 1;
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
haptograph_engine::node! {
    /// Copies its input.
    struct Fan(FanSettings) in "test";
    example: "";
    in INPUT: Linear = Port::any("What is copied.");
    out COUNT: Scalar = Port::of(Quantity::NUMBER, "How many copies there are.");
    out COPIES: Linear, Family = Port::like("input", "A copy.").named_by("names");
}

impl NodeKind for Fan {
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

haptograph_engine::node! {
    /// Multiplies two signals.
    struct Multiply(NoSettings) in "test";
    example: "";
    in A: Linear = Port::any("One factor.");
    in B: Linear = Port::like("a", "The other.").carrying(QuantityRule::Any);
    out OUTPUT: Linear = Port::like("a", "The product.").carrying(QuantityRule::Product("a", "b"));
}

haptograph_engine::node! {
    /// Change per second.
    struct Derivative(NoSettings) in "test";
    example: "";
    in INPUT: Linear = Port::any("What changes.");
    out OUTPUT: Linear = Port::like("input", "Its change.").carrying(QuantityRule::PerSecond("input"));
}

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
haptograph_engine::node! {
    /// A synthesis filter.
    struct Filter(FilterSettings) in "test";
    example: "";
    in WEIGHTS: Weights, Held = Port::of(Quantity::NUMBER, "Which models.");
    in EXCITATION: Scalar, Optional = Port::of(Quantity::NUMBER, "Noise.");
    out ACCELERATION: Scalar = Port::of(Quantity::ACCELERATION, "The vibration.");
}
impl NodeKind for Filter {
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

haptograph_engine::node! {
    /// Finds the models of a speed and force.
    struct Locate(NoSettings) in "test";
    example: "";
    in SPEED: Scalar = Port::of(Quantity::SPEED, "Speed of the tool.");
    in FORCE: Scalar = Port::of(Quantity::FORCE, "Normal force.");
    out WEIGHTS: Weights = Port::of(Quantity::NUMBER, "The models.");
}
haptograph_engine::node! {
    /// Takes a vector apart.
    struct Split(NoSettings) in "test";
    example: "";
    in POSITION: Vector = Port::of(Quantity::LENGTH, "The vector.");
    out X: Scalar = Port::of(Quantity::LENGTH, "Along x.");
    out Y: Scalar = Port::of(Quantity::LENGTH, "Along y.");
}
haptograph_engine::node! {
    /// Speed of a point.
    struct SpeedMeter(NoSettings) in "test";
    example: "";
    in POSITION: Vector = Port::of(Quantity::LENGTH, "The point.");
    out SPEED: Scalar = Port::of(Quantity::SPEED, "Its speed.");
}
haptograph_engine::node! {
    /// From acceleration to current.
    struct Compensator(NoSettings) in "test";
    example: "";
    in ACCELERATION: Scalar = Port::of(Quantity::ACCELERATION, "What is wanted.");
    out CURRENT: Scalar = Port::of(Quantity::CURRENT, "What makes it.");
}

settings! {
    /// A file.
    pub struct WavSettings {
        /// The name.
        [output_file] file: String;
    }
}
haptograph_engine::node! {
    /// Writes a file.
    struct Wav(WavSettings) in "test";
    example: "";
    in INPUTS: AnyKind, Many = Port::any("The terms.");
}
impl FileKind for Wav {
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
haptograph_engine::node! {
    /// Drives a coil.
    struct Drive(DriveSettings) in "test";
    example: "";
    in CURRENT: Scalar = Port::of(Quantity::CURRENT, "What is given.");
    out DELIVERED: Scalar = Port::of(Quantity::CURRENT, "What was given.");
}
impl ActuatorKind for Drive {
    fn limit(settings: &DriveSettings) -> Result<(f64, Limit), BuildError> {
        let peak = settings.limit.peak_a;
        let limit = Limit { peak, continuous: peak, window_s: 1.0, slew_per_s: None };
        Ok((1.0, limit))
    }
}

haptograph_engine::node! {
    /// A stylus on a tablet.
    pub struct StylusSource as "Stylus"(NoSettings) in "test";
    example: "";
    out POSITION: Vector = Port::of(Quantity::LENGTH, "Its tip.");
    out FORCE: Scalar = Port::of(Quantity::FORCE, "Normal force.");
}
haptograph_engine::node! {
    /// Temperature.
    pub struct ThermometerSource as "Thermometer"(NoSettings) in "test";
    example: "";
    out TEMPERATURE: Scalar = Port::of(Quantity::TEMPERATURE, "Now.");
}

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
    type Settings = NoSettings;
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
