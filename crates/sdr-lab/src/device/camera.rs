//! The client of a camera.

use std::io::{ErrorKind, Read, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::Duration;

use super::{
    CameraAnswer, CameraRequest, DeviceError, DeviceKind, FrameHeader, Greeting, LineBuffer,
    PICTURE_BYTES_MAX, PROTOCOL, Wanted, error::beginning, line_of,
};
use crate::optics::{Lens, Picture};

/// A picture and when it was taken.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Frame {
    /// What the camera saw.
    pub picture: Picture,
    /// Monotonic clock of the machine, nanoseconds.
    pub stamp_ns: u64,
    /// Counts the pictures of this camera.
    pub sequence: u64,
}

/// A connection to a perspective camera or a fisheye; waits for its answers.
#[derive(Debug)]
pub struct CameraClient {
    stream: UnixStream,
    lines: LineBuffer,
    greeting: Greeting,
    lens: Lens,
    timeout: Duration,
}

impl CameraClient {
    /// Connects; `timeout` (more than zero) bounds every single wait from now on.
    pub fn connect(path: &Path, timeout: Duration) -> Result<Self, DeviceError> {
        let (stream, mut lines) = open(path, timeout)?;
        let greeting = greeting(&stream, &mut lines, path, timeout, "a camera")?;
        match (greeting.device, greeting.lens) {
            (DeviceKind::Camera | DeviceKind::Fisheye, Some(lens)) => {
                Ok(Self { stream, lines, greeting, lens, timeout })
            }
            (DeviceKind::Camera | DeviceKind::Fisheye | DeviceKind::Wheels, _) => {
                Err(DeviceError::Unexpected {
                    path: path.to_owned(),
                    wanted: "a camera",
                    found: beginning(&line_of(&greeting)),
                })
            }
        }
    }

    /// Takes a picture now and waits for it.
    pub fn frame(&mut self) -> Result<Frame, DeviceError> {
        self.stream.write_all(&line_of(&CameraRequest::Get(Wanted::Frame)))?;
        let line = next_line(&self.stream, &mut self.lines, self.timeout)?;
        let header = match serde_json::from_slice(&line) {
            Ok(CameraAnswer::Frame(header)) => header,
            Ok(CameraAnswer::Error(reason)) => return Err(DeviceError::Refused { reason }),
            Err(_) => return Err(DeviceError::garbled(&line, "a frame or an error")),
        };
        if !is_sane(&header) {
            return Err(DeviceError::garbled(&line, "3 bytes a pixel, at most 16 MiB"));
        }
        let mut rgb = self.lines.take_rest();
        let came = rgb.len();
        if came > header.bytes {
            return Err(DeviceError::garbled(&line, "nothing after the picture"));
        }
        rgb.resize(header.bytes, 0);
        (&self.stream).read_exact(&mut rgb[came..]).map_err(|error| silent(error, self.timeout))?;
        let picture = Picture { width: header.width, height: header.height, rgb };
        Ok(Frame { picture, stamp_ns: header.stamp_ns, sequence: header.sequence })
    }

    /// What the camera said of itself.
    pub fn greeting(&self) -> &Greeting {
        &self.greeting
    }

    /// Its lens.
    pub fn lens(&self) -> Lens {
        self.lens
    }
}

fn is_sane(header: &FrameHeader) -> bool {
    let pixels = header.width.checked_mul(header.height).and_then(|pixels| pixels.checked_mul(3));
    pixels == Some(header.bytes) && header.bytes <= PICTURE_BYTES_MAX
}

/// Connects and sets the time limits.
pub(super) fn open(
    path: &Path,
    timeout: Duration,
) -> Result<(UnixStream, LineBuffer), DeviceError> {
    let absent = |source| DeviceError::Absent { path: path.to_owned(), source };
    let stream = UnixStream::connect(path).map_err(absent)?;
    stream.set_read_timeout(Some(timeout))?;
    stream.set_write_timeout(Some(timeout))?;
    Ok((stream, LineBuffer::default()))
}

/// Reads and checks the first line.
pub(super) fn greeting(
    stream: &UnixStream,
    lines: &mut LineBuffer,
    path: &Path,
    timeout: Duration,
    wanted: &'static str,
) -> Result<Greeting, DeviceError> {
    let line = next_line(stream, lines, timeout)?;
    let greeting: Option<Greeting> = serde_json::from_slice(&line).ok();
    greeting.filter(|greeting| greeting.protocol == PROTOCOL).ok_or_else(|| {
        DeviceError::Unexpected { path: path.to_owned(), wanted, found: beginning(&line) }
    })
}

/// Waits for a line.
fn next_line(
    mut stream: &UnixStream,
    lines: &mut LineBuffer,
    timeout: Duration,
) -> Result<Vec<u8>, DeviceError> {
    let mut chunk = [0; 512];
    loop {
        let line = lines.next_line();
        if let Some(line) = line.map_err(|_| DeviceError::garbled(b"", "lines of 512 bytes"))? {
            return Ok(line);
        }
        match stream.read(&mut chunk).map_err(|error| silent(error, timeout))? {
            0 => return Err(DeviceError::hung_up()),
            count => lines.push(&chunk[..count]),
        }
    }
}

/// A read that ran into the limit is silence, anything else a broken connection.
fn silent(error: std::io::Error, timeout: Duration) -> DeviceError {
    let kind = error.kind();
    if kind == ErrorKind::WouldBlock || kind == ErrorKind::TimedOut {
        DeviceError::Silent { waited_ms: timeout.as_millis() }
    } else if kind == ErrorKind::UnexpectedEof {
        DeviceError::hung_up()
    } else {
        DeviceError::Broken(error)
    }
}
