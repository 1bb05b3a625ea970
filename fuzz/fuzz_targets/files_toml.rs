//! robot.toml as people write it, and as nobody should.
#![no_main]

use libfuzzer_sys::fuzz_target;
use sdr_files::robot::{Places, parse_robot};
use sdr_fuzz::meter;

fuzz_target!(|bytes: &[u8]| {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let places = Places::of_this_process();
    meter::at_most((4 << 20) + 512 * text.len(), || {
        if let Err(problems) = parse_robot("robot.toml", text, &places) {
            assert!(!problems.to_string().is_empty());
        }
    });
});
