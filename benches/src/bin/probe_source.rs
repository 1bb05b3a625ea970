//! The producer of the failover bench: the moment of sending, as often as it is called.

use std::process::ExitCode;

use sdr_benches::monotonic_ns;
use sdr_component::message::std_msgs::UInt64;
use sdr_component::{Component, ComponentError, Context, OutPort, Outcome, Setup};

struct Source {
    tick: OutPort<UInt64>,
}

impl Component for Source {
    const NAME: &'static str = "probe_source";

    fn new(setup: &mut Setup) -> Result<Self, ComponentError> {
        Ok(Self { tick: setup.output("tick")? })
    }

    fn on_execute(&mut self, _: &mut Context<'_>) -> Outcome {
        Ok(self.tick.send(&UInt64 { data: monotonic_ns() })?)
    }
}

fn main() -> ExitCode {
    sdr_component::run::<Source>()
}
