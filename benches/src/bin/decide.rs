//! How long one `handle` of a brain takes, by the size of its fleet: CPU time of this thread
//! around each call, in simulated fleets that come up, deploy, and rest.
//!
//! ```text
//! cargo run --release -p sdr-benches --bin decide              # 10, 100, 300, 1000 robots
//! cargo run --release -p sdr-benches --bin decide -- --robots 100
//! ```

use std::{cell::RefCell, collections::BTreeMap, io, rc::Rc, time::Duration};

use clap::Parser;
use rustix::time::{ClockId, clock_gettime};
use sdr_benches::line;
use sdr_core::{brain::Brain, input::Input, time::Instant};
use sdr_lab::sim::{Fleet, Probe, Setup, systems};

/// Measures `Brain::handle` by fleet size.
#[derive(Debug, Parser)]
struct Args {
    /// Fleets of this size only.
    #[arg(long)]
    robots: Option<usize>,
    /// Everything is drawn from it.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// How long the converged fleet is watched, virtual seconds.
    #[arg(long, default_value_t = 20)]
    seconds: u64,
}

/// Calls by part of the run and by who was called, nanoseconds each.
#[derive(Debug, Default)]
struct Calls {
    part: &'static str,
    took: BTreeMap<(&'static str, &'static str), Vec<u64>>,
}

/// Takes the time of every call.
struct Watch(Rc<RefCell<Calls>>);

impl Probe for Watch {
    fn handle(&mut self, brain: &mut Brain, now: Instant, input: Input) {
        let what = match &input {
            Input::Datagram { .. } => "datagram",
            Input::Tick => "tick",
            Input::Host(_)
            | Input::Facts(_)
            | Input::Usage(_)
            | Input::Instance { .. }
            | Input::Route { .. }
            | Input::Deploy { .. }
            | Input::Undeploy { .. }
            | Input::Reset { .. }
            | Input::Told { .. }
            | Input::Hold { .. }
            | Input::MoveRole { .. }
            | Input::RolePolicy { .. }
            | Input::Planned { .. }
            | Input::Fetched { .. }
            | Input::Stored { .. }
            | Input::StoreFailed { .. } => "other",
        };
        let leads = brain.mesh().fleet().role().is_some_and(|role| brain.robot() == &role.holder);
        let begun = cpu_ns();
        brain.handle(now, input);
        let took = cpu_ns().saturating_sub(begun);
        let calls = &mut *self.0.borrow_mut();
        let who = if leads { "coordinator" } else { what };
        calls.took.entry((calls.part, who)).or_default().push(took);
    }
}

fn main() -> io::Result<()> {
    let args = Args::parse();
    line("| robots | part | called | calls | p50 us | p99 us | p99.9 us | max us |")?;
    line("| --- | --- | --- | --- | --- | --- | --- | --- |")?;
    for robots in [10, 100, 300, 1000] {
        if args.robots.is_none_or(|only| only == robots) {
            measure(robots, &args)?;
        }
    }
    line("bar: 2000 us for any single call (nothing slow happens inside `handle`)")
}

fn measure(robots: usize, args: &Args) -> io::Result<()> {
    let calls = Rc::new(RefCell::new(Calls { part: "start", ..Calls::default() }));
    let mut fleet = Fleet::new(Setup::new(robots, args.seed));
    fleet.probe(Box::new(Watch(Rc::clone(&calls))));
    for robot in 0..robots {
        fleet.keep_disk(robot, false);
        fleet.switch_on(robot);
    }
    fleet.run(Duration::from_secs(15));
    calls.borrow_mut().part = "deploy";
    let needs = systems::fitting(robots, robots, fleet.setup().memory, fleet.setup().cpu);
    for number in 0..robots / 10 {
        let system = systems::chain(systems::name("system", number), 10, needs);
        fleet.deploy(number * 7 % robots, &system);
        fleet.run(Duration::from_millis(50));
    }
    fleet.run(Duration::from_secs(20));
    calls.borrow_mut().part = "rest";
    fleet.run(Duration::from_secs(args.seconds));
    for ((part, who), took) in &mut calls.borrow_mut().took {
        took.sort_unstable();
        let at = |permille: usize| took[(took.len() * permille / 1000).min(took.len() - 1)];
        line(&format!(
            "| {robots} | {part} | {who} | {} | {} | {} | {} | {} |",
            took.len(),
            micros(at(500)),
            micros(at(990)),
            micros(at(999)),
            micros(at(1000)),
        ))?;
    }
    Ok(())
}

fn cpu_ns() -> u64 {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    let part = |part: i64| u64::try_from(part).unwrap_or(0);
    part(time.tv_sec) * 1_000_000_000 + part(time.tv_nsec)
}

fn micros(nanos: u64) -> String {
    format!("{}.{}", nanos / 1000, nanos % 1000 / 100)
}
