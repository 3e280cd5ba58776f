//! Hull extension: adds vertices on the border of the map, so that it reaches from rest to the largest speed and force.

use crate::texture::{ModelAt, TextureError, VertexKind};

/// The number of border vertices: each side of the map is divided evenly (thesis 2.3.4).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hull {
    /// Divisions of the sides along speed.
    pub speed_steps: usize,
    /// Divisions of the sides along force.
    pub force_steps: usize,
    /// Largest speed of the map, m/s; if `None`, that of the fastest model.
    pub max_speed_m_s: Option<f64>,
    /// Largest force of the map, N; if `None`, that of the model with the largest force.
    pub max_force_n: Option<f64>,
}

impl Default for Hull {
    /// Five steps along each side: 20 border vertices, the toolkit's median.
    fn default() -> Self {
        Hull { speed_steps: 5, force_steps: 5, max_speed_m_s: None, max_force_n: None }
    }
}

/// A border vertex closer than this fraction of the side to a model on the border is omitted.
const NEAR: f64 = 1e-3;

/// The border vertices of a map of `measured` models. Each has the filter of the measured model nearest in raw units
/// (mm/s and N, as the toolkit does); the variance is copied where speed or force is largest, and zero where either
/// is zero, so that a tool at rest or in the air is silent.
pub(crate) fn extend(measured: &[ModelAt], hull: &Hull) -> Result<Vec<ModelAt>, TextureError> {
    for (vertex, at) in measured.iter().enumerate() {
        let (speed_m_s, force_n) = (at.speed_m_s, at.force_n);
        if !(speed_m_s > 0.0 && force_n > 0.0 && speed_m_s.is_finite() && force_n.is_finite()) {
            return Err(TextureError::MeasuredAtRest { vertex, speed_m_s, force_n });
        }
    }
    let largest = |value: fn(&ModelAt) -> f64| measured.iter().map(value).fold(0.0, f64::max);
    let (fastest, hardest) = (largest(|at| at.speed_m_s), largest(|at| at.force_n));
    let max_speed = hull.max_speed_m_s.unwrap_or(fastest);
    let max_force = hull.max_force_n.unwrap_or(hardest);
    if measured.is_empty() || !(max_speed >= fastest && max_force >= hardest) {
        return Err(TextureError::Hull { max_speed_m_s: max_speed, max_force_n: max_force });
    }
    border(hull, max_speed, max_force)
        .filter(|&(speed, force)| {
            !measured.iter().any(|at| {
                let (along_speed, along_force) =
                    ((at.speed_m_s - speed) / max_speed, (at.force_n - force) / max_force);
                let corner = (speed == 0.0 || speed == max_speed) && (force == 0.0 || force == max_force);
                let near = if corner { 0.0 } else { NEAR };
                // Only a model on the same side of the map can replace a vertex of that side.
                (along_speed == 0.0 && along_force.abs() <= near)
                    || (along_force == 0.0 && along_speed.abs() <= near)
            })
        })
        .map(|(speed_m_s, force_n)| {
            let nearest = nearest(measured, speed_m_s, force_n);
            let variance = if speed_m_s == 0.0 || force_n == 0.0 { 0.0 } else { nearest.model.variance() };
            let model = nearest.model.clone().with_variance(variance)?;
            Ok(ModelAt { speed_m_s, force_n, model, kind: VertexKind::Edge })
        })
        .collect()
}

/// Border positions, corners included, once each.
fn border(hull: &Hull, max_speed: f64, max_force: f64) -> impl Iterator<Item = (f64, f64)> {
    let division = |max: f64, step: usize, steps: usize| {
        if step == steps {
            return max;
        }
        // Six decimals, as the toolkit's files have, unless the whole map is that small.
        let exact = max * step as f64 / steps as f64;
        let rounded = (exact * 1e6).round() / 1e6;
        if (rounded - exact).abs() < 1e-4 * max / steps as f64 { rounded } else { exact }
    };
    let (speed_steps, force_steps) = (hull.speed_steps.max(1), hull.force_steps.max(1));
    let along_speed = (0..=speed_steps).flat_map(move |step| {
        let speed = division(max_speed, step, speed_steps);
        [(speed, 0.0), (speed, max_force)]
    });
    let along_force = (1..force_steps).flat_map(move |step| {
        let force = division(max_force, step, force_steps);
        [(0.0, force), (max_speed, force)]
    });
    along_speed.chain(along_force)
}

/// The model nearest in raw units: a millimetre per second counts as much as a newton.
fn nearest(measured: &[ModelAt], speed_m_s: f64, force_n: f64) -> &ModelAt {
    let distance = |at: &ModelAt| {
        let (speed_mm_s, force) = ((at.speed_m_s - speed_m_s) * 1000.0, at.force_n - force_n);
        speed_mm_s * speed_mm_s + force * force
    };
    let mut best = &measured[0];
    for at in &measured[1..] {
        if distance(at) < distance(best) {
            best = at;
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ArmaModel, TextureModel};

    fn measured() -> Vec<ModelAt> {
        let at = |speed_m_s: f64, force_n: f64, a: f64, variance: f64| ModelAt {
            speed_m_s,
            force_n,
            model: ArmaModel::from_ar(&[a, 0.2], variance).unwrap(),
            kind: VertexKind::Measured,
        };
        vec![at(0.05, 2.0, -0.5, 1.0), at(0.1, 0.5, 0.1, 2.0), at(0.2, 3.0, 0.5, 4.0)]
    }

    #[test]
    fn the_border_is_silent_at_rest_and_copies_at_the_maximum() {
        let edges = extend(&measured(), &Hull::default()).unwrap();
        assert_eq!(edges.len(), 19, "20 less the corner that a measured model stands on");
        for edge in &edges {
            let at_rest = edge.speed_m_s == 0.0 || edge.force_n == 0.0;
            assert_eq!(edge.model.variance() == 0.0, at_rest);
        }
    }

    #[test]
    fn nearest_is_meant_in_raw_units() {
        let edges = extend(&measured(), &Hull::default()).unwrap();
        // 80 mm/s at 3 N: 20 mm/s from the second and 30 mm/s from the first, whatever the forces.
        let edge =
            edges.iter().find(|edge| edge.force_n == 3.0 && (edge.speed_m_s - 0.08).abs() < 1e-12).unwrap();
        assert_eq!(edge.model.variance(), 2.0);
    }

    #[test]
    fn the_extended_map_is_sound() {
        for seed in 0..20 {
            let mut models = measured();
            models[0].speed_m_s = 0.01 + 0.009 * seed as f64;
            TextureModel::from_measured(10_000.0, models, &Hull::default()).unwrap();
        }
        let higher = Hull { max_speed_m_s: Some(0.3), max_force_n: Some(5.0), ..Hull::default() };
        let texture = TextureModel::from_measured(10_000.0, measured(), &higher).unwrap();
        assert_eq!((texture.max_speed_m_s(), texture.max_force_n()), (0.3, 5.0));
    }

    #[test]
    fn a_model_at_rest_or_beyond_the_maximum_is_refused() {
        let mut models = measured();
        models[0].speed_m_s = 0.0;
        assert!(matches!(
            extend(&models, &Hull::default()),
            Err(TextureError::MeasuredAtRest { vertex: 0, .. })
        ));
        let small = Hull { max_speed_m_s: Some(0.1), ..Hull::default() };
        assert!(matches!(extend(&measured(), &small), Err(TextureError::Hull { .. })));
        assert!(matches!(extend(&[], &Hull::default()), Err(TextureError::Hull { .. })));
    }
}
