//! Robots that know nobody's address find each other on the local network.
//!
//! The brain has one more seed: a multicast group that the fleet's name gives. What it sends
//! there is an ordinary datagram, sealed as all are, from the mesh's own port; who hears it
//! challenges and answers that port. So discovery lets nobody in who has no key.

use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::net::{Ipv4Addr, SocketAddr, SocketAddrV4};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use rustix::net::{AddressFamily, SocketFlags, SocketType, bind, socket_with, sockopt};
use sdr_core::order::hash64;
use sdr_files::robot::Interfaces;
use tokio::net::UdpSocket;

/// The port of all groups; the mesh's own is usually one more.
const PORT: u16 = 7599;
/// How often interfaces are looked for: a radio may come up late.
const LOOK_PERIOD: Duration = Duration::from_secs(5);
const FLAG_UP: u32 = 0x1;
const FLAG_LOOPBACK: u32 = 0x8;

/// The group of a fleet, and the interfaces it is spoken on; cheap to clone.
#[derive(Clone, Debug)]
pub(crate) struct Discovery {
    group: SocketAddrV4,
    wanted: Interfaces,
    /// Interfaces that are there now, by number.
    present: Arc<Mutex<BTreeSet<u32>>>,
}

impl Discovery {
    /// Of this fleet; nothing is joined yet.
    pub(crate) fn new(fleet: &str, wanted: Interfaces) -> Self {
        let [.., high, low] = hash64(fleet.as_bytes()).to_be_bytes();
        // 239.0.0.0/8 stays within the site (RFC 2365).
        let group = SocketAddrV4::new(Ipv4Addr::new(239, 83, high, low), PORT);
        Self { group, wanted, present: Arc::default() }
    }

    /// What the brain takes for one more seed.
    pub(crate) fn seed(&self) -> SocketAddr {
        SocketAddr::V4(self.group)
    }

    /// Whether a datagram to `to` is for everybody.
    pub(crate) fn is_group(&self, to: SocketAddr) -> bool {
        to == self.seed()
    }

    /// A socket that hears the group; agents of one machine may share it. Joins interfaces as
    /// they come. Call within a `LocalSet`.
    pub(crate) fn listen(&self) -> io::Result<Arc<UdpSocket>> {
        let flags = SocketFlags::CLOEXEC | SocketFlags::NONBLOCK;
        let socket = socket_with(AddressFamily::INET, SocketType::DGRAM, flags, None)?;
        sockopt::set_socket_reuseaddr(&socket, true)?;
        bind(&socket, &self.group)?;
        let socket = Arc::new(UdpSocket::from_std(socket.into())?);
        self.join_present(&socket);
        let (own, joining) = (self.clone(), socket.clone());
        tokio::task::spawn_local(async move {
            loop {
                tokio::time::sleep(LOOK_PERIOD).await;
                own.join_present(&joining);
            }
        });
        Ok(socket)
    }

    /// Sends through `socket` on every interface.
    pub(crate) fn send(&self, socket: &UdpSocket, bytes: &[u8]) {
        let present = self.present.lock().unwrap_or_else(PoisonError::into_inner).clone();
        for index in present {
            let (group, any) = (self.group.ip(), Ipv4Addr::UNSPECIFIED);
            let sent = sockopt::set_ip_multicast_if_with_ifindex(socket, group, &any, index)
                .map_err(io::Error::from)
                .and_then(|()| socket.try_send_to(bytes, self.seed()));
            if let Err(error) = sent {
                tracing::debug!(event = "group-not-reached", index, %error);
            }
        }
    }

    /// Joins interfaces that came; those that went leave by themselves.
    fn join_present(&self, socket: &UdpSocket) {
        let found: BTreeSet<u32> = interfaces(&self.wanted).collect();
        let mut present = self.present.lock().unwrap_or_else(PoisonError::into_inner);
        for index in found.difference(&present) {
            let (group, any) = (self.group.ip(), Ipv4Addr::UNSPECIFIED);
            match sockopt::set_ip_add_membership_with_ifindex(socket, group, &any, *index) {
                // It came back under its old number.
                Ok(()) | Err(rustix::io::Errno::ADDRINUSE) => {}
                Err(error) => tracing::warn!(event = "group-not-joined", index, %error),
            }
        }
        *present = found;
    }
}

/// Numbers of the interfaces wanted that are up.
fn interfaces(wanted: &Interfaces) -> impl Iterator<Item = u32> {
    let entries = fs::read_dir("/sys/class/net").into_iter().flatten().flatten();
    entries.filter_map(move |entry| {
        let name = entry.file_name().into_string().ok()?;
        let word = |file: &str| fs::read_to_string(entry.path().join(file)).ok();
        let flags = word("flags")?;
        let flags = u32::from_str_radix(flags.trim().strip_prefix("0x")?, 16).ok()?;
        let chosen = match wanted {
            Interfaces::Usual => flags & FLAG_LOOPBACK == 0 && !name.starts_with("docker"),
            Interfaces::Named(names) => names.contains(&name),
        };
        (chosen && flags & FLAG_UP != 0).then_some(())?;
        word("ifindex")?.trim().parse().ok()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fleets_have_groups_of_their_own_within_the_site() {
        let group = |fleet: &str| Discovery::new(fleet, Interfaces::Usual).seed();
        assert_ne!(group("moon"), group("mars"));
        assert_eq!(group("moon"), group("moon"));
        assert!(group("moon").to_string().starts_with("239.83."));
    }

    #[test]
    fn loopback_is_joined_only_when_it_is_named() {
        let lo: u32 =
            fs::read_to_string("/sys/class/net/lo/ifindex").unwrap().trim().parse().unwrap();
        assert!(interfaces(&Interfaces::Named(vec!["lo".into()])).any(|index| index == lo));
        assert!(interfaces(&Interfaces::Usual).all(|index| index != lo));
    }
}
