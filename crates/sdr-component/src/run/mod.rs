//! `run()`: from the command line to the end of the process.
//!
//! ```text
//!   main thread: Runner                    link thread: Link
//!   waits for inputs, orders, deadlines    reads and writes the agent's socket,
//!   calls the component                    reconnects, counts the time alone
//!          ▲   orders (bounded)   │ words (bounded, the newest win)
//!          └──────────────────────┴── both wake each other by an eventfd
//! ```

mod ballast;
mod door;
mod identity;
mod link;
mod outbox;
mod runner;
mod runner_orders;
mod ticker;
mod wake;

use std::io::Write;
use std::process::ExitCode;

use rustix::mm::{MlockAllFlags, mlockall};

use crate::component::Component;
use crate::protocol::ENV_LOCK_MEMORY;
use crate::setup::Setup;
use identity::Identity;
use link::Link;
use runner::Runner;

/// Runs a component until its agent ends it: the whole `main` of its executable.
///
/// With `--describe` as first argument it prints its profile as JSON and ends. Otherwise the
/// agent's socket and the instance come from the environment (`docs/protocol.md`). Exit codes:
/// 0 ended as told, 1 something failed, 2 started wrongly.
pub fn run<C: Component>() -> ExitCode {
    let mut description = Setup::new::<C>(None);
    if let Err(error) = C::new(&mut description) {
        crate::log(format_args!("{}: cannot describe itself: {error}", C::NAME));
        return ExitCode::from(2);
    }
    let profile = description.profile();
    if std::env::args().nth(1).as_deref() == Some("--describe") {
        return match serde_json::to_string_pretty(&profile) {
            Ok(text) if writeln!(std::io::stdout().lock(), "{text}").is_ok() => ExitCode::SUCCESS,
            Ok(_) | Err(_) => ExitCode::FAILURE,
        };
    }
    let identity = match Identity::from_environment() {
        Ok(identity) => identity,
        Err(reason) => {
            crate::log(format_args!(
                "{0}: {reason}. Components are started by sdr-agent; `{0} --describe` says what \
                 this one is.",
                C::NAME
            ));
            return ExitCode::from(2);
        }
    };
    if std::env::var_os(ENV_LOCK_MEMORY).is_some() {
        let flags = MlockAllFlags::CURRENT | MlockAllFlags::FUTURE | MlockAllFlags::ONFAULT;
        if let Err(error) = mlockall(flags) {
            crate::log(format_args!("{}: memory is not locked: {error}", C::NAME));
        }
    }
    match Link::start(identity.clone(), profile.clone()) {
        Ok(link) => Runner::<C>::new(identity, profile, link).run(),
        Err(error) => {
            crate::log(format_args!("{}: cannot start: {error}", C::NAME));
            ExitCode::FAILURE
        }
    }
}
