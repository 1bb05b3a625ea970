//! The end of a scenario: the fleet stops, the recordings become a report, all is judged.

use std::{
    path::{Path, PathBuf},
    time::Duration,
};

use sdr_files::scenario::{Expectation, Step, Wanted};
use sdr_lab::world::monotonic_ns;

use super::{
    answer::{self, LabAnswer},
    judged::{self, Verdict},
    play::{Play, rounded, verdict_words},
};
use crate::{
    demo::Out,
    failure::Failure,
    output::Format,
    report::{
        Report,
        extra::{self, Extra, Lab},
        machine::Machine,
    },
};

impl Play<'_> {
    /// Ends the fleet, makes the report, judges what it tells; whether all is met.
    pub(super) async fn finish(
        mut self,
        seed: u64,
        out: &Out,
        ended: Duration,
    ) -> Result<bool, Failure> {
        let until_ns = monotonic_ns();
        self.coordinator.at_end = {
            let seen = self.eyes.seen();
            seen.views().next().and_then(|view| view.coordinator.clone())
        };
        self.hands.fleet.stop().await;
        let recordings = self.copy_recordings(out)?;
        let extra = self.extra(until_ns);
        let mut report = Report::make(&recordings, extra)?;
        for (step, expectation, since_ns) in std::mem::take(&mut self.judged.at_end) {
            let verdict = recorded(&report, step, expectation, since_ns, until_ns);
            self.tell(verdict_words(&verdict))?;
            self.judged.verdicts.push(verdict);
        }
        self.judged.verdicts.sort_by_key(|verdict| verdict.line);
        report.extra.lab = Some(self.lab(seed));
        write_json(&out.path().join(extra::FILE), &report.extra)?;
        let page = report.write(out.path())?;
        let met = self.judged.verdicts.iter().all(|verdict| verdict.met);
        let radio = {
            let air = self.hands.fleet.bed.air.lock();
            let names = self.hands.scenario.robots.iter().map(|robot| robot.name.as_str());
            names.zip(air.traffic().iter().copied()).collect()
        };
        let answer = LabAnswer {
            format: answer::FORMAT,
            scenario: &self.hands.scenario.name,
            about: &self.hands.scenario.about,
            seed,
            met,
            duration_s: rounded(ended.as_secs_f64()),
            expectations: &self.judged.verdicts,
            timeline: &self.told,
            radio,
            report: &report.summary,
            out: out.path().display().to_string(),
        };
        write_json(&out.path().join(answer::FILE), &answer)?;
        match self.session.output.format() {
            Format::Json => self.session.output.json(&answer)?,
            Format::Text => self.session.output.line(&self.ending(met, &page))?,
        }
        Ok(met)
    }

    fn ending(&self, met: bool, page: &Path) -> String {
        let all = self.judged.verdicts.len();
        let good = self.judged.verdicts.iter().filter(|verdict| verdict.met).count();
        let word = if met { "met" } else { "MISSED" };
        format!(
            "{} {word}: {good} of {all} expectations\n{}",
            self.hands.scenario.name,
            page.display()
        )
    }

    fn copy_recordings(&self, out: &Out) -> Result<Vec<PathBuf>, Failure> {
        let mut copies = Vec::new();
        for places in &self.hands.fleet.places {
            for entry in std::fs::read_dir(&places.recordings)?.flatten() {
                let to = out.path().join(entry.file_name());
                std::fs::copy(entry.path(), &to)?;
                copies.push(to);
            }
            let name = places.own.file_name().unwrap_or_default().to_string_lossy().into_owned();
            // An agent that never started has no log.
            let _ = std::fs::copy(&places.log, out.path().join(format!("agent-{name}.log")));
        }
        Ok(copies)
    }

    fn extra(&self, until_ns: u64) -> Extra {
        Extra {
            machine: Some(Machine::here()),
            coordinator: self.coordinator.clone(),
            until_ns: Some(until_ns),
            ..Extra::default()
        }
    }

    fn lab(&self, seed: u64) -> Lab {
        Lab {
            scenario: self.hands.scenario.name.clone(),
            about: self.hands.scenario.about.clone(),
            seed,
            timeline: self.told.clone(),
            expectations: self.judged.verdicts.clone(),
        }
    }
}

/// What only the recordings tell.
fn recorded(
    report: &Report,
    step: &Step,
    expectation: &Expectation,
    since_ns: u64,
    until_ns: u64,
) -> Verdict {
    let (met, found) = match &expectation.what {
        Wanted::Lost(connection, most) => match report.figures.samples.get(connection) {
            Some(traffic) => {
                let counts = &traffic.counts;
                (
                    counts.lost <= *most,
                    format!("{} lost, {} received", counts.lost, counts.received),
                )
            }
            None => (false, format!("no sample of {connection} was recorded")),
        },
        Wanted::Pause(connection, most) => {
            let link = report.run.links.get(connection);
            match link.and_then(|link| link.pause(since_ns, until_ns)) {
                Some(pause) => {
                    let longest = Duration::from_nanos(pause.gap_max_ns);
                    (longest <= *most, format!("longest pause {longest:.1?}"))
                }
                None => (false, format!("no sample of {connection} was recorded")),
            }
        }
        Wanted::Home(..)
        | Wanted::State(..)
        | Wanted::Coordinator(..)
        | Wanted::Coordinators(_)
        | Wanted::Seen(..)
        | Wanted::Running
        | Wanted::Unchanged
        | Wanted::Event(_) => (false, "not judged from recordings".to_owned()),
    };
    let expected = judged::words(expectation);
    Verdict { line: step.line, expected, met, took_ms: None, found }
}

fn write_json(path: &Path, value: &impl serde::Serialize) -> Result<(), Failure> {
    let text =
        serde_json::to_string_pretty(value).map_err(|error| Failure::new(error.to_string()))?;
    std::fs::write(path, text)
        .map_err(|error| Failure::new(format!("cannot write {}: {error}", path.display())))
}
