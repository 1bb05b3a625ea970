//! Streams between robots, as far as parts of systems go over them.

use std::{net::SocketAddr, time::Duration};

use sdr_core::{blob::BlobRef, input::Input};

use super::{
    air::{FRAME_BYTES, number_of},
    due::Due,
    fleet::Fleet,
};

/// Time the own disk takes.
const DISK: Duration = Duration::from_millis(2);
/// Time a handshake and a question take.
const QUESTION: Duration = Duration::from_millis(30);
/// Time after which somebody who does not answer is given up.
const NO_ANSWER: Duration = Duration::from_secs(5);
/// What a stream carries, bytes per millisecond.
const BYTES_PER_MS: u64 = 500;
/// Bytes of a handshake and a question.
const QUESTION_BYTES: usize = 4000;

/// A transfer: who asks, and who is left to be asked.
#[derive(Debug)]
pub(crate) struct Transfer {
    robot: usize,
    life: u64,
    blob: BlobRef,
    /// Who gives it now; `None` while a question is on its way.
    giver: Option<usize>,
    from: Vec<usize>,
}

impl Fleet {
    /// Looks on the own disk, then asks.
    pub(crate) fn fetch(&mut self, robot: usize, blob: BlobRef, from: &[SocketAddr]) {
        self.trace.note(self.now, robot, &blob.hash.0);
        if let Some(bytes) = self.robots[robot].disk.blob(&blob.hash) {
            let result = Ok(bytes.to_vec());
            return self.later(robot, DISK, Input::Fetched { blob, result });
        }
        let life = self.robots[robot].life;
        let from = from.iter().rev().map(|address| number_of(*address)).collect();
        self.ask(Transfer { robot, life, blob, giver: None, from });
    }

    /// The next of those who may have it.
    fn ask(&mut self, mut transfer: Transfer) {
        let Some(giver) = transfer.from.pop().filter(|giver| *giver < self.robots.len()) else {
            let input = Input::Fetched { blob: transfer.blob, result: Err("nobody has it".into()) };
            return self.later(transfer.robot, DISK, input);
        };
        self.tally.sent(transfer.robot, QUESTION_BYTES);
        let answers = self.is_reached(transfer.robot, giver);
        let has = answers && self.robots[giver].disk.blob(&transfer.blob.hash).is_some();
        let length = u64::from(transfer.blob.length);
        let time = match (answers, has) {
            (false, _) => NO_ANSWER,
            (true, false) => QUESTION,
            (true, true) => QUESTION + Duration::from_millis(length / BYTES_PER_MS),
        };
        transfer.giver = has.then_some(giver);
        self.queue.push(self.now + time, Due::Transfer(transfer));
    }

    /// A transfer is over: it came through when both ends still hear each other.
    pub(crate) fn transferred(&mut self, transfer: Transfer) {
        if !self.lives(transfer.robot, transfer.life) {
            return;
        }
        let giver = transfer.giver.filter(|giver| self.is_reached(transfer.robot, *giver));
        let bytes = giver.and_then(|giver| {
            let bytes = self.robots[giver].disk.blob(&transfer.blob.hash)?;
            Some((giver, bytes.to_vec()))
        });
        let Some((giver, bytes)) = bytes else { return self.ask(transfer) };
        self.tally.sent(giver, bytes.len() + FRAME_BYTES * (bytes.len() / 1200 + 1));
        self.tell(transfer.robot, Input::Fetched { blob: transfer.blob, result: Ok(bytes) });
    }

    fn is_reached(&self, one: usize, other: usize) -> bool {
        self.robots[other].is_on()
            && self.air.is_linked(one, other, self.now)
            && self.air.is_linked(other, one, self.now)
    }
}
