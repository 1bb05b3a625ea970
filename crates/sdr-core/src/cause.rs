//! What can be wrong: the rows of the paper's Table III, and those that a policy adds.

use alloc::string::String;
use core::fmt;

use serde::{
    Deserialize, Deserializer, Serialize, Serializer,
    de::{self, SeqAccess, Visitor},
    ser::SerializeTuple,
};
use thiserror::Error;

/// What is wrong. As text it is one word, such as `rssi-low`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Cause {
    /// Free memory of the robot is short.
    MemoryShort,
    /// The component takes too much CPU.
    ComponentCpuHigh,
    /// Its process ended, or never came up.
    Exited,
    /// No heartbeat from the execution thread.
    Hung,
    /// Error state without a reason.
    Error,
    /// Error state: hardware failed or was disconnected.
    HardwareLost,
    /// Error state: the robot behaves abnormally.
    AbnormalBehaviour,
    /// Error state: an emergency stop.
    EmergencyStop,
    /// The battery is low.
    BatteryLow,
    /// The robot takes too much CPU.
    RobotCpuHigh,
    /// The radio level is low.
    RssiLow,
    /// Links are slow.
    DelayHigh,
    /// Links are uneven.
    JitterHigh,
    /// Links lose too much.
    LossHigh,
    /// The robot is not heard any more.
    RobotGone,
    /// Its outputs come later than their readers' deadlines.
    DeadlineMissed,
    /// A cause that a policy, a component or a program of the operator's adds.
    Own(CauseName),
}

/// What stands for an own cause on the wire; the known ones stand for themselves.
const OWN_CODE: u8 = 127;

impl Cause {
    /// All but own ones, in the order of Table III; their place is their number on the wire,
    /// so that more are only appended.
    pub const KNOWN: [Self; 16] = [
        Self::MemoryShort,
        Self::ComponentCpuHigh,
        Self::Exited,
        Self::Hung,
        Self::Error,
        Self::HardwareLost,
        Self::AbnormalBehaviour,
        Self::EmergencyStop,
        Self::BatteryLow,
        Self::RobotCpuHigh,
        Self::RssiLow,
        Self::DelayHigh,
        Self::JitterHigh,
        Self::LossHigh,
        Self::RobotGone,
        Self::DeadlineMissed,
    ];

    /// The cause called `word`: a known one, or an own one of that name.
    pub fn from_word(word: &str) -> Result<Self, CauseNameError> {
        match Self::known(word) {
            Some(cause) => Ok(cause),
            None => CauseName::new(word).map(Self::Own),
        }
    }

    /// The known cause called `word`.
    pub fn known(word: &str) -> Option<Self> {
        Self::KNOWN.into_iter().find(|cause| cause.word() == word)
    }

    /// The word that stands in policies, events and reports.
    pub fn word(&self) -> &str {
        match self {
            Self::MemoryShort => "memory-short",
            Self::ComponentCpuHigh => "component-cpu-high",
            Self::Exited => "exited",
            Self::Hung => "hung",
            Self::Error => "error",
            Self::HardwareLost => "hardware-lost",
            Self::AbnormalBehaviour => "abnormal-behaviour",
            Self::EmergencyStop => "emergency-stop",
            Self::BatteryLow => "battery-low",
            Self::RobotCpuHigh => "robot-cpu-high",
            Self::RssiLow => "rssi-low",
            Self::DelayHigh => "delay-high",
            Self::JitterHigh => "jitter-high",
            Self::LossHigh => "loss-high",
            Self::RobotGone => "robot-gone",
            Self::DeadlineMissed => "deadline-missed",
            Self::Own(name) => name.as_str(),
        }
    }

    /// Whether it is an event, reported as it happens, rather than a figure over time. Own
    /// causes may be either; a policy knows ([`crate::recover::Recovery::is_event`]).
    pub fn is_event(self) -> bool {
        match self {
            Self::Exited
            | Self::Hung
            | Self::Error
            | Self::HardwareLost
            | Self::AbnormalBehaviour
            | Self::EmergencyStop
            | Self::RobotGone
            | Self::Own(_) => true,
            Self::MemoryShort
            | Self::ComponentCpuHigh
            | Self::BatteryLow
            | Self::RobotCpuHigh
            | Self::RssiLow
            | Self::DelayHigh
            | Self::JitterHigh
            | Self::LossHigh
            | Self::DeadlineMissed => false,
        }
    }

    /// Whether the whole robot or its links are ill, so that nothing should go there.
    pub fn is_of_robot(self) -> bool {
        match self {
            Self::MemoryShort
            | Self::BatteryLow
            | Self::RobotCpuHigh
            | Self::RssiLow
            | Self::DelayHigh
            | Self::JitterHigh
            | Self::LossHigh
            | Self::RobotGone => true,
            Self::ComponentCpuHigh
            | Self::Exited
            | Self::Hung
            | Self::Error
            | Self::HardwareLost
            | Self::AbnormalBehaviour
            | Self::EmergencyStop
            | Self::DeadlineMissed
            | Self::Own(_) => false,
        }
    }

    fn code(self) -> Option<u8> {
        let place = Self::KNOWN.iter().position(|cause| *cause == self)?;
        u8::try_from(place).ok()
    }
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.word())
    }
}

/// In text a word; in postcard a number, and behind 127 a name.
impl Serialize for Cause {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if serializer.is_human_readable() {
            return serializer.serialize_str(self.word());
        }
        let mut tuple = serializer.serialize_tuple(2)?;
        match self.code() {
            Some(code) => tuple.serialize_element(&code)?,
            None => {
                tuple.serialize_element(&OWN_CODE)?;
                tuple.serialize_element(self.word())?;
            }
        }
        tuple.end()
    }
}

impl<'de> Deserialize<'de> for Cause {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        if deserializer.is_human_readable() {
            let word = String::deserialize(deserializer)?;
            return Self::from_word(&word).map_err(de::Error::custom);
        }
        deserializer.deserialize_tuple(2, Wire)
    }
}

struct Wire;

impl<'de> Visitor<'de> for Wire {
    type Value = Cause;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the number of a cause")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut parts: A) -> Result<Cause, A::Error> {
        let lacks = || de::Error::custom("a cause is cut off");
        let code: u8 = parts.next_element()?.ok_or_else(lacks)?;
        if code == OWN_CODE {
            let name: String = parts.next_element()?.ok_or_else(lacks)?;
            return CauseName::new(&name).map(Cause::Own).map_err(de::Error::custom);
        }
        let known = Cause::KNOWN.get(usize::from(code)).copied();
        known.ok_or_else(|| de::Error::custom("a cause of a later version"))
    }
}

/// Longest name of an own cause, in bytes.
pub const CAUSE_BYTES_MAX: usize = 24;

/// The name of an own cause: `[a-z][a-z0-9-]*`, at most [`CAUSE_BYTES_MAX`] bytes.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct CauseName {
    /// Zeros behind the name, so that the order is that of the words.
    bytes: [u8; CAUSE_BYTES_MAX],
}

/// A word that cannot name a cause. Nothing changed; whoever wrote it can mend it.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error(
    "`{found}` names no cause; allowed: a letter first, then letters, digits and single `-`, lower \
     case, at most {CAUSE_BYTES_MAX} characters"
)]
pub struct CauseNameError {
    /// The word as given, cut to what may be shown.
    pub found: String,
}

impl CauseName {
    /// The name `word`, when it is one.
    pub fn new(word: &str) -> Result<Self, CauseNameError> {
        let starts = word.starts_with(|first: char| first.is_ascii_lowercase());
        let fine = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'-';
        let whole = starts && word.bytes().all(fine) && !word.ends_with('-');
        if !whole || word.contains("--") || word.len() > CAUSE_BYTES_MAX {
            return Err(CauseNameError { found: word.chars().take(40).collect() });
        }
        let mut bytes = [0; CAUSE_BYTES_MAX];
        bytes[..word.len()].copy_from_slice(word.as_bytes());
        Ok(Self { bytes })
    }

    /// The name as text.
    pub fn as_str(&self) -> &str {
        let len = self.bytes.iter().position(|byte| *byte == 0).unwrap_or(CAUSE_BYTES_MAX);
        core::str::from_utf8(&self.bytes[..len]).expect("a checked name is ASCII")
    }
}

impl fmt::Debug for CauseName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_cause_keeps_its_word_and_its_number() {
        let own = Cause::from_word("cooking").unwrap();
        for (number, cause) in Cause::KNOWN.into_iter().chain([own]).enumerate() {
            assert_eq!(Cause::from_word(cause.word()), Ok(cause));
            let bytes = postcard::to_allocvec(&(cause, 7_u8)).unwrap();
            assert_eq!(postcard::from_bytes(&bytes), Ok((cause, 7_u8)));
            if cause != own {
                // What a derived enum had on the wire before there were own causes.
                assert_eq!(bytes, [u8::try_from(number).unwrap(), 7]);
            }
        }
    }

    #[test]
    fn a_name_is_one_lower_case_word() {
        for good in ["a", "too-hot", "zone-2", "abcdefghijklmnopqrstuvwx"] {
            assert_eq!(CauseName::new(good).unwrap().as_str(), good);
        }
        for bad in ["", "-a", "a-", "a--b", "A", "2a", "a b", "ä", "abcdefghijklmnopqrstuvwxy"] {
            assert!(CauseName::new(bad).is_err(), "{bad:?}");
        }
    }

    #[test]
    fn numbers_of_later_versions_and_bad_names_are_errors() {
        for bytes in [&[16_u8][..], &[OWN_CODE, 1, b'A'], &[OWN_CODE], &[]] {
            assert!(postcard::from_bytes::<Cause>(bytes).is_err(), "{bytes:?}");
        }
    }
}
