//! Cosines of the transform, computed the same way on every machine.

/// cos(π · numerator / denominator), by symmetry and a series, so that no mathematical library decides the last bit.
pub(super) fn cos_of_turn(numerator: usize, denominator: usize) -> f64 {
    // An angle of a full turn is 2 · denominator.
    let mut n = numerator % (2 * denominator);
    if n > denominator {
        n = 2 * denominator - n;
    }
    let (sign, n) = if 2 * n > denominator { (-1.0, denominator - n) } else { (1.0, n) };
    let x = std::f64::consts::PI * n as f64 / denominator as f64;
    let (mut term, mut sum) = (1.0, 1.0);
    for k in 1..=12u32 {
        term *= -x * x / f64::from((2 * k - 1) * (2 * k));
        sum += term;
    }
    sign * sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cosines_are_those_of_the_library() {
        for d in 1..90 {
            for n in 0..4 * d {
                let wanted = (std::f64::consts::PI * n as f64 / d as f64).cos();
                assert!((cos_of_turn(n, d) - wanted).abs() < 1e-14, "{n}/{d}");
            }
        }
    }
}
