//! Takes flat pictures: see `components/camera/README.md`.

use std::process::ExitCode;

use sdr_components::programs::{Eye, PerspectiveCamera};

fn main() -> ExitCode {
    sdr_component::run::<Eye<PerspectiveCamera>>()
}
