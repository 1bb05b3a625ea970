//! Misbehaves on order: see `components/faulty/README.md`.

use std::process::ExitCode;

use sdr_components::faulty::Faulty;

fn main() -> ExitCode {
    sdr_component::run::<Faulty>()
}
