//! Summary of predictions over textures.

use super::{MapKind, Prediction};
use crate::evaluate::holdout::Mean;
use std::collections::BTreeMap;

/// Accuracy of a map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Summary {
    /// Log-spectral distance of a texture's models, dB.
    pub lsd_db: Mean,
    /// Absolute error of the power, dB.
    pub power_db: Mean,
    /// Share of a texture's models whose power error exceeds `BEYOND_DB`.
    pub beyond: Mean,
    /// The same share over all models together.
    pub beyond_of_models: f64,
    /// Number of predicted models.
    pub models: usize,
    /// Number of textures.
    pub textures: usize,
}

impl Summary {
    /// Threshold of the power error, dB.
    pub(crate) const BEYOND_DB: f64 = 6.0;

    /// Summary of one kind of map over the predictions selected by `count`; `None` if there are none.
    pub fn of(predictions: &[Prediction], map: MapKind, count: impl Fn(&Prediction) -> bool) -> Option<Self> {
        let mut textures: BTreeMap<usize, Vec<&Prediction>> = BTreeMap::new();
        for one in predictions.iter().filter(|one| one.map == map && count(one)) {
            textures.entry(one.texture).or_default().push(one);
        }
        let beyond = |one: &Prediction| f64::from(u8::from(one.power_db.abs() > Self::BEYOND_DB));
        let over = |value: &dyn Fn(&Prediction) -> f64| {
            let of = |texture: &Vec<&Prediction>| {
                texture.iter().map(|one| value(one)).sum::<f64>() / texture.len() as f64
            };
            Mean::of(&textures.values().map(of).collect::<Vec<_>>())
        };
        let models = textures.values().map(Vec::len).sum();
        let all = textures.values().flatten().map(|one| beyond(one)).sum::<f64>();
        (models > 0).then(|| Self {
            lsd_db: over(&|one| one.lsd_db),
            power_db: over(&|one| one.power_db.abs()),
            beyond: over(&beyond),
            beyond_of_models: all / models as f64,
            models,
            textures: textures.len(),
        })
    }
}
