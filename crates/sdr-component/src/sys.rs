//! The few calls that the compiler cannot check, each with its reason, for the rest of the crate.

use std::fmt;
use std::mem::MaybeUninit;
use std::os::fd::BorrowedFd;

use iceoryx2::prelude::{FileDescriptorBased, ZeroCopySend};
use rustix::mm::{Advice, MapFlags, ProtFlags, madvise, mmap_anonymous, munmap};

/// What goes before the payload of every sample, as it stands in shared memory.
///
/// Fixed: `docs/protocol.md` tells it to other languages. Another layout gets another name.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ZeroCopySend)]
#[type_name("sdr.SampleHeader.v1")]
pub struct SampleHeader {
    /// Number of the epoch under which the producer is active.
    pub epoch: u64,
    /// The robot that minted it, padded with zeros.
    pub minted_by: [u8; 32],
    /// Activation within the epoch.
    pub run: u32,
    /// [`SampleHeader::INJECTED`] and bits yet to come.
    pub flags: u32,
    /// Counts the samples of this output under this token, from 1.
    pub sequence: u64,
    /// The producer's tick.
    pub tick: u64,
    /// CLOCK_MONOTONIC of the producer's machine when it was sent; compared only within it.
    pub source_time_ns: u64,
}

/// A file descriptor that lives as long as its owner.
pub(crate) fn borrow_fd<T: FileDescriptorBased>(owner: &T) -> BorrowedFd<'_> {
    // SAFETY: the descriptor belongs to `owner`, which the result borrows; the number is
    // handed to poll and the like, never closed.
    unsafe { BorrowedFd::borrow_raw(owner.file_descriptor().native_handle()) }
}

/// Bytes of shared memory as bytes.
pub(crate) fn as_bytes(memory: &mut [MaybeUninit<u8>]) -> &mut [u8] {
    // SAFETY: the memory is a mapping of a file that the kernel filled with zeros and to
    // which only bytes are ever written, so each byte has a value.
    unsafe { &mut *(std::ptr::from_mut(memory) as *mut [u8]) }
}

/// Marks a loan as written; see [`as_bytes`] for why every byte has a value.
pub(crate) fn assume_written<S, H>(
    loan: iceoryx2::sample_mut_uninit::SampleMutUninit<S, [MaybeUninit<u8>], H>,
) -> iceoryx2::sample_mut::SampleMut<S, [u8], H>
where
    S: iceoryx2::service::Service,
    H: fmt::Debug + ZeroCopySend,
{
    // SAFETY: as in `as_bytes`.
    unsafe { loan.assume_init() }
}

/// Private memory that was really touched, given back when dropped.
#[derive(Debug)]
pub(crate) struct TouchedMemory {
    start: *mut std::ffi::c_void,
    bytes: usize,
}

// SAFETY: the mapping belongs to this value alone and is not bound to a thread.
unsafe impl Send for TouchedMemory {}

impl TouchedMemory {
    /// Maps `bytes` (more than zero), asks for huge pages, writes to each page.
    pub(crate) fn new(bytes: usize) -> rustix::io::Result<Self> {
        let protection = ProtFlags::READ | ProtFlags::WRITE;
        // SAFETY: a fresh private mapping at an address of the kernel's choice.
        let start =
            unsafe { mmap_anonymous(std::ptr::null_mut(), bytes, protection, MapFlags::PRIVATE)? };
        let memory = Self { start, bytes };
        // SAFETY: advice on our own mapping; kernels without huge pages refuse it, which only
        // makes the next step slower.
        let _ = unsafe { madvise(start, bytes, Advice::LinuxHugepage) };
        for offset in (0..bytes).step_by(4096) {
            // SAFETY: `offset` lies within our own mapping. Volatile, since nobody reads it.
            unsafe { start.cast::<u8>().add(offset).write_volatile(1) };
        }
        Ok(memory)
    }
}

impl Drop for TouchedMemory {
    fn drop(&mut self) {
        // SAFETY: our own mapping, of which nobody holds a reference.
        let _ = unsafe { munmap(self.start, self.bytes) };
    }
}
