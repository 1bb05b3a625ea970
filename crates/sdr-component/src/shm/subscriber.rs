//! Reading a port.

use std::fmt;
use std::os::fd::{AsFd, AsRawFd, BorrowedFd, RawFd};

use iceoryx2::port::{listener::Listener, subscriber};

use super::{SampleHeader, Service, ShmError};
use crate::sys;

/// Reads a port; may be sent to another thread.
///
/// Its descriptor becomes readable when something was sent. The pattern for any event loop:
/// readable, then [`Subscriber::clear_wakes`], then [`Subscriber::receive`] until `None`; and
/// once before the first wait. Wake-ups coalesce.
pub struct Subscriber {
    path: String,
    port: subscriber::Subscriber<Service, [u8], SampleHeader>,
    listener: Listener<Service>,
}

impl Subscriber {
    pub(super) fn new(
        path: &str,
        port: subscriber::Subscriber<Service, [u8], SampleHeader>,
        listener: Listener<Service>,
    ) -> Self {
        Self { path: path.to_owned(), port, listener }
    }

    /// The next sample, oldest first; `None` when there is none. At most a full
    /// queue and four more may be held.
    pub fn receive(&self) -> Result<Option<Sample>, ShmError> {
        match self.port.receive() {
            Ok(sample) => Ok(sample.map(|inner| Sample { inner })),
            Err(error) => {
                Err(ShmError::Receive { path: self.path.clone(), reason: format!("{error:?}") })
            }
        }
    }

    /// Forgets wake-ups, so that the descriptor is readable again only after the next one.
    pub fn clear_wakes(&self) {
        // An error means nothing was there to forget; samples are found by `receive` anyway.
        let _ = self.listener.try_wait(|_| {});
    }

    /// The port's path.
    pub fn path(&self) -> &str {
        &self.path
    }
}

impl AsFd for Subscriber {
    fn as_fd(&self) -> BorrowedFd<'_> {
        sys::borrow_fd(&self.listener)
    }
}

impl AsRawFd for Subscriber {
    fn as_raw_fd(&self) -> RawFd {
        self.as_fd().as_raw_fd()
    }
}

impl fmt::Debug for Subscriber {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Subscriber").field("path", &self.path).finish_non_exhaustive()
    }
}

/// A sample in shared memory; its slot is free again when dropped.
pub struct Sample {
    inner: iceoryx2::sample::Sample<Service, [u8], SampleHeader>,
}

impl Sample {
    /// Token, sequence, times.
    pub fn header(&self) -> &SampleHeader {
        self.inner.user_header()
    }

    /// The bytes, in place; CDR may have up to 3 bytes of padding at the end.
    pub fn payload(&self) -> &[u8] {
        self.inner.payload()
    }
}

impl fmt::Debug for Sample {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let bytes = self.payload().len();
        f.debug_struct("Sample").field("header", self.header()).field("bytes", &bytes).finish()
    }
}
