//! Drives and stops: see `components/controller/README.md`.

use std::process::ExitCode;

use sdr_components::programs::MotionController;

fn main() -> ExitCode {
    sdr_component::run::<MotionController>()
}
