//! Multi-dimensional scaling: points whose distances follow given dissimilarities, and the gradients of
//! properties over the points.

use haptograph_signal::statistics::Line;
use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// Maximum number of majorization steps.
const MAX_STEPS: usize = 1000;
/// Relative improvement of the stress per step at which the iteration stops.
const SETTLED: f64 = 1e-6;

/// Points found by non-metric scaling.
#[derive(Debug, Clone, PartialEq)]
pub struct Scaling {
    /// Coordinates of each item along the principal axes of the map, the longest first.
    pub places: Vec<Vec<f64>>,
    /// Kruskal's stress-1 in 1, 2, ... dimensions, each scaled separately: the scree plot.
    pub stress: Vec<f64>,
    /// The fraction of the variance of the distances that the transformed dissimilarities explain, in 1, 2, ... dimensions; 0
    /// if these are constant.
    pub r_squared: Vec<f64>,
}

/// Non-metric scaling (Kruskal 1964) of `count` items from their dissimilarities (condensed: the pairs (0,
/// 1), (0, 2), ..., (1, 2), ...) into `dimensions`, with the stress in 1 to `scree` dimensions. Distances
/// follow a monotonic transformation of the dissimilarities, fitted by isotonic regression; points move by
/// majorization (SMACOF), starting from classical scaling. Each axis is oriented towards its largest
/// coordinate. `None` if the number of dissimilarities is not the number of pairs, or if one is not finite.
pub fn nonmetric_scaling(
    dissimilarities: &[f64],
    count: usize,
    dimensions: usize,
    scree: usize,
) -> Option<Scaling> {
    let start = classical_places(dissimilarities, count, dimensions.max(scree))?;
    let placed = |dimensions: usize| majorize(start.columns(0, dimensions).into_owned(), dissimilarities);
    let fit = |dimensions: usize| {
        let (places, stress) = placed(dimensions);
        let distances = distances(&places);
        let disparities = isotonic(dissimilarities, &distances);
        let points: Vec<(f64, f64)> = disparities.into_iter().zip(distances).collect();
        (stress, Line::fit(&points).map_or(0.0, |line| line.r_squared))
    };
    let (stress, r_squared) = (1..=scree).map(fit).unzip();
    let places = along_principal_axes(placed(dimensions).0);
    Some(Scaling {
        places: (0..count).map(|item| places.row(item).iter().copied().collect()).collect(),
        stress,
        r_squared,
    })
}

/// Classical (Torgerson) scaling: one row per item.
fn classical_places(dissimilarities: &[f64], count: usize, dimensions: usize) -> Option<DMatrix<f64>> {
    if dissimilarities.len() != count * count.saturating_sub(1) / 2
        || !dissimilarities.iter().all(|d| d.is_finite())
    {
        return None;
    }
    if count == 0 {
        return Some(DMatrix::zeros(0, dimensions));
    }
    let mut squares = DMatrix::<f64>::zeros(count, count);
    for ((a, b), d) in pairs(count).zip(dissimilarities) {
        squares[(a, b)] = d * d;
        squares[(b, a)] = d * d;
    }
    let row_means: DVector<f64> = squares.column_mean();
    let mean = row_means.mean();
    let centred =
        DMatrix::from_fn(count, count, |a, b| -0.5 * (squares[(a, b)] - row_means[a] - row_means[b] + mean));
    let eigen = SymmetricEigen::new(centred);
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    Some(DMatrix::from_fn(count, dimensions, |item, rank| {
        order
            .get(rank)
            .map_or(0.0, |&axis| eigen.eigenvalues[axis].max(0.0).sqrt() * eigen.eigenvectors[(item, axis)])
    }))
}

/// The pairs of items in the order of condensed dissimilarities.
fn pairs(count: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..count).flat_map(move |a| (a + 1..count).map(move |b| (a, b)))
}

/// Moves points until their stress converges; returns the best points and their stress.
fn majorize(mut places: DMatrix<f64>, dissimilarities: &[f64]) -> (DMatrix<f64>, f64) {
    let size: f64 = dissimilarities.iter().map(|d| d * d).sum();
    let mut best = (places.clone(), f64::INFINITY);
    for _ in 0..MAX_STEPS {
        let distances = distances(&places);
        let disparities = isotonic(dissimilarities, &distances);
        let stress = stress(&distances, &disparities);
        let gained = best.1 - stress;
        if stress < best.1 {
            best = (places.clone(), stress);
        }
        // This form continues at the first step, where the gain is infinite.
        if stress < 1e-12 || gained <= SETTLED * stress {
            break;
        }
        let fitted: f64 = disparities.iter().map(|d| d * d).sum();
        // Scaled to the size of the dissimilarities, so that the points do not collapse.
        let scale = if fitted > 0.0 { (size / fitted).sqrt() } else { 0.0 };
        places = guttman(&places, &distances, &disparities, scale);
    }
    best
}

/// The distances between points, condensed.
fn distances(places: &DMatrix<f64>) -> Vec<f64> {
    pairs(places.nrows()).map(|(a, b)| (places.row(a) - places.row(b)).norm()).collect()
}

/// Isotonic regression: the values nearest to the distances that do not decrease with the dissimilarities;
/// among equal dissimilarities they follow the distances.
fn isotonic(dissimilarities: &[f64], distances: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..distances.len()).collect();
    let key = |i: usize| (dissimilarities[i], distances[i]);
    order.sort_by(|&i, &j| {
        let ((a, x), (b, y)) = (key(i), key(j));
        a.total_cmp(&b).then(x.total_cmp(&y))
    });
    // Pool adjacent violators: sums and counts of blocks whose means rise.
    let mut blocks: Vec<(f64, usize)> = Vec::with_capacity(order.len());
    for &i in &order {
        let mut block = (distances[i], 1);
        while let Some(&(sum, count)) = blocks.last() {
            if sum / (count as f64) < block.0 / block.1 as f64 {
                break;
            }
            block = (block.0 + sum, block.1 + count);
            blocks.pop();
        }
        blocks.push(block);
    }
    let mut fitted = vec![0.0; distances.len()];
    let means = blocks.iter().flat_map(|&(sum, count)| std::iter::repeat_n(sum / count as f64, count));
    for (&i, mean) in order.iter().zip(means) {
        fitted[i] = mean;
    }
    fitted
}

/// Kruskal's stress-1.
fn stress(distances: &[f64], disparities: &[f64]) -> f64 {
    let total: f64 = distances.iter().map(|d| d * d).sum();
    let left: f64 = distances.iter().zip(disparities).map(|(d, fitted)| (d - fitted).powi(2)).sum();
    if total > 0.0 { (left / total).sqrt() } else { 0.0 }
}

/// The Guttman transform: points closer to the scaled disparities.
fn guttman(places: &DMatrix<f64>, distances: &[f64], disparities: &[f64], scale: f64) -> DMatrix<f64> {
    let count = places.nrows();
    let mut moved = DMatrix::zeros(count, places.ncols());
    for ((a, b), (distance, disparity)) in pairs(count).zip(distances.iter().zip(disparities)) {
        if *distance > 0.0 {
            let share = scale * disparity / distance / count as f64;
            for axis in 0..places.ncols() {
                let pull = share * (places[(a, axis)] - places[(b, axis)]);
                moved[(a, axis)] += pull;
                moved[(b, axis)] -= pull;
            }
        }
    }
    moved
}

/// Points rotated to their principal axes, the longest first, each oriented towards its largest coordinate.
fn along_principal_axes(mut places: DMatrix<f64>) -> DMatrix<f64> {
    if places.is_empty() {
        return places;
    }
    let mean = places.row_mean();
    places.row_iter_mut().for_each(|mut row| row -= &mean);
    let eigen = SymmetricEigen::new(places.transpose() * &places);
    let mut order: Vec<usize> = (0..places.ncols()).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let axes: Vec<_> = order.iter().map(|&axis| eigen.eigenvectors.column(axis)).collect();
    let mut turned = places * DMatrix::from_columns(&axes);
    for mut axis in turned.column_iter_mut() {
        if axis[axis.iamax()] < 0.0 {
            axis.neg_mut();
        }
    }
    turned
}

/// Gradient of a property over the first `dimensions` of the points, by linear regression: change per unit of
/// each coordinate. Zeros if it is undetermined.
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
    let solution = design.svd(true, true).solve(&DVector::from_row_slice(property), 1e-10 * scale);
    solution.map_or(vec![0.0; dimensions], |solution| solution.iter().skip(1).copied().collect())
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
        let pairs = places.iter().enumerate().flat_map(|(a, p)| places[a + 1..].iter().map(move |q| (p, q)));
        pairs.map(|(p, q)| (p[0] - q[0]).hypot(p[1] - q[1])).collect()
    }

    /// Pseudo-random points.
    fn scattered(count: usize, seed: u64) -> Vec<[f64; 2]> {
        let mut noise = haptograph_signal::noise::Gaussian::new(seed);
        (0..count).map(|_| [2.0 * noise.next_sample(), noise.next_sample()]).collect()
    }

    fn correlation(a: &[f64], b: &[f64]) -> f64 {
        let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
        let (mean_a, mean_b) = (mean(a), mean(b));
        let product = |a: &[f64], mean_a: f64, b: &[f64], mean_b: f64| {
            a.iter().zip(b).map(|(x, y)| (x - mean_a) * (y - mean_b)).sum::<f64>()
        };
        product(a, mean_a, b, mean_b) / (product(a, mean_a, a, mean_a) * product(b, mean_b, b, mean_b)).sqrt()
    }

    /// Stress-1 of the points of classical scaling, by the same monotonic fit.
    fn classical_stress(dissimilarities: &[f64], count: usize, dimensions: usize) -> f64 {
        let places = classical_places(dissimilarities, count, dimensions).unwrap();
        let found = super::distances(&places);
        stress(&found, &isotonic(dissimilarities, &found))
    }

    #[test]
    fn places_in_a_plane_are_found_again() {
        let given = distances(&[[0.0, 0.0], [4.0, 0.0], [4.0, 1.0], [-3.0, 2.0], [1.0, -2.0]]);
        let scaling = nonmetric_scaling(&given, 5, 2, 3).unwrap();
        let found: Vec<[f64; 2]> = scaling.places.iter().map(|p| [p[0], p[1]]).collect();
        for (a, b) in distances(&found).iter().zip(&given) {
            assert!((a - b).abs() < 1e-9);
        }
        assert!(scaling.stress[1] < 1e-9 && scaling.stress.len() == 3);
        assert!(scaling.r_squared[1] > 1.0 - 1e-9);
    }

    #[test]
    fn only_the_order_of_dissimilarities_counts() {
        let places = scattered(15, 4);
        let truth = distances(&places);
        let bent: Vec<f64> = truth.iter().map(|d| d.powi(3)).collect();
        let scaling = nonmetric_scaling(&bent, 15, 2, 2).unwrap();
        let found: Vec<[f64; 2]> = scaling.places.iter().map(|p| [p[0], p[1]]).collect();
        let (here, classical) = (scaling.stress[1], classical_stress(&bent, 15, 2));
        assert!(here < 0.01 && here < 0.3 * classical, "{here}, classical {classical}");
        let alike = correlation(&distances(&found), &truth);
        assert!(alike > 0.99, "{alike}");
        assert!(scaling.r_squared[1] > 0.99 && scaling.r_squared[0] < scaling.r_squared[1]);
    }

    #[test]
    fn the_stress_is_never_above_that_of_classical_scaling() {
        for seed in 0..5 {
            let mut noise = haptograph_signal::noise::Gaussian::new(seed);
            let any: Vec<f64> = (0..66).map(|_| 1.0 + noise.next_sample().abs()).collect();
            let found = nonmetric_scaling(&any, 12, 2, 4).unwrap().stress;
            for (d, stress) in (1..).zip(&found) {
                let classical = classical_stress(&any, 12, d);
                assert!(*stress < classical, "seed {seed}, {d} dimensions: {stress}, {classical}");
            }
            assert!(found[3] < found[1] && found[1] < found[0], "{found:?}");
        }
    }

    #[test]
    fn isotonic_regression_pools_what_falls() {
        assert_eq!(isotonic(&[1.0, 2.0, 3.0, 4.0], &[1.0, 3.0, 2.0, 4.0]), [1.0, 2.5, 2.5, 4.0]);
        assert_eq!(isotonic(&[2.0, 1.0, 3.0], &[9.0, 6.0, 3.0]), [6.0, 6.0, 6.0]);
        assert_eq!(isotonic(&[1.0, 1.0], &[5.0, 2.0]), [5.0, 2.0], "equals may differ");
    }

    #[test]
    fn few_items_and_wrong_counts_are_handled() {
        assert_eq!(nonmetric_scaling(&[], 1, 2, 2).unwrap().places, vec![vec![0.0, 0.0]]);
        assert_eq!(nonmetric_scaling(&[], 0, 2, 2).unwrap().places.len(), 0);
        let same = nonmetric_scaling(&[0.0; 3], 3, 2, 2).unwrap();
        assert_eq!((same.places, same.stress), (vec![vec![0.0; 2]; 3], vec![0.0; 2]));
        assert_eq!(same.r_squared, [0.0; 2]);
        assert_eq!(nonmetric_scaling(&[1.0], 3, 2, 2), None);
        assert_eq!(nonmetric_scaling(&[f64::NAN], 2, 2, 2), None);
    }

    #[test]
    fn gradients_point_where_properties_grow() {
        let places: Vec<Vec<f64>> = (0..20).map(|i| vec![(i % 5) as f64, (i / 5) as f64, 9.0]).collect();
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
