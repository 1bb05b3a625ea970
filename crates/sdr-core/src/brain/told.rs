//! Programs of the operator's: asked about components at home here, what they say is evidence.

use alloc::{
    boxed::Box,
    collections::BTreeMap,
    format,
    string::{String, ToString},
    vec::Vec,
};

use super::Brain;
use crate::{
    effect::{Effect, ProgramOrder},
    event::Event,
    id::{ComponentKey, Name},
    input::{Finding, QuestionId},
    recover::{Cause, Evidence, Otherwise, Program, Told},
    time::{Duration, Instant},
};

/// How much longer than its limit a program's answer may take on its way.
const ANSWER_SLACK: Duration = Duration::from_secs(2);
/// Longest reason that is kept, in characters.
const REASON_MAX: usize = 200;

/// What programs were asked and said.
#[derive(Debug, Default)]
pub(super) struct ToldDesk {
    last: QuestionId,
    asked: BTreeMap<(Name, Program), Asked>,
    said: BTreeMap<ComponentKey, Vec<Told>>,
}

#[derive(Debug)]
struct Asked {
    /// The question that is out.
    open: Option<QuestionId>,
    /// When it was asked last.
    since: Instant,
    /// When it is asked next, or given up.
    at: Instant,
    /// The last one failed, which was told.
    failed: bool,
    /// Whom it was asked about, and which causes it may find.
    about: Vec<(ComponentKey, Vec<Cause>)>,
}

impl ToldDesk {
    /// What was said of a component last.
    pub(super) fn of(&self, key: &ComponentKey) -> Vec<Told> {
        self.said.get(key).cloned().unwrap_or_default()
    }

    pub(super) fn next_deadline(&self) -> Option<Instant> {
        self.asked.values().map(|asked| asked.at).min()
    }

    pub(super) fn is_due(&self, now: Instant) -> bool {
        self.next_deadline().is_some_and(|at| now >= at)
    }

    /// Forgets systems that have nothing here any more.
    pub(super) fn keep(&mut self, systems: &[Name]) {
        self.asked.retain(|(system, _), _| systems.contains(system));
        self.said.retain(|key, _| systems.contains(&key.system));
    }

    fn say(&mut self, key: &ComponentKey, told: Told) {
        let said = self.said.entry(key.clone()).or_default();
        said.retain(|before| before.cause != told.cause);
        said.push(told);
    }
}

impl Brain {
    /// Asks the programs of a system's policy whose time has come.
    pub(super) fn ask_programs(&mut self, now: Instant, system: &Name, evidence: Vec<Evidence>) {
        let Some(engine) = self.engines.get(system) else { return };
        let mut wanted: BTreeMap<Program, Vec<(ComponentKey, Vec<Cause>)>> = BTreeMap::new();
        for seen in &evidence {
            for (program, causes) in engine.recovery().programs(&seen.component) {
                wanted.entry(program).or_default().push((seen.component.clone(), causes));
            }
        }
        let desk = &mut self.told;
        desk.asked.retain(|(of, program), _| of != system || wanted.contains_key(program));
        let here = |key: &ComponentKey| evidence.iter().any(|seen| seen.component == *key);
        desk.said.retain(|key, _| key.system != *system || here(key));
        for (program, about) in wanted {
            self.ask_program(now, system, (program, about), &evidence);
        }
    }

    fn ask_program(
        &mut self,
        now: Instant,
        system: &Name,
        (program, about): (Program, Vec<(ComponentKey, Vec<Cause>)>),
        evidence: &[Evidence],
    ) {
        let place = (system.clone(), program.clone());
        let fresh = Asked { open: None, since: now, at: now, failed: false, about: Vec::new() };
        let asked = self.told.asked.entry(place.clone()).or_insert(fresh);
        if now < asked.at {
            return;
        }
        if asked.open.take().is_some() {
            self.fail_program(&place, "no answer from the shell");
        }
        self.told.last += 1;
        let question = self.told.last;
        let concerns = |seen: &&Evidence| about.iter().any(|(key, _)| *key == seen.component);
        let evidence: Vec<Evidence> = evidence.iter().filter(concerns).cloned().collect();
        let limit = program.limit;
        let asked = self.told.asked.get_mut(&place).expect("entered above");
        asked.open = Some(question);
        asked.since = now;
        asked.at = now + program.every.max(limit + ANSWER_SLACK);
        asked.about = about;
        let system = system.clone();
        let order = ProgramOrder { question, program, system, evidence };
        self.effects.push_back(Effect::Ask(Box::new(order)));
    }

    pub(super) fn handle_told(
        &mut self,
        now: Instant,
        question: QuestionId,
        result: Result<Vec<Finding>, String>,
    ) {
        let mut open = self.told.asked.iter_mut();
        let Some((place, asked)) = open.find(|(_, asked)| asked.open == Some(question)) else {
            return;
        };
        asked.open = None;
        asked.at = (asked.since + place.1.every).max(now);
        let place = place.clone();
        let checked = result.and_then(|found| self.check_findings(&place, found));
        match checked {
            Ok(found) => self.take_findings(&place, &found),
            Err(reason) => self.fail_program(&place, &reason),
        }
    }

    /// Findings about somebody else, or of causes that the policy does not know, are an error
    /// of the program: it is better told than half believed.
    fn check_findings(
        &self,
        place: &(Name, Program),
        found: Vec<Finding>,
    ) -> Result<Vec<(ComponentKey, Cause, String)>, String> {
        let about = &self.told.asked[place].about;
        let check = |finding: Finding| {
            let name = &finding.component;
            let of = about.iter().find(|(key, _)| key.name == *name);
            let (key, causes) = of.ok_or_else(|| format!("it was not asked about `{name}`"))?;
            let cause = match (finding.cause, causes.as_slice()) {
                (Some(cause), causes) if causes.contains(&cause) => cause,
                (None, [only]) => *only,
                (Some(cause), _) => {
                    return Err(format!("the policy has no rule of it for {cause}"));
                }
                (None, _) => return Err(format!("it does not say which cause `{name}` has")),
            };
            let reason = finding.reason.chars().take(REASON_MAX).collect();
            Ok((key.clone(), cause, reason))
        };
        found.into_iter().map(check).collect()
    }

    fn take_findings(&mut self, place: &(Name, Program), found: &[(ComponentKey, Cause, String)]) {
        let asked = self.told.asked.get_mut(place).expect("it was asked");
        let mended = core::mem::take(&mut asked.failed);
        let about = asked.about.clone();
        for (key, causes) in about {
            for cause in causes {
                let same = |one: &&(ComponentKey, Cause, String)| one.0 == key && one.1 == cause;
                let said = found.iter().find(same);
                let reason = said.map(|(_, _, reason)| reason.clone()).unwrap_or_default();
                let holds = Some(said.is_some());
                self.told.say(&key, Told { cause, holds, reason });
            }
        }
        if mended {
            let text = format!("{} answers again", words(&place.1));
            self.event("program-answers", text);
        }
    }

    fn fail_program(&mut self, place: &(Name, Program), reason: &str) {
        let program = &place.1;
        let asked = self.told.asked.get_mut(place).expect("it was asked");
        let is_news = !core::mem::replace(&mut asked.failed, true);
        let about = asked.about.clone();
        let (holds, word) = match program.otherwise {
            Otherwise::Ignore => (None, "nothing is concluded"),
            Otherwise::Raise => (Some(true), "its causes are raised"),
            Otherwise::Clear => (Some(false), "its causes are taken back"),
        };
        for (key, causes) in about {
            for cause in causes {
                self.told.say(&key, Told { cause, holds, reason: reason.to_string() });
            }
        }
        if is_news {
            let text = format!("{} of {}: {reason}; {word}", words(program), place.0);
            let event = Event::new("program-failed", &self.me, text);
            self.push_event(event);
        }
    }
}

fn words(program: &Program) -> String {
    program.command.join(" ")
}
