//! Ports that nobody uses: UDP for the mesh, a DDS domain for the data.

use std::{io, net::UdpSocket};

/// DDS: port of a domain's first address (RTPS 2.3, section 9.6.1.1).
const DDS_BASE: u16 = 7400;
/// DDS: ports of one domain.
const DDS_DOMAIN_PORTS: u16 = 250;
/// Domains below the ports that Linux gives to clients.
const DOMAIN_MAX: u16 = 99;
/// Ports of a domain that its participants use: multicast, then two for each participant.
const DOMAIN_PORTS_CHECKED: u16 = 20;

/// As many free UDP ports on loopback as wanted. Somebody else may take one before it is used;
/// the agent then says so.
pub(super) fn free_udp_ports(count: usize) -> io::Result<Vec<u16>> {
    // Held together, so that none is given twice.
    let sockets: Vec<UdpSocket> =
        (0..count).map(|_| UdpSocket::bind(("127.0.0.1", 0))).collect::<io::Result<_>>()?;
    sockets.iter().map(|socket| Ok(socket.local_addr()?.port())).collect()
}

/// A DDS domain none of whose first ports is in use, searched from a place of this process's own.
pub(super) fn free_domain(seed: u32) -> Option<u16> {
    let start = u16::try_from(seed % u32::from(DOMAIN_MAX)).unwrap_or(0);
    let domains = (0..DOMAIN_MAX).map(|step| 1 + (start + step) % DOMAIN_MAX);
    domains.into_iter().find(|domain| is_free(*domain))
}

fn is_free(domain: u16) -> bool {
    let first = DDS_BASE + DDS_DOMAIN_PORTS * domain;
    (first..first + DOMAIN_PORTS_CHECKED).all(|port| UdpSocket::bind(("0.0.0.0", port)).is_ok())
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn ports_are_free_and_differ() {
        let ports = free_udp_ports(8).unwrap();
        assert_eq!(ports.iter().collect::<BTreeSet<_>>().len(), 8);
        assert!(ports.iter().all(|port| *port > 1023));
    }

    #[test]
    fn a_domain_in_use_is_passed_over() {
        let domain = free_domain(17).unwrap();
        let port = DDS_BASE + DDS_DOMAIN_PORTS * domain + 11;
        let _held = UdpSocket::bind(("0.0.0.0", port)).unwrap();

        assert!(!is_free(domain));
        assert_ne!(free_domain(u32::from(domain) - 1), Some(domain));
    }
}
