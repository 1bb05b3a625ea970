//! Which agent is asked, and what it is shown.

use std::{
    env, fmt, fs,
    path::{Path, PathBuf},
    sync::Arc,
    time::{SystemTime, UNIX_EPOCH},
};

use sdr_keys::{
    Holder, Identity, Papers,
    tls::{self, Gate},
};

use super::{Client, connect::Pass};
use crate::{Session, failure::Failure};

/// Where an agent of the system listens.
const SYSTEM_SOCKET: &str = "/run/sdr/agent.sock";
/// Where agents listen for other machines, when nobody says otherwise.
const REMOTE_PORT: u16 = 7601;

/// Where an agent is.
#[derive(Clone, Debug)]
pub(super) enum Address {
    /// On this machine.
    Socket(PathBuf),
    /// Elsewhere, over TLS with certificates at both ends.
    Remote {
        /// Name or IP address.
        host: String,
        /// TCP.
        port: u16,
        /// What it is shown.
        pass: Pass,
    },
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Socket(path) => write!(f, "{}", path.display()),
            Self::Remote { host, port, .. } if host.contains(':') => write!(f, "[{host}]:{port}"),
            Self::Remote { host, port, .. } => write!(f, "{host}:{port}"),
        }
    }
}

/// An address as it was given.
#[derive(Debug, PartialEq, Eq)]
enum Given {
    Socket(PathBuf),
    Remote(String, u16),
}

impl Client {
    /// The agent of `--agent` or `SDR_AGENT`, else of the system, else of this user.
    pub(crate) fn of(session: &Session) -> Result<Self, Failure> {
        if let Some(address) = &session.agent {
            return match parse(address)? {
                Given::Socket(path) => Ok(Self::at(path)),
                Given::Remote(host, port) => {
                    let pass = pass(session.keys.as_deref(), address)?;
                    Ok(Self::new(Address::Remote { host, port, pass }))
                }
            };
        }
        let user = env::var_os("XDG_RUNTIME_DIR").map(|dir| Path::new(&dir).join("sdr/agent.sock"));
        let system = PathBuf::from(SYSTEM_SOCKET);
        match user {
            Some(user) if !system.exists() && user.exists() => Ok(Self::at(user)),
            Some(_) | None => Ok(Self::at(system)),
        }
    }
}

/// A folder of this user's own files: below XDG_CONFIG_HOME, else ~/.config.
pub(crate) fn user_folder(name: &str) -> Option<PathBuf> {
    let xdg = env::var_os("XDG_CONFIG_HOME").map(PathBuf::from).filter(|path| path.is_absolute());
    let home = || env::var_os("HOME").map(|home| Path::new(&home).join(".config"));
    xdg.or_else(home).map(|folder| folder.join("sdr").join(name))
}

/// The operator's keys, from `--keys`, `SDR_KEYS` or the user's own folder.
fn pass(keys: Option<&Path>, address: &str) -> Result<Pass, Failure> {
    let own = || user_folder("keys").filter(|folder| folder.exists());
    let folder = keys.map(Path::to_owned).or_else(own).ok_or_else(|| {
        Failure::Usage(format!(
            "--agent {address} is on another machine and wants an operator's keys: --keys DIR or SDR_KEYS\n  They are made by:   sdr keys operator NAME --role view|operate"
        ))
    })?;
    let wall = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let identity = Identity::load(&folder, wall)?;
    match identity.holder() {
        Holder::Operator { .. } => {}
        Holder::Robot(name) => {
            return Err(Failure::Usage(format!(
                "--keys {}: these are the keys of robot {name}; an operator's are made by:   sdr keys operator NAME --role view|operate",
                folder.display()
            )));
        }
    }
    // What it says is checked by signature; without it nobody is denied at this end.
    let notices = fs::read_to_string(folder.join("notices")).unwrap_or_default();
    let denied = Papers::parse(&notices, identity.trust()).map(|papers| papers.denied().clone());
    let gate = Arc::new(Gate::new(identity.trust(), denied.unwrap_or_default()));
    let config = tls::client(&identity, gate, b"http/1.1", Arc::new(|_| {}));
    Ok(Pass { holder: identity.holder().clone(), config: Arc::new(config) })
}

/// A path, optionally behind `unix:`, or `HOST:PORT`, optionally behind `https://`.
fn parse(address: &str) -> Result<Given, Failure> {
    if address.is_empty() {
        return Err(Failure::Usage(format!(
            "--agent is empty; allowed: the path of a Unix socket, such as {SYSTEM_SOCKET}, or robot-2:{REMOTE_PORT}"
        )));
    }
    if let Some(path) = address.strip_prefix("unix:") {
        return Ok(Given::Socket(path.into()));
    }
    if address.starts_with("http://") {
        return Err(Failure::Usage(format!(
            "--agent {address}: agents speak TLS alone; allowed: https://HOST:PORT"
        )));
    }
    let secure = address.strip_prefix("https://").map(|rest| rest.trim_end_matches('/'));
    let text = secure.unwrap_or(address);
    if secure.is_none() && text.contains('/') {
        return Ok(Given::Socket(text.into()));
    }
    match (host_and_port(text), secure) {
        (Some((host, port)), _) => Ok(Given::Remote(host, port)),
        (None, Some(host)) if !host.is_empty() && !host.contains(['/', ':']) => {
            Ok(Given::Remote(host.into(), REMOTE_PORT))
        }
        (None, Some(_)) => Err(Failure::Usage(format!(
            "--agent {address}: no host and port; allowed: https://HOST:PORT, such as https://robot-2:{REMOTE_PORT}"
        ))),
        (None, None) => Ok(Given::Socket(text.into())),
    }
}

fn host_and_port(text: &str) -> Option<(String, u16)> {
    let (host, port) = text.rsplit_once(':')?;
    let host = host.strip_prefix('[').and_then(|host| host.strip_suffix(']')).unwrap_or(host);
    (!host.is_empty() && !host.contains('/')).then_some((host.into(), port.parse().ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hosts_and_ports_are_remote() {
        for (text, host, port) in [
            ("robot-2:7601", "robot-2", 7601),
            ("127.0.0.1:1", "127.0.0.1", 1),
            ("[::1]:7601", "::1", 7601),
            ("https://robot-2:7601", "robot-2", 7601),
            ("https://robot-2/", "robot-2", 7601),
        ] {
            assert_eq!(parse(text).unwrap(), Given::Remote(host.into(), port), "{text}");
        }
    }

    #[test]
    fn nonsense_is_wrong_usage_and_says_what_is_allowed() {
        for (text, allowed) in [
            ("", "Unix socket"),
            ("http://robot-2:7601", "https://HOST:PORT"),
            ("https://", "https://HOST:PORT"),
            ("https://robot-2:port", "https://HOST:PORT"),
        ] {
            match parse(text) {
                Err(Failure::Usage(said)) => assert!(said.contains(allowed), "{said}"),
                other => panic!("{text}: {other:?}"),
            }
        }
    }

    #[test]
    fn paths_are_taken_as_they_are() {
        for (text, path) in [
            ("/tmp/a.sock", "/tmp/a.sock"),
            ("unix:a.sock", "a.sock"),
            ("./a:1", "./a:1"),
            ("a.sock", "a.sock"),
        ] {
            assert_eq!(parse(text).unwrap(), Given::Socket(path.into()));
        }
    }
}
