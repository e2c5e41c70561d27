//! Numbers of a grid, laid out so that a vector of a row does not lie across two lines of the cache.

use std::ops::{Deref, DerefMut};

/// Single-precision numbers in a line of the cache.
pub(crate) const CACHE_LINE: usize = 16;

/// A slice that begins with a line of the cache.
#[derive(Debug, Default)]
pub(crate) struct Plane {
    memory: Vec<f32>,
    start: usize,
    len: usize,
}

impl Plane {
    pub(crate) fn new(len: usize, value: f32) -> Self {
        let memory = vec![value; len + CACHE_LINE - 1];
        // Only speed hangs on it.
        let start = memory.as_ptr().align_offset(CACHE_LINE * size_of::<f32>()).min(CACHE_LINE - 1);
        Self { memory, start, len }
    }
}

impl Clone for Plane {
    fn clone(&self) -> Self {
        let mut other = Self::new(self.len, 0.0);
        other.copy_from_slice(self);
        other
    }
}

impl Deref for Plane {
    type Target = [f32];

    #[inline(always)]
    fn deref(&self) -> &[f32] {
        &self.memory[self.start..self.start + self.len]
    }
}

impl DerefMut for Plane {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [f32] {
        &mut self.memory[self.start..self.start + self.len]
    }
}
