//! The same API for operators of other machines: TLS 1.3, certificates at both ends.

use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use axum::extract::connect_info::Connected;
use axum::extract::{ConnectInfo, Request, State};
use axum::http::{Method, StatusCode};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse as _, Response};
use axum::serve::{IncomingStream, Listener};
use rustls::pki_types::UnixTime;
use sdr_keys::tls::{self, Wanted};
use sdr_keys::{Bearer, Holder, Role};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, mpsc};
use tokio::task::JoinHandle;
use tokio::time::timeout;
use tokio_rustls::TlsAcceptor;
use tokio_rustls::server::TlsStream;

use super::answer::Refusal;
use super::connection::Counted;
use super::{ApiState, router};
use crate::mesh::keys::FleetKeys;
use crate::trouble::Kind;

/// Connections at a time.
const CONNECTIONS_MAX: usize = 64;
/// How long a handshake may take.
const HANDSHAKE_WITHIN: Duration = Duration::from_secs(5);
/// Pause after the system refused a connection, such as for want of descriptors.
const REST: Duration = Duration::from_secs(1);

/// Serves operators at `listener` until the task is ended.
pub(super) fn serve(listener: TcpListener, keys: FleetKeys, state: ApiState) -> JoinHandle<()> {
    let guard = Guard { keys: keys.clone(), state: state.clone() };
    let router = router(state).layer(from_fn_with_state(guard, admit));
    let service = router.into_make_service_with_connect_info::<Caller>();
    let listener = Door::open(listener, keys);
    tokio::spawn(async move {
        if let Err(error) = axum::serve(listener, service).await {
            tracing::error!(event = "remote-api-lost", %error, next = "restart the agent");
        }
    })
}

/// Who is at the other end.
#[derive(Clone, Debug)]
struct Caller {
    bearer: Arc<Bearer>,
}

impl Connected<IncomingStream<'_, Door>> for Caller {
    fn connect_info(stream: IncomingStream<'_, Door>) -> Self {
        stream.remote_addr().clone()
    }
}

/// What each request is checked against.
#[derive(Clone)]
struct Guard {
    keys: FleetKeys,
    state: ApiState,
}

/// Lets a request through when its operator may make it, now.
async fn admit(
    State(guard): State<Guard>,
    ConnectInfo(caller): ConnectInfo<Caller>,
    request: Request,
    next: Next,
) -> Response {
    let Bearer { holder, fingerprint, .. } = &*caller.bearer;
    let refused = if guard.keys.gate().is_denied(fingerprint) {
        Some(format!("{holder} was revoked"))
    } else {
        let reads = request.method() == Method::GET || request.method() == Method::HEAD;
        match holder {
            Holder::Operator { role: Role::Operate, .. } => None,
            Holder::Operator { role: Role::View, .. } if reads => None,
            Holder::Operator { role: Role::View, .. } => Some(format!(
                "{holder} may look and not {} {}; that takes the role operate",
                request.method(),
                request.uri().path()
            )),
            Holder::Robot(_) => Some(format!("{holder} is not an operator")),
        }
    };
    match refused {
        None => next.run(request).await,
        Some(refused) => {
            guard.state.trouble.count(Kind::ApiForbidden, &refused);
            Refusal::new(StatusCode::FORBIDDEN, refused).into_response()
        }
    }
}

/// Connections whose handshake is done.
struct Door {
    ready: mpsc::Receiver<(Counted<TlsStream<TcpStream>>, Caller)>,
    address: io::Result<SocketAddr>,
}

impl Door {
    fn open(listener: TcpListener, keys: FleetKeys) -> Self {
        let (sender, ready) = mpsc::channel(1);
        let address = listener.local_addr();
        tokio::spawn(receive(listener, keys, sender));
        Self { ready, address }
    }
}

impl Listener for Door {
    type Io = Counted<TlsStream<TcpStream>>;
    type Addr = Caller;

    async fn accept(&mut self) -> (Self::Io, Self::Addr) {
        match self.ready.recv().await {
            Some(connection) => connection,
            // The runtime ends; so does this task.
            None => std::future::pending().await,
        }
    }

    fn local_addr(&self) -> io::Result<Caller> {
        match &self.address {
            Ok(_) => Err(io::Error::other("the own end has no caller")),
            Err(error) => Err(io::Error::new(error.kind(), error.to_string())),
        }
    }
}

/// Shakes hands with everybody at once, so that none waits for another.
async fn receive(
    listener: TcpListener,
    keys: FleetKeys,
    ready: mpsc::Sender<(Counted<TlsStream<TcpStream>>, Caller)>,
) {
    let on_refusal = keys.on_refusal("api");
    let config =
        tls::server(keys.identity(), keys.gate(), Wanted::Operator, b"http/1.1", on_refusal);
    let acceptor = TlsAcceptor::from(Arc::new(config));
    let room = Arc::new(Semaphore::new(CONNECTIONS_MAX));
    loop {
        let Ok(place) = room.clone().acquire_owned().await else { return };
        let (stream, from) = match listener.accept().await {
            Ok(accepted) => accepted,
            Err(error) => {
                tracing::warn!(event = "remote-api-busy", %error, next = "again in 1 s");
                tokio::time::sleep(REST).await;
                continue;
            }
        };
        let (acceptor, keys, ready) = (acceptor.clone(), keys.clone(), ready.clone());
        tokio::spawn(async move {
            match shake(&acceptor, &keys, stream, place).await {
                // The server ended meanwhile.
                Ok(connection) => drop(ready.send(connection).await),
                Err(reason) => tracing::debug!(event = "operator-refused", %from, reason),
            }
        });
    }
}

async fn shake(
    acceptor: &TlsAcceptor,
    keys: &FleetKeys,
    stream: TcpStream,
    place: OwnedSemaphorePermit,
) -> Result<(Counted<TlsStream<TcpStream>>, Caller), String> {
    let shaken = timeout(HANDSHAKE_WITHIN, acceptor.accept(stream)).await;
    let stream = shaken.map_err(|_| "no handshake in time")?.map_err(|error| error.to_string())?;
    let shown = stream.get_ref().1.peer_certificates().and_then(|chain| chain.first());
    let shown = shown.ok_or("no certificate")?;
    let bearer = keys.gate().admit(shown, &Wanted::Operator, UnixTime::now());
    let bearer = Arc::new(bearer.map_err(|refused| refused.to_string())?);
    Ok((Counted::new(stream, place), Caller { bearer }))
}
