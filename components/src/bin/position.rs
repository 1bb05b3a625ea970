//! Says where the rover is: see `components/position/README.md`.

use std::process::ExitCode;

use sdr_components::programs::PositionEstimation;

fn main() -> ExitCode {
    sdr_component::run::<PositionEstimation>()
}
