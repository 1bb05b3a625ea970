//! What a component author uses: a trait to fill in, typed ports, `run()`.
//!
//! ```text
//!  sdr-agent ◀── one JSON object a line ──▶ run() ──▶ your Component ──▶ on_execute
//!                (protocol)                  │              │
//!                                            ▼              ▼
//!                           life cycle, deadlines,     InPort, OutPort
//!                           heartbeat, figures         (messages in CDR, fence)
//!                                                           │
//!                                                           ▼
//!                                             shm: iceoryx2, one service a port
//! ```
//!
//! A sample's path: [`OutPort::send`] loans shared memory, writes the ROS 2 encoding in place,
//! stamps it with the token of this activation and wakes the readers; [`InPort::receive`] hands
//! over what the fence let pass, read in place.
//!
//! The contract: all callbacks run on one thread; an instance that is not active never writes;
//! tokens accepted by one connection never decrease; nothing here spins or grows without bound.
//!
//! ```no_run
//! use sdr_component::{Component, ComponentError, Context, InPort, OutPort, Outcome, Setup};
//! use sdr_component::message::std_msgs::{Bool, Float64};
//!
//! struct Alarm { level: InPort<Float64>, alarm: OutPort<Bool>, bar: f64 }
//!
//! impl Component for Alarm {
//!     const NAME: &'static str = "alarm";
//!     fn new(setup: &mut Setup) -> Result<Self, ComponentError> {
//!         let bar = setup.parameter("bar", 0.8, "level from which it is an alarm")?;
//!         Ok(Self { level: setup.input("level")?, alarm: setup.output("alarm")?, bar })
//!     }
//!     fn on_execute(&mut self, _: &mut Context<'_>) -> Outcome {
//!         let Some(level) = self.level.latest() else { return Ok(()) };
//!         Ok(self.alarm.send(&Bool { data: level.message()?.data >= self.bar })?)
//!     }
//! }
//!
//! fn main() -> std::process::ExitCode { sdr_component::run::<Alarm>() }
//! ```

pub mod clock;
mod component;
mod log;
pub mod message;
pub mod port;
pub mod protocol;
mod run;
mod setup;
pub mod shm;
#[expect(unsafe_code, reason = "descriptors, loans and ballast; each call says why it is sound")]
mod sys;
#[cfg(test)]
mod testing;

pub use component::{Component, ComponentError, Context, Outcome};
pub use log::log;
pub use port::{InPort, OutPort, PortError, Received};
pub use run::run;
pub use setup::{Parameter, Setup, SetupError};
