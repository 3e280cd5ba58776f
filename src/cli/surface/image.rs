//! `haptograph surface image`: visual roughness and fineness of a photograph (thesis 3.2.1 and 3.2.4).

use super::Failure;
use crate::cli::import::number;
use crate::cli::result::{CommandResult, show};
use crate::cli::table::{facts, significant};
use crate::learning::metrics::{GrayImage, fineness_per_mm, roughness};
use crate::signal::files;
use png::{BitDepth, ColorType, Decoder, Limits, Transformations};
use serde::Serialize;
use std::io::Cursor;
use std::path::PathBuf;

/// Measure the visual roughness and fineness of a photograph of a surface
///
/// Roughness is the angular second moment of the grey levels of neighbouring pixels, after removal of
/// shades wider than 2.54 mm (thesis 3.2.1). Fineness is the spectral centroid of rows and columns. Both
/// depend on the camera and on the resolution: compare only pictures taken alike. The thesis has 500 pixels
/// for 63.5 mm.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The photograph, from above in even light: PNG or uncompressed BMP, up to 2048 pixels wide and high
    file: PathBuf,
    /// Width of the material in the picture, mm
    #[arg(long, value_name = "MM", value_parser = millimetres)]
    mm: f64,
    /// Print the measures as JSON
    #[arg(long)]
    json: bool,
}

/// Reads a width of 1 mm to 10 m: the Gaussian that is taken off has a fixed width.
fn millimetres(text: &str) -> Result<f64, String> {
    number(text, 1.0..=1e4, "expected a number from 1 to 10000")
}

/// Largest width and height, pixels.
const MAX_SIDE: usize = 2048;
/// Weights of red, green and blue in the grey value (ITU-R BT.601).
const LUMA: [f64; 3] = [0.299, 0.587, 0.114];

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let failed = |error: &dyn std::fmt::Display| Failure::file("read", &arguments.file, error);
    let bytes = files::read(&arguments.file, files::MAX_PICTURE_BYTES).map_err(|error| failed(&error))?;
    let Picture { width, height, gray } = Picture::read(&bytes).map_err(|error| failed(&error))?;
    let pixels_per_mm = width as f64 / arguments.mm;
    let image = GrayImage::new(width, height, pixels_per_mm, gray).map_err(|error| failed(&error))?;
    let measured = Measured {
        angular_second_moment: roughness(&image),
        fineness_per_mm: fineness_per_mm(&image),
        height_px: height,
        pixels_per_mm,
        width_px: width,
    };
    show(&measured, arguments.json)
}

#[derive(Serialize)]
struct Measured {
    angular_second_moment: f64,
    fineness_per_mm: f64,
    height_px: usize,
    pixels_per_mm: f64,
    width_px: usize,
}

impl CommandResult for Measured {
    fn text(&self) -> String {
        let scale = significant(self.pixels_per_mm, 4);
        let roughness = significant(self.angular_second_moment, 3);
        facts(&[
            ("picture", format!("{} x {} pixels, {scale} pixels/mm", self.width_px, self.height_px)),
            (
                "roughness",
                format!("angular second moment {roughness} (1 if even; the smaller, the rougher it looks)"),
            ),
            ("fineness", format!("{} cycles/mm (spectral centroid)", significant(self.fineness_per_mm, 3))),
        ])
    }
}

/// The grey values of a picture, by row.
#[derive(Debug)]
struct Picture {
    width: usize,
    height: usize,
    gray: Vec<f64>,
}

impl Picture {
    fn read(bytes: &[u8]) -> Result<Self, String> {
        match bytes {
            [0x89, b'P', b'N', b'G', ..] => Self::of_png(bytes),
            [b'B', b'M', ..] => Self::of_bmp(bytes),
            [0xff, 0xd8, ..] => Err("it is a JPEG, whose compression changes the grain of a surface; \
                 give a PNG or BMP picture that was never a JPEG"
                .to_owned()),
            _ => Err("it is neither a PNG nor a BMP picture".to_owned()),
        }
    }

    /// Refuses a size before memory is used for it.
    fn check(width: u64, height: u64) -> Result<(usize, usize), String> {
        let side = |pixels: u64| usize::try_from(pixels).ok().filter(|side| (2..=MAX_SIDE).contains(side));
        side(width).zip(side(height)).ok_or_else(|| {
            format!(
                "it has {width} x {height} pixels; width and height must be from 2 to {MAX_SIDE}: crop it to the material or scale it down"
            )
        })
    }

    fn of_png(bytes: &[u8]) -> Result<Self, String> {
        let limits = Limits { bytes: files::MAX_PICTURE_BYTES as usize };
        let mut decoder = Decoder::new_with_limits(Cursor::new(bytes), limits);
        decoder.set_transformations(Transformations::EXPAND);
        let mut reader = decoder.read_info().map_err(|error| error.to_string())?;
        let (width, height) = Self::check(reader.info().width.into(), reader.info().height.into())?;
        let size = reader.output_buffer_size().ok_or("it is too large")?;
        let mut samples = vec![0; size];
        let frame = reader.next_frame(&mut samples).map_err(|error| error.to_string())?;
        let channels = frame.color_type.samples();
        let is_gray = matches!(frame.color_type, ColorType::Grayscale | ColorType::GrayscaleAlpha);
        let gray = |pixel: &[f64]| match is_gray {
            true => pixel[0],
            false => gray([pixel[0], pixel[1], pixel[2]]),
        };
        let values: Vec<f64> = match frame.bit_depth {
            BitDepth::Sixteen => {
                let (pairs, _) = samples.as_chunks::<2>();
                pairs.iter().map(|pair| f64::from(u16::from_be_bytes(*pair))).collect()
            }
            _ => samples.iter().map(|sample| f64::from(*sample)).collect(),
        };
        let gray = values.chunks_exact(channels).map(gray).collect();
        Ok(Self { width, height, gray })
    }

    /// An uncompressed BMP of 24 or 32 bits per pixel.
    fn of_bmp(bytes: &[u8]) -> Result<Self, String> {
        let cut = || "the file ends within the picture".to_owned();
        let number = |at: usize| -> Result<u32, String> {
            let four = bytes.get(at..).and_then(|rest| rest.first_chunk::<4>());
            four.map(|four| u32::from_le_bytes(*four)).ok_or_else(cut)
        };
        let (start, head) = (number(10)? as usize, number(14)?);
        let (width, height) = (number(18)? as i32, number(22)? as i32);
        let (bits, compression) = (number(28)? & 0xffff, number(30)?);
        let pixel = match (bits, compression) {
            (24, 0) => 3,
            (32, 0) => 4,
            _ if head < 40 => return Err("it is an OS/2 bitmap; save it as PNG".to_owned()),
            _ => {
                return Err(format!(
                    "its pixels have {bits} bits with compression {compression}; only uncompressed ones of 24 or 32 bits are read: save it as PNG"
                ));
            }
        };
        let size = u64::try_from(width).map(|width| (width, u64::from(height.unsigned_abs())));
        let (width, rows) = size.map_err(|_| format!("its width is {width} pixels"))?;
        let (width, rows) = Self::check(width, rows)?;
        // Rows are padded to whole words.
        let stride = (width * pixel).next_multiple_of(4);
        let data = bytes.get(start..).and_then(|data| data.get(..rows * stride)).ok_or_else(cut)?;
        let mut lines: Vec<&[u8]> = data.chunks_exact(stride).collect();
        // A positive height counts from the bottom.
        if height > 0 {
            lines.reverse();
        }
        let gray_of = |bgr: &[u8]| gray([bgr[2], bgr[1], bgr[0]].map(f64::from));
        let pixels = lines.iter().flat_map(|line| line[..width * pixel].chunks_exact(pixel));
        Ok(Self { width, height: rows, gray: pixels.map(gray_of).collect() })
    }
}

fn gray(rgb: [f64; 3]) -> f64 {
    rgb.iter().zip(LUMA).map(|(part, weight)| part * weight).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (u32, u32) = (5, 3);

    fn colour(x: u32, y: u32) -> [u8; 3] {
        [(40 * x) as u8, (60 * y) as u8, (7 * x * y) as u8]
    }

    fn expected() -> Vec<f64> {
        let places = (0..SIZE.1).flat_map(|y| (0..SIZE.0).map(move |x| colour(x, y)));
        places.map(|rgb| gray(rgb.map(f64::from))).collect()
    }

    fn bmp(bits: u16, height: i32) -> Vec<u8> {
        let mut bytes = b"BM\0\0\0\0\0\0\0\0".to_vec();
        for number in [54, 40, SIZE.0, height as u32, u32::from(bits) << 16 | 1, 0, 0, 0, 0, 0, 0] {
            bytes.extend(number.to_le_bytes());
        }
        for row in 0..SIZE.1 {
            let y = if height > 0 { SIZE.1 - 1 - row } else { row };
            let first = bytes.len();
            for x in 0..SIZE.0 {
                let [r, g, b] = colour(x, y);
                bytes.extend([b, g, r]);
                bytes.extend(vec![255; usize::from(bits / 8) - 3]);
            }
            let length = (bytes.len() - first).next_multiple_of(4);
            bytes.resize(first + length, 0);
        }
        bytes
    }

    fn png(colour_type: ColorType, depth: BitDepth, samples: &[u8]) -> Vec<u8> {
        let mut bytes = vec![];
        let mut encoder = png::Encoder::new(&mut bytes, SIZE.0, SIZE.1);
        encoder.set_color(colour_type);
        encoder.set_depth(depth);
        encoder.write_header().unwrap().write_image_data(samples).unwrap();
        bytes
    }

    #[test]
    fn bitmaps_and_png_of_one_picture_are_alike() {
        for (bits, height) in [(24, 3), (24, -3), (32, 3)] {
            let read = Picture::read(&bmp(bits, height)).unwrap();
            assert_eq!((read.width, read.height, read.gray), (5, 3, expected()));
        }
        let places = || (0..SIZE.1).flat_map(|y| (0..SIZE.0).map(move |x| colour(x, y)));
        let read =
            Picture::read(&png(ColorType::Rgb, BitDepth::Eight, &places().flatten().collect::<Vec<u8>>()));
        assert_eq!(read.unwrap().gray, expected());
        let deep: Vec<u8> = places().flat_map(|[r, ..]| u16::from(r).to_be_bytes()).collect();
        let read = Picture::read(&png(ColorType::Grayscale, BitDepth::Sixteen, &deep));
        assert_eq!(read.unwrap().gray, places().map(|[r, ..]| f64::from(r)).collect::<Vec<f64>>());
    }

    #[test]
    fn unsound_pictures_are_refused() {
        let whole = bmp(24, 3);
        for length in 0..whole.len() {
            assert!(Picture::read(&whole[..length]).is_err(), "{length} bytes");
        }
        let with = |at: usize, number: u32| {
            let mut bytes = whole.clone();
            bytes[at..at + 4].copy_from_slice(&number.to_le_bytes());
            Picture::read(&bytes).unwrap_err()
        };
        assert!(with(18, 100_000).contains("100000 x 3 pixels"));
        assert!(with(22, i32::MIN as u32).contains("2147483648 pixels"));
        assert!(with(18, u32::MAX).contains("-1 pixels"));
        assert!(with(30, 1).contains("compression 1"));
        assert!(with(10, u32::MAX).contains("ends"));
        let whole = png(ColorType::Grayscale, BitDepth::Eight, &[9; 15]);
        for length in 0..whole.len() - 24 {
            assert!(Picture::read(&whole[..length]).is_err(), "{length} bytes");
        }
        assert!(Picture::read(&[0xff, 0xd8, 0xff]).unwrap_err().contains("JPEG"));
    }
}
