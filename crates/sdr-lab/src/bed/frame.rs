//! Ethernet frames, as far as the radio looks into them.

/// Longest frame: an MTU of 1500 and its header, with a tag.
pub(super) const FRAME_BYTES_MAX: usize = 1518;
/// First bytes of the addresses that robots have: locally administered, `sdr`.
const PREFIX: [u8; 4] = [0x02, b's', b'd', b'r'];

/// Whom a frame is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Receiver {
    /// One robot, by number from 0.
    One(usize),
    /// Everybody: broadcast and multicast.
    All,
}

/// The hardware address of a robot, by number from 0.
pub(super) fn mac(number: u16) -> [u8; 6] {
    let [high, low] = number.to_be_bytes();
    [PREFIX[0], PREFIX[1], PREFIX[2], PREFIX[3], high, low]
}

/// Whom the frame is for; `None` for strangers and for what is no frame.
pub(super) fn receiver(frame: &[u8]) -> Option<Receiver> {
    let to = frame.first_chunk::<14>()?;
    if to[0] & 1 == 1 {
        return Some(Receiver::All);
    }
    let own = to[..4] == PREFIX;
    own.then(|| Receiver::One(usize::from(u16::from_be_bytes([to[4], to[5]]))))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(to: [u8; 6]) -> Vec<u8> {
        let mut frame = to.to_vec();
        frame.extend([0; 8]);
        frame
    }

    #[test]
    fn robots_are_found_by_their_address_and_strangers_are_nobody() {
        assert_eq!(receiver(&frame(mac(258))), Some(Receiver::One(258)));
        assert_eq!(receiver(&frame([0xff; 6])), Some(Receiver::All));
        assert_eq!(receiver(&frame([0x01, 0, 0x5e, 1, 2, 3])), Some(Receiver::All));
        assert_eq!(receiver(&frame([0x02, 0, 0, 0, 0, 1])), None);
        assert_eq!(receiver(&mac(1)), None);
    }
}
