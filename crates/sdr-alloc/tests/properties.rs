//! Every allocator keeps every promise, on random problems.

mod build;

use std::time::Duration;

use build::{item, name, offer, pair, problem, robot_id, settled, wire};
use proptest::{collection::vec, option, prelude::*, sample::select};
use sdr_alloc::{
    Bars, BatteryBar, BestScore, FirstFit, IfUnknown, Millimetres, Policy, StartWith, Unknown,
    conformance,
};
use sdr_core::{
    allocate::{Allocator, Item, Pair, Problem, RobotOffer, Tier},
    units::{Bytes, Dbm, Permille, Position},
};

const ROBOTS: [&str; 5] = ["robot-1", "robot-2", "robot-3", "robot-4", "robot-5"];
const COMPONENTS: [&str; 6] = ["a", "b", "c", "d", "e", "f"];

fn robot(word: &'static str) -> impl Strategy<Value = RobotOffer> {
    let figures = (0_u64..3000, 0_u32..4000, option::of(0_u32..=1000), option::of(-900_i16..-400));
    let body = (option::of(-40_000_i32..40_000), any::<bool>(), any::<bool>());
    (figures, body).prop_map(move |((memory, cpu, battery, rssi), (x_mm, wheels, can))| {
        RobotOffer {
            memory_free: Bytes::mega(memory),
            cpu_free: Permille(cpu),
            battery: battery.map(Permille),
            rssi: rssi.map(Dbm::from_tenths),
            position: x_mm.map(|x_mm| Position { x_mm, ..Position::default() }),
            devices: if wheels { vec![name("wheels")] } else { vec![] },
            launchables: if can { vec![1, 2] } else { vec![1] },
            ..offer(word)
        }
    })
}

fn component(word: &'static str) -> impl Strategy<Value = Item> {
    let needs = (0_u64..1200, 0_u32..1500, prop::bool::weighted(0.2), 1_u32..=2);
    let others = || vec(select(&COMPONENTS[..]), 0..2);
    let robots = || vec(select(&ROBOTS[..]), 0..2);
    let pin = option::weighted(0.1, select(&ROBOTS[..]));
    (needs, pin, others(), option::weighted(0.2, select(&COMPONENTS[..])), robots(), robots())
        .prop_map(move |((memory, cpu, wheels, launch), pin, apart, with, running, avoid)| {
            let mut item = item(word);
            item.needs.memory = Bytes::mega(memory);
            item.needs.cpu = Permille(cpu);
            item.devices = if wheels { vec![name("wheels")] } else { vec![] };
            item.launch = launch;
            item.place.robot = pin.map(robot_id);
            let not_itself = |other: &&str| *other != word;
            item.place.apart_from = apart.into_iter().filter(not_itself).map(name).collect();
            item.place.together_with = with.iter().copied().filter(not_itself).map(name).collect();
            item.running_on = running.into_iter().map(robot_id).collect();
            item.avoid = avoid.into_iter().map(|word| (robot_id(word), "left".into())).collect();
            item
        })
}

fn unknown<T: Copy + core::fmt::Debug + 'static>(value: T) -> impl Strategy<Value = IfUnknown<T>> {
    select(vec![IfUnknown::Refuse, IfUnknown::Worst, IfUnknown::Assume(value)])
}

fn policy() -> impl Strategy<Value = Policy> {
    let unknown =
        (unknown(Permille(1000)), unknown(Dbm::from_tenths(-600)), unknown(Millimetres(0)))
            .prop_map(|(battery, rssi, distance)| Unknown {
                battery,
                rssi,
                distance,
                jitter: IfUnknown::Worst,
                ..Unknown::default()
            });
    let starts = vec![
        StartWith::Receiver,
        StartWith::Nearest,
        StartWith::List(vec![robot_id("robot-4"), robot_id("robot-2")]),
    ];
    (unknown, select(starts), any::<bool>(), bars(), any::<bool>()).prop_map(
        |(unknown, start_with, reuse_standbys, strict, relaxed)| Policy {
            unknown,
            start_with,
            reuse_standbys,
            strict,
            relaxed: relaxed
                .then(|| Bars { memory_free_at_least: Some(Bytes::mega(50)), ..Bars::none() }),
            ..Policy::default()
        },
    )
}

fn bars() -> impl Strategy<Value = Bars> {
    let robot = (option::of(50_u64..600), option::of(300_u32..1000), option::of(0_u32..600));
    let link = (option::of(-850_i16..-500), option::of(0_u64..60), option::of(0_u64..60_000));
    (robot, link, any::<bool>()).prop_map(
        |((memory, cpu, battery), (rssi, jitter, far), hungry)| Bars {
            memory_free_at_least: memory.map(Bytes::mega),
            cpu_used_at_most: cpu.map(Permille),
            battery_at_least: battery.map(|bar| BatteryBar {
                at_least: Permille(bar),
                if_needs_cpu: hungry.then_some(Permille(700)),
            }),
            rssi_at_least: rssi.map(Dbm::from_tenths),
            jitter_at_most: jitter.map(Duration::from_millis),
            distance_at_most: far.map(Millimetres),
            ..Bars::none()
        },
    )
}

fn pairs() -> impl Strategy<Value = Vec<Pair>> {
    let one = (select(&ROBOTS[..]), select(&ROBOTS[..]), option::of(0_u64..80));
    vec(one, 0..8).prop_map(|pairs| {
        let mut all: Vec<Pair> = Vec::new();
        for (a, b, jitter) in pairs {
            let pair =
                Pair { jitter: jitter.map(Duration::from_millis), ..pair(a.min(b), a.max(b)) };
            if a != b && all.iter().all(|other| (&other.a, &other.b) != (&pair.a, &pair.b)) {
                all.push(pair);
            }
        }
        all
    })
}

fn any_problem() -> impl Strategy<Value = (Policy, Problem)> {
    let robots = ROBOTS.map(robot);
    let items = COMPONENTS.map(component);
    let wires = vec((select(&COMPONENTS[..]), select(&COMPONENTS[..])), 0..8);
    let shape = (any::<bool>(), 0_usize..=5, 0_usize..=6, option::of(select(&ROBOTS[..])));
    (policy(), robots, items, wires, pairs(), shape).prop_map(
        |(policy, robots, items, wires, pairs, (relaxed, robots_count, items_count, home))| {
            let robots = robots.into_iter().take(robots_count).collect();
            let items = items.into_iter().take(items_count).collect();
            let mut problem = problem(&policy, robots, items);
            problem.tier = if relaxed { Tier::Relaxed } else { Tier::Strict };
            problem.connections = wires.into_iter().map(|(from, to)| wire(from, to)).collect();
            problem.pairs = pairs;
            if items_count < COMPONENTS.len() {
                problem.settled = home.into_iter().map(|home| settled("f", home)).collect();
            }
            (policy, problem)
        },
    )
}

proptest! {
    #[test]
    fn every_allocator_keeps_every_promise((policy, problem) in any_problem()) {
        let allocators: [&dyn Allocator; 2] =
            [&FirstFit::new(policy.clone()), &BestScore::new(policy.clone())];
        for allocator in allocators {
            prop_assert_eq!(conformance::check(allocator, &policy, &problem), Ok(()));
        }
    }

    #[test]
    fn a_policy_survives_the_wire(policy in policy()) {
        prop_assert_eq!(Policy::decode(&policy.encode()), policy.check().map(|()| policy));
    }

    #[test]
    fn any_bytes_are_a_policy_or_an_error(bytes in vec(any::<u8>(), 0..200)) {
        let _ = Policy::decode(&sdr_core::spec::PolicyBytes { name: "any".into(), bytes });
    }
}
