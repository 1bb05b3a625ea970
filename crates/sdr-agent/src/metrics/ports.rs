//! Battery and position from ports, through the data plane's taps.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use sdr_component::message::{CdrError, Message, nav_msgs::Odometry, sensor_msgs::BatteryState};
use sdr_core::{
    time::Instant,
    units::{Permille, Position},
};

use super::sensors::{Sensors, Source, millimetres, permille};
use crate::clock;
use crate::trouble::{Kind, Trouble};

/// A figure that is older is unknown: nobody says it any more.
const FRESH_FOR: Duration = Duration::from_secs(5);

/// The last figure of one port; unknown until it says one. Cheap to clone.
#[derive(Clone, Debug)]
pub(crate) struct Reading<T>(Arc<Mutex<Option<(T, Instant)>>>);

impl<T> Default for Reading<T> {
    fn default() -> Self {
        Self(Arc::default())
    }
}

impl<T: Copy> Reading<T> {
    /// What was said last, unless that was too long ago.
    pub(super) fn at(&self, now: Instant) -> Option<T> {
        let said = *self.0.lock().unwrap_or_else(PoisonError::into_inner);
        said.filter(|(_, at)| now.since(*at) <= FRESH_FOR).map(|(value, _)| value)
    }

    fn set(&self, now: Instant, value: Option<T>) {
        let said = value.map(|value| (value, now));
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = said;
    }
}

/// The data plane's end: takes samples of the ports that `[sensors]` of robot.toml names.
#[derive(Debug)]
pub(crate) struct SensorPorts {
    sensors: Sensors,
    trouble: Trouble,
    /// Ports and their types that were complained of.
    told: BTreeSet<(String, String)>,
}

impl SensorPorts {
    /// Fills the readings of `sensors`.
    pub(crate) fn new(sensors: Sensors, trouble: Trouble) -> Self {
        Self { sensors, trouble, told: BTreeSet::new() }
    }

    /// The ports to listen to.
    pub(crate) fn ports(&self) -> Vec<String> {
        let battery = self.sensors.battery.as_ref().and_then(Source::port);
        let position = self.sensors.position.as_ref().and_then(Source::port);
        battery.into_iter().chain(position).map(str::to_owned).collect()
    }

    /// Takes a sample of `port`, which has `message_type`; other ports pass by.
    pub(crate) fn take(&mut self, port: &str, message_type: &str, body: &[u8]) {
        let Self { sensors, trouble, told } = self;
        let mut ear = Ear { port, message_type, body, trouble, told };
        if let Some(reading) = sensors.battery.as_ref().and_then(|from| from.reading_of(port)) {
            ear.hear("battery", reading, |said: BatteryState| charge(&said));
        }
        if let Some(reading) = sensors.position.as_ref().and_then(|from| from.reading_of(port)) {
            ear.hear("position", reading, |said: Odometry| place(&said));
        }
    }
}

/// One sample, and where to complain of it.
struct Ear<'a> {
    port: &'a str,
    message_type: &'a str,
    body: &'a [u8],
    trouble: &'a Trouble,
    told: &'a mut BTreeSet<(String, String)>,
}

impl Ear<'_> {
    fn hear<M, T: Copy>(
        &mut self,
        sensor: &str,
        reading: &Reading<T>,
        figure: impl FnOnce(M) -> Option<T>,
    ) where
        M: for<'a> Message<View<'a> = M>,
    {
        let (port, found, allowed) = (self.port, self.message_type, M::TYPE);
        if found != allowed {
            let told = (format!("{sensor} {port}"), found.to_owned());
            if self.told.insert(told) {
                let said = format!("{sensor} from {port}: found {found}; allowed: {allowed}");
                self.trouble.say(Kind::SensorType, &said);
            }
            return;
        }
        let said: Result<M, CdrError> = M::decode(self.body);
        match said {
            Ok(said) => reading.set(clock::now(), figure(said)),
            Err(error) => {
                let said = format!("{sensor} from {port}: no {allowed}: {error}");
                self.trouble.count(Kind::SensorSample, &said);
            }
        }
    }
}

/// `None` when the driver does not know.
fn charge(said: &BatteryState) -> Option<Permille> {
    permille(f64::from(said.percentage))
}

/// `None` when any of it is unknown or beyond all places.
fn place(said: &Odometry) -> Option<Position> {
    let at = said.pose.pose.position;
    let (x_mm, y_mm) = (millimetres(at.x)?, millimetres(at.y)?);
    Some(Position { x_mm, y_mm, z_mm: millimetres(at.z)? })
}

#[cfg(test)]
mod tests {
    use sdr_component::message::Encode;
    use sdr_core::id::RobotId;

    use super::*;
    use crate::events::Events;

    const BATTERY: &str = "body.battery.state";
    const ODOMETRY: &str = "body.position.odometry";

    struct Bench {
        events: Events,
        sensors: Sensors,
        ports: SensorPorts,
    }

    fn bench() -> Bench {
        let events = Events::new(RobotId::new("robot-1").unwrap());
        let sensors = Sensors {
            battery: Some(Source::of_port(BATTERY)),
            position: Some(Source::of_port(ODOMETRY)),
        };
        let ports = SensorPorts::new(sensors.clone(), Trouble::new(events.clone()));
        Bench { events, sensors, ports }
    }

    impl Bench {
        fn say<M: Message + Encode>(&mut self, port: &str, message: &M) {
            let mut body = vec![0; message.encoded_len()];
            message.encode(&mut body).unwrap();
            self.ports.take(port, M::TYPE, &body);
        }

        fn say_charge(&mut self, percentage: f32) -> Option<Permille> {
            self.say(BATTERY, &BatteryState { percentage, ..BatteryState::default() });
            self.sensors.battery(clock::now())
        }

        fn say_place(&mut self, x: f64, y: f64, z: f64) -> Option<Position> {
            let mut said = Odometry::default();
            let at = &mut said.pose.pose.position;
            (at.x, at.y, at.z) = (x, y, z);
            self.say(ODOMETRY, &said);
            self.sensors.position(clock::now())
        }
    }

    #[test]
    fn a_charge_is_a_share_and_what_is_none_is_unknown() {
        let mut bench = bench();
        assert_eq!(bench.sensors.battery(clock::now()), None);

        assert_eq!(bench.say_charge(0.815), Some(Permille(815)));
        assert_eq!(bench.say_charge(0.0), Some(Permille(0)));
        assert_eq!(bench.say_charge(1.0), Some(Permille(1000)));
        for unknown in [f32::NAN, -0.1, 1.01, 81.5] {
            assert_eq!(bench.say_charge(0.5), Some(Permille(500)));
            assert_eq!(bench.say_charge(unknown), None, "{unknown}");
        }
        assert_eq!(bench.events.since(0), []);
    }

    #[test]
    fn a_place_is_in_metres_and_what_is_none_is_unknown() {
        let mut bench = bench();
        assert_eq!(bench.sensors.position(clock::now()), None);

        let there = Position { x_mm: 12_500, y_mm: -250, z_mm: 1000 };
        for (x, y, z) in [(f64::NAN, 0.0, 0.0), (0.0, 0.0, f64::NAN), (0.0, 1e30, 0.0)] {
            assert_eq!(bench.say_place(12.5, -0.25, 1.0), Some(there));
            assert_eq!(bench.say_place(x, y, z), None, "{x} {y} {z}");
        }
    }

    #[test]
    fn figures_that_nobody_repeats_become_unknown() {
        let mut bench = bench();
        let before = clock::now();
        bench.say_charge(0.5);
        bench.say_place(1.0, 2.0, 3.0);
        let after = clock::now();

        assert_eq!(bench.sensors.battery(before + FRESH_FOR), Some(Permille(500)));
        assert!(bench.sensors.position(before + FRESH_FOR).is_some());
        let late = after + FRESH_FOR + Duration::from_millis(1);
        assert_eq!(bench.sensors.battery(late), None);
        assert_eq!(bench.sensors.position(late), None);
    }

    #[test]
    fn a_wrong_type_is_not_used_and_told_once_with_the_right_one() {
        let mut bench = bench();

        for _ in 0..3 {
            bench.say(BATTERY, &Odometry::default());
            bench.say(ODOMETRY, &BatteryState::default());
        }

        assert_eq!(bench.sensors.battery(clock::now()), None);
        assert_eq!(bench.sensors.position(clock::now()), None);
        let events = bench.events.since(0);
        let reasons: Vec<_> = events.iter().map(|view| view.event.reason.as_str()).collect();
        assert_eq!(
            reasons,
            [
                "battery from body.battery.state: found nav_msgs/msg/Odometry; allowed: \
                 sensor_msgs/msg/BatteryState",
                "position from body.position.odometry: found sensor_msgs/msg/BatteryState; \
                 allowed: nav_msgs/msg/Odometry",
            ]
        );
        assert!(events.iter().all(|view| view.event.kind == "bad-input"));
    }

    #[test]
    fn bytes_that_are_no_message_are_counted_and_change_nothing() {
        let mut bench = bench();
        bench.say_charge(0.5);

        bench.ports.take(BATTERY, BatteryState::TYPE, &[1, 2, 3]);

        assert_eq!(bench.sensors.battery(clock::now()), Some(Permille(500)));
        assert_eq!(bench.events.since(0)[0].event.numbers["sensor_samples_bad"], 1.0);
    }
}
