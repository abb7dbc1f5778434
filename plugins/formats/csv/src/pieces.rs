//! Pieces of text that are made one after another, such as rows, as the bytes of a file.

use std::io::{Read, Result};

/// What makes the pieces.
pub(crate) trait Pieces {
    /// Writes the next piece into an empty buffer; `false` at the end.
    fn next(&mut self, piece: &mut Vec<u8>) -> Result<bool>;
}

/// The bytes of all pieces.
pub(crate) struct Joined<P> {
    pieces: P,
    piece: Vec<u8>,
    /// Number of bytes of the piece that were given.
    given: usize,
}

impl<P> Joined<P> {
    pub fn new(pieces: P) -> Self {
        Self { pieces, piece: Vec::new(), given: 0 }
    }
}

impl<P: Pieces> Read for Joined<P> {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize> {
        while self.given == self.piece.len() {
            self.piece.clear();
            self.given = 0;
            if !self.pieces.next(&mut self.piece)? {
                return Ok(0);
            }
        }
        let rest = &self.piece[self.given..];
        let count = rest.len().min(bytes.len());
        bytes[..count].copy_from_slice(&rest[..count]);
        self.given += count;
        Ok(count)
    }
}
