//! The component's side of the protocol, by hand.

use std::env;
use std::io::{self, Read as _, Write as _};
use std::net::Shutdown;
use std::os::unix::net::UnixStream;

use sdr_component::protocol::{
    Beat, Counters, ENV_BADGE, ENV_COMPONENT, ENV_INSTANCE, ENV_ORPHAN_MS, ENV_SOCKET,
    FromComponent, Hello, LineBuffer, Order, PROTOCOL_VERSION, StateReport, ToComponent,
    encode_line,
};
use sdr_core::{
    lifecycle::LifecycleState,
    order::Token,
    recover::{Cause, Fault},
    spec::ComponentProfile,
};

use super::key;

/// Not a test: what `Bench::launch_component` starts.
#[test]
fn the_component_of_these_tests() {
    let Ok(socket) = env::var(ENV_SOCKET) else { return };
    assert_eq!(env::var(ENV_COMPONENT).unwrap(), key().to_string());
    assert!(env::var(ENV_ORPHAN_MS).is_ok_and(|ms| ms == "500") || env::var(ENV_BADGE).is_ok());
    let stream = UnixStream::connect(&socket).unwrap();
    let now = report(LifecycleState::Created, None);
    let mut body = Body { stream, manner: String::new(), now };
    body.greet().unwrap();
    let mut buffer = LineBuffer::default();
    let mut bytes = [0; 4096];
    loop {
        let length = body.stream.read(&mut bytes).unwrap_or(0);
        if length == 0 && !body.endure(&socket) {
            return;
        }
        buffer.push(&bytes[..length]);
        while let Some(message) = buffer.next_message::<ToComponent>().unwrap() {
            body.hear(message);
        }
    }
}

fn hello(now: StateReport) -> Hello {
    let profile = ComponentProfile {
        name: "tests".into(),
        about: String::new(),
        inputs: Vec::new(),
        outputs: Vec::new(),
        parameters: Vec::new(),
        devices: Vec::new(),
    };
    Hello {
        v: PROTOCOL_VERSION,
        component: key(),
        instance: env::var(ENV_INSTANCE).unwrap().parse().unwrap(),
        pid: std::process::id(),
        badge: env::var(ENV_BADGE).ok(),
        profile,
        now,
    }
}

fn report(state: LifecycleState, token: Option<Token>) -> StateReport {
    StateReport { state, token, fault: None }
}

/// The component's side of the protocol, by hand.
struct Body {
    stream: UnixStream,
    manner: String,
    now: StateReport,
}

impl Body {
    fn greet(&mut self) -> io::Result<()> {
        let hello = hello(self.now.clone());
        self.stream.write_all(&encode_line(&FromComponent::Hello(Box::new(hello))).unwrap())
    }

    /// The agent is gone: some wait for the next one, and some do nothing any more.
    fn endure(&mut self, socket: &str) -> bool {
        match self.manner.as_str() {
            "loyal" => {}
            "waiting" | "shy" => loop {
                std::thread::park();
            },
            _ => return false,
        }
        loop {
            if let Ok(stream) = UnixStream::connect(socket) {
                self.stream = stream;
                // The agent that is ending may still have taken it.
                if self.greet().is_ok() {
                    eprintln!("here I am again");
                    return true;
                }
            }
            std::thread::yield_now();
        }
    }

    /// To an agent that may die meanwhile: the next reading finds out.
    fn say(&mut self, message: &FromComponent) {
        let _ = self.stream.write_all(&encode_line(message).unwrap());
    }

    fn hear(&mut self, message: ToComponent) {
        match message {
            ToComponent::Configure(configure) => {
                assert_eq!(configure.devices["wheels"], "/dev/wheels0");
                self.manner = configure.parameters["manner"].to_string();
                self.say(&FromComponent::State(report(LifecycleState::Inactive, None)));
                if self.manner == "gone" {
                    self.stream.shutdown(Shutdown::Both).unwrap();
                    loop {
                        std::thread::park();
                    }
                }
            }
            ToComponent::Command(Order::Activate { .. }) if self.manner == "stubborn" => {}
            ToComponent::Command(Order::Activate { token }) => self.activate(token),
            ToComponent::Command(Order::Finish) if self.manner == "deaf" => {}
            ToComponent::Command(Order::Finish) => std::process::exit(0),
            ToComponent::Command(Order::Deactivate | Order::Reset) => {
                let fault = Fault { cause: Cause::Error, reason: "worn out".into() };
                let state = report(LifecycleState::Error, None);
                self.say(&FromComponent::State(StateReport { fault: Some(fault), ..state }));
            }
            ToComponent::Reconfigure(_) => {}
            ToComponent::Error(error) => {
                // What the agent said is told by the last line of output.
                eprintln!("{}", error.message);
                std::process::exit(3);
            }
        }
    }

    fn activate(&mut self, token: Token) {
        self.now = report(LifecycleState::Active, Some(token));
        self.say(&FromComponent::State(self.now.clone()));
        self.say(&FromComponent::Beat(Beat::default()));
        self.say(&FromComponent::Counters(Counters::default()));
        match self.manner.as_str() {
            "garbage" => self.stream.write_all(b"{\"type\":\"sing\"}\n").unwrap(),
            "crash" => {
                eprintln!("the lidar is on fire");
                std::process::exit(101);
            }
            _ => {}
        }
    }
}
