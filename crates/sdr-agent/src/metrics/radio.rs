//! The radio level from a file in the format of /proc/net/wireless.

use std::fs;
use std::path::{Path, PathBuf};

use sdr_core::units::Dbm;

/// Where the level is read.
#[derive(Clone, Debug)]
pub(crate) struct Radio {
    /// The file.
    pub(crate) file: PathBuf,
    /// The line; the first one when there is no name.
    pub(crate) interface: Option<String>,
}

impl Radio {
    /// The level now; `None` when nobody can tell.
    pub(super) fn level(&self) -> Option<Dbm> {
        level_in(&self.file, self.interface.as_deref())
    }
}

fn level_in(file: &Path, interface: Option<&str>) -> Option<Dbm> {
    parse_level(&fs::read_to_string(file).ok()?, interface)
}

/// Third column behind the interface's name; 0 and what is no level are unknown.
fn parse_level(text: &str, interface: Option<&str>) -> Option<Dbm> {
    let fields = text.lines().find_map(|line| {
        let (name, fields) = line.split_once(':')?;
        let wanted = interface.is_none_or(|interface| interface == name.trim());
        wanted.then_some(fields)
    })?;
    let word = fields.split_ascii_whitespace().nth(2)?.trim_end_matches('.');
    let level: f64 = word.parse().ok()?;
    // Some drivers print the level as an unsigned byte.
    let level = if level > 63.0 { level - 256.0 } else { level };
    if !(-150.0..0.0).contains(&level) {
        return None;
    }
    #[expect(clippy::cast_possible_truncation, reason = "between -1500 and 0")]
    let tenths = (level * 10.0).round() as i16;
    Some(Dbm::from_tenths(tenths))
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &str = "Inter-| sta-|   Quality        |   Discarded packets               | Missed | WE\n \
                        face | tus | link level noise |  nwid  crypt   frag  retry   misc | beacon | 22\n";

    fn parse(line: &str, interface: Option<&str>) -> Option<i16> {
        parse_level(&format!("{HEAD}{line}"), interface).map(Dbm::tenths)
    }

    #[test]
    fn the_level_is_the_third_figure_of_the_interface() {
        let line = " wlan0: 0000   54.  -56.  -256        0      0      0      0      0        0\n";
        assert_eq!(parse(line, Some("wlan0")), Some(-560));
        assert_eq!(parse(line, None), Some(-560));
        assert_eq!(parse(line, Some("wlan1")), None);
        assert_eq!(parse(" wlan1: 0000   54.  -52.5  -95.  0\n", Some("wlan1")), Some(-525));
        assert_eq!(parse("wlp3s0:0000   40.  200.  161.  0\n", None), Some(-560));
    }

    #[test]
    fn zero_and_nonsense_are_unknown() {
        for line in ["", " wlan0: 0000 54. 0. -95.\n", " wlan0: 0000\n", " wlan0: 0000 54. x. 0\n"]
        {
            assert_eq!(parse(line, None), None, "{line:?}");
        }
        assert_eq!(parse(" wlan0: 0000 54. NaN 0\n", None), None);
        assert_eq!(level_in(Path::new("/nowhere/at/all"), None), None);
    }
}
