//! Quantities as people read them.

/// What stands where nothing is known or nothing is to be said.
pub(crate) const NOTHING: &str = "-";

/// `1898 MB`: 10^6 bytes, rounded down, since it is compared with bars.
pub(crate) fn megabytes(bytes: u64) -> String {
    format!("{} MB", bytes / 1_000_000)
}

/// `12 %`.
pub(crate) fn percent(permille: u32) -> String {
    format!("{} %", permille.saturating_add(5) / 10)
}

/// `-47.1`, without its unit, which stands in the head of the column.
pub(crate) fn level(dbm: Option<f64>) -> String {
    dbm.map_or_else(|| NOTHING.into(), |dbm| format!("{dbm:.1}"))
}

/// `0.3 s`, `14 s`, `5 min`, `3 h`: two figures at most.
pub(crate) fn span(ms: u64) -> String {
    match ms {
        0..10_000 => format!("{}.{} s", ms / 1000, ms % 1000 / 100),
        10_000..120_000 => format!("{} s", ms / 1000),
        120_000..7_200_000 => format!("{} min", ms / 60_000),
        7_200_000.. => format!("{} h", ms / 3_600_000),
    }
}

/// `12:03:04.567`, UTC.
pub(crate) fn clock(wall_ms: u64) -> String {
    let seconds = wall_ms / 1000;
    let (hour, minute, second) = (seconds / 3600 % 24, seconds / 60 % 60, seconds % 60);
    format!("{hour:02}:{minute:02}:{second:02}.{:03}", wall_ms % 1000)
}

/// Text on one line and without control characters, which could steer the terminal.
pub(crate) fn one_line(text: &str) -> String {
    let spaced: String = text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    spaced.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// The first `columns` characters, the last three being dots when some are left out.
pub(crate) fn shorten(text: &str, columns: usize) -> String {
    if text.chars().count() <= columns {
        return text.into();
    }
    let kept: String = text.chars().take(columns.saturating_sub(3)).collect();
    format!("{}...", kept.trim_end())
}

/// Whole words in lines of at most `columns`; lines after the first begin with `indent`.
///
/// A word that is longer than a line gets a line of its own and is not cut.
pub(crate) fn wrap(text: &str, columns: usize, indent: &str) -> Vec<String> {
    if text.chars().count() <= columns {
        return vec![text.into()];
    }
    let mut lines: Vec<String> = Vec::new();
    let mut line = String::new();
    let start: String = text.chars().take_while(|c| *c == ' ').collect();
    for word in text.split_whitespace() {
        let fits = line.chars().count() + 1 + word.chars().count() <= columns;
        if line.is_empty() {
            line = format!("{start}{word}");
        } else if fits {
            line.push(' ');
            line.push_str(word);
        } else {
            lines.push(std::mem::replace(&mut line, format!("{indent}{word}")));
        }
    }
    lines.push(line);
    lines
}

/// `1 robot`, `3 robots`.
pub(crate) fn count(number: usize, noun: &str) -> String {
    match number {
        1 => format!("1 {noun}"),
        _ => format!("{number} {noun}s"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantities_keep_their_units_and_two_figures() {
        assert_eq!(megabytes(1_898_900_000), "1898 MB");
        assert_eq!(percent(384), "38 %");
        assert_eq!(level(Some(-54.96)), "-55.0");
        assert_eq!(level(None), "-");
        assert_eq!([300, 14_900, 300_000, 8_000_000].map(span), ["0.3 s", "14 s", "5 min", "2 h"]);
        assert_eq!(clock(1_700_000_000_123), "22:13:20.123");
    }

    #[test]
    fn text_of_others_cannot_steer_the_terminal() {
        assert_eq!(one_line("a\n\tb\u{1b}[2Jc"), "a b [2Jc");
    }

    #[test]
    fn long_sentences_go_on_in_the_next_line() {
        assert_eq!(wrap("! one two three", 9, "  "), ["! one two", "  three"]);
        assert_eq!(wrap("  unbreakable", 5, "  "), ["  unbreakable"]);
    }

    #[test]
    fn what_is_left_out_is_marked() {
        assert_eq!(shorten("fisheye", 7), "fisheye");
        assert_eq!(shorten("fisheyes", 7), "fish...");
    }
}
