//! Infers which vertices of a toolkit file were measured. The file does not contain it; it follows from how the toolkit
//! extends a map: border vertices repeat the filter of a measured one, at the same positions along opposite sides.

use crate::{ModelAt, VertexKind};
use std::collections::HashSet;

/// Sets the kind of each vertex. Vertices inside the map are measured. For each filter that no inner vertex has, one border
/// vertex is measured: the one without a counterpart on the opposite side, else that of the largest speed and force.
pub(super) fn infer(models: &mut [ModelAt]) {
    let max_speed = models.iter().map(|at| at.speed_m_s).fold(0.0, f64::max);
    let max_force = models.iter().map(|at| at.force_n).fold(0.0, f64::max);
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for (vertex, at) in models.iter().enumerate() {
        match groups.iter_mut().find(|group| models[group[0]].model.same_filter(&at.model)) {
            Some(group) => group.push(vertex),
            None => groups.push(vec![vertex]),
        }
    }
    let places: HashSet<(u64, u64)> =
        models.iter().map(|at| (at.speed_m_s.to_bits(), at.force_n.to_bits())).collect();
    let stands = |speed: f64, force: f64| places.contains(&(speed.to_bits(), force.to_bits()));
    let inside = |at: &ModelAt| {
        at.speed_m_s > 0.0 && at.speed_m_s < max_speed && at.force_n > 0.0 && at.force_n < max_force
    };
    let faced = |at: &ModelAt| {
        (at.speed_m_s == max_speed && stands(0.0, at.force_n))
            || (at.force_n == max_force && stands(at.speed_m_s, 0.0))
    };
    let mut measured: Vec<usize> = Vec::new();
    for group in &groups {
        let before = measured.len();
        measured.extend(group.iter().filter(|&&vertex| inside(&models[vertex])));
        if measured.len() > before {
            continue;
        }
        let loud =
            || group.iter().filter(|&&vertex| models[vertex].speed_m_s > 0.0 && models[vertex].force_n > 0.0);
        let alone = loud().find(|&&vertex| !faced(&models[vertex]));
        let corner = || {
            loud()
                .find(|&&vertex| models[vertex].speed_m_s == max_speed && models[vertex].force_n == max_force)
        };
        measured.extend(alone.or_else(corner).or_else(|| loud().next()));
    }
    for vertex in measured {
        models[vertex].kind = VertexKind::Measured;
    }
}
