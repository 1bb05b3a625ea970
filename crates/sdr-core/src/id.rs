//! Who and what: robots, names, components.

use alloc::string::{String, ToString};
use core::{
    cmp::Ordering,
    fmt,
    hash::{Hash, Hasher},
    marker::PhantomData,
    str::FromStr,
};

use serde::{
    Deserialize, Deserializer, Serialize, Serializer,
    de::{self, Visitor},
};
use thiserror::Error;

/// Longest name of a robot, system, component or port, in bytes.
pub const NAME_BYTES_MAX: usize = 32;

/// Why a word is not a name.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum NameError {
    /// Nothing was given.
    #[error(
        "a name is empty; allowed: 1 to {NAME_BYTES_MAX} characters of [a-z0-9_], a letter first"
    )]
    Empty,
    /// Too long for topics, shared-memory names and sample headers.
    #[error("`{found}` has {} characters; a name has at most {NAME_BYTES_MAX}", found.len())]
    TooLong {
        /// The word as given.
        found: String,
    },
    /// A character that ROS 2 names do not know.
    #[error("`{found}` is not a ROS 2 name: `{character}` at {at}; allowed: [a-z][a-z0-9_]* without `__`{}", if *.dash { ", robots also `-`" } else { "" })]
    Character {
        /// The word as given.
        found: String,
        /// The character that is not allowed there.
        character: char,
        /// Its place, from 1.
        at: usize,
        /// Whether `-` is allowed in this kind of name.
        dash: bool,
    },
}

fn check(word: &str, dash: bool) -> Result<(), NameError> {
    if word.is_empty() {
        return Err(NameError::Empty);
    }
    if word.len() > NAME_BYTES_MAX {
        return Err(NameError::TooLong { found: word.to_string() });
    }
    let mut before = '_';
    for (index, character) in word.chars().enumerate() {
        let fine = match character {
            'a'..='z' => true,
            '0'..='9' => index > 0,
            '_' => index > 0 && before != '_',
            '-' => dash && index > 0,
            _ => false,
        };
        if !fine {
            let found = word.to_string();
            return Err(NameError::Character { found, character, at: index + 1, dash });
        }
        before = character;
    }
    Ok(())
}

/// A checked word in place: comparing and copying it touches nothing else.
///
/// Bytes behind its end are zero, which no name holds, so that order and equality of the
/// whole are those of the word.
#[derive(Clone)]
struct Word {
    bytes: [u8; NAME_BYTES_MAX],
    len: u8,
}

impl Word {
    /// `word`, which was checked and has at most [`NAME_BYTES_MAX`] bytes.
    fn of(word: &str) -> Self {
        let mut bytes = [0; NAME_BYTES_MAX];
        bytes[..word.len()].copy_from_slice(word.as_bytes());
        Self { bytes, len: u8::try_from(word.len()).expect("a name has at most 32 bytes") }
    }

    fn as_str(&self) -> &str {
        core::str::from_utf8(&self.bytes[..usize::from(self.len)]).expect("names are ASCII")
    }
}

/// Eight bytes at once: names are compared with every datagram.
impl Ord for Word {
    fn cmp(&self, other: &Self) -> Ordering {
        let (own, _) = self.bytes.as_chunks::<8>();
        let (others, _) = other.bytes.as_chunks::<8>();
        for (own, other) in own.iter().zip(others) {
            let order = u64::from_be_bytes(*own).cmp(&u64::from_be_bytes(*other));
            if order != Ordering::Equal {
                return order;
            }
        }
        Ordering::Equal
    }
}

impl PartialOrd for Word {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Word {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Word {}

impl Hash for Word {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.as_str().hash(state);
    }
}

/// Reads a name from any text.
struct WordVisitor<T>(PhantomData<T>);

impl<T: FromStr<Err = NameError>> Visitor<'_> for WordVisitor<T> {
    type Value = T;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a name")
    }

    fn visit_str<E: de::Error>(self, word: &str) -> Result<T, E> {
        word.parse().map_err(E::custom)
    }
}

macro_rules! name_type {
    ($(#[$doc:meta])* $name:ident, $dash:expr) => {
        $(#[$doc])*
        #[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub struct $name(Word);

        impl $name {
            /// The name `word`, when it is one.
            pub fn new(word: &str) -> Result<Self, NameError> {
                check(word, $dash)?;
                Ok(Self(Word::of(word)))
            }

            /// The name as text.
            pub fn as_str(&self) -> &str {
                self.0.as_str()
            }
        }

        impl TryFrom<String> for $name {
            type Error = NameError;

            fn try_from(word: String) -> Result<Self, NameError> {
                Self::new(&word)
            }
        }

        impl From<$name> for String {
            fn from(name: $name) -> Self {
                name.as_str().into()
            }
        }

        impl FromStr for $name {
            type Err = NameError;

            fn from_str(word: &str) -> Result<Self, NameError> {
                Self::new(word)
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.pad(self.as_str())
            }
        }

        impl fmt::Debug for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.debug_tuple(stringify!($name)).field(&self.as_str()).finish()
            }
        }

        impl Serialize for $name {
            fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                serializer.serialize_str(self.as_str())
            }
        }

        impl<'de> Deserialize<'de> for $name {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                deserializer.deserialize_str(WordVisitor(PhantomData))
            }
        }
    };
}

name_type!(
    /// A system, component or port: `[a-z][a-z0-9_]*` without `__`, at most
    /// [`NAME_BYTES_MAX`] bytes, so that it can stand in a ROS 2 topic.
    Name,
    false
);
name_type!(
    /// A robot's name: as [`Name`], and `-` is allowed; in topics `-` becomes `_`.
    RobotId,
    true
);

impl RobotId {
    /// The name as it stands in ROS 2 topics: `-` becomes `_`.
    pub fn topic_word(&self) -> String {
        self.as_str().replace('-', "_")
    }
}

/// Names one component over the whole fleet: (system, name, scope).
///
/// Scope is empty for one component over the fleet, or a robot for `for_each: robot`.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct ComponentKey {
    /// The system it belongs to.
    pub system: Name,
    /// Its name within the system.
    pub name: Name,
    /// The robot it is pinned to, for one copy on each robot.
    pub scope: Option<RobotId>,
}

impl ComponentKey {
    /// The one component `name` of `system` over the fleet.
    pub fn new(system: &Name, name: &Name) -> Self {
        Self { system: system.clone(), name: name.clone(), scope: None }
    }
}

impl fmt::Display for ComponentKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.system, self.name)?;
        match &self.scope {
            Some(robot) => write!(f, "@{robot}"),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use alloc::{vec, vec::Vec};

    use super::*;

    #[test]
    fn names_are_ros_2_names() {
        for good in ["a", "fisheye", "red_box2", "a_b_c"] {
            assert_eq!(Name::new(good).unwrap().as_str(), good);
        }
        for bad in ["", "Red", "2d", "_x", "a__b", "red-box", "a b", "ä"] {
            assert!(Name::new(bad).is_err(), "{bad:?}");
        }
        assert!(Name::new(&"a".repeat(33)).is_err());
        assert_eq!(RobotId::new("robot-1").unwrap().topic_word(), "robot_1");
        assert!(RobotId::new("-1").is_err());
    }

    #[test]
    fn names_are_ordered_as_their_words_are() {
        let mut words =
            vec!["a", "aa", "ab", "a_b", "robot1", "robot10", "robot2", "robot12345678901234"];
        let mut names: Vec<Name> = words.iter().map(|word| Name::new(word).unwrap()).collect();
        words.sort_unstable();
        names.sort_unstable();
        assert!(names.iter().map(Name::as_str).eq(words));
    }

    #[test]
    fn an_error_names_the_character_and_what_is_allowed() {
        let text = Name::new("red-box").unwrap_err().to_string();
        assert!(text.contains("`-` at 4") && text.contains("[a-z][a-z0-9_]*"), "{text}");
        assert!(!text.contains("robots also"), "{text}");
    }
}
