//! `[mesh]` and the addresses of robot.toml: sealed with keys, or plain and said so.

use std::{net::SocketAddr, time::Duration};

use schemars::{Schema, SchemaGenerator, json_schema};

use super::{
    config::{Interfaces, MeshConfig, Seal},
    file::MeshTable,
    places::Places,
};
use crate::{
    problem::Mark,
    read::{At, Read, Reader, address},
    tree::{Body, Node},
};

/// The mesh's UDP port when none is given.
const MESH_PORT: u16 = 7600;
/// The API's TCP port when none is given.
const API_PORT: u16 = 7601;
/// Most interfaces on which others are looked for.
const INTERFACES_MAX: usize = 8;
/// Round what a key that was just learnt waits before it seals.
const KEY_GRACE: Duration = Duration::from_secs(20);

/// Whether datagrams may be plain, and where.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Unsealed {
    /// Nowhere.
    No,
    /// On loopback.
    Loopback,
    /// On any network: whoever reaches the robot can command it.
    Anywhere,
}

impl Read for Unsealed {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        match &node.body {
            Body::Bool(false) => Some(Self::No),
            Body::Bool(true) => Some(Self::Loopback),
            Body::Text(word) if word == "anywhere" => Some(Self::Anywhere),
            Body::Nothing
            | Body::Int(_)
            | Body::Float(_)
            | Body::Text(_)
            | Body::List(_)
            | Body::Table(_) => {
                reader.wrong(node, "true (on loopback), false, \"anywhere\"");
                None
            }
        }
    }

    fn schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "enum": [true, false, "anywhere"] })
    }
}

pub(super) fn mesh(
    table: At<MeshTable>,
    places: &Places,
    reader: &mut Reader,
) -> Option<MeshConfig> {
    let At { value: table, mark } = table;
    let (seal, reach) = seal(&table, mark, places, reader)?;
    let default = match reach {
        Reach::Any => [0, 0, 0, 0],
        Reach::Loopback => [127, 0, 0, 1],
    };
    let listen = match table.listen {
        Some(listen) => within_reach(&listen, reach, reader),
        None => Some(SocketAddr::from((default, MESH_PORT))),
    };
    let seeds = table.seeds.map(|seeds| seeds.value).unwrap_or_default();
    let told = !seeds.is_empty() || seal == Seal::Plain;
    let seeds = seeds.iter().filter_map(|seed| within_reach(seed, reach, reader)).collect();
    let mut within = |given: Option<At<Duration>>, default, range| {
        given.map_or(default, |at| bounded(&at, range, reader))
    };
    let gossip_period = within(table.gossip_period, Duration::from_millis(350), (20, 10_000));
    let gone_mark = table.gone_after.as_ref().map(|at| at.mark);
    let gone_after = within(table.gone_after, Duration::from_millis(11_500), (100, 600_000));
    let rejoin_wait = within(table.rejoin_wait, Duration::from_secs(2), (0, 60_000));
    let key_grace = within(table.key_grace, KEY_GRACE, (500, 3_600_000));
    if gone_after < gossip_period * 3 {
        let message = format!("gone_after {gone_after:?} is less than 3 rounds of gossip");
        let help = format!("allowed: {:?} or more", gossip_period * 3);
        reader.problem(gone_mark.unwrap_or(Mark::FILE), message, Some(help));
    }
    let listen = listen?;
    let discovery = discovery(table.discovery, table.interfaces, listen, told, reader);
    Some(MeshConfig {
        fleet: table.fleet.map(|fleet| fleet.value.to_string()),
        seal,
        listen,
        seeds,
        discovery,
        gossip_period,
        gone_after,
        rejoin_wait,
        key_grace,
    })
}

/// Where others are looked for. Datagrams go to a group of IPv4's. Whoever was `told` of seeds,
/// or speaks in the open, looks for nobody unless asked to.
fn discovery(
    wanted: Option<bool>,
    interfaces: Option<At<Vec<At<String>>>>,
    listen: SocketAddr,
    told: bool,
    reader: &mut Reader,
) -> Option<Interfaces> {
    let usual = !told && !listen.ip().is_loopback() && listen.is_ipv4();
    if !wanted.unwrap_or(usual || interfaces.is_some()) {
        return None;
    }
    if !listen.is_ipv4() {
        let mark = interfaces.map_or(Mark::FILE, |at| at.mark);
        let message = format!("others are looked for by IPv4 multicast, and `listen` is {listen}");
        let help = String::from("allowed: an IPv4 address behind `listen`, or `discovery = false`");
        reader.problem(mark, message, Some(help));
        return None;
    }
    let Some(At { value: names, mark }) = interfaces else {
        // On loopback there is one to look on.
        return Some(match listen.ip().is_loopback() {
            true => Interfaces::Named(vec!["lo".into()]),
            false => Interfaces::Usual,
        });
    };
    if names.is_empty() || names.len() > INTERFACES_MAX {
        let message = format!("{} interfaces", names.len());
        reader.problem(mark, message, Some(format!("allowed: 1 to {INTERFACES_MAX}")));
    }
    for At { value: name, mark } in &names {
        let plain = |c: char| c.is_ascii_graphic() && c != '/';
        if name.is_empty() || name.len() > 15 || !name.chars().all(plain) {
            let message = format!("`{name}` is no name of an interface");
            let help = String::from("allowed: such as wlan0, at most 15 characters");
            reader.problem(*mark, message, Some(help));
        }
    }
    Some(Interfaces::Named(names.into_iter().map(|at| at.value).collect()))
}

/// Where operators of other machines reach the API; they need certificates.
pub(super) fn api_listen(
    listen: Option<At<String>>,
    mesh: Option<&MeshConfig>,
    reader: &mut Reader,
) -> Option<SocketAddr> {
    let listen = listen?;
    let found = address(&listen.value, API_PORT);
    if found.is_none() {
        let message = format!("`{}` is no IP address with port", listen.value);
        let help = String::from("allowed: such as 0.0.0.0:7601 or [::]:7601");
        reader.problem(listen.mark, message, Some(help));
    }
    if mesh.is_some_and(|mesh| mesh.seal == Seal::Plain) {
        let message = "operators of other machines are known by certificates, and there are none";
        let help = String::from("give [mesh] `keys`, or take `listen` out");
        reader.problem(listen.mark, message, Some(help));
    }
    found
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Reach {
    Loopback,
    Any,
}

/// Whether datagrams are sealed, and how far they may go.
fn seal(
    table: &MeshTable,
    mark: Mark,
    places: &Places,
    reader: &mut Reader,
) -> Option<(Seal, Reach)> {
    let unsealed = table.unsealed.as_ref().map_or(Unsealed::No, |at| at.value);
    match (&table.keys, unsealed) {
        (Some(keys), Unsealed::No) => Some((Seal::Keys(places.resolve(&keys.value)), Reach::Any)),
        (Some(keys), Unsealed::Loopback | Unsealed::Anywhere) => {
            let message = "`keys` seal the mesh and `unsealed` asks that it be plain";
            reader.problem(keys.mark, message, Some("take one of them out".into()));
            None
        }
        (None, Unsealed::Loopback) => Some((Seal::Plain, Reach::Loopback)),
        (None, Unsealed::Anywhere) => Some((Seal::Plain, Reach::Any)),
        // The word behind `unsealed` was told before.
        (None, Unsealed::No) if !reader.is_clean() => None,
        (None, Unsealed::No) => {
            let help = "allowed: `keys = \"/etc/sdr/keys\"` (made by `sdr keys add`), or `unsealed = true`, on loopback only";
            reader.problem(mark, "the mesh has no keys", Some(help.into()));
            None
        }
    }
}

/// An address; on loopback, when plain datagrams go no further.
fn within_reach(at: &At<String>, reach: Reach, reader: &mut Reader) -> Option<SocketAddr> {
    let Some(address) = address(&at.value, MESH_PORT) else {
        let message = format!("`{}` is no IP address with port", at.value);
        let help = String::from("allowed: such as 127.0.0.1:7600 or [::1]:7600");
        reader.problem(at.mark, message, Some(help));
        return None;
    };
    if reach == Reach::Loopback && !address.ip().is_loopback() {
        let message = format!("`{}` is not loopback, and this mesh is not sealed", at.value);
        let help = "allowed: 127.0.0.0/8 and ::1; or give it `keys`; or `unsealed = \"anywhere\"`, where whoever reaches this robot commands it";
        reader.problem(at.mark, message, Some(help.into()));
        return None;
    }
    Some(address)
}

/// A time within `range`, in milliseconds, both ends allowed.
pub(super) fn bounded(at: &At<Duration>, range: (u64, u64), reader: &mut Reader) -> Duration {
    let (least, most) = (Duration::from_millis(range.0), Duration::from_millis(range.1));
    if at.value < least || at.value > most {
        let message = format!("{:?} is out of range", at.value);
        reader.problem(at.mark, message, Some(format!("allowed: {least:?} to {most:?}")));
    }
    at.value
}
