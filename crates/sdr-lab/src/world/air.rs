//! The thread that writes what agents read from files: radio and battery.

use std::io;
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::time::Duration;

use super::config::RobotPaths;
use super::peer::wait_for;
use super::state::Shared;
use crate::radio::{NOISE_FLOOR_DBM, capacity_text, wireless_text, write_whole};

/// Between two writings, nanoseconds.
const PERIOD_NS: u64 = 100_000_000;

/// Runs until `wake` closes; `paths` has one entry for each body, in the same order.
pub(super) fn run(shared: &Arc<Shared>, paths: &[RobotPaths], wake: &UnixStream) {
    let mut next = Duration::ZERO;
    loop {
        let elapsed = shared.elapsed();
        if elapsed >= next {
            for (index, paths) in paths.iter().enumerate() {
                // A full disk now may have room in 100 ms; agents see the file's age meanwhile.
                let _ = write(shared, index, paths);
            }
            next = elapsed.max(next + Duration::from_nanos(PERIOD_NS));
        }
        let left = next.saturating_sub(shared.elapsed());
        if wait_for(&mut [], wake, crate::cast::nanoseconds(left)) {
            return;
        }
    }
}

/// Writes both files of one robot.
pub(super) fn write(shared: &Shared, index: usize, paths: &RobotPaths) -> io::Result<()> {
    let elapsed = shared.elapsed();
    let (level, percent) = {
        let mut truth = shared.truth();
        let body = &mut truth.bodies[index];
        let drained = elapsed.as_secs_f64() / 60.0 * body.config.drain_percent_per_minute;
        (body.radio.sample_dbm(elapsed), body.config.battery_percent - drained)
    };
    write_whole(&paths.wireless, &wireless_text("wlan0", level, NOISE_FLOOR_DBM))?;
    write_whole(&paths.battery, &capacity_text(percent))
}
