//! Records of the fleet table, whatever their author put into them: read, merged, acted upon.
#![no_main]

use std::time::Duration;

use libfuzzer_sys::fuzz_target;
use sdr_core::{
    blob::BlobRef,
    input::Input,
    mesh::{FleetRecord, Incarnation},
    order::{Epoch, Version},
    record::{FleetKey, FleetValue, RECORD_BYTES_MAX, RecordKind},
};
use sdr_fuzz::{bytes::Choices, fleet, meter, shell::Shell};

const RECORDS_MAX: usize = 8;
/// The section of records.
const TAG: u8 = 16;

fn record(choices: &mut Choices<'_>) -> FleetRecord {
    let kind = RecordKind(choices.byte() % 15);
    let name = match kind {
        RecordKind::SYSTEM
        | RecordKind::ALLOCATION
        | RecordKind::RECOVERY
        | RecordKind::LARGE_ALLOCATION
        | RecordKind::LARGE_RECOVERY => "watch",
        RecordKind::COMPONENT | RecordKind::LARGE_COMPONENT => {
            ["watch/camera", "watch/anomaly"][usize::from(choices.byte() % 2)]
        }
        RecordKind::CONNECTION => "watch/0",
        RecordKind::ASSIGNMENT | RecordKind::LATCH => "watch/camera",
        _ => "",
    };
    let epoch = choices.byte();
    let author = fleet::robot(choices.byte());
    let number = u64::from(epoch & 3);
    let version = Version {
        epoch: (epoch & 4 != 0).then(|| Epoch { number, minted_by: author.clone() }),
        revision: u64::from(choices.byte() % 4),
        term: u64::from(choices.byte() % 4),
        author,
    };
    let value = choices.slice();
    let value = value[..value.len().min(RECORD_BYTES_MAX)].to_vec();
    FleetRecord { key: FleetKey { kind, name: name.into() }, version, value }
}

fuzz_target!(|bytes: &[u8]| {
    let mut choices = Choices(bytes);
    let mut shell = Shell::new(None);
    for number in 0..RECORDS_MAX {
        if choices.is_empty() {
            break;
        }
        let mut record = record(&mut choices);
        if RecordKind::LARGE.contains(&record.key.kind) && !record.value.is_empty() {
            // as a blob that others have
            shell.gift = std::mem::take(&mut record.value);
            record.value = FleetValue::Large(BlobRef::of(&shell.gift)).encode();
        }
        let read = || FleetValue::decode(record.key.kind, &record.value);
        if let Ok(value) = meter::at_most(256 * 1024, read)
            && value != FleetValue::Unknown
        {
            let again = FleetValue::decode(record.key.kind, &value.encode());
            assert_eq!(again.as_ref(), Ok(&value), "written and read again");
        }
        let body = postcard::to_allocvec(&vec![record]).expect("plain data");
        let beat = u64::try_from(number).expect("few") * 400 + 5000;
        let mut datagram = fleet::header(1, Incarnation { counter: 1, nonce: 1 }, beat, 0);
        fleet::put_section(TAG, &body, &mut datagram);
        meter::at_most(16 << 20, || {
            shell.tell(Input::Datagram { from: fleet::address(1), bytes: datagram });
            shell.pass(Duration::from_millis(400));
        });
    }
    shell.pass(Duration::from_secs(9));
});
