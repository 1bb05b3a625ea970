//! Who and what: robots, names, components.

use alloc::string::{String, ToString};
use core::{fmt, str::FromStr};

use serde::{Deserialize, Serialize};
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

macro_rules! name_type {
    ($(#[$doc:meta])* $name:ident, $dash:expr) => {
        $(#[$doc])*
        #[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
        #[serde(try_from = "String", into = "String")]
        pub struct $name(String);

        impl $name {
            /// The name `word`, when it is one.
            pub fn new(word: &str) -> Result<Self, NameError> {
                check(word, $dash)?;
                Ok(Self(word.to_string()))
            }

            /// The name as text.
            pub fn as_str(&self) -> &str {
                &self.0
            }
        }

        impl TryFrom<String> for $name {
            type Error = NameError;

            fn try_from(word: String) -> Result<Self, NameError> {
                check(&word, $dash)?;
                Ok(Self(word))
            }
        }

        impl From<$name> for String {
            fn from(name: $name) -> Self {
                name.0
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
                f.pad(&self.0)
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
        self.0.replace('-', "_")
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
    fn an_error_names_the_character_and_what_is_allowed() {
        let text = Name::new("red-box").unwrap_err().to_string();
        assert!(text.contains("`-` at 4") && text.contains("[a-z][a-z0-9_]*"), "{text}");
        assert!(!text.contains("robots also"), "{text}");
    }
}
