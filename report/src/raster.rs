//! Images of many cells as PNG inside SVG: rectangles would take a hundred times the space.

use super::theme::heat;

/// A grid of values, bottom row first.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `height` rows of `width` values each, the bottom one first; NaN is drawn in the lowest colour.
    pub values: Vec<f64>,
}

impl Grid {
    /// The PNG as a `data:` URL, with `low` in the darkest colour and `high` in the brightest.
    pub(crate) fn to_address(&self, low: f64, high: f64) -> String {
        let palette = (0..=255u8).flat_map(|level| heat(f64::from(level) / 255.0));
        self.address((low, high), palette.collect())
    }

    /// The same in light greys, as a background.
    pub(crate) fn to_grey_address(&self, low: f64, high: f64) -> String {
        let grey = |level: u8| 120 + (u16::from(level) * 120 / 255) as u8;
        self.address((low, high), (0..=255u8).flat_map(|level| [grey(level); 3]).collect())
    }

    fn address(&self, (low, high): (f64, f64), palette: Vec<u8>) -> String {
        let span = if high > low { high - low } else { 1.0 };
        let mut levels = Vec::with_capacity(self.width * self.height);
        for row in (0..self.height).rev() {
            let cells = self.values.iter().skip(row * self.width).take(self.width);
            levels.extend(cells.map(|value| (((value - low) / span).clamp(0.0, 1.0) * 255.0).round() as u8));
            levels.resize((self.height - row) * self.width, 0);
        }
        encode((self.width, self.height), &levels, palette)
            .map(|png| format!("data:image/png;base64,{}", base64(&png)))
            .unwrap_or_default()
    }
}

fn encode(
    (width, height): (usize, usize),
    levels: &[u8],
    palette: Vec<u8>,
) -> Result<Vec<u8>, png::EncodingError> {
    let mut bytes = Vec::new();
    let size = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
    let mut encoder = png::Encoder::new(&mut bytes, size(width), size(height));
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::High);
    encoder.set_palette(palette);
    encoder.write_header()?.write_image_data(levels)?;
    Ok(bytes)
}

fn base64(bytes: &[u8]) -> String {
    use base64::Engine as _;
    base64::engine::general_purpose::STANDARD.encode(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_row_is_at_the_bottom_of_the_picture() {
        let grid = Grid { width: 2, height: 2, values: vec![0.0, 0.0, 1.0, f64::NAN] };
        let address = grid.to_address(0.0, 1.0);
        let data = address.strip_prefix("data:image/png;base64,").unwrap();
        use base64::Engine as _;
        let png = base64::engine::general_purpose::STANDARD.decode(data).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(png)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        assert_eq!(&pixels[..4], &[255, 0, 0, 0]);
    }
}
