//! The door for components: who greets is checked before anybody listens to it.

use std::io;
use std::path::Path;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;
use std::{fs, os::unix::fs::PermissionsExt as _};

use rustix::process::{Pid, getpgid, getuid};
use sdr_component::protocol::{
    ErrorReport, FromComponent, Hello, LineBuffer, LineError, Order, PROTOCOL_VERSION, ToComponent,
    encode_agent_line,
};
use thiserror::Error;
use tokio::io::AsyncWriteExt as _;
use tokio::net::{UnixListener, UnixStream};
use tokio::sync::Semaphore;

use super::keeper::{Greeting, Message};
use super::{Shared, remove_if_there};
use crate::trouble::Kind;

/// How long a connection may stay silent before it greets.
const GREETING_MAX: Duration = Duration::from_secs(2);
/// Connections that may be greeting at the same time.
const GREETERS_MAX: usize = 64;
/// How long a component may leave a line of the agent unread.
const WRITE_MAX: Duration = Duration::from_secs(1);

/// Why a connection was refused. Nobody else notices.
#[derive(Debug, Error)]
enum Refused {
    #[error("no greeting within {} s", GREETING_MAX.as_secs())]
    Silent,
    #[error("the connection ended before a greeting")]
    Ended,
    #[error("{0}")]
    Line(#[from] LineError),
    #[error("the first line is `{0}`; it must be `hello`")]
    NotHello(&'static str),
    #[error("protocol version {found}; this agent speaks {PROTOCOL_VERSION}")]
    Version { found: u32 },
    #[error("instance {instance} of {component} was not started by this agent")]
    Unknown { instance: u64, component: String },
    #[error("process {pid} of user {uid} is not the process of instance {instance}")]
    Stranger { pid: i32, uid: u32, instance: u64 },
    #[error("process {pid} does not carry the badge of instance {instance}")]
    Badge { pid: i32, instance: u64 },
    #[error("{0}")]
    Io(#[from] io::Error),
}

/// Opens the socket at `path`, only for this user, and serves it.
pub(super) fn listen(path: &Path, shared: Rc<Shared>) -> io::Result<()> {
    // Whoever listened here was this robot's former agent: two on one state are refused at
    // the API's socket, which is opened first. Components that outlived it watch the folder:
    // what appears under the name takes connections already.
    let unnamed = path.with_extension("new");
    remove_if_there(&unnamed);
    let listener = UnixListener::bind(&unnamed)?;
    fs::set_permissions(&unnamed, fs::Permissions::from_mode(0o600))?;
    fs::rename(&unnamed, path)?;
    tokio::task::spawn_local(serve(listener, shared));
    Ok(())
}

async fn serve(listener: UnixListener, shared: Rc<Shared>) {
    let greeters = Arc::new(Semaphore::new(GREETERS_MAX));
    loop {
        let stream = match listener.accept().await {
            Ok((stream, _)) => stream,
            Err(error) => {
                tracing::error!(event = "components-unheard", %error, next = "retry in 100 ms");
                tokio::time::sleep(Duration::from_millis(100)).await;
                continue;
            }
        };
        let Ok(greeter) = Arc::clone(&greeters).try_acquire_owned() else {
            let said = format!("more than {GREETERS_MAX} connections at once");
            shared.outlets.trouble.count(Kind::ComponentHello, &said);
            continue;
        };
        let shared = Rc::clone(&shared);
        tokio::task::spawn_local(async move {
            welcome(stream, &shared).await;
            drop(greeter);
        });
    }
}

/// Hands the connection to the keeper of its process, or refuses it with the reason.
async fn welcome(mut stream: UnixStream, shared: &Shared) {
    let mut buffer = LineBuffer::default();
    let greeting = async {
        let hello = greeting(&mut stream, &mut buffer).await?;
        let mailbox = check(&hello, &stream, shared)?;
        Ok((hello, mailbox))
    };
    let greeting = tokio::time::timeout(GREETING_MAX, greeting).await;
    match greeting.unwrap_or(Err(Refused::Silent)) {
        Ok((hello, mailbox)) => {
            let greeting = Message::Greeted(Box::new(Greeting { stream, buffer, hello }));
            // The keeper ends only with its process.
            let _ = mailbox.send(greeting).await;
        }
        Err(refused) => {
            let kind = match refused {
                Refused::Line(_) | Refused::NotHello(_) => Kind::ComponentLine,
                Refused::Silent
                | Refused::Ended
                | Refused::Version { .. }
                | Refused::Unknown { .. }
                | Refused::Stranger { .. }
                | Refused::Badge { .. }
                | Refused::Io(_) => Kind::ComponentHello,
            };
            if matches!(refused, Refused::Unknown { .. }) {
                // It outlived an agent whose journal is lost: nobody else can end it.
                let _ = say(&mut stream, &ToComponent::Command(Order::Finish)).await;
            }
            let message = format!("components' socket: {refused}");
            shared.outlets.trouble.count(kind, &message);
            // It may be gone already.
            let _ = say(&mut stream, &ToComponent::Error(ErrorReport { message })).await;
        }
    }
}

async fn greeting(stream: &mut UnixStream, buffer: &mut LineBuffer) -> Result<Hello, Refused> {
    loop {
        if let Some(message) = buffer.next_message::<FromComponent>()? {
            return match message {
                FromComponent::Hello(hello) => Ok(*hello),
                FromComponent::State(_) => Err(Refused::NotHello("state")),
                FromComponent::Heard(_) => Err(Refused::NotHello("heard")),
                FromComponent::Beat(_) => Err(Refused::NotHello("beat")),
                FromComponent::Counters(_) => Err(Refused::NotHello("counters")),
                FromComponent::Error(_) => Err(Refused::NotHello("error")),
            };
        }
        if receive(stream, buffer).await? == 0 {
            return Err(Refused::Ended);
        }
    }
}

/// Whether the one who greets is who it says, by what the kernel says.
fn check(
    hello: &Hello,
    stream: &UnixStream,
    shared: &Shared,
) -> Result<tokio::sync::mpsc::Sender<Message>, Refused> {
    if hello.v != PROTOCOL_VERSION {
        return Err(Refused::Version { found: hello.v });
    }
    let kept = shared.kept.borrow();
    let known = kept.get(&hello.instance).filter(|kept| kept.component == hello.component);
    let Some(known) = known else {
        let component = hello.component.to_string();
        return Err(Refused::Unknown { instance: hello.instance, component });
    };
    let peer = stream.peer_cred()?;
    let pid = peer.pid().unwrap_or(0);
    // The process itself, or one that it started in its own group (a wrapper script).
    let group = Pid::from_raw(pid).and_then(|pid| getpgid(Some(pid)).ok());
    let ours =
        group.is_some_and(|group| u32::try_from(group.as_raw_nonzero().get()) == Ok(known.pid));
    if !ours || peer.uid() != getuid().as_raw() {
        return Err(Refused::Stranger { pid, uid: peer.uid(), instance: hello.instance });
    }
    if hello.badge.as_ref().is_some_and(|badge| *badge != known.badge) {
        return Err(Refused::Badge { pid, instance: hello.instance });
    }
    Ok(known.mailbox.clone())
}

/// Takes what came into `buffer`; 0 at the end of the stream. May be cancelled at any time.
pub(super) async fn receive(stream: &UnixStream, buffer: &mut LineBuffer) -> io::Result<usize> {
    let mut bytes = [0_u8; 16 * 1024];
    loop {
        stream.readable().await?;
        match stream.try_read(&mut bytes) {
            Ok(length) => {
                buffer.push(&bytes[..length]);
                return Ok(length);
            }
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
            Err(error) => return Err(error),
        }
    }
}

/// Sends one message.
pub(super) async fn say(stream: &mut UnixStream, message: &ToComponent) -> io::Result<()> {
    let line = encode_agent_line(message).map_err(io::Error::other)?;
    tokio::time::timeout(WRITE_MAX, stream.write_all(&line)).await?
}
