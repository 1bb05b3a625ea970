//! `sdr policy`: what a recovery policy does, in words.

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
};

use clap::Subcommand;
use sdr_files::{FileKind, Problems, detect, load_recovery, load_system};
use sdr_recovery::{Explained, ExplainedRule, Policy, explain};

use super::problems;
use crate::{Session, failure::Failure, output::Format, render::units::wrap};

/// Arguments of `sdr policy`.
#[derive(Debug, clap::Args)]
pub(crate) struct PolicyArgs {
    #[command(subcommand)]
    command: PolicyCommand,
}

#[derive(Debug, Subcommand)]
enum PolicyCommand {
    /// Print a policy's table in words: what is seen, when it is over, what is tried
    Explain {
        /// A recovery policy, or a system with its policy and its components' own rules
        /// [default: the built-in policy]
        file: Option<PathBuf>,
    },
}

/// Reads the file and says what it means; nothing is asked of any agent.
pub(crate) fn run(args: PolicyArgs, session: &Session) -> Result<ExitCode, Failure> {
    let PolicyCommand::Explain { file } = args.command;
    let loaded = file.as_deref().map_or_else(|| Ok(Policy::default()), load);
    let policy = match loaded {
        Ok(policy) => policy,
        Err(found) => {
            problems::tell(&found, "nothing was changed", session)?;
            return Ok(ExitCode::FAILURE);
        }
    };
    let explained = explain(&policy);
    match session.output.format() {
        Format::Json => session.output.json(&explained)?,
        Format::Text => {
            let (columns, _) = session.output.size();
            for line in screen(&explained, columns) {
                session.output.line(&line)?;
            }
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn load(file: &Path) -> Result<Policy, Problems> {
    match detect(file)? {
        FileKind::System => {
            let system = load_system(file)?;
            Ok(Policy::decode(&system.spec.recovery).expect("encoded by the reader of the file"))
        }
        FileKind::Recovery
        | FileKind::Robot
        | FileKind::Allocation
        | FileKind::Role
        | FileKind::Scenario => load_recovery(file),
    }
}

fn screen(explained: &Explained, columns: usize) -> Vec<String> {
    let mut lines = vec![format!("recovery policy {}", explained.policy), String::new()];
    rows(&explained.rules, columns, &mut lines);
    for own in &explained.components {
        lines.push(format!("component {} has these rules instead", own.component));
        lines.push(String::new());
        rows(&own.rules, columns, &mut lines);
        if own.limits != explained.limits {
            list("bounds", &own.limits, columns, &mut lines);
        }
    }
    list("over all rules", &explained.limits, columns, &mut lines);
    lines
}

/// Rules that climb the same ladder share its words, as in the paper's table.
fn rows(rules: &[ExplainedRule], columns: usize, lines: &mut Vec<String>) {
    let mut before: Option<&ExplainedRule> = None;
    for rule in rules {
        let same =
            |other: &ExplainedRule| (&other.then, &other.actuator) == (&rule.then, &rule.actuator);
        if before.is_some_and(|other| !same(other)) {
            ladder(before, columns, lines);
        }
        let over = rule.over.as_ref().map(|over| format!("; over {over}")).unwrap_or_default();
        put(&format!("{}: {}{over}", rule.cause, rule.when), ("", "    "), columns, lines);
        before = Some(rule);
    }
    ladder(before, columns, lines);
}

fn ladder(rule: Option<&ExplainedRule>, columns: usize, lines: &mut Vec<String>) {
    let Some(rule) = rule else { return };
    for (number, rung) in rule.then.iter().enumerate() {
        put(rung, (&format!("  {}. ", number + 1), "     "), columns, lines);
    }
    if let Some(actuator) = &rule.actuator {
        put(&actuator.join("; else "), ("  actuators: ", "     "), columns, lines);
    }
    lines.push(String::new());
}

fn list(head: &str, items: &[String], columns: usize, lines: &mut Vec<String>) {
    lines.push(head.to_owned());
    for item in items {
        put(item, ("  - ", "    "), columns, lines);
    }
}

fn put(text: &str, (first, next): (&str, &str), columns: usize, lines: &mut Vec<String>) {
    let width = columns.max(20);
    lines.extend(wrap(&format!("{first}{text}"), width, next));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_names_each_ladder_once_and_keeps_to_its_width() {
        let lines = screen(&explain(&Policy::default()), 60);

        assert!(lines.iter().all(|line| line.chars().count() <= 60), "{lines:#?}");
        let text = lines.join("\n");
        assert!(text.contains("memory-short: free memory of the robot"), "{text}");
        assert!(text.contains("  actuators: leave it as it is until"), "{text}");
        assert_eq!(text.matches("launch it on another robot").count(), 4, "{text}");
    }
}
