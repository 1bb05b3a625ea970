//! Plays a scenario: meet, deploy, then the timeline.

use std::{
    collections::BTreeMap,
    process::ExitCode,
    time::{Duration, Instant},
};

use sdr_files::{Scenario, scenario::Action};
use sdr_lab::world::monotonic_ns;

use super::{
    act::{Hands, Later},
    answer::Told,
    deeds,
    eyes::Eyes,
    fleet::Fleet,
    judged::{Judged, Verdict},
};
use crate::{Session, client::Client, demo::Out, failure::Failure, report::extra::Coordinator};

/// Between two looks at the clock and the fleet.
const ROUND: Duration = Duration::from_millis(10);
/// How long the fleet may take to meet, and each system to run.
const READY_WITHIN: Duration = Duration::from_secs(60);

/// Plays it; exit code 1 when something expected did not come true.
pub(super) async fn play(
    scenario: &Scenario,
    seed: u64,
    out: &Out,
    session: &Session,
) -> Result<ExitCode, Failure> {
    let fleet = Fleet::build(scenario, seed)?;
    let clients = fleet.places.iter().map(|places| Client::at(&places.socket)).collect();
    let eyes = Eyes::open(clients);
    let hands = Hands { scenario, fleet, commands: Vec::new() };
    let mut play = Play {
        hands,
        eyes,
        judged: Judged::default(),
        told: Vec::new(),
        start: Instant::now(),
        coordinator: Coordinator::default(),
        session,
    };
    play.meet().await?;
    play.deploy().await?;
    play.run().await?;
    let ended = play.start.elapsed();
    let answer = play.finish(seed, out, ended).await?;
    Ok(if answer { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// A scenario while it is played.
pub(super) struct Play<'a> {
    pub(super) hands: Hands<'a>,
    pub(super) eyes: Eyes,
    pub(super) judged: Judged<'a>,
    pub(super) told: Vec<Told>,
    start: Instant,
    pub(super) coordinator: Coordinator,
    pub(super) session: &'a Session,
}

impl<'a> Play<'a> {
    fn scenario(&self) -> &'a Scenario {
        self.hands.scenario
    }

    /// Tells a line, and keeps it.
    pub(super) fn tell(&mut self, text: String) -> Result<(), Failure> {
        let at = self.start.elapsed().as_secs_f64();
        self.session.output.progress(&format!("{at:8.2} s  {text}\n"))?;
        self.told.push(Told { at_s: rounded(at), monotonic_ns: monotonic_ns(), text });
        Ok(())
    }

    /// All agents answer, see each other and agree on the wished coordinator.
    async fn meet(&mut self) -> Result<(), Failure> {
        let scenario = self.scenario();
        for index in 0..scenario.robots.len() {
            self.hands.fleet.start_agent(index).map_err(|error| Failure::new(error.to_string()))?;
        }
        let count = scenario.robots.len();
        let wanted = scenario.coordinator.as_ref().map(|robot| robot.to_string());
        let met = |play: &mut Self| {
            let seen = play.eyes.seen();
            let views: Vec<_> = seen.views().collect();
            let holder = views.first()?.coordinator.clone()?;
            let all = views.iter().all(|view| {
                view.coordinator.as_deref() == Some(&holder)
                    && view.robots.iter().filter(|robot| robot.alive).count() == count
            });
            let right = wanted.as_ref().is_none_or(|wanted| *wanted == holder);
            (views.len() == count && all && right).then_some(holder)
        };
        let holder =
            self.wait("agents that see each other and agree on a coordinator", met).await?;
        self.tell(format!(
            "{count} agents up, sealed, each with a wlan0 of its own; coordinator {holder}"
        ))?;
        self.coordinator.at_start = Some(holder);
        Ok(())
    }

    /// The systems of time 0 run.
    async fn deploy(&mut self) -> Result<(), Failure> {
        let scenario = self.scenario();
        for path in &scenario.systems {
            let words = ["deploy".to_owned(), path.display().to_string()];
            let robot = scenario.robots[0].name.clone();
            let action = Action::Sdr { robot, words: words.to_vec(), fails: false };
            self.hands.act(0, &action, &self.eyes)?;
            let Some(command) = self.hands.commands.pop() else { continue };
            let output = command.child.wait_with_output().await?;
            if !output.status.success() {
                let said = String::from_utf8_lossy(&output.stderr).into_owned();
                return Err(Failure::new(format!("{} was refused\n{said}", path.display())));
            }
        }
        if !scenario.systems.is_empty() {
            let count = scenario.systems.len();
            self.wait("systems that are active and heard", |play| {
                let seen = play.eyes.seen();
                let mut views = seen.views();
                views
                    .all(|view| {
                        view.systems.len() == count && view.systems.iter().all(crate::demo::is_up)
                    })
                    .then_some(())
            })
            .await?;
            self.tell("all components active, all connections heard".to_owned())?;
        }
        Ok(())
    }

    /// The timeline, from time 0 on.
    async fn run(&mut self) -> Result<(), Failure> {
        self.start = Instant::now();
        let start_ns = monotonic_ns();
        let scenario = self.scenario();
        let mut steps = scenario.steps.iter().peekable();
        let mut later: BTreeMap<(Duration, u64), Later> = BTreeMap::new();
        let mut number = 0;
        loop {
            let now = self.start.elapsed();
            while let Some(step) = steps.next_if(|step| step.at <= now) {
                let text = deeds::words(&step.what);
                if matches!(step.what, Action::Expect(_)) {
                    // From the moment it is meant, not from when we got to it.
                    self.judged.begin(step, start_ns + whole_ns(step.at));
                } else {
                    self.tell(text)?;
                }
                let did = self.hands.act(step.line, &step.what, &self.eyes);
                let due = did.map_err(|failure| self.at_line(step.line, failure))?;
                if let Some((after, what)) = due {
                    number += 1;
                    later.insert((now + after, number), what);
                }
            }
            while let Some(entry) = later.first_entry().filter(|entry| entry.key().0 <= now) {
                let what = entry.remove();
                self.tell(words_of(&what, scenario))?;
                self.hands.act_later(&what, &self.eyes)?;
            }
            self.look(now)?;
            if now >= scenario.ends && self.judged.is_done() && later.is_empty() {
                return Ok(());
            }
            tokio::time::sleep(ROUND).await;
        }
    }

    fn at_line(&self, line: u32, failure: Failure) -> Failure {
        match failure {
            Failure::Failed(answer) => Failure::new(format!("line {line}: {}", answer.error)),
            Failure::Usage(_) | Failure::Closed => failure,
        }
    }

    /// Judges what is open, collects commands and agents that ended.
    fn look(&mut self, now: Duration) -> Result<(), Failure> {
        let scenario = self.scenario();
        let decided = {
            let seen = self.eyes.seen();
            self.judged.look(scenario, &seen, now)
        };
        for verdict in decided {
            self.tell(verdict_words(&verdict))?;
        }
        for index in 0..self.hands.commands.len() {
            if let Some(status) = self.hands.commands[index].child.try_wait()? {
                let command = &self.hands.commands[index];
                let met = status.success() != command.fails;
                let expected = format!(
                    "sdr {} {}",
                    command.words,
                    if command.fails { "fails" } else { "succeeds" }
                );
                let found = format!("{status}");
                let verdict = Verdict { line: command.line, expected, met, took_ms: None, found };
                self.hands.commands.remove(index);
                self.tell(verdict_words(&verdict))?;
                self.judged.verdicts.push(verdict);
                break;
            }
        }
        self.watch_agents()
    }

    /// An agent that ends without being told to is a defect, whatever was expected.
    fn watch_agents(&mut self) -> Result<(), Failure> {
        for index in 0..self.hands.fleet.bed.robots.len() {
            let robot = &mut self.hands.fleet.bed.robots[index];
            let name = robot.name.clone();
            let Some(status) = robot.agent_ended().map(str::to_owned) else { continue };
            if std::mem::replace(&mut self.hands.fleet.agents_on[index], false) {
                let expected = format!("the agent of {name} runs");
                let found = format!("it ended: {status}\n{}", self.last_lines(index, 12));
                let verdict = Verdict { line: 0, expected, met: false, took_ms: None, found };
                self.tell(verdict_words(&verdict))?;
                self.judged.verdicts.push(verdict);
            }
        }
        Ok(())
    }

    fn last_lines(&self, index: usize, count: usize) -> String {
        let text = std::fs::read(&self.hands.fleet.places[index].log).unwrap_or_default();
        let text = String::from_utf8_lossy(&text);
        let lines: Vec<&str> = text.lines().collect();
        lines[lines.len().saturating_sub(count)..].join("\n")
    }

    /// Looks again and again until `done` gives something.
    async fn wait<T>(
        &mut self,
        what: &str,
        mut done: impl FnMut(&mut Self) -> Option<T>,
    ) -> Result<T, Failure> {
        let since = Instant::now();
        loop {
            if let Some(found) = done(self) {
                return Ok(found);
            }
            self.watch_agents()?;
            let dead = self.judged.verdicts.iter().any(|verdict| !verdict.met);
            if dead || since.elapsed() > READY_WITHIN {
                return Err(self.waited_in_vain(what));
            }
            tokio::time::sleep(ROUND).await;
        }
    }

    fn waited_in_vain(&self, what: &str) -> Failure {
        let mut lines = vec![format!("awaited in vain: {what}")];
        {
            let seen = self.eyes.seen();
            for view in seen.views() {
                lines.push(format!("seen from {}:", view.seen_from));
                let problems = crate::render::problems::problems(view);
                let screen = crate::render::status::screen(view, &problems, 110);
                lines.extend(screen.into_iter().map(|line| format!("  {line}")));
            }
        }
        for (index, robot) in self.scenario().robots.iter().enumerate() {
            lines.push(format!("last lines of the agent of {}:", robot.name));
            lines.push(self.last_lines(index, 8));
        }
        Failure::new(lines.join("\n"))
    }
}

fn words_of(later: &Later, scenario: &Scenario) -> String {
    let names = |robots: &[usize]| {
        robots
            .iter()
            .map(|robot| scenario.robots[*robot].name.to_string())
            .collect::<Vec<_>>()
            .join(", ")
    };
    match later {
        Later::Hear(robots) => format!("{} on the air again", names(robots)),
        Later::Heal(name) => format!("{name} is over"),
        Later::PowerOn(robots) => format!("{} has power again", names(robots)),
    }
}

pub(super) fn verdict_words(verdict: &Verdict) -> String {
    let word = if verdict.met { "ok    " } else { "MISSED" };
    let took =
        verdict.took_ms.map(|ms| format!(" (after {:.2} s)", ms / 1000.0)).unwrap_or_default();
    format!("{word} {}{took}: {}", verdict.expected, verdict.found)
}

fn whole_ns(time: Duration) -> u64 {
    u64::try_from(time.as_nanos()).unwrap_or(u64::MAX)
}

pub(super) fn rounded(seconds: f64) -> f64 {
    (seconds * 1000.0).round() / 1000.0
}
