//! A policy in words.

use alloc::{
    format,
    string::{String, ToString},
    vec::Vec,
};
use core::time::Duration;

use sdr_core::recover::{Cause, HangLimit, Otherwise};
use serde::Serialize;

use crate::{
    condition::{Bar, Condition},
    fact::{Fact, Over},
    ladder::{Backoff, Ladder, Rung},
    level::Unit,
    policy::{Limits, Policy, Rule, Trigger},
};

/// A policy as people say it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Explained {
    /// Its name.
    pub policy: String,
    /// For all components without rules of their own.
    pub rules: Vec<ExplainedRule>,
    /// Components with rules of their own: all the rules they have.
    pub components: Vec<ExplainedComponent>,
    /// Bounds over all rules.
    pub limits: Vec<String>,
}

/// One row of the table.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ExplainedRule {
    /// The word of the cause.
    pub cause: String,
    /// When it is raised.
    pub when: String,
    /// When it is over; `None` for what is reported as it happens.
    pub over: Option<String>,
    /// What is tried, in order.
    pub then: Vec<String>,
    /// What is tried with what moves a body, when that is something else.
    pub actuator: Option<Vec<String>>,
}

/// One component with rules of its own.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ExplainedComponent {
    /// Its name.
    pub component: String,
    /// Its rules.
    pub rules: Vec<ExplainedRule>,
    /// Its bounds.
    pub limits: Vec<String>,
}

/// Says in words what `policy` does.
pub fn explain(policy: &Policy) -> Explained {
    let parts = policy.parts();
    let rules_of = |policy: &Policy| -> Vec<ExplainedRule> {
        policy.parts().rules.iter().map(|rule| row(policy, rule)).collect()
    };
    let components = parts.exceptions.iter().map(|exception| {
        let own = policy.for_component(&exception.component);
        ExplainedComponent {
            component: exception.component.clone(),
            rules: rules_of(&own),
            limits: limits(&own.parts().limits),
        }
    });
    Explained {
        policy: parts.name.clone(),
        rules: rules_of(&policy.for_component("")),
        components: components.collect(),
        limits: limits(&parts.limits),
    }
}

fn row(policy: &Policy, rule: &Rule) -> ExplainedRule {
    let (then, for_actuator) = (policy.ladder(rule, false), policy.ladder(rule, true));
    ExplainedRule {
        cause: rule.cause.to_string(),
        when: when(rule),
        over: rule.trigger.condition().map(|condition| over(&condition)),
        then: climb(then),
        actuator: (then != for_actuator).then(|| climb(for_actuator)),
    }
}

fn when(rule: &Rule) -> String {
    match &rule.trigger {
        Trigger::Fault => String::from(reported(rule.cause)),
        Trigger::Silent(HangLimit::Periods(periods)) => {
            format!(
                "its execution thread gives no sign of life for {periods} periods (at least 1 s)"
            )
        }
        Trigger::Silent(HangLimit::Time(time)) => {
            format!("its execution thread gives no sign of life for {}", words(*time))
        }
        Trigger::Lost(time) => {
            format!(
                "nothing was heard of its robot for {}, and nobody else knows more",
                words(*time)
            )
        }
        Trigger::Condition(condition) => measured(condition),
        Trigger::Expression(expression, condition) => {
            format!("`{}` is true{}", expression.source(), held(condition.hold))
        }
        Trigger::Program(program, condition) => {
            let otherwise = match program.otherwise {
                Otherwise::Ignore => "nothing is concluded",
                Otherwise::Raise => "it counts as said",
                Otherwise::Clear => "it counts as not said",
            };
            format!(
                "`{}`, asked each {}, says so{}; without an answer within {} {otherwise}",
                program.command.join(" "),
                words(program.every),
                held(condition.hold),
                words(program.limit),
            )
        }
    }
}

fn reported(cause: Cause) -> &'static str {
    match cause {
        Cause::Exited => "its process ends without being told to, or does not come up",
        Cause::Hung => "its execution thread gives no sign of life",
        Cause::Error => "it goes to its error state without a reason",
        Cause::HardwareLost => "hardware that it needs failed or was disconnected",
        Cause::AbnormalBehaviour => "it says that the robot behaves abnormally",
        Cause::EmergencyStop => "it says that there was an emergency stop",
        Cause::RobotGone => "its robot is not heard any more",
        Cause::MemoryShort
        | Cause::ComponentCpuHigh
        | Cause::BatteryLow
        | Cause::RobotCpuHigh
        | Cause::RssiLow
        | Cause::DelayHigh
        | Cause::JitterHigh
        | Cause::LossHigh
        | Cause::DeadlineMissed
        | Cause::Own(_) => "the component says so",
    }
}

fn measured(condition: &Condition) -> String {
    let fact = named(condition.fact, condition.over);
    let hold = held(condition.hold);
    if condition.fact.unit() == Unit::Rate {
        let per = words(condition.per);
        return format!("{fact}: {} or more within {per}{hold}", condition.bar.level());
    }
    let median = match condition.median_over {
        Duration::ZERO => String::new(),
        window => format!(" (median of {})", words(window)),
    };
    match condition.bar {
        Bar::AtMost(level) => format!("{fact}{median} is at most {level}{hold}"),
        Bar::AtLeast(level) => format!("{fact}{median} is at least {level}{hold}"),
    }
}

fn over(condition: &Condition) -> String {
    let told = condition.fact == Fact::Told;
    match (condition.clear, condition.bar) {
        (None, _) => String::from("as soon as that is not so"),
        (Some(clear), _) if told => format!("when that is not so{}", held(clear.hold)),
        (Some(clear), Bar::AtMost(_)) => {
            format!("when it is at least {}{}", clear.level, held(clear.hold))
        }
        (Some(clear), Bar::AtLeast(_)) => {
            format!("when it is at most {}{}", clear.level, held(clear.hold))
        }
    }
}

fn named(fact: Fact, over: Over) -> String {
    let links = |what: &str| match over {
        Over::Median => format!("{what} over its links (median)"),
        Over::Worst => format!("{what} of its worst link"),
        Over::Best => format!("{what} of its best link"),
    };
    String::from(match fact {
        Fact::RobotMemoryFree => "free memory of the robot",
        Fact::RobotCpu => "CPU used of the robot",
        Fact::RobotBattery => "charge of the robot",
        Fact::RobotRssi => "radio level of the robot",
        Fact::ComponentCpuOfLimit => "CPU of the component, of its declared need or one core,",
        Fact::ComponentCpuOfCore => "CPU of the component, of one core,",
        Fact::ComponentMemory => "memory of the component",
        Fact::LinksDelay => return links("delay"),
        Fact::LinksJitter => return links("jitter"),
        Fact::LinksLoss => return links("loss"),
        Fact::ComponentExits => "exits",
        Fact::ComponentHangs => "hangs",
        Fact::ComponentErrors => "errors",
        Fact::DeadlineMisses => "deadlines of readers on this robot that its outputs miss",
        Fact::InputsLate => "deadlines that its inputs from other robots miss",
        Fact::Told => "what was told",
    })
}

fn climb(ladder: &Ladder) -> Vec<String> {
    let only = ladder.rungs().len() == 1;
    let rung = |rung: &Rung| match rung {
        Rung::LocalStandby => String::from("switch to a standby on this robot, if one is ready"),
        Rung::Restart(restart) => format!(
            "restart it here, {} times at most, {} apart; {} of quiet count as healed",
            restart.tries,
            range(restart.backoff),
            words(restart.settle),
        ),
        Rung::StandbyElsewhere => {
            String::from("switch to a standby on another robot, if one is ready")
        }
        Rung::LaunchElsewhere => String::from("launch it on another robot"),
        Rung::Hold if only => String::from("leave it as it is until somebody resets it"),
        Rung::Hold => String::from("stop trying, and say so"),
    };
    ladder.rungs().iter().map(rung).collect()
}

fn limits(limits: &Limits) -> Vec<String> {
    let prepare = limits.prepare_after.0 / 10;
    let mut lines = Vec::from([
        format!(
            "at most {} moves and {} restarts within any hour, per component",
            limits.moves_per_hour, limits.restarts_per_hour
        ),
        String::from("what moved away does not come back by itself"),
        format!(
            "a robot that was left for a cause is not taken again for {}",
            words(limits.not_back_for)
        ),
        format!(
            "{} of quiet count as healed, where a rung does not say otherwise",
            words(limits.settle)
        ),
        format!("what was refused is asked for again after {}", range(limits.retry)),
        String::from("a figure that nobody can tell raises nothing and clears nothing"),
    ]);
    if prepare < 100 {
        lines.push(format!("after {prepare} % of a condition's time another robot gets ready"));
    }
    lines
}

fn range(pause: Backoff) -> String {
    if pause.min == pause.max {
        return words(pause.min);
    }
    format!("{} to {}", words(pause.min), words(pause.max))
}

fn held(time: Duration) -> String {
    if time.is_zero() { String::new() } else { format!(" for {}", words(time)) }
}

/// `2 s`, `1.5 s`, `200 ms`, `2 min`.
fn words(time: Duration) -> String {
    let millis = time.as_millis();
    let (number, unit) = match millis {
        0..1000 => return format!("{millis} ms"),
        _ if millis.is_multiple_of(60_000) && millis >= 120_000 => {
            return format!("{} min", millis / 60_000);
        }
        _ => (millis, "s"),
    };
    let tenths = number / 100;
    match tenths % 10 {
        0 => format!("{} {unit}", tenths / 10),
        tenth => format!("{}.{tenth} {unit}", tenths / 10),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row_of(explained: &Explained, cause: &str) -> ExplainedRule {
        explained.rules.iter().find(|row| row.cause == cause).unwrap().clone()
    }

    #[test]
    fn the_default_policy_reads_like_the_table() {
        let explained = explain(&Policy::default());

        assert_eq!(explained.rules.len(), 16);
        let memory = row_of(&explained, "memory-short");
        assert_eq!(memory.when, "free memory of the robot is at most 100 MB for 2 s");
        assert_eq!(memory.over.as_deref(), Some("when it is at least 200 MB for 5 s"));
        assert_eq!(
            memory.then,
            [
                "switch to a standby on this robot, if one is ready",
                "restart it here, 3 times at most, 200 ms to 5 s apart; 10 s of quiet count as healed",
                "switch to a standby on another robot, if one is ready",
                "launch it on another robot",
                "stop trying, and say so",
            ]
        );
        let rssi = row_of(&explained, "rssi-low");
        assert_eq!(
            rssi.when,
            "radio level of the robot (median of 1 s) is at most -80.0 dBm for 6 s"
        );
        let stop = row_of(&explained, "emergency-stop");
        let held = Some(Vec::from([String::from("leave it as it is until somebody resets it")]));
        assert_eq!((stop.over, stop.actuator), (None, held));
        let late = row_of(&explained, "deadline-missed");
        assert_eq!(
            late.when,
            "deadlines of readers on this robot that its outputs miss: 5 or more within 1 s for 2 s"
        );
    }
}
