//! The seam between robots: what the bridge asks of whatever carries samples.

use sdr_core::spec::Qos;

use super::origin::Origin;

/// Names an open endpoint; never used twice.
pub(crate) type EndpointId = u64;

/// Which way samples go, seen from this robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) enum Way {
    /// From a local producer to other robots.
    Out,
    /// From another robot to local consumers.
    In,
}

/// What an endpoint carries.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Topic {
    /// The output's path in shared memory.
    pub(crate) path: String,
    /// The ROS 2 type, such as `sensor_msgs/msg/Image`.
    pub(crate) message_type: String,
    /// Reliability and depth.
    pub(crate) qos: Qos,
}

/// Why a sample was not sent.
#[derive(Debug, thiserror::Error)]
pub(crate) enum SendError {
    /// Readers acknowledge too little; nothing changed.
    #[error("unacknowledged samples fill the send window")]
    Backlog,
    /// The endpoint is not open or its machinery broke; nothing changed.
    #[error("{0}")]
    Broken(String),
}

/// What [`Transport::receive`] found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Arrival {
    /// A sample of another robot's bridge; the body is filled in.
    Sample(Origin),
    /// A sample without an origin: of some other DDS program.
    Foreign,
    /// An echo of what this robot sent.
    Own,
    /// A sample in an encoding other than little-endian CDR.
    Undecodable,
}

/// How many remote endpoints an endpoint is joined to, after a change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Matched {
    pub(crate) endpoint: EndpointId,
    pub(crate) count: u16,
}

/// Carries samples between robots. Never blocks; rings the bell it was made with whenever
/// `receive` or `poll_matched` may have something new.
pub(crate) trait Transport {
    /// Opens an endpoint for `topic`; peers find it by themselves.
    fn open(&mut self, way: Way, topic: &Topic) -> Result<EndpointId, TransportError>;

    /// Closes an endpoint at once and tells peers.
    fn close(&mut self, endpoint: EndpointId);

    /// Hands one sample to the network.
    fn send(&mut self, endpoint: EndpointId, origin: &Origin, body: &[u8])
    -> Result<(), SendError>;

    /// Takes the next arrived sample of an endpoint; its body replaces what `body` held.
    fn receive(&mut self, endpoint: EndpointId, body: &mut Vec<u8>) -> Option<Arrival>;

    /// The next change of who is matched.
    fn poll_matched(&mut self) -> Option<Matched>;

    /// Once a second: whatever needs looking after.
    fn sweep(&mut self);
}

/// Why the transport or one of its endpoints could not be made; nothing was left behind.
#[derive(Debug, thiserror::Error)]
#[error("{what}: {reason}")]
pub(crate) struct TransportError {
    pub(crate) what: String,
    pub(crate) reason: String,
}

impl TransportError {
    pub(crate) fn new(what: impl Into<String>, reason: impl ToString) -> Self {
        Self { what: what.into(), reason: reason.to_string() }
    }
}
