//! The world the robots are in, and its truth, noted twenty times a second.

use std::{
    path::Path,
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    thread::JoinHandle,
    time::Duration,
};

use sdr_lab::{
    World, WorldConfig, WorldHandle,
    radio::Fade,
    world::{RobotPaths, RoverSnapshot, WorldError, monotonic_ns},
};

use super::ROBOTS;
use crate::{
    failure::Failure,
    report::extra::{Detector, Radio, TruthPoint},
};

/// Whose wheels are used: the controller's robot.
pub(crate) const DRIVEN: &str = "robot-2";
/// Whose radio fades.
pub(crate) const FADING: &str = "robot-1";
/// The paper's: from -47 to -55 dBm.
const FADE: Fade = Fade { from_dbm: -47.0, to_dbm: -55.0, over: Duration::from_millis(1500) };
/// Spread of the level, dB.
const NOISE_DB: f64 = 0.5;
/// Draws all noise of the world.
const SEED: u64 = 2026;
/// Between two notes of the truth.
const NOTE_EVERY: Duration = Duration::from_millis(50);
/// How far ahead the dangerous object appears, metres.
const OBJECT_AHEAD_M: f64 = 2.5;

/// The running world. Dropping it ends it and removes its sockets.
pub(crate) struct Stage {
    world: Arc<WorldHandle>,
    notes: Arc<Mutex<Vec<Note>>>,
    stop: Arc<AtomicBool>,
    writer: Option<JoinHandle<()>>,
}

/// The truth about the driven robot at one moment.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Note {
    monotonic_ns: u64,
    x_m: f64,
    y_m: f64,
    driving: bool,
    stops: u32,
    distance_m: f64,
    object: Option<f64>,
}

impl Stage {
    /// Starts the world below `folder`.
    pub(crate) fn start(folder: &Path) -> Result<Self, Failure> {
        let followers: Vec<&str> = ROBOTS.into_iter().filter(|robot| *robot != DRIVEN).collect();
        let config = WorldConfig::convoy(folder, DRIVEN, &followers, SEED);
        let world = Arc::new(World::start(config).map_err(|error| told(&error))?);
        let (notes, stop) = (Arc::new(Mutex::new(Vec::new())), Arc::new(AtomicBool::new(false)));
        let mut stage = Self { world, notes, stop, writer: None };
        stage.writer = Some(stage.note_truth()?);
        Ok(stage)
    }

    /// Where the bodies' devices and files are, in the order of [`ROBOTS`].
    pub(crate) fn bodies(&self, folder: &Path) -> Vec<RobotPaths> {
        ROBOTS.into_iter().map(|robot| RobotPaths::new(folder, robot)).collect()
    }

    /// The driven robot now.
    pub(crate) fn driven(&self) -> Option<RoverSnapshot> {
        self.world.snapshot().rover(DRIVEN).cloned()
    }

    /// Puts the dangerous object before the driven robot.
    pub(crate) fn show_object(&self) -> Result<(), Failure> {
        self.world.place_object_ahead(DRIVEN, OBJECT_AHEAD_M).map_err(|error| told(&error))
    }

    /// Takes it away.
    pub(crate) fn hide_object(&self) {
        self.world.remove_object();
    }

    /// Lets the radio of [`FADING`] fade, from now on.
    pub(crate) fn fade(&self) -> Result<(), Failure> {
        self.world.fade(FADING, FADE).map_err(|error| told(&error))
    }

    /// How the radio is played.
    pub(crate) fn radio() -> Radio {
        Radio {
            robot: FADING.to_owned(),
            from_dbm: FADE.from_dbm,
            to_dbm: FADE.to_dbm,
            noise_db: NOISE_DB,
            fade_s: FADE.over.as_secs_f64(),
            carrier: "DDS and the mesh over loopback: no loss, no delay; only the level is played"
                .to_owned(),
        }
    }

    /// Where the driven robot was.
    pub(crate) fn truth(&self) -> Vec<TruthPoint> {
        let point = |note: &Note| TruthPoint {
            monotonic_ns: note.monotonic_ns,
            x_m: note.x_m,
            y_m: note.y_m,
        };
        self.notes().iter().map(point).collect()
    }

    /// When commands reached the wheels, CLOCK_MONOTONIC.
    pub(crate) fn commands_ns(&self) -> Vec<u64> {
        self.world.command_times(DRIVEN).unwrap_or_default()
    }

    /// What became of the dangerous object.
    pub(crate) fn detector(&self, until_ns: u64) -> Detector {
        let notes = self.notes();
        let until = notes.partition_point(|note| note.monotonic_ns <= until_ns);
        judge(&notes[..until])
    }

    fn notes(&self) -> std::sync::MutexGuard<'_, Vec<Note>> {
        self.notes.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn note_truth(&self) -> Result<JoinHandle<()>, Failure> {
        let (world, notes, stop) = (self.world.clone(), self.notes.clone(), self.stop.clone());
        let write = move || {
            while !stop.load(Ordering::Relaxed) {
                let at = monotonic_ns();
                if let Some(rover) = world.snapshot().rover(DRIVEN) {
                    let note = Note {
                        monotonic_ns: at,
                        x_m: rover.pose.x,
                        y_m: rover.pose.y,
                        driving: rover.driving,
                        stops: rover.stops,
                        distance_m: rover.distance_m,
                        object: rover.object_distance_m,
                    };
                    notes.lock().unwrap_or_else(PoisonError::into_inner).push(note);
                }
                std::thread::sleep(NOTE_EVERY);
            }
        };
        std::thread::Builder::new()
            .name("truth".to_owned())
            .spawn(write)
            .map_err(|error| Failure::new(format!("cannot note the truth: {error}")))
    }
}

impl Drop for Stage {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(writer) = self.writer.take() {
            // A writer that panicked has already said so.
            let _ = writer.join();
        }
    }
}

/// What the notes say of the object and the stops.
fn judge(notes: &[Note]) -> Detector {
    let mut detector = Detector::default();
    let (mut shown_ns, mut hidden_ns) = (None, None);
    for pair in notes.windows(2) {
        let (before, now) = (&pair[0], &pair[1]);
        if before.object.is_none() && now.object.is_some() {
            detector.shown += 1;
            shown_ns = shown_ns.or(Some(now.monotonic_ns));
        }
        if before.object.is_some() && now.object.is_none() {
            hidden_ns = hidden_ns.or(Some(now.monotonic_ns));
        }
        let stops = now.stops.saturating_sub(before.stops);
        match now.object {
            Some(distance) if stops > 0 => {
                detector.stops += stops;
                if detector.stop_after_ms.is_none() {
                    detector.stop_after_ms = shown_ns.map(|from| ms(now.monotonic_ns - from));
                    detector.stop_distance_m = Some((distance * 1000.0).round() / 1000.0);
                }
            }
            Some(_) | None => detector.stops_without_cause += stops,
        }
        if let (Some(hidden), None) = (hidden_ns, detector.resumed_after_ms)
            && now.driving
            && detector.stops > 0
        {
            detector.resumed_after_ms = Some(ms(now.monotonic_ns - hidden));
        }
    }
    let way = notes.last().map_or(0.0, |last| last.distance_m);
    detector.distance_m = (way * 1000.0).round() / 1000.0;
    detector
}

fn ms(ns: u64) -> f64 {
    crate::report::summary::ms(ns)
}

fn told(error: &WorldError) -> Failure {
    Failure::new(format!("the world: {error}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn note(at_ms: u64, driving: bool, stops: u32, object: Option<f64>) -> Note {
        let monotonic_ns = at_ms * 1_000_000;
        Note { monotonic_ns, x_m: 0.0, y_m: 0.0, driving, stops, distance_m: 1.0, object }
    }

    #[test]
    fn a_stop_before_the_object_is_told_from_one_without_cause() {
        let detector = judge(&[
            note(0, true, 0, None),
            note(1000, true, 0, Some(2.5)),
            note(1400, false, 1, Some(2.4)),
            note(3000, false, 1, None),
            note(3200, true, 1, None),
            note(5000, false, 2, None),
        ]);

        assert_eq!((detector.shown, detector.stops, detector.stops_without_cause), (1, 1, 1));
        assert_eq!(detector.stop_after_ms, Some(400.0));
        assert_eq!(detector.stop_distance_m, Some(2.4));
        assert_eq!(detector.resumed_after_ms, Some(200.0));
    }

    #[test]
    fn an_object_that_nobody_stopped_for_leaves_its_figures_unknown() {
        let detector = judge(&[note(0, true, 0, None), note(50, true, 0, Some(2.5))]);
        assert_eq!((detector.shown, detector.stops), (1, 0));
        assert_eq!((detector.stop_after_ms, detector.resumed_after_ms), (None, None));
    }

    #[test]
    fn the_world_starts_in_a_folder_and_goes_without_a_trace() {
        let folder = tempfile::tempdir().unwrap();
        let world = folder.path().join("w");
        let stage = Stage::start(&world).unwrap();
        assert!(stage.bodies(&world).iter().all(|body| body.wireless.exists()));
        drop(stage);
        assert!(!world.join("robot-1").exists());
    }
}
