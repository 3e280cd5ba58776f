//! Which way a texture is learned.

use super::law::{LawSettings, learn_law};
use super::texture::{LearnTextureError, TextureReport, TextureSettings, learn_texture};
use crate::TextureModel;
use crate::recording::ProcessedRecording;

/// How a texture is learned.
#[derive(Debug, Clone, PartialEq)]
pub enum TextureMethod {
    /// As a law over speed and force on a warped frequency axis: [`learn_law`].
    Law(LawSettings),
    /// As in the thesis: segments, a model each, triangulated: [`learn_texture`].
    Thesis(TextureSettings),
}

impl Default for TextureMethod {
    fn default() -> Self {
        Self::Law(LawSettings::default())
    }
}

impl TextureMethod {
    /// The thesis's, with its settings.
    pub fn thesis() -> Self {
        Self::Thesis(TextureSettings::default())
    }

    /// The method's name, as on the command line and in provenance.
    pub fn as_str(&self) -> &'static str {
        match self {
            Self::Law(_) => "law",
            Self::Thesis(_) => "thesis",
        }
    }

    /// Learns a texture from dragging recordings. `progress` is called with the part done, 0 to 1.
    ///
    /// # Errors
    /// [`LearnTextureError`].
    pub fn learn(
        &self,
        recordings: &[ProcessedRecording],
        progress: &dyn Fn(f64),
    ) -> Result<(TextureModel, TextureReport), LearnTextureError> {
        match self {
            Self::Law(settings) => learn_law(recordings, settings, progress),
            Self::Thesis(settings) => learn_texture(recordings, settings, progress),
        }
    }
}
