//! A slow disk: every call that waits for it waits longer.

use std::{
    fs, io,
    os::fd::OwnedFd,
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
        mpsc,
    },
    thread,
    time::Duration,
};

use super::sys;

/// The disk of all processes that the calling thread starts.
#[derive(Debug)]
pub(super) struct Disk {
    delay_ns: Arc<AtomicU64>,
}

impl Disk {
    /// Takes hold of the disk; it is as fast as ever at first.
    pub(super) fn hold() -> io::Result<Self> {
        let delay_ns = Arc::new(AtomicU64::new(0));
        let (sender, receiver) = mpsc::channel();
        let delay = Arc::clone(&delay_ns);
        // Begun before calls are held, so that its own never are.
        let serve = move || {
            if let Ok(listener) = receiver.recv() {
                serve(&listener, &delay);
            }
        };
        thread::Builder::new().name("disk".to_owned()).spawn(serve)?;
        let listener = sys::hold_syncs()?;
        sender.send(listener).map_err(io::Error::other)?;
        Ok(Self { delay_ns })
    }

    /// How long each write to the platter takes from now on.
    pub(super) fn slow(&self, delay: Duration) {
        self.delay_ns.store(crate::cast::nanoseconds(delay), Ordering::Relaxed);
    }
}

/// One call after the other, as a platter does.
fn serve(listener: &OwnedFd, delay_ns: &AtomicU64) {
    loop {
        match sys::next_sync(listener) {
            Ok(call) => {
                if is_on_disk(&call) {
                    thread::sleep(Duration::from_nanos(delay_ns.load(Ordering::Relaxed)));
                }
                // Its process may have ended meanwhile.
                let _ = sys::let_go(listener, call.id);
            }
            // One that ended before it was told of; the next call is another.
            Err(error) if error.kind() == io::ErrorKind::NotFound => {}
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(_) => return,
        }
    }
}

/// Shared memory has no platter.
fn is_on_disk(call: &sys::Held) -> bool {
    let link = format!("/proc/{}/fd/{}", call.pid, call.descriptor);
    fs::read_link(link).is_ok_and(|path| !path.starts_with("/dev/shm"))
}
