//! A map of stimuli whose distances follow their dissimilarities, and the tree of their groups (thesis 3.3.3).

use super::{StatisticsError, all_finite, at_least, same_length};
use haptograph_learning::evaluate::{cut_tree, hierarchical, nonmetric_scaling};
use serde::Serialize;

/// Stimuli on a map.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PerceptualSpace {
    /// Coordinates of each stimulus along the principal axes, the longest first.
    pub places: Vec<Vec<f64>>,
    /// Kruskal's stress-1 in 1, 2, ... dimensions: the scree plot.
    pub stress: Vec<f64>,
    /// Share of the variance of the distances that the transformed dissimilarities explain, in 1, 2, ... dimensions.
    pub r_squared: Vec<f64>,
    /// Merges of Ward's tree of the distances on the map, the closest first: both groups (stimuli by their number, earlier
    /// merges by the number of stimuli plus their own) and their distance.
    pub tree: Vec<(usize, usize, f64)>,
    /// Group of each stimulus where the tree has two groups, three groups and so on, up to one a stimulus.
    pub cuts: Vec<Vec<usize>>,
}

/// Places `count` stimuli in `dimensions` by non-metric scaling of their dissimilarities (condensed: (0, 1), (0, 2), ..., (1, 2),
/// ...), with stress in 1 to `scree` dimensions.
pub fn perceptual_space(
    dissimilarities: &[f64],
    count: usize,
    dimensions: usize,
    scree: usize,
) -> Result<PerceptualSpace, StatisticsError> {
    at_least("stimuli", count, 2)?;
    at_least("dimensions", dimensions, 1)?;
    if dimensions.max(scree) >= count {
        let (what, value) = ("number of dimensions", dimensions.max(scree) as f64);
        return Err(StatisticsError::OutOfRange { what, value, expected: "less than the number of stimuli" });
    }
    same_length("pairs and dissimilarities", count.saturating_mul(count - 1) / 2, dissimilarities.len())?;
    all_finite("dissimilarities", dissimilarities)?;
    let largest = dissimilarities.iter().fold(0.0, |size: f64, d| size.max(d.abs()));
    if largest == 0.0 {
        return Err(StatisticsError::NoVariation { what: "dissimilarities" });
    }
    // Only their order counts; their squares might overflow.
    let scaled: Vec<f64> = dissimilarities.iter().map(|d| d / largest).collect();
    let undetermined = StatisticsError::Undetermined { what: "places" };
    let scaling = nonmetric_scaling(&scaled, count, dimensions, scree).ok_or(undetermined)?;
    let distance = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
    let places = &scaling.places;
    let distances: Vec<f64> =
        (0..count).flat_map(|a| (a + 1..count).map(move |b| distance(&places[a], &places[b]))).collect();
    let tree = hierarchical(&distances, count);
    Ok(PerceptualSpace {
        cuts: (2..=count).map(|groups| cut_tree(&tree, count, groups)).collect(),
        tree: tree.iter().map(|merge| (merge.groups.0, merge.groups.1, merge.distance)).collect(),
        places: scaling.places,
        stress: scaling.stress,
        r_squared: scaling.r_squared,
    })
}
