//! Everything has a bound: effects of one input, datagrams, tables, processes, what is sent.

use sdr_core::time::Instant;

use crate::sim::{Broken, Checker, Fleet, Sight};

/// Orders to the shell from one input.
const EFFECTS_MAX: usize = 4096;
/// Bytes of one datagram.
const DATAGRAM_MAX: usize = 1200;
/// Bytes that one robot sends in a second, on average over [`RATE_OVER`].
const SENT_BYTES_S_MAX: f64 = 400_000.0;
/// Bursts shorter than this are no growth.
const RATE_OVER: f64 = 5.0;
/// Processes of one robot for each component that ever was.
const PROCESSES_EACH_MAX: usize = 2;

/// Things due for each robot: datagrams under way, timers, outcomes.
const DUE_EACH_MAX: usize = 2000;

/// `unbounded`.
#[derive(Debug, Default)]
pub struct Bounds {
    looked_at: Option<Instant>,
    sent: Vec<u64>,
}

impl Checker for Bounds {
    fn watch(&mut self, fleet: &Fleet, sight: &Sight) -> Option<Broken> {
        if !matches!(sight, Sight::Look) {
            return None;
        }
        let passed = self.looked_at.map_or(0.0, |at| fleet.now.since(at).as_secs_f64());
        let before = self.sent.clone();
        if self.looked_at.is_none() || passed >= RATE_OVER {
            self.looked_at = Some(fleet.now);
            self.sent.clone_from(&fleet.tally.sent_bytes);
        }
        if fleet.due() > fleet.robots.len().max(10) * DUE_EACH_MAX {
            let what = format!("{} datagrams and timers are due", fleet.due());
            return Some(Broken::new("unbounded", what));
        }
        let processes_max = fleet.components() * PROCESSES_EACH_MAX;
        fleet.robots.iter().enumerate().find_map(|(number, robot)| {
            let sent =
                before.get(number).map_or(0, |before| fleet.tally.sent_bytes[number] - before);
            let rate = if passed >= RATE_OVER { sent as f64 / passed } else { 0.0 };
            let processes = robot.processes().count();
            let what = if robot.effects_max() > EFFECTS_MAX {
                format!("{}: {} effects of one input", robot.id, robot.effects_max())
            } else if robot.datagram_bytes_max() > DATAGRAM_MAX {
                format!("{}: a datagram of {} bytes", robot.id, robot.datagram_bytes_max())
            } else if rate > SENT_BYTES_S_MAX {
                format!("{}: {rate:.0} bytes sent in a second", robot.id)
            } else if processes > processes_max {
                format!("{}: {processes} processes", robot.id)
            } else {
                return None;
            };
            Some(Broken::new("unbounded", what))
        })
    }
}
