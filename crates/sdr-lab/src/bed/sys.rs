//! The few calls that the compiler cannot check, each with its reason.
#![expect(unsafe_code, reason = "TAP devices and namespaces have no safe calls")]

use std::{
    ffi::CString,
    fs::File,
    io,
    mem::zeroed,
    net::Ipv4Addr,
    os::{
        fd::{AsRawFd as _, FromRawFd as _, OwnedFd},
        unix::ffi::OsStrExt as _,
    },
    path::Path,
    ptr::{from_mut, null},
};

use rustix::{
    fs::{Mode, OFlags},
    net::{AddressFamily, SocketType},
    thread::{UnshareFlags, unshare_unsafe},
};

/// Where the kernel gives out TAP devices.
pub(super) const TUN: &str = "/dev/net/tun";

/// Moves this process into fresh namespaces. It must have one thread only.
pub(super) fn leave(what: UnshareFlags) -> io::Result<()> {
    // SAFETY: the flags that callers give are namespaces; tables of descriptors stay shared.
    unsafe { unshare_unsafe(what) }.map_err(io::Error::from)
}

/// Makes the TAP device `name` in this network namespace; it goes with its descriptor.
pub(super) fn tap(name: &str) -> io::Result<OwnedFd> {
    let flags = OFlags::RDWR | OFlags::CLOEXEC | OFlags::NONBLOCK;
    let file = rustix::fs::open(TUN, flags, Mode::empty())?;
    let mut request = request(name);
    let kind = libc::IFF_TAP | libc::IFF_NO_PI;
    request.ifr_ifru.ifru_flags = libc::c_short::try_from(kind).map_err(io::Error::other)?;
    // SAFETY: TUNSETIFF reads and writes one ifreq, which lives until the call returns.
    let answer = unsafe { libc::ioctl(file.as_raw_fd(), libc::TUNSETIFF, from_mut(&mut request)) };
    told(answer)?;
    Ok(file)
}

/// What an interface is given.
#[derive(Clone, Copy, Debug)]
pub(super) struct Address {
    pub(super) mac: [u8; 6],
    pub(super) ip: Ipv4Addr,
    pub(super) mask: Ipv4Addr,
}

/// Gives `name` its addresses, brings it up, and sends everything out by it.
pub(super) fn configure(name: &str, address: &Address) -> io::Result<()> {
    let socket = rustix::net::socket(AddressFamily::INET, SocketType::DGRAM, None)?;
    let mut hardware = request(name);
    hardware.ifr_ifru.ifru_hwaddr = mac(address.mac);
    set(&socket, libc::SIOCSIFHWADDR, &mut hardware)?;
    for (what, value) in [(libc::SIOCSIFADDR, address.ip), (libc::SIOCSIFNETMASK, address.mask)] {
        let mut change = request(name);
        change.ifr_ifru.ifru_addr = inet(value);
        set(&socket, what, &mut change)?;
    }
    up(name)?;
    default_route(&socket, name)
}

/// Brings an interface up.
pub(super) fn up(name: &str) -> io::Result<()> {
    let socket = rustix::net::socket(AddressFamily::INET, SocketType::DGRAM, None)?;
    let mut change = request(name);
    let flags = libc::IFF_UP | libc::IFF_RUNNING | libc::IFF_MULTICAST;
    change.ifr_ifru.ifru_flags = libc::c_short::try_from(flags).map_err(io::Error::other)?;
    set(&socket, libc::SIOCSIFFLAGS, &mut change)
}

/// Multicast has no other way to find its interface.
fn default_route(socket: &OwnedFd, name: &str) -> io::Result<()> {
    let mut device = name_of(name);
    // SAFETY: rtentry is plain data of the kernel; all zeros is an empty one.
    let mut route: libc::rtentry = unsafe { zeroed() };
    route.rt_dst = inet(Ipv4Addr::UNSPECIFIED);
    route.rt_genmask = inet(Ipv4Addr::UNSPECIFIED);
    route.rt_gateway = inet(Ipv4Addr::UNSPECIFIED);
    route.rt_flags = libc::RTF_UP;
    route.rt_dev = device.as_mut_ptr();
    // SAFETY: SIOCADDRT reads one rtentry and the name it points to; both outlive the call.
    told(unsafe { libc::ioctl(socket.as_raw_fd(), libc::SIOCADDRT, from_mut(&mut route)) })
}

fn set(socket: &OwnedFd, what: libc::c_ulong, request: &mut libc::ifreq) -> io::Result<()> {
    // SAFETY: these requests read one ifreq, which lives until the call returns.
    told(unsafe { libc::ioctl(socket.as_raw_fd(), what, from_mut(request)) })
}

fn told(answer: libc::c_int) -> io::Result<()> {
    if answer < 0 { Err(io::Error::last_os_error()) } else { Ok(()) }
}

fn request(name: &str) -> libc::ifreq {
    // SAFETY: ifreq is plain data of the kernel; all zeros is an empty one.
    let mut request: libc::ifreq = unsafe { zeroed() };
    request.ifr_name = name_of(name);
    request
}

/// At most 15 bytes and a zero.
fn name_of(name: &str) -> [libc::c_char; libc::IFNAMSIZ] {
    let mut text = [0; libc::IFNAMSIZ];
    for (place, byte) in text.iter_mut().zip(name.bytes().take(libc::IFNAMSIZ - 1)) {
        *place = libc::c_char::from_ne_bytes([byte]);
    }
    text
}

fn inet(address: Ipv4Addr) -> libc::sockaddr {
    let mut data = [0; 14];
    // Two bytes of the port go before.
    for (place, byte) in data.iter_mut().skip(2).zip(address.octets()) {
        *place = libc::c_char::from_ne_bytes([byte]);
    }
    let family = libc::sa_family_t::try_from(libc::AF_INET).unwrap_or_default();
    libc::sockaddr { sa_family: family, sa_data: data }
}

fn mac(address: [u8; 6]) -> libc::sockaddr {
    let mut data = [0; 14];
    for (place, byte) in data.iter_mut().zip(address) {
        *place = libc::c_char::from_ne_bytes([byte]);
    }
    libc::sockaddr { sa_family: libc::ARPHRD_ETHER, sa_data: data }
}

/// Makes the calling process's namespaces of users say that it is root in them.
pub(super) fn map_root(user: u32, group: u32) -> io::Result<()> {
    use std::io::Write as _;
    let write = |path: &str, text: String| {
        File::options().write(true).open(path)?.write_all(text.as_bytes())
    };
    write("/proc/self/setgroups", "deny".to_owned())?;
    write("/proc/self/uid_map", format!("0 {user} 1"))?;
    write("/proc/self/gid_map", format!("0 {group} 1"))
}

/// Whatever is mounted from now on stays in this namespace.
pub(super) fn keep_mounts_here() -> io::Result<()> {
    mount(None, Path::new("/"), None, libc::MS_PRIVATE | libc::MS_REC, None)
}

/// A /proc of this tree of processes.
pub(super) fn mount_proc() -> io::Result<()> {
    let flags = libc::MS_NOSUID | libc::MS_NODEV | libc::MS_NOEXEC;
    mount(Some(Path::new("proc")), Path::new("/proc"), Some("proc"), flags, None)
}

/// An empty disk in memory.
pub(super) fn mount_tmpfs(folder: &Path, options: &str) -> io::Result<()> {
    let flags = libc::MS_NOSUID | libc::MS_NODEV;
    mount(Some(Path::new("tmpfs")), folder, Some("tmpfs"), flags, Some(options))
}

/// Shows `file` where `place` was.
pub(super) fn mount_file(file: &Path, place: &Path) -> io::Result<()> {
    mount(Some(file), place, None, libc::MS_BIND, None)
}

fn mount(
    what: Option<&Path>,
    place: &Path,
    kind: Option<&str>,
    flags: libc::c_ulong,
    options: Option<&str>,
) -> io::Result<()> {
    let text = |text: Option<&[u8]>| text.map(CString::new).transpose();
    let what = text(what.map(|path| path.as_os_str().as_bytes()))?;
    let place = CString::new(place.as_os_str().as_bytes())?;
    let (kind, options) = (text(kind.map(str::as_bytes))?, text(options.map(str::as_bytes))?);
    let pointer = |text: &Option<CString>| text.as_ref().map_or(null(), |text| text.as_ptr());
    // SAFETY: every pointer is null or a text with its end, which lives until the call returns.
    told(unsafe {
        libc::mount(
            pointer(&what),
            place.as_ptr(),
            pointer(&kind),
            flags,
            pointer(&options).cast::<libc::c_void>(),
        )
    })
}

/// From here on, each call of this thread and of what it starts that waits for the disk is held until
/// [`next_sync`] tells of it and [`let_go`] frees it.
pub(super) fn hold_syncs() -> io::Result<OwnedFd> {
    let word = |code: u32| libc::__u16::try_from(code).unwrap_or_default();
    let number = u32::try_from(std::mem::offset_of!(libc::seccomp_data, nr)).unwrap_or_default();
    let held = [libc::SYS_fsync, libc::SYS_fdatasync];
    let count = u8::try_from(held.len()).unwrap_or_default();
    let load = word(libc::BPF_LD | libc::BPF_W | libc::BPF_ABS);
    let (jump, give) =
        (word(libc::BPF_JMP | libc::BPF_JEQ | libc::BPF_K), word(libc::BPF_RET | libc::BPF_K));
    let line = |code, k, jt| libc::sock_filter { code, jt, jf: 0, k };
    let mut filter = vec![line(load, number, 0)];
    for (index, call) in (0..count).zip(held) {
        // Over the remaining comparisons and the line that allows.
        filter.push(line(jump, u32::try_from(call).unwrap_or(u32::MAX), count - index));
    }
    filter.push(line(give, libc::SECCOMP_RET_ALLOW, 0));
    filter.push(line(give, libc::SECCOMP_RET_USER_NOTIF, 0));
    let length = libc::c_ushort::try_from(filter.len()).map_err(io::Error::other)?;
    let program = libc::sock_fprog { len: length, filter: filter.as_mut_ptr() };
    rustix::thread::set_no_new_privs(true)?;
    // SAFETY: the kernel copies the program, which lives until the call returns; the answer is a fresh
    // descriptor of ours, or negative.
    unsafe {
        let answer = libc::syscall(
            libc::SYS_seccomp,
            libc::SECCOMP_SET_MODE_FILTER,
            libc::SECCOMP_FILTER_FLAG_NEW_LISTENER,
            &raw const program,
        );
        let descriptor = libc::c_int::try_from(answer).map_err(io::Error::other)?;
        told(descriptor)?;
        Ok(OwnedFd::from_raw_fd(descriptor))
    }
}

/// A call that is held.
#[derive(Clone, Copy, Debug)]
pub(super) struct Held {
    pub(super) id: u64,
    /// Whose, in this tree of processes.
    pub(super) pid: u32,
    /// Of which file.
    pub(super) descriptor: u64,
}

/// Waits for the next call that is held.
pub(super) fn next_sync(listener: &OwnedFd) -> io::Result<Held> {
    // SAFETY: plain data of the kernel, which wants it zeroed.
    let mut call: libc::seccomp_notif = unsafe { zeroed() };
    // SAFETY: the request writes one seccomp_notif, which lives until the call returns.
    told(unsafe {
        libc::ioctl(listener.as_raw_fd(), libc::SECCOMP_IOCTL_NOTIF_RECV, from_mut(&mut call))
    })?;
    Ok(Held { id: call.id, pid: call.pid, descriptor: call.data.args[0] })
}

/// Lets a held call go on.
pub(super) fn let_go(listener: &OwnedFd, id: u64) -> io::Result<()> {
    let flags = u32::try_from(libc::SECCOMP_USER_NOTIF_FLAG_CONTINUE).map_err(io::Error::other)?;
    let mut answer = libc::seccomp_notif_resp { id, val: 0, error: 0, flags };
    // SAFETY: the request reads one seccomp_notif_resp, which lives until the call returns.
    told(unsafe {
        libc::ioctl(listener.as_raw_fd(), libc::SECCOMP_IOCTL_NOTIF_SEND, from_mut(&mut answer))
    })
}
