//! Medians of three planes at once, by their values as whole numbers.

/// The values of a plane in the order of [`f32::total_cmp`], as whole numbers: their upper and lower halves, so that many
/// are compared at once.
#[derive(Debug, Clone, Default)]
pub(super) struct Keys {
    cells: usize,
    /// Past the cells, the largest.
    upper: Vec<i16>,
    lower: Vec<i16>,
}

/// Halves that are compared at once.
const TOGETHER: usize = 32;

impl Keys {
    /// For a plane of some thousand cells at most.
    pub fn of(cells: usize) -> Self {
        let largest = || vec![i16::MAX; cells.next_multiple_of(TOGETHER)];
        Self { cells, upper: largest(), lower: largest() }
    }

    /// Takes a plane's first cells.
    #[inline(always)]
    pub fn take(&mut self, plane: &[f32]) {
        let halves = self.upper.iter_mut().zip(&mut self.lower);
        for ((upper, lower), value) in halves.zip(plane).take(self.cells) {
            let key = key_of(value.to_bits() as i32);
            (*upper, *lower) = ((key >> 16) as i16, (key as i16) ^ i16::MIN);
        }
    }

    /// How many upper halves are under one; the lower halves of others than it no longer count.
    #[inline(always)]
    fn keep(&mut self, found: i16) -> i16 {
        for (lower, upper) in self.lower.iter_mut().zip(&self.upper) {
            *lower = if *upper == found { *lower } else { i16::MAX };
        }
        under(&self.upper, found)
    }
}

/// The value in the middle of each plane, the upper one of two.
#[inline(always)]
pub(super) fn middles(planes: &mut [Keys; 3]) -> [f32; 3] {
    let rank = planes.each_ref().map(|plane| (plane.cells / 2) as i16);
    let upper = ranked(planes.each_ref().map(|plane| &plane.upper[..]), rank);
    let mut left = rank;
    for ((left, plane), upper) in left.iter_mut().zip(&mut *planes).zip(upper) {
        *left -= plane.keep(upper);
    }
    let lower = ranked(planes.each_ref().map(|plane| &plane.lower[..]), left);
    std::array::from_fn(|plane| {
        let key = i32::from(upper[plane]) << 16 | i32::from((lower[plane] ^ i16::MIN) as u16);
        f32::from_bits(key_of(key) as u32)
    })
}

/// The value at a rank, 0 for the smallest, of each of three planes: bit by bit, from the highest on, which takes no
/// longer for one order of the values than for another.
#[inline(always)]
fn ranked(planes: [&[i16]; 3], ranks: [i16; 3]) -> [i16; 3] {
    let mut found = [i16::MIN; 3];
    for bit in (0..i16::BITS).rev() {
        for ((found, plane), rank) in found.iter_mut().zip(planes).zip(ranks) {
            // The highest bit is that of the sign.
            let tried = *found ^ (1 << bit);
            if under(plane, tried) <= rank {
                *found = tried;
            }
        }
    }
    found
}

/// How many values are under one.
#[inline(always)]
fn under(plane: &[i16], value: i16) -> i16 {
    plane.iter().map(|key| i16::from(*key < value)).sum()
}

/// A number's bits as a whole number in the order of [`f32::total_cmp`], and back.
#[inline(always)]
fn key_of(bits: i32) -> i32 {
    bits ^ ((bits >> 31) as u32 >> 1) as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_in_the_order_of_the_numbers_and_lead_back() {
        let numbers =
            [f32::NEG_INFINITY, -2.5, -f32::MIN_POSITIVE, -0.0, 0.0, 1e-40, 3.0, f32::INFINITY, f32::NAN];
        let keys = numbers.map(|v| key_of(v.to_bits() as i32));
        assert!(keys.is_sorted(), "{keys:?}");
        assert_eq!(keys.map(|k| key_of(k) as u32), numbers.map(f32::to_bits));
    }

    proptest::proptest! {
        #[test]
        fn the_middle_is_that_of_sorting(values in proptest::collection::vec(proptest::num::u32::ANY, 1..70), near in 0..1u32 << 18) {
            // Any numbers, few that differ in both halves, and many that are alike.
            let planes = [&|v: u32| v, &|v: u32| near + (v & 0x1_0003), &|v: u32| near & (v | 1)] as [&dyn Fn(u32) -> u32; 3];
            let planes = planes.map(|of| values.iter().map(|v| f32::from_bits(of(*v))).collect::<Vec<_>>());
            let mut keys = [0; 3].map(|_| Keys::of(values.len()));
            keys.iter_mut().zip(&planes).for_each(|(keys, plane)| keys.take(plane));
            let wanted = planes.map(|mut plane| *plane.select_nth_unstable_by(values.len() / 2, f32::total_cmp).1);
            assert_eq!(middles(&mut keys).map(f32::to_bits), wanted.map(f32::to_bits));
        }
    }
}
