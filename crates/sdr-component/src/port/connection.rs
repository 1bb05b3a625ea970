//! One connection into an input: its shared memory, its fence, its figures.

use sdr_core::{effect::InputWiring, order::Token};

use super::{Fence, Passage, Statistics};
use crate::{
    clock,
    protocol::Heard,
    shm::{Sample, SampleHeader, ShmError, Subscriber},
};

/// One connection into an input.
#[derive(Debug)]
pub(crate) struct Connection {
    pub(crate) wiring: InputWiring,
    pub(crate) subscriber: Subscriber,
    pub(crate) statistics: Statistics,
    fence: Fence,
    /// The last accepted header, so that most samples need no token built.
    last: Option<SampleHeader>,
}

impl Connection {
    pub(crate) fn new(wiring: InputWiring, subscriber: Subscriber) -> Self {
        let deadline_ns = wiring.qos.deadline.map(clock::nanos);
        let statistics = Statistics::new(wiring.connection, deadline_ns);
        Self { wiring, subscriber, statistics, fence: Fence::default(), last: None }
    }

    /// The next sample that passes, and what must be told when its token is greater.
    pub(crate) fn accept(
        &mut self,
        is_whole: fn(&[u8]) -> bool,
    ) -> Result<Option<(Sample, Option<Heard>)>, ShmError> {
        while let Some(sample) = self.subscriber.receive()? {
            if !is_whole(sample.payload()) {
                self.statistics.break_off();
                continue;
            }
            let header = *sample.header();
            let now_ns = clock::monotonic_ns();
            let heard = match self.judge(&header) {
                Passage::Refused => continue,
                Passage::Same => None,
                Passage::Greater => self.heard(now_ns),
            };
            self.statistics.accept(now_ns, header.epoch, header.sequence, heard.is_some());
            self.last = Some(header);
            return Ok(Some((sample, heard)));
        }
        Ok(None)
    }

    /// The token accepted last, to be told to an agent that is new.
    pub(crate) fn heard(&self, at_ns: u64) -> Option<Heard> {
        let token = self.fence.accepted()?.clone();
        Some(Heard { connection: self.wiring.connection, token, at_ns })
    }

    /// Drops what came while nobody listened.
    pub(crate) fn discard(&mut self) {
        self.subscriber.clear_wakes();
        while let Ok(Some(_)) = self.subscriber.receive() {}
        self.statistics.pause();
    }

    fn judge(&mut self, header: &SampleHeader) -> Passage {
        if self.last.is_some_and(|last| last.same_token(header)) {
            return Passage::Same;
        }
        let Some(token): Option<Token> = header.token() else {
            self.statistics.break_off();
            return Passage::Refused;
        };
        let passage = self.fence.pass(&token);
        if passage == Passage::Refused {
            self.statistics.refuse();
        }
        passage
    }
}
