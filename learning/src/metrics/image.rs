//! Visual roughness and fineness of a surface from a photograph (thesis sections 3.2.1 and 3.2.4).

use haptograph_signal::{Complex64, fft};

/// Grey values of a photograph.
#[derive(Debug, Clone, PartialEq)]
pub struct GrayImage {
    width: usize,
    height: usize,
    pixels_per_mm: f64,
    /// Pixels by row.
    pixels: Vec<f64>,
}

/// Error of an image.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs)] // see the messages
pub enum ImageError {
    #[error(
        "{values} gray values do not form an image of {width} by {height} pixels; both dimensions must be at least 2"
    )]
    Size { width: usize, height: usize, values: usize },
    #[error("the scale is {pixels_per_mm} pixels per mm; it must be a finite number above 0")]
    Scale { pixels_per_mm: f64 },
    #[error("gray value {index} (from 0) is not a finite number")]
    NotFinite { index: usize },
}

impl GrayImage {
    /// An image of grey values (any unit), by row.
    pub fn new(
        width: usize,
        height: usize,
        pixels_per_mm: f64,
        pixels: Vec<f64>,
    ) -> Result<Self, ImageError> {
        if width < 2 || height < 2 || width.checked_mul(height) != Some(pixels.len()) {
            return Err(ImageError::Size { width, height, values: pixels.len() });
        }
        if !(pixels_per_mm.is_finite() && pixels_per_mm > 0.0) {
            return Err(ImageError::Scale { pixels_per_mm });
        }
        if let Some(index) = pixels.iter().position(|x| !x.is_finite()) {
            return Err(ImageError::NotFinite { index });
        }
        Ok(Self { width, height, pixels_per_mm, pixels })
    }

    /// Differences up to this are rounding.
    fn rounding(&self) -> f64 {
        1e-12 * self.pixels.iter().fold(0.0_f64, |most, x| most.max(x.abs()))
    }

    fn transposed(&self) -> Self {
        let pixel = |i: usize| self.pixels[(i % self.height) * self.width + i / self.height];
        Self {
            width: self.height,
            height: self.width,
            pixels_per_mm: self.pixels_per_mm,
            pixels: (0..self.pixels.len()).map(pixel).collect(),
        }
    }
}

/// Standard deviation of the Gaussian that separates waviness from roughness, mm.
const WAVINESS_MM: f64 = 2.54;
/// Number of grey levels.
const LEVELS: usize = 500;

/// The angular second moment (Eq. 3.2.1) of the grey levels of neighbouring pixels in four directions, after
/// removal of the waviness: 1 for an even surface, smaller for a rougher one.
///
/// Photographs of rough materials yield about 1e-4; the values of Table 3.1 (0.28 to 0.37) are not reproduced. The levels span the darkest to
/// the brightest pixel, so that one bright speck raises the moment.
pub fn roughness(image: &GrayImage) -> f64 {
    let levels = gray_levels(&rough_component(image), image.rounding());
    angular_second_moment(&levels, image.width, image.height)
}

/// The sum of squares of the symmetric co-occurrence matrix over four directions.
fn angular_second_moment(levels: &[usize], width: usize, height: usize) -> f64 {
    let (width, height) = (width as isize, height as isize);
    let mut counts = vec![0_u32; LEVELS * LEVELS];
    for (dx, dy) in [(1, 0), (1, -1), (0, 1), (1, 1)] {
        for y in (0..height).filter(|y| (0..height).contains(&(y + dy))) {
            for x in 0..width - dx {
                let here = levels[(y * width + x) as usize];
                let there = levels[((y + dy) * width + x + dx) as usize];
                counts[here * LEVELS + there] += 1;
                counts[there * LEVELS + here] += 1;
            }
        }
    }
    let total: f64 = counts.iter().map(|&c| f64::from(c)).sum();
    counts.iter().map(|&c| (f64::from(c) / total).powi(2)).sum()
}

/// The image minus its waviness.
fn rough_component(image: &GrayImage) -> Vec<f64> {
    let sigma = WAVINESS_MM * image.pixels_per_mm;
    // No weight is read from beyond the border.
    let reach = ((4.0 * sigma).ceil() as usize).min(image.width.max(image.height));
    let weights: Vec<f64> = (0..=reach).map(|i| (-0.5 * (i as f64 / sigma).powi(2)).exp()).collect();
    let smooth = smoothed_rows(&smoothed_rows(image, &weights).transposed(), &weights).transposed();
    image.pixels.iter().zip(&smooth.pixels).map(|(x, s)| x - s).collect()
}

/// Each row convolved with a symmetric kernel; beyond the border the kernel is renormalised.
fn smoothed_rows(image: &GrayImage, weights: &[f64]) -> GrayImage {
    let mut pixels = Vec::with_capacity(image.pixels.len());
    for row in image.pixels.chunks(image.width) {
        for x in 0..row.len() {
            let first = x.saturating_sub(weights.len() - 1);
            let last = (x + weights.len() - 1).min(row.len() - 1);
            let (mut sum, mut total) = (0.0, 0.0);
            for (i, value) in row.iter().enumerate().take(last + 1).skip(first) {
                let weight = weights[i.abs_diff(x)];
                sum += weight * value;
                total += weight;
            }
            pixels.push(sum / total);
        }
    }
    GrayImage { pixels, ..*image }
}

/// Values sorted into equal bins between their minimum and maximum, unless these differ by rounding only.
fn gray_levels(values: &[f64], rounding: f64) -> Vec<usize> {
    let least = values.iter().copied().fold(f64::INFINITY, f64::min);
    let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let range = most - least;
    let level = |v: &f64| {
        if range <= rounding { 0 } else { (((v - least) / range * LEVELS as f64) as usize).min(LEVELS - 1) }
    };
    values.iter().map(level).collect()
}

/// The spectral centroid (Eq. 2.5.4), in 1/mm, of the mean amplitude spectra of rows and columns: larger for
/// smaller features. Each frequency is weighted by its squared amplitude. 0 for an even surface.
///
/// The mean of each row and column is removed, since it is brightness and not a feature.
pub fn fineness_per_mm(image: &GrayImage) -> f64 {
    let (rows, columns) = (row_spectrum(image), row_spectrum(&image.transposed()));
    let frequency = |k: usize, length: usize| k as f64 * image.pixels_per_mm / length as f64;
    // The two spectra may have different bins; a squared amplitude is the power in a bin for any bin width.
    let sums = |spectrum: &[f64], length: usize| {
        let power = |a: &f64| a * a;
        let total: f64 = spectrum.iter().map(power).sum();
        let first: f64 = spectrum.iter().enumerate().map(|(k, a)| frequency(k, length) * power(a)).sum();
        (first, total)
    };
    let ((a, b), (c, d)) = (sums(&rows, image.width), sums(&columns, image.height));
    if (b + d).sqrt() > image.rounding() { (a + c) / (b + d) } else { 0.0 }
}

/// Mean amplitude spectrum of the rows.
fn row_spectrum(image: &GrayImage) -> Vec<f64> {
    let fft = fft::forward(image.width);
    let mut sum = vec![0.0; image.width / 2 + 1];
    for row in image.pixels.chunks(image.width) {
        let mean = row.iter().sum::<f64>() / row.len() as f64;
        let mut spectrum: Vec<Complex64> = row.iter().map(|x| Complex64::new(x - mean, 0.0)).collect();
        fft.process(&mut spectrum);
        let scale = 1.0 / (image.width * image.height) as f64;
        sum.iter_mut().zip(&spectrum).skip(1).for_each(|(sum, x)| *sum += x.norm() * scale);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_signal::noise::Gaussian;
    use std::f64::consts::TAU;

    fn image(size: usize, pixels_per_mm: f64, mut gray: impl FnMut(f64, f64) -> f64) -> GrayImage {
        let pixels = (0..size * size)
            .map(|i| gray((i % size) as f64 / pixels_per_mm, (i / size) as f64 / pixels_per_mm));
        GrayImage::new(size, size, pixels_per_mm, pixels.collect()).unwrap()
    }

    #[test]
    fn an_even_surface_is_perfectly_uniform() {
        assert_eq!(roughness(&image(64, 7.874, |_, _| 0.7)), 1.0);
        assert_eq!(fineness_per_mm(&image(64, 7.874, |_, _| 0.7)), 0.0);
    }

    #[test]
    fn a_picture_of_any_size_takes_the_memory_of_its_pixels() {
        for pixels_per_mm in [1e-300, 1e12, 1e300] {
            let found =
                roughness(&GrayImage::new(8, 8, pixels_per_mm, (0..64).map(f64::from).collect()).unwrap());
            assert!((0.0..=1.0).contains(&found), "{found}");
        }
    }

    #[test]
    fn two_levels_have_their_closed_form() {
        // A checkerboard: neighbours along rows and columns always differ, diagonal ones never do.
        let checkers: Vec<usize> = (0..100 * 100).map(|i| (i % 100 + i / 100) % 2).collect();
        let (straight, diagonal) = (2.0 * 99.0 * 100.0, 2.0 * 99.0 * 99.0);
        // Half of the pairs have each order or kind.
        let part = |pairs: f64| 0.5 * (pairs / (straight + diagonal)).powi(2);
        let found = angular_second_moment(&checkers, 100, 100);
        assert!((found - part(straight) - part(diagonal)).abs() < 1e-6, "{found}");
    }

    #[test]
    fn noise_looks_rougher_than_gentle_waves() {
        let mut noise = Gaussian::new(1);
        let rough = roughness(&image(128, 7.874, |_, _| noise.next_sample()));
        let smooth = roughness(&image(128, 7.874, |x, y| (TAU * x / 4.0).sin() + (TAU * y / 4.0).sin()));
        assert!(rough < 0.5 * smooth, "{rough} against {smooth}");
    }

    #[test]
    fn slow_shading_is_waviness_not_roughness() {
        let mut noise = Gaussian::new(2);
        let grain: Vec<f64> = (0..128 * 128).map(|_| 0.1 * noise.next_sample()).collect();
        let mut values = grain.iter();
        let even = roughness(&image(128, 7.874, |_, _| *values.next().unwrap()));
        let mut values = grain.iter();
        let shaded = roughness(&image(128, 7.874, |x, _| 0.02 * x + *values.next().unwrap()));
        assert!((shaded / even - 1.0).abs() < 0.3, "{shaded} against {even}");
    }

    #[test]
    fn a_grating_is_as_fine_as_its_lines() {
        for per_mm in [0.5, 1.0, 2.0] {
            let grating = image(400, 8.0, |x, y| 3.0 + (TAU * per_mm * x).sin() * (TAU * per_mm * y).cos());
            assert!((fineness_per_mm(&grating) / per_mm - 1.0).abs() < 0.02, "{}", fineness_per_mm(&grating));
        }
    }

    #[test]
    fn two_gratings_weigh_by_their_squared_amplitudes() {
        // Along x: 0.5 lines per mm with twice the amplitude of 2 lines per mm.
        let both = image(400, 8.0, |x, _| 2.0 * (TAU * 0.5 * x).sin() + (TAU * 2.0 * x).sin());
        let expected = (4.0 * 0.5 + 1.0 * 2.0) / 5.0;
        let found = fineness_per_mm(&both);
        assert!((found / expected - 1.0).abs() < 1e-9, "{found}, not {expected}");
    }

    #[test]
    fn unsound_images_are_refused() {
        assert!(matches!(GrayImage::new(3, 2, 1.0, vec![0.0; 5]), Err(ImageError::Size { .. })));
        assert!(matches!(GrayImage::new(1, 5, 1.0, vec![0.0; 5]), Err(ImageError::Size { .. })));
        assert!(matches!(GrayImage::new(2, 2, 0.0, vec![0.0; 4]), Err(ImageError::Scale { .. })));
        assert!(matches!(
            GrayImage::new(2, 2, 1.0, vec![f64::NAN; 4]),
            Err(ImageError::NotFinite { index: 0 })
        ));
    }
}
