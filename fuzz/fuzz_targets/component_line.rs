//! Lines between agent and component, in pieces of any size.
#![no_main]

use libfuzzer_sys::fuzz_target;
use sdr_fuzz::protocol::{
    FromComponent, LINE_BYTES_MAX, LineBuffer, LineError, ToComponent, encode_line,
    parse_component_key,
};
use sdr_fuzz::{bytes::Choices, meter};
use serde::{Serialize, de::DeserializeOwned};

fn read<T: DeserializeOwned + Serialize + PartialEq + std::fmt::Debug>(bytes: &[u8], piece: usize) {
    let mut buffer = LineBuffer::default();
    for piece in bytes.chunks(piece.max(1)) {
        buffer.push(piece);
        loop {
            match buffer.next_message::<T>() {
                Ok(Some(message)) => {
                    let line = match encode_line(&message) {
                        Ok(line) => line,
                        // escapes may make a line longer than it came
                        Err(LineError::TooLong { .. }) => continue,
                        Err(error) => panic!("what was read cannot be written: {error}"),
                    };
                    assert!(line.len() <= LINE_BYTES_MAX);
                    let mut again = LineBuffer::default();
                    again.push(&line);
                    let again = again.next_message::<T>().expect("own words can be read");
                    assert_eq!(again, Some(message));
                }
                Ok(None) => break,
                Err(_) => return,
            }
        }
    }
}

fuzz_target!(|bytes: &[u8]| {
    let mut choices = Choices(bytes);
    let kind = choices.byte();
    let piece = usize::from(choices.short());
    let rest = choices.rest();
    meter::at_most(1 << 20 | 64 * rest.len(), || match kind % 3 {
        0 => read::<FromComponent>(rest, piece),
        1 => read::<ToComponent>(rest, piece),
        _ => drop(parse_component_key(&String::from_utf8_lossy(rest))),
    });
});
