//! Layers of a texture: what it has beside the spectrum of its map.
//!
//! A layer is one file of this folder: its parameters, its field in a surface file, its interpolation over the map, its
//! resampling, and its rendering by one voice and by a bank of voices. [`LAYERS`] lists them; a program can read files with
//! layers of its own ([`LayerSet`]).
//!
//! ```text
//! white noise ─► layers of the excitation ─► level and filter of the map ─► layers of the output ─► vibration
//! ```

pub mod clips;
pub mod grain;
pub mod lines;
pub mod onset;
mod spectrum;
mod voices;

pub use clips::Clips;
pub use grain::Grain;
pub use lines::SpatialLine;
pub use onset::Onset;
pub(crate) use spectrum::{SpectrumBank, SpectrumVoice};
pub use voices::LayerVoices;

use crate::files::native;
use crate::rendering::Block;
use crate::{ModelAt, Spot, TextureError, TextureModel};
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::any::Any;
use std::fmt::{self, Debug, Display};
use std::sync::Arc;

/// All layers, in the order of their components in a frame of coefficients.
pub const LAYERS: &[LayerKind] = &[clips::KIND, grain::KIND, lines::KIND, onset::KIND];

/// The type of a layer.
#[derive(Debug, Clone, Copy)]
pub struct LayerKind {
    /// Field of the texture in a surface file, and name of the layer's random stream.
    pub name: &'static str,
    /// Name in a sentence, without an article.
    pub title: &'static str,
    /// What the layer changes.
    pub stage: Stage,
    /// Names of the numbers that [`Layer::interpolate`] writes; of layers of the output only.
    pub components: &'static [&'static str],
    /// Reads the field's value: [`parse`].
    pub parse: fn(&str) -> ron::error::SpannedResult<ParsedLayer>,
    /// Stands in JSON for a texture without the layer.
    pub absent: fn() -> Value,
}

/// Makes the layer of a value that could be parsed; `None` if the value says that there is none.
pub(crate) type ParsedLayer = Box<dyn FnOnce() -> Result<Option<Arc<dyn Layer>>, LayerError>>;

/// What a layer changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// The white excitation, before it has the level of the map.
    Excitation,
    /// The vibration, after the high-pass.
    Output,
}

/// A layer's parameters.
pub trait Layer: Any + Debug + Send + Sync {
    /// The layer's type.
    fn kind(&self) -> &'static LayerKind;

    /// Writes the field with its indentation and a line break. Two layers are equal if this text is.
    ///
    /// # Errors
    /// Those of the writer.
    fn write(&self, out: &mut String) -> fmt::Result;

    /// Checks the layer against the models of its texture.
    ///
    /// # Errors
    /// What does not match.
    fn check(&self, models: &[ModelAt]) -> Result<(), LayerError> {
        let _ = models;
        Ok(())
    }

    /// The layer of the texture at another rate; `None` if it is the same.
    fn resampled(&self, from_hz: f64, to_hz: f64) -> Option<Arc<dyn Layer>> {
        let _ = (from_hz, to_hz);
        None
    }

    /// Writes the components at a place on the map. Real-time code; numbers of no model count as silent.
    fn interpolate(&self, spot: &Spot, into: &mut [f64]) {
        let _ = (spot, into);
    }

    /// A voice at rest.
    fn voice(&self, rates: RenderRates, seed: u64) -> Box<dyn LayerVoice>;

    /// The voices of a bank: by default each by itself.
    fn bank(&self, voices: Vec<Box<dyn LayerVoice>>) -> Box<dyn LayerBank> {
        Box::new(voices)
    }

    /// The parameters as JSON.
    fn json(&self) -> Value;

    /// The parameters in a sentence, for models of this rate.
    fn summary(&self, rate_hz: f64) -> String;
}

/// Rates of a voice, Hz.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RenderRates {
    /// Of the samples.
    pub rate_hz: f64,
    /// Of the texture's models.
    pub models_hz: f64,
}

/// The state of a layer in one voice. Real-time code; its output does not depend on the sizes of blocks.
pub trait LayerVoice: Any + Debug + Send + Sync {
    /// Moves to a speed, and to the interpolated components there.
    fn set(&mut self, speed_m_s: f64, components: &[f64]) {
        let _ = (speed_m_s, components);
    }

    /// Changes the next samples of the stage.
    fn process(&mut self, samples: &mut [f64]);

    /// Continues the state of the voice that this one replaces, with the parameters of this one.
    fn copy_state_from(&mut self, other: &dyn LayerVoice);

    /// A copy, made elsewhere than in real-time code.
    fn boxed_clone(&self) -> Box<dyn LayerVoice>;
}

impl dyn LayerVoice {
    /// The voice, if it has this type.
    pub fn downcast_ref<V: LayerVoice>(&self) -> Option<&V> {
        (self as &dyn Any).downcast_ref()
    }
}

/// A layer of the excitation of all voices in a bank.
pub trait LayerBank: Send {
    /// Changes the next samples of all voices.
    fn process(&mut self, block: &mut Block<'_>);
}

impl LayerBank for Vec<Box<dyn LayerVoice>> {
    fn process(&mut self, block: &mut Block<'_>) {
        block.each_voice(|number, samples| self[number].process(samples));
    }
}

/// The layers that a reader of surface files knows.
pub trait LayerSet {
    /// Their kinds.
    const KINDS: &'static [LayerKind];
}

/// [`LAYERS`], and crackle, which earlier files have in place of grain.
pub(crate) enum BuiltIn {}

impl LayerSet for BuiltIn {
    const KINDS: &'static [LayerKind] = &[clips::KIND, grain::KIND, lines::KIND, onset::KIND, grain::CRACKLE];
}

/// Parses a field's value, of which `layer` makes the layer.
///
/// # Errors
/// Those of the parser.
pub fn parse<D: DeserializeOwned + 'static, L: Layer>(
    text: &str,
    layer: fn(D) -> Result<Option<L>, LayerError>,
) -> ron::error::SpannedResult<ParsedLayer> {
    let document = native::options().from_str::<Option<D>>(text)?;
    Ok(Box::new(move || {
        let layer = document.map(layer).transpose()?.flatten();
        Ok(layer.map(|layer| -> Arc<dyn Layer> { Arc::new(layer) }))
    }))
}

/// Number of components of all [`LAYERS`].
pub const COMPONENTS: usize = {
    let (mut count, mut kind) = (0, 0);
    while kind < LAYERS.len() {
        count += LAYERS[kind].components.len();
        kind += 1;
    }
    count
};

/// Names of the components of all [`LAYERS`].
pub const COMPONENT_NAMES: [&str; COMPONENTS] = {
    let (mut names, mut count, mut kind) = ([""; COMPONENTS], 0, 0);
    while kind < LAYERS.len() {
        let mut component = 0;
        while component < LAYERS[kind].components.len() {
            names[count] = LAYERS[kind].components[component];
            count += 1;
            component += 1;
        }
        kind += 1;
    }
    names
};

/// An error in the numbers of a layer.
#[derive(Debug, Clone)]
pub struct LayerError(Arc<dyn std::error::Error + Send + Sync>);

impl LayerError {
    /// A layer's own error.
    pub fn new(error: impl std::error::Error + Send + Sync + 'static) -> Self {
        Self(Arc::new(error))
    }

    /// The layer's own error, if it has this type.
    pub fn downcast_ref<E: std::error::Error + 'static>(&self) -> Option<&E> {
        self.0.downcast_ref()
    }
}

impl Display for LayerError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        Display::fmt(&self.0, f)
    }
}

impl std::error::Error for LayerError {}

impl PartialEq for LayerError {
    fn eq(&self, other: &Self) -> bool {
        self.to_string() == other.to_string()
    }
}

impl PartialEq for dyn Layer {
    fn eq(&self, other: &Self) -> bool {
        let text = |layer: &dyn Layer| {
            let mut text = String::new();
            layer.write(&mut text).map(|()| text)
        };
        text(self) == text(other)
    }
}

impl TextureModel {
    /// The layer of this type.
    pub fn layer<L: Layer>(&self) -> Option<&L> {
        self.layers.iter().find_map(|layer| (&**layer as &dyn Any).downcast_ref())
    }

    /// The same texture with a layer, in place of its own of the same name.
    ///
    /// # Errors
    /// [`TextureError::Layer`] if the layer does not match the models.
    pub fn with_layer(self, layer: Arc<dyn Layer>) -> Result<Self, TextureError> {
        layer.check(self.models())?;
        Ok(self.with_checked(layer))
    }

    /// Like [`Self::with_layer`], for a layer that matches its models.
    fn with_checked(self, layer: Arc<dyn Layer>) -> Self {
        let mut texture = self.without_layer(layer.kind().name);
        let place = texture.layers.partition_point(|own| own.kind().name < layer.kind().name);
        texture.layers.insert(place, layer);
        texture
    }

    /// The same texture without the layer of this name.
    pub fn without_layer(mut self, name: &str) -> Self {
        self.layers.retain(|own| own.kind().name != name);
        self
    }

    /// Its layers, in the order of names.
    pub fn layers(&self) -> impl Iterator<Item = &dyn Layer> {
        self.layers.iter().map(|layer| &**layer)
    }

    /// The [`COMPONENTS`] of its layers at a place on the map; `None` if its layers have none. Real-time code.
    pub fn interpolate_layers(&self, spot: &Spot) -> Option<[f64; COMPONENTS]> {
        let (mut components, mut any) = ([0.0; COMPONENTS], None);
        for layer in self.layers() {
            if let Some(place) = layer.kind().place().filter(|place| !place.is_empty()) {
                layer.interpolate(spot, &mut components[place]);
                any = Some(());
            }
        }
        any.map(|()| components)
    }
}
