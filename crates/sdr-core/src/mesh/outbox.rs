//! Datagrams on their way out.

use alloc::vec::Vec;
use core::net::SocketAddr;

use super::{ANSWERS_MAX, Header, Mesh, Section, author_table::Seat};

/// Datagrams that wait to be sent; more are dropped.
const OUTBOX_MAX: usize = 8192;

impl Mesh {
    /// Milliseconds since this robot's start; from 1.
    pub(super) fn heartbeat(&self) -> u64 {
        let age = self.clock.since(self.born_at).as_millis();
        u64::try_from(age).unwrap_or(u64::MAX).saturating_add(1)
    }

    pub(super) fn header(&self) -> Header {
        Header {
            fleet: self.config.fleet,
            from: self.config.robot.clone(),
            incarnation: self.own,
            heartbeat: self.heartbeat(),
            sequence: self.authors.at(Seat::OWN).sequence(),
        }
    }

    /// Packs sections into as few datagrams as hold them, numbered when the receiver is known.
    pub(super) fn send(&mut self, to: SocketAddr, sections: Vec<Section>) -> usize {
        let encoded: Vec<(u8, Vec<u8>)> = sections.iter().map(Section::encode).collect();
        self.send_encoded(to, &encoded)
    }

    /// The same of sections by their tags and bodies: what goes to several is written once.
    pub(super) fn send_encoded(&mut self, to: SocketAddr, sections: &[(u8, Vec<u8>)]) -> usize {
        let mark = self.peers.seat_at(to).map(|seat| self.links.mark(seat, self.clock));
        let mark = mark.map(|mark| Section::Link(mark).encode());
        let mut sent = 0;
        let header = self.header();
        let packed = header.pack_encoded(mark.iter().chain(sections));
        for bytes in packed.into_iter().take(ANSWERS_MAX) {
            if self.outbox.len() >= OUTBOX_MAX {
                self.traffic.dropped += 1;
                continue;
            }
            sent += bytes.len();
            header.tally(&bytes, &mut self.traffic.sections);
            self.outbox.push_back((to, bytes));
        }
        sent
    }
}
