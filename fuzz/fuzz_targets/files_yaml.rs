//! Systems and policies as people write them, and as nobody should.
#![no_main]

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use sdr_fuzz::{bytes::Choices, meter};

fuzz_target!(|bytes: &[u8]| {
    let mut choices = Choices(bytes);
    let kind = choices.byte();
    let Ok(text) = std::str::from_utf8(choices.rest()) else { return };
    // from a folder that is not there: nothing outside the text is read
    let folder = Path::new("/nowhere");
    meter::at_most((4 << 20) + 512 * text.len(), || {
        let problems = match kind % 4 {
            0 => match sdr_files::parse_system("fuzz.yaml", text, folder) {
                Ok(system) => {
                    system.spec.check().expect("a system that was read is one");
                    None
                }
                Err(problems) => Some(problems),
            },
            1 => sdr_files::parse_allocation("fuzz.yaml", text, folder).err(),
            2 => sdr_files::parse_recovery("fuzz.yaml", text, folder).err(),
            _ => match sdr_files::parse_role("fuzz.yaml", text, folder) {
                Ok(policy) => {
                    let again = sdr_files::role_text(&policy);
                    let again = sdr_files::parse_role("again.yaml", &again, folder);
                    assert_eq!(again.expect("own words can be read"), policy);
                    None
                }
                Err(problems) => Some(problems),
            },
        };
        if let Some(problems) = problems {
            assert!(!problems.to_string().is_empty());
        }
    });
});
