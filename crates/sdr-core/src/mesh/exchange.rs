//! What is said to whom: greetings, answers, pushes, forwarded records.

use alloc::{collections::BTreeSet, vec, vec::Vec};
use core::net::SocketAddr;

use super::{
    FORWARD_PEERS, FleetRecord, GOSSIP_PEERS, Incarnation, Merge, Mesh, MeshNews, PUSH_PEERS_MAX,
    author_table::STAMP_BYTES_MAX,
    wire::{
        AuthorDelta, AuthorDigest, AuthorStamp, DATAGRAM_BYTES_MAX, Datagram, FleetBucket, Section,
    },
};
use crate::{
    id::RobotId,
    planted::{self, Defect},
    time::Instant,
};

/// Entries of one piece of a bucket: 10 bytes each at most.
const PIECE_ENTRIES_MAX: usize = 100;
/// Addresses told in one greeting.
const ADDRESSES_TOLD: usize = 4;
/// Stamps in one greeting.
const STAMPS_TOLD: usize = 12;
/// Answers to one datagram, in datagrams, so that a small question has no huge answer.
const ANSWERS_MAX: usize = 12;

impl Mesh {
    /// A datagram under this robot's own name: an echo, an old life, or a twin.
    pub(super) fn handle_own_name(&mut self, from: SocketAddr, datagram: &Datagram) {
        if datagram.incarnation == self.own {
            return;
        }
        self.counters.stale += 1;
        if datagram.incarnation > self.own {
            self.outgrow(datagram.incarnation);
            self.news.push_back(MeshNews::DuplicateId(from));
        }
    }

    /// Speaks under a greater incarnation than `seen`, which others hold of this robot.
    fn outgrow(&mut self, seen: Incarnation) {
        self.own.counter = seen.counter.saturating_add(1);
        self.authors.reincarnate(self.own);
        self.pushed = 0;
    }

    pub(super) fn take_in(&mut self, now: Instant, from: SocketAddr, datagram: Datagram) {
        let mut answer = Vec::new();
        let mut anything = false;
        let robot = datagram.from;
        let greeted = datagram.sections.iter().any(|part| matches!(part, Section::Ping(_)));
        for section in datagram.sections {
            anything |= match section {
                Section::Ping(number) => {
                    answer.push(Section::Pong(number));
                    false
                }
                Section::Pong(number) => self.links.pong(&robot, number, now),
                Section::AuthorDigest(digest) => self.compare(now, digest, &mut answer),
                Section::AuthorDelta(delta) => self.learn(now, &delta, &mut answer),
                Section::FleetDigest(theirs) => {
                    self.compare_buckets(&theirs, greeted, &mut answer);
                    false
                }
                Section::FleetBucket(piece) => self.answer_piece(&piece, &mut answer),
                Section::FleetRecords(records) => self.merge(from, records, &mut answer),
                Section::Peers(addresses) => {
                    addresses.into_iter().take(ADDRESSES_TOLD).for_each(|a| self.peers.learn(a));
                    false
                }
            };
        }
        if anything && self.liveness.is_alive(&robot) {
            self.peers.hear(&robot, from);
        } else if !anything {
            self.counters.stale += 1;
        }
        self.send_sections(from, answer);
    }

    /// Greets a few robots, and one that was never heard.
    pub(super) fn greet_some(&mut self, now: Instant) {
        let mut peers = self.peers.pick(GOSSIP_PEERS, &mut self.rng, &[]);
        peers.extend(self.peers.pick_unheard(&mut self.rng));
        peers.dedup();
        for peer in peers {
            let mut sections = vec![
                Section::Ping(self.links.ping(peer, now)),
                Section::AuthorDigest(self.digest()),
                Section::FleetDigest(self.fleet.digest()),
            ];
            let known = self.peers.pick(ADDRESSES_TOLD, &mut self.rng, &[peer]);
            if !known.is_empty() {
                sections.push(Section::Peers(known));
            }
            self.send_sections(peer, sections);
        }
    }

    /// Own records made since the last push, to many at once.
    pub(super) fn push_own(&mut self) {
        let peers = self.peers.pick(PUSH_PEERS_MAX, &mut self.rng, &[]);
        while self.pushed < self.authors.own_sequence() {
            let Some(delta) = self.authors.own_delta(self.pushed, self.room()) else { break };
            self.pushed = delta.stamp.sequence;
            for peer in &peers {
                self.send_sections(*peer, vec![Section::AuthorDelta(delta.clone())]);
            }
        }
    }

    pub(super) fn send_records(&mut self, records: &[FleetRecord], peers: &[SocketAddr]) {
        for chunk in self.chunks(records) {
            for peer in peers {
                self.send_sections(*peer, vec![Section::FleetRecords(chunk.clone())]);
            }
        }
    }

    /// Own stamp first, then the others in turn.
    fn digest(&mut self) -> AuthorDigest {
        let (mine, mut others): (Vec<AuthorStamp>, Vec<AuthorStamp>) =
            self.authors.stamps().partition(|stamp| stamp.robot == self.config.robot);
        let whole = others.len() < STAMPS_TOLD;
        if !whole {
            let turn = self.rng.below(others.len());
            others.rotate_left(turn);
            others.truncate(STAMPS_TOLD - 1);
        }
        AuthorDigest { whole, stamps: mine.into_iter().chain(others).collect() }
    }

    /// Whether the digest brought a sign of life.
    fn compare(&mut self, now: Instant, digest: AuthorDigest, answer: &mut Vec<Section>) -> bool {
        let mut anything = false;
        let mut behind = Vec::new();
        let mut told: BTreeSet<RobotId> = BTreeSet::new();
        for stamp in &digest.stamps {
            if stamp.robot == self.config.robot && stamp.incarnation > self.own {
                self.outgrow(stamp.incarnation);
            }
            let ahead = self.authors.is_behind(stamp);
            if self.authors.hear(stamp).fresh {
                anything = true;
                self.hear(now, &stamp.robot);
            }
            if ahead {
                behind.extend(self.authors.stamp_of(&stamp.robot));
            } else {
                let delta = self.authors.delta(&stamp.robot, Some(stamp), self.room());
                answer.extend(delta.map(Section::AuthorDelta));
            }
            told.insert(stamp.robot.clone());
        }
        if digest.whole {
            let unknown: Vec<RobotId> =
                self.authors.robots().filter(|robot| !told.contains(robot)).cloned().collect();
            for robot in unknown {
                let delta = self.authors.delta(&robot, None, self.room());
                answer.extend(delta.map(Section::AuthorDelta));
            }
        }
        if !behind.is_empty() {
            behind.truncate(STAMPS_TOLD);
            answer.push(Section::AuthorDigest(AuthorDigest { whole: false, stamps: behind }));
        }
        anything
    }

    fn learn(&mut self, now: Instant, delta: &AuthorDelta, answer: &mut Vec<Section>) -> bool {
        if planted::is(Defect::StaleReports)
            && self.authors.robots().any(|r| *r == delta.stamp.robot)
        {
            return false;
        }
        let learned = self.authors.learn(delta);
        self.counters.refused += learned.refused;
        if learned.fresh {
            self.hear(now, &delta.stamp.robot);
        }
        if learned.records {
            self.news.push_back(MeshNews::Report(delta.stamp.robot.clone()));
        }
        if learned.gap {
            let stamps = self.authors.stamp_of(&delta.stamp.robot).into_iter().collect();
            answer.push(Section::AuthorDigest(AuthorDigest { whole: false, stamps }));
        }
        learned.fresh || learned.records
    }

    fn hear(&mut self, now: Instant, robot: &RobotId) {
        if self.liveness.hear(robot, now) {
            self.news.push_back(MeshNews::Alive(robot.clone()));
        }
    }

    /// Asks for what differs; when nothing does, both ends know that they are in step.
    fn compare_buckets(&mut self, theirs: &[u32], greeted: bool, answer: &mut Vec<Section>) {
        if planted::is(Defect::NoRepair) {
            self.in_step = true;
            return;
        }
        let ours = self.fleet.digest();
        if ours == theirs {
            self.in_step = true;
            answer.extend(greeted.then_some(Section::FleetDigest(ours)));
            return;
        }
        for (bucket, (our, their)) in ours.iter().zip(theirs).enumerate() {
            if our != their {
                let pieces = self.fleet.pieces(bucket, false, PIECE_ENTRIES_MAX);
                answer.extend(pieces.into_iter().map(Section::FleetBucket));
            }
        }
    }

    fn answer_piece(&self, piece: &FleetBucket, answer: &mut Vec<Section>) -> bool {
        let missing = self.fleet.missing_from(piece);
        answer.extend(self.chunks(&missing).into_iter().map(Section::FleetRecords));
        if !piece.answer && self.fleet.lacks_of(piece) {
            let bucket = usize::from(piece.bucket);
            let pieces = self.fleet.pieces(bucket, true, PIECE_ENTRIES_MAX);
            answer.extend(pieces.into_iter().map(Section::FleetBucket));
        }
        !missing.is_empty()
    }

    /// Merges records; news is forwarded, what is outdated is answered with the newer.
    fn merge(
        &mut self,
        from: SocketAddr,
        records: Vec<FleetRecord>,
        answer: &mut Vec<Section>,
    ) -> bool {
        let mut news = Vec::new();
        let mut newer = Vec::new();
        for record in records {
            match self.fleet.merge(record.clone()) {
                Merge::News => {
                    self.news.push_back(MeshNews::Record(record.key.clone()));
                    news.push(record);
                }
                Merge::Older => newer.extend(self.fleet.record(&record.key).cloned()),
                Merge::Known if planted::is(Defect::EndlessEcho) => news.push(record),
                Merge::Known => {}
                Merge::Refused => self.counters.refused += 1,
            }
        }
        answer.extend(self.chunks(&newer).into_iter().map(Section::FleetRecords));
        let peers = self.peers.pick(FORWARD_PEERS, &mut self.rng, &[from]);
        self.send_records(&news, &peers);
        !news.is_empty()
    }

    /// Bytes for one section beside the header.
    fn room(&self) -> usize {
        DATAGRAM_BYTES_MAX - Datagram::header_len(&self.config.robot) - 3
    }

    /// Records in groups that fit one section each.
    fn chunks(&self, records: &[FleetRecord]) -> Vec<Vec<FleetRecord>> {
        let mut chunks: Vec<Vec<FleetRecord>> = Vec::new();
        let mut used = usize::MAX;
        for record in records {
            let size = record.value.len() + record.key.name.len() + STAMP_BYTES_MAX;
            used = used.saturating_add(size);
            match chunks.last_mut() {
                Some(chunk) if used <= self.room() => chunk.push(record.clone()),
                Some(_) | None => {
                    chunks.push(vec![record.clone()]);
                    used = size + 2;
                }
            }
        }
        chunks
    }

    /// Packs sections into as few datagrams as hold them.
    fn send_sections(&mut self, to: SocketAddr, sections: Vec<Section>) {
        let limit = DATAGRAM_BYTES_MAX - Datagram::header_len(&self.config.robot);
        let mut used = 0;
        let mut packed: Vec<Vec<Section>> = Vec::new();
        for section in sections {
            let size = section.wire_len();
            if size > limit {
                self.counters.refused += 1;
                continue;
            }
            match packed.last_mut() {
                Some(datagram) if used + size <= limit => {
                    used += size;
                    datagram.push(section);
                }
                Some(_) | None => {
                    packed.push(vec![section]);
                    used = size;
                }
            }
        }
        for sections in packed.into_iter().take(ANSWERS_MAX) {
            let datagram = Datagram {
                fleet: self.config.fleet,
                from: self.config.robot.clone(),
                incarnation: self.own,
                sections,
            };
            self.outbox.push_back((to, datagram.encode()));
        }
    }
}
