//! What the muscle chain owes to any samples at all. The body is that of the fuzz target.

#[path = "../../../fuzz/src/bytes.rs"]
#[allow(dead_code, clippy::all, clippy::pedantic, clippy::unwrap_used)]
mod bytes;
#[path = "../../../fuzz/src/emg.rs"]
#[allow(clippy::all, clippy::pedantic, clippy::unwrap_used, clippy::expect_used, clippy::panic)]
mod fuzz;
#[path = "../../../fuzz/replay.rs"]
#[allow(clippy::unwrap_used, clippy::expect_used)]
mod replay;

use proptest::prelude::*;

#[test]
fn committed_seeds_hold() {
    replay::committed_seeds(fuzz::TARGETS);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn emg(data in prop::collection::vec(any::<u8>(), 0..1500)) {
        fuzz::emg_any_chunking_is_the_same(&data);
    }
}
