//! Waiting, with a limit, and what is said when it was in vain.

use std::time::{Duration, Instant};

use super::{
    super::{board::Step, watch::LOOK_EVERY},
    Story,
};
use crate::{
    failure::Failure,
    render::{
        status::{problems, screen},
        units::one_line,
    },
};

/// How long the robot may take to stop or to go on.
const MOTION_WITHIN: Duration = Duration::from_secs(20);
/// Last lines of each agent that are shown.
const LINES_SHOWN: usize = 8;

impl Story<'_> {
    /// Looks again and again until `done` gives something; too late or with an agent gone it fails
    /// and says what was awaited, the last status and what the agents wrote last.
    pub(super) async fn wait<T>(
        &mut self,
        limit: Duration,
        mut done: impl FnMut(&mut Self) -> Option<T>,
    ) -> Result<T, Failure> {
        let since = Instant::now();
        loop {
            self.watch.look(&self.fleet).await;
            let found = done(self);
            self.board.show(self.session, &self.watch)?;
            if let Some(found) = found {
                return Ok(found);
            }
            let ended = self.fleet.agents.iter_mut().find_map(|agent| {
                agent.ended().map(|status| format!("the agent of {} ended ({status})", agent.robot))
            });
            if let Some(ended) = ended {
                return Err(self.failed(&ended));
            }
            if since.elapsed() >= limit {
                return Err(self.failed(&format!("not within {} s", limit.as_secs())));
            }
            tokio::time::sleep(LOOK_EVERY).await;
        }
    }

    pub(super) async fn let_pass(&mut self, time: Duration) -> Result<(), Failure> {
        let until = Instant::now() + time;
        self.wait(time + MOTION_WITHIN, |story| {
            if story.board.step() == Step::Drive {
                let text = story.driven();
                story.board.doing(text);
            }
            (Instant::now() >= until).then_some(())
        })
        .await
    }

    pub(super) async fn wait_for_motion(&mut self, wanted: bool) -> Result<(), Failure> {
        self.wait(MOTION_WITHIN, |story| {
            let text = story.driven();
            story.board.doing(text);
            let rover = story.stage.driven()?;
            (rover.driving == wanted).then_some(())
        })
        .await
    }

    /// Everything a person needs to see what went wrong.
    fn failed(&self, what: &str) -> Failure {
        let mut lines = vec![format!("awaited in vain ({what}): {}", self.board.awaited())];
        if let Some(status) = self.watch.any() {
            lines.push(format!("last status, seen from {}:", status.seen_from));
            let screen = screen(status, &problems(status), 100);
            lines.extend(screen.into_iter().map(|line| format!("  {line}")));
        }
        for (robot, reason) in &self.watch.unanswered {
            lines.push(format!("{robot} does not answer: {reason}"));
        }
        for agent in &self.fleet.agents {
            lines.push(format!("last lines of the agent of {}:", agent.robot));
            let last = agent.last_lines(LINES_SHOWN).into_iter();
            lines.extend(last.map(|line| format!("  {}", one_line(&line))));
        }
        Failure::new(lines.join("\n"))
    }
}
