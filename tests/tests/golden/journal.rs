//! A journal: what was seen of two components on one robot, and what came of orders.
//!
//! ```text
//! policy policies/recovery/default.yaml
//! 1s robot memory_free 100MB
//! 2s fault anomaly exited signal 9
//! 2s answer anomaly refused
//! 60s end
//! ```

use std::{fmt::Write as _, path::Path, time::Duration};

use sdr_core::{
    id::{ComponentKey, Name},
    recover::{
        Cause, Evidence, Fault, Recovery, Remedy, RemedyOutcome, RobotEvidence, Spread, Verdict,
    },
    time::Instant,
    units::{Bytes, Permille},
};
use sdr_files::units;
use sdr_recovery::Engine;

const WORDS: [&str; 2] = ["fisheye", "anomaly"];

/// What happens, and when.
pub(super) struct Journal {
    engine: Engine,
    all: Vec<Evidence>,
    lines: Vec<(Instant, Vec<String>)>,
}

impl Journal {
    /// Reads a journal; its policy is a file below `root`.
    pub(super) fn read(text: &str, root: &Path) -> Result<Self, String> {
        let mut lines = text.lines().filter(|line| !line.starts_with('#') && !line.is_empty());
        let head = lines.next().and_then(|line| line.strip_prefix("policy "));
        let file = head.ok_or("the first line names no policy")?;
        let policy = sdr_files::load_recovery(&root.join(file)).map_err(|told| told.to_string())?;
        let line = |line: &str| {
            let mut words = line.split_whitespace().map(str::to_owned);
            let at = words.next().ok_or("an empty line")?;
            let at = units::duration(&at).map_err(|error| error.to_string())?;
            Ok((Instant::ZERO + at, words.collect()))
        };
        let lines = lines.map(line).collect::<Result<_, String>>()?;
        Ok(Self { engine: Engine::new(policy), all: WORDS.map(healthy).into(), lines })
    }

    /// The verdicts, a line each.
    pub(super) fn play(mut self) -> String {
        let mut told = String::new();
        self.judge(Instant::ZERO, &mut told);
        for (at, words) in std::mem::take(&mut self.lines) {
            // Between two lines only the engine's own deadlines wake it.
            while let Some(due) = self.engine.next_deadline().filter(|due| *due < at) {
                self.judge(due, &mut told);
            }
            let words: Vec<&str> = words.iter().map(String::as_str).collect();
            self.happen(at, &words);
            self.judge(at, &mut told);
        }
        told
    }

    fn judge(&mut self, now: Instant, told: &mut String) {
        let verdicts = self.engine.judge(now, &self.all);
        self.all.iter_mut().for_each(|one| one.fault = None);
        for verdict in verdicts {
            let _ = writeln!(told, "{}", line(now, &verdict));
        }
    }

    fn happen(&mut self, now: Instant, words: &[&str]) {
        match words {
            ["end"] => {}
            ["robot", fact, value] => {
                self.all.iter_mut().for_each(|one| set_robot(&mut one.robot, fact, value));
            }
            ["fault", who, cause, reason @ ..] => {
                let cause = Cause::from_word(cause).unwrap();
                self.one(who).fault = Some(Fault { cause, reason: reason.join(" ") });
            }
            ["answer", who, answer] => {
                let outcome = match *answer {
                    "done" => RemedyOutcome::Done,
                    "refused" => RemedyOutcome::Refused,
                    other => panic!("no answer: {other}"),
                };
                self.engine.outcome(now, &key(who), outcome);
            }
            ["leaves", who] => {
                self.engine.forget(&key(who));
                self.all.retain(|one| one.component != key(who));
            }
            [who, fact, value] => set_component(self.one(who), fact, value),
            other => panic!("no line of a journal: {other:?}"),
        }
    }

    fn one(&mut self, who: &str) -> &mut Evidence {
        self.all.iter_mut().find(|one| one.component == key(who)).unwrap()
    }
}

fn set_robot(robot: &mut RobotEvidence, fact: &str, value: &str) {
    let time = || Some(Spread::of_one(units::duration(value).unwrap()));
    match fact {
        "memory_free" => robot.memory_free = Some(units::size(value).unwrap()),
        "cpu" => robot.cpu = Some(units::share(value).unwrap()),
        "battery" => robot.battery = Some(units::share(value).unwrap()),
        "rssi" => robot.rssi = Some(units::level(value).unwrap()),
        "delay" => robot.delay = time(),
        "jitter" => robot.jitter = time(),
        "loss" => robot.loss = Some(Spread::of_one(units::share(value).unwrap())),
        other => panic!("no fact of a robot: {other}"),
    }
}

fn set_component(one: &mut Evidence, fact: &str, value: &str) {
    match fact {
        "cpu" => one.cpu = units::share(value).unwrap(),
        "memory" => one.memory = units::size(value).unwrap(),
        "deadlines_missed" => one.deadlines_missed = value.parse().unwrap(),
        "inputs_late" => one.inputs_late = value.parse().unwrap(),
        "standby_here" => one.standby_here = value == "ready",
        "standby_elsewhere" => one.standby_elsewhere = value == "ready",
        "actuator" => one.actuator = value == "yes",
        other => panic!("no fact of a component: {other}"),
    }
}

fn line(now: Instant, verdict: &Verdict) -> String {
    let millis = now.since(Instant::ZERO).as_millis();
    let pause = match verdict.remedy {
        Remedy::Restart { after } => format!(" after {} ms", after.as_millis()),
        Remedy::LocalStandby
        | Remedy::StandbyElsewhere
        | Remedy::LaunchElsewhere
        | Remedy::Hold => String::new(),
    };
    let (who, cause, remedy) = (&verdict.component.name, verdict.cause, verdict.remedy.word());
    format!("{:>9.3} {who} {cause} -> {remedy}{pause}: {}", seconds(millis), verdict.reason)
}

fn seconds(millis: u128) -> f64 {
    Duration::from_millis(u64::try_from(millis).unwrap()).as_secs_f64()
}

fn key(word: &str) -> ComponentKey {
    ComponentKey::new(&Name::new("exploration").unwrap(), &Name::new(word).unwrap())
}

/// A component that is well, on a robot that is well.
fn healthy(word: &str) -> Evidence {
    Evidence {
        component: key(word),
        actuator: false,
        fault: None,
        standby_here: false,
        standby_elsewhere: false,
        memory: Bytes::mega(530),
        cpu: Permille(200),
        cpu_limit: Permille(0),
        deadlines_missed: 0,
        inputs_late: 0,
        told: vec![],
        robot: RobotEvidence {
            memory_free: Some(Bytes::mega(840)),
            cpu: Some(Permille(300)),
            battery: Some(Permille(800)),
            rssi: units::level("-47dBm").ok(),
            delay: Some(Spread::of_one(Duration::from_millis(5))),
            jitter: Some(Spread::of_one(Duration::from_millis(2))),
            loss: Some(Spread::of_one(Permille(0))),
        },
    }
}
