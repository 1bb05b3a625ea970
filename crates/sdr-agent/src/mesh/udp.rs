//! One UDP socket for all datagrams of the mesh, and for the packets of streams.

use std::borrow::Cow;
use std::io;
use std::net::SocketAddr;
use std::rc::Rc;
use std::sync::Arc;

use sdr_core::input::Input;
use sdr_keys::seal::OVERHEAD_BYTES;
use tokio::net::UdpSocket;
use tokio::sync::mpsc;

use super::addresses::Addresses;
use super::discovery::Discovery;
use super::keys::FleetKeys;
use super::sealed::{self, Sidings, Sorter};
use crate::clock;
use crate::trouble::{Kind, Trouble};

/// Largest datagram of the mesh, bytes; sealed and with its IPv6 headers it has 1280, which
/// passes every link without fragments.
pub(crate) const DATAGRAM_BYTES_MAX: usize = 1200;
/// Largest packet that is read: what a link of Ethernet's size carries.
const PACKET_BYTES_MAX: usize = 1500;

/// Sends datagrams; a task reads those that come.
#[derive(Debug)]
pub(crate) struct Mesh {
    socket: Arc<UdpSocket>,
    keys: Option<(FleetKeys, Addresses)>,
    /// `None` when nobody is looked for.
    discovery: Option<Discovery>,
}

impl Mesh {
    /// A socket at `address`, which nobody reads yet.
    pub(crate) async fn open(address: SocketAddr) -> io::Result<Arc<UdpSocket>> {
        UdpSocket::bind(address).await.map(Arc::new)
    }

    /// Hands every datagram in, those of the group that `discovery` names too: opened with the
    /// keys, or plain when there are none. Call within a `LocalSet`.
    pub(crate) fn start(
        socket: Arc<UdpSocket>,
        keys: Option<(FleetKeys, Sidings)>,
        discovery: Option<Discovery>,
        inputs: mpsc::Sender<Input>,
        trouble: Trouble,
    ) -> Self {
        let sorter = keys
            .map(|(keys, sidings)| Sorter::start(keys, socket.clone(), sidings, trouble.clone()));
        let own = sorter.as_ref().map(|sorter| (sorter.keys.clone(), sorter.addresses.clone()));
        let sorter = sorter.map(Rc::new);
        let group = discovery.as_ref().and_then(|discovery| match discovery.listen() {
            Ok(group) => Some(group),
            // Seeds and those who find this robot are left.
            Err(error) => {
                tracing::error!(event = "group-unheard", %error, next = "go on without");
                None
            }
        });
        for socket in group.into_iter().chain([socket.clone()]) {
            let (sorter, inputs) = (sorter.clone(), inputs.clone());
            let ear = Ear { socket, sorter, inputs, trouble: trouble.clone() };
            tokio::task::spawn_local(ear.listen());
        }
        Self { socket, keys: own, discovery }
    }

    /// Where others reach this robot.
    pub(crate) fn local_address(&self) -> io::Result<SocketAddr> {
        self.socket.local_addr()
    }

    /// Where all robots on the local network are reached, when others are looked for.
    pub(crate) fn group(&self) -> Option<SocketAddr> {
        self.discovery.as_ref().map(Discovery::seed)
    }

    /// Sends once, without waiting: gossip repairs what a full socket buffer drops.
    pub(crate) fn send(&self, to: SocketAddr, bytes: &[u8]) {
        assert!(bytes.len() <= DATAGRAM_BYTES_MAX, "the brain bounds its datagrams");
        let group = self.discovery.as_ref().filter(|discovery| discovery.is_group(to));
        let datagram = match &self.keys {
            Some((keys, addresses)) => {
                let now = clock::now();
                if group.is_none() {
                    addresses.note(now, to);
                }
                Cow::Owned(keys.seal().seal(now, bytes))
            }
            None => Cow::Borrowed(bytes),
        };
        match group {
            Some(group) => group.send(&self.socket, &datagram),
            None => sealed::send(&self.socket, to, &datagram),
        }
    }
}

/// Reads the socket.
struct Ear {
    socket: Arc<UdpSocket>,
    /// `None` when datagrams are plain.
    sorter: Option<Rc<Sorter>>,
    inputs: mpsc::Sender<Input>,
    trouble: Trouble,
}

impl Ear {
    async fn listen(self) {
        let mut buffer = [0_u8; PACKET_BYTES_MAX];
        loop {
            let (length, from) = match self.socket.recv_from(&mut buffer).await {
                Ok(received) => received,
                // A peer's port was closed; the socket itself is fine.
                Err(error) if error.kind() == io::ErrorKind::ConnectionRefused => continue,
                Err(error) => {
                    tracing::error!(event = "mesh-lost", %error, next = "retry in 1 s");
                    tokio::time::sleep(std::time::Duration::from_secs(1)).await;
                    continue;
                }
            };
            let bytes = match &self.sorter {
                Some(sorter) => sorter.sort(from, &buffer[..length]),
                None => Some(buffer[..length].to_vec()),
            };
            let Some(bytes) = bytes else { continue };
            if bytes.len() > DATAGRAM_BYTES_MAX {
                let said = format!("datagram from {from} over {DATAGRAM_BYTES_MAX} bytes");
                self.trouble.count(Kind::DatagramOversized, &said);
                continue;
            }
            match self.inputs.try_send(Input::Datagram { from, bytes }) {
                Ok(()) => {}
                Err(mpsc::error::TrySendError::Full(_)) => {
                    let said = format!("datagram from {from}: loop is busy");
                    self.trouble.count(Kind::DatagramUnread, &said);
                }
                Err(mpsc::error::TrySendError::Closed(_)) => return,
            }
        }
    }
}

const _: () = assert!(DATAGRAM_BYTES_MAX + OVERHEAD_BYTES <= PACKET_BYTES_MAX);
