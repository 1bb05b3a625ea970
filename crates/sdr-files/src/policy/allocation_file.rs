//! An allocation policy as it is written.

use std::time::Duration;

use schemars::{Schema, SchemaGenerator, json_schema};
use sdr_alloc::{IfUnknown, Millimetres, StartWith, Strategy, Weight};
use sdr_core::{
    id::RobotId,
    units::{Bytes, Dbm, Permille},
};

use super::bars::{AtLeast, AtMost, BatteryEntry, UnknownElse};
use crate::{
    read::{At, Read, Reader, table},
    tree::{Body, Node},
};

/// The keys of a policy, once at its top and once under `override`.
macro_rules! changes {
    ($($(#[$meta:meta])* $field:ident: $type:ty,)*) => {
        table! {
            /// Where components may be placed (Tables I and II), and which place is taken.
            pub(crate) struct AllocationFile {
                /// The policy's name.
                allocation: Option<At<String>>,
                /// The policy that this one changes; what changes stands under `override`.
                extends: Option<At<String>>,
                /// What differs from the policy under `extends`.
                r#override: Option<At<AllocationChanges>>,
                $($(#[$meta])* $field: $type,)*
            }
            later {
                estimates: "choosing between estimates",
                objective: "an objective in CEL",
                replan: "planning anew while running",
            }
        }

        table! {
            /// What a policy says, or changes.
            pub(crate) struct AllocationChanges {
                $($(#[$meta])* $field: $type,)*
            }
            later {
                estimates: "choosing between estimates",
                objective: "an objective in CEL",
                replan: "planning anew while running",
            }
        }

        impl AllocationFile {
            /// The keys at the top without name, `extends` and `override`.
            pub(crate) fn own(&self) -> AllocationChanges {
                AllocationChanges { $($field: self.$field.clone(),)* }
            }

            /// The first key at the top that `extends` leaves no room for.
            pub(crate) fn first_own(&self) -> Option<&'static str> {
                [$((stringify!($field), self.$field.is_some())),*]
                    .into_iter()
                    .find_map(|(key, given)| given.then_some(key))
            }
        }
    };
}

changes! {
    /// first-fit or best-score (default).
    strategy: Option<At<Strategy>>,
    /// first-fit's order: receiver (default), nearest, or a list of robots.
    start_with: Option<At<StartWith>>,
    /// Table I, judged after placing.
    robot: Option<RobotBars>,
    /// Table II, for every connection that would cross robots.
    link: Option<LinkBars>,
    /// The second tier, used in recovery only and only when the first has no answer.
    relaxed: Option<RelaxedTable>,
    /// What counts for a fact that nobody can tell.
    unknown: Option<UnknownTable>,
    /// What counts for needs that nobody declared or measured.
    default_needs: Option<DefaultNeeds>,
    /// A standby that runs already is taken before anything is started; default true.
    reuse_standbys: Option<At<bool>>,
    /// What best-score weighs; greater is better.
    score: Option<ScoreTable>,
}

table! {
    /// Bars on a robot.
    pub(crate) struct RobotBars {
        /// CPU in use, as a share of the robot's capacity.
        cpu_used: Option<At<AtMost<Permille>>>,
        /// Memory left.
        memory_free: Option<At<AtLeast<Bytes>>>,
        /// Charge; `if_needs_cpu` makes it count for hungry components only.
        battery: Option<At<BatteryEntry>>,
    }
    later { temperature: "a bar on temperature", }
}

table! {
    /// Bars on a pair of robots.
    pub(crate) struct LinkBars {
        /// Radio level, the worse of both ends.
        rssi: Option<At<AtLeast<Dbm>>>,
        /// Change from one round trip to the next.
        jitter: Option<At<AtMost<Duration>>>,
        /// Distance.
        distance: Option<At<AtMost<Millimetres>>>,
        /// Half a round trip.
        delay: Option<At<AtMost<Duration>>>,
        /// Lost datagrams.
        loss: Option<At<AtMost<Permille>>>,
    }
    later { bandwidth: "a bar on bandwidth", }
}

table! {
    /// The second tier.
    pub(crate) struct RelaxedTable {
        /// Table I.
        robot: Option<RobotBars>,
        /// Table II; empty sets no bar.
        link: Option<LinkBars>,
    }
}

table! {
    /// What counts for a fact that nobody can tell.
    pub(crate) struct UnknownTable {
        /// refuse or worst, for facts without a line of their own.
        default: Option<At<UnknownElse>>,
        /// Charge.
        battery: Option<At<IfUnknown<Permille>>>,
        /// Radio level.
        rssi: Option<At<IfUnknown<Dbm>>>,
        /// Jitter.
        jitter: Option<At<IfUnknown<Duration>>>,
        /// Distance.
        distance: Option<At<IfUnknown<Millimetres>>>,
        /// Half a round trip.
        delay: Option<At<IfUnknown<Duration>>>,
        /// Lost datagrams.
        loss: Option<At<IfUnknown<Permille>>>,
    }
}

table! {
    /// What counts for needs that nobody declared or measured.
    pub(crate) struct DefaultNeeds {
        /// Memory.
        memory: Option<At<Bytes>>,
        /// CPU.
        cpu: Option<At<Permille>>,
    }
}

table! {
    /// Weights of best-score, 0 to 1000.
    pub(crate) struct ScoreTable {
        /// Memory left after placing.
        memory_left: Option<At<Weight>>,
        /// CPU left after placing.
        cpu_left: Option<At<Weight>>,
        /// Charge.
        battery: Option<At<Weight>>,
        /// Radio level towards those it talks to.
        link_quality: Option<At<Weight>>,
        /// Distance to those it talks to.
        nearness: Option<At<Weight>>,
        /// It runs there already.
        stay: Option<At<Weight>>,
    }
}

impl Read for Strategy {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        const LATER: &[(&str, &str)] = &[
            ("search", "local search over whole plans"),
            ("exact", "the exact optimum"),
            ("auto", "choosing a strategy by size"),
        ];
        if let Body::Table(entries) = &node.body
            && let Some((key, _)) = entries.first()
            && key.word == "exec"
        {
            reader.later(key.mark, "exec", "an allocator of your own");
            return None;
        }
        let all = [Self::FirstFit, Self::BestScore];
        let index = reader.choice(node, &all.map(Self::word), LATER)?;
        all.into_iter().nth(index)
    }

    fn schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "enum": [Self::FirstFit.word(), Self::BestScore.word()] })
    }
}

impl Read for StartWith {
    fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
        if matches!(node.body, Body::List(_)) {
            return Vec::<RobotId>::read(node, reader).map(Self::List);
        }
        let index = reader.choice(node, &["receiver", "nearest", "[robot-1, robot-2]"], &[])?;
        [Self::Receiver, Self::Nearest].into_iter().nth(index)
    }

    fn schema(generator: &mut SchemaGenerator) -> Schema {
        let list = Vec::<RobotId>::schema(generator);
        json_schema!({ "anyOf": [{ "enum": ["receiver", "nearest"] }, list] })
    }
}
