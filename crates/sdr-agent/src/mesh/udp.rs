//! One UDP socket for all datagrams of the mesh.

use std::io;
use std::net::SocketAddr;
use std::rc::Rc;

use sdr_core::input::Input;
use tokio::net::UdpSocket;
use tokio::sync::mpsc;

use crate::trouble::{Kind, Trouble};

/// Largest datagram of the mesh, bytes; it passes every link without fragments.
pub(crate) const DATAGRAM_BYTES_MAX: usize = 1200;

/// Sends datagrams; a task reads those that come.
#[derive(Debug)]
pub(crate) struct Mesh {
    socket: Rc<UdpSocket>,
}

impl Mesh {
    /// Listens at `address` and hands every datagram in. Call within a `LocalSet`.
    pub(crate) async fn start(
        address: SocketAddr,
        inputs: mpsc::Sender<Input>,
        trouble: Trouble,
    ) -> io::Result<Self> {
        let socket = Rc::new(UdpSocket::bind(address).await?);
        tokio::task::spawn_local(listen(Rc::clone(&socket), inputs, trouble));
        Ok(Self { socket })
    }

    /// Where others reach this robot.
    pub(crate) fn local_address(&self) -> io::Result<SocketAddr> {
        self.socket.local_addr()
    }

    /// Sends once, without waiting: gossip repairs what a full socket buffer drops.
    pub(crate) fn send(&self, to: SocketAddr, bytes: &[u8]) {
        assert!(bytes.len() <= DATAGRAM_BYTES_MAX, "the brain bounds its datagrams");
        if let Err(error) = self.socket.try_send_to(bytes, to) {
            tracing::debug!(event = "datagram-not-sent", %to, %error);
        }
    }
}

async fn listen(socket: Rc<UdpSocket>, inputs: mpsc::Sender<Input>, trouble: Trouble) {
    // One byte more than allowed, so that an oversized datagram is seen as such.
    let mut buffer = [0_u8; DATAGRAM_BYTES_MAX + 1];
    loop {
        let (length, from) = match socket.recv_from(&mut buffer).await {
            Ok(received) => received,
            // A peer's port was closed; the socket itself is fine.
            Err(error) if error.kind() == io::ErrorKind::ConnectionRefused => continue,
            Err(error) => {
                tracing::error!(event = "mesh-lost", %error, next = "retry in 1 s");
                tokio::time::sleep(std::time::Duration::from_secs(1)).await;
                continue;
            }
        };
        if length > DATAGRAM_BYTES_MAX {
            let said = format!("datagram from {from} over {DATAGRAM_BYTES_MAX} bytes");
            trouble.count(Kind::DatagramOversized, &said);
            continue;
        }
        let datagram = Input::Datagram { from, bytes: buffer[..length].to_vec() };
        match inputs.try_send(datagram) {
            Ok(()) => {}
            Err(mpsc::error::TrySendError::Full(_)) => {
                trouble.count(Kind::DatagramUnread, &format!("datagram from {from}: loop is busy"));
            }
            Err(mpsc::error::TrySendError::Closed(_)) => return,
        }
    }
}
