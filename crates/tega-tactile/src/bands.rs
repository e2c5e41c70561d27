//! Compare pictures band by band: a few pixels of each, and how far those of two pictures are apart.

use ndarray::{ArrayView3, Axis};

use crate::frame::row_bytes;

/// Bands of a picture, from its first row to its last. Pictures were seen with a tenth of another sensor's lines: of so
/// many bands, one lies wholly within.
const BANDS: usize = 24;
const ROWS_A_BAND: usize = 2;
const COLUMNS: usize = 40;
/// Pixels that stand for a band.
const PIXELS: usize = ROWS_A_BAND * COLUMNS;

/// The pixels that stand for each band, three bytes each, evenly over the picture; empty where it has none.
///
/// # Examples
/// ```
/// let grey = ndarray::Array3::from_elem((64, 48, 3), 7);
/// assert_eq!(tega_tactile::picture_bands(grey.view()), [7; 24 * 80 * 3]);
/// ```
pub fn picture_bands(image: ArrayView3<'_, u8>) -> Vec<u8> {
    let (height, width, channels) = image.dim();
    if height * width == 0 || channels != 3 {
        return Vec::new();
    }
    // The middle of each part of a side.
    let middle = |k: usize, parts: usize, side: usize| (2 * k + 1) * side / (2 * parts);
    let columns: [usize; COLUMNS] = std::array::from_fn(|k| middle(k, COLUMNS, width));
    let (mut taken, mut gathered) = (Vec::with_capacity(3 * BANDS * PIXELS), Vec::new());
    for k in 0..BANDS * ROWS_A_BAND {
        let row = image.index_axis(Axis(0), middle(k, BANDS * ROWS_A_BAND, height));
        let pixels = row_bytes(&row, &mut gathered).as_chunks::<3>().0;
        taken.extend(columns.iter().filter_map(|x| pixels.get(*x)).flatten());
    }
    taken
}

/// Of each band the median over its pixels of the largest difference of a colour, counts of 255; empty unless both are
/// what [`picture_bands`] took of a picture.
///
/// # Examples
/// ```
/// let [dark, light] = [7, 19].map(|grey| ndarray::Array3::from_elem((64, 48, 3), grey));
/// let [dark, light] = [dark, light].map(|image| tega_tactile::picture_bands(image.view()));
/// assert_eq!(tega_tactile::band_distances(&dark, &light), [12.0; 24]);
/// ```
pub fn band_distances(one: &[u8], other: &[u8]) -> Vec<f64> {
    let whole = 3 * BANDS * PIXELS;
    if one.len() != whole || other.len() != whole {
        return Vec::new();
    }
    one.chunks_exact(3 * PIXELS).zip(other.chunks_exact(3 * PIXELS)).map(|(a, b)| distance(a, b)).collect()
}

fn distance(one: &[u8], other: &[u8]) -> f64 {
    let mut counts = [0_usize; 256];
    for (a, b) in one.as_chunks::<3>().0.iter().zip(other.as_chunks::<3>().0) {
        let apart = a[0].abs_diff(b[0]).max(a[1].abs_diff(b[1])).max(a[2].abs_diff(b[2]));
        counts[usize::from(apart)] += 1;
    }
    // The two in the middle of an even number of pixels.
    let at = |rank: usize| {
        let mut below = 0;
        counts.iter().position(|n| {
            below += n;
            below > rank
        })
    };
    let [low, high] = [at(PIXELS / 2 - 1), at(PIXELS / 2)].map(|level| level.unwrap_or_default() as f64);
    f64::midpoint(low, high)
}
