//! Cameras: a device of the robot, or pictures of a folder.

use std::marker::PhantomData;
use std::path::{Path, PathBuf};

use sdr_component::message::{
    builtin_interfaces::Time,
    sensor_msgs::{Image, ImageView},
};
use sdr_component::{Component, ComponentError, Context, OutPort, Outcome, Setup};
use sdr_lab::device::CameraClient;
use sdr_lab::optics::Picture;

use super::{DEVICE_TIMEOUT, Pictures, Unreadable};

/// Which camera it is.
pub trait Optics: 'static {
    /// Name of the component and of its device, and frame of its pictures.
    const NAME: &'static str;
    /// One sentence for people.
    const ABOUT: &'static str;
    /// Width and height of replayed pictures.
    const SIZE: (i64, i64);
}

/// The round camera of `OmnidirectionalCameraRTC`.
#[derive(Debug)]
pub enum FisheyeCamera {}

impl Optics for FisheyeCamera {
    const NAME: &'static str = "fisheye";
    const ABOUT: &'static str = "Takes round pictures of 180 degrees.";
    const SIZE: (i64, i64) = (240, 240);
}

/// The flat camera of `CameraRTC`.
#[derive(Debug)]
pub enum PerspectiveCamera {}

impl Optics for PerspectiveCamera {
    const NAME: &'static str = "camera";
    const ABOUT: &'static str = "Takes flat pictures of 70 degrees.";
    const SIZE: (i64, i64) = (160, 120);
}

/// Sends a picture each tick.
#[derive(Debug)]
pub struct Eye<O: Optics> {
    image: OutPort<Image>,
    place: Place,
    source: Option<Source>,
    optics: PhantomData<O>,
}

/// Where pictures shall come from.
#[derive(Debug)]
enum Place {
    Device(PathBuf),
    Folder { folder: PathBuf, width: u32, height: u32 },
}

/// Where pictures come from.
#[derive(Debug)]
enum Source {
    Device(Box<CameraClient>),
    Folder(Pictures),
}

impl<O: Optics> Component for Eye<O> {
    const NAME: &'static str = O::NAME;
    const ABOUT: &'static str = O::ABOUT;

    fn new(setup: &mut Setup) -> Result<Self, ComponentError> {
        let (width, height) = O::SIZE;
        let folder = setup.parameter(
            "images",
            String::new(),
            "folder of PNG and JPEG pictures to send in the order of their names instead of the \
             device's; empty for the device",
        )?;
        let sizes = 8..=4096;
        let width =
            setup.parameter_within("width", width, sizes.clone(), "of those pictures, pixels")?;
        let height =
            setup.parameter_within("height", height, sizes, "of those pictures, pixels")?;
        let place = if folder.is_empty() {
            Place::Device(setup.device_unless(O::NAME, "images")?)
        } else {
            let (width, height) = (u32::try_from(width)?, u32::try_from(height)?);
            Place::Folder { folder: PathBuf::from(folder), width, height }
        };
        let image = setup.output_of_size("image", 256 * 1024)?;
        Ok(Self { image, place, source: None, optics: PhantomData })
    }

    fn on_initialize(&mut self, context: &mut Context<'_>) -> Outcome {
        self.source = Some(match &self.place {
            Place::Device(path) => Source::Device(Box::new(connect(path)?)),
            Place::Folder { folder, width, height } => {
                let skipped =
                    &mut |one: &Unreadable| context.log(format_args!("passed over: {one}"));
                Source::Folder(Pictures::open(folder, (*width, *height), skipped)?)
            }
        });
        Ok(())
    }

    fn on_execute(&mut self, context: &mut Context<'_>) -> Outcome {
        match &mut self.source {
            Some(Source::Device(client)) => {
                let frame = client.frame().map_err(ComponentError::hardware_lost)?;
                send::<O>(&self.image, &frame.picture, frame.stamp_ns)
            }
            Some(Source::Folder(pictures)) => {
                let skipped =
                    &mut |one: &Unreadable| context.log(format_args!("passed over: {one}"));
                let picture = pictures.next_picture(skipped)?;
                send::<O>(&self.image, picture, context.now_ns())
            }
            None => Err(ComponentError::other("never initialised")),
        }
    }

    /// The device may have come back.
    fn on_reset(&mut self, context: &mut Context<'_>) -> Outcome {
        self.on_initialize(context)
    }

    fn on_finalize(&mut self, _: &mut Context<'_>) -> Outcome {
        self.source = None;
        Ok(())
    }
}

fn connect(path: &Path) -> Result<CameraClient, ComponentError> {
    CameraClient::connect(path, DEVICE_TIMEOUT).map_err(ComponentError::hardware_lost)
}

fn send<O: Optics>(port: &OutPort<Image>, picture: &Picture, stamp_ns: u64) -> Outcome {
    let (width, height) = (u32::try_from(picture.width)?, u32::try_from(picture.height)?);
    let stamp = Time::from_nanos(stamp_ns);
    port.send(&ImageView::rgb8(stamp, O::NAME, width, height, &picture.rgb))?;
    Ok(())
}
