//! CDR by hand, for messages whose large parts must not go through `serde`.

use std::io;

use super::CdrError;

/// Counts what is written to it.
pub(super) struct Count(pub(super) usize);

impl io::Write for Count {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0 += bytes.len();
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Writes fields in order, aligned as CDR wants; paddings are zero.
#[derive(Debug)]
pub struct CdrWriter<'a> {
    out: &'a mut [u8],
    at: usize,
}

impl<'a> CdrWriter<'a> {
    /// Writes to the beginning of `out`.
    pub fn new(out: &'a mut [u8]) -> Self {
        Self { out, at: 0 }
    }

    /// One byte.
    pub fn u8(&mut self, value: u8) -> Result<(), CdrError> {
        self.take(1)?[0] = value;
        Ok(())
    }

    /// An unsigned number.
    pub fn u32(&mut self, value: u32) -> Result<(), CdrError> {
        self.align(4)?;
        self.take(4)?.copy_from_slice(&value.to_le_bytes());
        Ok(())
    }

    /// A signed number.
    pub fn i32(&mut self, value: i32) -> Result<(), CdrError> {
        self.align(4)?;
        self.take(4)?.copy_from_slice(&value.to_le_bytes());
        Ok(())
    }

    /// A text with its length and its end.
    pub fn string(&mut self, text: &str) -> Result<(), CdrError> {
        self.length(text.len().saturating_add(1))?;
        self.take(text.len())?.copy_from_slice(text.as_bytes());
        self.u8(0)
    }

    /// The length of a sequence of bytes, and the room for them, to be filled by the caller.
    pub fn byte_sequence(&mut self, count: usize) -> Result<&mut [u8], CdrError> {
        self.length(count)?;
        self.take(count)
    }

    /// How many bytes were written.
    pub fn written(&self) -> usize {
        self.at
    }

    fn length(&mut self, count: usize) -> Result<(), CdrError> {
        let count = u32::try_from(count)
            .map_err(|_| CdrError::Wrong { what: "a sequence over 4 GiB", at: self.at })?;
        self.u32(count)
    }

    fn align(&mut self, to: usize) -> Result<(), CdrError> {
        let padding = self.at.next_multiple_of(to) - self.at;
        self.take(padding)?.fill(0);
        Ok(())
    }

    fn take(&mut self, needed: usize) -> Result<&mut [u8], CdrError> {
        let left = self.out.len() - self.at;
        if needed > left {
            return Err(CdrError::Short { at: self.at, needed, left });
        }
        let start = self.at;
        self.at += needed;
        Ok(&mut self.out[start..self.at])
    }
}

/// Reads fields in order; what it returns borrows from the bytes.
#[derive(Debug)]
pub struct CdrReader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> CdrReader<'a> {
    /// Reads from the beginning of `bytes`.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    /// One byte.
    pub fn u8(&mut self) -> Result<u8, CdrError> {
        Ok(self.take(1)?[0])
    }

    /// An unsigned number.
    pub fn u32(&mut self) -> Result<u32, CdrError> {
        Ok(u32::from_le_bytes(self.four()?))
    }

    /// A signed number.
    pub fn i32(&mut self) -> Result<i32, CdrError> {
        Ok(i32::from_le_bytes(self.four()?))
    }

    /// A text.
    pub fn string(&mut self) -> Result<&'a str, CdrError> {
        let at = self.at;
        let bytes = self.byte_sequence()?;
        // Some writers send an empty text as no bytes at all.
        let text = match bytes.split_last() {
            None => bytes,
            Some((0, text)) => text,
            Some((_, _)) => return Err(CdrError::Wrong { what: "a text without its end", at }),
        };
        std::str::from_utf8(text).map_err(|_| CdrError::Wrong { what: "a text not in UTF-8", at })
    }

    /// A sequence of bytes.
    pub fn byte_sequence(&mut self) -> Result<&'a [u8], CdrError> {
        let count = self.u32()?;
        self.take(usize::try_from(count).unwrap_or(usize::MAX))
    }

    fn four(&mut self) -> Result<[u8; 4], CdrError> {
        let padding = self.at.next_multiple_of(4) - self.at;
        self.take(padding)?;
        let mut four = [0; 4];
        four.copy_from_slice(self.take(4)?);
        Ok(four)
    }

    fn take(&mut self, needed: usize) -> Result<&'a [u8], CdrError> {
        let rest = &self.bytes[self.at..];
        let Some(taken) = rest.get(..needed) else {
            return Err(CdrError::Short { at: self.at, needed, left: rest.len() });
        };
        self.at += needed;
        Ok(taken)
    }
}
