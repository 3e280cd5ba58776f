//! Selects a few representative surfaces of many (thesis section 4.4): clusters them by z-scores of friction, tap response
//! and vibration power, and selects one surface of each cluster.

use crate::evaluate::{cut_tree, hierarchical};
use haptograph_signal::statistics::{mean, z_scores};
use haptograph_surfaces::Surface;
use haptograph_surfaces::rendering::{RandomWalk, SynthesisError, SynthesisSettings, synthesise};

/// The features by which surfaces are compared.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Features {
    /// Friction coefficient: slipperiness.
    #[serde(rename = "mu")]
    pub friction: Option<f64>,
    /// The surface's name.
    pub name: String,
    /// Power of the vibration along the representative trajectory, (m/s²)²: roughness.
    pub power: Option<f64>,
    /// Tap response factor, N per m/s: hardness. The slope of [`Taps::response`](haptograph_surfaces::Taps::response).
    #[serde(rename = "tap_response_n_s_per_m")]
    pub tap_response: Option<f64>,
}

/// The features of a surface, from the parts that it has.
///
/// The trajectory is played at the texture's own rate, so compare textures of one rate.
pub fn features(surface: &Surface, walk: &RandomWalk, seed: u64) -> Result<Features, SynthesisError> {
    let power = match &surface.texture {
        Some(texture) => {
            let trajectory = walk.at(texture.rate_hz()).trajectory();
            let vibration =
                synthesise(texture, &trajectory, &SynthesisSettings { seed, ..Default::default() })?;
            Some(mean(&vibration.iter().map(|y| y * y).collect::<Vec<_>>()))
        }
        None => None,
    };
    Ok(Features {
        name: surface.name.clone(),
        friction: surface.friction.map(|friction| friction.mu()),
        tap_response: surface.taps.as_ref().and_then(|taps| Some(taps.response()?.slope)),
        power,
    })
}

/// Surfaces in clusters, with one selected from each.
#[derive(Debug, Clone, PartialEq)]
pub struct Selection {
    /// The features used: those that all surfaces have.
    pub features: Vec<&'static str>,
    /// Cluster of each surface, numbered in order of appearance.
    pub clusters: Vec<usize>,
    /// The surface nearest to the centre of each cluster, by cluster.
    pub chosen: Vec<usize>,
    /// Mean distance of surfaces to the centre of their cluster, for 1, 2, ... clusters: a scree plot for choosing the number.
    pub scree: Vec<f64>,
}

/// An error of selecting surfaces.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs)] // see the messages
pub enum SelectError {
    #[error("cannot select {clusters} of {surfaces} surfaces; give a number from 1 to {surfaces}")]
    Clusters { clusters: usize, surfaces: usize },
    #[error(
        "the surfaces have no feature in common (friction, taps, texture); for example, {example} lacks {lacks}"
    )]
    NoSharedFeature { example: String, lacks: String },
}

/// Selects `clusters` representative surfaces: 15 of 100 in the thesis.
pub fn select(surfaces: &[Features], clusters: usize) -> Result<Selection, SelectError> {
    let count = surfaces.len();
    if clusters == 0 || clusters > count {
        return Err(SelectError::Clusters { clusters, surfaces: count });
    }
    let (features, columns): (Vec<_>, Vec<_>) = shared_features(surfaces).into_iter().unzip();
    if features.is_empty() {
        let poorest = &surfaces[0];
        let lacks =
            [("friction", poorest.friction), ("taps", poorest.tap_response), ("texture", poorest.power)];
        let lacks: Vec<_> =
            lacks.iter().filter(|(_, value)| value.is_none()).map(|(name, _)| *name).collect();
        return Err(SelectError::NoSharedFeature {
            example: poorest.name.clone(),
            lacks: lacks.join(" and "),
        });
    }
    let columns: Vec<Vec<f64>> = columns.iter().map(|column: &Vec<f64>| z_scores(column)).collect();
    let places: Vec<Vec<f64>> =
        (0..count).map(|i| columns.iter().map(|column| column[i]).collect()).collect();
    let mut distances = vec![];
    for (i, from) in places.iter().enumerate() {
        distances.extend(places[i + 1..].iter().map(|to| distance(from, to)));
    }
    let tree = hierarchical(&distances, count);
    let to_centres = |clusters: usize| {
        let labels = cut_tree(&tree, count, clusters);
        let centres = centres(&places, &labels, clusters);
        let distances: Vec<f64> =
            places.iter().zip(&labels).map(|(p, &l)| distance(p, &centres[l])).collect();
        (labels, distances)
    };
    let (labels, off_centre) = to_centres(clusters);
    let nearest = |cluster: usize| {
        let members = (0..count).filter(|&i| labels[i] == cluster);
        members.min_by(|&a, &b| off_centre[a].total_cmp(&off_centre[b])).unwrap_or_default()
    };
    let chosen = (0..clusters).map(nearest).collect();
    let scree = (1..=count).map(|clusters| mean(&to_centres(clusters).1)).collect();
    Ok(Selection { features, clusters: labels, chosen, scree })
}

/// A feature by name, and how to take it.
type Feature = (&'static str, fn(&Features) -> Option<f64>);

fn shared_features(surfaces: &[Features]) -> Vec<(&'static str, Vec<f64>)> {
    let kinds: [Feature; 3] =
        [("friction", |f| f.friction), ("tap response", |f| f.tap_response), ("power", |f| f.power)];
    let column = |(name, value): Feature| {
        surfaces.iter().map(value).collect::<Option<Vec<f64>>>().map(|column| (name, column))
    };
    kinds.into_iter().filter_map(column).collect()
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

fn centres(places: &[Vec<f64>], labels: &[usize], clusters: usize) -> Vec<Vec<f64>> {
    let centre = |cluster: usize| {
        let members: Vec<&Vec<f64>> =
            places.iter().zip(labels).filter(|(_, l)| **l == cluster).map(|(p, _)| p).collect();
        (0..places[0].len()).map(|axis| mean(&members.iter().map(|m| m[axis]).collect::<Vec<_>>())).collect()
    };
    (0..clusters).map(centre).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Six surfaces of three kinds: slippery and hard, sticky and soft, rough.
    fn surfaces() -> Vec<Features> {
        let kinds = [
            (0.1, 50.0, 1.0),
            (0.12, 51.0, 1.1),
            (0.9, 5.0, 1.0),
            (0.92, 5.5, 0.9),
            (0.5, 30.0, 9.0),
            (0.5, 31.0, 9.9),
        ];
        let features = |(i, (mu, response, power)): (usize, (f64, f64, f64))| Features {
            name: format!("surface {i}"),
            friction: Some(mu),
            tap_response: Some(response),
            power: Some(power),
        };
        kinds.into_iter().enumerate().map(features).collect()
    }

    #[test]
    fn one_surface_of_each_kind_is_chosen() {
        let selection = select(&surfaces(), 3).unwrap();
        assert_eq!(selection.clusters, [0, 0, 1, 1, 2, 2]);
        assert_eq!(selection.chosen.iter().map(|i| i / 2).collect::<Vec<_>>(), [0, 1, 2]);
        assert_eq!(selection.features, ["friction", "tap response", "power"]);
        assert_eq!(selection.scree.len(), 6);
        // Three clusters suffice: more hardly reduce the distance.
        assert!(selection.scree[2] < 0.1 * selection.scree[0] && selection.scree[5] == 0.0);
        assert!(selection.scree.windows(2).all(|w| w[1] <= w[0]));
    }

    #[test]
    fn features_that_some_lack_are_left_out() {
        let mut some = surfaces();
        some[3].tap_response = None;
        assert_eq!(select(&some, 3).unwrap().features, ["friction", "power"]);
        some.iter_mut().for_each(|f| (f.friction, f.power) = (None, None));
        let error = select(&some, 3).unwrap_err().to_string();
        assert!(error.contains("surface 0 lacks friction and texture"), "{error}");
        assert!(matches!(select(&some, 0), Err(SelectError::Clusters { .. })));
        assert!(matches!(select(&some, 7), Err(SelectError::Clusters { clusters: 7, surfaces: 6 })));
    }
}
