//! Sealed datagrams: genuine, changed on their way, repeated, of an insider who seals whatever
//! it likes as whatever kind.
#![no_main]

use std::time::Duration;

use libfuzzer_sys::fuzz_target;
use sdr_core::time::Instant;
use sdr_fuzz::{bytes::Choices, insider, meter};
use sdr_keys::{
    KeyId, MeshKey,
    seal::{Begin, OVERHEAD_BYTES, Opened, Refusal, Seal},
};

const STEPS_MAX: usize = 64;
const MEMORY_MAX: usize = 4 << 20;

fn key(number: u16) -> MeshKey {
    MeshKey::new(KeyId(number), [u8::try_from(number & 0xff).expect("masked"); 32])
}

fn seal(salt: u8) -> Seal {
    let mut count = 0_u8;
    let chance = Box::new(move |bytes: &mut [u8]| {
        count = count.wrapping_add(1);
        bytes.fill(salt.wrapping_mul(31).wrapping_add(count));
    });
    Seal::new([key(1)], Duration::from_secs(20), Instant::ZERO, chance)
}

fuzz_target!(|bytes: &[u8]| {
    let mut choices = Choices(bytes);
    let (mut here, mut there) = (seal(1), seal(2));
    let mut now = Instant::from_millis(1);
    let mut passed: Vec<Vec<u8>> = Vec::new();
    meter::at_most(MEMORY_MAX, || {
        for _ in 0..STEPS_MAX {
            if choices.is_empty() {
                break;
            }
            let step = choices.byte();
            let datagram = match step % 8 {
                0 => choices.slice().to_vec(),
                1 => there.seal(now, choices.slice()),
                2 => there.seal_notice(now, &String::from_utf8_lossy(choices.slice())),
                3 => {
                    let mut changed = there.seal(now, choices.slice());
                    let at = usize::from(choices.short()) % changed.len();
                    changed[at] ^= choices.byte() | 1;
                    changed
                }
                4 => passed.get(usize::from(choices.byte())).cloned().unwrap_or_default(),
                5 => {
                    now = now + Duration::from_millis(u64::from(choices.short()));
                    continue;
                }
                6 => {
                    let begin = if step & 8 == 0 { Begin::Now } else { Begin::AfterGrace };
                    let newer = key(u16::from(choices.byte() % 4) + 1);
                    here.add_key(now, newer.clone(), begin);
                    if step & 16 == 0 {
                        there.add_key(now, newer, begin);
                    }
                    continue;
                }
                _ => insider::seal(
                    &key(u16::from(choices.byte() % 4) + 1),
                    choices.byte() % 5,
                    [choices.byte() % 3; 8],
                    u64::from(choices.short()) << (choices.byte() % 25),
                    choices.slice(),
                ),
            };
            open(&mut here, &mut there, now, &datagram, &passed);
            if passed.len() < 16 {
                passed.push(datagram);
            }
        }
        let counters = here.counters(now);
        assert!(counters.unanswered.datagrams <= counters.unproven);
    });
});

/// Opens it and passes answers on, as a network would.
fn open(here: &mut Seal, there: &mut Seal, now: Instant, datagram: &[u8], passed: &[Vec<u8>]) {
    match here.open(now, datagram) {
        Opened::Datagram(inner) => {
            assert_eq!(inner.len() + OVERHEAD_BYTES, datagram.len());
            let again = here.open(now, datagram);
            assert!(matches!(again, Opened::Refused(_)), "passed twice: {again:?}");
        }
        Opened::Answer(answer) => {
            assert!(answer.len() <= datagram.len().max(OVERHEAD_BYTES + 16), "a lever");
            if let Opened::Answer(proof) = there.open(now, &answer) {
                here.open(now, &proof);
            }
        }
        Opened::Refused(Refusal::Retired(_)) => {
            if let Some(hint) = here.hint(now, datagram.len()) {
                assert!(hint.len() <= datagram.len(), "a lever");
            }
        }
        Opened::Notice(line) => assert!(line.len() <= datagram.len()),
        Opened::Proven => {}
        Opened::Refused(
            Refusal::NotSealed
            | Refusal::NoKey(_)
            | Refusal::Forged
            | Refusal::Replayed
            | Refusal::Unproven
            | Refusal::Stray
            | Refusal::Own,
        ) => {}
    }
    assert!(passed.len() <= 16);
}
