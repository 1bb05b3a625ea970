//! Streams between robots: QUIC with certificates at both ends, on the mesh's own port.
//!
//! ```text
//!  mesh port ─▶ sorter ─▶ port ─▶ quinn ─▶ serve ─▶ store (blobs), keys (mesh key)
//!                                   ▲
//!                   fetch, rotation ┘  asks others
//! ```

mod fetch;
mod parts;
mod port;
mod rotation;
mod serve;
mod store;
#[cfg(test)]
mod tests;

use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use quinn::crypto::rustls::{NoInitialCipherSuite, QuicClientConfig, QuicServerConfig};
use quinn::{
    ClientConfig, Endpoint, EndpointConfig, IdleTimeout, ServerConfig, TransportConfig, VarInt,
};
use sdr_keys::stream::PROTOCOL;
use sdr_keys::tls::{self, Wanted};
use thiserror::Error;
use tokio::net::UdpSocket;
use tokio::sync::mpsc;

use crate::mesh::keys::FleetKeys;
use crate::mesh::sealed::KeyHint;
pub(crate) use fetch::FetchError;
pub(crate) use parts::Parts;
pub(crate) use store::{BLOB_BYTES_MAX, BlobStore, Keep, StoreError};

/// First guess of a round trip; the library's own 333 ms would make a lost packet of a
/// handshake cost a second.
const ROUND_TRIP_GUESS: Duration = Duration::from_millis(50);
/// A connection that is quiet for so long ends.
const IDLE: Duration = Duration::from_secs(15);
/// Keeps one that is in use from ending.
const KEEP_ALIVE: Duration = Duration::from_secs(4);
/// Requests that one robot may have open at another.
const STREAMS_MAX: u32 = 8;
/// What one stream may have in flight, bytes.
const STREAM_WINDOW: u32 = 256 * 1024;
/// What one connection may have in flight, bytes.
const CONNECTION_WINDOW: u32 = 1024 * 1024;

/// Why streams do not start.
#[derive(Debug, Error)]
pub(crate) enum StreamsError {
    /// The TLS library cannot speak QUIC with these settings.
    #[error("streams: {0}")]
    Suite(#[from] NoInitialCipherSuite),
    /// The system refused.
    #[error("streams: {0}")]
    Io(#[from] io::Error),
}

/// This robot's end of all streams; cheap to clone.
#[derive(Clone, Debug)]
pub(crate) struct Streams {
    endpoint: Endpoint,
    keys: FleetKeys,
    store: BlobStore,
}

impl Streams {
    /// Serves and asks over `socket`, whose packets come through `packets`. Call within a
    /// runtime.
    pub(crate) fn start(
        socket: Arc<UdpSocket>,
        packets: mpsc::Receiver<(SocketAddr, Vec<u8>)>,
        keys: FleetKeys,
        store: BlobStore,
    ) -> Result<Self, StreamsError> {
        let transport = transport();
        let identity = keys.identity();
        let gate = keys.gate();
        let server =
            tls::server(identity, gate.clone(), Wanted::Robot, PROTOCOL, keys.on_refusal("stream"));
        let mut server =
            ServerConfig::with_crypto(Arc::new(QuicServerConfig::try_from(Arc::new(server))?));
        server.transport_config(transport.clone());
        let client = tls::client(identity, gate, PROTOCOL, keys.on_refusal("stream"));
        let mut client = ClientConfig::new(Arc::new(QuicClientConfig::try_from(Arc::new(client))?));
        client.transport_config(transport);

        let mut config = EndpointConfig::default();
        // The bit tells packets of streams from sealed datagrams.
        config.grease_quic_bit(false);
        let port = port::Port::new(socket, packets);
        let runtime = Arc::new(quinn::TokioRuntime);
        let mut endpoint =
            Endpoint::new_with_abstract_socket(config, Some(server), Arc::new(port), runtime)?;
        endpoint.set_default_client_config(client);
        let streams = Self { endpoint, keys, store };
        tokio::spawn(serve::serve(streams.clone()));
        Ok(streams)
    }

    /// Asks whoever seems to have a newer mesh key, until the agent ends.
    pub(crate) fn follow_hints(&self, hints: mpsc::Receiver<KeyHint>) {
        tokio::spawn(rotation::follow(self.clone(), hints));
    }

    /// The blobs of this robot.
    pub(crate) fn store(&self) -> &BlobStore {
        &self.store
    }
}

fn transport() -> Arc<TransportConfig> {
    let mut transport = TransportConfig::default();
    let idle = u32::try_from(IDLE.as_millis()).expect("seconds");
    transport
        .initial_rtt(ROUND_TRIP_GUESS)
        .max_idle_timeout(Some(IdleTimeout::from(VarInt::from_u32(idle))))
        .keep_alive_interval(Some(KEEP_ALIVE))
        .max_concurrent_bidi_streams(VarInt::from_u32(STREAMS_MAX))
        .max_concurrent_uni_streams(VarInt::from_u32(0))
        .datagram_receive_buffer_size(None)
        .stream_receive_window(VarInt::from_u32(STREAM_WINDOW))
        .receive_window(VarInt::from_u32(CONNECTION_WINDOW))
        .send_window(u64::from(CONNECTION_WINDOW));
    Arc::new(transport)
}
