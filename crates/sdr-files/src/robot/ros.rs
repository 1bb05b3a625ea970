//! How samples cross: the DDS domain and the addresses it uses.

use std::net::Ipv4Addr;

use super::{config::RosConfig, file::RosTable};
use crate::read::{At, Reader};

/// Highest DDS domain whose ports are below 65536.
const DOMAIN_MAX: u16 = 232;

pub(super) fn ros(table: RosTable, reader: &mut Reader) -> RosConfig {
    let domain_id = table.domain_id.map_or(0, |domain| domain_id(&domain, reader));
    let addresses = table.addresses.map_or_else(Vec::new, |addresses| {
        if addresses.value.is_empty() {
            let help = String::from("allowed: one address or more; without the key, all");
            reader.problem(addresses.mark, "samples cross by no address", Some(help));
        }
        addresses.value.iter().filter_map(|text| address(text, reader)).collect()
    });
    RosConfig { domain_id, addresses }
}

fn domain_id(domain: &At<u16>, reader: &mut Reader) -> u16 {
    if domain.value > DOMAIN_MAX {
        let message = format!("DDS has no domain {}", domain.value);
        reader.problem(domain.mark, message, Some(format!("allowed: 0 to {DOMAIN_MAX}")));
    }
    domain.value
}

fn address(text: &At<String>, reader: &mut Reader) -> Option<Ipv4Addr> {
    let found = text.value.parse().ok();
    if found.is_none() {
        let message = format!("`{}` is no IPv4 address", text.value);
        let help = String::from("allowed: addresses of this robot, such as 192.168.1.7");
        reader.problem(text.mark, message, Some(help));
    }
    found
}
