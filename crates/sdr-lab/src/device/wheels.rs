//! The client of the wheels.

use std::io::{ErrorKind, Read, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};

use super::{
    Command, DeviceError, DeviceKind, Greeting, LineBuffer, WheelReading, WheelsAnswer, camera,
    error::beginning, line_of,
};

/// Most readings handed over at once; the rest stays for the next call.
const READINGS_MAX: usize = 256;

/// A connection to the wheels of a rover; nothing but [`WheelsClient::wait`] waits.
#[derive(Debug)]
pub struct WheelsClient {
    stream: UnixStream,
    lines: LineBuffer,
    greeting: Greeting,
}

impl WheelsClient {
    /// Connects; `timeout` (more than zero) bounds the wait for the greeting.
    pub fn connect(path: &Path, timeout: Duration) -> Result<Self, DeviceError> {
        let (stream, mut lines) = camera::open(path, timeout)?;
        let greeting = camera::greeting(&stream, &mut lines, path, timeout, "wheels")?;
        if greeting.device != DeviceKind::Wheels {
            return Err(DeviceError::Unexpected {
                path: path.to_owned(),
                wanted: "wheels",
                found: beginning(&line_of(&greeting)),
            });
        }
        stream.set_nonblocking(true)?;
        Ok(Self { stream, lines, greeting })
    }

    /// Sends a command at once.
    pub fn command(&mut self, command: Command) -> Result<(), DeviceError> {
        check(&command)?;
        let line = line_of(&command);
        match self.stream.write(&line) {
            Ok(count) if count == line.len() => Ok(()),
            // Half a line would garble all that follow.
            Ok(_) => Err(DeviceError::hung_up()),
            Err(error) if error.kind() == ErrorKind::WouldBlock => Err(DeviceError::Busy),
            Err(error) => Err(DeviceError::Broken(error)),
        }
    }

    /// All readings that came since the last call, oldest first; at most 256 at once.
    pub fn readings(&mut self) -> Result<Vec<WheelReading>, DeviceError> {
        let mut readings = Vec::new();
        let mut chunk = [0; 4096];
        loop {
            self.drain(&mut readings)?;
            if readings.len() >= READINGS_MAX {
                return Ok(readings);
            }
            match self.stream.read(&mut chunk) {
                Ok(0) if readings.is_empty() => return Err(DeviceError::hung_up()),
                Ok(0) => return Ok(readings),
                Ok(count) => self.lines.push(&chunk[..count]),
                Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(readings),
                Err(error) => return Err(DeviceError::Broken(error)),
            }
        }
    }

    /// Waits until there is a reading, at most `timeout`; returns all there are.
    pub fn wait(&mut self, timeout: Duration) -> Result<Vec<WheelReading>, DeviceError> {
        let deadline = Instant::now() + timeout;
        loop {
            let readings = self.readings()?;
            if !readings.is_empty() {
                return Ok(readings);
            }
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Err(DeviceError::Silent { waited_ms: timeout.as_millis() });
            }
            let limit = Timespec::try_from(left).ok();
            poll(&mut [PollFd::new(&self.stream, PollFlags::IN)], limit.as_ref())
                .map_err(|errno| DeviceError::Broken(errno.into()))?;
        }
    }

    /// What the wheels said of themselves.
    pub fn greeting(&self) -> &Greeting {
        &self.greeting
    }

    fn drain(&mut self, readings: &mut Vec<WheelReading>) -> Result<(), DeviceError> {
        while readings.len() < READINGS_MAX {
            let line = self.lines.next_line();
            let line = line.map_err(|_| DeviceError::garbled(b"", "lines of 512 bytes"))?;
            let Some(line) = line else { return Ok(()) };
            match serde_json::from_slice(&line) {
                Ok(WheelsAnswer::Reading(reading)) => readings.push(reading),
                Ok(WheelsAnswer::Error(reason)) => return Err(DeviceError::Refused { reason }),
                Err(_) => return Err(DeviceError::garbled(&line, "a reading or an error")),
            }
        }
        Ok(())
    }
}

/// Finite and within what a command may say.
pub(crate) fn check(command: &Command) -> Result<(), DeviceError> {
    let Command { linear, angular } = *command;
    if !(-10.0..=10.0).contains(&linear) {
        let allowed = "-10 to 10 m/s";
        return Err(DeviceError::OutOfRange { name: "linear", value: linear, allowed });
    }
    if !(-100.0..=100.0).contains(&angular) {
        let allowed = "-100 to 100 rad/s";
        return Err(DeviceError::OutOfRange { name: "angular", value: angular, allowed });
    }
    Ok(())
}
