//! A policy of the coordinator role as it is written.

use std::time::Duration;

use schemars::{Schema, SchemaGenerator, json_schema};
use sdr_core::{
    fitness::Alone,
    id::RobotId,
    units::{Dbm, Permille},
};

use super::bars::{AtLeast, AtMost};
use crate::{
    read::{At, Read, Reader, choices, table},
    tree::{Body, Node},
};

table! {
    /// Who should hold the coordinator role; one policy for the whole fleet.
    pub(crate) struct RoleFile {
        /// The policy's name.
        role: Option<At<String>>,
        /// The policy that this one changes: what is left out here stays as it is there.
        extends: Option<At<String>>,
        /// How much each aspect counts.
        weights: Option<RoleWeightsTable>,
        /// What a holder must have; without `extends`, what is left out asks for nothing.
        bars: Option<RoleBarsTable>,
        /// Robots that go before all others while they are fit, the first first.
        pinned: Option<Vec<At<RobotId>>>,
        /// Robots that never hold it.
        forbidden: Option<Vec<At<RobotId>>>,
        /// A fitter robot gets the role when it is ahead by so many points, 0 to 1000 ...
        margin: Option<At<Points>>,
        /// ... for so long, at most 1h.
        margin_for: Option<At<Duration>>,
        /// Period at which the holder tells its successors that it lives, 50ms to 5s.
        beat: Option<At<Duration>>,
        /// So many beats missed make the holder suspect, 2 to 50.
        misses: Option<At<Misses>>,
        /// Each further successor waits so much longer, at most 10s.
        stagger: Option<At<Duration>>,
        /// What the other of two robots does when one is gone.
        alone: Option<At<Alone>>,
    }
}

table! {
    /// How much each aspect counts; all zero: all robots are alike.
    pub(crate) struct RoleWeightsTable {
        /// Charge.
        battery: Option<At<u16>>,
        /// CPU that is free.
        cpu: Option<At<u16>>,
        /// Memory that is free.
        memory: Option<At<u16>>,
        /// Radio level and loss, the worse of both.
        links: Option<At<u16>>,
        /// Share of its links that reach the other robot.
        centrality: Option<At<u16>>,
    }
}

table! {
    /// What a holder must have; `none` asks for nothing.
    pub(crate) struct RoleBarsTable {
        /// Charge.
        battery: Option<At<AtLeast<Permille>>>,
        /// CPU in use, as a share of the robot's capacity.
        cpu_used: Option<At<AtMost<Permille>>>,
        /// Memory left, as a share of the robot's capacity.
        memory_free: Option<At<AtLeast<Permille>>>,
        /// Radio level.
        rssi: Option<At<AtLeast<Dbm>>>,
        /// Lost datagrams, the mean over its links.
        loss: Option<At<AtMost<Permille>>>,
    }
}

choices! {
    Alone { "promote" => Self::Promote, "wait" => Self::Wait, }
}

/// Whole numbers with bounds of their own.
macro_rules! numbers {
    ($($(#[$meta:meta])* $name:ident $min:literal..=$max:literal $allowed:literal;)*) => {$(
        $(#[$meta])*
        #[derive(Clone, Copy, Debug)]
        pub(crate) struct $name(pub(crate) u32);

        impl Read for $name {
            fn read(node: &Node, reader: &mut Reader) -> Option<Self> {
                if let Body::Int(number) = node.body
                    && let Ok(number) = u32::try_from(number)
                    && ($min..=$max).contains(&number)
                {
                    return Some(Self(number));
                }
                reader.wrong(node, $allowed);
                None
            }

            fn schema(_: &mut SchemaGenerator) -> Schema {
                json_schema!({ "type": "integer", "minimum": $min, "maximum": $max })
            }
        }
    )*};
}
numbers! {
    /// A difference of fitness.
    Points 0..=1000 "points, a whole number from 0 to 1000 without a unit";
    /// Beats in a row.
    Misses 2..=50 "a whole number of beats, from 2 to 50";
}
