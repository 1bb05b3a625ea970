//! Shared memory inside a robot: one service for the samples and one for the wake-ups of a port.
//!
//! Everybody on a robot (components and the agent's bridge) opens ports by
//! [`Memory::publisher`] and [`Memory::subscriber`], because whoever comes first fixes the
//! limits of a port for all. Nothing here knows messages or the fence: payloads are bytes,
//! tokens are stamped by the caller.
//!
//! ```text
//!   Publisher::loan ─▶ fill ─▶ send ──▶ service `system/component/port` ──▶ Subscriber::receive
//!                                └────▶ event   `system/component/port` ──▶ Subscriber: AsFd
//! ```

mod error;
mod header;
mod publisher;
mod subscriber;

use std::time::Duration;

use iceoryx2::prelude::{
    AllocationStrategy, Config, FileName, LogLevel, Node, NodeBuilder, NodeName, Path,
    SemanticString, ServiceName, SignalHandlingMode, ipc_threadsafe, set_log_level,
};
use iceoryx2::service::builder::publish_subscribe::{
    PublishSubscribeOpenError as OpenError, PublishSubscribeOpenOrCreateError as OpenOrCreateError,
};
use iceoryx2::service::port_factory::{PortFactory, event, publish_subscribe};

pub use error::ShmError;
pub use header::SampleHeader;
pub use publisher::{Loan, Publisher};
pub use subscriber::{Sample, Subscriber};

use crate::protocol::SharedMemory;

/// Largest payload, bytes.
pub const PAYLOAD_BYTES_MAX: usize = 64 << 20;
/// Longest root path, bytes: the wake-ups are Unix sockets below it.
pub const ROOT_BYTES_MAX: usize = 50;
/// Longest prefix, bytes.
pub const PREFIX_BYTES_MAX: usize = 12;
/// Deepest queue of a reader, samples.
pub const DEPTH_MAX: u8 = 64;

/// Processes that may write a port at a time: an old home, a new one, a standby, a bridge.
const PUBLISHERS_MAX: usize = 4;
/// Readers of a port at a time. Every one costs each reader and writer memory.
const SUBSCRIBERS_MAX: usize = 8;
/// Processes that may know a port at a time.
const NODES_MAX: usize = 32;
/// Ports are made for queues of this depth, or of [`DEPTH_MAX`]: a few classes, so that those
/// who open a port with different depths agree, and only deep ports pay for depth.
const DEPTH_USUAL: u8 = 16;
/// Samples a reader may hold beside a full queue of its own.
const IN_HAND_MAX: usize = 4;
/// Attempts at a service that is being made or cleaned up by somebody else.
const TRIES_MAX: u32 = 25;
/// Time between two of them.
const TRY_AGAIN_AFTER: Duration = Duration::from_millis(20);

pub(crate) type Service = ipc_threadsafe::Service;
type Samples = publish_subscribe::PortFactory<Service, [u8], SampleHeader>;
type Wakes = event::PortFactory<Service>;

/// One process's door to its robot's shared memory.
///
/// Keep it as long as its ports. Making one takes about 2 ms, 10 ms when it has to clean up
/// after a process that died.
#[derive(Debug)]
pub struct Memory {
    node: Node<Service>,
}

impl Memory {
    /// Opens the memory of the robot, under a name for diagnostics (at most 128 bytes).
    pub fn open(place: &SharedMemory, name: &str) -> Result<Self, ShmError> {
        set_log_level(LogLevel::Error);
        let config = config(place)?;
        let name: NodeName = name.try_into().map_err(|_| ShmError::Name(name.to_owned()))?;
        let node = retry(|| {
            NodeBuilder::new()
                .config(&config)
                .name(&name)
                .signal_handling_mode(SignalHandlingMode::Disabled)
                .create::<Service>()
        })
        .map_err(|source| ShmError::node(place, &source))?;
        Ok(Self { node })
    }

    /// A writer for the output `path` whose readers may fall behind by `depth` samples, in its
    /// first allocation good for `size_hint_bytes`.
    pub fn publisher(
        &self,
        path: &str,
        depth: u8,
        size_hint_bytes: usize,
    ) -> Result<Publisher, ShmError> {
        let (samples, wakes) = self.services(path, depth)?;
        let port = samples
            .publisher_builder()
            .initial_max_slice_len(size_hint_bytes.clamp(64, PAYLOAD_BYTES_MAX))
            .allocation_strategy(AllocationStrategy::PowerOfTwo)
            .max_loaned_samples(2)
            .create()
            .map_err(|source| ShmError::port(path, &source))?;
        let notifier =
            wakes.notifier_builder().create().map_err(|source| ShmError::port(path, &source))?;
        Ok(Publisher::new(path, port, notifier))
    }

    /// A reader of the output `path` that may fall behind by `depth` samples (1..=64; at most
    /// 16 when all who opened the port before wanted at most 16).
    ///
    /// Only samples sent from now on are seen.
    pub fn subscriber(&self, path: &str, depth: u8) -> Result<Subscriber, ShmError> {
        let (samples, wakes) = self.services(path, depth)?;
        // The listener first: what is sent between the two steps wakes for nothing, the
        // other way round it would not wake at all.
        let listener =
            wakes.listener_builder().create().map_err(|source| ShmError::port(path, &source))?;
        let port = samples
            .subscriber_builder()
            .buffer_size(
                usize::from(depth).clamp(1, samples.static_config().subscriber_max_buffer_size()),
            )
            .create()
            .map_err(|source| ShmError::port(path, &source))?;
        Ok(Subscriber::new(path, port, listener))
    }

    /// Gives back what processes that died left behind; returns how many there were.
    pub fn clean_up(&self) -> u64 {
        self.node.try_cleanup_dead_nodes().cleanups
    }

    /// The two services of a port: the one place where limits are set.
    fn services(&self, path: &str, depth: u8) -> Result<(Samples, Wakes), ShmError> {
        let name: ServiceName = path.try_into().map_err(|_| ShmError::Name(path.to_owned()))?;
        let wanted = if depth > DEPTH_USUAL { DEPTH_MAX } else { DEPTH_USUAL };
        let samples = match self.samples(&name, wanted) {
            // Somebody made it for the usual depth before.
            Err(OpenOrCreateError::PublishSubscribeOpenError(
                OpenError::DoesNotSupportRequestedMinBufferSize,
            )) => self.samples(&name, DEPTH_USUAL),
            done => done,
        };
        let samples = samples.map_err(|source| ShmError::port(path, &source))?;
        let wakes = retry(|| {
            self.node
                .service_builder(&name)
                .event()
                .max_listeners(SUBSCRIBERS_MAX)
                .max_notifiers(PUBLISHERS_MAX)
                .max_nodes(NODES_MAX)
                .open_or_create()
        })
        .map_err(|source| ShmError::port(path, &source))?;
        Ok((samples, wakes))
    }

    fn samples(&self, name: &ServiceName, depth: u8) -> Result<Samples, OpenOrCreateError> {
        let depth = usize::from(depth);
        retry(|| {
            self.node
                .service_builder(name)
                .publish_subscribe::<[u8]>()
                .user_header::<SampleHeader>()
                .max_publishers(PUBLISHERS_MAX)
                .max_subscribers(SUBSCRIBERS_MAX)
                .max_nodes(NODES_MAX)
                .subscriber_max_buffer_size(depth)
                .subscriber_max_borrowed_samples(depth + IN_HAND_MAX)
                .history_size(0)
                .enable_safe_overflow(true)
                .open_or_create()
        })
    }
}

/// The library's settings for one robot; nothing is read from files or the environment.
fn config(place: &SharedMemory) -> Result<Config, ShmError> {
    let root = place.root.as_os_str().as_encoded_bytes();
    if root.len() > ROOT_BYTES_MAX {
        return Err(ShmError::RootTooLong { root: place.root.clone() });
    }
    if place.prefix.len() > PREFIX_BYTES_MAX {
        return Err(ShmError::PrefixTooLong { prefix: place.prefix.clone() });
    }
    let mut config = Config::default();
    config.global.prefix =
        FileName::new(place.prefix.as_bytes()).map_err(|_| ShmError::Name(place.prefix.clone()))?;
    let root = Path::new(root).map_err(|_| ShmError::Name(place.root.display().to_string()))?;
    config.global.set_root_path(&root);
    Ok(config)
}

/// Tries again while somebody else makes or cleans up the same thing.
fn retry<T, E: std::fmt::Debug>(mut attempt: impl FnMut() -> Result<T, E>) -> Result<T, E> {
    for _ in 1..TRIES_MAX {
        match attempt() {
            Err(error) if is_passing(&error) => std::thread::sleep(TRY_AGAIN_AFTER),
            done => return done,
        }
    }
    attempt()
}

/// The several error enums name these states alike and nest them; their names are all we need.
fn is_passing<E: std::fmt::Debug>(error: &E) -> bool {
    let text = format!("{error:?}");
    let passing = [
        "ServiceInCorruptedState",
        "IsMarkedForDestruction",
        "HangsInCreation",
        "IsBeingCreatedByAnotherInstance",
        "AlreadyExists",
        "SystemInFlux",
        "DoesNotExist",
    ];
    passing.iter().any(|word| text.contains(word))
}

#[cfg(test)]
mod tests;
