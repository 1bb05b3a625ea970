//! Wheels as a component has them: readings become motion, commands may be refused.

use std::path::PathBuf;

use sdr_component::ComponentError;
use sdr_lab::device::{Command, DeviceError, WheelReading, WheelsClient};
use sdr_lab::tunnel::Pose;
use sdr_lab::world::TRACK_M;

use super::DEVICE_TIMEOUT;
use crate::estimate::{DeadReckoning, Motion, Odometer};

/// Wheels that say nothing for this long are gone, nanoseconds.
const SILENCE_MAX_NS: u64 = 1_000_000_000;

/// What the wheels measured up to a moment.
#[derive(Debug, Clone, Copy)]
pub(super) struct Measured {
    pub(super) stamp_ns: u64,
    /// In a frame of its own that drifts.
    pub(super) pose: Pose,
    /// The newest motion.
    pub(super) motion: Motion,
}

/// The device, its odometer and what they add up to.
#[derive(Debug)]
pub(super) struct Wheels {
    path: PathBuf,
    client: Option<WheelsClient>,
    odometer: Odometer,
    reckoning: DeadReckoning,
    heard_ns: u64,
}

impl Wheels {
    /// Not connected yet.
    pub(super) fn new(path: PathBuf) -> Self {
        Self {
            path,
            client: None,
            odometer: Odometer::new(TRACK_M),
            reckoning: DeadReckoning::default(),
            heard_ns: 0,
        }
    }

    pub(super) fn connect(&mut self) -> Result<(), ComponentError> {
        let client = WheelsClient::connect(&self.path, DEVICE_TIMEOUT);
        self.client = Some(client.map_err(ComponentError::hardware_lost)?);
        Ok(())
    }

    /// Begins anew: what was said while nobody listened is dropped.
    pub(super) fn start(&mut self, now_ns: u64) -> Result<(), ComponentError> {
        while !self.readings()?.is_empty() {}
        self.odometer = Odometer::new(TRACK_M);
        self.reckoning = DeadReckoning::default();
        self.heard_ns = now_ns;
        Ok(())
    }

    /// What was measured since the last call; `None` when nothing was.
    pub(super) fn measure(&mut self, now_ns: u64) -> Result<Option<Measured>, ComponentError> {
        let readings = self.readings()?;
        if readings.is_empty() {
            if now_ns.saturating_sub(self.heard_ns) > SILENCE_MAX_NS {
                return Err(ComponentError::hardware_lost("wheels silent for 1 s"));
            }
            return Ok(None);
        }
        self.heard_ns = now_ns;
        let mut measured = None;
        for reading in &readings {
            if let Some(motion) = self.odometer.handle(reading) {
                let pose = self.reckoning.advance(&motion);
                measured = Some(Measured { stamp_ns: reading.stamp_ns, pose, motion });
            }
        }
        Ok(measured)
    }

    /// Orders a speed; a device that is busy keeps the order before.
    pub(super) fn order(&mut self, linear: f64, angular: f64) -> Result<(), ComponentError> {
        match self.client()?.command(Command { linear, angular }) {
            Ok(()) | Err(DeviceError::Busy) => Ok(()),
            Err(error) => Err(ComponentError::hardware_lost(error)),
        }
    }

    pub(super) fn disconnect(&mut self) {
        self.client = None;
    }

    fn readings(&mut self) -> Result<Vec<WheelReading>, ComponentError> {
        self.client()?.readings().map_err(ComponentError::hardware_lost)
    }

    fn client(&mut self) -> Result<&mut WheelsClient, ComponentError> {
        self.client.as_mut().ok_or_else(|| ComponentError::hardware_lost("wheels not connected"))
    }
}
