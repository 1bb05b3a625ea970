//! The client of an agent's API: HTTP/1.1 and JSON over a Unix socket or TLS, one connection a
//! request.

mod address;
mod connect;
mod error;
mod stream;

use std::{path::PathBuf, time::Duration};

use http_body_util::{BodyExt, Full, LengthLimitError, Limited};
use hyper::{
    Method, Request, Response, StatusCode,
    body::{Bytes, Incoming},
    client::conn::http1::{self, SendRequest},
    header,
};
use hyper_util::rt::TokioIo;
use sdr_core::api::ErrorAnswer;
use serde::{Serialize, de::DeserializeOwned};
use tokio::time::timeout;

use address::Address;
pub(crate) use address::user_folder;
pub(crate) use error::ClientError;
pub(crate) use stream::{Chunks, Events};

/// Largest answer that is read whole.
const ANSWER_BYTES_MAX: usize = 16 << 20;
/// How long an agent may take for an answer: it gives its disk 10 s, and then says so itself.
const ANSWER_WITHIN: Duration = Duration::from_secs(15);
/// How long a hint may take.
const HINT_WITHIN: Duration = Duration::from_secs(1);

/// Speaks with one agent.
#[derive(Clone, Debug)]
pub(crate) struct Client {
    address: Address,
    within: Duration,
}

/// A request without its connection.
struct Call<'a> {
    method: Method,
    path: &'a str,
    body: Option<Vec<u8>>,
}

impl Client {
    /// The agent at this Unix socket.
    pub(crate) fn at(socket: impl Into<PathBuf>) -> Self {
        Self::new(Address::Socket(socket.into()))
    }

    fn new(address: Address) -> Self {
        Self { address, within: ANSWER_WITHIN }
    }

    /// The same agent, given up soon: for what is nice to know.
    pub(crate) fn hurried(&self) -> Self {
        Self { address: self.address.clone(), within: HINT_WITHIN }
    }

    /// Where the agent is looked for.
    pub(crate) fn agent(&self) -> String {
        self.address.to_string()
    }

    /// `GET path`, read as `T`.
    pub(crate) async fn get<T: DeserializeOwned>(&self, path: &str) -> Result<T, ClientError> {
        self.ask(Call { method: Method::GET, path, body: None }).await
    }

    /// `POST path` with `value` as JSON, the answer read as `T`.
    pub(crate) async fn post<T: DeserializeOwned>(
        &self,
        path: &str,
        value: &impl Serialize,
    ) -> Result<T, ClientError> {
        let body = serde_json::to_vec(value)
            .map_err(|error| ClientError::Request { reason: error.to_string() })?;
        self.ask(Call { method: Method::POST, path, body: Some(body) }).await
    }

    /// `DELETE path`; what the answer says beyond its status does not matter.
    pub(crate) async fn delete(&self, path: &str) -> Result<(), ClientError> {
        let call = Call { method: Method::DELETE, path, body: None };
        self.whole(call).await.map(|_| ())
    }

    /// `GET path` as a stream of bytes that may never end.
    pub(crate) async fn stream(&self, path: &str) -> Result<Chunks, ClientError> {
        let call = Call { method: Method::GET, path, body: None };
        let (sender, response) = self.in_time(path, self.send(call)).await?;
        if response.status().is_success() {
            return Ok(Chunks::new(sender, response.into_body(), self.agent()));
        }
        let status = response.status();
        let body = self.in_time(path, self.read(path, response)).await?;
        Err(self.refused(path, status, &body))
    }

    /// `GET path` as server-sent events.
    pub(crate) async fn events(&self, path: &str) -> Result<Events, ClientError> {
        Ok(Events::new(self.stream(path).await?))
    }

    async fn ask<T: DeserializeOwned>(&self, call: Call<'_>) -> Result<T, ClientError> {
        let path = call.path;
        let body = self.whole(call).await?;
        serde_json::from_slice(&body)
            .map_err(|error| ClientError::nonsense(self, path, error, &body))
    }

    /// The whole body of an answer that is no refusal.
    async fn whole(&self, call: Call<'_>) -> Result<Bytes, ClientError> {
        let path = call.path;
        let exchange = async {
            let (_sender, response) = self.send(call).await?;
            let status = response.status();
            Ok((status, self.read(path, response).await?))
        };
        let (status, body) = self.in_time(path, exchange).await?;
        match status.is_success() {
            true => Ok(body),
            false => Err(self.refused(path, status, &body)),
        }
    }

    async fn in_time<T>(
        &self,
        path: &str,
        exchange: impl Future<Output = Result<T, ClientError>>,
    ) -> Result<T, ClientError> {
        timeout(self.within, exchange).await.unwrap_or_else(|_| {
            Err(ClientError::Silent {
                agent: self.agent(),
                path: path.into(),
                seconds: self.within.as_secs_f64(),
            })
        })
    }

    async fn send(
        &self,
        call: Call<'_>,
    ) -> Result<(SendRequest<Full<Bytes>>, Response<Incoming>), ClientError> {
        let stream = self.connect().await?;
        let broken = |error: hyper::Error| self.broken(call.path, &error);
        let (mut sender, connection) =
            http1::handshake(TokioIo::new(stream)).await.map_err(broken)?;
        // Its error reaches us through the response or its body as well.
        tokio::spawn(async move { drop(connection.await) });
        let request = Request::builder()
            .method(call.method)
            .uri(call.path)
            .header(header::HOST, "agent")
            .header(header::CONTENT_TYPE, "application/json")
            .body(Full::new(Bytes::from(call.body.unwrap_or_default())))
            .map_err(|error| ClientError::Request { reason: error.to_string() })?;
        let response = sender.send_request(request).await.map_err(broken)?;
        Ok((sender, response))
    }

    async fn read(&self, path: &str, response: Response<Incoming>) -> Result<Bytes, ClientError> {
        let body = Limited::new(response.into_body(), ANSWER_BYTES_MAX).collect().await;
        body.map(http_body_util::Collected::to_bytes).map_err(|error| {
            match error.downcast::<LengthLimitError>() {
                Ok(_) => ClientError::TooLarge { path: path.into(), limit: ANSWER_BYTES_MAX >> 20 },
                Err(error) => self.broken(path, error.as_ref()),
            }
        })
    }

    fn broken(&self, path: &str, error: &(dyn std::error::Error + 'static)) -> ClientError {
        if let Some(refusal) = self.refusal_in(error) {
            return refusal;
        }
        let mut reason = error.to_string();
        let mut cause = error.source();
        while let Some(inner) = cause {
            reason = format!("{reason}: {inner}");
            cause = inner.source();
        }
        ClientError::Broken { agent: self.agent(), path: path.into(), reason }
    }

    fn refused(&self, path: &str, status: StatusCode, body: &Bytes) -> ClientError {
        match serde_json::from_slice::<ErrorAnswer>(body) {
            Ok(answer) => ClientError::Refused { status: status.as_u16(), answer },
            Err(error) => {
                ClientError::nonsense(self, path, format!("status {status}, {error}"), body)
            }
        }
    }
}

#[cfg(test)]
mod tests;
