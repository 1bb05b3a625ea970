//! Live progress: on a terminal a frame is drawn over the one before; else only the lines
//! that are new are printed, each behind the seconds since the start.

use std::time::Instant;

use super::units::shorten;
use crate::{failure::Failure, output::Output};

/// What is drawn while something is waited for.
#[derive(Debug)]
pub(crate) struct Progress {
    since: Instant,
    redraw: bool,
    /// Lines of the last frame: as drawn, or as said.
    last: Vec<String>,
    drawn: usize,
}

/// One state of what is waited for.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Frame {
    /// The first line; on a terminal the elapsed time is set behind it.
    pub(crate) head: String,
    /// The others. They hold no running times, so that equal states give equal lines.
    pub(crate) lines: Vec<String>,
}

impl Progress {
    /// Starts the clock.
    pub(crate) fn new(output: &Output) -> Self {
        Self { since: Instant::now(), redraw: output.may_redraw(), last: Vec::new(), drawn: 0 }
    }

    /// Shows the present state; `limit` names how long is waited in all, such as `of 60 s`.
    pub(crate) fn show(
        &mut self,
        output: &Output,
        frame: Frame,
        limit: &str,
    ) -> Result<(), Failure> {
        let elapsed = self.since.elapsed().as_secs_f64();
        let text = match self.redraw {
            true => self.drawing(frame, &format!("{elapsed:.1} s {limit}"), output.size()),
            false => self.saying(frame, elapsed),
        };
        match text.is_empty() {
            true => Ok(()),
            false => output.progress(&text),
        }
    }

    /// Takes what was drawn off the terminal and puts `lines` there; without a terminal they follow
    /// what was said before.
    pub(crate) fn replace(&mut self, output: &Output, lines: &[String]) -> Result<(), Failure> {
        let text = self.replacement(lines);
        output.progress(&text)
    }

    fn replacement(&mut self, lines: &[String]) -> String {
        let back = match std::mem::take(&mut self.drawn) {
            0 => String::new(),
            drawn => format!("\x1b[{drawn}A\r\x1b[J"),
        };
        format!("{back}{}\n", lines.join("\n"))
    }

    /// The frame over the one before; what exceeds the screen is left out and counted.
    fn drawing(&mut self, frame: Frame, time: &str, (columns, rows): (usize, usize)) -> String {
        let width = columns.saturating_sub(1);
        let room = width.saturating_sub(time.len() + 1);
        let mut lines = vec![format!("{:room$} {time}", shorten(&frame.head, room))];
        lines.extend(frame.lines.iter().map(|line| shorten(line, width)));
        let fits = rows.saturating_sub(2).max(2);
        if lines.len() > fits {
            let hidden = lines.len() - (fits - 1);
            lines.truncate(fits - 1);
            lines.push(format!(" ... {hidden} more lines"));
        }
        let back = match self.drawn {
            0 => String::new(),
            drawn => format!("\x1b[{drawn}A\r\x1b[J"),
        };
        self.drawn = lines.len();
        format!("{back}{}\n", lines.join("\n"))
    }

    /// Lines that were not in the frame before.
    fn saying(&mut self, frame: Frame, elapsed: f64) -> String {
        let mut lines = vec![frame.head];
        lines.extend(frame.lines);
        let news = lines.iter().filter(|line| !self.last.contains(line));
        let text = news.map(|line| format!("{elapsed:6.1}  {}\n", line.trim_end())).collect();
        self.last = lines;
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn progress(redraw: bool) -> Progress {
        Progress { since: Instant::now(), redraw, last: Vec::new(), drawn: 0 }
    }

    fn frame(lines: &[&str]) -> Frame {
        Frame { head: "head".into(), lines: lines.iter().map(|line| (*line).into()).collect() }
    }

    #[test]
    fn without_a_terminal_only_news_are_said_behind_their_seconds() {
        let mut progress = progress(false);
        assert_eq!(
            progress.saying(frame(&[" a", " b"]), 0.0),
            "   0.0  head\n   0.0   a\n   0.0   b\n"
        );
        assert_eq!(progress.saying(frame(&[" a", " c"]), 12.34), "  12.3   c\n");
        assert_eq!(progress.saying(frame(&[" a", " c"]), 13.0), "");
    }

    #[test]
    fn on_a_terminal_a_frame_covers_the_one_before_and_fits() {
        let mut progress = progress(true);
        let first = progress.drawing(frame(&["x"; 30]), "1.0 s of 9", (40, 10));
        assert_eq!(first.lines().count(), 8);
        assert!(first.ends_with(" ... 24 more lines\n"), "{first}");
        assert!(first.lines().all(|line| line.chars().count() < 40));
        let second = progress.drawing(frame(&["x"]), "1.1 s of 9", (40, 10));
        assert!(second.starts_with("\x1b[8A\r\x1b[Jhead"), "{second:?}");
        assert_eq!(progress.drawn, 2);
        assert_eq!(progress.replacement(&["end".to_owned()]), "\x1b[2A\r\x1b[Jend\n");
        assert_eq!(progress.replacement(&["more".to_owned()]), "more\n");
    }
}
