//! Committed seeds through the bodies of the fuzz targets, on any compiler: the tests of the crates include this file.

use std::path::Path;

/// Every target has seeds, and every seed holds.
#[allow(clippy::unwrap_used, clippy::expect_used, reason = "a test: a seed that cannot be read is a failure")]
pub fn committed_seeds(targets: &[crate::bytes::Target]) {
    let seeds = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/seeds");
    for (name, body) in targets {
        let mut count = 0;
        for entry in std::fs::read_dir(seeds.join(name)).expect(name) {
            body(&std::fs::read(entry.unwrap().path()).unwrap());
            count += 1;
        }
        assert!(count > 0, "{name} has no seeds");
    }
}
