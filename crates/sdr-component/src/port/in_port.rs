//! Reading samples of one type.

use std::collections::VecDeque;
use std::marker::PhantomData;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use sdr_core::order::Token;

use super::{Connection, PortError};
use crate::{
    message::Message,
    protocol::Heard,
    shm::{Sample, SampleHeader},
};

/// An input that carries messages of type `M`, from any number of connections.
///
/// Samples wait here, at most the connection's depth of each; older ones make room. While the
/// component is not active nothing waits. Belongs to the thread that runs the callbacks;
/// another one may wait up to a beat for it.
#[derive(Debug)]
pub struct InPort<M: Message> {
    core: SharedInput,
    message: PhantomData<fn() -> M>,
}

impl<M: Message> InPort<M> {
    pub(crate) fn new(core: SharedInput) -> Self {
        Self { core, message: PhantomData }
    }

    /// The oldest sample that waits.
    pub fn receive(&mut self) -> Option<Received<M>> {
        let mut core = self.core.lock();
        core.accept();
        let (connection, sample) = core.queue.pop_front()?;
        Some(Received { sample, connection, message: PhantomData })
    }

    /// The newest sample that waits; the others are dropped.
    pub fn latest(&mut self) -> Option<Received<M>> {
        let mut newest = None;
        while let Some(sample) = self.receive() {
            newest = Some(sample);
        }
        newest
    }

    /// Whether any connection feeds it.
    pub fn is_connected(&self) -> bool {
        !self.core.lock().connections.is_empty()
    }
}

/// A sample in shared memory; its slot is free again when dropped.
#[derive(Debug)]
pub struct Received<M: Message> {
    sample: Sample,
    connection: u16,
    message: PhantomData<fn() -> M>,
}

impl<M: Message> Received<M> {
    /// The message, or a view of it in place.
    ///
    /// It was whole when it arrived; an error means that its producer broke it since.
    pub fn message(&self) -> Result<M::View<'_>, PortError> {
        M::decode(self.sample.payload()).map_err(|source| PortError::Message {
            port: format!("connection {}", self.connection),
            message_type: M::TYPE,
            source,
        })
    }

    /// Sequence, tick and time of its producer.
    pub fn header(&self) -> &SampleHeader {
        self.sample.header()
    }

    /// The token of its producer.
    pub fn token(&self) -> Option<Token> {
        self.sample.header().token()
    }

    /// The index in the system of the connection it came by.
    pub fn connection(&self) -> u16 {
        self.connection
    }
}

/// What the port and the execution thread share.
#[derive(Clone, Debug)]
pub(crate) struct SharedInput(Arc<Mutex<InputCore>>);

impl SharedInput {
    pub(crate) fn new(core: InputCore) -> Self {
        Self(Arc::new(Mutex::new(core)))
    }

    pub(crate) fn lock(&self) -> MutexGuard<'_, InputCore> {
        // A callback that panicked left whole samples behind; the figures stay right.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// An input without its type.
#[derive(Debug)]
pub(crate) struct InputCore {
    pub(crate) connections: Vec<Connection>,
    /// Accepted and not taken yet, with the index of the connection in the system.
    queue: VecDeque<(u16, Sample)>,
    /// To be told to the agent.
    pub(crate) heard: Vec<Heard>,
    is_whole: fn(&[u8]) -> bool,
    is_listening: bool,
}

impl InputCore {
    pub(crate) fn new<M: Message>(connections: Vec<Connection>) -> Self {
        Self {
            connections,
            queue: VecDeque::new(),
            heard: Vec::new(),
            is_whole: |bytes| M::decode(bytes).is_ok(),
            is_listening: false,
        }
    }

    /// Begins to accept; what came before is dropped.
    pub(crate) fn listen(&mut self) {
        for connection in &mut self.connections {
            connection.discard();
        }
        self.is_listening = true;
    }

    /// Stops accepting and gives back what waits.
    pub(crate) fn stop_listening(&mut self) {
        self.is_listening = false;
        self.queue.clear();
        for connection in &mut self.connections {
            connection.statistics.pause();
        }
    }

    /// Takes in what came; returns how many samples were accepted.
    pub(crate) fn accept(&mut self) -> usize {
        if !self.is_listening {
            return 0;
        }
        let mut accepted = 0;
        for connection in &mut self.connections {
            let depth = usize::from(connection.wiring.qos.depth).max(1);
            let index = connection.wiring.connection;
            // A producer faster than this loop must not keep it from anything else.
            for _ in 0..depth * 2 {
                // An error means that the component holds too many samples: the others wait
                // in shared memory.
                let Ok(Some((sample, heard))) = connection.accept(self.is_whole) else { break };
                accepted += 1;
                self.heard.extend(heard);
                make_room(&mut self.queue, index, depth);
                self.queue.push_back((index, sample));
            }
        }
        accepted
    }
}

/// Drops the oldest sample of a connection that already fills its depth.
fn make_room(queue: &mut VecDeque<(u16, Sample)>, connection: u16, depth: usize) {
    let is_its_own = |(index, _): &(u16, Sample)| *index == connection;
    if queue.iter().filter(|entry| is_its_own(entry)).count() >= depth
        && let Some(oldest) = queue.iter().position(is_its_own)
    {
        queue.remove(oldest);
    }
}
