//! Medians of three planes at once, by their values as whole numbers.

/// The value at this rank, 0 for the smallest, of each of three planes: bit by bit, from the highest on, which takes no
/// longer for one order of the values than for another.
#[inline(always)]
pub(super) fn ranked(planes: &[Vec<i32>; 3], rank: usize) -> [i32; 3] {
    let mut found = [i32::MIN; 3];
    for bit in (0..u32::BITS).rev() {
        for (found, plane) in found.iter_mut().zip(planes) {
            // The highest bit is that of the sign.
            let tried = *found ^ (1 << bit);
            let under: i32 = plane.iter().map(|key| i32::from(*key < tried)).sum();
            if under <= rank as i32 {
                *found = tried;
            }
        }
    }
    found
}

/// A number's bits as a whole number in the order of [`f32::total_cmp`], and back.
#[inline(always)]
pub(super) fn key_of(bits: i32) -> i32 {
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
        fn values_are_ranked_as_sorting_does(values in proptest::collection::vec(proptest::num::i32::ANY, 1..40), low in -3..3, rank in 0..40usize) {
            let rank = rank % values.len();
            let planes = [&|v: i32| v, &|v: i32| v & 7, &|v: i32| low + v.signum()] as [&dyn Fn(i32) -> i32; 3];
            let mut planes = planes.map(|of| values.iter().map(|v| of(*v)).collect::<Vec<_>>());
            let wanted = planes.clone().map(|mut plane| *plane.select_nth_unstable(rank).1);
            for plane in &mut planes {
                plane.resize(40, i32::MAX);
            }
            assert_eq!(ranked(&planes, rank), wanted);
        }
    }
}
