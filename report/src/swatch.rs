//! Image of a texture: its vibration over the stroke path, drawn as a relief.

use super::raster::Grid;
use haptograph_surfaces::TextureModel;
use haptograph_surfaces::rendering::{SynthesisError, SynthesisSettings, Trajectory, synthesise};

/// Cells of the image, and the length of each on the surface, mm.
const CELLS: [usize; 2] = [120, 75];
const CELL_MM: f64 = 1.0 / 3.0;
/// Speed and force of the stroke.
const SPEED_M_S: f64 = 0.1;
const FORCE_N: f64 = 1.0;
/// Correlation between successive rows, so that the relief has no stripes.
const ALONG: f64 = 0.8;
/// Maximum samples of a cell: at more than 120 kHz a cell is a shorter part of the stroke.
const MAX_EACH: f64 = 400.0;

/// A grey image of 40 by 25 mm as SVG: rows of the vibration of strokes at 100 mm/s and 1 N.
///
/// # Errors
/// [`SynthesisError`] if the texture cannot be rendered.
pub fn swatch(texture: &TextureModel) -> Result<String, SynthesisError> {
    let [width, height] = CELLS;
    let rate_hz = texture.rate_hz();
    let each = samples_of_a_cell(rate_hz);
    let samples = each * width * height;
    let trajectory =
        Trajectory { rate_hz, speed_m_s: vec![SPEED_M_S; samples], force_n: vec![FORCE_N; samples] };
    let vibration = synthesise(texture, &trajectory, &SynthesisSettings::default())?;
    let cells: Vec<f64> = vibration.chunks(each).map(|cell| cell.iter().sum::<f64>()).collect();
    let mut values = vec![0.0; width * height];
    for (at, cell) in cells.iter().take(width * height).enumerate() {
        let below = at.checked_sub(width).map_or(0.0, |below| values[below]);
        values[at] = ALONG * below + (1.0 - ALONG * ALONG).sqrt() * cell;
    }
    let spread = (values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64).sqrt();
    let image = Grid { width, height, values }.to_grey_address(-4.0 * spread, 4.0 * spread);
    Ok(format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" preserveAspectRatio=\"xMidYMid slice\">\
         <image href=\"{image}\" width=\"{width}\" height=\"{height}\"/></svg>"
    ))
}

fn samples_of_a_cell(rate_hz: f64) -> usize {
    ((CELL_MM * 1e-3 / SPEED_M_S) * rate_hz).clamp(1.0, MAX_EACH) as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_surfaces::files;
    use std::path::Path;

    #[test]
    fn a_swatch_of_any_rate_takes_little() {
        let each = [1.0, 10_000.0, 1e12].map(samples_of_a_cell);
        assert_eq!(each, [1, 33, 400]);
    }

    #[test]
    fn surfaces_look_different_and_each_the_same_every_time() {
        let of = |name: &str| {
            let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs/surfaces").join(name);
            swatch(&files::load(&path).unwrap().texture.unwrap()).unwrap()
        };
        let canvas = of("t2-canvas.ron");
        assert_eq!(canvas, of("t2-canvas.ron"));
        assert_ne!(canvas, of("t3-tile.ron"));
        assert!((2_000..30_000).contains(&canvas.len()), "{}", canvas.len());
    }
}
