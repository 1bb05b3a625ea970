//! What comes in at the port of a mesh with keys: datagrams, streams, and what is neither.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use sdr_core::{mesh::is_plain, time::Instant};
use sdr_keys::seal::{Begin, Opened, Refusal};
use tokio::net::UdpSocket;
use tokio::sync::mpsc;

use super::addresses::Addresses;
use super::keys::FleetKeys;
use crate::clock;
use crate::trouble::{Kind, Trouble};

/// How often a new key is told of: datagrams are lost.
const TELLINGS: u32 = 5;
/// Time between two of them.
const TELL_PERIOD: Duration = Duration::from_secs(1);

/// A robot that has a newer key.
#[derive(Clone, Copy, Debug)]
pub(crate) struct KeyHint {
    /// Where it is.
    pub(crate) from: SocketAddr,
    /// From when on its key is to seal.
    pub(crate) begin: Begin,
}

/// Where things go that are no datagrams of the brain.
#[derive(Clone, Debug)]
pub(crate) struct Sidings {
    /// Packets of streams.
    pub(crate) streams: mpsc::Sender<(SocketAddr, Vec<u8>)>,
    /// Whom to ask for a newer key.
    pub(crate) hints: mpsc::Sender<KeyHint>,
}

/// Looks into everything that comes.
pub(super) struct Sorter {
    pub(super) keys: FleetKeys,
    pub(super) socket: Arc<UdpSocket>,
    pub(super) sidings: Sidings,
    pub(super) trouble: Trouble,
    pub(super) addresses: Addresses,
}

impl Sorter {
    /// Sorts for `keys`; tells others of each newer key. Call within a `LocalSet`.
    pub(super) fn start(
        keys: FleetKeys,
        socket: Arc<UdpSocket>,
        sidings: Sidings,
        trouble: Trouble,
    ) -> Self {
        let addresses = Addresses::default();
        let telling = tell_of_new_keys(keys.clone(), socket.clone(), addresses.clone());
        tokio::task::spawn_local(telling);
        Self { keys, socket, sidings, trouble, addresses }
    }

    /// What a packet holds for the brain.
    pub(super) fn sort(&self, from: SocketAddr, packet: &[u8]) -> Option<Vec<u8>> {
        if is_of_a_stream(packet) {
            // A full queue loses packets as a full radio does.
            let _ = self.sidings.streams.try_send((from, packet.to_vec()));
            return None;
        }
        let now = clock::now();
        let opened = self.keys.seal().open(now, packet);
        match opened {
            Opened::Datagram(bytes) => {
                self.addresses.note(now, from);
                return Some(bytes);
            }
            Opened::Answer(bytes) => self.send(from, &bytes),
            Opened::Proven => self.addresses.note(now, from),
            Opened::Notice(line) => self.consider_notice(from, &line),
            Opened::Refused(refusal) => self.refuse(now, from, packet.len(), refusal),
        }
        None
    }

    fn refuse(&self, now: Instant, from: SocketAddr, length: usize, refusal: Refusal) {
        let kind = match refusal {
            Refusal::NotSealed => Kind::DatagramUnsealed,
            Refusal::NoKey(id) => {
                // Anybody can write such a datagram; only those this robot speaks with anyway
                // are asked, so that nobody can be made a target.
                let newer = id > *self.keys.newest().borrow();
                if newer && self.addresses.knows(now, from) {
                    self.ask(from, Begin::Now);
                }
                Kind::DatagramNoKey
            }
            Refusal::Retired(_) => {
                let hint = self.keys.seal().hint(now, length);
                if let Some(hint) = hint {
                    self.send(from, &hint);
                }
                Kind::DatagramRetiredKey
            }
            Refusal::Forged => Kind::DatagramForged,
            Refusal::Replayed => Kind::DatagramReplayed,
            // Normal when a robot starts; what stays unproven is counted by the watch.
            Refusal::Unproven => return,
            // A robot may be among its own seeds.
            Refusal::Own => return,
            // A question was lost on its way, or answered twice.
            Refusal::Stray => return,
        };
        self.trouble.count(kind, &format!("datagram from {from}: {refusal}"));
    }

    /// A robot says that there is a newer key.
    fn consider_notice(&self, from: SocketAddr, line: &str) {
        match self.keys.trust().read_notice(line) {
            Ok(notice) if notice.notice().key > *self.keys.newest().borrow() => {
                self.ask(from, Begin::AfterGrace);
            }
            Ok(_) => {}
            Err(error) => {
                self.trouble.count(Kind::NoticeForged, &format!("notice from {from}: {error}"));
            }
        }
    }

    fn ask(&self, from: SocketAddr, begin: Begin) {
        // Who is asked already is enough.
        let _ = self.sidings.hints.try_send(KeyHint { from, begin });
    }

    fn send(&self, to: SocketAddr, bytes: &[u8]) {
        send(&self.socket, to, bytes);
    }
}

/// Sends once, without waiting.
pub(super) fn send(socket: &UdpSocket, to: SocketAddr, bytes: &[u8]) {
    if let Err(error) = socket.try_send_to(bytes, to) {
        tracing::debug!(event = "datagram-not-sent", %to, %error);
    }
}

/// QUIC sets one of the two first bits of each packet (RFC 9000, 17.2 and 17.3); sealed
/// datagrams set none, and plain ones of the mesh begin with `SD` and the version.
fn is_of_a_stream(packet: &[u8]) -> bool {
    packet.first().is_some_and(|first| first & 0xc0 != 0) && !is_plain(packet)
}

/// Tells all robots that this one speaks with of each newer key, several times.
async fn tell_of_new_keys(keys: FleetKeys, socket: Arc<UdpSocket>, addresses: Addresses) {
    let mut newest = keys.newest();
    while newest.changed().await.is_ok() {
        for _ in 0..TELLINGS {
            let line = keys.notice();
            let now = clock::now();
            for to in addresses.recent(now) {
                let datagram = keys.seal().seal_notice(now, &line);
                send(&socket, to, &datagram);
            }
            tokio::time::sleep(TELL_PERIOD).await;
        }
    }
}
