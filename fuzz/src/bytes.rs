//! Choices out of the bytes that the fuzzer gives; zeros when there are no more.

/// Reads from the front.
pub struct Choices<'a>(pub &'a [u8]);

impl<'a> Choices<'a> {
    /// Whether there is nothing left.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// One byte.
    pub fn byte(&mut self) -> u8 {
        self.0.split_off_first().copied().unwrap_or(0)
    }

    /// Two bytes.
    pub fn short(&mut self) -> u16 {
        u16::from_le_bytes([self.byte(), self.byte()])
    }

    /// A slice whose length stands before it; as much of it as there is.
    pub fn slice(&mut self) -> &'a [u8] {
        let length = usize::from(self.short()).min(self.0.len());
        let (taken, rest) = self.0.split_at(length);
        self.0 = rest;
        taken
    }

    /// All that is left.
    pub fn rest(&mut self) -> &'a [u8] {
        std::mem::take(&mut self.0)
    }
}

/// Writes what [`Choices::slice`] reads.
pub fn put_slice(bytes: &[u8], into: &mut Vec<u8>) {
    let length = u16::try_from(bytes.len()).expect("seeds are short");
    into.extend(length.to_le_bytes());
    into.extend(bytes);
}
