//! The state file of an agent: as it lies there, or whole with any content; and the brain
//! that goes on from it.
#![no_main]

use std::time::Duration;

use libfuzzer_sys::fuzz_target;
use sdr_core::disk;
use sdr_fuzz::{bytes::Choices, meter, shell::Shell};

fuzz_target!(|bytes: &[u8]| {
    let mut choices = Choices(bytes);
    let sealed = choices.byte() % 2 == 1;
    let rest = choices.rest();
    let file = if sealed { disk::seal(rest) } else { rest.to_vec() };
    let allowed = 128 * 1024 + 512 * file.len();
    let Ok(state) = meter::at_most(allowed, || disk::decode(&file)) else { return };
    let again = disk::decode(&disk::encode(&state)).expect("what was read can be written");
    assert_eq!(again, state);
    meter::at_most(16 << 20, || {
        let mut shell = Shell::new(Some(state));
        shell.pass(Duration::from_secs(4));
    });
});
