//! What is said only because something differs: records that are lacking, unknown robots,
//! branches of the fleet table.

use alloc::{collections::BTreeMap, vec, vec::Vec};
use core::{net::SocketAddr, time::Duration};

use super::{
    ANSWERS_MAX, AskNews, AskStamps, FleetEntries, FleetNodes, FleetRecord, Mesh, RosterPiece,
    Section, Summary,
    author_table::Seat,
    fleet_tree::{DEPTH_MAX, range_of},
    inquiry::SUBJECTS_MAX,
    spread::sections_of,
    wire::SECTION_BYTES_MAX,
};
use crate::{
    planted::{self, Defect},
    time::Instant,
};

/// A lacking report is asked for after so many rounds: until then it may come by itself.
const WANT_ROUNDS: u32 = 3;
/// Authors asked for in one datagram.
const ASKS_MAX: usize = 40;
/// Times that a lacking report is asked for before a new sign of it is awaited.
const ASK_TRIES_MAX: u8 = 8;
/// Unknown ids are asked for at most so often.
const STAMPS_PERIOD: Duration = Duration::from_millis(300);
/// Ids asked for at once.
const STAMPS_ASKED_MAX: usize = 64;
/// Ids in one piece of the roster.
const ROSTER_IDS_MAX: usize = 250;
/// Rosters are compared at most so often.
const ROSTER_PERIOD: Duration = Duration::from_secs(2);
/// Rosters differ in so many datagrams before they are compared: news may be under way.
const ROSTER_DOUBTS: u8 = 3;
/// Stamps in answer to one datagram.
const STAMPS_TOLD_MAX: usize = 250;
/// Fleet tables are compared only when this one did not change for so long.
const CALM: Duration = Duration::from_millis(1200);
/// While one change follows the other, they are compared so often all the same: what is lacking
/// may be the very thing that ends the changes.
const RESTLESS: Duration = Duration::from_secs(3);
/// A comparison goes on so long after the last records came.
const PACE: Duration = Duration::from_millis(100);
/// A comparison that does not go on for so long is given up.
const STALLED: Duration = Duration::from_millis(400);
/// Entries in one piece of the fleet table, 10 bytes each at most.
const PIECE_ENTRIES_MAX: usize = 100;
/// A branch with at most so many records is told entry by entry.
const BRANCH_ENTRIES_MAX: usize = 64;
/// Pieces and nodes in one answer.
const PIECES_MAX: usize = 4;
/// Records asked for at once, so that an answer brings all of them.
const WANTED_MAX: usize = 60;
/// Repaired facts are sent on as news when they are at most so many.
const SENT_ON_MAX: usize = 8;

#[derive(Clone, Copy, Debug)]
struct Want {
    since: Instant,
    tries: u8,
}

/// A comparison of fleet tables with one robot.
#[derive(Clone, Copy, Debug)]
struct Session {
    with: SocketAddr,
    their_root: u32,
    /// Records came since the roots were compared last.
    moved: bool,
    moved_at: Instant,
}

/// What is known to be lacking.
#[derive(Clone, Debug, Default)]
pub(super) struct Repair {
    wants: BTreeMap<Seat, Want>,
    stamps_at: Option<Instant>,
    names_at: Option<Instant>,
    corrected_at: Option<Instant>,
    roster_at: Option<Instant>,
    roster_doubts: u8,
    /// The last who spoke knows the same robots by name.
    names_agreed: bool,
    session: Option<Session>,
    unfinished: bool,
    changed_at: Option<Instant>,
    /// Since when changes come without a calm between them, or the last comparison since.
    restless_since: Option<Instant>,
}

impl Repair {
    /// Somebody holds records of this author that are lacking here.
    pub(super) fn want(&mut self, seat: Seat, now: Instant) {
        if seat != Seat::OWN {
            self.wants.entry(seat).or_insert(Want { since: now, tries: 0 });
        }
    }

    /// Records of this author came; what is still lacking will be seen again. Whether they
    /// had been asked for.
    pub(super) fn unwant(&mut self, seat: Seat) -> bool {
        self.wants.remove(&seat).is_some_and(|want| want.tries > 0)
    }

    /// The fleet table has news.
    pub(super) fn note_change(&mut self, now: Instant) {
        if self.is_calm(now) {
            self.restless_since = Some(now);
        }
        self.changed_at = Some(now);
    }

    fn is_calm(&self, now: Instant) -> bool {
        self.changed_at.is_none_or(|at| now.since(at) >= CALM)
    }

    /// Whether others know the same robots by name, as far as can be told.
    pub(super) fn names_agree(&self) -> bool {
        self.names_agreed
    }

    pub(super) fn note_names(&mut self, agree: bool) {
        self.names_agreed = agree;
    }

    pub(super) fn may_correct(&mut self, now: Instant) -> bool {
        let may = self.corrected_at.is_none_or(|at| now.since(at) >= Duration::from_millis(100));
        if may {
            self.corrected_at = Some(now);
        }
        may
    }

    pub(super) fn next_deadline(&self) -> Option<Instant> {
        let session = self.session.filter(|session| session.moved);
        session.map(|session| session.moved_at + PACE)
    }

    pub(super) fn tidy(&mut self, now: Instant) {
        self.wants.retain(|_, want| want.tries < ASK_TRIES_MAX);
        if self.session.is_some_and(|session| now.since(session.moved_at) >= STALLED) {
            self.session = None;
            self.unfinished = true;
        }
    }
}

impl Mesh {
    /// Asks for records that are lacking, on the datagram of a round.
    pub(super) fn next_asks(&mut self) -> Option<Section> {
        let rounds = if self.liveness.living_count() < 8 { 1 } else { WANT_ROUNDS };
        let patience = self.config.period * rounds;
        let now = self.clock;
        let due =
            self.repair.wants.iter_mut().filter(|(_, want)| now.since(want.since) >= patience);
        let asks: Vec<(u32, u64)> = due
            .take(ASKS_MAX)
            .map(|(seat, want)| {
                want.tries += 1;
                let author = self.authors.at(*seat);
                (author.id, author.sequence())
            })
            .collect();
        (!asks.is_empty()).then_some(Section::AskRecords(asks))
    }

    pub(super) fn answer_records(&self, asks: &[(u32, u64)], answer: &mut Vec<Section>) {
        for (id, since) in asks.iter().take(ASKS_MAX) {
            let author = self.authors.by_id(*id).map(|seat| self.authors.at(seat));
            let delta = author.and_then(|author| author.delta(*since, SECTION_BYTES_MAX));
            answer.extend(delta.map(Section::AuthorDelta));
        }
    }

    /// Asks who is behind ids that say nothing here.
    pub(super) fn ask_stamps(&mut self, from: SocketAddr, wide: bool, ids: Vec<u32>) {
        let may = self.repair.stamps_at.is_none_or(|at| self.clock.since(at) >= STAMPS_PERIOD);
        if may {
            self.repair.stamps_at = Some(self.clock);
            let ids = ids.into_iter().take(STAMPS_ASKED_MAX).collect();
            self.send(from, vec![Section::AskStamps(AskStamps { wide, ids })]);
        }
    }

    /// Asks for news of robots of which others seem to know another life, or too much.
    pub(super) fn ask_names(&mut self, from: SocketAddr, seats: &[Seat]) {
        let may = self.repair.names_at.is_none_or(|at| self.clock.since(at) >= STAMPS_PERIOD);
        if may {
            self.repair.names_at = Some(self.clock);
            let names = seats.iter().take(SUBJECTS_MAX);
            let robots = names.map(|seat| self.authors.at(*seat).robot.clone()).collect();
            self.send(from, vec![Section::AskNews(AskNews { number: 0, robots })]);
        }
    }

    pub(super) fn answer_stamps(&self, ask: &AskStamps, answer: &mut Vec<Section>) {
        let mut seats = Vec::new();
        for id in ask.ids.iter().take(STAMPS_ASKED_MAX) {
            let low = super::wire::cut(*id, ask.wide);
            let meant = self.authors.ids(low, super::wire::last_of(low, ask.wide));
            seats.extend(meant.map(|(_, seat)| seat).take(4));
        }
        answer.extend(self.stamps_for(seats.into_iter()));
    }

    /// Another's hashes: equal ones need no more words.
    pub(super) fn compare(&mut self, from: SocketAddr, theirs: Summary, answer: &mut Vec<Section>) {
        let root = self.fleet.tree().root();
        if theirs.fleet == root || planted::is(Defect::NoRepair) {
            self.in_step = true;
            self.meet(from);
            self.repair.unfinished = false;
            self.repair.session = self.repair.session.filter(|session| session.with != from);
        } else if self.may_compare() {
            self.repair.session = Some(Session {
                with: from,
                their_root: theirs.fleet,
                moved: false,
                moved_at: self.clock,
            });
            self.repair.restless_since = Some(self.clock);
            answer.push(self.root_nodes());
        }
        if theirs.roster == self.authors.hash() {
            self.repair.names_agreed = true;
            self.repair.roster_doubts = 0;
            return;
        }
        self.repair.roster_doubts = self.repair.roster_doubts.saturating_add(1);
        let enough = self.repair.roster_doubts >= ROSTER_DOUBTS || self.authors.count() < 8;
        let rested = self.repair.roster_at.is_none_or(|at| self.clock >= at);
        if enough && rested {
            let chance = u32::try_from(self.rng.below(1000)).unwrap_or(0);
            let rest = ROSTER_PERIOD + ROSTER_PERIOD * chance / 1000;
            self.repair.roster_at = Some(self.clock + rest);
            self.repair.roster_doubts = 0;
            answer.extend(self.roster_pieces());
        }
    }

    fn may_compare(&self) -> bool {
        let repair = &self.repair;
        let restless = repair.restless_since.is_some_and(|at| self.clock.since(at) >= RESTLESS);
        let due = repair.is_calm(self.clock) || restless || repair.unfinished;
        repair.session.is_none() && due
    }

    fn root_nodes(&self) -> Section {
        let children = self.fleet.tree().children(0, 0);
        Section::FleetNodes(FleetNodes { depth: 0, prefix: 0, children })
    }

    fn roster_pieces(&self) -> Vec<Section> {
        let ids: Vec<u32> = self.authors.ids(0, u32::MAX).map(|(id, _)| id).collect();
        let chunks: Vec<&[u32]> = ids.chunks(ROSTER_IDS_MAX).collect();
        let mut low = 0;
        let mut pieces = Vec::new();
        for (index, chunk) in chunks.iter().enumerate() {
            let next = chunks.get(index + 1).map(|chunk| chunk[0]);
            let high = next.map_or(u32::MAX, |next| next.saturating_sub(1));
            pieces.push(Section::Roster(RosterPiece { low, high, ids: chunk.to_vec() }));
            low = high.saturating_add(1);
        }
        pieces
    }

    /// Tells of robots that the other does not know, asks for those unknown here.
    pub(super) fn answer_roster(&self, piece: &RosterPiece, answer: &mut Vec<Section>) {
        let mut theirs = piece.ids.clone();
        theirs.sort_unstable();
        let ours = self.authors.ids(piece.low, piece.high);
        let lacking = ours.filter(|(id, _)| theirs.binary_search(id).is_err());
        let lacking: Vec<Seat> = lacking.map(|(_, seat)| seat).take(STAMPS_TOLD_MAX).collect();
        answer.extend(self.stamps_for(lacking.into_iter()));
        let unknown = theirs.into_iter().filter(|id| self.authors.by_id(*id).is_none());
        let ids: Vec<u32> = unknown.take(STAMPS_ASKED_MAX).collect();
        if !ids.is_empty() {
            answer.push(Section::AskStamps(AskStamps { wide: true, ids }));
        }
    }

    /// Goes down where branches differ; small branches are told entry by entry.
    pub(super) fn answer_nodes(&self, nodes: &FleetNodes, answer: &mut Vec<Section>) {
        if nodes.depth >= DEPTH_MAX || usize::from(nodes.prefix) >> (4 * nodes.depth) != 0 {
            return;
        }
        let ours = self.fleet.tree().children(nodes.depth, nodes.prefix);
        let mut pieces = Vec::new();
        for (nibble, (our, their)) in (0..).zip(ours.iter().zip(&nodes.children)) {
            if our == their {
                continue;
            }
            let (depth, prefix) = (nodes.depth + 1, nodes.prefix << 4 | nibble);
            let (low, high) = range_of(depth, prefix);
            let count = self.fleet.count_in(low, high, BRANCH_ENTRIES_MAX + 1);
            if depth == DEPTH_MAX || count <= BRANCH_ENTRIES_MAX {
                let entries = self.fleet.pieces(depth, prefix, PIECE_ENTRIES_MAX);
                pieces.extend(entries.into_iter().map(Section::FleetEntries));
            } else {
                let children = self.fleet.tree().children(depth, prefix);
                pieces.push(Section::FleetNodes(FleetNodes { depth, prefix, children }));
            }
            if pieces.len() >= PIECES_MAX {
                break;
            }
        }
        answer.extend(pieces.into_iter().take(PIECES_MAX));
    }

    /// Sends what the other lacks, asks for what is lacking here.
    pub(super) fn answer_entries(&self, piece: &FleetEntries, answer: &mut Vec<Section>) {
        let mut wanted = self.fleet.wanted_of(piece);
        wanted.truncate(WANTED_MAX);
        if !wanted.is_empty() {
            answer.push(Section::FleetWanted(wanted));
        }
        let missing = self.fleet.missing_from(piece, WANTED_MAX);
        answer.extend(self.bounded(&missing));
    }

    pub(super) fn answer_wanted(&self, keys: &[u32], answer: &mut Vec<Section>) {
        let found = keys.iter().take(WANTED_MAX).flat_map(|key| self.fleet.by_hash(*key));
        let found: Vec<FleetRecord> = found.cloned().collect();
        answer.extend(self.bounded(&found));
    }

    /// Records that were asked for, or that another found lacking here.
    pub(super) fn take_records(
        &mut self,
        from: SocketAddr,
        records: Vec<FleetRecord>,
        answer: &mut Vec<Section>,
    ) {
        let fresh = self.merge(records, answer);
        self.traffic.caught_up += fresh.len() as u64;
        if fresh.len() <= SENT_ON_MAX && self.in_step {
            self.spread_keys(fresh, vec![from]);
        }
        let root = self.fleet.tree().root();
        let Some(session) = self.repair.session.as_mut().filter(|session| session.with == from)
        else {
            return;
        };
        session.moved = true;
        session.moved_at = self.clock;
        if root == session.their_root {
            self.in_step = true;
            self.repair.session = None;
        }
    }

    /// Goes on with a comparison that brought something.
    pub(super) fn compare_on(&mut self) {
        let now = self.clock;
        let due = |session: &&mut Session| session.moved && now >= session.moved_at + PACE;
        let Some(session) = self.repair.session.as_mut().filter(due) else { return };
        session.moved = false;
        session.moved_at = now;
        let with = session.with;
        let nodes = self.root_nodes();
        self.send(with, vec![nodes]);
    }

    fn bounded(&self, records: &[FleetRecord]) -> Vec<Section> {
        let mut sections = sections_of(records, Section::FleetRecords);
        sections.truncate(ANSWERS_MAX);
        sections
    }
}
