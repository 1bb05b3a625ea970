//! Writing samples of one type.

use std::marker::PhantomData;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use sdr_core::{id::Name, order::Token};

use super::PortError;
use crate::{
    clock,
    message::{CdrError, Encode, Message, sensor_msgs},
    protocol::OutputCounters,
    shm::{Publisher, SampleHeader},
};

/// An output that carries messages of type `M`. Refuses to write while the component is not
/// active.
#[derive(Debug)]
pub struct OutPort<M: Message> {
    core: SharedOutput,
    message: PhantomData<fn() -> M>,
}

impl<M: Message> OutPort<M> {
    pub(crate) fn new(core: SharedOutput) -> Self {
        Self { core, message: PhantomData }
    }

    /// The same, and `message` is the last sample whenever the component leaves the active
    /// state: deactivated, aborted or finished. What a reader does when the process is killed
    /// is the reader's matter: its connection's deadline.
    pub fn with_safe(self, message: &M::View<'_>) -> Result<Self, PortError> {
        let mut core = self.core.lock();
        let mut bytes = vec![0; message.encoded_len()];
        message.encode(&mut bytes).map_err(|source| PortError::Message {
            port: core.name.to_string(),
            message_type: M::TYPE,
            source,
        })?;
        core.safe = Some(Safe { bytes, message_type: M::TYPE });
        drop(core);
        Ok(self)
    }

    /// Encodes the message straight into shared memory, stamps it, and wakes the readers.
    pub fn send(&self, message: &M::View<'_>) -> Result<(), PortError> {
        self.send_with(message.encoded_len(), |out| message.encode(out))
    }

    /// Sends a message of `bytes` that `fill` writes in place, in CDR, all of them.
    pub fn send_with(
        &self,
        bytes: usize,
        fill: impl FnOnce(&mut [u8]) -> Result<(), CdrError>,
    ) -> Result<(), PortError> {
        self.core.lock().send(bytes, M::TYPE, fill)
    }
}

impl OutPort<sensor_msgs::Image> {
    /// Sends a picture of `count` bytes that `draw` writes straight into shared memory;
    /// `shape.data` is not looked at.
    pub fn fill(
        &self,
        shape: &sensor_msgs::ImageView<'_>,
        count: usize,
        draw: impl FnOnce(&mut [u8]),
    ) -> Result<(), PortError> {
        self.send_with(shape.encoded_len_with(count), |out| {
            draw(shape.begin(count, out)?);
            Ok(())
        })
    }
}

/// What the port and the execution thread share.
#[derive(Clone, Debug)]
pub(crate) struct SharedOutput(Arc<Mutex<OutputCore>>);

impl SharedOutput {
    pub(crate) fn new(core: OutputCore) -> Self {
        Self(Arc::new(Mutex::new(core)))
    }

    pub(crate) fn lock(&self) -> MutexGuard<'_, OutputCore> {
        // A callback that panicked sent its sample or did not; the counts stay right.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The last sample of an activation, encoded.
#[derive(Debug)]
struct Safe {
    bytes: Vec<u8>,
    message_type: &'static str,
}

/// An output without its type.
#[derive(Debug)]
pub(crate) struct OutputCore {
    name: Name,
    /// Absent only while a component describes itself.
    publisher: Option<Publisher>,
    /// Stamped on the next sample; absent while the component is not active.
    stamp: Option<SampleHeader>,
    /// Sent before the port falls silent.
    safe: Option<Safe>,
    sent: u64,
    sent_bytes: u64,
}

impl OutputCore {
    pub(crate) fn new(name: Name, publisher: Option<Publisher>) -> Self {
        Self { name, publisher, stamp: None, safe: None, sent: 0, sent_bytes: 0 }
    }

    /// Samples carry this token from now on, counted from 1; `None` keeps the port silent.
    pub(crate) fn set_token(&mut self, token: Option<&Token>) {
        self.stamp = token.map(SampleHeader::new);
    }

    /// Sends the safe value, when there is one, and writes nothing from then on.
    pub(crate) fn fall_silent(&mut self) -> Result<(), PortError> {
        let mut sent = Ok(());
        if self.stamp.is_some()
            && let Some(safe) = self.safe.take()
        {
            let fill = |out: &mut [u8]| {
                out.copy_from_slice(&safe.bytes);
                Ok(())
            };
            sent = self.send(safe.bytes.len(), safe.message_type, fill);
            self.safe = Some(safe);
        }
        self.set_token(None);
        sent
    }

    /// Samples carry this tick from now on.
    pub(crate) fn set_tick(&mut self, tick: u64) {
        if let Some(stamp) = &mut self.stamp {
            stamp.tick = tick;
        }
    }

    pub(crate) fn counters(&self) -> OutputCounters {
        OutputCounters { port: self.name.clone(), sent: self.sent, sent_bytes: self.sent_bytes }
    }

    fn send(
        &mut self,
        bytes: usize,
        message_type: &'static str,
        fill: impl FnOnce(&mut [u8]) -> Result<(), CdrError>,
    ) -> Result<(), PortError> {
        let (Some(publisher), Some(stamp)) = (&self.publisher, &mut self.stamp) else {
            return Err(PortError::Inactive { port: self.name.to_string() });
        };
        let mut loan = publisher.loan(bytes)?;
        fill(loan.payload_mut()).map_err(|source| PortError::Message {
            port: publisher.path().to_owned(),
            message_type,
            source,
        })?;
        stamp.sequence += 1;
        stamp.source_time_ns = clock::monotonic_ns();
        loan.send(*stamp)?;
        self.sent += 1;
        self.sent_bytes += u64::try_from(bytes).unwrap_or(u64::MAX);
        Ok(())
    }
}
