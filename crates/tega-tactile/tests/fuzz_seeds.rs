//! What the readings owe to any images at all. The bodies are those of the fuzz targets.

#[path = "../../../fuzz/src/tactile/mod.rs"]
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
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn contact_metrics(data in prop::collection::vec(any::<u8>(), 0..300)) {
        fuzz::contact_fast_equals_exact(&data);
    }

    #[test]
    fn paper(data in prop::collection::vec(any::<u8>(), 0..300)) {
        fuzz::paper_reading_survives_any_image(&data);
    }

    #[test]
    fn live(data in prop::collection::vec(any::<u8>(), 0..300)) {
        fuzz::live_reading_mask_is_its_area(&data);
    }

    #[test]
    fn tracker(data in prop::collection::vec(any::<u8>(), 0..300)) {
        fuzz::tracker_is_bounded_and_the_same_again(&data);
    }

    #[test]
    fn baseline(data in prop::collection::vec(any::<u8>(), 0..500)) {
        fuzz::baseline_survives_any_frames(&data);
    }
}
