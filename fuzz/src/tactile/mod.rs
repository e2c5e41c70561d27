//! What the contact readings and the baseline owe to any images at all.

mod baseline;
mod exact;
mod metrics;
mod oracle;
mod pictures;
mod readings;
mod tracker;

pub use baseline::baseline_survives_any_frames;
pub use metrics::contact_fast_equals_exact;
pub use readings::{live_reading_mask_is_its_area, paper_reading_survives_any_image};
pub use tracker::tracker_is_bounded_and_the_same_again;

use crate::bytes::Target;

/// All of them.
pub const TARGETS: &[Target] = &[
    ("contact_fast_equals_exact", contact_fast_equals_exact),
    ("paper_reading_survives_any_image", paper_reading_survives_any_image),
    ("live_reading_mask_is_its_area", live_reading_mask_is_its_area),
    ("tracker_is_bounded_and_the_same_again", tracker_is_bounded_and_the_same_again),
    ("baseline_survives_any_frames", baseline_survives_any_frames),
];
