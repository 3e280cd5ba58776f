//! Multi-dimensional scaling: places whose distances are near to given dissimilarities, and directions in which properties grow.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// Places found by classical scaling.
#[derive(Debug, Clone, PartialEq)]
pub struct Scaling {
    /// Coordinates of each item, in all dimensions that were asked for.
    pub places: Vec<Vec<f64>>,
    /// Eigenvalues of the doubly centred squared dissimilarities, all of them, descending.
    pub eigenvalues: Vec<f64>,
    /// Kruskal's stress-1 of the places in 1, 2, ... dimensions: the scree plot.
    pub stress: Vec<f64>,
}

/// Classical (Torgerson) scaling of `count` items by their dissimilarities (condensed: the pairs (0, 1), (0, 2), ..., (1, 2), ...) into
/// `dimensions`. Each axis points so that its largest coordinate is positive. `None` if the number of dissimilarities is not that of the
/// pairs, or one is not finite.
pub fn classical_scaling(dissimilarities: &[f64], count: usize, dimensions: usize) -> Option<Scaling> {
    if dissimilarities.len() != count * count.saturating_sub(1) / 2
        || !dissimilarities.iter().all(|d| d.is_finite())
    {
        return None;
    }
    let mut squares = DMatrix::<f64>::zeros(count, count);
    let mut values = dissimilarities.iter();
    for a in 0..count {
        for b in a + 1..count {
            let d = *values.next()?;
            squares[(a, b)] = d * d;
            squares[(b, a)] = d * d;
        }
    }
    if count == 0 {
        return Some(Scaling {
            places: vec![],
            eigenvalues: vec![],
            stress: vec![0.0; dimensions],
        });
    }
    let row_means: DVector<f64> = squares.column_mean();
    let mean = row_means.mean();
    let centred = DMatrix::from_fn(count, count, |a, b| {
        -0.5 * (squares[(a, b)] - row_means[a] - row_means[b] + mean)
    });
    let eigen = SymmetricEigen::new(centred);
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let axis = |rank: usize| {
        let Some(&index) = order.get(rank) else {
            return vec![0.0; count];
        };
        let vector = eigen.eigenvectors.column(index);
        let length = eigen.eigenvalues[index].max(0.0).sqrt();
        let sign = if vector[vector.iamax()] < 0.0 { -1.0 } else { 1.0 };
        vector.iter().map(|x| sign * length * x).collect()
    };
    let axes: Vec<Vec<f64>> = (0..dimensions).map(axis).collect();
    let places: Vec<Vec<f64>> = (0..count)
        .map(|item| axes.iter().map(|axis| axis[item]).collect())
        .collect();
    let stress = (1..=dimensions)
        .map(|d| stress(dissimilarities, &places, d))
        .collect();
    Some(Scaling {
        places,
        eigenvalues: order.iter().map(|&i| eigen.eigenvalues[i]).collect(),
        stress,
    })
}

/// Kruskal's stress-1 in the first `dimensions`.
fn stress(dissimilarities: &[f64], places: &[Vec<f64>], dimensions: usize) -> f64 {
    let mut left = 0.0;
    let mut total = 0.0;
    let mut values = dissimilarities.iter();
    for (a, from) in places.iter().enumerate() {
        for to in &places[a + 1..] {
            let Some(d) = values.next() else { break };
            let squared = (0..dimensions).map(|i| (from[i] - to[i]).powi(2)).sum::<f64>();
            left += (d - squared.sqrt()).powi(2);
            total += d * d;
        }
    }
    if total > 0.0 { (left / total).sqrt() } else { 0.0 }
}

/// The direction in which a property grows fastest over the first `dimensions` of places, by linear regression: rise per unit of each
/// coordinate. Zeros where it cannot be told.
pub fn gradient(places: &[Vec<f64>], property: &[f64], dimensions: usize) -> Vec<f64> {
    let count = places.len();
    if count != property.len() || count <= dimensions || places.iter().any(|place| place.len() < dimensions) {
        return vec![0.0; dimensions];
    }
    let design = DMatrix::from_fn(count, dimensions + 1, |row, column| match column {
        0 => 1.0,
        column => places[row][column - 1],
    });
    let scale = design.amax();
    let solution = design
        .svd(true, true)
        .solve(&DVector::from_row_slice(property), 1e-10 * scale);
    solution.map_or(vec![0.0; dimensions], |solution| {
        solution.iter().skip(1).copied().collect()
    })
}

/// The angle between two lines in degrees, 0 to 90. `None` if a direction is zero.
pub fn angle_deg(a: &[f64], b: &[f64]) -> Option<f64> {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let cosine = dot(a, b).abs() / (dot(a, a) * dot(b, b)).sqrt();
    cosine.is_finite().then(|| cosine.min(1.0).acos().to_degrees())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn distances(places: &[[f64; 2]]) -> Vec<f64> {
        let pairs = places
            .iter()
            .enumerate()
            .flat_map(|(a, p)| places[a + 1..].iter().map(move |q| (p, q)));
        pairs.map(|(p, q)| (p[0] - q[0]).hypot(p[1] - q[1])).collect()
    }

    #[test]
    fn places_in_a_plane_are_found_again() {
        let places = [[0.0, 0.0], [4.0, 0.0], [4.0, 1.0], [-3.0, 2.0], [1.0, -2.0]];
        let given = distances(&places);
        let scaling = classical_scaling(&given, 5, 3).unwrap();
        let found: Vec<[f64; 2]> = scaling.places.iter().map(|p| [p[0], p[1]]).collect();
        for (a, b) in distances(&found).iter().zip(&given) {
            assert!((a - b).abs() < 1e-9);
        }
        assert!(scaling.stress[1] < 1e-9 && scaling.stress[0] > 0.05);
        assert!(scaling.places.iter().all(|p| p[2].abs() < 1e-6));
        assert_eq!(scaling.eigenvalues.len(), 5);
    }

    #[test]
    fn few_items_and_wrong_counts_are_handled() {
        assert_eq!(classical_scaling(&[], 1, 2).unwrap().places, vec![vec![0.0, 0.0]]);
        assert_eq!(classical_scaling(&[], 0, 2).unwrap().places.len(), 0);
        assert_eq!(classical_scaling(&[1.0], 3, 2), None);
        assert_eq!(classical_scaling(&[f64::NAN], 2, 2), None);
    }

    #[test]
    fn gradients_point_where_properties_grow() {
        let places: Vec<Vec<f64>> = (0..20)
            .map(|i| vec![(i % 5) as f64, (i / 5) as f64, 9.0])
            .collect();
        let property: Vec<f64> = places.iter().map(|p| 7.0 + 2.0 * p[0] - p[1]).collect();
        let found = gradient(&places, &property, 2);
        assert!((found[0] - 2.0).abs() < 1e-9 && (found[1] + 1.0).abs() < 1e-9);
        assert_eq!(gradient(&places, &property[..3], 2), [0.0, 0.0]);
    }

    #[test]
    fn lines_have_no_direction() {
        assert!((angle_deg(&[1.0, 0.0], &[0.0, 3.0]).unwrap() - 90.0).abs() < 1e-12);
        assert!((angle_deg(&[1.0, 0.0], &[-1.0, 1.0]).unwrap() - 45.0).abs() < 1e-12);
        assert_eq!(angle_deg(&[0.0, 0.0], &[1.0, 0.0]), None);
    }
}
