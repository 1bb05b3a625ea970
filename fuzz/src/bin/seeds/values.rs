//! Real values: what robots, operators and components say.

use std::path::Path;
use std::time::Duration;

use byteorder::LittleEndian;
use sdr_core::{
    api::{DeployRequest, RoleMoveRequest, RolePolicyRequest},
    brain::Brain,
    effect::{Effect, StoredState},
    fitness::RolePolicy,
    id::ComponentKey,
    input::Input,
    recording::{ComponentSample, ConnectionSample, EventSample, OutputSample, RobotMetrics},
    spec::SystemSpec,
    time::Instant,
};
use sdr_fuzz::protocol::{
    ErrorReport, ExecutionSetup, FromComponent, Order, Reconfigure, ToComponent, encode_line,
};
use sdr_fuzz::{fleet, shell};
use sdr_keys::{KeyId, stream::Request};

const WATCH: &str = "system: watch
components:
  camera: { run: { native: camera }, rate: 15Hz, needs: { memory: 10MB }, parameters: { gain: 1.5, names: [a, b], on: true } }
  anomaly: { run: { native: [anomaly, --fast] }, execute: on-data, after: [camera] }
connections:
  - camera.image -> anomaly.image
";

/// A small system.
fn watch(folder: &Path) -> SystemSpec {
    let read = sdr_files::parse_system("watch.yaml", WATCH, folder);
    read.expect("the system of the seeds is right").spec
}

/// All datagrams of two robots in their first seconds, one of which is told a system.
pub fn talk() -> Vec<Vec<u8>> {
    let start = Instant::from_millis(1000);
    let brain = |number: u8| {
        let mut config = shell::config();
        config.robot = fleet::robot(number);
        config.seeds = vec![fleet::address(3 - number)];
        config.seed = u64::from(number) << 33;
        Brain::new(config, shell::seams(), None, start)
    };
    let mut brains = [brain(1), brain(2)];
    let mut said = Vec::new();
    let mut now = start;
    for step in 0..150 {
        now = now + Duration::from_millis(100);
        for number in 0..2 {
            brains[number].handle(now, Input::Tick);
            if step == 80 && number == 0 {
                let system = watch(Path::new("."));
                brains[0].handle(now, Input::Deploy { request: 1, system });
            }
            while let Some(effect) = brains[number].poll_effect() {
                match effect {
                    Effect::Send { bytes, .. } => {
                        let from = fleet::address(u8::try_from(number).expect("two") + 1);
                        let input = Input::Datagram { from, bytes: bytes.clone() };
                        brains[1 - number].handle(now, input);
                        said.push(bytes);
                    }
                    Effect::Store { ticket, .. } => {
                        brains[number].handle(now, Input::Stored { ticket });
                    }
                    Effect::Plan { plan, problem } => {
                        let result = sdr_alloc::allocate(&problem);
                        brains[number].handle(now, Input::Planned { plan, result });
                    }
                    Effect::Launch(_)
                    | Effect::Ask(_)
                    | Effect::Fetch { .. }
                    | Effect::Command { .. }
                    | Effect::Routes(_)
                    | Effect::Answer { .. }
                    | Effect::Event(_) => {}
                }
            }
        }
    }
    said
}

/// What a robot with that system has on its disk.
pub fn state(folder: &Path) -> StoredState {
    let start = Instant::from_millis(1000);
    let mut brain = Brain::new(shell::config(), shell::seams(), None, start);
    let mut now = start;
    let mut last = StoredState::default();
    for step in 0..120 {
        now = now + Duration::from_millis(100);
        brain.handle(now, Input::Tick);
        if step == 90 {
            brain.handle(now, Input::Deploy { request: 1, system: watch(folder) });
        }
        while let Some(effect) = brain.poll_effect() {
            if let Effect::Store { ticket, change } = effect {
                last.take(change);
                brain.handle(now, Input::Stored { ticket });
            } else if let Effect::Plan { plan, problem } = effect {
                let result = sdr_alloc::allocate(&problem);
                brain.handle(now, Input::Planned { plan, result });
            }
        }
    }
    last.peers = vec![fleet::address(1), fleet::address(2)];
    last.runs = [(key("watch", "camera"), 7)].into();
    last
}

fn key(system: &str, component: &str) -> ComponentKey {
    let name = |word| sdr_core::id::Name::new(word).expect("a name");
    ComponentKey::new(&name(system), &name(component))
}

/// Requests on streams.
pub fn requests() -> Vec<Vec<u8>> {
    let blob = Request::Blob { hash: [7; 32], offset: 4096 };
    vec![blob.encode(), Request::Key { have: KeyId(3) }.encode(), vec![1, 40, 0, 0, 9]]
}

/// Bodies of requests, each behind its kind.
pub fn bodies(folder: &Path) -> Vec<Vec<u8>> {
    fn body<T: serde::Serialize>(kind: u8, value: &T) -> Vec<u8> {
        let text = serde_json::to_vec(value).expect("plain data");
        [&[kind][..], &text].concat()
    }
    let delivery =
        br#"{"papers":"sdr1 keys fleet=moon key=1 check=00 denied=0 sig=00","key":"1 00"}"#;
    vec![
        body(0, &DeployRequest { system: watch(folder) }),
        body(1, &RoleMoveRequest { to: fleet::robot(0) }),
        body(2, &RolePolicyRequest { policy: RolePolicy::default() }),
        [&[3][..], delivery].concat(),
        b"\x04watch".to_vec(),
    ]
}

/// Lines of components and agents; those of components are the ones of the protocol's page.
pub fn lines() -> Vec<Vec<u8>> {
    let page = include_str!("../../../../docs/protocol.md");
    let shown = page.split("```json\n").skip(1).filter_map(|rest| rest.split("```").next());
    let mut seeds = Vec::new();
    for block in shown {
        for kind in 0..2 {
            let one_line = block.replace('\n', "") + "\n";
            seeds.push([&[kind, 255, 0][..], one_line.as_bytes()].concat());
        }
    }
    let error = ErrorReport { message: "line 3: nonsense".into() };
    let execution = Some(ExecutionSetup::OnData);
    let reconfigure = Reconfigure { parameters: Default::default(), execution };
    for message in [
        ToComponent::Error(error.clone()),
        ToComponent::Command(Order::Deactivate),
        ToComponent::Reconfigure(reconfigure),
    ] {
        let line = encode_line(&message).expect("short");
        seeds.push([&[1, 9, 0][..], &line].concat());
    }
    let line = encode_line(&FromComponent::Error(error)).expect("short");
    seeds.push([&[0, 200, 0][..], &line, &line].concat());
    seeds.push(b"\x02\0\0exploration/anomaly@robot-1".to_vec());
    seeds
}

/// The body of a recorded message of one of [`sdr_fuzz::recordings::TYPES`].
pub fn recorded(kind: usize) -> Vec<u8> {
    fn cdr<T: serde::Serialize>(value: &T) -> Vec<u8> {
        let body = cdr_encoding::to_vec::<T, LittleEndian>(value).expect("plain data");
        [&[0, 1, 0, 0][..], &body].concat()
    }
    match kind {
        0 => cdr(&RobotMetrics { robot: "robot-1".into(), ..RobotMetrics::default() }),
        1 => cdr(&ComponentSample::default()),
        2 => cdr(&ConnectionSample::default()),
        3 => cdr(&OutputSample::default()),
        4 => cdr(&EventSample { kind: "deployed".into(), ..EventSample::default() }),
        5 => cdr(&((7, 8_u32), "map", "base", 1.5_f64, 2.5_f64)),
        _ => cdr(&true),
    }
}

/// The repository's own systems and policies, each behind its kind.
pub fn yaml(root: &Path) -> std::io::Result<Vec<Vec<u8>>> {
    let mut seeds = vec![[&[0][..], WATCH.as_bytes()].concat()];
    let folders = [(0, "systems"), (1, "policies/allocation"), (2, "policies/recovery")];
    for (kind, folder) in folders.into_iter().chain([(3, "policies/role")]) {
        for entry in std::fs::read_dir(root.join(folder)).into_iter().flatten() {
            let text = std::fs::read(entry?.path())?;
            seeds.push([&[kind][..], &text].concat());
        }
    }
    Ok(seeds)
}

/// The shortest robot.toml, and a long one.
pub fn toml() -> Vec<Vec<u8>> {
    let short = "[robot]\nname = \"robot-7\"\n[mesh]\nkeys = \"/etc/sdr/keys\"\n";
    let long = r#"[robot]
name = "robot-1"
labels = ["red", "indoor"]
devices = { camera = "/dev/video0" }
coordinator = "preferred"
[capacity]
memory = "1.9GB"
cpu = "400%"
reserve_memory = "150MB"
[mesh]
unsealed = true
listen = "127.0.0.1:7601"
seeds = ["127.0.0.1:7602", "localhost:7603"]
gone_after = "4s"
[radio]
rssi = { file = "/tmp/wireless" }
[sensors]
battery = { power_supply = "BAT0" }
position = { port = "exploration.position.pose" }
[components]
path = ["/opt/sdr/components", "~/ws"]
on_agent_death = "stop"
[ros]
domain_id = 3
[api]
socket = "r.sock"
listen = "0.0.0.0:7601"
[storage]
state = "r"
recordings = { dir = "rec", max = "2GB" }
logs = { max = "50MB", each = "5MB" }
[log]
level = "info"
"#;
    vec![short.into(), long.into()]
}
