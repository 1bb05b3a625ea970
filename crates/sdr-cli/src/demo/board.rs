//! What the terminal shows while the demo runs: 80 columns, 22 lines.

use std::time::Instant;

use super::{ROBOTS, watch::Watch};
use crate::{
    Session,
    failure::Failure,
    render::{
        progress::{Frame, Progress},
        status::is_active,
        units::{NOTHING, level, megabytes, shorten},
    },
    report::extra::Bars,
};

/// Columns of a line.
const COLUMNS: usize = 79;
/// News on the board.
const NEWS_SHOWN: usize = 5;
/// About how long all takes, seconds.
const ABOUT_S: u32 = 30;

/// The steps, in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Step {
    /// Agents come up and meet.
    Fleet,
    /// The system is placed and started.
    Deploy,
    /// The robot drives and stops for the object.
    Drive,
    /// The radio fades and two components move.
    Fade,
    /// Recordings become a report.
    Report,
}

const STEPS: [(Step, &str); 5] = [
    (Step::Fleet, "fleet"),
    (Step::Deploy, "deploy"),
    (Step::Drive, "drive"),
    (Step::Fade, "fade"),
    (Step::Report, "report"),
];

/// See the module.
pub(super) struct Board {
    started: Instant,
    step_since: Instant,
    step: Step,
    done: Vec<(Step, String, f64)>,
    /// What the present step is at, with numbers.
    doing: String,
    /// What is waited for and why; without running numbers.
    waiting: Vec<String>,
    progress: Progress,
    redraw: bool,
    bars: Bars,
}

impl Board {
    /// An empty board; time begins.
    pub(super) fn new(session: &Session, bars: Bars) -> Self {
        let now = Instant::now();
        Self {
            started: now,
            step_since: now,
            step: Step::Fleet,
            done: Vec::new(),
            doing: String::new(),
            waiting: Vec::new(),
            progress: Progress::new(&session.output),
            redraw: session.output.may_redraw(),
            bars,
        }
    }

    /// Says what is waited for and why.
    pub(super) fn wait_for(&mut self, lines: &[String]) {
        self.waiting = lines.to_vec();
    }

    /// The present step.
    pub(super) fn step(&self) -> Step {
        self.step
    }

    /// What is waited for.
    pub(super) fn awaited(&self) -> String {
        self.waiting.join(" ")
    }

    /// Says what the present step is at.
    pub(super) fn doing(&mut self, text: impl Into<String>) {
        self.doing = text.into();
    }

    /// The present step is done, the next begins.
    pub(super) fn finish(&mut self, text: impl Into<String>, next: Step) {
        let took = self.step_since.elapsed().as_secs_f64();
        self.done.push((self.step, text.into(), took));
        self.step = next;
        self.step_since = Instant::now();
        self.doing.clear();
        self.waiting.clear();
    }

    /// Draws it anew.
    pub(super) fn show(&mut self, session: &Session, watch: &Watch) -> Result<(), Failure> {
        let frame = match self.redraw {
            true => self.drawn(watch),
            false => self.plain(watch),
        };
        self.progress.show(&session.output, frame, &format!("of ~{ABOUT_S} s"))
    }

    /// The last screen in its place: on a terminal below what was done, else alone.
    pub(super) fn end(&mut self, session: &Session, lines: &[String]) -> Result<(), Failure> {
        let mut all = Vec::new();
        if self.redraw {
            let took = self.started.elapsed().as_secs_f64();
            all.push(format!("{:<69} {took:6.1} s", "sdr demo"));
            all.extend(self.steps());
        }
        all.extend_from_slice(lines);
        self.progress.replace(&session.output, &all)
    }

    /// Everything, numbers included.
    fn drawn(&self, watch: &Watch) -> Frame {
        let mut lines = self.steps();
        lines.push(String::new());
        lines.extend(self.robots(watch));
        lines.push(String::new());
        lines.push(match self.waiting.first() {
            Some(first) => format!(" waiting for: {first}"),
            None => String::new(),
        });
        lines.push(format!(" {}", self.waiting.get(1).map_or("", String::as_str)));
        lines.push(String::new());
        let news: Vec<String> = watch
            .news
            .iter()
            .rev()
            .take(NEWS_SHOWN)
            .map(|one| {
                let at = one.at.saturating_duration_since(self.started).as_secs_f64();
                shorten(&format!("{at:5.1}  {:<8} {}", one.robot, one.text), COLUMNS)
            })
            .collect();
        let missing = NEWS_SHOWN - news.len();
        lines.extend(news);
        lines.extend((0..missing).map(|_| String::new()));
        lines
            .push(" Ctrl-C stops everything and leaves nothing behind.     * = coordinator".into());
        let number = STEPS.iter().position(|(step, _)| *step == self.step).unwrap_or(0) + 1;
        let head = format!("sdr demo                                     step {number} of 5");
        Frame { head, lines }
    }

    /// What is steady: a line that comes again says nothing new.
    fn plain(&self, watch: &Watch) -> Frame {
        let mut lines: Vec<String> =
            self.done.iter().map(|(step, text, took)| done_line(*step, text, *took)).collect();
        let news = watch.news.iter().map(|one| format!("          {:<8} {}", one.robot, one.text));
        lines.extend(news);
        if let Some(first) = self.waiting.first() {
            lines.push(format!(" waiting for: {first}"));
            lines.extend(self.waiting.iter().skip(1).map(|line| format!("   {line}")));
        }
        let head = "sdr demo: three robots, five components, one fading radio (about 30 s)".into();
        Frame { head, lines }
    }

    fn steps(&self) -> Vec<String> {
        let line = |(step, word): &(Step, &str)| {
            let number = *step as u8 + 1;
            if let Some((_, text, took)) = self.done.iter().find(|one| one.0 == *step) {
                return done_line(*step, text, *took);
            }
            match *step == self.step {
                true => shorten(&format!(" >> {number} {word:<10} {}", self.doing), COLUMNS),
                false => format!("    {number} {word}"),
            }
        };
        STEPS.iter().map(line).collect()
    }

    fn robots(&self, watch: &Watch) -> Vec<String> {
        let mut lines = vec![" ROBOT       FREE MEMORY      BAR   RSSI    COMPONENTS".to_owned()];
        for robot in ROBOTS {
            let Some(view) = watch.itself(robot) else {
                lines.push(format!(" {robot:<9}             -        -        -"));
                continue;
            };
            let coordinator =
                watch.any().is_some_and(|status| status.coordinator.as_deref() == Some(robot));
            let star = if coordinator { '*' } else { ' ' };
            let low = view
                .rssi_dbm
                .zip(self.bars.recovery_rssi_dbm)
                .is_some_and(|(level, bar)| level <= bar);
            let here = watch.any().and_then(|status| status.systems.first());
            let here = here.into_iter().flat_map(|system| &system.components);
            let here = here.filter(|component| component.home.as_deref() == Some(robot));
            let names: Vec<String> = here
                .map(|component| match is_active(component) {
                    true => component.name.clone(),
                    false => format!("({})", component.name),
                })
                .collect();
            let line = format!(
                " {robot:<8}{star}{:>14}{:>9}{:>7} {}  {}",
                megabytes(view.memory_free_bytes),
                self.bars.allocation_memory_bytes.map_or_else(|| NOTHING.to_owned(), megabytes),
                level(view.rssi_dbm),
                if low { '!' } else { ' ' },
                names.join("  ")
            );
            lines.push(shorten(&line, COLUMNS));
        }
        lines
    }
}

fn done_line(step: Step, text: &str, took_s: f64) -> String {
    let word = STEPS.iter().find(|one| one.0 == step).map_or("", |one| one.1);
    let number = step as u8 + 1;
    let line = shorten(&format!(" ok {number} {word:<10} {text}"), COLUMNS - 10);
    format!("{line:<69} {took_s:6.1} s")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        output::{Format, Output},
        render::fixture,
    };

    fn board() -> Board {
        let session = Session { agent: None, keys: None, output: Output::new(Format::Text) };
        let bars = Bars {
            allocation_memory_bytes: Some(500_000_000),
            relaxed_memory_bytes: Some(250_000_000),
            recovery_memory_bytes: Some(200_000_000),
            recovery_rssi_dbm: Some(-52.5),
            recovery_rssi_hold_s: Some(6.0),
        };
        Board::new(&session, bars)
    }

    fn watch() -> Watch {
        let mut watch = Watch::default();
        for robot in ROBOTS {
            watch.statuses.insert(robot, fixture::fleet());
        }
        for number in 0..30 {
            watch.say("robot-1", &format!("news {number} {}", "and more ".repeat(20)));
        }
        watch
    }

    #[test]
    fn a_full_board_fits_a_small_terminal() {
        let mut board = board();
        board.finish("3 agents up on loopback, sealed", Step::Deploy);
        board.doing("x".repeat(200));
        board.wait_for(&["one".to_owned(), "two".to_owned()]);

        let frame = board.drawn(&watch());

        assert!(frame.lines.len() < 22, "{}", frame.lines.len());
        let wide = frame.lines.iter().find(|line| line.chars().count() > COLUMNS);
        assert_eq!(wide, None);
    }

    #[test]
    fn numbers_stand_beside_their_bars_and_a_low_level_is_marked() {
        let text = board().drawn(&watch()).lines.join("\n");
        assert!(text.contains(" robot-1         1898 MB   500 MB  -55.0 !"), "{text}");
        assert!(
            text.contains(" robot-2 *        841 MB   500 MB  -47.1    camera  controller"),
            "{text}"
        );
    }

    #[test]
    fn plain_lines_hold_nothing_that_runs() {
        let mut board = board();
        board.doing("held 4.2 of 6.0 s");
        let frame = board.plain(&Watch::default());
        assert!(frame.lines.is_empty(), "{frame:?}");
    }
}
