//! A clock that does nothing else: how late a machine lets anybody be.

use std::thread::sleep;
use std::time::{Duration, Instant};

/// Waits for `n_ticks` deadlines, one every `period_ns`, and returns how late each wait ended, nanoseconds.
///
/// A thread of its own that waits as the loop waits, without a computation, a device or a lock: what is late here is so
/// by the machine. A deadline that has passed is not waited for, and the ones after it stay where they were.
pub fn bare_clock(period_ns: u64, n_ticks: u32) -> Vec<u64> {
    let began = Instant::now();
    let late = |k: u32| {
        let due = Duration::from_nanos(period_ns.saturating_mul(u64::from(k) + 1));
        while let Some(left) = due.checked_sub(began.elapsed()).filter(|left| !left.is_zero()) {
            sleep(left);
        }
        began.elapsed().saturating_sub(due).as_nanos() as u64
    };
    (0..n_ticks).map(late).collect()
}

#[cfg(test)]
mod tests {
    use super::bare_clock;

    #[test]
    fn every_tick_is_waited_for() {
        let began = std::time::Instant::now();
        assert_eq!(bare_clock(1_000_000, 5).len(), 5);
        assert!(began.elapsed().as_micros() >= 5_000);
    }
}
