//! The mesh of a few robots over a wire that loses, repeats and spoils.

use alloc::{collections::BTreeMap, format, string::ToString, vec, vec::Vec};
use core::{net::SocketAddr, time::Duration};

use proptest::prelude::*;

use super::*;
use crate::{
    order::Version,
    record::{FleetValue, RecordKind, RoleRecord},
    report::HostReport,
    rng::Rng,
    units::Bytes,
};

const FLEET: u32 = 7;

fn robot(number: usize) -> RobotId {
    RobotId::new(&format!("robot-{number}")).unwrap()
}

fn address(number: usize) -> SocketAddr {
    SocketAddr::from(([127, 0, 0, 1], 7000 + u16::try_from(number).unwrap()))
}

fn mesh(number: usize, robots: usize, counter: u64) -> Mesh {
    let config = MeshConfig {
        robot: robot(number),
        fleet: FLEET,
        seeds: (0..robots).map(address).collect(),
        listen: Some(address(number)),
        period: Duration::from_millis(250),
        gone_after: Duration::from_secs(5),
    };
    let own = Incarnation { counter, nonce: u32::try_from(number).unwrap() };
    Mesh::new(config, own, FleetTable::default(), &[], Instant::ZERO)
}

fn role(holder: usize, term: u64) -> FleetRecord {
    let value = FleetValue::Role(RoleRecord {
        holder: robot(holder),
        term,
        fitness: 1,
        by_operator: false,
    });
    let version = Version { epoch: None, revision: 0, term, author: robot(holder) };
    FleetRecord::new(RecordKind::ROLE, "".into(), version, &value)
}

/// Robots in virtual time, joined by a wire that loses `loss` of 1000 datagrams.
struct Bench {
    meshes: Vec<Option<Mesh>>,
    now: Instant,
    rng: Rng,
    loss: usize,
    last: BTreeMap<usize, Vec<u8>>,
}

impl Bench {
    fn new(robots: usize, loss: usize) -> Self {
        let meshes = (0..robots).map(|number| Some(mesh(number, robots, 1))).collect();
        let rng = Rng::new(11);
        Self { meshes, now: Instant::ZERO, rng, loss, last: BTreeMap::new() }
    }

    fn run(&mut self, time: Duration) {
        let end = self.now + time;
        while self.now < end {
            self.now = self.now + Duration::from_millis(10);
            for mesh in self.meshes.iter_mut().flatten() {
                mesh.handle_tick(self.now);
            }
            self.deliver();
        }
    }

    fn deliver(&mut self) {
        loop {
            let mut flying = Vec::new();
            for (number, mesh) in self.meshes.iter_mut().enumerate() {
                let Some(mesh) = mesh else { continue };
                while let Some((to, bytes)) = mesh.poll_send() {
                    assert!(bytes.len() <= DATAGRAM_BYTES_MAX);
                    self.last.insert(number, bytes.clone());
                    flying.push((address(number), to, bytes));
                }
            }
            if flying.is_empty() {
                return;
            }
            for (from, to, bytes) in flying {
                let number = usize::from(to.port() - 7000);
                let lost = self.rng.below(1000) < self.loss;
                if let (Some(Some(mesh)), false) = (self.meshes.get_mut(number), lost) {
                    mesh.handle_datagram(self.now, from, &bytes);
                }
            }
        }
    }

    fn mesh(&mut self, number: usize) -> &mut Mesh {
        self.meshes[number].as_mut().unwrap()
    }

    fn host_seen(&self, by: usize, of: usize) -> Option<HostReport> {
        let author = self.meshes[by].as_ref().unwrap().authors().author(&robot(of))?;
        author.reports().find_map(|report| match report {
            Report::Host(host) => Some(*host),
            Report::Facts(_)
            | Report::Link(..)
            | Report::Instance(_)
            | Report::Condition(_)
            | Report::Succession(_)
            | Report::Homeless(_) => None,
        })
    }
}

fn host(memory: u64) -> Report {
    Report::Host(HostReport { memory_used: Bytes(memory), ..HostReport::default() })
}

#[test]
fn what_one_robot_says_reaches_all_others_through_heavy_loss() {
    let mut bench = Bench::new(6, 300);
    bench.run(Duration::from_secs(3));

    bench.mesh(0).report(&host(42), Push::Now);
    bench.mesh(3).publish(vec![role(3, 5)]);
    bench.run(Duration::from_secs(6));

    for number in 0..6 {
        assert_eq!(bench.host_seen(number, 0).unwrap().memory_used, Bytes(42));
        let held = bench.mesh(number).fleet().get(RecordKind::ROLE, "").unwrap().0.term;
        assert_eq!(held, 5, "robot-{number}");
        assert_eq!(bench.mesh(number).alive().count(), 5);
    }
}

#[test]
fn many_records_of_one_author_arrive_in_order_and_whole() {
    let mut bench = Bench::new(2, 0);
    let links = |number: usize| Report::Link(robot(100 + number), LinkReport::default());
    for number in 0..300 {
        bench.mesh(0).report(&links(number), Push::WithGossip);
    }
    bench.run(Duration::from_secs(10));

    let seen = bench.meshes[1].as_ref().unwrap().authors().author(&robot(0)).unwrap();
    assert_eq!(seen.reports().count(), 300);
}

#[test]
fn the_greater_version_stays_wherever_it_is_met_first() {
    let mut bench = Bench::new(2, 1000);
    bench.mesh(0).publish(vec![role(0, 3)]);
    bench.mesh(1).publish(vec![role(1, 2)]);
    bench.run(Duration::from_secs(1));
    assert_eq!(bench.mesh(1).fleet().get(RecordKind::ROLE, "").unwrap().0.term, 2);

    bench.loss = 0;
    bench.run(Duration::from_secs(2));
    for number in 0..2 {
        assert_eq!(bench.mesh(number).fleet().get(RecordKind::ROLE, "").unwrap().0.term, 3);
    }
}

#[test]
fn a_silent_robot_is_gone_and_its_old_datagrams_do_not_revive_it() {
    let mut bench = Bench::new(3, 0);
    bench.run(Duration::from_secs(2));
    let replayed = bench.last[&2].clone();
    bench.meshes[2] = None;
    bench.run(Duration::from_secs(7));
    assert!(!bench.mesh(0).is_alive(&robot(2)));

    let now = bench.now;
    bench.mesh(0).handle_datagram(now, address(2), &replayed);
    assert!(!bench.mesh(0).is_alive(&robot(2)));
    assert!(bench.mesh(0).counters().stale > 0);
}

#[test]
fn a_robot_that_lost_its_disk_is_heard_again() {
    let mut bench = Bench::new(3, 0);
    bench.meshes[2] = Some(mesh(2, 3, 9));
    bench.mesh(2).report(&host(1), Push::Now);
    bench.run(Duration::from_secs(2));
    bench.meshes[2] = Some(mesh(2, 3, 1));
    bench.mesh(2).report(&host(2), Push::Now);
    bench.run(Duration::from_secs(3));

    assert_eq!(bench.host_seen(0, 2).unwrap().memory_used, Bytes(2));
    assert!(bench.mesh(2).incarnation().counter > 9);
}

#[test]
fn a_pause_of_the_observer_buries_nobody() {
    let mut bench = Bench::new(2, 0);
    bench.run(Duration::from_secs(2));
    let pause = Duration::from_secs(60);
    let later = bench.now + pause;
    bench.mesh(0).forgive_pause(pause);
    bench.mesh(0).handle_tick(later);
    assert!(bench.mesh(0).is_alive(&robot(1)));
}

#[test]
fn links_are_measured() {
    let mut bench = Bench::new(2, 0);
    bench.run(Duration::from_secs(2));
    let links: Vec<_> = bench.mesh(0).links().map(|(robot, _)| robot.to_string()).collect();
    assert_eq!(links, ["robot-1"]);
}

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
    let beat = (any::<u32>(), 0u16..2048, 0u8..64, 0u8..128);
    (any::<bool>(), proptest::collection::vec(beat, 0..60)).prop_map(|(wide, beats)| {
        let beat = |(id, heartbeat, sequence, age)| Beat {
            id: wire::cut(id, wide),
            heartbeat,
            sequence,
            age,
        };
        Beats { wide, beats: beats.into_iter().map(beat).collect() }
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
        let mut rng = Rng::new(order);
        for index in (1..shuffled.len()).rev() {
            shuffled.swap(index, rng.below(index + 1));
        }
        let (mut one, mut other) = (FleetTable::default(), FleetTable::default());
        records.into_iter().for_each(|record| { one.merge(record); });
        shuffled.into_iter().for_each(|record| { other.merge(record); });

        prop_assert_eq!(one.to_stored(), other.to_stored());
        prop_assert_eq!(one.tree().root(), other.tree().root());
        let again = FleetTable::from_stored(one.to_stored());
        prop_assert_eq!(again.tree().root(), one.tree().root());
    }
}
