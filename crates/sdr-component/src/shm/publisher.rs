//! Writing a port.

use std::fmt;
use std::mem::MaybeUninit;

use iceoryx2::port::{LoanError, notifier::Notifier, publisher};
use iceoryx2::sample_mut_uninit::SampleMutUninit;

use super::{PAYLOAD_BYTES_MAX, SampleHeader, Service, ShmError};
use crate::sys;

/// Writes a port; may be sent to another thread.
pub struct Publisher {
    path: String,
    port: publisher::Publisher<Service, [u8], SampleHeader>,
    notifier: Notifier<Service>,
}

impl Publisher {
    pub(super) fn new(
        path: &str,
        port: publisher::Publisher<Service, [u8], SampleHeader>,
        notifier: Notifier<Service>,
    ) -> Self {
        Self { path: path.to_owned(), port, notifier }
    }

    /// Borrows memory for a sample of `bytes`; at most two loans at a time.
    ///
    /// Its content is whatever an earlier sample left there: write all of it. The memory
    /// grows by powers of two and never shrinks; growing takes about 0.1 ms.
    pub fn loan(&self, bytes: usize) -> Result<Loan<'_>, ShmError> {
        if bytes > PAYLOAD_BYTES_MAX {
            return Err(ShmError::TooLarge { path: self.path.clone(), bytes });
        }
        // Slices of length zero are not loaned.
        match self.port.loan_slice_uninit(bytes.max(1)) {
            Ok(memory) => Ok(Loan { publisher: self, memory, bytes }),
            Err(error) => Err(self.loan_error(bytes, error)),
        }
    }

    /// The port's path.
    pub fn path(&self) -> &str {
        &self.path
    }

    fn loan_error(&self, bytes: usize, error: LoanError) -> ShmError {
        ShmError::Loan { path: self.path.clone(), bytes, reason: format!("{error:?}") }
    }
}

impl fmt::Debug for Publisher {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Publisher").field("path", &self.path).finish_non_exhaustive()
    }
}

/// Memory of a sample that was not sent yet; given back when dropped.
pub struct Loan<'a> {
    publisher: &'a Publisher,
    memory: SampleMutUninit<Service, [MaybeUninit<u8>], SampleHeader>,
    bytes: usize,
}

impl Loan<'_> {
    /// The payload, to be filled in place.
    pub fn payload_mut(&mut self) -> &mut [u8] {
        &mut sys::as_bytes(self.memory.payload_mut())[..self.bytes]
    }

    /// Stamps it, hands it to all readers and wakes them; returns how many there were.
    ///
    /// A slow reader loses its oldest sample. A reader that could not be woken finds the
    /// sample at its next look.
    pub fn send(mut self, header: SampleHeader) -> Result<usize, ShmError> {
        *self.memory.user_header_mut() = header;
        let publisher = self.publisher;
        let readers = sys::assume_written(self.memory).send().map_err(|error| ShmError::Send {
            path: publisher.path.clone(),
            reason: format!("{error:?}"),
        })?;
        let _ = publisher.notifier.notify();
        Ok(readers)
    }
}

impl fmt::Debug for Loan<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let path = &self.publisher.path;
        f.debug_struct("Loan").field("path", path).field("bytes", &self.bytes).finish()
    }
}
