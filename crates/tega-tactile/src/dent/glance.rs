//! A first look at a fraction of the frame: two rows of pixels of every row of cells.
//!
//! A cell's response is at most as long as the range of the cells' values, per channel and in noise units: it is measured
//! from their median, and smoothing leaves no range. While that range, as seen on two rows, stays under [`NEAR`], no
//! cell can come near the gate, and the rest of the frame is not read. An untouched gel stays under it; a change of
//! colour that varies over the picture may not, and costs the full reading, never a wrong answer.

use super::cells::{self, Grid, Range, Strip};
use super::response::NOISE;
use crate::frame::{Order, Pair};
use crate::simd;

/// Range of the cells' values under which nothing is in contact, noise units. Drawn gels at rest show 4 to 7 of them, drawn
/// presses of the promised smallest area 17.8 or more in 400, the faintest press that the gate lets through at all 14.1
/// in 820, real presses and grips 21.9 or more.
const NEAR: f32 = 10.0;
/// Smaller cells have no rows to spare.
const LEAST_SIDE: usize = 4;

/// Whether any cell may be in contact.
#[inline(never)]
pub(super) fn may_touch(pair: &Pair<'_>, grid: &Grid, order: Order, strip: &mut Strip) -> bool {
    grid.side < LEAST_SIDE || range(pair, grid, order, strip, NEAR) >= NEAR
}

/// The range of the cells' values in noise units, as seen on two rows of each row of cells; stops once it is `enough`.
fn range(pair: &Pair<'_>, grid: &Grid, order: Order, strip: &mut Strip, enough: f32) -> f32 {
    let noise = match order {
        Order::Bgr => NOISE,
        Order::Rgb => [NOISE[2], NOISE[1], NOISE[0]],
    };
    let scale = noise.map(|noise| 1.0 / ((2 * grid.side) as f32 * noise));
    let mut ranges = [Range::default(); 3];
    let mut length = 0.0;
    for first in (0..grid.height).step_by(grid.side) {
        let height = grid.side.min(grid.height - first);
        strip.clear(grid);
        for row in [first + height / 4, first + 3 * height / 4] {
            pair.with_rows(row..row + 1, |frame, baseline| {
                simd::add_difference(strip.sums(), frame, baseline);
            });
        }
        cells::widen(strip, grid, &mut ranges);
        let [a, b, c] = [0, 1, 2].map(|c| ranges[c].width() as f32 * scale[c]);
        length = (a * a + b * b + c * c).sqrt();
        if length >= enough {
            break;
        }
    }
    length
}

#[cfg(test)]
#[path = "../../tests/slopes/mod.rs"]
mod slopes;

#[cfg(test)]
mod tests {
    use super::super::{LiveScratch, respond_in_full};
    use super::slopes::{Drift, Gel, Press, Random};
    use super::*;
    use proptest::prelude::*;

    const SIZES: [(usize, usize); 5] = [(240, 320), (320, 240), (120, 160), (213, 301), (480, 640)];

    /// The range that the glance sees, and whether the full reading finds a contact.
    fn both(seed: u64, size: usize, across: f32, press: Option<Press>) -> (f32, bool) {
        let mut random = Random(seed);
        let (height, width) = SIZES[size];
        let gel = Gel::any(&mut random, height, width);
        let baseline = gel.frame(&mut random, None, Drift::default());
        let mut three = |most: f32| [(); 3].map(|()| random.between(-most, most));
        let drift = Drift { step: three(20.0), across: three(across), down: three(across) };
        let frame = gel.frame(&mut random, press, drift);
        let pair = Pair::new(frame.view(), baseline.view()).unwrap();
        let grid = Grid::of(height, width);
        let mut scratch = LiveScratch::default();
        let seen = range(&pair, &grid, Order::Bgr, &mut scratch.strip, f32::INFINITY);
        (seen, respond_in_full(&pair, &grid, Order::Bgr, None, &mut scratch))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(100))]

        /// Presses from half the promised size on: whatever the full reading takes for contact is far from being overlooked.
        #[test]
        fn a_contact_is_never_overlooked(
            seed: u64, size in 0..SIZES.len(), x in 0_f32..=1.0, y in 0_f32..=1.0, contact_radius in 8_f32..40.0
        ) {
            let press = Press { centre: [x, y], contact_radius, ball_radius: 82.2 };
            let (seen, contact) = both(seed, size, 3.0, Some(press));
            prop_assert!(!contact || seen > 1.3 * NEAR, "{press:?} {seen}");
        }

        #[test]
        fn a_gel_at_rest_needs_no_second_look(seed: u64, size in 0..SIZES.len()) {
            let (seen, contact) = both(seed, size, 0.5, None);
            prop_assert!(!contact && seen < NEAR, "{seen}");
        }
    }
}
