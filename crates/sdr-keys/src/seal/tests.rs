//! Two robots and somebody between them.

use std::time::Duration;

use proptest::prelude::*;

use super::opener::{QUESTION_LIFE, QUESTIONS_MAX, SENDERS_MAX};
use super::*;

const KEY_GRACE: Duration = Duration::from_secs(20);
const WORDS: &[u8] = b"a datagram of the mesh";

fn key(id: u16) -> MeshKey {
    MeshKey::new(KeyId(id), [u8::try_from(id).unwrap(); 32])
}

/// Counts upwards from `seed`: as good as random where only difference matters.
fn chance(seed: u64) -> Chance {
    let mut next = seed << 20;
    Box::new(move |bytes: &mut [u8]| {
        for piece in bytes.chunks_mut(8) {
            next += 1;
            piece.copy_from_slice(&next.to_be_bytes()[..piece.len()]);
        }
    })
}

fn robot(seed: u64) -> Seal {
    Seal::new([key(1)], KEY_GRACE, Instant::ZERO, chance(seed))
}

fn at(millis: u64) -> Instant {
    Instant::from_millis(millis)
}

fn answer(opened: Opened) -> Vec<u8> {
    let Opened::Answer(bytes) = opened else { panic!("no answer: {opened:?}") };
    bytes
}

/// `there` learns that `here` lives; the datagram that began it.
fn introduce(here: &mut Seal, there: &mut Seal, now: Instant) -> Vec<u8> {
    let first = here.seal(now, WORDS);
    let challenge = answer(there.open(now, &first));
    assert!(challenge.len() <= first.len());
    let proof = answer(here.open(now, &challenge));
    assert!(proof.len() <= challenge.len());
    assert_eq!(there.open(now, &proof), Opened::Proven);
    first
}

#[test]
fn after_one_round_of_proof_datagrams_pass_and_each_passes_once() {
    let (mut here, mut there) = (robot(1), robot(2));
    let first = introduce(&mut here, &mut there, at(1));

    let second = here.seal(at(2), WORDS);
    let third = here.seal(at(2), b"");
    assert_eq!(second.len(), WORDS.len() + OVERHEAD_BYTES);
    assert_eq!(there.open(at(3), &third), Opened::Datagram(Vec::new()));
    assert_eq!(there.open(at(3), &second), Opened::Datagram(WORDS.to_vec()));

    for again in [first, second, third] {
        assert_eq!(there.open(at(4), &again), Opened::Refused(Refusal::Replayed));
    }
    let counters = there.counters(at(4));
    assert_eq!((counters.opened, counters.proven, counters.replayed), (2, 1, 3));
}

#[test]
fn what_was_recorded_before_a_receiver_restarted_is_refused_for_ever() {
    let (mut here, mut there) = (robot(1), robot(2));
    let mut recorded = vec![introduce(&mut here, &mut there, at(1))];
    for _ in 0..20 {
        let datagram = here.seal(at(2), WORDS);
        assert_eq!(there.open(at(2), &datagram), Opened::Datagram(WORDS.to_vec()));
        recorded.push(datagram);
    }

    let mut restarted = robot(3);
    let mut asked = 0;
    for datagram in &recorded {
        let opened = restarted.open(at(3), datagram);
        if matches!(opened, Opened::Answer(_)) {
            asked += 1;
        } else {
            assert_eq!(opened, Opened::Refused(Refusal::Unproven));
        }
    }
    assert_eq!(asked, 1, "a flood is not answered by a flood");
    let lapsed = at(3) + QUESTION_LIFE;
    let counters = restarted.counters(lapsed);
    assert_eq!((counters.opened, counters.unproven), (0, 21));
    assert_eq!((counters.unanswered.starts, counters.unanswered.datagrams), (1, 21));

    introduce(&mut here, &mut restarted, lapsed);
    for datagram in &recorded {
        let opened = restarted.open(lapsed, datagram);
        assert_eq!(opened, Opened::Refused(Refusal::Replayed));
    }
}

#[test]
fn a_recorded_proof_proves_nothing_to_a_new_question() {
    let (mut here, mut there) = (robot(1), robot(2));
    let first = here.seal(at(1), WORDS);
    let challenge = answer(there.open(at(1), &first));
    let proof = answer(here.open(at(1), &challenge));

    let mut restarted = robot(3);
    assert_eq!(restarted.open(at(2), &proof), Opened::Refused(Refusal::Stray));
    let fresh = answer(restarted.open(at(2), &first));
    assert_ne!(fresh[HEADER..], challenge[HEADER..]);
    assert_eq!(restarted.open(at(2), &proof), Opened::Refused(Refusal::Stray));
    assert_eq!(there.open(at(1) + QUESTION_LIFE, &proof), Opened::Refused(Refusal::Stray));
}

const HEADER: usize = 16;

#[test]
fn only_the_start_that_is_asked_answers() {
    let (mut here, mut there, mut third) = (robot(1), robot(2), robot(3));
    let first = here.seal(at(1), WORDS);
    let challenge = answer(there.open(at(1), &first));

    assert_eq!(third.open(at(1), &challenge), Opened::Refused(Refusal::Stray));
    assert_eq!(there.open(at(1), &challenge), Opened::Refused(Refusal::Own));
    assert_eq!(here.open(at(1), &first), Opened::Refused(Refusal::Own));
}

#[test]
fn short_datagrams_of_strangers_are_no_lever() {
    let (mut here, mut there) = (robot(1), robot(2));
    for length in 0..16 {
        let datagram = here.seal(at(1), &WORDS[..length]);
        assert_eq!(there.open(at(1), &datagram), Opened::Refused(Refusal::Unproven));
    }
    let datagram = here.seal(at(1), &WORDS[..16]);
    let challenge = answer(there.open(at(1), &datagram));
    assert_eq!(challenge.len(), datagram.len());
}

#[test]
fn strangers_cannot_fill_the_memory() {
    let mut there = robot(0);
    for seed in 1..=1000 {
        let datagram = robot(seed).seal(at(1), WORDS);
        there.open(at(1), &datagram);
    }
    assert_eq!(there.opener.sizes(), (0, QUESTIONS_MAX));

    let late = at(1) + QUESTION_LIFE;
    for seed in 1..=u64::try_from(SENDERS_MAX).unwrap() + 10 {
        introduce(&mut robot(seed), &mut there, late + Duration::from_millis(seed));
    }
    assert_eq!(there.opener.sizes().0, SENDERS_MAX);
}

#[test]
fn other_keys_plain_words_and_cut_datagrams_are_told_apart() {
    let mut there = robot(2);
    let mut newer = Seal::new([key(9)], KEY_GRACE, Instant::ZERO, chance(5));
    let mut liar =
        Seal::new([MeshKey::new(KeyId(1), [99; 32])], KEY_GRACE, Instant::ZERO, chance(6));
    let datagram = newer.seal(at(1), WORDS);
    assert_eq!(there.open(at(1), &datagram), Opened::Refused(Refusal::NoKey(KeyId(9))));
    let forged = liar.seal(at(1), WORDS);
    assert_eq!(there.open(at(1), &forged), Opened::Refused(Refusal::Forged));
    for plain in [&b""[..], b"SD\x01 plain words of the mesh, long enough", &forged[..31]] {
        assert_eq!(there.open(at(1), plain), Opened::Refused(Refusal::NotSealed));
    }
    let counters = there.counters(at(1));
    assert_eq!((counters.no_key, counters.forged, counters.not_sealed), (1, 1, 3));
}

#[test]
fn a_rotation_under_traffic_loses_nothing_and_retires_the_old_key() {
    let (mut here, mut there) = (robot(1), robot(2));
    introduce(&mut here, &mut there, at(0));
    let second = |number: u64| at(number * 1000);
    let mut sealed_with = Vec::new();
    for now in 1..60 {
        if now == 5 {
            here.add_key(second(now), key(2), Begin::AfterGrace);
        }
        if now == 15 {
            there.add_key(second(now), key(2), Begin::AfterGrace);
        }
        let datagram = here.seal(second(now), WORDS);
        sealed_with.push(datagram[2]);
        assert_eq!(there.open(second(now), &datagram), Opened::Datagram(WORDS.to_vec()), "{now}");
    }
    assert_eq!(sealed_with[..24], [1; 24]);
    assert_eq!(sealed_with[24..], [2; 35]);

    let mut revoked = robot(7);
    let datagram = revoked.seal(second(60), WORDS);
    assert_eq!(there.open(second(60), &datagram), Opened::Refused(Refusal::Retired(KeyId(1))));
    here.add_key(second(61), key(3), Begin::Now);
    assert_eq!(here.open(second(61), &datagram), Opened::Refused(Refusal::Retired(KeyId(1))));
}

#[test]
fn a_restarted_robot_seals_with_its_newest_key_and_opens_older_ones_for_a_grace() {
    let mut restarted = Seal::new([key(2), key(1)], KEY_GRACE, at(1000), chance(1));
    let mut other = robot(2);
    let old = other.seal(at(1000), WORDS);
    assert_eq!(restarted.seal(at(1000), b"")[2], 2);
    assert!(matches!(restarted.open(at(1000), &old), Opened::Answer(_)));
    let late = at(1000) + KEY_GRACE;
    assert_eq!(restarted.open(late, &old), Opened::Refused(Refusal::Retired(KeyId(1))));
}

#[test]
fn a_robot_with_a_retired_key_is_told_that_there_is_a_newer_one() {
    let (mut here, mut away) = (robot(1), robot(2));
    here.add_key(at(0), key(2), Begin::Now);
    let late = at(0) + KEY_GRACE;
    let datagram = away.seal(late, WORDS);
    assert_eq!(here.open(late, &datagram), Opened::Refused(Refusal::Retired(KeyId(1))));

    let hint = here.hint(late, datagram.len()).unwrap();
    assert!(hint.len() <= datagram.len());
    assert_eq!(away.open(late, &hint), Opened::Refused(Refusal::NoKey(KeyId(2))));
    assert_eq!(here.hint(late, 31), None);
}

#[test]
fn notices_are_taken_of_the_living_alone() {
    let (mut here, mut there) = (robot(1), robot(2));
    let early = here.seal_notice(at(1), "sdr1 keys");
    assert_eq!(there.open(at(1), &early), Opened::Refused(Refusal::Unproven));
    introduce(&mut here, &mut there, at(1));
    let notice = here.seal_notice(at(2), "sdr1 keys");
    assert_eq!(there.open(at(2), &notice), Opened::Notice("sdr1 keys".into()));
    assert_eq!(there.open(at(2), &notice), Opened::Refused(Refusal::Replayed));
}

#[test]
fn after_its_last_counter_a_sender_starts_anew() {
    let (mut here, mut there) = (robot(1), robot(2));
    introduce(&mut here, &mut there, at(1));
    here.sealer.set_counter((1 << 40) - 2);

    let last = here.seal(at(2), WORDS);
    assert_eq!(there.open(at(2), &last), Opened::Datagram(WORDS.to_vec()));
    let anew = here.seal(at(2), WORDS);
    assert_ne!(last[3..11], anew[3..11]);
    assert!(matches!(there.open(at(2), &anew), Opened::Answer(_)));
    introduce(&mut here, &mut there, at(300));
}

proptest! {
    #[test]
    fn any_bytes_are_answered_with_a_value(bytes in prop::collection::vec(any::<u8>(), 0..200), first in 0_u8..4) {
        let mut there = robot(2);
        let mut bytes = bytes;
        if bytes.len() > 3 {
            bytes[..3].copy_from_slice(&[0x10 | first, 0, 1]);
        }
        let refused = matches!(there.open(at(1), &bytes), Opened::Refused(_));
        prop_assert!(refused);
    }

    #[test]
    fn one_changed_bit_anywhere_is_seen(bit in 0_usize..(22 + 32) * 8) {
        let (mut here, mut there) = (robot(1), robot(2));
        introduce(&mut here, &mut there, at(1));
        let mut datagram = here.seal(at(2), WORDS);
        datagram[bit / 8] ^= 1 << (bit % 8);
        let refused = matches!(there.open(at(2), &datagram), Opened::Refused(_));
        prop_assert!(refused);
    }

    #[test]
    fn whatever_the_order_each_datagram_passes_at_most_once(
        order in prop::collection::vec(0_usize..60, 0..300),
    ) {
        let (mut here, mut there) = (robot(1), robot(2));
        introduce(&mut here, &mut there, at(1));
        let sealed: Vec<Vec<u8>> = (0..60_u8).map(|n| here.seal(at(2), &[n])).collect();
        let mut passed = [0; 60];
        for number in order {
            if there.open(at(3), &sealed[number]) == Opened::Datagram(vec![u8::try_from(number).unwrap()]) {
                passed[number] += 1;
            } else {
                prop_assert_eq!(passed[number], 1, "the first of each passes within the window");
            }
        }
        prop_assert!(passed.iter().all(|times| *times <= 1));
    }

    #[test]
    fn what_is_sealed_is_what_is_opened(bytes in prop::collection::vec(any::<u8>(), 0..1200)) {
        let (mut here, mut there) = (robot(1), robot(2));
        introduce(&mut here, &mut there, at(1));
        let datagram = here.seal(at(2), &bytes);
        prop_assert_eq!(datagram.len(), bytes.len() + 32);
        prop_assert_eq!(there.open(at(2), &datagram), Opened::Datagram(bytes));
    }
}
