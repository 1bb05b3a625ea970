//! A robot with a few components, figures that can be set, and a driver that wakes the engine
//! at its deadlines only, or at a rate.

#![expect(dead_code, reason = "each test file uses its own part of the builders")]

use std::time::Duration;

use sdr_core::{
    id::{ComponentKey, Name},
    recover::{
        Cause, Evidence, Fault, Recovery, Remedy, RemedyOutcome, RobotEvidence, Spread, Verdict,
    },
    time::Instant,
    units::{Bytes, Dbm, Permille},
};
use sdr_recovery::{
    Bar, Condition, Engine, Fact, Ladder, Level, Limits, Policy, PolicyParts, Restart, Rule, Rung,
};

pub(crate) fn at(millis: u64) -> Instant {
    Instant::from_millis(millis)
}

pub(crate) fn key(word: &str) -> ComponentKey {
    let name = |word| Name::new(word).expect("a name");
    ComponentKey::new(&name("exploration"), &name(word))
}

pub(crate) fn fault(cause: Cause) -> Option<Fault> {
    Some(Fault { cause, reason: "because".into() })
}

/// Everything is well.
pub(crate) fn evidence(word: &str) -> Evidence {
    Evidence {
        component: key(word),
        actuator: false,
        fault: None,
        standby_here: false,
        standby_elsewhere: false,
        memory: Bytes::mega(530),
        cpu: Permille(200),
        cpu_limit: Permille(200),
        deadlines_missed: 0,
        inputs_late: 0,
        told: vec![],
        robot: RobotEvidence {
            memory_free: Some(Bytes::mega(840)),
            cpu: Some(Permille(300)),
            battery: Some(Permille(800)),
            rssi: Some(Dbm::from_tenths(-470)),
            delay: Some(Spread::of_one(Duration::from_millis(5))),
            jitter: Some(Spread::of_one(Duration::from_millis(2))),
            loss: Some(Spread::of_one(Permille(0))),
        },
    }
}

pub(crate) fn signal(tenths: i16) -> Level {
    Level::Signal(Dbm::from_tenths(tenths))
}

/// The paper's Table VI, as `policies/recovery/exploration.yaml` has it.
pub(crate) fn exploration() -> Policy {
    let memory = Condition::new(
        Fact::RobotMemoryFree,
        Bar::AtMost(Level::Memory(Bytes::mega(200))),
        Duration::from_secs(2),
    )
    .clear(Level::Memory(Bytes::mega(250)), Duration::from_secs(5));
    let rssi = Condition::new(Fact::RobotRssi, Bar::AtMost(signal(-525)), Duration::from_secs(6))
        .clear(signal(-500), Duration::from_secs(10));
    let rules = vec![
        Rule::on_condition(Cause::MemoryShort, memory, "local-first"),
        Rule::on_condition(Cause::RssiLow, rssi, "elsewhere"),
    ];
    let parts = Policy::default().parts().clone();
    Policy::new(PolicyParts { name: "exploration".into(), rules, ..parts }).expect("a policy")
}

/// Restart twice, then hold.
pub(crate) fn restart_only(limits: Limits) -> Policy {
    let restart = Restart { tries: 2.try_into().expect("not zero"), ..Restart::default() };
    let ladder = Ladder::new(vec![Rung::Restart(restart), Rung::Hold]).expect("a ladder");
    Policy::new(PolicyParts {
        name: "restart-only".into(),
        ladders: vec![("up".into(), ladder)],
        rules: vec![Rule::on_fault(Cause::Exited, "up")],
        limits,
        exceptions: vec![],
    })
    .expect("a policy")
}

/// One robot as an engine sees it.
pub(crate) struct Scene {
    pub(crate) engine: Engine,
    pub(crate) now: Instant,
    pub(crate) all: Vec<Evidence>,
}

impl Scene {
    pub(crate) fn new(policy: Policy, words: &[&str]) -> Self {
        let all = words.iter().map(|word| evidence(word)).collect();
        Self { engine: Engine::new(policy), now: at(0), all }
    }

    pub(crate) fn robot(&mut self, change: impl Fn(&mut RobotEvidence)) {
        self.all.iter_mut().for_each(|one| change(&mut one.robot));
    }

    pub(crate) fn judge(&mut self) -> Vec<Verdict> {
        let verdicts = self.engine.judge(self.now, &self.all);
        self.all.iter_mut().for_each(|one| one.fault = None);
        verdicts
    }

    pub(crate) fn judge_at(&mut self, millis: u64) -> Vec<Verdict> {
        assert!(at(millis) >= self.now, "time never goes back");
        self.now = at(millis);
        self.judge()
    }

    /// A component fails at `millis`.
    pub(crate) fn fails(&mut self, millis: u64, word: &str, cause: Cause) -> Vec<Verdict> {
        let one = self.all.iter_mut().find(|one| one.component == key(word));
        one.expect("it is there").fault = fault(cause);
        self.judge_at(millis)
    }

    /// Judges at deadlines only, up to and with `millis`; verdicts with their moment.
    pub(crate) fn sleep_until(&mut self, millis: u64) -> Vec<(u64, Verdict)> {
        let mut all = Vec::new();
        while let Some(due) = self.engine.next_deadline().filter(|due| *due <= at(millis)) {
            assert!(due > self.now || self.now == at(0), "no deadline lies in the past");
            self.now = due;
            let verdicts = self.judge();
            all.extend(verdicts.into_iter().map(|one| (due.as_nanos() / 1_000_000, one)));
        }
        self.now = at(millis);
        all
    }

    pub(crate) fn outcome(&mut self, word: &str, outcome: RemedyOutcome) {
        self.engine.outcome(self.now, &key(word), outcome);
    }

    /// The component is gone from here.
    pub(crate) fn leaves(&mut self, word: &str) {
        self.engine.forget(&key(word));
        self.all.retain(|one| one.component != key(word));
    }
}

/// `fisheye: launch-elsewhere`, in the order given.
pub(crate) fn orders(verdicts: &[Verdict]) -> Vec<String> {
    let order = |one: &Verdict| format!("{}: {}", one.component.name, one.remedy.word());
    verdicts.iter().map(order).collect()
}

pub(crate) fn restart_after(millis: u64) -> Remedy {
    Remedy::Restart { after: Duration::from_millis(millis) }
}

/// Normal noise from a seed: twelve uniform numbers make one that is close enough.
pub(crate) struct Noise(pub(crate) u64);

impl Noise {
    /// Tenths of a dBm with a spread of `sigma` tenths.
    pub(crate) fn tenths(&mut self, sigma: f64) -> i16 {
        let sum: f64 = (0..12).map(|_| self.uniform()).sum();
        let tenths = ((sum - 6.0) * sigma).round();
        format!("{tenths}").parse().expect("a few tenths")
    }

    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut word = self.0;
        word = (word ^ (word >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        word = (word ^ (word >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        let small = u32::try_from((word ^ (word >> 31)) >> 32).expect("32 bits");
        f64::from(small) / f64::from(u32::MAX)
    }
}
