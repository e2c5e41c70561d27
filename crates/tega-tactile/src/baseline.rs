//! A baseline from a recording that comes without one.
//!
//! Contact adds shading, so the untouched gel is the picture with the least structure: frames are ranked by the steps
//! between neighbouring cells of a small thumbnail. The median of the quietest few is the baseline. Frames of another
//! brightness (a camera that has just been started) are left out first; being early or late counts for nothing.

use ndarray::{Array3, ArrayView3};

use crate::error::TactileError;
use crate::frame::Pair;

/// Cells along the shorter side of a thumbnail: coarse enough to even out noise and printed dots.
const THUMBNAIL: usize = 40;
/// A frame further than this share from the median brightness is not from a settled camera.
const SETTLED: f64 = 0.04;
/// Quietest frames used: one in ten, within these bounds. Their median survives some that are not quiet after all.
const QUIET_SHARE: usize = 10;
const QUIET_FRAMES: std::ops::RangeInclusive<usize> = 5..=30;

/// An estimated no-contact image, and which frames it was made from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct EstimatedBaseline {
    /// Median of the chosen frames, shape (height, width, 3).
    pub image: Array3<u8>,
    /// Indices of the chosen frames, quietest first.
    pub chosen: Vec<usize>,
}

/// Estimates the no-contact image from the quietest frames of a recording.
///
/// Where the contact moves about and never ceases, the median of frames with the contact in different places is
/// still close to the untouched gel; where it stays in one place for the whole recording, no estimate can remove it.
///
/// # Errors
/// [`TactileError::NoFrames`], or the error of the first frame that is not like the others.
pub fn estimate_baseline(frames: &[ArrayView3<'_, u8>]) -> Result<EstimatedBaseline, TactileError> {
    let first = frames.first().ok_or(TactileError::NoFrames)?;
    let pairs: Vec<Pair<'_>> = frames.iter().map(|f| Pair::new(*f, *first)).collect::<Result<_, _>>()?;
    let seen: Vec<Seen> = pairs.iter().map(look).collect();
    let middle = median_of(seen.iter().map(|s| s.brightness).collect());
    let mut order: Vec<usize> = (0..frames.len())
        .filter(|&i| (seen[i].brightness - middle).abs() <= SETTLED * middle.max(1.0))
        .collect();
    order.sort_by(|&a, &b| seen[a].structure.total_cmp(&seen[b].structure));
    order.truncate((frames.len() / QUIET_SHARE).clamp(*QUIET_FRAMES.start(), *QUIET_FRAMES.end()));
    let chosen: Vec<_> = order.iter().map(|&i| frames[i]).collect();
    Ok(EstimatedBaseline { image: median(&chosen, first.dim()), chosen: order })
}

struct Seen {
    brightness: f64,
    structure: f64,
}

/// Brightness and structure of a frame, from its thumbnail (the pair's baseline is only there for the size check).
fn look(frame: &Pair<'_>) -> Seen {
    let (height, width) = (frame.height(), frame.width());
    let side = (height.min(width) / THUMBNAIL).max(1);
    let (rows, columns) = (height / side, width / side);
    let mut cells = vec![0_u32; rows * columns * 3];
    frame.for_each_row(|y, bytes, _| {
        let row = cells.chunks_exact_mut(columns * 3).nth(y / side);
        for (cell, pixels) in
            row.into_iter().flat_map(|r| r.chunks_exact_mut(3)).zip(bytes.chunks_exact(3 * side))
        {
            for pixel in pixels.as_chunks::<3>().0 {
                cell.iter_mut().zip(pixel).for_each(|(sum, v)| *sum += u32::from(*v));
            }
        }
    });
    let steps = |offset: usize, within: usize| -> f64 {
        let rows = cells.chunks_exact(within);
        rows.flat_map(|r| r.iter().zip(r.iter().skip(offset))).map(|(a, b)| f64::from(a.abs_diff(*b))).sum()
    };
    let scale = (side * side * cells.len()) as f64;
    Seen {
        brightness: cells.iter().map(|&v| f64::from(v)).sum::<f64>() / scale,
        structure: (steps(3, columns * 3) + steps(columns * 3, cells.len())) / scale,
    }
}

fn median_of(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or_default()
}

/// Per-byte median; the lower of the two middle ones for an even number.
fn median(frames: &[ArrayView3<'_, u8>], shape: (usize, usize, usize)) -> Array3<u8> {
    let mut values = Vec::with_capacity(frames.len());
    Array3::from_shape_fn(shape, |at| {
        values.clear();
        values.extend(frames.iter().filter_map(|f| f.get(at).copied()));
        let middle = values.len().saturating_sub(1) / 2;
        if values.is_empty() { 0 } else { *values.select_nth_unstable(middle).1 }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gel() -> Array3<u8> {
        Array3::from_shape_fn((60, 80, 3), |(y, x, c)| (90 + y / 4 + x / 8 + c) as u8)
    }

    fn pressed(at: usize) -> Array3<u8> {
        let mut frame = gel();
        for y in 20..40 {
            for x in at..at + 20 {
                frame[[y, x, 0]] += if x < at + 10 { 60 } else { 0 };
                frame[[y, x, 2]] -= if x < at + 10 { 0 } else { 40 };
            }
        }
        frame
    }

    fn chosen(frames: &[Array3<u8>]) -> EstimatedBaseline {
        estimate_baseline(&frames.iter().map(|f| f.view()).collect::<Vec<_>>()).unwrap()
    }

    #[test]
    fn quiet_frames_are_found_wherever_they_lie() {
        let mut frames = vec![pressed(30); 40];
        frames[0] = gel() / 2; // the camera has just been started
        frames[25..32].fill(gel());
        let found = chosen(&frames);
        assert!(found.chosen.iter().all(|i| (25..32).contains(i)), "{:?}", found.chosen);
        assert_eq!(found.image, gel());
    }

    #[test]
    fn a_contact_that_moves_is_removed_by_the_median() {
        let frames: Vec<_> = (0..5).map(|k| pressed(k * 15 % 60)).collect();
        let off = chosen(&frames).image.iter().zip(&gel()).filter(|(a, b)| a != b).count();
        assert!(off < 60 * 80 * 3 / 50, "{off}");
    }

    #[test]
    fn one_frame_is_its_own_baseline_and_none_is_refused() {
        assert_eq!(chosen(&[gel()]).image, gel());
        assert_eq!(estimate_baseline(&[]), Err(TactileError::NoFrames));
        let other = Array3::<u8>::zeros((3, 3, 3));
        assert!(estimate_baseline(&[gel().view(), other.view()]).is_err());
    }
}
