//! Recorded frames: a PNG file to the bytes a camera would have delivered.
//!
//! The decoding is the `png` crate's, about twice as fast as libpng on a fingertip camera's pictures. What is
//! added here is strictness: a recording is either whole or refused.
#![forbid(unsafe_code)]

use std::io::Cursor;

use png::{BitDepth, ColorType, Decoder, Limits, Transformations};

/// Most pixels decoded: larger than any camera's frame, small enough that no file asks for all memory.
const MAX_PIXELS: usize = 1 << 26;

/// Deflate makes at most 1032 bytes of one, so a shorter file than its header's picture needs is cut short or forged.
const MOST_INFLATION: usize = 1032;

/// What the decoder may take for everything but the picture, bytes.
const MOST_BESIDE: usize = 1 << 24;

/// Why a file is no frame.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// The file is cut short, damaged, or not PNG at all.
    #[error("{0}")]
    Png(#[from] png::DecodingError),
    /// More pixels than any camera delivers.
    #[error("{height}x{width} pixels (height x width), at most {MAX_PIXELS} in all are read")]
    TooLarge {
        /// Rows.
        height: usize,
        /// Columns.
        width: usize,
    },
    /// Fewer bytes than the header's picture takes at the least.
    #[error("{bytes} bytes cannot hold {height}x{width} pixels (height x width): cut short or forged")]
    TooShort {
        /// Of the file.
        bytes: usize,
        /// Rows.
        height: usize,
        /// Columns.
        width: usize,
    },
}

/// An 8-bit colour image: blue, green, red, row by row from the top.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Bgr {
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// `3 * height * width` bytes.
    pub bytes: Vec<u8>,
}

/// Decodes a whole PNG file; `None` for a whole one with 16-bit samples or a palette, which no camera writes and whose
/// conversion is left to the caller.
///
/// Grey is repeated in all channels, transparency is dropped. Checksums and the end marker have to be there.
///
/// # Errors
/// [`ImageError`] when the file is not a whole, undamaged PNG.
///
/// # Examples
/// ```
/// assert!(tega_image::decode_png(b"not a picture").is_err());
/// ```
pub fn decode_png(file: &[u8]) -> Result<Option<Bgr>, ImageError> {
    let limits = Limits { bytes: MOST_BESIDE };
    let mut decoder = Decoder::new_with_limits(Cursor::new(file), limits);
    // Expanding a palette whose length is no multiple of three panics in `png` 0.18, so palettes are not expanded.
    let header = decoder.read_header_info()?;
    let indexed = header.color_type == ColorType::Indexed;
    // Before anything is allocated by these numbers, which are whatever the file says.
    let (height, width) = (header.height as usize, header.width as usize);
    let row_bytes = header.raw_row_length_from_width(header.width).saturating_sub(1);
    if height.saturating_mul(width) > MAX_PIXELS {
        return Err(ImageError::TooLarge { height, width });
    }
    if height.saturating_mul(row_bytes) / MOST_INFLATION > file.len() {
        return Err(ImageError::TooShort { bytes: file.len(), height, width });
    }
    decoder.set_transformations(if indexed { Transformations::IDENTITY } else { Transformations::EXPAND });
    let mut reader = decoder.read_info()?;
    let mut decoded = vec![0; reader.output_buffer_size().unwrap_or_default()];
    let frame = reader.next_frame(&mut decoded)?;
    reader.finish()?;
    if frame.bit_depth != BitDepth::Eight {
        return Ok(None);
    }
    let pixels = &decoded[..frame.buffer_size().min(decoded.len())];
    let bytes = match frame.color_type {
        ColorType::Rgb => pixels.as_chunks::<3>().0.iter().flat_map(|[r, g, b]| [*b, *g, *r]).collect(),
        ColorType::Rgba => pixels.as_chunks::<4>().0.iter().flat_map(|[r, g, b, _]| [*b, *g, *r]).collect(),
        ColorType::Grayscale => pixels.iter().flat_map(|v| [*v; 3]).collect(),
        ColorType::GrayscaleAlpha => pixels.as_chunks::<2>().0.iter().flat_map(|[v, _]| [*v; 3]).collect(),
        ColorType::Indexed => return Ok(None),
    };
    Ok(Some(Bgr { height, width, bytes }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn encode(color: ColorType, width: u32, height: u32, bytes: &[u8]) -> Vec<u8> {
        let mut file = Vec::new();
        let mut encoder = png::Encoder::new(&mut file, width, height);
        encoder.set_color(color);
        encoder.set_depth(BitDepth::Eight);
        encoder.write_header().unwrap().write_image_data(bytes).unwrap();
        file
    }

    #[test]
    fn colours_come_in_camera_order() {
        let file = encode(ColorType::Rgb, 2, 1, &[1, 2, 3, 4, 5, 6]);
        assert_eq!(
            decode_png(&file).unwrap(),
            Some(Bgr { height: 1, width: 2, bytes: vec![3, 2, 1, 6, 5, 4] })
        );
        let file = encode(ColorType::Grayscale, 1, 2, &[7, 9]);
        assert_eq!(decode_png(&file).unwrap().unwrap().bytes, [7, 7, 7, 9, 9, 9]);
        let file = encode(ColorType::Rgba, 1, 1, &[1, 2, 3, 0]);
        assert_eq!(decode_png(&file).unwrap().unwrap().bytes, [3, 2, 1]);
    }

    #[test]
    fn palettes_and_16_bits_are_left_to_the_caller_but_have_to_be_whole() {
        let mut file = Vec::new();
        let mut encoder = png::Encoder::new(&mut file, 2, 1);
        encoder.set_color(ColorType::Indexed);
        encoder.set_palette(vec![1, 2, 3, 4, 5, 6]);
        encoder.write_header().unwrap().write_image_data(&[0, 1]).unwrap();
        assert_eq!(decode_png(&file).unwrap(), None);
        assert!(decode_png(&file[..file.len() - 12]).is_err());

        let mut file = Vec::new();
        let mut encoder = png::Encoder::new(&mut file, 1, 1);
        encoder.set_depth(BitDepth::Sixteen);
        encoder.write_header().unwrap().write_image_data(&[1, 2]).unwrap();
        assert_eq!(decode_png(&file).unwrap(), None);
    }

    #[test]
    fn a_file_cut_anywhere_is_refused() {
        let picture: Vec<u8> = (0..60 * 40 * 3).map(|i| (i * 7 % 251) as u8).collect();
        let file = encode(ColorType::Rgb, 60, 40, &picture);
        assert!(decode_png(&file).is_ok());
        for end in 0..file.len() {
            assert!(decode_png(&file[..end]).is_err(), "cut at {end} of {}", file.len());
        }
    }

    #[test]
    fn a_forged_size_is_refused_before_memory_is_asked_for() {
        let forged = |width: u32, height: u32| {
            let mut file = Vec::new();
            let mut encoder = png::Encoder::new(&mut file, width, height);
            encoder.set_color(ColorType::Rgba);
            encoder.set_depth(BitDepth::Eight);
            drop(encoder.write_header().unwrap());
            decode_png(&file).unwrap_err()
        };
        assert!(matches!(forged(1 << 14, 1 << 14), ImageError::TooLarge { height: 16384, width: 16384 }));
        assert!(matches!(forged(u32::MAX >> 1, u32::MAX >> 1), ImageError::TooLarge { .. }));
        let error = forged(4096, 4096);
        assert!(matches!(error, ImageError::TooShort { .. }), "{error}");
        assert!(
            error.to_string().ends_with("cannot hold 4096x4096 pixels (height x width): cut short or forged")
        );
    }

    #[test]
    fn the_best_packed_picture_is_read() {
        let file = encode(ColorType::Grayscale, 4000, 4000, &vec![0; 16_000_000]);
        assert!(file.len() < 40_000, "{}", file.len());
        assert_eq!(decode_png(&file).unwrap().unwrap().width, 4000);
    }

    proptest! {
        #[test]
        fn a_changed_byte_never_panics_and_is_refused_in_the_data(at in 0_usize..2000, value in 1_u8..) {
            let picture: Vec<u8> = (0..30 * 20 * 3).map(|i| (i * 7 % 251) as u8).collect();
            let mut file = encode(ColorType::Rgb, 30, 20, &picture);
            let at = at % file.len();
            file[at] ^= value;
            let whole = decode_png(&file);
            // Only a length or type of a chunk that is not needed may be changed unnoticed; never a pixel.
            if let Ok(Some(image)) = whole {
                let rgb: Vec<u8> = image.bytes.as_chunks::<3>().0.iter().flat_map(|[b, g, r]| [*r, *g, *b]).collect();
                prop_assert_eq!(rgb, picture);
            }
        }
    }
}
