//! Counts of one run.

/// What was sent, handled, planned.
#[derive(Debug, Clone, Default)]
pub struct Tally {
    /// Bytes each robot sent, headers and seal included.
    pub sent_bytes: Vec<u64>,
    /// Bytes each robot received, headers and seal included.
    pub received_bytes: Vec<u64>,
    /// Datagrams sent.
    pub datagrams: u64,
    /// Calls of `handle`.
    pub handled: u64,
    /// Questions to the allocator.
    pub replans: u64,
    /// Samples refused by fences.
    pub fenced: u64,
}

impl Tally {
    pub(crate) fn new(robots: usize) -> Self {
        Self { sent_bytes: vec![0; robots], received_bytes: vec![0; robots], ..Self::default() }
    }

    pub(crate) fn sent(&mut self, robot: usize, bytes: usize) {
        self.sent_bytes[robot] += bytes as u64;
        self.datagrams += 1;
    }

    pub(crate) fn received(&mut self, robot: usize, bytes: usize) {
        self.received_bytes[robot] += bytes as u64;
    }
}
