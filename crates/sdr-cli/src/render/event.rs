//! One event, one line.

use sdr_core::api::EventView;

use super::units::{clock, one_line};

/// `12:03:04.567  robot-2  placed  camera: first that fits`.
pub(crate) fn line(view: &EventView) -> String {
    let event = &view.event;
    let reason = one_line(&event.reason);
    let about = match (&event.system, &event.component) {
        (_, Some(component)) => format!("{component}: "),
        (Some(system), None) => format!("{system}: "),
        (None, None) => String::new(),
    };
    let epoch = match &event.token {
        Some(token) => format!("  (epoch {}, run {})", token.epoch.number, token.run),
        None => String::new(),
    };
    format!(
        "{}  {:<9} {:<18} {about}{reason}{epoch}",
        clock(view.wall_ms),
        event.robot,
        one_line(&event.kind)
    )
}

#[cfg(test)]
mod tests {
    use sdr_core::{
        event::Event,
        id::{ComponentKey, Name, RobotId},
    };

    use super::*;

    #[test]
    fn an_event_says_when_where_what_and_why() {
        let robot = RobotId::new("robot-2").unwrap();
        let key = ComponentKey::new(&Name::new("moon").unwrap(), &Name::new("camera").unwrap());
        let event = Event::new("placed", &robot, "robot-1: memory_free 310 MB, bar 500 MB");
        let view = EventView {
            sequence: 7,
            wall_ms: 43_384_567,
            monotonic_ns: 1,
            event: event.about(&key),
        };
        assert_eq!(
            line(&view),
            "12:03:04.567  robot-2   placed             camera: robot-1: memory_free 310 MB, bar 500 MB"
        );
    }
}
