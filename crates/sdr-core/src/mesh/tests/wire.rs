//! What comes over the wire, good or bad.

use alloc::{format, vec, vec::Vec};
use core::time::Duration;

use proptest::prelude::*;

use super::{super::*, Bench, FLEET, address, mesh, robot, role};
use crate::record::RecordKind;

#[test]
fn datagrams_of_other_fleets_and_versions_are_counted_and_dropped() {
    let mut bench = Bench::new(2, 0);
    bench.run(Duration::from_secs(1));
    let mut bytes = bench.last[&1].clone();
    let now = bench.now;
    bytes[3] ^= 1;
    bench.mesh(0).handle_datagram(now, address(1), &bytes);
    assert_eq!(bench.mesh(0).counters().foreign, 1);

    bytes[2] = 99;
    bench.mesh(0).handle_datagram(now, address(1), &bytes);
    bench.mesh(0).handle_datagram(now, address(1), &[0; 4000]);
    assert_eq!(bench.mesh(0).counters().malformed, 2);
}

fn any_stamp() -> impl Strategy<Value = Stamp> {
    let numbers = (any::<u64>(), any::<u32>(), any::<u64>(), any::<u64>(), any::<u64>());
    (0usize..9, numbers, any::<bool>()).prop_map(
        |(number, (counter, nonce, heartbeat, sequence, age_ms), told)| Stamp {
            robot: robot(number),
            incarnation: Incarnation { counter, nonce },
            heartbeat,
            sequence,
            age_ms,
            address: told.then(|| address(number)),
        },
    )
}

fn any_beats() -> impl Strategy<Value = Beats> {
    let beat = (any::<u32>(), any::<bool>(), 0u16..1024, 0u8..64, 0u8..128);
    (any::<bool>(), proptest::collection::vec(beat, 0..60)).prop_map(|(wide, beats)| {
        let beat = |(id, odd, heartbeat, sequence, age)| Beat {
            id: wire::cut(id, wide),
            sign: Sign { odd, heartbeat, sequence, age },
        };
        Beats { wide, beats: beats.into_iter().map(beat).collect() }
    })
}

/// Places near each other and far apart, so that there are runs.
fn any_pulse() -> impl Strategy<Value = Pulse> {
    let sign = (any::<bool>(), 0u16..1024, 0u8..64, 0u8..128);
    let place = prop_oneof![0u16..40, any::<u16>(), 65_530u16..=65_535];
    let beats = proptest::collection::btree_map(place, sign, 0..60);
    (any::<(u32, u32, u32)>(), beats).prop_map(|((fleet, roster, names), beats)| {
        let beat = |(place, (odd, heartbeat, sequence, age))| PlacedBeat {
            place,
            sign: Sign { odd, heartbeat, sequence, age },
        };
        let beats = beats.into_iter().map(beat).collect();
        Pulse { summary: Summary { fleet, roster }, names, beats }
    })
}

fn any_mark() -> impl Strategy<Value = LinkMark> {
    let echo = any::<(u16, u32, u8)>().prop_map(|(number, held, loss)| Echo { number, held, loss });
    (any::<u16>(), proptest::option::of(echo)).prop_map(|(number, echo)| LinkMark { number, echo })
}

fn any_delta() -> impl Strategy<Value = AuthorDelta> {
    (any_stamp(), any::<u64>(), proptest::collection::vec(any::<u8>(), 0..40)).prop_map(
        |(stamp, since, value)| AuthorDelta {
            robot: stamp.robot,
            incarnation: stamp.incarnation,
            since,
            sequence: stamp.sequence,
            records: vec![(stamp.sequence, "h".into(), value)],
        },
    )
}

fn any_section() -> impl Strategy<Value = Section> {
    let ids = || proptest::collection::vec(any::<u32>(), 0..20);
    let stamps = || proptest::collection::vec(any_stamp(), 0..4);
    let entries = proptest::collection::vec(any::<(u32, u32)>(), 0..9);
    let robots = proptest::collection::vec((0usize..9).prop_map(robot), 0..5);
    prop_oneof![
        any_mark().prop_map(Section::Link),
        Just(Section::Ping),
        any_beats().prop_map(Section::Beats),
        any_pulse().prop_map(Section::Pulse),
        any::<(u32, u32)>().prop_map(|(fleet, roster)| Section::Summary(Summary { fleet, roster })),
        stamps().prop_map(Section::Stamps),
        (any::<bool>(), ids()).prop_map(|(wide, ids)| Section::AskStamps(AskStamps { wide, ids })),
        proptest::collection::vec(any::<(u32, u64)>(), 0..9).prop_map(Section::AskRecords),
        any_delta().prop_map(Section::AuthorDelta),
        (any::<u16>(), robots)
            .prop_map(|(number, robots)| Section::AskNews(AskNews { number, robots })),
        (any::<u16>(), stamps())
            .prop_map(|(number, stamps)| Section::News(News { number, stamps })),
        (any::<(u32, u32)>(), ids()).prop_map(|((low, high), ids)| Section::Roster(RosterPiece {
            low,
            high,
            ids
        })),
        (0u8..4, any::<u16>(), ids()).prop_map(|(depth, prefix, children)| {
            Section::FleetNodes(FleetNodes { depth, prefix, children })
        }),
        (any::<(u32, u32)>(), entries).prop_map(|((low, high), entries)| {
            Section::FleetEntries(FleetEntries { low, high, entries })
        }),
        ids().prop_map(Section::FleetWanted),
        (0usize..9, any::<u64>()).prop_map(|(h, t)| Section::FleetRecords(vec![role(h, t)])),
        (0usize..9, any::<u64>()).prop_map(|(h, t)| Section::FleetNews(vec![role(h, t)])),
        Just(Section::Peers(vec![address(3)])),
    ]
}

fn any_datagram() -> impl Strategy<Value = Datagram> {
    let header = (any::<u64>(), any::<u32>(), any::<u64>(), any::<u64>()).prop_map(
        |(counter, nonce, heartbeat, sequence)| Header {
            fleet: FLEET,
            from: robot(1),
            incarnation: Incarnation { counter, nonce },
            heartbeat,
            sequence,
        },
    );
    (header, proptest::collection::vec(any_section(), 0..3))
        .prop_map(|(header, sections)| Datagram { header, sections })
}

/// Facts that have greater and lesser versions, some of kinds nobody knows.
fn any_record() -> impl Strategy<Value = FleetRecord> {
    (0usize..4, 0u64..6, 0u64..3, any::<bool>()).prop_map(|(name, term, revision, known)| {
        let mut record = role(name, term);
        record.version.revision = revision;
        if !known {
            record.key.kind = RecordKind(200);
            record.key.name = format!("thing-{name}");
        }
        record
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn a_datagram_survives_the_wire(datagram in any_datagram()) {
        let mut read = Vec::new();
        for bytes in datagram.header.pack(&datagram.sections) {
            let part = Datagram::decode(&bytes, FLEET).unwrap();
            prop_assert_eq!(&part.header, &datagram.header);
            read.extend(part.sections);
        }
        prop_assert_eq!(read, datagram.sections);
    }

    #[test]
    fn no_bytes_at_all_upset_a_mesh(
        noise in proptest::collection::vec(any::<u8>(), 0..1400),
        datagram in any_datagram(),
        spoil in any::<(usize, u8)>(),
        cut in any::<usize>(),
    ) {
        let mut mesh = mesh(0, 3, 1);
        mesh.handle_datagram(Instant::ZERO, address(1), &noise);

        for mut bytes in datagram.header.pack(&datagram.sections) {
            mesh.handle_datagram(Instant::ZERO, address(1), &bytes);
            let place = spoil.0 % bytes.len();
            bytes[place] ^= spoil.1;
            mesh.handle_datagram(Instant::ZERO, address(1), &bytes);
            bytes.truncate(cut % bytes.len());
            mesh.handle_datagram(Instant::ZERO, address(1), &bytes);
        }

        mesh.handle_tick(Instant::from_millis(300));
        mesh.handle_tick(Instant::from_millis(1300));
        while let Some((_, bytes)) = mesh.poll_send() {
            prop_assert!(bytes.len() <= DATAGRAM_BYTES_MAX);
        }
    }

    #[test]
    fn the_order_of_records_does_not_matter(
        records in proptest::collection::vec(any_record(), 0..20),
        order in any::<u64>(),
    ) {
        let mut shuffled = records.clone();
        let mut rng = crate::rng::Rng::new(order);
        for index in (1..shuffled.len()).rev() {
            shuffled.swap(index, rng.below(index + 1));
        }
        let (mut one, mut other) = (FleetTable::default(), FleetTable::default());
        records.into_iter().for_each(|record| { one.merge(record); });
        shuffled.into_iter().for_each(|record| { other.merge(record); });

        prop_assert_eq!(one.facts(), other.facts());
        prop_assert_eq!(one.tree().root(), other.tree().root());
        let again = FleetTable::new(one.facts(), None);
        prop_assert_eq!(again.tree().root(), one.tree().root());
    }
}
