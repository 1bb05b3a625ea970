//! `AnomalyDetectionRTC`: is there a dangerous object?

use sdr_component::message::{
    sensor_msgs::{Image, ImageView},
    std_msgs::Bool,
};
use sdr_component::{Component, ComponentError, Context, InPort, OutPort, Outcome, Setup};

use crate::vision::{View, Vote, find_red_box};

/// Judges every picture.
#[derive(Debug)]
pub struct Anomaly {
    image: InPort<Image>,
    danger: OutPort<Bool>,
    score_min: f64,
    vote: Vote,
}

impl Component for Anomaly {
    const NAME: &'static str = "anomaly";
    const ABOUT: &'static str = "Finds a dangerous object in pictures.";

    fn new(setup: &mut Setup) -> Result<Self, ComponentError> {
        let object = setup.parameter("object", String::from("red_box"), "what is dangerous")?;
        if object != "red_box" {
            let reason = format!("parameter `object` is {object}; allowed: red_box");
            return Err(ComponentError::other(reason));
        }
        let score_min = setup.parameter_within(
            "score_min",
            0.8,
            0.0..=1.0,
            "how sure one picture must be, 0 to 1",
        )?;
        let image = setup.input("image")?;
        let danger = setup.output("danger")?;
        Ok(Self { image, danger, score_min, vote: Vote::default() })
    }

    fn on_activated(&mut self, _: &mut Context<'_>) -> Outcome {
        self.vote = Vote::default();
        Ok(())
    }

    fn on_execute(&mut self, _: &mut Context<'_>) -> Outcome {
        while let Some(sample) = self.image.receive() {
            let view = view_of(&sample.message()?)?;
            let is_seen = find_red_box(&view).is_some_and(|found| found.score >= self.score_min);
            self.danger.send(&Bool { data: self.vote.handle(is_seen) })?;
        }
        Ok(())
    }
}

/// The pixels of a picture, when it is one that the detectors understand.
pub(super) fn view_of<'a>(image: &ImageView<'a>) -> Result<View<'a>, ComponentError> {
    if image.encoding != "rgb8" {
        let reason = format!("pictures are `{}`; allowed: rgb8", image.encoding);
        return Err(ComponentError::other(reason));
    }
    Ok(View::new(image.width as usize, image.height as usize, image.data)?)
}
