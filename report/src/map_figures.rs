//! The perceptual map of textures (Fig. 2.11), and the tree of their clusters.

use super::plot::{Axis, Mark, Plot, Style, Weight};
use super::theme::Ink;
use haptograph_learning::evaluate::{Merge, PerceptualMap};
use std::collections::{BTreeMap, BTreeSet};

/// Width of the map's frame by its height, without margins: both axes have one scale.
pub(super) const ASPECT: f64 = 676.0 / 412.0;

/// True if there are fewer k-means groups than textures.
pub(super) fn has_groups(map: &PerceptualMap) -> bool {
    let groups: BTreeSet<usize> = map.k_means.iter().copied().collect();
    groups.len() < map.names.len()
}

/// The first two dimensions of the map, with outlined k-means groups and the directions of roughness and
/// fineness.
pub(super) fn places(map: &PerceptualMap) -> Plot {
    let place = |i: usize| {
        let place = &map.scaling.places[i];
        (place[0], place.get(1).copied().unwrap_or(0.0))
    };
    let all: Vec<(f64, f64)> = (0..map.names.len()).map(place).collect();
    let half = all.iter().fold(1e-9_f64, |half, (x, y)| half.max(y.abs()).max(x.abs() / ASPECT)) * 1.12;
    let mut groups: BTreeMap<usize, Vec<(f64, f64)>> = BTreeMap::new();
    all.iter().zip(&map.k_means).for_each(|(place, group)| groups.entry(*group).or_default().push(*place));
    let outlines = match has_groups(map) {
        true => groups.into_values().map(|group| outline(group, 0.05 * half)).collect(),
        false => Vec::new(),
    };
    let mut marks = vec![Mark::Areas(Style::of(Ink::Grey), outlines)];
    for (name, direction, weight) in [
        ("rougher (power)", &map.roughness_direction, Weight::Normal),
        ("finer (spectral centroid)", &map.fineness_direction, Weight::Dashed),
    ] {
        marks.extend(
            arrow(direction, half)
                .map(|line| Mark::Segments(Style::named(Ink::Grey, name).weight(weight), line)),
        );
    }
    for (number, material) in materials(&map.names).into_iter().enumerate() {
        let of_material =
            all.iter().zip(&map.names).filter(|(_, (_, m))| m == material).map(|(place, _)| *place);
        marks.push(Mark::Dots(
            Style::named(Ink::number(number), material).weight(Weight::Bold),
            of_material.collect(),
        ));
    }
    Plot {
        title: "Textures placed by their spectral differences".into(),
        x: Axis::of("Dimension 1").over(-half * ASPECT, half * ASPECT),
        y: Axis::of("Dimension 2").over(-half, half),
        marks,
        size: (0.0, 520.0),
        aspect: Some(ASPECT),
        caption: "Textures that lie close to each other differ little. The axes have no meaning of their own; the arrows point to where \
                  power and spectral centroid grow."
            .to_owned(),
        ..Plot::default()
    }
}

pub(super) fn materials(names: &[(String, String)]) -> Vec<&String> {
    let mut materials: Vec<&String> = names.iter().map(|(_, material)| material).collect();
    materials.sort();
    materials.dedup();
    materials
}

/// An arrow through the centre of the map towards the largest value of the property; `None` if it grows
/// nowhere.
fn arrow(direction: &[f64], half: f64) -> Option<Vec<[(f64, f64); 2]>> {
    let (x, y) = (*direction.first()?, *direction.get(1)?);
    let length = x.hypot(y);
    let (x, y) = (x / length, y / length);
    if !(x.is_finite() && y.is_finite()) {
        return None;
    }
    let at = |along: f64, across: f64| (half * (along * x - across * y), half * (along * y + across * x));
    let tip = at(0.95, 0.0);
    Some(vec![[at(-0.95, 0.0), tip], [at(0.89, 0.03), tip], [at(0.89, -0.03), tip]])
}

/// The convex hull of points (Andrew's monotone chain), widened by `margin`.
fn outline(points: Vec<(f64, f64)>, margin: f64) -> Vec<(f64, f64)> {
    let mut around: Vec<(f64, f64)> = points
        .iter()
        .flat_map(|&(x, y)| (0..12).map(move |i| (x, y, std::f64::consts::TAU * f64::from(i) / 12.0)))
        .map(|(x, y, angle)| (x + margin * angle.cos(), y + margin * angle.sin()))
        .collect();
    around.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let half = |points: &mut dyn Iterator<Item = (f64, f64)>| {
        let mut chain: Vec<(f64, f64)> = vec![];
        for point in points {
            while let [.., a, b] = chain[..] {
                if (b.0 - a.0) * (point.1 - a.1) - (b.1 - a.1) * (point.0 - a.0) > 0.0 {
                    break;
                }
                chain.pop();
            }
            chain.push(point);
        }
        chain.pop();
        chain
    };
    let mut hull = half(&mut around.iter().copied());
    hull.extend(half(&mut around.iter().rev().copied()));
    hull
}

/// Stress in 1, 2, ... dimensions.
pub(super) fn scree(stress: &[f64]) -> Plot {
    let points: Vec<(f64, f64)> = stress.iter().enumerate().map(|(i, s)| ((i + 1) as f64, *s)).collect();
    let most = points.iter().fold(0.0_f64, |most, point| most.max(point.1));
    Plot {
        title: "Stress by dimensions of the map".into(),
        x: Axis::of("Dimensions")
            .over(0.5, points.len() as f64 + 0.5)
            .named((1..=points.len()).map(|d| (d as f64, d.to_string()))),
        y: Axis::of("Kruskal's stress (1)").over(0.0, 1.1 * most),
        marks: vec![
            Mark::Line(Style::named(Ink::Blue, "stress"), points.clone()),
            Mark::Dots(Style::of(Ink::Blue).weight(Weight::Bold), points),
        ],
        size: (0.0, 200.0),
        caption: "Where the curve is flat, more dimensions do not improve the map.".to_owned(),
        ..Plot::default()
    }
}

/// The dendrogram of items by their names and materials: the nearest textures join first.
pub(super) fn tree(names: &[(String, String)], merges: &[Merge]) -> Plot {
    let count = names.len();
    let order = leaves(count, merges);
    // Position of each group: distance and row.
    let mut at = vec![(0.0, 0.0); count];
    order.iter().enumerate().for_each(|(row, &leaf)| at[leaf] = (0.0, (count - row) as f64));
    let mut lines = vec![];
    for merge in merges {
        let (a, b) = (at[merge.groups.0], at[merge.groups.1]);
        lines.extend([
            [a, (merge.distance, a.1)],
            [b, (merge.distance, b.1)],
            [(merge.distance, a.1), (merge.distance, b.1)],
        ]);
        at.push((merge.distance, 0.5 * (a.1 + b.1)));
    }
    let far = merges.last().map_or(1.0, |merge| 1.04 * merge.distance);
    let mut marks = vec![Mark::Segments(Style::of(Ink::Grey), lines)];
    for (number, material) in materials(names).into_iter().enumerate() {
        let of_material = (0..count).filter(|i| names[*i].1 == *material).map(|i| at[i]);
        marks.push(Mark::Dots(Style::of(Ink::number(number)), of_material.collect()));
    }
    Plot {
        title: "Tree of spectral differences".into(),
        note: "Ward's criterion".into(),
        x: Axis::of("Distance").over(-0.01 * far, far),
        y: Axis::default().over(0.3, count as f64 + 0.7).named(
            order
                .iter()
                .enumerate()
                .map(|(row, &leaf)| ((count - row) as f64, names[leaf].0.clone())),
        ),
        marks,
        size: (0.0, 90.0 + 15.0 * count as f64),
        caption: "The farther to the left two branches join, the more alike they are; a colour is a material, as on the map."
            .to_owned(),
        ..Plot::default()
    }
}

/// An order of the textures in which no lines of the tree cross.
fn leaves(count: usize, merges: &[Merge]) -> Vec<usize> {
    let mut groups: Vec<Vec<usize>> = (0..count).map(|i| vec![i]).collect();
    for merge in merges {
        let mut joined = std::mem::take(&mut groups[merge.groups.0]);
        joined.append(&mut groups[merge.groups.1]);
        groups.push(joined);
    }
    groups.into_iter().flatten().collect()
}
