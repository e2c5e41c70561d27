//! The baseline of a recording of any frames.

use ndarray::{Array3, s};
use tega_tactile::{BaselineSource, TactileError, estimate_baseline, median_image};

use super::pictures::{draw, laid_out};
use crate::bytes::Bytes;

/// Any frames: no panic; the baseline is per pixel the median of the frames it names, or one error says what is wrong.
pub fn baseline_survives_any_frames(data: &[u8]) {
    let mut bytes = Bytes(data);
    let (height, width) = if bytes.flag() {
        (1 + bytes.up_to(59), 1 + bytes.up_to(79))
    } else {
        (bytes.up_to(6), bytes.up_to(6))
    };
    let odd_one = bytes.byte();
    let count = bytes.up_to(14);
    let mut frames: Vec<Array3<u8>> = vec![];
    let mut picture = Array3::from_elem((height, width, 3), bytes.byte());
    for number in 0..count {
        // Most frames of a recording are nearly the one before.
        if bytes.up_to(7) == 7 {
            picture.fill(bytes.byte());
        }
        if !picture.is_empty() {
            draw(&mut bytes, &mut picture);
        }
        frames.push(match usize::from(odd_one) {
            layout @ 0..64 => laid_out(picture.clone(), layout as u8),
            odd if odd == number + 64 => Array3::zeros((width + 1, height, 3)),
            odd if odd == number + 128 => Array3::zeros((height, width, 4)),
            _ => picture.clone(),
        });
    }
    let views: Vec<_> = frames.iter().map(|frame| frame.view()).collect();
    let usable = frames.iter().all(|frame| {
        let (height, width, channels) = frame.dim();
        frame.dim() == frames[0].dim() && height > 0 && width > 0 && channels == 3
    });
    let estimate = match estimate_baseline(&views) {
        Ok(estimate) => estimate,
        Err(TactileError::NoFrames) => return assert!(frames.is_empty()),
        Err(_) => return assert!(!usable),
    };
    assert!(usable);
    let chosen = &estimate.choice.frames;
    assert!(!chosen.is_empty() && chosen.is_sorted_by(|a, b| a < b) && chosen.iter().all(|at| *at < count));
    assert!(estimate.choice.source == BaselineSource::QuietFrames || chosen.len() >= 5);
    for ((y, x, c), value) in estimate.image.indexed_iter() {
        let mut column: Vec<u16> = chosen.iter().map(|at| u16::from(frames[*at][[y, x, c]])).collect();
        column.sort_unstable();
        let n = column.len();
        assert_eq!(u16::from(*value), (column[(n - 1) / 2] + column[n / 2]).div_ceil(2), "{n} frames");
    }
    assert_eq!(estimate_baseline(&views), Ok(estimate));
    if let [first, ..] = &frames[..] {
        let same = vec![first.view(); count];
        assert_eq!(median_image(&same).as_ref(), Ok(first));
        assert!(median_image(&[first.view(), first.slice(s![..0, .., ..])]).is_err());
    }
}
