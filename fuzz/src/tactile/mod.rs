//! What the contact readings and the baseline owe to any images at all.

mod baseline;
mod exact;
mod metrics;
mod oracle;
mod pictures;
mod readings;

pub use baseline::baseline_survives_any_frames;
pub use metrics::contact_fast_equals_exact;
pub use readings::{live_reading_mask_is_its_area, paper_reading_survives_any_image};

use crate::bytes::Target;

/// All of them.
pub const TARGETS: &[Target] = &[
    ("contact_fast_equals_exact", contact_fast_equals_exact),
    ("paper_reading_survives_any_image", paper_reading_survives_any_image),
    ("live_reading_mask_is_its_area", live_reading_mask_is_its_area),
    ("baseline_survives_any_frames", baseline_survives_any_frames),
];
