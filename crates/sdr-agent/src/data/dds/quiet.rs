//! Samples go to those who want them, one by one.

use std::net::{Ipv4Addr, UdpSocket};

/// Ports of one domain (RTPS 2.3, section 9.6.1.1).
const DOMAIN_PORTS: u16 = 250;
/// Port for samples to all, of domain 0.
const SAMPLES_PORT: u16 = 7401;

/// Holds the port on which a participant would hear samples sent to all, while it is made: it then
/// announces none, and samples come to it alone.
///
/// A writer prefers to send to all when a reader allows it. By Wi-Fi that is the slowest rate and no
/// retry: pictures that way filled the air and were lost. Discovery has another port and stays as it
/// is. `None` when somebody else holds the port; then nothing is different from before.
pub(super) fn hold_multicast_port(domain_id: u16) -> Option<UdpSocket> {
    let port = domain_id.checked_mul(DOMAIN_PORTS)?.checked_add(SAMPLES_PORT)?;
    UdpSocket::bind((Ipv4Addr::UNSPECIFIED, port)).ok()
}
