//! Any bytes as a datagram: a value or an error, little memory, and what is read packs into
//! datagrams that say the same.
#![no_main]

use libfuzzer_sys::fuzz_target;
use sdr_core::mesh::{DATAGRAM_BYTES_MAX, Datagram, Incarnation, Section};
use sdr_fuzz::{fleet, meter};

/// Memory that reading one datagram may take.
const MEMORY_MAX: usize = 192 * 1024;

fn read(bytes: &[u8]) {
    let read = || Datagram::decode(bytes, fleet::number());
    let Ok(datagram) = meter::at_most(MEMORY_MAX, read) else { return };
    let packed = datagram.header.pack(&datagram.sections);
    let mut again: Vec<Section> = Vec::new();
    for bytes in &packed {
        assert!(bytes.len() <= DATAGRAM_BYTES_MAX);
        let part = Datagram::decode(bytes, fleet::number()).expect("own words can be read");
        assert_eq!(part.header, datagram.header);
        again.extend(part.sections);
    }
    assert_eq!(again, datagram.sections);
}

fuzz_target!(|bytes: &[u8]| {
    read(bytes);
    // the same as one section behind a good header: the fuzzer need not find that first
    if let [tag, body @ ..] = bytes {
        let mut datagram = fleet::header(1, Incarnation { counter: 1, nonce: 1 }, 5000, 3);
        fleet::put_section(*tag, body, &mut datagram);
        read(&datagram);
    }
});
