//! Finds a dangerous object: see `components/anomaly/README.md`.

use std::process::ExitCode;

use sdr_components::programs::Anomaly;

fn main() -> ExitCode {
    sdr_component::run::<Anomaly>()
}
