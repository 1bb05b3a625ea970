//! One connection to an agent: a Unix socket here, or TLS to another robot.

use std::{io, sync::Arc};

use rustls::{ClientConfig, pki_types::ServerName};
use sdr_keys::{Holder, tls};
use tokio::{
    io::{AsyncRead, AsyncWrite},
    net::{TcpStream, UnixStream},
};
use tokio_rustls::TlsConnector;

use super::{Client, ClientError, address::Address};

/// Whatever bytes go through.
pub(super) trait Wire: AsyncRead + AsyncWrite + Unpin + Send {}
impl<T: AsyncRead + AsyncWrite + Unpin + Send> Wire for T {}

/// What a remote agent is shown.
#[derive(Clone)]
pub(super) struct Pass {
    pub(super) holder: Holder,
    pub(super) config: Arc<ClientConfig>,
}

impl std::fmt::Debug for Pass {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Pass({})", self.holder)
    }
}

impl Client {
    /// A new connection.
    pub(super) async fn connect(&self) -> Result<Box<dyn Wire>, ClientError> {
        match &self.address {
            Address::Socket(path) => {
                let stream = UnixStream::connect(path).await;
                Ok(Box::new(stream.map_err(|error| self.absent(error))?))
            }
            Address::Remote { host, port, pass } => {
                let stream = TcpStream::connect((host.as_str(), *port)).await;
                let stream = stream
                    .map_err(|source| ClientError::Unreachable { agent: self.agent(), source })?;
                // The name is not looked at: the certificate must be a robot's of the fleet.
                let name = ServerName::try_from("robot").expect("a host name");
                let tls = TlsConnector::from(pass.config.clone()).connect(name, stream).await;
                Ok(Box::new(tls.map_err(|error| self.unwelcome(&error, &pass.holder))?))
            }
        }
    }

    fn absent(&self, source: io::Error) -> ClientError {
        let agent = self.agent();
        match source.kind() == io::ErrorKind::PermissionDenied {
            true => ClientError::Denied { agent },
            false => ClientError::Absent { agent, source },
        }
    }

    /// In TLS 1.3 the agent's refusal of a certificate comes after the client's handshake:
    /// with the first bytes read.
    pub(super) fn refusal_in(
        &self,
        error: &(dyn std::error::Error + 'static),
    ) -> Option<ClientError> {
        let Address::Remote { pass, .. } = &self.address else { return None };
        let mut cause = Some(error);
        while let Some(error) = cause {
            let io = error.downcast_ref::<io::Error>();
            if let Some(reason) = io.and_then(|io| tls::explain(io, &pass.holder)) {
                return Some(ClientError::Unwelcome { agent: self.agent(), reason });
            }
            cause = error.source();
        }
        None
    }

    fn unwelcome(&self, error: &io::Error, own: &Holder) -> ClientError {
        let reason = tls::explain(error, own).unwrap_or_else(|| format!("no TLS: {error}"));
        ClientError::Unwelcome { agent: self.agent(), reason }
    }
}
