//! What the parts of a datagram say, and their bytes.

use alloc::{string::String, vec::Vec};
use core::net::SocketAddr;

use serde::{Deserialize, Serialize};

use super::{
    Reader, WireError,
    beat::{BEATS_MAX, Beat, PlacedBeat, decode_placed, encode_placed},
    record::{RecordRef, unknown_of},
};
use crate::{
    id::RobotId,
    mesh::{FleetRecord, Incarnation},
};

/// One part of a datagram.
#[derive(Clone, Debug, PartialEq)]
pub enum Section {
    /// Numbers this datagram on its pair's link, and answers the last one that came back.
    Link(LinkMark),
    /// Asks for any datagram back at once.
    Ping,
    /// Signs of life.
    Beats(Beats),
    /// What the sender holds in all.
    Summary(Summary),
    /// Both at once, for those who know the same robots.
    Pulse(Pulse),
    /// How far some authors are known, by name.
    Stamps(Vec<Stamp>),
    /// Asks for stamps of robots by id.
    AskStamps(AskStamps),
    /// Asks for records of authors: (id, all up to this sequence are known).
    AskRecords(Vec<(u32, u64)>),
    /// Records of one author.
    AuthorDelta(AuthorDelta),
    /// Asks for the freshest news of some robots.
    AskNews(AskNews),
    /// Answers [`Section::AskNews`].
    News(News),
    /// All robots that the sender knows in a range of ids.
    Roster(RosterPiece),
    /// Hashes below one node of the fleet table's tree.
    FleetNodes(FleetNodes),
    /// What the sender holds in part of the fleet table.
    FleetEntries(FleetEntries),
    /// Asks for records of the fleet table by key hash.
    FleetWanted(Vec<u32>),
    /// Records of the fleet table that the receiver asked for or was found to lack.
    FleetRecords(Vec<FleetRecord>),
    /// Records of the fleet table that are news: whoever did not know them sends them on.
    FleetNews(Vec<FleetRecord>),
    /// Where some robots can be reached.
    Peers(Vec<SocketAddr>),
}

/// A number per datagram of one direction of a pair, and an echo of the other direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LinkMark {
    /// Grows by one with each numbered datagram to this receiver.
    pub number: u16,
    /// Of the last datagram that came from the receiver.
    pub echo: Option<Echo>,
}

/// What became of the receiver's own datagrams.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Echo {
    /// The number of the last one that came.
    pub number: u16,
    /// How long ago it came, units of 100 us.
    pub held: u32,
    /// How many of the last ones were lost, 255ths.
    pub loss: u8,
}

/// Signs of life of several robots.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Beats {
    /// Ids have three bytes instead of two.
    pub wide: bool,
    /// One for each robot.
    pub beats: Vec<Beat>,
}

/// Two robots with equal summaries hold the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Summary {
    /// Hash over the fleet table.
    pub fleet: u32,
    /// Hash over the robots known, with their incarnations.
    pub roster: u32,
}

/// A summary, and signs of life by place among all names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pulse {
    /// What the sender holds in all.
    pub summary: Summary,
    /// Hash over the names of the robots known; who has another cannot read the beats.
    pub names: u32,
    /// By growing place.
    pub beats: Vec<PlacedBeat>,
}

/// How far the sender's knowledge of one author goes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Stamp {
    /// The author.
    pub robot: RobotId,
    /// Its incarnation.
    pub incarnation: Incarnation,
    /// Its last heartbeat: milliseconds of its own clock since its start.
    pub heartbeat: u64,
    /// All its records up to this number are known.
    pub sequence: u64,
    /// How long ago it said that heartbeat, milliseconds.
    pub age_ms: u64,
    /// Where it was heard.
    pub address: Option<SocketAddr>,
}

/// Ids as they stood in beats.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct AskStamps {
    /// Ids have three bytes instead of two.
    pub wide: bool,
    /// Upper bits; the lower ones are zero.
    pub ids: Vec<u32>,
}

/// Records of one author, by growing sequence.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct AuthorDelta {
    /// The author.
    pub robot: RobotId,
    /// Its incarnation.
    pub incarnation: Incarnation,
    /// Records up to this number are taken for granted.
    pub since: u64,
    /// How far this brings a receiver that knows all up to `since`.
    pub sequence: u64,
    /// (sequence, key, value); an empty value takes the record back.
    pub records: Vec<(u64, String, Vec<u8>)>,
}

/// A question for news of robots.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct AskNews {
    /// Returns in the answer.
    pub number: u16,
    /// At most four.
    pub robots: Vec<RobotId>,
}

/// The freshest news of the robots asked for, as far as they are known.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct News {
    /// Which question.
    pub number: u16,
    /// At most one for each robot.
    pub stamps: Vec<Stamp>,
}

/// All ids that the sender knows in `low..=high`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RosterPiece {
    /// Least id covered.
    pub low: u32,
    /// Greatest id covered.
    pub high: u32,
    /// The ids.
    pub ids: Vec<u32>,
}

/// One node of the tree over the fleet table, by the upper nibbles of the key hash.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FleetNodes {
    /// Nibbles that all keys below have in common, 0 for the root, at most 2.
    pub depth: u8,
    /// Those nibbles.
    pub prefix: u16,
    /// One hash for each next nibble.
    pub children: Vec<u32>,
}

/// All records that the sender holds with a key hash in `low..=high`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FleetEntries {
    /// Least key hash covered.
    pub low: u32,
    /// Greatest key hash covered.
    pub high: u32,
    /// (key hash, version hash), by key hash.
    pub entries: Vec<(u32, u32)>,
}

const TAG_LINK: u8 = 1;
const TAG_PING: u8 = 2;
const TAG_BEATS: u8 = 3;
const TAG_BEATS_WIDE: u8 = 4;
const TAG_SUMMARY: u8 = 5;
const TAG_STAMPS: u8 = 6;
const TAG_ASK_STAMPS: u8 = 7;
const TAG_ASK_RECORDS: u8 = 8;
const TAG_AUTHOR_DELTA: u8 = 9;
const TAG_ASK_NEWS: u8 = 10;
const TAG_NEWS: u8 = 11;
const TAG_ROSTER: u8 = 12;
const TAG_FLEET_NODES: u8 = 13;
const TAG_FLEET_ENTRIES: u8 = 14;
const TAG_FLEET_WANTED: u8 = 15;
const TAG_FLEET_RECORDS: u8 = 16;
const TAG_PEERS: u8 = 17;
pub(in crate::mesh) const TAG_FLEET_NEWS: u8 = 18;
const TAG_PULSE: u8 = 19;

/// What the sections are called, by tag; 0 stands for headers.
pub const SECTION_NAMES: [&str; 20] = [
    "header",
    "link",
    "ping",
    "beats",
    "beats-wide",
    "summary",
    "stamps",
    "ask-stamps",
    "ask-records",
    "author-delta",
    "ask-news",
    "news",
    "roster",
    "fleet-nodes",
    "fleet-entries",
    "fleet-wanted",
    "fleet-records",
    "peers",
    "fleet-news",
    "pulse",
];

impl Section {
    /// The tag and the body.
    pub(in crate::mesh) fn encode(&self) -> (u8, Vec<u8>) {
        fn plain<T: Serialize>(value: &T) -> Vec<u8> {
            postcard::to_allocvec(value).expect("writing plain data to memory cannot fail")
        }
        match self {
            Self::Link(mark) => (TAG_LINK, mark.encode()),
            Self::Ping => (TAG_PING, Vec::new()),
            Self::Beats(beats) => {
                let tag = if beats.wide { TAG_BEATS_WIDE } else { TAG_BEATS };
                let mut body = Vec::with_capacity(beats.beats.len() * 6);
                beats.beats.iter().for_each(|beat| beat.encode(beats.wide, &mut body));
                (tag, body)
            }
            Self::Summary(summary) => (TAG_SUMMARY, summary.encode()),
            Self::Pulse(pulse) => {
                let mut body = pulse.summary.encode();
                body.extend_from_slice(&pulse.names.to_le_bytes());
                encode_placed(&pulse.beats, &mut body);
                (TAG_PULSE, body)
            }
            Self::Stamps(stamps) => (TAG_STAMPS, plain(stamps)),
            Self::AskStamps(ask) => (TAG_ASK_STAMPS, plain(ask)),
            Self::AskRecords(asks) => (TAG_ASK_RECORDS, plain(asks)),
            Self::AuthorDelta(delta) => (TAG_AUTHOR_DELTA, plain(delta)),
            Self::AskNews(ask) => (TAG_ASK_NEWS, plain(ask)),
            Self::News(news) => (TAG_NEWS, plain(news)),
            Self::Roster(piece) => {
                let mut body = piece.low.to_le_bytes().to_vec();
                body.extend_from_slice(&piece.high.to_le_bytes());
                piece.ids.iter().for_each(|id| body.extend_from_slice(&id.to_le_bytes()));
                (TAG_ROSTER, body)
            }
            Self::FleetNodes(nodes) => (TAG_FLEET_NODES, plain(nodes)),
            Self::FleetEntries(entries) => (TAG_FLEET_ENTRIES, plain(entries)),
            Self::FleetWanted(keys) => (TAG_FLEET_WANTED, plain(keys)),
            Self::FleetRecords(records) => (TAG_FLEET_RECORDS, plain(records)),
            Self::FleetNews(records) => (TAG_FLEET_NEWS, plain(records)),
            Self::Peers(addresses) => (TAG_PEERS, plain(addresses)),
        }
    }

    /// The section behind `tag`; `None` for a tag of a later version. Bytes behind the known
    /// fields are a later version's and are skipped; so are records of facts that are `known`.
    pub(super) fn decode(
        tag: u8,
        body: &[u8],
        known: &dyn Fn(&RecordRef<'_>) -> bool,
    ) -> Result<Option<Self>, WireError> {
        fn plain<'a, T: Deserialize<'a>>(tag: u8, body: &'a [u8]) -> Result<T, WireError> {
            let taken = postcard::take_from_bytes(body).map_err(|_| WireError::Body(tag));
            taken.map(|(value, _later_fields)| value)
        }
        let mut reader = Reader { bytes: body, at: 0 };
        let section = match tag {
            TAG_LINK => Self::Link(LinkMark::decode(&mut reader)?),
            TAG_PING => Self::Ping,
            TAG_BEATS | TAG_BEATS_WIDE => {
                let wide = tag == TAG_BEATS_WIDE;
                let mut beats = Vec::new();
                while reader.at < body.len() && beats.len() < BEATS_MAX {
                    beats.push(Beat::decode(wide, &mut reader)?);
                }
                Self::Beats(Beats { wide, beats })
            }
            TAG_SUMMARY => Self::Summary(Summary::decode(&mut reader)?),
            TAG_PULSE => Self::Pulse(Pulse {
                summary: Summary::decode(&mut reader)?,
                names: u32::from_le_bytes(reader.array()?),
                beats: decode_placed(tag, &mut reader)?,
            }),
            TAG_STAMPS => Self::Stamps(plain(tag, body)?),
            TAG_ASK_STAMPS => Self::AskStamps(plain(tag, body)?),
            TAG_ASK_RECORDS => Self::AskRecords(plain(tag, body)?),
            TAG_AUTHOR_DELTA => Self::AuthorDelta(plain(tag, body)?),
            TAG_ASK_NEWS => Self::AskNews(plain(tag, body)?),
            TAG_NEWS => Self::News(plain(tag, body)?),
            TAG_ROSTER => Self::Roster(RosterPiece::decode(&mut reader)?),
            TAG_FLEET_NODES => Self::FleetNodes(plain(tag, body)?),
            TAG_FLEET_ENTRIES => Self::FleetEntries(plain(tag, body)?),
            TAG_FLEET_WANTED => Self::FleetWanted(plain(tag, body)?),
            TAG_FLEET_RECORDS => Self::FleetRecords(unknown_of(tag, body, known)?),
            TAG_FLEET_NEWS => Self::FleetNews(unknown_of(tag, body, known)?),
            TAG_PEERS => Self::Peers(plain(tag, body)?),
            _ => return Ok(None),
        };
        Ok(Some(section))
    }
}

impl Summary {
    fn encode(self) -> Vec<u8> {
        let mut body = self.fleet.to_le_bytes().to_vec();
        body.extend_from_slice(&self.roster.to_le_bytes());
        body
    }

    fn decode(reader: &mut Reader<'_>) -> Result<Self, WireError> {
        let fleet = u32::from_le_bytes(reader.array()?);
        Ok(Self { fleet, roster: u32::from_le_bytes(reader.array()?) })
    }
}

impl LinkMark {
    fn encode(self) -> Vec<u8> {
        let mut body = self.number.to_le_bytes().to_vec();
        if let Some(echo) = self.echo {
            body.extend_from_slice(&echo.number.to_le_bytes());
            body.push(echo.loss);
            super::put_varint(u64::from(echo.held), &mut body);
        }
        body
    }

    fn decode(reader: &mut Reader<'_>) -> Result<Self, WireError> {
        let number = u16::from_le_bytes(reader.array()?);
        if reader.at == reader.bytes.len() {
            return Ok(Self { number, echo: None });
        }
        let echo = Echo {
            number: u16::from_le_bytes(reader.array()?),
            loss: reader.byte()?,
            held: u32::try_from(reader.varint()?).unwrap_or(u32::MAX),
        };
        Ok(Self { number, echo: Some(echo) })
    }
}

impl RosterPiece {
    fn decode(reader: &mut Reader<'_>) -> Result<Self, WireError> {
        let low = u32::from_le_bytes(reader.array()?);
        let high = u32::from_le_bytes(reader.array()?);
        let mut ids = Vec::new();
        while reader.at < reader.bytes.len() {
            ids.push(u32::from_le_bytes(reader.array()?));
        }
        Ok(Self { low, high, ids })
    }
}
