//! A recovery policy as it is written.

use std::{num::NonZeroU8, time::Duration};

use schemars::{Schema, SchemaGenerator, json_schema};
use sdr_core::{fitness::Alone, units::Permille};
use sdr_recovery::{Backoff, Over, Restart, Return, Rung};

use super::{
    cause_words::CauseEntry,
    condition_words::{ClearText, CpuOf, HoldTime, LevelText},
};
use crate::{
    read::{At, Map, Read, Reader, choices, one_key, table},
    tree::{Body, Node},
    units,
};

table! {
    /// What to do in trouble (Table III): rules that see faults, ladders that are climbed.
    pub(crate) struct RecoveryFile {
        /// The policy's name.
        recovery: Option<At<String>>,
        /// The policy that this one takes ladders, rules and limits from.
        extends: Option<At<String>>,
        /// What to try, from mild to severe; the last rung is `hold`.
        ladders: Option<Map<At<Vec<Rung>>>>,
        /// What to watch; `only` keeps just the rules named under `override`.
        rules: Option<At<RulesEntry>>,
        /// What differs in the rules of the policy under `extends`, by cause.
        r#override: Option<At<Map<At<RuleChanges>>>>,
        /// Bounds over all rules.
        limits: Option<LimitsTable>,
        /// ignore: a fact that nobody can tell raises nothing.
        unknown: Option<At<UnknownFact>>,
    }
}

/// The keys of a rule, once whole and once as a change.
macro_rules! rules {
    ($($(#[$meta:meta])* $field:ident: $type:ty,)*) => {
        table! {
            /// One rule: a cause, how it is seen, and what to climb.
            pub(crate) struct RuleTable {
                /// What is wrong.
                cause: At<CauseEntry>,
                $($(#[$meta])* $field: $type,)*
            }
        }

        table! {
            /// What differs in a rule.
            pub(crate) struct RuleChanges {
                $($(#[$meta])* $field: $type,)*
            }
        }

        impl RuleTable {
            pub(crate) fn split(self) -> (At<CauseEntry>, RuleChanges) {
                (self.cause, RuleChanges { $($field: self.$field,)* })
            }
        }
    };
}

rules! {
    /// The figure that is watched.
    fact: Option<At<String>>,
    /// Fault at this value and below.
    at_most: Option<At<LevelText>>,
    /// Fault at this value and above.
    at_least: Option<At<LevelText>>,
    /// For component.cpu: of its `limit` (default) or of one `core`.
    of: Option<At<CpuOf>>,
    /// For links: median (default), worst or best.
    over: Option<At<Over>>,
    /// Instead of a fact and a bar: an expression (a part of CEL) that is true or false.
    when: Option<At<String>>,
    /// How long it must last, default 0s; for hung: how long no sign of life came, such as
    /// `5 periods` or `2s`.
    r#for: Option<At<HoldTime>>,
    /// For robot-gone: how long nothing was heard of it; default: as the mesh has it.
    lost_after: Option<At<Duration>>,
    /// When it is over: `200MB for 5s`, for expressions and programs `5s`; default: as soon
    /// as the bar is not met.
    clear: Option<At<ClearText>>,
    /// The median of this window is judged; default 1s for rssi, else 0s.
    median_over: Option<At<Duration>>,
    /// The ladder to climb.
    ladder: Option<At<String>>,
    /// Another ladder for what moves a body.
    actuator: Option<At<String>>,
}

table! {
    /// Bounds over all rules.
    pub(crate) struct LimitsTable {
        /// Moves to another robot: `6 per hour per component`.
        moves: Option<At<PerHour>>,
        /// Restarts and local switches: `10 per hour per component`.
        restarts: Option<At<PerHour>>,
        /// never: what moved away does not come back by itself.
        r#return: Option<At<Return>>,
        /// How long a component must not come back to a robot that it left for a cause.
        not_back_for: Option<At<Duration>>,
        /// Quiet time that counts as healed, for rungs without their own; default 10s.
        settle: Option<At<Duration>>,
        /// Pause before a refused remedy is asked for again; default 1s..30s.
        retry: Option<At<Backoff>>,
        /// Share of a condition's `for` after which another robot gets ready; default 50%,
        /// 100%: never before the time is over.
        prepare_after: Option<At<Permille>>,
        /// How fast a standby on another robot follows a home that is silent.
        guard: Option<GuardTable>,
    }
}

table! {
    /// Beats between a home and its standbys.
    pub(crate) struct GuardTable {
        /// Time between two beats, 10ms to 1s; default 50ms.
        period: Option<At<Duration>>,
        /// Beats that may be missed on a good link, 2 to 20; default 4.
        misses: Option<At<u8>>,
        /// Of two robots, the one left: promote (default) or wait.
        alone: Option<At<Alone>>,
    }
}

table! {
    /// The rung `restart`.
    pub(crate) struct RestartTable {
        /// How often within one climb; default 3.
        tries: Option<At<NonZeroU8>>,
        /// Quiet time that counts as healed; default 10s.
        settle: Option<At<Duration>>,
        /// Pause before each try but the first, doubling: default 200ms..5s.
        backoff: Option<At<Backoff>>,
    }
}

/// `only`, or rules.
#[derive(Clone, Debug)]
pub(crate) enum RulesEntry {
    Only,
    List(Vec<At<RuleTable>>),
}

impl Read for RulesEntry {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        if matches!(node.body, Body::List(_)) {
            return Vec::read(node, reader).map(Self::List);
        }
        reader.choice(node, &["only", "[a list of rules]"], &[]).map(|_| Self::Only)
    }

    fn schema(generator: &mut SchemaGenerator) -> Schema {
        let list = Vec::<RuleTable>::schema(generator);
        json_schema!({ "anyOf": [{ "const": "only" }, list] })
    }
}

const RUNGS: [Rung; 4] =
    [Rung::LocalStandby, Rung::StandbyElsewhere, Rung::LaunchElsewhere, Rung::Hold];
const RUNG_WORDS: &[&str] =
    &["local-standby", "restart", "standby-elsewhere", "launch-elsewhere", "hold"];

impl Read for Rung {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        if let Body::Table(entries) = &node.body
            && let [(key, value)] = entries.as_slice()
        {
            if key.word != "restart" {
                reader.unknown(key.mark, "rung with keys", &key.word, &["restart"]);
                return None;
            }
            let table = RestartTable::read(value, reader)?;
            let usual = Restart::default();
            return Some(Self::Restart(Restart {
                tries: table.tries.map_or(usual.tries, |at| at.value),
                settle: table.settle.map_or(usual.settle, |at| at.value),
                backoff: table.backoff.map_or(usual.backoff, |at| at.value),
            }));
        }
        let index = reader.choice(node, RUNG_WORDS, &[])?;
        if RUNG_WORDS[index] == "restart" {
            return Some(Self::Restart(Restart::default()));
        }
        RUNGS.into_iter().find(|rung| rung.word() == RUNG_WORDS[index])
    }

    fn schema(generator: &mut SchemaGenerator) -> Schema {
        let restart = one_key::<RestartTable>("restart", generator);
        json_schema!({ "anyOf": [{ "enum": RUNG_WORDS }, restart] })
    }
}

impl Read for NonZeroU8 {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        let number = u8::read(node, reader)?;
        let found = Self::new(number);
        if found.is_none() {
            reader.wrong(node, "a whole number, 1 to 255");
        }
        found
    }

    fn schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "integer", "minimum": 1, "maximum": 255 })
    }
}

/// A range of times: `200ms..5s`.
impl Read for Backoff {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        const ALLOWED: &str = "a range of times such as 200ms..5s";
        let text = reader.text(node, ALLOWED)?;
        let Some((min, max)) = text.split_once("..") else {
            reader.wrong(node, ALLOWED);
            return None;
        };
        let mut time = |word: &str| {
            units::duration(word.trim())
                .map_err(|error| {
                    let help = format!("allowed: {ALLOWED}");
                    reader.problem(node.mark, error.to_string(), Some(help));
                })
                .ok()
        };
        let (min, max) = (time(min), time(max));
        let (min, max) = (min?, max?);
        if min.is_zero() || max < min {
            reader.wrong(node, "a range whose first time is not 0 and not over the second");
            return None;
        }
        Some(Self { min, max })
    }

    fn schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string", "pattern": r"^[0-9].*\.\.[0-9].*$" })
    }
}

/// `6 per hour per component`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PerHour(pub(crate) u16);

impl Read for PerHour {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        const ALLOWED: &str = "such as `6 per hour per component` (0 to 65535)";
        let text = reader.text(node, ALLOWED)?;
        let number = text
            .strip_suffix(" per component")
            .unwrap_or(text)
            .strip_suffix(" per hour")
            .and_then(|number| number.trim().parse().ok());
        if number.is_none() {
            reader.wrong(node, ALLOWED);
        }
        number.map(Self)
    }

    fn schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string", "pattern": "^[0-9]+ per hour( per component)?$" })
    }
}

/// The word `ignore`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct UnknownFact;

choices! {
    UnknownFact { "ignore" => Self, }
    Return { "never" => Self::Never, }
}
