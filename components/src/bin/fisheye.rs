//! Takes round pictures: see `components/fisheye/README.md`.

use std::process::ExitCode;

use sdr_components::programs::{Eye, FisheyeCamera};

fn main() -> ExitCode {
    sdr_component::run::<Eye<FisheyeCamera>>()
}
