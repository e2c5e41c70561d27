//! Random numbers by counting: the same seed, stream and number give the same value in any order, on any machine.

/// One stream of a seed.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Stream(u64);

impl Stream {
    pub(crate) fn new(seed: u64, stream: u64) -> Self {
        Self(mix(mix(seed).wrapping_add(stream.wrapping_mul(0xD1B5_4A32_D192_ED03))))
    }

    /// 64 random bits.
    pub(crate) fn bits(self, number: u64) -> u64 {
        mix(self.0.wrapping_add(number.wrapping_mul(0x9E37_79B9_7F4A_7C15)))
    }

    /// Close to a standard normal: the sum of twelve 16-bit numbers, which needs no library function whose last bit
    /// could differ from machine to machine. It ends at 6 and its kurtosis is 2.9.
    pub(crate) fn normal(self, number: u64) -> f32 {
        let sum: u64 = (0..3)
            .map(|word| {
                let bits = self.bits(3 * number + word);
                (bits & 0xFFFF) + (bits >> 16 & 0xFFFF) + (bits >> 32 & 0xFFFF) + (bits >> 48)
            })
            .sum();
        // Each has mean 32767.5 and variance (2^32 - 1) / 12, so that their sum has deviation 65536.
        (sum as f32 - 12.0 * 32767.5) / 65536.0
    }
}

/// The finaliser of `SplitMix64`.
fn mix(mut z: u64) -> u64 {
    z = z.wrapping_add(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normals_have_mean_0_and_deviation_1() {
        let stream = Stream::new(3, 1);
        let n = 100_000;
        let drawn: Vec<f64> = (0..n).map(|i| f64::from(stream.normal(i))).collect();
        let mean = drawn.iter().sum::<f64>() / n as f64;
        let variance = drawn.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / n as f64;
        assert!(mean.abs() < 0.01 && (variance - 1.0).abs() < 0.02, "{mean} {variance}");
    }
}
