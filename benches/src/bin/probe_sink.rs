//! The consumer of the failover bench: a line in a file for each sample it accepted.

use std::fs::File;
use std::io::Write;
use std::process::ExitCode;

use sdr_benches::monotonic_ns;
use sdr_component::message::std_msgs::UInt64;
use sdr_component::{Component, ComponentError, Context, InPort, Outcome, Setup};

struct Sink {
    tick: InPort<UInt64>,
    path: String,
    file: Option<File>,
}

impl Component for Sink {
    const NAME: &'static str = "probe_sink";

    fn new(setup: &mut Setup) -> Result<Self, ComponentError> {
        let path = setup.parameter("file", String::new(), "where the lines go")?;
        Ok(Self { tick: setup.input("tick")?, path, file: None })
    }

    fn on_initialize(&mut self, _: &mut Context<'_>) -> Outcome {
        self.file = Some(File::options().create(true).append(true).open(&self.path)?);
        Ok(())
    }

    fn on_execute(&mut self, _: &mut Context<'_>) -> Outcome {
        let Some(file) = &mut self.file else { return Ok(()) };
        while let Some(sample) = self.tick.receive() {
            let (header, sent) = (sample.header(), sample.message()?.data);
            let now = monotonic_ns();
            let line =
                format!("{now} {sent} {} {} {}\n", header.epoch, header.run, header.sequence);
            file.write_all(line.as_bytes())?;
        }
        Ok(())
    }
}

fn main() -> ExitCode {
    sdr_component::run::<Sink>()
}
