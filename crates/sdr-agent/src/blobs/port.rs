//! The mesh's socket as the QUIC library wants it: packets come out of a queue.

use std::fmt;
use std::future::Future;
use std::io::{self, IoSliceMut};
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll, ready};

use quinn::udp::{RecvMeta, Transmit};
use quinn::{AsyncUdpSocket, UdpPoller};
use tokio::net::UdpSocket;
use tokio::sync::mpsc;

/// A socket that is shared with the mesh.
#[derive(Debug)]
pub(super) struct Port {
    socket: Arc<UdpSocket>,
    packets: Mutex<mpsc::Receiver<(SocketAddr, Vec<u8>)>>,
}

impl Port {
    pub(super) fn new(
        socket: Arc<UdpSocket>,
        packets: mpsc::Receiver<(SocketAddr, Vec<u8>)>,
    ) -> Self {
        Self { socket, packets: Mutex::new(packets) }
    }
}

impl AsyncUdpSocket for Port {
    fn create_io_poller(self: Arc<Self>) -> Pin<Box<dyn UdpPoller>> {
        Box::pin(Writable { socket: self.socket.clone(), waiting: None })
    }

    fn try_send(&self, transmit: &Transmit<'_>) -> io::Result<()> {
        self.socket.try_send_to(transmit.contents, transmit.destination).map(drop)
    }

    fn poll_recv(
        &self,
        context: &mut Context<'_>,
        buffers: &mut [IoSliceMut<'_>],
        metas: &mut [RecvMeta],
    ) -> Poll<io::Result<usize>> {
        let mut packets = self.packets.lock().unwrap_or_else(PoisonError::into_inner);
        let (from, packet) = loop {
            match ready!(packets.poll_recv(context)) {
                // Longer than anything that this end allows.
                Some((_, packet)) if packet.len() > buffers[0].len() => {}
                Some(packet) => break packet,
                None => return Poll::Ready(Err(io::ErrorKind::NotConnected.into())),
            }
        };
        buffers[0][..packet.len()].copy_from_slice(&packet);
        let length = packet.len();
        metas[0] = RecvMeta { addr: from, len: length, stride: length, ecn: None, dst_ip: None };
        Poll::Ready(Ok(1))
    }

    fn local_addr(&self) -> io::Result<SocketAddr> {
        self.socket.local_addr()
    }
}

type Waiting = Pin<Box<dyn Future<Output = io::Result<()>> + Send + Sync>>;

/// Waits until the socket takes more.
struct Writable {
    socket: Arc<UdpSocket>,
    waiting: Option<Waiting>,
}

impl UdpPoller for Writable {
    fn poll_writable(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        let socket = self.socket.clone();
        let waiting =
            self.waiting.get_or_insert_with(|| Box::pin(async move { socket.writable().await }));
        let result = ready!(waiting.as_mut().poll(context));
        self.waiting = None;
        Poll::Ready(result)
    }
}

impl fmt::Debug for Writable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Writable")
    }
}
