//! The paper's Table III as data, every row, with bars that suit ordinary Wi-Fi.

use alloc::vec;
use core::time::Duration;

use sdr_core::{
    recover::{Cause, HangLimit},
    units::{Bytes, Dbm, Permille},
};

use crate::{
    condition::{Bar, Condition},
    fact::Fact,
    ladder::{Ladder, Restart, Rung},
    level::Level,
    policy::{Limits, Policy, PolicyParts, Rule, Trigger},
};

const LOCAL_FIRST: &str = "local-first";
const ELSEWHERE: &str = "elsewhere";
const STOP: &str = "stop";

/// The default policy.
pub(crate) fn policy() -> Policy {
    let mut rules = vec![];
    rules.extend(resolved_by_restarting());
    rules.extend(error_with_a_reason());
    rules.extend(bad_robot());
    rules.extend(bad_link());
    rules.push(Rule::on_fault(Cause::RobotGone, ELSEWHERE));
    let ladder = |rungs| Ladder::new(rungs).expect("rungs from mild to severe, hold last");
    let ladders = vec![
        (
            LOCAL_FIRST.into(),
            ladder(vec![
                Rung::LocalStandby,
                Rung::Restart(Restart::default()),
                Rung::StandbyElsewhere,
                Rung::LaunchElsewhere,
                Rung::Hold,
            ]),
        ),
        (ELSEWHERE.into(), ladder(vec![Rung::StandbyElsewhere, Rung::LaunchElsewhere, Rung::Hold])),
        (STOP.into(), ladder(vec![Rung::Hold])),
    ];
    let (limits, exceptions) = (Limits::default(), vec![]);
    let parts = PolicyParts { name: "default".into(), ladders, rules, limits, exceptions };
    Policy::new(parts).expect("the table names its own ladders and units")
}

/// Upper half: try here first.
fn resolved_by_restarting() -> [Rule; 6] {
    let memory = Condition::new(
        Fact::RobotMemoryFree,
        Bar::AtMost(Level::Memory(Bytes::mega(100))),
        Duration::from_secs(2),
    )
    .clear(Level::Memory(Bytes::mega(200)), Duration::from_secs(5));
    let cpu = Condition::new(
        Fact::ComponentCpuOfLimit,
        Bar::AtLeast(Level::Share(Permille(950))),
        Duration::from_secs(10),
    );
    [
        Rule::on_condition(Cause::MemoryShort, memory, LOCAL_FIRST),
        Rule::on_condition(Cause::ComponentCpuHigh, cpu, LOCAL_FIRST),
        Rule::on_fault(Cause::Exited, LOCAL_FIRST),
        Rule {
            trigger: Trigger::Silent(HangLimit::Periods(5)),
            ..Rule::on_fault(Cause::Hung, LOCAL_FIRST)
        },
        Rule::on_fault(Cause::Error, LOCAL_FIRST),
        // Only for connections that have a deadline.
        Rule::on_condition(
            Cause::DeadlineMissed,
            Condition {
                hold: Duration::from_secs(2),
                ..Condition::rate(Fact::DeadlineMisses, 5, Duration::from_secs(1))
            },
            LOCAL_FIRST,
        ),
    ]
}

/// Component in error state, with a reason: leave this robot.
fn error_with_a_reason() -> [Rule; 3] {
    [
        Rule::on_fault(Cause::HardwareLost, ELSEWHERE),
        Rule::on_fault(Cause::AbnormalBehaviour, ELSEWHERE),
        // What drives a body does not start again by itself.
        Rule::on_fault(Cause::EmergencyStop, ELSEWHERE).actuator(STOP),
    ]
}

/// Lower half: the robot is bad.
fn bad_robot() -> [Rule; 2] {
    let battery = Condition::new(
        Fact::RobotBattery,
        Bar::AtMost(Level::Share(Permille(150))),
        Duration::from_secs(10),
    );
    let cpu = Condition::new(
        Fact::RobotCpu,
        Bar::AtLeast(Level::Share(Permille(950))),
        Duration::from_secs(30),
    );
    [
        Rule::on_condition(Cause::BatteryLow, battery, ELSEWHERE),
        Rule::on_condition(Cause::RobotCpuHigh, cpu, ELSEWHERE),
    ]
}

/// Lower half: its link is bad, four rows.
fn bad_link() -> [Rule; 4] {
    let hold = Duration::from_secs(6);
    let signal = |tenths| Level::Signal(Dbm::from_tenths(tenths));
    let rssi = Condition::new(Fact::RobotRssi, Bar::AtMost(signal(-800)), hold)
        .clear(signal(-740), Duration::from_secs(10));
    let time = |millis| Bar::AtLeast(Level::Time(Duration::from_millis(millis)));
    let loss = Bar::AtLeast(Level::Share(Permille(200)));
    [
        Rule::on_condition(Cause::RssiLow, rssi, ELSEWHERE),
        Rule::on_condition(
            Cause::DelayHigh,
            Condition::new(Fact::LinksDelay, time(200), hold),
            ELSEWHERE,
        ),
        Rule::on_condition(
            Cause::JitterHigh,
            Condition::new(Fact::LinksJitter, time(100), hold),
            ELSEWHERE,
        ),
        Rule::on_condition(Cause::LossHigh, Condition::new(Fact::LinksLoss, loss, hold), ELSEWHERE),
    ]
}
