//! `run()` in a process of its own, against an agent as small as can be.
#![expect(
    clippy::unwrap_used,
    clippy::wildcard_enum_match_arm,
    reason = "what a test cannot go on without, and words it does not wait for"
)]

mod agent;

use std::time::Duration;

use agent::{Agent, key, token};
use sdr_component::message::{Encode, std_msgs::Int32};
use sdr_component::protocol::{
    ENV_SOCKET, ExecutionSetup, FromComponent, Order, Reconfigure, ToComponent,
};
use sdr_component::shm::{Memory, Publisher, SampleHeader};
use sdr_component::{Component, ComponentError, Context, InPort, OutPort, Outcome, Setup};
use sdr_core::{lifecycle::LifecycleState, order::Token, recover::Cause, spec::Value};

/// Doubles numbers; some of them make it fail.
struct Doubler {
    number: InPort<Int32>,
    double: OutPort<Int32>,
    factor: i64,
}

impl Component for Doubler {
    const NAME: &'static str = "doubler";

    fn new(setup: &mut Setup) -> Result<Self, ComponentError> {
        Ok(Self {
            number: setup.input("number")?,
            double: setup.output("double")?.with_safe(&Int32 { data: 0 })?,
            factor: setup.parameter("factor", 1, "by what")?,
        })
    }

    fn on_initialize(&mut self, _: &mut Context<'_>) -> Outcome {
        if self.factor == 0 { Err(ComponentError::hardware_lost("no factor")) } else { Ok(()) }
    }

    fn on_execute(&mut self, context: &mut Context<'_>) -> Outcome {
        while let Some(sample) = self.number.receive() {
            let number = sample.message()?.data;
            match number {
                -1 => context.raise(Cause::EmergencyStop, "minus one"),
                -2 => panic!("minus two"),
                -3 => context.stop(),
                _ => {}
            }
            let factor = i32::try_from(self.factor)?;
            self.double.send(&Int32 { data: number * factor })?;
        }
        Ok(())
    }

    fn on_parameters_changed(
        &mut self,
        changed: &std::collections::BTreeMap<String, Value>,
        _: &mut Context<'_>,
    ) -> Outcome {
        if let Some(Value::Int(factor)) = changed.get("factor") {
            self.factor = *factor;
        }
        Ok(())
    }
}

/// Not a claim: what the processes of the other tests run.
#[test]
fn the_component_itself() {
    if std::env::var_os(ENV_SOCKET).is_some() {
        let code = sdr_component::run::<Doubler>();
        let is_success = code == std::process::ExitCode::SUCCESS;
        std::process::exit(i32::from(!is_success));
    }
}

fn send(publisher: &Publisher, token: &Token, sequence: u64, data: i32) {
    let message = Int32 { data };
    let mut loan = publisher.loan(message.encoded_len()).unwrap();
    message.encode(loan.payload_mut()).unwrap();
    loan.send(SampleHeader { sequence, ..SampleHeader::new(token) }).unwrap();
}

#[test]
fn a_whole_life_from_greeting_to_the_end_of_the_process() {
    let agent = Agent::new();
    let process = agent.start(None);
    let (mut line, hello) = agent.greet();
    assert_eq!((hello.v, hello.instance, hello.pid), (1, 7, process.id()));
    assert_eq!((hello.component, hello.now.state), (key(), LifecycleState::Created));
    assert_eq!(hello.profile.outputs[0].message_type, "std_msgs/msg/Int32");

    line.say(&ToComponent::Configure(Box::new(agent.configure(ExecutionSetup::OnData))));
    line.until_state(LifecycleState::Inactive);
    let memory = Memory::open(&agent.memory, "test").unwrap();
    let source = memory.publisher("test/source/number", 8, 64).unwrap();
    let doubles = memory.subscriber("test/doubler/double", 8).unwrap();
    line.order(Order::Activate { token: token(4, 2) });
    assert_eq!(line.until_state(LifecycleState::Active).token, Some(token(4, 2)));
    send(&source, &token(1, 1), 1, 21);

    let heard = line.until(|word| match word {
        FromComponent::Heard(heard) => Some(heard),
        _ => None,
    });
    assert_eq!((heard.connection, heard.token), (3, token(1, 1)));
    let counters = line.until(|word| match word {
        FromComponent::Counters(counters) if counters.inputs[0].accepted > 0 => Some(counters),
        _ => None,
    });
    assert_eq!((counters.outputs[0].sent, counters.outputs[0].sent_bytes), (1, 4));
    let beat = line.until(|word| match word {
        FromComponent::Beat(beat) => Some(beat),
        _ => None,
    });
    assert_eq!(beat.ticks, 1);
    let double = doubles.receive().unwrap().unwrap();
    assert_eq!(
        (double.payload(), double.header().token()),
        ([42, 0, 0, 0].as_slice(), Some(token(4, 2)))
    );

    line.order(Order::Deactivate);
    assert_eq!(line.until_state(LifecycleState::Inactive).token, None);
    line.order(Order::Finish);
    line.until_state(LifecycleState::Finalized);
    assert!(process.wait().success());
}

#[test]
fn orders_may_be_repeated_and_older_tokens_are_refused() {
    let agent = Agent::new();
    let (_process, mut line) = agent.prepare(None, ExecutionSetup::OnData);
    for run in [2, 2, 3] {
        line.order(Order::Activate { token: token(1, run) });
        assert_eq!(line.until_state(LifecycleState::Active).token, Some(token(1, run)));
    }

    line.order(Order::Activate { token: token(1, 2) });
    assert!(line.until_error().contains("older"));
    line.order(Order::Reset);
    assert!(line.until_error().contains("while active"));

    for _ in 0..2 {
        line.order(Order::Deactivate);
        line.until_state(LifecycleState::Inactive);
    }
}

#[test]
fn a_raised_fault_and_a_panic_lead_to_the_error_state_with_their_reasons() {
    let agent = Agent::new();
    let (_process, mut line) = agent.prepare(None, ExecutionSetup::Periodic { period_us: 1000 });
    let memory = Memory::open(&agent.memory, "test").unwrap();
    let source = memory.publisher("test/source/number", 8, 64).unwrap();

    for (number, cause, words) in
        [(-1, Cause::EmergencyStop, "minus one"), (-2, Cause::Error, "panic: minus two")]
    {
        line.order(Order::Activate { token: token(1, 1) });
        line.until_state(LifecycleState::Active);
        send(&source, &token(1, 1), 1, number);
        let report = line.until_state(LifecycleState::Error);
        let fault = report.fault.unwrap();
        assert_eq!((fault.cause, report.token), (cause, None));
        assert!(fault.reason.contains(words), "{}", fault.reason);
        line.order(Order::Reset);
        assert_eq!(line.until_state(LifecycleState::Inactive).fault, None);
    }
}

#[test]
fn the_last_sample_of_each_activation_is_the_safe_value() {
    let agent = Agent::new();
    let (process, mut line) = agent.prepare(None, ExecutionSetup::OnData);
    let memory = Memory::open(&agent.memory, "test").unwrap();
    let source = memory.publisher("test/source/number", 8, 64).unwrap();
    let doubles = memory.subscriber("test/doubler/double", 8).unwrap();
    let last = || {
        let sample = std::iter::from_fn(|| doubles.receive().unwrap()).last()?;
        Some((sample.payload().to_vec(), sample.header().run))
    };

    // Raises, panics, is told to deactivate, is told to finish.
    for (run, number) in (1..).zip([-1, -2, 21, 21]) {
        line.order(Order::Activate { token: token(1, run) });
        line.until_state(LifecycleState::Active);
        send(&source, &token(1, run), 1, number);
        if number < 0 {
            line.until_state(LifecycleState::Error);
            line.order(Order::Reset);
            line.until_state(LifecycleState::Inactive);
        } else {
            line.until(|word| matches!(word, FromComponent::Heard(_)).then_some(()));
            line.order(if run == 3 { Order::Deactivate } else { Order::Finish });
            let end = [LifecycleState::Inactive, LifecycleState::Finalized];
            line.until_state(end[usize::from(run == 4)]);
        }
        assert_eq!(last(), Some((vec![0, 0, 0, 0], run)), "activation {run}");
    }
    assert_eq!(last(), None);
    assert!(process.wait().success());
}

#[test]
fn a_fault_is_told_with_the_error_and_not_again_with_the_end() {
    let agent = Agent::new();
    let process = agent.start(None);
    let (mut line, _) = agent.greet();
    let mut configure = agent.configure(ExecutionSetup::OnData);
    configure.parameters.insert(String::from("factor"), Value::Int(0));
    line.say(&ToComponent::Configure(Box::new(configure)));
    assert!(line.until_state(LifecycleState::Error).fault.is_some());

    line.order(Order::Finish);

    assert_eq!(line.until_state(LifecycleState::Finalized).fault, None);
    assert!(process.wait().success());
}

#[test]
fn a_component_that_cannot_initialise_says_why_and_comes_up_after_a_reset() {
    let agent = Agent::new();
    let _process = agent.start(None);
    let (mut line, _) = agent.greet();
    let mut configure = agent.configure(ExecutionSetup::OnData);
    configure.parameters.insert(String::from("factor"), Value::Int(0));
    line.say(&ToComponent::Configure(Box::new(configure)));
    let fault = line.until_state(LifecycleState::Error).fault.unwrap();
    assert_eq!((fault.cause, fault.reason.as_str()), (Cause::HardwareLost, "no factor"));

    let mut change = Reconfigure::default();
    change.parameters.insert(String::from("factor"), Value::Int(3));
    line.say(&ToComponent::Reconfigure(change));
    line.order(Order::Reset);

    line.until_state(LifecycleState::Inactive);
    line.order(Order::Activate { token: token(1, 1) });
    line.until_state(LifecycleState::Active);
}

#[test]
fn a_configuration_that_does_not_fit_is_named() {
    let agent = Agent::new();
    let _process = agent.start(None);
    let (mut line, _) = agent.greet();
    let mut configure = agent.configure(ExecutionSetup::OnData);
    configure.inputs[0].message_type = String::from("sensor_msgs/msg/Image");
    line.say(&ToComponent::Configure(Box::new(configure)));

    let reason = line.until_state(LifecycleState::Error).fault.unwrap().reason;
    assert!(reason.contains("sensor_msgs/msg/Image; it reads std_msgs/msg/Int32"), "{reason}");
}

#[test]
fn garbage_is_answered_and_the_component_comes_back_unharmed() {
    let agent = Agent::new();
    let (_process, mut line) = agent.prepare(None, ExecutionSetup::OnData);
    line.order(Order::Activate { token: token(1, 1) });
    line.until_state(LifecycleState::Active);

    line.say_bytes(b"{\"type\":\"sing\"}\n");

    assert!(line.until_error().contains("sing"));
    while line.try_next().is_some() {}
    let (_line, hello) = agent.greet();
    assert_eq!(hello.now.state, LifecycleState::Active);
    assert_eq!(hello.now.token, Some(token(1, 1)));
}

#[test]
fn a_component_outlives_its_agent_and_greets_the_next_one_with_what_it_knows() {
    let agent = Agent::new();
    let (_process, mut line) = agent.prepare(None, ExecutionSetup::OnData);
    let memory = Memory::open(&agent.memory, "test").unwrap();
    let source = memory.publisher("test/source/number", 8, 64).unwrap();
    let doubles = memory.subscriber("test/doubler/double", 8).unwrap();
    line.order(Order::Activate { token: token(1, 1) });
    line.until_state(LifecycleState::Active);
    send(&source, &token(5, 1), 1, 1);
    line.until(|word| matches!(word, FromComponent::Heard(_)).then_some(()));
    drop(line);

    send(&source, &token(5, 1), 2, 2);
    let (mut line, hello) = agent.greet();
    assert_eq!((hello.now.state, hello.now.token), (LifecycleState::Active, Some(token(1, 1))));
    let heard = line.until(|word| match word {
        FromComponent::Heard(heard) => Some(heard.token),
        _ => None,
    });
    assert_eq!(heard, token(5, 1));
    line.until(|word| match word {
        FromComponent::Counters(counters) => (counters.inputs[0].accepted == 2).then_some(()),
        _ => None,
    });
    assert_eq!(std::iter::from_fn(|| doubles.receive().unwrap()).count(), 2);
}

#[test]
fn a_component_that_must_not_act_alone_deactivates_without_an_agent() {
    let lease = Duration::from_millis(50);
    let mut agent = Agent::new();
    agent.lease = Some(lease);
    let (_process, mut line) = agent.prepare(None, ExecutionSetup::OnData);
    line.order(Order::Activate { token: token(1, 1) });
    line.until_state(LifecycleState::Active);
    drop(line);

    // A busy machine may be late with its lease; it is never early.
    let mut states = (1..=100).map(|times| {
        agent.be_away(lease * times);
        agent.greet().1.now
    });
    let last = states.find(|now| now.state != LifecycleState::Active).unwrap();

    assert_eq!((last.state, last.token), (LifecycleState::Inactive, None));
}

#[test]
fn an_orphan_ends_when_it_was_told_so() {
    let agent = Agent::new();
    let (process, line) = agent.prepare(Some(0), ExecutionSetup::OnData);
    drop(line);
    assert_eq!(process.wait().code(), Some(1));
}

#[test]
fn a_component_may_end_itself() {
    let agent = Agent::new();
    let (process, mut line) = agent.prepare(None, ExecutionSetup::OnData);
    let memory = Memory::open(&agent.memory, "test").unwrap();
    let source = memory.publisher("test/source/number", 8, 64).unwrap();
    line.order(Order::Activate { token: token(1, 1) });
    line.until_state(LifecycleState::Active);
    send(&source, &token(1, 1), 1, -3);
    line.until_state(LifecycleState::Finalized);
    assert!(process.wait().success());
}

#[test]
fn a_component_that_is_killed_again_and_again_finds_its_ports_free() {
    let agent = Agent::new();
    let memory = Memory::open(&agent.memory, "test").unwrap();
    let source = memory.publisher("test/source/number", 8, 64).unwrap();
    let doubles = memory.subscriber("test/doubler/double", 8).unwrap();

    // More often than a port has places for writers.
    for run in 1..=6 {
        let (process, mut line) = agent.prepare(None, ExecutionSetup::OnData);
        line.order(Order::Activate { token: token(1, run) });
        line.until_state(LifecycleState::Active);
        send(&source, &token(1, 1), u64::from(run), 5);
        line.until(|word| match word {
            FromComponent::Counters(counters) => (counters.outputs[0].sent == 1).then_some(()),
            _ => None,
        });
        let double = doubles.receive().unwrap().unwrap();
        assert_eq!(double.header().run, run);
        // Dropping it kills it, without any farewell.
        drop(process);
    }
}
