//! Clustering: k-means, hierarchical trees, and the purity of clusters against known classes.

use kodama::{Method, linkage};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::collections::BTreeMap;

/// Number of k-means restarts; the best result is kept.
const RESTARTS: usize = 50;

/// Divides points into `clusters` groups by Lloyd's algorithm from 50 random starts (k-means++). Groups are
/// numbered in order of appearance; there are at most as many groups as points.
pub fn k_means(places: &[Vec<f64>], clusters: usize, seed: u64) -> Vec<usize> {
    let clusters = clusters.min(places.len());
    if clusters == 0 {
        return vec![0; places.len()];
    }
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut best: Option<(f64, Vec<usize>)> = None;
    for _ in 0..RESTARTS {
        let mut centres = spread_out(places, clusters, &mut random);
        let mut labels = vec![usize::MAX; places.len()];
        loop {
            let nearest: Vec<usize> = places.iter().map(|place| nearest(place, &centres).0).collect();
            if nearest == labels {
                break;
            }
            labels = nearest;
            centres = moved(places, &labels, &centres);
        }
        let spread: f64 = places.iter().map(|place| nearest(place, &centres).1).sum();
        if best.as_ref().is_none_or(|(least, _)| spread < *least) {
            best = Some((spread, labels));
        }
    }
    best.map_or(vec![], |(_, labels)| renumbered(&labels))
}

fn squared_distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

fn nearest(place: &[f64], centres: &[Vec<f64>]) -> (usize, f64) {
    let distances = centres.iter().map(|centre| squared_distance(place, centre)).enumerate();
    distances.min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0, 0.0))
}

/// Initial centres; points far from those already chosen are more likely.
fn spread_out(places: &[Vec<f64>], clusters: usize, random: &mut Xoshiro256PlusPlus) -> Vec<Vec<f64>> {
    let mut centres = vec![places[random.random_range(0..places.len())].clone()];
    while centres.len() < clusters {
        let weights: Vec<f64> = places.iter().map(|place| nearest(place, &centres).1).collect();
        let mut left = random.random::<f64>() * weights.iter().sum::<f64>();
        let chosen = weights.iter().position(|weight| {
            left -= weight;
            left < 0.0
        });
        centres.push(places[chosen.unwrap_or(places.len() - 1)].clone());
    }
    centres
}

/// The new centre of each group; an empty group keeps its centre.
fn moved(places: &[Vec<f64>], labels: &[usize], centres: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let mut moved = centres.to_vec();
    for (group, centre) in moved.iter_mut().enumerate() {
        let members: Vec<&Vec<f64>> =
            places.iter().zip(labels).filter(|(_, l)| **l == group).map(|(p, _)| p).collect();
        if !members.is_empty() {
            for (axis, coordinate) in centre.iter_mut().enumerate() {
                *coordinate = members.iter().map(|place| place[axis]).sum::<f64>() / members.len() as f64;
            }
        }
    }
    moved
}

/// A merge of two groups.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Merge {
    /// The groups: items by their number, earlier merges by the number of items plus their own number.
    pub groups: (usize, usize),
    /// Distance between the groups.
    pub distance: f64,
}

/// The tree of merges by Ward's criterion, from the condensed dissimilarities of `count` items.
pub fn hierarchical(dissimilarities: &[f64], count: usize) -> Vec<Merge> {
    if count < 2 || dissimilarities.len() != count * (count - 1) / 2 {
        return vec![];
    }
    let mut matrix = dissimilarities.to_vec();
    let tree = linkage(&mut matrix, count, Method::Ward);
    let merge = |step: &kodama::Step<f64>| Merge {
        groups: (step.cluster1, step.cluster2),
        distance: step.dissimilarity,
    };
    tree.steps().iter().map(merge).collect()
}

/// Cuts a tree of `count` items into `clusters` groups, numbered in order of appearance.
pub fn cut_tree(tree: &[Merge], count: usize, clusters: usize) -> Vec<usize> {
    let mut group: Vec<usize> = (0..count).collect();
    let merges = count.saturating_sub(clusters.max(1)).min(tree.len());
    for (i, merge) in tree.iter().take(merges).enumerate() {
        for label in &mut group {
            if *label == merge.groups.0 || *label == merge.groups.1 {
                *label = count + i;
            }
        }
    }
    renumbered(&group)
}

fn renumbered(labels: &[usize]) -> Vec<usize> {
    let mut numbers = BTreeMap::new();
    labels
        .iter()
        .map(|label| {
            let next = numbers.len();
            *numbers.entry(*label).or_insert(next)
        })
        .collect()
}

/// Share of the items that belong to the most common class of their group; 1 if no group mixes classes.
pub fn purity(labels: &[usize], classes: &[usize]) -> f64 {
    let mut counts: BTreeMap<usize, BTreeMap<usize, usize>> = BTreeMap::new();
    for (&label, &class) in labels.iter().zip(classes) {
        *counts.entry(label).or_default().entry(class).or_default() += 1;
    }
    let commonest: usize = counts.values().filter_map(|classes| classes.values().max()).sum();
    if labels.is_empty() { 1.0 } else { commonest as f64 / labels.len() as f64 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_signal::noise::Gaussian;

    /// Ten places around each of four corners.
    fn corners() -> (Vec<Vec<f64>>, Vec<usize>) {
        let mut noise = Gaussian::new(1);
        let mut place = |i: usize| {
            let corner = [((i / 10) % 2) as f64, (i / 20) as f64];
            corner.iter().map(|c| 10.0 * c + noise.next_sample()).collect()
        };
        ((0..40).map(&mut place).collect(), (0..40).map(|i| i / 10).collect())
    }

    #[test]
    fn both_ways_find_separate_groups() {
        let (places, classes) = corners();
        assert_eq!(k_means(&places, 4, 1), classes);
        let pairs = places.iter().enumerate().flat_map(|(a, p)| places[a + 1..].iter().map(move |q| (p, q)));
        let distances: Vec<f64> = pairs.map(|(p, q)| squared_distance(p, q).sqrt()).collect();
        let tree = hierarchical(&distances, 40);
        assert_eq!(tree.len(), 39);
        assert_eq!(cut_tree(&tree, 40, 4), classes);
        assert_eq!(cut_tree(&tree, 40, 1), vec![0; 40]);
        assert_eq!(cut_tree(&tree, 40, 40), (0..40).collect::<Vec<_>>());
        assert!(tree.windows(2).all(|w| w[0].distance <= w[1].distance));
    }

    #[test]
    fn purity_counts_the_commonest() {
        assert_eq!(purity(&[0, 0, 1, 1], &[5, 5, 7, 7]), 1.0);
        assert_eq!(purity(&[0, 0, 0, 0], &[1, 1, 2, 3]), 0.5);
        assert_eq!(purity(&[], &[]), 1.0);
    }

    #[test]
    fn odd_requests_are_handled() {
        let places = vec![vec![0.0], vec![1.0]];
        assert_eq!(k_means(&places, 9, 1), [0, 1]);
        assert_eq!(k_means(&places, 0, 1), [0, 0]);
        assert_eq!(k_means(&[], 3, 1), [0_usize; 0]);
        assert_eq!(k_means(&[vec![1.0], vec![1.0], vec![1.0]], 2, 1), [0, 0, 0]);
        assert_eq!(hierarchical(&[1.0], 5), []);
        assert_eq!(cut_tree(&[], 1, 3), [0]);
    }
}
