//! Perceptual map of virtual textures (thesis 2.5.4): textures are rendered along one trajectory, compared in
//! pairs, and placed by multi-dimensional scaling.

use super::clusters::{Merge, cut_tree, hierarchical, k_means, purity};
use super::scaling::{Scaling, angle_deg, gradient, nonmetric_scaling};
use crate::metrics::{
    Deviations, ErrorStatistics, MetricError, Pooling, WindowSettings, WindowedSpectra, all_pairs,
};
use haptograph_signal::parallel;
use haptograph_signal::statistics::mean;
use haptograph_surfaces::TextureModel;
use haptograph_surfaces::rendering::{RandomWalk, SynthesisError, SynthesisSettings, Trajectory, synthesise};
use std::collections::BTreeSet;

/// Settings of a map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapSettings {
    /// The trajectory of all textures.
    pub walk: RandomWalk,
    /// Synthesis settings. Each texture has its own excitation; its number is part of the seed.
    pub synthesis: SynthesisSettings,
    /// Windows of the metric; `None` for 25.6 ms.
    pub windows: Option<WindowSettings>,
    /// Set over which deviations are pooled; by default all windows of all pairs, so that all differences
    /// have the same unit. If pooled by pair, a texture that is much louder than another is hundreds of
    /// deviations away (its power error is near 2 in every window and hardly varies), and one such pair
    /// flattens the whole map.
    pub pooling: Pooling,
    /// Dimensions of the scree plot.
    pub scree_dimensions: usize,
    /// Dimensions of the map, used for clustering and regression.
    pub dimensions: usize,
    /// Number of clusters; `None` for the number of materials.
    pub clusters: Option<usize>,
    /// Seed of k-means.
    pub seed: u64,
}

impl Default for MapSettings {
    fn default() -> Self {
        Self {
            walk: RandomWalk::default(),
            synthesis: SynthesisSettings::default(),
            windows: None,
            pooling: Pooling::All,
            scree_dimensions: 6,
            dimensions: 2,
            clusters: None,
            seed: 1,
        }
    }
}

/// Virtual textures on a map.
#[derive(Debug, Clone, PartialEq)]
pub struct PerceptualMap {
    /// Name and material of each texture.
    pub names: Vec<(String, String)>,
    /// Spectral differences of all pairs (0, 1), (0, 2), ..., (1, 2), ...
    pub differences: Vec<f64>,
    /// Positions and stress.
    pub scaling: Scaling,
    /// Cluster of each texture by k-means on the map.
    pub k_means: Vec<usize>,
    /// Share of the textures in a k-means cluster of their own material.
    pub k_means_purity: f64,
    /// The tree of the differences themselves.
    pub tree: Vec<Merge>,
    /// Share of the textures in a cluster of the tree of their own material.
    pub tree_purity: f64,
    /// Mean windowed power of each texture, (m/s²)²: roughness.
    pub power: Vec<f64>,
    /// Mean windowed spectral centroid of each texture, Hz: fineness.
    pub spectral_centroid_hz: Vec<f64>,
    /// Direction on the map in which power grows.
    pub roughness_direction: Vec<f64>,
    /// Direction on the map in which the spectral centroid grows.
    pub fineness_direction: Vec<f64>,
    /// Angle between the two directions as lines, degrees, 0 to 90; 76.4 in the thesis.
    pub angle_deg: Option<f64>,
}

/// Error of [`perceptual_map`].
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs)] // see the messages
pub enum MapError {
    #[error("a map needs at least three textures, there are {textures}")]
    TooFew { textures: usize },
    #[error("cannot render texture {name}: {source}")]
    Synthesis { name: String, source: SynthesisError },
    #[error("cannot compare the textures: {0}")]
    Metric(#[from] MetricError),
    #[error(
        "two textures cannot be placed on the map: their spectral or power error is the same in every window; are they the same recording?"
    )]
    NotFinite,
}

/// Computes the map of textures, each with its name and material. `progress` receives the fraction done.
pub fn perceptual_map(
    textures: &[(String, String, &TextureModel)],
    settings: &MapSettings,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<PerceptualMap, MapError> {
    let count = textures.len();
    if count < 3 {
        return Err(MapError::TooFew { textures: count });
    }
    let walk = settings.walk.at(textures[0].2.rate_hz());
    let spectra = play_all(textures, &walk.trajectory(), settings, &|part| progress(0.5 * part))?;
    let errors = all_pairs(&spectra, &|part| progress(0.5 + 0.5 * part))?;
    let differences = differences(&errors, settings.pooling);
    let scaling = nonmetric_scaling(&differences, count, settings.dimensions, settings.scree_dimensions)
        .ok_or(MapError::NotFinite)?;

    let materials: BTreeSet<&String> = textures.iter().map(|(_, material, _)| material).collect();
    let materials: Vec<&String> = materials.into_iter().collect();
    let class = |material: &String| materials.iter().position(|known| *known == material).unwrap_or_default();
    let classes: Vec<usize> = textures.iter().map(|(_, material, _)| class(material)).collect();
    let clusters = settings.clusters.unwrap_or(materials.len());
    let on_map = &scaling.places;
    let k_means = k_means(on_map, clusters, settings.seed);
    let tree = hierarchical(&differences, count);

    let power: Vec<f64> = spectra.iter().map(|spectra| mean(spectra.power())).collect();
    let spectral_centroid_hz: Vec<f64> =
        spectra.iter().map(|spectra| mean(&spectra.spectral_centroids_hz())).collect();
    let roughness_direction = gradient(on_map, &power, settings.dimensions);
    let fineness_direction = gradient(on_map, &spectral_centroid_hz, settings.dimensions);
    Ok(PerceptualMap {
        names: textures.iter().map(|(name, material, _)| (name.clone(), material.clone())).collect(),
        k_means_purity: purity(&k_means, &classes),
        tree_purity: purity(&cut_tree(&tree, count, clusters), &classes),
        angle_deg: angle_deg(&roughness_direction, &fineness_direction),
        differences,
        scaling,
        k_means,
        tree,
        power,
        spectral_centroid_hz,
        roughness_direction,
        fineness_direction,
    })
}

/// The spectra of all textures' vibrations along one trajectory, computed on all cores.
fn play_all(
    textures: &[(String, String, &TextureModel)],
    trajectory: &Trajectory,
    settings: &MapSettings,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Vec<WindowedSpectra>, MapError> {
    let play = |(number, (name, _, texture)): (usize, &(String, String, &TextureModel))| {
        let seed = settings.synthesis.seed.wrapping_mul(1_000_003).wrapping_add(number as u64);
        let synthesis = SynthesisSettings { seed, ..settings.synthesis };
        let vibration = synthesise(texture, trajectory, &synthesis)
            .map_err(|source| MapError::Synthesis { name: name.clone(), source })?;
        let rate_hz = texture.rate_hz();
        let windows = settings.windows.unwrap_or_else(|| WindowSettings::comparison_at(rate_hz));
        Ok(WindowedSpectra::new(&vibration, rate_hz, &windows)?)
    };
    parallel::try_map(parallel::cores(), textures.iter().enumerate(), progress, play)
}

fn differences(errors: &[ErrorStatistics], pooling: Pooling) -> Vec<f64> {
    let all: Deviations =
        errors.iter().fold(ErrorStatistics::default(), |all, pair| all.merged(pair)).deviations();
    let by = |pair: &ErrorStatistics| match pooling {
        Pooling::Pair => pair.deviations(),
        Pooling::All => all,
    };
    errors.iter().map(|pair| pair.spectral_difference(&by(pair))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_surfaces::hull::Hull;
    use haptograph_surfaces::{ArmaModel, ModelAt, VertexKind};

    /// A texture with a resonance at `angle` and the given loudness; persons differ a little.
    fn texture(angle: f64, loudness: f64, person: usize) -> TextureModel {
        let angle = angle + 0.02 * person as f64;
        let at = |(speed_m_s, force_n): (f64, f64)| ModelAt {
            speed_m_s,
            force_n,
            model: ArmaModel::from_ar(&[-1.8 * angle.cos(), 0.81], loudness * speed_m_s * force_n).unwrap(),
            kind: VertexKind::Measured,
        };
        let measured = [(0.05, 0.5), (0.2, 0.5), (0.05, 3.0), (0.2, 3.0), (0.1, 1.5)].map(at);
        TextureModel::from_measured(10_000.0, measured.to_vec(), &Hull::default()).unwrap()
    }

    fn map(pooling: Pooling) -> PerceptualMap {
        // Loudness and pitch vary independently: the low resonance has nine times the gain of the high one.
        let materials = [
            ("soft low", 0.3, 1.0),
            ("loud low", 0.3, 30.0),
            ("soft high", 1.2, 9.0),
            ("loud high", 1.2, 270.0),
        ];
        let made: Vec<(String, String, TextureModel)> = materials
            .iter()
            .flat_map(|&(name, angle, loudness)| {
                (0..3).map(move |person| {
                    (format!("{name} {person}"), name.to_owned(), texture(angle, loudness, person))
                })
            })
            .collect();
        let textures: Vec<_> =
            made.iter().map(|(name, material, t)| (name.clone(), material.clone(), t)).collect();
        let walk = RandomWalk { seconds: 3.0, ..Default::default() };
        perceptual_map(&textures, &MapSettings { walk, pooling, ..Default::default() }, &|_| ()).unwrap()
    }

    #[test]
    fn textures_of_a_material_lie_together() {
        let map = map(Pooling::All);
        assert_eq!(map.differences.len(), 66);
        assert_eq!((map.k_means_purity, map.tree_purity), (1.0, 1.0), "{map:?}");
        assert_eq!(map.scaling.stress.len(), 6);
        assert!(map.scaling.stress[1] < map.scaling.stress[0]);
    }

    #[test]
    fn deviations_of_a_pair_measure_each_pair_by_itself() {
        let (pair, all) = (map(Pooling::Pair), map(Pooling::All));
        let spread = |map: &PerceptualMap| {
            let largest = map.differences.iter().copied().fold(0.0, f64::max);
            largest / map.differences.iter().copied().fold(f64::INFINITY, f64::min)
        };
        assert!(spread(&pair) > 2.0 * spread(&all), "{} {}", spread(&pair), spread(&all));
    }

    #[test]
    fn independent_properties_grow_in_different_directions() {
        let map = map(Pooling::All);
        assert!(map.angle_deg.unwrap() > 45.0, "{:?}", map.angle_deg);
        assert!(map.power[3] > 10.0 * map.power[0]);
        assert!(map.spectral_centroid_hz[6] > map.spectral_centroid_hz[0] + 500.0);
    }

    #[test]
    fn two_textures_make_no_map() {
        let texture = texture(0.5, 1.0, 0);
        let two = [("a".into(), "m".into(), &texture), ("b".into(), "m".into(), &texture)];
        assert_eq!(
            perceptual_map(&two, &MapSettings::default(), &|_| ()),
            Err(MapError::TooFew { textures: 2 })
        );
    }
}
