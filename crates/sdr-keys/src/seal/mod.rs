//! Datagrams that only robots with a mesh key can make or read.
//!
//! ```text
//!  byte 0        1..3     3..11    11..16     16..            last 16
//!  version|kind  key id   start    counter    sealed bytes    tag
//! ```
//!
//! Numbers are big-endian. The AEAD is ChaCha20-Poly1305 (RFC 8439) under a sub-key per mesh
//! key and sender start (HKDF-SHA256, RFC 5869: salt = start, info = `sdr seal 1`); nonce =
//! seven zero bytes and the counter; the sixteen bytes of the header are authenticated.
//!
//! A *start* is eight random bytes that a sender chooses when its process starts. A
//! receiver accepts data of a start only after the start has answered a fresh challenge of
//! this receiver, and then each counter once: whatever was recorded before the receiver
//! itself started is refused for ever.

mod header;
mod keyring;
mod opener;
mod sealer;
mod window;

#[cfg(test)]
mod tests;

use std::{fmt, time::Duration};

use sdr_core::time::Instant;

pub use header::OVERHEAD_BYTES;
pub use keyring::{Begin, Keyring};
pub use opener::{SealCounters, Unproven};

use crate::mesh_key::{KeyId, MeshKey};
use header::Kind;
use opener::{Opener, Verdict};
use sealer::Sealer;

/// Fills bytes with randomness.
pub type Chance = Box<dyn FnMut(&mut [u8]) + Send>;

/// What became of a datagram.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Opened {
    /// It is of the fleet, fresh, and this is what it holds.
    Datagram(Vec<u8>),
    /// A line that its sender says the authority signed: to be checked.
    Notice(String),
    /// Send this back to where it came from; it is never longer than what came.
    Answer(Vec<u8>),
    /// A start has just proven that it lives; its datagrams are taken from now on.
    Proven,
    /// It is dropped.
    Refused(Refusal),
}

/// Why a datagram is dropped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Refusal {
    /// It is not sealed, or by another version.
    NotSealed,
    /// Sealed with a key that this robot does not have: newer than its own, or another fleet's.
    NoKey(KeyId),
    /// Sealed with a key that was retired by a rotation, as a revoked robot has it.
    Retired(KeyId),
    /// Changed on its way, or sealed with another key of the same number.
    Forged,
    /// It came before, or it is older than the last 1,024 of its sender.
    Replayed,
    /// Of a start that has not proven to live: recorded in the past, or just started.
    Unproven,
    /// An answer to no question.
    Stray,
    /// Of this very robot.
    Own,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotSealed => f.write_str("it is not sealed"),
            Self::NoKey(id) => write!(f, "it is sealed with mesh key {id}, which is not here"),
            Self::Retired(id) => write!(f, "it is sealed with mesh key {id}, which was retired"),
            Self::Forged => f.write_str("its seal is broken"),
            Self::Replayed => f.write_str("it came before"),
            Self::Unproven => f.write_str("its sender has not proven that it lives"),
            Self::Stray => f.write_str("it answers no question"),
            Self::Own => f.write_str("it is this robot's own"),
        }
    }
}

/// One robot's half of the sealed mesh: time and randomness in, bytes in, bytes out.
pub struct Seal {
    keyring: Keyring,
    sealer: Sealer,
    opener: Opener,
    chance: Chance,
}

impl Seal {
    /// Seals under a new start with the newest of `keys` and opens with all of them; `grace`
    /// is the time from learning another key to sealing with it.
    ///
    /// # Panics
    /// When there is no key.
    pub fn new(
        keys: impl IntoIterator<Item = MeshKey>,
        grace: Duration,
        now: Instant,
        mut chance: Chance,
    ) -> Self {
        let keyring = Keyring::new(keys, grace, now);
        Self { keyring, sealer: Sealer::new(&mut chance), opener: Opener::default(), chance }
    }

    /// Takes a new key: it opens at once.
    pub fn add_key(&mut self, now: Instant, key: MeshKey, begin: Begin) {
        self.keyring.add(now, key, begin);
    }

    /// Which keys there are.
    pub fn keyring(&self) -> &Keyring {
        &self.keyring
    }

    /// The datagram that carries `bytes`, [`OVERHEAD_BYTES`] longer.
    pub fn seal(&mut self, now: Instant, bytes: &[u8]) -> Vec<u8> {
        self.seal_as(now, Kind::Data, bytes)
    }

    /// The datagram that carries a signed line.
    pub fn seal_notice(&mut self, now: Instant, line: &str) -> Vec<u8> {
        self.seal_as(now, Kind::Notice, line.as_bytes())
    }

    /// For somebody who sealed with a retired key: a datagram that says nothing but which key
    /// is in use; never longer than the `came` bytes that came, or nothing.
    pub fn hint(&mut self, now: Instant, came: usize) -> Option<Vec<u8>> {
        (came >= OVERHEAD_BYTES).then(|| self.seal_as(now, Kind::Proof, &[]))
    }

    /// Looks into a datagram.
    pub fn open(&mut self, now: Instant, datagram: &[u8]) -> Opened {
        let verdict =
            self.opener.open(now, datagram, &self.keyring, self.sealer.start(), &mut self.chance);
        match verdict {
            Verdict::Data(bytes) => Opened::Datagram(bytes),
            Verdict::Notice(line) => Opened::Notice(line),
            Verdict::Proven => Opened::Proven,
            Verdict::Ask(question) => Opened::Answer(self.seal_as(now, Kind::Challenge, &question)),
            Verdict::Prove(answer) => Opened::Answer(self.seal_as(now, Kind::Proof, &answer)),
            Verdict::Refused(refusal) => Opened::Refused(refusal),
        }
    }

    /// What was opened and refused since the start; forgets questions that are too old.
    pub fn counters(&mut self, now: Instant) -> SealCounters {
        self.opener.counters(now)
    }

    fn seal_as(&mut self, now: Instant, kind: Kind, bytes: &[u8]) -> Vec<u8> {
        let key = self.keyring.sealing(now);
        self.sealer.seal(key, kind, bytes, &mut self.chance)
    }
}

impl fmt::Debug for Seal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Seal({:?})", self.keyring)
    }
}
