//! The receiving half: who lives, and what came before.

use std::{collections::BTreeMap, time::Duration};

use sdr_core::time::Instant;

use super::{
    Chance, Refusal,
    header::{Header, Kind, OVERHEAD_BYTES, Start, SubKey},
    keyring::Keyring,
    window::Window,
};

/// Most sender starts that are known at a time; whoever was heard least lately goes first
/// and is challenged again.
pub(super) const SENDERS_MAX: usize = 4096;
/// Most questions that are open at a time.
pub(super) const QUESTIONS_MAX: usize = 256;
/// How long a question waits for its answer.
pub(super) const QUESTION_LIFE: Duration = Duration::from_secs(5);
/// Time between two questions to one start.
const QUESTION_PERIOD: Duration = Duration::from_millis(200);
/// The start that is asked, and the random number.
const QUESTION_BYTES: usize = 16;

/// What was opened and refused since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SealCounters {
    /// Datagrams of the mesh that were opened.
    pub opened: u64,
    /// Starts that proved to live.
    pub proven: u64,
    /// Refused: [`Refusal::NotSealed`].
    pub not_sealed: u64,
    /// Refused: [`Refusal::NoKey`].
    pub no_key: u64,
    /// Refused: [`Refusal::Retired`].
    pub retired: u64,
    /// Refused: [`Refusal::Forged`].
    pub forged: u64,
    /// Refused: [`Refusal::Replayed`].
    pub replayed: u64,
    /// Refused: [`Refusal::Unproven`]; normal at every start of a robot.
    pub unproven: u64,
    /// Refused: [`Refusal::Stray`].
    pub stray: u64,
    /// Refused: [`Refusal::Own`].
    pub own: u64,
    /// Of those unproven, the datagrams of starts that let their question lapse.
    pub unanswered: Unproven,
}

/// Datagrams of starts that never answered: recorded in the past, or their sender is gone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Unproven {
    /// How many such starts.
    pub starts: u64,
    /// How many datagrams of theirs.
    pub datagrams: u64,
}

/// What to do with a datagram.
pub(super) enum Verdict {
    Data(Vec<u8>),
    Notice(String),
    Proven,
    /// Seal this as a challenge and send it back.
    Ask([u8; QUESTION_BYTES]),
    /// Seal this as a proof and send it back.
    Prove([u8; 8]),
    Refused(Refusal),
}

/// Knows who lives and what came.
#[derive(Default)]
pub(super) struct Opener {
    senders: BTreeMap<Start, Sender>,
    questions: BTreeMap<Start, Question>,
    counters: SealCounters,
}

struct Sender {
    window: Window,
    sub_key: SubKey,
    heard_at: Instant,
}

struct Question {
    number: [u8; 8],
    since: Instant,
    asked_at: Instant,
    refused: u64,
}

impl Opener {
    pub(super) fn open(
        &mut self,
        now: Instant,
        datagram: &[u8],
        keyring: &Keyring,
        own: &Start,
        chance: &mut Chance,
    ) -> Verdict {
        let (header, bytes) = match self.unseal(now, datagram, keyring, own) {
            Ok(opened) => opened,
            Err(refusal) => return self.refuse(refusal),
        };
        match (self.senders.get_mut(&header.start), header.kind) {
            (Some(sender), Kind::Data) => {
                sender.heard_at = now;
                self.counters.opened += 1;
                Verdict::Data(bytes)
            }
            (Some(_), Kind::Notice) => match String::from_utf8(bytes) {
                Ok(line) => Verdict::Notice(line),
                Err(_) => self.refuse(Refusal::Stray),
            },
            (None, Kind::Notice) => self.refuse(Refusal::Unproven),
            // A robot that restarted asks before anybody knows its new start.
            (Some(_) | None, Kind::Challenge) => self.answer(&bytes, own),
            (Some(_), Kind::Proof) => self.refuse(Refusal::Stray),
            (None, Kind::Proof) => self.hear_proof(now, &header, &bytes, keyring),
            (None, Kind::Data) => self.question(now, &header, datagram.len(), chance),
        }
    }

    pub(super) fn counters(&mut self, now: Instant) -> SealCounters {
        self.forget_questions(now);
        self.counters
    }

    /// Header and plain bytes, when the seal is whole and the counter fresh.
    fn unseal(
        &mut self,
        now: Instant,
        datagram: &[u8],
        keyring: &Keyring,
        own: &Start,
    ) -> Result<(Header, Vec<u8>), Refusal> {
        let header = Header::read(datagram).ok_or(Refusal::NotSealed)?;
        let key = keyring.opening(now, header.key)?;
        if header.start == *own {
            return Err(Refusal::Own);
        }
        let Some(sender) = self.senders.get_mut(&header.start) else {
            let bytes = SubKey::new(key, &header.start).open(&header, datagram);
            return Ok((header, bytes.ok_or(Refusal::Forged)?));
        };
        if sender.sub_key.id != header.key {
            let sub_key = SubKey::new(key, &header.start);
            let bytes = sub_key.open(&header, datagram).ok_or(Refusal::Forged)?;
            // During a rotation both keys come; the newer one is kept at hand.
            if header.key > sender.sub_key.id {
                sender.sub_key = sub_key;
            }
            return sender
                .window
                .admit(header.counter)
                .then_some((header, bytes))
                .ok_or(Refusal::Replayed);
        }
        let bytes = sender.sub_key.open(&header, datagram).ok_or(Refusal::Forged)?;
        sender.window.admit(header.counter).then_some((header, bytes)).ok_or(Refusal::Replayed)
    }

    /// Asks a start that is not known whether it lives.
    fn question(
        &mut self,
        now: Instant,
        header: &Header,
        came: usize,
        chance: &mut Chance,
    ) -> Verdict {
        self.counters.unproven += 1;
        self.forget_questions(now);
        let full = self.questions.len() >= QUESTIONS_MAX;
        // A question is never longer than what it answers: nobody can use it as a lever.
        let lever = came < OVERHEAD_BYTES + QUESTION_BYTES;
        let number = match self.questions.get_mut(&header.start) {
            Some(open) => {
                open.refused += 1;
                if lever || now.since(open.asked_at) < QUESTION_PERIOD {
                    return Verdict::Refused(Refusal::Unproven);
                }
                open.asked_at = now;
                open.number
            }
            None if full || lever => return Verdict::Refused(Refusal::Unproven),
            None => {
                let mut number = [0; 8];
                chance(&mut number);
                let open = Question { number, since: now, asked_at: now, refused: 1 };
                self.questions.insert(header.start, open);
                number
            }
        };
        let mut question = [0; QUESTION_BYTES];
        question[..8].copy_from_slice(&header.start);
        question[8..].copy_from_slice(&number);
        Verdict::Ask(question)
    }

    /// Proves that this robot lives, when it is the one that was asked.
    fn answer(&mut self, bytes: &[u8], own: &Start) -> Verdict {
        match <[u8; QUESTION_BYTES]>::try_from(bytes) {
            Ok(question) if question[..8] == own[..] => {
                Verdict::Prove(question[8..].try_into().expect("eight bytes"))
            }
            Ok(_) | Err(_) => self.refuse(Refusal::Stray),
        }
    }

    fn hear_proof(
        &mut self,
        now: Instant,
        header: &Header,
        bytes: &[u8],
        keyring: &Keyring,
    ) -> Verdict {
        self.forget_questions(now);
        let fits = self.questions.get(&header.start).is_some_and(|open| open.number[..] == *bytes);
        let key = keyring.opening(now, header.key);
        let (true, Ok(key)) = (fits, key) else { return self.refuse(Refusal::Stray) };
        self.questions.remove(&header.start);
        self.make_room();
        let window = Window::after(header.counter);
        let sub_key = SubKey::new(key, &header.start);
        self.senders.insert(header.start, Sender { window, sub_key, heard_at: now });
        self.counters.proven += 1;
        Verdict::Proven
    }

    fn make_room(&mut self) {
        if self.senders.len() < SENDERS_MAX {
            return;
        }
        let quietest = self.senders.iter().min_by_key(|(start, sender)| (sender.heard_at, **start));
        if let Some(start) = quietest.map(|(start, _)| *start) {
            self.senders.remove(&start);
        }
    }

    fn forget_questions(&mut self, now: Instant) {
        let unanswered = &mut self.counters.unanswered;
        self.questions.retain(|_, open| {
            let alive = now.since(open.since) < QUESTION_LIFE;
            if !alive {
                unanswered.starts += 1;
                unanswered.datagrams += open.refused;
            }
            alive
        });
    }

    fn refuse(&mut self, refusal: Refusal) -> Verdict {
        let counters = &mut self.counters;
        let counter = match refusal {
            Refusal::NotSealed => &mut counters.not_sealed,
            Refusal::NoKey(_) => &mut counters.no_key,
            Refusal::Retired(_) => &mut counters.retired,
            Refusal::Forged => &mut counters.forged,
            Refusal::Replayed => &mut counters.replayed,
            Refusal::Unproven => &mut counters.unproven,
            Refusal::Stray => &mut counters.stray,
            Refusal::Own => &mut counters.own,
        };
        *counter += 1;
        Verdict::Refused(refusal)
    }

    #[cfg(test)]
    pub(super) fn sizes(&self) -> (usize, usize) {
        (self.senders.len(), self.questions.len())
    }
}
