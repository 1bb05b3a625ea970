//! A component's counters as the recording keeps them.

use sdr_component::protocol::Counters;
use sdr_core::{
    effect::LaunchOrder,
    recording::{ConnectionSample, OutputSample},
};

use crate::record::{RecordSender, stamp};

/// Records one round of counters of the instance that `order` started.
pub(super) fn record(counters: &Counters, order: &LaunchOrder, record: &RecordSender) {
    let system = order.component.system.to_string();
    for input in &counters.inputs {
        let Some(connection) = label(order, input.connection) else { continue };
        let sample = ConnectionSample {
            stamp: stamp(),
            monotonic_ns: counters.at_ns,
            robot: record.robot().into(),
            system: system.clone(),
            connection,
            accepted: input.accepted,
            lost: input.lost,
            fenced: input.fenced,
            late: input.late,
            first_ns: input.first_ns,
            last_ns: input.last_ns,
            gap_max_ns: input.gap_max_ns,
            period_median_ns: input.period_median_ns,
            epoch: input.epoch,
        };
        record.record(counters.at_ns, &sample);
    }
    for output in &counters.outputs {
        let sample = OutputSample {
            stamp: stamp(),
            monotonic_ns: counters.at_ns,
            robot: record.robot().into(),
            system: system.clone(),
            output: format!("{}.{}", order.component.name, output.port),
            sent: output.sent,
            sent_bytes: output.sent_bytes,
        };
        record.record(counters.at_ns, &sample);
    }
}

/// `fisheye.image -> anomaly.image`; `None` for a connection that was never wired.
fn label(order: &LaunchOrder, connection: u16) -> Option<String> {
    let wiring = order.inputs.iter().find(|wiring| wiring.connection == connection)?;
    let mut parts = wiring.path.rsplit('/');
    let (port, component) = (parts.next()?, parts.next()?);
    Some(format!("{component}.{port} -> {}.{}", order.component.name, wiring.port))
}
