//! The qualities of a connection as DDS has them.

use rustdds::{
    QosPolicies, QosPolicyBuilder,
    policy::{Durability, History, Reliability as DdsReliability, ResourceLimits},
};
use sdr_core::spec::{Qos, Reliability};

/// Samples a reliable writer may have unacknowledged.
const WINDOW: i32 = 4096;
/// Samples a reader's cache may hold at least, so that a short delay of ours loses none.
const CACHE_MIN: i32 = 16;

/// What both ends of a topic say of it.
pub(super) fn policies(qos: Qos) -> QosPolicies {
    let depth = i32::from(qos.depth.max(1));
    let reliability = match qos.reliability {
        // A full window is reported at once: the bridge must never wait.
        Reliability::Reliable => {
            DdsReliability::Reliable { max_blocking_time: rustdds::Duration::ZERO }
        }
        Reliability::BestEffort => DdsReliability::BestEffort,
    };
    QosPolicyBuilder::new()
        .reliability(reliability)
        .history(History::KeepLast { depth })
        .durability(Durability::Volatile)
        // Also the bound of the reading side's cache.
        .resource_limits(limits(depth.max(CACHE_MIN)))
        .build()
}

/// What a writer says in addition: a reliable one has a window of its own.
pub(super) fn writer_policies(qos: Qos) -> QosPolicies {
    let own = match qos.reliability {
        Reliability::Reliable => QosPolicyBuilder::new().resource_limits(limits(WINDOW)),
        Reliability::BestEffort => QosPolicyBuilder::new(),
    };
    policies(qos).modify_by(&own.build())
}

fn limits(max_samples: i32) -> ResourceLimits {
    ResourceLimits { max_samples, max_instances: 1, max_samples_per_instance: max_samples }
}
