//! 36 numbers without a length, which `serde` does not do by itself.

use std::fmt;

use serde::{
    Deserializer, Serializer,
    de::{Error, SeqAccess, Visitor},
    ser::SerializeTuple,
};

pub(super) fn serialize<S: Serializer>(
    values: &[f64; 36],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let mut tuple = serializer.serialize_tuple(values.len())?;
    for value in values {
        tuple.serialize_element(value)?;
    }
    tuple.end()
}

pub(super) fn deserialize<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<[f64; 36], D::Error> {
    deserializer.deserialize_tuple(36, Numbers)
}

struct Numbers;

impl<'de> Visitor<'de> for Numbers {
    type Value = [f64; 36];

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("36 numbers")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut sequence: A) -> Result<[f64; 36], A::Error> {
        let mut values = [0.0; 36];
        for (index, value) in values.iter_mut().enumerate() {
            *value =
                sequence.next_element()?.ok_or_else(|| A::Error::invalid_length(index, &self))?;
        }
        Ok(values)
    }
}
