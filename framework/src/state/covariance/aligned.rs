//! Numbers in memory that begin where a cache line does.

use std::fmt;
use std::ops::{Deref, DerefMut};

/// A fixed count of numbers from the start of a cache line on: no vector of four crosses a line.
#[derive(Default)]
pub(super) struct Aligned {
    buffer: Vec<f64>,
    start: usize,
    length: usize,
}

/// Numbers of a cache line.
const LINE: usize = 8;

impl Aligned {
    pub(super) fn zeros(length: usize) -> Self {
        let buffer = vec![0.0; length + LINE - 1];
        let start = buffer.as_ptr().align_offset(LINE * size_of::<f64>()).min(LINE - 1);
        Self { buffer, start, length }
    }
}

impl Deref for Aligned {
    type Target = [f64];

    #[inline(always)]
    fn deref(&self) -> &[f64] {
        &self.buffer[self.start..][..self.length]
    }
}

impl DerefMut for Aligned {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [f64] {
        &mut self.buffer[self.start..][..self.length]
    }
}

impl Clone for Aligned {
    fn clone(&self) -> Self {
        let mut copy = Self::zeros(self.length);
        copy.copy_from_slice(self);
        copy
    }

    fn clone_from(&mut self, from: &Self) {
        if self.length == from.length {
            self.copy_from_slice(from);
        } else {
            *self = from.clone();
        }
    }
}

/// Copies have other places in memory, and the same text.
impl fmt::Debug for Aligned {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.iter()).finish()
    }
}

impl PartialEq for Aligned {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}
