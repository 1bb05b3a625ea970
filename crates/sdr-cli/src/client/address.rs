//! Which agent is asked.

use std::{
    env,
    path::{Path, PathBuf},
};

use super::Client;
use crate::{Session, failure::Failure};

/// Where an agent of the system listens.
const SYSTEM_SOCKET: &str = "/run/sdr/agent.sock";

impl Client {
    /// The agent of `--agent` or `SDR_AGENT`, else of the system, else of this user.
    pub(crate) fn of(session: &Session) -> Result<Self, Failure> {
        if let Some(address) = &session.agent {
            return Ok(Self::at(parse(address)?));
        }
        let user = env::var_os("XDG_RUNTIME_DIR").map(|dir| Path::new(&dir).join("sdr/agent.sock"));
        let system = PathBuf::from(SYSTEM_SOCKET);
        match user {
            Some(user) if !system.exists() && user.exists() => Ok(Self::at(user)),
            Some(_) | None => Ok(Self::at(system)),
        }
    }
}

/// A path, optionally behind `unix:`; hosts and ports are refused.
fn parse(address: &str) -> Result<PathBuf, Failure> {
    let path = address.strip_prefix("unix:").unwrap_or(address);
    if path.is_empty() {
        return Err(Failure::Usage(
            "--agent is empty; give the path of an agent's Unix socket".into(),
        ));
    }
    let port = path.rsplit_once(':').is_some_and(|(_, port)| port.parse::<u16>().is_ok());
    if !path.contains('/') && port {
        return Err(Failure::Usage(format!(
            "--agent {address}: agents are not reachable over the network in this version; give the path of a Unix socket on this machine, such as {SYSTEM_SOCKET}"
        )));
    }
    Ok(path.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_host_and_port_is_wrong_usage_and_says_what_is_allowed() {
        for address in ["robot-2:7601", "127.0.0.1:7601", "[::1]:7601"] {
            match parse(address) {
                Err(Failure::Usage(text)) => assert!(text.contains("Unix socket"), "{text}"),
                other => panic!("{address}: {other:?}"),
            }
        }
        assert!(matches!(parse(""), Err(Failure::Usage(_))));
    }

    #[test]
    fn paths_are_taken_as_they_are() {
        assert_eq!(parse("/tmp/a.sock").unwrap(), Path::new("/tmp/a.sock"));
        assert_eq!(parse("unix:/tmp/a.sock").unwrap(), Path::new("/tmp/a.sock"));
        assert_eq!(parse("./a:1").unwrap(), Path::new("./a:1"));
    }
}
