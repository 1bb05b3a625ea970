//! The hand of the host program in the world.

use std::io;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread::{Builder, JoinHandle};

use super::camera::Camera;
use super::config::{RobotPaths, WorldConfig};
use super::eyes::Eye;
use super::peer::Device;
use super::state::{CommandGaps, Shared, Snapshot, Truth};
use super::{WorldError, air, bodies, eyes};
use crate::device::{DeviceKind, Greeting, PROTOCOL};
use crate::noise::Noise;
use crate::radio::Fade;
use crate::tunnel::DangerousObject;

/// A running world. Dropping it ends it like [`WorldHandle::stop`].
#[derive(Debug)]
pub struct WorldHandle {
    shared: Arc<Shared>,
    folder: PathBuf,
    paths: Vec<RobotPaths>,
    /// Closing these wakes the threads to their end.
    wakes: Vec<UnixStream>,
    threads: Vec<JoinHandle<()>>,
}

/// Starts a world whose configuration has been checked.
pub(super) fn start(config: WorldConfig) -> Result<WorldHandle, WorldError> {
    let WorldConfig { folder, rovers, seed, schedule } = config;
    let paths: Vec<RobotPaths> =
        rovers.iter().map(|rover| RobotPaths::new(&folder, &rover.name)).collect();
    let names: Vec<String> = rovers.iter().map(|rover| rover.name.clone()).collect();
    let shared = Arc::new(Shared::new(seed, rovers, schedule));
    // From here on dropping the handle removes what was made.
    let mut handle =
        WorldHandle { shared, folder, paths: Vec::new(), wakes: Vec::new(), threads: Vec::new() };
    let (perspective, fisheye) = (Arc::new(Camera::perspective()), Arc::new(Camera::fisheye()));
    let (mut wheels, mut sights, mut cameras) = (Vec::new(), Vec::new(), Vec::new());
    for (index, (name, paths)) in names.iter().zip(paths).enumerate() {
        let tell = |source| WorldError::Io { path: paths.folder.clone(), source };
        std::fs::create_dir_all(&paths.folder).map_err(tell)?;
        handle.paths.push(paths.clone());
        wheels.push(device(name, &paths.wheels, DeviceKind::Wheels, None)?);
        for (kind, path, camera) in [
            (DeviceKind::Camera, &paths.camera, &perspective),
            (DeviceKind::Fisheye, &paths.fisheye, &fisheye),
        ] {
            cameras.push(device(name, path, kind, Some(camera))?);
            let noise = Noise::stream(seed, 1000 + sights.len() as u64);
            sights.push(Eye::new(camera.clone(), index, noise));
        }
        air::write(&handle.shared, index, &paths).map_err(tell)?;
    }
    let shared = handle.shared.clone();
    handle.spawn("world-bodies", move |wake| bodies::run(&shared, wheels, &wake))?;
    let shared = handle.shared.clone();
    handle.spawn("world-eyes", move |wake| eyes::run(&shared, sights, cameras, &wake))?;
    let (shared, paths) = (handle.shared.clone(), handle.paths.clone());
    handle.spawn("world-air", move |wake| air::run(&shared, &paths, &wake))?;
    Ok(handle)
}

/// Makes one device's socket; a socket left over by a dead world is replaced.
fn device(
    robot: &str,
    path: &Path,
    kind: DeviceKind,
    camera: Option<&Arc<Camera>>,
) -> Result<Device, WorldError> {
    let bind = || {
        remove(path)?;
        let listener = UnixListener::bind(path)?;
        listener.set_nonblocking(true)?;
        Ok(listener)
    };
    let listener = bind().map_err(|source| WorldError::Io { path: path.to_owned(), source })?;
    let greeting = Greeting {
        device: kind,
        protocol: PROTOCOL,
        robot: robot.to_owned(),
        width: camera.map(|camera| camera.size().0),
        height: camera.map(|camera| camera.size().1),
        lens: camera.map(|camera| camera.lens()),
        rate_hz: (kind == DeviceKind::Wheels).then_some(bodies::READINGS_HZ),
    };
    Ok(Device { listener, greeting, peers: Vec::new() })
}

fn remove(path: &Path) -> io::Result<()> {
    match std::fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        Ok(()) | Err(_) => Ok(()),
    }
}

impl WorldHandle {
    /// Starts the fade of a robot's radio now.
    pub fn fade(&self, robot: &str, fade: Fade) -> Result<(), WorldError> {
        for (name, value) in [("from_dbm", fade.from_dbm), ("to_dbm", fade.to_dbm)] {
            if !(-110.0..=-10.0).contains(&value) {
                return Err(WorldError::OutOfRange { name, value, allowed: "-110 to -10 dBm" });
            }
        }
        let elapsed = self.shared.elapsed();
        self.with(robot, |truth, index| truth.bodies[index].radio.start_fade(elapsed, fade))
    }

    /// Puts the dangerous object somewhere; it is moved if it stands elsewhere.
    pub fn place_object(&self, object: DangerousObject) -> Result<(), WorldError> {
        let inside = object.x.is_finite() && object.y.is_finite();
        if !inside || !(0.05..=2.0).contains(&object.edge_m) {
            let value = object.edge_m;
            return Err(WorldError::OutOfRange { name: "edge_m", value, allowed: "0.05 to 2 m" });
        }
        self.shared.truth().object = Some(object);
        Ok(())
    }

    /// Puts the dangerous object before a robot, inside the tunnel.
    pub fn place_object_ahead(&self, robot: &str, distance_m: f64) -> Result<(), WorldError> {
        if !(0.0..=30.0).contains(&distance_m) {
            let (name, value) = ("distance_m", distance_m);
            return Err(WorldError::OutOfRange { name, value, allowed: "0 to 30 m" });
        }
        self.with(robot, |truth, index| truth.place_ahead(index, distance_m))
    }

    /// Takes the dangerous object away.
    pub fn remove_object(&self) {
        self.shared.truth().object = None;
    }

    /// Ends the world: threads joined, sockets, files and folders it made removed.
    pub fn stop(self) {
        drop(self);
    }

    /// The truth now.
    pub fn snapshot(&self) -> Snapshot {
        self.shared.truth().snapshot(self.shared.elapsed())
    }

    /// When commands reached the wheels, monotonic nanoseconds, oldest first (the newest
    /// 100,000).
    pub fn command_times(&self, robot: &str) -> Result<Vec<u64>, WorldError> {
        self.with(robot, |truth, index| truth.bodies[index].commands().iter().copied().collect())
    }

    /// Pauses of the command stream that overlap a window of the monotonic clock
    /// ([`super::monotonic_ns`]); `None` when fewer than two commands came.
    pub fn command_gaps(
        &self,
        robot: &str,
        from_ns: u64,
        until_ns: u64,
    ) -> Result<Option<CommandGaps>, WorldError> {
        self.with(robot, |truth, index| {
            CommandGaps::between(truth.bodies[index].commands(), from_ns, until_ns)
        })
    }

    /// Where the devices and files of all robots are, in the order of the configuration.
    pub fn paths(&self) -> &[RobotPaths] {
        &self.paths
    }

    /// When the world began, monotonic nanoseconds.
    pub fn started_ns(&self) -> u64 {
        self.shared.started_ns
    }

    fn with<T>(
        &self,
        robot: &str,
        ask: impl FnOnce(&mut Truth, usize) -> T,
    ) -> Result<T, WorldError> {
        let mut truth = self.shared.truth();
        let index = truth.find(robot);
        let index = index.ok_or_else(|| WorldError::UnknownRobot { name: robot.to_owned() })?;
        Ok(ask(&mut truth, index))
    }

    fn spawn(
        &mut self,
        name: &str,
        run: impl FnOnce(UnixStream) + Send + 'static,
    ) -> Result<(), WorldError> {
        let tell = |source| WorldError::Io { path: self.folder.clone(), source };
        let (ours, theirs) = UnixStream::pair().map_err(tell)?;
        let thread =
            Builder::new().name(name.to_owned()).spawn(move || run(theirs)).map_err(tell)?;
        self.wakes.push(ours);
        self.threads.push(thread);
        Ok(())
    }
}

impl Drop for WorldHandle {
    fn drop(&mut self) {
        self.wakes.clear();
        for thread in self.threads.drain(..) {
            // A thread that panicked has already said so.
            let _ = thread.join();
        }
        for paths in &self.paths {
            for file in
                [&paths.fisheye, &paths.camera, &paths.wheels, &paths.wireless, &paths.battery]
            {
                let _ = remove(file);
            }
            // Stays when somebody else keeps something there.
            let _ = std::fs::remove_dir(&paths.folder);
        }
    }
}
